"""Damping from none to far beyond critical, through the double roots, against SciPy's exponential."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from systems import LENGTH, TIME, limiter_rotor

import jaxrotor as jr
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.equations.system import assemble
from jaxrotor.solvers.basis import WORST_CONDITION, condition
from jaxrotor.solvers.choice import choose


PERIOD, STEPS = 0.5 * TIME, 16
START = jr.Whirl(1e-3, 40.0)


def quiet(voigt: float) -> jr.Scene:
    """The rotor at rest, without stops, its material alone dampens."""
    scene = limiter_rotor(N=0.0, eta_e=None, eta_Dxi=None, contact=False, nodes=4)
    return scene.replace({"internal_damping.voigt_time": voigt})


@eqx.filter_jit
def assembled(scene: jr.Scene):
    system = assemble(scene)
    return Motion(system, jnp.asarray(2 * np.pi / PERIOD)).matrix(), system.blocks


def matrix(scene: jr.Scene) -> np.ndarray:
    return np.asarray(assembled(scene)[0])


def condition_at(scene: jr.Scene) -> float:
    return float(condition(np.linalg.eig(matrix(scene))[1]))


def simulated(scene: jr.Scene) -> tuple[np.ndarray, str]:
    """Displacement of the tip over two periods, and the basis it was computed in."""
    chosen = choose(None, assemble(scene), jnp.asarray(2 * np.pi / PERIOD))
    assert isinstance(chosen, jr.Exponential)
    r = jr.simulate(scene, 2, STEPS, start=START, period=PERIOD)
    assert f"'{chosen.basis}'" in r.solver
    return np.asarray(r.displacement[:, 0]), chosen.basis


def begun(scene: jr.Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates and velocities of the start, and the row that reads the tip."""
    system = assemble(scene)
    q, v = START.state(system, jnp.asarray(LENGTH))
    return np.asarray(q), np.asarray(v), np.asarray(system.line.row(jnp.asarray(LENGTH)))


def by_exponential(scene: jr.Scene) -> np.ndarray:
    """SciPy's exponential of the whole matrix."""
    q, v, row = begun(scene)
    y, a = np.concatenate([q, v * PERIOD / (2 * np.pi)]), matrix(scene)
    turns = 2 * np.pi * np.arange(2 * STEPS + 1) / STEPS
    return np.array([row @ (expm(a * t) @ y)[: q.size] for t in turns])


def by_modes(scene: jr.Scene, voigt: float) -> np.ndarray:
    """`x.. + T w^2 x. + w^2 x = 0` of every mode of the undamped shaft, which Voigt's keeps apart."""
    q, v, row = begun(scene)
    blocks = assembled(scene)[1]
    square, shapes = np.linalg.eig(np.linalg.solve(blocks.inertia, blocks.stiffness))
    x, rate = np.linalg.solve(shapes, q), np.linalg.solve(shapes, v)
    half = voigt * square / 2
    fast = -half - np.sqrt(half**2 - square + 0j)
    slow = square / fast
    a = (rate - slow * x) / (fast - slow)
    t = PERIOD * np.arange(2 * STEPS + 1)[:, None] / STEPS
    return (a * np.exp(fast * t) + (x - a) * np.exp(slow * t)) @ (row @ shapes)


def off(found: np.ndarray, want: np.ndarray) -> float:
    """Over the start."""
    return float(abs(found - want).max() / 1e-3)


@pytest.mark.slow
@pytest.mark.hard("1.5 defective modal basis: both sides of the switch to the dense one")
def test_both_sides_of_the_switch(record_property):
    """At `T = 2 / w` a pair of roots merges: the eigenvectors' condition grows as `|T - 2 / w|^-1/2`."""
    first = np.abs(np.asarray(jr.roots(quiet(0.0)))).min()
    near = [2 / first * (1 + d) for d in np.geomspace(1e-2, 1e-15, 53)]
    conditions = np.array([condition_at(quiet(t)) for t in near])
    before = conditions < WORST_CONDITION
    assert before.any() and not before.all(), "the double root is met"
    last = near[np.flatnonzero(before)[conditions[before].argmax()]]
    beyond = near[np.flatnonzero(~before)[conditions[~before].argmin()]]
    worst = near[conditions.argmax()]
    found = [(simulated(quiet(t)), by_exponential(quiet(t))) for t in (last, beyond, worst)]
    assert [basis for (_, basis), _ in found] == ["modal", "dense", "dense"]
    figures = [off(z, want) for (z, _), want in found]
    text = "modal {:.0e}, dense {:.0e} and {:.0e}".format(*figures)
    record_property("measured", f"path {text} (conditions up to {conditions.max():.0e})")
    assert max(figures) < 1e-10


@pytest.mark.slow
@pytest.mark.hard("1.5 internal damping 0 and far over-damped")
def test_internal_damping_from_none_to_far_over_damped(record_property):
    """Rounding of the matrix bounds its slow roots: the bound of 1e-10 holds up to eta = 1e3."""
    figures = {}
    for eta in (0.0, 1.0, 10.0, 1e2, 1e3, 1e4, 1e6):
        scene = quiet(2 * eta * TIME)
        z, _ = simulated(scene)
        figures[eta] = off(z, by_modes(scene, 2 * eta * TIME))
        rounding = np.finfo(float).eps * np.linalg.norm(matrix(scene), 1)
        assert figures[eta] < max(1e-10, 0.1 * rounding)
    text = ", ".join(f"{e:.0e} at eta {eta:g}" for eta, e in figures.items())
    record_property("measured", f"path {text}")
    assert max(e for eta, e in figures.items() if eta <= 1e3) < 1e-10


@pytest.mark.hard("1.5 over-damped: the shaft creeps back")
def test_an_over_damped_shaft_creeps(record_property):
    """Its slow roots are `-1 / T`, whatever the inertia, as `T` grows."""
    voigt = 2e4 * TIME
    slow = np.asarray(jr.roots(quiet(voigt)))
    slow = slow[np.abs(slow.real + 1 / voigt) < 0.5 / voigt]
    assert slow.size >= 1
    error = abs(slow * voigt + 1).max()
    record_property("measured", f"roots {error:.0e}")
    assert error < 1e-6


@pytest.mark.slow
@pytest.mark.hard("1.5 without any damping amplitudes last")
def test_no_damping_at_all(record_property):
    """Roots are imaginary, and after 3000 whirls the tip reaches no farther than it did."""
    scene = quiet(0.0)
    roots = np.asarray(jr.roots(scene))
    growth = abs(roots.real).max() / abs(roots).max()
    r = jr.simulate(scene, 20_000, 4, start=jr.Whirl(1e-3), period=PERIOD, keep=1)
    reach = abs(np.asarray(r.displacement[:, 0])).max()
    record_property("measured", f"growth of roots {growth:.0e} of the largest")
    assert growth < 1e-10
    assert reach < 1.2e-3
