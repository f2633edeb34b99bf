"""Examples of commands in help texts, on pages and in advice: they run in the order printed.

The rotors are those of the examples with few nodes, and with few lanes in their sweeps.
"""

import ast
import functools
import importlib
import inspect
import re
import shlex
import shutil

import pytest
from test_docs import BLOCK, PAGES, ROOT, blocks, commanded, without_error_lanes
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.cli import app
from jaxrotor.cli.app import COMMANDS, loaded, options


shipped = importlib.import_module(
    "jaxrotor.files.shipped"
)  # the package has a function of that name
SMALL = (  # of a shipped scene: so few nodes, lanes and revolutions that only programs cost time
    (r'^(length = "0.7 m")', r"nodes = 3\n\1"),
    (r'^(length = "0.9 m")', r"nodes = 3\n\1"),
    (r"^settle = \d+", "settle = 4"),
    (r"^keep = \d+", "keep = 8"),
    (r"^steps_per_revolution = \d+", "steps_per_revolution = 64"),
    (r": 144\"", ': 3"'),
)
FEWER = (  # of an example
    (r"(--over \S+:)\d\d+\b", r"\g<1>3"),
    (r'(--over "[^"]+:)\d\d+"', r'\g<1>3"'),
    (r"--settle \d+", "--settle 4"),
    (r"--revolutions 500", "--revolutions 8"),
    (r"--keep 50", "--keep 4"),
    (r"^jaxrotor simulate limiter-rotor(?!.*--revolutions)", r"\g<0> --revolutions 8"),
)
ELSEWHERE = {  # examples that need more than this machine
    "jaxrotor sweep limiter-rotor --cluster tcp://10.0.0.1:8786 --out /shared/run": "test_cluster.py",
    "jaxrotor explore runs/long": "it opens a window",
    "jaxrotor --install-completion": "it writes into the home of the user",
}


@pytest.fixture(autouse=True)
def small(tmp_path, monkeypatch, rendered):
    """A folder with a file of ROSS, and shipped scenes that are small."""
    monkeypatch.chdir(tmp_path)
    without_error_lanes(monkeypatch)
    kept = tmp_path / "scenes"
    kept.mkdir()
    for name, file in shipped._shipped().items():
        text = file.read_text("utf-8")
        for pattern, other in SMALL:
            text = re.sub(pattern, other, text, flags=re.M)
        (kept / f"{name}.toml").write_text(text, "utf-8")
    found = {path.stem: path for path in kept.iterdir()}
    monkeypatch.setattr(shipped, "_shipped", lambda: found)
    shutil.copy(ROOT / "tests/files/ross/example.toml", "rotor.toml")


def run(line: str) -> None:
    """Run an example, shortened."""
    plain = " ".join(line.split("  #")[0].split())
    if plain in ELSEWHERE or plain.startswith("jaxrotor accuracy "):
        return  # an accuracy takes minutes; tests/work_precision has it at a small size
    for pattern, other in FEWER:
        plain = re.sub(pattern, other, plain)
    commanded(plain)


def examples(text: str) -> list[str]:
    """Lines of a text that are commands."""
    lines = inspect.cleandoc(text).replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if re.match(r"\s*jaxrotor -?-?[a-z]", line)]


LONG = ("", "sweep", "accuracy", "explore")  # not yet tried here as a whole
HELP = {"": examples(options.__doc__)}
HELP |= {name: examples(loaded(name).help) for name in COMMANDS}


@pytest.mark.parametrize(
    "command",
    [
        # A report of the compressor takes 45 s, and test_api.py writes one of a smaller rotor.
        pytest.param(name, marks=pytest.mark.long if name == "api" else pytest.mark.slow)
        for name in HELP
        if name not in LONG
    ],
)
def test_examples_of_help_run_in_order(command):
    assert HELP[command] or command == "scenes"
    for line in HELP[command]:
        run(line)


# Commands that are refused, and how their message says that it is mended.
ADVISED = [
    "response limiter-rotor --points 11",
    "balance limiter-rotor",
    "balance limiter-rotor --planes 0m,0.4m --set spin.speed=0rpm",
    "accuracy turbine-run-up --quantity reaction --duration 0.01s --samples 3 --method Tsit5",
    "new own.toml --from-ross rotor.toml",
    "sweep two-discs --settle 1 --keep 2 --steps 16",
    "run-up limiter-rotor --set spin.speed=0rpm",
]


@pytest.mark.slow
@pytest.mark.parametrize("line", ADVISED)
def test_advice_of_an_error_runs(line):
    refused = CliRunner().invoke(app, shlex.split(line))
    assert refused.exit_code == 2, refused.output
    advice = re.search(r"as in (--.+?)(?: \(|\.$)", refused.stderr.strip())
    assert advice is not None, refused.stderr
    added = advice[1]
    for pattern, other in FEWER:
        added = re.sub(pattern, other, added)
    commanded(f"jaxrotor {line} {added}")


def test_every_advice_is_tried():
    """Messages that say "as in --option value" are no more than those tried above."""
    texts = [path.read_text() for path in (ROOT / "jaxrotor/cli").glob("*.py")]
    raised = [
        one for text in texts for one in re.findall(r"as in\s+(?:f?\"\s*f?\")?--[a-z]+", text)
    ]
    assert len(raised) <= len(ADVISED), raised


@functools.cache
def python_left() -> list[tuple[str, str]]:
    """Python of the pages that is not run, and of the docstrings of the package."""
    found = [
        (page, block["code"])
        for page in PAGES
        for block in blocks(page)
        if block["left"] and block["language"] == "python"
    ]
    for path in sorted((ROOT / "jaxrotor").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            told = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            for block in BLOCK.finditer((told and ast.get_docstring(node)) or ""):
                if block["language"] == "python":
                    found.append((path.name, block["code"]))
    return found


def test_python_that_is_not_run_calls_what_exists():
    """Names exist, and take the arguments that they are given."""
    for page, code in python_left():
        for call in (n for n in ast.walk(ast.parse(code)) if isinstance(n, ast.Call)):
            place = call.func
            if not (isinstance(place, ast.Attribute) and isinstance(place.value, ast.Name)):
                continue
            room = {"jr": jr, "plot": plot}.get(place.value.id)
            if room is None:
                continue
            called = getattr(room, place.attr)
            spread = any(one.arg is None for one in call.keywords)
            given = {one.arg: None for one in call.keywords if one.arg is not None}
            signature = inspect.signature(called)
            (signature.bind_partial if spread else signature.bind)(*call.args, **given), page
