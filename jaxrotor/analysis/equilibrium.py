"""Equilibrium: coordinates of a rotor at rest under constant loads and the forces of its ports.

    matrix x - load - Sum column F(row x) = 0,   x = (Re q, Im q)

It is solved for journals in films and for shafts in rolling bearings.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..core.plane import real_matrix
from ..effects.base import AbstractContact
from ..effects.law import Now
from ..equations.pencil import Pencil
from ..equations.port import Port
from ..equations.system import System
from ..scene import Scene


_Contact = TypeVar("_Contact", bound=AbstractContact)


def linear_part(system: System) -> tuple[Float[Array, "n2 n2"], Float[Array, " n2"]]:
    """Matrix and load of the linear equations of a rotor at rest."""
    mean, fixed = Pencil.mean(system).stiffness, system.blocks.fixed_stiffness
    matrix = real_matrix(mean, jnp.zeros_like(mean) if fixed is None else fixed)
    constant = system.load.constant
    constant = jnp.zeros(system.n, complex) if constant is None else constant
    return matrix, parts_of(constant)


def numbered(scene: Scene, kind: type[_Contact]) -> dict[int, _Contact]:
    """Contacts of a kind by their number among all contacts of a scene."""
    every = enumerate(scene.of(AbstractContact))
    return {number: one for number, one in every if isinstance(one, kind)}


def port_forces_at_rest(
    ports: Sequence[Port], now: Now, x: Float[Array, " n2"]
) -> tuple[Float[Array, " n2"], Float[Array, "n2 n2"]]:
    """Forces of ports in the equations, and their derivative by the coordinates.

    `now` is the rotation of the first shaft.
    """

    def pressed(port: Port) -> tuple[Array, Array]:
        own = port.own(now)
        force = lambda at: port.forces(at, jnp.zeros(2), own).sum(0)
        row, column = double(port.row), double(port.column).T
        value, slope = with_slopes(force, row @ x)
        return column @ value, column @ slope @ row

    values, slopes = of_each(pressed, tuple(ports))
    return values.sum(0), slopes.sum(0)


def double(row: Float[Array, " n"]) -> Float[Array, "2 n2"]:
    """Displacement `(x, y)` of a row by real and imaginary parts."""
    return jnp.stack([jnp.append(row, 0 * row), jnp.append(0 * row, row)])


def parts_of(q: Complex[Array, " n"]) -> Float[Array, " n2"]:
    """Real and imaginary parts."""
    return jnp.concatenate([q.real, q.imag])


def with_slopes(function: Callable, x: Array) -> tuple[Array, Array]:
    """A function of a vector, and its derivative by that."""
    one = lambda along: jax.jvp(function, (x,), (along,))
    value, slopes = jax.vmap(one, out_axes=(None, -1))(jnp.eye(x.size))
    return value, slopes


def of_each(function: Callable, parts: tuple, *more: Array) -> Any:
    """`function(part, ..)` of all parts with the rows of `more`, traced once if the parts are alike."""
    stack = lambda *leaves: jnp.stack(leaves)
    kinds = {(jax.tree.structure(part), *map(jnp.shape, jax.tree.leaves(part))) for part in parts}
    if len(parts) > 1 and len(kinds) == 1:
        return jax.vmap(function)(jax.tree.map(stack, *parts), *more)
    return jax.tree.map(stack, *(function(*each) for each in zip(parts, *more, strict=True)))
