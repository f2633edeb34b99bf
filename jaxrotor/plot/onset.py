"""Onset of instability against damping."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, page


def onset(
    x: Any,
    speeds: Any,
    frequencies: Any,
    axes: Any = None,
    *,
    x_label: str = "internal damping ratio [1]",
    speed_label: str = "onset speed [rad/s]",
    frequency_label: str = "whirl frequency at onset [rad/s]",
) -> tuple[Axes, Axes]:
    """Onset speed of instability, and the whirl frequency there, against a parameter.

    NaN (no onset) leaves a gap.

    Args:
        x: (N,) the parameter, by default a damping ratio [1].
        speeds: (N,) onset speed [rad/s].
        frequencies: (N,) whirl frequency at the onset [rad/s].
        axes: two Axes, left and right; a new figure if None.
        x_label: label of both horizontal axes.
        speed_label: label of the speeds.
        frequency_label: label of the frequencies.

    Returns:
        The Axes of the speeds and of the frequencies.

    Raises:
        ValueError: `axes` are not two.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 2.
    """
    first, second = page.pair(axes, 170, 65, beside=True)
    for ax, values, colour, label in (
        (first, speeds, colours.BLUE, speed_label),
        (second, frequencies, colours.ORANGE, frequency_label),
    ):
        ax.plot(
            np.asarray(x),
            np.asarray(values),
            color=colour,
            linewidth=1.2,
            marker="o",
            markersize=3.0,
        )
        ax.set_xlabel(x_label)
        ax.set_ylabel(label)
    return first, second
