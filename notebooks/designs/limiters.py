"""Limiters between which no backward whirl survives.

A stop that rubs drives the rotor backward. In a deep backward whirl of rate `w` and radius `r` friction
feeds it, and the stop's damper takes (a flat stop, pressed half of the time)

    P_friction = f k w r^2 / 4,    P_damper = c w^2 r^2 / 4,    so it dies out where  c w > f k,

and a backward rub that bounces among `n` hard flat stops comes back the same if their restitution is

    e* = (tan(pi / n) - f) / (tan(pi / n) + f),

less than which it dies: 0.89 for three stops, 0.71 for six (f = 0.1, no loss in flight). Both are estimates:
the rotor bends, is unbalanced, and is damped by other things too. The design goes by the motion itself:

    minimise  c / (100 N s/m) - gap / (1 mm)      over stiffness k, damping c and gap of the stops
    such that W = Int h(t) Re(conj(z.) F) dt <= -0.6 E     released into the violent whip,
              W <= -0.4 E                                  released into the backward rub,
              radius <= 10 mm                              touching in forward whirl, most unbalanced.

`W` is the work of the stops on the rotor over four revolutions after the release, weighed by
`h = cos^2(pi t / 2 T)`, mean over angles and eccentricities, `E` the kinetic energy of the disc at release.
The work of a short window is smooth where its end state is not: a bounce that comes a little later has done
almost the same work, but leaves in another direction.

Friction is given. Turning all stops together changes nothing without weight, and their number is no gradient's
business: it is compared. What is designed is then verified by an ensemble of long motions, which the design
has never seen.

    python notebooks/designs/limiters.py
"""

import jax
import jax.numpy as jnp
import numpy as np

import jaxrotor as jr
from jaxrotor import observe, plot


BASE = jr.load("limiter-rotor")
LENGTH, TIME = 0.7, 0.0226465597  # l [m] and T* [s] of its source
MOST = 0.00143 * LENGTH  # eccentricity [m]
STARTS = {  # radius [m] and rate [rad/s] of release; the names say what they become in the scene as it is
    "at rest": (1e-3 * LENGTH, 0.0),
    "backward rub": (0.012 * LENGTH, -10.0 / TIME),
    "violent whip": (0.1 * LENGTH, -18.0 / TIME),
}
PEAK = 0.010  # bound of the radius [m]
STEPS = 128  # a revolution, of the design; the ensemble takes 256
WHERE = {
    "limiters.stiffness": (2e5, 8e6),
    "limiters.damping": (5.0, 2e3),
    "limiters.gap": (5e-3, 9e-3),
}


def rotor(number=3, blend=None):
    """The rotor between so many equal stops; `blend` [m] smooths their onset for the design."""
    first = BASE.of(jr.Limiter)[0]
    others = [effect for effect in BASE.effects if not isinstance(effect, jr.Limiter)]
    same = ("at", "gap", "stiffness", "damping", "friction", "rim_radius")
    stops = [
        jr.Limiter(
            **{name: getattr(first, name) for name in same},
            angle=np.pi / 3 + 2 * np.pi * k / number,
            blend=blend,
        )
        for k in range(number)
    ]
    return jr.Scene(BASE.shaft, *others, *stops, spin=BASE.spin)


# === what the design goes by


def released(scene, name, objective):
    """Mean of an objective of the motion from a start, over angles and eccentricities."""
    radius, rate = STARTS[name]
    angles, eccentricities = np.meshgrid(np.arange(4) * np.pi / 6, [0.0, MOST])

    def one(case):
        angle, eccentricity = case
        moved = scene.put({"unbalance.eccentricity": eccentricity})
        return objective(moved, jr.Whirl(radius, rate, angle))

    return jnp.mean(jax.lax.map(one, (jnp.ravel(angles), jnp.ravel(eccentricities))))


def work(scene, name, revolutions=4):
    """Work of the stops from a start, over the kinetic energy of the disc there."""
    radius, rate = STARTS[name]
    energy = 0.5 * scene.get("disc.mass") * (radius * rate) ** 2
    run = lambda moved, start: jr.objectives.contact_work(
        moved, revolutions, start=start, steps_per_revolution=STEPS
    )
    return released(scene, name, run) / energy


def radius(scene, revolutions=8):
    """Largest radius [m], a mean by the 16th power over angles, touching in forward whirl."""
    unbalanced = scene.put({"unbalance.eccentricity": MOST})
    gap = scene.get("limiters.gap")[0]

    def one(angle):
        start = jr.Whirl(gap, 1.74 / TIME, angle)
        run = jr.simulate(unbalanced, revolutions, STEPS, start=start)
        return jnp.max(jnp.abs(run.displacement))

    return jr.objectives.peak(jax.lax.map(one, jnp.arange(4) * np.pi / 2), 16)


CONSTRAINTS = (
    ("whip", lambda scene: work(scene, "violent whip") + 0.6),
    ("rub", lambda scene: work(scene, "backward rub") + 0.4),
    ("radius", lambda scene: (radius(scene) - PEAK) / 1e-3),
)


def cost(scene):
    """Dampers cost, clearance is worth something."""
    return scene.get("limiters.damping")[0] / 100.0 - scene.get("limiters.gap")[0] / 1e-3


def design(number=3, quick=False):
    """Stops by gradient, a `jr.Tuned`."""
    return jr.tune(
        cost,
        rotor(number, blend=2e-4),
        WHERE,
        constraints=CONSTRAINTS,
        steps=60 if quick else 200,
        tolerance=1e-5,
        progress=False,
    )


if __name__=="__main__":
    import time
    t=time.time()
    tuned=design()
    print(tuned, time.time()-t)
