"""Stability maps: growth over two parameters, and the curves on which it is zero."""

from collections.abc import Mapping
from typing import Any

import contourpy
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import elementwise

from ..pencil import Pencil
from ..quantities import Scalar
from ..scene import Scene
from ..system import assemble
from .stability import growth_rate


MARGIN = 1e-9  # growth, as a fraction of the first natural frequency, that counts as unstable


class StabilityMap(eqx.Module):
    """Growth rate over a grid of two parameters, `a` by `b` values, and its boundaries."""

    x: Float[np.ndarray, " a"]  # of the first parameter, SI
    y: Float[np.ndarray, " b"]  # of the second
    growth: Float[np.ndarray, "a b"]  # largest real part of a root [1/s]; above zero unstable
    boundaries: tuple[Float[np.ndarray, "k 2"], ...]  # curves (x, y) between stable and unstable
    paths: tuple[str, str] = eqx.field(static=True)
    units: tuple[str, str] = eqx.field(static=True)


def stability_map(scene: Scene, over: Mapping[str, Any]) -> StabilityMap:
    """`max Re lambda` over two parameters, and the curves where the rotor turns unstable.

    A curve is found by its crossings of the grid's lines, each refined to 1e-10 of a cell by root
    finding; an island smaller than a cell is missed. Growth below 1e-9 of the first natural
    frequency counts as none, so that an undamped rotor is stable where it does not grow.

    Args:
        scene: the rotor.
        over: two parameter paths, and ascending values of each: `{"spin.speed": .., ..}`.

    Returns:
        Growth on the grid and boundaries; not differentiable, `stability_crossings` is.

    Source: Klochkov, Figs. 2-9.
    """
    if len(over) != 2:
        raise ValueError(f"`over` must name two parameters, but names {len(over)}: {list(over)}.")
    first, second = over
    x, y = (_axis(scene, path, values) for path, values in over.items())
    evaluate = lambda x, y: np.asarray(_growth(scene, (first, second), x, y))
    grid = np.meshgrid(x, y, indexing="ij")
    growth = evaluate(*(part.ravel() for part in grid)).reshape(grid[0].shape)
    level = MARGIN * float(_rate(scene))
    boundaries = _boundaries(evaluate, x, y, growth, level)
    units = scene.unit(first), scene.unit(second)
    return StabilityMap(x, y, growth, boundaries, (first, second), units)


def _axis(scene: Scene, path: str, values: Any) -> np.ndarray:
    values = np.asarray(values, float)
    if values.ndim != 1 or values.size < 2 or not np.all(np.diff(values) > 0):
        raise ValueError(f"`over['{path}']` must be two or more ascending values, but is {values}.")
    for value in values:
        if scene.replace({path: value}).spans != scene.spans:
            raise ValueError(f"`over['{path}']` moves a station past another at {value:g}.")
    return values


@eqx.filter_jit
def _growth(scene: Scene, paths: tuple[str, str], x: Array, y: Array) -> Float[Array, " k"]:
    one = lambda point: growth_rate(scene.put(dict(zip(paths, point, strict=True))))
    return jax.lax.map(one, (jnp.asarray(x), jnp.asarray(y)))


@eqx.filter_jit
def _rate(scene: Scene) -> Scalar:
    return Pencil.of(assemble(scene.put({"spin.speed": jnp.zeros(())}))).rate


def _boundaries(evaluate, x, y, growth, level) -> tuple[np.ndarray, ...]:
    """Curves `growth = level`: found between the points of the grid, then refined along its lines."""
    lines = contourpy.contour_generator(z=growth.T - level).lines(0.0)
    if not lines:
        return ()
    places = np.concatenate(lines)  # in steps of the grid
    low = np.floor(places + 1e-9).astype(int)
    along = (np.abs(places - np.round(places)) > 1e-9).astype(int)  # the line of the grid it is on
    low = np.where(along, np.floor(places).astype(int), np.round(places).astype(int))
    corner = lambda ij: (x[ij[:, 0]], y[ij[:, 1]])
    (ax, ay), (bx, by) = corner(low), corner(low + along)
    size = len(places)

    def gap(share, ax, ay, bx, by):
        at = np.stack([ax + share * (bx - ax), ay + share * (by - ay)])
        padded = np.pad(at, [(0, 0), (0, size - at.shape[1])], mode="edge")  # one compiled program
        return evaluate(*padded)[: at.shape[1]] - level

    ends = np.zeros(size), np.ones(size)
    found = elementwise.find_root(
        gap, ends, args=(ax, ay, bx, by), tolerances={"xatol": 1e-10, "xrtol": 0.0}
    )
    share = found.x[:, None]
    curve = np.stack([ax, ay], axis=1) * (1 - share) + np.stack([bx, by], axis=1) * share
    return tuple(np.split(curve, np.cumsum([len(line) for line in lines])[:-1]))
