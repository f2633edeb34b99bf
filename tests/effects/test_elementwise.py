"""Laws that take lanes along a last axis give each lane the force that they give it alone."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor.core.lanes import one_lane
from jaxrotor.effects.coefficients import DeviatorLaw
from jaxrotor.effects.cubic_spring import CubicLaw
from jaxrotor.effects.law import Now
from jaxrotor.equations.port import Port
from jaxrotor.solvers.ports import forces_of_lanes


LANES = 12
FILM = {"viscosity": 0.02, "radius": 0.04, "length": 0.03, "clearance": 1e-4}
STOP = {"gap": 2e-5, "stiffness": 4e6, "damping": 60.0, "friction": 0.1, "rim_radius": 0.1}
ROLLING = {"balls": 7, "stiffness": 1e10, "gap": 2e-5, "inner_radius": 0.04, "outer_radius": 0.06}
SEAL = {"clearance": 4e-4, "stiffness": 6e5, "damping": 1800.0, "swirl": 0.46, "inertia": 4.0}
SEAL |= {"exponent": 2.0, "swirl_exponent": 0.6}
MAGNETIC = {"constant": 4e-6, "bias": 3.0, "gap": 4e-4, "kp": 15000.0, "kd": 15.0, "limit": 0.5}
SOFT = {"blend": 1e-5, "slip": 0.05}
LAWS = {
    "stop": jr.Limiter(0.5, 0.7, **STOP).law(),
    "blended stop": jr.Limiter(0.5, 0.7, **STOP, **SOFT).law(),
    "ring": jr.AnnularStator(0.5, **STOP, offset=1e-5, angle=0.4).law(),
    "blended ring": jr.AnnularStator(0.5, **STOP, **SOFT).law(),
    "cubic spring": jr.CubicSpring(0.5, 0.3, 1e12).law(),
    "film": jr.JournalBearing(0.5, **FILM, offset=1e-5, angle=0.4).law(),
    "blended film": jr.JournalBearing(0.5, **FILM, blend=0.1).law(),
    "full film": jr.SqueezeFilm(0.5, **FILM, cavitated=False).law(),
    "rolling bearing": jr.RollingBearing(0.5, **ROLLING, angle=0.3).law(),
    "blended rolling bearing": jr.RollingBearing(0.5, **ROLLING, exponent=1.2, blend=1e-6).law(),
    "seal": jr.Seal(0.5, **SEAL, offset=1e-5, angle=0.4).law(),
    "plain seal": jr.Seal(0.5, 4e-4, 6e5, 1800.0, 0.46).law(),
    "crack": jr.Crack(0.5, 3e5, 1e5, angle=0.3).law(),
    "crack by switch": jr.Crack(0.5, 3e5, 1e5, angle=0.3, breathing="switch").law(),
    "crack by response": jr.Crack(0.5, 3e5, angle=2.0, breathing="response").law(),
    "magnetic bearing": jr.MagneticBearing(0.5, **MAGNETIC).law(),
    "unequal bearing": DeviatorLaw(jnp.array([2e6, 3e5]), jnp.array([40.0, 7.0])),
}


def motions():
    """Displacements [m], velocities [m/s], speeds [rad/s] and angles [rad], lanes last."""
    draw = np.random.default_rng(0)
    place = lambda size: jnp.asarray(draw.uniform(-size, size, (2, LANES)))
    return place(6e-5), place(0.1), Now(*jnp.asarray(draw.uniform(-300, 300, (2, LANES))))


@jax.jit
def forces(law, motion):
    """Forces of a law whose lanes share its numbers, and of one that has its own, together and by lane."""
    shared = one_lane(law)
    own = jax.tree.map(lambda leaf: leaf * (1 + 0.02 * jnp.arange(LANES)), shared)
    each = lambda law, motion: law(*motion)
    mapped = jax.vmap(each, in_axes=(None, -1), out_axes=-1)(law, motion)
    mapped_own = jax.vmap(each, in_axes=-1, out_axes=-1)(own, motion)
    return (shared(*motion), mapped), (own(*motion), mapped_own)


@pytest.mark.parametrize("name", LAWS)
def test_each_lane_has_the_force_of_its_own_motion(name):
    """Numbers of the law are shared by all lanes, or each lane has its own."""
    assert LAWS[name].elementwise
    for found, wanted in forces(LAWS[name], motions()):
        assert np.any(np.asarray(wanted) != 0, axis=0).sum() > 2  # lanes are loaded
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-9)


def test_a_law_of_several_modes_is_mapped_over_the_lanes():
    assert not jr.JournalBearing(0.5, **FILM, modes=4).law().elementwise


class Central(CubicLaw):
    """A spring to the centre, whose formula is not elementwise though it inherits from one that is."""

    def __call__(self, displacement, velocity, now):
        return -self.stiffness * jnp.sum(displacement**2) * displacement


def test_a_law_that_only_inherits_is_mapped_over_the_lanes():
    law = jax.tree.map(lambda leaf: leaf[None], Central(*jnp.array([1.0, 0.0, 1e12])))
    port = one_lane(Port(jnp.ones(1), jnp.ones(1), jnp.zeros(()), (law,)))
    place, velocity, _ = motions()
    seen = jnp.stack([place, velocity], axis=1).reshape(4, LANES)  # x, x., y, y.
    wanted = -1e12 * np.sum(np.square(place), axis=0) * np.asarray(place)
    found = jax.jit(forces_of_lanes)((port,), Now(jnp.zeros(1)), seen)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
