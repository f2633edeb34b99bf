"""Solvers by the names that `--solver` takes."""

import enum

import diffrax as dfx

from ..solvers import Exponential


NAMED = "Exponential of order 2 or 4, or a diffrax solver."  # help of the option


class Solver(enum.StrEnum):
    """Names of solvers: those of this package, and those of diffrax in lower case."""

    exponential2 = "exponential2"
    exponential4 = "exponential4"
    exponential4_located = "exponential4-located"
    kvaerno3 = "kvaerno3"
    kvaerno4 = "kvaerno4"
    kvaerno5 = "kvaerno5"
    kencarp3 = "kencarp3"
    kencarp4 = "kencarp4"
    kencarp5 = "kencarp5"
    tsit5 = "tsit5"
    dopri5 = "dopri5"
    dopri8 = "dopri8"


_SOLVERS = {
    Solver.exponential2: lambda: Exponential(2),
    Solver.exponential4: lambda: Exponential(4),
    Solver.exponential4_located: lambda: Exponential(4, located=True),
    Solver.kvaerno3: dfx.Kvaerno3,
    Solver.kvaerno4: dfx.Kvaerno4,
    Solver.kvaerno5: dfx.Kvaerno5,
    Solver.kencarp3: dfx.KenCarp3,
    Solver.kencarp4: dfx.KenCarp4,
    Solver.kencarp5: dfx.KenCarp5,
    Solver.tsit5: dfx.Tsit5,
    Solver.dopri5: dfx.Dopri5,
    Solver.dopri8: dfx.Dopri8,
}


def chosen(name: Solver | None) -> Exponential | dfx.AbstractSolver | None:
    """The solver of a name; None, the default, if there is none."""
    return None if name is None else _SOLVERS[name]()
