"""Exponential steps at a speed that varies: against scipy on equations written out here."""

import dataclasses
import functools

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.motion import stepped


TIMES, SPEEDS = np.array([0.0, 0.31, 0.6]), np.array([30.0, 260.0, 180.0])  # a kink between samples
ORDER_4 = jr.Exponential(order=4)
FINE = dfx.PIDController(rtol=1e-11, atol=1e-14)
SAMPLES = np.linspace(0.0, 0.5, 26)
OFF = {"gap": 7e-4, "stiffness": 4e4, "damping": 20.0, "friction": 0.1, "rim_radius": 0.05}
DISC = jnp.asarray(0.6)
SMOOTH = {"blend": 5e-4, "slip": 2.0}


def rotor(*effects, shaft=None, speeds=SPEEDS):
    """Two gyroscopic discs on a shaft with internal damping, under weight and unbalance."""
    return jr.Scene(
        shaft
        or jr.FlexibleShaft(
            0.6, 0.02, jr.steel(), nodes=2, constraints=[jr.Constraint(0.0, "clamp")]
        ),
        jr.Disc(0.6, 3.0, 0.02, 0.04),
        jr.InternalDamping(2e-4),
        jr.DiscDamping(0.6, 8.0, 0.05),
        jr.Unbalance(0.6, 3.0, 2e-4, phase=0.4),
        jr.Gravity(9.81),
        *effects,
        spin=jr.SpeedProfile(TIMES, speeds),
    )


def stops(**laws):
    return jr.Limiter.at_angles([0.3, 2.4, 4.5], at=0.6, **OFF | laws)


def bearing():
    """Unequal, cross-coupled stiffness and damping at mid-span."""
    return jr.Support(
        0.3, kxx=6e4, kxy=1e4, kyx=-2e4, kyy=2e4, cxx=60.0, cxy=5.0, cyx=10.0, cyy=30.0
    )


def turning(t, speeds):
    """Angle, speed and acceleration of the profile, by its formula."""
    i = 0 if t < TIMES[1] else 1
    rate = (speeds[i + 1] - speeds[i]) / (TIMES[i + 1] - TIMES[i])
    before = 0.0 if i == 0 else (speeds[0] + speeds[1]) / 2 * TIMES[1]
    s = t - TIMES[i]
    return before + speeds[i] * s + rate * s**2 / 2, speeds[i] + rate * s, rate


@eqx.filter_jit
def at_disc(line):
    """Row of the disc's displacement and column of a force on it, by one program."""
    return line.row(DISC), line.column(DISC)


def by_scipy(scene, times, speeds=SPEEDS):
    """Displacement of the disc by DOP853, from the blocks of the scene and laws written out here."""
    system = jr.assemble(scene)
    blocks, n = system.blocks, system.n
    part = lambda name: np.asarray(
        getattr(blocks, name) if getattr(blocks, name) is not None else np.zeros((n, n))
    )
    inverse = np.linalg.inv(part("inertia"))
    row, column = map(np.asarray, at_disc(system.line))
    fields = ("damping", "stiffness", "gyroscopic", "circulatory", "skew_damping")
    c, k, g, h, sc = map(part, fields)
    sk, fd, fk = map(part, ("skew_stiffness", "fixed_damping", "fixed_stiffness"))

    def free(y, speed):
        q, v = y[:n] + 1j * y[n : 2 * n], y[2 * n : 3 * n] + 1j * y[3 * n :]
        force = -c @ v - k @ q + 1j * speed * (g @ v + h @ q)
        force = force - 1j * (sc @ v + sk @ q) - fd @ v.conj() - fk @ q.conj()
        return np.concatenate([v.real, v.imag, *accelerations(force)])

    def accelerations(force):
        a = inverse @ force
        return a.real, a.imag

    def pushed(force):
        return np.concatenate([np.zeros(2 * n), *accelerations(force + 0j)])

    # The field is linear in the state, its matrix in the speed: both are taken from `free` once.
    still, fast = (np.stack([free(one, w) for one in np.eye(4 * n)], axis=1) for w in (0.0, 1.0))
    fast = fast - still
    weight = pushed(np.asarray(system.load.constant))
    ahead, aside = (pushed(x * np.asarray(system.load.unbalance)) for x in (1, 1j))
    along, across = pushed(column), pushed(1j * column)
    limiters = [
        (np.exp(1j * float(s.angle)), s) for s in scene.effects if isinstance(s, jr.Limiter)
    ]
    laws = [
        (turn, *(None if x is None else float(x) for x in (stop.blend, stop.slip)))
        for turn, stop in limiters
    ]

    def rates(t, y):
        theta, speed, rate = turning(t, speeds)
        push = (speed**2 - 1j * rate) * np.exp(1j * theta)
        found = (still + speed * fast) @ y + weight + push.real * ahead + push.imag * aside
        if laws:
            z, v = row @ y[:n] + 1j * (row @ y[n : 2 * n]), row @ y[2 * n : 3 * n]
            force = sum(_stop(law, z, v + 1j * (row @ y[3 * n :]), speed) for law in laws)
            found = found + force.real * along + force.imag * across
        return found

    y, path = np.zeros(4 * n), [np.zeros(4 * n)]
    for begin, end in ((0.0, TIMES[1]), (TIMES[1], times[-1])):  # the acceleration jumps
        own = times[(times > begin) & (times <= end)]
        near = min(end, TIMES[1] - 1e-12) if begin == 0 else end
        at = np.unique(np.append(np.minimum(own, near), near))
        found = solve_ivp(rates, (begin, near), y, "DOP853", at, rtol=1e-11, atol=1e-15)
        path += list(found.y.T[: own.size])
        y = found.y[:, -1]
    path = np.array(path)
    return (path[:, :n] + 1j * path[:, n : 2 * n]) @ row


def _stop(law, z, v, speed):
    """Force of one stop on the disc."""
    turn, blend, slip = law
    z, v = z / turn, v / turn
    if z.real <= OFF["gap"]:
        return 0.0
    normal, way = _pressure(z.real - OFF["gap"], v.real, blend), speed * OFF["rim_radius"] + v.imag
    if slip is None:
        way = np.sign(way)
    else:
        u = min(max(way / slip, -1.0), 1.0)
        way = u * (15 - 10 * u**2 + 3 * u**4) / 8
    return -normal * (1 + 1j * OFF["friction"] * way) * turn


def _pressure(depth, closing, blend):
    """Normal force of a stop: sharp, or with the smooth onset and release of `Limiter`."""
    k, c = OFF["stiffness"], OFF["damping"]
    if blend is None:
        return max(k * depth + c * closing, 0.0) if depth > 0 else 0.0
    onset = lambda u: u**3 * (6 - 8 * u + 3 * u**2)
    depth = max(depth, 0.0)
    u = min(depth / blend, 1.0)
    force = k * (depth + blend * (onset(u) - u))
    force = max(force + c * closing * u**3 * (10 - 15 * u + 6 * u**2), 0.0)
    v = min(force / (k * blend), 1.0)
    return force + k * blend * (onset(v) - v)


@functools.cache
def free_rotor():
    """The rotor without stops, and its displacement by scipy."""
    return rotor(), by_scipy(rotor(), SAMPLES)


@functools.cache
def stopped_rotor():
    """The rotor between stops in unequal bearings, and its displacement by scipy."""
    scene = rotor(bearing(), stops())
    return scene, by_scipy(scene, SAMPLES)


def errors(scene, order, substeps, exact=None, speeds=SPEEDS, **settings):
    """Largest errors of the disc's displacement, relative to the largest displacement."""
    exact, found = by_scipy(scene, SAMPLES, speeds) if exact is None else exact, []
    for count in substeps:
        solver = jr.Exponential(order=order, **settings)
        run = jr.run_up(scene, SAMPLES, solver=solver, substeps=count, at=0.6)
        found.append(np.abs(run.displacement[:, 0] - exact).max() / np.abs(exact).max())
    return np.array(found)


# === against scipy


@pytest.mark.slow
def test_order_of_a_run_up_without_contact():
    """Order 2 is that of located steps below, between whose impacts nothing is in contact."""
    scene, exact = free_rotor()
    found = errors(scene, 4, (20, 40, 80), exact)
    assert np.all(found[:-1] / found[1:] > 12.0)
    assert found[-1] < 3e-8


@pytest.mark.slow
def test_a_kink_of_the_speed_is_met_within_a_trace():
    """A step across the kink has an error of 9e-5, at which order 4 ends."""
    scene, exact = free_rotor()

    @eqx.filter_jit
    def displacement(eccentricity):
        changed = scene.put({"unbalance.eccentricity": eccentricity})
        run = jr.run_up(changed, SAMPLES, solver=ORDER_4, substeps=20, at=0.6)
        return run.displacement[:, 0]

    found = displacement(jnp.asarray(2e-4))
    assert np.abs(found - exact).max() / np.abs(exact).max() < 3e-6


@pytest.mark.slow
def test_order_with_smooth_contact():
    found = errors(rotor(stops(**SMOOTH)), 4, (80, 320))
    assert found[0] / found[1] > 8**2
    assert found[1] < 1e-8


@pytest.mark.long
def test_sharp_stops_and_unequal_bearings():
    scene, exact = stopped_rotor()
    found = errors(scene, 2, (100, 1600), exact)
    assert found[1] < 1e-4 < 100 * found[1]
    assert found[1] < found[0] / 8


@functools.cache
def struck_rotor():
    """The rotor between stops, and its displacement by scipy."""
    return rotor(stops()), by_scipy(rotor(stops()), SAMPLES)


@pytest.mark.slow
@pytest.mark.parametrize(("order", "least", "last"), [(2, 12.0, 3e-4), (4, 100.0, 5e-8)])
def test_located_steps_keep_their_order_through_impacts(order, least, last):
    scene, exact = struck_rotor()
    found = errors(scene, order, (16, 64), exact, located=True)
    assert found[0] / found[1] > least
    assert found[1] < last


@pytest.mark.slow
def test_located_steps_and_unequal_bearings():
    scene, exact = stopped_rotor()
    assert errors(scene, 4, (32,), exact, located=True)[0] < 1e-6


@pytest.mark.slow
def test_derivative_through_located_impacts():
    """Of the disc's distance from the centre after several impacts, by the friction of the stops."""
    solver = jr.Exponential(order=4, located=True, basis="modal")
    scene = rotor(stops())

    def last(friction):
        one = scene.put({"limiters.friction": friction})
        run = jr.run_up(one, SAMPLES[:16], solver=solver, substeps=32, at=0.6)
        return jnp.abs(run.displacement[-1, 0]), run.contact_force

    both = jax.jit(lambda friction: jax.jvp(last, (friction,), (jnp.ones(()),)))
    _, (slope, force) = both(jnp.asarray(0.1))
    assert jnp.abs(force).max() > 0  # contact is felt by the friction
    ends = [both(jnp.asarray(0.1 + change))[0][0] for change in (1e-6, -1e-6)]
    assert float(slope) == pytest.approx(float(ends[0] - ends[1]) / 2e-6, rel=1e-5)


@pytest.mark.slow
def test_dense_and_modal_bases_agree():
    one, other = (
        jr.run_up(rotor(), SAMPLES, solver=jr.Exponential(order=4, basis=basis), substeps=20)
        for basis in ("modal", "dense")
    )
    scale = np.abs(one.displacement).max()
    assert np.allclose(one.displacement, other.displacement, rtol=0, atol=1e-10 * scale)


@pytest.mark.slow
def test_run_down_and_backward_spin():
    assert errors(rotor(speeds=-SPEEDS), 4, (40,), speeds=-SPEEDS)[0] < 1e-6


# === against the other ways through time


def test_constant_speed_is_that_of_simulate():
    scene = rotor().at_speed(150.0)
    exact = jr.simulate(scene, 4, 32)
    run = jr.run_up(scene, exact.time, at=exact.stations, solver=ORDER_4)
    scale = np.abs(exact.displacement).max()
    assert np.allclose(run.displacement, exact.displacement, rtol=0, atol=1e-12 * scale)
    assert np.allclose(run.velocity, exact.velocity, rtol=0, atol=1e-9 * scale)


@pytest.mark.slow
def test_unequal_bearings_at_constant_speed_and_another_first_angle():
    scene, times = rotor(bearing()).at_speed(-150.0), np.array([0.01, 0.02, 0.06])
    start = jr.Launch(jr.Whirl(1e-4, 20.0), angle=0.7)
    exact = jr.run_up(scene, times, start=start, solver=ORDER_4)
    other = jr.run_up(scene, times, start=start, solver=dfx.Dopri8(), controller=FINE)
    scale = np.abs(exact.displacement).max()
    assert np.allclose(exact.displacement, other.displacement, rtol=0, atol=1e-9 * scale)


@pytest.mark.slow
def test_an_undamped_resonance_is_stepped():
    shaft = jr.FlexibleShaft(
        0.6, 0.02, jr.steel(), nodes=2, constraints=[jr.Constraint(0.0, "clamp")]
    )
    parts = jr.Disc(0.6, 3.0), jr.Unbalance(0.6, 3.0, 1e-5)
    scene = jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(1.0))
    scene = scene.at_speed(jr.critical_speeds(scene, 1).forward[0])
    run = jr.run_up(scene, np.linspace(0, 1.0, 41), at=0.6, solver=ORDER_4)
    radius = np.abs(run.displacement[:, 0])
    assert radius[-1] / radius[20] == pytest.approx(2, rel=0.02)


@pytest.mark.slow
def test_accelerations_and_the_end_are_those_of_the_motion():
    run = jr.run_up(rotor(), SAMPLES, solver=ORDER_4, substeps=80)
    # Up to 0.32 s by as many samples, so that one program serves both.
    before = jr.run_up(rotor(), np.linspace(0.0, 0.32, 26), solver=ORDER_4, substeps=80)
    after = jr.run_up(rotor(), SAMPLES[:10], solver=ORDER_4, substeps=80, start=before.end)
    assert np.allclose(after.displacement, run.displacement[16:], rtol=0, atol=1e-9)
    system, now = jr.assemble(rotor()), jax.tree.map(lambda leaf: leaf[-1], run.instants)
    b, speed = system.blocks, now.turning.speed
    q, v, a = (x * now.turn for x in (now.r, now.velocity, now.absolute))
    left = b.inertia @ a + b.damping @ v + b.stiffness @ q
    left = left - 1j * speed * (b.gyroscopic @ v + b.circulatory @ q)
    g = speed**2 - 1j * now.turning.acceleration
    right = system.load.constant + g * system.load.unbalance * now.turn
    assert np.allclose(left, right, rtol=0, atol=1e-9 * np.abs(right).max())


@pytest.mark.slow
def test_change_of_speed_in_the_slowest_modes(monkeypatch):
    """With eight modes at sixteen speeds, and in all modes at one."""
    scene = jr.load("two-discs").with_nodes(4)
    scene = jr.Scene(scene.shaft, *scene.effects, spin=jr.SpeedProfile([0.0, 0.5], [40.0, 160.0]))
    times = np.linspace(0, 0.5, 51)
    few = jr.run_up(scene, times)
    assert few.solver == "Exponential(order=4, basis='modal')"  # by default
    monkeypatch.setattr(stepped, "MODES", 50)
    every = jr.run_up(scene, times)
    scale = np.abs(every.displacement).max()
    assert np.allclose(few.displacement, every.displacement, rtol=0, atol=3e-6 * scale)


@pytest.mark.slow
def test_uneven_times_and_a_first_sample_after_the_start():
    even = jr.run_up(rotor(), SAMPLES, solver=ORDER_4, substeps=80)
    kept = np.array([0, 5, 9, 20, 25])
    times = SAMPLES + np.where(np.isin(np.arange(26), kept), 0.0, 0.007 * np.sin(np.arange(26.0)))
    found = jr.run_up(rotor(), times, solver=ORDER_4, substeps=80).displacement[kept]
    there = np.asarray(even.displacement)[kept]
    assert np.allclose(found, there, rtol=0, atol=1e-6 * np.abs(there).max())
    late = jr.run_up(rotor(), SAMPLES[20:], solver=ORDER_4, substeps=80).displacement
    assert np.allclose(late, even.displacement[20:], rtol=0, atol=1e-9 * np.abs(there).max())


# === derivatives


def after_a_run(scene, eccentricity, damping):
    scene = scene.put(
        {"unbalance.eccentricity": eccentricity, "disc_damping.translational": damping}
    )
    run = jr.run_up(
        scene, SAMPLES[:11], solver=jr.Exponential(order=4, basis="dense"), substeps=20, at=0.6
    )
    return jnp.abs(run.displacement[-1, 0])


@pytest.mark.slow
@pytest.mark.parametrize("effects", [(), (stops(**SMOOTH),)])
def test_derivatives_are_differences(effects):
    scene, at, steps = rotor(*effects), (2e-4, 8.0), (1e-9, 1e-3)
    last = lambda values: after_a_run(scene, *values)

    @jax.jit
    def both(values):
        push = lambda along: jax.jvp(last, (values,), (along,))
        return jax.vmap(push, out_axes=(None, 0))(jnp.eye(2))

    forward = both(jnp.array(at))[1]
    for i, step in enumerate(steps):
        ends = [jnp.array(at).at[i].add(s * step) for s in (1, -1)]
        slope = (both(ends[0])[0] - both(ends[1])[0]) / (2 * step)
        assert float(forward[i]) == pytest.approx(float(slope), rel=1e-5)
    if not effects:
        reverse = jax.jit(jax.grad(last))(jnp.array(at))
        assert np.allclose(reverse, forward, rtol=1e-9)


# === steps


@pytest.mark.slow
def test_automatic_steps_say_what_they_leave():
    scene, exact = free_rotor()
    run = jr.run_up(scene, SAMPLES, solver=jr.Exponential(order=4), substeps="auto", tolerance=1e-5)
    (pilot,) = run.pilots
    assert pilot.converged and pilot.difference < 1e-5
    assert f"chosen {pilot.setting} steps" in str(run)
    assert np.abs(run.displacement[:, 0] - exact).max() < 1e-5 * np.abs(exact).max()


@pytest.mark.slow
def test_a_stop_too_stiff_for_the_steps_is_told():
    scene = rotor(stops()).put({"limiters.stiffness": 1e9})
    with pytest.raises(RuntimeError, match=r"take [\d.e+]+ times as many `substeps`"):
        jr.run_up(scene, SAMPLES, solver=jr.Exponential(), substeps=100)


def test_nothing_depends_on_the_speed_of_a_point_mass():
    system = jr.assemble(rotor())
    plain = dataclasses.replace(system.blocks, gyroscopic=None, circulatory=None)
    system = dataclasses.replace(system, blocks=plain)
    stepping = stepped.Stepping.of(system, None, SAMPLES, jr.Exponential(), 4)
    assert (stepping.modes, stepping.speeds) == (0, 1)


# === refusals


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"spin": jr.Drive(1.0, 5.0, coulomb=0.1)}, "the rotor may come to rest under its Drive"),
        (
            {
                "shaft": jr.FlexibleShaft(
                    0.6,
                    0.02,
                    jr.steel(),
                    nodes=2,
                    anisotropy=0.1,
                    constraints=[jr.Constraint(0.0, "clamp")],
                )
            },
            "turn with",
        ),
        ({"shaft": jr.MasslessShaft(0.6, 0.3, 1e5, 1e3, 1e4)}, "has no mass"),
    ],
)
def test_scenes_that_exponential_steps_do_not_take(change, words):
    effects = (jr.Disc(0.3, 3.0, 0.0, 0.04),) if "shaft" in change else rotor().effects
    shaft = change.get("shaft", rotor().shaft)
    scene = jr.Scene(shaft, *effects, spin=change.get("spin", rotor().spin))
    with pytest.raises(ValueError, match=words):
        jr.run_up(scene, SAMPLES, solver=jr.Exponential())


def test_settings_that_exponential_steps_do_not_take():
    with pytest.raises(ValueError, match="for diffrax solvers"):
        jr.run_up(
            rotor(), SAMPLES, solver=jr.Exponential(), adjoint=dfx.RecursiveCheckpointAdjoint()
        )
    with pytest.raises(ValueError, match='`substeps` "auto" are for Exponential'):
        jr.run_up(rotor(), SAMPLES, solver=dfx.Kvaerno5(), substeps="auto")
