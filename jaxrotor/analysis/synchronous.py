"""Synchronous whirl of the undamped rotor: the equations of its critical speeds, and their solutions.

    det( K(Omega) - Omega^2 (M -+ G) ) = 0

Where the stiffness does not depend on the speed, all solutions are eigenvalues. Where it does, those at
a speed are speeds `Omega_j(Omega)`, and the critical ones are the crossings `Omega_j(Omega) = Omega`.
"""

import functools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, Inexact, Int

from ..core import linalg
from ..core.extremes import larger
from ..core.quantities import Scalar
from ..core.roots import sign_change
from ..equations.pencil import Pencil, check_axes, frame, isotropic, root_changes
from ..equations.speed_tables import nodes_by_first, parts_with_tables, speed_range
from ..equations.system import System


SAMPLES = 48  # intervals of speed in which crossings are sought
PARTS = 6  # of such an interval, where a crossing is in it or may be
MORE = 16  # crossings for which there is a place, beyond the number of unknowns
SAME = 1e-8  # relative difference of `Omega_j(Omega)` and `Omega` at a crossing

Family = tuple[Inexact[Array, "m m"], Inexact[Array, "m m"]]


def families(system: System) -> list[Family]:
    """Stiffness and inertia of all synchronous whirls: `(K - Omega^2 M) q = 0`.

    Where all axes are equal, those of forward and those of backward whirl, real; else those of the pair.
    """
    blocks = system.blocks
    part = filled(system, float if isotropic(blocks) else complex)
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

    All speeds here are magnitudes of those in the sense of the spin. They are sought between the ends of
    its tables, from 0 on, and where these are held constant beyond the ends, at all speeds. Two
    crossings of one `Omega_j` within an interval are missed, see `_sampled`. Infinite speeds fill up.
    Differentiable, as the implicit function theorem has it.
    """
    held = jax.lax.stop_gradient(system)
    count = len(families(held))
    searched, beyond = _searched(held)

    def of_family(family: Array) -> Float[Array, " c"]:
        @jax.jit  # traced once a program
        def above(speed: Scalar) -> Float[Array, " m"]:
            found = _whirls(held, speed, family)
            there = jnp.isfinite(found)
            found = jnp.where(there, found, 1.0)
            return jnp.where(there, (found - speed) / (found + speed), 1.0)

        speeds, values = _sampled(above, searched)

        def refined(case):
            k, j = case
            first, last = speeds[k], speeds[k + 1]
            ends = values[k, j], values[k + 1, j]
            root = sign_change(lambda speed: above(speed)[j], first, last, *ends, ends[1] > 0)
            # Where the value does not vanish at its change of sign, a whirl begins or ends there.
            return jnp.where(jnp.abs(above(root)[j]) < SAME, root, jnp.inf)

        changes = (values[:-1] > 0) != (values[1:] > 0)
        order = jnp.argsort(~changes.ravel())[: values.shape[1] + MORE]
        places = order // values.shape[1], order % values.shape[1]
        none = lambda _: jnp.asarray(jnp.inf)
        one = lambda case: jax.lax.cond(case[0], refined, none, case[1])
        within = jax.lax.map(one, (changes.ravel()[order], places))
        if not beyond:
            return within
        # Beyond all tables the stiffness is constant, so the whirls at their end are critical there.
        last = values[-1]
        inside = (last > 0) & (last < 1)
        far = searched[-1] * (1 + last) / jnp.where(inside, 1 - last, 1.0)
        return jnp.concatenate([within, jnp.where(inside, far, jnp.inf)])

    found = jax.lax.map(of_family, jnp.arange(count))
    family = jnp.repeat(jnp.arange(count), found.shape[1])
    return _implicit(system, jax.lax.stop_gradient(found.ravel()), family), family


@eqx.filter_custom_jvp
def _implicit(system, speeds, families):
    """Crossings `Omega = Omega_j(Omega)`, with the derivatives of the implicit function."""
    return speeds


@_implicit.def_jvp
def _implicit_jvp(primals, tangents):
    """`d Omega = d Omega_j / (1 - dOmega_j / dOmega)`."""
    system, speeds, families = primals

    def moved(case):
        root, family = case
        nearest = lambda system, speed: _nearest(root, *_family(system, speed, family))
        none = jax.tree.map(lambda _: None, tangents[0])
        _, slope = eqx.filter_jvp(nearest, (system, root), (none, jnp.ones_like(root)))
        _, change = eqx.filter_jvp(nearest, (system, root), (tangents[0], jnp.zeros_like(root)))
        return change / (1 - slope)

    none = lambda case: jnp.zeros_like(case[0])
    one = lambda case: jax.lax.cond(jnp.isfinite(case[0]), moved, none, case)
    return speeds, jax.lax.map(one, (speeds, families))


def _family(system: System, speed: Scalar, family: Array | int) -> Family:
    """Stiffness and inertia of one of the families of synchronous whirls at a speed."""
    stiffness, inertia = zip(*families(system.at_speed(system.spin.sense * speed)), strict=True)
    return jnp.stack(stiffness)[family], jnp.stack(inertia)[family]


def _whirls(system: System, speed: Scalar, family: Array | int) -> Float[Array, " m"]:
    """`Omega_j` of a family at a speed, ascending."""
    return jnp.sort(synchronous_of(*_family(system, speed, family))[0])


def _searched(system: System) -> tuple[Float[Array, " w"], bool]:
    """Speeds between which crossings are sought, and whether there are critical speeds above, too."""
    assert system.tabled is not None
    sense, tables = system.spin.sense, parts_with_tables(system.tabled)
    span = speed_range(system.tabled, sense)
    nodes = [one for part in tables for one in nodes_by_first(system.tabled, part, sense)]
    top = larger(jnp.max(jnp.stack([one[-1] for one in nodes])), 0.0)
    low, high = (jnp.zeros(()), top) if span is None else span
    even = jnp.linspace(low, high, SAMPLES + 1)
    cut = [jnp.clip(one, low, high) for one in nodes]
    return jnp.sort(jnp.concatenate([even, *cut])), span is None


def _sampled(
    function: Callable[[Scalar], Array], speeds: Float[Array, " w"]
) -> tuple[Float[Array, " f"], Float[Array, "f m"]]:
    """Speeds, each interval cut into `PARTS`, and values of a function there.

    Inside, an interval is sampled where a value changes its sign, or may do so twice, since it is no
    further from zero than it changes here or beside. Elsewhere its first value stands for all inside.
    """
    ends = _in_order(function, speeds)
    padded = jnp.concatenate([ends[:1], ends, ends[-1:]])
    before, first, last, behind = padded[:-3], padded[1:-2], padded[2:-1], padded[3:]
    near = jnp.minimum(jnp.abs(first), jnp.abs(last))
    steps = [jnp.abs(first - before), jnp.abs(last - first), jnp.abs(behind - last)]
    touches = near <= jnp.max(jnp.stack(steps), axis=0)
    to_sample = jnp.any(touches | ((first > 0) != (last > 0)), axis=1) & (jnp.diff(speeds) > 0)
    shares = jnp.arange(PARTS) / PARTS
    parts = speeds[:-1, None] + jnp.diff(speeds)[:, None] * shares

    def inside(case):
        parts, first = case
        return jnp.concatenate([first[None], jax.lax.map(function, parts[1:])])

    repeated = lambda case: jnp.broadcast_to(case[1], (PARTS, case[1].size))
    sampled_or_repeated = lambda case: jax.lax.cond(case[0], inside, repeated, case[1:])
    values = jax.lax.map(sampled_or_repeated, (to_sample, parts, first)).reshape(-1, ends.shape[1])
    return jnp.append(parts.ravel(), speeds[-1]), jnp.concatenate([values, ends[-1:]])


def _in_order(
    function: Callable[[Scalar], Array], speeds: Float[Array, " w"]
) -> Float[Array, "w m"]:
    """Values at ascending speeds, each speed once, as most tables of a machine have the same nodes."""

    def go(before, speed):
        same = lambda: before[1]
        value = jax.lax.cond(speed == before[0], same, lambda: function(speed))
        return (speed, value), value

    value = jax.eval_shape(function, speeds[0])
    begin = -jnp.ones_like(speeds[0]), jnp.zeros(value.shape, value.dtype)  # no speed is negative
    return jax.lax.scan(go, begin, speeds)[1]


def filled(system: System, kind: type = complex) -> Callable[[Array | None], Array]:
    """A function that gives a block as a matrix of a kind, zero if the block is absent."""
    zero = jnp.zeros((system.n, system.n), kind)
    return lambda block: zero if block is None else block + zero


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


def _nearest(speed: Scalar, stiffness: Array, inertia: Array) -> Scalar:
    """The `Omega` of `synchronous_of` that is nearest to a speed, with its derivative alone."""
    found = _nearest_squares(speed**2, stiffness, inertia)[0].real
    return jnp.sqrt(jnp.where(found > 0, found, jnp.inf))


@jax.custom_jvp
def _nearest_squares(square: Scalar, stiffness: Array, inertia: Array) -> Complex[Array, " k"]:
    """The one or two `s` with `(K - s M) q = 0` that are nearest to a square."""
    found = _squares(False, stiffness, inertia)[0]
    return found[jnp.argsort(jnp.abs(found - square))[:2]]


@_nearest_squares.defjvp
def _nearest_squares_jvp(primals, tangents):
    """Derivatives by the matrices alone."""
    found = _nearest_squares(*primals)
    return found, root_changes(found, _linear(*primals[1:]), _linear(*tangents[1:]))


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _squares(vectors: bool, stiffness: Array, inertia: Array):
    """Every `s` with `(K - s M) q = 0`, infinite for massless coordinates; and `q`, one per row."""
    shift, shapes = Pencil(inertia, inertia, stiffness).shift ** 2, None
    matrix = linalg.solve(stiffness + shift * inertia, inertia)
    if vectors:
        inverses, columns = linalg.eig(matrix)
        shapes = columns.T
    else:
        inverses = linalg.eigvals(matrix)
    finite = jnp.abs(inverses) * shift > 1e-10
    return jnp.where(finite, 1 / jnp.where(finite, inverses, 1.0) - shift, jnp.inf), shapes


@_squares.defjvp
def _squares_jvp(vectors, primals, tangents):
    """Derivatives like those of roots, equal ones by their mean; vectors are held constant."""
    values, shapes = _squares(vectors, *primals)
    moved = root_changes(values, _linear(*primals), _linear(*tangents))
    return (values, shapes), (moved, None if shapes is None else jnp.zeros_like(shapes))


def _linear(stiffness: Array, inertia: Array) -> Pencil:
    """`P(s) = K - s M`."""
    return Pencil(jnp.zeros_like(inertia), -inertia, stiffness)
