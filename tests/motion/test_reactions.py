"""Bearing reactions against the sheet of the worked example: its numbers, point masses, statics, beams.

Reference numbers are those of section 3 of the sheet; hard cases those of its section 4.
"""

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxrotor as jr


P = jr.Constraint
A, B = 0.093, 0.36  # bearings; the paper's z is measured from A
ZB = B - A
INERTIA = 2.2354
DRIVE = {"torque": 1950.0, "slope": 1.57, "drag": 0.039}
STEADY = 204.382695814

# t, omega, eps, X_A, Y_A, X_B, Y_B, R_A, R_B of section 3.3
TABLE = np.array(
    [
        [float(cell) for cell in line.split()]
        for line in """
0.00 600.0000000 -5829.829113 12510.9222 -2544.8228 -16787.1049 3742.5188 12767.1178 17199.2249
0.02 504.3056223 -3918.941619 8836.8934 -1804.7165 -11857.1261 2653.1952 9019.2952 12150.3450
0.04 438.1651545 -2784.950656 6669.6264 -1368.3825 -8948.9826 2010.9475 6808.5525 9172.1426
0.06 390.2296553 -2058.490082 5288.9825 -1090.5661 -7096.3643 1602.0061 5400.2473 7274.9440
0.08 354.2807596 -1566.296950 4358.4052 -903.4056 -5847.6659 1326.4972 4451.0490 5996.2314
0.10 326.6244689 -1218.331672 3703.6406 -771.7774 -4969.0663 1132.7270 3783.1989 5096.5371
0.12 304.9273902 -964.026045 3227.1849 -676.0348 -4329.7305 991.7790 3297.2330 4441.8680
0.14 287.6426786 -773.191875 2871.0447 -604.4964 -3851.8402 886.4600 2933.9928 3952.5288
0.16 273.7042059 -626.895098 2598.9801 -549.8650 -3486.7672 806.0292 2656.5107 3578.7189
0.18 262.3532918 -512.765235 2387.4008 -507.3923 -3202.8567 743.4973 2440.7231 3288.0205
0.20 253.0354659 -422.437422 2220.4126 -473.8799 -2978.7812 694.1565 2270.4172 3058.5929
0.22 245.3363078 -350.086900 2086.9876 -447.1098 -2799.7428 654.7414 2134.3440 2875.2819
0.24 238.9401198 -291.553566 1979.2769 -425.5034 -2655.2093 622.9288 2024.4975 2727.3021
0.26 233.6024701 -243.799913 1891.5689 -407.9129 -2537.5169 597.0285 1935.0519 2606.8055
0.28 229.1314533 -204.564765 1819.6259 -393.4865 -2440.9788 575.7868 1861.6848 2507.9689
0.30 225.3745909 -172.135927 1760.2489 -381.5815 -2361.3026 558.2576 1801.1332 2426.3968
0.32 222.2094790 -145.197250 1710.9861 -371.7057 -2295.1983 543.7159 1750.8965 2358.7205
0.34 219.5369827 -122.723471 1669.9328 -363.4766 -2240.1101 531.5987 1709.0321 2302.3229
0.36 217.2761978 -103.906473 1635.5917 -356.5935 -2194.0288 521.4636 1674.0128 2255.1467
0.38 215.3606638 -88.102642 1606.7730 -350.8178 -2155.3578 512.9589 1644.6253 2215.5573
0.40 213.7354748 -74.794654 1582.5225 -345.9579 -2122.8167 505.8028 1619.8964 2182.2437
0.42 212.3550502 -63.563324 1562.0685 -341.8592 -2095.3701 499.7673 1599.0390 2154.1456
0.44 211.1813915 -54.066569 1544.7824 -338.3954 -2072.1744 494.6669 1581.4120 2130.3995
0.46 210.1827071 -46.023483 1530.1488 -335.4632 -2052.5380 490.3493 1566.4900 2110.2973
0.48 209.3323160 -39.202137 1517.7428 -332.9775 -2035.8907 486.6890 1553.8395 2093.2551
1e3 204.3826958 0 1446.5328 -318.7114 -1940.3359 465.6816 1481.2272 1995.4354
""".strip().splitlines()
    ]
)
TIMES = TABLE[:, 0]


def rotor(exact=False, **drive):
    """The rotor of the worked example."""
    return jr.Scene(
        jr.RigidShaft(0.453, (P(A), P(B))),
        jr.Disc.thin(A + 0.133, 47, 0.17, offset=4e-4, offset_angle=0.68 - np.pi / 2, exact=exact),
        jr.Disc.thin(0.453, 57, 0.2, tilt=0.019, tilt_axis=-np.pi / 2, exact=exact),
        jr.Disc.thin(0.0, 37, 0.15, offset=3e-4, offset_angle=np.pi / 2, exact=exact),
        spin=jr.Drive(**({"speed": 600.0} | DRIVE | drive)),
    )


def forces(scene, times, **options):
    run = jr.run_up(scene, np.asarray(times), **options)
    return run, jr.reactions(run)


def printed(found, expected, digits):
    """Equal to one unit of the last digit given."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=1.001 * 10.0**-digits)


@pytest.fixture(scope="module")
def worked():
    return forces(jr.load("turbine-run-up"), TIMES)


# === 3.1 to 3.3


@pytest.mark.hard("4.11 squares of the offsets, with and without")
def test_mass_and_inertia():
    linear = jr.mass_properties(jr.load("turbine-run-up"), A)
    exact = jr.mass_properties(rotor(exact=True), A)
    for both in (linear, exact):
        assert both.mass == 141
        printed(both.centre[:2], [8.3839070e-5, -2.4952958e-5], 12)
        printed(both.centre[2] - A, 0.165460993, 9)
        printed(both.tensor[0, 1], 3.6767709e-6, 13)
        printed(both.tensor[1, 1], 9.65629897, 8)
        printed([both.unbalance.real, both.unbalance.imag], [1.1821309e-2, -3.5183671e-3], 9)
        printed(both.product.imag, -2.9765428e-3, 10)
        np.testing.assert_allclose(both.tensor, both.tensor.T)
        np.testing.assert_allclose(both.tensor[0, 2], -both.product.real)
        np.testing.assert_allclose(both.tensor[1, 2], -both.product.imag)
    printed([linear.tensor[0, 0], exact.tensor[0, 0]], [9.65630388, 9.65650962], 8)
    printed([linear.tensor[2, 2], exact.tensor[2, 2]], [2.2354000000, 2.2352051048], 10)
    printed([linear.product.real, exact.product.real], [1.2402234e-2, 1.2399628e-2], 9)
    arm = linear.product / ZB
    printed([arm.real, arm.imag], [0.0464503149, -0.0111481005], 10)
    rest = linear.unbalance - arm
    printed([rest.real, rest.imag], [-0.0346290060, 0.0076297334], 10)


@pytest.mark.hard("4.1 sign of the products of inertia")
def test_inertia_of_discs_out_of_true_is_that_of_point_masses():
    scene = crooked()
    found = jr.mass_properties(scene, 0.2)
    m, r = point_masses(scene)
    r = r - [0, 0, 0.2]
    tensor = np.einsum(
        "k,kij->ij", m, np.eye(3) * (r**2).sum(1)[:, None, None] - r[:, :, None] * r[:, None]
    )
    np.testing.assert_allclose(found.tensor, tensor, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.mass, m.sum(), rtol=1e-13)
    np.testing.assert_allclose(found.centre - np.array([0, 0, 0.2]), m @ r / m.sum(), atol=1e-14)
    np.testing.assert_allclose(found.unbalance, m @ (r[:, 0] + 1j * r[:, 1]), rtol=1e-12)
    np.testing.assert_allclose(found.product, (m * r[:, 2]) @ (r[:, 0] + 1j * r[:, 1]), rtol=1e-12)


def test_mass_properties_refuses():
    with pytest.raises(ValueError, match="is for a RigidShaft"):
        jr.mass_properties(jr.load("limiter-rotor"))
    with pytest.raises(ValueError, match="put a disc on it"):
        jr.mass_properties(jr.Scene(jr.RigidShaft(1.0), spin=jr.ConstantSpeed(1.0)))


def test_speed(worked):
    run, _ = worked
    printed(run.speed[-1], STEADY, 9)
    polar = jr.assemble(rotor()).blocks.polar
    printed(jr.relaxation_rate(polar, *DRIVE.values()), 7.833877728, 9)
    printed(jr.relaxation_rate(polar, *DRIVE.values()) * polar, 17.511850273, 9)  # D
    printed(run.angle[8], 60.68796105, 8)
    printed(run.angle[24], 133.69098650, 8)


def test_reactions_of_the_table(worked):
    _, found = worked
    assert found.names == ("constraints.0", "constraints.1")
    parts = np.stack([found.rotating.real, found.rotating.imag], axis=-1).reshape(len(TIMES), 4)
    printed(parts, TABLE[:, 3:7], 4)
    printed(np.abs(found.force), TABLE[:, 7:], 4)
    assert not np.any(found.moment) and not np.any(found.static)


@pytest.mark.hard("4.2 ratio and angle of the reactions stay")
@pytest.mark.hard("4.13 fixed axes turn by the angle, not by speed times time")
def test_reactions_keep_ratio_and_angle(worked):
    _, found = worked
    first, second = found.rotating.T
    printed(np.abs(first / second), 0.742307744, 9)
    printed(np.degrees(np.angle(second / first)), 178.929570484, 9)
    printed(np.degrees(np.angle(first[8])), -11.945882, 6)
    printed(np.degrees(np.angle(second[8])), 166.983689, 6)
    fixed = found.force[8]  # turned by the angle reached, 60.7 rad (hard case 13)
    printed(fixed.real, [-1871.271006, 2567.896814], 6)
    printed(fixed.imag, [-1885.575275, 2492.616045], 6)
    np.testing.assert_allclose(found.dynamic, found.force)


def test_exact_wheels():
    _, found = forces(rotor(exact=True), [0.0, 1e3])
    printed(np.abs(found.force[1]), [1480.828993, 1995.038962], 6)


def test_coefficients_as_the_course_rounded_them():
    """Two unbalances that amount to its u and J; and its wrong sign of Y_B (erratum 4)."""
    u, product = 0.0118 - 0.0036j, 0.0124 - 0.003j
    pair = (u - product / ZB, A), (product / ZB, B)
    weights = [jr.Unbalance(at, 1.0, abs(part), np.angle(part)) for part, at in pair]
    spin = jr.Drive(speed=600.0, polar=2.24, **DRIVE)
    run, found = forces(jr.Scene(jr.RigidShaft(0.453, (P(A), P(B))), *weights, spin=spin), [0, 1e3])
    printed(run.acceleration[0], -5817.857143, 6)
    printed(np.abs(found.force), [[12772.143, 17203.697], [1481.811, 1995.955]], 3)
    first, second = found.rotating.T
    printed(np.abs(first + 2j * second.imag), [13478.108, 1574.195], 3)


# === 3.4: the integrators


class RK4(dfx.AbstractERK):
    """Classical, of order 4; its estimate of the error is not used."""

    tableau = dfx.ButcherTableau(
        a_lower=(np.array([0.5]), np.array([0.0, 0.5]), np.array([0.0, 0.0, 1.0])),
        b_sol=np.array([1, 2, 2, 1]) / 6,
        b_error=np.array([1, 2, 2, 1]) / 6 - np.array([1.0, 0, 0, 0]),
        c=np.array([0.5, 0.5, 1.0]),
    )
    interpolation_cls = dfx.ThirdOrderHermitePolynomialInterpolation.from_k

    def order(self, terms):
        return 4


@pytest.mark.slow
def test_euler_at_the_step_of_the_course(worked):
    exact, right = worked
    run, found = forces(jr.load("turbine-run-up"), TIMES[:-1], solver=dfx.Euler())
    rows = np.array([1, 2, 3, 8, 24])
    printed(run.speed[rows], [483.403418, 412.521973, 364.794853, 258.897912, 207.522765], 6)
    error = np.abs(run.speed / exact.speed[:-1] - 1)
    assert np.round(np.max(error), 4) == 0.0666
    shares = np.abs(found.force) / np.abs(right.force[:-1]) - 1
    np.testing.assert_array_equal(np.round(np.max(np.abs(shares), axis=0), 3), 0.129)
    rounded, _ = forces(rotor(polar=2.24), TIMES[:-1], solver=dfx.Euler())
    printed(rounded.speed[rows], [483.642857, 412.822987, 365.103148, 259.105752, 207.552886], 6)


@pytest.mark.slow
def test_orders_of_integrators():
    """Errors at t = 0.16 of 8 and 64 steps; RK4 with the course's 24 steps."""
    times, exact = np.array([0.0, 0.16]), 273.704205856

    def error(count, solver):
        steps = dfx.StepTo(ts=np.linspace(0, 0.16, count + 1))
        run = jr.run_up(rotor(), times, solver=solver, controller=steps)
        return float(run.speed[1]) - exact

    counts = np.array([8, 64])
    euler = np.array(
        [
            float(jr.run_up(rotor(), times, solver=dfx.Euler(), substeps=int(n)).speed[1]) - exact
            for n in counts
        ]
    )
    np.testing.assert_allclose(euler, [-14.8, -1.76], rtol=4e-3)
    fourth = np.array([error(n, RK4()) for n in counts])
    np.testing.assert_allclose(np.abs(fourth), [3.6e-3, 7.9e-7], rtol=2.5e-2)
    slope = lambda errors: np.log(errors[0] / errors[1]) / np.log(8)
    assert abs(slope(euler) - 1) < 0.05 and abs(slope(fourth) - 4) < 0.1


@pytest.mark.slow
def test_rk4_with_the_steps_of_the_course(worked):
    steps = dfx.StepTo(ts=TIMES[:-1])
    run = jr.run_up(rotor(), TIMES[:-1], solver=RK4(), controller=steps)
    most = np.max(np.abs(run.speed / worked[0].speed[:-1] - 1))
    assert np.round(most, 6) == 2.0e-5


# === 3.5, 3.6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("drive", "speed"),
    [
        ({"drag": 0.0}, 668.2420602522),
        ({"slope": 0.0}, 291.1107768288),
        ({"torque": 0.0, "slope": 0.0}, 224.3101314513),
        ({"speed": 0.0}, 117.9015589611),
        ({"torque": -(1.57**2) / (4 * 0.039)}, 206.9372477372),
    ],
)
def test_special_cases_of_the_drive(drive, speed):
    """The integrated speed and the reactions that belong to it; one program for all numbers."""
    scene = jr.load("turbine-run-up").replace({f"spin.{name}": x for name, x in drive.items()})
    run, found = forces(scene, TIMES[:2] * 8)
    printed(run.speed[1], speed, 9)
    free = jr.run_up(scene, TIMES[:2] * 8, solver=dfx.Dopri8())
    np.testing.assert_allclose(free.speed[1], speed, rtol=1e-7)
    size = np.hypot(run.acceleration, run.speed**2)
    arms = np.abs([-0.0346290060 + 0.0076297334j, 0.0464503149 - 0.0111481005j])
    np.testing.assert_allclose(np.abs(found.force), np.outer(size, arms), rtol=3e-9)


def test_drives_without_slope_or_drag():
    """None is zero: Omega_0 + M0 t / I."""
    run = jr.run_up(rotor(slope=None, drag=None), TIMES[:2] * 8)
    printed(run.speed[1], 739.5723360472, 9)


@pytest.mark.hard("4.9 a tilt that is not small")
@pytest.mark.parametrize(
    ("tilt", "product", "digits"),
    [
        (0.019, 2.4e-4, 5),
        (0.05, 1.7e-3, 4),
        (0.1, 6.7e-3, 4),
        (0.2, 2.7e-2, 3),
        (0.5, 0.19, 2),
        (np.pi / 4, 0.57, 2),
    ],
)
def test_error_of_a_small_tilt(tilt, product, digits):
    def of(exact):
        disc = jr.Disc.thin(0.5, 2.0, 0.3, tilt=tilt, exact=exact)
        return jr.mass_properties(jr.Scene(jr.RigidShaft(1.0), disc, spin=jr.ConstantSpeed(1.0)))

    first, exact = of(False), of(True)
    share = float(abs(first.product / exact.product)) - 1
    assert round(share, digits) == product
    polar = float(first.tensor[2, 2] / exact.tensor[2, 2]) - 1
    known = {0.019: (1.8e-4, 5), np.pi / 4: (0.33, 2)}
    if tilt in known:
        assert round(polar, known[tilt][1]) == known[tilt][0]
    upright = jr.Disc.thin(0.5, 2.0, 0.3, tilt=np.pi / 2)
    scene = jr.Scene(jr.RigidShaft(1.0), upright, spin=jr.ConstantSpeed(1.0))
    assert abs(jr.mass_properties(scene).product) < 1e-16


# === point masses


def crooked(**drive):
    """Four wheels off centre and leaning every way, some far; between, outside and on bearings."""
    discs = [
        jr.Disc.thin(at, mass, radius, offset=e, offset_angle=beta, tilt=tilt, tilt_axis=axis)
        for at, mass, radius, e, beta, tilt, axis in (
            (0.0, 3.0, 0.2, 0.01, 0.4, 0.3, 2.0),
            (0.1, 5.0, 0.1, 0.03, 2.4, -0.5, 0.3),
            (0.3, 2.0, 0.3, 0.002, -1.4, 0.9, -2.5),
            (0.7, 4.0, 0.25, 0.02, 5.4, 0.1, 1.0),
        )
    ]
    spin = jr.Drive(**({"speed": 50.0, "torque": 30.0, "slope": 0.2, "drag": 1e-3} | drive))
    return jr.Scene(jr.RigidShaft(0.7, (P(0.1), P(0.5))), *discs, spin=spin)


def point_masses(scene):
    """Masses (k,) and places (k, 3): a thin disc has the inertia of a ring of R / sqrt 2."""
    masses, places = [], []
    turns = 2 * np.pi * np.arange(7) / 7
    for disc in scene.of(jr.Disc):
        radius = np.sqrt(2 * float(disc.polar) / float(disc.mass)) / np.sqrt(2)
        ring = radius * np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
        axis = np.array([np.cos(disc.tilt_axis), np.sin(disc.tilt_axis), 0])
        c, s = np.cos(float(disc.tilt)), np.sin(float(disc.tilt))
        leaning = (
            c * ring + s * np.cross(axis, ring) + (1 - c) * np.outer(ring @ axis, axis)
        )  # Rodrigues
        angle = float(disc.offset_angle)
        centre = np.array([np.cos(angle), np.sin(angle), 0]) * float(disc.offset)
        places.append(leaning + centre + [0, 0, float(disc.at)])
        masses.append(np.full(7, float(disc.mass) / 7))
    return np.concatenate(masses), np.concatenate(places)


def newton(scene, turning, bearings):
    """Sum of m a of all points in fixed axes, and its moment, shared by two bearings."""
    m, r = point_masses(scene)
    angle, speed, acceleration = (np.asarray(part)[:, None] for part in turning)
    path = (r[:, 0] + 1j * r[:, 1]) * np.exp(1j * angle)
    push = m * (1j * acceleration - speed**2) * path
    a, b = bearings
    second = np.sum(push * (r[:, 2] - a), axis=1) / (b - a)
    return np.stack([push.sum(1) - second, second], axis=1)


def test_reactions_are_those_of_point_masses():
    scene = crooked()
    run, found = forces(scene, np.linspace(0, 1, 7))
    expected = newton(scene, (run.angle, run.speed, run.acceleration), (0.1, 0.5))
    np.testing.assert_allclose(found.force, expected, rtol=0, atol=2e-14 * np.max(np.abs(expected)))


def test_clamp_takes_force_and_moment():
    scene = crooked()
    clamped = jr.Scene(jr.RigidShaft(0.7, (P(0.3, "clamp"),)), *scene.effects, spin=scene.spin)
    run, found = forces(clamped, [0.0, 0.3])
    m, r = point_masses(scene)
    arm = (r[:, 0] + 1j * r[:, 1]) * np.exp(1j * np.asarray(run.angle))[:, None]
    push = m * (1j * run.acceleration - run.speed**2)[:, None] * arm
    np.testing.assert_allclose(found.force[:, 0], push.sum(1), rtol=1e-12)
    np.testing.assert_allclose(found.moment[:, 0], np.sum(push * (r[:, 2] - 0.3), 1), rtol=1e-12)


def test_guide_and_pin_share_force_and_moment():
    scene = crooked()
    held = (P(0.3), P(0.6, "guide"))
    run, found = forces(
        jr.Scene(jr.RigidShaft(0.7, held), *scene.effects, spin=scene.spin), [0, 0.3]
    )
    m, r = point_masses(scene)
    arm = (r[:, 0] + 1j * r[:, 1]) * np.exp(1j * np.asarray(run.angle))[:, None]
    push = m * (1j * run.acceleration - run.speed**2)[:, None] * arm
    np.testing.assert_allclose(found.force[:, 0], push.sum(1), rtol=1e-12)
    np.testing.assert_allclose(found.moment[:, 1], np.sum(push * (r[:, 2] - 0.3), 1), rtol=1e-12)
    assert not np.any(found.moment[:, 0]) and not np.any(found.force[:, 1])


# === hard cases


def one_wheel(at, bearing=0.4, e=1e-3, tilt=None, **spin):
    disc = jr.Disc.thin(at, 10.0, 0.2, offset=e, tilt=tilt, tilt_axis=-np.pi / 2)
    shaft = jr.RigidShaft(1.0, (P(0.2), P(bearing)))
    spin = jr.Drive(**({"speed": 0.0} | DRIVE | spin)) if spin else jr.ConstantSpeed(100.0)
    return jr.Scene(shaft, disc, spin=spin)


@pytest.mark.hard("4.1 sign of the products of inertia")
def test_wheel_at_constant_speed_is_pulled_to_the_axis():
    """Case 1."""
    _, found = forces(one_wheel(0.3), [0.0, 0.1])
    np.testing.assert_allclose(found.rotating[0], [-50, -50], rtol=1e-12)


@pytest.mark.hard("4.3 reactions at once on starting from rest")
def test_starting_from_rest():
    """Case 3: reactions begin at once, a quarter turn from the later ones."""
    run, found = forces(rotor(speed=0.0), [0.0, 1e3])
    arms = np.abs([-0.0346290060 + 0.0076297334j, 0.0464503149 - 0.0111481005j])
    np.testing.assert_allclose(np.abs(found.force[0]), arms * 1950 / INERTIA, rtol=1e-8)
    turned = np.angle(found.rotating[1] / found.rotating[0])
    np.testing.assert_allclose(np.abs(turned), np.pi / 2, rtol=1e-12)


@pytest.mark.hard("4.4 coast-down never ends")
def test_coast_down_never_ends():
    """Case 4."""
    run = jr.run_up(rotor(torque=0.0), [0.0, 100.0])
    assert 0 < run.speed[1] < 1e-25
    run = jr.run_up(rotor(torque=0.0, slope=0.0), np.array([0.0, 100.0]))
    assert 0.5 < run.speed[1] < 0.6  # as 1 / t


@pytest.mark.slow
@pytest.mark.hard("4.4 braked to a stop")
def test_a_rotor_that_has_stopped_loads_no_bearing():
    """Case 4: without weight."""
    run, found = forces(rotor(torque=-100.0, stops=True), [0.0, 1.0, 1.4, 5.0])
    printed(run.stopped, 1.3411738400, 7)
    assert np.all(found.force[2:] == 0) and np.all(found.force[:2] != 0)
    with pytest.raises(ValueError, match="needs steps that end there"):
        jr.run_up(rotor(stops=True), [0.0, 1.0], solver=dfx.Euler())


@pytest.mark.slow
@pytest.mark.hard("4.5 no drag, no slope, no torque, D = 0, D^2 < 0")
def test_derivatives_where_the_formula_degenerates():
    """Case 5: D = 0."""
    scene = rotor(torque=-(1.57**2) / (4 * 0.039))
    paths = ("spin.torque", "spin.slope", "spin.drag")

    def reaction(values):
        changed = scene.replace(dict(zip(paths, values, strict=True)))
        run = jr.run_up(changed, np.array([0.0, 0.16]))
        return jnp.abs(jr.reactions(run).force[1])

    both = jax.jit(lambda values, along: jax.jvp(reaction, (values,), (along,)))
    values = np.array([float(scene.get(path)) for path in paths])
    for value, along in zip(values, np.eye(3), strict=True):
        h = 1e-4 * abs(value)
        found = both(values, along)[1]
        central = (both(values + h * along, along)[0] - both(values - h * along, along)[0]) / (
            2 * h
        )
        assert np.all(np.isfinite(found)) and np.all(found != 0)
        np.testing.assert_allclose(found, central, rtol=1e-6)


@pytest.mark.hard("4.6 the angle as drag vanishes")
def test_angle_with_little_drag():
    """Case 6."""
    (none, least), times = (rotor(drag=d) for d in (None, 1e-13)), [0.0, 0.5, 50.0]
    angle = [jr.run_up(scene, times).angle for scene in (none, least)]
    rate = 1.57 / INERTIA
    t, gap = np.array(times), 600 - 1950 / 1.57
    exact = 1950 / 1.57 * t + gap * (1 - np.exp(-rate * t)) / rate
    np.testing.assert_allclose(angle, [exact, exact], rtol=1e-9)


@pytest.mark.hard("4.8 at the steady speed")
@pytest.mark.parametrize("start", [STEADY, STEADY * (1 + 1e-9)])
def test_start_at_the_steady_speed(start):
    """Case 8."""
    run, found = forces(rotor(speed=start), [0.0, 0.2, 3.0])
    printed(np.abs(found.force), [[1481.2272, 1995.4354]] * 3, 4)
    expected = -7.833877728 * (start - 204.38269581386) * np.exp(-7.833877728 * run.time)
    np.testing.assert_allclose(run.acceleration, expected, rtol=1e-4, atol=5e-9)


@pytest.mark.hard("4.10 both bearings at one place", outcome="refused")
def test_bearings_at_one_place_are_refused():
    """Case 10."""
    with pytest.raises(ValueError, match=r"Both constraints are at 0\.2 m; put the bearings apart"):
        one_wheel(0.3, bearing=0.2)


@pytest.mark.hard("4.10 overhung wheels")
@pytest.mark.parametrize("at", [0.0, 0.2, 0.3, 0.4, 0.9])
def test_wheels_anywhere(at):
    """Case 10: an overhung wheel reverses the far bearing."""
    _, found = forces(one_wheel(at), [0.0, 0.1])
    total, share = -10 * 1e-3 * 1e4, (at - 0.2) / 0.2
    np.testing.assert_allclose(found.rotating[0], [total * (1 - share), total * share], atol=1e-11)


@pytest.mark.slow
@pytest.mark.hard("4.12 balanced: no reaction, no NaN")
def test_balanced_rotor_loads_no_bearing():
    """Case 12: nothing, and no NaN."""
    straight = jr.Scene(
        jr.RigidShaft(1.0, (P(0.2), P(0.8))), jr.Disc.thin(0.5, 10.0, 0.2), spin=rotor().spin
    )
    null = one_wheel(0.3, e=0.0, tilt=0.0, speed=0.0)
    for scene in (straight, null):
        _, found = forces(scene, [0.0, 0.3])
        assert np.all(found.force == 0) and np.all(found.dynamic == 0)
    slope = jax.jacfwd(
        lambda e: (
            jr.reactions(
                jr.run_up(null.replace({"disc.offset": e}), jnp.array([0.0, 0.3]))
            ).force.real
        )
    )(0.0)
    assert np.all(np.isfinite(slope)) and np.any(slope)


@pytest.mark.hard("4.15 the limit is of the steady speed")
def test_stationary_limit_is_of_the_steady_speed(worked):
    """Case 15: at the end of the run it is 5 % less."""
    force = np.abs(worked[1].force)
    np.testing.assert_allclose(force[-2] / force[-1], 1.049, rtol=1e-3)


# === what nothing holds, and what does not move


def test_a_rotor_on_a_fixed_axis_has_no_whirl():
    """All analyses of whirl refuse it in one sentence."""
    scene = jr.load("turbine-run-up").at_speed(200.0)
    asked = [
        lambda: jr.simulate(scene, 1, 8),
        lambda: jr.roots(scene),
        lambda: jr.modes(scene),
        lambda: jr.critical_speeds(scene, 1),
        lambda: jr.campbell(scene, [50.0, 100.0], 1),
        lambda: jr.unbalance_response(scene, [100.0]),
        lambda: jr.growth_rate(scene),
        lambda: jr.sweep(scene, {"spin.speed": [1.0, 2.0]}, settle=0, keep=1),
    ]
    for ask in asked:
        with pytest.raises(ValueError, match="nothing that moves .* `jaxrotor.reactions`"):
            ask()


def test_a_pivot_under_weight_has_no_static_part():
    """It falls: forces are right, but it has no rest position."""
    disc, pivot = jr.Disc(0.5, 2.0, 0.1, 0.2), jr.RigidShaft(1.0, (P(0.0),))
    scene = jr.Scene(pivot, disc, jr.Gravity(9.81), spin=jr.ConstantSpeed(100.0))
    _, found = forces(scene, [0.0, 0.01])
    assert np.isnan(found.static).all()
    # From rest the mass falls with a = m g l / (I + m l^2) l; the pivot bears the rest.
    falls = 2 * 9.81 * 0.5 / (0.1 + 2 * 0.25) * 0.5
    np.testing.assert_allclose(found.force[0], [2j * (9.81 - falls)], rtol=1e-12)
    for part in ("dynamic", "dynamic_moment", "rotating_dynamic"):
        with pytest.raises(ValueError, match="Nothing elastic holds the rotor against its weight"):
            getattr(found, part)


def test_parts_and_axes_of_forces_and_moments():
    """A clamp under weight: static m g and m g l; dynamic as without weight, turned back by the angle."""
    clamp, disc = jr.RigidShaft(0.7, (P(0.3, "clamp"),)), crooked().effects
    bare = jr.Scene(clamp, *disc, spin=crooked().spin)
    level = jr.Scene(clamp, *disc, jr.Gravity(9.81), spin=crooked().spin)
    (run, found), (_, light) = (forces(scene, [0.0, 0.3]) for scene in (level, bare))
    back = np.exp(-1j * np.asarray(run.angle))[:, None]
    arms = sum(m * (at - 0.3) for at, m in ((0.0, 3), (0.1, 5), (0.3, 2), (0.7, 4)))
    np.testing.assert_allclose(found.static, [14 * 9.81j], rtol=1e-12)
    np.testing.assert_allclose(found.static_moment, [arms * 9.81j], rtol=1e-12)
    for name, one in (("", light.force), ("_moment", light.moment)):
        dynamic, turned = (getattr(found, f"{kind}dynamic{name}") for kind in ("", "rotating_"))
        np.testing.assert_allclose(dynamic, one, rtol=1e-10)
        np.testing.assert_allclose(turned, one * back, rtol=1e-10)
    np.testing.assert_allclose(found.rotating_moment, found.moment * back, rtol=1e-12)


# === weight, supports, flexible shafts


def test_weight_of_a_horizontal_rotor():
    """Static part by moments about a bearing; the dynamic part is that without weight."""
    level = jr.Scene(rotor().shaft, *rotor().effects, jr.Gravity(9.81), spin=rotor().spin)
    _, found = forces(level, TIMES[:9])
    places, masses = np.array([0.133, 0.36, -0.093]), np.array([47, 57, 37])
    second = masses @ places * 9.81 / ZB
    np.testing.assert_allclose(found.static, [1j * (141 * 9.81 - second), 1j * second], rtol=1e-12)
    dynamic = np.abs(found.dynamic)
    printed(dynamic, TABLE[:9, 7:], 4)


@pytest.mark.slow
def test_supports_of_two_stiffnesses():
    """Reactions against x and y integrated apart by scipy; one mass between two like bearings."""
    m, e, speed, k, mu, c = 12.0, 2e-4, 180.0, 4e5, 0.3, 900.0
    sup = lambda at: jr.Support(at, k, c, anisotropy=mu)
    scene = jr.Scene(
        jr.RigidShaft(1.0),
        jr.Disc(0.5, m, 1.0, 0.0, offset=e, offset_angle=0.4),
        *(sup(0.0), sup(1.0), jr.Gravity(9.81)),
        spin=jr.SpeedProfile.ramp(0.0, speed, 0.2),
    )
    times = np.linspace(0, 0.3, 13)
    control = dfx.PIDController(rtol=1e-10, atol=1e-14)
    run, found = forces(scene, times, controller=control, solver=dfx.Dopri8())

    def rate(t, state):
        z, v = state[0] + 1j * state[1], state[2] + 1j * state[3]
        acceleration, omega = (speed / 0.2, speed / 0.2 * t) if t < 0.2 else (0.0, speed)
        angle = speed / 0.4 * t**2 if t < 0.2 else speed * (t - 0.1)
        push = e * np.exp(1j * (angle + 0.4)) * (omega**2 - 1j * acceleration)
        spring = 2 * k * ((1 + mu) * z.real + 1j * (1 - mu) * z.imag) + 2 * c * v
        a = push - spring / m - 9.81j
        return [v.real, v.imag, a.real, a.imag]

    first = solve_ivp(
        rate, (0, 0.2), np.zeros(4), "DOP853", times[times <= 0.2], rtol=1e-12, atol=1e-16
    )
    later = times[times > 0.2]
    second = solve_ivp(rate, (0.2, 0.3), first.y[:, -1], "DOP853", later, rtol=1e-12, atol=1e-16)
    x, y, u, v = np.concatenate([first.y, second.y], axis=1)
    expected = -(k * ((1 + mu) * x + 1j * (1 - mu) * y) + c * (u + 1j * v))
    assert found.names == ("supports.0", "supports.1")
    for j in (0, 1):
        np.testing.assert_allclose(found.force[:, j], expected, rtol=0, atol=1e-7 * m * 9.81)
    np.testing.assert_allclose(found.static, [m * 9.81j / 2] * 2, rtol=1e-12)


def beam(*constraints, length=2.0, discs=()):
    """A steel shaft under its own weight, at rest; its reactions, and its weight per length."""
    shaft = jr.FlexibleShaft(length, 0.05, constraints=constraints, nodes=8)
    scene = jr.Scene(shaft, *discs, jr.Gravity(9.81), spin=jr.ConstantSpeed(0.0))
    found = jr.reactions(jr.run_up(scene, [0.0, 1e-9], solver=dfx.Euler()))  # compiles at once
    return found, 7850 * np.pi * 0.05**2 / 4 * 9.81


@pytest.mark.slow
def test_beam_on_three_supports():
    """Beam tables: 3/8, 5/4, 3/8 of q l."""
    found, q = beam(P(0.0), P(1.0), P(2.0))
    np.testing.assert_allclose(found.static, np.array([3, 10, 3]) / 8 * q * 1j, rtol=1e-9)
    assert not np.any(found.static_moment)


@pytest.mark.slow
def test_clamped_beams():
    """Beam tables: q L and q L^2 / 2 with a mass at the end; clamped and pinned 5/8, 3/8, q L^2 / 8."""
    found, q = beam(P(0.0, "clamp"), discs=(jr.Disc(2.0, 3.0),))
    np.testing.assert_allclose(found.static, [1j * (2 * q + 3 * 9.81)], rtol=1e-9)
    np.testing.assert_allclose(found.static_moment, [1j * (2 * q + 6 * 9.81)], rtol=1e-9)
    found, q = beam(P(0.0, "clamp"), P(2.0))
    np.testing.assert_allclose(found.static, np.array([5, 3]) / 8 * 2 * q * 1j, rtol=1e-9)
    np.testing.assert_allclose(found.static_moment[0], q * 4 / 8 * 1j, rtol=1e-9)


def steady(scene):
    """State of steady whirl with the shaft, from the equations of motion."""
    system, speed = jr.assemble(scene), float(scene.spin.speed)
    m, g, k = (
        np.asarray(getattr(system.blocks, n)) for n in ("inertia", "gyroscopic", "stiffness")
    )
    r = np.linalg.solve(k - speed**2 * (m - g), speed**2 * np.asarray(system.load.unbalance))
    return jr.Continued(jnp.asarray(r), jnp.asarray(1j * speed * r))


@pytest.mark.slow
def test_stiff_shaft_in_stiff_bearings_is_the_rigid_rotor():
    """The worked example in steady motion at 300 rad/s: reactions differ as 1 / stiffness."""
    arms = np.array([-0.0346290060 + 0.0076297334j, 0.0464503149 - 0.0111481005j])
    shaft = jr.FlexibleShaft(0.453, 0.1, jr.Material(2.1e11, 1.0), constraints=(), nodes=4)
    bearings = [jr.Support(at, 1e10) for at in (A, B)]
    scene = jr.Scene(shaft, *rotor().effects, *bearings, spin=jr.ConstantSpeed(300.0))
    errors = []
    for stiffness in (1.0, 10.0, 100.0, 1000.0):
        paths = "shaft.material.youngs_modulus", "supports.stiffness"
        stiffer = scene.replace({p: stiffness * scene.get(p).ravel()[0] for p in paths})
        _, found = forces(stiffer, [0.0, 1e-4], start=steady(stiffer))
        assert found.names == ("supports.0", "supports.1")
        errors.append(np.max(np.abs(found.rotating / (-(300**2) * arms) - 1)))
    assert errors[0] < 0.1 and errors[-1] < 1e-4
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 10, rtol=0.1)


@pytest.mark.slow
def test_reactions_of_simulate_are_those_of_run_up():
    """A flexible rotor between a pin, a support and a stop, at constant speed."""
    scene = jr.Scene(
        jr.FlexibleShaft(1.0, 0.03, constraints=(P(0.0),), nodes=4),
        jr.Disc.thin(0.6, 8.0, 0.1, offset=3e-4, tilt=0.01),
        jr.Support(1.0, 2e5, 300.0),
        jr.ExternalDamping(20.0),
        jr.Gravity(),
        spin=jr.ConstantSpeed(200.0),
    )
    response = jr.simulate(scene, 2, 8, start=jr.Whirl(1e-4, 20.0))
    one = jr.reactions(response)
    control = dfx.PIDController(rtol=1e-10, atol=1e-13)
    run, two = forces(scene, response.time, start=jr.Whirl(1e-4, 20.0), controller=control)
    assert one.names == two.names == ("support", "constraints.0")
    scale = np.max(np.abs(two.force))
    # `simulate` is exact; `run_up` interpolates accelerations of stiff modes between its steps.
    np.testing.assert_allclose(one.force, two.force, rtol=0, atol=5e-5 * scale)
    np.testing.assert_allclose(one.static, two.static, rtol=1e-12)
    shaft = 7850 * np.pi * 0.03**2 / 4
    weight = (8 + shaft) * 9.80665
    second = (8 * 0.6 + shaft / 2) * 9.80665
    np.testing.assert_allclose(two.static, [1j * second, 1j * (weight - second)], rtol=1e-9)
