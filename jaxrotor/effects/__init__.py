"""Physical effects on and around a shaft, one per file."""

from .annular_stator import AnnularStator as AnnularStator
from .ball_balancer import BallBalancer as BallBalancer, BallContact as BallContact
from .base import (
    AbstractBetween as AbstractBetween,
    AbstractBodies as AbstractBodies,
    AbstractCasing as AbstractCasing,
    AbstractContact as AbstractContact,
    AbstractDamping as AbstractDamping,
    AbstractEffect as AbstractEffect,
    AbstractLinear as AbstractLinear,
    AbstractLoad as AbstractLoad,
    AbstractOwnCoordinates as AbstractOwnCoordinates,
)
from .casing import Casing as Casing
from .coaxial_shaft import CoaxialShaft as CoaxialShaft
from .coupling import Coupling as Coupling, OldhamCoupling as OldhamCoupling
from .crack import Crack as Crack
from .cubic_spring import CubicSpring as CubicSpring
from .disc import Disc as Disc
from .external_damping import DiscDamping as DiscDamping, ExternalDamping as ExternalDamping
from .gravity import Gravity as Gravity
from .hysteretic_damping import HystereticDamping as HystereticDamping
from .internal_damping import InternalDamping as InternalDamping
from .journal_bearing import JournalBearing as JournalBearing
from .law import AbstractLaw as AbstractLaw, AbstractSmoothLaw as AbstractSmoothLaw, Now as Now
from .limiter import Limiter as Limiter
from .linear_magnetic_bearing import LinearMagneticBearing as LinearMagneticBearing
from .loose_pedestal import LoosePedestal as LoosePedestal
from .magnetic_bearing import MagneticBearing as MagneticBearing
from .modal_damping import ModalDamping as ModalDamping
from .rayleigh_damping import RayleighDamping as RayleighDamping
from .rolling_bearing import RollingBearing as RollingBearing
from .seal import Seal as Seal
from .squeeze_film import SqueezeFilm as SqueezeFilm
from .support import Support as Support
from .unbalance import Unbalance as Unbalance
