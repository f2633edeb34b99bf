"""Cluster: chunks of a sweep as tasks of Dask workers, which write their results themselves.

For a chunk, the scheduler is given its place in the grid, and the task returns the revolutions done;
the program for chunks is sent to every worker once. Chunks that a worker had not yet written when it
died are run by other workers.
"""

import asyncio
import concurrent.futures
import contextlib
import dataclasses
import functools
import itertools
import logging
import os
import pickle
import tempfile
import threading
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

from ..core.checks import check_counts
from ..core.parallel import Threads, cores
from ..core.program_cache import UNREADABLE
from ..results.provenance import versions
from .store import Store, explained_errors


MOST_QUEUED = 1000  # chunks given to the scheduler at once; more if there are more workers
QUIET = (  # Ctrl-C is for the process that started the workers, which then end without messages
    "import logging, signal, warnings; signal.signal(signal.SIGINT, signal.SIG_IGN); "
    "logging.getLogger('distributed.worker.state_machine').setLevel(logging.ERROR); "
    f"warnings.filterwarnings('ignore', '{UNREADABLE}')"
)
MOST_PROCESSES = 1024  # that may be started here
CONNECTION_TIME = 5  # seconds in which a scheduler must answer

_lock = threading.Lock()  # for the threads of a worker


@contextlib.contextmanager
def executor(cluster: Any, workers: int | None) -> Iterator["Threads | Workers"]:
    """The executor of chunks: threads of this process, or the workers of a Dask `cluster`."""
    if cluster is None:
        yield Threads(cores(workers))
        return
    if workers is not None:
        raise ValueError("`workers` are threads of this process; with a `cluster` leave them out.")
    try:
        from distributed import Client
    except ImportError:
        raise ValueError(
            "A `cluster` needs Dask, which is not installed; install it by `pip install distributed`."
        ) from None
    if isinstance(cluster, Client):
        yield Workers(cluster)
        return
    with _processes(cluster) if isinstance(cluster, int) else _connected(cluster) as client:
        yield Workers(client)


@dataclasses.dataclass(frozen=True)
class Workers:
    """Chunks run by the workers of a Dask cluster, each a process of its own."""

    client: Any

    @property
    def count(self) -> int:
        """Number of chunks that the present workers run at once."""
        return max(sum(self.client.nthreads().values()), 1)

    def each(self, call: Callable, chunks: list, tick: Callable[[int], None], sink: Any = None):
        """Results of `call(chunk, tick)` for every chunk, in order; None for what went into a `sink`."""
        import cloudpickle
        from distributed import KilledWorker, as_completed

        results: list[Any] = [None] * len(chunks)
        name, numbers = f"chunk-{uuid.uuid4().hex}", iter(range(len(chunks)))
        with _shared_folder(sink) as folder:
            task = cloudpickle.dumps((call, folder, _installed()))
            packed = self.client.submit(bytes, task, pure=False)
            submit = lambda number: self.client.submit(
                _work, packed, chunks[number], key=(name, number)
            )
            first = itertools.islice(numbers, max(MOST_QUEUED, 4 * self.count))
            running = as_completed(map(submit, first), loop=self.client.loop)
            try:
                for done in running:
                    revolutions, part = done.result()
                    number = done.key[1]
                    if sink is None or not sink.takes(chunks[number]):
                        results[number] = part
                    elif part is not None:
                        sink.put(chunks[number], part)
                    tick(revolutions)
                    running.update(map(submit, itertools.islice(numbers, 1)))
            except KilledWorker as error:
                raise RuntimeError(
                    f"{error.allowed_failures + 1} worker processes died over the same chunk of lanes, "
                    f"the last at {error.last_worker.address}; see their logs, and if memory ran out, "
                    "take fewer `lanes_per_chunk`."
                ) from None
            except concurrent.futures.CancelledError:
                raise RuntimeError(
                    "The cluster has gone, or has cancelled this sweep; what is in a store is kept."
                ) from None
            finally:
                if self.client.status == "running":
                    self.client.cancel(list(running.futures))
        return results


@contextlib.contextmanager
def _processes(count: int) -> Iterator[Any]:
    """A client of worker processes that are started on this machine, and ended with it."""
    from distributed import Client, LocalCluster

    check_counts(cluster=count)
    if count > MOST_PROCESSES:
        raise ValueError(
            f"`cluster` may start up to {MOST_PROCESSES} processes here, but is {count}."
        )
    if count > 1 and jax.default_backend() != "cpu":
        raise ValueError(
            f"{count} processes would share one {jax.default_backend()}, whose memory the first takes; "
            "leave `cluster` out, or start one worker for each by `dask cuda worker`."
        )
    config: Any = jax.config
    cache = config.jax_compilation_cache_dir
    environment = {"JAX_ENABLE_X64": str(int(config.jax_enable_x64))}
    environment |= {"JAX_COMPILATION_CACHE_DIR": cache} if cache else {}
    options = {"threads_per_worker": 1, "dashboard_address": ":0", "env": environment}
    options["memory_limit"] = 0  # that of Dask pauses a worker without a message
    try:
        cluster = LocalCluster(n_workers=count, preload=[QUIET], **options)
    except RuntimeError as error:
        raise RuntimeError(
            f"{count} worker processes could not be started ({error}); they import the script that starts "
            "them, which must do so below `if __name__ == '__main__':`."
        ) from None
    log = logging.getLogger("distributed.nanny")
    level = log.level
    try:
        with cluster, Client(cluster, set_as_default=False) as client:
            try:
                yield client
            finally:
                log.setLevel(logging.ERROR)  # a worker may be killed while it runs a chunk
    finally:
        log.setLevel(level)


@contextlib.contextmanager
def _connected(cluster: Any) -> Iterator[Any]:
    """A client of a cluster that runs already."""
    from distributed import Client, Security, connect

    async def try_connection() -> None:  # a client that fails to connect takes long to end
        options = Security().get_connection_args("client")
        await (await connect(cluster, timeout=CONNECTION_TIME, **options)).close()

    if isinstance(cluster, str):
        try:
            # In a thread, because a notebook runs an event loop in its own.
            with concurrent.futures.ThreadPoolExecutor(1) as thread:
                thread.submit(lambda: asyncio.run(try_connection())).result()
        # MemoryError: another server answers. Others: protocols that are not set up.
        except (OSError, ValueError, MemoryError, TypeError, ImportError) as error:
            raise ValueError(
                f"No Dask scheduler answers at {cluster!r} ({error}); give the address that one prints "
                "when it is started (`dask scheduler`), such as tcp://10.0.0.1:8786, or a "
                "`Client` if it takes more, as for TLS."
            ) from None
    with Client(cluster, set_as_default=False) as client:
        yield client


@contextlib.contextmanager
def _shared_folder(sink: Any) -> Iterator[tuple[Store, Path] | None]:
    """A store, and a file beside it from which workers know that they have access to its folder."""
    if not isinstance(sink, Store):
        yield None
        return
    with explained_errors(sink.path):
        parent = sink.path.absolute().parent
        parent.mkdir(parents=True, exist_ok=True)
        handle, mark = tempfile.mkstemp(prefix=".shared-", dir=parent)
        os.close(handle)
    try:
        yield sink, Path(mark)
    finally:
        Path(mark).unlink(missing_ok=True)


def _installed() -> str:
    """Versions and precision, which must be the same in all processes of a sweep."""
    return f"{versions()} {jnp.zeros(()).dtype}"


@functools.lru_cache(maxsize=4)
def _unpacked(packed: bytes) -> tuple[Callable, tuple[Store, Path] | None]:
    """The call for chunks and the shared folder: unpacked, and so compiled, once in a process."""
    call, folder, installed = pickle.loads(packed)
    if installed != _installed():
        raise RuntimeError(
            f"A worker has {_installed()}, but this process {installed}; install the same there, and set "
            "JAX_ENABLE_X64 to the same value."
        )
    return call, folder


def _work(packed: bytes, chunk: Any) -> tuple[int, Any]:
    """Run a chunk on a worker: revolutions done, and the results, or None if they are in the store."""
    with _lock:
        call, folder = _unpacked(packed)
    revolutions: list[int] = []
    part = call(chunk, revolutions.append)
    if folder is not None and folder[0].takes(chunk):
        store, mark = folder
        with _lock:
            if mark.exists():
                store.put(chunk, part)
                part = None
    return sum(revolutions), part
