"""jaxrotor: differentiable rotor dynamics."""

import os

import jax


if "JAX_ENABLE_X64" not in os.environ:  # float32 is a choice, made in the environment
    jax.config.update("jax_enable_x64", True)

from . import observe as observe  # noqa: E402
from .analysis import (  # noqa: E402
    Boundary as Boundary,
    Campbell as Campbell,
    CriticalSpeeds as CriticalSpeeds,
    HarmonicForce as HarmonicForce,
    HarmonicResponse as HarmonicResponse,
    Modes as Modes,
    Onset as Onset,
    Perturbation as Perturbation,
    Reduction as Reduction,
    StabilityMap as StabilityMap,
    WeightResponse as WeightResponse,
    balancer as balancer,
    campbell as campbell,
    critical_speeds as critical_speeds,
    floquet_multipliers as floquet_multipliers,
    forced_response as forced_response,
    growth_rate as growth_rate,
    inertia_from_frequency as inertia_from_frequency,
    modes as modes,
    onset_speed as onset_speed,
    perturbed_roots as perturbed_roots,
    reduction as reduction,
    roots as roots,
    stability_boundary as stability_boundary,
    stability_crossings as stability_crossings,
    stability_map as stability_map,
    unbalance_response as unbalance_response,
    weight_response as weight_response,
)
from .dataset import dataset as dataset  # noqa: E402
from .effects import (  # noqa: E402
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
from .files import (  # noqa: E402
    load as load,
    loads as loads,
    save as save,
    shipped as shipped,
    study as study,
)
from .materials import Material as Material, steel as steel  # noqa: E402
from .scene import Scene as Scene  # noqa: E402
from .shafts import (  # noqa: E402
    Constraint as Constraint,
    FlexibleShaft as FlexibleShaft,
    MasslessShaft as MasslessShaft,
    Step as Step,
)
from .simulate import Response as Response, simulate as simulate  # noqa: E402
from .solvers import Exponential as Exponential  # noqa: E402
from .spin import ConstantSpeed as ConstantSpeed  # noqa: E402
from .start import AtRest as AtRest, Continued as Continued, Whirl as Whirl  # noqa: E402
from .sweep import sweep as sweep  # noqa: E402
from .system import System as System, assemble as assemble  # noqa: E402
from .units import SceneError as SceneError  # noqa: E402
