"""Kernels and memory traffic of lanes on an H100, from the programs that XLA compiles for one without one.

    pip install --no-deps jax-cuda12-plugin==0.9.2 jax-cuda12-pjrt==0.9.2    # of the same version as jax
    python benchmarks/gpu_traffic.py                                         # takes /usr/local/cuda, too

Lanes of the limiter rotor that differ in their unbalance, over 20 revolutions, with ordinary steps and
with those of `Exponential(fused=True)`. A kernel counts with the bytes of its operands and results, as if
there were no cache; one that writes a part of an array in place counts with that part. Registers and
spills are those that ptxas states for the fused kernel. Nothing is run, so this tells no times.
"""

import argparse
import itertools
import math
import os
import re
import subprocess
import tempfile
from pathlib import Path


CUDA = Path("/usr/local/cuda")
DUMP = tempfile.mkdtemp(prefix="gpu-traffic-")
os.environ["JAX_PLATFORMS"] = "cpu"
os.environ["XLA_FLAGS"] = f"--xla_gpu_cuda_data_dir={CUDA} --xla_dump_to={DUMP}"

import equinox as eqx  # noqa: E402
import jax  # noqa: E402
import numpy as np  # noqa: E402
from gpu import whirl_rates  # noqa: E402
from jax.experimental import topologies  # noqa: E402
from peers.rotor import LARGEST, Lanes, skipped  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.table import Table  # noqa: E402

import jaxrotor as jr  # noqa: E402


REVOLUTIONS = 20
H100 = """
gpu_device_info {
  threads_per_block_limit: 1024 threads_per_warp: 32 shared_memory_per_block: 49152
  shared_memory_per_core: 233472 threads_per_core_limit: 2048 core_count: 132 fpus_per_core: 128
  block_dim_limit_x: 2147483647 block_dim_limit_y: 65535 block_dim_limit_z: 65535
  memory_bandwidth: 3352320000000 l2_cache_size: 52428800 clock_rate_ghz: 1.98
  device_memory_size: 84942979072 shared_memory_per_block_optin: 232448
  cuda_compute_capability { major: 9 } registers_per_core_limit: 65536 registers_per_block_limit: 65536
}
platform_name: "CUDA"
dnn_version_info { major: 8 minor: 9 patch: 4 }
device_description_str: "NVIDIA H100 80GB HBM3"
"""  # of its data sheet, as XLA takes it
BYTES = {"f64": 8, "f32": 4, "s64": 8, "s32": 4, "u32": 4, "pred": 1, "c128": 16, "c64": 8}
KERNELS = ("fusion", "custom-call", "copy", "transpose", "dot")


def size(types: str) -> int:
    """Bytes of arrays in HLO's notation; the workspace of a product, of bytes, is left out."""
    found = re.findall(rf"\b({'|'.join(BYTES)})\[([\d,]*)\]", types)
    return sum(
        BYTES[kind] * math.prod(map(int, filter(None, dims.split(",")))) for kind, dims in found
    )


def counted(text: str) -> tuple[int, int]:
    """Kernels that a program starts, and the bytes of their operands and results."""
    parts, entry, own = {}, "", []
    for line in text.splitlines():
        if head := re.match(r"(ENTRY )?%([\w.\-]+) \(.*\{$", line):
            own = parts.setdefault(head[2], [])
            entry = head[2] if head[1] else entry
        elif found := re.match(r"\s+(?:ROOT )?%([\w.\-]+) = (\(.*?\)|\S+) ([\w\-]+)\((.*)", line):
            own.append(found.groups())

    def of(name: str) -> tuple[int, int]:
        kernels = moved = 0
        types = {result: kind for result, kind, *_ in parts[name]}
        for result, kind, operation, rest in parts[name]:
            if operation == "while":
                body, trips = (re.search(p, rest) for p in (r"body=%([\w.\-]+)", r'"n":"(\d+)"'))
                inside, times = of(body[1]), int(trips[1])
                kernels, moved = kernels + times * inside[0], moved + times * inside[1]
            elif operation in KERNELS:
                given = [size(types[one]) for one in re.findall(r"%([\w.\-]+)", rest.split(")")[0])]
                in_place = "dynamic_update_slice" in result
                kernels += 1
                moved += 2 * (sum(given) - max(given)) if in_place else size(kind) + sum(given)
        return kernels, moved

    return of(entry)


def placed(lanes: Lanes, count: int, device) -> tuple:
    """Shapes of as many lanes on the device."""
    place = jax.sharding.SingleDeviceSharding(device)
    array = lambda shape, like: jax.ShapeDtypeStruct(shape, like.dtype, sharding=place)
    many = lambda leaf: array((count, *leaf.shape[1:]), leaf)
    shared, constant = eqx.partition(lanes.shared, eqx.is_array)
    shared = jax.tree.map(lambda leaf: array(leaf.shape, leaf), shared)
    return shared, constant, jax.tree.map(many, lanes.own), many(lanes.y)


def registers() -> str:
    """What ptxas says of the fused kernel of the last program."""
    *_, last = sorted(Path(DUMP).glob("*.ptx"), key=lambda path: path.stat().st_mtime)
    command = [CUDA / "bin/ptxas", "-v", "-arch=sm_90a", last, "-o", Path(DUMP) / "cubin"]
    told = subprocess.run(command, check=True, capture_output=True, text=True).stderr
    _, _, kernel = told.partition("entry function 'revolution'")
    used, spilled = (re.search(p, kernel)[1] for p in (r"Used (\d+) reg", r"(\d+) bytes spill st"))
    return f"{used}, {spilled} bytes spilled"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lanes", type=int, default=65536)
    parser.add_argument("--steps", type=int, default=96, help="a revolution")
    parser.add_argument("--order", type=int, nargs="+", default=(2, 4), choices=(2, 4))
    args = parser.parse_args()
    topology = topologies.get_topology_desc(platform="cuda", target_config=H100, topology="1x1x1")
    shown = Table(title=f"limiter rotor on an H100, {args.lanes} lanes, {args.steps} steps")
    for head in ("order", "revolutions", "steps", "kernels a step", "bytes a lane-step"):
        shown.add_column(head, justify="right")
    shown.add_column("registers of a lane", justify="right")
    for order, kept, fused in itertools.product(args.order, (False, True), (False, True)):
        solver = jr.Exponential(order, basis="modal", fused=fused)
        lanes = Lanes.of(solver, args.steps, np.linspace(0, LARGEST, 2), jr.Whirl(7e-3, 75.0))
        shared, constant, own, y = placed(lanes, args.lanes, topology.devices[0])
        run = whirl_rates if kept else skipped

        def call(shared, own, y, run=run, constant=constant):
            return run(eqx.combine(shared, constant), own, y, REVOLUTIONS)

        kernels, moved = counted(jax.jit(call).lower(shared, own, y).compile().as_text())
        steps = REVOLUTIONS * args.steps
        shown.add_row(
            str(order),
            "observed" if kept else "settling",
            "fused" if fused else "ordinary",
            f"{kernels / steps:.2f}",
            f"{moved / args.lanes / steps:,.0f}",
            registers() if fused else "",
        )
    Console(highlight=False, width=120).print(shown)


if __name__ == "__main__":
    main()
