"""March: a motion made ready to step, revolution after revolution."""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float

from .motion import Motion
from .quantities import Scalar
from .scene import Scene
from .solvers.exponential import Exponential, ExponentialForm, ExponentialStep, Tableau
from .solvers.form import AbstractForm, PhysicalForm
from .solvers.stiff import step_control, tuned
from .start import AbstractStart
from .system import System, assemble


class Plan(eqx.Module):
    """What is decided before anything is traced: solver, steps, and which contacts share a port."""

    solver: Exponential | dfx.AbstractSolver
    controller: dfx.AbstractStepSizeController | None
    adjoint: dfx.AbstractAdjoint
    max_steps: int = eqx.field(static=True)  # of an adaptive solver, in one revolution
    steps: int = eqx.field(static=True)  # samples a revolution; fixed solvers step them
    slopes: bool = eqx.field(static=True)  # whether slopes are read besides displacements
    contacts: bool = eqx.field(static=True)  # whether ports are read
    together: tuple[tuple[int, ...], ...] = eqx.field(static=True)


class Orbit(eqx.Module):
    """One revolution seen at the stations, its first and last samples included."""

    displacement: Complex[Array, "T s"]  # [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    slope: Complex[Array, "T s"] | None
    contact_force: Complex[Array, "T k"] | None  # [N]
    seconds: Scalar  # in a radian of revolution
    s: Scalar  # sign of the spin


class March(eqx.Module):
    """One scene's motion from revolution to revolution.

    Time restarts at zero with every revolution, so the phase of the unbalance is exact however
    long the run.
    """

    system: System
    stations: Float[Array, " s"]
    form: AbstractForm
    plan: Plan
    step: ExponentialStep | None

    @classmethod
    def build(cls, scene: Scene, plan: Plan, rate: Scalar, stations: Float[Array, " s"]) -> "March":
        """Assemble a scene for a plan; `rate` is 2 pi over the length of a revolution."""
        system = assemble(scene, plan.together)
        motion = Motion(system, rate)
        rows = [jax.vmap(system.line.row)(stations)]
        if plan.slopes:
            rows.append(jax.vmap(system.line.slope_row)(stations))
        if plan.contacts and motion.rows is not None:
            rows.append(motion.rows)
        rows = jnp.concatenate(rows)
        if not isinstance(plan.solver, Exponential):
            return cls(system, stations, PhysicalForm(motion, rows), plan, None)
        form = plan.solver.form(motion, rows)
        if form.ports is None:
            return cls(system, stations, form, plan, None)
        order = plan.solver.order
        h = jnp.asarray(2 * jnp.pi / plan.steps)
        return cls(
            system,
            stations,
            form,
            plan,
            ExponentialStep(Tableau.build(form, h, order), form.field, order),
        )

    def begin(self, start: AbstractStart, at: Scalar) -> Array:
        """State of the form at the start."""
        return self.form.encode(*start.state(self.system, at))

    def skip(self, y: Array, revolutions: int) -> tuple[Array, Bool[Array, ""]]:
        """State after whole revolutions, and whether every one of them succeeded."""
        if self._free():
            return self.form.fly(y, revolutions), jnp.array(True)

        def turn(carry, _):
            y, good = carry
            end, _, ok = self._solve(y, sample=False)
            return (end, good & ok), None

        (y, good), _ = self._scan(turn, (y, jnp.array(True)), revolutions)
        return y, good

    def sample(self, y: Array) -> tuple[Array, Float[Array, "S+1 2 2 s"], Bool[Array, ""]]:
        """One revolution: state at its end, stations at its S + 1 samples, success."""
        if not self._free():
            return self._solve(y, sample=True)
        grid, small = self._grid(), jnp.asarray(2 * jnp.pi / self.plan.steps)
        b = jnp.zeros((y.size // 2, 0), complex)
        advance = self.form.basis.step(self.form.basis.flow(small, b, 0)[0])

        def hop(y, theta):
            return advance(y), self.form.read(theta, y)

        y, samples = jax.lax.scan(hop, y, grid[:-1])
        last = self.form.read(grid[-1], y)
        return y, jnp.concatenate([samples, last[None]]), jnp.array(True)

    def collect(self, y: Array, carry, update, revolutions: int):
        """Carry through whole revolutions: `carry, out = update(carry, orbit)` at each."""

        def turn(state, _):
            y, carry, good = state
            y, samples, ok = self.sample(y)
            carry, out = update(carry, self.orbit(samples))
            return (y, carry, good & ok), out

        return self._scan(turn, (y, carry, jnp.array(True)), revolutions)

    def orbit(self, samples: Float[Array, "S+1 2 2 r"]) -> "Orbit":
        """What the samples of a revolution say, by name."""
        seen = samples[:, 0] + 1j * samples[:, 1]  # (S + 1, displacement or velocity, rows)
        s = self.stations.size
        displacement, velocity = seen[:, 0], seen[:, 1]
        forces = None
        if self.plan.contacts and self.system.ports:
            p = len(self.system.ports)
            ports = jnp.moveaxis(samples[..., -p:], 1, -1)  # (S + 1, 2, p, xy)
            vectors = jax.vmap(self.system.contact_forces)(ports[:, 0], ports[:, 1])
            forces = vectors[..., 0] + 1j * vectors[..., 1]
        slope = displacement[:, s : 2 * s] if self.plan.slopes else None
        motion = self.form.motion
        return Orbit(displacement[:, :s], velocity[:, :s], slope, forces, 1 / motion.rate, motion.s)

    def _free(self) -> bool:
        """A linear scene: nothing to step."""
        return self.step is None and isinstance(self.form, ExponentialForm)

    def _grid(self) -> Float[Array, " S+1"]:
        return jnp.linspace(0.0, 2 * jnp.pi, self.plan.steps + 1)

    def _scan(self, body, carry, length: int):
        if not isinstance(self.plan.adjoint, dfx.ForwardMode):
            body = jax.checkpoint(body)
        return jax.lax.scan(body, carry, None, length=length)

    def _solve(self, y: Array, *, sample: bool):
        plan, grid = self.plan, self._grid()
        read = lambda theta, y, args: self.form.read(theta, y)
        solver = self.step or tuned(plan.solver)
        controller = None if self.step else plan.controller or step_control(plan.solver)
        end = dfx.SubSaveAt(t1=True)
        if controller is None:  # a fixed grid: every step is a sample
            controller, max_steps = dfx.StepTo(ts=grid), plan.steps
            path = dfx.SubSaveAt(t0=True, steps=True, fn=read)
        else:
            max_steps = plan.max_steps
            path = dfx.SubSaveAt(ts=grid, fn=read)
        fixed = isinstance(controller, dfx.StepTo)
        solution = dfx.diffeqsolve(
            dfx.ODETerm(self.form.field),
            solver,
            t0=0.0,
            t1=grid[-1],
            dt0=None if fixed else grid[1],
            y0=y,
            saveat=dfx.SaveAt(subs=[end, path] if sample else [end]),
            stepsize_controller=controller,
            adjoint=plan.adjoint,
            max_steps=max_steps,
            throw=False,
        )
        ok = solution.result == dfx.RESULTS.successful
        y1 = solution.ys[0][-1]
        return y1, solution.ys[1] if sample else None, ok & jnp.all(jnp.isfinite(y1))
