"""Record: quantities that the plots derive from the response of one simulation."""

from typing import Any

import numpy as np
from jaxtyping import Bool, Complex, Float


Times = Float[np.ndarray, " T"]


def signal(response: Any, name: str, station: int) -> Complex[np.ndarray, " T"]:
    """One complex signal x + i y of a response at one station."""
    values = np.asarray(getattr(response, name), dtype=complex)
    if values.ndim != 2:
        raise ValueError(
            f"This plot takes one simulation, but `{name}` has shape {values.shape}, not "
            "(times, stations); pick one lane."
        )
    stations = values.shape[1]
    if not -stations <= station < stations:
        raise ValueError(f"`station` must be 0 to {stations - 1}, but is {station}.")
    return values[:, station]


def station_of(response: Any, station: int) -> float:
    """Place [m] of a station of a response on the shaft."""
    return float(np.asarray(response.stations)[station])


def sample(result: Any, time: float | int) -> int:
    """Index of the sample closest to a time [s]."""
    times = np.asarray(result.time)
    if not times[0] <= time <= times[-1]:
        raise ValueError(
            f"`time [s]` must be within the run ({times[0]:g} to {times[-1]:g}), but is {time!r}."
        )
    return int(np.argmin(np.abs(times - time)))


def revolutions(response: Any) -> Times:
    """Revolutions of the rotor at each time."""
    steps = getattr(response, "steps_per_revolution", None)
    if steps is None:
        return np.asarray(response.angle, dtype=float) / (2 * np.pi)
    time = np.asarray(response.time, dtype=float)  # at zero speed, too
    return (round(time[0] / (time[1] - time[0])) + np.arange(time.size)) / steps


def once_per_revolution(response: Any) -> Bool[np.ndarray, " T"]:
    """Mask of the first sample of each revolution: a Poincare section at angle 0."""
    # A millionth of a revolution is far below any step and far above the rounding of the angle.
    turns = np.abs(revolutions(response)) + 1e-6
    first = turns[:1] % 1 < 2e-6
    return np.concatenate([first, np.diff(np.floor(turns)) != 0])


def whirl_speed(response: Any, station: int) -> Times:
    """`Lambda = Im(conj(z) z.) / (|z|^2 Omega)`: relative whirl speed, NaN at rest in the centre."""
    z, rate = (signal(response, name, station) for name in ("displacement", "velocity"))
    below = np.abs(z) ** 2 * np.asarray(response.speed, dtype=float)
    defined = below != 0
    return np.where(defined, np.imag(np.conj(z) * rate) / np.where(defined, below, 1.0), np.nan)
