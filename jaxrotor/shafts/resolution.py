"""Number of nodes that each span of a shaft needs for its part of a bending wave."""

import bisect
import math

import numpy as np
from jaxtyping import Float

from .line import NODES


FEWEST, MOST = 2, 24

# Largest phase of a wave [rad] on a span of 2, 3, .. 7 nodes. Up to it the second bending frequency of a
# uniform beam with equal spans, pinned or clamped, has an error below 1e-9.
LONGEST = (0.2, 0.39, 1.1, 1.75, 2.65, 4.1)
LONGEST_WITH_SHEAR = (0.01, 0.087, 0.35, 0.8, 1.4, 2.1)
# Phase on a span of 8 nodes, and of each further one, up to which a bending frequency of a uniform pinned
# beam with up to five equal spans has an error below 2e-8; without and with shear.
BEYOND = (5.0, 1.3), (3.6, 1.4)


def nodes_needed(
    lengths: Float[np.ndarray, " spans"], held: int, shear: bool, modes: int = 2
) -> tuple[int, ...]:
    """Nodes of every span for a number n of modes, each with a root forward and one backward.

        phase_k = (c + n - 3/2) pi l_k / Sum l_k,   l_k = (rho A / EI)^(1/4) times the length of the span

    Mode n of a beam with c constraints is at or below mode c + n of the free beam, counting its two
    rigid motions. The wave of that mode has the phase `(c + n - 3/2) pi` from end to end, and masses
    lower its frequency. With different sections or fast gyroscopes this is an estimate: the four slowest
    roots of the shipped rotors and of 14 random ones were within 1e-9 of those with 8 nodes per span.

    Args:
        lengths: `l_k` of each span, up to a common factor.
        held: number c of displacements and slopes that are held; at least two are assumed.
        shear: whether displacement and slope of the sections are separate polynomials.
        modes: number n; two of them have at most 8 nodes a span.

    Returns:
        Number of nodes of every span, 2 to 24.
    """
    phases = (max(held, 2) + modes - 1.5) * math.pi * lengths / np.sum(lengths)
    longest = LONGEST_WITH_SHEAR if shear else LONGEST
    found = [FEWEST + bisect.bisect_left(longest, float(phase)) for phase in phases]
    if modes > 2:
        first, each = BEYOND[shear]
        most = [NODES + math.ceil((float(phase) - first) / each) for phase in phases]
        pairs = zip(found, most, strict=True)
        found = [n if n < NODES else min(max(n, own), MOST) for n, own in pairs]
    return tuple(found)
