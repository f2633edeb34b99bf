"""A shaft has no constraints unless they are drawn, and rotors that nothing holds are treated as free."""

import fem
import jax
import numpy as np
import pytest
import scipy.linalg

import jaxrotor as jr
from jaxrotor.equations.rigid_motions import unheld


STEEL = (2.1e11, 7850.0, np.inf)
TWO_BEARINGS = """
[shaft]
length = "1 m"
diameter = "50 mm"
[disc]
at = "0.5 m"
mass = "10 kg"
[[support]]
at = "0 m"
stiffness = "10 MN/m"
[[support]]
at = "1 m"
stiffness = "10 MN/m"
[spin]
speed = 0
"""


def frequencies(bearings, mass=10.0):
    """Natural frequencies [rad/s] of the rotor at rest by finite elements, along one axis."""
    discs = [(0.5, mass, 0.0, 0.0)]
    held = [(at, np.diag([stiffness, stiffness])) for at, stiffness in bearings]
    _, inertia, _, stiffness = fem.matrices([fem.Stretch(1.0, 0.05)], discs, held, STEEL, 0.025)
    plane = np.ix_(*[np.arange(0, len(inertia), 2)] * 2)
    squares = scipy.linalg.eigh(stiffness[plane], inertia[plane], eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0))


def test_two_bearings_alone_hold_a_shaft():
    """A file without `constraints` has none: 383 rad/s in its bearings, where a clamp gave 611."""
    scene = jr.loads(TWO_BEARINGS)
    expected = frequencies([(0.0, 1e7), (1.0, 1e7)])[:3]
    assert expected[0] == pytest.approx(383.3, abs=0.1)
    np.testing.assert_allclose(np.abs(jr.roots(scene, 6))[::2], expected, rtol=2e-6)


def test_a_free_rotor_has_zero_roots_and_bends_as_finite_elements_do():
    """Four roots of its drift are zero at rest, not small numbers of either sign."""
    scene = jr.loads(TWO_BEARINGS[: TWO_BEARINGS.index("[[support")] + "[spin]\nspeed = 0\n")
    found = np.asarray(jr.roots(scene, 8))
    np.testing.assert_array_equal(found[:4], 0.0)
    expected = frequencies([])[2:4]
    np.testing.assert_allclose(found[4:].imag, np.repeat(expected, 2) * [1, -1, 1, -1], rtol=1e-5)
    assert unheld(scene) == "nothing holds it"


def test_a_free_rigid_rotor_precesses():
    """`lambda = 0, 0, 0, i Omega I_p / I_d` of a rigid body: Euler's precession."""
    scene = rigid(speed=100.0)
    np.testing.assert_allclose(np.asarray(jr.roots(scene)), [0, 0, 0, 200j], atol=1e-9)
    np.testing.assert_allclose(jr.campbell(scene, [50.0, 100.0]).frequencies[:, 3], [100.0, 200.0])
    assert jr.growth_rate(scene) == 0.0


def test_a_free_rotor_neither_grows_nor_decays_where_it_is_traced():
    """Growth is zero, not rounding of either sign, also in programs that take the scene."""
    for effects in ((), (jr.Support(0.0, 1e6),)):
        growth = jax.jit(lambda scene, speed: jr.growth_rate(scene.at_speed(speed)))
        found = [growth(rigid(*effects), speed) for speed in (0.0, 1.0, 50.0)]
        np.testing.assert_array_equal(found, 0.0)
    boundary = jr.stability_boundary(rigid(jr.Support(0.0, 1e6)), "spin.speed", [0.0, 10.0, 90.0])
    assert not boundary.values.size


def rigid(*effects, speed=0.0, constraints=()):
    """Rigid shaft with a disc whose polar is twice its diametral moment of inertia."""
    disc = jr.Disc(0.5, 10.0, 0.1, 0.2)
    return jr.Scene(jr.RigidShaft(1.0, constraints), disc, *effects, spin=jr.ConstantSpeed(speed))


PIN = (jr.Constraint(0.0),)
AT, TO = jr.Support(0.0, 1e6), jr.Support(1.0, 1e-3)
TILTS, ALONG_Y = "it can move as a rigid body", "it can move as a rigid body along y"


@pytest.mark.parametrize(
    ("scene", "free"),
    [
        (rigid(), "nothing holds it"),
        (rigid(constraints=PIN), TILTS),
        (rigid(AT), TILTS),
        (rigid(AT, AT), TILTS),
        (rigid(AT, TO), ""),  # a soft support is one
        (rigid(TO, constraints=PIN), ""),
        (rigid(jr.Support(0.0, 1e6, angular_stiffness=1.0)), ""),
        (rigid(AT, jr.Support(1.0, kxx=1e6, kyy=0.0)), ALONG_Y),
        (rigid(AT, jr.Support(1.0, kxx=1e6, kyy=1.0)), ""),
        (rigid(AT, jr.Support(1.0, kxx=1e6)), ""),
        (rigid(AT, jr.Support(1.0, -1e5)), ""),  # unstable, but not free
        (rigid(AT, jr.Support(1.0, kxx=0.0, kxy=1e6, kyx=-1e6, kyy=0.0)), ""),
        (
            rigid(
                jr.Support(0.0, 1e6, on="box"),
                jr.Support(1.0, 1e6, on="box"),
                jr.Casing("box", 5.0),
                jr.Support(of="box", stiffness=0.0),
            ),
            TILTS,
        ),
        (rigid(jr.DiscDamping(0.5, 1.0, 1.0)), "nothing holds it"),  # a damper lets it drift
        (
            jr.Scene(
                jr.MasslessShaft(1.0, 0.5, 1e5), jr.Disc(0.5, 1.0), spin=jr.ConstantSpeed(0.0)
            ),
            "",
        ),
    ],
)
def test_what_holds_a_rotor(scene, free):
    assert unheld(scene) == free


@pytest.mark.slow
def test_what_needs_a_held_rotor_refuses_a_free_one():
    cure = "needs a rotor that is held, but nothing holds it; give the shaft `constraints`, for"
    falling = rigid(jr.Gravity(), speed=10.0)
    for run in (
        lambda: jr.weight_response(falling, 10.0),
        lambda: jr.steady_state(falling),
        lambda: jr.simulate(falling, revolutions=1),
        lambda: jr.sweep(falling, {"spin.speed": [1.0, 2.0]}),
        lambda: jr.lyapunov(rigid(jr.Unbalance(0.5, 1.0, 1e-4), speed=10.0)),
        lambda: jr.unbalance_response(rigid(jr.Unbalance(0.5, 1.0, 1e-4)), [0.0, 1.0]),
    ):
        with pytest.raises(ValueError, match=cure):
            run()
    with pytest.raises(
        ValueError, match="The rotor is free, and no motion grows, from 1 to 10 rad/s"
    ):
        jr.onset_speed(rigid(), (1.0, 10.0))


def test_unbalance_moves_a_free_rotor_round_its_centre_of_mass():
    """`z = -m e / M` at every speed, with the sign of a rotor far above its critical speeds."""
    scene = rigid(jr.Unbalance(0.5, 10.0, 1e-4))
    found = jr.unbalance_response(scene, [1.0, 300.0], 0.5).forward[:, 0]
    np.testing.assert_allclose(found, [-1e-4, -1e-4], rtol=1e-12)


def test_a_rotor_on_a_casing_or_a_seal_inside_a_program():
    """The speed alone is traced: `det(K - w^2 M) = 0` of a chain of two masses; NaN beyond tables."""
    shaft = jr.RigidShaft(1.0, constraints=[jr.Constraint(1.0, "pin")])
    parts = jr.Disc(0.0, 2.0), jr.Casing("pedestal", 1.0), jr.Support(of="pedestal", stiffness=2e6)
    spin = jr.ConstantSpeed(150.0)
    scene = jr.Scene(shaft, *parts, jr.Support(0.0, 1e6, on="pedestal"), spin=spin)
    stiffness, inertia = np.array([[1e6, -1e6], [-1e6, 3e6]]), np.diag([2.0, 1.0])
    expected = np.sqrt(scipy.linalg.eigh(stiffness, inertia, eigvals_only=True))
    roots = jax.jit(lambda speed: jr.roots(scene.at_speed(speed)))(300.0)
    np.testing.assert_allclose(np.unique(np.abs(roots.imag).round(6)), expected, rtol=1e-8)
    seal = jr.Support(0.0, kxx=[-1e3, -2e3], cxx=4.0, speeds=[100.0, 200.0])
    sealed = jr.Scene(shaft, parts[0], seal, spin=spin)
    growth = jax.jit(lambda speed: jr.growth_rate(sealed.at_speed(speed)))
    assert float(growth(100.0)) == pytest.approx(-1 + np.sqrt(1 + 1e3 / 2), rel=1e-9)
    assert np.isnan(growth(300.0))
