"""Automatic nodes: fewer coordinates with the same first roots, and `shaft.nodes` as a parameter."""

import dataclasses

import equinox as eqx
import fem
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import jaxrotor as jr
from jaxrotor.analysis.forced import ending_span
from jaxrotor.analysis.resolved import resolved
from jaxrotor.shafts.cased import same_shape
from jaxrotor.shafts.resolution import nodes_needed


FAN = jr.load("overhung-fan").replace({"shaft.nodes": 8})
SIMPLE = jr.Scene(  # by default 5 and 8 nodes
    jr.FlexibleShaft(1.0, 0.03, constraints=[jr.Constraint(0.0, "clamp")]),
    jr.Disc(0.2, 5.0, 0.01, 0.02),
    jr.Unbalance(1.0, 5.0, 1e-4),
    jr.ExternalDamping(20.0),
    spin=jr.ConstantSpeed(150.0),
)


def coordinates(scene):
    """Number of them, without computing anything."""
    return jax.eval_shape(lambda: scene.line().stiffness).shape[0]


@pytest.mark.slow
def test_the_fan_has_fewer_coordinates_and_the_same_roots():
    automatic = FAN.replace({"shaft.nodes": "auto"})
    assert automatic.resolution == (7, 6, 6, 8, 6, 8)
    assert coordinates(automatic) < 0.9 * coordinates(FAN)
    np.testing.assert_allclose(jr.roots(automatic, 4), jr.roots(FAN, 4), rtol=1e-8)


@pytest.mark.parametrize(
    "name", ["limiter-rotor", "overhung-disc", "two-discs", "two-discs-unequal"]
)
def test_short_spans_aside_shipped_rotors_have_eight(name):
    """Their files give no nodes; the roots of the fan, which needs fewer, are above."""
    scene = jr.load(name)
    assert scene.shaft.nodes == "auto" and set(scene.resolution) == {8}


@pytest.mark.slow
@pytest.mark.parametrize("shear", [False, True])
def test_steps_and_uneven_spans(shear):
    """Roots of a stepped shaft on two soft and two hard supports, within 1e-8 of 8 nodes per span."""
    shaft = jr.FlexibleShaft(
        1.6,
        0.06,
        constraints=[],
        steps=[jr.Step(0.25, 0.11), jr.Step(0.3, 0.05), jr.Step(1.2, 0.09)],
        nodes=8,
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
    shaft = jr.FlexibleShaft(
        0.7, 0.02, nodes="auto", rotary_inertia=False, constraints=[jr.Constraint(0.0, "clamp")]
    )
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
    assert few == nodes_needed(10 * lengths, 0, False) == (5, 6, 7)
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

    both = jax.jit(jax.value_and_grad(frequency))
    slope = both(FAN.shaft.diameter)[1]
    step = 1e-5 * FAN.shaft.diameter
    ends = [float(both(FAN.shaft.diameter + h)[0]) for h in (step, -step)]
    assert float(slope) == pytest.approx((ends[0] - ends[1]) / (2 * float(step)), rel=1e-5)


def test_written_and_read(tmp_path):
    scene = FAN.replace({"shaft.nodes": "auto"})
    jr.save(scene, tmp_path / "fan.toml")
    assert 'nodes = "auto"' in (tmp_path / "fan.toml").read_text()
    assert jr.load(tmp_path / "fan.toml").resolution == scene.resolution


@pytest.mark.parametrize("rule", ["spectral", "trapezoid"])
def test_refusals(rule):
    with pytest.raises(ValueError, match='`nodes` must be a whole number or "auto", but is True'):
        jr.FlexibleShaft(
            1.0, 0.02, nodes=True, rule=rule, constraints=[jr.Constraint(0.0, "clamp")]
        )


def test_the_trapezoidal_rule_has_eight_cells_unless_it_says():
    scenes = [
        jr.Scene(jr.FlexibleShaft(1.0, 0.02, rule="trapezoid", **one), spin=jr.ConstantSpeed(1.0))
        for one in ({}, {"nodes": "auto"}, {"nodes": 8})
    ]
    assert {scene.line().cells for scene in scenes} == {8}


def test_eight_nodes_where_sections_are_traced():
    """Where nothing is known of the waves, every span has 8 nodes, and derivatives pass."""

    def scene(diameter):
        shaft = dataclasses.replace(SIMPLE.shaft, diameter=diameter)
        return jr.Scene(shaft, *SIMPLE.effects, spin=SIMPLE.spin)

    def frequency(diameter):
        assert scene(diameter).resolution == (8, 8)
        return jr.roots(scene(diameter), 1).imag[0]

    value, slope = jax.jit(jax.value_and_grad(frequency))(0.03)
    assert float(value) == pytest.approx(float(jr.roots(SIMPLE, 1).imag[0]), rel=1e-8)
    assert scene(0.03).resolution == SIMPLE.resolution != (8, 8)
    step = 1e-6
    ends = [float(jr.roots(scene(0.03 + h), 1).imag[0]) for h in (step, -step)]
    assert float(slope) == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-5)


@pytest.mark.long
def test_derivatives_by_what_decides_the_nodes():
    """Nodes stay those of the scene's own values, and derivatives are those with 8 nodes."""
    paths = ("disc.at", "shaft.length", "shaft.diameter")

    def slopes(scene, mode):
        frequency = lambda values: jr.roots(scene.replace(values), 1).imag[0]
        return jax.jit(mode(frequency))({path: scene.get(path) for path in paths})

    expected, found = (
        slopes(SIMPLE.replace({"shaft.nodes": 8}), jax.jacfwd),
        slopes(SIMPLE, jax.jacrev),
    )
    for path in paths:
        assert float(found[path]) == pytest.approx(float(expected[path]), rel=1e-6)


def test_derivatives_of_a_line_of_unequal_nodes():
    """By a station, in both modes, against differences."""
    assert SIMPLE.resolution == (5, 8)

    @jax.jit
    def column(at):
        return SIMPLE.replace({"disc.at": at}).line().column(at)

    at, step = jnp.asarray(0.2), 1e-6
    expected = (column(at + step) - column(at - step)) / (2 * step)
    for mode in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(mode(column)(at), expected, rtol=1e-6, atol=1e-12)


@pytest.mark.long
def test_eight_nodes_where_what_decides_them_is_varied():
    """A map over the material and a tuning of a station have the same nodes, and so the same numbers.

    As with 8 a span; a sweep over a station is below.
    """
    fixed, own = SIMPLE.replace({"shaft.nodes": 8}), float(SIMPLE.get("shaft.material.density"))
    over = {"shaft.material.density": [0.99 * own, own], "spin.speed": [100.0, 200.0]}
    maps = [jr.stability_map(scene, over).growth for scene in (SIMPLE, fixed)]
    np.testing.assert_array_equal(*maps)
    loss = lambda scene: jr.roots(scene, 1).imag[0] - 90.0
    own = float(SIMPLE.get("disc.at"))
    where = {"disc.at": (0.9 * own, 1.1 * own)}
    tuned = [jr.tune(loss, one, where, steps=2, progress=False) for one in (SIMPLE, fixed)]
    assert tuned[0].scene.resolution == (8, 8) and tuned[0].scene.shaft.nodes == 8
    assert float(tuned[0].loss) == float(tuned[1].loss)


@pytest.mark.long
def test_a_sweep_has_the_nodes_that_it_says():
    """8 a span where a station is swept, those of the scene where the speed is."""
    run = {"settle": 1, "keep": 1, "steps_per_revolution": 16, "progress": False}
    along = jr.sweep(SIMPLE, {"disc.at": [0.19, 0.2]}, **run)
    assert jr.loads(along.attrs["scene"]).resolution == (8, 8)
    fast = jr.sweep(SIMPLE, {"spin.speed": [100.0, 200.0]}, **run)
    assert jr.loads(fast.attrs["scene"]).resolution == SIMPLE.resolution


@eqx.filter_jit
def line_of(scene):
    return scene.line()


@eqx.filter_jit
def seen(line, q, stations):
    """Displacements and slopes at stations."""
    return [jax.vmap(row)(stations) @ q for row in (line.row, line.slope_row)]


def test_the_same_shape_on_a_finer_line():
    at = jnp.array([0.07, 0.2, 0.61, 1.0])
    for shear in (False, True):
        shaft = dataclasses.replace(SIMPLE.shaft, shear=shear, constraints=())
        scene = jr.Scene(shaft, *SIMPLE.effects, spin=SIMPLE.spin)
        line, finer = line_of(scene), line_of(scene.replace({"shaft.nodes": 8}))
        q = np.random.default_rng(3).normal(size=(line.stiffness.shape[0], 2)) @ [1, 1j]
        same = same_shape(q, line, finer)
        assert same.size > q.size
        found, expected = seen(finer, jnp.asarray(same), at), seen(line, jnp.asarray(q), at)
        np.testing.assert_allclose(found[0], expected[0], rtol=1e-9)
        np.testing.assert_allclose(found[1], expected[1], rtol=1e-8)


def test_a_span_that_ends_where_sections_are_traced():
    automatic = FAN.without("limiter").replace({"shaft.nodes": "auto"})

    def diameter(value):
        return ending_span(
            automatic.replace({"shaft.diameter": value}), jnp.asarray(0.7)
        ).shaft.diameter

    assert float(jax.grad(diameter)(FAN.shaft.diameter)) == 1.0


@pytest.mark.slow
def test_nodes_for_more_roots():
    """`w_k = (k pi / l)^2 sqrt(EI / rho A)` of a pinned beam: eight modes, of which "auto" has few."""
    pins = [jr.Constraint(0.0, "pin"), jr.Constraint(1.0, "pin")]
    shaft = jr.FlexibleShaft(1.0, 0.02, rotary_inertia=False, constraints=pins)
    scene = jr.Scene(shaft, jr.Unbalance(0.37, moment=0.0), spin=jr.ConstantSpeed(0.0))
    material = shaft.material
    ratio = float(material.youngs_modulus / material.density) * 0.02**2 / 16
    expected = (np.arange(1, 9) * np.pi) ** 2 * np.sqrt(ratio)
    both = np.repeat(expected, 2)  # forward and backward
    critical = jr.critical_speeds(scene, 8)
    poles = np.linalg.eigvals(jr.state_space(scene, 0.37, modes=16).A).imag
    found = {
        "roots": jr.roots(scene, 16).imag,
        "modes": jr.modes(scene, 16, 3).values.imag,
        "campbell": jr.campbell(scene, [0.0, 100.0], 16).frequencies[1],
        "critical": jnp.concatenate([critical.forward, critical.backward]),
        "state space": np.sort(np.abs(poles))[::2],
    }
    for name, values in found.items():
        frequencies = np.sort(np.abs(np.asarray(values)))
        np.testing.assert_allclose(frequencies, both, rtol=1e-7, err_msg=name)
    own = np.sort(np.abs(np.asarray(jr.roots(scene).imag)))  # with nodes of the scene
    assert abs(own[10] / both[10] - 1) > 1e-4
    assert all(resolved(scene, count) is scene for count in (None, 4))
    fixed = scene.with_nodes(5)
    assert resolved(fixed, 16) is fixed


@pytest.mark.slow
def test_faster_critical_speeds_of_a_stepped_shaft_are_those_of_finite_elements():
    """Six forward and six backward ones, with gyroscopic moments, on a short thick end and a long span."""
    length, first, then, at, material = 1.6, 0.09, 0.06, 0.15, (2.05e11, 7830.0)
    disc, bearings = (at, 20.0, 0.1, 0.2), [(0.0, 5e7), (length, 5e7)]
    steps = [jr.Step(at, then)]
    shaft = jr.FlexibleShaft(length, first, jr.Material(*material), steps=steps, constraints=())
    supports = [jr.Support(*one) for one in bearings]
    scene = jr.Scene(shaft, jr.Disc(*disc), *supports, spin=jr.ConstantSpeed(300.0))
    stretches = [fem.Stretch(at, first), fem.Stretch(length, then)]
    springs = [(place, stiff * np.eye(2)) for place, stiff in bearings]
    _, speeds, shares, _ = fem.critical_speeds(
        stretches, [disc], springs, (*material, np.inf), length / 80, 16
    )
    found, own = jr.critical_speeds(scene, 6), jr.critical_speeds(scene)
    for ahead, kind in ((True, "forward"), (False, "backward")):
        expected = speeds[(shares > 0.5) == ahead][:6]
        np.testing.assert_allclose(getattr(found, kind), expected, rtol=1e-6)
        assert abs(getattr(own, kind)[5] / expected[5] - 1) > 1e-3  # with nodes of the scene


def test_a_traced_shaft_keeps_its_nodes():
    def number(diameter, speed):
        traced = SIMPLE.replace({"shaft.diameter": diameter})
        assert resolved(traced, 16) is traced
        return resolved(SIMPLE.at_speed(speed), 16).line().stiffness

    finer = jax.eval_shape(number, 0.03, 150.0).shape[0]
    assert finer == coordinates(resolved(SIMPLE, 16)) > coordinates(SIMPLE)
