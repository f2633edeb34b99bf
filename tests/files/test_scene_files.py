"""The page of scene files is up to date with the classes, and its examples are valid scenes."""

import importlib
import re
import tomllib
from pathlib import Path

import pytest

from jaxrotor.files.toml import loads
from jaxrotor.files.toml_reader import read
from jaxrotor.files.vocabulary import FORMS, exported


DOCS = Path(__file__).parents[2] / "docs"
BASE = {
    "shaft": '[shaft]\nlength = "1.2 m"\ndiameter = "40 mm"\n',
    "spin": '[spin]\nspeed = "1500 rpm"\n',
    "sweep": '[unbalance]\nat = "0.4 m"\nmoment = 1e-4\n',
}


@pytest.fixture(scope="module")
def script():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS))
        yield importlib.import_module("scene_files")


def test_page_is_up_to_date(script):
    """`python docs/scene_files.py` writes the page."""
    assert (DOCS / "scene-files.md").read_text("utf-8") == script.page()


def test_every_example_is_a_scene(script):
    for name, texts in script.EXAMPLES.items():
        for text in texts:
            own = tomllib.loads(text)
            given = {*own, "sweep", *(["shaft"] if "shafts" in own else [])}
            base = [part for key, part in BASE.items() if key not in given]
            if name in ("step", "constraint", "material"):  # a table inside that of the shaft
                base = [BASE["shaft"], text, BASE["spin"]]
            elif name == "sweep":
                base = [*BASE.values(), text]
            else:
                base.append(text)
            scene, study = read("\n".join(base), name)
            assert scene.effects or own.keys() & {"shaft", "spin", "machine"}
            assert bool(study) == (name == "sweep")


def test_every_part_has_examples_of_all_its_keys(script):
    """The script raises for a new effect or key without an example."""
    assert set(exported()) | {form.noun for form in FORMS} < set(script.EXAMPLES)
    with pytest.raises(KeyError, match="Give 'magnet' examples with every key"):
        script.examples("magnet")
    with pytest.raises(KeyError, match="Give `colour` of 'disc' an example"):
        script.example_of("disc", "colour")


def test_every_default_has_a_reason(script):
    """A default that is taken without being drawn says in the page why it is neutral, or is asked for."""
    rows = re.findall(r"^\| `(.+?)` \| .+? \| (.+?) \| `", script.page(), re.MULTILINE)
    assert len(rows) > 100
    bare = {"needed", "absent", "that of a constant spin"}
    unexplained = {
        key: default for key, default in rows if default not in bare and ": " not in default
    }
    assert not unexplained, "Give these a reason in WHY of docs/scene_defaults.py, or ask for them."
    own = {key for key, _ in rows}
    assert {name.rpartition(".")[2] for name in script.WHY} <= own


def test_examples_of_one_bearing_are_the_same_bearing(script):
    base = "\n".join([BASE["shaft"], BASE["spin"]])
    first, second, *_ = (loads(f"{base}\n{text}") for text in script.EXAMPLES["support"])
    for name in ("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy"):
        assert first.get(f"support.{name}") == second.get(f"support.{name}")
