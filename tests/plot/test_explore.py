"""Explorer of a sweep, without a window: a click or a key shows the lane as simulated alone."""

import importlib

import matplotlib


matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402
from matplotlib.backend_bases import KeyEvent, MouseEvent  # noqa: E402
from typer.testing import CliRunner  # noqa: E402

import jaxrotor as jr  # noqa: E402
from jaxrotor import plot  # noqa: E402
from jaxrotor.cli import app  # noqa: E402


ROTOR = jr.load("limiter-rotor").with_nodes(4)
VALUES = np.array([1e-4, 4e-4, 7e-4])
RUN = {"settle": 6, "keep": 4, "steps_per_revolution": 48, "error_sample": 0}


@pytest.fixture(scope="module")
def swept():
    over = {"unbalance.eccentricity": VALUES, "start.radius": [7e-4, 12e-3]}
    return jr.sweep(ROTOR, over, start=jr.Whirl(1e-3, -441.0123456789012), progress=False, **RUN)


@pytest.fixture
def explorer(swept):
    yield plot.explore(swept)
    plt.close("all")


def click(explorer, ax, x, y):
    canvas = explorer.figure.canvas
    canvas.draw()  # places the axes
    across, up = ax.transData.transform((x, y))
    canvas.callbacks.process(
        "button_press_event", MouseEvent("button_press_event", canvas, across, up, 1)
    )


def alone(eccentricity, radius):
    scene = ROTOR.replace({"unbalance.eccentricity": eccentricity})
    how = {"start": jr.Whirl(radius, -441.0123456789012), "keep": RUN["keep"]}
    return jr.simulate(scene, 10, RUN["steps_per_revolution"], **how)


def drawn(explorer):
    (line,) = [one for one in explorer.orbit.get_lines() if one.get_label() == "orbit"]
    return line.get_xdata() + 1j * line.get_ydata()


@pytest.mark.slow
def test_a_click_shows_the_lane_nearest_to_it(explorer, swept):
    assert explorer.response is None and "click" in explorer.orbit.texts[0].get_text()
    for number, start in ((1, 0), (1, 1), (2, 0)):
        lane = swept.isel({"unbalance.eccentricity": number, "start.radius": start})
        heights = lane["extrema"].values[np.isfinite(lane["extrema"].values)]
        other = swept.isel({"unbalance.eccentricity": number, "start.radius": 1 - start})
        far = [np.nanmin(np.abs(other["extrema"].values - height)) for height in heights]
        height = heights[int(np.argmax(far))]  # where only this lane is
        click(explorer, explorer.upper, 1e3 * VALUES[number] - 0.004, 1e3 * height)
        expected = alone(VALUES[number], float(swept["start.radius"][start]))
        path = 1e3 * np.asarray(expected.displacement[:, 0])
        np.testing.assert_allclose(drawn(explorer), path, rtol=0, atol=1e-9 * np.abs(path).max())
        assert len(explorer.spectrum.get_lines()) == 1
        assert f"{1e3 * VALUES[number]:.6g}" in explorer.orbit.get_title(loc="left")


@pytest.mark.slow
def test_the_index_and_the_keys(explorer, swept):
    index = float(swept["index"][0, 1])
    click(explorer, explorer.lower, 1e3 * VALUES[0], index)
    first = drawn(explorer)
    canvas = explorer.figure.canvas
    canvas.callbacks.process("key_press_event", KeyEvent("key_press_event", canvas, "right"))
    assert np.abs(drawn(explorer) - first).max() > 1e-3
    canvas.callbacks.process("key_press_event", KeyEvent("key_press_event", canvas, "left"))
    np.testing.assert_array_equal(drawn(explorer), first)
    assert not any("click" in text.get_text() for text in explorer.orbit.texts)


@pytest.mark.slow
def test_of_more_parameters_one_is_chosen(swept):
    chosen = plot.explore(swept.isel({"start.radius": 0}))
    chosen.show(2)
    path = 1e3 * np.asarray(alone(VALUES[2], 7e-4).displacement[:, 0])
    np.testing.assert_allclose(drawn(chosen), path, rtol=0, atol=1e-9 * np.abs(path).max())
    plt.close("all")


@pytest.mark.slow
def test_a_motion_without_whirl_is_said():
    """At rest in the centre the orbit is a point, and there is no spectrum."""
    over = {"unbalance.eccentricity": [0.0, *VALUES[1:]], "start.radius": [0.0, 12e-3]}
    rest = jr.sweep(ROTOR, over, start=jr.Whirl(1e-3, 0.0), progress=False, **RUN)
    explorer = plot.explore(rest.isel({"start.radius": 0}))
    explorer.show(0)
    assert "undefined" in explorer.spectrum.texts[0].get_text().replace("\n", " ")
    assert np.abs(drawn(explorer)).max() == 0.0
    plt.close("all")


@pytest.mark.slow
def test_the_last_revolutions_are_shown(swept, monkeypatch):
    """If more were kept, the last ones are those of the diagram."""
    monkeypatch.setattr(importlib.import_module("jaxrotor.plot.lane_motions"), "LONGEST", 2)
    explorer = plot.explore(swept.isel({"start.radius": 0}))
    explorer.show(0)
    start = jr.Whirl(7e-4, -441.0123456789012)
    scene = ROTOR.replace({"unbalance.eccentricity": VALUES[0]})
    found = jr.simulate(scene, 10, RUN["steps_per_revolution"], start=start, keep=2)
    np.testing.assert_allclose(explorer.response.displacement, found.displacement, rtol=1e-9)


@pytest.mark.slow
def test_at_zero_speed_a_revolution_is_the_period_given():
    still = ROTOR.replace({"spin.speed": 0.0, "unbalance.eccentricity": 0.0})
    start, over = jr.Whirl(9e-3), {"limiters.gap": [7e-3, 8e-3]}
    explorer = plot.explore(jr.sweep(still, over, start=start, period=0.009, progress=False, **RUN))
    explorer.show(1)
    scene = still.replace({"limiters.gap": 8e-3})
    how = {"start": start, "keep": RUN["keep"], "period": 0.009}
    alone = jr.simulate(scene, 10, RUN["steps_per_revolution"], **how)
    np.testing.assert_allclose(
        drawn(explorer), 1e3 * np.asarray(alone.displacement[:, 0]), atol=1e-12
    )
    plt.close("all")


def test_refusals(swept):
    with pytest.raises(ValueError, match="Only a data set of `sweep`"):
        plot.explore(swept.drop_attrs())
    for about, words in (
        ({"start": "Continued(q=..)"}, "only one from AtRest or Whirl"),
        ({"solver_settings": '{"class": "Kvaerno5"}'}, "only `Exponential`"),
        ({"start": "AtRest()", "solver": "Kvaerno5"}, "only `Exponential`"),
    ):
        with pytest.raises(ValueError, match=words):
            plot.explore(swept.assign_attrs(about))
    with pytest.raises(ValueError, match="carry"):
        plot.explore(swept.expand_dims(branch=["up", "down"]))


@pytest.mark.slow
def test_command(swept, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    swept.to_zarr("sweep.zarr", zarr_format=2)
    asked = lambda *more: CliRunner().invoke(app, ["explore", ".", *more])
    assert asked("--at", "0.4", "--out", "half.png").exit_code == 0
    assert np.ptp(plt.imread("half.png")) > 0.5
    for more, words in (
        ((), "No window can be opened here"),  # tests draw without one
        (("--out", "half.png"), "exists already"),
        (("--out", "half.xyz"), "is not supported"),
        (("--at", "nan"), "must be a number on the axis"),
    ):
        result = asked(*more, *(["--out", "other.png"] if "--at" in more else []))
        assert result.exit_code == 2 and words in result.output.replace("\n", " ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["half.png", "sweep.zarr"]
    plt.close("all")
