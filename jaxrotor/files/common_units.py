"""Common units: their factors to SI units, so that most files are read without loading pint."""

import functools
import re
from decimal import Decimal


_PI = Decimal("3.1415926535897932384626433832795028841971693993751")
_FACTOR = re.compile(r"([A-Za-z]+)(?:(?:\^|\*\*)(-?[1-9]))?")
_BETWEEN = re.compile(r"\s*\*\s*|\s+")
Dimension = tuple[int, ...]  # powers of m, kg, s and rad


def _with_prefixes(
    name: str, prefixes: str, *dimension: int
) -> dict[str, tuple[Decimal, Dimension]]:
    powers = {"k": 3, "M": 6, "G": 9, "c": -2, "m": -3, "u": -6, "n": -9}
    known = {name: (Decimal(1), dimension)}
    return known | {p + name: (Decimal(10) ** powers[p], dimension) for p in prefixes}


_KNOWN: dict[str, tuple[Decimal, Dimension]] = {
    **_with_prefixes("m", "kcmun", 1, 0, 0, 0),
    "g": (Decimal("0.001"), (0, 1, 0, 0)),
    "kg": (Decimal(1), (0, 1, 0, 0)),
    **_with_prefixes("s", "mun", 0, 0, 1, 0),
    "min": (Decimal(60), (0, 0, 1, 0)),
    **_with_prefixes("rad", "mu", 0, 0, 0, 1),
    "deg": (_PI / 180, (0, 0, 0, 1)),
    "rpm": (2 * _PI / 60, (0, 0, -1, 1)),
    **_with_prefixes("Hz", "kM", 0, 0, -1, 0),
    **_with_prefixes("N", "kMmu", 1, 1, -2, 0),
    **_with_prefixes("Pa", "kMG", -1, 1, -2, 0),
}


def factor(given: str, wanted: str) -> Decimal | None:
    """Factor by which a number in the unit `given` is one in `wanted`.

    Args:
        given: products of common units and their powers, at most one of them after a "/", such as "N s/m".
        wanted: another such unit.

    Returns:
        The factor to 28 digits; None for any other text, and where the dimensions differ, angles too.
    """
    one, other = _known(given), _known(wanted)
    if one is None or other is None or one[1] != other[1]:
        return None
    return one[0] / other[0]


@functools.cache
def _known(text: str) -> tuple[Decimal, Dimension] | None:
    """Factor to SI units and dimension of a unit; None unless it is a product of common ones."""
    above, slash, below = text.strip().partition("/")
    factors = [] if above.strip() == "1" and slash else _BETWEEN.split(above.strip())
    signed = [(one, 1) for one in factors] + [(below.strip(), -1)] * bool(slash)
    size, dimension = Decimal(1), [0, 0, 0, 0]
    for one, sign in signed:
        match = _FACTOR.fullmatch(one)
        if match is None or match[1] not in _KNOWN:
            return None
        power = sign * int(match[2] or 1)
        own, powers = _KNOWN[match[1]]
        size *= own**power
        dimension = [a + power * b for a, b in zip(dimension, powers, strict=True)]
    return size, tuple(dimension)
