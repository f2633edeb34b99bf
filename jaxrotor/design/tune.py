"""Tune: parameters of a scene by gradients of a loss."""

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
from ..scene import Scene
from .bounds import Bounds, bounds
from .course import FLAT, Course
from .descent import AbstractDescent, descent
from .target import Constraints, Look, augmented, lookout, pieces, shape_of


class History(eqx.Module):
    """What each of `s` starts has seen at up to `k` steps; NaN after it stopped."""

    loss: Float[np.ndarray, "s k"]
    values: dict[str, Float[np.ndarray, "s k"]]  # of the parameters, SI
    gradient: Float[np.ndarray, "s k"]  # norm by free numbers, constraints included
    excess: dict[str, Float[np.ndarray, "s k"]]  # of the constraints


class Tuned(eqx.Module):
    """The best that was found, and how; `s` starts."""

    scene: Scene
    values: dict[str, Scalar]  # of the parameters, SI
    loss: Scalar  # a sum of squares where the loss returns residuals
    excess: dict[str, Scalar]  # of the constraints, above zero violated
    multipliers: dict[str, Scalar]  # what a unit of each constraint costs in loss
    history: History
    start: int = eqx.field(static=True)  # that the best came from
    reasons: tuple[str, ...] = eqx.field(static=True)  # why each start stopped
    optimiser: str = eqx.field(static=True)
    seed: int = eqx.field(static=True)

    @property
    def reason(self) -> str:
        """Why the best start stopped."""
        return self.reasons[self.start]

    @property
    def steps(self) -> int:
        """Steps that the best start took."""
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
    is approached, not reached. Every start keeps the best it has seen, since losses with a kink chatter
    about it.

    Args:
        loss: of a scene, a number, or residuals whose squares are summed. It is traced: see
            `jaxrotor.objectives`, which say where they are smooth.
        scene: the rotor, and start 0.
        where: bounds by parameter path, `{"limiters.stiffness": (1e5, 1e8)}`; None for none.
        optimiser: an optax transformation, or a solver of optimistix that goes by gradients. By default
            `LevenbergMarquardt` for residuals, else `BFGS`: on a smooth loss of few parameters that
            takes a tenth of the steps of `optax.adam`, which in turn is safer where a loss is noisy.
            Solvers of optimistix see the loss over the norm of its gradient at the start, and stop as
            `tolerance` says.
        steps: at most, each one look at loss and derivatives.
        starts: the scene's own values, and more by a Latin hypercube in the bounds. On a CPU each start
            runs in a thread, one a core, which is as fast as all at once. On an accelerator all are
            one program.
        seed: of these starts.
        constraints: pairs of a name and a function of a scene that must not be above zero.
        tolerance: of a step in the free numbers `u`, and of the gradient over its largest. A loss that
            is not zero at its least has no digits for steps below 1e-8; residuals have.
        mode: of derivatives; "forward" costs one motion a parameter, "reverse" suits many parameters
            and losses that run backward (of a motion, with a diffrax `adjoint` that does).
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        A `Tuned`, of the start with the least loss among those that meet the constraints.

    Source: Nocedal, Wright (2006), Numerical Optimization, sections 6.1, 10.3, 17.4.
    """
    check_counts(steps=steps, starts=starts)
    if mode not in ("forward", "reverse"):
        raise ValueError(f"`mode` must be 'forward' or 'reverse', but is {mode!r}.")
    if not 0 < tolerance < 1:
        raise ValueError(f"`tolerance` must be between 0 and 1, but is {tolerance!r}.")
    pairs = _checked(constraints)
    limits = bounds(scene, where)
    for name, excess in pairs:
        shape_of(excess, f"Constraint {name!r}", scene, limits)
    squares = bool(shape_of(loss, "`loss`", scene, limits))
    how = descent(optimiser, squares, tolerance)
    own = limits.numbers([np.ravel(scene.get(path))[0] for path in where])
    numbers = np.concatenate([own[None], limits.drawn(starts - 1, seed)])
    courses = [Course(u, len(pairs), squares, tolerance, how.restarts) for u in numbers]
    run = _Run(lookout(pieces(loss, pairs, scene, limits), mode == "reverse"), how, squares)
    workers = cores(None)
    size = 1 if jax.default_backend() == "cpu" else starts
    chunks = [courses[i : i + size] for i in range(0, starts, size)]
    with bar(progress, starts * steps, "tuning", "steps") as tick:
        _check_first([look for chunk in chunks for look in run.measure(chunk)], limits, pairs)
        spread(lambda chunk, tick: run(chunk, steps, tick), chunks, workers, tick)
    return _tuned(scene, limits, pairs, courses, how.name, seed)


class _Run:
    """The compiled step of some starts, and their way."""

    def __init__(self, look: Callable[[Array], Look], how: AbstractDescent, squares: bool):
        def target(weights):
            def of(u):
                seen = look(u)
                return augmented(seen, weights, squares, how.residuals), seen

            return of

        def begin(case):
            u, weights = case
            return _strong(how.begin(target(weights), u))

        def step(case):
            u, state, weights, fresh = case
            if how.restarts:
                again = how.begin(target(weights), u)
                state = jax.tree.map(lambda new, old: jnp.where(fresh, new, old), again, state)
            return _strong(how.step(target(weights), u, state))

        each = jax.vmap if jax.default_backend() != "cpu" else _alone
        self.begin, self.step = jax.jit(each(begin)), jax.jit(each(step))

    def measure(self, chunk: list[Course]) -> list[Look]:
        """What is seen at the start of every course."""
        u, state = self._begun(chunk)
        seen = self._stepped(chunk, u, state).seen
        looks: Any = [Look(*pair) for pair in zip(*jax.device_get(seen), strict=True)]
        for course, look in zip(chunk, looks, strict=True):
            course.measure(*look)
        return looks

    def __call__(self, chunk: list[Course], steps: int, tick: Callable[[int], None]) -> None:
        """Steps until all starts have a reason to stop."""
        u, state = self._begun(chunk)
        for _ in range(steps):
            done = self._stepped(chunk, u, state)
            u, state = done.next, done.state
            seen: Any = jax.device_get((done.at, *done.seen, done.ahead))
            for course, *found in zip(chunk, *seen, strict=True):
                if not course.reason:
                    course.look(*found)
            tick(len(chunk))
            if all(course.reason for course in chunk):
                break
        for course in chunk:
            course.reason = course.reason or "steps used up"

    def _begun(self, chunk: list[Course]) -> tuple[Array, Any]:
        u = jnp.asarray(np.stack([course.first for course in chunk]))
        return u, self.begin((u, _stacked([course.weights for course in chunk])))

    def _stepped(self, chunk: list[Course], u: Array, state: Any) -> Any:
        weights = _stacked([course.weights for course in chunk])
        return self.step((u, state, weights, jnp.asarray([course.fresh for course in chunk])))


def _alone(call: Callable) -> Callable:
    """`jax.vmap` for one lane, less its batching."""
    lane = lambda case: call(jax.tree.map(lambda leaf: leaf[0], case))
    return lambda case: jax.tree.map(lambda leaf: leaf[None], lane(case))


def _strong(tree: Any) -> Any:
    """Arrays less their weak types, for which a program would be compiled again."""
    return jax.tree.map(lambda leaf: leaf.astype(leaf.dtype), tree)


def _stacked(trees: list) -> Any:
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def _checked(constraints: Sequence[Any]) -> Constraints:
    """Pairs of names, each its own, and functions."""
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


def _check_first(looks: list[Look], limits: Bounds, constraints: Constraints) -> None:
    """Refuse what cannot be tuned from the scene's own values."""
    count = len(looks[0].values) - len(constraints)
    names = ["The loss"] * count + [f"Constraint {name!r}" for name, _ in constraints]
    for name, value, slope in zip(names, *looks[0], strict=True):
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
    own = ((look.values[:count, None], look.slopes[:count]) for look in looks)
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
    courses: list[Course],
    optimiser: str,
    seed: int,
) -> Tuned:
    start = min(range(len(courses)), key=lambda i: courses[i].merit)
    best = courses[start]
    u, loss, excess = best.best
    values = dict(zip(limits.paths, limits.values(jnp.asarray(u)), strict=True))
    names = [name for name, _ in constraints]
    rows = lambda seen, width: np.reshape(seen, (len(seen), width))
    parameters: Any = jax.vmap(limits.values)
    numbers = [np.asarray(parameters(rows(one.numbers, len(u)))) for one in courses]
    over = [rows(one.excess, len(names)) for one in courses]
    history = History(
        _padded([one.losses for one in courses]),
        {path: _padded([x[:, i] for x in numbers]) for i, path in enumerate(limits.paths)},
        _padded([one.gradients for one in courses]),
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
        reasons=tuple(one.reason for one in courses),
        optimiser=optimiser,
        seed=seed,
    )


def _padded(rows: list) -> Float[np.ndarray, "s k"]:
    """Rows of unequal length as one array, NaN at their ends."""
    rows, longest = [np.asarray(row, float) for row in rows], max(map(len, rows))
    return np.stack([np.pad(row, (0, longest - len(row)), constant_values=np.nan) for row in rows])
