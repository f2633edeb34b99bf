"""Roots, onset speeds and steady responses against published numbers, formulas and finite elements.

[R] marks numbers of the sheet that were recomputed by other methods (a Ritz basis).
"""

import itertools

import numpy as np
import pytest
from oracles import Beam
from published import ONSET
from scipy.optimize import brentq
from systems import (
    DENSITY,
    DIAMETER,
    DIAMETRAL,
    LENGTH,
    MASS,
    PER_LENGTH,
    RIGIDITY,
    TIME,
    YOUNG,
    bare,
    limiter_rotor,
    slowest,
)
from transfer import Joint, Stretch, whirl_near

import jaxrotor as jr
from jaxrotor import Disc, DiscDamping, ExternalDamping, Gravity, InternalDamping, Unbalance
from jaxrotor.equations.pencil import Pencil, eigenvalues


UNDAMPED = {"eta_e": None, "eta_i": None, "eta_Dxi": None, "contact": False}


def forward(values, count):
    """Forward whirl speeds of undamped roots, ascending."""
    whirl = np.sort(np.asarray(values).imag)
    return whirl[whirl > 0][:count]


def paired(found, expected):
    """The found roots, each the closest to an expected one, in the order of these."""
    gap = np.abs(np.asarray(found)[:, None] - np.asarray(expected)[None])
    order = gap.argmin(axis=0)
    assert len(set(order)) == len(order)
    return np.asarray(found)[order]


# === section 3.1: conservative frequencies


def test_conservative_frequencies():
    whirl = forward(jr.roots(limiter_rotor(N=0.0, nodes=14, **UNDAMPED)), 4) * TIME
    np.testing.assert_allclose(whirl[:3], [1.59653241, 16.5802215, 41.1327862], rtol=1e-7)  # [R]
    assert whirl[3] == pytest.approx(81.0039, abs=5e-5)  # [R], six digits


@pytest.mark.slow
@pytest.mark.parametrize("nodes", [4, 12])
@pytest.mark.parametrize("N", [0.0, 15.0])
def test_conservative_roots_are_imaginary(nodes, N):
    scene = limiter_rotor(N=N, nodes=nodes, **UNDAMPED)
    values = np.asarray(eigenvalues(Pencil.of(jr.assemble(scene))))  # `roots` sets rounding to zero
    assert values.size == 2 * nodes
    # Rounding is relative to 1 / lambda of the slowest root, so the slowest have the most digits.
    rounding = 2e-14 * nodes * np.abs(values) / np.min(np.abs(values))
    assert np.all(np.abs(values.real) < rounding * np.abs(values))


def test_uniform_cantilever():
    """Without disc and rotary inertia cos b cosh b = -1, omega = b^2 sqrt(EI / (m l^4))."""
    characteristic = lambda b: np.cos(b) + 1 / np.cosh(b)
    b = np.array([brentq(characteristic, k * np.pi, (k + 1) * np.pi, xtol=1e-15) for k in range(5)])
    expected = b**2 * np.sqrt(RIGIDITY / (PER_LENGTH * LENGTH**4))
    whirl = forward(jr.roots(bare(nodes=16, rotary_inertia=False)), 5)
    np.testing.assert_allclose(whirl, expected, rtol=1e-8)


# === section 3.2: onset speeds and first roots


@pytest.mark.slow
@pytest.mark.parametrize(("eta_i", "right", "reverse"), ONSET)
def test_onset_speed(eta_i, right, reverse):
    for sign, (speed, whirl) in ((1, right), (-1, reverse)):
        onset = jr.onset_speed(limiter_rotor(eta_i=eta_i, sign=sign))
        assert float(onset.speed) * TIME == pytest.approx(speed, rel=1e-6)
        assert float(onset.whirl_frequency) * TIME == pytest.approx(whirl, rel=1e-6)


FIRST = {  # N: lambda T* [R]
    0: (-0.11423265 + 1.59636651j, -0.11423265 - 1.59636651j),
    10: (-0.19425748 - 1.50011970j, -0.03236635 + 1.69410001j),
    15: (-0.23335496 - 1.45302933j, 0.00912266 + 1.74308955j),
    20: (-0.27167697 - 1.40687159j, 0.05094682 + 1.79197492j),
}


@pytest.mark.parametrize("N", FIRST)
def test_first_roots(N):
    found = slowest(jr.roots(limiter_rotor(N=N)), 2) * TIME
    np.testing.assert_allclose(paired(found, FIRST[N]), FIRST[N], rtol=0, atol=1e-8)


# === section 3.3: convergence of both rules

EXACT = 13.90412512  # N_crit at eta_i = 0.005 [R]
TRAPEZOID = {  # cells: N_crit, stiffest eigenvalue [R]
    5: (13.925237, 7.9e4),
    10: (13.909524, 3.3e5),
    40: (13.904465, 5.4e6),
}
SPECTRAL = {  # nodes: N_crit and stiffest eigenvalue, collocated at the nodes [R]
    4: (13.891210, 1.1e2),
    5: (13.903526, 3.4e2),
    6: (13.904233, 1.5e3),
    8: (13.904125026, 1.1e4),
}


def onset_and_stiffest(**shaft):
    """Onset by scipy from the roots, which compiles faster than `onset_speed` for every new size."""
    scene = limiter_rotor(contact=False, **shaft)
    at = lambda N: np.asarray(jr.roots(scene.replace({"spin.speed": N / TIME})))
    speed = brentq(lambda N: at(N).real.max(), 13.0, 15.0, xtol=1e-11)
    return speed, np.max(np.abs(at(speed))) * TIME


@pytest.mark.slow
def test_trapezoid_converges_with_second_order():
    found = {m: onset_and_stiffest(rule="trapezoid", nodes=m) for m in TRAPEZOID}
    for m, (speed, stiffest) in TRAPEZOID.items():
        assert found[m][0] == pytest.approx(speed, abs=6e-7)
        assert found[m][1] == pytest.approx(stiffest, rel=0.03)
    errors = [abs(found[m][0] - EXACT) for m in TRAPEZOID]
    slope, _ = np.polyfit(np.log(list(TRAPEZOID)), np.log(errors), 1)
    assert -2.1 < slope < -1.9


@pytest.mark.long
def test_spectral_beats_collocation():
    """Galerkin's equations within spans: fewer wrong digits by as many nodes, and no stiffer."""
    for nodes, (speed, stiffest) in SPECTRAL.items():
        found = onset_and_stiffest(nodes=nodes)
        assert abs(found[0] - EXACT) < max(1e-4 * abs(speed - EXACT), 1e-8)  # 1e-8: digits of EXACT
        assert found[1] < stiffest


@pytest.mark.slow
def test_spectral_converges_exponentially():
    """First forward whirl at speed against transfer matrices, by 2 to 5 nodes."""
    scenes = {n: limiter_rotor(nodes=n, **UNDAMPED) for n in (2, 3, 4, 5)}
    found = {n: forward(jr.roots(scene), 1)[0] for n, scene in scenes.items()}
    end = Joint(mass=MASS, diametral=DIAMETRAL, polar=2 * DIAMETRAL)
    stretch = Stretch(LENGTH, DIAMETER, YOUNG, DENSITY)
    clamp = Joint(pinned=True, slope=True)
    exact = whirl_near(found[5], [stretch], [clamp, end], 15.0 / TIME)
    errors = [abs(whirl / exact - 1) for whirl in found.values()]
    assert errors[0] < 1e-3 and errors[-1] < 1e-9
    assert all(more < fewer / 10 for fewer, more in itertools.pairwise(errors))


# === several spans, against finite elements


def beam(**options):
    return Beam(LENGTH, DIAMETER, YOUNG, DENSITY, **options)


TWO = ((0.28, MASS, DIAMETRAL, 2 * DIAMETRAL), (0.7, 0.6, 0.001, 0.0015))
SEVERAL = {
    "end": ((0.7, MASS, DIAMETRAL, 2 * DIAMETRAL),),
    "middle": ((0.35, MASS, DIAMETRAL, 2 * DIAMETRAL),),
    "three": (*TWO, (0.49, 0.8, 0.002, 0.004)),
}


@pytest.mark.slow
@pytest.mark.parametrize("discs", SEVERAL)
def test_discs_against_finite_elements(discs):
    """Undamped forward and backward whirl with gyroscopic moments equals elements at three speeds."""
    elements = beam()
    for disc in SEVERAL[discs]:
        elements.disc(*disc)
    nodes = {"end": 14}.get(discs, 12)  # nodes per span
    scene = bare(*(Disc(*disc) for disc in SEVERAL[discs]), nodes=nodes)
    for N in (0.0, 15.0, 60.0):
        expected = elements.roots(N / TIME, 6)
        found = np.asarray(jr.roots(scene.replace({"spin.speed": N / TIME}), 14))
        np.testing.assert_allclose(
            np.sort(paired(found, expected).imag), np.sort(expected.imag), rtol=1e-6
        )


@pytest.mark.slow
@pytest.mark.hard("1.6 no spurious mode grows")
@pytest.mark.parametrize(("reach", "nodes"), [(0.65, 5), (0.6, 5), (0.03, 12)])
def test_no_spurious_mode_grows(reach, nodes):
    """With a disc near the end of the shaft every root is stable below the onset speed."""
    scene = limiter_rotor(N=1.0, eta_i=None, station=reach / LENGTH, nodes=nodes, contact=False)
    assert np.max(np.asarray(jr.roots(scene)).real) < 0


@pytest.mark.parametrize("reach", [0.35, 0.7])
def test_damped_roots_against_finite_elements(reach):
    """Roots with all kinds of damping together, the disc inside the shaft and at its end."""
    elements = beam().disc(reach, MASS, DIAMETRAL, 2 * DIAMETRAL, 0.6, 0.05).damp(8.0, 1e-4)
    scene = bare(
        Disc(reach, MASS, DIAMETRAL, 2 * DIAMETRAL),
        DiscDamping(reach, 0.6, 0.05),
        ExternalDamping(8.0),
        InternalDamping(1e-4),
        nodes=10,
    )
    for N in (0.0, 15.0, 40.0):
        expected = slowest(elements.roots(N / TIME, 8), 4)
        found = jr.roots(scene.replace({"spin.speed": N / TIME}))
        np.testing.assert_allclose(paired(found, expected), expected, rtol=1e-6)


# === steady responses


def hanging(x, load, tip, where):
    """Deflection of a cantilever under `load` per length and a force `tip` at `where`."""
    distributed = load * x**2 * (6 * LENGTH**2 - 4 * LENGTH * x + x**2) / 24
    near, far = np.minimum(x, where), np.maximum(x, where)
    return (distributed + tip * near**2 * (3 * far - near) / 6) / RIGIDITY


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["spectral", "trapezoid"])
def test_static_deflection(rule):
    """Under a disc inside the shaft; one at its end is below."""
    g, x, reach = 9.81, np.array([0.0, 0.14, 0.28, 0.42, 0.7]), 0.3
    nodes = {"spectral": 6, "trapezoid": 60}[rule]
    scene = bare(Disc(reach, MASS), Gravity(g), nodes=nodes, rule=rule)
    found = np.asarray(jr.weight_response(scene, 0.0, at=x).deflection[0])
    expected = -1j * hanging(x, PER_LENGTH * g, MASS * g, reach)
    tolerance = {"spectral": 1e-11, "trapezoid": 2e-4}[rule]
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=1e-18)


def test_internal_damping_turns_the_static_deflection():
    """A rotating shaft of Voigt material sags askew: z = z_0 / (1 - i Omega T)."""
    scene = bare(Disc(LENGTH, MASS), InternalDamping(3e-4), ExternalDamping(8.0), Gravity(9.81))
    speeds = np.array([-400.0, 0.0, 250.0, 900.0])
    found = np.asarray(jr.weight_response(scene, speeds, at=LENGTH).deflection[:, 0])
    straight = -1j * hanging(LENGTH, PER_LENGTH * 9.81, MASS * 9.81, LENGTH)
    np.testing.assert_allclose(found, straight / (1 - 1j * speeds * 3e-4), rtol=1e-10)


@pytest.mark.slow
def test_unbalance_response_against_finite_elements():
    stations = [0.14, 0.35, 0.7]
    elements = beam().disc(0.35, MASS, DIAMETRAL, 2 * DIAMETRAL, 0.6, 0.05).damp(8.0, 1e-4)
    scene = bare(
        Disc(0.35, MASS, DIAMETRAL, 2 * DIAMETRAL),
        DiscDamping(0.35, 0.6, 0.05),
        ExternalDamping(8.0),
        InternalDamping(1e-4),
        Unbalance(0.35, MASS, 2e-4, 0.7),
        nodes=10,
    )
    speeds = np.array([-300.0, 40.0, 160.0, 700.0, 1500.0])  # below and above critical speeds
    found = np.asarray(jr.unbalance_response(scene, speeds, at=stations).forward)
    moment = MASS * 2e-4 * np.exp(0.7j)
    expected = [elements.response(speed, 0.35, moment, stations) for speed in speeds]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.slow
def test_no_fast_root_of_a_passive_rotor_grows():
    """Springs and dampers to the ground only take energy; rounding is up to 3e-8 of the fastest root."""
    bearing = lambda at: jr.Support(at, kxx=1.5e8, kyy=3.5e8, cxx=3e5, cyy=5e5)
    steps = jr.Step(0.6, 0.18), jr.Step(1.5, 0.12)
    scene = jr.Scene(
        jr.FlexibleShaft(2.2, 0.12, steps=steps, nodes=14),
        jr.Disc(1.05, 620.0, diametral=45.0, polar=14.0),
        jr.Disc(1.7, 25.0, polar=0.9),
        bearing(0.3),
        bearing(1.95),
        spin=jr.ConstantSpeed(300.0),
    )
    for speed in (300.0, 5751.0, 8000.0, 12000.0):
        assert float(jr.growth_rate(scene.at_speed(speed))) <= 0
