"""Machines and questions that jaxrotor and ROSS are compared on, as numbers that both programs take.

Only the standard library is imported here, because the program in the peer's environment reads it, too.
"""

import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple


PEERS = Path(__file__).parent
QUESTIONS = ("Campbell diagram", "critical speeds", "response", "threshold", "modes")
ELEMENT = 0.05  # length of an element of ROSS [m]


class Machine(NamedTuple):
    """A rotor, the speeds that are asked for, and a seal that destabilizes it.

    The seal acts for the threshold alone. It is a damper whose fluid turns at half the speed of
    rotation: `F = -c (z. - i Omega z / 2)` with `z = x + i y`.
    """

    scene: str  # file, or name of a scene that jaxrotor ships
    highest: float  # speed up to which Campbell diagram and response go [rad/s]
    speed: float  # of the modes [rad/s]
    seal: float  # damping c of the seal [N s/m]; 0: none
    unstable: float  # speed up to which the threshold is looked for [rad/s]
    disc: float  # station of disc, unbalance and seal [m]
    nodes: int | None  # of every span of jaxrotor's shaft; None: those of the scene
    element: float = ELEMENT  # length of an element of ROSS [m]


MACHINES = {
    "overhung disc": Machine(str(PEERS / "overhung.toml"), 600.0, 300.0, 600.0, 1000.0, 1.15, 6),
    "overhung-fan": Machine("overhung-fan", 600.0, 157.0, 6e4, 2000.0, 1.3, 5),
}


def machine_of(asked: Mapping[str, Any]) -> Machine:
    """The machine that a request names, or has as a list."""
    which = asked["machine"]
    return MACHINES[which] if isinstance(which, str) else Machine(*which)


def request(
    which: str | Machine, question: str, *, speeds: int = 61, rotor: dict | None = None, **how: Any
) -> dict:
    """A question as a table that both programs read.

    Args:
        which: the machine, or the name of one.
        question: one of `QUESTIONS`, or "numbers", "roots", "growth rate", "show".
        speeds: how many speeds a Campbell diagram has.
        rotor: numbers of the rotor, see `with_jaxrotor.numbers`, where ROSS is asked.
        how: `response_speeds`, how many the response has; `nodes` of a span of jaxrotor's shaft;
            `cut`, how many elements of ROSS take the place of one; `rtol` of ROSS's critical speeds;
            `count` of jaxrotor's critical speeds of each kind; `most`, how many eigenvalues ROSS has;
            `near`, speeds from which ROSS takes one step to a critical speed or a threshold.
    """
    return {"machine": which, "question": question, "speeds": speeds, "rotor": rotor, **how}


def spread(highest: float, count: int) -> list[float]:
    """Equally spaced speeds [rad/s] up to the highest; the first is a hundredth of it."""
    first = highest / 100
    return [first + (highest - first) * k / (count - 1) for k in range(count)]


def serve(
    answer: Callable[[dict], Callable[[], Any]],
    plain: Callable[[Any], Any],
    beside: Callable[[], dict] = dict,
) -> None:
    """Answer requests, one a line of the standard input, with the seconds that each call took.

    `seconds` are those of a clock, `processor` those that all threads of the program computed.

    Args:
        answer: prepares a request: the rotor is built there, and the call that is timed is returned.
        plain: what that call returns, as lists of numbers.
        beside: what else a reply says.
    """
    out, sys.stdout = sys.stdout, sys.stderr  # what the programs print beside is no answer
    for line in sys.stdin:
        asked: Mapping[str, Any] = json.loads(line)
        call = answer(dict(asked))
        began, busy = time.perf_counter(), time.process_time()
        found = call()
        spent = {"seconds": time.perf_counter() - began, "processor": time.process_time() - busy}
        print(json.dumps(spent | beside() | {"answer": plain(found)}), file=out, flush=True)
