"""What each effect of a scene costs: the same rotor with effects added one at a time.

    python benchmarks/ladder.py              # writes docs/ladder.png
    python benchmarks/ladder.py --quick --figure /tmp/ladder.png

Of the vector field, which diffrax steps: equations of its jaxpr, flops and bytes by XLA's own
analysis of the compiled program, size of the state. Of a revolution by `Exponential(2)`: flops and
bytes a lane, the body of its loop counted once, seconds of compiling, time a lane and step; a linear
scene has no step. At varying speed there is the vector field alone. Then each rung is made from the
top of the ladder by taking effects away: it must cost exactly what it costs where they were never
drawn.
"""

import argparse
import functools
import json
import time
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib as mpl
import numpy as np
from peers.clock import quickest
from peers.rotor import plan_of
from rich.console import Console
from rich.table import Table

import jaxrotor as jr
from jaxrotor.equations.rotating_frame import RotatingState, Transient
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.motion.revolutions import March
from jaxrotor.plot import colours


GIVEN = jr.load("limiter-rotor")
END = GIVEN.shaft.length
STOPS = GIVEN.of(jr.Limiter)
STEPS = 64  # a revolution
FIGURE = Path(__file__).parent.parent / "docs" / "ladder.png"


def _stop(angle: float, at: Any = END) -> jr.Limiter:
    where = lambda stop: (stop.angle, stop.at)
    return eqx.tree_at(where, STOPS[0], (jnp.asarray(angle), jnp.asarray(at)))


ADDED = {  # what each rung adds to those before
    "bare shaft": (),
    "disc": GIVEN.of(jr.Disc),
    "external damping": GIVEN.of(jr.ExternalDamping),
    "internal damping": GIVEN.of(jr.InternalDamping),
    "unbalance": (jr.Unbalance(END, 2.4, 1e-5),),
    "weight": (jr.Gravity(),),
    "1 limiter": STOPS[:1],
    "3 limiters": STOPS[1:],
    "12 limiters": tuple(_stop(0.1 + 0.7 * k) for k in range(9)),
    "limiter at mid-span": (_stop(0.5, END / 2),),
    "rub ring": (jr.AnnularStator(END, 0.008, 1e7, friction=0.1, rim_radius=0.1),),
    "bearing over speed": (
        jr.Support(END / 3, kxx=[1e5, 2e5], kyy=[2e5, 3e5], speeds=[0.0, 1000.0]),
    ),
    "casing": (
        jr.Casing("frame", 50.0),
        jr.Support(END / 2, 1e5, on="frame"),
        jr.Support(stiffness=1e8, damping=1e3, of="frame"),
    ),
    "oil film": (
        jr.JournalBearing(END / 4, radius=0.02, length=0.02, clearance=1e-4, viscosity=0.01),
    ),
}
BESIDE = {"casing", "support"}  # they hold each other, so they are taken away together
SPUN = "limiter at mid-span"  # the rung whose rotor is taken at a speed that varies
RUN_UP = {  # the same at a speed that varies
    "varying speed": (),
    "5 balls": (jr.BallBalancer(END, 0.01, 0.06, 3.5, in_use=5.0, places=5),),
}

QUICK = ("bare shaft", "internal damping", "3 limiters", "varying speed")


def rungs() -> dict[str, jr.Scene]:
    """Scenes by what they add."""
    effects, found = (), {}
    for name, more in ADDED.items():
        effects += more
        found[name] = jr.Scene(GIVEN.shaft, *effects, spin=GIVEN.spin)
    effects = found[SPUN].effects
    varying = jr.SpeedProfile(jnp.array([0.0, 10.0]), jnp.array([100.0, 662.0]))
    for name, more in RUN_UP.items():
        effects += more
        found[name] = jr.Scene(GIVEN.shaft, *effects, spin=varying)
    return found


def stripped(name: str) -> jr.Scene | None:
    """A rung from the top of its ladder by taking away what it has not; None for the top."""
    scenes = rungs()
    ladder = [*RUN_UP] if name in RUN_UP else [*ADDED]
    above = [name for name in ladder[ladder.index(name) + 1 :]]
    if not above:
        return None
    scene = scenes[ladder[-1]]
    effects = {id(effect) for one in above for effect in (ADDED | RUN_UP)[one]}
    kinds = {e.kind for e in scene.effects if id(e) in effects}
    kept = {e.kind for e in scene.effects if id(e) not in effects}
    for kind in kinds - kept - BESIDE:
        scene = scene.without(kind)
    rest = [e for e in scene.effects if id(e) not in effects]  # some limiters of many
    return (
        scene if len(rest) == len(scene.effects) else jr.Scene(scene.shaft, *rest, spin=scene.spin)
    )


# === one rung


def field_of(scene: jr.Scene):
    """Vector field as a function of arrays alone, and a state."""
    if isinstance(scene.spin, jr.ConstantSpeed):
        motion = Motion(jr.assemble(scene), jnp.abs(scene.spin.speed))
        return motion, jnp.full((2, 2, motion.stiffness.shape[0]), 1e-4)
    field = Transient.of(scene, jnp.asarray(100.0), jnp.zeros(()))
    shape = jnp.full((2, field.system.n), 1e-4)
    bodies = jnp.zeros(sum(race.bodies.places for race in field.system.races))
    none = jnp.zeros(0)
    return field, RotatingState(shape, shape, none, none, 0.1 + bodies, bodies)


def equations(jaxpr) -> int:
    """Number of equations, those of inner jaxprs instead of their calls."""
    count = 0
    for equation in jaxpr.eqns:
        leaves = jax.tree.leaves([*equation.params.values()], is_leaf=lambda x: hasattr(x, "eqns"))
        inner = [getattr(leaf, "jaxpr", leaf) for leaf in leaves]
        inner = [one for one in inner if hasattr(one, "eqns")]
        count += sum(map(equations, inner)) if inner else 1
    return count


def work(compiled) -> tuple[float, float]:
    """Flops and bytes of a compiled program, the body of a loop counted once."""
    found = compiled.cost_analysis()
    found = found[0] if isinstance(found, list) else found
    return found.get("flops", 0.0), found.get("bytes accessed", 0.0)


def of_field(scene: jr.Scene) -> dict:
    """Size of the vector field."""
    field, y = field_of(scene)
    arrays, constant = eqx.partition(field, eqx.is_array)
    call = lambda arrays, theta, y: eqx.combine(arrays, constant)(theta, y)
    given = (arrays, jnp.zeros(()), y)
    flops, data = work(jax.jit(call).lower(*given).compile())
    return {
        "state": sum(leaf.size for leaf in jax.tree.leaves(y)),
        "equations": equations(jax.make_jaxpr(call)(*given).jaxpr),
        "field flops": flops,
        "field bytes": data,
    }


def spread_states(y, lanes: int):
    """States of lanes, each a little different."""
    shares = jnp.linspace(0.9, 1.0, lanes)
    return jax.tree.map(lambda leaf: jnp.multiply.outer(shares, leaf), y)


def field_time(scene: jr.Scene, lanes: int, repeats: int) -> float:
    """Time [ns] a lane and evaluation, in a loop of evaluations."""
    field, y = field_of(scene)
    count = 256

    @eqx.filter_jit
    def run(field, y):
        step = lambda y, _: (jax.tree.map(lambda a, b: a + 1e-12 * b, y, field(0.1, y)), None)
        return jax.vmap(lambda y: jax.lax.scan(step, y, None, length=count)[0])(y)

    y = spread_states(y, lanes)
    once = lambda: jax.block_until_ready(run(field, y))
    once()
    return 1e9 * quickest(once, repeats) / lanes / count


def of_revolution(scene: jr.Scene, lanes: int, revolutions: int, repeats: int) -> dict:
    """Work, compile time and run time of revolutions by the exponential step."""
    plan = plan_of(scene, jr.Exponential(2, basis="modal"), STEPS)
    build = eqx.filter_jit(functools.partial(March.build, plan=plan))
    march = build(scene, rate=jnp.abs(scene.spin.speed), stations=scene.stations(END))
    y = spread_states(march.begin(jr.Whirl(1e-3), END), lanes)
    arrays, constant = eqx.partition(march, eqx.is_array)
    skip = lambda arrays, y, turns: eqx.combine(arrays, constant).skip(y, turns)[0]
    every = jax.vmap(skip, in_axes=(None, 0, None))
    lowered = jax.jit(lambda arrays, y: every(arrays, y, revolutions)).lower(arrays, y)
    began = time.perf_counter()
    compiled = lowered.compile()
    compiling = time.perf_counter() - began
    flops, data = work(compiled)
    once = lambda: compiled(arrays, y).block_until_ready()
    once()
    seconds = quickest(once, repeats)
    return {
        "stepped": march.step is not None,
        "lane flops": flops / lanes,
        "lane bytes": data / lanes,
        "compile s": compiling,
        "ns/lane-step": 1e9 * seconds / lanes / revolutions / STEPS,
    }


def absent_is_free(rows: list[dict]) -> list[dict]:
    """Of each rung but the top ones: what it costs built up, and with the rest taken away."""
    less = {row["rung"]: stripped(row["rung"]) for row in rows}
    return [
        {"rung": row["rung"], "built": row, "stripped": of_field(less[row["rung"]])}
        for row in rows
        if less[row["rung"]] is not None
    ]


# === what comes out


def table(rows: list[dict]) -> Table:
    shown = Table(title="One rotor, effects added one at a time")
    shown.add_column("rung")
    heads = [head for head in rows[0] if head not in ("rung", "stepped")]
    for head in heads:
        shown.add_column(head, justify="right")
    for row in rows:
        cells = []
        for head in heads:
            value = row.get(head)
            cells.append(
                "-" if value is None else f"{value:,.3g}" if value < 100 else f"{value:,.0f}"
            )
        shown.add_row(row["rung"], *cells)
    return shown


def draw(rows: list[dict], path: Path) -> None:
    """A group of bars a rung: equations; flops and bytes; time."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with plt.rc_context({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False}):
        figure, axes = plt.subplots(3, 1, figsize=(6.5, 6.2), sharex=True, layout="constrained")
        x = np.arange(len(rows))
        top, middle, low = axes
        top.bar(x, [row["equations"] for row in rows], 0.6, color=colours.BLUE)
        for at, row in zip(x, rows, strict=True):
            top.annotate(f"{row['equations']}", (at, row["equations"]), ha="center", va="bottom")
        top.set_ylabel("equations")
        for shift, key, label, colour in (
            (-0.2, "field flops", "flops", colours.ORANGE),
            (0.2, "field bytes", "bytes", colours.TEAL),
        ):
            middle.bar(x + shift, [row[key] for row in rows], 0.38, color=colour, label=label)
        middle.set_yscale("log")
        middle.set_ylabel("of one evaluation")
        middle.legend(frameon=False, ncols=2, loc="upper left")
        step = [row.get("ns/lane-step") or np.nan for row in rows]
        low.bar(x - 0.2, step, 0.38, color=colours.BLUE, label="exponential step")
        field = [row["field ns"] for row in rows]
        low.bar(x + 0.2, field, 0.38, color=colours.GREY, label="vector field")
        low.set_yscale("log")
        low.set_ylabel("ns a lane")
        low.legend(frameon=False, ncols=2, loc="upper left")
        kinds = [row.get("stepped") for row in rows]  # None: speed varies
        for text, kind in (("closed form", False), ("stepped", True)):
            end = len(kinds) - kinds[::-1].index(kind) - 0.5
            where = {"xycoords": ("data", "axes fraction"), "ha": "right", "va": "top"}
            top.annotate(text, (end - 0.1, 1), **where)
            for axis in axes:
                axis.axvline(end, color=colours.DARK, lw=0.6, ls=":")
        names = [row["rung"] if i == 0 else f"+ {row['rung']}" for i, row in enumerate(rows)]
        low.set_xticks(x, names, rotation=35, ha="right", rotation_mode="anchor")
        figure.savefig(path, dpi=200)
        plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lanes", type=int, default=128)
    parser.add_argument("--revolutions", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=5, help="timed calls after the first")
    parser.add_argument("--quick", action="store_true", help="some rungs, 8 lanes, 2 revolutions")
    parser.add_argument("--figure", type=Path, default=FIGURE)
    parser.add_argument("--json", type=Path, help="file for all numbers")
    args = parser.parse_args()
    if args.quick:
        args.lanes, args.revolutions, args.repeats = 8, 2, 1
    scenes = rungs()
    if args.quick:
        scenes = {name: scenes[name] for name in QUICK}
    rows = []
    for name, scene in scenes.items():
        row = {"rung": name} | of_field(scene)
        row["field ns"] = field_time(scene, args.lanes, args.repeats)
        if isinstance(scene.spin, jr.ConstantSpeed):
            row |= of_revolution(scene, args.lanes, args.revolutions, args.repeats)
        rows.append(row)
    out = Console(highlight=False, width=max(140, Console().width))
    out.print(table(rows))
    out.print(f"ns/lane-step: of {STEPS} steps a revolution; a scene without limiters takes none.")
    checked = absent_is_free(rows)
    for key in ("state", "equations", "field flops", "field bytes"):
        same = sum(one["built"][key] == one["stripped"][key] for one in checked)
        out.print(f"Absent is free, {key}: {same} of {len(checked)} rungs exactly equal.")
    args.figure.parent.mkdir(parents=True, exist_ok=True)
    draw(rows, args.figure)
    out.print(f"Figure: {args.figure}")
    if args.json:
        args.json.write_text(json.dumps({"rows": rows, "absent": checked}, indent=2))


if __name__ == "__main__":
    main()
