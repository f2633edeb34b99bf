"""Orbits: periodic motions through contact, found as such instead of waited for."""

from .branch import Branch as Branch, BranchPoint as BranchPoint
from .continuation import continue_ as continue_
from .periodic import OrbitError as OrbitError, PeriodicOrbit as PeriodicOrbit, periodic as periodic
