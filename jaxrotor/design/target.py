"""Target: the loss with its constraints as one number, by the augmented Lagrangian."""

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
    """Scale, multipliers and penalties that combine loss and `c` constraints into one number."""

    scale: Scalar  # of the whole, so that the first step of a solver is of order 1
    multipliers: Float[Array, " c"]
    penalties: Float[Array, " c"]


class Evaluation(NamedTuple):
    """Loss (or `m` residuals), then constraints, and their derivatives."""

    values: Float[Array, " k"]
    slopes: Float[Array, "k n"]


def evaluator(
    function: Callable[[Float[Array, " n"]], Float[Array, " k"]], reverse: bool
) -> Callable[[Float[Array, " n"]], Evaluation]:
    """`u -> Evaluation`, all derivatives in one pass, forward or reverse.

    Its own derivative is the one it has computed. So an optimiser may differentiate it in either mode,
    and keeps a matrix of `k` by `n` instead of all that a motion stores.
    """

    @jax.jit  # solvers evaluate a target several times before they step: it is traced once
    def evaluate(u: Float[Array, " n"]) -> Evaluation:
        twice = lambda u: (function(u),) * 2
        slopes, values = (jax.jacrev if reverse else jax.jacfwd)(twice, has_aux=True)(u)
        return Evaluation(values, slopes)

    @jax.custom_jvp
    def moved(u: Float[Array, " n"], found: Evaluation) -> Evaluation:
        del u
        return found

    @moved.defjvp
    def _(primals, tangents):
        found = primals[1]
        return found, Evaluation(found.slopes @ tangents[0], jnp.zeros_like(found.slopes))

    # `u` is constant in there: else jax.linearize would trace all of it twice more.
    return lambda u: moved(u, evaluate(jax.lax.stop_gradient(u)))


def loss_and_constraints(
    loss: Callable[[Scene], Any], constraints: Constraints, scene: Scene, bounds: Bounds
) -> Callable[[Float[Array, " n"]], Float[Array, " k"]]:
    """Loss or residuals, then constraints, as a function of the free numbers."""

    def of(u: Float[Array, " n"]) -> Float[Array, " k"]:
        placed = bounds.placed(scene, u)
        parts = [loss(placed), *(excess(placed) for _, excess in constraints)]
        return jnp.concatenate([jnp.atleast_1d(jnp.asarray(part, float)) for part in parts])

    return of


def augmented(evaluation: Evaluation, weights: Weights, squares: bool, residuals: bool) -> Array:
    """`f + sum rho / 2 max(0, c + lambda / rho)^2`, `f` a loss or, if `squares`, a sum of them.

    With `residuals` it is the vector of which these are the squares. Infinite where a value or a
    derivative is not finite, so that solvers step back from there.
    """
    values, slopes = evaluation
    own = values[: values.size - weights.multipliers.size]
    excess = values[own.size :] + weights.multipliers / weights.penalties
    penalty = jnp.sqrt(weights.penalties / 2) * larger(excess, 0.0)
    finite = jnp.all(jnp.isfinite(values)) & jnp.all(jnp.isfinite(slopes))
    if residuals:
        return jnp.where(finite, jnp.sqrt(weights.scale) * jnp.concatenate([own, penalty]), jnp.inf)
    total = (jnp.sum(own**2) if squares else own[0]) + jnp.sum(penalty**2)
    return jnp.where(finite, weights.scale * total, jnp.inf)


def shape_of(
    loss: Callable[[Scene], Any], name: str, scene: Scene, bounds: Bounds
) -> tuple[int, ...]:
    """Shape of a loss or constraint; raise unless it is a number, or a vector of residuals."""
    found = eqx.filter_eval_shape(
        lambda u: _number(loss(bounds.placed(scene, u)), name), jnp.zeros(len(bounds.paths))
    )
    shape = found.shape
    wanted = "a number, or a vector of residuals," if name == "`loss`" else "a number"
    if len(shape) > (name == "`loss`") or 0 in shape:
        raise ValueError(f"{name} must return {wanted} but returns an array of shape {shape}.")
    return shape


def _number(found: Any, name: str) -> Array:
    real = eqx.is_inexact_array(found) and not jnp.iscomplexobj(found)
    if not real and not isinstance(found, int | float):
        about = f"{found.dtype} values" if eqx.is_array(found) else repr(found)
        raise ValueError(f"{name} must return real numbers, but returns {about}.")
    return jnp.asarray(found)
