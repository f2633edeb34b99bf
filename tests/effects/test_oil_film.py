"""Law of a short oil film against quadrature of its pressure, printed numbers, energy and symmetry."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad_vec

import jaxrotor as jr
from jaxrotor.effects.law import Now


UNIT = {"at": 0.5, "viscosity": 1.0, "radius": 1.0, "length": 1.0, "clearance": 1.0}  # k0 = 1
SI = {"at": 0.5, "viscosity": 0.02, "radius": 0.025, "length": 0.02, "clearance": 5e-5}


def bearing(kind=jr.JournalBearing, **values):
    return kind(**(UNIT | values))


@jax.jit
def evaluated(film, z, v, speed):
    one = lambda z, v: (
        film.law()(z, v, Now(speed)),
        film.law().torque(film.law()(z, v, Now(speed)), z, v, Now(speed)),
    )
    return jax.vmap(one)(z, v)


def laws(film, z, v, speed):
    """Forces `x + i y` and torques of many states."""
    parts = [np.stack([np.real(w), np.imag(w)], axis=1) for w in map(np.atleast_1d, (z, v))]
    force, torque = evaluated(film, *parts, speed)
    return np.asarray(force) @ [1, 1j], np.asarray(torque)


def of_pressure(film, z, v, speed, angles=None):
    """`-Int p e^(i theta) R dtheta dZ` with `p = 6 mu (Z^2 - L^2 / 4) (Omega h_theta / 2 + h_t) / h^3`.

    `p` is cut off below zero. By Gauss points over the half circle under pressure, or by SciPy.
    """
    mu, radius, length, c = (float(getattr(film, k)) for k in list(UNIT)[1:])
    squeezed = v / c - 0.5j * speed * z / c
    middle = np.angle(squeezed)[:, None]

    def part(theta):
        turn = np.exp(1j * theta)
        gap = c - (np.conj(z)[:, None] * turn).real
        rate = -(np.conj(v)[:, None] * turn).real  # of the gap
        slope = (np.conj(z)[:, None] * -1j * turn).real
        source = speed / 2 * slope + rate
        pressure = np.where(source < 0, -mu * length**3 * source / gap**3, 0.0)  # over the length
        return -pressure * turn * radius

    if angles is None:
        whole = lambda phi: part(middle + phi)[:, 0]
        return quad_vec(whole, -np.pi / 2, np.pi / 2, epsabs=0, epsrel=1e-13)[0]
    nodes, weights = np.polynomial.legendre.leggauss(angles)
    return part(middle + np.pi / 2 * nodes) @ weights * np.pi / 2


def states(count, seed, largest):
    rng = np.random.default_rng(seed)
    turned = lambda: np.exp(1j * rng.uniform(-np.pi, np.pi, count))
    return largest * np.sqrt(rng.uniform(0, 1, count)) * turned(), rng.uniform(
        0, 9, count
    ) * turned()


@pytest.mark.parametrize("speed", [3.0, -3.0, 0.0])
@pytest.mark.hard("8.4 reversed rotation of an oil film, and a film at rest")
def test_force_is_that_of_the_pressure(speed):
    """Over 400 states up to an eccentricity of 0.95 relative to each force."""
    z, v = states(400, 1, 0.95)
    want = of_pressure(bearing(), z, v, speed, 200)
    found = laws(bearing(), z, v, speed)[0]
    assert np.max(np.abs(found / want - 1)) < 1e-12
    film = bearing(**SI)
    by_scipy = of_pressure(film, 5e-5 * z[:3], 5e-5 * v[:3], 100 * speed)
    np.testing.assert_allclose(
        laws(film, 5e-5 * z[:3], 5e-5 * v[:3], 100 * speed)[0], by_scipy, rtol=1e-12
    )


def test_printed_numbers():
    """Table of the sheet, half film and full film."""
    zeta = np.array([0.3 + 0.2j, 0, 0.6j])
    w = np.array([0.1 - 0.4j, 0.7 + 0.1j, -0.6j])
    half = [
        -0.399559396023 + 0.489084403058j,
        -1.099557428756 - 0.157079632679j,
        0.283717849663j,
    ]
    full = [-0.186896441085 + 1.682067969765j, 2 * half[1], 9.894176081862j]
    moved = w + 0.5j * 0.7 * zeta
    np.testing.assert_allclose(laws(bearing(), zeta, moved, 0.7)[0], half, rtol=2e-12)
    both = laws(bearing(cavitated=False), zeta, moved, 0.7)[0]
    np.testing.assert_allclose(both, full, rtol=2e-12)


@pytest.mark.hard("8.6 a journal that leaves the wall of its bearing")
def test_journal_that_leaves_the_wall():
    """Terms of the size of s^-4 cancel there; the integrand is smooth, so quadrature is exact."""
    zeta = (1 - np.geomspace(1e-6, 0.3, 12)) * np.exp(0.4j)
    w = -np.exp(1j * (0.4 + np.linspace(-1e-3, 1e-3, 12)))
    want = of_pressure(bearing(), zeta, w, 0.0, 60)
    np.testing.assert_allclose(laws(bearing(), zeta, w, 0.0)[0], want, rtol=1e-8)


@pytest.mark.hard("8.5 a film that does not move, in its centre and off it")
def test_centre_rest_and_wall():
    """Half of the full film's derivative where the film does not move, NaN from the wall on."""
    slope = jax.jacfwd(lambda v, z, film: film.law()(z, v, Now(jnp.zeros(()))))
    zero = jnp.zeros(2)
    for e in (0.0, 0.5):
        z, s = jnp.array([e, 0.0]), np.sqrt(1 - e**2)
        want = -np.pi / 2 * np.diag([3 * e**2 / s**5 + 1 / s**3, 1 / s**3])
        np.testing.assert_allclose(slope(zero, z, bearing()), want, rtol=1e-14)
        assert not np.any(bearing().law()(z, zero, Now(jnp.zeros(()))))
    assert np.isnan(laws(bearing(), [1.0, 1.2j], [1j, 1.0], 2.0)[0]).all()
    slopes = jax.grad(lambda film: jnp.sum(film.law()(zero, zero, Now(jnp.ones(())))))(bearing())
    assert all(bool(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(slopes))


@pytest.mark.parametrize("blend", [None, 0.5])
def test_identities(blend):
    """Full film of two halves, power balance, dissipation at any blend, rotation, exact mirror."""
    film, speed, turn = bearing(**SI, blend=blend), 300.0, np.exp(1.1j)
    zeta, w = states(300, 2, 0.9)
    w = 30 * w
    c, z, v = 5e-5, 5e-5 * zeta, 5e-5 * (w + 0.5j * speed * zeta)
    force, torque = laws(film, z, v, speed)
    rates = np.abs(v) / c + speed * np.abs(zeta) / 2  # `w` is a difference of two such
    scale = 1.6 * rates / (1 - np.abs(zeta) ** 2) ** 3.5  # k0 |w| s^-7
    power = (force.conj() * v).real + torque * speed
    shear = 2 * np.pi * 0.02 * 0.025**3 * 0.02 / c * speed**2 / np.sqrt(1 - np.abs(zeta) ** 2)
    lost = c * (force * w.conj()).real
    assert (lost <= 0).all()
    np.testing.assert_allclose(power, lost - shear, rtol=1e-11)
    turned, same = laws(film, turn * z, turn * v, speed)
    assert np.max(np.abs(turned - turn * force) / scale) < 1e-14
    np.testing.assert_allclose(same, torque, rtol=1e-11)
    mirrored, opposite = laws(film, z.conj(), v.conj(), -speed)
    assert (mirrored == force.conj()).all() and (opposite == -torque).all()
    moved = bearing(**SI, blend=blend, offset=2e-5, angle=0.3)
    aside = laws(moved, z + 2e-5 * np.exp(0.3j), v, speed)[0]
    assert np.max(np.abs(aside - force) / scale) < 1e-11
    if blend is None:
        back = laws(film, z, 5e-5 * (-w + 0.5j * speed * zeta), speed)[0]
        full = laws(bearing(**SI, cavitated=False), z, v, speed)[0]
        assert np.max(np.abs(full - force + back) / scale) < 1e-11
    else:
        sharp = laws(bearing(**SI), z, v, speed)[0]
        first = np.abs(w) > 100 * blend
        assert first.sum() > 50
        assert np.max(np.abs(force - sharp)[first] / scale[first]) < 1e-3


def test_squeeze_film_is_a_film_that_does_not_turn():
    """Stiffness and damping (13) of circular orbits, whatever the speed; no torque on the shaft."""
    e, rate = np.array([0.05, 0.4, 0.8]), 3.0
    s = np.sqrt(1 - e**2)
    for cavitated in (True, False):
        film = bearing(jr.SqueezeFilm, cavitated=cavitated)
        force, torque = laws(film, e + 0j, 1j * rate * e, 700.0)
        stiff = 2 * rate * e / s**4 if cavitated else 0 * e
        damped = np.pi / s**3 / (2 if cavitated else 1)
        np.testing.assert_allclose(force, -(stiff + 1j * rate * damped) * e, rtol=1e-13)
        assert not torque.any()


@pytest.mark.hard("8.5 derivatives of a film next to its centre")
def test_derivatives_nearly_in_the_centre():
    """Of a film that moves, at displacements whose squares are no numbers: those of the centre."""
    law, rate = bearing().law(), jnp.array([1e-3, 0.0])
    force = lambda x: law(jnp.array([x, 0.0]), rate, Now(jnp.zeros(())))[0]
    slope = jax.grad(force)
    assert float(slope(-1e-160)) == pytest.approx(float(slope(-1e-12)), rel=1e-6)
