"""Objectives: numbers of a scene to tune by, each with where it is smooth.

Functions of a scene and options, to be put together freely: `lambda scene: objectives.anisotropy(scene,
speeds) - 1e-3 * objectives.onset_speed(scene)`. What is to grow gets a minus sign.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .. import analysis
from ..core.extremes import largest
from ..core.quantities import Scalar, known
from ..effects import AbstractBodies, AbstractContact, InternalDamping, Support
from ..equations.pencil import Pencil, isotropic
from ..equations.system import assemble
from ..motion.reactions import reactions
from ..motion.run_up import run_up
from ..motion.simulate import simulate
from ..orbits import periodic
from ..scene import Scene


# === speeds and stability


def onset_speed(
    scene: Scene, within: tuple[float, float] | None = None, samples: int = 200
) -> Scalar:
    """`Omega*` [rad/s] with `max Re lambda(Omega*) = 0`, rising; see `jaxrotor.onset_speed`.

    Smooth while the same whirl is the first to grow. It jumps where a band of instability opens or
    closes below, its slope grows without bound where two crossings merge (a tongue's tip), and it is
    not a number where there is none.
    """
    return analysis.onset_speed(scene, within, samples, throw=False).speed


def critical_gap(scene: Scene, order: int = 0) -> Scalar:
    """`P_along - P_across` [rad/s] of the critical speeds of an unequal shaft; see `axis_speeds`.

    Signed, so smooth through zero, where its square is least and the band between the two speeds
    closes; the sorted difference has a kink there. `order` counts critical speeds from 0.

    Source: Klochkov, eq. (17).
    """
    along, across = analysis.axis_speeds(scene)
    return along[order] - across[order]


def largest_growth(scene: Scene, speeds: Any, sharpness: float | int | None = None) -> Scalar:
    """`max_Omega max Re lambda` [1/s] over given speeds, or a smooth mean, `log( mean exp(s r) ) / s`.

    Without the sharpness `s` [s] it has kinks, where the largest moves to another speed or another
    root, and at exceptional points the slope grows as `1 / sqrt(distance)`. At a kink the derivative is
    a mean of both sides. It may be flat over whole ranges: without internal damping, away from bands of
    instability, every root has the same decay. The smoothed one lies below the largest, and its minimum
    elsewhere. Least growth is not least anisotropy.

    Source: sheet of the rotor of two stiffnesses, section 4.
    """
    rates = _over(speeds, lambda speed: analysis.growth_rate(scene.at_speed(speed)))
    if sharpness is None:
        return largest(rates)
    return (jax.nn.logsumexp(sharpness * rates) - jnp.log(rates.size)) / sharpness


def damping_ratio(scene: Scene, mode: int = 0) -> Scalar:
    """`-Re lambda / |lambda|` [1] of one of the `jaxrotor.modes`, counted from the slowest, 0.

    Smooth while modes keep their order; it jumps to another mode where two are equally fast, and has a
    slope without bound where two roots merge.
    """
    return analysis.modes(scene, mode + 1).damping_ratio[mode]


# === unequal stiffness


def anisotropy(scene: Scene, speeds: Any, at: Any = None) -> Scalar:
    """`mean |D_x - D_y|^2 / |D_x + D_y|^2` [1] at `s = i Omega`, over given speeds.

    `D(s)` is the dynamic stiffness that shaft, supports and internal damping offer at a station, in the
    axes that turn with the shaft where these are unequal: no inertia, no damping by a medium. Cross
    terms that are not those of a turn count as differences. Smooth, and of one minimum wherever that
    was looked at. Zero exactly where the rotor is isotropic; internal damping leaves a remainder, and
    moves the minimum a little.

    Args:
        scene: a rotor unequal in one frame.
        speeds: [rad/s], one or many.
        at: station [m], by default the observed one of `simulate`.

    Source: sheet of the rotor of two stiffnesses, sections 1.5 and 4 (R5).
    """
    station = scene.stations(at)[0]
    system = assemble(scene)
    blocks = scene.shaft.blocks(system.line)
    for effect in (*scene.of(Support), *scene.of(InternalDamping)):
        blocks = blocks + effect.blocks(system.line)
    if isotropic(blocks):
        raise ValueError(
            "The rotor is the same along every axis, so there is no anisotropy to tune; give a shaft or "
            "support its `anisotropy`."
        )
    still = jnp.zeros((system.n, system.n))
    blocks = dataclasses.replace(blocks, inertia=still, gyroscopic=None)
    held = dataclasses.replace(system, blocks=blocks)
    pair = lambda part: jax.scipy.linalg.block_diag(part[None], part[None])
    rows, columns = pair(system.line.row(station)), pair(system.line.column(station)).T

    def one(speed: Scalar) -> Scalar:
        dynamic = Pencil.of(held.at_speed(speed)).dynamic(speed)
        seen = jnp.linalg.inv(rows @ jnp.linalg.solve(dynamic, columns + 0j))
        sizes = seen.real**2 + seen.imag**2
        return (sizes[0, 1] + sizes[1, 0]) / (sizes[0, 0] + sizes[1, 1])

    return jnp.mean(_over(speeds, one))


def twice_share(scene: Scene, speeds: Any, at: Any = None) -> Scalar:
    """`mean |z_2|^2 / (|z_2|^2 + |z_0|^2)` [1], of the twice-per-revolution response to weight.

    `z_0` is the deflection under weight, see `jaxrotor.weight_response`. Smooth and between 0 and 1, so
    resonances between given speeds make no false minima that count; zero where the rotor is isotropic.

    Source: sheet of the rotor of two stiffnesses, section 4 (R4).
    """
    twice, still = _weight(scene, speeds, at)
    return jnp.mean(twice / (twice + still))


def twice_response(scene: Scene, speeds: Any, at: Any = None) -> Scalar:
    """`mean |z_2|^2` [m^2], the square of the twice-per-revolution response to weight.

    Smooth at every damping above zero. Of speeds below half the first critical one it has one minimum;
    over resonances a lightly damped rotor has false ones, where a resonance falls between two speeds.

    Source: sheet of the rotor of two stiffnesses, section 4 (R1, R6).
    """
    return jnp.mean(_weight(scene, speeds, at)[0])


def _weight(scene: Scene, speeds: Any, at: Any) -> tuple[Array, Array]:
    """Squares of the parts at twice the speed and at rest [m^2]."""
    found = analysis.weight_response(scene, speeds, at)
    return _square(found.twice), _square(found.deflection)


# === unbalance


def unbalance_peak(
    scene: Scene, speeds: Any, at: Any = None, power: float | int | None = None
) -> Scalar:
    """`max |z|` [m] of the unbalance response over given speeds; by `power`, `mean(|z|^p)^(1/p)`.

    `|z|` is the larger half axis of the orbit. The maximum has kinks, where the largest moves to another
    speed or station, and between speeds it sees nothing: a resonance narrower than their distance makes
    false minima. The mean by a power is smooth and lies below the largest.
    """
    return peak(analysis.unbalance_response(scene, speeds, at).major, power)


def unbalance_rms(scene: Scene, speeds: Any, at: Any = None) -> Scalar:
    """`sqrt( mean |z|^2 )` [m] of the unbalance response over given speeds and stations.

    `|z|^2` is the mean over the orbit, `|z_f|^2 + |z_b|^2`. Smooth at every damping above zero, unless
    there is no response at all.
    """
    found = analysis.unbalance_response(scene, speeds, at)
    return jnp.sqrt(jnp.mean(_square(found.forward) + _square(found.backward)))


# === motion


def contact_peak(
    scene: Scene, revolutions: int, *, power: float | int | None = None, **run: Any
) -> Scalar:
    """`max |F|` [N] of all contacts at the samples of a window, by `power` `mean(|F|^p)^(1/p)`.

    The derivative is that of the discretised motion. It is exact while the steps at which contacts
    begin and end stay the same, where the force has a kink (or a jump, of a damped stop). The maximum
    has more of them, where it moves to another sample. Long chaotic motions have no useful derivative:
    keep the window short.

    Args:
        scene: with contacts.
        revolutions: length of the run.
        power: of a smooth mean instead of the largest.
        **run: `start`, `keep`, `steps_per_revolution` and others of `simulate`.
    """
    return peak(jnp.abs(_contact(scene, revolutions, run)), power)


def contact_rms(scene: Scene, revolutions: int, **run: Any) -> Scalar:
    """`sqrt( mean sum |F|^2 )` [N] of all contacts over a window; smooth as `contact_peak` by a power."""
    squares = jnp.sum(_square(_contact(scene, revolutions, run)), axis=1)
    return jnp.sqrt(jnp.mean(squares))


def contact_work(scene: Scene, revolutions: int, **run: Any) -> Scalar:
    """`Int h Re(conj(z.) F) dt` [J] over a window, work of all contacts on the rotor.

    Above zero they feed the motion, by friction; below they take from it. The weight
    `h = cos^2(pi t / 2 T)` falls smoothly to zero at the end `T`, so what a stop stores and gives back
    cancels, also where the end cuts a contact in two. Smoother than the state at the end: of two bounces
    that part, the work is nearly the same. Contacts at one station; otherwise as of `contact_peak`.
    """
    at = {float(contact.at) for contact in scene.of(AbstractContact) if known(contact.at)}
    if len(at) > 1:
        raise ValueError(f"Contacts must be at one station, but are at {sorted(at)} m.")
    _check_contact(scene)
    if "at" in run:
        raise ValueError("The work is done where contacts are, so `contact_work` takes no `at`.")
    seen = simulate(scene, revolutions, at=scene.of(AbstractContact)[0].at, **run)
    power = jnp.real(
        jnp.conj(seen.velocity[:, 0]) * jnp.sum(cast(Array, seen.contact_force), axis=1)
    )
    share = (seen.time - seen.time[0]) / (seen.time[-1] - seen.time[0])
    return jnp.trapezoid(jnp.cos(0.5 * jnp.pi * share) ** 2 * power, seen.time)


def reaction_peak(
    scene: Scene,
    name: str,
    revolutions: int,
    *,
    power: float | int | None = None,
    **run: Any,
) -> Scalar:
    """`max |F|` [N] of one of the `jaxrotor.reactions` over a window, by `power` `mean(|F|^p)^(1/p)`.

    Without contact the motion is exact at every step, and the mean by a power is smooth; the maximum
    has kinks, where it moves to another sample. With contact see `contact_peak`.

    Args:
        scene: at constant speed.
        name: of the reaction, such as "supports.0".
        revolutions: length of the run.
        power: of a smooth mean instead of the largest.
        **run: `start`, `keep`, `steps_per_revolution` and others of `simulate`.
    """
    return peak(jnp.abs(_reaction(scene, name, revolutions, run)), power)


def reaction_rms(scene: Scene, name: str, revolutions: int, **run: Any) -> Scalar:
    """`sqrt( mean |F|^2 )` [N] of one of the `jaxrotor.reactions` over a window; see `reaction_peak`."""
    return jnp.sqrt(jnp.mean(_square(_reaction(scene, name, revolutions, run))))


def _check_contact(scene: Scene) -> None:
    if not scene.of(AbstractContact):
        raise ValueError("The scene has no contacts, so no contact force; give it a `Limiter`.")


def _contact(scene: Scene, revolutions: int, run: dict[str, Any]) -> Array:
    _check_contact(scene)
    return cast(Array, simulate(scene, revolutions, **run).contact_force)


def _reaction(scene: Scene, name: str, revolutions: int, run: dict[str, Any]) -> Array:
    return reactions(simulate(scene, revolutions, **run)).of(name)


# === periodic motion


class Rub(NamedTuple):
    """Of a periodic rub."""

    whirl_rate: Scalar  # over the speed [1], backward negative
    radius: Scalar  # mean by a power [m]


def rub(
    scene: Scene,
    orbit: Any,
    power: float | int | None = 2,
    *,
    at: Any = None,
    **find: Any,
) -> Rub:
    """Whirl rate `turn / (Omega T)` and radius `mean(|z|^p)^(1/p)` of the periodic rub near a known one.

    Smooth, by the implicit function theorem, as long as the orbit exists with the same order of contacts.
    Where it only just touches a stop that is elastic, the slope is continuous and its own slope without
    bound; a damped stop makes a kink, or ends the orbit. Where it is born or dies (a multiplier at 1)
    slopes grow without bound, and beyond it is not a number: keep bounds inside. A rate that is locked to
    the rotation is flat. The largest sample (`power=None`) has kinks.

    Args:
        scene: with contacts.
        orbit: of `jaxrotor.periodic`, of a scene not far away.
        power: of the mean over the samples.
        at: station [m], by default the observed one of `simulate`.
        **find: `steps_per_revolution`, `finder` and others of `periodic`.
    """
    _check_contact(scene)
    found = periodic(scene, orbit, at=scene.stations(at)[0], **find)
    return Rub(found.whirl_rate, peak(jnp.abs(found.displacement[:-1, 0]), power))


# === balls


def balancing_time(scene: Scene, times: Any, **run: Any) -> Scalar:
    """`Int |u| dt / |u(0)|` [s], `u` the imbalance of rotor and balls: `T` of one like `exp(-t / T)`.

    Smooth where the imbalance does not pass exactly through zero and balls do not collide. The time
    of `balancer.settling_time`, the first sample from which on all is still, is a step function of every
    parameter: it has no derivative to go by.

    Args:
        scene: with balls.
        times: ascending [s], of the samples; the run should end when balance is reached.
        **run: `start`, `controller` and others of `run_up`.
    """
    sizes = _imbalance(scene, times, run)
    return jnp.trapezoid(sizes, jnp.asarray(times, float)) / sizes[0]


def residual_imbalance(scene: Scene, times: Any, share: float = 0.25, **run: Any) -> Scalar:
    """`sqrt( mean |u|^2 ) / capacity` [1] over the last `share` of a run, `u` the imbalance left.

    Smooth unless it is zero or balls collide; flat once all is balanced, within the tolerance of the
    run. Arguments as of `balancing_time`.
    """
    sizes = _imbalance(scene, times, run)
    capacity = sum(jnp.sum(race.masses) * race.race_radius for race in scene.of(AbstractBodies))
    last = sizes[-max(1, round(share * sizes.size)) :]
    return jnp.sqrt(jnp.mean(last**2)) / capacity


def _imbalance(scene: Scene, times: Any, run: dict[str, Any]) -> Float[Array, " T"]:
    """Size of the imbalance left [kg m]."""
    if not scene.of(AbstractBodies):
        raise ValueError("The scene has no balls to balance it; give it a `BallBalancer`.")
    return jnp.abs(run_up(scene, times, **run).imbalance)


# === means


def peak(sizes: Float[Array, "..."], power: float | int | None) -> Scalar:
    """The largest, with kinks, or by `power` `p` the smooth `mean(s^p)^(1/p)`, at most the largest."""
    most = largest(sizes.ravel())
    if power is None:
        return most
    unit = jax.lax.stop_gradient(jnp.where(most == 0, 1.0, most))
    mean = jnp.mean((sizes / unit) ** power)
    return unit * jnp.where(mean == 0, 0.0, jnp.where(mean == 0, 1.0, mean) ** (1 / power))


def _square(vectors: Array) -> Array:
    return vectors.real**2 + vectors.imag**2


def _over(speeds: Any, of: Callable[[Scalar], Scalar]) -> Float[Array, " w"]:
    """Values at speeds, one after the other, so that memory does not grow with their number."""
    return jax.lax.map(of, jnp.atleast_1d(jnp.asarray(speeds, float)))
