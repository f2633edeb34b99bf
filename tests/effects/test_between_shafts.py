"""Balls, rubs and oil films between two shafts: laws, energy, motions by DOP853, and rest under weight."""

import dataclasses

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from shafts_of_tests import launched, toy

import jaxrotor as jr
from jaxrotor.effects.law import Beside, Now


FINE = dfx.PIDController(rtol=1e-10, atol=1e-13)
TIMES = np.linspace(0.0, 25.0, 26)
BEGIN = np.array([0.05, -0.03j, 0.0, 0.0])
FIRST = 1.4  # speed of the first shaft
MASS, POLAR, SPRING = np.array([1.0, 0.6]), np.array([0.2, 0.18]), np.array([1.0, 2.0])
STILL, TURNING = np.array([0.04, 0.03]), np.array([0.01, 0.02])  # dampers
JOINT, UNBALANCE = 0.02, np.array([0.05, 0.03 * np.exp(0.7j)])
ACROSS = np.array([1.0, -1.0])

INNER, BALLS, HERTZ, GAP = 0.4, 5, 40.0, 0.03
RIM, STIFF, DAMPER, FRICTION = 4.0, 20.0, 0.3, 0.05
FILM = {"viscosity": 1.0, "radius": 0.3, "length": 0.4, "clearance": 0.5}

at = {"at": ("lp", 1.0), "on": "hp"}
balls = jr.RollingBearing(
    **at,
    balls=BALLS,
    stiffness=HERTZ,
    gap=GAP,
    inner_radius=INNER,
    outer_radius=1 - INNER,
    angle=0.2,
)
ring = jr.AnnularStator(
    **at, gap=GAP, stiffness=STIFF, damping=DAMPER, friction=FRICTION, rim_radius=RIM
)
film = jr.JournalBearing(**at, **FILM, cavitated=False)


# === forces and torques, written here; each also has its stored and its lost power


def of_balls(t, d, v, w):
    angles = (INNER * w[0] + (1 - INNER) * w[1]) * t + 0.2 + 2 * np.pi * np.arange(BALLS) / BALLS
    depth = np.maximum((d * np.exp(-1j * angles)).real - GAP, 0.0)
    force = -HERTZ * (depth**1.5 * np.exp(1j * angles)).sum()
    moment = (np.conj(d) * force).imag
    torques = np.array([-INNER * moment, -(1 - INNER) * moment])
    return force, torques, HERTZ * (depth**2.5).sum() / 2.5, 0.0


def of_ring(t, d, v, w):
    radius = abs(d)
    n, depth = d / radius, radius - GAP
    closing = (v * np.conj(n)).real
    if depth <= 0 or STIFF * depth + DAMPER * closing <= 0:
        return 0j, np.zeros(2), 0.0, 0.0
    normal = STIFF * depth + DAMPER * closing
    slip = w[0] * RIM - w[1] * (RIM + GAP) + (v * np.conj(n)).imag
    rub = FRICTION * normal * np.sign(slip)
    torques = rub * np.array([-RIM, RIM + GAP])
    # The ring leaves the rim while it is pressed in, so what it stores is not all given back.
    lost = normal * closing + FRICTION * normal * abs(slip)
    return -(normal + 1j * rub) * n, torques, 0.0, lost


def of_film(t, d, v, w):
    k0, c = (
        FILM["viscosity"] * FILM["radius"] * FILM["length"] ** 3 / FILM["clearance"] ** 2,
        FILM["clearance"],
    )
    zeta, rate = d / c, v / c - 0.5j * w.sum() * d / c
    s = np.sqrt(1 - abs(zeta) ** 2)
    squeezed = (zeta * np.conj(rate)).real
    force = -np.pi * k0 * (3 * zeta * squeezed / s**5 + rate / s**3)
    shear = 2 * np.pi * FILM["viscosity"] * FILM["radius"] ** 3 * FILM["length"] / c
    couette = shear * (w[0] - w[1]) / s
    half = (np.conj(d) * force).imag / 2
    lost = couette * (w[0] - w[1]) + np.pi * k0 * c * (
        3 * squeezed**2 / s**5 + abs(rate) ** 2 / s**3
    )
    return force, np.array([-couette - half, couette - half]), 0.0, lost


LAWS = {"balls": (balls, of_balls), "ring": (ring, of_ring), "film": (film, of_film)}


def states(count=40):
    draw = np.random.default_rng(3)
    d = draw.uniform(0.005, 0.2, count) * np.exp(1j * draw.uniform(-3, 3, count))
    v = draw.normal(size=count) + 1j * draw.normal(size=count)
    return zip(d, 0.2 * v, draw.uniform(0, 9, count), draw.uniform(-2, 2, (count, 2)), strict=True)


@pytest.mark.parametrize("name", LAWS)
def test_force_and_torque(name):
    contact, own = LAWS[name]
    law = contact.law()
    for d, v, t, w in states():
        wanted, torques, _, _ = own(t, d, v, w)
        place, velocity = (jnp.array([z.real, z.imag]) for z in (d, v))
        now = Now(w[0], w[0] * t, beside=Beside(w[1], w[1] * t))
        force = law(place, velocity, now)
        assert complex(*np.asarray(force)) == pytest.approx(wanted, rel=1e-11, abs=1e-13)
        found = law.torque(force, place, velocity, now)
        assert float(found) == pytest.approx(torques[0], rel=1e-11, abs=1e-13)
        if name != "ring":  # a massless joint keeps the angular momentum of both shafts
            assert torques.sum() == pytest.approx(-(np.conj(d) * wanted).imag, abs=1e-13)


@pytest.mark.parametrize("ratio", [1.0, -1.2, 0.4])
def test_balls_between_shafts_of_a_ratio_are_those_of_such_an_outer_race(ratio):
    """At a ratio of 1 the cage is locked to both."""
    one = jr.RollingBearing(
        0.0, BALLS, HERTZ, GAP, INNER, 1 - INNER, angle=0.2, outer_speed=ratio
    ).law()
    place, still = jnp.array([0.1, -0.05]), jnp.zeros(2)
    now = Now(FIRST, jnp.asarray(3.1))
    both = now._replace(beside=Beside(ratio * FIRST, ratio * jnp.asarray(3.1)))
    np.testing.assert_allclose(balls.law()(place, still, both), one(place, still, now), rtol=1e-12)


def test_a_squeeze_film_between_shafts_turns_with_what_it_stands_on():
    """As one that stands, in the axes of that shaft."""
    law = jr.SqueezeFilm(**at, **FILM).law()
    d, v, w = 0.1 + 0.02j, 0.03 - 0.05j, 1.7
    pair = lambda z: jnp.array([z.real, z.imag])
    found = law(pair(d), pair(v), Now(0.3, beside=Beside(w, None)))
    wanted = law(pair(d), pair(v - 1j * w * d), Now(0.3))
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


# === motions


def field_of(ratio, speed, *laws):
    """Equations of the toy in time with laws between its shafts, and the power of all that acts on it."""
    w = np.array([FIRST, ratio * FIRST + speed])

    def field(t, y):
        z, v = y[:2].astype(complex), y[2:4]
        d, rate = z @ ACROSS, v @ ACROSS
        load = UNBALANCE * w**2 * np.exp(1j * w * t)
        drag = -TURNING * (v - 1j * w * z)
        force = load - STILL * v + drag - JOINT * rate * ACROSS - SPRING * z
        power = (np.conj(load) * v).real.sum() - STILL @ abs(v) ** 2 - JOINT * abs(rate) ** 2
        power += (np.conj(drag) * v).real.sum()
        for law in laws:
            own, torques, _, lost = law(t, d, rate, w)
            force = force + own * ACROSS
            power -= lost + torques @ w
        return np.concatenate([v, (force + 1j * w * POLAR * v) / MASS, [power]])

    return field, w


def energy(t, z, v, w, *laws):
    own = [law(t, z @ ACROSS, v @ ACROSS, w)[2] for law in laws]
    return MASS @ abs(v) ** 2 / 2 + SPRING @ abs(z) ** 2 / 2 + sum(own)


JOINTS = {"balls and a rub": ("balls", "ring"), "a film": ("film",)}


@pytest.mark.slow  # tight steps of two scenes
@pytest.mark.filterwarnings("ignore::jaxrotor.ImplausibleWarning")
@pytest.mark.parametrize("name", JOINTS)
def test_motions_and_their_energy(name):
    """A ratio with a speed of its own, and counter-rotation."""
    parts, laws = zip(*(LAWS[one] for one in JOINTS[name]), strict=True)
    for ratio, speed in ((1.3, 0.2), (-1.2, 0.0)):
        scene = toy(ratio, speed, *parts, k12=0.0)
        run = {"at": ("lp", 1.0), "solver": dfx.Dopri8(), "controller": FINE}
        motion = jr.run_up(scene, TIMES, **run, start=launched())
        field, w = field_of(ratio, speed, *laws)
        begin = np.append(BEGIN, 0.0)
        found = solve_ivp(field, (0, 25), begin, "DOP853", TIMES, rtol=1e-11, atol=1e-14)
        assert abs(found.y[0] - found.y[1]).max() > 1.5 * GAP
        np.testing.assert_allclose(motion.coordinates, found.y[:2].T, atol=5e-8)
        ends = motion.end.shaft
        last = energy(25.0, np.asarray(ends.q), np.asarray(ends.velocity), w, *laws)
        first = energy(0.0, BEGIN[:2], BEGIN[2:], w, *laws)
        assert last - first == pytest.approx(found.y[4, -1].real, abs=1e-8)


@pytest.mark.slow  # lanes and a run are two programs
def test_lanes_over_the_ratio_are_runs():
    scene, times = toy(1.3, None, balls, ring, k12=0.0), np.linspace(0.0, 20.0, 129)
    run = {"times": times, "at": ("lp", 1.0), "solver": jr.Exponential(order=4)}
    fine = {"steps_per_revolution": 512, "error_sample": 0, "progress": False}
    ratios = {"coaxial_shaft.ratio": [-1.2, 1.3]}
    lanes = jr.sweep(scene, ratios, **run, start=launched(), **fine)
    for number, ratio in enumerate((-1.2, 1.3)):
        alone = jr.simulate(scene.replace({"coaxial_shaft.ratio": ratio}), **run, start=launched())
        peak = float(np.abs(alone.displacement).max())
        assert float(lanes["peak"][number]) == pytest.approx(peak, rel=5e-3)


# === rest


def rest_of(law, weights=MASS - POLAR / 2):
    """Coordinates at rest under weight, by scipy."""
    w = np.array([FIRST, -1.2 * FIRST])

    def residual(x):
        z = x[:2] + 1j * x[2:]
        force = law(0.0, z @ ACROSS, 0j, w)[0]
        found = (SPRING - 1j * TURNING * w) * z - force * ACROSS + 0.1j * weights
        return np.concatenate([found.real, found.imag])

    found = root(residual, np.array([0.01, -0.01, -0.12, -0.02]), tol=1e-14)
    assert np.abs(residual(found.x)).max() < 1e-13
    z = found.x[:2] + 1j * found.x[2:]
    return z @ ACROSS, w


@pytest.mark.parametrize("name", ["film", pytest.param("balls", marks=pytest.mark.slow)])
def test_rest_and_small_motions_about_it(name):
    contact, own = LAWS[name]
    if name == "balls":
        contact = dataclasses.replace(contact, linear="frozen")
    scene = toy(-1.2, None, jr.Gravity(0.1), contact, k12=0.0)
    found = jr.static_positions(scene)
    place, w = rest_of(own)
    assert complex(found.position[0, 0]) == pytest.approx(place, rel=1e-9)

    def slopes(of):  # (2, 2), by differences
        ahead = [1e-6 * (of(step) - of(-step)) for step in (1e-6, 1e-6j)]
        return -1e6 * np.array([[z.real for z in ahead], [z.imag for z in ahead]]) * 0.5e6

    stiffness = slopes(lambda step: own(0.0, place + step, 0j, w)[0])
    np.testing.assert_allclose(found.stiffness[0, 0], stiffness, rtol=1e-5, atol=1e-7)
    support = next(one for one in jr.linearized(scene).of(jr.Support) if one.kxy is not None)
    assert (support.shaft, support.on) == ("lp", "hp")
    if name == "film":
        damping = slopes(lambda step: own(0.0, place, step, w)[0])
        np.testing.assert_allclose(found.damping[0, 0], damping, rtol=1e-5, atol=1e-7)


# === refusals

hertz = {"balls": 5, "stiffness": 1.0, "gap": 0.1, "inner_radius": 1.0, "outer_radius": 2.0}


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (jr.RollingBearing(**at, **hertz, outer_speed=0.5), "leave `outer_speed"),
        (jr.AnnularStator(**at, gap=0.1, stiffness=1.0, friction=0.1), "give `rim_radius"),
        (jr.Limiter(**at, angle=0.0, gap=0.1, stiffness=1.0, friction=0.1), "AnnularStator"),
        (jr.Seal(**at, clearance=0.1, stiffness=1.0, damping=1.0, swirl=0.5), "Support"),
    ],
)
def test_what_is_refused(part, said):
    with pytest.raises(ValueError, match=said):
        toy(1.3, None, part)
