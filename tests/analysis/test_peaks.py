"""Peaks of the response to unbalance: a disc on a massless shaft, whose response has a closed form."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import jaxrotor as jr


OWN = 100.0  # [rad/s], of 10 kg on 1e5 N/m
ECCENTRICITY = 1e-4


def disc(ratio, *more):
    """A disc at half length of a massless shaft, with damping ratio `ratio`."""
    parts = [jr.Disc(0.3, 10.0), jr.Unbalance(0.3, 0.1, 0.01), *more]
    parts += [jr.DiscDamping(0.3, 2 * ratio * 10.0 * OWN, 0.0)]
    return jr.Scene(jr.MasslessShaft(0.6, 0.3, 1e5), *parts, spin=jr.ConstantSpeed(50.0))


def half_power(ratio):
    """Speeds at which `r^2 / |1 - r^2 + 2 i D r|` is 0.707 of its largest value: a quadratic in r^2."""
    height = np.sqrt(0.5) / (2 * ratio * np.sqrt(1 - ratio**2))
    squares = np.sort(np.roots([1 - 1 / height**2, 4 * ratio**2 - 2, 1]))
    return OWN * np.sqrt(squares[squares > 0])


@pytest.mark.parametrize("points", [30, 301])
@pytest.mark.parametrize("ratio", [0.003, 0.05, 0.2])
def test_amplification_factor_of_one_disc(ratio, points):
    found = jr.response_peaks(disc(ratio), np.linspace(10.0, 300.0, points))
    np.testing.assert_allclose(found.speeds, [OWN / np.sqrt(1 - 2 * ratio**2)], rtol=1e-9)
    largest = ECCENTRICITY / (2 * ratio * np.sqrt(1 - ratio**2))
    np.testing.assert_allclose(found.amplitudes, [largest], rtol=1e-12)
    lower, upper = half_power(ratio)
    np.testing.assert_allclose([*found.lower, *found.upper], [lower, upper], rtol=1e-9)
    expected = OWN / np.sqrt(1 - 2 * ratio**2) / (upper - lower)
    np.testing.assert_allclose(found.amplification, [expected], rtol=1e-7)
    if ratio < 0.1:  # of little damping it is 1 / (2 D)
        assert found.amplification[0] == pytest.approx(1 / (2 * ratio), rel=0.02)


def test_a_flat_peak_has_no_speed_of_half_power():
    """With D = 0.4 the amplitude never falls below the eccentricity, which is over 0.707 of the peak."""
    found = jr.response_peaks(disc(0.4), np.linspace(10.0, 300.0, 30))
    np.testing.assert_allclose(found.lower, [half_power(0.4)[0]], rtol=1e-9)
    assert np.isnan(found.upper).all() and np.isnan(found.amplification).all()
    assert found.amplification_at_most == pytest.approx(found.speeds / (300.0 - found.lower))
    margins = found.margins(200.0)  # a factor below 2.5 needs none
    assert margins.required.tolist() == [0.0] and margins.kept.all()


def test_margins_are_unknown_where_the_range_of_speeds_ends_at_a_peak():
    found = jr.response_peaks(disc(0.2), np.linspace(10.0, 115.0, 12))
    assert np.isnan(found.upper).all() and found.amplification_at_most > 3.5
    margins = found.margins(200.0)
    assert np.isnan(margins.required).all() and not margins.kept.any()


def on_supports(stiffness, damping):
    """A disc on supports, each axis with a stiffness [N/m] and damping [N s/m] of its own, two of each."""
    (kxx, kyy), (cxx, cyy) = np.array([stiffness, damping]) / 2  # at either end
    supports = [jr.Support(at, kxx=kxx, kyy=kyy, cxx=cxx, cyy=cyy) for at in (0.0, 0.6)]
    parts = [jr.Disc(0.3, 10.0, 0.1, 0.1), jr.Unbalance(0.3, 0.1, 0.01)]
    return jr.Scene(jr.RigidShaft(0.6), *parts, *supports, spin=jr.ConstantSpeed(50.0))


def ellipse(speed, stiffness, damping):
    """Major axis of `x = X cos, y = Y sin` of that disc."""
    push = 10.0 * ECCENTRICITY * speed**2
    both = zip(stiffness, damping, strict=True)
    x, y = (push / (k - 10.0 * speed**2 + 1j * c * speed) for k, c in both)
    return (abs(x + y) + abs(x - y)) / 2


def maxima(low, high, *axes):
    """Speeds and heights of all maxima of `ellipse`, by a million values of it."""
    speeds = np.linspace(low, high, 1_000_001)
    heights = ellipse(speeds, *axes)
    tops = 1 + np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] >= heights[2:]))
    return speeds[tops], heights[tops]


def test_peaks_of_an_ellipse():
    axes = (1e5, 2.25e5), (40.0, 40.0)
    scene = on_supports(*axes)
    major = lambda speed: ellipse(speed, *axes)
    found = jr.response_peaks(scene, np.linspace(10.0, 200.0, 41), at=0.3)
    assert found.speeds.size == 2
    for speed, lower, upper in zip(found.speeds, found.lower, found.upper, strict=True):
        best = minimize_scalar(
            lambda x: -major(x), bounds=(speed - 3, speed + 3), options={"xatol": 1e-9}
        )
        assert speed == pytest.approx(best.x, rel=1e-6)
        off = lambda x, top=-best.fun: major(x) - np.sqrt(0.5) * top
        assert lower == pytest.approx(brentq(off, speed - 5, speed), rel=1e-6)
        assert upper == pytest.approx(brentq(off, speed, speed + 5), rel=1e-6)


@pytest.mark.parametrize("points", [11, 96])  # 19 and 2 rad/s apart
def test_both_of_two_close_resonances_are_found(points):
    """Unequal supports by 2 %: peaks 1 rad/s apart, of which no speed that is given is between."""
    axes = (1e5, 1.02e5), (4.0, 4.0)
    found = jr.response_peaks(on_supports(*axes), np.linspace(10.0, 200.0, points), at=0.3)
    speeds, heights = maxima(95.0, 105.0, *axes)
    assert speeds.size == 2
    np.testing.assert_allclose(found.speeds, speeds, atol=1e-5)
    np.testing.assert_allclose(found.amplitudes, heights, rtol=1e-9)


@pytest.mark.parametrize("points", [11, 96])
@pytest.mark.parametrize("damping", [(0.0, 4.0), (4.0, 0.0)])
def test_a_peak_beside_an_undamped_critical_speed_is_found(damping, points):
    """Along one axis `m e W^2 / |k - m W^2|` is unbounded, 1 rad/s beside the peak along the other."""
    axes = (1e5, 1.02e5), damping
    found = jr.response_peaks(on_supports(*axes), np.linspace(10.0, 200.0, points), at=0.3)
    sharp = np.sqrt(axes[0][damping.index(0.0)] / 10.0)
    beside = (sharp + 0.2, 105.0) if damping[0] == 0.0 else (95.0, sharp - 0.2)
    (damped,), (height,) = maxima(*beside, *axes)
    expected = sorted([(sharp, np.inf), (damped, height)])
    np.testing.assert_allclose(found.speeds, [speed for speed, _ in expected], atol=1e-5)
    np.testing.assert_allclose(found.amplitudes, [top for _, top in expected], rtol=1e-9)


@pytest.mark.parametrize("second", [110.0, 112.0, 118.0, 125.0])
def test_of_two_maxima_between_neighbouring_speeds_the_higher_one_is_found(second):
    """The range begins between the first critical speed, 100 rad/s, and its peak, of 0.4 of the height.

    From there to `second` the slope changes its sign three times; where it is found to first depends on
    the ends.
    """
    axes = (1e5, 1.15e5), (50.0, 20.0)
    speeds, heights = maxima(100.1, second, *axes)
    assert speeds.size == 2 and 2 * heights[0] < heights[1]
    found = jr.response_peaks(on_supports(*axes), [100.1, second, second + 10.0], at=0.3)
    np.testing.assert_allclose(found.speeds, speeds[1:], atol=2e-5)
    np.testing.assert_allclose(found.amplitudes, heights[1:], rtol=1e-9)


def test_peaks_without_damping_are_infinite():
    scene = disc(0.0)
    found = jr.response_peaks(scene, np.linspace(10.0, 300.0, 30))
    np.testing.assert_allclose(found.speeds, [OWN])
    assert np.isinf(found.amplitudes).all() and np.isinf(found.amplification).all()
    np.testing.assert_allclose(found.margins(150.0).required, [0.16])
    np.testing.assert_allclose(found.margins(80.0).required, [0.26])


def test_a_peak_without_damping_is_infinite_where_the_critical_speed_is_rounded():
    """`sqrt(2e5 / 3)` is no float, so no dynamic stiffness is zero."""
    parts = jr.Disc(0.3, 3.0), jr.Unbalance(0.3, 0.1, 0.01), jr.DiscDamping(0.3, 0.0, 0.0)
    scene = jr.Scene(jr.MasslessShaft(0.6, 0.3, 2e5), *parts, spin=jr.ConstantSpeed(50.0))
    found = jr.response_peaks(scene, np.linspace(10.0, 300.0, 30))
    np.testing.assert_allclose(found.speeds, [np.sqrt(2e5 / 3)], rtol=1e-14)
    assert np.isinf(found.amplitudes).all() and np.isinf(found.amplification).all()


def peaks_of(speeds, factors):
    """Peaks with given amplification factors."""
    speeds = np.array(speeds)
    width = speeds / np.array(factors)
    scene = disc(0.05)
    response, critical = jr.unbalance_response(scene, [50.0]), jr.critical_speeds(scene)
    return jr.ResponsePeaks(
        response, critical, speeds, np.ones(speeds.size), speeds - width / 2, speeds + width / 2
    )


def test_margins_worked_by_hand():
    """A machine that runs from 300 to 400 rad/s; factors 10, 2.4, 50, 3.5 and 10 of five peaks.

    17 (1 - 1/8.5) = 15.0 below and 25.0 above; none; 16.65, of which 16 suffice; 8.5, above 18.5.
    """
    peaks = peaks_of([240.0, 260.0, 270.0, 470.0, 520.0], [10.0, 2.4, 50.0, 3.5, 10.0])
    found = peaks.margins(300.0, 400.0)
    np.testing.assert_allclose(found.required, [0.15, 0.0, 0.16, 0.185, 0.25])
    np.testing.assert_allclose(found.actual, [0.2, 40 / 300, 0.1, 0.175, 0.3])
    assert found.kept.tolist() == [True, True, False, False, True]
    within = peaks_of([350.0], [10.0]).margins(300.0, 400.0)
    assert within.actual.tolist() == [0.0] and not within.kept.any()
    assert "amplification" in peaks._repr_html_()


def test_reading_of_a_probe():
    """`Re(exp(-i psi) z)` of the orbit at any time."""
    forward, backward = jnp.array([[1e-3 + 2e-3j]]), jnp.array([[-4e-4 + 1e-3j]])
    one = jnp.ones(1)
    found = jr.HarmonicResponse(one, one, one, forward, backward, None)
    for angle, turn in ((0.0, 0.3), (np.pi / 2, 1.0), (0.7, 2.5)):
        orbit = forward * np.exp(1j * turn) + backward * np.exp(-1j * turn)
        expected = np.real(np.exp(-1j * angle) * orbit)
        reading = np.real(found.probe(angle) * np.exp(1j * turn))
        np.testing.assert_allclose(reading, expected, rtol=1e-12)


@pytest.mark.parametrize(
    "speeds, at, sentence",
    [
        ([1.0, 2.0], None, "three or more"),
        ([1.0, 3.0, 2.0], None, "ascending"),
        ([1.0, 2.0, 3.0], [0.3, 0.3], "one station"),
    ],
)
def test_refusals(speeds, at, sentence):
    with pytest.raises(ValueError, match=sentence):
        jr.response_peaks(disc(0.05), speeds, at)


@pytest.mark.parametrize("ends", [(0.0, 10.0), (20.0, 10.0), (-5.0, 10.0), (np.inf, None)])
def test_operating_speeds_are_checked(ends):
    with pytest.raises(ValueError, match="Operating speeds"):
        peaks_of([100.0], [10.0]).margins(*ends)
