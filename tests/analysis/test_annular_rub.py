"""Full rubs in closed form: against the tables of the sheet, motions in time and periodic orbits."""

import dataclasses
import functools
import importlib
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import check_forward
from systems import LENGTH, RIGIDITY, RIM, TIME, limiter_rotor

import jaxrotor as jr


AT = 0.5


def rotor(zeta, beta, friction, gap, speed, *, damper=0.0, eccentricity=1.0, rim=1.0, **law):
    """A mass of 1 on a shaft of stiffness 1 in a ring: section 3 of the sheet."""
    return jr.Scene(
        jr.MasslessShaft(1.0, AT, 1.0),
        jr.Disc(AT, 1.0),
        jr.DiscDamping(AT, 2 * zeta),
        jr.Unbalance(AT, 1.0, eccentricity),
        jr.AnnularStator(AT, gap, beta, damper, friction, rim, **law),
        spin=jr.ConstantSpeed(speed),
    )


S1, S2, S3 = (0.03, 25, 0.12, 1.6), (0.1, 4, 0.35, 2.5), (0.08, 6, 0.05, 2)
TABLE = {  # numbers of the sheet, 3.1: speed, branch; R, Nf, phi, rate and frequency of the leading root
    "R1": (S1, 1.2, 0, 1.6852503878, 2.131259695, -0.264956715, 0.0966957271, 5.523896936),
    "R2": (S1, 2.0, 0, 1.9884333975, 9.710834939, -0.358615397, 0.1597032256, 6.235409828),
    "R3": (S1, 2.0, 1, 1.6369003852, 0.922509629, -3.064734707, 1.0211978409, 0),
    "R4": (S2, 1.4, 1, 2.7670604606, 1.068241843, -2.515415095, 0.1348883661, 0),
    "R5": (S2, 1.2, 0, 2.9539078059, 1.815631224, -1.204379877, 0.1049403030, 3.083490074),
    "R6": (S3, 1.2, 0, 2.3954428932, 2.372657359, -0.413455794, -0.0430122782, 3.405885609),
    "R7": (S3, 1.6, 0, 3.2135828042, 7.281496825, -0.482025703, -0.0358201805, 3.895163809),
    "R8": (S3, 1.6, 1, 2.1416893225, 0.850135935, -2.908720448, 0.4959403567, 0),
    "R9": (S3, 2.4, 0, 9.2649874978, 43.589924987, -1.659700811, -0.0269702684, 4.921449108),
}
ENDS = {  # onsets and fold
    S1: (0.7855976, 1.63063791, 4.7016129880),
    S2: (0.86809381, 1.25687965, 1.4877258242),
    S3: (0.82729948, 1.39574672, 2.4313736489),
}


@functools.cache
def at_speeds(case):
    """Full rubs of a case; the speeds of the table are among them, all tests have as many."""
    return jr.annular_rub(rotor(*case, 1.0), np.linspace(0.5, 6.0, 56))


@pytest.mark.hard("7.4 synchronous full rub: radius, force, phase and leading root")
@pytest.mark.parametrize("name", TABLE)
def test_full_rubs_are_those_of_the_sheet(name, record_property):
    case, speed, branch, radius, force, phase, rate, frequency = TABLE[name]
    found = at_speeds(case)
    k = int(np.argmin(abs(np.asarray(found.speeds) - speed)))
    root = complex(found.roots[k, branch, 0])
    numbers = found.radius[k, branch], found.normal_force[k, branch], found.phase[k, branch]
    errors = [abs(float(a) - b) for a, b in zip(numbers, (radius, force, phase), strict=True)]
    errors += [abs(root.real - rate), abs(abs(root.imag) - frequency)]
    record_property("measured", f"{name}: {max(errors):.0e}")
    assert max(errors) < 1e-8
    assert bool(found.stable[k, branch]) == (rate < 0)


@pytest.mark.hard("7.4 onsets and fold of a full rub")
@pytest.mark.parametrize("case", ENDS)
def test_onsets_and_folds_are_those_of_the_sheet(case, record_property):
    found = at_speeds(case)
    assert found.onsets.shape == (2,) and found.folds.shape == (1,)
    errors = abs(np.append(found.onsets, found.folds) - ENDS[case])
    record_property("measured", f"{errors.max():.0e}")
    assert errors.max() < 1e-8
    low, high = found.onsets
    inside = (found.speeds > low) & (found.speeds < high)
    between = (found.speeds > high) & (found.speeds < found.folds[0])
    count = found.exists.sum(axis=1)
    assert (count == inside + 2 * between).all()
    assert not found.stable[:, 1].any()  # the lower branch never is


def test_a_damped_ring_changes_stability_alone():
    """R7 with d = 0.5: the same orbit, and another root."""
    found = jr.annular_rub(rotor(*S3, 1.6, damper=0.5))
    assert float(found.radius[0, 0]) == pytest.approx(3.2135828042, abs=1e-9)
    root = complex(found.roots[0, 0, 0])
    assert (root.real, abs(root.imag)) == pytest.approx((-0.132341697, 0.449562572), abs=1e-8)


FLUTTER = [  # friction of the Hopf bifurcation, 3.1: (zeta, beta, g, s, d) and mu_H
    ((0.08, 6, 2, 1.2, 0.0), 0.1086188193),
    ((0.08, 6, 2, 1.6, 0.0), 0.0909479323),
    ((0.08, 6, 2, 2.0, 0.0), 0.0811956419),
    ((0.08, 6, 2, 1.6, 0.5), 0.4081833211),
    ((0.03, 25, 1.6, 1.2, 0.0), 0.0283451222),
    ((0.03, 25, 1.6, 3.0, 0.0), 0.0150087384),
]


@pytest.mark.slow
@pytest.mark.hard("7.4 friction at which a full rub flutters")
def test_flutter_begins_where_the_sheet_says(record_property):
    """Growth by Newton's step from the printed friction: it vanishes there."""
    worst = 0.0

    @eqx.filter_jit
    def growth(scene, friction):
        at = lambda f: jr.annular_rub(scene.put({"annular_stator.friction": f})).growth[0, 0]
        return jax.jvp(at, (friction,), (jnp.ones(()),))

    for (zeta, beta, gap, speed, damper), friction in FLUTTER:
        scene = rotor(zeta, beta, friction, gap, speed, damper=damper)

        value, slope = growth(scene, jnp.asarray(friction))
        worst = max(worst, abs(float(value / slope)))
        assert slope > 0
    record_property("measured", f"{worst:.0e}")
    assert worst < 1e-8
    root = jr.annular_rub(rotor(0.08, 6, 0.0909479323, 2, 1.6)).roots[0, 0, 0]
    assert abs(root.imag) == pytest.approx(3.892293733, abs=1e-7)


def test_a_rigid_ring_folds_where_the_sheet_says():
    """`beta` to infinity: (mu g - e sqrt(1 + mu^2)) s^2 + 2 zeta g s - mu g = 0."""
    scene = rotor(0.03, 1e9, 0.35, 5.0, 1.0)
    found = jr.annular_rub(scene, np.linspace(1.2, 1.6, 56))
    assert float(found.folds[0]) == pytest.approx(1.389481026, abs=1e-7)


def test_a_frictionless_ring_folds_at_a_root_of_the_cubic():
    zeta, beta, gap = 0.08, 6.0, 2.0
    cubic = np.poly1d([1, -2 * (1 + beta) + 4 * zeta**2, (1 + beta) ** 2])
    own = np.roots(np.polysub((cubic * np.poly1d([1, 0])).c, [4 * zeta**2 * beta**2 * gap**2]))
    want = np.sqrt(min(x.real for x in own if abs(x.imag) < 1e-9 and x.real > 1.5))
    found = jr.annular_rub(rotor(zeta, beta, 0.0, gap, 1.0), np.linspace(1.4, 8.0, 56))
    assert float(found.folds[0]) == pytest.approx(want, rel=1e-10)


# === in time, and as orbits


FINE = {"steps_per_revolution": 1024}  # so that one program finds all forced orbits


@pytest.mark.slow
@pytest.mark.hard("7.4 a full rub in time and as an orbit")
def test_a_stable_full_rub_stays_in_time(record_property):
    """R6, started 2 % off: after 120 revolutions at the orbit; no step is split."""
    scene = rotor(*S3, 1.2)
    found = jr.annular_rub(scene)
    start = found.start()
    off = jr.Continued(1.02 * start.q, 1.02 * start.velocity)
    r = jr.simulate(scene, 120, 256, keep=1, start=off, solver=jr.Exponential(4, located=True))
    error = abs(np.asarray(r.displacement[:, 0]) * np.exp(-1j * np.asarray(r.angle)))
    error = abs(error - float(found.radius[0, 0])).max()
    whirl = np.asarray(r.displacement[0, 0])
    record_property(
        "measured",
        f"radius {error:.0e}, phase {abs(np.angle(whirl) - float(found.phase[0, 0])):.0e}",
    )
    assert error < 1e-8 and abs(whirl - complex(found.displacement[0, 0])) < 1e-8
    assert int(r.unresolved) == 0


@pytest.mark.slow
@pytest.mark.hard("7.5 multipliers of a full rub, stable or not")
@pytest.mark.parametrize(("case", "speed", "branch"), [(S3, 1.6, 1), (S1, 1.2, 0), (S3, 1.6, 0)])
def test_multipliers_are_those_of_the_roots(case, speed, branch, record_property):
    """Per revolution `exp(2 pi lambda / s)`, in fixed axes turned by whole revolutions."""
    scene = rotor(*case, speed)
    found = jr.annular_rub(scene)
    orbit = jr.periodic(scene, found.start(0, branch), **FINE)
    assert float(jnp.max(jnp.abs(orbit.displacement))) == pytest.approx(
        float(found.radius[0, branch]), rel=1e-9
    )
    want = np.exp(2 * np.pi * np.asarray(found.roots[0, branch]) / speed)
    errors = [np.min(abs(np.asarray(orbit.multipliers) - one)) for one in want]
    record_property("measured", f"{max(errors):.0e}")
    assert max(errors) < 1e-6
    assert bool(found.stable[0, branch]) == (float(abs(orbit.multipliers[0])) < 1)


@pytest.mark.slow
@pytest.mark.hard("7.4 both branches through the fold by continuation")
def test_continuation_goes_through_the_fold(record_property):
    scene = rotor(*S3, 2.4)
    orbit = jr.periodic(scene, jr.annular_rub(scene).start(), **FINE)
    coarse = dataclasses.replace(orbit, steps=256)
    branch = jr.continue_(coarse, "spin.speed", (2.35, 2.6))
    (fold,) = [point for point in branch.points if point.kind == "fold"]
    error = abs(float(fold.value) - ENDS[S3][-1])
    record_property("measured", f"fold {error:.0e}")
    assert error < 1e-5


# === derivatives, refusals


@pytest.mark.slow
def test_derivatives_are_those_of_differences():
    """Of radius, growth and fold by damping of the shaft, ring, friction, gap and eccentricity."""
    paths = ["disc_damping.translational", "unbalance.eccentricity"]
    paths += [f"annular_stator.{name}" for name in ("stiffness", "friction", "gap", "damping")]
    scene = rotor(*S3, 1.6, damper=0.2)

    def numbers(values):
        changed = scene.put(dict(zip(paths, values, strict=True)))
        found = jr.annular_rub(changed, jnp.array([1.6, 2.4, 3.2]))
        ends = jnp.nansum(found.folds) + 0.3 * found.radius[0, 0] + 0.7 * found.radius[0, 1]
        return ends + 11.0 * found.growth[0, 0] + 0.1 * found.phase[0, 0]

    own = jnp.stack([jnp.ravel(scene.get(path))[0] for path in paths])
    check_forward(numbers, own, 1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.without("annular_stators"), "one `AnnularStator`, but the scene has 0"),
        (lambda s: s.of_parts(*s.effects, jr.Limiter(AT, 0.0, 1.0, 1.0)), "and 1 other contacts"),
        (
            lambda s: s.replace({"annular_stator.offset": 0.1}),
            r"`offset \[m\]` of the ring must be 0",
        ),
        (
            lambda s: s.replace({"annular_stator.stiffness": 0.0}),
            r"`stiffness \[N/m\]` of the ring",
        ),
        (lambda s: s.of_parts(*s.effects, jr.Gravity()), "of a rotor without weight"),
        (lambda s: s.of_parts(*s.effects, jr.HystereticDamping(0.1)), "without hysteretic damping"),
        (lambda s: s.of_parts(*s.effects, jr.Support(AT, kxx=1.0, kyy=2.0)), "axes of .* unequal"),
    ],
)
@pytest.mark.parametrize("what", ["annular_rub", "dry_whirl"])
def test_what_has_no_closed_form_is_refused(what, change, message):
    with pytest.raises(ValueError, match=message):
        getattr(jr, what)(change(rotor(*S3, 1.6)))


# === dry whirl


def dry(zeta, beta, friction, rim_speed, *, gap=1.0, **more):
    """A balanced rotor whose rim turns at `rim_speed`."""
    return rotor(zeta, beta, friction, gap, 1.0, eccentricity=0.0, rim=rim_speed, **more)


SLIP = [  # 3.2: mu_min, w, R/g, v_min/g, rate, the pair
    (
        (0.03, 25, 0.12),
        (0.012237647, 1.2807764064, 1.0262889330, 1.3144466516, 0.194482976),
        -0.157241488 + 5.564279047j,
    ),
    (
        (0.1, 4, 0.35),
        (0.111803399, 1.3257299842, 1.2336388611, 1.6354720278, 0.225802067),
        -0.312901034 + 3.218086437j,
    ),
]


@pytest.mark.slow
@pytest.mark.hard("7.7 dry whirl of a slipping rim")
@pytest.mark.parametrize(("case", "numbers", "pair"), SLIP)
def test_dry_whirls_are_those_of_the_sheet(case, numbers, pair, record_property):
    least, rate, radius, rim_speed, growth = numbers
    above, below = (jr.dry_whirl(dry(*case, share * rim_speed)) for share in (1.0001, 0.9999))
    assert not below.exists.any() and above.rate.shape == (2,)
    assert above.rolling.tolist() == [True, False] and above.stable.tolist() == [True, False]
    found = [above.least_friction, -above.rate[1], above.radius[1], above.least_rim_speed[1]]
    found.append(above.growth[1])
    errors = abs(np.array(found, float) - [least, rate, radius, rim_speed, growth])
    roots = np.asarray(above.roots[1])
    roots = roots[np.isfinite(roots)]
    apart = [np.min(abs(roots - one)) for one in (pair, pair.conjugate())]
    record_property("measured", f"{max(*errors, *apart):.0e}")
    assert max(*errors, *apart) < 2e-9
    assert float(above.needed[1]) == pytest.approx(case[2], rel=1e-12)


ROLL = [  # R10, R11: rim speed, w, R, friction needed; with slip widths w and R
    ((0.03, 25, 0.12, 2.0), (1.8161329025, 1.1012409925, 0.047411625)),
    ((0.1, 4, 0.35, 3.0), (5 / 3, 1.8, None)),
]
CREEP = [
    (ROLL[0][0], 0.1, 1.8005088777, 1.0985067093),
    (ROLL[0][0], 0.01, 1.8145995959, 1.1009710063),
    (ROLL[1][0], 0.1, 1.6617672404, 1.7868872187),
]


@pytest.mark.slow
@pytest.mark.hard("7.7 dry whirl of a rolling rim")
@pytest.mark.parametrize(("case", "numbers"), ROLL)
def test_rolling_whirls_are_those_of_the_sheet(case, numbers):
    rate, radius, needed = numbers
    found = jr.dry_whirl(dry(*case))
    assert bool(found.rolling[0]) and float(found.slip[0]) == 0
    assert float(found.rate[0]) == pytest.approx(-rate, abs=1e-9)
    assert float(found.radius[0]) == pytest.approx(radius, abs=1e-9)
    if needed:
        assert float(found.needed[0]) == pytest.approx(needed, abs=1e-9)
    zeta, beta = case[:2]  # l^2 + (2 zeta + d) l + 1 + beta + w^2 = 0
    want = np.roots([1, 2 * zeta, 1 + beta + rate**2])
    roots = np.asarray(found.roots[0])
    roots = roots[np.isfinite(roots)]
    assert roots.size == 2
    np.testing.assert_allclose(np.sort_complex(roots), np.sort_complex(want), rtol=1e-8)


@pytest.mark.slow
@pytest.mark.hard("7.7 dry whirl of a creeping rim")
@pytest.mark.parametrize(("case", "slip", "rate", "radius"), CREEP)
def test_creeping_whirls_are_those_of_the_sheet(case, slip, rate, radius, record_property):
    found = jr.dry_whirl(dry(*case, slip=slip))
    assert bool(found.rolling[0]) and bool(found.stable[0])
    errors = abs(float(found.rate[0]) + rate), abs(float(found.radius[0]) - radius)
    record_property("measured", f"slip {slip}: {max(errors):.0e}")
    assert max(errors) < 1e-9


@pytest.mark.slow
def test_a_mirrored_rotor_whirls_the_other_way():
    one = jr.dry_whirl(dry(*ROLL[0][0]))
    other = jr.dry_whirl(dry(*ROLL[0][0]).replace({"spin.speed": -1.0}))
    np.testing.assert_allclose(np.sort(other.rate), np.sort(-one.rate), rtol=1e-12)
    np.testing.assert_allclose(np.sort(other.growth), np.sort(one.growth), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.hard("7.7 dry whirl in time and as an orbit")
def test_a_creeping_whirl_stays_in_time_and_is_an_orbit(record_property):
    scene = dry(*ROLL[0][0], slip=0.1)
    found = jr.dry_whirl(scene)
    start = found.start()
    off = jr.Continued(1.02 * start.q, 1.02 * start.velocity)
    r = jr.simulate(scene, 30, 512, keep=1, start=off, solver=jr.Exponential(4))
    error = abs(abs(np.asarray(r.displacement[:, 0])) - float(found.radius[0])).max()
    period = 2 * np.pi / abs(float(found.rate[0]))
    orbit = jr.periodic(scene, start, period=period, steps_per_revolution=1024)
    turned = abs(float(orbit.period) / period - 1)
    want = np.exp(np.asarray(found.roots[0]) * period)
    want = want[np.isfinite(want)]
    apart = max(np.min(abs(np.asarray(orbit.multipliers) - one)) for one in want)
    record_property("measured", f"radius {error:.0e}, period {turned:.0e}, multipliers {apart:.0e}")
    assert error < 1e-8 and turned < 1e-9 and apart < 1e-6
    assert float(orbit.whirl_rate) == pytest.approx(float(found.rate[0]), rel=1e-9)


@pytest.mark.slow
@pytest.mark.hard("7.7 dry whirl of a slipping rim, as an orbit")
def test_a_slipping_whirl_is_a_saddle_of_orbits(record_property):
    """Found from a hundredth beside it, with the growth of the sheet: one multiplier of it is outside.

    In a ring a part of it is an orbit: after any angle the motion is the same, turned.
    """
    case, (_, rate, radius, rim_speed, growth), pair = SLIP[0]
    scene = dry(*case, 1.2 * rim_speed)
    start = jr.dry_whirl(scene).start(1)
    beside = jr.Continued(1.01 * start.q, 1.01 * start.velocity)
    period = 0.3 / rate
    orbit = jr.periodic(scene, beside, period=period, turn=-0.3, steps_per_revolution=1024)
    off = abs(abs(np.asarray(orbit.displacement[:, 0])) - radius).max()
    turned = abs(float(orbit.period) / period - 1)
    found = np.asarray(orbit.multipliers)
    want = np.exp(np.array([growth, pair, pair.conjugate()]) * period)
    apart = max(np.min(abs(found - one)) for one in want)
    record_property("measured", f"radius {off:.0e}, period {turned:.0e}, multipliers {apart:.0e}")
    assert off < 1e-8 and turned < 1e-8 and apart < 1e-6
    assert (abs(found) > 1 + 1e-6).sum() == 1 and not orbit.stable
    with pytest.raises(ValueError, match="`turn` must leave the scene as it is"):
        aside = scene.replace({"annular_stator.offset": 0.01})
        jr.periodic(aside, beside, period=period, turn=-0.3, steps_per_revolution=1024)


# === the limiter rotor in a ring, section 4


def beam(N, friction, slip=None):
    """The limiter rotor of sheet 1 in a ring of the stiffness, damping and gap of its stops."""
    scene = limiter_rotor(N=N, eps=None, contact=False, nodes=12)
    mass = float(scene.of(jr.Disc)[0].mass)
    damper = 0.06 * np.sqrt(mass * RIGIDITY / LENGTH**3)
    stiffness, gap = 850 * RIGIDITY / LENGTH**3, 0.0075 / 0.7 * LENGTH
    width = None if slip is None else slip * LENGTH / TIME
    ring = jr.AnnularStator(LENGTH, gap, stiffness, damper, friction, RIM, slip=width)
    return scene.of_parts(*scene.effects, ring)


BEAM = [  # N, f, w, rho, load, least N that slips, leading root
    (2, 0.03, -6.62642898, 0.0113713420, 0.558497839, 0.527460, 0.25054796),
    (2, 0.03, -13.61904785, 0.0146424652, 3.338952576, 1.395915, -0.93902232),
    (15, 0.03, -8.95831368, 0.0120528425, 1.137773267, 0.755812, 0.33801451),
    (15, 0.03, -14.62314644, 0.0154330810, 4.010975964, 1.579761, -0.40901085),
    (15, 0.1, -4.04216509, 0.0109404720, 0.192258359, 0.309562, 0.49430889),
    (15, 0.1, 1.80169838, 0.0107171696, 0.002451301, None, -0.48740595),
    (15, 0.0, 1.91763211, 0.0107231363, 0.007522977, None, -0.15960410),
]
ROLLED = [  # needed friction, root with a slip of 0.01
    (15, 0.1, -24.96163608, 0.0858460213, 63.86197526, 0.062940226, -1.475 + 36.98j),
    (1, 0.1, -11.05310666, 0.0129246145, 1.87877949, 0.012207023, -3.19 + 27.56j),
]


@functools.cache
def whirls(N, friction, slip=None):
    return jr.dry_whirl(beam(N, friction, slip))


@pytest.mark.slow
@pytest.mark.hard("7.8 dry whirl of the limiter rotor in a ring")
@pytest.mark.parametrize("case", BEAM)
def test_dry_whirls_of_the_limiter_rotor(case, record_property):
    N, friction, rate, radius, load, least, growth = case
    found = whirls(N, friction)
    i = int(np.argmin(abs(np.asarray(found.rate) * TIME - rate)))
    numbers = [found.rate[i] * TIME, found.radius[i] / LENGTH]
    numbers += [found.normal_force[i] * LENGTH**2 / RIGIDITY, found.growth[i] * TIME]
    errors = abs(np.array(numbers, float) / [rate, radius, load, growth] - 1)
    record_property("measured", f"{errors.max():.0e}")
    assert errors.max() < 2e-7
    assert not bool(found.rolling[i])
    if least is not None:
        speed = float(found.least_rim_speed[i]) / RIM * TIME
        assert speed == pytest.approx(least, rel=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("case", ROLLED)
def test_rolling_whirls_of_the_limiter_rotor(case):
    N, friction, rate, radius, load, needed, root = case
    found = whirls(N, friction)
    numbers = [found.rate[0] * TIME, found.radius[0] / LENGTH]
    numbers += [found.normal_force[0] * LENGTH**2 / RIGIDITY, found.needed[0]]
    errors = abs(np.array(numbers, float) / [rate, radius, load, needed] - 1)
    assert errors.max() < 2e-7 and bool(found.rolling[0])
    creeping = np.asarray(whirls(N, friction, 0.01).roots[0]) * TIME
    leading = creeping[0]
    assert (leading.real, abs(leading.imag)) == pytest.approx((root.real, root.imag), rel=2e-3)


@pytest.mark.slow
@pytest.mark.hard("7.8 least friction of backward whirl of the limiter rotor")
def test_least_friction_of_the_limiter_rotor(record_property):
    errors = []
    for N, friction, rate in (
        (1, 0.012109254, -10.79),
        (15, 0.019380496, -11.63),
        (25, 0.023111573, None),
        (50, 0.034344348, None),
    ):
        found = whirls(N, 0.1)
        errors.append(abs(float(found.least_friction) / friction - 1))
        if rate:
            assert float(found.least_friction_rate) * TIME == pytest.approx(rate, abs=6e-3)
    record_property("measured", f"{max(errors):.0e}")
    assert max(errors) < 1e-7


@pytest.mark.slow
@pytest.mark.hard("7.8 regions of dry whirl of the limiter rotor over speed")
@pytest.mark.parametrize(
    ("friction", "ends"),
    [
        (0.03, (0.50510304, 1.40223685, 40.5375)),
        (0.05, (0.35773996, 1.62010194)),
        (0.1, (0.23090236,)),
    ],
)
def test_regions_of_the_limiter_rotor(friction, ends):
    """None below the first speed, rolling to the second, whip of a slipping rim to the third.

    Near the third the shaft's own damping makes it flutter: there it exists, no more.
    """
    kinds = []
    for end, width in zip(ends, (1e-6, 1e-6, 2e-5), strict=False):
        for side in (1 - width, 1 + width):
            found = jr.dry_whirl(beam(end * side, friction))
            held = np.asarray(found.exists if end > 40 else found.stable) & (found.rate < 0)
            assert end < 40 or np.asarray(held).sum() in (0, 2)  # both ends of the range
            kinds.append("".join("rs"[int(not one)] for one in np.asarray(found.rolling)[held])[:1])
    assert kinds == ["", "r", "r", "s", "s", ""][: len(kinds)]


@pytest.mark.slow
def test_derivatives_of_dry_whirl_are_those_of_differences():
    """Of rates, radius, growth and the least friction, of a slipping and a creeping rim."""
    paths = ["disc_damping.translational", "spin.speed"]
    paths += [f"annular_stator.{name}" for name in ("stiffness", "friction", "gap", "slip")]
    scene = dry(0.1, 4, 0.35, 3.0, slip=0.1, damper=0.05)

    def numbers(values):
        found = jr.dry_whirl(scene.put(dict(zip(paths, values, strict=True))), count=2)
        return (
            found.rate[0]
            + 0.7 * found.radius[1]
            + 0.3 * found.growth[0]
            + 0.9 * found.growth[1]
            + 2.0 * found.least_friction
        )

    own = jnp.stack([jnp.ravel(scene.get(path))[0] for path in paths])
    check_forward(numbers, own, 1e-4)


# === maps, the shipped scene, random rotors


@pytest.mark.slow
def test_a_map_has_the_regions_of_the_closed_form():
    """A mass on a round shaft rolls above the least friction and the least speed, or it does not."""
    zeta, beta = 0.1, 4.0
    scene = dry(zeta, beta, 0.3, 1.0)
    speeds, frictions = np.array([1.0, 1.5, 1.7, 3.0]), np.array([0.05, 0.1, 0.12, 0.35])
    found = jr.dry_whirl_map(scene, speeds, frictions)
    w = zeta / frictions + np.sqrt((zeta / frictions) ** 2 + 1)
    share = 2 * zeta * w / frictions / beta  # K / beta, below 1 where there is a whirl
    least = w / np.where(share < 1, 1 - share, np.nan)
    assert (np.asarray(found.rolls) == (speeds[:, None] > least)).all()
    assert (np.asarray(found.exists) == np.asarray(found.rolls)).all() and not found.slips.any()
    want = 2 * zeta * np.sqrt(1 + beta) / beta
    np.testing.assert_allclose(found.least_friction, want, rtol=1e-9)
    rolling = np.asarray(found.rate)[-1, -1]
    assert rolling == pytest.approx(-5 / 3, rel=1e-9)  # R11
    assert np.isnan(np.asarray(found.rate)[0]).all()


@pytest.mark.slow
def test_the_shipped_scene_is_as_its_comments_say():
    scene = jr.load("ring-rub")
    speeds = np.sort(np.append(np.linspace(200, 1200, 54), [704.0, 706.0]))
    found = jr.annular_rub(scene, speeds)
    assert np.asarray(found.onsets) == pytest.approx([231, 304], abs=0.5)
    below, above = (found.growth[list(speeds).index(speed), 0] for speed in (704.0, 706.0))
    assert below < 0 < above
    assert float(found.folds[0]) == pytest.approx(1038.65, abs=0.01)  # docs/concepts/ring.md
    thrown = jr.dry_whirl(scene)
    assert bool(thrown.stable[0] & thrown.rolling[0]) and float(thrown.radius[0]) > 0.01


@pytest.mark.slow
@pytest.mark.hard("7.5 dry whirl of random rotors and rings, against runs in time")
def test_dry_whirl_of_random_rotors(monkeypatch, record_property):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    benchmark = importlib.import_module("dry_whirl")
    monkeypatch.setattr(benchmark, "MOST", 20_000)
    found = benchmark.judged(40, seed=3)
    runs = found["runs"] - found["too slow to tell"]
    record_property(
        "measured", f"{found['rotors misjudged']} of 40 rotors misjudged by {runs} runs"
    )
    assert found["rotors misjudged"] == 0
    assert runs > 40 and found["with a stable whirl"] > 10 and found["without a whirl, run"] > 5
