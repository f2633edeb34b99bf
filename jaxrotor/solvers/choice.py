"""Choice of a solver: what may be asked for, and modal or dense steps, decided once."""

import dataclasses
from typing import Any

import diffrax as dfx
import equinox as eqx
import jax
import numpy as np

from ..core.quantities import Scalar, known
from ..equations.constant_frame import ConstantFrame
from ..equations.pencil import isotropic
from ..equations.stationary_frame import Motion
from ..equations.system import assemble
from ..scene import Scene
from .basis import well_conditioned
from .exponential import Exponential


def choose(
    solver: Exponential | dfx.AbstractSolver | None, scene: Scene, rate: Scalar, start=None
) -> Exponential | dfx.AbstractSolver:
    """The solver with its basis settled: modal where eigenvectors serve, else dense."""
    solver = checked_solver(solver)
    if not isinstance(solver, Exponential) or solver.basis == "dense":
        return solver
    traced = not all(known(leaf) for leaf in jax.tree.leaves((scene, rate, start)))
    if traced:
        return dataclasses.replace(
            solver, basis="dense" if solver.basis == "auto" else solver.basis
        )
    matrix, frequencies = _linear(scene, rate)
    _check_resonance(scene, np.asarray(matrix), [float(frequency) for frequency in frequencies])
    if solver.basis == "auto":
        _, vectors = np.linalg.eig(np.asarray(matrix))
        return dataclasses.replace(solver, basis="modal" if well_conditioned(vectors) else "dense")
    return solver


@eqx.filter_jit
def _linear(scene: Scene, rate: Scalar):
    """`A` by the angle of revolution, and the frequencies at which unbalance and weight act on it."""
    system = assemble(scene)
    s, load = scene.spin.speed / rate, system.load
    if isotropic(system.blocks):
        matrix, turns = Motion(system, rate).matrix(), False
    else:
        axes = ConstantFrame.of(system, rate)
        matrix, turns = axes.matrix, axes.turn is not None
    own = s if turns else 0.0
    frequencies = [] if load.unbalance is None else [s - own]
    if turns and load.constant is not None:  # weight, which goes round in turning axes
        frequencies.append(-own)
    return matrix, frequencies


def _check_resonance(scene: Scene, matrix: np.ndarray, frequencies: list[float]) -> None:
    roots = np.linalg.eigvals(matrix)
    if scene.spin.speed and any(np.min(np.abs(1j * f - roots)) < 1e-9 for f in frequencies):
        raise ValueError(
            f"The speed, {float(scene.spin.speed):g} rad/s, is a critical speed of an undamped mode, "
            "where the response to unbalance or weight grows without bound: add damping, move the speed, "
            "or give a diffrax solver."
        )


def checked_solver(solver: Any) -> Exponential | dfx.AbstractSolver:
    """The solver asked for, by default the exponential one; refuses what is none."""
    solver = Exponential() if solver is None else solver
    if not isinstance(solver, Exponential | dfx.AbstractSolver):
        raise ValueError(
            "`solver` must be Exponential(..) or a diffrax solver such as diffrax.Kvaerno5(), but is "
            f"{solver!r}."
        )
    return solver


def solver_name(solver: Exponential | dfx.AbstractSolver) -> str:
    """Short name of a solver for results."""
    if isinstance(solver, Exponential):
        located = ", located=True" if solver.located else ""
        return f"Exponential(order={solver.order}, basis={solver.basis!r}{located})"
    return type(solver).__name__
