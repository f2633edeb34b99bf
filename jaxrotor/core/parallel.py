"""Parallel execution: chunks of lanes, each one call of a compiled program, over cores or GPUs."""

import concurrent.futures
import dataclasses
import itertools
import os
import queue
import threading
from collections.abc import Callable
from typing import Any

import jax

from .checks import check_counts
from .compiled import Compiled


def cores(workers: int | None) -> int:
    """Number of chunks to run at once: `workers` if given, else one per core or one per GPU."""
    if workers is not None:
        check_counts(workers=workers)
        return workers
    if jax.default_backend() != "cpu":
        return jax.local_device_count()
    if hasattr(os, "sched_getaffinity"):  # a scheduler may have assigned only some cores
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def chunk_size(lanes: int, most: int, workers: int) -> int:
    """Lanes per chunk: at most `most`, in chunks of equal size, at least one chunk per worker."""
    chunks = max(-(-lanes // most), min(workers, lanes))
    return -(-lanes // chunks)


def spread(
    run: Callable, chunks: list, workers: int, tick: Callable[[int], None], leave: bool = False
) -> list:
    """Results of `run(chunk, tick)` for all chunks, computed by `workers` threads.

    Threads suffice, as a compiled program runs outside the interpreter's lock. With several devices
    each chunk runs on a device that is free. Ctrl-C waits for the current segments of chunks that are
    under way, unless it leaves them to end by themselves (`leave`).
    """
    stop, wait = threading.Event(), True
    devices = jax.local_devices()
    free: queue.SimpleQueue[Any] = queue.SimpleQueue()
    for device in itertools.islice(itertools.cycle(devices), workers):
        free.put(device)

    def placed(chunk: Any, tick: Callable[[int], None]) -> Any:
        device = free.get()
        try:
            with jax.default_device(device):
                return run(chunk, tick)
        finally:
            free.put(device)

    def tick_or_stop(steps: int) -> None:
        if stop.is_set():
            raise concurrent.futures.CancelledError
        tick(steps)

    if workers == 1 or len(chunks) == 1:
        return [run(chunk, tick) for chunk in chunks]
    pool = concurrent.futures.ThreadPoolExecutor(workers)
    call = placed if len(devices) > 1 else run
    try:
        futures = [pool.submit(call, chunk, tick_or_stop) for chunk in chunks]
        return [future.result() for future in futures]
    except BaseException as error:  # also Ctrl-C: running chunks stop after their current segment
        stop.set()
        wait = not (leave and isinstance(error, KeyboardInterrupt))
        raise
    finally:
        pool.shutdown(wait, cancel_futures=True)


def in_threads(call: Callable, values: Any) -> list:
    """`call(value)` for each of many values, on all cores.

    Ctrl-C does not wait for the calls that are under way. Settings of jax that hold in a `with` block
    alone hold in the thread that set them, so not here.
    """
    own = lambda value, _: call(value)
    return spread(own, list(values), cores(None), lambda _: None, leave=True)


@dataclasses.dataclass(frozen=True)
class Threads:
    """Executor that runs chunks in threads of this process, `count` at once."""

    count: int

    def each(self, call: Callable, chunks: list, tick: Callable[[int], None], sink: Any = None):
        """Results of `call(chunk, tick)` in order of the chunks; None for what a `sink` took."""
        lock = threading.Lock()

        def one(chunk: Any, tick: Callable[[int], None]) -> Any:
            part = call(chunk, tick)
            if sink is None or not sink.takes(chunk):
                return part
            with lock:
                return sink.put(chunk, part)

        return spread(one, chunks, self.count, tick)


def first_alone(call: Callable) -> Callable:
    """`call`, of which one thread compiles each program, while others that need the same one wait.

    A compiled function is compiled without running it, so that chunks run side by side from the first on.
    Any other function runs alone the first time.
    """
    locks: dict[Any, threading.Lock] = {}
    known = set()

    def run(*args: Any) -> Any:
        key = _program_of(args)
        if key not in known:
            with locks.setdefault(key, threading.Lock()):
                if key not in known:
                    if not isinstance(call, Compiled):
                        out = call(*args)
                        known.add(key)
                        return out
                    call.compile(*args)
                    known.add(key)
        return call(*args)

    return run


def _program_of(args: Any) -> tuple:
    """Structure, shapes, types and static values of arguments, which decide a program."""
    leaves, structure = jax.tree.flatten(args)
    arrays = [(one.shape, one.dtype) if hasattr(one, "dtype") else one for one in leaves]
    return structure, *arrays
