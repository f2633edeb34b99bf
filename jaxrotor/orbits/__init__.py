"""Orbits: periodic motions through contact, found as such instead of waited for."""

from .branch import Branch as Branch, BranchPoint as BranchPoint
from .continuation import continue_ as continue_
from .harmonic import HarmonicOrbit as HarmonicOrbit, harmonic_balance as harmonic_balance
from .lyapunov import Lyapunov as Lyapunov, lyapunov as lyapunov
from .periodic import OrbitError as OrbitError, PeriodicOrbit as PeriodicOrbit, periodic as periodic
