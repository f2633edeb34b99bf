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
from ..equations.counted import counted
from ..equations.pencil import frame
from ..equations.system import System, assemble, phrase
from ..scene import Scene


STANDS = 1e6  # revolutions: a law that takes more of them for a period stands, but for rounding
SAME = 1e-9  # relative difference of numbers of periods that count as whole
MOST = 64  # periods that are looked through for a common one
SHAFT = "what turns with the shaft"
_ADVICE = "follow its motion by `jaxrotor.simulate`"


class Cycle(NamedTuple):
    """The shortest period of all forces: a revolution of the shaft, or a pass of a law by "turns"."""

    passes: bool
    revolutions: float | None  # in it; None where values are traced
    every: tuple[float, ...] = ()  # revolutions in a period of each law by "turns"
    common: bool = True  # False: forces are never again what they were, see `counted`

    def of(self, system: System) -> System:
        """The system with its laws by "turns" as a motion by these periods takes them."""
        return with_cycle(system, self.passes) if self.common else counted(system)


def cycle_of(scene: Scene, system: System, what: str, *, apart: bool = False) -> Cycle:
    """The shortest period of all forces; raises where there is none that `what` takes.

    With `apart` it also takes forces that never repeat together, by revolutions of the shaft.
    """
    laws = {scene.name_of(one): _law(one) for one in scene.of(AbstractContact)}
    counting = {name: law.period for name, law in laws.items() if law.clock == "turns"}
    turning = {name: period for name, period in counting.items() if period is not None}
    if not counting:
        return Cycle(False, 1.0)
    if unknown := [name for name in counting if name not in turning]:
        raise ValueError(
            f"{what} is for forces that repeat, but contacts ({phrase(unknown)}) count turns and their "
            f"laws state no `period`; {_ADVICE}."
        )
    with_shaft = _turns_with_the_shaft(system)
    if not all(map(known, turning.values())):
        if len(turning) == 1 and not with_shaft:
            return Cycle(True, None)
        zero = ", and leave an unbalance of zero out of the scene" if with_shaft else ""
        raise ValueError(
            f"Whether {phrase([*turning, *[SHAFT] * with_shaft])} have a common period is told by values, "
            f"which are traced here; trace other parameters than those of their rotation{zero}."
        )
    every = {name: float(period) / (2 * np.pi) for name, period in turning.items()}
    speed = system.spin.speed
    turns = not (known(speed) and float(speed) == 0)
    moving = {name: count for name, count in every.items() if count < STANDS and turns}
    if with_shaft and turns:
        moving[SHAFT] = 1.0
    if not moving:
        raise ValueError(
            f"What turns in {phrase(every)} stands, so there is no period; the rotor comes to rest, see "
            "`jaxrotor.static_positions`."
        )
    longest = max(moving.values())
    if not all(_whole(longest / count) for count in moving.values()):
        message, never = _apart(moving, what)
        if apart and never:
            return Cycle(False, 1.0, tuple(every.values()), common=False)
        raise ValueError(message)
    if with_shaft and longest > 1 + SAME:
        raise ValueError(
            f"Beside {SHAFT}, {what} takes a period of one revolution, but all forces repeat after "
            f"{round(longest)} revolutions at the earliest; {_ADVICE}."
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
    stacks = [stack for port in system.ports for stack in port.laws if stack.clock == "turns"]
    periods = jnp.concatenate([jax.vmap(lambda law: law.period)(stack) for stack in stacks])
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


def _apart(moving: dict[str, float], what: str) -> tuple[str, bool]:
    """Why the longest period is not a common one, and whether there is none at all."""
    first = max(moving, key=lambda name: moving[name])
    other = next(name for name in moving if not _whole(moving[first] / moving[name]))
    ratio = moving[other] / moving[first]
    near = Fraction(ratio).limit_denominator(MOST)
    never = abs(ratio - near) > SAME * ratio
    both = near.numerator * moving[first]
    ends = "so both never do" if never else f"so both do after {both:.9g} at the earliest"
    without = "leave unbalance out, or " if SHAFT in moving else ""
    message = (
        f"{what} needs one period of all forces, but {other} repeats after {moving[other]:.9g} "
        f"revolutions and {first} after {moving[first]:.9g}, {ends}; {without}{_ADVICE}."
    )
    return message, never
