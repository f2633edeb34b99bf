"""Earlier names of modules, from before they were in folders; pickles and imports may use them."""

import importlib
import sys
import types
from typing import Any


EARLIER = {  # earlier name -> modules that define its names now, searched in this order
    "accuracy": ("work_precision.accuracy",),
    "attractors": ("sweeps.attractors",),
    "balancer": ("analysis.balancer",),
    "basins": ("sweeps.basins",),
    "blocks": ("core.blocks",),
    "dataset": ("results.dataset",),
    "escapes": ("sweeps.escapes",),
    "export": ("results.export",),
    "grid": ("sweeps.grid",),
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


RENAMED = {  # earlier name of a class -> its name now
    "Curve": "ContinuationProblem",
    "Instant": "Kinematics",
    "Orbit": "Window",
    "Posture": "RotatingState",
}


class _Earlier(types.ModuleType):
    """Stand-in for a module that was moved: its names are looked up where they are defined now."""

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("__"):  # tools query these of every loaded module
            for place in EARLIER[self.__name__.removeprefix("jaxrotor.")]:
                module = importlib.import_module(f"jaxrotor.{place}")
                for known in (name, RENAMED.get(name, name)):
                    if hasattr(module, known):
                        return getattr(module, known)
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")


def keep_earlier_names() -> None:
    """Make the earlier names importable, also for pickles that use them, without loading anything."""
    for name in EARLIER:
        sys.modules.setdefault(f"jaxrotor.{name}", _Earlier(f"jaxrotor.{name}"))
