"""Balancing, against point masses, trial runs of a flexible rotor, and numbers of the standard."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr


# === rigid rotors, against point masses

RANDOM = np.random.default_rng(4)
MASSES = RANDOM.uniform(0.1, 2.0, 9)
PLACES = RANDOM.normal(size=9) + 1j * RANDOM.normal(size=9)  # x + i y [m]
STATIONS = RANDOM.uniform(-0.3, 0.9, 9)
U, J = np.sum(MASSES * PLACES), np.sum(MASSES * PLACES * STATIONS)


@pytest.mark.parametrize("planes", [(0.0, 0.5), (0.7, 0.1), (-0.4, 1.3)])
def test_two_corrections_cancel_every_moment_of_point_masses(planes):
    c = jr.rigid_correction(U, J, planes=np.array(planes))
    mass, radius = 0.2, np.asarray(c) / 0.2  # as real point masses
    places, masses = np.append(PLACES, radius), np.append(MASSES, [mass] * 2)
    assert abs(np.sum(masses * places)) < 1e-13
    assert abs(np.sum(masses * places * np.append(STATIONS, planes))) < 1e-13
    by_hand = np.linalg.solve([[1, 1], planes], [-U, -J])
    np.testing.assert_allclose(c, by_hand, rtol=1e-12)
    left = jr.rigid_residual(U, J, np.array(planes), c)
    assert abs(left.unbalance) < 1e-13 and abs(left.product) < 1e-13


def test_the_course_rotor_by_its_bearing_coefficients():
    """Variant 31 of the sheet: the forces of its bearings follow from J / z_B and u - J / z_B."""
    b = 0.267
    at_b = 0.0464503149 - 0.0111481005j
    u, j = at_b + (-0.0346290060 + 0.0076297334j), at_b * b
    c = jr.rigid_correction(u, j, np.array([0.0, b]))
    np.testing.assert_allclose(c, [0.0346290060 - 0.0076297334j, -at_b], rtol=1e-12)
    half = jr.rigid_residual(u, j, np.array([0.0, b]), c / 2)
    np.testing.assert_allclose([half.unbalance, half.product], [u / 2, j / 2], rtol=1e-12)


def test_no_reaction_of_the_course_rotor_remains():
    """Two masses that balance the sheet's u and J, on wheels 1, 2 at 0.133 and 0.36 m from A."""
    at_b = 0.0464503149 - 0.0111481005j  # kg m
    u, j = at_b + (-0.0346290060 + 0.0076297334j), at_b * 0.267
    scene, planes = jr.load("turbine-run-up"), np.array([0.133, 0.36])
    masses = np.linalg.solve([[1, 1], planes], [-u, -j])

    def dynamic(share, *weight):
        """Dynamic reactions of the rotor with that share of the corrections, as real unbalances."""
        pieces = [
            jr.Unbalance(0.093 + at, 1.0, abs(m), np.angle(m))
            for at, m in zip(planes, share * masses, strict=True)
        ]
        rotor = jr.Scene(scene.shaft, *scene.effects, *pieces, *weight, spin=scene.spin)
        return np.abs(jr.reactions(jr.run_up(rotor, np.linspace(0, 0.48, 25))).dynamic)

    half = dynamic(0.5)
    np.testing.assert_allclose(half[0], [12767.1178 / 2, 17199.2249 / 2], rtol=1e-6)
    assert dynamic(1.0).max() < 1e-4  # N: the sheet's ten digits at 600 rad/s
    assert dynamic(1.0, jr.Gravity()).max() < 1e-4  # weight is static


def test_a_correction_is_differentiable_and_maps():
    planes = jnp.asarray([0.1, 0.6])
    size = jax.jit(lambda z: jnp.sum(jnp.abs(jr.rigid_correction(U, J, z)) ** 2))
    for i, value in enumerate(jax.grad(size)(planes)):
        step = 1e-6 * jnp.eye(2)[i]
        np.testing.assert_allclose(
            value, (size(planes + step) - size(planes - step)) / 2e-6, rtol=1e-7
        )
    many = jax.vmap(lambda u: jr.rigid_correction(u, J, planes))(jnp.asarray([U, 2 * U]))
    np.testing.assert_allclose(many[1], jr.rigid_correction(2 * U, J, planes), rtol=1e-15)


def test_planes_must_be_two_and_apart():
    with pytest.raises(ValueError, match="must be two different stations, but both are 0.3."):
        jr.rigid_correction(U, J, np.array([0.3, 0.3]))
    with pytest.raises(ValueError, match=r"must be two stations, but has shape \(3,\)."):
        jr.rigid_correction(U, J, np.array([0.3, 0.4, 0.5]))


# === influence coefficients, on a flexible rotor


PLANES = (0.4, 1.0)
OWN = (2.4e-4 * np.exp(0.4j), 2.5e-4 * np.exp(2.9j))  # in the planes of the discs [kg m]
SHAFT = 1.6e-4 * np.exp(-1j)  # at 0.7 m, in neither
TRIALS = np.array([2e-4 * np.exp(0.7j), 1e-4 * np.exp(-2.0j)])  # [kg m]
SPEEDS, SENSORS = np.array([90.0, 210.0]), np.array([0.4, 0.7, 1.0])


def piece(at, moment):
    """A mass of 0.05 kg at the radius that gives `moment` [kg m]."""
    return jr.Unbalance(at, 0.05, abs(moment) / 0.05, np.angle(moment))


def vibration(pieces=(0.0, 0.0), shaft=0.0):
    """Forward whirl (speeds, sensors) of two discs on a shaft, with masses added in both."""
    scene = jr.Scene(
        jr.FlexibleShaft(1.0, 0.03, nodes=5, constraints=[jr.Constraint(0.0, "clamp")]),
        jr.Disc(0.4, 8.0, 0.02, 0.04),
        jr.Disc(1.0, 5.0, 0.01, 0.02),
        jr.DiscDamping(0.4, 60.0),
        jr.Support(0.7, 1e6, 200.0, anisotropy=0.2),
        *(piece(at, moment) for at, moment in zip(PLANES, OWN, strict=True)),
        *(piece(at, moment) for at, moment in zip(PLANES, pieces, strict=True)),
        piece(0.7, shaft),
        spin=jr.ConstantSpeed(1.0),
    )
    return np.asarray(jr.unbalance_response(scene, SPEEDS, SENSORS).forward)


def trial_runs(shaft=0.0):
    return np.stack([vibration((TRIALS[0], 0.0), shaft), vibration((0.0, TRIALS[1]), shaft)])


def test_balancing_finds_the_unbalance_and_removes_all_vibration():
    base = vibration()
    influence = jr.influence_coefficients(base, TRIALS, trial_runs())
    assert influence.shape == (2, 3, 2)  # speeds, sensors, planes
    corrections = np.asarray(jr.correction_masses(influence, base))
    np.testing.assert_allclose(corrections, -np.array(OWN), rtol=1e-8)
    assert np.abs(vibration(corrections)).max() < 1e-9 * np.abs(base).max()


def test_two_planes_quiet_two_sensors_at_one_speed_whatever_is_unbalanced():
    base, tried = vibration(shaft=SHAFT), trial_runs(shaft=SHAFT)
    seen = np.s_[0, [0, 2]]  # first speed, sensors at the discs
    influence = jr.influence_coefficients(base, TRIALS, tried)[seen]
    corrections = np.asarray(jr.correction_masses(influence, base[seen]))
    after = vibration(corrections, shaft=SHAFT)
    assert np.abs(after[seen]).max() < 1e-9 * np.abs(base[seen]).max()
    assert np.abs(after[1]).max() > 1e-3 * np.abs(base[1]).max()  # at the other speed it does not


def test_more_readings_than_planes_are_met_by_least_squares():
    a = RANDOM.normal(size=(2, 3, 2)) + 1j * RANDOM.normal(size=(2, 3, 2))
    v = RANDOM.normal(size=(2, 3)) + 1j * RANDOM.normal(size=(2, 3))
    weights = RANDOM.uniform(0.1, 3.0, (2, 3))
    plain = np.linalg.lstsq(a.reshape(6, 2), -v.ravel())[0]
    np.testing.assert_allclose(jr.correction_masses(a, v), plain, rtol=1e-12)
    root = np.sqrt(weights.ravel())
    weighted = np.linalg.lstsq(root[:, None] * a.reshape(6, 2), -root * v.ravel())[0]
    np.testing.assert_allclose(jr.correction_masses(a, v, weights), weighted, rtol=1e-12)
    only = np.zeros((2, 3))
    only[0, :2] = 1  # as many readings as planes: these two vanish
    left = v + a @ np.asarray(jr.correction_masses(a, v, only))
    assert np.abs(left[0, :2]).max() < 1e-13


def test_corrections_are_differentiable_and_map():
    a = jnp.asarray(RANDOM.normal(size=(4, 2)) + 1j * RANDOM.normal(size=(4, 2)))
    v = jnp.asarray(RANDOM.normal(size=4) + 1j * RANDOM.normal(size=4))
    size = jax.jit(lambda w: jnp.sum(jnp.abs(jr.correction_masses(a, v, w)) ** 2))
    weights = jnp.asarray([1.0, 2.0, 0.5, 1.5])
    for i, value in enumerate(jax.grad(size)(weights)):
        step = 1e-6 * jnp.eye(4)[i]
        change = (size(weights + step) - size(weights - step)) / 2e-6
        np.testing.assert_allclose(value, change, rtol=1e-6, atol=1e-9)
    many = jax.vmap(lambda v: jr.correction_masses(a, v))(jnp.stack([v, 3 * v]))
    np.testing.assert_allclose(many[1], 3 * many[0], rtol=1e-12)


def test_influence_coefficients_by_hand():
    found = jr.influence_coefficients(np.array([1 + 1j]), np.array([2j]), np.array([[5 - 1j]]))
    np.testing.assert_allclose(found, [[(4 - 2j) / 2j]], rtol=1e-15)


ONE = np.ones((2, 2))
REFUSED = [
    (
        lambda: jr.influence_coefficients(ONE, TRIALS, ONE),
        r"one run of the shape of `base` per trial",
    ),
    (
        lambda: jr.influence_coefficients(ONE[0], np.array([1.0, 0.0]), ONE),
        r"`trials \[kg m\]` must not be zero",
    ),
    (lambda: jr.correction_masses(ONE, np.ones(3)), r"`influence` must have the shape of"),
    (
        lambda: jr.correction_masses(np.ones((1, 2)), np.ones(1)),
        "1 readings do not determine 2 planes",
    ),
    (lambda: jr.correction_masses(ONE, np.ones(2)), "do not distinguish the planes"),
    (
        lambda: jr.correction_masses(np.eye(2), np.ones(2), np.array([1.0, -2.0])),
        "`weights` must not be negative, but the smallest is -2.",
    ),
]


@pytest.mark.parametrize(("call", "message"), REFUSED, ids=[text[:20] for _, text in REFUSED])
def test_balancing_refuses_in_one_sentence(call, message):
    with pytest.raises(ValueError, match=message):
        call()


# === the standard


def test_permissible_unbalance():
    """A rotor of 3600 kg at 3000/min in G 2.5: e = 7.96 um, U = 28.6e3 g mm."""
    found = jr.permissible_unbalance(2.5, 3600.0, 3000 * np.pi / 30)
    np.testing.assert_allclose(found, 3600 * 2.5e-3 / (100 * np.pi), rtol=1e-15)
    assert round(float(found) * 1e6 / 1e3, 1) == 28.6
    assert found == jr.permissible_unbalance(2.5, 3600.0, -3000 * np.pi / 30)
    for bad, message in (
        ((0.0, 1.0, 1.0), r"`grade \[mm/s\]` must be positive, but is 0."),
        ((1.0, -1.0, 1.0), r"`mass \[kg\]` must be positive, but is -1."),
        ((1.0, 1.0, 0.0), r"`speed \[rad/s\]` must not be zero, but is 0."),
    ):
        with pytest.raises(ValueError, match=message):
            jr.permissible_unbalance(*bad)


@pytest.mark.parametrize(
    ("centre", "shares"),
    [
        (1.5, (0.5, 0.5)),
        (1.4, (0.6, 0.4)),
        (1.9, (0.3, 0.7)),  # 0.1 and 0.9
        (1.0, (0.7, 0.3)),
        (2.2, (0.3, 1.2)),  # overhung: 0.2 and 1.2
        (0.5, (1.3, 0.5)),  # 1.5 and 0.5
    ],
)
def test_allocation_by_the_lever_within_limits(centre, shares):
    found = jr.allocated_unbalance(0.02, centre, np.array([1.0, 2.0]))
    np.testing.assert_allclose(found, 0.02 * np.array(shares), rtol=1e-14)
    turned = jr.allocated_unbalance(0.02, centre, np.array([2.0, 1.0]))
    np.testing.assert_allclose(turned, found[::-1], rtol=1e-14)


def test_allocation_needs_two_bearings():
    with pytest.raises(ValueError, match="must be two different stations, but both are 1."):
        jr.allocated_unbalance(0.02, 1.5, np.array([1.0, 1.0]))


GRADES = [0.4, 1, 2.5, 6.3, 16, 40, 100, 250, 630, 1600, 4000]


@pytest.mark.parametrize("grade", GRADES)
def test_what_is_permitted_is_of_that_grade(grade):
    permitted = jr.permissible_unbalance(grade, 7.3, 123.4)
    found = jr.balance_grade(permitted * np.exp(0.3j), 7.3, -123.4)
    np.testing.assert_allclose(found.value, grade, rtol=1e-14)
    assert found.standard == grade
    above = [*GRADES, np.inf][GRADES.index(grade) + 1]
    assert jr.balance_grade(1.001 * permitted, 7.3, 123.4).standard == above


def test_a_balanced_rotor_is_of_the_finest_grade():
    found = jr.balance_grade(0.0, 7.3, 123.4)
    assert found.value == 0 and found.standard == 0.4
    slope = jax.grad(lambda u: jr.balance_grade(u, 2.0, 100.0).value)(1e-5)
    np.testing.assert_allclose(slope, 1e3 * 100 / 2, rtol=1e-14)


@pytest.mark.parametrize(("u", "j"), [(2e-3 + 1e-3j, 0.0), (0.0, 1e-3j), (1e-3, -2e-3)])
def test_grade_by_what_each_bearing_is_allotted(u, j):
    """The grade equals a direct calculation, and at the limit the share of `allocated_unbalance`."""
    bearings, centre, mass, speed = np.array([0.2, 1.0]), 0.5, 7.3, 123.4
    loads = np.abs(np.linalg.solve([[1, 1], bearings], [u, j]))
    by_hand = max(loads / [0.625, 0.375]) * speed / mass * 1e3
    found = jr.bearing_grade(u, j, mass, centre, bearings, speed)
    np.testing.assert_allclose(found.value, by_hand, rtol=1e-12)
    total = jr.permissible_unbalance(found.value, mass, speed)
    permitted = np.asarray(jr.allocated_unbalance(total, centre, bearings))
    np.testing.assert_allclose(max(loads / permitted), 1, rtol=1e-12)


# === scenes


@pytest.mark.slow
def test_where_a_rotor_is_held_and_heavy():
    shaft = jr.FlexibleShaft(
        0.6, 0.02, constraints=(jr.Constraint(0.5), jr.Constraint(0.1, "guide"))
    )
    rotor = jr.Scene(
        shaft,
        jr.Disc(0.2, 4.0),
        jr.Support(0.6, 0.0, angular_stiffness=1.0),
        jr.Support(0.2, 1e6),
        spin=jr.ConstantSpeed(1.0),
    )
    np.testing.assert_allclose(jr.bearing_stations(rotor), [0.2, 0.5])
    steel = 7850 * np.pi * 0.02**2 / 4 * 0.6
    np.testing.assert_allclose(
        jr.centre_of_mass(rotor), (0.8 + 0.3 * steel) / (4 + steel), rtol=1e-12
    )
    massless = jr.Scene(
        jr.MasslessShaft(0.4, 0.2, 1e4), jr.Disc(0.2, 1.0), spin=jr.ConstantSpeed(1.0)
    )
    np.testing.assert_allclose(jr.bearing_stations(massless), [0.0, 0.4])


def test_first_moments_of_a_scene():
    """A scene with offset, unbalance and a tilted disc; its steel shaft (20 mm, 0.5 m) has 1.233 kg."""
    scene = jr.Scene(
        jr.FlexibleShaft(length=0.5, diameter=0.02, constraints=[jr.Constraint(0.0, "clamp")]),
        jr.Disc(0.2, 3.0, 0.01, 0.04, offset=1e-3, offset_angle=0.7),
        jr.Disc(0.3, 2.0, 0.02, 0.05, tilt=0.01, tilt_axis=0.4, exact=False),
        jr.Unbalance(0.4, 1.0, 5e-4, phase=-1.0),
        spin=jr.ConstantSpeed(100.0),
    )
    one, two = 3e-3 * np.exp(0.7j), 5e-4 * np.exp(-1j)
    found = jr.first_moments(scene)
    assert complex(found.unbalance) == pytest.approx(one + two, rel=1e-12)
    couple = 1j * (0.05 - 0.02) * 0.01 * np.exp(0.4j)
    assert complex(found.product) == pytest.approx(0.2 * one + 0.4 * two + couple, rel=1e-12)
    steel = 7850 * np.pi * 0.02**2 / 4 * 0.5
    assert float(jr.total_mass(scene)) == pytest.approx(5.0 + steel, rel=1e-12)


@pytest.mark.slow
def test_first_moments_of_a_true_rotor():
    scene = jr.Scene(jr.MasslessShaft(0.4, 0.2, 1e4), jr.Disc(0.2, 1.0), spin=jr.ConstantSpeed(1.0))
    assert [complex(one) for one in jr.first_moments(scene)] == [0, 0]
