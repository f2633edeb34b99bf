"""Limiters between which no backward whirl survives.

A stop that rubs drives the rotor backward. In a deep backward whirl of rate `w` and radius `r`, friction
feeds power into the motion and the damper of the stop takes power out (a flat stop, pressed half of the
time):

    P_friction = f k w r^2 / 4,    P_damper = c w^2 r^2 / 4,    so it dies out where  c w > f k,

and a backward rub that bounces among `n` hard flat stops repeats itself if their restitution is

    e* = (tan(pi / n) - f) / (tan(pi / n) + f),

and dies out below: 0.89 for three stops, 0.70 for six (f = 0.1, no loss in flight). Both are estimates:
the rotor bends, is unbalanced, and has other damping too. The design uses the motion itself:

    minimise  c / (100 N s/m) - gap / (1 mm)      over stiffness k, damping c and gap of the stops
    such that W = Int h(t) Re(conj(z.) F) dt <= -0.6 E     released into the violent whip,
              W <= -0.4 E                                  released into the backward rub,
              radius <= 10 mm                              touching in forward whirl, most unbalanced.

`W` is the work of the stops on the rotor over four revolutions after the release, weighted by
`h = cos^2(pi t / 2 T)` and averaged over angles and eccentricities; `E` is the kinetic energy of the disc
at release. The work over a short window is smooth where the state at its end is not: a bounce that comes a
little later does almost the same work, but leaves in another direction.

Friction is given. Rotating all stops by the same angle changes nothing without weight (it shifts the phase
of the unbalance, over which all is averaged). The number of stops has no gradient, so designs of different
numbers are compared. The design is verified by an ensemble of long motions that it was not fitted to, and
by releases from the whole plane of radius and whirl rate (`anywhere`: none of 1728 ends backward).

Two things fail. The whirl index at the end of a long run is nearly the same at any damping where the rub
survives, and its derivative is noise (see `slopes`); then it jumps. Descent from the published stops ends
in a corner of the bounds where nothing changes any more, since such hard stops scatter the motion. So it
starts from a guess by hand, ten times softer, with more damping than `f k / w`.

    python notebooks/designs/limiters.py [--quick]
"""

import argparse
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import jaxrotor as jr
from jaxrotor import objectives, observe
from jaxrotor.plot import colours


PUBLISHED = jr.load("limiter-rotor")
LENGTH, TIME = 0.7, 0.0226465597  # l [m] and T* [s] of its source
MOST = 0.00143 * LENGTH  # eccentricity [m]
STARTS = {  # radius [m] and rate [rad/s] of release; named by its motion between published stops
    "at rest": (1e-3 * LENGTH, 0.0),
    "backward rub": (0.012 * LENGTH, -10.0 / TIME),
    "violent whip": (0.1 * LENGTH, -18.0 / TIME),
}
PEAK = 0.010  # bound of the radius [m]
STEPS = 128  # a revolution, of the design
GUESS = {"limiters.stiffness": 4e5, "limiters.damping": 200.0, "limiters.gap": 7e-3}
WHERE = {
    "limiters.stiffness": (2e5, 6e6),
    "limiters.damping": (3.0, 1e3),
    "limiters.gap": (4e-3, 9e-3),
}


def rotor(number: int = 3, blend: float | None = None) -> jr.Scene:
    """The rotor between `number` equal stops; `blend` [m] smooths their onset for the design."""
    first = PUBLISHED.of(jr.Limiter)[0]
    others = [effect for effect in PUBLISHED.effects if not isinstance(effect, jr.Limiter)]
    names = ("at", "gap", "stiffness", "damping", "friction", "rim_radius")
    same = {name: getattr(first, name) for name in names}
    angles = [np.pi / 3 + 2 * np.pi * k / number for k in range(number)]
    stops = [jr.Limiter(angle=angle, blend=blend, **same) for angle in angles]
    return jr.Scene(PUBLISHED.shaft, *others, *stops, spin=PUBLISHED.spin)


# === by hand


def restitution(number: int, friction: float = 0.1) -> float:
    """Restitution of hard stops below which a backward rub dies out, without loss in flight."""
    side = np.tan(np.pi / number)
    return (side - friction) / (side + friction)


# === objective and constraints of the design


def work(scene: jr.Scene, radius, rate, revolutions: int = 4) -> jax.Array:
    """Mean work of the stops from a start, over the kinetic energy of the disc there."""
    apart = 2 * jnp.pi / len(scene.of(jr.Limiter))  # the stops
    angles, eccentricities = jnp.meshgrid(jnp.arange(4) * apart / 4, jnp.array([0.0, MOST]))

    def one(case):
        angle, eccentricity = case
        moved = scene.put({"unbalance.eccentricity": eccentricity})
        start = jr.Whirl(radius, rate, angle)
        return objectives.contact_work(moved, revolutions, start=start, steps_per_revolution=STEPS)

    mean = jnp.mean(jax.lax.map(one, (angles.ravel(), eccentricities.ravel())))
    return mean / (0.5 * scene.get("disc.mass") * (radius * rate) ** 2)


def peak(scene: jr.Scene, revolutions: int = 8) -> jax.Array:
    """Largest radius [m], by the 16th power over angles, touching in forward whirl at most unbalance."""
    unbalanced = scene.put({"unbalance.eccentricity": jnp.asarray(MOST)})
    gap = jnp.ravel(scene.get("limiters.gap"))[0]

    def one(angle):
        start = jr.Whirl(gap, 1.74 / TIME, angle)
        run = jr.simulate(unbalanced, revolutions, STEPS, start=start)
        return objectives.peak(jnp.abs(run.displacement), None)

    return objectives.peak(jax.lax.map(one, jnp.arange(4) * jnp.pi / 2), 16)


CONSTRAINTS = (
    ("work, whip", lambda scene: work(scene, *STARTS["violent whip"]) + 0.6),
    ("work, rub", lambda scene: work(scene, *STARTS["backward rub"]) + 0.4),
    ("radius", lambda scene: (peak(scene) - PEAK) / 1e-3),
)


def cost(scene: jr.Scene) -> jax.Array:
    """Cost of the dampers less the value of the clearance."""
    damping, gap = (scene.get(f"limiters.{name}")[0] for name in ("damping", "gap"))
    return damping / 100.0 - gap / 1e-3


def design(number: int = 3, quick: bool = False) -> jr.Tuned:
    """The stops of least cost, by gradient."""
    return jr.tune(
        cost,
        rotor(number, blend=2e-4).replace(GUESS),
        WHERE,
        constraints=CONSTRAINTS,
        steps=15 if quick else 120,
        tolerance=1e-4,
        progress=False,
    )


def index(scene: jr.Scene, revolutions: int = 200) -> jax.Array:
    """`Int Im(conj(z) z.) dt / Omega Int |z|^2 dt` at the end of a long run, an objective that fails."""
    moved = scene.put({"unbalance.eccentricity": jnp.asarray(0.7 * MOST)})
    start = jr.Whirl(*STARTS["backward rub"])
    run = jr.simulate(moved, revolutions, STEPS, start=start, keep=20)
    momentum = jnp.mean(jnp.imag(jnp.conj(run.displacement) * run.velocity))
    return momentum / (jnp.mean(jnp.abs(run.displacement) ** 2) * scene.spin.speed)


def slopes(dampings=(100.0, 101.0)) -> list[tuple[float, float]]:
    """The index at the published stops with other damping, and its derivative [1 / (N s/m)]."""
    scene = rotor(3, blend=2e-4)
    of = lambda c: index(scene.put({"limiters.damping": c}))
    both = jax.jit(lambda c: jax.jvp(of, (c,), (jnp.ones(()),)))
    return [tuple(map(float, both(jnp.asarray(c)))) for c in dampings]


# === verification


def ensemble(scene: jr.Scene, eccentricities: int = 63, angles: int = 8, settle: int = 500):
    """Long motions from every start, angle and eccentricity: a dataset over all three."""
    over = {
        "unbalance.eccentricity": np.linspace(0.0, MOST, eccentricities),
        "start.angle": np.linspace(0.0, 2 * np.pi, angles, endpoint=False),
    }
    seen = (observe.Precession(), observe.Radius())
    run = {"settle": settle, "keep": 50, "observe": seen, "progress": False}
    run |= {
        "solver": jr.Exponential(order=4),
        "steps_per_revolution": 96,
    }  # not those of the design
    run["error_sample"] = 0
    parts = [jr.sweep(scene, over, start=jr.Whirl(*start), **run) for start in STARTS.values()]
    return xr.concat(parts, xr.Variable("start", list(STARTS)), combine_attrs="drop_conflicts")


def anywhere(scene: jr.Scene) -> xr.Dataset:
    """Long motions from 1728 releases: 2 to 100 mm off the axis, whirling at -24 to 2 over T*."""
    over = {
        "unbalance.eccentricity": np.linspace(0.0, MOST, 6),
        "start.radius": np.linspace(2e-3, 0.1, 8),
        "start.rate": np.linspace(-24.0, 2.0, 9) / TIME,
        "start.angle": np.array([0.3, 1.0, 1.7, 4.0]),
    }
    seen = (observe.Precession(), observe.Radius())
    run = {"settle": 300, "keep": 50, "observe": seen, "error_sample": 0, "progress": False}
    return jr.sweep(scene, over, start=jr.Whirl(1e-3), **run)


def summary(ends: xr.Dataset) -> dict[str, float]:
    """Fraction of motions that end backward, by start and in all, and the largest radius [mm]."""
    backward = (ends["winding"] < 0) | (ends["status"] != 0)
    shares = {name: float(backward.sel(start=name).mean()) for name in STARTS}
    return shares | {
        "all": float(backward.mean()),
        "lanes": float(backward.size),
        "largest radius": 1e3 * float(ends["radius_max"].max()),
    }


class Solution(NamedTuple):
    """Designs by the number of stops, and the ensembles with three before and after."""

    designs: dict[int, jr.Tuned]
    before: xr.Dataset
    after: xr.Dataset
    others: dict[int, tuple[xr.Dataset, xr.Dataset]]  # smaller ensembles of other numbers


def stops(tuned: jr.Tuned, number: int) -> jr.Scene:
    """The designed scene, its stops sharp."""
    return rotor(number).replace({path: float(value) for path, value in tuned.values.items()})


def solve(quick: bool = False) -> Solution:
    """Design and verification; `quick` takes few motions, and three stops only."""
    numbers = (3,) if quick else (3, 6)
    few = {"eccentricities": 8, "angles": 3, "settle": 200}
    some = few if quick else {"eccentricities": 12, "angles": 6}
    most = few if quick else {}
    with ThreadPoolExecutor() as threads:  # each tuning keeps one core busy
        tuned = threads.map(lambda number: design(number, quick), numbers)
        designs = dict(zip(numbers, tuned, strict=True))
    others = {
        number: (ensemble(rotor(number), **some), ensemble(stops(designs[number], number), **some))
        for number in numbers[1:]
    }
    before, after = ensemble(rotor(), **most), ensemble(stops(designs[3], 3), **most)
    return Solution(designs, before, after, others)


# === pictures


def draw(solution: Solution) -> np.ndarray:
    """Whirl index and largest radius of every motion against eccentricity, before and after."""
    figure, axes = plt.subplots(
        2, 2, figsize=(6.7, 4.4), sharex=True, sharey="row", layout="constrained"
    )
    tints = (colours.BLUE, colours.ORANGE, colours.RED)
    for column, ends in zip(axes.T, (solution.before, solution.after), strict=True):
        across = 1e3 * ends["unbalance.eccentricity"].values
        for name, tint, mark in zip(STARTS, tints, "o^s", strict=True):
            lanes = ends.sel(start=name).transpose("unbalance.eccentricity", "start.angle", ...)
            style = {
                "color": tint,
                "markersize": 2,
                "label": f"from {name}".replace("at ", ""),
                "linestyle": "",
            }
            column[0].plot(across, lanes["winding"], mark, **style)
            column[1].plot(across, 1e3 * lanes["radius_max"], mark, **style)
        column[0].axhline(0.0, color="0.6", linewidth=0.6)
        column[1].axhline(1e3 * PEAK, color="0.6", linewidth=0.6)
        column[1].set(yscale="log", xlabel="eccentricity [mm]")
    axes[0, 0].set(title="published stops", ylabel="whirl [turns/rev]")
    axes[0, 1].set(title="designed stops")
    axes[1, 0].set_ylabel("largest radius [mm]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    pairs = dict(zip(labels, handles, strict=True))
    figure.legend(pairs.values(), pairs.keys(), loc="outside lower center", ncols=3, frameon=False)
    return axes


def draw_objectives(quick: bool = False) -> np.ndarray:
    """Pictures of the work over a window and of the index after a long run, against damping."""
    dampings = np.geomspace(5.0, 1000.0, 3 if quick else 41)
    scene = rotor(3, blend=2e-4)
    at = lambda of: jax.jit(
        lambda all_: jax.lax.map(lambda c: of(scene.put({"limiters.damping": c})), all_)
    )(jnp.asarray(dampings))
    starts = jnp.array([STARTS["violent whip"], STARTS["backward rub"]])
    works = lambda moved: jax.lax.map(lambda start: work(moved, *start), starts)
    figure, axes = plt.subplots(1, 2, figsize=(6.7, 2.6), layout="constrained")
    for values, label in zip(at(works).T, ("from the whip", "from the rub"), strict=True):
        axes[0].plot(dampings, values, label=label)
    axes[0].set_ylabel("work of the stops over $E$ [1]")
    axes[0].legend(frameon=False)
    if quick:  # `slopes` computes the index as well
        axes[1].set_xlim(dampings[0], dampings[-1])
    else:
        axes[1].plot(dampings, at(index), ".-", color=colours.RED, markersize=3, linewidth=0.6)
    axes[1].set_ylabel("whirl index, late [1]")
    for ax in axes:
        ax.axhline(0.0, color="0.6", linewidth=0.6)
        ax.set(xscale="log", xlabel="damping of the stops [N s/m]")
    return axes


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarser, in a fraction of the time")
    quick = parser.parse_args().quick
    solution = solve(quick)
    for number, tuned in solution.designs.items():
        print(f"{number} stops; by hand a rub needs restitution {restitution(number):.3f}\n{tuned}")
    for name, ends in (("before", solution.before), ("after", solution.after)):
        print(name, summary(ends))
    for number, pair in solution.others.items():
        print(number, "stops", *(summary(ends) for ends in pair), sep="\n  ")
    wide = anywhere(stops(solution.designs[3], 3))
    backward = int((wide["winding"] < 0).sum() + (wide["status"] != 0).sum())
    print(
        f"of {wide['winding'].size} releases from a grid, backward after 300 revolutions: {backward}"
    )
    print("index after a long run, and its derivative", *slopes())
    draw(solution)[0, 0].figure.savefig("limiters.png", dpi=200)
    draw_objectives(quick)[0].figure.savefig("limiters_objectives.png", dpi=200)
