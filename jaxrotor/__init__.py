"""jaxrotor: differentiable rotor dynamics. What it has is listed in `__init__.pyi`."""

import os
import sys

import lazy_loader

from .earlier_names import keep_earlier_names


# Matrices this small lose by threads (a Campbell diagram takes 13 times as long on two cores); read
# when the linear algebra is first loaded, so a value of your own set before that stands.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Double precision; float32 is a choice, made in the environment. jax reads it when it is loaded.
if "JAX_ENABLE_X64" not in os.environ:
    os.environ["JAX_ENABLE_X64"] = "1"
    if "jax" in sys.modules:
        sys.modules["jax"].config.update("jax_enable_x64", True)

keep_earlier_names()

# Every name is loaded when it is first asked for: jax alone takes half a second.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
