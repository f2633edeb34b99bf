"""Solvers: how a motion is advanced in time."""

from .exponential import Exponential as Exponential
