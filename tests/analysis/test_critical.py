"""Critical speeds and their whirl, against finite elements that share no code with them."""

import fem
import jax
import numpy as np
import pytest

import jaxrotor as jr


STEEL = (2.1e11, 7850.0, 2.1e11 / 2.6)
OIL = np.array([[8e7, 1e7], [-2e7, 4e7]])  # stiffness of an oil film [N/m]


def fan(*more):
    """An overhung disc on a stepped shaft in two oil films."""
    shaft = jr.FlexibleShaft(
        1.2, 0.08, steps=(jr.Step(0.3, 0.1), jr.Step(0.9, 0.07)), constraints=(), shear=True
    )
    bearings = (jr.Support(at, stiffness=OIL) for at in (0.2, 0.8))
    return jr.Scene(shaft, jr.Disc(1.15, 80.0, 2.0, 3.8), *bearings, *more, spin=SPIN)


def two(*more):
    scene = jr.load("two-discs-unequal")
    return scene.of_parts(*scene.effects, *more)


SPIN = jr.ConstantSpeed(100.0)
# The skew part of a cross-coupled stiffness does not count.
FAN = fem.critical_speeds(
    [fem.Stretch(0.3, 0.08), fem.Stretch(0.9, 0.1), fem.Stretch(1.2, 0.07)],
    [(1.15, 80.0, 2.0, 3.8)],
    [(at, (OIL + OIL.T) / 2) for at in (0.2, 0.8)],
    STEEL,
    0.025,
    8,
)
TWO = fem.critical_speeds(
    [fem.Stretch(1.5, 0.05)],
    [
        (0.5, 32.58972765, 0.1780892826, 0.3295636209),
        (1.0, 51.52526111, 0.4235805841, 0.8050822049),
    ],
    [(at, np.diag([1e6, 0.8e6])) for at in (0.0, 1.5)],
    (2.11e11, 7810.0, 8.12e10),
    0.025,
    8,
)
STOPS = [jr.Limiter(at, 0.0, 3e-4, 1e6) for at in (0.07, 0.6)]


@pytest.mark.parametrize(
    "more", [pytest.param((), marks=pytest.mark.slow), STOPS], ids=["bare", "stops"]
)
@pytest.mark.parametrize("scene, expected", [(fan, FAN), (two, TWO)], ids=["fan", "two-discs"])
def test_speeds_and_senses_are_those_of_finite_elements(scene, expected, more):
    """Stops only add stations, so they do not change the critical speeds."""
    nodes, speeds, shares, senses = expected
    found = jr.critical_speeds(scene(*more))
    np.testing.assert_allclose(found.speeds[:8], speeds, rtol=1e-7)
    np.testing.assert_allclose(found.forward_share[:8], shares, atol=1e-6)
    for own, sense in zip(np.asarray(found.senses), senses, strict=False):
        own = np.interp(nodes, np.asarray(found.stations), own)
        np.testing.assert_allclose(np.median(own - sense), 0.0, atol=1e-3)
    kinds = ["forward" if s > 0.6 else "backward" if s < 0.4 else "mixed" for s in shares]
    assert found.kinds[:8] == kinds and len({*kinds}) == 3
    for kind in {*kinds}:
        own = np.asarray(getattr(found, kind))
        np.testing.assert_array_equal(own, found.speeds[np.array(found.kinds) == kind])


def test_as_many_of_each_kind_as_asked_for():
    found = jr.critical_speeds(two(), 1)
    np.testing.assert_allclose(found.speeds, TWO[1][[0, 2, 3]], rtol=1e-7)
    assert found.kinds == ["mixed", "backward", "forward"]


@pytest.mark.slow
def test_traced_speeds_are_those_of_each_kind():
    """Infinite speeds fill up the result where traced."""
    scene = two()
    own = jax.jit(lambda k: jr.critical_speeds(scene.put({"supports.0.stiffness": k}), 3))(9e5)
    known = jr.critical_speeds(scene, 3)
    for kind in ("forward", "backward", "mixed"):
        expected = np.asarray(getattr(known, kind))
        found = np.asarray(getattr(own, kind))
        np.testing.assert_allclose(found[: expected.size], expected, rtol=1e-9)
        assert np.isinf(found[expected.size :]).all()
