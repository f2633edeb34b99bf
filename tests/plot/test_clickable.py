"""Clickable page of a sweep: what it holds, and what the mouse does to it in a browser."""

import base64
import gzip
import json
import re
import shutil
import sys
import time

import numpy as np
import pytest
import xarray as xr
from systems import one_disc
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.cli import app
from jaxrotor.files.toml import dumps
from jaxrotor.plot.lane_motions import spread_lanes
from jaxrotor.results.provenance import as_json


STOP = jr.Limiter(0.5, 0.0, gap=7e-3, stiffness=4e4)
ROTOR = one_disc(STOP, mass=10.0, damping=60.0, stiffness=1e5, speed=50.0, eccentricity=1e-4)
PATHS = "unbalance.eccentricity", "start.angle"
VALUES, ANGLES = np.linspace(1e-4, 1e-3, 7), np.array([0.0, 1.5])
RUN = {"settle": 3, "keep": 4, "steps_per_revolution": 32}
FRACTION = 1 / 20_000  # of the largest number of a motion, to which its numbers are rounded
LOST = 4, 0  # the lane that is said to have failed


def content_of(path):
    """What the script of a page reads."""
    packed = re.search(r'id="data">([^<]+)<', path.read_text("utf-8"))[1]
    return json.loads(gzip.decompress(base64.b64decode(packed)))


def numbers(packed):
    return np.cumsum(packed["columns"], axis=1) * packed["unit"]


# === what is in a page


def told(paths, **variables):
    """A data set over `paths` as a sweep gives it."""
    settings = {"start": as_json(jr.AtRest()), "solver_settings": as_json(jr.Exponential())}
    settings |= {**RUN, "period": "that of the spin", "station": 0.5}
    data = xr.Dataset(variables, paths, {"scene": dumps(ROTOR), "title": "by hand", **settings})
    data["index"].attrs["units"] = "1"
    return data


@pytest.fixture(scope="module")
def by_hand():
    """Three lanes: two heights, a circle of 2 mm once a revolution, and a lane without a result."""
    (name, _), t = PATHS, 2 * np.pi * np.arange(1, 4 * 32 + 1) / 32
    circle = 2e-3 * np.stack([np.cos(t), np.sin(t)], -1).reshape(4, 32, 2)
    orbit = np.stack([circle, 2 * circle, np.nan * circle])
    heights = np.array([[1e-3, np.nan, -1e-3], [4e-3, 4e-3 + 1e-9, np.nan], [9.0, 9.0, 9.0]])
    lanes, samples = (name,), ("revolution", "sample", "axis")
    return told(
        {name: [1e-4, 2e-4, 3e-4], "frequency": [0.0, 0.25, 0.5]},
        extrema=((name, "revolution", "extremum"), np.tile(heights[:, None], (1, 4, 1))),
        index=(lanes, [1.0, -0.5, np.nan]),
        status=(lanes, [0, 0, 1]),
        orbit=((name, *samples), orbit),
        spectrum=((name, "frequency"), [[0.0, 0.3, 0.1], 3 * [np.nan], 3 * [np.nan]]),
    )


def test_what_a_page_holds(by_hand, tmp_path):
    plot.write_page(tmp_path / "a.html", by_hand)
    held = content_of(tmp_path / "a.html")
    assert held["axes"][0] == {
        "name": "unbalance eccentricity",
        "unit": "",
        "values": [1e-4, 2e-4, 3e-4],
    }
    heights = [np.cumsum(one) * held["level"] + held["low"] for one in held["points"]]
    np.testing.assert_allclose(heights[0], [-1, 1], atol=held["level"])
    np.testing.assert_allclose(heights[1], [4], atol=held["level"])  # both in one bin
    assert held["points"][2] == [] and held["failed"] == [False, False, True]
    names = [group["name"] for group in held["groups"]]
    assert [names[k] for k in held["group"][:2]] == ["forward whirl", "backward whirl"]
    assert held["numbers"][0]["values"] == [1.0, -0.5, None]
    assert [motion["lane"] for motion in held["motions"]] == [0, 1]
    first, second = held["motions"]
    t = 2 * np.pi * np.arange(1, 129) / 32
    circle = 2 * np.stack([np.cos(t), np.sin(t)])
    np.testing.assert_allclose(numbers(first["orbit"]), circle, atol=FRACTION * 2)
    np.testing.assert_allclose(
        numbers(second["marks"]), np.tile([[4.0], [0]], 4), atol=FRACTION * 4
    )
    np.testing.assert_allclose(numbers(first["spectrum"])[0], [0, 0.3, 0.1], atol=FRACTION)
    assert second["spectrum"] is None and held["frequency"] == [0, 0.25, 0.5]
    (stop,) = first["stops"]  # a line at the gap, as the orbit has it
    assert stop["name"] == "limiter" and stop["x"] == [7, 7]
    with plot.units(length="um"):
        plot.write_page(tmp_path / "b.html", by_hand)
    fine = content_of(tmp_path / "b.html")
    circles = [numbers(one["motions"][0]["orbit"]) for one in (held, fine)]
    np.testing.assert_allclose(circles[1], 1e3 * circles[0], rtol=1e-12)
    assert (held["lengthUnit"], fine["lengthUnit"], stop["x"]) == ("mm", "\N{MICRO SIGN}m", [7, 7])
    text = (tmp_path / "a.html").read_text("utf-8")
    assert "<title>by hand</title>" in text and "eccentricity = 0.0001" in text and "@@" not in text


@pytest.fixture(scope="module")
def map_page(tmp_path_factory):
    """The page of four lanes over two parameters, without motions."""
    (name, _), other = PATHS, "spin.speed"
    lanes = (name, other)
    data = told(
        {name: [1e-4, 2e-4], other: [60.0, 50.0]},  # sorted in the page
        index=(lanes, [[1.0, -1.0], [1.0, np.nan]]),
        status=(lanes, [[0, 0], [0, 1]]),
    )
    path = tmp_path_factory.mktemp("map") / "a.html"
    plot.write_page(path, data, motions=0, title="a < b")
    return path


def test_a_map(map_page):
    held = content_of(map_page)
    names = [held["groups"][k]["name"] for k in held["group"]]
    assert names == ["backward whirl", "forward whirl", "no result", "forward whirl"]
    assert held["axes"][1] == {"name": "spin speed", "unit": "rad/s", "values": [50, 60]}
    assert held["motions"] == [] and "a &lt; b" in map_page.read_text("utf-8")


def test_lanes_are_spread_over_values_and_starts():
    good = np.zeros(700, int)
    assert spread_lanes([5], [], 3, good).tolist() == [0, 2, 4]
    assert spread_lanes([5], [2], 5, good).tolist() == [0, 1, 8, 9]
    assert spread_lanes([5], [7], 3, good).tolist() == [0, 3, 6]
    assert spread_lanes([5], [], 99, good).tolist() == [0, 1, 2, 3, 4]
    assert spread_lanes([3, 5], [], 7, good).tolist() == [0, 2, 4, 10, 12, 14]
    assert spread_lanes([5], [], 0, good).tolist() == []
    good[2] = 1  # it has no result
    assert spread_lanes([5], [], 3, good).tolist() == [0, 4]


def test_refusals(by_hand, tmp_path, monkeypatch):
    page = tmp_path / "a.html"
    with pytest.raises(ValueError, match="must end in .html, but is a.htm"):
        plot.write_page(tmp_path / "a.htm", by_hand)
    with pytest.raises(ValueError, match="`motions` must be a whole number of at least 0"):
        plot.write_page(page, by_hand, motions=-1)
    with pytest.raises(ValueError, match="one swept dimension, but `extrema` has"):
        plot.write_page(page, by_hand.expand_dims({"spin.speed": [1.0], PATHS[1]: [1.0]}))
    with pytest.raises(ValueError, match="carry"):
        plot.write_page(page, by_hand.expand_dims(branch=["up", "down"]))
    drag = by_hand.drop_vars("orbit").assign_attrs(solver_settings='{"class": "Kvaerno5"}')
    with pytest.raises(ValueError, match="only `Exponential` can. With no motions"):
        plot.write_page(page, drag)
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    with pytest.raises(ValueError, match=r"`pip install plotly`"):
        plot.write_page(page, by_hand)
    assert not list(tmp_path.iterdir())


def test_command(by_hand, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    by_hand.to_zarr("sweep.zarr", zarr_format=2)
    asked = lambda *more: CliRunner().invoke(app, ["explore", ".", "--html", "a.html", *more])
    assert asked("--motions", "1").exit_code == 0
    assert len(content_of(tmp_path / "a.html")["motions"]) == 1
    for more, words in ((("--at", "1"), "leave out --at and --out"), ((), "exists already")):
        result = asked(*more)
        assert result.exit_code == 2 and words in result.output.replace("\n", " ")


# === in a browser

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)


@pytest.fixture(scope="module")
def swept():
    over = dict(zip(PATHS, (VALUES, ANGLES), strict=True))
    found = jr.sweep(ROTOR, over, start=jr.Whirl(7e-3, 75.0), progress=False, error_sample=0, **RUN)
    found["status"].values[LOST] = 1
    return found


@pytest.fixture(scope="module")
def page(swept, tmp_path_factory):
    """The page of the sweep in Chromium, without network; its errors are in `page.errors`."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    from playwright.sync_api import sync_playwright

    path = tmp_path_factory.mktemp("page") / "a.html"
    plot.write_page(path, swept, motions=6)
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        context = browser.new_context(viewport={"width": 1280, "height": 900}, offline=True)
        page = context.new_page()
        page.errors, page.asked = [], []
        page.on("console", lambda said: said.type == "error" and page.errors.append(said.text))
        page.on("pageerror", lambda error: page.errors.append(str(error)))
        page.on("request", lambda request: page.asked.append(request.url))
        page.goto(path.as_uri())
        page.wait_for_selector("body[data-ready]", timeout=120_000)
        yield page
        browser.close()


def pixel(page, x, y, axis="yaxis"):
    """Where a point of the diagram is on the screen."""
    return page.evaluate(
        """([x, y, axis]) => {
            const drawn = document.getElementById("diagram"), layout = drawn._fullLayout;
            const box = drawn.getBoundingClientRect(), across = layout.xaxis, up = layout[axis];
            return [box.left + across._offset + across.d2p(x), box.top + up._offset + up.d2p(y)];
        }""",
        [x, y, axis],
    )


def lone_height(swept, value, angle):
    """The extremum [mm] of a lane that is farthest from those of the other start."""
    mine, other = (1e3 * swept["extrema"].values[value, k].ravel() for k in (angle, 1 - angle))
    mine = mine[np.isfinite(mine)]
    return float(mine[np.argmax(np.nanmin(np.abs(mine[:, None] - other), axis=1))])


def until(page, expression):
    page.wait_for_function(expression, timeout=60_000)


def drawn(page, panel, trace=0):
    """x and y of a trace of a panel."""
    return np.array(
        page.evaluate(
            "([panel, k]) => (({x, y}) => [x, y])(document.getElementById(panel).data[k])",
            [panel, trace],
        )
    )


def click(page, swept, value, angle):
    page.mouse.move(5, 5)
    page.mouse.move(*pixel(page, 1e3 * VALUES[value], lone_height(swept, value, angle)))
    until(page, "() => document.querySelector('#diagram .hoverlayer').textContent")
    page.mouse.down()
    page.mouse.up()
    until(page, f"() => document.getElementById('told').dataset.lane == {2 * value + angle}")


@pytest.mark.slow
def test_hovering_tells_the_values(page, swept):
    height = lone_height(swept, 2, 1)
    page.mouse.move(*pixel(page, 1e3 * VALUES[2], height))
    until(page, "() => document.querySelector('#diagram .hoverlayer').textContent")
    said = page.text_content("#diagram .hoverlayer").replace("\N{MINUS SIGN}", "-")
    assert float(re.search(r"^x ([-\d.]+) mm", said)[1]) == pytest.approx(height, abs=1e-4 * 20)
    assert f"unbalance eccentricity {1e3 * VALUES[2]:.5g} mm" in said
    assert f"start angle {ANGLES[1]:.5g} rad" in said
    index = float(re.search(r"precession index ([-\d.]+\d)", said)[1])
    assert index == pytest.approx(float(swept["index"][2, 1]), rel=1e-4)
    page.mouse.move(*pixel(page, 1e3 * VALUES[LOST[0]], 0, "yaxis3"))
    until(
        page,
        "() => document.querySelector('#diagram .hoverlayer').textContent.includes('no result')",
    )
    assert "no result: not finite" in page.text_content("#diagram .hoverlayer")


@pytest.mark.slow
def test_a_click_shows_the_motion_of_its_lane(page, swept):
    for value, angle in ((3, 1), (3, 0), (6, 1)):
        click(page, swept, value, angle)
        scene = ROTOR.replace({PATHS[0]: VALUES[value]})
        how = {"start": jr.Whirl(7e-3, 75.0, ANGLES[angle]), "keep": RUN["keep"]}
        alone = jr.simulate(scene, RUN["settle"] + RUN["keep"], RUN["steps_per_revolution"], **how)
        path = 1e3 * np.asarray(alone.displacement[:, 0])
        count, near = RUN["keep"] * RUN["steps_per_revolution"], 1.01 * FRACTION
        assert path.size == count + 1
        want = np.stack([path.real, path.imag])
        top = np.abs(want).max()
        np.testing.assert_allclose(drawn(page, "orbit"), want[:, 1:], rtol=0, atol=near * top)
        once = want[:, :: RUN["steps_per_revolution"]][:, 1:]
        np.testing.assert_allclose(drawn(page, "orbit", 1), once, rtol=0, atol=near * top)
        np.testing.assert_allclose(drawn(page, "section"), once, rtol=0, atol=near * top)
        whirl = np.angle(path[1:] / path[:-1]) * RUN["steps_per_revolution"] / (2 * np.pi)
        window = np.hanning(count + 1)[:-1]
        height = 2 * np.abs(np.fft.rfft(window * (whirl - whirl.mean()))) / window.sum()
        frequency = np.arange(height.size) / RUN["keep"]
        height = (height / np.sinc(frequency / RUN["steps_per_revolution"]))[frequency <= 10]
        seen = drawn(page, "spectrum")
        np.testing.assert_allclose(seen[0], frequency[frequency <= 10])
        np.testing.assert_allclose(seen[1], height, rtol=0, atol=near * height.max())
        assert page.text_content("#told").startswith("Motion of unbalance eccentricity")


@pytest.mark.slow
def test_a_lane_without_its_motion_shows_the_nearest(page, swept):
    click(page, swept, 1, 1)
    assert page.get_attribute("#told", "data-motion") == "1"  # value 0, the same start
    assert "Below is the nearest motion" in page.text_content("#told")
    page.keyboard.press("ArrowRight")
    until(page, "() => document.getElementById('told').dataset.motion == 6")
    width = "document.getElementById('orbit')._fullLayout.xaxis._length"
    first = page.evaluate(f"() => {width}")
    for key in ("ArrowLeft", "ArrowRight"):
        page.keyboard.press(key)
    assert page.evaluate(f"() => {width}") == first > 250  # it does not shrink


@pytest.mark.slow
def test_a_drag_zooms_and_a_double_click_resets(page):
    limits = lambda: page.evaluate(
        "() => { const drawn = document.getElementById('diagram')._fullLayout;"
        " return [drawn.xaxis.range, drawn.yaxis.range]; }"
    )
    before = limits()
    x, y = ([0.75 * low + 0.25 * high, 0.5 * low + 0.5 * high] for low, high in before)
    (left, bottom), (right, top) = pixel(page, x[0], y[0]), pixel(page, x[1], y[1])
    page.mouse.move(left, bottom)
    page.mouse.down()
    page.mouse.move(right, top, steps=5)
    page.mouse.up()
    until(
        page,
        f"() => document.getElementById('diagram')._fullLayout.xaxis.range[0] > {before[0][0]}",
    )
    for found, want, whole in zip(limits(), (x, y), before, strict=True):
        assert found == pytest.approx(want, abs=0.01 * np.ptp(whole))
    time.sleep(0.5)  # so that the clicks are not taken for one with the drag
    page.mouse.dblclick((left + right) / 2, (top + bottom) / 2)
    until(
        page,
        f"() => document.getElementById('diagram')._fullLayout.xaxis.range[0] == {before[0][0]}",
    )
    assert limits() == before


@pytest.mark.slow
def test_the_page_needs_no_network_and_fits_a_phone(page):
    titles = page.evaluate(
        "() => [...document.querySelectorAll('#diagram .modebar-btn')].map(one => one.dataset.title)"
    )
    assert len(titles) == 6 and "Share" not in " ".join(titles)  # nothing sends data away
    page.set_viewport_size({"width": 390, "height": 844})
    until(page, "() => document.getElementById('diagram')._fullLayout.width < 390")
    assert page.evaluate("() => document.documentElement.scrollWidth") == 390
    assert page.errors == [] and all(
        url.startswith(("file:", "blob:", "data:")) for url in page.asked
    )


@pytest.mark.slow
def test_a_click_on_a_map(page, map_page):
    other = page.context.new_page()
    other.goto(map_page.as_uri())
    other.wait_for_selector("body[data-ready]", timeout=120_000)
    for place, words in (((1e-4, 50.0), "backward whirl"), ((2e-4, 50.0), "no result: not finite")):
        other.mouse.move(*pixel(other, *place))
        until(
            other,
            f"() => document.querySelector('#diagram .hoverlayer').textContent.includes('{words}')",
        )
        other.mouse.down()
        other.mouse.up()
        until(other, f"() => document.getElementById('told').textContent.includes('{words}')")
    assert "This page has no motions." in other.text_content("#told")
