"""Reader of rotors that ROSS has written."""

from .rotor import from_ross as from_ross
