"""Plots of a sweep: bifurcation diagram, waterfall, the spectrum of a lane, maps over two parameters."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from drawn import check_axes, legend, lines
from matplotlib.colors import LogNorm, to_hex

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.core.attributes import flags
from jaxrotor.core.outcome import STATUS
from jaxrotor.files.toml import dumps
from jaxrotor.plot import colours, page
from jaxrotor.results.provenance import BRANCHES
from jaxrotor.sweeps.claims import MOTIONS


pytestmark = pytest.mark.usefixtures("rendered")

SPEED = 662.0  # [rad/s]
ECCENTRICITY = "unbalance.eccentricity"
ROTOR = jr.Scene(  # undamped, with a natural frequency of half of the speed
    jr.MasslessShaft(0.7, 0.35, 2.0 * (SPEED / 2) ** 2),
    jr.Disc(0.35, 2.0),
    jr.Unbalance(0.35, 2.0, 0.0),
    spin=jr.ConstantSpeed(SPEED),
)
RUBBING = jr.Scene(
    jr.MasslessShaft(0.7, 0.35, 2.0 * (SPEED / 2) ** 2),
    jr.Disc(0.35, 2.0),
    jr.DiscDamping(0.35, 200.0),
    jr.Unbalance(0.35, 2.0, 0.0),
    jr.Limiter.at_angles([0.0, np.pi], at=0.35, gap=1e-3, stiffness=1e6),
    spin=jr.ConstantSpeed(SPEED),
)
RUB = (jr.observe.Precession(), jr.observe.Radius(), jr.observe.Contact())
GRID = {"spin.speed": [SPEED, 1.2 * SPEED, 1.4 * SPEED], ECCENTRICITY: [2e-4, 2e-3]}
OBSERVE = (jr.observe.Section(), jr.observe.Extrema(3), jr.observe.Precession())


@pytest.fixture(scope="module")
def swept():
    """A sweep over three eccentricities: two revolutions, up to three extrema in each."""
    over = {ECCENTRICITY: [0.0, 5e-4, 1e-3]}
    return jr.sweep(ROTOR, over, settle=0, keep=2, observe=OBSERVE, steps_per_revolution=32)


@pytest.fixture(scope="module")
def lanes(swept):
    """The sweep with known values in its three lanes: undefined, forward, backward."""
    nan = np.nan
    extrema = [
        [[0.0, nan, nan], [nan, nan, nan]],
        [[0.001, -0.002, nan], [0.003, nan, nan]],
        [[0.004, -0.005, 0.006], [nan, nan, nan]],
    ]
    section = [[[0.0, 9.0]] * 2, [[0.0011, 9.0], [0.0012, 9.0]], [[0.0041, 9.0], [0.0042, 9.0]]]
    return put(swept, extrema=extrema, section=section, index=[nan, 0.1, -0.9])


@pytest.fixture(scope="module")
def spectra():
    """A sweep over five speeds, each spectrum replaced by a peak at 3 cycles per revolution."""
    return peaks("spin.speed")


@pytest.fixture(scope="module")
def mapped():
    """A real sweep over three speeds and two eccentricities, below and above what the gap allows."""
    observe = (jr.observe.Section(), *RUB)
    run = {"settle": 20, "keep": 5, "steps_per_revolution": 32, "error_sample": 0}
    return jr.sweep(RUBBING, GRID, observe=observe, **run)


@pytest.fixture(scope="module")
def kinds(mapped):
    """The sweep with one lane of every kind."""
    duty = np.array([[0.0, 0.2], [0.3, 0.4], [0.5, 0.0]])[..., None]
    whirl = np.array([[1.0, 1.0], [-0.5, np.nan], [0.0, -1.0]])
    status = np.array([[0, 0], [0, 2], [STATUS.index("steps_too_long_for_a_stop"), 1]], np.int8)
    return put(mapped, duty=duty * [1.0, 0.0], winding=whirl, index=whirl, status=status)


def put(dataset, **values):
    """The dataset with some variables replaced."""
    return dataset.assign({name: dataset[name].copy(data=a) for name, a in values.items()})


def peaks(path):
    """A sweep of 100 to 500 over a parameter; its spectra are peaks of height 1 to 5."""
    over, observe = {path: np.linspace(100.0, 500.0, 5)}, (jr.observe.WhirlSpectrum(40),)
    run = {"start": jr.Whirl(0.01, SPEED), "settle": 0, "keep": 4, "steps_per_revolution": 40}
    dataset = jr.sweep(ROTOR, over, observe=observe, **run)
    frequency = dataset["frequency"].values
    amplitude = 1e-9 + np.exp(-(((frequency - 3.0) / 0.3) ** 2))
    return put(dataset, spectrum=np.arange(1, 6)[:, None] * amplitude)


def test_waterfall_in_given_axes_or_a_figure_of_its_own(spectra):
    check_axes(lambda ax: plot.waterfall(spectra, ax=ax))


# === bifurcation


def test_bifurcation_draws_extrema_by_direction(lanes):
    upper, lower = plot.bifurcation(lanes)
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


def test_bifurcation_draws_index_below_with_zero_line(lanes):
    upper, lower = plot.bifurcation(lanes)
    points = {to_hex(line.get_color()).upper(): line.get_ydata() for line in lower.lines}
    np.testing.assert_allclose(points[colours.FORWARD], [0.1])
    np.testing.assert_allclose(points[colours.BACKWARD], [-0.9])
    assert any(np.array_equal(line.get_ydata(), [0.0, 0.0]) for line in lower.lines)
    assert upper.get_xlim() == lower.get_xlim()
    assert "[1]" in lower.get_ylabel()


def test_bifurcation_of_a_free_whirl():
    """`z = 10 exp(i (1 + w t))` mm, forward and backward at half of the speed."""
    over = {"start.rate": [SPEED / 2, -SPEED / 2]}
    run = {"settle": 0, "keep": 2, "observe": OBSERVE, "steps_per_revolution": 32}
    dataset = jr.sweep(ROTOR, over, start=jr.Whirl(0.01, angle=1.0), **run)
    seen = -10 * np.cos(1.0)  # after a revolution the whirl has advanced by a half
    for section, expected in ((False, [-10.0, 10.0]), (True, [seen, -seen])):
        upper, lower = plot.bifurcation(dataset, section=section)
        for name, way in (("forward whirl", 0.5), ("backward whirl", -0.5)):
            drawn = lines(upper)[name]
            np.testing.assert_allclose(drawn.get_xdata(), way * SPEED)
            np.testing.assert_allclose(np.sort(drawn.get_ydata()), expected, rtol=1e-5)
            below = [line.get_xydata().tolist() for line in lower.lines]
            assert [pytest.approx([way * SPEED, way])] in below
        assert lower.get_xlabel() == "start rate [rad/s]"


def test_bifurcation_of_section_draws_its_x(lanes):
    upper, _ = plot.bifurcation(lanes, section=True)
    np.testing.assert_allclose(lines(upper)["forward whirl"].get_ydata(), [1.1, 1.2])
    assert "once a revolution" in upper.get_ylabel()


def clearances(ax):
    """Data of the lines of clearance, by their order."""
    return [np.array(line.get_data(), float) for line in ax.lines if is_clearance(line)]


def is_clearance(line):
    return to_hex(line.get_color()).upper() == colours.ORANGE


def test_bifurcation_draws_the_clearance_of_stops(mapped):
    """Two stops along x with gaps of 1 mm, which another value of the data set may replace."""
    along = mapped.isel({"spin.speed": 0})
    upper, _ = plot.bifurcation(along, section=True)
    assert [line[1].tolist() for line in clearances(upper)] == [[-1.0, -1.0], [1.0, 1.0]]
    assert legend(upper)[-1] == "clearance"
    with plot.units(length="um"):
        upper, lower = plot.bifurcation(along.assign_coords({"limiters.gap": 1.5e-3}), section=True)
    np.testing.assert_allclose([line[1] for line in clearances(upper)], [[-1500] * 2, [1500] * 2])
    assert upper.get_ylabel().endswith("[\N{MICRO SIGN}m]")
    swept_gap = along.rename({ECCENTRICITY: "limiters.gap"})
    upper, _ = plot.bifurcation(swept_gap, section=True)
    gaps = [0.2, 2.0]  # [mm]
    np.testing.assert_allclose(clearances(upper), [[gaps, np.negative(gaps)], [gaps, gaps]])
    far, _ = plot.bifurcation(along.assign_coords({"limiters.gap": 1.0}), section=True)
    assert legend(far)[-1] == "clearance 1e+03 mm, beyond" and far.get_ylim()[1] < 10


def test_bifurcation_marks_the_values_with_contact():
    """A strip from the middle between 1 and 2 to the last value, where lanes that did not fail touch."""
    values = np.array([3.0, 1.0, 2.0, 0.0])
    duty = np.array([[0.2, 0.0], [0.0, 0.0], [0.0, 0.1], [0.3, 0.0]])
    variables = {
        "extrema": (("spin.speed", "revolution", "extremum"), np.full((4, 2, 2), 1e-3)),
        "index": ("spin.speed", np.ones(4)),
        "status": ("spin.speed", np.array([0, 0, 0, STATUS.index("not_finite")], np.int8)),
        "duty": (("spin.speed", "limiter"), duty),
    }
    data = xr.Dataset(variables, {"spin.speed": ("spin.speed", values, {"units": "rad/s"})})
    strips = lambda data: [
        patch
        for patch in plot.bifurcation(data)[0].patches
        if to_hex(patch.get_facecolor()).upper() == colours.DARK
    ]
    drawn = sorted((one.get_x(), one.get_width()) for one in strips(data))
    assert drawn == [(1.5, 1.0), (2.5, 0.5)]
    assert "contact" in legend(plot.bifurcation(data)[0])
    for same in (
        0 * duty,
        1 + duty,
    ):  # no value differs from the others, but for the one that failed
        assert len(strips(data.assign(duty=(data.duty.dims, same)))) == 3 * bool(same[1, 0])


def test_bifurcation_of_any_stops_and_of_none(lanes):
    upper, _ = plot.bifurcation(lanes)  # has no stops
    assert not clearances(upper)
    assert not clearances(plot.bifurcation(lanes.drop_attrs(deep=False))[0])
    ring = jr.AnnularStator(at=0.35, gap=3e-3, stiffness=1e6, offset=1e-3, angle=np.pi / 3)
    tilted = [
        jr.Limiter(at=at, angle=angle, gap=gap, stiffness=1e6)
        for at, angle, gap in ((0.35, 2.0, 2e-3), (0.35, np.pi / 2, 1e-3))
    ]
    scene = ROTOR.of_parts(*ROTOR.effects, ring, *tilted)
    upper, _ = plot.bifurcation(lanes.assign_attrs(scene=dumps(scene)))
    # the ring is about x = 0.5 mm; the first limiter faces -x, the second y
    np.testing.assert_allclose([line[1][0] for line in clearances(upper)], [-2.5, -2.0, 3.5])
    elsewhere = lanes.assign_attrs(scene=dumps(scene), station=0.1)
    assert not clearances(plot.bifurcation(elsewhere)[0])


def test_bifurcation_says_why_a_value_has_no_points(lanes):
    gave_up, not_finite = STATUS.index("solver_gave_up"), STATUS.index("not_finite")
    upper, _ = plot.bifurcation(put(lanes, status=np.array([gave_up, 0, not_finite], np.int8)))
    assert [text.get_text() for text in upper.texts] == ["solver gave up", "not finite"]
    assert [text.get_position()[0] for text in upper.texts] == [0.0, 1.0]
    assert [patch.get_bbox().intervalx.tolist() for patch in upper.patches] == [
        pytest.approx([0.0, 0.25]),
        pytest.approx([0.75, 1.0]),
    ]
    several = put(lanes, status=np.array([0, gave_up, gave_up], np.int8))
    (text,) = plot.bifurcation(several)[0].texts  # one of values beside each other
    assert text.get_text() == "solver gave up" and text.get_position()[0] == 0.75
    several = put(lanes, status=np.array([0, gave_up, not_finite], np.int8))
    assert len(plot.bifurcation(several)[0].texts) == 2
    close = several.assign_coords({ECCENTRICITY: [0.0, 9.9e-4, 1e-3]})
    (text,) = plot.bifurcation(close)[0].texts
    assert text.get_text() == "solver gave up, not finite"
    nothing = put(lanes, extrema=np.full((3, 2, 3), np.nan))
    assert plot.bifurcation(nothing)[0].texts[0].get_text() == "no points"


def test_bifurcation_has_larger_points_the_fewer_there_are(lanes):
    """Points of a lane at one height count once: those of a periodic lane are few."""
    of = lambda dataset, **given: lines(plot.bifurcation(dataset, **given)[0])["forward whirl"]
    dims, one = (ECCENTRICITY, "revolution", "extremum"), np.ones((3, 5000, 1))
    dataset = lanes.drop_vars(["extrema", "section"])
    periodic = dataset.assign(extrema=(dims, one * np.array([0.0, 1e-3, 2e-3])[:, None, None]))
    apart = dataset.assign(extrema=(dims, one * np.linspace(0.0, 1e-3, 5000)[:, None]))
    assert of(lanes).get_markersize() == of(periodic).get_markersize() == 4.0
    assert 1.5 <= of(apart).get_markersize() < 3.0
    assert of(lanes, size=2).get_markersize() == 2


def test_bifurcation_in_any_order_of_dimensions(lanes):
    upper, _ = plot.bifurcation(lanes.transpose("extremum", "revolution", ECCENTRICITY, "axis"))
    np.testing.assert_allclose(sorted(lines(upper)["forward whirl"].get_ydata()), [-2.0, 1.0, 3.0])


def test_bifurcation_rasterises_only_huge_clouds(lanes):
    small, _ = plot.bifurcation(lanes)
    assert not lines(small)["forward whirl"].get_rasterized()
    dataset = lanes.drop_vars(["extrema", "section"])
    huge = np.zeros((3, page.RASTER + 1, 1))
    dataset["extrema"] = ((ECCENTRICITY, "revolution", "extremum"), huge)
    large, _ = plot.bifurcation(dataset)
    assert lines(large)["forward whirl"].get_rasterized()


def test_bifurcation_uses_given_axes(lanes):
    figure, axes = plt.subplots(2)
    assert plot.bifurcation(lanes, axes) == tuple(axes)
    with pytest.raises(ValueError, match="`axes` must be two Axes, but are 1."):
        plot.bifurcation(lanes, axes[0])


def test_bifurcation_says_what_it_lacks(lanes):
    for name in ("extrema", "index"):
        with pytest.raises(ValueError, match=rf"has no `{name}`.*`observe=`\.$"):
            plot.bifurcation(lanes.drop_vars(name))
    with pytest.raises(ValueError, match="has no `section`"):
        plot.bifurcation(lanes.drop_vars("section"), section=True)


def test_bifurcation_takes_one_swept_dimension(lanes):
    two = lanes.expand_dims({"spin.speed": [600.0, 700.0]})
    with pytest.raises(ValueError, match=r"'spin.speed', 'unbalance.eccentricity'.*`\.sel`.*\.$"):
        plot.bifurcation(two)
    plot.bifurcation(two.isel({"spin.speed": 0}))
    plot.bifurcation(two.rename({"spin.speed": "start.rate"}))  # starts are drawn over each other
    ways = two.rename({"spin.speed": "branch"}).assign_coords(branch=list(BRANCHES))
    upper, lower = plot.bifurcation(ways)
    assert {line.get_marker() for line in lower.lines} >= {"^", "v"}
    assert "below: up" in [text.get_text() for text in upper.get_legend().get_texts()]
    _, lower = plot.bifurcation(ways.isel(branch=[1]))
    markers = {line.get_marker() for line in lower.lines}
    assert "v" in markers and "^" not in markers
    _, lower = plot.bifurcation(lanes.rename({ECCENTRICITY: "start.radius"}))
    assert lower.get_xlabel() == "start radius [mm]"
    with pytest.raises(ValueError, match="`extrema` has none; select a range"):
        plot.bifurcation(lanes.isel({ECCENTRICITY: 0}))


def test_spectrum_of_a_dataset_is_drawn_as_stored(spectra):
    ax = plot.whirl_spectrum(spectra.isel({"spin.speed": 1}), highest=5.0)
    frequency, amplitude = ax.lines[0].get_data()
    np.testing.assert_allclose(frequency, np.linspace(0.0, 5.0, 21))
    np.testing.assert_allclose(amplitude, spectra["spectrum"].values[1, :21])
    plot.whirl_spectrum(spectra.isel({"spin.speed": [1]}))


def test_spectrum_of_a_dataset_says_what_to_do_next(spectra, lanes):
    with pytest.raises(ValueError, match=r"over 'spin.speed'; select .* with `waterfall`\.$"):
        plot.whirl_spectrum(spectra)
    with pytest.raises(ValueError, match=r"has no `spectrum`.*`observe=`\.$"):
        plot.whirl_spectrum(lanes.isel({ECCENTRICITY: 0}))


# === waterfall


def test_waterfall_maps_spectra_over_three_decades(spectra):
    ax = plot.waterfall(spectra)
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
    mixed = peaks("shaft.k11").isel({"shaft.k11": [4, 0, 2, 1, 3]})
    ax = plot.waterfall(mixed, highest=4.0)
    np.testing.assert_allclose(ax.collections[0].get_array()[12], [1, 2, 3, 4, 5])
    assert ax.get_xlabel() == "shaft k11 [N/m]"


def test_waterfall_leaves_lanes_without_spectrum_blank(spectra):
    holed = spectra.where(spectra["spin.speed"] != 300.0)
    array = np.ma.masked_invalid(plot.waterfall(holed).collections[0].get_array())
    assert array.mask[:, 2].all() and array.mask.sum() == 41


def test_waterfall_says_what_it_needs(spectra):
    with pytest.raises(ValueError, match=r"at least two lanes.*has 1 lanes.*\.$"):
        plot.waterfall(spectra.isel({"spin.speed": [0]}))
    with pytest.raises(ValueError, match=r"a largest amplitude of 0\.$"):
        plot.waterfall(spectra * 0)
    with pytest.raises(ValueError, match="takes one swept dimension"):
        plot.waterfall(spectra.expand_dims({"disc.mass": [1.0, 2.0]}))


# === map over two parameters


def colours_of(ax):
    """Colours of the cells, in rows from below."""
    mesh = ax.collections[0]
    mesh.update_scalarmappable()
    rows, columns = mesh.get_array().shape
    shades = [to_hex(shade).upper() for shade in mesh.get_facecolors()]
    return np.reshape(shades, (rows, columns)).tolist()


def test_map_of_a_sweep_tells_contact_from_none(mapped):
    ax = plot.sweep_map(mapped)
    below, above = colours_of(ax)
    assert len(set(below)) == 1 and not set(below) & set(above)
    assert legend(ax)[0] == "no contact" and legend(ax)[1].startswith("rub, ")
    assert ax.get_xlabel() == "spin speed [rad/s]"
    assert ax.get_ylabel() == "unbalance eccentricity [mm]"
    assert [axis.get_xlabel() for axis in ax.child_axes] == ["spin speed [rpm]"]
    ax.figure.draw_without_rendering()
    low, high = ax.child_axes[0].get_xlim()
    assert [low, high] == pytest.approx(np.multiply(ax.get_xlim(), 30 / np.pi))
    assert ax.collections[0].get_rasterized()
    check_axes(lambda given: plot.sweep_map(mapped, ax=given))


def test_map_has_a_colour_for_every_kind(kinds):
    ax = plot.sweep_map(kinds)
    rub = ["rub, forward whirl", "rub, backward whirl", "rub, undefined"]
    assert legend(ax) == ["no contact", *rub, "steps too long", "no result"]
    below, above = colours_of(ax)
    assert below[1:] == [colours.BACKWARD, colours.DARK]
    assert above == [colours.FORWARD, colours.UNDEFINED, "#FFFFFF"]
    other = plot.sweep_map(kinds.transpose()).collections[0].get_array()
    np.testing.assert_array_equal(other, ax.collections[0].get_array().T)


def test_map_tells_what_has_run_away(kinds):
    """Beyond a tenth of the shaft's 0.7 m, whatever its whirl; a lane without a result has none."""
    far = put(kinds, radius_max=np.array([[0.01, 0.0701], [0.0699, 0.5], [0.1, np.inf]]))
    ax = plot.sweep_map(far)
    below, above = colours_of(ax)
    assert above[:2] == [colours.MAGENTA] * 2 and above[2] == "#FFFFFF"
    assert below[1:] == [colours.BACKWARD, colours.DARK]
    assert "ran away" in legend(ax)


def test_map_takes_the_direction_from_winding_if_it_can(kinds):
    """A passage near the centre makes the index large, and its sign that of rounding."""
    other = put(kinds, index=-19.0 * kinds["index"].values)
    assert colours_of(plot.sweep_map(other)) == colours_of(plot.sweep_map(kinds))
    without = colours_of(plot.sweep_map(other.drop_vars("winding")))
    assert without[1][0] == colours.BACKWARD
    assert without[0] == [*colours_of(plot.sweep_map(kinds))[0][:1], colours.FORWARD, colours.DARK]


def test_map_in_ascending_order(kinds):
    mixed = kinds.isel({"spin.speed": [2, 0, 1]})
    assert colours_of(plot.sweep_map(mixed)) == colours_of(plot.sweep_map(kinds))


def test_map_without_limiters_is_by_whirl(kinds):
    ax = plot.sweep_map(kinds.drop_vars("duty"))
    assert legend(ax)[:3] == ["forward whirl", "backward whirl", "undefined"]


def test_map_of_a_number_with_its_unit(kinds):
    radius = np.arange(1.0, 7.0).reshape(3, 2) * 1e-3
    ax = plot.sweep_map(put(kinds, radius_max=radius), "radius_max")
    mesh = ax.collections[0]
    np.testing.assert_allclose(mesh.get_array(), [[1, 3, 5], [2, 4, np.nan]])
    assert mesh.colorbar.ax.get_ylabel() == "largest radius [mm]"
    assert legend(ax) == ["no result"] and mesh.norm.vmin == 1.0
    ax = plot.sweep_map(kinds, "duty")
    np.testing.assert_allclose(ax.collections[0].get_array()[0], [0.0, 0.3, 0.5])


def test_map_of_classes(kinds):
    """Whole numbers have a colour and a name each; lanes without a result are hatched."""
    ax = plot.sweep_map(kinds, "status")
    assert legend(ax) == ["ok", "not finite", "whirl undefined", "steps too long for a stop"]
    np.testing.assert_array_equal(ax.collections[0].get_array(), [[0, 0, 3], [0, 2, 1]])
    attractors = {"features": ["index"], "means": [[0.5], [-0.25]]}
    numbers = np.array([[0, 1], [1, 1], [0, -1]])
    found = kinds.assign(attractor=(kinds["status"].dims, numbers, attractors))
    ax = plot.sweep_map(found, "attractor")
    assert legend(ax) == ["index 0.5", "index -0.25", "no result"]
    blue, orange = colours.CYCLE[:2]
    assert colours_of(ax) == [[blue, orange, blue], [orange, orange, "#FFFFFF"]]
    motions = flags("kind of motion", MOTIONS)
    claimed = kinds.assign(
        motion=(kinds["status"].dims, np.array([[0, 2], [2, 4], [0, 1]]), motions)
    )
    ax = plot.sweep_map(claimed, "motion")
    assert legend(ax) == ["periodic", "chaotic", "undecided", "no result"]
    shades = [colours.MOTIONS[name] for name in ("periodic", "chaotic", "undecided")]
    assert colours_of(ax)[0][:2] == [shades[0], shades[1]] and colours_of(ax)[1][1] == shades[2]
    counted = kinds.assign(missed=(kinds["status"].dims, np.array([[0, 3], [0, 3], [7, 0]])))
    assert legend(plot.sweep_map(counted, "missed")) == [
        "missed 0",
        "missed 3",
        "missed 7",
        "no result",
    ]
    many = kinds.assign(missed=(kinds["status"].dims, np.arange(6).reshape(3, 2)))
    assert len(legend(plot.sweep_map(many, "missed"))) == 6  # five, and the lane that failed


def test_map_hatches_whole_cells(kinds):
    """Cells end half-way between values: 1.3 to 1.5 times the speed, 1.1 to 2.9 mm."""
    hatched = [c for c in plot.sweep_map(kinds, "radius_max").collections if c.get_hatch()]
    (cell,) = hatched[0].get_paths()
    corners = cell.get_extents()
    np.testing.assert_allclose(corners.intervalx, np.array([1.3, 1.5]) * SPEED)
    np.testing.assert_allclose(corners.intervaly, [1.1, 2.9])


def test_map_in_a_chosen_unit(kinds):
    with plot.units(speed="rpm", length="um"):
        ax = plot.sweep_map(kinds)
    assert ax.get_xlabel() == "spin speed [rpm]" and not ax.child_axes
    assert ax.get_ylabel() == "unbalance eccentricity [\N{MICRO SIGN}m]"


def test_map_chooses_a_scale(kinds):
    norm = lambda dataset, name, **given: plot.sweep_map(dataset, name, **given).collections[0].norm
    wide = put(kinds, radius_max=np.geomspace(1e-6, 1.0, 6).reshape(3, 2))
    assert isinstance(norm(wide, "radius_max"), LogNorm)
    mine = LogNorm(0.1, 10.0)
    assert norm(kinds, "radius_max", norm=mine) is mine
    about_zero = norm(kinds, "index")
    assert about_zero.vmin == -about_zero.vmax == -1.0
    assert legend(plot.sweep_map(kinds, "index")) == ["undefined", "no result"]


def test_map_of_runs_along_times():
    over = {"spin.speed": [0.9 * SPEED, SPEED], ECCENTRICITY: [2e-4, 2e-3]}
    run = {"times": np.linspace(0.0, 0.1, 65), "steps_per_revolution": 32, "error_sample": 0}
    runs = jr.sweep(RUBBING, over, **run)
    ax = plot.sweep_map(runs)
    assert legend(ax) == ["no contact", "rub"]
    below, above = colours_of(ax)
    assert below != above and set(above) == {colours.ORANGE}
    mesh = plot.sweep_map(runs, "peak").collections[0]
    np.testing.assert_allclose(mesh.get_array(), 1e3 * runs["peak"].T)
    assert mesh.colorbar.ax.get_ylabel() == "largest radius at the samples of the run [mm]"


def test_map_says_what_it_needs(kinds):
    one = kinds.isel({"spin.speed": 0})
    with pytest.raises(ValueError, match=r"has 'unbalance.eccentricity' \(2\); select .*\.$"):
        plot.sweep_map(one)
    with pytest.raises(ValueError, match=r"two or more values each.*'spin.speed' \(1\)"):
        plot.sweep_map(kinds.isel({"spin.speed": [0]}))
    ways = one.expand_dims(branch=list(BRANCHES))
    with pytest.raises(ValueError, match="takes two swept parameters"):
        plot.sweep_map(ways)
    with pytest.raises(ValueError, match=r"has no `spectrum`.*`observe=`\.$"):
        plot.sweep_map(kinds, "spectrum")
    with pytest.raises(
        ValueError, match=r"one number a lane, but `section` is over .*'revolution'"
    ):
        plot.sweep_map(kinds, "section")
    with pytest.raises(ValueError, match=r"needs `duty`, `winding` or .*of section, "):
        plot.sweep_map(kinds.drop_vars(["duty", "winding", "index"]))
