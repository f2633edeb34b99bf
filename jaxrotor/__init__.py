"""jaxrotor: differentiable rotor dynamics."""

import os

import jax


if "JAX_ENABLE_X64" not in os.environ:  # float32 is a choice, made in the environment
    jax.config.update("jax_enable_x64", True)

from .effects import (  # noqa: E402
    Disc as Disc,
    DiscDamping as DiscDamping,
    ExternalDamping as ExternalDamping,
    Gravity as Gravity,
    InternalDamping as InternalDamping,
    Limiter as Limiter,
    Unbalance as Unbalance,
)
from .materials import Material as Material, steel as steel  # noqa: E402
from .scene import Scene as Scene  # noqa: E402
from .shafts import FlexibleShaft as FlexibleShaft  # noqa: E402
from .spin import ConstantSpeed as ConstantSpeed  # noqa: E402
from .system import System as System, assemble as assemble  # noqa: E402
