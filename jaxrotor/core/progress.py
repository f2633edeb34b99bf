"""Progress of long computations on a terminal: a bar, or a line where there are no steps to count.

One display is shown at a time: a computation called by another that shows its progress stays silent.
"""

import contextlib
import sys
import threading
from collections.abc import Iterator
from typing import Any


PATIENCE = 2.0  # [s], before a line is shown
COMPILING = "compiling .."
_SHOWN = threading.Lock()


@contextlib.contextmanager
def _display(show: bool | None) -> Iterator[bool]:
    """Whether to show progress: `show`, or if None on a terminal; False while another display is shown."""
    wanted = sys.stderr.isatty() if show is None else show
    held = wanted and _SHOWN.acquire(blocking=False)
    try:
        yield held
    finally:
        if held:
            _SHOWN.release()


@contextlib.contextmanager
def waiting(show: bool | None, what: str) -> Iterator[None]:
    """Show on a terminal, after `PATIENCE`, a line with `what` is under way and the time elapsed.

    It is for a single program, which is compiled and run without steps that could be counted.
    """
    with _display(show) as shown:
        if not shown:
            yield
            return
        done = threading.Event()
        line = threading.Thread(target=_line, args=(what, done), daemon=True)
        line.start()
        try:
            yield
        finally:
            done.set()
            line.join()


def _line(what: str, done: threading.Event) -> None:
    if done.wait(PATIENCE):
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=console.is_terminal) as bar:
        bar.add_task(f"{what}: compiling and running", total=None)
        done.wait()


@contextlib.contextmanager
def progress(show: bool | None, total: int, what: str, unit: str, each: int = 1) -> Iterator:
    """Show a bar on a terminal; yields `tick(steps)`, which advances it.

    A step is `each` of the `unit`, in which the rate is shown. Until the first step the bar says that
    the program is being compiled.
    """
    with _display(show) as shown:
        if not shown:
            yield lambda steps: None
            return
        with _bar(total, what, unit, each) as tick:
            yield tick


@contextlib.contextmanager
def _bar(total: int, what: str, unit: str, each: int) -> Iterator:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.table import Column
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Any) -> Text:
            speed = task.finished_speed or task.speed
            if speed is None:
                return Text("")
            digits = ",.0f" if speed * each >= 100 else ".3g"
            return Text(f"{speed * each:{digits}} {unit}/s")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=16),  # so that the line fits 80 columns
        TextColumn("{task.percentage:3.0f} %"),
        Rate(table_column=Column(no_wrap=True)),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(COMPILING, total=total)
        yield lambda steps: bar.update(task, advance=steps, description=what)


SEGMENT = 50  # revolutions between two updates of the progress bar


def segments(revolutions: int) -> list[int]:
    """Parts of a number of revolutions; the progress bar is updated after each."""
    whole, rest = divmod(revolutions, SEGMENT)
    return [SEGMENT] * whole + [rest] * (rest > 0)
