"""Design: parameters of a scene by gradients of what it does."""

from . import objectives as objectives
from .tune import History as History, Tuned as Tuned, tune as tune
from .uncertainty import Uncertainty as Uncertainty, uncertainty as uncertainty
