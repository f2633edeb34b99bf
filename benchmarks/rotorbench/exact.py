"""Rotors by transfer matrices in many digits (mpmath): exact for uniform stretches, of no mesh.

    w' = psi + Q / kGA,   psi' = M / EI,   Q' = (rho A l^2 + b l) w,
    M' = -Q + (rho I l^2 -+ 2 i Omega rho I l) psi

of a motion `exp(l t)` of `p = x + i y` (upper sign) and of `m = x - i y` (lower sign), at the speed
Omega. Bearings with unequal axes couple both. Rotary inertia, gyroscopic moments, shear (Cowper), material
damping (`E (1 + T (l -+ i Omega))`), damping b per length and discs are in it. Source: Timoshenko (1921);
Friswell, Penny, Garvey, Lees (2010), section 5.4; Cowper (1966).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from mpmath import mp

from .machines import Machine, Stretch


mp.dps = 30
HALF = mp.mpf(1) / 2
SIGNS = (1, -1)  # of p and of m


def number(x: float) -> Any:
    """The decimal number that a file has, not its neighbour in binary."""
    return mp.mpf(repr(float(x)))


class Rotor:
    """Transfer matrices of a machine.

    Args:
        machine: the rotor.
        damped: whether its bearings keep their damping.
    """

    def __init__(self, machine: Machine, damped: bool = True):
        self.machine, self.damped = machine, damped
        self.stretches = machine.stretches()
        young, density, shear = machine.material
        self.young, self.density, self.shear = number(young), number(density), shear
        given = lambda kind, key: number(machine.scene.get(kind, {}).get(key, 0.0))
        self.voigt = given("internal_damping", "voigt_time")
        self.along = given("external_damping", "per_length")
        bearings = machine.bearings()
        equal = lambda k: k[0, 0] == k[1, 1] and k[0, 1] == -k[1, 0]
        self.circular = all(equal(b.k) and equal(b.c) for b in bearings)

    def stretch(self, piece: Stretch, root: Any, speed: Any, sign: int) -> Any:
        """4 by 4, from the state (w, psi, M, Q) at its start to that at its end."""
        outer, inner = number(piece.diameter), number(piece.inner)
        area = mp.pi / 4 * (outer**2 - inner**2)
        second = mp.pi / 64 * (outer**4 - inner**4)
        soft = mp.mpf(0)
        if np.isfinite(self.shear):
            shear, r2 = number(self.shear), (inner / outer) ** 2
            nu = self.young / (2 * shear) - 1
            cowper = 6 * (1 + r2) ** 2 * (1 + nu)
            cowper /= (7 + 6 * nu) * (1 + r2) ** 2 + (20 + 12 * nu) * r2
            soft = 1 / (cowper * shear * area)
        material = 1 + self.voigt * (root - sign * 1j * speed)
        rates = mp.zeros(4)
        rates[0, 1], rates[0, 3] = 1, soft
        rates[1, 2] = 1 / (self.young * second * material)
        rates[2, 1] = self.density * second * (root**2 - sign * 2j * speed * root)
        rates[2, 3] = -1
        rates[3, 0] = self.density * area * root**2 + self.along * root
        return mp.expm(rates * (number(piece.stop) - number(piece.start)))

    def joint(self, at: float, root: Any, speed: Any) -> Any:
        """8 by 8, of the state (w, psi, M, Q of p, then of m) across a station."""
        jump = mp.eye(8)
        for disc in self.machine.parts("discs"):
            if disc["at"] != at:
                continue
            mass, diametral, polar = (
                number(disc.get(key, 0.0)) for key in ("mass", "diametral", "polar")
            )
            for k, sign in enumerate(SIGNS):
                jump[4 * k + 3, 4 * k] += mass * root**2
                jump[4 * k + 2, 4 * k + 1] += diametral * root**2 - sign * 1j * speed * polar * root
        for damper in self.machine.parts("disc_dampings"):
            if damper["at"] == at:
                for k in range(2):
                    jump[4 * k + 3, 4 * k] += number(damper.get("translational", 0.0)) * root
                    jump[4 * k + 2, 4 * k + 1] += number(damper.get("angular", 0.0)) * root
        for bearing in self.machine.bearings(float(mp.re(speed))):
            if bearing.at == at:
                force = self._bearing(bearing, root, speed)
                for i in range(2):
                    for k in range(2):
                        jump[4 * i + 3, 4 * k] += force[i, k]
        return jump

    def _bearing(self, bearing: Any, root: Any, speed: Any) -> Any:
        """Force of p and m by p and m, of a bearing on the ground or on its casing."""
        plane = lambda k: mp.matrix([[number(x) for x in row] for row in k.tolist()])
        turn = mp.matrix([[1, 1j], [1, -1j]])
        into = lambda k: turn * k * turn**-1
        damping = into(plane(bearing.c)) * (1 if self.damped else 0)
        force = into(plane(bearing.k))
        for i in range(2):
            for k in range(2):
                rate = root - SIGNS[k] * 1j * speed if bearing.turns else root
                force[i, k] += rate * damping[i, k]
        if bearing.on is None:
            return force
        (casing,) = (one for one in self.machine.parts("casings") if one["name"] == bearing.on)
        held = self._bearing(self.machine.held(bearing.on), root, speed)
        held += number(casing["mass"]) * root**2 * mp.eye(2)
        return (force**-1 + held**-1) ** -1

    def through(self, root: Any, speed: Any, force_at: float | None = None) -> tuple[Any, Any]:
        """8 by 8 from the left end to the right, and what a unit jump of Q of p at a station adds."""
        whole, added = self.joint(0.0, root, speed), mp.zeros(8, 1)
        if force_at == 0.0:
            added[3] = 1
        for piece in self.stretches:
            step = mp.zeros(8)
            for k, sign in enumerate(SIGNS):
                own = self.stretch(piece, root, speed, sign)
                for i in range(4):
                    for j in range(4):
                        step[4 * k + i, 4 * k + j] = own[i, j]
            step = self.joint(piece.stop, root, speed) * step
            whole, added = step * whole, step * added
            if piece.stop == force_at:
                added[3] += 1
        return whole, added

    def ends(self) -> tuple[list[int], list[int]]:
        """Which of (w, psi, M, Q) are free at the left end, and which are zero at the right one."""
        held = {one["at"]: one["holds"] for one in self.machine.shaft["constraints"]}
        free = {None: [0, 1], "pin": [1, 3], "clamp": [2, 3]}[held.get(0.0)]
        zero = {None: [2, 3], "pin": [0, 2], "clamp": [0, 1]}[
            held.get(self.machine.shaft["length"])
        ]
        return free, zero

    def determinant(self, root: Any, speed: Any) -> Any:
        """Zero where `root` [1/s] is one of the rotor at `speed` [rad/s]; of p alone where it can be."""
        whole, _ = self.through(root, speed)
        free, zero = self.ends()
        planes = range(1) if self.circular else range(2)
        rows = [4 * k + i for k in planes for i in zero]
        columns = [4 * k + i for k in planes for i in free]
        return mp.det(mp.matrix([[whole[i, j] for j in columns] for i in rows]))

    def response(self, root: Any, speed: Any, force_at: float, at: float) -> tuple[Any, Any]:
        """`p` and `m` [m] at a station for a force `exp(l t)` of 1 N on p at another one."""
        whole, added = self.through(root, speed, force_at)
        free, zero = self.ends()
        rows = [4 * k + i for k in range(2) for i in zero]
        columns = [4 * k + i for k in range(2) for i in free]
        matrix = mp.matrix([[whole[i, j] for j in columns] for i in rows])
        left = mp.lu_solve(matrix, mp.matrix([added[i] for i in rows]))  # Q jumps by less the force
        start = mp.zeros(8, 1)
        for k, j in enumerate(columns):
            start[j] = left[k]
        state = self.joint(0.0, root, speed) * start
        if force_at == 0.0:
            state[3] -= 1
        here = 0.0
        for piece in self.stretches:
            if here == at:
                break
            parts = [self.stretch(piece, root, speed, sign) for sign in SIGNS]
            state = self._passed(parts, state)
            here = piece.stop
            state = self.joint(here, root, speed) * state
            if here == force_at:
                state[3] -= 1
        return state[0], state[4]

    def _passed(self, parts: list[Any], state: Any) -> Any:
        moved = mp.zeros(8, 1)
        for k, own in enumerate(parts):
            for i in range(4):
                moved[4 * k + i] = sum(own[i, j] * state[4 * k + j] for j in range(4))
        return moved


def zero_near(function: Callable[[Any], Any], guess: complex, reach: float = 1e-6) -> Any:
    """The zero of an analytic function near a guess by the secant method, or an error."""
    start = mp.mpmathify(guess)
    before, here = start * (1 + reach), start
    below, value = function(before), function(here)
    for _ in range(40):
        if value == below:
            break
        step = value * (here - before) / (value - below)
        before, here = here, here - step
        if abs(step) < 1e-13 * abs(here):  # the next one is far smaller
            break
        below, value = value, function(here)
    else:
        raise ArithmeticError(f"The secant method has not found the zero near {guess}.")
    if abs(here - start) > 1e-3 * abs(start):
        raise ArithmeticError(f"There is no zero near {guess}, but one at {complex(here)}.")
    return here


def zero_of_two(function: Callable[..., Any], guess: tuple[float, float]) -> Any:
    """Two real unknowns of one complex equation, by Newton's method from a guess."""
    parts = lambda x, y: (lambda f: (mp.re(f), mp.im(f)))(function(x, y))
    return mp.findroot(parts, tuple(map(mp.mpf, guess)), tol=1e-30, maxsteps=40, verify=False)
