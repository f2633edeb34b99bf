"""Cases of known answers by jaxrotor, ROSS and SciPy: error against time, the table and the figure.

    python benchmarks/rotorbench
    python benchmarks/rotorbench --only 'two discs' --repeats 1

Every case is asked of each program at several settings: nodes or steps, meshes, tolerances; two meshes are
extrapolated to elements of no length. Seconds are processor time of all threads (user and system), the
median of calls after a first one. The rotor is built before: ROSS assembles there, the others in the call.
With `--write` the table of `docs/rotorbench.md` and `docs/rotorbench.png` are written anew, with `--only`
the rows of those cases alone.
"""

import argparse
import json
import os
import re
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from peers.programs import Program, environment, processor, version
from platformdirs import user_cache_path
from rich.console import Console

from .cases import Case, cases, complex_of, error, references
from .report import GOAL, draw, rows, table, told, write


MESHES = [[1], [2], [1, 2], [4], [2, 4], [8], [4, 8]]
LONGEST = 6.0  # processor seconds of a call after which no finer mesh is tried
ENOUGH = 2.0  # processor seconds of calls after which none is repeated


def settings(case: Case, program: str) -> list[Any]:
    """What a program is asked with, from coarse to fine."""
    if program == "jaxrotor":
        return case.jaxrotor
    if program == "ROSS":
        return [] if case.without_ross else MESHES
    return case.scipy or MESHES


def measured(
    program: Program, case: Case, setting: Any, exact: np.ndarray, repeats: int, compiles: bool
) -> dict:
    """Error, and processor seconds of the first call and of later ones.

    Where nothing is compiled any more, a first call that takes long stands for the later ones.
    """
    request = {"case": case.name, "setting": setting}
    first = program.ask(request)
    off = error(case, [complex_of(one) for one in first["answer"]], exact)
    later = [] if compiles or first["processor"] < ENOUGH else [first["processor"]]
    while not later or (len(later) < repeats and sum(later) < ENOUGH):
        later.append(program.ask(request)["processor"])
    return {
        "setting": setting,
        "error": off,
        "first": first["processor"],
        "warm": statistics.median(later),
    }


def asked(program: Program, name: str, case: Case, exact: np.ndarray, repeats: int) -> list[dict]:
    """What a program reaches at its settings; meshes end where the error is reached or time runs out."""
    rows: list[dict] = []
    for setting in settings(case, name):
        compiles = name == "jaxrotor" or not rows
        rows.append(measured(program, case, setting, exact, repeats, compiles))
        last = rows[-1]
        good = last["error"] <= (GOAL / 10 if last["warm"] < 1 else GOAL)
        if name != "jaxrotor" and (good or last["warm"] > LONGEST):
            break
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", default=".", metavar="PATTERN", help="names of cases")
    parser.add_argument("--repeats", type=int, default=3, help="timed calls after the first")
    default = user_cache_path("jaxrotor-benchmarks") / "ross-2.3"
    parser.add_argument("--peer-environment", type=Path, default=default, metavar="FOLDER")
    parser.add_argument(
        "--json", type=Path, metavar="PATH", help="write all that was measured there"
    )
    parser.add_argument("--figure", type=Path, metavar="PATH", help="draw the figure there")
    parser.add_argument(
        "--write", action="store_true", help="write the table and the figure of docs/rotorbench.md"
    )
    args, log = parser.parse_args(), Console(stderr=True, highlight=False)
    exact, load = references(), os.getloadavg()[:1]
    python = environment(args.peer_environment)
    found: dict[str, dict[str, list[dict]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        programs = {
            "jaxrotor": Program([sys.executable, "-m", "rotorbench.by_jaxrotor", folder], 1),
            "ROSS": Program([python, "-m", "rotorbench.by_ross"], 1),
            "SciPy": Program([sys.executable, "-m", "rotorbench.by_scipy"], 1),
        }
        for case in cases():
            if re.search(args.only, case.name):
                log.print(case.name)
                found[case.name] = {
                    name: asked(program, name, case, exact[case.name], args.repeats)
                    for name, program in programs.items()
                }
                if args.json:  # anew after every case, lest a run that ends early is lost
                    args.json.write_text(json.dumps({"cases": found}, indent=1) + "\n")
        for program in programs.values():
            program.close()
    load += os.getloadavg()[:1]
    about = {"machine": processor(), "ROSS": version(python)}
    about["load before and after"] = " ".join(f"{x:.1f}" for x in load)
    print(table(rows(found), told(about)))
    if args.json:
        args.json.write_text(json.dumps({"cases": found, "about": about}, indent=1) + "\n")
    if args.figure:
        draw(found, args.figure)
    if args.write:
        write(found, about)
