"""Colours: Paul Tol's "vibrant" set, told apart by colour-blind readers and in print."""

BLUE = "#0077BB"
RED = "#CC3311"
ORANGE = "#EE7733"
TEAL = "#009988"
MAGENTA = "#EE3377"
GREY = "#888888"
DARK = "#333333"

FORWARD, BACKWARD, UNDEFINED = BLUE, RED, GREY
CYCLE = (BLUE, ORANGE, TEAL, RED, MAGENTA, DARK)
