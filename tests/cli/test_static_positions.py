"""Commands of scenes that are linear about a static position, or not at all."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from jaxrotor.cli import app


def run(*words):
    result = CliRunner().invoke(app, list(map(str, words)))
    assert result.exit_code == 0, result.output
    return result.stdout


# The seal of shared/spec/11-elements.md, section 4, in a rotor without weight, and the unbalance.
M, K, C, K0, D, TAU, MF, ECCENTRICITY = 30.0, 2.4e6, 900.0, 6e5, 1800.0, 0.46, 4.0, 20e-6


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
    bearings = " ".join(run("show", "rolling-bearing").split())
    assert "nothing holds it" not in bearings
    for command in ("campbell", "critical"):
        assert f"{command} rolling-bearing" in bearings
    magnetic = " ".join(run("show", "magnetic-rotor").split())
    assert "campbell magnetic-rotor" in magnetic and "critical magnetic-rotor" not in magnetic
    cracked = run("show", "cracked-rotor")
    assert "crack.loss" in cracked and "breathe as the shaft turns" in " ".join(cracked.split())


def test_critical_speeds_have_the_stiffness_at_each_speed():
    """`K + K0 - m_f (tau Omega)^2 = (M + m_f) Omega^2`, either way; none in magnets, which damp all."""
    found = json.loads(run("critical", "seal-whirl", "--json"))
    wanted = ((K + K0) / (M + MF + MF * TAU**2)) ** 0.5
    for kind in ("forward", "backward"):
        (one,) = found[kind]
        assert one["speed"] == pytest.approx(wanted, rel=1e-6)  # between nodes
    ended = run("critical", "seal-whirl")
    assert "2787.5 rad/s" in ended and "raise `spin.speed`" in ended
    refused = CliRunner().invoke(app, ["critical", "magnetic-rotor"])
    assert refused.exit_code and "jaxrotor campbell magnetic-rotor" in refused.output
    assert "(magnetic_bearings.0, magnetic_bearings.1)" in " ".join(refused.output.split())
    refused = CliRunner().invoke(app, ["critical", "seal-whirl", "--set", "spin.speed=0"])
    assert refused.exit_code and "--set spin.speed=3000rpm" in refused.output
    refused = CliRunner().invoke(app, ["campbell", "seal-whirl", "--from", "0", "--to", "0"])
    assert refused.exit_code and "both are 0 rad/s" in refused.output


@pytest.mark.slow
def test_campbell_has_the_static_position_of_each_speed():
    ends = "--from", 1000, "--to", 500, "--points", 3
    found = json.loads(run("campbell", "seal-whirl", *ends, "--json"))
    growth = {one["direction"]: one["growth"][0] for one in found["branches"]}
    assert growth["forward"] == pytest.approx(-0.735726265, abs=1e-7)
    assert growth["backward"] == pytest.approx(-78.676038441, abs=1e-7)
    mean = json.loads(run("campbell", "rolling-bearing", "--to", 400, "--points", 3, "--json"))
    same = json.loads(run("roots", "rolling-bearing", "--speed", 400, "--count", 1, "--json"))
    assert mean["branches"][0]["frequency"][-1] == pytest.approx(same["roots"][0]["frequency"])


@pytest.mark.slow
def test_response_has_the_bearings_about_their_static_positions():
    """By equation (9) of the sheet, at the operating speed; it was that of a rotor without the seal."""
    found = json.loads(run("response", "seal-whirl", "--points", 41, "--json"))
    (running,) = found["at_operating"]
    w = running["speed"]
    back = K + K0 - (M + MF * (1 - TAU) ** 2) * w**2 + 1j * w * (C + (1 - TAU) * D)
    z = M * ECCENTRICITY * w**2 / back
    assert running["amplitude"] == pytest.approx(abs(z), rel=1e-9)
    assert running["phase"] == pytest.approx(np.angle(z), abs=1e-9)
    assert found["without"] == []
    magnets = json.loads(run("response", "magnetic-rotor", "--points", 41, "--json"))
    assert magnets["peaks"][0]["amplitude"] > 0 and magnets["critical"] == []
