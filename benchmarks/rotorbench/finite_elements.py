"""Linear answers of finite elements by SciPy alone: what one writes oneself, from `tests/fem.py`."""

import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eig, lu_factor, lu_solve
from scipy.optimize import newton
from scipy.sparse.linalg import LinearOperator, eigs

from .cases import speeds_of, values_of
from .machines import Machine
from .searches import peak, threshold


sys.path.append(str(Path(__file__).parents[2] / "tests"))
import fem  # noqa: E402
import oracles  # noqa: E402


class Model:
    """`M u.. + (C + Omega G) u. + (K + Omega H) u = f`, of four coordinates a node, then casings.

    Args:
        machine: the rotor.
        cut: how many elements take the place of one of the coarsest mesh.
    """

    def __init__(self, machine: Machine, cut: int):
        self.machine = machine
        mesh = [fem.Stretch(one.stop, one.diameter, one.inner) for one in machine.elements(cut)]
        discs = [
            (d["at"], d["mass"], d.get("diametral", 0.0), d.get("polar", 0.0))
            for d in machine.parts("discs")
        ]
        long = 2 * machine.shaft["length"]
        self.nodes, *parts = fem.matrices(mesh, discs, [], machine.material, long)
        self.casings = [one["name"] for one in machine.parts("casings")]
        size = 4 * len(self.nodes) + 2 * len(self.casings)
        grown = np.zeros((3, size, size))
        grown[:, : 4 * len(self.nodes), : 4 * len(self.nodes)] = parts
        self.m, self.g, self.shaft = grown
        for one in machine.parts("casings"):
            place = self.casing(one["name"])
            self.m[place, place] = one["mass"] * np.eye(2)
        self.free = np.ones(size, bool)
        for pin in machine.pins:
            self.free[self.place(pin)] = False

    def place(self, at: float) -> slice:
        first = 4 * int(np.argmin(np.abs(self.nodes - at)))
        return slice(first, first + 2)

    def casing(self, name: str) -> slice:
        first = 4 * len(self.nodes) + 2 * self.casings.index(name)
        return slice(first, first + 2)

    def matrices(self, speed: float, damped: bool = True) -> tuple[np.ndarray, ...]:
        """`M`, of the velocity, and of the displacement, at a speed, without held coordinates."""
        c, k = speed * self.g, self.shaft.copy()
        turned = np.array([[0.0, 1.0], [-1.0, 0.0]])  # q. in turning axes is q. + Omega turned q
        pairs = [(self.place(b.at), b) for b in self.machine.bearings(speed)]
        pairs += [(self.casing(name), self.machine.held(name)) for name in self.casings]
        for place, bearing in pairs:
            signs = [(place, place, 1)]
            if bearing.on is not None:
                ground = self.casing(bearing.on)
                signs += [(ground, ground, 1), (place, ground, -1), (ground, place, -1)]
            for row, column, sign in signs:
                k[row, column] += sign * bearing.k
                if damped:
                    c[row, column] += sign * bearing.c
                    if bearing.turns:
                        k[row, column] += sign * speed * bearing.c @ turned
        keep = np.ix_(self.free, self.free)
        return self.m[keep], c[keep], k[keep]

    def roots(self, speed: float, count: int) -> np.ndarray:
        """The slowest roots with a positive imaginary part, by Arnoldi's method on the inverse."""
        m, c, k = self.matrices(speed)
        n, factors = len(m), lu_factor(k)
        apply = lambda v: np.concatenate([-lu_solve(factors, c @ v[:n] + m @ v[n:]), v[:n]])
        inverse = LinearOperator((2 * n, 2 * n), apply, dtype=float)
        start = np.random.default_rng(0).standard_normal(2 * n)
        wanted = 2 * count + 4
        space = min(2 * n - 1, 3 * wanted + 10)
        found = 1 / eigs(inverse, wanted, v0=start, ncv=space, tol=1e-12, return_eigenvectors=False)
        return _ordered(found[found.imag > 1e-6])

    def criticals(self, speed: float, count: int) -> np.ndarray:
        """Speeds with `K u = Omega^2 (M - i G) u`, bearings as they are at `speed`."""
        m, _, k = self.matrices(speed, damped=False)
        k = (k + k.T) / 2
        keep = np.ix_(self.free, self.free)
        factors, inertia = lu_factor(k), m - 1j * self.g[keep]
        inverse = LinearOperator(k.shape, lambda v: lu_solve(factors, inertia @ v), dtype=complex)
        start = np.random.default_rng(0).standard_normal(len(k)) + 0j
        found = eigs(inverse, count, v0=start, tol=1e-14, return_eigenvectors=False).real
        return np.sort(1 / np.sqrt(found[found > 0]))

    def unbalance(self, speed: float) -> np.ndarray:
        """Amplitude [N] of the force of all unbalances on all coordinates."""
        force = np.zeros(self.free.size, complex)
        for one in self.machine.parts("unbalances"):
            push = one["moment"] * speed**2 * np.exp(1j * one.get("phase", 0.0))
            force[self.place(one["at"])] += push * np.array([1, -1j])
        return force

    def response(self, speed: float, at: float) -> np.ndarray:
        """Forward and backward radius [m] at a station, of the unbalance."""
        m, c, k = self.matrices(speed)
        force = self.unbalance(speed)
        found = np.zeros(self.free.size, complex)
        found[self.free] = np.linalg.solve(k + 1j * speed * c - speed**2 * m, force[self.free])
        x, y = found[self.place(at)]
        return np.abs([x + 1j * y, x - 1j * y]) / 2

    def history(self, speed: float, at: float, times: np.ndarray) -> np.ndarray:
        """Displacements x and y [m] at a station from rest, by all eigenvectors."""
        m, c, k = self.matrices(speed)
        n, inverse = len(m), np.linalg.inv(m)
        first = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ k, -inverse @ c]])
        values, shapes = eig(first)
        force = self.unbalance(speed)
        steady = np.linalg.solve(k + 1j * speed * c - speed**2 * m, force[self.free])
        begin = -np.concatenate([steady, 1j * speed * steady]).real
        shares = np.linalg.solve(shapes, begin.astype(complex))
        place = np.flatnonzero(self.free)
        rows = [int(np.flatnonzero(place == i)[0]) for i in range(self.free.size)[self.place(at)]]
        moved = (shapes[rows] * shares) @ np.exp(np.outer(values, times))
        return (moved + np.outer(steady[rows], np.exp(1j * speed * times))).real.T


class Damped:
    """Roots of the cantilever with material damping, in complex coordinates, by `tests/oracles.py`."""

    def __init__(self, machine: Machine, cut: int):
        shaft, given = machine.shaft, machine.scene
        young, density, _ = machine.material
        self.beam = oracles.Beam(
            shaft["length"], shaft["diameter"], young, density, elements=16 * cut
        )
        (disc,), (damper,) = machine.parts("discs"), machine.parts("disc_dampings")
        self.beam.damp(
            given["external_damping"]["per_length"], given["internal_damping"]["voigt_time"]
        )
        own = disc["mass"], disc["diametral"], disc["polar"]
        self.beam.disc(disc["at"], *own, damper["translational"], damper["angular"])

    def roots(self, speed: float, count: int) -> np.ndarray:
        return self.beam.roots(speed, count)


def answered(machine: Machine, ask: dict[str, Any], question: str, cut: int) -> Callable:
    """The call that answers a linear question on one mesh; the mesh is made in it."""
    model = Damped if "internal_damping" in machine.scene else Model
    build = functools.partial(model, machine, cut)
    if "over" in ask:
        models = lambda: (Model(machine.varied(ask["over"], x), cut) for x in values_of(ask))
        if question == "roots over a parameter":
            return lambda: _cut_to_shortest(
                [model.roots(machine.speed, ask["count"]) for model in models()]
            )
        count = 4 * ask["count"]
        return lambda: _cut_to_shortest(
            [model.criticals(machine.speed, count) for model in models()]
        )
    if question == "roots":
        return lambda: build().roots(ask.get("speed", machine.speed), ask["count"])
    if question == "Campbell diagram":
        return lambda: campbell(build(), ask)
    if question == "critical speeds":
        return lambda: criticals(build(), ask["count"])
    if question == "threshold":
        onset = lambda model: threshold(lambda speed: model.roots(speed, 8), ask["within"])
        return lambda: onset(build())
    if question == "response":
        return lambda: (lambda one: [one.response(speed, ask["at"]) for speed in speeds_of(ask)])(
            build()
        )
    if question == "peak":
        highest = lambda model: peak(lambda x: model.response(x, ask["at"]), ask["within"])
        return lambda: highest(build())
    return lambda: build().history(machine.speed, ask["at"], np.array(ask["times"]))


def campbell(model: Model, ask: dict[str, Any]) -> np.ndarray:
    """The slowest roots at every speed, of which some are spare."""
    return _cut_to_shortest([model.roots(speed, ask["count"] + 1) for speed in speeds_of(ask)])


def _cut_to_shortest(rows: list[np.ndarray]) -> np.ndarray:
    """Rows as a matrix, as long as the shortest of them."""
    return np.array([row[: min(map(len, rows))] for row in rows])


def criticals(model: Model, count: int) -> np.ndarray:
    """Critical speeds; where bearings change with the speed each by the secant method."""
    found = model.criticals(model.machine.speed, count)
    if not any("speeds" in one for one in model.machine.parts("supports")):
        return found
    return np.array(
        [
            newton(lambda speed, k=k: model.criticals(speed, count)[k] - speed, one, tol=1e-5)
            for k, one in enumerate(found)
        ]
    )


def _ordered(roots: np.ndarray) -> np.ndarray:
    return roots[np.argsort(np.abs(roots))]
