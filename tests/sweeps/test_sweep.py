"""Sweeps against loops of single runs, observables against known motions."""

import contextlib
import dataclasses
import functools
import io
import itertools

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import one_disc

import jaxrotor as jr
from jaxrotor.core.outcome import STATUS
from jaxrotor.sweeps import lanes
from jaxrotor.sweeps.observable import Turn, updated


LENGTH, UNIT = 0.7, 0.022646559709295067
ROTOR = jr.load("limiter-rotor")
FEW = ROTOR.with_nodes(2)  # where numbers of the sheet are not looked at
SPEED = float(ROTOR.get("spin.speed"))
RUB = jr.Whirl(0.012 * LENGTH, -10 / UNIT)
SHORT = {"settle": 3, "keep": 2, "steps_per_revolution": 64, "progress": False, "error_sample": 0}


def whirl_rate(z: np.ndarray, steps: int) -> float:
    turned = np.angle(z[1:] * z[:-1].conj()) * steps / (2 * np.pi)
    u = (np.arange(turned.size) + 0.5) / turned.size
    weight = np.exp(-1 / (u * (1 - u)))
    return float((turned * weight).sum() / weight.sum())


# === lanes


def test_lengths_are_tried_together():
    """Each value is valid alone, but not all pairs are."""
    shaft = jr.FlexibleShaft(
        length=0.7, diameter=0.03, inner_diameter=0.01, constraints=[jr.Constraint(0.0, "clamp")]
    )
    scene = jr.Scene(shaft, jr.Disc(0.7, 2.0), jr.Disc(0.4, 1.0), spin=jr.ConstantSpeed(100.0))
    over = {"shaft.diameter": [0.02, 0.03], "shaft.inner_diameter": [0.01, 0.025]}
    with pytest.raises(ValueError, match="inner_diameter"):
        jr.sweep(scene, over)
    with pytest.raises(ValueError, match="moves a station past another"):
        jr.sweep(scene, {"discs.1.at": [0.4, 0.6], "discs.0.at": [0.5, 0.7]})


def test_too_many_lanes_are_refused():
    many = np.linspace(0, 1e-3, 100_000)
    with pytest.raises(ValueError, match=r"A sweep of 1e\+10 lanes is more than one can hold"):
        jr.sweep(
            jr.load("limiter-rotor"),
            {"start.radius": many, "start.angle": many},
            start=jr.Whirl(1e-3),
        )


@pytest.mark.parametrize(
    "given, words",
    [
        ({"precision": "half"}, '"float32" or "float64", but is \'half\''),
        ({"solver": jr.Exponential(4, located=True)}, "not `located`"),
        ({"times": np.linspace(0, 0.1, 65), "steps_per_revolution": 64}, "whole revolutions"),
        ({"solver": dfx.Tsit5()}, r"whole revolutions by Exponential\(\)"),
    ],
)
def test_refusals_of_precision(given, words):
    scene = jr.load("limiter-rotor").with_nodes(2)
    with pytest.raises(ValueError, match=words):
        jr.sweep(scene, {"limiters.gap": [7e-3]}, **{"precision": "float32", **given})


@pytest.mark.long
def test_lanes_in_single_precision_tell_their_error():
    """The whirl rate of the rub, beside that in double precision by as many steps and by twice as many."""
    over = {"start.rate": [-441.0, -430.0]}
    how = {"start": jr.Whirl(12e-3, -441.0), "settle": 200, "keep": 60, "steps_per_revolution": 64}
    how |= {"solver": jr.Exponential(4), "observe": [jr.observe.Precession()]}
    scene = ROTOR.with_nodes(3)
    single = jr.sweep(scene, over, precision="float32", **how)
    double = jr.sweep(scene, over, error_sample=0, **how)
    assert (single.attrs["precision"], double.attrs["precision"]) == ("float32 steps", "float64")
    off = np.abs(single["whirl_rate"].values - double["whirl_rate"].values).max()
    assert 0 < off < 1e-5
    finer = jr.sweep(scene, over, error_sample=0, **{**how, "steps_per_revolution": 128})
    error = np.abs(single["whirl_rate"].values - finer["whirl_rate"].values).max()
    assert single["whirl_rate"].attrs["error"] == pytest.approx(error, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "over",
    [
        {"unbalance.eccentricity": [1e-4, 5e-4], "spin.speed": [SPEED, 0.6 * SPEED]},
        {"start.radius": [1e-3, 8.4e-3, 2e-2], "limiters.friction": [0.0, 0.3]},
    ],
    ids=["speed", "start"],
)
def test_sweep_is_a_loop_of_simulations(over):
    observe = (*jr.observe.everything(), jr.observe.Contact())
    ds = jr.sweep(FEW, over, start=RUB, observe=observe, solver=jr.Exponential(), **SHORT)
    assert ds.index.dims == tuple(over)
    for point in itertools.product(*(range(len(v)) for v in over.values())):
        values = {path: over[path][i] for path, i in zip(over, point, strict=True)}
        start = jr.Whirl(values.pop("start.radius", RUB.radius), RUB.rate)
        r = jr.simulate(FEW.replace(values), 5, 64, start=start, keep=2)
        lane = ds.isel(dict(zip(over, point, strict=True)))
        z, v = np.asarray(r.displacement[:, 0]), np.asarray(r.velocity[:, 0])
        force = abs(np.asarray(r.contact_force))
        spin = float(values.get("spin.speed", SPEED))
        # Impacts multiply rounding, which differs between a program of one lane and one of many.
        close = lambda got, want: np.testing.assert_allclose(got, want, rtol=1e-7, atol=1e-11)
        close(lane.section, np.stack([z[64::64].real, z[64::64].imag], axis=1))
        close(lane.radius_min, abs(z[1:]).min())
        close(lane.radius_max, abs(z[1:]).max())
        close(lane.radius_rms, np.sqrt(np.mean(abs(z[1:]) ** 2)))
        close(lane.index, np.mean((z[1:].conj() * v[1:]).imag / abs(z[1:]) ** 2) / spin)
        close(lane.winding, np.angle(z[1:] / z[:-1]).sum() / (2 * np.pi) / 2)
        close(lane.whirl_rate, whirl_rate(z, 64))
        close(lane.duty, np.mean(force[1:] > 0, axis=0))
        close(lane.peak_force, force[1:].max(axis=0))
        assert int(lane.status) == 0


@pytest.mark.slow
def test_chunks_and_workers_do_not_change_results():
    over = {"unbalance.eccentricity": np.linspace(0, 1e-3, 5)}
    whole = jr.sweep(FEW, over, start=RUB, workers=1, **SHORT)
    parts = jr.sweep(FEW, over, start=RUB, lanes_per_chunk=2, workers=2, **SHORT)
    for name in whole:
        np.testing.assert_allclose(parts[name], whole[name], rtol=1e-10, atol=1e-14)


@pytest.mark.long
def test_adaptive_solver_in_a_sweep():
    over = {"unbalance.eccentricity": [1e-4, 5e-4]}
    ds = jr.sweep(FEW, over, start=RUB, solver=dfx.Kvaerno5(), **SHORT)
    fine = jr.sweep(FEW, over, start=RUB, **(SHORT | {"steps_per_revolution": 4096}))
    assert ds.status.values.tolist() == [0, 0]
    np.testing.assert_allclose(ds.section, fine.section, atol=2e-6)
    np.testing.assert_allclose(ds.winding, fine.winding, atol=2e-4)
    assert ds.attrs["solver"] == "Kvaerno5"


@pytest.mark.slow
def test_a_solver_that_gives_up_is_one_of_the_reasons():
    over = {"unbalance.eccentricity": [1e-4]}
    ds = jr.sweep(FEW, over, start=RUB, solver=dfx.Tsit5(), max_steps=2, **SHORT)
    assert ds.status.attrs["flag_meanings"].split()[ds.status.item()] == "solver_gave_up"


@pytest.mark.slow
def test_silent_unless_asked():
    over = {"unbalance.eccentricity": [0.0]}
    for progress in (None, True):
        noise = io.StringIO()
        with contextlib.redirect_stderr(noise), contextlib.redirect_stdout(noise):
            jr.sweep(FEW, over, **(SHORT | {"progress": progress}))
        assert bool(noise.getvalue()) == (progress is True)


@pytest.mark.slow
def test_provenance_brings_the_scene_back():
    scene = FEW.replace({"limiters.gap": 1 / 300, "unbalance.phase": 0.1})
    ds = jr.sweep(scene, {"unbalance.eccentricity": [0.0]}, start=RUB, **SHORT)
    again = jr.loads(ds.attrs["scene"])
    assert jax.tree.structure(again) == jax.tree.structure(scene)
    assert all(
        bool(jnp.array_equal(a, b))
        for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(scene), strict=True)
    )
    assert (ds.attrs["settle"], ds.attrs["keep"], ds.attrs["steps_per_revolution"]) == (3, 2, 64)
    assert ds.attrs["precision"] == "float64"
    assert ds["unbalance.eccentricity"].attrs["units"] == "m"
    assert all("long_name" in ds[name].attrs for name in ds)


# === observables


def observed(one, path, count: int, steps: int, speed: float = 1.0, force=None):
    """Variables that an observable reports of `path(t)`, whose velocity is found by differences."""
    carry = one.start(0 if force is None else force(np.zeros(1)).shape[1])
    update = eqx.filter_jit(one.update)
    stored = []
    for number in range(count):
        t = 2 * np.pi * (number + np.arange(steps + 1) / steps) / speed
        velocity = (path(t + 1e-6) - path(t - 1e-6)) / 2e-6
        turn = Turn(
            jnp.asarray(path(t) + 0j),
            jnp.asarray(velocity + 0j),
            None if force is None else jnp.asarray(force(t) + 0j),
            jnp.asarray(number),
            jnp.asarray(2 * np.pi / steps / speed),
            jnp.asarray(1.0),
            count,
        )
        carry, out = update(carry, turn)
        stored.append(out)
    lane = jax.tree.map(lambda leaf: np.asarray(leaf)[None], carry)
    stored = jax.tree.map(lambda *parts: np.stack(parts)[None], *stored)
    return {name: v.values for name, v in one.report(lane, stored, count).items()}


def test_orbit_is_every_step_of_every_revolution():
    found = observed(jr.observe.Orbit(), lambda t: t * np.exp(0.3j * t), 3, 16)["orbit"]
    t = 2 * np.pi * np.arange(1, 3 * 16 + 1) / 16
    want = t * np.exp(0.3j * t)
    want = np.stack([want.real, want.imag], -1).reshape(3, 16, 2)
    np.testing.assert_allclose(found[0], want, atol=1e-12)


def test_section_is_the_end_of_every_revolution():
    found = observed(jr.observe.Section(), lambda t: t * np.exp(0.3j * t), 4, 16)["section"]
    t = 2 * np.pi * np.arange(1, 5)
    want = t * np.exp(0.3j * t)
    np.testing.assert_allclose(found[0], np.stack([want.real, want.imag], 1), atol=1e-12)


def test_extrema_of_a_known_motion():
    path = lambda t: np.cos(t + 0.3) + 0.5 * np.sin(3 * t) + 0j
    found = observed(jr.observe.Extrema(), path, 2, 64)["extrema"]
    fine = np.linspace(0, 2 * np.pi, 2_000_001)
    x = path(fine).real
    turns = x[1:-1][(np.diff(x)[:-1] * np.diff(x)[1:]) < 0]
    for kept in found[0]:
        assert np.sort(kept[np.isfinite(kept)]) == pytest.approx(np.sort(turns), abs=5e-5)
    errors = []
    for steps in (32, 64, 128):
        kept = observed(jr.observe.Extrema(), path, 1, steps)["extrema"][0, 0]
        errors.append(abs(np.sort(kept[np.isfinite(kept)]) - np.sort(turns)).max())
    assert errors[2] < errors[0] / 30  # fourth order while steps are fine


def test_extrema_beyond_the_room_are_counted():
    one = jr.observe.Extrema(most=3)
    found = observed(one, lambda t: np.cos(4 * t + 0.1) + 0j, 5, 128)
    assert found["extrema"].shape == (1, 5, 3)
    assert found["extrema_missed"].tolist() == [25]


@pytest.mark.parametrize("rate", [1.0, -0.5, 0.118])
def test_precession_of_a_circle(rate):
    found = observed(jr.observe.Precession(), lambda t: np.exp(1j * rate * t), 7, 32)
    for name in ("index", "winding", "whirl_rate"):
        assert found[name][0] == pytest.approx(rate, abs=1e-9)


@pytest.mark.slow
def test_precession_of_unbalance_response_is_one():
    linear = ROTOR.without("limiters").replace({"spin.speed": 0.6 * SPEED})
    ds = jr.sweep(linear, {"unbalance.eccentricity": [1e-4]}, settle=2000, keep=3, progress=False)
    radius = abs(
        complex(
            jr.unbalance_response(
                linear.replace({"unbalance.eccentricity": 1e-4}), 0.6 * SPEED
            ).forward[0, 0]
        )
    )
    for name in ("index", "winding", "whirl_rate"):
        assert ds[name].item() == pytest.approx(1, abs=1e-8)
    for name in ("radius_min", "radius_max", "radius_rms"):
        assert ds[name].item() == pytest.approx(radius, rel=1e-8)


OF_ROWS = (*jr.observe.everything(True), jr.observe.Orbit(), jr.observe.Reversal(window=1))


@pytest.mark.parametrize("steps", [33, 32])
def test_observables_of_all_lanes_at_once_are_those_of_each(steps):
    """Lanes along a last axis; some rest in the centre, and steps and senses differ."""
    draw, lanes, count = np.random.default_rng(0), 5, 4
    shape = lambda *sizes: jnp.asarray(draw.normal(size=(steps + 1, *sizes, lanes)) + 0j)
    z, velocity = shape() * jnp.array([1, 1j, 1, 0, 1]) + 1j * shape(), shape() + 1j * shape()
    still = jnp.array([1, 1, 1, 0, 1])
    force = shape(2) * (draw.uniform(size=(steps + 1, 2, lanes)) > 0.5)
    number, length = jnp.asarray(2), jnp.linspace(0.1, 0.2, lanes)
    sense = jnp.array([1.0, -1.0, 1.0, 1.0, 0.0])
    turn = Turn(z * still, velocity * still, force, number, length, sense, count)
    one_by_one = dataclasses.replace(turn, number=jnp.full(lanes, 2))
    spectrum = [jr.observe.WhirlSpectrum()] * (steps == 32)
    for one in (*OF_ROWS, *spectrum):
        carry = jax.tree.map(lambda leaf: jnp.stack([leaf] * lanes, -1), one.start(2))
        found = jax.jit(functools.partial(updated, one))(carry, turn)
        wanted = jax.jit(jax.vmap(one.update, in_axes=-1, out_axes=-1))(carry, one_by_one)
        assert "rows" in vars(type(one)) and one.rows
        jax.tree.map(
            functools.partial(np.testing.assert_allclose, rtol=1e-12, atol=1e-12), found, wanted
        )


class Distance(jr.observe.AbstractStored):
    """An observable of one's own, which is written for one lane."""

    def update(self, carry, turn):
        return carry, jnp.sort(jnp.abs(turn.z[1:]))[-1] + 0 * turn.number

    def report(self, carry, stored, count):
        return {"distance": jr.observe.Variable(("revolution",), stored, "m", "largest radius")}


def test_an_observable_of_ones_own_sees_one_lane():
    run = {"settle": 0, "keep": 3, "progress": False, "error_sample": 0}
    over = {"unbalance.eccentricity": [1e-4, 1e-3]}
    ds = jr.sweep(
        FEW, over, steps_per_revolution=32, observe=(Distance(), jr.observe.Orbit()), **run
    )
    radius = np.linalg.norm(ds["orbit"], axis=-1).max(axis=-1)
    np.testing.assert_allclose(ds["distance"], radius, rtol=1e-12)


def test_contact_of_a_known_force():
    force = lambda t: np.stack([3j * (np.sin(t) > 0.5), 0 * t + 2.0], axis=1)
    found = observed(jr.observe.Contact(), lambda t: np.exp(1j * t), 3, 360, force=force)
    assert found["duty"][0] == pytest.approx([1 / 3, 1], abs=1 / 180)
    assert found["peak_force"][0].tolist() == [3, 2]


@pytest.mark.slow
def test_contacts_of_lanes_are_those_of_each():
    """Several kinds of law at a station, in the order of the scene."""
    film = {"viscosity": 0.02, "radius": 0.04, "length": 0.03, "clearance": 2e-3}
    laws = (
        jr.Limiter(0.5, 0.7, 2e-4, 4e5, 60.0, 0.1, rim_radius=0.1, blend=1e-5),
        jr.CubicSpring(0.5, 0.3, 1e11),
        jr.AnnularStator(0.5, 4e-4, 1e5, 30.0, 0.1, rim_radius=0.1, offset=1e-5),
        jr.SqueezeFilm(0.5, **film),
        jr.Limiter(0.5, 2.8, 1e-4, 3e5, 20.0, rim_radius=0.1),
    )
    rotor = one_disc(*laws, speed=80.0, stiffness=6000.0, eccentricity=2e-4)
    run = {"steps_per_revolution": 32, "start": jr.Whirl(5e-4, 20.0), "solver": jr.Exponential(2)}
    over = {"limiters.0.stiffness": [3e5, 4e5], "unbalance.eccentricity": [2e-4, 3e-4]}
    how = {"settle": 0, "keep": 2, "progress": False, "error_sample": 0}
    ds = jr.sweep(rotor, over, observe=[jr.observe.Contact()], **how, **run)
    for lane in [dict(zip(over, ends, strict=True)) for ends in zip(*over.values(), strict=True)]:
        alone = jr.simulate(rotor.replace(lane), 2, **run)
        size = np.abs(np.asarray(alone.contact_force))
        found = ds.sel(lane)
        np.testing.assert_allclose(found["peak_force"], size[1:].max(0), rtol=1e-9)
        np.testing.assert_allclose(found["duty"], (size[1:] > 0).mean(0), atol=1e-12)
    assert (ds["duty"] > 0).all()


def test_spectrum_of_a_known_whirl():
    """Lambda = 0.5 + 0.2 cos 3 theta."""
    path = lambda t: np.exp(1j * (0.5 * t + 0.2 / 3 * np.sin(3 * t)))
    found = observed(jr.observe.WhirlSpectrum(), path, 20, 128)
    spectrum, frequency = found["spectrum"][0], found["frequency"]
    peak = int(np.argmax(spectrum))
    assert frequency[peak] == pytest.approx(3)
    assert spectrum[peak] == pytest.approx(0.2, rel=1e-3)
    away = abs(frequency - 3) > 0.2
    assert spectrum[away].max() < 1e-3


def test_spectrum_of_the_highest_frequency_and_of_rest():
    """The amplitude of a Lambda that alternates is counted once; at the centre there is none."""
    samples = jr.observe.WhirlSpectrum().samples
    sign = lambda t: 1 - 2 * (np.floor(t * samples / (2 * np.pi) - 1e-9) % 2)
    rises = lambda t: np.concatenate([[0.0], np.cumsum(0.2 * sign(t[1:]) * np.diff(t))])
    path = lambda t: np.exp(1j * (0.5 * t + rises(t)))
    found = observed(jr.observe.WhirlSpectrum(), path, 20, 4 * samples)
    highest = found["spectrum"][0, -1] * np.sinc(0.5)  # as if sampled, not averaged
    assert found["frequency"][-1] == samples / 2 and highest == pytest.approx(0.2, rel=1e-6)
    still = observed(jr.observe.WhirlSpectrum(), lambda t: np.exp(1j * t) * (t > 1), 4, 128)
    assert np.isnan(still["spectrum"]).all()


def test_spectrum_needs_steps_that_divide():
    with pytest.raises(ValueError, match="must be a multiple"):
        jr.sweep(
            ROTOR,
            {"unbalance.eccentricity": [0.0]},
            observe=(jr.observe.WhirlSpectrum(),),
            **(SHORT | {"steps_per_revolution": 100}),
        )


@pytest.mark.slow
def test_spectrum_of_the_rub_peaks_at_three_whirls():
    """The orbit meets three stops a turn, which gives a peak at 3 |Lambda| cycles a revolution."""
    ds = jr.sweep(
        ROTOR,
        {"unbalance.eccentricity": [0.0]},
        start=RUB,
        settle=100,
        keep=100,
        error_sample=0,
        observe=(jr.observe.WhirlSpectrum(), jr.observe.Precession(), jr.observe.Contact()),
    )
    peak = float(ds.frequency[int(ds.spectrum[0].values.argmax())])
    assert peak == pytest.approx(3 * 0.567622, abs=0.01)
    assert ds.whirl_rate.item() == pytest.approx(-0.567622, abs=1e-4)
    assert np.ptp(ds.duty.values) < 0.01
    assert np.ptp(ds.peak_force.values) < 0.02 * float(ds.peak_force.max())


# === section 3.5 of the sheet

FOUR = ROTOR.with_nodes(4)  # long runs, of which no digits are looked at


@pytest.mark.slow
def test_forward_at_small_and_backward_at_large_eccentricity():
    """Started on the rub, large unbalance locks it to -1/2; from rest, small leaves it forward."""
    kept = {"keep": 100, "error_sample": 0}
    small = {"unbalance.eccentricity": np.linspace(0.0, 3e-4, 8) * LENGTH}
    ds = jr.sweep(FOUR, small, start=jr.Whirl(1e-3 * LENGTH), settle=1000, **kept)
    assert np.all((ds.index > 0.05) & (ds.index < 0.2))
    large = {"unbalance.eccentricity": np.linspace(9e-4, 1.43e-3, 8) * LENGTH}
    ds = jr.sweep(FOUR, large, start=RUB, settle=300, **kept)
    assert ds.winding.values == pytest.approx(-0.5, abs=0.02)


@pytest.mark.slow
def test_large_eccentricity_escapes_to_the_rub_from_rest():
    """The transient is chaotic: in 3000 revolutions almost every lane escapes.

    As many lanes and revolutions that are kept as in the test above: one program.
    """
    over = {"unbalance.eccentricity": np.linspace(1.2e-3, 1.4e-3, 8) * LENGTH}
    kept = {"keep": 100, "error_sample": 0}
    ds = jr.sweep(FOUR, over, start=jr.Whirl(1e-3 * LENGTH), settle=3000, **kept)
    assert np.count_nonzero(ds.winding < -0.4) >= 6


@pytest.mark.slow
def test_states_are_carried_up_and_down():
    """The sweep is a loop of simulations, each from the end of the one before, in all coordinates."""
    values = np.array([1e-4, 5e-4, 1e-3])
    over = {"start.angle": [0.0, 1.0], "unbalance.eccentricity": values}
    start = jr.Whirl(7e-3, rate=75.0)
    how = SHORT | {"carry": "unbalance.eccentricity", "solver": jr.Exponential()}
    found = jr.sweep(FEW, over, start=start, **how)
    assert found["index"].dims[:2] == ("branch", "unbalance.eccentricity")
    assert found["branch"].values.tolist() == ["up", "down"] and (found["status"] == 0).all()
    for angle in (0.0, 1.0):
        state = jr.Whirl(7e-3, rate=75.0, angle=angle)
        for branch, values_ in (("up", values), ("down", values[::-1])):
            for value in values_:
                one = FEW.replace({"unbalance.eccentricity": value})
                run = jr.simulate(one, 5, 64, start=state, keep=1)
                state = run.end
                seen = found.sel(
                    {"branch": branch, "unbalance.eccentricity": value, "start.angle": angle}
                )
                z = complex(run.displacement[-1, 0])
                assert seen["section"][-1].values == pytest.approx([z.real, z.imag], abs=1e-9)


@pytest.mark.slow
def test_a_lane_that_fails_goes_on_from_where_it_came():
    """Far above its onset speed a rotor without stops diverges; the lanes below are not affected.

    After some of the revolutions its state is finite, but the square of the state is not.
    """
    scene = ROTOR.without("limiters")
    speeds = np.array([0.5, 0.6, 30.0]) * SPEED
    how = {"start": jr.Whirl(1e-3), "keep": 2, "steps_per_revolution": 16, "progress": False}
    for settle in (400, 800):
        found = jr.sweep(scene, {"spin.speed": speeds}, carry="spin.speed", settle=settle, **how)
        status = found["status"].values
        assert status[0, 2] == status[1, 2] == 1 and (status[:, :2] == 0).all()  # not finite


@pytest.mark.parametrize(
    ("carry", "more", "words"),
    [
        ("spin.speed", {}, "`carry` must be one of the paths of `over`"),
        ("start.radius", {}, "`carry` keeps the state of a lane"),
        ("unbalance.eccentricity", {}, "must be two or more numbers that ascend, or descend"),
        ("limiters.gap", {"error_sample": 1}, "`error_sample` runs single lanes again"),
        ("limiters.gap", {"kick": 0.1}, "`kick` moves a ball .* without balls; leave it out"),
        (None, {"kick": 0.1}, "without `carry`; leave it out"),
        ("limiters.gap", {"kick": np.nan}, "must be a finite angle"),
    ],
)
def test_refusals_of_carry(carry, more, words):
    over = {
        "unbalance.eccentricity": [2e-4, 1e-4, 3e-4],
        "start.radius": [1e-3],
        "limiters.gap": [7e-3, 8e-3],
    }
    with pytest.raises(ValueError, match=words):
        jr.sweep(ROTOR, over, start=jr.Whirl(1e-3), carry=carry, **more)


def test_a_straight_oscillation_through_the_centre_has_no_whirl():
    """At half the spin speed every 16th sample is in the centre to within rounding."""
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e4), jr.Disc(0.5, 1.0), spin=jr.ConstantSpeed(200.0)
    )
    start, kept = jr.Whirl(1e-3, rate=0.0), {"settle": 1, "keep": 4, "steps_per_revolution": 32}
    dataset = jr.sweep(scene, {"start.radius": [1e-3, 2e-3]}, start=start, **kept)
    assert np.isnan(dataset["index"]).all()
    assert (dataset["status"] == STATUS.index("whirl_undefined")).all()


@pytest.mark.slow
def test_lanes_of_equal_equations_are_decomposed_once(monkeypatch):
    """Four unbalances at each of two speeds: two decompositions, and the same numbers as without."""
    scene = jr.load("limiter-rotor").with_nodes(2)
    over = {
        "spin.speed": [600.0, 660.0],
        "unbalance.eccentricity": [1e-4, 2e-4, 3e-4, 4e-4],
    }
    run = {"settle": 1, "keep": 2, "steps_per_revolution": 32, "observe": [jr.observe.Radius()]}
    run["error_sample"] = 0
    decomposed, calls = lanes._decomposed, []
    monkeypatch.setattr(lanes, "_decomposed", lambda one: calls.append(one) or decomposed(one))
    alone = jr.sweep(scene, over, **run, workers=1)
    assert not calls
    monkeypatch.setattr(lanes, "MANY_NODES", 1)
    shared = jr.sweep(scene, over, **run, workers=1)
    assert len(calls) == 2
    for name in ("radius_min", "radius_max", "radius_rms"):
        np.testing.assert_allclose(shared[name], alone[name], rtol=1e-9)
