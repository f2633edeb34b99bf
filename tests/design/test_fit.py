"""Fits to records: closed forms and SciPy make the records, many of them count what intervals cover."""

import dataclasses
import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.integrate import solve_ivp
from scipy.optimize import curve_fit
from shown import shown

import jaxrotor as jr
from jaxrotor.design.fit import checked, concluded
from jaxrotor.design.minimum import minimum
from jaxrotor.design.records import with_starts


K, M, C, E, PHASE = 8e5, 5.0, 60.0, 1e-4, 0.4  # [SI] of a disc in the middle of a massless shaft
SIGMA = 2e-5  # noise of every number [m]
SHAFT = jr.MasslessShaft(1.0, 0.5, K)
PARTS = (jr.Disc(0.5, M), jr.DiscDamping(0.5, C))
UNBALANCE = jr.Unbalance(0.5, M, eccentricity=E, phase=PHASE)
ROTOR = jr.Scene(SHAFT, *PARTS, UNBALANCE, spin=jr.ConstantSpeed(380.0))
SPEEDS = np.linspace(350.0, 450.0, 20)
WHERE = {
    "shaft.k11": (4e5, 1.6e6),
    "disc_damping.translational": (10.0, 300.0),
    "unbalance.eccentricity": (1e-6, 1e-2),
    "unbalance.phase": None,
}
TRUE = dict(zip(WHERE, (K, C, E, PHASE), strict=True))
GUESS = ROTOR.replace(dict(zip(WHERE, (7.5e5, 80.0, 2e-4, 0.0), strict=True)))


def whirl(speed, stiffness=K, damping=C, eccentricity=E, phase=PHASE):
    """`z = m e Omega^2 exp(i phase) / (k - m Omega^2 + i c Omega)`; `M` is the mass of the unbalance."""
    load = M * eccentricity * speed**2 * np.exp(1j * phase)
    return load / (stiffness - M * speed**2 + 1j * damping * speed)


def noisy(clean, count=None, sigma=SIGMA, seed=0):
    """The record with noise in real and imaginary parts, or `count` of them."""
    shape = clean.shape if count is None else (count, *clean.shape)
    two = np.random.default_rng(seed).normal(scale=sigma, size=(2, *shape))
    return clean + (two[0] + 1j * two[1] if np.iscomplexobj(clean) else two[0])


def fitted_to_all(fitted, scene, measured, start):
    """Results of `jr.fit` to many records in place of its own, by the same search from `start`.

    `measured` has for each record the name of its numbers and an array (count, T).
    """
    records, limits = fitted.records, fitted.bounds
    swapped = lambda rows: tuple(
        dataclasses.replace(record, **{name: row})
        for record, (name, _), row in zip(records, measured, rows, strict=True)
    )
    u = jnp.asarray(limits.numbers(start))
    fit_one = lambda rows: minimum(scene, swapped(rows), limits, u, 50)
    arrays = [many[:, :, None] for _, many in measured]
    all_at_once = jax.jit(lambda all_: jax.lax.map(fit_one, all_))
    found = jax.device_get(all_at_once([jnp.asarray(array) for array in arrays]))
    lanes = [jax.tree.map(lambda leaf, i=i: leaf[i][None], found) for i in range(len(arrays[0]))]
    return [
        concluded(scene, swapped([array[i] for array in arrays]), limits, lane)
        for i, lane in enumerate(lanes)
    ]


def shares_covered(results, true):
    """Share of the 95 % intervals that contain the true value, by parameter."""
    found = [one.intervals(0.95) for one in results]
    return {
        path: np.mean([ends[path][0] < value < ends[path][1] for ends in found])
        for path, value in true.items()
    }


@pytest.fixture(scope="module")
def response():
    """A fit to a response over speed, complex."""
    record = jr.ResponseRecord(noisy(whirl(SPEEDS)), SPEEDS)
    return jr.fit(GUESS, record, WHERE, progress=False)


# === one record


def test_response_as_scipy_fits_it(response):
    """Values, covariance and noise are those of `curve_fit` on the closed form."""
    measured = noisy(whirl(SPEEDS))
    real = lambda speeds, *x: np.concatenate([whirl(speeds, *x).real, whirl(speeds, *x).imag])
    data = np.concatenate([measured.real, measured.imag])
    values, covariance = curve_fit(
        real, SPEEDS, data, p0=list(TRUE.values()), x_scale=[1e5, 10.0, 1e-4, 1.0],
        xtol=1e-14, ftol=1e-14, gtol=1e-14, method="trf",
    )  # fmt: skip
    found = list(response.values.values())
    np.testing.assert_allclose(found, values, rtol=1e-6)
    deviations = np.sqrt(np.diag(covariance))
    scale = np.outer(deviations, deviations)
    np.testing.assert_allclose(response.covariance / scale, covariance / scale, atol=1e-4)
    left = real(SPEEDS, *values) - data
    np.testing.assert_allclose(response.degrees_of_freedom, 2 * SPEEDS.size - 4, rtol=1e-9)
    sigma = np.sqrt(np.sum(left**2) / response.degrees_of_freedom[0])
    assert response.noise[0] == pytest.approx(sigma, rel=1e-6)
    np.testing.assert_allclose(
        response.residuals[0][:, 0], left[:20] + 1j * left[20:], atol=1e-5 * SIGMA
    )
    low, high = response.intervals(0.9)["shaft.k11"]
    reach = stats.t.ppf(0.95, 36) * deviations[0]
    assert (low, high) == pytest.approx((values[0] - reach, values[0] + reach), rel=1e-6)


def test_noise_is_within_its_bounds(response):
    """`(m - n) s^2 / sigma^2` is a chi-square of `m - n` degrees of freedom."""
    freedom = response.degrees_of_freedom[0]
    square = freedom * (response.noise[0] / SIGMA) ** 2
    assert stats.chi2.ppf(0.005, freedom) < square < stats.chi2.ppf(0.995, freedom)


def test_result_is_shown(response):
    assert response.cautions == ()
    lines = str(response).split("\n")
    assert lines[0].startswith("4 parameters from 40 numbers; noise ") and len(lines) == 5
    low, high = response.intervals()["shaft.k11"]
    assert lines[1] == (
        f"  shaft.k11 = {float(response.values['shaft.k11']):.6g} N/m, 95 % from {low:.6g} to {high:.6g}"
    )
    head, heads, rows = shown(response)
    assert head == lines[0] and [row[0] for row in rows] == list(WHERE)
    assert float(rows[0][3]) == pytest.approx(low, rel=1e-5) and heads[3:5] == ["95 % from", "to"]
    assert float(response.scene.get("shaft.k11")) == float(response.values["shaft.k11"])
    assert response.start is None


def test_residuals_with_a_hum_are_not_noise(response):
    """Record and result of a fit to a response that has a slow error: the sentence says so."""
    hum = 2 * SIGMA * np.sin(np.arange(20) / 2)
    record = dataclasses.replace(response.records[0], amplitude=noisy(whirl(SPEEDS)) + hum)
    found = jr.fit(ROTOR, record, WHERE, progress=False)
    (said,) = found.cautions
    assert said.startswith("The residuals of record 0 are correlated") and said in str(found)


@pytest.mark.long
def test_intervals_of_a_response_cover(response):
    """2000 records: share covered, noise as chi-square, scatter as covariance, correlation as of noise."""
    many = noisy(whirl(SPEEDS), 2000, seed=1)
    results = fitted_to_all(response, ROTOR, [("amplitude", many)], list(TRUE.values()))
    for path, share in shares_covered(results, TRUE).items():
        assert 0.93 < share < 0.97, path
    squares = 36 * np.array([one.noise[0] for one in results]) ** 2 / SIGMA**2
    assert stats.kstest(squares, stats.chi2(36).cdf).pvalue > 1e-3
    scatter = np.cov(np.array([list(one.values.values()) for one in results], float).T)
    mean = np.mean([one.covariance for one in results], axis=0)
    sizes = np.sqrt(np.diag(scatter))
    np.testing.assert_allclose(
        mean / np.outer(sizes, sizes), scatter / np.outer(sizes, sizes), atol=0.1
    )
    off = np.array([one.z_scores[0, 0] for one in results])
    assert abs(off.mean()) < 0.1 and off.std() == pytest.approx(1.0, abs=0.07)
    assert np.mean([bool(one.cautions) for one in results]) < 0.01
    again = fitted_to_all(
        response, ROTOR, [("amplitude", noisy(whirl(SPEEDS))[None])], list(TRUE.values())
    )
    found = [list(one.values.values()) for one in (response, *again)]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-7)  # from wherever it began


def test_amplitudes_alone():
    """Without phases there is no phase of the unbalance to find; the others are as before."""
    measured = noisy(np.abs(whirl(SPEEDS)))
    where = {path: pair for path, pair in WHERE.items() if pair is not None}
    found = jr.fit(GUESS, jr.ResponseRecord(measured, SPEEDS), where, progress=False)
    value, sizes = curve_fit(
        lambda speeds, *x: np.abs(whirl(speeds, *x)), SPEEDS, measured,
        p0=[K, C, E], x_scale=[1e5, 10.0, 1e-4], xtol=1e-14, ftol=1e-14, gtol=1e-14, method="trf",
    )  # fmt: skip
    np.testing.assert_allclose(list(found.values.values()), value, rtol=1e-5)
    np.testing.assert_allclose(
        list(found.uncertainty.deviations.values()), np.sqrt(np.diag(sizes)), rtol=1e-3
    )


# === several records, and motion in time


FREE = jr.Scene(SHAFT, *PARTS, spin=jr.ConstantSpeed(100.0))
TIMES = np.linspace(0.0, 0.3, 61)
RADIUS, TURN = 1e-3, 0.3


def decay(times, stiffness=K, damping=C, radius=RADIUS, turn=TURN, steady=0.0, speed=0.0):
    """`z = A exp(i W t) + exp(-d t) (a cos w t + b sin w t)`: the disc let go from rest.

    `A` is the `steady` whirl at the `speed` W.
    """
    d = damping / M / 2
    w = np.sqrt(stiffness / M - d**2)
    a = radius * np.exp(1j * turn) - steady
    b = (d * a - 1j * speed * steady) / w
    free = np.exp(-d * times) * (a * np.cos(w * times) + b * np.sin(w * times))
    return free + steady * np.exp(1j * speed * times)


@pytest.mark.long
def test_intervals_of_two_records_cover():
    """A decay whose start is sought too, and a response with five times the noise: each has its own."""
    speed, revolutions = 200.0, 10
    times = 2 * np.pi / speed * np.linspace(0.0, revolutions, 61)
    model = lambda t, k, c, e, phase, r, turn: decay(
        t, k, c, r, turn, whirl(speed, k, c, e, phase), speed
    )
    true = TRUE | {"start.shaft.radius": RADIUS, "start.shaft.angle": TURN}
    clean = model(times, *true.values())
    timed = jr.TimeRecord(noisy(clean), revolutions, start=jr.Whirl(8e-4), substeps=1)
    slow = jr.ResponseRecord(noisy(whirl(SPEEDS), sigma=5 * SIGMA), SPEEDS)
    where = WHERE | {"start.shaft.radius": (1e-4, 1e-1), "start.shaft.angle": None}
    rotor = ROTOR.at_speed(speed)
    found = jr.fit(rotor, [timed, slow], where, progress=False)
    assert float(found.start.radius) == float(found.values["start.shaft.radius"])
    assert "start" not in str(found.scene) and len(found.scene.effects) == 3
    many = [
        ("displacement", noisy(clean, 500, seed=2)),
        ("amplitude", noisy(whirl(SPEEDS), 500, 5 * SIGMA, seed=3)),
    ]
    results = fitted_to_all(found, found.model, many, list(true.values()))
    for path, share in shares_covered(results, true).items():
        assert 0.93 < share < 0.97, path
    noises = np.array([one.noise for one in results])
    np.testing.assert_allclose(np.mean(noises**2, axis=0), [SIGMA**2, 25 * SIGMA**2], rtol=0.03)
    # What SciPy finds from both, weighted by the true noise.
    both = np.concatenate([many[0][1][0], many[1][1][0] / 5])
    stacked = lambda t, *x: np.concatenate([model(times, *x), whirl(SPEEDS, *x[:4]) / 5])
    parts = lambda z: np.concatenate([z.real, z.imag])
    x, covariance = curve_fit(
        lambda t, *x: parts(stacked(t, *x)), np.zeros(2 * both.size), parts(both),
        p0=list(true.values()), x_scale=[1e5, 10.0, 1e-4, 1.0, 1e-3, 1.0],
        sigma=np.full(2 * both.size, SIGMA),
        absolute_sigma=True, method="trf", xtol=1e-14, ftol=1e-14, gtol=1e-14,
    )  # fmt: skip
    deviations = np.array(list(results[0].uncertainty.deviations.values()))
    np.testing.assert_allclose(deviations, np.sqrt(np.diag(covariance)), rtol=0.2)
    off = (np.array(list(results[0].values.values())) - x) / deviations
    assert np.abs(off).max() < 0.2  # as the noise that was found is not quite the true one


GAP, STOP, FRICTION, RIM = 1e-3, 2e6, 0.2, 0.1
RUB = jr.Scene(
    SHAFT,
    *PARTS,
    jr.Limiter(0.5, 0.0, GAP, STOP, friction=FRICTION, rim_radius=RIM),
    spin=jr.ConstantSpeed(400.0),
)
RUBBED = {
    "limiter.stiffness": (2e5, 2e7),
    "limiter.gap": (5e-4, 2e-3),
    "limiter.friction": (0.01, 0.9),
}


def moved(times, state, speed, eccentricity=0.0, weight=0.0, gap=GAP):
    """The disc against its stop, by SciPy: `z` at the times, and the last state."""

    def rate(t, y):
        x, _, vx, vy = y
        normal = STOP * (x - gap) if x > gap else 0.0
        load = M * eccentricity * speed**2 * np.exp(1j * (PHASE + speed * t)) - 1j * M * weight
        along = FRICTION * normal * np.sign(speed * RIM + vy)
        return [
            vx,
            vy,
            (load.real - K * x - C * vx - normal) / M,
            (load.imag - K * y[1] - C * vy - along) / M,
        ]

    run = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-13, "max_step": 5e-4}
    found = solve_ivp(rate, (0.0, times[-1]), state, t_eval=times, **run).y
    return found[0] + 1j * found[1], found[:, -1]


@pytest.mark.long
def test_intervals_of_a_rub_cover():
    """500 records of three revolutions with impacts, each integrated by SciPy but for its noise."""
    times = 2 * np.pi / 400.0 * np.arange(3 * 32 + 1) / 32
    first = 2e-3 * np.exp(0.6j)
    clean, _ = moved(times, [first.real, first.imag, 0.0, 0.0], 400.0)
    assert clean.real.max() > 1.5 * GAP
    record = jr.TimeRecord(noisy(clean), 3, start=jr.Whirl(2e-3, angle=0.6), substeps=2)
    np.testing.assert_allclose(record.prediction(RUB)[:, 0], clean, atol=1e-3 * SIGMA)
    guess = RUB.replace(dict(zip(RUBBED, (3e6, 1.1e-3, 0.3), strict=True)))
    found = jr.fit(guess, record, RUBBED, progress=False)
    true = dict(zip(RUBBED, (STOP, GAP, FRICTION), strict=True))
    many = noisy(clean, 500, seed=4)
    results = fitted_to_all(found, RUB, [("displacement", many)], list(true.values()))
    for path, share in shares_covered(results, true).items():
        assert 0.93 < share < 0.97, path
    squares = (
        found.degrees_of_freedom[0] * np.array([one.noise[0] for one in results]) ** 2 / SIGMA**2
    )
    assert stats.kstest(squares, stats.chi2(found.degrees_of_freedom[0]).cdf).pvalue > 1e-3
    assert float(found.uncertainty.distance(true)) < stats.chi2.ppf(0.999, 3)


# === steady motions


WEIGHT = 9.80665
COUNT = 32
HEAVY = ROTOR.of_parts(*PARTS, UNBALANCE, jr.Gravity())


def test_orbits_and_spectra_of_a_linear_rotor():
    """Unbalance turns, weight (downwards, along -y) stands still: orders 1 and 0."""
    angle = 2 * np.pi * np.arange(COUNT) / COUNT
    around, sag = whirl(380.0), -1j * M * WEIGHT / K
    orbit = around * np.exp(1j * angle) + sag
    record = jr.OrbitRecord(orbit)
    np.testing.assert_allclose(record.prediction(HEAVY)[:, 0], orbit, atol=1e-12)
    spectrum = jr.SpectrumRecord([sag, around, 0j], [0, 1, -1])
    np.testing.assert_allclose(
        spectrum.prediction(HEAVY)[:, 0], spectrum.amplitude[:, 0], atol=1e-12
    )
    sizes = jr.SpectrumRecord(np.abs([sag, around]), [0, 1]).prediction(HEAVY)
    np.testing.assert_allclose(sizes[:, 0], np.abs([sag, around]), rtol=1e-9)
    across = jr.OrbitRecord(orbit.imag, angle=np.pi / 2)
    np.testing.assert_allclose(across.prediction(HEAVY)[:, 0], orbit.imag, atol=1e-12)
    where = {"unbalance.eccentricity": (1e-6, 1e-2), "unbalance.phase": None}
    measured = noisy(orbit)
    found = jr.fit(
        HEAVY.replace({"unbalance.phase": 0.1}), jr.OrbitRecord(measured), where, progress=False
    )
    # `z - sag` is linear in `e exp(i phase)`.
    best = np.mean((measured - sag) * np.exp(-1j * angle)) / around * E * np.exp(1j * PHASE)
    values = [float(value) for value in found.values.values()]
    assert values == pytest.approx([abs(best), np.angle(best)], rel=1e-7)
    expected = float(found.noise[0]) / np.sqrt(COUNT) / abs(around) * E
    assert float(found.uncertainty.deviations["unbalance.eccentricity"]) == pytest.approx(
        expected, rel=1e-6
    )


@pytest.mark.slow
def test_an_unstable_orbit_is_doubted():
    """Damping in the shaft drives a whirl above 400 (1 + 60 / 320) = 475 rad/s, so nobody measures it."""
    parts = *PARTS, UNBALANCE, jr.InternalDamping(320.0 / K), jr.CubicSpring(0.5, 0.0, 1e9)
    record = jr.OrbitRecord(np.ones(8) + 0j, guess=jr.AtRest())
    slow, quick = (
        jr.Scene(SHAFT, *parts, spin=jr.ConstantSpeed(speed)) for speed in (450.0, 500.0)
    )
    assert record.doubt(slow) == "" and record.doubt(ROTOR) == ""
    assert "free vibration grows" in record.doubt(quick.without("cubic_spring"))
    assert "its orbit is unstable with the fitted parameters (a multiplier of" in record.doubt(
        quick
    )


@pytest.mark.long
def test_orbit_of_a_rub():
    """A periodic rub that SciPy has settled, and its spectrum: gap and friction are found."""
    scene = HEAVY.of_parts(
        *HEAVY.effects, jr.Limiter(0.5, 0.0, 4e-4, STOP, friction=FRICTION, rim_radius=RIM)
    )
    period = 2 * np.pi / 380.0
    options = (380.0, E, WEIGHT, 4e-4)
    state = moved(np.array([0.0, 200 * period]), np.zeros(4), *options)[1]
    orbit, _ = moved(period * np.arange(COUNT) / COUNT, state, *options)
    assert orbit.real.max() > 4.2e-4
    record = jr.OrbitRecord(noisy(orbit, sigma=5e-6))
    where = {"limiter.gap": (2e-4, 8e-4), "limiter.friction": (0.05, 0.6)}
    guess = scene.replace({"limiter.gap": 3.5e-4, "limiter.friction": 0.15})
    found = jr.fit(guess, record, where, progress=False)
    true = {"limiter.gap": 4e-4, "limiter.friction": FRICTION}
    assert float(found.uncertainty.distance(true)) < stats.chi2.ppf(0.999, 2)
    assert found.cautions == ()
    clean = orbit - (record.displacement[:, 0] + found.residuals[0][:, 0])  # of the fitted scene
    assert np.abs(clean).max() < 1e-5
    orders = np.arange(-3, 4)
    spectrum = jr.SpectrumRecord(np.ones(7, complex), orders, guess=found.records[0].guess)
    lines = np.fft.fft(orbit)[orders] / COUNT
    np.testing.assert_allclose(spectrum.prediction(scene)[:, 0], lines, atol=3e-8)


def test_probes_and_forces():
    """Probes along x and y read both parts of a whirl; a force has its own response."""
    two = jr.TimeRecord(
        np.zeros((61, 2)), times=TIMES, at=[0.5, 0.5], angle=[0.0, np.pi / 2],
        start=jr.Whirl(RADIUS, angle=TURN), solver=jr.Exponential(),
    )  # fmt: skip
    z = decay(TIMES)
    np.testing.assert_allclose(two.prediction(FREE), np.stack([z.real, z.imag], 1), atol=1e-10)
    where = {"start.shaft.radius": None}
    launched = jr.TimeRecord(
        z, times=TIMES, start=jr.Launch(jr.Whirl(2 * RADIUS, angle=TURN)), solver=jr.Exponential()
    )
    scene = with_starts((launched,), FREE, where).replace({"start.shaft.radius": RADIUS})
    np.testing.assert_allclose(launched.prediction(scene)[:, 0], z, atol=1e-10)
    force = jr.HarmonicForce(0.5, amplitude=20.0, angle=0.3)
    record = jr.ResponseRecord(np.zeros(3, complex), [100.0, 200.0, 300.0], angle=0.3, force=force)
    w = np.array([100.0, 200.0, 300.0])
    np.testing.assert_allclose(
        record.prediction(FREE)[:, 0], 20.0 / (K - M * w**2 + 1j * C * w), rtol=1e-9
    )
    assert record.name == "frequency"


# === refusals


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: jr.ResponseRecord([1.0, np.nan], [1.0, 2.0]), r"sample 1 is nan \(1 of 2"),
        (lambda: jr.ResponseRecord([1.0, 2.0], [1.0]), "has 2 samples, but 1 `frequencies`"),
        (lambda: jr.TimeRecord(np.ones(5)), "must be complex, x [+] i y, or real with the `angle`"),
        (lambda: jr.TimeRecord(np.ones(5) + 0j), "needs `revolutions` or `times`"),
        (lambda: jr.TimeRecord(np.ones(6) + 0j, 2), "whole number of samples in each"),
        (lambda: jr.TimeRecord(np.ones(2) + 0j, times=[0, 1, 2]), "has 2 samples, but 3 `times`"),
        (lambda: jr.OrbitRecord(np.ones(5) + 0j, 2), "orbit of 2 revolutions must have a whole"),
        (lambda: jr.SpectrumRecord(1j * np.ones(1), [0.5]), "must be multiples of 1 / 1"),
        (lambda: jr.OrbitRecord(["a"]), "must be numbers by sample"),
        (lambda: jr.OrbitRecord([1.0, 2.0], angle=np.nan), r"`angle \[rad\]` must be finite"),
        (lambda: jr.SpectrumRecord(1j * np.ones(1), [128]), "`orders` must be below 128"),
        (lambda: jr.ResponseRecord([-1.0, 2.0], [1.0, 2.0]), "cannot be negative, but one is -1"),
        (lambda: jr.OrbitRecord("a.csv"), "'a.csv'; read the file first, as by `numpy.loadtxt`"),
        (lambda: jr.OrbitRecord(None), r"type object: None; give an array \(T,\) or \(T, c\)"),
        (lambda: jr.OrbitRecord(np.ones((2, 2, 2))), r"has shape \(2, 2, 2\) and type float64"),
        (lambda: jr.OrbitRecord([]), r"has shape \(0,\) .* give an array \(T,\) or \(T, c\)"),
        (lambda: jr.OrbitRecord([True, False]), "type bool"),
        (lambda: jr.OrbitRecord([[1.0, 2.0], [3.0]]), "several lengths: .* a number for every channel"),
        (lambda: jr.ResponseRecord([1.0], [1j]), r"`frequencies .* must be a list .*, but is \[1j\]"),
        (lambda: jr.ResponseRecord([1.0], ["1"]), r"`frequencies .* must be a list .*, but is \['1'\]"),
        (lambda: jr.ResponseRecord([1.0], np.array([1], "datetime64[s]")), "but is array.*1970"),
        (lambda: jr.TimeRecord(np.ones(2) + 0j, times=[0.0, 1j]), r"`times \[s\]` must be a list"),
        (lambda: jr.OrbitRecord([1.0], angle="x"), "`angle .* must be the direction of a probe.*'x'"),
        (lambda: jr.OrbitRecord([1.0], angle=1j), "direction of a probe, or a list .*, but is 1j"),
        (lambda: jr.OrbitRecord([1.0], angle=[None]), r"direction of a probe, .*, but is \[None\]"),
        (lambda: jr.OrbitRecord([1.0], angle=[[0.0, 1.0]]), r"but is \[\[0.0, 1.0\]\]"),
        (lambda: jr.TimeRecord(np.ones(5) + 0j, 2, start="rest"), "`start` must be a start such as Whirl"),
        (lambda: jr.ResponseRecord([1.0], [1.0], force=20.0), "`force` must be a `HarmonicForce`.*20.0"),
        (lambda: jr.Launch(jr.Whirl(1e-3), balls=3), "`balls` must be a `Balls` for every race.* is 3"),
    ],
)  # fmt: skip
def test_what_is_not_a_record(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_refusals():
    record = jr.ResponseRecord(noisy(whirl(SPEEDS)), SPEEDS)
    refused = lambda said, *given: pytest.raises(ValueError, match=said)
    with refused("2 numbers, too few for 4 parameters"):
        jr.fit(ROTOR, jr.ResponseRecord([1e-4 + 0j], [400.0]), WHERE)
    with refused("must be a `TimeRecord` or its like"):
        jr.fit(ROTOR, [np.ones(3)], WHERE)
    with refused("Balls have many steady positions"):
        jr.fit(jr.load("ball-balancer"), jr.OrbitRecord([1e-4, 1e-4j]), {"disc.mass": None})
    ramp = jr.Scene(SHAFT, *PARTS, spin=jr.SpeedProfile.ramp(0.0, 100.0, 1.0))
    with refused("constant speed"):
        jr.fit(ramp, jr.SpectrumRecord([1e-4, 1e-4j], [0, 1]), {"disc.mass": None})
    with refused("`parameters` must name at least one parameter"):
        jr.fit(ROTOR, record, {})
    with refused("must be a `TimeRecord` or its like, but is None"):
        jr.fit(ROTOR, None, WHERE)
    with refused("needs at least one record"):
        jr.fit(ROTOR, [], WHERE)
    with refused("1 channels, but `at` names 2 stations"):
        jr.fit(ROTOR, dataclasses.replace(record, at=[0.5, 0.5]), WHERE)
    with refused("fitted to time records, but there are none"):
        jr.fit(ROTOR, record, {"start.shaft.radius": None})
    timed = jr.TimeRecord(noisy(decay(TIMES)), times=TIMES)
    with refused("AtRest, has no numbers to fit"):
        jr.fit(FREE, timed, {"start.shaft.radius": None})


@pytest.mark.parametrize(
    ("scene", "records", "parameters", "said"),
    [
        (None, (), {}, "`scene` must be a `Scene`, but is None; `jr.load` reads one from a file"),
        ("rotor.toml", (), {}, "`scene` must be a `Scene`, but is 'rotor.toml'"),
        (ROTOR, "record.csv", WHERE, "like, but is 'record.csv'; give one of these, or a list"),
        (ROTOR, [np.ones(999)], WHERE, r"like, but is array\(\[1., 1"),
        (ROTOR, [[]], WHERE, r"like, but is \[\]"),
        (ROTOR, jr.TimeRecord, WHERE, "like, but is <class"),
        (ROTOR, (), ["shaft.k11"], r"`parameters` must be bounds by path, .*, but is \['shaft.k11'\]"),
        (ROTOR, (), None, "`parameters` must be bounds by path, .*, but is None"),
        (ROTOR, (), {1: None}, "keys of `parameters` must be paths .*, but one is 1"),
    ],
)  # fmt: skip
def test_what_is_not_an_argument_of_a_fit(scene, records, parameters, said):
    """Arguments of other types, which the checks of annotations in tests would not let pass."""
    with pytest.raises(ValueError, match=said) as raised:
        checked(scene, records, parameters)
    assert len(str(raised.value)) < 400  # a long array is cut


@pytest.mark.parametrize(
    "pair",
    [
        8e5, "19", ("4e5", "1.6e6"), (1, 2, 3), (1.6e6, 4e5), (8e5, 8e5), (np.nan, 1e6), (4e5, np.inf),
        (4e5, 1.6e6 + 0j), (None, 1e6), (False, True), (True, 2e6), {4e5, 1.6e6}, {4e5: 0, 1.6e6: 0},
        (), [[1], 2], np.ones((2, 2)), np.array([4e5, 1.6e6], complex), (1, 10**400), b"01",
    ],
)  # fmt: skip
def test_what_is_not_a_pair_of_bounds(pair):
    record = jr.ResponseRecord(noisy(whirl(SPEEDS)), SPEEDS)
    said = (
        r"`parameters\['shaft.k11'\]` must be a lower and a higher bound, or None for none, but is "
    )
    with pytest.raises(ValueError, match=said):
        jr.fit(ROTOR, record, {"shaft.k11": pair})


@pytest.mark.parametrize(
    ("at", "said"),
    [
        ({"a": 1}, "must be a station or a list of them, but is {'a': 1}"),
        ([None], r"must be a station or a list of them, but is \[None\]"),
        (0.5j, "must be a station or a list of them, but is 0.5j"),
        ([[0.5], [0.1, 0.2]], "must be a station or a list of them"),
        (ROTOR, "must be a station or a list of them, but is Scene"),
        (5.0, r"must be on the shaft \(0 to 1\), but is 5"),
        ("pedestal", "There is no casing 'pedestal'"),
    ],
)
def test_what_is_not_a_station(at, said):
    with pytest.raises(ValueError, match=said):
        jr.fit(ROTOR, jr.ResponseRecord(noisy(whirl(SPEEDS)), SPEEDS, at=at), WHERE)


def test_settings_are_checked(response):
    record, where = response.records[0], {"shaft.k11": (4e5, 1.6e6)}
    refused = lambda said: pytest.raises(ValueError, match=said)
    with refused("`seed` must be a whole number of at least 0, but is -1"):
        jr.fit(ROTOR, record, where, seed=-1)
    with refused("`disc.mass` and `discs.mass` are the same number; leave one out"):
        jr.fit(ROTOR, record, {"disc.mass": None, "discs.mass": None})
    with refused("every fitted parameter, but `shaft.k11` is missing; it has: disc.mass"):
        response.uncertainty.distance({"disc.mass": 5.0})
    with refused("`level` must be a number between 0 and 1, but is nan"):
        response.intervals(np.nan)
    unchecked = inspect.unwrap(type(response).intervals)  # by annotations, in tests
    for level in (np.array([0.5, 0.6]), np.array([0.5]), [0.5], [[0.5], 0.6], "0.95", None):
        with refused("`level` must be a number between 0 and 1, but is "):
            unchecked(response, level)
    jr.fit(ROTOR, record, where, steps=10**30, progress=False)  # no program counts so far
    still = FREE.at_speed(0.0)
    with refused("At zero speed a time record by `revolutions` has no length; give its `times`"):
        jr.fit(still, jr.TimeRecord(np.ones(5) + 0j, 2), where)
    timed = jr.TimeRecord(decay(TIMES), times=TIMES, solver=jr.Exponential(4))
    with refused(r"Steps of Exponential\(\) along `times` are chosen by a known speed, but a fit"):
        jr.fit(FREE, timed, where)
    timed = jr.TimeRecord(decay(TIMES), times=TIMES, solver="rk4")
    with refused(r"`solver` must be Exponential\(..\) or a diffrax solver .*, but is 'rk4'"):
        jr.fit(FREE, timed, where)


def test_tables_that_end_before_the_speeds_of_a_record():
    """Said before the fit: a prediction beyond the tables is not a number."""
    over = {"speeds": [50.0, 400.0], "kxx": [2e6, 3e6], "kyy": [2e6, 3e6]}
    shaft = jr.MasslessShaft(1.0, 0.5, K, ends="elastic")
    parts = *PARTS, UNBALANCE, *(jr.Support(x, **over) for x in (0.0, 1.0))
    at = lambda spin: jr.Scene(shaft, *parts, spin=spin)
    slow, quick = at(jr.ConstantSpeed(300.0)), at(jr.ConstantSpeed(500.0))
    ramp = at(jr.SpeedProfile.ramp(0.0, 480.0, 0.1))
    z = np.ones(9) + 0j
    force = jr.HarmonicForce(0.5)
    for scene, record, speed in (
        (slow, jr.ResponseRecord(z, np.linspace(360.0, 440.0, 9)), 410),
        (quick, jr.ResponseRecord(z, np.linspace(60.0, 90.0, 9), force=force), 500),
        (quick, jr.OrbitRecord(z), 500),
        (quick, jr.SpectrumRecord(z, np.arange(9)), 500),
        (quick, jr.TimeRecord(z, 2), 500),
        (quick, jr.TimeRecord(z, times=np.linspace(0.0, 0.1, 9)), 500),
        (ramp, jr.TimeRecord(z, times=np.linspace(0.03, 0.1, 9)), 0),
    ):
        with pytest.raises(ValueError, match=f"coefficients are needed at {speed} rad/s"):
            jr.fit(scene, record, {"disc.mass": (1.0, 20.0)})


def test_a_bound_and_parameters_that_are_not_told_apart():
    record = jr.ResponseRecord(noisy(whirl(SPEEDS)), SPEEDS)
    with pytest.raises(
        RuntimeError, match="`shaft.k11` ended on its bound 760000, where no interval"
    ):
        jr.fit(GUESS, record, {"shaft.k11": (6e5, 7.6e5)}, progress=False)
    both = {"unbalance.mass": (1.0, 20.0), "unbalance.eccentricity": (1e-6, 1e-2)}
    with pytest.raises(ValueError, match="do not tell `unbalance.mass`, `unbalance.ecc.* apart"):
        jr.fit(ROTOR, record, both, progress=False)


def test_a_record_without_noise():
    """What is left is rounding, which is not taken for a model that is wrong."""
    found = jr.fit(GUESS, jr.ResponseRecord(whirl(SPEEDS), SPEEDS), WHERE, progress=False)
    values = [float(value) for value in found.values.values()]
    assert values == pytest.approx(list(TRUE.values()), rel=1e-9)
    assert found.noise[0] < 1e-9 * np.abs(whirl(SPEEDS)).max() and found.cautions == ()


@pytest.mark.slow
def test_more_starts_leave_a_wrong_minimum():
    """From a fourth of the stiffness a decay fits nowhere near; one of eight starts finds it."""
    times = 2 * np.pi / 100.0 * np.linspace(0.0, 4.0, 65)
    start = jr.Whirl(RADIUS, angle=TURN)
    record = jr.TimeRecord(noisy(decay(times)), 4, start=start, substeps=1)
    where = {"shaft.k11": (1e5, 5e6), "disc_damping.translational": (10.0, 300.0)}
    far = FREE.replace({"shaft.k11": 2e5})
    with pytest.raises(RuntimeError, match="ended on its bound"):
        jr.fit(far, record, where, progress=False)
    found = jr.fit(far, record, where, starts=8, progress=False)
    true = {"shaft.k11": K, "disc_damping.translational": C}
    assert float(found.uncertainty.distance(true)) < stats.chi2.ppf(0.999, 2)


def test_a_better_start_on_a_bound_is_not_left_for_a_worse_one():
    """The true stiffness is beyond the bounds; a wrong minimum within fits ten times worse."""
    times = 2 * np.pi / 100.0 * np.linspace(0.0, 4.0, 65)
    record = jr.TimeRecord(noisy(decay(times)), 4, start=jr.Whirl(RADIUS, angle=TURN), substeps=1)
    near, where = FREE.replace({"shaft.k11": 7e5}), {"shaft.k11": (1e5, 7.95e5)}
    for starts in (1, 8):
        with pytest.raises(RuntimeError, match="`shaft.k11` ended on its bound 795000"):
            jr.fit(near, record, where, starts=starts, progress=False)


def test_steps_that_run_out_are_not_a_kink():
    record = jr.ResponseRecord(noisy(whirl(SPEEDS)), SPEEDS)
    with pytest.raises(RuntimeError, match="found no minimum: after 2 steps a next one"):
        jr.fit(GUESS, record, WHERE, steps=2, progress=False)
    (said,) = jr.fit(GUESS, record, WHERE, steps=6, progress=False).cautions
    assert said.startswith("The search used all its steps")


def test_noise_that_channels_share_is_told():
    """Two probes in the same place with the same noise: half of what they seem to say."""
    one = noisy(whirl(SPEEDS), seed=5)
    both = jr.ResponseRecord(np.stack([one, one], axis=1), SPEEDS, at=[0.5, 0.5])
    (said,) = jr.fit(ROTOR, both, WHERE, progress=False).cautions
    assert "correlated from channel to channel" in said
    apart = np.stack([one, noisy(whirl(SPEEDS), seed=6)], axis=1)
    assert not jr.fit(
        ROTOR, jr.ResponseRecord(apart, SPEEDS, at=[0.5, 0.5]), WHERE, progress=False
    ).cautions


@pytest.mark.long
def test_a_short_record_has_the_degrees_of_freedom_of_its_own():
    """Damping is found by six numbers beside 200 of another kind: `t` of 5 degrees, not of 204."""
    far, near = np.linspace(1500.0, 2500.0, 100), np.array([395.0, 400.0, 405.0])
    force = jr.HarmonicForce(0.5, amplitude=20.0, whirl="forward")
    pushed = 20.0 / (K - M * near**2 + 1j * C * near)
    where = {"unbalance.eccentricity": (1e-6, 1e-2), "disc_damping.translational": (1.0, 1e3)}
    true = {"unbalance.eccentricity": E, "disc_damping.translational": C}
    first = jr.ResponseRecord(noisy(whirl(far), sigma=2e-6), far)
    second = jr.ResponseRecord(noisy(pushed, sigma=5e-5), near, force=force)
    found = jr.fit(ROTOR, [first, second], where, progress=False)
    np.testing.assert_allclose(found.degrees_of_freedom, [199.0, 5.0], rtol=0.02)
    assert found.cautions[0].startswith("Record 1 has 5.0 degrees of freedom for its noise")
    many = [
        ("amplitude", noisy(whirl(far), 1000, 2e-6, seed=11)),
        ("amplitude", noisy(pushed, 1000, 5e-5, seed=12)),
    ]
    results = fitted_to_all(found, ROTOR, many, list(true.values()))
    for path, share in shares_covered(results, true).items():
        assert 0.93 < share < 0.97, path


@pytest.mark.slow
def test_a_stop_that_the_guess_does_not_reach():
    """With a gap too wide no motion says how wide; other starts find it, and the sentence says so."""
    times = 2 * np.pi / 400.0 * np.arange(2 * 32 + 1) / 32
    first = 2e-3 * np.exp(0.6j)
    clean, _ = moved(times, [first.real, first.imag, 0.0, 0.0], 400.0)
    record = jr.TimeRecord(noisy(clean), 2, start=jr.Whirl(2e-3, angle=0.6), substeps=2)
    wide = RUB.replace({"limiter.gap": 2.2e-3})
    where = {"limiter.gap": (5e-4, 3e-3)}
    with pytest.raises(ValueError, match="do not depend on `limiter.gap`.* begin where it matters"):
        jr.fit(wide, record, where, progress=False)
    found = jr.fit(wide, record, where, starts=6, progress=False)
    assert float(found.values["limiter.gap"]) == pytest.approx(GAP, rel=5e-3)


def test_an_interval_beyond_the_bounds_is_told(response):
    value, (low, high) = float(response.values["shaft.k11"]), response.intervals()["shaft.k11"]
    near = WHERE | {"shaft.k11": ((low + value) / 2, high + value)}
    scene = response.scene
    found = jr.fit(scene, response.records[0], near, progress=False)
    (said,) = found.cautions
    assert said.startswith("The interval of `shaft.k11`") and "goes beyond its bounds" in said
    with pytest.raises(ValueError, match="`level` must be a number between 0 and 1, but is 95"):
        found.intervals(95)
