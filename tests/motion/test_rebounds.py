"""Steps of a rebound: what is told of few of them, against SciPy and `pi sqrt(m / k)`."""

import re

import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor.cli import app


MASS, SHAFT, DAMPING, ECCENTRICITY, SPEED, GAP, HARD = 1.0, 4e3, 2.0, 1e-3, 60.0, 1e-3, 1e7
REVOLUTION = 2 * np.pi / SPEED


def jeffcott(*stops):
    """A disc on a massless shaft between stops."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, SHAFT),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, DAMPING),
        jr.Unbalance(0.5, MASS, ECCENTRICITY),
        *stops,
        spin=jr.ConstantSpeed(SPEED),
    )


def stop(stiffness=HARD, gap=GAP, angle=0.0):
    return jr.Limiter(at=0.5, angle=angle, gap=gap, stiffness=stiffness)


def by_scipy(times, stiffness=HARD):
    """Displacement between the stop and nothing."""

    def rates(t, y):
        z, v = y
        pull = SHAFT * z + DAMPING * v + stiffness * max(0.0, z.real - GAP)
        return [v, ECCENTRICITY * SPEED**2 * np.exp(1j * SPEED * t) - pull / MASS]

    how = {"rtol": 1e-10, "atol": 1e-14, "max_step": np.sqrt(MASS / stiffness), "t_eval": times}
    return solve_ivp(rates, (0, times[-1]), [0j, 0j], method="DOP853", **how).y[0]


def rebound(stiffness, steps):
    """Steps of a rebound by a mass alone."""
    return np.pi * np.sqrt(MASS / stiffness) / (REVOLUTION / steps)


def off(run, want):
    return np.abs(np.asarray(run.displacement)[:, 0] - want).max() / np.abs(want).max()


@pytest.mark.slow
def test_few_steps_of_a_rebound_are_told_with_the_steps_that_cure_it():
    """The default steps are off by percents; those that the sentence names are not."""
    scene = jeffcott(stop())
    with pytest.warns(jr.FewStepsWarning, match="^`limiter` was touched with 2.4 steps a") as told:
        run = jr.simulate(scene, 20)
    assert told[0].filename == __file__
    want = by_scipy(np.asarray(run.time))
    assert off(run, want) > 0.02
    count = rebound(HARD, 256)
    assert count == pytest.approx(2.4, abs=0.05)
    plain, located = map(int, re.findall(r"at least (\d+) `steps", str(told[0].message)))
    assert plain == pytest.approx(256 * 12 / count, rel=0.01)
    assert located == pytest.approx(256 * 4 / count, rel=0.01)
    run = jr.simulate(scene, 20, 512, solver=jr.Exponential(4, located=True))
    assert off(run, by_scipy(np.asarray(run.time))) < 0.01
    run = jr.simulate(scene, 5, 1280)
    assert off(run, by_scipy(np.asarray(run.time))) < 0.02


def test_only_stops_that_are_touched_matter():
    """A hard stop out of reach changes nothing; within reach of a soft one, it is the one named."""
    soft, away = stop(1e5), stop(1e9, gap=1.0, angle=np.pi)
    run = jr.simulate(jeffcott(soft, away), 5)
    assert not np.any(np.asarray(run.contact_force)[:, 1])
    assert off(run, by_scipy(np.asarray(run.time), 1e5)) < 1e-3
    behind = stop(HARD, gap=1.01 * GAP)
    with pytest.warns(jr.FewStepsWarning, match="^`limiters.1` was touched with 2.4 steps"):
        jr.simulate(jeffcott(soft, behind), 5)


def test_a_command_notes_few_steps_in_its_own_options(tmp_path):
    jr.save(jeffcott(stop()), tmp_path / "stop.toml")
    done = CliRunner().invoke(app, ["simulate", str(tmp_path / "stop.toml"), "--revolutions", "5"])
    assert done.exit_code == 0
    assert "Note: `limiter` was touched with 2.4 steps a rebound" in done.stderr
    assert re.search(r"take at least 12\d\d --steps instead of 256", done.stderr)
    assert "--solver exponential4-located, with at least 42" in done.stderr


def test_a_run_along_times_tells_how_many_times_as_many_steps():
    times = np.linspace(0.0, 0.5, 1001)
    with pytest.warns(jr.FewStepsWarning, match="^`limiter` was touched with 2 steps") as told:
        jr.run_up(jeffcott(stop()), times, solver=jr.Exponential(2), substeps=1)
    more = float(re.findall(r"take ([\d.]+) times as many `substeps`", str(told[0].message))[0])
    assert more == pytest.approx(12 * 0.5e-3 / (np.pi * np.sqrt(MASS / HARD)), rel=0.02)


@pytest.mark.slow
def test_automatic_steps_and_traced_calls_warn_of_nothing():
    """A pilot has measured the error; a trace knows no values."""
    scene = jeffcott(stop())
    run = jr.simulate(scene, 5, "auto", tolerance=0.05)
    assert run.steps_per_revolution < 256 * 12 / rebound(HARD, 256)
    radius = lambda k: abs(jr.simulate(scene.put({"limiter.stiffness": k}), 2).displacement[-1, 0])
    value, slope = jax.jvp(radius, (1e7,), (1e3,))
    several = jax.jit(jax.vmap(radius))(np.array([1e7, 1.001e7]))
    assert np.isfinite(slope) and several[0] == pytest.approx(float(value), rel=1e-6)


@pytest.mark.slow
def test_exponents_and_orbits_tell_of_few_steps():
    """Located steps of order 4 need four of them."""
    scene, steps = jeffcott(stop(1e6)), 116  # 3.5 of a rebound
    with pytest.warns(jr.FewStepsWarning, match="`limiter` was touched with 3.5 steps a rebound"):
        jr.lyapunov(scene, revolutions=20, settle=10, steps_per_revolution=steps)


@pytest.mark.slow
def test_a_sweep_tells_of_lanes_with_few_steps_and_of_their_errors():
    """The error of the lane with few steps, run again, is that against SciPy within a factor of two."""
    stiffness, steps, settle = np.array([1.0, 1e5, 3e5]), 128, 60
    with pytest.warns(jr.FewStepsWarning, match="In 1 of 3 lanes .* `limiter` was touched with 7"):
        found = jr.sweep(
            jeffcott(stop()),
            {"limiter.stiffness": stiffness},
            observe=[jr.observe.Radius(), jr.observe.Contact()],
            settle=settle,
            keep=1,
            steps_per_revolution=steps,
            progress=False,
            workers=1,  # threads of several may leave each other's filters of warnings behind
        )
    np.testing.assert_allclose(
        found["rebound_steps"].values[:, 0], rebound(stiffness, steps), rtol=0.02
    )
    assert found["error_lane"].values.tolist() == [0, 1, 2]
    assert not found["diverges"].any()
    grid = (settle + np.arange(1, steps + 1) / steps) * REVOLUTION
    want = np.abs(by_scipy(grid, stiffness[-1])).max()
    true = abs(found["radius_max"].values[-1] - want)
    told = found["radius_max_error"].values
    assert true / 2 < told[-1] < 2 * true
    assert found["radius_max"].attrs["error"] == pytest.approx(told.max())
