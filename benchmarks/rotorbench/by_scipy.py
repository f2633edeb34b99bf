"""Answers of SciPy and NumPy alone: `python -m rotorbench.by_scipy` in `benchmarks`."""

from collections.abc import Callable
from typing import Any

from peers.turbomachines import serve

from .cases import cases, plain
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


if __name__ == "__main__":
    serve(answered, lambda found: [plain(one) for one in found])
