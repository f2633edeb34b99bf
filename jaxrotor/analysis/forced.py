"""Steady response of a linear rotor to unbalance, weight and a given harmonic force."""

from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known, nonnegative, real
from ..core.tables import RPM, largest_rows, notebook_table
from ..effects import AbstractBodies, AbstractContact, Disc
from ..effects.layout import check_one_shaft
from ..equations.other_unbalance import force_of
from ..equations.pencil import Pencil, check_axes, frame, isotropic
from ..equations.rigid_motions import check_constant_load
from ..equations.system import System, assemble, structure
from ..scene import Scene
from .linearized import check_linear
from .observed import Places, Unbalanced
from .operating_line import OperatingLine
from .resonance import CRITICAL, from_resonance
from .whirl_tables import synchronous


class HarmonicForce(eqx.Module):
    """`F(t) = amplitude exp(i angle)` times `cos phi`, `exp(i phi)` or `exp(-i phi)`, phi = w t + phase.

    `whirl="none"` is a force along the axis at `angle`; "forward" and "backward" are rotating forces,
    at `angle` when phi = 0.
    """

    at: Scalar = nonnegative("at [m]")
    amplitude: Scalar = nonnegative("amplitude [N]", default=1.0)
    angle: Scalar = real("angle [rad]", default=0.0)
    phase: Scalar = real("phase [rad]", default=0.0)
    whirl: Literal["none", "forward", "backward"] = eqx.field(default="none", static=True)

    def __check_init__(self):
        if self.whirl not in ("none", "forward", "backward"):
            raise ValueError(
                f"`whirl` must be 'none', 'forward' or 'backward', but is {self.whirl!r}."
            )

    @property
    def parts(self) -> tuple[Complex[Array, ""] | None, Complex[Array, ""] | None]:
        """`f, b` of `F = f exp(i w t) + b exp(-i w t)` [N]."""
        turned = lambda phase: self.amplitude * jnp.exp(1j * (self.angle + phase))
        forward, backward = turned(self.phase), turned(-self.phase)
        if self.whirl == "none":
            return forward / 2, backward / 2
        return (forward, None) if self.whirl == "forward" else (None, backward)


class HarmonicResponse(eqx.Module):
    """`z(x, t) = forward exp(i w t) + backward exp(-i w t)`; `k` cases, `s` stations.

    A shaft of two stiffnesses adds `sidebands[0] exp(i (2 Omega - w) t) + sidebands[1] exp(i (2 Omega
    + w) t)`, the mirror images of both parts in its rotating axes. Unbalance causes none.
    """

    speeds: Float[Array, " k"]  # Omega [rad/s]
    frequencies: Float[Array, " k"]  # w [rad/s]
    stations: Float[Array, " s"]  # [m], NaN for a casing
    forward: Complex[Array, "k s"]  # [m]
    backward: Complex[Array, "k s"]  # [m]
    sidebands: Complex[Array, "2 k s"] | None  # [m]

    def _repr_html_(self) -> str:
        return _peaks("Response", self.speeds, self.frequencies, self.stations, self.major)

    @property
    def major(self) -> Float[Array, "k s"]:
        """Major half axis [m] of the ellipse of the forward and backward parts."""
        return _major(self.forward, self.backward)

    @property
    def minor(self) -> Float[Array, "k s"]:
        """Minor half axis [m] of that ellipse, negative where it is passed backward."""
        return jnp.abs(self.forward) - jnp.abs(self.backward)

    def probe(self, angle: ArrayLike) -> Complex[Array, "k s"]:
        """`p = forward exp(-i psi) + backward* exp(i psi)` [m]: a probe at psi reads `Re p exp(i w t)`.

        Args:
            angle: direction of the probe from x to y [rad], or one for every station.
        """
        turned = jnp.exp(-1j * jnp.asarray(angle, float))
        return self.forward * turned + (self.backward * turned).conj()


def _major(forward: Array, backward: Array) -> Array:
    """`|f| + |b|`: major half axis of the ellipse `f exp(i w t) + b exp(-i w t)`."""
    return jnp.abs(forward) + jnp.abs(backward)


class WeightResponse(eqx.Module):
    """`z(x, t) = deflection + twice exp(2 i Omega t)`; `k` speeds, `s` stations."""

    speeds: Float[Array, " k"]  # [rad/s]
    stations: Float[Array, " s"]  # [m], NaN for a casing
    deflection: Complex[Array, "k s"]  # [m]
    twice: Complex[Array, "k s"]  # [m], zero where the shaft is equally stiff along every axis

    def _repr_html_(self) -> str:
        what = "Twice-per-revolution response"
        return _peaks(what, self.speeds, 2 * self.speeds, self.stations, self.twice)


def _peaks(what: str, speeds: Array, frequencies: Array, stations: Array, parts: Array) -> str:
    """Table for a notebook: the largest displacement at every station and the case it occurs in."""
    rows = largest_rows(np.asarray(stations), np.abs(parts), speeds, speeds * RPM, frequencies)
    heads = ("station [m]", "largest half axis [m]", "at speed [rad/s]", "[rpm]")
    ends = f"{np.min(speeds):.6g} to {np.max(speeds):.6g} rad/s"
    head = f"{what} of {speeds.size} cases, speeds {ends}"
    return notebook_table(head, (*heads, "frequency [rad/s]"), rows)


def unbalance_response(scene: Scene, speeds, at=None, by: str | None = None) -> HarmonicResponse:
    """`( K - i Omega H + i Omega (C - i Omega G) - Omega^2 M ) q = Omega^2 U`, without time stepping.

    On supports of two stiffnesses the orbits are ellipses; a shaft of two stiffnesses stands bent in
    its own axes, so its orbits are circles.

    Args:
        scene: a rotor without contact (`scene.without("limiters")` removes it).
        speeds: one or more speeds [rad/s], none of them an undamped critical speed; of several shafts
            those of the first one.
        at: station(s) [m] or names of casings, by default the observed station of `simulate`; of several
            shafts `("hp", 0.3)`.
        by: name of the shaft whose unbalance acts, where there are several, by default the first one.
            Responses to both together have two frequencies, and the sum of their half axes as bound.

    Returns:
        `HarmonicResponse` with `w = Omega`, or the speed of the shaft `by`: the angle of `forward` is its
        lead over the rotation angle of that shaft.
        The amplitudes exist where the rotor is unstable too; check `growth_rate`. Differentiable.

    Raises:
        ValueError: the scene has contact, some unequal axes stand still and others turn, a station is
            off the shaft, or a speed is an undamped critical speed.

    Source: Azarov, Gouskov, Panovko (2023), eq. (9) with Pi = eps N^2 exp(i N tau).
    """
    scene = synchronous(scene)
    check_linear(scene, speeds)
    speeds, places = _cases(scene, speeds, at)
    line, forces, frequencies = OperatingLine.of(scene, by), _of_unbalance, speeds
    if line is not None and line.by:
        frequencies = line.ratios[line.by] * speeds + line.speeds[line.by]
        forces = eqx.Partial(_of_other, by)
    forward, backward, mirrored, _ = _respond(scene, speeds, frequencies, places, forces)
    return HarmonicResponse(
        speeds, frequencies, places.stations, forward + mirrored, backward, None
    )


def weight_response(scene: Scene, speeds, at=None) -> WeightResponse:
    """`z = a + b exp(2 i Omega t)`: response to what stands still, such as weight and misalignment.

    In the axes of a shaft of two stiffnesses the weight rotates backward, `W exp(-i Omega t)`. The
    response there, `a exp(-i Omega t) + b exp(i Omega t)`, is `a + b exp(2 i Omega t)` in the fixed
    frame. So is that to a misaligned `Coupling`, whose stiffness turns.

    Args:
        scene: a rotor without contact that has Gravity, a Coupling or an OldhamCoupling.
        speeds: one or more speeds [rad/s], none of them an undamped resonance.
        at: station(s) [m] or names of casings, by default the observed station of `simulate`.

    Returns:
        `WeightResponse`. Differentiable.

    Raises:
        ValueError: the scene has contact, some unequal axes stand still and others turn, a station is
            off the shaft, or a speed is an undamped resonance.

    Source: Klochkov, eqs. (4), (8).
    """
    check_linear(scene, speeds)
    speeds, places = _cases(scene, speeds, at)
    forward, backward, twice, _ = _respond(scene, speeds, 0 * speeds, places, _of_weight)
    return WeightResponse(speeds, places.stations, forward + backward, twice)


def forced_response(scene: Scene, frequencies, force: HarmonicForce, at=None) -> HarmonicResponse:
    """`( K + i w C - w^2 M ) q = F`: response to a given harmonic force at the rotor's own speed.

    Args:
        scene: a rotor without contact; its unbalance and weight are left out.
        frequencies: one or more frequencies w [rad/s], none of them an undamped resonance.
        force: station, amplitude and direction of the force. The deflection of a flexible shaft has a
            kink there, so a span is made to end there; if a station is traced, end the span by a
            Disc of zero mass instead.
        at: station(s) [m] or names of casings to observe, by default that of the force.

    Returns:
        `HarmonicResponse` to the force alone. The sign of hysteretic damping follows each part's whirl,
        `w` or `-w`, relative to the speed. Differentiable.

    Raises:
        ValueError: the scene has contact, some unequal axes stand still and others turn, a station is
            off the shaft, or a frequency is an undamped resonance.
    """
    check_one_shaft(scene.shafts, "`forced_response`")
    check_linear(scene)
    scene = ending_span(scene, scene.stations(force.at)[0])
    frequencies, places = _cases(scene, frequencies, force.at if at is None else at)
    speeds = jnp.broadcast_to(scene.spin.speed, frequencies.shape)
    forces = eqx.Partial(_of_force, force)
    forward, backward, *mirrored = _respond(scene, speeds, frequencies, places, forces)
    rotating = frame(structure(scene).blocks) == "rotating"
    sidebands = jnp.stack(mirrored) if rotating else None
    return HarmonicResponse(speeds, frequencies, places.stations, forward, backward, sidebands)


def steady_state(scene: Scene) -> tuple[Complex[Array, " n"], Complex[Array, " n"]]:
    """`q, q.` of the steady motion under unbalance, weight and misalignment at rotation angle zero.

    A run that starts there, `run_up(scene, times, start=Continued(*steady_state(scene)))`, is steady
    from the first sample on, stable or not. No time stepping is needed.

    Args:
        scene: a rotor without contact or balls, at constant speed.

    Returns:
        Coordinates and their rates. Differentiable.

    Raises:
        ValueError: the scene has contact or balls, some unequal axes stand still and others turn, or the
            speed is an undamped critical speed or resonance.

    Source: Azarov, Gouskov, Panovko (2023), eq. (9); Klochkov, eqs. (4), (8).
    """
    check_one_shaft(scene.shafts, "`steady_state`")
    check_linear(scene)
    _cases(scene, 0.0, None)
    if scene.of(AbstractBodies):
        raise ValueError("Balls have many steady positions; use `run_up` to find one.")
    q, velocity, distance = _steady(assemble(scene))
    if known(distance) and distance < CRITICAL:
        check_constant_load(scene, 0.0 if structure(scene).load.steady else scene.spin.speed)
        raise ValueError(
            f"The response is unbounded at {float(scene.spin.speed):g} rad/s, an undamped critical speed "
            "or resonance; add damping."
        )
    return q, velocity


@compiled_quickly
def _steady(system: System):
    speed = system.spin.speed
    if not system.n:
        return jnp.zeros(0, complex), jnp.zeros(0, complex), jnp.ones(())
    ahead, back, mirrored, _, near = _parts(system, speed, *_of_unbalance(system))
    static, same, twice, _, far = _parts(system, jnp.zeros(()), *_of_weight(system))
    velocity = 1j * speed * (ahead + mirrored - back + 2 * twice)
    return ahead + back + mirrored + static + same + twice, velocity, jnp.minimum(near, far)


def _of_unbalance(system: System):
    return system.load.unbalance_force(system.spin.speed), None


def _of_other(shaft: str, system: System):
    return force_of(shaft, system.others, system.spin.speed), None


def _of_weight(system: System):
    speed = system.spin.speed
    return system.load.still_force(speed), None, system.load.twice_force(speed)


def _of_force(force: HarmonicForce, system: System):
    column = system.line.column(force.at)
    forward, backward = (None if part is None else part * column for part in force.parts)
    return forward, backward


def ending_span(scene: Scene, at: Scalar) -> Scene:
    """The scene with a span that ends at a station, if all values that determine the spans are known."""
    placed = [getattr(effect, "at", at) for effect in scene.effects]
    if all(map(known, (at, scene.shaft.length, *scene.shaft.stations, *placed))):
        return scene.of_parts(*scene.effects, Disc(at, mass=0.0))
    return scene


def unbalance_system(scene: Scene, at, by: str | None = None) -> Unbalanced:
    """Equations, places and shaft of `unbalance_response`, for many calls of `radius_and_distance`."""
    line = OperatingLine.of(scene, by)
    other = None if line is None or not line.by else by
    return Unbalanced(assemble(synchronous(scene)), Places.of(scene, at), other)


@compiled_quickly
def radius_and_distance(rotor: Unbalanced, speed: Scalar) -> tuple[Float[Array, " s"], Scalar]:
    """Major half axes [m] of the response to unbalance at one speed (s,), and distance from resonance.

    Where the distance is below `CRITICAL` the response is infinite, for want of damping. See
    `unbalance_system`.
    """
    frequency, forces = speed, _of_unbalance
    if rotor.by is not None:
        clocks = [one.clock for one in rotor.system.others if one.name == rotor.by]
        frequency = clocks[0].speed(speed) if clocks else speed
        forces = eqx.Partial(_of_other, rotor.by)
    case = speed, frequency
    forward, backward, mirrored, _, distance = _parts_at(rotor.system, case, rotor.places, forces)
    return _major(forward + mirrored, backward), distance


def _cases(scene: Scene, cases, at) -> tuple[Float[Array, " k"], Places]:
    """Speeds or frequencies (k,), and places (s,); raises unless there is a closed-form response."""
    system = structure(scene)
    if system.ports:
        kinds = sorted({effect.plural for effect in scene.of(AbstractContact)})
        raise ValueError(
            "The closed-form response is that of a linear rotor, but the scene has contacts "
            f"({system.owners_of('contact')}); remove them, as by "
            f"{', '.join(f'`scene.without({kind!r})`' for kind in kinds)}, or use `jaxrotor.simulate`."
        )
    check_axes(
        system,
        "The response to a harmonic load is an infinite series of frequencies, not a closed form,",
        "use `jaxrotor.run_up`, or make one kind of axes equal",
    )
    return jnp.atleast_1d(jnp.asarray(cases, float)), Places.of(scene, at)


def _respond(scene: Scene, speeds, frequencies, places: Places, forces):
    """Parts at `w`, `-w` and, mirrored in rotating axes, at `2 Omega - w`, `2 Omega + w`; (k, s) each.

    `forces(system)` are `f, b` of `f exp(i w t) + b exp(-i w t)`, None where there is none; a third one is
    that beside `f` at `2 Omega - w`, if any.
    """
    *parts, distance = _parts_of_all(assemble(scene), speeds, frequencies, places, forces)
    if known(distance) and np.any(np.asarray(distance) < CRITICAL):
        bad = int(np.argmin(distance))
        check_constant_load(scene, frequencies[bad])
        raise ValueError(
            f"The response is unbounded at a speed of {float(speeds[bad]):g} rad/s and a frequency of "
            f"{float(frequencies[bad]):g} rad/s, an undamped critical speed or resonance; add damping."
        )
    return parts


@compiled_quickly
def _parts_of_all(rotor: System, speeds, frequencies, places: Places, forces):
    return jax.lax.map(lambda case: _parts_at(rotor, case, places, forces), (speeds, frequencies))


def _parts_at(rotor: System, case: tuple[Scalar, Scalar], places: Places, forces):
    system = rotor.at_speed(case[0])
    *parts, distance = _parts(system, case[1], *forces(system))
    rows = places.rows(system.line)
    return *(rows @ part for part in parts), distance


def _parts(system: System, frequency: Scalar, forward, backward, beside: Array | None = None):
    """The four parts of `q` (see `_respond`), and the smallest distance from resonance."""
    n, speed, axes = system.n, system.spin.speed, frame(system.blocks)
    none = jnp.zeros(n, complex)
    filled = lambda force: none if force is None else force

    def solve(pencil, at, force):
        turned = speed if axes == "rotating" else 0.0  # whose stiffness has such forces, too
        inertia = (at**2 + turned**2) * pencil.inertia
        damping = (jnp.abs(at) + jnp.abs(turned)) * pencil.damping
        return pencil.response(at, force), from_resonance(pencil.dynamic(at), damping, inertia)

    def circular(at, force):
        if force is None:
            return none, 1.0
        return solve(Pencil.of(system, jnp.sign(at - speed)), at, force)

    def rotating(at, force, mirrored=None):
        """Response in the axes of the shaft, and its mirror image there, which may have a force, too."""
        if force is None:
            return none, none, 1.0
        pair = jnp.concatenate([force, filled(mirrored).conj()])
        q, distance = solve(Pencil.of(system), at - speed, pair)
        return q[:n], q[n:].conj(), distance

    if isotropic(system.blocks):
        (q, near), (p, far) = circular(frequency, forward), circular(-frequency, backward)
        return q, p, none, none, jnp.minimum(near, far)
    if axes == "rotating":
        q, q_mirrored, near = rotating(frequency, forward, beside)
        p, p_mirrored, far = rotating(-frequency, backward)
        return q, p, q_mirrored, p_mirrored, jnp.minimum(near, far)
    if forward is None and backward is None:
        return none, none, none, none, jnp.ones(())
    pair = jnp.concatenate([filled(forward), filled(backward).conj()])
    q, distance = solve(Pencil.of(system), frequency, pair)
    return q[:n], q[n:].conj(), none, none, distance
