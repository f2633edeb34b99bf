"""What is decided before a motion is traced, and what one revolution of it shows."""

import diffrax as dfx
import equinox as eqx
from jaxtyping import Array, Complex

from ..core.quantities import Scalar
from ..solvers.exponential import Exponential


class Plan(eqx.Module):
    """What is decided before anything is traced: solver, steps, and which contacts share a port."""

    solver: Exponential | dfx.AbstractSolver
    controller: dfx.AbstractStepSizeController | None
    adjoint: dfx.AbstractAdjoint
    max_steps: int = eqx.field(static=True)  # of an adaptive solver, in one revolution
    steps: int = eqx.field(static=True)  # samples a revolution; fixed solvers step them
    slopes: bool = eqx.field(static=True)  # whether slopes are read besides displacements
    contacts: bool = eqx.field(static=True)  # whether ports are read
    coordinates: bool = eqx.field(static=True)  # whether all coordinates are read
    together: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    batch: bool = eqx.field(static=True, default=False)  # lanes under vmap are stepped as one


class RevolutionSamples(eqx.Module):
    """One revolution seen at the stations, its first and last samples included."""

    displacement: Complex[Array, "T s"]  # [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    slope: Complex[Array, "T s"] | None
    contact_force: Complex[Array, "T k"] | None  # [N]
    coordinates: tuple[Complex[Array, "T n"], Complex[Array, "T n"]] | None  # and their rates
    seconds: Scalar  # in a radian of revolution
    s: Scalar  # sign of the spin
