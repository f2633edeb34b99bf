"""Laws of rotation of the shaft, one a file."""

from .base import (
    AbstractSpin as AbstractSpin,
    ConstantSpeed as ConstantSpeed,
    Drive as Drive,
    SpeedProfile as SpeedProfile,
    Turning as Turning,
)
