"""Sensitivity of magnetic bearings: peaks, zones, gain margins, and gains tuned under a limit."""

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from differences import central
from magnetic_bearing import (
    FILTER,
    KD,
    KI,
    KP,
    LAG,
    MASS,
    NEGATIVE,
    PER_AMPERE,
    free_shaft,
    machine,
)

import jaxrotor as jr
from jaxrotor import plot


def closed_form(frequencies, ki=KI):
    """`S` of a mass about the centre, by its equation of motion and the controller."""
    p = 1j * np.asarray(frequencies)
    wanted = KP + ki / p + KD * p / (1 + FILTER * p)
    return 1 / (1 + PER_AMPERE * wanted / (1 + LAG * p) / (MASS * p**2 - NEGATIVE))


@pytest.mark.slow
def test_peaks_of_a_mass():
    """Centred; along the weight, whose axis is the second; and without an integral."""
    centred = jr.sensitivity(jr.linearized(machine(weight=0.0)))
    np.testing.assert_allclose(centred.peaks, 3.148112827, rtol=1e-9)
    np.testing.assert_allclose(centred.peak_frequencies, 469.1234, atol=6e-5)
    assert centred.zones == ["B", "B"] and centred.growth < 0
    loaded = jr.sensitivity(jr.linearized(machine()))
    np.testing.assert_allclose(loaded.peaks, [3.148112827, 3.177898729], rtol=1e-9)
    alone = jr.sensitivity(jr.linearized(machine(weight=0.0, ki=None)))
    np.testing.assert_allclose(alone.peaks, 2.517967104, rtol=1e-9)
    assert alone.zones == ["A", "A"]
    html = loaded._repr_html_()
    assert "3.1779" in html and "magnetic_bearing second" in html


def test_values_and_gain_margins_of_a_mass():
    frequencies = np.geomspace(20.0, 30000.0, 80)
    scene = jr.linearized(machine(weight=0.0))
    found = jr.sensitivity(scene, frequencies)
    np.testing.assert_allclose(found.values[0], closed_form(frequencies), rtol=1e-10)
    np.testing.assert_allclose(found.open_loops, 1 / np.asarray(found.values) - 1)
    # At each gain margin a pair of roots is on the imaginary axis.
    for factor in np.asarray(found.gain_margins)[0]:
        own = {"current_factor": factor * PER_AMPERE}
        there = scene.replace({f"linear_magnetic_bearing.{k}": v for k, v in own.items()})
        real = np.sort(np.abs(np.asarray(jr.roots(there)).real))
        assert real[1] < 1e-7, (factor, real)
    # Without an integral, the least gain is where the stiffness vanishes.
    least = jr.sensitivity(jr.linearized(machine(weight=0.0, ki=None)), frequencies).gain_margins
    np.testing.assert_allclose(least[:, 0], NEGATIVE / (PER_AMPERE * KP), rtol=1e-12)


@pytest.mark.slow
def test_one_loop_with_the_other_closed():
    """Sensors on the other side of a node from their coils; the peak below the bending modes."""
    scene = free_shaft(0.16, nodes=16)
    found = jr.sensitivity(scene, np.linspace(100.0, 900.0, 80))
    np.testing.assert_allclose(found.peaks, 2.996981490, rtol=1e-9)
    np.testing.assert_allclose(found.peak_frequencies, 293.427, atol=5e-4)
    assert float(found.growth) == pytest.approx(float(jr.growth_rate(scene)), rel=1e-6)
    assert "unstable: roots grow" in found._repr_html_()
    # Loops of a shaft that is the same in both halves are alike, and its modes give higher peaks.
    every = jr.sensitivity(scene)
    assert np.ptp(every.peaks) < 1e-6 and every.peaks[0] > 3.4


@pytest.mark.slow
@pytest.mark.parametrize("lag", [LAG, None])
def test_gyroscopic_loops_of_turned_axes(lag):
    """`S` by a dense matrix of the test's own: two bearings, axes turned, at speed, one loop cut."""
    shaft, disc = jr.RigidShaft(1.0), jr.Disc(0.4, 8.0, diametral=0.2, polar=0.35)
    gains = {"kp": 15000.0, "kd": 15.0, "filter": FILTER, "lag": lag}
    speed, angle = 900.0, 0.4
    across = {"current_across": 280.0, "position_across": 2.0e6}
    bearings = [
        jr.LinearMagneticBearing(at, PER_AMPERE, NEGATIVE, **gains, angle=angle, name=name, **more)
        for at, name, more in ((0.1, "a", across), (0.9, "b", {}))
    ]
    scene = jr.Scene(shaft, disc, *bearings, spin=jr.ConstantSpeed(speed))
    frequencies = np.array([150.0, 420.0, 900.0])
    found = jr.sensitivity(scene, frequencies)

    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for k, w in enumerate(frequencies):
        p = 1j * w
        control = (gains["kp"] + gains["kd"] * p / (1 + FILTER * p)) / (1 + (lag or 0.0) * p)
        # Coordinates: displacements (x, y) at 0 and tilts (x, y); `a` reads a station.
        reads = [np.hstack([np.eye(2), at * np.eye(2)]) for at in (0.1, 0.9)]
        disc_at = np.hstack([np.eye(2), 0.4 * np.eye(2)])
        tilt = np.hstack([np.zeros((2, 2)), np.eye(2)])
        spinning = 0.35 * speed * np.array([[0.0, 1.0], [-1.0, 0.0]])
        matrix = 8.0 * p**2 * disc_at.T @ disc_at
        matrix = matrix + tilt.T @ (0.2 * p**2 * np.eye(2) + p * spinning) @ tilt
        gain = []
        factors = (300.0, 280.0, 2.25e6, 2e6), (300.0, 300.0, 2.25e6, 2.25e6)
        for read, own in zip(reads, factors, strict=True):
            ki, ks = turn @ np.diag(own[:2]) @ turn.T, turn @ np.diag(own[2:]) @ turn.T
            matrix = matrix + read.T @ (ki * control - ks) @ read
            gain.append(ki * control)
        for j, read in enumerate(reads):
            for axis in (0, 1):
                unit = turn[:, axis]
                moved = np.linalg.solve(matrix, -read.T @ gain[j] @ unit)
                wanted = 1 + unit @ read @ moved
                np.testing.assert_allclose(found.values[2 * j + axis, k], wanted, rtol=1e-9)


@pytest.mark.slow
def test_derivatives_of_peaks():
    """Through the static position and the peak, by the gains and the lag."""
    numbers = {"kp": KP, "ki": KI, "kd": KD, "lag": LAG}
    scene, values = machine(), jnp.array(list(numbers.values()))

    @jax.jit
    def found(values, along):
        def of(values):
            paths = {f"magnetic_bearing.{n}": v for n, v in zip(numbers, values, strict=True)}
            own = jr.sensitivity(jr.linearized(scene.replace(paths)), np.geomspace(50, 30000, 60))
            return jnp.stack([own.peaks[1], own.peak_frequencies[1], *own.gain_margins[1]])

        return jax.jvp(of, (values,), (along,))

    for k, value in enumerate(numbers.values()):
        unit, step = jnp.eye(values.size)[k], 1e-3 * value
        expected = central(lambda n, u=unit, h=step: found(values + n * h * u, u)[0], step)
        np.testing.assert_allclose(found(values, unit)[1], expected, rtol=1e-6)


@pytest.mark.slow
def test_gains_are_tuned_under_a_limit():
    """The least sag of a mass under its weight at a peak of 2, which limits it."""
    scene, grid = machine(ki=None, limit=None), np.geomspace(50.0, 5000.0, 40)
    loss = lambda scene: 1e6 * jnp.abs(jr.static_positions(scene).position[0])
    peaks = lambda scene: jr.sensitivity(jr.linearized(scene), grid).peaks
    where = {"magnetic_bearing.kp": (9000.0, 60000.0), "magnetic_bearing.kd": (5.0, 25.0)}
    limits = [("sensitivity", lambda scene: jnp.max(peaks(scene)) - 2.0)]
    best = jr.tune(loss, scene, where, constraints=limits, steps=60, tolerance=1e-6, progress=False)
    assert float(loss(best.scene)) < 40.0 < float(loss(scene))
    assert float(jnp.max(peaks(best.scene))) == pytest.approx(2.0, abs=1e-5)


def test_refused():
    scene = jr.Scene(jr.RigidShaft(1.0), jr.Disc(0.5, 1.0), spin=jr.ConstantSpeed(0.0))
    with pytest.raises(ValueError, match="no magnetic bearing, so no control loop"):
        jr.sensitivity(scene)
    with pytest.raises(ValueError, match="are linear about a static position only"):
        jr.sensitivity(machine())
    linear = jr.linearized(machine(weight=0.0))
    with pytest.raises(ValueError, match="must be positive and ascending"):
        jr.sensitivity(linear, [2.0, 1.0])
    stop = jr.Limiter(0.5, angle=0.0, gap=1e-4, stiffness=1e6)
    with pytest.raises(ValueError, match=r"has contacts \(limiter\)"):
        jr.sensitivity(linear.of_parts(*linear.effects, stop))


def test_plot_has_a_curve_of_each_unlike_loop():
    found = jr.sensitivity(jr.linearized(machine()), np.geomspace(20.0, 3000.0, 30))
    ax = plot.sensitivity(found)
    labels = ax.get_legend_handles_labels()[1]
    assert labels == ["magnetic_bearing first", "magnetic_bearing second", "peak"]
    assert [text.get_text() for text in ax.texts] == [f"zone {letter}" for letter in "ABCD"]
    plt.close(ax.figure)
