"""jaxrotor: differentiable rotor dynamics. Its public names are listed in `__init__.pyi`."""

import os
import sys

import lazy_loader


# Threads slow down linear algebra with matrices this small (a Campbell diagram takes 13 times as long on
# two cores). OpenBLAS reads the variable when it is first loaded; a value that is already set is kept.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Double precision, unless the environment sets JAX_ENABLE_X64=0. jax reads it when it is first loaded.
if "JAX_ENABLE_X64" not in os.environ:
    os.environ["JAX_ENABLE_X64"] = "1"
    if "jax" in sys.modules:
        sys.modules["jax"].config.update("jax_enable_x64", True)

# Every name is loaded at its first use, as jax alone takes half a second.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
