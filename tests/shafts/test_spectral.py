"""Deflection by the Green's function and polynomials: exact at the ends of spans, passive everywhere."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor.equations.pencil import Pencil, eigenvalues


LENGTH, DIAMETER = 1.3, 0.11
# As programs, not one operation after the other.
roots_of = eqx.filter_jit(lambda system: eigenvalues(Pencil.of(system)))
line_of = eqx.filter_jit(lambda scene: scene.line())
between = eqx.filter_jit(lambda line, x, s: line.row(x) @ line.column(s))
FAN = jr.Scene(  # a fan on two oil films away from the ends of its shaft
    jr.FlexibleShaft(LENGTH, DIAMETER, constraints=()),
    [jr.Support(at, kxx=8e7, kyy=4e7, cxx=2e5, cyy=1e5) for at in (0.25, 0.95)],
    jr.Disc(1.3, 80.0, 3.2, 6.4),
    spin=jr.ConstantSpeed(157.0),
)


@pytest.mark.parametrize("nodes", [2, 3, pytest.param(8, marks=pytest.mark.slow), 12])
@pytest.mark.hard("1.6 strong dampers away from the ends of a shaft")
def test_dampers_take_energy_out_of_every_mode(nodes, record_property):
    """No root of a passive rotor grows, high modes of the shaft included."""
    values = np.asarray(roots_of(jr.assemble(FAN.with_nodes(nodes))))
    assert values.size == 4 * (4 * nodes - nodes + 1 + 2)
    record_property("measured", f"{nodes} nodes: largest growth {values.real.max():.3g} 1/s")
    assert values.real.max() < 0


RIGIDITY = float(jr.steel().youngs_modulus) * np.pi * DIAMETER**4 / 64


def cantilever(x, s):
    """Deflection at x of a uniform cantilever under a unit force at s."""
    near, far = np.minimum(x, s), np.maximum(x, s)
    return near**2 * (3 * far - near) / (6 * RIGIDITY)


def clamped(nodes):
    shaft = jr.FlexibleShaft(
        LENGTH, DIAMETER, nodes=nodes, constraints=[jr.Constraint(0.0, "clamp")]
    )
    scene = jr.Scene(shaft, jr.Disc(0.4, 1.0), jr.Disc(0.9, 1.0), spin=jr.ConstantSpeed(0.0))
    return line_of(scene)


def compliance(line, x, s):
    """Displacement at x due to a unit force at s."""
    return float(between(line, jnp.asarray(x), jnp.asarray(s)))


@pytest.mark.parametrize("nodes", [2, 5])
def test_deflections_at_the_ends_of_spans_are_exact(nodes):
    """Due to forces at them, in closed form, and due to a load that is uniform along the shaft."""
    line = clamped(nodes)
    for s in (0.4, 0.9, LENGTH):
        for x in (0.4, 0.9, LENGTH):
            assert compliance(line, x, s) == pytest.approx(cantilever(x, s), rel=1e-12)
    uniform = line.load_along(jnp.asarray(3.0))
    for x in (0.4, 0.9, LENGTH):
        expected = 3.0 * x**2 * (6 * LENGTH**2 - 4 * LENGTH * x + x**2) / (24 * RIGIDITY)
        assert float(line.row(jnp.asarray(x)) @ uniform) == pytest.approx(expected, rel=1e-12)


def test_within_a_span_the_response_is_mutual_and_converges():
    """`G(x, s) = G(s, x)` of forces inside one span, by 3 to 9 nodes."""
    x, s, errors = 0.5, 0.77, []
    for nodes in (3, 5, 9):
        line = clamped(nodes)
        found = compliance(line, x, s)
        assert found == pytest.approx(compliance(line, s, x), rel=1e-13)
        errors.append(abs(found / cantilever(x, s) - 1))
    assert errors[0] < 1e-3 and errors[2] < errors[1] / 3 < errors[0] / 3


def test_one_span_of_free_slopes_needs_three_nodes():
    pins = (jr.Constraint(0.0, "pin"), jr.Constraint(1.0, "pin"))
    shaft = jr.FlexibleShaft(1.0, 0.02, constraints=pins, nodes=2)
    still = jr.ConstantSpeed(0.0)
    with pytest.raises(ValueError, match="`nodes` must be at least 3 for a shaft of one span"):
        jr.Scene(shaft, spin=still)
    cells = jr.Scene(dataclasses.replace(shaft, rule="trapezoid"), spin=still)
    assert cells.resolution == (2,)
    assert jr.roots(jr.Scene(dataclasses.replace(shaft, nodes=3), spin=still)).size == 4
