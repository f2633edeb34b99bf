"""How linear answers grow with the sections of a shaft, by jaxrotor and by ROSS.

    python benchmarks/size.py
    python benchmarks/size.py --only 'roots|growth' --sections 10 20 --repeats 1 --no-ross

A compressor of 10 to 100 sections (`peers/stepped.py`) is asked for twelve roots and for the largest
growth rate at one speed, for three critical speeds of each sense, for a Campbell diagram of 40 speeds,
for the response to unbalance at 200 speeds and for the onset of instability; `jaxrotor show` has all of
them but two. Every question has a process of its own.

Fresh seconds are wall time from the start of a process to its answer, with an empty cache of programs;
those in the compiler are named apart. Warm seconds are the median of calls after that, assembly included
for jaxrotor and excluded for ROSS, of which a call that takes `LONG` is not repeated. `!`: the goal is
missed.

Errors are the largest relative ones of jaxrotor (of a response, relative to its largest radius) against
ROSS, extrapolated from its elements and from those of half the length to elements of no length, with
Campbell diagram and response at a few speeds. ROSS's critical speed or threshold is then one step of the
secant method from that of jaxrotor.
"""

import argparse
import json
import os
import re
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from peers.agreement import error, extrapolated, matched
from peers.programs import Program, environment, processor, version
from peers.stepped import LENGTH, compressor
from peers.turbomachines import Machine, request
from platformdirs import user_cache_path
from rich.console import Console
from rich.table import Table


QUESTIONS = (
    *("roots", "growth rate", "critical speeds", "Campbell diagram", "response", "threshold"),
    "show",
)
NEAR = ("critical speeds", "threshold")  # searches, of which the check takes one step
GOALS = {"fresh": 5.0, "warm": 1.0, "error": 1e-6}
FULL = {"speeds": 40, "response_speeds": 200, "count": 3}
FEW = {"speeds": 3, "response_speeds": 5, "count": 3}  # for the check
CUTS = (1, 2)
LONG = 10.0  # [s]


def timed(command: list[str], threads: int, asked: dict, processes: int, repeats: int) -> dict:
    """Seconds of fresh processes, of their compilers, and of calls after the first in the last one."""
    fresh, compiling, warm = [], [], []
    for k in range(processes):
        with tempfile.TemporaryDirectory() as programs:
            began = time.perf_counter()
            program = Program([*command, programs], threads)
            first = program.ask(asked)
            fresh.append(time.perf_counter() - began)
            compiling.append(first.get("compiling", 0.0))
            if k == processes - 1:
                warm = [program.ask(asked)["seconds"]]
                more = repeats - 1 if warm[0] < LONG else 0
                warm += [program.ask(asked)["seconds"] for _ in range(more)]
            program.close()
    found = {"fresh": fresh, "compiling": compiling, "warm": warm}
    return {key: statistics.median(values) for key, values in found.items()}


def checked(ours: Program, peer: Program, machine: Machine, question: str, rotor: dict) -> float:
    """Error of jaxrotor against what ROSS tends to by finer elements."""
    answer = ours.ask(request(machine, question, **FEW))["answer"]
    how = {"near": np.ravel(answer).tolist()} if question in NEAR else {}
    asked = request(machine, question, rotor=rotor, most=24, **how, **FEW)
    meshes = [matched(question, peer.ask(asked | {"cut": cut})["answer"], answer) for cut in CUTS]
    return error(question, extrapolated(*meshes), answer)


def table(sections: int, size: str, rows: dict[str, dict]) -> Table:
    """What was measured of one size, and which goals were missed."""
    shown = Table(title=f"{sections} sections: {size}; columns without a name are jaxrotor's")
    heads = ("fresh", "<= 5 s"), ("of it compiling", "s"), ("warm", "<= 1 s"), ("ROSS", "fresh, s")
    heads += ("ROSS", "warm, s"), ("ratio", "warm"), ("error", f"<= {GOALS['error']:g}")
    for head in ("question", *("\n".join(pair) for pair in heads)):
        shown.add_column(head, justify="left" if head == "question" else "right")
    for question, row in rows.items():
        own, peer = row["jaxrotor"], row.get("ROSS")
        cells = [_against("fresh", own["fresh"], ".1f"), f"{own['compiling']:.1f}"]
        cells += [_against("warm", own["warm"], ".3f")]
        if peer:
            cells += [f"{peer['fresh']:.1f}", f"{peer['warm']:.2f}"]
            cells += [f"{peer['warm'] / own['warm']:.2g}"]
            cells += [_against("error", row["error"], ".1e")]
        shown.add_row(question, *cells)
    return shown


def _against(goal: str, reached: float, form: str) -> str:
    return f"{reached:{form}}{'' if reached <= GOALS[goal] else ' !'}"


def exponents(found: dict[int, dict]) -> dict[str, dict[str, float]]:
    """Exponent `p` of `seconds ~ sections^p` by question, of warm calls, by least squares."""
    fitted: dict[str, dict[str, float]] = {}
    for question in next(iter(found.values())):
        for who in ("jaxrotor", "ROSS"):
            rows = {n: rows[question][who] for n, rows in found.items() if who in rows[question]}
            if len(rows) > 1:
                seconds = [np.log(row["warm"]) for row in rows.values()]
                slope = np.polyfit(np.log(list(rows)), seconds, 1)[0]
                fitted.setdefault(question, {})[who] = float(slope)
    return fitted


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", default=".", metavar="PATTERN", help="of questions")
    parser.add_argument("--sections", type=int, nargs="+", default=[10, 20, 56, 100])
    parser.add_argument("--repeats", type=int, default=5, help="timed calls after the first")
    parser.add_argument("--fresh", type=int, default=1, help="fresh processes, at least one")
    parser.add_argument("--no-ross", action="store_true", help="without ROSS, so without errors")
    parser.add_argument("--threads", type=int, default=1, help="of OpenBLAS, in both programs")
    default = user_cache_path("jaxrotor-benchmarks") / "ross-2.3"
    parser.add_argument("--peer-environment", type=Path, default=default, metavar="FOLDER")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write all figures there")
    args, log = parser.parse_args(), Console(stderr=True, highlight=False)
    questions = [question for question in QUESTIONS if re.search(args.only, question)]
    if min(args.sections) < 8 or args.fresh < 1 or args.repeats < 1:
        parser.error("`--sections` are at least 8, `--fresh` and `--repeats` at least 1.")
    if not questions:
        parser.error(f"`--only` must match one of {', '.join(QUESTIONS)}, but is {args.only!r}.")
    python = None if args.no_ross else environment(args.peer_environment)
    out, load = Console(highlight=False, width=max(130, log.width)), os.getloadavg()[:1]
    command = [sys.executable, "-m", "peers.with_jaxrotor"]
    peers = [python or "", "-m", "peers.with_ross"]
    found: dict[int, dict] = {}
    with tempfile.TemporaryDirectory() as folder:
        for sections in args.sections:
            machine = compressor(sections, Path(folder))
            ours = Program([*command, folder], args.threads)
            peer = Program(peers, args.threads) if python else None
            rotor = ours.ask(request(machine, "numbers"))["answer"]
            found[sections] = rows = {}
            for question in questions:
                log.print(f"{sections} sections, {question}")
                asked, how = request(machine, question, **FULL), (args.fresh, args.repeats)
                rows[question] = {"jaxrotor": timed(command, args.threads, asked, *how)}
                if peer and question != "show":
                    rows[question]["ROSS"] = timed(
                        peers, args.threads, asked | {"rotor": rotor}, *how
                    )
                    rows[question]["error"] = checked(ours, peer, machine, question, rotor)
            ours.close()
            if peer:
                peer.close()
            elements = round(LENGTH / machine.element)
            size = f"{rotor['coordinates']} complex coordinates"
            size += f", ROSS {elements} elements, {6 * (elements + 1)} real ones" * bool(python)
            out.print(table(sections, size, rows))
    fitted = exponents(found)
    if fitted:
        shown = Table("question", *("jaxrotor", "ROSS")[: 2 - args.no_ross], title="Exponents")
        for question, row in fitted.items():
            shown.add_row(question, *(f"{slope:.2f}" for slope in row.values()))
        out.print(shown)
    load += os.getloadavg()[:1]
    about = {"machine": processor(), "threads": args.threads}
    about |= {"ROSS": version(python)} if python else {}
    about["load before and after"] = " ".join(f"{x:.1f}" for x in load)
    out.print("; ".join(f"{key} {value}" for key, value in about.items()), soft_wrap=True)
    if args.json:
        figures = {"sections": found, "exponents": fitted, "about": about}
        args.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
