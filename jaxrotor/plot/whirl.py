"""Whirl: relative whirl speed `Lambda = psi. / Omega` in time and in frequency."""

from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float
from matplotlib.axes import Axes

from . import colours, page
from .labels import swept
from .record import revolutions, whirl_speed


def whirl_history(response: Any, station: int = 0, ax: Axes | None = None) -> Axes:
    """Relative whirl speed against time in revolutions, and its mean, the precession index.

    +1 is synchronous forward whirl, and negative values are backward whirl. The curve has gaps where the
    rotor is at rest in the centre.

    Args:
        response: one simulation, with `time`, `angle`, `displacement` and `velocity`.
        station: index of the station of the response.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, relative whirl speed [1] over revolutions.

    Raises:
        ValueError: the response has no such station, or is of many lanes.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 5a.
    """
    turns, whirl = revolutions(response), whirl_speed(response, station)
    ax = page.single(ax, 170, 60)
    ax.plot(turns, whirl, color=colours.BLUE, linewidth=0.8, rasterized=turns.size > page.RASTER)
    page.zero(ax)
    if np.isfinite(whirl).any():
        mean = float(np.nanmean(whirl))
        ax.axhline(
            mean,
            color=colours.RED,
            linewidth=0.8,
            linestyle="--",
            label=f"mean {mean:.3g}".replace("-", "\N{MINUS SIGN}"),
        )
        page.legend(ax, columns=1)
    ax.margins(x=0)
    ax.set_xlabel("time [revolutions]")
    ax.set_ylabel("relative whirl speed\n" r"$\dot\psi/\Omega$ [1]")
    return ax


def whirl_spectrum(
    source: Any, ax: Axes | None = None, *, station: int = 0, highest: float | int = 10
) -> Axes:
    """Amplitude spectrum of the relative whirl speed without its mean.

    A sinusoid of amplitude a has a peak of height a. The unit of frequency is the spin, so a rotor that
    whirls at `Lambda` in contact with `n` equal stops has a peak at `n |Lambda|`. The spectrum of a
    response is taken with a Hann window over its last whole number of revolutions.

    Args:
        source: a dataset with `spectrum` (frequency,) of one lane, or the response of one
            simulation, evenly sampled in angle.
        ax: Axes to draw in; a new figure if None.
        station: index of the station of a response.
        highest: end of the frequency axis [cycles per revolution].

    Returns:
        The Axes, amplitude [1] over frequency [cycles per revolution].

    Raises:
        ValueError: the dataset has no spectrum of a single lane; or the response is not sampled evenly in
            angle, or is at rest in the centre at a sample.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 5b.
    """
    if isinstance(source, xr.Dataset):
        frequency, amplitude = _stored(source)
    else:
        frequency, amplitude = _computed(source, station)
    shown = frequency <= highest
    ax = page.single(ax, 85, 60)
    ax.plot(frequency[shown], amplitude[shown], color=colours.BLUE, linewidth=0.9)
    ax.set_xlim(0.0, min(highest, frequency[-1]))
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("frequency [cycles per revolution]")
    ax.set_ylabel("amplitude of\n" r"relative whirl speed $\dot\psi/\Omega$ [1]")
    return ax


Spectrum = tuple[Float[np.ndarray, " f"], Float[np.ndarray, " f"]]


def _stored(dataset: xr.Dataset) -> Spectrum:
    dims = swept(dataset, "spectrum", ("frequency",))
    if any(dataset.sizes[dim] > 1 for dim in dims):
        raise ValueError(
            "A whirl spectrum is that of one lane, but `spectrum` is over "
            f"{', '.join(repr(dim) for dim in dims)}; select one value of each with `.sel` or "
            "`.isel`, or draw them all with `waterfall`."
        )
    frequency = np.asarray(dataset["frequency"].values, dtype=float)
    return frequency, np.asarray(dataset["spectrum"].values, dtype=float).ravel()


def _computed(response: Any, station: int) -> Spectrum:
    """`2 |FFT(w (Lambda - mean))| / sum(w)`, w the Hann window."""
    turns, whirl = revolutions(response), whirl_speed(response, station)
    steps = np.diff(turns)
    if turns.size < 3 or not np.allclose(steps, steps[0], rtol=1e-6) or steps[0] == 0:
        raise ValueError(
            "A whirl spectrum needs a rotating rotor sampled evenly in angle; simulate at constant "
            "speed and keep every step."
        )
    step = abs(float(turns[-1] - turns[0])) / steps.size
    per_revolution = max(round(1 / step), 1)
    whole = turns.size // per_revolution * per_revolution or turns.size
    whirl = whirl[-whole:]
    undefined = int(np.sum(~np.isfinite(whirl)))
    if undefined:
        raise ValueError(
            f"The whirl speed is undefined at {undefined} of {whole} samples (at rest in the "
            "centre), so it has no spectrum; start off the centre or keep a later window."
        )
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(whole) / whole)
    amplitude = np.abs(np.fft.rfft(window * (whirl - whirl.mean()))) / window.sum()
    amplitude[1 : (whole + 1) // 2] *= 2  # negative frequencies are added to the positive ones
    return np.fft.rfftfreq(whole, step), amplitude
