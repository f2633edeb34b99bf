"""Pieces: a motion in which unbalance appears at given times, as motions that continue each other."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..core.quantities import known, with_values
from ..effects.base import AbstractUnbalance
from ..equations.start import Launch
from ..scene import Scene
from .history import TimeHistory


ALONG = ("angle", "speed", "acceleration", "displacement", "velocity", "slope", "contact_force")
ALONG += ("coordinates", "rates", "balls", "states")  # of a history, with an entry for every sample


def appearing(scene: Scene) -> list[AbstractUnbalance]:
    """Unbalance of a scene that appears at a time of its motion."""
    return [one for one in scene.of(AbstractUnbalance) if one.since is not None]


def check_always(scene: Scene, what: str, cure: str) -> None:
    """Raise if unbalance of a scene appears at a time; `what` takes none."""
    if own := appearing(scene):
        names = " and ".join(map(scene.name_of, own))
        raise ValueError(
            f"{what} is of a scene that stays as it is, but `since [s]` of {names} is given; {cure}."
        )


def in_pieces(
    run: Callable[..., TimeHistory],
    scene: Scene,
    times: Any,
    launch: Launch,
    options: dict[str, Any],
) -> TimeHistory:
    """A run whose unbalance appears at times from that of the launch on, joined of runs between these."""
    own = appearing(scene)
    sinces: list[Any] = [one.since for one in own]
    if not all(map(known, (times, launch.time, *sinces))):
        names = " and ".join(map(scene.name_of, own))
        raise ValueError(
            f"The times of a motion and `since [s]` of {names} must be known when it is run; run it up to "
            "then, and on from `motion.end` in the scene that has the unbalance."
        )
    times, begun = np.asarray(times), float(launch.time)
    ended = begun + float(times[-1])
    cuts = sorted({float(one) for one in sinces if begun < float(one) < ended})
    pieces, start = [], launch
    for since, until in zip([begun, *cuts], [*cuts, ended], strict=True):
        first, last = since - begun, until - begun
        inside = times[(first < times) & (times <= last)] - first
        steps = np.unique([0.0, *inside, last - first])
        there = [
            one.by(since) if isinstance(one, AbstractUnbalance) else one for one in scene.effects
        ]
        found = run(with_values(scene, effects=tuple(there)), steps, start=start, **options)
        keep = slice(0 if first == 0 and times[0] == 0 else 1, 1 + inside.size)
        pieces.append((first, keep, found))
        start = found.end
    return _joined(scene, times, pieces)


def _joined(
    scene: Scene, times: np.ndarray, pieces: list[tuple[float, slice, TimeHistory]]
) -> TimeHistory:
    """One history of pieces, each with the time at which it begins and the samples to keep."""
    join = lambda *parts: jnp.concatenate(
        [part[keep] for part, (_, keep, _) in zip(parts, pieces, strict=True)]
    )
    every = [found for *_, found in pieces]
    along = {name: jax.tree.map(join, *(getattr(one, name) for one in every)) for name in ALONG}
    return dataclasses.replace(
        every[-1],
        time=jnp.asarray(times, float),
        **along,
        integrated=jax.tree.map(join, *(one.instants for one in every)),
        stopped=jnp.min(jnp.stack([first + found.stopped for first, _, found in pieces])),
        unresolved=sum((one.unresolved for one in every), start=jnp.zeros((), int)),
        pilots=sum((one.pilots for one in every), start=()),
        scene=scene,
    )
