"""The table of hard cases: what `@pytest.mark.hard("1.4 a phrase")` says, and how its test ended."""

import ast
import re
from pathlib import Path

import pytest


COMMAND = "pytest -m hard --hard-table docs/hard-cases.md"
SHEETS = {
    1: "Flexible rotor between limiters",
    2: "Rotor of two stiffnesses in elastic supports",
    3: "Gyroscopic rotor with hysteretic friction",
    4: "Bearing reactions during run-up",
    5: "Automatic ball balancer",
    6: "Any rotor",
    7: "Rotor in an annular stator",
    8: "Oil films and coefficients that change with speed",
}
ANY = 6  # the sheet of cases without a number
OUTCOMES = {"right": "right", "refused": "refused in one sentence", "flagged": "flagged"}
STATES = ("passed", "skipped", "failed")  # worse to the right
HEAD = f"""# Hard cases

Where rotor programs go wrong, and how this one fares there. *Right*: the numbers are those of a published
table, of a closed form or of a program that shares no code with the library. *Refused in one sentence*: an
error that says what was wrong and what to do. *Flagged*: a result that says what is wrong
with it, beside others that are right.

The table is written by the tests themselves: `{COMMAND}`.
"""


def case_of(mark):
    """Arguments of a mark: the case, and what is to come of it."""

    def hard(case, outcome="right"):
        if outcome not in OUTCOMES:
            raise pytest.UsageError(
                f"outcome={outcome!r} of {case!r} must be one of {[*OUTCOMES]}."
            )
        return case, outcome

    return hard(*mark.args, **mark.kwargs)


def sheet_and_number(case):
    """Where a case stands in the table; those without a number are of any rotor."""
    found = re.match(r"(\d+)\.(\d+) ", case)
    return (int(found[1]), int(found[2]), case) if found else (ANY, 10**6, case)


class HardTable:
    """Gathers the reports of marked tests, from any worker, and writes the table at the end."""

    def __init__(self, path):
        self.path = Path(path)
        self.tests = {}  # test: state, cases, measured

    def pytest_runtest_logreport(self, report):
        properties = report.user_properties
        cases = [tuple(value) for key, value in properties if key == "hard"]
        if cases and (report.when == "call" or report.outcome != "passed"):
            before = self.tests.get(report.nodeid, (report.outcome,))[0]
            measured = [str(value) for key, value in properties if key == "measured"]
            self.tests[report.nodeid] = (worst([before, report.outcome]), cases, measured)

    def pytest_sessionfinish(self):
        self.path.write_text(text(self.tests))


def worst(states):
    return max(states, key=STATES.index)


def text(tests):
    """The page: a table for every sheet, a row for every case, whatever the order of the tests."""
    rows = {}
    for test, (state, cases, measured) in sorted(tests.items()):
        for case, outcome in cases:
            rows.setdefault(case, []).append((test, state, outcome, measured))
    page, sheet = [HEAD.rstrip()], None
    for case in sorted(rows, key=sheet_and_number):
        if sheet != (sheet := sheet_and_number(case)[0]):
            page.append(f"\n## {sheet}. {SHEETS[sheet]}\n")
            page.append("| hard case | outcome | measured | test |\n|---|---|---|---|")
        page.append(row(case, *zip(*rows[case], strict=True)))
    return "\n".join(page) + "\n"


def row(case, tests, states, outcomes, measured):
    state = worst(states)
    outcome = ", ".join(OUTCOMES[x] for x in OUTCOMES if x in outcomes)
    names = dict.fromkeys(test.partition("[")[0] for test in tests)
    said = list(dict.fromkeys(said for texts in measured for said in texts))
    if len(said) > 4:
        said = [*said[:2], "...", said[-1]]
    cells = [
        case,
        outcome if state == "passed" else f"**{state}**",
        "; ".join(said),
        " <br> ".join(f"`{name}`" for name in names),
    ]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


# === what the sources promise


def promised(folder):
    """Pairs of case and test of every mark below a folder, without running anything."""
    found = set()
    for path in sorted(folder.rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                test = f"{path.relative_to(folder.parent).as_posix()}::{node.name}"
                found |= {(case, test) for mark in node.decorator_list for case in cases_in(mark)}
    return found


def cases_in(decorator):
    """Cases of the marks in a decorator, also in `pytest.param(..., marks=...)`."""
    for node in ast.walk(decorator):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "pytest.mark.hard":
            yield ast.literal_eval(node.args[0])


def written(page):
    """The same pairs out of the page."""
    rows = [line for line in page.splitlines() if "::" in line]
    cells = [re.split(r" (?<!\\)\| ", line[2:-2]) for line in rows]
    return {
        (cell[0].replace("\\|", "|"), test.strip(" `"))
        for cell in cells
        for test in cell[3].split("<br>")
    }
