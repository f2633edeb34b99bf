"""How the cost of a sweep grows with lanes, revolutions and limiters: it should be linear."""

import argparse
import functools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from rich.table import Table

import jaxrotor as jr

from .clock import quickest
from .rotor import LARGEST, SCENE, library_rates


STOPS = (1, 3, 12)


def with_stops(count: int) -> jr.Scene:
    """The rotor with so many stops, evenly around."""
    one = SCENE.of(jr.Limiter)[0]
    angles = np.pi / 3 + 2 * np.pi * np.arange(count) / count
    stops = [eqx.tree_at(lambda s: s.angle, one, jnp.asarray(angle)) for angle in angles]
    return jr.Scene(SCENE.shaft, *SCENE.without("limiters").effects, *stops, spin=SCENE.spin)


def growth(args: argparse.Namespace, steps: int) -> list[dict]:
    """Seconds of preparing lanes and of revolutions, one worker, precession observed."""
    lanes, revolutions = args.lanes, args.revolutions
    cases = [(lanes, revolutions, 3), (max(lanes // 4, 2), revolutions, 3)]
    cases += [(4 * lanes, revolutions, 3), (lanes, 2 * revolutions, 3)]
    cases += [(lanes, revolutions, count) for count in STOPS if count != 3]
    rows = []
    for lanes, revolutions, count in cases:
        shares = np.linspace(0, LARGEST, lanes)
        scene = with_stops(count)
        seconds = []
        for turns in (1, revolutions):
            given = ({"order": 2}, steps, turns, shares, 1, scene)
            run = functools.partial(library_rates, *given)
            run()
            seconds.append(quickest(run, args.repeats))
        prepare, whole = seconds
        rows.append(
            {
                "lanes": lanes,
                "revolutions": revolutions,
                "limiters": count,
                "prepare ms/lane": 1e3 * prepare / lanes,
                "us/lane-rev": 1e6 * (whole - prepare) / lanes / max(revolutions - 1, 1),
            }
        )
    return rows


def growth_table(rows: list[dict]) -> Table:
    shown = Table(title="Cost of the public sweep, order 2, one worker")
    for head in (*rows[0], "over the first"):
        shown.add_column(head, justify="right")
    for row in rows:
        *sizes, prepare, cost = row.values()
        over = f"{cost / rows[0]['us/lane-rev']:.2f}"
        shown.add_row(*map(str, sizes), f"{prepare:.2f}", f"{cost:.2f}", over)
    return shown
