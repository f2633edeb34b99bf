"""What accuracy costs: work-precision figure of three scenes, jaxrotor, diffrax and SciPy.

    python benchmarks/work_precision.py --limit 4       # all, forty minutes on two cores
    python benchmarks/work_precision.py --quick         # a few settings of each, minutes
    python benchmarks/work_precision.py --only turbine --json numbers.json   # one scene, added there
    python benchmarks/work_precision.py --draw numbers.json                  # the figure, nothing run

Limiter rotor: whirl rate of the settled backward rub over `--revolutions`. Turbine: reaction of a
bearing after 0.1 s of its run-down. Ball balancer: imbalance left at the end. Every method walks its
settings from loose to tight; references are refined once more and their uncertainty drawn. jaxrotor
and diffrax are timed by `jaxrotor.accuracy`; SciPy integrates a right-hand side of its own in numpy:
of the rotor that of peers/by_scipy.py, of the others the equations of the published papers.
"""

import argparse
import dataclasses
import json
import time
from collections.abc import Callable
from pathlib import Path

import against_peers
import diffrax as dfx
import jax
import numpy as np
import xarray as xr
from peers import by_scipy, rotor
from rich.console import Console
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor import measures, methods, plot


SCIPY = ("LSODA", "Radau", "BDF", "DOP853")
STEPS = (32, 64, 128, 256, 512, 1024, 2048)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
RUN_DOWN = np.linspace(0.0, 0.1, 6)  # [s], the steps of the course
BALLS = np.array([[1.0, 2.5], [0.3, 2.0, 4.0]], dtype=object)


@dataclasses.dataclass
class Case:
    """A scene, the number asked of it, and the same number by SciPy."""

    name: str
    scene: jr.Scene
    measure: measures.AbstractMeasure
    methods: tuple[methods.Method, ...]
    scipy: Callable[[str, float], complex]  # by method and relative tolerance


# === the turbine of three wheels in two bearings, equations (9), (10) of the course


def turbine(method: str, rtol: float) -> float:
    """Force of bearing A at the end, of point masses and first-order tilt."""
    a, b, c, alpha, beta = 0.133, 0.267, 0.093, 0.019, 0.68
    masses, radii = np.array([47.0, 57.0, 37.0]), np.array([0.17, 0.2, 0.15])
    at = np.array([a, b + c, -c])  # from bearing A
    offset = np.array([4e-4 * (np.sin(beta) - 1j * np.cos(beta)), 0.0, 3e-4j])
    polar = masses @ radii**2 / 2
    unbalance = masses @ offset
    product = masses @ (offset * at) + alpha * masses[1] * radii[1] ** 2 / 4  # I_xz + i I_yz
    torque = lambda speed: 1950 - 1.57 * speed - 0.039 * speed**2
    right = lambda t, y: [y[1], torque(y[1]) / polar]
    how = {"rtol": rtol, "atol": 1e-3 * rtol}
    found = solve_ivp(right, (0, RUN_DOWN[-1]), [0.0, 600.0], method, **how)
    if not found.success:
        return np.nan
    speed = found.y[1, -1]
    turn = 1j * torque(speed) / polar - speed**2
    return float(abs(turn * (unbalance - product / b)))


# === the ball balancer: casing on a ball joint, the rotor's axis tilts by z' = s


class NumpyBalancer:
    """`(A + Sum m d^2) s.. + h s. + c s - i w C s. = d (m0 + ..) (..)`, balls of rolling inertia.

    Slope `s = s_x + i s_y`; every ball at angle `phi` in fixed axes, its drag against the race.
    """

    def __init__(self):
        scene = jr.load("ball-balancer")
        self.d, self.r, self.kappa = 0.14, 0.06, 1.4
        self.mass = np.repeat([0.025, 0.02], [2, 3])
        self.drag = np.repeat([3.5, 2.24], [2, 3])
        self.speed, self.unbalance = float(scene.spin.speed), 2.4e-3
        self.transverse = 0.067844 + self.d**2 * self.mass.sum()
        self.polar, self.stiff, self.damp = 0.014, 700.0, 1.4

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        s, v = y[0] + 1j * y[1], y[2] + 1j * y[3]
        phi, rate = y[4:9], y[9:]
        out = np.exp(1j * phi)
        w = self.speed
        # d'Alembert along the slope: d times the lateral force of what turns or rolls
        load = self.d * self.unbalance * w**2 * np.exp(1j * w * t)
        load += self.d * self.r * np.sum(self.mass * rate**2 * out)
        load -= self.stiff * s + self.damp * v - 1j * w * self.polar * v
        push = -self.drag * self.r * (rate - w) / self.mass
        # phi.. = (push - Im(conj(out) d s..)) / (kappa r); its reaction -i m r phi.. out d
        free = push / (self.kappa * self.r)
        gain = self.mass * self.d / self.kappa
        load -= self.d * self.r * np.sum(self.mass * 1j * free * out)
        # gain * d * i out * Im(conj(out) a) in [re, im]
        x, z = -out.imag, out.real
        matrix = self.transverse * np.eye(2) - self.d * np.einsum(
            "k,ki,kj->ij", gain, *(np.stack([x, z], axis=1),) * 2
        )
        a = np.linalg.solve(matrix, [load.real, load.imag])
        spin = free - self.d * (x * a[0] + z * a[1]) / (self.kappa * self.r)
        return np.concatenate([[v.real, v.imag], a, rate, spin])

    def left(self, method: str, rtol: float, end: float) -> complex:
        """Imbalance of rotor and balls at the end [kg m], in the axes of the rotor."""
        start = np.concatenate([np.zeros(4), *BALLS, np.full(5, self.speed)]).astype(float)
        found = solve_ivp(self, (0, end), start, method, [end], rtol=rtol, atol=1e-3 * rtol)
        if not found.success:
            return np.nan
        balls = self.r * np.sum(self.mass * np.exp(1j * found.y[4:9, -1]))
        return complex(self.unbalance + balls * np.exp(-1j * self.speed * end))


def cases(args: argparse.Namespace) -> list[Case]:
    steps, tolerances = (STEPS, TOLERANCES) if not args.quick else ((64, 256), (1e-3, 1e-6))
    exponential = [jr.Exponential(order, located=by) for by in (False, True) for order in (2, 4)]
    explicit, implicit = (dfx.Tsit5(), dfx.Dopri8()), (dfx.Kvaerno3(), dfx.Kvaerno5())
    if args.quick:  # every method is one more program to compile
        exponential, explicit, implicit = exponential[::3], explicit[:1], implicit[:1]
    adaptive = methods.by_tolerance((*explicit, *implicit), tolerances)
    split = methods.by_tolerance((dfx.KenCarp4(),), tolerances)
    ours = methods.by_steps(exponential, steps)
    euler = methods.by_steps((dfx.ImplicitEuler(),), steps)
    substeps = methods.by_steps((dfx.ImplicitEuler(),), (1, 4) if args.quick else (1, 4, 16, 64))
    rub, run = rotor.settled(), args.revolutions
    balls = jr.Launch(
        balls=tuple(jr.Balls(np.array(row, float), np.zeros(len(row))) for row in BALLS)
    )
    end = 0.2 if args.quick else 1.0

    def rate(method: str, rtol: float) -> float:
        return rotor.whirl_rate(by_scipy.orbits(rotor.arrays(), [0.0], method, rtol, run)[0])

    return [
        Case(
            "limiter rotor, backward rub",
            rotor.SCENE,
            measures.LongRun("whirl_rate", rub, settle=0, keep=run),
            (*ours, *methods.in_float32(ours[:1]), *euler, *split, *adaptive),
            rate,
        ),
        Case(
            "turbine, run-down",
            jr.load("turbine-run-up"),
            measures.Reaction(RUN_DOWN, "constraints.0", "last"),
            (*substeps, *adaptive),
            turbine,
        ),
        Case(
            "ball balancer",
            jr.load("ball-balancer"),
            measures.FinalState(np.linspace(0.0, end, 21), "imbalance", balls),
            (*substeps, *adaptive),
            lambda method, rtol: NumpyBalancer().left(method, rtol, end),
        ),
    ]


def with_scipy(case: Case, found: xr.Dataset, args: argparse.Namespace) -> xr.Dataset:
    """The study with SciPy's methods added, each until a run takes longer than their limit."""
    rows, about = [], found.attrs
    reference = complex(about["reference"], about.get("reference_imag", 0.0))
    for method in SCIPY:
        for rtol in (1e-3, 1e-6) if args.quick else TOLERANCES:
            reason, value, times = "", complex(np.nan), []
            while len(times) < args.repeats and sum(times) < args.scipy_limit:
                begun = time.perf_counter()
                try:
                    value = case.scipy(method, rtol)
                except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
                    reason = str(error)
                times.append(time.perf_counter() - begun)
            seconds = min(times)
            error = abs(value - reference)
            rows.append(
                {
                    "method": f"SciPy {method}",
                    "setting": f"SciPy {method}, rtol {rtol:g}",
                    "axis": "tolerance",
                    "tolerance": rtol,
                    "value": value.real,
                    "value_imag": value.imag,
                    "error": error,
                    "relative_error": error / abs(reference),
                    "run_time": seconds,
                    "lane_rate": 1 / seconds,
                    "status": 0 if np.isfinite(value) else 1,
                    "reason": reason or ("" if np.isfinite(value) else "not finite"),
                }
            )
            if seconds > args.scipy_limit:
                break
    texts = ("setting", "method", "axis", "solver", "rule", "precision", "reason")
    columns = {}
    for name, array in found.variables.items():
        empty = "" if name in texts else np.nan
        more = np.array([row.get(name, empty) for row in rows])
        columns[name] = ("run", np.concatenate([array.values, more]), array.attrs)
    coords = {name: columns.pop(name) for name in list(found.coords)}
    return xr.Dataset(columns, coords, found.attrs)


def study_of(case: Case, args: argparse.Namespace) -> xr.Dataset:
    """All settings of one scene, timed and held against the reference."""
    fine = methods.Setting(jr.Exponential(4, located=True), 256 if args.quick else 2048)
    long = isinstance(case.measure, measures.LongRun)
    how = {"repeats": args.repeats, "limit": args.limit, "reference": fine if long else None}
    jax.clear_caches()  # a hundred programs are more than the system maps
    return with_scipy(case, jr.accuracy(case.scene, case.measure, case.methods, **how), args)


def show(name: str, study: xr.Dataset, out: Console) -> None:
    about = study.attrs
    out.rule(f"{name}: {study['value'].attrs['long_name']}")
    out.print(f"reference {about['reference']:.12g} +- {about['reference_uncertainty']:.1e}")
    for i in range(study.sizes["run"]):
        one = {name: array.values[i] for name, array in study.variables.items()}
        numbers = f"{one['relative_error']:9.1e} {one['compile_time']:7.2f} {one['run_time']:9.4f}"
        out.print(f"{one['method']:26} {one['setting']:40} {numbers} {one['reason']}")


def draw(studies: dict[str, xr.Dataset], figure: Path) -> None:
    names = [str(name) for study in studies.values() for name in study["method"].values]

    def panels(axes):
        for (name, study), ax in zip(studies.items(), np.atleast_1d(axes), strict=True):
            plot.work_precision(study, ax, methods=names)  # one style a method in all panels
            ax.tick_params(labelbottom=True)
            ax.annotate(name, (0.99, 0.98), xycoords="axes fraction", ha="right", va="top")

    figure.parent.mkdir(parents=True, exist_ok=True)
    plot.write(figure, panels, 150, 105 * len(studies), rows=len(studies))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few settings, short runs")
    parser.add_argument("--revolutions", type=int, help="of the rub, by default 60 (quick: 10)")
    parser.add_argument("--repeats", type=int, default=3, help="timed runs after the first")
    parser.add_argument("--limit", type=float, default=60.0, help="[s] of a run")
    parser.add_argument("--scipy-limit", type=float, default=60.0, help="[s] of a run of SciPy")
    parser.add_argument("--only", default="", help="the case whose name has this in it")
    parser.add_argument("--figure", type=Path, default=Path("docs/work_precision.png"))
    parser.add_argument("--json", type=Path, help="file to which each scene's numbers are added")
    parser.add_argument("--draw", type=Path, help="draw the numbers of such a file, run nothing")
    args, out = parser.parse_args(), Console(highlight=False, width=130)
    args.revolutions = args.revolutions or (10 if args.quick else 60)
    args.repeats = 1 if args.quick else args.repeats
    if args.draw:  # in the order in which they were run
        numbers = json.loads(args.draw.read_text())
        studies = {name: xr.Dataset.from_dict(one["study"]) for name, one in numbers.items()}
        for name, study in studies.items():
            show(name, study, out)
        return draw(studies, args.figure)
    studies = {}
    for case in cases(args):
        if args.only not in case.name:
            continue
        studies[case.name] = study = study_of(case, args)
        show(case.name, study, out)
        if args.json:  # after every scene, for a run may be cut off
            entry = {"machine": against_peers.machine(), "study": study.to_dict()}
            earlier = json.loads(args.json.read_text()) if args.json.exists() else {}
            args.json.write_text(json.dumps({**earlier, case.name: entry}, indent=1))
    draw(studies, args.figure)


if __name__ == "__main__":
    main()
