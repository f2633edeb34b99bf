"""Plots: what is drawn, of data whose answer is known."""

import types

import matplotlib


matplotlib.use("Agg")

import jax.numpy as jnp  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402
import xarray as xr  # noqa: E402
from matplotlib.animation import FFMpegWriter  # noqa: E402
from matplotlib.colors import LogNorm, to_hex  # noqa: E402
from PIL import Image  # noqa: E402

import jaxrotor as jr  # noqa: E402
from jaxrotor import plot  # noqa: E402
from jaxrotor.analysis.balancer import StabilityChart  # noqa: E402
from jaxrotor.plot import colours, page  # noqa: E402


STEPS = 64
SPEED = 662.0
ECCENTRICITY = "unbalance.eccentricity"


@pytest.fixture(autouse=True)
def rendered_without_warnings():
    """Every figure a test leaves must draw, and no test leaves a figure or a setting behind."""
    settings = dict(matplotlib.rcParams)
    yield
    for number in plt.get_fignums():
        plt.figure(number).canvas.draw()
    plt.close("all")
    assert dict(matplotlib.rcParams) == settings


def response(whirl, ripple, turns=8, station=0.7, scene=None, slope=None):
    """Whirl at `Lambda = whirl + ripple cos 3 theta`, 10 mm from the centre; x = 10 mm at first."""
    angle = 2 * np.pi * np.arange(turns * STEPS + 1) / STEPS
    z = 0.01 * np.exp(1j * (whirl * angle + ripple / 3 * np.sin(3 * angle)))
    return types.SimpleNamespace(
        time=angle / SPEED,
        angle=angle,
        displacement=np.stack([z, 2 * z], axis=1),
        velocity=np.stack([z, 2 * z], axis=1)
        * (1j * SPEED * (whirl + ripple * np.cos(3 * angle)))[:, None],
        slope=np.stack([z, z], axis=1) if slope is None else slope,
        contact_force=None,
        stations=np.array([station, 0.3]),
        steps_per_revolution=STEPS,
        scene=scene or rotor(),
    )


def rotor(*limiters):
    return jr.Scene(
        jr.FlexibleShaft(length=0.7, diameter=0.02), *limiters, spin=jr.ConstantSpeed(SPEED)
    )


def sweep(**extra):
    """Three lanes: undefined, forward, backward; two revolutions, up to three extrema in each."""
    nan = np.nan
    extrema = [
        [[0.0, nan, nan], [nan, nan, nan]],
        [[0.001, -0.002, nan], [0.003, nan, nan]],
        [[0.004, -0.005, 0.006], [nan, nan, nan]],
    ]
    section = [[[0.0, 9.0]] * 2, [[0.0011, 9.0], [0.0012, 9.0]], [[0.0041, 9.0], [0.0042, 9.0]]]
    return xr.Dataset(
        {
            "extrema": ((ECCENTRICITY, "revolution", "extremum"), np.array(extrema)),
            "section": ((ECCENTRICITY, "revolution", "axis"), np.array(section)),
            "index": (ECCENTRICITY, np.array([nan, 0.1, -0.9])),
            "status": (ECCENTRICITY, np.array([0, 0, 0])),
            **extra,
        },
        coords={
            ECCENTRICITY: (ECCENTRICITY, np.array([0.0, 5e-4, 1e-3]), {"units": "m"}),
            "axis": ["x", "y"],
        },
    )


def spectra(lanes=5, name="spin.speed", units="rad/s"):
    frequency = np.linspace(0.0, 20.0, 81)
    amplitude = 1e-9 + np.exp(-(((frequency - 3.0) / 0.3) ** 2))
    return xr.Dataset(
        {"spectrum": ((name, "frequency"), np.arange(1, lanes + 1)[:, None] * amplitude)},
        coords={
            name: (name, np.linspace(100.0, 500.0, lanes), {"units": units}),
            "frequency": frequency,
        },
    )


def lines(ax):
    return {line.get_label(): line for line in ax.lines}


# === bifurcation


def test_bifurcation_draws_extrema_by_direction():
    upper, lower = plot.bifurcation(sweep())
    drawn = lines(upper)
    assert list(drawn) == ["forward whirl", "backward whirl", "undefined"]
    for label, x, y, colour in (
        ("forward whirl", [0.5] * 3, [1.0, -2.0, 3.0], colours.FORWARD),
        ("backward whirl", [1.0] * 3, [4.0, -5.0, 6.0], colours.BACKWARD),
        ("undefined", [0.0], [0.0], colours.UNDEFINED),
    ):
        np.testing.assert_allclose(drawn[label].get_xdata(), x)
        np.testing.assert_allclose(drawn[label].get_ydata(), y)
        assert to_hex(drawn[label].get_color()).upper() == colour
    assert [text.get_text() for text in upper.get_legend().get_texts()] == list(drawn)
    assert "[mm]" in upper.get_ylabel()
    assert lower.get_xlabel() == "unbalance eccentricity [mm]"


def test_bifurcation_draws_index_below_with_zero_line():
    upper, lower = plot.bifurcation(sweep())
    points = {to_hex(line.get_color()).upper(): line.get_ydata() for line in lower.lines}
    np.testing.assert_allclose(points[colours.FORWARD], [0.1])
    np.testing.assert_allclose(points[colours.BACKWARD], [-0.9])
    assert any(np.array_equal(line.get_ydata(), [0.0, 0.0]) for line in lower.lines)
    assert upper.get_xlim() == lower.get_xlim()
    assert "[1]" in lower.get_ylabel()


def test_bifurcation_of_section_draws_its_x():
    upper, _ = plot.bifurcation(sweep(), section=True)
    np.testing.assert_allclose(lines(upper)["forward whirl"].get_ydata(), [1.1, 1.2])
    assert "once a revolution" in upper.get_ylabel()


def test_bifurcation_in_any_order_of_dimensions():
    upper, _ = plot.bifurcation(sweep().transpose("extremum", "revolution", ECCENTRICITY, "axis"))
    np.testing.assert_allclose(sorted(lines(upper)["forward whirl"].get_ydata()), [-2.0, 1.0, 3.0])


def test_bifurcation_rasterises_only_huge_clouds():
    small, _ = plot.bifurcation(sweep())
    assert not lines(small)["forward whirl"].get_rasterized()
    dataset = sweep().drop_vars(["extrema", "section"])
    huge = np.zeros((3, page.RASTER + 1, 1))
    dataset["extrema"] = ((ECCENTRICITY, "revolution", "extremum"), huge)
    large, _ = plot.bifurcation(dataset)
    assert lines(large)["forward whirl"].get_rasterized()


def test_bifurcation_uses_given_axes():
    figure, axes = plt.subplots(2)
    assert plot.bifurcation(sweep(), axes) == tuple(axes)
    with pytest.raises(ValueError, match="`axes` must be two Axes, but are 1."):
        plot.bifurcation(sweep(), axes[0])


def test_bifurcation_says_what_it_lacks():
    for name in ("extrema", "index"):
        with pytest.raises(ValueError, match=rf"has no `{name}`.*`observe=`\.$"):
            plot.bifurcation(sweep().drop_vars(name))
    with pytest.raises(ValueError, match="has no `section`"):
        plot.bifurcation(sweep().drop_vars("section"), section=True)


def test_bifurcation_takes_one_swept_dimension():
    two = sweep().drop_vars("status").expand_dims({"spin.speed": [600.0, 700.0]})
    with pytest.raises(ValueError, match=r"'spin.speed', 'unbalance.eccentricity'.*`\.sel`.*\.$"):
        plot.bifurcation(two)
    plot.bifurcation(two.isel({"spin.speed": 0}))
    plot.bifurcation(two.rename({"spin.speed": "start.rate"}))  # starts are drawn over each other
    ways = two.rename({"spin.speed": "branch"}).assign_coords(branch=["up", "down"])
    upper, lower = plot.bifurcation(ways)
    assert {line.get_marker() for line in lower.lines} >= {"^", "v"}
    assert "below: up" in [text.get_text() for text in upper.get_legend().get_texts()]
    _, lower = plot.bifurcation(sweep().rename({ECCENTRICITY: "start.radius"}))
    assert lower.get_xlabel() == "start radius [mm]"
    with pytest.raises(ValueError, match="`extrema` has none; select a range"):
        plot.bifurcation(sweep().isel({ECCENTRICITY: 0}))


# === rotor


def test_rotor_is_drawn_to_scale():
    """The disc of the limiter rotor is 200 mm across and 10 mm thick, its stops 7.5 mm off the rim."""
    ax = plot.rotor(jr.load("limiter-rotor"))
    boxes = {box.get_label(): box for box in ax.patches if not box.get_label().startswith("_")}
    assert list(boxes) == ["shaft", "disc", "limiter"]
    (left, low), height = boxes["disc"].get_xy(), boxes["disc"].get_height()
    assert (low, height) == pytest.approx((-100.0, 200.0))
    assert left + boxes["disc"].get_width() / 2 == pytest.approx(700.0)
    assert (boxes["shaft"].get_width(), boxes["shaft"].get_height()) == pytest.approx((700.0, 20.0))
    stops = [box for box in ax.patches if box.get_facecolor() == boxes["limiter"].get_facecolor()]
    near = [min(abs(box.get_y()), abs(box.get_y() + box.get_height())) for box in stops]
    assert (
        near == pytest.approx([107.5] * len(near)) and len(near) == 4
    )  # the one aside is seen twice
    assert ax.get_xlabel().endswith("not drawn: external damping, disc damping, internal damping")
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["shaft", "disc", "limiter", "clamp", "unbalance"]


@pytest.mark.parametrize("name", [name for name, _ in jr.files.shipped()])
def test_every_shipped_rotor_can_be_drawn(name):
    scene = jr.load(name)
    low, high = plot.rotor(scene).get_xlim()
    assert low <= 0.0 and high >= 1e3 * float(scene.shaft.length)
    plt.close("all")


# === orbit


def test_orbit_is_in_millimetres_with_equal_scales():
    ax = plot.orbit(response(0.5, 0.0))
    drawn = lines(ax)["orbit"]
    np.testing.assert_allclose(np.hypot(drawn.get_xdata(), drawn.get_ydata()), 10.0)
    assert ax.get_aspect() == 1.0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x displacement [mm]", "y displacement [mm]")


def test_orbit_marks_each_revolution_in_red():
    points = lines(plot.orbit(response(0.25, 0.0)))["once a revolution"]
    # A quarter of a turn of whirl each revolution, from angle 0 to the end of the 8th.
    np.testing.assert_allclose(points.get_xdata(), [10, 0, -10, 0, 10, 0, -10, 0, 10], atol=1e-9)
    assert to_hex(points.get_color()).upper() == colours.RED


def test_orbit_marks_whole_revolutions_of_a_late_window():
    whole = response(0.25, 0.0)
    late = {
        name: getattr(whole, name)[STEPS // 2 :] for name in ("angle", "displacement", "velocity")
    }
    points = lines(plot.orbit(types.SimpleNamespace(**{**vars(whole), **late})))
    np.testing.assert_allclose(
        points["once a revolution"].get_xdata(), [0, -10, 0, 10, 0, -10, 0, 10], atol=1e-9
    )


def test_orbit_draws_limiters_of_its_station():
    limiters = [
        jr.Limiter(at=at, angle=angle, gap=gap, stiffness=1e6)
        for at, angle, gap in ((0.7, 0.0, 0.0075), (0.7, np.pi / 2, 0.006), (0.3, 1.0, 0.001))
    ]
    ax = plot.orbit(response(0.5, 0.0, scene=rotor(*limiters)))
    right, above = [line for line in ax.lines if to_hex(line.get_color()).upper() == colours.ORANGE]
    np.testing.assert_allclose(right.get_xdata(), [7.5, 7.5])
    np.testing.assert_allclose(np.sum(right.get_ydata()), 0.0, atol=1e-12)
    np.testing.assert_allclose(above.get_ydata(), [6.0, 6.0])
    np.testing.assert_allclose(np.sum(above.get_xdata()), 0.0, atol=1e-12)
    assert 1.0 < np.ptp(right.get_ydata()) < 7.5


def test_orbit_of_another_station():
    drawn = lines(plot.orbit(response(0.5, 0.0), station=1))["orbit"]
    np.testing.assert_allclose(np.hypot(drawn.get_xdata(), drawn.get_ydata()), 20.0)
    with pytest.raises(ValueError, match="`station` must be 0 to 1, but is 2."):
        plot.orbit(response(0.5, 0.0), station=2)


def test_orbit_takes_one_simulation():
    many = response(0.5, 0.0)
    many.displacement = many.displacement[None]
    with pytest.raises(ValueError, match=r"has shape \(1, 513, 2\).*pick one lane\.$"):
        plot.orbit(many)


# === periodic orbit


def test_periodic_orbit_goes_on_by_its_turn():
    z = 0.01 * np.exp(1j * np.linspace(0.0, -2 * np.pi / 3, 65))
    result = types.SimpleNamespace(
        displacement=z[:, None],
        turn=-2 * np.pi / 3,
        multipliers=np.array([-1.2 + 0.1j, -1.2 - 0.1j, 0.5]),
        trivial=1.0,
        stations=np.array([0.7]),
        scene=rotor(jr.Limiter(at=0.7, angle=0.0, gap=0.0075, stiffness=1e6)),
    )
    left, right = plot.periodic(result)
    drawn = lines(left)
    np.testing.assert_allclose(drawn["one period"].get_xdata(), 1e3 * z.real)
    greys = [line for line in left.lines if to_hex(line.get_color()).upper() == colours.GREY]
    assert len(greys) == 2  # and then it is closed
    np.testing.assert_allclose(greys[1].get_xdata()[-1], 10.0)
    drawn = lines(right)
    np.testing.assert_allclose(drawn["repels"].get_xdata(), [-1.2, -1.2])
    np.testing.assert_allclose(drawn["attracts"].get_xdata(), [0.5])
    np.testing.assert_allclose(drawn["in time"].get_xdata(), [1.0])


def test_harmonics_forward_and_backward():
    """Every circle by its whirl, and what is far below the largest left out."""
    coefficients = 1e-3 * np.array([2.0, 1e-9, 1.0, 5.0, 0.25])
    result = types.SimpleNamespace(
        orders=np.arange(-2, 3) / 2, coefficients=1j * coefficients[:, None], scene=rotor()
    )
    ax = plot.harmonics(result)
    drawn = lines(ax)
    np.testing.assert_allclose(drawn["forward"].get_xydata(), [[0.5, 5.0], [1.0, 0.25]])
    np.testing.assert_allclose(drawn["backward"].get_xydata(), [[-1.0, 2.0]])
    np.testing.assert_allclose(drawn["mean"].get_xydata(), [[0.0, 1.0]])
    assert ax.get_yscale() == "log" and ax.get_ylabel() == "amplitude [mm]"
    result.coefficients = 0 * result.coefficients
    with pytest.raises(ValueError, match="at rest in the centre"):
        plot.harmonics(result)


# === history


def test_history_is_in_revolutions_and_millimetres():
    ax = plot.history(response(0.5, 0.0, turns=2))
    drawn = lines(ax)
    np.testing.assert_allclose(drawn["x"].get_xdata()[[0, STEPS, -1]], [0.0, 1.0, 2.0])
    np.testing.assert_allclose(drawn["x"].get_ydata()[[0, STEPS, -1]], [10.0, -10.0, 10.0])
    np.testing.assert_allclose(drawn["y"].get_ydata()[STEPS // 2], 10.0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [revolutions]", "displacement [mm]")


def test_history_of_slope_is_in_milliradians():
    slope = np.full((2 * STEPS + 1, 2), 0.003 - 0.004j)
    ax = plot.history(response(0.5, 0.0, turns=2, slope=slope), slope=True)
    np.testing.assert_allclose(lines(ax)["x'"].get_ydata(), 3.0)
    np.testing.assert_allclose(lines(ax)["y'"].get_ydata(), -4.0)
    assert ax.get_ylabel() == "slope [mrad]"


# === whirl


def test_whirl_history_is_relative_to_the_spin():
    ax = plot.whirl_history(response(-0.5, 0.2))
    whirl = ax.lines[0]
    expected = -0.5 + 0.2 * np.cos(2 * np.pi * 3 * whirl.get_xdata())
    np.testing.assert_allclose(whirl.get_ydata(), expected, rtol=1e-9)
    assert "[1]" in ax.get_ylabel() and ax.get_xlabel() == "time [revolutions]"


def test_whirl_history_leaves_a_gap_at_rest_in_the_centre():
    still = response(0.5, 0.2)
    still.displacement = np.where(np.arange(8 * STEPS + 1)[:, None] < 5, 0.0, still.displacement)
    drawn = plot.whirl_history(still).lines[0].get_ydata()
    assert np.isnan(drawn[:5]).all() and np.isfinite(drawn[5:]).all()
    still.displacement = 0 * still.displacement
    assert plot.whirl_history(still).get_legend() is None


def test_spectrum_of_a_sinusoid_has_its_amplitude_and_frequency():
    ax = plot.whirl_spectrum(response(0.5, 0.2))
    frequency, amplitude = ax.lines[0].get_data()
    assert frequency[np.argmax(amplitude)] == pytest.approx(3.0)
    assert amplitude.max() == pytest.approx(0.2, rel=1e-9)
    assert amplitude[0] == pytest.approx(0.0, abs=1e-12)  # the mean is removed
    assert amplitude[np.abs(frequency - 3.0) > 0.2].max() < 1e-9
    assert frequency.max() <= 10.0
    assert ax.get_xlabel() == "frequency [cycles per revolution]"
    assert "[1]" in ax.get_ylabel()


def test_spectrum_of_a_rotor_spinning_backwards():
    mirrored = response(0.5, 0.2)
    mirrored.angle = -mirrored.angle
    frequency, amplitude = plot.whirl_spectrum(mirrored).lines[0].get_data()
    assert frequency[np.argmax(amplitude)] == pytest.approx(3.0)


def test_spectrum_of_a_dataset_is_drawn_as_stored():
    dataset = spectra()
    ax = plot.whirl_spectrum(dataset.isel({"spin.speed": 1}), highest=5.0)
    frequency, amplitude = ax.lines[0].get_data()
    np.testing.assert_allclose(frequency, np.linspace(0.0, 5.0, 21))
    np.testing.assert_allclose(amplitude, dataset["spectrum"].values[1, :21])
    plot.whirl_spectrum(dataset.isel({"spin.speed": [1]}))


def test_spectrum_says_what_to_do_next():
    with pytest.raises(ValueError, match=r"over 'spin.speed'; select .* with `waterfall`\.$"):
        plot.whirl_spectrum(spectra())
    with pytest.raises(ValueError, match=r"has no `spectrum`.*`observe=`\.$"):
        plot.whirl_spectrum(sweep().isel({ECCENTRICITY: 0}))
    still = response(0.5, 0.2)
    still.displacement = 0 * still.displacement
    with pytest.raises(ValueError, match=r"undefined at 512 of 512 samples.*\.$"):
        plot.whirl_spectrum(still)
    for angle in (0 * still.angle, still.angle**2):
        uneven = response(0.5, 0.2)
        uneven.angle = angle
        with pytest.raises(ValueError, match=r"sampled evenly in angle.*\.$"):
            plot.whirl_spectrum(uneven)


# === waterfall


def test_waterfall_maps_spectra_over_three_decades():
    ax = plot.waterfall(spectra())
    (mesh,) = ax.collections
    assert mesh.get_array().shape == (41, 5)  # frequencies up to 10, lanes
    assert isinstance(mesh.norm, LogNorm)
    assert mesh.norm.vmax == pytest.approx(5.0)
    assert mesh.norm.vmax / mesh.norm.vmin == pytest.approx(1e3)
    peak = np.unravel_index(np.argmax(mesh.get_array()), (41, 5))
    assert peak == (12, 4)  # 3 cycles per revolution, last lane
    assert mesh.get_rasterized()
    assert ax.get_xlabel() == "spin speed [rad/s]"
    assert ax.get_ylabel() == "frequency [cycles per revolution]"
    assert "[1]" in mesh.colorbar.ax.get_ylabel()


def test_waterfall_over_another_parameter_in_any_order():
    dataset = spectra(name="limiters.stiffness", units="N/m")
    ax = plot.waterfall(dataset.isel({"limiters.stiffness": [4, 0, 2, 1, 3]}), highest=4.0)
    np.testing.assert_allclose(ax.collections[0].get_array()[12], [1, 2, 3, 4, 5])
    assert ax.get_xlabel() == "limiters stiffness [N/m]"


def test_waterfall_leaves_lanes_without_spectrum_blank():
    dataset = spectra()
    dataset["spectrum"][2] = np.nan
    array = np.ma.masked_invalid(plot.waterfall(dataset).collections[0].get_array())
    assert array.mask[:, 2].all() and array.mask.sum() == 41


def test_waterfall_says_what_it_needs():
    with pytest.raises(ValueError, match=r"at least two lanes.*has 1 lanes.*\.$"):
        plot.waterfall(spectra(lanes=1))
    with pytest.raises(ValueError, match=r"a largest amplitude of 0\.$"):
        plot.waterfall(spectra() * 0)
    with pytest.raises(ValueError, match="takes one swept dimension"):
        plot.waterfall(spectra().expand_dims({"disc.mass": [1.0, 2.0]}))


# === modes and onset


def motions(values, shapes, counter=None, stations=(0.0, 0.5, 1.0), frame="fixed", speed=30.0):
    to = lambda a: None if a is None else jnp.asarray(a, complex)
    at, speed = jnp.asarray(stations), jnp.asarray(speed)
    return jr.Modes(to(values), to(shapes), to(counter), at, speed, frame)


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
    """Branches `frequency + slope Omega` of a constant growth rate."""
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
    assert "critical speed" in lines(upper)


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
    assert "critical speed" not in lines(upper) and "crossing" in lines(upper)


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
    with pytest.raises(ValueError, match=r"begin at -30 rad/s; begin at 0\.$"):
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
    (ax,) = plot.modes3d(pair)  # of the conjugate pair one
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
    """Against the positive sense of turning is with the spin."""
    drawn = plot.modes3d(motions([70j, -60j], np.ones((2, 3)), speed=-30.0))
    assert [list(orbits(ax)) for ax in drawn] == [["backward"], ["forward"]]
    assert (
        plot.mode_shapes(motions([70j], np.ones((1, 3)), speed=-30.0)).lines[0].get_label()
        == "backward 70 rad/s, undamped"
    )


def test_modes3d_in_the_axes_of_the_shaft():
    """At 30 rad/s, 50 in turning axes is 80 with the spin and 20 against it in fixed ones."""
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
    ((_, path), *_) = orbits(ahead)["forward"]  # drawn as it is in the axes of the shaft
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
    """`z = e W^2 / (w^2 - W^2 + 2 i D w W)` of w = 100 rad/s, and twice it at a second station."""
    speeds = np.linspace(0.0, 300.0, 301) if speeds is None else np.asarray(speeds)
    z = 1e-3 * speeds**2 / (1e4 - speeds**2 + 2j * damping * 100 * speeds + (damping == 0) * 1e-9)
    pair = jnp.asarray(np.stack([z, 2 * z], axis=1), complex)
    stations = jnp.array([0.2, 0.4])
    return circles(speeds, stations, pair)


def circles(speeds, stations, forward):
    speeds = jnp.asarray(speeds)
    return jr.HarmonicResponse(speeds, speeds, stations, forward, 0 * forward, None)


def test_response_draws_amplitude_and_phase():
    upper, lower = plot.response(resonance(), station=1, critical=[100.0, 400.0])
    speed, amplitude = upper.lines[0].get_data()
    assert amplitude[speed == 100.0] == pytest.approx([2 * 1.0 / 0.1])  # mm: 2 e / (2 D)
    phase = lower.lines[0].get_ydata()
    assert np.isnan(phase[0])  # nothing moves at rest
    assert phase[speed == 100.0] == pytest.approx([-90.0])
    assert (np.diff(phase[1:]) < 0).all() and phase[-1] < -170
    marks = lines(upper)["critical speed"]
    np.testing.assert_allclose(marks.get_xdata(), 100.0)  # 400 rad/s is outside
    assert sum(line.get_linestyle() == "--" for line in upper.lines) == 1
    assert upper.get_ylabel() == "amplitude [mm]" and lower.get_ylabel() == "phase [deg]"
    assert lower.get_xlabel() == "spin speed [rad/s]" and upper.get_ylim()[0] == 0.0


def test_response_in_micrometres_and_decades():
    small = resonance()
    small = circles(small.speeds, small.stations, 1e-3 * small.forward)
    upper, _ = plot.response(small, log=True)
    assert upper.lines[0].get_ydata().max() == pytest.approx(10.0, rel=0.01)
    assert upper.get_ylabel() == "amplitude [\N{MICRO SIGN}m]" and upper.get_yscale() == "log"


def test_response_phase_runs_on():
    """Two resonances turn the phase by a whole turn; of no damping it falls by half a turn."""
    speeds = np.linspace(1.0, 400.0, 800)
    product = np.prod([w**2 / (w**2 - speeds**2 + 4j * speeds) for w in (100.0, 250.0)], axis=0)
    both = jnp.asarray(product[:, None], complex)
    result = circles(speeds, jnp.array([0.2]), both)
    phase = plot.response(result)[1].lines[0].get_ydata()
    assert (np.diff(phase) < 0).all() and -360 < phase[-1] < -350 and phase[0] > -1
    undamped = plot.response(resonance(0.0, [50.0, 90.0, 110.0, 200.0]))[1].lines[0].get_ydata()
    np.testing.assert_allclose(undamped, [0.0, 0.0, -180.0, -180.0], atol=1e-9)


def test_response_draws_the_parts_there_are():
    """Forward and backward of an ellipse, against frequency at one speed; of weight its one part."""
    frequencies, one = jnp.linspace(10.0, 90.0, 5), jnp.array([0.2])
    forward = jnp.full((5, 1), 2e-3 + 0j)
    found = jr.HarmonicResponse(jnp.full(5, 300.0), frequencies, one, forward, 0.5j * forward, None)
    upper, lower = plot.response(found)
    assert lower.get_xlabel() == "frequency [rad/s]"
    np.testing.assert_allclose(lines(upper)["forward part"].get_data(), [frequencies, [2.0] * 5])
    np.testing.assert_allclose(lines(upper)["backward part"].get_ydata(), 1.0)
    np.testing.assert_allclose(lines(lower)["backward part"].get_ydata(), 90.0)
    weight = jr.WeightResponse(frequencies, one, 0 * forward, 3 * forward)
    upper, lower = plot.response(weight)
    assert lower.get_xlabel() == "spin speed [rad/s]" and len(upper.lines) == 1
    np.testing.assert_allclose(lines(upper)["twice a revolution, by weight"].get_ydata(), 6.0)


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


def test_response_of_a_station_that_is_not_there():
    with pytest.raises(ValueError, match="`station` must be 0 to 1, but is 2."):
        plot.response(resonance(), station=2)


# === stability maps


def stability(shift=0.0, growth=None, paths=("unbalance.eccentricity", "spin.speed")):
    """Unstable right of the circle's arc `x = 0.002 + shift + (y / 1000 - 0.3)^2 / 50`."""
    x, y = np.linspace(0.0, 0.01, 41), np.linspace(100.0, 500.0, 31)
    arc = lambda y: 0.002 + shift + (y / 1000 - 0.3) ** 2 / 50
    values = 1e3 * (x[:, None] - arc(y))
    curve = np.stack([arc(y), y], axis=1)
    return types.SimpleNamespace(
        paths=paths,
        units=("m", "rad/s"),
        x=x,
        y=y,
        growth=values if growth is None else growth + 0 * values,
        boundaries=(curve,) if growth is None else (),
    )


def test_stability_map_shades_what_is_unstable():
    ax = plot.stability_map(stability())
    (shading,) = ax.collections
    inside = lambda x, y: any(path.contains_point((x, y)) for path in shading.get_paths())
    for y in (110.0, 300.0, 490.0):  # x in mm
        edge = 2.0 + 20 * (y / 1000 - 0.3) ** 2
        assert inside(edge + 0.05, y) and not inside(edge - 0.05, y)
    boundary = lines(ax)["boundary of stability"]
    np.testing.assert_allclose(boundary.get_xdata(), 1e3 * stability().boundaries[0][:, 0])
    assert boundary.get_linewidth() > 1.5 and to_hex(boundary.get_color()).upper() == colours.DARK
    assert ax.get_xlabel() == "unbalance eccentricity [mm]"
    assert ax.get_ylabel() == "spin speed [rad/s]"
    assert ax.get_xlim() == (0.0, 10.0) and ax.get_ylim() == (100.0, 500.0)
    bar = shading.colorbar
    assert "[1/s]" in bar.ax.get_ylabel() and bar.ax.get_yticklabels()[0].get_text() == "0"
    assert shading.get_clim()[1] >= 8.0  # [1/s], the largest of the map


def test_stability_map_without_a_boundary():
    stable = plot.stability_map(stability(growth=-1.0))
    assert not stable.collections and stable.get_legend() is None
    undamped = plot.stability_map(stability(growth=np.eye(41, 31) - 1.0))
    assert not undamped.collections and undamped.get_xlim() == (0.0, 10.0)


def test_stability_map_hatches_what_is_not_known():
    growth = stability().growth.copy()
    growth[:20, :10] = np.nan  # to x = 5 mm and y = 220 rad/s
    result = stability()
    result.growth = growth
    ax = plot.stability_map(result)
    (hatched,) = [c for c in ax.collections if getattr(c, "hatches", [None]) == ["///"]]
    inside = lambda of, x, y: any(path.contains_point((x, y)) for path in of.get_paths())
    assert inside(hatched, 4.0, 150.0) and not inside(hatched, 6.0, 150.0)
    (shading,) = [c for c in ax.collections if c is not hatched]
    assert inside(shading, 6.0, 150.0) and not inside(shading, 4.0, 150.0)
    assert "not known" in [text.get_text() for text in ax.get_legend().get_texts()]


def test_boundary_family_draws_sections():
    maps = [stability(shift) for shift in (0.0, 0.001, 0.002)]
    ax = plot.boundary_family(maps, ["k = 0", "k = 1", "k = 2"])
    for number, (name, line) in enumerate(lines(ax).items()):
        assert name == f"k = {number}"
        np.testing.assert_allclose(line.get_xdata().min(), 2.0 + number, atol=1e-2)
    assert len({to_hex(line.get_color()) for line in ax.lines}) == 3
    assert ax.get_xlabel() == "unbalance eccentricity [mm]" and ax.get_ylim() == (100.0, 500.0)
    with pytest.raises(ValueError, match="has 3 maps and 1 names"):
        plot.boundary_family(maps, ["k"])
    with pytest.raises(ValueError, match="over the same two parameters"):
        plot.boundary_family([maps[0], stability(paths=("disc.mass", "spin.speed"))], ["a", "b"])


# === error map


def test_error_map_has_decades_lines_and_hatches():
    x, y = np.linspace(0.0, 1.0, 50), np.linspace(0.1, 1.0, 40)
    error = 0.4 * (x[:, None] * y) ** 2
    ax = plot.error_map(x, y, error, x[:, None] * y < 0.5)
    shading = ax.collections[0]
    assert shading.get_clim() == (1e-6, 1.0) and isinstance(shading.norm, LogNorm)
    assert ax.collections[0].colorbar.ax.get_ylabel() == "relative error [1]"
    (marked,) = [c for c in ax.collections if list(getattr(c, "levels", [])) == [0.01, 0.05]]
    for path, product in zip(marked.get_paths(), (0.025**0.5, 0.125**0.5), strict=True):
        np.testing.assert_allclose(np.prod(path.vertices, axis=1), product, rtol=0.02)
    (hatched,) = [c for c in ax.collections if getattr(c, "hatches", [None]) == ["///"]]
    inside = lambda x, y: any(path.contains_point((x, y)) for path in hatched.get_paths())
    assert inside(0.9, 0.9) and not inside(0.6, 0.6)
    assert r"$\Omega/\lambda_2$" in ax.get_xlabel() and "$I_0/I$" in ax.get_ylabel()


def test_error_map_of_no_error():
    with pytest.raises(ValueError, match="needs an error above zero"):
        plot.error_map([0.0, 1.0], [0.0, 1.0], np.zeros((2, 2)), np.ones((2, 2)))


# === run-ups, reactions, balancer


PIVOTED = jr.RigidShaft(0.14, (jr.Constraint(0.0),))


def run(*effects, size=201):
    """Speed from 10 to 20 rad/s in 1 s; 2 mm of whirl that grows to 3 mm; two rows of balls."""
    time = np.linspace(0.0, 1.0, size)
    angle = 10 * time + 5 * time**2
    row = lambda *starts: 2 * np.pi * time[:, None] + np.asarray(starts)
    scene = jr.Scene(
        PIVOTED,
        jr.Unbalance(0.14, 1.0, 2e-3),
        jr.BallBalancer(0.14, 0.025, 0.06, 1.0),
        jr.BallBalancer(0.14, 0.02, 0.05, 1.0, places=3, in_use=1),
        *effects,
        spin=jr.SpeedProfile.ramp(10.0, 20.0, 1.0),
    )
    angles = row(0.0, np.pi / 2), row(-np.pi / 2, 1.0, 2.0)
    thrown = 1.5e-3 * np.exp(1j * angles[0]).sum(1) + 1e-3 * np.exp(1j * angles[1][:, 0])
    return types.SimpleNamespace(
        time=time,
        angle=angle,
        speed=10 + 10 * time,
        acceleration=np.full(size, 10.0),
        displacement=((2e-3 + 1e-3 * time) * np.exp(1j * angle))[:, None],
        balls=tuple(jr.Balls(jnp.asarray(a), jnp.zeros_like(a)) for a in angles),
        imbalance=2e-3 + thrown,
        contact_force=None,
        stations=np.array([0.14]),
        scene=scene,
    )


def pressed(factor=1.0):
    """Two bearings: 3 N turning with the shaft, and weight of 4 N alone."""
    time = np.linspace(0.0, 2.0, 101)
    turn = np.exp(5j * time)
    force = factor * np.stack([3 * turn, 4j + 0 * turn], axis=1)
    return types.SimpleNamespace(
        time=time,
        angle=5 * time,
        force=force,
        moment=0.1 * force,
        static=factor * np.array([0.0, 4j]),
        static_moment=np.zeros(2, complex),
        names=("support", "constraints.0"),
    )


def test_speed_and_acceleration_in_time():
    upper, lower = plot.speed(run())
    np.testing.assert_allclose(upper.lines[0].get_ydata()[[0, -1]], [10.0, 20.0])
    np.testing.assert_allclose(lower.lines[0].get_ydata(), 10.0)
    assert upper.get_ylabel() == "speed [rad/s]" and lower.get_xlabel() == "time [s]"
    assert lower.get_ylabel() == "acceleration [rad/s$^2$]"


def test_amplitude_of_a_run_up():
    upper, lower = plot.run_up(run())
    np.testing.assert_allclose(upper.lines[0].get_ydata()[[0, -1]], [2.0, 3.0])
    assert upper.get_ylabel() == "amplitude [mm]"
    np.testing.assert_allclose(lower.lines[0].get_ydata()[[0, -1]], [10.0, 20.0])
    small = run()
    small.displacement = 1e-3 * small.displacement
    ax = plot.passage(small)
    np.testing.assert_allclose(ax.lines[0].get_xdata()[[0, -1]], [10.0, 20.0])
    np.testing.assert_allclose(ax.lines[0].get_ydata()[[0, -1]], [2.0, 3.0])
    assert ax.get_ylabel() == "amplitude [\N{MICRO SIGN}m]"
    assert ax.get_xlabel() == "speed of rotation [rad/s]"


def test_reactions_are_magnitudes_with_their_static_part():
    drawn = lines(plot.reactions(pressed()))
    assert list(drawn) == ["support", "constraints.0", "constraints.0 at rest"]
    np.testing.assert_allclose(drawn["support"].get_ydata(), 3.0)
    np.testing.assert_allclose(drawn["constraints.0 at rest"].get_ydata(), 4.0)
    assert to_hex(drawn["support"].get_color()).upper() == colours.CYCLE[0]


@pytest.mark.parametrize(
    "factor, moment, size, label",
    [
        (1.0, False, 3.0, "reaction [N]"),
        (1e4, False, 30.0, "reaction [kN]"),
        (1.0, True, 0.3, "moment [N m]"),
    ],
)
def test_reactions_have_units(factor, moment, size, label):
    ax = plot.reactions(pressed(factor), moment=moment)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), size)
    assert ax.get_ylabel() == label


def test_reaction_vectors_at_an_instant():
    for rotating, tip in ((False, 3 * np.exp(5j * 0.5)), (True, 3.0)):
        ax = plot.reaction_vectors(pressed(), 0.501, rotating=rotating)
        arrow = ax.collections[0]
        np.testing.assert_allclose(arrow.U[0] + 1j * arrow.V[0], tip, atol=1e-12)
        assert ("axes of the shaft" in ax.get_xlabel()) == rotating
        assert ax.get_xlabel().endswith("[N]") and ax.texts[0].get_text() == "0.5 s"
    with pytest.raises(ValueError, match="within the run"):
        plot.reaction_vectors(pressed(), 3.0)


def test_hodograph_of_a_turning_force():
    path = lines(plot.hodograph(pressed()))["support"]
    np.testing.assert_allclose(np.hypot(path.get_xdata(), path.get_ydata()), 3.0)
    fixed = lines(plot.hodograph(pressed(), rotating=True))
    np.testing.assert_allclose(fixed["support"].get_xdata(), 3.0)
    turned = fixed["constraints.0"].get_xdata() + 1j * fixed["constraints.0"].get_ydata()
    np.testing.assert_allclose(turned, 4j * np.exp(-5j * pressed().time), atol=1e-12)


def test_reactions_of_nothing():
    nothing = pressed()
    nothing.names = ()
    with pytest.raises(ValueError, match="no supports"):
        plot.hodograph(nothing)


def test_balls_by_row_and_what_they_leave():
    upper, lower = plot.balls(run())
    blue, orange = colours.BLUE, colours.ORANGE
    assert [to_hex(line.get_color()).upper() for line in upper.lines] == [blue, blue, orange]
    drawn = lines(upper)["row 1, 2 balls"].get_ydata()
    np.testing.assert_allclose(drawn[:200], 360 * np.linspace(0.0, 1.0, 201)[:200], atol=1e-9)
    once = upper.lines[1].get_ydata()  # begins at 90 degrees, goes round at three quarters
    assert np.isnan(once).sum() == 1 and once[-1] == pytest.approx(90.0)
    assert "row 2, 1 ball" in lines(upper)
    left = lines(lower)
    np.testing.assert_allclose(left["rotor and balls"].get_ydata(), 1e3 * np.abs(run().imbalance))
    np.testing.assert_allclose(left["rotor alone"].get_ydata(), 2.0)
    assert lower.get_ylabel() == "imbalance [g m]" and "[deg]" in upper.get_ylabel()


def test_balls_that_balance_are_on_a_logarithmic_scale():
    assert plot.balls(run())[1].get_yscale() == "linear"
    settling = run()
    pair = np.pi - 10.0 ** np.linspace(0.0, -9.0, 201)[:, None] * np.ones(2)
    single = np.zeros((201, 3))
    settling.balls = tuple(jr.Balls(jnp.asarray(a), jnp.zeros_like(a)) for a in (pair, single))
    settling.imbalance = 2e-3 + 1e-3 + 3e-3 * np.exp(1j * pair[:, 0])
    lower = plot.balls(settling)[1]
    assert lower.get_yscale() == "log"
    top = np.abs(settling.imbalance).max() * 1e3
    np.testing.assert_allclose(lower.get_ylim(), [1e-6 * top, 2 * top])


def test_balancer_is_drawn_to_scale():
    sized = run()
    sized.scene = sized.scene.replace({"ball_balancers.ball_radius": 0.008})
    ax = plot.balancer_at(sized, 0.0)
    circles = [(*patch.center, patch.radius) for patch in ax.patches]
    expected = [(0, 0, 60), (60, 0, 8), (0, 60, 8), (0, 0, 50), (0, -50, 8)]
    np.testing.assert_allclose(circles, expected, atol=1e-6)
    arrows = {a.get_label(): complex(a.U[0], a.V[0]) for a in ax.collections}
    each = 60 / 4.0  # mm a g m: the balls can balance 4 g m
    assert arrows["rotor"] == pytest.approx(2 * each)
    assert arrows["row 1, 2 balls"] == pytest.approx((1.5 + 1.5j) * each)
    assert arrows["row 2, 1 ball"] == pytest.approx(-1j * each)
    assert arrows["remaining"] == pytest.approx((3.5 + 0.5j) * each)
    assert "radius = 4 g m" in [text.get_text() for text in ax.texts]
    assert ax.get_xlabel() == "x of the rotor [mm]" and ax.get_aspect() == 1.0


def test_balls_without_a_radius_are_of_steel():
    ball = plot.balancer_at(run(), 0.0).patches[1]
    assert 4 / 3 * np.pi * (1e-3 * ball.radius) ** 3 * 7850 == pytest.approx(0.025)


def test_balls_need_a_balancer():
    other = run()
    other.scene = rotor()
    with pytest.raises(ValueError, match="BallBalancer"):
        plot.balls(other)


def test_animation_is_a_film(tmp_path):
    path = tmp_path / "film.gif"
    plot.animate(run(size=21), path, seconds=0.4, rate=10)
    with Image.open(path) as film:
        assert film.n_frames == 4 and film.width > 600
    assert not plt.get_fignums()


def test_animation_says_what_it_writes(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=".gif or .mp4"):
        plot.animate(run(), tmp_path / "film.avi")
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(ValueError, match="ffmpeg"):
        plot.animate(run(), tmp_path / "film.mp4")
    for wrong, said in (
        ({"station": 3}, "`station`"),
        ({"seconds": 0}, "0 and 15"),
        ({"rate": 0}, "4 and 0"),
    ):
        with pytest.raises(ValueError, match=said):
            plot.animate(run(), tmp_path / "film.gif", **wrong)
    with pytest.raises(ValueError, match="no/film.gif cannot be written"):
        plot.animate(run(), tmp_path / "no" / "film.gif")
    assert not list(tmp_path.iterdir())


def charted(growth):
    """Stable above speed 2 - mass / 2, promised above 1; over speed and mass."""
    x, y = np.linspace(0.5, 2.5, 5), np.linspace(0.0, 2.0, 3)
    a11 = np.broadcast_to(1 - x[:, None] ** 2, (5, 3))
    boundary = (np.array([[1.0, 0.0], [2.0, 2.0]]),)
    return StabilityChart(x, y, growth(x[:, None], y), a11, boundary, ("speed", "mass"), ("1", "1"))


def test_stability_chart_beside_the_first_approximation():
    ax = plot.stability_chart(charted(lambda x, y: 1 + y / 2 - x))
    drawn = lines(ax)
    np.testing.assert_allclose(drawn["boundary of stability"].get_xdata(), [1.0, 2.0])
    assert "$a_{11} = 0$" in drawn
    dashed = [s for c in ax.collections for s in c.get_paths() if len(s) and c.get_edgecolor().size]
    assert any(np.allclose(path.vertices[:, 0], 1.0, atol=0.02) for path in dashed)
    assert ax.get_xlabel().startswith("speed") and ax.get_ylabel().startswith("factor on the mass")
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "$a_{11} < 0$ but unstable" in names
    assert ax.figure.axes[1].get_ylabel() == "growth rate where unstable [1]"


def test_stability_chart_where_the_approximation_is_right():
    ax = plot.stability_chart(charted(lambda x, y: 1 - x + 0 * y))
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["boundary of stability", "$a_{11} = 0$"]


# === all


@pytest.mark.parametrize(
    "draw",
    [
        lambda ax: plot.orbit(response(0.5, 0.1), ax=ax),
        lambda ax: plot.history(response(0.5, 0.1), ax=ax),
        lambda ax: plot.whirl_history(response(0.5, 0.1), ax=ax),
        lambda ax: plot.whirl_spectrum(response(0.5, 0.1), ax=ax),
        lambda ax: plot.waterfall(spectra(), ax=ax),
        lambda ax: plot.stability_map(stability(), ax=ax),
        lambda ax: plot.boundary_family([stability()], ["k = 0"], ax=ax),
        lambda ax: plot.passage(run(), ax=ax),
        lambda ax: plot.reactions(pressed(), ax=ax),
        lambda ax: plot.reaction_vectors(pressed(), 1.0, ax=ax),
        lambda ax: plot.hodograph(pressed(), ax=ax),
        lambda ax: plot.balancer_at(run(), 0.5, ax=ax),
        lambda ax: plot.error_map([0, 1], [0, 1], np.eye(2), np.eye(2), ax=ax),
    ],
    ids=[
        "orbit",
        "history",
        "whirl_history",
        "whirl_spectrum",
        "waterfall",
        "stability_map",
        "boundary_family",
        "passage",
        "reactions",
        "reaction_vectors",
        "hodograph",
        "balancer_at",
        "error_map",
    ],
)
def test_draws_in_given_axes_or_a_figure_of_its_own(draw):
    _, ax = plt.subplots()
    assert draw(ax) is ax
    assert 84.9 < 25.4 * draw(None).figure.get_figwidth() < 170.1


# === what lies on each other, what is hidden


def symmetric(*effects, times=(0.0, 0.1, 0.2)):
    """Reactions of a disc in the middle of two pins, off centre."""
    shaft = jr.RigidShaft(0.4, (jr.Constraint(0.0), jr.Constraint(0.4)))
    spin = jr.ConstantSpeed(100.0)
    scene = jr.Scene(shaft, jr.Disc(0.2, 2.0, 0.0, 0.02, offset=1e-3), *effects, spin=spin)
    return jr.reactions(jr.run_up(scene, np.array(times)))


def test_equal_reactions_can_be_told_apart():
    for ax in (
        plot.reactions(symmetric()),
        plot.hodograph(symmetric(times=np.linspace(0, 0.1, 999))),
    ):
        first, second = [line for line in ax.lines if len(line.get_xdata()) > 2]
        assert first.get_linestyle() == "-" and second.get_linestyle() == "--"
        names = ["constraints.0 at 0 mm", "constraints.1 at 400 mm"]
        assert [text.get_text() for text in ax.get_legend().get_texts()] == names


def test_a_force_that_is_never_there_has_no_legend():
    ax = plot.reactions(symmetric(jr.Limiter(0.2, 0.0, 1e-3, 1e5)))
    assert len(ax.get_legend().get_texts()) == 2


def test_a_coarse_hodograph_is_round():
    """`m e W^2 / 2` = 10 N about the weight, 2 g / 2, at three samples in about three revolutions."""
    ax = plot.hodograph(symmetric(jr.Gravity()))
    path = ax.lines[0].get_xdata() + 1j * ax.lines[0].get_ydata()
    weight = np.mean([np.min(path.imag), np.max(path.imag)]) * 1j
    assert abs(weight) == pytest.approx(9.80665, rel=1e-2)
    assert np.abs(path - weight) == pytest.approx(10.0, rel=1e-2)
    assert any("samples a revolution, interpolated" in text.get_text() for text in ax.texts)


def test_passage_marks_contact_and_the_critical_speed():
    """50 rad/s of 2 kg on 5 kN/m; touches where the amplitude exceeds the gap."""
    scene = jr.Scene(
        jr.MasslessShaft(0.4, 0.2, 5e3),
        jr.Disc(0.2, 2.0, 0.0, 0.0, offset=1e-3),
        jr.DiscDamping(0.2, 8.0),
        jr.Limiter(0.2, 0.0, 3e-3, 4e4, 20.0),
        spin=jr.SpeedProfile.ramp(10.0, 90.0, 2.0),
    )
    ax = plot.passage(jr.run_up(scene, np.linspace(0, 2, 801)))
    lines = dict(
        zip(ax.get_legend_handles_labels()[1], ax.get_legend_handles_labels()[0], strict=True)
    )
    assert lines["critical speed"].get_xdata()[0] == pytest.approx(50.0)
    touched = lines["contact"].get_ydata()
    assert np.nanmin(touched) > 2.99 and np.isnan(touched[0])


def test_a_scene_prints_its_parameters():
    text = str(jr.load("turbine-variants", row=1))
    assert text.startswith("RigidShaft, Drive (layout assumed: chain)")
    assert "  discs.mass = 100, 90 kg" in text and "  discs.offset = 0.0002, - m" in text
