"""Plots: what is drawn, of data whose answer is known."""

import types

import matplotlib


matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402
import xarray as xr  # noqa: E402
from matplotlib.colors import LogNorm, to_hex  # noqa: E402

import jaxrotor as jr  # noqa: E402
from jaxrotor import plot  # noqa: E402
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
    with pytest.raises(ValueError, match="`extrema` has none; select a range"):
        plot.bifurcation(sweep().isel({ECCENTRICITY: 0}))


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


def test_mode_shapes_are_normalised_and_in_phase():
    stations = np.array([0.0, 0.4, 0.2])
    modes = types.SimpleNamespace(
        values=np.array([0.4 + 77.0j, -8.6 - 66.0j, -200.0 + 0j]),
        stations=stations,
        shapes=np.array([[0, 4j, 1j], [0, -3.0, -3j], [0, 1, -2.0]]),
    )
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


# === all


@pytest.mark.parametrize(
    "draw",
    [
        lambda ax: plot.orbit(response(0.5, 0.1), ax=ax),
        lambda ax: plot.history(response(0.5, 0.1), ax=ax),
        lambda ax: plot.whirl_history(response(0.5, 0.1), ax=ax),
        lambda ax: plot.whirl_spectrum(response(0.5, 0.1), ax=ax),
        lambda ax: plot.waterfall(spectra(), ax=ax),
    ],
    ids=["orbit", "history", "whirl_history", "whirl_spectrum", "waterfall"],
)
def test_draws_in_given_axes_or_a_figure_of_its_own(draw):
    _, ax = plt.subplots()
    assert draw(ax) is ax
    assert 84.9 < 25.4 * draw(None).figure.get_figwidth() < 170.1
