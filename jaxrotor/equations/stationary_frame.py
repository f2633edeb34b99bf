"""Equations of motion at constant speed as a first-order vector field over the angle of revolution.

Axes are fixed in space, see docs/concepts/frames.md.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..core import linalg
from ..core.blocks import Load
from ..core.plane import angle, plane
from ..core.quantities import Scalar
from ..effects.law import AbstractLaw, Now, States
from .massless_coordinates import MasslessCoordinates
from .pencil import check_moves
from .port import Port, forces_and_rates
from .system import System


RUN_UP = "use `jaxrotor.run_up`, which takes any rotor and any spin"
State = Float[Array, "2 2 n"]  # (q, dq/dtheta) by (x, y) by coordinate, all in metres


class Motion(eqx.Module):
    """`q'' = -k q - c q' + i (g q' + h q) + f0 + f1 exp(i s theta) + f2 exp(2 i s theta) + b F + ..`.

    Unequal axes that are fixed in space add `-k_f q* - c_f q'*`, those that turn with the shaft
    `-exp(2 i s theta) (k_r q* + c_r (q' - i s q)*)`.

    All fields are real; a complex vector is its [x, y] parts.

    Here `' = d/dtheta`. `theta = rate t` runs from 0 to 2 pi in a revolution whatever the speed, so all
    members of a sweep share one horizon; `s = Omega / rate` is +1 or -1 (0 at rest), or another number
    where the motion repeats in another time, as that of balls that pass. Terms to which no effect
    contributes are None and absent from the compiled program. Called as a diffrax vector field.

    `loads=False` leaves out `f0` to `f2`, for a state that is the deviation from the steady response.
    """

    rate: Scalar  # [rad/s]
    s: Scalar
    stiffness: Float[Array, "n n"]
    damping: Float[Array, "n n"] | None
    gyroscopic: Float[Array, "n n"] | None
    circulatory: Float[Array, "n n"] | None
    fixed_stiffness: Float[Array, "2 n n"] | None  # [Re, Im], acting on q*
    fixed_damping: Float[Array, "2 n n"] | None
    rotating_stiffness: Float[Array, "2 n n"] | None  # the same in axes that turn with the shaft
    rotating_damping: Float[Array, "2 n n"] | None
    constant: Float[Array, "2 n"] | None
    twice: Float[Array, "2 n"] | None
    unbalance: Float[Array, "2 n"] | None
    columns: Float[Array, "n p"] | None
    rows: Float[Array, "p n"] | None
    ports: tuple[Port, ...]
    speed: Scalar  # [rad/s]

    def __init__(self, system: System, rate: Scalar, *, loads: bool = True):
        blocks = system.blocks
        check_moves(system)
        check_known_in_time(system)
        check_no_balls(system, "Simulation by whole revolutions", RUN_UP)
        if not system.repeats and (contacts := system.laws_with(lambda law: law.clock == "turns")):
            raise ValueError(
                f"A motion by whole revolutions is for forces that repeat in one, but contacts "
                f"({contacts}) count turns; {RUN_UP}."
            )
        speed, s = system.spin.speed, system.spin.speed / rate
        load = system.load if loads else Load()
        columns = rows = None
        if system.ports:
            columns = jnp.stack([port.column for port in system.ports], axis=1)
            rows = jnp.stack([port.row for port in system.ports])
        gyroscopic = _sum((speed, blocks.gyroscopic), (-1.0, blocks.skew_damping))
        circulatory = _sum((speed, blocks.circulatory), (-1.0, blocks.skew_stiffness))
        stiffness = _sum((1.0, blocks.stiffness), (speed, blocks.skew_circulatory))
        parts = {
            "stiffness": (stiffness, 1 / rate**2),
            "damping": (blocks.damping, 1 / rate),
            "gyroscopic": (gyroscopic, 1 / rate),
            "circulatory": (circulatory, 1 / rate**2),
            "fixed_stiffness": (blocks.fixed_stiffness, 1 / rate**2),
            "fixed_damping": (blocks.fixed_damping, 1 / rate),
            "rotating_stiffness": (blocks.rotating_stiffness, 1 / rate**2),
            "rotating_damping": (blocks.rotating_damping, 1 / rate),
            "constant": (load.still_force(speed), 1 / rate**2),
            "twice": (load.twice_force(speed), 1 / rate**2),
            "unbalance": (load.unbalance_force(s), 1.0),  # `s` is the speed by the angle
            "columns": (columns, 1 / rate**2),
        }
        invert: Any = linalg.inv
        if system.massless is not None:
            invert = MasslessCoordinates.known(system.massless[:2]).inverse
        inverse = invert(blocks.inertia)
        for name, (part, factor) in parts.items():
            scaled = None if part is None else factor * (inverse @ part)
            if scaled is not None and jnp.iscomplexobj(scaled):
                scaled = plane(scaled)
            setattr(self, name, scaled)
        self.rate, self.s = rate, s
        self.rows, self.ports, self.speed = rows, system.ports, speed

    def __call__(self, theta: Scalar, y: State, args: None = None) -> State:
        linear = self.linear(theta, y)
        return linear if self.rows is None else linear + self.contact(theta, y)

    def linear(self, theta: Scalar, y: State, args: None = None) -> State:
        """The part that may be stiff: all but contact."""
        del args
        q, rate = y
        acceleration = -(q @ self.stiffness.T)
        if self.damping is not None:
            acceleration -= rate @ self.damping.T
        if self.gyroscopic is not None:
            acceleration += _times_i(rate @ self.gyroscopic.T)
        if self.circulatory is not None:
            acceleration += _times_i(q @ self.circulatory.T)
        if self.fixed_stiffness is not None:
            acceleration -= _conjugated(self.fixed_stiffness, q)
        if self.fixed_damping is not None:
            acceleration -= _conjugated(self.fixed_damping, rate)
        if self.rotating_stiffness is not None or self.rotating_damping is not None:
            acceleration -= self._turning_with_the_shaft(theta, q, rate)
        if self.constant is not None:
            acceleration += self.constant
        for order, load in ((1, self.unbalance), (2, self.twice)):
            if load is not None:
                phase = order * self.s * theta
                acceleration += jnp.cos(phase) * load + jnp.sin(phase) * _times_i(load)
        return jnp.stack([rate, acceleration])

    def _turning_with_the_shaft(self, theta: Scalar, q: Array, rate: Array) -> Array:
        """`exp(2 i s theta) (k q* + c (q' - i s q)*)`: unequal axes that turn with the shaft."""
        force = jnp.zeros_like(q)
        if self.rotating_stiffness is not None:
            force += _conjugated(self.rotating_stiffness, q)
        if self.rotating_damping is not None:
            force += _conjugated(self.rotating_damping, rate - self.s * _times_i(q))
        twice = 2 * self.s * theta
        return jnp.cos(twice) * force + jnp.sin(twice) * _times_i(force)

    def contact(self, theta: Scalar, y: State, args: None = None) -> State:
        """The part that may have jumps and kinks: contact."""
        del args
        return self._contact(theta, y, None)[0]

    def with_states(self, theta: Scalar, y: State, states: States) -> tuple[State, States]:
        """Rates, by the angle, of a state of the rotor and of the states of its laws."""
        contact, rates = self._contact(theta, y, states if states.size else None)
        return self.linear(theta, y) + contact, states if rates is None else rates / self.rate

    def _contact(
        self, theta: Scalar, y: State, states: States | None
    ) -> tuple[State, States | None]:
        """Contact, and the rates of the states of its laws per second where these are given."""
        if self.rows is None or self.columns is None:
            return jnp.zeros_like(y), None
        q, rate = y
        now = self.of_laws(lambda: jnp.stack([jnp.cos(theta), jnp.sin(theta)]), states)
        seen = q @ self.rows.T, self.rate * (rate @ self.rows.T)
        forces, rates = forces_and_rates(self.ports, *seen, now)
        return jnp.stack([jnp.zeros_like(q), forces @ self.columns.T]), rates

    def of_laws(
        self, phase: Callable[[], Float[Array, "2 ..."]], states: States | None = None
    ) -> Now:
        """Speed, states and, where a law asks for it, angle, by cosine and sine of that of revolution."""
        # The angle is within half a revolution on either side: laws by "turns" are here only where their
        # forces repeat in a revolution of the motion, which may be shorter or longer than one of the
        # shaft, by the factor `s`.
        if not any(law.clock for port in self.ports for law in port.laws):
            return Now(self.speed, None, states)
        cos, sin, *_ = phase()
        return Now(self.speed, self.s * angle(jax.lax.complex(cos, sin)), states)

    def matrix(self) -> Complex[Array, "n2 n2"]:
        """`A` of the linear part `(q, q')' = A (q, q')` of a rotor that is the same along every axis."""
        n = self.stiffness.shape[0]
        low = -self.stiffness + 0j
        if self.circulatory is not None:
            low = low + 1j * self.circulatory
        high = jnp.zeros((n, n), complex)
        if self.damping is not None:
            high = high - self.damping
        if self.gyroscopic is not None:
            high = high + 1j * self.gyroscopic
        top = jnp.concatenate([jnp.zeros((n, n)), jnp.eye(n)], axis=1)
        return jnp.concatenate([top, jnp.concatenate([low, high], axis=1)])


def _sum(*terms: tuple[Scalar | float, Array | None]) -> Array | None:
    """Sum of factors times parts, None where every part is absent."""
    products = [factor * part for factor, part in terms if part is not None]
    return sum(products[1:], products[0]) if products else None


def check_known_in_time(system: System) -> None:
    """Raise if hysteretic damping, defined for harmonic motions only, is present."""
    if system.blocks.hysteretic is not None:
        raise ValueError(
            f"Hysteretic damping ({system.owners_of('hysteretic')}) is known for harmonic motions only "
            '(roots, Campbell diagrams), not in time; take `scene.without("hysteretic_damping")` and '
            "InternalDamping in its place."
        )


def check_no_balls(system: System, what: str, instead: str) -> None:
    """Raise if bodies run round the shaft; the message names `what`, and says to do `instead`."""
    if system.races:
        raise ValueError(
            f"{what} is for a rotor without balls, but it has {system.owners_of('bodies')}; {instead}."
        )


def has_memory(law: AbstractLaw) -> bool:
    """Whether a law has states, or counts turns, so that no revolution is as the one before it."""
    return bool(law.states) or law.clock == "turns"


def check_no_states(system: System, what: str, instead: str) -> None:
    """Raise if laws have states or count turns; the message names `what`, and says to do `instead`."""
    if contacts := system.laws_with(has_memory):
        raise ValueError(
            f"{what} is for forces that the motion there determines, but contacts ({contacts}) have "
            f"states of their own or count turns; {instead}."
        )


def check_not_turning(system: System, what: str, instead: str) -> None:
    """Raise if laws have states or turn; the message names `what`, and says to do `instead`."""
    check_no_states(system, what, instead)
    if contacts := system.laws_with(lambda law: law.clock):
        raise ValueError(
            f"{what} is for forces that stand still, but those of {contacts} turn; {instead}."
        )


def _conjugated(block: Float[Array, "2 n n"], v: Float[Array, "2 n"]) -> Float[Array, "2 n"]:
    """`B v*`."""
    (real, imag), (x, y) = block, v
    return jnp.stack([real @ x + imag @ y, imag @ x - real @ y])


def _times_i(v: Float[Array, "2 n"]) -> Float[Array, "2 n"]:
    """`i v`."""
    return jnp.stack([-v[1], v[0]])
