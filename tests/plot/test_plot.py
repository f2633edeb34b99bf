"""Plots of a scene, and of maps over two parameters: stability and errors."""

import dataclasses

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from drawn import check_axes, lines
from matplotlib.colors import LogNorm, to_hex
from matplotlib.patches import Circle, Polygon

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.analysis.balancer import StabilityChart
from jaxrotor.plot import colours, page


pytestmark = pytest.mark.usefixtures("rendered")


# === rotor


def test_rotor_is_drawn_to_scale():
    """The disc of the limiter rotor has a diameter of 200 mm, 10 mm width and stops 7.5 mm off its rim."""
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
    )  # the one at the side is drawn twice
    assert ax.get_xlabel().endswith("not drawn: external damping, disc damping, internal damping")
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["shaft", "disc", "limiter", "clamp", "unbalance"]


def test_a_rotor_fills_its_figure():
    """Height over width of the Axes is that of the rotor, and of a new figure nearly so."""
    scene = jr.load("limiter-rotor")
    for ax in (plot.rotor(scene), plot.rotor(scene.replace({"limiters.rim_radius": 0.5}))):
        ax.figure.draw_without_rendering()
        (width, height), box = ax.figure.get_size_inches(), ax.get_window_extent()
        shares = np.array([box.width, box.height]) / ax.figure.dpi / (width, height)
        assert (shares > 0.5).all()
        low, high = ax.get_ylim()
        assert box.height / box.width == pytest.approx((high - low) / np.ptp(ax.get_xlim()))
    with plot.units(length="m"):
        ax = plot.rotor(scene)
    assert ax.get_xlabel().startswith("station [m]; not") and ax.get_ylabel() == "radius [m]"
    assert ax.patches[0].get_width() == pytest.approx(0.7)


def test_a_rotor_in_a_narrow_column_is_legible():
    """In 90 mm its legend has several rows and its label several lines, of at least 7 pt, none cut off."""
    with plt.rc_context(page.STYLE):
        figure, ax = plt.subplots(figsize=page.inches(90, 55), layout="constrained")
    plot.rotor(jr.load("limiter-rotor"), ax)
    figure.draw_without_rendering()
    texts = [*ax.get_legend().get_texts(), ax.xaxis.label, ax.yaxis.label]
    assert min(text.get_size() for text in (*texts, *ax.get_xticklabels())) >= 7.0
    assert "\n" in ax.get_xlabel()
    for text in texts:
        box = text.get_window_extent()
        assert box.x0 >= 0 and box.x1 <= figure.bbox.width, text.get_text()


def test_a_ring_is_drawn_on_both_sides():
    """At 7.5 mm from the rim of 100 mm, and 2 mm lower than the axis."""
    scene = jr.load("limiter-rotor").without("limiters")
    ring = jr.AnnularStator(0.7, 7.5e-3, 4e6, rim_radius=0.1, offset=2e-3, angle=-np.pi / 2)
    ax = plot.rotor(scene.of_parts(*scene.effects, ring))
    boxes = [box for box in ax.patches if to_hex(box.get_facecolor()).upper() == colours.ORANGE]
    ends = sorted((box.get_y(), box.get_y() + box.get_height()) for box in boxes)
    assert (ends[0][1], ends[1][0]) == pytest.approx((-109.5, 105.5))
    assert "ring" in [text.get_text() for text in ax.get_legend().get_texts()]


@pytest.mark.parametrize("name", [name for name, _ in jr.shipped()])
def test_every_shipped_rotor_can_be_drawn(name):
    scene = jr.load(name)
    low, high = plot.rotor(scene).get_xlim()
    assert low <= 0.0 and high >= 1e3 * float(scene.shaft.length)
    plt.close("all")


def test_balls_of_a_bearing_are_drawn_between_its_races():
    ax = plot.rotor(jr.load("rolling-bearing"))
    balls = [one for one in ax.patches if isinstance(one, Circle)]
    assert [one.center for one in balls] == [
        (x, pytest.approx(y)) for x in (0, 400) for y in (52, -52)
    ]
    assert [2 * one.radius for one in balls] == pytest.approx([23.8] * 4)


def test_a_casing_is_drawn_between_shaft_and_ground():
    """It reaches beyond both bearings that stand on it, and a spring holds it at its middle."""
    bearings = [jr.Support(at, 1e7, on="frame") for at in (0.2, 0.8)]
    frame = jr.Casing("frame", 40.0), jr.Support(of="frame", stiffness=1e8)
    disc = jr.Disc.thin(0.5, 10.0, 0.1)
    scene = jr.Scene(jr.RigidShaft(1.0), *bearings, *frame, disc, spin=jr.ConstantSpeed(1.0))
    ax = plot.rotor(scene)
    (box,) = [box for box in ax.patches if box.get_label() == "casing"]
    left, right = box.get_x(), box.get_x() + box.get_width()
    assert left < 200.0 and right > 800.0 and left + right == pytest.approx(1000.0)
    springs = [line for line in ax.lines if line.get_color() == colours.MAGENTA]
    feet = [(line.get_xdata()[-1], line.get_ydata()[-1]) for line in springs]
    assert [x for x, _ in feet] == pytest.approx([200.0, 800.0, 500.0])
    top = box.get_y() + box.get_height()
    assert feet[0][1] == feet[1][1] == pytest.approx(top) and feet[2][1] < box.get_y()
    plt.close("all")


def test_parts_without_a_size_are_symbols_at_their_stations():
    """On the surface of a shaft of 25 mm radius, as high above the axis as below; a crack is within."""
    parts = [
        jr.LoosePedestal("block", 12.0, 5e7, 8e3, 2e7, 4e3, 4e-5),
        jr.Support(0.05, 8e6, on="block"),
        jr.Crack(0.6, compliance=1e-6),
        jr.Seal(0.7, 4e-4, 6e5, 1800.0, 0.46),
        jr.Coupling(1.0, 1e5, 0.2),
        jr.OldhamCoupling(0.9, 1.5, 2e-4),
        jr.MagneticBearing(0.3, 4e-6, 3.0, 4e-4, kp=15000.0, kd=15.0, sensor=0.36),
        jr.SqueezeFilm(0.8, 0.02, 0.03, 0.1, 1e-4),
    ]
    ax = plot.rotor(jr.Scene(jr.FlexibleShaft(1.0, 0.05), *parts, spin=jr.ConstantSpeed(1.0)))
    handles, names = ax.get_legend_handles_labels()
    drawn = dict(zip(names, handles, strict=True))
    assert {"loose pedestal", "foundation", "bolt", "support"} < set(names)
    places = {"seal": 700, "coupling": 1000, "floating disc": 900, "magnetic bearing": 300}
    for name, at in (places | {"squeeze film": 800}).items():
        every = [p.get_xy() for p in ax.patches if isinstance(p, Polygon)]
        own = [xy for xy in every if abs(xy[:, 0].mean() - at) < 40]
        x, y = np.concatenate(own).T
        assert x.min() + x.max() == pytest.approx(2 * at), name
        assert y.max() == pytest.approx(-y.min()) and np.abs(y).min() >= 25.0 - 1e-9
        assert drawn[name].get_xy()[0, 1] >= 25.0 - 1e-9
    assert drawn["crack"].get_xdata() == pytest.approx(600.0, abs=10.0)
    assert np.abs(drawn["crack"].get_ydata()).max() <= 30.0
    assert drawn["sensor"].get_xdata() == [360.0]
    assert "not drawn" not in ax.get_xlabel()
    plt.close("all")


def test_a_scene_prints_its_parameters():
    text = str(jr.load("turbine-variants", row=1))
    assert text.startswith("RigidShaft, Drive (layout assumed: chain)")
    assert "  discs.mass = 100, 90 kg" in text and "  discs.offset = 0.0002, - m" in text


# === stability maps


@pytest.mark.parametrize(
    "draw",
    [
        lambda ax: plot.stability_map(stability(), ax=ax),
        lambda ax: plot.boundary_family([stability()], ["k = 0"], ax=ax),
        lambda ax: plot.error_map([0, 1], [0, 1], np.eye(2), np.eye(2), ax=ax),
    ],
    ids=["stability_map", "boundary_family", "error_map"],
)
def test_draws_in_given_axes_or_a_figure_of_its_own(draw):
    check_axes(draw)


def stability(shift=0.0, growth=None, paths=("unbalance.eccentricity", "spin.speed")):
    """A map that is unstable right of the parabola `x = 0.002 + shift + (y / 1000 - 0.3)^2 / 50`."""
    x, y = np.linspace(0.0, 0.01, 41), np.linspace(100.0, 500.0, 31)
    arc = lambda y: 0.002 + shift + (y / 1000 - 0.3) ** 2 / 50
    values = 1e3 * (x[:, None] - arc(y))
    curve = np.stack([arc(y), y], axis=1)
    return jr.StabilityMap(
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


def test_stability_map_of_internal_damping():
    """A rotor stable below `w (1 + c / h)`: w = 100 rad/s, c at the disc and h = 4 N s/m in the shaft."""
    scene = jr.Scene(
        jr.MasslessShaft(0.6, 0.3, 2e4, damping=4.0),
        jr.Disc(0.3, 2.0),
        jr.DiscDamping(0.3, 8.0),
        spin=jr.ConstantSpeed(100.0),
    )
    outer, speeds = np.linspace(0.0, 8.0, 5), np.linspace(60.0, 340.0, 7)
    found = jr.stability_map(scene, {"disc_damping.translational": outer, "spin.speed": speeds})
    ax = plot.stability_map(found)
    (shading,) = ax.collections
    inside = lambda x, y: any(path.contains_point((x, y)) for path in shading.get_paths())
    assert inside(4.0, 230.0) and not inside(4.0, 170.0)
    x, y = lines(ax)["boundary of stability"].get_data()
    np.testing.assert_allclose(y, 100 * (1 + x / 4))
    assert ax.get_xlim() == (0.0, 8.0) and ax.get_ylim() == (60.0, 340.0)
    assert ax.get_xlabel() == "disc damping translational [N s/m]"


def test_stability_map_without_a_boundary():
    stable = plot.stability_map(stability(growth=-1.0))
    assert not stable.collections and stable.get_legend() is None
    undamped = plot.stability_map(stability(growth=np.eye(41, 31) - 1.0))
    assert not undamped.collections and undamped.get_xlim() == (0.0, 10.0)


def test_stability_map_hatches_what_is_not_known():
    growth = stability().growth.copy()
    growth[:20, :10] = np.nan  # to x = 5 mm and y = 220 rad/s
    ax = plot.stability_map(dataclasses.replace(stability(), growth=growth))
    (hatched,) = [c for c in ax.collections if getattr(c, "hatches", [None]) == ["///"]]
    inside = lambda of, x, y: any(path.contains_point((x, y)) for path in of.get_paths())
    assert inside(hatched, 4.0, 150.0) and not inside(hatched, 6.0, 150.0)
    (shading,) = [c for c in ax.collections if c is not hatched]
    assert inside(shading, 6.0, 150.0) and not inside(shading, 4.0, 150.0)
    assert "unknown" in [text.get_text() for text in ax.get_legend().get_texts()]


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


# === stability chart


def charted(growth):
    """A chart over speed and mass, stable above speed 2 - mass / 2, predicted stable above 1."""
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


def studied(*names):
    """A study of methods, each with one run."""
    columns = {name: ("run", np.full(len(names), 1e-3)) for name in ("run_time", "relative_error")}
    columns |= {"status": ("run", np.zeros(len(names), np.int8))}
    columns |= {"value": ("run", np.ones(len(names)), {"long_name": "whirl rate"})}
    coords = {"method": ("run", list(names))}
    return xr.Dataset(columns, coords, {"reference": 1.0, "reference_uncertainty": 0.0, "lanes": 1})


def test_a_method_has_one_style_in_the_pictures_of_several_studies():
    names = ("Tsit5", "Dopri8", "Kvaerno3")
    drawn = [lines(plot.work_precision(studied(*own), methods=names)) for own in (names, names[1:])]
    for name in names[1:]:
        one, other = (found[name] for found in drawn)
        assert one.get_color() == other.get_color() and one.get_marker() == other.get_marker()
    assert set(drawn[1]) == set(names[1:])
    alone = lines(plot.work_precision(studied(*names[1:])))  # styles begin anew
    assert alone["Dopri8"].get_color() == drawn[0]["Tsit5"].get_color()
