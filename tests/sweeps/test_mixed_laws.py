"""Lanes of located steps with laws that change their branches beside laws that do not."""

import numpy as np
import pytest

import jaxrotor as jr


ECCENTRICITIES = [1e-4, 1.5e-4, 2e-4]
LOCATED = jr.Exponential(4, located=True)


def rotor(eccentricity=1e-4):
    return jr.Scene(
        jr.MasslessShaft(length=1.0, at=0.5, k11=1e5),
        jr.Disc(at=0.5, mass=10.0),
        jr.Unbalance(at=0.5, mass=10.0, eccentricity=eccentricity),
        jr.DiscDamping(at=0.5, translational=100.0),
        jr.Limiter(
            at=0.5, angle=0, gap=2e-4, stiffness=1e6, damping=50, friction=0.2, rim_radius=0.05
        ),
        jr.CubicSpring(at=0.5, stiffness=1e10, angle=0.3),
        spin=jr.ConstantSpeed(90.0),
    )


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3])
def test_located_lanes_are_motions(count):
    """A stop and a spring at one station, by whole revolutions and along times."""
    lanes, times = ECCENTRICITIES[:count], np.linspace(0.0, 0.25, 65)
    over = {"unbalance.eccentricity": lanes}
    settings = {"solver": LOCATED, "steps_per_revolution": 64, "error_sample": 0}
    turns = jr.sweep(rotor(), over, settle=0, keep=4, observe=[jr.observe.Section()], **settings)
    runs = jr.sweep(rotor(), over, times=times, **settings)
    steps = runs.attrs["steps_per_sample"]
    for lane, eccentricity in enumerate(lanes):
        alone = rotor(eccentricity)
        motion = jr.simulate(alone, revolutions=4, steps_per_revolution=64, solver=LOCATED)
        z = np.asarray(motion.displacement)[64::64].reshape(-1)
        np.testing.assert_allclose(turns.section[lane], np.stack([z.real, z.imag], 1), atol=1e-14)
        run = jr.run_up(alone, times, solver=LOCATED, substeps=steps)
        force = np.abs(run.contact_force).max(0)
        assert force.min() > 0
        assert float(runs.peak[lane]) == pytest.approx(np.abs(run.displacement).max(), rel=1e-9)
        np.testing.assert_allclose(runs.peak_force[lane], force, rtol=1e-6)
