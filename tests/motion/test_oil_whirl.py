"""Motions in oil films: whirl beyond the threshold, orbits of a damper, and SciPy on its own equations."""

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad_vec, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, fsolve

import jaxrotor as jr


def mass(*parts, speed):
    """A unit mass at a point, on a shaft without stiffness to speak of."""
    shaft, disc = jr.MasslessShaft(1.0, 0.5, 1e-9), jr.Disc(0.5, 1.0)
    return jr.Scene(shaft, disc, *parts, spin=jr.ConstantSpeed(speed))


def film(scale, kind=jr.JournalBearing, **values):
    """A film of clearance 1 and `k0 = scale`."""
    return kind(0.5, scale, 1.0, 1.0, 1.0, **values)


def at(z, v):
    return jr.Continued(jnp.array([z + 0j]), jnp.array([v + 0j]))


def late(scene, start, revolutions):
    """The last 100 of some revolutions, by one program for all."""
    return jr.simulate(scene, revolutions, 64, keep=100, start=start, solver=dfx.Dopri8())


def whirl(scene, start, revolutions):
    """Whirl over speed, smallest and largest eccentricity of the last revolutions."""
    return measured(late(scene, start, revolutions), float(scene.spin.speed))


def measured(run, speed):
    z, time = np.asarray(run.displacement)[:, 0], np.asarray(run.time)
    y = z.imag - z.imag.mean()
    curve, up = CubicSpline(time, y), np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    first, last = (brentq(curve, time[i], time[i + 1], xtol=1e-13) for i in up[[0, -1]])
    return 2 * np.pi * (up.size - 1) / (last - first) / speed, np.abs(z).min(), np.abs(z).max()


def rigid(sigma, speed):
    """A rigid rotor under its weight."""
    return mass(jr.Gravity(1.0), film(4 * sigma), speed=speed)


def flexible(speed):
    """A tenth of the mass in the journal, the rest on a spring of natural frequency 1: sheet 8."""
    cage = jr.Support(0.5, 0.9, on="disc"), jr.Support(of="disc", stiffness=0.0, damping=0.036)
    parts = jr.Disc(0.5, 0.1), jr.Casing("disc", 0.9), *cage, jr.Gravity(1.0), film(1.2)
    return jr.Scene(jr.MasslessShaft(1.0, 0.5, 1e-9), *parts, spin=jr.ConstantSpeed(speed))


def near(found, known):
    """The rate to 1e-6, the extremes, which fall between samples, to 2e-5."""
    assert found[0] == pytest.approx(known[0], rel=1e-6)
    assert found[1:] == pytest.approx(known[1:], rel=2e-5)


@pytest.mark.slow
def test_large_whirl_beside_a_stable_rest():
    """Subcritical: below the threshold a kicked rotor whirls, one let go near its rest does not.

    The whirl beyond a threshold is among the orbits below.
    """
    speed = 0.97 * 2.75064044
    kicked = at(0.767, 0.767j * 0.4993 * speed)
    found = whirl(rigid(1.5, speed), kicked, 300)
    near(found, (0.499326667, 0.76137742, 0.77128502))
    scene = rigid(1.5, speed)
    rest = complex(jr.static_positions(scene).position[0, 0])
    calm = late(scene, at(rest + 1e-3, 0), 340)
    assert np.max(np.abs(np.asarray(calm.displacement) - rest)) < 3e-4


@pytest.mark.slow
@pytest.mark.hard("8.7 oil whip, which is locked to the natural frequency of the shaft")
def test_oil_whip_of_a_flexible_rotor():
    """A tenth of the mass in the journal, the rest on a spring of natural frequency 1: sheet 8."""
    start = jr.Continued(jnp.array([0.8, 4.0 + 0j]), 1j * jnp.array([0.8, 4.0]))
    rate, _, largest = whirl(flexible(3.0), start, 300)
    assert 3.0 * rate == pytest.approx(0.96231767, rel=1e-5)
    assert largest == pytest.approx(0.817388, rel=1e-4)


@pytest.mark.long
@pytest.mark.hard("8.7 oil whip below its onset, carried down, beside the stable rest")
def test_whip_has_hysteresis():
    """Sheet 8: whip carried down lasts to 1.66 and is over at 1.62; its onset on the way up is 1.763."""
    start = jr.Continued(jnp.array([0.8, 4.0 + 0j]), 0.86j * jnp.array([0.8, 4.0]))
    how = {"keep": 30, "solver": dfx.Dopri8()}
    known = {1.8: (0.86287026, 0.890749), 1.73: None, 1.66: (0.80250333, 0.779855), 1.62: None}
    for speed, expected in known.items():
        run = jr.simulate(flexible(speed), 100, 32, start=start, **how)
        start = run.end.shaft
        if expected is not None:
            rate, _, largest = measured(run, speed)
            assert speed * rate == pytest.approx(expected[0], rel=1e-3)
            assert largest == pytest.approx(expected[1], rel=1e-4)
        elif speed == 1.73:
            assert np.ptp(np.asarray(run.displacement)[:, 0].real) > 1.5
    run = jr.simulate(flexible(1.62), 100, 32, start=start, **how)
    assert np.ptp(np.asarray(run.displacement)[:, 0].real) < 0.1  # it comes to rest
    rest = 0.359 - 0.209j  # about that under its weight, with the disc's on its spring
    start = jr.Continued(jnp.array([rest + 0.02, rest - 1j]), jnp.zeros(2) + 0j)
    calm = jr.simulate(flexible(1.73), 100, 32, start=start, **how)
    assert np.ptp(np.asarray(calm.displacement)[:, 0].real) < 0.05


@pytest.mark.slow
@pytest.mark.hard("8.7 oil whirl of a rotor that its film alone holds, as orbits, stable or not")
def test_whirls_are_orbits_with_their_multipliers():
    """Sheet 8: above its threshold, sigma 0.3; below it, sigma 1.5, unstable, and large."""
    cases = (  # sigma, speed, centre, radius, guess of the rate; rate, extremes, second multiplier
        (0.3, 1.005 * 2.59133483, 0.29 - 0.126j, 0.12, 0.519),
        (1.5, 0.99 * 2.75064044, 0.07 - 0.01j, 0.25, 0.5005),
        (1.5, 0.97 * 2.75064044, 0.0, 0.767, 0.4995),
    )
    known = (
        (0.519014768, 0.19972033, 0.41947616, 0.974269),
        (0.500518140, 0.18918166, 0.31314390, 1.031737),
        (0.499326667, 0.76137742, 0.77128502, 0.916141),
    )
    for (sigma, speed, centre, radius, rate), (*motion, multiplier) in zip(
        cases, known, strict=True
    ):
        scene = rigid(sigma, speed)
        start, period = at(centre + radius, 1j * radius * rate * speed), 2 * np.pi / rate / speed
        how = {"solver": jr.Exponential(4), "steps_per_revolution": round(2000 * rate)}
        orbit = jr.periodic(scene, start, period=period, **how)  # 2000 steps, so one program
        z = np.abs(np.asarray(orbit.displacement)[:, 0])
        whirl = 2 * np.pi / float(orbit.period) / speed
        assert whirl == pytest.approx(motion[0], rel=1e-8)
        assert (z.min(), z.max()) == pytest.approx(
            motion[1:], rel=2e-5
        )  # they fall between samples
        assert float(np.abs(orbit.multipliers[0])) == pytest.approx(multiplier, abs=1e-6)


@pytest.mark.slow
def test_motions_are_those_of_scipy():
    """Unbalance and weight from rest, by default, by exponential steps and by `run_up`."""
    speed, scale, e = 2.0, 1.2, 0.1
    parts = jr.Gravity(1.0), jr.Unbalance(0.5, 1.0, e), jr.Support(0.5, 0.3), film(scale)
    scene = mass(*parts, speed=speed)

    def rates(t, y):
        z, v = y[0] + 1j * y[1], y[2] + 1j * y[3]
        w = v - 0.5j * speed * z
        turn = lambda phi: w * np.exp(1j * phi)
        u = np.exp(1j * np.angle(w))
        part = lambda phi: (
            np.cos(phi) * turn(phi) / (1 - (np.conj(z) * u * np.exp(1j * phi)).real) ** 3
        )
        force = -scale * quad_vec(part, -np.pi / 2, np.pi / 2, epsabs=1e-13, epsrel=1e-12)[0]
        a = force - 0.3 * z - 1j + e * speed**2 * np.exp(1j * speed * t)
        return [v.real, v.imag, a.real, a.imag]

    period = 2 * np.pi / speed
    known = solve_ivp(rates, (0, 2 * period), [0.0] * 4, "DOP853", rtol=1e-10, atol=1e-12).y[:2, -1]
    runs = (
        (jr.simulate(scene, 2, 16), 1e-8),
        (jr.run_up(scene, np.linspace(0, 2 * period, 33)), 1e-8),
        (jr.simulate(scene, 2, 1024, solver=jr.Exponential(4)), 1e-8),
    )
    for run, error in runs:
        assert abs(complex(np.asarray(run.displacement)[-1, 0]) - complex(*known)) < error


@pytest.mark.long
@pytest.mark.hard(
    "8.9 three orbits of a squeeze film damper, and the fold in which two of them end"
)
def test_damper_has_several_orbits():
    """Unbalance response (14) of a mass on a cage: three circles at r = 2.6, one with a full film.

    Two of the three meet in a fold at a lower speed.
    """
    rate, b, u = 2.6, 0.1, 0.4

    def excess(e, rate):
        """Square of (14), left minus right, of a half film."""
        s = np.sqrt(1 - e**2)
        stiff, damped = 1 - rate**2 + 2 * b * rate * e / s**4, b * rate * np.pi / (2 * s**3)
        return e**2 * (stiff**2 + damped**2) - (u * rate**2) ** 2

    def fold_of(e, rate):
        return excess(e, rate), (excess(e + 1e-6, rate) - excess(e - 1e-6, rate)) / 2e-6

    def orbit(e, cavitated=True):
        s = np.sqrt(1 - e**2)
        stiff, damped = (2 * b * rate * e / s**4, np.pi / 2) if cavitated else (0.0, np.pi)
        phase = -np.angle(1 - rate**2 + stiff + 1j * b * rate * damped / s**3)
        damper = film(b, jr.SqueezeFilm, cavitated=cavitated)
        scene = mass(jr.Support(0.5, 1.0), damper, jr.Unbalance(0.5, 1.0, u), speed=rate)
        start, solver = jr.Whirl(e, rate, phase), jr.Exponential(4)
        found = jr.periodic(scene, start, steps_per_revolution=192, solver=solver)
        growth = np.log(np.max(np.abs(found.multipliers))) * rate / (2 * np.pi)
        return np.abs(np.asarray(found.displacement)).ravel(), growth, found

    cases = {
        0.508499218: (0.5, -0.178819, True),
        0.785185011: (0.78, 0.478155, True),
        0.859282184: (0.86, -1.010162, True),
        0.460096063: (0.45, None, False),
    }
    for radius, (guess, growth, cavitated) in cases.items():
        found, grows, last = orbit(guess, cavitated)
        np.testing.assert_allclose(found, radius, rtol=1e-7)
        assert growth is None or grows == pytest.approx(growth, rel=1e-4)
        if guess == 0.5:
            branch = jr.continue_(last, "spin.speed", (2.0, 2.7), direction="down")
            fold = branch.of("fold")[0]
            radius, place = fsolve(lambda x: fold_of(*x), [0.65, 2.1], xtol=1e-13)
            assert (place, radius) == pytest.approx((2.11302071, 0.6533), rel=2e-4)  # of the sheet
            assert fold.value == pytest.approx(place, rel=1e-8)
            assert float(fold.radius_max[0]) == pytest.approx(radius, rel=1e-6)


@pytest.mark.slow
def test_a_whirl_starts_alike_whatever_steps_it():
    """The shape in which the shaft is bent is that of its own supports, without what films lend."""
    supports = jr.Support(0.0, 0.3), jr.Support(1.0, 0.2)
    parts = jr.Disc(0.4, 1.0, 0.1, 0.1), jr.Unbalance(0.4, 1.0, 0.01), film(1.2), *supports
    scene = jr.Scene(jr.RigidShaft(1.0, constraints=[]), *parts, spin=jr.ConstantSpeed(2.0))
    start = jr.Whirl(0.3, 1.0)
    runs = [jr.simulate(scene, 1, 16, start=start, solver=s) for s in (jr.Exponential(4), None)]
    first, second = (np.asarray(run.coordinates[0]) for run in runs)
    np.testing.assert_allclose(first, second, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.hard(
    "8.1 a journal at its wall, and a rotor that floats in its films at standstill",
    outcome="refused",
)
def test_rotor_held_by_films_alone():
    """Integrated by default, or by exponential steps, which need a speed or something else to hold it."""
    films = [film(1.2, offset=0.0), jr.JournalBearing(0.0, 1.2, 1.0, 1.0, 1.0)]
    shaft = jr.RigidShaft(0.5, constraints=[])
    parts = jr.Disc(0.25, 2.0, 0.1, 0.1), jr.Gravity(1.0)
    scene = jr.Scene(shaft, *parts, *films, spin=jr.ConstantSpeed(2.0))
    with pytest.raises(ValueError, match=r"nothing linear holds it \(journal_bearings.0 and"):
        jr.simulate(scene.at_speed(0.0), 2, period=1.0, solver=jr.Exponential())
    begin = lambda z: jr.Continued(jnp.array([z + 0j, 0]), jnp.zeros(2) + 0j)
    how = {"keep": 1, "max_steps": 200}
    run = jr.simulate(scene, 60, 16, start=begin(0.0), **how)
    assert run.solver == "Dopri8"
    rest = jr.static_positions(scene).position[0, 0]
    np.testing.assert_allclose(run.displacement, complex(rest), atol=1e-6)
    stepped = jr.simulate(scene, 60, 128, start=begin(0.0), keep=1, solver=jr.Exponential(4))
    np.testing.assert_allclose(stepped.displacement, complex(rest), atol=1e-6)
    weight = complex(np.sum(stepped.contact_force[-1]))  # of the films alone, nothing lent
    assert weight == pytest.approx(2j, abs=1e-5)
    with pytest.raises(RuntimeError):
        jr.simulate(scene, 60, 16, start=begin(1.2), **how)
