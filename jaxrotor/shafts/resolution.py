"""Resolution: how many nodes each span of a shaft needs for its share of a wave."""

import bisect
import math

import numpy as np
from jaxtyping import Float


FEWEST, MOST = 2, 8

# The longest piece of a wave [rad] that a span of 2, 3, .. 7 nodes carries: below it the second bending
# frequency of a uniform beam in equal spans, pinned or clamped, is right to 1e-9.
LONGEST = (0.09, 0.33, 0.95, 1.35, 2.3, 3.0)
LONGEST_WITH_SHEAR = (0.01, 0.087, 0.35, 0.8, 1.4, 2.1)


def nodes_by_need(lengths: Float[np.ndarray, " spans"], held: int, shear: bool) -> tuple[int, ...]:
    """Nodes of every span, 2 to 8, for the first four roots: two modes, forward and backward.

        phase_k = (c + 1/2) pi l_k / Sum l_k,   l_k = (rho A / EI)^(1/4) times the length of the span

    A beam held at c places has its second mode at or below the (c + 2)-th of the free beam, two rigid
    motions among them, whose wave has the phase `(c + 1/2) pi` from end to end; masses slow it. Where
    sections differ, or discs are fast gyroscopes, that is an estimate: of shipped rotors and 14 random
    ones the four slowest roots were within 1e-9 of those of 8 nodes a span.

    Args:
        lengths: `l_k` of each span, up to a factor.
        held: at how many places displacement or slope is held; at least two are reckoned with.
        shear: whether displacement and slope of the sections are polynomials by themselves.
    """
    phases = (max(held, 2) + 0.5) * math.pi * lengths / np.sum(lengths)
    longest = LONGEST_WITH_SHEAR if shear else LONGEST
    return tuple(FEWEST + bisect.bisect_left(longest, float(phase)) for phase in phases)
