"""Command `response`: steady response to unbalance, its peaks, and its values at critical speeds."""

import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..analysis import (
    HarmonicResponse,
    ResponsePeaks,
    growth_rate,
    response_peaks,
    unbalance_response,
)
from ..core.attributes import about
from ..effects import AbstractContact, Disc
from ..equations.speed_tables import speed_range
from ..files.units import quantity
from ..plot.marks import amplitudes
from ..plot.units import LENGTHS, SPEEDS
from ..scene import Scene
from . import answer
from .axis_units import axis_units
from .linear import growth_at
from .options import (
    AsJson,
    At,
    High,
    Low,
    Out,
    Overwrite,
    Points,
    SceneName,
    Settings,
    operating_speed,
    optional,
    scene_with,
    speeds_between,
)
from .output import draft_or_none, draw, labelled, write_dataset, written_to


_FILES = ("response.zarr", "response.png")
_LONGER = 4  # times that the default range of speeds is made half as long again


def response(
    scene: SceneName,
    settings: Settings = None,
    low: Low = None,
    high: High = None,
    points: Points = 401,
    at: At = None,
    operating: Annotated[
        str | None,
        typer.Option(
            metavar="SPEED[:SPEED]",
            help="Operating speed, or the slowest and the fastest, from which peaks must be separated. "
            "[default: the scene's speed]",
        ),
    ] = None,
    out: Out = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Steady response to unbalance: its peaks, and its values at operating and critical speeds.

    The phase is the lead over the rotation. Contacts are left out: where the amplitude exceeds a
    gap, use `simulate`. Where the rotor is unstable (growth above 0) the response is not attained.
    Amplification factors are those of API RP 684: the speed of a peak over the distance of the speeds
    beside it at which the amplitude is 0.707 of the peak's. So are the margins to the operating speeds.
    Without --to the range is made longer until both of these speeds of the first peak lie in it.
    With --out, DIR/response.zarr and DIR/response.png.

    ```
    jaxrotor response limiter-rotor --set unbalance.eccentricity=0.1mm --to 5000rpm --out run
    ```
    """
    whole = rotor = scene_with(scene, settings)
    station = rotor.stations(optional(at, "m", "--at"))  # of a contact, before it is left out
    contacts = sorted({effect.plural for effect in rotor.of(AbstractContact)})
    for kind in contacts:
        rotor = rotor.without(kind)
    units = axis_units(scene, whole, high, low, operating, *settings or ())
    with draft_or_none(out, _FILES, overwrite) as folder:
        speeds = speeds_between(rotor, low, high, points)
        range_ = _operating(rotor, operating, speeds)
        found = _peaks(rotor, speeds, station, high)
        result, whirls = found.response, found.critical
        if not np.asarray(result.major).any():
            raise ValueError(
                f"The response is zero at that station; give the scene an unbalance, {_added(rotor)}."
            )
        critical = [
            {"kind": kind, **_at(rotor, speed, station)}
            for kind, speed in zip(whirls.kinds, np.asarray(whirls.speeds).tolist(), strict=True)
        ]
        finite = found.speeds[np.isfinite(found.amplitudes)]
        peaks = [_at(rotor, speed, station) for speed in finite.tolist()]
        growth = growth_at(rotor, result.speeds)
        ends = [] if range_ is None else list(dict.fromkeys(range_))
        running = [_at(rotor, one, station) for one in ends if speeds.min() <= one <= speeds.max()]
        if folder is not None:
            data = labelled(_variables(result, growth), "jaxrotor unbalance response", rotor)
            write_dataset(data, folder / "response.zarr", units)
            shown_with = {"growth": growth, "operating": range_}
            _draw(found, whole, shown_with, folder, units)
    largest = max((one["amplitude"] or 0.0 for one in (*running, *peaks, *critical)), default=0.0)
    answer.note_large(largest, float(rotor.shaft.length))
    unstable = float(np.mean(growth > 0))
    if as_json:
        shown = {"station": result.stations[0], "without": contacts, "peaks": peaks}
        shown |= {"margins": _margins(found, range_), "operating": range_}
        shown |= {"at_operating": running, "critical": critical, "unstable_share": unstable}
        answer.print_json({"scene": scene, **shown, "written": written_to(out, _FILES)})
        return
    unit, own = units["speed"], "\N{MICRO SIGN}m" if largest < 1e-4 else "mm"
    length = units["length"] or own
    named = [("operating", one) for one in running] + [("peak", one) for one in peaks]
    named += [(f"critical, {one['kind']}", one) for one in critical]
    rows = [(name, *_row(one, SPEEDS[unit], LENGTHS[length])) for name, one in named]
    heads = ("", f"[{unit}]", f"amplitude [{length}]", "phase [deg]", "growth [1/s]")
    if rows:
        answer.print_table(rows, heads, numbers=[1, 2, 3, 4])
    _print_margins(_margins(found, range_), unit)
    notes = [("station", f"{result.stations[0]:g} m")]
    notes += [("without", ", ".join(contacts))] if contacts else []
    notes += _clearance_note(_nearest(found, whole), found, (LENGTHS[length], length))
    text = lambda own, word: f" {word} ".join(f"{SPEEDS[unit] * one:.6g}" for one in own)
    none = f"none between these speeds, {text((speeds[0], speeds[-1]), 'and')} {unit}"
    notes += [("peak", none)] if not found.speeds.size else []
    notes += [("operating", f"{text(ends, 'to')} {unit}")] if ends else []
    if unstable:
        notes.append(
            ("unstable", f"at {100 * unstable:.3g} % of the speeds, where no response is attained")
        )
    answer.print_table([*notes, *answer.written(written_to(out, _FILES))])


def _peaks(rotor: Scene, speeds: np.ndarray, station: Any, high: str | None) -> ResponsePeaks:
    """Peaks between speeds [rad/s]; without `--to` farther up until the first has both of half power.

    Tables of coefficients over speed set the highest speed themselves.
    """
    found = longer = response_peaks(rotor, speeds, station)
    if high is not None or speed_range(rotor) is not None:
        return found
    for _ in range(_LONGER):
        if not np.isnan(longer.upper[:1]).any():
            return longer
        speeds = np.linspace(speeds[0], 1.5 * speeds[-1], len(speeds))
        longer = response_peaks(rotor, speeds, station)
    return found  # the amplitude does not fall so far


def _added(rotor: Scene) -> str:
    """Advice on how a scene gets an unbalance."""
    paths = [path for path in rotor.paths() if path.endswith("balance.eccentricity")]
    paths += [path for path in rotor.paths() if path.endswith("balances.eccentricity")]
    if paths:
        return f"as in --set {paths[0]}=0.1mm"
    at = next((float(disc.at) for disc in rotor.of(Disc)), float(rotor.shaft.length))
    return f'in its file: [unbalance], at = "{at:g} m", mass = "1 kg", eccentricity = "0.1 mm"'


def _row(one: dict[str, Any], turns: float, factor: float) -> tuple[str, ...]:
    """Speed, amplitude, phase and growth, by the factors from SI of speed, `turns`, and amplitude."""
    speed, growth = f"{turns * one['speed']:.6g}", f"{one['growth']:.4g}"
    if one["amplitude"] is None:
        return (speed, "unbounded", "-", growth)
    return (speed, f"{factor * one['amplitude']:.6g}", f"{math.degrees(one['phase']):.5g}", growth)


def _nearest(found: ResponsePeaks, whole: Scene) -> float | None:
    """Smallest amplitude [m] that reaches a stop at the station of a response, None without one."""
    return min(amplitudes(whole, float(np.asarray(found.response.stations)[0])), default=None)


def _clearance_note(
    clearance: float | None, found: ResponsePeaks, scale: tuple[float, str]
) -> list[tuple[str, str]]:
    """Row of the clearance, and of how far the largest amplitude is from it, in a unit of lengths."""
    if clearance is None:
        return []
    heights = np.asarray(found.response.major)
    largest = float(np.max([*heights[np.isfinite(heights)], *found.amplitudes], initial=0.0))
    text = f"{scale[0] * clearance:.6g} {scale[1]}"
    return [("clearance", f"{text}, {clearance / largest:.3g} times the largest amplitude")]


def _operating(rotor: Scene, text: str | None, speeds: np.ndarray) -> tuple[float, float] | None:
    """Slowest and fastest operating speed [rad/s], by default that of the rotor.

    None if it has none in the sense of any of the speeds.
    """
    if text is None:
        speed = operating_speed(rotor)
        return None if speed is None or not (speed * speeds > 0).any() else (speed, speed)
    ends = [quantity(one, "rad/s", "--operating") for one in text.split(":")]
    if len(ends) > 2 or not 0 < abs(ends[0]) <= abs(ends[-1]) or ends[0] * ends[-1] < 0:
        raise ValueError(
            "--operating must be one speed other than 0, or two of one sense, the slower one first, as "
            f"3000rpm:3600rpm, but is {text!r}."
        )
    return ends[0], ends[-1]


def _margins(found: ResponsePeaks, operating: tuple[float, float] | None) -> list[dict[str, Any]]:
    """Amplification and margin of each peak, None for what is unknown or infinite."""
    columns = {"speed": found.speeds, "lower": found.lower, "upper": found.upper}
    columns["amplification"] = found.amplification
    columns["amplification_at_most"] = found.amplification_at_most
    if operating is not None:
        margins = found.margins(*operating)
        columns |= {"margin": margins.actual, "required": margins.required, "kept": margins.kept}
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    known = lambda value: value if math.isfinite(value) else None
    return [dict(zip(columns, map(known, row), strict=True)) for row in rows]


def _print_margins(rows: list[dict[str, Any]], unit: str) -> None:
    """Table of amplification factors and margins, as standards ask for it, with speeds in `unit`."""
    text = lambda value, digits=6, factor=1.0: (
        "-" if value is None else f"{factor * value:.{digits}g}"
    )
    heads = [f"peak [{unit}]", "half power", "to", "AF"]
    lines = []
    for one in rows:
        sharp = one["lower"] is not None and one["lower"] == one["upper"]  # no damping
        factor = "infinite" if sharp else text(one["amplification"], 4)
        if factor == "-" and one["amplification_at_most"] is not None:
            factor = f"\N{LESS-THAN OR EQUAL TO} {one['amplification_at_most']:.4g}"
        ends = (text(one[name], 6, SPEEDS[unit]) for name in ("speed", "lower", "upper"))
        lines.append([*ends, factor])
        if "margin" in one:
            lines[-1] += [text(one[name], 3, 100) for name in ("margin", "required")]
            lines[-1].append(_verdict(one))
    if lines:
        heads += ["margin [%]", "required", ""][: len(lines[0]) - 4]
        answer.print_table(lines, heads, numbers=[0, 1, 2, 3, 4, 5][: len(lines[0])])


def _verdict(one: dict[str, Any]) -> str:
    """Whether the margin of a peak is as large as required."""
    if one["required"] is None:
        return "unknown"
    return ("kept" if one["kept"] else "too close") if one["required"] else "not needed"


def _at(rotor: Scene, speed: float, station: Any) -> dict[str, Any]:
    """Amplitude [m] and phase [rad] at a speed, None where unbounded, and growth rate [1/s]."""
    growth = float(growth_rate(rotor.at_speed(speed)))
    try:
        found = unbalance_response(rotor, speed, station)
    except ValueError:
        return {"speed": speed, "amplitude": None, "phase": None, "growth": growth}
    phase = float(_lead(found)[0, 0])
    amplitude = float(found.major[0, 0])
    return {"speed": speed, "amplitude": amplitude, "phase": phase, "growth": growth}


def _lead(result: HarmonicResponse) -> np.ndarray:
    """Lead of the forward part over the rotation [rad] (k, s), in the sense of rotation."""
    return np.angle(result.forward) * np.where(np.asarray(result.speeds) < 0, -1, 1)[:, None]


def _variables(
    result: HarmonicResponse, growth: np.ndarray
) -> tuple[dict[str, Any], dict[str, Any]]:
    dims, phase = ("speed", "station"), about("rad", "lead of the forward part over the rotation")
    major, minor = np.asarray(result.major), np.asarray(result.minor)
    return (
        {
            "amplitude": (dims, major, about("m", "major half axis of the synchronous orbit")),
            "minor": (dims, minor, about("m", "minor half axis, negative if backward")),
            "phase": (dims, _lead(result), phase),
            "growth": ("speed", growth, about("1/s", "largest growth rate, positive unstable")),
        },
        {
            "speed": ("speed", np.asarray(result.speeds), about("rad/s", "spin speed")),
            "station": ("station", np.asarray(result.stations), about("m", "station")),
        },
    )


def _draw(
    found: ResponsePeaks, whole: Scene, about: dict[str, Any], folder: Path, units: dict[str, Any]
) -> None:
    from .. import plot

    about = about | {"critical": found.critical, "peaks": found}
    about |= {"clearance": _nearest(found, whole)}

    def both(axes: Any) -> None:
        plot.response(found.response, axes, **about)

    draw(folder / "response.png", both, 170, 110, rows=2, units=units)
