"""Stability map of the limiter rotor's shaft against a numpy loop over the same matrices.

    python benchmarks/stability_map.py                  # 200 by 200 points
    python benchmarks/stability_map.py --points 20

Growth rate over spin speed and external damping, 8 nodes. The loop is given the matrices for nothing
and calls `numpy.linalg.eigvals` of the same inverse pencil point by point, on `--loop` of the points.
"""

import argparse
import os
import time


os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices this small lose by threads

import jax  # noqa: E402
import numpy as np
from rich.console import Console
from rich.table import Table

import jaxrotor as jr


SCENE = jr.load("limiter-rotor").without("limiters")
FIRST, SECOND = "spin.speed", "external_damping.per_length"


def matrices():
    """Inertia, damping without and with the medium (per unit), gyroscopic, stiffness, circulatory."""
    blocks = jr.assemble(SCENE).blocks
    still = jr.assemble(SCENE.replace({SECOND: 0.0})).blocks
    unit = (blocks.damping - still.damping) / float(SCENE.get(SECOND))
    parts = blocks.inertia, still.damping, unit, blocks.gyroscopic, blocks.stiffness
    return [np.asarray(part) for part in (*parts, blocks.circulatory)]


def loop(points, parts):
    """Growth rates at `points` (speed, damping), one after the other."""
    inertia, damping, medium, gyroscopic, stiffness, circulatory = parts
    n = len(inertia)
    shift = 1 / np.sqrt(np.linalg.norm(inertia))
    growth = []
    for speed, per_length in points:
        c = damping + per_length * medium - 1j * speed * gyroscopic
        k = stiffness - 1j * speed * circulatory
        m, c = shift**2 * inertia, shift * c
        upper = -np.linalg.solve(k + c + m, np.concatenate([c + m, m], axis=1))
        lower = upper.copy()
        lower[:, :n] += np.eye(n)
        inverse = np.linalg.eigvals(np.concatenate([upper, lower]) / shift)
        growth.append((shift + 1 / inverse).real.max())
    return np.array(growth)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--points", type=int, default=200, help="points along each axis")
    parser.add_argument("--loop", type=int, default=2000, help="points of the numpy loop")
    given = parser.parse_args()
    axes = {
        FIRST: np.linspace(1.0, 900.0, given.points),
        SECOND: np.linspace(0.0, 20.0, given.points),
    }
    begun = time.perf_counter()
    jr.stability_map(SCENE, axes)
    first = time.perf_counter() - begun
    begun = time.perf_counter()
    result = jr.stability_map(SCENE, axes)
    again = time.perf_counter() - begun

    grid = np.stack(np.meshgrid(*axes.values(), indexing="ij"), axis=-1).reshape(-1, 2)
    chosen = np.random.default_rng(0).choice(len(grid), min(given.loop, len(grid)), replace=False)
    parts = matrices()
    begun = time.perf_counter()
    expected = loop(grid[chosen], parts)
    each = (time.perf_counter() - begun) / len(chosen)
    error = np.max(np.abs(result.growth.ravel()[chosen] - expected) / np.abs(expected).max())

    table = Table("", "s", "us a point")
    table.add_row("stability_map, compiled", f"{again:.2f}", f"{1e6 * again / len(grid):.0f}")
    table.add_row("compilation", f"{first - again:.2f}", "")
    table.add_row("numpy loop", f"{each * len(grid):.2f}", f"{1e6 * each:.0f}")
    Console().print(table)
    curves = sum(map(len, result.boundaries))
    print(f"numpy / stability_map {each * len(grid) / again:.2f}, growth differs by {error:.1e}")
    print(f"{curves} points of boundaries traced within that time; jax {jax.__version__}")


if __name__ == "__main__":
    main()
