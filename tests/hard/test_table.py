"""The table of hard cases: what it shows of the results, and that it names every marked test."""

from pathlib import Path
from types import SimpleNamespace

from hard import table


ROOT = Path(__file__).parents[2]


def report(test, cases, *measured, state="passed", when="call"):
    properties = [("hard", case) for case in cases] + [("measured", said) for said in measured]
    return SimpleNamespace(nodeid=test, when=when, outcome=state, user_properties=properties)


def test_rows_are_sorted_and_merged(tmp_path):
    made = table.HardTable(tmp_path / "page.md")
    soft, stiff = ["1.10 later", "right"], ["1.9 a | b", "refused"]
    for one in (
        report("tests/test_b.py::test_x[2]", [soft], "2e-3"),
        report("tests/test_b.py::test_x[1]", [soft, stiff], "1e-3"),
        report("tests/test_b.py::test_x[1]", [soft, stiff], "1e-3", when="teardown"),
        report("tests/test_a.py::test_y", [["no number", "flagged"]]),
        report("tests/test_a.py::test_z", [["2.1 broken", "right"]]),
        report(
            "tests/test_a.py::test_z", [["2.1 broken", "right"]], state="failed", when="teardown"
        ),
        report(
            "tests/test_a.py::test_w", [["2.2 elsewhere", "right"]], state="skipped", when="setup"
        ),
        report("tests/test_a.py::test_v", []),
    ):
        made.pytest_runtest_logreport(one)
    made.pytest_sessionfinish()
    page = made.path.read_text()
    assert [line for line in page.splitlines() if "::" in line] == [
        "| 1.9 a \\| b | refused in one sentence | 1e-3 | `tests/test_b.py::test_x` |",
        "| 1.10 later | right | 1e-3; 2e-3 | `tests/test_b.py::test_x` |",
        "| 2.1 broken | **failed** |  | `tests/test_a.py::test_z` |",
        "| 2.2 elsewhere | **skipped** |  | `tests/test_a.py::test_w` |",
        "| no number | flagged |  | `tests/test_a.py::test_y` |",
    ]
    assert ("1.9 a | b", "tests/test_b.py::test_x") in table.written(page)


def test_the_page_names_every_marked_test():
    """By case and test; the results are those of the last run with the option."""
    page = (ROOT / "docs" / "hard-cases.md").read_text()
    assert table.promised(ROOT / "tests") == table.written(page), f"Run {table.COMMAND}."
    assert table.COMMAND in page and "**failed**" not in page and "**skipped**" not in page
