"""Choice of a solver: which ones are accepted, and whether exponential steps are modal or dense."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import diffrax as dfx
import jax
import numpy as np
from jaxtyping import Array, Inexact

from ..core.compiled import compiled_quickly
from ..core.pilot import Pilot
from ..core.quantities import Scalar, known
from ..equations.clocks import rate_of
from ..equations.constant_frame import in_constant_axes, linear_matrix
from ..equations.lent import with_lent_films
from ..equations.pencil import Pencil, frame
from ..equations.system import System
from .basis import well_conditioned
from .exponential import Exponential
from .shapes import shape_errors


MOST = 24  # shapes that are tried


def choose(
    solver: Exponential | dfx.AbstractSolver | None, system: System, rate: Scalar, start: Any = None
) -> Exponential | dfx.AbstractSolver:
    """The solver with its basis decided for a system; `rate` is 2 pi over the length of a revolution.

    Basis "auto" becomes "dense" where the system, the rate or the start is traced.
    """
    solver = checked_solver(solver, system)
    if not isinstance(solver, Exponential):
        return solver
    system = with_lent_films(in_constant_axes(system))
    given = all(known(leaf) for leaf in jax.tree.leaves((system, rate, start)))
    if given and system.steep:
        _check_held(system)
    if solver.basis == "dense":
        return solver
    if not given:
        return dataclasses.replace(solver, basis="dense") if solver.basis == "auto" else solver
    matrix, frequencies = _matrix(system, rate)
    roots, vectors = np.linalg.eig(np.asarray(matrix))
    _check_resonance(system, roots, [float(frequency) for frequency in frequencies])
    return decide_basis(solver, vectors) if solver.basis == "auto" else solver


def with_shapes(
    solver: Any,
    systems: Sequence[System],
    rates: Sequence[Scalar],
    stations: Array,
    tolerance: float | int,
) -> tuple[Any, tuple[Pilot, ...]]:
    """The solver with its shapes decided, and the pilot that did, if they are "auto".

    They are then as many as the most demanding of some systems needs for an error below a tolerance, see
    `shape_errors`. All coordinates are followed where a system is traced, has no contact, oil films or
    massless parts, where a law of contact states no stiffness, and where neither `MOST` shapes nor one
    fewer than the coordinates are enough.

    Args:
        solver: `Exponential`, or any other, which is left as it is.
        systems: equations of a scene at some points of a sweep, all of one structure.
        rates: 2 pi over the length of a revolution of each [rad/s].
        stations: those that are seen [m].
        tolerance: largest error.

    Returns:
        The solver and the pilots.
    """
    if not isinstance(solver, Exponential) or solver.shapes is None:
        return solver, ()
    every = dataclasses.replace(solver, shapes=None)
    systems = [in_constant_axes(system) for system in systems]
    if solver.shapes != "auto":
        fewer = systems[0].ports and solver.shapes < systems[0].n
        return solver if fewer else every, ()
    most = min(MOST, systems[0].n - 1)
    if not (systems[0].ports and most > 0) or systems[0].massless is not None or systems[0].steep:
        return every, ()
    if not all(known(leaf) for leaf in jax.tree.leaves((systems, rates, stations))):
        return every, ()
    others: dict[bytes, tuple[System, Scalar]] = {}  # which differ in more than their loads
    for pair in zip(systems, rates, strict=True):
        parts = jax.tree.leaves((pair[0].blocks, pair[0].ports, pair[0].spin, pair[1]))
        others[b"".join(np.asarray(part).tobytes() for part in parts)] = pair
    errors = np.max([shape_errors(*pair, stations, most) for pair in others.values()], axis=0)
    enough = np.flatnonzero(errors <= tolerance)
    if not enough.size:
        return every, ()
    count = int(enough[0]) + 1
    error = float(errors[enough[0]])
    pilot = Pilot("shapes", count, error, float(tolerance), True, "error")
    return dataclasses.replace(solver, shapes=count), (pilot,)


def decide_basis(solver: Exponential, vectors: Array | np.ndarray) -> Exponential:
    """The solver in a modal basis if all eigenvectors, (.., m, m), are well conditioned, else dense."""
    return dataclasses.replace(solver, basis="modal" if well_conditioned(vectors) else "dense")


@compiled_quickly
def _matrix(system: System, rate: Scalar) -> tuple[Inexact[Array, "m m"], list[Scalar]]:
    """Matrix of the linear equations, and the frequencies, by the angle, of loads that go round in them.

    In turning axes the unbalance stands still, and weight goes round.
    """
    s, load = system.spin.speed / rate, system.load
    turns = frame(system.blocks) == "rotating"
    frequencies = [] if load.unbalance is None else [0.0 * s if turns else s]
    if turns and load.steady:
        frequencies.append(-s)
    others = [rate_of(one, system.spin.speed, rate) for one in system.others]
    frequencies += [one - s if turns else one for one in others]
    return linear_matrix(system, rate), frequencies


def _check_resonance(system: System, roots: np.ndarray, frequencies: list[float]) -> None:
    """Raise if unbalance or weight excites an undamped mode at its natural frequency."""
    turns = bool(system.spin.speed)
    if turns and any(np.min(np.abs(1j * f - roots)) < 1e-9 for f in frequencies):
        raise ValueError(
            f"The speed, {float(system.spin.speed):g} rad/s, is a critical speed of an undamped mode, "
            "where the response to unbalance or weight grows without bound: add damping, move the speed, "
            "or give a diffrax solver."
        )


def _check_held(system: System) -> None:
    """Raise if a constant load acts where nothing linear holds the rotor."""
    constant = system.load.constant
    if constant is None or frame(system.blocks) != "fixed":
        return
    force = np.asarray(constant)
    stiffness = np.asarray(Pencil.mean(system).stiffness)
    rest = np.linalg.lstsq(stiffness, force, rcond=None)[0]
    if np.linalg.norm(stiffness @ rest - force) > 1e-6 * np.linalg.norm(force):
        raise ValueError(
            "Exponential() needs a rest position of the linear rotor under its constant loads, but "
            f"nothing linear holds it ({system.owners_of('contact')} not counted; films hold it while it "
            "rotates); leave `solver` out, or give a diffrax solver."
        )


def checked_solver(solver: Any, system: System | None = None) -> Exponential | dfx.AbstractSolver:
    """The solver, by default `Exponential()`; raises unless it is one.

    By default a system whose only ports are those of a remainder, which is smooth, is stepped by order 4.
    """
    if solver is None:
        if system is None or system.members:
            return Exponential()
        return Exponential(4 if system.remainder or system.deviators else 2)
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
        shapes = "" if solver.shapes is None else f", shapes={solver.shapes!r}"
        fused = ", fused=True" if solver.fused else ""
        return f"Exponential(order={solver.order}, basis={solver.basis!r}{located}{shapes}{fused})"
    return type(solver).__name__
