"""Static positions in rolling bearings, and stiffness there: frozen, and means over a pass of the cage."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from ball_bearing import BALLS, MASS, WEIGHT, bearing, machine
from differences import central
from scipy.optimize import brentq

import jaxrotor as jr
from jaxrotor.analysis import rolling
from jaxrotor.effects.law import Now


TIGHT = {"gap": 5e-6, "weight": 2000.0}
PASS = 2 * np.pi / BALLS


def at(degrees, linear="frozen", **values):
    """The mass, with a ball so many degrees past the bottom."""
    return machine(300.0, angle=-np.pi / 2 + np.radians(degrees), linear=linear, **values)


@pytest.mark.parametrize(
    ("degrees", "values", "place", "stiffness"),
    [
        (1, {}, (-2.6222378964, -25.9779413329), (6.9005140039, 6.2801690420, 56.0890499242)),
        (10, {}, (-1.9174365077, -25.9447209171), ()),
        (22.5, {}, (0.0, -25.9599350405), (11.6979036203, 0.0, 68.1803787630)),
        (0, TIGHT, (0.0, -24.7205323372), ()),
        (10, TIGHT, (-0.6723821897, -24.8649268107), ()),
        (22.5, TIGHT, (0.0, -25.0172436754), (97.9965879141, 0.0, 157.913104119)),
    ],
)
def test_rest_at_an_angle_of_the_cage(degrees, values, place, stiffness):
    """In um, and in N/um along x, across and along y."""
    found = jr.static_positions(at(degrees, **values))
    assert found.linear == "frozen" and found.bearings == ("rolling_bearing",)
    z = 1e6 * complex(found.position[0, 0])
    np.testing.assert_allclose([z.real, z.imag], place, rtol=0, atol=1.01e-10)
    weight = values.get("weight", WEIGHT)
    assert complex(found.load[0, 0]) == pytest.approx(-1j * weight, abs=1e-9 * weight)
    (xx, xy), (yx, yy) = 1e-6 * np.asarray(found.stiffness[0, 0])
    assert xy == pytest.approx(yx, abs=1e-9)
    if stiffness:
        np.testing.assert_allclose((xx, xy, yy), stiffness, rtol=0, atol=1e-9)


def closed_form(degrees):
    """Rest on two balls: two loads, then the place by two lines."""
    a, b = np.radians(degrees), PASS - np.radians(degrees)
    loads = WEIGHT * np.array([np.sin(b), np.sin(a)]) / np.sin(PASS)
    reach = 20e-6 + (loads / 13.34e9) ** (2 / 3)
    # Ball 0 is `a` past the bottom forward, and its neighbour as far before it as is left of the pass.
    angles = -np.pi / 2 + np.array([a, -b])
    return np.linalg.solve(np.array([np.cos(angles), np.sin(angles)]).T, reach)


@pytest.mark.parametrize("degrees", [1e-4, 0.1, 3.0, 44.9])
def test_rest_on_two_balls(degrees):
    """Under a light load; close to the bottom it is one neighbour or the other that bears the rest."""
    found = complex(jr.static_positions(at(degrees)).position[0, 0])
    np.testing.assert_allclose([found.real, found.imag], closed_form(degrees), rtol=1e-10)


def test_mean_over_a_pass():
    """Between angles at which a ball begins or ceases to bear, by Gauss; the library has 256 angles."""
    scene = at(0, **TIGHT)
    (bearing,) = scene.of(jr.RollingBearing)
    rest = rolling._Rest.of(jr.assemble(scene), {0: bearing}, jnp.ones(()))

    @jax.jit
    def positions(shares):
        (position, _, stiffness), *_ = jax.vmap(lambda u: rolling._positions(rest.turned(u)))(
            shares
        )
        z = position[:, 0, None] * jnp.exp(
            -1j * (-np.pi / 2 + PASS * (shares[:, None] + np.arange(BALLS)))
        )
        return position[:, 0].imag * 1e6, stiffness[:, 0] / 1e6, z.real - TIGHT["gap"]

    one = lambda share, ball: float(positions(jnp.full(40, share))[2][0, ball])
    coarse = np.linspace(0, 1, 40)
    depths = np.asarray(positions(jnp.asarray(coarse))[2])
    turns = np.argwhere(depths[1:] * depths[:-1] < 0)
    touches = sorted(brentq(one, coarse[i], coarse[i + 1], (j,), xtol=1e-15) for i, j in turns)
    assert len(touches) == 2
    nodes, weights = np.polynomial.legendre.leggauss(40)
    t = (nodes + 1) / 2
    y, stiffness = 0.0, np.zeros((2, 2))
    for a, b in zip([0, *touches], [*touches, 1], strict=True):
        # Square roots of the distance to a touch are smooth in t.
        there, each, _ = positions(jnp.asarray(a + (b - a) * t**2 * (3 - 2 * t)))
        share = (b - a) * 6 * t * (1 - t) * weights / 2
        y, stiffness = (
            y + share @ np.asarray(there),
            stiffness + np.einsum("n,nab->ab", share, each),
        )
    wanted = np.diag([82.1618208971, 158.527405190])
    np.testing.assert_allclose(stiffness, wanted, rtol=0, atol=2e-9)
    assert y == pytest.approx(-24.8783106261, abs=1e-10)
    found = jr.static_positions(at(0, "mean", **TIGHT))
    assert found.linear == "mean"
    np.testing.assert_allclose(found.stiffness[0, 0] / 1e6, wanted, rtol=0, atol=1e-4 * 82)
    assert 1e6 * found.position[0, 0].imag == pytest.approx(y, abs=1e-7)
    aside = jr.static_positions(at(7.0, "mean", **TIGHT))  # a mean does not depend on the angle
    np.testing.assert_allclose(aside.stiffness[0, 0] / 1e6, wanted, rtol=0, atol=2e-4 * 82)


@pytest.mark.slow
@pytest.mark.parametrize("linear", ["frozen", "mean"])
def test_derivatives_of_rest_and_stiffness(linear):
    scene = at(5.0, linear, exponent=1.5, **TIGHT)
    names = ["stiffness", "exponent", "gap", "angle"]
    values = jnp.array([float(scene.get(f"rolling_bearing.{name}")) for name in names])

    def found(values):
        there = {f"rolling_bearing.{n}": v for n, v in zip(names, values, strict=True)}
        rest = jr.static_positions(scene.replace(there))
        z = 1e6 * rest.position[0, 0]
        return jnp.concatenate([jnp.stack([z.real, z.imag]), rest.stiffness.ravel() / 1e6])

    step = 1e-4 if linear == "frozen" else 1e-6  # less than from one touch to the next angle
    for name, along in zip(names, jnp.diag(values), strict=True):
        slopes = jax.jvp(found, (values,), (along,))[1]
        differences = central(lambda k, along=along: found(values + k * step * along), step)
        size = float(jnp.abs(slopes).max())
        np.testing.assert_allclose(differences, slopes, rtol=0, atol=1e-6 * size, err_msg=name)


def test_roots_of_the_linearized_scene():
    """Those of a mass on the stiffness; every result says what is assumed of the cage."""
    scene = at(22.5)
    linear = jr.linearized(scene)
    assert linear.assumption == "cages of rolling bearings stand at their angle"
    assert not linear.of(jr.RollingBearing) and linear.of(jr.Support)[0].cxx is None
    roots = np.asarray(jr.roots(linear))
    stiffness = np.array([11.6979036203, 68.1803787630]) * 1e6
    wanted = np.sqrt(stiffness / MASS - 25.0)  # damping 200 N s/m: 5 1/s
    np.testing.assert_allclose(np.sort(roots.imag)[2:], wanted, rtol=1e-9)
    np.testing.assert_allclose(roots.real, -5.0, rtol=1e-6)
    mean = jr.linearized(at(0, "mean"), [100.0, 200.0])
    assert mean.assumption == "rolling bearings have their mean stiffness over a pass of the cage"
    np.testing.assert_allclose(*mean.of(jr.Support)[0].kyy, rtol=1e-12)


@pytest.mark.slow
def test_bearings_of_a_flexible_rotor():
    """They share its weight by the lever; one of them stands on a casing."""
    places = {"at": 0.0}, {"at": 0.9, "on": "pedestal"}
    bearings = [bearing(gap=5e-6, angle=-1.3, linear="frozen", **place) for place in places]
    held = jr.Casing("pedestal", 30.0), jr.Support(of="pedestal", kxx=2e8, cxx=0.0)
    parts = jr.Disc(0.4, 40.0, 0.8, 1.2), jr.Gravity(10.0), *bearings, *held
    material = jr.Material(2e11, 7800.0)
    shaft = jr.FlexibleShaft(1.0, 0.04, material, nodes=4)
    scene = jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(300.0))
    found = jr.static_positions(scene)
    mass = 7800.0 * np.pi * 0.04**2 / 4
    second = 10.0 * (40.0 * 0.4 + mass * 0.5) / 0.9
    first = 10.0 * (40.0 + mass) - second
    np.testing.assert_allclose(found.load[0], [-1j * first, -1j * second], rtol=0, atol=1e-6)
    for one, z, load in zip(bearings, found.position[0], found.load[0], strict=True):
        force = one.law()(
            jnp.stack([z.real, z.imag]), jnp.zeros(2), Now(jnp.ones(()), jnp.zeros(()))
        )
        np.testing.assert_allclose(-force[0] - 1j * force[1], load, rtol=1e-9)
    assert jr.linearized(scene).of(jr.Support)[1].on == "pedestal"


@pytest.mark.parametrize("gap", [0.0, 2e-5])
def test_a_bearing_without_a_load_has_no_stiffness(gap):
    """Where another one holds the shaft."""
    scene = at(3, weight=0.0, gap=gap)
    held = scene.of_parts(*scene.effects, jr.Support(0.5, kxx=1e6, cxx=0.0))
    found = jr.static_positions(held)
    assert np.abs(found.position).max() < 1e-20 and np.abs(found.stiffness).max() < 1e-9
    roots = np.asarray(jr.roots(jr.linearized(held)))
    np.testing.assert_allclose(np.abs(roots.imag), np.sqrt(1e6 / MASS - 25.0), rtol=1e-9)


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (at(0), "singular: a single ball of rolling_bearing bears the load"),
        (at(0, weight=0.0), "singular: no ball of rolling_bearing bears a load"),
        (at(0, "mean", weight=0.0), "singular: no ball of rolling_bearing bears a load"),
        (at(3, None), "unless `linear` of each names one: the cage at its `angle`"),
    ],
    ids=["one ball", "no load", "no load in the mean", "not named"],
)
def test_rest_that_is_not_determined(scene, message):
    for call in (jr.static_positions, jr.linearized):
        with pytest.raises(ValueError, match=message):
            call(scene)


FILM = jr.JournalBearing(0.5, 1e-4, 0.05, 0.02, 0.01)


@pytest.mark.parametrize(
    ("more", "linear", "call", "message"),
    [
        (bearing(linear="mean"), "frozen", jr.linearized, "must all have the same `linear`"),
        (
            FILM,
            "frozen",
            jr.static_positions,
            "of films and seals, of rolling bearings or of magnetic ones, but",
        ),
        (None, "mean", jr.roots, "give this analysis `jaxrotor.linearized.scene.`"),
        (None, None, jr.roots, "unless `linear` of each names one"),
        (None, None, lambda s: jr.campbell(s, [0.0, 9.0]), "unless `linear` of each names one"),
        (None, None, lambda s: jr.unbalance_response(s, [9.0]), "unless `linear` of each names"),
    ],
)
def test_what_is_not_linear_is_refused(more, linear, call, message):
    scene = at(3, linear)
    if more is not None:
        scene = scene.of_parts(*scene.effects, more)
    with pytest.raises(ValueError, match=message):
        call(scene)
