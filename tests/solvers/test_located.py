"""Located steps: order through impacts, several crossings in a step, grazing, derivatives."""

import functools

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from switched import Switched
from systems import LENGTH, TIME, limiter_rotor

import jaxrotor as jr
from jaxrotor.equations.stationary_frame import Motion


RUB = jr.Whirl(0.012 * LENGTH, rate=-10 / TIME)  # leads to the backward rub


def prepared(scene, order):
    """Form, and `run(y, steps, revolutions)` of located steps whose length is traced."""
    choice = jr.Exponential(order, "modal", located=True)
    system = jr.assemble(scene)
    motion = Motion(system, jnp.abs(scene.spin.speed))
    form = choice.form(system, motion, jnp.eye(system.n))

    @jax.jit
    def run(y, steps, revolutions):
        step = choice.stepper(form, steps)

        def one(i, carry):
            y, unresolved = carry
            y, _, more = step.advance((i % steps) * step.tableau.h, y)
            return y, unresolved + more

        return jax.lax.fori_loop(0, steps * revolutions, one, (y, jnp.zeros((), int)))

    return form, run


@pytest.fixture(scope="module")
def stepped(rub):
    """See `prepared`, of the rub; every order is compiled once."""
    return functools.cache(lambda order: prepared(rub[0], order))


def physical(form, y):
    """`(q, dq/dtheta)` as `[re, im]` of a state at a whole revolution."""
    q, velocity = form.decode(y)
    w = np.concatenate([q, velocity / form.motion.rate])
    return np.concatenate([w.real, w.imag])


def off(form, y, truth):
    return np.abs(physical(form, y) - truth).max() / np.abs(truth).max()


@pytest.fixture(scope="module")
def rub():
    """The periodic backward rub of sheet 1, section 3.4, with a little eccentricity."""
    scene = limiter_rotor(eps=1e-5 / LENGTH)
    settled = jr.simulate(scene, 300, 512, solver=jr.Exponential(4), start=RUB, keep=1)
    return scene, settled.end


@pytest.fixture(scope="module")
def truth(rub):
    scene, end = rub
    switched = Switched(scene)
    w = np.concatenate([end.q, end.velocity / switched.rate])
    once, some = switched.run(np.concatenate([w.real, w.imag]), 1)
    last, more = switched.run(once, 3)
    assert some >= 3 and some + more >= 10  # changes of contact
    return {1: once, 4: last}


@pytest.mark.hard("1.3 order of the steps through impacts")
@pytest.mark.slow
@pytest.mark.parametrize(("order", "least"), [(2, 1.8), (4, 3.0)])
def test_order_through_impacts(rub, stepped, truth, order, least, record_property):
    _, end = rub
    form, run = stepped(order)
    begin = form.encode(end.q, end.velocity)
    steps, errors = np.array([32, 64, 128, 256, 512, 1024]), []
    for count in steps:
        y, unresolved = run(begin, int(count), 4)
        assert unresolved == 0
        errors.append(off(form, y, truth[4]))
    errors = np.array(errors)
    above = errors > 1e-10  # what scipy itself is good for
    assert above.sum() >= 4
    slope = np.polyfit(np.log(steps[above]), np.log(errors[above]), 1)[0]
    record_property("measured", f"order {order}: slope {-slope:.2f}")
    assert -slope >= least
    assert errors[-1] < {2: 2e-4, 4: 1e-8}[order]


@pytest.mark.slow
def test_lanes_together_are_lanes_alone(rub, stepped):
    _, end = rub
    form, run = stepped(2)
    begin = form.encode(end.q, end.velocity)
    lanes = begin * (1 + 0.02 * jnp.linspace(-1, 1, 21)[:, None])  # more than a block, all striking
    together, unresolved = jax.vmap(lambda y: run(y, 24, 1))(lanes)
    alone = np.stack([run(y, 24, 1)[0] for y in lanes])
    assert not unresolved.any()
    assert np.allclose(together, alone, rtol=0, atol=1e-12 * np.abs(alone).max())


@pytest.mark.slow
@pytest.mark.hard("1.3 several impacts in one step")
def test_several_crossings_in_one_step(rub, stepped, truth):
    """Eight steps in a revolution with three or more changes of contact: most of it is flight."""
    _, end = rub
    form, run = stepped(4)
    begin = form.encode(end.q, end.velocity)
    for steps, most in ((8, 0.05), (12, 0.01)):
        y, unresolved = run(begin, steps, 1)
        assert unresolved == 0 and off(form, y, truth[1]) < most


LINE = {"at": LENGTH, "stiffness": 4e5, "damping": 30.0}


def on_a_line(*stops, blend=None):
    """A rotor at rest that is thrown along x at its stops; 0.05 s in 5 periods of 10 ms."""
    linear = limiter_rotor(N=0.0, contact=False)
    scene = jr.Scene(linear.shaft, *linear.effects, *stops, spin=linear.spin)
    start = jr.Whirl(1e-3, rate=0.0)
    how = {"start": start, "period": 0.01, "solver": jr.Exponential(4, located=True)}
    return jr.simulate(scene, 5, 32, **how)


@pytest.mark.slow
@pytest.mark.hard("1.3 two and three stops at once")
def test_two_stops_at_once(record_property):
    """Like stops at +a and -a act as one at 0: gap / cos a, 2 cos^2 a as stiff and damped."""
    a, gap = 0.5, 3e-4
    pair = on_a_line(*(jr.Limiter(angle=s * a, gap=gap, **LINE) for s in (1, -1)))
    scaled = {"stiffness": 2 * np.cos(a) ** 2 * 4e5, "damping": 2 * np.cos(a) ** 2 * 30.0}
    far = jr.Limiter(angle=0.0, gap=1.0, **LINE)  # is never touched; so one program runs both
    one = on_a_line(jr.Limiter(LENGTH, 0.0, gap / np.cos(a), **scaled), far)
    assert pair.unresolved == 0 and (np.abs(pair.contact_force) > 0).all(axis=1).sum() > 3
    error = np.abs(pair.displacement - one.displacement).max() / 1e-3
    record_property("measured", f"{error:.0e} from the one stop they amount to")
    assert error < 1e-8


@pytest.mark.slow
@pytest.mark.hard("1.3 grazing")
def test_grazing_is_a_touch_at_most():
    """The radius of the free orbit is the gap within 1e-9 of it."""
    rotor = limiter_rotor(N=5.0, eps=1e-3, eta_i=None)
    linear = rotor.without("limiters")
    circle = float(abs(jr.unbalance_response(linear, float(rotor.spin.speed)).forward[0, 0]))
    free = jr.simulate(linear, 400, 64, keep=1).end
    for share in (-1e-9, 0.0, 1e-9):
        scene = rotor.replace({"limiters.gap": circle * (1 - share)})
        run = jr.simulate(scene, 2, 64, start=free, solver=jr.Exponential(2, located=True))
        assert np.abs(np.abs(run.displacement) - circle).max() < 1e-5 * circle


@pytest.mark.slow
@pytest.mark.hard("1.3 more changes of contact than a step can locate", outcome="flagged")
def test_steps_that_cannot_be_located_are_counted():
    """Friction that holds the rim against its slip reverses without end and is not resolved."""
    stop = jr.Limiter(angle=0.0, gap=0.0, friction=50.0, rim_radius=0.1, **LINE)
    linear = limiter_rotor(N=1.0, contact=False, gravity=True)
    scene = jr.Scene(linear.shaft, *linear.effects, stop, spin=linear.spin)
    how = {"start": jr.Whirl(5e-3), "solver": jr.Exponential(2, located=True)}
    with pytest.warns(jr.FewStepsWarning, match="`limiter` was touched with 3.7 steps a rebound"):
        run = jr.simulate(scene, 2, 64, **how)
    assert run.unresolved > 0 and np.isfinite(run.displacement).all()


@pytest.mark.slow
@pytest.mark.hard("1.2 gradients through impacts")
def test_derivatives_through_impacts(rub):
    """Forward mode against central differences, by eccentricity and stiffness of the stops."""
    scene, end = rub
    names = ("unbalance.eccentricity", "limiters.stiffness", "limiters.gap")
    values = jnp.array([1e-5, 4.087e6, 0.0075 * LENGTH])

    def final(values):
        changed = scene.put(dict(zip(names, [*values], strict=True)))
        solver = jr.Exponential(2, "dense", located=True)
        run = jr.simulate(changed, 1, 32, start=end, solver=solver, at=LENGTH)
        return 1e3 * run.displacement[-1, 0].real

    push = jax.jit(lambda values, along: jax.jvp(final, (values,), (along,)))
    for i, value in enumerate(values):
        along = jnp.zeros(3).at[i].set(value)
        _, slope = push(values, along)
        at = lambda h: push(values + h * along, 0 * along)[0]  # noqa: B023
        differ = lambda h: (at(h) - at(-h)) / (2 * h)  # noqa: B023
        found = (4 * differ(1e-5) - differ(2e-5)) / 3
        assert slope == pytest.approx(float(found), rel=1e-5)


def test_reverse_mode_is_refused():
    how = {"solver": jr.Exponential(located=True), "adjoint": dfx.RecursiveCheckpointAdjoint()}
    with pytest.raises(ValueError, match="forward mode alone"):
        jr.simulate(jr.load("limiter-rotor"), 1, 32, start=jr.Whirl(1e-3), **how)


@pytest.mark.slow
def test_a_sweep_says_what_it_did_not_locate(rub):
    scene, end = rub
    over = {"unbalance.eccentricity": [0.0, 1e-5]}
    how = {"start": end, "settle": 0, "keep": 30, "steps_per_revolution": 32, "error_sample": 0}
    found = jr.sweep(scene, over, solver=jr.Exponential(4, located=True), **how)
    assert (found["unresolved"] == 0).all() and "located" in found.attrs["solver"]
    fine = jr.sweep(scene, over, solver=jr.Exponential(4), **how | {"steps_per_revolution": 2048})
    assert np.abs(found["whirl_rate"] - fine["whirl_rate"]).max() < 1e-4
