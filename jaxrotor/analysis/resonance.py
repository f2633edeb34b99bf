"""Distance of a frequency from a resonance of an undamped rotor."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex

from ..core.quantities import Scalar


CRITICAL = 1e-9  # relative distance below which a response has no correct digits


def from_resonance(dynamic: Complex[Array, "m m"]) -> Scalar:
    """`1 / max diag( |D^-1| |D| )`: about the relative distance of a frequency from a resonance.

    Its inverse is the factor by which relative errors of `D` are magnified; units of rows cancel. Near a
    resonance `D^-1` is `x y^H / (y^H a)`, where `x = D^-1 a` and `y = D^-H b` are null vectors for any `a`
    and `b`. The distance is computed by these two, which takes a fraction of the time of the inverse: the
    response takes the same factors of `D`. It is off by a factor of up to 0.7 there, and far from a
    resonance it is some number that is not small.
    """
    dynamic = jax.lax.stop_gradient(dynamic)
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
