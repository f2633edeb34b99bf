"""Rotors with unequal axes of both kinds by exponential steps, beside scipy, Radau and diffrax."""

import dataclasses

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from unequal_rotor import SPEED, ByHand, rotor, unequal

import jaxrotor as jr
from jaxrotor.effects.law import Now
from jaxrotor.equations.constant_frame import WORST_GAIN, in_constant_axes, loop_gain
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.motion.choice import has_small_remainder, system_of_march
from jaxrotor.solvers.remainder import RemainderMap


FAST = 662.0  # rad/s
SPRINGS = {"kxx": 4e4, "kyy": 1e4, "kxy": 1e4, "kyx": -2e4, "cxx": 60.0, "cyy": 60.0}


def flexible(**bearing):
    """A clamped shaft of two stiffnesses with a disc at its end and an unequal bearing half way."""
    base = jr.load("limiter-rotor").without("limiters")
    shaft = dataclasses.replace(base.shaft, nodes=3, anisotropy=jnp.asarray(0.1))
    more = [jr.Support(0.35, **(SPRINGS | bearing)), jr.Gravity(9.81)]
    scene = jr.Scene(shaft, *base.effects, *more, spin=base.spin)
    return scene.replace({"spin.speed": FAST, "unbalance.eccentricity": 1e-3})


def stiff(share, stiffness=1e7):
    """A disc in a stiff bearing with hardly any damping."""
    return rotor(jr.Support(0.5, stiffness, anisotropy=share), anisotropy=0.15, stops=False)


def parts(scene, order):
    """Solver, its form, a state at rest in it, and the settings of a map."""
    system, rate = in_constant_axes(jr.assemble(scene)), jnp.abs(scene.spin.speed)
    solver = jr.Exponential(order, "modal")
    form = solver.form(system, Motion(system, rate, loads=False), jnp.eye(system.n))
    rest = form.encode(*jr.AtRest().state(system, jnp.asarray(0.5)))
    return solver, form, rest, (system, rate, solver, form.basis)


@eqx.filter_jit
def after_two_revolutions(scene, steps, order):
    """Coordinates after two revolutions from rest; one program for any number of steps."""
    solver, form, rest, _ = parts(scene, order)
    step = solver.stepper(form, steps)
    one = lambda k, y: step.several((k * step.tableau.h)[None], y)[0]
    return form.decode(jax.lax.fori_loop(0, 2 * steps, one, rest))[0]


@eqx.filter_jit
def by_the_map(scene, steps, order):
    """The same by the map of a revolution, and the map."""
    _, form, rest, settings = parts(scene, order)
    whole = RemainderMap.of(*settings, steps, jnp.asarray(2 * jnp.pi))
    return form.decode(whole(whole(rest)))[0], whole


@pytest.fixture(scope="module")
def free():
    """A flexible rotor, and where two revolutions from rest leave its coordinates."""
    scene = flexible()
    return scene, ByHand(scene).end(4 * np.pi / FAST, rtol=1e-12, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("order", "first", "falls", "multipliers"),
    [(2, 1e-3, 14.0, 1e-3), (4, 3e-6, 150.0, 1e-6)],
)
def test_the_error_falls_with_the_order(free, order, first, falls, multipliers):
    """At 16, 64 and 256 steps; multipliers at 16 steps are those of an integration by Radau."""
    scene, end = free
    counts = map(jnp.asarray, (16, 64, 256))
    off = [np.abs(after_two_revolutions(scene, n, order) - end).max() for n in counts]
    off = np.array(off) / np.abs(end).max()
    assert off[0] < first and (off[:-1] > falls * off[1:]).all()
    exact = np.asarray(jr.floquet_multipliers(scene))[:4]
    found = np.linalg.eigvals(by_the_map(scene, 16, order)[1].matrix)
    found = found[np.argsort(-np.abs(found))][:4]
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(exact), rtol=multipliers)


def test_the_map_of_a_revolution_is_that_of_its_steps():
    """Twice it leads from rest to where two revolutions of steps do, and nothing is amplified."""
    scene = unequal("both", stops=False)
    end, whole = by_the_map(scene, 32, 4)
    other = after_two_revolutions(scene, jnp.asarray(32), 4)
    np.testing.assert_allclose(end, other, rtol=1e-10)
    assert not whole.amplified


def test_what_is_unequal_adds_up_to_the_blocks():
    """Of bearings at a shaft, on a casing and of a casing, turned by an angle."""
    scene = jr.Scene(
        jr.FlexibleShaft(
            1.0, 0.02, nodes=2, anisotropy=0.2, constraints=[jr.Constraint(0.0, "clamp")]
        ),
        jr.Casing("housing", 3.0),
        jr.Support(0.5, 1e4, damping=20.0, anisotropy=0.3, angle=0.4, on="housing"),
        jr.Support(0.2, 2e4, anisotropy=-0.2, damping=9.0, damping_anisotropy=0.5),
        jr.Support(0.4, 3e4, rotating=True, anisotropy=0.1),
        jr.Support(0.1, 3e4),
        jr.Support(of="housing", kxx=3e4, kyy=1e4, cxx=5.0, cyy=2.0),
        spin=jr.ConstantSpeed(SPEED),
    )
    system = jr.assemble(scene)
    assert len(system.deviators) == 3
    unit = np.eye(2)
    for name, still in (("fixed_stiffness", False), ("fixed_damping", True)):
        total = np.zeros((system.n, system.n), complex)
        for port in system.deviators:
            motion = (0 * unit[0], unit[0]) if still else (unit[0], 0 * unit[0])
            force = -port.forces(*map(jnp.asarray, motion), Now(jnp.ones(()))).sum(0)
            total += np.outer(port.column, port.row) * complex(*np.asarray(force))
        np.testing.assert_allclose(total, getattr(system.blocks, name), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("kind", ["fixed", "turning"])
def test_axes_of_one_kind_leave_no_remainder(kind):
    system = jr.assemble(unequal(kind))
    assert not system.deviators and in_constant_axes(system) is system


def test_loop_gain_of_one_disc():
    """`|k_d|` times the larger flexibility of shaft and mean bearing along the turning axes."""
    gain = loop_gain(in_constant_axes(jr.assemble(unequal("both", stops=False))))
    mean, cross = 2e4 + 2.5e4, -1.5e4  # shaft and bearing; of the bearing (kyx - kxy) / 2
    stiffness = np.array([[mean + 0.15 * 2e4, -cross], [cross, mean - 0.15 * 2e4]])
    modulus = np.hypot((4e4 - 1e4) / 2, (1e4 - 2e4) / 2)
    flexibility = 1 / np.linalg.svd(stiffness, compute_uv=False)[-1]
    assert float(gain) == pytest.approx(modulus * flexibility, rel=1e-12)


def test_a_large_remainder_is_integrated_unless_a_solver_is_named():
    """With stiffness of the bearing the gain becomes its anisotropy."""
    for share in (0.5, 0.7):
        scene = stiff(share)
        system = jr.assemble(scene)
        gain = float(loop_gain(in_constant_axes(system)))
        assert gain == pytest.approx(share, rel=3e-3)
        assert has_small_remainder(system) == (share < WORST_GAIN)
        taken, _ = system_of_march(scene, system, None)
        assert (taken is None) == (share > WORST_GAIN)
        assert system_of_march(scene, system, jr.Exponential())[0].remainder == 1


@pytest.mark.slow
def test_steps_that_amplify_are_refused():
    """Undamped at 5000 rad/s, with 16 steps in 42 ms; by SciPy it does not grow."""
    scene = stiff(0.5)
    with pytest.raises(
        RuntimeError, match="By 16 .* a motion grows .* axes of support, .* more steps"
    ):
        jr.simulate(scene, 2, 16, solver=jr.Exponential(4))


@pytest.mark.slow
def test_lanes_whose_steps_amplify_have_no_result():
    over = {"support.stiffness": [3e4, 1e7]}
    quiet = {"settle": 2, "keep": 1, "steps_per_revolution": 16, "progress": False}
    found = jr.sweep(stiff(0.5), over, observe=[jr.observe.Extrema()], **quiet)
    assert list(found["status"].values) == [0, 1] and "order=4" in found.attrs["solver"]


@pytest.mark.slow
def test_without_contact_order_4_is_taken():
    """A run along another code path, in axes of the shaft by Dopri8."""
    scene = unequal("both", stops=False)
    found = jr.simulate(scene, 2, 64)
    assert found.solver.startswith("Exponential(order=4") and found.contact_force is None
    control = dfx.PIDController(rtol=1e-10, atol=1e-13)
    other = jr.run_up(scene, found.time, solver=dfx.Dopri8(), controller=control)
    np.testing.assert_allclose(found.velocity, other.velocity, rtol=0, atol=1e-5)


@pytest.mark.slow
def test_massless_bearings():
    """Bearings without mass yield at once to the remainder; diffrax eliminates them otherwise."""
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1.0, anisotropy=0.2, damping=0.16, ends="elastic"),
        jr.Disc(0.5, 1.0),
        jr.DiscDamping(0.5, 0.1),
        *(jr.Support(at, 1.0, damping=0.16, anisotropy=0.3, angle=0.4) for at in (0.0, 1.0)),
        jr.Unbalance(0.5, 1.0, 1e-3, 0.3),
        jr.Gravity(1e-3),
        spin=jr.ConstantSpeed(1.3),
    )
    found = jr.simulate(scene, 2, 64)
    assert found.solver.startswith("Exponential(order=4")
    control = dfx.PIDController(rtol=1e-10, atol=1e-13)
    other = jr.run_up(scene, found.time, solver=dfx.Kvaerno5(), controller=control)
    largest = np.abs(other.velocity).max()
    np.testing.assert_allclose(found.velocity, other.velocity, rtol=0, atol=1e-5 * largest)


@pytest.mark.slow
def test_a_stop_that_is_too_stiff_matters_only_where_it_is_touched():
    """The remainder moves the rotor as well, but is no contact."""
    stiffer = {"limiters.stiffness": 3e7, "limiters.gap": 0.1}
    scene = unequal("both").replace(stiffer)
    free = jr.simulate(scene.without("limiters"), 2, 64, solver=jr.Exponential(2))
    found = jr.simulate(scene, 2, 64)
    assert not np.any(found.contact_force)
    np.testing.assert_allclose(found.displacement, free.displacement, rtol=1e-12)
    with pytest.raises(RuntimeError, match="A stop was touched that is too stiff for the steps"):
        jr.simulate(scene.replace({"limiters.gap": 1e-3}), 2, 64)
