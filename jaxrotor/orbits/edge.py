"""Edge: the boundary between the basins of two motions, and the orbit on it."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core import linalg
from ..core.checks import check_counts
from ..core.progress import progress as bar
from ..equations.start import Continued
from ..scene import Scene
from ..solvers.exponential import Exponential
from .orbit import PeriodicOrbit
from .periodic import periodic
from .two_motions import APART, TwoMotions


PERIODS = 8  # revolutions after which the motion on the boundary may return


class Edge(eqx.Module):
    """The orbit on the boundary between the basins of two motions, and where a line crosses it."""

    orbit: PeriodicOrbit  # unstable, with one multiplier outside of the unit circle
    share: float | int  # of the way from the first state to the second, at which the basin changes
    # States on both sides of the orbit, beside it along its unstable direction; the first leads to the
    # first motion, the second to the other one:
    sides: tuple[Continued, Continued]
    crossing: Continued  # the state at `share`, on the first side of the boundary

    def __str__(self) -> str:
        return f"Edge at {self.share:.6g} of the way between both states; on it: {self.orbit}"


def edge(
    scene: Scene,
    a: Any,
    b: Any,
    *,
    revolutions: int = 200,
    rounds: int = 8,
    steps_per_revolution: int = 128,
    solver: Exponential | None = None,
    at: Any = None,
    progress: bool | None = None,
) -> Edge:
    """The motion on the boundary between the basins of the motions to which two states lead.

        a + s (b - a),    s: followed until it whirls as a does, or as b does

    The interval in which the outcome changes is divided by 17 until it is narrow. Both of its ends stay
    beside the boundary, and on it come near the motion that attracts there, until they part; then the
    interval between them is divided anew. The orbit near them, found by Newton's method, has one
    multiplier outside of the unit circle: its stable manifold is the boundary.

    Args:
        scene: the rotor, at constant speed; its laws have no states.
        a: state to begin with, end of a `TimeHistory`, or an orbit.
        b: another, which leads to another motion; the two differ by their rms radius or whirl rate at
            the station that is observed.
        revolutions: after which it is decided where a state leads; up to six times as many if it is not.
        rounds: times that the interval is divided anew until the orbit is found.
        steps_per_revolution: of all runs and of the orbit.
        solver: `Exponential(4, located=True)` by default.
        at: station to observe [m], as in `simulate`.
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        An `Edge`; its orbit is differentiable as that of `periodic`, which takes it as a guess.

    Raises:
        ValueError: if an argument is out of its range or of another type, the speed is not constant, or
            both states lead to the same motion.
        RuntimeError: if a state between them leads to a third motion or to none, or the motion on the
            boundary is no orbit of up to eight revolutions with one unstable multiplier.

    Source: Skufca, Yorke, Eckhardt (2006), Physical Review Letters 96, 174101.
    """
    check_counts(revolutions=revolutions, rounds=rounds, steps_per_revolution=steps_per_revolution)
    solver = Exponential(4, located=True) if solver is None else solver
    with bar(progress, rounds, "motion on the boundary", "rounds") as tick:
        runs = TwoMotions.of(scene, a, b, revolutions, steps_per_revolution, solver, at)
        first, last = runs.begins
        low, high = runs.bracket(first, last)
        way = last - first
        share, crossing = float((low - first) @ way / (way @ way)), runs.start_at(low)
        for _ in range(rounds):
            beside = runs.beside(low, high)
            if (found := _orbit_near(runs, beside)) is not None:
                return Edge(found[0], share, found[1], crossing)
            low, high = runs.bracket(*beside[-1])
            tick(1)
    raise RuntimeError(
        f"The motion on the boundary settled on no orbit of up to {PERIODS} revolutions with one unstable "
        f"multiplier in {rounds} rounds: give more `rounds`; it may be quasi-periodic or chaotic."
    )


def _orbit_near(
    runs: TwoMotions, beside: Float[Array, "T 2 m"]
) -> tuple[PeriodicOrbit, tuple[Continued, Continued]] | None:
    """The orbit near which both ends of a bracket come, and states on both sides; None without one."""
    middle = beside.mean(axis=1)
    returns = {
        n: np.asarray(linalg.norm(middle[n:] - middle[:-n], axis=-1))
        for n in range(1, min(PERIODS, len(middle) - 1) + 1)
    }
    if not returns:
        return None
    best = min(one.min() for one in returns.values())
    count = next(n for n, one in returns.items() if one.min() <= 2 * best)
    plan: Any = runs.march.plan
    found = periodic(
        runs.scene,
        runs.start_at(middle[returns[count].argmin()]),
        revolutions=count,
        steps_per_revolution=plan.steps,
        solver=plan.solver,
        throw=False,
        progress=False,
    )
    if not bool(found.converged) or int((jnp.abs(found.multipliers) > 1).sum()) != 1:
        return None
    way = beside[-1, 1] - beside[-1, 0]
    step = APART * runs.width * way / linalg.norm(way)
    own = runs.state_of(found.start)
    sides = jnp.stack([own - step, own + step])
    if runs.lead_to_other(sides).tolist() != [False, True]:
        return None
    return found, (runs.start_at(sides[0]), runs.start_at(sides[1]))
