"""Run-up and run-down in closed form: constant torque, linear and quadratic resistance."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from ..core.extremes import smaller
from ..core.quantities import Scalar, known
from .base import Turning


def riccati(
    time: ArrayLike,
    polar: ArrayLike,
    torque: ArrayLike,
    slope: ArrayLike,
    drag: ArrayLike,
    speed: ArrayLike,
) -> Turning:
    """Solution of `I Omega. = M0 - k1 Omega - k2 Omega^2`, `Omega(0) = Omega_0`, in closed form.

    With `D^2 = k1^2 + 4 k2 M0`, `x = t / 2 I`, `N = cosh D x + (k1 + 2 k2 Omega_0) sinh(D x) / D`:

        Omega  = ( Omega_0 (cosh D x - k1 sinh(D x) / D) + 2 M0 sinh(D x) / D ) / N
        Omega. = ( M0 - k1 Omega_0 - k2 Omega_0^2 ) / ( I N^2 )
        theta  = (I / k2) ( ln N - k1 x )

    evaluated so that nothing overflows and no digit is lost where D, k1, k2 or M0 vanish. Braking can
    make D^2 negative. The drag `k2 Omega^2` keeps its sign, so it drives the rotor where Omega < 0.

    Args:
        time: t >= 0 [s], of any shape.
        polar: I [kg m^2].
        torque: M0 [N m].
        slope: k1 [N m s].
        drag: k2 [N m s^2].
        speed: Omega_0 [rad/s].

    Returns:
        Angle, speed and acceleration, differentiable by every argument; NaN for a traced time from
        `blow_up_time` on, where there is no solution.

    Raises:
        ValueError: If a known time is negative, or not below `blow_up_time`.

    Source: course project "Dynamic reactions in the bearings of a rotor", eq. (11).
    """
    time, *data = (jnp.asarray(a, float) for a in (time, polar, torque, slope, drag, speed))
    if known(time) and np.any(np.asarray(time) < 0):
        raise ValueError(f"`time [s]` must not be negative, but is {np.min(time):g}.")
    last = blow_up_time(*data)
    if known(time) and known(last) and np.any(np.asarray(time) >= np.asarray(last)):
        raise ValueError(
            f"`time [s]` must be below {float(last):g}, where the speed runs away to minus infinity, as "
            f"the drag drives a negative speed, but is {np.max(time):g}; use odd drag."
        )
    return _solution(time, last, *data)


def steady_speed(torque: ArrayLike, slope: ArrayLike, drag: ArrayLike) -> Scalar:
    """Stable steady speed of `riccati`: `Omega* = 2 M0 / (k1 + D)` [rad/s].

    Args:
        torque: M0 [N m].
        slope: k1 [N m s].
        drag: k2 [N m s^2].

    Returns:
        The speed at which the torques balance; NaN if a brake (M0 < 0) is too strong for a balance,
        infinite if nothing resists.
    """
    torque, slope, drag = (jnp.asarray(a, float) for a in (torque, slope, drag))
    d = jnp.sqrt(slope**2 + 4 * drag * torque)
    steep = slope < 0  # then k1 + D is a difference
    none = (torque == 0) & (slope + d == 0)
    fall = jnp.where(steep | none, 1.0, slope + d)
    return jnp.where(steep, (d - slope) / (2 * jnp.where(steep, drag, 1.0)), 2 * torque / fall)


def relaxation_rate(
    polar: ArrayLike, torque: ArrayLike, slope: ArrayLike, drag: ArrayLike
) -> Scalar:
    """Rate at which the speed of `riccati` approaches `steady_speed`: `D / I` [1/s].

    Args:
        polar: I [kg m^2].
        torque: M0 [N m].
        slope: k1 [N m s].
        drag: k2 [N m s^2].

    Returns:
        The rate; zero if there is no steady speed.
    """
    polar, torque, slope, drag = (jnp.asarray(a, float) for a in (polar, torque, slope, drag))
    square = slope**2 + 4 * drag * torque
    there = square > 0
    return jnp.where(there, jnp.sqrt(jnp.where(there, square, 1.0)), 0.0) / polar


def stop_time(
    polar: ArrayLike, torque: ArrayLike, slope: ArrayLike, drag: ArrayLike, speed: ArrayLike
) -> Scalar:
    """Time at which the speed of `riccati` is first zero [s].

    Args:
        polar: I [kg m^2].
        torque: M0 [N m].
        slope: k1 [N m s].
        drag: k2 [N m s^2].
        speed: Omega_0 [rad/s].

    Returns:
        The time; infinite if the rotor never stops.
    """
    polar, torque, slope, drag, speed = (
        jnp.asarray(a, float) for a in (polar, torque, slope, drag, speed)
    )
    rotates = speed != 0
    ratio = torque / jnp.where(rotates, speed, 1.0)
    time = 2 * polar * _first_zero(slope**2 + 4 * drag * torque, 2 * ratio - slope)
    time = jnp.where(time < blow_up_time(polar, torque, slope, drag, speed), time, jnp.inf)
    return jnp.where(rotates, time, 0.0)


def blow_up_time(
    polar: ArrayLike, torque: ArrayLike, slope: ArrayLike, drag: ArrayLike, speed: ArrayLike
) -> Scalar:
    """Time at which the speed of `riccati` reaches minus infinity [s].

    Args:
        polar: I [kg m^2].
        torque: M0 [N m].
        slope: k1 [N m s].
        drag: k2 [N m s^2].
        speed: Omega_0 [rad/s].

    Returns:
        The time; infinite if it never does.
    """
    polar, torque, slope, drag, speed = (
        jnp.asarray(a, float) for a in (polar, torque, slope, drag, speed)
    )
    return 2 * polar * _first_zero(slope**2 + 4 * drag * torque, slope + 2 * drag * speed)


# === each degenerate case has its own branch; the others get harmless numbers (double where)

_NEAR = 1.0  # |D x|^2 up to which cosh and sinh are computed by their series
_TERMS = 14
# Of cosh, in (D x)^2
_COSH = [1 / float(np.prod(np.arange(1.0, 2 * k + 1))) for k in range(_TERMS)]
_SINH = [c / (2 * k + 1) for k, c in enumerate(_COSH)]  # of sinh(D x) / D x


@jax.jit
def _solution(time, last, polar, torque, slope, drag, speed) -> Turning:
    x, square = time / (2 * polar), slope**2 + 4 * drag * torque
    z = square * x**2
    start = (torque - slope * speed - drag * speed**2) / polar
    apart = _apart(time, z > _NEAR, square, polar, torque, slope, drag, speed, start)
    near = _near(x, z, polar, torque, slope, drag, speed, start)
    both = (jnp.where(z > _NEAR, a, b) for a, b in zip(apart, near, strict=True))
    return Turning(*(jnp.where(time < last, value, jnp.nan) for value in both))


def _apart(time, there, square, polar, torque, slope, drag, speed, start):
    """Rotation where D^2 > 0 is large, so that the two steady speeds are well apart.

    With the steady speed w that stays finite as k2 -> 0 and `v = Omega - w`: `I v. = -r v - k2 v^2`,
    r = D or -D, so `v = v0 E / (1 + h)`, `h = k2 v0 (1 - E) / r`, `E = exp(-r t / I)`, and
    `theta = w t + (I / k2) ln(1 + h)`.
    """
    d = jnp.sqrt(jnp.where(there, square, 1.0))
    r = jnp.where(slope < 0, -d, d)
    w = 2 * torque / (slope + r)
    v0 = jnp.where(there, speed - w, 0.0)
    power = -r * time / polar
    # If r < 0, E grows without bound, but drag ends the growth of v long before the cut of E.
    most = jnp.where(drag == 0, jnp.inf, 0.4 * float(np.log(jnp.finfo(power.dtype).max)))
    cut = smaller(power, most)
    y = -v0 * jnp.expm1(cut) / r
    e, fall = jnp.exp(cut), 1 + drag * y
    rest = polar * jnp.where(power > most, power - most, 0.0) / jnp.where(drag == 0, 1.0, drag)
    angle = w * time + polar * y * _log_ratio(drag * y) + rest
    return angle, w + v0 * e / fall, start * e / fall / fall


def _near(x, z, polar, torque, slope, drag, speed, start):
    """Rotation where the steady speeds are close or complex, so that D x is small or imaginary."""
    k = slope * x
    small = jnp.abs(z) <= _NEAR
    inside = jnp.where(small, z, 0.0)
    phase = jnp.sqrt(jnp.where(z < -_NEAR, -z, 1.0))
    cosh = jnp.where(small, _series(_COSH, inside), jnp.cos(phase))
    sinh = x * jnp.where(small, _series(_SINH, inside), jnp.sin(phase) / phase)
    here = z <= _NEAR
    n = jnp.where(here, cosh + (slope + 2 * drag * speed) * sinh, 1.0)
    # ln N - k = ln(1 + k2 y); N exp(-k) - 1 = k2 y is computed by a divided difference of the series.
    gentle = small & (k**2 <= 4)
    k_in = jnp.where(gentle, k, 0.0)
    apart = _divided(_COSH, inside, k_in**2) + k_in * _divided(_SINH, inside, k_in**2)
    y = jnp.exp(-k_in) * (2 * speed * sinh + 4 * torque * x**2 * apart)
    soft = polar * y * _log_ratio(jnp.where(gentle, drag * y, 0.0))
    strong = here & ~gentle
    logarithm = jnp.log(jnp.where(strong & (n > 0), n, 1.0))
    hard = polar / jnp.where(strong, drag, 1.0) * (logarithm - k)
    omega = (speed * (cosh - slope * sinh) + 2 * torque * sinh) / n
    return jnp.where(gentle, soft, hard), omega, start / n**2


def _series(coefficients: list[float], z: Array) -> Array:
    return jnp.polyval(jnp.asarray(coefficients[::-1]), z)


def _divided(coefficients: list[float], z: Array, y: Array) -> Array:
    """Divided difference `(P(z) - P(y)) / (z - y)` of a polynomial, also for z = y."""
    value, difference = jnp.zeros_like(z), jnp.zeros_like(z)
    for c in coefficients[::-1]:
        difference = difference * y + value
        value = value * z + c
    return difference


def _log_ratio(h: Array) -> Array:
    """`ln(1 + h) / h`, by its series near h = 0."""
    small = jnp.abs(h) < 0.02
    near = _series([(-1) ** k / (k + 1) for k in range(11)], jnp.where(small, h, 0.0))
    far = jnp.where(small, 1.0, h)
    return jnp.where(small, near, jnp.log1p(far) / far)


def _first_zero(square: Array, b: Array) -> Array:
    """First `x > 0` where `cosh D x + b sinh(D x) / D = 0`, `square` = D^2; infinite if none.

    `tanh(D x) / D = -1 / b`: with `y = D^2 / b^2`, `x = artanh(sqrt y) / (-b sqrt y)`.
    """
    falling = b < 0
    y = jnp.where(falling, square, 0.0) / jnp.where(falling, b, 1.0) ** 2
    close = jnp.abs(y) < 0.01
    near = _series([1 / (2 * k + 1) for k in range(9)], jnp.where(close, y, 0.0))
    two = falling & ~close & (y > 0) & (y < 1)
    root = jnp.sqrt(jnp.where(two, y, 0.25))
    none = square < 0
    rate = jnp.sqrt(jnp.where(none, -square, 1.0))
    x = jnp.where(two, jnp.arctanh(root) / (root * jnp.where(falling, -b, 1.0)), jnp.inf)
    x = jnp.where(none, jnp.arctan2(rate, jnp.where(none, -b, 1.0)) / rate, x)
    return jnp.where(falling & close, near / jnp.where(falling, -b, 1.0), x)
