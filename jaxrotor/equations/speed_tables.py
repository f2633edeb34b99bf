"""Speed tables: coefficients of a scene that are given over its speed of rotation, or over whirl."""

from typing import Any, NoReturn

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from ..core.extremes import bounded, larger
from ..core.quantities import Scalar, Series, known, with_values
from ..effects.base import AbstractOverSpeed
from ..effects.law import Clock
from ..effects.layout import coaxial_shafts
from ..scene import Scene
from ..spins.base import sense_of


def has_tables(scene: Scene) -> bool:
    """Whether coefficients of a scene are tables over the speed of rotation."""
    return bool(parts_with_tables(scene))


def parts_with_tables(scene: Scene) -> list[AbstractOverSpeed]:
    """Parts of a scene with coefficients over the speed of rotation."""
    return [part for part in scene.of(AbstractOverSpeed) if part.nodes_over_speed]


def has_whirl_tables(scene: Scene) -> bool:
    """Whether coefficients of a scene are tables over the frequency of whirl."""
    return any(effect.nodes_over_whirl is not None for effect in scene.of(AbstractOverSpeed))


def whirl_range(scene: Scene) -> tuple[Scalar, Scalar, bool]:
    """Frequencies [rad/s] between which roots are sought, and whether there are roots above, too.

    Where all tables over whirl are held, these are zero and the highest node.
    """
    every = [(one.nodes_over_whirl, one.hold) for one in scene.of(AbstractOverSpeed)]
    tables = [(nodes, hold) for nodes, hold in every if nodes is not None]
    ends = [(nodes[0], nodes[-1]) for nodes, hold in tables if not hold]
    if not ends:
        return jnp.zeros(()), jnp.max(jnp.stack([nodes[-1] for nodes, _ in tables])), True
    lows, highs = (jnp.stack(side) for side in zip(*ends, strict=True))
    return jnp.max(lows), jnp.min(highs), False


def at_own_speed(scene: Scene, part: Any) -> Any:
    """A part of a scene with its coefficients at the speed of the scene at t = 0."""
    if isinstance(part, AbstractOverSpeed) and part.nodes_over_whirl is not None:
        raise ValueError(
            f"Coefficients of {scene.name_of(part)} are tables over the frequency of whirl, which only a "
            "harmonic motion has; take `roots`, `growth_rate`, `onset_speed`, `stability_crossings`, "
            "`stability_map`, `campbell`, `critical_speeds` or `unbalance_response`, or the numbers at "
            "one frequency, `support.at_whirl(frequency)`."
        )
    if isinstance(part, AbstractOverSpeed) and part.nodes_over_speed:
        return part.at_speed(speed_of(clock_of(scene, part), scene.spin.speed))
    return part


def clock_of(scene: Scene, part: AbstractOverSpeed) -> Clock | None:
    """Clock whose speed the tables of a part are over; None: that of the first shaft."""
    if part.speeds_of == "first" or not scene.shafts:
        _check_over(scene, part, part.speeds_of in (None, "first"))
        return None
    clocks = {one.name: one.clock for one in coaxial_shafts(scene.effects)}
    own = clocks.get(part.shaft or "")
    if part.synchronous and not (part.speeds_of is None and own is None):
        raise ValueError(
            f"Coefficients of {scene.name_of(part)} are tables over the frequency of whirl, but not on "
            "the first shaft, whose unbalance whirls the rotor; give their numbers at one frequency, "
            "`support.at_whirl(frequency)`."
        )
    if part.speeds_of is None:
        return own
    on = getattr(part, "on", None)
    _check_over(scene, part, on in scene.shafts)
    sign, one = (1 if part.speeds_of == "sum" else -1), Clock(jnp.ones(()), None)
    first, second = own or one, clocks.get(on or "") or one
    excess = [(1, first.excess), (sign, second.excess)]
    given = [s * value for s, value in excess if value is not None]
    return Clock(first.ratio + sign * second.ratio, sum(given) if given else None)


def _check_over(scene: Scene, part: AbstractOverSpeed, fits: bool) -> None:
    if not fits:
        raise ValueError(
            f"The tables of {scene.name_of(part)} are over the {part.speeds_of} of two speeds, but it is "
            "not between two shafts; leave `speeds_of` out."
        )


def speed_of(clock: Clock | None, first: ArrayLike) -> Any:
    """Speed [rad/s] at which tables are read, by that of the first shaft."""
    return first if clock is None else clock.speed(jnp.asarray(first))


def nodes_by_first(scene: Scene, part: AbstractOverSpeed, sense: ArrayLike) -> list[Series]:
    """Nodes of the tables of a part over speed, as speeds of the first shaft in one sense, ascending.

    Empty where the speed of the tables does not depend on that of the first shaft. Tables at `|Omega|`
    of a shaft with a speed of its own are those of the sense in which that turns in the scene.
    """
    clock = clock_of(scene, part)
    if clock is None:
        return part.in_sense(sense)
    if _is_still(clock):
        return []
    rate = clock.ratio * jnp.asarray(sense)
    if clock.excess is None:
        return [nodes / jnp.abs(rate) for nodes in part.in_sense(jnp.sign(rate))]
    own = jnp.sign(clock.speed(jnp.asarray(scene.spin.speed)))
    found = []
    for nodes in part.in_sense(own):
        if not part.one_sense and known(nodes) and float(nodes[0]) == 0:
            nodes = jnp.concatenate([-nodes[:0:-1], nodes])
        found.append(jnp.sort((own * nodes - clock.excess) / rate))
    return found


def _is_still(clock: Clock) -> bool:
    """Whether the speed of a clock is known not to depend on that of the first shaft."""
    return known(clock.ratio) and float(clock.ratio) == 0


def without_still_tables(scene: Scene) -> Scene:
    """The scene with numbers for tables over a speed that does not depend on that of the first shaft."""

    def read(part: Any) -> Any:
        if not isinstance(part, AbstractOverSpeed) or not part.nodes_over_speed:
            return part
        clock = clock_of(scene, part)
        return (
            part
            if clock is None or not _is_still(clock)
            else part.at_speed(clock.speed(jnp.zeros(())))
        )

    if not scene.shafts or not has_tables(scene):
        return scene
    return with_values(scene, effects=tuple(map(read, scene.effects)))


def speed_range(scene: Scene, sense: ArrayLike = 1.0) -> tuple[Scalar, Scalar] | None:
    """Magnitudes [rad/s] of the speeds of one sense between which all tables of a scene have values.

    None where there is no limit. Tables that begin at 0 or above hold for both senses.
    """
    tables = [one for one in parts_with_tables(scene) if not one.hold]
    every = [nodes for own in tables for nodes in nodes_by_first(scene, own, sense)]
    if not every:
        return None
    lows, highs = (jnp.stack([nodes[end] for nodes in every]) for end in (0, -1))
    return larger(jnp.max(lows), 0.0), jnp.min(highs)


def within_tables(scene: Scene, speed: ArrayLike) -> Scalar:
    """A speed [rad/s], or where tables of a scene have no value the nearest one of its sense."""
    sense = jnp.where(jnp.asarray(speed) == 0, scene.spin.sense, sense_of(speed))
    span = speed_range(scene, sense)
    return jnp.asarray(speed) if span is None else sense * bounded(sense * speed, *span)


def check_no_tables(scene: Scene, what: str) -> None:
    """Raise if coefficients of a scene are tables; `what` needs numbers."""
    if has_whirl_tables(scene):
        raise ValueError(
            f"{what} is for constant coefficients, but supports have tables over the frequency of whirl; "
            "give their numbers at one frequency, `support.at_whirl(frequency)`."
        )
    if has_tables(scene):
        raise ValueError(
            f"{what} is for constant coefficients, but supports have tables over the speed; give their "
            "numbers at one speed, `support.at_speed(speed)`."
        )


def check_tables(scene: Scene, speeds: Any = None) -> None:
    """Raise unless tables of a scene have values at some speeds, by default its own, if all are known."""
    speeds = scene.spin.speed if speeds is None else speeds
    _check_still(scene)
    span = speed_range(scene)
    if span is None or not all(map(known, jax.tree.leaves((speeds, span)))):
        return
    every = np.ravel(np.asarray(speeds, float))
    senses = np.where(every < 0, -1.0, 1.0)
    for sense in np.unique(senses) if every.size else [float(scene.spin.sense)]:
        low, high = map(float, speed_range(scene, sense) or span)
        ends = f"{sense * low + 0:g}", f"{sense * high + 0:g}"
        own = every[senses == sense]
        if high < 0:
            _refuse_sense(scene, sense, own)
        if low > high:
            raise ValueError(
                f"The tables of the supports have no speed in common: one begins at {ends[0]} rad/s, "
                f"where another has ended at {ends[1]} rad/s; extend one, or give `hold=True`."
            )
        outside = own[(sense * own < low) | (sense * own > high)]
        if outside.size:
            raise ValueError(
                f"The tables of the supports are for speeds from {ends[0]} to {ends[1]} rad/s, but "
                f"coefficients are needed at {outside[0]:g} rad/s; extend the tables, or give "
                "`hold=True`, which takes them as constant beyond their ends."
            )


def _check_still(scene: Scene) -> None:
    """Raise if tables have no value at a speed that does not depend on that of the first shaft."""
    for one in parts_with_tables(scene):
        clock = clock_of(scene, one)
        if one.hold or clock is None or not _is_still(clock):
            continue
        speed = clock.speed(jnp.asarray(0.0))
        for nodes in one.in_sense(jnp.sign(speed)):
            if known(nodes) and known(speed) and not nodes[0] <= abs(speed) <= nodes[-1]:
                raise ValueError(
                    f"The tables of {scene.name_of(one)} are for speeds from {float(nodes[0]):g} to "
                    f"{float(nodes[-1]):g} rad/s, but are read at {float(speed):g} rad/s at any speed of "
                    "the first shaft; extend them, or give `hold=True`."
                )


def _refuse_sense(scene: Scene, sense: float, speeds: np.ndarray) -> NoReturn:
    """Raise, as speeds are of a sense that some tables of a scene lack."""
    tabled = [one for one in parts_with_tables(scene) if not one.hold]
    last = lambda one: [float(nodes[-1]) for nodes in nodes_by_first(scene, one, sense)]
    lacking = [one for one in tabled if min(last(one), default=0.0) < 0]
    names = ", ".join(map(scene.name_of, lacking))
    lacks, has = ("negative", "positive") if sense < 0 else ("positive", "negative")
    at = f"{speeds[0]:g} rad/s" if speeds.size else f"{lacks} speeds"
    raise ValueError(
        f"The tables of {names} are for {has} speeds alone, but coefficients are needed at {at}: films "
        f"and seals follow the sense of rotation; give tables over {lacks} speeds (of an oil film by "
        f"`linearized` of the scene that turns so), or take {has} speeds."
    )
