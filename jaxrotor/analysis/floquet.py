"""Floquet multipliers of a linear rotor over a revolution, with constant or periodic coefficients."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from numpy.polynomial import legendre

from ..core import linalg
from ..core.checks import check_counts
from ..core.compiled import compiled_quickly
from ..core.plane import real_matrix
from ..core.quantities import Scalar, known
from ..equations.pencil import Pencil, check_circular, eigenvalues, frame, root_changes
from ..equations.system import System, assemble
from ..scene import Scene
from .linearized import check_linear
from .modal import natural_roots
from .whirl_tables import OverWhirl, grows_beyond, whirl_roots


STAGES = 7
# Phase of the first mode per step [rad]; its multiplier errs by 3e-8 per step there
LONGEST_STEP = 3.0
LEAST = 1e-8  # multipliers of half a revolution below this part of the largest are rounding


def floquet_multipliers(scene: Scene, steps: int = 32) -> Complex[Array, " m"]:
    """`mu` of the motions `z(t + T) = mu z(t)` over one revolution, `T = 2 pi / |Omega|`.

    The rotor is stable where every `|mu| < 1`; `log(|mu|) / T` is the growth rate. The multipliers are
    the same in the fixed frame and in the axes of the shaft. If a frame has constant coefficients they
    are `exp(lambda T)` of the `roots`. Otherwise, in `x, y` of the fixed frame,

        M q.. + C(2 Omega t) q. + K(2 Omega t) q = 0,    mu = (multiplier of half a revolution)^2

    is integrated by Radau IIA of seven stages, order 13: a step over 2 rad of a mode has an error of
    1e-10, and fast or massless coordinates do not limit the step. For an error of 1e-9 this is about
    thirty times cheaper than Hill's determinant with eight nodes.

    Args:
        scene: the rotor at a speed other than zero; contact is left out.
        steps: steps per half revolution. A mode of frequency w needs `w <= 0.6 steps |Omega|`; modes far
            above appear more damped than they are. The change on doubling `steps` shows the error.

    Returns:
        The `4 n` multipliers, largest first. Those of coordinates without mass, and those below 1e-16
        of the largest, are zero. Differentiable like `roots`. NaN where traced if `steps` is too
        small for the first mode.

    Raises:
        ValueError: `steps` is not a positive integer or too small for the first mode, the speed is zero,
            or there is hysteretic damping with unequal axes.

    Source: Hairer, Wanner (1996), Solving Ordinary Differential Equations II, section IV.5.
    """
    check_counts(steps=steps)
    check_linear(scene)
    speed = scene.spin.speed
    if known(speed) and float(speed) == 0:
        raise ValueError(
            "Floquet multipliers are those of one revolution, but the speed is 0; use `jaxrotor.roots`."
        )
    values = _multipliers(assemble(scene), steps)
    if known(values) and jnp.any(jnp.isnan(values)):
        raise ValueError(
            f"`steps` = {steps} is too small to resolve the first mode at {float(speed):g} rad/s; give "
            "more steps, in inverse proportion to the speed."
        )
    return values


def exponents(system: System | OverWhirl, steps: int = 32) -> Complex[Array, " m"]:
    """`lambda` of every motion, -inf for coordinates without mass; NaN where `grows_beyond` a table.

    They are the roots or, where coefficients are periodic, `log(mu) / T` with imaginary parts between
    `-|Omega|` and `|Omega|` (a multiplier determines a frequency modulo twice the speed).
    """
    if isinstance(system, OverWhirl):
        values = whirl_roots(system.scene)
        values = jnp.where(jnp.isfinite(values), values, -jnp.inf)
        return jnp.where(grows_beyond(jax.lax.stop_gradient(system.scene)), jnp.nan, values)
    if frame(system.blocks) != "periodic":
        values = natural_roots(system)
        return jnp.where(jnp.isinf(values), -jnp.inf, values)
    values, time = half_revolution(system, steps)
    nonzero = values != 0
    return jnp.where(nonzero, jnp.log(jnp.where(nonzero, values, 1.0)) / time, -jnp.inf)


@compiled_quickly
def _multipliers(system: System, steps: int) -> Complex[Array, " m"]:
    if frame(system.blocks) == "periodic":
        values = half_revolution(system, steps)[0] ** 2
    else:
        roots = natural_roots(system)
        finite = jnp.isfinite(roots)
        period = 2 * jnp.pi / jnp.abs(system.spin.speed)
        values = jnp.where(finite, jnp.exp(jnp.where(finite, roots, 0.0) * period), 0.0)
        if values.size == 2 * system.n:  # those of x + i y; x - i y has the conjugates
            values = jnp.concatenate([values, values.conj()])
    return values[jnp.argsort(-jnp.abs(values))]


def half_revolution(system: System, steps: int) -> tuple[Complex[Array, " m"], Scalar]:
    """Multipliers of half a revolution, unordered, and its time [s], which at rest is arbitrary."""
    check_circular(system)
    speed, first = system.spin.speed, _first_frequency(system)
    turning = speed != 0
    time = jnp.where(turning, jnp.pi / jnp.abs(jnp.where(turning, speed, 1.0)), jnp.pi / first)
    resolved = first * time <= LONGEST_STEP * steps
    values = multipliers_of(_monodromy(system, time / steps, steps))
    return jnp.where(resolved, values, jnp.nan), time


def _first_frequency(system: System) -> Scalar:
    """First frequency [rad/s] without damping and anisotropy, a unit of time held constant."""
    own = jax.lax.stop_gradient(Pencil.mean(system))
    undamped = Pencil(own.inertia, jnp.zeros_like(own.damping), own.stiffness.real + 0j)
    return jnp.min(jnp.abs(eigenvalues(undamped)))


def _monodromy(system: System, step: Scalar, steps: int) -> Float[Array, "m m"]:
    """Monodromy matrix of the state `(q, M dq/dtau)` over all steps, `tau` the time in steps.

    With momenta instead of velocities the mass is never inverted, and the momentum of a massless
    coordinate is exactly zero.
    """
    inertia, damping, stiffness = _coefficients(system, step)
    # Each equation is divided by its size, so momenta are of the order of displacements.
    sizes = jnp.abs(inertia) + steps**2 * jnp.abs(stiffness[0])
    scale = jax.lax.stop_gradient(1 / jnp.max(sizes, axis=1, keepdims=True))
    inertia, damping, stiffness = scale * inertia, scale * damping, scale * stiffness
    nodes, weights = RADAU
    size = inertia.shape[0]

    def advance(state, number):
        angle = 2 * system.spin.speed * step * (number + nodes)
        waves = jnp.stack([jnp.ones_like(angle), jnp.cos(angle), jnp.sin(angle)])
        # The unknowns are the velocities V of the stages: displacements q + A V, momenta p + A F = M V.
        by_damping = jnp.einsum("ij,wj,wab->iajb", weights, waves, damping)
        by_stiffness = jnp.einsum("ik,wk,kj,wab->iajb", weights, waves, weights, stiffness)
        own = jnp.einsum("ij,ab->iajb", jnp.eye(STAGES), inertia)
        displacements, momenta = state[:size], state[size:]
        impulses = jnp.einsum("ij,wj,wab,bc->iac", weights, waves, stiffness, displacements)
        velocities = linalg.solve(
            (own + by_damping + by_stiffness).reshape(STAGES * size, -1),
            (momenta - impulses).reshape(STAGES * size, -1),
        ).reshape(STAGES, size, -1)
        displacements = displacements + jnp.einsum("j,jac->ac", weights[-1], velocities)
        return jnp.concatenate([displacements, inertia @ velocities[-1]]), None

    return jax.lax.scan(advance, jnp.eye(2 * size), jnp.arange(steps))[0]


def _coefficients(system: System, step: Scalar) -> tuple[Array, Array, Array]:
    """`M`, and the Fourier coefficients (constant, cosine, sine of `2 Omega t`) of `C` and `K`.

    They are for real coordinates `(x, y)`, with time in steps.
    """
    blocks, speed, own = system.blocks, system.spin.speed, Pencil.mean(system)
    zero = jnp.zeros_like(own.inertia)
    part = lambda block: zero if block is None else block
    turning = part(blocks.rotating_damping)
    # A rotating part acts on r* in the shaft's axes, q* = r* exp(-i Omega t), hence exp(2 i Omega t).
    waves = {
        "damping": (own.damping, part(blocks.fixed_damping), turning),
        "stiffness": (
            own.stiffness,
            part(blocks.fixed_stiffness),
            part(blocks.rotating_stiffness) + 1j * speed * turning,
        ),
    }
    real = {
        name: jnp.stack(
            [real_matrix(mean, fixed), real_matrix(zero, wave), real_matrix(zero, 1j * wave)]
        )
        for name, (mean, fixed, wave) in waves.items()
    }
    inertia = real_matrix(own.inertia, zero)
    return inertia, step * real["damping"], step**2 * real["stiffness"]


@jax.custom_jvp
def multipliers_of(matrix: Float[Array, "m m"]) -> Complex[Array, " m"]:
    """Eigenvalues of a monodromy matrix, unordered, zero where they are rounding; differentiable."""
    values = linalg.eigvals(matrix)
    return jnp.where(jnp.abs(values) <= LEAST * jnp.max(jnp.abs(values)), 0.0, values)


@multipliers_of.defjvp
def _multipliers_jvp(primals, tangents):
    """Each derivative uses its own vectors only: those of repeated zeros would spoil all others."""
    (matrix,), (tangent,) = primals, tangents
    values = multipliers_of(matrix)
    zero, one = jnp.zeros(matrix.shape, complex), jnp.eye(matrix.shape[0], dtype=complex)
    changes = root_changes(
        values, Pencil(zero, one, zero - matrix), Pencil(zero, zero, -tangent + zero)
    )
    return values, jnp.where(values != 0, changes, 0.0)


def _radau(stages: int) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s s"]]:
    """Nodes (zeros of `P_s - P_(s-1)`) and stage weights of Radau IIA, on a step of length 1."""
    series = np.zeros(stages + 1)
    series[-2:] = -1, 1
    points = np.sort(legendre.legroots(series).real)
    for _ in range(3):  # Newton steps to full precision
        points = points - legendre.legval(points, series) / legendre.legval(
            points, legendre.legder(series)
        )
    integrals = [legendre.legint(one, lbnd=-1) for one in np.eye(stages)]
    integral = np.stack([legendre.legval(points, one) for one in integrals], axis=1) / 2
    return (points + 1) / 2, integral @ np.linalg.inv(legendre.legvander(points, stages - 1))


RADAU = _radau(STAGES)
