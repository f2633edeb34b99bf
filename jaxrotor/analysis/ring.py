"""Ring: circular whirl of an isotropic rotor in an annular stator, and small motions about it.

    P(i w) q = load - column N (1 + i s) n,   row q = (g + N / k) n,   n = exp(i w t)

`s` is the friction in force, `f sgn V` where the rim slips. In axes that turn with the whirl the
linearised equations have constant coefficients, so that small motions have roots.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..core.quantities import Scalar, known
from ..effects import AbstractBodies, AbstractContact, AnnularStator
from ..effects.law import Now
from ..equations.pencil import Pencil, check_alike, check_moves, eigenvalues
from ..equations.system import System, structure
from ..scene import Scene
from ..spins.base import sense_of


NEWTON = 4  # iterations that polish a root
NEAR = 1e-3  # relative distance to which a root may move by these
EXACT = 1e-8  # relative size of the last of them


class RotorInRing(eqx.Module):
    """Rotor at constant speed without its ring, and the ring."""

    pencil: Pencil
    row: Float[Array, " n"]
    column: Float[Array, " n"]
    ring: AnnularStator
    rim: Scalar  # speed at which the centred rim slips along the ring [m/s]
    sense: Scalar  # -1 where the shaft in the ring turns backward, else 1

    @classmethod
    def of(cls, system: System, ring: AnnularStator) -> "RotorInRing":
        """The parts of the equations of a scene with one ring."""
        port = system.ports[0]
        now = port.own(Now(jnp.asarray(system.spin.speed)))
        rim = ring.law().sliding(now)
        sense = sense_of(jnp.where(rim == 0, now.speed, rim))
        return cls(Pencil.of(system), port.row, port.column, ring, rim, sense)

    def receptance(self, rate: Scalar) -> Complex[Array, ""]:
        """`row P(i rate)^-1 column`: displacement by a force that turns at `rate` [m/N]."""
        return self.row @ self.pencil.response(rate, self.column + 0j)

    def linearised(
        self, rate: Scalar, normal: Scalar, friction: Scalar, slope: Scalar | float = 0.0
    ) -> Pencil:
        """Pencil of small motions about a whirl, in axes that turn with it and start along `n`.

        `z = n (rho + a + i b)`, `dN = k a + d a.`, `dV = rate a + b.`, and the force is
        `-(1 + i s) (N + dN) (n + i b n / rho) - i N slope dV n`.

        Args:
            rate: whirl rate [rad/s].
            normal: normal force N [N].
            friction: s, of the sign of the slip.
            slope: derivative of s by the slip velocity [s/m].
        """
        ring, own = self.ring, self.pencil
        stiff, damper = ring.stiffness, ring.damping
        radius = ring.gap + normal / stiff
        around = jnp.where(radius > 0, normal / jnp.where(radius > 0, radius, 1.0), stiff)
        force, push = jnp.outer(self.column, self.row), 1 + 1j * friction
        creep = normal * slope / 2
        pair = lambda same, other: jnp.block([[same, other], [other.conj(), same.conj()]])
        damping = own.damping + 2j * rate * own.inertia
        stiffness = own.stiffness + 1j * rate * own.damping - rate**2 * own.inertia
        return Pencil(
            pair(own.inertia, jnp.zeros_like(own.inertia)),
            pair(
                damping + force * (push * damper / 2 + creep),
                force * (push * damper / 2 - creep),
            ),
            pair(
                stiffness + force * (push * (stiff + around) / 2 + 1j * rate * creep),
                force * (push * (stiff - around) / 2 + 1j * rate * creep),
            ),
            paired=True,
        )

    def rolling(self, rate: Scalar, normal: Scalar, friction: Scalar) -> Pencil:
        """Pencil of small motions with a rim that rolls, `b. + rate a = 0`, whatever its friction.

        The tangential force is eliminated together with the component of the motion that it pushes. What
        is left of that component is `b` alone.
        """
        own, n = self.linearised(rate, normal, friction).along_axes, self.row.size
        lift, hidden = _null_space(self.row)
        keep = _null_space(self.column)[0].T
        radial = jnp.concatenate([self.row, jnp.zeros(n - 1)])  # a of (x, y without the component)

        def split(block: Array) -> tuple[Array, Array]:
            rows = jnp.concatenate([block[:n], keep @ block[n:]])
            return jnp.concatenate([rows[:, :n], rows[:, n:] @ lift], axis=1), rows[:, n:] @ hidden

        (inertia, mass), (damping, drag), (stiffness, spring) = map(
            split, (own.inertia, own.damping, own.stiffness)
        )
        # lambda b = -rate a, wherever b moves
        damping, stiffness = (
            block - rate * jnp.outer(part, radial)
            for block, part in ((damping, mass), (stiffness, drag))
        )
        zero, none = jnp.zeros((2 * n - 1, 1)), jnp.zeros(2 * n - 1)
        border = lambda block, column, row, corner: jnp.block(
            [[block, column], [row[None], jnp.full((1, 1), corner)]]
        )
        return Pencil(
            border(inertia, zero, none, 0.0),
            border(damping, zero, none, 1.0),
            border(stiffness, spring[:, None], rate * radial, 0.0),
        )


def _null_space(row: Float[Array, " n"]) -> tuple[Float[Array, "n k"], Float[Array, " n"]]:
    """Columns `E` with `row E = 0`, and a vector `e` with `row e = 1`."""
    n = row.size
    pivot = jnp.argmax(jnp.abs(row))
    others = (pivot + jnp.arange(1, n)) % n
    unit = jnp.zeros(n).at[pivot].set(1 / row[pivot])
    return jnp.eye(n)[:, others] - jnp.outer(unit, row[others]), unit


def sorted_roots(pencil: Pencil, neutral: bool) -> Complex[Array, " m"]:
    """All roots, ordered by their real parts, largest first; NaN stands for infinite ones.

    A whirl whose phase is arbitrary is `neutral`: its root zero is left out, too.
    """
    roots = eigenvalues(pencil)
    left = jnp.isfinite(roots)
    if neutral:
        left = left & (jnp.arange(roots.size) != jnp.argmin(jnp.abs(roots)))
    order = jnp.argsort(jnp.where(left, -roots.real, jnp.inf))
    return jnp.where(left, roots, jnp.nan)[order]


def ring_of(scene: Scene, what: str) -> AnnularStator:
    """The ring of a scene; raise unless it and the rotor are the same along every direction.

    `what` begins the message, "A full rub" for example.
    """
    rings, contacts = scene.of(AnnularStator), scene.of(AbstractContact)
    if len(rings) != 1 or len(contacts) != 1:
        raise ValueError(
            f"{what} in closed form is that of one `AnnularStator`, but the scene has {len(rings)} and "
            f"{len(contacts) - len(rings)} other contacts; leave one ring, or use `jaxrotor.simulate`."
        )
    system = structure(scene)
    check_moves(system)
    check_alike(system, f"{what} in closed form", "make them equal, or use `jaxrotor.simulate`")
    if scene.of(AbstractBodies):
        raise ValueError(
            f"{what} in closed form takes no balls; remove them, or use `jaxrotor.run_up`."
        )
    for part, there in (
        ("hysteretic damping", system.blocks.hysteretic is not None),
        ("weight or other constant loads", system.load.steady),
    ):
        if there:
            raise ValueError(
                f"{what} in closed form is of a rotor without {part}; remove it by `scene.without(..)`, "
                "or use `jaxrotor.simulate`."
            )
    (ring,) = rings
    for name, wrong, rule in (
        ("offset [m]", lambda x: x != 0, "must be 0"),
        ("stiffness [N/m]", lambda x: x == 0, "must not be 0"),
    ):
        value = getattr(ring, name.partition(" ")[0])
        if known(value) and wrong(np.asarray(value)):
            raise ValueError(
                f"{what} in closed form: `{name}` of the ring {rule}, but is {float(value):g}; change "
                "it, or use `jaxrotor.simulate`."
            )
    return ring


def polished(function: Callable[[Scalar], Scalar], guess: Scalar) -> tuple[Scalar, Bool[Array, ""]]:
    """Root of a function near a guess by Newton's method, and whether there is one.

    The derivative of the root is that of the implicit function theorem.
    """

    def newton(_, state):
        value, _, _ = state
        found, slope = jax.jvp(function, (value,), (jnp.ones_like(value),))
        change = found / slope
        return value - change, change, slope

    start = guess, guess, jnp.ones_like(guess)
    value, change, slope = jax.lax.stop_gradient(jax.lax.fori_loop(0, NEWTON, newton, start))
    near = jnp.abs(value - guess) <= NEAR * jnp.abs(guess)
    return value - function(value) / slope, near & (jnp.abs(change) <= EXACT * jnp.abs(value))
