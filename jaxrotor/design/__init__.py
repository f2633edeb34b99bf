"""Design: parameters of a scene by gradients of what it does."""

from . import objectives as objectives
from .diagnosis import Diagnosis as Diagnosis, diagnose as diagnose, diagnose_each as diagnose_each
from .estimates import (
    Estimate as Estimate,
    Smoothed as Smoothed,
    exceedance as exceedance,
    expectation as expectation,
    probability as probability,
)
from .explanation import Explanation as Explanation
from .fit import Fitted as Fitted, fit as fit
from .records import TimeRecord as TimeRecord
from .steady_records import (
    OrbitRecord as OrbitRecord,
    ResponseRecord as ResponseRecord,
    SpectrumRecord as SpectrumRecord,
)
from .tolerances import (
    draws as draws,
    over_draws as over_draws,
    sensitivities as sensitivities,
)
from .tune import History as History, Tuned as Tuned, tune as tune
from .uncertainty import Uncertainty as Uncertainty, uncertainty as uncertainty
