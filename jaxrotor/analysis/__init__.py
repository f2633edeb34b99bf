"""Analyses of the linear rotor, in closed form."""

from .campbell import (
    Campbell as Campbell,
    CriticalSpeeds as CriticalSpeeds,
    campbell as campbell,
    critical_speeds as critical_speeds,
)
from .forced import UnbalanceResponse as UnbalanceResponse, unbalance_response as unbalance_response
from .modal import Modes as Modes, modes as modes, roots as roots
from .perturbation import Perturbation as Perturbation, perturbed_roots as perturbed_roots
from .reduction import (
    Reduction as Reduction,
    inertia_from_frequency as inertia_from_frequency,
    reduction as reduction,
)
from .stability import (
    Onset as Onset,
    onset_speed as onset_speed,
    stability_crossings as stability_crossings,
)
