"""Objectives: numbers of a scene to tune by, each with where it is smooth.

They are functions of a scene and options, to be combined freely: `lambda scene: objectives.anisotropy(
scene, speeds) - 1e-3 * objectives.onset_speed(scene)`. What is to grow gets a minus sign.
"""

from .balls import balancing_time as balancing_time, residual_imbalance as residual_imbalance
from .means import peak as peak
from .motion import (
    Rub as Rub,
    contact_peak as contact_peak,
    contact_rms as contact_rms,
    contact_work as contact_work,
    reaction_peak as reaction_peak,
    reaction_rms as reaction_rms,
    rub as rub,
)
from .response import (
    anisotropy as anisotropy,
    twice_response as twice_response,
    twice_share as twice_share,
    unbalance_peak as unbalance_peak,
    unbalance_rms as unbalance_rms,
)
from .stability import (
    critical_gap as critical_gap,
    damping_ratio as damping_ratio,
    largest_growth as largest_growth,
    onset_speed as onset_speed,
)
