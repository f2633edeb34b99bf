"""A shaft has no constraints unless they are drawn, and rotors that nothing holds are treated as free."""

import fem
import numpy as np
import pytest
import scipy.linalg

import jaxrotor as jr


STEEL = (2.1e11, 7850.0, np.inf)
TWO_BEARINGS = """
[shaft]
length = "1 m"
diameter = "50 mm"
[disc]
at = "0.5 m"
mass = "10 kg"
[[support]]
at = "0 m"
stiffness = "10 MN/m"
[[support]]
at = "1 m"
stiffness = "10 MN/m"
[spin]
speed = 0
"""


def frequencies(bearings, mass=10.0):
    """Natural frequencies [rad/s] of the rotor at rest by finite elements, along one axis."""
    discs = [(0.5, mass, 0.0, 0.0)]
    held = [(at, np.diag([stiffness, stiffness])) for at, stiffness in bearings]
    _, inertia, _, stiffness = fem.matrices([fem.Stretch(1.0, 0.05)], discs, held, STEEL, 0.025)
    plane = np.ix_(*[np.arange(0, len(inertia), 2)] * 2)
    squares = scipy.linalg.eigh(stiffness[plane], inertia[plane], eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0))


def test_two_bearings_alone_hold_a_shaft():
    """A file without `constraints` has none: 383 rad/s in its bearings, where a clamp gave 611."""
    scene = jr.loads(TWO_BEARINGS)
    expected = frequencies([(0.0, 1e7), (1.0, 1e7)])[:3]
    assert expected[0] == pytest.approx(383.3, abs=0.1)
    np.testing.assert_allclose(np.abs(jr.roots(scene, 6))[::2], expected, rtol=2e-6)
