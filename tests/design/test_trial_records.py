"""Responses to trial masses, with constants besides: closed forms make the records."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr


K, M, C, PHASE = 8e5, 5.0, 60.0, 0.4  # [SI] of a disc in the middle of a massless shaft
ROTOR = jr.Scene(
    jr.MasslessShaft(1.0, 0.5, K),
    jr.Disc(0.5, M),
    jr.DiscDamping(0.5, C),
    jr.Unbalance(0.5, moment=1e-3, phase=PHASE),
    spin=jr.ConstantSpeed(380.0),
)
RANDOM = np.random.default_rng(2)
SPEEDS = RANDOM.uniform(350.0, 450.0, 24)
MASSES = 5e-4 * (RANDOM.normal(size=(24, 1)) + 1j * RANDOM.normal(size=(24, 1)))  # [kg m]
RECEPTANCE = SPEEDS**2 * np.exp(1j * PHASE) / (K - M * SPEEDS**2 + 1j * C * SPEEDS)
CLEAN = MASSES[:, 0] * RECEPTANCE
CONSTANT = 3e-3 - 1e-3j
SIGMA = 2e-5
SOUGHT = {
    "shaft.k11": (4e5, 1.6e6),
    "disc_damping.translational": (10.0, 300.0),
    "unbalance.phase": None,
}
TRUE = dict(zip(SOUGHT, (K, C, PHASE), strict=True))
GUESS = ROTOR.replace(
    {"shaft.k11": 7.5e5, "disc_damping.translational": 80.0, "unbalance.phase": 0.0}
)


def record(measured, **options):
    return jr.ResponseRecord(measured, SPEEDS, trials=MASSES, **options)


def test_a_prediction_has_the_masses_of_every_sample_at_angles_from_the_phase():
    np.testing.assert_allclose(record(CLEAN).prediction(ROTOR)[:, 0], CLEAN, rtol=1e-10)
    probed = record(CLEAN, angle=0.3).prediction(ROTOR)[:, 0]
    np.testing.assert_allclose(probed, CLEAN * np.exp(-0.3j), rtol=1e-10)


def test_a_fit_finds_the_rotor_beside_a_constant_and_leaves_what_the_mean_leaves():
    noise = SIGMA * (RANDOM.normal(size=24) + 1j * RANDOM.normal(size=24))
    fitted = jr.fit(GUESS, record(CLEAN + CONSTANT + noise, offset=True), SOUGHT, progress=False)
    for path, (low, high) in fitted.intervals(0.999).items():
        assert low < TRUE[path] < high
    left = np.asarray(fitted.residuals[0])[:, 0]
    predicted = np.asarray(record(CLEAN).prediction(fitted.scene))[:, 0]
    off = predicted - CLEAN - CONSTANT - noise
    np.testing.assert_allclose(left, off - off.mean(), atol=1e-12)
    freedom = 2 * 24 - 2 - 3  # real numbers, those of the constant and of the parameters
    np.testing.assert_allclose(
        fitted.noise[0], np.sqrt(np.sum(np.abs(left) ** 2) / freedom), rtol=1e-6
    )


def test_the_constant_is_one_unknown_more_in_values_and_covariance():
    """The same normal equations with two columns for the constant, at the minimum."""
    noise = SIGMA * (RANDOM.normal(size=24) + 1j * RANDOM.normal(size=24))
    measured = CLEAN + CONSTANT + noise
    fitted = jr.fit(GUESS, record(measured, offset=True), SOUGHT, progress=False)

    def predicted(x):
        receptance = SPEEDS**2 * jnp.exp(1j * x[2]) / (x[0] - M * SPEEDS**2 + 1j * x[1] * SPEEDS)
        return MASSES[:, 0] * receptance + x[3] + 1j * x[4]

    two = lambda x: jnp.concatenate(
        [(predicted(x) - measured).real, (predicted(x) - measured).imag]
    )
    found = np.array([float(value) for value in fitted.values.values()])
    rest = measured - np.asarray(predicted(np.array([*found, 0.0, 0.0])))
    x = np.array([*found, rest.mean().real, rest.mean().imag])
    slopes = np.asarray(jax.jacfwd(two)(x))
    assert np.all(np.abs(slopes.T @ two(x)) < 1e-4 * np.linalg.norm(slopes, axis=0) * SIGMA)
    units = np.linalg.norm(slopes, axis=0)
    inverse = np.linalg.inv((slopes / units).T @ (slopes / units)) / np.outer(units, units)
    np.testing.assert_allclose(fitted.covariance, fitted.noise[0] ** 2 * inverse[:3, :3], rtol=1e-5)


def test_a_diagnosis_takes_the_constant_off_what_it_compares():
    noise = SIGMA * (RANDOM.normal(size=24) + 1j * RANDOM.normal(size=24))
    seen = record(CLEAN + CONSTANT + noise, offset=True)
    causes = {"softer": (None, {"shaft.k11": SOUGHT["shaft.k11"]}), "nothing": (None, {})}
    common = {"disc_damping.translational": (10.0, 300.0), "unbalance.phase": (-1.0, 1.0)}
    found = jr.diagnose(seen, GUESS, causes, common, draws=8, starts=1, progress=False)
    assert found.cause == "softer"
    softer = found.explanations["softer"]
    assert abs(softer.values["shaft.k11"] - K) < 4 * softer.deviations["shaft.k11"]
    left = np.asarray(softer.residuals[0])
    assert left.shape == (24, 1) and abs(left.mean()) < 1e-12


def test_a_station_by_its_path_follows_the_parameter():
    shaft = jr.FlexibleShaft(1.0, 0.03, nodes=2)
    held = jr.Support(0.0, 1e6), jr.Support(1.0, 1e6)
    rotor = jr.Scene(
        shaft, jr.Disc(0.5, 4.0), jr.Disc(0.2, 0.0), jr.Unbalance(0.5, moment=1e-4), *held,
        spin=jr.ConstantSpeed(100.0),
    )  # fmt: skip
    moved = rotor.replace({"discs.1.at": 0.3})
    by_path = jr.unbalance_response(moved, 100.0, ["discs.1.at", 0.5])
    by_number = jr.unbalance_response(moved, 100.0, [0.3, 0.5])
    np.testing.assert_array_equal(by_path.stations, [0.3, 0.5])
    np.testing.assert_allclose(by_path.forward, by_number.forward, rtol=1e-12)
    np.testing.assert_array_equal(moved.stations("discs.1.at"), [0.3])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: jr.ResponseRecord(CLEAN, SPEEDS, trials=MASSES[:5]),
            "5 rows of them for 24 samples",
        ),
        (
            lambda: record(CLEAN, force=jr.HarmonicForce(0.5)),
            "24 samples of a response to a force",
        ),
        (lambda: record(np.abs(CLEAN), offset=True), "amplitudes with their phase"),
        (
            lambda: jr.fit(GUESS.without("unbalances"), record(CLEAN), {"shaft.k11": None}),
            "of which there are 0, but has 1",
        ),
    ],
)
def test_bad_trials_are_refused_in_one_sentence(make, message):
    with pytest.raises(ValueError, match=message):
        make()
