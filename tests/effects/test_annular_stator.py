"""Law of a ring against its formula, energy, and motions in it against closed forms and SciPy."""

import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import check_forward
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.effects.law import Now
from jaxrotor.equations.system import assemble
from jaxrotor.solvers.crossing import Crossing, falls_through_zero


AT = 0.5
GAP, STIFF, DAMPER, FRICTION, RIM = 0.8, 40.0, 1.5, 0.3, 2.0


def ring(**values) -> jr.AnnularStator:
    base = {"at": AT, "gap": GAP, "stiffness": STIFF, "damping": DAMPER, "friction": FRICTION}
    return jr.AnnularStator(**(base | {"rim_radius": RIM} | values))


def plane(w: complex) -> jax.Array:
    return jnp.array([np.real(w), np.imag(w)], float)


def laws(ring: jr.AnnularStator, z, v, speed) -> tuple[np.ndarray, np.ndarray]:
    """Forces `x + i y` and torques of many states."""
    states = [jnp.stack([jnp.real(w), jnp.imag(w)], axis=1) for w in map(np.asarray, (z, v))]
    law, now = ring.law(), Now(jnp.asarray(speed, float))
    both = jax.vmap(lambda z, v: (law(z, v, now), law.torque(law(z, v, now), z, v, now)))
    force, torque = jax.jit(both)(*states)
    return np.asarray(force) @ [1, 1j], np.asarray(torque)


def written(one: jr.AnnularStator | types.SimpleNamespace, z, v, speed):
    """Force and torque by equations (1)-(4) of the sheet."""
    r = z - float(one.offset) * np.exp(1j * float(one.angle))
    rho = np.abs(r)
    n = np.where(rho > 0, r / np.where(rho > 0, rho, 1), 0)
    closing = (v * n.conj()).real
    p = rho - float(one.gap)
    normal = float(one.stiffness) * p + float(one.damping) * closing
    normal = np.where((p > 0) & (normal > 0), normal, 0.0)
    slip = speed * float(one.rim_radius) + (v * n.conj()).imag
    if one.slip is None:
        direction = np.sign(slip)
    else:
        u = np.clip(slip / float(one.slip), -1, 1)
        direction = u * (15 - 10 * u**2 + 3 * u**4) / 8
    rub = float(one.friction) * normal * direction
    return -(normal + 1j * rub) * n, -float(one.rim_radius) * rub


def states(count: int, seed: int, size: float = 1.3):
    """Random displacements and velocities, most of them in contact, with slip of both signs."""
    rng = np.random.default_rng(seed)
    turned = lambda: np.exp(1j * rng.uniform(-np.pi, np.pi, count))
    z = size * np.sqrt(rng.uniform(0, 1, count)) * turned()
    return z, rng.uniform(0, 12, count) * turned()


# === law


@pytest.mark.parametrize("speed", [3.0, -3.0, 0.0])
@pytest.mark.parametrize("values", [{}, {"gap": 0.0}, {"offset": 0.2, "angle": 0.7, "slip": 0.5}])
def test_law_is_that_of_the_sheet(speed, values):
    one = ring(**values)
    z, v = states(400, 1)
    force, torque = laws(one, z, v, speed)
    want = written(one, z, v, speed)
    assert np.count_nonzero(want[0]) > 100
    np.testing.assert_allclose(force, want[0], rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(torque, want[1], rtol=1e-12, atol=1e-11)


def test_blended_law_is_the_sharp_one_outside_its_width():
    z, v = states(2000, 2)
    sharp, soft = (laws(ring(blend=blend), z, v, 3.0)[0] for blend in (None, 0.01))
    reach = STIFF * 0.01
    exact = (np.abs(z) - GAP > 0.01) & (np.abs(sharp) > reach * np.hypot(1, FRICTION))
    free = np.abs(z) < GAP
    assert np.count_nonzero(exact) > 200 and np.count_nonzero(free) > 200
    np.testing.assert_allclose(soft[exact], sharp[exact], rtol=1e-12)
    assert not soft[free].any()


@pytest.mark.hard("7.1 a ring turned and mirrored")
def test_law_turns_and_mirrors_with_the_motion(record_property):
    """`F(e^ib r, e^ib r.) = e^ib F`, the torque unchanged; the mirror image is exact."""
    z, v = states(500, 3)
    speed, turn = 3.0, np.exp(1.234j)
    one = ring(offset=0.1, angle=0.4)
    force, torque = laws(one, z, v, speed)
    turned, same = laws(ring(offset=0.1, angle=0.4 + 1.234), turn * z, turn * v, speed)
    size = abs(force).max()
    error = max(abs(turned - turn * force).max() / size, abs(same - torque).max() / size)
    record_property("measured", f"force turned {error:.0e}, mirrored exactly")
    assert error < 1e-14
    mirrored, opposite = laws(ring(offset=0.1, angle=-0.4), z.conj(), v.conj(), -speed)
    assert (mirrored == force.conj()).all() and (opposite == -torque).all()


@pytest.mark.hard("7.2 a rotor in the centre of its ring")
@pytest.mark.parametrize("blend", [None, 1e-2])
@pytest.mark.parametrize("gap", [0.0, GAP])
def test_law_is_safe_in_the_centre(gap, blend):
    """No force, and finite derivatives by every number; a ring without gap has its stiffness there."""
    one = ring(gap=gap, blend=blend, damping=0.0, slip=None if blend is None else 1.0)
    zero, speed = jnp.zeros(2), jnp.asarray(2.0)
    assert not np.any(one.law()(zero, zero, Now(speed)))
    total = lambda one, z, v: jnp.sum(one.law()(z, v, Now(speed)))
    slopes_at = jax.jit(jax.grad(total, argnums=(0, 1, 2)))
    for v in (zero, jnp.array([3.0, -1.0])):
        slopes = slopes_at(one, zero, v)
        assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(slopes))
    found = np.asarray(jax.jit(jax.jacfwd(lambda z: one.law()(z, zero, Now(speed))))(zero))
    stiff = STIFF if gap == 0 and blend is None else 0.0
    want = -stiff * np.array([[1, -FRICTION], [FRICTION, 1]])
    np.testing.assert_allclose(found, want, rtol=1e-12, atol=1e-12)


def test_a_negative_gap_is_refused():
    with pytest.raises(ValueError, match=r"`gap \[m\]` must not be negative, but is -0.1"):
        ring(gap=-0.1)


@pytest.mark.hard("7.2 a fast pass through the centre of a ring")
def test_a_fast_pass_through_the_centre_is_no_crossing():
    """From one side to the other in one step: the margin is a parabola and stays positive."""
    law, now = ring().law(), Now(jnp.asarray(1.0))
    begin, end = plane(-0.7 + 0.05j), plane(0.6 - 0.02j)
    v = (end - begin) / 0.1
    branch = law.branch(begin, v, now)

    def crossing(z):
        margins = lambda z: law.margins(branch, z, v, now)
        return Crossing(*jax.jvp(margins, (z,), (v,)))

    assert not np.any(falls_through_zero(crossing(begin), crossing(end), jnp.asarray(0.1)))


@pytest.mark.slow
@pytest.mark.hard("7.2 a fast pass through the centre of a ring, in time")
def test_a_pass_through_the_centre_in_time_is_the_free_one(record_property):
    scene = rotor(ring(), speed=0.3)
    start = jr.Continued(jnp.array([-0.79 + 0j]), jnp.array([0.02 + 0.03j]))
    runs = [
        jr.simulate(one, 1, 12, start=start) for one in (scene, scene.without("annular_stators"))
    ]
    error = abs(np.asarray(runs[0].displacement[:, 0] - runs[1].displacement[:, 0])).max()
    record_property("measured", f"path {error:.0e} of the free one, steps of half a radian")
    assert abs(np.asarray(runs[1].displacement)).max() < GAP
    assert error < 1e-13


def test_a_ring_is_hard_in_every_direction():
    """Together with a stop it is as hard as both along the stop; beside another ring, as both rings."""
    stop = jr.Limiter(AT, 0.7, GAP, 5.0, 0.25)
    found = assemble(rotor(ring(), stop)).ports[0].hardness()
    np.testing.assert_allclose(found, [STIFF + 5.0, DAMPER + 0.25])
    found = assemble(rotor(ring(), ring(gap=0.9), stop)).ports[0].hardness()
    np.testing.assert_allclose(found, [2 * STIFF + 5.0, 2 * DAMPER + 0.25])


@pytest.mark.slow
def test_a_ring_too_stiff_for_the_steps_is_refused():
    with pytest.raises(RuntimeError, match="A stop was touched that is too stiff for the steps"):
        jr.simulate(rotor(ring(stiffness=600.0), speed=1.0), 1, 64, start=jr.Whirl(0.85))


# === energy


@pytest.mark.hard("7.3 power of a rub in a ring")
def test_power_is_what_the_contact_loses(record_property):
    """`Re(F* r.) + T Omega = -U. - d p.^2 - f N |V|` while it presses, equation (5) of the sheet."""
    z, v = states(4000, 5)
    speed = 2.5
    force, torque = laws(ring(), z, v, speed)
    n, p = z / abs(z), abs(z) - GAP
    closing, slip = (v * n.conj()).real, speed * RIM + (v * n.conj()).imag
    normal = -(force * n.conj()).real
    pressed = normal > 0
    power = (force.conj() * v).real + torque * speed
    want = -STIFF * p * closing - DAMPER * closing**2 - FRICTION * normal * abs(slip)
    error = abs(power - want)[pressed].max() / abs(want[pressed]).max()
    record_property("measured", f"{error:.0e} of the largest power")
    assert np.count_nonzero(pressed) > 500 and error < 1e-14
    assert (slip[pressed] < 0).any() and (slip[pressed] > 0).any()
    assert not power[~pressed].any()


def rotor(*effects, speed=0.0, damping=0.0):
    """`z.. + damping z. + z = forces of the effects`."""
    parts = jr.MasslessShaft(1.0, AT, 1.0), jr.Disc(AT, 1.0), jr.DiscDamping(AT, damping)
    return jr.Scene(*parts, *effects, spin=jr.ConstantSpeed(speed))


def energy(z, v, stiffness=STIFF):
    depth = np.maximum(abs(z) - GAP, 0)
    return (abs(z) ** 2 + abs(v) ** 2 + stiffness * depth**2) / 2


@pytest.mark.slow
@pytest.mark.hard("7.3 energy of a passive rotor in a ring")
def test_a_passive_rotor_keeps_its_energy(record_property):
    """Without damping and friction, over some forty bounces; the moment of momentum, too."""
    scene = rotor(ring(damping=0.0, friction=0.0))
    start = jr.Continued(jnp.array([0.5 + 0.1j]), jnp.array([0.2 + 1.1j]))
    r = jr.simulate(scene, 10, 2048, start=start, period=2 * np.pi, solver=LOCATED)
    z, v = np.asarray(r.displacement[:, 0]), np.asarray(r.velocity[:, 0])
    inside = abs(z) > GAP
    assert np.count_nonzero(inside[1:] != inside[:-1]) > 60 and int(r.unresolved) == 0
    own, moment = energy(z, v), (z.conj() * v).imag
    errors = [np.ptp(own) / own[0], np.ptp(moment) / abs(moment[0])]
    record_property("measured", f"energy {errors[0]:.0e}, moment of momentum {errors[1]:.0e}")
    assert max(errors) < 1e-9


# === in time

LOCATED = jr.Exponential(4, located=True)


def by_scipy(scene, z, v, times, damping):
    """Path by SciPy, of the unbalance and the written law; restarted where contact begins or ends."""
    (ring,) = scene.of(jr.AnnularStator)
    names = ("offset", "angle", "gap", "stiffness", "damping", "rim_radius", "slip", "friction")
    values = {name: getattr(ring, name) for name in names}
    one = types.SimpleNamespace(
        **{name: value if value is None else float(value) for name, value in values.items()}
    )
    loads = [(float(u.mass) * float(u.eccentricity)) for u in scene.of(jr.Unbalance)]
    speed = float(scene.spin.speed)

    def rate(t, y):
        z, v = y[0] + 1j * y[1], y[2] + 1j * y[3]
        push = sum(loads) * speed**2 * np.exp(1j * speed * t)
        a = -damping * v - z + push + written(one, z, v, speed)[0]
        return [v.real, v.imag, a.real, a.imag]

    begin = [np.real(z), np.imag(z), np.real(v), np.imag(v)]
    found = solve_ivp(
        rate, (0, times[-1]), begin, "DOP853", times, rtol=1e-11, atol=1e-13, max_step=1e-2
    )
    return found.y[0] + 1j * found.y[1]


CASES = {
    "a sharp ring, bouncing": ({}, 2.0, 0.3),
    "friction of 5, in reverse": ({"friction": 5.0, "slip": 0.5}, 1.5, 0.3),
    "an offset ring": ({"offset": 0.3, "angle": 2.0}, 2.0, 0.3),
    "a rotor that turns the other way": ({"rim_radius": 0.1}, -2.0, 0.3),
    # At times its rim rolls: with sharp friction SciPy would take ever shorter steps.
    "a ring without gap": ({"gap": 0.0, "damping": 0.0, "slip": 0.5}, 2.0, 0.3),
}


@pytest.mark.long
@pytest.mark.hard("7.6 rubs in a ring of every kind, against SciPy")
@pytest.mark.parametrize("name", CASES)
def test_paths_in_a_ring_are_those_of_scipy(name, record_property):
    values, speed, eccentricity = CASES[name]
    scene = rotor(ring(**values), jr.Unbalance(AT, 1.0, eccentricity), speed=speed, damping=0.2)
    z, v = 0.6 + 0.1j, 0.3 - 0.8j
    start = jr.Continued(jnp.array([z]), jnp.array([v]))
    r = jr.simulate(scene, 3, 1024, start=start, solver=LOCATED)
    want = by_scipy(scene, z, v, np.asarray(r.time)[::64], 0.2)
    error = abs(np.asarray(r.displacement[::64, 0]) - want).max()
    record_property("measured", f"path {error:.0e}")
    assert np.any(np.asarray(r.contact_force)) and int(r.unresolved) == 0
    assert error < 1e-6


@pytest.mark.slow
@pytest.mark.hard("7.6 a ring without gap is a spring with cross stiffness")
def test_a_ring_without_gap_is_a_support(record_property):
    """`F = -k (1 + i f) z`: the cross-coupled stiffness of a support, in closed form."""
    unbalance = jr.Unbalance(AT, 1.0, 0.1)
    closed = ring(gap=0.0, damping=0.0, friction=0.02, stiffness=3.0)
    scene = rotor(closed, unbalance, speed=1.7, damping=0.2)
    support = jr.Support(AT, 3.0, cross_stiffness=0.06)
    linear = scene.without("annular_stators").of_parts(
        *scene.without("annular_stators").effects, support
    )
    run = {"start": jr.Whirl(0.4, 0.3), "solver": LOCATED}
    paths = [np.asarray(jr.simulate(one, 2, 512, **run).displacement) for one in (scene, linear)]
    error = abs(paths[0] - paths[1]).max()
    record_property("measured", f"path {error:.0e} of the support's")
    assert error < 1e-9


@pytest.mark.slow
def test_derivatives_by_every_number_are_those_of_differences():
    """Of a rub in a blended ring off the centre, after a revolution."""
    names = (
        "gap",
        "stiffness",
        "damping",
        "friction",
        "rim_radius",
        "offset",
        "angle",
        "blend",
        "slip",
    )
    one = ring(offset=0.1, angle=0.5, blend=0.02, slip=1.0, rim_radius=0.3, damping=0.4)
    scene = rotor(one, jr.Unbalance(AT, 1.0, 0.3), speed=2.0, damping=0.2)
    start = jr.Continued(jnp.array([0.6 + 0.1j]), jnp.array([0.3 - 0.8j]))
    paths = [f"annular_stators.{name}" for name in names]

    def end(values):
        changed = scene.put(dict(zip(paths, values, strict=True)))
        z = jr.simulate(changed, 1, 256, start=start, solver=jr.Exponential(4)).displacement[-1, 0]
        return z.real + 0.3 * z.imag

    own = jnp.stack([jnp.ravel(scene.get(path))[0] for path in paths])
    check_forward(end, own, 1e-4)


# === a ring and many stops


@pytest.mark.hard("7.1 many stops are not a ring")
def test_many_stops_press_by_another_law(record_property):
    """By equation (6) of the sheet: `n k (0.30011) p^1.5 / g^0.5` for small depths, not `k p`."""
    count = 4096
    angles = 2 * np.pi * (np.arange(count) + 0.3) / count
    errors = []
    for depth in (0.0005, 0.005, 0.05):
        z = GAP * (1 + depth)
        stops = jr.Limiter(AT, 0.0, GAP, 1.0)
        law = lambda a, stops=stops, z=z: jr.Limiter(AT, a, stops.gap, 1.0).law()(
            plane(z), jnp.zeros(2), Now(jnp.zeros(()))
        )
        force = -float(np.sum(jax.vmap(law)(jnp.asarray(angles))[:, 0]))
        a0 = np.arccos(GAP / z)
        want = count / (2 * np.pi) * (z * (a0 + np.sin(2 * a0) / 2) - 2 * GAP * np.sin(a0))
        errors.append(abs(force / want - 1))
        small = count * 0.30011 * (z - GAP) ** 1.5 / GAP**0.5
        assert want == pytest.approx(small, rel=0.75 * depth)
        ring_force = -laws(ring(stiffness=1.0, damping=0.0, friction=0.0), [z], [0j], 0.0)[0][0]
        assert ring_force == pytest.approx(z - GAP, rel=1e-12)
    record_property("measured", f"4096 stops, by the law of a continuum {max(errors):.0e}")
    assert max(errors) < 1e-3


def test_second_derivatives_at_the_centre_are_finite():
    """Of the clearance `gap - r`: those of r beside the centre, and numbers in it, also in float32."""
    law = ring().law()
    curved = jax.jit(jax.hessian(lambda z: law.clearance(z)))
    x, y = 0.03, -0.04
    expected = -np.array([[y**2, -x * y], [-x * y, x**2]]) / 0.05**3
    np.testing.assert_allclose(curved(jnp.array([x, y])), expected, rtol=1e-12)
    for kind in (jnp.float64, jnp.float32):
        small = jax.tree.map(lambda leaf, kind=kind: leaf.astype(kind), law)
        second = jax.jit(jax.hessian(small.clearance))
        assert np.all(np.isfinite(second(jnp.zeros(2, kind))))
        speed = jnp.ones((), kind)
        force = lambda z, small=small, speed=speed: jnp.sum(small(z, 0 * z, Now(speed)))
        assert np.all(np.isfinite(jax.jit(jax.hessian(force))(jnp.zeros(2, kind))))
