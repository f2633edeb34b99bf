"""Plots: free functions that take a result and return its matplotlib Axes."""

from .bifurcation import bifurcation as bifurcation
from .history import history as history
from .mode_shapes import mode_shapes as mode_shapes
from .onset import onset as onset
from .orbit import orbit as orbit
from .page import write as write
from .waterfall import waterfall as waterfall
from .whirl import whirl_history as whirl_history, whirl_spectrum as whirl_spectrum
