"""Lateral analysis of a machine in two bearings, as API Standard 617 and API RP 684 ask for it."""

from .analysis import (
    ONLY as ONLY,
    LateralAnalysis as LateralAnalysis,
    lateral_analysis as lateral_analysis,
)
from .criteria import HEADS as HEADS, Criterion as Criterion, verdict as verdict
from .critical_map import CriticalMap as CriticalMap, critical_map as critical_map
from .damped_response import CaseResponse as CaseResponse, vibration_limit as vibration_limit
from .level_one import LevelOne as LevelOne, level_one as level_one, ratio_limit as ratio_limit
from .scene_analysis import SceneAnalysis as SceneAnalysis
from .unbalance_cases import (
    UnbalanceCase as UnbalanceCase,
    residual_unbalance as residual_unbalance,
)
