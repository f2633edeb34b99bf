"""Answers of SciPy and NumPy alone: `python -m rotorbench.by_scipy` in `benchmarks`."""

from collections.abc import Callable
from typing import Any

import numpy as np

from peers.turbomachines import serve

from .cases import cases
from .finite_elements import answered as by_elements
from .machines import Machine
from .nonlinear import answered as nonlinear


CASES = {case.name: case for case in cases()}


def answered(asked: dict[str, Any]) -> Callable[[], Any]:
    """The call that answers a case, a linear one on one mesh or on two."""
    case, setting = CASES[asked["case"]], asked["setting"]
    machine = Machine(case.machine)
    call = nonlinear(machine, case.question, case.ask, setting)
    if call is not None:
        return call if isinstance(setting, list) else lambda: [call()]
    calls = [by_elements(machine, case.ask, case.question, cut) for cut in setting]
    return lambda: [call() for call in calls]


def plain(found: list[Any]) -> list[Any]:
    """Answers as lists that JSON takes; complex numbers as tables."""
    return [_numbers(np.asarray(one)) for one in found]


def _numbers(found: np.ndarray) -> list[Any]:
    if np.iscomplexobj(found):
        return [{"re": z.real, "im": z.imag} for z in found.tolist()]
    return found.tolist()


if __name__ == "__main__":
    serve(answered, plain)
