"""The table of the machine in a scene file."""

import numpy as np
import pytest

import jaxrotor as jr


HEAD = "[shaft]\nlength = 1.0\ndiameter = 0.05\n[spin]\nspeed = 100.0\n"
MACHINE = """
[machine]
slowest = "3000 rpm"
fastest = 400
couplings = ["10 mm"]
probes = [{at = "0.2 m", name = "left"}]
clearances = [{at = 0.5, diametral = "0.4 mm"}]
stages = [{power = "100 kW", diameter = "40 cm", width = "20 mm", density_ratio = 1.2, at = 0.5}]
"""


def written(tmp_path, text):
    file = tmp_path / "rotor.toml"
    file.write_text(text, "utf-8")
    return file


def test_a_machine_is_read_with_its_units(tmp_path):
    found = jr.machine(written(tmp_path, HEAD + MACHINE))
    assert float(found.slowest) == pytest.approx(100 * np.pi)
    assert (float(found.fastest), found.highest) == (400.0, pytest.approx(420.0))
    assert np.asarray(found.couplings).tolist() == [0.01]
    (probe,), (clearance,), (stage,) = found.probes, found.clearances, found.stages
    assert (probe.name, float(probe.at)) == ("left", 0.2)
    assert (clearance.label, float(clearance.diametral)) == ("clearance at 0.5 m", 4e-4)
    assert (stage.kind, float(stage.power), float(stage.width)) == ("centrifugal", 1e5, 0.02)


def test_stages_have_their_power_at_the_rated_speed():
    """1 MW at 400 rad/s are 2500 N m; times 1.5 / (0.5 m 0.1 m)."""
    stage = jr.Stage(1e6, 0.5, 0.1, kind="axial")
    rated = jr.Machine(300.0, 500.0, rated=400.0, stages=[stage])
    assert rated.anticipated == pytest.approx(75_000.0)
    fastest = jr.Machine(300.0, 500.0, stages=[stage])
    assert fastest.rated_speed == 500.0
    assert fastest.anticipated == pytest.approx(60_000.0)


def test_a_scene_beside_a_machine_is_what_it_is_without(tmp_path):
    with_machine = jr.load(written(tmp_path, HEAD + MACHINE))
    assert repr(with_machine) == repr(jr.load(written(tmp_path, HEAD)))


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (MACHINE, "", r"has no \[machine\]; a lateral analysis needs"),
        ("[machine]", "[machine]\nspeed = 3", r"machine.speed"),
        ('"3000 rpm"', '"3000 mm"', r"machine.slowest.*must be in rad/s"),
        ("fastest = 400", "", r"machine.*fastest"),
        ("fastest = 400", "fastest = 200", r"must be in this order"),
        ("fastest = 400", "fastest = 400\nrated = 410", r"`rated .* but is 3915.2 rpm"),
        ("probes = [", "probes = [3, ", r"machine.probes.0"),
        ("density_ratio = 1.2", "kind = 'screw'", r"machine.stages.0.kind"),
        ("density_ratio = 1.2, ", "", r"needs `density_ratio"),
        ("[machine]", "[machine", r"is not valid TOML"),
    ],
)
def test_words_for_a_wrong_machine(tmp_path, old, new, text):
    whole = HEAD + MACHINE
    assert old in whole
    with pytest.raises(ValueError, match=text):
        jr.machine(written(tmp_path, whole.replace(old, new)))
