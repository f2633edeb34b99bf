"""Draws, shares, means, Sobol indices, and functions over draws: against closed forms."""

import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import jaxrotor as jr


sys.path.insert(0, str(Path(__file__).parents[2] / "notebooks"))
from designs import tolerances  # noqa: E402


SPREAD = {"disc.mass": (4.0, 6.0), "shaft.k11": stats.norm(8e5, 2e4)}
POINT = jr.Scene(jr.MasslessShaft(1.0, 0.5, 8e5), jr.Disc(0.5, 5.0), spin=jr.ConstantSpeed(100.0))


def whirl(scene):
    """`sqrt(k / m)` [rad/s]."""
    return jnp.abs(jr.roots(scene, 1)[0].imag)


def test_draws_are_of_their_distributions():
    """By the distance of Kolmogorov and Smirnov; the same seed gives the same draws."""
    found = jr.draws(SPREAD, 2000, seed=3)
    assert list(found) == list(SPREAD)
    again, other = jr.draws(SPREAD, 2000, seed=3), jr.draws(SPREAD, 2000, seed=4)
    for path, one in (("disc.mass", stats.uniform(4.0, 2.0)), ("shaft.k11", SPREAD["shaft.k11"])):
        assert stats.kstest(found[path], one.cdf).pvalue > 1e-3
        np.testing.assert_array_equal(found[path], again[path])
        assert not np.any(found[path] == other[path])
    assert abs(np.corrcoef(*found.values())[0, 1]) < 0.1


def test_replicates_fill_evenly():
    """Each of 8 sequences of 32 draws has one in every 32nd part, and the sequences differ."""
    mass = jr.draws({"disc.mass": (4.0, 6.0), "disc.polar": (0.0, 1.0)}, 256, replicates=8)[
        "disc.mass"
    ]
    parts = np.floor((mass.reshape(8, 32) - 4.0) / 2.0 * 32).astype(int)
    assert (np.sort(parts, axis=1) == np.arange(32)).all()
    assert len(np.unique(mass)) == 256


def test_mean_by_evenly_spread_draws():
    """Of `x^2 + y` over the unit square, 1/3 + 1/2, within bounds that are 20 times as close."""
    square = {"x": (0.0, 1.0), "y": (0.0, 1.0)}
    of = lambda found: found["x"] ** 2 + found["y"]
    plain = jr.expectation(of(jr.draws(square, 4096)))
    even = jr.expectation(of(jr.draws(square, 4096, replicates=16)), replicates=16)
    for one in (plain, even):
        assert one.low < 5 / 6 < one.high and one.draws == 4096
    assert even.high - even.low < (plain.high - plain.low) / 20


def test_bounds_of_a_share():
    """Exact where an event is never or always seen, and in a table of Clopper and Pearson."""
    never = jr.probability(np.zeros(3000, bool))
    assert (never.value, never.low) == (0.0, 0.0)
    assert never.high == pytest.approx(1 - 0.025 ** (1 / 3000), rel=1e-12)
    assert jr.probability(np.ones(50, bool)).low == pytest.approx(0.025 ** (1 / 50), rel=1e-12)
    some = jr.probability(np.arange(20) < 4)
    assert (some.low, some.high) == pytest.approx((0.057334, 0.436614), abs=1e-6)
    assert str(some) == "0.2 (0.0573 to 0.437 with 95 % confidence, 20 draws)"


def test_bounds_hold_as_often_as_they_say():
    """In 500 experiments and more: 93 to 97 % of means, at least 93 % of shares."""
    random = np.random.default_rng(5)
    values = random.normal(2.0, 3.0, (500, 40))
    means = [jr.expectation(row) for row in values]
    held = np.mean([one.low < 2.0 < one.high for one in means])
    assert 0.93 <= held <= 0.97
    shares = [jr.probability(row) for row in random.random((500, 200)) < 0.07]
    assert np.mean([one.low < 0.07 < one.high for one in shares]) >= 0.93
    rare = [jr.probability(row) for row in random.random((500, 2000)) < 1e-3]
    assert np.mean([one.low <= 1e-3 <= one.high for one in rare]) >= 0.93
    rows = random.normal(2.0, 3.0, (2000, 16 * 20))
    means = [jr.expectation(row, replicates=16) for row in rows]
    assert 0.93 <= np.mean([one.low < 2.0 < one.high for one in means]) <= 0.97


def ishigami(found):
    a, b, c = found.values()
    return jnp.sin(a) + 7 * jnp.sin(b) ** 2 + 0.1 * c**4 * jnp.sin(a)


def test_sobol_indices_of_a_known_function():
    """Ishigami and Homma (1990): 0.3139, 0.4424, 0; with interactions 0.5576, 0.4424, 0.2437."""
    cube = {name: (-np.pi, np.pi) for name in "abc"}
    found = jr.sensitivities(ishigami, cube, 4096)
    np.testing.assert_allclose(found["first"], [0.3139, 0.4424, 0.0], atol=0.02)
    np.testing.assert_allclose(found["total"], [0.5576, 0.4424, 0.2437], atol=0.02)
    assert (found["first_low"] <= found["first"]).all()
    assert (found["total_high"] >= found["total"]).all()
    assert found.identical(jr.sensitivities(ishigami, cube, 4096))
    assert jr.plot.sensitivities(found).get_yticklabels()[-1].get_text() == "a"


def test_over_draws_of_a_frequency():
    """`sqrt(k (1 + d) / m (1 + e))` of every draw, its mean and quantile with their derivatives."""
    deviations = jr.draws({"disc.mass": (-0.1, 0.1), "shaft.k11": stats.norm(0, 0.02)}, 64, seed=1)
    whirls = jr.over_draws(whirl, deviations, relative=True)
    ratio = (1 + deviations["shaft.k11"]) / (1 + deviations["disc.mass"])
    np.testing.assert_allclose(whirls(POINT), np.sqrt(8e5 / 5.0 * ratio), rtol=1e-12)
    for of in (jnp.mean, lambda values: jnp.quantile(values, 0.05)):
        at = jax.jit(lambda mass, of=of: of(whirls(POINT.replace({"disc.mass": mass}))))
        expected = (at(5.0 + 1e-4) - at(5.0 - 1e-4)) / 2e-4
        assert float(jax.grad(at)(5.0)) == pytest.approx(float(expected), rel=1e-7)
    moved = jr.over_draws(whirl, {"disc.mass": [0.0, 1.0]})
    np.testing.assert_allclose(moved(POINT), np.sqrt(8e5 / np.array([5.0, 6.0])), rtol=1e-12)


def test_a_quantile_is_tuned():
    """The mass at which 95 % of machines whirl below 380 rad/s: closed form by the same draws."""
    deviations = jr.draws({"shaft.k11": stats.norm(0, 0.02)}, 128)
    whirls = jr.over_draws(whirl, deviations, relative=True)
    loss = lambda scene: (jnp.quantile(whirls(scene), 0.95) - 380.0) ** 2
    tuned = jr.tune(loss, POINT, {"disc.mass": (3.0, 8.0)}, steps=40, progress=False)
    stiff = np.quantile(np.sqrt(8e5 * (1 + deviations["shaft.k11"])), 0.95)
    assert float(tuned.values["disc.mass"]) == pytest.approx((stiff / 380.0) ** 2, rel=1e-5)


def test_correlated_draws():
    """Spearman's correlation of a Gaussian copula is `6 / pi asin(r / 2)`; every draw keeps its law."""
    spread = SPREAD | {"disc.polar": (0.0, 1.0)}
    pair = ("disc.mass", "shaft.k11")
    found = jr.draws(spread, 20_000, seed=3, correlations={pair: -0.6})
    expected = 6 / np.pi * np.arcsin(-0.3)
    seen = stats.spearmanr(np.stack(list(found.values())).T).statistic
    assert seen[0, 1] == pytest.approx(expected, abs=0.02) and np.abs(seen[2, :2]).max() < 0.02
    assert stats.kstest(found["disc.mass"], stats.uniform(4.0, 2.0).cdf).pvalue > 1e-3
    assert stats.kstest(found["shaft.k11"], SPREAD["shaft.k11"].cdf).pvalue > 1e-3
    even = jr.draws(spread, 512, replicates=4, correlations={pair: -0.6})
    seen = stats.spearmanr(even["disc.mass"], even["shaft.k11"]).statistic
    assert seen == pytest.approx(expected, abs=0.03)


def test_a_smoothed_probability_states_its_bias():
    """Of a normal y: `Phi(t / sqrt(1 + h^2))` instead of `Phi(t)`; the derivative is that of the draws."""
    y = jnp.asarray(stats.norm.ppf((np.arange(4000) + 0.5) / 4000))
    for limit, width in ((1.0, 0.3), (1.6, 0.2), (-0.5, 0.1)):
        found = jr.exceedance(y, limit, width)
        blurred, true = stats.norm.sf(limit / np.sqrt(1 + width**2)), stats.norm.sf(limit)
        assert float(found.value) == pytest.approx(blurred, abs=2e-5)
        assert float(found.bias) == pytest.approx(blurred - true, rel=0.15)
        of = lambda shift, limit=limit, width=width: jr.exceedance(y + shift, limit, width).value
        slope = (of(1e-4) - of(-1e-4)) / 2e-4
        assert float(jax.grad(of)(0.0)) == pytest.approx(float(slope), rel=1e-7)
    with pytest.raises(ValueError, match="`width` must be positive, but is 0"):
        jr.exceedance(y, 1.0, 0.0)


def test_a_probability_is_tuned():
    """The mass for which 5 % of machines whirl above 380 rad/s, `k` being normal: closed form."""
    even = {"shaft.k11": 0.02 * stats.norm.ppf((np.arange(512) + 0.5) / 512)}
    whirls = jr.over_draws(whirl, even, relative=True)
    loss = lambda scene: jnp.log(jr.exceedance(whirls(scene), 380.0, 0.4).value / 0.05) ** 2
    start = POINT.replace({"disc.mass": 5.6})
    tuned = jr.tune(loss, start, {"disc.mass": (5.2, 6.2)}, steps=40, progress=False)
    mass = 8e5 * (1 + 0.02 * stats.norm.ppf(0.95)) / 380.0**2
    assert float(tuned.values["disc.mass"]) == pytest.approx(mass, rel=5e-4)


@pytest.mark.long
def test_designed_stops_within_their_tolerances():
    """None of 64 machines and releases ends backward, of which more than half do between other stops."""
    published = jr.load("limiter-rotor")
    draws = jr.draws(tolerances.spread(published), 64, seed=2)
    assert jr.probability(tolerances.backward(tolerances.ends(published, draws, 150))).low > 0.5
    designed = published.replace(tolerances.DESIGNED)
    draws = jr.draws(tolerances.spread(designed), 64, seed=2)
    after = jr.probability(tolerances.backward(tolerances.ends(designed, draws, 150)))
    assert after.value == 0.0 and after.high < 0.06


def test_refusals():
    for spread, words in (
        ({}, "`spread` must name at least one"),
        ({"disc.mass": (2.0, 1.0)}, "must be a pair"),
        ({"disc.mass": stats.norm(np.nan, 1.0)}, "does not give a finite number"),
    ):
        with pytest.raises(ValueError, match=words):
            jr.draws(spread, 8)
    with pytest.raises(ValueError, match="`count` must be `replicates` times a power of two"):
        jr.draws(SPREAD, 36, replicates=3)
    with pytest.raises(ValueError, match="10 draws are not the same number in each of 3"):
        jr.draws(SPREAD, 10, replicates=3)
    for spread in ("uniform", stats.norm, (0.0, np.inf)):
        with pytest.raises(ValueError, match=r"`spread\['disc.mass'\]` must be a pair"):
            jr.draws({"disc.mass": spread}, 8)
    with pytest.raises(ValueError, match="must be one distribution, but its parameters are lists"):
        jr.draws({"disc.mass": stats.norm([0.0, 1.0], 1.0)}, 8)
    for pair, value, words in (
        (("disc.mass", "disc.polar"), 0.5, "must be a number between -1 and 1 for two paths"),
        (("disc.mass", "shaft.k11"), 1.0, "must be a number between -1 and 1 for two paths"),
    ):
        with pytest.raises(ValueError, match=words):
            jr.draws(SPREAD, 8, correlations={pair: value})
    three = {name: (0.0, 1.0) for name in "abc"}
    apart = {("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9}
    with pytest.raises(ValueError, match="No parameters have these `correlations` together"):
        jr.draws(three, 8, correlations=apart)
    with pytest.raises(ValueError, match="`happened` must be true or false"):
        jr.probability([0.0, 1.0])
    with pytest.raises(ValueError, match="`happened` is empty"):
        jr.probability([])
    with pytest.raises(ValueError, match="`confidence` must be between 0 and 1"):
        jr.probability([True], confidence=95.0)
    with pytest.raises(ValueError, match="must be finite, but 1 of 3 are not"):
        jr.expectation([1.0, np.nan, 2.0])
    with pytest.raises(ValueError, match="`values` must be at least two numbers, but there are 1"):
        jr.expectation([1.0])
    with pytest.raises(ValueError, match="`count` must be a power of two from 2 on, but is 100"):
        jr.sensitivities(ishigami, SPREAD, 100)
    with pytest.raises(ValueError, match="one number for each of 8 draws, but gives an array"):
        jr.sensitivities(lambda found: 1.0, SPREAD, 8)
    with pytest.raises(ValueError, match="the same for every draw"):
        jr.sensitivities(lambda found: 0 * found["disc.mass"], SPREAD, 8)
    with pytest.raises(ValueError, match="8 of 8 values are not"):
        jr.sensitivities(lambda found: np.nan * found["disc.mass"], SPREAD, 8)
    with pytest.raises(ValueError, match="one parameter, which makes all of the variance"):
        jr.sensitivities(ishigami, {"disc.mass": (1.0, 2.0)}, 8)
    for deviations in ({"disc.mass": [0.0], "shaft.k11": [0.0, 1.0]}, {"disc.mass": 0.1}):
        with pytest.raises(ValueError, match="must be a list of draws for every path"):
            jr.over_draws(whirl, deviations)
    with pytest.raises(ValueError, match="has no `first` and `total`"):
        jr.plot.sensitivities(
            jr.sensitivities(ishigami, {n: (0.0, 1.0) for n in "abc"}, 4)[["first"]]
        )
