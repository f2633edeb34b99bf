"""Exponential steps of rotors with unequal axes, beside scipy on equations written by hand.

The linear blocks are those of the library; frames, integration, contact and steady response are not.
"""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from unequal_rotor import BEARING, SPEED, ByHand, rotor, unequal

import jaxrotor as jr
from jaxrotor.equations.constant_frame import in_constant_axes
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.solvers.basis import WORST_CONDITION, condition, well_conditioned


RATIOS = np.geomspace(1e2, 1e9, 15)  # of the axes of an ellipsoid, before equilibration


@pytest.fixture(scope="module")
def rub(request):
    """A rotor, and where two revolutions from rest with some impacts leave its disc."""
    scene = unequal(request.param)
    return scene, ByHand(scene).end(4 * np.pi / SPEED)


@pytest.mark.parametrize(
    ("rub", "order", "steps", "error"),
    [
        ("fixed", 4, 256, 2e-6),
        pytest.param("turning", 4, 256, 2e-6, marks=pytest.mark.slow),
        pytest.param("both", 2, 2048, 2e-4, marks=pytest.mark.slow),  # of order 4: the next test
    ],
    indirect=["rub"],
)
def test_located_steps_follow_impacts(rub, order, steps, error):
    scene, end = rub
    found = jr.simulate(scene, 2, steps, solver=jr.Exponential(order, located=True))
    assert found.unresolved == 0 and np.abs(found.contact_force).max() > 10.0
    np.testing.assert_allclose(found.coordinates[-1], end, rtol=0, atol=error * np.abs(end).max())


@eqx.filter_jit
def after_two_revolutions(scene, steps):
    """Coordinates after two revolutions from rest by located steps; one program for any number of them."""
    system = in_constant_axes(jr.assemble(scene))
    motion = Motion(system, jnp.abs(scene.spin.speed))
    solver = jr.Exponential(4, "modal", located=True)
    form = solver.form(system, motion, jnp.eye(system.n))
    step = solver.stepper(form, steps)
    rest = form.encode(*jr.AtRest().state(system, jnp.asarray(0.5)))
    one = lambda k, y: step.advance(step.tableau.h * (k % steps), y)[0]
    return form.decode(jax.lax.fori_loop(0, 2 * steps, one, rest))[0]


@pytest.mark.slow
@pytest.mark.parametrize("rub", ["both"], indirect=True)
def test_the_error_falls_with_the_order(rub):
    scene, end = rub
    counts = map(jnp.asarray, (64, 128, 256))
    off = [np.abs(after_two_revolutions(scene, steps) - end).max() for steps in counts]
    assert off[0] > 10 * off[1] > 100 * off[2]


@pytest.mark.parametrize("speed", [SPEED, -SPEED])
@pytest.mark.parametrize("kind", ["fixed", "turning"])
def test_without_contact_it_is_exact_at_any_step(kind, speed):
    """The disc after three revolutions, from a start that moves, sampled three times a revolution."""
    scene = unequal(kind, stops=False, speed=speed)
    q, velocity = 2e-3 + 1e-3j, -0.1 + 0.3j
    start = jr.Continued(jnp.array([q]), jnp.array([velocity]))
    found = jr.simulate(scene, 3, 3, start=start)
    state = [q.real, q.imag, velocity.real, velocity.imag]
    end = ByHand(scene).end(6 * np.pi / SPEED, np.array(state))
    np.testing.assert_allclose(found.coordinates[-1], end, rtol=1e-9)
    again = jr.simulate(scene, 1, 3, start=jr.simulate(scene, 2, 3, start=start).end)
    np.testing.assert_allclose(again.coordinates[-1], end, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "speed"), [("fixed", -SPEED), ("turning", -SPEED)])
def test_stops_of_a_rotor_that_turns_the_other_way(kind, speed):
    scene = unequal(kind, speed=speed)
    found = jr.simulate(scene, 2, 256, solver=jr.Exponential(4, located=True))
    end = ByHand(scene).end(4 * np.pi / SPEED)
    assert np.abs(found.contact_force).max() > 10.0
    np.testing.assert_allclose(found.coordinates[-1], end, rtol=0, atol=1e-6 * np.abs(end).max())


@pytest.mark.slow
def test_at_rest_turning_axes_stand_still():
    """A shaft of two stiffnesses that does not turn falls on its stops; a "revolution" is a time."""
    smooth = {"limiters.gap": 3e-4, "limiters.friction": 0.0}
    scene, period = unequal("turning", speed=0.0).replace(smooth), 0.05
    found = jr.simulate(scene, 2, 256, solver=jr.Exponential(4, located=True), period=period)
    end = ByHand(scene).end(2 * period)
    assert np.abs(found.contact_force).max() > 1.0
    np.testing.assert_allclose(found.coordinates[-1], end, rtol=0, atol=1e-5 * np.abs(end).max())


def test_condition_of_vectors_that_coincide():
    """A coordinate without stiffness and damping: the exact vectors of its double root are one."""
    coincident = np.linalg.eig(np.array([[0.0, 1.0], [0.0, 0.0]]))[1]
    assert condition(coincident) > 1e15 and not well_conditioned(coincident)
    assert condition(np.eye(3)) == pytest.approx(1.0)
    assert condition(np.diag([1e9, 1e-9])) == pytest.approx(1.0)
    assert condition(np.full((2, 2), np.nan)) == np.inf


def test_well_conditioned_is_the_condition_below_its_limit(monkeypatch):
    """On both sides of the limit; singular values are not computed where a bound decides."""
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(2, 6, 6)))[0]
    vectors = [turn[0] @ np.diag(np.geomspace(1.0, ratio, 6)) @ turn[1] for ratio in RATIOS]
    found = [well_conditioned(one) for one in vectors]
    assert found == [condition(one) < WORST_CONDITION for one in vectors]
    assert set(found) == {False, True} and not well_conditioned(np.stack(vectors))
    assert not well_conditioned(np.zeros((2, 2))) and not well_conditioned(np.full((2, 2), np.nan))
    monkeypatch.setattr(
        np.linalg, "cond", lambda given: pytest.fail() if given.size else np.empty(0)
    )
    assert well_conditioned(np.stack([vectors[0]] * 3))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["fixed", "turning"])
def test_heavy_damping_leaves_real_roots(kind):
    """Two real roots share a slot of the modal coordinates, beside a pair; dense steps agree."""
    if kind == "fixed":
        scene = rotor(jr.Support(0.5, **(BEARING | {"cxx": 5e3})))
    else:
        scene = rotor(anisotropy=0.3, internal=1e4)
    real = np.abs(np.asarray(jr.roots(scene)).imag) < 1e-9
    assert real.sum() == 2
    modal, dense = (
        jr.simulate(scene, 2, 80, solver=jr.Exponential(2, basis=basis))
        for basis in ("modal", "dense")
    )
    np.testing.assert_allclose(modal.coordinates, dense.coordinates, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_equal_axes_written_as_unequal_ones():
    """With blocks of axes that differ by nothing the motion is that of the rotor without them."""
    scene = rotor(jr.Support(0.5, 2e4, 30.0))
    same = {"kxx": 2e4, "kxy": 1e-300, "kyx": 0.0, "kyy": 2e4}  # not known to be isotropic
    same |= {"cxx": 30.0, "cxy": 1e-300, "cyx": 0.0, "cyy": 30.0}
    parted = rotor(jr.Support(0.5, **same))
    assert jr.assemble(parted).blocks.fixed_stiffness is not None
    assert jr.assemble(scene).blocks.fixed_stiffness is None
    one, other = (jr.simulate(s, 2, 256, solver=jr.Exponential(4)) for s in (scene, parted))
    assert np.abs(one.contact_force).max() > 10.0
    np.testing.assert_allclose(one.displacement, other.displacement, rtol=0, atol=1e-13)


@pytest.mark.slow
def test_axes_of_both_kinds_by_a_diffrax_solver():
    scene = unequal("both", stops=False)
    found = jr.simulate(scene, 2, 16, solver=dfx.Dopri8())
    end = ByHand(scene).end(4 * np.pi / SPEED)
    np.testing.assert_allclose(found.coordinates[-1], end, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "basis"), [("turning", "dense"), ("both", "modal")])
def test_derivatives_are_central_differences(kind, basis):
    """By the stiffness of the stops, and of the shaft, which moves roots and vectors of the basis."""
    scene, solver = unequal(kind), jr.Exponential(4, basis=basis, located=True)

    def height(share):
        values = {"limiters.stiffness": 4e5 * share, "shaft.k11": 2e4 * share}
        if kind == "both":
            values["support.kyy"] = 1e4 * share
        run = jr.simulate(scene.put(values), 2, 128, solver=solver)
        return jnp.abs(run.displacement[-1, 0])

    both = jax.jit(lambda share: jax.jvp(height, (share,), (jnp.ones(()),)))
    (found, high, low) = both(1.0)[1], both(1.0 + 1e-5)[0], both(1.0 - 1e-5)[0]
    assert float(found) == pytest.approx(float(high - low) / 2e-5, rel=1e-5)


@pytest.mark.slow
def test_a_sweep_is_a_loop_of_runs():
    """Of axes of one kind, `test_every_shipped_scene_moves` compares lanes with motions."""
    scene, path = unequal("both"), "unbalance.eccentricity"
    values = [5e-4, 1.5e-3]
    counts = {"settle": 4, "keep": 2, "steps_per_revolution": 64, "error_sample": 0}
    swept = jr.sweep(scene, {path: values}, observe=[jr.observe.Radius()], **counts)
    assert (swept["status"] == 0).all()
    for value, largest in zip(values, swept["radius_max"].values, strict=True):
        run = jr.simulate(scene.replace({path: value}), 6, 64, keep=2)
        assert np.abs(run.displacement).max() == pytest.approx(largest, rel=1e-10)


@pytest.mark.slow
def test_a_periodic_motion_and_its_multipliers():
    """Out of reach of the stops the orbit is the steady response, its multipliers those of Radau's method.

    With axes of both kinds; of turning ones: the next test.
    """
    scene = unequal("both").replace({"unbalance.eccentricity": 1e-5, "limiters.gap": 0.1})
    located = jr.Exponential(4, located=True)
    orbit = jr.periodic(scene, jr.AtRest(), revolutions=1, steps_per_revolution=256, solver=located)
    period = 2 * np.pi / SPEED
    found = np.sort_complex(np.asarray(orbit.multipliers))
    expected = np.sort_complex(jr.floquet_multipliers(scene))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)
    hand = ByHand(scene)
    q, velocity = orbit.start.q, orbit.start.velocity
    state = np.concatenate([q.real, q.imag, velocity.real, velocity.imag])
    np.testing.assert_allclose(hand.end(period, state), q, rtol=1e-8)


@pytest.mark.slow
def test_multipliers_of_a_rub_are_those_of_integration():
    """Central differences of scipy's map over the revolution, about an orbit that touches stops."""
    softer = {"limiters.stiffness": 5e4, "limiters.friction": 0.02}
    scene = unequal("turning").replace({"unbalance.eccentricity": 7e-4} | softer)
    located = jr.Exponential(4, located=True)
    settled = jr.simulate(scene, 300, 256, keep=1)
    orbit = jr.periodic(scene, settled, revolutions=1, steps_per_revolution=256, solver=located)
    assert orbit.converged and np.abs(orbit.contact_force).max() > 1.0
    hand, period = ByHand(scene), 2 * np.pi / SPEED
    q, velocity = orbit.start.q, orbit.start.velocity
    state = np.concatenate([q.real, q.imag, velocity.real, velocity.imag])
    step = 1e-3 * np.repeat([np.abs(q).max(), np.abs(velocity).max()], 2 * hand.n)
    how = {"rtol": 1e-9, "atol": 1e-12, "max_step": period / 100}
    end = lambda start: hand.map(period, start, **how)
    change = [end(state + d) - end(state - d) for d in np.diag(step)]
    jacobian = np.stack(change, axis=1) / (2 * step)
    found = np.sort(np.abs(orbit.multipliers))
    np.testing.assert_allclose(
        found, np.sort(np.abs(np.linalg.eigvals(jacobian))), rtol=1e-3, atol=1e-5
    )


@pytest.mark.slow
def test_a_flexible_rotor_in_a_cross_coupled_bearing():
    """Clamped, with an oil-film bearing half way, weight, unbalance and stops at its free end."""
    base = jr.load("limiter-rotor")
    base = base.replace({"shaft.nodes": 3, "spin.speed": SPEED, "unbalance.eccentricity": 1e-3})
    softer = {"limiters.stiffness": 4e5, "limiters.damping": 50.0, "limiters.gap": 1e-3}
    scene = base.replace(softer)
    more = [jr.Support(0.35, **BEARING), jr.Gravity(9.81)]
    scene = jr.Scene(scene.shaft, *scene.effects, *more, spin=scene.spin)
    end = ByHand(scene).end(4 * np.pi / SPEED, rtol=1e-9, atol=1e-12)
    found = jr.simulate(scene, 2, 256, solver=jr.Exponential(4, located=True))
    assert np.abs(found.contact_force).max() > 10.0
    np.testing.assert_allclose(found.coordinates[-1], end, rtol=0, atol=1e-6 * np.abs(end).max())


@pytest.mark.slow
def test_a_machine_is_stepped_in_modal_coordinates():
    """Raw eigenvectors have condition 2e5, which is one of units: modal and dense steps agree."""
    scene = jr.load("two-discs-unequal")
    scene = scene.replace({"spin.speed": float(scene.spin.speed) * 1.03})
    stop = jr.Limiter.at_angles([0.5, 2.5, 4.5], at=0.5, gap=1e-5, stiffness=1e6, damping=100.0)
    touching = jr.Scene(scene.shaft, *scene.effects, *stop, spin=scene.spin)
    chosen = jr.simulate(touching, 3, 64)
    assert "modal" in chosen.solver and np.abs(chosen.contact_force).max() > 1.0
    dense = jr.simulate(touching, 3, 64, solver=jr.Exponential(2, basis="dense"))
    largest = np.abs(dense.displacement).max()
    np.testing.assert_allclose(chosen.displacement, dense.displacement, rtol=0, atol=1e-9 * largest)
