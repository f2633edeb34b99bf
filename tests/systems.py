"""Scenes of the tests: the limiter rotor by its dimensionless groups, and one of every effect."""

import jax.numpy as jnp
import numpy as np

from jaxrotor import (
    AnnularStator,
    BallBalancer,
    BallContact,
    Casing,
    CoaxialShaft,
    ConstantSpeed,
    Constraint,
    Coupling,
    Crack,
    CubicSpring,
    Disc,
    DiscDamping,
    ExternalDamping,
    FlexibleShaft,
    Gravity,
    HystereticDamping,
    InternalDamping,
    JournalBearing,
    Limiter,
    LinearMagneticBearing,
    LoosePedestal,
    MagneticBearing,
    MasslessShaft,
    ModalDamping,
    OldhamCoupling,
    RayleighDamping,
    RollingBearing,
    Scene,
    Seal,
    SqueezeFilm,
    Support,
    Unbalance,
)


# Base data of the sheet (section 1), from dimensions and material.
LENGTH, DIAMETER, RIM = 0.7, 0.02, 0.1
DENSITY, YOUNG = 7850.0, 2.1e11
MASS = DENSITY * np.pi * RIM**2 * 0.01  # 10 mm thick
DIAMETRAL = MASS * (2 * RIM) ** 2 / 16
RIGIDITY = YOUNG * np.pi * DIAMETER**4 / 64
TIME = np.sqrt(MASS * LENGTH**3 / RIGIDITY)  # T*
PER_LENGTH = DENSITY * np.pi * DIAMETER**2 / 4
CLAMP = (Constraint(0.0, "clamp"),)


def one_disc(*effects, mass=1.0, damping=0.1, stiffness=1.0, speed=0.8, eccentricity=0.08):
    """A mass on a round shaft: `m x.. + c x. + k x = m e Omega^2 cos Omega t + ..`."""
    return Scene(
        MasslessShaft(1.0, 0.5, stiffness),
        Disc(0.5, mass),
        DiscDamping(0.5, damping),
        Unbalance(0.5, mass, eccentricity),
        *effects,
        spin=ConstantSpeed(speed),
    )


def limiter_rotor(
    N=15.0,
    eta_e=0.025,
    eta_i=0.005,
    eta_Dxi=0.0025,
    eta_Dtheta=0.05,
    eps=0.0,
    phase=0.0,
    kappa=None,
    eta_S=0.06,
    chi=0.0075 / LENGTH,
    friction=0.1,
    sign=1.0,
    station=1.0,
    gravity=False,
    contact=True,
    blend=None,
    slip=None,
    out_of_true=None,
    **shaft,
):
    """The limiter rotor in the groups of the sheet.

    `sign` -1 reverses the gyroscopic moment; `station` is that of disc and limiters over the length;
    a group that is None is left out of the scene; `blend`, `slip` and what is `out_of_true` of the
    disc in SI units.
    """
    scale = np.sqrt(MASS * LENGTH**3 * RIGIDITY)
    at = station * LENGTH
    effects = [Disc(at, MASS, DIAMETRAL, sign * 2 * DIAMETRAL, **(out_of_true or {}))]
    if eps is not None:
        effects.append(Unbalance(at, MASS, eps * LENGTH, phase))
    if gravity:
        effects.append(Gravity(9.81, angle=-1.4))
    if eta_e is not None:
        effects.append(ExternalDamping(2 * eta_e * scale / LENGTH**4))
    if eta_Dxi is not None:
        translational, angular = eta_Dxi / LENGTH**3, eta_Dtheta / LENGTH
        effects.append(DiscDamping(at, 2 * scale * translational, 2 * scale * angular))
    if eta_i is not None:
        effects.append(InternalDamping(2 * eta_i * TIME))
    if contact:
        effects += [
            Limiter(
                at=at,
                angle=np.pi / 3 + 2 * np.pi * k / 3,
                gap=chi * LENGTH,
                stiffness=4.087e6 if kappa is None else kappa * RIGIDITY / LENGTH**3,
                damping=eta_S * np.sqrt(MASS * RIGIDITY / LENGTH**3),
                friction=friction,
                rim_radius=RIM,
                blend=blend,
                slip=slip,
            )
            for k in range(3)
        ]
    shaft = FlexibleShaft(
        LENGTH, DIAMETER, **({"polar_ratio": sign * 2.0, "constraints": CLAMP} | shaft)
    )
    return Scene(shaft, *effects, spin=ConstantSpeed(N / TIME))


def bare(*effects, N=15.0, **shaft):
    """A shaft clamped at 0, with what is named on it."""
    line = FlexibleShaft(LENGTH, DIAMETER, **({"constraints": CLAMP} | shaft))
    return Scene(line, *effects, spin=ConstantSpeed(N / TIME))


# One of every effect, all at the free end, and the parameters that make it vanish when all are zero.
EFFECTS = [
    Disc(LENGTH, 2.0, 0.01, 0.02, offset=1e-4, offset_angle=0.5, tilt=0.02, tilt_axis=0.9),
    Unbalance(LENGTH, 2.0, 2e-4, 0.3),
    Gravity(9.81, angle=-1.2),
    ExternalDamping(8.0),
    DiscDamping(LENGTH, 0.6, 0.05),
    InternalDamping(2e-4),
    RayleighDamping(4.0, 3e-5),
    ModalDamping([0.02, 0.01]),
    Limiter(LENGTH, 0.4, 0.001, 4e5, 6.0, 0.2, rim_radius=0.1),
    CubicSpring(LENGTH, 0.6, 1e9),
    AnnularStator(LENGTH, 0.001, 4e5, 6.0, 0.2, rim_radius=0.1, offset=2e-4, angle=0.4),
    JournalBearing(LENGTH, 0.02, 0.5, 0.1, 0.1, offset=1e-3, angle=0.4),
    SqueezeFilm(LENGTH, 0.02, 0.5, 0.1, 0.1, blend=0.1),
    Seal(LENGTH, 0.1, 4e4, 6.0, 0.5, 0.3, 2.0, 0.6),
    Support(
        LENGTH,
        3e4,
        9.0,
        cross_stiffness=9e3,
        cross_damping=1.8,
        angular_stiffness=500.0,
        angular_damping=0.1,
    ),
    LinearMagneticBearing(LENGTH, 40.0, 3e3, kp=300.0, kd=0.2),
]
# What turns or may have states: no constant coefficients, or no motion by whole revolutions.
TURNING = [
    RollingBearing(LENGTH, 7, 4e7, 1e-3, 0.04, 0.06, angle=0.3),
    MagneticBearing(LENGTH, 3.0, 2.0, 0.1, kp=400.0, kd=1.0),
    Crack(LENGTH, 3e4, 1e4, angle=0.3),
    Coupling(LENGTH, 3e4, 0.2, 0.3, 1e-3, 0.6, angular_stiffness=500.0, tilt=0.01),
    OldhamCoupling(LENGTH, 2.0, 1e-3, 0.6, 0.3),
]
HARMONIC = [HystereticDamping(0.01)]  # known for harmonic motions only
ROLLING = [
    BallBalancer(LENGTH, 0.05, 0.06, 3.5, in_use=2.0, ball_radius=0.02, places=3),
    BallContact(1e5, 8.0),
]
BESIDE = [
    Casing("pedestal", 3.0),
    LoosePedestal("block", 3.0, 3e4, 9.0, 2e4),
    CoaxialShaft(FlexibleShaft(0.4, 0.04), 1.3, start=0.2, name="outer"),
]  # a mass or a shaft beside the shaft, which a support has to hold
STRENGTHS = {
    "casing": (),  # its supports, see tests/effects/test_casing.py
    "loose_pedestal": (),
    "coaxial_shaft": (),
    "disc": ("mass", "diametral", "polar"),
    "unbalance": ("eccentricity",),
    "gravity": ("acceleration",),
    "external_damping": ("per_length",),
    "disc_damping": ("translational", "angular"),
    "internal_damping": ("voigt_time",),
    "rayleigh_damping": ("mass", "stiffness"),
    "modal_damping": ("ratios",),
    "limiter": ("stiffness", "damping"),
    "cubic_spring": ("stiffness",),
    "annular_stator": ("stiffness", "damping"),
    "journal_bearing": ("viscosity",),
    "squeeze_film": ("viscosity",),
    "seal": ("stiffness", "damping", "inertia"),
    "rolling_bearing": ("stiffness",),
    "crack": ("loss", "loss_across"),
    "coupling": ("stiffness", "angular_stiffness"),
    "oldham_coupling": ("mass",),
    "magnetic_bearing": ("constant",),
    "linear_magnetic_bearing": ("current_factor", "position_factor"),
    "support": (
        "stiffness",
        "damping",
        "cross_stiffness",
        "cross_damping",
        "angular_stiffness",
        "angular_damping",
    ),
    "hysteretic_damping": ("loss_factor",),
    "ball_balancer": ("in_use",),
    "ball_contact": ("stiffness", "damping"),
}


def slowest(values, count):
    """The `count` values of least magnitude, as numpy, sorted by magnitude."""
    values = np.asarray(values)
    return values[np.argsort(np.abs(values))][:count]


def leaf_values(scene, paths=None):
    """Values of the paths that are present, as a dict of scalar (or stacked) arrays."""
    found = {}
    for path in scene.paths() if paths is None else paths:
        try:
            found[path] = jnp.asarray(scene.get(path))
        except ValueError:  # absent: None
            continue
    return found
