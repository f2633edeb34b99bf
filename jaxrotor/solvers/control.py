"""Settings of diffrax solvers for rotors."""

from typing import Any

import diffrax as dfx
import equinox as eqx
import optimistix as optx


RTOL, ATOL = 1e-7, 1e-10  # relative, and absolute [m], of q and dq/dtheta


def step_control(
    solver: dfx.AbstractSolver,
    rtol: float = RTOL,
    atol: float = ATOL,
    dtmax: Any = None,
    dtmin: float | None = None,
) -> dfx.AbstractStepSizeController | None:
    """Adaptive steps at `rtol`, `atol` [m] where the solver estimates its error, else None.

    A run that would need steps below `dtmin` [s] fails.
    """
    if not isinstance(solver, dfx.AbstractAdaptiveSolver):
        return None
    return dfx.PIDController(
        rtol=rtol,
        atol=atol,
        pcoeff=0.3,
        icoeff=0.4,
        dtmax=dtmax,
        dtmin=dtmin,
        force_dtmin=dtmin is None,
    )


def tuned(solver: dfx.AbstractSolver) -> dfx.AbstractSolver:
    """The solver with a root finder whose tolerance can be met.

    diffrax solves for the derivative of a stage with the tolerance of the state, which cannot be met by
    the accelerations of a stiff rotor. Here the state is scaled (metres, radians of revolution), and
    Kvaerno5 tolerates it, but KenCarp4 takes 18 times as many steps. A root finder with tolerances of its
    own is left unchanged.
    """
    if not isinstance(solver, dfx.AbstractImplicitSolver):
        return solver
    if isinstance(getattr(solver.root_finder, "rtol", 0.0), int | float):
        return solver
    chord = dfx.VeryChord(rtol=1e-5, atol=1e-6, norm=optx.max_norm)
    return eqx.tree_at(lambda s: s.root_finder, solver, chord)
