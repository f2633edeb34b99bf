"""Negative stiffness, as of seals and of magnetic pull: a mass on two springs, and finite elements."""

import fem
import numpy as np
import pytest
import scipy.linalg

import jaxrotor as jr
from jaxrotor.analysis.static_instability import static_instability


SHAFT, MASS = 1e6, 2.0  # [N/m], [kg]
MOTOR = """\
[shaft]
length = "1 m"
diameter = "50 mm"
constraints = []
[shaft.material]
youngs_modulus = "211 GPa"
density = "7810 kg/m^3"
[disc]
at = "0.5 m"
mass = "10 kg"
[[support]]
at = "0 m"
stiffness = "10 MN/m"
[[support]]
at = "1 m"
stiffness = "10 MN/m"
[[support]]
at = "0.5 m"
kxx = "-1 MN/m"
[spin]
speed = "3000 rpm"
"""


def jeffcott(**given):
    shaft, disc = jr.MasslessShaft(1.0, 0.5, SHAFT), jr.Disc(0.5, MASS)
    return jr.Scene(shaft, disc, jr.Support(0.5, **given), spin=jr.ConstantSpeed(300.0))


@pytest.mark.parametrize("damping", [0.0, 30.0])
@pytest.mark.parametrize("negative", [-3e6, -1e6 - 8.0, -1e6 + 8.0, -0.4e6])
def test_roots_of_a_mass(negative, damping):
    """`s = -c / 2m +- sqrt((c / 2m)^2 - k / m)`, also where a root is `sqrt(|k| / m)`."""
    half, square = damping / (2 * MASS), (SHAFT + negative) / MASS
    expected = -half + np.array([-1, 1]) * np.sqrt(half**2 - square + 0j)
    scene = jeffcott(kxx=negative, cxx=damping)
    found = np.asarray(jr.roots(scene))
    order = lambda roots: roots[np.lexsort((roots.real, roots.imag))]
    np.testing.assert_allclose(order(found), order(expected), rtol=1e-9, atol=1e-9)
    critical = np.asarray(jr.critical_speeds(scene).speeds)
    np.testing.assert_allclose(critical, np.sqrt([square] * 2) if square > 0 else [], rtol=1e-9)
    said = static_instability(scene)
    assert bool(said) == (square < 0)
    if said:
        assert "support at 500 mm" in said
        assert float(said.split(" at ")[-1].split()[0]) == pytest.approx(np.sqrt(-square), rel=1e-5)


def test_unstable_along_one_axis():
    """Critical is the other axis alone; the support may be given by its mean and its axes."""
    for given in ({"kxx": -3e6, "kyy": 2e6}, {"stiffness": -5e5, "anisotropy": 5.0}):
        scene = jeffcott(**given)
        expected = np.sqrt(3e6 / MASS)
        np.testing.assert_allclose(jr.critical_speeds(scene).speeds, [expected], rtol=1e-12)
        assert "undamped at 1000 1/s" in static_instability(scene)
    assert not static_instability(jeffcott(kxx=3e6, kyy=2e6))


def test_motion_off_the_axis():
    """`z = r cosh(s t)` from rest; a lane of a sweep beside a stable one is right as well."""
    start = jr.Whirl(1e-6)
    found = jr.simulate(jeffcott(kxx=-1e6 - 8e4), 1, 64, start=start)  # s = 200 / s
    expected = 1e-6 * np.cosh(200.0 * np.asarray(found.time))
    np.testing.assert_allclose(np.ravel(found.displacement), expected, rtol=1e-9)


def test_tilting_and_casings():
    """A negative angular stiffness tilts a pivoted disc: `I s^2 = |k_a| - k l^2`."""
    pivot = jr.RigidShaft(1.0, (jr.Constraint(0.0),))
    parts = jr.Disc(0.0, 1.0, polar=4.0), jr.Support(1.0, 100.0)
    scene = jr.Scene(
        pivot, *parts, jr.Support(0.0, 0.0, angular_stiffness=-150.0), spin=jr.ConstantSpeed(0.0)
    )
    assert "undamped at 5 1/s" in static_instability(scene)
    found = np.sort(np.asarray(jr.roots(scene)).real)
    np.testing.assert_allclose(found, [-5.0, 5.0], rtol=1e-12)


@pytest.mark.slow
def test_magnetic_pull_on_a_flexible_shaft():
    """Roots at 3000 rpm of finite elements; others found 304.919 and 305.203 rad/s by coarser ones."""
    spring, pull, material = 1e7 * np.eye(2), -1e6 * np.eye(2), (211e9, 7810.0, np.inf)
    bearings = [(0.0, spring), (1.0, spring), (0.5, pull)]
    speed, found = 100 * np.pi, []
    for longest in (0.05, 0.025):
        _, mass, gyroscopic, stiffness = fem.matrices(
            [fem.Stretch(1.0, 0.05)], [(0.5, 10.0, 0.0, 0.0)], bearings, material, longest
        )
        zero, one = np.zeros_like(mass), np.eye(len(mass))
        low = np.block([[zero, one], [-stiffness, -speed * gyroscopic]])
        values = scipy.linalg.eigvals(low, scipy.linalg.block_diag(one, mass)).imag
        found.append(np.sort(values[values > 1.0])[:2])
    expected = (4 * found[1] - found[0]) / 3
    scene = jr.loads(MOTOR)
    roots = np.asarray(jr.roots(scene, 2))
    np.testing.assert_allclose(np.sort(np.abs(roots.imag)), expected, rtol=1e-6)
    np.testing.assert_allclose(np.sort(np.abs(roots.imag)), [304.919, 305.203], rtol=2e-5)
    assert not static_instability(scene)
    assert static_instability(scene.replace({"supports.2.kxx": -3e6}))
