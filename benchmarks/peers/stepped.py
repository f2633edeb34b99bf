"""A compressor of any number of sections, as a scene file and as a machine to compare.

A stepped shaft of 2.6 m with shear, 2 bearings, impellers, labyrinth seals whose coefficients are tables
over nine speeds, as those of the bearings, and an unbalance on the middle impeller. 56 sections have 7
impellers and 8 seals; more sections have more of both between the same ends.
"""

import math
from pathlib import Path

from .turbomachines import Machine


LENGTH = 2.6  # [m]
SPEED, HIGHEST = 840.0, 1600.0  # of the scene, and up to which it is asked [rad/s]
LONGEST = 0.026  # largest length of an element of ROSS [m]
# Tables cover every speed that is asked for and are linear in it, so that all interpolations agree.
NODES = [210.0 * k for k in range(9)]  # [rad/s]
BEARING = {"k": (44e6, 1.1e5), "c": (152.6e3, -40.0)}  # at rest, and per rad/s
SEAL = {"k": (165e3, 430.0), "c": (2.2e3, -0.6), "cross": (400e3, 1900.0)}


def compressor(sections: int, folder: Path) -> Machine:
    """The machine, whose scene file is written into a folder."""
    section, impellers = LENGTH / sections, _places(sections, sections // 8, 12, 42)
    seals, middle = _places(sections, sections // 7, 11, 43), impellers[len(impellers) // 2]
    at = lambda place: f"at = {place * section!r}\n"
    parts = [
        f"[shaft]\nlength = {LENGTH}\ndiameter = {_diameter(0)}\nconstraints = []\nshear = true\n",
        "[shaft.material]\nyoungs_modulus = 205e9\ndensity = 7830.0\nshear_modulus = 80e9\n",
        *(f"[[shaft.steps]]\n{at(k)}diameter = {_diameter(k)}\n" for k in range(1, sections)),
        *(f"[[disc]]\n{at(k)}mass = 35.0\ndiametral = 0.5\npolar = 0.9\n" for k in impellers),
        *(f"[[support]]\n{at(k)}{_tables(BEARING)}" for k in _places(sections, 2, 6, 50)),
        *(f"[[support]]\n{at(k)}{_tables(SEAL)}" for k in seals),
        f"[[unbalance]]\n{at(middle)}mass = 35.0\neccentricity = 2e-6\n[spin]\nspeed = {SPEED}\n",
    ]
    file = folder / f"{sections}-sections.toml"
    file.write_text("".join(parts))
    element = section / math.ceil(section / LONGEST - 1e-9)
    return Machine(str(file), HIGHEST, SPEED, 0.0, HIGHEST, middle * section, None, element)


def _diameter(section: int) -> float:
    return round(0.11 + 0.04 * (section % 3) + 0.001 * (section % 7), 3)


def _places(sections: int, count: int, first: float, last: float) -> list[int]:
    """Ends of sections for parts from one place to another of 56; a single part stands between them."""
    shares = [k / (count - 1) for k in range(count)] if count > 1 else [0.5]
    return [round((first + (last - first) * share) * sections / 56) for share in shares]


def _tables(law: dict[str, tuple[float, float]]) -> str:
    """Coefficients of a support with equal axes."""
    table = lambda key, sign=1: [sign * (law[key][0] + law[key][1] * speed) for speed in NODES]
    rows = {"speeds": NODES, "kxx": table("k"), "cxx": table("c")}
    if "cross" in law:
        rows |= {"kxy": table("cross"), "kyx": table("cross", -1)}
    return "".join(f"{key} = {row}\n" for key, row in rows.items())
