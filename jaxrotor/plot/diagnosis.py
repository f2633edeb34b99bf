"""Diagnosis: probabilities of candidates beside the record and the fit of each."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, page
from .labels import length, parameter


def diagnosis(
    result: Any, axes: Any = None, *, record: int = 0, channel: int = 0
) -> tuple[Axes, Axes]:
    """Bars of the probabilities, and beside them the record with the fit of every candidate.

    An orbit is drawn as a path, a response or a spectrum by its amplitude, and of a complex motion in time
    its x. The fit of the most probable candidate is the thick line. Above the bars is what was found.

    Args:
        result: result of `jaxrotor.diagnose`.
        axes: two Axes; a new figure if None.
        record: index of the record.
        channel: index of the channel in the record.

    Returns:
        The Axes of the bars, and those of the record.

    Raises:
        ValueError: the result has no such record or channel, or `axes` are not two.
    """
    shown = result.explanations[result.most_probable].records
    if not 0 <= record < len(shown):
        raise ValueError(f"`record` must be 0 to {len(shown) - 1}, but is {record}.")
    measured = np.asarray(shown[record].measured)
    if not 0 <= channel < measured.shape[1]:
        raise ValueError(f"`channel` must be 0 to {measured.shape[1] - 1}, but is {channel}.")
    first, second = page.pair(axes, 170, 75, beside=True)
    names = sorted(result.probabilities, key=lambda name: result.probabilities[name])
    colour = {name: colours.cycled(i) for i, name in enumerate(result.probabilities)}
    shares = [result.probabilities[name] for name in names]
    bars = first.barh(names, shares, color=[colour[name] for name in names])
    first.bar_label(bars, [f"{share:.3g}" for share in shares], padding=2, fontsize=page.TEXT)
    first.set_xlim(0.0, 1.2)
    first.set_xticks([0.0, 0.5, 1.0])
    said = "none of these" if result.cause is None else result.cause
    first.set_title(f"cause: {said}", fontsize=page.TEXT, loc="left")
    page.finish(first, "probability [1]")
    _record(second, result, colour, names, (record, channel))
    return first, second


def _record(
    ax: Axes, result: Any, colour: dict[str, str], names: list[str], which: tuple[int, int]
) -> None:
    """Draw a record and the fits, the most probable one last and thick."""
    number, channel = which
    explanations = result.explanations
    shown = explanations[names[-1]].records[number]
    measured = np.asarray(shown.measured)[:, channel]
    fits = {
        name: measured + np.asarray(explanations[name].residuals[number])[:, channel]
        for name in names
    }
    plane, sizes = shown.kind == "plane" and np.iscomplexobj(measured), shown.kind == "amplitude"
    factor, unit = length(measured)
    turns, label = parameter(shown.name, shown.unit)
    across = turns * np.asarray(shown.abscissa)
    part = np.abs if sizes else np.real
    for name in names:
        width, line = (1.4 if name == names[-1] else 0.8), factor * fits[name]
        if plane:
            page.path(ax, np.append(line, line[:1]), colour[name], name, width=width)
        else:
            page.curve(ax, across, part(line), colour[name], name, width)
    dots: Any = {"color": colours.DARK, "markersize": 3, "label": "measured"}
    seen = factor * measured
    if plane:
        ax.plot(seen.real, seen.imag, ".", **dots)
        ax.set_aspect("equal", "datalim")
        ax.locator_params(axis="x", nbins=5)
        page.finish(ax, f"x displacement [{unit}]", f"y displacement [{unit}]", columns=2)
    else:
        ax.plot(across, part(seen), ".", **dots)
        what = "amplitude" if sizes else "displacement"
        page.finish(ax, label, f"{what} [{unit}]", columns=2)
