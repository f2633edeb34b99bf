"""Plausibility: warnings of numbers that no machine has, mostly because of a wrong unit.

Lengths are compared with the length of the shaft, so a dimensionless scene with values of order 1 gives
no warning. Sag under weight is computed only for a shaft of a real material.
"""

import math
import sys
import warnings
from collections.abc import Iterator, Mapping


LONGER = 20.0  # times the length of the shaft: larger than any disc, stop or race
SLENDER = 1e4  # length over diameter: more than any shaft has
HEAVIEST = 1e7  # [kg], five times the mass of the largest rotor of a hydro generator
FASTEST = 1e6  # [rad/s], ten times the speed of the fastest gas bearings
SURFACE = 5e3  # [m/s] at the surface of the shaft: materials burst at a third of it
GRAVITY = 9.8  # [m/s^2]
SAG = 0.3  # over length: of a shaft supported at both ends, under its discs
MODULI = (1e9, 2e12)  # [Pa], range of materials for shafts
DENSITIES = (500.0, 3e4)  # [kg/m^3], range of materials for shafts
LIGHT = (0.5, 30.0)  # the same in g/cm^3

Found = Mapping[str, tuple[float, str]]  # value and unit of each known parameter, by path


class ImplausibleWarning(UserWarning):
    """A number of a scene is far outside the range of machines; its unit may be wrong."""


def warn_implausible(found: Found) -> None:
    """Warn of every implausible number, at the line of the caller outside the package."""
    level, caller = 1, sys._getframe()
    while caller.f_back is not None and _ours(caller.f_globals.get("__name__", "")):
        level, caller = level + 1, caller.f_back
    for sentence in doubts(found):
        warnings.warn(sentence, ImplausibleWarning, stacklevel=level)


def _ours(module: str) -> bool:
    """Whether a module belongs to the package or to the libraries that call it."""
    return module.partition(".")[0] in ("jaxrotor", "equinox", "jaxtyping", "beartype")


def doubts(found: Found) -> Iterator[str]:
    """A sentence on each implausible number, with the unit that may be meant.

    Args:
        found: value in SI and unit of every known parameter, by its path in the scene.

    Yields:
        Sentences. Sag is checked only if nothing else is wrong, as a wrong length or mass causes it.
    """
    first = [*_lengths(found), *_material(found), *_too_large(found)]
    yield from first or _sags(found)


def _doubt(path: str, value: float, unit: str, why: str, other: str, factor: float) -> str:
    return (
        f"`{path}` is {value:g} {unit}, {why}; check its unit: "
        f"{value:g} {other} is {factor * value:.6g} {unit}."
    )


def _too_large(found: Found) -> Iterator[str]:
    """Masses and speeds that are too large."""
    for path, (value, unit) in found.items():
        if unit == "kg" and value > HEAVIEST:
            yield _doubt(path, value, "kg", "heavier than any rotor", "g", 1e-3)
        if unit == "rad/s" and abs(value) > FASTEST:
            yield _doubt(path, value, "rad/s", "faster than any rotor", "rpm", math.pi / 30)
    diameter, speed = found.get("shaft.diameter"), found.get("spin.speed")
    if diameter and speed and FASTEST >= abs(speed[0]) > 2 * SURFACE / diameter[0]:
        why = f"{abs(speed[0]) * diameter[0] / 2:.3g} m/s at the surface of the shaft"
        yield _doubt("spin.speed", speed[0], "rad/s", why, "rpm", math.pi / 30)


def _lengths(found: Found) -> Iterator[str]:
    """Lengths that are too large for the length of the shaft, and a shaft too long for its diameter."""
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
    """A density that is plausible in g/cm^3 only, or a modulus that is plausible in GPa or MPa only."""
    for path, (density, unit) in found.items():
        modulus = found.get(f"{path.removesuffix('density')}youngs_modulus")
        if unit != "kg/m^3" or modulus is None:
            continue
        if _between(modulus[0], MODULI) and _between(density, LIGHT):
            why = "lighter than what shafts are made of"
            yield _doubt(path, density, "kg/m^3", why, "g/cm^3", 1e3)
        for other, factor in (("GPa", 1e9), ("MPa", 1e6)):
            if _between(density, DENSITIES) and _between(factor * modulus[0], MODULI):
                path, why = f"{path.removesuffix('density')}youngs_modulus", "softer than any shaft"
                yield _doubt(path, modulus[0], "Pa", why, other, factor)


def _sags(found: Found) -> Iterator[str]:
    """Discs that bend the shaft, and supports that deflect, by a large part of its length.

    The sag of a shaft supported at both ends is `m g l^3 / (48 E I)`, that of all supports `m g / k`.
    """
    modulus, density = (
        found.get(f"shaft.material.{name}") for name in ("youngs_modulus", "density")
    )
    if modulus is None or density is None or "shaft.length" not in found:
        return
    if not (_between(modulus[0], MODULI) and _between(density[0], DENSITIES)):
        return
    length = found["shaft.length"][0]
    shaft = {path: v for path, (v, _) in found.items() if path.startswith("shaft.")}
    wide = max((v for path, v in shaft.items() if path.endswith(".diameter")), default=math.inf)
    discs = {
        path: v for path, (v, unit) in found.items() if unit == "kg" and _is_kind(path, "disc")
    }
    sag = sum(discs.values()) * GRAVITY * length**2 / (48 * modulus[0] * math.pi * wide**4 / 64)
    if sag > SAG and discs:
        path = max(discs, key=discs.__getitem__)
        why = f"under which the shaft would sag by {100 * sag:.3g} % of its length"
        yield _doubt(path, discs[path], "kg", why, "g", 1e-3)
        return
    supports: dict[str, float] = {}
    for path, (value, unit) in found.items():
        if unit == "N/m" and _is_kind(path, "support"):
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


def _is_kind(path: str, kind: str) -> bool:
    return path.partition(".")[0] in (kind, f"{kind}s")


def _between(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]
