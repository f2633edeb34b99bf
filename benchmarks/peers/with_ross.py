"""Answers of ROSS, run in an environment of its own: `python -m peers.with_ross` in `benchmarks`.

A new rotor is built for every request, because ROSS remembers the modes of a rotor by speed.
"""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from .turbomachines import ELEMENT, MACHINES, Machine, serve, spread


warnings.simplefilter("ignore")
import ross  # noqa: E402
from scipy.optimize import brentq  # noqa: E402


FREQUENCIES = 8  # branches of a Campbell diagram; some are torsional
SCAN = 40  # speeds at which the threshold is bracketed


def rotor(numbers: dict, cut: int = 1, seal: tuple[float, float] | None = None, damped=True):
    """The rotor of ROSS with elements of `ELEMENT / cut`.

    Args:
        numbers: see `with_jaxrotor.numbers`.
        cut: how many elements take the place of one of the default length.
        seal: its station [m] and damping [N s/m].
        damped: whether the bearings keep their damping and the antisymmetric part of their stiffness,
            which `jaxrotor.critical_speeds` leaves out.
    """
    length = ELEMENT / cut
    count = round(numbers["length"] / length)
    young, density, shear = numbers["material"]
    material = ross.Material("of_the_shaft", rho=density, E=young, G_s=shear)
    shaft = []
    for k in range(count):
        widths = [width for at, width in numbers["sections"] if at <= (k + 0.5) * length]
        shaft.append(ross.ShaftElement(L=length, idl=0, odl=widths[-1], material=material, n=k))
    node = lambda at: round(at / length)
    discs = [
        ross.DiskElement(n=node(at), m=mass, Id=diametral, Ip=polar)
        for at, mass, diametral, polar in numbers["discs"]
    ]
    bearings = []
    for at, coefficients in numbers["bearings"]:
        own = {"cxx": 0.0, "cyy": 0.0} | coefficients
        if not damped:
            shared = (own.get("kxy", 0.0) + own.get("kyx", 0.0)) / 2
            own = {"kxx": own["kxx"], "kyy": own["kyy"], "kxy": shared, "kyx": shared, "cxx": 0.0}
        bearings.append(ross.BearingElement(n=node(at), **own))
    if seal is not None:
        at, damping = seal
        speeds = np.array([0.0, 1e4])  # the stiffness across is linear in the speed
        across, same = damping * speeds / 2, np.full(2, damping)
        zero = np.zeros(2)
        bearings.append(
            ross.BearingElement(
                n=node(at), kxx=zero, kyy=zero, kxy=across, kyx=-across, cxx=same, cyy=same,
                frequency=speeds,
            )
        )  # fmt: skip
    return ross.Rotor(shaft, discs, bearings)


def answer(asked: dict) -> Callable[[], Any]:
    """The call that answers a request."""
    numbers, cut, question = asked["rotor"], asked.get("cut", 1), asked["question"]
    machine = MACHINES[asked["machine"]]
    if question == "threshold":
        sealed = rotor(numbers, cut, (machine.disc, machine.seal))
        return lambda: threshold(sealed, machine)
    built = rotor(numbers, cut, damped=question != "critical speeds")
    if question == "Campbell diagram":
        speeds = np.array(spread(machine.highest, asked["speeds"]))
        return lambda: branches(built.run_campbell(speeds, frequencies=FREQUENCIES))
    if question == "critical speeds":
        rtol = asked.get("rtol", 0.005)
        return lambda: built.run_critical_speed(rtol=rtol).wn()
    if question == "response":
        speeds = np.array(spread(machine.highest, asked["response_speeds"]))
        ((at, moment),) = numbers["unbalances"]
        node = round(at * cut / ELEMENT)
        run = built.run_unbalance_response
        return lambda: ellipses(run(node, moment, 0.0, speeds).forced_resp, node)
    if question == "motion":
        times = np.linspace(0.0, asked["seconds"], asked["samples"])
        return lambda: orbit(built, machine, numbers, times)
    return lambda: built.run_modal(machine.speed).evalues


def orbit(built: Any, machine: Machine, numbers: dict, times: np.ndarray) -> np.ndarray:
    """Displacement x + i y [m] of the disc from rest, under the unbalance at constant speed."""
    ((at, moment),) = numbers["unbalances"]
    count, node = built.number_dof, round(at / ELEMENT)
    force = np.zeros((times.size, built.ndof))
    turned = moment * machine.speed**2 * np.exp(1j * machine.speed * times)
    force[:, count * node], force[:, count * node + 1] = turned.real, turned.imag
    x, y = built.run_time_response(machine.speed, force, times).yout[:, count * node :][:, :2].T
    return x + 1j * y


def branches(diagram: Any) -> np.ndarray:
    """Roots [rad/s] of a Campbell diagram of ROSS, which has frequencies and damping ratios."""
    ratio = diagram.damping_ratio
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nan_to_num(diagram.wd * (1j - ratio / np.sqrt(1 - ratio**2)))


def ellipses(amplitudes: np.ndarray, node: int) -> np.ndarray:
    """Forward and backward radius [m] of the orbit at a node, which has six coordinates."""
    x, y = amplitudes[6 * node : 6 * node + 2]
    return np.stack([np.abs(x + 1j * y), np.abs(x - 1j * y)], axis=1) / 2


def threshold(sealed: Any, machine: Machine) -> float:
    """Speed where the largest growth rate of lateral motion crosses zero, bracketed by a scan.

    Axial and torsional motions have no damping here, so their growth rates are rounding errors.
    """

    def growth(speed: float) -> float:
        modal = sealed.run_modal(speed)
        parts = np.abs(modal.evectors[: sealed.ndof].reshape(-1, 6, modal.evalues.size)) ** 2
        along = parts[:, (2, 5)].sum((0, 1)) > parts[:, (0, 1, 3, 4)].sum((0, 1))
        return float(modal.evalues.real[~along].max())

    low = 0.0
    for high in np.linspace(0.0, machine.unstable, SCAN)[1:]:
        if growth(high) > 0:
            return brentq(growth, low, high, xtol=1e-9)
        low = high
    return float("nan")


def plain(found: Any) -> list:
    """Real and imaginary parts of roots, else the numbers themselves, as lists."""
    found = np.asarray(found)
    return (np.stack([found.real, found.imag], -1) if np.iscomplexobj(found) else found).tolist()


if __name__ == "__main__":
    serve(answer, plain)
