"""Memory: states of laws in orbits, such as those of controllers, beside coordinates and velocities.

They are part of what returns after a period, of its multipliers and of disturbances. What only grows, as
wear does, has no orbit.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..core.quantities import Scalar, known
from ..equations.start import AbstractStart, Continued, Launch, states_of
from ..equations.system import System, phrase, state_names
from ..motion.revolutions import March
from ..motion.speeds import rate_of_states
from ..scene import Scene
from .orbit import PeriodicOrbit


def steps_for_states(system: System, steps: int, length: Scalar, guess: Any = None) -> int:
    """Steps in a `length` of time [s] that follow what states of laws do by themselves, at least `steps`.

    Where values are traced they are as many as those of a `guess` that is an orbit.
    """
    if not system.state_count:
        return steps
    if all(map(known, jax.tree.leaves((system, length)))):
        return max(steps, math.ceil(float(length) * rate_of_states(system)))
    if isinstance(guess, PeriodicOrbit):
        return max(steps, guess.steps)
    raise ValueError(
        "Steps are counted by the rates of the states of laws, which are being traced here; give an orbit "
        "that `periodic` found before as the guess."
    )


def parts_of(
    start: AbstractStart, system: System, at: Scalar
) -> tuple[Complex[Array, " n"], Complex[Array, " n"], Float[Array, " k"]]:
    """Coordinates [m], velocities [m/s] and states of laws in a start."""
    return *start.state(system, at), states_of(start, system)


def state_in(march: March, y: Array) -> tuple[Array, Array, Float[Array, " k"]]:
    """Coordinates [m], velocities [m/s] and states of laws of a state at a whole revolution."""
    q, velocity, *others = march.decode(y)
    return q, velocity, others[2] if others else jnp.zeros(0)


def start_on(
    q: Complex[Array, " n"], velocity: Complex[Array, " n"], states: Float[Array, " k"]
) -> Continued | Launch:
    """The start of coordinates [m], their velocities [m/s] and states of laws."""
    shaft = Continued(q, velocity)
    return Launch(shaft, states=states) if states.size else shaft


def named_samples(scene: Scene, states: Any) -> dict[str, Float[Array, " T"]]:
    """States of laws at the samples of an orbit, (T, k) or None without any, by their names."""
    columns = () if states is None else jnp.moveaxis(jnp.asarray(states), -1, 0)
    return dict(zip(state_names(scene), columns, strict=True))


def one_way_states(scene: Scene, states: Float[np.ndarray, "T k"], *, lasting: bool = False) -> str:
    """Names of the states that change in one sense alone, as a phrase, see `go_one_way`."""
    found = go_one_way(states, lasting=lasting)
    return phrase(name for name, goes in zip(state_names(scene), found, strict=True) if goes)


def go_one_way(
    states: Float[np.ndarray, "... T k"], *, lasting: bool = False
) -> Bool[np.ndarray, "... k"]:
    """Whether states change in one sense alone.

    `lasting`: in the last half as much as in the first, so that they do not settle.
    """
    changes = np.diff(states, axis=-2)
    half = changes.shape[-2] // 2
    parts = changes[..., :half, :], changes[..., -half:, :]
    early, late = (np.abs(part.sum(axis=-2)) for part in parts)
    found = np.all(changes >= 0, axis=-2) | np.all(changes <= 0, axis=-2)
    return found & (late > early / 2 if lasting else early + late > 0)


def check_returning(scene: Scene, states: Float[np.ndarray, "R k"]) -> None:
    """Raise if a state of a law, at the ends of revolutions, goes on in one sense."""
    if names := one_way_states(scene, states, lasting=True):
        raise ValueError(
            f"The motion does not return, as a state of a law ({names}) goes on in one sense: take a "
            "longer `settle`, or, where it can only grow, as wear does, follow the motion by "
            "`jaxrotor.simulate`."
        )
