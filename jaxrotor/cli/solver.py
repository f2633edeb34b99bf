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
    Kvaerno3 = "kvaerno3"
    Kvaerno4 = "kvaerno4"
    Kvaerno5 = "kvaerno5"
    KenCarp3 = "kencarp3"
    KenCarp4 = "kencarp4"
    KenCarp5 = "kencarp5"
    Tsit5 = "tsit5"
    Dopri5 = "dopri5"
    Dopri8 = "dopri8"


def chosen(name: Solver | None) -> Exponential | dfx.AbstractSolver | None:
    """The solver of a name; None, the default, if there is none."""
    match name:
        case None:
            return None
        case Solver.exponential2:
            return Exponential(2)
        case Solver.exponential4 | Solver.exponential4_located:
            return Exponential(4, located=name is Solver.exponential4_located)
        case _:
            return getattr(dfx, name.name)()
