"""Records: what was measured on a rotor, and how a scene predicts it."""

import abc
import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..analysis import HarmonicForce, forced_response, unbalance_response, weight_response
from ..core.checks import check_counts
from ..core.quantities import Series, known, series
from ..core.representation import AbstractPart
from ..effects import AbstractContact
from ..effects.base import AbstractEffect
from ..equations.start import AbstractStart, AtRest, Continued, Launch
from ..equations.system import structure
from ..motion.simulate import simulate
from ..orbits import periodic
from ..scene import Scene
from ..solvers.exponential import Exponential


SETTLING = 100  # revolutions before the first search of an orbit
STEPS = 256  # of contact in a revolution, at least


def _table(value: Any) -> Any:
    """Measured numbers by sample and channel; one channel may be given as a list."""
    if not known(value):
        return value
    array = np.asarray(value)
    if array.dtype.kind not in "iufc" or array.ndim not in (1, 2) or not array.size:
        raise ValueError(
            "A record must be numbers by sample, or by sample and channel, but has shape "
            f"{array.shape} and type {array.dtype}."
        )
    table = jnp.asarray(array.astype(complex if array.dtype.kind == "c" else float))
    bad = np.flatnonzero(~np.isfinite(array.reshape(array.shape[0], -1)).all(axis=1))
    if bad.size:
        raise ValueError(
            f"A record must have finite numbers, but sample {bad[0]} is "
            f"{array[bad[0]].tolist()} ({bad.size} of {len(array)} samples are not finite); leave "
            "such samples out, or cut the record before them."
        )
    return table.reshape(array.shape[0], -1)


def _angles(value: Any) -> Any:
    return None if value is None else jnp.atleast_1d(jnp.asarray(value, float))


class AbstractRecord(AbstractPart):
    """Numbers that were measured by sample and channel, and their prediction from a scene."""

    kind: eqx.AbstractClassVar[str]  # how it is drawn: over samples, in the plane, by amplitude
    name: eqx.AbstractClassVar[str]  # of the numbers at which samples were taken
    unit: eqx.AbstractClassVar[str]

    @property
    @abc.abstractmethod
    def measured(self) -> Inexact[Array, "T c"]:
        """The measured numbers [m]."""

    @property
    @abc.abstractmethod
    def abscissa(self) -> Float[Array, " T"]:
        """Where the samples were taken."""

    @abc.abstractmethod
    def prediction(self, scene: Scene) -> Inexact[Array, "T c"]:
        """The same numbers as a scene has them."""

    @abc.abstractmethod
    def prepared(self, scene: Scene) -> "AbstractRecord":
        """The record with all that has to be found before values are traced; checked against a scene."""

    def residuals(self, scene: Scene) -> Float[Array, "T d"]:
        """Prediction less measurement, of complex numbers first real, then imaginary parts."""
        off = self.prediction(scene) - self.measured
        return jnp.concatenate([off.real, off.imag], axis=1) if jnp.iscomplexobj(off) else off

    def _check_channels(self, scene: Scene, at: Any, angle: Any) -> None:
        """Raise unless every channel has its station, and its direction where numbers are real."""
        count = scene.stations(at).size
        if self.measured.shape[1] != count:
            raise ValueError(
                f"The record has {self.measured.shape[1]} channels, but `at` names {count} stations; "
                "name the station of every channel, one twice if two probes are there."
            )
        if angle is not None and angle.size not in (1, count):
            raise ValueError(
                f"`angle` has {angle.size} directions for {count} channels; give one for every channel."
            )


class Begun(AbstractEffect):
    """The start of a record as a member of its scene, so that its numbers are parameters."""

    kind: ClassVar[str] = "start"
    plural: ClassVar[str] = "starts"

    shaft: AbstractStart


def _read(z: Array, angle: Array | None) -> Array:
    """Displacements (T, c), complex, or along probes `Re z exp(-i psi)`."""
    return z if angle is None else (z * jnp.exp(-1j * angle)).real


def _check_directions(measured: Array, angle: Array | None) -> None:
    """Raise unless displacements are complex or along probes."""
    if jnp.iscomplexobj(measured) == (angle is None):
        return
    raise ValueError(
        "Displacements must be complex, x + i y, or real with the `angle` of every probe, but are "
        + ("real without one." if angle is None else "complex and have one.")
    )


class TimeRecord(AbstractRecord):
    """`z(t_k)` or, of probes, `Re z(t_k) exp(-i psi)`: displacement in time [m], (T,) or (T, c).

    Samples are evenly spaced over whole `revolutions` of constant speed, both ends included, or at `times`.

    Args:
        displacement: x + i y of every channel [m], or the readings of probes, real.
        revolutions: length of the record from angle zero, `T - 1` intervals of samples.
        times: of the samples [s] in place of revolutions, ascending from the start.
        at: station(s) [m], one a channel; by default as in `simulate`.
        angle: direction(s) of probes from x to y [rad], one a channel.
        start: state in which the motion begins, by default at rest. Its numbers may be fitted: those of
            `Whirl(..)` are `start.shaft.radius`, `start.shaft.rate` and `start.shaft.angle`.
        substeps: steps from sample to sample of a record by revolutions; more where contact is stiff.
        solver: as of `simulate`; by revolutions with contact by default `Exponential(4, located=True)`.
    """

    kind: ClassVar[str] = "samples"

    displacement: Inexact[Array, "T c"] = eqx.field(converter=_table)
    revolutions: int | None = eqx.field(default=None, static=True)
    times: Series | None = series("times [s]", ascending=True, nonnegative=True, default=None)
    at: Any = None
    angle: Float[Array, " c"] | None = eqx.field(default=None, converter=_angles)
    start: AbstractStart = eqx.field(default_factory=AtRest)
    substeps: int = eqx.field(default=4, static=True)
    solver: Any = None

    def __check_init__(self):
        _check_directions(self.displacement, self.angle)
        if (self.revolutions is None) == (self.times is None):
            raise ValueError("A time record needs `revolutions` or `times`, one of the two.")
        count = len(self.displacement)
        if self.times is not None:
            if self.times.size != count:
                raise ValueError(f"The record has {count} samples, but {self.times.size} `times`.")
            return
        check_counts(revolutions=self.revolutions, substeps=self.substeps)
        if count == 1 or (count - 1) % self.revolutions:
            raise ValueError(
                f"A record of {self.revolutions} revolutions must have a whole number of samples in "
                f"each and one at the end, but has {count}; leave some out, or give `times`."
            )

    @property
    def name(self) -> str:
        return "time" if self.revolutions is None else "revolutions"

    @property
    def unit(self) -> str:
        return "s" if self.revolutions is None else "1"

    @property
    def measured(self):
        return self.displacement

    @property
    def abscissa(self):
        if self.revolutions is None:
            return self.times
        return jnp.linspace(0.0, self.revolutions, len(self.displacement))

    def prepared(self, scene: Scene) -> "TimeRecord":
        self._check_channels(scene, self.at, self.angle)
        return self

    def prediction(self, scene: Scene):
        run = {"at": self.at, "start": self._start(scene), "solver": self.solver}
        if self.solver is None and self.times is None and scene.of(AbstractContact):
            run["solver"] = Exponential(4, located=True)  # plain steps leave kinks in residuals
        if self.revolutions is None:
            motion = simulate(scene, times=self.times, **run, progress=False)
            return _read(motion.displacement, self.angle)
        steps = (len(self.displacement) - 1) // self.revolutions * self.substeps
        motion = simulate(scene, self.revolutions, steps, **run, progress=False)
        return _read(motion.displacement[:: self.substeps], self.angle)

    def _start(self, scene: Scene) -> AbstractStart:
        """The record's own start, or the one whose numbers are parameters."""
        begun = scene.of(Begun)
        if not begun:
            return self.start
        if isinstance(self.start, Launch):
            return dataclasses.replace(self.start, shaft=begun[0].shaft)
        return begun[0].shaft


class _Steady(eqx.Module):
    """The steady motion of a scene over a period, evenly sampled by the angle of rotation."""

    revolutions: int = eqx.field(static=True)
    at: Any
    solver: Any
    guess: Any

    def found(self, scene: Scene) -> AbstractStart | None:
        """A state on the orbit of a scene with contact; None where there is a closed form."""
        if not scene.of(AbstractContact):
            return None
        guess = self.guess
        if guess is None:
            guess = simulate(scene, SETTLING, STEPS, keep=1, at=self.at, progress=False)
        options = {"revolutions": self.revolutions, "solver": self.solver, "at": self.at}
        return periodic(scene, guess, **options, progress=False).start

    def samples(self, scene: Scene, count: int) -> Array:
        """Displacements [m] at `count` samples from angle zero, (count, c), the period's end left out."""
        if scene.of(AbstractContact):
            each, rest = divmod(count, self.revolutions)
            step = -(-STEPS // each)
            options = {"revolutions": self.revolutions, "solver": self.solver, "at": self.at}
            options |= {"steps_per_revolution": each * step, "throw": False, "progress": False}
            return periodic(scene, self.guess, **options).displacement[:-1:step]
        angle = 2 * jnp.pi * self.revolutions * jnp.arange(count)[:, None] / count
        turn = jnp.exp(1j * angle)
        whirl = unbalance_response(scene, scene.spin.speed, self.at)
        z = whirl.forward * turn + whirl.backward / turn
        if structure(scene).load.constant is None:
            return z
        bent = weight_response(scene, scene.spin.speed, self.at)
        return z + bent.deflection + bent.twice * turn**2


def _prepared_steady(record: Any, scene: Scene, angle: Array | None) -> Any:
    """A record of a steady motion with a guess of the orbit, checked against the scene."""
    record._check_channels(scene, record.at, angle)
    steady = record.steady
    return dataclasses.replace(record, guess=steady.found(scene))


class OrbitRecord(AbstractRecord):
    """`z(phi_k)`, `phi_k = 2 pi n k / T`: a synchronous or periodic orbit [m], (T,) or (T, c).

    `T` samples are evenly spaced by the angle of rotation over a period of `n` revolutions, from angle zero
    on, the end left out. A linear scene answers in closed form, one with contact by `periodic`, from the
    orbit at the scene's own values.

    Args:
        displacement: x + i y of every channel [m], or the readings of probes, real.
        revolutions: in a period; a whole number of samples in each.
        at: station(s) [m], one a channel; by default as in `simulate`.
        angle: direction(s) of probes from x to y [rad], one a channel.
        guess: of the orbit of a scene with contact, as of `periodic`; by default the end of 100 revolutions.
        solver: as of `periodic`.
    """

    kind: ClassVar[str] = "plane"
    name: ClassVar[str] = "revolutions"
    unit: ClassVar[str] = "1"

    displacement: Inexact[Array, "T c"] = eqx.field(converter=_table)
    revolutions: int = eqx.field(default=1, static=True)
    at: Any = None
    angle: Float[Array, " c"] | None = eqx.field(default=None, converter=_angles)
    guess: Any = None
    solver: Any = None

    def __check_init__(self):
        _check_directions(self.displacement, self.angle)
        check_counts(revolutions=self.revolutions)
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
    def steady(self) -> _Steady:
        return _Steady(self.revolutions, self.at, self.solver, self.guess)

    def prepared(self, scene: Scene) -> "OrbitRecord":
        return _prepared_steady(self, scene, self.angle)

    def prediction(self, scene: Scene):
        return _read(self.steady.samples(scene, len(self.displacement)), self.angle)


class SpectrumRecord(AbstractRecord):
    """`c_k` of `z = sum_k c_k exp(i k phi)`: the spectrum of a steady motion by orders [m], (T,) or (T, c).

    Positive orders are forward, negative ones backward; a real record is `|c_k|`, whose noise must be well
    below it. Orders are multiples of `1 / revolutions`.

    Args:
        amplitude: of every order and channel [m], complex with its phase, or real without.
        orders: of the speed of rotation, one a sample.
        revolutions: in a period.
        at: station(s) [m], one a channel; by default as in `simulate`.
        guess: of the orbit of a scene with contact, as of `periodic`; by default the end of 100 revolutions.
        solver: as of `periodic`.
    """

    kind: ClassVar[str] = "amplitude"
    name: ClassVar[str] = "order"
    unit: ClassVar[str] = "1"

    amplitude: Inexact[Array, "T c"] = eqx.field(converter=_table)
    orders: Series = series("orders [1]", least=1)
    revolutions: int = eqx.field(default=1, static=True)
    at: Any = None
    guess: Any = None
    solver: Any = None

    def __check_init__(self):
        check_counts(revolutions=self.revolutions)
        _check_samples(self.amplitude, self.orders, "orders")
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
    def steady(self) -> _Steady:
        return _Steady(self.revolutions, self.at, self.solver, self.guess)

    def prepared(self, scene: Scene) -> "SpectrumRecord":
        return _prepared_steady(self, scene, None)

    def prediction(self, scene: Scene):
        count = STEPS * self.revolutions
        angle = 2 * jnp.pi * jnp.arange(count) / STEPS
        waves = jnp.exp(-1j * self.orders[:, None] * angle) / count
        found = waves @ self.steady.samples(scene, count)
        return found if jnp.iscomplexobj(self.amplitude) else jnp.abs(found)


class ResponseRecord(AbstractRecord):
    """`z = a exp(i w t) + b exp(-i w t)`: a response over speed or frequency [m], (T,) or (T, c).

    A channel without an `angle` is the forward amplitude `a`, one with it that of a probe,
    `a exp(-i psi) + b* exp(i psi)`. A real record is the amplitude alone, whose noise must be well below it.

    Args:
        amplitude: of every speed and channel [m], complex with its phase, or real without.
        frequencies: speeds Omega [rad/s] of the response to unbalance, or frequencies w of the force.
        at: station(s) [m], one a channel; by default as in `unbalance_response` or `forced_response`.
        angle: direction(s) of probes from x to y [rad], one a channel.
        force: by which the rotor is excited at its own speed; None: by its unbalance.
    """

    kind: ClassVar[str] = "amplitude"
    unit: ClassVar[str] = "rad/s"

    amplitude: Inexact[Array, "T c"] = eqx.field(converter=_table)
    frequencies: Series = series("frequencies [rad/s]", least=1)
    at: Any = None
    angle: Float[Array, " c"] | None = eqx.field(default=None, converter=_angles)
    force: HarmonicForce | None = None

    def __check_init__(self):
        _check_samples(self.amplitude, self.frequencies, "frequencies")

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

    def prepared(self, scene: Scene) -> "ResponseRecord":
        self._check_channels(scene, self._stations, self.angle)
        return self

    def prediction(self, scene: Scene):
        if self.force is None:
            found = unbalance_response(scene, self.frequencies, self.at)
        else:
            found = forced_response(scene, self.frequencies, self.force, self.at)
        a = found.forward if self.angle is None else found.probe(self.angle)
        return a if jnp.iscomplexobj(self.amplitude) else jnp.abs(a)


def _check_samples(measured: Array, numbers: Array, name: str) -> None:
    if len(measured) != numbers.size:
        raise ValueError(f"The record has {len(measured)} samples, but {numbers.size} `{name}`.")


def with_start(records: tuple[AbstractRecord, ...], scene: Scene, paths: Any) -> Scene:
    """The scene with the start of a time record as a member, if any of the paths is one of its numbers."""
    if not any(path.startswith("start.") for path in paths):
        return scene
    timed = [record for record in records if isinstance(record, TimeRecord)]
    if len(timed) != 1:
        raise ValueError(
            f"Numbers of a start are fitted to one time record, but there are {len(timed)}; leave "
            "`start.` out of the parameters."
        )
    start = timed[0].start
    shaft = start.shaft if isinstance(start, Launch) else start
    if isinstance(shaft, AtRest | Continued):
        raise ValueError(
            f"The start of the record, {type(shaft).__name__}, has no numbers to fit; begin the record "
            "with a `Whirl`."
        )
    return scene.of_parts(*scene.effects, Begun(shaft))
