"""Coefficients over the frequency of whirl: closed forms, a dense scan, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

import jaxrotor as jr


MASS, STILL, RISE, LOSS = 2.0, 8e5, 0.3, 1500.0  # k = STILL + RISE w^2
WHIRL = np.sqrt((STILL - LOSS**2 / 4 / MASS) / (MASS - RISE))  # of the damped mass
CRITICAL = np.sqrt(STILL / (MASS - RISE))
NODES = np.union1d(np.linspace(0.0, 2000.0, 21), [WHIRL, CRITICAL])
KXX = STILL + RISE * NODES**2
AXES = ("xx", "xy", "yx", "yy")


def rotor(*supports, speed=1000.0, mass=MASS, others=()):
    """A mass at a point, on a shaft without stiffness to speak of."""
    shaft = jr.MasslessShaft(1.0, 0.5, 1e-9)
    parts = jr.Disc(0.5, mass), *supports, *others
    return jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(speed))


def seal(damping=LOSS, **values):
    tables = {"frequencies": NODES, "kxx": KXX, "kyy": KXX, "cxx": damping, "cyy": damping}
    return jr.Support(0.5, **(tables | values))


def sorted_roots(values):
    values = np.asarray(values)
    return values[np.lexsort((values.real.round(6), values.imag.round(6)))]


def scanned(at, top, mass=MASS):
    """Roots with `|Im lambda| = w` above zero, by a dense scan of w, and `at(w)` coefficients by name."""
    grid = np.linspace(0.0, top, 30_001)
    found = at(grid)
    matrices = np.zeros((grid.size, 4, 4))
    matrices[:, :2, 2:] = np.eye(2)
    for j, letter in enumerate("kc"):
        own = np.stack([found.get(letter + axes, 0 * grid) for axes in AXES], axis=-1)
        matrices[:, 2:, 2 * j : 2 * j + 2] = -own.reshape(-1, 2, 2) / mass
    every = np.linalg.eigvals(matrices)
    every = np.take_along_axis(every, np.argsort(every.imag, axis=1), axis=1)
    apart = every.imag - grid[:, None]
    roots = []
    for k, j in np.argwhere((apart[:-1] > 0) != (apart[1:] > 0)):
        share = apart[k, j] / (apart[k, j] - apart[k + 1, j])
        after = every[k + 1, np.argmin(np.abs(every[k + 1] - every[k, j]))]
        roots.append(every[k, j] + share * (after - every[k, j]))
    return np.array([root for root in roots if root.imag > 1e-3])


@pytest.mark.slow
def test_closed_form_and_its_derivative():
    """`lambda = -c / 2m +- i sqrt((a - c^2 / 4m) / (m - b))`, critical at `sqrt(a / (m - b))`."""
    scene = rotor(seal())
    found = sorted_roots(jr.roots(scene))
    want = -LOSS / 2 / MASS + 1j * WHIRL * np.array([-1, 1])
    np.testing.assert_allclose(found, want, rtol=1e-11)
    speeds = jr.critical_speeds(scene)
    np.testing.assert_allclose(speeds.forward, [CRITICAL], rtol=1e-11)
    np.testing.assert_allclose(speeds.backward, [CRITICAL], rtol=1e-11)

    def root(kxx):
        return jr.roots(rotor(seal(kxx=kxx, kyy=kxx)))[0]

    k = int(np.flatnonzero(NODES == WHIRL)[0])
    along = jnp.zeros(NODES.size).at[k].set(1.0)
    _, slope = jax.jvp(root, (jnp.asarray(KXX),), (along,))
    ahead, behind = (root(jnp.asarray(KXX) + h * along) for h in (10.0, -10.0))
    assert abs(complex(slope) / complex((ahead - behind) / 20) - 1) < 1e-6
    speeds = np.array([200.0, CRITICAL, 1500.0])
    loads = rotor(seal(), others=[jr.Unbalance(0.5, MASS, 1e-4)])
    response = np.asarray(jr.unbalance_response(loads, speeds).forward)[:, 0]
    stiff = PchipInterpolator(NODES, KXX)(speeds)
    known = MASS * 1e-4 * speeds**2 / (stiff - MASS * speeds**2 + 1j * LOSS * speeds)
    np.testing.assert_allclose(response, known, rtol=1e-8)


@pytest.mark.slow
def test_roots_are_those_of_a_dense_scan():
    """Unequal, cross-coupled tables that meet `m w^2` three times: every root, and no other."""
    nodes = np.array([0.0, 300.0, 350.0, 450.0, 600.0, 1000.0, 1500.0])
    own = {
        "kxx": [2e5, 2e5, 2.2e5, 4.6e5, 9e5, 1e6, 1.1e6],
        "kyy": [6e5, 6.2e5, 6.3e5, 6.6e5, 7e5, 8e5, 9e5],
        "kxy": [1e4, 3e4, 2e4, 2e4, 3e4, 5e4, 6e4],
        "kyx": [-2e4, -3e4, -3e4, -4e4, -6e4, -8e4, -9e4],
        "cxx": [60.0, 80.0, 100.0, 90.0, 50.0, 40.0, 30.0],
        "cyy": [90.0, 80.0, 60.0, 60.0, 50.0, 40.0, 30.0],
    }
    tables = {name: PchipInterpolator(nodes, values) for name, values in own.items()}
    known = scanned(lambda w: {name: table(w) for name, table in tables.items()}, 1500.0)
    assert known.size == 4  # of constant coefficients there are two
    known = sorted_roots(np.concatenate([known, known.conj()]))
    scene = rotor(jr.Support(0.5, frequencies=nodes, hold=True, **own))
    found = sorted_roots(jr.roots(scene))
    np.testing.assert_allclose(found, known, rtol=1e-7)
    speeds = [500.0, 1000.0]
    followed = jr.campbell(scene, speeds, count=4)
    for row in np.asarray(followed.values):
        np.testing.assert_allclose(sorted_roots(row), found[4:], rtol=1e-9)


SPEEDS = np.array([0.0, 200.0, 500.0, 900.0, 1500.0])
WHIRLS = np.array([0.0, 300.0, 450.0, 600.0, 800.0, 1200.0])


def surfaces():
    """Tables with a row for every speed and a column for every frequency."""
    w, f = SPEEDS[:, None], WHIRLS
    return {
        "kxx": 6e5 + 60.0 * f + 0.05 * f**2 + 40.0 * w,
        "kyy": 7e5 + 0.1 * f**2 - 30.0 * w + 0.01 * w * f,
        "kxy": (100.0 - 0.03 * f) * w,
        "kyx": -(120.0 - 0.02 * f) * w,
        "cxx": 90.0 + 0.02 * f - 0.01 * w,
        "cyy": 80.0 + 0.00002 * w * f,
    }


def at_speed(speed, **changed):
    """Coefficients at a speed as functions of the frequency, by SciPy."""
    own = {
        name: PchipInterpolator(WHIRLS, PchipInterpolator(SPEEDS, table)(speed))
        for name, table in (surfaces() | changed).items()
    }
    return lambda w: {name: table(w) for name, table in own.items()}


def growth(speed, mass=MASS):
    return scanned(at_speed(speed), 1200.0, mass).real.max()


def film(speed=350.0, **changed):
    tables = surfaces() | changed
    return rotor(jr.Support(0.5, speeds=SPEEDS, frequencies=WHIRLS, **tables), speed=speed)


@pytest.mark.long
def test_tables_over_speed_and_whirl_are_those_of_a_dense_scan():
    """Roots, growth and its derivative by one entry, and a Campbell diagram, between the nodes."""
    scene = film()
    known = scanned(at_speed(350.0), 1200.0)
    known = sorted_roots(np.concatenate([known, known.conj()]))
    np.testing.assert_allclose(sorted_roots(jr.roots(scene)), known, rtol=1e-7)
    assert float(jr.growth_rate(scene)) == pytest.approx(known.real.max(), rel=1e-6)

    def rate(entry):
        return jr.growth_rate(film(kyx=jnp.asarray(surfaces()["kyx"]).at[2, 3].add(entry)))

    _, slope = jax.jvp(rate, (jnp.zeros(()),), (jnp.ones(()),))
    assert float(slope) == pytest.approx(float(rate(5.0) - rate(-5.0)) / 10, rel=1e-6)
    assert abs(float(slope)) > 1e-6
    for speed, row in zip(
        (350.0, 700.0), jr.campbell(scene, [350.0, 700.0], 2).values, strict=True
    ):
        own = scanned(at_speed(speed), 1200.0)
        np.testing.assert_allclose(sorted_roots(row), sorted_roots(own), rtol=1e-7)


@pytest.mark.slow
def test_synchronous_whirl_reads_both_tables_at_the_speed():
    """`det( K(Omega, Omega) - Omega^2 M ) = 0`, and the unbalance response."""
    weak = dict.fromkeys(("kxy", "kyx"), 0.1 * surfaces()["kxy"])

    def matrices(speed):
        at = at_speed(speed, **weak)(speed)
        both = [[at.get(a + axes, 0.0) for axes in AXES] for a in "kc"]
        return np.reshape(both, (2, 2, 2))

    def excess(speed):
        return np.linalg.det(matrices(speed)[0] - MASS * speed**2 * np.eye(2))

    grid = np.linspace(50.0, 1150.0, 111)
    signs = np.sign([excess(speed) for speed in grid])
    known = [brentq(excess, *grid[k : k + 2]) for k in np.flatnonzero(np.diff(signs))]
    assert len(known) == 2
    scene = film(**weak)
    np.testing.assert_allclose(jr.critical_speeds(scene).speeds, known, rtol=1e-9)
    loaded = scene.of_parts(*scene.effects, jr.Unbalance(0.5, MASS, 1e-4))
    speeds = np.array([300.0, 800.0])
    response = jr.unbalance_response(loaded, speeds)
    for speed, ahead, behind in zip(speeds, response.forward, response.backward, strict=True):
        stiff, loss = matrices(speed)
        force = MASS * 1e-4 * speed**2 * np.array([1.0, -1j])  # of exp(i Omega t)
        x, y = np.linalg.solve(stiff - MASS * speed**2 * np.eye(2) + 1j * speed * loss, force)
        # z = x + i y, each the real part of its amplitude times exp(i Omega t)
        assert complex(ahead[0]) == pytest.approx((x + 1j * y) / 2, rel=1e-8)
        assert complex(behind[0]) == pytest.approx(np.conj(x - 1j * y) / 2, rel=1e-8)


@pytest.mark.slow
def test_maps_over_tables_of_whirl_are_those_of_a_dense_scan():
    """Growth at every point, and zero along the boundary."""
    over = {"spin.speed": [200.0, 600.0, 1000.0, 1400.0], "disc.mass": [1.8, 2.1, 2.4]}
    found = jr.stability_map(film(), over)
    known = [[growth(speed, mass) for mass in found.y] for speed in found.x]
    np.testing.assert_allclose(found.growth, known, rtol=1e-5, atol=1e-6)
    (curve,) = found.boundaries
    assert len(curve) >= 3
    assert max(abs(growth(speed, mass)) for speed, mass in curve) < 1e-5


class Pad:
    """Sheet 8, (16): a mass on a pad of some inertia, whose motion is left out of the coefficients."""

    def __init__(self, inertia, drive):
        self.inertia, self.drive = inertia, drive
        self.c, self.k, self.k1, self.d1 = 200.0, 8e5, 3e6, 2500.0

    def exact(self):
        """Roots of `(m l^2 + c l + k)(J l^2 + H) + H J l^2`, `H = k1 - i q + d1 l`."""
        h = [self.d1, self.k1 - 1j * self.drive]
        free = np.polymul([MASS, self.c, self.k], [self.inertia, *h])
        return np.roots(np.polyadd(free, np.polymul([self.inertia, 0, 0], h)))

    def coefficients(self, w):
        """Real coefficients of `Z(i w)`, with drives `q` and `-q` of both directions of whirl."""
        q = np.array([[1.0], [-1.0]]) * -1j * self.drive
        h, inertia = q + self.k1 + self.d1 * 1j * w, self.inertia * w**2
        ahead, back = self.k + 1j * self.c * w - h * inertia / (h - inertia)
        along, across = (ahead + back) / 2, 1j * (ahead - back) / 2
        found = {"kxx": along.real, "kyy": along.real, "kxy": across.real, "kyx": -across.real}
        losses = {"cxx": along.imag, "cyy": along.imag, "cxy": across.imag, "cyx": -across.imag}
        return found | {name: loss / w for name, loss in losses.items()}

    def roots(self, nodes, speed):
        tables = jr.Support(0.5, frequencies=nodes, **self.coefficients(nodes))
        return np.asarray(jr.roots(rotor(tables, speed=speed)))


@pytest.mark.slow
def test_onset_of_a_pad():
    """A pad with inertia is exact over whirl at the onset, and wrong if reduced at the speed."""
    onset = 3018.46148
    pad = Pad(0.4, 2500.0 * onset)
    exact = pad.exact()
    growing = exact[np.argmax(exact.real)]
    assert abs(growing.real) < 1e-4
    nodes = np.union1d(np.linspace(10.0, 4000.0, 400), [growing.imag])
    assert np.min(np.abs(pad.roots(nodes, onset) - growing)) < 1e-3
    # Newton's method from the root reduced at the speed goes to the backward one of these two.
    heavy = Pad(1.5, 2500.0 * 1000.0)
    back, ahead = sorted(heavy.exact(), key=lambda root: abs(root.real))[:2][::-1]
    assert (back, ahead) == pytest.approx(
        (-33.30627773 - 471.32033891j, -21.63877074 + 468.50262297j)
    )
    found = heavy.roots(nodes, 1000.0)
    found = found[np.isfinite(found)]
    assert sorted(np.sign(found.imag)) == [-1, 1]
    for root, whirl in zip(sorted(found, key=lambda root: root.imag), (back, ahead), strict=True):
        assert root.imag == pytest.approx(
            whirl.imag, rel=5e-3
        )  # the damping is that of |Im lambda|
    scan = scanned(lambda w: heavy.coefficients(np.maximum(w, 1e-3)), 4000.0)
    np.testing.assert_allclose(np.sort(np.abs(found)), np.sort(np.abs(scan)), rtol=1e-5)
    nodes = np.union1d(np.linspace(500.0, 1300.0, 161), [1279.16685])
    tables = Pad(0.4, 2500.0 * nodes).coefficients(nodes)
    reduced = rotor(jr.Support(0.5, speeds=nodes, **tables))
    assert float(jr.onset_speed(reduced, samples=16).speed) == pytest.approx(1279.16685, rel=1e-7)


@pytest.mark.slow
def test_a_whirl_beyond_the_tables_is_not_called_stable():
    """`m s^2 + c s + k - i k' = 0` is unstable at 707 rad/s, within the first tables, above the others."""
    stiffness, cross = 1e6, 2e5

    def scene(ends):
        table = {
            "kxx": stiffness,
            "kyy": stiffness,
            "kxy": cross,
            "kyx": -cross,
            "cxx": 1.0,
            "cyy": 1.0,
        }
        support = jr.Support(
            0.5, frequencies=ends, **{name: [value] * 2 for name, value in table.items()}
        )
        shaft = jr.MasslessShaft(1.0, 0.5, 1.0)
        return jr.Scene(shaft, jr.Disc(0.5, 2.0), support, spin=jr.ConstantSpeed(300.0))

    expected = np.roots([2.0, 1.0, stiffness + 1.0 - 1j * cross]).real.max()
    assert float(jr.growth_rate(scene([600.0, 900.0]))) == pytest.approx(expected, rel=1e-9)
    with pytest.raises(ValueError, match="beyond the tables over its frequency may be unstable"):
        jr.growth_rate(scene([300.0, 600.0]))
    with pytest.raises(
        ValueError, match="beyond the tables .* from 50 to 500 rad/s .*; search other"
    ):
        jr.onset_speed(scene([300.0, 600.0]), (50.0, 500.0), 8)
    with pytest.raises(ValueError, match="may be unstable, .* at `disc.mass` = 2; leave such"):
        jr.stability_boundary(scene([300.0, 600.0]), "disc.mass", [2.0, 2.1])


@pytest.mark.long
def test_onset_speed():
    """`Omega = w (1 + c / c_i)`, `w` at the coefficients of its own: damping that turns with the shaft."""
    turning = jr.Support(0.5, 0.0, 500.0, rotating=True)
    scene = rotor(seal(1000.0), turning)
    threshold = jr.onset_speed(scene, (1500.0, 2500.0), samples=8)
    assert float(threshold.speed) == pytest.approx(3 * CRITICAL, rel=1e-10)
    assert float(threshold.whirl_frequency) == pytest.approx(CRITICAL, rel=1e-9)


def test_what_is_refused():
    """In time there is no frequency; a table is over speed or over whirl."""
    scene = rotor(seal())
    with pytest.raises(
        ValueError, match="Coefficients of support are tables over the frequency of whirl"
    ):
        jr.simulate(scene, 1)
    turning = jr.Support(0.5, 1e5, anisotropy=0.1, rotating=True)
    with pytest.raises(
        ValueError, match="are for axes that stand still, but unequal axes of support"
    ):
        jr.roots(rotor(seal(), turning))
    with pytest.raises(
        ValueError, match=r"must have 2 rows, .* of 23 values, .* has shape \(23,\)"
    ):
        seal(speeds=[100.0, 200.0])
    with pytest.raises(ValueError, match="at each of the 2 `frequencies"):
        seal(frequencies=[0.0, 1.0])
