"""Sweeps along times: every lane is a run of `run_up`, whatever its speed."""

import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor.motion.windows import window_of


TIMES = np.linspace(0.0, 0.32, 65)
OVER = {"unbalance.eccentricity": [1e-4, 4e-4], "limiters.stiffness": [1e5, 2e5]}


def scene(spin=None):
    rotor = jr.load("limiter-rotor").with_nodes(2)
    spin = jr.SpeedProfile([0.0, 0.32], [60.0, 200.0]) if spin is None else spin
    small = {"limiters.gap": 1e-3, "limiters.stiffness": 1e5, "unbalance.eccentricity": 3e-4}
    return jr.Scene(rotor.shaft, *rotor.effects, spin=spin).replace(small)


@pytest.fixture(scope="module")
def runs():
    return jr.sweep(scene(), OVER, times=TIMES, steps_per_revolution=128, error_sample=0)


def lane(dataset, one, **solver):
    substeps = dataset.attrs["steps_per_sample"]
    return jr.run_up(one, TIMES, solver=jr.Exponential(**solver), substeps=substeps)


def test_lanes_are_runs(runs):
    values = {"unbalance.eccentricity": 4e-4, "limiters.stiffness": 2e5}
    run, found = lane(runs, scene().replace(values)), runs.sel(values)
    radius, force = np.abs(run.displacement[:, 0]), np.abs(run.contact_force)
    top = 1 + radius[1:].argmax()
    assert force.max() > 0
    assert float(found.peak) == pytest.approx(radius[top], rel=1e-9)
    assert float(found.peak_time) == pytest.approx(TIMES[top])
    assert float(found.peak_speed) == pytest.approx(float(run.speed[top]))
    np.testing.assert_allclose(found.peak_force, force.max(axis=0), rtol=1e-7)
    size = runs.attrs["samples_per_window"]
    windows = [radius[i + 1 : i + size + 1].max() for i in range(0, 64, size)]
    np.testing.assert_allclose(found.envelope, windows, rtol=1e-9)
    np.testing.assert_allclose(found.speed, run.speed[size::size])
    np.testing.assert_allclose(runs.window, TIMES[size::size])


@pytest.mark.slow
def test_what_is_before_the_first_time_is_not_observed(runs):
    """The second half alone; paths that vary together are one axis."""
    together = {path: [values[0], values[1]] for path, values in OVER.items()}
    how = {"steps_per_revolution": 128, "error_sample": 0, "progress": False}
    late = jr.sweep(scene(), {"machine": together}, times=TIMES[32:], **how)
    assert late.peak.dims == ("machine",) and late.attrs["first_sample"] == pytest.approx(0.16)
    np.testing.assert_array_equal(late["limiters.stiffness"], OVER["limiters.stiffness"])
    half = runs.envelope[:, :, runs.window > 0.17].max("window").values.diagonal()
    np.testing.assert_allclose(late.envelope.max("window"), half, rtol=1e-9)
    np.testing.assert_allclose(late.window, runs.window[runs.window > 0.17])
    np.testing.assert_allclose(late.speed[0], runs.speed[0, 0, runs.window > 0.17])


@pytest.mark.slow
def test_lanes_by_located_steps_are_runs():
    solver = {"order": 4, "located": True}
    how = {"steps_per_revolution": 48, "solver": jr.Exponential(**solver), "error_sample": 0}
    runs = jr.sweep(scene(), OVER, times=TIMES, **how)
    assert (runs.unresolved == 0).all()
    values = {"unbalance.eccentricity": 4e-4, "limiters.stiffness": 2e5}
    run = lane(runs, scene().replace(values), **solver)
    radius = np.abs(run.displacement[:, 0])
    assert float(runs.sel(values).peak) == pytest.approx(radius[1:].max(), rel=1e-9)


@pytest.mark.parametrize(
    ("over", "words"),
    [
        (
            {"a": {"limiters.gap": [1e-3], "limiters.stiffness": [1e5, 2e5]}},
            "as many values of every",
        ),
        ({"a": {"limiters.at": [0.7], "limiters.gap": [1e-3]}}, "`limiters.at` decides stations"),
    ],
)
def test_paths_that_cannot_vary_together(over, words):
    with pytest.raises(ValueError, match=words):
        jr.sweep(scene(), over, times=TIMES)
    carried = {"a": {"limiters.gap": [1e-3, 2e-3]}}
    with pytest.raises(ValueError, match="`carry` must be a single path"):
        jr.sweep(scene().at_speed(100.0), carried, carry="a")


@pytest.mark.slow
def test_a_lane_begins_where_its_start_says():
    """A later time of the profile; 33 intervals before the first sample, which no window divides."""
    profile = jr.SpeedProfile([0.0, 1.0], [60.0, 200.0])
    start, times = jr.Launch(jr.Whirl(1e-5), time=0.4), np.linspace(0.0, 0.485, 98)
    over = {"unbalance.eccentricity": [3e-4]}
    settings = {"start": start, "steps_per_revolution": 128, "error_sample": 0}
    late = jr.sweep(scene(profile), over, times=times[33:], **settings)
    substeps = late.attrs["steps_per_sample"]
    run = jr.run_up(scene(profile), times, start=start, solver=jr.Exponential(2), substeps=substeps)
    assert late.attrs["solver"].startswith("Exponential") and late.attrs["samples_per_window"] == 32
    np.testing.assert_allclose(late.speed[0], run.speed[np.array([65, 97])])
    radius = np.abs(run.displacement[34:, 0]).max()
    assert float(late.peak[0]) == pytest.approx(radius, rel=1e-9)


def test_settings_are_told(runs):
    assert runs.attrs["duration"] == TIMES[-1] and runs.attrs["samples"] == TIMES.size
    assert "settle" not in runs.attrs
    assert (runs.status == 0).all()


@pytest.mark.slow
def test_errors_are_told(runs):
    again = jr.sweep(scene(), OVER, times=TIMES, steps_per_revolution=128, error_sample=2)
    assert 0 < again.peak.attrs["error"] < 1e-3 * float(runs.peak.max())
    assert again.peak.equals(runs.peak)


@pytest.mark.slow
def test_lanes_whose_speeds_differ(tmp_path):
    """Run-ups by several torques, in blocks of two through a store.

    They share one speed of decomposition, `run_up` takes the middle of its own: the error of both counts.
    """
    spin = jr.Drive(60.0, 5.0, drag=1e-5)
    torques = [2.0, 4.0, 6.0]
    found = jr.sweep(
        scene(spin),
        {"spin.torque": torques},
        times=TIMES,
        steps_per_revolution=512,
        error_sample=0,
        lanes_per_chunk=2,
        store=tmp_path / "runs.zarr",
    )
    for torque in torques:
        run = lane(found, scene(spin).replace({"spin.torque": torque}))
        radius = np.abs(run.displacement[:, 0])
        own = found.sel({"spin.torque": torque})
        assert float(own.peak) == pytest.approx(radius.max(), rel=1e-6)
        assert float(own.speed[-1]) == pytest.approx(float(run.speed[-1]))
    assert float(found.speed[-1, -1]) > float(found.speed[0, -1]) + 10


@pytest.mark.slow
def test_unequal_bearings_and_no_contact():
    """By default of order 4, decomposed at one speed where `run_up` takes sixteen."""
    rotor = jr.load("overhung-fan").without("limiters")
    rotor = jr.Scene(rotor.shaft, *rotor.effects, spin=jr.SpeedProfile([0.0, 0.64], [20.0, 80.0]))
    times = np.linspace(0, 0.64, 129)
    first = float(rotor.get("unbalance.eccentricity"))
    over = {"unbalance.eccentricity": [first, 2 * first]}
    found = jr.sweep(rotor, over, times=times, steps_per_revolution=32)
    assert found.attrs["solver"].startswith("Exponential(order=4")
    run = jr.run_up(rotor, times)
    peaks = np.abs(run.displacement[:, 0]).max() * np.array([1.0, 2.0])
    np.testing.assert_allclose(found.peak, peaks, rtol=1e-5)


@pytest.mark.slow
def test_constant_speeds_that_differ_between_lanes():
    speeds = [60.0, 180.0]
    still = scene().at_speed(100.0)
    how = {"steps_per_revolution": 512, "error_sample": 0}
    found = jr.sweep(still, {"spin.speed": speeds}, times=TIMES, **how)
    for speed in speeds:
        run = jr.run_up(still.at_speed(speed), TIMES, solver=jr.Exponential(), substeps=64)
        peak = np.abs(run.displacement[1:, 0]).max()
        assert float(found.peak.sel({"spin.speed": speed})) == pytest.approx(peak, rel=1e-5)


@pytest.mark.slow
def test_a_lane_that_fails_has_no_peak():
    free = scene().without("limiters")
    growing = {"disc_damping.translational": [0.5, -1e5]}
    base = free.put({"disc_damping.translational": 0.5})
    values = np.array(growing["disc_damping.translational"])
    assert values.min() < 0  # refused by the scene, so the start fails instead
    with pytest.raises(ValueError, match="translational"):
        jr.sweep(base, growing, times=TIMES)
    start = jr.Whirl(1e-4, 0.0)
    found = jr.sweep(base, {"start.rate": [0.0, 1e200]}, start=start, times=TIMES)
    assert found.status.values.tolist()[0] == 0 and found.status.values[1] != 0
    assert not 0 <= float(found.peak[1]) < 1e6


@pytest.mark.parametrize(("samples", "size"), [(65, 32), (2001, 40), (2, 1), (102, 101), (38, 37)])
def test_windows_divide_the_samples(samples, size):
    assert window_of(samples) == size


def test_samples_without_windows_are_refused():
    with pytest.raises(ValueError, match="2000 samples cannot be cut .* take 1985"):
        window_of(2000)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"settle": 3}, "`settle` is for whole revolutions"),
        ({"keep": 3}, "`keep` is for whole revolutions"),
        ({"carry": "limiters.stiffness"}, "`carry` is for whole revolutions"),
        ({"period": 1.0}, "`period` is for whole revolutions"),
        ({"times": [0.0, 0.1, 0.3]}, "evenly spaced times from 0 on"),
        ({"times": [0.05, 0.15, 0.25]}, "must be a whole number of intervals, of 0.1 s"),
        ({"observe": [jr.observe.Section()]}, "`Section` is an observable of motions of whole"),
        ({"steps_per_revolution": "auto"}, "give `steps_per_revolution`"),
        ({"solver": jr.Exponential(shapes=2)}, "A few shapes are for whole revolutions"),
        ({"solver": jr.Exponential(fused=True)}, "`fused=True` is for sweeps by whole revolutions"),
    ],
)
def test_settings_that_runs_do_not_take(settings, words):
    with pytest.raises(ValueError, match=words):
        jr.sweep(scene(), OVER, **{"times": TIMES} | settings)


def test_what_whole_revolutions_do_not_take():
    with pytest.raises(ValueError, match="`sweep` without `times` is for constant speed"):
        jr.sweep(scene(), OVER)
    with pytest.raises(ValueError, match="`Peak` is an observable of motions along `times`"):
        jr.sweep(scene().at_speed(100.0), OVER, observe=[jr.observe.Peak()])
    stopping = scene(jr.Drive(10.0, 1.0, stops=True))
    with pytest.raises(ValueError, match="the rotor may come to rest under its Drive"):
        jr.sweep(stopping, OVER, times=TIMES, solver=jr.Exponential(2))
