"""Implausible numbers: each gives a warning with the unit that may be meant, plausible ones give none."""

import warnings

import jax
import pytest
from machines import MACHINES
from systems import one_disc
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor.cli import app


STEEL = {"youngs_modulus": 2.1e11, "density": 7850.0}


def shaft(length=1.2, diameter=0.08, **material):
    """A free shaft of steel, with the given properties."""
    return jr.FlexibleShaft(length, diameter, jr.Material(**(STEEL | material)), constraints=())


def scene(shaft, *effects, mass=2.0, speed=300.0, stiffness=1e6):
    """A disc at the middle of a shaft on two equal supports."""
    ends = [jr.Support(at, stiffness) for at in (0.0, float(shaft.length))]
    return jr.Scene(shaft, jr.Disc(0.6, mass), *ends, *effects, spin=jr.ConstantSpeed(speed))


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (
            lambda: scene(shaft(diameter=80.0)),
            "`shaft.diameter` is 80 m, 67 times the length of the shaft, 1.2 m; check its unit: "
            "80 mm is 0.08 m.",
        ),
        (
            lambda: scene(shaft(), jr.Unbalance(0.6, 2.0, 50.0)),
            "`unbalance.eccentricity` is 50 m, 42 times the length of the shaft, 1.2 m; check its unit: "
            "50 um is 5e-05 m.",
        ),
        (lambda: scene(shaft(1200.0)), "15000 times its diameter, 0.08 m; .* 1200 mm is 1.2 m"),
        (lambda: scene(shaft(density=7.85)), r"7.85 g/cm\^3 is 7850 kg/m\^3"),
        (lambda: scene(shaft(youngs_modulus=210.0)), "210 GPa is 2.1e\\+11 Pa"),
        (lambda: scene(shaft(youngs_modulus=2.1e5)), "210000 MPa is 2.1e\\+11 Pa"),
        (lambda: scene(shaft(), mass=2e6), "`disc.mass` is 2e\\+06 kg, under which the shaft would sag"),
        (lambda: scene(shaft(diameter=0.8), mass=2e7), "heavier than any rotor"),
        (lambda: scene(shaft(), stiffness=100.0), "The supports, 200 N/m together, would give way"),
        (lambda: scene(shaft(), speed=1e7), "`spin.speed` is 1e\\+07 rad/s, faster than any rotor"),
        (lambda: scene(shaft(), speed=3e5), "1.2e\\+04 m/s at the surface of the shaft"),
    ],
)  # fmt: skip
def test_implausible_number_is_warned_of(build, sentence):
    with pytest.warns(jr.ImplausibleWarning, match=sentence) as found:
        build()
    assert len(found) == 1
    assert found[0].filename == __file__  # the line of the user, not of the package


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", MACHINES)
def test_machines_give_no_warning(name):
    MACHINES[name]()


@pytest.mark.filterwarnings("error")
def test_shipped_scenes_give_no_warning():
    for name, _ in jr.shipped():
        jr.load(name)
    for row in range(1, 31):
        jr.load("turbine-variants", row)


FAN, MOTOR = "fan, 1500 rpm, with a trial weight", "electric motor, 2 poles"
TURBINE, BALLS = "steam turbine, 3000 rpm", "balls in a race"
TURBO, SPINDLE = "turbocharger, 150 000 rpm", "gas-bearing spindle, 200 000 rpm"
DRILL, MICRO = "dental drill, 400 000 rpm", "micro turbine of silicon, 1.2 million rpm"


@pytest.mark.parametrize(
    ("name", "path", "value", "meant"),
    [
        (FAN, "unbalances.0.eccentricity", 50.0, "50 um is 5e-05 m"),
        (FAN, "unbalances.0.eccentricity", 0.05, "0.05 mm is 5e-05 m"),
        (MICRO, "unbalance.eccentricity", 5e-5, "5e-05 mm is 5e-08 m"),
        (TURBINE, "unbalance.eccentricity", 0.02, "0.02 mm is 2e-05 m"),
        (FAN, "unbalances.1.mass", 3e4, "30000 g is 30 kg"),
        (FAN, "disc.mass", 3e4, "30000 g is 30 kg"),
        (DRILL, "disc.mass", 0.3, "0.3 g is 0.0003 kg"),
        (FAN, "disc.polar", 1.35e6, "1.35e+06 kg mm^2 is 1.35 kg m^2"),
        (FAN, "shaft.diameter", 50.0, "50 mm is 0.05 m"),
        (DRILL, "shaft.length", 12.0, "12 mm is 0.012 m"),
        (MOTOR, "limiter.gap", 0.4, "0.4 mm is 0.0004 m"),
        (MOTOR, "limiter.gap", 400.0, "400 um is 0.0004 m"),
        (TURBINE, "annular_stator.gap", 1.0, "1 mm is 0.001 m"),
        (TURBINE, "annular_stator.rim_radius", 900.0, "900 mm is 0.9 m"),
        (TURBINE, "journal_bearing.clearance", 0.4, "0.4 mm is 0.0004 m"),
        (TURBO, "journal_bearing.clearance", 20.0, "20 um is 2e-05 m"),
        (TURBINE, "journal_bearing.radius", 250.0, "250 mm is 0.25 m"),
        (TURBINE, "journal_bearing.length", 250.0, "250 mm is 0.25 m"),
        (TURBINE, "journal_bearing.viscosity", 20.0, "20 cP is 0.02 Pa s"),
        (BALLS, "ball_balancer.race_radius", 90.0, "90 mm is 0.09 m"),
        (BALLS, "ball_balancer.ball_mass", 50.0, "50 g is 0.05 kg"),
        (MOTOR, "limiter.angle", 60.0, "60 deg is 1.0472 rad"),
        (MOTOR, "gravity.acceleration", 9810.0, "9810 mm/s^2 is 9.81 m/s^2"),
        (TURBO, "spin.speed", 150e3, "150000 rpm is 15708 rad/s"),
        (TURBINE, "spin.speed", 3000.0, "3000 rpm is 314.159 rad/s"),
        (TURBINE, "supports.0.speeds", [1000.0, 2000.0, 4000.0], "4000 rpm is 418.879 rad/s"),
        (TURBINE, "supports.0.speeds", [300.0, 2000.0, 4000.0], "4000 rpm is 418.879 rad/s"),
        (MOTOR, "unbalance.eccentricity", 0.03, "0.03 mm is 3e-05 m"),
        (FAN, "supports.kxx", 8e4, "1 N/mm is 1000 N/m"),
        (FAN, "supports.0.kyy", 4e4, "40000 N/mm is 4e+07 N/m"),
        (SPINDLE, "supports.stiffness", 5.0, "1 N/um is 1e6 N/m"),
        (FAN, "shaft.material.youngs_modulus", 210e3, "210000 MPa is 2.1e+11 Pa"),
        (FAN, "shaft.material.density", 7.85, "7.85 g/cm^3 is 7850 kg/m^3"),
        (FAN, "shaft.material.density", 7.85e6, "7.85e+06 g/m^3 is 7850 kg/m^3"),
    ],
)  # fmt: skip
def test_a_wrong_unit_gives_one_warning_that_names_the_right_one(name, path, value, meant):
    changes = {path: value}
    if path == "supports.kxx":  # both axes, as they were typed
        changes["supports.kyy"] = value / 2
    rotor = MACHINES[name]()
    with pytest.warns(jr.ImplausibleWarning) as found:
        rotor.replace(changes)
    (sentence,) = [str(one.message) for one in found]
    assert meant in sentence
    assert path.startswith("supports.") or sentence.startswith(f"`{path}` is ")


def test_one_of_two_supports_a_thousand_times_too_soft():
    """Each bears half of `7850 pi d^2 l / 4 + 10 kg`; together they are as firm as one that is right."""
    rotor = lambda first, second: jr.Scene(
        jr.FlexibleShaft(1.0, 0.05, jr.Material(**STEEL), constraints=()),
        jr.Disc(0.5, 10.0),
        jr.Support(0.0, kxx=first),
        jr.Support(1.0, kxx=second),
        spin=jr.ConstantSpeed(100.0),
    )
    said = (
        "`supports.1.kxx` is 10000 N/m, by which it would give way by 0.0125 m under its part of the "
        "weight, 125 N; check its unit: 10000 N/mm is 1e+07 N/m."
    )
    with pytest.warns(jr.ImplausibleWarning) as found:
        rotor(1e7, 1e4)
    assert [str(one.message) for one in found] == [said]


@pytest.mark.filterwarnings("error")
def test_no_body_has_more_than_twice_the_moment_about_its_diameter():
    fan = MACHINES[FAN]()
    twice = 2 * fan.get("disc.diametral")
    fan.replace({"disc.polar": 1.01 * twice})  # a thin disc, rounded
    with pytest.warns(jr.ImplausibleWarning, match="2.5 times `disc.diametral`, where no body"):
        fan.replace({"disc.polar": 1.25 * twice})


def test_a_typed_file_and_a_typed_setting(tmp_path):
    """The fan of an eccentricity of 50 instead of "50 um"."""
    text = """
[shaft]
length = "0.9 m"
diameter = "50 mm"
constraints = []
[disc]
at = "0.9 m"
mass = "30 kg"
[unbalance]
at = "0.9 m"
mass = "30 kg"
eccentricity = {}
[[support]]
at = "0 m"
stiffness = "8e7 N/m"
[[support]]
at = "0.5 m"
stiffness = "8e7 N/m"
[spin]
speed = "1500 rpm"
"""
    (tmp_path / "fan.toml").write_text(text.format('"50 um"'))
    (tmp_path / "typed.toml").write_text(text.format("50"))
    call = lambda *words: CliRunner().invoke(app, ["show", "--toml", *map(str, words)])
    assert not call(tmp_path / "fan.toml").stderr
    setting = call(tmp_path / "fan.toml", "--set", "unbalance.eccentricity=50")
    for result in (call(tmp_path / "typed.toml"), setting):
        assert result.stderr.splitlines() == [
            "Note: `unbalance.eccentricity` is 50 m, 56 times the length of the shaft, 0.9 m; check its "
            "unit: 50 um is 5e-05 m."
        ]


def test_a_changed_value_is_doubted_and_a_traced_one_is_not():
    rotor = scene(shaft())
    with pytest.warns(jr.ImplausibleWarning, match=r"`shaft.diameter` is 80 m") as found:
        rotor.replace({"shaft.diameter": 80.0, "spin.speed": 1.0})
    assert found[0].filename == __file__
    traced = lambda d: rotor.replace({"shaft.diameter": d}).shaft.diameter
    assert float(jax.jit(traced)(80.0)) == 80.0


def test_a_start_is_compared_with_the_shaft():
    """Seven metres instead of millimetres; where the run ends is of no interest."""
    rotor = one_disc(speed=150.0, stiffness=2e4)
    with pytest.warns(jr.ImplausibleWarning) as found:
        jr.simulate(rotor, 1, 4, start=jr.Whirl(7.0))
    start = "`start.radius` is 7 m, 7 times the length of the shaft, 1 m; check its unit: 7 mm is 0.007 m."
    assert [str(one.message) for one in found] == [start] and found[0].filename == __file__


def test_a_command_notes_it_once():
    call = ["show", "limiter-rotor", "--toml", "--set", "limiters.gap=300"]
    with warnings.catch_warnings(record=True) as kept:
        result = CliRunner().invoke(app, call)
    assert result.exit_code == 0 and not kept
    assert result.stderr.splitlines() == [  # of three stops at once
        "Note: `limiters.gap` is 300 m, 429 times the length of the shaft, 0.7 m; check its unit: 300 um "
        "is 0.0003 m."
    ]
