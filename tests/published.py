"""Rotors of the published sheets that several files of tests share, and numbers of theirs."""

import jax.numpy as jnp

import jaxrotor as jr


MU, DELTA, KAPPA = 0.2, 0.1, 0.16


def dual(scheme, p=1.0, *, alpha=1.0, nu=None, mu=MU, kappa=KAPPA, delta=DELTA, phase=0.0, more=()):
    """The sheet's schemes with unit mass, stiffness, eccentricity and weight (along +x)."""
    ends, supports = "rigid", []
    if scheme != 1:
        ends = "elastic"
        options = {"anisotropy": nu, "rotating": scheme == 3}
        supports = [jr.Support(at, 1 / alpha, damping=kappa, **options) for at in (0.0, 1.0)]
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1.0, anisotropy=mu, damping=kappa, ends=ends),
        jr.Disc(0.5, 1.0),
        jr.DiscDamping(0.5, delta),
        *supports,
        jr.Unbalance(0.5, 1.0, 1.0, phase),
        jr.Gravity(1.0, angle=0.0),
        *more,
        spin=jr.ConstantSpeed(p),
    )


POLAR = 2.38e-4

NAMES = {"CAN": "gyroscopic-cantilever", "PIN": "gyroscopic-propped"}

SHIPPED = {name: jr.load(scene) for name, scene in NAMES.items()}


def rotor(name, speed=0.0, polar=POLAR, eta=None, **stiffness):
    values = {"disc.polar": polar, "spin.speed": speed}
    values |= {f"shaft.{key}": value for key, value in stiffness.items()}
    if eta is not None:
        values["hysteretic_damping.loss_factor"] = eta
    return SHIPPED[name].put({key: jnp.asarray(value, float) for key, value in values.items()})


ONSET = [  # eta_i, right sign (N_crit, omega), reversed sign [R]
    (0.0025, (24.6932795, 1.8284168), (26.2647983, 1.3430319)),
    (0.005, (13.9041252, 1.7323570), (14.2586142, 1.4602310)),
    (0.01, (7.9154968, 1.6764461), (7.9430751, 1.5225309)),
    (0.02, (4.7974027, 1.6467404), (4.7595744, 1.5538594)),
    (0.05, (2.8950645, 1.6284482), (2.8524383, 1.5725612)),
]
