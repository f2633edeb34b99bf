"""Branches of periodic orbits against scipy, closed forms and the onset of instability.

The scalar equations and their derivatives are written here again and integrated by scipy.
"""

import dataclasses

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from shown import shown
from switched import TURN, Switched
from systems import LENGTH, TIME, limiter_rotor, one_disc

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.orbits.bifurcations import touches


FINE = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}


class Duffing:
    """`x.. + c x. + k x + x^3 = g + e Omega^2 cos Omega t` by scipy, with the derivative by its state."""

    def __init__(self, damping, stiffness, constant):
        self.damping, self.stiffness, self.constant = damping, stiffness, constant

    def field(self, t, y, force, speed):
        x, v, *d = y
        slope = self.stiffness + 3 * x**2
        rest = self.constant + force * np.cos(speed * t) - self.stiffness * x - x**3
        rates = [v, rest - self.damping * v]
        for a, b in zip(d[::2], d[1::2], strict=True):
            rates += [b, -slope * a - self.damping * b]
        return rates

    def back(self, start, eccentricity, speed, revolutions=1):
        """State after some revolutions, or a part of one, and its derivative by the start."""
        span = (0.0, TURN / speed * revolutions)
        more = (eccentricity * speed**2, speed)
        y = solve_ivp(self.field, span, [*start, 1, 0, 0, 1], args=more, **FINE).y[:, -1]
        return y[:2], y[2:].reshape(2, 2).T

    def critical(self, start, value, multiplier, revolutions=1, speed=None):
        """Parameter at which an orbit has a real multiplier: eccentricity, or speed at a given one."""

        def residual(unknown):
            *state, p = unknown
            which = (p, 1.0) if speed is None else (speed, p)
            end, derivative = self.back(state, *which, revolutions)
            return [*(end - state), np.linalg.det(derivative - multiplier * np.eye(2))]

        found, _, success, message = fsolve(residual, [*start, value], xtol=1e-13, full_output=True)
        assert success == 1 or np.abs(residual(found)).max() < 1e-10, message
        return found[2]


def along_x(orbit):
    """Displacement [m] and velocity [m/s] along x that an orbit starts with."""
    return float(orbit.start.q[0].real), float(orbit.start.velocity[0].real)


# === Duffing


@pytest.fixture(scope="module")
def slow_orbit():
    """An orbit below the hardening resonance."""
    scene = one_disc(jr.CubicSpring(0.5, 0.0, 1.0), speed=0.5)
    return jr.periodic(scene, jr.AtRest(), revolutions=1)


@pytest.fixture(scope="module")
def resonance():
    """The hardening resonance, continued in speed through both folds."""
    scene = one_disc(jr.CubicSpring(0.5, 0.0, 1.0))
    orbit = jr.periodic(scene, jr.AtRest(), revolutions=1)
    return jr.continue_(orbit, "spin.speed", (0.5, 2.5))


@pytest.mark.slow
def test_folds_of_the_hardening_resonance(resonance):
    """The two speeds at which the amplitude jumps, by scipy."""
    folds = resonance.of("fold")
    assert [point.kind for point in resonance.points] == ["fold", "fold"]
    for point in folds:
        start = along_x(resonance.orbit(point))
        exact = Duffing(0.1, 1.0, 0.0).critical(start, point.value, 1.0, speed=0.08)
        assert point.value == pytest.approx(exact, rel=1e-7)
        assert abs(point.multipliers[0] - 1) < 1e-6
    # between the folds, and nowhere else, orbits are unstable
    upper, lower = (point.place for point in folds)
    place = np.arange(resonance.values.size)
    np.testing.assert_array_equal(resonance.stable, (place < upper) | (place > lower))
    assert resonance.values[0] == 0.5 and resonance.values[-1] == 2.5
    assert "spin.speed = 2.5 is the end of the range" in resonance.reasons[1]
    assert "fold at 1.399" in str(resonance)
    said, heads, rows = shown(resonance)
    assert said.startswith(str(resonance).splitlines()[0]) and "ends: " in said
    assert heads[1] == "spin.speed" and [row[0] for row in rows] == ["fold", "fold"]
    assert [row[1] for row in rows] == [f"{point.value:.6g}" for point in folds]


@pytest.mark.slow
def test_multipliers_on_the_branch(resonance):
    """Every tenth orbit: along x by scipy; across, of the linear oscillator in closed form."""
    for number in range(0, resonance.values.size, 10):
        orbit, speed = resonance.orbit(number), resonance.values[number]
        end, derivative = Duffing(0.1, 1.0, 0.0).back(along_x(orbit), 0.08, speed)
        np.testing.assert_allclose(end, along_x(orbit), rtol=0, atol=1e-7)
        across = np.exp((-0.05 + 1j * np.sqrt(1 - 0.05**2)) * TURN / speed)
        expected = [*np.linalg.eigvals(derivative), across, across.conj()]
        for value in expected:
            assert np.abs(resonance.multipliers[number] - value).min() < 1e-6


@pytest.mark.slow
def test_orbits_of_the_branch_are_those_of_periodic(resonance):
    unstable = int(np.flatnonzero(~resonance.stable)[3])
    orbit = resonance.orbit(unstable)
    again = jr.periodic(orbit.scene, orbit)
    assert float(orbit.scene.spin.speed) == resonance.values[unstable]
    np.testing.assert_allclose(again.displacement, orbit.displacement, rtol=0, atol=1e-9)
    np.testing.assert_allclose(again.multipliers, orbit.multipliers, rtol=0, atol=1e-8)
    assert float(orbit.radius[1][0]) == resonance.radius_max[unstable, 0]


# === contact


@pytest.fixture(scope="module")
def oscillator():
    """A mass that meets an undamped stop along x, continued in eccentricity."""
    scene = one_disc(speed=1.3, eccentricity=0.12)
    orbit = jr.periodic(scene, jr.AtRest(), steps_per_revolution=400)
    stop = jr.Limiter(0.5, 0.0, gap=0.3, stiffness=20.0)
    free = dataclasses.replace(orbit, scene=scene.of_parts(*scene.effects, stop))  # not touched
    return jr.continue_(free, "unbalance.eccentricity", (0.03, 0.14), max_step=0.1)


@pytest.mark.slow
def test_grazing_of_the_impact_oscillator(oscillator):
    """The amplitude of the linear response is the gap: `e Omega^2 = gap |k - m Omega^2 + i c Omega|`."""
    first = oscillator.points[0]
    speed = 1.3
    exact = 0.3 * abs(1 - speed**2 + 0.1j * speed) / speed**2
    assert (first.kind, first.contact) == ("grazing", 0)
    assert first.value == pytest.approx(exact, rel=1e-8)
    free = np.arange(oscillator.values.size) < first.place
    linear = oscillator.values * 0.3 / exact
    np.testing.assert_allclose(oscillator.radius_max[free, 0], linear[free], rtol=1e-9)
    np.testing.assert_allclose(oscillator.clearance[free, 0], 0.3 - linear[free], atol=1e-9)


@pytest.mark.slow
def test_multipliers_of_impacts_are_those_of_direct_integration(oscillator):
    """By scipy from event to event."""
    after = np.flatnonzero(oscillator.clearance[:, 0] < -1e-3)
    assert after.size > 10
    for number in after[:: after.size // 4]:
        orbit = oscillator.orbit(int(number))
        w = np.concatenate([orbit.start.q, orbit.start.velocity / 1.3])
        y = np.concatenate([w.real, w.imag])
        end, changes, derivative = Switched(orbit.scene).followed(y, 1)
        assert changes == 2 * touches(oscillator.look(int(number)))[0][0]
        assert np.abs(end - y).max() < 1e-7 * np.abs(y).max()
        for value in np.linalg.eigvals(derivative):
            assert np.abs(oscillator.multipliers[number] - value).min() < 1e-6


# === Neimark-Sacker


@pytest.mark.slow
def test_synchronous_whirl_loses_its_stability_at_the_onset_speed():
    """A linear rotor in closed form: a pair of multipliers leaves at an angle of `omega / Omega` turns."""
    shaft = jr.MasslessShaft(1.0, 0.5, 1.0, damping=0.05)
    parts = jr.Disc(0.5, 1.0), jr.DiscDamping(0.5, 0.1), jr.Unbalance(0.5, 1.0, 0.01)
    scene = jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(2.5))
    orbit = jr.periodic(scene, jr.AtRest(), steps_per_revolution=32)
    branch = jr.continue_(orbit, "spin.speed", (2.0, 4.0))
    onset = jr.onset_speed(scene, (2.0, 4.0))
    (point,) = branch.points
    assert point.kind == "neimark-sacker"
    assert point.value == pytest.approx(3.0, rel=1e-9)  # (1 + c / h) omega, omega = 1
    assert point.value == pytest.approx(float(onset.speed), rel=1e-9)
    assert point.angle == pytest.approx(TURN / 3, rel=1e-8)
    np.testing.assert_array_equal(branch.stable, branch.values < 3.0)


# === derivatives of the modal form


@pytest.mark.slow
def test_modal_basis_has_the_derivative_of_the_dense_one():
    """Derivative by eigenvectors, which continuation uses, against that of matrix exponentials."""
    paths = ("limiters.stiffness", "spin.speed", "internal_damping.voigt_time")
    scene = limiter_rotor(nodes=4, eps=1e-3)
    own = jnp.stack([jnp.ravel(scene.get(path))[0] for path in paths])

    def slopes(basis):
        options = {"solver": jr.Exponential(4, basis), "start": jr.Whirl(0.009, -441.0)}
        values = lambda share: dict(zip(paths, share * own, strict=True))
        moved = lambda share: jr.simulate(scene.put(values(share)), 2, 64, **options).displacement
        return np.moveaxis(jax.jit(jax.jacfwd(moved))(jnp.ones(len(paths))), -1, 0)

    for path, modal, dense in zip(paths, slopes("modal"), slopes("dense"), strict=True):
        atol = 1e-9 * np.abs(dense).max()
        np.testing.assert_allclose(modal, dense, rtol=0, atol=atol, err_msg=path)


@pytest.mark.slow
def test_a_branch_has_eight_nodes_where_the_shaft_is_varied():
    """The orbit has fewer; carried over to 8 a span, the branch meets the response in closed form."""
    scene = limiter_rotor(N=1.2, eps=1e-3, contact=False, station=0.3)
    orbit = jr.periodic(scene, jr.Whirl(1e-4), steps_per_revolution=16)
    own = float(scene.shaft.diameter)
    options = {"max_points": 2, "locate": False, "direction": "up"}
    branch = jr.continue_(orbit, "shaft.diameter", (0.95 * own, 1.05 * own), **options)
    assert scene.resolution == (6, 8) and branch.values[0] == pytest.approx(own)
    for number, value in enumerate(branch.values):
        found = branch.orbit(number)
        assert found.scene.resolution == (8, 8)
        exact = jr.unbalance_response(
            scene.replace({"shaft.diameter": float(value)}), scene.spin.speed
        )
        radius = np.abs(np.asarray(exact.forward)).ravel()
        np.testing.assert_allclose(np.abs(found.displacement[0]), radius, rtol=1e-7)


# === a motion without unbalance


@pytest.fixture(scope="module")
def rub():
    """The backward rub, every contact a third of a turn further back."""
    scene = limiter_rotor(nodes=4)
    start = jr.Whirl(0.012 * LENGTH, rate=-10 / TIME)
    settled = jr.simulate(scene, 200, 128, solver=jr.Exponential(4), start=start, keep=4)
    return jr.periodic(scene, settled, steps_per_revolution=128)


@pytest.fixture(scope="module")
def slipping(rub):
    """Its branch as friction falls."""
    return jr.continue_(rub, "limiters.friction", (0.05, 0.15), direction="down")


@pytest.fixture(scope="module")
def faster(rub):
    """Its branch as the rotor turns faster."""
    speed = float(rub.scene.spin.speed)
    return jr.continue_(rub, "spin.speed", (speed, 1350.0), direction="up")


def direct(orbit):
    """Multipliers of an orbit by scipy from event to event, after a check that it closes."""
    speed = float(orbit.scene.spin.speed)
    w = np.concatenate([orbit.start.q, orbit.start.velocity / speed])
    y = np.concatenate([w.real, w.imag])
    end, _, derivative = Switched(orbit.scene).followed(y, float(orbit.period) * speed / TURN)
    back = np.exp(-1j * (0.0 if orbit.turn is None else float(orbit.turn))) * np.eye(w.size)
    back = np.block([[back.real, -back.imag], [back.imag, back.real]])
    assert np.abs(back @ end - y).max() < 1e-6 * np.abs(y).max()
    return np.linalg.eigvals(back @ derivative)


@pytest.mark.slow
def test_backward_rub_ends_at_a_fold(rub, slipping):
    """Continued in friction it turns back before friction is zero; `periodic` finds an orbit of it too."""
    branch = slipping
    (fold,) = branch.of("fold")
    assert abs(fold.multipliers[0] - 1) < 1e-5
    near = np.sort(np.abs(direct(branch.orbit(fold)) - 1))
    assert near[1] < 1e-2 < near[2]  # that of the motion itself and of the fold: a root of rounding
    assert branch.stable[: int(fold.place) + 1].all()
    assert not branch.stable[int(fold.place) + 1 :].any()
    np.testing.assert_allclose(branch.trivial, 1.0, atol=1e-5)
    number = int(fold.place) // 2
    changed = rub.scene.replace({"limiters.friction": branch.values[number]})
    again = jr.periodic(changed, rub, steps_per_revolution=128)
    assert float(again.whirl_rate) == pytest.approx(branch.whirl_rate[number], abs=1e-8)
    for path in ("limiters.0.stiffness", "unbalance.eccentricity"):
        with pytest.raises(ValueError, match="breaks the symmetry"):
            jr.continue_(rub, path, (0.0, 1e7))


@pytest.mark.slow
def test_backward_rub_becomes_a_torus_at_higher_speed(faster):
    """A pair of multipliers leaves the unit circle, by scipy too; before and after it they do not."""
    branch = faster
    (point,) = branch.points
    assert point.kind == "neimark-sacker"
    pair = np.exp(1j * point.angle)
    assert np.abs(direct(branch.orbit(point)) - pair).min() < 1e-5
    np.testing.assert_array_equal(branch.stable, branch.values < point.value)


@pytest.mark.long
def test_curves_of_the_fold_and_the_torus_of_the_backward_rub(slipping, faster):
    """Both over a second parameter, at either end, against branches of the first."""
    speed = float(faster.values[0])
    cases = (  # with the point of the curve that is looked at; between both is that of the branch
        ("fold", slipping, "limiters.friction", (0.05, 0.15), 2e-3, 0),
        ("neimark-sacker", faster, "spin.speed", (speed, 1350.0), 4.0, 2),
    )
    for kind, branch, path, between, width, number in cases:
        plane, bounds = (path, "limiters.stiffness"), (between, (3e6, 6e6))
        how = {"max_points": 1, "step": 0.05, "max_step": 0.2}
        curve = jr.continue_curve(branch, branch.of(kind)[0], plane, bounds, **how)
        assert len(curve.values) == 3 and np.ptp(curve.values[:, 1]) > 1e5
        assert curve.stable.all()
        value = curve.values[number, 0]
        near = value - width, value + width
        how = {"step": 2e-2, "max_points": 2, "locate": False, "direction": "up"}
        orbit = jr.continue_(curve.orbit(number), path, near, **how).orbit(-1)
        points = jr.continue_(orbit, path, near, step=2e-2, max_points=6).of(kind)
        nearest = min((point.value for point in points), key=lambda one: abs(one - value))
        assert nearest == pytest.approx(value, rel=1e-8)


@pytest.mark.long
def test_locked_rub_is_left_for_a_torus_on_both_sides():
    """At half the speed between two eccentricities; there a pair of multipliers leaves, by scipy too."""
    scene = limiter_rotor(nodes=4, eps=0.8e-3 / LENGTH)
    start = jr.Whirl(0.012 * LENGTH, rate=-10 / TIME)
    settled = jr.simulate(scene, 300, 128, solver=jr.Exponential(4), start=start, keep=4)
    orbit = jr.periodic(scene, settled, revolutions=2, steps_per_revolution=128)
    branch = jr.continue_(orbit, "unbalance.eccentricity", (0.5e-3, 1e-3))
    low, high = sorted(branch.of("neimark-sacker"), key=lambda point: point.value)
    assert low.value < 0.8e-3 < high.value
    for point in (low, high):
        assert np.abs(direct(branch.orbit(point)) - np.exp(1j * point.angle)).min() < 1e-5


# === refusals and pictures


@pytest.mark.slow
def test_refusals(resonance):
    orbit = resonance.orbit(0)
    for how, sentence in (
        (("spin.sped", (0.4, 1.0)), "did you mean `spin.speed`"),
        (("spin.speed", (0.6, 1.0)), "must hold the orbit's own `spin.speed`, 0.5"),
        (("spin.speed", (-0.5, 1.0)), "must keep the sense of rotation"),
        (("spin.speed", [1.0]), "must be two numbers"),
        (("disc_damping.translational", (-0.1, 0.2)), "must not be negative"),
    ):
        with pytest.raises(ValueError, match=sentence):
            jr.continue_(orbit, *how)
    housing = jr.Casing("housing", 1.0), jr.Support(of="housing", stiffness=1.0)
    stop = jr.Limiter(0.5, 0.0, 1e3, 1.0, on="housing")
    cased = orbit.scene.of_parts(*orbit.scene.effects, stop, *housing)
    with pytest.raises(ValueError, match="`limiter` stands on the casing 'housing', but branch"):
        jr.continue_(dataclasses.replace(orbit, scene=cased), "spin.speed", (0.4, 1.0))
    with pytest.raises(ValueError, match="`direction` must be"):
        jr.continue_(orbit, "spin.speed", (0.4, 1.0), direction="left")
    with pytest.raises(ValueError, match="`step` must be above"):
        jr.continue_(orbit, "spin.speed", (0.4, 1.0), step=1.0)


def test_where_it_stops_is_said(slow_orbit):
    short = jr.continue_(slow_orbit, "spin.speed", (0.5, 2.5), max_points=3)
    assert short.values.size == 4
    assert "`max_points` = 3 are taken, to spin.speed = 0." in short.reasons[1]
    with pytest.raises(RuntimeError, match="cannot be continued in `spin.speed`: after 1 iter"):
        off = jr.Continued(3 * slow_orbit.start.q, slow_orbit.start.velocity)
        far = dataclasses.replace(slow_orbit, start=off)
        jr.continue_(far, "spin.speed", (0.5, 2.5), max_iterations=1)


@pytest.mark.slow
def test_picture_of_a_branch(resonance):
    ax = plot.branch(resonance)
    assert ax.get_xlabel() == "spin speed [rad/s]" and ax.get_ylabel() == "largest radius [mm]"
    lines = {line.get_label(): line for line in ax.get_lines()}
    assert set(lines) == {"stable", "unstable", "fold"}
    np.testing.assert_allclose(
        lines["fold"].get_xdata(), [point.value for point in resonance.of("fold")]
    )
    unstable = np.isfinite(lines["unstable"].get_ydata()).sum()
    assert unstable == (~resonance.stable).sum() + 2  # with the folds at both ends
    plot.branch(resonance, ax)  # named once
    assert len(ax.get_legend().get_texts()) == 3
    assert plot.branch(resonance, of="whirl_rate").get_ylabel() == "whirl rate [1]"
    with pytest.raises(ValueError, match="`of` must be"):
        plot.branch(resonance, of="height")
    plt.close("all")
