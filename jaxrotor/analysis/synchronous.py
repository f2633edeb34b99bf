"""Synchronous whirl of the undamped rotor: the equations of its critical speeds, and their solutions.

    det( K(Omega) - Omega^2 (M -+ G) ) = 0

Where the stiffness does not depend on the speed, all solutions are eigenvalues. Where it does, those at
a speed are speeds `Omega_j(Omega)`, and the critical ones are the crossings `Omega_j(Omega) = Omega`.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, Int

from ..core.extremes import larger
from ..core.quantities import Scalar
from ..core.sign_change import sign_change
from ..effects.base import AbstractOverSpeed
from ..equations.pencil import Pencil, check_axes, frame, isotropic, root_changes
from ..equations.speed_tables import speed_range
from ..equations.system import System


SAMPLES = 256  # intervals of speed in which crossings are sought
MORE = 16  # crossings for which there is a place, beyond the number of unknowns
SAME = 1e-8  # relative difference of `Omega_j(Omega)` and `Omega` at a crossing

Family = tuple[Complex[Array, "m m"], Complex[Array, "m m"]]


def families(system: System) -> list[Family]:
    """Stiffness and inertia of all synchronous whirls: `(K - Omega^2 M) q = 0`.

    Where all axes are equal, those of forward and those of backward whirl; else those of the pair.
    """
    blocks, part = system.blocks, filled(system)
    stiffness, inertia = part(blocks.stiffness), part(blocks.inertia)
    ahead, behind = (inertia + sense * part(blocks.gyroscopic) for sense in (-1, 1))
    if isotropic(blocks):
        return [(stiffness, ahead), (stiffness, behind)]
    axes, zero = frame(blocks), jnp.zeros_like(inertia)
    check_axes(
        system,
        "There are no single critical speeds, but bands of instability,",
        "use `jaxrotor.floquet_multipliers`",
    )
    unequal = part(getattr(blocks, f"{axes}_stiffness"))
    if axes == "rotating":  # in the shaft's axes both parts of a synchronous whirl stand still
        behind = ahead
    pair = jnp.block([[stiffness, unequal], [unequal.conj(), stiffness.conj()]])
    return [(pair, jnp.block([[ahead, zero], [zero, behind]]))]


def crossings(system: System) -> tuple[Float[Array, " c"], Int[Array, " c"]]:
    """Speeds `Omega = Omega_j(Omega)` of a rotor whose stiffness depends on the speed, and their families.

    They are sought between the ends of its tables, from 0 on, and where these are held constant beyond
    the ends, at all speeds. Two crossings of one `Omega_j` within an interval are missed. Infinite speeds
    fill up. Differentiable, as the implicit function theorem has it.
    """
    held = jax.lax.stop_gradient(system)

    def whirls(system: System, speed: Scalar) -> Float[Array, " m"]:
        own = families(system.at_speed(speed))
        return jnp.concatenate([jnp.sort(synchronous_of(*one)[0]) for one in own])

    def above(speed: Scalar) -> Float[Array, " m"]:
        found = whirls(held, speed)
        there = jnp.isfinite(found)
        found = jnp.where(there, found, 1.0)
        return jnp.where(there, (found - speed) / (found + speed), 1.0)

    speeds = _searched(held, whirls)
    values = jax.lax.map(above, speeds)
    changes = (values[:-1] > 0) != (values[1:] > 0)
    count = values.shape[1]
    order = jnp.argsort(~changes.ravel())[: count + MORE]
    k, j = order // count, order % count

    def refined(case):
        k, j = case
        first, last = speeds[k], speeds[k + 1]
        ends = values[k, j], values[k + 1, j]
        root = sign_change(lambda speed: above(speed)[j], first, last, *ends, ends[1] > 0)
        root = jax.lax.stop_gradient(root)
        # One evaluation has the value, its slope and, as `system` is that of `held`, the derivative.
        one = jnp.ones_like(root)
        value, slope = jax.jvp(lambda speed: whirls(system, speed)[j], (root,), (one,))
        now, slope = jax.lax.stop_gradient((value, slope - 1))
        same = jnp.abs(now - root) < SAME * (now + root)  # else a whirl begins or ends there
        moved = (value - now) / slope
        return jnp.where(same, root - moved, jnp.inf)

    def one(case):
        return jax.lax.cond(case[0], refined, lambda _: jnp.asarray(jnp.inf), case[1:])

    found = jax.lax.map(one, (changes.ravel()[order], k, j))
    return found, j // (count // len(families(held)))


def _searched(system: System, whirls: Callable) -> Float[Array, " w"]:
    """Speeds between which crossings are sought."""
    assert system.tabled is not None
    span = speed_range(system.tabled)
    if span is not None:
        return jnp.linspace(larger(span[0], 0.0), span[1], SAMPLES + 1)
    tables = system.tabled.of(AbstractOverSpeed)
    tops = [nodes[-1] for one in tables for nodes in one.nodes_over_speed]
    top = larger(jnp.max(jnp.stack(tops)), 0.0)
    beyond = whirls(system, top)  # beyond all tables they are constant
    fastest = jnp.max(jnp.where(jnp.isfinite(beyond), beyond, 0.0))
    return jnp.append(jnp.linspace(0.0, top, SAMPLES + 1), 1.01 * larger(fastest, top))


def filled(system: System) -> Callable[[Array | None], Array]:
    """A function that gives a block as a complex matrix, zero if the block is absent."""
    zero = jnp.zeros((system.n, system.n), complex)
    return lambda block: zero if block is None else block + 0j


def synchronous_of(
    stiffness: Array, inertia: Array, vectors: bool = False
) -> tuple[Float[Array, " c"], Complex[Array, "c m"] | None]:
    """Every real `Omega > 0` with `(K - Omega^2 M) q = 0`, else infinite; `q` too if `vectors`.

    `Omega = 0` of a free shaft does not count; rounding leaves about 1e-15 of the scale in its square.
    """
    squares, shapes = _squares(vectors, stiffness, inertia)
    scale = _scale(stiffness, inertia)
    real = jnp.isfinite(squares) & (squares.real > 1e-10 * scale)
    real = real & (jnp.abs(squares.imag) < 1e-6 * jnp.abs(squares))
    return jnp.where(real, jnp.sqrt(jnp.where(real, squares.real, 1.0)), jnp.inf), shapes


def _scale(stiffness: Array, inertia: Array) -> Scalar:
    """Scale [rad^2/s^2] of the order of the square of the first critical speed."""
    return Pencil(inertia, inertia, stiffness).rate ** 2


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _squares(vectors: bool, stiffness: Array, inertia: Array):
    """Every `s` with `(K - s M) q = 0`, infinite for massless coordinates; and `q`, one per row."""
    shift, shapes = _scale(stiffness, inertia), None
    matrix = jnp.linalg.solve(stiffness + shift * inertia, inertia)
    if vectors:
        inverses, columns = jnp.linalg.eig(matrix)
        shapes = columns.T
    else:
        inverses = jnp.linalg.eigvals(matrix)
    finite = jnp.abs(inverses) * shift > 1e-10
    return jnp.where(finite, 1 / jnp.where(finite, inverses, 1.0) - shift, jnp.inf), shapes


@_squares.defjvp
def _squares_jvp(vectors, primals, tangents):
    """Derivatives like those of roots, equal ones by their mean; vectors are held constant."""
    values, shapes = _squares(vectors, *primals)
    linear = lambda stiffness, inertia: Pencil(jnp.zeros_like(inertia), -inertia, stiffness)
    moved = root_changes(values, linear(*primals), linear(*tangents))
    return (values, shapes), (moved, None if shapes is None else jnp.zeros_like(shapes))
