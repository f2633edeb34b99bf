"""Passes: the period of a scene whose laws turn at another ratio than the shaft, as a cage does.

    n_i period_i = longest,   n_i = 1, 2, ..

A motion that restarts its angle with every period is exact, since all forces are then what they were.
"""

import dataclasses
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..core.quantities import Scalar, known
from ..effects.base import AbstractContact
from ..effects.law import AbstractLaw
from ..equations.pencil import frame
from ..equations.system import System, assemble, phrase
from ..scene import Scene


STANDS = 1e6  # revolutions: a law that takes more of them for a period stands, but for rounding
SAME = 1e-9  # relative difference of numbers of periods that count as whole
MOST = 64  # revolutions that are looked through for a common period
SHAFT = "what turns with the shaft"


class Cycle(NamedTuple):
    """What counts as one period of a scene: a revolution of the shaft, or a pass of a law by "turns"."""

    passes: bool
    revolutions: float | None  # in it; None where values are traced
    every: tuple[float, ...] = ()  # revolutions in a period of each law by "turns"


def cycle_of(scene: Scene, system: System, what: str) -> Cycle:
    """The shortest period of all forces; raises where there is none that `what` takes."""
    laws = {scene.name_of(one): _law(one) for one in scene.of(AbstractContact)}
    turning = {name: law.period for name, law in laws.items() if law.clock == "turns"}
    if not turning:
        return Cycle(False, 1.0)
    if unknown := [name for name, period in turning.items() if period is None]:
        raise ValueError(
            f"{what} is for forces that repeat, but contacts ({phrase(unknown)}) count turns and their "
            "laws state no `period`; follow the motion by `jaxrotor.simulate`."
        )
    with_shaft = _turns_with_the_shaft(system)
    if not all(map(known, turning.values())):
        if len(turning) == 1 and not with_shaft:
            return Cycle(True, None)
        raise ValueError(
            f"Whether the forces of {phrase(turning)} and of {SHAFT} have a common period is known by "
            "values alone, which are traced here; differentiate and compile by other parameters than "
            "those of their rotation, and without unbalance leave it out of the scene."
        )
    every = {name: float(period) / (2 * np.pi) for name, period in turning.items()}
    moving = {name: count for name, count in every.items() if count < STANDS}
    if with_shaft:
        moving[SHAFT] = 1.0
    if not moving:
        raise ValueError(
            f"The cages of {phrase(every)} stand, so nothing repeats and no period is known; see "
            "`jaxrotor.static_positions` for the rest in their bearings."
        )
    longest = max(moving.values())
    if not all(_whole(longest / count) for count in moving.values()):
        raise ValueError(_apart(moving, what))
    if with_shaft and longest > 1 + SAME:
        raise ValueError(
            f"{what} takes a period of one revolution, or of a pass without anything that turns with the "
            f"shaft, but all forces repeat after {longest:.9g} revolutions at the earliest; follow the "
            "motion by `jaxrotor.simulate`."
        )
    return Cycle(not with_shaft, longest, tuple(every.values()))


def with_cycle(system: System, passes: bool) -> System:
    """The system whose laws by "turns" repeat in a period, and without unbalance if these are passes."""
    if "turns" not in system.clocks:
        return system
    system = dataclasses.replace(system, repeats=True)
    absent = lambda part: part is None
    if passes:  # it is zero
        system = eqx.tree_at(lambda s: s.load.unbalance, system, None, is_leaf=absent)
    return system


def cycle_rate(system: System, passes: bool) -> Scalar:
    """2 pi over the time of a revolution, or of the longest pass [rad/s].

    A motion is stepped by an angle from 0 to 2 pi in that time, `1 / s` times the one that laws are
    given, see `Motion.of_laws`, so a pass may also take more than a revolution.
    """
    speed = jnp.abs(system.spin.speed)
    if not passes:
        return speed
    laws = [law for port in system.ports for law in port.laws if law.clock == "turns"]
    periods = jnp.concatenate([jnp.ravel(jnp.asarray(law.period)) for law in laws])
    moving = jnp.where(periods < 2 * jnp.pi * STANDS, periods, 0.0)
    return 2 * jnp.pi * speed / jnp.max(moving)


def check_ranges(scene: Scene, ends: Sequence[Scene], passes: bool, path: str) -> None:
    """Raise unless orbits of passes, or else of revolutions, have their period at the ends of ranges."""
    own, *there = (cycle_of(one, assemble(one), f"A branch in {path}") for one in (scene, *ends))
    if passes:
        same = all(one.passes for one in there)
    else:  # where unbalance vanishes, passes are whole parts of a revolution
        same = all(np.allclose(one.every, own.every, rtol=SAME, atol=0.0) for one in there)
    if not same:
        raise ValueError(
            f"{path} changes which period the forces have, so that orbits have another at an end of the "
            "range than at its begin; take a range without such an end."
        )


def _law(contact: AbstractContact) -> AbstractLaw:
    """The law of a contact, with known values also inside a program."""
    if not all(map(known, jax.tree.leaves(contact))):
        return contact.law()
    with jax.ensure_compile_time_eval():
        return contact.law()


def _turns_with_the_shaft(system: System) -> bool:
    """Whether anything repeats with a revolution alone: unbalance, axes or laws that turn."""
    unbalance = system.load.unbalance
    if frame(system.blocks) != "fixed" or "revolution" in system.clocks:
        return True
    return unbalance is not None and (not known(unbalance) or bool(jnp.any(unbalance != 0)))


def _whole(number: float) -> bool:
    return abs(number - round(number)) <= SAME * number


def _apart(moving: dict[str, float], what: str) -> str:
    """Why some forces have no common period, or one of several of the longest."""
    first = max(moving, key=lambda name: moving[name])
    other = next(name for name in moving if not _whole(moving[first] / moving[name]))
    ratio = moving[other] / moving[first]
    near = Fraction(ratio).limit_denominator(MOST)
    times = "no common period"
    if abs(ratio - near) <= SAME * ratio:
        times = f"none before {near.numerator * moving[first]:.9g} revolutions"
    return (
        f"{what} needs one period of all forces, but those of {other} repeat after "
        f"{moving[other]:.9g} and those of {first} after {moving[first]:.9g} revolutions, which have "
        f"{times}; leave unbalance out, or follow the motion by `jaxrotor.simulate`."
    )
