"""Planes: complex numbers as pairs of real ones."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxrotor.core.plane import angle, plane


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
