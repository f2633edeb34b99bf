"""Fused steps: the kernel, interpreted, has the states of ordinary lanes; it can be lowered for a GPU."""

import re

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import EFFECTS, one_disc

import jaxrotor as jr
from jaxrotor.core.lanes import lanes_last
from jaxrotor.core.precision import single
from jaxrotor.effects.base import AbstractContact
from jaxrotor.effects.law import Now
from jaxrotor.equations.system import port_groups
from jaxrotor.motion.base import Plan
from jaxrotor.motion.revolutions import March
from jaxrotor.solvers.choice import solver_name
from jaxrotor.solvers.exponential import _stepped, revolution
from jaxrotor.solvers.fused import BLOCK, ELEMENTWISE, LaneStep, evaluate, scan_lanes


STEPS = 16
START = jr.Whirl(8e-3, -75.0)
# Two stops at one station, in and out of contact within a revolution.
STOPS = [jr.Limiter(0.5, angle, 7e-3, 4e5, 20.0, 0.2, rim_radius=0.1) for angle in (0.0, 2.5)]
ROTOR = one_disc(*STOPS, mass=10.0, damping=60.0, stiffness=1e5, speed=50.0, eccentricity=1e-3)


def march_of(scene, order=2, *, steps=STEPS, **choice):
    """A march as of the lanes of a sweep, that reads one station, and its state at the start."""
    plan = Plan(
        solver=jr.Exponential(order, **{"basis": "modal"} | choice),
        controller=None,
        adjoint=dfx.ForwardMode(),
        max_steps=4096,
        steps=steps,
        slopes=False,
        contacts=False,
        coordinates=False,
        together=port_groups(scene),
        batch=True,
    )
    station = scene.stations(None)
    march = March.build(scene, plan, jnp.abs(scene.spin.speed), station)
    return march, march.begin(START, station[0])


def varied(march, factor):
    """The march with an unbalance and stops of its own."""
    own = lambda m: (
        m.step.forcing.reading.cos,
        m.step.forcing.reading.sin,
        m.step.forcing.ports[0].laws[0].contact.stiffness,
    )
    return eqx.tree_at(own, march, [factor * leaf for leaf in own(march)])


def by_kernel(parts, y):
    """A revolution by the interpreted kernel, lanes last."""
    arrays, constant = eqx.partition(parts, eqx.is_array)
    phases = parts[0].tableau.phases(parts[0].tableau.h * jnp.arange(STEPS))
    one = lambda arrays, y, phase: _stepped(eqx.combine(arrays, constant), y, phase)
    return scan_lanes(one, arrays, y, phases, interpret=True)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_kernel_has_the_states_and_readings_of_ordinary_lanes(order):
    """More lanes than a block has, and not a multiple of them; what differs in them is of their own."""
    march, y = march_of(ROTOR, order)
    lanes = BLOCK + 3
    factors = jnp.linspace(0.5, 1.5, lanes)
    begin = y * jnp.linspace(1.0, 1.3, lanes)[:, None]

    @jax.jit
    @jax.vmap
    def both(factor, y, other):
        step, stations = varied(march, factor).step, march.form.stations
        ordinary = revolution(step, other, STEPS, stations, batch=True)[:2]
        return lanes_last(by_kernel, (step, stations), y), ordinary

    end = expected = begin
    for _ in range(4):
        (end, seen), (expected, readings) = both(factors, end, expected)
    scale, largest = jnp.abs(expected).max(), jnp.abs(readings).max()
    np.testing.assert_allclose(end, expected, rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(seen, readings[:, :-1], rtol=0, atol=1e-12 * largest)
    # Contact matters in every lane.
    (_, _), (once, _) = both(factors, begin, begin)
    assert jnp.abs(once - jax.vmap(march.free)(begin)).max(1).min() > 0.01 * jnp.abs(once).max()


@pytest.mark.slow
def test_without_a_gpu_lanes_are_the_ordinary_ones():
    lanes = []
    for fused in (True, False):
        march, y = march_of(ROTOR, fused=fused)
        lanes.append(
            jax.jit(jax.vmap(lambda y, march=march: march.advance(y)[0]))(y * jnp.ones((3, 1)))
        )
    np.testing.assert_array_equal(*lanes)


def for_a_gpu(call, *given, lanes=256):
    """Text of the program for a GPU of `call` in many lanes."""
    many = [jnp.broadcast_to(one, (lanes, *jnp.shape(one))) for one in given]
    traced = jax.jit(jax.vmap(call)).trace(*many)
    return traced.lower(lowering_platforms=("cuda",)).as_text()


def primitives(equations):
    """Names of the operations of equations, those of inner ones in place of their calls."""
    for equation in equations.eqns:
        inner = [getattr(value, "jaxpr", None) for value in equation.params.values()]
        inner = [one for one in inner if one is not None]
        yield from [equation.primitive.name] if not inner else []
        for one in inner:
            yield from primitives(one)


def kernels(text):
    return len(re.findall("__gpu.xla.gpu.triton", text)), len(re.findall("stablehlo.while", text))


def test_a_revolution_is_one_kernel_on_a_gpu():
    march, y = march_of(ROTOR, fused=True)
    assert kernels(for_a_gpu(lambda y: march.advance(y)[0], y)) == (1, 0)
    assert kernels(for_a_gpu(lambda y: march.sample(y)[:2], y)) == (1, 0)
    last = lambda carry, window, number: (carry, window.displacement[-1])
    observed = lambda y: march.collect(y, (), last, 2)[1]
    assert kernels(for_a_gpu(observed, y)) == (1, 1)  # in a loop over revolutions
    ordinary, y = march_of(ROTOR)
    assert kernels(for_a_gpu(lambda y: ordinary.sample(y)[:2], y)) == (0, 1)


def test_lanes_with_matrices_of_their_own_take_ordinary_steps_on_a_gpu():
    march, y = march_of(ROTOR, 4, fused=True)

    def ahead(factor, y):
        own = lambda m: (m.step.tableau.outputs, m.step.tableau.weights)
        return eqx.tree_at(own, march, [factor * leaf for leaf in own(march)]).advance(y)[0]

    assert kernels(for_a_gpu(ahead, 1.0, y)) == (0, 1)


@pytest.mark.slow
@pytest.mark.parametrize(("order", "precise"), [(2, True), (4, False)])
def test_the_limiter_rotor_and_single_precision_on_a_gpu(order, precise):
    march, y = march_of(jr.load("limiter-rotor"), order, fused=True)
    march, y = (march, y) if precise else single((march, y))
    assert kernels(for_a_gpu(lambda y: march.sample(y)[:2], y)) == (1, 0)


def test_every_operation_on_a_number_is_there_on_a_gpu():
    """A step that has all of them can be lowered."""

    def one(parts, y, phase):
        x, whole = jnp.abs(y) + 0.5, (y > 0).astype(jnp.int32)
        u = jnp.sin(x) + jnp.cos(x) * jnp.tan(x) - jnp.tanh(x) / jnp.exp(x) + jnp.expm1(x)
        u += jnp.sinh(x) + jnp.cosh(x) + jnp.exp2(x) + jnp.log(x) + jnp.log1p(x) + jnp.sqrt(x)
        u += (
            jax.lax.rsqrt(x)
            + x**3
            + x ** phase[0]
            + jnp.square(x)
            + jnp.arctan2(x, -x)
            + jnp.sign(y)
        )
        u += jnp.floor(x) + jnp.ceil(x) + jnp.minimum(jnp.maximum(x, 1.0), 2.0)
        a, b, c, d = u < 1, u >= 0, u <= x, (u == x) ^ (u != y)
        return jnp.where((a & b) | (~c ^ d), u, whole), None

    traced = jax.make_jaxpr(one)((), jnp.zeros((1, 1)), jnp.ones(1))
    names = set(primitives(traced.jaxpr))
    assert set(ELEMENTWISE.split()) <= names, set(ELEMENTWISE.split()) - names
    call = lambda y: scan_lanes(one, (), y, jnp.ones((3, 1)))
    lowered = jax.jit(call).trace(jnp.ones((1, 9))).lower(lowering_platforms=("cuda",))
    assert kernels(lowered.as_text()) == (1, 0)


def test_laws_number_by_number_are_the_laws():
    """Every contact, in and out of it, by plain numbers of NumPy."""
    contacts = [effect for effect in EFFECTS if isinstance(effect, AbstractContact)]
    assert len(contacts) >= 5
    for contact in contacts:
        law = contact.law()
        for size in (4e-3, 4e-4):
            motion = size * jnp.array([1.0, 0.7]), jnp.array([0.3, -0.2])
            force = lambda law, u, v: law(u, v, Now(jnp.asarray(30.0)))
            traced = jax.make_jaxpr(force)(law, *motion)
            leaves = [np.asarray(leaf) for leaf in jax.tree.leaves((law, *motion))]
            numbers = [np.vectorize(np.float64, otypes="O")(leaf) for leaf in leaves]
            (found,) = evaluate(traced.jaxpr, traced.consts, numbers)
            expected = force(law, *motion)
            np.testing.assert_allclose(found.astype(float), expected, rtol=1e-12, atol=1e-12)


def test_operations_on_arrays_number_by_number():
    """Against NumPy: products, sums, extremes, and what only arranges numbers."""
    a, b = np.arange(12.0).reshape(2, 3, 2) - 5, np.linspace(-1, 1, 18).reshape(2, 3, 3)

    def call(a, b):
        joined = jnp.concatenate([a.sum(1), a.max(1), jnp.flip(a[:, 0], 1)], axis=1)
        both = (a < 0).any(2) | (a < -4).all(2)
        return jnp.einsum("nij,nik->njk", a, b), joined, jnp.where(both, a.min(2), a[..., 1].T.T)

    traced = jax.make_jaxpr(call)(a, b)
    args = [np.vectorize(np.float64, otypes="O")(part) for part in (a, b)]
    product, joined, chosen = evaluate(traced.jaxpr, traced.consts, args)
    np.testing.assert_allclose(product.astype(float), np.einsum("nij,nik->njk", a, b), rtol=1e-14)
    np.testing.assert_array_equal(joined.astype(float), np.c_[a.sum(1), a.max(1), a[:, 0, ::-1]])
    both = (a < 0).any(2) | (a < -4).all(2)
    np.testing.assert_array_equal(chosen.astype(float), np.where(both, a.min(2), a[..., 1]))


def test_what_a_step_does_not_use_is_not_read():
    march, y = march_of(ROTOR)
    arrays, constant = eqx.partition((march.step, None), eqx.is_array)
    one = lambda arrays, y, phase: _stepped(eqx.combine(arrays, constant), y, phase)
    last = jax.tree.map(lambda leaf: leaf[..., None], arrays)
    step = LaneStep.of(one, last, y[:, None], march.step.tableau.phases(0.0))
    used = sum(array.size for array in step.arrays)
    assert (
        used
        < sum(leaf.size for leaf in jax.tree.leaves(arrays))
        - march.step.forcing.field.generator.size
    )
    assert len(step.equations.invars) == len(step.arrays) + 2


def test_a_step_that_iterates_is_refused():
    one = lambda parts, y, phase: (
        jax.lax.while_loop(lambda y: y[0, 0] < 1, lambda y: 2 * y, y),
        None,
    )
    y, phases = jnp.ones((1, 2)), jnp.zeros((3, 1))
    with pytest.raises(ValueError, match="has the operation `while`.*leave `fused` out"):
        scan_lanes(one, (), y, phases, interpret=True)


def test_settings_of_fused_steps():
    assert solver_name(jr.Exponential(4, fused=True)).endswith(", fused=True)")
    assert "fused" not in solver_name(jr.Exponential(4))
    with pytest.raises(ValueError, match="`fused=True` is for steps of one size"):
        jr.Exponential(4, located=True, fused=True)
