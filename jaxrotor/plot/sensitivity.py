"""Sensitivity of the control loops of magnetic bearings over frequency, with zones."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..analysis.sensitivity import LETTERS, ZONES, Sensitivity
from . import colours, page
from .units import speed_unit


LOWEST, ABOVE = 0.02, 1.3  # least |S| that is drawn, and how far beyond the highest peak and zone C
STRENGTHS = 0.0, 0.12, 0.26, 0.42  # of the background of each zone


def sensitivity(result: Sensitivity, ax: Axes | None = None) -> Axes:
    """`|S|` of every loop over the frequency, its peak, and the zones of ISO 14839-3.

    Loops that are alike are one curve.

    Args:
        result: result of `jaxrotor.sensitivity`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, both of its axes logarithmic.
    """
    ax = page.single(ax, 170, 85)
    turns, unit = speed_unit()
    frequencies, sizes = turns * np.asarray(result.frequencies), np.abs(result.values)
    peaks = np.asarray(result.peaks)
    ax.set_xscale("log")
    ax.set_yscale("log")
    for number, (name, size) in enumerate(_unlike(result.loops, sizes).items()):
        page.curve(ax, frequencies, size, colours.cycled(number), name)
    places = turns * np.asarray(result.peak_frequencies)
    ax.plot(places, peaks, "o", color=colours.DARK, markersize=3.5, label="peak", zorder=4)
    top = ABOVE * max(peaks.max(), ZONES["C"])
    low = max(LOWEST, 0.8 * float(np.min(sizes[sizes > 0], initial=1.0)))
    ax.set_xlim(frequencies[0], frequencies[-1])
    ax.set_ylim(low, top)
    ends = [low, *ZONES.values(), np.inf]
    for letter, strength, first, last in zip(LETTERS, STRENGTHS, ends[:-1], ends[1:], strict=True):
        if first < top:
            last = min(last, top)
            ax.axhspan(first, last, color=colours.ORANGE, alpha=strength, linewidth=0, zorder=0.2)
            style: Any = {
                "fontsize": page.TEXT,
                "ha": "left",
                "va": "center",
                "color": colours.DARK,
            }
            where = ax.get_yaxis_transform()
            height = np.sqrt(max(first, 1.0) * last)
            ax.text(0.01, height, f"zone {letter}", transform=where, **style)
    return page.finish(ax, f"frequency [{unit}]", "|S|", columns=3)


def _unlike(names: tuple[str, ...], sizes: np.ndarray) -> dict[str, np.ndarray]:
    """Sizes by the names of loops; those that are alike have one, with all their names."""
    found: list[tuple[list[str], np.ndarray]] = []
    for name, size in zip(names, sizes, strict=True):
        for own, other in found:
            if np.allclose(size, other, rtol=1e-3):
                own.append(name)
                break
        else:
            found.append(([name], size))
    return {", ".join(own): size for own, size in found}
