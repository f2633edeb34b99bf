"""Dataset: results as labelled arrays, with units and what made them."""

import importlib.metadata
from typing import Any

import numpy as np
import xarray as xr

from .files import dumps
from .simulate import Response


def dataset(response: Response) -> xr.Dataset:
    """A response as an `xarray.Dataset`: complex motions as x and y along `axis`, units, provenance.

    `dataset(response).sel(time=slice(0.1, 0.2))` takes a part of it.
    """
    motion = ("time", "station", "axis")
    variables: dict[str, Any] = {
        "displacement": (motion, _parts(response.displacement), _about("m", "displacement")),
        "velocity": (motion, _parts(response.velocity), _about("m/s", "velocity")),
        "slope": (motion, _parts(response.slope), _about("rad", "slope dz/dx")),
    }
    if response.contact_force is not None:
        force = _parts(response.contact_force)
        about = _about("N", "contact force on the shaft")
        variables["contact_force"] = (("time", "limiter", "axis"), force, about)
    coordinates = {
        "time": ("time", np.asarray(response.time), _about("s", "time since the start")),
        "angle": ("time", np.asarray(response.angle), _about("rad", "angle of revolution")),
        "station": ("station", np.asarray(response.stations), _about("m", "station")),
        "axis": ("axis", ["x", "y"]),
    }
    about = {
        "title": "jaxrotor simulation",
        "scene": dumps(response.scene),
        "steps_per_revolution": response.steps_per_revolution,
        "solver": response.solver,
        "precision": str(np.asarray(response.time).dtype),
        "versions": versions(),
    }
    return xr.Dataset(variables, coordinates, about)


def _parts(values: Any) -> np.ndarray:
    values = np.asarray(values)
    return np.stack([values.real, values.imag], axis=-1)


def _about(units: str, long_name: str) -> dict[str, str]:
    return {"units": units, "long_name": long_name}


def versions() -> str:
    """Versions of the packages a result depends on."""
    names = ("jaxrotor", "jax", "diffrax", "equinox")
    return " ".join(f"{name} {importlib.metadata.version(name)}" for name in names)
