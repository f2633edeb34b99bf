"""Shaft models."""

from .constraint import Constraint as Constraint
from .flexible import FlexibleShaft as FlexibleShaft
from .line import AbstractLine as AbstractLine, AbstractShaft as AbstractShaft
from .massless import MasslessShaft as MasslessShaft
from .rigid import RigidShaft as RigidShaft
from .section import Step as Step
