"""Stability maps: growth rate over two parameters, and the curves on which it is zero."""

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import contourpy
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.optimize import elementwise

from ..core.checks import in_order
from ..core.compiled import compiled
from ..equations.shared_nodes import with_shared_nodes
from ..equations.speed_tables import has_whirl_tables
from ..scene import Scene
from .growth import EDGES, STEPS, growth_of, undamped_side, why_unknown
from .linearized import check_linear
from .whirl_tables import OverWhirl


CHUNK = 64  # points per call of the compiled program


class StabilityMap(eqx.Module):
    """Growth rate over a grid of two parameters, `a` by `b` values, and its boundaries."""

    x: Float[np.ndarray, " a"]  # values of the first parameter, SI
    y: Float[np.ndarray, " b"]  # values of the second parameter, SI
    growth: Float[np.ndarray, "a b"]  # `growth_rate` [1/s], unstable above zero, NaN where unknown
    boundaries: tuple[Float[np.ndarray, "_ 2"], ...]  # curves (x, y) between stable and unstable
    paths: tuple[str, str] = eqx.field(static=True)
    units: tuple[str, str] = eqx.field(static=True)


def stability_map(scene: Scene, over: Mapping[str, Any]) -> StabilityMap:
    """`max Re lambda` over two parameters, and the curves where stability changes.

    A curve is found from its crossings with the grid lines, each refined to 1e-10 of a cell by root
    finding; an island smaller than a cell is missed. Growth within rounding is zero and stable, so an
    undamped rotor has boundaries too. Where `growth_rate` is NaN, no curve is drawn.

    Args:
        scene: the rotor.
        over: two parameter paths, and values of each in order: `{"spin.speed": .., ..}`.

    Returns:
        `StabilityMap`. Not differentiable; `stability_crossings` is.

    Raises:
        ValueError: `over` does not name two parameters, values are not two or more in order, or one
            moves a station past another.

    Source: Klochkov, Figs. 2-9.
    """
    if len(over) != 2:
        raise ValueError(f"`over` must name two parameters, but names {len(over)}: {list(over)}.")
    check_linear(scene, [])
    first, second = over
    scene = with_shared_nodes(scene, over)
    x, y = (_axis(scene, path, values) for path, values in over.items())
    growth, boundaries = traced(functools.partial(_growth, scene, (first, second)), x, y)
    units = scene.unit(first), scene.unit(second)
    return StabilityMap(x, y, growth, boundaries, (first, second), units)


def traced(
    evaluate: Callable, x: Float[np.ndarray, " a"], y: Float[np.ndarray, " b"]
) -> tuple[Float[np.ndarray, "a b"], tuple[Float[np.ndarray, "_ 2"], ...]]:
    """Growth over a grid and its curves of zero; `evaluate(x, y)` of points (k,) is like `_growth`."""
    grid = np.meshgrid(x, y, indexing="ij")
    growth = evaluate(*(part.ravel() for part in grid))[0].reshape(grid[0].shape)
    # Contours of the sign alone cross every edge of a cell at its middle.
    signs = np.ma.array(np.where(growth > 0, 1.0, -1.0), mask=np.isnan(growth)).T
    lines: Any = contourpy.contour_generator(z=signs, corner_mask=False).lines(0.0)
    if not lines:
        return growth, ()
    middle = np.concatenate(lines)  # in steps of the grid
    low, high = (rounded(middle).astype(int) for rounded in (np.floor, np.ceil))
    corners = (np.stack([x[ij[:, 0]], y[ij[:, 1]]]) for ij in (low, high))
    curve = _crossing(evaluate, *corners).T
    parts = np.split(curve, np.cumsum([len(line) for line in lines])[:-1])
    known = (part[~np.isnan(part).any(axis=1)] for part in parts)
    return growth, tuple(part for part in known if len(part))


class Boundary(NamedTuple):
    """Values of a parameter at which stability changes, in the order of the values searched."""

    values: Float[np.ndarray, " k"]  # SI
    lost: Bool[np.ndarray, " k"]  # True where the rotor is unstable beyond, False where stable


def stability_boundary(scene: Scene, path: str, values: Any) -> Boundary:
    """Values of one parameter where `max Re lambda` changes sign, to 1e-10 of an interval.

    Args:
        scene: the rotor.
        path: path of the parameter.
        values: ascending or descending values between which changes are sought; two changes in one
            interval are missed.

    Returns:
        `Boundary`. Not differentiable; along the speed `stability_crossings` is.

    Raises:
        ValueError: the values are not two or more in order, one moves a station past another,
            or `growth_rate` is NaN at a value.
    """
    scene = with_shared_nodes(scene, [path])
    check_linear(scene, [])
    values = _axis(scene, path, values)
    evaluate = functools.partial(_growth, scene, (path,))
    growth = evaluate(values)[0]
    _refuse_unknown(scene, path, values, growth)
    unstable = growth > 0
    below = np.flatnonzero(unstable[:-1] != unstable[1:])
    if not below.size:
        return Boundary(np.zeros(0), np.zeros(0, bool))
    found = _crossing(evaluate, values[None, below], values[None, below + 1])
    _refuse_unknown(scene, path, values[below], found[0])
    return Boundary(found[0], unstable[below + 1])


def _refuse_unknown(scene: Scene, path: str, values: np.ndarray, found: np.ndarray) -> None:
    if np.isnan(found).any():
        raise ValueError(
            f"{why_unknown(has_whirl_tables(scene))} at `{path}` = {values[np.isnan(found)][0]:g}; leave "
            "such values out."
        )


def _axis(scene: Scene, path: str, values: Any) -> np.ndarray:
    values = np.atleast_1d(np.asarray(values, float))
    if values.ndim != 1 or values.size < 2 or not in_order(values):
        ends = f"{values.size} from {values[0]:g} to {values[-1]:g}" if values.ndim == 1 else values
        raise ValueError(f"`over['{path}']` must be two or more values in order, but is {ends}.")
    for value in values:
        if scene.replace({path: value}).spans != scene.spans:
            raise ValueError(
                f"`over['{path}']` moves a station past another at {value:g}; leave such values out."
            )
    return values


def _growth(scene: Scene, paths: tuple[str, ...], *values: np.ndarray) -> np.ndarray:
    """Growth rates (2, k) at points (k,), see `growth_of`, by one compiled program for any k.

    Points where a slow rotor needs more steps take another program.
    """
    points = np.stack(values)  # (parameters, k)
    found = np.full((2, points.shape[1]), np.nan)
    for steps in STEPS[:1] if has_whirl_tables(scene) else STEPS:
        (left,) = np.nonzero(np.isnan(found[0]))
        size = CHUNK * STEPS[0] // steps
        for chunk in (left[k : k + size] for k in range(0, left.size, size)):
            padded = np.pad(points[:, chunk], [(0, 0), (0, size - chunk.size)], mode="edge")
            growth = _growth_of_chunk(scene, paths, steps, *padded)
            found[:, chunk] = np.asarray(growth)[:, : chunk.size]
    return found


@compiled
def _growth_of_chunk(
    scene: Scene, paths: tuple[str, ...], steps: int, *values: Array
) -> Float[Array, "2 k"]:
    one = lambda point: growth_of(
        OverWhirl.of(scene.put(dict(zip(paths, point, strict=True)))), steps
    )
    return jnp.stack(jax.lax.map(one, tuple(map(jnp.asarray, values))))


def _crossing(growth: Callable, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Points between `low` and `high` (parameters, k) where the sign of the growth changes."""
    ends = np.stack([growth(*(low + share * (high - low)))[0] for share in EDGES])
    marginal = undamped_side(ends)

    def above(share, marginal, *ends):
        start, stop = np.split(np.stack(ends), 2)
        certain, computed = growth(*(start + share * (stop - start)))
        return np.where(marginal, np.where(certain > 0, certain, -1.0), computed)

    found = elementwise.find_root(
        above,
        (np.zeros(low.shape[1]), np.ones(low.shape[1])),
        args=(marginal, *low, *high),
        tolerances={"xatol": 1e-10, "xrtol": 0.0},
    )
    return low + found.x * (high - low)
