"""Physical effects on and around a shaft, one per file."""

from .annular_stator import AnnularStator as AnnularStator
from .ball_balancer import BallBalancer as BallBalancer, BallContact as BallContact
from .base import (
    AbstractBetween as AbstractBetween,
    AbstractBodies as AbstractBodies,
    AbstractContact as AbstractContact,
    AbstractEffect as AbstractEffect,
    AbstractLaw as AbstractLaw,
    AbstractLinear as AbstractLinear,
    AbstractLoad as AbstractLoad,
)
from .cubic_spring import CubicSpring as CubicSpring
from .disc import Disc as Disc
from .external_damping import DiscDamping as DiscDamping, ExternalDamping as ExternalDamping
from .gravity import Gravity as Gravity
from .hysteretic_damping import HystereticDamping as HystereticDamping
from .internal_damping import InternalDamping as InternalDamping
from .limiter import Limiter as Limiter
from .support import Support as Support
from .unbalance import Unbalance as Unbalance
