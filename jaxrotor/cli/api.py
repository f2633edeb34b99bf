"""Command `api`: lateral analysis of a machine with pass or fail, and its report."""

import json
from pathlib import Path
from typing import Annotated

import typer

from ..analysis.lateral import HEADS, ONLY, LateralAnalysis, lateral_analysis
from ..files.machine import machine
from ..files.toml import title
from ..plot.document import NO_PDF, writes_pdf
from ..plot.lateral_report import lateral_report
from ..scene import Scene
from . import answer, options
from .output import draft, written_to


_FILES = ("lateral.html", "lateral.pdf", "lateral.json")
NAMES = "smallest clearance", "largest clearance"


def api(
    scene: options.SceneName,
    largest: Annotated[
        str | None,
        typer.Argument(
            metavar="LARGEST",
            help="The same rotor in bearings of the largest clearance; SCENE has the smallest one.",
        ),
    ] = None,
    settings: options.Settings = None,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
) -> None:
    """Lateral analysis in the style of API 617 and API RP 684, with pass or fail of each demand.

    The machine around the rotor is the table [machine] of SCENE: its running range, probes, close
    clearances and stages. Undamped critical speed map, Campbell diagram, damped response to the unbalance
    cases that the standard places by mode shape, separation margins, clearances, Level I stability.
    With --out, DIR/lateral.html, DIR/lateral.json, and where fpdf2 is installed DIR/lateral.pdf. Printed
    are the demands that are not met, and of each paragraph that is met the one with the least room; the
    report and --json have all.

    jaxrotor api compressor --out runs/api
    """
    names = [scene] if largest is None else [scene, largest]
    rotors = [options.scene_with(name, settings) for name in names]
    scenes: dict[str, Scene] = dict(zip((ONLY,) if largest is None else NAMES, rotors, strict=True))
    found = lateral_analysis(scenes, machine(scene))
    files: list[str] = []
    if out is not None:
        own = title(scene) if largest is None else " and ".join(names)
        head = f"Lateral analysis: {found.machine.name or own or scene}"
        with draft(out, _FILES, overwrite) as folder:
            _write(found, folder, head)
        files = written_to(out, _FILES)
    met = [one.passed for one in found.criteria]
    rows = [one.texts for one in found.summary]
    notes = {"demands": f"{sum(met)} of {len(met)} are met"}
    tables = answer.Table(rows, HEADS, (3, 4)), answer.filled(notes) + answer.written(files)
    answer.give(as_json, found.data() | {"written": files}, *tables)


def _write(found: LateralAnalysis, folder: Path, head: str) -> None:
    (folder / "lateral.json").write_text(json.dumps(found.data(), indent=1), "utf-8")
    if not writes_pdf():
        answer.note(NO_PDF)
    endings = ("html", "pdf") if writes_pdf() else ("html",)
    lateral_report(found, [folder / f"lateral.{ending}" for ending in endings], head)
