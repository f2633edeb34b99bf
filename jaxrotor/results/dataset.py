"""Dataset: results as labelled arrays, with units and what made them."""

from typing import Any

import numpy as np
import xarray as xr

from ..effects import AbstractBodies
from ..files.toml import dumps
from ..motion.reactions import Reactions
from ..motion.run_up import RunUp
from ..motion.simulate import Response
from .provenance import assumed, chosen, versions


Variables = dict[str, Any]


def dataset(result: Response | RunUp | Reactions) -> xr.Dataset:
    """A result as an `xarray.Dataset`: complex vectors as x and y along `axis`, units, provenance.

    `dataset(response).sel(time=slice(0.1, 0.2))` takes a part of it. Balls of all races are along
    `ball`, with the number of their `race`; places without a ball are left out.
    """
    about: Variables = {}
    match result:
        case Response():
            title, variables, own = "simulation", *_motion(result)
            slope = _vector(("time", "station"), result.slope, "rad", "slope dz/dx")
            variables = {**variables, "slope": slope}
            about["steps_per_revolution"] = result.steps_per_revolution
            about |= chosen(result.pilots)
        case RunUp():
            title, variables, own = "run-up", *_motion(result)
            variables |= _spin(result)
            if result.balls:
                more, place = _balls(result)
                variables, own = variables | more, own | place
        case Reactions():
            title, variables, own = "reactions", *_reactions(result)
    time = np.asarray(result.time)
    coordinates = {
        "time": ("time", time, _about("s", "time since the start")),
        "angle": ("time", np.asarray(result.angle), _about("rad", "angle of revolution")),
        **own,
        "axis": ("axis", ["x", "y"]),
    }
    about = {
        "title": f"jaxrotor {title}",
        "scene": dumps(result.scene),
        **assumed(result.scene),
        **about,
        "solver": result.solver,
        "precision": str(time.dtype),
        "versions": versions(),
    }
    return xr.Dataset(variables, coordinates, about)


def _motion(result: Response | RunUp) -> tuple[Variables, Variables]:
    """What every motion in time has, and its coordinates."""
    variables = {
        "displacement": _vector(("time", "station"), result.displacement, "m", "displacement"),
        "velocity": _vector(("time", "station"), result.velocity, "m/s", "velocity"),
    }
    force = result.contact_force
    if force is not None:
        name = "contact force on the shaft"
        variables["contact_force"] = _vector(("time", "limiter"), force, "N", name)
    return variables, {"station": ("station", np.asarray(result.stations), _about("m", "station"))}


def _spin(run: RunUp) -> Variables:
    return {
        "speed": ("time", np.asarray(run.speed), _about("rad/s", "speed of rotation")),
        "acceleration": (
            "time",
            np.asarray(run.acceleration),
            _about("rad/s^2", "acceleration of rotation"),
        ),
    }


def _balls(run: RunUp) -> tuple[Variables, Variables]:
    there = [np.asarray(bodies.masses) > 0 for bodies in run.scene.of(AbstractBodies)]
    together = lambda name: np.concatenate(
        [
            np.asarray(getattr(row, name))[:, some]
            for row, some in zip(run.balls, there, strict=True)
        ],
        axis=1,
    )
    race = np.repeat(np.arange(len(there)), [some.sum() for some in there])
    variables = {
        "ball_angle": (
            ("time", "ball"),
            together("angle"),
            _about("rad", "angle of a ball from the rotor"),
        ),
        "ball_rate": (("time", "ball"), together("rate"), _about("rad/s", "its rate")),
        "imbalance": _vector(
            ("time",), run.imbalance, "kg m", "imbalance of rotor and balls, in its axes"
        ),
    }
    return variables, {"race": ("ball", race, _about("1", "race of a ball"))}


def _reactions(result: Reactions) -> tuple[Variables, Variables]:
    parts = ("time", "bearing")
    about = {
        "force": (parts, "N", "force on the rotor"),
        "moment": (parts, "N m", "moment on the rotor, positive with the slope"),
        "static": (parts[1:], "N", "force on the rotor at rest"),
        "static_moment": (parts[1:], "N m", "moment on the rotor at rest"),
    }
    variables = {
        name: _vector(dims, getattr(result, name), units, long_name)
        for name, (dims, units, long_name) in about.items()
    }
    return variables, {"bearing": ("bearing", list(result.names))}


def _vector(dims: tuple[str, ...], values: Any, units: str, long_name: str) -> tuple:
    """A variable of complex numbers, as x and y."""
    values = np.asarray(values)
    parts = np.stack([values.real, values.imag], axis=-1)
    return (*dims, "axis"), parts, _about(units, long_name)


def _about(units: str, long_name: str) -> dict[str, str]:
    return {"units": units, "long_name": long_name}
