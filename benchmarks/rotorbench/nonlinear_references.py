"""Reference numbers of nonlinear cases: closed forms in many digits, and DOP853 at its least tolerance."""

from collections.abc import Callable
from typing import Any

import numpy as np
from mpmath import mp

from . import nonlinear
from .cases import Case
from .exact import Rotor, number
from .machines import Machine


def full_rub(case: Case) -> np.ndarray:
    """`R = [b g (A + mu B) + sqrt((A^2 + B^2) U^2 s^4 - b^2 g^2 C^2)] / (A^2 + B^2)`, m = k = 1."""
    machine = Machine(case.machine)
    found = _upper(machine, number(machine.speed))[0]
    return np.array([float(found), float(_ring(machine)[1] * (found - _ring(machine)[0]))])


def fold(case: Case) -> np.ndarray:
    """Where the root in `full_rub` is zero."""
    machine = Machine(case.machine)
    speed = mp.findroot(lambda s: _upper(machine, s)[1], (2.4, 2.45), solver="anderson", tol=1e-40)
    return np.array([float(speed), float(_upper(machine, speed, merged=True)[0])])


def _ring(machine: Machine) -> list[Any]:
    ring = machine.parts("annular_stators")[0]
    return [number(ring[key]) for key in ("gap", "stiffness", "friction")]


def _upper(machine: Machine, s: Any, merged: bool = False) -> tuple[Any, Any]:
    """Radius, and what stands below the root."""
    gap, beta, mu = _ring(machine)
    damping = number(machine.parts("disc_dampings")[0]["translational"])
    moment = number(machine.parts("unbalances")[0]["moment"])
    a, b = 1 + beta - s**2, damping * s + mu * beta
    c = damping * s - mu * (1 - s**2)
    size = a**2 + b**2
    below = size * (moment * s**2) ** 2 - (beta * gap * c) ** 2
    root = 0 if merged else mp.sqrt(below)
    return (beta * gap * (a + mu * b) + root) / size, below


def receptance(machine: Machine) -> Callable[[Any, Any], Any]:
    """Displacement at the ring of a circling unit force there, by transfer matrices."""
    rotor, at = Rotor(machine), machine.parts("annular_stators")[0]["at"]
    return lambda whirl, speed: rotor.response(1j * mp.mpmathify(whirl), number(speed), at, at)[0]


def flexible_rub(case: Case) -> np.ndarray:
    machine = Machine(case.machine)
    return np.array([float(x) for x in nonlinear.rub_by(receptance(machine), machine, mp.sqrt)])


def dry_whirl(case: Case) -> np.ndarray:
    machine = Machine(case.machine)
    zero = lambda f: mp.findroot(f, tuple(case.ask["within"]), solver="anderson", tol=1e-30)
    return np.array([float(x) for x in nonlinear.dry_whirl_by(receptance(machine), machine, zero)])


def squeezed(case: Case) -> np.ndarray:
    """`e |1 - r^2 + 2 B r e / s^4 + i B r pi / (2 s^3)| = U r^2`, `s^2 = 1 - e^2`."""
    machine = Machine(case.machine)
    scale = number(machine.parts("squeeze_films")[0]["viscosity"])
    moment, rate = (
        number(machine.parts("unbalances")[0]["moment"]),
        number(machine.speed),
    )

    def excess(e: Any) -> Any:
        s = mp.sqrt(1 - e * e)
        stiff = 1 - rate**2 + 2 * scale * rate * e / s**4
        return e * mp.sqrt(stiff**2 + (scale * rate * mp.pi / (2 * s**3)) ** 2) - moment * rate**2

    return np.array([float(mp.findroot(excess, (0.7, 0.85), solver="anderson", tol=1e-40))])


# === oil films


class Film:
    """The short bearing about its static position, as a function of eccentricity and speed."""

    def __init__(self, machine: Machine):
        film = machine.parts("journal_bearings")[0]
        mu, r, length, self.c = (
            number(film[key]) for key in ("viscosity", "radius", "length", "clearance")
        )
        self.k0 = mu * r * length**3 / self.c**2
        self.mass = number(machine.parts("discs")[0]["mass"]) / 2
        self.weight = self.mass * number(machine.scene["gravity"]["acceleration"])

    def eccentricity(self, speed: Any) -> Any:
        """`S = k0 Omega / (4 W) = (1 - e^2)^2 / (e sqrt(16 e^2 + pi^2 (1 - e^2)))`."""
        target = self.k0 * speed / (4 * self.weight)
        load = lambda e: (
            (1 - e * e) ** 2 / (e * mp.sqrt(16 * e * e + mp.pi**2 * (1 - e * e))) - target
        )
        return mp.findroot(load, (0.001, 0.999), solver="anderson", tol=1e-40, maxsteps=200)

    def coefficients(self, e: Any) -> tuple[list[Any], list[Any]]:
        """(xx, xy, yx, yy) of stiffness in W / c and of damping in W / (c Omega)."""
        q, s, pi2 = e * e, mp.sqrt(1 - e * e), mp.pi**2
        h = (pi2 * s**2 + 16 * q) ** mp.mpf("-1.5")
        k = [
            4 * h * (pi2 * (2 - q) + 16 * q),
            h * mp.pi * (pi2 * (1 - q) ** 2 - 16 * q**2) / (e * s),
            -h * mp.pi * (pi2 * (1 - q) * (1 + 2 * q) + 32 * q * (1 + q)) / (e * s),
            4 * h * (pi2 * (1 + 2 * q) + 32 * q * (1 + q) / (1 - q)),
        ]
        across = -8 * h * (pi2 * (1 + 2 * q) - 16 * q)
        along = 2 * mp.pi * h * s * (pi2 * (1 + 2 * q) - 16 * q) / e
        return k, [along, across, across, 2 * mp.pi * h * (pi2 * (1 - q) ** 2 + 48 * q) / (e * s)]


def position(case: Case) -> np.ndarray:
    machine = Machine(case.machine)
    film = Film(machine)
    e = film.eccentricity(number(machine.speed))
    return np.array([float(e), *(float(k * film.weight / film.c) for k in film.coefficients(e)[0])])


def oil_onset(case: Case) -> np.ndarray:
    """`m c Omega^2 / W = kappa / gamma^2`, equivalent stiffness kappa and whirl ratio gamma."""
    film = Film(Machine(case.machine))

    def ratio(e: Any) -> tuple[Any, Any]:
        (kxx, kxy, kyx, kyy), (cxx, cxy, cyx, cyy) = film.coefficients(e)
        kappa = (cxx * kyy + cyy * kxx - cxy * kyx - cyx * kxy) / (cxx + cyy)
        return kappa, ((kappa - kxx) * (kappa - kyy) - kxy * kyx) / (cxx * cyy - cxy * cyx)

    def excess(speed: Any) -> Any:
        kappa, square = ratio(film.eccentricity(speed))
        return film.mass * film.c * speed**2 / film.weight - kappa / square

    speed = mp.findroot(excess, tuple(case.ask["within"]), solver="anderson", tol=1e-30)
    whirl = speed * mp.sqrt(ratio(film.eccentricity(speed))[1])
    return np.array([float(speed), float(whirl)])


# === motions


def in_time(case: Case) -> np.ndarray:
    rtol = 3e-14 if case.question == "rub in time" else 1e-13
    call = nonlinear.answered(Machine(case.machine), case.question, case.ask, rtol)
    assert call is not None
    return np.asarray(call())


def impact(case: Case) -> np.ndarray:
    """Free from (x, v) until `t1`, pressed until `t2`, free until (x, v) again after a period."""
    machine = Machine(case.machine)
    (stop,) = machine.parts("limiters")
    gap, stiff = number(stop["gap"]), number(stop["stiffness"])
    damping = number(machine.parts("disc_dampings")[0]["translational"])
    speed = number(machine.speed)
    push = number(machine.parts("unbalances")[0]["moment"]) * speed**2
    period = 2 * mp.pi / speed

    def moved(x: Any, v: Any, start: Any, stop: Any, k: Any, rest: Any) -> tuple[Any, Any]:
        """`x.. + c x. + k (x - rest) = U Omega^2 cos(Omega t)` in closed form."""
        amplitude = push / (k - speed**2 + 1j * damping * speed)
        steady = lambda t: amplitude * mp.exp(1j * speed * t)
        rate, root = damping / 2, mp.sqrt(k - damping**2 / 4)
        a = x - rest - mp.re(steady(start))
        b = (v - mp.re(1j * speed * steady(start)) + rate * a) / root
        t = stop - start
        decay, cos, sin = mp.exp(-rate * t), mp.cos(root * t), mp.sin(root * t)
        place = decay * (a * cos + b * sin)
        pace = decay * root * (b * cos - a * sin) - rate * place
        return (
            rest + place + mp.re(steady(stop)),
            pace + mp.re(1j * speed * steady(stop)),
        )

    def conditions(x: Any, v: Any, t1: Any, t2: Any) -> list[Any]:
        first = moved(x, v, mp.mpf(0), t1, mp.mpf(1), mp.mpf(0))
        second = moved(*first, t1, t2, 1 + stiff, stiff * gap / (1 + stiff))
        last = moved(*second, t2, period, mp.mpf(1), mp.mpf(0))
        return [first[0] - gap, second[0] - gap, last[0] - x, last[1] - v]

    x, v = nonlinear.impact(machine, case.ask, 1e-9)
    t1 = (gap - number(x)) / number(v)
    guess = (number(x), number(v), t1, t1 + mp.pi / mp.sqrt(1 + stiff))
    found = mp.findroot(conditions, guess, tol=1e-28, maxsteps=60)
    if abs(found[0] - number(x)) > 1e-6:
        raise ArithmeticError(f"{case.name}: the orbit has not one contact in a revolution.")
    return np.array([float(found[0]), float(found[1])])


NONLINEAR: dict[str, Callable[[Case], np.ndarray]] = {
    "full rub": full_rub,
    "fold of a full rub": fold,
    "full rub of a flexible shaft": flexible_rub,
    "dry whirl": dry_whirl,
    "static position": position,
    "onset in oil films": oil_onset,
    "squeeze film": squeezed,
    "oil whirl": in_time,
    "run-up": in_time,
    "rub in time": in_time,
    "impact orbit": impact,
}
