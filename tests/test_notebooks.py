"""Notebooks: each runs from top to bottom, draws its figures, and finds the numbers it shows."""

import math
import re

import nbformat
import pytest
from executed import DRAWS, NOTEBOOKS, check_found, check_runs, code_cells, executed, pictures


STRAY = re.compile(
    r"<Axes|<matplotlib|Text\(|^\s*\{\s*\""
)  # what no reader wants: objects and JSON

# Notebook -> number in its dictionary `found` -> (value, tolerance). The values are those of
# the source's independent computation; tolerances cover 512 steps a revolution (07: 64) and short runs.
# Those of 06 are in `tests/design/test_designs.py`.
FOUND = {
    "01_limiter_rotor": {
        "kappa": (849.94257, 1e-4),
        "onset N, right sign": (13.9041251, 1e-6),
        "onset whirl, right sign": (1.7323570, 1e-6),
        "onset N, reversed sign, continuous": (14.2586142, 1e-6),
        "onset whirl, reversed sign, continuous": (1.4602310, 1e-6),
        "a', sign of 2023": (-0.024, 1e-3),
        "b', sign of 2023": (1.58, 5e-3),
        "forward index, sign of 2023": (0.097, 3e-3),
        "rub, sign of 2023": (-0.931369, 1e-4),
        "rub peak per T*, sign of 2023": (6.6686, 7e-3),
        "rub, reversed sign, continuous": (-0.918395, 1e-4),
        "rub, right sign": (-0.567622, 1e-4),
        "rub radius max, right sign": (0.0145980, 5e-6),
        "rub at eps 0.00082, right sign": (-0.5, 1e-4),
        "whip, right sign": (-1.5130, 5e-4),
    },
    "02_two_stiffnesses": {
        "nu0 at alpha 0.1": (-0.887174264961, 1e-9),
        "nu0 at alpha 0.5": (-0.566190378969, 1e-9),
        "nu0 at alpha 1": (-0.362049935181, 1e-9),
        "nu0 at alpha 2": (-0.2, 1e-9),
        "nu0 at alpha 5": (-0.082762530298, 1e-9),
        "nu0 at alpha 10": (-0.041594578792, 1e-9),
        "scheme 1, delta 0.1, boundary 1": (0.90648925, 6e-9),
        "scheme 1, delta 0.1, boundary 2": (1.08086874, 6e-9),
        "scheme 1, delta 0.1, boundary 3": (1.62804316, 6e-9),
        "scheme 2, alpha 1, delta 0.05, boundary 1": (0.775165, 6e-7),
        "scheme 2, alpha 1, delta 0.05, boundary 2": (0.847825, 6e-7),
        "scheme 2, alpha 1, delta 0.05, boundary 3": (1.7635750, 6e-8),
        "scheme 3, nu -0.9, boundary 1": (0.4183673, 6e-8),
        "scheme 3, nu -0.9, boundary 2": (0.8045290, 6e-8),
        "scheme 3, nu -0.9, boundary 3": (1.0656522, 6e-8),
        "scheme 3, nu -0.07": (1.5579954, 6e-8),
        "scheme 3, nu0": (1.4724190, 6e-8),
        "twice, rigid, p 0.485634": (1.115728, 6e-7),
        "twice, nu0, p 0.393208": (0.014200, 6e-7),
    },
    "03_complex_frequencies": {
        "free, first frequency of the shaft": (83.5107621, 1e-6),
        "free, second": (387.556955, 1e-5),
        "propped, first frequency of the shaft": (299.833866, 2e-5),
        "propped, second": (770.848410, 5e-5),
        "L 0 92": (92.080226887, 2e-9),
        "D 0 92": (1.334882690, 2e-9),
        "L 92 -389": (-388.614752006, 2e-9),
        "D 92 -389": (5.647546140, 2e-9),
        "L 241 93": (92.905851899, 2e-9),
        "D 241 93": (-1.334868906, 2e-9),
        "L 390 394": (393.677368664, 2e-9),
        "D 390 394": (5.646849586, 2e-9),
        "L 390 -91": (-90.749146939, 2e-9),
        "D 390 -91": (1.334838339, 2e-9),
        "forward critical 1": (92.603958028, 2e-9),
        "forward critical 2": (396.619495461, 2e-9),
        "backward critical 1": (91.544097673, 2e-9),
        "backward critical 2": (382.964863926, 2e-9),
        "onset of instability": (92.613690377, 2e-9),
        "limit of I0/I, frequency 5 %": (0.277968, 6e-7),
        "limit of I0/I, damping 15 %": (0.291822, 6e-7),
        "error of frequency at 0.05": (0.0009, 6e-5),
        "error of damping at 0.05": (0.0029, 6e-5),
    },
    "04_bearing_reactions": {
        "speed at 0.16": (273.7042059, 6e-8),
        "acceleration at 0.16": (-626.895098, 6e-7),
        "R_A at 0": (12767.1178, 6e-5),
        "R_B at 0": (17199.2249, 6e-5),
        "R_A at 0.16": (2656.510737, 6e-7),
        "R_B at 0.16": (3578.718876, 6e-7),
        "R_A / R_B": (0.742307744, 1e-9),
        "angle from F_A to F_B": (178.929570484, 1e-9),
        "Euler, error of speed": (0.0666, 6e-5),
        "Euler, error of reactions": (0.129, 6e-4),
        "reaction left / before": (0.0, 1e-12),
        "left when 1 % off": (0.01, 1e-9),
        "static unbalance [g mm]": (1e6 * math.hypot(1.1821309e-2, 3.5183671e-3), 1e-2),
        "unbalance at A [g mm]": (1e6 * 1481.2272 / 204.382695814**2, 1e-2),
        "unbalance at B [g mm]": (1e6 * 1995.4354 / 204.382695814**2, 1e-2),
        "variant 1, steady speed": (475.158208, 1e-6),
        "variant 1, R_A": (6087.52, 6e-3),
        "variant 1, R_B": (10603.0, 6e-2),
        "variant 30, R_B": (2403.04, 6e-3),
    },
    "05_ball_balancer": {
        "|s| at 20": (0.486455190656, 2e-8),
        "|s| at 100": (abs(0.00249012 - 0.00058245j), 2e-8),
        "first ball at 20": (0.04607666, 2e-8),
        "|s| at 100, om 0.9": (5.552501, 6e-7),
        "critical speed": (1.118033989, 1e-9),
        "light set, true boundary": (1.65833228122, 1e-9),
        "rate at 1.5, going up": (1.0946, 0.02),
        "rms imbalance at 2, coming down": (0.0, 1e-3),
        "rms imbalance at 1.7, coming down": (0.0, 0.05),
        "rms imbalance at 1.6, coming down": (4.48, 0.1),
    },
    "07_ring_and_oil": {
        "first contact, f 0.05": (0.82729948, 6e-9),
        "last contact, f 0.05": (1.39574672, 6e-9),
        "fold, f 0.05": (2.4313736489, 1e-9),
        "radius, f 0.05": (3.2135828042, 1e-9),
        "force, f 0.05": (7.281496825, 1e-8),
        "growth, f 0.05": (-0.0358201805, 1e-9),
        "first contact, f 0.12": (0.7855976, 6e-8),
        "last contact, f 0.12": (1.63063791, 6e-9),
        "fold, f 0.12": (4.7016129880, 1e-9),
        "radius, f 0.12": (1.6852503878, 1e-9),
        "force, f 0.12": (2.131259695, 1e-8),
        "growth, f 0.12": (0.0966957271, 1e-9),
        "least friction": (0.012237647, 1e-9),
        "rolling, rate": (-1.8005088777, 1e-9),
        "rolling, radius": (1.0985067093, 1e-9),
        "slipping, rate": (-1.2807764064, 1e-9),
        "slipping, radius": (1.0262889330, 1e-9),
        "slipping, growth": (0.194482976, 1e-8),
        "rate in time": (-1.8005088777, 5e-4),
        "radius in time": (1.0985067093, 5e-5),
        "threshold, sigma 0.3": (2.59133483, 5e-6),
        "whirl there, sigma 0.3": (0.520874118, 1e-6),
        "threshold, sigma 1.5": (2.75064044, 5e-6),
        "whip at 3": (0.96231767, 5e-3),
        "eccentricity at 3": (0.817388, 1e-2),
    },
    "08_faults_and_bearings": {
        "crack, peak of 2X at": (0.4742909779, 1e-5),
        "crack, 2X": (4.7692484357, 1e-5),
        "crack, peak of 3X at": (0.3167002905, 1e-5),
        "crack, 3X": (2.3865942022, 1e-5),
        "pedestal, height at 600 [um]": (-58.103207803, 0.05),
        "pedestal, height at 700 [um]": (-71.140084213, 0.05),
        "balls, order of passage": (8 * 40.1 / (40.1 + 63.9), 1e-9),
        "seal, threshold": (1014.4092665841, 1e-3),
        "seal, whirl there": (311.0855084191, 1e-3),
        "seal, order of whirl at 1115.85": (313.2728839487 / 1115.850193, 0.01),
        "rub, 2X over 1X": (0.118096226, 1e-3),  # DOP853, sharp onset of the force
        "diagnosis, probability of the rub": (1.0, 1e-6),
        "diagnosis, gap off by deviations": (0.0, 3.0),
    },
    "10_measured_rotor": {  # coefficients as their description has them
        "N1 U1 p1x [nm]": (62, 0.6),
        "N1 U1 p1x [deg]": (-20, 0.6),
        "N1 U1 p1y [nm]": (108, 0.6),
        "N1 U1 p1y [deg]": (-1, 0.6),
        "N1 U1 p2x [nm]": (195, 0.6),
        "N1 U1 p2x [deg]": (-76, 0.6),
        "N1 U1 p2y [nm]": (167, 0.6),
        "N1 U1 p2y [deg]": (8, 0.6),
        "N1 U2 p1x [nm]": (55, 0.6),
        "N1 U2 p1x [deg]": (-23, 0.6),
        "N1 U2 p1y [nm]": (92, 0.6),
        "N1 U2 p1y [deg]": (1, 0.6),
        "N1 U2 p2x [nm]": (224, 0.6),
        "N1 U2 p2x [deg]": (-74, 0.6),
        "N1 U2 p2y [nm]": (194, 0.6),
        "N1 U2 p2y [deg]": (10, 0.6),
        "N2 U1 p1x [nm]": (122, 0.6),
        "N2 U1 p1x [deg]": (-21, 0.6),
        "N2 U1 p1y [nm]": (216, 0.6),
        "N2 U1 p1y [deg]": (0, 0.6),
        "N2 U1 p2x [nm]": (401, 0.6),
        "N2 U1 p2x [deg]": (-74, 0.6),
        "N2 U1 p2y [nm]": (346, 0.6),
        "N2 U1 p2y [deg]": (9, 0.6),
        "N2 U2 p1x [nm]": (111, 0.6),
        "N2 U2 p1x [deg]": (-23, 0.6),
        "N2 U2 p1y [nm]": (194, 0.6),
        "N2 U2 p1y [deg]": (2, 0.6),
        "N2 U2 p2x [nm]": (443, 0.6),
        "N2 U2 p2x [deg]": (-73, 0.6),
        "N2 U2 p2y [nm]": (389, 0.6),
        "N2 U2 p2y [deg]": (11, 0.6),
        "condition number, N1": (19, 0.5),
        "condition number, N2": (26, 0.5),
        "residual of influence, N1 [um]": (0.38, 0.005),
        "residual of influence, N2 [um]": (0.65, 0.005),
        "model held back, N1 [um]": (
            0.424,
            0.002,
        ),  # as docs/measured-rotor.md says, like all below
        "model held back, N2 [um]": (0.783, 0.002),
        "influence held back, N1 [um]": (0.361, 0.001),
        "influence held back, N2 [um]": (0.693, 0.001),
        "model held back, N1, share": (0.065, 5e-4),
        "model held back, N2, share": (0.059, 1e-3),
        "model, magnitude": (0.035, 5e-4),
        "influence, magnitude": (0.037, 5e-4),
        "spring 1": (86257.0, 50.0),
        "spring 2": (416330.0, 500.0),
        "probes 1": (0.0365014, 1e-5),
        "probes 2": (0.487161, 1e-5),
        "damping and mark, correlation": (0.96, 0.01),
        "lower natural frequency [rpm]": (1547.0, 1.0),
        "upper [rpm]": (1623.0, 1.0),
        "p1x off by": (2.14, 0.01),
        "p1x, gain": (0.457, 2e-3),
        "p1x, left": (0.071, 2e-3),
        "model, 3 probes, MAE": (3.45, 0.02),
        "influence, 3 probes, MAE": (1.26, 0.01),
        "influence, 4 probes, MAE": (1.15, 0.01),
        "influence, 4 probes, covered": (0.875, 0.015),
        "model, 3 probes, covered": (0.82, 0.015),
        "first maximum of the run-up [rpm]": (1665.0, 8.0),  # measured; a turn is 8 rpm
        "second maximum over first": (0.38 / 0.81, 0.03),  # measured
        "later maxima, off by [rpm]": (39.1, 2.0),
    },
}


@pytest.fixture(scope="module")
def ran(request, tmp_path_factory):
    """Code cells of the notebooks that the tests of this session look at, by name."""
    own = [item for item in request.session.items if item.module is request.module]
    chosen = {item.callspec.params["cells"] for item in own if "cells" in item.fixturenames}
    paths = [path for path in NOTEBOOKS if path.stem in chosen]
    found = executed(paths, tmp_path_factory.mktemp("notebooks"))
    return {path.stem: cells for path, cells in zip(paths, found, strict=True)}


@pytest.fixture(scope="module", params=FOUND)
def cells(request, ran):
    """Name and code cells of a notebook that ran in a folder of its own."""
    return request.param, ran[request.param]


@pytest.mark.slow
def test_runs_without_error_or_warning_and_draws(cells):
    check_runs(cells[1])


@pytest.mark.slow
def test_finds_the_numbers_of_the_source(cells):
    name, ran = cells
    check_found(ran, FOUND[name])


def test_every_notebook_is_run():
    assert [path.stem for path in NOTEBOOKS] == sorted([*FOUND, "06_design"])


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_is_committed_with_its_outputs(path):
    cells = code_cells(nbformat.read(path, as_version=4))
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert all(pictures(cell) for cell in cells if DRAWS.search(cell.source))
    texts = [str(one.get("text", "")) for cell in cells for one in cell.outputs]
    texts += [one.get("data", {}).get("text/plain", "") for cell in cells for one in cell.outputs]
    assert not [text for text in texts if STRAY.search(text)]
    assert path.stat().st_size < 1.5e6
