"""Stability of a linear rotor over a revolution, whether its coefficients are constant or not."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from numpy.polynomial import legendre

from ..core.checks import check_counts
from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known
from ..equations.pencil import Pencil, check_circular, eigenvalues, frame, root_changes
from ..equations.system import System, assemble
from ..scene import Scene
from .modal import natural_roots


STAGES = 7
LONGEST_STEP = 3.0  # of the first mode [rad]; the error of its multiplier is 3e-8 a step there
LEAST = 1e-8  # of the largest multiplier: what is below, squared of half a revolution, is rounding


def floquet_multipliers(scene: Scene, steps: int = 32) -> Complex[Array, " m"]:
    """`mu` of the motions `z(t + T) = mu z(t)`, `T = 2 pi / |Omega|`: one revolution.

    Stable where every `|mu| < 1`; `log(|mu|) / T` is the growth rate. The same in the fixed frame
    and in the axes of the shaft, for any rotor: where coefficients are constant in a frame they are
    `exp(lambda T)` of its `roots`. Where they are not, in `x, y` of the fixed frame,

        M q.. + C(2 Omega t) q. + K(2 Omega t) q = 0,    mu = (multiplier of half a revolution)^2

    by Radau IIA of seven stages, order 13: a step of 2 rad of a mode has an error of 1e-10, and
    fast or massless coordinates shorten no step. For an error of 1e-9 that is some thirty times
    cheaper than Hill's determinant with eight nodes.

    Args:
        scene: the rotor; contact is absent, its speed must not be zero.
        steps: of half a revolution. A mode of frequency w takes `w <= 0.6 steps |Omega|`; modes far
            above seem more damped than they are. Doubling it shows the error.

    Returns:
        The `4 n` multipliers, largest first; those of coordinates without mass are zero, as is what
        is below 1e-16 of the largest.
        Differentiable like `roots`. Not a number where traced and `steps` too few for the first mode.

    Source: Hairer, Wanner (1996), Solving Ordinary Differential Equations II, section IV.5.
    """
    check_counts(steps=steps)
    speed = scene.spin.speed
    if known(speed) and float(speed) == 0:
        raise ValueError(
            "Floquet multipliers are those of one revolution, but the speed is 0; look at "
            "`jaxrotor.roots`."
        )
    values = _multipliers(scene, steps)
    if known(values) and jnp.any(jnp.isnan(values)):
        raise ValueError(
            f"`steps` = {steps} is too few to follow the first mode at {float(speed):g} rad/s; the "
            "slower the rotor turns the more steps half a revolution takes."
        )
    return values


def exponents(system: System, steps: int = 32) -> Complex[Array, " m"]:
    """`lambda` of every motion, -inf where there is no mass.

    They are the roots; where coefficients are periodic, `log(mu) / T` with imaginary parts between
    `-|Omega|` and `|Omega|` (a multiplier tells a frequency up to twice the speed).
    """
    if frame(system.blocks) != "periodic":
        values = natural_roots(system)
        return jnp.where(jnp.isfinite(values), values, -jnp.inf)
    values, time = half_revolution(system, steps)
    there = values != 0
    return jnp.where(there, jnp.log(jnp.where(there, values, 1.0)) / time, -jnp.inf)


@compiled_quickly
def _multipliers(scene: Scene, steps: int) -> Complex[Array, " m"]:
    system = assemble(scene)
    if frame(system.blocks) == "periodic":
        values = half_revolution(system, steps)[0] ** 2
    else:
        roots = natural_roots(system)
        there = jnp.isfinite(roots)
        period = 2 * jnp.pi / jnp.abs(system.spin.speed)
        values = jnp.where(there, jnp.exp(jnp.where(there, roots, 0.0) * period), 0.0)
        if values.size == 2 * system.n:  # of x + i y; its conjugate moves likewise
            values = jnp.concatenate([values, values.conj()])
    return values[jnp.argsort(-jnp.abs(values))]


def half_revolution(system: System, steps: int) -> tuple[Complex[Array, " m"], Scalar]:
    """Multipliers of half a revolution, in no order, and its time [s]; any time at rest."""
    check_circular(system)
    speed, first = system.spin.speed, _first_frequency(system)
    turning = speed != 0
    time = jnp.where(turning, jnp.pi / jnp.abs(jnp.where(turning, speed, 1.0)), jnp.pi / first)
    resolved = first * time <= LONGEST_STEP * steps
    values = multipliers_of(_monodromy(system, time / steps, steps))
    return jnp.where(resolved, values, jnp.nan), time


def _first_frequency(system: System) -> Scalar:
    """Of the rotor without damping and anisotropy [rad/s]; the unit of time is not differentiated."""
    own = jax.lax.stop_gradient(Pencil.mean(system))
    undamped = Pencil(own.inertia, jnp.zeros_like(own.damping), own.stiffness.real + 0j)
    return jnp.min(jnp.abs(eigenvalues(undamped)))


def _monodromy(system: System, step: Scalar, steps: int) -> Float[Array, "m m"]:
    """State `(q, M dq/dtau)` after all steps from that before, `tau` the time in steps.

    With momentum, not velocity, mass is never inverted, and massless coordinates have exactly none.
    """
    inertia, damping, stiffness = _coefficients(system, step)
    # Each equation by its size, so that momenta are of the order of places.
    sizes = jnp.abs(inertia) + steps**2 * jnp.abs(stiffness[0])
    scale = jax.lax.stop_gradient(1 / jnp.max(sizes, axis=1, keepdims=True))
    inertia, damping, stiffness = scale * inertia, scale * damping, scale * stiffness
    nodes, weights = RADAU
    size = inertia.shape[0]

    def advance(state, number):
        angle = 2 * system.spin.speed * step * (number + nodes)
        waves = jnp.stack([jnp.ones_like(angle), jnp.cos(angle), jnp.sin(angle)])
        # Unknown are the velocities V of the stages: q + A V their places, p + A (forces) = M V.
        by_damping = jnp.einsum("ij,wj,wab->iajb", weights, waves, damping)
        by_stiffness = jnp.einsum("ik,wk,kj,wab->iajb", weights, waves, weights, stiffness)
        own = jnp.einsum("ij,ab->iajb", jnp.eye(STAGES), inertia)
        places, momenta = state[:size], state[size:]
        pushed = jnp.einsum("ij,wj,wab,bc->iac", weights, waves, stiffness, places)
        velocities = jnp.linalg.solve(
            (own + by_damping + by_stiffness).reshape(STAGES * size, -1),
            (momenta - pushed).reshape(STAGES * size, -1),
        ).reshape(STAGES, size, -1)
        places = places + jnp.einsum("j,jac->ac", weights[-1], velocities)
        return jnp.concatenate([places, inertia @ velocities[-1]]), None

    return jax.lax.scan(advance, jnp.eye(2 * size), jnp.arange(steps))[0]


def _coefficients(system: System, step: Scalar) -> tuple[Array, Array, Array]:
    """`M`, and of `C` and `K` the constant part and that by the cosine and sine of `2 Omega t`.

    Of real coordinates `(x, y)`, with time in steps.
    """
    blocks, speed, own = system.blocks, system.spin.speed, Pencil.mean(system)
    zero = jnp.zeros_like(own.inertia)
    part = lambda block: zero if block is None else block
    turning = part(blocks.rotating_damping)
    # exp(2 i Omega t) of the rotating parts, on q* = r* exp(-i Omega t) of the shaft's axes
    waves = {
        "damping": (own.damping, part(blocks.fixed_damping), turning),
        "stiffness": (
            own.stiffness,
            part(blocks.fixed_stiffness),
            part(blocks.rotating_stiffness) + 1j * speed * turning,
        ),
    }
    real = {
        name: jnp.stack([_real(mean, fixed), _real(zero, wave), _real(zero, 1j * wave)])
        for name, (mean, fixed, wave) in waves.items()
    }
    inertia = _real(own.inertia, zero)
    return inertia, step * real["damping"], step**2 * real["stiffness"]


def _real(own: Complex[Array, "n n"], other: Complex[Array, "n n"]) -> Float[Array, "m m"]:
    """`own q + other q*` of `q = x + i y` as a matrix of `(x, y)`."""
    plus, minus = own + other, own - other
    return jnp.block([[plus.real, -minus.imag], [plus.imag, minus.real]])


@jax.custom_jvp
def multipliers_of(matrix: Float[Array, "m m"]) -> Complex[Array, " m"]:
    """Eigenvalues of a monodromy matrix, in no order, zero where they are rounding; differentiable."""
    values = jnp.linalg.eigvals(matrix)
    return jnp.where(jnp.abs(values) <= LEAST * jnp.max(jnp.abs(values)), 0.0, values)


@multipliers_of.defjvp
def _multipliers_jvp(primals, tangents):
    """By the vectors of each alone: the zeros share theirs, which would spoil all others."""
    (matrix,), (tangent,) = primals, tangents
    values = multipliers_of(matrix)
    zero, one = jnp.zeros(matrix.shape, complex), jnp.eye(matrix.shape[0], dtype=complex)
    changes = root_changes(
        values, Pencil(zero, one, zero - matrix), Pencil(zero, zero, -tangent + zero)
    )
    return values, jnp.where(values != 0, changes, 0.0)


def _radau(stages: int) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s s"]]:
    """Nodes in a step, zeros of `P_s - P_(s-1)`, and weights of the stages (Radau IIA)."""
    series = np.zeros(stages + 1)
    series[-2:] = -1, 1
    points = np.sort(legendre.legroots(series).real)
    for _ in range(3):  # polished
        points = points - legendre.legval(points, series) / legendre.legval(
            points, legendre.legder(series)
        )
    integrals = [legendre.legint(one, lbnd=-1) for one in np.eye(stages)]
    integral = np.stack([legendre.legval(points, one) for one in integrals], axis=1) / 2
    return (points + 1) / 2, integral @ np.linalg.inv(legendre.legvander(points, stages - 1))


RADAU = _radau(STAGES)
