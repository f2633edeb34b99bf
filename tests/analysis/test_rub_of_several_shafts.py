"""Circular whirl of one of two shafts in a ring, against transfer matrices and matrices written here."""

import numpy as np
import pytest
from shafts_of_tests import dual_rotor, toy

import jaxrotor as jr


RIM = {"at": ("hp", 0.5925), "friction": 0.1, "rim_radius": 0.125}


@pytest.mark.slow  # eight nodes a span
@pytest.mark.parametrize(
    ("ratio", "speed", "gap", "normal", "phase", "leading"),
    [
        (1.3, 200.0, 60e-6, 30.56542707, 3.131000862, 1.54982682 + 345.099022j),
        (-1.2, 400.0, 100e-6, 59.40720607, 2.638557865, 5.19937427 + 113.740301j),
    ],
)
def test_full_rub_of_a_disc_by_the_unbalance_of_the_other_shaft(
    ratio, speed, gap, normal, phase, leading
):
    ring = jr.AnnularStator(gap=gap, stiffness=1e6, **RIM)
    found = jr.annular_rub(dual_rotor(ratio, None, ring, first=speed, nodes=8))
    assert float(found.normal_force[0, 0]) == pytest.approx(normal, rel=1e-9)
    assert float(found.phase[0, 0]) == pytest.approx(phase, abs=1e-9)
    root = complex(found.roots[0, 0, 0])
    assert complex(root.real, abs(root.imag)) == pytest.approx(leading, rel=1e-8)
    assert not found.exists[0, 1]


@pytest.mark.slow  # five nodes a span; at eight it agrees to nine digits
def test_dry_whirls_are_backward_of_the_shaft_in_the_ring():
    """So forward of the other one, against which that turns."""
    ring = jr.AnnularStator(gap=3e-4, stiffness=5e6, **RIM)
    found = jr.dry_whirl(dual_rotor(-1.2, None, ring, nodes=5))
    for rate, normal, growth in (
        (263.8748947, 95.48548245, 29.7474502),
        (331.9908943, 935.5781218, 3.60215972),
    ):
        place = int(np.argmin(np.abs(np.asarray(found.rate) - rate)))
        assert float(found.rate[place]) == pytest.approx(rate, rel=3e-8)
        assert float(found.normal_force[place]) == pytest.approx(normal, rel=1e-7)
        assert float(found.growth[place]) == pytest.approx(growth, rel=2e-7)


# === the toy, by matrices written here

FIRST, RATIO, GAP, STIFF, FRICTION = 1.4, -1.2, 0.03, 30.0, 0.05
ring = {"gap": GAP, "stiffness": STIFF, "friction": FRICTION, "rim_radius": 1.0}


def compliance(rate, k12=0.8):
    """Response of both shafts to unit forces that turn at a rate."""
    speeds, turning = np.diag([FIRST, RATIO * FIRST]), np.diag([0.01, 0.02])
    across = np.array([[1.0, -1.0], [-1.0, 1.0]])
    damping = np.diag([0.04, 0.03]) + turning + 0.02 * across
    stiffness = np.diag([1.0, 2.0]) + k12 * across - 1j * speeds @ turning
    moving = 1j * rate * (damping - 1j * speeds @ np.diag([0.2, 0.18]))
    return np.linalg.inv(stiffness + moving - rate**2 * np.diag([1.0, 0.6]))


def test_full_rub_by_the_unbalance_of_a_further_shaft():
    """LP in a ring, whirled by the unbalance of HP: the force balances, and friction is against LP."""
    scene = toy(RATIO, None, jr.AnnularStator(("lp", 1.0), **ring))
    found = jr.annular_rub(scene, by="hp")
    rate = RATIO * FIRST
    assert float(found.rates[0]) == pytest.approx(rate)
    z, normal = complex(found.displacement[0, 0]), float(found.normal_force[0, 0])
    n = z / abs(z)
    assert abs(z) == pytest.approx(GAP + normal / STIFF) and normal > 0
    sign = np.sign(FIRST + rate * abs(z))
    force = np.array([-normal * (1 + 1j * FRICTION * sign) * n, 0.0])
    force[1] += 0.03 * np.exp(0.7j) * rate**2
    moved = compliance(rate) @ force
    assert moved[0] == pytest.approx(z, rel=1e-10)
    np.testing.assert_allclose(found.coordinates[0, 0], moved, rtol=1e-10)


@pytest.mark.slow  # all dry whirls
def test_dry_whirl_of_a_shaft_in_another_one():
    """`V` has the speeds of both surfaces, each at its own radius."""
    scene = toy(RATIO, None, jr.AnnularStator(("lp", 1.0), on="hp", **ring), k12=0.0)
    found = jr.dry_whirl(scene)
    assert found.rate.size
    for rate, radius, normal, slip, needed in zip(
        found.rate, found.radius, found.normal_force, found.slip, found.needed, strict=True
    ):
        response = compliance(float(rate), k12=0.0)
        receptance = np.array([1.0, -1.0]) @ response @ np.array([1.0, -1.0])
        balance = float(radius) / float(normal) + receptance * (1 + 1j * float(needed))
        assert abs(balance) < 1e-10 * abs(receptance)
        past = FIRST - RATIO * FIRST * (1.0 + GAP) + float(rate) * float(radius)
        assert float(slip) == pytest.approx(past, abs=1e-10)
        assert abs(float(needed)) <= FRICTION * (1 + 1e-12)


@pytest.mark.slow  # a motion in time
def test_a_motion_stays_on_a_full_rub_that_is_stable():
    scene = toy(1.3, None, jr.AnnularStator(("hp", 1.0), **(ring | {"gap": 0.12})))
    balanced = scene.replace({"unbalances.1.moment": 0.0})
    found = jr.annular_rub(balanced)
    assert found.stable[0, 0]
    times = np.linspace(0.0, 20.0, 21)
    motion = jr.run_up(balanced, times, at=("hp", 1.0), start=found.start(), substeps=256)
    turned = complex(found.displacement[0, 0]) * np.exp(1j * FIRST * times)
    np.testing.assert_allclose(motion.displacement[:, 0], turned, atol=2e-7)
