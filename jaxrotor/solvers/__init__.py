"""Solvers: how a motion is carried through time."""

from .exponential import Exponential as Exponential
