"""First answers: what a fresh process needs, with an empty and with a filled program cache.

    python benchmarks/startup.py                  # ten minutes
    python benchmarks/startup.py --only 'help|show'

Processor time of every process, its children included, as a multiple of `import jax, diffrax` in the
same run: that is the floor of whatever computes. Beside it, from the monitoring events of jax, the
seconds spent in tracing (of a function inside another counted twice) and in the compiler with an empty
cache, the number of programs compiled, and of those loaded from a filled one. `!`: the goal is missed.
"""

import argparse
import json
import os
import re
import resource
import runpy
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console
from rich.table import Table


GOALS = {  # multiples of the floor: with an empty cache, with a filled one
    "light": (0.5, 0.5),
    "linear": (5.0, 2.0),
    "pictures": (8.0, 4.0),
    "motion": (10.0, 5.0),
    "accuracy": (15.0, 6.0),
}
COMMANDS = {
    "--help": "light",
    "scenes": "light",
    "new OUT/own.toml": "light",
    "show no-such-scene": "light",
    "show limiter-rotor": "linear",
    "show overhung-fan": "linear",
    "roots limiter-rotor": "linear",
    "onset limiter-rotor": "linear",
    "critical two-discs-unequal": "linear",
    "critical overhung-fan": "linear",
    "campbell two-discs-unequal --out OUT/c": "pictures",
    "campbell overhung-fan --out OUT/c": "pictures",
    "response two-discs-unequal --out OUT/r": "pictures",
    "stability limiter-rotor --over spin.speed=0:9000rpm:61": "pictures",
    "reactions turbine-run-up --out OUT/f": "pictures",
    "balance turbine-run-up --planes 0m,0.453m": "pictures",
    "simulate limiter-rotor --revolutions 500 --keep 50 --out OUT/m": "motion",
    "sweep limiter-rotor --out OUT/w": "motion",
    "accuracy limiter-rotor --quantity onset-speed --out OUT/a": "accuracy",
}


def floor(repeats: int = 5) -> float:
    """Processor seconds of a process that loads jax and diffrax and ends; the least of some."""
    return min(_spent([sys.executable, "-c", "import jax, diffrax"], {})[0] for _ in range(repeats))


def measured(command: str, cache: Path, out: Path) -> dict[str, float]:
    """Processor seconds, and what jax did, of a command that may load programs from `cache`."""
    own = {"JAX_COMPILATION_CACHE_DIR": str(cache), "STARTUP_EVENTS": str(out / "events.json")}
    own |= {
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
    }
    words = shlex.split(command.replace("OUT", str(out)))
    seconds, code = _spent([sys.executable, __file__, "--inside", *words], own)
    events = out / "events.json"
    seen = json.loads(events.read_text()) if events.exists() else {}
    events.unlink(missing_ok=True)
    return {"seconds": seconds, "code": code, **seen}


def _spent(command: list[str], settings: dict[str, str]) -> tuple[float, int]:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, env=os.environ | settings, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return spent, done.returncode


def inside(words: list[str]) -> None:
    """A command of jaxrotor in this process, and what jax says of it at the end."""
    sys.argv = ["jaxrotor", *words]
    heard: dict[str, float] = {"trace": 0.0, "compile": 0.0, "programs": 0, "loaded": 0}

    def duration(event: str, seconds: float, **_: object) -> None:
        if event.endswith("jaxpr_trace_duration") or event.endswith(
            "jaxpr_to_mlir_module_duration"
        ):
            heard["trace"] += seconds
        if event.endswith("backend_compile_duration"):
            heard["compile"] += seconds
            heard["programs"] += 1

    def happened(event: str, **_: object) -> None:
        heard["loaded"] += event.endswith("cache_hits")

    class WithJax:
        """Listens as soon as jax is there, and does not load it."""

        def find_spec(self, name: str, path: object = None, target: object = None) -> None:
            if (
                name.startswith("jax.")
                and "jax.monitoring" in sys.modules
                and self in sys.meta_path
            ):
                sys.meta_path.remove(self)
                monitoring = sys.modules["jax.monitoring"]
                monitoring.register_event_duration_secs_listener(duration)
                monitoring.register_event_listener(happened)

    sys.meta_path.insert(0, WithJax())
    try:
        runpy.run_module("jaxrotor", run_name="__main__")
    finally:
        if "jax" in sys.modules:
            Path(os.environ["STARTUP_EVENTS"]).write_text(json.dumps(heard))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", default=".", metavar="PATTERN", help="commands to run")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write all figures there")
    chosen = parser.parse_args()
    least, rows = floor(), {}
    for command in (one for one in COMMANDS if re.search(chosen.only, one)):
        with tempfile.TemporaryDirectory() as folder:
            cache = Path(folder) / "programs"
            rows[command] = []
            for run in ("empty", "filled"):
                out = Path(folder) / run
                out.mkdir()
                rows[command].append(measured(command, cache, out))
    print(f"`import jax, diffrax`: {least:.2f} s of the processor\n")
    table = Table("command", "empty", "goal", "filled", "goal", "traced", "compiled", "loaded")
    for command, (empty, filled) in rows.items():
        goals = GOALS[COMMANDS[command]]
        cells = [
            f"{one['seconds'] / least:.1f}{'' if one['seconds'] <= goal * least else ' !'}"
            for one, goal in zip((empty, filled), goals, strict=True)
        ]
        traced = " / ".join(f"{one.get('trace', 0):.1f} s" for one in (empty, filled))
        built = f"{empty.get('programs', 0)} in {empty.get('compile', 0):.1f} s"
        goals = [f"{goal:g}" for goal in goals]
        name = command.replace("OUT/", "")
        table.add_row(
            name,
            cells[0],
            goals[0],
            cells[1],
            goals[1],
            traced,
            built,
            f"{filled.get('loaded', 0)}",
        )
    Console(width=150).print(table)
    if chosen.json:
        chosen.json.write_text(json.dumps({"floor": least, "commands": rows}, indent=1) + "\n")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--inside"]:
        inside(sys.argv[2:])
    else:
        main()
