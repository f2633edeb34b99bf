"""Design: parameters of a scene by gradients of what it does."""

from . import objectives as objectives
from .fit import Fitted as Fitted, fit as fit
from .records import TimeRecord as TimeRecord
from .steady_records import (
    OrbitRecord as OrbitRecord,
    ResponseRecord as ResponseRecord,
    SpectrumRecord as SpectrumRecord,
)
from .tolerances import (
    Estimate as Estimate,
    draws as draws,
    expectation as expectation,
    over_draws as over_draws,
    probability as probability,
    sensitivities as sensitivities,
)
from .tune import History as History, Tuned as Tuned, tune as tune
from .uncertainty import Uncertainty as Uncertainty, uncertainty as uncertainty
