"""Warnings about the validity of the formulas for given groups and positions."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from .boundary import polar_limit
from .groups import BalancerGroups, Scales
from .linear import growth_rate
from .positions import balance_margin, second_harmonics, smallest_gap


LARGEST_TILT = 0.1  # rad, limit of the small angles that the equations assume


def cautions(
    groups: BalancerGroups,
    positions: Sequence,
    *,
    pitch: Any = None,
    scales: Scales | None = None,
    delta: Any = None,
) -> tuple[str, ...]:
    """Warnings that apply, one sentence each.

    Args:
        groups: the balancer.
        positions: a balanced position.
        pitch: smallest possible angle [rad] between balls of each row, see `pitch`; to check overlap.
        scales: scales of the machine; together with `delta`, to check the tilt.
        delta: dimensionless tilts of any shape.

    Returns:
        Sentences; an empty tuple if no warning applies.
    """
    beta = second_harmonics(positions)
    growth, a11 = float(growth_rate(groups, beta)), float(groups.a11)
    total, polar = float(jnp.sum(groups.mass)), float(groups.polar)
    limit = float(polar_limit(groups, beta))
    margin = float(balance_margin(groups))
    found = [
        (
            total >= 0.5,
            f"The balls are too heavy: m1 + m2 is {total:g}, but must be below 1/2 with their mass "
            "counted in the transverse inertia.",
        ),
        (
            margin < 0,
            "No position balances this imbalance: the largest of imbalance and balls exceeds the sum of "
            f"the others by {-margin:g}.",
        ),
        (
            polar >= 1,
            f"The rotor is not long: C_p / A is {polar:g}, and balancing needs it below 1.",
        ),
        (
            limit < polar < 1,
            f"C_p / A is {polar:g}, but with these balls balance is lost at high speed above {limit:g}.",
        ),
        (
            a11 < 0 < growth,
            f"a11 is {a11:g} and predicts stability, but the exact roots are unstable ({growth:g}).",
        ),
    ]
    if pitch is not None:
        gaps = np.asarray(smallest_gap(positions))
        for row, (gap, least) in enumerate(
            zip(gaps, np.broadcast_to(pitch, gaps.shape), strict=True)
        ):
            sentence = (
                f"Balls of row {row + 1} overlap: two are {gap:g} rad apart, but the pitch is "
                f"{least:g}."
            )
            found.append((gap < least, sentence))
    if scales is not None and delta is not None:
        tilt = float(scales.tilt) * float(np.max(np.abs(delta)))
        sentence = f"The tilt of {tilt:g} rad is beyond small angles (about {LARGEST_TILT:g})."
        found.append((tilt > LARGEST_TILT, sentence))
    return tuple(sentence for wrong, sentence in found if wrong)
