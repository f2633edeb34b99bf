"""Cluster: chunks of a sweep as tasks of Dask workers, which write what they find themselves.

The scheduler knows of a chunk its place in the grid, and hears the revolutions done; what to do with
chunks goes to every worker once. What a worker that dies had not yet written others do again.
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
from ..results.provenance import versions
from .store import Store, plainly


AHEAD = 1000  # chunks that the scheduler knows of at once, more where there are more workers
QUIET = (  # Ctrl-C is for who began the workers, and how they end then no news
    "import logging, signal; signal.signal(signal.SIGINT, signal.SIG_IGN); "
    "logging.getLogger('distributed.worker.state_machine').setLevel(logging.ERROR)"
)
MOST = 1024  # processes started here
PATIENCE = 5  # seconds after which a cluster that does not answer counts as none

_alone = threading.Lock()  # among the threads of a worker


@contextlib.contextmanager
def crew(cluster: Any, workers: int | None) -> Iterator["Threads | Workers"]:
    """What runs chunks: threads of this process, or the workers of a Dask `cluster`."""
    if cluster is None:
        yield Threads(cores(workers))
        return
    if workers is not None:
        raise ValueError("`workers` are threads of this process; with a `cluster` leave them out.")
    try:
        from distributed import Client
    except ImportError:
        raise ValueError(
            "A `cluster` needs Dask, which is not installed: pip install 'jaxrotor[cluster]'."
        ) from None
    if isinstance(cluster, Client):
        yield Workers(cluster)
        return
    with _processes(cluster) if isinstance(cluster, int) else _connected(cluster) as client:
        yield Workers(client)


@dataclasses.dataclass(frozen=True)
class Workers:
    """Chunks run by the workers of a Dask cluster, each its own process."""

    client: Any

    @property
    def count(self) -> int:
        """Chunks run at once by the workers there are now."""
        return max(sum(self.client.nthreads().values()), 1)

    def each(self, call: Callable, chunks: list, tick: Callable[[int], None], sink: Any = None):
        """`call(chunk, tick)` of every chunk, in order; what goes into a `sink` is not returned."""
        import cloudpickle
        from distributed import KilledWorker, as_completed

        found: list[Any] = [None] * len(chunks)
        name, numbers = f"chunk-{uuid.uuid4().hex}", iter(range(len(chunks)))
        with _seen(sink) as place:
            what = cloudpickle.dumps((call, place, _installed()))
            packed = self.client.submit(bytes, what, pure=False)
            begin = lambda number: self.client.submit(
                _work, packed, chunks[number], key=(name, number)
            )
            first = itertools.islice(numbers, max(AHEAD, 4 * self.count))
            running = as_completed(map(begin, first), loop=self.client.loop)
            try:
                for done in running:
                    revolutions, part = done.result()
                    number = done.key[1]
                    if sink is None:
                        found[number] = part
                    elif part is not None:
                        sink.put(chunks[number], part)
                    tick(revolutions)
                    running.update(map(begin, itertools.islice(numbers, 1)))
            except KilledWorker as error:
                raise RuntimeError(
                    f"{error.allowed_failures + 1} worker processes died over the same chunk of lanes, "
                    f"the last at {error.last_worker.address}; their logs may say why, and if it was for "
                    "want of memory fewer `lanes_per_chunk` help."
                ) from None
            except concurrent.futures.CancelledError:
                raise RuntimeError(
                    "The cluster has gone, or was told to forget this sweep; what is in a store is kept."
                ) from None
            finally:
                if self.client.status == "running":
                    self.client.cancel(list(running.futures))
        return found


@contextlib.contextmanager
def _processes(count: int) -> Iterator[Any]:
    """Workers of this machine, as long as they are needed."""
    from distributed import Client, LocalCluster

    check_counts(cluster=count)
    if count > MOST:
        raise ValueError(f"`cluster` may start up to {MOST} processes here, but is {count}.")
    if count > 1 and jax.default_backend() != "cpu":
        raise ValueError(
            f"{count} processes would share one {jax.default_backend()}, whose memory the first takes; "
            "leave `cluster` out, or start one worker for each by `dask cuda worker`."
        )
    config: Any = jax.config
    kept = config.jax_compilation_cache_dir
    environment = {"JAX_ENABLE_X64": str(int(config.jax_enable_x64))}
    environment |= {"JAX_COMPILATION_CACHE_DIR": kept} if kept else {}
    how = {"threads_per_worker": 1, "dashboard_address": ":0", "env": environment}
    how["memory_limit"] = 0  # Dask's own pauses a worker without a word
    try:
        cluster = LocalCluster(n_workers=count, preload=[QUIET], **how)
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
                log.setLevel(logging.ERROR)  # a worker in the midst of a chunk is killed, as it may
    finally:
        log.setLevel(level)


@contextlib.contextmanager
def _connected(cluster: Any) -> Iterator[Any]:
    """A cluster that is there already."""
    from distributed import Client, Security, connect

    async def knock() -> None:  # a client that has failed to connect takes its time to go
        how = Security().get_connection_args("client")
        await (await connect(cluster, timeout=PATIENCE, **how)).close()

    if isinstance(cluster, str):
        try:
            with concurrent.futures.ThreadPoolExecutor(
                1
            ) as alone:  # a notebook has a loop of its own
                alone.submit(lambda: asyncio.run(knock())).result()
        # A MemoryError comes from what is no scheduler, the others from protocols without set-up.
        except (OSError, ValueError, MemoryError, TypeError, ImportError) as error:
            raise ValueError(
                f"No Dask scheduler answers at {cluster!r} ({error}); give the address that one prints "
                "when it is started (`dask scheduler`), such as tcp://10.0.0.1:8786, or a "
                "`Client` if it takes more, as for TLS."
            ) from None
    with Client(cluster, set_as_default=False) as client:
        yield client


@contextlib.contextmanager
def _seen(sink: Any) -> Iterator[tuple[Store, Path] | None]:
    """A store, and a file beside it by which workers know that they see the same folder."""
    if not isinstance(sink, Store):
        yield None
        return
    with plainly(sink.path):
        parent = sink.path.absolute().parent
        parent.mkdir(parents=True, exist_ok=True)
        handle, mark = tempfile.mkstemp(prefix=".seen-", dir=parent)
        os.close(handle)
    try:
        yield sink, Path(mark)
    finally:
        Path(mark).unlink(missing_ok=True)


def _installed() -> str:
    """What must be the same in all processes of a sweep."""
    return f"{versions()} {jnp.zeros(()).dtype}"


@functools.lru_cache(maxsize=4)
def _unpacked(packed: bytes) -> tuple[Callable, tuple[Store, Path] | None]:
    """What to do with chunks: unpacked, and so compiled, once in a process."""
    call, place, installed = pickle.loads(packed)
    if installed != _installed():
        raise RuntimeError(
            f"A worker has {_installed()}, but this process {installed}; install the same there, and set "
            "JAX_ENABLE_X64 alike."
        )
    return call, place


def _work(packed: bytes, chunk: Any) -> tuple[int, Any]:
    """Run a chunk on a worker: revolutions done, and what is found if it could not be written."""
    with _alone:
        call, place = _unpacked(packed)
    revolutions: list[int] = []
    part = call(chunk, revolutions.append)
    if place is not None:
        store, mark = place
        with _alone:
            if mark.exists():
                store.put(chunk, part)
                part = None
    return sum(revolutions), part
