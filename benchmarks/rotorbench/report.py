"""The table and the figure of RotorBench."""

import re
import statistics
from pathlib import Path
from typing import Any

from .cases import cases


GOAL, TENTH = 1e-6, 0.1
WIDE = 25  # letters of a title that fit above a panel
LEAST = 1e-14  # smaller errors are drawn here
DOCS = Path(__file__).parents[2] / "docs"
PAGE, FIGURE = DOCS / "rotorbench.md", DOCS / "rotorbench.png"
BEGIN, END = "<!-- written by rotorbench: begin -->", "<!-- written by rotorbench: end -->"
PROGRAMS = {"jaxrotor": "C0", "ROSS": "C1", "SciPy": "C2"}
MISSED = "**!**"  # mark of an error above the goal
Found = dict[str, dict[str, list[dict[str, Any]]]]
Rows = dict[str, list[str]]


def best(rows: list[dict[str, Any]]) -> dict[str, Any] | None:
    """The quickest setting with an error of at most `GOAL`, or the one with the least error."""
    reached = [row for row in rows if row["error"] <= GOAL]
    if reached:
        return min(reached, key=lambda row: row["warm"])
    return min(rows, key=lambda row: row["error"]) if rows else None


def rows(found: Found) -> Rows:
    """What was measured as cells of a table, by case."""
    cells: Rows = {}
    for name, by in found.items():
        ours, ross, own = (best(by[program]) for program in PROGRAMS)
        cells[name] = [*_cells(ours), f"{max(row['first'] for row in by['jaxrotor']):.1f}"]
        cells[name] += [*_cells(ross), *_cells(own)]
        cells[name] += [f"{ross['warm'] / ours['warm']:.3g}" if ross and ours else "-"]
    return cells


def table(cells: Rows, told: str) -> str:
    """The table, how many cases reach what is wanted, and how it was measured, as Markdown."""
    heads = ["case", "jaxrotor: error", "ms", "first, s", "ROSS: error", "ms", "SciPy: error", "ms"]
    lines = ["| " + " | ".join([*heads, "ROSS over jaxrotor"]) + " |", "|---" * 9 + "|"]
    lines += ["| " + " | ".join([name, *own]) + " |" for name, own in cells.items()]
    return "\n".join([*lines, "", summary(cells), "", told])


def told(about: dict[str, str]) -> str:
    """How a run was measured."""
    return f"Measured with: {'; '.join(f'{key} {value}' for key, value in about.items())}."


def _cells(row: dict[str, Any] | None) -> list[str]:
    if row is None:
        return ["-", "-"]
    missed = f" {MISSED}" if row["error"] > GOAL else ""
    return [f"{row['error']:.0e}{missed}", f"{1e3 * row['warm']:.3g}"]


def summary(cells: Rows) -> str:
    """How many cases reach what is wanted, and which do not."""
    off, late, slow, ratios = [], [], [], []
    for name, (error, ms, _, _, ross, own_error, own, ratio) in cells.items():
        good = MISSED not in error
        off += [] if good else [name]
        if ross != "-":
            ratios.append(float(ratio))
            late += [] if good and float(ms) <= TENTH * float(ross) else [name]
        if own != "-" and MISSED not in own_error:
            slow += [] if good and float(ms) <= float(own) else [name]
    listed = lambda names: f" (not in: {'; '.join(names)})" if names else ""
    text = (
        f"jaxrotor has six digits in {len(cells) - len(off)} of {len(cells)} cases{listed(off)}. "
    )
    if ratios:
        text += (
            f"ROSS answers {len(ratios)} of them; jaxrotor takes at most a tenth of its time in "
        )
        text += f"{len(ratios) - len(late)}{listed(late)}, and the median ratio is "
        text += f"{statistics.median(ratios):.3g}. "
    return text + f"SciPy of one's own is quicker than jaxrotor in {len(slow)} cases."


def draw(found: Found, path: Path) -> None:
    """Error against time, one small panel a case."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    columns = 6
    rows = -(-len(found) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(11, 1.5 * rows + 0.6), sharex=True, sharey=True, squeeze=False
    )
    for ax in axes.flat[len(found) :]:
        ax.set_visible(False)
    for ax, (name, by) in zip(axes.flat, found.items(), strict=False):
        ax.axhline(GOAL, color="0.7", linewidth=0.8)
        for program, colour in PROGRAMS.items():
            points = sorted((1e3 * row["warm"], max(row["error"], LEAST)) for row in by[program])
            if points:
                ax.loglog(*zip(*points, strict=True), ".-", color=colour, lw=1, ms=5)
        ax.set_title(name, fontsize=7.5 if len(name) <= WIDE else 6, pad=2)
        ax.tick_params(labelsize=7)
        ax.set_ylim(LEAST / 5, 1)
        ax.set_yticks([1e-12, 1e-9, 1e-6, 1e-3])
    figure.supxlabel("processor time of a call [ms]", fontsize=9)
    figure.supylabel("relative error", fontsize=9)
    handles = [
        plt.Line2D([], [], color=colour, marker=".", label=program)
        for program, colour in PROGRAMS.items()
    ]
    figure.legend(handles=handles, loc="upper right", ncols=3, fontsize=9, frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.97), h_pad=0.4, w_pad=0.3)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def sources() -> str:
    """The cases, their questions, and where their reference numbers come from."""
    lines = ["| case | question | source of the reference | ROSS |", "|---|---|---|---|"]
    for case in cases():
        cells = [case.name, case.question, case.source, case.without_ross or "yes"]
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def write(found: Found, about: dict[str, str]) -> None:
    """Table, summary and sources into the page, and the figure beside it.

    Of a run of some cases the rows alone: other rows, and the figure, stay as they were.
    """
    text, names = PAGE.read_text(), [case.name for case in cases()]
    cells, how = rows(found), told(about)
    if set(found) == set(names):
        draw(found, FIGURE)
    else:
        (before,) = re.findall("^Measured with: .*$", text, flags=re.M)
        how = f"{before} Measured apart, load {about['load before and after']}: {'; '.join(found)}."
        cells = _written(text) | cells
    cells = {name: cells[name] for name in names if name in cells}
    own = "\n\n".join([BEGIN, table(cells, how), sources(), END])
    PAGE.write_text(re.sub(f"{BEGIN}.*{END}", lambda _: own, text, flags=re.S))


def _written(text: str) -> Rows:
    """Cells of the table in a page, by case."""
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {name: own for name, *own in lines if len(own) == 8 and name != "case"}
