"""Axes: the values that a sweep takes, each along the path of its parameter."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..core.parameters import follow
from ..equations.speed_tables import check_tables
from ..equations.start import AbstractStart, address, numbers_of, put_number
from ..equations.system import port_groups
from ..motion.revolutions import revolution_rate
from ..scene import Scene


# Names of dimensions and variables that data sets of sweeps have.
TAKEN = (
    *(
        "axis",
        "ball",
        "branch",
        "error_lane",
        "extremum",
        "frequency",
        "limiter",
        "revolution",
        "sample",
        "state",
        "states",
        "states_end",
        "window",
    ),
    *(
        "status",
        "unresolved",
        "section",
        "orbit",
        "extrema",
        "index",
        "winding",
        "duty",
        "peak",
        "envelope",
    ),
    *("speed", "imbalance", "captured", "outcome", "race", "reversal", "spectrum"),
)
MOST_LANES = 1_000_000_000  # in one sweep, because lists of what is to be computed take memory


def checked_axes(
    scene: Scene,
    start: AbstractStart,
    over: Mapping[str, Any],
    period: float | str | None,
    *,
    revolve: bool = True,
) -> dict[str, np.ndarray]:
    """Values by path, each path tried on the scene.

    Admissible values form an interval, so the least and the largest suffice, and zero, which is
    special for a speed, whose revolutions have no length unless lanes do not `revolve`.
    """
    if not over:
        raise ValueError(
            "`over` must name at least one parameter, such as {'spin.speed': speeds}; one trajectory "
            "is a job for `simulate`."
        )
    axes: dict[str, np.ndarray] = {}
    _check_names(over)
    for path, given in paths_of(over).items():
        values = np.atleast_1d(np.asarray(given, float))
        if values.ndim != 1 or not values.size:
            raise ValueError(f"`over['{path}']` must be a list of numbers, but is {given!r}.")
        for value in {values.min(), values.max(), *values[values == 0]}:
            changed, _ = at_point(scene, start, {path: value})
            if revolve and (path == "spin.speed" or isinstance(period, str)):
                revolution_rate(changed, period)
        axes[path] = values
    if "spin.speed" in axes or revolve:
        check_tables(scene, axes.get("spin.speed"))
    for name, together in over.items():
        if isinstance(together, Mapping):
            axes[name] = np.stack(
                _of_one_length(name, {path: axes.pop(path) for path in together}), 1
            )
    check_lanes(axes)
    return {name: axes[name] for name in over}


def paths_of(over: Mapping[str, Any]) -> dict[str, Any]:
    """Values by parameter path, also those of paths that vary together."""
    paths: dict[str, Any] = {}
    for name, values in over.items():
        paths |= values if isinstance(values, Mapping) else {name: values}
    return paths


def _check_names(over: Mapping[str, Any]) -> None:
    """Raise if a path is named twice, or paths that vary together have a name that cannot be one."""
    paths: list[str] = []
    for name, values in over.items():
        if not isinstance(values, Mapping):
            paths.append(name)
            continue
        if not values:
            raise ValueError(
                f"`over['{name}']` must name the paths that vary together, but is empty."
            )
        if not name.isidentifier() or name in TAKEN:
            raise ValueError(
                f"Paths that vary together need a name of letters that data sets do not use, such as "
                f"`machine`, but it is {name!r}."
            )
        paths += values
    twice = [path for path in dict.fromkeys(paths) if paths.count(path) > 1]
    if twice:
        raise ValueError(f"`{twice[0]}` is swept twice; name it once.")


def values_by_path(
    over: Mapping[str, Any], axes: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Columns of the axes by parameter path."""
    columns = {}
    for name, values in axes.items():
        together = over[name]
        names = list(together) if isinstance(together, Mapping) else [name]
        columns |= dict(zip(names, values.reshape(len(values), -1).T, strict=True))
    return columns


def _of_one_length(name: str, values: dict[str, np.ndarray]) -> list[np.ndarray]:
    """Values of paths that vary together, as many of each; raises where one moves a station."""
    if len({len(one) for one in values.values()}) > 1:
        sizes = ", ".join(f"{len(one)} of {path}" for path, one in values.items())
        raise ValueError(
            f"`over['{name}']` must have as many values of every path, but has {sizes}."
        )
    for path in values:
        if path.endswith(".at") or path.startswith("shaft."):
            raise ValueError(f"`{path}` decides stations and nodes, so it is swept by itself.")
    return list(values.values())


def check_lanes(axes: Mapping[str, Sequence[float] | np.ndarray]) -> None:
    """Raise if a grid has more lanes than one sweep can hold."""
    lanes = math.prod(map(len, axes.values()))
    if lanes > MOST_LANES:
        raise ValueError(
            f"A sweep of {lanes:.3g} lanes is more than one can hold ({MOST_LANES:.0e}); cut it along an "
            "axis, a sweep and a store each."
        )


def with_carried_first(over: Mapping[str, Any], carry: str, error_sample: int) -> dict[str, Any]:
    """The swept paths, first the one along which states are carried."""
    if carry not in over:
        raise ValueError(
            f"`carry` must be one of the paths of `over`, {', '.join(over)}, but is {carry!r}."
        )
    if carry.startswith("start."):
        raise ValueError(f"`carry` keeps the state of a lane, so it cannot be {carry!r}.")
    if isinstance(over[carry], Mapping):
        raise ValueError(f"`carry` must be a single path, but `{carry}` has several.")
    values = np.atleast_1d(np.asarray(over[carry], float))
    changes = np.diff(values)
    if values.size < 2 or not (np.all(changes > 0) or np.all(changes < 0)):
        raise ValueError(
            f"`over['{carry}']`, along which states are carried, must be two or more numbers that ascend, "
            f"or descend, but is {values.tolist()}."
        )
    if error_sample:
        raise ValueError(
            "`error_sample` runs single lanes again, which `carry` does not have; repeat the sweep with "
            "twice the `steps_per_revolution`."
        )
    return {carry: over[carry], **over}


def at_point(
    scene: Scene, start: AbstractStart, values: Mapping[str, Any]
) -> tuple[Scene, AbstractStart]:
    """Scene and start with values by path; paths that begin with `start.` go to the start."""
    own = {path: value for path, value in values.items() if not path.startswith("start.")}
    for path in values.keys() - own.keys():
        name, numbers = path.removeprefix("start."), numbers_of(start)
        if name not in numbers:
            has = [path for path in numbers if not path[-1].isdigit()]
            here = f"{type(start).__name__}, has no `{name}`; it has: {', '.join(has) or '-'}"
            raise ValueError(
                f"The start, {here}. A start=jaxrotor.Whirl(..) has radius, rate and angle, in a "
                "Launch(..) written `start.shaft.radius`."
            )
        start = put_number(start, name, values[path])
        _check_numbers(start, name)
    return scene.replace(own), start


def _check_numbers(start: AbstractStart, path: str) -> None:
    """Raise unless a number that was put into a start, which is not checked there, is admissible."""
    parents, name = address(path)
    part = follow(start, parents)
    if isinstance(part, AbstractStart):
        fields = {name: getattr(part, name) for name in part.__dataclass_fields__}
        type(part)(**fields)
    elif not np.all(np.isfinite(part if isinstance(name, int) else getattr(part, name))):
        raise ValueError(f"`start.{path}` must be finite.")


def shared_ports(scene: Scene, axes: Mapping[str, np.ndarray]) -> tuple[tuple[int, ...], ...]:
    """Groups of contacts that share a port at every point of the grid.

    Raises where a combination of swept lengths makes no valid scene, or changes the order of stations.
    """
    lengths = {
        path: values
        for path, values in axes.items()
        if path.endswith(".at") or (path.startswith("shaft.") and scene.unit(path) == "m")
    }
    groups = set()
    for point in itertools.product(*lengths.values()):
        changed = scene.replace(dict(zip(lengths, point, strict=True)))
        if changed.spans != scene.spans:
            raise ValueError(
                "The sweep moves a station past another; sweep each order of stations apart."
            )
        groups.add(port_groups(changed))
    if len(groups) == 1:
        return groups.pop()
    return tuple((i,) for group in port_groups(scene) for i in group)
