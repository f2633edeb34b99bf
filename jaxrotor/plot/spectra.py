"""Spectra: of the relative whirl speed `Lambda = psi. / Omega`, and of a periodic motion by its whirls."""

from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from . import colours, labels, page
from .record import revolutions, signal, whirl_speed


Spectrum = tuple[Float[np.ndarray, " f"], Float[np.ndarray, " f"]]

_DECADES = 8  # range of the amplitudes of harmonics drawn, downwards from the largest
_FREQUENCY = "frequency [cycles per revolution]"
_WHIRL = r"relative whirl speed $\dot\psi/\Omega$ [1]"


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
    return page.finish(ax, _FREQUENCY, f"amplitude of\n{_WHIRL}")


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
    dim = labels.only_swept(dataset, "spectrum", ("frequency",))
    dataset = dataset[["spectrum"]].sortby(dim).sel(frequency=dataset["frequency"] <= highest)
    amplitude = dataset["spectrum"].transpose("frequency", dim).values
    top = float(np.max(amplitude, initial=0.0, where=np.isfinite(amplitude)))
    if min(amplitude.shape) < 2 or top <= 0:
        raise ValueError(
            "A waterfall needs at least two lanes, two frequencies and one amplitude above zero, "
            f"but has {amplitude.shape[1]} lanes, {amplitude.shape[0]} frequencies up to "
            f"{highest:g} and a largest amplitude of {top:g}."
        )
    values, label = labels.coordinate(dataset, dim)
    bottom = top / 10**decades
    shown = np.maximum(amplitude, bottom)  # NaN stays NaN
    ax = page.single(ax, 120, 85)
    scale: Any = {"norm": LogNorm(bottom, top), "extend": "min"}
    page.shade(ax, values, dataset["frequency"].values, shown, f"amplitude of {_WHIRL}", **scale)
    return page.finish(ax, label, _FREQUENCY)


def harmonics(result: Any, ax: Axes | None = None, *, station: int = 0) -> Axes:
    """Amplitude of every harmonic `exp(i k Omega t)` of a motion against its order `k`.

    Args:
        result: `jaxrotor.HarmonicOrbit`.
        ax: Axes to draw in; a new figure if None.
        station: index of the station of the result.

    Returns:
        The Axes, amplitude on a logarithmic scale over the order of whirl, negative if backward.

    Raises:
        ValueError: the orbit is at rest in the centre, or the result has no such station.
    """
    ax = page.single(ax, 120, 75)
    orders = np.asarray(result.orders)
    amplitude = np.abs(signal(result, "coefficients", station))
    largest = float(amplitude.max(initial=0.0))
    if not largest > 0:
        raise ValueError(
            "This orbit is at rest in the centre, so it has no harmonics to draw; draw another orbit."
        )
    factor, unit = labels.length(largest)
    floor = factor * largest * 10.0**-_DECADES
    for chosen, colour, name in (
        (orders > 0, colours.FORWARD, "forward"),
        (orders < 0, colours.BACKWARD, "backward"),
        (orders == 0, colours.UNDEFINED, "mean"),
    ):
        drawn = chosen & (factor * amplitude > floor)
        if drawn.any():
            heights = factor * amplitude[drawn]
            ax.vlines(orders[drawn], floor, heights, color=colour, linewidth=1.2)
            ax.plot(orders[drawn], heights, "o", color=colour, markersize=3.5, label=name)
    ax.set_yscale("log")
    ax.set_ylim(floor, 3 * factor * largest)
    ax.set_xlim(1.05 * orders[0], 1.05 * orders[-1])
    label = f"amplitude [{unit}]"
    return page.finish(ax, "order of whirl [1]", label, columns=3, scene=result.scene)


def _stored(dataset: xr.Dataset) -> Spectrum:
    dims = labels.swept(dataset, "spectrum", ("frequency",))
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
