"""Laws of rotation: angle, speed and acceleration against quadrature and integration; scene files."""

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from systems import bare, limiter_rotor

import jaxrotor as jr
from jaxrotor.files.toml import dumps, loads


KNOTS = np.array([-0.5, 0.3, 1.0, 1.25, 3.0])
SPEEDS = np.array([10.0, 40.0, 40.0, -20.0, 5.0])
PROFILE = jr.SpeedProfile(KNOTS, SPEEDS)
DRIVE = jr.Drive(600.0, 1950.0, 1.57, 0.039, polar=2.2354)


def turned(speed, time, breaks):
    """Angle by adaptive quadrature between the breaks."""
    ends = [0.0, *[b for b in breaks if 0 < b < time], time]
    return sum(quad(speed, a, b, epsabs=1e-13)[0] for a, b in zip(ends, ends[1:], strict=False))


# === rotations known in advance


def test_constant_speed():
    times = np.array([0.0, 0.5, 2.0])
    found = jr.ConstantSpeed(-30.0).turning(times)
    assert found.angle.tolist() == [0.0, -15.0, -60.0]
    assert found.speed.tolist() == [-30.0] * 3 and found.acceleration.tolist() == [0.0] * 3
    assert jr.ConstantSpeed(3.0).given


@pytest.mark.parametrize("time", [0.0, 0.2, 0.3, 0.999, 1.1, 1.25, 2.0, 3.0, 7.5])
def test_angle_of_a_profile_is_the_area_under_it(time):
    found = PROFILE.turning(time)
    speed = lambda t: np.interp(t, KNOTS, SPEEDS)
    np.testing.assert_allclose(found.speed, speed(time), rtol=1e-14)
    np.testing.assert_allclose(found.angle, turned(speed, time, KNOTS), rtol=1e-13, atol=1e-14)
    rate = (speed(time + 1e-6) - speed(time)) / 1e-6  # at a knot, that of the next interval
    np.testing.assert_allclose(found.acceleration, rate, rtol=1e-6, atol=1e-6)


def test_a_profile_that_begins_later_is_held_before():
    late = jr.SpeedProfile([2.0, 4.0], [10.0, 30.0])
    assert late.speed == 10 and PROFILE.speed == 10 + 30 * 0.5 / 0.8
    found = late.turning(np.array([0.0, 1.0, 2.0, 3.0, 5.0]))
    np.testing.assert_allclose(found.angle, [0, 10, 20, 35, 90], rtol=1e-15)
    assert found.acceleration.tolist() == [0, 0, 10, 10, 0]


def test_a_ramp():
    ramp = jr.SpeedProfile.ramp(5.0, 25.0, 4.0)
    assert ramp.times.tolist() == [0.0, 4.0] and ramp.speed == 5
    found = ramp.turning(np.array([2.0, 4.0, 5.0]))
    np.testing.assert_allclose(found.angle, [20, 60, 85], rtol=1e-15)
    assert found.speed.tolist() == [15, 25, 25]
    with pytest.raises(ValueError, match=r"`duration \[s\]` must be positive, but is 0."):
        jr.SpeedProfile.ramp(5.0, 25.0, 0.0)
    with pytest.raises(ValueError, match="must be of one length, but have 3 and 2 numbers"):
        jr.SpeedProfile([0.0, 1.0, 2.0], [1.0, 2.0])


# === drives


def test_a_drive_turns_as_scipy_says():
    times = np.linspace(0.0, 0.48, 25)
    law = lambda t, y: [y[1], (1950 - 1.57 * y[1] - 0.039 * y[1] ** 2) / 2.2354]
    y = solve_ivp(law, (0, 0.48), [0.0, 600.0], "DOP853", times, rtol=1e-13, atol=1e-12).y
    found = DRIVE.turning(times)
    np.testing.assert_allclose(found.angle, y[0], rtol=1e-12)
    np.testing.assert_allclose(found.speed, y[1], rtol=1e-12)
    np.testing.assert_allclose(found.acceleration, law(0, y)[1], rtol=1e-9)
    speed = lambda t: float(DRIVE.turning(t).speed)
    np.testing.assert_allclose(found.angle[8], turned(speed, 0.16, ()), rtol=1e-12)


def test_the_inertia_is_the_drives_own_or_the_rotors():
    bare_drive = jr.Drive(0.0, 10.0)
    assert bare_drive.turning(3.0, jnp.asarray(5.0)).speed == 6
    own = jr.Drive(0.0, 10.0, polar=2.0)
    assert own.turning(3.0, jnp.asarray(5.0)).speed == 15
    with pytest.raises(ValueError) as caught:
        bare_drive.turning(3.0)
    needs = "A drive needs a moment of inertia, but neither it nor the scene has one"
    assert str(caught.value) == f"{needs}; give `polar [kg m^2]`."


def test_moment_adds_its_parts():
    table = {"table_speeds": [-10.0, 0.0, 20.0], "table_torques": [1.0, 5.0, -3.0]}
    drive = jr.Drive(0.0, 7.0, 0.5, 0.1, coulomb=2.0, odd=True, **table)
    speeds = np.array([-30.0, -4.0, 0.0, 5.0, 20.0, 100.0])
    by_hand = 7 - 0.5 * speeds - 0.1 * speeds * np.abs(speeds) - 2 * np.sign(speeds)
    by_hand += [1.0, 5 - 4 * 0.4, 5.0, 5 - 5 * 0.4, -3.0, -3.0]
    np.testing.assert_allclose(drive.moment(speeds), by_hand, rtol=1e-14)
    assert drive.moment(5.0) == by_hand[3]
    assert jr.Drive(0.0, 7.0).moment(speeds).tolist() == [7.0] * 6


def test_literal_drag_drives_a_negative_speed():
    literal, odd = (jr.Drive(-300.0, 0.0, None, 0.1, odd=odd) for odd in (False, True))
    assert literal.moment(-300.0) == -9000 and odd.moment(-300.0) == 9000
    assert literal.given and not odd.given
    with pytest.raises(ValueError, match="must be below 0.0333333, where the speed runs away"):
        literal.turning(0.04, jnp.asarray(1.0))


@pytest.mark.parametrize(
    ("speed", "torque", "more"),
    [(-300.0, 1950.0, {}), (0.0, -20.0, {}), (-100.0, -20.0, {"feedback": True})],
)
def test_drag_of_a_drive_that_turns_backward_is_asked_for(speed, torque, more):
    """`odd`, with which the mirrored drive has the mirrored moment, or the letter, as is said."""
    with pytest.raises(
        ValueError, match=r"`drag \[N m s\^2\]` would drive this rotor.*`odd = true`"
    ):
        jr.Drive(speed, torque, 0.5, 0.1, **more)
    scene = jr.Scene(jr.MasslessShaft(1.0, 0.5, 1e6), jr.Disc(0.5, 1.0), spin=DRIVE)
    with pytest.raises(ValueError, match=r"spin\.speed: `drag \[N m s\^2\]` would drive"):
        scene.replace({"spin.speed": -300.0})
    odd = jr.Drive(speed, torque, 0.5, 0.1, odd=True, **more)
    mirrored = jr.Drive(-speed, -torque, 0.5, 0.1, odd=True, **more)
    speeds = np.array([-200.0, -3.0, 40.0])
    np.testing.assert_array_equal(odd.moment(speeds), -mirrored.moment(-speeds))
    by_hand = torque - 0.5 * speeds - 0.1 * np.sign(speeds) * speeds**2
    np.testing.assert_allclose(odd.moment(speeds), by_hand, rtol=1e-14)


VARIED = [
    {"coulomb": 1.0},
    {"drag": 0.1, "odd": True},
    {"table_speeds": [0.0, 1.0], "table_torques": [0.0, 1.0]},
    {"feedback": True},
    {"stops": True},
]


@pytest.mark.parametrize("more", VARIED, ids=str)
def test_without_a_closed_form_the_rotation_is_not_given(more):
    drive = jr.Drive(1.0, 2.0, polar=3.0, **more)
    assert not drive.given
    with pytest.raises(ValueError, match=r"has no closed form; use `jaxrotor.run_up`.$"):
        drive.turning(1.0)


def test_odd_alone_changes_nothing():
    assert jr.Drive(1.0, 2.0, odd=True, polar=3.0).given


REFUSED = [
    ({"coulomb": -1.0}, "`coulomb [N m]` must not be negative, but is -1."),
    ({"drag": -1.0}, "`drag [N m s^2]` must not be negative, but is -1."),
    ({"polar": 0.0}, "`polar [kg m^2]` must be positive, but is 0."),
    (
        {"table_speeds": [0.0, 1.0]},
        "`table_speeds [rad/s]` and `table_torques [N m]` belong together; give both or neither.",
    ),
    (
        {"table_speeds": [0.0, 1.0, 2.0], "table_torques": [1.0, 2.0]},
        "`table_speeds` and `table_torques` must be of one length, but have 3 and 2 numbers.",
    ),
    (
        {"table_speeds": [0.0, 1.0, 1.0], "table_torques": [1.0, 2.0, 3.0]},
        "`table_speeds [rad/s]` must be ascending, each above the one before, but has 1 and then 1.",
    ),
]


@pytest.mark.parametrize(("more", "message"), REFUSED, ids=lambda value: str(value)[:30])
def test_a_drive_refuses_in_one_sentence(more, message):
    with pytest.raises(ValueError) as caught:
        jr.Drive(1.0, 2.0, **more)
    assert str(caught.value) == message


# === transformations

SPINS = [jr.ConstantSpeed(30.0), PROFILE, DRIVE]


@pytest.mark.slow
@pytest.mark.parametrize("spin", SPINS, ids=lambda spin: type(spin).__name__)
def test_jit_and_vmap_change_nothing(spin):
    times = jnp.asarray([[0.0, 0.1], [0.35, 1.2]])
    plain = spin.turning(times)
    assert all(part.shape == times.shape for part in plain)
    for other in (
        eqx.filter_jit(lambda s, t: s.turning(t))(spin, times),
        jax.vmap(jax.vmap(spin.turning))(times),
    ):
        for one, two in zip(plain, other, strict=True):
            np.testing.assert_allclose(one, two, rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("spin", SPINS, ids=lambda spin: type(spin).__name__)
def test_derivatives_of_every_leaf_and_of_time(spin):
    """Derivatives of the angle by every leaf; speed and acceleration are its derivatives by time."""
    time = 1.1
    ask = eqx.filter_jit(lambda spin, t: spin.turning(t))
    flat, structure = jax.flatten_util.ravel_pytree(spin)
    angle = jax.jit(lambda x: structure(x).turning(time).angle)
    found = jax.jit(jax.grad(angle))(flat)
    assert (np.abs(found) > 0).any()
    for i, value in enumerate(np.asarray(flat)):
        h = 1e-5 * max(abs(value), 0.1)
        step = jnp.zeros_like(flat).at[i].set(h)
        change = (angle(flat + step) - angle(flat - step)) / (2 * h)
        np.testing.assert_allclose(found[i], change, rtol=1e-6, atol=1e-7)
    rate = lambda part: jax.jit(jax.grad(lambda t: ask(spin, t)[part]))(time)
    now = ask(spin, time)
    np.testing.assert_allclose(rate(0), now.speed, rtol=1e-12)
    np.testing.assert_allclose(rate(1), now.acceleration, rtol=1e-11, atol=1e-11)


def test_derivatives_of_the_moment():
    drive = jr.Drive(
        0.0,
        7.0,
        0.5,
        0.1,
        True,
        2.0,
        table_speeds=[-10.0, 0.0, 20.0],
        table_torques=[1.0, 5.0, -3.0],
    )
    slope = jax.grad(drive.moment)
    for speed in (-30.0, -4.0, 5.0):
        change = (drive.moment(speed + 1e-5) - drive.moment(speed - 1e-5)) / 2e-5
        np.testing.assert_allclose(slope(speed), change, rtol=1e-8)
    by_table = jax.grad(lambda v: eqx.tree_at(lambda d: d.table_torques, drive, v).moment(5.0))
    np.testing.assert_allclose(by_table(drive.table_torques), [0, 0.75, 0.25], rtol=1e-14)


# === scene files


FULL = jr.Drive(
    1 / 3,
    2.0,
    0.1 + 0.2,
    4.0,
    True,
    5.0,
    [0.0, 1 / 7],
    [np.pi, -1.0],
    6.0,
    feedback=True,
    stops=True,
)


@pytest.mark.parametrize("spin", [*SPINS, jr.Drive(1.0, 2.0), FULL], ids=str)
def test_every_spin_is_written_and_read_to_the_last_bit(spin):
    scene = jr.Scene(bare().shaft, spin=spin)
    again = loads(dumps(scene)).spin
    assert jax.tree.structure(again) == jax.tree.structure(spin)
    for one, two in zip(jax.tree.leaves(again), jax.tree.leaves(spin), strict=True):
        assert one.dtype == two.dtype and np.asarray(one).tobytes() == np.asarray(two).tobytes()


def test_a_drive_by_hand():
    text = """
        [shaft]
        length = 0.7
        diameter = 0.02
        [spin]
        model = "drive"
        speed = "1500 rpm"
        torque = "0.02 kN m"
        drag = 0.01
        odd = true
        table_speeds = [0, "3000 rpm"]
        table_torques = ["1 N m", 0.0]
    """
    spin = loads(text).spin
    np.testing.assert_allclose(spin.speed, 50 * np.pi, rtol=1e-15)
    assert spin.torque == 20 and spin.odd is True and spin.slope is None
    np.testing.assert_allclose(spin.table_speeds, [0, 100 * np.pi], rtol=1e-15)
    with pytest.raises(jr.SceneError, match="spin.odd must be true or false, but is 1"):
        loads(text.replace("odd = true", "odd = 1"))
    with pytest.raises(
        jr.SceneError, match="spin.model must be 'constant' or 'drive' or 'profile'"
    ):
        loads(text.replace('"drive"', '"motor"'))


# === scenes of any spin


def with_spin(scene, spin):
    return jr.Scene(scene.shaft, *scene.effects, spin=spin)


@pytest.fixture(scope="module")
def rotor():
    return limiter_rotor(eps=0.001, contact=False, nodes=5)


@pytest.mark.slow
def test_analyses_at_given_speeds_ask_for_no_spin(rotor):
    varied = with_spin(rotor, PROFILE)
    speeds = [50.0, 200.0]
    one, two = (jr.campbell(scene, speeds, 3).values for scene in (rotor, varied))
    np.testing.assert_array_equal(one, two)
    one, two = (jr.unbalance_response(scene, speeds).forward for scene in (rotor, varied))
    np.testing.assert_array_equal(one, two)
    one, two = (jr.critical_speeds(scene, 1).forward for scene in (rotor, varied))
    np.testing.assert_array_equal(one, two)
    at_start = with_spin(rotor, jr.ConstantSpeed(10 + 30 * 0.5 / 0.8))
    np.testing.assert_allclose(jr.roots(varied)[:4], jr.roots(at_start)[:4], rtol=1e-12)


def test_a_scene_at_another_speed(rotor):
    still = with_spin(rotor, PROFILE).at_speed(70.0)
    assert type(still.spin) is jr.ConstantSpeed and still.spin.speed == 70
    assert still.spans == rotor.spans
    system = jr.assemble(with_spin(rotor, DRIVE)).at_speed(80.0)
    assert type(system.spin) is jr.ConstantSpeed and system.spin.speed == 80


@pytest.mark.parametrize("spin", [PROFILE, DRIVE], ids=["profile", "drive"])
def test_stepping_at_constant_speed_refuses_a_speed_that_varies(rotor, spin):
    varied, name = with_spin(rotor, spin), type(spin).__name__
    for what, run in {
        "Motion by `revolutions`": lambda: jr.simulate(varied, 1),
        "`sweep` without `times`": lambda: jr.sweep(
            varied, {"unbalance.eccentricity": [1e-3]}, settle=0, keep=1
        ),
    }.items():
        with pytest.raises(ValueError) as caught:
            run()
        assert str(caught.value) == (
            f"{what} is for constant speed, but the spin of the scene is a {name}; give the `times` of "
            "the samples [s], or take `scene.at_speed(..)`."
        )


# === steady speed of a drive


def test_speed_and_time_at_which_a_drive_settles():
    """Rotor of the course project by its quadratic and partial fractions; the others by hand."""
    torque, slope, drag, polar = 1950.0, 1.57, 0.039, 2.2354
    root = np.sqrt(slope**2 + 4 * drag * torque)
    high, low = (root - slope) / (2 * drag), (-root - slope) / (2 * drag)
    for start, end in ((600.0, 1.001 * high), (0.0, 0.999 * high)):
        ratio = (start - high) / (start - low) * (end - low) / (end - high)
        found = jr.settled(jr.Drive(start, torque, slope, drag), polar)
        assert found == pytest.approx((high, polar / root * np.log(ratio)), rel=1e-5)
    coasting = jr.settled(jr.Drive(100.0, 0.0, coulomb=5.0), 2.0)
    assert coasting == pytest.approx((0.0, 2.0 * 99.9 / 5.0), rel=1e-5, abs=1e-9)
    table = jr.Drive(0.0, 0.0, slope=0.1, table_speeds=[0.0, 50.0], table_torques=[10.0, 5.0])
    # torque 10 - 0.2 W, balanced at 50 rad/s: the speed is within 0.05 of it after 5 ln(1000) s
    assert jr.settled(table, 1.0) == pytest.approx((50.0, 5 * np.log(1000)), rel=1e-4)
    assert jr.settled(jr.Drive(5.0, 0.0), 1.0) == (5.0, 0.0)
    with pytest.raises(ValueError, match="runs away"):
        jr.settled(jr.Drive(0.0, 3.0), 1.0)
