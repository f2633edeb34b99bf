"""Nonlinear answers by SciPy and NumPy alone: circles as zeros in turning axes, motions by DOP853.

Friction acts on the rim of the disc, `F = -N (1 + i mu) n`, while it slips forward against the ring or
the stop; the film is the short one with half of it under pressure (Ocvirk), by Gauss quadrature.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve, root

from .finite_elements import Damped, Model
from .machines import Machine


GAUSS = np.polynomial.legendre.leggauss(64)


def film_force(z: complex, v: complex, speed: float, film: dict[str, Any]) -> complex:
    """Force [N] of a short film on a journal at `z` with velocity `v`."""
    c = film["clearance"]
    k0 = film["viscosity"] * film["radius"] * film["length"] ** 3 / c**2
    w = v / c - 0.5j * speed * z / c
    u = w / abs(w)
    phi = GAUSS[0] * np.pi / 2
    height = 1 - (np.conj(z / c) * u * np.exp(1j * phi)).real
    integral = np.sum(GAUSS[1] * np.cos(phi) * u * np.exp(1j * phi) / height**3) * np.pi / 2
    return complex(-k0 * abs(w) * integral)


# === circles


def full_rub(machine: Machine) -> np.ndarray:
    """Radius and normal force of the upper full rub of a Jeffcott rotor, by `root` on its balance."""
    balance = _balance(machine)
    ring = machine.parts("annular_stators")[0]
    guess = 1.5 * ring["gap"] * np.exp(-0.5j)
    found = root(lambda x: balance(x, machine.speed), [guess.real, guess.imag], tol=1e-14)
    radius = float(np.hypot(*found.x))
    return np.array([radius, ring["stiffness"] * (radius - ring["gap"])])


def fold(machine: Machine) -> np.ndarray:
    """Speed and radius where both full rubs merge: the balance and its Jacobian's determinant are zero."""
    balance = _balance(machine)

    def jacobian(x: np.ndarray, speed: float) -> np.ndarray:
        h = 1e-5
        steps = (np.array([h, 0]), np.array([0, h]))
        return np.array(
            [
                (8 * (balance(x + s, speed) - balance(x - s, speed))
                 - balance(x + 2 * s, speed) + balance(x - 2 * s, speed)) / (12 * h)
                for s in steps
            ]
        )  # fmt: skip

    def conditions(y: np.ndarray) -> list[float]:
        return [*balance(y[:2], y[2]), float(np.linalg.det(jacobian(y[:2], y[2])))]

    gap = machine.parts("annular_stators")[0]["gap"]
    found = fsolve(conditions, [-0.8 * gap, -2.5 * gap, 2.4], xtol=1e-13)
    return np.array([found[2], float(np.hypot(*found[:2]))])


def _balance(machine: Machine) -> Callable[[np.ndarray, float], np.ndarray]:
    """Forces on the disc in turning axes, of a circle z exp(i Omega t) that slides in the ring."""
    ring, disc = machine.parts("annular_stators")[0], machine.parts("discs")[0]
    damping = machine.parts("disc_dampings")[0]["translational"]
    moment, stiffness = machine.parts("unbalances")[0]["moment"], machine.shaft["k11"]

    def balance(x: np.ndarray, speed: float) -> np.ndarray:
        z = complex(x[0], x[1])
        pressed = ring["stiffness"] * (abs(z) - ring["gap"])
        pushed = pressed * (1 + 1j * ring["friction"]) * z / abs(z)
        linear = (stiffness - disc["mass"] * speed**2 + 1j * damping * speed) * z
        left = moment * speed**2 - linear - pushed
        return np.array([left.real, left.imag])

    return balance


def elements_receptance(machine: Machine, cut: int) -> Callable[[float, float], complex]:
    """Displacement at the ring of a circling force there of 1 N, by finite elements."""
    if "internal_damping" in machine.scene:
        model = Damped(machine, cut)
        at = machine.parts("annular_stators")[0]["at"]

        def damped(whirl: float, speed: float) -> complex:
            m, c, k = model.beam.blocks(speed)
            place = model.beam.node(at) - 2
            force = np.zeros(len(k), complex)
            force[place] = 1.0
            return complex(np.linalg.solve(k + 1j * whirl * c - whirl**2 * m, force)[place])

        return damped
    own = Model(machine, cut)
    place = own.place(machine.parts("annular_stators")[0]["at"])
    keep = np.ix_(own.free, own.free)
    rate = along_damping(machine, own)[keep]

    def receptance(whirl: float, speed: float) -> complex:
        m, c, k = own.matrices(speed)
        force = np.zeros(own.free.size, complex)
        force[place] = [1.0, -1j]
        dynamic = k + 1j * whirl * (c + rate) - whirl**2 * m
        found = np.zeros(own.free.size, complex)
        found[own.free] = np.linalg.solve(dynamic, force[own.free])
        return complex(found[place][0])

    return receptance


def along_damping(machine: Machine, model: Model) -> np.ndarray:
    """Damping of a uniform shaft by its length, a mass matrix without rotary inertia, and of discs."""
    per_length = machine.scene["external_damping"]["per_length"]
    damping = np.zeros_like(model.m)
    bend = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
    for k, h in enumerate(np.diff(model.nodes)):
        scale = np.array([1, h, 1, h])
        for plane in (np.array([0, 2, 4, 6]) + 4 * k, np.array([1, 3, 5, 7]) + 4 * k):
            damping[np.ix_(plane, plane)] += per_length * h / 420 * bend * np.outer(scale, scale)
    for one in machine.parts("disc_dampings"):
        place = model.place(one["at"])
        damping[place, place] += one["translational"] * np.eye(2)
    return damping


def rub_by(receptance: Callable[[Any, Any], Any], machine: Machine, root_of: Any = np.sqrt) -> list:
    """Radius [m] and force [N] of the upper full rub: |g + N q| = |z_free|, a quadratic in N."""
    ring, speed = machine.parts("annular_stators")[0], machine.speed
    own = receptance(speed, speed)
    q = 1 / ring["stiffness"] + own * (1 + 1j * ring["friction"])
    free = machine.parts("unbalances")[0]["moment"] * speed**2 * own
    a, b = abs(q) ** 2, ring["gap"] * q.real
    c = ring["gap"] ** 2 - abs(free) ** 2
    force = (-b + root_of(b * b - a * c)) / a
    return [ring["gap"] + force / ring["stiffness"], force]


def dry_whirl_by(receptance: Callable[[Any, Any], Any], machine: Machine, zero: Any) -> list:
    """Rate [rad/s] and radius [m] of the slipping whirl: the friction that it needs is that in force."""
    ring, speed = machine.parts("annular_stators")[0], machine.speed
    own = lambda whirl: receptance(whirl, speed)
    whirl = zero(lambda w: (lambda h: h.imag + ring["friction"] * h.real)(own(w)))
    force = -ring["gap"] / (1 / ring["stiffness"] + (own(whirl) * (1 + 1j * ring["friction"])).real)
    return [whirl, ring["gap"] + force / ring["stiffness"]]


def squeezed(machine: Machine) -> np.ndarray:
    """Radius [m] of the circle in a squeeze film, by `root` on the balance in turning axes."""
    (film,), speed = machine.parts("squeeze_films"), machine.speed
    moment, stiffness = machine.parts("unbalances")[0]["moment"], machine.shaft["k11"]

    def balance(x: np.ndarray) -> list[float]:
        z = complex(x[0], x[1])
        linear = (stiffness - machine.parts("discs")[0]["mass"] * speed**2) * z
        left = moment * speed**2 - linear + film_force(z, 1j * speed * z, 0.0, film)
        return [left.real, left.imag]

    found = root(balance, [-0.5, -0.6], tol=1e-14)
    return np.array([float(np.hypot(*found.x))])


# === films


def position(machine: Machine) -> np.ndarray:
    """Eccentricity of a journal under its half of the weight, and the stiffness of its film [N/m]."""
    film, speed = machine.parts("journal_bearings")[0], machine.speed
    weight = machine.parts("discs")[0]["mass"] * machine.scene["gravity"]["acceleration"] / 2
    c = film["clearance"]
    force = lambda x: film_force(complex(x[0], x[1]) * c, 0j, speed, film)

    def balance(x: np.ndarray) -> list[float]:
        left = force(x) - 1j * weight
        return [left.real / weight, left.imag / weight]

    found = root(balance, [0.3, -0.3], tol=1e-14).x
    h, columns = 1e-3, []
    for step in (np.array([h, 0]), np.array([0, h])):
        slope = 0j
        for size, share in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60)):
            slope += share * (force(found + size * step) - force(found - size * step)) / (h * c)
        columns.append([-slope.real, -slope.imag])
    return np.array([np.hypot(*found), *np.array(columns).T.ravel()])


def oil_onset(machine: Machine, ask: dict[str, Any]) -> np.ndarray:
    """Speed and whirl [rad/s] at which the rotor that moves without tilting loses its stability."""
    film, mass = machine.parts("journal_bearings")[0], machine.parts("discs")[0]["mass"] / 2
    c = film["clearance"]

    def fastest(speed: float) -> complex:
        own = Machine(machine.path.stem)
        own.scene["spin"]["speed"] = speed
        eccentricity, *stiffness = position(own)
        angle = np.arctan2(np.pi * np.sqrt(1 - eccentricity**2), 4 * eccentricity)
        here = c * eccentricity * np.exp(1j * (angle - np.pi / 2))
        columns = []
        for step in (1.0, 1j):
            slope, h = 0j, 1e-3 * c * speed
            for size, share in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60)):
                more = film_force(here, size * h * step, speed, film)
                less = film_force(here, -size * h * step, speed, film)
                slope += share * (more - less) / h
            columns.append([-slope.real, -slope.imag])
        k, d = np.array(stiffness).reshape(2, 2), np.array(columns).T
        first = np.block([[np.zeros((2, 2)), np.eye(2)], [-k / mass, -d / mass]])
        values = np.linalg.eigvals(first)
        return complex(values[np.argmax(values.real)])

    speed = float(brentq(lambda speed: fastest(speed).real, *ask["within"], xtol=1e-9, rtol=1e-13))
    return np.array([speed, abs(fastest(speed).imag)])


# === motions


def oil_whirl(machine: Machine, ask: dict[str, Any], rtol: float) -> np.ndarray:
    """Whirl rate [rad/s] of the orbit in an oil film, by shooting with DOP853."""
    (film,), speed = machine.parts("journal_bearings"), machine.speed
    weight, stiffness = machine.scene["gravity"]["acceleration"], machine.shaft["k11"]

    def field(_: float, y: np.ndarray) -> list[float]:
        z, v = complex(y[0], y[1]), complex(y[2], y[3])
        a = film_force(z, v, speed, film) - 1j * weight - stiffness * z
        return [y[2], y[3], a.real, a.imag]

    def end(x: np.ndarray) -> np.ndarray:
        start = np.array([x[0], ask["y"], x[1], x[2]])  # at a fixed height
        run = solve_ivp(field, (0, x[3]), start, method="DOP853", rtol=rtol, atol=rtol / 10)
        return run.y[:, -1] - start

    found = fsolve(end, [*ask["start"], ask["period"]], xtol=max(rtol, 1e-12))
    return np.array([2 * np.pi / found[3]])


def run_up(machine: Machine, ask: dict[str, Any], rtol: float) -> np.ndarray:
    """Largest radius [m] among samples of a run-up from rest."""
    first, last = machine.scene["spin"]["speeds"]
    ramp = (last - first) / machine.scene["spin"]["times"][1]
    damping = machine.parts("disc_dampings")[0]["translational"]
    moment = machine.parts("unbalances")[0]["moment"]

    def field(t: float, y: np.ndarray) -> list[float]:
        speed, angle = first + ramp * t, first * t + ramp * t * t / 2
        push = moment * (speed**2 - 1j * ramp) * np.exp(1j * angle)
        return [y[2], y[3], push.real - damping * y[2] - y[0], push.imag - damping * y[3] - y[1]]

    times = np.linspace(0.0, ask["until"], ask["samples"])
    run = solve_ivp(
        field, (0, times[-1]), np.zeros(4), method="DOP853", t_eval=times, rtol=rtol, atol=rtol / 10
    )
    return np.array([np.hypot(*run.y[:2]).max()])


def rub(machine: Machine, ask: dict[str, Any], rtol: float) -> np.ndarray:
    """Displacements x and y [m] after some revolutions from rest against a stop, from event to event."""
    return _struck(machine, np.zeros(4), ask["revolutions"], rtol)[:2]


def impact(machine: Machine, ask: dict[str, Any], rtol: float) -> np.ndarray:
    """Displacement along x and its velocity as a revolution of the orbit begins, by shooting."""
    whole = lambda x: _struck(machine, np.array([x[0], 0.0, x[1], 0.0]), 1, rtol)
    found = fsolve(lambda x: whole(x)[[0, 2]] - x, ask["start"], xtol=max(rtol, 1e-13))
    return np.array(found)


def _struck(machine: Machine, start: np.ndarray, revolutions: int, rtol: float) -> np.ndarray:
    """State (x, y, velocities) after revolutions, steps ending where the stop is touched or left."""
    (stop,), speed = machine.parts("limiters"), machine.speed
    damping = machine.parts("disc_dampings")[0]["translational"]
    moment = machine.parts("unbalances")[0]["moment"]
    friction, held = stop.get("friction", 0.0), stop.get("damping", 0.0)
    normal = lambda y: stop["stiffness"] * (y[0] - stop["gap"]) + held * y[2]

    def field(t: float, y: np.ndarray, pressed: bool) -> list[float]:
        push = moment * speed**2
        force = normal(y) if pressed else 0.0
        return [
            y[2], y[3],
            push * np.cos(speed * t) - damping * y[2] - y[0] - force,
            push * np.sin(speed * t) - damping * y[3] - y[1] - friction * force,
        ]  # fmt: skip

    touch = lambda t, y, pressed: y[0] - stop["gap"]
    leave = lambda t, y, pressed: normal(y)
    touch.terminal = leave.terminal = True
    touch.direction, leave.direction = 1, -1
    t, end, y, pressed = 0.0, 2 * np.pi * revolutions / speed, start, False
    while True:
        run = solve_ivp(
            field, (t, end), y, method="DOP853", rtol=rtol, atol=rtol / 10,
            args=(pressed,), events=leave if pressed else touch,
        )  # fmt: skip
        t, y = run.t[-1], run.y[:, -1]
        if run.status == 0:
            return y
        pressed = not pressed


# === by question


def answered(machine: Machine, question: str, ask: dict[str, Any], setting: Any) -> Callable | None:
    """The call that answers a nonlinear question, None for another; `setting`: tolerance or meshes."""
    calls: dict[str, Callable[[], Any]] = {
        "full rub": lambda: full_rub(machine),
        "fold of a full rub": lambda: fold(machine),
        "squeeze film": lambda: squeezed(machine),
        "static position": lambda: position(machine),
        "onset in oil films": lambda: oil_onset(machine, ask),
        "oil whirl": lambda: oil_whirl(machine, ask, setting),
        "run-up": lambda: run_up(machine, ask, setting),
        "rub in time": lambda: rub(machine, ask, setting),
        "impact orbit": lambda: impact(machine, ask, setting),
        "full rub of a flexible shaft": lambda: [
            rub_by(elements_receptance(machine, cut), machine) for cut in setting
        ],
        "dry whirl": lambda: [
            dry_whirl_by(
                elements_receptance(machine, cut),
                machine,
                lambda f: brentq(f, *ask["within"], xtol=1e-11, rtol=1e-14),
            )
            for cut in setting
        ],
    }
    return calls.get(question)
