"""Beat: the time after which the unbalance of several shafts has the same relative angles again.

    T = 2 pi / |Omega_k - Omega_j|,    z(t + T) = e^(i Omega_j T) z(t)

In a scene that a rotation leaves as it is, only angles between shafts count, so that motions may repeat
after a beat, turned, whatever the ratio of speeds.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.checks import check_counts
from ..core.quantities import Scalar, known
from ..equations.clocks import rate_of
from ..equations.system import System, phrase
from ..motion.history import TimeHistory
from ..scene import Scene
from .guess import LEAST, OrbitGuess, start_of
from .memory import parts_of, steps_for_states
from .shooting import without_unbalance
from .symmetry import SAME, nan_unless_symmetric, symmetry_defects, symmetry_order


NEAR = 0.3  # of the angles between shafts in a guess from those of a section [rad]
MOST = 24  # beats that are looked through for one that leaves a scene as it is


def beat_of(system: System, beats: int) -> tuple[Scalar, Scalar]:
    """Angle of the first shaft in some beats, and the turn by which a motion returns after them [rad].

    Where one shaft alone has unbalance a beat is its revolution, and the turn is 0.
    """
    first, *others = _turning(system)
    apart = others[0] - first if others else first
    apart = jnp.where(apart == 0, first, apart)  # shafts of one speed, which beat once a revolution
    span = 2 * jnp.pi * beats / jnp.abs(apart)
    return span, first * span if others else jnp.zeros(())


def beat_guess(
    scene: Scene,
    system: System,
    guess: Any,
    beats: int,
    steps_per_revolution: int,
    stations: Float[Array, " s"],
) -> OrbitGuess:
    """The guess of an orbit over a beat of shafts with unbalance; raise where there is none."""
    rate = jnp.abs(system.spin.speed)
    span, turn, defects = checked_beat(scene, system, beats)
    if not known(span):
        raise ValueError(
            "Steps are counted by the beat of the shafts, which is being traced here; trace other "
            "parameters than speeds, or take differences."
        )
    fastest = max(1.0, *(abs(float(one)) for one in _turning(system)))
    steps = max(LEAST, math.ceil(steps_per_revolution * fastest * float(span) / (2 * math.pi)))
    steps = steps_for_states(system, steps, span / rate, guess)
    turn = nan_unless_symmetric(turn, defects)
    if isinstance(guess, TimeHistory):
        start = _in_section(scene, system, guess)
    else:
        start = parts_of(start_of(guess, states=system.state_count), system, stations[0])
    return OrbitGuess(start, rate, span, turn, beats, steps, beats=True)


def checked_beat(
    scene: Scene, system: System, beats: int
) -> tuple[Scalar, Scalar, Float[Array, " d"]]:
    """Angle and turn of `beat_of`, and what the turn changes of the scene; raises where it does."""
    _check(scene, system)
    _check_two(system)
    span, turn = beat_of(system, beats)
    defects = symmetry_defects(scene, without_unbalance(system), turn)
    if known(defects) and float(jnp.max(jnp.abs(defects))) > SAME:
        raise ValueError(_asymmetry(scene, system, beats, float(turn)))
    return span, turn, defects


def check_period(revolutions: Any, beats: Any, turn: Any, period: Any) -> None:
    """Raise unless the period of shafts with unbalance is given by beats or by revolutions alone."""
    if turn is not None or period is not None or beats is not None and revolutions is not None:
        raise ValueError(
            "Where several shafts have unbalance the period is a number of `beats` or of `revolutions`, "
            "one of them, without `turn` and `period`."
        )
    check_counts(**{"beats": 1 if beats is None else beats})


def check_revolutions(scene: Scene, system: System, revolutions: int) -> None:
    """Raise unless every shaft with unbalance makes whole turns in some revolutions of the first one."""
    _check(scene, system)
    for other, turns in zip(system.others, _turning(system)[-len(system.others) :], strict=True):
        if not known(turns):
            raise ValueError(
                f"Whether the shaft {other.name!r} makes whole turns in {revolutions} revolutions is told "
                "by its speed, which is traced here; trace other parameters."
            )
        count = float(turns) * revolutions
        if abs(count - round(count)) > SAME * max(1.0, abs(count)):
            raise ValueError(
                f"In {revolutions} revolutions of the first shaft {other.name!r} turns {count:.9g} "
                "times, which is not whole, so no motion repeats after them; leave `revolutions` out "
                "for a motion that repeats after a beat, or take `jaxrotor.torus`."
            )


def _turning(system: System) -> list[Scalar]:
    """Speeds of the shafts with unbalance over that of the first one."""
    rate = jnp.abs(system.spin.speed)
    own = [] if system.load.unbalance is None else [jnp.sign(system.spin.speed)]
    return own + [rate_of(one, system.spin.speed, rate) for one in system.others]


def _check(scene: Scene, system: System) -> None:
    """Raise where shafts have no beat: at rest, or beside laws that turn."""
    if known(scene.spin.speed) and not float(scene.spin.speed):
        raise ValueError(
            f"The first shaft, {scene.name!r}, is at rest, so its revolutions have no length; name "
            "another one first."
        )
    if system.clocks:
        raise ValueError(
            f"An orbit of several shafts with unbalance is for forces that do not turn, but those of "
            f"{system.laws_with(lambda law: law.clock)} do; follow the motion by `jaxrotor.simulate`."
        )


def _check_two(system: System) -> None:
    """Raise unless two shafts at most have unbalance, as a beat is of two."""
    if len(_turning(system)) > 2:
        names = phrase(one.name for one in system.others)
        raise ValueError(
            f"A beat is of two shafts with unbalance, but beside the first one {names} have some; give "
            "`revolutions` in which all make whole turns, or take `jaxrotor.torus`."
        )


def _asymmetry(scene: Scene, system: System, beats: int, turn: float) -> str:
    """Why a motion does not return turned after a beat, and what to do."""
    still = without_unbalance(system)
    for count in range(beats + 1, MOST):
        defects = symmetry_defects(scene, still, jnp.asarray(turn * count / beats))
        if float(jnp.max(jnp.abs(defects))) < SAME:
            advice = f"give `beats={count}`"
            break
    else:
        advice = "give `revolutions` where the ratio is rational, or take `jaxrotor.torus`"
    degrees = math.degrees(math.remainder(turn, 2 * math.pi))
    after = "a beat" if beats == 1 else f"{beats} beats"
    return (
        f"After {after} the unbalance of all shafts is what it was but for a turn by {degrees:.6g} "
        f"degrees, which does not leave stops, weight or unequal supports as they are; {advice}."
    )


def _in_section(
    scene: Scene, system: System, guess: TimeHistory
) -> tuple[Complex[Array, " n"], Complex[Array, " n"], Float[Array, " k"]]:
    """The sample of a motion nearest to the section at which all angles are zero, turned back to it."""
    if not all(map(known, jax.tree.leaves((system, guess)))):
        raise ValueError(
            "The sample of a guess at which the shafts have their first angles is chosen by values, which "
            "are traced here; give an orbit that `periodic` found before as the guess."
        )
    if system.state_count:
        return parts_of(start_of(guess, states=system.state_count), system, guess.stations[0])
    still = without_unbalance(system)
    any_turn = symmetry_defects(scene, still, jnp.asarray(1.0))
    angle, speed = np.asarray(guess.angle), float(system.spin.speed)
    turns = (
        (angle / speed)[:, None] * abs(speed) * np.array([float(one) for one in _turning(system)])
    )
    off = np.abs(np.exp(1j * (turns[:, 1:] - turns[:, :1])) - 1).sum(axis=1)
    if float(jnp.max(jnp.abs(any_turn))) > SAME:  # the first angle counts, too
        count = symmetry_order(scene, still)
        off = off + np.abs(np.exp(1j * count * turns[:, 0]) - 1)
    nearest = int(np.argmin(off))
    if off[nearest] > NEAR:
        raise ValueError(
            "The guess has no time at which the shafts stand to each other as they did at the start; "
            "simulate some beats more, with more samples, or give a start."
        )
    back = np.exp(-1j * turns[nearest, 0])
    q, velocity = guess.coordinates[nearest], guess.rates[nearest]
    return back * q, back * velocity, jnp.zeros(0)
