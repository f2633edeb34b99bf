"""Plots of linear analyses: mode shapes, Campbell diagram, modes in space, response."""

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn import lines
from matplotlib.colors import to_hex

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.plot import colours


pytestmark = pytest.mark.usefixtures("rendered")


# === modes and onset


def motions(values, shapes, counter=None, stations=(0.0, 0.5, 1.0), frame="fixed", speed=30.0):
    to = lambda a: None if a is None else jnp.asarray(a, complex)
    at, speed = jnp.asarray(stations), jnp.asarray(speed)
    sizes = [
        np.sum(np.abs(np.asarray(part)) ** 2, axis=1)
        for part in (shapes, counter)
        if part is not None
    ]
    sizes = np.stack([*sizes, 0 * sizes[0]][:2], axis=1)  # for equal masses at the stations
    shares = jnp.asarray(sizes / sizes.sum(axis=1, keepdims=True))
    return jr.Modes(to(values), to(shapes), to(counter), shares, at, speed, frame)


def test_mode_shapes_are_normalised_and_in_phase():
    stations = np.array([0.0, 0.4, 0.2])
    values = [0.4 + 77.0j, -8.6 - 66.0j, -200.0 + 0j]
    modes = motions(values, [[0, 4j, 1j], [0, -3.0, -3j], [0, 1, -2.0]], stations=stations)
    ax = plot.mode_shapes(modes)
    drawn = [line for line in ax.lines if line.get_marker() == "."]
    np.testing.assert_allclose(drawn[0].get_xdata(), [0.0, 0.2, 0.4])
    np.testing.assert_allclose(drawn[0].get_ydata(), [0.0, 0.25, 1.0])
    np.testing.assert_allclose(drawn[1].get_ydata(), [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(drawn[2].get_ydata(), [0.0, 1.0, -0.5])
    (quadrature,) = [line for line in ax.lines if line.get_linestyle() == ":"]
    np.testing.assert_allclose(quadrature.get_ydata(), [0.0, 1.0, 0.0], atol=1e-12)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "forward 77 rad/s, growth 0.4 /s",
        "backward 66 rad/s, decay 8.6 /s",
        "no whirl, decay 200 /s",
    ]
    assert ax.get_xlabel() == "position along the shaft [m]"


@pytest.mark.slow  # compiles eigenvalues with their vectors
def test_every_shaft_is_drawn():
    """hp from 0.3 m to 0.682 m, where a stiff bearing between the shafts keeps both together."""
    stiff = {"supports.3.kxx": 1e11, "supports.3.kyy": 1e11}
    modes = jr.modes(jr.load("dual-rotor").replace(stiff), 2)
    assert modes.shafts == (("lp", 101), ("hp", 101))
    ax = plot.mode_shapes(modes)
    first, other = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert first.get_linewidth() > other.get_linewidth()
    np.testing.assert_allclose(first.get_xdata()[[0, -1]], [0.0, 0.962])
    np.testing.assert_allclose(other.get_xdata()[[0, -1]], [0.3, 0.682])
    there = np.interp(0.682, first.get_xdata(), first.get_ydata())
    np.testing.assert_allclose(other.get_ydata()[-1], there, atol=1e-3)
    assert len(ax.get_legend().get_texts()) == 2
    drawn, _ = plot.modes3d(modes, [0, 1])
    dark = [line for line in drawn.lines if line.get_label() == "phase 0"]
    assert [len(line.get_data_3d()[0]) for line in dark] == [101, 101]


def test_mode_shapes_draw_one_of_each_conjugate_pair():
    shapes = [[0, 1.0, 2.0]] * 2
    stations = np.linspace(0.0, 0.4, 3)
    pair = motions([-1 + 50j, -1 - 50j], shapes, np.zeros((2, 3)), stations=stations)
    with plot.units(length="mm"):
        ax = plot.mode_shapes(pair)
    (line,) = [line for line in ax.lines if line.get_marker() == "."]
    np.testing.assert_allclose(line.get_xdata(), [0.0, 200.0, 400.0])
    assert ax.get_xlabel() == "position along the shaft [mm]"


def test_onset_draws_speed_and_frequency():
    speed, frequency = plot.onset([0.01, 0.02], [300.0, 200.0], [70.0, np.nan])
    np.testing.assert_allclose(speed.lines[0].get_data(), [[0.01, 0.02], [300.0, 200.0]])
    np.testing.assert_allclose(frequency.lines[0].get_ydata(), [70.0, np.nan])
    assert speed.get_ylabel() == "onset speed [rad/s]"
    assert frequency.get_ylabel() == "whirl frequency at onset [rad/s]"
    relabelled, _ = plot.onset([1.0], [2.0], [3.0], x_label="shaft diameter [mm]")
    assert relabelled.get_xlabel() == "shaft diameter [mm]"


# === Campbell diagram


def branches(slopes, growth, frame="fixed", speeds=(0.0, 10.0, 20.0, 30.0)):
    """Branches `frequency + slope Omega` with a constant growth rate."""
    speeds = jnp.asarray(speeds)
    values = [g + 1j * (f + s * speeds) for (f, s), g in zip(slopes, growth, strict=True)]
    circular = frame == "fixed" and any(f < 0 for f, _ in slopes)
    return jr.Campbell(speeds, jnp.stack(values, axis=1), frame, circular)


GYROSCOPIC = [(20.0, 0.1), (-20.0, 0.1), (90.0, 1.0), (-90.0, 1.0)]  # [rad/s], [1]


def parts(line):
    """The branches that one line joins, without the gaps between them."""
    x, y = (np.asarray(a) for a in line.get_data())
    ends = np.flatnonzero(np.isnan(x))
    return [
        (x[k][np.isfinite(y[k])], y[k][np.isfinite(y[k])])
        for k in np.split(np.arange(len(x)), ends)
        if np.isfinite(y[k]).any()
    ]


def rings(ax):
    found = [line for line in ax.lines if line.get_marker() == "o"]
    return {to_hex(line.get_color()).upper(): np.asarray(line.get_data()) for line in found}


def test_campbell_draws_forward_and_backward_branches():
    upper, lower = plot.campbell(branches(GYROSCOPIC, [-1.0, -2.0, 0.5, -3.0]))
    speeds = np.arange(0.0, 31.0, 10.0)
    for label, colour, lines_, rates in (
        ("forward whirl", colours.FORWARD, [20 + 0.1 * speeds, 90 + speeds], [-1.0, 0.5]),
        ("backward whirl", colours.BACKWARD, [20 - 0.1 * speeds, 90 - speeds], [-2.0, -3.0]),
    ):
        frequency, growth = lines(upper)[label], lines(lower)[label]
        assert to_hex(frequency.get_color()).upper() == colour
        for (x, y), (_, g), expected, rate in zip(
            parts(frequency), parts(growth), lines_, rates, strict=True
        ):
            np.testing.assert_allclose(x, speeds)
            np.testing.assert_allclose(y, expected)
            np.testing.assert_allclose(g, rate)
    assert upper.get_ylabel() == "whirl frequency [rad/s]" and upper.get_ylim()[0] == 0
    assert lower.get_ylabel() == "growth rate [1/s]" and lower.get_yscale() == "linear"
    assert lower.get_xlabel() == "spin speed [rad/s]"


def test_campbell_marks_critical_speeds():
    upper, _ = plot.campbell(branches(GYROSCOPIC, [-1.0] * 4))
    synchronous = lines(upper)["synchronous"]
    np.testing.assert_allclose(synchronous.get_ydata(), synchronous.get_xdata())
    # 20 + 0.1 Omega = Omega and 20 - 0.1 Omega = Omega; the fast branches stay above
    np.testing.assert_allclose(rings(upper)[colours.FORWARD], [[20 / 0.9]] * 2)
    np.testing.assert_allclose(rings(upper)[colours.BACKWARD], [[20 / 1.1]] * 2)
    assert "critical speed, damped" in lines(upper)


def test_campbell_shows_every_cross_that_it_lists():
    """Of branches that stay below 15 rad/s the axis reaches to the undamped critical speed."""
    slow = branches([(10.0, 0.1), (-10.0, 0.1)], [-1.0] * 2)
    upper, _ = plot.campbell(slow, critical=undamped([28.0, 150.0]))
    np.testing.assert_allclose(lines(upper)["critical speed, undamped"].get_ydata(), [28.0])
    assert upper.get_ylim() == pytest.approx((0.0, 1.05 * 28.0))


def test_campbell_tells_damped_from_undamped_critical_speeds():
    """A ring has its number and damping ratio beside it; none is drawn where damping leaves no peak."""
    damped = branches(GYROSCOPIC, [-2.0, -20.0, -1.0, -1.0])
    upper, _ = plot.campbell(damped, critical=undamped([20 / 0.9, 150.0]))
    at, fast = 20 / 0.9, 20 / 1.1  # [rad/s], decay 2 /s and 20 /s
    ratio, other = 2.0 / np.hypot(2.0, at), 20.0 / np.hypot(20.0, fast)
    assert [note.get_text() for note in upper.texts] == [
        rf"$\bf{{1}}$  {ratio:.2g}",
        f"1  22.22 rad/s, forward, D = {ratio:.2g}",
        f"\N{EN DASH}  18.18 rad/s, backward, D = {other:.2g}",
        "\N{MULTIPLICATION SIGN}  22.22 rad/s, forward",
    ]
    assert upper.texts[0].xy == pytest.approx((at, at))
    marks = lines(upper)
    np.testing.assert_allclose(marks["critical speed, undamped"].get_xdata(), [at])
    assert "1 damped by over 0.2" in marks


def test_campbell_numbers_and_lists_its_rings():
    """Rings are numbered by ascending speed along each line; close ones have no ratio beside them."""
    with plot.units(speed="rpm"):
        upper, _ = plot.campbell(branches(GYROSCOPIC, [-1.0] * 4), orders=(1, 2))
    turns = 30 / np.pi
    speeds = turns * np.array([20 / 1.1, 20 / 0.9, 20 / 2.1, 20 / 1.9])  # 20 -+ 0.1 Omega = n Omega
    rings = {note.get_text()[5:6]: note.xy for note in upper.texts if "$" in note.get_text()}
    assert [rings[name][0] for name in "1234"] == pytest.approx(speeds)
    assert [rings[name][1] for name in "34"] == pytest.approx(2 * speeds[2:])
    listed = [note for note in upper.texts if "rpm" in note.get_text()]
    for note, speed, colour in zip(
        listed, speeds, [colours.BACKWARD, colours.FORWARD] * 2, strict=False
    ):
        assert f"  {speed:.4g} rpm, " in note.get_text() and note.get_color() == colour
    assert [note.get_text().endswith("(2x)") for note in listed[:4]] == [False, False, True, True]


def test_campbell_counts_what_its_list_has_no_room_for():
    upper, _ = plt.subplots(2, figsize=(4.0, 2.0))[1]
    steps = [(20.0 + k, 0.1) for k in range(7)]
    plot.campbell(branches(steps, [-1.0] * 7), (upper, upper.figure.axes[1]))
    texts = [note.get_text() for note in upper.texts]
    assert texts[-1] == f"and {7 - sum('rad/s' in text for text in texts)} more"


def test_campbell_of_more_orders():
    upper, _ = plot.campbell(branches(GYROSCOPIC, [-1.0] * 4), orders=(2.5, 3), highest=70.0)
    assert upper.get_ylim() == (0.0, 70.0)
    thrice = lines(upper)["3 a revolution"]
    np.testing.assert_allclose(thrice.get_ydata(), 3 * thrice.get_xdata())
    crossings = [line.get_xdata() for line in upper.lines if line.get_marker() == "o"]
    # 20 + 0.1 Omega = n Omega; backward 20 - 0.1 Omega and 90 - Omega
    expected = [[20 / 2.4], [20 / 2.9], [20 / 2.6, 90 / 3.5], [20 / 3.1, 90 / 4]]
    for found, x in zip(crossings, expected, strict=True):
        np.testing.assert_allclose(np.sort(found), x)
    assert "critical speed, damped" not in lines(upper) and "crossing" in lines(upper)


def test_campbell_mirrored():
    upper, lower = plot.campbell(branches(GYROSCOPIC, [-1.0] * 4), mirrored=True)
    x, y = parts(lines(upper)["backward whirl"])[0]
    np.testing.assert_allclose((x, y), [[0, -10, -20, -30], [20, 19, 18, 17]], atol=1e-12)
    assert parts(lines(lower)["backward whirl"])[0][0].max() == 0.0
    x, y = parts(lines(upper)["forward whirl"])[0]
    np.testing.assert_allclose((x, y), [[0, 10, 20, 30], [20, 21, 22, 23]])
    np.testing.assert_allclose(rings(upper)[colours.BACKWARD], [[-20 / 1.1], [20 / 1.1]])
    wings = lines(upper)["synchronous"]
    np.testing.assert_allclose(wings.get_data(), [[-30, 0, 30], [30, 0, 30]])
    assert "backward whirl at negative" in lower.get_xlabel()


def test_campbell_says_why_it_is_not_mirrored():
    with pytest.raises(ValueError, match=r"has no backward branch; leave `mirrored` out\.$"):
        plot.campbell(branches([(20.0, 0.1)], [0.0]), mirrored=True)
    both_ways = branches(GYROSCOPIC, [0.0] * 4, speeds=(-30.0, 0.0, 30.0))
    with pytest.raises(ValueError, match=r"from -30 to 30 rad/s; begin at 0\.$"):
        plot.campbell(both_ways, mirrored=True)


def test_campbell_of_a_rotor_that_spins_both_ways():
    """Forward is with the spin, so a branch changes its direction at standstill."""
    upper, _ = plot.campbell(branches(GYROSCOPIC[:2], [0.0] * 2, speeds=(-30.0, 0.0, 30.0)))
    forward = parts(lines(upper)["forward whirl"])
    np.testing.assert_allclose(forward[0], [[0.0, 30.0], [20.0, 23.0]])
    np.testing.assert_allclose(forward[1], [[-30.0], [23.0]])


def test_campbell_of_elliptic_whirl_has_no_direction():
    upper, _ = plot.campbell(branches([(19.0, -0.1), (21.0, 0.1)], [0.0, 1e-14]))
    assert "whirl" in lines(upper) and "forward whirl" not in lines(upper)
    np.testing.assert_allclose(np.sort(rings(upper)[colours.DARK][0]), [19 / 1.1, 21 / 0.9])


def test_campbell_in_the_axes_of_the_shaft():
    result = branches([(-20.0, 2.0), (20.0, 1.0)], [-1.0, -1.0], "rotating")
    upper, _ = plot.campbell(result)
    x, y = parts(lines(upper)["whirl"])[0]
    np.testing.assert_allclose((x, y), [[0, 10, 20, 30], [20, 0, 20, 40]])
    weight = lines(upper)["weight"]
    np.testing.assert_allclose(weight.get_ydata(), weight.get_xdata())
    assert "axes\nof the shaft [rad/s]" in upper.get_ylabel() and not rings(upper)


def test_campbell_shows_a_slow_branch_beside_fast_ones():
    _, lower = plot.campbell(branches(GYROSCOPIC, [0.5, -1.0, -900.0, -1000.0]))
    assert lower.get_yscale() == "asinh"
    at = lambda growth: lower.transAxes.inverted().transform(
        lower.transData.transform((0.0, growth))
    )[1]
    assert at(0.5) - at(0.0) > 0.03  # a linear axis would give 0.0005
    assert 0.0 in lower.get_yticks()


def test_campbell_takes_rounding_for_zero():
    upper, lower = plot.campbell(branches([(20.0, 0.0), (-20.0, 0.0)], [1e-13, -1e-13]))
    assert (parts(lines(lower)["forward whirl"])[0][1] == 0).all()
    assert lower.get_ylim() == (-1.0, 1.0)
    _, lower = plot.campbell(branches([(1e-12, 0.0), (-20.0, 0.0)], [-50.0, -1.0]))
    assert to_hex(lines(lower)["no whirl"].get_color()).upper() == colours.UNDEFINED


# === modes in space


def orbits(ax):
    """Direction, colour and orbits (station, path) of each line of orbits."""
    found = {}
    for line in ax.lines:
        if line.get_label() in ("forward", "backward", "straight"):
            x, y, z = (np.asarray(a) for a in line.get_data_3d())
            path = np.where(np.isfinite(y), y + 1j * z, np.nan)
            whole = np.isfinite(y)
            groups = np.split(np.arange(len(x)), np.flatnonzero(~whole))
            paths = [(x[k[-1]], path[k][np.isfinite(path[k])]) for k in groups if whole[k].any()]
            assert (
                to_hex(line.get_color()).upper()
                == {
                    "forward": colours.FORWARD,
                    "backward": colours.BACKWARD,
                    "straight": colours.UNDEFINED,
                }[line.get_label()]
            )
            found[line.get_label()] = paths
    return found


def test_modes3d_draws_circles_of_both_directions():
    shape = [0.0, 0.5j, 1.0]
    drawn = plot.modes3d(motions([-1 + 70j, -60j], [shape, shape]))
    for ax, way, sign in zip(drawn, ("forward", "backward"), (1, -1), strict=True):
        ((way_found, paths),) = orbits(ax).items()
        assert way_found == way and [at for at, _ in paths] == [0.5, 1.0]  # no orbit at the clamp
        for (_, path), start in zip(paths, shape[1:], strict=True):
            np.testing.assert_allclose(np.abs(path), abs(start))
            np.testing.assert_allclose(path[0], start)
            turned = np.sum(np.angle(path[1:] / path[:-1]))
            assert turned == pytest.approx(sign * 2 * np.pi * 11 / 12)
        (line,) = [line for line in ax.lines if line.get_label() == "phase 0"]
        np.testing.assert_allclose(line.get_data_3d(), [[0, 0.5, 1], [0, 0, 1], [0, 0.5, 0]])
    assert [ax.get_title() for ax in drawn] == [
        "forward, 70 rad/s, decay 1 /s",
        "backward, 60 rad/s, undamped",
    ]
    assert drawn[0].get_xlabel() == "position [m]"
    assert (drawn[0].get_ylabel(), drawn[0].get_zlabel()) == ("x [1]", "y [1]")


def test_modes3d_draws_ellipses_by_their_direction_at_each_station():
    """`z = s exp(i p) + conj(c exp(i p))`: axes |s| + |c| and |s| - |c|, forward where |s| > |c|."""
    pair = motions(
        [50j, -50j],
        [[0.75, 0.25, 0.5], [0.75, 0.25, 0.5]],
        [[0.25, 0.75, 0.5], [0.25, 0.75, 0.5]],
        stations=(1.0, 0.0, 0.5),
    )
    (ax,) = plot.modes3d(pair)  # one of the conjugate pair
    found = orbits(ax)
    for way, at, turned in (("forward", 1.0, 1), ("backward", 0.0, -1)):
        ((station, path),) = found[way]
        assert station == at
        np.testing.assert_allclose((path.real / 1.0) ** 2 + (path.imag / 0.5) ** 2, 1.0)
        assert np.imag(np.conj(path[0]) * path[1]) * turned > 0
    ((station, path),) = found["straight"]
    assert station == 0.5
    np.testing.assert_allclose(path.imag, 0.0, atol=1e-12)
    assert ax.get_title() == "forward and backward and straight, 50 rad/s, undamped"


def test_modes3d_of_negative_spin():
    """At negative speed whirl from y to x is with the spin."""
    drawn = plot.modes3d(motions([70j, -60j], np.ones((2, 3)), speed=-30.0))
    assert [list(orbits(ax)) for ax in drawn] == [["backward"], ["forward"]]
    assert (
        plot.mode_shapes(motions([70j], np.ones((1, 3)), speed=-30.0)).lines[0].get_label()
        == "backward 70 rad/s, undamped"
    )


def test_modes3d_in_the_axes_of_the_shaft():
    """At 30 rad/s, 50 rad/s in rotating axes is 80 with the spin and 20 against it in fixed axes."""
    ahead, behind, bent = plot.modes3d(
        motions(
            [50j, 50j, 3.0],
            [[1.0] * 3, [0.25] * 3, [1.0] * 3],
            [[0.25] * 3, [1.0] * 3, [1.0] * 3],
            frame="rotating",
        )
    )
    assert ahead.get_title() == "forward, 80 rad/s, undamped"
    assert behind.get_title() == "backward, 20 rad/s, undamped"
    assert bent.get_title() == "forward, 30 rad/s, growth 3 /s" and not orbits(bent)
    ((_, path), *_) = orbits(ahead)["forward"]  # drawn in the axes of the shaft
    np.testing.assert_allclose(np.ptp(path.real) / np.ptp(path.imag), 5 / 3, rtol=1e-2)
    assert ahead.get_ylabel() == "x of the shaft [1]"


def test_modes3d_without_whirl_has_no_orbit():
    (ax,) = plot.modes3d(motions([-200 + 1e-13j], [[0, 0.5, 1.0]]))
    assert not orbits(ax) and ax.get_title() == "no whirl, decay 200 /s"


def test_modes3d_of_one_station_and_of_chosen_modes():
    many = motions(np.arange(1, 7) * 10j, np.ones((6, 1)), stations=(0.3,))
    assert len(plot.modes3d(many)) == 4
    (ax,) = plot.modes3d(many, [-1])
    assert ax.get_title() == "forward, 60 rad/s, undamped"
    assert [at for at, _ in orbits(ax)["forward"]] == [0.3]
    for numbers in ([6], []):
        with pytest.raises(ValueError, match=r"`numbers` must be one or more of 0 to 5, but is"):
            plot.modes3d(many, numbers)


def test_modes3d_in_given_axes():
    one = motions([10j], [[0.0, 1.0, 2.0]])
    ax = plt.figure().add_subplot(projection="3d")
    assert plot.modes3d(one, axes=ax) == (ax,)
    with pytest.raises(ValueError, match=r"must be 1 3-D Axes .*, but are 1: rectilinear\.$"):
        plot.modes3d(one, axes=plt.subplots()[1])


# === response


def resonance(damping=0.05, speeds=None):
    """`z = e W^2 / (w^2 - W^2 + 2 i D w W)` with w = 100 rad/s, and twice this at a second station."""
    scene = jr.Scene(
        jr.RigidShaft(0.4, (jr.Constraint(0.0),)),
        jr.Disc(0.4, 1.0),
        jr.Support(0.4, 1e4, 200.0 * damping),
        jr.Unbalance(0.4, 1.0, 2e-3),
        spin=jr.ConstantSpeed(1.0),
    )
    speeds = np.linspace(0.0, 300.0, 301) if speeds is None else speeds
    return jr.unbalance_response(scene, speeds, at=[0.2, 0.4])


def undamped(speeds):
    """Forward critical speeds of circular whirl."""
    speeds = jnp.asarray(speeds)
    senses = jnp.ones((speeds.size, 2))
    return jr.CriticalSpeeds(speeds, jnp.ones(speeds.size), jnp.array([0.0, 0.4]), senses, None)


def circles(speeds, stations, forward):
    speeds = jnp.asarray(speeds)
    return jr.HarmonicResponse(speeds, speeds, stations, forward, 0 * forward, None)


def test_response_draws_amplitude_and_phase():
    upper, lower = plot.response(resonance(), station=1, critical=undamped([100.0, 400.0]))
    speed, amplitude = upper.lines[0].get_data()
    assert amplitude[speed == 100.0] == pytest.approx([2 * 1.0 / 0.1])  # mm: 2 e / (2 D)
    phase = lower.lines[0].get_ydata()
    assert np.isnan(phase[0])  # nothing moves at rest
    assert phase[speed == 100.0] == pytest.approx([-90.0])
    assert (np.diff(phase[1:]) < 0).all() and phase[-1] < -170
    marks = lines(upper)["critical, forward"]
    np.testing.assert_allclose(marks.get_xdata(), 100.0)  # 400 rad/s is outside
    assert sum(line.get_linestyle() == "--" for line in upper.lines) == 1
    assert upper.get_ylabel() == "amplitude [mm]" and lower.get_ylabel() == "phase [deg]"
    assert lower.get_xlabel() == "spin speed [rad/s]" and upper.get_ylim()[0] == 0.0


def test_response_with_a_limit_is_peak_to_peak():
    """2 e / (2 D) is 20 mm, so 40 mm peak to peak; a limit of 50 mm, and one that is far beyond."""
    upper, _ = plot.response(resonance(), station=1, limit=0.05)
    speed, swing = upper.lines[0].get_data()
    assert swing[speed == 100.0] == pytest.approx([4 * 1.0 / 0.1])
    np.testing.assert_allclose(lines(upper)["limit"].get_ydata(), 50.0)
    assert upper.get_ylabel() == "peak to peak [mm]"
    far, _ = plot.response(resonance(), station=1, limit=1.0)
    assert "limit 1e+03 mm, beyond" in lines(far) and far.get_ylim()[1] < 100


def test_response_in_micrometres_and_decades():
    small = resonance()
    small = circles(small.speeds, small.stations, 1e-3 * small.forward)
    upper, _ = plot.response(small, log=True)
    assert upper.lines[0].get_ydata().max() == pytest.approx(10.0, rel=0.01)
    assert upper.get_ylabel() == "amplitude [\N{MICRO SIGN}m]" and upper.get_yscale() == "log"


def test_response_phase_runs_on():
    """Two resonances shift the phase by 360 degrees; without damping it drops by 180 degrees."""
    speeds = np.linspace(1.0, 400.0, 800)
    product = np.prod([w**2 / (w**2 - speeds**2 + 4j * speeds) for w in (100.0, 250.0)], axis=0)
    both = jnp.asarray(product[:, None], complex)
    result = circles(speeds, jnp.array([0.2]), both)
    phase = plot.response(result)[1].lines[0].get_ydata()
    assert (np.diff(phase) < 0).all() and -360 < phase[-1] < -350 and phase[0] > -1
    undamped = plot.response(resonance(0.0, [50.0, 90.0, 110.0, 200.0]))[1].lines[0].get_ydata()
    np.testing.assert_allclose(undamped, [0.0, 0.0, -180.0, -180.0], atol=1e-9)


def test_response_draws_the_parts_there_are():
    """Both parts of an ellipse are drawn over frequency at one speed, and the one part of weight."""
    frequencies, one = jnp.linspace(10.0, 90.0, 5), jnp.array([0.2])
    forward = jnp.full((5, 1), 2e-3 + 0j)
    found = jr.HarmonicResponse(jnp.full(5, 300.0), frequencies, one, forward, 0.5j * forward, None)
    upper, lower = plot.response(found)
    assert lower.get_xlabel() == "frequency [rad/s]"
    np.testing.assert_allclose(lines(upper)["forward part"].get_data(), [frequencies, [2.0] * 5])
    np.testing.assert_allclose(lines(upper)["backward part"].get_ydata(), 1.0)
    np.testing.assert_allclose(lines(lower)["backward part"].get_ydata(), 90.0)
    np.testing.assert_allclose(lines(upper)["major half axis"].get_ydata(), 3.0)
    weight = jr.WeightResponse(frequencies, one, 0 * forward, 3 * forward)
    upper, lower = plot.response(weight)
    assert lower.get_xlabel() == "spin speed [rad/s]" and len(upper.lines) == 1
    np.testing.assert_allclose(lines(upper)["twice per revolution"].get_ydata(), 6.0)


def test_response_shades_where_nothing_settles():
    result = resonance()
    speeds = np.asarray(result.speeds)
    upper, lower = plot.response(result, growth=speeds - 210.0)
    for ax in (upper, lower):
        (ground,) = ax.collections
        reach = ground.get_paths()[0].get_extents()
        assert (reach.x0, reach.x1) == (211.0, 300.0) and (reach.y0, reach.y1) == (0.0, 1.0)
    assert "unstable" in [text.get_text() for text in upper.get_legend().get_texts()]
    stable, _ = plot.response(result, growth=-np.ones_like(speeds))
    assert not stable.collections


def test_response_marks_peaks_and_what_they_are_kept_from():
    found = resonance()
    none = jr.CriticalSpeeds(jnp.zeros(0), jnp.zeros(0), jnp.zeros(2), jnp.zeros((0, 2)), None)
    ends = [np.array([value]) for value in (100.0, 20e-3, 95.0, 105.0)]
    peaks = jr.ResponsePeaks(found, none, *ends)
    upper, lower = plot.response(
        found, station=1, peaks=peaks, operating=(150.0, 180.0), clearance=0.03
    )
    (bar,) = [line for line in upper.lines if line.get_marker() == "|"]
    np.testing.assert_allclose(bar.get_data(), [[95.0, 105.0], [20 * np.sqrt(0.5)] * 2])
    assert [text.get_text() for text in upper.texts] == ["AF 10"]
    np.testing.assert_allclose(lines(upper)["clearance"].get_ydata(), 30.0)
    for ax in (upper, lower):
        (band,) = ax.patches
        assert (band.get_x(), band.get_width()) == (150.0, 30.0)
    upper, _ = plot.response(found, operating=(150.0, 150.0))
    np.testing.assert_allclose(lines(upper)["operating speed"].get_xdata(), 150.0)


def test_response_of_probes():
    """A straight orbit along 30 degrees: a probe across it reads nothing."""
    speeds, one = jnp.linspace(10.0, 90.0, 5), jnp.array([0.2])
    along = jnp.full((5, 1), 1e-3 * np.exp(1j * np.pi / 6))
    result = jr.HarmonicResponse(speeds, speeds, one, along, along, None)
    upper, lower = plot.response(result, probes=(np.pi / 6, 2 * np.pi / 3))
    np.testing.assert_allclose(lines(upper)["probe at 30\N{DEGREE SIGN}"].get_ydata(), 2.0)
    across = lines(upper)["probe at 120\N{DEGREE SIGN}"].get_ydata()
    np.testing.assert_allclose(across, 0.0, atol=1e-12)
    np.testing.assert_allclose(
        lines(lower)["probe at 30\N{DEGREE SIGN}"].get_ydata(), 0.0, atol=1e-9
    )
    weight = jr.WeightResponse(speeds, one, 0 * along, along)
    with pytest.raises(ValueError, match="leave `probes` out"):
        plot.response(weight, probes=(0.0,))


def test_response_of_a_station_that_is_not_there():
    with pytest.raises(ValueError, match="`station` must be 0 to 1, but is 2."):
        plot.response(resonance(), station=2)
