"""Dataset: results as labelled arrays, with units and provenance."""

from typing import Any

import numpy as np
import xarray as xr

from ..core.attributes import about, variable
from ..core.plane import plane
from ..effects import AbstractBodies
from ..equations.system import state_names
from ..files.toml import dumps
from ..motion.history import TimeHistory
from ..motion.reactions import Reactions
from .provenance import assumed, chosen, versions


Variables = dict[str, Any]


def dataset(result: TimeHistory | Reactions) -> xr.Dataset:
    """A result as an `xarray.Dataset`: complex vectors as x and y along `axis`, units, provenance.

    `dataset(response).sel(time=slice(0.1, 0.2))` takes a part of it. Balls of all races are along
    `ball`, with the number of their `race`; places without a ball are left out.

    Args:
        result: what `simulate`, `run_up` or `reactions` returned.

    Returns:
        Dataset over `time`, and over `station`, `limiter`, `ball` or `bearing` where the result has them.
        Its attributes hold the scene as TOML text, the solver, the precision and the versions.
    """
    settings: Variables = {}
    if isinstance(result, Reactions):
        title, variables, coordinates = "reactions", *_reactions(result)
    else:
        title, variables, coordinates = "motion in time", *_motion(result)
        if result.balls:
            balls, races = _balls(result)
            variables, coordinates = variables | balls, coordinates | races
        units = state_names(result.scene) if result.states else {}
        for name, values in result.states.items():
            variables[name] = variable("time", values, units[name], "state of a law")
        if result.steps_per_revolution is not None:
            settings["steps_per_revolution"] = result.steps_per_revolution
        settings["method"] = result.method
        settings |= chosen(result.pilots)
    time = np.asarray(result.time)
    coordinates = {
        "time": variable("time", time, "s", "time since the start"),
        "angle": variable("time", result.angle, "rad", "angle of revolution"),
        **coordinates,
        "axis": ("axis", ["x", "y"]),
    }
    attributes = {
        "title": f"jaxrotor {title}",
        "scene": dumps(result.scene),
        **assumed(result.scene),
        **settings,
        "solver": result.solver,
        "precision": str(time.dtype),
        "versions": versions(),
    }
    return xr.Dataset(variables, coordinates, attributes)


def _motion(result: TimeHistory) -> tuple[Variables, Variables]:
    """Variables and coordinates that every motion in time has."""
    at_stations = ("time", "station")
    variables = {
        "displacement": _vector(at_stations, result.displacement, "m", "displacement"),
        "velocity": _vector(at_stations, result.velocity, "m/s", "velocity"),
        "slope": _vector(at_stations, result.slope, "rad", "slope dz/dx"),
        "speed": variable("time", result.speed, "rad/s", "speed of rotation"),
        "acceleration": variable(
            "time", result.acceleration, "rad/s^2", "acceleration of rotation"
        ),
    }
    force = result.contact_force
    if force is not None:
        name = "contact force on the shaft"
        variables["contact_force"] = _vector(("time", "limiter"), force, "N", name)
    return variables, {"station": variable("station", result.stations, "m", "station")}


def _balls(run: TimeHistory) -> tuple[Variables, Variables]:
    """Variables of the balls of all races, and the race of each; places without a ball left out."""
    present = [np.asarray(bodies.masses) > 0 for bodies in run.scene.of(AbstractBodies)]
    of_all_races = lambda name: np.concatenate(
        [
            np.asarray(getattr(balls, name))[:, places]
            for balls, places in zip(run.balls, present, strict=True)
        ],
        axis=1,
    )
    along = ("time", "ball")
    race = np.repeat(np.arange(len(present)), [places.sum() for places in present])
    variables = {
        "ball_angle": variable(
            along, of_all_races("angle"), "rad", "angle of a ball from the rotor"
        ),
        "ball_rate": variable(along, of_all_races("rate"), "rad/s", "its rate"),
        "imbalance": _vector(
            ("time",), run.imbalance, "kg m", "imbalance of rotor and balls, in its axes"
        ),
    }
    return variables, {"race": variable("ball", race, "1", "race of a ball")}


def _reactions(result: Reactions) -> tuple[Variables, Variables]:
    """Variables and coordinates of reactions: forces and moments, in motion and at rest."""
    dims = ("time", "bearing")
    parts = {
        "force": (dims, "N", "force on the rotor"),
        "moment": (dims, "N m", "moment on the rotor, positive with the slope"),
        "static": (dims[1:], "N", "force on the rotor at rest"),
        "static_moment": (dims[1:], "N m", "moment on the rotor at rest"),
    }
    variables = {
        name: _vector(dims, getattr(result, name), units, long_name)
        for name, (dims, units, long_name) in parts.items()
    }
    return variables, {"bearing": ("bearing", list(result.names))}


def _vector(dims: tuple[str, ...], values: Any, units: str, long_name: str) -> tuple:
    """A variable of complex numbers, as x and y."""
    return (*dims, "axis"), plane(np.asarray(values), axis=-1), about(units, long_name)
