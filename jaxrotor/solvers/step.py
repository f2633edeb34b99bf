"""Step: the linear rotor exactly, all that acts on it, and what moves with it, by the stages of one step.

    w' = A w + B f(C w + steady, x) + L load,   x' = g(C w + steady, x),   ' = d/dtheta

`w` are coordinates of the rotor in a basis of its linear equations, `x` the states of what is coupled to
it: balls, states of laws, a rotation that the rotor holds back. `x` has no linear part, so that the
stages of an exponential step are those of the classical method of Runge and Kutta for it.
"""

import abc
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Inexact, Int

from ..core.quantities import Scalar
from ..effects.law import Now
from ..equations.port import Law, Port, actual
from .basis import Basis
from .tableau import OnceTableau, Tableau


# Shares of the rates of earlier stages in a stage, and of all in the step, by order.
STAGES = {
    2: (((), (1.0,)), (0.5, 0.5)),
    4: (((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}


class StepData(NamedTuple):
    """Data of a step that are known in time.

    Nodes are instants from the beginning to the end of the step, along a first axis of even distances.
    """

    nodes: Any
    load: Float[Array, "u ..."] | None = None  # as the tableau takes it


class At(NamedTuple):
    """Data of one instant of a step, and their rate by the angle."""

    node: Any
    rate: Any
    load: Float[Array, "l ..."] | None = None  # as the equations take it


class Part(NamedTuple):
    """Beginning of a part of a step [rad], and length of the whole step."""

    begin: Scalar | float
    whole: Scalar


class AbstractForcing(eqx.Module):
    """Forces on a rotor in a step, and motion of what is coupled to it; arrays may have lanes last."""

    if TYPE_CHECKING:  # to type checkers an abstract variable would be an argument
        ports: ClassVar[Any]
    else:
        ports: eqx.AbstractVar[tuple[Port, ...]]

    @property
    @abc.abstractmethod
    def others(self) -> int:
        """Numbers of `x`, the last ones of a state."""

    @property
    @abc.abstractmethod
    def through(self) -> Float[Array, "p4 p2"] | None:
        """`D` of ports without mass, see `PortField`; None: all have mass."""

    @abc.abstractmethod
    def data(
        self, start: Any, times: tuple[float, ...], span: Scalar, part: Part | None = None
    ) -> StepData:
        """Data of a step of `span` [rad] at its `times`, or of a part of one, by its start."""

    @abc.abstractmethod
    def at(self, start: Any, part: Part) -> At:
        """Data of the instant at which a part of a step begins."""

    @abc.abstractmethod
    def seen(self, node: Any, own: Float[Array, "s ..."]) -> Float[Array, "s ..."]:
        """Readings, by those of `w` alone, which may be the deviation from a steady response."""

    @abc.abstractmethod
    def forces(
        self, node: Any, seen: Float[Array, "s ..."], x: Float[Array, "x ..."], law: Law
    ) -> tuple[Float[Array, "i ..."], Float[Array, "x ..."] | None]:
        """Inputs of the rotor, those of the ports first, and the rates of `x`, by a law of contact."""

    @abc.abstractmethod
    def motion(self, node: Any, seen: Float[Array, "p4 ..."], law: Law) -> tuple[Array, Array]:
        """Displacement and velocity of the ports along fixed axes, (2, p, ..) each, by their readings."""

    @abc.abstractmethod
    def of_laws(self, node: Any, x: Float[Array, "x ..."]) -> Now:
        """Speed, angle and states that the laws of the ports are given."""


class Step(eqx.Module):
    """A step of fixed size; all arrays may have lanes last."""

    tableau: Tableau | OnceTableau
    forcing: AbstractForcing

    @property
    def ports(self) -> tuple[Port, ...]:
        """Ports whose laws act in the step."""
        return self.forcing.ports

    @property
    def reading(self) -> Float[Array, "p4 m2 ..."]:
        """Reading of the ports by a state of the rotor."""
        return of_ports(self.ports, self.tableau.output)

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        """See `Tableau.contact_stiffness_ratio`; zero without contact."""
        if not self.ports:
            return jnp.zeros((0, 2))
        through = self.forcing.through
        assert isinstance(self.tableau, Tableau)
        return self.tableau.contact_stiffness_ratio(self.reading, self.ports, through)

    def __call__(
        self, now: StepData, y: Float[Array, "y ..."], law: Law = actual
    ) -> tuple[Float[Array, "y ..."], Bool[Array, "..."]]:
        """State after a step, and whether a contact was loaded at its start."""
        tableau, forcing = self.tableau, self.forcing
        count = y.shape[0] - forcing.others
        w, x, h = y[:count], y[count:], tableau.h
        end, free = tableau.ahead(w, now.load)
        if not (free[0].shape[0] or forcing.others):
            return end, jnp.zeros(y.shape[1:], bool)
        nodes = [_node(now, time) for time in tableau.times]
        free = [forcing.seen(node, own) for node, own in zip(nodes, free, strict=True)]
        within, ahead = STAGES[tableau.order]
        inputs: list[Array] = []
        rates: list[Array] = []

        def forces(stage: Array, time: int) -> Array:
            there, pairs = x, zip(within[len(inputs)], rates, strict=False)
            for share, rate in pairs:
                there = there + share * h * rate if share else there
            found, rate = forcing.forces(nodes[time], stage, there, law)
            inputs.append(found)
            if rate is not None:
                rates.append(rate)
            return found

        end = end + tableau.increment(free, forces)
        if forcing.others:
            x = x + h * sum(share * rate for share, rate in zip(ahead, rates, strict=True))
            end = jnp.concatenate([end, x])
        contact = inputs[0].reshape(2, -1, *y.shape[1:])[:, : len(self.ports)]
        return end, jnp.any(contact != 0, axis=(0, 1))

    def several(
        self, starts: Any, y: Float[Array, "y ..."]
    ) -> tuple[Float[Array, "y ..."], Bool[Array, "..."], Int[Array, "..."]]:
        """State after a step from every start, and whether a contact was loaded at one of them.

        No step is split, so none is unresolved.
        """

        def one(carry, following):
            y, touched, start = carry
            now = self.forcing.data(start, self.tableau.times, self.tableau.h)
            y, loaded = self(now, y)
            return (y, touched | loaded, following), None

        lanes = y.shape[1:]
        first, after = in_turn(starts)
        (y, touched, _), _ = jax.lax.scan(one, (y, jnp.zeros(lanes, bool), first), after)
        return y, touched, jnp.zeros(lanes, int)


class AbstractRotor(eqx.Module):
    """A rotor in a basis of its linear equations, of which steps of any size are made."""

    if TYPE_CHECKING:
        basis: ClassVar[Any]
        output: ClassVar[Any]
        input: ClassVar[Any]
        load_matrix: ClassVar[Any]
    else:
        basis: eqx.AbstractVar[Basis]
        output: eqx.AbstractVar[
            Inexact[Array, "s m"] | None
        ]  # C, the first rows those of the ports
        input: eqx.AbstractVar[Inexact[Array, "m i"] | None]  # B
        load_matrix: eqx.AbstractVar[Float[Array, "m2 l"]]  # L, of `At.load`

    @abc.abstractmethod
    def step(self, order: int, h: Scalar, forcing: AbstractForcing, *, once: bool = False) -> Step:
        """A step of `h` [rad] under a forcing, which is taken `once` or many times."""


def _node(now: StepData, time: float) -> Any:
    """Data at a node, by its time in steps."""
    return jax.tree.map(lambda leaf: leaf[int(time * (leaf.shape[0] - 1))], now.nodes)


def in_turn(starts: Any) -> tuple[Any, Any]:
    """The first of some starts, and those after every one, the last of which is not used.

    A step that takes its start from the carry of a loop does not index arrays by the number of the step.
    Kernels that do are not vectorised, so that a step of many lanes takes three times as long.
    """
    of = lambda take: jax.tree.map(take, starts)
    return of(lambda leaf: leaf[0]), of(lambda leaf: jnp.roll(leaf, -1, axis=0))


def of_ports(ports: tuple[Port, ...], seen: Float[Array, "s ..."]) -> Float[Array, "p4 ..."]:
    """Readings of the ports, the first of all: `[Re, Im]` of displacement and velocity."""
    both = seen.reshape(2, -1, *seen.shape[1:])[:, : 2 * len(ports)]
    return both.reshape(-1, *seen.shape[1:])
