"""Printed form of parts and results, and their display in notebooks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shown import shown
from systems import one_disc

import jaxrotor as jr
from jaxrotor.core.tables import notebook_table


@pytest.mark.parametrize(
    ("part", "text"),
    [
        (jr.Disc(at=0.5, mass=10), "Disc(at=0.5 m, mass=10 kg)"),
        (jr.Disc(0.5, 10, polar=1 / 3), "Disc(at=0.5 m, mass=10 kg, polar=0.333333 kg m^2)"),
        (jr.Support(0, kxx=8e7, rotating=True), "Support(at=0 m, kxx=8e+07 N/m, rotating=True)"),
        (jr.Limiter(0.5, 0, 1e-3, 1, friction=0.1), "Limiter(at=0.5 m, angle=0 rad, gap=0.001 m, "),
        (
            jr.FlexibleShaft(1, 0.1, steps=[jr.Step(0.5, 0.2)], constraints=[jr.Constraint(1)]),
            "FlexibleShaft(length=1 m, diameter=0.1 m, steps=[Step(at=0.5 m, diameter=0.2 m)], "
            "constraints=[Constraint(at=1 m)])",
        ),
        (
            jr.RigidShaft(1, [jr.Constraint(0.0, "clamp")]),
            "RigidShaft(length=1 m, constraints=[Constraint(at=0 m, holds='clamp')])",
        ),
        (
            jr.SpeedProfile(np.arange(8.0), np.arange(8.0) ** 2),
            "SpeedProfile(times=[0, 1, 2, .., 7] s, speeds=[0, 1, 4, .., 49] rad/s)",
        ),
        (jr.Material(7e10, 2700), "Material(youngs_modulus=7e+10 Pa, density=2700 kg/m^3)"),
        (jr.Whirl(1e-3, -5), "Whirl(radius=0.001 m, rate=-5 rad/s)"),
    ],
)
def test_parts_show_values_and_units(part, text):
    assert repr(part).startswith(text)


def test_scene_shows_its_parts():
    scene = jr.Scene(
        jr.RigidShaft(1.0), jr.Disc(0.5, 10.0), spin=jr.ConstantSpeed(3.0), assumption="a chain"
    )
    assert repr(scene).splitlines() == [
        "Scene(",
        "    RigidShaft(length=1 m),",
        "    Disc(at=0.5 m, mass=10 kg),",
        "    spin=ConstantSpeed(speed=3 rad/s),",
        "    assumption='a chain',",
        ")",
    ]


def test_values_that_are_no_numbers_are_shown_as_they_are():
    seen, disc = [], jr.Disc(0.5, 10.0)

    def look(disc):
        seen.append(repr(disc))
        return disc.mass

    jax.jit(look)(disc)
    jax.vmap(look)(jax.tree.map(lambda leaf: jnp.stack([leaf] * 2), disc))
    look(jax.tree.map(lambda leaf: jnp.stack([leaf, leaf + 1]), disc))
    look(jax.eval_shape(lambda disc: disc, disc))
    look(jax.tree.map(lambda leaf: None, disc))
    for text, mass in zip(
        seen,
        ("JitTracer(float64[]) kg", "VmapTracer(", "[10, 11] kg", "ShapeDtypeStruct(", "None kg"),
        strict=True,
    ):
        assert text.startswith("Disc(at=") and f", mass={mass}" in text


# === notebooks


def test_scene_in_a_notebook():
    scene = jr.load("limiter-rotor")
    said, heads, rows = shown(scene)
    assert said == "FlexibleShaft, ConstantSpeed" and heads == ["parameter", "value", "unit"]
    assert ["limiters.gap", "0.0075, 0.0075, 0.0075", "m"] in rows
    present = [p for p in scene.paths() if any(leaf is not None for leaf in scene.leaves(p))]
    assert [row[0] for row in rows] == present


@pytest.mark.slow  # three linear programs are compiled
def test_linear_results_in_a_notebook():
    scene = one_disc()
    said, heads, rows = shown(jr.modes(scene))
    assert said.startswith("Modes at 0.8 rad/s") and heads[1:3] == [
        "growth [1/s]",
        "frequency [rad/s]",
    ]
    assert {(row[1], row[2].lstrip("-")) for row in rows} == {("-0.05", "0.998749")}
    assert {row[-1] for row in rows} == {"forward", "backward"}
    critical = shown(jr.critical_speeds(scene))[2]
    assert ["1", "9.5493", "forward", "1"] in critical
    speeds = np.array([0.5, 1.0, 1.5])
    found = jr.unbalance_response(scene, speeds)
    (row,) = shown(found)[2]
    assert row == [f"{v:.6g}" for v in (0.5, abs(found.forward[1, 0]), 1.0, 30 / np.pi, 1.0)]
    (row,) = shown(jr.weight_response(one_disc(jr.Gravity()), speeds))[2]
    assert row[0] == "0.5" and row[1] == "0"


def test_motions_in_a_notebook():
    response = jr.simulate(one_disc(), 3, 16)
    said, heads, rows = shown(response)
    assert said == str(response) and heads[:2] == ["station [m]", "largest displacement [m]"]
    radius = np.abs(response.displacement[:, 0])
    (row,) = rows
    assert row[:2] == ["0.5", f"{radius.max():.6g}"]
    assert row[2] == f"{response.time[np.argmax(radius)]:.6g}"


def test_long_tables_show_their_ends():
    rows = [(f"row {k}", k) for k in range(100)]
    text = notebook_table("A <b>", ("", "number"), rows, most=6)
    assert "A &lt;b&gt;" in text and ".. 94 more .." in text
    assert "row 2<" in text and "row 97<" in text and "row 3<" not in text
    assert "<table>" not in notebook_table("nothing", ("a",), [])


@pytest.mark.slow  # an integration is compiled
def test_run_up_in_a_notebook():
    run = jr.run_up(one_disc(), np.linspace(0.0, 4.0, 9))
    said, _, (row,) = shown(run)
    sizes = np.abs(run.displacement[:, 0])
    k = np.argmax(sizes)
    assert said == str(run) and row[:3] == [f"{v:.6g}" for v in (0.5, sizes[k], run.time[k])]
