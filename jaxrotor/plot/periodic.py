"""Periodic orbit: path over a period, and multipliers with the unit circle."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, labels, page
from .orbit import draw_limiters
from .record import signal


IMAGES = 360  # largest number of rotated periods drawn


def periodic(result: Any, axes: Any = None, *, station: int = 0) -> tuple[Axes, Axes]:
    """One period of an orbit, its continuation, and its multipliers, unstable outside the unit circle.

    Args:
        result: `jaxrotor.PeriodicOrbit`.
        axes: two Axes, left and right; a new figure if None.
        station: index of the station of the result.

    Returns:
        The left Axes, path, and the right, multipliers [1].

    Raises:
        ValueError: the result has no such station, or `axes` are not two.
    """
    left, right = page.pair(axes, 170, 85, beside=True)
    path = signal(result, "displacement", station)
    factor, unit = labels.length(float(np.abs(path).max(initial=0.0)))
    path = factor * path
    for number in range(1, _images(float(result.turn))):
        image = path * np.exp(1j * number * float(result.turn))
        label = "next periods" if number == 1 else None
        left.plot(image.real, image.imag, color=colours.GREY, linewidth=0.6, label=label)
    left.plot(path.real, path.imag, color=colours.BLUE, linewidth=1.4, label="one period")
    left.plot(path.real[:1], path.imag[:1], "o", color=colours.BLUE, ms=4.0, label="start")
    draw_limiters(left, result, station, np.abs(path).max(initial=0.0), factor)
    left.set_xlabel(f"x displacement [{unit}]")
    left.set_ylabel(f"y displacement [{unit}]")

    circle = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 181))
    right.plot(
        np.real(circle), np.imag(circle), color=colours.GREY, linewidth=0.8, label="unit circle"
    )
    values = np.asarray(result.multipliers)
    outside = np.abs(values) >= 1
    for chosen, colour, name in (
        (~outside, colours.BLUE, "attracts"),
        (outside, colours.RED, "repels"),
    ):
        if chosen.any():
            right.plot(
                np.real(values[chosen]),
                np.imag(values[chosen]),
                "o",
                color=colour,
                markersize=4.0,
                label=name,
            )
    if result.trivial is not None:
        right.plot(
            [float(result.trivial)], [0.0], "D", color=colours.DARK, mfc="none", label="in time"
        )
    right.set_xlabel("Re multiplier [1]")
    right.set_ylabel("Im multiplier [1]")
    for ax in (left, right):
        ax.set_aspect("equal", adjustable="datalim")
        page.legend(ax, columns=2)
    page.assumption(right, result.scene)
    return left, right


def _images(turn: float) -> int:
    """Number of periods after which the rotated orbit closes."""
    ahead = np.abs(np.angle(np.exp(1j * turn * np.arange(1, IMAGES + 1))))
    return int(np.argmax(ahead < 1e-9)) + 1
