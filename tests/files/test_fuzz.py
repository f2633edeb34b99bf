"""Fuzzing of scene files: each gives a scene or an error message of one sentence.

`JAXROTOR_FUZZ=100000 pytest -n 0 tests/files/test_fuzz.py` tries as many files; the default is 500,
others in every run.
"""

import contextlib
import io
import os
import re
import sys
import tomllib
import traceback
import types
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings, strategies as st
from typer.main import get_command

from jaxrotor import SceneError, files
from jaxrotor.cli import app
from jaxrotor.cli.typed import typed
from jaxrotor.files import units
from jaxrotor.files.shipped import _shipped, shipped
from jaxrotor.files.units import quantity


PROGRAM: Any = get_command(app)
COUNT = int(os.environ.get("JAXROTOR_FUZZ", "500"))
SHIPPED = [file.read_text("utf-8") for file in _shipped().values()]
LONGEST = 3100  # limit of the characters of a message

CODE = "__import__('os').system('touch touched')"
UNITS = [
    "mm",
    "rpm",
    "deg",
    "N/m",
    "kg",
    "s",
    "%",
    "",
    "m m",
    "m^9",
    "1/s",
    "furlong",
    "°",
    "m**-1",
]
UNITS += [CODE, f"{CODE} m", "9**9**9 m", "m**9**9**9", "m^99999999", "(" * 500, "m" * 5000, "m\\n"]
UNITS += [
    "lambda: 0",
    "m if 1 else m",
    "m; m",
    "[m for m in m]",
    "{0}",
    "m.__class__",
    "µm",
    "\\u0000",
]
NUMBERS = ["0", "-1", "1", "2.5", "1_000", "007", "9" * 400, "-" + "9" * 5000, "0x1F", "0b1", "0o7"]
NUMBERS += [
    "nan",
    "-nan",
    "inf",
    "-inf",
    "1e999",
    "-1e308",
    "1e-400",
    "5e-324",
    "-0.0",
    "1e999999999",
]
PLAIN = [
    "true",
    "false",
    "1979-05-27",
    "07:32:00",
    "1979-05-27T07:32:00Z",
    "0001-01-01T00:00:00+23:59",
]
BROKEN = [
    "",
    "=",
    "]",
    "[",
    "{",
    '"',
    "'''",
    '"""',
    "#",
    "\\",
    ",",
    '"\\ud800"',
    '"\\q"',
    "\x00",
    "\x1b",
]
JUNK = [
    '""',
    '"a b"',
    "'__class__'",
    "a.b.c",
    "é",
    '"é\U0001f600"',
    "1",
    "-",
    ".",
    "a.",
    '"\\u0000"',
]
JUNK += [".".join("a" * 2000), "k" * 5000, "constructor", "model", "exact", "over", "start", "self"]
BYTES = [
    b"\xff",
    b"\xc3",
    b"\xed\xa0\x80",
    b"\xef\xbb\xbf",
    b"\x00",
    b"\r",
    b"\xf4\x90\x80\x80",
    b"\n",
]


def names():
    """All keys of all shipped scenes, including dotted ones."""

    def below(table):
        for key, value in table.items():
            yield f'"{key}"' if "." in key else key
            for one in value if isinstance(value, list) else [value]:
                if isinstance(one, dict):
                    yield from below(one)

    return sorted({key for text in SHIPPED for key in below(tomllib.loads(text))})


KEYS = names()


def value(random, depth=0):
    """Text of a TOML value of any kind and depth, or of something that is not a value."""
    some = lambda: ", ".join(value(random, depth + 1) for _ in range(random.randrange(4)))
    table = lambda: ", ".join(f"{key(random)} = {value(random, depth + 1)}" for _ in range(2))
    number = lambda: random.choice(NUMBERS)
    kind = random.randrange(9 if depth < 3 else 5)
    many = random.choice([5, 500, 5000])
    match kind:
        case 0:
            return number()
        case 1:
            return f'"{number()} {random.choice(UNITS)}"'
        case 2:
            return random.choice(PLAIN)
        case 3:
            return f'"{number()} {random.choice(UNITS)} : {number()} : {number()}"'
        case 4:
            return random.choice(
                [*BROKEN, '"steel"', '"flexible"', '"pin"', "''", '"' + "x" * many + '"']
            )
        case 5 | 6:
            return f"[{some()}]"
        case 7:
            return f"{{{table()}}}"
        case _:
            return random.choice(["[" * many + "]" * many, "{a = " * many + "1" + "}" * many])


def key(random):
    """Key of a scene, or any other key, or several joined by dots."""
    parts = [random.choice(JUNK if random.random() < 0.2 else KEYS)]
    if random.random() < 0.2:
        parts.append(random.choice(KEYS))
    return ".".join(parts)


def mutated(random):
    """Bytes of a shipped scene with one to four changes of its lines, and possibly one of its bytes."""
    lines = random.choice(SHIPPED).split("\n")
    lines = [line for line in lines if line and not line.startswith("#")]
    for _ in range(random.choice([1, 1, 2, 4])):
        at = random.randrange(len(lines))
        name, _, rest = lines[at].partition(" = ")
        match random.randrange(12):
            case 0 | 1 | 2 if rest:
                lines[at] = f"{name} = {value(random)}"
            case 3 if rest:
                lines[at] = f"{key(random)} = {rest}"
            case 4:
                lines.insert(at, f"{key(random)} = {value(random)}")
            case 5:
                lines.insert(at, random.choice(["[{}]", "[[{}]]", "[[[{}]]]"]).format(key(random)))
            case 6:
                lines.insert(at, random.choice(lines))
            case 7 if len(lines) > 1:
                del lines[at]
            case _:  # another digit in the line
                lines[at] = re.sub(r"\d", str(random.randrange(10)), lines[at], count=1)
    text = "\n".join(lines).encode("utf-8", "surrogatepass")
    if random.random() < 0.1:
        at = random.randrange(len(text) + 1)
        text = text[:at] + random.choice(BYTES) + text[at + random.randrange(3) :]
    return text


# === what reading a file must not do

FORBIDDEN = ("os.", "subprocess.", "shutil.", "socket.", "ctypes.", "exec", "compile")
HARMLESS = ("os.listdir", "os.scandir")
WATCH: list = []  # its last list collects events


def _hook(event, args):
    if WATCH and event == "open":
        mode, flags = args[1:]
        if (mode and set(mode) & set("wax+")) or (flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)):
            WATCH[-1].append((event, args))
    elif WATCH and event.startswith(FORBIDDEN) and event not in HARMLESS and not checking_types():
        WATCH[-1].append((event, args))


def checking_types():
    """Whether beartype is compiling the checks of a nested function, which happens under pytest only."""
    frames = (frame.f_code for frame, _ in traceback.walk_stack(sys._getframe(1)))
    return any(
        "/beartype/" in code.co_filename or (code.co_name, Path(code.co_filename).name) == JAXTYPED
        for code in frames
    )


JAXTYPED = ("jaxtyped", "_decorator.py")


@contextlib.contextmanager
def watched():
    """Fail if a file is opened for writing, or anything is executed, compiled or sent."""
    seen = []
    WATCH.append(seen)
    try:
        yield
    finally:
        WATCH.pop()
    assert not seen


@pytest.fixture(scope="module", autouse=True)
def prepared(tmp_path_factory):
    for name, _ in shipped():  # so that modules for units and scenes are imported,
        files.load(name)
    bad = tmp_path_factory.mktemp("bad") / "bad.toml"
    bad.write_text("[shaft]\nmodel = 'rigid'\n")
    assert called("show", str(bad))[0] == 2  # and those for a command and its message
    if _hook not in HOOKED:
        sys.addaudithook(_hook)
        HOOKED.append(_hook)


HOOKED: list = []
OUTCOMES = {"scene": 0, "sentence": 0}


def called(*words):
    """Exit code, stdout and stderr of the program."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), watched():
        try:
            PROGRAM.main(list(words), prog_name="jaxrotor")
        except SystemExit as end:
            return end.code, out.getvalue(), err.getvalue()


def checked(path, content):
    """Check that a file gives a scene that can be written, or a message that names the file."""
    path.write_bytes(content)
    try:
        with watched():
            scene = files.load(path)
    except SceneError as error:
        OUTCOMES["sentence"] += 1
        said = str(error)
        assert said.startswith(str(path)) and said.endswith("."), said
        assert said.isprintable() and len(said) < LONGEST, said
        if sum(OUTCOMES.values()) % 10 == 0:
            shown = typed(said, "show", [str(path)], (), types.SimpleNamespace(params=()))
            assert called("show", str(path)) == (2, "", f"{' '.join(shown.split())}\n")
    else:
        OUTCOMES["scene"] += 1
        files.study(path)
        files.loads(files.dumps(scene))


@settings(
    max_examples=COUNT,
    derandomize=True,  # else a draw of 500 has few scenes now and then
    deadline=None,
    database=None,
    phases=[Phase.explicit, Phase.generate, Phase.shrink],
    suppress_health_check=list(HealthCheck),
)
@given(st.randoms(use_true_random=False))
def one_file(path, random):
    checked(path, mutated(random))


@pytest.mark.slow
def test_every_file_is_a_scene_or_one_sentence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    one_file(tmp_path / "my.toml")
    assert os.listdir() == ["my.toml"]
    assert min(OUTCOMES.values()) > COUNT / 20, OUTCOMES


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("number", ["1", "1e999999999", "9" * 5000])
def test_units_are_names_and_never_run(tmp_path, monkeypatch, number, unit):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(units, "_remember", lambda factors: None)
    try:
        with watched():
            quantity(f"{number} {unit}", "m", "my.toml: shaft.length")
    except SceneError as error:
        assert str(error).startswith("my.toml: shaft.length must be in m")
    assert not os.listdir()
