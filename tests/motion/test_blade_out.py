"""Unbalance that appears in a motion, as of a lost blade, against DOP853."""

import dataclasses

import diffrax as dfx
import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shafts_of_tests import launched, toy

import jaxrotor as jr


TIMES = np.linspace(0.0, 25.0, 26)
SINCE, LOST, PHASE = 7.3, 0.1, 0.4
BLADE = jr.Unbalance(("hp", 1.0), moment=LOST, phase=PHASE, since=SINCE)
BEGIN = np.array([0.05, -0.03j, 0.0, 0.0])
RING = {"gap": 0.12, "stiffness": 20.0, "damping": 0.3, "friction": 0.1}


def found(ratio, speed, force=lambda z, v: 0.0, times=TIMES):
    """The toy by DOP853, from `SINCE` on with the lost blade, by equations written here."""
    w = np.array([1.4, 1.4 * ratio + speed])
    mass, polar = np.array([1.0, 0.6]), np.array([0.2, 0.18])
    turning, still, spring = np.array([0.01, 0.02]), np.array([0.04, 0.03]), np.array([1.0, 2.0])
    across = np.array([1.0, -1.0])

    def field_with(moment):
        unbalance = np.array([0.05, 0.03 * np.exp(0.7j) + moment * np.exp(1j * PHASE)])

        def field(t, y):
            z, v = y[:2], y[2:]
            f = unbalance * w**2 * np.exp(1j * w * t) - (still + turning) * v + 1j * w * turning * z
            f = f - spring * z - (0.8 * (z @ across) + 0.02 * (v @ across)) * across
            return np.concatenate([v, (f + force(z, v) + 1j * w * polar * v) / mass])

        return field

    tight = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-14}
    early, late = times[times <= SINCE], times[times > SINCE]
    first = solve_ivp(field_with(0.0), (0, SINCE), BEGIN, t_eval=[*early, SINCE], **tight)
    span = SINCE, times[-1]
    second = solve_ivp(field_with(LOST), span, first.y[:, -1], t_eval=late, **tight)
    return np.concatenate([first.y[:2, :-1], second.y[:2]], axis=1).T


def test_a_linear_motion_is_exact():
    motion = jr.run_up(toy(1.3, 0.2, BLADE), TIMES, at=("lp", 1.0), start=launched())
    np.testing.assert_allclose(motion.coordinates, found(1.3, 0.2), atol=1e-9)
    np.testing.assert_allclose(motion.time, TIMES)
    np.testing.assert_allclose(motion.angle, 1.4 * TIMES)
    forces = motion.instants.absolute  # which jump with the unbalance
    assert forces.shape == motion.coordinates.shape


def test_it_appears_whatever_the_rounding_of_the_times():
    """`.303 + (.89 - .303)` is less than .89."""
    scene = toy(1.3, 0.2, jr.Unbalance(("hp", 1.0), moment=LOST, since=0.89))
    first = jr.run_up(scene, [0.0, 0.303], at=("lp", 1.0), start=launched())
    rest = jr.run_up(scene, np.array([0.0, 1.0]), at=("lp", 1.0), start=first.end)
    whole = jr.run_up(scene, [0.0, 1.303], at=("lp", 1.0), start=launched())
    np.testing.assert_allclose(rest.displacement[-1], whole.displacement[-1], rtol=1e-12)


def test_a_motion_goes_on_to_the_time_and_beyond():
    """The time counts from the beginning of the first of motions that continue each other."""
    scene = toy(1.3, 0.2, BLADE)
    whole = jr.run_up(scene, TIMES, at=("lp", 1.0), start=launched())
    for cut in (5, 10):
        part = jr.run_up(scene, TIMES[: cut + 1], at=("lp", 1.0), start=launched())
        rest = jr.run_up(scene, TIMES[: 26 - cut], at=("lp", 1.0), start=part.end)
        np.testing.assert_allclose(rest.displacement, whole.displacement[cut:], atol=1e-10)


@pytest.mark.slow  # tight steps through contact
def test_a_lost_blade_drives_the_shaft_into_a_ring():
    """The shaft comes to the ring with the blade alone."""
    ring = jr.AnnularStator(("lp", 1.0), rim_radius=1.0, **(RING | {"gap": 0.5}))
    run = {"solver": dfx.Dopri8(), "controller": dfx.PIDController(rtol=1e-10, atol=1e-13)}
    motion = jr.run_up(toy(1.3, 0.0, ring, BLADE), TIMES, at=("lp", 1.0), start=launched(), **run)

    def force(z, v):
        n, depth = z[0] / abs(z[0]), abs(z[0]) - 0.5
        normal = 20.0 * depth + 0.3 * (v[0] * np.conj(n)).real
        slip = 1.4 + (v[0] * np.conj(n)).imag
        pressed = depth > 0 and normal > 0
        return np.array([-normal * (1 + 0.1j * np.sign(slip)) * n if pressed else 0.0, 0.0])

    wanted = found(1.3, 0.0, force)
    assert np.abs(wanted[TIMES <= SINCE, 0]).max() < 0.5 < np.abs(wanted[:, 0]).max()
    np.testing.assert_allclose(motion.coordinates, wanted, atol=3e-8)
    touched = np.abs(motion.contact_force[:, 0]) > 0
    assert touched.any() and not touched[TIMES <= SINCE].any()


def one_shaft(*parts, **options):
    shaft = jr.RigidShaft(1.0, constraints=[jr.Constraint(at=0.0, holds="pin")])
    disc = jr.Disc(1.0, mass=0.9, diametral=0.1, polar=0.2)
    spin = jr.ConstantSpeed(1.4)
    return jr.Scene(shaft, disc, jr.Support(1.0, kxx=1.0, cxx=0.05), *parts, spin=spin, **options)


@pytest.mark.slow  # two runs of another structure
def test_one_shaft_by_revolutions_and_by_times():
    blades = [
        jr.Unbalance(1.0, moment=0.1, since=5.0),
        jr.Unbalance(1.0, mass=1.0, eccentricity=0.2),
    ]
    scene = one_shaft(*blades)
    by_turns = jr.simulate(scene, 3, 16)
    along = jr.simulate(scene, times=by_turns.time)
    np.testing.assert_allclose(by_turns.displacement, along.displacement, atol=1e-8)
    alone = scene.without("unbalances")
    before = jr.simulate(alone.of_parts(*alone.effects, blades[1]), times=[0.0, 5.0])
    late = dataclasses.replace(blades[0], since=None)
    rest = jr.simulate(
        alone.of_parts(*alone.effects, blades[1], late), times=[0.0, 4.0], start=before.end
    )
    whole = jr.simulate(scene, times=[0.0, 9.0])
    assert whole.displacement[-1, 0] == pytest.approx(complex(rest.displacement[-1, 0]), abs=1e-9)


def test_what_is_refused():
    scene = one_shaft(jr.Unbalance(1.0, moment=0.1, since=5.0))
    with pytest.raises(ValueError, match="sweep on from there"):
        jr.sweep(scene, {"unbalance.moment": [0.1, 0.2]}, settle=1, keep=1)
    motion = jr.simulate(scene, times=[0.0, 9.0])
    with pytest.raises(ValueError, match="on from `motion.end`"):
        jr.reactions(motion)
    moved = lambda time: jr.run_up(scene.put({"unbalance.since": time}), [0.0, 9.0]).angle
    with pytest.raises(ValueError, match="must be known"):
        jax.jit(moved)(5.0)
