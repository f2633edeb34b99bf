"""Command `show`: contents and linear properties of a scene."""

import tomllib
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any, Literal

import jax
import numpy as np
import typer

from ..analysis import Onset, onset_speed
from ..analysis.linearized import check_linear
from ..analysis.modal import KINDS
from ..analysis.resolved import resolved
from ..analysis.static_instability import static_instability
from ..core.parallel import in_threads
from ..effects.places import of_first_order
from ..equations.rigid_motions import CURE, unheld
from ..equations.system import assemble, structure
from ..files.several_shafts import SHAFTS
from ..files.shipped import source
from ..files.toml import dumps, title
from ..plot.units import SPEEDS
from ..results.provenance import assumed
from ..scene import Scene
from . import answer, options
from .axis_units import angle_unit, axis_units, written_in
from .campbell import described_critical, end_of_search, speeds_of_shafts
from .linear import described_onset, described_roots, linear_at_speed
from .output import files_in


_FILES = ("rotor.png",)
SAME = 1e-6  # relative difference below which two frequencies are shown as one
_CONDENSED = ": modes of the shaft, and its deflections by loads where parts are"
_SHOWN = 3  # number of whirl frequencies shown of each kind


def show(
    scene: options.SceneName,
    settings: options.Settings = None,
    row: options.Row = None,
    layout: options.Layout = None,
    toml: Annotated[
        bool, typer.Option("--toml", help="Print the scene file itself, to start a new one from.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for a drawing of the rotor.")
    ] = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
) -> None:
    """Show a scene: its parameters, whirl frequencies, critical speeds and onset of instability.

    The paths in the first column are those of `--set` and `--over`. Speeds and small lengths are in the
    units that the scene file has most often; a number without unit in `--set` is in SI. --json lists
    absent parameters too. With --out, DIR/rotor.png: shaft, discs, supports and stops to scale.

    ```
    jaxrotor show limiter-rotor
    jaxrotor show limiter-rotor --out run
    jaxrotor show limiter-rotor --toml > my-rotor.toml
    jaxrotor show limiter-rotor --set disc.mass=3kg --set "limiters.0.gap=5 mm"
    ```
    """
    rotor, name = options.scene_of(scene, settings, row, layout), title(scene, row, layout)
    if toml:
        unchanged = not settings and row is None
        typer.echo(source(scene) if unchanged else dumps(rotor, name), nl=False)
        return
    with files_in(out, _FILES, overwrite, {}) as files:
        if out is not None:
            from ..plot.rotor import fit, rotor as drawn

            files.picture("rotor.png", lambda ax: fit(drawn(rotor, ax)), 170, 75)
    parameters = {path: _parameter(rotor, path) for path in rotor.paths()}
    nodes = getattr(rotor.shaft, "nodes", None)
    linear = _or_why(lambda: linear_at_speed(rotor))[0] or rotor
    refused, coordinates, (axes, found, still), (critical, no_critical), (onset, why) = _linear(
        rotor, linear
    )
    whirl = {kind: _whirl(found, kind) for kind in KINDS}
    end = end_of_search(rotor, critical, _SHOWN) if critical else ""
    others = {name: _critical(linear, name) for name in rotor.shafts[1:]}
    notes = _notes(scene, linear)
    onset = onset if onset is None else described_onset(onset, axes)
    why = why.partition(";")[0]  # its advice is for Python
    facts = {
        "scene": scene,
        "title": name,
        **assumed(rotor),
        "parameters": parameters,
        **notes,
        **speeds_of_shafts(rotor),
        "nodes": None if nodes is None else list(rotor.resolution),
        "coordinates": coordinates,
        "whirl_frequencies": {"standstill": still, **whirl},
        "critical_speeds": critical,
        "no_critical_speeds": no_critical or None,
        **({"critical_speeds_by": {k: one for k, (one, _) in others.items()}} if others else {}),
        "onset": onset,
        "no_onset": why or None,
        "written": files.written,
    }
    given = {path: one for path, one in parameters.items() if one["value"] is not None}
    absent = given != parameters
    units, angles = axis_units(scene, rotor, *settings or ()), angle_unit(scene, *settings or ())
    values = [(path, *_typed(one, units, angles, rotor)) for path, one in given.items()]
    turning = speeds_of_shafts(rotor).get("shaft_speeds", {})
    rate, spans = units["speed"], ", ".join(map(str, rotor.resolution))
    speeds = lambda found: f"{_text(_scaled(found, SPEEDS[rate]))} {rate}"
    table = answer.Table(values, ("parameter", "value", "unit"), [1])
    rows = answer.filled(
        {
            "note": rotor.assumption,
            "absent": absent and "parameters without a value; --json lists them",
            **_note_texts(**notes),
            "nodes of each span": nodes and f"{spans} (shaft.nodes = {nodes})",
            "coordinates": f"{coordinates}, complex x + iy" + _CONDENSED * bool(rotor.condensed),
            "whirl at standstill": still is not None and speeds(still),
            **{f"{kind}, at speed": speeds(own) for kind, own in whirl.items() if own},
            **{f"speed of {name}": speeds([one]) for name, one in turning.items()},
        }
    )
    instead = _why_not_critical(scene, linear is not rotor and linear, no_critical)
    rows += _critical_rows(critical, instead, rate, rotor.shafts[:1])
    rows += [row for k, one in others.items() for row in _critical_rows(*one, rate, [k])]
    lost = f"at {speeds(onset['speed'])}" if onset else not refused and why
    rows += answer.filled({"critical": end, "loses stability": lost})
    answer.give(as_json, facts, table, rows + files.rows)


def _why_not_critical(scene: str, linear: Scene | Literal[False], why: str) -> str:
    """Why there are no critical speeds, and what answers where a scene is `linear` at rest."""
    why, answers = why.partition("; give")[0], []
    if linear:
        answers = [f"`jaxrotor campbell {scene}` has whirl over the speed"]
    if linear and not of_first_order(linear.effects):
        answers.insert(0, f"`jaxrotor critical {scene}` has them there")
    return "; ".join([why, *filter(None, [", ".join(answers)])])


def _linear(rotor: Scene, linear: Scene) -> tuple[str, int, Any, Any, Any]:
    """Why linear analyses refuse a scene, its coordinates, whirl, critical speeds and onset.

    `linear` is the scene about its static position.
    """
    _, refused = _or_why(lambda: check_linear(rotor))
    if refused:  # what depends on the static position is known at one speed alone
        found, _ = _or_why(lambda: described_roots(linear))
        whirling = *(found or ("fixed", [])), None
        return refused, structure(rotor).n, whirling, (None, refused), (None, refused)
    finer = resolved(rotor, 2 * _SHOWN)
    coordinates = assemble(finer).n  # compiled before the threads, which all need it
    if finer.resolution != rotor.resolution:
        coordinates = structure(rotor).n
    questions = _whirling, _critical, _onset
    return "", coordinates, *in_threads(lambda question: question(finer), questions)


def _notes(scene: str, rotor: Scene) -> dict[str, str | None]:
    """Free motions, static instability and a material that the file does not name."""
    return {
        "free": unheld(rotor) or None,
        "statically_unstable": static_instability(rotor) or None,
        "material_taken": _material_taken(scene),
    }


def _material_taken(scene: str) -> str | None:
    """Name of the material that is taken where the file of a scene names none for its shaft."""
    document = tomllib.loads(source(scene))
    tables = [document["shaft"]] if "shaft" in document else document[SHAFTS].values()
    asked = (one for one in tables if one.get("model", "flexible") == "flexible")
    return "steel" if any({"material", "table"}.isdisjoint(one) for one in asked) else None


def _note_texts(
    free: str | None, statically_unstable: str | None, material_taken: str | None
) -> dict[str, str | None]:
    """Texts of what holds the rotor, or does not, and of the material that the file leaves out."""
    held = free and f"free: {free}; {CURE}"
    taken = material_taken and f"{material_taken}, since the file names none"
    return {"held": held, "statically unstable": statically_unstable, "material": taken}


def _or_why(find: Callable[[], Any]) -> tuple[Any, str]:
    """The result, or None and the reason why there is none."""
    try:
        return find(), ""
    except ValueError as error:
        return None, str(error)


def _critical_rows(
    critical: dict[str, list[float]] | None, why: str, rate: str, by: Sequence[str]
) -> answer.Rows:
    """Critical speeds in the unit that was typed, and in rpm, of several shafts `by` one of them."""
    of = f" by {by[0]}" if by else ""
    if critical is None:
        return [(f"critical speeds{of}", why.partition("; give")[0])]
    rows = []
    for way, speeds in critical.items():
        names = [f"critical{of}, {way}", ""] if speeds else []
        for name, unit in zip(names, dict.fromkeys((rate, "rpm")), strict=False):
            rows.append((name, f"{_text(_scaled(speeds, SPEEDS[unit]))} {unit}"))
    return rows


def _typed(
    parameter: dict[str, Any], units: dict[str, Any], angles: tuple[float, str], rotor: Scene
) -> tuple[str, str]:
    """Text of a parameter and its unit, that of the typed speeds, small lengths and angles."""
    value, unit = parameter["value"], parameter["unit"]
    numbers = [one for one in jax.tree.leaves(value) if one is not None]
    factor, shown = angles if unit == "rad" else written_in(units, unit, numbers, rotor)
    taken = f", = {parameter['taken']}" if "taken" in parameter else ""
    return _text(_scaled(value, factor)), shown + taken


def _scaled(value: Any, factor: float) -> Any:
    """A number, or lists of numbers and None, times a factor."""
    return value if factor == 1 else jax.tree.map(lambda one: factor * one, value)


def _parameter(scene: Scene, path: str) -> dict[str, Any]:
    """Value at a path, or those of several effects, unit, and how a value is taken that is not given."""
    leaves, formula = scene.values(path)
    values = [None if leaf is None else np.asarray(leaf).tolist() for leaf in leaves]
    value = values if len(values) > 1 else values[0]
    value = None if all(one is None for one in values) else value
    taken = {"taken": formula} if formula else {}
    return {"value": value, "unit": scene.unit(path), **taken}


def _still(found: list[dict[str, Any]]) -> list[float]:
    """First whirl frequencies at rest [rad/s], where whirl has no direction."""
    values = sorted(root["frequency"] for root in found if root["frequency"])
    ends = zip([0.0, *values], values, strict=False)
    return [value for last, value in ends if value > last * (1 + SAME)][:_SHOWN]


def _critical(rotor: Scene, by: str | None = None) -> tuple[dict[str, list[float]] | None, str]:
    """Critical speeds, or why there are none."""
    return _or_why(lambda: described_critical(rotor, _SHOWN, by))


def _onset(rotor: Scene) -> tuple[Onset | None, str]:
    """Onset of instability, or why there is none."""
    return _or_why(lambda: jax.block_until_ready(onset_speed(rotor)))


def _whirling(rotor: Scene) -> tuple[str, list[dict[str, Any]], list[float] | None]:
    """Axes, roots at the speed, and whirl frequencies at standstill where the rotor has any."""
    axes, found = described_roots(rotor)
    return axes, found, _or_why(lambda: _still(described_roots(rotor.at_speed(0.0))[1]))[0]


def _whirl(found: list[dict[str, Any]], direction: str) -> list[float]:
    """First whirl frequencies of one direction [rad/s], in fixed axes."""
    moving = [r for r in found if r["frequency"] and r.get("shaft_frequency", 1.0)]
    return [r["frequency"] for r in moving if r["direction"] == direction][:_SHOWN]


def _text(value: Any) -> str:
    if value is None:  # absent from one of several effects
        return "-"
    if isinstance(value, list):
        texts = [f"[{_text(one)}]" if isinstance(one, list) else _text(one) for one in value]
        if len(texts) > 1 and len(set(texts)) == 1:
            return f"{texts[0]} each"
        runs = [(text, len(list(run))) for text, run in groupby(texts)]
        return ", ".join(
            f"{count} times {text}" if count > 1 and text[0] == "[" else ", ".join([text] * count)
            for text, count in runs
        )
    return f"{value:.7g}"
