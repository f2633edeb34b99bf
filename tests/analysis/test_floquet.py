"""Floquet multipliers against direct integration over one revolution by scipy, written by hand.

The equations are those of the sheet of the dual-stiffness rotor, in the fixed frame, with supports
that are unequal along two axes fixed in space.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import Beam
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq, linear_sum_assignment

import jaxrotor as jr


J = np.array([[0.0, -1.0], [1.0, 0.0]])
BASE = {"mu": 0.2, "kappa": 0.16, "delta": 0.1, "alpha": 1.0, "nu": 0.3, "angle": 0.4}


def rotor(p, *, mu, kappa, delta, alpha, nu, angle, support=0.16, mass=None):
    """Disc of unit mass on a shaft of unit mean stiffness, in two supports of stiffness 1 / alpha each."""
    ends = [] if mass is None else [jr.Disc(0.0, mass)]
    unequal = {} if nu is None else {"anisotropy": nu, "angle": angle}
    supports = [jr.Support(at, 1 / alpha, damping=support, **unequal) for at in (0.0, 1.0)]
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1.0, anisotropy=mu, damping=kappa, ends="elastic"),
        jr.Disc(0.5, 1.0),
        jr.DiscDamping(0.5, delta),
        *ends,
        *supports,
        spin=jr.ConstantSpeed(p),
    )


def along(mean, share, angle):
    """Symmetric matrix of `mean (1 + share)` along `angle` and `mean (1 - share)` across it."""
    c, s = np.cos(2 * angle), np.sin(2 * angle)
    return mean * (np.eye(2) + share * np.array([[c, s], [s, -c]]))


def integrated(p, *, mu, kappa, delta, alpha, nu, angle, support=0.16, mass=None):
    """Multipliers of one revolution by scipy, without those of the massless supports."""
    kappa, support = kappa or 0.0, support or 0.0
    bearing = along(2 / alpha, nu, angle)

    def force(t, q, v, q0, v0):
        """Force of the shaft on the disc."""
        return along(1.0, mu, p * t) @ (q - q0) + kappa * ((v - v0) - p * J @ (q - q0))

    def field(t, y):
        q, v = y[:2], y[2:4]
        if mass is not None:
            q0, v0 = y[4:6], y[6:8]
            f = force(t, q, v, q0, v0)
            return np.concatenate(
                [v, -delta * v - f, v0, (f - bearing @ q0 - 2 * support * v0) / mass]
            )
        if kappa + support > 0:
            q0 = y[4:6]
            v0 = (force(t, q, v, q0, 0) - bearing @ q0) / (kappa + 2 * support)
            return np.concatenate([v, -delta * v - force(t, q, v, q0, v0), v0])
        shaft = along(1.0, mu, p * t)
        q0 = np.linalg.solve(shaft + bearing, shaft @ q)
        return np.concatenate([v, -delta * v - shaft @ (q - q0)])

    size = 8 if mass is not None else 6 if kappa + support > 0 else 4
    return np.linalg.eigvals(monodromy(field, size, 2 * np.pi / p))


def monodromy(field, size, period):
    end = lambda y: solve_ivp(field, (0, period), y, method="DOP853", rtol=1e-11, atol=1e-13).y[
        :, -1
    ]
    return np.stack([end(y) for y in np.eye(size)], axis=1)


def paired(found, expected):
    """The found values that match the expected ones, and the rest."""
    found, expected = np.asarray(found), np.asarray(expected)
    _, columns = linear_sum_assignment(np.abs(expected[:, None] - found[None]))
    return found[columns], np.delete(found, columns)


VARIANTS = {
    "massless": {},
    "massive": {"mass": 0.3},
    "undamped supports": {"support": None},
    "no coordinate of its own": {"support": None, "kappa": None},
    "rigid in one axis almost": {"alpha": 0.2, "nu": 0.9},
}


@pytest.mark.slow
@pytest.mark.parametrize("p", [0.83, 4.0])
@pytest.mark.parametrize("name", VARIANTS)
def test_against_integration(name, p):
    values = BASE | VARIANTS[name]
    expected = integrated(p, **values)
    found = jr.floquet_multipliers(rotor(p, **values))
    assert found.shape == (8,)
    assert np.all(np.diff(np.abs(found)) <= 0)
    found, rest = paired(found, expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    if values.get("mass") is None:
        assert np.all(rest == 0)  # coordinates without mass


@pytest.mark.parametrize("p", [-0.8, 0.8])
def test_sense_of_rotation(p):
    """Reversing the spin mirrors the supports' axis: x, -y obeys the equations of -p."""
    values = BASE | {"angle": np.sign(p) * BASE["angle"]}
    found = jr.floquet_multipliers(rotor(p, **values))
    np.testing.assert_allclose(
        paired(found, integrated(0.8, **BASE))[0], integrated(0.8, **BASE), rtol=0, atol=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("p", [0.5, 2.5])
@pytest.mark.parametrize("equal", ["supports", "shaft", "both"])
def test_constant_coefficients_in_some_frame(equal, p):
    """Zero anisotropy, which is integrated, gives the multipliers of absent anisotropy, by its roots."""
    names = {"supports": ["nu"], "shaft": ["mu"], "both": ["nu", "mu"]}[equal]
    integrated_ = jr.floquet_multipliers(rotor(p, **BASE | dict.fromkeys(names, 0.0)))
    autonomous = rotor(p, **BASE | dict.fromkeys(names))
    expected = np.exp(np.asarray(jr.roots(autonomous)) * 2 * np.pi / p)
    if equal == "both":
        expected = np.concatenate([expected, expected.conj()])
    assert expected.size == 6
    for found in (integrated_, jr.floquet_multipliers(autonomous)):
        found, rest = paired(found, expected)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)
        assert np.all(rest == 0)
    growth = [jr.growth_rate(rotor(p, **BASE | dict.fromkeys(names, x))) for x in (0.0, None)]
    assert float(growth[0]) == pytest.approx(float(growth[1]), abs=1e-10)


# === a flexible shaft in bearings

LENGTH, DIAMETER, YOUNG, DENSITY = 0.7, 0.02, 2.1e11, 7850.0
DISC = (0.35, 2.0, 0.004, 0.007)
BEARING, DAMPING, SHAFT, FIXED, VOIGT = 4e5, 60.0, 0.2, 0.35, 2e-5


def flexible(speed, nodes=8):
    return jr.Scene(
        jr.FlexibleShaft(
            LENGTH,
            DIAMETER,
            jr.Material(YOUNG, DENSITY),
            nodes=nodes,
            constraints=(),
            anisotropy=SHAFT,
        ),
        jr.Disc(*DISC),
        jr.DiscDamping(0.35, 4.0, 0.01),
        jr.InternalDamping(VOIGT),
        jr.Support(0.0, BEARING, DAMPING, FIXED, angle=0.2),
        jr.Support(LENGTH, 0.7 * BEARING, DAMPING, FIXED, angle=0.2),
        spin=jr.ConstantSpeed(speed),
    )


def by_elements(speed, modes):
    """Multipliers by finite elements and scipy, in modes of the rotor at rest and static shapes."""
    beam = Beam(LENGTH, DIAMETER, YOUNG, DENSITY, elements=40).disc(*DISC, 4.0, 0.01)
    held = np.zeros_like(beam.K)
    damped = beam.C.copy()
    for at, stiffness in ((0.0, BEARING), (LENGTH, 0.7 * BEARING)):
        held[beam.node(at), beam.node(at)] = stiffness
        damped[beam.node(at), beam.node(at)] += DAMPING
    _, shapes = eigh(beam.K + held, beam.M, subset_by_index=[0, modes - 1])
    ends = np.eye(len(held))[:, [beam.node(0.0), beam.node(LENGTH)]]
    shapes = np.concatenate([shapes, np.linalg.solve(beam.K + held, ends)], axis=1)
    shapes = shapes @ eigh(shapes.T @ (beam.K + held) @ shapes, shapes.T @ beam.M @ shapes)[1]
    modes += 2
    elastic, held, damped, gyroscopic = (
        shapes.T @ part @ shapes for part in (beam.K, held, damped, beam.G)
    )
    both = lambda matrix: np.kron(np.eye(2), matrix)
    damping = both(damped) - speed * np.kron(J, gyroscopic)
    fixed = np.kron(along(1.0, FIXED, 0.2), held)
    size = 2 * modes

    def field(t, y):
        q, v = y.reshape(2, size, -1)
        # Voigt: the stress depends on the rate of strain too, in the axes of the shaft.
        strain = q + VOIGT * (v - speed * np.kron(J, np.eye(modes)) @ q)
        force = np.kron(along(1.0, SHAFT, speed * t), elastic) @ strain
        return np.concatenate([v, -damping @ v - fixed @ q - force]).ravel()

    half = solve_ivp(
        field, (0, np.pi / speed), np.eye(2 * size).ravel(), method="DOP853", rtol=1e-9, atol=1e-11
    )
    return np.linalg.eigvals(half.y[:, -1].reshape(2 * size, -1)) ** 2


@pytest.mark.long
def test_flexible_shaft_against_finite_elements():
    speed = 320.0
    expected = by_elements(speed, modes=8)
    expected = expected[np.argsort(-np.abs(expected))][:8]
    found, _ = paired(jr.floquet_multipliers(flexible(speed)), expected)
    # In the second pair of modes the error of the elements is that of truncation to eight modes.
    np.testing.assert_allclose(found[:4], expected[:4], rtol=0, atol=1e-7)
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-6)


@pytest.mark.slow
def test_error_is_seen_by_doubling_the_steps():
    """The order is 13, for a mode of 2.4 times the speed with 2.5 rad per step and half of it."""
    scene = flexible(100.0)
    exact = jr.floquet_multipliers(scene, steps=32)
    slow = np.asarray(exact)[np.abs(exact) > 0.1]
    errors = [
        np.max(np.abs(paired(jr.floquet_multipliers(scene, steps=k), slow)[0] - slow))
        for k in (3, 6)
    ]
    assert 1e-11 < errors[1] < errors[0] / 2**10


# === growth


def growth_by_scipy(p, values):
    return np.log(np.max(np.abs(integrated(p, **values)))) * p / (2 * np.pi)


@pytest.mark.long
def test_onset_speed_with_periodic_coefficients():
    values = BASE | {"nu": 0.2, "delta": 0.15}
    scene = rotor(1.0, **values)
    onset = jr.onset_speed(scene, within=(1.0, 4.0), samples=12)
    expected = brentq(lambda p: growth_by_scipy(p, values), 1.2, 3.8, xtol=1e-9)
    assert float(onset.speed) == pytest.approx(expected, abs=1e-7)
    crossings = jr.stability_crossings(scene, within=(1.0, 4.0), samples=12)
    assert [lost for _, lost in crossings] == [True]
    assert float(crossings[0][0].speed) == float(onset.speed)


@pytest.mark.parametrize("p", [0.6, 0.83, 3.0])
def test_growth_rate(p):
    assert float(jr.growth_rate(rotor(p, **BASE))) == pytest.approx(
        growth_by_scipy(p, BASE), abs=1e-10
    )


def test_growth_rate_at_rest():
    """A rotor at rest has fixed axes: its own stiff axis is x."""
    stands = {name: value for name, value in BASE.items() if name != "mu"}
    scene = rotor(0.0, **BASE)
    m = np.eye(2)
    # Quadratic in the displacement of the disc alone, by the massless supports' equation at each root.
    bearing, shaft = along(2.0, stands["nu"], stands["angle"]), along(1.0, BASE["mu"], 0.0)
    zero = np.zeros((2, 2))
    kappa, support = 0.16, 0.16
    damping = np.block(
        [[(kappa + BASE["delta"]) * m, -kappa * m], [-kappa * m, (kappa + 2 * support) * m]]
    )
    stiffness = np.block([[shaft, -shaft], [-shaft, shaft + bearing]])
    inertia = np.block([[m, zero], [zero, zero]])
    first = np.block([[np.eye(4), np.zeros((4, 4))], [np.zeros((4, 4)), inertia]])
    second = np.block([[np.zeros((4, 4)), np.eye(4)], [-stiffness, -damping]])
    inverses = np.linalg.eigvals(np.linalg.solve(second, first))
    expected = max((1 / inverses[np.abs(inverses) > 1e-9]).real)
    assert float(jr.growth_rate(scene)) == pytest.approx(expected, abs=1e-10)


PATHS = ("shaft.anisotropy", "supports.anisotropy", "supports.stiffness", "spin.speed")


@pytest.mark.slow
@pytest.mark.parametrize("support", [None, 0.16])
def test_gradient(support):
    """Massless supports have zero multipliers, defective without damping; the others stay correct."""
    values = BASE | {"support": support, "kappa": 0.05}
    scene = rotor(1.3, **values)
    middle = {path: jnp.ravel(scene.get(path))[0] for path in PATHS}
    both = jax.jit(jax.value_and_grad(lambda values: jr.growth_rate(scene.put(values))))
    slopes = both(middle)[1]
    for path, value in middle.items():
        at = lambda h, path=path, value=value: float(both(middle | {path: value + h})[0])
        h = 1e-4
        found = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
        assert float(slopes[path]) == pytest.approx(found, rel=1e-7, abs=1e-9), path


@pytest.mark.slow
def test_gradient_of_multipliers():
    scene, x, h = flexible(300.0, nodes=4), jnp.asarray(SHAFT), 1e-4
    at = lambda x: jr.floquet_multipliers(scene.put({"shaft.anisotropy": x}), 8)[:8]
    both = jax.jit(lambda x: jax.jvp(at, (x,), (jnp.ones(()),)))
    near = [np.asarray(both(x + k * h)[0]) for k in (-2, -1, 1, 2)]
    found = (near[0] - 8 * near[1] + 8 * near[2] - near[3]) / (12 * h)
    np.testing.assert_allclose(both(x)[1], found, rtol=1e-6)


def test_mapped_equals_one_by_one():
    scene = rotor(1.0, **BASE)
    speeds = jnp.array([0.5, 0.9, 1.4])
    at = lambda p: jr.floquet_multipliers(scene.put({"spin.speed": p}))
    for mapped in (jax.lax.map(at, speeds), jax.vmap(at)(speeds)):
        for p, found in zip(speeds, mapped, strict=True):
            expected = np.asarray(jr.floquet_multipliers(rotor(float(p), **BASE)))
            np.testing.assert_allclose(paired(found, expected)[0], expected, rtol=0, atol=1e-13)


def test_refusals():
    scene = rotor(1.0, **BASE)
    with pytest.raises(ValueError, match="the speed is 0"):
        jr.floquet_multipliers(rotor(0.0, **BASE))
    with pytest.raises(ValueError, match="`steps` must be a whole number"):
        jr.floquet_multipliers(scene, 0)
    with pytest.raises(
        ValueError, match="`steps` = 32 is too small to resolve the first mode at 0.01"
    ):
        jr.floquet_multipliers(rotor(0.01, **BASE))
    slow = jax.lax.map(
        lambda p: jr.growth_rate(scene.put({"spin.speed": p})), jnp.array([0.01, 1.0])
    )
    assert np.isnan(slow).tolist() == [True, False]
    with pytest.raises(
        ValueError, match=r"\(hysteretic_damping\) is defined for circular whirl only"
    ):
        jr.growth_rate(
            jr.Scene(scene.shaft, *scene.effects, jr.HystereticDamping(0.01), spin=scene.spin)
        )
    for refused in (jr.roots, jr.modes, jr.critical_speeds):
        with pytest.raises(
            ValueError, match=r"supports.0 and supports.1.*`jaxrotor.floquet_multipliers`"
        ):
            refused(scene)
