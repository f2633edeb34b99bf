"""Influence coefficients fitted to runs: closed forms, `numpy.linalg.lstsq`, and what circles cover."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr


RANDOM = np.random.default_rng(3)
gauss = lambda *shape, random=RANDOM: random.normal(size=shape) + 1j * random.normal(size=shape)
TRUE, OFFSET = gauss(3, 2), gauss(3)  # of three readings and two planes
MASSES = np.concatenate([np.zeros((2, 2)), gauss(10, 2)])
SCATTER = RANDOM.uniform(0.5, 2.0, (12, 3))


def readings(noise, masses=MASSES):
    return masses @ TRUE.T + OFFSET + noise


def test_a_base_run_and_one_trial_a_plane_are_the_classic_coefficients():
    masses = np.array([[0, 0], [0.3j, 0], [0, 0.2 + 0.1j]])
    runs = readings(0.1 * gauss(3, 3), masses)
    fitted = jr.fitted_influence(masses, runs, scatter=0.1)
    classic = jr.influence_coefficients(runs[0], np.array([0.3j, 0.2 + 0.1j]), runs[1:])
    np.testing.assert_allclose(fitted.coefficients, classic, rtol=1e-12)
    np.testing.assert_allclose(fitted.offset[:, 0], runs[0], rtol=1e-12)
    # A = (v1 - v0) / t: twice the variance of a reading over |t|^2
    np.testing.assert_allclose(fitted.covariance[:, 0, 0], 2 * 0.1**2 / 0.3**2, rtol=1e-12)
    assert fitted.freedom == np.inf and not np.isfinite(np.asarray(fitted.misfit)).any()
    untold = jr.fitted_influence(masses, runs)  # as many runs as coefficients and offset
    with pytest.raises(ValueError, match="leave nothing that tells the noise"):
        untold.correction(runs[0]).radius()


def test_weighted_runs_of_two_sessions_are_those_of_lstsq():
    sessions = ["monday"] * 7 + ["tuesday"] * 5
    runs = (
        readings(SCATTER * gauss(12, 3))
        + 5 * np.array([name == "tuesday" for name in sessions])[:, None]
    )
    fitted = jr.fitted_influence(MASSES, runs, scatter=SCATTER, offset=sessions)
    flags = np.array([[name == "monday", name == "tuesday"] for name in sessions])
    rows = np.concatenate([MASSES, flags], axis=1)
    for k in range(3):
        weighted, v = rows / SCATTER[:, k, None], runs[:, k] / SCATTER[:, k]
        by_numpy, squares, *_ = np.linalg.lstsq(weighted, v, rcond=None)
        own = np.append(fitted.coefficients[k], fitted.offset[k])
        np.testing.assert_allclose(own, by_numpy, rtol=1e-10)
        inverse = np.linalg.inv(weighted.conj().T @ weighted)
        np.testing.assert_allclose(fitted.covariance[k], inverse, rtol=1e-9)
        np.testing.assert_allclose(fitted.misfit[k] ** 2, squares[0] / 8, rtol=1e-10)
    given = np.array([0.2, 1j])
    np.testing.assert_allclose(
        fitted.predict(given, "tuesday"), fitted.coefficients @ given + fitted.offset[:, 1]
    )


def test_without_scatter_the_noise_is_that_of_the_residuals():
    runs = readings(gauss(12, 3) @ gauss(3, 3))
    fitted = jr.fitted_influence(MASSES, runs)
    rows = np.concatenate([MASSES, np.ones((12, 1))], axis=1)
    left = runs - rows @ np.linalg.lstsq(rows, runs, rcond=None)[0]
    np.testing.assert_allclose(fitted.noise, left.T @ left.conj() / 9, rtol=1e-9)
    inverse = np.linalg.inv(rows.conj().T @ rows)
    for k in range(3):
        np.testing.assert_allclose(fitted.covariance[k], fitted.noise[k, k] * inverse, rtol=1e-9)


def test_a_ridge_solves_its_normal_equations():
    runs, ridge = readings(gauss(12, 3)), 0.1
    fitted = jr.fitted_influence(MASSES, runs, ridge=ridge)
    rows = np.concatenate([MASSES, np.ones((12, 1))], axis=1)
    drawn = np.diag([*(ridge * np.sum(np.abs(MASSES) ** 2, axis=0)), 0.0])
    by_hand = np.linalg.solve(rows.conj().T @ rows + drawn, rows.conj().T @ runs)
    np.testing.assert_allclose(fitted.coefficients, by_hand[:2].T, rtol=1e-10)
    alike = np.stack([MASSES[:, 0], MASSES[:, 0]], axis=1)  # both planes always have the same mass
    one = jr.fitted_influence(alike, runs, ridge=1e-6).coefficients
    np.testing.assert_allclose(one[:, 0], one[:, 1], rtol=1e-6)


@pytest.mark.parametrize("scatter", [None, 0.3], ids=["found", "given"])
def test_circles_contain_unbalance_and_remaining_vibration_as_often_as_they_say(scatter):
    """1000 campaigns of 12 runs with noise that two readings share where it is found."""
    random = np.random.default_rng(5)
    noise = 0.3 * gauss(1000, 14, 3, random=random) / np.sqrt(2)
    if scatter is None:
        noise[..., 1] = 0.8 * noise[..., 0] + 0.6 * noise[..., 1]
    unknown = np.array([0.8 - 0.3j, -0.5 + 1j])
    runs = noise[:, :12] + readings(0.0)
    seen, before = noise[:, 12] + OFFSET + TRUE @ unknown, noise[:, 13] + TRUE @ unknown
    after = random.permutation(noise[:, 0])

    def campaign(runs, seen, before):
        fitted = jr.fitted_influence(MASSES, runs, scatter=scatter)
        estimate, correction = fitted.estimate(seen), fitted.correction(before)
        true = TRUE @ (correction.masses + unknown)
        return (
            jnp.abs(estimate.value - unknown) / estimate.radius(0.9),
            (true - correction.vibration, correction.radius(0.9)),
        )

    share, (off, radius) = jax.jit(jax.vmap(campaign))(runs, seen, before)
    assert np.all(np.abs(np.mean(share < 1, axis=0) - 0.9) < 0.03)
    inside = np.abs(np.asarray(off) + after) < np.asarray(radius)
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.9) < 0.03)


def test_an_estimate_finds_the_masses_of_exact_readings_and_differentiates():
    fitted = jr.fitted_influence(MASSES, readings(0.0), scatter=0.1, offset=[7] * 12)
    told = fitted.estimate(readings(0.0)[5], session=7)
    np.testing.assert_allclose(told.value, MASSES[5], rtol=1e-9)
    by_hand = np.linalg.inv(TRUE.conj().T @ TRUE) * 0.1**2
    assert np.all(np.diag(told.covariance).real > np.diag(by_hand).real)
    size = lambda k: jnp.sum(jr.fitted_influence(MASSES, k * readings(0.0)).coefficients.real)
    np.testing.assert_allclose(jax.grad(size)(1.0), np.sum(TRUE.real), rtol=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: jr.fitted_influence(MASSES[:, 0], readings(0.0)), "a row for every run"),
        (lambda: jr.fitted_influence(MASSES[:3], readings(0.0)), "as many runs"),
        (lambda: jr.fitted_influence(MASSES, readings(0.0), ridge=-1.0), "negative, but is -1"),
        (
            lambda: jr.fitted_influence(MASSES, readings(0.0), scatter=0.0),
            "positive, but the smallest",
        ),
        (lambda: jr.fitted_influence(MASSES, readings(0.0), offset=[1, 2]), "has 2 labels"),
        (lambda: jr.fitted_influence(MASSES[:2], readings(0.0)[:2]), "do not tell 2 planes"),
        (lambda: jr.fitted_influence(MASSES * [1, 0], readings(0.0), ridge=1.0), "do not tell"),
        (
            lambda: jr.fitted_influence(MASSES[1:4], readings(0.0)[1:4]).estimate(OFFSET),
            "leave nothing that tells the noise",
        ),
        (lambda: jr.fitted_influence(MASSES, readings(0.0)).estimate(OFFSET[:2]), "have the shape"),
        (
            lambda: jr.fitted_influence(MASSES, readings(0.0)[:, :1]).estimate(OFFSET[:1]),
            "1 readings do not determine 2 planes",
        ),
        (
            lambda: jr.fitted_influence(MASSES, readings(0.0), offset=[1, 2] * 6).predict(
                MASSES[0]
            ),
            "`session` must be one of 1, 2",
        ),
        (
            lambda: jr.fitted_influence(MASSES, readings(0.0)).correction(OFFSET).radius(1.0),
            "between 0 and 1, but is 1.0",
        ),
    ],
)
def test_bad_runs_are_refused_in_one_sentence(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_text_has_every_coefficient():
    masses = np.array([[0.0], [1.0], [-1.0], [0.0]])
    runs = masses @ np.array([[2j]]) + np.array([0.1, 0.0, 0.0, -0.1])[:, None] + 3.0
    lines = str(jr.fitted_influence(masses, runs)).splitlines()
    assert lines[0].split() == ["reading", "plane", "1", "offset"]
    # variance 2 0.1^2 / (4 - 2) = 0.01, deviations 0.1 / sqrt(2) and 0.1 / sqrt(4)
    assert lines[1].split() == ["1", "2", "@", "90", "+-", "0.07", "3", "@", "0", "+-", "0.05"]
