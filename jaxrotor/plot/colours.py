"""Colours: Paul Tol's "vibrant" set, distinct in print and for colour-blind readers."""

import matplotlib
from matplotlib.colors import LinearSegmentedColormap, to_hex


BLUE = "#0077BB"
RED = "#CC3311"
ORANGE = "#EE7733"
TEAL = "#009988"
MAGENTA = "#EE3377"
GREY = "#888888"
DARK = "#333333"

FORWARD, BACKWARD, UNDEFINED = BLUE, RED, GREY
MOTIONS = {  # kinds of motion, see `jaxrotor.classify`
    "periodic": BLUE,
    "quasi_periodic": TEAL,
    "chaotic": RED,
    "transient": ORANGE,
    "undecided": GREY,
    "failed": "white",
}
CYCLE = (BLUE, ORANGE, TEAL, RED, MAGENTA, DARK)

# Background of lines and text
RAMP = LinearSegmentedColormap.from_list("ramp", ["#FCF0E4", "#DE9468"])


def shades(count: int) -> list[str]:
    """`count` colours: those of the set if it has enough, else from a colour map."""
    if count <= len(CYCLE):
        return list(CYCLE[:count])
    ramp = matplotlib.colormaps["viridis"]
    return [to_hex(ramp(i / (count - 1))) for i in range(count)]


def cycled(number: int) -> str:
    """Colour of a line by its number; they repeat after six."""
    return CYCLE[number % len(CYCLE)]
