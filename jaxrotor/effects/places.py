"""Places: where the effects of a scene may stand, and what stands beside its shaft."""

from collections.abc import Sequence
from typing import Any

from ..core.checks import suggest
from ..core.quantities import known
from ..shafts.line import AbstractShaft
from ..shafts.massless import coincide
from .base import AbstractCasing, AbstractContact, AbstractEffect, AbstractOwnCoordinates


# === casings


def check_casings(effects: tuple[AbstractEffect, ...], shafts: Sequence[str] = ()) -> None:
    """Raise unless casings have names of their own, and each is held by a part that names it.

    Effects with coordinates of their own have names of their own, too.
    """
    owners = of_first_order(effects)
    for effect in owners:
        if sum(other.name == effect.name for other in owners) > 1:
            raise ValueError(
                f"Two parts with coordinates of their own have the name {effect.name!r}; give each "
                f"{effect.kind} a `name` of its own."
            )
    names = [effect.name for effect in effects if isinstance(effect, AbstractCasing)]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"Two casings have the name {name!r}; give each a name of its own.")
    parts = [(effect, getattr(effect, key, None)) for effect in effects for key in ("of", "on")]
    parts = [(effect, name) for effect, name in parts if name is not None]
    for _, name in parts:
        if name not in (*names, *shafts) and shafts:
            every = (*names, *shafts)
            near = suggest(str(name), every)
            raise ValueError(
                f"There is no casing or shaft {name!r}{near}; the scene has: {', '.join(every)}."
            )
        if name not in shafts:
            check_casing(name, names)
    held = [name for effect, name in parts if not isinstance(effect, AbstractContact)]
    loose = [
        one for one in effects if isinstance(one, AbstractContact)
    ]  # by a foundation of their own
    held += [one.name for one in loose if isinstance(one, AbstractCasing)]
    for name in names:
        if name not in held:
            raise ValueError(
                f"Nothing holds the casing {name!r}; give it a Support by `of`, and the shaft one by `on`."
            )


def of_first_order(effects: tuple[AbstractEffect, ...]) -> list[AbstractOwnCoordinates]:
    """Effects that have coordinates of their own."""
    return [one for one in effects if isinstance(one, AbstractOwnCoordinates) and one.own]


def names_beside(effects: tuple[AbstractEffect, ...]) -> tuple[str, ...]:
    """Names of the coordinates beside the shaft: own ones of effects, then those of casings."""
    own = [name for one in of_first_order(effects) for name in one.own]
    return *own, *(one.name for one in effects if isinstance(one, AbstractCasing))


def check_casing(name: str, names: Sequence[str]) -> None:
    """Raise unless a casing has a name."""
    if name not in names:
        there = f"the scene has: {', '.join(names)}" if names else "the scene has none"
        raise ValueError(f"There is no casing {name!r}{suggest(str(name), names)}; {there}.")


# === stations


def station_of(effect: AbstractEffect) -> Any:
    """Station of an effect [m]; None if it has none."""
    return getattr(effect, "at", None)


def count_held(effects: tuple[AbstractEffect, ...]) -> int:
    """Number of stations where effects hold the shaft, always or while in contact."""
    held = (getattr(effect, "at", None) for effect in effects if effect.holds_shaft)
    return len({float(at) for at in held if at is not None})


def check_sensors(shaft: AbstractShaft, effects: tuple[AbstractEffect, ...], start: float) -> None:
    """Raise if a sensor is where nothing can be placed on the shaft."""
    for effect in effects:
        sensor = getattr(effect, "sensor", None)
        if sensor is None or not (known(sensor) and known(shaft.length)):
            continue
        if (reason := shaft.reason_against(float(sensor) - start)) is not None:
            raise ValueError(f"The sensor of a {effect.kind} at {float(sensor):g} m {reason}.")


def check_yield(
    shaft: AbstractShaft, effects: tuple[AbstractEffect, ...], start: float = 0.0
) -> None:
    """Raise if a sensor is off the shaft, or a support where a constraint holds what it acts on.

    Stations of effects [m] are those along an axis on which the shaft begins at `start`.
    """
    check_sensors(shaft, effects, start)
    pins = [one for one in getattr(shaft, "constraints", ()) if one.displacement]
    for effect in effects:
        at, on = getattr(effect, "at", None), getattr(effect, "on", None)
        linear = effect.holds_shaft and not isinstance(effect, AbstractContact)
        if at is None or on is not None or not linear or effect.turns_section:
            continue
        for pin in pins:
            if coincide(float(at) - start, float(pin.at), float(shaft.length)):
                raise ValueError(
                    f"The {effect.kind} at {float(at):g} m has no effect, since a {pin.holds} of the "
                    "shaft holds the displacement there; leave one of both out."
                )


# === hinges


def has_hinges(effects: tuple[AbstractEffect, ...]) -> bool:
    """Whether an effect is a hinge of the shaft."""
    return any(isinstance(one, AbstractContact) and one.hinged for one in effects)


def check_hinges(
    shaft: AbstractShaft,
    effects: tuple[AbstractEffect, ...],
    spans: Sequence[int],
    stations: Sequence[float],
) -> None:
    """Raise unless spans between known `stations` [m] meet at every hinge, and nothing resists it."""
    if not has_hinges(effects):
        return
    length, number, ends = float(shaft.length), [], [stations[k] for k in spans[1:-1]]
    for effect in effects:
        if not isinstance(effect, AbstractContact) or not effect.hinged:
            continue
        name = f"The {effect.kind} at {float(effect.at):g} m"
        at = [k for k, end in enumerate(ends) if coincide(float(effect.at), end, length)]
        if not at:
            raise ValueError(
                f"{name} bends the shaft, but no spans of it meet there; place it in a FlexibleShaft of "
                "spectral rule, between its ends and off other parts by 0.2 % of its length or not at all."
            )
        number += at
        for one in getattr(shaft, "constraints", ()):
            if one.slope and coincide(float(one.at), float(effect.at), length):
                raise ValueError(
                    f"{name} is where a {one.holds} of the shaft holds its slope; move one of them."
                )
        if getattr(shaft, "anisotropy", None) is not None:
            raise ValueError(f"{name} needs a round shaft; leave `shaft.anisotropy` out.")
        for one in effects:
            if one.strains:
                raise ValueError(
                    f"{name} has a jump of slope, which is no strain of the material, so the "
                    f"{one.kind} would damp it wrongly; take ExternalDamping, ModalDamping or a "
                    "DiscDamping in its place."
                )
    number.sort()
    if any(after - one < 2 for one, after in zip(number, number[1:], strict=False)):
        raise ValueError(
            "Two hinges of the shaft, as by cracks with `compliance`, need another station between them; "
            "put a Disc of zero mass there, or move one of them."
        )
