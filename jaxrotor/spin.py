"""How the shaft turns about its axis."""

import equinox as eqx

from .quantities import Scalar, real


class AbstractSpin(eqx.Module):
    """Law of rotation `theta(t)`; positive spin turns x into y."""

    speed: eqx.AbstractVar[Scalar]


class ConstantSpeed(AbstractSpin):
    """Constant speed: `theta(t) = Omega t`."""

    speed: Scalar = real("speed [rad/s]")
