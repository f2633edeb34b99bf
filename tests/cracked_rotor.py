"""A mass on a cracked shaft, dimensionless, for tests in time, of orbits and by harmonic balance."""

import jax.numpy as jnp

import jaxrotor as jr


LOSS, ACROSS, RATIO = 0.3, 0.05, 0.01


def crack(breathing="mayes", **values):
    """A crack that opens below; without a loss across it if it opens by the response."""
    given = {"loss": LOSS} | ({} if breathing == "response" else {"loss_across": ACROSS})
    return jr.Crack(0.5, breathing=breathing, **(given | values))


def machine(speed, breathing="mayes", eccentricity=0.0, phase=0.0, damping=2 * RATIO, **values):
    """`z.. + 2 zeta z. = F - i + e s^2 e^(i (theta + beta))`."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1.0),
        jr.Disc(0.5, 1.0),
        jr.DiscDamping(0.5, damping),
        jr.Gravity(1.0),
        *([jr.Unbalance(0.5, 1.0, eccentricity, phase)] if eccentricity else []),
        crack(breathing, **values),
        spin=jr.ConstantSpeed(speed),
    )


def rest():
    """Start at the static deflection of the intact shaft."""
    return jr.Launch(jr.Continued(jnp.array([-1j]), jnp.array([0j])))
