"""Designed limiters under tolerances: how probable is backward whirl, and which tolerance matters.

Eight parameters scatter evenly by 10 % to either side of their design, apart from each other: stiffness,
damping, gap and friction of the stops, speed, mass of the disc, external and internal damping of the
shaft. The rotor is released anywhere: 2 to 100 mm off the axis, whirling at -24 to 2 over T* of its
source, at any angle, with any eccentricity up to the largest published one. A motion that fails counts as
backward.

Draws are independent, so the bounds of the probability are exact. Of 16 384 draws around the designed
stops 22 end backward, 0.13 % (0.08 to 0.20 % with 95 % confidence). By hand a deep backward whirl dies
out where `c w > f k` (see `limiters.py`); so that this holds as well where friction and stiffness are
10 % more and damping 10 % less, the safer stops have 1.1 * 1.1 / 0.9 times the damping. The Sobol indices
are those of all that is random, the release included.

    python notebooks/designs/tolerances.py [--quick]
"""

import argparse

import numpy as np
import xarray as xr

import jaxrotor as jr
from jaxrotor import observe


LENGTH, TIME = 0.7, 0.0226465597  # l [m] and T* [s] of the rotor's source
DESIGNED = {  # by `limiters.py`: three stops
    "limiters.stiffness": 337_682.0,
    "limiters.damping": 151.7,
    "limiters.gap": 6.6154e-3,
}
WITHIN = 0.1  # of each parameter
SAFER = DESIGNED | {"limiters.damping": 204.0}  # 1.1 * 1.1 / 0.9 times as much
SCATTERED = (
    *("limiters.stiffness", "limiters.damping", "limiters.gap", "limiters.friction"),
    *("spin.speed", "disc.mass", "external_damping.per_length", "internal_damping.voigt_time"),
)
RELEASES = {
    "start.radius": (2e-3, 0.1),
    "start.rate": (-24.0 / TIME, 2.0 / TIME),
    "start.angle": (0.0, 2 * np.pi),
    "unbalance.eccentricity": (0.0, 0.00143 * LENGTH),
}


def spread(scene: jr.Scene) -> dict[str, tuple[float, float]]:
    """Ranges of the parameters that scatter and of the releases."""
    own = {path: float(np.ravel(scene.get(path))[0]) for path in SCATTERED}
    return {
        path: (value * (1 - WITHIN), value * (1 + WITHIN)) for path, value in own.items()
    } | RELEASES


def ends(scene: jr.Scene, draws: dict[str, np.ndarray], settle: int = 300) -> xr.Dataset:
    """Long motions of all draws, over `draw`."""
    seen = (observe.Precession(), observe.Radius())
    run = {"settle": settle, "keep": 50, "observe": seen, "progress": False}
    return jr.sweep(scene, {"draw": draws}, start=jr.Whirl(1e-2), **run)


def backward(found: xr.Dataset) -> np.ndarray:
    """Whether a motion ends in backward whirl, or fails."""
    return ((found["winding"] < 0) | (found["status"] != 0)).values


def probability(scene: jr.Scene, count: int, seed: int = 0, settle: int = 300) -> jr.Estimate:
    """Probability that a motion ends in backward whirl, with its bounds."""
    found = ends(scene, jr.draws(spread(scene), count, seed=seed), settle)
    return jr.probability(backward(found))


def importance(scene: jr.Scene, count: int) -> xr.Dataset:
    """Which parameter decides the largest radius at the end: Sobol indices; it raises if a lane fails."""
    radius = lambda draws: ends(scene, draws)["radius_max"].values
    return jr.sensitivities(radius, spread(scene), count)


def main(quick: bool) -> None:
    published = jr.load("limiter-rotor")
    designed = published.replace(DESIGNED)
    count = 256 if quick else 4096
    print("published stops:", probability(published, count))
    print("designed stops:", probability(designed, count))
    safer = published.replace(SAFER)
    print("stops with more damping:", probability(safer, count, seed=1))
    found = importance(safer, 16 if quick else 1024)
    for path in found.sortby("total", ascending=False)["path"].values:
        one = found.sel(path=path)
        low, value, high = (float(one[f"total{end}"]) for end in ("_low", "", "_high"))
        print(f"  {path:30} {value:6.2f} ({low:.2f} to {high:.2f}) of the variance")
    axes = jr.plot.sensitivities(found)
    axes.figure.savefig("tolerances.png", dpi=200)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer draws")
    main(parser.parse_args().quick)
