"""Step control of diffrax solvers on rotors."""

import diffrax as dfx


RTOL, ATOL = 1e-7, 1e-10  # relative, and absolute in metres of q and dq/dtheta


def step_control(
    solver: dfx.AbstractSolver, rtol: float = RTOL, atol: float = ATOL
) -> dfx.AbstractStepSizeController | None:
    """Adaptive steps at `rtol`, `atol` [m] where the solver estimates its error, else None.

    The state is in metres and per radian of revolution, so one tolerance suits displacements and
    rates, and the root finder of an implicit solver may share it: on the limiter rotor a finder
    with tolerances of its own saves no step of Kvaerno5 or KenCarp4 (in SI units it saved most).
    """
    if isinstance(solver, dfx.AbstractAdaptiveSolver):
        return dfx.PIDController(rtol=rtol, atol=atol, pcoeff=0.3, icoeff=0.4)
    return None
