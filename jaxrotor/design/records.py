"""Records: what was measured on a rotor, and how a scene predicts it; motions in time."""

import abc
import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..analysis.forced import Places
from ..core.checks import check_counts
from ..core.quantities import Scalar, Series, known, series
from ..core.representation import AbstractPart
from ..effects import AbstractContact
from ..effects.base import AbstractEffect
from ..equations.start import AbstractStart, AtRest, Continued, Launch
from ..equations.system import assemble, port_groups
from ..motion.simulate import simulate, system_of_march
from ..scene import Scene
from ..solvers.exponential import Exponential


def table(value: Any) -> Any:
    """Measured numbers by sample and channel; one channel may be given as a list."""
    if not known(value):
        return value
    array = np.asarray(value)
    if array.dtype.kind not in "iufc" or array.ndim not in (1, 2) or not array.size:
        raise ValueError(
            "A record must be numbers by sample, or by sample and channel, but has shape "
            f"{array.shape} and type {array.dtype}."
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
    found = jnp.atleast_1d(jnp.asarray(value, float))
    if known(found) and not np.isfinite(found).all():
        raise ValueError(f"`angle [rad]` must be finite, but is {value!r}.")
    return found


class AbstractRecord(AbstractPart):
    """Numbers that were measured by sample and channel, and their prediction from a scene."""

    kind: eqx.AbstractVar[str]  # how it is drawn: over samples, in the plane, by amplitude
    name: eqx.AbstractVar[str]  # of the numbers at which samples were taken
    unit: eqx.AbstractVar[str]

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

    @abc.abstractmethod
    def doubt(self, scene: Scene) -> str:
        """A sentence on why a fitted scene cannot be what was measured; empty where nothing says so."""

    def residuals(self, scene: Scene) -> Float[Array, "T d"]:
        """Prediction less measurement, of complex numbers first real, then imaginary parts."""
        off = self.prediction(scene) - self.measured
        return jnp.concatenate([off.real, off.imag], axis=1) if jnp.iscomplexobj(off) else off

    @property
    def count(self) -> int:
        """Number of real numbers in the record."""
        return self.measured.size * (2 if jnp.iscomplexobj(self.measured) else 1)

    @property
    def scale(self) -> Scalar:
        """Root mean square of the record [m], 1 if it is zero."""
        size = jnp.sqrt(jnp.mean(jnp.abs(self.measured) ** 2))
        return jnp.where(size > 0, size, 1.0)

    def check_channels(self, scene: Scene, at: Any, angle: Any) -> None:
        """Raise unless every channel has its station, and its direction where numbers are real."""
        count = Places.of(scene, at).stations.size
        if self.measured.shape[1] != count:
            raise ValueError(
                f"The record has {self.measured.shape[1]} channels, but `at` names {count} stations; "
                "name the station of every channel, one twice if two probes are there."
            )
        if angle is not None and angle.size not in (1, count):
            raise ValueError(
                f"`angle` has {angle.size} directions for {count} channels; give one for every channel."
            )


class FittedStart(AbstractEffect):
    """The start of a record as a member of its scene, so that its numbers are parameters."""

    kind: ClassVar[str] = "start"
    plural: ClassVar[str] = "starts"

    shaft: AbstractStart


def read(z: Array, angle: Array | None) -> Array:
    """Displacements (T, c), complex, or along probes `Re z exp(-i psi)`."""
    return z if angle is None else (z * jnp.exp(-1j * angle)).real


def check_directions(measured: Array, angle: Array | None) -> None:
    """Raise unless displacements are complex or along probes."""
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
            `Whirl(..)` are `start.shaft.radius`, `start.shaft.rate` and `start.shaft.angle`.
        substeps: steps from sample to sample of a record by revolutions; more where contact is stiff.
        solver: as of `simulate`; by default, by revolutions with contact, `Exponential(4, located=True)`
            where exponential steps are taken.
    """

    kind: ClassVar[str] = "samples"

    displacement: Inexact[Array, "T c"] = eqx.field(
        converter=table
    )  # x + i y, or read by probes [m]
    revolutions: int | None = eqx.field(default=None, static=True)
    times: Series | None = series("times [s]", ascending=True, nonnegative=True, default=None)
    at: Any = None
    angle: Float[Array, " c"] | None = eqx.field(default=None, converter=angles)
    start: AbstractStart = eqx.field(default_factory=AtRest)  # in which the motion begins
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

    def prepared(self, scene: Scene) -> "TimeRecord":
        self.check_channels(scene, self.at, self.angle)
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
        taken = system_of_march(scene, assemble(scene, port_groups(scene)), None, self.start)
        return None if taken is None else Exponential(4, located=True)

    def _start(self, scene: Scene) -> AbstractStart:
        """The record's own start, or the one whose numbers are parameters."""
        begun = scene.of(FittedStart)
        if not begun:
            return self.start
        if isinstance(self.start, Launch):
            return dataclasses.replace(self.start, shaft=begun[0].shaft)
        return begun[0].shaft


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
    return scene.of_parts(*scene.effects, FittedStart(shaft))
