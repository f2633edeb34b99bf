"""Analyses of the linear rotor, in closed form."""

from .campbell import (
    Campbell as Campbell,
    CriticalSpeeds as CriticalSpeeds,
    campbell as campbell,
    critical_speeds as critical_speeds,
)
from .floquet import floquet_multipliers as floquet_multipliers
from .forced import UnbalanceResponse as UnbalanceResponse, unbalance_response as unbalance_response
from .modal import Modes as Modes, modes as modes, roots as roots
from .perturbation import Perturbation as Perturbation, perturbed_roots as perturbed_roots
from .stability import (
    Onset as Onset,
    growth_rate as growth_rate,
    onset_speed as onset_speed,
    stability_crossings as stability_crossings,
)
