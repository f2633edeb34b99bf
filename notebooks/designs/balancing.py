"""Balancing in two planes through a rub.

The rotor of the scene `two-discs`, its bearings damped, runs at 110 rad/s, above its first critical
speed, and rubs on three stops at the second disc. The unbalance `u_1, u_2` [kg m] of the discs is unknown;
only the orbits at both are measured, over one settled revolution, with noise of 1 um. Correction masses
`c_1, c_2` are sought for the planes of the discs.

*Influence coefficients*: the vibration `v` once a revolution is measured at both discs, in a run as the
machine is and in two with trial masses; `A_j = (v_j - v) / t_j`, `v + A c = 0`. The method assumes that
vibration is proportional to unbalance. Through a stop it is not, so the coefficients, and with them the
corrections, are wrong. The remaining vibration may be clear of the stops, and then a second balancing, of
two or three more runs, is right.

*By gradient*: the four numbers of `u` are fitted to the measured orbits by Levenberg-Marquardt, through
the contact,

    minimise  sum |z_i(u) - z_i|^2 / sigma^2,     then  c = -u.

One run is enough, without trial masses, if the machine and its stops are known. The first guess is the
unbalance that would give the measured orbit without contact. Without contact the rotor is linear, so the
vibration that a correction leaves is known exactly: `unbalance_response`.

    python notebooks/designs/balancing.py [--quick]
"""

import argparse
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes

import jaxrotor as jr
from jaxrotor.plot import colours, page


SPEED, PLANES, SIGMA = 110.0, (0.5, 1.0), 1e-6  # [rad/s], [m], [m]
SETTLE, STEPS = 60, 128  # revolutions until the rub repeats itself; steps a revolution
HIDDEN = np.array([32.6 * 60e-6 * np.exp(0.5j), 51.5 * 80e-6 * np.exp(2.0j)])  # u [kg m]
GAP = 85e-6  # of the stops [m]
MODAL = jr.Exponential(
    basis="modal"
)  # unbalance does not move the modes; compiles in half the time
WHERE = {
    "unbalances.0.eccentricity": (1e-5, 2e-2),
    "unbalances.1.eccentricity": (1e-5, 2e-2),
    "unbalances.0.phase": None,
    "unbalances.1.phase": None,
}


def rotor(unbalance, rubbing: bool = True) -> jr.Scene:
    """The machine with unbalances [kg m] in both planes, complex in the axes of the rotor."""
    drawn = jr.load("two-discs").with_nodes(5)
    kept = [effect for effect in drawn.effects if not isinstance(effect, jr.Support | jr.Unbalance)]
    bearings = [jr.Support(at=at, stiffness=1e6, damping=2000.0) for at in (0.0, 1.5)]
    stop = {"gap": GAP, "stiffness": 5e6, "damping": 2000.0, "friction": 0.1, "rim_radius": 0.175}
    stops = [jr.Limiter(at=1.0, angle=2 * np.pi * k / 3, **stop) for k in range(3)]
    sources = [
        jr.Unbalance(at=at, mass=1.0, eccentricity=abs(u), phase=np.angle(u))
        for at, u in zip(PLANES, unbalance, strict=True)
    ]
    parts = (*kept, *bearings, *sources, *(stops if rubbing else ()))
    return jr.Scene(drawn.shaft, *parts, spin=jr.ConstantSpeed(SPEED))


def settled(scene: jr.Scene) -> jax.Array:
    """Orbits of both discs [m] over a revolution, (samples, 2)."""
    return jr.simulate(scene, SETTLE, STEPS, keep=1, at=PLANES, solver=MODAL).displacement[:-1]


def once(orbits) -> np.ndarray:
    """Harmonic of the vibration at once a revolution [m], complex in the axes of the rotor."""
    turn = np.exp(-2j * np.pi * np.arange(STEPS) / STEPS)
    return np.mean(np.asarray(orbits) * turn[:, None], axis=0)


def measured(unbalance, generator) -> np.ndarray:
    """Orbits of the machine with noise [m]."""
    noise = generator.normal(scale=SIGMA, size=(2, STEPS, 2))
    return np.asarray(settled(rotor(unbalance))) + noise[0] + 1j * noise[1]


def coefficients() -> np.ndarray:
    """Influence coefficients [m / (kg m)] of the rotor without contact, (discs, planes)."""
    unit = 1e-3
    sides = [rotor(unit * np.eye(2)[plane], rubbing=False) for plane in range(2)]
    seen = [jr.unbalance_response(side, SPEED, at=PLANES).forward for side in sides]
    return np.stack([np.ravel(one) for one in seen], axis=1) / unit


def left(corrections) -> float:
    """Largest vibration [m] that corrections leave without contact, exactly."""
    return float(np.max(np.abs(coefficients() @ (HIDDEN + np.asarray(corrections)))))


def by_influence(generator) -> np.ndarray:
    """Corrections [kg m] from influence coefficients of three runs that rub."""
    trials = 0.3 * np.abs(HIDDEN)
    runs = [once(measured(HIDDEN + added, generator)) for added in (0, *np.diag(trials))]
    influence = jr.influence_coefficients(runs[0], trials, np.stack(runs[1:]))
    return np.asarray(jr.correction_masses(influence, runs[0]))


def by_gradient(orbits) -> tuple[np.ndarray, jr.Tuned]:
    """Corrections [kg m] from the orbits of one run that rubs, through the contact."""
    guess = np.linalg.solve(coefficients(), once(orbits))

    def misfit(scene):
        off = (settled(scene) - orbits) / SIGMA
        return jnp.concatenate([off.real.ravel(), off.imag.ravel()])

    tuned = jr.tune(misfit, rotor(guess), WHERE, steps=40, tolerance=1e-8, progress=False)
    size, phase = np.reshape([float(value) for value in tuned.values.values()], (2, 2))
    return -size * np.exp(1j * phase), tuned


def draw(solution: "Solution") -> tuple[Axes, Axes]:
    """Picture of the orbits of the second disc before and after, and of the corrections."""
    first, second = page.pair(None, 170, 105, beside=True)
    added = {"as it is": np.zeros(2)} | solution.corrections
    tints = (colours.DARK, colours.RED, colours.BLUE)
    for (name, masses), tint in zip(added.items(), tints, strict=True):
        seen = 1e6 * np.asarray(settled(rotor(HIDDEN + masses)))[:, 1]
        seen = np.append(seen, seen[0])
        first.plot(seen.real, seen.imag, color=tint, linewidth=1.2, label=name)
        if name in solution.corrections:
            points = 1e3 * masses
            second.plot(points.real, points.imag, "o", color=tint, markersize=4, label=name)
    for k in range(3):
        wall = np.exp(2j * np.pi * k / 3) * 1e6 * (GAP + 147e-6j * np.array([-1.0, 1.0]))
        label = None if k else "stops"
        first.plot(wall.real, wall.imag, color="0.6", linewidth=1.5, zorder=0, label=label)
    points = -1e3 * HIDDEN
    second.plot(points.real, points.imag, "+", color="k", markersize=10, label="right")
    for plane, point in enumerate(points, 1):
        place = {"xytext": (8, 8), "textcoords": "offset points", "fontsize": 8}
        second.annotate(f"plane {plane}", (point.real, point.imag), **place)
    second.plot(0.0, 0.0, ".", color="0.6")
    first.set(xlabel="x of disc 2 [\N{MICRO SIGN}m]", ylabel="y of disc 2 [\N{MICRO SIGN}m]")
    second.set(xlabel="correction along x [g m]", ylabel="correction along y [g m]")
    second.set(xlim=(-3, 4.5), ylim=(-5, 1))
    for ax in (first, second):
        ax.set_aspect("equal")
        page.legend(ax, 2)
    return first, second


class Solution(NamedTuple):
    """Corrections [kg m] by both methods, and the fit."""

    corrections: dict[str, np.ndarray]
    tuned: jr.Tuned


def solve(quick: bool = False) -> Solution:
    """Both methods on the same machine; `quick` changes nothing, since none takes long."""
    del quick
    generator = np.random.default_rng(0)
    orbits = measured(HIDDEN, generator)
    by_runs = by_influence(generator)
    added, tuned = by_gradient(orbits)
    return Solution({"influence coefficients": by_runs, "by gradient": added}, tuned)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarser, in a fraction of the time")
    quick = parser.parse_args().quick
    solution = solve(quick)
    print(solution.tuned)
    free = 1e6 * left(np.zeros(2))
    print(f"without correction, were there no stops: {free:.2f} um; gap {1e6 * GAP:g} um")
    for name, added in solution.corrections.items():
        share = np.abs(HIDDEN + added) / np.abs(HIDDEN)
        print(f"{name}: leaves {1e6 * left(added):.2f} um, of the unbalances {np.round(share, 4)}")
    draw(solution)[0].figure.savefig("balancing.png")
