"""Notebooks as tests execute them: in the quick version, with the numbers that they have found."""

import base64
import json
import os
import re
from pathlib import Path

import garbage
import nbformat
import pytest
from nbclient import NotebookClient


NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
DRAWS = re.compile(r"\bplot\.\w+\(|\bplt\.subplots\(")
PNG = b"\x89PNG\r\n\x1a\n"
# Run after the last cell: numbers the notebook has found, of 01 each with its reference.
TOLD = """import json
first = lambda value: float(value[0] if isinstance(value, tuple) else value)
print(json.dumps({name: first(value) for name, value in found.items()}))"""


# Settings of the compiler for a notebook whose programs run longer than they take to compile.
OPTIMISED = "--xla_backend_optimization_level=1 --xla_cpu_use_fusion_emitters=false"


# Before the first cell of a notebook: of the one before it only the modules are left.
ANEW = """%reset -f
import os
import matplotlib.pyplot as plt
plt.close("all")
plt.rcdefaults()
os.chdir({folder!r})
"""


def executed(paths: list[Path], folder: Path, flags: str | None = None) -> list[list]:
    """Code cells of notebooks that ran one after the other, each in a folder, in its quick version.

    One kernel runs them all, so that the library is loaded once. `flags` are settings of the compiler,
    by default those of the tests.
    """
    notebooks = [nbformat.read(path, as_version=4) for path in paths]
    for path, notebook in zip(paths, notebooks, strict=True):
        own = folder / path.stem
        own.mkdir()
        begin = ANEW.format(folder=str(own)) + garbage.CODE
        first, last = map(nbformat.v4.new_code_cell, (begin, TOLD))
        notebook.cells = [first, *notebook.cells, last]
        for number, cell in enumerate(notebook.cells):
            cell.id = f"{path.stem}-{number}"
    every = nbformat.v4.new_notebook(cells=[cell for one in notebooks for cell in one.cells])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("JAXROTOR_QUICK", "1")
        patch.setenv("PYTHONPATH", str(paths[0].parent), prepend=os.pathsep)
        if flags is not None:
            patch.setenv("XLA_FLAGS", flags)
        patch.delenv("MPLBACKEND", raising=False)  # the kernel's own draws into the notebook
        NotebookClient(every, timeout=600, kernel_name="python3", allow_errors=True).execute()
    return [code_cells(notebook) for notebook in notebooks]


def code_cells(notebook) -> list:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def pictures(cell) -> list[bytes]:
    data = (output.get("data", {}) for output in cell.outputs)
    return [base64.b64decode(one["image/png"]) for one in data if "image/png" in one]


def streams(cells, name: str) -> list[str]:
    outputs = (output for cell in cells for output in cell.outputs)
    return [one["text"] for one in outputs if one.output_type == "stream" and one["name"] == name]


def found(cells) -> dict[str, float]:
    """Numbers of its dictionary `found`, none of which an error has left out."""
    assert not [one for cell in cells for one in cell.outputs if one.output_type == "error"]
    return json.loads(streams(cells, "stdout")[-1])


def check_runs(cells) -> None:
    """Neither errors nor warnings, and every cell that draws has its picture."""
    assert not [one for cell in cells for one in cell.outputs if one.output_type == "error"]
    assert streams(cells, "stderr") == []
    drawing = [cell for cell in cells if DRAWS.search(cell.source)]
    assert drawing
    for cell in drawing:
        assert len(pictures(cell)) == 1, cell.source
        assert pictures(cell)[0].startswith(PNG)


def check_found(cells, expected: dict[str, tuple[float, float]]) -> None:
    """Numbers found are those expected, within their tolerances."""
    numbers = found(cells)
    wrong = {
        key: (numbers[key], value)
        for key, (value, tolerance) in expected.items()
        if not abs(numbers[key] - value) <= tolerance
    }
    assert not wrong
