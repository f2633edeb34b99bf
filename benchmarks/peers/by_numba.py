"""numba: the exponential step in blocks of lanes, and RK4 on a few modes as written by hand."""

import numba
import numpy as np
from numba import njit, prange

from .exponential import WIDTH, Tableau
from .rotor import SAMPLES, Arrays


@njit(fastmath=True, inline="always")
def _forces(seen, stops, rim, force):
    """Force (x, y) of every lane of a block from seen = (x, vx, y, vy)."""
    for l in range(WIDTH):
        force[0, l] = 0.0
        force[1, l] = 0.0
    for k in range(stops.shape[0]):
        cos, sin, gap = stops[k, 0], stops[k, 1], stops[k, 2]
        stiffness, damping, friction = stops[k, 3], stops[k, 4], stops[k, 5]
        for l in range(WIDTH):
            depth = cos * seen[0, l] + sin * seen[2, l] - gap
            normal = stiffness * depth + damping * (cos * seen[1, l] + sin * seen[3, l])
            normal = normal if depth > 0 and normal > 0 else 0.0
            slip = rim + cos * seen[3, l] - sin * seen[1, l]
            sign = 1.0 if slip > 0 else (-1.0 if slip < 0 else 0.0)
            rub = friction * normal * sign
            force[0, l] += sin * rub - cos * normal
            force[1, l] -= cos * rub + sin * normal


@njit(parallel=True, fastmath=True)
def _march(state, cos4, sin4, look, echo, feed, turn, stops, rim, phases, revolutions):
    modes, steps = turn.size // 2, phases.shape[0] - 1
    for b in prange(state.shape[0]):
        w = state[b].copy()
        s0, s1 = np.empty((4, WIDTH)), np.empty((4, WIDTH))
        f0, f1 = np.empty((2, WIDTH)), np.empty((2, WIDTH))
        for _ in range(revolutions):
            for step in range(steps):
                c0, z0, c1, z1 = (
                    phases[step, 0],
                    phases[step, 1],
                    phases[step + 1, 0],
                    phases[step + 1, 1],
                )
                for i in range(4):
                    for l in range(WIDTH):
                        s0[i, l] = c0 * cos4[b, i, l] + z0 * sin4[b, i, l]
                        s1[i, l] = c1 * cos4[b, i, l] + z1 * sin4[b, i, l]
                    for j in range(2 * modes):
                        p, q = look[0, i, j], look[1, i, j]
                        for l in range(WIDTH):
                            s0[i, l] += p * w[j, l]
                            s1[i, l] += q * w[j, l]
                _forces(s0, stops, rim, f0)
                for i in range(4):
                    for l in range(WIDTH):
                        s1[i, l] += echo[i, 0] * f0[0, l] + echo[i, 1] * f0[1, l]
                _forces(s1, stops, rim, f1)
                for j in range(modes):
                    re, im, k = turn[j], turn[modes + j], modes + j
                    for l in range(WIDTH):
                        u, v = w[j, l], w[k, l]
                        w[j, l] = (
                            re * u
                            - im * v
                            + feed[j, 0] * f0[0, l]
                            + feed[j, 1] * f0[1, l]
                            + feed[j, 2] * f1[0, l]
                            + feed[j, 3] * f1[1, l]
                        )
                        w[k, l] = (
                            re * v
                            + im * u
                            + feed[k, 0] * f0[0, l]
                            + feed[k, 1] * f0[1, l]
                            + feed[k, 2] * f1[0, l]
                            + feed[k, 3] * f1[1, l]
                        )
        state[b] = w


def march(tableau: Tableau, blocks, revolutions: int, threads: int = 1) -> np.ndarray:
    """States after whole revolutions."""
    numba.set_num_threads(threads)
    state, t = blocks[0].copy(), tableau
    given = (t.look, t.echo, t.feed, t.turn, t.stops, t.rim, t.phases)
    _march(state, *blocks[1:], *given, revolutions)
    return state


@njit(fastmath=True)
def _rates(theta, q, v, share, low, high, row, column, load, rate, stops, rim, out):
    """`q.. = low q + high v + column F + load e^(i theta)`, amplitudes of modes, complex."""
    z, vz = 0j, 0j
    for i in range(q.size):
        z += row[i] * q[i]
        vz += rate * row[i] * v[i]
    force = 0j
    for k in range(stops.shape[0]):
        cos, sin, gap = stops[k, 0], stops[k, 1], stops[k, 2]
        depth = cos * z.real + sin * z.imag - gap
        if depth > 0:
            normal = stops[k, 3] * depth + stops[k, 4] * (cos * vz.real + sin * vz.imag)
            if normal > 0:
                slip = rim + cos * vz.imag - sin * vz.real
                force -= normal * (1 + 1j * stops[k, 5] * np.sign(slip)) * (cos + 1j * sin)
    phase = share * (np.cos(theta) + 1j * np.sin(theta))
    for i in range(q.size):
        total = column[i] * force + load[i] * phase
        for j in range(q.size):
            total += low[i, j] * q[j] + high[i, j] * v[j]
        out[i] = total


@njit(parallel=True, fastmath=True)
def _rk4(start, shares, low, high, row, column, load, rate, stops, rim, steps, revolutions):
    n, h = row.size, 2 * np.pi / steps
    each = steps // SAMPLES
    orbits = np.empty((shares.size, revolutions * SAMPLES + 1), np.complex128)
    for lane in prange(shares.size):
        share = shares[lane]
        q, v = start[:n].copy(), start[n:].copy()
        q1, v1 = np.empty_like(q), np.empty_like(q)
        a, b, c, d = np.empty_like(q), np.empty_like(q), np.empty_like(q), np.empty_like(q)
        v2, v3 = np.empty_like(q), np.empty_like(q)
        orbits[lane, 0] = (row * q).sum()
        for sample in range(revolutions * SAMPLES):
            for inner in range(each):
                theta = ((sample % SAMPLES) * each + inner) * h
                _rates(theta, q, v, share, low, high, row, column, load, rate, stops, rim, a)
                for i in range(n):
                    q1[i], v1[i] = q[i] + h / 2 * v[i], v[i] + h / 2 * a[i]
                _rates(
                    theta + h / 2, q1, v1, share, low, high, row, column, load, rate, stops, rim, b
                )
                for i in range(n):
                    q1[i], v2[i] = q[i] + h / 2 * v1[i], v[i] + h / 2 * b[i]
                _rates(
                    theta + h / 2, q1, v2, share, low, high, row, column, load, rate, stops, rim, c
                )
                for i in range(n):
                    q1[i], v3[i] = q[i] + h * v2[i], v[i] + h * c[i]
                _rates(theta + h, q1, v3, share, low, high, row, column, load, rate, stops, rim, d)
                for i in range(n):
                    q[i] += h / 6 * (v[i] + 2 * v1[i] + 2 * v2[i] + v3[i])
                    v[i] += h / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i])
            orbits[lane, sample + 1] = (row * q).sum()
    return orbits


def rk4_orbits(arrays: Arrays, shares, steps: int, revolutions: int, threads: int) -> np.ndarray:
    """Complex displacement of the disc (lanes, T)."""
    numba.set_num_threads(threads)
    n = arrays.row.size
    low, high = np.ascontiguousarray(arrays.a[n:, :n]), np.ascontiguousarray(arrays.a[n:, n:])
    stop = (arrays.cos, arrays.sin, arrays.gap, arrays.stiffness, arrays.damping, arrays.friction)
    matrices = (low, high, arrays.row, arrays.column, arrays.load, arrays.rate)
    stops = np.ascontiguousarray(np.stack(stop, axis=1))
    shares = np.asarray(shares, float)
    return _rk4(arrays.start, shares, *matrices, stops, arrays.rim, steps, revolutions)
