"""Reversed spin: answers of a rotor and of its mirror image (y for -y), and values from elsewhere."""

import dataclasses

import fem
import numpy as np
import pytest
import scipy.linalg

import jaxrotor as jr
from jaxrotor.analysis.critical import critical_between


MIRRORED = {
    "kxy",
    "kyx",
    "cxy",
    "cyx",
    "angle",
    "phase",
    "tilt_axis",
    "offset_angle",
    "cross_stiffness",
}
MIRRORED |= {"damping_angle", "cross_damping"}


def mirror(scene):
    """The mirror image of a scene: angles, cross-coupling and the spin change their sign."""

    def image(part):
        own = {f.name for f in dataclasses.fields(part)} & MIRRORED
        given = {name: getattr(part, name) for name in own if getattr(part, name) is not None}
        return dataclasses.replace(part, **{name: -value for name, value in given.items()})

    return scene.of_parts(*map(image, scene.effects)).at_speed(-scene.spin.speed)


def drawn(seed, tables=False, unequal=True):
    """A random flexible rotor on two bearings with cross-coupling, and an unbalance."""
    rng = np.random.default_rng(seed)
    draw = lambda low, high: float(rng.uniform(low, high))
    nodes = [20.0, 120.0, 500.0]

    def bearing(at):
        stiff, soft = draw(2e5, 4e5), draw(0.6, 0.9)
        own = {"kxx": stiff, "kyy": soft * stiff, "kxy": draw(1e3, 2e4), "kyx": -draw(1e3, 2e4)}
        own |= {"cxx": draw(20, 60), "cyy": draw(20, 60), "cxy": draw(-9, 9), "cyx": draw(-9, 9)}
        if not unequal:
            own["kxy"] /= 20
            own |= {"kyy": own["kxx"], "cyy": own["cxx"], "kyx": -own["kxy"], "cyx": -own["cxy"]}
        if tables:
            own = {name: value * np.array([0.9, 1.0, 1.2]) for name, value in own.items()}
        return jr.Support(at, speeds=nodes if tables else None, **own)

    polar = draw(0.04, 0.12)
    return jr.Scene(
        jr.FlexibleShaft(0.8, 0.03, constraints=[], nodes=4),
        bearing(0.0),
        bearing(0.6),
        jr.Disc(0.8, draw(4, 8), polar / 2, polar),
        jr.InternalDamping(draw(1e-5, 1e-4)),
        jr.Unbalance(0.8, 5.0, 1e-4, draw(-3, 3)),
        spin=jr.ConstantSpeed(draw(100, 300)),
    )


def as_set(values):
    """Roots by magnitude and sign, so that equal sets are equal lists."""
    values = np.asarray(values)
    return values[np.lexsort((values.imag > 0, np.abs(values).round(6)))]


@pytest.mark.long
@pytest.mark.parametrize("seed, tables", [(0, False), (1, False), (2, False), (3, True), (4, True)])
def test_a_rotor_and_its_mirror_image(seed, tables):
    """Every linear answer of random rotors on unequal bearings, with and without tables over speed."""
    one = drawn(seed, tables)
    other = mirror(one)
    speeds = np.linspace(20.0, 480.0, 60)
    close = lambda a, b, rtol=1e-7: np.testing.assert_allclose(a, b, rtol=rtol, atol=1e-12)

    close(as_set(jr.roots(other, 8)), as_set(np.conj(jr.roots(one, 8))))
    ours, theirs = jr.critical_speeds(one), jr.critical_speeds(other)
    close(theirs.speeds, -ours.speeds)
    assert theirs.kinds == ours.kinds
    close(theirs.senses, ours.senses)
    ours, theirs = (jr.unbalance_response(s, w * speeds, 0.8) for s, w in ((one, 1), (other, -1)))
    close(theirs.forward, np.conj(ours.forward))
    close(theirs.backward, np.conj(ours.backward))
    ours, theirs = (
        jr.stability_crossings(s, (w * 30.0, w * 480.0), 60) for s, w in ((one, 1), (other, -1))
    )
    close([float(o.speed) for o, _ in theirs], [-float(o.speed) for o, _ in ours])
    assert [lost for _, lost in theirs] == [lost for _, lost in ours]
    if tables:
        return
    ours, theirs = (jr.response_peaks(s, w * speeds, 0.8) for s, w in ((one, 1), (other, -1)))
    assert ours.speeds.size
    for name in ("speeds", "lower", "upper"):
        close(getattr(theirs, name), -getattr(ours, name), 1e-6)
    close(theirs.amplification, ours.amplification, 1e-5)
    for mine, image in zip(ours.margins(150.0), theirs.margins(-150.0), strict=True):
        close(image, mine, 1e-5)
    ours, theirs = (jr.campbell(s, w * speeds[::6], 4) for s, w in ((one, 1), (other, -1)))
    close(theirs.values.real, ours.values.real)
    close(np.abs(theirs.frequencies), np.abs(ours.frequencies))
    close(theirs.forward, ours.forward)
    close(theirs.crossings().speeds, -ours.crossings().speeds)


@pytest.mark.slow
def test_an_isotropic_rotor_and_its_mirror_image():
    """Roots are conjugate one by one, whirl has its direction as to the spin, and so has an onset."""
    one = drawn(7, unequal=False)
    other = mirror(one)
    ours, theirs = jr.modes(one, 4), jr.modes(other, 4)
    np.testing.assert_allclose(theirs.values, np.conj(ours.values), rtol=1e-8)
    np.testing.assert_array_equal(theirs.forward, ours.forward)
    ours, theirs = jr.onset_speed(one), jr.onset_speed(other)
    np.testing.assert_allclose(theirs, -np.array(ours), rtol=1e-8)
    end = 1.2 * float(ours.speed)
    np.testing.assert_allclose(jr.onset_speed(other, (0.0, -end)), theirs, rtol=1e-9)
    either = [jr.onset_speed(one, (0.0, e), throw=False) for e in (end, -end)]
    nearest = min(either, key=lambda found: np.nan_to_num(abs(float(found.speed)), nan=np.inf))
    np.testing.assert_allclose(jr.onset_speed(one, (-end, end)), nearest, rtol=1e-9)


@pytest.mark.slow
def test_rubs_and_motions_of_a_rotor_and_of_its_mirror_image():
    """Dry whirl and full rubs in a ring, the friction that they need, and a motion between stops."""
    contact = 4e5, 6.0, 0.2
    rotor = jr.FlexibleShaft(0.7, 0.02, constraints=[jr.Constraint(0.0, "clamp")], nodes=4)
    parts = jr.Disc(0.7, 2.0, 0.005, 0.01), jr.InternalDamping(1e-5), jr.ExternalDamping(8.0)
    unbalance, spin = jr.Unbalance(0.7, 2.0, 1e-3, 0.4), jr.ConstantSpeed(400.0)
    ring = jr.AnnularStator(0.7, 2e-3, *contact, rim_radius=0.1)
    one = jr.Scene(rotor, *parts, unbalance, ring, spin=spin)
    other = mirror(one)
    ours, theirs = jr.dry_whirl(one), jr.dry_whirl(other)
    assert ours.rate.size == 2 and np.all(ours.rate < 0)
    for name in ("rate", "slip", "needed", "least_friction_rate"):
        np.testing.assert_allclose(getattr(theirs, name), -getattr(ours, name), rtol=1e-8)
    for name in ("radius", "growth", "least_friction"):
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), rtol=1e-7)
    speeds = np.linspace(50.0, 600.0, 9)
    ours, theirs = jr.annular_rub(one, speeds), jr.annular_rub(other, -speeds)
    np.testing.assert_allclose(theirs.folds, -ours.folds, rtol=1e-9)
    np.testing.assert_allclose(theirs.displacement, np.conj(ours.displacement), rtol=1e-7)
    stop = jr.Limiter(0.7, 0.4, 1e-3, *contact, rim_radius=0.1)
    one = jr.Scene(rotor, *parts, unbalance, stop, spin=spin)
    ours, theirs = (jr.simulate(s, 6, steps_per_revolution=64) for s in (one, mirror(one)))
    assert np.any(ours.contact_force)
    size = np.abs(ours.displacement).max()
    np.testing.assert_allclose(theirs.displacement, np.conj(ours.displacement), atol=1e-8 * size)
    np.testing.assert_allclose(theirs.angle, -np.asarray(ours.angle), rtol=1e-12)


# === absolute values


def jeffcott(speed, external=30.0, internal=12.0):
    """`m q.. + c q. + c_i (q. - i Omega q) + k q`: 4 kg on 1e5 N/m, with a damper that turns."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e5),
        jr.Disc(0.5, 4.0),
        jr.DiscDamping(0.5, external),
        jr.InternalDamping(internal / 1e5),
        jr.Unbalance(0.5, 4.0, 1e-4),
        spin=jr.ConstantSpeed(speed),
    )


@pytest.mark.slow
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_onset_of_internal_damping_in_either_sense(sense):
    """`|Omega| = w_n (1 + c_e / c_i)`, where the whirl has the rate `w_n` with the spin."""
    natural = np.sqrt(1e5 / 4.0)
    speed, whirl = jr.onset_speed(jeffcott(sense * 50.0))
    np.testing.assert_allclose(speed, sense * natural * (1 + 30.0 / 12.0), rtol=1e-10)
    np.testing.assert_allclose(whirl, sense * natural, rtol=1e-8)
    (critical,) = jr.critical_speeds(jeffcott(sense * 50.0)).forward
    np.testing.assert_allclose(critical, sense * natural, rtol=1e-12)


def overhung():
    """A shaft with an overhung disc on two bearings, of which one has circulatory stiffness."""
    bearing = {"kxx": 8e7, "kyy": 4e7, "cxx": 5e3, "cyy": 5e3}
    return jr.Scene(
        jr.FlexibleShaft(0.9, 0.05, constraints=[]),
        jr.Disc(0.9, 30.0, 0.9, 1.8),
        jr.Unbalance(0.9, 30.0, 50e-6),
        jr.Support(0.0, **bearing),
        jr.Support(0.5, **bearing, kxy=-5e6, kyx=5e6),
        spin=jr.ConstantSpeed(-50 * np.pi),
    )


def by_finite_elements(speed):
    """Major half axis [m] at the disc, largest growth rate [1/s], and the root that has it."""
    springs = [(0.0, np.diag([8e7, 4e7])), (0.5, np.array([[8e7, -5e6], [5e6, 4e7]]))]
    material = 2.1e11, 7850.0, np.inf
    nodes, mass, gyroscopic, stiffness = fem.matrices(
        [fem.Stretch(0.9, 0.05)], [(0.9, 30.0, 0.9, 1.8)], springs, material, 0.02
    )
    damping = speed * gyroscopic
    for station in (0.0, 0.5):
        k = 4 * int(np.argmin(np.abs(nodes - station)))
        damping[k : k + 2, k : k + 2] += 5e3 * np.eye(2)
    force = np.zeros(len(mass), complex)
    force[-4:-2] = 30.0 * 50e-6 * speed**2 * np.array([1.0, -1j])
    x, y = np.linalg.solve(stiffness + 1j * speed * damping - speed**2 * mass, force)[-4:-2]
    zero, one = np.zeros_like(mass), np.eye(len(mass))
    state = np.block([[zero, one], [-np.linalg.solve(mass, np.hstack([stiffness, damping]))]])
    roots = scipy.linalg.eigvals(state)
    return (abs(x + 1j * y) + abs(x - 1j * y)) / 2, roots.real.max()


@pytest.mark.slow
@pytest.mark.parametrize("rpm", [2112.96, -2112.96])
def test_circulatory_stiffness_tells_the_senses_apart(rpm):
    """At -2112.96 rpm the disc moves 9998 um, at 2112.96 rpm 5308 um, as in finite elements."""
    speed = rpm * np.pi / 30
    major, growth = by_finite_elements(speed)
    scene = overhung()
    found = jr.unbalance_response(scene, speed, 0.9)
    np.testing.assert_allclose(found.major[0, 0], major, rtol=2e-3)
    np.testing.assert_allclose(major, {2112.96: 5308e-6, -2112.96: 9998e-6}[rpm], rtol=2e-3)
    np.testing.assert_allclose(jr.growth_rate(scene.at_speed(speed)), growth, rtol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [100.0, -100.0])
def test_objectives_of_a_reversed_rotor_have_the_same_sign(speed):
    """`w (1 + c / h)` by internal damping h and external c, and `w (sqrt(1 + mu) - sqrt(1 - mu))`."""
    shaft, disc, spin = jr.MasslessShaft(1.0, 0.5, 1e6), jr.Disc(0.5, 10.0), jr.ConstantSpeed(speed)
    damped = dataclasses.replace(shaft, damping=20.0)
    scene = jr.Scene(damped, disc, jr.DiscDamping(0.5, 5.0), spin=spin)
    found = jr.objectives.onset_speed(scene, (0.0, 9 * speed), 20)
    assert float(found) == pytest.approx(np.sqrt(1e5) * 1.25, rel=1e-8)
    scene = jr.Scene(dataclasses.replace(shaft, anisotropy=0.1), disc, spin=spin)
    gap = np.sqrt(1.1e5) - np.sqrt(0.9e5)
    assert float(jr.objectives.critical_gap(scene)) == pytest.approx(gap, rel=1e-9)


def test_tables_over_speed_are_read_at_the_magnitude():
    """A table from 0 on is that of both senses; one that begins below 0 has a value for each."""
    nodes, own = [0.0, 100.0, 300.0], [1e6, 2e6, 4e6]
    one = jr.Support(0.0, kxx=own, kyy=own, speeds=nodes)
    np.testing.assert_allclose(one.at_speed(-100.0).kxx, 2e6, rtol=1e-12)
    both = jr.Support(0.0, kxx=own, kyy=own, speeds=[-300.0, -100.0, 200.0])
    np.testing.assert_allclose(both.at_speed(-100.0).kxx, 2e6, rtol=1e-12)
    np.testing.assert_allclose(both.at_speed(200.0).kxx, 4e6, rtol=1e-12)
    shaft = jr.RigidShaft(1.0, constraints=[jr.Constraint(1.0, "pin")])
    parts = jr.Disc(0.0, 2.0), dataclasses.replace(both, cxx=1.0, cyy=1.0)
    scene = jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(-200.0))
    with pytest.raises(
        ValueError, match="from 0 to -300 rad/s, but coefficients are needed at -400"
    ):
        jr.unbalance_response(scene, -400.0)
    with pytest.raises(ValueError, match="from 0 to 200 rad/s, but coefficients are needed at 250"):
        jr.unbalance_response(scene, 250.0)
    one_sided = dataclasses.replace(both, speeds=[-300.0, -200.0, -100.0])
    scene = scene.of_parts(parts[0], one_sided)
    said = "tables of support are for negative speeds alone, but coefficients are needed at "
    with pytest.raises(ValueError, match=f"{said}50 rad/s: films"):
        jr.unbalance_response(scene, [-150.0, 50.0])
    with pytest.raises(ValueError, match=f"{said}positive speeds: films"):
        critical_between(scene, -300.0, 300.0)
