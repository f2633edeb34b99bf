"""Distance of a frequency from a resonance of an undamped rotor."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex

from ..core import linalg
from ..core.quantities import Scalar


CRITICAL = 1e-9  # relative distance below which a response has no correct digits


def from_resonance(
    dynamic: Complex[Array, "m m"], damping: Complex[Array, "m m"], inertia: Complex[Array, "m m"]
) -> Scalar:
    """`1 / max diag( |D^-1| (|D| + |w C| + |I|) )`: about the relative distance from a resonance.

    `D = K + i w C - I` is the dynamic stiffness, where `w C` are damping and gyroscopic moments, and
    `I = w^2 M`. Where elements of `D` are small differences of these terms, as the only one of an undamped
    rotor of one coordinate is, their errors are those of the terms; `K` is at most as large as the others
    and `D` together. The inverse of the distance is about the factor by which relative errors of the
    terms are magnified; units of rows cancel. Near a resonance of one or two modes `D^-1` is about
    `X (Y^H A)^-1 Y^H`, with `X = D^-1 A` and `Y = D^-H B` for any two columns `A` and `B`, which takes a
    fraction of the time of the inverse. The distance is too small then by a factor down to 0.7, as moduli
    are `|Re| + |Im|`; far from a resonance of a rotor with more than two coordinates it tells the order of
    magnitude at best.
    """
    dynamic, damping, inertia = jax.lax.stop_gradient((dynamic, damping, inertia))
    modulus = lambda part: jnp.abs(part.real) + jnp.abs(part.imag)
    size = modulus(dynamic) + modulus(damping) + modulus(inertia)
    rows = jnp.max(size, axis=1)
    columns = jnp.max(size / jnp.where(rows > 0, rows, 1.0)[:, None], axis=0)
    some = np.random.default_rng(0).standard_normal((2, len(dynamic), min(2, len(dynamic))))
    factors = linalg.lu_factor(dynamic)
    a, b = rows[:, None] * some[0] + 0j, columns[:, None] * some[1] + 0j
    x = linalg.lu_solve(factors, a)
    y = linalg.lu_solve(factors, b, trans=2)
    inverse = x @ linalg.solve(y.conj().T @ a, y.conj().T)
    found = 1 / jnp.max(jnp.sum(jnp.abs(inverse) * size.T, axis=1))
    return jnp.where(jnp.isfinite(found), found, 0.0)
