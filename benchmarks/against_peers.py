"""Sweep of the limiter rotor against SciPy and diffrax, at the same measured error.

    python benchmarks/against_peers.py                       # about a quarter of an hour
    python benchmarks/against_peers.py --lanes 8 --revolutions 20 --peer-revolutions 10

Every lane goes on from one settled backward rub, with its own eccentricity in 0 .. 0.01 mm. What is
compared is the whirl rate over the spin speed: the mean of the orbit's angular velocity with a bump
weight that vanishes at both ends of the window, as `jaxrotor.observe.Precession` reports it. A method
walks its settings from loose to tight on the first and the last lane, until it agrees with the
reference over the same window to `--target`, and still does one setting tighter (no lucky hits);
with that setting it is timed on all its lanes.
"""

import argparse
import dataclasses
import functools
import importlib.metadata
import json
import os
import platform
import time
from collections.abc import Callable, Sequence
from pathlib import Path


os.environ.setdefault("EQX_ON_ERROR", "nan")  # no host callbacks in what is timed

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.motion import Motion
from jaxrotor.solvers.control import step_control


SCENE = jr.load("limiter-rotor")
START = jr.Whirl(0.012 * 0.7, rate=-10 / 0.022646559709295067)  # leads to the backward rub
LARGEST = 1e-5  # [m] of the eccentricities
REFERENCE_STEPS = 4096  # a revolution, by Exponential(4)
SAMPLES = 32  # a revolution, that the peers give their rate from
STEPS = (48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048)
RTOLS = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 1e-8, 1e-9)
ATOL = 1e-3  # [m] of rtol: displacements are about 1e-2 m, velocities as much per radian


# === the same rotor for all


@functools.cache
def settled() -> jr.Continued:
    """State of the rotor without eccentricity in its periodic backward rub."""
    return jr.simulate(SCENE, 300, 1024, solver=jr.Exponential(4), start=START, keep=1).end


def library_rates(solver, steps: int, revolutions: int, eccentricities, **options) -> np.ndarray:
    """Whirl rates by the public sweep."""
    found = jr.sweep(
        SCENE,
        {"unbalance.eccentricity": eccentricities},
        start=settled(),
        settle=0,
        keep=revolutions,
        observe=(jr.observe.Precession(),),
        steps_per_revolution=steps,
        solver=solver,
        progress=False,
        **options,
    )
    return found["whirl_rate"].values


@functools.cache
def reference(revolutions: int) -> np.ndarray:
    """Rates of the first and the last lane over a window."""
    return library_rates(jr.Exponential(4), REFERENCE_STEPS, revolutions, [0.0, LARGEST], workers=1)


def whirl_rate(z: np.ndarray) -> float:
    """Bump-weighted mean of the whirl's angular velocity over the spin's, from complex samples."""
    turned = np.angle(z[1:] * z[:-1].conj()) * SAMPLES / (2 * np.pi)
    u = (np.arange(turned.size) + 0.5) / turned.size
    weight = np.exp(-1 / (u * (1 - u)))
    return float(turned @ weight / weight.sum())


@functools.cache
def motion_and_state():
    """First-order motion at the largest eccentricity, and the settled state in its coordinates."""
    scene = SCENE.replace({"unbalance.eccentricity": LARGEST})
    motion = Motion(jr.assemble(scene), jnp.abs(scene.spin.speed))
    state = np.stack([settled().q, settled().velocity / motion.rate])
    return motion, np.stack([state.real, state.imag], axis=1)  # (q or q', x or y, n)


# === SciPy: one lane at a time, the right-hand side in numpy


class NumpyRotor:
    """`y' = A y + B [N, T, cos theta, sin theta]`, y = [x, x', y, y'] parts of (q, q').

    Normal forces N and friction T of all stops come from `local y`: their outward displacement,
    outward velocity and sideways velocity. All products that can be formed beforehand are.
    """

    def __init__(self, eccentricity: float):
        motion, state = motion_and_state()
        a = np.asarray(motion.matrix())
        n, rate = a.shape[0] // 2, float(motion.rate)
        self.A = np.block([[a.real, -a.imag], [a.imag, a.real]])
        law = motion.ports[0].laws[0]
        stop = jax.tree.map(np.asarray, law.limiter)
        cos, sin = np.asarray(law.cos)[:, None], np.asarray(law.sin)[:, None]
        row, zero = np.asarray(motion.rows)[:1], np.zeros((1, n))
        x, vx = np.block([[row, zero, zero, zero]]), np.block([[zero, rate * row, zero, zero]])
        y, vy = np.block([[zero, zero, row, zero]]), np.block([[zero, zero, zero, rate * row]])
        self.local = np.concatenate([cos * x + sin * y, cos * vx + sin * vy, cos * vy - sin * vx])
        self.see = np.concatenate([x, y])
        push, none = np.asarray(motion.columns)[:, :1], np.zeros((n, 3))
        normal = [none, -push * cos.T, none, -push * sin.T]
        tangential = [none, push * sin.T, none, -push * cos.T]
        re, im = np.asarray(motion.unbalance)[..., None] * eccentricity / LARGEST
        off = np.zeros((n, 2))
        turning = [off, np.hstack([re, -im]), off, np.hstack([im, re])]
        self.B = np.hstack([np.concatenate(part) for part in (normal, tangential, turning)])
        self.gap, self.k, self.d, self.f = stop.gap, stop.stiffness, stop.damping, stop.friction
        self.rim = float(motion.speed) * stop.rim_radius
        self.start = state.transpose(1, 0, 2).ravel()

    def __call__(self, theta: float, y: np.ndarray) -> np.ndarray:
        outward, closing, sideways = (self.local @ y).reshape(3, 3)
        inputs = np.zeros(8)
        inputs[6], inputs[7] = np.cos(theta), np.sin(theta)
        depth = outward - self.gap
        if depth.max() > 0:
            normal = self.k * depth + self.d * closing
            inputs[:3] = np.where((depth > 0) & (normal > 0), normal, 0.0)
            inputs[3:6] = self.f * inputs[:3] * np.sign(self.rim + sideways)
        return self.A @ y + self.B @ inputs

    def jacobian(self, theta: float, y: np.ndarray) -> np.ndarray:
        outward, closing, sideways = (self.local @ y).reshape(3, 3)
        depth = outward - self.gap
        normal = self.k * depth + self.d * closing
        active = ((depth > 0) & (normal > 0))[:, None]
        if not active.any():
            return self.A
        slope = active * (self.k[:, None] * self.local[:3] + self.d[:, None] * self.local[3:6])
        friction = (self.f * np.sign(self.rim + sideways))[:, None]
        return self.A + self.B[:, :3] @ slope + self.B[:, 3:6] @ (friction * slope)

    def orbit(self, method: str, rtol: float, revolutions: int) -> np.ndarray:
        """Complex displacement of the disc, SAMPLES a revolution."""
        angles = np.linspace(0, 2 * np.pi * revolutions, revolutions * SAMPLES + 1)
        found = solve_ivp(
            self,
            (0, angles[-1]),
            self.start,
            method=method,
            t_eval=angles,
            jac=self.jacobian,
            rtol=rtol,
            atol=ATOL * rtol,
        )
        x, y = self.see @ found.y
        return x + 1j * y if found.success else np.full(angles.size, np.nan + 0j)


def scipy_rates(method: str, rtol: float, revolutions: int, eccentricities) -> np.ndarray:
    orbits = [NumpyRotor(e).orbit(method, rtol, revolutions) for e in eccentricities]
    return np.array([whirl_rate(z) for z in orbits])


# === diffrax: all lanes under vmap, matrices shared


@eqx.filter_jit
def _diffrax_orbits(solver, motion, y0, rtol, eccentricities, revolutions: int):
    angles = jnp.linspace(0, 2 * jnp.pi * revolutions, revolutions * SAMPLES + 1)

    def lane(eccentricity):
        load = motion.unbalance * eccentricity / LARGEST
        return dfx.diffeqsolve(
            dfx.ODETerm(eqx.tree_at(lambda m: m.unbalance, motion, load)),
            solver,
            t0=0.0,
            t1=angles[-1],
            dt0=None,
            y0=y0,
            saveat=dfx.SaveAt(ts=angles, fn=lambda t, y, args: y[0] @ motion.rows[0]),
            stepsize_controller=step_control(solver, rtol, ATOL * rtol),
            adjoint=dfx.ForwardMode(),
            max_steps=None,
            throw=False,
        ).ys

    return jax.vmap(lane)(eccentricities)


def diffrax_rates(solver, rtol: float, revolutions: int, eccentricities) -> np.ndarray:
    motion, y0 = motion_and_state()
    given = jnp.asarray(y0), jnp.asarray(rtol), jnp.asarray(eccentricities)
    x, y = np.moveaxis(np.asarray(_diffrax_orbits(solver, motion, *given, revolutions)), -1, 0)
    return np.array([whirl_rate(z) for z in x + 1j * y])


# === the contest


@dataclasses.dataclass
class Method:
    """`rates(setting, revolutions, eccentricities, **variant)` and its settings, loose to tight."""

    name: str
    rates: Callable[..., np.ndarray]
    settings: Sequence[float]
    unit: str  # of the settings
    revolutions: int
    lanes: int
    variants: Sequence[dict] = ({},)  # each timed
    compiles: bool = True


def methods(args: argparse.Namespace) -> list[Method]:
    workers = [{"workers": count} for count in sorted({1, os.cpu_count() or 1})]
    found = []
    for order in (2, 4):
        rates = functools.partial(library_rates, jr.Exponential(order))
        size = args.revolutions, args.lanes
        found.append(
            Method(f"jaxrotor Exponential({order})", rates, STEPS, "steps", *size, workers)
        )
    for solver in (dfx.Tsit5(), dfx.Kvaerno5()):
        rates = functools.partial(diffrax_rates, solver)
        size = args.peer_revolutions, args.peer_lanes
        found.append(Method(f"diffrax {type(solver).__name__}", rates, RTOLS, "rtol", *size))
    for name in ("LSODA", "Radau"):
        rates = functools.partial(scipy_rates, name)
        size = args.peer_revolutions, 2
        found.append(Method(f"SciPy {name}", rates, RTOLS, "rtol", *size, compiles=False))
    return found


def error(rates: np.ndarray, revolutions: int) -> float:
    """Of the first and the last lane, the larger."""
    return float(np.abs(rates[[0, -1]] - reference(revolutions)).max())


def climb(method: Method, target: float, log: Console) -> float:
    """The loosest setting that meets the target, as does the next; the tightest if none does."""
    met = None
    for setting in method.settings:
        rates = method.rates(setting, method.revolutions, [0.0, LARGEST])
        found = error(rates, method.revolutions)
        log.print(f"{method.name}, {method.unit} {setting:g}: error {found:.1e}")
        if found <= target and met is not None:
            return met
        met = setting if found <= target else None
    return method.settings[-1]


def measure(method: Method, setting: float, variant: dict, repeats: int) -> dict:
    """First call, then the fastest of more: what the first took longer is compilation."""
    lanes, seconds = np.linspace(0, LARGEST, method.lanes), []
    for _ in range(1 + repeats):
        began = time.perf_counter()
        rates = method.rates(setting, method.revolutions, lanes, **variant)
        seconds.append(time.perf_counter() - began)
    run = min(seconds[1:])
    return {
        "method": ", ".join([method.name, *(f"{k} {v}" for k, v in variant.items())]),
        "setting": f"{method.unit} {setting:g}",
        "error": error(rates, method.revolutions),
        "lanes": method.lanes,
        "revolutions": method.revolutions,
        "compile_s": max(seconds[0] - run, 0.0) if method.compiles else None,
        "run_s": run,
        "lane_revolutions_per_s": method.lanes * method.revolutions / run,
    }


def confirm(revolutions: int = 3) -> dict:
    """How far the reference is from Radau at rtol 1e-11: orbit over its radius, whirl rate."""
    run = jr.simulate(
        SCENE, revolutions, REFERENCE_STEPS, solver=jr.Exponential(4), start=settled()
    )
    ours = np.asarray(run.displacement[:: REFERENCE_STEPS // SAMPLES, 0])
    radau = NumpyRotor(0.0).orbit("Radau", 1e-11, revolutions)
    return {
        "orbit": float(abs(ours - radau).max() / abs(radau).max()),
        "whirl_rate": abs(whirl_rate(ours) - whirl_rate(radau)),
    }


def machine() -> dict:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    models = [line.split(": ")[1] for line in lines if line.startswith("model name")]
    packages = ("jaxrotor", "jax", "diffrax", "scipy", "numpy")
    return {
        "cpu": models[0] if models else platform.processor(),
        "cores": os.cpu_count(),
        "device": str(jax.devices()[0]),
        "precision": str(jnp.zeros(()).dtype),
        "versions": " ".join(f"{name} {importlib.metadata.version(name)}" for name in packages),
    }


def table(rows: list[dict], target: float) -> Table:
    best = max(
        row["lane_revolutions_per_s"] for row in rows if row["method"].startswith("jaxrotor")
    )
    shown = Table(title=f"Whirl rate to {target:g} of the spin speed")
    for head in ("method", "setting", "error", "lanes x rev", "compile s", "run s", "lane-rev/s"):
        shown.add_column(head, justify="left" if head in ("method", "setting") else "right")
    shown.add_column("jaxrotor's best is faster by", justify="right")
    for row in rows:
        shown.add_row(
            row["method"],
            row["setting"],
            f"{row['error']:.1e}" + (" missed" if not row["error"] <= target else ""),
            f"{row['lanes']} x {row['revolutions']}",
            "-" if row["compile_s"] is None else f"{row['compile_s']:.1f}",
            f"{row['run_s']:.2f}",
            f"{row['lane_revolutions_per_s']:,.0f}",
            f"{best / row['lane_revolutions_per_s']:,.1f}",
        )
    return shown


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--lanes", type=int, default=256, help="lanes of jaxrotor")
    parser.add_argument("--revolutions", type=int, default=300, help="revolutions of jaxrotor")
    parser.add_argument("--peer-lanes", type=int, default=32, help="lanes of diffrax under vmap")
    parser.add_argument("--peer-revolutions", type=int, default=60)
    parser.add_argument("--target", type=float, default=1e-4, help="error of the whirl rate")
    parser.add_argument("--repeats", type=int, default=3, help="timed calls after the first")
    parser.add_argument("--json", type=Path, help="file for all numbers")
    return parser.parse_args()


def main() -> None:
    args, log = arguments(), Console(stderr=True, highlight=False)
    load = [round(os.getloadavg()[0], 2)]
    close = confirm()
    rows = []
    for method in methods(args):
        setting = climb(method, args.target, log)
        for variant in method.variants:
            rows.append(measure(method, setting, variant, args.repeats))
    load.append(round(os.getloadavg()[0], 2))
    about = machine() | {"load_before_and_after": load}
    out = Console(highlight=False)
    out.print(table(rows, args.target))
    out.print(
        f"Reference: Exponential(4), {REFERENCE_STEPS} steps a revolution; Radau at 1e-11 is off by "
        f"{close['orbit']:.0e} of the radius and {close['whirl_rate']:.0e} in the whirl rate."
    )
    out.print(", ".join(f"{key} {value}" for key, value in about.items()), soft_wrap=True)
    if args.json:
        found = {"target": args.target, "rows": rows, "confirmed": close, "machine": about}
        args.json.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
