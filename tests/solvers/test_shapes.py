"""A few shapes of a rotor in place of all its coordinates: compliance, stated error, motion."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor.equations.constant_frame import linear_matrix
from jaxrotor.solvers.choice import with_shapes
from jaxrotor.solvers.shapes import Shapes, shape_errors


TIP = 0.7
# As programs, not one operation after the other.
shapes_of, first_order = map(eqx.filter_jit, (Shapes.of, linear_matrix))
row_of = eqx.filter_jit(lambda line, at: line.row(at)[None])


@pytest.fixture(scope="module")
def rotor():
    """The limiter rotor, its equations and the row of its disc."""
    scene = jr.load("limiter-rotor")
    system = jr.assemble(scene)
    return scene, system, row_of(system.line, jnp.asarray(TIP))


def test_static_compliance_of_the_end_of_a_cantilever(rotor):
    """`l^3 / 3EI` under a force, of a shaft without shear, whose tip is where the stops are."""
    scene, system, row = rotor
    found = shapes_of(system, scene.spin.speed, row, 4)
    np.testing.assert_allclose(found.left @ found.inertia @ found.right, np.eye(4), atol=1e-9)
    stiffness = found.left @ system.blocks.stiffness @ found.right
    force = found.left @ system.ports[0].column
    compliance = (row @ found.right @ jnp.linalg.solve(stiffness, force))[0]
    rigidity = 2.1e11 * np.pi * 0.02**4 / 64
    assert compliance == pytest.approx(TIP**3 / (3 * rigidity), rel=2e-4)


def test_the_first_shapes_are_the_same_however_many(rotor):
    scene, system, row = rotor
    few, more = (shapes_of(system, scene.spin.speed, row, count) for count in (2, 5))
    np.testing.assert_allclose(few.right, more.right[:, :2], rtol=1e-12)


@pytest.mark.parametrize(
    "name", ["limiter-rotor", pytest.param("overhung-fan", marks=pytest.mark.slow)]
)
def test_stated_error_is_that_of_the_compliance(name):
    """Computed anew from the first-order equations, of equal and of unequal axes."""
    scene = jr.load(name)
    system, speed = jr.assemble(scene), jnp.abs(scene.spin.speed)
    stations, most = scene.stations(None), 6
    row = np.asarray(row_of(system.line, stations[0]))
    stated = np.asarray(shape_errors(system, speed, stations, most))
    a, (port,) = np.asarray(first_order(system, speed)), system.ports
    axes = np.eye(len(a) // system.n // 2)
    speed = float(speed)
    drive = np.linalg.solve(system.blocks.inertia, np.asarray(port.column)[:, None]) / speed**2
    drive = np.concatenate([np.kron(axes, 0 * drive), np.kron(axes, drive)])
    rows = np.stack([np.asarray(port.row), row[0]])
    seen = np.concatenate([np.kron(axes, rows), np.kron(axes, 0 * rows)], axis=1)
    stop = np.asarray(port.hardness())
    light = np.asarray(port.row) @ drive[len(drive) // 2 :][: system.n, 0] * speed**2
    top = 2 * max(np.sqrt(stop[0] * light) / speed, 1.0)
    first = -top if np.iscomplexobj(a) else 0.0
    growth = 1 / (2 * np.pi) + 1j * np.linspace(first, top, 48 if first else 24)
    at_port = np.arange(0, len(seen), 2)
    for count in (3, 5):
        shapes = shapes_of(system, jnp.asarray(speed), jnp.asarray(row), count)
        small, into, back = map(np.asarray, shapes.within(jnp.asarray(a)))
        worst = 0.0
        for root in growth:
            exact = seen @ np.linalg.solve(root * np.eye(len(a)) - a, drive)
            few = seen @ into @ np.linalg.solve(root * np.eye(len(small)) - small, back @ drive)
            soft = np.eye(len(axes)) / (stop[0] + root * speed * stop[1])
            change = (few - exact) @ np.linalg.inv(exact[at_port] + soft)
            worst = max(worst, np.abs(change).max())
        assert stated[count - 1] == pytest.approx(worst, rel=1e-3)
    assert np.all(np.diff(stated) < 0) and stated[-1] < 1e-4


def test_shapes_are_counted_or_refused():
    assert jr.Exponential(shapes=3).shapes == 3
    for bad in (0, -1, True):
        with pytest.raises(ValueError, match="`shapes` must be a positive whole number"):
            jr.Exponential(shapes=bad)
    scene = jr.load("limiter-rotor")
    with pytest.raises(ValueError, match="shapes are for whole revolutions"):
        jr.run_up(scene, np.linspace(0, 0.1, 5), solver=jr.Exponential(shapes=3))


def test_orbits_refuse_shapes(rotor):
    """Their direction of motion is that of all coordinates."""
    solver = jr.Exponential(4, located=True, shapes=4)
    with pytest.raises(ValueError, match="Orbits follow all coordinates of the rotor"):
        jr.periodic(rotor[0], jr.Whirl(1e-3), revolutions=1, solver=solver)


@pytest.mark.slow
def test_stops_that_no_force_moves_leave_all_coordinates(rotor):
    """At the clamped end no force moves the rotor; and a cubic spring states no stiffness."""
    bare = rotor[0].without("limiters")
    for contact in (jr.Limiter(0.0, 0.0, 1e-3, 1e6), jr.CubicSpring(TIP, 0.0, 1e9)):
        scene = jr.Scene(bare.shaft, *bare.effects, contact, spin=bare.spin)
        system = jr.assemble(scene)
        given = jr.Exponential(shapes="auto"), [system], [scene.spin.speed]
        solver, pilots = with_shapes(*given, jnp.array([TIP]), 1e-3)
        assert solver.shapes is None and not pilots


def test_without_contact_all_coordinates_are_followed():
    scene = jr.load("limiter-rotor").without("limiter")
    found = jr.simulate(scene, 1, 8, solver=jr.Exponential(shapes="auto"))
    assert found.pilots == () and "shapes" not in found.solver


@pytest.mark.slow
def test_a_rub_by_shapes_that_are_chosen(rotor):
    """The error of five revolutions is of the size that the pilot states; the derivative follows."""
    scene, _, _ = rotor
    start = jr.Whirl(12e-3, -441.0)
    every = jr.simulate(scene, 5, 64, start=start, solver=jr.Exponential(4, located=True))
    solver, tolerance = jr.Exponential(4, located=True, shapes="auto"), 1e-5
    found = jr.simulate(scene, 5, 64, start=start, solver=solver, tolerance=tolerance)
    (pilot,) = found.pilots
    assert pilot.converged and pilot.difference <= tolerance and pilot.setting < 8
    assert f"shapes={pilot.setting}" in found.solver and "error" in str(pilot)
    off = np.abs(found.displacement - every.displacement).max()
    assert off < 10 * pilot.difference * np.abs(every.displacement).max()


@pytest.mark.slow
def test_derivative_by_the_stiffness_of_the_stops(rotor):
    scene, _, _ = rotor
    start, solver = (
        jr.Whirl(12e-3, -441.0),
        jr.Exponential(4, located=True, shapes=5, basis="modal"),
    )

    def end(stiffness):
        changed = scene.replace(
            {"limiters.stiffness": stiffness, "disc.mass": stiffness / 1657220.0}
        )
        found = jr.simulate(changed, 1, 64, start=start, solver=solver)
        return jnp.array([found.displacement[-1, 0].real, found.displacement[-1, 0].imag])

    both = lambda stiffness: jax.jvp(end, (stiffness,), (1.0,))  # one program has the values, too
    at, step = 4.087e6, 40.87
    slope = both(at)[1]
    change = (both(at + step)[0] - both(at - step)[0]) / (2 * step)
    np.testing.assert_allclose(slope, change, rtol=0, atol=1e-5 * np.abs(change).max())


@pytest.mark.slow
def test_a_sweep_takes_shapes_and_says_so(rotor):
    scene, _, _ = rotor
    run = {"start": jr.Whirl(12e-3, -441.0), "settle": 60, "keep": 20, "steps_per_revolution": 64}
    over = {"unbalance.eccentricity": np.array([0.0, 1e-6])}
    few = jr.sweep(scene, over, solver=jr.Exponential(shapes="auto"), error_sample=2, **run)
    every = jr.sweep(scene, over, error_sample=0, **run)
    assert "shapes=4" in few.attrs["solver"] and "4 shapes (error" in few.attrs["chosen"]
    assert "shapes" not in every.attrs["solver"] and "chosen" not in every.attrs
    np.testing.assert_allclose(few["whirl_rate"], every["whirl_rate"], rtol=0, atol=2e-4)
    assert few["radius_max"].attrs["error"] < 2e-2 * float(few["radius_max"].max())
