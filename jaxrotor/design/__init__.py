"""Design: parameters of a scene by gradients of what it does."""

from . import objectives as objectives
from .tolerances import (
    Estimate as Estimate,
    average as average,
    draws as draws,
    over_draws as over_draws,
    sensitivities as sensitivities,
    share as share,
)
from .tune import History as History, Tuned as Tuned, tune as tune
from .uncertainty import Uncertainty as Uncertainty, uncertainty as uncertainty
