"""Error of a motion against the steps that a rebound from a stop takes, by plain and by located steps.

    python benchmarks/rebound.py    # some five minutes of a core
    python benchmarks/rebound.py --only 'linear stop' --steps 64 256

The error is the largest difference of two displacements at a station over the largest displacement,
against SciPy's DOP853 (rtol 1e-10), whose stops are written here. Steps of a rebound are `T / h`, with
`T = pi sqrt(m / k)` of the mass at the stop, or as `jr.simulate` counts them where the shaft is flexible.
"""

import argparse
import math
import re
from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
from scipy.integrate import solve_ivp

import jaxrotor as jr


jax.config.update("jax_enable_x64", True)
SOLVERS = (
    jr.Exponential(2),
    jr.Exponential(4),
    jr.Exponential(2, located=True),
    jr.Exponential(4, located=True),
)
MASS, SHAFT, DAMPING, UNBALANCE, SPEED = 1.0, 4e3, 2.0, 1e-3, 60.0
Force = Callable[[complex, complex], complex]


class Case(NamedTuple):
    """A scene, the force of its stops on the shaft, their hardest stiffness, and revolutions."""

    scene: jr.Scene
    force: Force
    stiffness: float
    revolutions: int
    start: jr.AtRest | jr.Whirl = jr.AtRest()


def jeffcott(*stops, damping: float = DAMPING) -> jr.Scene:
    """A disc on a massless shaft between stops."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, SHAFT),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, damping),
        jr.Unbalance(0.5, MASS, UNBALANCE),
        *stops,
        spin=jr.ConstantSpeed(SPEED),
    )


def stop(angle: float, gap: float, stiffness: float, damping: float = 0.0) -> Force:
    """Force of a stop, which cannot pull."""
    out = np.exp(1j * angle)

    def force(z: complex, v: complex) -> complex:
        depth, closing = (z / out).real - gap, (v / out).real
        return -out * max(0.0, stiffness * depth + damping * closing) * (depth > 0)

    return force


def ring(gap: float, stiffness: float, friction: float, rim: float) -> Force:
    """Force of a ring with dry friction."""

    def force(z: complex, v: complex) -> complex:
        radius = abs(z)
        if radius <= gap:
            return 0j
        out = z / radius
        slip = SPEED * rim + (v / out).imag
        return -stiffness * (radius - gap) * (1 + 1j * friction * np.sign(slip)) * out

    return force


def cases() -> dict[str, Case]:
    """Scenes by name."""
    one = jr.Limiter(at=0.5, angle=0.0, gap=1e-3, stiffness=1e6)
    soft = jr.Limiter(at=0.5, angle=math.pi, gap=5e-4, stiffness=1e5)
    damped = jr.Limiter(at=0.5, angle=0.0, gap=1e-3, stiffness=1e6, damping=400.0)
    zero = jr.Limiter(at=0.5, angle=0.0, gap=0.0, stiffness=1e6)
    springs = jr.Limiter.at_angles([0.0, math.pi], at=0.5, gap=0.0, stiffness=4e5)
    rub = jr.AnnularStator(at=0.5, gap=1e-3, stiffness=1e6, friction=0.1, rim_radius=0.05)
    both = stop(0.0, 1e-3, 1e6), stop(math.pi, 5e-4, 1e5)
    pair = stop(0.0, 0.0, 4e5), stop(math.pi, 0.0, 4e5)
    rotor = jr.load("limiter-rotor").with_nodes(4)
    limiter = rotor.of(jr.Limiter)[0]
    return {
        "linear stop": Case(jeffcott(one), stop(0.0, 1e-3, 1e6), 1e6, 20),
        "stop with damping": Case(jeffcott(damped), stop(0.0, 1e-3, 1e6, 400.0), 1e6, 20),
        "stop without gap": Case(jeffcott(zero), stop(0.0, 0.0, 1e6), 1e6, 5),
        "two stops, 10 : 1 in stiffness": Case(
            jeffcott(one, soft), lambda z, v: both[0](z, v) + both[1](z, v), 1e6, 5
        ),
        "springs on both sides, no gap": Case(
            jeffcott(*springs), lambda z, v: pair[0](z, v) + pair[1](z, v), 4e5, 5
        ),
        "ring with friction": Case(jeffcott(rub), ring(1e-3, 1e6, 0.1, 0.05), 1e6, 5),
        "limiter rotor": Case(
            rotor.replace({"unbalance.eccentricity": 2e-4}),
            limiters(rotor),
            float(limiter.stiffness),
            4,
            jr.Whirl(12e-3, -441.0),
        ),
    }


def limiters(rotor: jr.Scene) -> Force:
    """Force of the stops of the limiter rotor, with damping and friction."""
    stops = rotor.of(jr.Limiter)
    numbers = [
        [float(x) for x in (s.angle, s.gap, s.stiffness, s.damping, s.friction, s.rim_radius)]
        for s in stops
    ]
    speed = float(rotor.spin.speed)

    def force(z: complex, v: complex) -> complex:
        total = 0j
        for angle, gap, k, d, friction, rim in numbers:
            out = np.exp(1j * angle)
            depth, closing = (z / out).real - gap, (v / out).real
            press = max(0.0, k * depth + d * closing) * (depth > 0)
            slip = speed * rim + (v / out).imag
            total -= press * (1 + 1j * friction * np.sign(slip)) * out
        return total

    return force


def reference(case: Case, samples: int) -> np.ndarray:
    """Displacement at the first stop by SciPy, `samples` a revolution."""
    system = jr.assemble(case.scene)
    blocks, speed = system.blocks, float(case.scene.spin.speed)
    n = system.n
    full = lambda block: np.zeros((n, n)) if block is None else np.asarray(block)
    mass = full(blocks.inertia)
    damping = full(blocks.damping) - 1j * speed * full(blocks.gyroscopic)
    stiffness = full(blocks.stiffness) - 1j * speed * full(blocks.circulatory)
    whirl = np.asarray(system.load.unbalance) * speed**2
    port = system.ports[0]
    row, column = np.asarray(port.row), np.asarray(port.column)
    solve = np.linalg.inv(mass)
    a, c, w, b = solve @ stiffness, solve @ damping, solve @ whirl, solve @ column
    begin = np.concatenate(case.start.state(system, port.at))

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        q, v = y[:n], y[n:]
        force = case.force(complex(row @ q), complex(row @ v))
        return np.concatenate([v, w * np.exp(1j * speed * t) - a @ q - c @ v + b * force])

    rebound = math.pi * math.sqrt(1 / (float(row @ b) * case.stiffness))
    period = 2 * math.pi / speed
    times = period * np.arange(case.revolutions * samples + 1) / samples
    how = {"rtol": 1e-10, "atol": 1e-14, "max_step": rebound / 8, "t_eval": times}
    found = solve_ivp(rates, (0, times[-1]), begin.astype(complex), method="DOP853", **how)
    return row @ found.y[:n]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="pattern of the cases")
    parser.add_argument("--steps", type=int, nargs="+", default=[64, 128, 256, 512, 1024, 2048])
    given = parser.parse_args()
    print("| scene | steps of a rebound | order 2 | order 4 | 2 located | 4 located |")
    print("|---|---|---|---|---|---|")
    for name, case in cases().items():
        if not re.search(given.only, name):
            continue
        samples = min(given.steps)
        want = reference(case, samples)
        period = 2 * math.pi / float(case.scene.spin.speed)
        for steps in given.steps:
            mass = float(case.scene.of(jr.Disc)[0].mass)
            count = steps * math.pi * math.sqrt(mass / case.stiffness) / period
            errors = []
            for solver in SOLVERS:
                how = {"solver": solver, "start": case.start}
                try:
                    run = jr.simulate(case.scene, case.revolutions, steps, **how)
                except RuntimeError:
                    errors.append("refused")
                    continue
                z = np.asarray(run.displacement)[:: steps // samples, 0]
                errors.append(f"{abs(z - want).max() / abs(want).max():.1e}")
            print(f"| {name} | {count:.3g} | " + " | ".join(errors) + " |", flush=True)


if __name__ == "__main__":
    main()
