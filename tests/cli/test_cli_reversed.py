"""Commands on a scene that turns backward: speeds in its sense, and pictures that name it."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.cli import app
from jaxrotor.files.toml import dumps


NATURAL = np.sqrt(1e5 / 4.0)  # 4 kg on 1e5 N/m
ONSET = NATURAL * (1 + 30.0 / 12.0)  # damping c = 30 N s/m, that turns 12 N s/m


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rotor = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e5),
        jr.Disc(0.5, 4.0),
        jr.DiscDamping(0.5, 30.0),
        jr.InternalDamping(12e-5),
        jr.Unbalance(0.5, 4.0, 1e-5),
        spin=jr.ConstantSpeed(-100.0),
    )
    (tmp_path / "back.toml").write_text(dumps(rotor, "backward"))
    return rotor


def answered(*args):
    result = CliRunner().invoke(app, [*args, "--json"])
    assert result.exit_code == 0, (result.stdout, result.stderr)
    return json.loads(result.stdout)


@pytest.mark.slow
def test_commands_take_the_sense_of_the_scene(scene):
    (whirl,) = answered("critical", "back.toml")["forward"]
    assert whirl["speed"] == pytest.approx(-NATURAL, rel=1e-10)
    found = answered("response", "back.toml", "--points", "60")
    (peak,) = found["peaks"]
    c = 30.0  # damping that turns does not act in a circle with the spin
    frequency = NATURAL / np.sqrt(1 - c**2 / (2 * 4.0 * 1e5))
    size = lambda w: 4e-5 * w**2 / abs(1e5 - 4 * w**2 + 1j * c * w)
    assert peak["speed"] == pytest.approx(-frequency, rel=1e-8)
    assert peak["amplitude"] == pytest.approx(size(frequency), rel=1e-8)
    assert found["operating"] == [-100.0, -100.0]
    (margin,) = found["margins"]
    assert margin["margin"] == pytest.approx(frequency / 100.0 - 1, rel=1e-8)
    whirl = answered("onset", "back.toml")
    assert whirl["speed"] == pytest.approx(-ONSET, rel=1e-9) and whirl["kind"] == "forward"
    assert answered("onset", "back.toml", "--to", "-9000rpm") == pytest.approx(whirl)
    speeds = answered("campbell", "back.toml", "--points", "5")["speeds"]
    assert speeds[0] == 0 and speeds == sorted(speeds, reverse=True)
    branches = answered(
        "campbell", "back.toml", "--from=-9000rpm", "--to", "9000rpm", "--points", "5"
    )
    assert {one["direction"] for one in branches["branches"]} == {"from x to y", "from y to x"}
    over = "spin.speed={}rpm:{}rpm:41"
    found = answered("stability", "back.toml", "--over", over.format(-9000, 9000))["changes"]
    assert [one["becomes"] for one in found] == ["stable", "unstable"]
    np.testing.assert_allclose([one["value"] for one in found], [-ONSET, ONSET], rtol=1e-8)
    (found,) = answered("stability", "back.toml", "--over", over.format(0, -9000))["changes"]
    assert found["becomes"] == "unstable" and found["value"] == pytest.approx(-ONSET, rel=1e-8)


@pytest.mark.slow
def test_pictures_name_the_sense(scene):
    speeds = np.linspace(0.0, -300.0, 21)
    upper, lower = plot.response(jr.unbalance_response(scene, speeds))
    assert lower.get_xlabel() == "spin speed [rad/s], negative sense"
    diagram = jr.campbell(scene, speeds)
    _, lower = plot.campbell(diagram, critical=jr.critical_speeds(scene))
    assert lower.get_xlabel() == "spin speed [rad/s], negative sense"
    np.testing.assert_array_equal(np.sign(diagram.frequencies[0]), -diagram.forward[0])
    np.testing.assert_array_equal(diagram.forward[0], diagram.forward[-1])
    _, lower = plot.campbell(jr.campbell(scene, speeds[::-1] + 100.0))
    assert lower.get_xlabel() == "spin speed [rad/s], both senses"
