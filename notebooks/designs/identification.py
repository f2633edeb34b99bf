"""A limiter's stiffness, gap and friction from one noisy record of a rotor that strikes it.

The rotor of the scene `limiter-rotor` is pulled 12 mm aside at full speed, into the corner between two
stops, and let go; it strikes the third. Both coordinates `z_i` of the disc are recorded 64 times a
revolution for 20 revolutions, with noise of standard deviation `sigma = 50` um. Sought are the three
numbers `p` that all stops share, and the noise, by `jr.fit`:

    minimise  sum |z_i(p) - z_i|^2,    C = sigma^2 (J^T J)^-1,   J = d z_i(p) / d p,

`C` being the covariance of the result, to first order in the noise. If it is right,
`(p - p_true)^T C^-1 (p - p_true)` is distributed as chi-square with three degrees of freedom: 99 % below
11.34.

The record is computed by four times as many steps as the ones that fit it, so that the data do not contain
the errors of the model.

    python notebooks/designs/identification.py [--quick]
"""

import argparse
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

import jaxrotor as jr
from jaxrotor.plot import colours, page


TRUE = jr.load("limiter-rotor")
PLUCK = jr.Whirl(12e-3)  # towards the corner between two stops
REVOLUTIONS, STEPS, EVERY = 20, 256, 4  # of the fit; every fourth sample is recorded
SIGMA = 50e-6  # [m]
WHERE = {
    "limiters.stiffness": (5e5, 2e7),
    "limiters.gap": (5e-3, 10e-3),
    "limiters.friction": (0.01, 0.5),
}
GUESS = {"limiters.stiffness": 2e6, "limiters.gap": 7.2e-3, "limiters.friction": 0.2}
TRUTH = {path: float(TRUE.get(path)[0]) for path in WHERE}
QUANTILE = 11.345  # of chi-square with 3 degrees of freedom, 99 %


def records(count: int) -> np.ndarray:
    """Records of the disc [m], complex, alike but for the noise: (count, samples)."""
    fine = jr.Exponential(4, located=True)
    run = jr.simulate(TRUE, REVOLUTIONS, 4 * STEPS, start=PLUCK, solver=fine)
    clean = np.asarray(run.displacement[:: 4 * EVERY, 0])
    noise = np.random.default_rng(0).normal(scale=SIGMA, size=(count, 2, clean.size))
    return clean + noise[:, 0] + 1j * noise[:, 1]


def record_of(recorded: np.ndarray) -> jr.TimeRecord:
    """The record as `jr.fit` takes it."""
    solver = jr.Exponential(basis="modal")  # stops do not move the modes; compiles in half the time
    return jr.TimeRecord(recorded, REVOLUTIONS, start=PLUCK, substeps=EVERY, solver=solver)


def identify(recorded: np.ndarray) -> jr.Fitted:
    """The limiter fitted to a record."""
    return jr.fit(TRUE.replace(GUESS), record_of(recorded), WHERE, progress=False)


def scatter(recorded: np.ndarray) -> np.ndarray:
    """Fits to every record, each begun at the truth: (count, 3), all by the program of the first.

    A fit that ends on a bound or finds no minimum is left out, and their number is printed.
    """
    found = []
    for one in recorded:
        try:
            fitted = jr.fit(TRUE, record_of(one), WHERE, progress=False)
        except RuntimeError:
            continue
        found.append([float(value) for value in fitted.values.values()])
    if missing := len(recorded) - len(found):
        print(f"{missing} of {len(recorded)} fits ended on a bound or found no minimum.")
    return np.array(found).reshape(-1, len(WHERE))


def draw(solution: "Solution") -> tuple[Axes, Axes]:
    """Picture of the record and its fit, and of the fits to every record with the covariance."""
    recorded, fitted, others = solution
    known = fitted.uncertainty
    first, second = page.pair(None, 170, 95, beside=True)
    dots = 1e3 * recorded
    first.plot(dots.real, dots.imag, ".", color="0.5", markersize=2, label="recorded")
    scene = fitted.scene
    seen = 1e3 * np.asarray(jr.simulate(scene, REVOLUTIONS, STEPS, start=PLUCK).displacement)
    first.plot(seen.real, seen.imag, color=colours.BLUE, linewidth=0.8, label="fitted")
    for stop in scene.of(jr.Limiter):
        turn, gap = np.exp(1j * float(stop.angle)), 1e3 * float(stop.gap)
        wall = turn * (gap + 1j * np.array([-12.0, 12.0]))
        first.plot(wall.real, wall.imag, color="0.6", linewidth=1.5, zorder=0)
    first.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", xlim=(-11, 14), ylim=(-13, 13))
    page.legend(first, 2)
    names = ("limiters.stiffness", "limiters.friction")
    order = [list(WHERE).index(name) for name in names]
    part = np.asarray(known.covariance)[np.ix_(order, order)]
    around = np.exp(1j * np.linspace(0.0, 2 * np.pi, 181))
    circle = np.sqrt(5.991) * np.stack([around.real, around.imag])  # chi-square of 2, 95 %
    scale = np.array([[1e-6], [1.0]])
    ring = scale * (np.linalg.cholesky(part) @ circle)
    at = scale * np.array([[float(known.values[name])] for name in names])
    second.plot(*(at + ring), color=colours.BLUE, linewidth=1.2, label="95 %")
    second.plot(*(scale * others[:, order].T), ".", color=colours.DARK, label="all records")
    second.plot(*at, "o", color=colours.BLUE, markersize=4)
    truth = [factor * TRUTH[name] for factor, name in zip((1e-6, 1.0), names, strict=True)]
    second.plot(*truth, "+", color=colours.RED, markersize=9, label="true")
    second.set(xlabel="stiffness of the stops [MN/m]", ylabel="friction [1]")
    page.legend(second, 3)
    return first, second


def distances(fitted: jr.Fitted, others: np.ndarray) -> np.ndarray:
    """Squared distances of the fits from the truth, each chi-square of 3 if the covariance is right."""
    off = (others - np.array(list(TRUTH.values()))).T
    return np.sum(off * np.linalg.solve(np.asarray(fitted.covariance), off), axis=0)


class Solution(NamedTuple):
    """The fit to the first record, and those to all."""

    recorded: np.ndarray
    fitted: jr.Fitted
    others: np.ndarray


def solve(quick: bool = False) -> Solution:
    """The limiter from one record, and from 16 (`quick`: 2) alike but for their noise."""
    recorded = records(2 if quick else 16)
    return Solution(recorded[0], identify(recorded[0]), scatter(recorded))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarser, in a fraction of the time")
    quick = parser.parse_args().quick
    solution = solve(quick)
    print(solution.fitted)
    distance = float(solution.fitted.uncertainty.distance(TRUTH))
    print(f"squared distance from the truth {distance:.2f}, 99 % below {QUANTILE}")
    every = distances(solution.fitted, solution.others)
    print(f"of {every.size} records {np.round(every, 1)}, in all {every.sum():.1f}")
    share = solution.others.std(axis=0, ddof=1) / np.sqrt(np.diag(solution.fitted.covariance))
    print(f"scatter over deviation {np.round(share, 2)}, 0.65 to 1.35 in 95 % of cases")
    draw(solution)[0].figure.savefig("identification.png")
