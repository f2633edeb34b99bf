"""Coefficients over the frequency of whirl: closed forms, a dense scan, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import jaxrotor as jr


MASS, STILL, RISE, LOSS = 2.0, 8e5, 0.3, 1500.0  # k = STILL + RISE w^2
WHIRL = np.sqrt((STILL - LOSS**2 / 4 / MASS) / (MASS - RISE))  # of the damped mass
CRITICAL = np.sqrt(STILL / (MASS - RISE))
NODES = np.union1d(np.linspace(0.0, 2000.0, 21), [WHIRL, CRITICAL])
KXX = STILL + RISE * NODES**2
PATHS = ("supports.0.kxx", "supports.0.kyy")


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

    def eigenvalues(w):
        at = {name: float(table(w)) for name, table in tables.items()}
        stiff = np.array([[at["kxx"], at["kxy"]], [at["kyx"], at["kyy"]]])
        damp = np.diag([at["cxx"], at["cyy"]])
        lower = np.concatenate([-stiff, -damp], axis=1) / MASS
        values = np.linalg.eigvals(np.concatenate([np.eye(4)[2:], lower]))
        return values[np.argsort(values.imag)]

    grid = np.linspace(0.0, 1500.0, 30_001)
    every = np.stack([eigenvalues(w) for w in grid])
    apart = every.imag - grid[:, None]
    known = []
    for k, j in np.argwhere(
        (apart[:-1] > 0) & (apart[1:] <= 0) | (apart[:-1] < 0) & (apart[1:] > 0)
    ):
        share = apart[k, j] / (apart[k, j] - apart[k + 1, j])
        known.append(every[k, j] + share * (every[k + 1, j] - every[k, j]))
    known = np.array([root for root in known if root.imag > 1e-3])
    assert known.size == 4  # of constant coefficients there are two
    known = sorted_roots(np.concatenate([known, known.conj()]))
    scene = rotor(jr.Support(0.5, frequencies=nodes, hold=True, **own))
    found = sorted_roots(jr.roots(scene))
    np.testing.assert_allclose(found, known, rtol=1e-7)
    speeds = [500.0, 1000.0]
    followed = jr.campbell(scene, speeds, count=4)
    for row in np.asarray(followed.values):
        np.testing.assert_allclose(sorted_roots(row), found[4:], rtol=1e-9)


@pytest.mark.slow
def test_onset_of_a_pad():
    """Sheet 8, (16): the onset of a pad with inertia by its dynamic stiffness over whirl is exact."""
    onset, c, k, k1, d1, inertia = 3018.46148, 200.0, 8e5, 3e6, 2500.0, 0.4
    q = 2500.0 * onset
    exact = np.roots(  # of (m l^2 + c l + k)(J l^2 + H) + H J l^2, H = k1 - i q + d1 l
        np.polyadd(
            np.polymul([MASS, c, k], [inertia, d1, k1 - 1j * q]),
            np.polymul([inertia, 0, 0], [d1, k1 - 1j * q]),
        )
    )
    growing = exact[np.argmax(exact.real)]
    assert abs(growing.real) < 1e-4
    nodes = np.union1d(np.linspace(0.0, 4000.0, 401), [growing.imag])

    def dynamic(q):
        h = k1 - 1j * q + d1 * 1j * nodes
        return k + 1j * c * nodes - h * inertia * nodes**2 / (h - inertia * nodes**2)

    along, across = (dynamic(q) + dynamic(-q)) / 2, 1j * (dynamic(q) - dynamic(-q)) / 2
    rate = np.where(nodes > 0, nodes, 1.0)
    numbers = {"kxx": along.real, "kyy": along.real, "kxy": across.real, "kyx": -across.real}
    losses = {"cxx": along.imag, "cyy": along.imag, "cxy": across.imag, "cyx": -across.imag}
    numbers |= {
        name: np.append(loss[1], loss[1:]) / np.append(rate[1], rate[1:])
        for name, loss in losses.items()
    }
    roots = np.asarray(jr.roots(rotor(jr.Support(0.5, frequencies=nodes, **numbers), speed=onset)))
    assert np.min(np.abs(roots - growing)) < 1e-3


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
    with pytest.raises(ValueError, match="beyond the tables .* from 50 to 500 rad/s; search other"):
        jr.onset_speed(scene([300.0, 600.0]), (50.0, 500.0), 8)


@pytest.mark.slow
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
    with pytest.raises(ValueError, match="a table is over one of the two; leave out the other"):
        seal(speeds=NODES)
    with pytest.raises(ValueError, match="at each of the 2 `frequencies"):
        seal(frequencies=[0.0, 1.0])
