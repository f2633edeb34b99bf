"""Target: what is minimised, a loss with its constraints by the augmented Lagrangian."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.extremes import larger
from ..core.quantities import Scalar
from ..scene import Scene
from .bounds import Bounds


Constraints = tuple[tuple[str, Callable[[Scene], Any]], ...]


class Weights(NamedTuple):
    """What turns loss and constraints into one number; `c` constraints."""

    scale: Scalar  # of the whole, so that the first step of a solver is of order 1
    multipliers: Float[Array, " c"]
    penalties: Float[Array, " c"]


class Look(NamedTuple):
    """Loss (or `m` residuals) and constraints, one below the other, and their derivatives."""

    values: Float[Array, " k"]
    slopes: Float[Array, "k n"]


def lookout(
    pieces: Callable[[Float[Array, " n"]], Float[Array, " k"]], reverse: bool
) -> Callable[[Float[Array, " n"]], Look]:
    """`u -> Look`, all derivatives in one pass, forward or reverse.

    Its own derivative is what it has seen. So an optimiser may go forward or backward through it, and
    keeps a matrix of `k` by `n` where it would keep what a whole motion leaves behind.
    """

    @jax.jit  # solvers look at a target several times before they step: traced once
    def look(u: Float[Array, " n"]) -> Look:
        twice = lambda u: (pieces(u),) * 2
        slopes, values = (jax.jacrev if reverse else jax.jacfwd)(twice, has_aux=True)(u)
        return Look(values, slopes)

    known = jax.custom_jvp(look)

    @known.defjvp
    def _(primals, tangents):
        seen = look(*primals)
        return seen, Look(seen.slopes @ tangents[0], jnp.zeros_like(seen.slopes))

    return known


def pieces(
    loss: Callable[[Scene], Any], constraints: Constraints, scene: Scene, bounds: Bounds
) -> Callable[[Float[Array, " n"]], Float[Array, " k"]]:
    """Loss or residuals, then constraints, as a function of the free numbers."""

    def of(u: Float[Array, " n"]) -> Float[Array, " k"]:
        placed = bounds.placed(scene, u)
        parts = [loss(placed), *(excess(placed) for _, excess in constraints)]
        return jnp.concatenate([jnp.atleast_1d(jnp.asarray(part, float)) for part in parts])

    return of


def augmented(look: Look, weights: Weights, squares: bool, residuals: bool) -> Array:
    """`f + sum rho / 2 max(0, c + lambda / rho)^2`, `f` a loss or, if `squares`, a sum of them.

    `residuals`: the vector whose squares these are. What is not finite is infinite, so that solvers
    step back from it.
    """
    count = weights.multipliers.size
    own = look.values[: look.values.size - count]
    excess = look.values[look.values.size - count :] + weights.multipliers / weights.penalties
    penalty = jnp.sqrt(weights.penalties / 2) * larger(excess, 0.0)
    good = jnp.all(jnp.isfinite(look.values)) & jnp.all(jnp.isfinite(look.slopes))
    if residuals:
        return jnp.where(good, jnp.sqrt(weights.scale) * jnp.concatenate([own, penalty]), jnp.inf)
    total = (jnp.sum(own**2) if squares else own[0]) + jnp.sum(penalty**2)
    return jnp.where(good, weights.scale * total, jnp.inf)


def shape_of(
    loss: Callable[[Scene], Any], what: str, scene: Scene, bounds: Bounds
) -> tuple[int, ...]:
    """Shape of a loss or constraint; refuses what is no number or vector of numbers."""
    found = eqx.filter_eval_shape(
        lambda u: _number(loss(bounds.placed(scene, u)), what), jnp.zeros(len(bounds.paths))
    )
    shape = found.shape
    wanted = "a number, or a vector of residuals," if what == "`loss`" else "a number"
    if len(shape) > (what == "`loss`") or 0 in shape:
        raise ValueError(f"{what} must return {wanted} but returns an array of shape {shape}.")
    return shape


def _number(found: Any, what: str) -> Array:
    real = eqx.is_inexact_array(found) and not jnp.iscomplexobj(found)
    if not real and not isinstance(found, int | float):
        about = f"{found.dtype} values" if eqx.is_array(found) else repr(found)
        raise ValueError(f"{what} must return real numbers, but returns {about}.")
    return jnp.asarray(found)
