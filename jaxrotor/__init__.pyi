"""Public names of `jaxrotor`; each is loaded at its first use."""

from . import (
    analysis as analysis,
    design as design,
    effects as effects,
    files as files,
    orbits as orbits,
    plot as plot,
    shafts as shafts,
    solvers as solvers,
)
from .analysis import (
    AnnularRub as AnnularRub,
    AxisSpeeds as AxisSpeeds,
    Boundary as Boundary,
    Campbell as Campbell,
    CaseResponse as CaseResponse,
    Correction as Correction,
    Criterion as Criterion,
    CriticalMap as CriticalMap,
    CriticalSpeeds as CriticalSpeeds,
    DryWhirl as DryWhirl,
    DryWhirlMap as DryWhirlMap,
    FirstMoments as FirstMoments,
    Grade as Grade,
    HarmonicForce as HarmonicForce,
    HarmonicResponse as HarmonicResponse,
    Influence as Influence,
    LateralAnalysis as LateralAnalysis,
    LevelOne as LevelOne,
    MagneticPositions as MagneticPositions,
    Margins as Margins,
    MassProperties as MassProperties,
    Modes as Modes,
    Onset as Onset,
    Perturbation as Perturbation,
    Reduction as Reduction,
    ResponsePeaks as ResponsePeaks,
    RollingPositions as RollingPositions,
    SceneAnalysis as SceneAnalysis,
    Sensitivity as Sensitivity,
    Settled as Settled,
    StabilityMap as StabilityMap,
    StaticPositions as StaticPositions,
    UnbalanceCase as UnbalanceCase,
    UnbalanceEstimate as UnbalanceEstimate,
    WeightResponse as WeightResponse,
    allocated_unbalance as allocated_unbalance,
    annular_rub as annular_rub,
    axis_speeds as axis_speeds,
    balance_grade as balance_grade,
    balancer as balancer,
    bearing_grade as bearing_grade,
    bearing_stations as bearing_stations,
    campbell as campbell,
    centre_of_mass as centre_of_mass,
    chosen_nodes as chosen_nodes,
    correction_masses as correction_masses,
    critical_map as critical_map,
    critical_speeds as critical_speeds,
    dry_whirl as dry_whirl,
    dry_whirl_map as dry_whirl_map,
    film_support as film_support,
    first_moments as first_moments,
    fitted_influence as fitted_influence,
    floquet_multipliers as floquet_multipliers,
    forced_response as forced_response,
    growth_rate as growth_rate,
    inertia_from_frequency as inertia_from_frequency,
    influence_coefficients as influence_coefficients,
    lateral_analysis as lateral_analysis,
    level_one as level_one,
    linearized as linearized,
    mass_properties as mass_properties,
    modes as modes,
    onset_speed as onset_speed,
    permissible_unbalance as permissible_unbalance,
    perturbed_roots as perturbed_roots,
    reduction as reduction,
    residual_unbalance as residual_unbalance,
    response_peaks as response_peaks,
    rigid_correction as rigid_correction,
    rigid_residual as rigid_residual,
    roots as roots,
    sensitivity as sensitivity,
    settled as settled,
    stability_boundary as stability_boundary,
    stability_crossings as stability_crossings,
    stability_map as stability_map,
    state_space as state_space,
    static_positions as static_positions,
    steady_state as steady_state,
    total_mass as total_mass,
    unbalance_response as unbalance_response,
    vibration_limit as vibration_limit,
    weight_response as weight_response,
)
from .core.caller import FewStepsWarning as FewStepsWarning
from .core.pilot import Pilot as Pilot
from .core.plausibility import ImplausibleWarning as ImplausibleWarning
from .core.program_cache import keep_programs as keep_programs
from .design import (
    Diagnosis as Diagnosis,
    Estimate as Estimate,
    Explanation as Explanation,
    Fitted as Fitted,
    History as History,
    OrbitRecord as OrbitRecord,
    ResponseRecord as ResponseRecord,
    Smoothed as Smoothed,
    SpectrumRecord as SpectrumRecord,
    TimeRecord as TimeRecord,
    Tuned as Tuned,
    Uncertainty as Uncertainty,
    diagnose as diagnose,
    diagnose_each as diagnose_each,
    draws as draws,
    exceedance as exceedance,
    expectation as expectation,
    fit as fit,
    objectives as objectives,
    over_draws as over_draws,
    probability as probability,
    sensitivities as sensitivities,
    tune as tune,
    uncertainty as uncertainty,
)
from .effects import (
    AnnularStator as AnnularStator,
    BallBalancer as BallBalancer,
    BallContact as BallContact,
    Casing as Casing,
    CoaxialShaft as CoaxialShaft,
    Coupling as Coupling,
    Crack as Crack,
    CubicSpring as CubicSpring,
    Disc as Disc,
    DiscDamping as DiscDamping,
    ExternalDamping as ExternalDamping,
    Gravity as Gravity,
    HystereticDamping as HystereticDamping,
    InternalDamping as InternalDamping,
    JournalBearing as JournalBearing,
    Limiter as Limiter,
    LinearMagneticBearing as LinearMagneticBearing,
    LoosePedestal as LoosePedestal,
    MagneticBearing as MagneticBearing,
    ModalDamping as ModalDamping,
    OldhamCoupling as OldhamCoupling,
    RayleighDamping as RayleighDamping,
    RollingBearing as RollingBearing,
    Seal as Seal,
    SqueezeFilm as SqueezeFilm,
    Support as Support,
    Unbalance as Unbalance,
)
from .equations.start import (
    AtRest as AtRest,
    Balls as Balls,
    Continued as Continued,
    Launch as Launch,
    Whirl as Whirl,
)
from .equations.system import System as System, assemble as assemble
from .files.machine import (
    Clearance as Clearance,
    Machine as Machine,
    Probe as Probe,
    Stage as Stage,
    machine as machine,
)
from .files.ross import from_ross as from_ross
from .files.shipped import shipped as shipped
from .files.tables import read_shaft as read_shaft, read_support as read_support
from .files.toml import load as load, loads as loads, save as save, study as study, title as title
from .files.units import SceneError as SceneError
from .files.variants import Variant as Variant, variants as variants
from .motion.history import TimeHistory as TimeHistory
from .motion.reactions import Reactions as Reactions, reactions as reactions
from .motion.run_up import run_up as run_up
from .motion.simulate import chosen_steps as chosen_steps, simulate as simulate
from .orbits import (
    BifurcationCurve as BifurcationCurve,
    Branch as Branch,
    BranchPoint as BranchPoint,
    CurvePoint as CurvePoint,
    Edge as Edge,
    HarmonicOrbit as HarmonicOrbit,
    Lyapunov as Lyapunov,
    NormalForm as NormalForm,
    OrbitError as OrbitError,
    PeriodicOrbit as PeriodicOrbit,
    Resilience as Resilience,
    Torus as Torus,
    TorusBranch as TorusBranch,
    continue_ as continue_,
    continue_curve as continue_curve,
    edge as edge,
    harmonic_balance as harmonic_balance,
    lyapunov as lyapunov,
    normal_form as normal_form,
    periodic as periodic,
    resilience as resilience,
    switch as switch,
    torus as torus,
)
from .plot.lateral_report import lateral_report as lateral_report
from .plot.report import report as report
from .results.dataset import dataset as dataset
from .results.export import export as export, table as table
from .scene import Scene as Scene
from .shafts import (
    Constraint as Constraint,
    FlexibleShaft as FlexibleShaft,
    MasslessShaft as MasslessShaft,
    RigidShaft as RigidShaft,
    Step as Step,
)
from .shafts.materials import Material as Material, steel as steel
from .solvers import Exponential as Exponential
from .spins.base import Turning as Turning
from .spins.constant import ConstantSpeed as ConstantSpeed
from .spins.drive import Drive as Drive
from .spins.profile import SpeedProfile as SpeedProfile
from .spins.riccati import (
    blow_up_time as blow_up_time,
    relaxation_rate as relaxation_rate,
    riccati as riccati,
    steady_speed as steady_speed,
    stop_time as stop_time,
)
from .sweeps import observe as observe
from .sweeps.attractors import attractors as attractors
from .sweeps.basins import basins as basins
from .sweeps.classify import classify as classify
from .sweeps.escapes import escapes as escapes
from .sweeps.sweep import sweep as sweep
from .work_precision import measures as measures, methods as methods
from .work_precision.accuracy import accuracy as accuracy
