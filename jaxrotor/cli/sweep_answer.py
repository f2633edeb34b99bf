"""Printed answer of the command `sweep`."""

from typing import Any

import numpy as np
import xarray as xr

from ..core.outcome import STATUS, failed
from . import answer
from .options import rpm


def _range(path: str, values: np.ndarray, unit: str) -> str:
    """Description of a swept axis; a spin speed also in revolutions per minute."""
    low, high = values.min(), values.max()
    also = f" ({rpm(low):.6g} to {rpm(high):.6g} rpm)" if path == "spin.speed" else ""
    return f"{low:.6g} to {high:.6g} {unit}{also}, {values.size} values"


def lanes_of(dataset: xr.Dataset) -> dict[str, Any]:
    """Number of lanes by whirl and status, and the range of the index over those that whirl."""
    status = dataset["status"].values
    lost = failed(status)
    long = np.sum(status == STATUS.index("steps_too_long_for_a_stop"))
    if "index" not in dataset:
        return {"lanes": status.size, "failed": np.sum(lost), "steps_too_long": long}
    index = dataset["index"].values
    whirls = np.isfinite(index) & ~lost
    return {
        "lanes": index.size,
        "forward": np.sum(whirls & (index > 0)),
        "backward": np.sum(whirls & (index < 0)),
        "undefined": np.sum(~lost & ~(whirls & (index != 0))),
        "failed": np.sum(lost),
        "steps_too_long": long,
        "index_min": index[whirls].min() if whirls.any() else None,
        "index_max": index[whirls].max() if whirls.any() else None,
    }


def results(dataset: xr.Dataset, swept: list[str]) -> dict[str, Any]:
    """Swept values, and the variables with one number per lane."""
    coordinates = {
        path: {"units": dataset[path].attrs["units"], "values": dataset[path].values}
        for path in swept
    }
    single = {
        str(name): array.values
        for name, array in dataset.data_vars.items()
        if list(array.dims) == swept
    }
    return {"over": coordinates, **single}


def errors(dataset: xr.Dataset) -> dict[str, Any]:
    """Changes of the numbers under twice the steps, where estimated, and the settings chosen."""
    named = {
        str(name): {
            "largest": array.attrs["error"],
            "median": array.attrs["error_median"],
            "units": array.attrs["units"],
        }
        for name, array in dataset.data_vars.items()
        if "error" in array.attrs
    }
    found: dict[str, Any] = {"errors": named} if "error_lane" in dataset.coords else {}
    return found | {key: value for key, value in dataset.attrs.items() if key == "chosen"}


def _motion_rows(
    dataset: xr.Dataset, counts: dict[str, Any], lanes: dict[str, Any]
) -> list[tuple[str, str]]:
    """How long the lanes ran by what steps, and what they did."""
    solver = dataset.attrs["solver"]
    if "duration" in counts:
        peak = dataset["peak"].values[~failed(dataset["status"])]
        reached = f"{peak.min():.6g} to {peak.max():.6g} m" if peak.size else "none"
        steps = "steps by its tolerance"
        if "steps_per_sample" in counts:
            steps = f"{counts['steps_per_sample']} steps from sample to sample"
        return [
            ("run", f"{counts['duration']:.6g} s, {counts['samples']} samples"),
            ("solver", f"{solver}, {steps}"),
            ("lanes", f"{lanes['lanes']}"),
            ("largest radius", reached),
        ]
    each = "steps" if solver.startswith("Exponential") else "samples"
    return [
        ("revolutions", f"{counts['settle']} to settle, {counts['keep']} observed"),
        ("solver", f"{solver}, {counts['steps_per_revolution']} {each} each"),
        ("lanes", f"{lanes['lanes']}"),
        ("forward whirl", f"{lanes['forward']}"),
        ("backward whirl", f"{lanes['backward']}"),
    ]


def print_sweep(
    dataset: xr.Dataset,
    axes: dict[str, np.ndarray],
    counts: dict[str, Any],
    seconds: float,
    written: list[str],
) -> None:
    """Print what was swept, how the lanes ran, what they did and where it is written."""
    lanes = lanes_of(dataset)
    rows = [(path, _range(path, v, dataset[path].attrs["units"])) for path, v in axes.items()]
    rows += _motion_rows(dataset, counts, lanes)
    rows += [(name, f"{lanes[name]}") for name in ("undefined", "failed") if lanes.get(name)]
    if lanes["steps_too_long"]:
        text = f"{lanes['steps_too_long']} lanes, contact too stiff for the step; increase --steps"
        rows.append(("steps too long", text))
    if lanes.get("index_min") is not None:
        text = f"{lanes['index_min']:.6g} to {lanes['index_max']:.6g}"
        rows.append(("precession index", text))
    found = errors(dataset)
    rows += [("chosen", found["chosen"])] if "chosen" in found else []
    for name, one in found.get("errors", {}).items():
        text = f"{one['median']:.1e} (median), {one['largest']:.1e} (largest) {one['units']}"
        rows.append((f"error of {name}", text))
    if "errors" in found:
        rows.append(("errors from", f"{dataset.sizes['error_lane']} lanes, with twice the steps"))
    rows.append(("time", f"{seconds:.1f} s"))
    rows += answer.written(written)
    answer.print_table(rows)
