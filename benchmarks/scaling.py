"""A sweep by threads and by worker processes, and what a very large one would write and schedule.

    python benchmarks/scaling.py
    python benchmarks/scaling.py --lanes 64 --settle 4 --keep 4 --steps 32 --repeats 1 --chunks 50

Every way runs the same sweep into a store: once with what it compiles (after a short one with another
count of steps, so that importing is not counted), then in turns, the quickest counting, so that other
work on the machine meets all alike. Then what a chunk costs the scheduler
beside its work, by chunks that do nothing, and what a lane takes in a store.
"""

import argparse
import contextlib
import json
import os
import tempfile
import time
from pathlib import Path

import jax
import numpy as np
import xarray as xr
from distributed import Client, LocalCluster
from rich.console import Console
from rich.table import Table

import jaxrotor as jr
from jaxrotor.sweeps.cluster import Workers
from jaxrotor.sweeps.store import Store


ROTOR = jr.load("limiter-rotor")
PATH = "unbalance.eccentricity"
NUMBERS = (jr.observe.Precession(), jr.observe.Radius(), jr.observe.Contact())  # no series
MANY = 10_000_000  # lanes of the store that is begun
LARGE = 16384  # of its blocks, as on an accelerator


def swept(args: argparse.Namespace, folder: Path, **how) -> float:
    """Seconds of the sweep into a store of its own."""
    over = {PATH: np.linspace(0, 1e-3, args.lanes)}
    counts = {"settle": args.settle, "keep": args.keep, "steps_per_revolution": args.steps}
    with tempfile.TemporaryDirectory(dir=folder) as inside:
        began = time.perf_counter()
        where = {"store": Path(inside) / "a.zarr", "lanes_per_chunk": args.block}
        jr.sweep(ROTOR, over, start=jr.Whirl(7e-3, 75.0), **counts, **where, **how)
        return time.perf_counter() - began


def ways(args: argparse.Namespace, folder: Path, processes: dict[int, Client]) -> list[dict]:
    """The same sweep by every way: first run, quickest run."""
    how = {f"{n} thread{'s' * (n > 1)}": {"workers": n} for n in processes}
    how |= {f"{n} process{'es' * (n > 1)}": {"cluster": c} for n, c in processes.items()}
    short = {"lanes": args.block, "settle": 0, "keep": 1, "steps": args.steps // 2}
    first = {}
    for name, one in how.items():
        swept(argparse.Namespace(**{**vars(args), **short}), folder, **one)
        jax.clear_caches()
        first[name] = swept(args, folder, **one)
    for one in how.values():
        if "workers" in one:  # forgotten meanwhile
            swept(args, folder, **one)
    runs = [
        {name: swept(args, folder, **one) for name, one in how.items()} for _ in range(args.repeats)
    ]
    best = {name: min(run[name] for run in runs) for name in how}
    one = next(iter(how))
    turns = args.lanes * (args.settle + args.keep)
    return [
        {
            "way": name,
            "first s": first[name],
            "run s": best[name],
            "lane-revolutions/s": turns / best[name],
            f"over {one}": best[one] / best[name],
        }
        for name in how
    ]


def nothing(chunk: int, tick) -> None:
    """A chunk without work."""


def scheduling(args: argparse.Namespace, client: Client) -> float:
    """Seconds of a chunk that does nothing."""
    workers = Workers(client)
    workers.each(nothing, list(range(50)), lambda _: None)
    began = time.perf_counter()
    workers.each(nothing, list(range(args.chunks)), lambda _: None)
    return (time.perf_counter() - began) / args.chunks


def stored(folder: Path, observe, settle: int) -> dict:
    """Bytes of a lane in a store, 300 revolutions kept, and seconds to put and to begin blocks."""
    over, lanes = {PATH: np.linspace(0, 1e-3, 256)}, 256
    path = folder / "bytes.zarr"
    how = {"settle": settle, "steps_per_revolution": 96, "observe": observe}
    found = jr.sweep(ROTOR, over, start=jr.Whirl(7e-3, 75.0), store=path, **how).load()
    chunks = [p for name in found.data_vars for p in (path / str(name)).glob("[0-9]*")]
    repeat = {PATH: np.arange(LARGE) % lanes}
    part = found.isel(repeat).drop_vars(PATH)
    values = np.linspace(0, 1e-3, MANY)
    big = Store(folder / "big.zarr", {PATH: (PATH, values, {"units": "m"})}, {}, {PATH: LARGE})
    began = time.perf_counter()
    big._begin(part)
    begun = time.perf_counter()
    for k in range(3):
        big.put({PATH: slice(k * LARGE, (k + 1) * LARGE)}, part)
    put = (time.perf_counter() - begun) / 3
    files = sum(len(names) for _, _, names in os.walk(folder / "big.zarr"))
    assert (xr.open_zarr(big.path, chunks=None)[PATH][[0, -1]] == values[[0, -1]]).all()
    return {
        "variables": len(found.data_vars),
        "bytes a lane": sum(p.stat().st_size for p in chunks) / lanes,
        "before compression": sum(v.nbytes for v in found.data_vars.values()) / lanes,
        f"s to put {LARGE} lanes": put,
        f"s to begin {MANY:.0e} lanes": begun - began,
        "files then": files,
    }


def shown(rows: list[dict], title: str) -> Table:
    table = Table(title=title)
    for head in rows[0]:
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(*(v if isinstance(v, str) else f"{v:,.4g}" for v in row.values()))
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lanes", type=int, default=1024)
    parser.add_argument("--block", type=int, default=128, help="lanes of a chunk")
    parser.add_argument("--settle", type=int, default=200)
    parser.add_argument("--keep", type=int, default=50)
    parser.add_argument("--steps", type=int, default=96, help="a revolution")
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--chunks", type=int, default=5000, help="that do nothing")
    parser.add_argument("--json", type=Path, help="file for all numbers")
    args = parser.parse_args()
    out = Console(highlight=False, width=max(110, Console().width))
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        processes = {}
        for n in args.processes:
            began = time.perf_counter()
            how = {"threads_per_worker": 1, "dashboard_address": ":0"}
            cluster = stack.enter_context(LocalCluster(n_workers=n, **how))
            processes[n] = stack.enter_context(Client(cluster, set_as_default=False))
            out.print(f"{n} worker processes started in {time.perf_counter() - began:.1f} s")
        rows = ways(args, folder, processes)
        out.print(shown(rows, f"{args.lanes} lanes, {args.settle} + {args.keep} revolutions"))
        chunk = scheduling(args, processes[max(processes)])
        out.print(f"a chunk without work: {1e3 * chunk:.2f} ms, {1 / chunk:.0f} a second")
        bytes_ = []
        for what, observe in (("everything", None), ("numbers alone", NUMBERS)):
            with tempfile.TemporaryDirectory(dir=folder) as inside:
                bytes_.append({"observed": what, **stored(Path(inside), observe, args.settle)})
        out.print(shown(bytes_, "store, 300 revolutions kept"))
        out.print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if args.json:
        args.json.write_text(json.dumps({"ways": rows, "chunk s": chunk, "store": bytes_}))


if __name__ == "__main__":
    main()
