"""Rotor files written by ROSS, and results of ROSS for them. Run by hand, not by the tests.

    pip install "ross-rotordynamics==2.3.0" "plotly<6"
    python tests/files/ross/reference.py

writes `example.toml`, `stepped.json`, `housed.json` and `roots.json`: eigenvalues [rad/s] of lateral
motion of the same rotors, with every shaft element cut into 1 (as in the files), 12 and 24 pieces, from
which the limit of a fine mesh is extrapolated.
"""

import json
import warnings
from pathlib import Path

import numpy as np
import scipy.linalg


warnings.simplefilter("ignore")
import ross  # noqa: E402


HERE = Path(__file__).parent
SPEEDS = {"example": (0.0, 400.0, 1200.0), "stepped": (0.0, 500.0), "housed": (0.0, 500.0)}
CUTS = (1, 12, 24)
COUNT = 12


def example(cut):
    """Rotor of `ross.rotor_example`: six equal elements, two discs, kxx != kyy."""
    rotor = ross.rotor_example()
    shaft = [
        ross.ShaftElement(
            L=0.25 / cut, idl=0, odl=0.05, material=rotor.shaft_elements[0].material, n=i
        )
        for i in range(6 * cut)
    ]
    own = rotor.disk_elements
    discs = [ross.DiskElement(n=d.n * cut, m=d.m, Id=d.Id, Ip=d.Ip, tag=d.tag) for d in own]
    bearings = [
        ross.BearingElement(n=n * cut, kxx=1e6, kyy=8e5, cxx=0, tag=f"Bearing {i}")
        for i, n in enumerate((0, 6))
    ]
    return ross.Rotor(shaft, discs, bearings)


# length, inner and outer diameter [m], material
STEPS = (
    (0.08, 0.0, 0.03, "steel"),
    (0.12, 0.0, 0.03, "steel"),
    (0.10, 0.0, 0.05, "steel"),
    (0.15, 0.02, 0.06, "bronze"),
    (0.15, 0.02, 0.06, "bronze"),
    (0.10, 0.0, 0.04, "steel"),
    (0.10, 0.0, 0.03, "steel"),
)


def stepped(cut):
    """Stepped hollow rotor of two materials, an overhung disc, and bearings with full matrices."""
    made = {
        "steel": ross.Material("steel", rho=7850, E=2.1e11, G_s=8.1e10),
        "bronze": ross.Material("bronze", rho=8800, E=1.1e11, G_s=4.1e10),
    }
    shaft = [
        ross.ShaftElement(L=length / cut, idl=bore, odl=width, material=made[of])
        for length, bore, width, of in STEPS
        for _ in range(cut)
    ]
    discs = [
        ross.DiskElement(n=0, m=3.0, Id=0.008, Ip=0.015, tag="overhung"),
        ross.DiskElement(n=4 * cut, m=9.0, Id=0.03, Ip=0.055, tag="middle"),
    ]
    at = [
        0.0,
        700.0,
        1400.0,
    ]  # for four or more ROSS uses a smoothing spline, which does not interpolate
    bearings = [
        ross.BearingElement(
            n=cut, kxx=3e7, kyy=5e7, kxy=4e6, kyx=-6e6, cxx=4e3, cyy=6e3, cxy=-500, cyx=-300,
            tag="front",
        ),
        ross.BearingElement(
            n=7 * cut, kxx=[2e7, 2.8e7, 3e7], kyy=[3e7, 3.5e7, 4.2e7], cxx=[9e3, 5e3, 4e3],
            frequency=at, tag="rear",
        ),
    ]  # fmt: skip
    return ross.Rotor(shaft, discs, bearings)


def housed(cut):
    """The stepped rotor in two bearings whose housings have masses and stand on bases."""
    rotor, last = stepped(cut), 7 * cut
    bearings = [
        ross.BearingElement(
            n=cut, n_link=last + 1, kxx=3e7, kyy=5e7, kxy=4e6, kyx=-6e6, cxx=4e3, cyy=6e3, cxy=-500,
            cyx=-300, tag="front",
        ),
        ross.BearingElement(n=last, n_link=last + 2, kxx=2.5e7, kyy=3.5e7, cxx=5e3, tag="rear"),
        ross.BearingElement(n=last + 1, kxx=6e7, kyy=4e7, cxx=2e3, cyy=1e3, tag="front base"),
        ross.BearingElement(n=last + 2, kxx=8e7, kyy=5e7, cxx=1e3, tag="rear base"),
    ]  # fmt: skip
    housings = [
        ross.PointMass(n=last + 1, m=14.0, tag="front housing"),
        ross.PointMass(n=last + 2, m=20.0, tag="rear housing"),
    ]
    return ross.Rotor(rotor.shaft_elements, rotor.disk_elements, bearings, housings)


def lateral_roots(rotor, speed):
    """Slowest eigenvalues of x, y and the two tilts, from the matrices of ROSS."""
    lateral = [i for i in range(rotor.ndof) if i % 6 not in (2, 5)]
    pick = lambda matrix: np.asarray(matrix, float)[np.ix_(lateral, lateral)]
    mass, stiffness = pick(rotor.M(speed)), pick(rotor.K(speed))
    damping = pick(rotor.C(speed)) + speed * pick(rotor.G())
    n = len(lateral)
    inverse = (
        np.block(  # inverse of the state matrix: its largest eigenvalues, the slowest, are accurate
            [
                [-np.linalg.solve(stiffness, damping), -np.linalg.solve(stiffness, mass)],
                [np.eye(n), np.zeros((n, n))],
            ]
        )
    )
    values = 1 / scipy.linalg.eigvals(inverse)
    values = values[values.imag > 1.0]  # one of each pair, without overdamped ones
    return values[np.argsort(np.abs(values))][:COUNT]


def main():
    example(1).save(HERE / "example.toml")
    stepped(1).save(HERE / "stepped.json")
    housed(1).save(HERE / "housed.json")
    found = {"ross_version": ross.__version__}
    for build in (example, stepped, housed):
        for cut in CUTS:
            rotor = build(cut)
            for speed in SPEEDS[build.__name__]:
                values = lateral_roots(rotor, speed)
                name = f"{build.__name__} at {speed:g} rad/s, elements cut into {cut}"
                found[name] = [[value.real, value.imag] for value in values]
    (HERE / "roots.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
