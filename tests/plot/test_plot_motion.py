"""Plots of a motion at constant speed: orbit, periodic orbit, harmonics, history, whirl."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn import check_axes, lines
from matplotlib.colors import to_hex

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.plot import colours


pytestmark = pytest.mark.usefixtures("rendered")

STEPS = 64
SPEED = 662.0  # [rad/s]
RADIUS = 0.01  # [m]
SHARES = jnp.array([1.0, 0.5])  # of the displacement, at the end and the middle of the shaft
DRIVEN = 1.0 / (1 - 0.3**2)  # [mm] of `driven`: `e W^2 / (W^2 - w^2)`


def pivoted(whirl, speed=SPEED):
    """2 kg at the end of a tilting axis, on a spring: `z = r exp(i w t)`, `w = whirl Omega`."""
    return jr.Scene(
        jr.RigidShaft(0.7, (jr.Constraint(0.0),)),
        jr.Disc(0.7, 2.0),
        jr.Unbalance(0.7, 2.0, 0.0),
        jr.Support(0.7, 2.0 * (whirl * SPEED) ** 2),
        spin=jr.ConstantSpeed(speed),
    )


def driven():
    """The same rotor with its centre of mass 1 mm off axis, well above its critical speed."""
    return pivoted(0.3).replace({"unbalance.eccentricity": 1e-3})


def whirling(whirl, speed=SPEED):
    """Eight revolutions of the rotor from x = 10 mm; other values use the same program."""
    start = jr.Whirl(RADIUS, whirl * SPEED)
    return jr.simulate(pivoted(whirl, speed), 8, STEPS, start=start, at=[0.7, 0.35])


def rippling(whirl, ripple, speed=SPEED):
    """The same response with a motion of `Lambda = whirl + ripple cos 3 theta`."""
    response = whirling(whirl, speed)
    angle = response.angle
    z = RADIUS * jnp.exp(1j * (whirl * angle + ripple / 3 * jnp.sin(3 * angle)))
    rate = SPEED * (whirl + ripple * jnp.cos(3 * angle))
    motion = {"displacement": z, "velocity": 1j * rate * z}
    return dataclasses.replace(
        response, **{name: a[:, None] * SHARES for name, a in motion.items()}
    )


def beside(result, *limiters):
    """The result with limiters in its scene, computed without them."""
    scene = result.scene
    return dataclasses.replace(result, scene=scene.of_parts(*scene.effects, *limiters))


@pytest.mark.parametrize(
    "draw", [plot.orbit, plot.history, plot.whirl_history, plot.whirl_spectrum]
)
def test_draws_in_given_axes_or_a_figure_of_its_own(draw):
    response = whirling(0.5)
    check_axes(lambda ax: draw(response, ax=ax))


# === orbit


def test_orbit_is_in_millimetres_with_equal_scales():
    ax = plot.orbit(whirling(0.5))
    drawn = lines(ax)["orbit"]
    np.testing.assert_allclose(np.hypot(drawn.get_xdata(), drawn.get_ydata()), 10.0)
    assert ax.get_aspect() == 1.0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x displacement [mm]", "y displacement [mm]")


def test_orbit_marks_each_revolution_in_red():
    points = lines(plot.orbit(whirling(0.25)))["once a revolution"]
    # The whirl advances by a quarter of a revolution each, from angle 0 to the end of the 8th.
    np.testing.assert_allclose(points.get_xdata(), [10, 0, -10, 0, 10, 0, -10, 0, 10], atol=1e-9)
    assert to_hex(points.get_color()).upper() == colours.RED


def test_orbit_marks_whole_revolutions_of_a_late_window():
    whole = whirling(0.25)
    late = lambda leaf: leaf[STEPS // 2 :] if leaf.shape[:1] == whole.time.shape else leaf
    points = lines(plot.orbit(jax.tree.map(late, whole)))
    np.testing.assert_allclose(
        points["once a revolution"].get_xdata(), [0, -10, 0, 10, 0, -10, 0, 10], atol=1e-9
    )


def test_orbit_draws_limiters_of_its_station():
    limiters = [
        jr.Limiter(at=at, angle=angle, gap=gap, stiffness=1e6)
        for at, angle, gap in ((0.7, 0.0, 0.0075), (0.7, np.pi / 2, 0.006), (0.3, 1.0, 0.001))
    ]
    ax = plot.orbit(beside(whirling(0.5), *limiters))
    right, above = [line for line in ax.lines if to_hex(line.get_color()).upper() == colours.ORANGE]
    np.testing.assert_allclose(right.get_xdata(), [7.5, 7.5])
    np.testing.assert_allclose(np.sum(right.get_ydata()), 0.0, atol=1e-12)
    np.testing.assert_allclose(above.get_ydata(), [6.0, 6.0])
    np.testing.assert_allclose(np.sum(above.get_xdata()), 0.0, atol=1e-12)
    assert 1.0 < np.ptp(right.get_ydata()) < 7.5


def test_orbit_draws_the_circle_of_a_ring():
    ring = jr.AnnularStator(at=0.7, gap=0.006, stiffness=1e6, offset=0.002, angle=np.pi / 2)
    other = jr.AnnularStator(at=0.3, gap=0.001, stiffness=1e6)
    ax = plot.orbit(beside(whirling(0.5), ring, other))
    (circle,) = [line for line in ax.lines if to_hex(line.get_color()).upper() == colours.ORANGE]
    x, y = circle.get_xdata(), circle.get_ydata()
    np.testing.assert_allclose(np.hypot(x, y - 2.0), 6.0)
    assert np.ptp(x) == pytest.approx(12.0) and circle.get_label() == "ring"


def test_orbit_of_another_station():
    drawn = lines(plot.orbit(whirling(0.5), station=1))["orbit"]
    np.testing.assert_allclose(np.hypot(drawn.get_xdata(), drawn.get_ydata()), 5.0)
    with pytest.raises(ValueError, match="`station` must be 0 to 1, but is 2."):
        plot.orbit(whirling(0.5), station=2)


def test_orbits_at_all_stations():
    """Amplitudes of 10 and 5 mm; the limiter is drawn at its station, and named in the one legend."""
    found = beside(whirling(0.25), jr.Limiter(at=0.35, angle=0.0, gap=0.0075, stiffness=1e6))
    first, second = plot.orbits(found)
    for ax, radius, title in ((first, 10.0, "at 700 mm"), (second, 5.0, "at 350 mm")):
        drawn = lines(ax)
        path, points = drawn["orbit"], drawn["once a revolution"]
        np.testing.assert_allclose(np.hypot(path.get_xdata(), path.get_ydata()), radius)
        expected = radius * np.array([1, 0, -1, 0] * 2 + [1])
        np.testing.assert_allclose(points.get_xdata(), expected, atol=1e-9)
        assert ax.get_title() == title and ax.get_aspect() == 1.0
    assert "limiter" not in lines(first)
    np.testing.assert_allclose(lines(second)["limiter"].get_xdata(), 7.5)
    (named,) = first.figure.legends
    assert [text.get_text() for text in named.get_texts()] == [
        "orbit",
        "once a revolution",
        "limiter",
    ]
    _, given = plt.subplots(1, 2)
    assert plot.orbits(found, given) == tuple(given)
    with pytest.raises(ValueError, match="must be 2 Axes, one for each station, but are 1"):
        plot.orbits(found, given[0])


def test_lengths_in_a_chosen_unit():
    moving = whirling(0.5)
    with plot.units(length="m"):
        path, turns = plot.orbit(moving), plot.history(moving)
        slopes = plot.history(moving, slope=True)
        titles = [ax.get_title() for ax in plot.orbits(moving)]
    assert np.abs(lines(path)["orbit"].get_xdata()).max() == pytest.approx(0.01)
    assert lines(turns)["x"].get_ydata()[0] == pytest.approx(0.01)
    assert path.get_ylabel() == "y displacement [m]" and turns.get_ylabel() == "displacement [m]"
    assert slopes.get_ylabel() == "slope [mrad]" and titles == ["at 0.7 m", "at 0.35 m"]


def test_orbit_takes_one_simulation():
    one = whirling(0.5)
    many = eqx.tree_at(lambda one: one.displacement, one, one.displacement[None])
    with pytest.raises(ValueError, match=r"has shape \(1, 513, 2\).*pick one lane\.$"):
        plot.orbit(many)


# === periodic orbit


def test_periodic_orbit_goes_on_by_its_turn():
    found = jr.periodic(driven(), jr.AtRest(), steps_per_revolution=STEPS)
    left, _ = plot.periodic(found)
    path = lines(left)["one period"]
    np.testing.assert_allclose(np.hypot(path.get_xdata(), path.get_ydata()), DRIVEN)
    assert "next periods" not in lines(left)  # the orbit is closed

    z = 0.01 * np.exp(1j * np.linspace(0.0, -2 * np.pi / 3, STEPS + 1))
    turned = dataclasses.replace(
        beside(found, jr.Limiter(at=0.7, angle=0.0, gap=0.0075, stiffness=1e6)),
        displacement=jnp.asarray(z[:, None]),
        turn=jnp.asarray(-2 * np.pi / 3),
        multipliers=jnp.array([-1.2 + 0.1j, -1.2 - 0.1j, 0.5]),
        trivial=jnp.asarray(1.0),
    )
    left, right = plot.periodic(turned)
    drawn = lines(left)
    np.testing.assert_allclose(drawn["one period"].get_xdata(), 1e3 * z.real)
    greys = [line for line in left.lines if to_hex(line.get_color()).upper() == colours.GREY]
    assert len(greys) == 2  # the orbit closes after these
    np.testing.assert_allclose(greys[1].get_xdata()[-1], 10.0)
    assert "limiter" in drawn
    drawn = lines(right)
    np.testing.assert_allclose(drawn["repels"].get_xdata(), [-1.2, -1.2])
    np.testing.assert_allclose(drawn["attracts"].get_xdata(), [0.5])
    np.testing.assert_allclose(drawn["in time"].get_xdata(), [1.0])


def test_harmonics_forward_and_backward():
    """Every harmonic is drawn by its direction; those far below the largest are left out."""
    found = jr.harmonic_balance(driven(), harmonics=2, revolutions=2)
    drawn = lines(plot.harmonics(found))
    np.testing.assert_allclose(drawn["forward"].get_xydata(), [[1.0, DRIVEN]])
    assert "backward" not in drawn and "mean" not in drawn

    coefficients = 1e-3 * jnp.array([2.0, 1e-9, 1.0, 5.0, 0.25])
    mixed = dataclasses.replace(found, coefficients=1j * coefficients[:, None])
    ax = plot.harmonics(mixed)
    drawn = lines(ax)
    np.testing.assert_allclose(drawn["forward"].get_xydata(), [[0.5, 5.0], [1.0, 0.25]])
    np.testing.assert_allclose(drawn["backward"].get_xydata(), [[-1.0, 2.0]])
    np.testing.assert_allclose(drawn["mean"].get_xydata(), [[0.0, 1.0]])
    assert ax.get_yscale() == "log" and ax.get_ylabel() == "amplitude [mm]"
    with pytest.raises(ValueError, match="at rest in the centre"):
        plot.harmonics(dataclasses.replace(found, coefficients=0 * found.coefficients))


# === history


def test_history_is_in_revolutions_and_millimetres():
    ax = plot.history(whirling(0.5))
    drawn = lines(ax)
    turns = [0, STEPS, 2 * STEPS, -1]
    np.testing.assert_allclose(drawn["x"].get_xdata()[turns], [0.0, 1.0, 2.0, 8.0])
    np.testing.assert_allclose(drawn["x"].get_ydata()[turns], [10.0, -10.0, 10.0, 10.0])
    np.testing.assert_allclose(drawn["y"].get_ydata()[STEPS // 2], 10.0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [revolutions]", "displacement [mm]")


def test_history_of_slope_is_in_milliradians():
    """A straight axis has the slope displacement over length, in the direction of its whirl."""
    ax = plot.history(whirling(-0.25), slope=True)
    turn, size = -np.pi / 2 * np.arange(8 * STEPS + 1) / STEPS, 1e3 * RADIUS / 0.7
    np.testing.assert_allclose(lines(ax)["x'"].get_ydata(), size * np.cos(turn), atol=1e-9)
    np.testing.assert_allclose(lines(ax)["y'"].get_ydata(), size * np.sin(turn), atol=1e-9)
    assert ax.get_ylabel() == "slope [mrad]"


# === whirl


def test_whirl_history_is_relative_to_the_spin():
    ax = plot.whirl_history(rippling(-0.5, 0.2))
    whirl = ax.lines[0]
    expected = -0.5 + 0.2 * np.cos(2 * np.pi * 3 * whirl.get_xdata())
    np.testing.assert_allclose(whirl.get_ydata(), expected, rtol=1e-9)
    assert "[1]" in ax.get_ylabel() and ax.get_xlabel() == "time [revolutions]"


def test_whirl_history_leaves_a_gap_at_rest_in_the_centre():
    moving = rippling(0.5, 0.2)
    late = jnp.arange(8 * STEPS + 1)[:, None] >= 5
    begun = dataclasses.replace(moving, displacement=late * moving.displacement)
    drawn = plot.whirl_history(begun).lines[0].get_ydata()
    assert np.isnan(drawn[:5]).all() and np.isfinite(drawn[5:]).all()
    still = dataclasses.replace(moving, displacement=0 * moving.displacement)
    assert plot.whirl_history(still).get_legend() is None


def test_spectrum_of_a_sinusoid_has_its_amplitude_and_frequency():
    ax = plot.whirl_spectrum(rippling(0.5, 0.2))
    frequency, amplitude = ax.lines[0].get_data()
    assert frequency[np.argmax(amplitude)] == pytest.approx(3.0)
    assert amplitude.max() == pytest.approx(0.2, rel=1e-9)
    assert amplitude[0] == pytest.approx(0.0, abs=1e-12)  # the mean is removed
    assert amplitude[np.abs(frequency - 3.0) > 0.2].max() < 1e-9
    assert frequency.max() <= 10.0
    assert ax.get_xlabel() == "frequency [cycles per revolution]"
    assert "[1]" in ax.get_ylabel()


def test_spectrum_of_a_rotor_spinning_backwards():
    """A response counts its angle upwards, a run-up with the sign of the speed."""
    mirrored = rippling(0.5, 0.2, speed=-SPEED)
    for angle in (mirrored.angle, -mirrored.angle):
        ax = plot.whirl_spectrum(dataclasses.replace(mirrored, angle=angle))
        frequency, amplitude = ax.lines[0].get_data()
        assert frequency[np.argmax(amplitude)] == pytest.approx(3.0)


def test_spectrum_says_what_to_do_next():
    moving = rippling(0.5, 0.2)
    still = dataclasses.replace(moving, displacement=0 * moving.displacement)
    with pytest.raises(ValueError, match=r"undefined at 512 of 512 samples.*\.$"):
        plot.whirl_spectrum(still)
    for angle in (0 * moving.angle, moving.angle**2):
        uneven = dataclasses.replace(moving, angle=angle, steps_per_revolution=None)
        with pytest.raises(ValueError, match=r"sampled evenly in angle.*\.$"):
            plot.whirl_spectrum(uneven)
