"""Dampers at the disc and in the bearings for a required onset speed, at least cost.

A disc `m` on a massless shaft of stiffness `k`, with damping `h` inside it, in two bearings of stiffness
`k_b`. Above its onset speed internal damping feeds a forward whirl; damping at the disc `c_d` and in the
bearings `c_b` raises that speed:

    minimise  (10 c_d + 2 c_b) / (1000 N s/m)     a damper at the disc costs ten times one in a bearing
    such that Omega* >= 300 rad/s

By hand, for the whirl `exp(i w t)` on the boundary: shaft and bearings in series carry the disc,

    D = m w^2 - i c_d w,   B = 2 k_b + 2 i c_b w,   D B / (B - D) = k + i h (w - Omega*),

whose real part gives `w` and then the imaginary part `Omega*`. A bearing too strongly damped acts as a
rigid one, so `Omega*` rises with `c_b` and falls again; a damper at the disc always helps, but costs more.

A second, smaller design: the least damping by the medium that makes a given speed the onset speed of the
scene `limiter-rotor`.

    python notebooks/designs/damping.py [--quick]
"""

import argparse
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes

import jaxrotor as jr
from jaxrotor import objectives
from jaxrotor.plot import colours, page


REQUIRED = 300.0  # onset speed [rad/s]
PRICES = {"disc_damping.translational": 10.0, "supports.damping": 2.0}  # of 1000 N s/m
WHERE = {"disc_damping.translational": (1.0, 500.0), "supports.damping": (1.0, 5000.0)}
TIME = 0.0226465597  # T* of the limiter rotor [s]


def rotor() -> jr.Scene:
    """A disc of 10 kg in the middle of a shaft on two bearings."""
    bearing = {"stiffness": 1e5, "damping": 600.0}
    return jr.Scene(
        jr.MasslessShaft(length=1.0, at=0.5, k11=1e5, damping=160.0, ends="elastic"),
        jr.Disc(at=0.5, mass=10.0),
        jr.DiscDamping(at=0.5, translational=50.0),
        jr.Support(at=0.0, **bearing),
        jr.Support(at=1.0, **bearing),
        spin=jr.ConstantSpeed(200.0),
    )


def onset(scene: jr.Scene) -> jax.Array:
    """Onset speed [rad/s]."""
    return objectives.onset_speed(scene, (80.0, 700.0), 20)


def cost(scene: jr.Scene) -> jax.Array:
    """Cost of the dampers [1]."""
    return sum(price * jnp.ravel(scene.get(path))[0] for path, price in PRICES.items()) / 1000


def dampers(required: float = REQUIRED, quick: bool = False) -> jr.Tuned:
    """The cheapest dampers for a required onset speed [rad/s]."""
    return jr.tune(
        cost,
        rotor(),
        WHERE,
        constraints=[("onset", lambda scene: (required - onset(scene)) / 100)],
        steps=80 if quick else 200,
        tolerance=1e-7,
        progress=False,
    )


def medium(number: float = 15.0, quick: bool = False) -> jr.Tuned:
    """Least damping by the medium for an onset speed `N / T*` of the limiter rotor."""
    required = number / TIME
    path = "external_damping.per_length"
    speed = lambda scene: objectives.onset_speed(scene, (0.5 * required, 1.5 * required), 20)
    return jr.tune(
        lambda scene: scene.get(path) / 10.0,
        jr.load("limiter-rotor"),
        {path: (1.0, 30.0)},
        constraints=[("onset", lambda scene: 1.0 - speed(scene) / required)],
        steps=80 if quick else 200,
        tolerance=1e-7,
        progress=False,
    )


def draw(tuned: jr.Tuned, quick: bool = False) -> Axes:
    """Picture of the onset speed over both dampers, lines of equal cost, and the iterates."""
    disc, bearing = (
        np.linspace(1, 300, 9 if quick else 25),
        np.linspace(1, 1200, 9 if quick else 33),
    )
    scene = rotor()
    one = lambda pair: onset(scene.put(dict(zip(WHERE, pair, strict=True))))
    pairs = jnp.asarray(np.stack(np.meshgrid(disc, bearing), -1).reshape(-1, 2))
    speeds = np.asarray(jax.jit(lambda pairs: jax.lax.map(one, pairs))(pairs))
    speeds = speeds.reshape(bearing.size, disc.size)
    ax = page.single(None, 110, 85)
    levels = [level for level in range(150, 601, 50) if level != REQUIRED]
    lines = ax.contour(disc, bearing, speeds, levels=levels, colors="0.6", linewidths=0.8)
    ax.clabel(lines, fmt="%g", fontsize=7)
    ax.contour(disc, bearing, speeds, levels=[REQUIRED], colors=colours.BLUE, linewidths=2)
    least = float(tuned.loss)
    for share, style in ((0.8, ":"), (1.0, "-"), (1.2, ":")):
        by_bearing = (1000 * share * least - 10 * disc) / 2
        label = "equal cost, 20 % apart" if share == 1 else None
        ax.plot(disc, by_bearing, style, color=colours.ORANGE, linewidth=1.2, label=label)
    ways = [values[tuned.start] for values in tuned.history.values.values()]
    ax.plot(*ways, ".-", color=colours.DARK, linewidth=0.6, markersize=3, label="way of the tuning")
    ax.plot([], [], color=colours.BLUE, linewidth=2, label="300 rad/s, required")
    ax.plot([], [], color="0.6", linewidth=0.8, label="onset speed [rad/s]")
    ax.plot(
        *(float(jnp.ravel(value)[0]) for value in tuned.values.values()), "o", color=colours.RED
    )
    ax.set(
        xlim=(0, 300),
        ylim=(0, 1200),
        xlabel="damping at the disc $c_d$ [N s/m]",
        ylabel="damping in each bearing $c_b$ [N s/m]",
    )
    page.legend(ax, 2)
    return ax


class Solution(NamedTuple):
    """Dampers of the rotor in bearings, and the medium of the limiter rotor."""

    dampers: jr.Tuned
    medium: jr.Tuned


def solve(quick: bool = False) -> Solution:
    """Both designs."""
    return Solution(dampers(quick=quick), medium(quick=quick))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarser, in a fraction of the time")
    quick = parser.parse_args().quick
    solution = solve(quick)
    print(
        solution.dampers, f"onset speed {float(onset(solution.dampers.scene)):.6f} rad/s", sep="\n"
    )
    print(solution.medium)
    draw(solution.dampers).figure.savefig("damping.png")
