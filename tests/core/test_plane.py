"""Planes: complex numbers as pairs of real ones."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxrotor.core.plane import angle, directions, plane


@pytest.mark.parametrize(("make", "kind"), [(np.asarray, np.ndarray), (jnp.asarray, jnp.ndarray)])
def test_parts_are_along_a_new_axis_in_the_same_kind_of_array(make, kind):
    z = make([[1 + 2j, 3 - 4j, 5j]])
    for axis, shape in ((0, (2, 1, 3)), (1, (1, 2, 3)), (-1, (1, 3, 2))):
        found = plane(z, axis)
        assert found.shape == shape and isinstance(found, kind)
        np.testing.assert_array_equal(np.take(np.asarray(found), 0, axis), z.real)
        np.testing.assert_array_equal(np.take(np.asarray(found), 1, axis), z.imag)


def test_angle_is_that_of_numpy():
    draw = np.random.default_rng(0)
    size = 10.0 ** draw.uniform(-100, 100, (2, 20_000))
    axes = [0, 1, -1, 1j, -1j, 1 + 1j, -1 - 1j, 1e-300j, complex(-1, -0.0), complex(-0.0, -1)]
    z = np.concatenate([draw.normal(size=20_000) * size[0] + 1j * size[1], axes])
    z = np.concatenate([z, z.conj(), draw.normal(size=20_000) + 1j * draw.normal(size=20_000)])
    found, wanted = np.asarray(jax.jit(angle)(z)), np.angle(z)
    np.testing.assert_allclose(found, wanted, rtol=4e-16, atol=4e-16)
    single = np.asarray(jax.jit(angle)(z[-20_000:].astype(np.complex64)))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, wanted[-20_000:], atol=3e-6)


def test_angle_grows_by_the_motion_across():
    z, dz = 0.6 - 0.8j, 0.3 + 0.2j
    grown = (np.angle(z + 1e-6 * dz) - np.angle(z - 1e-6 * dz)) / 2e-6
    assert jax.jvp(angle, (z,), (dz,))[1] == pytest.approx(grown, rel=1e-9)


@pytest.mark.parametrize("size", [0.1, 10.0, 1e6, 1e8])
def test_directions_of_numpy(size):
    """Beyond 1e6 rad to half of the last digit that the angle itself has."""
    angles = np.random.default_rng(0).uniform(-size, size, 100_000)
    quarters = np.pi / 4 * np.arange(-100, 101)
    angles = np.concatenate([angles, quarters, np.nextafter(quarters, np.inf)])
    found = np.asarray(jax.jit(directions)(angles))
    np.testing.assert_allclose(
        found, np.exp(1j * angles), rtol=0, atol=4e-16 + np.spacing(size) / 2
    )
    single = angles[:-402].astype(np.float32)
    found = np.asarray(jax.jit(directions)(single))
    assert found.dtype == np.complex64
    atol = 2e-7 + np.spacing(np.float32(size))
    np.testing.assert_allclose(found, np.exp(1j * single.astype(float)), rtol=0, atol=atol)


def test_directions_turn_by_a_right_angle():
    at = np.array([0.3, 4.0, -2.5e4])
    value, rate = jax.jvp(directions, (at,), (np.array([1.0, 2.0, -1.0]),))
    np.testing.assert_allclose(rate, 1j * value * np.array([1.0, 2.0, -1.0]), rtol=1e-15)
    second = jax.grad(jax.grad(lambda x: directions(x).real))(0.3)
    assert second == pytest.approx(-np.cos(0.3), rel=1e-15)
