"""A rotor by finite elements, in numpy, sharing nothing with the library.

Hermite cubic beam elements (Euler-Bernoulli, consistent mass, rotary inertia, gyroscopic), clamped
at 0; `q = (w_1, w'_1, w_2, ..)` complex, `M q.. + (C - i Omega G) q. + (K - i Omega T K) q = f`.
"""

import numpy as np
from scipy.sparse.linalg import eigs


class Beam:
    def __init__(self, length, diameter, youngs, density, elements=80, polar_ratio=2.0):
        h = self.h = length / elements
        area, second = np.pi * diameter**2 / 4, np.pi * diameter**4 / 64
        bend = [[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]
        move = [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]
        turn = [[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]
        size = np.array([1, h, 1, h])
        scale = np.outer(size, size)
        n = 2 * (elements + 1)
        self.K, self.shape, self.rotary, self.load = (
            np.zeros((n, n)),
            np.zeros((n, n)),
            np.zeros((n, n)),
            np.zeros(n),
        )
        for e in range(elements):
            i = slice(2 * e, 2 * e + 4)
            self.K[i, i] += youngs * second / h**3 * scale * np.array(bend)
            self.shape[i, i] += h / 420 * scale * np.array(move)
            self.rotary[i, i] += density * second / (30 * h) * scale * np.array(turn)
            self.load[i] += h * np.array([1 / 2, h / 12, 1 / 2, -h / 12])
        self.M = density * area * self.shape + self.rotary
        self.G = polar_ratio * self.rotary
        self.C, self.voigt = np.zeros((n, n)), 0.0
        self.weight = density * area * self.load

    def node(self, at):
        """Index of the displacement at a station, which must be a node."""
        i = round(at / self.h)
        assert abs(i * self.h - at) < 1e-9
        return 2 * i

    def disc(self, at, mass, diametral=0.0, polar=0.0, translational=0.0, angular=0.0):
        i = self.node(at)
        self.M[i, i] += mass
        self.M[i + 1, i + 1] += diametral
        self.G[i + 1, i + 1] += polar
        self.C[i, i] += translational
        self.C[i + 1, i + 1] += angular
        self.weight[i] += mass
        return self

    def damp(self, per_length=0.0, voigt=0.0):
        self.C += per_length * self.shape + voigt * self.K
        self.voigt += voigt
        return self

    def blocks(self, speed):
        """Inertia, velocity and displacement matrices, the clamp removed."""
        parts = self.M, self.C - 1j * speed * self.G, (1 - 1j * speed * self.voigt) * self.K
        return [part[2:, 2:] for part in parts]

    def roots(self, speed, count):
        """Slowest roots, from the inverse of the first-order matrix (the accurate end)."""
        m, c, k = self.blocks(speed)
        n = len(m)
        flexible = -np.linalg.solve(k, np.concatenate([c, m], axis=1))
        inverse = np.concatenate([flexible, np.eye(n, 2 * n)])
        first = np.ones(2 * n, complex)
        values = eigs(inverse, count, which="LM", v0=first, tol=1e-13, return_eigenvectors=False)
        return 1 / values[np.argsort(-np.abs(values))]

    def response(self, speed, at, moment, stations):
        """Complex amplitude at stations of a force `moment speed^2 exp(i speed t)` at `at`."""
        m, c, k = self.blocks(speed)
        force = np.zeros(len(self.M), complex)
        force[self.node(at)] = moment * speed**2
        q = np.linalg.solve(k + 1j * speed * c - speed**2 * m, force[2:])
        return np.concatenate([[0, 0], q])[[self.node(x) for x in stations]]
