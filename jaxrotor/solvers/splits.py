"""Splits: a step that ends, and begins anew, at the instants at which a force changes its branch.

Between two such instants every force follows one smooth branch of its law, so an exponential step
keeps its order. A step is tried along the branches that hold at its start. Every condition of a
branch has a margin, positive while it holds; margins and rates at both ends of the step, which the
readings of the ports give, define cubics, and the step ends at the first descent of one through zero.
The error of a cubic there, `dt = -margin / rate`, is corrected by the jump of the force, so that neither
order nor derivatives depend on how the instant was found:

    w <- w + B (f_before - f_after) dt

See docs/concepts/lanes.md for lanes that are split at different instants.
"""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Inexact, Int

from ..core.quantities import Scalar
from ..equations.system import Branches
from .basis import Basis, BasisWithOthers, packed, unpacked
from .branches import BranchedPorts
from .crossing import Crossing, falls_through_zero, first_crossing
from .tableau import Force


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

    @property
    def unresolved(self) -> Int[Array, ""]:
        """1 where the attempts did not complete the step."""
        return (self.tries > TRIES) + 0


class AbstractInstant(eqx.Module):
    """The ports of a rotor at an instant of a step."""

    ports: eqx.AbstractVar[BranchedPorts]

    @abc.abstractmethod
    def read(self, w: Inexact[Array, " m"]) -> Float[Array, " p6"]:
        """Readings of the ports in a state, along fixed axes."""

    @abc.abstractmethod
    def crossing(self, branches: tuple[Branches, ...], seen: Float[Array, " p6"]) -> Crossing:
        """Margins of the conditions of given branches, and their rates."""

    @abc.abstractmethod
    def inputs(
        self,
        branches: tuple[Branches, ...],
        w: Inexact[Array, " m"],
        exhausted: Bool[Array, ""] | None = None,
    ) -> Inexact[Array, " i"]:
        """Inputs of the linear rotor by forces along given branches, and by what else moves it.

        Where `exhausted`, the forces are the actual ones, with their jumps.
        """

    @abc.abstractmethod
    def jump(
        self, before: tuple[Branches, ...], after: tuple[Branches, ...], w: Inexact[Array, " m"]
    ) -> Inexact[Array, " i"]:
        """Inputs along one branch less those along another."""


class AbstractSplitStep(eqx.Module):
    """A step that can be split where a force changes its branch."""

    basis: eqx.AbstractVar[Basis | BasisWithOthers]
    input_matrix: eqx.AbstractVar[Inexact[Array, "m i"]]
    h: eqx.AbstractVar[Scalar]  # length of the whole step [rad]
    batch: eqx.AbstractVar[bool]

    @abc.abstractmethod
    def at(self, theta: Scalar, w: Inexact[Array, " m"]) -> AbstractInstant:
        """The ports at an angle, in a state."""

    @abc.abstractmethod
    def part(
        self, w: Inexact[Array, " m"], theta: Scalar, span: Scalar, force: Force
    ) -> Inexact[Array, " m"]:
        """State after a span from `theta` on, under inputs by the state and the angle since then."""

    def attempt(self, split: Split) -> Split:
        """Step to the first crossing or the end; accepted unless another crossing is on the way."""
        branches = split.branches
        exhausted = split.tries >= TRIES
        share = first_crossing(split.begin, split.end, split.span)
        span = jnp.where(exhausted | (share > 1), split.left, share * split.span)
        at = lambda after, w: self.at(split.theta + after, w)
        force = lambda w, after: at(after, w).inputs(branches, w, exhausted)
        w = unpacked(self.basis, split.y)
        start = at(0.0, w)
        begin = start.crossing(branches, start.read(w))
        w = self.part(w, split.theta, span, force)
        there = at(span, w)
        finish, ports = there.read(w), there.ports
        end = there.crossing(branches, finish)
        falling = falls_through_zero(begin, end, span)
        # The condition that ends here, and its distance; at the end of the step it must be past.
        last = span >= split.left
        off = -end.margin / jnp.where(end.rate < 0, end.rate, -1.0)
        ends = (end.rate < 0) & (jnp.abs(off) < NEAR * self.h) & (~last | (end.margin <= 0))
        first = jnp.argmin(jnp.where(ends, off, jnp.inf))
        ends &= (jnp.arange(ends.size) == first) & ~exhausted
        accepted = exhausted | ~jnp.any(falling & ~ends)
        after = _branches_after(ports, ends, end, branches, finish)
        jump = there.jump(branches, after, w)
        w = w + self.input_matrix @ (jump * jnp.sum(jnp.where(ends, off, 0.0)))
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

    def complete(
        self,
        theta: Scalar,
        whole: tuple[Float[Array, " m2"], Float[Array, " m2"]],
        branches: tuple[Branches, ...],
        ends: tuple[Crossing, Crossing],
    ) -> Split:
        """A step from `theta` as it was tried whole, split where a crossing is on the way.

        `whole` are the states before and after it, `ends` the margins there.
        """
        before, after = whole
        passed = ~jnp.any(falls_through_zero(*ends, self.h))
        split = Split(
            jnp.where(passed, after, before),
            theta,
            jnp.where(passed, 0.0, self.h),
            self.h,
            *ends,
            branches,
            jnp.zeros((), int),
        )
        return _finish(self, split)


def in_turn(
    advance: Callable, instants: Any, y: Float[Array, " m2"]
) -> tuple[Array, Bool[Array, ""], Int[Array, ""]]:
    """State after a step from every instant, whether a contact was loaded, how many are unresolved.

    `advance(instant, y)` gives the same of one step.
    """

    def one(carry, now):
        y, touched, unresolved = carry
        y, loaded, more = advance(now, y)
        return (y, touched | loaded, unresolved + more), None

    begin = y, jnp.zeros((), bool), jnp.zeros((), int)
    return jax.lax.scan(one, begin, instants)[0]


def _branches_after(
    ports: BranchedPorts, ends: Bool[Array, " c"], end: Crossing, branches, seen: Array
):
    """Branches after some conditions end; inactive conditions are evaluated anew."""
    flat, rebuild = ravel_pytree(branches)
    now, _ = ravel_pytree(ports.branches(seen))
    stay = jnp.where(jnp.isfinite(end.margin), flat, now)
    return rebuild(jnp.where(ends, 1 - flat, stay))


def _finish(step: AbstractSplitStep, split: Split) -> Split:
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
