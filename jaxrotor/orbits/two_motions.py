"""Two motions: the basins of two motions, and states on both sides of the boundary between them."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..core import linalg
from ..equations.start import Continued
from ..equations.system import assemble, port_groups
from ..motion.revolutions import March, check_constant, revolution_rate
from ..scene import Scene
from ..solvers.choice import choose
from .guess import revolutions_of, start_of
from .shooting import differentiable, plan_of


LANES = 16  # states on a segment that are followed at once
LOOK = 32  # revolutions by which it is told where a state leads
SAME = 1e-3  # distance in rms radius and whirl rate below which two motions are one
NARROW = 0.6  # power of the rounding error that is the width of a bracket, over the distance of the states
APART = 1e-3  # distance of the ends of a bracket, over that of both states, up to which they are followed
DECIDED = 0.25  # largest distance from a motion in which a state ends, over that of both motions
PATIENCE = 6  # times that a state is followed further until it is decided


class TwoMotions(NamedTuple):
    """Runs of a scene from many states at once, and the two motions in which they may end."""

    scene: Scene
    march: March
    begins: Float[Array, "2 m"]  # states that lead to them
    motions: Float[np.ndarray, "2 2"]  # rms radius [m] and whirl rate [1] of both
    revolutions: int

    @classmethod
    def of(
        cls, scene: Scene, a: Any, b: Any, revolutions: int, steps: int, solver: Any, at: Any
    ) -> "TwoMotions":
        """Those to which `a` and `b` lead; raises unless they are two."""
        check_constant(scene, "`edge`")
        (scene, stations), together = scene.to_simulate(at, in_time=False), port_groups(scene)
        system = assemble(scene, together)
        if revolutions_of(scene, system, None) is None:
            raise ValueError(
                "`edge` counts revolutions, after which nothing of this scene returns; give it an "
                "`Unbalance`."
            )
        starts = [start_of(one, name) for name, one in (("a", a), ("b", b))]
        rate = revolution_rate(scene, None)
        chosen: Any = choose(differentiable(solver, system), system, rate, starts[0])
        plan = plan_of(chosen, together, steps, contacts=False)
        march = eqx.filter_jit(March.of)(system, plan, rate, stations[:1])
        begins = jnp.stack([march.begin(one, stations[0]) for one in starts])
        runs = cls(scene, march, begins, np.zeros((2, 2)), revolutions)
        _, motions = runs.followed(begins)
        if runs.distance(motions[0], motions[1]) < SAME:
            raise ValueError(
                f"Both states lead to one motion, of the rms radius {motions[0, 0]:.5g} m and the whirl "
                f"rate {motions[0, 1]:.5g}; give states that lead to two."
            )
        return runs._replace(motions=motions)

    @property
    def width(self) -> float:
        """Distance of the states that were given."""
        return float(linalg.norm(self.begins[1] - self.begins[0]))

    def start_at(self, y: Array) -> Continued:
        """A state as a start."""
        return Continued(*self.march.decode(y)[:2])

    def state_of(self, start: Any) -> Array:
        """A start as a state."""
        return self.march.encode(*start.state(self.march.system, self.march.stations[0]))

    def followed(self, states: Float[Array, "k m"]) -> tuple[Array, np.ndarray]:
        """States after the revolutions, and rms radius and whirl rate over the last of them."""
        ends, motions = [], []
        for k in range(0, len(states), LANES):  # one program for any number of states
            some = states[jnp.minimum(jnp.arange(k, k + LANES), len(states) - 1)]
            end, motion, good = _followed(self.march, some, jnp.asarray(self.revolutions))
            if not bool(jnp.all(good.ok)):
                raise RuntimeError(
                    "A motion between both states did not stay finite: take more `steps_per_revolution`."
                )
            ends.append(end)
            motions.append(motion)
        both = jnp.concatenate(ends), jnp.concatenate(motions)
        return both[0][: len(states)], np.asarray(both[1][: len(states)])

    def distance(self, one: np.ndarray, other: np.ndarray) -> Any:
        """Distance in rms radius, relative to the larger of both motions, and whirl rate."""
        scale = np.stack([np.maximum(one[..., 0], other[..., 0]), np.ones(one.shape[:-1])], -1)
        return np.linalg.norm((one - other) / scale, axis=-1)

    def ends(self, states: Float[Array, "k m"]) -> Int[np.ndarray, " k"]:
        """Where states lead: 0 to the first motion, 1 to the second, 2 to another or to none."""
        return self._followed_to_end(states)[0]

    def _followed_to_end(self, states: Float[Array, "k m"]) -> tuple[np.ndarray, np.ndarray]:
        """Where states lead, and the rms radius and whirl rate that they are left with."""
        gap = self.distance(*self.motions)
        ends, motions = np.full(len(states), 2), np.zeros((len(states), 2))
        for _ in range(PATIENCE):
            left = np.flatnonzero(ends == 2)
            states, motions[left] = self.followed(states)
            away = np.stack([self.distance(motions[left], one) for one in self.motions])
            decided = away.min(axis=0) < DECIDED * gap
            ends[left] = np.where(decided, away.argmin(axis=0), 2)
            if decided.all():
                break
            states = states[~decided]
        return ends, motions

    def lead_to_other(self, states: Float[Array, "k m"]) -> Bool[np.ndarray, " k"]:
        """Whether states lead to the second motion; raises where one leads to neither."""
        ends, motions = self._followed_to_end(states)
        if (ends < 2).all():
            return ends == 1
        radius, whirl = motions[ends.argmax()]
        raise RuntimeError(
            f"A state between both leads, after {PATIENCE * (self.revolutions + LOOK)} revolutions, to "
            f"neither motion, but to the rms radius {radius:.5g} m and the whirl rate {whirl:.5g}: give "
            "states of that motion as `a` or `b`, or more `revolutions`."
        )

    def bracket(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Neighbouring states between two that lead to one motion and to the other."""
        least = float(jnp.finfo(low.dtype).eps) ** NARROW * self.width
        shares = np.arange(1, LANES + 1)[:, None] / (LANES + 1)
        while float(linalg.norm(high - low)) > least:
            between = low + shares * (high - low)
            turn = int(np.argmax(np.append(self.lead_to_other(between), True)))
            every = jnp.concatenate([low[None], between, high[None]])
            low, high = every[turn], every[turn + 1]
        return low, high

    def beside(self, low: Array, high: Array) -> Float[Array, "T 2 m"]:
        """States of both ends of a bracket revolution by revolution, until they part."""
        every = _beside(self.march, jnp.stack([low, high]), self.revolutions)
        apart = linalg.norm(every[:, 1] - every[:, 0], axis=-1) > APART * self.width
        last = int(jnp.argmax(jnp.append(apart, True)))
        return every[: max(last, 1)]


@eqx.filter_jit
def _followed(march: March, states: Float[Array, "k m"], revolutions: Int[Array, ""]):
    """States after the revolutions and `LOOK` more, what these show, and outcomes."""

    def look(carry, _):
        y, good = carry
        y, window, ok = march.observe(y)
        z = window.displacement[:, 0]
        turned = jnp.sum(jnp.angle(z[1:] * z[:-1].conj())) / (2 * jnp.pi) * window.sense
        return (y, good & ok), (jnp.mean(jnp.abs(z[1:]) ** 2), turned)

    def one(y):
        begun = march.skip(y, revolutions)
        (y, good), (squares, turns) = jax.lax.scan(look, begun, None, length=LOOK)
        return y, jnp.stack([jnp.sqrt(squares.mean()), turns.mean()]), good

    return jax.vmap(one)(states)


@eqx.filter_jit
def _beside(march: March, states: Float[Array, "2 m"], revolutions: int) -> Float[Array, "T 2 m"]:
    """States revolution by revolution, the first ones included."""
    advance = lambda y, _: (jax.vmap(march.advance)(y)[0], y)
    return jax.lax.scan(advance, states, None, length=revolutions)[1]
