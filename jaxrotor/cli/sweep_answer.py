"""Answer of the command `sweep`: what the lanes did, in numbers and as rows of a table."""

from typing import Any

import numpy as np
import xarray as xr

from ..core.outcome import FAILED, STATUS, failed
from ..scene import Scene
from . import answer
from .axis_units import ends_in, written_in


_RANGES = 3  # of values with contact that are named


def _range(values: np.ndarray) -> str:
    """Smallest and largest of some values, or the only one."""
    low, high = values.min(), values.max()
    return f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"


def _contact_rows(
    dataset: xr.Dataset, axes: dict[str, np.ndarray], scales: dict[str, tuple[float, str]]
) -> answer.Rows:
    """How many lanes touch a stop, how long at most, and over one swept parameter at which values."""
    if "duty" not in dataset:
        return []
    duty = dataset["duty"].where(~dataset["status"].isin(FAILED), 0.0)
    touches = (duty > 0).any("limiter")
    count, most = int(touches.sum()), float(duty.max())
    if not count:
        return [("contact", "none")]
    rows = [
        ("contact", f"{count} of {touches.size} lanes, a stop up to {100 * most:.3g} % of the time")
    ]
    if len(axes) == 1 and count < touches.size:
        ((path, values),) = axes.items()
        factor, unit = scales[path]
        order = np.argsort(values)
        there = touches.any([dim for dim in touches.dims if dim != path]).values[order]
        starts = np.flatnonzero(np.diff(there, prepend=False))  # ranges begin and end in turn
        parts = np.split(factor * values[order], starts)[1::2]
        said = [_range(part) for part in parts[:_RANGES]]
        more = f" and {len(parts) - _RANGES} more ranges" if len(parts) > _RANGES else ""
        rows.append(("", f"at {path} {', '.join(said)} {unit}{more}"))
    return rows


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
    found: dict[str, Any] = {}
    if "error_lane" in dataset.coords:
        diverging = dataset["diverges"].values.sum() if "diverges" in dataset else 0
        found = {"errors": named, "diverging": int(diverging)}
    return found | {key: value for key, value in dataset.attrs.items() if key == "chosen"}


def _motion_rows(
    dataset: xr.Dataset, found: dict[str, Any], rotor: Scene, units: dict[str, Any]
) -> answer.Rows:
    """How long the lanes ran by what steps, and what they did."""
    solver = dataset.attrs["solver"]
    if "duration" in found:
        peak = dataset["peak"].values[~failed(dataset["status"])]
        ends = (peak.min(initial=np.inf), peak.max(initial=0.0))
        steps = "steps by its tolerance"
        if "steps_per_sample" in found:
            steps = f"{found['steps_per_sample']} steps from sample to sample"
        return [
            ("run", f"{found['duration']:.6g} s, {found['samples']} samples"),
            ("solver", f"{solver}, {steps}"),
            ("lanes", f"{found['lanes']}"),
            ("largest radius", ends_in(units, "m", ends, rotor) if peak.size else "none"),
        ]
    each = "steps" if solver.startswith("Exponential") else "samples"
    return [
        ("revolutions", f"{found['settle']} to settle, {found['keep']} observed"),
        ("solver", f"{solver}, {found['steps_per_revolution']} {each} each"),
        ("lanes", f"{found['lanes']}"),
        ("forward whirl", f"{found['forward']}"),
        ("backward whirl", f"{found['backward']}"),
    ]


def sweep_rows(
    dataset: xr.Dataset,
    axes: dict[str, np.ndarray],
    found: dict[str, Any],
    rotor: Scene,
    units: dict[str, Any],
) -> answer.Rows:
    """Rows of what was swept, how the lanes ran and what they did, `found`; see `axis_units`."""
    scales = {p: written_in(units, dataset[p].attrs["units"], v, rotor) for p, v in axes.items()}
    rows = [
        (path, f"{_range(scales[path][0] * v)} {scales[path][1]}, {v.size} values")
        for path, v in axes.items()
    ]
    rows += _motion_rows(dataset, found, rotor, units)
    rows += _contact_rows(dataset, axes, scales)
    rows += [(name, f"{found[name]}") for name in ("undefined", "failed") if found.get(name)]
    if found["steps_too_long"]:
        text = f"{found['steps_too_long']} lanes, contact too stiff for the step; increase --steps"
        rows.append(("steps too long", text))
    if found.get("index_min") is not None:
        text = f"{found['index_min']:.6g} to {found['index_max']:.6g}"
        rows.append(("precession index", text))
    rows += answer.filled({"chosen": found.get("chosen")})
    for name, one in found.get("errors", {}).items():
        text = f"{one['median']:.1e} (median), {one['largest']:.1e} (largest) {one['units']}"
        rows.append((f"error of {name}", text))
    if "errors" in found:
        text = f"{dataset.sizes['error_lane']} lanes, with twice the steps"
        diverging = found["diverging"]
        if diverging:
            text += f"; {diverging} of them left out, whose neighbours leave them, as in chaos"
        rows.append(("errors from", text))
    return [*rows, ("time", f"{found['seconds']:.1f} s")]
