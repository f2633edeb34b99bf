"""Memory of a derivative through a run against its length, by XLA's own count.

    python benchmarks/memory.py              # writes docs/memory.png
    python benchmarks/memory.py --quick --figure /tmp/memory.png

The backward rub of the limiter rotor, its last revolution kept; the derivative of the mean square of
the displacement by the stiffness of the stops: in forward mode, in reverse mode with all steps kept
(no checkpoints), with the state kept at every revolution, and as `simulate` does it. Bytes are what the
compiled program holds beside its arguments and results. Each program is also run, up to a number of
revolutions, for its result and the peak by which the process grew, where Linux tells that.
"""

import argparse
import json
from pathlib import Path
from unittest import mock

import diffrax as dfx
import jax
import jax.numpy as jnp
import matplotlib as mpl
from rich.console import Console
from rich.table import Table

import jaxrotor as jr
from jaxrotor.core.compiled import QUICKLY
from jaxrotor.motion.revolutions import SHORT
from jaxrotor.plot import colours


SCENE = jr.load("limiter-rotor").replace({"unbalance.eccentricity": 0.0})
START = jr.Whirl(12e-3, rate=-441.0)  # leads to the backward rub
STEPS = 64  # a revolution
FIGURE = Path(__file__).parent.parent / "docs" / "memory.png"
WAYS = {  # adjoint, revolutions of which each is a checkpoint, colour
    "reverse mode, all steps kept": (None, SHORT, colours.RED),
    "reverse mode, every revolution kept": (
        dfx.RecursiveCheckpointAdjoint(),
        10**9,
        colours.ORANGE,
    ),
    "reverse mode": (dfx.RecursiveCheckpointAdjoint(), SHORT, colours.BLUE),
    "forward mode": (None, SHORT, colours.GREY),
}


def derivative(way: str, revolutions: int):
    """Compiled, and the stiffness to call it with."""
    adjoint, short, _ = WAYS[way]

    def size(stiffness):
        scene = SCENE.put({"limiters.stiffness": stiffness})
        how = {"start": START, "keep": 1, "solver": jr.Exponential(4), "adjoint": adjoint}
        run = jr.simulate(scene, revolutions, STEPS, **how)
        return jnp.mean(jnp.abs(run.displacement) ** 2)

    forward = lambda stiffness: jax.jvp(size, (stiffness,), (jnp.ones(()),))[1]
    function = forward if way == "forward mode" else jax.grad(size)
    stiffness = SCENE.get("limiters.stiffness")[0]
    with mock.patch("jaxrotor.motion.revolutions.SHORT", short):
        return jax.jit(function, **QUICKLY).lower(stiffness).compile(), stiffness


def grown(once) -> float | None:
    """Bytes by which the process grew at most while something ran; None where nobody tells."""
    resident = lambda name: next(
        1024 * int(line.split()[1])
        for line in Path("/proc/self/status").read_text().splitlines()
        if line.startswith(name)
    )
    try:
        Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
        before = resident("VmRSS")
        once()
        return float(resident("VmHWM") - before)
    except OSError:
        return None


def measured(way: str, revolutions: int, longest: int) -> dict:
    """Of one way and length."""
    compiled, stiffness = derivative(way, revolutions)
    row = {
        "way": way,
        "revolutions": revolutions,
        "bytes": compiled.memory_analysis().temp_size_in_bytes,
    }
    if revolutions > longest:
        return row
    once = lambda: jax.block_until_ready(compiled(stiffness))
    row["grown"] = grown(once)
    row["derivative"] = float(once())
    return row


def table(rows: list[dict]) -> Table:
    shown = Table(title="Memory of a derivative through a run")
    for head in rows[0]:
        shown.add_column(head, justify="left" if head == "way" else "right")
    for row in rows:
        cells = (row.get(head, "-") for head in rows[0])
        shown.add_row(*(f"{cell:,.6g}" if isinstance(cell, float) else str(cell) for cell in cells))
    return shown


def draw(rows: list[dict], path: Path) -> None:
    """Bytes against revolutions."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with plt.rc_context({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False}):
        figure, axes = plt.subplots(figsize=(5.0, 3.2), layout="constrained")
        for way, (_, _, colour) in WAYS.items():
            own = [row for row in rows if row["way"] == way]
            counts = [row["revolutions"] for row in own]
            axes.loglog(counts, [row["bytes"] for row in own], "o-", ms=3, color=colour, label=way)
        axes.set_xlabel("revolutions")
        axes.set_ylabel("memory of the derivative [bytes]")
        axes.legend(frameon=False)
        axes.grid(which="major", color="0.9", linewidth=0.6)
        figure.savefig(path, dpi=200)
        plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--revolutions", type=int, nargs="+", default=[10, 30, 100, 300, 1000])
    parser.add_argument("--longest", type=int, default=1000, help="that are run, not only compiled")
    parser.add_argument("--quick", action="store_true", help="two short runs")
    parser.add_argument("--figure", type=Path, default=FIGURE)
    parser.add_argument("--json", type=Path, help="file for all numbers")
    args = parser.parse_args()
    counts = [10, 30] if args.quick else args.revolutions
    rows = []
    for way in WAYS:
        jax.clear_caches()  # else a run traced for another is taken as it is
        rows += [measured(way, count, args.longest) for count in counts]
    out = Console(highlight=False, width=max(120, Console().width))
    out.print(table(rows))
    out.print(f"{STEPS} steps a revolution; a state is {8 * 4 * jr.assemble(SCENE).n} bytes.")
    args.figure.parent.mkdir(parents=True, exist_ok=True)
    draw(rows, args.figure)
    out.print(f"Figure: {args.figure}")
    if args.json:
        args.json.write_text(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
