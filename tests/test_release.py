"""What a release says of itself agrees: version, requirements and Pythons in all their places."""

import importlib.metadata
import re
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet


ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
CONDA = {"lazy-loader": "lazy_loader", "matplotlib": "matplotlib-base"}  # names that differ there


def parsed(path: str) -> dict:
    return yaml.safe_load((ROOT / path).read_text("utf-8"))


def test_the_version_is_one():
    version = PROJECT["version"]
    assert parsed("CITATION.cff")["version"] == version
    assert parsed("conda/recipe.yaml")["context"]["version"] == version
    latest = re.search(r"^## (\S+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M)
    assert latest is not None and latest[1] == version
    assert importlib.metadata.version("jaxrotor") == version


def test_the_recipe_requires_what_the_package_does():
    wanted = {}
    for text in PROJECT["dependencies"]:
        one = Requirement(text)
        wanted[CONDA.get(one.name, one.name)] = one.specifier
    rows = parsed("conda/recipe.yaml")["requirements"]["run"]
    found = dict(row.split(maxsplit=1) for row in rows)
    python = found.pop("python")
    assert {name: SpecifierSet(versions) for name, versions in found.items()} == wanted
    least = parsed("conda/recipe.yaml")["context"]["python_min"]
    assert python == ">=${{ python_min }}" and PROJECT["requires-python"] == f">={least}"


def test_the_pythons_named_are_allowed():
    named = re.findall(r":: Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    assert named and all(one in SpecifierSet(PROJECT["requires-python"]) for one in named)


@pytest.mark.parametrize("name", ["bug", "proposal"])
def test_an_issue_form_has_what_it_needs(name):
    """Forms have a name, a description and fields, of which each has its own id and a label."""
    form = parsed(f".github/ISSUE_TEMPLATE/{name}.yml")
    assert form["name"] and form["description"]
    ids = [field["id"] for field in form["body"]]
    assert len(set(ids)) == len(ids) > 1
    assert all(
        field["type"] == "textarea" and field["attributes"]["label"] for field in form["body"]
    )
