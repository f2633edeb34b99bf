"""Random scenes: nothing turns out not a number, no energy from nowhere, three symmetries hold."""

import jax
import numpy as np
import pint
import pytest
from hypothesis import Phase, given, settings, strategies as st
from jeffcott import AT, jeffcott, path, state
from systems import TIME, limiter_rotor

import jaxrotor as jr


PHASES = (Phase.explicit, Phase.generate)  # a failure is shown as it is found
EXAMPLES = settings(derandomize=True, max_examples=12, deadline=None, database=None, phases=PHASES)
UNITS = pint.UnitRegistry()
# One scene whose numbers are drawn, so that one compiled program serves all examples.
ROTOR = limiter_rotor(eps=0.0, gravity=True, nodes=4)
START, TURNS, STEPS = jr.Whirl(0.01, 0.0, 0.3), 2, 512


def between(low: float, high: float):
    """Numbers spread evenly over the decades."""
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


@st.composite
def numbers(draw) -> dict[str, float]:
    """Values by path, for `ROTOR`."""
    values = {
        "spin.speed": draw(between(2.0, 30.0)) / TIME * draw(st.sampled_from([-1, 1])),
        "shaft.diameter": draw(between(0.01, 0.03)),
        "disc.mass": draw(between(0.3, 10.0)),
        "unbalance.eccentricity": draw(between(1e-6, 1e-3)),
        "unbalance.phase": draw(st.floats(-3, 3)),
        "external_damping.per_length": draw(between(0.1, 100.0)),
        "internal_damping.voigt_time": draw(between(1e-7, 1e-3)),
        "gravity.acceleration": draw(between(0.1, 10.0)),
    }
    for k in range(3):
        values |= {
            f"limiters.{k}.angle": draw(st.floats(-3, 3)),
            f"limiters.{k}.gap": draw(st.floats(-2e-3, 1.2e-2)),
            f"limiters.{k}.stiffness": draw(between(1e2, 1e6)),
            f"limiters.{k}.damping": draw(between(0.1, 30.0)),
            f"limiters.{k}.friction": draw(st.floats(0, 1)),
        }
    return values


def run(scene: jr.Scene, start=START) -> jr.TimeHistory:
    r = jr.simulate(scene, TURNS, STEPS, start=start)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves((r.velocity, r.contact_force)))
    return r


def tip(scene: jr.Scene, start=START) -> np.ndarray:
    return path(run(scene, start))[0]


def difference(found: np.ndarray, want: np.ndarray) -> float:
    assert np.isfinite(found).all() and np.isfinite(want).all()
    return float(abs(found - want).max() / abs(want).max())


@pytest.mark.slow
@pytest.mark.hard("also: random scenes, effects in another order")
def test_the_order_of_effects_is_no_matter(record_property):
    worst, touch = [], 0

    @EXAMPLES
    @given(numbers())
    def check(values):
        nonlocal touch
        scene = ROTOR.replace(values)
        r = run(scene)
        touch += int(np.any(np.asarray(r.contact_force) != 0))
        worst.append(difference(tip(scene.of_parts(*scene.effects[::-1])), path(r)[0]))
        assert worst[-1] < 1e-8

    check()
    record_property("measured", f"path {max(worst):.0e} over {len(worst)} scenes, {touch} touch")
    assert touch >= 6


@pytest.mark.slow
@pytest.mark.hard("also: random scenes, turned about the axis")
def test_a_scene_turned_about_its_axis(record_property):
    worst = []

    @EXAMPLES
    @given(numbers(), st.floats(-3, 3))
    def check(values, angle):
        turned = scene = ROTOR.replace(values)
        for one in ("unbalance.phase", "gravity.angle", *(f"limiters.{k}.angle" for k in range(3))):
            turned = turned.replace({one: float(scene.get(one)) + angle})
        found = tip(turned, jr.Whirl(0.01, 0.0, 0.3 + angle))
        worst.append(difference(found * np.exp(-1j * angle), tip(scene)))
        assert worst[-1] < 1e-8

    check()
    record_property("measured", f"path {max(worst):.0e} over {len(worst)} scenes")


def rescaled(scene: jr.Scene, length: float, mass: float, time: float) -> jr.Scene:
    """Every parameter in other units."""
    values, factors = {}, {"[length]": length, "[mass]": mass, "[time]": time}
    each = [p for p in scene.paths() if not p.startswith("limiters.")]
    each += [f"limiters.{k}.{p[9:]}" for k in range(3) for p in scene.paths() if "limiters." in p]
    for one in each:
        try:
            value = float(scene.get(one))
        except ValueError:  # absent
            continue
        powers = UNITS.parse_units(scene.unit(one).replace(" ", "*")).dimensionality
        values[one] = value * np.prod([factors[d] ** p for d, p in powers.items()])
    return scene.put({k: jax.numpy.asarray(v) for k, v in values.items()})


@pytest.mark.slow
@pytest.mark.hard("also: random scenes in other units")
def test_other_units_of_length_mass_and_time(record_property):
    """All parameters scaled by their dimensions: lengths come out scaled, and nothing else happens."""
    worst = []

    @EXAMPLES
    @given(numbers(), between(1e-3, 1e3), between(1e-3, 1e3), between(1e-3, 1e3))
    def check(values, length, mass, time):
        scene = ROTOR.replace(values)
        other = rescaled(scene, length, mass, time)
        found = tip(other, jr.Whirl(0.01 * length, 0.0, 0.3)) / length
        worst.append(difference(found, tip(scene)))
        assert worst[-1] < 1e-8

    check()
    record_property("measured", f"path {max(worst):.0e} over {len(worst)} scenes")


@pytest.mark.slow
@pytest.mark.hard("also: random passive rotors between stops, no energy from nowhere (case 1.8)")
def test_no_energy_from_nowhere(record_property):
    """No speed, no load, no friction: `|z.|^2 + |z|^2 + Sum_j K (depth)^2` never grows."""
    angles = np.array([0.3, 1.9, 4.4])
    base = jeffcott(*[jr.Limiter(AT, a, 0.1, 1.0, 0.1) for a in angles], jr.DiscDamping(AT, 0.0))
    steps, worst = 4096, []
    three = st.lists(between(0.1, 1e4), min_size=3, max_size=3)

    @EXAMPLES
    @given(three, st.floats(-0.2, 0.4), st.floats(0, 0.3), st.floats(0, 1), st.floats(-3, 3))
    def check(stiffness, gap, ratio, loss, angle):
        k = np.array(stiffness)
        values = {f"limiters.{i}.stiffness": x for i, x in enumerate(k)}
        values |= {f"limiters.{i}.damping": 2 * ratio * np.sqrt(x) for i, x in enumerate(k)}
        scene = base.replace({**values, "limiters.gap": gap, "disc_damping.translational": loss})
        start = state(0.3 * np.exp(1j * angle), np.exp(-0.7j * angle))
        period = steps * 0.03 / np.sqrt(1 + k.sum())
        r = jr.simulate(scene, 2, steps, start=start, period=period, solver=jr.Exponential(4))
        z, v = path(r)
        depth = np.maximum((z[:, None] * np.exp(-1j * angles)).real - gap, 0)
        energy = (abs(v) ** 2 + abs(z) ** 2 + (k * depth**2).sum(1)) / 2
        assert np.isfinite(energy).all()
        growth = (energy - np.minimum.accumulate(energy)).max() / energy[0]
        worst.append(growth)
        assert growth < 2e-3

    check()
    record_property("measured", f"growth {max(worst):.0e} over {len(worst)} rotors")


@pytest.mark.slow
@pytest.mark.hard("also: random scenes in one sweep, lanes that fail", outcome="flagged")
def test_lanes_that_cannot_be_computed_say_why(record_property):
    """A critical speed without damping and a lane whose start overflows: the others go on."""
    scene = jeffcott(jr.Unbalance(AT, 1.0, 0.01), jr.Limiter(AT, 0.0, 100.0, 1.0), speed=0.5)
    ds = jr.sweep(
        scene,
        {"spin.speed": [0.5, 1.0, 2.0], "start.radius": [0.1, 1e200]},
        start=jr.Whirl(0.1),
        settle=3,
        keep=2,
        observe=[jr.observe.Radius()],
        steps_per_revolution=64,
        error_sample=0,
    )
    meaning = np.array(ds.status.attrs["flag_meanings"].split())
    assert meaning[ds.status.values].tolist() == [
        ["ok", "not_finite"],
        [
            "start_or_steady_response_undefined",
            "start_or_steady_response_undefined",
        ],  # of a resonance there is no steady response
        ["ok", "not_finite"],
    ]
    record_property("measured", "4 of 6 lanes flagged with a reason, the others finite")
    good = ds.radius_max.values[ds.status.values == 0]
    assert np.isfinite(good).all() and (good > 0).all()
