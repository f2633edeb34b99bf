"""Shafts of many sections, whose line is condensed, against finite elements."""

import fem
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.sparse.linalg import eigs

import jaxrotor as jr
from jaxrotor.core.blocks import Blocks
from jaxrotor.effects.base import AbstractLinear


LENGTH, SECTIONS, SPEED = 2.0, 30, 600.0
MATERIAL = jr.Material(2.05e11, 7830.0, 8e10)
DIAMETERS = [0.11 + 0.03 * (k % 3) + 0.002 * (k % 5) for k in range(SECTIONS)]
STARTS = [LENGTH * k / SECTIONS for k in range(SECTIONS)]
DISCS = [(LENGTH * k / 16, 35.0, 0.5, 0.9) for k in (5, 8, 11)]
BEARINGS = [(LENGTH * k / 16, 8e7) for k in (2, 14)]


def scene(shear):
    steps = [jr.Step(at, own) for at, own in zip(STARTS[1:], DIAMETERS[1:], strict=True)]
    shaft = jr.FlexibleShaft(LENGTH, DIAMETERS[0], MATERIAL, steps=steps, shear=shear)
    discs = [jr.Disc(*disc) for disc in DISCS]
    bearings = [jr.Support(at, kxx=stiff) for at, stiff in BEARINGS]
    return jr.Scene(shaft, *discs, *bearings, spin=jr.ConstantSpeed(SPEED))


def whirls(shear, discs=DISCS, bearings=BEARINGS):
    """Whirl frequencies [rad/s] at the speed by finite elements, ascending.

    Of two meshes: their error goes with the square of the length of the elements.
    """
    coarse, fine = (
        whirls_of_elements(shear, LENGTH / pieces, discs, bearings)[:8] for pieces in (60, 120)
    )
    return (4 * fine - coarse) / 3


def whirls_of_elements(shear, longest, discs, bearings):
    stops = [*STARTS[1:], LENGTH]
    stretches = [fem.Stretch(*piece) for piece in zip(stops, DIAMETERS, strict=True)]
    springs = [(at, stiff * np.eye(2)) for at, stiff in bearings]
    material = (2.05e11, 7830.0, 8e10 if shear else np.inf)
    _, mass, turned, stiff = fem.matrices(stretches, discs, springs, material, longest)
    flexible = np.linalg.inv(stiff)
    rate = np.block(
        [[-flexible @ (SPEED * turned), -flexible @ mass], [np.eye(len(mass)), 0 * mass]]
    )
    found = 1 / eigs(rate, 20, v0=np.ones(len(rate)), return_eigenvectors=False)  # the slowest
    return np.sort(found.imag[found.imag > 0])


@pytest.mark.slow  # an assembly of thirty sections
@pytest.mark.parametrize("shear", [True, False])
def test_whirls_are_those_of_finite_elements(shear):
    rotor = scene(shear)
    # Bearings do not hold the slope.
    assert sum(couple for _, couple in rotor.layouts[0].attached) == len(DISCS)
    assert jr.assemble(rotor).n == 2 + 40 + 2 * len(DISCS) + len(BEARINGS)
    found = np.sort(np.abs(np.asarray(jr.roots(rotor, 8)).imag))
    assert found == pytest.approx(whirls(shear), rel=1e-6)


@pytest.mark.slow  # the derivative of the assembly
def test_derivatives_are_those_of_finite_elements():
    """By the station of a disc, which moves the shapes, and by the stiffness of the bearings."""
    rotor, (at, *disc), (_, stiff) = scene(False), DISCS[0], BEARINGS[0]

    def frequencies(at, stiff):
        return jr.roots(rotor.replace({"discs.0.at": at, "supports.kxx": stiff}), 8).imag

    def elements(at, stiff):
        return whirls(False, [(at, *disc), *DISCS[1:]], [(place, stiff) for place, _ in BEARINGS])

    both = jax.jit(lambda along: jax.jvp(frequencies, (at, stiff), along))
    for change, rel, bound in (([2e-3, 0.0], 0.0, 1e-3), ([0.0, 4e5], 1e-4, 0.0)):
        values, exact = map(np.asarray, both(tuple(change)))
        exact = (np.sign(values) * exact)[np.argsort(np.abs(values))]
        ahead, behind = (elements(at + way * change[0], stiff + way * change[1]) for way in (1, -1))
        differences = (ahead - behind) / 2
        size = np.abs(differences).max()
        assert exact == pytest.approx(differences, rel=rel, abs=bound * size)


@pytest.mark.slow  # two programs of a motion
def test_motion_of_a_shaft_with_a_disc_at_a_pin():
    """A force at a pin deflects nothing; the steady motion under unbalance is that of finite elements."""
    steps = [jr.Step(at, own) for at, own in zip(STARTS[1:], DIAMETERS[1:], strict=True)]
    pins, middle, damping, moment = (LENGTH / 8, 7 * LENGTH / 8), LENGTH / 2, 2e4, 0.02
    shaft = jr.FlexibleShaft(
        LENGTH, DIAMETERS[0], MATERIAL, steps=steps, constraints=[*map(jr.Constraint, pins)]
    )
    discs = [(pins[0], 20.0, 0.3, 0.5), (middle, 35.0, 0.5, 0.9)]
    parts = [
        *(jr.Disc(*disc) for disc in discs),
        jr.DiscDamping(middle, damping),
        jr.Unbalance(middle, moment=moment),
    ]
    rotor = jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(SPEED))
    assert rotor.condensed
    found = jr.simulate(rotor, 100, 16, keep=1, at=middle, progress=False).displacement[-1, 0]
    stretches = [
        fem.Stretch(*piece) for piece in zip([*STARTS[1:], LENGTH], DIAMETERS, strict=True)
    ]
    springs = [(at, 1e14 * np.eye(2)) for at in pins]
    nodes, mass, turned, stiff = fem.matrices(
        stretches, discs, springs, (2.05e11, 7830.0, np.inf), LENGTH / 120
    )
    rates, x = SPEED * turned, 4 * int(np.argmin(np.abs(nodes - middle)))
    rates[x : x + 2, x : x + 2] += damping * np.eye(2)
    force = np.zeros(len(mass), complex)
    force[x : x + 2] = moment * SPEED**2 * np.array([1.0, -1j])
    expected = np.linalg.solve(stiff + 1j * SPEED * rates - SPEED**2 * mass, force)[x : x + 2].real
    assert [found.real, found.imag] == pytest.approx(expected, rel=1e-4)


def test_few_sections_keep_their_coordinates():
    shaft = jr.FlexibleShaft(1.0, 0.05)
    few = jr.Scene(shaft, jr.Disc(0.5, 10.0), spin=jr.ConstantSpeed(SPEED))
    assert not few.condensed


class Tilting(jr.CubicSpring, AbstractLinear):
    """A spring on the slope beside one on the displacement."""

    def blocks(self, line):
        return Blocks(
            stiffness=1e8 * jnp.outer(line.couple_column(self.at), line.slope_row(self.at))
        )


@pytest.mark.slow  # an assembly of thirty sections each
def test_a_slope_is_held_where_values_are_put_and_by_a_part_of_ones_own():
    at = BEARINGS[0][0]
    bare = scene(False)
    given = bare.replace({"supports.0.angular_stiffness": 1e8})
    own = bare.of_parts(*bare.effects, Tilting(at, 0.0, 0.0))
    wanted = np.asarray(jr.roots(given.with_nodes(4), 6)).imag
    for rotor in (given, bare.put({"supports.0.angular_stiffness": 1e8}), own):
        assert rotor.condensed
        found = np.asarray(jr.roots(rotor, 6)).imag
        np.testing.assert_allclose(np.sort(found), np.sort(wanted), rtol=1e-6)
