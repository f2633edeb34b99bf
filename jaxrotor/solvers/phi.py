"""Exponential and phi functions: `phi_k(z) = Int_0^1 exp((1 - u) z) u^(k-1)/(k-1)! du`, `phi_0 = exp`.

    phi_k(z) = (phi_(k-1)(z) - 1/(k-1)!) / z = Sum_j z^j / (j + k)!

Source: Hochbruck, Ostermann, Acta Numerica 19 (2010), eqs. (2.10), (2.11).
"""

import functools
import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, Inexact

from ..core.linalg import expm


NEAR = 0.5  # below it, the series; above it, the recurrence, which loses three digits at most
BALANCINGS = 8  # sweeps over rows and columns
TERMS = 14  # of the series, whose remainder is below 0.5^14 / 15! < 1e-16


@functools.partial(jax.custom_jvp, nondiff_argnums=(1,))
def phi_scalar(z: Complex[Array, " m"], count: int) -> list[Complex[Array, " m"]]:
    """`phi_0 .. phi_count` of every eigenvalue, to rounding."""
    small = jnp.abs(z) < NEAR
    near, far = jnp.where(small, z, 0.0), jnp.where(small, 1.0, z)
    values = [jnp.exp(z)]
    for k in range(1, count + 1):  # recurrence upwards, away from zero
        values.append((values[-1] - 1 / math.factorial(k - 1)) / far)
    series = jnp.zeros_like(z)
    for j in reversed(range(TERMS)):
        series = series * near + 1 / math.factorial(j + count)
    for k in reversed(range(1, count + 1)):  # recurrence downwards from the series of the last
        values[k] = jnp.where(small, series, values[k])
        series = series * near + 1 / math.factorial(k - 1)
    return values


@phi_scalar.defjvp
def _phi_scalar_jvp(count, primals, tangents):
    """`d phi_k / dz = phi_k - k phi_(k+1)`."""
    values = phi_scalar(*primals, count + 1)
    rates = [values[k] - k * values[k + 1] for k in range(count + 1)]
    return values[:-1], [rate * tangents[0] for rate in rates]


def phi_dense(
    a: Inexact[Array, "m m"], b: Inexact[Array, "m p"], count: int
) -> tuple[Inexact[Array, "m m"], list[Inexact[Array, "m p"]]]:
    """`exp(a)` and `phi_k(a) b`, k = 1 .. count, from one exponential of a bordered matrix."""
    m, p = b.shape
    units = balancing_units(a)
    a = a * units / units[:, None]
    b = b / units[:, None]
    unit = jax.lax.stop_gradient(jnp.max(jnp.abs(b), axis=0, initial=0.0))
    unit = jnp.where(unit > 0, unit, 1.0)
    size = m + count * p
    bordered = jnp.zeros((size, size), a.dtype).at[:m, :m].set(a)
    if count:
        bordered = bordered.at[:m, m : m + p].set(b / unit)
        shift = jnp.eye((count - 1) * p)
        bordered = bordered.at[m : size - p, m + p :].set(shift)
    exponential = expm(bordered, max_squarings=64)
    flow = exponential[:m, :m] / units * units[:, None]
    parts = [exponential[:m, m + k * p : m + (k + 1) * p] for k in range(count)]
    return flow, [unit * units[:, None] * part for part in parts]


def balancing_units(a: Inexact[Array, "m m"]) -> Float[Array, " m"]:
    """Units `d` of coordinates in which rows and columns of `D^-1 a D` are alike; held constant.

    The norm of the matrix of a machine falls from 1e6 to 1e2, near its largest eigenvalue. An exponential
    by squarings loses as many digits as the norm has beyond that.

    Source: Osborne, J. ACM 7 (1960), all rows at once.
    """
    size = jax.lax.stop_gradient(jnp.abs(a))
    size = size - jnp.diag(jnp.diagonal(size))

    def sweep(_, state):
        size, units = state
        rows, columns = size.sum(axis=1), size.sum(axis=0)
        both = (rows > 0) & (columns > 0)
        change = jnp.where(both, columns / jnp.where(both, rows, 1.0), 1.0) ** 0.25
        return size * change[:, None] / change, units / change

    return jax.lax.fori_loop(0, BALANCINGS, sweep, (size, jnp.ones(a.shape[0])))[1]
