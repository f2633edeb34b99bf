"""Layout: the stations on every shaft of a scene, and the spans between them."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.quantities import Scalar, known
from ..shafts.line import NODES, AbstractLine, AbstractShaft, Attached
from .base import AbstractCoaxial, AbstractContact, AbstractEffect
from .places import check_hinges, check_yield, count_held, has_hinges, station_of


Effects = tuple[AbstractEffect, ...]


class Layout(NamedTuple):
    """Spans of one shaft, see `AbstractShaft.spans`, their nodes, and `AbstractShaft.attached`."""

    spans: tuple[int, ...]
    resolution: tuple[int, ...]
    attached: Attached = ()

    def line(self, placed: "Placed") -> AbstractLine:
        """The elastic line of a shaft with effects on it."""
        return placed.shaft.line(placed.stations, *self)


class Placed(NamedTuple):
    """A shaft, the effects on it, and their stations from its left end on [m]."""

    shaft: AbstractShaft
    effects: Effects
    own: tuple[Scalar, ...]  # stations of the effects that have one
    start: Scalar | None = None  # of the shaft on the axis of several; None: of a shaft alone

    @property
    def stations(self) -> tuple[Any, ...]:
        """Stations of the shaft itself, then those of the effects."""
        return (*self.shaft.stations, *self.own)

    @property
    def known_stations(self) -> tuple[float, ...] | None:
        """All stations, or None while any of them or the length is traced."""
        stations = self.stations
        if not all(map(known, (self.shaft.length, *stations))):
            return None
        return tuple(map(float, stations))

    @property
    def turned(self) -> tuple[bool, ...]:
        """Whether each effect that has a station may act on the slope there."""
        return tuple(one.turns_section for one in self.effects if station_of(one) is not None)

    def spans(self, stations: tuple[float, ...]) -> tuple[int, ...]:
        """Indices of the stations between which the line is smooth, see `AbstractShaft.spans`."""
        owners = [effect.kind for effect in self.effects if station_of(effect) is not None]
        owners = ["constraint or step"] * len(self.shaft.stations) + owners
        start = 0.0 if self.start is None else float(self.start)
        for owner, at in zip(owners, stations, strict=True):
            if (reason := self.shaft.reason_against(at)) is not None:
                beyond = f" ({at:g} m from the left end of its shaft)" * (self.start is not None)
                raise ValueError(f"The {owner} at {at + start:g} m{beyond} {reason}.")
        check_yield(self.shaft, self.effects, start)
        spans = self.shaft.spans(stations)
        if self.start is not None and has_hinges(self.effects):
            raise ValueError(
                "A hinge of a shaft, as by a crack with `compliance`, is for scenes of one shaft; give "
                "the `loss` of stiffness at its station instead."
            )
        check_hinges(self.shaft, self.effects, spans, stations)
        return spans

    def layout(self, stations: tuple[float, ...]) -> Layout:
        """Spans between known stations, and their nodes."""
        spans, shaft = self.spans(stations), self.shaft
        nodes = shaft.resolution(stations, spans, count_held(self.effects))
        if not has_hinges(self.effects):
            return Layout(spans, nodes, shaft.attached(stations, self.turned, nodes))
        if getattr(shaft, "nodes", None) == "auto":  # a kink needs them, and is in no mode
            nodes = tuple(max(NODES, count) for count in nodes)
        return Layout(spans, nodes)


def placed(shaft: AbstractShaft, name: str | None, effects: Effects) -> list[Placed]:
    """Every shaft of a scene, the first one of a name before those beside it, with what is on it."""
    beside = coaxial_shafts(effects)
    if not beside:
        return [_placed(shaft, effects)]
    every = [(name, shaft, jnp.zeros(())), *((one.name, one.body, one.start) for one in beside)]
    on = lambda own: tuple(e for e in effects if own in (e.shaft, getattr(e, "on", None)))
    return [_placed(body, on(own), start) for own, body, start in every]


def _placed(shaft: AbstractShaft, effects: Effects, start: Scalar | None = None) -> Placed:
    stations = [at for at in map(station_of, effects) if at is not None]
    if start is not None:
        stations = [at - start for at in stations]
    return Placed(shaft, effects, tuple(stations), start)


def coaxial_shafts(effects: Effects) -> list[AbstractCoaxial]:
    """Shafts beside the first one."""
    return [one for one in effects if isinstance(one, AbstractCoaxial)]


def seen_stations(
    every: Sequence[Placed], names: Sequence[str], effects: Effects, at: Any
) -> tuple[Float[Array, " s"], tuple[str | None, ...]]:
    """Stations to observe [m] and the shaft of each, see `Scene.seen`."""
    if at is None:
        contacts = tuple(one for one in effects if isinstance(one, AbstractContact))
        own = [one for one in (*contacts, *effects) if station_of(one) is not None]
        if own:
            return jnp.atleast_1d(station_of(own[0])), (own[0].shaft,)
        return jnp.atleast_1d(every[0].shaft.length), (names[0] if names else None,)
    if not names:
        stations = check_stations(every[0].shaft, at)
        return stations, (None,) * stations.size
    single = isinstance(at, tuple) and len(at) == 2 and isinstance(at[0], str)
    found, shafts = [], []
    for one in [at] if single or not isinstance(at, list | tuple) else at:
        if not isinstance(one, tuple) or len(one) != 2 or one[0] not in names:
            raise ValueError(
                f"`at` must name the shaft of every station, as ({names[0]!r}, 0.3), since there are "
                f"several ({', '.join(names)}), but has {one!r:.80}."
            )
        own = every[names.index(one[0])]
        found.append(check_stations(own.shaft, one[1], own.start))
        shafts += [one[0]] * found[-1].size
    return jnp.concatenate(found), tuple(shafts)


def check_stations(
    shaft: AbstractShaft, at: Any, start: Scalar | None = None
) -> Float[Array, " s"]:
    """Stations [m] as an array; raises if one is not on the shaft, whose left end is at `start`."""
    try:
        stations = jnp.atleast_1d(jnp.asarray(at, float))
    except (TypeError, ValueError):
        stations = jnp.zeros(0)
    if stations.ndim > 1 or not stations.size:
        raise ValueError(f"`at [m]` must be a station or a list of them, but is {at!r:.200}.")
    if all(map(known, (stations, shaft.length, start))):
        length, left = float(shaft.length), 0.0 if start is None else float(start)
        own = [x - left for x in stations.tolist()]
        off = [x for x in own if not -1e-12 * length <= x <= length * (1 + 1e-12)]
        if off:
            raise ValueError(
                f"`at [m]` must be on the shaft ({left:g} to {left + length:g}), but is {left + off[0]:g}."
            )
        for x in own:
            if (reason := shaft.reason_against(max(x, 0.0))) is not None:
                raise ValueError(f"`at [m]` = {left + x:g} m {reason}.")
    return stations


def check_one_shaft(shafts: Sequence[str], what: str) -> None:
    """Raise if a scene has several shafts; `what` is for one."""
    if shafts:
        raise ValueError(
            f"{what} is for scenes of one shaft, but this one has several ({', '.join(shafts)}); take "
            "`roots`, `critical_speeds`, `campbell`, `unbalance_response`, `simulate` or `sweep`."
        )


def check_simulated(observed: Sequence[str | None], *, given: bool) -> None:
    """Raise unless stations are of one shaft, and the speed of a scene of several is given in time."""
    if len(set(observed)) > 1:
        raise ValueError(
            "A motion in time is observed at stations of one shaft, but `at` names "
            f"{' and '.join(sorted(map(str, set(observed))))}; simulate once for each."
        )
    if not given:
        raise ValueError(
            "The drive of the scene is held back by the rotor, but there are several shafts, whose "
            "torques are not known apart; give the speed in time, by a SpeedProfile or a Drive without "
            "`feedback`."
        )


def check_shafts(effects: Effects, name: str | None) -> None:
    """Raise unless shafts have names of their own, and every part names that on which it sits."""
    beside = [one.name for one in coaxial_shafts(effects)]
    if not beside:
        for effect in effects:
            if isinstance(effect.shaft, str) and effect.shaft != name:
                raise ValueError(
                    f"The {effect.kind} is on a shaft {effect.shaft!r}, but the scene has one shaft "
                    "without a name; give the shafts by their names, `Scene({'lp': .., 'hp': ..}, ..)`."
                )
        return
    names = [name, *beside]
    for one in names:
        if not isinstance(one, str) or not one.strip() or names.count(one) > 1:
            raise ValueError(
                f"Every shaft of a scene of several needs a name of its own, but they have {names}; give "
                "them as `Scene({'lp': .., 'hp': CoaxialShaft(..)}, ..)`."
            )
    for effect in effects:
        needs = station_of(effect) is not None or effect.along_shaft
        if isinstance(effect, AbstractCoaxial) or not needs and not isinstance(effect.shaft, str):
            continue
        if effect.shaft not in names:
            raise ValueError(
                f"The {effect.kind} {_where(effect)}must name its shaft, {_either(names)}, as in "
                f"`at=({names[0]!r}, 0.3)` or `shaft={names[0]!r}`, but names {effect.shaft!r}."
            )
        if getattr(effect, "on", None) in names:
            _check_joint(effect)
        if getattr(effect, "on", None) == effect.shaft:
            raise ValueError(
                f"The {effect.kind} {_where(effect)}is between a shaft, {effect.shaft!r}, and itself; "
                "name another one by `on`, or a casing, or leave it out."
            )


def _check_joint(effect: AbstractEffect) -> None:
    """Raise if the force of an effect between two shafts is not known."""
    if effect.reason_between is not None:
        raise ValueError(
            f"The {effect.kind} {_where(effect)}is between two shafts, {effect.reason_between}."
        )
    if effect.by_speed:
        raise ValueError(
            f"The {effect.kind} {_where(effect)}is between two shafts, but its force depends on the speed "
            "of one; take a Support with its coefficients, or stand it on the ground or on a casing."
        )


def _where(effect: AbstractEffect) -> str:
    at = station_of(effect)
    return f"at {float(at):g} m " if at is not None and known(at) else ""


def _either(names: Sequence[Any]) -> str:
    return " or ".join(map(repr, names))
