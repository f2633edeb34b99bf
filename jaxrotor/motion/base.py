"""Settings of a motion by whole revolutions, and the samples of one revolution."""

import diffrax as dfx
import equinox as eqx
from jaxtyping import Array, Complex, Float

from ..core.quantities import Scalar
from ..solvers.exponential import Exponential


class Plan(eqx.Module):
    """Settings that are fixed before tracing: solver, steps, and the contacts that share a port."""

    solver: Exponential | dfx.AbstractSolver
    controller: dfx.AbstractStepSizeController | None
    adjoint: dfx.AbstractAdjoint
    max_steps: int = eqx.field(static=True)  # of an adaptive solver, in one revolution
    steps: int = eqx.field(static=True)  # samples a revolution; fixed solvers step them
    slopes: bool = eqx.field(static=True)  # whether slopes are read besides displacements
    contacts: bool = eqx.field(static=True)  # whether ports are read
    coordinates: bool = eqx.field(static=True)  # whether all coordinates are read
    together: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    batch: bool = eqx.field(static=True, default=False)  # whether vmapped lanes are one array


class RevolutionSamples(eqx.Module):
    """Motion of the stations in one revolution, with its first and last samples."""

    displacement: Complex[Array, "T s"]  # [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    slope: Complex[Array, "T s"] | None
    contact_force: Complex[Array, "T k"] | None  # [N]
    coordinates: tuple[Complex[Array, "T n"], Complex[Array, "T n"]] | None  # with their rates
    seconds: Scalar  # in a radian of revolution
    s: Scalar  # sign of the spin


class WindowSamples(eqx.Module):
    """Motion of the stations in one window of a run, with its first and last samples."""

    displacement: Complex[Array, "T s"]  # [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    contact_force: Complex[Array, "T k"] | None  # [N]
    time: Float[Array, " T"]  # [s]
    speed: Float[Array, " T"]  # of rotation [rad/s]
