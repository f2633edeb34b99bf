"""Answers of ROSS, run in an environment of its own: `python -m peers.with_ross` in `benchmarks`.

A new rotor is built for every request, because ROSS remembers the modes of a rotor by speed.
"""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from .turbomachines import Machine, machine_of, serve, spread


warnings.simplefilter("ignore")
import ross  # noqa: E402
from scipy.optimize import brentq  # noqa: E402


FREQUENCIES = 8  # branches of a Campbell diagram; some are torsional
SCAN = 40  # speeds at which the threshold is bracketed


def rotor(
    numbers: dict, longest: float, seal: tuple[float, float] | None = None, damped: bool = True
) -> Any:
    """The rotor of ROSS.

    Args:
        numbers: see `with_jaxrotor.numbers`.
        longest: length of its elements [m].
        seal: its station [m] and damping [N s/m].
        damped: whether the bearings keep their damping and the antisymmetric part of their stiffness,
            which `jaxrotor.critical_speeds` leaves out.
    """
    count = round(numbers["length"] / longest)
    length = numbers["length"] / count
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
        own = {key: np.asarray(value) for key, value in coefficients.items()}
        over = {"frequency": own.pop("speeds")} if "speeds" in own else {}
        zero = 0 * own["kxx"]
        own = {"kyy": own["kxx"], "cxx": zero, "cyy": own.get("cxx", zero)} | own
        if not damped:
            shared = (own.get("kxy", zero) + own.get("kyx", zero)) / 2
            own = {"kxx": own["kxx"], "kyy": own["kyy"], "kxy": shared, "kyx": shared, "cxx": zero}
        bearings.append(ross.BearingElement(n=node(at), **own, **over))
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
    numbers, machine, question = asked["rotor"], machine_of(asked), asked["question"]
    element = machine.element / asked.get("cut", 1)
    if question == "threshold":
        seal = (machine.disc, machine.seal) if machine.seal else None
        sealed = rotor(numbers, element, seal)
        if "near" in asked:
            return lambda: refined(lambda speed: growth(sealed, speed), *asked["near"])
        return lambda: threshold(sealed, machine)
    built = rotor(numbers, element, damped=question != "critical speeds")
    most = asked.get("most", 12)
    if question == "Campbell diagram":
        speeds = np.array(spread(machine.highest, asked["speeds"]))
        return lambda: branches(built.run_campbell(speeds, frequencies=FREQUENCIES))
    if question == "critical speeds":
        rtol = asked.get("rtol", 0.005)
        if "near" in asked:
            apart = lambda speed: built.run_modal(speed, num_modes=most).wn - speed
            nearest = lambda speed: min(apart(speed), key=abs)
            return lambda: [refined(nearest, near) for near in asked["near"]]
        return lambda: built.run_critical_speed(num_modes=most, rtol=rtol).wn()
    if question == "response":
        speeds = np.array(spread(machine.highest, asked["response_speeds"]))
        ((at, moment),) = numbers["unbalances"]
        node = round(at / element)
        run = built.run_unbalance_response
        return lambda: ellipses(run(node, moment, 0.0, speeds).forced_resp, node)
    if question == "motion":
        times = np.linspace(0.0, asked["seconds"], asked["samples"])
        return lambda: orbit(built, machine, numbers, times)
    if question == "growth rate":
        return lambda: growth(built, machine.speed)
    return lambda: built.run_modal(machine.speed, num_modes=most).evalues


def orbit(built: Any, machine: Machine, numbers: dict, times: np.ndarray) -> np.ndarray:
    """Displacement x + i y [m] of the disc from rest, under the unbalance at constant speed."""
    ((at, moment),) = numbers["unbalances"]
    count, node = built.number_dof, round(at / machine.element)
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


def growth(built: Any, speed: float) -> float:
    """Largest growth rate [1/s] of lateral motion.

    Axial and torsional motions have no damping here, so their growth rates are rounding errors.
    """
    modal = built.run_modal(speed)
    parts = np.abs(modal.evectors[: built.ndof].reshape(-1, 6, modal.evalues.size)) ** 2
    along = parts[:, (2, 5)].sum((0, 1)) > parts[:, (0, 1, 3, 4)].sum((0, 1))
    return float(modal.evalues.real[~along].max())


def refined(function: Callable[[float], float], near: float) -> float:
    """Zero of a function by one step of the secant method from a place near it."""
    other = near * (1 + 1e-4)
    here, there = function(near), function(other)
    return near - here * (other - near) / (there - here)


def threshold(sealed: Any, machine: Machine) -> float:
    """Speed where the largest growth rate crosses zero, bracketed by a scan."""
    low, own = 0.0, lambda speed: growth(sealed, speed)
    for high in np.linspace(0.0, machine.unstable, SCAN)[1:]:
        if own(high) > 0:
            return brentq(own, low, high, xtol=1e-9)
        low = high
    return float("nan")


def plain(found: Any) -> list:
    """Real and imaginary parts of roots, else the numbers themselves, as lists."""
    found = np.asarray(found)
    return (np.stack([found.real, found.imag], -1) if np.iscomplexobj(found) else found).tolist()


if __name__ == "__main__":
    serve(answer, plain)
