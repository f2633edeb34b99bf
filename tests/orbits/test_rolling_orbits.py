"""Orbits in a rolling bearing, by passes of its balls and by revolutions, and their branches over speed.

Numbers are those of DOP853 and of collocation of order 12, see `tests/effects/test_rolling_bearing.py`. A
touch of a ball costs an error of the orbit of order 5/2 of the step, and of its derivatives of order 3/2.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from ball_bearing import (
    BALLS,
    GAP,
    GEAR,
    HERTZ,
    INNER,
    ONCE,
    ONCE_MULTIPLIERS,
    OUTER,
    PASSAGES,
    SHARE,
    TIGHT,
    end_of,
    launch,
    machine,
)
from differences import central
from own_laws import TurningForce
from scipy.optimize import linear_sum_assignment

import jaxrotor as jr


BOTTOM = launch(0.0, -26.0)
PLAIN = jr.Exponential(4)  # no formula of the force changes, so that there is nothing to be located
TIGHT_FIT = {"speed": 300.0, "damping": 1500.0, "gap": 5e-6} | GEAR


def orbit(scene, steps, guess=BOTTOM, **options):
    return jr.periodic(scene, guess, steps_per_revolution=steps, solver=PLAIN, **options)


def start_of(found):
    """x, y [um] and their velocities [um/ms] at angle 0."""
    z, v = 1e6 * complex(found.start.q[0]), 1e3 * complex(found.start.velocity[0])
    return np.array([z.real, z.imag, v.real, v.imag])


def away(found, wanted):
    """Largest distance of multipliers from those wanted and their conjugates."""
    apart = np.abs(np.asarray(found)[:, None] - np.concatenate([wanted, np.conj(wanted)]))
    return apart[linear_sum_assignment(apart)].max()


@pytest.mark.parametrize("speed", PASSAGES)
def test_orbit_of_a_pass(speed):
    """A pass is 0.324 of a turn, so it takes 83 of 256 steps."""
    start, multipliers = PASSAGES[speed]
    found = orbit(machine(speed), 256)
    assert found.converged and found.stable and found.passes and found.revolutions == 1
    assert found.steps == 83 and str(found).startswith("Orbit of 1 pass, ")
    assert float(found.period) == pytest.approx(2 * np.pi / (BALLS * SHARE * speed), rel=1e-14)
    np.testing.assert_allclose(start_of(found), start, rtol=0, atol=3e-6)
    assert away(found.multipliers, multipliers) < 5e-4


@pytest.mark.slow
def test_neighbours_diverge_by_the_multipliers_of_a_pass():
    """Lyapunov exponents of an orbit are `ln |multipliers|` in its period."""
    scene, (_, multipliers) = machine(900.0), PASSAGES[900.0]
    period = 2 * np.pi / (BALLS * SHARE * 900.0)
    how = {"steps_per_revolution": 512, "solver": PLAIN, "count": 4}
    found = jr.lyapunov(scene, BOTTOM, 400, settle=1200, **how)
    wanted = np.sort(np.repeat(np.log(np.abs(multipliers)) / period, 2))[::-1]
    assert found.period == pytest.approx(period, rel=1e-14)
    np.testing.assert_allclose(found.exponents, wanted, rtol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "error", "slopes"), [(4096, 7e-9, 1e-5), (65536, 6e-10, 1e-7)])
def test_digits_of_orbits(steps, error, slopes):
    """With steps enough starts have all digits that are printed, and multipliers seven."""
    for speed, (start, multipliers) in PASSAGES.items():
        found = orbit(machine(speed), steps)
        np.testing.assert_allclose(start_of(found), start, rtol=0, atol=error)
        assert away(found.multipliers, multipliers) < slopes


@pytest.mark.slow
def test_orbit_of_a_revolution():
    """Three balls pass in a turn, so that unbalance has the period of three passes."""
    for steps, error, slopes in ((256, 5e-5, 2e-3), (65536, 1e-10, 5e-7)):
        found = orbit(machine(eccentricity=1e-6, **TIGHT_FIT), steps, launch(0.0, -9.8))
        assert found.stable and not found.passes and found.revolutions == 1
        assert str(found).startswith("Orbit of 1 revolution, ")
        np.testing.assert_allclose(start_of(found), ONCE, rtol=0, atol=error)
        assert away(found.multipliers, ONCE_MULTIPLIERS) < slopes


@pytest.mark.slow
@pytest.mark.parametrize(
    ("values", "guess", "turns", "error"),
    [
        ({"speed": -900.0}, (0.0, -26.0), BALLS * SHARE, 2e-8),
        (
            {"speed": 300.0, "balls": 3, "outer_speed": -0.3, "weight": 2000.0, "damping": 3000.0},
            (0.0, -26.0),
            3 * (SHARE - 0.3 * (1 - SHARE)),
            2e-7,
        ),
        (TIGHT_FIT, (0.0, -9.8), 3.0, 2e-8),
    ],
    ids=["backward", "a pass of 1.66 turns", "three a turn"],
)
def test_orbit_closes_in_an_integration(values, guess, turns, error):
    """Dopri8 from the start of an orbit through its period; `turns` passes are one revolution."""
    found = orbit(machine(**values), 4096, launch(*guess))
    start, period = start_of(found), float(found.period)
    assert period == pytest.approx(2 * np.pi / (turns * abs(values["speed"])), rel=1e-14)
    run = jr.run_up(machine(**values), np.array([0.0, period]), start=launch(*start), **TIGHT)
    np.testing.assert_allclose(end_of(run), start, rtol=0, atol=error)


def test_orbit_of_two_passes():
    """It is that of one, run through twice: the angle begins anew with every pass."""
    one, two = (orbit(machine(), 256, revolutions=count) for count in (1, 2))
    assert two.revolutions == 2 and str(two).startswith("Orbit of 2 passes, ")
    assert float(two.period) == 2 * float(one.period)
    np.testing.assert_allclose(start_of(two), start_of(one), rtol=0, atol=1e-11)
    assert away(two.multipliers, np.asarray(one.multipliers)[::2] ** 2) < 1e-11
    force = np.asarray(two.contact_force[:, 0])
    steps = one.steps
    np.testing.assert_allclose(force[steps:], force[: steps + 1], rtol=0, atol=1e-8 * 196.0)


def test_a_force_that_turns_is_sought_from_rest():
    """`z = f / (k - m w^2 + i w c)` after a search that begins without any displacement."""
    shaft, disc = jr.MasslessShaft(1.0, 0.5, 1e6), jr.Disc(0.5, 20.0)
    damping = jr.DiscDamping(0.5, 200.0)
    spin = jr.ConstantSpeed(300.0)
    force = TurningForce(0.5, 1e-3, 0.4, repeats=True)
    scene = jr.Scene(shaft, disc, damping, force, spin=spin)
    rate = 0.4 * 300.0
    wanted = 1e-3 / (1e6 - 20.0 * rate**2 + 200j * rate)
    found = orbit(scene, 512, jr.AtRest())
    assert found.passes and float(found.period) == pytest.approx(2 * np.pi / rate, rel=1e-14)
    assert complex(found.start.q[0]) == pytest.approx(wanted, rel=1e-7)


NUMBERS = {
    "rolling_bearing.stiffness": HERTZ,
    "rolling_bearing.gap": GAP,
    "rolling_bearing.inner_radius": INNER,
    "rolling_bearing.outer_speed": -0.01,
    "rolling_bearing.angle": -np.pi / 2,
    "spin.speed": 900.0,
}


@pytest.mark.slow
def test_derivatives_of_an_orbit():
    """The period changes with the radii of the races and with the speed, too."""
    scene = machine(outer_speed=-0.01)
    known = orbit(scene, 1024)
    values = jnp.array(list(NUMBERS.values()))

    def start(values):
        moved = scene.replace(dict(zip(NUMBERS, values, strict=True)))
        found = orbit(moved, 1024, known)
        q = found.start.q[0]
        return jnp.stack([1e6 * q.real, 1e6 * q.imag, 1e3 * found.period])

    for along in jnp.diag(values):
        slopes = jax.jvp(start, (values,), (along,))[1]
        differences = central(lambda k, along=along: start(values + k * 1e-5 * along), 1e-5)
        size = float(jnp.abs(slopes).max())
        np.testing.assert_allclose(differences, slopes, rtol=0, atol=2e-4 * size)


# === branches over the speed


FLIPS = (481.979974, 1076.227610)
PAIRS = (749.812630, 769.136682)  # between them a pair of multipliers is outside of the circle


@pytest.fixture(scope="module")
def branch():
    """The orbits of a pass from below the one flip to above the other."""
    first = orbit(machine(700.0), 512)
    return jr.continue_(
        first, "spin.speed", (470.0, 1090.0), solver=PLAIN, step=0.02, max_step=0.02
    )


@pytest.mark.slow
def test_branch_over_speed(branch):
    """Steps of 512 a turn leave an error of 0.02 rad/s."""
    found = [(point.kind, point.value) for point in branch.points]
    kinds, values = zip(*found, strict=True)
    assert kinds == ("flip", "neimark-sacker", "neimark-sacker", "flip")
    wanted = np.sort([*FLIPS, *PAIRS])
    np.testing.assert_allclose(values, wanted, rtol=0, atol=0.02)
    inside = (branch.values > FLIPS[0]) & (branch.values < FLIPS[1])
    inside &= (branch.values < PAIRS[0]) | (branch.values > PAIRS[1])
    np.testing.assert_array_equal(branch.stable, inside)
    periods = 2 * np.pi / (BALLS * SHARE * branch.values)
    np.testing.assert_allclose(branch.period, periods, rtol=1e-13)


@pytest.mark.slow
def test_orbits_of_two_passes_begin_at_a_flip(branch):
    doubled = jr.switch(branch, branch.points[-1], max_points=1, locate=False).orbit(-1)
    assert doubled.passes and doubled.revolutions == 2
    moved = np.asarray(doubled.displacement[:, 0])
    assert np.abs(moved[doubled.steps] - moved[0]) > 1e-3 * np.ptp(np.abs(moved))


# === what has no period


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"eccentricity": 2e-6},
            "rolling_bearing repeats after 0.324189526 revolutions and what turns with the shaft after 1, "
            "so both never do; leave unbalance out",
        ),
        (GEAR | {"eccentricity": 2e-6, "balls": 7}, "so both do after 8 at the earliest"),
        (
            {"eccentricity": 2e-6, "balls": 3, "inner_radius": 1.0, "outer_radius": 5.0},
            "`periodic` takes a period of one revolution, but all forces repeat after 2",
        ),
        ({"outer_speed": -INNER / OUTER}, "in rolling_bearing stands, so there is no period"),
        ({"speed": 0.0}, "in rolling_bearing stands, so there is no period"),
    ],
)
def test_clocks_without_a_common_period_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        jr.periodic(machine(**values), BOTTOM)


def test_what_is_traced_has_no_known_ratio():
    scene = machine(eccentricity=1e-6, **TIGHT_FIT)
    start = lambda radius: jr.periodic(scene.replace({path: radius}), BOTTOM).start.q
    path = "rolling_bearing.inner_radius"
    with pytest.raises(
        ValueError, match="have a common period is told by values, which are traced"
    ):
        jax.jvp(start, (3.0,), (1.0,))
    path = "rolling_bearing.outer_radius"
    scene = machine()
    with pytest.raises(ValueError, match="give an orbit that `periodic` found before as the guess"):
        jax.jvp(start, (OUTER,), (1.0,))


def test_a_law_that_states_no_period_is_refused():
    held = machine()
    scene = jr.Scene(held.shaft, *held.effects, TurningForce(0.5, 1.0, 0.4), spin=held.spin)
    with pytest.raises(
        ValueError, match="contacts .turning_force. count turns and their laws state no"
    ):
        jr.periodic(scene, BOTTOM)


@pytest.mark.slow
def test_ranges_keep_the_period():
    found = orbit(machine(eccentricity=1e-6, **TIGHT_FIT), 64, launch(0.0, -9.8))
    with pytest.raises(
        ValueError, match="A branch in `rolling_bearing.inner_radius` needs one period"
    ):
        jr.continue_(found, "rolling_bearing.inner_radius", (2.9, 3.1))
    passing = orbit(machine(**TIGHT_FIT), 64, launch(0.0, -9.8))
    with pytest.raises(ValueError, match="`unbalance.eccentricity` changes which period"):
        jr.continue_(passing, "unbalance.eccentricity", (0.0, 1e-6))


def test_a_record_over_revolutions_is_of_no_pass():
    record = jr.OrbitRecord(np.ones(8) + 0j, guess=BOTTOM, solver=PLAIN)
    with pytest.raises(ValueError, match="this scene repeats with the passes of the balls"):
        record.prepared(machine())
