"""Orbits: periodic motions through contact, found as such instead of waited for."""

from .periodic import OrbitError as OrbitError, PeriodicOrbit as PeriodicOrbit, periodic as periodic
