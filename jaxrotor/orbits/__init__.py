"""Orbits: periodic motions through contact, computed directly, with their branches and exponents."""

from .bifurcation_curve import BifurcationCurve as BifurcationCurve, CurvePoint as CurvePoint
from .branch import Branch as Branch, BranchPoint as BranchPoint
from .continuation import continue_ as continue_
from .curves import continue_curve as continue_curve
from .edge import Edge as Edge, edge as edge
from .harmonic import HarmonicOrbit as HarmonicOrbit, harmonic_balance as harmonic_balance
from .lyapunov import Lyapunov as Lyapunov, lyapunov as lyapunov
from .normal_forms import NormalForm as NormalForm, normal_form as normal_form
from .orbit import OrbitError as OrbitError, PeriodicOrbit as PeriodicOrbit
from .periodic import periodic as periodic
from .resilience import Resilience as Resilience, resilience as resilience
from .switching import switch as switch
from .torus import Torus as Torus, torus as torus
from .torus_branch import TorusBranch as TorusBranch
