"""Axes of the pictures of commands: in the units in which the numbers of a scene were typed."""

import re

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.cli import app
from jaxrotor.cli.axis_units import axis_units, written_in
from jaxrotor.files.toml import texts
from jaxrotor.plot.units import length_unit, speed_unit


MICRO = "\N{MICRO SIGN}m"
TEXT = """
title = "2 m of shaft, 9 krpm"
[shaft]
model = "rigid"
length = "0.5 m"
[[support]]
at = "0 m"
kxx = "1e6 N/m"
kyy = "1e6 N/m"
[[support]]
at = "0.5 m"
kxx = "1e6 N/m"
kyy = "1e6 N/m"
[disc]
at = "0.2 m"
mass = "10 kg"
radius = "100 mm"
[unbalance]
at = "0.2 m"
eccentricity = "20 um"
mass = "10 kg"
[[limiter]]
at = "0.2 m"
angles = ["0 deg"]
gap = "0.2 mm"
stiffness = "1e6 N/m"
[spin]
speed = "3000 rpm"
"""


@pytest.fixture
def typed(tmp_path, monkeypatch):
    """Path of a scene file; lengths of both kinds are typed in it, gaps twice."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "typed.toml"
    path.write_text(TEXT + '[sweep.start]\nradius = "0.1 mm"\n', "utf-8")
    return str(path)


@pytest.mark.parametrize(
    "options, speed, length",
    [
        ([], "rpm", "mm"),
        ([None, "9000", "disc.mass=3kg", "disc.at=0.3m"], "rpm", "mm"),  # no unit of an axis
        (["500 rad/s", "8rpm"], "rad/s", "mm"),
        (["3krpm:4krpm"], "krpm", "mm"),
        (["0:50 hz:11"], "Hz", "mm"),
        (["limiters.gap=10um:30um:3"], "rpm", MICRO),
        (["unbalance.eccentricity=1e-5m,2e-5m"], "rpm", "m"),
        (["unbalance.eccentricity=20 \N{GREEK SMALL LETTER MU}m"], "rpm", MICRO),
    ],
)
def test_an_option_comes_before_the_file(typed, options, speed, length):
    found = axis_units(typed, jr.load(typed), *options)
    assert found == {"speed": speed, "length": length}


def test_numbers_without_a_unit_choose_none(tmp_path):
    path = tmp_path / "plain.toml"
    jr.save(
        jr.Scene(jr.RigidShaft(0.7), jr.Disc(0.2, 10.0, 0.1, 0.1), spin=jr.ConstantSpeed(5.0)), path
    )
    assert axis_units(str(path), jr.load(path)) == {"speed": "rad/s", "length": None}


def test_texts_of_a_file_are_its_values(typed):
    found = texts(typed)
    assert found[:2] == ["rigid", "0.5 m"] and found[-2:] == ["3000 rpm", "0.1 mm"]
    assert "0 deg" in found and not any("shaft" in one for one in found)


@pytest.fixture
def labels(monkeypatch):
    """Axis labels of the pictures that commands write, by file name."""
    found = {}

    def write(path, draw, width, height, rows=1):
        axes = Figure().subplots(rows)
        draw(axes)
        every = axes.ravel() if rows > 1 else [axes]
        found[path.name] = " ".join(f"{ax.get_xlabel()} {ax.get_ylabel()}" for ax in every)
        path.write_bytes(b"")

    monkeypatch.setattr(plot, "write", write)
    return found


def call(*args):
    result = CliRunner().invoke(app, [str(a) for a in args])
    assert result.exit_code == 0, (result.stdout, result.stderr, result.exception)
    return result.stdout


def test_numbers_of_tables_as_typed(typed):
    """Speeds and gaps are; stations are lengths of the shaft, in m."""
    rotor = jr.load(typed)
    chosen = axis_units(typed, rotor)
    said = lambda unit, value: (lambda found: (found[0] * value, found[1]))(
        written_in(chosen, unit, value, rotor)
    )
    assert said("rad/s", 100 * np.pi) == (pytest.approx(3000.0), "rpm")
    assert said("m", 2e-4) == (pytest.approx(0.2), "mm")
    assert said("m", 0.5) == (0.5, "m") and said("N/m", 1e6) == (1e6, "N/m")
    assert written_in(chosen, "m", [], rotor) == (1e3, "mm")


@pytest.mark.slow
def test_commands_print_as_typed(typed, tmp_path):
    """`show`, `simulate` and the report of its run."""
    shown = " ".join(call("show", typed).split())
    assert "spin.speed 3000 rpm" in shown and "limiter.gap 0.2 mm" in shown
    assert "disc.at 0.2 m" in shown and "standstill" in shown
    run = ["simulate", typed, "--revolutions", 4, "--keep", 2, "--steps", 64, "--out", "run"]
    assert re.search(r"radius +\S+ to \S+ mm", call(*run))
    call("report", "run")
    page = (tmp_path / "run" / "report.html").read_text("utf-8")
    text = " ".join(re.sub("<[^>]+>", " ", page).split())
    assert (
        "spin.speed 3000 rpm" in text and "limiter.gap 0.2 mm" in text and "disc.at 0.2 m" in text
    )


@pytest.mark.slow
def test_a_response_as_typed(typed, labels):
    """The amplitude is some micrometres; it is in mm, as the gap is."""
    call("response", typed, "--points", 9, "--out", "a")
    assert "amplitude [mm]" in labels["response.png"] and "[rpm]" in labels["response.png"]


@pytest.mark.slow
def test_a_sweep_is_explored_as_typed(typed, labels, tmp_path, monkeypatch):
    swept = ("limiters.gap=10um:30um:2", "--settle", 2, "--keep", 2, "--steps", 32, "--out", "rub")
    call("sweep", typed, "--over", *swept)
    assert labels["bifurcation.png"].count(f"[{MICRO}]") == 2
    assert "length_unit" in xr.open_zarr("rub/sweep.zarr").attrs
    seen = []
    page = lambda *_, **__: seen.append((length_unit("mm")[1], speed_unit()[1]))
    monkeypatch.setattr("jaxrotor.plot.clickable.write_page", page)
    call("explore", "rub", "--html", "rub.html", "--motions", 0)
    assert seen == [(MICRO, "rpm")]
