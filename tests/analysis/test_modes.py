"""Modes: whirl and damping in fixed axes, and derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr


MASS, STIFFNESS, MU, INNER, OUTER = 2.0, 8.0, 0.3, 0.4, 0.25  # kg, N/m, 1, N s/m


def unequal(speed, mu=MU):
    """A disc on a shaft of two stiffnesses, damped inside and outside."""
    shaft = jr.MasslessShaft(1.0, 0.5, STIFFNESS, anisotropy=mu, damping=INNER)
    on_it = jr.Disc(0.5, MASS), jr.DiscDamping(0.5, OUTER)
    return jr.Scene(shaft, *on_it, spin=jr.ConstantSpeed(speed))


def turning(speed, mu=MU):
    """Values and shapes (x + i y, and of the counter part) by numpy, in the axes of the shaft.

    m (x.. - 2 W y. - W^2 x) + c_i x. + c_e (x. - W y) + k (1 + mu) x = 0, and so in y.
    """
    J = np.array([[0.0, -1.0], [1.0, 0.0]])
    damping = 2 * MASS * speed * J + (INNER + OUTER) * np.eye(2)
    stiffness = STIFFNESS * np.diag([1 + mu, 1 - mu]) + (OUTER * speed * J)
    stiffness = stiffness - MASS * speed**2 * np.eye(2)
    lower = np.concatenate([-stiffness / MASS, -damping / MASS], axis=1)
    values, vectors = np.linalg.eig(np.concatenate([np.eye(2, 4, 2), lower]))
    # x = X exp(l t) and its conjugate: z = (X + i Y) / 2 exp(l t) + conj((X - i Y) / 2 exp(l t))
    x, y = vectors[:2]
    return values, x + 1j * y, x - 1j * y


def winding(value, shape, counter, speed):
    """Mean angular speed in fixed axes, from the phase of the motion over a long time."""
    t = np.linspace(0.0, 4000.0, 400_001)
    turned = shape * np.exp(1j * value.imag * t) + np.conj(counter * np.exp(1j * value.imag * t))
    phase = np.unwrap(np.angle(turned * np.exp(1j * speed * t)))
    return (phase[-1] - phase[0]) / t[-1]


@pytest.mark.parametrize("speed", [0.7, -0.7, 2.6, -2.6])
def test_whirl_in_turning_axes_is_that_seen_from_fixed_ones(speed):
    found = jr.modes(unequal(speed))
    assert found.frame == "rotating"
    values, shapes, counters = turning(speed)
    ways = set()
    for k, value in enumerate(np.asarray(found.values)):
        one = int(np.argmin(np.abs(values - value)))
        assert values[one] == pytest.approx(value, rel=1e-10)
        seen = winding(values[one], shapes[one], counters[one], speed)
        exact = np.array([speed + value.imag, speed - value.imag])  # one of the two, to all digits
        (seen,) = exact[np.abs(exact - seen) < 2e-3]
        assert float(found.fixed_values[k].imag) == pytest.approx(seen, rel=1e-9)
        way = np.sign(seen * speed)
        ways.add(way)
        assert np.sign(float(found.forward[k])) == way
        growth = value.real
        ratio = -growth / np.hypot(growth, seen)
        assert float(found.damping_ratio[k]) == pytest.approx(ratio, rel=1e-8)
        assert float(found.log_decrement[k]) == pytest.approx(
            -2 * np.pi * growth / abs(seen), rel=1e-8
        )
    assert ways == {-1.0, 1.0}


@pytest.mark.parametrize("speed", [1.3, -1.3])
def test_equal_axes_whirl_alike_in_both_axes(speed):
    """The roots obey `m l^2 + c l + k - i W c_i = 0` and orbits are circles in any axes of computation."""
    exact = np.roots([MASS, INNER + OUTER, STIFFNESS - 1j * speed * INNER])
    for scene in (unequal(speed, mu=0.0), unequal(speed).put({"shaft.anisotropy": None})):
        found = jr.modes(scene)
        fixed = np.asarray(found.fixed_values)
        for root in exact:
            (same,) = {
                round(float(found.forward[k])) for k in np.flatnonzero(np.abs(fixed - root) < 1e-9)
            }
            assert same == np.sign(root.imag * speed)
        np.testing.assert_allclose(
            np.unique(np.round(found.log_decrement, 9)),
            np.sort(np.round(-2 * np.pi * exact.real / np.abs(exact.imag), 9)),
            atol=2e-9,
        )


@pytest.mark.parametrize("speed", [0.5, -0.5, 0.0])
def test_forward_is_with_the_spin(speed):
    """A tilting disc: gyroscopic moments raise the frequency of forward whirl."""
    shaft = jr.MasslessShaft(1.0, 0.5, 1.0, 0.1, 1.44)
    scene = jr.Scene(shaft, jr.Disc(0.5, 1.0, 1.0, 1.0), spin=jr.ConstantSpeed(speed))
    found = jr.modes(scene)
    sense = -1.0 if speed < 0 else 1.0
    np.testing.assert_array_equal(found.forward, sense * np.sign(np.asarray(found.values).imag))
    if speed:  # frequency ratio of the tilting pair
        fast = np.argsort(-np.abs(np.asarray(found.values)))[:2]
        assert float(found.forward[fast[0]]) == 1.0 and float(found.forward[fast[1]]) == -1.0
    branches = jr.campbell(scene, [-0.6, -0.3, 0.0, 0.3, 0.6])
    signs = np.sign(np.asarray(branches.values).imag)
    np.testing.assert_array_equal(branches.forward[2:], signs[2:])
    np.testing.assert_array_equal(branches.forward[:2], -signs[:2])


# === derivatives


def ordered(speed, mu):
    """Values, damping ratios in turning axes and counter shapes by numpy, of positive frequency."""
    values, shapes, counters = turning(speed, mu)
    order = np.argsort(values.imag)[-2:]
    return values[order], (counters / shapes)[order]


@pytest.mark.slow
def test_modes_are_differentiable():
    """Derivatives by the anisotropy equal central differences of numpy."""
    speed, h = 0.7, 1e-4
    weights = {1: 2 / 3, -1: -2 / 3, 2: -1 / 12, -2: 1 / 12}
    near = {k: ordered(speed, MU + k * h) for k in weights}
    slopes = [sum(w * near[k][i] for k, w in weights.items()) / h for i in (0, 1)]

    def split(mu):
        found = jr.modes(unequal(speed).put({"shaft.anisotropy": mu}))
        ratio = (found.counter / found.shapes)[:, 0]
        parts = [found.values.real, found.values.imag, ratio.real, ratio.imag, found.damping_ratio]
        return jnp.stack(parts)

    at, (forward, backward) = (
        split(jnp.asarray(MU)),
        (kind(split)(jnp.asarray(MU)) for kind in (jax.jacfwd, jax.jacrev)),
    )
    np.testing.assert_allclose(forward, backward, rtol=1e-9, atol=1e-12)
    order = np.argsort(at[1])[-2:]
    found = np.asarray(forward)[:, order]
    np.testing.assert_allclose(found[0] + 1j * found[1], slopes[0], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found[2] + 1j * found[3], slopes[1], rtol=1e-7, atol=1e-9)
    seen = lambda values: np.array([speed + values[0].imag, speed - values[1].imag])
    ratio = lambda values: -values.real / np.hypot(values.real, seen(values))
    ratios = sum(w * ratio(near[k][0]) for k, w in weights.items()) / h
    np.testing.assert_allclose(found[4], ratios, rtol=1e-6, atol=1e-9)


@pytest.mark.slow
def test_equal_roots_hold_their_shapes():
    """On supports with zero anisotropy two roots are equal: the derivative is their mean, not NaN."""
    shaft = jr.MasslessShaft(1.0, 0.5, STIFFNESS)
    support = jr.Support(0.5, 1.0, anisotropy=0.0)
    scene = jr.Scene(shaft, jr.Disc(0.5, MASS), support, spin=jr.ConstantSpeed(1.0))

    def frequency(stiffness):
        found = jr.modes(scene.put({"supports.stiffness": stiffness}))
        return jnp.max(found.values.imag) + 0 * jnp.sum(jnp.abs(found.shapes) ** 2)

    slope = 1 / (2 * MASS * np.sqrt((STIFFNESS + 1.0) / MASS))  # of sqrt((k + s) / m)
    for kind in (jax.jacfwd, jax.jacrev):
        assert float(kind(frequency)(jnp.asarray(1.0))) == pytest.approx(slope, rel=1e-9)


@pytest.mark.slow
def test_massless_supports_have_no_modes():
    scene = jr.load("dual-stiffness-elastic").put({"shaft.damping": None, "supports.damping": None})
    found = jr.modes(scene)
    values = np.asarray(jr.roots(scene))
    np.testing.assert_allclose(found.values, values, rtol=1e-12)
    assert found.shapes.shape[0] == found.counter.shape[0] == values.size
    assert np.isfinite(found.damping_ratio).all()
