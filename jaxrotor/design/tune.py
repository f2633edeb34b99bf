"""Tune: parameters of a scene that minimise a loss, by its gradients."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import check_counts
from ..core.parallel import cores, spread
from ..core.progress import progress as bar
from ..core.quantities import Scalar
from ..core.tables import notebook_table
from ..equations.shared_nodes import with_shared_nodes
from ..scene import Scene
from .bounds import Bounds, bounds, check_paths
from .descent import AbstractDescent, descent
from .iterates import FLAT, Iterates
from .target import Constraints, Evaluation, augmented, evaluator, loss_and_constraints, shape_of


class History(eqx.Module):
    """The iterates of each of `s` starts at up to `k` steps; NaN after it stopped."""

    loss: Float[np.ndarray, "s k"]
    values: dict[str, Float[np.ndarray, "s k"]]  # of the parameters, SI
    gradient: Float[np.ndarray, "s k"]  # norm by free numbers, constraints included
    excess: dict[str, Float[np.ndarray, "s k"]]  # of the constraints


class Tuned(eqx.Module):
    """The best parameters found, and how `s` starts led to them."""

    scene: Scene
    values: dict[str, Scalar]  # of the parameters, SI
    loss: Scalar  # a sum of squares where the loss returns residuals
    excess: dict[str, Scalar]  # of the constraints, violated above zero
    multipliers: dict[str, Scalar]  # increase of the loss by a unit of each constraint
    history: History
    start: int = eqx.field(static=True)  # that led to the best
    reasons: tuple[str, ...] = eqx.field(static=True)  # why each start stopped
    optimiser: str = eqx.field(static=True)
    seed: int = eqx.field(static=True)

    @property
    def reason(self) -> str:
        """Why the best start stopped."""
        return self.reasons[self.start]

    @property
    def steps(self) -> int:
        """Number of steps of the best start."""
        return int(np.isfinite(self.history.loss[self.start]).sum())

    def _repr_html_(self) -> str:
        rows: list[tuple] = [
            (path, value, self.history.values[path][self.start, 0], self.scene.unit(path))
            for path, value in self.values.items()
        ]
        rows += [
            (name, excess, None, f"at most 0; multiplier {float(self.multipliers[name]):.4g}")
            for name, excess in self.excess.items()
        ]
        return notebook_table(str(self).split("\n")[0], ("", "found", "at the start", "unit"), rows)

    def __str__(self) -> str:
        found = f"Loss {float(self.loss):.6g} after {self.steps} steps of {self.optimiser}: {self.reason}"
        if len(self.reasons) > 1:
            found += f"; start {self.start} of {len(self.reasons)}, seed {self.seed}"
        lines = [found]
        for path, value in self.values.items():
            unit = self.scene.unit(path)
            number = f"{float(value):.9g}" + ("" if unit == "1" else f" {unit}")
            first = self.history.values[path][self.start, 0]
            lines.append(f"  {path} = {number}, from {first:.6g}")
        for name, excess in self.excess.items():
            cost = float(self.multipliers[name])
            lines.append(f"  {name}: {float(excess):.3g} (at most 0), multiplier {cost:.4g}")
        return "\n".join(lines)


def tune(
    loss: Callable[[Scene], Any],
    scene: Scene,
    where: Mapping[str, Any],
    *,
    optimiser: Any = None,
    steps: int = 300,
    starts: int = 1,
    seed: int = 0,
    constraints: Sequence[Any] = (),
    tolerance: float | int = 1e-10,
    mode: str = "forward",
    progress: bool | None = None,
) -> Tuned:
    """`min f(x)` subject to `c(x) <= 0` and `low < x < high`, `x` the parameters at some paths.

        f + sum rho / 2 max(0, c + lambda / rho)^2,   lambda <- max(0, lambda + rho c)

    Constraints are met by this augmented Lagrangian, bounds by `x = low + (high - low) s(u)` with a
    sigmoid `s`, of `log x` where both are positive and more than a decade apart. An optimum on a bound
    is approached, not reached. Every start keeps its best iterate, since losses with a kink chatter
    about it.

    Args:
        loss: function of a scene that returns a number, or residuals whose squares are summed. It is
            traced; `jaxrotor.objectives` say where they are smooth.
        scene: the rotor, whose own values are start 0.
        where: bounds by parameter path, `{"limiters.stiffness": (1e5, 1e8)}`; None for none.
        optimiser: an optax transformation, or a solver of optimistix that uses gradients. By default
            `LevenbergMarquardt` for residuals, else `BFGS`: on a smooth loss of few parameters that
            takes a tenth of the steps of `optax.adam`, which in turn is safer where a loss is noisy.
            For solvers of optimistix the loss is divided by the norm of its gradient at the start, and
            they stop as `tolerance` says.
        steps: greatest number of steps, each one evaluation of loss and derivatives.
        starts: number of starts: the scene's own values, and more by a Latin hypercube within the
            bounds. On a CPU each start runs in a thread, one a core, which is as fast as all at once. On
            an accelerator all are one program.
        seed: of these starts.
        constraints: pairs of a name and a function of a scene that must not be above zero.
        tolerance: of a step in the free numbers `u`, and of the gradient over its largest. A loss that
            is not zero at its minimum has no digits for steps below 1e-8; residuals have.
        mode: of derivatives; "forward" costs one motion a parameter, "reverse" suits many parameters
            and losses that run backward (of a motion, with a diffrax `adjoint` that does).
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        A `Tuned`, of the start with the least loss among those that meet the constraints.

    Raises:
        ValueError: if an argument is out of its range, a path is not a single number within its bounds,
            loss or constraints return anything but real numbers or are not finite at the first start, or
            the loss depends on no parameter at any start.

    Source: Nocedal, Wright (2006), Numerical Optimization, sections 6.1, 10.3, 17.4.
    """
    check_counts(steps=steps, starts=starts)
    if mode not in ("forward", "reverse"):
        raise ValueError(f"`mode` must be 'forward' or 'reverse', but is {mode!r}.")
    if not 0 < tolerance < 1:
        raise ValueError(f"`tolerance` must be between 0 and 1, but is {tolerance!r}.")
    pairs = _checked(constraints)
    check_paths(where, "where")
    limits = bounds(scene, where)
    scene = with_shared_nodes(scene, where)
    for name, excess in pairs:
        shape_of(excess, f"Constraint {name!r}", scene, limits)
    squares = bool(shape_of(loss, "`loss`", scene, limits))
    how = descent(optimiser, squares, tolerance)
    own = limits.numbers([np.ravel(scene.get(path))[0] for path in where])
    numbers = np.concatenate([own[None], limits.drawn(starts - 1, seed)])
    all_starts = [Iterates(u, len(pairs), squares, tolerance, how.restarts) for u in numbers]
    evaluate = evaluator(loss_and_constraints(loss, pairs, scene, limits), mode == "reverse")
    run = _Run(evaluate, how, squares)
    workers = cores(None)
    size = 1 if jax.default_backend() == "cpu" else starts
    chunks = [all_starts[i : i + size] for i in range(0, starts, size)]
    with bar(progress, starts * steps, "tuning", "steps") as tick:
        _check_first([one for chunk in chunks for one in run.scale(chunk)], limits, pairs)
        spread(lambda chunk, tick: run(chunk, steps, tick), chunks, workers, tick)
    return _tuned(scene, limits, pairs, all_starts, how.name, seed)


class _Run:
    """The compiled step of some starts, and the loop over it."""

    def __init__(
        self, evaluate: Callable[[Array], Evaluation], how: AbstractDescent, squares: bool
    ):
        def target(weights):
            def of(u):
                evaluation = evaluate(u)
                return augmented(evaluation, weights, squares, how.residuals), evaluation

            return of

        def begin(case):
            u, weights = case
            return _strong(how.begin(target(weights), u))

        def step(case):
            u, state, weights, changed = case
            if how.restarts:
                first = how.begin(target(weights), u)
                state = jax.tree.map(lambda new, old: jnp.where(changed, new, old), first, state)
            return _strong(how.step(target(weights), u, state))

        each = jax.vmap if jax.default_backend() != "cpu" else _alone
        self.begin, self.step = jax.jit(each(begin)), jax.jit(each(step))

    def scale(self, chunk: list[Iterates]) -> list[Evaluation]:
        """Set the scales of all starts from their first evaluations, which are returned."""
        u, state = self._begun(chunk)
        found: Any = jax.device_get(self._stepped(chunk, u, state).evaluation)
        evaluations: Any = [Evaluation(*pair) for pair in zip(*found, strict=True)]
        for iterates, evaluation in zip(chunk, evaluations, strict=True):
            iterates.scale_by(evaluation)
        return evaluations

    def __call__(self, chunk: list[Iterates], steps: int, tick: Callable[[int], None]) -> None:
        """Step until all starts have a reason to stop."""
        u, state = self._begun(chunk)
        for _ in range(steps):
            done = self._stepped(chunk, u, state)
            u, state = done.next, done.state
            found: Any = jax.device_get((done.at, *done.evaluation, done.change))
            for iterates, *one in zip(chunk, *found, strict=True):
                if not iterates.reason:
                    iterates.add(*one)
            tick(len(chunk))
            if all(iterates.reason for iterates in chunk):
                break
        for iterates in chunk:
            iterates.reason = iterates.reason or "steps used up"

    def _begun(self, chunk: list[Iterates]) -> tuple[Array, Any]:
        u = jnp.asarray(np.stack([iterates.first for iterates in chunk]))
        return u, self.begin((u, _stacked([iterates.weights for iterates in chunk])))

    def _stepped(self, chunk: list[Iterates], u: Array, state: Any) -> Any:
        weights = _stacked([iterates.weights for iterates in chunk])
        changed = jnp.asarray([iterates.changed for iterates in chunk])
        return self.step((u, state, weights, changed))


def _alone(call: Callable) -> Callable:
    """`jax.vmap` for one lane, without its batching."""
    lane = lambda case: call(jax.tree.map(lambda leaf: leaf[0], case))
    return lambda case: jax.tree.map(lambda leaf: leaf[None], lane(case))


def _strong(tree: Any) -> Any:
    """Arrays without weak types, for which a program would be compiled again."""
    return jax.tree.map(lambda leaf: leaf.astype(leaf.dtype), tree)


def _stacked(trees: list) -> Any:
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def _checked(constraints: Sequence[Any]) -> Constraints:
    """Constraints as pairs of a name and a function; raise unless they are, and the names differ."""
    for pair in constraints:
        good = isinstance(pair, tuple | list) and len(pair) == 2
        if not good or not isinstance(pair[0], str) or not callable(pair[1]):
            raise ValueError(
                "Each of `constraints` must be a name and a function of a scene, such as "
                f"('peak', lambda scene: ..), but one is {pair!r}."
            )
    names = [name for name, _ in constraints]
    if len(set(names)) < len(names):
        raise ValueError(
            f"Each of `constraints` must have a name of its own, but they are {names}."
        )
    return tuple((name, excess) for name, excess in constraints)


def _check_first(first: list[Evaluation], limits: Bounds, constraints: Constraints) -> None:
    """Raise unless the first start is finite, and the loss depends on a parameter at some start."""
    count = len(first[0].values) - len(constraints)
    names = ["The loss"] * count + [f"Constraint {name!r}" for name, _ in constraints]
    for name, value, slope in zip(names, *first[0], strict=True):
        if not np.isfinite(value):
            raise ValueError(
                f"{name} is {value} at the scene's own values, the first start; begin where it is finite."
            )
        if not np.isfinite(slope).all():
            path = limits.paths[int(np.argmin(np.isfinite(slope)))]
            raise ValueError(
                f"{name} has no derivative by `{path}` at the scene's own values, the first start; begin "
                "elsewhere, or take a loss that is smooth there."
            )
    own = ((one.values[:count, None], one.slopes[:count]) for one in first)
    if not any(np.any(np.abs(slopes) > FLAT * np.abs(values)) for values, slopes in own):
        where = " or ".join(f"`{path}`" for path in limits.paths)
        raise ValueError(
            f"The loss does not change with {where} at any start: it does not depend on them, or is flat "
            "there; begin elsewhere, or take another loss."
        )


def _tuned(
    scene: Scene,
    limits: Bounds,
    constraints: Constraints,
    all_starts: list[Iterates],
    optimiser: str,
    seed: int,
) -> Tuned:
    start = min(range(len(all_starts)), key=lambda i: all_starts[i].merit)
    best = all_starts[start]
    u, loss, excess = best.best
    values = dict(zip(limits.paths, limits.values(jnp.asarray(u)), strict=True))
    names = [name for name, _ in constraints]
    rows = lambda found, width: np.reshape(found, (len(found), width))
    parameters: Any = jax.vmap(limits.values)
    numbers = [np.asarray(parameters(rows(one.numbers, len(u)))) for one in all_starts]
    over = [rows(one.excess, len(names)) for one in all_starts]
    history = History(
        _padded([one.losses for one in all_starts]),
        {path: _padded([x[:, i] for x in numbers]) for i, path in enumerate(limits.paths)},
        _padded([one.gradients for one in all_starts]),
        {name: _padded([x[:, i] for x in over]) for i, name in enumerate(names)},
    )
    return Tuned(
        scene=scene.replace(values),
        values=values,
        loss=jnp.asarray(loss),
        excess=dict(zip(names, map(jnp.asarray, excess), strict=True)),
        multipliers=dict(zip(names, map(jnp.asarray, best.multipliers), strict=True)),
        history=history,
        start=start,
        reasons=tuple(one.reason for one in all_starts),
        optimiser=optimiser,
        seed=seed,
    )


def _padded(rows: list) -> Float[np.ndarray, "s k"]:
    """Rows of unequal length as one array, NaN at their ends."""
    rows, longest = [np.asarray(row, float) for row in rows], max(map(len, rows))
    return np.stack([np.pad(row, (0, longest - len(row)), constant_values=np.nan) for row in rows])
