"""Earlier names of modules, from before they were sorted into rooms: pickles and imports may have them."""

import importlib
import sys
import types
from typing import Any


EARLIER = {  # earlier name -> where its names live now, the first that has one counts
    "accuracy": ("work_precision.accuracy",),
    "attractors": ("sweeps.attractors",),
    "balancer": ("analysis.balancer",),
    "basins": ("sweeps.basins",),
    "blocks": ("core.blocks",),
    "dataset": ("results.dataset",),
    "escapes": ("sweeps.escapes",),
    "export": ("results.export",),
    "grid": ("sweeps.grid",),
    "hysteresis": ("sweeps.hysteresis",),
    "job": ("sweeps.job",),
    "lanes": ("sweeps.lanes",),
    "march": ("motion.revolutions", "motion.base"),
    "materials": ("shafts.materials",),
    "measures": ("work_precision.measures",),
    "methods": ("work_precision.methods",),
    "objectives": ("design.objectives",),
    "observe": ("sweeps.observe",),
    "orbits.curve": ("orbits.problem",),
    "outcome": ("core.outcome",),
    "pencil": ("equations.pencil",),
    "pilot": ("core.pilot",),
    "plausibility": ("core.plausibility",),
    "quantities": ("core.quantities",),
    "reactions": ("motion.reactions",),
    "report": ("plot.report",),
    "riccati": ("spins.riccati", "spins.base"),
    "run_up": ("motion.run_up", "equations.start"),
    "simulate": ("motion.simulate",),
    "spin": ("spins",),
    "start": ("equations.start",),
    "store": ("sweeps.store",),
    "sweep": ("sweeps.sweep",),
    "system": ("equations.system",),
    "transient": ("equations.rotating_frame",),
    "units": ("files.units",),
    "variants": ("files.variants",),
}


RENAMED = {  # classes that had another name there
    "Curve": "ContinuationProblem",
    "Instant": "Kinematics",
    "Orbit": "RevolutionSamples",
    "Posture": "RotatingState",
}


class _Earlier(types.ModuleType):
    """A module that is no longer there: its names are found where they live now."""

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("__"):  # tools ask every loaded module for these
            for place in EARLIER[self.__name__.removeprefix("jaxrotor.")]:
                module = importlib.import_module(f"jaxrotor.{place}")
                for known in (name, RENAMED.get(name, name)):
                    if hasattr(module, known):
                        return getattr(module, known)
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")


def keep_earlier_names() -> None:
    """Let the earlier modules be imported, and pickles that name them be read; loads nothing."""
    for name in EARLIER:
        sys.modules.setdefault(f"jaxrotor.{name}", _Earlier(f"jaxrotor.{name}"))
