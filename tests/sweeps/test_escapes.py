"""Escapes: rates and shares against known distributions, reversals of known motions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

import jaxrotor as jr
import jaxrotor.plot
from jaxrotor.sweeps.observe import Reversal, Turn


def drawn(rate, lanes, kept, ensembles=1):
    """A sweep whose lanes escape with one rate, whatever their age."""
    times = np.random.default_rng(0).exponential(1 / rate, (ensembles, lanes))
    times = np.where(times < kept, times, np.nan)
    dims = ("unbalance.eccentricity", "start.angle")
    variables = {
        "reversal": (dims, times),
        "reversal_watched": (dims, np.full(times.shape, kept)),
        "status": (dims, np.zeros(times.shape, np.int8)),
    }
    coords = {dims[0]: np.arange(1.0 * ensembles), dims[1]: np.linspace(0, 1, lanes)}
    return xr.Dataset(variables, coords, {"settle": 0, "keep": kept})


def test_rate_and_survival_of_an_exponential_law():
    found = jr.escapes(drawn(0.01, 20_000, 300))
    rate = float(found["rate"][0])
    assert rate == pytest.approx(0.01, rel=0.03)
    assert found["rate_low"] < 0.01 < found["rate_high"]
    # half the width of the interval is 1.96 / root of the count
    width = float((found["rate_high"] - found["rate_low"])[0]) / 2 / rate
    assert width == pytest.approx(1.96 / np.sqrt(float(found["escaped"][0])), rel=0.01)
    law = np.exp(-0.01 * found["revolution"].values)
    inside = (found["survival_low"][0] <= law) & (law <= found["survival_high"][0])
    assert inside.mean() > 0.9


def test_bounds_hold_as_often_as_they_say():
    """Coverage over 4000 ensembles of 30 lanes; exact bounds of a count may be wider, not narrower."""
    ensembles = drawn(0.01, 30, 60, 4000)
    for confidence in (0.95, 0.9):
        found = jr.escapes(ensembles, confidence=confidence)
        held = (found["rate_low"] < 0.01) & (found["rate_high"] > 0.01)
        assert confidence - 0.01 < float(held.mean()) < confidence + 0.03


def test_rate_after_a_first_transient():
    """Lanes that leave at once say nothing of the rate later on."""
    dataset = drawn(0.01, 20_000, 300)
    dataset["reversal"][0, ::2] = 3.0
    assert float(jr.escapes(dataset)["rate"][0]) > 0.015
    late = jr.escapes(dataset, after=20)
    assert float(late["rate"][0]) == pytest.approx(0.01, rel=0.04)
    assert float(late["survival"][0, 3]) == pytest.approx(0.5, abs=0.02)


def test_no_escape_has_a_bound_all_the_same():
    """The bound is about three over the survived revolutions, at 95 % of one side."""
    dataset = drawn(0.01, 100, 50)
    dataset["reversal"][:] = np.nan
    dataset["status"][0, :20] = 1  # not finite
    found = jr.escapes(dataset, confidence=0.9)
    assert float(found["rate"][0]) == 0 == float(found["rate_low"][0])
    assert float(found["rate_high"][0]) == pytest.approx(-np.log(0.05) / (80 * 50), rel=1e-6)
    assert int(found["failed"][0]) == 20 and int(found["lanes"][0]) == 80


@pytest.mark.parametrize("s", [1.0, -1.0])
def test_reversal_of_a_known_whirl(s):
    """Along the spin the whirl is forward, briefly backward, and backward for good from revolution 7."""
    observable, count, steps = Reversal(window=3), 12, 16
    rates = s * np.array([1, 1, -1, -1, 1, 1, 1, -1, -1, -1, -1, -1.0])
    carry = observable.start(0)
    for number, rate in enumerate(rates):
        z = jnp.exp(1j * rate * jnp.linspace(0, 1, steps + 1))
        one = jnp.asarray(1.0 / steps)
        turn = Turn(z, 1j * rate * z, None, jnp.asarray(number), one, jnp.asarray(s), count)
        carry, _ = observable.update(carry, turn)
    carry = [np.asarray(leaf)[None] for leaf in carry]
    found = observable.report(carry, None, count)
    assert found["reversal"].values == [7.0] and found["reversal_watched"].values == [10]


def test_reversals_that_could_not_be_seen_are_not_counted_as_survived():
    """Areas change sign at a known rate; the window of the observable is half of the run."""
    observable, count, rate = Reversal(window=50), 100, 0.02
    times = np.random.default_rng(0).geometric(rate, 4000) - 1  # revolutions before
    carry = observable.start(0)
    carry = tuple(np.broadcast_to(leaf, times.shape) for leaf in carry)

    @jax.jit
    def update(carry, sign, number):
        def one(carry, sign):
            z = jnp.exp(1j * sign * jnp.linspace(0, 1, 9))
            more = jnp.asarray(0.1), jnp.asarray(1.0), count
            return observable.update(carry, Turn(z, 1j * sign * z, None, number, *more))[0]

        return jax.vmap(one)(carry, sign)

    for number in range(count):
        carry = update(carry, jnp.where(number < times, 1.0, -1.0), jnp.asarray(number))
    report = observable.report(carry, None, count)
    dims, shape = ("unbalance.eccentricity", "start.angle"), (1, times.size)
    variables = {name: (dims, one.values.reshape(shape)) for name, one in report.items()}
    variables["status"] = (dims, np.zeros(shape, np.int8))
    found = jr.escapes(xr.Dataset(variables, attrs={"settle": 0, "keep": count}))
    # For a geometric law, escapes over survived revolutions are close to its probability.
    assert found["rate_low"] < -np.log(1 - rate) * 1.02 and found["rate_high"] > rate
    assert found["revolution"][-1] == 51


@pytest.mark.slow
def test_chaotic_forward_motion_escapes_sooner_with_more_unbalance():
    """Section 3.5: above 0.0009 of the length some last for 1000 revolutions, hardly any for 3000.

    So the rate is between 1e-3 and 5e-3 of a revolution; below they last.
    """
    over = {"unbalance.eccentricity": 0.7 * np.array([2e-4, 1.4e-3])}
    over["start.angle"] = np.linspace(0.0, 6.0, 32)
    how = {"start": jr.Whirl(7e-3, rate=75.0), "settle": 0, "keep": 400, "observe": [Reversal()]}
    how |= {"steps_per_revolution": 64, "error_sample": 0}
    dataset = jr.sweep(jr.load("limiter-rotor"), over, **how)
    found = jr.escapes(dataset, after=50)
    slow, fast = found["rate"].values
    assert 1e-3 < fast < 5e-3 and slow < 1e-4
    assert found["rate_high"][0] < found["rate_low"][1]


@pytest.mark.parametrize(
    ("change", "given", "words"),
    [
        (lambda d: d.drop_vars("reversal"), {}, "no `reversal`; run the sweep with"),
        (lambda d: d.assign_attrs(settle=5), {}, "did not watch its first 5 revolutions"),
        (
            lambda d: d,
            {"after": 300},
            "`after` must be at least 0 and below the 300 revolutions in which",
        ),
        (lambda d: d, {"confidence": 1.0}, "`confidence` must be between 0 and 1"),
        (lambda d: d, {"over": "start.rate"}, "`over` must name dimensions of the ensemble"),
    ],
)
def test_refusals(change, given, words):
    with pytest.raises(ValueError, match=words):
        jr.escapes(change(drawn(0.01, 10, 300)), **given)


def test_picture():
    found = jr.escapes(drawn(0.01, 200, 300, 3), after=20)
    left, right = jr.plot.escapes(found)
    assert left.get_xlabel() == "revolutions [1]" and left.get_yscale() == "log"
    assert left.get_ylabel() == "surviving share [1]"
    assert right.get_ylabel() == "rate of escape [1/revolution]"
