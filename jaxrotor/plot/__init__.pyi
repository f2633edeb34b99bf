"""Plots: functions that draw a result and return its matplotlib Axes."""

from .accuracy import convergence as convergence, work_precision as work_precision
from .animation import animate as animate
from .annular_rub import annular_rub as annular_rub, dry_whirl as dry_whirl
from .attractors import attractors as attractors
from .balancer import balancer_at as balancer_at, balls as balls
from .bifurcation import bifurcation as bifurcation
from .branch import branch as branch
from .campbell import campbell as campbell
from .clickable import write_page as write_page
from .curves import curves as curves
from .envelope import envelope as envelope
from .error_map import error_map as error_map
from .escapes import escapes as escapes
from .explore import Explorer as Explorer, explore as explore
from .fitted import fitted as fitted
from .harmonics import harmonics as harmonics
from .history import history as history
from .lyapunov import lyapunov as lyapunov
from .mode_shapes import mode_shapes as mode_shapes
from .modes3d import modes3d as modes3d
from .onset import onset as onset
from .orbit import orbit as orbit, orbits as orbits
from .page import write as write
from .periodic import periodic as periodic
from .reactions import (
    hodograph as hodograph,
    reaction_vectors as reaction_vectors,
    reactions as reactions,
)
from .response import response as response
from .rotor import rotor as rotor
from .run_up import passage as passage, run_up as run_up, speed as speed
from .sensitivities import sensitivities as sensitivities
from .stability import (
    boundary_family as boundary_family,
    stability_chart as stability_chart,
    stability_map as stability_map,
)
from .sweep_map import sweep_map as sweep_map
from .tuning import tuning as tuning
from .units import units as units
from .waterfall import waterfall as waterfall
from .whirl import whirl_history as whirl_history, whirl_spectrum as whirl_spectrum
