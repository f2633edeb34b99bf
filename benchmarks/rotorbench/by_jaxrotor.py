"""Answers of jaxrotor: `python -m rotorbench.by_jaxrotor FOLDER` in `benchmarks`.

Compiled programs are kept in the folder.
"""

import dataclasses
import sys
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from peers.turbomachines import serve

import jaxrotor as jr

from .cases import Case, cases, plain, speeds_of, values_of
from .machines import FOLDER


CASES = {case.name: case for case in cases()}
SAMPLES = 8  # speeds at which an onset is bracketed: the fewest that there are
BETWEEN = 5  # speeds between which a peak is bracketed, likewise


def answered(asked: dict[str, Any]) -> Callable[[], Any]:
    """The call that answers a case with a number of nodes or steps; it waits for its arrays."""
    call = prepared(CASES[asked["case"]], asked["setting"])
    return lambda: np.asarray(jax.block_until_ready(call()))


def prepared(case: Case, setting: int) -> Callable[[], Any]:
    """The call that answers a case; scenes are built before."""
    ask, scene = case.ask, jr.load(FOLDER / f"{case.machine}.toml")
    if isinstance(scene.shaft, jr.FlexibleShaft):
        shaft = dataclasses.replace(scene.shaft, nodes=setting)
        scene = jr.Scene(shaft, *scene.effects, spin=scene.spin)
    motion = nonlinear(case, scene, setting)
    if motion is not None:
        return motion
    if case.question == "roots":
        turning = scene.at_speed(ask["speed"]) if "speed" in ask else scene
        return lambda: jr.roots(turning, 2 * ask["count"] + 2)
    if "over" in ask:
        return over_parameter(case.question, ask, scene)
    if case.question == "Campbell diagram":
        return lambda: jr.campbell(scene, speeds_of(ask), ask["count"]).values
    if case.question == "critical speeds":
        return lambda: jr.critical_speeds(scene).speeds
    if case.question == "threshold":
        return lambda: list(jr.onset_speed(scene, tuple(ask["within"]), SAMPLES, progress=False))
    if case.question == "response":
        return lambda: radii(jr.unbalance_response(scene, speeds_of(ask), ask["at"]))
    if case.question == "peak":
        speeds = np.linspace(*ask["within"], BETWEEN)
        return lambda: highest(jr.response_peaks(scene, speeds, ask["at"]))
    return lambda: plane(jr.simulate(scene, times=ask["times"], at=ask["at"]).displacement[:, 0])


def over_parameter(question: str, ask: dict[str, Any], scene: jr.Scene) -> Callable[[], Any]:
    """The call that gives roots or critical speeds of a scene with every value of a parameter."""
    factors = {**ask["over"]}
    supports = factors.pop("supports")
    paths = {f"supports.{k}.{key}": x for k in supports for key, x in factors.items()}
    scenes = lambda: (
        scene.replace({path: x * value for path, x in paths.items()}) for value in values_of(ask)
    )
    if question == "roots over a parameter":
        return lambda: [np.asarray(jr.roots(one, 2 * ask["count"] + 2)) for one in scenes()]
    return lambda: [np.asarray(jr.critical_speeds(one).forward)[: ask["count"]] for one in scenes()]


def nonlinear(case: Case, scene: jr.Scene, setting: int) -> Callable[[], Any] | None:
    """The call that answers a nonlinear question, None for another one."""
    ask = case.ask
    located = jr.Exponential(4, located=True)
    steps = {"steps_per_revolution": setting, "progress": False}
    calls: dict[str, Callable[[], Any]] = {
        "full rub": lambda: rub(jr.annular_rub(scene)),
        "full rub of a flexible shaft": lambda: rub(jr.annular_rub(scene)),
        "fold of a full rub": lambda: (lambda r: [r.folds[-1], r.fold_radius[-1]])(
            jr.annular_rub(scene, ask["speeds"])
        ),
        "dry whirl": lambda: (lambda w: [w.rate[0], w.radius[0]])(jr.dry_whirl(scene)),
        "static position": lambda: position(jr.static_positions(scene)),
        "onset in oil films": lambda: oil_onset(scene, ask["within"], setting),
        "squeeze film": lambda: squeezed(scene, steps),
        "oil whirl": lambda: whirl(scene, ask, steps),
        "run-up": lambda: [
            np.abs(
                jr.run_up(
                    scene, np.linspace(0.0, ask["until"], ask["samples"]),
                    solver=jr.Exponential(4), substeps=setting, progress=False,
                ).displacement
            ).max()
        ],
        "impact orbit": lambda: struck(scene, ask["start"], steps),
        "rub in time": lambda: plane(
            jr.simulate(scene, ask["revolutions"], setting, solver=located, keep=1, progress=False)
            .displacement.ravel()[-1]
        ),
    }  # fmt: skip
    return calls.get(case.question)


def at(z: complex, v: complex) -> jr.Continued:
    """A state of a rotor of one coordinate."""
    return jr.Continued(jnp.array([z]), jnp.array([v]))


def rub(found: jr.AnnularRub) -> list[Any]:
    """Radius and normal force of the upper branch."""
    return [found.radius[0, 0], found.normal_force[0, 0]]


def position(found: jr.StaticPositions) -> np.ndarray:
    """Eccentricity and stiffness of the first film."""
    return np.array([found.eccentricity[0, 0], *np.ravel(found.stiffness[0, 0])])


def oil_onset(scene: jr.Scene, within: list[float], speeds: int) -> list[Any]:
    """Onset of the rotor with tables of the films' coefficients over some speeds."""
    tables = jr.linearized(scene, np.linspace(*within, speeds))
    return list(jr.onset_speed(tables, tuple(within), SAMPLES, progress=False))


def whirl(scene: jr.Scene, ask: dict[str, Any], steps: dict[str, Any]) -> list[Any]:
    """Whirl rate of the orbit in an oil film, from a start beside it."""
    start = at(complex(ask["start"][0], ask["y"]), complex(*ask["start"][1:]))
    solver = jr.Exponential(4)
    found = jr.periodic(scene, start, turn=0.0, period=ask["period"], solver=solver, **steps)
    return [2 * np.pi / found.period]


def squeezed(scene: jr.Scene, steps: dict[str, Any]) -> list[Any]:
    """Radius of the circle, from a guess."""
    start = jr.Whirl(0.8, float(scene.spin.speed), -2.3)
    found = jr.periodic(scene, start, solver=jr.Exponential(4), **steps)
    return [np.abs(np.asarray(found.displacement)).ravel()[0]]


def struck(scene: jr.Scene, start: list[float], steps: dict[str, Any]) -> list[Any]:
    """Displacement along x and its velocity as a revolution of the orbit begins."""
    begin = at(complex(start[0], -0.089), complex(start[1], -0.6))
    found = jr.periodic(scene, begin, revolutions=1, **steps).start
    return [found.q[0].real, found.velocity[0].real]


def radii(response: jr.analysis.HarmonicResponse) -> np.ndarray:
    """Forward and backward radius [m] of the orbit."""
    parts = response.forward[:, 0], response.backward[:, 0]
    return np.stack([np.abs(np.asarray(part)) for part in parts], axis=1)


def highest(peaks: jr.analysis.ResponsePeaks) -> np.ndarray:
    """Speed and amplitude of the highest peak."""
    k = int(np.argmax(peaks.amplitudes))
    return np.array([peaks.speeds[k], peaks.amplitudes[k]])


def plane(z: Any) -> np.ndarray:
    """Parts x and y of complex displacements."""
    z = np.asarray(z)
    return np.stack([z.real, z.imag], axis=-1)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    jr.keep_programs(sys.argv[1])
    serve(answered, lambda found: [plain(found)])
