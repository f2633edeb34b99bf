"""What a release says of itself agrees: version, requirements and Pythons in all their places."""

import importlib.metadata
import re
import shutil
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


@pytest.mark.parametrize("repository", [None, "https://example.org/rotors/jaxrotor"])
def test_the_long_description_needs_no_checkout(tmp_path, repository):
    """In the metadata of a build, every link is to an address, and leads where the README's does."""
    pytest.importorskip("hatchling", reason="needs jaxrotor[test]")
    from hatchling.metadata.core import ProjectMetadata
    from hatchling.plugin.manager import PluginManager

    for name in ("pyproject.toml", "README.md", "LICENSE", "hatch_build.py"):
        shutil.copy(ROOT / name, tmp_path)
    (tmp_path / "jaxrotor").mkdir()
    if repository is not None:
        text = (tmp_path / "pyproject.toml").read_text("utf-8")
        named = f'[project.urls]\nRepository = "{repository}/"\n\n[project.scripts]'
        (tmp_path / "pyproject.toml").write_text(text.replace("[project.scripts]", named), "utf-8")
    core = ProjectMetadata(str(tmp_path), PluginManager()).core
    found = re.findall(r"(!?)\[[^]]*\]\(([^)]*)\)", core.readme)
    own = re.findall(r"(!?)\[[^]]*\]\(([^)]*)\)", (ROOT / "README.md").read_text("utf-8"))
    assert core.readme_content_type == "text/markdown" and len(own) > 20
    want = []
    for mark, path in own:
        if path.startswith("https://"):
            want.append((mark, path))
        elif repository is not None:
            want.append((mark, f"{repository}/{'raw' if mark else 'blob'}/HEAD/{path}"))
            assert (ROOT / path).exists(), path
    assert found == want
    assert "<!--" not in core.readme and "pip install jaxrotor &&" in core.readme


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
