"""Crack: a transverse crack that opens and closes as the shaft turns under its weight."""

from collections.abc import Callable
from typing import Any, ClassVar, Literal, cast, get_args

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..core.extremes import larger
from ..core.lanes import computed_once
from ..core.plane import cosine_and_sine
from ..core.quantities import Number, Scalar, known, nonnegative, real
from ..shafts.hinge import hinge
from ..shafts.line import AbstractLine
from .base import AbstractContact, OwnPort
from .law import AbstractLaw, Branch, Hardness, Now, Plane


Breathing = Literal["mayes", "switch", "response"]
AHEAD = 1e-9  # angle by which a switch is seen in advance, so that a step may begin at it [rad]


class Crack(AbstractContact):
    """Breathing crack, whose weak axis `xi` turns with the shaft: at `angle` where `theta = 0`.

        F = f (S z + D e^(2 i psi) z*),   psi = angle + theta,   S, D = (loss +- loss_across) / 2
        T = -Im(z* F) + f' (loss xi^2 + loss_across eta^2) / 2,   xi + i eta = z e^(-i psi)

    The stiffness of the intact shaft is the shaft's own; `F` takes away what the crack loses of it, along
    `xi` and across, as far as it is open, `f` from 0 to 1. It opens on the side of `tension`, fixed in
    space, below under weight. By `breathing` "mayes" `f = (1 + cos(psi - tension)) / 2`, by "switch" it
    is 1 where that cosine is positive, else 0, and by "response" it is 1 where `xi` is positive, which
    is for cracks without `loss_across`.

    A flexible shaft takes `compliance` and `compliance_across` in place of losses: the open crack is a
    hinge, whose jump of slope is `f compliance M` of the bending moment `M` there, along both axes. With
    `t` the deflection by a jump of one and `K` the stiffness of the intact shaft,

        M = M_0 / (1 + f compliance t'K t),   M_0 = t'K q,   K q - K t f compliance M = loads

    so a closed crack leaves the shaft as it is, and `xi` above stands for that of `M_0`. The station is
    then the end of two spans; the error falls with the third power of `nodes`.

    A switched `f(theta)` has no balance of energy, in the turning axes "response" has one. Where `f`
    jumps or bends, located steps end. Harmonic balance takes "mayes" alone; it finds a bounded motion
    also where that is unstable, so look at the multipliers of `jaxrotor.periodic`.
    Source: Mayes, Davies (1984); Gasch (1993); Dimarogonas (1996); the torque: virtual work.
    """

    kind: ClassVar[str] = "crack"
    plural: ClassVar[str] = "cracks"
    holds_shaft: ClassVar[bool] = False

    at: Scalar = nonnegative("at [m]")
    loss: Scalar | None = nonnegative("loss [N/m]", default=None)  # along the weak axis
    loss_across: Scalar | None = nonnegative("loss_across [N/m]", default=None)
    compliance: Scalar | None = nonnegative("compliance [rad/(N m)]", default=None)  # likewise
    compliance_across: Scalar | None = nonnegative("compliance_across [rad/(N m)]", default=None)
    angle: Scalar = real("angle [rad]", default=0.0)  # of the weak axis at theta = 0
    tension: Scalar = real("tension [rad]", default=-np.pi / 2)  # direction of the side that opens
    breathing: Breathing = eqx.field(default="mayes", static=True)  # how it opens, see above
    on: ClassVar[None] = None  # it is in the shaft itself

    def __check_init__(self):
        if self.breathing not in get_args(Breathing):
            raise ValueError(
                f'`breathing` must be "mayes", "switch" or "response", but is {self.breathing!r}.'
            )
        weak, across = self._numbers
        other = self.loss_across if self.hinged else self.compliance_across
        if weak is None or self.loss is not None and self.hinged or other is not None:
            raise ValueError(
                "A crack needs either `loss [N/m]`, with `loss_across` if any, or `compliance "
                "[rad/(N m)]`, with `compliance_across` if any."
            )
        split = self.breathing == "response" and across is not None
        if split and known(across) and float(cast(Any, across)) > 0:
            name = "compliance_across" if self.hinged else "loss_across"
            raise ValueError(
                f"A crack that opens by its response has no `{name}`, but it is "
                f"{float(cast(Any, across)):g}: the force across would jump where the crack opens, and "
                'energy would appear from nowhere; leave it out, or take `breathing = "mayes"`.'
            )

    @property
    def hinged(self) -> bool:
        return self.compliance is not None

    @property
    def _numbers(self) -> tuple[Scalar | None, Scalar | None]:
        """Losses, or compliances, along the weak axis and across."""
        if self.hinged:
            return self.compliance, self.compliance_across
        return self.loss, self.loss_across

    @property
    def own_port(self) -> Callable[[AbstractLine], OwnPort] | None:
        return self._as_hinge if self.hinged else None

    def _as_hinge(self, line: AbstractLine) -> OwnPort:
        row, column, stiffness = hinge(line, self.at)
        return OwnPort(row, column, self.law_within(stiffness))

    def law(self) -> "CrackLaw":
        return self.law_within(None)

    def law_within(self, stiffness: Scalar | None) -> "CrackLaw":
        """The law of a hinge in a line of a stiffness [N m] against a jump of slope; None: of a loss."""
        weak, across = self._numbers
        return CrackLaw(
            weak=cast(Any, weak),
            across=None if self.breathing == "response" else across,
            stiffness=stiffness,
            angle=self.angle,
            tension=self.tension,
            breathing=self.breathing,
        )


class CrackLaw(AbstractLaw):
    """Law of a `Crack`; of a hinge the displacement is `M_0` [N m], and the force the jump of slope."""

    clock: ClassVar = "revolution"

    weak: Scalar  # loss [N/m], or compliance [rad/(N m)], along the weak axis
    across: Scalar | None  # the same across it
    stiffness: Scalar | None  # of the intact line against a jump of slope [N m]; None: no hinge
    angle: Scalar  # of the weak axis at theta = 0 [rad]
    tension: Scalar  # [rad]
    breathing: Breathing = eqx.field(static=True)

    @property
    def elementwise(self) -> bool:
        return True

    @property
    def steep(self) -> bool:
        """Whether it is a hinge, whose jump moves all modes at once, also those too fast for the steps."""
        return self.stiffness is not None

    @property
    def kinked(self) -> bool:
        return self.breathing != "mayes"

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        return self._by(self._opening(displacement, now), displacement, now)

    def branch(self, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        return jnp.stack([self._opening(displacement, now)]) if self.kinked else jnp.zeros(0)

    def along(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        opening = branch[0] if self.kinked else self._opening(displacement, now)
        return self._by(opening, displacement, now)

    def margins(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        if not self.kinked:
            return jnp.zeros(0)
        switched = self.breathing == "switch"
        seen = jnp.cos(self._ahead(now)) if switched else self._turned(displacement, now)[2]
        return jnp.stack([(2 * branch[0] - 1) * seen])

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        """Also where a switch jumps, whose impulse is left out."""
        torque = displacement[1] * force[0] - displacement[0] * force[1]
        if self.kinked:
            return torque
        opening, rate = self._opening(displacement, now), -jnp.sin(self._ahead(now)) / 2
        _, _, *places = self._turned(displacement, now)
        for number, place in zip((self.weak, self.across), places, strict=True):
            if number is not None:
                if self.stiffness is not None:  # `M` in place of `M_0`
                    place = place * (1 - self.stiffness * self._open(number, opening))
                torque += rate * number * place**2 / 2
        return torque

    def hardness(self) -> Hardness:
        """The loss, or compliance, which is that of a hinge without the line about it."""
        lost = self.weak if self.across is None else larger(self.weak, self.across)
        return Hardness(lost, jnp.zeros_like(lost), jnp.zeros(2), jnp.zeros_like(lost))

    def clearance(self, displacement: Plane) -> Number:
        return -jnp.inf * jnp.ones(())

    def _ahead(self, now: Now) -> Number:
        """Angle of the weak axis from the side in tension [rad]."""
        return cast(Any, now.angle) + self.angle - self.tension

    def _turned(self, displacement: Plane, now: Now) -> tuple[Number, Number, Number, Number]:
        """Cosine and sine of the angle of the weak axis, displacements along it and across."""
        angle = cast(Any, now.angle) + self.angle
        cos, sin = computed_once(jnp.stack(cosine_and_sine(angle)))
        x, y = displacement
        return cos, sin, cos * x + sin * y, cos * y - sin * x

    def _opening(self, displacement: Plane, now: Now) -> Number:
        """How far the crack is open, from 0 to 1."""
        if self.breathing == "mayes":
            return (1 + jnp.cos(self._ahead(now))) / 2
        if self.breathing == "response":
            return jnp.where(self._turned(displacement, now)[2] > 0, 1.0, 0.0)
        soon = self._ahead(now) + AHEAD * jnp.sign(now.speed)
        return jnp.where(jnp.cos(soon) > 0, 1.0, 0.0)

    def _by(self, opening: Number, displacement: Plane, now: Now) -> Plane:
        """Force by the opening."""
        cos, sin, xi, eta = self._turned(displacement, now)
        along = self._open(self.weak, opening) * xi
        if self.across is None:
            return jnp.stack([along * cos, along * sin])
        across = self._open(self.across, opening) * eta
        return jnp.stack([along * cos - across * sin, along * sin + across * cos])

    def _open(self, number: Number, opening: Number) -> Number:
        """`f c` of a loss, or `f c / (1 + f c k)` of a compliance in a line of stiffness k."""
        opened = opening * number
        return opened if self.stiffness is None else opened / (1 + opened * self.stiffness)
