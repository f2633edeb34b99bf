"""How the shaft turns about its axis."""

import abc

import equinox as eqx

from .quantities import Scalar, real


class AbstractSpin(eqx.Module):
    """Law of rotation `theta(t)`; positive spin turns x into y."""

    speed: eqx.AbstractVar[Scalar]

    @abc.abstractmethod
    def constant(self) -> bool:
        """Whether the speed never changes, so that linear scenes have closed solutions."""


class ConstantSpeed(AbstractSpin):
    """Constant speed: `theta(t) = Omega t`."""

    speed: Scalar = real("speed [rad/s]")

    def constant(self) -> bool:
        return True
