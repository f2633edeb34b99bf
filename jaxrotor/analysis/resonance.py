"""Distance of a frequency from a resonance of an undamped rotor."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex

from ..core.quantities import Scalar


CRITICAL = 1e-9  # relative distance below which a response has no correct digits
CLEAR = 1e-5  # estimate of the distance above which it need not be known


def from_resonance(dynamic: Complex[Array, "m m"]) -> Scalar:
    """`1 / max diag( |D^-1| |D| )`: about the relative distance of a frequency from a resonance.

    Its inverse is the factor by which relative errors of `D` are magnified; units of rows cancel.
    """
    dynamic = jax.lax.stop_gradient(dynamic)

    def exact(_):
        magnified = jnp.einsum("ij,ji->i", jnp.abs(jnp.linalg.inv(dynamic)), jnp.abs(dynamic))
        return jnp.where(jnp.all(jnp.isfinite(magnified)), 1 / jnp.max(magnified), 0.0)

    guess = _near_resonance(dynamic)
    return jax.lax.cond(guess > CLEAR, lambda _: guess, exact, None)


def _near_resonance(dynamic: Complex[Array, "m m"]) -> Scalar:
    """The distance of `from_resonance`, or as little as 0.7 of it, where it is small.

    `D^-1` is then `x y^H / (y^H a)`: `x = D^-1 a` and `y = D^-H b` of any `a` and `b` are null vectors.
    Elsewhere it is some number that is not small. Its response takes the same factors of `D`.
    """
    size = jnp.abs(dynamic.real) + jnp.abs(dynamic.imag)
    rows = jnp.max(size, axis=1)
    columns = jnp.max(size / jnp.where(rows > 0, rows, 1.0)[:, None], axis=0)
    some = np.random.default_rng(0).standard_normal((2, len(dynamic)))
    factors = jax.scipy.linalg.lu_factor(dynamic)
    a, b = rows * some[0] + 0j, columns * some[1] + 0j
    x = jax.scipy.linalg.lu_solve(factors, a)
    y = jax.scipy.linalg.lu_solve(factors, b, trans=2)
    found = jnp.abs(y.conj() @ a) / jnp.max(jnp.abs(x) * (jnp.abs(y) @ size))
    return jnp.where(jnp.isfinite(found), found, 0.0)
