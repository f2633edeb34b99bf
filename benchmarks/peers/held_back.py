"""Rotor and drive: a motor that its rotor holds back, in lanes of torque, by jaxrotor and by diffrax.

The limiter rotor has an unbalance of 2.5 mm, and a drive with feedback turns it from 60 rad/s on through
its first critical speed, `I Omega. = M0 - k1 Omega + M`, with the moment `M` of the unbalance and of
friction in the stops. Motion and speed are integrated together.
"""

import functools
import time

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
import xarray as xr
from rich.console import Console

import jaxrotor as jr
from jaxrotor.core.outcome import failed

from .clock import quickest
from .loosest import loosest
from .rub_in_time import ATOL


TORQUES = 0.5, 3.0  # [N m]
FIRST, SLOPE, POLAR = 60.0, 1e-3, 0.02  # [rad/s], [N m s], [kg m^2]
ECCENTRICITY = 2.5e-3  # [m]
INTERVALS = 64  # a second
STEPS = {
    "with stops": (64, 96, 128, 192, 256, 384, 512, 768, 1024),
    "without stops": (8, 16, 32, 64),
}
REFERENCE = {"with stops": 2048, "without stops": 256}  # steps, located where there are stops
RTOLS = {"with stops": (3e-7, 1e-7, 3e-8), "without stops": (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 1e-4)}
CONTROL = {"pcoeff": 0.3, "icoeff": 0.4}  # of the steps of Kvaerno5, as jaxrotor has it by default
TIGHT, MOST = 1e-9, 2_000_000  # of the run that confirms the reference, and its steps in a window


class HeldBack:
    """Lanes of torque, with stops or without, each method giving data sets of a sweep."""

    def __init__(self, where: str, lanes: int, seconds: float, located: bool):
        rotor = jr.load("limiter-rotor").replace({"unbalance.eccentricity": ECCENTRICITY})
        self.where, self.located = where, located and where == "with stops"
        parts = (rotor if where == "with stops" else rotor.without("limiters")).effects
        drive = jr.Drive(FIRST, TORQUES[0], SLOPE, polar=POLAR, feedback=True)
        self.scene = jr.Scene(rotor.shaft, *parts, spin=drive)
        self.times = np.linspace(0.0, seconds, round(INTERVALS * seconds) + 1)
        self.torques = np.linspace(*TORQUES, lanes)
        self.right = self.exponential(REFERENCE[where], self.located)
        assert not failed(self.right.status).any()

    def swept(self, torques: np.ndarray | None = None, **how) -> xr.Dataset:
        """Largest radius of every window, and the speed at its end."""
        every = self.torques if torques is None else torques
        over, envelope = {"spin.torque": every}, [jr.observe.Envelope()]
        how |= {"times": self.times, "observe": envelope, "workers": 1, "progress": False}
        return jr.sweep(self.scene, over, **how)

    def exponential(self, steps: float, located: bool) -> xr.Dataset:
        solver = jr.Exponential(order=4, located=located)
        return self.swept(solver=solver, steps_per_revolution=int(steps))

    def kvaerno(self, rtol: float, torques: np.ndarray | None = None, **how) -> xr.Dataset:
        tolerances = {"rtol": jnp.asarray(rtol), "atol": jnp.asarray(ATOL * rtol)}
        steps = dfx.PIDController(**tolerances, **CONTROL)
        return self.swept(torques, solver=dfx.Kvaerno5(), controller=steps, **how)

    def errors(self, found: xr.Dataset) -> tuple[float, float]:
        """Largest error of the envelope over the peak of a lane, and of the speed over its largest.

        Both are infinite where a lane failed.
        """
        if failed(found.status).any():
            return np.inf, np.inf
        right = self.right.sel({"spin.torque": found["spin.torque"]})
        off = [
            (abs(found[name] - right[name]).max("window") / right[name].max("window")).max()
            for name in ("envelope", "speed")
        ]
        return float(off[0]), float(off[1])

    def confirmed(self) -> float:
        """Error of the reference against Kvaerno5 at a tight tolerance, on the first and the last lane."""
        return max(self.errors(self.kvaerno(TIGHT, self.torques[[0, -1]], max_steps=MOST)))

    def rows(
        self, settings: tuple[int, ...], target: float, repeats: int, diffrax: bool, log: Console
    ) -> list[dict]:
        """What every method takes at its setting for the target, by the error of the envelope."""
        ours = lambda located: functools.partial(self.exponential, located=located)
        methods = {"jaxrotor order 4": (ours(False), settings)}
        if self.located:
            methods["jaxrotor order 4 located"] = ours(True), settings
        if diffrax:
            methods["diffrax Kvaerno5"] = self.kvaerno, RTOLS[self.where]
        rows = []
        for name, (method, every) in methods.items():
            error = lambda found: self.errors(found)[0]
            reached = loosest(name, method, every, error, target, log)
            again = []
            run = lambda m=method, s=reached["setting"], a=again: a.append(m(s))
            seconds = quickest(run, repeats, time.process_time)
            row = {"scene": self.where, "method": name, "setting": reached["setting"]}
            row |= {"error": reached["error"], "of the speed": self.errors(again[0])[1]}
            row |= {key: reached[key] for key in ("first s", "compile s")}
            rows.append(row | {"processor ms a lane": 1e3 * seconds / self.torques.size})
        costs = [row["processor ms a lane"] for row in rows if row["error"] <= target]
        least = min(costs, default=np.nan)
        return [row | {"over the quickest": row["processor ms a lane"] / least} for row in rows]


def rotor_and_drive(full: bool, target: float, repeats: int, log: Console) -> list[dict]:
    """The rows of all methods, with stops and without; if not `full`, one method at one setting."""
    found = []
    for where, settings in STEPS.items():
        case = HeldBack(where, *((16, 2.0) if full else (2, 0.25)), full)
        if full:
            off = case.confirmed()
            log.print(f"{where}: the reference is off from Kvaerno5 at rtol {TIGHT:g} by {off:.0e}")
            if not off <= target / 10:
                raise SystemExit("The reference and Kvaerno5 differ, so no error can be told.")
        found += case.rows(settings if full else settings[2:3], target, repeats, full, log)
    return found
