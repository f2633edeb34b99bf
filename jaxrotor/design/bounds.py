"""Bounds: parameters of a scene within bounds, as free numbers by smooth transforms."""

import itertools
from collections.abc import Mapping
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import logit
from scipy.stats import qmc

from ..core.checks import check_counts
from ..scene import Scene


DECADE = 10.0  # ratio of positive bounds above which they are bounds of the logarithm


class Bounds(eqx.Module):
    """`x = a + b s(u)` or, logarithmic, `log x = a + b s(u)`, with `s(u) = 1 / (1 + exp(-u))`.

    `u` are the `n` free numbers that an optimiser moves, one for each path; a parameter without bounds is
    `x = a + b u`.
    """

    origin: Float[np.ndarray, " n"]  # a
    span: Float[np.ndarray, " n"]  # b
    free: np.ndarray  # (n,) where there are no bounds
    logarithmic: np.ndarray  # (n,) where the bounds are of the logarithm
    paths: tuple[str, ...] = eqx.field(static=True)
    units: tuple[str, ...] = eqx.field(static=True)

    def values(self, u: Float[Array, " n"]) -> Float[Array, " n"]:
        """Parameters of free numbers."""
        raw = self.origin + self.span * jnp.where(self.free, u, jax.nn.sigmoid(u))
        return jnp.where(self.logarithmic, jnp.exp(jnp.where(self.logarithmic, raw, 0.0)), raw)

    def rates(self, u: Float[Array, " n"]) -> Float[Array, " n"]:
        """Derivatives of the parameters by the free numbers."""
        return jax.jvp(self.values, (u,), (jnp.ones_like(u),))[1]

    @property
    def ends(self) -> dict[str, tuple[float, float]]:
        """Lower and upper bound by path, infinite where there are none."""
        low, high = (
            np.where(self.logarithmic, np.exp(np.where(self.logarithmic, raw, 0.0)), raw)
            for raw in (self.origin, self.origin + self.span)
        )
        low, high = np.where(self.free, -np.inf, low), np.where(self.free, np.inf, high)
        return dict(zip(self.paths, zip(low.tolist(), high.tolist(), strict=True), strict=True))

    def numbers(self, values: Any) -> Float[np.ndarray, " n"]:
        """Free numbers of parameters."""
        values = np.asarray(values, float)
        raw = np.where(self.logarithmic, np.log(np.where(self.logarithmic, values, 1.0)), values)
        share = (raw - self.origin) / self.span
        return np.where(self.free, share, logit(np.where(self.free, 0.5, share)))

    def placed(self, scene: Scene, u: Float[Array, " n"]) -> Scene:
        """The scene with the parameters of free numbers."""
        return scene.put(dict(zip(self.paths, self.values(u), strict=True)))

    def drawn(self, count: int, seed: int) -> Float[np.ndarray, "count n"]:
        """Free numbers of a Latin hypercube, uniform in `x` or its logarithm.

        A parameter without bounds is drawn between zero and twice its own value.
        """
        check_counts(0, seed=seed)
        cube = qmc.LatinHypercube(len(self.paths), rng=seed).random(count)
        return np.where(self.free, 2 * cube - 1, logit(np.where(self.free, 0.5, cube)))


def bounds(scene: Scene, where: Mapping[str, Any], name: str = "where") -> Bounds:
    """Bounds of parameters by paths that `check_paths` accepts: `(low, high)`, or None for no bounds."""
    own = {path: own_value(scene, path) for path in where}
    _check_apart(scene, where)
    ends = {path: _ends(path, pair, name) for path, pair in where.items()}
    for path, (low, high) in ends.items():
        if np.isfinite(low):
            _check_ends(scene, path, low, high)
            if not low < own[path] < high:
                raise ValueError(
                    f"`{path}` of the scene must be between its bounds, {low:g} and {high:g}, since the "
                    f"first start is there, but is {own[path]:g}; give the scene another with "
                    "`scene.replace`, or other bounds."
                )
    _check_order(scene, {path: pair for path, pair in ends.items() if np.isfinite(pair[0])})
    low, high = np.array(list(ends.values())).T
    free = ~np.isfinite(low)
    logarithmic = ~free & (low > 0) & (high > DECADE * low)
    raw = lambda x: np.where(logarithmic, np.log(np.where(logarithmic, x, 1.0)), x)
    values = np.array(list(own.values()))
    origin = np.where(free, values, raw(low))
    span = np.where(free, np.where(values == 0, 1.0, np.abs(values)), raw(high) - raw(low))
    units = tuple(scene.unit(path) for path in where)
    return Bounds(origin, span, free, logarithmic, tuple(where), units)


def check_paths(where: Any, name: str) -> None:
    """Raise unless these are bounds by the paths of at least one parameter."""
    if not isinstance(where, Mapping):
        raise ValueError(
            f"`{name}` must be bounds by path, such as {{'limiters.stiffness': (1e5, 1e8)}}, but is "
            f"{where!r:.200}."
        )
    if not where:
        raise ValueError(
            f"`{name}` must name at least one parameter, such as {{'limiters.stiffness': (1e5, 1e8)}}."
        )
    for path in where:
        if not isinstance(path, str):
            raise ValueError(
                f"The keys of `{name}` must be paths of parameters, such as 'limiters.stiffness', but one "
                f"is {path!r:.200}."
            )


def _check_apart(scene: Scene, where: Mapping[str, Any]) -> None:
    """Raise where two paths are the same number."""
    paths = list(where)
    numbered = scene.put({path: jnp.asarray(float(i)) for i, path in enumerate(paths)})
    for path in paths:
        for leaf in numbered.leaves(path):
            other = paths[int(cast(Array, leaf))]
            if other != path:
                raise ValueError(f"`{path}` and `{other}` are the same number; leave one out.")


def own_value(scene: Scene, path: str) -> float:
    """The scene's own value of a parameter; raise unless it is a single number."""
    head, _, rest = path.partition(".")
    own = {"shaft": [scene.shaft], "spin": [scene.spin]}
    parts = own.get(head, [e for e in scene.effects if head in (e.kind, e.plural)])
    index, _, name = rest.partition(".")
    if not index.isdigit():
        index, name = "", rest
    option = getattr(parts[0], name, None) if parts else None
    if isinstance(option, bool | int | str):
        raise ValueError(
            f"`{path}` = {option!r} is a whole number or a choice, which has no gradient to tune by; "
            "compare scenes instead."
        )
    value = np.asarray(scene.get(path))
    if value.ndim > (len(parts) > 1 and not index):
        raise ValueError(
            f"`{path}` is a table of numbers, but only single numbers can be tuned; name a parameter "
            "that is one number."
        )
    if np.ptp(value):
        listed = ", ".join(f"{one:g}" for one in value)
        raise ValueError(
            f"`{path}` has several values ({listed}), but is to be one parameter; make them equal with "
            f"`scene.replace`, or name each: `{head}.0.{name}`, .."
        )
    return float(np.ravel(value)[0])


def _ends(path: str, pair: Any, name: str) -> tuple[float, float]:
    """Low and high bounds, infinite where there are none."""
    if pair is None:
        return -np.inf, np.inf
    ends = ascending_pair(pair)
    if ends is None:
        raise ValueError(
            f"`{name}['{path}']` must be a lower and a higher bound, or None for none, but is "
            f"{pair!r:.200}."
        )
    return ends


def ascending_pair(pair: Any) -> tuple[float, float] | None:
    """Two finite numbers of which the second is larger; None of anything else."""
    if not isinstance(pair, list | tuple | np.ndarray | Array):
        return None
    try:
        ends = np.asarray(pair)
    except (TypeError, ValueError):  # of several lengths
        return None
    if ends.shape != (2,) or ends.dtype.kind not in "iuf" or not np.isfinite(ends).all():
        return None
    if any(isinstance(end, bool | np.bool_) for end in pair):  # beside a number
        return None
    low, high = map(float, ends)
    return (low, high) if low < high else None


def _check_ends(scene: Scene, path: str, low: float, high: float) -> None:
    """Raise unless both bounds are values that the parameter may have."""
    for end in (low, high):
        try:
            scene.replace({path: end})
        except ValueError as error:
            raise ValueError(
                f"The bounds of `{path}` must be values it may have: {error}"
            ) from None


def _check_order(scene: Scene, ends: Mapping[str, tuple[float, float]]) -> None:
    """Raise where a station passes another between the bounds."""
    lengths = {p: pair for p, pair in ends.items() if p.endswith(".at") or p.startswith("shaft.")}
    for corner in itertools.product(*lengths.values()):
        if scene.replace(dict(zip(lengths, corner, strict=True))).spans != scene.spans:
            raise ValueError(
                "The bounds let a station pass another, where no loss is smooth; give each order of "
                "stations bounds of its own."
            )
