"""Law of a limiter against its formula, and energy of a rotor that strikes limiters."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Legendre

import jaxrotor as jr
from jaxrotor.effects.law import Now


SPEED = 662.0  # [rad/s]
PERIOD = 2 * np.pi / SPEED


def stop(**values) -> jr.Limiter:
    base = {
        "at": 0.7,
        "angle": np.pi / 3,
        "gap": 7.5e-3,
        "stiffness": 4e6,
        "damping": 60.0,
        "friction": 0.1,
        "rim_radius": 0.1,
    }
    return jr.Limiter(**(base | values))


def force(limiter: jr.Limiter, z, v, speed=SPEED) -> complex:
    """Force of the law as `x + i y`."""
    plane = lambda w: jnp.array([np.real(w), np.imag(w)], float)
    fx, fy = np.asarray(limiter.law()(plane(z), plane(v), Now(jnp.asarray(speed, float))))
    return complex(fx, fy)


def sheet(limiter: jr.Limiter, z: complex, v: complex, speed: float = SPEED) -> complex:
    """`Psi = -r (1 + i f sgn V) exp(i alpha)` by section 1 of the sheet, in SI units."""
    angle, gap = float(limiter.angle), float(limiter.gap)
    local, moving = z * np.exp(-1j * angle), v * np.exp(-1j * angle)
    g = local.real - gap
    r = float(limiter.stiffness) * g + float(limiter.damping) * moving.real
    if g <= 0 or r <= 0:
        return 0j
    slip = speed * float(limiter.rim_radius) + moving.imag
    return -r * (1 + 1j * float(limiter.friction) * np.sign(slip)) * np.exp(1j * angle)


def states(count: int, seed: int) -> list[tuple[complex, complex]]:
    """Random displacements [m] and velocities [m/s] near the stops, with slip of both signs."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(0, 0.02, count) * np.exp(1j * rng.uniform(-np.pi, np.pi, count))
    v = rng.uniform(0, 150, count) * np.exp(1j * rng.uniform(-np.pi, np.pi, count))
    v[::3] *= 1e-3
    return list(zip(z.tolist(), v.tolist(), strict=True))


@pytest.mark.parametrize("speed", [SPEED, -SPEED, 0.0])
def test_law_is_that_of_the_sheet(speed):
    active = 0
    for number, (z, v) in enumerate(states(300, 1)):
        limiter = stop(angle=[np.pi / 3, np.pi, -2.0][number % 3], friction=[0.1, 1.7][number % 2])
        want = sheet(limiter, z, v, speed)
        active += want != 0
        assert force(limiter, z, v, speed) == pytest.approx(want, rel=1e-12, abs=1e-9)
    assert active > 20


@pytest.mark.parametrize("blend", [None, 1e-4])
def test_no_force_inside_the_clearance(blend):
    limiter = stop(blend=blend)
    for z, v in states(200, 2):
        if (z * np.exp(-1j * np.pi / 3)).real <= 7.5e-3:
            assert force(limiter, z, v) == 0
    edge = 7.5e-3 * (1 - 1e-15) * np.exp(1j * np.pi / 3)
    assert force(limiter, edge, 1.0 * edge / abs(edge)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("blend", [None, 1e-4, 5e-3])
def test_a_stop_never_pulls(blend):
    limiter = stop(blend=blend)
    for z, v in states(300, 3):
        assert (force(limiter, z, v) * np.exp(-1j * np.pi / 3)).real <= 0


def test_blended_law_is_the_sharp_one_outside_its_width():
    blend = 1e-4
    hits = 0
    for z, v in states(400, 4):
        depth = (z * np.exp(-1j * np.pi / 3)).real - 7.5e-3
        sharp = sheet(stop(), z, v)
        if depth > blend and abs(sharp) > 4e6 * blend * np.hypot(1, 0.1):
            hits += 1
            assert force(stop(blend=blend), z, v) == pytest.approx(sharp, rel=1e-12)
    assert hits > 20
    # without force where the sharp law has none, as the rotor leaves the stop
    out = np.exp(1j * np.pi / 3)
    assert sheet(stop(), 7.6e-3 * out, -50 * out) == force(
        stop(blend=5e-5), 7.6e-3 * out, -50 * out
    )


def second_difference(f, x: float, h: float) -> float:
    return (f(x + h) - 2 * f(x) + f(x - h)) / h**2


@pytest.mark.parametrize("closing", [0.0, 0.5, -0.5])
def test_blended_law_is_twice_differentiable(closing):
    """The curvature of the force over the depth has no jump at the gap nor at the end of the blend."""
    blend, out = 1e-3, np.exp(1j * np.pi / 3)
    limiter = stop(blend=blend, friction=0.0)
    scale = 4e6 / blend  # scale of the curvature

    def normal(depth):
        return -(force(limiter, (7.5e-3 + depth) * out, closing * out) / out).real

    for edge in (0.0, blend):
        jumps = []
        for h in (2e-5, 1e-5, 5e-6):
            left = second_difference(normal, edge - 2 * h, h)
            right = second_difference(normal, edge + 2 * h, h)
            jumps.append(abs(right - left) / scale)
        assert jumps[-1] < 0.6 * jumps[0] + 1e-9  # falls in proportion to h: continuous
        assert jumps[-1] < 1
    sharp = lambda depth: -(force(stop(friction=0.0), (7.5e-3 + depth) * out, 0j) / out).real
    assert second_difference(sharp, 0.0, 1e-5) / scale > 10  # the sharp law has a kink


def test_release_of_a_blended_stop_is_twice_differentiable():
    """The curvature over the closing speed is continuous where a damped stop is released."""
    blend, out = 1e-3, np.exp(1j * np.pi / 3)
    limiter = stop(blend=blend, friction=0.0)
    at = (7.5e-3 + 2 * blend) * out
    normal = lambda v: -(force(limiter, at, v * out) / out).real
    release = -4e6 * 2 * blend / 60.0
    width = 4e6 * blend / 60.0
    scale = 60.0 / width
    for edge in (release, release + width):
        jumps = []
        for h in (width / 50, width / 100, width / 200):
            left = second_difference(normal, edge - 2 * h, h)
            right = second_difference(normal, edge + 2 * h, h)
            jumps.append(abs(right - left) / scale)
        assert jumps[-1] < 0.6 * jumps[0] + 1e-9
    assert normal(release - 1) == 0


@pytest.mark.hard("1.4 sign of friction smoothed over a stated width")
def test_smoothed_friction_sign_is_twice_differentiable():
    width, out = 2.0, np.exp(1j * np.pi / 3)
    limiter = stop(slip=width)
    at = 8e-3 * out
    rim = SPEED * 0.1

    def sign(slip):
        local = force(limiter, at, 1j * (slip - rim) * out) / out
        return local.imag / local.real / 0.1

    for slip in (-7.0, -2.0, 2.0, 30.0):
        assert sign(slip) == pytest.approx(np.sign(slip), abs=1e-12)
    assert sign(0.0) == pytest.approx(0, abs=1e-12)
    assert sign(0.7) == pytest.approx(-sign(-0.7), abs=1e-12)
    for edge in (-width, 0.0, width):
        jumps = []
        for h in (width / 50, width / 100, width / 200):
            left = second_difference(sign, edge - 2 * h, h)
            right = second_difference(sign, edge + 2 * h, h)
            jumps.append(abs(right - left) * width**2)
        assert jumps[-1] < 0.6 * jumps[0] + 1e-6


@pytest.mark.hard("1.2 gradients beside a contact that is not there")
@pytest.mark.parametrize("blend", [None, 1e-4])
@pytest.mark.parametrize("gap", [0.0, 7.5e-3])
def test_law_is_safe_at_the_centre(gap, blend):
    """Values and derivatives by every number are finite, at rest in the centre and just touching."""
    limiter = stop(gap=gap, blend=blend, slip=1.0)

    def pull(limiter, z, v):
        return jnp.sum(limiter.law()(z, v, Now(jnp.asarray(0.0))))

    zero = jnp.zeros(2)
    touching = gap * jnp.array([jnp.cos(jnp.pi / 3), jnp.sin(jnp.pi / 3)])
    for z in (zero, touching):
        assert float(pull(limiter, z, zero)) == pytest.approx(0, abs=1e-6)
        slopes = jax.grad(pull, argnums=(0, 1, 2))(limiter, z, zero)
        assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(slopes))


# === energy

POINTS = 0.35 * (1 - np.cos(np.pi * np.arange(1, 17) / 16))  # stations [m], the last at the tip
TIP = (0.7, *POINTS[:-1])


def passive(**limiter) -> jr.Scene:
    """Rotor between stops, without rotation, damping, unbalance and friction."""
    shaft = jr.FlexibleShaft(0.7, 0.02, nodes=12, constraints=[jr.Constraint(0.0, "clamp")])
    stops = [
        stop(angle=np.pi / 3 + k * 2 * np.pi / 3, **({"friction": 0.0, "damping": 0.0} | limiter))
        for k in range(3)
    ]
    disc = jr.Disc.from_dimensions(0.7, 0.2, 0.01)
    return jr.Scene(shaft, disc, *stops, spin=jr.ConstantSpeed(0.0))


def energy(z: np.ndarray, v: np.ndarray, stiffness: float) -> float:
    """Kinetic, elastic and contact energy [J] from displacement and velocity at the stations `TIP`.

    The displacement is a polynomial of degree 13 between clamp and disc, so the fit is exact.
    """
    x = np.array([0.0, *TIP])
    line = lambda w: [
        Legendre.fit(x, part, 13, domain=[0, 0.7]) for part in (np.r_[0, w.real], np.r_[0, w.imag])
    ]
    square = lambda f: (f * f).integ(lbnd=0)(0.7)
    area, second = np.pi * 0.02**2 / 4, np.pi * 0.02**4 / 64
    mass = 7850 * np.pi * 0.2**2 / 4 * 0.01
    diametral = mass * 0.2**2 / 16 + mass * 0.01**2 / 12
    total = 0.0
    for f in line(v):
        along = 7850 * area * square(f) + 7850 * second * square(f.deriv())
        total += (along + mass * f(0.7) ** 2 + diametral * f.deriv()(0.7) ** 2) / 2
    for f in line(z):
        total += 2.1e11 * second * square(f.deriv(2)) / 2
    for k in range(3):
        depth = (z[0] * np.exp(-1j * (np.pi / 3 + k * 2 * np.pi / 3))).real - 7.5e-3
        total += stiffness * max(depth, 0) ** 2 / 2
    return float(total)


@functools.cache
def history(steps: int, stiffness: float, damping: float, order: int = 4) -> np.ndarray:
    """Energy 16 times in each of 12 periods, which are shorter than those of the motion."""
    start = jr.Whirl(0.012, 12.0, 0.9)
    built = passive(stiffness=stiffness, damping=damping)
    r = jr.simulate(
        built, 12, steps, solver=jr.Exponential(order), start=start, at=TIP, period=0.0226
    )
    force = abs(np.asarray(r.contact_force))
    assert np.count_nonzero(force.max(axis=0)) >= 2  # at least two stops are struck
    every = steps // 16
    pairs = zip(r.displacement[::every], r.velocity[::every], strict=True)
    return np.array([energy(np.asarray(z), np.asarray(v), stiffness) for z, v in pairs])


@pytest.mark.slow
@pytest.mark.hard("1.8 energy of a passive rotor between stops")
def test_passive_rotor_keeps_its_energy(record_property):
    """Energy of the shaft, the disc and the stops is that of the start at every instant."""
    kept = history(1024, 5e4, 0.0)
    change = np.ptp(kept) / kept[0]
    record_property("measured", f"energy changes by {change:.0e}")
    assert change < 1e-6
    # Coarse steps of low order change the energy.
    error = [
        abs(history(steps, 5e4, 0.0, 2)[-64:].mean() / kept[-64:].mean() - 1) for steps in (16, 64)
    ]
    assert change < error[1] < error[0] / 4


@pytest.mark.slow
@pytest.mark.hard("1.8 energy of a passive rotor between stops")
def test_damped_stops_only_take_energy():
    kept = history(1024, 5e4, 30.0)
    assert kept[-1] < 0.99 * kept[0]
    assert np.diff(kept).max() < 1e-9 * kept[0]
