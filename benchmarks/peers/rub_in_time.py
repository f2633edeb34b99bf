"""Rub of the limiter rotor at a speed linear in time, for SciPy: one lane at a time.

The right-hand side is written in numpy, and compiled by numba where that is installed.
"""

import importlib.util
from typing import NamedTuple

import numpy as np
from scipy.integrate import odeint, solve_ivp

import jaxrotor as jr


ATOL = 1e-3  # [m, m/s] of rtol
NUMBA = importlib.util.find_spec("numba") is not None
if NUMBA:
    from numba import njit
else:
    njit = lambda function: function


class Numbers(NamedTuple):
    """`y' = (A + Omega B) y + P [N, T] + load (Omega^2 - i Omega.) e^(i theta)`.

    `y` is (x, x', y, y') of all coordinates; `local y` is the outward displacement, the outward velocity
    and the sideways velocity at every stop.
    """

    fixed: np.ndarray  # A
    turning: np.ndarray  # B
    push: np.ndarray  # P, (state, 2 stops)
    local: np.ndarray  # (3 stops, state)
    see: np.ndarray  # (2, state), displacement of the disc
    ahead: np.ndarray  # load, for an eccentricity of 1 m, and i times it
    aside: np.ndarray
    speeds: np.ndarray  # first speed [rad/s], acceleration [rad/s^2]
    stop: np.ndarray  # gap, stiffness, damping, friction, rim radius, blend, slip

    @classmethod
    def of(cls, scene: jr.Scene, speeds: tuple[float, float]) -> "Numbers":
        """Numbers of a scene with equal stops and one unbalance, all at the disc."""
        system = jr.assemble(scene.replace({"unbalance.eccentricity": 1.0}))
        blocks, n, stops = system.blocks, system.n, scene.of(jr.Limiter)
        inverse, zero = np.linalg.inv(np.asarray(blocks.inertia)), np.zeros((system.n, system.n))
        part = lambda name: inverse @ np.asarray(getattr(blocks, name))
        column, row = (np.asarray(of(stops[0].at)) for of in (system.line.column, system.line.row))
        fixed = np.block([[zero, np.eye(n)], [-part("stiffness"), -part("damping")]])
        across = np.block([[zero, zero], [part("circulatory"), part("gyroscopic")]])
        nothing, x, v = np.zeros_like(fixed), np.append(row, 0 * row), np.append(0 * row, row)
        see = np.stack([np.append(x, 0 * x), np.append(0 * x, x)])
        rate = np.stack([np.append(v, 0 * v), np.append(0 * v, v)])
        cos, sin = (np.array([[f(float(s.angle))] for s in stops]) for f in (np.cos, np.sin))
        out = lambda pair: cos * pair[0] + sin * pair[1]
        side = lambda pair: cos * pair[1] - sin * pair[0]
        force = lambda at: np.append(0 * at, inverse @ at)
        unit, load = force(column), force(np.asarray(system.load.unbalance).real)
        push = np.concatenate([np.hstack([-cos.T, sin.T]), np.hstack([-sin.T, -cos.T])])
        laws = ("gap", "stiffness", "damping", "friction", "rim_radius", "blend", "slip")
        return cls(
            np.block([[fixed, nothing], [nothing, fixed]]),
            np.block([[nothing, -across], [across, nothing]]),
            np.kron(push, unit[:, None]),
            np.concatenate([out(see), out(rate), side(rate)]),
            see,
            np.append(load, 0 * load),
            np.append(0 * load, load),
            np.array([speeds[0], speeds[1]]),
            np.array([float(getattr(stops[0], law)) for law in laws]),
        )


@njit
def rates(t, y, e, fixed, turning, push, local, ahead, aside, speeds, stop):
    """Right-hand side at the eccentricity `e` [m], with the smooth law of `jaxrotor.Limiter`."""
    gap, stiffness, damping, friction, rim, blend, slip = stop
    speed, theta = speeds[0] + speeds[1] * t, (speeds[0] + speeds[1] * t / 2) * t
    cos, sin, square = np.cos(theta), np.sin(theta), speed**2
    rate = fixed @ y + speed * (turning @ y)
    rate += e * (square * cos + speeds[1] * sin) * ahead
    rate += e * (square * sin - speeds[1] * cos) * aside
    seen, count = local @ y, push.shape[1] // 2
    depth = seen[:count] - gap
    if depth.max() > 0:
        depth = np.maximum(depth, 0.0)
        u = np.minimum(depth / blend, 1.0)
        onset = u**3 * (6 - 8 * u + 3 * u**2)
        viscous = damping * seen[count : 2 * count] * u**3 * (10 - 15 * u + 6 * u**2)
        normal = np.maximum(stiffness * (depth + blend * (onset - u)) + viscous, 0.0)
        reach = stiffness * blend
        u = np.minimum(normal / reach, 1.0)
        normal += reach * (u**3 * (6 - 8 * u + 3 * u**2) - u)
        u = np.minimum(np.maximum((speed * rim + seen[2 * count :]) / slip, -1.0), 1.0)
        sideways = friction * normal * u * (15 - 10 * u**2 + 3 * u**4) / 8
        rate += push @ np.concatenate((normal, sideways))
    return rate


def orbits(
    numbers: Numbers, eccentricities, times: np.ndarray, rtol: float, method="LSODA", compiled=NUMBA
) -> np.ndarray:
    """Complex displacement of the disc (lanes, T), from rest.

    LSODA is called by `odeint`, which returns to Python for the right-hand side only.
    """
    field = rates if compiled or not NUMBA else rates.py_func
    found, start = [], np.zeros(numbers.see.shape[1])
    given = tuple(part for part in numbers if part is not numbers.see)
    for e in eccentricities:
        args, how = (float(e), *given), {"rtol": rtol, "atol": ATOL * rtol}
        if method == "LSODA":
            y = odeint(field, start, times, args, tfirst=True, mxstep=100_000, **how).T
        else:
            span = (times[0], times[-1])
            y = solve_ivp(field, span, start, method, times, args=args, **how).y
        x, across = numbers.see @ y
        found.append(x + 1j * across)
    return np.array(found)
