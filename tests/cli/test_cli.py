"""Command line: the numbers it prints, the files it writes, and one sentence for every mistake."""

import importlib
import json
import os
import re
import signal
import subprocess
import sys
import time
import types
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.cli import app, main, run_up
from jaxrotor.core.plain import plain


LENGTH, TIME, SPEED = 0.7, 0.022646559709295068, 662.3522597934992  # l, T*, N = 15
SMALL = ["--over", "unbalance.eccentricity=0:1e-3:4", "--settle", "5", "--keep", "5"]
SMALL += ["--steps", "64"]


def call(*args, code=0):
    result = CliRunner().invoke(app, [str(a) for a in args])
    assert result.exit_code == code, (result.stdout, result.stderr, result.exception)
    return result


def answered(*args):
    """JSON answer of a command; raises for NaN and Infinity, which are not JSON."""
    result = call(*args, "--json")
    assert not result.stderr
    return json.loads(result.stdout, parse_constant=lambda text: pytest.fail(text))


def refused(*args):
    result = call(*args, code=2)
    assert not result.stdout
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1 and lines[0].endswith("."), result.stderr
    return lines[0]


def everything_below(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


# === show and roots


def test_scenes():
    assert answered("scenes")["scenes"] == [{"name": n, "title": t} for n, t in jr.shipped()]
    assert "limiter-rotor-2023" in call("scenes").stdout


@pytest.fixture
def quick_onset(monkeypatch):
    """Replace the onset search, to save its compilation; `test_onset` runs the true one."""
    module = importlib.import_module("jaxrotor.cli.show")
    monkeypatch.setattr(module, "onset_speed", lambda scene: jr.Onset(600.0, 76.0))
    return monkeypatch, module


def test_show(quick_onset):
    shown = answered("show", "limiter-rotor", "--set", "disc.mass=3kg")
    assert shown["parameters"]["disc.mass"] == {"value": 3.0, "unit": "kg"}
    assert shown["parameters"]["limiters.angle"]["value"] == pytest.approx(
        [np.pi / 3, np.pi, 5 * np.pi / 3]
    )
    assert shown["parameters"]["limiters.blend"] == {"value": None, "unit": "m"}
    assert shown["coordinates"] == 8 and shown["onset"]["speed"] == 600.0
    assert shown["nodes"] == [8]
    text = call("show", "limiter-rotor").stdout
    assert "8 (shaft.nodes = auto)" in text
    assert "unbalance.eccentricity" in text and "at 600 rad/s" in text
    (angles,) = [line.split() for line in text.splitlines() if "limiters.angle" in line]
    assert angles[1:] == ["60,", "180,", "300", "deg"]  # as they were typed
    found = answered("show", "limiter-rotor")
    critical, whirl = found["critical_speeds"], found["whirl_frequencies"]
    for way, speeds in critical.items():
        for speed in speeds:  # the spin equals a whirl frequency of the undamped rotor
            still = {"external_damping.per_length": 0.0, "internal_damping.voigt_time": 0.0}
            still |= {"disc_damping.translational": 0.0, "disc_damping.angular": 0.0}
            met = jr.roots(jr.load("limiter-rotor").replace(still | {"spin.speed": speed}))
            sense = 1 if way == "forward" else -1
            assert np.abs(np.asarray(met).imag - sense * speed).min() < 1e-6 * speed
    assert whirl["standstill"][0] == pytest.approx(1.59636651 / TIME, rel=1e-7)
    assert whirl["forward"][0] == pytest.approx(1.74308955 / TIME, rel=1e-7)
    assert whirl["backward"][0] == pytest.approx(1.45302933 / TIME, rel=1e-7)


def test_nodes_are_set_like_a_parameter():
    for given in ("4", "auto", "8"):
        shown = answered("roots", "limiter-rotor", "--count", 1, "--set", f"shaft.nodes={given}")
        value = shown["roots"][0]["root"]
        scene = jr.load("limiter-rotor").replace(
            {"shaft.nodes": given if given == "auto" else int(given)}
        )
        own = complex(jr.roots(scene, 1)[0])
        assert complex(value["re"], value["im"]) == pytest.approx(own, rel=1e-9)


def test_show_toml_is_a_scene_to_start_from(quick_onset, place):
    text = call("show", "limiter-rotor", "--toml").stdout
    (place / "own.toml").write_text(text)
    assert "#" in text and jr.load("own.toml") == jr.load("limiter-rotor")
    heavier = call("show", "limiter-rotor", "--set", "disc.mass=3kg", "--toml").stdout
    assert float(jr.loads(heavier).get("disc.mass")) == 3.0


def test_show_says_that_a_rotor_is_free_and_of_what_it_is(quick_onset, place):
    shaft = '[shaft]\nlength = "1 m"\ndiameter = "50 mm"\n'
    parts = '[disc]\nat = "0.5 m"\nmass = "10 kg"\n[spin]\nspeed = "1000 rpm"\n'
    (place / "free.toml").write_text(shaft + parts)
    found = answered("show", "free.toml")
    assert found["free"] == "nothing holds it" and found["material_taken"] == "steel"
    assert answered("critical", "free.toml", "--count", 3)["free"] == found["free"]
    text = " ".join(call("show", "free.toml").stdout.split())
    assert "held free: nothing holds it; give the shaft `constraints`" in text
    assert "material steel, since the file names none" in text


def test_show_says_why_there_is_no_onset(quick_onset):
    monkeypatch, module = quick_onset

    def none(scene):
        raise ValueError("The rotor has no damping; search by `within`.")

    monkeypatch.setattr(module, "onset_speed", none)
    shown = answered("show", "limiter-rotor")
    assert shown["onset"] is None and shown["no_onset"] == "The rotor has no damping"
    text = call("show", "limiter-rotor").stdout
    assert "no damping" in text and "within" not in text


def test_roots():
    shown = answered("roots", "limiter-rotor", "--count", "2")
    values = [complex(r["root"]["re"], r["root"]["im"]) * TIME for r in shown["roots"]]
    assert values == pytest.approx([-0.23335496 - 1.45302933j, 0.00912266 + 1.74308955j], abs=2e-8)
    assert [r["direction"] for r in shown["roots"]] == ["backward", "forward"]
    assert [r["stability"] for r in shown["roots"]] == ["stable", "unstable"]
    one = shown["roots"][0]
    assert one["frequency_hz"] == pytest.approx(1.45302933 / TIME / (2 * np.pi), rel=1e-7)
    assert one["damping_ratio"] == pytest.approx(0.23335496 / abs(values[0]), rel=1e-7)
    decay = np.log(np.exp(0.23335496 * 2 * np.pi / 1.45302933))  # of the amplitude in one whirl
    assert one["log_decrement"] == pytest.approx(decay, rel=1e-7)


def test_speed_takes_units():
    rpm = 20 / TIME * 30 / np.pi  # N = 20
    for given in (["--speed", f"{rpm!r} rpm"], ["--set", f"spin.speed={20 / TIME!r}"]):
        shown = answered("roots", "limiter-rotor", "--count", "2", *given)
        forward = [r["root"] for r in shown["roots"] if r["direction"] == "forward"][0]
        assert forward["re"] * TIME == pytest.approx(0.05094682, abs=2e-8)
        assert forward["im"] * TIME == pytest.approx(1.79197492, abs=2e-8)
    assert "unstable" in call("roots", "limiter-rotor", *given).stdout


def test_onset():
    shown = answered("onset", "limiter-rotor", "--from", "100", "--to", "8000rpm")
    assert shown["speed"] * TIME == pytest.approx(13.9041252, rel=1e-7)
    assert shown["whirl_frequency"] * TIME == pytest.approx(1.7323570, rel=1e-7)
    assert shown["rpm"] == pytest.approx(shown["speed"] * 30 / np.pi)
    assert "613.9619" in call("onset", "limiter-rotor", "--from", "100", "--to", "8000rpm").stdout
    assert "stability" in refused("onset", "limiter-rotor", "--from", "1", "--to", "100")


# === frequencies against speed


def gyroscopic():
    """The gyroscopic rotor of spec 3, set CAN."""
    shaft = jr.MasslessShaft(0.645, 0.16125, 11.51e4, -9.28e3, 1.00e3)
    disc = jr.Disc(0.16125, 2.62, 86e-4, 2.38e-4)
    spin = jr.ConstantSpeed(100.0)
    jr.save(jr.Scene(shaft, disc, jr.HystereticDamping(0.029), spin=spin), "can.toml")
    return "can.toml"


def test_campbell(place):
    run = ["campbell", gyroscopic(), "--from", 240.800121421, "--to", 389.529692329]
    shown = answered(*run, "--points", 5, "--mirrored", "--twice", "--out", "run")
    assert shown["frame"] == "fixed" and len(shown["speeds"]) == 5
    at_end = {
        (one["direction"], round(one["frequency"][-1])): (one["frequency"][-1], one["growth"][-1])
        for one in shown["branches"]
    }
    assert at_end == {  # spec 3, table 3.4
        ("forward", 93): pytest.approx((93.416720969, 1.334848603), abs=1e-8),
        ("forward", 394): pytest.approx((393.677368664, -5.646849586), abs=1e-8),
        ("backward", 91): pytest.approx((90.749146939, -1.334838339), abs=1e-8),
        ("backward", 386): pytest.approx((385.564934930, -5.646859850), abs=1e-8),
    }
    slow = next(one for one in shown["branches"] if round(one["frequency"][0]) == 93)
    assert slow["frequency"][0] == pytest.approx(92.905851899, abs=1e-8)
    names = ["campbell.png", "campbell.zarr"]
    assert sorted(os.listdir("run")) == names
    assert sorted(shown["written"]) == [os.path.join("run", name) for name in names]
    with xr.open_zarr("run/campbell.zarr") as data:
        assert data.attrs["frame"] == "fixed" and data.frequency.attrs["units"] == "rad/s"
        assert data.speed.values.tolist() == shown["speeds"]
        signed = data.frequency.values.T  # backward whirl is negative
        for found, one in zip(signed, shown["branches"], strict=True):
            sign = 1 if one["direction"] == "forward" else -1
            assert found.tolist() == [sign * f for f in one["frequency"]]
        assert data.growth.values[:, 0].tolist() == shown["branches"][0]["growth"]
        assert float(jr.loads(data.attrs["scene"]).shaft.k11) == 11.51e4
    assert "--overwrite" in refused(*run, "--out", "run")
    text = call(*run, "--count", 1).stdout
    assert "91.2567" in text and "90.7491" in text and "forward" not in text


def test_campbell_ends_beyond_the_running_speed():
    """The critical speeds of forward whirl are 92.387 and 393.681 rad/s."""
    shown = answered("campbell", gyroscopic(), "--points", 3)
    assert shown["speeds"][0] == 0 and shown["written"] == []
    assert shown["speeds"][-1] == 250.0
    ends = {800: 2000.0, 20: 1.25 * 92.387084740, 0: 1.25 * 393.680758289}
    for speed, end in ends.items():
        shown = answered("campbell", "can.toml", "--points", 3, "--set", f"spin.speed={speed}")
        assert shown["speeds"][-1] == pytest.approx(end)


def test_campbell_says_what_faster_branch_is_damped_less(place):
    """Two masses on springs, the stiffer one without damper: 100 rad/s, D = 0.1, and 300 rad/s, D = 0."""
    text = """
        [shaft]
        length = 1.0
        model = "rigid"
        [[support]]
        at = 0.0
        stiffness = 1e4
        damping = 20.0
        [[support]]
        at = 1.0
        stiffness = 9e4
        [[disc]]
        at = 0.0
        mass = 1.0
        [[disc]]
        at = 1.0
        mass = 1.0
        [spin]
        speed = 50.0
    """
    (place / "two.toml").write_text(text)
    run = ["campbell", "two.toml", "--to", 100, "--points", 3]
    whole, part = call(*run).stdout, call(*run, "--count", 2).stdout
    assert "left out" not in whole
    assert "faster whirl that nothing damps, at 0 rad/s; --count" in " ".join(part.split())
    shown = answered(*run, "--count", 2)
    assert shown["largest_growth"] == pytest.approx([0.0] * 3, abs=1e-9)
    assert shown["branches"][0]["growth"] == pytest.approx([-10.0] * 3)
    overdamped = [*run, "--set", "supports.0.damping=400"]  # beyond twice 100 N s/m
    ways = [one["direction"] for one in answered(*overdamped)["branches"]]
    assert sorted(ways) == ["backward", "forward", "no whirl", "no whirl"]


def test_campbell_in_the_axes_of_the_shaft():
    """A disc with `w^2 = k / m`, 10 % more and less along two axes; unstable between critical speeds."""
    shaft = jr.MasslessShaft(0.6, 0.3, 1e5, anisotropy=0.1)
    jr.save(jr.Scene(shaft, jr.Disc(0.3, 10.0), spin=jr.ConstantSpeed(50.0)), "two.toml")
    shown = answered("campbell", "two.toml", "--from", 90, "--to", 110, "--points", 3)
    assert shown["frame"] == "rotating"
    # (s^2 + w^2 - W^2)^2 + 4 W^2 s^2 = 0.01 w^4, at W = w
    growth = [one["growth"][1] for one in shown["branches"]]
    assert max(growth) == pytest.approx(100 * np.sqrt(np.sqrt(4.01) - 2), rel=1e-9)
    assert all({one["direction"]} == {"whirl"} for one in shown["branches"])
    text = call("campbell", "two.toml", "--from", 90, "--to", 110, "--points", 3).stdout
    assert "in the axes of the shaft" in text


def test_critical():
    shown = answered("critical", gyroscopic())
    speeds = {name: [one["speed"] for one in shown[name]] for name in ("forward", "backward")}
    assert speeds == {  # spec 3, section 3.6
        "forward": pytest.approx([92.387084740, 393.680758289], rel=1e-10),
        "backward": pytest.approx([91.756478455, 385.564284342], rel=1e-10),
    }
    first = shown["forward"][0]
    assert first["rpm"] == pytest.approx(92.387084740 * 60 / (2 * np.pi))
    assert first["hz"] == pytest.approx(92.387084740 / (2 * np.pi))
    text = call("critical", "can.toml", "--count", 1).stdout
    assert "92.3870847" in text and "91.7564785" in text and "393.68" not in text


def in_seals(along_x, along_y):
    """A disc of 10 kg midway between two supports, whose stiffness is by tables that end at 80 rad/s."""
    tables = {"speeds": [0.0, 80.0], "kxx": [along_x] * 2, "kyy": [along_y] * 2}
    seals = [jr.Support(at, **tables) for at in (0.0, 0.6)]
    shaft, disc = jr.RigidShaft(0.6), jr.Disc(0.3, 10.0, 0.1, 0.0)
    jr.save(jr.Scene(shaft, disc, *seals, spin=jr.ConstantSpeed(50.0)), "seals.toml")
    return "seals.toml"


@pytest.mark.slow
def test_critical_says_where_tables_end_it(place, quick_onset):
    """`sqrt(k / m)` is 100 rad/s, beyond the tables; with a quarter of the stiffness it is 50 rad/s."""
    name = in_seals(5e4, 5e4)
    text = " ".join(call("critical", name, "--count", 1).stdout.split())
    between = "from 0 to 80 rad/s (0 to 763.944 rpm), the speeds of all tables"
    assert text.startswith(f"critical none {between}") and "extend them" in text
    shown = " ".join(call("show", name).stdout.split())
    assert f"critical none {between}" in shown
    text = " ".join(call("critical", in_seals(12500.0, 12500.0), "--count", 2).stdout.split())
    assert " 50 " in text and f"no others {between}" in text


def test_show_has_whirl_that_is_neither_forward_nor_backward(place, quick_onset):
    """Whirl in unequal supports without gyroscopics is along lines: `sqrt(kxx / m)`, `sqrt(kyy / m)`."""
    name = in_seals(5e4, 2e5)
    whirl = answered("show", name)["whirl_frequencies"]
    assert whirl["mixed"][:2] == pytest.approx([100.0, 200.0], rel=1e-9)
    assert re.search(r"mixed, at speed +100, 200", call("show", name).stdout)


# === response


def damped(damping=100.0, *more):
    """A disc of 10 kg on 1e5 N/m (`w` = 100 rad/s, `D` = 0.05 for 100 N s/m), 0.1 kg at 1 cm off axis."""
    parts = [jr.Disc(0.3, 10.0), jr.Unbalance(0.3, 0.1, 0.01), *more]
    parts += [jr.DiscDamping(0.3, damping, 0.0)] if damping else []
    shaft, spin = jr.MasslessShaft(0.6, 0.3, 1e5), jr.ConstantSpeed(50.0)
    jr.save(jr.Scene(shaft, *parts, spin=spin), "damped.toml")
    return "damped.toml"


def test_response(place, monkeypatch):
    drawn, draw = {}, plot.response
    monkeypatch.setattr(plot, "response", lambda *a, **b: drawn.update(b) or draw(*a, **b))
    limiter = jr.Limiter(at=0.3, angle=0.0, gap=0.002, stiffness=1e6)
    run = ["response", damped(100.0, limiter), "--from", 10, "--to", 300, "--points", 42]
    shown = answered(*run, "--out", "run")
    assert shown["without"] == ["limiters"] and shown["station"] == 0.3
    assert drawn["clearance"] == 0.002  # [m]; the amplitude is 1 mm
    eccentricity, ratio = 0.1 * 0.01 / 10, 0.05
    (running,) = shown["at_operating"]
    exact = eccentricity * 50**2 / (1e4 - 50**2 + 500j)
    assert running["speed"] == 50 and running["amplitude"] == pytest.approx(abs(exact), rel=1e-10)
    assert running["phase"] == pytest.approx(np.angle(exact), rel=1e-10)
    (peak,) = shown["peaks"]
    assert peak["speed"] == pytest.approx(100 / np.sqrt(1 - 2 * ratio**2), rel=1e-10)
    largest = eccentricity / (2 * ratio * np.sqrt(1 - ratio**2))
    assert peak["amplitude"] == pytest.approx(largest, rel=1e-10)
    (critical,) = shown["critical"]
    assert critical["speed"] == pytest.approx(100.0)
    assert critical["amplitude"] == pytest.approx(eccentricity / (2 * ratio))
    assert critical["phase"] == pytest.approx(-np.pi / 2)
    assert critical["growth"] == pytest.approx(-5.0) and shown["unstable_share"] == 0.0
    assert sorted(os.listdir("run")) == ["response.png", "response.zarr"]
    with xr.open_zarr("run/response.zarr") as data:
        assert {10.0, 300.0, critical["speed"]} <= set(data.speed.values)
        speed, motion = data.speed.values, data.amplitude.values * np.exp(1j * data.phase.values)
        exact = eccentricity * speed**2 / (1e4 - speed**2 + 10j * speed)
        np.testing.assert_allclose(motion[:, 0], exact, rtol=1e-10)
        assert data.amplitude.attrs["units"] == "m" and data.phase.attrs["units"] == "rad"
    (sharp,) = shown["margins"]  # of little damping AF = 1 / (2 D) nearly
    assert sharp["lower"] < 100 < sharp["upper"] and shown["operating"] == [50.0, 50.0]
    assert sharp["amplification"] == pytest.approx(10.0, rel=0.02)
    assert sharp["margin"] == pytest.approx(peak["speed"] / 50 - 1) and sharp["kept"]
    factor = sharp["amplification"]
    assert sharp["required"] == pytest.approx(0.1 + 0.17 * (1 - 1 / (factor - 1.5)))
    text = call(*run, "--operating", "90:99").stdout
    assert "too close" in text and "90 to 99 rad/s" in text
    assert "1.00125" in text and "-90" in text and "limiters" in text and "written" not in text
    assert re.search(r"station\W+0\.3 m", text)


def test_response_reaches_both_speeds_of_half_power(place, monkeypatch):
    """Of a disc with D = 0.25 the upper one is beyond 1.25 times the critical speed of 100 rad/s."""
    limiter = jr.Limiter(at=0.3, angle=0.0, gap=4e-4, stiffness=1e6)
    run = ["response", damped(500.0, limiter), "--points", 41, "--set", "spin.speed=20"]
    (peak,) = answered(*run)["margins"]
    ratio = np.linspace(0.5, 4.0, 200001)  # of the speeds
    height = ratio**2 / np.hypot(1 - ratio**2, 0.5 * ratio)
    high = ratio[height >= np.sqrt(0.5) * height.max()]
    assert peak["lower"] == pytest.approx(100 * high[0], rel=1e-4)
    assert peak["upper"] == pytest.approx(100 * high[-1], rel=1e-4) and peak["upper"] > 125
    monkeypatch.setenv("COLUMNS", "80")
    lines = call(*run).stdout.splitlines()
    assert sum("critical, forward" in line for line in lines) == 1  # in one line of 80 columns
    times = 4e-4 / (1e-4 * height.max())
    assert any(
        line.split()[:2] == ["clearance", "0.4"] and f"{times:.3g} times" in line for line in lines
    )
    (cut,) = answered(*run, "--to", 125)["margins"]
    assert cut["upper"] is None


def test_response_is_at_the_contact_that_is_left_out(place):
    parts = [jr.Support(0.0, 1e6), jr.Support(0.5, 1e6), jr.Disc(0.2, 10.0, 0.1, 0.1)]
    parts += [jr.Unbalance(0.2, 0.1, 0.01), jr.Limiter(at=0.6, angle=0.0, gap=0.01, stiffness=1e6)]
    jr.save(jr.Scene(jr.RigidShaft(0.7), *parts, spin=jr.ConstantSpeed(50.0)), "rigid.toml")
    shown = answered("response", "rigid.toml", "--to", 300, "--points", 5)
    assert shown["station"] == pytest.approx(0.6) and shown["without"] == ["limiters"]


@pytest.mark.slow
def test_response_without_damping_is_unbounded():
    shown = answered("response", damped(0.0), "--points", 42)
    assert shown["peaks"] == [] and shown["critical"][0]["amplitude"] is None
    assert shown["margins"][0]["required"] == pytest.approx(0.26)
    text = call("response", "damped.toml", "--points", 42).stdout
    assert "unbounded" in text and "infinite" in text
    below = call("response", "damped.toml", "--to", 50, "--points", 42).stdout
    assert "none between these speeds" in below


def test_a_speed_that_is_critical_but_for_rounding_is_no_peak(place):
    run = ["response", damped(1.0), "--from", 10, "--to", 300, "--points", 30, "--out", "run"]
    run += ["--set", "unbalance.eccentricity=0.1mm"]
    shown = answered(*run, "--set", "shaft.k11=100000.0000001")
    assert len(shown["peaks"]) == 1
    with xr.open_zarr("run/response.zarr") as data:
        assert data.speed.size == 30 and np.diff(data.speed.values).min() > 9.9


@pytest.mark.slow
def test_response_at_critical_speeds_of_every_kind(place):
    """On unequal supports without damping the response is unbounded at backward and mixed ones too."""
    run = ["response", "two-discs-unequal", "--to", 300, "--points", 31, "--set", "shaft.nodes=4"]
    shown = answered(*run, "--out", "run")
    assert [one["kind"] for one in shown["critical"]] == ["mixed", "mixed", "backward", "forward"]
    assert all(one["amplitude"] is None for one in shown["critical"])
    assert shown["peaks"] == []
    assert (place / "run" / "response.png").stat().st_size > 0


@pytest.mark.slow
@pytest.mark.hard("2.1 finite response inside the unstable band")
def test_response_says_where_it_is_unstable(place):
    """Sheet 3.8: growth +0.049703 of w_0 = 100 rad/s at p = 1, in a band from 0.906 to 1.081."""
    run = ["response", "dual-stiffness-rigid", "--from", 99, "--to", 101, "--points", 5]
    run += ["--set", "unbalance.eccentricity=1um"]
    assert answered(*run, "--out", "run")["unstable_share"] == 1.0
    with xr.open_zarr("run/response.zarr") as data:
        assert float(data.growth.sel(speed=100.0)) == pytest.approx(4.9703, abs=5.1e-5)
    assert "where no response is attained" in call(*run).stdout


def test_response_of_a_balanced_rotor(place):
    balanced = ["--set", "unbalance.eccentricity=0", "--points", 5, "--out", "run"]
    sentence = refused("response", damped(), *balanced)
    assert "unbalance" in sentence and everything_below(place) == ["damped.toml"]


def test_roots_in_axes_that_turn_with_the_shaft():
    """One of each conjugate pair is listed, in fixed axes too; its whirl is that of the larger part."""
    shown = answered("roots", "dual-stiffness-rigid", "--speed", "50")
    assert shown["axes"] == "rotating" and len(shown["roots"]) == 2
    slow, fast = shown["roots"]
    assert slow["shaft_frequency"] == pytest.approx(47.1729494, abs=1e-7)  # of the sheet, 3.10
    assert fast["shaft_frequency"] == pytest.approx(149.8931294, abs=1e-7)
    assert slow["frequency"] == pytest.approx(50 + 47.1729494, abs=1e-7)
    assert fast["frequency"] == pytest.approx(149.8931294 - 50, abs=1e-7)
    assert (slow["direction"], fast["direction"]) == ("forward", "backward")
    assert "shaft's" in call("roots", "dual-stiffness-rigid").stdout
    bent = answered("roots", "dual-stiffness-rigid", "--speed", "100")["roots"]
    assert [root["shaft_frequency"] for root in bent[:2]] == [0.0, 0.0]
    assert [root["stability"] for root in bent] == ["unstable", "stable", "stable"]


def test_roots_on_unequal_supports(place):
    """In fixed axes with elliptic orbits, each whirl is that of the larger of its two circles."""
    text = """
    [shaft]
    model = "massless"
    length = 1.0
    at = 0.5
    k11 = 1e5
    ends = "elastic"
    [disc]
    at = 0.5
    mass = 10.0
    [[supports]]
    at = 0.0
    stiffness = 1e5
    anisotropy = 0.3
    [[supports]]
    at = 1.0
    stiffness = 1e5
    anisotropy = 0.3
    [spin]
    speed = 50.0
    """
    (place / "own.toml").write_text(text)
    shown = answered("roots", "own.toml")
    assert shown["axes"] == "fixed" and [r["direction"] for r in shown["roots"]] == ["mixed"] * 2
    series = [1e5 * 2e5 * a / (1e5 + 2e5 * a) for a in (0.7, 1.3)]
    expected = np.sqrt(np.array(series) / 10.0)
    assert [r["frequency"] for r in shown["roots"]] == pytest.approx(expected, rel=1e-9)


def test_onset_in_axes_that_turn_with_the_shaft():
    bent = answered("onset", "dual-stiffness-rigid", "--to", "300")
    assert bent["speed"] == pytest.approx(90.648925, abs=1e-6)  # of the sheet, 3.1
    assert bent["axes"] == "rotating" and bent["whirl_frequency"] == 0.0 and "bent" in bent["kind"]
    text = call("onset", "dual-stiffness-rigid", "--from", "120", "--to", "300").stdout
    assert "162.804316" in text and "62.316971" in text and "at 100.4873" in text


@pytest.mark.slow
def test_show_two_stiffnesses():
    shown = answered("show", "dual-stiffness-elastic")
    assert (
        shown["coordinates"] == 2
        and shown["parameters"]["supports.stiffness"]["value"] == [1e5] * 2
    )
    assert shown["onset"]["speed"] == pytest.approx(235.22605, abs=1e-5)
    assert shown["whirl_frequencies"]["backward"] == pytest.approx([161.0007123 - 80], abs=1e-6)
    assert len(shown["whirl_frequencies"]["standstill"]) == 2
    text = call("show", "gyroscopic-cantilever").stdout
    assert "hysteretic_damping.loss_factor" in text and "at 92.39679 rad/s" in text


# === simulate


def test_simulate(place):
    run = ["simulate", "limiter-rotor", "--revolutions", 8, "--keep", 5, "--steps", 64]
    run += ["--start-radius", "8.4 mm", "--start-rate", -10 / TIME]
    shown = answered(*run, "--out", "run")
    scene = jr.load("limiter-rotor")
    own = jr.simulate(scene, 8, 64, keep=5, start=jr.Whirl(0.012 * LENGTH, -10 / TIME))
    radius = np.abs(np.asarray(own.displacement))[1:, 0]
    assert shown["radius_min"] == radius.min() and shown["radius_max"] == radius.max()
    assert -0.7 < shown["index"] < -0.4 and len(shown["contacts"]) == 3
    assert all(0 < one["duty"] < 1 and one["peak_force"] > 0 for one in shown["contacts"])
    names = ["history.png", "orbit.png", "response.zarr"]
    assert sorted(os.listdir("run")) == names
    assert sorted(shown["written"]) == [os.path.join("run", name) for name in names]
    with xr.open_zarr("run/response.zarr") as data:
        assert data.displacement.attrs["units"] == "m" and data.axis.values.tolist() == ["x", "y"]
        z = data.displacement.sel(axis="x") + 1j * data.displacement.sel(axis="y")
        np.testing.assert_array_equal(z.values, np.asarray(own.displacement))
        assert data.contact_force.dims == ("time", "limiter", "axis")
        again = jr.loads(data.attrs["scene"])
    assert float(again.spin.speed) == SPEED
    assert "--overwrite" in refused(*run, "--out", "run")


@pytest.mark.hard("1.1 at rest in the centre: the whirl index is 0/0", outcome="flagged")
def test_simulate_at_rest_has_no_index(place):
    args = ["limiter-rotor", "--revolutions", 2, "--steps", 16, "--start-radius", 0]
    assert "undefined" in call("simulate", *args).stdout
    assert everything_below(place) == []  # nothing is written without --out


# === sweep


def test_sweep(place):
    few = ["--set", "shaft.nodes=3", "--error-sample", 0]
    shown = answered("sweep", "limiter-rotor", *SMALL, *few, "--spectrum", "--out", "a/b")
    assert sorted(os.listdir("a/b")) == ["bifurcation.png", "sweep.zarr"]
    assert shown["lanes"] == 4 and shown["forward"] + shown["backward"] == 4
    assert shown["failed"] == shown["undefined"] == 0
    assert (shown["settle"], shown["keep"], shown["steps_per_revolution"]) == (5, 5, 64)
    results = shown["results"]
    assert results["over"]["unbalance.eccentricity"] == {
        "units": "m",
        "values": np.linspace(0, 1e-3, 4).tolist(),
    }
    assert shown["index_max"] == max(results["index"]) and results["status"] == [0] * 4
    with xr.open_zarr("a/b/sweep.zarr") as data:
        assert data["index"].values.tolist() == results["index"]
        assert {"section", "extrema", "duty", "peak_force", "spectrum"} <= set(data.data_vars)
        assert data.attrs["steps_per_revolution"] == 64
        start = data.attrs["start"]
    assert "0.0007" in start  # from the scene file
    with open("a/b/bifurcation.png", "rb") as picture:
        assert picture.read(8) == b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def fake(monkeypatch):
    """Replace the run of a sweep by `fake(how)`, and count the calls."""
    module = importlib.import_module("jaxrotor.cli.sweep")
    seen = types.SimpleNamespace(calls=[], set=None)

    def replace(how):
        def run(scene, axes, **options):
            seen.calls.append((scene, axes, options))
            found = how(axes).assign_attrs(steps_per_revolution=options["steps_per_revolution"])
            found.to_zarr(options["store"], zarr_format=2)
            return found

        monkeypatch.setattr(module, "run", run)
        return seen

    return replace


def lanes(axes, index=None, spectrum=False):
    """Dataset like that of a sweep; the index falls from 1 to -1 over the lanes."""
    dims = tuple(axes)
    shape = tuple(len(v) for v in axes.values())
    if index is None:
        index = np.linspace(1, -1, int(np.prod(shape))).reshape(shape)
    variables = {
        "index": (dims, index),
        "status": (dims, np.where(np.isnan(index), 2, 0).astype(np.int8)),
        "extrema": ((*dims, "revolution", "extremum"), np.zeros((*shape, 3, 2))),
        "radius_max": (dims, np.zeros(shape)),
    }
    units = {path: "rad/s" if path == "spin.speed" else "m" for path in axes}
    coords = {path: (path, values, {"units": units[path]}) for path, values in axes.items()}
    if spectrum:
        variables["spectrum"] = ((*dims, "frequency"), np.ones((*shape, 9)))
        coords["frequency"] = ("frequency", np.arange(9.0))
    return xr.Dataset(variables, coords, {"solver": "none"})


def test_sweep_takes_what_to_do_from_the_scene_file(fake):
    seen = fake(lanes)
    text = call("sweep", "limiter-rotor").stdout
    ((_, axes, options),) = seen.calls
    study = jr.study("limiter-rotor")
    assert list(axes) == ["unbalance.eccentricity"]
    assert (
        axes["unbalance.eccentricity"].tolist() == study["over"]["unbalance.eccentricity"].tolist()
    )
    counts = [options[name] for name in ("settle", "keep", "steps_per_revolution")]
    assert counts == [1000, 300, 256] and float(options["start"].radius) == 7e-4
    assert [type(one).__name__ for one in options["observe"]] == [
        "Section",
        "Extrema",
        "Precession",
        "Radius",
        "Contact",
    ]
    assert "forward whirl" in text and "72" in text and "sweep.zarr" in text
    assert os.listdir("runs/limiter-rotor-sweep")


def test_a_large_radius_is_noted(fake, place):
    fake(lambda axes: lanes(axes).assign(radius_max=lanes(axes)["radius_max"] + 0.08))
    note = call("sweep", "limiter-rotor").stderr
    assert "0.08 m, exceeds a tenth of the shaft's length, 0.7 m" in note


def test_sweep_options(fake):
    seen = fake(lanes)
    over = ["--over", "spin.speed=600rpm,1200rpm", "--over", "start.radius=1mm:3mm:3"]
    more = ["--settle", 0, "--order", 4, "--workers", 1, "--at", "70 cm", "--start-rate", "-5"]
    call("sweep", "limiter-rotor", *over, *more, "--out", "out")
    ((_, axes, options),) = seen.calls
    assert axes["spin.speed"] == pytest.approx([20 * np.pi, 40 * np.pi])
    assert axes["start.radius"].tolist() == [1e-3, 2e-3, 3e-3]
    assert options["settle"] == 0 and options["solver"].order == 4 and options["workers"] == 1
    assert options["at"] == 0.7 and float(options["start"].rate) == -5.0
    assert sorted(os.listdir("out")) == [
        "map.png",
        "sweep.zarr",
    ]  # a map over two parameters, no diagram


def test_waterfall(fake):
    fake(lambda axes: lanes(axes, spectrum=True))
    over = ["--over", "spin.speed=6000rpm:7000rpm:3"]
    said = call("sweep", "limiter-rotor", *over, "--spectrum", "--out", "out").stdout
    assert "6000 to 7000 rpm, 3 values" in said
    assert sorted(os.listdir("out")) == ["bifurcation.png", "sweep.zarr", "waterfall.png"]


def test_undefined_lanes_are_null(fake):
    fake(lambda axes: lanes(axes, index=np.full(2, np.nan)))
    run = ["sweep", "limiter-rotor", "--over", "disc.mass=2,3"]
    shown = answered(*run)
    assert shown["undefined"] == 2 and shown["index_min"] is None
    assert shown["results"]["index"] == [None, None]
    assert "undefined" in call(*run, "--overwrite").stdout


def test_a_picture_that_fails_does_not_cost_the_data(fake):
    fake(lambda axes: lanes(axes).drop_vars("extrema"))
    result = call("sweep", "limiter-rotor", "--out", "out")
    assert os.listdir("out") == ["sweep.zarr"] and "not drawn" in result.stderr


def test_overwrite_replaces_its_own_files_only(fake, place):
    seen = fake(lambda axes: lanes(axes, spectrum=True))
    (place / "out").mkdir()
    (place / "out" / "notes.txt").write_text("mine")
    run = ["sweep", "limiter-rotor", "--over", "spin.speed=600:700:3", "--spectrum", "--out", "out"]
    call(*run)
    sentence = refused(*run)
    assert "exists already" in sentence and "--overwrite" in sentence and len(seen.calls) == 1
    fake(lambda axes: lanes(axes, index=np.zeros(3)))
    call(*run, "--overwrite")
    assert sorted(os.listdir("out")) == ["bifurcation.png", "notes.txt", "sweep.zarr"]
    with xr.open_zarr("out/sweep.zarr") as data:
        assert (data["index"] == 0).all()
    assert (place / "out" / "notes.txt").read_text() == "mine"


@pytest.mark.slow
def test_data_of_two_commands_are_not_mixed(fake, place):
    """An unfinished run of the same command is accepted, others are not; a drawing is no obstacle."""
    fake(lanes)
    (place / "out" / "response.zarr").mkdir(parents=True)
    for more in ((), ("--overwrite",)):
        sentence = refused("sweep", "limiter-rotor", "--out", "out", *more)
        assert sentence == (
            "out holds the data of another command (response.zarr); choose another --out."
        )
    (place / "out" / "response.zarr").rename(place / "out" / "sweep-partial.zarr")
    call("sweep", "limiter-rotor", "--out", "out")
    assert "(sweep.zarr)" in refused("campbell", "two-discs", "--out", "out")
    output = importlib.import_module("jaxrotor.cli.output")
    with output.draft(place / "out", ["rotor.png"], overwrite=False):
        pass


def test_a_sweep_too_large_is_refused_before_its_folder(fake, place):
    fake(lanes)
    call("sweep", "limiter-rotor", "--out", "out")
    many = [f"--over={path}=1:2:100000" for path in ("disc.mass", "spin.speed")]
    sentence = refused("sweep", "limiter-rotor", *many, "--out", "out")
    assert "1e+10 lanes is more than one can hold" in sentence


def broken(error):
    def how(axes):
        raise error

    return how


@pytest.mark.parametrize(
    "error, code, said",
    [
        (KeyboardInterrupt(), 130, "Interrupted; nothing was written."),
        (RuntimeError("It did not converge.\n\nPages about jax."), 2, "It did not converge."),
        (OSError(28, "No space left on device"), 2, "No space left on device"),
    ],
)
def test_nothing_half_written(fake, place, error, code, said):
    fake(broken(error))
    result = call("sweep", "limiter-rotor", "--out", "a/b", code=code)
    assert said in result.stderr and len(result.stderr.splitlines()) == 1 and not result.stdout
    assert everything_below(place) == []
    fake(lanes)
    call("sweep", "limiter-rotor", "--out", "a/b")
    before = everything_below(place)
    fake(broken(error))
    call("sweep", "limiter-rotor", "--out", "a/b", "--overwrite", code=code)
    assert everything_below(place) == before


def test_a_failed_move_puts_everything_back(fake, place, monkeypatch):
    output = importlib.import_module("jaxrotor.cli.output")
    fake(lanes)
    call("sweep", "limiter-rotor", "--out", "out")
    before = everything_below(place)
    real = output.Path.rename

    def rename(self, target):
        if self.name == "bifurcation.png" and self.parent.name.startswith(".draft-"):
            raise OSError(5, "Input/output error")
        return real(self, target)

    monkeypatch.setattr(output.Path, "rename", rename)
    sentence = refused("sweep", "limiter-rotor", "--out", "out", "--overwrite")
    assert "Input/output error" in sentence
    after = everything_below(place)
    assert [name for name in after if "partial" not in name] == before
    assert "out/sweep-partial.zarr" in after  # the new run is kept too


# === mistakes


def test_stability(place):
    """Edges of the unstable band of sheet 2, table 3.1, delta = 0.1, and a map of it."""
    run = ["stability", "dual-stiffness-rigid", "--over", "spin.speed=50:200:31"]
    found = answered(*run)
    values = [one["value"] / 100 for one in found["changes"]]
    assert values == pytest.approx([0.90648925, 1.08086874, 1.62804316], abs=6e-9)
    assert [one["becomes"] for one in found["changes"]] == ["unstable", "stable", "unstable"]
    assert "becomes" in call(*run).stdout
    damping = "disc_damping.translational=50,100,150"
    shown = answered(*run, "--over", damping, "--out", "run")
    assert sorted(os.listdir("run")) == ["stability.png", "stability.zarr"]
    points = [p for c in shown["boundaries"] for p in zip(c["x"], c["y"], strict=True)]
    at_100 = sorted(x / 100 for x, y in points if y == 100.0)
    assert at_100 == pytest.approx([0.90648925, 1.08086874, 1.62804316], abs=1e-8)
    for band, state in (("50:80:3", "stable"), ("95:105:3", "unstable")):
        along = ["stability", "dual-stiffness-rigid", "--over", f"spin.speed={band}"]
        found = answered(*along)
        assert found["changes"] == [] and found["throughout"] == state
        assert f" {state} throughout" in call(*along).stdout
    assert "--out is for a map" in refused(*run, "--out", "other")
    assert "must name two parameters" in refused(
        *run, "--over", damping, "--over", "disc.mass=9,10"
    )


# === run-ups, reactions, balancing


def ramp(*effects, spin=None, name="ramp.toml"):
    """A disc of 2 kg, 1 mm off the axis, a quarter of the way between two bearings."""
    shaft = jr.RigidShaft(0.4, (jr.Constraint(0.0), jr.Constraint(0.4)))
    spin = spin or jr.SpeedProfile.ramp(10.0, 20.0, 0.05)
    jr.save(jr.Scene(shaft, jr.Disc(0.1, 2.0, 0.0, 0.02, offset=1e-3), *effects, spin=spin), name)
    return name


def test_run_up(place):
    """Released 1 mm off the axis, a mass on a spring oscillates as a cosine at any speed."""
    shaft = jr.MasslessShaft(0.4, 0.2, 5e3)
    spin = jr.SpeedProfile.ramp(10.0, 20.0, 0.1)
    jr.save(jr.Scene(shaft, jr.Disc(0.2, 2.0), spin=spin), "spring.toml")
    run = ["run-up", "spring.toml", "--start-radius", "1mm", "--samples", "41", "--out", "run"]
    shown = answered(*run)
    assert shown["speed"] == [10.0, 20.0] and shown["stopped"] is None
    assert shown["peak"] == pytest.approx({"radius": 1e-3, "time": 0.0, "speed": 10.0})
    assert shown["revolutions"] == pytest.approx(1.5 / (2 * np.pi))
    assert everything_below(place / "run")[0] == "passage.png"
    assert sorted(os.listdir("run")) == ["passage.png", "run-up.png", "run-up.zarr", "speed.png"]
    data = xr.open_zarr("run/run-up.zarr")
    swing = 1e-3 * np.cos(50.0 * np.linspace(0.0, 0.1, 41))
    np.testing.assert_allclose(data["displacement"].sel(axis="x")[:, 0], swing, atol=1e-9)
    assert "exists already" in refused(*run)


@pytest.mark.slow
def test_run_up_by_a_chosen_solver(place):
    """Released within a stop, a disc on a spring strikes it again: solvers of both kinds agree."""
    shaft = jr.MasslessShaft(0.4, 0.2, 5e3)
    stop = jr.Limiter(0.2, 0.0, 5e-4, 2e4)
    spin = jr.SpeedProfile.ramp(10.0, 20.0, 0.1)
    jr.save(jr.Scene(shaft, jr.Disc(0.2, 2.0), stop, spin=spin), "stop.toml")
    run = ["run-up", "stop.toml", "--start-radius", "1mm"]
    run += ["--samples", "41", "--out"]
    answered(*run, "by-steps", "--solver", "exponential2", "--substeps", "32")
    answered(*run, "adaptive", "--solver", "dopri8")
    one, other = (
        xr.open_zarr(f"{name}/run-up.zarr").displacement.values for name in ("by-steps", "adaptive")
    )
    assert 0 < np.abs(one - other).max() < 1e-4 * np.abs(other).max()
    assert "add --solver exponential2" in refused(*run, "not", "--substeps", "8")


def test_run_up_of_what_cannot_move(place):
    text = call("run-up", ramp(), "--times", "0, 10ms, 0.02").stdout
    assert "cannot move; use `jaxrotor reactions`" in text and "10 to 14 rad/s" in text
    call("run-up", "ramp.toml", "--times", "0, 10ms, 0.02", "--out", "run", "--film")
    assert sorted(os.listdir("run")) == ["run-up.zarr", "speed.png"]


@pytest.mark.parametrize("samples, noted", [(21, True), (161, False)])
def test_a_run_of_few_samples_is_noted(capsys, samples, noted):
    """Ten revolutions by two samples each, and by the sixteen that the note asks for."""
    run_up._note_few_samples(np.linspace(0.0, 20 * np.pi, samples))
    told = capsys.readouterr().err
    assert ("only 2 samples" in told and "take 161 samples" in told) if noted else not told


@pytest.mark.slow
def test_run_up_looks_at_what_moves():
    """The moving station is that of the balls, 0.14 m above the joint; the run has 50 revolutions."""
    shown = answered("run-up", "ball-balancer", "--samples", 11)
    assert shown["station"] == 0.14 and shown["moves"] and shown["peak"]["radius"] > 1e-5
    assert 'model = "profile"' in call("run-up", "ball-balancer", "--samples", 11).stdout
    assert shown["revolutions"] == pytest.approx(50)


def test_run_up_until_a_drive_is_steady():
    """The duration, until 0.1 % above 204.3827 rad/s, equals that by partial fractions."""
    root, high, low = 17.511850273, 204.382695814, -244.639106070
    ratio = (600 - high) / (600 - low) * (1.001 * high - low) / (1e-3 * high)
    shown = answered("run-up", "turbine-run-up", "--samples", 11)
    assert shown["duration"] == pytest.approx(2.2354 / root * np.log(ratio), rel=1e-5)
    assert shown["speed"][1] == pytest.approx(1.001 * high, rel=1e-6)
    runs_away = ["--set", "spin.slope=0", "--set", "spin.drag=0"]
    assert "runs away" in refused("run-up", "turbine-run-up", *runs_away)
    assert "add --duration" in refused("run-up", "limiter-rotor", "--set", "spin.speed=0")


def test_times_must_ascend_and_be_finite():
    times = ["run-up", "turbine-run-up", "--times"]
    assert "--times must ascend, but has 0.2 s and then 0.1 s." in refused(*times, "0,0.2,0.1")
    assert "finite, but is 'nan'" in refused(*times, "0,nan")


def test_reactions(place):
    run = ["reactions", ramp(jr.Gravity()), "--samples", "501", "--out", "run"]
    first, second = answered(*run)["bearings"]
    assert first["name"] == "constraints.0" and first["moment"] is None
    assert first["force"]["static"] == pytest.approx(0.75 * 2 * 9.80665)
    assert first["force"]["first"] == pytest.approx(1.5e-3 * np.hypot(100, 200))
    assert second["force"]["last"] == pytest.approx(0.5e-3 * 400)
    before = 20 - 200 * 1e-4  # the last sample is past the ramp
    assert second["force"]["most"] == pytest.approx(0.5e-3 * np.hypot(before**2, 200))
    assert second["force"]["time"] == pytest.approx(0.0499)
    files = ["hodograph.png", "reactions.png", "reactions.zarr", "vectors.png"]
    assert sorted(os.listdir("run")) == files
    data = xr.open_zarr("run/reactions.zarr")
    assert data["force"].dims == ("time", "bearing", "axis") and data["force"].units == "N"


def test_reactions_of_a_steady_state(place):
    """`m e W^2 k / |k - m W^2 + i c W|` against the support and `k z + c z.` of it."""
    shaft = jr.RigidShaft(0.4, (jr.Constraint(0.2, "guide"),))
    disc = jr.Disc(0.2, 2.0, 0.0, 0.02, offset=1e-3)
    support = jr.Support(0.2, 5e3, damping=30.0)
    scene = jr.Scene(shaft, disc, support, jr.Gravity(), spin=jr.ConstantSpeed(60.0))
    jr.save(scene, "steady.toml")
    (one, *_) = answered("reactions", "steady.toml")["bearings"]
    spring = 5e3 + 30j * 60
    force = abs(spring * 2e-3 * 60**2 / (spring - 2 * 60**2))
    assert one["name"] == "support"
    for key in ("first", "last", "most"):
        assert one["force"][key] == pytest.approx(force, rel=1e-6)
    assert one["force"]["static"] == pytest.approx(2 * 9.80665)


@pytest.mark.slow
def test_layouts_are_said_to_be_assumed(place):
    """Row 3 of the printed table: masses of 60 and 70 kg at 0.12 and 0.23 m of 0.37 m."""
    row = ["turbine-variants", "--row", 3]
    layout = "layout assumed: chain"
    shown = answered("balance", *row)
    assert shown["assumption"] == layout and shown["planes"]["mass"] == 130.0
    assert layout in call("balance", *row).stdout
    run = ["--times", "0, 0.1", "--layout", "example31"]
    for command in ("reactions", "run-up"):
        text = call(command, *row, *run, "--out", command).stdout
        assert "layout assumed: example31" in text
        name = f"{command}/{command}.zarr"
        assert xr.open_zarr(name).attrs["assumption"] == "layout assumed: example31"
    assert "variant 3" in call("show", *row, "--toml").stdout
    assert "needs the row" in refused("balance", "turbine-variants", "--layout", "chain")
    assert "no rows" in refused("balance", "limiter-rotor", "--row", 3)


def test_balance_in_two_planes(place):
    shown = answered("balance", ramp(), "--planes", "0m,400mm")
    assert shown["speed"] == 20.0 and shown["planes"]["mass"] == 2.0
    one, two = shown["planes"]["corrections"]
    assert [one["plane"], two["plane"]] == [0.0, 0.4]
    assert [one["moment"], two["moment"]] == pytest.approx([1.5e-3, 0.5e-3])
    assert np.cos([one["angle"], two["angle"]]) == pytest.approx([-1.0, -1.0])
    assert shown["speed_of"] == "highest of the profile"
    before, after = shown["planes"]["before"], shown["planes"]["residual"]
    # 2 kg and 2 g m at 0.1 m between bearings at 0 and 0.4 m: shares 0.75 and 0.25, held to 0.7 and 0.3.
    assert (before["static"], before["couple"]) == pytest.approx((2e-3, 0), abs=1e-15)
    assert before["bearings"] == pytest.approx([1.5e-3, 0.5e-3])
    assert (
        before["grade"] == pytest.approx(1.5e-3 / 0.7 * 20 / 2 * 1e3) and before["standard"] == 40
    )
    zeros = {"static": 0, "couple": 0, "bearings": [0, 0], "grade": 0, "standard": 0.4}
    assert after == zeros
    permitted = shown["planes"]["permissible"]
    assert permitted["static"] == pytest.approx(6.3e-3 * 2 / 20)
    assert permitted["bearings"] == pytest.approx([0.7 * 6.3e-4, 0.3 * 6.3e-4])
    other = answered("balance", "ramp.toml", "--planes", "100mm,300mm")["planes"]
    assert other["before"] == before and other["residual"] == zeros
    text = call("balance", "ramp.toml", "--planes", "0,0.4", "--grade", "2.5").stdout
    assert "1500" in text and "21.4" in text and "175" in text and "highest of the profile" in text
    assert "--speed must not be 0" in refused("balance", "ramp.toml", "--speed=0")
    assert "two different stations" in refused("balance", "ramp.toml")
    still = ramp(spin=jr.ConstantSpeed(0.0), name="still.toml")
    assert "--speed" in refused("balance", still, "--planes", "0,0.4")


def test_grade_of_the_course_rotor():
    """Grade from R_A, R_B of the sheet over its steady speed squared, shares by the centre of mass."""
    shown = answered("balance", "turbine-run-up")
    assert shown["speed"] == pytest.approx(204.382695814, rel=1e-9)
    assert shown["speed_of"] == "steady speed of the drive"
    loads = np.array([1481.2272, 1995.4354]) / 204.382695814**2
    assert shown["planes"]["before"]["bearings"] == pytest.approx(loads, rel=1e-7)
    lever = 0.165460993 / 0.267
    grade = max(loads / [1 - lever, lever]) * 204.382695814 / 141 * 1e3
    assert shown["planes"]["before"]["grade"] == pytest.approx(grade, rel=1e-6)


def test_balance_with_balls(place):
    """The machine R of the sheet, `om_cr = 1 / sqrt(1 - C)`."""
    rotor = jr.Scene(
        jr.RigidShaft(0.14, (jr.Constraint(0.0),)),
        jr.Disc(0.0, 1.0, 0.07 - 0.14**2 * 0.11, 0.014),
        jr.Support(0.0, 0.0, angular_stiffness=700.0, angular_damping=1.4),
        jr.Unbalance(0.14, 1.0, 2.4e-3),
        jr.BallBalancer(0.14, 0.025, 0.06, 3.5, places=2),
        jr.BallBalancer(0.14, 0.02, 0.06, 2.24, places=3),
        spin=jr.ConstantSpeed(200.0),
    )
    jr.save(rotor, "balls.toml")
    found = answered("balance", "balls.toml")["balancer"]
    assert found["capacity"] == pytest.approx(6.6e-3)
    assert found["imbalance"] == pytest.approx(2.4e-3)
    assert found["critical_speed"] == pytest.approx(100 / np.sqrt(0.8))
    assert found["above"] and found["balances"] and found["stable"] and not found["cautions"]
    one, two = (np.exp(1j * np.array(row)).sum() for row in found["position"])
    assert abs(2.4 + 1.5 * one + 1.2 * two) < 1e-8
    just = answered("balance", "balls.toml", "--speed", "112.5")["balancer"]
    assert just["above"] and not just["stable"]
    assert "predicts stability" in just["cautions"][0]
    heavy = ["--set", "unbalance.eccentricity=7mm"]
    text = call("balance", "balls.toml", *heavy).stdout
    assert "No position balances" in " ".join(text.split()) and "stable, largest" not in text
    wide = ["--set", "ball_balancers.0.at=0.1"]
    assert "in one plane" in refused("balance", "balls.toml", *wide)


@pytest.mark.parametrize(
    "args, said",
    [
        (["show", "limiter-rottor"], "did you mean `limiter-rotor`"),
        (["roots", "limiter-rotor", "--set", "spin.sped=1"], "did you mean `spin.speed`"),
        (["roots", "limiter-rotor", "--set", "spin.speed"], "must be path=value"),
        (["roots", "limiter-rotor", "--set", "spin.speed=7 mm"], "write rpm or rad/s"),
        (
            ["roots", "limiter-rotor", "--set", "shaft.nodes=1.5"],
            """number, such as 12, or "auto", but is '1.5'""",
        ),
        (["roots", "limiter-rotor", "--set", "shaft.nodes=99"], "must be 2 to 24"),
        (["roots", "turbine-run-up", "--set", "shaft.nodes=9"], "RigidShaft has no nodes"),
        (["roots", "limiter-rotor", "--set", "disc.mass=-1"], "must not be negative"),
        (["roots", "limiter-rotor", "--set", "disc.at=2"], "off the shaft"),
        (["roots", "limiter-rotor", "--set", "disc.mass=nan"], "must be in kg"),
        (["roots", "limiter-rotor", "--speed", "fast"], "--speed must be in rad/s"),
        (["onset", "limiter-rotor", "--from", "5"], "add --to"),
        (["onset", "limiter-rotor", "--from", "5", "--to", "5"], "another speed than --from"),
        (["campbell", "limiter-rotor", "--from", "5", "--to", "5"], "another speed than --from"),
        (["campbell", "limiter-rotor", "--to", "fast"], "--to must be in rad/s"),
        (["critical", "limiter-rotor", "--set", "disc.mass=-1"], "must not be negative"),
        (["response", "limiter-rotor", "--to", "900", "--at", "2 m"], "on the shaft"),
        (["response", "limiter-rotor", "--from", "5 kg", "--to", "6"], "--from must be in rad/s"),
        (["response", "limiter-rotor", "--operating", "3:2"], "--operating must be one speed"),
        (["simulate", "limiter-rotor", "--start-radius", "-1 mm"], "must not be negative"),
        (["simulate", "limiter-rotor", "--start-radius", "1 kg"], "--start-radius must be in m"),
        (["simulate", "limiter-rotor", "--keep", "200"], "must not exceed"),
        (["simulate", "limiter-rotor", "--at", "2 m"], "on the shaft"),
        (["simulate", "limiter-rotor", "--set", "spin.speed=0"], "give --period"),
        (["run-up", "limiter-rotor", "--set", "spin.speed=0"], "add --duration"),
        (["run-up", "limiter-rotor", "--duration", "0"], "must be above 0"),
        (["run-up", "limiter-rotor", "--duration", "1s", "--film"], "add --out"),
        (["run-up", "limiter-rotor", "--duration", "1s", "--times", "0,1"], "leave out"),
        (["run-up", "limiter-rotor", "--times", "0:1"], "start : stop : count"),
        (["reactions", "limiter-rotor", "--times", "1s,0s"], "must ascend"),
        (
            ["reactions", "limiter-rotor"],
            "has limiters; leave them out of the file, or add a --duration",
        ),
        (["balance", "limiter-rotor", "--planes", "0m"], "two different stations"),
        (["balance", "limiter-rotor", "--planes", "0m,9m"], "on the shaft"),
        (["sweep", "limiter-rotor", "--over", "spin.speed=1:2"], "start : stop : count"),
        (["sweep", "limiter-rotor", "--over", "spin.speed=1:2:1"], "count from 2"),
        (["sweep", "limiter-rotor", "--over", "spin.speed=a:2:3"], "must be in rad/s"),
        (["sweep", "limiter-rotor", "--over", "disc.mass=-1:2:3"], "must not be negative"),
        (["sweep", "limiter-rotor", "--over", "discs=1:2:3"], "no parameter"),
        (["sweep", "limiter-rotor", "--over", "start.speed=1:2:3"], "no parameter"),
        (["sweep", "limiter-rotor", "--spectrum", "--steps", "50"], "multiple of 32"),
        (["sweep", "limiter-rotor", "--set", "unbalance.eccentricity=0"], "it is swept"),
    ],
)
def test_one_sentence(place, args, said):
    assert said in refused(*args)
    assert everything_below(place) == []


def test_a_scene_without_a_sweep_table(place, fake):
    jr.save(jr.load("limiter-rotor"), "plain.toml")
    assert "--over" in refused("sweep", "plain.toml")
    assert "--start-radius" in refused("simulate", "plain.toml", "--start-rate", "5")
    seen = fake(lanes)
    call("sweep", "plain.toml", "--over", "start.radius=0:1mm:2")
    assert seen.calls[0][2]["settle"] == 1000 and type(seen.calls[0][2]["start"]) is jr.Whirl
    call("sweep", "plain.toml", "--over", "disc.mass=2,3", "--out", "out")
    assert type(seen.calls[1][2]["start"]) is jr.AtRest
    assert os.listdir("runs") == ["plain-sweep"]


def test_out_that_is_a_file(place):
    (place / "out").write_text("mine")
    sentence = refused("sweep", "limiter-rotor", "--out", "out")
    assert "cannot be written" in sentence and (place / "out").read_text() == "mine"


@pytest.mark.parametrize(
    "args",
    [
        ["nonsense"],
        ["sweep"],
        ["roots", "x", "--count", "0"],
        ["campbell", "x", "--points", "2"],
        ["sweep", "x", "--order", "3"],
    ],
)
def test_usage_errors(args):
    result = call(*args, code=2)
    assert not result.stdout and "Traceback" not in result.stderr


def test_debug_shows_where():
    result = CliRunner().invoke(app, ["--debug", "show", "nowhere"])
    assert isinstance(result.exception, jr.SceneError)


def test_json_is_valid():
    values = {
        "a": np.float64("nan"),
        "b": np.array([1 + 2j, np.inf]),
        "c": np.int8(3),
        "d": (True,),
    }
    assert plain(values) == {
        "a": None,
        "b": [{"re": 1.0, "im": 2.0}, {"re": None, "im": 0.0}],
        "c": 3,
        "d": [True],
    }


COMMANDS = ["show", "roots", "onset", "campbell", "critical", "stability", "response"]
COMMANDS += ["balance", "simulate", "run-up", "reactions", "sweep"]


@pytest.mark.parametrize("command", ["", "scenes", *COMMANDS])
def test_help(command):
    text = call(*filter(None, [command]), "--help").stdout
    assert "Usage" in text and (command in ("", "scenes") or f"jaxrotor {command} " in text)


# === new scenes


@pytest.mark.slow
def test_new_scene_runs_as_it_is(place):
    said = call("new", "mine.toml").stdout
    assert said.startswith("Written: mine.toml.")
    text = (place / "mine.toml").read_text()
    assert "jaxrotor show mine.toml" in text
    shown = answered("show", "mine.toml")
    assert shown["parameters"]["disc.mass"]["value"] == pytest.approx(
        7850 * np.pi * 0.125**2 * 0.04
    )
    assert shown["onset"]["speed"] > 0
    assert jr.study("mine.toml")["over"]["spin.speed"].size == 41
    assert "exists already" in refused("new", "mine.toml")
    assert (place / "mine.toml").read_text() == text
    assert "must end in .toml" in refused("new", "mine")
    assert "cannot be written" in refused("new", "no/where.toml")


@pytest.mark.slow
def test_a_new_scene_is_stable_at_the_speeds_it_sweeps(place):
    call("new", "mine.toml")
    scene, speeds = jr.load("mine.toml"), jr.study("mine.toml")["over"]["spin.speed"]
    for speed in (speeds[0], speeds[-1], float(scene.spin.speed)):
        assert np.max(np.asarray(jr.roots(scene.at_speed(speed))).real) < 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two-discs-unequal", "limiter-rotor"])
def test_standstill_frequencies_are_those_of_roots(name):
    """Each frequency is listed once, whether or not both planes have it."""
    values = np.abs(np.asarray(jr.roots(jr.load(name).with_nodes(4).at_speed(0.0), 20)).imag)
    values = np.unique(np.round(values[values > 1e-3], 5))[:3]
    shown = answered("show", name, "--set", "shaft.nodes=4")["whirl_frequencies"]["standstill"]
    assert shown == pytest.approx(values.tolist(), rel=1e-6)


def test_all_that_a_new_scene_prepares_is_valid(place):
    """Every table that is commented out is valid when uncommented."""
    call("new", "mine.toml")
    _, _, rest = (place / "mine.toml").read_text().partition("title =")
    lines = [line.removeprefix("# ") for line in rest.splitlines()]
    whole = "title =" + "\n".join(lines).replace("\n[disc]", "\n[[disc]]")
    first, second, third = whole.split("[spin]")  # the second one instead of the first
    scene = jr.loads(f"{first}[spin]{third.partition('[sweep]')[0]}")
    assert isinstance(scene.spin, jr.SpeedProfile) and 'speed = "1500 rpm"' in second
    assert [float(step.diameter) for step in scene.shaft.steps] == [0.04, 0.03]
    film, seal, same, foundation = scene.of(jr.Support)[2:]
    assert seal.kyx.tolist() == (-seal.kxy).tolist() and foundation.of == "pedestal"
    for name in ("kxx", "kxy", "kyx", "kyy", "cxx", "cyy"):
        assert float(getattr(film, name)) == float(getattr(same, name)) != 0
    assert {effect.kind for effect in scene.effects} == {
        *("disc", "unbalance", "support", "internal_damping", "external_damping"),
        *("disc_damping", "gravity", "limiter", "casing"),
    }
    assert len(scene.of(jr.Disc)) == 2 and len(scene.of(jr.Limiter)) == 4


@pytest.mark.skipif(os.name == "nt", reason="POSIX limits")
def test_new_leaves_no_half_of_a_scene(place):
    resource = importlib.import_module("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        sentence = refused("new", "mine.toml")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert sentence == "mine.toml cannot be written (File too large); choose another."
    assert everything_below(place) == []


def test_new_scene_like_another(place):
    call("new", "mine.toml", "--like", "limiter-rotor")
    assert jr.load("mine.toml").get("limiters.gap")[0] == 7.5e-3
    assert answered("show", "mine.toml", "--out", "run")["written"] == [
        os.path.join("run", "rotor.png")
    ]
    assert "nor a shipped scene" in refused("new", "other.toml", "--like", "nothing")
    assert not (place / "other.toml").exists()


# === as a program of its own


@pytest.mark.slow
def test_program(place):
    run = [sys.executable, "-m", "jaxrotor", "show", "limiter-rottor"]
    done = subprocess.run(run, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and not done.stdout
    assert len(done.stderr.splitlines()) == 1 and "limiter-rottor" in done.stderr
    assert callable(main)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_ctrl_c(place):
    run = [sys.executable, "-m", "jaxrotor", "sweep", "limiter-rotor", "--settle", "1000000"]
    process = subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    while not (place / "runs").exists() and time.monotonic() < until:
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    try:
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130 and not out
    assert err == "Interrupted; nothing was written.\n" and everything_below(place) == []


INTERRUPTED_AS_MEMORY_IS_FREED = """
import gc, signal, time, weakref
from jaxrotor.cli.interrupt import stop_on_ctrl_c

lost = []

def freed(phase, info):
    if len(lost) < 3:  # several times
        lost.append(phase)
        signal.raise_signal(signal.SIGINT)

class Part:
    pass

stop_on_ctrl_c()
for case in ("garbage collection", "weak reference"):
    try:
        if case == "garbage collection":
            gc.callbacks.append(freed)
            gc.collect()
        else:
            part = Part()
            reference = weakref.ref(part, lambda _: signal.raise_signal(signal.SIGINT))
            del part
        time.sleep(30)
    except KeyboardInterrupt:
        print(case)
    gc.callbacks.clear()
time.sleep(0.2)  # an interruption too many ends this process
print(len(lost) > 1)
"""


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_ctrl_c_while_memory_is_freed():
    """Python cannot propagate what is raised there; the interrupt follows a moment later, once."""
    run = [sys.executable, "-c", INTERRUPTED_AS_MEMORY_IS_FREED]
    done = subprocess.run(
        run, capture_output=True, text=True, timeout=25
    )  # a sleeping thread is woken
    assert done.returncode == 0 and not done.stderr, done.stderr
    assert done.stdout.splitlines() == ["garbage collection", "weak reference", "True"]


INTERRUPTED_BESIDE_A_THREAD_WITHOUT_END = """
import threading
from jaxrotor.cli.interrupt import run_until_interrupted

def program():
    threading.Thread(target=threading.Event().wait).start()
    print("Interrupted")
    raise SystemExit(130)

run_until_interrupted(program)
"""


def test_ctrl_c_leaves_threads():
    run = [sys.executable, "-c", INTERRUPTED_BESIDE_A_THREAD_WITHOUT_END]
    done = subprocess.run(run, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (130, "Interrupted\n", "")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_interrupted_sweep_goes_on(place):
    """Completed lanes are kept and reported; the same command ends with the data of a whole run."""
    over = ["--over", "start.angle=0:3:24", "--start-radius", "1mm", "--steps", "16"]
    small = ["sweep", "limiter-rotor", *over, "--settle", "0", "--keep", "8", "--workers", "1"]
    call(*small, "--out", "whole")
    module = importlib.import_module("jaxrotor.sweeps.store")
    put, count = module.Store.put, []

    def interrupted(self, block, part):
        put(self, block, part)
        count.append(block)
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module.Store, "put", interrupted)
        patch.setattr(
            importlib.import_module("jaxrotor.sweeps.sweep"), "block_shape", lambda *_: (6,)
        )
        said = call(*small, "--out", "run", code=130).stderr
    where = os.path.join("run", "sweep-partial.zarr")
    assert said == (
        f"Interrupted; 6 of 24 lanes are kept in {where}; the same command continues from there.\n"
    )
    assert os.listdir("run") == ["sweep-partial.zarr"]
    with pytest.MonkeyPatch.context() as patch:  # also while its picture is drawn
        drawing = importlib.import_module("jaxrotor.cli.sweep")
        patch.setattr(drawing, "draw", Mock(side_effect=KeyboardInterrupt))
        assert "24 of 24 lanes are kept" in call(*small, "--out", "run", code=130).stderr
    call(*small, "--out", "run")
    assert sorted(os.listdir("run")) == ["bifurcation.png", "sweep.zarr"]
    with xr.open_zarr("run/sweep.zarr") as run, xr.open_zarr("whole/sweep.zarr") as whole:
        np.testing.assert_allclose(run["section"], whole["section"], rtol=1e-12, atol=1e-15)


# === accuracy


def test_accuracy_lists_every_setting_and_writes_data_and_pictures(place):
    args = ["accuracy", "limiter-rotor", "--quantity", "root", "--method", "trapezoid"]
    found = answered(*args, "--repeats", 1, "--out", "run")
    names = ["accuracy.zarr", "convergence.png", "work-precision.png"]
    assert sorted(path.name for path in (place / "run").iterdir()) == names
    assert found["method"] == ["trapezoid"] * 4 and found["status"] == [0] * 4
    assert found["relative_error"] == sorted(found["relative_error"], reverse=True)
    assert found["reference_imag"] * TIME == pytest.approx(-1.45302933, abs=1e-8)  # sheet 3.2
    with xr.open_zarr(place / "run" / "accuracy.zarr") as data:
        assert data["error"].attrs["units"] == "rad/s"
    assert "add --bearing" in refused(
        "accuracy", "turbine-run-up", "--quantity", "reaction", "--duration", "0.1s"
    )
    assert "is none of the methods" in refused("accuracy", "limiter-rotor", "--method", "magic")


def test_accuracy_gives_reasons_a_line(capsys, monkeypatch):
    """A setting that fails has its sentence below the table, not in a narrow column of it."""
    monkeypatch.setenv("COLUMNS", "80")
    columns = {"method": ["spectral"] * 2, "axis": ["nodes"] * 2, "nodes": [3, 4], "status": [0, 1]}
    columns |= {"reason": ["", "The rotor never loses its stability from 0 to 9 rad/s."]}
    columns |= dict.fromkeys(
        ("relative_error", "compile_time", "run_time", "memory"), [0.5, np.nan]
    )
    found = xr.Dataset({name: ("run", values) for name, values in columns.items()})
    found["value"] = "run", [2.0, np.nan], {"long_name": "onset speed", "units": "rad/s"}
    about = {"reference": 2.0, "reference_uncertainty": 0.1, "reference_setting": "14 nodes"}
    importlib.import_module("jaxrotor.cli.accuracy")._print(
        found.assign_attrs(about, reference_reason="", lanes=1), []
    )
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    failed = "spectral, 4 nodes  The rotor never loses its stability from 0 to 9 rad/s."
    assert failed in lines and any(line.startswith("spectral   3 nodes") for line in lines)


@pytest.mark.slow
def test_sweep_along_times(place):
    rotor = jr.load("limiter-rotor").with_nodes(2)
    spin = jr.SpeedProfile([0.0, 0.2], [50.0, 150.0])
    jr.save(jr.Scene(rotor.shaft, *rotor.effects, spin=spin), "up.toml")
    over = ("--over", "unbalance.eccentricity=0.1mm,0.2mm")
    out = call("sweep", "up.toml", "--times", "0:0.2s:65", *over, "--out", "a").stdout
    assert "0.2 s, 65 samples" in out and "largest radius" in out
    assert sorted(os.listdir("a")) == ["envelope.png", "sweep.zarr"]
    found = answered("sweep", "up.toml", "--times", "0:0.2s:65", *over, "--out", "b")
    assert found["lanes"] == 2 and len(found["results"]["peak"]) == 2
    for option in (("--settle", "3"), ("--keep", "3"), ("--spectrum",)):
        told = refused("sweep", "up.toml", "--times", "0:0.2s:65", *over, *option)
        assert f"{option[0]} is for whole revolutions" in told


@pytest.mark.slow
def test_sweep_prints_its_errors_and_what_was_chosen(place):
    args = ["sweep", "limiter-rotor", *SMALL[:-2], "--steps", "auto", "--error-sample", 2]
    found = answered(*args)
    assert found["steps_per_revolution"] == 128 and found["chosen"].startswith("128 steps")
    assert set(found["errors"]["radius_max"]) == {"largest", "median", "units"}
    shown = call(*args, "--overwrite").stdout
    assert "error of radius_max" in shown and "2 lanes, with twice the steps" in shown
    assert 'or "auto"' in refused("sweep", "limiter-rotor", "--steps", "many")


@pytest.mark.slow
def test_every_root_that_is_printed_has_its_digits(place):
    """Eight roots of a disc near an end, against those of 16 nodes a span."""
    (place / "own.toml").write_text(
        '[shaft]\nlength = "1 m"\ndiameter = "40 mm"\n[disc]\nat = "0.1 m"\nmass = "2 kg"\n'
        'polar = "0.01 kg m^2"\n[[support]]\nat = "0 m"\nkxx = "1e8 N/m"\n[[support]]\nat = "1 m"\n'
        'kxx = "1e8 N/m"\n[spin]\nspeed = "300 rad/s"\n'
    )
    shown = [root["root"]["im"] for root in answered("roots", "own.toml")["roots"]]
    exact = np.abs(np.asarray(jr.roots(jr.load("own.toml").with_nodes(16))).imag)
    np.testing.assert_allclose(np.sort(np.abs(shown)), np.unique(exact.round(7))[:8], rtol=1e-8)
