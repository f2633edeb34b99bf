"""Objectives of contact where they are not smooth: what their docstrings say of either side.

A mass of 1 kg on a round shaft and one flat stop: `m x.. + c x. + k x = m e Omega^2 cos Omega t - F`.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import one_disc

import jaxrotor as jr
from jaxrotor import objectives


TURN = 2 * np.pi
SPEED, DAMPING, GAP, STIFFNESS = 1.3, 0.1, 0.3, 20.0
ECCENTRICITY = "unbalance.eccentricity"
# Named, since inside a compiled function a dense basis would be taken, of a program half as long again.
MODAL = jr.Exponential(4, "modal", located=True)


def mass(eccentricity):
    """Above its resonance, so that a stop feeds what touches it."""
    stop = jr.Limiter(0.5, 0.0, gap=GAP, stiffness=STIFFNESS)
    return one_disc(stop, damping=DAMPING, speed=SPEED, eccentricity=eccentricity)


# At this eccentricity [m] the mass just touches, on a circle of the gap.
GRAZING = GAP * abs(1 - SPEED**2 + 1j * DAMPING * SPEED) / SPEED**2
SCENE = mass(GRAZING)


@pytest.fixture(scope="module")
def radius():
    """Root mean square of a periodic rub [m] and its slope by eccentricity, by damping and start too."""

    @jax.jit
    def both(eccentricity, damping, q, velocity):
        near = jr.Continued(q, velocity)
        how = {"revolutions": 1, "steps_per_revolution": 64, "solver": MODAL}
        of = lambda e: (
            objectives.rub(
                SCENE.put({ECCENTRICITY: e, "limiters.damping": damping}), near, **how
            ).radius
        )
        return jax.jvp(of, (eccentricity,), (jnp.ones(()),))

    def at(eccentricity, damping, start):
        # Plain floats alike: of a number from numpy jax would compile another program.
        values = jnp.asarray(float(eccentricity)), jnp.asarray(float(damping))
        return tuple(map(float, both(*values, start.q, start.velocity)))

    return at


@pytest.fixture(scope="module")
def circle():
    return jr.periodic(mass(0.9 * GRAZING), jr.AtRest(), steps_per_revolution=64)


@pytest.mark.long
def test_a_rub_that_just_touches_has_the_slope_of_its_stop(radius, circle):
    """Before it `R = e GAP / GRAZING`. After it an elastic stop adds `sqrt(e - e*)`, a damped one a kink.

    It acts while it closes, by an impulse `c d` of the depth `d`; with the response `g` of the mass to
    impulses once a turn, at their moments, and `H(Omega)` its receptance,

        d = d0 / (1 + c g),   dR = d0 - c d Re H / T.

    Where `1 + c g < 0` the orbit ends there.
    """
    start = dataclasses.replace(
        circle.start, q=circle.start.q / 0.9, velocity=circle.start.velocity / 0.9
    )
    at = lambda beyond, damping: radius(GRAZING + beyond, damping, start)
    period = TURN / SPEED
    own = np.sqrt(1 - DAMPING**2 / 4)
    turn = np.exp((-DAMPING / 2 + 1j * own) * period)
    again = (turn / (1 - turn)).imag / own
    receptance = (1 / (1 - SPEED**2 + 1j * DAMPING * SPEED)).real
    before = GAP / GRAZING
    for damping in (0.0, 0.2, 1.0):
        kink = -damping / (1 + damping * again) * receptance / period
        assert at(-1e-7, damping)[1] == pytest.approx(before, rel=1e-9)
        near, far = (at(beyond, damping)[1] for beyond in (1e-8, 4e-8))
        assert far - before * (1 + kink) > near - before * (1 + kink) > 0
        assert 2 * near - far == pytest.approx(before * (1 + kink), rel=1e-3)
    assert 1 + 2.0 * again < 0 and np.isfinite(at(-1e-7, 2.0)).all()
    assert np.isnan(at(1e-7, 2.0)).all()


@pytest.mark.slow
def test_a_rub_that_is_born_has_a_slope_without_bound(radius, circle):
    """At a fold: as one over the root of the distance; beyond it there is no number."""
    branch = jr.continue_(
        dataclasses.replace(circle, scene=SCENE.replace({ECCENTRICITY: 0.9 * GRAZING})),
        ECCENTRICITY,
        (0.03, 0.14),
        max_step=0.1,
    )
    fold = min(branch.of("fold"), key=lambda point: point.value)
    born = branch.orbit(int(fold.place) + 3)
    assert bool(born.stable)
    beyond = np.array([4e-6, 8e-6, 1.6e-5])
    steep = np.array([radius(fold.value + far, 0.0, born.start)[1] for far in beyond]) ** -2.0
    first, second = np.diff(steep) / np.diff(beyond)
    assert second == pytest.approx(first, rel=0.03)
    assert steep[0] / first == pytest.approx(beyond[0], rel=0.03)  # so it is zero at the fold
    assert np.isnan(radius(fold.value - 1e-5, 0.0, born.start)).all()


@pytest.mark.slow
def test_a_contact_that_begins_at_a_sample_has_a_kink_or_jumps():
    """The mass let go from x0 = 1 m against a stop at its free swing: see `contact_peak`."""
    scene = mass(0.0)
    start, how = jr.Whirl(1.0, angle=np.pi), {"steps_per_revolution": 64}
    free = jr.simulate(scene.without("limiters"), 1, start=start, **how)
    gap = float(jnp.max(free.displacement.real))  # at a sample, where the stop would be met
    at = int(jnp.argmax(free.displacement.real))
    names = ("limiters.gap", "limiters.damping", "limiters.stiffness")

    @jax.jit
    def both(gap, *others):
        values = lambda gap: dict(zip(names, (gap, *others), strict=True))
        of = lambda gap: objectives.contact_peak(scene.put(values(gap)), 1, start=start, **how)
        return jax.jvp(of, (gap,), (jnp.ones(()),))

    soft = lambda gap: both(jnp.asarray(gap), jnp.asarray(0.0), jnp.asarray(1e-3))
    value, slope = (lambda gap, i=i: float(soft(gap)[i]) for i in (0, 1))
    assert value(gap + 1e-9) == slope(gap + 1e-9) == 0.0
    assert slope(gap - 1e-9) == pytest.approx(-1e-3, rel=1e-3)
    assert (value(gap - 1e-6) - value(gap)) / -1e-6 == pytest.approx(-1e-3, rel=1e-3)
    # a stop that only damps, met while the mass closes: a jump from one sample's `c v` to the next's
    weak = lambda gap: both(jnp.asarray(gap), jnp.asarray(1e-3), jnp.asarray(1e-12))[0]
    early, closing = (
        np.asarray(seen[at - 4 : at - 2, 0].real) for seen in (free.displacement, free.velocity)
    )
    assert closing[0] > 1.2 * closing[1] > 0
    met, missed = float(weak(early[0] - 1e-5)), float(weak(early[0] + 1e-5))
    assert (met, missed) == pytest.approx(tuple(1e-3 * closing), rel=1e-3)
