"""Located steps: the instant at which a force changes its law splits the step there.

Between two such instants every force follows one smooth branch of its law, so an exponential step
keeps its order. A step is tried along the branches that hold at its start. Every condition of a
branch has a margin, positive while it holds; margins and rates at both ends of the step, free from
the ports, give cubics, and the first descent of one through zero is where the step ends instead.
What a cubic misses, `dt = -margin / rate` there, is put right by the jump of the force, so that
neither order nor derivatives feel how the instant was found:

    w <- w + B (f_before - f_after) dt
"""

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ..quantities import Scalar
from ..system import Branches
from .basis import as_complex, as_real
from .branches import BranchedPorts, Crossing
from .exponential import Tableau, tableau_of
from .ports import PortForm


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


class LocatedStep(dfx.AbstractSolver):
    """A tableau as a diffrax solver, split where a force changes its law.

    The state of the solver counts the steps that more than `TRIES` splits did not resolve.
    """

    tableau: Tableau
    form: PortForm
    ports: BranchedPorts
    order_: int = eqx.field(static=True)

    term_structure: ClassVar = dfx.ODETerm
    interpolation_cls: ClassVar[Callable[..., Any]] = dfx.LocalLinearInterpolation

    @classmethod
    def build(cls, form: PortForm, order: int, h: Scalar) -> "LocatedStep":
        ports = BranchedPorts.build(form)
        return cls(tableau_of(order, form.basis, ports.contacts, h), form, ports, order)

    def order(self, terms) -> int:
        del terms
        return self.order_

    def init(self, terms, t0, t1, y0, args) -> Int[Array, ""]:
        del terms, t0, t1, y0, args
        return jnp.zeros((), int)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del terms, t1, args, made_jump
        y1, unresolved = self.advance(jnp.asarray(t0), y0)
        return y1, None, {"y0": y0, "y1": y1}, solver_state + unresolved, dfx.RESULTS.successful

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)

    def advance(self, theta: Scalar, y: Array) -> tuple[Array, Int[Array, ""]]:
        """State after a full step from `theta`, and 1 if it is not resolved."""
        h, ports = self.tableau.h, self.ports
        seen = self._look(self.tableau, theta, y)
        branches = ports.branches(seen[0])
        forces = lambda stage: ports.forces(branches, stage)
        y1, end = self._stages(self.tableau, y, seen, forces)
        begin, end = ports.crossing(branches, seen[0]), ports.crossing(branches, end)
        whole = ~jnp.any(_leaves(begin, end, h))
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
        share = _first_end(split.begin, split.end, split.span)
        span = jnp.where(exhausted | (share > 1), split.left, share * split.span)
        see = lambda w, after: ports.read(w, split.theta + after)

        def force(seen):
            found = jnp.where(exhausted, ports.as_they_are(seen), ports.forces(branches, seen))
            return as_complex(found)

        w = as_complex(split.y)
        begin = ports.crossing(branches, see(w, 0.0))
        w = (_step4 if self.order_ == 4 else _step2)(
            self.form.basis, ports.contacts.drive, w, span, lambda w, c: force(see(w, c))
        )
        finish = see(w, span)
        end = ports.crossing(branches, finish)
        leaving = _leaves(begin, end, span)
        # Which conditions end here, and how far off: on the grid late alone, between it early too.
        last = span >= split.left
        off = -end.margin / jnp.where(end.rate < 0, end.rate, -1.0)
        ends = (end.rate < 0) & (jnp.abs(off) < NEAR * h) & (~last | (end.margin <= 0))
        first = jnp.argmin(jnp.where(ends, off, jnp.inf))
        ends &= (jnp.arange(ends.size) == first) & ~exhausted
        taken = exhausted | ~jnp.any(leaving & ~ends)
        after = self._turned(ends, end, branches, finish)
        jump = as_complex(ports.forces(branches, finish) - ports.forces(after, finish))
        w = w + ports.contacts.drive @ (jump * jnp.sum(jnp.where(ends, off, 0.0)))
        left = jnp.where(last, 0.0, split.left - span)
        keep = lambda new, old: jax.tree.map(lambda a, b: jnp.where(taken, a, b), new, old)
        # What comes next is not known after a span that was taken: try all that is left.
        unknown = jax.tree.map(lambda one: jnp.full_like(one, jnp.inf), end)
        return Split(
            keep(jnp.concatenate([w.real, w.imag]), split.y),
            keep(split.theta + span, split.theta),
            keep(left, split.left),
            span,
            keep(unknown, begin),
            keep(unknown, end),
            keep(after, branches),
            split.tries + 1,
        )

    def _look(self, tableau: Tableau, theta: Scalar, y: Array) -> list[Array]:
        """Ports at the times of the stages without contact: at 0 first, at the end last."""
        seen = (tableau.look.reshape(-1, y.size) @ y).reshape(len(tableau.times), -1)
        steady = self.ports.contacts.reading.steady
        return [
            one + steady(theta + c * tableau.h) for one, c in zip(seen, tableau.times, strict=True)
        ]

    def _stages(self, tableau: Tableau, y: Array, seen: list[Array], forces: Callable):
        """State at the end of a step and ports there."""
        found: list[Array] = []
        for time, echo in zip(tableau.stages, tableau.echo, strict=True):
            stage = seen[time]
            for earlier, gain in echo.items():
                stage = stage + gain @ found[earlier]
            found.append(forces(stage))
        fed = tableau.feed @ jnp.concatenate(found)
        return tableau.advance(y) + fed, seen[-1] + as_real(self.ports.contacts.see) @ fed

    def _turned(self, ends: Bool[Array, " c"], end: Crossing, branches, seen: Array):
        """Branches after some conditions end; those that were no matter are looked up."""
        flat, rebuild = jax.flatten_util.ravel_pytree(branches)
        now, _ = jax.flatten_util.ravel_pytree(self.ports.branches(seen))
        stay = jnp.where(jnp.isfinite(end.margin), flat, now)
        return rebuild(jnp.where(ends, 1 - flat, stay))


def _step2(basis, drive, w, span, force: Callable):
    """ETDRK2 of any length, eq. (22)."""
    flow, (one, two) = basis.flow(span, drive, 2)
    f = force(w, 0.0)
    a = basis.apply(flow, w[:, None])[:, 0] + one @ f
    return a + two @ (force(a, span) - f)


def _step4(basis, drive, w, span, force: Callable):
    """ETDRK4 of any length, eqs. (26)-(29)."""
    middle, (half,) = basis.flow(span / 2, drive, 1)
    flow, (one, two, three) = basis.flow(span, drive, 3)
    go = lambda flow, w: basis.apply(flow, w[:, None])[:, 0]
    f, there = force(w, 0.0), go(middle, w)
    a = there + half @ f
    fa = force(a, span / 2)
    fb = force(there + half @ fa, span / 2)
    fc = force(go(middle, a) + half @ (2 * fb - f), span)
    return (
        go(flow, w)
        + one @ f
        + two @ (2 * (fa + fb) - 3 * f - fc)
        + three @ (4 * (f - fa - fb + fc))
    )


class Cubic(NamedTuple):
    """`c0 + c1 u + c2 u^2 + c3 u^3`: a margin over the share `u` of a span."""

    c0: Array
    c1: Array
    c2: Array
    c3: Array

    @classmethod
    def of(cls, begin: Crossing, end: Crossing, span: Scalar) -> "Cubic":
        """By values and rates at both ends; constant where it is no matter."""
        matters = jnp.isfinite(begin.margin) & jnp.isfinite(end.margin)
        m0, m1 = (jnp.where(matters, one.margin, 1.0) for one in (begin, end))
        r0, r1 = (jnp.where(matters, one.rate, 0.0) * span for one in (begin, end))
        return cls(m0, r0, 3 * (m1 - m0) - 2 * r0 - r1, 2 * (m0 - m1) + r0 + r1)

    def __call__(self, u: Array | float) -> Array:
        return self.c0 + u * (self.c1 + u * (self.c2 + u * self.c3))

    def slope(self, u: Array) -> Array:
        return self.c1 + u * (2 * self.c2 + u * 3 * self.c3)

    def extrema(self) -> tuple[Array, Array]:
        """Where it is greatest and where least between 0 and 1; 0 where there is none."""
        square = self.c2**2 - 3 * self.c1 * self.c3
        turns = square > 0
        root = jnp.sqrt(jnp.where(turns, square, 1.0))
        q = self.c2 + jnp.where(self.c2 < 0, -root, root)  # no difference of near equals
        far, near = _ratio(-q, 3 * self.c3), _ratio(-self.c1, q)
        clip = lambda u: jnp.clip(jnp.where(turns, u, 0.0), 0.0, 1.0)
        up = self.c2 < 0  # then `far` is the minimum
        return clip(jnp.where(up, near, far)), clip(jnp.where(up, far, near))


def _ratio(a: Array, b: Array) -> Array:
    return jnp.where(b == 0, 0.0, a / jnp.where(b == 0, 1.0, b))


def _leaves(begin: Crossing, end: Crossing, span: Scalar) -> Bool[Array, " c"]:
    """Which margins descend through zero within the span."""
    cubic = Cubic.of(begin, end, span)
    top, bottom = cubic.extrema()
    end_falls = (cubic(1.0) < 0) & (cubic(1.0) < jnp.maximum(cubic.c0, cubic(top)))
    return end_falls | ((cubic(bottom) < 0) & (cubic(bottom) < cubic.c0))


def _first_end(begin: Crossing, end: Crossing, span: Scalar) -> Scalar:
    """Share of the span at which a margin first descends through zero, 2 if none does.

    A cubic is monotone from 0 to one extremum, to the other, to 1.
    """
    cubic = Cubic.of(begin, end, span)
    low, high = cubic.extrema()
    low, high = jnp.minimum(low, high), jnp.maximum(low, high)
    nodes = (jnp.zeros_like(low), low, high, jnp.ones_like(low))
    a, b = jnp.full_like(low, 2.0), jnp.full_like(low, 2.0)
    for begin_, end_ in ((nodes[2], nodes[3]), (nodes[1], nodes[2]), (nodes[0], nodes[1])):
        falls = (cubic(end_) < 0) & (cubic(end_) < cubic(begin_))
        a, b = jnp.where(falls, begin_, a), jnp.where(falls, end_, b)
    leaving, start = a < 2, a
    for _ in range(3):
        middle = (a + b) / 2
        above = cubic(middle) > 0
        a, b = jnp.where(above, middle, a), jnp.where(above, b, middle)
    u = (a + b) / 2
    for _ in range(4):
        rate = cubic.slope(u)
        u = jnp.clip(u - cubic(u) / jnp.where(rate < 0, rate, -jnp.inf), a, b)
    u = jnp.where(cubic(start) <= 0, start, u)  # just begun, and ends at once
    return jnp.min(jnp.where(leaving, u, 2.0), initial=2.0)


def _finish(step: LocatedStep, split: Split) -> Split:
    """Attempts until nothing is left; of many lanes, blocks of those that still go on."""
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
