"""Uncertainty of fitted parameters: against the textbook's straight line."""

import jax.numpy as jnp
import numpy as np
import pytest
from shown import shown

import jaxrotor as jr


SCENE = jr.load("overhung-disc")
PATHS = ("spin.speed", "disc.mass")
ACROSS = np.linspace(-1.0, 3.0, 9)
LEFT = np.array([0.3, -0.1, 0.2, -0.4, 0.1, 0.0, -0.2, 0.4, -0.3])


def line(scene):
    """Residuals of `speed + mass x`, of which `LEFT` remains at the scene's own values."""
    level, slope = (scene.get(path) - SCENE.get(path) for path in PATHS)
    return level + slope * ACROSS + LEFT


def test_of_a_straight_line():
    """`C = sigma^2 (X^T X)^-1`, `sigma^2 = sum r^2 / (m - n)`."""
    design = np.stack([np.ones(9), ACROSS], axis=1)
    sigma = np.sqrt(np.sum(LEFT**2) / 7)
    expected = sigma**2 * np.linalg.inv(design.T @ design)
    found = jr.uncertainty(line, SCENE, PATHS)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-12)
    assert float(found.noise) == pytest.approx(sigma, rel=1e-14)
    assert float(found.deviations["disc.mass"]) == pytest.approx(expected[1, 1] ** 0.5, rel=1e-12)
    rows = {path: float(deviation) for path, _, deviation in shown(found)[2]}
    assert rows == pytest.approx(
        dict(zip(PATHS, np.sqrt(np.diag(expected)), strict=True)), rel=1e-5
    )
    given = jr.uncertainty(line, SCENE, PATHS, noise=0.1)
    np.testing.assert_allclose(given.covariance, expected * (0.1 / sigma) ** 2, rtol=1e-12)
    off = np.array([0.2, -0.1])
    values = {path: SCENE.get(path) + one for path, one in zip(PATHS, off, strict=True)}
    distance = off @ np.linalg.solve(expected, off)
    assert float(found.distance(values)) == pytest.approx(distance, rel=1e-11)
    assert "disc.mass = " in str(found) and "+-" in str(found)


def test_refusals():
    with pytest.raises(ValueError, match="2 residuals do not determine 2 parameters"):
        jr.uncertainty(lambda s: line(s)[:2], SCENE, PATHS)
    with pytest.raises(ValueError, match="do not depend on `disc.polar`"):
        jr.uncertainty(line, SCENE, (*PATHS, "disc.polar"))
    both = lambda s: jnp.arange(4.0) * (s.get("spin.speed") + s.get("disc.mass"))
    with pytest.raises(ValueError, match="do not tell `spin.speed`, `disc.mass` apart"):
        jr.uncertainty(both, SCENE, PATHS)
