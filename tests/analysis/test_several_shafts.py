"""Linear answers of machines of two shafts against transfer matrices, finite elements and own matrices."""

import jax
import numpy as np
import pytest
from shafts_of_tests import CRITICAL, ROOTS, dual_rotor, toy

import jaxrotor as jr


def but_first_slow(cases, first=1):
    """The cases, all but the first ones marked slow."""
    slow = [pytest.param(*case, marks=pytest.mark.slow) for case in list(cases)[first:]]
    return [*list(cases)[:first], *slow]


@pytest.mark.parametrize(("ratio", "cased"), but_first_slow(ROOTS))
def test_roots(ratio, cased):
    found = np.asarray(jr.roots(dual_rotor(ratio, cased=cased, nodes=8), 8))
    for root in ROOTS[ratio, cased]:
        assert np.abs(found - root).min() < 3e-9 * abs(root)


@pytest.mark.slow  # three structures of scenes
def test_a_speed_of_its_own_is_a_ratio():
    alike = [jr.roots(dual_rotor(*pair), 8) for pair in ((1.3, None), (0.0, 325.0), (1.0, 75.0))]
    np.testing.assert_allclose(alike[1], alike[0], rtol=1e-9)
    np.testing.assert_allclose(alike[2], alike[0], rtol=1e-9)


@pytest.mark.filterwarnings("ignore::jaxrotor.ImplausibleWarning")
@pytest.mark.parametrize(("ratio", "speed", "by"), but_first_slow(CRITICAL, 2))
def test_critical_speeds_by_each_shaft(ratio, speed, by):
    wanted = CRITICAL[ratio, speed, by]
    found = jr.critical_speeds(dual_rotor(ratio, speed, nodes=8), by=by)
    np.testing.assert_allclose(found.forward[: len(wanted)], wanted, rtol=1e-8)
    first, second = np.asarray(found.operating).T
    np.testing.assert_allclose(second, ratio * first + (speed or 0.0), rtol=1e-12)


def test_operating_points_of_another_machine_have_another_sense():
    found = jr.critical_speeds(dual_rotor(1.3, 100.0), by="hp")
    operating = np.asarray(found.operating)[np.asarray(found.forward_share) > 0.5]
    np.testing.assert_allclose(operating[:2, 0], [-10.90668161, 113.5159978], rtol=2e-7)


RESPONSES = {  # um, at lp .2705 and hp .5925
    (1.3, 200.0, "lp"): [-16.1522820 - 3.09597031j, -107.873365 + 1.83272304j],
    (1.3, 200.0, "hp"): [541.716566 + 114.871277j, -367.373208 - 68.7028213j],
    (1.3, 400.0, "lp"): [-179.566868 + 32.7762093j, -161.832298 + 61.1088870j],
    (1.3, 400.0, "hp"): [-11.7495271 - 3.55867558j, -165.926526 - 16.8262320j],
    (-1.2, 400.0, "lp"): [-143.958560 + 70.9235219j, -100.695831 + 155.352637j],
    (-1.2, 400.0, "hp"): [-19.0724707 + 8.28964957j, -200.480253 + 29.3829072j],
}


@pytest.mark.parametrize(("ratio", "speed", "by"), but_first_slow(RESPONSES, 2))
def test_responses_to_each_shaft(ratio, speed, by):
    places = [("lp", 0.2705), ("hp", 0.5925)]
    found = jr.unbalance_response(dual_rotor(ratio), [speed], places, by=by)
    wanted = 1e-6 * np.array(RESPONSES[ratio, speed, by])
    assert np.abs(found.forward[0] - wanted).max() < 1e-7 * np.abs(wanted).max()
    assert found.frequencies[0] == pytest.approx(speed if by == "lp" else ratio * speed)


def damped(name, time):
    return jr.InternalDamping(time, shaft=name)


def turning(shaft, on):
    return jr.Support(at=(shaft, 0.682), on=on, kxx=0.0, cxx=600.0, rotating=True)


ONSETS = {  # speed of the first shaft, and of the whirl
    "lp's material": (1.3, [damped("lp", 1e-4)], 130.3180330, 89.43845970),
    "lp's material, counter-rotating": (-1.2, [damped("lp", 1e-4)], 119.0096201, 83.18534322),
    "hp's drives lp's whirl": (-1.2, [damped("hp", 3e-4)], 860.8635939, -86.50741701),
    "damper turns with hp": (1.3, [turning("hp", "lp")], 316.5620455, 249.8760654),
    "damper turns with lp": (1.3, [turning("lp", "hp")], 421.1131799, 251.0164363),
    "damper turns with hp, counter-rotating": (
        -1.2,
        [turning("hp", "lp")],
        354.1966769,
        -246.6548914,
    ),
}


@pytest.mark.slow  # eight nodes a span
@pytest.mark.parametrize("name", ONSETS)
def test_whirl_at_the_onset_by_damping_that_turns_with_a_shaft(name):
    ratio, more, speed, whirl = ONSETS[name]
    found = np.asarray(jr.roots(dual_rotor(ratio, None, *more, first=speed, nodes=8), 8))
    assert np.abs(found - 1j * whirl).min() < 2e-9 * abs(whirl)
    assert found.real.max() < 2e-9 * abs(whirl)


@pytest.mark.slow  # a scan and a bracket
def test_onset_speed():
    ratio, more, speed, whirl = ONSETS["lp's material"]
    found = jr.onset_speed(dual_rotor(ratio, None, *more), (50.0, 400.0), 20)
    # Fast modes are undamped within rounding, so that growth is looked for beyond that
    assert float(found.speed) == pytest.approx(speed, rel=1e-6)
    assert float(found.whirl_frequency) == pytest.approx(whirl, rel=1e-6)


def own_roots(ratio, speed, k12=0.8, c12=0.02, d=(0.01, 0.02), first=1.4):
    """Roots of the toy by matrices written here."""
    speeds = np.diag([first, ratio * first + (speed or 0.0)])
    across = np.array([[1.0, -1.0], [-1.0, 1.0]])
    mass, polar = np.diag([1.0, 0.6]), np.diag([0.2, 0.18])
    turning = np.diag(d)
    damping = np.diag([0.04, 0.03]) + turning + c12 * across - 1j * speeds @ polar
    stiffness = np.diag([1.0, 2.0]) + k12 * across - 1j * speeds @ turning
    inverse = np.linalg.inv(mass)
    zero, one = np.zeros((2, 2)), np.eye(2)
    matrix = np.block([[zero, one], [-inverse @ stiffness, -inverse @ damping]])
    return np.sort_complex(np.linalg.eigvals(matrix))


@pytest.mark.filterwarnings("ignore::jaxrotor.ImplausibleWarning")
@pytest.mark.parametrize(("ratio", "speed"), [(1.3, None), (1.0, None), (0.0, None), (-1.2, 0.3)])
def test_roots_of_rigid_shafts(ratio, speed):
    found = np.sort_complex(np.asarray(jr.roots(toy(ratio, speed))))
    np.testing.assert_allclose(found, own_roots(ratio, speed), rtol=1e-12, atol=1e-14)


def test_onset_of_rigid_shafts():
    found = jr.onset_speed(toy(damping=(0.01, 0.2)), (0.1, 6.0), 40)
    assert float(found.speed) == pytest.approx(2.814721139, rel=1e-9)


@pytest.mark.slow  # a program for every parameter
def test_derivatives_by_the_numbers_of_a_shaft():
    scene = toy(1.3, 0.1)
    paths = ["coaxial_shaft.ratio", "coaxial_shaft.speed", "supports.4.kxx", "discs.1.polar"]

    def at(path):
        return lambda value: jr.critical_speeds(scene.replace({path: value}), by="hp").forward[0]

    for path in paths:
        value = float(scene.get(path))
        slope = float(jax.jacfwd(at(path))(value))
        step = 1e-5
        both = float(at(path)(value + step)) - float(at(path)(value - step))
        assert slope == pytest.approx(both / (2 * step), rel=1e-6, abs=1e-9), path


@pytest.mark.slow  # shares a program with critical speeds of that tier
def test_a_joint_that_is_stiff_is_a_rigid_one():
    found = [float(jr.critical_speeds(dual_rotor(joint=k)).forward[0]) for k in (1e9, 1e12)]
    np.testing.assert_allclose(found, [88.41808182, 88.41845824], rtol=1e-8)


def lone():
    return jr.FlexibleShaft(1.0, 0.02, nodes=4)


HELD = [jr.Support(at=("a", x), kxx=1e6) for x in (0.0, 1.0)]
HELD += [jr.Support(at=("b", x), kxx=1e6) for x in (0.0, 1.0)]


def two(*parts, **options):
    shafts = {"a": lone(), "b": jr.CoaxialShaft(lone(), **options)}
    return jr.Scene(shafts, *HELD, *parts, spin=jr.ConstantSpeed(100.0))


@pytest.mark.slow  # two scenes
def test_machines_without_a_joint_are_two():
    alone = jr.Scene(
        lone(), *(jr.Support(at=x, kxx=1e6) for x in (0.0, 1.0)), spin=jr.ConstantSpeed(100.0)
    )
    faster = alone.replace({"spin.speed": 170.0})
    wanted = np.concatenate([jr.roots(alone), jr.roots(faster)])
    found = np.asarray(jr.roots(two(ratio=1.7)))
    order = lambda roots: roots[np.argsort(roots.imag)]
    np.testing.assert_allclose(order(found).imag, order(wanted).imag, rtol=1e-9)


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: two(jr.Disc(at=0.5, mass=1.0)), "must name its shaft"),
        (lambda: two(jr.Disc(at=("c", 0.5), mass=1.0)), "names 'c'"),
        (lambda: two(jr.Disc(at=("b", 1.5), mass=1.0)), "off the shaft"),
        (lambda: two(jr.InternalDamping(1e-4)), "must name its shaft"),
        (lambda: two(jr.HystereticDamping(0.01, shaft="b")), "HystereticDamping"),
        (lambda: two(jr.Support(at=("a", 0.5), on="a", kxx=1.0)), "and itself"),
        (lambda: two(jr.Disc(at=("a", 0.5), mass=1.0), ratio=np.inf), "finite"),
        (lambda: jr.critical_speeds(two(), by="c"), "`by` must be the name of a shaft"),
        (lambda: jr.critical_speeds(two(ratio=0.0), by="b"), "does not turn"),
        (lambda: jr.unbalance_response(two(), [1.0], 0.5), "must name the shaft"),
    ],
)
def test_what_is_refused(build, said):
    def answer():
        scene = build()
        return jr.roots(scene) if isinstance(scene, jr.Scene) else scene

    with pytest.raises(ValueError, match=said):
        answer()


def test_nodes_are_those_of_every_shaft():
    assert set(two().with_nodes(5).resolution) == {5}


def test_modes_without_damping_are_told_from_those_that_are_not_resolved():
    """Supports damp the highest modes of dual-rotor by less than the rounding of their roots.

    A damper in the middle of a shaft between pins is at the node of every second mode.
    """
    with pytest.raises(ValueError, match="^The rotor never loses its stability from 0 to 100"):
        jr.onset_speed(jr.load("dual-rotor"), (0.0, 100.0), 8)
    pins = jr.Constraint(0.0), jr.Constraint(1.0)
    shaft = jr.FlexibleShaft(1.0, 0.05, constraints=pins, nodes=4)
    middle = jr.Disc(0.5, 5.0), jr.DiscDamping(0.5, 50.0)
    noded = jr.Scene(shaft, *middle, spin=jr.ConstantSpeed(1.0))
    with pytest.raises(
        ValueError, match="^Some modes of the rotor have no damping beyond rounding"
    ):
        jr.onset_speed(noded, (0.0, 100.0), 8)
    alone = jr.Scene(jr.MasslessShaft(1.0, 0.5, 1e6), jr.Disc(0.5, 1.0), spin=jr.ConstantSpeed(1.0))
    with pytest.raises(ValueError, match="^The rotor has no damping, so it is neither"):
        jr.onset_speed(alone, (0.0, 100.0), 8)
