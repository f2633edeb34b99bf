"""Orbit: a periodic motion with its multipliers, as shooting computes it."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float, Int

from ..core.extremes import largest
from ..core.quantities import Scalar
from ..core.tables import notebook_table
from ..equations.start import Continued, Launch
from ..scene import Scene


class OrbitError(eqx.Module):
    """Changes of an orbit when its steps are halved: about its errors at full steps."""

    period: Scalar  # [s]
    whirl_rate: Scalar  # [1]
    displacement: Scalar  # largest along the orbit [m]
    multipliers: Scalar  # largest of all [1]


class AbstractOrbit(eqx.Module):
    """A periodic motion, sampled over a period at `s` stations."""

    displacement: eqx.AbstractVar[Complex[Array, "T s"]]  # x + i y [m]
    stations: eqx.AbstractVar[Float[Array, " s"]]  # [m]

    @property
    def radius(self) -> tuple[Float[Array, " s"], Float[Array, " s"]]:
        """Smallest and largest distance from the centre [m] at the samples."""
        radius = jnp.abs(self.displacement)
        return -largest(-radius), largest(radius)

    def _repr_html_(self) -> str:
        low, high = self.radius
        heads = ("station [m]", "least radius [m]", "largest radius [m]")
        rows = list(zip(self.stations.tolist(), low.tolist(), high.tolist(), strict=True))
        return notebook_table(str(self), heads, rows)


class PeriodicOrbit(AbstractOrbit):
    """A motion with `z(t + period) = e^(i turn) z(t)`, sampled over a period at `s` stations."""

    # A state on it, of a scene with unbalance that at angle 0; a launch where laws have states
    start: Continued | Launch
    period: Scalar  # [s]
    turn: Scalar  # angle about the centre in a period [rad], whole turns included
    whirl_rate: Scalar  # turn / (period Omega) [1]
    # Of the period map, turned back, also of states of laws; largest first
    multipliers: Complex[Array, " m"]
    trivial: Scalar | None  # multiplier along a motion without unbalance, 1 up to errors
    time: Float[Array, " T"]  # [s]
    displacement: Complex[Array, "T s"]  # x + i y [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    contact_force: Complex[Array, "T k"] | None  # on the shaft, by contact of the scene [N]
    states: dict[str, Float[Array, " T"]]  # of laws by their names, as of a `TimeHistory`
    stations: Float[Array, " s"]  # [m]
    residual: Scalar  # largest change of the state over a period, over its largest [1]
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]
    unresolved: Int[Array, ""]  # steps whose changes of contact were not located
    scene: Scene
    error: OrbitError | None
    revolutions: int | None = eqx.field(static=True)  # in a period; None if it was unknown
    steps: int = eqx.field(static=True)  # in a revolution, a pass, or a period that was unknown
    solver: str = eqx.field(static=True)
    # Whether `revolutions` are passes of the balls of a bearing, or periods of another law that turns:
    passes: bool = eqx.field(static=True, default=False)
    # Whether they are beats of shafts with unbalance, after which it returns turned:
    beats: bool = eqx.field(static=True, default=False)
    shaft: str | None = eqx.field(static=True, default=None)  # of its stations, of several

    @property
    def stable(self) -> Bool[Array, ""]:
        """Whether every multiplier is inside the unit circle."""
        return jnp.all(jnp.abs(self.multipliers) < 1)

    @property
    def duty(self) -> Float[Array, " k"]:
        """Fraction of the samples at which each contact is loaded; not differentiable."""
        return jnp.mean(jnp.abs(self._forces()[1:]) > 0, axis=0)

    @property
    def peak_force(self) -> Float[Array, " k"]:
        """Largest force of each contact [N] at the samples."""
        return largest(jnp.abs(self._forces()))

    def _forces(self) -> Complex[Array, "T k"]:
        if self.contact_force is None:
            raise ValueError("The scene of this orbit has no contact; give it a `Limiter`.")
        return self.contact_force

    def __str__(self) -> str:
        if self.revolutions is None:
            degrees = math.degrees(float(self.turn))
            kind = f"Orbit of period {float(self.period):.9g} s that turns by {degrees:.6g} degrees"
        else:
            one, many = ("pass", "passes") if self.passes else ("revolution", "revolutions")
            one, many = ("beat", "beats") if self.beats else (one, many)
            kind = f"Orbit of {self.revolutions} {many if self.revolutions > 1 else one}"
        first = complex(self.multipliers[0])
        return (
            f"{kind}, whirl rate {float(self.whirl_rate):.9g}, "
            f"{'stable' if self.stable else 'unstable'}: largest multiplier {abs(first):.6g} at "
            f"{math.degrees(np.angle(first)):.4g} degrees; residual {float(self.residual):.1e} after "
            f"{int(self.iterations)} iterations of {self.steps} steps, {self.solver}"
        )


def winding_angle(z: Complex[Array, " T"], turn: Scalar) -> Scalar:
    """The turn with all whole turns about the centre; not a number where the path meets the centre."""
    total = jnp.sum(jnp.angle(z[1:] * jnp.conj(z[:-1])))
    whole = jax.lax.stop_gradient(jnp.round((total - turn) / (2 * jnp.pi)))
    return jnp.where(jnp.any(z == 0), jnp.nan, turn + 2 * jnp.pi * whole)
