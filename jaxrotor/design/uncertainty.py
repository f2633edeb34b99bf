"""Uncertainty: how well residuals determine the parameters that were fitted to them."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core import linalg
from ..core.quantities import Scalar
from ..core.tables import notebook_table
from ..scene import Scene
from .bounds import own_value


class Uncertainty(eqx.Module):
    """`C = sigma^2 (J^T J)^-1`, covariance of `n` fitted parameters in the order of `values`."""

    values: Mapping[str, Scalar]  # SI
    deviations: Mapping[str, Scalar]  # standard, SI
    covariance: Float[Array, "n n"]
    noise: Scalar  # standard deviation of a residual

    def distance(self, values: Mapping[str, Any]) -> Scalar:
        """`(x - x')^T C^-1 (x - x')` [1]; of the true parameters `x'` it is a chi-square of `n` degrees.

        Args:
            values: parameters `x'` by path, SI.

        Returns:
            The squared distance [1].
        """
        missing = [path for path in self.values if path not in values]
        if missing:
            raise ValueError(
                f"`values` must have every fitted parameter, but `{missing[0]}` is missing; it has: "
                f"{', '.join(map(str, values))}."
            )
        given = jnp.stack([jnp.asarray(values[path], float) for path in self.values])
        scale = jnp.stack(list(self.deviations.values()))
        off = (given - jnp.stack(list(self.values.values()))) / scale
        return off @ linalg.solve(self.covariance / jnp.outer(scale, scale), off)

    def _repr_html_(self) -> str:
        rows = [
            (path, float(value), float(self.deviations[path]))
            for path, value in self.values.items()
        ]
        heads = ("parameter", "value, SI", "standard deviation, SI")
        return notebook_table("Fitted parameters", heads, rows)

    def __str__(self) -> str:
        return "\n".join(
            f"{path} = {float(value):.6g} +- {float(self.deviations[path]):.2g}"
            for path, value in self.values.items()
        )


def uncertainty(
    residuals: Callable[[Scene], Any],
    scene: Scene,
    paths: Sequence[str],
    noise: float | None = None,
) -> Uncertainty:
    """`C = sigma^2 (J^T J)^-1`, `J = d residuals / d parameters` at the result of a fit.

    Correct to first order in the noise, for residuals that scatter independently and alike. The fit must
    not have ended on a bound.

    Args:
        residuals: function of a scene that returns the `m` residuals that were fitted, more than there
            are parameters.
        scene: the scene where they are least, such as `tuned.scene`.
        paths: of the `n` parameters, such as `tuned.values`.
        noise: standard deviation sigma of a residual; by default that of the residuals left by the fit,
            `sqrt(sum r^2 / (m - n))`.

    Returns:
        An `Uncertainty`.

    Raises:
        ValueError: if a path is not a single number, the residuals are complex or too few, or they do
            not determine the parameters.

    Source: Nocedal, Wright (2006), Numerical Optimization, section 10.2; Bard (1974), section 7.5.
    """
    values = {path: jnp.asarray(own_value(scene, path)) for path in paths}
    own = jnp.stack(list(values.values()))
    at = lambda x: jnp.ravel(residuals(scene.put(dict(zip(values, x, strict=True)))))
    left, slopes = jax.jit(lambda x: (at(x), jax.jacfwd(at)(x)))(own)
    if jnp.iscomplexobj(left):
        raise ValueError(
            "Residuals must be real, but are complex; return real and imaginary parts."
        )
    return of_slopes(left, slopes, values, noise)


def of_slopes(
    left: Float[Array, " m"],
    slopes: Float[Array, "m n"],
    values: Mapping[str, Scalar],
    noise: float | None = None,
) -> Uncertainty:
    """Uncertainty of `n` parameters from `m` residuals and their slopes; raise if these are not enough."""
    if left.size <= len(values):
        raise ValueError(
            f"{left.size} residuals do not determine {len(values)} parameters and their noise; take more."
        )
    units = np.linalg.norm(slopes, axis=0)
    if not np.all(np.isfinite(slopes)) or not np.all(units > 0):
        wrong = list(values)[int(np.argmin(np.isfinite(units) & (units > 0)))]
        raise ValueError(
            f"The residuals do not depend on `{wrong}`, or not smoothly; leave it out, or begin where "
            "it matters, as in contact with a stop."
        )
    _, sizes, ways = np.linalg.svd(np.asarray(slopes / units), full_matrices=False)
    if sizes[-1] <= np.finfo(float).eps * left.size * sizes[0]:
        raise ValueError(
            f"The residuals do not tell {', '.join(f'`{path}`' for path in values)} apart; leave one out."
        )
    sigma = jnp.sqrt(jnp.sum(left**2) / (left.size - len(values))) if noise is None else noise
    spread = (ways.T / sizes) / units[:, None]
    matrix = jnp.asarray(sigma) ** 2 * (spread @ spread.T)
    deviations = dict(zip(values, jnp.sqrt(jnp.diag(matrix)), strict=True))
    return Uncertainty(values, deviations, matrix, jnp.asarray(sigma, float))
