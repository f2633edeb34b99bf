"""Trapezoidal rule of a shaft held at its ends in every way, against closed forms of Rayleigh's beam."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import central
from scipy.optimize import brentq

import jaxrotor as jr
from jaxrotor import Constraint, Disc, FlexibleShaft, Scene


LENGTH, DIAMETER = 1.3, 0.05
STEEL = jr.Material(2.1e11, 7850.0)
AREA, SECOND = np.pi * DIAMETER**2 / 4, np.pi * DIAMETER**4 / 64
CELLS = (16, 32, 64)
# An end knows nothing of the other, so every kind is at either end once; and nothing holds the last.
PAIRS = [
    ("clamp", "guide"),
    ("pin", "clamp"),
    ("free", "pin"),
    ("guide", "free"),
    ("free", "free"),
]
RIGID = {("free", "free"): 2, ("free", "pin"): 1, ("guide", "free"): 1}


def rotor(pair, cells, *effects, speed=0.0, **shaft):
    both = zip((0.0, LENGTH), pair, strict=True)
    held = tuple(Constraint(at, holds) for at, holds in both if holds != "free")
    line = FlexibleShaft(
        LENGTH, DIAMETER, STEEL, nodes=cells, rule="trapezoid", constraints=held, **shaft
    )
    return Scene(line, *effects, spin=jr.ConstantSpeed(speed))


def conditions(holds, basis, frequency):
    """Two conditions on `w = basis(x)` at an end: `w`, `w'`, `EI w''` or `EI w''' + rho I omega^2 w'`."""
    w, slope, bent, sheared = basis
    moment = 2.1e11 * SECOND * bent
    force = 2.1e11 * SECOND * sheared + 7850 * SECOND * frequency**2 * slope
    return {
        "clamp": (w, slope),
        "pin": (w, moment),
        "guide": (slope, force),
        "free": (moment, force),
    }[holds]


def determinant(pair, frequency):
    """Of `EI w'''' + rho I omega^2 w'' - rho A omega^2 w = 0` under the conditions at both ends."""
    stiff, heavy, rotary = 2.1e11 * SECOND, 7850 * AREA, 7850 * SECOND
    p = np.roots([stiff, 0.0, rotary * frequency**2, 0.0, -heavy * frequency**2])
    # Each solution is 1 at the end from which it decays.
    start = np.where(p.real > 1e-9, LENGTH, 0.0)
    at = lambda x: [p**k * np.exp(p * (x - start)) for k in range(4)]
    rows = [
        *conditions(pair[0], at(0.0), frequency),
        *conditions(pair[1], at(LENGTH), frequency),
    ]
    rows = np.array([row / np.abs(row).max() for row in rows])
    found = np.linalg.det(rows)
    # A pair of solutions exp(+-i b x) makes a real determinant imaginary.
    return found.imag


def closed_form(pair, count):
    """First bending frequencies of Rayleigh's beam."""
    grid = np.linspace(50.0, 2e4, 800)
    values = [determinant(pair, f) for f in grid]
    places = [i for i in range(len(grid) - 1) if values[i] * values[i + 1] < 0][:count]
    own = lambda f: determinant(pair, f)
    return np.array([brentq(own, grid[i], grid[i + 1], xtol=1e-10) for i in places])


def bending(scene, count):
    whirl = np.sort(np.asarray(jr.roots(scene)).imag)
    return whirl[whirl > 20.0][:count]


def orders(pair, number):
    """Orders of convergence of a frequency between successive numbers of cells, and the last error."""
    exact = closed_form(pair, number)[-1]
    errors = [abs(bending(rotor(pair, cells), number)[-1] / exact - 1) for cells in CELLS]
    return np.log2(np.array(errors[:-1]) / errors[1:]), errors[-1]


@pytest.mark.slow
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_frequencies_converge_to_those_of_the_beam(pair):
    """With second order where an end is free, else with fourth: the error is of the integrand's slopes."""
    found, last = orders(pair, 2)
    expected = 2 if "free" in pair else 4
    assert np.all(np.abs(found - expected) < 0.25), (found, last)
    assert last < (2e-3 if expected == 2 else 1e-5)
    slow = np.abs(np.asarray(jr.roots(rotor(pair, 16)))) < 1.0
    assert np.sum(slow) == 2 * RIGID.get(pair, 0)


def test_pinned_shaft_of_few_cells():
    exact = closed_form(("pin", "pin"), 1)[0]
    whirl = bending(rotor(("pin", "pin"), 8), 1)[0]
    assert abs(whirl / exact - 1) < 1e-3


def test_static_deflection_and_reaction_free_balance():
    """A disc at the middle of a pinned shaft sags by `F l^3 / 48 EI`; the kernel is exact at nodes."""
    force = 1e5
    disc = Disc(LENGTH / 2, 1.0)
    scene = rotor(("pin", "pin"), 4, disc, jr.Gravity(force, angle=0.0))
    line = jr.assemble(scene).line
    both = eqx.filter_jit(lambda line, x: (line.column(x), line.row(x)))
    column, row = map(np.asarray, both(line, jnp.asarray(LENGTH / 2)))
    sag = row @ np.linalg.solve(np.asarray(line.stiffness), column)
    assert sag == pytest.approx(LENGTH**3 / (48 * 2.1e11 * SECOND), rel=1e-12)


@pytest.mark.slow
def test_gyroscopic_whirl_is_that_of_the_spectral_rule():
    """A rotating propped shaft with a disc at a node, by 96 cells and by 12 nodes in each span."""
    disc = Disc(0.375 * LENGTH, 20.0, 0.2, 0.4)
    coarse = rotor(("clamp", "pin"), 96, disc, speed=900.0)
    fine = Scene(
        FlexibleShaft(LENGTH, DIAMETER, STEEL, nodes=12, constraints=coarse.shaft.constraints),
        disc,
        spin=coarse.spin,
    )
    np.testing.assert_allclose(
        np.asarray(jr.roots(coarse, 4)).imag, np.asarray(jr.roots(fine, 4)).imag, rtol=3e-4
    )


@pytest.mark.long
def test_derivative_by_the_length():
    scene = rotor(("clamp", "pin"), 6, Disc(LENGTH / 2, 5.0))

    def lowest(diameter):
        return jr.roots(scene.put({"shaft.diameter": diameter}), 2)[0].imag

    value, slope = jax.jvp(lowest, (jnp.asarray(DIAMETER),), (jnp.ones(()),))
    expected = central(lambda k: float(lowest(jnp.asarray(DIAMETER + 1e-5 * k))), 1e-5)
    assert float(slope) == pytest.approx(expected, rel=1e-7) and float(value) > 0


@pytest.mark.parametrize("at", [0.5, 1e-6])
def test_constraints_between_the_ends_are_refused(at):
    with pytest.raises(ValueError, match='constraints at its ends only; take rule="spectral".'):
        FlexibleShaft(LENGTH, DIAMETER, rule="trapezoid", constraints=(Constraint(at),))
