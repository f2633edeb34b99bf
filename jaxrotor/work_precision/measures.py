"""Measures: the number that a study of accuracy computes by every setting."""

import abc
from typing import Any, ClassVar, Literal

import diffrax as dfx
import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..analysis import onset_speed, roots
from ..core.compiled import compiled
from ..core.outcome import failed
from ..equations.start import AbstractStart, Launch
from ..motion.choice import default_solver
from ..motion.history import TimeHistory
from ..motion.reactions import reactions
from ..motion.rebounds import pilot_run
from ..motion.run_up import run_up
from ..motion.transient import controller_for
from ..scene import Scene
from ..solvers.exponential import Exponential
from ..sweeps import observe
from ..sweeps.sweep import sweep
from .methods import ATOL, Method, Setting, linear, of_motion, of_run_up


FINE_NODES = 12  # nodes, steps and tolerance of a reference
FINE_STEPS = 4096
FINE_TOLERANCE = 1e-10
SAMPLES = 256  # samples a revolution of a solver that chooses its steps


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(np.asarray(values, float).tolist())


class AbstractMeasure(eqx.Module):
    """A number of a scene, and the methods by which it is usually computed."""

    many: eqx.AbstractClassVar[bool]  # whether several lanes can be timed

    @property
    @abc.abstractmethod
    def about(self) -> tuple[str, str]:
        """Unit and long name."""

    @abc.abstractmethod
    def value(self, scene: Scene, setting: Setting, lanes: int = 1) -> complex | float:
        """The number of a scene that has the nodes and the precision of the setting already."""

    @abc.abstractmethod
    def methods(self) -> tuple[Method, ...]:
        """The methods that are compared by default."""

    @abc.abstractmethod
    def reference(self, scene: Scene) -> Setting:
        """A setting whose number is converged."""


class AbstractLinear(AbstractMeasure):
    """A number of the linear rotor, which depends on the nodes alone."""

    many: ClassVar[bool] = False

    def methods(self):
        return linear()

    def reference(self, scene):
        if not hasattr(scene.shaft, "nodes"):
            return Setting()
        return Setting(nodes=FINE_NODES, rule="spectral")


class AbstractRunUp(AbstractMeasure):
    """A number of a `run_up` that is sampled at `times`, by one program from the scene to the number."""

    many: ClassVar[bool] = False

    @abc.abstractmethod
    def of(self, run: TimeHistory) -> Array:
        """The number of a motion."""

    def value(self, scene, setting, lanes=1):
        found = np.asarray(_of_run_up(setting.cast(self), scene, setting))
        return found.astype(complex if np.iscomplexobj(found) else float).item()

    def methods(self):
        return of_run_up()

    def reference(self, scene):
        return Setting(default_solver(scene), tolerance=FINE_TOLERANCE)


class OnsetSpeed(AbstractLinear):
    """Speed at which the straight rotor becomes unstable, see `jaxrotor.onset_speed`."""

    within: tuple[Any, Any] | None = eqx.field(default=None, static=True)  # [rad/s]

    @property
    def about(self):
        return "rad/s", "onset speed"

    def value(self, scene, setting, lanes=1):
        return float(onset_speed(scene, self.within).speed)


class Root(AbstractLinear):
    """A root of `jaxrotor.roots` by its number, the slowest first."""

    number: int = eqx.field(default=0, static=True)

    @property
    def about(self):
        return "rad/s", f"root {self.number}"

    def value(self, scene, setting, lanes=1):
        return complex(roots(scene, self.number + 1)[self.number])


class LongRun(AbstractMeasure):
    """A number of a long motion, as `jaxrotor.sweep` observes it; of several contacts the largest.

    A solver that chooses its steps is observed `SAMPLES` times a revolution, others at every step; the
    largest radius and force are those of the samples.
    """

    name: Literal[
        "whirl_rate", "index", "radius_max", "radius_rms", "section", "peak_force", "duty"
    ] = eqx.field(static=True)
    start: AbstractStart | None = None
    settle: int = eqx.field(default=200, static=True)
    keep: int = eqx.field(default=100, static=True)
    at: Any = None  # station [m]
    many: ClassVar[bool] = True

    @property
    def about(self):
        return {
            "whirl_rate": ("1", "whirl rate over spin speed"),
            "index": ("1", "precession index"),
            "radius_max": ("m", "largest radius"),
            "radius_rms": ("m", "rms radius"),
            "section": ("m", "displacement at the end"),
            "peak_force": ("N", "largest contact force"),
            "duty": ("1", "share of time in contact"),
        }[self.name]

    def value(self, scene, setting, lanes=1):
        observable: observe.AbstractObservable = {
            "whirl_rate": observe.Precession,
            "index": observe.Precession,
            "radius_max": observe.Radius,
            "radius_rms": observe.Radius,
            "section": observe.Section,
        }.get(self.name, observe.Contact)()
        steps = setting.steps or SAMPLES
        with pilot_run():
            found = sweep(
                scene,
                {"spin.speed": np.full(lanes, float(scene.spin.speed))},
                start=setting.cast(self.start),
                settle=self.settle,
                keep=self.keep,
                observe=[observable],
                steps_per_revolution=steps,
                at=self.at,
                solver=setting.solver,
                controller=setting.controller(),
                error_sample=0,
                workers=1,  # because the precision is set for this thread
                lanes_per_chunk=lanes,
                progress=False,
                max_steps=max(4096, 2 * steps),
            )
        if failed(found["status"]).any():
            raise RuntimeError("not finite, or the solver could not meet its tolerance")
        first = found[self.name].isel({"spin.speed": 0}).values
        if self.name == "section":
            return complex(*first[-1])
        return float(np.max(first))

    def methods(self):
        return of_motion()

    def reference(self, scene):
        return Setting(Exponential(4, located=True), FINE_STEPS)


class Reaction(AbstractRunUp):
    """Force of one bearing, constraint or stop in a `run_up`: the largest of its samples, or the last.

    Names are those of `jaxrotor.reactions`.
    """

    times: Any = eqx.field(converter=_numbers, static=True)  # (T,) [s]
    name: str = eqx.field(static=True)
    which: Literal["largest", "last"] = eqx.field(default="largest", static=True)
    start: AbstractStart | Launch | None = None

    @property
    def about(self):
        return "N", f"{self.which} reaction of {self.name}"

    def of(self, run):
        force = jnp.abs(reactions(run).of(self.name))
        return force.max() if self.which == "largest" else force[-1]


class FinalState(AbstractRunUp):
    """A number of the state in which a `run_up` ends."""

    times: Any = eqx.field(converter=_numbers, static=True)  # (T,) [s]
    name: Literal["speed", "angle", "displacement", "imbalance"] = eqx.field(static=True)
    start: AbstractStart | Launch | None = None

    @property
    def about(self):
        return {
            "speed": ("rad/s", "speed at the end"),
            "angle": ("rad", "angle of rotation at the end"),
            "displacement": ("m", "displacement at the end"),
            "imbalance": ("kg m", "imbalance left at the end"),
        }[self.name]

    def of(self, run):
        return getattr(run, self.name)[-1].ravel()[0]


@compiled
def _of_run_up(measure: Any, scene: Scene, setting: Setting) -> Array:
    """A number of a run-up by the solver and the steps of a setting, not finite where it fails."""
    times = np.asarray(measure.times)
    solver = default_solver(scene) if setting.solver is None else setting.solver
    steps: dict[str, Any] = {}
    if setting.tolerance is not None:
        options = {"rtol": setting.tolerance, "atol": ATOL * setting.tolerance}
        steps["controller"] = controller_for(solver, scene, **options)
    elif setting.steps is not None:
        share = np.arange(setting.steps) / setting.steps
        whole = times if times[0] == 0 else np.append(0.0, times)
        grid = np.append((whole[:-1, None] + np.diff(whole)[:, None] * share).ravel(), whole[-1])
        steps["controller"] = dfx.StepTo(ts=grid)
    return measure.of(run_up(scene, times, start=measure.start, solver=solver, **steps))
