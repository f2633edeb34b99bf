"""Several devices run chunks of a sweep, with the data of one. The processor is presented as two."""

import os
import subprocess
import sys

import pytest


SCRIPT = """
import threading

import jax
import jax.numpy as jnp
import numpy as np

import jaxrotor as jr
from jaxrotor.core.parallel import spread

assert jax.local_device_count() == 2
both = threading.Barrier(2, timeout=60)


def run(chunk, tick):
    both.wait()
    return jnp.zeros(1).devices()


assert set.union(*spread(run, [0, 1], 2, lambda steps: None)) == set(jax.local_devices())
over = {"unbalance.eccentricity": np.linspace(0, 1e-3, 8)}
how = {"start": jr.Whirl(7e-3, 75.0), "settle": 2, "keep": 2, "steps_per_revolution": 48}
how["error_sample"] = 0
scene = jr.load("limiter-rotor").with_nodes(4)
one, two = (jr.sweep(scene, over, workers=n, lanes_per_chunk=2, **how) for n in (1, 2))
assert one.identical(two)
"""


@pytest.mark.slow
def test_a_sweep_over_two_devices():
    flags = os.environ.get("XLA_FLAGS", "")
    environment = os.environ | {"XLA_FLAGS": f"{flags} --xla_force_host_platform_device_count=2"}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
