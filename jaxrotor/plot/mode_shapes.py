"""Mode shapes along the shaft."""

from typing import Any

import numpy as np
from jaxtyping import Bool, Complex
from matplotlib.axes import Axes

from ..analysis import Modes
from ..analysis.modal import kind_of_whirl
from . import colours, labels, page
from .units import length_unit


MARKED = 24  # largest number of stations that are marked by points
_LINES = {"forward": "-", "backward": "--", "mixed": "-."}


def mode_shapes(modes: Modes, ax: Axes | None = None) -> Axes:
    """Shapes along the shaft, scaled to a largest displacement of 1, with the roots in the legend.

    Roots are those in fixed axes. Forward whirl is solid, backward whirl dashed, and mixed whirl, whose
    orbits are nearly straight lines, dash-dotted. A dotted curve is the imaginary part of a shape, 90
    degrees ahead in the plane of whirl; it is drawn if it exceeds 0.01. Of the two conjugate modes of a
    rotor with unequal axes, which are one motion, one is drawn.

    Args:
        modes: result of `jaxrotor.modes`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, displacement [1] over the position.
    """
    stations = np.asarray(modes.stations, dtype=float)
    order = np.argsort(stations)
    ax = page.single(ax, 140, 90)
    lengths, unit = length_unit("m")
    at = lengths * stations[order]
    parts = (modes.fixed_values, modes.forward, modes.shapes)
    one_each = single(modes)
    parts = (np.asarray(part)[one_each] for part in parts)
    for number, (value, sense, shape) in enumerate(zip(*parts, strict=True)):
        shape = _normalised(np.asarray(shape, dtype=complex))[order]
        quadrature = np.imag(shape)
        colour = colours.CYCLE[number % len(colours.CYCLE)]
        ax.plot(
            at,
            np.real(shape),
            color=colour,
            linewidth=1.2,
            linestyle=_LINES[kind_of_whirl(float(sense))] if value.imag else "-",
            marker="." if at.size <= MARKED else "",
            markersize=3.5,
            label=_described(complex(value), float(sense)),
        )
        if np.abs(quadrature).max() > 0.01:
            ax.plot(at, quadrature, color=colour, linewidth=1.0, linestyle=":")
    page.zero(ax)
    ax.set_ylim(-1.1, 1.1)
    ax.set_xlabel(f"position along the shaft [{unit}]")
    ax.set_ylabel("displacement / largest [1]")
    page.legend(ax, columns=2)
    return ax


def single(modes: Modes) -> Bool[np.ndarray, " m"]:
    """Mask of the modes without the second of each conjugate pair."""
    values: Any = np.asarray(modes.values)
    return np.full(values.shape, modes.counter is None) | (values.imag >= 0)


def _normalised(shape: Complex[np.ndarray, " x"]) -> Complex[np.ndarray, " x"]:
    largest = shape[np.argmax(np.abs(shape))]
    return shape / largest if largest != 0 else shape


def _described(value: complex, sense: float) -> str:
    """Description of a mode, such as "forward 77 rad/s, decay 5.04 /s"."""
    way = f"{kind_of_whirl(sense)} " if value.imag else ""
    return f"{way}{labels.root(value)}"
