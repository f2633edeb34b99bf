"""Time history: the motion of a scene in time, whichever way it was computed."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from ..analysis import first_moments
from ..core.compiled import compiled
from ..core.pilot import Pilot
from ..core.plane import plane
from ..core.quantities import Scalar
from ..core.tables import largest_rows, notebook_table
from ..effects.base import AbstractBodies, AbstractCasing
from ..equations.kinematics import Kinematics, RotatingState
from ..equations.rotating_frame import Transient
from ..equations.start import Balls, Launch
from ..equations.system import System, assemble, state_names
from ..scene import Scene


class TimeHistory(eqx.Module):
    """Motion of a scene at `T` times and `s` stations, in fixed axes."""

    time: Float[Array, " T"]  # [s] since the start
    angle: Float[Array, " T"]  # of rotation [rad]
    speed: Float[Array, " T"]  # of rotation [rad/s]
    acceleration: Float[Array, " T"]  # of rotation [rad/s^2]
    displacement: Complex[Array, "T s"]  # x + i y [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    slope: Complex[Array, "T s"]  # dz/dx [rad]
    contact_force: Complex[Array, "T k"] | None  # on the shaft, by contact of the scene [N]
    coordinates: Complex[Array, "T n"]  # of the equations of motion
    rates: Complex[Array, "T n"]  # of them [1/s]
    balls: tuple[Balls, ...]  # one entry a race
    states: dict[str, Float[Array, " T"]]  # of laws by their names, such as "worn_stop.wear"
    stations: Float[Array, " s"]  # [m]
    stopped: Scalar  # time at which the rotor came to rest for good [s], infinite if never
    end: Launch  # state at the end, from which another motion may continue
    unresolved: Int[Array, ""]  # steps in which `located=True` did not find all contact changes
    scene: Scene
    solver: str = eqx.field(static=True)
    method: str = eqx.field(static=True)  # the solver, and why it was chosen
    steps_per_revolution: int | None = eqx.field(
        static=True
    )  # samples; None: at times of their own
    pilots: tuple[Pilot, ...] = eqx.field(default=(), static=True)  # that chose "auto" settings
    integrated: Kinematics | None = None  # of all moving parts, where they were integrated

    @property
    def instants(self) -> Kinematics:
        """Positions, velocities and accelerations of all moving parts, in the axes of the shaft."""
        if self.integrated is not None:
            return self.integrated
        motion = self.time, self.angle, self.coordinates, self.rates
        return _instants(self.scene, assemble(self.scene), *motion)

    @property
    def imbalance(self) -> Complex[Array, " T"]:
        """Unbalance of the scene and of all balls, in the axes of the shaft [kg m]."""
        angles = [balls.angle for balls in self.balls]
        none = jnp.zeros((*self.time.shape, 0))
        return imbalance_of(self.scene, jnp.concatenate([none, *angles], axis=-1))

    def of_casing(self, name: str) -> Complex[Array, " T"]:
        """Displacement of a casing by its name [m]."""
        number = self.scene.casing(name)
        return self.coordinates[:, number - len(self.scene.of(AbstractCasing))]

    def _repr_html_(self) -> str:
        sizes = np.abs(self.displacement)
        rows = largest_rows(np.asarray(self.stations), sizes, self.time, self.speed)
        heads = ("station [m]", "largest displacement [m]", "at time [s]", "at speed [rad/s]")
        return notebook_table(str(self), heads, rows)

    def __str__(self) -> str:
        chosen = "".join(f"; chosen {pilot}" for pilot in self.pilots)
        where = ", ".join(f"{at:g}" for at in np.asarray(self.stations))
        if self.steps_per_revolution is not None:
            turns = (self.time.size - 1) / self.steps_per_revolution
            samples = f"{self.steps_per_revolution} samples a revolution"
            return f"Motion of {turns:g} revolutions at {where} m: {samples}, {self.solver}{chosen}"
        first, last = float(self.speed[0]), float(self.speed[-1])
        turns = float(self.angle[-1] - self.angle[0]) / (2 * np.pi)
        long = float(self.time[-1] - self.time[0])
        return (
            f"Motion from {first:g} to {last:g} rad/s in {long:g} s and {turns:.1f} revolutions at "
            f"{where} m: {self.time.size} samples, {self.solver}{chosen}"
        )


def named_states(scene: Scene, instants: Kinematics | None) -> dict[str, Float[Array, " T"]]:
    """States of laws at the samples of a run, by their names."""
    if instants is None or not instants.states.shape[-1]:
        return {}
    columns = jnp.moveaxis(instants.states, -1, 0)
    return dict(zip(state_names(scene), columns, strict=True))


def imbalance_of(scene: Scene, bodies: Float[Array, "*T b"]) -> Complex[Array, "*T"]:
    """Unbalance of the scene and of all bodies at angles `psi` from the shaft, in its axes [kg m]."""
    moments = [race.masses * race.race_radius for race in scene.of(AbstractBodies)]
    of_bodies = jnp.exp(1j * bodies) @ jnp.concatenate([jnp.zeros(0), *moments])
    return first_moments(scene).unbalance + of_bodies


@compiled
def _instants(
    scene: Scene,
    system: System,
    times: Array,
    angles: Array,
    coordinates: Array,
    rates: Array,
) -> Kinematics:
    """Kinematics at the samples of a motion at constant speed."""
    speed, none = scene.spin.speed, jnp.zeros(0)
    begin = angles[0] - speed * times[0]
    transient = Transient.of(scene, jnp.ones(()), begin, system=system)

    def instant(time: Scalar, angle: Scalar, q: Array, velocity: Array) -> Kinematics:
        turn = jnp.exp(-1j * angle)
        r = turn * q
        drift = turn * velocity - 1j * speed * r
        state = RotatingState(plane(r), plane(drift), *[none] * 5)
        return transient.instant(time, state)

    return jax.vmap(instant)(times, angles, coordinates, rates)
