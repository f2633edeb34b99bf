"""Contact by the events of diffrax, against plain steps and located ones, on the backward rub.

    python benchmarks/events.py
    python benchmarks/events.py --revolutions 1 --quick

A diffrax event ends a solve where a margin of the contact law falls through zero, found by its root
finder; the solve then goes on along the next branch, from Python, a lane at a time. Errors are those
of the state after `--revolutions`, relative, against located steps of order 4, 4096 a revolution.
"""

import argparse
import time

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax.flatten_util import ravel_pytree
from peers import rotor
from rich.console import Console
from rich.table import Table

import jaxrotor as jr
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.solvers.control import tuned
from jaxrotor.solvers.exponential import Exponential
from jaxrotor.solvers.located import Along, LocatedStep
from jaxrotor.solvers.step import Part


SCENE = rotor.SCENE.replace({"unbalance.eccentricity": rotor.LARGEST})


class Switched(eqx.Module):
    """The rotor along given branches of its contact law, and when they end."""

    step: LocatedStep

    def at(self, theta):
        return self.step.forcing.at(theta, Part(0.0, self.step.tableau.h))

    def rate(self, theta, y, branches):
        generator = self.step.forcing.field.generator
        return generator @ y + self.step.change(self.at(theta), Along(branches), y)

    def branches(self, theta, y):
        return self.step.branches(self.at(theta), y)

    def margins(self, theta, y, branches):
        return self.step.crossing(self.at(theta), branches, y).margin

    def margin(self, t, y, args, **_):
        return jnp.min(self.margins(t, y, args))

    def next(self, theta, y, branches):
        """The branches after the one that is nearest its end there."""
        margin = self.margins(theta, y, branches)
        flat, rebuild = ravel_pytree(branches)
        now, _ = ravel_pytree(self.branches(theta, y))
        flat = jnp.where(jnp.isfinite(margin), flat, now)
        ends = jnp.argmin(jnp.abs(margin))
        return rebuild(flat.at[ends].set(1 - flat[ends]))


@eqx.filter_jit
def segment(switched: Switched, theta, end, y, branches, solver, rtol):
    """Until a branch ends: time, state, next branches, steps."""
    event = dfx.Event(switched.margin, optx.Bisection(1e-10, 1e-9), direction=False)
    found = dfx.diffeqsolve(
        dfx.ODETerm(switched.rate), solver, theta, end, None, y, branches, event=event,
        stepsize_controller=dfx.PIDController(rtol=rtol, atol=1e-3 * rtol), max_steps=10**6,
    )  # fmt: skip
    theta, y = found.ts[-1], found.ys[-1]
    return theta, y, switched.next(theta, y, branches), found.stats["num_steps"]


def by_events(form, y, solver, rtol, revolutions: int):
    step = Exponential(4, "modal", located=True).stepper(form, 32)
    switched, end = Switched(step), jnp.asarray(2 * np.pi * revolutions)
    theta, steps, events = jnp.zeros(()), 0, 0
    branches = switched.branches(theta, y)
    while theta < end:
        theta, y, branches, more = segment(switched, theta, end, y, branches, solver, rtol)
        steps, events = steps + int(more), events + 1
    return y, steps, events - 1


@eqx.filter_jit
def plain(form, y, solver, rtol, revolutions):
    found = dfx.diffeqsolve(
        dfx.ODETerm(form.field), solver, 0.0, 2 * np.pi * revolutions, None, y,
        stepsize_controller=dfx.PIDController(rtol=rtol, atol=1e-3 * rtol), max_steps=10**6,
    )  # fmt: skip
    return found.ys[-1], found.stats["num_steps"]


def exponential(choice: Exponential, steps: int, revolutions: int):
    return jr.simulate(SCENE, revolutions, steps, solver=choice, start=rotor.settled(), keep=1).end


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--revolutions", type=int, default=4)
    parser.add_argument("--quick", action="store_true", help="one tolerance, one solver")
    args = parser.parse_args()
    system = jr.assemble(SCENE)
    motion = Motion(system, jnp.abs(SCENE.spin.speed))
    form = Exponential(4, "modal").form(system, motion, jnp.eye(system.n))
    start = rotor.settled()
    y0 = form.encode(start.q, start.velocity)
    truth = np.asarray(exponential(Exponential(4, located=True), 4096, args.revolutions).q)
    shown = Table(title=f"Backward rub, {args.revolutions} revolutions, one lane")
    for head in ("method", "setting", "error", "steps a revolution", "events", "ms a revolution"):
        shown.add_column(head, justify="left" if head in ("method", "setting") else "right")

    def add(name, setting, run):
        run()
        begun = time.perf_counter()
        q, steps, events = run()
        ms = 1e3 * (time.perf_counter() - begun) / args.revolutions
        off = np.abs(np.asarray(q) - truth).max() / np.abs(truth).max()
        shown.add_row(
            name, setting, f"{off:.1e}", f"{steps / args.revolutions:.0f}", str(events), f"{ms:.3g}"
        )

    solvers = {"Kvaerno5": tuned(dfx.Kvaerno5()), "Tsit5": dfx.Tsit5()}
    for name, solver in list(solvers.items())[: 1 if args.quick else None]:
        for rtol in (1e-6,) if args.quick else (1e-4, 1e-6, 1e-8):

            def switched(solver=solver, rtol=rtol):
                y, steps, events = by_events(form, y0, solver, rtol, args.revolutions)
                return form.decode(y)[0], steps, events

            def alone(solver=solver, rtol=rtol):
                y, steps = jax.block_until_ready(plain(form, y0, solver, rtol, args.revolutions))
                return form.decode(y)[0], int(steps), "-"

            add(f"{name}, plain", f"rtol {rtol:g}", alone)
            add(f"{name}, events", f"rtol {rtol:g}", switched)
    for located in (False, True):
        for steps in (64, 256):

            def ours(located=located, steps=steps):
                end = exponential(Exponential(4, located=located), steps, args.revolutions)
                return jax.block_until_ready(end.q), steps * args.revolutions, "-"

            add(f"Exponential(4{', located' * located})", f"{steps} steps", ours)
    Console(highlight=False, width=120).print(shown)


if __name__ == "__main__":
    main()
