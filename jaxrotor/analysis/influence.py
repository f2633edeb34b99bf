"""Influence: coefficients fitted to any number of runs, the unbalance they tell, and corrections."""

from collections.abc import Hashable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from ..core import linalg
from ..core.quantities import known
from .field_balancing import SAME, check_enough_readings, correction_masses


_PASSES = 3  # of an estimate, whose weights depend on the unbalance that is estimated


class UnbalanceEstimate(eqx.Module):
    """Unbalance of `p` planes as readings tell it, with its covariance."""

    value: Complex[Array, " p"]  # m r exp(i angle) [kg m]
    covariance: Complex[Array, "p p"]  # E d d^H of its error d [kg^2 m^2]
    freedom: float = eqx.field(static=True)  # complex degrees of freedom of the noise

    def radius(self, level: float = 0.95) -> Float[Array, " p"]:
        """`sqrt(f ((1 - level)^(-1/f) - 1) C_jj)`: circle about `value` that contains the unbalance.

        Args:
            level: probability with which it does, for every plane by itself.

        Returns:
            Radius for each plane [kg m]; `asin(radius / |value|)` is that of the angle.
        """
        return _radius(jnp.diagonal(self.covariance, axis1=-2, axis2=-1).real, self.freedom, level)


class Correction(eqx.Module):
    """Correction masses, and the vibration that a run with them is predicted to have."""

    masses: Complex[Array, " p"]  # m r exp(i angle) to add in each plane [kg m]
    vibration: Complex[Array, "*readings"]  # that remains
    variance: Float[
        Array, "*readings"
    ]  # E |d|^2 of its difference d from a reading after the correction
    freedom: float = eqx.field(static=True)  # complex degrees of freedom of the noise

    def radius(self, level: float = 0.95) -> Float[Array, "*readings"]:
        """Circle about `vibration` in which a reading after the correction lies, as of an estimate.

        Args:
            level: probability with which it does, for every reading by itself.

        Returns:
            Radius in the unit of the readings.
        """
        return _radius(self.variance, self.freedom, level)


class Influence(eqx.Module):
    """`v_k = A t_k + b + e_k`: influence coefficients `A` and offsets `b` that runs `k` tell.

    `m` readings a run, of any shape, `p` planes, `s` sessions, each with an offset of its own.
    """

    coefficients: Complex[Array, "*readings p"]  # A
    offset: Complex[Array, "*readings s"]  # b, of every session
    covariance: Complex[Array, "*readings k k"]  # of each reading's A and b, k = p + s
    noise: Complex[Array, "m m"]  # E e e^H of the readings of a run, one behind the other
    misfit: Float[
        Array, "*readings"
    ]  # rms of residuals over the given scatter; 1 if none was given
    freedom: float = eqx.field(static=True)  # runs less k; infinite where the scatter was given
    sessions: tuple[Hashable, ...] = eqx.field(static=True)  # in the order of the offsets

    def __str__(self) -> str:
        """Size, angle [deg] and standard deviation of every coefficient and offset, a row a reading."""
        planes = self.coefficients.shape[-1]
        values = np.concatenate([self.coefficients, self.offset], axis=-1)
        deviations = np.sqrt(np.real(np.diagonal(self.covariance, axis1=-2, axis2=-1)))
        heads = [f"plane {k + 1}" for k in range(planes)]
        heads += ["offset" if len(self.sessions) == 1 else f"offset {one}" for one in self.sessions]
        lines = ["reading " + "".join(f"{head:>27}" for head in heads)]
        for place in np.ndindex(values.shape[:-1]):
            pairs = zip(values[place], deviations[place], strict=True)
            cells = [
                f"{abs(a):.3g} @ {round(np.degrees(np.angle(a)))} +- {s:.1g}" for a, s in pairs
            ]
            name = ", ".join(str(k + 1) for k in place) or "1"
            lines.append(f"{name:8}" + "".join(f"{cell:>27}" for cell in cells))
        return "\n".join(lines)

    def predict(
        self, unbalances: ArrayLike, session: Hashable | None = None
    ) -> Complex[Array, "*readings"]:
        """`A t + b`: readings of a run.

        Args:
            unbalances: t [kg m], complex, (p,).
            session: whose offset is added; needed where there are several.
        """
        return self.coefficients @ jnp.asarray(unbalances, complex) + self._offset(session)[0]

    def estimate(self, readings: ArrayLike, session: Hashable | None = None) -> UnbalanceEstimate:
        """`t = (A^H S^-1 A)^-1 A^H S^-1 (v - b)`, `S = D N D`, `D^2 = 1 + x^T C x* / N`, `x = (t, 1)`.

        `N` is the noise of the readings, and `x^T C x*` the variance of `A t + b`. So the covariance,
        `(A^H S^-1 A)^-1`, contains the scatter of the runs from which the coefficients come. Where these
        told all of `N` it is `(f / (f - m + p))^2` times as large, as weights by an `N` of `f` degrees of
        freedom are not the best ones, and look better than they are. With few runs that is not all: of
        circles by five runs for 95 %, 92 % held the unbalance.

        Args:
            readings: v, (*readings).
            session: whose offset is taken off; needed where there are several.

        Returns:
            An `UnbalanceEstimate`.

        Raises:
            ValueError: the readings have another shape or are too few, the runs leave nothing that would
                tell the noise, or the session is not one of the runs.

        Source: Darlow (1989), Balancing of High-Speed Machinery, section 4.2; Brown (1982), Journal of
        the Royal Statistical Society B 44, 287-308; Reed, Mallett, Brennan (1974), IEEE Transactions on
        Aerospace and Electronic Systems 10, 853-863, for the last factor.
        """
        a, v = self._paired(readings)
        _check_noise(self.freedom)
        offset, last = self._offset(session)
        planes, own = a.shape[1], self.covariance.reshape(len(a), *self.covariance.shape[-2:])
        variances = jnp.diagonal(self.noise).real
        factor, wide = linalg.cholesky(self.noise), jnp.ones(len(a))
        t, square = jnp.zeros(planes, complex), jnp.eye(planes, dtype=complex)
        for _ in range(_PASSES):
            white = lambda x, d=wide: linalg.solve_triangular(factor, (x.T / d).T, lower=True)
            q, r = linalg.qr(white(a))
            t = linalg.solve_triangular(r, q.conj().T @ white(v - offset.ravel()))
            square = linalg.solve_triangular(r, jnp.eye(planes, dtype=complex))
            x = jnp.concatenate([t, last])
            wide = jnp.sqrt(1 + jnp.einsum("j,mjk,k->m", x, own, x.conj()).real / variances)
        left = self.freedom - (len(a) - planes) * _correlated(self.freedom, len(a))
        wider = 1.0 if np.isinf(left) else (self.freedom / left) ** 2
        return UnbalanceEstimate(t, wider * square @ square.conj().T, left)

    def correction(self, vibration: ArrayLike, weights: ArrayLike | None = None) -> Correction:
        """Corrections `c` that minimise `Sum weight |v + A c|^2`, and what they leave.

            E |d|^2 = 2 N + c^T C c*

        `v` and the reading after the correction have the noise `N` each, and `C` is the covariance of
        the coefficients.

        Args:
            vibration: v, (*readings), without trial masses; what is not due to unbalance, such as
                runout, taken off.
            weights: as of `correction_masses`.

        Returns:
            A `Correction`.

        Raises:
            ValueError: as `correction_masses` does.

        Source: Goodman (1964), Journal of Engineering for Industry 86, 273-277.
        """
        masses = correction_masses(self.coefficients, vibration, weights)
        planes, shape = len(masses), self.coefficients.shape[:-1]
        own = self.covariance[..., :planes, :planes]
        spread = jnp.einsum("j,...jk,k->...", masses, own, masses.conj()).real
        noise = jnp.diagonal(self.noise).real.reshape(shape)
        left = jnp.asarray(vibration, complex) + self.coefficients @ masses
        return Correction(masses, left, 2 * noise + spread, self.freedom)

    def _paired(self, readings: ArrayLike) -> tuple[Array, Array]:
        """Coefficients (m, p) and readings (m,)."""
        v, shape = jnp.asarray(readings, complex), self.coefficients.shape[:-1]
        planes = self.coefficients.shape[-1]
        if v.shape != shape:
            raise ValueError(f"`readings` must have the shape {shape}, but has {v.shape}.")
        check_enough_readings(v.size, planes)
        return self.coefficients.reshape(-1, planes), v.ravel()

    def _offset(self, session: Hashable | None) -> tuple[Array, Array]:
        """Offset of a session, (*readings), and which one it is, (s,)."""
        count = len(self.sessions)
        if session is None and count > 1 or session is not None and session not in self.sessions:
            raise ValueError(
                f"`session` must be one of {', '.join(map(repr, self.sessions)) or 'none'}, each of which "
                f"has an offset of its own, but is {session!r}."
            )
        chosen = 0 if session is None else self.sessions.index(session)
        which = jnp.zeros(count, complex).at[chosen : chosen + 1].set(1.0)
        return self.offset @ which, which


def fitted_influence(
    unbalances: ArrayLike,
    readings: ArrayLike,
    *,
    scatter: ArrayLike | None = None,
    offset: bool | Sequence[Hashable] = True,
    ridge: ArrayLike = 0.0,
) -> Influence:
    """`min Sum_k |v_k - A t_k - b|^2 / s_k^2 + ridge Sum_j |A_j|^2 Sum_k |t_kj|^2 / s_k^2`.

    Any number of runs with trial masses in one plane or several, runs without any, and repeats. With a
    base run and one trial in each plane `A` is that of `influence_coefficients`. The covariance
    `C = N X^+ X^+^H`, `X` the rows `(t_k, 1)`, is that of noise with independent real and imaginary
    parts, from run to run.

    Args:
        unbalances: t [kg m], `m r exp(i angle)` added in each of `p` planes, (r, p); zeros in a run
            without masses.
        readings: v, complex amplitudes of every run, (r, *readings), such as (r, speeds, sensors).
        scatter: standard deviation `s` of a reading, `E |e|^2 = s^2`, (r, *readings) or what broadcasts
            to it; by default it is the same in all runs, and found from the residuals, with its
            correlation between readings where `r - k >= 2 m`.
        offset: whether all runs share a constant `b`: the vibration without masses, runout, and drift
            since a baseline that was taken off. Labels of the runs' sessions, (r,), give every session a
            constant of its own.
        ridge: draws coefficients towards zero where runs hardly tell planes apart; their covariance has
            the scatter, not the bias.

    Returns:
        An `Influence`. Differentiable.

    Raises:
        ValueError: the shapes do not fit, a scatter is not positive, `ridge` is negative, or the runs do
            not tell planes and offsets apart.

    Source: Goodman (1964), Journal of Engineering for Industry 86, 273-277; Darlow (1989), Balancing of
    High-Speed Machinery, chapter 4.
    """
    t, v = jnp.asarray(unbalances, complex), jnp.asarray(readings, complex)
    if t.ndim != 2 or v.ndim < 1 or len(v) != len(t):
        raise ValueError(
            f"`unbalances` must have a row for every run and a column for every plane, and `readings` as "
            f"many runs, but have shapes {t.shape} and {v.shape}."
        )
    if known(ridge) and np.any(np.asarray(ridge) < 0):
        raise ValueError(f"`ridge` must not be negative, but is {float(jnp.asarray(ridge)):g}.")
    (runs, planes), shape, flat = t.shape, v.shape[1:], v.reshape(len(v), -1)
    labels, shared = _sessions(offset, runs)
    x = jnp.concatenate([t, jnp.asarray(shared, complex)], axis=1)
    _check_told_apart(x, planes, bool(known(ridge) and np.any(np.asarray(ridge) > 0)))
    s = jnp.ones(v.shape) if scatter is None else jnp.broadcast_to(_positive(scatter), v.shape)

    def one(v, s):
        """Coefficients of a reading, their covariance by unit noise, residuals and what these leave."""
        rows = x / s[:, None]
        drawn = jnp.sqrt(jnp.asarray(ridge)) * linalg.norm(rows[:, :planes], axis=0)
        drawn = jnp.diag(jnp.append(drawn, jnp.zeros(len(labels))))
        q, r = linalg.qr(jnp.concatenate([rows, drawn.astype(complex)]))
        inverse = linalg.solve_triangular(r, q[:runs].conj().T)
        a = inverse @ (v / s)
        return (
            a,
            inverse @ inverse.conj().T,
            v / s - rows @ a,
            runs - jnp.sum(jnp.abs(q[:runs]) ** 2),
        )

    a, square, left, free = jax.vmap(one, in_axes=1)(flat, s.reshape(runs, -1))
    count = runs - x.shape[1]  # more with a ridge, which determines less
    square_sum = jnp.sum(jnp.abs(left) ** 2, axis=1)
    variance = square_sum / free if count else jnp.full(len(a), jnp.nan)
    if scatter is None:
        noise = left @ left.conj().T / jnp.sqrt(free[:, None] * free)
        noise = noise if _correlated(float(count), len(a)) else jnp.diag(variance + 0j)
        square, misfit, freedom = variance[:, None, None] * square, jnp.ones(len(a)), float(count)
    else:
        noise = jnp.diag(jnp.mean(s.reshape(runs, -1) ** 2, axis=0) + 0j)
        misfit, freedom = jnp.sqrt(variance), np.inf
    return Influence(
        coefficients=a[:, :planes].reshape(*shape, planes),
        offset=a[:, planes:].reshape(*shape, len(labels)),
        covariance=square.reshape(*shape, *square.shape[1:]),
        noise=noise,
        misfit=misfit.reshape(shape),
        freedom=freedom,
        sessions=labels,
    )


def _sessions(offset: Any, runs: int) -> tuple[tuple[Hashable, ...], np.ndarray]:
    """Labels of sessions, and which run belongs to which, (r, s)."""
    if offset is False:
        return (), np.zeros((runs, 0))
    own = [0] * runs if offset is True else list(offset)
    if len(own) != runs:
        raise ValueError(
            f"`offset` must be true, false, or the label of each of {runs} runs' session, but has "
            f"{len(own)} labels."
        )
    labels = tuple(dict.fromkeys(own))
    return labels, np.array([[one == label for label in labels] for one in own], float)


def _positive(scatter: ArrayLike) -> Array:
    s = jnp.asarray(scatter, float)
    if known(s) and not np.all(np.asarray(s) > 0):
        raise ValueError(f"`scatter` must be positive, but the smallest is {float(s.min()):g}.")
    return s


def _check_told_apart(x: Array, planes: int, drawn: bool) -> None:
    """Raise where runs do not determine coefficients and offsets; a ridge determines coefficients."""
    if not known(x):
        return
    every = np.asarray(x)[:, planes:] if drawn else np.asarray(x)
    norms = np.linalg.norm(every, axis=0)
    sizes = np.linalg.svd(every / np.where(norms > 0, norms, 1.0), compute_uv=False)
    idle = not np.all(np.any(np.asarray(x) != 0, axis=0))  # a plane that no run has a mass in
    if idle or every.shape[1] > len(every) or sizes.size and sizes[-1] <= SAME * sizes[0]:
        raise ValueError(
            f"{len(every)} runs do not tell {planes} planes and {x.shape[1] - planes} offsets apart; add "
            "runs with other masses and one without, leave out a plane or the offset, or give a `ridge`."
        )


def _correlated(freedom: float, readings: int) -> bool:
    """Whether the residuals tell how the noises of readings are correlated."""
    return bool(np.isfinite(freedom)) and freedom >= 2 * readings


def _check_noise(freedom: float) -> None:
    """Raise if the runs leave nothing that tells the noise."""
    if not freedom > 0:
        raise ValueError(
            "The runs are as many as coefficients and offsets, so they leave nothing that tells the "
            "noise; give the `scatter` of readings, or more runs."
        )


def _radius(variance: Array, freedom: float, level: float) -> Array:
    """Radius of a circle about an estimate: `|d|^2 / C` is distributed as F of 2 and 2 f degrees."""
    if not 0 < level < 1:
        raise ValueError(f"`level` must be between 0 and 1, but is {level!r:.200}.")
    _check_noise(freedom)
    wide = -np.log1p(-level)
    if np.isfinite(freedom):
        wide = freedom * np.expm1(wide / freedom)
    return jnp.sqrt(wide * variance)
