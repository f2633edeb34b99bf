"""Answers of jaxrotor: `python -m peers.with_jaxrotor FOLDER` in `benchmarks`.

Compiled programs are kept in the folder.
"""

import dataclasses
import sys
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

import jaxrotor as jr
from jaxrotor.cli import app

from .clock import COMPILING, listen
from .turbomachines import Machine, machine_of, serve, spread


BRANCHES = 6
SCAN = 40  # speeds at which the threshold is bracketed


def scene_of(machine: Machine, nodes: int | None = None) -> jr.Scene:
    """The machine without stops, with its own number of nodes a span or another one."""
    scene = jr.load(machine.scene)
    scene = scene.without("limiters") if scene.of(jr.Limiter) else scene
    nodes = nodes or machine.nodes
    if nodes is None:
        return scene
    shaft = dataclasses.replace(scene.shaft, nodes=nodes)
    return jr.Scene(shaft, *scene.effects, spin=scene.spin)


def sealed(scene: jr.Scene, machine: Machine) -> jr.Scene:
    """The scene with the seal, if any: half of its damping turns with the shaft."""
    if not machine.seal:
        return scene
    half = {"stiffness": 0.0, "damping": machine.seal / 2}
    own = (jr.Support(machine.disc, **half), jr.Support(machine.disc, **half, rotating=True))
    return jr.Scene(scene.shaft, *scene.effects, *own, spin=scene.spin)


def numbers(scene: jr.Scene) -> dict[str, Any]:
    """Lengths [m], masses [kg] and coefficients of a rotor of one material, for ROSS to build."""
    shaft = scene.shaft
    made = shaft.material
    own = lambda part, key: np.asarray(getattr(part, key)).tolist()
    keys = [letter + axes for letter in "kc" for axes in ("xx", "xy", "yx", "yy")] + ["speeds"]
    return {
        "length": float(shaft.length),
        "nodes": shaft.nodes,
        "coordinates": jr.assemble(scene).n,
        "material": [float(made.youngs_modulus), float(made.density), float(made.shear_modulus)],
        "sections": [[0.0, float(shaft.diameter)]]
        + [[float(step.at), float(step.diameter)] for step in shaft.steps],
        "discs": [
            [float(disc.at), float(disc.mass), float(disc.diametral), float(disc.polar)]
            for disc in scene.of(jr.Disc)
        ],
        "bearings": [
            [float(one.at), {key: own(one, key) for key in keys if getattr(one, key) is not None}]
            for one in scene.of(jr.Support)
        ],
        "unbalances": [
            [float(one.at), float(one.mass * one.eccentricity)] for one in scene.of(jr.Unbalance)
        ],
    }


def answer(asked: dict) -> Callable[[], Any]:
    """The call that answers a request."""
    machine, question = machine_of(asked), asked["question"]
    if question == "show":
        return lambda: app(["show", machine.scene], standalone_mode=False)
    scene = scene_of(machine, asked.get("nodes"))
    if question == "numbers":
        return lambda: numbers(scene)
    if question == "Campbell diagram":
        speeds = np.array(spread(machine.highest, asked["speeds"]))
        return lambda: jr.campbell(scene, speeds, BRANCHES).values
    if question == "critical speeds":
        return lambda: jr.critical_speeds(scene, asked.get("count")).speeds
    if question == "response":
        speeds = np.array(spread(machine.highest, asked["response_speeds"]))
        return lambda: ellipses(jr.unbalance_response(scene, speeds, machine.disc))
    if question == "threshold":
        whole = sealed(scene, machine)
        return lambda: jr.onset_speed(whole, (0.0, machine.unstable), SCAN, progress=False).speed
    turning = scene.at_speed(machine.speed)
    if question == "growth rate":
        return lambda: jr.growth_rate(turning)
    if question == "roots":
        return lambda: jr.roots(turning, 12)
    return lambda: jr.modes(turning, 12).values


def ellipses(response: jr.analysis.HarmonicResponse) -> np.ndarray:
    """Forward and backward radius [m] of the orbit at the disc."""
    parts = (response.forward[:, 0], response.backward[:, 0])
    return np.stack([np.abs(np.asarray(part)) for part in parts], axis=1)


def waited(call: Callable[[], Any]) -> Callable[[], Any]:
    """The call, which returns when its arrays are computed."""
    return lambda: jax.block_until_ready(call())


def plain(found: Any) -> Any:
    """Real and imaginary parts of roots, else the numbers themselves, as lists."""
    if found is None or isinstance(found, dict):
        return found
    found = np.asarray(found)
    return (np.stack([found.real, found.imag], -1) if np.iscomplexobj(found) else found).tolist()


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    jr.keep_programs(sys.argv[1])
    listen()
    serve(lambda asked: waited(answer(asked)), plain, lambda: {"compiling": sum(COMPILING)})
