"""Critical speeds: lines at them in diagrams over speed, by kind of whirl."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..analysis import CriticalSpeeds
from . import colours, page
from .units import speed_unit


_DASHES = {"forward": "--", "backward": ":", "mixed": "-."}
_CLOSE = 0.025  # distance of speeds, over the range, below which the second is not written


def mark_critical(
    axes: tuple[Axes, ...],
    critical: CriticalSpeeds,
    low: float,
    high: float,
    *,
    written: bool = False,
) -> None:
    """Draw a line at every critical speed from `low` to `high` [unit drawn], one label per kind.

    With `written` the speed stands beside its line, at the top of the first Axes.
    """
    seen: set[str] = set()
    last = -np.inf
    places = speed_unit()[0] * np.asarray(critical.speeds)
    for speed, kind in zip(places.tolist(), critical.kinds, strict=True):
        if not low <= speed <= high:
            continue
        name = None if kind in seen else f"critical, {kind}"
        seen.add(kind)
        for ax in axes:
            style = {"color": colours.GREY, "linewidth": 0.8, "zorder": 0.5}
            ax.axvline(speed, label=name, linestyle=_DASHES[kind], **style)
        if written and abs(speed - last) > _CLOSE * (high - low):
            style: Any = {"rotation": 90, "ha": "right", "va": "top", "fontsize": page.TEXT - 1}
            where = axes[0].get_xaxis_transform()
            axes[0].text(speed, 0.98, f"{speed:.4g}", transform=where, color="0.35", **style)
            last = speed
