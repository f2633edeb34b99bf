"""Lateral report: a lateral analysis as one document with numbered tables and figures."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from ..analysis import StaticPositions
from ..analysis.lateral import HEADS, CaseResponse, LateralAnalysis, SceneAnalysis, verdict
from ..analysis.lateral.unbalance_cases import journal_loads
from ..core.quantities import with_values
from ..core.tables import RPM
from ..effects import Gravity
from ..files.machine import Machine
from ..results.provenance import versions
from .campbell import campbell
from .document import Heading, Part, Paths, Picture, Sentence, Table, write_document
from .lateral import critical_map, deflected_shapes, level_one
from .modes import mode_shapes
from .response import response
from .rotor import rotor
from .units import units


_STANDARD = "API RP 684, 2nd edition (2005), standard paragraphs SP6.8.2 and SP6.8.5"
_UM = 1e6


def lateral_report(result: LateralAnalysis, paths: Paths, title: str = "Lateral analysis") -> None:
    """Write a lateral analysis to .html, .pdf or both: criteria, machine, and answers of every scene.

    Tables and figures are numbered. An existing file is replaced once the new one is complete.

    Args:
        result: result of `jaxrotor.lateral_analysis`.
        paths: the file, or several of the same content; .pdf needs `pip install 'jaxrotor[pdf]'`.
        title: heading of the report.

    Raises:
        ValueError: an ending is another one, or the package for PDF is not installed.
    """
    with units(speed="rpm"):
        write_document(paths, title, list(_parts(result)))


def _parts(result: LateralAnalysis) -> Iterator[Part]:
    machine, failed = result.machine, [one for one in result.criteria if not one.passed]
    word = (
        "All demands are met."
        if not failed
        else f"Demands that are not met: {len(failed)} of {len(result.criteria)}."
    )
    yield Heading("Summary")
    yield Sentence(f"{word} Numbers of paragraphs are those of {_STANDARD}.")
    if len(result.scenes) == 1:
        yield Sentence(
            "One clearance of the bearings was analysed; the standard asks for the smallest and "
            "the largest."
        )
    rows = [one.texts for one in result.summary]
    what = "Demands that are not met, and of each paragraph that is met the one with the least room"
    yield Table(what, HEADS, rows, (3, 4))
    yield Heading("Machine")
    yield from _machine(machine)
    for name, part in result.scenes.items():
        yield from _scene(name, part, result)
    yield Heading("Versions")
    yield Sentence(versions())
    yield Heading("Appendix: all demands")
    rows = [one.texts for one in result.criteria]
    yield Table("Demands of the standard", HEADS, rows, (3, 4))


def _machine(machine: Machine) -> Iterator[Part]:
    taken = "" if machine.rated is not None else ", taken as the maximum continuous speed"
    speeds = {
        "minimum operating speed": machine.slowest,
        f"rated speed{taken}": machine.rated_speed,
        "maximum continuous speed": machine.fastest,
        "trip speed": machine.highest,
    }
    rows = [(name, f"{RPM * float(speed):.5g}", "rpm") for name, speed in speeds.items()]
    if machine.gas_density is not None:
        rows.append(("mean gas density", f"{float(machine.gas_density):.4g}", "kg/m^3"))
    yield Table("Speeds and gas", ("quantity", "value", "unit"), rows, (1,))
    places = [(one.label, "probe", f"{float(one.at):.4g}", "") for one in machine.probes]
    places += [
        (one.label, "close clearance", f"{float(one.at):.4g}", f"{_UM * float(one.diametral):.4g}")
        for one in machine.clearances
    ]
    yield Table(
        "Probes and close clearances", ("name", "kind", "at [m]", "diametral [um]"), places, (2, 3)
    )
    if machine.stages:
        rows = [
            (
                one.label,
                one.kind,
                f"{1e-3 * float(one.power):.5g}",
                f"{1e3 * float(one.diameter):.4g}",
                f"{1e3 * float(one.width):.4g}",
                "" if one.density_ratio is None else f"{float(one.density_ratio):.4g}",
                f"{1e-6 * own:.4g}",
            )
            for one, own in zip(machine.stages, machine.cross_couplings, strict=True)
        ]
        heads = (
            "stage",
            "kind",
            "power [kW]",
            "diameter [mm]",
            "width [mm]",
            "density ratio",
            "q [MN/m]",
        )
        total = f"sum {1e-6 * machine.anticipated:.4g} MN/m"
        caption = f"Anticipated cross coupling at the rated speed, {total} (SP6.8.5.6)"
        yield Table(caption, heads, rows, range(2, 7))


def _scene(name: str, part: SceneAnalysis, result: LateralAnalysis) -> Iterator[Part]:
    machine = result.machine
    sense = float(part.scene.spin.sense)
    operating = sense * float(machine.slowest), sense * float(machine.fastest)
    yield Heading(f"Rotor, {name}")
    if part.scene.assumption:
        yield Sentence(f"Assumption: {part.scene.assumption}.")
    plain = with_values(part.scene, assumption="")
    yield Picture("the rotor, to scale", partial(rotor, plain), height=48)
    low, high = (RPM * one for one in part.speeds)
    yield Sentence(
        f"The rotor weighs {sum(journal_loads(part.scene, part.bearings)):.4g} kg. The response is "
        f"computed from {low:.0f} to {high:.0f} rpm."
    )
    yield from _bearings(part, machine)
    yield from _modes(part, operating)
    yield _cases(part, machine)
    for case in part.cases:
        yield from _responses(case, machine, operating)
    yield _peaks(result.margins(name))
    if machine.clearances:
        yield _clearances(part, machine)
    yield from _stability(part, machine)


def _bearings(part: SceneAnalysis, machine: Machine) -> Iterator[Part]:
    """Loads, films and coefficients."""
    weight = float(Gravity().acceleration)
    loads = zip(part.bearings.tolist(), journal_loads(part.scene, part.bearings), strict=True)
    rows = [(f"{at:.4g}", f"{mass:.4g}", f"{weight * mass:.4g}") for at, mass in loads]
    heads = ("bearing at [m]", "mass [kg]", "load [N]")
    yield Table("Static loads of the bearings, by weight", heads, rows, (0, 1, 2))
    if part.statics is not None:
        yield _films(part.statics)
    if part.reduced:
        yield Sentence(
            "Coefficients of bearings over the frequency of whirl are reduced to those of synchronous "
            "whirl here and in all of the analysis, Level I included. The largest growth rate alone is "
            "that of whirls with the coefficients at their own frequencies."
        )
    names = ("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy")
    rows = [
        (f"{row['at']:.4g}", f"{RPM * row['speed']:.0f}", *(f"{1e-6 * row[k]:.4g}" for k in names))
        for row in part.coefficients(machine)
    ]
    heads = ("at [m]", "speed [rpm]", *names)
    yield Table(
        "Coefficients of the bearings, k [MN/m] and c [MN s/m]", heads, rows, range(len(heads))
    )


def _films(statics: StaticPositions) -> Table:
    numbers = zip(
        np.asarray(statics.speeds),
        np.abs(statics.load),
        np.asarray(statics.eccentricity),
        np.degrees(statics.attitude),
        strict=True,
    )
    rows = [
        (film, f"{RPM * abs(speed):.0f}", f"{load:.4g}", f"{ratio:.3f}", f"{angle:.1f}")
        for speed, *columns in numbers
        for film, load, ratio, angle in zip(statics.films, *columns, strict=True)
    ]
    heads = ("film", "speed [rpm]", "load [N]", "eccentricity / clearance", "attitude angle [deg]")
    return Table("Static positions in the films", heads, rows, (1, 2, 3, 4))


def _modes(part: SceneAnalysis, operating: tuple[float, float]) -> Iterator[Part]:
    """Critical speed map, Campbell diagram, undamped and damped shapes."""
    drawn = partial(critical_map, part.map, operating=operating)
    yield Picture(
        "undamped critical speed map, with the stiffness of the bearings", drawn, height=95
    )
    rigid = [f"{RPM * one:.0f}" for one in part.map.rigid if np.isfinite(one)]
    if rigid:
        yield Sentence(f"On rigid bearings the critical speeds are {', '.join(rigid)} rpm.")
    shapes = "mode shapes of the undamped rotor at its critical speeds, which place the unbalance"
    yield Picture(shapes, partial(mode_shapes, part.undamped), height=75)
    diagram = partial(
        campbell,
        part.campbell,
        critical=part.critical,
        operating=operating,
        highest=1.1 * part.speeds[1],
    )
    yield Picture("Campbell diagram with the running range", diagram, height=120, rows=2)
    if part.modes.values.size:
        yield Picture(
            "damped mode shapes at the maximum continuous speed, of frequencies up to 1.25 times that or "
            "to the trip speed; the dotted parts are 90 degrees ahead",
            partial(mode_shapes, part.modes),
            height=90,
        )


def _peaks(margins: list[dict[str, Any]]) -> Table:
    rows = [
        (
            row["case"],
            row["probe"],
            f"{RPM * abs(row['speed']):.0f}",
            f"{_UM * row['amplitude']:.3g}",
            f"{row['amplification']:.3g}",
            f"{100 * row['margin']:.3g}",
            f"{100 * row['required']:.3g}",
            verdict(row["kept"]),
        )
        for row in margins
    ]
    heads = (
        "case",
        "probe",
        "peak [rpm]",
        "p-p [um]",
        "AF",
        "margin [%]",
        "required [%]",
        "verdict",
    )
    return Table(
        "Peaks: amplification and separation margins (SP6.8.2.10)", heads, rows, range(2, 7)
    )


def _stability(part: SceneAnalysis, machine: Machine) -> Iterator[Part]:
    own = part.stability
    if machine.stages and not (own.above_rigid or part.fixed_pads):
        yield Sentence(
            "The rotor runs below its first critical speed on rigid bearings, so the standard asks for no "
            "Level I analysis; it is shown and not judged."
        )
    yield Picture(
        "Level I stability at the maximum continuous speed",
        partial(level_one, own),
        height=75,
        columns=2,
    )
    reached = (
        f"Q0 is {1e-6 * own.threshold:.4g} MN/m"
        if np.isfinite(own.threshold)
        else "No Q0 was found"
    )
    own_coefficients = (
        "synchronously reduced coefficients"
        if part.reduced
        else "coefficients that do not depend on the frequency of whirl"
    )
    yield Sentence(
        f"{reached}, Q0 / QA {own.ratio:.3g}, the logarithmic decrement at QA {own.decrement:.3g}, its "
        f"whirl frequency {RPM * own.frequency:.0f} cycles a minute, the critical speed ratio "
        f"{own.critical_ratio:.3g}. QA is that of the rated speed, {RPM * machine.rated_speed:.5g} rpm. "
        f"The bearings have {own_coefficients}."
    )


def _cases(part: SceneAnalysis, machine: Machine) -> Table:
    rows = []
    for one in part.cases:
        own = one.case
        placed = "-" if np.isnan(own.critical) else f"{RPM * abs(own.critical):.0f}"
        where = ", ".join(f"{at:.4g}" for at in own.stations)
        masses = ", ".join(f"{mass:.4g}" for mass in own.masses)
        moments = ", ".join(f"{_UM * moment:.4g}" for moment in own.moments)
        rows.append((own.name, placed, where, masses, moments))
    heads = ("case", "of critical speed [rpm]", "at [m]", "W [kg]", "2 Ur [g mm]")
    return Table(
        "Unbalance cases; the second of two is opposite (SP6.8.2.7)", heads, rows, range(1, 5)
    )


def _responses(
    case: CaseResponse, machine: Machine, operating: tuple[float, float]
) -> Iterator[Part]:
    name = case.case.name
    for number, (probe, peaks) in enumerate(zip(machine.probes, case.peaks, strict=True)):
        marks = {"station": number, "peaks": peaks, "operating": operating, "limit": case.limit}
        where = f"response at {probe.label} to the unbalance case {name}"
        caption = f"{where}; the limit A_vl is {_UM * case.limit:.3g} um"
        yield Picture(caption, partial(response, case.response, **marks), height=80, rows=2)
    caption = (
        f"deflected rotor of the unbalance case {name}, scaled by {case.scale:.3g} as for the close "
        "clearances; dashed beyond the trip speed"
    )
    drawn = partial(deflected_shapes, case, clearances=machine.clearances)
    yield Picture(caption, drawn, height=65)


def _clearances(part: SceneAnalysis, machine: Machine) -> Table:
    rows = [
        (
            row["case"],
            row["clearance"],
            f"{row['scale']:.3g}",
            f"{_UM * row['scaled']:.4g}",
            f"{_UM * row['limit']:.4g}",
            verdict(row["kept"]),
        )
        for row in part.clearances(machine)
    ]
    heads = ("case", "clearance", "scale", "scaled p-p [um]", "75 % of it [um]", "verdict")
    return Table(
        "Close clearances up to trip speed (SP6.8.2.12, SP6.8.2.13)", heads, rows, (2, 3, 4)
    )
