"""Field balancing: influence coefficients from trial runs, and the corrections that follow."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex

from ..core import linalg
from ..core.quantities import known


SAME = 1e-10  # relative difference below which two planes are taken to have the same effect


def influence_coefficients(
    base: ArrayLike, trials: ArrayLike, trial_runs: ArrayLike
) -> Complex[Array, "*readings p"]:
    """`A_j = (v_j - v) / t_j`: vibration due to a unit unbalance in each of `p` planes.

    Args:
        base: v, complex amplitudes without a trial mass, of any shape, such as (speeds, sensors).
        trials: t [kg m], `m r exp(i angle)` of the trial mass of each plane, (p,).
        trial_runs: v_j, amplitudes with that trial mass alone, (p, *readings).

    Returns:
        Influence coefficients, planes on the last axis. Differentiable.

    Raises:
        ValueError: the shapes do not fit, or a trial mass is zero.

    Source: Goodman (1964), least-squares method for computing balance corrections.
    """
    v, t, runs = (jnp.asarray(part, complex) for part in (base, trials, trial_runs))
    if t.ndim != 1 or runs.shape != (*t.shape, *v.shape):
        raise ValueError(
            f"`trial_runs` must hold one run of the shape of `base` per trial, {(*t.shape, *v.shape)}, "
            f"but has shape {runs.shape}."
        )
    if known(t) and np.any(np.asarray(t) == 0):
        raise ValueError(
            "`trials [kg m]` must not be zero: a run without a trial mass determines no coefficient."
        )
    return jnp.moveaxis((runs - v) / t.reshape(-1, *[1] * v.ndim), 0, -1)


def correction_masses(
    influence: ArrayLike, vibration: ArrayLike, weights: ArrayLike | None = None
) -> Complex[Array, " p"]:
    """Corrections `c` that minimise `Sum weight |v + A c|^2` over all sensors and speeds.

    Args:
        influence: A, (*readings, p), see `influence_coefficients`.
        vibration: v, (*readings), without trial masses; at least as many readings as planes.
        weights: non-negative weight of each reading, (*readings); by default all are equal.

    Returns:
        `m r exp(i angle)` [kg m] to add in each plane; the vibration `v + A c` remains. Differentiable.

    Raises:
        ValueError: the shapes do not fit, there are fewer readings than planes, a weight is negative, or
            the readings do not distinguish the planes.

    Source: Goodman (1964), least-squares method for computing balance corrections.
    """
    a, v = jnp.asarray(influence, complex), jnp.asarray(vibration, complex)
    if a.shape[:-1] != v.shape:
        raise ValueError(
            f"`influence` must have the shape of `vibration`, {v.shape}, and then an axis of planes, but "
            f"has shape {a.shape}."
        )
    planes = a.shape[-1]
    check_enough_readings(v.size, planes)
    a, v = a.reshape(-1, planes), v.ravel()
    if weights is not None:
        share = jnp.asarray(weights, float)
        if known(share) and np.any(np.asarray(share) < 0):
            raise ValueError(
                f"`weights` must not be negative, but the smallest is {share.min():g}."
            )
        root = jnp.sqrt(jnp.broadcast_to(share, jnp.shape(vibration))).ravel()
        a, v = root[:, None] * a, root * v
    if known(a):
        sizes = np.linalg.svd(np.asarray(a), compute_uv=False)
        if sizes[-1] <= SAME * sizes[0]:
            raise ValueError(
                "The readings do not distinguish the planes; leave out a plane, or add sensors or "
                "speeds."
            )
    q, r = linalg.qr(a)
    return -linalg.solve_triangular(r, q.conj().T @ v)


def check_enough_readings(readings: int, planes: int) -> None:
    """Raise where there are fewer readings than planes."""
    if readings < planes:
        raise ValueError(
            f"{readings} readings do not determine {planes} planes; add sensors or speeds, or leave out "
            "planes."
        )
