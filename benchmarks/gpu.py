"""Throughput of the contact sweep on an accelerator against lanes, in float64 and float32.

    python benchmarks/gpu.py                      # needs one; says so without
    python benchmarks/gpu.py --cpu --lanes 64 256 --revolutions 10 --steps 64

All lanes are one program; the precession is observed, as in a sweep. A GPU takes ordinary steps and
those of `Exponential(fused=True)`. 256 eccentricities are prepared on the CPU and repeated. The error is
that of the whirl rate on the first and the last of them, from `Exponential(4)` at 4096 steps in float64 on
the CPU. Each precision is a process of its own.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path


os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")  # two processes share the device

import equinox as eqx  # noqa: E402
import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from peers.clock import compile_seconds, listen, quickest  # noqa: E402
from peers.rotor import LARGEST, Lanes, reference, settled  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.table import Table  # noqa: E402

import jaxrotor as jr  # noqa: E402
from jaxrotor.sweeps.observable import Turn, updated  # noqa: E402


LANES = tuple(4**k for k in range(3, 11))  # 64 .. 1048576
DISTINCT = 256


@eqx.filter_jit
def whirl_rates(shared, own, y, revolutions: int):
    """Whirl rate of every lane, as a sweep observes it."""
    precession = jr.observe.Precession()

    def update(seen, orbit, number):
        return updated(precession, seen, Turn.of(orbit, number, revolutions))[0], None

    def lane(own, y):
        march = eqx.combine(own, shared)
        (_, seen, _), _ = march.collect(y, precession.start(0), update, revolutions)
        return seen["whirl"] / seen["weight"]

    return jax.vmap(lane)(own, y)


def measure(args: argparse.Namespace) -> list[dict]:
    """Rows of one precision, in its own process."""
    listen()
    given = np.load(args.child)
    start = jr.Continued(jnp.asarray(given["q"]), jnp.asarray(given["velocity"]))
    distinct = np.linspace(0, LARGEST, DISTINCT)
    device, rows = jax.devices()[0], []
    for fused in (False, True) if device.platform == "gpu" else (False,):
        solver = jr.Exponential(args.order, basis="modal", fused=fused)
        lanes = Lanes.of(solver, args.steps, distinct, start)
        for count in args.lanes:
            ends = [0, min(count, DISTINCT) - 1]
            index = np.resize(np.r_[ends[0], DISTINCT - 1, 1 : DISTINCT - 1], count)
            shared, own, y = jax.device_put(lanes.part(index), device)
            run = lambda given=(shared, own, y): np.asarray(whirl_rates(*given, args.revolutions))
            compiling = compile_seconds(run)
            seconds = quickest(run, args.repeats)
            rows.append(
                {
                    "precision": str(y.dtype),
                    "steps": "fused" if fused else "ordinary",
                    "lanes": count,
                    "compile s": compiling,
                    "run s": seconds,
                    "ns/lane-step": 1e9 * seconds / count / args.revolutions / args.steps,
                    "lane-rev/s": count * args.revolutions / seconds,
                    "error": float(np.abs(run()[:2] - given["rates"]).max()),
                }
            )
    return rows


def table(rows: list[dict], title: str) -> Table:
    shown = Table(title=title)
    for head in rows[0]:
        shown.add_column(head, justify="right")
    for row in rows:
        precision, steps, count, compiling, seconds, step, speed, error = row.values()
        numbers = (
            f"{compiling:.1f}",
            f"{seconds:.3g}",
            f"{step:.3g}",
            f"{speed:,.0f}",
            f"{error:.1e}",
        )
        shown.add_row(precision, steps, f"{count:,}", *numbers)
    return shown


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lanes", type=int, nargs="+", default=LANES)
    parser.add_argument("--revolutions", type=int, default=20)
    parser.add_argument("--steps", type=int, default=128, help="a revolution")
    parser.add_argument("--order", type=int, default=2, choices=(2, 4))
    parser.add_argument("--repeats", type=int, default=3, help="timed calls after the first")
    parser.add_argument("--cpu", action="store_true", help="run where there is no accelerator")
    parser.add_argument("--json", type=Path, help="file for all numbers")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        print(json.dumps(measure(args)))
        return
    device = jax.devices()[0]
    if device.platform == "cpu" and not args.cpu:
        print(
            "No accelerator: jax sees the CPU alone. Install `.[cuda]` on a machine with an NVIDIA GPU, "
            "or try the script with --cpu --lanes 64 256 --revolutions 10."
        )
        return
    rows, out = [], Console(highlight=False, width=max(110, Console().width))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "start.npz"
        with jax.default_device(jax.local_devices(backend="cpu")[0]):
            start, rates = settled(), reference(args.revolutions)
        np.savez(path, q=start.q, velocity=start.velocity, rates=rates)
        for wide in ("1", "0"):
            command = [sys.executable, __file__, *sys.argv[1:], "--child", str(path)]
            how = os.environ | {"JAX_ENABLE_X64": wide}
            found = subprocess.run(command, env=how, check=True, stdout=subprocess.PIPE, text=True)
            rows += json.loads(found.stdout.splitlines()[-1])
    name = f"{device.device_kind} ({device.platform})"
    title = f"{name}, order {args.order}, {args.steps} steps, {args.revolutions} revolutions"
    out.print(table(rows, title))
    if args.json:
        args.json.write_text(json.dumps({"device": name, "jax": jax.__version__, "rows": rows}))


if __name__ == "__main__":
    main()
