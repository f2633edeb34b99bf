"""Balancer: positions of the balls of a ball balancer, and the remaining imbalance."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from ..analysis import first_moments
from ..effects import AbstractBodies
from . import colours, page
from .record import sample


STEEL = 7850.0  # kg/m^3
_TINTS = (colours.BLUE, colours.ORANGE, colours.TEAL, colours.MAGENTA)  # one per row


class Row(NamedTuple):
    """The balls of one race, `b` of them, without empty places."""

    name: str
    colour: str
    angle: Float[np.ndarray, "T b"]  # relative to the rotor [rad]
    mass: Float[np.ndarray, " b"]  # [kg]
    size: Float[np.ndarray, " b"]  # radius of a ball [m]
    radius: float  # radius of the race [m]

    @property
    def moment(self) -> Complex[np.ndarray, " T"]:
        """Imbalance of the row [kg m]."""
        return np.exp(1j * self.angle) @ (self.radius * self.mass)


class Rows(NamedTuple):
    """All balls, and the imbalance with and without them."""

    rows: list[Row]
    rotor: complex  # imbalance without balls [kg m]
    left: Complex[np.ndarray, " T"]  # imbalance of rotor and balls [kg m]

    @classmethod
    def of(cls, run: Any) -> "Rows":
        races = run.scene.of(AbstractBodies)
        if not races:
            raise ValueError("This plot takes a run with balls; give the scene a `BallBalancer`.")
        rows = []
        for i, (race, found) in enumerate(zip(races, run.balls, strict=True)):
            there = np.asarray(race.masses) > 0
            count = int(there.sum())
            name = f"row {i + 1}, {count} ball{'s' if count != 1 else ''}"
            angle, mass = np.asarray(found.angle)[:, there], np.asarray(race.masses)[there]
            steel = np.cbrt(3 * mass / (4 * np.pi * STEEL))
            size = steel if race.ball_radius is None else np.full(count, float(race.ball_radius))
            tint = _TINTS[i % len(_TINTS)]
            rows.append(Row(name, tint, angle, mass, size, float(race.race_radius)))
        rotor = complex(first_moments(run.scene).unbalance)
        return cls(rows, rotor, np.asarray(run.imbalance))

    def draw(self, ax: Axes, now: int) -> None:
        """Draw races, balls and arrows of imbalance at a sample."""
        radius = max(row.radius for row in self.rows)
        capacity = sum(float(row.mass.sum()) * row.radius for row in self.rows)
        unit = max(capacity, abs(self.rotor))  # kg m, drawn as long as the radius of the race
        arrows = [("rotor", colours.DARK, self.rotor)]
        for row in self.rows:
            circle = {"fill": False, "edgecolor": colours.GREY, "linewidth": 0.8, "zorder": 1}
            ax.add_patch(Circle((0, 0), 1e3 * row.radius, **circle))
            style = {"facecolor": row.colour, "edgecolor": "white", "alpha": 0.85, "zorder": 2}
            for size, angle in zip(row.size, row.angle[now], strict=True):
                there = 1e3 * row.radius * np.array([np.cos(angle), np.sin(angle)])
                ax.add_patch(Circle(tuple(there), 1e3 * size, **style))
            arrows.append((row.name, row.colour, row.moment[now]))
        arrows.append(("remaining", colours.RED, self.left[now]))
        style = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.009, "zorder": 3}
        for name, colour, moment in arrows:
            tip = 1e3 * radius * moment / unit
            ax.quiver(0, 0, tip.real, tip.imag, color=colour, label=name, **style)
        reach = 1.35e3 * radius
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        page.note(ax, f"radius = {1e3 * unit:.3g} g m", right=True)
        page.finish(ax, "x of the rotor [mm]", "y of the rotor [mm]", columns=2)


def balls(run: Any, axes: Any = None) -> tuple[Axes, Axes]:
    """Angles of all balls relative to the rotor, and imbalance of rotor and balls, against time.

    A curve is interrupted where a ball passes 360 degrees.

    Args:
        run: a `TimeHistory` of a scene with balls.
        axes: two Axes, upper and lower; a new figure if None.

    Returns:
        The upper Axes, angles [deg], and the lower, imbalance [g m].
    """
    found, time = Rows.of(run), np.asarray(run.time)
    upper, lower = page.pair(axes, 170, 110)
    for row in found.rows:
        for number, angle in enumerate(_broken(np.degrees(row.angle)).T):
            label = None if number else row.name
            page.curve(upper, time, angle, row.colour, label, 1.0)
    left, alone = 1e3 * np.abs(found.left), 1e3 * abs(found.rotor)
    page.curve(lower, time, left, colours.DARK, "rotor and balls", 1.0)
    lower.axhline(alone, color=colours.RED, lw=0.8, ls="--", label="rotor alone")
    top = max(left.max(), alone)
    if left.min() < 1e-2 * top:
        lower.set_yscale("log")
        lower.set_ylim(max(left.min(), 1e-6 * top), 2 * top)
    else:
        lower.set_ylim(bottom=0.0)
    for ax in (upper, lower):
        ax.margins(x=0)
    upper.set(ylim=(0.0, 360.0), yticks=range(0, 361, 90))
    page.finish(upper, y="angle from the rotor [deg]", columns=4)
    return upper, page.finish(lower, "time [s]", "imbalance [g m]", columns=2)


def balancer_at(run: Any, time: float | int, ax: Axes | None = None) -> Axes:
    """Races and balls to scale at the sample next to a time, in the axes of the rotor.

    Arrows are the imbalances of the rotor and of each row, and their sum; the scale is noted in the
    picture. Balls without a `ball_radius` are drawn with the size of steel balls.

    Args:
        run: a `TimeHistory` of a scene with balls.
        time: instant [s] within the run.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, x and y in axes of the rotor [mm].
    """
    found, now = Rows.of(run), sample(run, time)
    ax = page.single(ax, 85, 95)
    found.draw(ax, now)
    page.note(ax, f"{run.time[now]:.4g} s")
    return ax


def _broken(degrees: Float[np.ndarray, "T b"]) -> Float[np.ndarray, "T b"]:
    """Angles from 0 to 360, with NaN where they pass 360."""
    turns = np.floor(degrees / 360)
    wrapped = degrees - 360 * turns
    wrapped[1:][np.diff(turns, axis=0) != 0] = np.nan
    return wrapped
