"""RotorBench: its references are met by jaxrotor, and by finite elements of SciPy alone."""

import importlib
from pathlib import Path

import numpy as np
import pytest


BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
CHEAP = ("pinned beam", "full rub of a Jeffcott rotor")


@pytest.fixture(scope="module")
def bench():
    """Imports a module of the benchmark."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        yield lambda name: importlib.import_module(f"rotorbench.{name}")


def names():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        return [case.name for case in importlib.import_module("rotorbench.cases").cases()]


NAMES = names()


def test_every_case_has_a_machine_a_source_and_reference_numbers(bench):
    cases = bench("cases")
    known = cases.references()
    assert len(NAMES) == len(set(NAMES)) >= 30 and set(known) == set(NAMES)
    for case in cases.cases():
        assert bench("machines").Machine(case.machine).scene["title"]
        assert len(case.source) > 10 and np.isfinite(known[case.name]).all()
        for beside in (case.beside, case.jaxrotor, case.scipy):
            assert np.isfinite(beside).all()


def off(bench, name):
    """Error of jaxrotor's finest setting."""
    cases = bench("cases")
    (case,) = (one for one in cases.cases() if one.name == name)
    call = bench("by_jaxrotor").answered({"case": name, "setting": case.jaxrotor[-1]})
    return cases.error(case, [call()], cases.references()[name])


@pytest.mark.parametrize("name", CHEAP)
def test_jaxrotor_meets_cheap_references(bench, name):
    assert off(bench, name) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name not in CHEAP])
def test_jaxrotor_meets_references(bench, name):
    assert off(bench, name) < 1e-6


@pytest.mark.parametrize("name", ["two discs, unequal bearings", "rotor on a housing"])
def test_finite_elements_tend_to_references(bench, name):
    """Two meshes of SciPy's elements, extrapolated, are off by a tenth of what the finer one is."""
    cases = bench("cases")
    (case,) = (one for one in cases.cases() if one.name == name)
    answers = bench("by_scipy").answered({"case": name, "setting": [2, 4]})()
    exact = cases.references()[name]
    apart = cases.error(case, answers[1:], exact)
    assert apart < 1e-4 and cases.error(case, answers, exact) < apart / 10


@pytest.mark.slow
def test_references_are_what_transfer_matrices_give(bench):
    """In many digits, from other guesses than those that were stored."""
    pytest.importorskip("mpmath", reason="`pip install -e '.[benchmarks]'` has it")
    found = bench("references")
    known = found.references()
    (case,) = (one for one in found.cases() if one.name == "overhung disc, damped bearing")
    np.testing.assert_allclose(found.roots(case), known[case.name], rtol=1e-13)
