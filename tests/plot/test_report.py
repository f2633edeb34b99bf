"""Reports: a self-contained file, parsed as by a browser, with nothing to fetch."""

import base64
import io
from html.parser import HTMLParser

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure
from systems import one_disc
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor.cli import app


PLAIN = one_disc(mass=2.0, damping=3.0, stiffness=800.0, speed=15.0, eccentricity=1e-3)
SCENE = jr.Scene(PLAIN.shaft, *PLAIN.effects, spin=PLAIN.spin, assumption="a guess & <more>")
ALONE = {"meta", "img", "br", "link", "input"}


class Page(HTMLParser):
    """Texts and images of a page, and whether its elements are closed in order."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.texts, self.images, self.tags, self.links = [], [], [], set(), []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        given = dict(attrs)
        self.links += [given[key] for key in ("src", "href", "srcset", "action") if key in given]
        if tag == "img":
            self.images.append(given)
        if tag not in ALONE:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)

    @property
    def text(self):
        return "\n".join(self.texts)

    def picture(self, number):
        kind, _, coded = self.images[number]["src"].partition(";base64,")
        assert kind == "data:image/png"
        return matplotlib.image.imread(io.BytesIO(base64.b64decode(coded, validate=True)))


@pytest.fixture(scope="module")
def swept():
    axes = {"unbalance.eccentricity": [0.0, 1e-3, 2e-3]}
    return jr.sweep(SCENE, axes, settle=1, keep=2, steps_per_revolution=16)


def test_report_of_a_sweep(swept, tmp_path):
    figure = Figure()
    ax = figure.subplots()
    ax.plot([0, 1], [0, 1])
    path = tmp_path / "report.html"
    jr.report(path, swept, figures=[ax])
    text = path.read_text("utf-8")
    page = Page(text)
    assert not page.tags & {"script", "link", "iframe", "object", "base", "form"}
    assert all(link.startswith("data:image/") for link in page.links)
    for outside in ("http:", "https:", "url(", "@import"):
        assert outside not in text
    assert [image["alt"] for image in page.images] == ["the rotor, to scale", "figure 1"]
    for number in range(2):
        assert np.ptp(page.picture(number)[..., :3]) > 0.5
    assert swept.attrs["scene"] in page.text and "a guess & <more>" in page.text
    status = swept["status"].values
    rows = page.text.split("\n")
    assert rows[rows.index("ok") + 1] == str((status == 0).sum())
    assert rows[rows.index("whirl undefined") + 1] == str((status == 2).sum())
    assert swept.attrs["versions"] in page.text
    assert f"{float(swept['radius_max'].max()):.7g}" in rows
    assert rows[rows.index("steps_per_revolution") + 1] == "16"


def test_report_of_a_motion_and_of_a_scene(tmp_path):
    motion = jr.simulate(SCENE, 2, 16, start=jr.AtRest(), at=0.5)
    path = tmp_path / "report.html"
    path.write_text("old")
    jr.report(path, motion, title="Run <7>")
    page = Page(path.read_text("utf-8"))
    assert page.texts[page.texts.index("Run <7>")] and "displacement" in page.text
    assert f"{float(motion.time[-1]):.7g}" in page.text
    jr.report(path, SCENE)
    assert len(Page(path.read_text("utf-8")).images) == 1
    assert [one.name for one in tmp_path.iterdir()] == [path.name]


def test_refusals(tmp_path):
    with pytest.raises(ValueError, match="must end in .html"):
        jr.report(tmp_path / "report.pdf", SCENE)
    with pytest.raises(ValueError, match="needs a result"):
        jr.report(tmp_path / "report.html")
    with pytest.raises(ValueError, match="A picture must end in"):
        jr.report(tmp_path / "report.html", figures=["a.txt"])
    with pytest.raises(ValueError, match="cannot be read"):
        jr.report(tmp_path / "report.html", figures=["none.png"])
    with pytest.raises(ValueError, match="figures or Axes, but one is 3"):
        jr.report(tmp_path / "report.html", figures=[3])
    with pytest.raises(ValueError, match="cannot be written"):
        jr.report(tmp_path / "none" / "report.html", SCENE)
    assert not list(tmp_path.iterdir())


def test_command(swept, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = lambda *args: CliRunner().invoke(app, ["report", *args])
    swept.to_zarr("run/sweep.zarr", zarr_format=2, consolidated=True)
    figure = Figure()
    figure.subplots().plot([0, 1], [0, 1])
    figure.savefig("run/b.png")
    done = run("run")
    assert done.exit_code == 0, done.stderr
    page = Page((tmp_path / "run" / "report.html").read_text("utf-8"))
    assert [image["alt"] for image in page.images] == ["the rotor, to scale", "b.png"]
    np.testing.assert_array_equal(page.picture(1), matplotlib.image.imread("run/b.png"))
    assert "add --overwrite" in run("run").stderr
    assert run("run", "--out", "r.html", "--title", "Mine").exit_code == 0
    assert "Mine" in Page((tmp_path / "r.html").read_text("utf-8")).texts
    (tmp_path / "empty").mkdir()
    assert "no data and no pictures" in run("empty").stderr
    assert "is not a folder" in run("nothing").stderr
