"""Film of finite length against Reynolds' equation in two dimensions and, mode by mode, in one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve

import jaxrotor as jr
from jaxrotor.effects.law import Now


def bearing(slenderness, modes, kind=jr.JournalBearing, **values):
    """Clearance 1, length 1 and `k0 = 1`."""
    radius = 0.5 / slenderness
    return kind(0.5, 1 / radius, radius, 1.0, 1.0, modes=modes, **values)


@jax.jit
def evaluated(film, z, v, speed):
    one = lambda z, v: (
        film.law()(z, v, Now(speed)),
        film.law().torque(film.law()(z, v, Now(speed)), z, v, Now(speed)),
    )
    return jax.vmap(one)(z, v)


def laws(film, z, v, speed=0.0):
    """Forces `x + i y` and torques of many states."""
    parts = [np.stack([np.real(w), np.imag(w)], axis=1) for w in np.broadcast_arrays(z, v)]
    force, torque = evaluated(film, *parts, speed)
    return np.asarray(force) @ [1, 1j], np.asarray(torque)


def plane(zeta, w, slenderness, around, along):
    """Force over `k0` by finite differences of `(H^3 p_t)_t + H^3 p_zz / l^2 = g`, positive part of p."""
    angle, step = 2 * np.pi * np.arange(around) / around, 2 * np.pi / around
    cubed = lambda t: (1 - (np.conj(zeta) * np.exp(1j * t)).real) ** 3
    ahead, behind = cubed(angle + step / 2), cubed(angle - step / 2)
    round_ = sparse.diags([ahead[:-1], -(ahead + behind), behind[1:]], [1, 0, -1]).tolil()
    round_[0, -1], round_[-1, 0] = behind[0], ahead[-1]
    length = sparse.diags([1.0, -2.0, 1.0], [1, 0, -1], shape=(along, along)).tolil()
    length[0, 1] = 2.0  # symmetric about the middle, no pressure at the end
    middle = sparse.kron(sparse.diags(cubed(angle)), length) * (along / slenderness) ** 2
    matrix = sparse.kron(round_ / step**2, sparse.eye(along)) + middle
    g = -(np.conj(w) * np.exp(1j * angle)).real
    p = np.maximum(spsolve(matrix.tocsc(), np.repeat(g, along)), 0).reshape(around, along)
    mean = (p.sum(1) - p[:, 0] / 2) / along
    return -3 / slenderness**2 * np.sum(mean * np.exp(1j * angle)) * step


def one_by_one(zeta, w, slenderness, modes, n=161, whole=False):
    """Force over `k0` of some modes, each by collocation of `(H^3 P')' - k H^3 P = 6 k g / b^4`."""
    angle, orders = 2 * np.pi * np.arange(n) / n, np.fft.fftfreq(n, 1 / n)
    wave = np.exp(1j * np.outer(angle, orders))
    first = (wave @ np.diag(1j * orders) @ wave.conj().T / n).real
    gap = lambda t: 1 - (np.conj(zeta) * np.exp(1j * t)).real
    g = lambda t: -(np.conj(w) * np.exp(1j * t)).real
    cubed = np.diag(gap(angle) ** 3)
    p, rest = 0, 1.0
    for j in range(modes):
        b = (j + 0.5) * np.pi
        k = (b / slenderness) ** 2
        p = p + np.linalg.solve(first @ cubed @ first - k * cubed, 6 * k / b**4 * g(angle))
        rest -= 6 / b**4
    series = wave.conj().T @ p / n

    def mean(t):
        t = np.asarray(t)
        return (np.exp(1j * t[..., None] * orders) @ series).real - rest * g(t) / gap(t) ** 3

    def load(begin, end):
        nodes, weights = np.polynomial.legendre.leggauss(120)
        t = (begin + end) / 2 + (end - begin) / 2 * nodes
        return -((end - begin) / 2 * weights) @ (mean(t) * np.exp(1j * t))

    grid = np.angle(w) + np.linspace(0, 2 * np.pi, 200) + 1e-3
    up = next(i for i in range(199) if mean(grid[i]) < 0 <= mean(grid[i + 1]))
    down = next(i for i in range(199) if mean(grid[i]) >= 0 > mean(grid[i + 1]))
    begin, end = (brentq(mean, grid[i], grid[i + 1], xtol=1e-14) for i in (up, down))
    end = end + 2 * np.pi * (end < begin)
    return load(begin, end) + (load(end, begin + 2 * np.pi) if whole else 0)


def states(count, largest, seed=1):
    rng = np.random.default_rng(seed)
    turned = lambda: np.exp(1j * rng.uniform(-np.pi, np.pi, count))
    return largest * np.sqrt(rng.uniform(0, 1, count)) * turned(), rng.uniform(
        1, 9, count
    ) * turned()


@pytest.mark.slow
def test_load_is_that_in_two_dimensions():
    """Static load at four eccentricities: error by the number of modes, as the documentation has it."""
    cases = {  # length over diameter, eccentricity: Sommerfeld number of the sheet; errors
        (1.0, 0.6): (0.1381, 5e-3, 3e-4),
        (1.0, 0.9): (0.02275, 5e-2, 4e-3),
        (0.5, 0.2): (2.0718, 5e-4, 5e-5),
        (0.5, 0.6): (0.3434, 1e-3, 1e-4),
    }
    for (slenderness, e), (number, *errors) in cases.items():
        fine, coarse = (plane(e, -0.5j * e, slenderness, n, n // 12) for n in (480, 240))
        exact = fine + (fine - coarse) / 3
        assert 1 / (4 * np.pi * slenderness**2 * abs(exact)) == pytest.approx(number, rel=2e-3)
        for modes, error in zip((1, 2), errors, strict=True):
            found = laws(bearing(slenderness, modes), np.array([e]), np.array([0.0]), 1.0)[0][0]
            assert abs(found / exact - 1) < 2 * error
            assert abs(abs(found) / abs(exact) - 1) < error


@pytest.mark.slow
def test_force_is_that_of_its_modes():
    """Random states up to 0.8 at three lengths; nearer to the wall less exactly."""
    for slenderness in (0.3, 1.0, 2.0):
        z, v = states(12, 0.8)
        want = [one_by_one(*state, slenderness, 2) for state in zip(z, v, strict=True)]
        whole = [one_by_one(*state, slenderness, 2, whole=True) for state in zip(z, v, strict=True)]
        assert np.max(np.abs(laws(bearing(slenderness, 2), z, v)[0] / want - 1)) < 1e-7
        found = laws(bearing(slenderness, 2, cavitated=False), z, v)[0]
        assert np.max(np.abs(found - whole) / np.abs(want)) < 1e-7
    z, v = 0.95 * np.exp(1j * np.arange(4.0)), np.exp(2j * np.arange(4.0) ** 2)
    want = [one_by_one(*state, 1.0, 2, 401) for state in zip(z, v, strict=True)]
    assert np.max(np.abs(laws(bearing(1.0, 2), z, v)[0] / want - 1)) < 2e-5


@pytest.mark.slow
def test_short_and_centred_films():
    """Much shorter than its diameter: the short film; in the centre `3 (1 - tanh(l) / l) / l^2` of it."""
    z, v = states(50, 0.8)
    short = laws(bearing(1e-3, 0), z, v, 2.0)[0]
    assert np.max(np.abs(laws(bearing(1e-3, 1), z, v, 2.0)[0] / short - 1)) < 1e-4
    l = 1.0
    want = -np.pi / 2 * v * 3 * (1 - np.tanh(l) / l) / l**2
    found = laws(bearing(l, 1), 0 * z, v)[0]
    assert np.max(np.abs(found / want - 1)) < 1e-3  # higher modes have no flow round the journal
    assert float(bearing(l, 1).law().hardness().damping) == pytest.approx(abs(want[0] / v[0]))


@pytest.mark.slow
@pytest.mark.parametrize("blend", [None, 0.5])
def test_identities(blend):
    """Energy, rotation, mirror, whole film of two halves; the sharp film at a small blend."""
    film, speed, turn = bearing(0.7, 2, blend=blend), 3.0, np.exp(1.1j)
    zeta, w = states(100, 0.85)
    v = w + 0.5j * speed * zeta
    force, torque = laws(film, zeta, v, speed)
    lost = (force * w.conj()).real
    assert (lost < 0).all()
    s, radius = np.sqrt(1 - np.abs(zeta) ** 2), 0.5 / 0.7
    shear = 2 * np.pi * radius**2 * speed**2 / s
    power = (force.conj() * v).real + torque * speed
    np.testing.assert_allclose(power, lost - shear, rtol=1e-11)
    turned = laws(film, turn * zeta, turn * v, speed)[0]
    assert np.max(np.abs(turned / force / turn - 1)) < 2e-6  # the nodes do not turn
    mirrored = laws(film, zeta.conj(), v.conj(), -speed)[0]
    assert np.max(np.abs(mirrored / force.conj() - 1)) < 1e-11
    if blend is None:
        back = laws(film, zeta, -w + 0.5j * speed * zeta, speed)[0]
        whole = laws(bearing(0.7, 2, cavitated=False), zeta, v, speed)[0]
        assert np.max(np.abs(whole - force + back) / np.abs(force)) < 1e-10
    else:
        sharp, half = (
            laws(bearing(0.7, 2, blend=blend), zeta, v, speed)[0] for blend in (1e-6, 0.25)
        )
        first = np.abs(w) > 4
        ratio = np.linalg.norm((force - sharp)[first]) / np.linalg.norm((half - sharp)[first])
        assert ratio == pytest.approx(4, rel=0.05)


@pytest.mark.slow
def test_derivatives_at_rest():
    """In the centre as in any direction; half of the whole film where it does not move."""
    slope = jax.jit(jax.jacfwd(lambda v, z, film: film.law()(z, v, Now(jnp.zeros(())))))
    film, zero = bearing(1.0, 1), jnp.zeros(2)
    rate = laws(film, np.array([0.0]), np.array([1.0]))[0][0].real
    np.testing.assert_allclose(slope(zero, zero, film), rate * np.eye(2), atol=1e-13)
    aside = jnp.array([0.3, 0.4])
    half = np.asarray(slope(zero, aside, bearing(1.0, 1, cavitated=False))) / 2
    np.testing.assert_allclose(slope(zero, aside, film), half, rtol=1e-12)


@pytest.mark.slow
def test_load_of_its_first_mode_and_the_wall():
    """Static load at L/D = 1 by one mode as the collocation has it; NaN from the wall on."""
    film, places = bearing(1.0, 1), np.array([0.6, 1.0, 1.2j])
    force, torque = laws(film, places, np.array([0.0, 1j, 1.0]), 1.0)
    assert abs(force[0] / one_by_one(0.6, -0.3j, 1.0, 1) - 1) < 1e-11
    assert np.isnan(force[1:]).all() and np.isnan(torque[1:]).all()


@pytest.mark.parametrize("kind", [jr.JournalBearing, jr.SqueezeFilm])
def test_modes_are_counted(kind):
    with pytest.raises(ValueError, match="`modes` must be a whole number of at least 0, but is -1"):
        bearing(1.0, -1, kind)


@pytest.mark.slow
def test_static_position_and_coefficients():
    """The position that bears a load, its Jacobian by differences, the threshold of a rigid rotor (10).

    By the sheet `p_cr^2` is 6.912 in two dimensions, where a short film has 7.295.
    """
    e, slenderness = 0.6, 0.5
    force = lambda z, v: one_by_one(z, v - 0.5j * z, slenderness, 2)
    load = -force(e, 0)
    weight, turned = abs(load), -1j * abs(load) / load  # so that the load is along -y
    support = jr.film_support(bearing(slenderness, 2), -1j * weight, 1.0)
    step, rows = 1e-4, []
    place = e * turned
    for along in (1.0, 1j):
        ahead = lambda h, along=along: np.array(
            [force(place + h * along, 0), force(place, h * along)]
        )
        rows.append(
            -(8 * (ahead(step) - ahead(-step)) - ahead(2 * step) + ahead(-2 * step)) / 12 / step
        )
    (kx, cx), (ky, cy) = rows
    want = [kx.real, ky.real, kx.imag, ky.imag, cx.real, cy.real, cx.imag, cy.imag]
    found = [float(getattr(support, a + b)) for a in "kc" for b in ("xx", "xy", "yx", "yy")]
    assert np.max(np.abs(np.array(found) - want)) < 1e-6 * np.max(np.abs(want))
    kxx, kxy, kyx, kyy = (value / weight for value in found[:4])
    cxx, cxy, cyx, cyy = (value / weight for value in found[4:])
    stiff = (cxx * kyy + cyy * kxx - cxy * kyx - cyx * kxy) / (cxx + cyy)
    rate = ((stiff - kxx) * (stiff - kyy) - kxy * kyx) / (cxx * cyy - cxy * cyx)
    assert stiff / rate == pytest.approx(6.912, rel=1e-3)


@pytest.mark.slow
def test_derivatives_are_those_of_differences():
    """First and second ones, also by the radius: coefficients about a position and their slopes."""

    @jax.jit
    def slopes(x, along):
        def force(x):
            film = jr.JournalBearing(0.5, 1.0, x[4], 1.0, 1.0, modes=1)
            return film.law()(x[:2], x[2:4], Now(jnp.ones(())))

        first = lambda x: jax.jvp(force, (x,), (along,))
        (value, slope), (_, second) = jax.jvp(first, (x,), (along,))
        return jnp.stack([value, slope, second])

    x = np.array([0.3, 0.4, 0.2, -0.7, 0.6])
    for along in np.eye(5)[[0, 3, 4]]:
        _, slope, second = slopes(x, along)
        ahead, behind = (slopes(x + h * along, along) for h in (1e-5, -1e-5))
        np.testing.assert_allclose((ahead[0] - behind[0]) / 2e-5, slope, rtol=1e-7)
        np.testing.assert_allclose((ahead[1] - behind[1]) / 2e-5, second, rtol=1e-6)


@pytest.mark.slow
def test_motion_is_that_of_scipy():
    """A mass under weight and unbalance in a film of finite length, over half a revolution."""
    speed, unbalance = 2.0, 0.1
    shaft, disc = jr.MasslessShaft(1.0, 0.5, 1e-9), jr.Disc(0.5, 1.0)
    parts = jr.Gravity(1.0), jr.Unbalance(0.5, 1.0, unbalance), jr.Support(0.5, 0.3)
    film = bearing(1.0, 1)
    scene = jr.Scene(shaft, disc, *parts, film, spin=jr.ConstantSpeed(speed))

    def rates(t, y):
        z, v = y[0] + 1j * y[1], y[2] + 1j * y[3]
        force = one_by_one(z, v - 0.5j * speed * z, 1.0, 1, 61)
        a = force - 0.3 * z - 1j + unbalance * speed**2 * np.exp(1j * speed * t)
        return [v.real, v.imag, a.real, a.imag]

    start = jr.Continued(jnp.array([0.2 + 0.1j]), jnp.array([0.1 - 0.2j]))
    run = jr.run_up(scene, np.linspace(0, np.pi / speed, 5), start=start)
    end = (0, np.pi / speed)
    known = solve_ivp(rates, end, [0.2, 0.1, 0.1, -0.2], "DOP853", rtol=1e-9, atol=1e-11).y[:2, -1]
    assert abs(complex(np.asarray(run.displacement)[-1, 0]) - complex(*known)) < 1e-7
