"""Located steps: a step is split at the instants at which a force changes its branch.

Between two such instants every force follows one smooth branch of its law, so an exponential step
keeps its order. A step is tried along the branches that hold at its start. Every condition of a
branch has a margin, positive while it holds; margins and rates at both ends of the step, which the
readings of the ports give, define cubics, and the step ends at the first descent of one through zero.
The error of a cubic there, `dt = -margin / rate`, is corrected by the jump of the force, so that neither
order nor derivatives depend on how the instant was found:

    w <- w + B (f_before - f_after) dt

See docs/concepts/lanes.md for lanes that are split at different instants.
"""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from ..core.quantities import Scalar
from ..equations.system import Branches
from .basis import as_real, packed, unpacked
from .branches import BranchedPorts
from .crossing import Crossing, falls_through_zero, first_crossing
from .lanes import one_lane
from .ports import PortForm, phase_at
from .tableau import AbstractStep, Tableau, step_of, tableau_of


NEAR = 1e-2  # of a full step: largest distance of a split from the crossing
TRIES = 24  # most attempts in one step; the rest is then stepped without splitting
BLOCK = 16  # lanes whose splits run at once


class Split(eqx.Module):
    """State of a partly completed step, and the crossings found in the span last tried."""

    y: Float[Array, " m2"]
    theta: Scalar
    left: Scalar  # of the step [rad]
    span: Scalar  # tried last, from `theta`
    begin: Crossing
    end: Crossing
    branches: tuple[Branches, ...]
    tries: Int[Array, ""]


class LocatedStep(AbstractStep):
    """A step that is split where a force changes its branch.

    The state of the solver counts the steps that `TRIES` attempts did not resolve. With `batch`, lanes
    under `jax.vmap` that are split run at once; otherwise one lane runs with all its tangents, as a
    Jacobian needs.
    """

    tableau: Tableau
    form: PortForm
    ports: BranchedPorts
    order_: int = eqx.field(static=True)
    batch: bool = eqx.field(static=True)

    @classmethod
    def build(cls, form: PortForm, order: int, h: Scalar, *, batch: bool = False) -> "LocatedStep":
        ports = BranchedPorts.build(form)
        own = ports.contacts
        tableau = tableau_of(order, form.basis, own.output_matrix, own.input_matrix, h)
        return cls(tableau=tableau, form=form, ports=ports, order_=order, batch=batch)

    def init(self, terms, t0, t1, y0, args) -> Int[Array, ""]:
        del terms, t0, t1, y0, args
        return jnp.zeros((), int)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del terms, t1, args, made_jump
        y1, unresolved = self.advance(jnp.asarray(t0), y0)
        return y1, None, {"y0": y0, "y1": y1}, solver_state + unresolved, dfx.RESULTS.successful

    def advance(self, theta: Scalar, y: Array) -> tuple[Array, Int[Array, ""]]:
        """State after a full step from `theta`, and 1 if it is not resolved."""
        h, ports = self.tableau.h, self.ports
        tableau, reading = one_lane((self.tableau, ports.contacts.reading))
        phases = self.tableau.phases(theta)
        free = tableau.free_readings(phases, y[:, None], reading)
        fixed, turned = ports.contacts.reading.fixed, ports.contacts.reading.turned
        now, then = fixed(lambda: phases[0], free[0][:, 0]), free[-1][:, 0]
        at = lambda time: ports.at(lambda: phases[time])
        branches = at(0).branches(now)

        def force(stage: Array, time: int) -> Array:
            phase = lambda: phases[time]
            return turned(phase, at(time).forces(branches, fixed(phase, stage[:, 0])))[:, None]

        added = tableau.increment(free, force)[:, 0]
        y1 = self.tableau.advance(y) + added
        finish = fixed(lambda: phases[-1], then + as_real(ports.contacts.output_matrix) @ added)
        begin, end = at(0).crossing(branches, now), at(-1).crossing(branches, finish)
        whole = ~jnp.any(falls_through_zero(begin, end, h))
        split = Split(
            jnp.where(whole, y1, y),
            theta,
            jnp.where(whole, 0.0, h),
            h,
            begin,
            end,
            branches,
            jnp.zeros((), int),
        )
        split = _finish(self, split)
        return split.y, (split.tries > TRIES) + 0

    def attempt(self, split: Split) -> Split:
        """Step to the first crossing or the end; accepted unless another crossing is on the way."""
        h, ports, branches = self.tableau.h, self.ports, split.branches
        exhausted = split.tries >= TRIES
        share = first_crossing(split.begin, split.end, split.span)
        span = jnp.where(exhausted | (share > 1), split.left, share * split.span)
        input_matrix = ports.contacts.input_matrix
        basis, turned = self.form.basis, ports.contacts.reading.turned
        read = lambda w, after: ports.read(w, split.theta + after)

        def applied(force, after):  # as the input matrix takes it
            return unpacked(basis, turned(lambda: phase_at(split.theta + after), force))

        at = lambda after: ports.at(lambda: phase_at(split.theta + after))

        def force(w, after):
            seen, here = read(w, after), at(after)
            found = jnp.where(exhausted, here.actual_forces(seen), here.forces(branches, seen))
            return applied(found, after)

        w = unpacked(basis, split.y)
        begin = at(0.0).crossing(branches, read(w, 0.0))
        w = step_of(self.order_, basis, input_matrix, w, span, force)
        finish, there = read(w, span), at(span)
        end = there.crossing(branches, finish)
        falling = falls_through_zero(begin, end, span)
        # The condition that ends here, and its distance; at the end of the step it must be past.
        last = span >= split.left
        off = -end.margin / jnp.where(end.rate < 0, end.rate, -1.0)
        ends = (end.rate < 0) & (jnp.abs(off) < NEAR * h) & (~last | (end.margin <= 0))
        first = jnp.argmin(jnp.where(ends, off, jnp.inf))
        ends &= (jnp.arange(ends.size) == first) & ~exhausted
        accepted = exhausted | ~jnp.any(falling & ~ends)
        after = _branches_after(there, ends, end, branches, finish)
        jump = applied(there.forces(branches, finish) - there.forces(after, finish), span)
        w = w + input_matrix @ (jump * jnp.sum(jnp.where(ends, off, 0.0)))
        left = jnp.where(last, 0.0, split.left - span)
        keep = lambda new, old: jax.tree.map(lambda a, b: jnp.where(accepted, a, b), new, old)
        # After an accepted span nothing is known of the next crossing: the rest is tried whole.
        unknown = jax.tree.map(lambda one: jnp.full_like(one, jnp.inf), end)
        return Split(
            keep(packed(w), split.y),
            keep(split.theta + span, split.theta),
            keep(left, split.left),
            span,
            keep(unknown, begin),
            keep(unknown, end),
            keep(after, branches),
            split.tries + 1,
        )


def _branches_after(
    ports: BranchedPorts, ends: Bool[Array, " c"], end: Crossing, branches, seen: Array
):
    """Branches after some conditions end; inactive conditions are evaluated anew."""
    flat, rebuild = ravel_pytree(branches)
    now, _ = ravel_pytree(ports.branches(seen))
    stay = jnp.where(jnp.isfinite(end.margin), flat, now)
    return rebuild(jnp.where(ends, 1 - flat, stay))


def _finish(step: LocatedStep, split: Split) -> Split:
    """Attempts until the step is complete; of many lanes, by blocks of those that are not."""
    if not step.batch:
        return jax.lax.while_loop(lambda s: s.left > 0, lambda s: step.attempt(s), split)
    arrays, constant = eqx.partition(step, eqx.is_array)
    leaves, treedef = jax.tree.flatten(arrays)
    attempt = lambda leaves, split: eqx.combine(
        jax.tree.unflatten(treedef, leaves), constant
    ).attempt(split)

    @jax.custom_batching.custom_vmap
    def run(leaves, split):
        return jax.lax.while_loop(lambda s: s.left > 0, lambda s: attempt(leaves, s), split)

    @run.def_vmap
    def _(size, batched, leaves, split):
        own, given = batched
        split = jax.tree.map(
            lambda leaf, is_own: leaf if is_own else jnp.broadcast_to(leaf, (size, *leaf.shape)),
            split,
            given,
        )
        axes = [0 if is_own else None for is_own in own]

        def block(split):
            left, lanes = jax.lax.top_k(split.left, min(size, BLOCK))
            lanes = jnp.where(left > 0, lanes, size)  # complete lanes: out of range, dropped
            take = lambda leaf: leaf.at[lanes].get(mode="clip")
            some = [
                take(leaf) if is_own else leaf for leaf, is_own in zip(leaves, own, strict=True)
            ]
            tried = jax.vmap(attempt, in_axes=(axes, 0))(some, jax.tree.map(take, split))
            put = lambda old, new: old.at[lanes].set(new, mode="drop")
            return jax.tree.map(put, split, tried)

        split = jax.lax.while_loop(lambda s: jnp.any(s.left > 0), block, split)
        return split, jax.tree.map(lambda _: True, split)

    return run(leaves, split)
