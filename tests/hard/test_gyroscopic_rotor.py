"""Hard cases of the gyroscopic rotor that its sheet has no table for: a free body, single precision."""

import os
import subprocess
import sys

import numpy as np
import pytest
from published import rotor

import jaxrotor as jr


def on_a_shaft(det, speed):
    """`k11 k22 - k12^2 = det k11 k22`: free to turn about a point of its axis where it vanishes."""
    shaft = jr.MasslessShaft(0.6, 0.3, 1e5, -1e4 * np.sqrt(1 - det), 1e3)
    return jr.Scene(shaft, jr.Disc(0.3, 2.0, 0.01, 0.002), spin=jr.ConstantSpeed(speed))


@pytest.mark.hard("3.10 a free body: its roots")
@pytest.mark.parametrize("speed", [0.0, 50.0, -50.0])
def test_roots_of_a_free_body(speed):
    """Eq. (3) with `det = 0`: one root is zero, a cubic has the others."""
    m, inertia, turn, total = 2.0, 0.01, 0.002 * speed, 2.0 * 1e3 + 0.01 * 1e5
    found = np.sort(np.asarray(jr.roots(on_a_shaft(0.0, speed))).imag)
    others = np.roots([m * inertia, -m * turn, -total, 1e5 * turn]).real
    # at rest zero is a double root: the square root of the rounding of 387 rad/s
    np.testing.assert_allclose(found, np.sort([0.0, *others]), rtol=1e-10, atol=2e-5)


@pytest.mark.hard("3.10 a free body: relative corrections are 0/0", outcome="flagged")
@pytest.mark.parametrize("det", [0.0, 1e-9, 1e-3])
def test_the_first_order_of_a_free_body(det):
    """Of the slow pair it does not hold, and says so; of the fast one it does."""
    scene = on_a_shaft(det, 50.0)
    first = jr.perturbed_roots(scene)
    assert np.asarray(first.valid).tolist() == [False, True, False, True]
    fast = -1j * np.asarray(first.values)[[1, 3]]
    exact = np.sort(np.asarray(jr.roots(scene)).imag)[[-1, 0]]
    np.testing.assert_allclose(fast, exact, rtol=2e-3)


SINGLE = """
import jaxrotor as jr
rotor = jr.load("gyroscopic-cantilever").put({"spin.speed": 240.800121421})
values = *jr.roots(rotor).tolist(), *jr.perturbed_roots(rotor).values.tolist()
print(jr.roots(rotor).dtype, *values)
"""


@pytest.mark.slow
@pytest.mark.hard("3.12 single precision: coefficients from 1e-2 to 1e7")
def test_single_precision(record_property):
    """The mismatches of interest are 1e-4; float64 is compared with the sheet elsewhere."""
    environment = os.environ | {"JAX_ENABLE_X64": "0"}
    options = {"env": environment, "capture_output": True, "text": True, "timeout": 300}
    done = subprocess.run([sys.executable, "-c", SINGLE], **options)
    kind, *values = done.stdout.split()
    assert kind == "complex64", done.stderr
    values = np.array([complex(value) for value in values])
    scene = rotor("CAN", 240.800121421)
    exact, first = np.asarray(jr.roots(scene)), np.asarray(jr.perturbed_roots(scene).values)
    error = max(np.abs(values[:4, None] - exact).min(axis=0) / np.abs(exact))
    error = max(error, *(np.abs(values[4:] - first) / np.abs(first)))
    record_property("measured", f"relative error {error:.0e}")
    assert error < 1e-5
