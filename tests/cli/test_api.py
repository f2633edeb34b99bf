"""`jaxrotor api`: criteria, files and refusals."""

import json

import pytest
from typer.testing import CliRunner

from jaxrotor.cli import app


ROTOR = """
title = "A disc on a stiff shaft"
[shaft]
model = "rigid"
length = 1.0
[disc]
at = 0.5
mass = 120
diametral = 6
polar = 3
[[support]]
at = 0
stiffness = "8 MN/m"
damping = DAMPING
[[support]]
at = 1
stiffness = "8 MN/m"
damping = DAMPING
[spin]
speed = "10000 rpm"
[machine]
name = "stiff rotor"
slowest = "9000 rpm"
fastest = "12000 rpm"
probes = [{at = 0}]
clearances = [{at = 0.5, diametral = "0.3 mm"}]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("api")
    for name, damping in (("smallest", "6e3"), ("largest", "3e3")):
        (place / f"{name}.toml").write_text(ROTOR.replace("DAMPING", damping), "utf-8")
    return place


def call(*args):
    return CliRunner().invoke(app, ["api", *map(str, args)])


def test_a_report_is_written_of_both_clearances(folder):
    files = folder / "smallest.toml", folder / "largest.toml"
    result = call(*files, "--out", folder / "run", "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert set(found["scenes"]) == {"smallest clearance", "largest clearance"}
    factors = [
        max(row["amplification"] for row in part["margins"]) for part in found["scenes"].values()
    ]
    assert factors[1] > 1.7 * factors[0]  # half the damping
    kept = json.loads((folder / "run" / "lateral.json").read_text("utf-8"))
    assert kept["criteria"] == found["criteria"]
    page = (folder / "run" / "lateral.html").read_text("utf-8")
    assert page.count("<figure>") == page.count("Figure ") // 2 > 10  # in captions and in `alt`
    for part in ("Table 1: ", "Lateral analysis: stiff rotor", "SP6.8.2.10", "smallest clearance"):
        assert part in page
    assert (folder / "run" / "lateral.pdf").read_bytes().startswith(b"%PDF-")


def test_words_where_there_is_no_machine(folder):
    bare = folder / "bare.toml"
    bare.write_text(ROTOR.partition("[machine]")[0].replace("DAMPING", "1e3"), "utf-8")
    result = call(bare)
    assert result.exit_code == 2
    assert "has no [machine]" in " ".join(result.stderr.split())
