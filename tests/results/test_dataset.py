"""Datasets hold the numbers of a result, with units."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor.files.toml import loads


TIMES = np.linspace(0.0, 0.05, 6)


def ramp(*effects, shaft=None):
    shaft = shaft or jr.RigidShaft(0.4, (jr.Constraint(0.0), jr.Constraint(0.4)))
    return jr.Scene(shaft, *effects, spin=jr.SpeedProfile.ramp(10.0, 20.0, 0.05))


def balancer(*effects, places=2, **row):
    """A rotor that tilts about a pivot, with balls of 20 g at a radius of 50 mm."""
    return ramp(
        jr.Disc(0.1, 1.0, 0.05, 0.01),
        jr.BallBalancer(0.3, 0.02, 0.05, 0.0, places=places, **row),
        *effects,
        shaft=jr.RigidShaft(0.4, (jr.Constraint(0.0),)),
    )


@pytest.fixture(scope="module")
def still():
    """A run of a rotor on a fixed axis, which costs nothing."""
    return jr.run_up(ramp(jr.Disc(0.1, 1.0)), TIMES)


def with_balls(run, scene, *angles):
    """The run of a scene with balls that stay where they are."""
    rows = [jnp.broadcast_to(jnp.asarray(row), (len(TIMES), len(row))) for row in angles]
    balls = tuple(jr.Balls(angle, 0 * angle) for angle in rows)
    return dataclasses.replace(run, scene=scene, balls=balls)


def test_run_up(still):
    run = with_balls(still, balancer(), [0.3, 2.0])
    data = jr.dataset(run)
    np.testing.assert_allclose(data["speed"], 10.0 + 200.0 * TIMES)
    np.testing.assert_allclose(data["acceleration"][:-1], 200.0)
    np.testing.assert_allclose(data["angle"], 10.0 * TIMES + 100.0 * TIMES**2)
    assert data["displacement"].dims == ("time", "station", "axis")
    np.testing.assert_array_equal(data["displacement"].sel(axis="y"), run.displacement.imag)
    np.testing.assert_array_equal(data["ball_angle"], run.balls[0].angle)
    units = {name: data[name].units for name in ("time", "speed", "acceleration", "displacement")}
    assert units == {"time": "s", "speed": "rad/s", "acceleration": "rad/s^2", "displacement": "m"}
    assert data["ball_angle"].units == "rad" and data["imbalance"].units == "kg m"
    assert data.attrs["solver"] == "Dopri8" and "jaxrotor" in data.attrs["versions"]
    assert loads(data.attrs["scene"]).get("disc.mass") == 1.0


def test_balls_of_several_races_and_empty_places(still):
    more = jr.BallBalancer(0.3, 0.03, 0.06, 0.0, places=1)
    scene = balancer(more, places=3, in_use=2)
    data = jr.dataset(with_balls(still, scene, [0.3, 2.0, 7.0], [4.0]))
    assert data["race"].values.tolist() == [0, 0, 1]
    np.testing.assert_allclose(data["ball_angle"][0], [0.3, 2.0, 4.0])
    left = 1e-3 * (np.exp(0.3j) + np.exp(2j)) + 1.8e-3 * np.exp(4j)
    np.testing.assert_allclose(data["imbalance"][0], [left.real, left.imag])


def test_reactions():
    scene = ramp(jr.Disc(0.1, 2.0, 0.0, 0.02, offset=1e-3), jr.Gravity())
    result = jr.reactions(jr.run_up(scene, TIMES))
    data = jr.dataset(result)
    assert data["bearing"].values.tolist() == ["constraints.0", "constraints.1"]
    # The disc's weight and the force by its offset, by the lever 1 : 3.
    np.testing.assert_allclose(
        data["static"].sel(axis="y"), [2 * 9.80665 * s for s in (0.75, 0.25)]
    )
    speed, angle = 10.0 + 200.0 * TIMES[:-1], (10.0 * TIMES + 100.0 * TIMES**2)[:-1]
    dynamic = (data["force"] - data["static"]).isel(bearing=0, time=slice(-1))
    pressed = -0.75 * 2e-3 * (speed**2 - 200j) * np.exp(1j * angle)
    np.testing.assert_allclose(dynamic.sel(axis="x"), pressed.real, atol=1e-9)
    np.testing.assert_allclose(dynamic.sel(axis="y"), pressed.imag, atol=1e-9)
    assert data["force"].units == "N" and data["moment"].units == "N m"
    assert data.attrs["title"] == "jaxrotor reactions" and data.attrs["solver"]


def test_simulation():
    scene = jr.Scene(
        jr.MasslessShaft(0.4, 0.2, 1e4), jr.Disc(0.2, 1.0), spin=jr.ConstantSpeed(50.0)
    )
    data = jr.dataset(jr.simulate(scene, 2, 16, start=jr.Whirl(1e-3)))
    assert data["slope"].dims == ("time", "station", "axis")
    assert data.attrs["steps_per_revolution"] == 16
    np.testing.assert_allclose(data["displacement"][0, 0], [1e-3, 0.0], atol=1e-18)
