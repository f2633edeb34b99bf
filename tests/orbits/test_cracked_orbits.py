"""Orbits of a mass on a cracked shaft, by shooting and by harmonic balance, and their instability.

Numbers are those of DOP853, of collocation of order 12 and of matrix exponentials, to 1e-9.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cracked_rotor import ACROSS, LOSS, RATIO, machine, rest
from differences import check_by_each
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import jaxrotor as jr


PLAIN, LOCATED = jr.Exponential(4), jr.Exponential(4, located=True)
MAYES = {  # speed: z and z. at theta = 0, abs of z_1, z_2, z_3
    0.32: (
        (1.5107478267 - 0.1035243459j, -1.2057080047 + 1.4028959943j),
        (0.1109658205, 0.1264770478, 1.6975156352),
    ),
    0.4825: (
        (1.3677545386 - 2.7784076713j, 1.5784943562 + 1.2131782159j),
        (0.0800686681, 2.1131413114, 0.0663779678),
    ),
    1.4: (
        (-0.0258462977 - 1.0989075356j, 0.0269376847 - 0.1570594730j),
        (0.0728338255, 0.0088045048, 0.0018403118),
    ),
}
OTHERS = {  # breathing, speed, eccentricity, phase: z and z.
    ("switch", 0.32, 0.0, 0.0): (2.4405485977 - 1.2531354747j, -1.0848582856 + 0.7906610704j),
    ("switch", 1.4, 0.0, 0.0): (-0.0465872306 - 1.0957430661j, 0.0245381588 - 0.1906795866j),
    ("response", 0.32, 0.0, 0.0): (1.2832723115 - 0.0758697093j, -0.5136237817 + 0.2861476293j),
    ("response", 1.4, 0.2, 0.7): (-0.3282686097 - 1.3248315878j, 0.3933664514 - 0.5310519622j),
}
PEAKS = {3: (0.3167002905, 2.3865942022), 2: (0.4742909779, 4.7692484357)}
EDGES = {
    "mayes": (0.6224429341, 0.6457029392, 0.9214254559, 0.9857948183, 1.8495130957, 1.9712120996),
    "switch": (0.6155621767, 0.6527650500, 0.9203907118, 0.9858026490, 1.8355003494, 1.9847751855),
}
SIGNS = (-1, -1, 1, 1, -1, -1)  # of the multiplier that leaves the circle
SECOND = 1.8854528085, 1.9358453975  # of Mayes, between them a second one is below -1


def start_of(orbit):
    return np.array([complex(orbit.start.q[0]), complex(orbit.start.velocity[0])])


def unloaded(speed, breathing="mayes"):
    """Without weight: the multipliers are the same, and the orbit is rest at every speed."""
    return machine(speed, breathing).replace({"gravity.acceleration": 0.0})


def multipliers(speed, breathing, steps=512):
    solver = PLAIN if breathing == "mayes" else LOCATED
    orbit = jr.periodic(
        unloaded(speed, breathing), rest(), solver=solver, steps_per_revolution=steps
    )
    return np.asarray(orbit.multipliers)


def sizes(scene, harmonics=12):
    """Largest of the forward harmonics 1, 2, 3."""
    found = jr.harmonic_balance(scene, harmonics=harmonics)
    return jnp.abs(found.coefficients[harmonics + 1 : harmonics + 4, 0])


# === orbits


@pytest.mark.slow
@pytest.mark.parametrize("speed", MAYES)
def test_table_of_mayes(speed):
    """By shooting with 1024 steps, whose error is of fourth order, and by twelve harmonics."""
    start, wanted = MAYES[speed]
    orbit = jr.periodic(machine(speed), rest(), solver=PLAIN, steps_per_revolution=1024)
    np.testing.assert_allclose(start_of(orbit), start, rtol=0, atol=2e-9)
    balance = jr.harmonic_balance(machine(speed), harmonics=12)
    np.testing.assert_allclose(start_of(balance), start, rtol=0, atol=1e-10)
    found = np.abs(balance.coefficients[13:16, 0])
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10)
    assert orbit.stable and float(balance.truncation) < 1e-10


@pytest.mark.parametrize("number", PEAKS)
def test_peaks_over_speed(number):
    """Where the derivative by speed vanishes."""
    scene, (speed, size) = machine(1.0), PEAKS[number]
    own = lambda speed: sizes(scene.replace({"spin.speed": speed}))[number - 1]
    slope = lambda speed: float(jax.jvp(own, (speed,), (1.0,))[1])
    found = brentq(slope, speed - 2e-4, speed + 2e-4, xtol=1e-13)
    assert found == pytest.approx(speed, abs=2e-10)
    assert float(own(found)) == pytest.approx(size, abs=2e-10)


@pytest.mark.slow
@pytest.mark.parametrize("case", OTHERS, ids=lambda case: f"{case[0]} {case[1]}")
def test_orbits_through_switches(case):
    """Located steps: by the angle twice a turn, by the response where the side in tension changes."""
    breathing, speed, eccentricity, phase = case
    scene = machine(speed, breathing, eccentricity, phase)
    orbit = jr.periodic(scene, rest(), solver=LOCATED, steps_per_revolution=1024)
    np.testing.assert_allclose(start_of(orbit), OTHERS[case], rtol=0, atol=2e-9)
    if case[:2] == ("response", 0.32):
        z = np.asarray(orbit.displacement[:-1, 0])
        side = np.real(z * np.exp(-2j * np.pi * np.arange(z.size) / z.size)) > 0
        assert np.sum(side != np.roll(side, 1)) == 4
        wanted = np.array([0.78319639 + 0.24866708j, 0.80717419 + 0.15395366j])
        found = np.asarray(orbit.multipliers)
        assert max(np.abs(found - one).min() for one in wanted) < 2e-8


@pytest.mark.slow
def test_orbit_against_scipy():
    """The affine map of a revolution by DOP853: fixed point and multipliers, with another `tension`."""
    speed, angle, tension = 0.55, 0.4, -1.1

    def rates(time, y, weight):
        z, v = y[0] + 1j * y[1], y[2] + 1j * y[3]
        turn = np.exp(1j * (speed * time + angle))
        zeta, f = z / turn, (1 + np.cos(speed * time + angle - tension)) / 2
        force = f * (LOSS * zeta.real + 1j * ACROSS * zeta.imag) * turn
        a = force - z - 2 * RATIO * v - 1j * weight
        return [v.real, v.imag, a.real, a.imag]

    turned = lambda y, weight: solve_ivp(
        rates, (0, 2 * np.pi / speed), y, "DOP853", args=(weight,), rtol=1e-12, atol=1e-14
    ).y[:, -1]
    matrix = np.stack([turned(y, 0.0) for y in np.eye(4)], axis=1)
    x, y, vx, vy = np.linalg.solve(np.eye(4) - matrix, turned(np.zeros(4), 1.0))
    scene = machine(speed, angle=angle, tension=tension)
    orbit = jr.periodic(scene, rest(), solver=PLAIN, steps_per_revolution=1024)
    np.testing.assert_allclose(start_of(orbit), [x + 1j * y, vx + 1j * vy], rtol=0, atol=1e-9)
    balance = jr.harmonic_balance(scene, harmonics=12)
    np.testing.assert_allclose(start_of(balance), [x + 1j * y, vx + 1j * vy], rtol=0, atol=1e-9)
    found, wanted = np.asarray(orbit.multipliers), np.linalg.eigvals(matrix)
    assert np.abs(found[:, None] - wanted).min(axis=0).max() < 1e-8


NUMBERS = {
    "crack.loss": LOSS,
    "crack.loss_across": ACROSS,
    "crack.angle": 0.3,
    "crack.tension": -1.4,
    "disc_damping.translational": 2 * RATIO,
    "shaft.k11": 1.0,
    "spin.speed": 0.55,
}


@pytest.mark.slow
def test_derivatives_of_harmonics_by_all_numbers():
    scene, values = machine(0.55), jnp.array(list(NUMBERS.values()))

    def own(values):
        there = scene.replace(dict(zip(NUMBERS, values, strict=True)))
        found = jr.harmonic_balance(there, harmonics=12)
        z = found.start.q[0]
        return jnp.stack([z.real, z.imag, *jnp.abs(found.coefficients[13:16, 0])])

    check_by_each(own, values, 1e-4, least=1e-3)


# === stability


@pytest.mark.slow
@pytest.mark.parametrize("breathing", EDGES)
def test_edges_of_instability(breathing):
    """Speeds at which a multiplier is +1 or -1."""
    for edge, sign in zip(EDGES[breathing], SIGNS, strict=True):
        outer = lambda speed, sign=sign: np.max(sign * multipliers(speed, breathing).real) - 1
        found = brentq(outer, edge - 3e-4, edge + 3e-4, xtol=1e-13)
        assert found == pytest.approx(edge, abs=2e-10)
    if breathing == "mayes":
        for edge in SECOND:
            inner = lambda speed: np.sort(-multipliers(speed, "mayes").real)[-2] - 1
            found = brentq(inner, edge - 3e-4, edge + 3e-4, xtol=1e-13)
            assert found == pytest.approx(edge, abs=2e-10)


@pytest.mark.slow
def test_branch_passes_the_edges():
    orbit = jr.periodic(unloaded(0.6), rest(), solver=PLAIN, steps_per_revolution=512)
    branch = jr.continue_(orbit, "spin.speed", (0.6, 1.1), solver=PLAIN)
    kinds, values = zip(*[(point.kind, point.value) for point in branch.points], strict=True)
    assert kinds == ("flip", "flip", "branching", "branching")
    np.testing.assert_allclose(values, EDGES["mayes"][:4], rtol=0, atol=2e-9)


@pytest.mark.parametrize(("speed", "wanted"), [(0.95, 0.0235310384), (1.9, 0.0216217364 + 0.95j)])
def test_exponents_where_harmonic_balance_stays_bounded(speed, wanted):
    """An orbit of moderate size that no motion comes to: multipliers alone tell."""
    largest = max(multipliers(speed, "mayes"), key=np.abs)
    found = np.log(complex(largest)) * speed / (2 * np.pi)
    assert found.real == pytest.approx(wanted.real, abs=1e-9)
    assert abs(found.imag) == pytest.approx(wanted.imag, abs=1e-9)
    balance = jr.harmonic_balance(machine(speed), harmonics=12)
    assert balance.converged and np.abs(balance.displacement).max() < 20
    orbit = jr.periodic(machine(speed), balance.start, solver=PLAIN, steps_per_revolution=512)
    np.testing.assert_allclose(start_of(orbit), start_of(balance), rtol=0, atol=1e-6)
    assert not orbit.stable
