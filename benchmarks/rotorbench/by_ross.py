"""Answers of ROSS, run in an environment of its own: `python -m rotorbench.by_ross` in `benchmarks`.

A new rotor is built for every request, because ROSS remembers the modes of a rotor by speed; building it
is not timed, though it assembles the matrices.
"""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from peers.turbomachines import serve
from peers.with_ross import branches, ellipses

from .cases import cases, plain, speeds_of, values_of
from .machines import Machine
from .searches import peak, threshold


warnings.simplefilter("ignore")
import ross  # noqa: E402


CASES = {case.name: case for case in cases()}


class Built:
    """A rotor of ROSS.

    Args:
        machine: the rotor.
        cut: how many elements take the place of one of the coarsest mesh.
        damped: whether bearings keep their damping.
    """

    def __init__(self, machine: Machine, cut: int, damped: bool = True):
        young, density, shear = machine.material
        sheared = bool(np.isfinite(shear))
        made = machine.shaft["material"]["shear_modulus"]
        material = ross.Material("of_the_shaft", rho=density, E=young, G_s=made)
        mesh = machine.elements(cut)
        shaft = [
            ross.ShaftElement(
                L=one.stop - one.start,
                idl=one.inner,
                odl=one.diameter,
                material=material,
                n=k,
                shear_effects=sheared,
            )
            for k, one in enumerate(mesh)
        ]
        self.nodes = np.array([0.0, *(one.stop for one in mesh)])
        discs = [
            ross.DiskElement(
                n=self.node(d["at"]),
                m=d["mass"],
                Id=d.get("diametral", 0.0),
                Ip=d.get("polar", 0.0),
            )
            for d in machine.parts("discs")
        ]
        self.machine, self.damped = machine, damped
        self.housings = {
            one["name"]: len(self.nodes) + k for k, one in enumerate(machine.parts("casings"))
        }
        masses = [
            ross.PointMass(n=self.housings[one["name"]], m=one["mass"])
            for one in machine.parts("casings")
        ]
        self.rotor = ross.Rotor(shaft, discs, self.bearings(), masses or None)

    def node(self, at: float) -> int:
        return int(np.argmin(np.abs(self.nodes - at)))

    def bearings(self) -> list[Any]:
        found = []
        for one in self.machine.parts("supports"):
            if "speeds" in one:
                speeds = np.array(one["speeds"])
                tabled = {key: np.array(one[key]) for key in ("kxx", "kyy")}
                zero = np.zeros(speeds.size)
                found.append(
                    ross.BearingElement(
                        n=self.node(one["at"]), cxx=zero, cyy=zero, frequency=speeds, **tabled
                    )
                )
                continue
            if one.get("rotating"):
                found.append(self.turning(one))
                continue
            keys = [k for k in one if k[0] in "kc" and len(k) == 3]
            own = {"cxx": 0.0, "cyy": 0.0} | {key: one[key] for key in keys}
            if not self.damped:
                own = {key: value for key, value in own.items() if key[0] == "k"} | {"cxx": 0.0}
            if "of" in one:
                found.append(ross.BearingElement(n=self.housings[one["of"]], **own))
            elif "on" in one:
                link = self.housings[one["on"]]
                found.append(ross.BearingElement(n=self.node(one["at"]), n_link=link, **own))
            else:
                found.append(ross.BearingElement(n=self.node(one["at"]), **own))
        return found

    def turning(self, one: dict[str, Any]) -> Any:
        """A damper that turns with the shaft: its stiffness across is linear in the speed."""
        speeds = np.array([0.0, 1e4])
        across, same, zero = one["cxx"] * speeds, np.full(2, one["cxx"]), np.zeros(2)
        return ross.BearingElement(
            n=self.node(one["at"]), kxx=zero, kyy=zero, kxy=across, kyx=-across, cxx=same, cyy=same,
            frequency=speeds,
        )  # fmt: skip

    def lateral(self, speed: float, count: int) -> np.ndarray:
        """Roots of lateral motion; axial and torsional ones have no damping here."""
        modal = self.rotor.run_modal(speed, num_modes=count)
        parts = np.abs(modal.evectors[: self.rotor.ndof].reshape(-1, 6, modal.evalues.size)) ** 2
        along = parts[:, (2, 5)].sum((0, 1)) > parts[:, (0, 1, 3, 4)].sum((0, 1))
        return modal.evalues[~along]


def answered(asked: dict[str, Any]) -> Callable[[], Any]:
    """The call that answers a case on one mesh or on two."""
    calls = [_one(asked["case"], cut) for cut in asked["setting"]]
    return lambda: [call() for call in calls]


def _one(name: str, cut: int) -> Callable[[], Any]:
    case = CASES[name]
    ask, machine = case.ask, Machine(case.machine)
    if case.question == "static position":
        return lambda: position(machine)
    if case.question == "roots over a parameter":
        over, speed, count = ask["over"], machine.speed, ask["count"] + 6
        rotors = [Built(machine.varied(over, value), cut).rotor for value in values_of(ask)]
        return lambda: [rotor.run_modal(speed, num_modes=count).evalues for rotor in rotors]
    built = Built(machine, cut, damped=not case.question.startswith("critical speeds"))
    rotor = built.rotor
    if case.question == "roots":
        speed, count = ask.get("speed", machine.speed), ask["count"] + 6
        return lambda: rotor.run_modal(speed, num_modes=count).evalues
    if case.question == "Campbell diagram":
        count = ask["count"] + 4  # some are torsional
        return lambda: branches(rotor.run_campbell(speeds_of(ask), frequencies=count))
    if case.question == "critical speeds":
        count = 2 * ask["count"] + 2
        return lambda: rotor.run_critical_speed(num_modes=count, rtol=1e-4).wn()
    if case.question == "critical speeds over a parameter":  # of all bearings alike
        given = {"stiffness_range": ask["powers"], "num": ask["points"], "synchronous": True}
        return lambda: rotor.run_ucs(**given).wn.T
    if case.question == "threshold":
        return lambda: threshold(lambda speed: built.lateral(speed, 10), ask["within"])
    if case.question == "response":
        return lambda: radii(built, ask["at"], speeds_of(ask))
    if case.question == "peak":
        at_one = lambda speed: radii(built, ask["at"], np.array([speed]))
        return lambda: peak(at_one, ask["within"])
    return lambda: history(built, ask)


def radii(built: Built, at: float, speeds: np.ndarray) -> np.ndarray:
    """Forward and backward radius [m] of the response to the unbalance."""
    every = built.machine.parts("unbalances")
    nodes, moments = [built.node(one["at"]) for one in every], [one["moment"] for one in every]
    phases = [one.get("phase", 0.0) for one in every]
    found = built.rotor.run_unbalance_response(nodes, moments, phases, speeds)
    return ellipses(found.forced_resp, built.node(at))


def history(built: Built, ask: dict[str, Any]) -> np.ndarray:
    """Displacements x and y [m] at a station from rest; the force is linear between many times."""
    (one,) = built.machine.parts("unbalances")
    speed, wanted = built.machine.speed, np.array(ask["times"])
    parts = 64 * (len(built.nodes) // 16)
    times = np.linspace(0.0, wanted[-1], parts * (wanted.size - 1) + 1)
    force = np.zeros((times.size, built.rotor.ndof))
    turned = one["moment"] * speed**2 * np.exp(1j * speed * times)
    place = 6 * built.node(one["at"])
    force[:, place], force[:, place + 1] = turned.real, turned.imag
    found = built.rotor.run_time_response(speed, force, times).yout
    return found[::parts, 6 * built.node(ask["at"]) :][:, :2]


def position(machine: Machine) -> list[float]:
    """Eccentricity of a journal under its half of the weight, and the stiffness of its film [N/m]."""
    film = machine.parts("journal_bearings")[0]
    weight = machine.parts("discs")[0]["mass"] * machine.scene["gravity"]["acceleration"] / 2
    found = ross.CylindricalBearing(
        n=0,
        speed=np.array([machine.speed]),
        weight=weight,
        bearing_length=film["length"],
        journal_diameter=2 * film["radius"],
        radial_clearance=film["clearance"],
        oil_viscosity=film["viscosity"],
    )
    stiffness = (found.kxx, found.kxy, found.kyx, found.kyy)
    return [found.eccentricity[0], *(one[0] for one in stiffness)]


if __name__ == "__main__":
    serve(answered, lambda found: [plain(one) for one in found])
