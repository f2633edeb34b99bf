"""Sweep of the limiter rotor against SciPy and diffrax, at the same measured error.

    python benchmarks/against_peers.py                       # some ten minutes
    python benchmarks/against_peers.py --lanes 8 --revolutions 20 --peer-revolutions 10

Every lane goes on from one settled backward rub, with its own eccentricity in 0 .. 0.01 mm. What is
compared is the whirl rate over the spin speed: the mean angular velocity of the orbit, by a bump
weight that vanishes at both ends of the window, as `jaxrotor.observe.Precession` reports it. A method
walks its settings from loose to tight on the first and the last lane until it agrees with the
reference to `--target`, and still does one setting tighter (no lucky hits); the window of all errors
is `--peer-revolutions`. With that setting it is timed on all its lanes. Coarse fixed steps lock the
rub at rational rates, whatever the order: the error falls in plateaus.
"""

import argparse
import dataclasses
import functools
import importlib.metadata
import json
import os
import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path

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
SAMPLES = 32  # a revolution, from which the peers' rates come
STEPS = (128, 192, 256, 384, 512, 768, 1024, 1536, 2048)  # each is compiled anew
RTOLS = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 1e-8, 1e-9)
ATOL = 1e-3  # [m] of rtol: displacements are about 1e-2 m, velocities as much per radian
COMPILING = []  # seconds in XLA, filled by jax


@functools.cache
def settled() -> jr.Continued:
    """State without eccentricity in its periodic backward rub."""
    return jr.simulate(SCENE, 300, 1024, solver=jr.Exponential(4), start=START, keep=1).end


def library_rates(order, steps, revolutions: int, eccentricities, workers: int = 1) -> np.ndarray:
    """Whirl rates by the public sweep."""
    over = {"unbalance.eccentricity": eccentricities}
    run = {"start": settled(), "settle": 0, "keep": revolutions, "progress": False}
    how = {"solver": jr.Exponential(order), "steps_per_revolution": steps, "workers": workers}
    found = jr.sweep(SCENE, over, observe=(jr.observe.Precession(),), **run, **how)
    return found["whirl_rate"].values


@functools.cache
def reference(revolutions: int) -> np.ndarray:
    """Rates of the first and the last lane over a window."""
    return library_rates(4, REFERENCE_STEPS, revolutions, [0.0, LARGEST])


def whirl_rate(z: np.ndarray) -> float:
    """Bump-weighted mean of the whirl's angular velocity over the spin's, from complex samples."""
    turned = np.angle(z[1:] * z[:-1].conj()) * SAMPLES / (2 * np.pi)
    u = (np.arange(turned.size) + 0.5) / turned.size
    weight = np.exp(-1 / (u * (1 - u)))
    return float(turned @ weight / weight.sum())


@functools.cache
def motion_and_state():
    """First-order motion at the largest eccentricity, and the settled state (q or q', x or y, n)."""
    scene = SCENE.replace({"unbalance.eccentricity": LARGEST})
    motion = Motion(jr.assemble(scene), jnp.abs(scene.spin.speed))
    state = np.stack([settled().q, settled().velocity / motion.rate])
    return motion, np.stack([state.real, state.imag], axis=1)


# === SciPy: one lane at a time, the right-hand side in numpy


class NumpyRotor:
    """`y' = A y + B [N, T, cos theta, sin theta]`, y the x and the y parts of (q, q').

    Normal forces N and friction T of the stops follow from `local y`: outward displacement, outward
    velocity, sideways velocity. All products that can be formed beforehand are.
    """

    def __init__(self, eccentricity: float):
        motion, state = motion_and_state()
        self.start = state.transpose(1, 0, 2).ravel()
        a, rate = np.asarray(motion.matrix()), float(motion.rate)
        self.A = np.block([[a.real, -a.imag], [a.imag, a.real]])
        ((law,),) = [port.laws for port in motion.ports]
        cos, sin = np.asarray(law.cos)[:, None], np.asarray(law.sin)[:, None]
        x, vx, y, vy = np.kron(np.diag([1, rate, 1, rate]), np.asarray(motion.rows))
        self.see = np.stack([x, y])
        self.local = np.concatenate([cos * x + sin * y, cos * vx + sin * vy, cos * vy - sin * vx])
        push, off = np.asarray(motion.columns), np.zeros((a.shape[0] // 2, 8))
        real, imag = np.asarray(motion.unbalance)[..., None] * eccentricity / LARGEST
        ahead = np.hstack([-push * cos.T, push * sin.T, real, -imag])
        aside = np.hstack([-push * sin.T, -push * cos.T, imag, real])
        self.B = np.concatenate([off, ahead, off, aside])
        stop = jax.tree.map(np.asarray, law.limiter)
        self.gap, self.k, self.d, self.f = stop.gap, stop.stiffness, stop.damping, stop.friction
        self.rim = float(motion.speed) * stop.rim_radius

    def contact(self, y: np.ndarray):
        """Of each stop: normal force, whether it acts, friction per normal force."""
        outward, closing, sideways = (self.local @ y).reshape(3, 3)
        depth = outward - self.gap
        normal = self.k * depth + self.d * closing
        return normal, (depth > 0) & (normal > 0), self.f * np.sign(self.rim + sideways)

    def __call__(self, theta: float, y: np.ndarray) -> np.ndarray:
        normal, active, friction = self.contact(y)
        rate = self.A @ y + self.B[:, 6:] @ np.array([np.cos(theta), np.sin(theta)])
        if active.any():
            rate += self.B[:, :6] @ np.concatenate([active * normal, active * friction * normal])
        return rate

    def jacobian(self, theta: float, y: np.ndarray) -> np.ndarray:
        _, active, friction = self.contact(y)
        if not active.any():
            return self.A
        k, d = (active * self.k)[:, None], (active * self.d)[:, None]
        slope = k * self.local[:3] + d * self.local[3:6]
        return self.A + self.B[:, :6] @ np.concatenate([slope, friction[:, None] * slope])

    def orbit(self, method: str, rtol: float, revolutions: int) -> np.ndarray:
        """Complex displacement of the disc, SAMPLES a revolution."""
        angles = np.linspace(0, 2 * np.pi * revolutions, revolutions * SAMPLES + 1)
        how = {"method": method, "jac": self.jacobian, "rtol": rtol, "atol": ATOL * rtol}
        found = solve_ivp(self, (0, angles[-1]), self.start, t_eval=angles, **how)
        x, y = self.see @ found.y
        return x + 1j * y if found.success else np.full(angles.size, np.nan + 0j)


def scipy_rates(method: str, rtol: float, revolutions: int, lanes) -> np.ndarray:
    return np.array([whirl_rate(NumpyRotor(e).orbit(method, rtol, revolutions)) for e in lanes])


# === diffrax: all lanes under vmap, matrices shared


@eqx.filter_jit
def _diffrax_orbits(solver, motion, y0, rtol, eccentricities, revolutions: int):
    angles = jnp.linspace(0, 2 * jnp.pi * revolutions, revolutions * SAMPLES + 1)
    saveat = dfx.SaveAt(ts=angles, fn=lambda t, y, args: y[0] @ motion.rows[0])
    how = {"saveat": saveat, "stepsize_controller": step_control(solver, rtol, ATOL * rtol)}
    how |= {"adjoint": dfx.ForwardMode(), "max_steps": None, "throw": False}

    def lane(eccentricity):
        load = motion.unbalance * eccentricity / LARGEST
        term = dfx.ODETerm(eqx.tree_at(lambda m: m.unbalance, motion, load))
        span = (0.0, angles[-1], None)  # from, to, first step: diffrax chooses
        return dfx.diffeqsolve(term, solver, *span, y0, **how).ys

    return jax.vmap(lane)(eccentricities)


def diffrax_rates(solver, rtol: float, revolutions: int, eccentricities) -> np.ndarray:
    motion, *given = *motion_and_state(), rtol, eccentricities
    orbits = np.asarray(_diffrax_orbits(solver, motion, *map(jnp.asarray, given), revolutions))
    return np.array([whirl_rate(z) for z in orbits @ [1, 1j]])


@dataclasses.dataclass
class Method:
    """`rates(setting, revolutions, eccentricities, **variant)` and its settings, loose to tight."""

    name: str
    rates: Callable[..., np.ndarray]
    unit: str  # of the settings
    settings: Sequence[float]
    lanes: int
    revolutions: int
    variants: Sequence[dict] = ({},)  # each timed

    def climb(self, target: float, window: int, log: Console) -> tuple[float, float]:
        """The loosest setting that meets the target, as does the next (else the tightest); its error."""
        met = None
        for setting in self.settings:
            off = np.abs(self.rates(setting, window, [0.0, LARGEST]) - reference(window))
            log.print(
                f"{self.name}, {self.unit} {setting:g}: error {(error := float(off.max())):.1e}"
            )
            if error <= target and met:
                return met
            met = (setting, error) if error <= target else None
        return setting, error

    def measure(self, setting: float, error: float, variant: dict, repeats: int) -> dict:
        """The first call, for what jax spends on compiling it, then the fastest of more."""
        lanes, seconds = np.linspace(0, LARGEST, self.lanes), []
        COMPILING.clear()
        for _ in range(1 + repeats):
            began = time.perf_counter()
            self.rates(setting, self.revolutions, lanes, **variant)
            seconds.append(time.perf_counter() - began)
        run = min(seconds[1:])
        return {
            "method": ", ".join([self.name, *(f"{k} {v}" for k, v in variant.items())]),
            "setting": f"{self.unit} {setting:g}",
            "error": error,
            "lanes x rev": f"{self.lanes} x {self.revolutions}",
            "compile s": sum(COMPILING),
            "run s": run,
            "lane-rev/s": self.lanes * self.revolutions / run,
        }


def methods(args: argparse.Namespace) -> list[Method]:
    workers = [{"workers": count} for count in sorted({1, os.cpu_count() or 1})]
    ours, peers = (args.lanes, args.revolutions), (args.peer_lanes, args.peer_revolutions)
    call = functools.partial
    return [
        Method("jaxrotor order 2", call(library_rates, 2), "steps", STEPS, *ours, workers),
        Method("jaxrotor order 4", call(library_rates, 4), "steps", STEPS, *ours, workers),
        Method("diffrax Tsit5", call(diffrax_rates, dfx.Tsit5()), "rtol", RTOLS, *peers),
        Method("diffrax Kvaerno5", call(diffrax_rates, dfx.Kvaerno5()), "rtol", RTOLS, *peers),
        Method("SciPy LSODA", call(scipy_rates, "LSODA"), "rtol", RTOLS, 2, peers[1]),
        Method("SciPy Radau", call(scipy_rates, "Radau"), "rtol", RTOLS, 2, peers[1]),
    ]


def confirm(revolutions: int = 3) -> dict:
    """How far Radau at rtol 1e-11 is from the reference: orbit over its radius, whirl rate."""
    how = {"solver": jr.Exponential(4), "start": settled()}
    run = jr.simulate(SCENE, revolutions, REFERENCE_STEPS, **how)
    ours = np.asarray(run.displacement[:: REFERENCE_STEPS // SAMPLES, 0])
    radau = NumpyRotor(0.0).orbit("Radau", 1e-11, revolutions)
    apart = abs(ours - radau).max() / abs(radau).max()
    return {"orbit": float(apart), "whirl rate": abs(whirl_rate(ours) - whirl_rate(radau))}


def machine() -> dict:
    info = Path("/proc/cpuinfo")
    found = re.search("model name.*: (.*)", info.read_text()) if info.exists() else None
    packages = ("jaxrotor", "jax", "diffrax", "scipy", "numpy")
    versions = [f"{name} {importlib.metadata.version(name)}" for name in packages]
    model, device = found[1] if found else "?", f"{jax.devices()[0]} {jnp.zeros(()).dtype}"
    return {"CPU": model, "cores": os.cpu_count(), "device": device, "versions": " ".join(versions)}


def table(rows: list[dict], target: float) -> Table:
    best = max(row["lane-rev/s"] for row in rows if row["method"].startswith("jaxrotor"))
    shown = Table(title=f"Whirl rate to {target:g} of the spin speed; best of jaxrotor / this")
    for head in (*rows[0], "best / this"):
        shown.add_column(head, justify="left" if head in ("method", "setting") else "right")
    for row in rows:
        *texts, error, size, compiling, run, speed = row.values()
        error = f"{error:.1e}{'' if error <= target else ' (missed)'}"
        numbers = f"{compiling:.1f}", f"{run:.2f}", f"{speed:,.0f}", f"{best / speed:,.1f}"
        shown.add_row(*texts, error, size, *numbers)
    return shown


def main() -> None:
    heard = lambda event, seconds, **_: COMPILING.append(seconds) if "/backend_" in event else None
    jax.monitoring.register_event_duration_secs_listener(heard)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lanes", type=int, default=256, help="of jaxrotor (2 or more)")
    parser.add_argument("--revolutions", type=int, default=300, help="of jaxrotor")
    parser.add_argument("--peer-lanes", type=int, default=32, help="of diffrax under vmap")
    parser.add_argument("--peer-revolutions", type=int, default=60, help="all errors too")
    parser.add_argument("--target", type=float, default=1e-4, help="error of the whirl rate")
    parser.add_argument("--repeats", type=int, default=3, help="timed calls after the first")
    parser.add_argument("--json", type=Path, help="file for all numbers")
    args, log = parser.parse_args(), Console(stderr=True, highlight=False)
    load, close, rows = os.getloadavg()[:1], confirm(), []
    for method in methods(args):
        found = method.climb(args.target, args.peer_revolutions, log)
        rows += [method.measure(*found, variant, args.repeats) for variant in method.variants]
    load += os.getloadavg()[:1]
    about = machine() | {"load before and after": " ".join(f"{x:.1f}" for x in load)}
    out = Console(highlight=False, width=max(120, log.width))
    out.print(table(rows, args.target))
    off = f"{close['orbit']:.0e} of the radius, {close['whirl rate']:.0e} in whirl rate"
    out.print(f"Reference: order 4, {REFERENCE_STEPS} steps; Radau at 1e-11 differs by {off}.")
    out.print("; ".join(f"{key} {value}" for key, value in about.items()), soft_wrap=True)
    if args.json:
        found = {"target": args.target, "rows": rows, "confirmed": close, "machine": about}
        args.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
