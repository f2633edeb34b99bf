"""Plots: functions that draw a result and return its matplotlib Axes."""

from .accuracy import convergence as convergence, work_precision as work_precision
from .balancer import balancer_at as balancer_at, balls as balls
from .bifurcation import bifurcation as bifurcation
from .branches import annular_rub as annular_rub, branch as branch, curves as curves
from .campbell import campbell as campbell
from .clickable import write_page as write_page
from .designs import fitted as fitted, tuning as tuning
from .diagnosis import diagnosis as diagnosis
from .explore import Explorer as Explorer, explore as explore
from .histories import (
    history as history,
    passage as passage,
    run_up as run_up,
    speed as speed,
    whirl_history as whirl_history,
)
from .lateral import (
    critical_map as critical_map,
    deflected_shapes as deflected_shapes,
    level_one as level_one,
)
from .lateral_report import lateral_report as lateral_report
from .modes import mode_shapes as mode_shapes, modes3d as modes3d
from .orbit import (
    animate as animate,
    orbit as orbit,
    orbits as orbits,
    periodic as periodic,
    resilience as resilience,
    torus as torus,
)
from .page import write as write
from .reactions import (
    hodograph as hodograph,
    reaction_vectors as reaction_vectors,
    reactions as reactions,
)
from .response import response as response
from .rotor import rotor as rotor
from .sensitivity import sensitivity as sensitivity
from .spectra import (
    harmonics as harmonics,
    waterfall as waterfall,
    whirl_spectrum as whirl_spectrum,
)
from .stability import (
    boundary_family as boundary_family,
    dry_whirl as dry_whirl,
    error_map as error_map,
    onset as onset,
    stability_chart as stability_chart,
    stability_map as stability_map,
)
from .statistics import escapes as escapes, lyapunov as lyapunov, sensitivities as sensitivities
from .sweep_maps import attractors as attractors, envelope as envelope, sweep_map as sweep_map
from .units import units as units
