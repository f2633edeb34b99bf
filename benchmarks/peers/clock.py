"""Seconds: of compiling, and of the quickest of some calls."""

import time
from collections.abc import Callable

import jax


COMPILING = []  # seconds in XLA, filled by jax


def listen() -> None:
    """Have jax report its compilations."""
    heard = lambda event, seconds, **_: COMPILING.append(seconds) if "/backend_" in event else None
    jax.monitoring.register_event_duration_secs_listener(heard)


def compile_seconds(run: Callable) -> float:
    """Seconds of compiling in a first call."""
    COMPILING.clear()
    run()
    return sum(COMPILING)


def quickest(run: Callable, repeats: int, clock: Callable[[], float] = time.perf_counter) -> float:
    """Seconds of the quickest call, which must wait for its result."""
    seconds = []
    for _ in range(repeats):
        began = clock()
        run()
        seconds.append(clock() - began)
    return min(seconds)
