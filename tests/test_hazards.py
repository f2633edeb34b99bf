"""Very many lanes at once: what `tests/hazards.py` runs neither hangs, crashes nor errs."""

import tomllib
from pathlib import Path

import hazards
import jax
import pytest
from packaging.requirements import Requirement


PROJECT = Path(__file__).parents[1] / "pyproject.toml"
QUICK = list(hazards.PLAIN)
LONG = "sweep", "tables"  # minutes each


def allowed():
    """Versions of jax that the package may be installed with."""
    needs = map(Requirement, tomllib.loads(PROJECT.read_text())["project"]["dependencies"])
    return next(need.specifier for need in needs if need.name == "jax")


@pytest.mark.parametrize("version", ["0.10.0", "0.10.1", "0.10.2", "0.11.0", "0.11.1", "0.11.2"])
def test_versions_with_a_known_defect_are_not_installed(version):
    assert version not in allowed()


def test_this_jax_is_one_of_those_allowed():
    assert jax.__version__ in allowed()
    assert "0.7.2" in allowed()


@pytest.fixture(scope="module")
def found(request):
    """What became of the programs that the tests of this session look at, all run by one process.

    It has one processor: a pool of one thread hangs wherever a larger one may.
    """
    own = [item for item in request.session.items if item.module is request.module]
    chosen = [item.callspec.params["name"] for item in own if "found" in item.fixturenames]
    return hazards.outcomes(chosen, one_processor=True)


@pytest.mark.parametrize("name", QUICK)
def test_many_lanes_at_once(found, name):
    assert found[name] == ""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.long if name in LONG else pytest.mark.slow)
        for name in hazards.PROGRAMS
        if name not in QUICK
    ],
)
def test_very_many_lanes_equal_chunks_of_few(found, name):
    assert found[name] == ""


@pytest.mark.slow
def test_a_program_that_hangs_or_crashes_is_told_from_those_beside_it():
    told = hazards.outcomes(["fused", "sleep", "leave"], limit=5)
    assert told["sleep"].startswith("hung: no answer within 5 s")
    assert told["fused"] == "" and told["leave"].startswith("crashed: exit status 3")
