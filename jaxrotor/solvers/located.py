"""Located steps: the instant at which a force changes its law splits the step there.

Between two such instants every force follows one smooth branch of its law, so an exponential step
keeps its order. A step is tried along the branches that hold at its start. Every condition of a
branch has a margin, positive while it holds; margins and rates at both ends of the step, free from
the ports, give cubics, and the first descent of one through zero is where the step ends instead.
What a cubic misses, `dt = -margin / rate` there, is put right by the jump of the force, so that
neither order nor derivatives feel how the instant was found:

    w <- w + B (f_before - f_after) dt
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
from .crossing import Crossing, first_end, leaves
from .lanes import one_lane
from .ports import PortForm, phase_at
from .tableau import AbstractStep, Tableau, step_of, tableau_of


NEAR = 1e-2  # of a full step: how far from a crossing it may be split
TRIES = 24  # substeps of one step; what is left after them is stepped as if nothing crossed
BLOCK = 16  # lanes whose splits run together


class Split(eqx.Module):
    """A step on its way: the state so far, and what was learnt from the span last tried."""

    y: Float[Array, " m2"]
    theta: Scalar
    left: Scalar
    span: Scalar  # tried last, from `theta`
    begin: Crossing
    end: Crossing
    branches: tuple[Branches, ...]
    tries: Int[Array, ""]


class LocatedStep(AbstractStep):
    """A step split where a force changes its law.

    The state of the solver counts the steps that more than `TRIES` splits did not resolve. `batch`:
    of lanes under `jax.vmap`, those that are split run together; otherwise one lane runs with all
    its tangents, which is what a Jacobian takes.
    """

    tableau: Tableau
    form: PortForm
    ports: BranchedPorts
    order_: int = eqx.field(static=True)
    batch: bool = eqx.field(static=True)

    @classmethod
    def build(cls, form: PortForm, order: int, h: Scalar, *, batch: bool = False) -> "LocatedStep":
        ports = BranchedPorts.build(form)
        tableau = tableau_of(order, form.basis, ports.contacts, h)
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
        seen = tableau.seen(phases, y[:, None], reading)
        fixed, turned = ports.contacts.reading.fixed, ports.contacts.reading.turned
        now, then = fixed(lambda: phases[0], seen[0][:, 0]), seen[-1][:, 0]
        branches = ports.branches(now)

        def force(stage: Array, time: int) -> Array:
            found = ports.forces(branches, fixed(lambda: phases[time], stage[:, 0]))
            return turned(lambda: phases[time], found)[:, None]

        fed = tableau.fed(seen, force)[:, 0]
        y1 = self.tableau.advance(y) + fed
        finish = fixed(lambda: phases[-1], then + as_real(ports.contacts.see) @ fed)
        begin, end = ports.crossing(branches, now), ports.crossing(branches, finish)
        whole = ~jnp.any(leaves(begin, end, h))
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
        """Go where the first condition ends, or as far as is left, and see whether that was right."""
        h, ports, branches = self.tableau.h, self.ports, split.branches
        exhausted = split.tries >= TRIES
        share = first_end(split.begin, split.end, split.span)
        span = jnp.where(exhausted | (share > 1), split.left, share * split.span)
        see = lambda w, after: ports.read(w, split.theta + after)
        basis, reading = self.form.basis, ports.contacts.reading
        along = lambda force, after: unpacked(
            basis, reading.turned(lambda: phase_at(split.theta + after), force)
        )

        def act(w, after):
            seen = see(w, after)
            found = jnp.where(exhausted, ports.as_they_are(seen), ports.forces(branches, seen))
            return along(found, after)

        w = unpacked(basis, split.y)
        begin = ports.crossing(branches, see(w, 0.0))
        w = step_of(self.order_, basis, ports.contacts.drive, w, span, act)
        finish = see(w, span)
        end = ports.crossing(branches, finish)
        leaving = leaves(begin, end, span)
        # Which conditions end here, and how far off: on the grid late alone, between it early too.
        last = span >= split.left
        off = -end.margin / jnp.where(end.rate < 0, end.rate, -1.0)
        ends = (end.rate < 0) & (jnp.abs(off) < NEAR * h) & (~last | (end.margin <= 0))
        first = jnp.argmin(jnp.where(ends, off, jnp.inf))
        ends &= (jnp.arange(ends.size) == first) & ~exhausted
        taken = exhausted | ~jnp.any(leaving & ~ends)
        after = self._turned(ends, end, branches, finish)
        jump = along(ports.forces(branches, finish) - ports.forces(after, finish), span)
        w = w + ports.contacts.drive @ (jump * jnp.sum(jnp.where(ends, off, 0.0)))
        left = jnp.where(last, 0.0, split.left - span)
        keep = lambda new, old: jax.tree.map(lambda a, b: jnp.where(taken, a, b), new, old)
        # What comes next is not known after a span that was taken: try all that is left.
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

    def _turned(self, ends: Bool[Array, " c"], end: Crossing, branches, seen: Array):
        """Branches after some conditions end; those that were no matter are looked up."""
        flat, rebuild = ravel_pytree(branches)
        now, _ = ravel_pytree(self.ports.branches(seen))
        stay = jnp.where(jnp.isfinite(end.margin), flat, now)
        return rebuild(jnp.where(ends, 1 - flat, stay))


def _finish(step: LocatedStep, split: Split) -> Split:
    """Attempts until nothing is left; of many lanes, blocks of those that still go on."""
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
            lanes = jnp.where(left > 0, lanes, size)  # none: out of range, dropped
            take = lambda leaf: leaf.at[lanes].get(mode="clip")
            some = [
                take(leaf) if is_own else leaf for leaf, is_own in zip(leaves, own, strict=True)
            ]
            went = jax.vmap(attempt, in_axes=(axes, 0))(some, jax.tree.map(take, split))
            put = lambda old, new: old.at[lanes].set(new, mode="drop")
            return jax.tree.map(put, split, went)

        split = jax.lax.while_loop(lambda s: jnp.any(s.left > 0), block, split)
        return split, jax.tree.map(lambda _: True, split)

    return run(leaves, split)
