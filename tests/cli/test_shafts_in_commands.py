"""Several shafts on the command line: numbers of the continuous beams, `--by`, `--at`, and refusals."""

import json

import numpy as np
import pytest
import shafts_of_tests
from typer.testing import CliRunner

from jaxrotor.cli import app


RATIOS = {"dual-rotor": 1.3, "counter-rotor": -1.2}
ROOTS = {name: shafts_of_tests.ROOTS[ratio, False] for name, ratio in RATIOS.items()}
CRITICAL = {
    (name, by): np.abs(shafts_of_tests.CRITICAL[ratio, None, by])
    for name, ratio in RATIOS.items()
    for by in ("lp", "hp")
}


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def call(*args, code=0):
    result = CliRunner().invoke(app, [*args])
    assert result.exit_code == code, (result.stdout, result.stderr, result.exception)
    return result


def answered(*args):
    return json.loads(call(*args, "--json").stdout)


def refused(*args):
    (line,) = call(*args, code=2).stderr.strip().splitlines()
    assert line.endswith(".")
    return line


@pytest.mark.slow  # compiles eigenvalues with their vectors
def test_roots_are_those_of_the_continuous_beams():
    for name, expected in ROOTS.items():
        found = answered("roots", name, "--count", "6")["roots"]
        values = [complex(one["root"]["re"], one["root"]["im"]) for one in found]
        np.testing.assert_allclose(values, expected, rtol=2e-9)


def test_critical_speeds_are_by_each_shaft_with_all_speeds():
    for (name, by), expected in CRITICAL.items():
        found = answered("critical", name, "--by", by)
        assert found["by"] == by
        sense = -1 if by == "hp" and RATIOS[name] < 0 else 1
        speeds = [one["speed"] for one in found["forward"]]
        np.testing.assert_allclose(speeds, sense * np.array(expected), rtol=2e-9)
        for one in (*found["forward"], *found["backward"]):
            own = one["shaft_speeds"]
            assert own[by] == pytest.approx(one["speed"], rel=1e-14)
            assert own["hp"] == pytest.approx(RATIOS[name] * own["lp"], rel=1e-14)
    assert answered("critical", "dual-rotor")["by"] == "lp"
    text = call("critical", "dual-rotor", "--by", "hp").stdout
    assert "lp [rad/s]" in text and "114.1" not in text and "66.8887356" in text


@pytest.mark.slow  # compiles two further searches
def test_a_speed_of_its_own_gives_speeds_of_the_first_shaft():
    """hp at 700 rad/s whatever lp does; by hp at 250 rad/s its unbalance meets lp at 740.5 rad/s."""
    own = "--set", "shafts.hp.ratio=0", "--set"
    found = answered("critical", "dual-rotor", *own, "shafts.hp.speed=700")
    speeds = [one["speed"] for one in found["forward"]]
    np.testing.assert_allclose(speeds[:3], [98.50169884, 250.5804988, 423.0876728], rtol=2e-9)
    assert {one["shaft_speeds"]["hp"] for one in found["forward"]} == {700.0}
    found = answered("critical", "dual-rotor", *own, "shafts.hp.speed=250", "--by", "hp")
    meets = [one["shaft_speeds"]["lp"] for kind in ("forward", "backward") for one in found[kind]]
    # Where hp has a speed of its own, errors of the frequency are enlarged a hundred times.
    assert min(abs(x - 740.538591) for x in meets) < 2e-4


@pytest.mark.slow  # growth at every speed
def test_response_by_a_shaft_at_a_station_of_another():
    """By hp at lp .2705 m, at 200 and 400 rad/s of lp, in um (sheet 10, section 3)."""
    run = "response", "dual-rotor", "--by", "hp", "--to", "450", "--points", "31"
    found = answered(*run, "--at", "lp 0.2705 m", "--operating", "200:400")
    assert (found["by"], found["shaft"], found["station"]) == ("hp", "lp", 0.2705)
    expected = np.array([541.716566 + 114.871277j, -11.7495271 - 3.55867578j]) * 1e-6
    values = [one["amplitude"] * np.exp(1j * one["phase"]) for one in found["at_operating"]]
    np.testing.assert_allclose(values, expected, rtol=2e-7)
    first = np.array(CRITICAL["dual-rotor", "hp"][:3]) / 1.3
    np.testing.assert_allclose([one["speed"] for one in found["critical"]], first, rtol=2e-9)
    np.testing.assert_allclose([one["speed"] for one in found["peaks"]], first, rtol=5e-3)


def test_refusals_say_what_to_type():
    few = "--points", "3", "--to", "100"
    text = refused("response", "dual-rotor", "--at", "0.3 m", *few)
    assert text == "--at must name its shaft, 'lp' or 'hp', as in \"lp 0.3 m\", but is '0.3 m'."
    text = refused("response", "dual-rotor", "--at", "hp 0.2 m", *few)
    assert "must be on the shaft (0.3 to 0.682)" in text
    assert "its shafts are lp, hp" in refused("critical", "dual-rotor", "--by", "ip")
    assert "it has one shaft" in refused("critical", "two-discs", "--by", "hp")
    bare = "--set", "unbalances.2.eccentricity=0", "--set", "unbalances.3.eccentricity=0"
    text = refused("response", "dual-rotor", "--by", "hp", *few, *bare)
    assert "give the shaft 'hp' an unbalance" in text and 'at = "hp 0.4505 m"' in text


@pytest.mark.slow  # all questions of `show`
def test_show_has_the_speeds_of_both_shafts():
    text = " ".join(call("show", "counter-rotor").stdout.split())
    assert "speed of lp 250 rad/s speed of hp -300 rad/s" in text
    assert "critical by lp, forward 83.54743, 244.3592, 402.7316 rad/s" in text
    assert "critical by hp, forward -84.93598, -245.9083, -413.733 rad/s" in text
    assert call("show", "counter-rotor", "--toml").stdout.startswith("# The rotor of `dual-rotor`")


def test_steel_is_taken_where_a_table_names_none(tmp_path):
    call("new", "my.toml", "--like", "dual-rotor")
    text = (tmp_path / "my.toml").read_text()
    line = next(one for one in text.splitlines() if one.startswith("material"))
    (tmp_path / "my.toml").write_text(text.replace(line, "", 1))
    from jaxrotor.cli.show import _material_taken

    assert _material_taken("my.toml") == "steel" and _material_taken("dual-rotor") is None
