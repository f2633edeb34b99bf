"""Waterfall: spectra over a parameter, as a map."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from . import page
from .labels import coordinate, only_swept


def waterfall(
    dataset: xr.Dataset,
    ax: Axes | None = None,
    *,
    decades: float | int = 3,
    highest: float | int = 10,
) -> Axes:
    """Amplitude spectrum of the relative whirl speed over one swept parameter, as colours.

    Lanes without a spectrum (NaN) are grey.

    Args:
        dataset: result of a sweep over one parameter, with `spectrum` and its `frequency`.
        ax: Axes to draw in; a new figure if None.
        decades: range of the logarithmic colour scale, downwards from the largest amplitude.
        highest: end of the frequency axis [cycles per revolution].

    Returns:
        The Axes, frequency [cycles per revolution] over the parameter.

    Raises:
        ValueError: the dataset has no `spectrum` or is not over one parameter, or there is too little to
            draw.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 6.
    """
    dim = only_swept(dataset, "spectrum", ("frequency",))
    dataset = dataset[["spectrum"]].sortby(dim).sel(frequency=dataset["frequency"] <= highest)
    amplitude = dataset["spectrum"].transpose("frequency", dim).values
    top = float(np.max(amplitude, initial=0.0, where=np.isfinite(amplitude)))
    if min(amplitude.shape) < 2 or top <= 0:
        raise ValueError(
            "A waterfall needs at least two lanes, two frequencies and one amplitude above zero, "
            f"but has {amplitude.shape[1]} lanes, {amplitude.shape[0]} frequencies up to "
            f"{highest:g} and a largest amplitude of {top:g}."
        )
    values, label = coordinate(dataset, dim)
    bottom = top / 10**decades

    ax = page.single(ax, 120, 85)
    mesh = ax.pcolormesh(
        values,
        dataset["frequency"].values,
        np.maximum(amplitude, bottom),  # NaN stays NaN
        norm=LogNorm(bottom, top),
        cmap="viridis",
        shading="nearest",
        rasterized=True,
    )
    ax.set_facecolor("0.8")
    page.colour_bar(
        ax, mesh, "amplitude of " r"relative whirl speed $\dot\psi/\Omega$ [1]", extend="min"
    )
    ax.set_xlabel(label)
    ax.set_ylabel("frequency [cycles per revolution]")
    return ax
