"""Orbits: periodic motions through contact, computed directly, with their branches and exponents."""

from .branch import Branch as Branch, BranchPoint as BranchPoint
from .continuation import continue_ as continue_
from .harmonic import HarmonicOrbit as HarmonicOrbit, harmonic_balance as harmonic_balance
from .lyapunov import Lyapunov as Lyapunov, lyapunov as lyapunov
from .orbit import OrbitError as OrbitError, PeriodicOrbit as PeriodicOrbit
from .periodic import periodic as periodic
