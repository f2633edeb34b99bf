"""Accuracy: the error of a number of a scene, and its cost in time, by every method."""

import dataclasses
import math
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
import xarray as xr

from ..core.attributes import about, flags
from ..core.checks import check_counts
from ..core.progress import progress as bar
from ..files.toml import dumps
from ..results.provenance import assumed, versions
from ..scene import Scene
from .measures import FINE_NODES, AbstractMeasure
from .methods import Method, Setting, name_of


STATUS = ("ok", "failed", "left_out")


class Row(NamedTuple):
    """Measurements of one setting of one method."""

    value: complex | float
    compile_time: float  # [s]
    run_time: float  # [s]
    memory: float  # [B]
    reason: str = ""


def accuracy(
    scene: Scene,
    measure: AbstractMeasure | Any,
    methods: Sequence[Method] | None = None,
    *,
    reference: Setting | None = None,
    lanes: int = 1,
    repeats: int = 3,
    limit: float | int | None = None,
    progress: bool | None = None,
) -> xr.Dataset:
    """Error against a converged reference, and cost, of a number by every setting of every method.

        error = |value - reference|,   uncertainty = |reference - the same one setting coarser|

    Nothing is dropped: a setting that fails is flagged in `status`, with its `reason`.

    Args:
        scene: the rotor.
        measure: the number, such as `jaxrotor.measures.LongRun("whirl_rate")`.
        methods: see `jaxrotor.methods`; by default those of the measure.
        reference: a converged setting, by default that of the measure; its `finer()` is the reference.
        lanes: number of equal trajectories timed as one program, for a `LongRun`.
        repeats: number of runs after the first, the fastest of which counts.
        limit: time of a run [s] beyond which the finer settings of its method are left out.
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        Dataset along `run`, with `method`, `setting` and its parts as coordinates: `value`, `error`,
        `relative_error`; `compile_time`, by which the first run was longer than the fastest (zero
        where an earlier one had compiled the program; the time to load it where jax keeps a cache of
        programs, see the attribute `compilation_cache`), `run_time` of the public function [s],
        `memory` of the largest program that was compiled (NaN where none), `lane_rate` [1/s]. All runs
        are on one thread of Python.

    Raises:
        ValueError: if `measure` is none, `methods` are empty, or `lanes` or `repeats` are not admissible.
    """
    check_counts(lanes=lanes, repeats=repeats)
    if not isinstance(measure, AbstractMeasure):
        raise ValueError(
            f"`measure` must be one of `jaxrotor.measures`, such as OnsetSpeed(), but is {measure!r}."
        )
    if lanes > 1 and not measure.many:
        raise ValueError(
            f"`lanes` must be 1 for {type(measure).__name__}, but is {lanes}; a LongRun takes many."
        )
    methods = tuple(measure.methods() if methods is None else methods)
    if not methods:
        raise ValueError("`methods` must name at least one method, but is empty.")
    if reference is None:
        reference = measure.reference(scene)
        refines = any(one.nodes is not None for method in methods for one in method.settings)
        if refines and hasattr(scene.shaft, "nodes"):
            reference = dataclasses.replace(reference, nodes=FINE_NODES, rule="spectral")
    pairs = [(method, setting) for method in methods for setting in method.settings]
    with bar(progress, len(pairs) + 2, "accuracy", "runs") as tick:
        coarse, best = (
            _measured(scene, measure, one, 1, 0, tick) for one in (reference, reference.finer())
        )
        rows = [
            row
            for method in methods
            for row in _ladder(scene, measure, method, lanes, repeats, limit, tick)
        ]
    attributes = {
        "title": f"jaxrotor accuracy of {measure.about[1]}",
        "measure": str(measure),
        "lanes": lanes,
        "repeats": repeats,
        "device": str(jax.devices()[0]),
        "compilation_cache": str(getattr(jax.config, "jax_compilation_cache_dir", None) or "none"),
        "reference": best.value.real,
        "reference_imag": best.value.imag,
        "reference_uncertainty": abs(best.value - coarse.value),
        "reference_setting": str(reference.finer()),
        "reference_reason": best.reason or coarse.reason,
        "scene": dumps(scene),
        **assumed(scene),
        "versions": versions(),
    }
    return _dataset(measure, pairs, rows, best.value, attributes)


def _ladder(
    scene: Scene, measure: AbstractMeasure, method: Method, lanes, repeats, limit, tick
) -> list[Row]:
    """Measurements of the settings of a method, loose to tight, until a run takes too long."""
    rows: list[Row] = []
    slowest = 0.0
    for setting in method.settings:
        if limit is not None and slowest > limit:
            rows.append(_left_out(slowest, limit))
            tick(1)
            continue
        rows.append(_measured(scene, measure, setting, lanes, repeats, tick))
        slowest = max(slowest, rows[-1].run_time if rows[-1].run_time > 0 else 0.0)
    return rows


def _measured(
    scene: Scene, measure: AbstractMeasure, setting: Setting, lanes, repeats, tick
) -> Row:
    """Value and cost of one setting; where it fails, the reason."""
    try:
        with setting.computed():
            return _timed(setting.applied(scene), measure, setting, lanes, repeats)
    except Exception as error:  # noqa: BLE001, one setting must not end a study
        paragraph = str(error).strip().partition("\n\n")[0]
        return Row(
            math.nan, math.nan, math.nan, math.nan, " ".join(paragraph.split()) or repr(error)
        )
    finally:
        tick(1)


def _timed(scene: Scene, measure: AbstractMeasure, setting: Setting, lanes, repeats) -> Row:
    """Value and cost of one setting, from a first run and others after it."""
    programs, seconds, memory = _programs(), [], math.nan
    value: complex | float = math.nan
    for _ in range(1 + repeats):
        begun = time.perf_counter()
        value = measure.value(scene, setting, lanes)
        seconds.append(time.perf_counter() - begun)
        if len(seconds) == 1:
            memory = max(
                (_size(new) for new in _programs() if new not in programs), default=math.nan
            )
    best = min(seconds[1:], default=seconds[0])
    finite = math.isfinite(value.real) and math.isfinite(value.imag)
    return Row(value, max(seconds[0] - best, 0.0), best, memory, "" if finite else "not finite")


def _left_out(slowest: float, limit: float | int) -> Row:
    """The row of a setting that is not tried."""
    reason = f"left out: a coarser setting took {slowest:.3g} s, above the limit of {limit:g} s"
    return Row(math.nan, math.nan, math.nan, math.nan, reason)


def _programs() -> list[Any]:
    """All compiled programs, where the backend lists them."""
    try:
        return jax.local_devices()[0].client.live_executables()
    except (AttributeError, RuntimeError):
        return []


def _size(program: Any) -> float:
    """Memory [B] of arguments, results and temporary arrays."""
    try:
        stats = program.get_compiled_memory_stats()
    except (AttributeError, RuntimeError):
        return math.nan
    parts = ("argument_size", "output_size", "temp_size")
    total = sum(getattr(stats, f"{part}_in_bytes") for part in parts)
    return float(total - stats.alias_size_in_bytes)


def _dataset(
    measure: AbstractMeasure,
    pairs: list[tuple[Method, Setting]],
    rows: list[Row],
    reference: complex | float,
    attributes: dict[str, Any],
) -> xr.Dataset:
    """Labelled measurements of all settings."""
    units, long_name = measure.about
    values: Any = np.array([row.value for row in rows])
    error = np.abs(values - reference)
    if np.isnan(reference):
        error[:] = np.nan
    run = lambda name: np.array([getattr(row, name) for row in rows])
    along = lambda values, units, long_name: ("run", values, about(units, long_name))
    run_time = run("run_time")
    left_out = [row.reason.startswith("left out") for row in rows]
    status = np.where(left_out, 2, [row.reason != "" for row in rows]).astype(np.int8)
    variables = {
        "value": along(values.real, units, long_name),
        "error": along(error, units, f"error of the {long_name}"),
        "relative_error": along(error / (abs(reference) or np.nan), "1", "relative error"),
        "compile_time": along(run("compile_time"), "s", "time to compile"),
        "run_time": along(run_time, "s", "time of a run"),
        "memory": along(run("memory"), "B", "memory of the largest program"),
        "lane_rate": along(attributes["lanes"] / run_time, "1/s", "lanes per second"),
        "status": ("run", status, flags("outcome", STATUS)),
        "reason": ("run", np.array([row.reason for row in rows], dtype=str)),
    }
    if np.iscomplexobj(values):
        variables["value_imag"] = along(values.imag, units, f"{long_name}, imaginary part")
    else:
        attributes.pop("reference_imag")
    return xr.Dataset(variables, _coordinates(pairs), attributes)


def _coordinates(pairs: list[tuple[Method, Setting]]) -> dict[str, Any]:
    """The method, the setting and its parts, along `run`."""
    settings = [setting for _, setting in pairs]
    each = lambda name: [getattr(setting, name) for setting in settings]
    text = lambda values: ("run", np.array(values, dtype=str))

    def number(name: str, long_name: str) -> tuple:
        values = [np.nan if value is None else value for value in each(name)]
        return "run", np.array(values, float), about("1", long_name)

    return {
        "method": text([method.name for method, _ in pairs]),
        "setting": text([str(setting) for setting in settings]),
        "axis": text([method.axis for method, _ in pairs]),
        "solver": text(["" if one is None else name_of(one) for one in each("solver")]),
        "steps": number("steps", "steps a revolution, or between samples"),
        "tolerance": number("tolerance", "relative tolerance"),
        "nodes": number("nodes", "nodes a span, or cells"),
        "rule": text([one or "" for one in each("rule")]),
        "precision": text(each("precision")),
    }
