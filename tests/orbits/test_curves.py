"""Curves of bifurcations against branches of one parameter, scipy and closed forms."""

import dataclasses

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.optimize import fsolve
from shown import shown
from systems import one_disc
from test_continuation import Duffing, along_x

import jaxrotor as jr
from jaxrotor import plot


PLANE = ("spin.speed", "support.cxx")  # along x the damping is that of the disc and `cxx`
SPANS = ((0.5, 2.5), (-0.25, 0.1))
STEPS = {"max_step": 0.2, "step": 0.05}


def duffing_disc(constant, **values):
    """`x.. + (c + cxx) x. + k x + x^3 = constant + e Omega^2 cos Omega t`; along y it is damped."""
    spring, weight = jr.CubicSpring(0.5, 0.0, 1.0), jr.Gravity(constant, angle=0.0)
    damper = jr.Support(0.5, kxx=0.0, kyy=0.0, cxx=0.0, cyy=0.3)
    return one_disc(spring, weight, damper, **values)


def check_three(curve, width=0.05):
    """Three points of a curve, and what is on its side, against branches of its first parameter.

    Each branch leaves the point and is then followed back through it, from an orbit of its own.
    """
    path, kind = curve.paths[0], curve.kind
    for number in np.linspace(1, len(curve.values) - 2, 3).round().astype(int):
        value, ahead = curve.values[number, 0], curve.side[number, 0]
        between = value - width, value + width
        how = {"step": 2e-2, "max_points": 2, "locate": False, "direction": "up"}
        away = jr.continue_(curve.orbit(int(number)), path, between, **how)
        branch = jr.continue_(away.orbit(-1), path, between, step=2e-2, max_points=8)
        found = [point.value for point in branch.of(kind)]
        nearest = min(found, key=lambda one: abs(one - value))
        assert nearest == pytest.approx(value, rel=1e-8, abs=1e-9)
        if kind == "fold":
            assert (away.values[-1] > value) == (ahead > 0)
        elif curve.stable[number]:
            assert away.stable[-1] == (ahead > 0)


# === Duffing


@pytest.fixture(scope="module")
def resonance():
    """The hardening resonance from a speed above it, down to the lower fold."""
    orbit = jr.periodic(duffing_disc(0.0, speed=1.25), jr.AtRest(), revolutions=1)
    how = {"direction": "down", "max_points": 12, "max_step": 0.1}
    return jr.continue_(orbit, "spin.speed", (1.1, 1.3), **how)


@pytest.fixture(scope="module")
def folds(resonance):
    """Its folds over speed and damping."""
    bounds = (0.7, 1.3), (-0.12, 0.06)
    return jr.continue_curve(resonance, resonance.of("fold")[0], PLANE, bounds, **STEPS)


@pytest.mark.slow
def test_fold_curve_is_that_of_branches(folds):
    check_three(folds)
    # Across the curve there are two orbits more or less: a tangent of the curve is across `side`.
    chords = np.diff(folds.unknowns[:, -2:], axis=0)
    chords = chords[1:] + chords[:-1]
    cosines = np.abs(np.sum(chords * folds.side[1:-1], axis=1)) / np.linalg.norm(chords, axis=1)
    assert np.median(cosines) < 2e-2


@pytest.mark.slow
def test_cusp_and_resonance_on_the_fold_curve(folds):
    """The cusp by scipy, with the derivative of `det(D - 1)` along its null vector by a difference."""
    (cusp,) = folds.of("cusp")

    def residual(unknown):
        *state, speed, damping = unknown
        duffing = Duffing(damping, 1.0, 0.0)
        back = lambda start: duffing.back(start, 0.08, speed)
        end, derivative = back(state)
        across = np.linalg.svd(derivative - np.eye(2))[2][-1]
        sides = [back(state + 1e-4 * sign * across)[1] for sign in (1, -1)]
        ahead, behind = (np.linalg.det(one - np.eye(2)) for one in sides)
        bend = (ahead - behind) / 2e-4
        return [*(end - state), np.linalg.det(derivative - np.eye(2)), bend]

    start = along_x(folds.orbit(cusp))
    exact = fsolve(residual, [*start, cusp.values[0], 0.1 + cusp.values[1]], xtol=1e-11)
    assert np.abs(residual(exact)).max() < 1e-7
    np.testing.assert_allclose(cusp.values + [0.0, 0.1], exact[2:], rtol=1e-6)
    # Without damping the product of both multipliers is 1: where one is 1 both are.
    (resonance,) = folds.of("1:1 resonance")
    start = along_x(folds.orbit(resonance))
    speed = Duffing(0.0, 1.0, 0.0).critical(start, resonance.values[0], 1.0, speed=0.08)
    np.testing.assert_allclose(resonance.values, [speed, -0.1], rtol=1e-7)
    after = np.arange(len(folds.values)) > resonance.place
    np.testing.assert_array_equal(folds.outside, after)  # beyond, both orbits are unstable
    text = str(folds)
    assert "1:1 resonance at 1.1829" in text and "cusp at 1.1409" in text
    said, heads, rows = shown(folds)
    assert said.startswith(text.splitlines()[0]) and heads == ["point", *PLANE]
    assert [row[0] for row in rows] == [point.kind for point in folds.points]


@pytest.mark.slow
def test_derivative_by_a_third_parameter(folds):
    """By the cubic stiffness, which is a change of scale of the force; differences by scipy.

    The damping of the disc and `cxx` have the same effect along x.
    """
    number = 10
    speed, damping = folds.values[number]
    start, step = np.array(along_x(folds.orbit(number))), 1e-4

    def fold(stiffness):
        share = np.sqrt(stiffness)
        duffing = Duffing(0.1 + damping, 1.0, 0.0)
        return duffing.critical(start * share, speed, 1.0, speed=0.08 * share)

    difference = (fold(1 + step) - fold(1 - step)) / (2 * step)
    found = folds.derivative(number, "cubic_spring.stiffness")[0]
    assert found == pytest.approx(difference, rel=1e-6)
    with pytest.raises(ValueError, match="`path` must be a third parameter, but `spin.speed` is"):
        folds.derivative(number, "spin.speed")


@pytest.fixture(scope="module")
def biased():
    """An orbit of the biased resonance, between its flips and folds."""
    options = {"damping": 0.2, "stiffness": 0.1, "speed": 1.0, "eccentricity": 1.0}
    scene = duffing_disc(1.0, **options)
    return jr.periodic(scene, jr.simulate(scene, 60, 128, keep=1), revolutions=1)


@pytest.mark.slow
def test_flip_curve(biased):
    """Without damping one multiplier -1 is two: a 1:2 resonance, by scipy."""
    branch = jr.continue_(biased, "spin.speed", (0.8, 1.2), max_step=0.1)
    flip = branch.of("flip")[0]
    curve = jr.continue_curve(branch, flip, PLANE, SPANS, max_points=30, **STEPS)
    check_three(curve)
    for point in curve.of("1:2 resonance"):
        start = along_x(curve.orbit(point))
        speed = Duffing(0.0, 0.1, 1.0).critical(start, point.values[0], -1.0, speed=1.0)
        np.testing.assert_allclose(point.values, [speed, -0.2], rtol=1e-7)
    assert len(curve.of("1:2 resonance")) == 1


@pytest.mark.long
def test_neimark_sacker_curve_has_the_four_resonances(biased):
    """It is where damping is zero; there the trace of the derivative by the state tells the angle."""
    branch = jr.continue_(biased, "support.cxx", (-0.25, 0.1), direction="down", max_step=0.1)
    (point,) = branch.of("neimark-sacker")
    plane = "support.cxx", "unbalance.eccentricity"
    curve = jr.continue_curve(branch, point, plane, ((-0.25, 0.1), (0.1, 1.5)), max_step=0.1)
    np.testing.assert_allclose(curve.values[:, 0], -0.2, rtol=1e-7)
    inside = curve.side[1:-1]  # it has no side where it meets the curve of folds
    np.testing.assert_allclose(inside, [[1.0, 0.0]] * len(inside), atol=1e-5)
    check_three(curve)
    kinds = [f"1:{n} resonance" for n in (2, 3, 4, 1)]
    assert [one.kind for one in curve.points] == kinds
    for one, cosine in zip(curve.points, (-1.0, -0.5, 0.0, 1.0), strict=True):

        def residual(unknown, trace=2 * cosine):
            *state, eccentricity = unknown
            end, derivative = Duffing(0.0, 0.1, 1.0).back(state, eccentricity, 1.0)
            return [*(end - state), np.trace(derivative) - trace]

        exact = fsolve(residual, [*along_x(curve.orbit(one)), one.values[1]], xtol=1e-13)
        assert one.values[1] == pytest.approx(exact[2], rel=1e-7)
    assert all("resonance at support.cxx = -0." in reason for reason in curve.reasons)


# === contact


@pytest.fixture(scope="module")
def oscillator():
    """A mass that meets an undamped stop along x, continued in eccentricity."""
    scene = one_disc(speed=1.3, eccentricity=0.1235)
    orbit = jr.periodic(scene, jr.AtRest(), steps_per_revolution=200)
    stop = jr.Limiter(0.5, 0.0, gap=0.3, stiffness=20.0)
    free = dataclasses.replace(orbit, scene=scene.of_parts(*scene.effects, stop))  # not touched
    return jr.continue_(
        free, "unbalance.eccentricity", (0.12, 0.126), direction="up", max_points=12
    )


@pytest.mark.slow
def test_grazing_curve_of_the_impact_oscillator(oscillator):
    """`e Omega^2 = gap |k - m Omega^2 + i c Omega|`, at every point."""
    plane = "unbalance.eccentricity", "spin.speed"
    bounds = (0.02, 0.2), (0.8, 1.8)
    (point,) = oscillator.of("grazing")
    curve = jr.continue_curve(oscillator, point, plane, bounds, max_points=40, **STEPS)
    assert (curve.kind, curve.contact) == ("grazing", 0)
    eccentricity, speed = curve.values.T
    exact = 0.3 * np.abs(1 - speed**2 + 0.1j * speed) / speed**2
    np.testing.assert_allclose(eccentricity, exact, rtol=1e-8)
    assert curve.stable.all() and np.ptp(speed) > 0.5
    assert (curve.side[:, 0] < 0).all()  # less unbalance, no contact


# === refusals and pictures


@pytest.mark.slow
def test_refusals(resonance):
    fold = resonance.of("fold")[0]
    for how, sentence in (
        (
            (resonance, fold, "spin.speed", SPANS),
            "`paths` must be two different parameters, but is",
        ),
        ((resonance, fold, (PLANE[0],) * 2, SPANS), "`paths` must be two different parameters"),
        ((resonance, fold, PLANE, SPANS[:1]), "`bounds` must be a range"),
        (
            (resonance, fold, PLANE, ((0.5, 1.0), (0.0, 0.1))),
            "`bounds` must hold the orbit's own `spin",
        ),
    ):
        with pytest.raises(ValueError, match=sentence):
            jr.continue_curve(*how)
    crossing = dataclasses.replace(fold, kind="branching")
    with pytest.raises(ValueError, match="`point` must be a fold, .* but is a branching"):
        jr.continue_curve(resonance, crossing, PLANE, SPANS)


@pytest.mark.slow
def test_picture_alone_and_over_a_map(folds):
    ax = plot.curves(folds)
    names = ["spin speed [rad/s]", "support cxx [N s/m]"]
    assert [ax.get_xlabel(), ax.get_ylabel()] == names
    assert {text.get_text() for text in ax.texts} == {"cusp", "1:1 resonance"}
    solid = ax.get_lines()[0]
    assert solid.get_label() == "fold" and solid.get_linestyle() == "-"
    shown = np.isfinite(solid.get_xdata())
    assert shown.sum() == folds.stable.sum() + 1  # up to the first point of the other kind
    np.testing.assert_array_equal(solid.get_ydata()[shown], folds.values[shown, 1])
    _, over = plt.subplots()  # as a map has them, the other way round
    over.plot([-0.1, 0.05], [1.0, 1.2])
    over.set(xlabel=names[1], ylabel=names[0], xlim=(-0.1, 0.05), ylim=(1.0, 1.2))
    plot.curves([folds, folds], over)
    assert over.get_xlim() == (-0.1, 0.05) and over.get_ylim() == (1.0, 1.2)
    np.testing.assert_array_equal(over.get_lines()[1].get_xdata()[shown], folds.values[shown, 1])
    assert len(over.get_legend().get_texts()) == 1
    over.set_xlabel("support cyy [N s/m]")
    with pytest.raises(ValueError, match="`ax` must have the parameters of the curve, spin speed"):
        plot.curves(folds, over)
    with pytest.raises(ValueError, match="have the same two parameters, but these have none"):
        plot.curves([])
    plt.close("all")
