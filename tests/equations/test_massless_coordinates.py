"""Coordinates without mass in time: against scipy, where they are eliminated by hand."""

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import check_forward
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.equations.rotating_frame import massless_of


FINE = dfx.PIDController(rtol=1e-11, atol=1e-15)
MASS, SHAFT, ANISOTROPY, DAMPING, OUTSIDE = 10.0, 1e5, 0.2, 160.0, 100.0
HELD, DAMPED = 2e5, 320.0  # stiffness and damping of both supports
UNBALANCE = MASS * 1e-4
AXIS = np.exp(2j * 0.4)  # of supports that are unequal along directions fixed in space


def rotor(spin, *effects, damping=DAMPING, support=None):
    """Disc between two massless elastic ends."""
    support = {"damping": DAMPED / 2} if support is None else support
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, SHAFT, anisotropy=ANISOTROPY, damping=damping, ends="elastic"),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, OUTSIDE),
        jr.Unbalance(0.5, MASS, UNBALANCE / MASS),
        jr.Gravity(9.81, 0.0),
        *[jr.Support(at, HELD / 2, **support) for at in (0.0, 1.0)],
        *effects,
        spin=spin,
    )


def by_scipy(rates, times, size):
    """Complex states of `y. = rates(t, y)` by an explicit method of order 8."""
    real = lambda y: np.stack([y.real, y.imag]).ravel()
    whole = lambda y: y[:size] + 1j * y[size:]
    found = solve_ivp(
        lambda t, y: real(np.array(rates(t, whole(y)))),
        (0, times[-1]),
        np.zeros(2 * size),
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


def test_shipped_scene_with_damped_supports():
    """`dual-stiffness-elastic`: the ends follow an equation of first order."""
    scene = jr.load("dual-stiffness-elastic").replace({"gravity.acceleration": 9.81})
    times = np.linspace(0, 0.5, 51)

    def parts(t, z, dz, z0):
        turn = np.exp(1j * 80.0 * t)
        stretch = z - z0
        elastic = SHAFT * (stretch + ANISOTROPY * np.conj(stretch) * turn**2)
        inside = DAMPING * (dz - 80j * stretch)
        dz0 = (elastic + inside - HELD * z0) / (DAMPED + DAMPING)
        return dz0, elastic + inside - DAMPING * dz0

    def rates(t, y):
        z, dz, z0 = y
        dz0, pull = parts(t, z, dz, z0)
        return dz, accelerated(t, z, dz, pull), dz0

    z, dz, z0 = by_scipy(rates, times, 3)
    run = jr.run_up(scene, times, at=[0.5, 0.0], controller=FINE, solver=dfx.Dopri8())
    expected = np.stack([z, z0], axis=1)
    velocity = np.stack([dz, parts(times, z, dz, z0)[0]], axis=1)
    assert np.abs(run.displacement - expected).max() < 1e-9 * np.abs(expected).max()
    assert np.abs(run.velocity - velocity).max() < 1e-8 * np.abs(velocity).max()
    force = np.asarray(jr.reactions(run).force)  # of both supports on the rotor
    held = -(HELD * z0 + DAMPED * velocity[:, 1])
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
@pytest.mark.parametrize("path", ["supports.stiffness", "supports.damping", "disc.mass"])
def test_derivatives(path):
    """Also while masses are traced, when it is not known which of them are zero."""
    scene, times = rotor(jr.ConstantSpeed(80.0)), jnp.linspace(0.0, 0.1, 5)
    value = float(np.ravel(scene.get(path))[0])

    def late(x):
        run = jr.run_up(scene.replace({path: x[0]}), times, controller=FINE, solver=dfx.Dopri8())
        return 1e6 * run.displacement[-1, 0].real

    check_forward(late, jnp.array([value]), 1e-3)


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


def test_exponential_steps_refuse_a_coordinate_without_mass():
    shaft = jr.MasslessShaft(1.0, 0.5, SHAFT, ends="elastic")
    equal = jr.Scene(shaft, *rotor(jr.ConstantSpeed(80.0)).effects, spin=jr.ConstantSpeed(80.0))
    steps = {"solver": jr.Exponential()}
    calls = (
        lambda: jr.simulate(equal, 5, **steps),
        lambda: jr.sweep(equal, {"disc.mass": [1.0]}, **steps),
        lambda: jr.lyapunov(equal, 1),
    )
    for call in calls:
        with pytest.raises(ValueError, match="has no mass|has none"):
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
    scene, times = jr.load("dual-stiffness-elastic"), jnp.linspace(0.0, 0.05, 3)
    run = {"solver": dfx.Dopri8(), "max_steps": 500}
    last = lambda scene: jr.run_up(scene, times, **run).displacement[-1, 0]
    stiffness = jnp.array([0.9e5, 1.1e5])
    mapped = jax.vmap(lambda k: last(scene.replace({"supports.stiffness": k})))(stiffness)
    alone = [last(scene.replace({"supports.stiffness": k})) for k in stiffness]
    np.testing.assert_allclose(mapped, alone, rtol=1e-5)
    touched = jr.Scene(
        scene.shaft, *scene.effects, jr.Limiter(0.0, 0.0, 1e-9, 1e6), spin=scene.spin
    )
    assert not np.isfinite(jax.jit(lambda m: last(touched.replace({"disc.mass": m})))(10.0))
