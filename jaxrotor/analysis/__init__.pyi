"""Analyses of the linear rotor: by its roots, or over a revolution where coefficients are periodic."""

from . import balancer as balancer
from .annular_rub import AnnularRub as AnnularRub, annular_rub as annular_rub
from .balancing import (
    FirstMoments as FirstMoments,
    Grade as Grade,
    allocated_unbalance as allocated_unbalance,
    balance_grade as balance_grade,
    bearing_grade as bearing_grade,
    bearing_stations as bearing_stations,
    centre_of_mass as centre_of_mass,
    first_moments as first_moments,
    permissible_unbalance as permissible_unbalance,
    rigid_correction as rigid_correction,
    rigid_residual as rigid_residual,
    total_mass as total_mass,
)
from .campbell import Campbell as Campbell, campbell as campbell
from .critical import (
    AxisSpeeds as AxisSpeeds,
    CriticalSpeeds as CriticalSpeeds,
    axis_speeds as axis_speeds,
    critical_speeds as critical_speeds,
)
from .dry_whirl import DryWhirl as DryWhirl, dry_whirl as dry_whirl
from .dry_whirl_map import DryWhirlMap as DryWhirlMap, dry_whirl_map as dry_whirl_map
from .field_balancing import (
    correction_masses as correction_masses,
    influence_coefficients as influence_coefficients,
)
from .films import StaticPositions as StaticPositions, film_support as film_support
from .floquet import floquet_multipliers as floquet_multipliers
from .forced import (
    HarmonicForce as HarmonicForce,
    HarmonicResponse as HarmonicResponse,
    WeightResponse as WeightResponse,
    forced_response as forced_response,
    steady_state as steady_state,
    unbalance_response as unbalance_response,
    weight_response as weight_response,
)
from .growth import growth_rate as growth_rate
from .inertia import MassProperties as MassProperties, mass_properties as mass_properties
from .influence import (
    Correction as Correction,
    Influence as Influence,
    UnbalanceEstimate as UnbalanceEstimate,
    fitted_influence as fitted_influence,
)
from .lateral import (
    CaseResponse as CaseResponse,
    Criterion as Criterion,
    CriticalMap as CriticalMap,
    LateralAnalysis as LateralAnalysis,
    LevelOne as LevelOne,
    SceneAnalysis as SceneAnalysis,
    UnbalanceCase as UnbalanceCase,
    critical_map as critical_map,
    lateral_analysis as lateral_analysis,
    level_one as level_one,
    residual_unbalance as residual_unbalance,
    vibration_limit as vibration_limit,
)
from .linearized import linearized as linearized, static_positions as static_positions
from .magnetic import MagneticPositions as MagneticPositions
from .maps import (
    Boundary as Boundary,
    StabilityMap as StabilityMap,
    stability_boundary as stability_boundary,
    stability_map as stability_map,
)
from .modal import Modes as Modes, modes as modes, roots as roots
from .nodes import chosen_nodes as chosen_nodes
from .peaks import (
    Margins as Margins,
    ResponsePeaks as ResponsePeaks,
    response_peaks as response_peaks,
)
from .perturbation import Perturbation as Perturbation, perturbed_roots as perturbed_roots
from .reduction import (
    Reduction as Reduction,
    inertia_from_frequency as inertia_from_frequency,
    reduction as reduction,
)
from .rolling import RollingPositions as RollingPositions
from .sensitivity import Sensitivity as Sensitivity, sensitivity as sensitivity
from .settling import Settled as Settled, settled as settled
from .stability import (
    Onset as Onset,
    onset_speed as onset_speed,
    stability_crossings as stability_crossings,
)
from .state_space import state_space as state_space
