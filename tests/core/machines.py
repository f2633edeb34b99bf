"""Machines of published orders of magnitude, from rotors of a few millimetres to hydro generators."""

import math

import jaxrotor as jr


STEEL = jr.Material(2.1e11, 7850.0)


def machine(length, diameter, mass, radius, speed, eccentricity, *effects, stiffness, **shaft):
    """A disc at the middle of a shaft in two equal bearings, with an unbalance of its own mass."""
    material = shaft.pop("material", STEEL)
    held = [jr.Support(at, **stiffness) for at in (0.0, length)]
    return jr.Scene(
        jr.FlexibleShaft(length, diameter, material, constraints=(), **shaft),
        jr.Disc(length / 2, mass, mass * radius**2 / 4, mass * radius**2 / 2),
        jr.Unbalance(length / 2, mass, eccentricity),
        *held,
        *effects,
        spin=jr.ConstantSpeed(speed),
    )


def tabled(speeds, stiffness):
    """Coefficients of a bearing over speed."""
    table = [stiffness * (1 + 0.1 * i) for i in range(len(speeds))]
    return {"kxx": table, "kyy": table, "speeds": speeds}


def equal(stiffness, damping):
    """Coefficients of a round bearing."""
    return {"stiffness": stiffness, "damping": damping}


# Length, diameter, mass and radius of the disc, speed, eccentricity of its centre of mass.
MACHINES = {
    "hydro generator, 100 rpm": lambda: machine(
        *(9.0, 2.2, 1e6, 6.5, 10.5, 5e-4), jr.Limiter(4.5, 0.0, 0.02, 1e9), stiffness=equal(2e9, 1e7)
    ),
    "steam turbine, 3000 rpm": lambda: machine(
        *(8.0, 0.6, 4e4, 0.9, 314.16, 2e-5),
        jr.JournalBearing(8.0, 0.02, 0.25, 0.25, 4e-4),
        jr.AnnularStator(4.0, 1e-3, 1e8, rim_radius=0.9),
        stiffness=tabled([100.0, 200.0, 400.0], 1e9),
    ),
    "centrifugal compressor, 10 000 rpm": lambda: machine(
        *(1.6, 0.12, 120.0, 0.25, 1047.0, 3e-6),
        jr.SqueezeFilm(0.0, 0.01, 0.065, 0.03, 1e-4),
        stiffness=tabled([300.0, 1500.0], 1e8),
    ),
    "fan, 1500 rpm, with a trial weight": lambda: machine(
        *(0.9, 0.05, 30.0, 0.3, 157.0, 5e-5),
        jr.Unbalance(0.45, 0.03, 0.25),
        stiffness={"kxx": 8e7, "kyy": 4e7, "cxx": 5e3, "cyy": 5e3},
    ),
    "turbocharger, 150 000 rpm": lambda: machine(
        *(0.12, 0.008, 0.15, 0.028, 15708.0, 2e-6),
        jr.JournalBearing(0.03, 0.008, 0.004, 0.006, 2e-5),
        stiffness=equal(5e6, 50.0),
    ),
    "gas-bearing spindle, 200 000 rpm": lambda: machine(
        *(0.12, 0.025, 0.05, 0.015, 20944.0, 5e-8),
        jr.JournalBearing(0.02, 1.8e-5, 0.0125, 0.025, 8e-6),
        stiffness=equal(5e6, 20.0),
    ),
    "dental drill, 400 000 rpm": lambda: machine(
        *(0.012, 0.0015, 3e-4, 0.003, 41888.0, 2e-6), stiffness=equal(2e5, 0.3)
    ),
    "micro turbine of silicon, 1.2 million rpm": lambda: machine(
        *(0.0015, 0.0008, 5e-6, 0.002, 1.26e5, 5e-8),
        jr.JournalBearing(0.0, 1.8e-5, 0.0004, 0.0003, 3e-6),
        stiffness=equal(3e4, 0.02),
        material=jr.Material(1.6e11, 2330.0),
    ),
    "electric motor, 2 poles": lambda: machine(
        *(0.6, 0.06, 35.0, 0.09, 314.0, 1e-5),
        jr.Limiter(0.3, 0.0, 4e-4, 1e8),
        jr.Gravity(),
        stiffness=equal(1e8, 500.0),
    ),
    "vertical line shaft of a pump": lambda: machine(
        *(12.0, 0.04, 15.0, 0.12, 155.0, 1e-4),
        *(jr.Support(at, 2e7) for at in (3.0, 6.0, 9.0)),
        stiffness=equal(1e7, 1e3),
    ),
    "train of turbines on seven bearings": lambda: machine(
        *(42.0, 0.6, 4e4, 0.7, 314.16, 2e-5),
        *(jr.Disc(at, 4e4, polar=1e4) for at in (3.0, 10.0, 17.0, 25.0, 32.0, 39.0)),
        *(jr.Support(at, kxx=1e9) for at in (7.0, 14.0, 20.0, 28.0, 35.0)),
        stiffness=equal(1e9, 1e6),
    ),
    "pump with a seal between its bearings": lambda: machine(
        *(1.2, 0.08, 40.0, 0.15, 310.0, 2e-5), jr.Support(0.7, 8e4), stiffness=equal(1e8, 1e4)
    ),
    "rotor whose weight is on one bearing": lambda: jr.Scene(
        jr.FlexibleShaft(0.4, 0.04, STEEL, constraints=()),
        jr.Disc(0.03, 20.0, polar=0.2),
        jr.Support(0.02, 1e8),
        jr.Support(0.4, 1e5),
        spin=jr.ConstantSpeed(300.0),
    ),
    "laboratory rotor": lambda: machine(
        *(0.56, 0.01, 0.8, 0.0375, 300.0, 1e-4),
        jr.Limiter(0.28, 1.0, 1e-3, 1e6, rim_radius=0.0375, blend=1e-5),
        stiffness=equal(1e6, 10.0),
    ),
    "rotor of a flywheel of carbon fibre": lambda: machine(
        *(0.5, 0.1, 60.0, 0.35, 1900.0, 1e-6),
        stiffness=equal(5e6, 2e3),
        material=jr.Material(1.4e11, 1600.0),
    ),
    "drum of a washing machine on springs, 1400 rpm": lambda: machine(
        *(0.3, 0.035, 8.0, 0.35, 147.0, 1e-3), jr.Unbalance(0.3, 1.0, 0.25), stiffness=equal(6e3, 150.0)
    ),
    "drum of a washing machine in a tub, 1200 rpm": lambda: machine(
        *(0.25, 0.03, 12.0, 0.3, 126.0, 1e-3),
        jr.Unbalance(0.25, 2.0, 0.2),
        jr.Casing("tub", 25.0),
        jr.Support(of="tub", stiffness=1e4, damping=200.0),
        stiffness={"stiffness": 5e7, "on": "tub"},
    ),
    "centrifuge on soft mounts, 3000 rpm": lambda: machine(
        *(0.5, 0.04, 30.0, 0.28, 314.0, 3e-4), stiffness=equal(5e3, 100.0)
    ),
    "exciter of a screen, 1000 rpm": lambda: machine(
        *(0.6, 0.09, 60.0, 0.2, 105.0, 0.1), stiffness={"stiffness": 5e8}
    ),
    "exciter on both ends of a shaft, 960 rpm": lambda: machine(
        *(0.4, 0.06, 12.0, 0.115, 100.0, 0.0),
        *(jr.Unbalance(at, moment=0.72) for at in (0.0, 0.4)),
        stiffness={"stiffness": 2e8},
    ),
    "string of drill pipes, 120 rpm": lambda: machine(
        *(2000.0, 0.127, 500.0, 0.1, 12.6, 0.01),
        jr.Limiter(1900.0, 0.0, 0.045, 1e8),
        stiffness={"stiffness": 1e8},
        inner_diameter=0.109,
    ),
    "balls in a race": lambda: jr.Scene(
        jr.RigidShaft(0.4),
        jr.Disc(0.2, 20.0, 0.2, 0.3),
        jr.Unbalance(0.2, 20.0, 1e-4),
        jr.BallBalancer(0.2, 0.05, 0.09, 0.02, ball_radius=0.011),
        *(jr.Support(at, 5e5) for at in (0.0, 0.4)),
        spin=jr.ConstantSpeed(200.0),
    ),
    "dimensionless": lambda: jr.Scene(
        jr.FlexibleShaft(1.0, 1.0, jr.Material(1.0, 1.0), constraints=()),
        jr.Disc(1.0, 1.0, 1.0, 2.0),
        jr.Unbalance(1.0, 3.0, 2.0),
        jr.Limiter(1.0, 0.0, 3.0, 100.0, rim_radius=2.0),
        jr.JournalBearing(0.0, 1.0, 1.0, 1.0, 1.0),
        jr.Support(0.0, 1.0),
        jr.Support(1.0, 0.01),
        spin=jr.ConstantSpeed(math.pi),
    ),
}  # fmt: skip
