"""Machines of two shafts, of flexible and of rigid ones, with numbers from two other computations."""

import jax.numpy as jnp

import jaxrotor as jr


STEEL = jr.Material(210e9, 7850.0, 210e9 / 2 / 1.296)
DISCS = {("lp", 0.2705): 0.02, ("lp", 0.7185): 0.02, ("hp", 0.4505): 0.034, ("hp", 0.5925): 0.034}
MASSES = {"lp": 5.743047355257, "hp": 5.67313199615}

# By transfer matrices of the continuous beams, of 40 digits, at 250 rad/s of lp
ROOTS = {  # by ratio, and whether hp stands on a casing
    (1.3, False): [
        -0.0906192037 - 74.73935647j,
        -0.1738504283 + 94.08310500j,
        -2.207495491 - 241.5020715j,
        -2.410639110 + 248.7345076j,
        -13.85501487 - 404.7975224j,
        -11.54582510 + 419.1905027j,
    ],
    (1.0, False): [
        -0.0915749981 - 76.12769787j,
        -0.1668950903 + 92.66232102j,
        -2.236085791 - 242.1433195j,
        -2.375250977 + 248.2936731j,
        -13.41503040 - 406.5416945j,
        -11.69536471 + 418.4025618j,
    ],
    (-1.2, False): [
        -0.1356484841 + 81.69535298j,
        -0.1115910199 - 86.11654500j,
        -2.136954727 + 244.4150048j,
        -2.482017153 - 246.0800375j,
        -13.89406179 + 408.8868369j,
        -11.66576427 - 414.3941339j,
    ],
    (1.3, True): [
        -0.1758185987 + 93.93854523j,
        -2.489452896 + 246.8110867j,
        -11.45884870 + 387.3019101j,
    ],
}
# Forward of the shaft, and speeds of it, by ratio, speed of its own and shaft
CRITICAL = {
    (1.3, None, "lp"): [87.77203494, 248.6158578, 421.9611807, 1588.592685],
    (1.3, None, "hp"): [86.95535621, 247.9231164, 420.2856415, 1233.950840],
    (1.0, None, "hp"): [87.24897811, 248.1742442, 420.8506533, 1234.798364],
    (-1.2, None, "lp"): [83.54743011, 244.3591520, 402.7316089, 518.2743305],
    (-1.2, None, "hp"): [-84.93598233, -245.9082553, -413.7330013, -562.654798],
    (1.3, 100.0, "lp"): [89.74945614, 249.1807177, 422.7325272],
    (1.3, 100.0, "hp"): [85.82131390, 247.5707972],
    (0.0, 700.0, "lp"): [98.50169884, 250.5804988, 423.0876728],
    (0.0, 250.0, "hp"): [740.538591],
    (0.0, 600.0, "hp"): [-385.191244],
}


def dual_rotor(ratio=1.3, speed=None, *more, first=250.0, joint=6e5, cased=False, nodes=6):
    """Two Timoshenko shafts; the outer one stands on a bearing and on the inner one by another."""
    lp = jr.FlexibleShaft(0.962, 0.020, shear=True, nodes=nodes, material=STEEL)
    hp = jr.FlexibleShaft(
        0.382, 0.034, inner_diameter=0.028, shear=True, nodes=nodes, material=STEEL
    )
    parts = [jr.Disc.from_dimensions(at, 0.25, 0.015, bore=bore) for at, bore in DISCS.items()]
    parts += [jr.Unbalance(at, mass=MASSES[at[0]], eccentricity=97.9e-6) for at in DISCS]
    parts += [
        jr.Support(at=("lp", 0.0), kxx=5e5, cxx=150.0),
        jr.Support(at=("lp", 0.962), kxx=6e5, cxx=150.0),
        jr.Support(at=("hp", 0.3), kxx=8e5, cxx=250.0, on="case" if cased else None),
    ]
    if cased:
        parts += [jr.Casing("case", 20.0), jr.Support(of="case", kxx=4e6, cxx=800.0)]
    if joint is not None:
        parts.append(jr.Support(at=("hp", 0.682), on="lp", kxx=joint, cxx=60.0))
    shafts = {"lp": lp, "hp": jr.CoaxialShaft(hp, ratio=ratio, speed=speed, start=0.3)}
    return jr.Scene(shafts, *parts, *more, spin=jr.ConstantSpeed(first))


def toy(
    ratio=1.3, speed=None, *more, k12=0.8, c12=0.02, damping=(0.01, 0.02), spin=None, cased=False
):
    """Two rigid shafts of one coordinate each, hinged at one end, with all parts at the other one."""
    hinged = lambda: jr.RigidShaft(1.0, constraints=[jr.Constraint(at=0.0, holds="pin")])
    values = [
        ("lp", 1.0, 0.2, 1.0, 0.04, 0.05, 0.0),
        ("hp", 0.6, 0.18, 2.0, 0.03, 0.03, 0.7),
    ]
    parts = []
    for (name, inertia, polar, k, c, moment, phase), d in zip(values, damping, strict=True):
        at = (name, 1.0)
        parts += [
            jr.Disc(at, mass=inertia - polar / 2, diametral=polar / 2, polar=polar),
            jr.Support(at, kxx=k, cxx=c),
            jr.Support(at, kxx=0.0, cxx=d, rotating=True),
            jr.Unbalance(at, moment=moment, phase=phase),
        ]
    parts.append(jr.Support(at=("lp", 1.0), on="hp", kxx=k12, cxx=c12))
    if cased:
        parts += [jr.Casing("case", 2.0), jr.Support(of="case", kxx=8.0, cxx=0.1)]
    shafts = {"lp": hinged(), "hp": jr.CoaxialShaft(hinged(), ratio=ratio, speed=speed)}
    spin = jr.ConstantSpeed(1.4) if spin is None else spin
    return jr.Scene(shafts, *parts, *more, spin=spin)


def launched(*casings: complex) -> jr.Continued:
    """The toy's start of all motions with numbers, at rest."""
    q = jnp.array([0.05, -0.03j, *casings])
    return jr.Continued(q, 0 * q)
