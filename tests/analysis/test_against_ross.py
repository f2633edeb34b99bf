"""Machine of `benchmarks/against_ross.py`: ROSS's elements converge to the numbers of jaxrotor."""

from pathlib import Path

import numpy as np
import pytest

import jaxrotor as jr


BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
# Printed by ROSS 2.3.0: python benchmarks/against_ross.py --limits --only 'disc, (crit|thre|modes)'
CRITICAL = [
    268.2974495580294, 304.3080143465277, 1187.9461572842067,
    1382.4209373038382, 1647.446860409178, 2218.5320856791072,
]  # fmt: skip
THRESHOLD = 730.5822654048425
MODES = [
    -1.0408274469355883 + 266.6833267175764j,
    -0.9936424243830736 + 304.11549718502533j,
    -126.74144563985891 + 1292.7835517523267j,
    -84.1179365574128 + 1634.0649914540456j,
    -70.26111161969288 + 1704.7696990996646j,
    -139.68070414687452 + 2050.12991762261j,
]


@pytest.fixture
def machine(monkeypatch):
    """The benchmark's module for jaxrotor, and the machine."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    from peers import turbomachines, with_jaxrotor

    return with_jaxrotor, turbomachines.MACHINES["overhung disc"]


def test_critical_speeds(machine):
    own, which = machine
    scene = own.scene_of(which)
    speeds = np.asarray(jr.critical_speeds(scene).speeds)[: len(CRITICAL)]
    np.testing.assert_allclose(speeds, CRITICAL, rtol=1e-6)


@pytest.mark.slow
def test_modes(machine):
    own, which = machine
    scene = own.scene_of(which)
    values = np.asarray(jr.modes(scene.at_speed(which.speed), 12).values)
    np.testing.assert_allclose(values[values.imag > 1], MODES, rtol=1e-6)


@pytest.mark.slow
def test_threshold(machine):
    own, which = machine
    whole = own.sealed(own.scene_of(which), which)
    found = jr.onset_speed(whole, (0.0, which.unstable), own.SCAN)
    assert float(found.speed) == pytest.approx(THRESHOLD, rel=1e-8)
