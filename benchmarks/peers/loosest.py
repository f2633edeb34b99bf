"""Loosest setting of a method whose error is small enough, and what its first calls took."""

import time
from collections.abc import Callable, Iterable
from typing import Any

from rich.console import Console

from .clock import compile_seconds, quickest


def timed(run: Callable, repeats: int) -> dict:
    """Seconds of the first call, of these in XLA, and of the quickest of more calls."""
    began = time.perf_counter()
    compiling = compile_seconds(run)
    first = time.perf_counter() - began
    rest = {"run s": quickest(run, repeats)} if repeats else {}
    return {"first s": first, "compile s": compiling, **rest}


def loosest(
    name: str,
    method: Callable[[float], Any],
    settings: Iterable[float],
    error: Callable[[Any], float],
    target: float,
    log: Console,
) -> dict:
    """The loosest setting that meets the target, as does the next finer one; its error, and first calls.

    One setting alone may meet it by chance. Where no two neighbours do, it is the tightest setting. Only
    some settings compile anew, so the longest of the calls counts.
    """
    first, compiling, met = 0.0, 0.0, None
    for setting in settings:
        found = []
        took = timed(lambda s=setting, f=found: f.append(method(s)), 0)
        first, compiling = max(first, took["first s"]), max(compiling, took["compile s"])
        off = error(found[0])
        log.print(f"{name} {setting:g}: error {off:.1e}")
        if off <= target and met:
            break
        met = (setting, off) if off <= target else None
    else:
        log.print(f"{name}: no two neighbouring settings meet the target of {target:g}")
        met = setting, off
    return {"setting": met[0], "error": met[1], "first s": first, "compile s": compiling}
