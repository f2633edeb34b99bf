"""The dimensionless groups of a ball auto-balancer on a rotor that tilts about a fixed point."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ...core.checks import is_whole
from ...core.quantities import Scalar, check, nonnegative, positive
from ...effects import BallBalancer
from ...equations.pencil import isotropic
from ...equations.speed_tables import check_no_tables
from ...equations.system import assemble
from ...scene import Scene


class Scales(NamedTuple):
    """Units of the dimensionless quantities; the unit of time is `1 / rate`."""

    rate: Scalar  # omega0 = sqrt(c_alpha / A) [rad/s]
    moment: Scalar  # l_s = m1 r1 [kg m]
    tilt: Scalar  # l_alpha = d l_s / A [rad]

    @classmethod
    def of(
        cls, transverse: Any, stiffness: Any, distance: Any, ball_mass: Any, track_radius: Any
    ) -> "Scales":
        """Scales of a machine; the arguments are those of `BalancerGroups.from_si`."""
        moment = jnp.asarray(ball_mass, float)[0] * jnp.asarray(track_radius, float)[0]
        return cls(jnp.sqrt(stiffness / transverse), moment, distance * moment / transverse)


def _rows(name: str, holds: Any, rule: str) -> Any:
    """A field with one number per row of balls."""

    def convert(values: Any) -> Float[Array, " r"]:
        if np.ndim(values) != 1:
            raise ValueError(f"`{name} [1]` must be one number per row, but is {values!r}.")
        labels = (f"{name} of row {row} [1]" for row in range(1, len(values) + 1))
        return jnp.stack([check(v, s, holds, rule) for v, s in zip(values, labels, strict=True)])

    return eqx.field(converter=convert, metadata={"unit": "1"})


def _balls() -> Any:
    return eqx.field(converter=_counts, static=True)


def _counts(values: Any) -> tuple[int, ...]:
    counts = tuple(values)
    if not counts or not all(is_whole(n, 1) for n in counts):
        raise ValueError(f"`balls` must be one positive whole number per row, but is {values!r}.")
    return counts


class BalancerGroups(eqx.Module):
    """Equations of a rotor with a fixed point, a heavy casing and `r` rows of balls in one plane.

        alpha_z'' + ha alpha_z' + alpha_z - i om C alpha_z' + i s_z'' = 0,  alpha_z = alpha + i beta
        phi_i'' + h_i (phi_i' - om) = mu_i Re( alpha_z'' exp(-i phi_i) )
        s_z = sum S_i exp(i phi_i) + s0 exp(i om tau)

    Time is `tau = omega0 t`. In axes of the rotor `alpha_z = delta exp(i om tau)` and `phi_i = om tau +
    psi_i`. Positions of balls are a tuple of the angles `psi` [rad] of each row.

    Source: Filimonikhin, Goncharov (2011), eqs. (2.1)-(2.2), made dimensionless.
    """

    speed: Scalar = positive("speed [1]")  # om = omega / omega0
    damping: Scalar = nonnegative("damping [1]")  # ha = h_alpha / (A omega0)
    polar: Scalar = nonnegative("polar [1]")  # C = C_p / A
    imbalance: Scalar = nonnegative("imbalance [1]")  # s0 = m0 r0 / (m1 r1)
    balls: tuple[int, ...] = _balls()  # n_l
    moment: Float[Array, " r"] = _rows("moment", lambda x: x > 0, "must be positive")
    # S_l = m_l r_l / (m1 r1), so 1 in the first row
    drag: Float[Array, " r"] = _rows("drag", lambda x: x > 0, "must be positive")
    # h_l / (k_l m_l omega0)
    mass: Float[Array, " r"] = _rows("mass", lambda x: x > 0, "must be positive")
    # m_l n_l d^2 / (2 k_l A)

    def __check_init__(self):
        for name in ("moment", "drag", "mass"):
            count = len(getattr(self, name))
            if count != self.rows:
                raise ValueError(
                    f"`{name}` must have one number per row of `balls` ({self.rows}), but has {count}."
                )

    @classmethod
    def from_si(
        cls,
        *,
        speed: Any,
        transverse: Any,
        polar: Any,
        damping: Any,
        stiffness: Any,
        distance: Any,
        unbalance: Any,
        balls: Sequence[int],
        ball_mass: Any,
        track_radius: Any,
        drag: Any,
        rolling: Any = 1.4,
    ) -> "BalancerGroups":
        """The groups of a machine, from quantities in SI.

        Args:
            speed: omega [rad/s].
            transverse: A [kg m^2], inertia about the fixed point, of rotor, casing, imbalance and balls.
            polar: C_p [kg m^2], inertia of the rotor alone about its axis.
            damping: h_alpha [N m s/rad] of the mount.
            stiffness: c_alpha [N m/rad] of the mount.
            distance: d [m] from the fixed point to the plane of balancing.
            unbalance: m0 r0 [kg m].
            balls: n_l, number of balls in each row.
            ball_mass: m_l [kg], one per row.
            track_radius: r_l [m] of the circle of the balls' centres, one per row.
            drag: h_l [kg/s], one per row.
            rolling: k_l = 1 + J / (m rho^2) [1], one per row or one for all: 7/5 for balls, 3/2 for
                rollers.

        Returns:
            `BalancerGroups`. Differentiable.
        """
        masses, radii, drags = (jnp.asarray(x, float) for x in (ball_mass, track_radius, drag))
        scales = Scales.of(transverse, stiffness, distance, masses, radii)
        rolling = jnp.broadcast_to(jnp.asarray(rolling, float), masses.shape)
        return cls(
            speed=speed / scales.rate,
            damping=damping / (transverse * scales.rate),
            polar=polar / transverse,
            imbalance=unbalance / scales.moment,
            balls=tuple(balls),
            moment=masses * radii / scales.moment,
            drag=drags / (rolling * masses * scales.rate),
            mass=masses * jnp.asarray(balls) * distance**2 / (2 * rolling * transverse),
        )

    @property
    def rows(self) -> int:
        return len(self.balls)

    @property
    def a11(self) -> Scalar:
        """`1 - om^2 (1 - C)`: effective stiffness against a steady tilt of the rotating rotor."""
        return 1 - self.speed**2 * (1 - self.polar)

    @property
    def a12(self) -> Scalar:
        """`ha om`."""
        return self.damping * self.speed

    @property
    def a13(self) -> Scalar:
        """`om (2 - C)`."""
        return self.speed * (2 - self.polar)

    @property
    def a_z(self) -> Complex[Array, ""]:
        """`A_z = a11 + i a12`."""
        return jnp.asarray(self.a11 + 1j * self.a12)

    @property
    def determinant(self) -> Scalar:
        """`Delta = |A_z|^2`."""
        return self.a11**2 + self.a12**2

    @property
    def coupling(self) -> Float[Array, " r"]:
        """`mu_l = 2 m_l / (n_l S_l)`: coupling of the tilt acceleration to one ball."""
        return 2 * self.mass / (jnp.asarray(self.balls) * self.moment)

    @property
    def capacity(self) -> Scalar:
        """`sum n_l S_l`: the largest imbalance that the balls can balance."""
        return jnp.sum(jnp.asarray(self.balls) * self.moment)

    @property
    def critical_speed(self) -> Scalar:
        """`om_cr = 1 / sqrt(1 - C)`, where `a11 = 0`; infinite unless the rotor is long (C < 1)."""
        long = self.polar < 1
        return jnp.where(long, 1 / jnp.sqrt(jnp.where(long, 1 - self.polar, 1.0)), jnp.inf)

    def per_ball(self, values: Float[Array, " r"]) -> Float[Array, " n"]:
        """Values per row, repeated for each ball."""
        return jnp.repeat(values, np.array(self.balls), total_repeat_length=sum(self.balls))


def groups_of(scene: Scene) -> tuple[BalancerGroups, Scales]:
    """Groups and scales of a rotor with one coordinate, such as the tilt about a pivot, at its speed.

    Positions of balls are then angles from the rotor's imbalance, in the sense of its rotation.

    Args:
        scene: a rotor that only tilts about a pivot, with all balls in one plane off it; rows without
            balls are left out.

    Returns:
        `BalancerGroups`, see `BalancerGroups.from_si`, and `Scales`.

    Raises:
        ValueError: the scene is not such a rotor, or has no inertia or spring.
    """
    check_no_tables(scene, "The theory of the ball balancer")
    system, races = assemble(scene), scene.of(BallBalancer)
    levers = [float(race.row[0]) for race in system.races] if system.n == 1 else []
    blocks, counts = system.blocks, [int(np.sum(np.asarray(row.masses) > 0)) for row in races]
    filled = [i for i, count in enumerate(counts) if count]
    fits = isotropic(blocks) and not system.ports and len(levers) == len(races) == len(system.races)
    if not fits or not filled or not all(lever == levers[0] != 0 for lever in levers):
        raise ValueError(
            "The theory of the ball balancer is that of a rotor which only tilts about a pivot, with all "
            "balls in one plane off it and no contacts: a `RigidShaft` with one constraint."
        )
    if blocks.inertia is None or blocks.stiffness is None:
        raise ValueError(
            "The theory of the ball balancer needs a rotor with inertia and a spring; add a Disc or a "
            "Support."
        )
    rows, distance = [races[i] for i in filled], levers[0]
    part = lambda block: 0.0 if block is None else block[0, 0]
    shape = {
        "transverse": blocks.inertia[0, 0],
        "stiffness": blocks.stiffness[0, 0],
        "distance": distance,
        "ball_mass": [row.ball_mass for row in rows],
        "track_radius": [row.race_radius for row in rows],
    }
    unbalance = system.load.unbalance
    groups = BalancerGroups.from_si(
        speed=scene.spin.sense * scene.spin.speed,
        polar=part(blocks.gyroscopic),
        damping=part(blocks.damping),
        unbalance=0.0 if unbalance is None else abs(unbalance[0]) / abs(distance),
        balls=[counts[i] for i in filled],
        drag=[row.drag_coefficient for row in rows],
        rolling=[row.rolling for row in rows],
        **shape,
    )
    return groups, Scales.of(**shape)
