"""Records: what was measured on a rotor, and how a scene predicts it; motions in time."""

import abc
import math
from collections.abc import Iterable
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..analysis.forced import Places
from ..core.checks import check_counts
from ..core.quantities import Scalar, Series, known, series, with_values
from ..core.representation import AbstractPart
from ..effects import AbstractContact
from ..effects.base import AbstractEffect
from ..equations.speed_tables import check_tables
from ..equations.start import AbstractStart, AtRest, Continued, Launch, checked_start
from ..equations.system import assemble, port_groups
from ..motion.choice import system_of_march
from ..motion.revolutions import check_constant_speed
from ..motion.run_up import after, check_tables_along
from ..motion.simulate import simulate
from ..scene import Scene
from ..solvers.choice import checked_solver
from ..solvers.control import step_control
from ..solvers.exponential import Exponential


def table(value: Any) -> Any:
    """Measured numbers by sample and channel; one channel may be given as a list."""
    if not known(value):
        return value
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(
            "A record must be numbers by sample, or by sample and channel, but its samples have several "
            f"lengths: {value!r:.200}; give every sample a number for every channel."
        ) from None
    if array.dtype.kind not in "iufc" or array.ndim not in (1, 2) or not array.size:
        give = "give an array (T,) or (T, c)"
        give = "read the file first, as by `numpy.loadtxt`" if isinstance(value, str) else give
        raise ValueError(
            "A record must be numbers by sample, or by sample and channel, but has shape "
            f"{array.shape} and type {array.dtype}: {value!r:.200}; {give}."
        )
    numbers = jnp.asarray(array.astype(complex if array.dtype.kind == "c" else float))
    bad = np.flatnonzero(~np.isfinite(array.reshape(array.shape[0], -1)).all(axis=1))
    if bad.size:
        raise ValueError(
            f"A record must have finite numbers, but sample {bad[0]} is "
            f"{array[bad[0]].tolist()} ({bad.size} of {len(array)} samples are not finite); leave "
            "such samples out, or cut the record before them."
        )
    return numbers.reshape(array.shape[0], -1)


def angles(value: Any) -> Any:
    """Directions of probes as an array; None where there are none."""
    if value is None:
        return None
    try:
        found = jnp.atleast_1d(jnp.asarray(value, float))
    except (TypeError, ValueError):
        found = jnp.zeros((0, 0))
    if found.ndim > 1:
        raise ValueError(
            "`angle [rad]` must be the direction of a probe, or a list of one for every channel, but is "
            f"{value!r:.200}."
        )
    if known(found) and not np.isfinite(found).all():
        raise ValueError(f"`angle [rad]` must be finite, but is {value!r}.")
    return found


class AbstractRecord(AbstractPart):
    """Numbers that were measured by sample and channel, and their prediction from a scene."""

    kind: eqx.AbstractVar[str]  # how it is drawn: over samples, in the plane, by amplitude
    name: eqx.AbstractVar[str]  # of the numbers at which samples were taken
    unit: eqx.AbstractVar[str]
    offset: eqx.AbstractVar[bool]  # whether every channel has a constant that is not predicted

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

    @property
    @abc.abstractmethod
    def deciding(self) -> list[Any]:
        """Numbers that decide how a prediction is computed, so that a program is compiled with them."""

    @abc.abstractmethod
    def prepared(self, scene: Scene) -> "AbstractRecord":
        """The record with all that has to be found before values are traced; checked against a scene."""

    @abc.abstractmethod
    def doubt(self, scene: Scene) -> str:
        """A sentence on why a fitted scene cannot be what was measured; empty where nothing says so."""

    def residuals(self, scene: Scene) -> Float[Array, "S d"]:
        """Prediction less measurement, as `numbers` has them."""
        return self.numbers(self.prediction(scene) - self.measured)

    def numbers(self, z: Inexact[Array, "T c"]) -> Float[Array, "S d"]:
        """Real numbers by sample, of complex ones first real, then imaginary parts.

        With an `offset` they are `T - 1` contrasts, which a constant does not change: rows of the
        reflection that turns `(1, .., 1)` into the first axis, so that noise stays as it was.
        """
        table = jnp.concatenate([z.real, z.imag], axis=1) if jnp.iscomplexobj(z) else z
        return _reflected(table)[1:] if self.offset else table

    def centred(self, table: Float[Array, "S d"]) -> Float[Array, "T d"]:
        """Residuals by sample of those `numbers`: with an `offset`, less their mean."""
        if not self.offset:
            return table
        return _reflected(jnp.concatenate([jnp.zeros((1, table.shape[1])), table]))

    @property
    def samples_left(self) -> int:
        """Number of samples, one less where a constant is taken off."""
        return len(self.measured) - self.offset

    @property
    def count(self) -> int:
        """Number of real numbers in the record that are fitted."""
        channels = self.measured.shape[1] * (2 if jnp.iscomplexobj(self.measured) else 1)
        return self.samples_left * channels

    @property
    def scale(self) -> Scalar:
        """Root mean square of the record [m], 1 if it is zero."""
        size = jnp.sqrt(jnp.mean(jnp.abs(self.measured) ** 2))
        return jnp.where(size > 0, size, 1.0)

    def check_channels(self, scene: Scene, at: Any) -> None:
        """Raise unless every channel has its station."""
        count = Places.of(scene, at).stations.size
        if self.measured.shape[1] != count:
            raise ValueError(
                f"The record has {self.measured.shape[1]} channels, but `at` names {count} stations; "
                "name the station of every channel, one twice if two probes are there."
            )


def _reflected(table: Float[Array, "T d"]) -> Float[Array, "T d"]:
    """`(1 - 2 v v^T / v^T v) z`, `v = (1, .., 1) / sqrt(T) - (1, 0, .., 0)`."""
    root = math.sqrt(len(table))
    share = (jnp.sum(table, axis=0) / root - table[0]) / (root - 1)
    return (table - share).at[0].add(root * share)


class FittedStart(AbstractEffect):
    """The start of a time record as a member of its scene, so that its numbers are parameters."""

    kind: ClassVar[str] = "start"
    plural: ClassVar[str] = "starts"

    shaft: Any = None  # an `AbstractStart`; of other effects, the name of their shaft


def read(z: Array, angle: Array | None) -> Array:
    """Displacements (T, c), complex, or along probes `Re z exp(-i psi)`."""
    return z if angle is None else (z * jnp.exp(-1j * angle)).real


def check_angles(measured: Array, angle: Array | None) -> None:
    """Raise unless probes have one direction, or one for every channel."""
    channels = measured.shape[1]
    if angle is not None and angle.size not in (1, channels):
        raise ValueError(
            f"`angle` has {angle.size} directions for {channels} channels; give one for every channel."
        )


def check_directions(measured: Array, angle: Array | None) -> None:
    """Raise unless displacements are complex or along probes."""
    check_angles(measured, angle)
    if jnp.iscomplexobj(measured) == (angle is None):
        return
    raise ValueError(
        "Displacements must be complex, x + i y, or real with the `angle` of every probe, but are "
        + ("real without one." if angle is None else "complex and have one.")
    )


def check_amplitudes(amplitude: Array) -> None:
    """Raise where an amplitude without a phase is negative."""
    if not jnp.iscomplexobj(amplitude) and known(amplitude) and np.min(amplitude) < 0:
        raise ValueError(
            f"An amplitude without phase cannot be negative, but one is {float(np.min(amplitude)):g}; "
            "give complex numbers, or their absolute values."
        )


def check_samples(measured: Array, numbers: Any, name: str) -> None:
    """Raise unless there is a number for every sample."""
    if len(measured) != numbers.size:
        raise ValueError(f"The record has {len(measured)} samples, but {numbers.size} `{name}`.")


class TimeRecord(AbstractRecord):
    """`z(t_k)` or, of probes, `Re z(t_k) exp(-i psi)`: displacement in time [m], (T,) or (T, c).

    Samples are evenly spaced over whole `revolutions` of constant speed, both ends included, or at
    `times`.

    Args:
        displacement: x + i y of every channel [m], or the readings of probes, real.
        revolutions: length of the record from angle zero, `T - 1` intervals of samples.
        times: of the samples [s] in place of revolutions, ascending from the start; also of a rotor with
            parts without mass.
        at: station(s) [m], one a channel; by default as in `simulate`.
        angle: direction(s) of probes from x to y [rad], one a channel.
        start: state in which the motion begins, by default at rest. Its numbers may be fitted: those of
            `Whirl(..)` are `start.shaft.radius`, `start.shaft.rate` and `start.shaft.angle`; of several
            time records `starts.0.shaft.radius`, `starts.1.shaft.radius`, .. in their order.
        substeps: steps from sample to sample of a record by revolutions; more where contact is stiff.
        solver: as of `simulate`; by default, by revolutions with contact, `Exponential(4, located=True)`
            where exponential steps are taken.
    """

    kind: ClassVar[str] = "samples"
    offset: ClassVar[bool] = False

    # x + i y, or read by probes [m]
    displacement: Inexact[Array, "T c"] = eqx.field(converter=table)
    revolutions: int | None = eqx.field(default=None, static=True)
    times: Series | None = series("times [s]", ascending=True, nonnegative=True, default=None)
    at: Any = None
    angle: Float[Array, " c"] | None = eqx.field(default=None, converter=angles)
    # In which the motion begins
    start: AbstractStart = eqx.field(default_factory=AtRest, converter=checked_start)
    substeps: int = eqx.field(default=4, static=True)
    solver: Any = None

    def __check_init__(self):
        check_directions(self.displacement, self.angle)
        if (self.revolutions is None) == (self.times is None):
            raise ValueError("A time record needs `revolutions` or `times`, one of the two.")
        count = len(self.displacement)
        if self.revolutions is None:
            check_samples(self.displacement, self.times, "times")
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
            return jnp.asarray(self.times)
        return jnp.linspace(0.0, self.revolutions, len(self.displacement))

    @property
    def deciding(self):
        if self.revolutions is not None:
            return [self.start.angle] if isinstance(self.start, Launch) else []
        through = self.solver is not None and step_control(self.solver) is None
        return [self.times] if through else []  # steps go from sample to sample

    def prepared(self, scene: Scene) -> "TimeRecord":
        self.check_channels(scene, self.at)
        if self.solver is not None:
            checked_solver(self.solver)
        if self.revolutions is None:
            if isinstance(self.solver, Exponential):
                raise ValueError(
                    "Steps of Exponential() along `times` are chosen by a known speed, but a fit moves "
                    "the numbers of the rotor; give the record `revolutions`, a diffrax solver, or none."
                )
            check_tables_along(after(scene, Launch.of(self.start)), self.times)
            return self
        check_constant_speed(scene, "A time record by `revolutions`")
        check_tables(scene)
        if not float(scene.spin.speed):
            raise ValueError(
                "At zero speed a time record by `revolutions` has no length; give its `times`."
            )
        return self

    def doubt(self, scene: Scene) -> str:
        del scene
        return ""

    def prediction(self, scene: Scene):
        run = {"at": self.at, "start": self._start(scene), "solver": self._solver(scene)}
        if self.revolutions is None:
            motion = simulate(scene, times=self.times, **run, progress=False)
            return read(motion.displacement, self.angle)
        steps = (len(self.displacement) - 1) // self.revolutions * self.substeps
        motion = simulate(scene, self.revolutions, steps, **run, progress=False)
        return read(motion.displacement[:: self.substeps], self.angle)

    def _solver(self, scene: Scene) -> Any:
        """The record's own solver; by default located steps, as plain ones leave kinks in residuals."""
        if self.solver is not None or self.revolutions is None or not scene.of(AbstractContact):
            return self.solver
        taken, _ = system_of_march(scene, assemble(scene, port_groups(scene)), None, self.start)
        return None if taken is None else Exponential(4, located=True)

    def _start(self, scene: Scene) -> AbstractStart:
        """The record's own start, or the one whose numbers are parameters."""
        begun = scene.of(FittedStart)
        if not begun:
            return self.start
        if isinstance(self.start, Launch):
            return eqx.tree_at(lambda start: start.shaft, self.start, begun[0].shaft)
        return begun[0].shaft


def is_of_start(path: str) -> bool:
    """Whether a parameter path names a number of a start."""
    return path.partition(".")[0] in (FittedStart.kind, FittedStart.plural)


def with_starts(records: tuple[AbstractRecord, ...], scene: Scene, paths: Iterable[str]) -> Scene:
    """The scene with the starts of time records as members, if any of the paths is a number of one."""
    if not any(map(is_of_start, paths)):
        return scene
    starts = [record.start for record in records if isinstance(record, TimeRecord)]
    shafts = [start.shaft if isinstance(start, Launch) else start for start in starts]
    if not shafts:
        raise ValueError(
            "Numbers of a start are fitted to time records, but there are none; leave `start.` out of "
            "the parameters."
        )
    if all(isinstance(shaft, AtRest | Continued) for shaft in shafts):
        names = ", ".join(type(shaft).__name__ for shaft in shafts)
        raise ValueError(
            f"The start of the record, {names}, has no numbers to fit; begin the record with a `Whirl`."
        )
    return scene.of_parts(*scene.effects, *map(FittedStart, shafts))


def without_starts(scene: Scene) -> tuple[AbstractEffect, ...]:
    """Effects of a scene without starts of records."""
    return tuple(effect for effect in scene.effects if not isinstance(effect, FittedStart))


def own_scenes(records: tuple[AbstractRecord, ...], scene: Scene) -> list[Scene]:
    """The scene of every record, where the only start that is a member is its own."""
    starts, others = iter(scene.of(FittedStart)), without_starts(scene)
    if len(others) == len(scene.effects):
        return [scene] * len(records)
    own = lambda record: (next(starts),) if isinstance(record, TimeRecord) else ()
    return [with_values(scene, effects=(*others, *own(record))) for record in records]
