"""Commands `show` and `roots` of scenes that are linear about a static position, or not at all."""

import json

import pytest
from typer.testing import CliRunner

from jaxrotor.cli import app


def run(*words):
    result = CliRunner().invoke(app, list(map(str, words)))
    assert result.exit_code == 0, result.output
    return result.stdout


def test_roots_are_those_about_the_static_position():
    """A seal without weight at 1000 rad/s, by roots of another program."""
    found = json.loads(run("roots", "seal-whirl", "--speed", "1000", "--json"))["roots"]
    roots = [complex(one["root"]["re"], one["root"]["im"]) for one in found]
    wanted = [-78.676038441 - 203.199301792j, -0.735726265 + 311.434595910j]
    assert roots == pytest.approx(wanted, abs=1e-8)


def test_show_tells_what_it_can():
    found = json.loads(run("show", "seal-whirl", "--json"))
    assert found["whirl_frequencies"]["forward"] and found["critical_speeds"] is None
    assert "about a static position" in found["no_critical_speeds"]
    cracked = run("show", "cracked-rotor")
    assert "crack.loss" in cracked and "breathe as the shaft turns" in " ".join(cracked.split())
