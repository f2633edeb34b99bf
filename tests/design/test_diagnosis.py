"""Diagnoses: evidence against exact integrals by SciPy, what is not told, and what is none of these."""

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad, solve_ivp
from shown import shown

import jaxrotor as jr
from jaxrotor.design.evidence import posterior, total_evidence


K, M, C, E = 1e6, 10.0, 316.0, 1e-4  # [SI] of a disc in the middle of a massless shaft
SIGMA = 2e-5  # noise of every number [m]
SPEEDS = np.linspace(150.0, 400.0, 12)
ROTOR = jr.Scene(
    jr.MasslessShaft(1.0, 0.5, K),
    jr.Disc(0.5, M),
    jr.DiscDamping(0.5, C),
    jr.Unbalance(0.5, M, eccentricity=E),
    spin=jr.ConstantSpeed(200.0),
)
MOST = 1e-3  # eccentricity [m]
ECCENTRICITY = {"unbalance.eccentricity": (0.0, MOST)}
DAMPING = {"disc_damping.translational": (100.0, 1000.0)}
STIFF = lambda scene: scene.replace({"shaft.k11": 2 * K})
CANDIDATES = {"unbalance": (None, {}), "damping": (None, DAMPING), "another shaft": (STIFF, {})}


def whirl(eccentricity=E, stiffness=K, damping=C):
    """`z = m e Omega^2 / (k - m Omega^2 + i c Omega)`."""
    return M * eccentricity * SPEEDS**2 / (stiffness - M * SPEEDS**2 + 1j * damping * SPEEDS)


def noisy(clean, seed=0):
    two = np.random.default_rng(seed).normal(scale=SIGMA, size=(2, *clean.shape))
    return clean + two[0] + 1j * two[1]


def real(z):
    return np.concatenate([z.real, z.imag])


def log_evidence_of_eccentricity(record, sigma=SIGMA, stiffness=K):
    """The integral of a normal density over the bounds, by its mean and deviation."""
    unit, data = real(whirl(1.0, stiffness)), real(record)
    mean, spread = unit @ data / (unit @ unit), sigma / np.sqrt(unit @ unit)
    inside = stats.norm.cdf(MOST, mean, spread) - stats.norm.cdf(0.0, mean, spread)
    at_mean = stats.norm.logpdf(data, unit * mean, sigma).sum()
    return at_mean + np.log(np.sqrt(2 * np.pi) * spread * inside / MOST)


@pytest.fixture(scope="module")
def each():
    """Diagnoses of four responses, of known noise: of an unbalance, none, a stiff shaft, and a kink."""
    clean = [whirl(), whirl(0.0), whirl(stiffness=2 * K), whirl() + 1e-4 * (SPEEDS > 300)]
    records = [jr.ResponseRecord(noisy(z, i), SPEEDS) for i, z in enumerate(clean)]
    found = jr.diagnose_each(
        records, ROTOR, CANDIDATES, ECCENTRICITY, noise=SIGMA, draws=4, progress=False
    )
    return records, found


def test_evidence_is_the_integral_over_the_bounds(each):
    """Linear in its parameter the density is normal; at a bound half of one, Laplace is 0.15 off."""
    records, found = each
    for i, off in ((0, 2e-3), (1, 0.2)):
        z = np.asarray(records[i].amplitude)[:, 0]
        exact = log_evidence_of_eccentricity(z)
        assert found[i].explanations["unbalance"].log_evidence == pytest.approx(exact, abs=off)
    stiff = log_evidence_of_eccentricity(np.asarray(records[2].amplitude)[:, 0], stiffness=2 * K)
    assert found[2].explanations["another shaft"].log_evidence == pytest.approx(stiff, abs=2e-3)


def test_criterion_and_likelihood(each):
    """`k log m - 2 log L` with `L` of the normal density at the fit."""
    records, found = each
    for name, k in (("unbalance", 1), ("damping", 2)):
        one = found[0].explanations[name]
        z = np.asarray(records[0].amplitude)[:, 0]
        at = [one.values.get(path, own) for path, own in (("unbalance.eccentricity", E),)]
        predicted = whirl(*at, damping=one.values.get("disc_damping.translational", C))
        likelihood = stats.norm.logpdf(real(z), real(predicted), SIGMA).sum()
        assert one.log_likelihood == pytest.approx(likelihood, rel=1e-9)
        assert one.criterion == pytest.approx(k * np.log(24) - 2 * likelihood, rel=1e-9)


def test_probabilities_are_those_of_bayes(each):
    for one in each[1]:
        evidence = np.array([e.log_evidence for e in one.explanations.values()])
        shares = np.exp(evidence - evidence.max())
        assert sum(one.probabilities.values()) == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(list(one.probabilities.values()), shares / shares.sum())


def test_cause_is_found_or_none_of_these(each):
    _, (plain, _, stiff, kink) = each
    assert plain.cause == "unbalance" and stiff.cause == "another shaft"
    assert stiff.probabilities["another shaft"] > 0.99
    assert kink.cause is None and str(kink).startswith("None of these explains the record: ")
    assert kink.explanations[kink.most_probable].unusual == "larger than the noise"


def test_a_record_without_vibration_tells_no_cause(each):
    """Two shafts are as probable as the integrals say, and damping, which does not matter, as neither."""
    records, (_, quiet, _, _) = each
    z = np.asarray(records[1].amplitude)[:, 0]
    one, other = (log_evidence_of_eccentricity(z, stiffness=k) for k in (K, 2 * K))
    p = quiet.probabilities
    assert np.log(p["unbalance"] / p["another shaft"]) == pytest.approx(one - other, abs=0.05)
    assert np.log(p["unbalance"] / p["damping"]) == pytest.approx(0.0, abs=0.2)
    assert max(p.values()) < 0.8


def test_result_is_shown(each):
    one = each[1][0]
    assert str(one).startswith("Most probable: unbalance, probability ")
    said, heads, rows = shown(one)
    assert said == one._sentences[0] and heads[0] == "candidate"
    assert [row[0] for row in rows] == ["unbalance", "damping", "another shaft"]
    assert (
        float(one.explanations["unbalance"].scene.get("unbalance.eccentricity"))
        == (one.explanations["unbalance"].values["unbalance.eccentricity"])
    )


def test_unknown_noise_is_integrated_over(each):
    """Against `p(z) = int int N(z; e f, sigma) de / e_max d log sigma` by quadrature of SciPy."""
    record = each[0][0]
    found = jr.diagnose(record, ROTOR, CANDIDATES, ECCENTRICITY, draws=4, progress=False)
    z = np.asarray(record.amplitude)[:, 0]
    best = log_evidence_of_eccentricity(z)
    over = lambda u: np.exp(log_evidence_of_eccentricity(z, SIGMA * np.exp(u)) - best)
    exact = best + np.log(quad(over, -3.0, 3.0, points=[0.0])[0])
    assert found.explanations["unbalance"].log_evidence == pytest.approx(exact, abs=0.02)
    noise, freedom = found.explanations["unbalance"].noise[0], 23
    assert stats.chi2.ppf(1e-3, freedom) < freedom * (noise / SIGMA) ** 2
    assert freedom * (noise / SIGMA) ** 2 < stats.chi2.ppf(0.999, freedom)


def test_parameter_that_does_not_matter_costs_its_error():
    """Without slopes the integral of the prior is 1, and Laplace's approximation has sqrt(pi) / 2 each."""
    given = np.zeros(3), np.ones(4) * SIGMA, np.zeros((4, 3)), np.array([SIGMA])
    one = posterior(*given, np.array([False]), [4])
    likelihood = stats.norm.logpdf(np.ones(4) * SIGMA, 0.0, SIGMA).sum()
    assert one.log_evidence - likelihood == pytest.approx(3 * np.log(np.sqrt(np.pi) / 2))
    assert one.freedom == pytest.approx(4.0)
    away = one._replace(u=one.u + 10.0)
    assert total_evidence([one, one]) == pytest.approx(one.log_evidence)
    assert total_evidence([one, away]) == pytest.approx(one.log_evidence + np.log(2))


@pytest.mark.parametrize(
    "given, said",
    [
        ({"candidates": {}}, "`candidates` must have at least two causes"),
        ({"candidates": {"a": (None, {}), "b": None}}, "Candidate 'b' must be a name with a pair"),
        ({"candidates": {"a": (None, {"disc.mass": None}), "b": (None, {})}}, "must have bounds"),
        ({"candidates": {"a": (None, {}), "b": (3.0, {})}}, "Candidate b must add an effect"),
        ({"candidates": {"a": (None, {}), "b": (lambda scene: 3, {})}}, "must return a `Scene`"),
        ({"parameters": {}}, "`parameters of unbalance` must name at least one"),
        ({"noise": 0.0}, "`noise` must be the positive standard deviation"),
        ({"noise": [SIGMA, SIGMA]}, "`noise` must be the positive standard deviation"),
        ({"level": 2.0}, "`level` must be a number between 0 and 1"),
        ({"draws": 0}, "`draws` must"),
        ({"records": 3.0}, "A record must be a `TimeRecord`"),
        ({"records": jr.ResponseRecord([1e-5], [200.0], angle=None)}, "too few for 1 parameters"),
    ],
)
def test_refusals(given, said):
    arguments = {
        "records": jr.ResponseRecord(whirl(), SPEEDS),
        "scene": ROTOR,
        "candidates": CANDIDATES,
        "parameters": ECCENTRICITY,
        "progress": False,
    }
    with pytest.raises(ValueError) as raised:
        jr.diagnose(**(arguments | given))
    assert said in str(raised.value)


def test_conditions_are_alike():
    one = jr.ResponseRecord(whirl(), SPEEDS)
    other = jr.ResponseRecord(whirl()[:8], SPEEDS[:8])
    with pytest.raises(ValueError, match="condition 1 has"):
        jr.diagnose_each([one, other], ROTOR, CANDIDATES, ECCENTRICITY, progress=False)
    with pytest.raises(ValueError, match="`conditions` must be a list"):
        jr.diagnose_each(one, ROTOR, CANDIDATES, ECCENTRICITY, progress=False)


# === orbits


LOSS, ANGLE, SPEED = 1.5e5, 0.7, 0.6 * np.sqrt(K / M)


def cracked_orbit(loss):
    """A revolution of 32 samples of a shaft with a crack after Mayes under its weight, by DOP853."""

    def rates(t, state):
        z, velocity = state[0] + 1j * state[1], state[2] + 1j * state[3]
        theta = SPEED * t
        turned = z * np.exp(-1j * (theta + ANGLE))
        opened = (1 - np.sin(theta + ANGLE)) / 2 * loss * turned.real
        force = opened * np.exp(1j * (theta + ANGLE)) - K * z - C * velocity
        total = (force + M * E * SPEED**2 * np.exp(1j * theta)) / M - 9.81j
        return velocity.real, velocity.imag, total.real, total.imag

    times = 2 * np.pi / SPEED * (60 + np.arange(32) / 32)
    run = solve_ivp(rates, (0.0, times[-1]), np.zeros(4), "DOP853", times, rtol=1e-9, atol=1e-13)
    return run.y[0] + 1j * run.y[1]


@pytest.mark.slow
def test_a_crack_is_told_from_unbalance_if_it_is_deep_enough():
    """Records of SciPy with 5 % of noise: a deep crack, one of which the record tells nothing, none."""
    machine = ROTOR.of_parts(*ROTOR.effects, jr.Gravity(9.81)).at_speed(SPEED)
    candidates = {
        "unbalance": (None, {}),
        "crack": (jr.Crack(0.5, 1e5), {"crack.loss": (1e3, 4e5), "crack.angle": (-2.0, 2.0)}),
    }
    clean = [cracked_orbit(loss) for loss in (LOSS, 2e3)]
    rng = np.random.default_rng(0)
    records = []
    for z in clean:
        two = 0.05 * np.std(z) * rng.normal(size=(2, z.size))
        records.append(jr.OrbitRecord(z + two[0] + 1j * two[1], steps_per_revolution=32))
    options = {"draws": 8, "starts": 2, "progress": False}
    deep, light = jr.diagnose_each(records, machine, candidates, ECCENTRICITY, **options)
    assert deep.cause == "crack" and deep.probabilities["crack"] > 0.999
    found = deep.explanations["crack"]
    for path, true in (("crack.loss", LOSS), ("crack.angle", ANGLE)):
        assert abs(found.values[path] - true) < 4 * found.deviations[path]
    assert deep.explanations["unbalance"].p_value < 1e-3
    assert light.cause is not None and 0.05 < light.probabilities["crack"] < 0.95
