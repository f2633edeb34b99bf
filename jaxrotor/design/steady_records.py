"""Records of steady motions: orbits, their spectra, and responses over speed or frequency."""

import abc
import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact

from ..analysis import (
    HarmonicForce,
    forced_response,
    growth_rate,
    unbalance_response,
    weight_response,
)
from ..core.checks import check_counts
from ..core.quantities import Series, known, series, with_values
from ..effects import AbstractBodies, AbstractContact, Unbalance
from ..equations.speed_tables import check_tables
from ..equations.start import AbstractStart
from ..equations.system import structure
from ..motion.rebounds import pilot_run
from ..motion.revolutions import check_constant_speed
from ..motion.simulate import simulate
from ..orbits import PeriodicOrbit, periodic
from ..scene import Scene
from .records import (
    AbstractRecord,
    angles,
    check_amplitudes,
    check_angles,
    check_directions,
    check_samples,
    read,
    table,
)


SETTLING = 100  # revolutions before the first search of an orbit
STEPS = 256  # in a revolution, by default


class AbstractSteadyRecord(AbstractRecord):
    """Record of a steady motion: in closed form, or of a scene with contact by `periodic`."""

    revolutions: eqx.AbstractVar[int]  # in a period
    at: eqx.AbstractVar[Any]
    guess: eqx.AbstractVar[Any]  # of the orbit of a scene with contact
    solver: eqx.AbstractVar[Any]
    steps_per_revolution: eqx.AbstractVar[int]

    @property
    @abc.abstractmethod
    def samples(self) -> int:
        """Number of displacements in a period from which the record is predicted."""

    @property
    def deciding(self):
        return []

    def prepared(self, scene: Scene) -> "AbstractSteadyRecord":
        self.check_channels(scene, self.at)
        check_constant_speed(scene, "A record of a steady motion")
        check_tables(scene)
        if scene.of(AbstractBodies):
            raise ValueError(
                "Balls have many steady positions, which an orbit does not determine; fit a `TimeRecord`."
            )
        return dataclasses.replace(self, guess=self._state(scene))

    def doubt(self, scene: Scene) -> str:
        if not scene.of(AbstractContact):
            growth = float(growth_rate(scene))
            if not growth > 0:
                return ""
            why = f"a free vibration grows by {growth:.3g} 1/s"
        else:
            orbit, _ = self._orbit(scene)
            if not bool(orbit.converged):
                return "no orbit is found with the fitted parameters; begin from another `guess`."
            if bool(orbit.stable):
                return ""
            why = f"a multiplier of modulus {float(np.abs(orbit.multipliers).max()):.3g}"
        return (
            f"its orbit is unstable with the fitted parameters ({why}), so it is not what was measured; "
            "begin elsewhere."
        )

    def displacements(self, scene: Scene) -> Array:
        """Displacements [m] at `samples` angles, evenly spaced over a period, (samples, c).

        They begin at angle zero; the end of the period is left out.
        """
        if scene.of(AbstractContact):
            orbit, step = self._orbit(scene)
            return orbit.displacement[:-1:step]
        angle = 2 * jnp.pi * self.revolutions * jnp.arange(self.samples)[:, None] / self.samples
        turn = jnp.exp(1j * angle)
        whirl = unbalance_response(scene, scene.spin.speed, self.at)
        z = whirl.forward * turn + whirl.backward / turn
        if not structure(scene).load.steady:
            return z
        bent = weight_response(scene, scene.spin.speed, self.at)
        return z + bent.deflection + bent.twice * turn**2

    @property
    def _options(self) -> dict[str, Any]:
        """Options of `periodic`."""
        options = {"revolutions": self.revolutions, "solver": self.solver, "at": self.at}
        return options | {"progress": False}

    def _state(self, scene: Scene) -> AbstractStart | None:
        """A state on the orbit of a scene with contact; None where there is a closed form."""
        if not scene.of(AbstractContact):
            return None
        guess = self.guess
        if guess is None:
            with pilot_run():
                guess = simulate(scene, SETTLING, STEPS, keep=1, at=self.at, progress=False)
        return self._found(scene, guess, steps_per_revolution=self.steps_per_revolution).start

    def _orbit(self, scene: Scene) -> tuple[PeriodicOrbit, int]:
        """The orbit of a scene with contact, converged or not, and its steps from sample to sample."""
        each = self.samples // self.revolutions
        step = -(-self.steps_per_revolution // each)
        steps = {"steps_per_revolution": each * step, "throw": False}
        return self._found(scene, self.guess, **steps), step

    def _found(self, scene: Scene, guess: Any, **options: Any) -> PeriodicOrbit:
        """The orbit near a guess; raises where it repeats with passes of balls, not with revolutions."""
        found = periodic(scene, guess, **self._options, **options)
        if found.passes:
            raise ValueError(
                "A record of an orbit is over revolutions, but without unbalance this scene repeats with "
                "the passes of the balls in its bearings; fit a `TimeRecord`."
            )
        return found


class OrbitRecord(AbstractSteadyRecord):
    """`z(phi_k)`, `phi_k = 2 pi n k / T`: a synchronous or periodic orbit [m], (T,) or (T, c).

    `T` samples are evenly spaced by the angle of rotation over a period of `n` revolutions, from angle
    zero on, the end left out. A linear scene answers in closed form, one with contact by `periodic`, from
    the orbit at the scene's own values. `Fitted.cautions` tells where the fitted orbit is unstable.

    Args:
        displacement: x + i y of every channel [m], or the readings of probes, real.
        revolutions: in a period; a whole number of samples in each.
        at: station(s) [m], one a channel; by default as in `simulate`.
        angle: direction(s) of probes from x to y [rad], one a channel.
        guess: of the orbit of a scene with contact, as in `periodic`; by default the end of 100
            revolutions.
        solver: as in `periodic`.
        steps_per_revolution: of contact, at least.
    """

    kind: ClassVar[str] = "plane"
    offset: ClassVar[bool] = False
    name: ClassVar[str] = "revolutions"
    unit: ClassVar[str] = "1"

    # x + i y, or read by probes [m]
    displacement: Inexact[Array, "T c"] = eqx.field(converter=table)
    revolutions: int = eqx.field(default=1, static=True)
    at: Any = None
    angle: Float[Array, " c"] | None = eqx.field(default=None, converter=angles)
    guess: Any = None
    solver: Any = None
    steps_per_revolution: int = eqx.field(default=STEPS, static=True)  # of contact, at least

    def __check_init__(self):
        check_directions(self.displacement, self.angle)
        check_counts(revolutions=self.revolutions, steps_per_revolution=self.steps_per_revolution)
        if len(self.displacement) % self.revolutions:
            raise ValueError(
                f"An orbit of {self.revolutions} revolutions must have a whole number of samples in "
                f"each, but has {len(self.displacement)}."
            )

    @property
    def measured(self):
        return self.displacement

    @property
    def abscissa(self):
        count = len(self.displacement)
        return jnp.arange(count) * self.revolutions / count

    @property
    def samples(self) -> int:
        return len(self.displacement)

    def prediction(self, scene: Scene):
        return read(self.displacements(scene), self.angle)


class SpectrumRecord(AbstractSteadyRecord):
    """`c_k` of `z = sum_k c_k exp(i k phi)`: spectrum of a steady motion by orders [m], (T,) or (T, c).

    Positive orders are forward, negative ones backward; a real record is `|c_k|`, whose noise must be well
    below it. Orders are multiples of `1 / revolutions`.

    Args:
        amplitude: of every order and channel [m], complex with its phase, or real without.
        orders: of the speed of rotation, one a sample.
        revolutions: in a period.
        at: station(s) [m], one a channel; by default as in `simulate`.
        guess: of the orbit of a scene with contact, as in `periodic`; by default the end of 100
            revolutions.
        solver: as in `periodic`.
        steps_per_revolution: of contact, at least.
    """

    kind: ClassVar[str] = "amplitude"
    offset: ClassVar[bool] = False
    name: ClassVar[str] = "order"
    unit: ClassVar[str] = "1"

    amplitude: Inexact[Array, "T c"] = eqx.field(converter=table)  # with its phase, or without [m]
    orders: Series = series("orders [1]", least=1)
    revolutions: int = eqx.field(default=1, static=True)
    at: Any = None
    guess: Any = None
    solver: Any = None
    steps_per_revolution: int = eqx.field(default=STEPS, static=True)  # in all

    def __check_init__(self):
        check_counts(revolutions=self.revolutions, steps_per_revolution=self.steps_per_revolution)
        check_samples(self.amplitude, self.orders, "orders")
        check_amplitudes(self.amplitude)
        if known(self.orders) and np.max(np.abs(self.orders)) >= STEPS / 2:
            raise ValueError(
                f"`orders` must be below {STEPS // 2}, as a revolution has {STEPS} samples, but one is "
                f"{float(np.max(np.abs(self.orders))):g}."
            )
        turns = self.revolutions * np.asarray(self.orders) if known(self.orders) else np.zeros(1)
        if np.max(np.abs(turns - np.round(turns))) > 1e-9:
            raise ValueError(
                f"`orders` must be multiples of 1 / {self.revolutions}, as a motion of "
                f"{self.revolutions} revolutions has no others; give `revolutions`."
            )

    @property
    def measured(self):
        return self.amplitude

    @property
    def abscissa(self):
        return self.orders

    @property
    def samples(self) -> int:
        return STEPS * self.revolutions

    def prediction(self, scene: Scene):
        angle = 2 * jnp.pi * jnp.arange(self.samples) / STEPS
        waves = jnp.exp(-1j * self.orders[:, None] * angle) / self.samples
        found = waves @ self.displacements(scene)
        return found if jnp.iscomplexobj(self.amplitude) else jnp.abs(found)


def _checked_force(force: Any) -> Any:
    """The force of a response; raise unless it is one, or None."""
    if not isinstance(force, HarmonicForce | None):
        raise ValueError(
            "`force` must be a `HarmonicForce`, or None for the response to unbalance, but is "
            f"{force!r:.200}."
        )
    return force


def _trial_masses(value: Any) -> Any:
    """Trial masses of every sample as complex numbers; None where there are none."""
    return value if value is None or not known(value) else table(value).astype(complex)


class ResponseRecord(AbstractRecord):
    """`z = a exp(i w t) + b exp(-i w t)`: a response over speed or frequency [m], (T,) or (T, c).

    A channel without an `angle` is the forward amplitude `a`, one with it that of a probe,
    `a exp(-i psi) + b* exp(i psi)`. A real record is the amplitude alone, whose noise must be well below
    it.

    Args:
        amplitude: of every speed and channel [m], complex with its phase, or real without.
        frequencies: speeds Omega [rad/s] of the response to unbalance, or frequencies w of the force.
        at: station(s) [m], paths of stations that are fitted, `"discs.2.at"`, or names of casings, one a
            channel; by default as in `unbalance_response` or `forced_response`.
        angle: direction(s) of probes from x to y [rad], one a channel.
        force: by which the rotor is excited at its own speed; None: by its unbalance.
        trials: `m r exp(i angle)` [kg m] of each `Unbalance` of the scene in every sample, in place of its
            own moment, as of runs with trial masses, (T, u). Its `phase` is added to the angle: that of
            the mark from which angles are counted may be a parameter.
        offset: whether every channel has a constant besides, such as runout, or drift since a baseline
            that was taken off. It is the same in all samples, and taken off what is fitted.
    """

    kind: ClassVar[str] = "amplitude"
    unit: ClassVar[str] = "rad/s"

    amplitude: Inexact[Array, "T c"] = eqx.field(converter=table)  # with its phase, or without [m]
    frequencies: Series = series("frequencies [rad/s]", least=1)
    at: Any = None
    angle: Float[Array, " c"] | None = eqx.field(default=None, converter=angles)
    force: HarmonicForce | None = eqx.field(default=None, converter=_checked_force)
    # Of each unbalance in every sample [kg m]
    trials: Complex[Array, "T u"] | None = eqx.field(default=None, converter=_trial_masses)
    offset: bool = eqx.field(default=False, static=True)  # whether channels have a constant besides

    def __check_init__(self):
        check_samples(self.amplitude, self.frequencies, "frequencies")
        check_angles(self.amplitude, self.angle)
        check_amplitudes(self.amplitude)
        if self.offset and (not jnp.iscomplexobj(self.amplitude) or len(self.amplitude) < 2):
            raise ValueError(
                "A constant is taken off amplitudes with their phase, of two samples or more; leave out "
                "`offset`."
            )
        if self.trials is not None and (
            self.force is not None or len(self.trials) != len(self.amplitude)
        ):
            raise ValueError(
                f"`trials [kg m]` are masses of every sample of a response to unbalance, but there are "
                f"{len(self.trials)} rows of them for {len(self.amplitude)} samples"
                f"{'' if self.force is None else ' of a response to a force'}."
            )

    @property
    def name(self) -> str:
        return "speed" if self.force is None else "frequency"

    @property
    def measured(self):
        return self.amplitude

    @property
    def abscissa(self):
        return self.frequencies

    @property
    def _stations(self) -> Any:
        return self.force.at if self.at is None and self.force is not None else self.at

    @property
    def deciding(self):
        return [] if self.force is None else [self.force.at]

    def prepared(self, scene: Scene) -> "ResponseRecord":
        self.check_channels(scene, self._stations)
        check_tables(scene, self.frequencies if self.force is None else None)
        count = len(scene.of(Unbalance))
        if self.trials is not None and self.trials.shape[1] != count:
            raise ValueError(
                f"`trials [kg m]` must have a column for every `Unbalance` of the scene, of which there "
                f"are {count}, but has {self.trials.shape[1]}; put one where each trial mass sits."
            )
        return self

    def doubt(self, scene: Scene) -> str:
        del scene
        return ""

    def prediction(self, scene: Scene):
        if self.trials is not None:
            every = jax.vmap(
                lambda *case: unbalance_response(_tried(scene, case[0]), case[1], self.at)
            )
            found = jax.tree.map(lambda part: part[:, 0], every(self.trials, self.frequencies))
        elif self.force is None:
            found = unbalance_response(scene, self.frequencies, self.at)
        else:
            found = forced_response(scene, self.frequencies, self.force, self.at)
        a = found.forward if self.angle is None else found.probe(self.angle)
        return a if jnp.iscomplexobj(self.amplitude) else jnp.abs(a)


def _tried(scene: Scene, masses: Complex[Array, " u"]) -> Scene:
    """The scene with these moments of its unbalances, at angles from their phases."""
    each = iter(masses)
    of = lambda one, u: with_values(
        one, mass=None, eccentricity=None, moment=jnp.abs(u), phase=one.phase + jnp.angle(u)
    )
    own = [of(one, next(each)) if isinstance(one, Unbalance) else one for one in scene.effects]
    return with_values(scene, effects=tuple(own))
