"""Lateral report: a lateral analysis as one document with numbered tables and figures."""

import os
from collections.abc import Iterator
from functools import partial

import numpy as np

from ..analysis.lateral import HEADS, CaseResponse, LateralAnalysis, SceneAnalysis, verdict
from ..analysis.lateral.damped_response import SHARE
from ..analysis.lateral.unbalance_cases import journal_loads
from ..core.quantities import with_values
from ..core.tables import RPM
from ..files.machine import Machine
from ..results.provenance import versions
from .campbell import campbell
from .document import Heading, Part, Picture, Sentence, Table, write_document
from .lateral import critical_map, level_one
from .response import response
from .rotor import rotor
from .units import units


_STANDARD = "API RP 684, 2nd edition (2005), standard paragraphs SP6.8.2 and SP6.8.5"
_UM = 1e6


def lateral_report(
    result: LateralAnalysis, path: str | os.PathLike[str], title: str = "Lateral analysis"
) -> None:
    """Write a lateral analysis to .html or .pdf: criteria, machine, and answers of every scene.

    Tables and figures are numbered. An existing file is replaced once the new one is complete.

    Args:
        result: result of `jaxrotor.lateral_analysis`.
        path: the file; .pdf needs `pip install 'jaxrotor[pdf]'`.
        title: heading of the report.

    Raises:
        ValueError: the ending is another one, or the package for PDF is not installed.
    """
    with units(speed="rpm"):
        write_document(path, title, list(_parts(result)))


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
    rows = [one.texts for one in result.criteria]
    yield Table("Criteria of the standard", HEADS, rows, (3, 4))
    yield Heading("Machine")
    yield from _machine(machine)
    for name, part in result.scenes.items():
        yield from _scene(name, part, result)
    yield Heading("Versions")
    yield Sentence(versions())


def _machine(machine: Machine) -> Iterator[Part]:
    speeds = {
        "minimum operating speed": machine.slowest,
        "maximum continuous speed": machine.fastest,
        "trip speed": machine.highest,
    }
    rows = [(name, f"{RPM * float(speed):.5g}", "rpm") for name, speed in speeds.items()]
    if machine.gas_density is not None:
        rows.append(("mean gas density", f"{float(machine.gas_density):.4g}", "kg/m^3"))
    yield Table("Speeds", ("", "", "unit"), rows, (1,))
    places = [(one.label, "probe", f"{float(one.at):.4g}", "") for one in machine.probes]
    places += [
        (one.label, "close clearance", f"{float(one.at):.4g}", f"{_UM * float(one.diametral):.4g}")
        for one in machine.clearances
    ]
    yield Table(
        "Probes and close clearances", ("name", "", "at [m]", "diametral [um]"), places, (2, 3)
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
                f"{1e-6 * one.cross_coupling(float(machine.fastest)):.4g}",
            )
            for one in machine.stages
        ]
        heads = (
            "stage",
            "",
            "power [kW]",
            "diameter [mm]",
            "width [mm]",
            "density ratio",
            "q [MN/m]",
        )
        total = f"sum {1e-6 * machine.anticipated:.4g} MN/m"
        yield Table(f"Anticipated cross coupling, {total} (SP6.8.5.6)", heads, rows, range(2, 7))


def _scene(name: str, part: SceneAnalysis, result: LateralAnalysis) -> Iterator[Part]:
    machine = result.machine
    running = float(machine.slowest), float(machine.fastest)
    sense = float(part.scene.spin.sense)
    operating = sense * running[0], sense * running[1]
    yield Heading(f"Rotor, {name}")
    if part.scene.assumption:
        yield Sentence(f"Assumption: {part.scene.assumption}.")
    plain = with_values(part.scene, assumption="")
    yield Picture("the rotor, to scale", partial(rotor, plain), height=70)
    loads = journal_loads(part.scene, part.bearings)
    at = ", ".join(
        f"{load:.4g} kg at {z:.4g} m" for load, z in zip(loads, part.bearings, strict=True)
    )
    low, high = (RPM * one for one in part.speeds)
    yield Sentence(
        f"The rotor weighs {sum(loads):.4g} kg; its bearings carry {at}. The response is computed from "
        f"{low:.0f} to {high:.0f} rpm."
    )
    drawn = partial(critical_map, part.map, operating=running)
    yield Picture(
        "undamped critical speed map, with the stiffness of the bearings", drawn, height=95
    )
    rigid = ", ".join(f"{RPM * one:.0f}" for one in part.map.rigid if np.isfinite(one))
    yield Sentence(f"On rigid bearings the critical speeds are {rigid} rpm.")
    diagram = partial(campbell, part.campbell, critical=part.critical, operating=operating)
    yield Picture("Campbell diagram with the running range", diagram, height=120, rows=2)
    yield _cases(part, machine)
    for case in part.cases:
        yield from _responses(case, machine, operating)
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
        for row in result.margins(name)
    ]
    heads = ("case", "probe", "peak [rpm]", "p-p [um]", "AF", "margin [%]", "required [%]", "")
    yield Table(
        "Peaks: amplification and separation margins (SP6.8.2.10)", heads, rows, range(2, 7)
    )
    if machine.clearances:
        yield _clearances(part, machine)
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
    yield Sentence(
        f"{reached}, Q0 / QA {own.ratio:.3g}, the logarithmic decrement at QA {own.decrement:.3g}, its "
        f"whirl frequency {RPM * own.frequency:.0f} cycles a minute, the critical speed ratio "
        f"{own.critical_ratio:.3g}."
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
    for number, (probe, peaks) in enumerate(zip(machine.probes, case.peaks, strict=True)):
        marks = {"station": number, "peaks": peaks, "operating": operating}
        where = f"response at {probe.label} to the unbalance case {case.case.name}"
        caption = f"{where}, half axes, not peak to peak"
        yield Picture(caption, partial(response, case.response, **marks), height=95, rows=2)


def _clearances(part: SceneAnalysis, machine: Machine) -> Table:
    rows = [
        (
            case.case.name,
            clearance.label,
            f"{case.scale:.3g}",
            f"{_UM * used:.4g}",
            f"{_UM * SHARE * float(clearance.diametral):.4g}",
            verdict(bool(used < SHARE * clearance.diametral)),
        )
        for case in part.cases
        for clearance, used in zip(machine.clearances, case.scaled.tolist(), strict=True)
    ]
    heads = ("case", "clearance", "scale", "scaled p-p [um]", "75 % of it [um]", "")
    return Table(
        "Close clearances up to trip speed (SP6.8.2.12, SP6.8.2.13)", heads, rows, (2, 3, 4)
    )
