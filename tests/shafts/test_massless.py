"""Massless shaft: its stations, and the stiffness that it accepts."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr


STILL = jr.ConstantSpeed(0.0)


def rotor(shaft, *effects):
    return jr.Scene(shaft, jr.Disc(shaft.at, 1.0, 1.0, 0.0), *effects, spin=STILL)


def elastic(*ends, at=0.3, length=0.6):
    """Unit mass on a shaft of unit stiffness, between supports of stiffness 1/2."""
    shaft = jr.MasslessShaft(length, at, 1.0, ends="elastic")
    return rotor(shaft, *(jr.Support(x, 0.5) for x in ends))


SERIES = np.sqrt(1 / (1 + 1))  # shaft in series with both supports


def test_stations_of_the_ends_are_compared_up_to_rounding():
    assert 3 * 0.2 != 0.6
    for scene in (elastic(0.0, 0.6), elastic(0.0, 3 * 0.2)):
        np.testing.assert_allclose(np.abs(jr.roots(scene)), SERIES, rtol=1e-14)
    # a support at the station of the disc is a spring to the ground
    scene = rotor(jr.MasslessShaft(0.6, 3 * 0.1, 1.0), jr.Support(0.3, 0.5))
    np.testing.assert_allclose(np.abs(jr.roots(scene)), np.sqrt(1.5), rtol=1e-14)


def test_supports_move_with_the_ends():
    scene = elastic(0.0, 0.6)
    moved = {"shaft.length": jnp.asarray(0.7), "supports.1.at": jnp.asarray(0.7)}
    np.testing.assert_allclose(np.abs(jr.roots(scene.put(moved))), SERIES, rtol=1e-14)
    np.testing.assert_allclose(np.abs(jr.roots(scene.replace(moved))), SERIES, rtol=1e-14)
    with pytest.raises(ValueError, match="support at 0.6 m is not at a station"):
        scene.replace({"shaft.length": 0.7})
    for left in ({"shaft.length": 0.7}, {"shaft.at": 0.2}, {"disc.at": 0.2}):
        left = {path: jnp.asarray(value) for path, value in left.items()}
        with pytest.raises(Exception, match="must stay at a station of the shaft"):
            jr.roots(scene.put(left))
    with pytest.raises(Exception, match="must stay at a station of the shaft"):
        jax.vmap(lambda x: jr.growth_rate(scene.replace({"shaft.length": x})))(jnp.array([0.6, 1]))


def shaft(*stiffness, at=0.5, **options):
    return rotor(jr.MasslessShaft(1.0, at, *stiffness, **options))


def test_semidefinite_elasticity_has_a_motion_without_bending():
    """`k12^2 = k11 k22`: a spring at a distance of 0.3, which a rotation by -1 / 0.3 does not stretch."""
    found = np.sort(np.abs(jr.roots(shaft(2.0, 0.6, 0.18))))
    np.testing.assert_allclose(found, [0, 0, np.sqrt(2.18), np.sqrt(2.18)], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: shaft(1.0, 5.0, 1.0), "k12 is 5, k11 1 and k22 1"),
        (lambda: shaft(1.0, 0.5, 1.0).replace({"shaft.k12": 1.5}), "k12 is 1.5, k11 1 and k22 1"),
        (lambda: shaft(1.0, anisotropy=1.5), "between -1 and 1, but is 1.5"),
        (lambda: shaft(1.0, anisotropy=0.5).replace({"shaft.anisotropy": -1.0}), "but is -1"),
        (lambda: shaft(1.0, at=2.5), "on the shaft (0 to 1), but is 2.5"),
        (lambda: elastic(0.0, 0.6, at=0.0), "between the elastic ends (0 and 0.6), but is 0"),
        (lambda: elastic(0.0, 0.6, at=3 * 0.2), "between the elastic ends (0 and 0.6), but is 0.6"),
        (lambda: elastic(), "needs a Support at 0 m and at 0.6 m, but nothing is at 0 m"),
        (lambda: elastic(0.0), "needs a Support at 0 m and at 0.6 m, but nothing is at 0.6 m"),
        (lambda: elastic(0.0, 0.6).without("supports"), "nothing is at 0 m"),
        (lambda: jr.MasslessShaft.clamped_pinned(1, 40.0, 1), "`length - at [m]` must be positive"),
        (lambda: jr.MasslessShaft.clamped_pinned(1, 40.0, 0), "`at [m]` must be positive"),
        (lambda: jr.MasslessShaft.clamped_free(1.0, 40.0, 0.0), "`at [m]` must be positive"),
        (lambda: jr.MasslessShaft.clamped_free(1.0, 40.0, 1.2), "on the shaft (0 to 1)"),
    ],
)
def test_refusals(make, sentence):
    with pytest.raises(ValueError) as error:
        make()
    assert sentence in str(error.value)


def test_without_any_mass():
    scene = shaft(1.0).without("disc")
    for use in (jr.roots, jr.modes, jr.growth_rate, lambda scene: jr.simulate(scene, 2)):
        with pytest.raises(ValueError, match="The rotor has no mass, .* add a Disc"):
            use(scene.replace({"spin.speed": 1.0}))


def test_lengths_are_differentiable():
    """`d k11 / d a` of `12 EI / a^3`, and `d k11 / d l` of the propped shaft at a = b, by hand."""
    slope = jax.grad(lambda a: jr.MasslessShaft.clamped_free(1.0, 40.0, a).k11)(0.5)
    assert float(slope) == pytest.approx(-36 * 40 / 0.5**4)
    # 3 EI (1 / b^3 + 4 / a^3): the length changes b only
    slope = jax.grad(lambda x: jr.MasslessShaft.clamped_pinned(x, 40.0, 0.5).k11)(1.0)
    assert float(slope) == pytest.approx(-9 * 40 / 0.5**4)
