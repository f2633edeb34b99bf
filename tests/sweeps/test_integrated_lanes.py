"""Lanes that exponential steps do not take: every one is a motion of `run_up` or `simulate`."""

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr


TIMES = np.linspace(0.0, 2.0, 129)
TORQUES = [
    2.0,
    12.0,
]  # of a drive that is captured at the critical speed, and of one that passes it
CRITICAL = 200.0
QUIET = {"progress": False}


def jeffcott(*effects, spin):
    """Disc of two coordinates on a massless shaft, critical speed 200 rad/s."""
    disc = jr.Disc(0.5, 2.0, 0.0, 0.01, offset=2e-3, exact=False)
    shaft = jr.MasslessShaft(1.0, 0.5, 8e4)
    return jr.Scene(shaft, disc, jr.DiscDamping(0.5, 12.0), *effects, spin=spin)


DRIVEN = jeffcott(spin=jr.Drive(150.0, 2.0, 0.004, polar=0.018, feedback=True))
BALLS = jeffcott(
    jr.BallBalancer(0.5, 0.04, 0.05, 2.0, places=2), spin=jr.ConstantSpeed(300.0)
).replace({"disc.offset": 5e-4})


@pytest.fixture(scope="module")
def captured():
    observe = [jr.observe.Capture(CRITICAL), *jr.observe.everything(along_times=True)]
    over = {"spin.torque": TORQUES}
    return jr.sweep(DRIVEN, over, times=TIMES, observe=observe, error_sample=2, **QUIET)


@pytest.mark.slow
def test_a_drive_is_caught_in_a_lane(captured):
    """Feedback of unbalance: each lane is the run of its torque; 2 N m hang below the critical speed."""
    assert captured.captured.values.tolist() == [1.0, 0.0]
    for torque in TORQUES:
        run = jr.run_up(DRIVEN.replace({"spin.torque": torque}), TIMES)
        lane, radius = captured.sel({"spin.torque": torque}), np.abs(run.displacement[:, 0])
        assert float(lane.end_speed) == pytest.approx(float(run.speed[-1]), rel=1e-6)
        assert float(lane.peak) == pytest.approx(radius.max(), rel=1e-5)
        assert float(lane.peak_time) == TIMES[radius.argmax()]
    assert 0 < captured.peak.attrs["error"] < 1e-4 * float(captured.peak.max())
    assert "steps_per_sample" not in captured.attrs and captured.attrs["duration"] == TIMES[-1]


@pytest.mark.slow
def test_a_drive_with_friction_stops_in_a_lane():
    """Coulomb friction brings it to rest within a window, and it stays through the later ones."""
    scene = jeffcott(spin=jr.Drive(40.0, 0.0, polar=0.018, coulomb=1.0, feedback=True))
    over = {"spin.coulomb": [0.5, 1.0]}
    observe = [jr.observe.Envelope()]
    found = jr.sweep(scene, over, times=TIMES, observe=observe, **QUIET)
    run = jr.run_up(scene, TIMES)
    assert float(run.speed[-1]) == 0 and np.isfinite(float(run.stopped))
    size = found.attrs["samples_per_window"]
    np.testing.assert_allclose(found.speed[1], run.speed[size::size], atol=1e-6)
    assert float(found.speed[1, -1]) == 0


def placed(first):
    return jr.Launch(balls=(jr.Balls(jnp.array([first, 1.0]), jnp.zeros(2)),))


@pytest.mark.long
def test_balls_begin_where_a_path_says(tmp_path):
    """Windows along times; the folder of a sweep is read again."""
    over = {"start.balls.0.angle.0": [0.5, 2.0], "spin.speed": [300.0]}
    times = np.linspace(0.0, 0.4, 65)
    settings = {"start": placed(0.0), "times": times, "store": tmp_path / "s.zarr", **QUIET}
    found = jr.sweep(BALLS, over, **settings)
    run = jr.run_up(BALLS, times, start=placed(2.0))
    lane = found.sel({"start.balls.0.angle.0": 2.0}).isel({"spin.speed": 0})
    assert found["start.balls.0.angle.0"].attrs["units"] == "rad"
    size = np.abs(run.imbalance)
    assert float(lane.imbalance_end) == pytest.approx(size[-1], rel=1e-5)
    assert float(lane.imbalance) == pytest.approx(np.sqrt(np.mean(size[1:] ** 2)), rel=1e-4)
    lag = (run.balls[0].angle[-1] - run.balls[0].angle[0]) / times[-1]
    np.testing.assert_allclose(lane.ball_lag, lag, rtol=1e-5)
    assert found.equals(jr.sweep(BALLS, over, **settings))
    both = {"lane": {"start.balls.0.angle.0": [2.0], "start.balls.0.rate": [-1.0]}}
    late = jr.sweep(BALLS, both, start=placed(0.0), times=times[32:], store=tmp_path / "l", **QUIET)
    rates = jr.Launch(balls=(jr.Balls(jnp.array([2.0, 1.0]), jnp.full(2, -1.0)),))
    size = np.abs(jr.run_up(BALLS, times, start=rates).imbalance)
    assert float(late.imbalance[0]) == pytest.approx(np.sqrt(np.mean(size[33:] ** 2)), rel=1e-4)
    assert late["start.balls.0.rate"].dims == ("lane",)
    assert late.equals(
        jr.sweep(BALLS, both, start=placed(0.0), times=times[32:], store=tmp_path / "l", **QUIET)
    )
    with pytest.raises(ValueError, match=r"has no `balls.0.angle.7`; it has: .*balls.0.angle"):
        jr.sweep(BALLS, {"start.balls.0.angle.7": [1.0]}, times=times)
    with pytest.raises(ValueError, match="`Imbalance` observes balls, but the scene has none"):
        jr.sweep(DRIVEN, {"spin.torque": [1.0]}, times=times, observe=[jr.observe.Imbalance()])


@pytest.mark.long
def test_balls_are_carried_from_speed_to_speed():
    """By whole revolutions; at a new speed balls keep their absolute rates."""
    counts = {"settle": 10, "keep": 2, "steps_per_revolution": 32}
    over = {"spin.speed": [300.0, 310.0]}
    found = jr.sweep(BALLS, over, carry="spin.speed", start=placed(2.0), **counts, **QUIET)
    first = jr.simulate(BALLS, 12, 32, start=placed(2.0))
    (balls,) = first.end.balls
    shifted = jr.Balls(balls.angle, balls.rate - 10.0)
    start = jr.Launch(first.end.shaft, balls=(shifted,))
    turned = jr.Launch(angle=1.0, balls=placed(2.0).balls)
    ahead = jr.sweep(
        BALLS,
        {"spin.speed": [300.0, 300.0 + 1e-9]},
        carry="spin.speed",
        start=turned,
        **counts,
        **QUIET,
    )
    whole = jr.simulate(BALLS, 24, 32, start=turned, keep=2)
    radius = np.abs(whole.displacement[1:]).max()
    assert float(ahead.radius_max[0, 1]) == pytest.approx(radius, rel=1e-5)
    second = jr.simulate(BALLS.at_speed(310.0), 12, 32, start=start, keep=2)
    up = found.sel(branch="up")
    assert float(up.radius_max[1]) == pytest.approx(np.abs(second.displacement[1:]).max(), rel=1e-5)


@pytest.mark.long
def test_a_coordinate_without_mass_in_some_lanes():
    shaft = jr.MasslessShaft(1.0, 0.5, 8e4, k12=5e3, k22=4e3)
    disc = jr.Disc(0.5, 2.0, 0.0, 0.01, offset=2e-3, exact=False)
    scene = jr.Scene(shaft, disc, jr.DiscDamping(0.5, 12.0), spin=jr.ConstantSpeed(150.0))
    counts = {"settle": 0, "keep": 2, "steps_per_revolution": 32}
    found = jr.sweep(scene, {"disc.diametral": [0.0, 0.1]}, **counts, **QUIET)
    for k, diametral in enumerate((0.0, 0.1)):
        one = jr.simulate(scene.replace({"disc.diametral": diametral}), 2, 32)
        radius = np.abs(one.displacement[1:]).max()
        assert float(found.radius_max[k]) == pytest.approx(radius, rel=1e-5)


def test_lanes_that_fail_are_left_out():
    """A lane that needs more steps has no result, and is not integrated any further."""
    observe = [jr.observe.Capture(CRITICAL), jr.observe.Radius()]
    over = {"spin.torque": [2.0]}
    few = jr.sweep(DRIVEN, over, times=TIMES, max_steps=3, observe=observe, **QUIET)
    assert few.status.values.tolist() == [3] and np.isnan(few.captured.values).all()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: jr.sweep(DRIVEN, {"spin.torque": [1.0]}, times=TIMES, solver=dfx.Euler()),
            "no error",
        ),
        (
            lambda: jr.sweep(BALLS, {"spin.speed": [1.0]}, solver=jr.Exponential()),
            "leave `solver` out",
        ),
        (lambda: jr.sweep(DRIVEN, {"spin.torque": [1.0]}), "give the `times` of the samples"),
        (
            lambda: jr.sweep(DRIVEN, {"start.balls.0.angle": [1.0]}, times=TIMES),
            "varies a ball, but the scene has none",
        ),
        (
            lambda: jr.sweep(
                BALLS, {"start.balls.0.angle": [1.0], "start.radius": [1e-3]}, start=jr.Whirl(1e-3)
            ),
            "must be written `start.shaft.radius`",
        ),
        (lambda: jr.sweep(BALLS, {"a": {"spin.speed": [1.0]}, "spin.speed": [2.0]}), "swept twice"),
        (lambda: jr.sweep(BALLS, {"a": {}}), "is empty"),
        (lambda: jr.sweep(BALLS, {"status": {"spin.speed": [1.0]}}), "that data sets do not use"),
    ],
)
def test_refusals(call, words):
    with pytest.raises(ValueError, match=words):
        call()
