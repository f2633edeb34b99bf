"""Seal: force and torque, onset of whirl, circles of whirl, motions and orbits of a disc in one."""

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import check_by_each
from numpy.polynomial import Polynomial

import jaxrotor as jr
from jaxrotor.effects.law import Now


MASS, STIFFNESS, DAMPING, INERTIA, GAP, SWIRL = 30.0, 2.4e6, 900.0, 4.0, 0.4e-3, 0.46
GIVEN = {
    "clearance": GAP,
    "stiffness": 6e5,
    "damping": 1800.0,
    "swirl": SWIRL,
    "inertia": INERTIA,
    "exponent": 2.0,
    "swirl_exponent": 0.6,
}
THRESHOLD, ONSET_WHIRL = 1014.4092665841, 311.0855084191
TIGHT = {"solver": dfx.Dopri8(), "controller": dfx.PIDController(rtol=1e-12, atol=1e-16)}
# Over the threshold: radius over the clearance, whirl rate, exponents in axes that turn with the whirl
CIRCLES = {
    1.02: (0.0331787465, 311.1761689541, (-1.027226944, -79.01490237 + 512.945216225j)),
    1.1: (0.1613592376, 313.2728839487, (-5.031659918, -79.76430502 + 521.201375853j)),
    1.3: (0.4137060492, 327.7539482176, (-19.78312533, -93.64178018 + 573.580237651j)),
}


def seal(**values):
    return jr.Seal(0.5, **(GIVEN | values))


def machine(speed=1000.0, eccentricity=0.0, weight=0.0, **values):
    """A disc on a massless shaft with the seal around it."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, STIFFNESS),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, DAMPING),
        jr.Gravity(weight / MASS),
        jr.Unbalance(0.5, MASS, eccentricity),
        seal(**values),
        spin=jr.ConstantSpeed(speed),
    )


def own_roots(speed, place=0.0, whirl=0.0, weight=0.0, **values):
    """Roots of `[x, v]` of the disc about a circle or a rest, written here, and what is left of forces.

    In axes that turn at the whirl rate `w`: (m + m_f) (a + 2 i w v - w^2 z) + c (v + i w z) + k z = F.
    """
    law, mass, fluid = seal(**values).law(), MASS, values.get("inertia", INERTIA)
    turned = lambda z: jnp.stack([-z[1], z[0]])

    def rates(state):
        z, v = jnp.split(state, 2)
        absolute = v + whirl * turned(z)
        force = law(z, absolute, Now(jnp.asarray(speed)))
        force = force - DAMPING * absolute - STIFFNESS * z - jnp.array([0.0, weight])
        across = 2 * whirl * turned(v) - whirl**2 * z
        return jnp.concatenate([v, force / (mass + fluid) - across])

    at = jnp.array([np.real(place), np.imag(place), 0.0, 0.0])
    return np.linalg.eigvals(np.asarray(jax.jacfwd(rates)(at))), np.asarray(rates(at))


# === force


def test_force_is_that_of_turning_axes():
    """A spring, a damper and a mass that turn at `q = tau Omega`, written as complex numbers."""
    law, rng = seal().law(), np.random.default_rng(3)
    for _ in range(4):
        z, v = (rng.uniform(-0.5, 0.5, 2) @ [1, 1j] * scale for scale in (GAP, 0.1))
        speed, eps = rng.uniform(-1500, 1500), abs(z) / GAP
        k, d = (part * (1 - eps**2) ** -2 for part in (6e5, 1800.0))
        q = SWIRL * (1 - eps) ** 0.6 * speed
        wanted = -(k - INERTIA * q**2 - 1j * q * d) * z - (d - 2j * INERTIA * q) * v
        place, velocity = (jnp.array([part.real, part.imag]) for part in (z, v))
        x, y = found = law(place, velocity, Now(jnp.asarray(speed)))
        np.testing.assert_allclose(x + 1j * y, wanted, rtol=1e-13)
        torque = law.torque(found, place, velocity, Now(jnp.asarray(speed)))
        np.testing.assert_allclose(torque, -q / speed * np.imag(np.conj(z) * wanted), rtol=1e-12)


def test_power_is_lost_to_the_fluid():
    """`Re(F* z.) + T Omega = -dE/dt - D |z. - i q z|^2` of a constant tau, with the mass of the fluid."""
    law, speed = seal(swirl_exponent=None).law(), 900.0
    q = SWIRL * speed
    path = lambda t: GAP * (0.3 * jnp.exp(1j * 200 * t) + (0.2 - 0.1j) * jnp.exp(-330j * t))
    parts = lambda f: lambda t: jnp.stack([f(t).real, f(t).imag])
    place = parts(path)
    velocity = jax.jacfwd(place)
    acceleration = jax.jacfwd(velocity)

    def energy(t):
        square = jnp.sum(place(t) ** 2)
        spring = 6e5 * GAP**2 / 2 * (1 / (1 - square / GAP**2) - 1)  # Int K r dr of exponent 2
        return spring + INERTIA / 2 * (jnp.sum(velocity(t) ** 2) - q**2 * square)

    for t in (0.0, 0.004, 0.011):
        z, v, a = place(t), velocity(t), acceleration(t)
        force = law(z, v, Now(jnp.asarray(speed))) - INERTIA * a
        momentum = z[0] * v[1] - z[1] * v[0]
        damping = 1800.0 * (1 - jnp.sum(z**2) / GAP**2) ** -2
        lost = damping * (jnp.sum(v**2) - q * momentum)
        assert float(force @ v) == pytest.approx(float(-jax.jacfwd(energy)(t) - lost), rel=1e-11)


def test_centre_and_wall():
    law, still = seal().law(), jnp.zeros(2)
    now = Now(jnp.asarray(1000.0))
    slopes = jax.jacfwd(lambda z: law(z, still, now))(still)
    q = SWIRL * 1000.0
    direct, across = 6e5 - INERTIA * q**2, q * 1800.0
    np.testing.assert_allclose(slopes, [[-direct, -across], [across, -direct]], rtol=1e-14)
    assert np.isnan(law(jnp.array([GAP, 0.0]), still, now)).all()
    assert np.isfinite(law(jnp.array([0.999 * GAP, 0.0]), still, now)).all()


def test_without_a_fluid_there_is_no_force():
    law = jr.Seal(0.5, GAP, 0.0, 0.0, SWIRL).law()
    assert not np.any(law(jnp.array([1e-4, 2e-4]), jnp.ones(2), Now(jnp.asarray(900.0))))
    blocks = jr.assemble(machine(inertia=None)).blocks
    np.testing.assert_array_equal(blocks.inertia, [[MASS]])


# === linear


def onset(near, **values):
    """Speed at which the growth rate crosses zero, through which it is interpolated.

    Within rounding of a root the library gives 0 for it, which a search would stop at.
    """
    growth = lambda speed: float(jr.growth_rate(jr.linearized(machine(speed, **values))))
    apart = np.array([-4.0, -3, -2, -1, 1, 2, 3, 4])
    fitted = Polynomial.fit(apart, [growth(near + one) for one in apart], apart.size - 1)
    roots = fitted.roots()
    return near + float(roots[np.argmin(np.abs(roots))].real)


def test_roots_and_threshold_of_the_centred_shaft():
    found = np.asarray(jr.roots(jr.linearized(machine(1000.0))))
    wanted = [-0.735726265 + 311.434595910j, -78.676038441 - 203.199301792j]
    for root in wanted:
        assert np.abs(found - root).min() < 1e-8
    assert onset(1014.2) == pytest.approx(THRESHOLD, abs=1e-7)
    at = np.asarray(jr.roots(jr.linearized(machine(THRESHOLD))))
    assert np.abs(at - 1j * ONSET_WHIRL).min() < 1e-8


def test_weight_makes_it_stable():
    """Eccentric rests, and their threshold, which is higher."""
    heavy = lambda speed: machine(speed, weight=294.3)
    rest = jr.static_positions(heavy(1200.0))
    place = complex(rest.position[0, 0]) / GAP
    assert place == pytest.approx(0.1129536211 - 0.2707197168j, abs=1e-9)
    assert float(rest.eccentricity[0, 0]) == pytest.approx(abs(place), rel=1e-12)
    found = np.asarray(jr.roots(jr.linearized(heavy(1200.0))))
    assert np.abs(found - (-1.477692979 + 338.081516304j)).min() < 1e-8
    own, left = own_roots(1200.0, place * GAP, weight=294.3)
    assert np.abs(left).max() < 1e-6
    assert all(np.abs(found - root).min() < 1e-7 for root in own)
    assert onset(1237.3, weight=294.3) == pytest.approx(1237.5457974071, abs=1e-6)


def test_linear_analyses_ask_for_a_position():
    with pytest.raises(ValueError, match=r"Films and seals \(seal\) have linear coefficients"):
        jr.roots(machine())


# === circles of whirl


@pytest.mark.parametrize("ratio", CIRCLES)
def test_circle_of_whirl(ratio):
    """A circle that the closed form gives balances, and has the exponents of the sheet."""
    radius, whirl, exponents = CIRCLES[ratio]
    speed = ratio * THRESHOLD
    share = 1800.0 / (DAMPING + 1800.0)
    tau = SWIRL * (1 - radius) ** 0.6
    harder = (1 - radius**2) ** -2
    share = 1800.0 * harder / (DAMPING + 1800.0 * harder)
    assert share * tau * speed == pytest.approx(whirl, rel=1e-9)
    found, left = own_roots(speed, radius * GAP, whirl)
    assert np.abs(left).max() < 1e-5
    for exponent in (0.0, *exponents):
        assert np.abs(found - exponent).min() < 1e-6


@pytest.mark.slow
def test_orbit_of_the_whirl():
    """Found by shooting, with a period of its own, and its multipliers."""
    radius, whirl, exponents = CIRCLES[1.1]
    scene = machine(1.1 * THRESHOLD)
    start = jr.Whirl(radius * GAP, rate=whirl)
    orbit = jr.periodic(scene, jr.simulate(scene, 20, 64, start=start), steps_per_revolution=512)
    period = 2 * np.pi / whirl
    assert float(orbit.period) == pytest.approx(period, rel=1e-9)
    np.testing.assert_allclose(np.abs(orbit.displacement[:, 0]), radius * GAP, rtol=1e-8)
    found = np.asarray(orbit.multipliers)
    for exponent in exponents:  # that of a shift in time, 1, is left out
        assert np.abs(found - np.exp(exponent * period)).min() < 1e-7


@pytest.mark.slow
def test_synchronous_orbits_and_their_end():
    """Radii of the closed form (9), and where a second frequency appears."""
    scene = machine(600.0, 20e-6)
    steps = {"steps_per_revolution": 256}
    slow = jr.periodic(scene, jr.AtRest(), **steps)
    radius = np.abs(np.asarray(slow.displacement[:, 0])) / GAP
    np.testing.assert_allclose(radius, 0.0648800211, rtol=0, atol=1e-9)
    branch = jr.continue_(slow, "spin.speed", (600.0, 1100.0))
    (end,) = branch.of("neimark-sacker")
    assert end.value == pytest.approx(1063.0984352901, abs=1e-5)
    fast = jr.periodic(scene.at_speed(1000.0), jr.AtRest(), **steps)
    np.testing.assert_allclose(np.abs(fast.displacement[:, 0]) / GAP, 0.0530186169, atol=1e-9)
    assert fast.stable


# === motions


def end_of(scene, duration=0.4):
    start = jr.Launch(jr.Continued(jnp.array([0.1 * GAP + 0j]), jnp.zeros(1, complex)))
    run = jr.run_up(scene, jnp.array([0.0, duration]), start=start, **TIGHT)
    return run.displacement[-1, 0] / GAP


@pytest.mark.slow
def test_motion_above_the_threshold():
    """Final displacements of DOP853, and derivatives of one by every number against differences."""
    speed = 1115.850193
    even, heavy = end_of(machine(speed)), end_of(machine(speed, 20e-6))
    assert complex(even) == pytest.approx(-0.0208809611 - 0.1160451501j, abs=1e-8)
    assert complex(heavy) == pytest.approx(0.0662161954 - 0.0984851540j, abs=1e-8)
    names = [f"seal.{name}" for name in (*GIVEN, "offset", "angle")] + ["spin.speed"]
    scene = machine(speed, 20e-6, offset=1e-5, angle=0.3)
    values = jnp.array([float(scene.get(name)) for name in names])

    def seen(values):
        given = dict(zip(names, values, strict=True))
        z = end_of(scene.replace(given), 0.02)
        return jnp.stack([z.real, z.imag])

    check_by_each(seen, values, 1e-3, least=0.0)


def test_order_of_steps():
    """Steps of order 4 have that order; numbers of steps that double share a program."""
    scene, start = machine(1.1 * THRESHOLD, 20e-6), jr.Whirl(0.3 * GAP, rate=300.0)
    times = jnp.linspace(0.0, 0.04, 9)
    move = lambda count: jr.run_up(
        scene, times, substeps=count, solver=jr.Exponential(4), start=start
    ).displacement[-1, 0]
    coarse, fine, exact = map(move, (32, 64, 1024))
    errors = abs(coarse - exact), abs(fine - exact)
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.3) and errors[1] < 1e-5 * GAP


@pytest.mark.slow
def test_a_shaft_at_the_wall_is_told():
    with pytest.raises(RuntimeError, match=r"At the wall of a bearing \(seal\) there is no force"):
        jr.simulate(machine(1000.0, 2e-3), 4, 64)
