"""Durations: what every file of tests costs, as a table; see `pytest --durations-table`."""

import os
from collections import Counter, defaultdict
from pathlib import Path

import jax
import pytest


COMPILED = "/jax/core/compile/backend_compile_duration"


def seconds_of_processor() -> float:
    """Processor time of this process and of the processes that it waited for [s]."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


class Meter:
    """Processor time and compilation of every phase of a test, sent along with its report."""

    def __init__(self):
        self.compiled = self.programs = 0
        self.before = (0.0, 0.0, 0)
        jax.monitoring.register_event_duration_secs_listener(self._hear)

    def _hear(self, event: str, seconds: float, **_):
        if event == COMPILED:
            self.compiled += seconds
            self.programs += 1

    def _now(self):
        return seconds_of_processor(), self.compiled, self.programs

    def pytest_runtest_logstart(self):
        self.before = self._now()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, item):
        now = self._now()
        spent = tuple(b - a for a, b in zip(self.before, now, strict=True))
        self.before = now
        others = [pair for pair in item.user_properties if pair[0] != "spent"]
        item.user_properties = [*others, ("spent", spent)]


class Table:
    """Writes, by file, the seconds of its tests, their number and how much of it is compilation."""

    def __init__(self, path: str):
        self.path = Path(path)
        self.files = defaultdict(Counter)

    def pytest_runtest_logreport(self, report):
        processor, compiled, programs = dict(report.user_properties).get("spent", (0.0, 0.0, 0))
        tests = int(report.when == "call")
        self.files[report.nodeid.partition("::")[0]].update(
            tests=tests,
            seconds=report.duration,
            processor=processor,
            compiled=compiled,
            programs=programs,
        )

    def pytest_sessionfinish(self):
        rows = sorted(self.files.items(), key=lambda row: -row[1]["processor"])
        total = Counter()
        for _, row in rows:
            total.update(row)
        lines = [
            "| file | tests | wall [s] | processor [s] | programs | compilation [s] | share |",
            "|---|---|---|---|---|---|---|",
        ]
        lines += [_line(name, row) for name, row in [("all", total), *rows]]
        self.path.write_text("\n".join(lines) + "\n")


def _line(name: str, row: Counter) -> str:
    share = row["compiled"] / row["seconds"] if row["seconds"] else 0.0
    return (
        f"| {name} | {row['tests']} | {row['seconds']:.1f} | {row['processor']:.1f} | "
        f"{row['programs']} | {row['compiled']:.1f} | {share:.0%} |"
    )
