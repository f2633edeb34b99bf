"""Plausibility: numbers that no machine has, mostly because a unit was taken for another.

Lengths are held against the length of the shaft, so a scene without dimensions, all of order 1, says
nothing; sag under weight is worked out for a shaft of a real material alone.
"""

import math
import sys
import warnings
from collections.abc import Iterator, Mapping


LONGER = 20.0  # times the length of the shaft: no disc, stop or race is as large
SLENDER = 1e4  # times its diameter: no shaft is as long
HEAVIEST = 1e7  # [kg], five times the rotor of the largest hydro generator
FASTEST = 1e6  # [rad/s], ten times the fastest gas bearings
RIM = 5e3  # [m/s] at the surface of the shaft: no material holds a third of it
GRAVITY = 9.8  # [m/s^2]
SAG = 0.3  # of the length, of a shaft on its two ends under its discs
MODULI = (1e9, 2e12)  # [Pa] of what shafts are made of
DENSITIES = (500.0, 3e4)  # [kg/m^3]
LIGHT = (0.5, 30.0)  # [g/cm^3], where a density in kg/m^3 is looked for

Found = Mapping[str, tuple[float, str]]  # value and unit by path, of what is known


class ImplausibleWarning(UserWarning):
    """A number of a scene is far outside what machines have; its unit may be another."""


def warn_implausible(found: Found) -> None:
    """Warn of every number that no machine has, at the line outside the package that led here."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and _ours(frame.f_globals.get("__name__", "")):
        level, frame = level + 1, frame.f_back
    for sentence in doubts(found):
        warnings.warn(sentence, ImplausibleWarning, stacklevel=level)


def _ours(module: str) -> bool:
    return module.partition(".")[0] in ("jaxrotor", "equinox", "jaxtyping", "beartype")


def doubts(found: Found) -> Iterator[str]:
    """A sentence on each number that is far outside what machines have, with the unit that may be meant.

    Args:
        found: value in SI and unit of every parameter that is known, by its path in the scene.
    """
    first = [*_lengths(found), *_material(found), *_too_large(found)]
    yield from first or _sags(found)  # which a wrong length or mass alone would explain


def _doubt(path: str, value: float, unit: str, why: str, other: str, factor: float) -> str:
    return (
        f"`{path}` is {value:g} {unit}, {why}; check its unit: "
        f"{value:g} {other} is {factor * value:.6g} {unit}."
    )


def _too_large(found: Found) -> Iterator[str]:
    """Masses and speeds."""
    for path, (value, unit) in found.items():
        if unit == "kg" and value > HEAVIEST:
            yield _doubt(path, value, "kg", "heavier than any rotor", "g", 1e-3)
        if unit == "rad/s" and abs(value) > FASTEST:
            yield _doubt(path, value, "rad/s", "faster than any rotor", "rpm", math.pi / 30)
    diameter, speed = found.get("shaft.diameter"), found.get("spin.speed")
    if diameter and speed and FASTEST >= abs(speed[0]) > 2 * RIM / diameter[0]:
        rim = f"{abs(speed[0]) * diameter[0] / 2:.3g} m/s at the surface of the shaft"
        yield _doubt("spin.speed", speed[0], "rad/s", rim, "rpm", math.pi / 30)


def _lengths(found: Found) -> Iterator[str]:
    """Lengths beside that of the shaft, and that of the shaft beside its diameter."""
    length = found["shaft.length"][0] if "shaft.length" in found else math.inf
    for path, (value, unit) in found.items():
        if unit == "m" and abs(value) > LONGER * length:
            why = f"{_times(abs(value) / length)} the length of the shaft, {length:g} m"
            yield _doubt(path, value, "m", why, "mm", 1e-3)
    diameter = found.get("shaft.diameter", (math.inf, "m"))[0]
    if SLENDER * diameter < length < math.inf:
        why = f"{_times(length / diameter)} its diameter, {diameter:g} m"
        yield _doubt("shaft.length", length, "m", why, "mm", 1e-3)


def _material(found: Found) -> Iterator[str]:
    """A modulus of a metal with a density in g/cm^3, or the reverse with a modulus in GPa or MPa."""
    for path, (density, unit) in found.items():
        modulus = found.get(f"{path.removesuffix('density')}youngs_modulus")
        if unit != "kg/m^3" or modulus is None:
            continue
        if _within(modulus[0], MODULI) and _within(density, LIGHT):
            why = "lighter than what shafts are made of"
            yield _doubt(path, density, "kg/m^3", why, "g/cm^3", 1e3)
        for other, factor in (("GPa", 1e9), ("MPa", 1e6)):
            if _within(density, DENSITIES) and _within(factor * modulus[0], MODULI):
                path, why = f"{path.removesuffix('density')}youngs_modulus", "softer than any shaft"
                yield _doubt(path, modulus[0], "Pa", why, other, factor)


def _sags(found: Found) -> Iterator[str]:
    """Discs that bend the shaft, and supports that give way, by a good part of its length.

    `m g l^3 / (48 E I)` is the sag of a shaft on its two ends; `m g / k` that of supports together.
    """
    modulus, density = (
        found.get(f"shaft.material.{name}") for name in ("youngs_modulus", "density")
    )
    if modulus is None or density is None or "shaft.length" not in found:
        return
    if not (_within(modulus[0], MODULI) and _within(density[0], DENSITIES)):
        return
    length = found["shaft.length"][0]
    shaft = {path: v for path, (v, _) in found.items() if path.startswith("shaft.")}
    wide = max((v for path, v in shaft.items() if path.endswith(".diameter")), default=math.inf)
    discs = {path: v for path, (v, unit) in found.items() if unit == "kg" and _of(path, "disc")}
    sag = sum(discs.values()) * GRAVITY * length**2 / (48 * modulus[0] * math.pi * wide**4 / 64)
    if sag > SAG and discs:
        path = max(discs, key=discs.__getitem__)
        why = f"under which the shaft would sag by {100 * sag:.3g} % of its length"
        yield _doubt(path, discs[path], "kg", why, "g", 1e-3)
        return
    supports: dict[str, float] = {}
    for path, (value, unit) in found.items():
        if unit == "N/m" and _of(path, "support"):
            owner = path.rpartition(".")[0]
            supports[owner] = max(abs(value), supports.get(owner, 0.0))
    weight = GRAVITY * (sum(discs.values()) + density[0] * math.pi * wide**2 / 4 * length)
    if supports and not any(".constraints." in path for path in found):
        stiffness = sum(supports.values())
        if 0 < length * stiffness < weight:
            yield (
                f"The supports, {stiffness:g} N/m together, would give way by more than the length of the "
                f"shaft under its weight, {weight:.3g} N; check their unit: 1 N/um is 1e6 N/m."
            )


def _times(ratio: float) -> str:
    return f"{ratio:.0f} times" if ratio < 1e6 else f"{ratio:.2g} times"


def _of(path: str, kind: str) -> bool:
    return path.partition(".")[0] in (kind, f"{kind}s")


def _within(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]
