"""A million lanes by worker processes, one of which is killed on the way: time, memory, what is lost.

    python benchmarks/million.py
    python benchmarks/million.py --side 16 --settle 2 --keep 2

A grid of eccentricities, speeds and starting angles of the limiter rotor goes into a store, chunk by
chunk, as `docs/cluster.md` plans it for a billion. First a piece of the same work, one chunk a worker, by
workers that have compiled; from its rate follows how long the whole should take. After a third of that
time one worker is killed; its chunk is run again by another process, which compiles anew. In the end every
lane is compared with what threads of this process find for some of the chunks.
"""

import argparse
import json
import os
import signal
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import psutil
import xarray as xr
from distributed import Client, LocalCluster
from rich.console import Console

import jaxrotor as jr
from jaxrotor.core.outcome import STATUS, failed


ROTOR = jr.load("limiter-rotor")
NUMBERS = (jr.observe.Precession(), jr.observe.Radius(), jr.observe.Contact())
CHECKED = 3  # chunks that are run again by threads
PERIOD = 1.0  # from one look at the memory to the next [s]


def sweep(args: argparse.Namespace, eccentricities: np.ndarray, speeds: np.ndarray, **how):
    """The sweep over these values and all starting angles."""
    over = {
        "unbalance.eccentricity": eccentricities,
        "spin.speed": speeds,
        "start.angle": np.linspace(0.0, 2 * np.pi, args.side, endpoint=False),
    }
    counts = {"settle": args.settle, "keep": args.keep, "steps_per_revolution": args.steps}
    run = {"observe": NUMBERS, "solver": jr.Exponential(order=4), "progress": False}
    return jr.sweep(ROTOR, over, start=jr.Whirl(7e-3, 75.0), **counts, **run, **how)


def values(args: argparse.Namespace) -> tuple[np.ndarray, np.ndarray]:
    """Eccentricities [m] and speeds [rad/s] of the grid."""
    return np.linspace(0.0, 1e-3, args.side), np.linspace(400.0, 900.0, args.side)


def expected(args: argparse.Namespace, folder: Path, client: Client) -> tuple[float, float]:
    """Seconds that the whole should take, by the rate of a piece, and those of its first call."""
    eccentricities, speeds = values(args)
    rows = max(1, args.workers * args.lanes_per_chunk // args.side**2 + 1)
    seconds = []
    for name in ("compiling", "piece"):
        began = time.perf_counter()
        where = {"store": folder / f"{name}.zarr", "lanes_per_chunk": args.lanes_per_chunk}
        piece = sweep(args, eccentricities[:rows], speeds, cluster=client, **where)
        seconds.append(time.perf_counter() - began)
    whole = args.side**3 / piece["status"].size * seconds[1]
    return whole, seconds[0] - seconds[1]


class Watched:
    """Memory of this process, looked at in a thread of its own while a block runs, and a worker killed."""

    def __init__(self, client: Client, kill_after: float):
        self.sizes: list[float] = []
        self.killed = None
        self._client, self._kill_after = client, kill_after
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._look)

    def __enter__(self) -> "Watched":
        self._thread.start()
        return self

    def __exit__(self, *_) -> None:
        self._done.set()
        self._thread.join()

    def _look(self) -> None:
        began, own = time.perf_counter(), psutil.Process()
        while not self._done.wait(PERIOD):
            self.sizes.append(own.memory_info().rss / 2**20)
            if self.killed is None and time.perf_counter() - began > self._kill_after:
                self.killed = next(iter(self._client.run(os.getpid).values()))
                os.kill(self.killed, signal.SIGKILL)


def differences(args: argparse.Namespace, found: xr.Dataset) -> float:
    """Largest difference of `whirl_rate` and `radius_max` of some rows, run again by threads."""
    eccentricities, speeds = values(args)
    largest = 0.0
    for row in np.linspace(0, args.side - 1, CHECKED).round().astype(int):
        again = sweep(args, eccentricities[row : row + 1], speeds, workers=args.workers)
        for name in ("whirl_rate", "radius_max"):
            there = found[name].isel({"unbalance.eccentricity": row}).values
            largest = max(largest, float(np.nanmax(np.abs(again[name].values[0] - there))))
    return largest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=100, help="values along each of three axes")
    parser.add_argument("--settle", type=int, default=20)
    parser.add_argument("--keep", type=int, default=10)
    parser.add_argument("--steps", type=int, default=32, help="a revolution, of order 4")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--lanes-per-chunk", type=int, default=2048)
    parser.add_argument("--json", type=Path, help="file for all numbers")
    args = parser.parse_args()
    out = Console(highlight=False)
    how = {"threads_per_worker": 1, "dashboard_address": ":0"}
    with (
        tempfile.TemporaryDirectory() as inside,
        LocalCluster(n_workers=args.workers, **how) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        folder = Path(inside)
        estimate, compiling = expected(args, folder, client)
        eccentricities, speeds = values(args)
        began = time.perf_counter()
        with Watched(client, estimate / 3) as watched:
            where = {"store": folder / "all.zarr", "lanes_per_chunk": args.lanes_per_chunk}
            found = sweep(args, eccentricities, speeds, cluster=client, **where)
        seconds = time.perf_counter() - began
        status = found["status"].values
        report = {
            "lanes": status.size,
            "revolutions": args.settle + args.keep,
            "s estimated by a piece": estimate,
            "s to compile": compiling,
            "s taken": seconds,
            "taken over estimated": seconds / estimate,
            "lane-revolutions/s": status.size * (args.settle + args.keep) / seconds,
            "worker killed": watched.killed is not None,
            "lanes that are missing": int((status == STATUS.index("not_computed")).sum()),
            "lanes that failed": int(failed(status).sum()),
            "MB of this process after a third": watched.sizes[len(watched.sizes) // 3],
            "MB at the end": watched.sizes[-1],
            "largest difference from threads": differences(args, found),
        }
    for name, value in report.items():
        out.print(f"{name:36}{value if isinstance(value, bool | int) else f'{value:.4g}'}")
    out.print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if args.json:
        args.json.write_text(json.dumps(report))


if __name__ == "__main__":
    main()
