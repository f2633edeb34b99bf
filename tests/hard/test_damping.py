"""Damping from none to far beyond critical, through the double roots, against SciPy's exponential."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from systems import LENGTH, TIME, limiter_rotor

import jaxrotor as jr
from jaxrotor.motion import Motion
from jaxrotor.simulate import choose
from jaxrotor.solvers.basis import WORST_CONDITION
from jaxrotor.system import assemble


PERIOD, STEPS = 0.5 * TIME, 16
START = jr.Whirl(1e-3, 40.0)


def quiet(voigt: float) -> jr.Scene:
    """The rotor at rest, without stops, its material alone dampens."""
    scene = limiter_rotor(N=0.0, eta_e=None, eta_Dxi=None, contact=False, nodes=4)
    return scene.replace({"internal_damping.voigt_time": voigt})


def matrix(scene: jr.Scene) -> np.ndarray:
    return np.asarray(Motion(assemble(scene), jnp.asarray(2 * np.pi / PERIOD)).matrix())


def condition(scene: jr.Scene) -> float:
    return float(np.linalg.cond(np.linalg.eig(matrix(scene))[1]))


def error(scene: jr.Scene) -> tuple[float, str]:
    """Of the motion over two periods, over its start; and the basis it was computed in."""
    chosen = choose(None, scene, jnp.asarray(2 * np.pi / PERIOD))
    r = jr.simulate(scene, 2, STEPS, start=START, period=PERIOD)
    system = assemble(scene)
    q, v = START.state(system, jnp.asarray(LENGTH))
    y, a = np.concatenate([q, np.asarray(v) * PERIOD / (2 * np.pi)]), matrix(scene)
    row = np.asarray(system.line.row(jnp.asarray(LENGTH)))
    turns = 2 * np.pi * np.arange(2 * STEPS + 1) / STEPS
    want = np.array([row @ (expm(a * t) @ y)[: system.n] for t in turns])
    assert f"'{chosen.basis}'" in r.solver
    return abs(np.asarray(r.displacement[:, 0]) - want).max() / 1e-3, chosen.basis


@pytest.mark.hard("1.5 defective modal basis: both sides of the switch to the dense one")
def test_both_sides_of_the_switch(record_property):
    """At `T = 2 / w` a pair of roots merges: the eigenvectors' condition grows as `|T - 2 / w|^-1/2`."""
    first = np.abs(np.asarray(jr.roots(quiet(0.0)))).min()
    near = [2 / first * (1 + d) for d in np.geomspace(1e-2, 1e-15, 53)]
    conditions = np.array([condition(quiet(t)) for t in near])
    before = conditions < WORST_CONDITION
    assert before.any() and not before.all(), "the double root is met"
    last = near[np.flatnonzero(before)[conditions[before].argmax()]]
    beyond = near[np.flatnonzero(~before)[conditions[~before].argmin()]]
    worst = near[conditions.argmax()]
    found = {name: error(quiet(t)) for name, t in zip("abc", (last, beyond, worst), strict=True)}
    assert [basis for _, basis in found.values()] == ["modal", "dense", "dense"]
    figures = [e for e, _ in found.values()]
    text = ", ".join(f"{e:.0e} by {b}" for e, b in found.values())
    record_property("measured", f"path {text} (conditions up to {conditions.max():.0e})")
    assert max(figures) < 1e-10


@pytest.mark.hard("1.5 internal damping 0 and far over-damped")
@pytest.mark.parametrize("eta", [0.0, 1.0, 1e2, 1e4])
def test_internal_damping_from_none_to_far_over_damped(eta, record_property):
    found, basis = error(quiet(2 * eta * TIME))
    record_property("measured", f"path {found:.0e}, {basis} basis")
    assert found < 1e-10


@pytest.mark.hard("1.5 over-damped: the shaft creeps back")
def test_an_over_damped_shaft_creeps(record_property):
    """Its slow roots are `-1 / T`, whatever the inertia, as `T` grows."""
    voigt = 2e4 * TIME
    slow = np.asarray(jr.roots(quiet(voigt)))
    slow = slow[np.abs(slow.real + 1 / voigt) < 0.5 / voigt]
    assert slow.size >= 1
    off = abs(slow * voigt + 1).max()
    record_property("measured", f"roots {off:.0e}")
    assert off < 1e-6


@pytest.mark.hard("1.5 without any damping amplitudes last")
def test_no_damping_at_all(record_property):
    """After 1000 whirls the elastic and kinetic energy of the tip's mode is what it was."""
    scene = quiet(0.0).without("disc_damping")
    roots = np.asarray(jr.roots(scene))
    off = abs(roots.real).max() / abs(roots).max()
    r = jr.simulate(scene, 20_000, 4, start=jr.Whirl(1e-3), period=PERIOD, keep=1)
    reach = abs(np.asarray(r.displacement[:, 0])).max()
    record_property("measured", f"growth of roots {off:.0e} of the largest")
    assert off < 1e-10
    assert reach < 1.2e-3
