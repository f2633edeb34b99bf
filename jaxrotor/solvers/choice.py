"""Choice of a solver: what may be asked for, and modal or dense steps, decided once."""

import dataclasses
from typing import Any

import diffrax as dfx
import equinox as eqx
import jax
import numpy as np

from ..core.quantities import Scalar, known
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
    matrix, s, driven = _linear(scene, rate)
    if driven:
        _check_resonance(scene, np.asarray(matrix), float(s))
    if solver.basis == "auto":
        _, vectors = np.linalg.eig(np.asarray(matrix))
        return dataclasses.replace(solver, basis="modal" if well_conditioned(vectors) else "dense")
    return solver


@eqx.filter_jit
def _linear(scene: Scene, rate: Scalar):
    motion = Motion(assemble(scene), rate)
    return motion.matrix(), motion.s, motion.unbalance is not None


def _check_resonance(scene: Scene, matrix: np.ndarray, s: float) -> None:
    if s and np.min(np.abs(1j * s - np.linalg.eigvals(matrix))) < 1e-9:
        raise ValueError(
            f"The speed, {float(scene.spin.speed):g} rad/s, is a critical speed of an undamped mode, "
            "where the response to unbalance grows without bound: add damping, move the speed, or "
            "give a diffrax solver."
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
