"""Accuracy: errors from the sheets, flagged failures, steps and nodes by a pilot, errors of a sweep."""

import math

import diffrax as dfx
import jax
import matplotlib
import numpy as np
import pytest
import xarray as xr
from systems import LENGTH, TIME

import jaxrotor as jr
from jaxrotor import measures, methods, plot
from jaxrotor.core.pilot import refined
from jaxrotor.plot.accuracy import slope


matplotlib.use("agg")

SCENE = jr.load("limiter-rotor")
SPEED = 15 / TIME
# spec/1, section 3.3: N_crit at eta_i = 0.005 by 5 trapezoidal cells; exact
CELLS, EXACT = 13.925237, 13.90412512
RUB = jr.Whirl(0.012 * LENGTH, rate=-10 / TIME)


# === linear


@pytest.mark.slow
def test_onset_speed_has_the_errors_of_the_sheet():
    found = jr.accuracy(
        SCENE,
        measures.OnsetSpeed(),
        methods.by_nodes((6,), (5,)),
        reference=methods.Setting(nodes=6, rule="spectral"),
        repeats=1,
    )
    assert found.attrs["reference"] * TIME == pytest.approx(EXACT, abs=1e-8)
    by_nodes, by_cells = found["error"].values * TIME
    assert by_nodes < 1e-8
    assert by_cells == pytest.approx(CELLS - EXACT, abs=6e-7)  # six digits are printed
    assert found.attrs["reference_uncertainty"] * TIME < 1e-8  # refined by two nodes
    assert found["value"].attrs["units"] == "rad/s" and (found["status"] == 0).all()
    assert (found["run_time"] > 0).all() and (found["memory"] > 0).any()
    assert jr.loads(found.attrs["scene"]).paths() == SCENE.paths()


@pytest.mark.slow
def test_a_setting_that_fails_is_flagged_and_the_study_goes_on():
    odd = methods.Method("odd", (methods.Setting(nodes=99), methods.Setting(nodes=5)), "nodes")
    single = methods.in_float32(methods.by_nodes((5,), ()))
    found = jr.accuracy(SCENE.at_speed(SPEED), measures.Root(1), [odd, *single], repeats=1, lanes=1)
    assert found["status"].values.tolist() == [1, 0, 0]
    assert "must be 2 to 24" in found["reason"].values[0] and np.isnan(found["error"].values[0])
    # sheet 3.2: the second root at N = 15
    value = complex(found.attrs["reference"], found.attrs["reference_imag"]) * TIME
    assert value == pytest.approx(0.00912266 + 1.74308955j, abs=2e-8)
    double, float32 = found["value_imag"].values[1:]
    assert 0 < abs(double - float32) < 1e-4 * abs(double)  # computed in single precision
    assert abs(double * TIME - 1.74308955) < 1e-3
    ax = plot.convergence(found)
    assert len(ax.lines) >= 2
    matplotlib.pyplot.close(ax.figure)


def test_what_a_study_cannot_take_is_one_sentence():
    with pytest.raises(ValueError, match="`measure` must be one of"):
        jr.accuracy(SCENE, "whirl rate")
    with pytest.raises(ValueError, match="a LongRun takes many"):
        jr.accuracy(SCENE, measures.OnsetSpeed(), lanes=2)
    with pytest.raises(ValueError, match="at least one method"):
        jr.accuracy(SCENE, measures.OnsetSpeed(), [])
    with pytest.raises(ValueError, match="has no nodes"):
        jr.load("turbine-run-up").with_nodes(8)


# === motion


@pytest.mark.slow
def test_free_flight_is_exact_at_any_step_and_implicit_euler_is_of_first_order():
    """`x.. = -k/m x` of a massless shaft: `x = r cos(w t)`, in closed form."""
    k, mass, radius = 4e4, 10.0, 1e-3
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, k),
        jr.Disc(at=0.5, mass=mass),
        spin=jr.ConstantSpeed(50.0),
    )
    turn = math.sqrt(k / mass) * 2 * math.pi / 50.0
    run = measures.LongRun("section", jr.Whirl(radius), settle=1, keep=1)
    euler = methods.by_steps((dfx.ImplicitEuler(),), (512, 1024))
    chosen = (*methods.by_steps((jr.Exponential(),), (16,)), *euler)
    found = jr.accuracy(scene, run, chosen, reference=chosen[0].settings[0], repeats=1)
    assert found.attrs["reference"] == pytest.approx(radius * math.cos(2 * turn), abs=1e-15)
    error = found["error"].values
    assert error[0] < 1e-15 and 1.8 < error[1] / error[2] < 2.2
    decayed = radius / (1 - 1j * turn / 1024) ** 2048  # (1 - i w h)^-n
    assert found["value"].values[2] == pytest.approx(decayed.real, rel=1e-6)


@pytest.fixture(scope="module")
def rub():
    """State in the periodic backward rub."""
    return jr.simulate(SCENE, 150, 256, start=RUB, keep=1).end


@pytest.mark.long
def test_whirl_rate_of_the_backward_rub(rub):
    run = measures.LongRun("whirl_rate", rub, settle=0, keep=40)
    ours = methods.by_steps((jr.Exponential(2),), (256,))
    coarse = methods.by_steps((dfx.Tsit5(),), (16,))  # far beyond its limit of stability
    found = jr.accuracy(
        SCENE,
        run,
        (*ours, *methods.in_float32(ours), *coarse),
        reference=methods.Setting(jr.Exponential(2), 128),
        lanes=2,
        repeats=1,
    )
    # sheet 3.4: -0.567622; the nodes cost 3.6e-5, steps less than 5e-5 at 256
    double, single, _ = found["value"].values
    assert double == pytest.approx(-0.567622, abs=9e-5)
    assert 1e-6 < abs(single - double) < 5e-3
    assert found["status"].values.tolist() == [0, 0, 1]
    assert "not finite" in found["reason"].values[2]
    assert found["precision"].values.tolist() == ["float64", "float32", "float64"]
    rate = 2 / found["run_time"].values
    np.testing.assert_allclose(found["lane_rate"].values, rate)
    ax = plot.work_precision(found)
    assert "1 of 3" in " ".join(text.get_text() for text in ax.texts)
    matplotlib.pyplot.close(ax.figure)


@pytest.mark.slow
def test_reaction_and_final_speed_of_the_turbine():
    """The spin follows a Riccati equation, whose closed solution is an oracle for every integrator."""
    scene, times = jr.load("turbine-run-up"), np.linspace(0.0, 0.48, 25)
    spin, polar = scene.spin, 2.2354  # sheet 4: I_z
    a, b, c = (float(v) for v in (spin.torque, spin.slope, spin.drag))
    root = math.sqrt(b * b + 4 * a * c)
    high, low = (-b + root) / (2 * c), (-b - root) / (2 * c)
    share = (600 - high) / (600 - low) * math.exp(-root * 0.48 / polar)
    speed = (high - low * share) / (1 - share)
    chosen = methods.by_tolerance((dfx.Tsit5(),), (1e-4, 1e-8))
    found = jr.accuracy(scene, measures.FinalState(times, "speed"), chosen, repeats=1)
    assert found.attrs["reference"] == pytest.approx(speed, rel=1e-5)  # I_z to five digits
    loose, tight = found["error"].values
    assert tight < 1e-5 and tight <= loose < 1e-2
    bearing = measures.Reaction(times, "constraints.0")
    assert bearing.value(scene, chosen[0].settings[-1]) == pytest.approx(12767, abs=1)


# === plots


def test_order_is_fitted_above_the_uncertainty_alone():
    x = np.array([10.0, 20, 40, 80])
    error = np.maximum(3.0 * x**-2, 1e-3)
    assert slope(x, error, 1e-3) == pytest.approx(-2, abs=1e-9)
    assert slope(x, error, 1.0) is None


# === chosen by a pilot


def test_refinement_stops_where_two_answers_agree():
    tried = []

    def answer(n):
        tried.append(n)
        return None if n == 1 else np.array([1.0, 1 + 1 / n])

    pilot = refined("steps", answer, (1, 2, 4, 8, 16, 32), 0.06)
    assert tried == [1, 2, 4, 8, 16] and pilot.setting == 16 and pilot.converged
    assert pilot.difference == pytest.approx((1 / 8 - 1 / 16) / (1 + 1 / 16))
    lost = refined("steps", lambda n: np.array([(-1.0) ** math.log2(n)]), (1, 2, 4), 0.1)
    assert not lost.converged and lost.setting == 4 and "not converged" in str(lost)
    with pytest.raises(ValueError, match="`tolerance` must be positive"):
        refined("steps", answer, (1, 2), 0.0)


@pytest.mark.slow
def test_auto_steps_reach_their_tolerance(rub):
    """They are compared with many steps of the other order, from the same state."""
    run = {"start": rub, "keep": 5}
    found = jr.simulate(SCENE, 5, "auto", tolerance=1e-2, **run)
    (pilot,) = found.pilots
    assert pilot.converged and pilot.setting == found.steps_per_revolution
    fine = jr.simulate(SCENE, 5, 2048, solver=jr.Exponential(4), **run)
    share = 2048 // pilot.setting
    off = np.abs(np.asarray(found.displacement) - np.asarray(fine.displacement)[::share])
    # The steps converge to first order, so the error that remains may be as large as the tolerance.
    assert off.max() < 2 * 1e-2 * np.abs(fine.displacement).max()
    assert str(pilot.setting) in jr.dataset(found).attrs["chosen"]


def test_auto_steps_are_refused_where_they_mean_nothing():
    with pytest.raises(ValueError, match="Kvaerno5 chooses its own"):
        jr.simulate(SCENE, 5, "auto", solver=dfx.Kvaerno5())
    with pytest.raises(ValueError, match="not inside jax.jit"):
        jax.jit(lambda scene: jr.simulate(scene, 5, "auto").displacement)(SCENE)


@pytest.mark.slow
def test_auto_nodes():
    scene = SCENE.without("limiters").with_nodes(4)
    found = jr.simulate(scene, 1, 8, nodes="auto", tolerance=1e-2, start=jr.Whirl(1e-3))
    (pilot,) = found.pilots
    assert pilot.what == "nodes" and pilot.converged and pilot.setting > 4
    assert found.scene.shaft.nodes == pilot.setting
    slow = np.asarray(jr.roots(found.scene, 6))  # by the nodes of the pilot; sheet 3.2, N = 15
    off = np.abs(slow[:2] * TIME - np.array([-0.23335496 - 1.45302933j, 0.00912266 + 1.74308955j]))
    assert off.max() < 1e-2 * np.abs(slow).max() * TIME


# === sweeps


@pytest.mark.slow
def test_sweep_carries_an_error_estimate(rub):
    """The error is the difference from twice the steps in all coordinates of the rotor."""
    over = {"unbalance.eccentricity": [0.0, 2e-6, 4e-6]}
    run = {"start": rub, "settle": 0, "keep": 10, "progress": False}
    found = jr.sweep(SCENE, over, steps_per_revolution=64, error_sample=2, **run)
    assert found["error_lane"].values.tolist() == [0, 2]
    twice = {"steps_per_revolution": 128, "error_sample": 0}
    finer = jr.sweep(SCENE, over, solver=jr.Exponential(), **twice, **run)
    for name in ("index", "radius_max"):
        off = np.abs(finer[name].values - found[name].values)[[0, 2]]
        np.testing.assert_allclose(found[f"{name}_error"].values, off, rtol=1e-6)
        assert found[name].attrs["error"] == pytest.approx(off.max(), rel=1e-6)
    assert found["peak_force_error"].dims == ("error_lane", "limiter")
    assert "section_error" not in found
    upper, lower = plot.bifurcation(found)
    assert any("twice the steps" in text.get_text() for text in lower.texts)
    matplotlib.pyplot.close(upper.figure)
    assert isinstance(found, xr.Dataset) and "index_error" not in finer
