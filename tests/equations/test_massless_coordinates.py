"""Coordinates without mass in time: against scipy, where they are eliminated by hand."""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import central, check_forward
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.effects.law import Now
from jaxrotor.equations.massless_coordinates import Condensed, Massless
from jaxrotor.equations.rotating_frame import massless_of
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.motion.choice import system_of_march
from jaxrotor.solvers.feedthrough import force_through


FINE = dfx.PIDController(rtol=1e-11, atol=1e-15)
MASS, SHAFT, ANISOTROPY, DAMPING, OUTSIDE = 10.0, 1e5, 0.2, 160.0, 100.0
HELD, DAMPED = 2e5, 320.0  # stiffness and damping of both supports
UNBALANCE = MASS * 1e-4
FREE = {"damping": None, "support": {}}  # ends that nothing damps
VARIED = {"disc.mass": [9.0, 10.0]}
AXIS = np.exp(2j * 0.4)  # of supports that are unequal along directions fixed in space


def rotor(spin, *effects, damping=DAMPING, support=None, anisotropy=ANISOTROPY):
    """Disc between two massless elastic ends."""
    support = {"damping": DAMPED / 2} if support is None else support
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, SHAFT, anisotropy=anisotropy, damping=damping, ends="elastic"),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, OUTSIDE),
        jr.Unbalance(0.5, MASS, UNBALANCE / MASS),
        jr.Gravity(9.81, 0.0),
        *[jr.Support(at, HELD / 2, **support) for at in (0.0, 1.0)],
        *effects,
        spin=spin,
    )


def by_scipy(rates, times, size, start=None):
    """Complex states of `y. = rates(t, y)` by an explicit method of order 8, by default from rest."""
    real = lambda y: np.stack([y.real, y.imag]).ravel()
    start = np.zeros(size, complex) if start is None else np.asarray(start)
    whole = lambda y: y[:size] + 1j * y[size:]
    found = solve_ivp(
        lambda t, y: real(np.array(rates(t, whole(y)))),
        (0, times[-1]),
        real(start),
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-16,
    )
    return found.y[:size] + 1j * found.y[size:]


def accelerated(t, z, dz, pull, speed=80.0, rate=0.0):
    """Acceleration of the disc that the shaft pulls."""
    angle = speed * t + rate * t**2 / 2
    now = speed + rate * t
    push = UNBALANCE * (now**2 - 1j * rate) * np.exp(1j * angle)
    return (push + MASS * 9.81 - OUTSIDE * dz - pull) / MASS


def shipped():
    return jr.load("dual-stiffness-elastic").replace({"gravity.acceleration": 9.81})


def shipped_by_hand(times, held=HELD):
    """Displacements of disc and ends of the shipped scene, and velocities, (T, 2) each."""

    def parts(t, z, dz, z0):
        turn = np.exp(1j * 80.0 * t)
        stretch = z - z0
        elastic = SHAFT * (stretch + ANISOTROPY * np.conj(stretch) * turn**2)
        inside = DAMPING * (dz - 80j * stretch)
        dz0 = (elastic + inside - held * z0) / (DAMPED + DAMPING)
        return dz0, elastic + inside - DAMPING * dz0

    def rates(t, y):
        z, dz, z0 = y
        dz0, pull = parts(t, z, dz, z0)
        return dz, accelerated(t, z, dz, pull), dz0

    z, dz, z0 = by_scipy(rates, times, 3)
    return np.stack([z, z0], axis=1), np.stack([dz, parts(times, z, dz, z0)[0]], axis=1)


@pytest.mark.slow
def test_shipped_scene_with_damped_supports():
    """`dual-stiffness-elastic`: the ends follow an equation of first order."""
    times = np.linspace(0, 0.5, 51)
    expected, velocity = shipped_by_hand(times)
    run = jr.run_up(shipped(), times, at=[0.5, 0.0], controller=FINE, solver=dfx.Dopri8())
    assert np.abs(run.displacement - expected).max() < 1e-9 * np.abs(expected).max()
    assert np.abs(run.velocity - velocity).max() < 1e-8 * np.abs(velocity).max()
    force = np.asarray(jr.reactions(run).force)  # of both supports on the rotor
    held = -(HELD * expected[:, 1] + DAMPED * velocity[:, 1])
    assert np.abs(force.sum(1) - held).max() < 1e-8 * np.abs(held).max()


@pytest.mark.slow
def test_undamped_supports_on_the_way_up():
    """Unequal supports without damping: the ends follow an algebraic equation, whatever the speed."""
    anisotropy, rate, times = 0.3, 100.0, np.linspace(0, 0.4, 41)
    scene = rotor(
        jr.SpeedProfile.ramp(80.0, 120.0, 0.4),
        damping=None,
        support={"anisotropy": anisotropy, "angle": 0.4},
    )

    def ends(t, z):
        """Displacement of the ends, linear in `z` and its conjugate."""
        turn = np.exp(1j * (80.0 * t + rate * t**2 / 2))
        # K (z0 - z) + K mu turn^2 (z0 - z)* + H z0 + H nu axis z0* = 0
        own, other = SHAFT + HELD, SHAFT * ANISOTROPY * turn**2 + HELD * anisotropy * AXIS
        known = SHAFT * z + SHAFT * ANISOTROPY * turn**2 * np.conj(z)
        return (own * known - other * np.conj(known)) / (own**2 - np.abs(other) ** 2)

    def rates(t, y):
        z, dz = y
        stretch = z - ends(t, z)
        turn = np.exp(1j * (80.0 * t + rate * t**2 / 2))
        pull = SHAFT * (stretch + ANISOTROPY * turn**2 * np.conj(stretch))
        return dz, accelerated(t, z, dz, pull, rate=rate)

    z, dz = by_scipy(rates, times, 2)
    run = jr.run_up(scene, times, at=[0.5, 0.0], controller=FINE, solver=dfx.Dopri8())
    expected = np.stack([z, ends(times, z)], axis=1)
    assert np.abs(run.displacement - expected).max() < 1e-9 * np.abs(expected).max()
    h = 1e-6  # velocity of the ends by differences along the motion
    ahead, behind = (ends(times + s, z + s * dz) for s in (h, -h))
    velocity = (ahead - behind) / (2 * h)
    assert np.abs(run.velocity[:, 1] - velocity).max() < 1e-7 * np.abs(velocity).max()


@pytest.mark.slow
def test_derivatives():
    """Masses are traced here, so that it is not known which of them are zero."""
    scene, times = rotor(jr.ConstantSpeed(80.0)), np.linspace(0.0, 0.1, 5)
    paths = ("supports.stiffness", "supports.damping", "disc.mass")
    own = np.array([float(np.ravel(scene.get(path))[0]) for path in paths])

    def late(values):
        changed = scene.replace(dict(zip(paths, values, strict=True)))
        run = jr.run_up(changed, times, controller=FINE, solver=dfx.Dopri8())
        return 1e6 * run.displacement[-1, 0].real

    check_forward(late, jnp.asarray(own), 1e-3)


@pytest.mark.slow
def test_a_slope_without_inertia():
    """A tilting disc without inertia about its diameter: its slope follows the forces at once."""
    k11, k12, k22, times = 4e4, -3e3, 900.0, np.linspace(0, 0.3, 31)
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.4, k11, k12, k22),
        jr.Disc(0.4, MASS, 0.0, 0.02),
        jr.DiscDamping(0.4, OUTSIDE),
        jr.Unbalance(0.4, MASS, UNBALANCE / MASS),
        spin=jr.ConstantSpeed(80.0),
    )

    def rates(t, y):  # -i Omega G psi. + k12 z + k22 psi = 0
        z, dz, psi = y
        slope_rate = (k12 * z + k22 * psi) / (80j * 0.02)
        pull = k11 * z + k12 * psi + MASS * 9.81  # `accelerated` has weight, this rotor none
        return dz, accelerated(t, z, dz, pull), slope_rate

    z, _, _ = by_scipy(rates, times, 3)
    run = jr.run_up(scene, times, controller=FINE, solver=dfx.Dopri8())
    assert np.abs(run.displacement[:, 0] - z).max() < 1e-8 * np.abs(z).max()


def test_what_cannot_be_eliminated_is_refused():
    times, constant = [0.0, 0.1], jr.ConstantSpeed(80.0)
    with pytest.raises(ValueError, match="at 0 m, where the rotor has no mass; put a Disc there"):
        jr.run_up(rotor(constant, jr.Limiter(0.0, 0.0, 1e-3, 1e6)), times)
    along_x = {"damping": 100.0, "damping_anisotropy": 1.0}
    with pytest.raises(ValueError, match="along one direction only"):
        jr.run_up(rotor(constant, damping=None, support=along_x), times)
    with pytest.raises(ValueError, match="while the rotor does not turn"):
        at_rest = jr.SpeedProfile.ramp(0.0, 80.0, 1.0)
        tilting = jr.MasslessShaft(1.0, 0.4, 4e4, -3e3, 900.0)
        jr.run_up(jr.Scene(tilting, jr.Disc(0.4, MASS, 0.0, 0.02), spin=at_rest), times)
    point = jr.Scene(
        jr.RigidShaft(1.0),
        jr.Disc(0.5, 1.0),
        *[jr.Support(at, 1e5) for at in (0.0, 1.0)],
        spin=constant,
    )
    with pytest.raises(ValueError, match="no inertia against one of its motions"):
        jr.run_up(point, times)


def test_exponential_steps_refuse_what_they_cannot_eliminate():
    constant, steps = jr.ConstantSpeed(80.0), {"solver": jr.Exponential()}
    rough = rotor(constant, jr.Limiter(0.0, 0.0, 1e-3, 1e6, 0.0, 0.1))
    damper = rotor(constant, jr.Limiter(0.0, 0.0, 1e-3, 1e6, 50.0), **FREE)
    ramp = rotor(jr.SpeedProfile.ramp(80.0, 90.0, 1.0), anisotropy=None)
    calls = {
        "where the rotor has no mass, a contact rubs": lambda: jr.simulate(rough, 5, **steps),
        "a contact has damping and the rotor none": lambda: jr.sweep(
            damper, {"disc.mass": [1.0]}, **steps
        ),
        "has none": lambda: jr.lyapunov(rough, 1),
        "a part of the rotor has no mass": lambda: jr.run_up(ramp, [0.0, 0.1], **steps),
    }
    for match, call in calls.items():
        with pytest.raises(ValueError, match=match):
            call()


@pytest.mark.slow
def test_coordinates_with_mass_leave_no_trace():
    """A disc at either end: no coordinate is eliminated, and the equations are as short as they were."""
    scene = rotor(jr.ConstantSpeed(80.0), jr.Disc(0.0, 0.3), jr.Disc(1.0, 0.3))
    assert massless_of(scene) is None
    assert massless_of(rotor(scene.spin)) == ((False, True), (False, False))  # damped, undamped


@pytest.mark.slow
def test_damped_and_undamped_coordinates_together():
    """A slope that gyroscopic moments damp, and ends that nothing damps."""
    k11, k12, k22, polar, times = 4e4, -3e3, 900.0, 0.02, np.linspace(0, 0.3, 31)
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, k11, k12, k22, ends="elastic"),
        jr.Disc(0.5, MASS, 0.0, polar),
        jr.DiscDamping(0.5, OUTSIDE),
        jr.Unbalance(0.5, MASS, UNBALANCE / MASS),
        *[jr.Support(at, HELD / 2) for at in (0.0, 1.0)],
        spin=jr.ConstantSpeed(80.0),
    )
    assert massless_of(scene) == ((False, True, False), (False, False, True))

    def ends(z, psi):
        return (k11 * z + k12 * psi) / (k11 + HELD)

    def rates(t, y):
        z, dz, psi = y
        stretch = z - ends(z, psi)
        pull = k11 * stretch + k12 * psi + MASS * 9.81
        return dz, accelerated(t, z, dz, pull), (k12 * stretch + k22 * psi) / (80j * polar)

    z, dz, psi = by_scipy(rates, times, 3)
    run = jr.run_up(scene, times, at=[0.5, 0.0], controller=FINE, solver=dfx.Dopri8())
    expected = np.stack([z, ends(z, psi)], axis=1)
    assert np.abs(run.displacement - expected).max() < 1e-8 * np.abs(expected).max()
    velocity = ends(dz, (k12 * (z - ends(z, psi)) + k22 * psi) / (80j * polar))
    assert np.abs(run.velocity[:, 1] - velocity).max() < 1e-8 * np.abs(velocity).max()


@pytest.mark.slow
def test_scenes_that_are_traced():
    """A scene mapped over a stiffness has known masses, one compiled with a contact has not."""
    scene, times = shipped(), np.linspace(0.0, 0.05, 3)
    run = {"solver": dfx.Dopri8(), "max_steps": 500}
    last = lambda scene: jr.run_up(scene, times, **run).displacement[-1, 0]
    stiffness = jnp.array([0.9e5, 1.1e5])
    mapped = jax.vmap(lambda k: last(scene.replace({"supports.stiffness": k})))(stiffness)
    alone = [shipped_by_hand(times, 2 * float(k))[0][-1, 0] for k in stiffness]
    np.testing.assert_allclose(mapped, alone, rtol=1e-5)
    touched = jr.Scene(
        scene.shaft, *scene.effects, jr.Limiter(0.0, 0.0, 1e-9, 1e6), spin=scene.spin
    )
    assert not np.isfinite(jax.jit(lambda m: last(touched.replace({"disc.mass": m})))(10.0))


# === exponential steps


GAP, STOP, DASHPOT = 4e-4, 1e6, 100.0
TOWARDS = 0.3  # direction of the stop
START = {"start": jr.Whirl(2e-3, 60.0), "at": [0.5, 0.0]}


@pytest.mark.parametrize("kinds", ["du", "d", "u"])
def test_condensed_equations_are_those_of_all_coordinates(kinds):
    """Displacements, velocities and accelerations that it gives satisfy every equation."""
    rng, n = np.random.default_rng(0), 4
    damped, undamped = np.arange(n) == 1, np.arange(n) == 2
    masks = damped & ("d" in kinds), undamped & ("u" in kinds)
    massless, still = np.tile(masks[0] | masks[1], 2), np.tile(masks[1], 2)
    inertia, damping = (np.eye(2 * n) + 0.1 * rng.normal(size=(2 * n, 2 * n)) for _ in range(2))
    inertia[massless], inertia[:, massless] = 0.0, 0.0
    damping[still], damping[:, still] = 0.0, 0.0
    stiffness = 3 * np.eye(2 * n) + rng.normal(size=(2 * n, 2 * n))
    columns = rng.normal(size=(2 * n, 2))
    known = Massless(*(tuple(mask.tolist()) for mask in masks), True)
    build = eqx.filter_jit(lambda *parts: Condensed.of(parts[:3], parts[3], known))
    found = jax.tree.map(np.asarray, build(inertia, damping, stiffness, columns))
    y, f = rng.normal(size=found.matrix.shape[0]), rng.normal(size=2)
    q, velocity = np.split(found.lift @ y + found.feed @ f, 2)
    np.testing.assert_allclose(np.append(q, velocity)[list(found.kept)], y)
    rates = found.matrix @ y + found.drive @ f
    acceleration = np.zeros(2 * n)
    acceleration[~massless] = rates[np.sum(~still) :]
    left = inertia @ acceleration + damping @ velocity + stiffness @ q
    np.testing.assert_allclose(left, columns @ f, atol=1e-12)
    np.testing.assert_allclose(rates[: np.sum(~still)], velocity[~still], atol=1e-12)


def test_a_stop_on_a_port_that_yields():
    """N = (k g0 + d g0') / (1 + k D_0 + d D_v); and a stop of no stiffness to speak of beside it."""
    stops = [jr.Limiter(0.0, TOWARDS, GAP, STOP, DASHPOT), jr.Limiter(0.0, 2.0, GAP, STOP)]
    place, velocity = np.array([3 * GAP, 0.0]), np.array([0.1, 0.05])
    yields, drifts = 2e-6, 1 / 480.0
    through = jnp.kron(jnp.eye(2), jnp.array([[yields], [drifts]]))

    @jax.jit
    def force(seen):
        def law(seen):
            d, v = jnp.moveaxis(seen.reshape(2, 2, -1), 1, 0)
            return sum(stop.law()(d[:, 0], v[:, 0], Now(jnp.zeros(()))) for stop in stops)

        return force_through(law, seen, through)

    out = np.array([np.cos(TOWARDS), np.sin(TOWARDS)])
    pressed = STOP * (out @ place - GAP) + DASHPOT * out @ velocity
    expected = -pressed / (1 + STOP * yields + DASHPOT * drifts) * out
    found = force(jnp.stack([place, velocity], axis=1).ravel())
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_port_that_yields_aslant():
    """A force along the normal moves the port across its axes, as between cross-coupled springs."""
    stop = jr.Limiter(0.0, TOWARDS, GAP, STOP)
    yields = np.array([[1e-6, 4e-6], [-6e-6, 2e-6]])  # [m/N]
    through = jnp.asarray(np.kron(yields, [[1.0], [0.0]]))
    place = np.array([3 * GAP, GAP])

    @jax.jit
    def force(seen):
        def law(seen):
            d, v = jnp.moveaxis(seen.reshape(2, 2, -1), 1, 0)
            return stop.law()(d[:, 0], v[:, 0], Now(jnp.zeros(())))

        return force_through(law, seen, through)

    out = np.array([np.cos(TOWARDS), np.sin(TOWARDS)])
    depth = out @ place - GAP
    expected = -STOP * depth / (1 + STOP * out @ yields @ out) * out
    assert depth > 0
    np.testing.assert_allclose(
        force(jnp.stack([place, 0 * place], axis=1).ravel()), expected, rtol=1e-12
    )


@pytest.mark.parametrize(("steep", "converges"), [(1e2, True), (1e12, False)])
def test_a_spring_that_is_too_steep_for_the_iterations_is_no_number(steep, converges):
    """`x + D k x^3 = x_0`, whose root numpy finds."""
    yields, place = 1e-2, 2.0
    law = lambda seen: -steep * seen[::2] ** 3
    through = jnp.kron(yields * jnp.eye(2), jnp.array([[1.0], [0.0]]))
    seen = jnp.array([place, 0.0, 0.0, 0.0])
    found = jax.jit(lambda seen: force_through(law, seen, through)[:1])(seen)
    (root,) = [x.real for x in np.roots([yields * steep, 0, 1, -place]) if abs(x.imag) < 1e-9]
    if converges:
        np.testing.assert_allclose(found, -steep * root**3, rtol=1e-7)
    else:
        assert np.isnan(found).all()


def damped_by_hand(times, anisotropy, start):
    """Disc and ends with a stop on the damped ends, whose force slows them down at once."""
    out, c = np.exp(1j * TOWARDS), DAMPED + DAMPING

    def rates(t, y):
        z, dz, z0 = y
        turn, stretch = np.exp(1j * 80.0 * t), z - z0
        elastic = SHAFT * (stretch + anisotropy * np.conj(stretch) * turn**2)
        inside = DAMPING * (dz - 80j * stretch)
        free = (elastic + inside - HELD * z0) / c
        depth, closing = np.real(z0 / out) - GAP, np.real(free / out)
        pressed = max(STOP * depth + DASHPOT * closing, 0.0) / (1 + DASHPOT / c) * (depth > 0)
        dz0 = free - pressed * out / c
        return dz, accelerated(t, z, dz, elastic + inside - DAMPING * dz0), dz0

    return by_scipy(rates, times, 3, start)[[0, 2]]


def undamped_by_hand(times, anisotropy, start):
    """Disc alone, with the ends from two algebraic equations, pressed against the stop or not."""
    normal = np.array([np.cos(TOWARDS), np.sin(TOWARDS)])

    def ends(t, z):
        twice = np.exp(160j * t)
        mirror = np.array([[twice.real, twice.imag], [twice.imag, -twice.real]])
        shaft = SHAFT * (np.eye(2) + anisotropy * mirror)
        inverse = np.linalg.inv(shaft + HELD * np.eye(2))
        free = inverse @ shaft @ [z.real, z.imag]
        pressed = max(STOP * (normal @ free - GAP), 0.0) / (1 + STOP * normal @ inverse @ normal)
        at = free - pressed * inverse @ normal
        return at[0] + 1j * at[1]

    def rates(t, y):
        z, dz = y
        stretch = z - ends(t, z)
        elastic = SHAFT * (stretch + anisotropy * np.conj(stretch) * np.exp(160j * t))
        return dz, accelerated(t, z, dz, elastic)

    z, _ = by_scipy(rates, times, 2, start[:2])
    return np.stack([z, [ends(t, one) for t, one in zip(times, z, strict=True)]])


@eqx.filter_jit
def at_samples(system, solver, y, steps):
    """Displacements at 16 samples a revolution; one program for any number of steps between them."""
    form = solver.form(system, Motion(system, system.spin.speed, loads=False), jnp.eye(system.n))
    step = solver.stepper(form, 16 * steps)
    advance = lambda theta, y: step.several(theta[None], y)[0]

    def sample(y, number):
        theta = 2 * jnp.pi * number / 16
        one = lambda k, y: advance(theta + k * step.tableau.h, y)
        return jax.lax.fori_loop(0, steps, one, y), form.read(theta, y)[:, 0]

    _, seen = jax.lax.scan(sample, form.encode(*y), jnp.arange(33))
    return seen[:, 0] + 1j * seen[:, 1]


def errors(scene, expected, solver, counts):
    """Largest error of disc and ends at the samples, relative, by steps a revolution."""
    system, _ = system_of_march(scene, jr.assemble(scene), solver)
    y, found = START["start"].state(system, jnp.asarray(0.5)), []
    for steps in counts:
        error = np.abs(at_samples(system, solver, y, jnp.asarray(steps // 16)) - expected)
        found.append(error.max(axis=0) / np.abs(expected).max(axis=0))
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize(
    ("ends", "anisotropy"), [("damped", None), ("undamped", ANISOTROPY)]
)  # along axes of either kind
def test_order_through_impacts_on_a_part_without_mass(ends, anisotropy):
    """A stop on the ends of the shaft, with a clearance, located steps of order 4, and plain ones."""
    damped = ends == "damped"
    stop = jr.Limiter(0.0, TOWARDS, GAP, STOP, DASHPOT if damped else 0.0)
    scene = rotor(jr.ConstantSpeed(80.0), stop, anisotropy=anisotropy, **({} if damped else FREE))
    by_hand, counts = (damped_by_hand, (288, 576)) if damped else (undamped_by_hand, (64, 128))
    q, velocity = START["start"].state(jr.assemble(scene), jnp.asarray(0.5))
    start = np.array([q[0], velocity[0], q[1]])
    expected = by_hand(2 * np.pi / 80.0 * np.arange(33) / 16, anisotropy or 0.0, start).T
    depth = np.real(expected[:, 1] * np.exp(-1j * TOWARDS)) - GAP
    assert (depth > 0).any() and (depth < 0).any()
    fine = errors(scene, expected, jr.Exponential(4, "modal", located=True), counts)
    assert fine[-1].max() < 1e-6 and (np.log2(fine[0] / fine[1]) > 3.4).all()
    plain = errors(scene, expected, jr.Exponential(2, "modal"), counts)
    assert plain[-1].max() < 3e-4 and (np.log2(plain[0] / plain[1]) > 1.3).all()


@pytest.mark.slow
@pytest.mark.parametrize("stops", ["one rigid, without clearance", "three around"])
def test_energy_of_bounces_of_a_part_without_mass(stops):
    """Nothing damps; two of three stops are pressed at once, and a rigid one is as soft as the ends."""
    # One program serves both: two of the stops around a rigid one are out of reach.
    three, angles = stops == "three around", np.array([0.0, 2.1, 4.2])
    gaps, k = (np.full(3, 1e-4), 1e7) if three else (np.array([0.0, 1.0, 1.0]), 1e9)
    limiters = [
        jr.Limiter(0.0, float(angle), float(gap), k)
        for angle, gap in zip(angles, gaps, strict=True)
    ]
    scene = rotor(jr.ConstantSpeed(80.0), *limiters, anisotropy=None, **FREE)
    for part in ("disc_damping", "unbalance", "gravity"):
        scene = scene.without(part)
    run = jr.simulate(scene, 2, 128, solver=jr.Exponential(4, located=True), **START)
    z, z0 = np.asarray(run.displacement).T
    depth = np.real(z0[:, None] * np.exp(-1j * angles)) - gaps
    kinetic = MASS * np.abs(run.velocity[:, 0]) ** 2
    elastic = SHAFT * np.abs(z - z0) ** 2 + HELD * np.abs(z0) ** 2
    energy = kinetic + elastic + k * (np.maximum(depth, 0.0) ** 2).sum(axis=1)
    assert (depth > 0).sum(axis=1).max() == (2 if three else 1)
    assert np.ptp(energy[1:]) < 1e-6 * energy[1]
    # The velocity of the ends, which a force changes at once, is the derivative of their displacement.
    middle = (z0[2:] - z0[:-2]) / (run.time[2] - run.time[0])
    smooth = np.diff((depth > 0).sum(axis=1)) == 0
    smooth = smooth[1:] & smooth[:-1]
    velocity = np.asarray(run.velocity[1:-1, 1])
    assert np.abs(velocity - middle)[smooth].max() < 2e-3 * np.abs(velocity).max()


@pytest.mark.long
def test_lanes_and_derivatives_with_a_part_without_mass():
    """Lanes of a sweep are those of single motions; derivatives by shaft, ends and stop."""
    scene = rotor(jr.ConstantSpeed(80.0), jr.Limiter(0.0, TOWARDS, GAP, STOP), **FREE)
    gaps = [GAP, GAP / 2, 1.0]
    run = {"steps_per_revolution": 64, "start": START["start"], "at": 0.0}
    observe = [jr.observe.Section(), jr.observe.Contact()]
    kept = {"settle": 0, "keep": 1, "observe": observe, "error_sample": 0}
    found = jr.sweep(scene, {"limiter.gap": gaps}, **kept, **run)
    assert (found.status == 0).all() and (found.duty.values[:2] > 0.1).all() and found.duty[2] == 0
    last = jr.simulate(scene, 1, **run).displacement[-1, 0]
    np.testing.assert_allclose(found.section[0, 0], [last.real, last.imag], rtol=1e-9)
    paths = ["shaft.k11", "supports.stiffness", "limiter.gap", "limiter.stiffness"]
    values = np.array([float(np.ravel(scene.get(path))[0]) for path in paths])
    way = values * [0.5, -0.4, 1.0, -0.3]

    def late(x):
        changed = scene.replace(dict(zip(paths, values + x * way, strict=True)))
        motion = jr.simulate(changed, 1, **run, solver=jr.Exponential(2, located=True))
        return 1e6 * motion.displacement[-1, 0].real

    both = lambda x: jax.jvp(late, (x,), (1.0,))  # one program has the values, too
    expected = central(lambda k: float(both(1e-3 * k)[0]), 1e-3)
    assert float(both(0.0)[1]) == pytest.approx(expected, rel=1e-5)
