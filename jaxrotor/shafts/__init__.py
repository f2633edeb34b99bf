"""Shaft models."""

from .flexible import FlexibleShaft as FlexibleShaft
from .line import AbstractLine as AbstractLine, AbstractShaft as AbstractShaft
from .massless import MasslessShaft as MasslessShaft
