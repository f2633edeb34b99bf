"""Analyses of the linear rotor, in closed form."""

from .forced import UnbalanceResponse as UnbalanceResponse, unbalance_response as unbalance_response
from .modal import Modes as Modes, modes as modes, roots as roots
from .stability import (
    Onset as Onset,
    onset_speed as onset_speed,
    stability_crossings as stability_crossings,
)
