"""Reference numbers of all cases, without jaxrotor: `python -m rotorbench.references` in `benchmarks`.

It writes `references.toml` and needs mpmath. `--only PATTERN` computes some anew and keeps the others.
Linear cases come from transfer matrices and closed forms in 30 digits (`exact.py`), started from
finite elements.
"""

import argparse
import contextlib
import re
from collections.abc import Callable
from typing import Any

import numpy as np
from mpmath import mp

from .cases import FOLDER, Case, cases, references, speeds_of, values_of
from .exact import Rotor, number, zero_near, zero_of_two
from .finite_elements import Model, answered
from .machines import Machine
from .nonlinear_references import NONLINEAR


FINE = 16  # elements of the meshes from which exact roots are sought, over the coarsest
MODES = 32  # roots of which a history is made up
BESIDE = 3e-6  # how well numbers of another code are met, which has finite elements


def roots(case: Case) -> np.ndarray:
    """Roots [1/s], imaginary parts made positive."""
    machine = Machine(case.machine)
    if case.name in CLOSED:
        return CLOSED[case.name](machine, case.ask["count"])
    speed = case.ask.get("speed", machine.speed)
    rotor = Rotor(machine)
    near = answered(machine, case.ask, "roots", FINE)()[: case.ask["count"]]
    found = [root_near(rotor, speed, guess) for guess in near]
    return np.array([complex(mp.re(one), abs(mp.im(one))) for one in found])


def root_near(rotor: Rotor, speed: float, guess: complex) -> Any:
    """A root; where planes are apart it may be one of p = x + i y or its conjugate."""
    determinant = lambda root: rotor.determinant(root, number(speed))
    starts = (guess, guess.conjugate()) if rotor.circular else (guess,)
    return nearest_zero([(determinant, start) for start in starts])


def nearest_zero(searches: list[tuple[Callable, Any]]) -> Any:
    """Of the zeros of functions, each sought from a start, the one that is nearest to its start."""
    found = []
    for function, start in searches:
        try:
            one = zero_near(function, start)
        except ArithmeticError:
            continue
        found.append((abs(one - start), one))
    if not found:
        raise ArithmeticError(f"There is no zero near {searches[0][1]}.")
    return min(found, key=lambda pair: pair[0])[1]


def campbell(case: Case) -> np.ndarray:
    """Roots at every speed."""
    rotor = Rotor(Machine(case.machine))
    near = Model(rotor.machine, FINE)
    rows = [
        [root_near(rotor, speed, one) for one in near.roots(speed, case.ask["count"])]
        for speed in speeds_of(case.ask)
    ]
    return np.array(
        [[complex(mp.re(z), abs(mp.im(z))) for z in row[: case.ask["count"]]] for row in rows]
    )


def roots_over(case: Case) -> np.ndarray:
    """Roots with every value of a parameter."""
    own = Machine(case.machine)
    machines = [own.varied(case.ask["over"], value) for value in values_of(case.ask)]
    near = answered(own, case.ask, case.question, FINE)()
    rows = [
        [root_near(Rotor(machine), machine.speed, one) for one in row[: case.ask["count"]]]
        for machine, row in zip(machines, near, strict=True)
    ]
    return np.array([[complex(mp.re(z), abs(mp.im(z))) for z in row] for row in rows])


def forward_over(case: Case) -> np.ndarray:
    """The lowest critical speeds of forward whirl with every value of a parameter."""
    own = Machine(case.machine)
    machines = [own.varied(case.ask["over"], value) for value in values_of(case.ask)]
    rows = []
    for machine, near in zip(machines, answered(own, case.ask, case.question, FINE)(), strict=True):
        rotor, found = Rotor(machine, damped=False), []
        for guess in near:
            with contextlib.suppress(ArithmeticError):  # a speed of backward whirl
                one = float(critical_near(rotor, guess, (1j,)))
                if not np.isclose(one, found, rtol=1e-9, atol=0).any():
                    found.append(one)
        rows.append(sorted(found)[: case.ask["count"]])
    return np.array(rows)


def pinned(machine: Machine, count: int) -> np.ndarray:
    """`a w^4 - b w^2 + c = 0` of Timoshenko, at rest; each frequency is one of both planes."""
    young, density, shear = map(number, machine.material)
    d, length = number(machine.shaft["diameter"]), number(machine.shaft["length"])
    area, second = mp.pi * d**2 / 4, mp.pi * d**4 / 64
    nu = young / (2 * shear) - 1
    cowper = 6 * (1 + nu) / (7 + 6 * nu)
    squares = []
    for n in range(1, count // 2 + 1):
        k = n * mp.pi / length
        a = density * second / (cowper * shear * area) * density * area
        b = density * area + k**2 * (density * second + young * second * density / (cowper * shear))
        c = k**4 * young * second
        squares += [(b - mp.sqrt(b * b - 4 * a * c)) / (2 * a)]
    return 1j * np.array([float(mp.sqrt(one)) for one in squares])


def spinning(machine: Machine, count: int) -> np.ndarray:
    """`(1 + r^2 k^2) w^2 - 2 Omega r^2 k^2 w - k^4 EI / rho A = 0`, forward and backward."""
    young, density, _ = machine.material
    young, density = number(young), number(density)
    d, length = number(machine.shaft["diameter"]), number(machine.shaft["length"])
    area, second = mp.pi * d**2 / 4, mp.pi * d**4 / 64
    found = []
    for n in range(1, count + 1):
        k2 = (n * mp.pi / length) ** 2
        r2k2 = second / area * k2
        b, c = number(machine.speed) * r2k2, k2**2 * young * second / (density * area)
        root = mp.sqrt(b * b + (1 + r2k2) * c)
        found += [(root + b) / (1 + r2k2), (root - b) / (1 + r2k2)]
    return 1j * np.array(sorted(map(float, found))[:count])


CLOSED: dict[str, Callable[[Machine, int], np.ndarray]] = {
    "pinned beam": pinned,
    "pinned shaft, spinning": spinning,
}


def critical_speeds(case: Case) -> np.ndarray:
    """Speeds with a root i Omega, or -i Omega, of the undamped rotor."""
    machine = Machine(case.machine)
    rotor = Rotor(machine, damped=False)
    near = answered(machine, case.ask, "critical speeds", FINE)()[: case.ask["count"]]
    return np.array([float(critical_near(rotor, guess)) for guess in near])


def critical_near(rotor: Rotor, guess: float, senses: tuple[complex, ...] = (1j, -1j)) -> Any:
    """A critical speed; where planes are apart it may be forward or backward."""
    of = lambda sense: lambda w: mp.re(rotor.determinant(sense * w, w))
    senses = senses if rotor.circular else (1j,)
    return nearest_zero([(of(sense), guess) for sense in senses])


def threshold(case: Case) -> np.ndarray:
    """Speed and whirl [rad/s] of a root without growth."""
    machine = Machine(case.machine)
    rotor = Rotor(machine)
    guess = answered(machine, case.ask, "threshold", 4)()
    found = zero_of_two(lambda speed, whirl: rotor.determinant(1j * whirl, speed), tuple(guess))
    return np.array([float(found[0]), float(found[1])])


def radii(rotor: Rotor, ask: dict[str, Any], speed: Any) -> list[Any]:
    """Forward and backward radius [m] of the response to the unbalance."""
    sums = [mp.mpc(0), mp.mpc(0)]
    for one in rotor.machine.parts("unbalances"):
        push = number(one["moment"]) * speed**2 * mp.exp(1j * number(one.get("phase", 0.0)))
        parts = rotor.response(1j * speed, speed, one["at"], ask["at"])
        sums = [whole + push * part for whole, part in zip(sums, parts, strict=True)]
    return [abs(whole) for whole in sums]


def response(case: Case) -> np.ndarray:
    rotor = Rotor(Machine(case.machine))
    rows = [radii(rotor, case.ask, number(speed)) for speed in speeds_of(case.ask)]
    return np.array([[float(x) for x in row] for row in rows])


def peak(case: Case) -> np.ndarray:
    """Where the derivative of the largest half axis by the speed is zero."""
    machine = Machine(case.machine)
    rotor = Rotor(machine)
    half = lambda speed: sum(radii(rotor, case.ask, speed))
    h = mp.mpf("1e-8")
    slope = lambda speed: (half(speed + h) - half(speed - h)) / (2 * h)
    guess = mp.mpf(float(answered(machine, case.ask, "peak", 4)()[0]))
    ends = guess * (1 - mp.mpf("1e-4")), guess * (1 + mp.mpf("1e-4"))
    speed = mp.findroot(slope, ends, solver="anderson", tol=1e-28, verify=False)
    return np.array([float(speed), float(half(speed))])


def history(case: Case) -> np.ndarray:
    """Motion from rest: the sum of all residues of `P(s) exp(s t)`, at the roots and at +-i Omega.

    `P(s) = U Omega^2 [G_pp(s) / (s - i Omega) + G_mp(s*)* / (s + i Omega)]` with the response (p, m)
    to a unit force on p. How far the sum is from rest at t = 0, where all that is left out adds up,
    bounds its error later.
    """
    machine, ask = Machine(case.machine), case.ask
    rotor, speed = Rotor(machine), number(machine.speed)
    (one,) = machine.parts("unbalances")
    push = number(one["moment"]) * speed**2
    turn = 1j * speed
    parts = lambda s: rotor.response(s, speed, one["at"], ask["at"])

    def transform(s: Any) -> Any:
        forward, backward = parts(s)[0], mp.conj(parts(mp.conj(s))[1])
        return push * (forward / (s - turn) + backward / (s + turn))

    h = mp.mpf("1e-8")
    poles = [turn, -turn]
    for guess in Model(machine, FINE).roots(machine.speed, MODES)[:MODES]:
        root = root_near(rotor, machine.speed, guess)
        poles += [root, mp.conj(root)]
    residues = [h * (transform(pole + h) - transform(pole - h)) / 2 for pole in poles]
    sums = [
        sum(r * mp.exp(pole * number(t)) for r, pole in zip(residues, poles, strict=True))
        for t in ask["times"]
    ]
    if abs(sums[0]) > 3e-8 * max(map(abs, sums)):
        raise ArithmeticError(f"{case.name}: at t = 0 it is {complex(sums[0])}; take more roots.")
    sums[0] = mp.mpc(0)
    return np.array([[float(mp.re(z)), float(mp.im(z))] for z in sums])


QUESTIONS: dict[str, Callable[[Case], np.ndarray]] = {
    "roots": roots,
    "roots over a parameter": roots_over,
    "Campbell diagram": campbell,
    "critical speeds over a parameter": forward_over,
    "critical speeds": critical_speeds,
    "threshold": threshold,
    "response": response,
    "peak": peak,
    "history": history,
} | NONLINEAR


def checked(case: Case, found: np.ndarray) -> None:
    """Refuse a number that another code or a print has otherwise."""
    beside = np.array(case.beside)
    values = np.abs(found.imag) if case.question == "roots" else found
    if beside.size and not np.allclose(values[: beside.size], beside, rtol=BESIDE, atol=0):
        raise ArithmeticError(f"{case.name}: {values} is not {beside}, which another code has.")


def text_of(found: np.ndarray) -> str:
    """Numbers as TOML has them."""
    made = lambda v: f"{{re = {v.real!r}, im = {v.imag!r}}}" if isinstance(v, complex) else repr(v)
    each = lambda v: f"[{', '.join(map(each, v))}]" if isinstance(v, list) else made(v)
    return each(found.tolist())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", default=".", metavar="PATTERN", help="names of cases")
    args = parser.parse_args()
    known = references() if (FOLDER / "references.toml").exists() else {}
    for case in cases():
        if re.search(args.only, case.name):
            known[case.name] = QUESTIONS[case.question](case)
            checked(case, known[case.name])
            print(case.name, known[case.name].ravel()[:4], flush=True)
            store(known)


def store(known: dict[str, np.ndarray]) -> None:
    """Write what is known, in the order of the cases."""
    lines = ["# Written by `python -m rotorbench.references`: see `cases.toml` for the sources."]
    lines += [
        f'"{case.name}" = {text_of(known[case.name])}' for case in cases() if case.name in known
    ]
    (FOLDER / "references.toml").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
