"""Implausible numbers: each gives a warning with the unit that may be meant, plausible ones give none."""

import warnings

import jax
import pytest
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
            lambda: scene(shaft(diameter=80.0), speed=1.0),
            "`shaft.diameter` is 80 m, 67 times the length of the shaft, 1.2 m; check its unit: "
            "80 mm is 0.08 m.",
        ),
        (
            lambda: scene(shaft(), jr.Unbalance(0.6, 2.0, 50.0)),
            "`unbalance.eccentricity` is 50 m, 42 times the length of the shaft",
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
def test_machines_and_dimensionless_scenes_give_no_warning():
    """All shipped scenes, a turbine of a power station, and a Jeffcott rotor with values of order 1."""
    for name, _ in jr.shipped():
        jr.load(name)
    scene(shaft(12.0, 0.9), mass=4e4, speed=314.0, stiffness=1e9)
    ones = jr.FlexibleShaft(1.0, 1.0, jr.Material(1.0, 1.0))
    jr.Scene(ones, jr.Disc(1.0, 1.0, 1.0, 2.0), jr.Support(1.0, 1.0), spin=jr.ConstantSpeed(1.0))


def test_a_changed_value_is_doubted_and_a_traced_one_is_not():
    rotor = scene(shaft())
    with pytest.warns(jr.ImplausibleWarning, match=r"`shaft.diameter` is 80 m") as found:
        rotor.replace({"shaft.diameter": 80.0, "spin.speed": 1.0})
    assert found[0].filename == __file__
    traced = lambda d: rotor.replace({"shaft.diameter": d}).shaft.diameter
    assert float(jax.jit(traced)(80.0)) == 80.0


def test_a_command_notes_it_once():
    call = ["show", "limiter-rotor", "--toml", "--set", "limiters.gap=300"]
    with warnings.catch_warnings(record=True) as kept:
        result = CliRunner().invoke(app, call)
    assert result.exit_code == 0 and not kept
    notes = result.stderr.splitlines()
    assert len(notes) == len(set(notes)) == 3
    start = "Note: `limiters.0.gap` is 300 m, 429 times the length of the shaft, 0.7 m"
    assert notes[0] == f"{start}; check its unit: 300 mm is 0.3 m."
