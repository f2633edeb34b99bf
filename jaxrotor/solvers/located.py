"""Located steps: a step that ends, and begins anew, at the instants at which a force changes its branch.

Between two such instants every force follows one smooth branch of its law, so an exponential step
keeps its order. A step is tried along the branches that hold at its start. Every condition of a
branch has a margin, positive while it holds; margins and rates at both ends of the step, which the
readings of the ports give, define cubics, and the step ends at the first descent of one through zero.
The error of a cubic there, `dt = -margin / rate`, is corrected by the jump of the force, so that neither
order nor derivatives depend on how the instant was found:

    w <- w + B (f_before - f_after) dt

See docs/concepts/lanes.md for lanes that are split at different instants.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from ..core.lanes import per_lane, product
from ..effects.law import Now, States
from ..equations.port import AbstractPortLaw, Branches, Law, Port, actual, of_each
from .basis import as_real
from .crossing import Crossing, falls_through_zero, first_crossing
from .ports import take_lanes
from .step import AbstractForcing, AbstractRotor, At, Part, Step, StepData, in_turn, of_ports
from .tableau import OnceTableau, Tableau


NEAR = 1e-2  # of a full step: largest distance of a split from the crossing
TRIES = 24  # most attempts in one step; the rest is then stepped without splitting
BLOCK = 16  # lanes whose splits run at once


class Along(AbstractPortLaw):
    """Forces and rates of every law along given branches; the actual ones where `exhausted`."""

    branches: tuple[Branches, ...]
    exhausted: Bool[Array, ""] | None = None

    def __call__(
        self, number: int, port: Port, place: Array, velocity: Array, now: Now
    ) -> Float[Array, "k 2 ..."]:
        found = port.along(self.branches[number], place, velocity, now)
        if self.exhausted is None:
            return found
        return jnp.where(self.exhausted, port.forces(place, velocity, now), found)

    def rates(self, number: int, port: Port, forces: Array, *motion: Any) -> States:
        found = port.rates(forces, *motion, branches=self.branches[number])
        if self.exhausted is None:
            return found
        return jnp.where(self.exhausted, port.rates(forces, *motion), found)


class Split(eqx.Module):
    """State of a partly completed step, and the crossings in the span last tried; lanes may be last."""

    y: Float[Array, "y ..."]
    after: Float[Array, "..."]  # the beginning of the step [rad]
    left: Float[Array, "..."]  # of the step [rad]
    span: Float[Array, "..."]  # tried last, from `after`
    begin: Crossing
    end: Crossing
    branches: tuple[Branches, ...]
    tries: Int[Array, "..."]

    @property
    def unresolved(self) -> Int[Array, "..."]:
        """1 where the attempts did not complete the step."""
        return (self.tries > TRIES) + 0


class KnownStep(NamedTuple):
    """Start of a step, data of its stages, and data of both of its ends, which are known in advance."""

    start: Any
    data: StepData
    begin: At
    end: At


class LocatedStep(eqx.Module):
    """A step of fixed size that is split where a force changes its branch."""

    whole: Step
    rotor: AbstractRotor
    # Readings C, and their rates at the ports by state, inputs and loads: C A, C B, C L
    views: Float[Array, "v m2"]
    input: Float[Array, "m2 i"]  # B
    entering: Float[Array, "p4 i"]
    loading: Float[Array, "p4 l"]

    @classmethod
    def of(cls, rotor: AbstractRotor, whole: Step) -> "LocatedStep":
        """The located step of a rotor by one that is not."""
        assert rotor.output is not None and rotor.input is not None
        real, ports = as_real(rotor.output), whole.ports
        own, enters = of_ports(ports, real), as_real(rotor.input)
        moving = of_ports(ports, as_real(rotor.output @ rotor.basis.matrix()))
        views = jnp.concatenate([real, moving])
        return cls(whole, rotor, views, enters, own @ enters, own @ rotor.load_matrix)

    @property
    def tableau(self) -> Tableau | OnceTableau:
        """That of the whole step."""
        return self.whole.tableau

    @property
    def forcing(self) -> AbstractForcing:
        """See `Step`."""
        return self.whole.forcing

    @property
    def reading(self) -> Float[Array, "p4 m2 ..."]:
        """See `Step`."""
        return self.whole.reading

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        """See `Step`."""
        return self.whole.contact_stiffness_ratio

    def several(
        self, starts: Any, y: Float[Array, "y ..."]
    ) -> tuple[Float[Array, "y ..."], Bool[Array, "..."], Int[Array, "..."]]:
        """State after a step from every start, whether a contact was loaded, how many are unresolved."""

        def one(carry, following):
            y, touched, unresolved, now = carry
            y, loaded, more = self.advance_by(now, y)
            return (y, touched | loaded, unresolved + more, following), None

        lanes = y.shape[1:]
        first, after = in_turn(jax.vmap(self.data_of)(starts))
        begin = y, jnp.zeros(lanes, bool), jnp.zeros(lanes, int), first
        (y, touched, unresolved, _), _ = jax.lax.scan(one, begin, after)
        return y, touched, unresolved

    def data_of(self, start: Any) -> "KnownStep":
        """Data of a step by its start."""
        tableau, forcing, h = self.tableau, self.forcing, self.tableau.h
        ends = (forcing.at(start, Part(part, h)) for part in (0.0 * h, h))
        return KnownStep(start, forcing.data(start, tableau.times, h), *ends)

    def advance(
        self, start: Any, y: Float[Array, "y ..."]
    ) -> tuple[Float[Array, "y ..."], Bool[Array, "..."], Int[Array, "..."]]:
        """State after a whole step, whether a contact was loaded in it, and 1 if it is not resolved."""
        return self.advance_by(self.data_of(start), y)

    def advance_by(
        self, now: "KnownStep", y: Float[Array, "y ..."]
    ) -> tuple[Float[Array, "y ..."], Bool[Array, "..."], Int[Array, "..."]]:
        """`advance`, by what is known of the step.

        All lanes take the whole step together, and those that are split go on in blocks.
        """
        if y.ndim > 1 and not take_lanes(self.whole.ports):
            begun, loaded = per_lane(lambda own, y: own[0]._begun(own[1], y), (self, now), y)
        else:
            begun, loaded = self._begun(now, y)
        done = _finish(self, now.start, begun)
        return done.y, loaded | (done.tries > 0), done.unresolved

    def _begun(
        self, now: "KnownStep", y: Float[Array, "y ..."]
    ) -> tuple[Split, Bool[Array, "..."]]:
        """The step as a whole, or all left of it where a condition ends; whether a contact was loaded."""
        h, lanes = self.tableau.h, y.shape[1:]
        branches = self.branches(now.begin, y)
        y1, loaded = self.whole(now.data, y, Along(branches))
        ends = self.crossing(now.begin, branches, y), self.crossing(now.end, branches, y1)
        passed = ~jnp.any(falls_through_zero(*ends, h), axis=0)
        left, none = jnp.where(passed, 0.0, h), jnp.zeros(lanes, jnp.result_type(h))
        tries = jnp.zeros(lanes, int)
        y = jnp.where(passed, y1, y)
        return Split(y, none, left, none + h, *ends, branches, tries), loaded

    def attempt(self, start: Any, split: Split) -> Split:
        """Step to the first crossing or the end; accepted unless another crossing is on the way."""
        forcing, h, branches = self.forcing, self.tableau.h, split.branches
        exhausted = split.tries >= TRIES
        share = first_crossing(split.begin, split.end, split.span)
        span = jnp.where(exhausted | (share > 1), split.left, share * split.span)
        here = Part(split.after, h)
        begin = self.crossing(forcing.at(start, here), branches, split.y)
        step = self.rotor.step(self.tableau.order, span, forcing, once=True)
        now = forcing.data(start, step.tableau.times, span, here)
        y, _ = step(now, split.y, Along(branches, exhausted))
        there = forcing.at(start, Part(split.after + span, h))
        end = self.crossing(there, branches, y)
        falling = falls_through_zero(begin, end, span)
        # The condition that ends here, and its distance; at the end of the step it must be past.
        last = span >= split.left
        off = -end.margin / jnp.where(end.rate < 0, end.rate, -1.0)
        ends = (end.rate < 0) & (jnp.abs(off) < NEAR * h) & (~last | (end.margin <= 0))
        first = jnp.argmin(jnp.where(ends, off, jnp.inf))
        ends &= (jnp.arange(ends.size) == first) & ~exhausted
        accepted = exhausted | ~jnp.any(falling & ~ends)
        after = _branches_after(ends, end, branches, self.branches(there, y))
        jump = self.change(there, Along(branches), y, less=Along(after))
        y = y + jump * jnp.sum(jnp.where(ends, off, 0.0))
        left = jnp.where(last, 0.0, split.left - span)
        keep = lambda new, old: jax.tree.map(lambda a, b: jnp.where(accepted, a, b), new, old)
        # After an accepted span nothing is known of the next crossing: the rest is tried whole.
        unknown = jax.tree.map(lambda one: jnp.full_like(one, jnp.inf), end)
        return Split(
            keep(y, split.y),
            keep(split.after + span, split.after),
            keep(left, split.left),
            span,
            keep(unknown, begin),
            keep(unknown, end),
            keep(after, branches),
            split.tries + 1,
        )

    def branches(self, at: At, y: Float[Array, "y ..."]) -> tuple[Branches, ...]:
        """Branches of all laws in a state."""
        own, _, x = self._viewed(y)
        seen = self.forcing.seen(at.node, own)
        d, v = self.forcing.motion(at.node, of_ports(self.whole.ports, seen), actual)
        motions = _motions(self.whole.ports, d, v, self.forcing.of_laws(at.node, x))
        return tuple(port.branches(*motion) for port, motion in motions)

    def crossing(
        self, at: At, branches: tuple[Branches, ...], y: Float[Array, "y ..."]
    ) -> Crossing:
        """Margins of the conditions of given branches, and their rates by the angle."""
        forcing, ports, law = self.forcing, self.whole.ports, Along(branches)
        own, moving, x = self._viewed(y)
        inputs, rates = forcing.forces(at.node, forcing.seen(at.node, own), x, law)
        change = moving + product(self.entering, inputs)
        if at.load is not None:
            change = change + product(self.loading, at.load)

        def margins(node: Any, own: Float[Array, "p4 ..."], x: Array) -> Float[Array, "c ..."]:
            d, v = forcing.motion(node, forcing.seen(node, own), law)
            pairs = zip(_motions(ports, d, v, forcing.of_laws(node, x)), branches, strict=True)
            found = [port.margins(branch, *motion) for (port, motion), branch in pairs]
            return _flat(found, y.shape[1:])

        point = at.node, of_ports(ports, own), x
        return Crossing(
            *jax.jvp(margins, point, (at.rate, change, 0 * x if rates is None else rates))
        )

    def change(
        self, at: At, law: Law, y: Float[Array, " y"], less: Law | None = None
    ) -> Float[Array, " y"]:
        """Rate of a state by what acts on it, by a law of contact, `less` that by another law."""
        own, _, x = self._viewed(y)
        of = lambda law: self.forcing.forces(at.node, self.forcing.seen(at.node, own), x, law)
        inputs, rates = of(law)
        if less is not None:
            others = of(less)
            inputs, rates = jax.tree.map(jnp.subtract, (inputs, rates), others)
        moved = product(self.input, inputs)
        return moved if rates is None else jnp.concatenate([moved, rates])

    def _viewed(self, y: Float[Array, "y ..."]) -> tuple[Array, Array, Array]:
        """Readings of a state, their rates at the ports by it, and the numbers of the others."""
        w, x = jnp.split(y, [len(y) - self.forcing.others])
        seen = product(self.views, w)
        own, moving = jnp.split(seen, [len(seen) - 4 * len(self.whole.ports)])
        return own, moving, x


def _motions(
    ports: tuple[Port, ...], displacement: Array, velocity: Array, now: Now
) -> Iterator[tuple[Port, tuple[Array, Array, Now]]]:
    """Every port with the motion there, of (2, p), or (2, p, lanes), and what its laws are given."""
    motions = [jnp.swapaxes(x, 0, 1) for x in (displacement, velocity)]
    return zip(ports, zip(*motions, of_each(ports, now, *motions), strict=True), strict=True)


def _flat(conditions: Any, lanes: tuple[int, ...]) -> Float[Array, "c ..."]:
    """Values of the conditions of all laws, of one motion or of lanes."""
    return jnp.concatenate([one.reshape(-1, *lanes) for one in jax.tree.leaves(conditions)])


def _branches_after(
    ends: Bool[Array, " c"], end: Crossing, branches: Any, now: tuple[Branches, ...]
) -> Any:
    """Branches after some conditions end; inactive conditions are those of the state `now`."""
    flat, rebuild = ravel_pytree(branches)
    stay = jnp.where(jnp.isfinite(end.margin), flat, ravel_pytree(now)[0])
    return rebuild(jnp.where(ends, 1 - flat, stay))


def _finish(step: LocatedStep, start: Any, split: Split) -> Split:
    """Attempts until the step is complete; of lanes, by blocks of those that are not."""
    lanes = split.left.shape
    if not lanes:
        return jax.lax.while_loop(lambda s: s.left > 0, lambda s: step.attempt(start, s), split)
    (size,) = lanes
    attempt = lambda parts, split: parts[0].attempt(parts[1], split)

    def block(split: Split) -> Split:
        left, some = jax.lax.top_k(split.left, min(size, BLOCK))
        some = jnp.where(left > 0, some, size)  # complete lanes: out of range, dropped
        own = lambda leaf: eqx.is_array(leaf) and leaf.shape[-1] == size  # else shared by all lanes
        take = lambda leaf: leaf.at[..., some].get(mode="clip") if own(leaf) else leaf
        tried = per_lane(attempt, *jax.tree.map(take, ((step, start), split)))
        put = lambda old, new: old.at[..., some].set(new, mode="drop")
        return jax.tree.map(put, split, tried)

    return jax.lax.while_loop(lambda s: jnp.any(s.left > 0), block, split)
