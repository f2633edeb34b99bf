"""jaxrotor: differentiable rotor dynamics."""

import os


# Matrices this small lose by threads (a Campbell diagram takes 13 times as long on two cores); read
# when the linear algebra is first loaded, so a value of your own set before that stands.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax  # noqa: E402


if "JAX_ENABLE_X64" not in os.environ:  # float32 is a choice, made in the environment
    jax.config.update("jax_enable_x64", True)

from . import measures as measures, methods as methods, observe as observe  # noqa: E402
from .accuracy import accuracy as accuracy  # noqa: E402
from .analysis import (  # noqa: E402
    AxisSpeeds as AxisSpeeds,
    Boundary as Boundary,
    Campbell as Campbell,
    CriticalSpeeds as CriticalSpeeds,
    FirstMoments as FirstMoments,
    Grade as Grade,
    HarmonicForce as HarmonicForce,
    HarmonicResponse as HarmonicResponse,
    MassProperties as MassProperties,
    Modes as Modes,
    Onset as Onset,
    Perturbation as Perturbation,
    Reduction as Reduction,
    Settled as Settled,
    StabilityMap as StabilityMap,
    WeightResponse as WeightResponse,
    allocated_unbalance as allocated_unbalance,
    axis_speeds as axis_speeds,
    balance_grade as balance_grade,
    balancer as balancer,
    bearing_grade as bearing_grade,
    bearing_stations as bearing_stations,
    campbell as campbell,
    centre_of_mass as centre_of_mass,
    chosen_nodes as chosen_nodes,
    correction_masses as correction_masses,
    critical_speeds as critical_speeds,
    first_moments as first_moments,
    floquet_multipliers as floquet_multipliers,
    forced_response as forced_response,
    growth_rate as growth_rate,
    inertia_from_frequency as inertia_from_frequency,
    influence_coefficients as influence_coefficients,
    mass_properties as mass_properties,
    modes as modes,
    onset_speed as onset_speed,
    permissible_unbalance as permissible_unbalance,
    perturbed_roots as perturbed_roots,
    reduction as reduction,
    rigid_correction as rigid_correction,
    rigid_residual as rigid_residual,
    roots as roots,
    settled as settled,
    stability_boundary as stability_boundary,
    stability_crossings as stability_crossings,
    stability_map as stability_map,
    state_space as state_space,
    steady_state as steady_state,
    total_mass as total_mass,
    unbalance_response as unbalance_response,
    weight_response as weight_response,
)
from .attractors import attractors as attractors  # noqa: E402
from .basins import basins as basins  # noqa: E402
from .dataset import dataset as dataset  # noqa: E402
from .design import (  # noqa: E402
    History as History,
    Tuned as Tuned,
    Uncertainty as Uncertainty,
    objectives as objectives,
    tune as tune,
    uncertainty as uncertainty,
)
from .effects import (  # noqa: E402
    BallBalancer as BallBalancer,
    BallContact as BallContact,
    CubicSpring as CubicSpring,
    Disc as Disc,
    DiscDamping as DiscDamping,
    ExternalDamping as ExternalDamping,
    Gravity as Gravity,
    HystereticDamping as HystereticDamping,
    InternalDamping as InternalDamping,
    Limiter as Limiter,
    Support as Support,
    Unbalance as Unbalance,
)
from .escapes import escapes as escapes  # noqa: E402
from .export import export as export, table as table  # noqa: E402
from .files import (  # noqa: E402
    load as load,
    loads as loads,
    save as save,
    shipped as shipped,
    study as study,
    title as title,
)
from .hysteresis import hysteresis as hysteresis  # noqa: E402
from .materials import Material as Material, steel as steel  # noqa: E402
from .orbits import (  # noqa: E402
    Branch as Branch,
    BranchPoint as BranchPoint,
    HarmonicOrbit as HarmonicOrbit,
    Lyapunov as Lyapunov,
    OrbitError as OrbitError,
    PeriodicOrbit as PeriodicOrbit,
    continue_ as continue_,
    harmonic_balance as harmonic_balance,
    lyapunov as lyapunov,
    periodic as periodic,
)
from .pilot import Pilot as Pilot  # noqa: E402
from .reactions import Reactions as Reactions, reactions as reactions  # noqa: E402
from .report import report as report  # noqa: E402
from .riccati import (  # noqa: E402
    blow_up_time as blow_up_time,
    relaxation_rate as relaxation_rate,
    riccati as riccati,
    steady_speed as steady_speed,
    stop_time as stop_time,
)
from .ross import from_ross as from_ross  # noqa: E402
from .run_up import (  # noqa: E402
    Balls as Balls,
    Launch as Launch,
    RunUp as RunUp,
    run_up as run_up,
)
from .scene import Scene as Scene  # noqa: E402
from .shafts import (  # noqa: E402
    Constraint as Constraint,
    FlexibleShaft as FlexibleShaft,
    MasslessShaft as MasslessShaft,
    RigidShaft as RigidShaft,
    Step as Step,
)
from .simulate import (  # noqa: E402
    Response as Response,
    chosen_steps as chosen_steps,
    simulate as simulate,
)
from .solvers import Exponential as Exponential  # noqa: E402
from .spin import (  # noqa: E402
    ConstantSpeed as ConstantSpeed,
    Drive as Drive,
    SpeedProfile as SpeedProfile,
    Turning as Turning,
)
from .start import AtRest as AtRest, Continued as Continued, Whirl as Whirl  # noqa: E402
from .sweep import sweep as sweep  # noqa: E402
from .system import System as System, assemble as assemble  # noqa: E402
from .units import SceneError as SceneError  # noqa: E402
from .variants import Variant as Variant, variants as variants  # noqa: E402
