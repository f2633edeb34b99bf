"""ROSS: rotors as ROSS writes them, read into scenes."""

from .rotor import from_ross as from_ross
