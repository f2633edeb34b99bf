"""Linear answers of jaxrotor and of ROSS: errors, seconds when warm, seconds of a fresh process.

    python benchmarks/against_ross.py
    python benchmarks/against_ross.py --only 'disc.*modes' --repeats 1 --fresh 0

ROSS is installed from PyPI into an environment of its own the first time. Both programs are asked in
turns, on the same machines: a Campbell diagram of 61 speeds, the undamped critical speeds, the response
to unbalance at 401 speeds, the speed at which a seal makes the rotor unstable, and the modes at one speed.

Warm seconds are the median of calls after a first one, of rotors that are built: ROSS assembles when
it builds, jaxrotor in every call. A fresh process reads or builds the rotor, too; jaxrotor runs there with
an empty and with a filled cache of compiled programs. Ratios are ROSS's seconds over jaxrotor's.
`!`: the goal is missed.

Errors are relative to jaxrotor at 16 nodes a span. How far ROSS is from that, at two and four times as
many elements and extrapolated to elements of no length, is printed as the check.
"""

import argparse
import json
import os
import re
import statistics
import sys
import tempfile
from pathlib import Path

from peers.agreement import error, extrapolated, matched
from peers.programs import Program, environment, fresh, processor, version
from peers.turbomachines import ELEMENT, MACHINES, QUESTIONS, request
from platformdirs import user_cache_path
from rich.console import Console
from rich.table import Table


GOALS = {"error": 1e-6, "warm": 3.0, "fresh": 1.0}
FULL = {"speeds": 61, "response_speeds": 401}
FEW = {"speeds": 3, "response_speeds": 5}  # for the check
CONVERGED, CUTS = 16, (2, 4)


def compared(ours: Program, peer: Program, name: str, question: str, rotor: dict, repeats: int):
    """Errors of both programs, and the median seconds of calls after the first."""
    asked = request(name, question, **FULL)
    asked_peer = request(name, question, rotor=rotor, **FULL)
    converged = ours.ask(request(name, question, nodes=CONVERGED, **FULL))["answer"]
    off = {
        key: error(question, matched(question, program.ask(one)["answer"], converged), converged)
        for key, program, one in (("jaxrotor", ours, asked), ("ROSS", peer, asked_peer))
    }
    pairs = [(ours.ask(asked), peer.ask(asked_peer)) for _ in range(repeats)]
    seconds = [
        statistics.median(one["seconds"] for one in column) for column in zip(*pairs, strict=True)
    ]
    return {"error": off, "warm": dict(zip(off, seconds, strict=True))}


def checked(ours: Program, peer: Program, name: str, question: str, rotor: dict):
    """What ROSS tends to by two finer meshes, and how far it is from the converged values."""
    converged = ours.ask(request(name, question, nodes=CONVERGED, **FEW))["answer"]
    meshes = [
        peer.ask(request(name, question, rotor=rotor, cut=cut, rtol=1e-12, **FEW))["answer"]
        for cut in CUTS
    ]
    found = extrapolated(*(matched(question, answer, converged) for answer in meshes))
    return found, error(question, found, converged)


def started(python: str, threads: int, name: str, question: str, rotor: dict, repeats: int):
    """Median seconds of fresh processes: jaxrotor with an empty and a filled cache, and ROSS."""
    asked, asked_peer = (request(name, question, rotor=own, **FULL) for own in (None, rotor))
    seconds: dict[str, list[float]] = {"empty": [], "ROSS": [], "filled": []}
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as programs:
            own = [sys.executable, "-m", "peers.with_jaxrotor", programs]
            seconds["empty"].append(fresh(own, threads, asked))
            seconds["ROSS"].append(fresh([python, "-m", "peers.with_ross"], threads, asked_peer))
            seconds["filled"].append(fresh(own, threads, asked))
    return {key: statistics.median(values) for key, values in seconds.items()}


def table(name: str, elements: int, nodes: int, rows: dict[str, dict]) -> Table:
    """What was measured of one machine, and which goals were missed."""
    size = f"ROSS {elements} elements, jaxrotor {nodes} nodes a span"
    shown = Table(title=f"{name}: {size}; columns without a name are jaxrotor's")
    heads = ("error", f"<= {GOALS['error']:g}"), ("error", "ROSS"), ("check", "")
    heads += ("warm", "ms"), ("ROSS", "ms"), ("ratio", f">= {GOALS['warm']:g}")
    heads += ("fresh", "empty, s"), ("fresh", "filled, s"), ("ROSS", "s")
    heads += ("ratio", f"empty >= {GOALS['fresh']:g}"), ("ratio", f"filled >= {GOALS['fresh']:g}")
    for head in ("question", *("\n".join(pair) for pair in heads)):
        shown.add_column(head, justify="left" if head == "question" else "right")
    for question, row in rows.items():
        off, warm, process = row["error"], row["warm"], row.get("fresh")
        missed = " !" if off["jaxrotor"] > GOALS["error"] else ""
        cells = [f"{off['jaxrotor']:.1e}{missed}", f"{off['ROSS']:.1e}"]
        cells += [f"{row['check']:.1e}" if "check" in row else "-"]
        cells += [f"{1e3 * seconds:.0f}" for seconds in warm.values()]
        cells += [_ratio(warm["ROSS"] / warm["jaxrotor"], GOALS["warm"])]
        if process:
            cells += [f"{process[key]:.1f}" for key in ("empty", "filled", "ROSS")]
            ratios = [process["ROSS"] / process[key] for key in ("empty", "filled")]
            cells += [_ratio(ratio, GOALS["fresh"]) for ratio in ratios]
        shown.add_row(question, *cells)
    return shown


def _ratio(reached: float, goal: float) -> str:
    return f"{reached:.2g}{'' if reached >= goal else ' !'}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", default=".", metavar="PATTERN", help="of 'machine, question'")
    parser.add_argument("--repeats", type=int, default=5, help="timed calls after the first")
    parser.add_argument("--fresh", type=int, default=3, help="fresh processes; 0 for none")
    parser.add_argument("--no-check", action="store_true", help="without finer meshes of ROSS")
    parser.add_argument(
        "--limits", action="store_true", help="print what ROSS tends to by finer meshes, and end"
    )
    parser.add_argument("--threads", type=int, default=1, help="of OpenBLAS, in both programs")
    default = user_cache_path("jaxrotor-benchmarks") / "ross-2.3"
    parser.add_argument("--peer-environment", type=Path, default=default, metavar="FOLDER")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write all figures there")
    args, log = parser.parse_args(), Console(stderr=True, highlight=False)
    python, load, found = environment(args.peer_environment), os.getloadavg()[:1], {}
    out = Console(highlight=False, width=max(150, log.width))
    with tempfile.TemporaryDirectory() as programs:
        ours = Program([sys.executable, "-m", "peers.with_jaxrotor", programs], args.threads)
        peer = Program([python, "-m", "peers.with_ross"], args.threads)
        for name in MACHINES:
            questions = [q for q in QUESTIONS if re.search(args.only, f"{name}, {q}")]
            if not questions:
                continue
            rotor = ours.ask(request(name, "numbers"))["answer"]
            rows: dict[str, dict] = {}
            for question in questions:
                log.print(f"{name}, {question}")
                if args.limits:
                    (*_, last), _ = checked(ours, peer, name, question, rotor)
                    out.print(f"{name}, {question}: {last.tolist()}")
                    continue
                row = compared(ours, peer, name, question, rotor, args.repeats)
                if not args.no_check:
                    row["check"] = checked(ours, peer, name, question, rotor)[1]
                if args.fresh:
                    row["fresh"] = started(python, args.threads, name, question, rotor, args.fresh)
                rows[question] = row
            if args.limits:
                continue
            out.print(table(name, round(rotor["length"] / ELEMENT), rotor["nodes"], rows))
            found[name] = rows
        ours.close()
        peer.close()
    load += os.getloadavg()[:1]
    about = {"machine": processor(), "ROSS": version(python), "threads": args.threads}
    about["load before and after"] = " ".join(f"{x:.1f}" for x in load)
    out.print("; ".join(f"{key} {value}" for key, value in about.items()), soft_wrap=True)
    if args.json:
        args.json.write_text(json.dumps({"machines": found, "about": about}, indent=1) + "\n")


if __name__ == "__main__":
    main()
