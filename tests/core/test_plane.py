"""Planes: complex numbers as pairs of real ones."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxrotor.core.plane import plane


@pytest.mark.parametrize(("make", "kind"), [(np.asarray, np.ndarray), (jnp.asarray, jnp.ndarray)])
def test_parts_are_along_a_new_axis_in_the_same_kind_of_array(make, kind):
    z = make([[1 + 2j, 3 - 4j, 5j]])
    for axis, shape in ((0, (2, 1, 3)), (1, (1, 2, 3)), (-1, (1, 3, 2))):
        found = plane(z, axis)
        assert found.shape == shape and isinstance(found, kind)
        np.testing.assert_array_equal(np.take(np.asarray(found), 0, axis), z.real)
        np.testing.assert_array_equal(np.take(np.asarray(found), 1, axis), z.imag)
