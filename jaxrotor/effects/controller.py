"""Controller of a magnetic bearing: from the displacement at a sensor to the current of its coils."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.quantities import Number, Scalar, known
from .law import Plane


class Controller(eqx.Module):
    """`x. = A x + b y`, `u = -(c x + d y + g y.)` of each axis: wanted current [A] by a displacement [m].

    `x` are `m` states. All numbers may have lanes last.
    """

    a: Float[Array, "m m ..."]
    b: Float[Array, "m ..."]
    c: Float[Array, "m ..."]
    d: Number
    g: Number | None  # None: the velocity is not read
    names: tuple[str, ...] = eqx.field(static=True)  # of the states, with units

    @classmethod
    def of(cls, bearing: Any) -> "Controller":
        """That of a bearing: PID, or one of its own by a transfer function."""
        if bearing.numerator is not None:
            return _of_fraction(bearing.numerator, bearing.denominator)
        poles, entries, exits, names = [], [], [], []
        d, g = bearing.kp, bearing.kd
        if bearing.ki is not None:
            poles, entries, exits, names = [0.0], [bearing.ki], [1.0], ["integral [A]"]
        if bearing.filter is not None:
            # kd p / (1 + filter p) = (kd / filter) (1 - 1 / (1 + filter p))
            gain, rate, g = bearing.kd / bearing.filter, 1 / bearing.filter, None
            d = d + gain
            poles, names = [*poles, -rate], [*names, "filtered [A]"]
            entries, exits = [*entries, gain * rate], [*exits, -1.0]
        column = lambda numbers: jnp.stack([jnp.asarray(one, float) for one in numbers])
        none = jnp.zeros(0)
        b, c, diagonal = (column(part) if names else none for part in (entries, exits, poles))
        return cls(jnp.diag(diagonal), b, c, jnp.asarray(d), g, tuple(names))

    def command(self, x: Float[Array, "m 2 ..."], place: Plane, velocity: Plane) -> Plane:
        """Wanted current `u` of both axes [A]."""
        found = self.d * place
        if self.names:
            found = found + jnp.sum(self.c[:, None] * x, axis=0)
        return -(found if self.g is None else found + self.g * velocity)

    def rates(self, x: Float[Array, "m 2 ..."], place: Plane) -> Float[Array, "m 2 ..."]:
        """Rates of the states of both axes."""
        return jnp.sum(self.a[:, :, None] * x, axis=1) + self.b[:, None] * place


def _of_fraction(numerator: Array, denominator: Array) -> Controller:
    """`-u / y = (n_0 p^m + .. + n_m) / (p^m + .. + d_m)`, each state the integral of the one before it.

    Time is in units of a mean of the poles, so that the numbers of fast ones are of one size.
    """
    m = denominator.size - 1
    monic = denominator / denominator[0]
    above = jnp.concatenate([jnp.zeros(m + 1 - numerator.size), numerator]) / denominator[0]
    rest = above[1:] - above[0] * monic[1:]
    last = jnp.abs(monic[-1])
    rate = jnp.where(last > 0, jnp.where(last > 0, last, 1.0) ** (1 / max(m, 1)), 1.0)
    scale = rate ** -jnp.arange(1.0, m + 1)
    a = rate * (jnp.eye(m, k=-1).at[:1].set(-monic[1:] * scale) if m else jnp.zeros((0, 0)))
    b = rate * jnp.eye(m, 1)[:, 0]
    names = tuple(f"controller_{i} [m]" for i in range(m))
    return Controller(a, b, rest * scale, above[0], None, names)


def check_controller(bearing: Any, least: Scalar | None) -> None:
    """Raise unless a bearing has one controller, with a gain above `least` [A/m] where that is known."""
    own = bearing.numerator, bearing.denominator
    pid = bearing.kp, bearing.ki, bearing.kd, bearing.filter
    if any(part is not None for part in own):
        if any(part is None for part in own) or any(part is not None for part in pid):
            raise ValueError(
                "A controller is given by `kp`, and `ki`, `kd` and `filter` where it has them, or by both "
                "`numerator` and `denominator`; give one of the two."
            )
        _check_fraction(*own)
        return
    if bearing.kp is None:
        raise ValueError(
            "A magnetic bearing needs a controller; give `kp [A/m]`, or `numerator` and `denominator`."
        )
    if bearing.filter is not None and bearing.kd is None:
        raise ValueError(
            "`filter [s]` is that of `kd [A s/m]`, which is absent; give both or neither."
        )
    if (
        known(bearing.kp)
        and known(least)
        and least is not None
        and float(bearing.kp) <= float(least)
    ):
        raise ValueError(
            f"`kp [A/m]` must be above {float(least):g}, the negative stiffness over the force per "
            f"ampere, or the shaft is pulled to a coil, but is {float(bearing.kp):g}."
        )


def _check_fraction(numerator: Array, denominator: Array) -> None:
    """Raise unless a transfer function has a bounded gain at high frequencies."""
    if numerator.size > denominator.size:
        raise ValueError(
            "`numerator` must not be of a higher degree than `denominator`, but they are of "
            f"{numerator.size - 1} and {denominator.size - 1}; add a pole, such as that of a filter."
        )
    if known(denominator) and denominator[0] == 0:
        raise ValueError("`denominator` begins with its highest power, which must not be 0.")
