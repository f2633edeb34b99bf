"""Shaft models."""

from .flexible import Constraint as Constraint, FlexibleShaft as FlexibleShaft
from .line import AbstractLine as AbstractLine, AbstractShaft as AbstractShaft
from .massless import MasslessShaft as MasslessShaft
from .section import Step as Step
