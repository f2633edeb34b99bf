"""Laws of rotation of the shaft, one per file."""

from .base import AbstractSpin as AbstractSpin, Turning as Turning
from .constant import ConstantSpeed as ConstantSpeed
from .drive import Drive as Drive
from .profile import SpeedProfile as SpeedProfile
