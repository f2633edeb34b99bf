"""Goals of speed, and what this run reached."""

import os

from rich.table import Table


CORES = os.cpu_count() or 1


def goals(rows: list[dict], by_hand: list[dict], began: dict, target: float) -> list[dict]:
    """Goal, ratio reached, whether: from methods that met the target, ours against each other's best."""
    meets = [row for row in rows if row["error"] <= target]

    def best(pattern: str, ending: str = "") -> float:
        """Lane-revolutions a second of the quickest method of a name."""
        named = [row for row in meets if row["method"].startswith(pattern)]
        return max(
            (row["lane-rev/s"] for row in named if row["method"].endswith(ending)),
            default=float("nan"),
        )

    def cost(by: str, threads: int) -> float:
        found = [r["us/lane-rev"] for r in by_hand if (r["by"], r["threads"]) == (by, threads)]
        return found[0] if found else float("nan")

    ours, one = best("jaxrotor"), best("jaxrotor", "workers 1")
    all_ours = cost("jaxrotor", CORES)
    listed = []

    def goal(name: str, least: float, ratio: float, at_most: bool = False) -> None:
        met = ratio <= least if at_most else ratio >= least
        known = ratio == ratio
        listed.append(
            {
                "goal": name,
                "wanted": f"{'<=' if at_most else '>='} {least:g}",
                "ratio": ratio if known else None,
                "reached": ("yes" if met else "no") if known else "not run",
            }
        )

    for kind, least in (("LSODA", 3000), ("Radau", 1500)):
        alone = ours / best(f"SciPy {kind}", "processes 1")
        goal(f"1. over SciPy {kind}, one process", least, alone)
        goal(
            f"1. over SciPy {kind}, {CORES} processes",
            800,
            ours / best(f"SciPy {kind}", f"processes {CORES}"),
        )
    goal("2. over diffrax Kvaerno5, quickest", 1200, ours / best("diffrax Kvaerno5"))
    goal("2. over diffrax Tsit5", 30, ours / best("diffrax Tsit5"))
    goal("2. over RK4 scan under vmap", 30, ours / best("RK4 scan", "RK4 scan"))
    goal("2. over RK4 scan under vmap, few modes", 30, ours / best("RK4 scan,"))
    goal("3. over numba, same arithmetic, all cores", 1.5, cost("numba", CORES) / all_ours)
    goal(
        "3. over numba RK4, few modes, all cores",
        12,
        ours / best("numba RK4", f"threads {CORES}"),
    )
    goal("4. time over C++, one core", 1.5, cost("jaxrotor", 1) / cost("C++", 1), at_most=True)
    goal("4. time over C++, all cores", 1.5, all_ours / cost("C++", CORES), at_most=True)
    few = next((row["by"] for row in by_hand if "shapes" in row["by"]), "")
    for name, count in (("one core", 1), ("all cores", CORES)):
        ratio = cost(few, count) / cost("C++", count)
        goal(f"4. time by few shapes over C++ in all coordinates, {name}", 1.0, ratio, at_most=True)
    goal("5. all cores over one core, sweep", 1.7, best("jaxrotor", f"workers {CORES}") / one)
    goal("5. all cores over one core, end states", 1.7, cost("jaxrotor", 1) / all_ours)
    goal("5. seconds of `jaxrotor sweep limiter-rotor`", 15, began["first s"], at_most=True)
    goal("5. the same again", 15, began["again s"], at_most=True)
    return listed


def goals_table(listed: list[dict]) -> Table:
    shown = Table(title="Goals (ours: all cores, unless it says one)")
    for head in listed[0]:
        shown.add_column(head, justify="left" if head == "goal" else "right")
    for row in listed:
        ratio = row["ratio"]
        text = "-" if ratio is None else f"{ratio:,.0f}" if ratio > 100 else f"{ratio:.3g}"
        shown.add_row(row["goal"], row["wanted"], text, row["reached"])
    return shown
