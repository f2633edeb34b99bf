"""SciPy: one lane at a time, or a lane a process; the right-hand side in numpy.

Imports no jax, so that processes start quickly.
"""

import functools
import multiprocessing

import numpy as np
from scipy.integrate import solve_ivp


SAMPLES = 32  # a revolution
ATOL = 1e-3  # [m] of rtol: displacements are about 1e-2 m, velocities as much per radian


class NumpyRotor:
    """`y' = A y + B [N, T, cos theta, sin theta]`, y the x and the y parts of (q, q').

    Normal forces N and friction T of the stops follow from `local y`: outward displacement, outward
    velocity, sideways velocity. All products that can be formed beforehand are. `share` is the
    eccentricity over that of the arrays.
    """

    def __init__(self, arrays, share: float):
        a, row, rate = arrays.a, arrays.row, arrays.rate
        n, self.stops = row.size, arrays.gap.size
        self.start = np.concatenate([arrays.start.real, arrays.start.imag])
        self.A = np.block([[a.real, -a.imag], [a.imag, a.real]])
        cos, sin = arrays.cos[:, None], arrays.sin[:, None]
        x, vx, y, vy = np.kron(np.diag([1, rate, 1, rate]), row)
        self.see = np.stack([x, y])
        self.local = np.concatenate([cos * x + sin * y, cos * vx + sin * vy, cos * vy - sin * vx])
        push, off = arrays.column[:, None], np.zeros((n, 2 * self.stops + 2))
        real, imag = share * arrays.load.real[:, None], share * arrays.load.imag[:, None]
        ahead = np.hstack([-push * cos.T, push * sin.T, real, -imag])
        aside = np.hstack([-push * sin.T, -push * cos.T, imag, real])
        self.B = np.concatenate([off, ahead, off, aside])
        self.gap, self.k, self.d = arrays.gap, arrays.stiffness, arrays.damping
        self.f, self.rim = arrays.friction, arrays.rim

    def contact(self, y: np.ndarray):
        """Of each stop: normal force, whether it acts, friction per normal force."""
        outward, closing, sideways = (self.local @ y).reshape(3, -1)
        depth = outward - self.gap
        normal = self.k * depth + self.d * closing
        return normal, (depth > 0) & (normal > 0), self.f * np.sign(self.rim + sideways)

    def __call__(self, theta: float, y: np.ndarray) -> np.ndarray:
        normal, active, friction = self.contact(y)
        rate = self.A @ y + self.B[:, -2:] @ np.array([np.cos(theta), np.sin(theta)])
        if active.any():
            rate += self.B[:, :-2] @ np.concatenate([active * normal, active * friction * normal])
        return rate

    def jacobian(self, theta: float, y: np.ndarray) -> np.ndarray:
        _, active, friction = self.contact(y)
        if not active.any():
            return self.A
        k, d = (active * self.k)[:, None], (active * self.d)[:, None]
        slope = k * self.local[: self.stops] + d * self.local[self.stops : 2 * self.stops]
        return self.A + self.B[:, :-2] @ np.concatenate([slope, friction[:, None] * slope])

    def orbit(self, method: str, rtol: float, revolutions: int) -> np.ndarray:
        """Complex displacement of the disc, SAMPLES a revolution."""
        angles = np.linspace(0, 2 * np.pi * revolutions, revolutions * SAMPLES + 1)
        how = {"method": method, "rtol": rtol, "atol": ATOL * rtol}
        if method in ("LSODA", "Radau", "BDF"):
            how["jac"] = self.jacobian
        found = solve_ivp(self, (0, angles[-1]), self.start, t_eval=angles, **how)
        x, y = self.see @ found.y
        return x + 1j * y if found.success else np.full(angles.size, np.nan + 0j)


def _orbit(arrays, share: float, how: tuple) -> np.ndarray:
    return NumpyRotor(arrays, share).orbit(*how)


@functools.cache
def _pool(processes: int):
    """Processes that wait for lanes; a start of them is not timed."""
    return multiprocessing.get_context("spawn").Pool(processes)


def orbits(arrays, shares, method: str, rtol: float, revolutions: int, processes: int = 1):
    """Orbits of all lanes (lanes, T)."""
    work = [(arrays, float(share), (method, rtol, revolutions)) for share in shares]
    if processes == 1:
        return np.stack([_orbit(*one) for one in work])
    return np.stack(_pool(processes).starmap(_orbit, work, chunksize=1))
