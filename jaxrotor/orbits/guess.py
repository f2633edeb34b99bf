"""Guess: the state, period and rotation from which an orbit is sought."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from ..core.quantities import Scalar, known
from ..equations.pencil import frame
from ..equations.start import AbstractStart, shaft_of
from ..equations.system import System
from ..motion.history import TimeHistory
from ..motion.rebounds import pilot_run
from ..motion.simulate import simulate
from ..scene import Scene
from ..solvers.exponential import Exponential
from .memory import parts_of, steps_for_states
from .orbit import PeriodicOrbit
from .passes import Cycle, cycle_rate
from .recurrence import recurrence
from .symmetry import SAME, nan_unless_symmetric, symmetry_defects, symmetry_order


LEAST = 16  # steps in a period
SEARCH = 8  # revolutions from a start in which a period is sought


class OrbitGuess(eqx.Module):
    """Start, period and rotation of an orbit, before Newton's method."""

    # Coordinates [m], velocities [m/s] and states of laws:
    start: tuple[Complex[Array, " n"], Complex[Array, " n"], Float[Array, " k"]]
    rate: Scalar  # [rad/s]
    span: Scalar  # of the period [rad]; of a revolution where the period is given
    turn: Scalar  # [rad]
    revolutions: int | None = eqx.field(static=True)  # None: the period is unknown
    steps: int = eqx.field(static=True)
    # Whether `revolutions` are passes, see `Cycle`:
    passes: bool = eqx.field(static=True, default=False)
    beats: bool = eqx.field(static=True, default=False)  # whether they are beats, see `beat_of`


def start_of(guess: Any, name: str = "guess", states: int = 0) -> AbstractStart:
    """The start that an argument stands for, a guess or one of another name, with `states` of laws."""
    if isinstance(guess, TimeHistory | PeriodicOrbit):
        guess = guess.end if isinstance(guess, TimeHistory) else guess.start
    if isinstance(guess, AbstractStart):
        return shaft_of(guess, "An orbit", states)
    raise ValueError(
        f"`{name}` must be a motion of jaxrotor.simulate, an orbit or a start such as AtRest(), but is "
        f"{guess!r}."
    )


def revolutions_of(scene: Scene, system: System, guess: Any) -> int | None:
    """Revolutions in a period, None where the rotation does not determine it."""
    if isinstance(guess, PeriodicOrbit):
        return guess.revolutions
    unbalance, speed = system.load.unbalance, scene.spin.speed
    if not system.ports:
        return 1
    if known(speed) and not float(speed):
        return None
    if frame(system.blocks) != "fixed" or system.clocks:
        return 1
    if unbalance is None:
        return None
    return 1 if not known(unbalance) or bool(jnp.any(unbalance != 0)) else None


def repeated_guess(
    system: System,
    guess: Any,
    cycle: Cycle,
    revolutions: int,
    steps_per_revolution: int,
    stations: Float[Array, " s"],
) -> OrbitGuess:
    """The guess of an orbit whose period is known: of revolutions, or of passes."""
    steps = steps_per_revolution
    if cycle.passes and cycle.revolutions is not None:
        steps = max(LEAST, math.ceil(steps * cycle.revolutions * (1 - 1e-9)))
    elif cycle.passes:
        if not (isinstance(guess, PeriodicOrbit) and guess.passes):
            raise ValueError(
                "Steps are counted by the period of the forces, which is being traced here; give an "
                "orbit that `periodic` found before as the guess."
            )
        steps = guess.steps
    start = parts_of(start_of(guess, states=system.state_count), system, stations[0])
    rate, whole, none = cycle_rate(system, cycle.passes), jnp.asarray(2 * jnp.pi), jnp.zeros(())
    steps = steps_for_states(system, steps, 2 * jnp.pi / rate, guess)
    return OrbitGuess(start, rate, whole, none, revolutions, steps, cycle.passes)


def autonomous_guess(
    scene: Scene,
    system: System,
    guess: Any,
    turn: ArrayLike | None,
    period: ArrayLike | None,
    steps_per_revolution: int,
    solver: Exponential,
    stations: Float[Array, " s"],
) -> OrbitGuess:
    """The guess of an orbit of unknown period; raise where the scene or the guess shows none."""
    if not system.ports:
        raise ValueError(
            "A scene without contact is linear, so it has no period of its own to be found; look at "
            "`jaxrotor.roots`."
        )
    if isinstance(guess, PeriodicOrbit):
        turn = guess.turn if turn is None else turn
        period = guess.period if period is None else period
    elif period is None:
        period, turn = _recurrence(
            scene, system, guess, turn, steps_per_revolution, solver, stations
        )
    turn = jnp.asarray(0.0 if turn is None else turn, float)
    if system.state_count and not (
        known(turn) and abs(math.remainder(float(turn), 2 * math.pi)) < SAME
    ):
        raise ValueError(
            "States of laws do not turn with an orbit, so `turn` must be 0 in a scene that has them, but "
            f"is {turn}."
        )
    defects = symmetry_defects(scene, system, turn)
    if known(defects) and float(jnp.max(jnp.abs(defects))) > SAME:
        raise ValueError(_asymmetry(scene, system, turn))
    rate = _rate(scene, period)
    known_before = isinstance(guess, PeriodicOrbit)
    counted = (guess.scene, guess.period) if known_before else (scene, period)
    revolutions = _revolutions_in(*counted)
    steps = max(LEAST, math.ceil(steps_per_revolution * revolutions * (1 - 1e-9)))
    steps = steps_for_states(system, steps, jnp.asarray(period), guess)
    start = parts_of(start_of(guess, states=system.state_count), system, stations[0])
    span, turn = rate * jnp.asarray(period), nan_unless_symmetric(turn, defects)
    return OrbitGuess(start, rate, span, turn, None, steps)


def _recurrence(
    scene: Scene,
    system: System,
    guess: Any,
    turn: ArrayLike | None,
    steps_per_revolution: int,
    solver: Exponential,
    stations: Float[Array, " s"],
) -> tuple[float, float]:
    """Period [s] and turn [rad] after which a response, or a run from a start, returns."""
    if not isinstance(guess, TimeHistory):
        start = start_of(guess, states=system.state_count)
        at = [(scene.observed, float(x)) for x in stations] if scene.shafts else stations
        options = {"solver": None if system.state_count else solver, "start": start, "at": at}
        with pilot_run():
            guess = simulate(scene, SEARCH, steps_per_revolution, **options)
    steps = np.diff(np.asarray(guess.time)) if known(guess.time) else np.ones(1)
    if np.ptp(steps) > 1e-6 * steps.max() or guess.scene.spin.kinks is not None:
        raise ValueError(
            "The period of a guess is sought in a motion at constant speed with evenly spaced times; take "
            "one of `simulate` by revolutions, or give `period` and `turn`."
        )
    if not all(map(known, jax.tree.leaves((system, guess)))):
        raise ValueError(
            "A period is sought by values, so not inside jax.jit or a derivative; give an orbit that "
            "`periodic` found before as the guess, or `period` and `turn`."
        )
    count = 1 if system.state_count else symmetry_order(scene, system)
    given = [float(jnp.asarray(turn))] if turn is not None else None
    allowed = given or [2 * math.pi * k / count for k in range(count)]
    return recurrence(guess, float(_rate(scene, 1.0)), allowed)


def _rate(scene: Scene, period: Any) -> Scalar:
    """`|Omega|`, or at zero speed 2 pi over a period."""
    speed = scene.spin.speed
    at_rest = known(speed) and not float(speed)
    return jnp.asarray(2 * jnp.pi / period) if at_rest else jnp.abs(speed)


def _revolutions_in(scene: Scene, period: Any) -> float:
    """Revolutions in a period, 1 at zero speed; raise where the values are traced."""
    speed = scene.spin.speed
    if not (known(speed) and known(period)):
        raise ValueError(
            "Steps are counted by the period of the guess, which is being traced here; give an orbit of "
            "known values as the guess."
        )
    return abs(float(speed)) * float(period) / (2 * math.pi) or 1.0


def _asymmetry(scene: Scene, system: System, turn: Scalar) -> str:
    """Why a rotation does not leave the scene as it is."""
    unbalance, degrees = system.load.unbalance, math.degrees(float(turn))
    if unbalance is not None and bool(jnp.any(unbalance != 0)):
        return (
            "A scene with unbalance repeats itself after whole revolutions, so it takes `revolutions` "
            "and no `turn` or `period`; or set the eccentricity to 0."
        )
    if frame(system.blocks) != "fixed":
        return (
            "A shaft of unequal axes repeats itself after whole revolutions, so it takes `revolutions` "
            "and no `turn` or `period`."
        )
    count = symmetry_order(scene, system)
    same = f"a turn of {360 / count:g} degrees" if count > 1 else "whole turns alone"
    return (
        f"`turn` must leave the scene as it is, but one of {degrees:g} degrees does not: stops that are "
        f"equal but for their angles, weight and unequal supports allow {same}."
    )
