"""Code on the pages of the documentation runs, and prints what the pages say it prints.

Blocks of a page run in order: `python` in one namespace, lines `jaxrotor ..` of `sh` as commands, and
`toml` with a title is written to the file of that name. A block `text` is what the block before it
prints, where `..` stands for anything. A comment `<!-- not run: reason -->` leaves the next block out.
A picture right behind a block is the figure that the block draws: `--pictures` draws them anew.
"""

import contextlib
import importlib
import inspect
import io
import re
import shlex
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from PIL import Image
from typer.testing import CliRunner

from jaxrotor import plot as plots
from jaxrotor.cli import app


ROOT = Path(__file__).parents[1]
BLOCK = re.compile(
    r"(?P<left><!-- not run: [^>]+ -->\n)?^```(?P<language>python|sh|toml|text)"
    r'(?: title="(?P<title>[^"]+)")?\n(?P<code>.*?)^```$'
    r"(?:\n\n!\[[^\]]*\]\((?P<picture>[^)]+)\))?",
    re.M | re.S,
)
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")
GALLERY = "docs/gallery.md"
TIERS = {  # of pages, by default "slow"
    **dict.fromkeys((GALLERY, "docs/tutorials/fan.md", "docs/guides/design.md"), "long"),
}
PAGES = [
    *(
        "README.md",
        GALLERY,
        "docs/concepts/couplings.md",
        "docs/concepts/cracks.md",
        "docs/concepts/rolling-bearings.md",
        "docs/concepts/magnetic-bearings.md",
        "docs/concepts/several-shafts.md",
    ),
    *sorted(str(p.relative_to(ROOT)) for p in ROOT.glob("docs/[gt]*/*.md")),
]
COARSER = (  # numbers of the gallery that its pictures alone need: of lanes, points and repeats
    *(("800.0, 121)", "800.0, 9)"), ("4e-3, 20)", "4e-3, 4)"), ("900.0, 21)", "900.0, 3)")),
    *(("6.0, 64)", "6.0, 6)"), ("300.0, 60)", "300.0, 6)"), ("0.3, 31)", "0.3, 4)")),
    *(("5e-4, 19)", "5e-4, 3)"), ("(3, 4, 6), (4, 8, 16)", "(3, 4), (4, 8)")),
    *(("repeats=20", "repeats=1"), ("0.1)), 64)", "0.1)), 8)")),
)
CODE = "Description"  # key of a picture's file: the code that drew it


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch, rendered):
    monkeypatch.chdir(tmp_path)


def without_error_lanes(patch: pytest.MonkeyPatch) -> None:
    """Sweeps tell no errors unless asked to: running lanes again is half of what they compile."""
    module = importlib.import_module("jaxrotor.sweeps.sweep")
    run = module._run
    patch.setattr(
        module, "_run", lambda job, place, sample, *more: run(job, place, sample or 0, *more)
    )


NAMES = [name for name in dir(plots) if inspect.isfunction(getattr(plots, name))]


def blocks(page: str) -> list[re.Match]:
    return list(BLOCK.finditer((ROOT / page).read_text("utf-8")))


def printed(block: re.Match, names: dict) -> str:
    """What a block of Python or of the shell prints."""
    if block["language"] == "python":
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(compile(block["code"], "page", "exec"), names)
        return out.getvalue()
    return "".join(commanded(line) for line in block["code"].replace("\\\n", " ").splitlines())


def commanded(line: str) -> str:
    name, *arguments = shlex.split(line, comments=True) or [""]
    if name != "jaxrotor":  # what installs, or runs something else
        return ""
    target = Path(arguments.pop()) if ">" in arguments else None
    result = CliRunner().invoke(app, [one for one in arguments if one != ">"])
    assert result.exit_code == 0, (line, result.output, result.exception)
    if target is not None:
        target.write_text(result.stdout, "utf-8")
    return result.stdout


def check_printed(stated: str, found: str) -> None:
    """Lines of a page are those printed: words are the same, numbers to the last digit stated."""
    lines = iter([line.split() for line in found.splitlines() if line.strip()])
    for line in (line.split() for line in stated.splitlines() if line.strip()):
        if line != [".."]:
            assert any(same(line, other) for other in lines), (" ".join(line), found)


def same(stated: list[str], found: list[str]) -> bool:
    words = [[NUMBER.sub("#", word) for word in line] for line in (stated, found)]
    numbers = [NUMBER.findall(" ".join(line)) for line in (stated, found)]
    return words[0] == words[1] and all(
        abs(float(one) - float(other)) <= 2.0 * last_digit(one)
        for one, other in zip(*numbers, strict=True)
    )


def last_digit(number: str) -> float:
    """Value of the last digit of a number as it is written."""
    mantissa, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def in_tier(page):
    return pytest.param(page, marks=getattr(pytest.mark, TIERS.get(page, "slow")))


@pytest.mark.parametrize("page", [in_tier(page) for page in PAGES])
def test_code_of_a_page_runs(page, pytestconfig, monkeypatch):
    if page != "README.md":  # which prints what the command prints
        without_error_lanes(monkeypatch)
    names, last, anew = {"__name__": "page"}, None, pytestconfig.getoption("pictures")
    coarser = COARSER if page == GALLERY and not anew else ()
    text = (ROOT / page).read_text("utf-8")
    assert all(text.count(one) == 1 for one, _ in coarser)
    for one, other in coarser:
        text = text.replace(one, other)
    for block in BLOCK.finditer(text):
        if block["left"]:
            last = None
        elif block["title"]:
            Path(block["title"]).write_text(block["code"], "utf-8")
        elif block["language"] in ("python", "sh"):
            last = printed(block, names)
            if block["picture"]:
                place = (ROOT / page).parent / block["picture"]
                draw(place if anew else io.BytesIO(), block["code"], 110 if anew else 30)
        elif block["language"] == "text" and last is not None:
            check_printed(block["code"], last)


def draw(file, code: str, dpi: int) -> None:
    """Write the one figure that a block has drawn, with its code, and close it."""
    (number,) = plt.get_fignums()
    plt.figure(number).savefig(file, format="png", dpi=dpi, metadata={CODE: code})
    plt.close(number)


PICTURES = [
    (page, block["picture"], block["code"])
    for page in PAGES
    for block in blocks(page)
    if block["picture"] and not block["left"]
]


@pytest.mark.parametrize(("page", "picture", "code"), PICTURES, ids=[one[1] for one in PICTURES])
def test_a_picture_is_drawn_by_its_code(page, picture, code):
    """`pytest -m slow tests/test_docs.py --pictures` draws it."""
    with Image.open((ROOT / page).parent / picture) as drawn:
        assert drawn.text[CODE] == code


def test_every_plot_has_a_picture_in_the_gallery():
    returned = {name: inspect.signature(getattr(plots, name)).return_annotation for name in NAMES}
    drawing = {name for name, result in returned.items() if "Axes" in str(result)}
    shown = {Path(picture).stem: code for page, picture, code in PICTURES if page == GALLERY}
    assert set(shown) == drawing
    for name, code in shown.items():
        assert f"plot.{name}(" in code


@pytest.mark.parametrize("page", PAGES)
def test_code_of_a_page_is_narrow(page):
    """Beside the navigation of the site, 1280 pixels have ninety columns; longer lines wrap."""
    for block in blocks(page):
        wide = [
            line
            for line in block["code"].splitlines()
            if len(line) > 90 and "pip install" not in line
        ]
        assert not wide, wide


def test_statements_are_compared():
    check_printed("a 1.23 mm\n..\nc 2e-05", "a   1.234 mm\nb 5\nc 2.04e-05")
    for wrong in ("a 1.26 mm", "a 1.23 m", "c 2e-05\na 1.23 mm"):
        with pytest.raises(AssertionError):
            check_printed(wrong, "a   1.234 mm\nb 5\nc 2.04e-05")


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 150
