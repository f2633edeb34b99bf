"""Automatic nodes: fewer coordinates with the same first roots, and `shaft.nodes` as a parameter."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import jaxrotor as jr
from jaxrotor.analysis.forced import ending_span
from jaxrotor.shafts.resolution import nodes_needed


FAN = jr.load("overhung-fan").replace({"shaft.nodes": 8})


def test_the_fan_has_fewer_coordinates_and_the_same_roots():
    automatic = FAN.replace({"shaft.nodes": "auto"})
    assert automatic.resolution == (7, 6, 6, 8, 6, 8)
    assert automatic.line().stiffness.shape[0] < 0.9 * FAN.line().stiffness.shape[0]
    np.testing.assert_allclose(jr.roots(automatic, 4), jr.roots(FAN, 4), rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("shear", [False, True])
def test_steps_and_uneven_spans(shear):
    """Roots of a stepped shaft on two soft and two hard supports, within 1e-8 of 8 nodes per span."""
    shaft = jr.FlexibleShaft(
        1.6,
        0.06,
        constraints=[],
        steps=[jr.Step(0.25, 0.11), jr.Step(0.3, 0.05), jr.Step(1.2, 0.09)],
        shear=shear,
    )
    at, stiffness = (0.1, 0.4, 0.9, 1.5), (1e6, 1e9, 1e9, 1e6)
    supports = [jr.Support(x, k, damping=1e3) for x, k in zip(at, stiffness, strict=True)]
    scene = jr.Scene(shaft, supports, jr.Disc(0.6, 12.0, 0.1, 0.2), spin=jr.ConstantSpeed(200.0))
    automatic = scene.replace({"shaft.nodes": "auto"})
    assert sum(automatic.resolution) < sum(scene.resolution)
    np.testing.assert_allclose(jr.roots(automatic, 4), jr.roots(scene, 4), rtol=1e-8)


def test_a_uniform_beam_against_its_closed_form():
    """Clamped at one end: `cos b cosh b = -1`; a disc without mass makes spans of 0.1 and 0.9."""
    shaft = jr.FlexibleShaft(0.7, 0.02, nodes="auto", rotary_inertia=False)
    scene = jr.Scene(shaft, jr.Disc(0.07, 1e-12), spin=jr.ConstantSpeed(0.0))
    assert scene.resolution == (4, 8)
    b = np.array([brentq(lambda b: np.cos(b) + 1 / np.cosh(b), *ends) for ends in ((1, 3), (4, 6))])
    steel = jr.steel()
    unit = np.sqrt(float(steel.youngs_modulus / steel.density)) * 0.02 / 4 / 0.7**2
    found = np.sort(np.abs(np.asarray(jr.roots(scene, 4)).imag))[::2]
    np.testing.assert_allclose(found, b**2 * unit, rtol=1e-8)


def test_more_constraints_need_more_nodes():
    lengths = np.array([0.2, 0.3, 0.5])
    few, many = (nodes_needed(lengths, held, False) for held in (2, 6))
    assert few == nodes_needed(10 * lengths, 0, False) == (6, 7, 8)
    assert all(m >= f for m, f in zip(many, few, strict=True)) and many != few
    assert nodes_needed(lengths, 2, True) >= few


def test_replaced_with_other_values():
    """`shaft.nodes` together with numbers; automatic nodes follow a changed diameter."""
    changed = FAN.replace({"shaft.nodes": 5, "disc.mass": 90.0})
    assert changed.shaft.nodes == 5 and set(changed.resolution) == {5}
    assert float(changed.get("disc.mass")) == 90.0
    automatic = FAN.replace({"shaft.nodes": "auto"})
    thick = automatic.replace({"shaft.diameter": 2.5 * float(FAN.shaft.diameter)})
    assert thick.resolution != automatic.resolution


@pytest.mark.slow
def test_nodes_stay_where_values_are_traced():
    automatic = FAN.replace({"shaft.nodes": "auto"})

    def frequency(diameter):
        scene = automatic.replace({"shaft.diameter": diameter})
        assert scene.resolution == automatic.resolution
        return jr.roots(scene, 1).imag[0]

    slope = jax.grad(frequency)(FAN.shaft.diameter)
    step = 1e-5 * FAN.shaft.diameter
    ends = [float(frequency(FAN.shaft.diameter + h)) for h in (step, -step)]
    assert float(slope) == pytest.approx((ends[0] - ends[1]) / (2 * float(step)), rel=1e-5)


def test_written_and_read(tmp_path):
    scene = FAN.replace({"shaft.nodes": "auto"})
    jr.save(scene, tmp_path / "fan.toml")
    assert 'nodes = "auto"' in (tmp_path / "fan.toml").read_text()
    assert jr.load(tmp_path / "fan.toml").resolution == scene.resolution


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"nodes": "auto", "rule": "trapezoid"}, "a whole number in the trapezoidal rule"),
        ({"nodes": True}, '`nodes` must be a whole number or "auto", but is True'),
    ],
)
def test_refusals(given, said):
    with pytest.raises(ValueError, match=said):
        jr.FlexibleShaft(1.0, 0.02, **given)


def test_a_traced_shaft_is_refused():
    def scene(diameter):
        shaft = dataclasses.replace(FAN.shaft, nodes="auto", diameter=diameter)
        return jr.Scene(shaft, *FAN.effects, spin=FAN.spin).shaft.length

    with pytest.raises(ValueError, match='`nodes="auto"` needs a shaft of known sections'):
        jax.jit(scene)(0.1)


@pytest.mark.parametrize("path", ["disc.at", "shaft.diameter"])
def test_what_decides_the_nodes_is_not_varied(path):
    automatic = FAN.replace({"shaft.nodes": "auto"})
    own = float(automatic.get(path))
    said = f'`nodes="auto"` depend on `{path}`, which is varied here; give a number'
    with pytest.raises(ValueError, match=said):
        jr.stability_map(automatic, {path: [0.999 * own, own], "spin.speed": [100.0, 200.0]})
    with pytest.raises(ValueError, match=said):
        jr.sweep(automatic, {path: [0.999 * own, own]}, settle=1, keep=1)


def test_a_span_that_ends_where_sections_are_traced():
    automatic = FAN.without("limiter").replace({"shaft.nodes": "auto"})

    def diameter(value):
        return ending_span(
            automatic.replace({"shaft.diameter": value}), jnp.asarray(0.7)
        ).shaft.diameter

    assert float(jax.grad(diameter)(FAN.shaft.diameter)) == 1.0
