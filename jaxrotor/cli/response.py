"""Command `response`: steady response to unbalance, its peaks, and its values at critical speeds."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any

import jax.numpy as jnp
import numpy as np
import typer

from .. import plot
from ..analysis import (
    HarmonicResponse,
    ResponsePeaks,
    growth_rate,
    response_peaks,
    unbalance_response,
    weight_response,
)
from ..analysis.linearized import BEARINGS
from ..analysis.operating_line import OperatingLine
from ..core.attributes import variable
from ..effects import AbstractContact, Disc
from ..equations.pencil import frame
from ..equations.speed_tables import speed_range
from ..equations.system import structure
from ..files.units import quantity
from ..plot.marks import amplitudes
from ..plot.units import LENGTHS, SPEEDS
from ..scene import Scene
from . import answer, options
from .axis_units import axis_units
from .linear import growth_at, linear_over_speeds
from .output import files_in, labelled


_FILES = ("response.zarr", "response.png")
_LONGER = 4  # times that the default range of speeds is made half as long again


def response(
    scene: options.SceneName,
    settings: options.Settings = None,
    low: options.Low = None,
    high: options.High = None,
    points: options.Points = 401,
    at: options.At = None,
    by: options.By = None,
    operating: Annotated[
        str | None,
        typer.Option(
            metavar="SPEED[:SPEED]",
            help="Operating speed, or the slowest and the fastest, from which peaks must be separated. "
            "[default: the scene's speed]",
        ),
    ] = None,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
) -> None:
    """Steady response to unbalance: its peaks, and its values at operating and critical speeds.

    The phase is the lead over the rotation. Films, seals, rolling and magnetic bearings are linear about
    the static position at each speed. Contacts are left out: where the amplitude exceeds a
    gap, use `simulate`. Where the rotor is unstable (growth above 0) the response is not attained.
    A shaft or a coupling that is stiffer along one axis adds vibration of twice the frequency, 2X,
    which is told at the operating speeds. Amplification factors are those of API RP 684: the speed of
    a peak over the distance of the speeds beside it at which the amplitude is 0.707 of the peak's. So
    are the margins to the operating speeds.
    Without --to the range is made longer until both of these speeds of the first peak lie in it.
    Of several shafts the unbalance of one acts, and the phase is its lead over the rotation of that one;
    speeds are those of the first shaft.
    With --out, DIR/response.zarr and DIR/response.png.

    ```
    jaxrotor response limiter-rotor --set unbalance.eccentricity=0.1mm --to 5000rpm --out run
    jaxrotor response dual-rotor --by hp --at "hp 0.5925 m"
    ```
    """
    whole = rotor = options.scene_with(scene, settings)
    asked = {"by": by, "at": options.place(rotor, at)}
    asked["at"] = options.suggested(rotor) if at is None else asked["at"]  # of a contact, too
    bearing = {effect.plural for kind in BEARINGS for effect in rotor.of(kind)}
    contacts = sorted({effect.plural for effect in rotor.of(AbstractContact)} - bearing)
    for kind in contacts:
        rotor = rotor.without(kind)
    units = axis_units(scene, whole, high, low, operating, *settings or ())
    with files_in(out, _FILES, overwrite, units) as files:
        rotor, speeds = linear_over_speeds(rotor, low, high, points)
        range_ = _operating(rotor, operating, speeds)
        found = _peaks(rotor, speeds, asked, high)
        result, whirls = found.response, found.critical
        _check_moves(found, rotor, by)
        critical = [
            {"kind": kind, **_at(rotor, speed, asked)}
            for kind, speed in zip(whirls.kinds, np.asarray(whirls.speeds).tolist(), strict=True)
        ]
        nearest = _nearest(found, whole, asked["at"])
        finite = found.speeds[np.isfinite(found.amplitudes)]
        peaks = [_at(rotor, speed, asked) for speed in finite.tolist()]
        growth = growth_at(rotor, result.speeds)
        ends = [] if range_ is None else list(dict.fromkeys(range_))
        running = [_at(rotor, one, asked) for one in ends if speeds.min() <= one <= speeds.max()]
        twice = _twice(rotor, [one["speed"] for one in running], asked["at"])
        if out is not None:
            files.data(_dataset(result, growth, rotor))
            marks: dict[str, Any] = {"critical": whirls, "peaks": found}
            marks |= {"clearance": nearest, "growth": growth, "operating": range_}
            curves = partial(plot.response, result, **marks)
            files.picture("response.png", curves, 170, 110, rows=2)
    largest = max((one["amplitude"] or 0.0 for one in (*running, *peaks, *critical)), default=0.0)
    answer.note_large(largest, float(rotor.shaft.length))
    unstable, margins = float(np.mean(growth > 0)), _margins(found, range_)
    facts = {"scene": scene, "station": result.stations[0], "without": contacts, "peaks": peaks}
    facts |= {"margins": margins, "operating": range_, "at_operating": running, "twice": twice}
    facts |= {"critical": critical, "unstable_share": unstable, "written": files.written}
    facts |= {"by": by or rotor.shafts[0], "shaft": asked["at"][0]} if rotor.shafts else {}
    unit, own = units["speed"], "\N{MICRO SIGN}m" if largest < 1e-4 else "mm"
    length = units["length"] or own
    named = [("operating", one) for one in running] + [("peak", one) for one in peaks]
    named += [(f"critical, {one['kind']}", one) for one in critical]
    rows = [(name, *_row(one, SPEEDS[unit], LENGTHS[length])) for name, one in named]
    heads = ("", f"[{unit}]", f"amplitude [{length}]", "phase [deg]", "growth [1/s]")
    heads, rows = _with_all_shafts(rotor, unit, heads, rows, [one["speed"] for _, one in named])
    tables = answer.Table(rows, heads, range(1, len(heads))), _margin_table(margins, unit)
    text = lambda own, word: f" {word} ".join(f"{SPEEDS[unit] * one:.6g}" for one in own)
    none = f"none between these speeds, {text((speeds[0], speeds[-1]), 'and')} {unit}"
    share = f"at {100 * unstable:.3g} % of the speeds, where no response is attained"
    notes = {
        "unbalance of": facts.get("by"),
        "station": f"{facts.get('shaft', '')} {result.stations[0]:g} m".strip(),
        "without": ", ".join(contacts),
        "clearance": _clearance(nearest, found, (LENGTHS[length], length)),
        "peak": "" if found.speeds.size else none,
        "operating": f"{text(ends, 'to')} {unit}" if ends else "",
        "2X there": ", ".join(f"{LENGTHS[length] * one:.6g} {length}" for one in twice),
        "unstable": share if unstable else "",
    }
    answer.give(as_json, facts, *tables, answer.filled(notes) + files.rows)


def _peaks(
    rotor: Scene, speeds: np.ndarray, asked: dict[str, Any], high: str | None
) -> ResponsePeaks:
    """Peaks between speeds [rad/s]; without `--to` farther up until the first has both of half power.

    Tables of coefficients over speed set the highest speed themselves.
    """
    found = longer = response_peaks(rotor, speeds, **asked)
    if high is not None or speed_range(rotor) is not None:
        return found
    for _ in range(_LONGER):
        if not np.isnan(longer.upper[:1]).any():
            return longer
        speeds = np.linspace(speeds[0], 1.5 * speeds[-1], len(speeds))
        longer = response_peaks(rotor, speeds, **asked)
    return found  # the amplitude does not fall so far


def _added(rotor: Scene, by: str | None) -> str:
    """Advice on how a scene, or one of its shafts, gets an unbalance."""
    paths = [path for path in rotor.paths() if path.endswith("balance.eccentricity")]
    paths += [path for path in rotor.paths() if path.endswith("balances.eccentricity")]
    if paths and not rotor.shafts:
        return f"as in --set {paths[0]}=0.1mm"
    shaft = (by or rotor.shafts[0]) if rotor.shafts else None
    at = next((float(d.at) for d in rotor.of(Disc) if d.shaft == shaft), float(rotor.shaft.length))
    place = f"{at:g} m" if shaft is None else f"{shaft} {at:g} m"
    return f'in its file: [unbalance], at = "{place}", mass = "1 kg", eccentricity = "0.1 mm"'


def _with_all_shafts(
    rotor: Scene,
    unit: str,
    heads: tuple[str, ...],
    rows: Sequence[tuple[str, ...]],
    first: list[float],
) -> tuple[tuple[str, ...], Sequence[tuple[str, ...]]]:
    """Heads and rows with the speeds of all shafts, by those of the first one [rad/s], in column 2."""
    line = OperatingLine.of(rotor, None)
    if line is None or not first:
        return heads, rows
    turning = SPEEDS[unit] * np.asarray(line.at(jnp.array(first)))
    texts = [[f"{speed:.6g}" for speed in own] for own in turning.tolist()]
    heads = (heads[0], *(f"{name} [{unit}]" for name in line.shafts), *heads[2:])
    return heads, [(row[0], *own, *row[2:]) for row, own in zip(rows, texts, strict=True)]


def _check_moves(found: ResponsePeaks, rotor: Scene, by: str | None) -> None:
    """Raise if the response is zero."""
    if not np.asarray(found.response.major).any():
        bare = f"the shaft '{by}'" if by else "the scene"
        raise ValueError(
            f"The response is zero at that station; give {bare} an unbalance, {_added(rotor, by)}."
        )


def _row(one: dict[str, Any], turns: float, factor: float) -> tuple[str, ...]:
    """Speed, amplitude, phase and growth, by the factors from SI of speed, `turns`, and amplitude."""
    speed, growth = f"{turns * one['speed']:.6g}", f"{one['growth']:.4g}"
    if one["amplitude"] is None:
        return (speed, "unbounded", "-", growth)
    return (speed, f"{factor * one['amplitude']:.6g}", f"{math.degrees(one['phase']):.5g}", growth)


def _nearest(found: ResponsePeaks, whole: Scene, at: Any) -> float | None:
    """Smallest amplitude [m] that reaches a stop `at` the station of a response, None without one."""
    station, shaft = float(np.asarray(found.response.stations)[0]), at[0] if whole.shafts else None
    return min(amplitudes(whole, station, shaft), default=None)


def _clearance(least: float | None, found: ResponsePeaks, scale: tuple[float, str]) -> str:
    """The clearance in a unit of lengths, and how far the largest amplitude is from it; "" without one."""
    if least is None:
        return ""
    heights = np.asarray(found.response.major)
    largest = float(np.max([*heights[np.isfinite(heights)], *found.amplitudes], initial=0.0))
    factor, unit = scale
    return f"{factor * least:.6g} {unit}, {least / largest:.3g} times the largest amplitude"


def _operating(rotor: Scene, text: str | None, speeds: np.ndarray) -> tuple[float, float] | None:
    """Slowest and fastest operating speed [rad/s], by default that of the rotor.

    None if it has none in the sense of any of the speeds.
    """
    if text is None:
        speed = options.operating_speed(rotor)
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


def _margin_table(margins: list[dict[str, Any]], unit: str) -> answer.Table:
    """Amplification factors and margins, as standards ask for them, with speeds in `unit`."""
    text = lambda value, digits=6, factor=1.0: (
        "-" if value is None else f"{factor * value:.{digits}g}"
    )
    heads = [f"peak [{unit}]", "half power", "to", "AF"]
    rows = []
    for one in margins:
        sharp = one["lower"] is not None and one["lower"] == one["upper"]  # no damping
        factor = "infinite" if sharp else text(one["amplification"], 4)
        if factor == "-" and one["amplification_at_most"] is not None:
            factor = f"\N{LESS-THAN OR EQUAL TO} {one['amplification_at_most']:.4g}"
        ends = (text(one[name], 6, SPEEDS[unit]) for name in ("speed", "lower", "upper"))
        rows.append([*ends, factor])
        if "margin" in one:
            rows[-1] += [text(one[name], 3, 100) for name in ("margin", "required")]
            rows[-1].append(_verdict(one))
    if margins and "margin" in margins[0]:
        heads += ["margin [%]", "required", ""]
    return answer.Table(rows, heads, range(min(len(heads), 6)))


def _verdict(one: dict[str, Any]) -> str:
    """Whether the margin of a peak is as large as required."""
    if one["required"] is None:
        return "unknown"
    return ("kept" if one["kept"] else "too close") if one["required"] else "not needed"


def _at(rotor: Scene, speed: float, asked: dict[str, Any]) -> dict[str, Any]:
    """Amplitude [m] and phase [rad] at a speed, None where unbounded, and growth rate [1/s]."""
    growth = float(growth_rate(rotor.at_speed(speed)))
    try:
        found = unbalance_response(rotor, speed, **asked)
    except ValueError:
        return {"speed": speed, "amplitude": None, "phase": None, "growth": growth}
    phase = float(_lead(found)[0, 0])
    amplitude = float(found.major[0, 0])
    return {"speed": speed, "amplitude": amplitude, "phase": phase, "growth": growth}


def _twice(rotor: Scene, speeds: list[float], station: Any) -> list[float]:
    """Amplitudes [m] at twice the frequency of rotation, by weight or misalignment; none without any."""
    system = structure(rotor)
    if not (speeds and system.load.steady and frame(system.blocks) == "rotating"):
        return []
    return np.abs(weight_response(rotor, speeds, station).twice[:, 0]).tolist()


def _lead(result: HarmonicResponse) -> np.ndarray:
    """Lead of the forward part over the rotation [rad] (k, s), in the sense of rotation."""
    return np.angle(result.forward) * np.where(np.asarray(result.frequencies) < 0, -1, 1)[:, None]


def _dataset(result: HarmonicResponse, growth: np.ndarray, rotor: Scene) -> Any:
    dims, lead = ("speed", "station"), "lead of the forward part over the rotation"
    major = "major half axis of the synchronous orbit"
    columns = {
        "amplitude": variable(dims, result.major, "m", major),
        "minor": variable(dims, result.minor, "m", "minor half axis, negative if backward"),
        "phase": variable(dims, _lead(result), "rad", lead),
        "growth": variable("speed", growth, "1/s", "largest growth rate, positive unstable"),
    }
    coordinates = {
        "speed": variable("speed", result.speeds, "rad/s", "spin speed"),
        "station": variable("station", result.stations, "m", "station"),
    }
    return labelled(columns, coordinates, "jaxrotor unbalance response", rotor)
