"""Tables over speed on and between two shafts: numbers at each speed, and what is refused."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from shafts_of_tests import launched, toy

import jaxrotor as jr


pytestmark = pytest.mark.filterwarnings("ignore::jaxrotor.ImplausibleWarning")

NODES = np.array([0.0, 0.5, 1.0, 2.0, 4.0])
KXX, CXX = np.array([0.8, 0.9, 1.1, 1.2, 1.5]), np.array([0.02, 0.03, 0.05, 0.05, 0.06])
KXY = np.array([0.0, 0.05, 0.1, 0.2, 0.3])


def tables(at, on, over, **more):
    values = {"kxx": KXX, "kyy": KXX, "kxy": KXY, "kyx": -KXY, "cxx": CXX, "speeds": NODES} | more
    return jr.Support(at=(at, 1.0), on=on, speeds_of=over, **values)


def scene_at(first, ratio, speed, *parts):
    return toy(ratio, speed, *parts, k12=0.1, spin=jr.ConstantSpeed(first))


WHOSE = {  # where, and the speed by those of both shafts
    "difference": (("lp", "hp", "difference"), lambda a, b: a - b),
    "sum": (("hp", "lp", "sum"), lambda a, b: a + b),
    "own": (("hp", None, None), lambda a, b: b),
    "first": (("hp", "lp", "first"), lambda a, b: a),
}
SHAFTS = [(1.3, 0.2), (-1.2, None), (0.0, 0.9)]


@pytest.mark.slow  # two structures of scenes each
@pytest.mark.parametrize("whose", WHOSE)
def test_roots_are_those_with_the_numbers_at_the_speed(whose):
    where, of = WHOSE[whose]
    for ratio, speed in SHAFTS:
        support = tables(*where)
        own = of(1.4, ratio * 1.4 + (speed or 0.0))
        found = jr.roots(scene_at(1.4, ratio, speed, support))
        wanted = jr.roots(scene_at(1.4, ratio, speed, support.at_speed(own)))
        both = map(np.sort_complex, (found, wanted))
        np.testing.assert_allclose(*both, rtol=0, atol=1e-12)


def test_ends_of_tables_are_speeds_of_the_first_shaft():
    """Of a shaft at 1.3 of its speed, and of one beside that by a speed of its own."""
    for ratio, speed in ((1.3, None), (-1.3, None), (1.3, 0.2)):
        last = (4.0 - (speed or 0.0)) / abs(ratio)
        parts = ratio, speed, tables("hp", None, None)
        jr.roots(scene_at(0.999 * last, *parts))
        with pytest.raises(ValueError, match=f"to {last:.6g}"):
            jr.roots(scene_at(1.001 * last, *parts))


def test_tables_for_one_sense_turn_with_the_shaft():
    one = tables("hp", None, None, speeds=NODES - 5.0, one_sense=True)
    scene, support = scene_at(1.4, -1.2, None, one), one.at_speed(-1.2 * 1.4)
    wanted = jr.roots(scene_at(1.4, -1.2, None, support))
    np.testing.assert_allclose(jr.roots(scene), wanted, rtol=1e-12)
    with pytest.raises(ValueError, match="negative speeds"):
        jr.roots(scene.at_speed(-1.4))


def test_critical_speeds_by_the_first_shaft():
    """`K(Omega_1 - Omega_2)` of a joint that turns with balls, by matrices written here."""
    scene = scene_at(1.4, 1.3, None, tables("lp", "hp", "difference", kxy=0 * KXY, kyx=0 * KXY))
    joint, across = PchipInterpolator(NODES, KXX), np.array([[1.0, -1.0], [-1.0, 1.0]])
    inertia = np.diag([1.0 - 0.2, 0.6 - 1.3 * 0.18])

    def determinant(w):
        stiffness = np.diag([1.0, 2.0]) + (0.1 + joint(0.3 * w)) * across
        return np.linalg.det(stiffness - w**2 * inertia)

    wanted = [brentq(determinant, *ends, xtol=1e-14) for ends in ((1.0, 2.0), (2.5, 3.5))]
    np.testing.assert_allclose(jr.critical_speeds(scene).forward, wanted, rtol=1e-10)
    with pytest.raises(ValueError, match="crossings"):
        jr.critical_speeds(scene, by="hp")


def test_locked_shafts_have_numbers():
    """The difference of their speeds is zero at any speed, so that critical speeds by both are known."""
    joint = tables("lp", "hp", "difference")
    locked = [scene_at(1.4, 1.0, None, one) for one in (joint, joint.at_speed(0.0))]
    found = [jr.critical_speeds(scene, by="hp").forward for scene in locked]
    np.testing.assert_allclose(*found, rtol=1e-12)


@pytest.mark.slow  # steps in time
def test_a_motion_has_the_numbers_at_the_speed():
    joint, times = tables("lp", "hp", "difference"), np.linspace(0.0, 5.0, 6)
    both = [scene_at(1.4, 1.3, 0.2, one) for one in (joint, joint.at_speed(1.4 * -0.3 - 0.2))]
    found = [jr.run_up(one, times, at=("lp", 1.0), start=launched()).coordinates for one in both]
    np.testing.assert_allclose(*found, atol=1e-12)


@pytest.mark.slow  # statics at three speeds
def test_a_film_between_shafts_over_speeds():
    film = jr.JournalBearing(
        ("lp", 1.0),
        on="hp",
        viscosity=1.0,
        radius=0.3,
        length=0.4,
        clearance=0.5,
        cavitated=False,
    )
    scene = toy(1.3, 0.1, jr.Gravity(0.1), film, k12=0.0)
    tabled = jr.linearized(scene, [1.0, 1.4, 1.8])
    found = np.sort_complex(jr.roots(tabled))
    np.testing.assert_allclose(found, np.sort_complex(jr.roots(jr.linearized(scene))), rtol=1e-10)


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        (lambda: tables("lp", "hp", None), "need `speeds_of`"),
        (lambda: tables("lp", None, "sum"), "not between two shafts"),
        (lambda: jr.Support(at=("lp", 1.0), kxx=1.0, speeds_of="first"), "belongs to tables"),
    ],
)
def test_what_is_refused(parts, said):
    with pytest.raises(ValueError, match=said):
        jr.roots(scene_at(1.4, 1.3, None, parts()))


def test_tables_that_lack_a_speed_which_is_always_the_same():
    with pytest.raises(ValueError, match="at any speed of the first shaft"):
        jr.roots(scene_at(1.4, 0.0, 9.0, tables("hp", None, None)))
