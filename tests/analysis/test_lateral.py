"""Lateral analysis of a machine: closed forms, numbers by hand, and those of ROSS."""

import numpy as np
import pytest
from scipy.optimize import brentq

import jaxrotor as jr
from jaxrotor.analysis.lateral import Criterion
from jaxrotor.analysis.lateral.critical_map import bearings_of
from jaxrotor.analysis.lateral.level_one import ratio_limit
from jaxrotor.analysis.lateral.scene_analysis import _statics
from jaxrotor.analysis.lateral.unbalance_cases import (
    journal_loads,
    overhung_masses,
    unbalance_cases,
)


RPM = np.pi / 30
MASS, SPRING, DAMPER, SPAN = 120.0, 8e6, 6e3, 1.0
FIRST = np.sqrt(2 * SPRING / MASS)  # of the disc on its two springs
DIAMETRAL, POLAR = 6.0, 3.0
MACHINE = jr.Machine(
    9000 * RPM,
    12000 * RPM,
    probes=[jr.Probe(0.0, "left")],
    clearances=[jr.Clearance(SPAN / 2, 3e-4, "disc")],
    stages=[jr.Stage(2e5, 0.4, 0.02, 1.2)],
    gas_density=20.0,
)


def rigid():
    """A disc in the middle of a rigid shaft on two equal bearings: `m z.. + 2 c z. + 2 k z = F`."""
    bearings = [jr.Support(at, SPRING, DAMPER) for at in (0.0, SPAN)]
    disc = jr.Disc(SPAN / 2, MASS, DIAMETRAL, POLAR)
    return jr.Scene(jr.RigidShaft(SPAN), disc, bearings, spin=jr.ConstantSpeed(1000.0))


@pytest.fixture(scope="module")
def found():
    return jr.lateral_analysis(rigid(), MACHINE)


@pytest.mark.parametrize(
    ("mass", "speed", "expected"), [(500.0, 10_000, 317.5), (500.0, 30_000, 500 / 3.937)]
)
def test_the_residual_unbalance_is_that_of_the_standard(mass, speed, expected):
    """6350 W / N g mm, from 25 000 rpm on W / 3.937 g mm, of three digits more than that number has."""
    assert 1e6 * jr.residual_unbalance(mass, speed * RPM) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("speed", "expected"), [(9000, 25.4), (15_000, 25.4 * 0.8**0.5)])
def test_the_limit_of_vibration_is_that_of_the_standard(speed, expected):
    assert 1e6 * jr.vibration_limit(speed * RPM) == pytest.approx(expected, rel=1e-12)


def test_the_cross_coupling_of_impellers_is_what_ross_prints():
    """The two impellers of the docstring of ROSS's report of 2020, 23022.32142857143; its C is 9.55."""
    stages = [jr.Stage(1e4, 0.35, 0.08, ratio) for ratio in (1.11, 1.14)]
    total = sum(stage.cross_coupling(1000 * RPM) for stage in stages)
    assert total == pytest.approx(23022.32142857143 * (30 / np.pi) / 9.55, rel=1e-12)
    row = jr.Stage(1e6, 0.5, 0.1, kind="axial")  # 1909.859 N m at 5000 rpm, times 1.5 / 0.05
    assert row.cross_coupling(5000 * RPM) == pytest.approx(57295.78, rel=1e-6)


@pytest.mark.parametrize(
    ("density", "expected"), [(0.0, 2.5), (16.53, 2.5), (40.0, 2.23), (60.0, 2.0), (61.0, 0.0)]
)
def test_regions_of_the_critical_speed_ratio(density, expected):
    assert ratio_limit(density) == pytest.approx(expected, abs=1e-3)


def test_a_map_of_a_rigid_rotor_is_its_closed_form():
    springs = np.array([1e6, 1e7])
    chart = jr.critical_map(rigid(), springs, 2)
    bounce, rocking = np.sqrt(2 * springs / MASS), np.sqrt(springs / 2 / (DIAMETRAL - POLAR))
    np.testing.assert_allclose(chart.speeds, np.sort(np.stack([bounce, rocking]).T), rtol=1e-10)
    np.testing.assert_allclose(chart.own, SPRING, rtol=1e-12)


def test_a_map_ends_on_rigid_bearings():
    """A slender shaft: `n^2 pi^2 sqrt(EI / m) / l^2`."""
    shaft = jr.FlexibleShaft(1.0, 0.02, rotary_inertia=False, nodes=14)
    bearings = [jr.Support(at, 1e6) for at in (0.0, 1.0)]
    scene = jr.Scene(shaft, bearings, spin=jr.ConstantSpeed(100.0))
    chart = jr.critical_map(scene, [1e13], 3)
    first = np.pi**2 * np.sqrt(float(shaft.rigidity / shaft.mass_per_length))
    np.testing.assert_allclose(chart.rigid, first * np.arange(1, 4) ** 2, rtol=1e-8)
    np.testing.assert_allclose(chart.speeds[0], chart.rigid, rtol=1e-6)


def shaft_with_overhang():
    """A steel shaft in bearings at 0.2 and 1.0 m, with a disc of 12 kg 0.25 m outside."""
    shaft = jr.FlexibleShaft(1.3, 0.05)
    bearings = [jr.Support(at, 5e7, 1e4) for at in (0.2, 1.0)]
    return jr.Scene(shaft, jr.Disc(1.25, 12.0), bearings, spin=jr.ConstantSpeed(300.0))


def test_loads_of_journals_and_overhung_masses_are_those_of_statics():
    scene = shaft_with_overhang()
    line = float(scene.shaft.mass_per_length)
    right = (1.3 * line * (0.65 - 0.2) + 12 * (1.25 - 0.2)) / 0.8  # moments about the left bearing
    bearings = bearings_of(scene)
    loads = journal_loads(scene, bearings)
    np.testing.assert_allclose(loads, (1.3 * line + 12 - right, right), rtol=1e-12)
    np.testing.assert_allclose(
        overhung_masses(scene, bearings), (0.2 * line, 0.3 * line + 12), rtol=1e-12
    )


def test_unbalances_are_where_the_modes_are_largest():
    """Of a shaft on stiff bearings at its ends: in the middle, then opposite ones at the quarters."""
    shaft = jr.FlexibleShaft(1.0, 0.03)
    bearings = [jr.Support(at, 1e9, 1e3) for at in (0.0, 1.0)]
    scene = jr.Scene(shaft, bearings, spin=jr.ConstantSpeed(2000.0))
    machine = jr.Machine(1500.0, 1500.0, probes=[jr.Probe(0.1)])
    middle, quarters = unbalance_cases(scene, machine, bearings_of(scene))
    whole = float(shaft.mass_per_length)
    assert (middle.name, quarters.name) == ("mid-span", "quarter-span")
    np.testing.assert_allclose(
        (*middle.stations, *quarters.stations), (0.5, 0.25, 0.75), atol=0.006
    )
    np.testing.assert_allclose(
        (*middle.masses, *quarters.masses), (whole, whole / 2, whole / 2), rtol=1e-9
    )
    speed = 1500.0 / RPM
    assert middle.moments[0] == pytest.approx(2 * 6.35e-3 * whole / speed, rel=1e-12)
    assert [float(one.phase) for one in quarters.unbalances] == [0.0, pytest.approx(np.pi)]


def test_an_overhung_mode_has_its_unbalance_outside():
    scene = shaft_with_overhang()
    machine = jr.Machine(300.0, 300.0, probes=[jr.Probe(0.1)], couplings=[0.0])
    overhung, *_, coupling = unbalance_cases(scene, machine, bearings_of(scene))
    assert (overhung.name, coupling.name) == ("overhung", "coupling")
    assert overhung.stations == (pytest.approx(1.25),)  # at the disc
    line = float(scene.shaft.mass_per_length)
    assert coupling.masses == (pytest.approx(0.2 * line),)


def test_a_conical_mode_with_a_large_coupling_end_is_excited_between_the_bearings_too():
    shaft = jr.FlexibleShaft(1.4, 0.05)
    bearings = [jr.Support(at, 5e6, 1e3) for at in (0.4, 1.4)]
    scene = jr.Scene(
        shaft, jr.Disc(0.9, 20.0), jr.Disc(0.05, 8.0), bearings, spin=jr.ConstantSpeed(300.0)
    )
    machine = jr.Machine(900.0, 900.0, probes=[jr.Probe(0.5)])
    cases = unbalance_cases(scene, machine, bearings_of(scene))
    assert {"overhung", "quarter-span"} <= {one.name for one in cases}
    (overhung,) = [one for one in cases if one.name == "overhung"]
    assert overhung.stations == (pytest.approx(0.05),)
    coupled = jr.Machine(900.0, 900.0, probes=[jr.Probe(0.5)], couplings=[0.05])
    assert "overhung" not in {
        one.name for one in unbalance_cases(scene, coupled, bearings_of(scene))
    }


def test_an_overhung_wheel_has_its_unbalance_whatever_the_shapes():
    """A rigid blower whose shapes are larger at its free stub than at the wheel."""
    bearings = [jr.Support(0.5, 1e7, 1e4), jr.Support(0.9, 1e8, 1e4)]
    discs = jr.Disc(0.95, 45.0, 0.6, 1.0), jr.Disc(0.7, 30.0, 0.3, 0.5)
    scene = jr.Scene(jr.RigidShaft(1.0), discs, bearings, spin=jr.ConstantSpeed(300.0))
    machine = jr.Machine(300.0, 300.0, probes=[jr.Probe(0.5)])
    found = unbalance_cases(scene, machine, bearings_of(scene))
    at_wheel = [
        one for one in found if one.name == "overhung" and one.stations == (pytest.approx(0.95),)
    ]
    assert [one.masses for one in at_wheel] == [(pytest.approx(45.0),)]


def test_axial_stages_are_judged_by_the_decrement_alone():
    """The same cross coupling of an axial stage and of an impeller, at which Q0 / QA is too small."""
    held = [jr.Stage(2.4e6, 0.4, 0.02, 1.0), jr.Stage(4.8e6, 0.4, 0.02, kind="axial")]
    found = [
        jr.level_one(rigid(), jr.Machine(900.0, 1000.0, probes=[jr.Probe(0.0)], stages=[s]))
        for s in held
    ]
    assert found[0].anticipated == pytest.approx(found[1].anticipated)
    assert [len(one.conditions) for one in found] == [3, 1]


def test_the_response_of_a_rigid_rotor_is_its_closed_form(found):
    """Peak, half-power speeds, margin, scale and clearance of `r = U w^2 / |2 k - m w^2 + 2 i c w|`."""
    (case,) = [one for one in found.scenes["as given"].cases if one.case.name == "mid-span"]
    unbalance = 2 * 6.35e-3 * MASS / 12_000
    speeds = np.linspace(100.0, 1900.0, 3_600_001)
    radius = unbalance * speeds**2 / abs(2 * SPRING - MASS * speeds**2 + 2j * DAMPER * speeds)
    top = radius.argmax()
    near = speeds[radius >= radius[top] / np.sqrt(2)]
    factor = speeds[top] / np.ptp(near)
    row = next(one for one in found.margins("as given") if one["case"] == "mid-span")
    assert row["speed"] == pytest.approx(speeds[top], rel=1e-5)
    assert row["amplitude"] == pytest.approx(2 * radius[top], rel=1e-9)
    assert row["amplification"] == pytest.approx(factor, rel=1e-4)
    assert row["margin"] == pytest.approx(1 - speeds[top] / (9000 * RPM), rel=1e-5)
    assert row["required"] == pytest.approx(0.17 * (1 - 1 / (factor - 1.5)), rel=1e-4)
    running = (speeds >= 9000 * RPM) & (speeds <= 12_000 * RPM)
    largest = 2 * radius[running].max()
    np.testing.assert_allclose(case.largest, largest, rtol=1e-6)
    scale = min(25.4e-6 / largest, 6.0)
    np.testing.assert_allclose(case.scaled, 2 * scale * radius[top], rtol=1e-6)


def test_level_one_of_a_rigid_rotor_is_its_closed_form(found):
    """`m z.. + 2 c z. + (2 k - i Q) z = 0`: unstable from `Q0 = 2 c sqrt(2 k / m)` on."""
    own = found.scenes["as given"].stability
    anticipated = 3 * (2e5 / (12_000 * RPM)) * 1.2 / (0.4 * 0.02)
    assert own.anticipated == pytest.approx(anticipated, rel=1e-12)
    assert own.threshold == pytest.approx(2 * DAMPER * FIRST, rel=1e-8)
    root = max(np.roots([MASS, 2 * DAMPER, 2 * SPRING - 1j * anticipated]), key=lambda x: x.imag)
    assert own.decrement == pytest.approx(-2 * np.pi * root.real / root.imag, rel=1e-8)
    assert own.frequency == pytest.approx(root.imag, rel=1e-8)


def test_level_one_follows_the_mode_that_becomes_unstable():
    """Bearings twice as stiff along y: at Q = 0 the mode is a straight line, not forward."""
    stiff, damper = np.array([4e7, 8e7]), 2e4
    bearings = [jr.Support(at, kxx=stiff[0], kyy=stiff[1], cxx=damper) for at in (0.0, SPAN)]
    disc = jr.Disc(SPAN / 2, MASS, DIAMETRAL, POLAR)
    scene = jr.Scene(jr.RigidShaft(SPAN), disc, bearings, spin=jr.ConstantSpeed(1000.0))
    machine = jr.Machine(
        900.0, 1000.0, probes=[jr.Probe(0.0)], stages=[jr.Stage(4e5, 0.4, 0.02, 1.2)]
    )

    def roots(q):
        """Of `m q.. + 2 c q. + (2 k + Q [[0, 1], [-1, 0]]) q = 0`."""
        spring = np.diag(2 * stiff) + q * np.array([[0, 1], [-1, 0]])
        top = np.hstack([np.zeros((2, 2)), np.eye(2)])
        return np.linalg.eigvals(
            np.vstack([top, np.hstack([-spring, -2 * damper * np.eye(2)]) / MASS])
        )

    own = jr.level_one(scene, machine)
    assert max(roots(own.threshold).real) == pytest.approx(0.0, abs=1e-6)
    root = max(roots(own.threshold), key=lambda one: (round(one.real, 6), one.imag))
    for q in np.linspace(own.threshold, own.anticipated, 2000):
        root = min(roots(q), key=lambda one: abs(one - root))
    assert own.decrement == pytest.approx(-2 * np.pi * root.real / abs(root.imag), rel=1e-8)
    assert max(abs(np.diff(own.decrements))) < 0.2  # no cliff, of 0.9 to -1.2


def of_ross():
    """Two discs on a shaft of 50 mm in two bearings, as it was given to ROSS 2.3."""
    metal = jr.Material(2.11e11, 7810.0, 81.2e9)
    shaft = jr.FlexibleShaft(1.5, 0.05, metal, shear=True)
    discs = [jr.Disc(0.5, 32.0, 0.18, 0.33), jr.Disc(1.0, 28.0, 0.15, 0.27)]
    bearings = [jr.Support(at, 2e7, 3e3) for at in (0.0, 1.5)]
    return jr.Scene(shaft, discs, bearings, spin=jr.ConstantSpeed(600.0))


def test_ross_finds_the_same_map():
    """`run_ucs(synchronous=True)` of 48 elements; of 24 they are up to 3e-4 away, of the third branch."""
    found = jr.critical_map(of_ross(), [1e6, 1e7, 1e8, 1e9], 3).speeds.T
    expected = [
        [99.66278942139805, 124.66299416378911, 128.26700096706114, 128.64366105515393],
        [314.68122669947377, 474.62130280023, 502.2173448542444, 505.12144803288],
        [886.6616504052804, 2012.097261620384, 3223.7316622826847, 3428.885439101287],
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_ross_finds_the_same_level_one():
    """`run_level1(n=24, stiffness_range=(0, 4e5), num=5)` of 48 elements, of which Q_A is the second."""
    stage = jr.Stage(1e5 * 0.4 * 0.02 * 600 / 3, 0.4, 0.02, 1.0)
    machine = jr.Machine(500.0, 600.0, probes=[jr.Probe(0.1)], stages=[stage])
    own = jr.level_one(of_ross(), machine)
    expected = [0.002038753284494133, -0.3282664252090225, -0.6524327151395808]
    expected += [-0.965024414542046, -1.2618140526004198]
    np.testing.assert_allclose(own.decrements[:9:2], expected, rtol=1e-4, atol=1e-8)
    np.testing.assert_allclose(own.applied[:9:2], [0.0, 1e5, 2e5, 3e5, 4e5], rtol=1e-12)
    assert own.critical_ratio == pytest.approx(
        600 / 128.71, rel=1e-3
    )  # rigid: `run_ucs` of 1e10 N/m


def test_ross_finds_the_same_response():
    """`run_unbalance_response` to 1e-3 kg m at the first disc, there and in the left bearing."""
    scene = of_ross()
    scene = scene.of_parts(*scene.effects, jr.Unbalance(0.5, moment=1e-3))
    found = jr.unbalance_response(scene, [150.0, 300.0, 600.0], [0.5, 0.0]).major.T
    expected = [
        [4.549354877104692e-05, 9.059057875879566e-06, 5.019545133550556e-05],
        [1.2874193767421158e-06, 5.923196881743793e-07, 7.348846547956102e-06],
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_cross_coupling_acts_at_overhung_stages_by_their_shares():
    """Two discs outside; of one at each end of a rigid shaft, the sum of both drives the bounce."""
    stages = [jr.Stage(2e5, 0.4, 0.02, 1.2, at=at) for at in (0.0, 1.0)]
    machine = jr.Machine(900.0, 1000.0, probes=[jr.Probe(0.5)], stages=stages)
    held = [jr.Support(at, SPRING, DAMPER) for at in (0.3, 0.7)]
    disc = jr.Disc(0.5, MASS, 0.4, 0.2)
    scene = jr.Scene(jr.RigidShaft(1.0), disc, held, spin=jr.ConstantSpeed(1000.0))
    own = jr.level_one(scene, machine)
    assert own.stations == (0.0, 1.0)
    assert own.shares == (0.5, 0.5)
    # Bounce has Q, rocking Q l^2 / 4 of both ends, with l = 1, about `(d^2 / 2) c` and inertia 0.4.
    rocking = lambda q: np.roots(
        [0.4, 2 * DAMPER * 0.04 - 0.2j * 1000.0, 2 * SPRING * 0.04 - 0.25j * q]
    )
    bounce = lambda q: np.roots([MASS, 2 * DAMPER, 2 * SPRING - 1j * q])
    each = [f(own.threshold).real.max() for f in (rocking, bounce)]
    assert max(each) == pytest.approx(0.0, abs=1e-4)


def test_criteria_name_what_fails(found):
    """Pass or fail of the rigid rotor: its first peak is far below, and its disc has room."""
    by = {one.paragraph: one for one in found.criteria}
    assert set(by) == {
        "SP6.8.2.10",
        "SP6.8.2.11",
        "SP6.8.2.13",
        "-",
    }  # it has no rigid bearing speed
    assert found.passed == all(one.passed for one in found.criteria)
    kept = found.data()["scenes"]["as given"]
    assert kept["level_one"]["critical_ratio"] is None
    assert kept["coefficients"][0]["kxx"] == SPRING
    assert len(kept["cases"][0]["shapes"]["major"]) == len(kept["cases"][0]["shapes"]["speeds"])


def test_a_summary_has_what_fails_and_the_least_room(found):
    """Rooms by hand, (25.4 - 5) / 25.4 and (1.5 - 1.26) / 1.26, below zero where a demand is not met."""
    room = lambda value, limit, met: Criterion("SP1", "a", "", value, limit, "1", met).room
    assert room(5.0, 25.4, True) == pytest.approx(0.80315, rel=1e-4)
    assert room(1.5, 1.26, True) == pytest.approx(0.190476, rel=1e-5)
    assert room(8.0, 24.0, False) == pytest.approx(-2 / 3)
    assert (room(-3.0, 0.0, True), room(np.nan, 2.5, False)) == (np.inf, -np.inf)
    failed = [one for one in found.criteria if not one.passed]
    assert {one.paragraph for one in failed} == {"SP6.8.2.11"}
    shown = found.summary
    assert shown[: len(failed)] == sorted(failed, key=lambda one: one.value, reverse=True)
    (clearance,) = [one for one in shown if one.paragraph == "SP6.8.2.13"]
    assert clearance.value == max(
        one.value for one in found.criteria if one.paragraph == "SP6.8.2.13"
    )
    assert len(shown) < len(found.criteria)


def test_the_deflected_shape_at_the_peak_is_its_closed_form(found):
    """The rigid rotor moves by the largest `U w^2 / |2 k - m w^2 + 2 i c w|`, all of it alike."""
    (case,) = [one for one in found.scenes["as given"].cases if one.case.name == "mid-span"]
    radius = lambda w: (
        2 * 6.35e-3 * MASS / 12_000 * w**2 / abs(2 * SPRING - MASS * w**2 + 2j * DAMPER * w)
    )
    speeds = np.linspace(100.0, 1900.0, 3_600_001)
    expected = [radius(speeds).max(), radius(12_000 * RPM)]
    shapes = np.asarray(case.shapes.major)
    np.testing.assert_allclose(shapes, np.array(expected)[:, None] + 0 * shapes, rtol=1e-8)


def test_modes_of_the_rigid_rotor_are_its_closed_forms(found):
    """Bounce at the critical speed without damping, with it `m l^2 + 2 c l + 2 k = 0`."""
    part = found.scenes["as given"]
    assert min(np.asarray(part.undamped.values).imag) == pytest.approx(FIRST, rel=1e-9)
    bounce = np.roots([MASS, 2 * DAMPER, 2 * SPRING])
    tilt = lambda sense: np.roots(
        [DIAMETRAL, DAMPER / 2 - 1j * sense * POLAR * 12_000 * RPM, SPRING / 2]
    )
    roots = np.concatenate([bounce, tilt(1)])
    shown = roots[(abs(roots.imag) < 1.25 * 12_000 * RPM) & (-roots.real < abs(roots) / np.sqrt(2))]
    own = np.asarray(part.modes.values)
    np.testing.assert_allclose(np.sort_complex(own), np.sort_complex(shown), rtol=1e-8)


def over_whirl(speed):
    """Bearings whose stiffness and damping change with the frequency of whirl, with a node at a speed."""
    nodes = np.array([0.0, 300.0, 600.0, 900.0, speed, 2.0 * speed])
    stiffness, damping = 5e6 + 4e3 * nodes, 9e3 - 3.0 * nodes
    bearings = [
        jr.Support(at, kxx=stiffness, cxx=damping, frequencies=nodes, interpolation="linear")
        for at in (0.0, SPAN)
    ]
    disc = jr.Disc(SPAN / 2, MASS, DIAMETRAL, POLAR)
    return jr.Scene(jr.RigidShaft(SPAN), disc, bearings, spin=jr.ConstantSpeed(1000.0))


def test_level_one_has_synchronously_reduced_coefficients():
    """`Q0 = 2 c sqrt(2 k / m)` with k and c at the speed."""
    speed = 12_000 * RPM
    own = jr.level_one(over_whirl(speed), MACHINE)
    spring, damper = 5e6 + 4e3 * speed, 9e3 - 3.0 * speed
    assert own.threshold == pytest.approx(2 * damper * np.sqrt(2 * spring / MASS), rel=1e-8)


@pytest.mark.slow  # the whole analysis of another rotor
def test_tables_over_whirl_are_reduced_in_the_whole_analysis():
    """Bearings have those at the speed; growth is `-c / m`, with c at the bounce's own frequency."""
    speed = 12_000 * RPM
    part = jr.lateral_analysis(over_whirl(speed), MACHINE).scenes["as given"]
    assert part.reduced
    rows = [row for row in part.coefficients(MACHINE) if row["speed"] == pytest.approx(speed)]
    assert [row["at"] for row in rows] == [0.0, SPAN]
    np.testing.assert_allclose([rows[0]["kxx"], rows[0]["kyy"]], 5e6 + 4e3 * speed, rtol=1e-12)
    np.testing.assert_allclose([rows[0]["cxx"], rows[0]["cyy"]], 9e3 - 3 * speed, rtol=1e-12)
    # Its frequency solves `m w^2 = 2 k(w) - c(w)^2 / m`.
    balance = lambda w: 2 * (5e6 + 4e3 * w) - (9e3 - 3 * w) ** 2 / MASS - MASS * w**2
    own = brentq(balance, 100.0, 1000.0)
    assert part.growth == pytest.approx(-(9e3 - 3 * own) / MASS, rel=1e-6)


def test_films_rest_where_the_short_bearing_has_them():
    """`e^8 - 4 e^6 + (6 - S^2 (16 - pi^2)) e^4 - (4 + pi^2 S^2) e^2 + 1 = 0`, Friswell et al. (2010)."""
    gap, radius, length, viscosity = 8e-5, 0.05, 0.05, 0.02
    films = [jr.JournalBearing(at, viscosity, radius, length, gap) for at in (0.0, SPAN)]
    disc = jr.Disc(SPAN / 2, MASS, DIAMETRAL, POLAR)
    scene = jr.Scene(jr.RigidShaft(SPAN), disc, films, jr.Gravity(), spin=jr.ConstantSpeed(300.0))
    statics = _statics(scene, jr.Machine(200.0, 300.0, probes=[jr.Probe(0.0)]))
    load = MASS * 9.80665 / 2
    for k, speed in enumerate((200.0, 300.0)):
        s = 2 * radius * speed * viscosity * length**3 / (8 * load * gap**2)
        squares = np.roots([1, -4, 6 - s**2 * (16 - np.pi**2), -(4 + np.pi**2 * s**2), 1])
        (square,) = [x.real for x in squares if abs(x.imag) < 1e-12 and 0 < x.real < 1]
        np.testing.assert_allclose(statics.eccentricity[k], np.sqrt(square), rtol=1e-6)
        attitude = np.arctan(np.pi / 4 * np.sqrt((1 - square) / square))
        np.testing.assert_allclose(statics.attitude[k], attitude, rtol=1e-6)
        np.testing.assert_allclose(abs(statics.load[k]), load, rtol=1e-9)


def test_words_for_what_cannot_be_analysed():
    scene = rigid()
    refused = lambda text: pytest.raises(ValueError, match=text)
    with refused("has no"):
        jr.lateral_analysis(scene, jr.Machine(100.0, 200.0))
    with refused("two bearings, but the scene has 1"):
        bearings_of(
            jr.Scene(
                jr.RigidShaft(1.0),
                jr.Disc(0.5, 1.0),
                jr.Support(0.5, 1e6, angular_stiffness=1e5),
                spin=jr.ConstantSpeed(1.0),
            )
        )
    with refused("`probes` must be a list of Probe"):
        jr.Machine(100.0, 200.0, probes=jr.Probe(0.1))
    with refused("in this order"):
        jr.Machine(300.0, 200.0)
    with refused("needs `density_ratio"):
        jr.Stage(1e5, 0.4, 0.02)
    with refused("needs `at"):
        jr.level_one(
            shaft_with_overhang(), jr.Machine(300.0, 300.0, stages=[jr.Stage(1e5, 0.4, 0.02, 1.2)])
        )
    with refused("The eye of the machine is at 3 m, but the shaft ends at 1 m"):
        jr.lateral_analysis(scene, jr.Machine(300.0, 300.0, probes=[jr.Probe(3.0, "eye")]))
    with refused("'a' and 'b' differ"):
        jr.lateral_analysis({"a": scene, "b": shaft_with_overhang()}, MACHINE)
    with refused("positive and ascending"):
        jr.critical_map(scene, [1e7, 1e6])
    short = [
        jr.Support(at, kxx=[1e7, 1e7], cxx=[1e4, 1e4], speeds=[100.0, 500.0]) for at in (0.0, SPAN)
    ]
    tabled = jr.Scene(
        jr.RigidShaft(SPAN), jr.Disc(0.5, 10.0, 1.0, 1.0), short, spin=jr.ConstantSpeed(300.0)
    )
    with refused("extend the tables"):
        jr.lateral_analysis(tabled, MACHINE)
