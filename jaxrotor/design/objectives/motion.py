"""Motion: contact forces, bearing reactions and periodic rubs as objectives."""

from typing import Any, NamedTuple, cast

import jax.numpy as jnp
from jaxtyping import Array

from ...core.quantities import Scalar, known
from ...effects import AbstractContact
from ...motion.reactions import reactions
from ...motion.simulate import simulate
from ...orbits import periodic
from ...scene import Scene
from .means import peak, square


def contact_peak(
    scene: Scene, revolutions: int, *, power: float | int | None = None, **run: Any
) -> Scalar:
    """`max |F|` [N] of all contacts at the samples of a window, by `power` `mean(|F|^p)^(1/p)`.

    The derivative is that of the discretised motion. It is exact while the steps at which contacts
    begin and end stay the same, where the force has a kink (or a jump, of a damped stop). The maximum
    has more of them, where it moves to another sample. Long chaotic motions have no useful derivative:
    keep the window short.

    Args:
        scene: a rotor with contacts.
        revolutions: length of the run.
        power: `p` of the smooth mean; None for the largest.
        **run: `start`, `keep`, `steps_per_revolution` and other options of `simulate`.

    Returns:
        The peak force [N].

    Raises:
        ValueError: if the scene has no contacts.
    """
    return peak(jnp.abs(_contact_force(scene, revolutions, run)), power)


def contact_rms(scene: Scene, revolutions: int, **run: Any) -> Scalar:
    """`sqrt( mean sum |F|^2 )` [N] of all contacts over a window; smooth as `contact_peak` by a power.

    Args:
        scene: a rotor with contacts.
        revolutions: length of the run.
        **run: `start`, `keep`, `steps_per_revolution` and other options of `simulate`.

    Returns:
        The root mean square of the forces [N].

    Raises:
        ValueError: if the scene has no contacts.
    """
    squares = jnp.sum(square(_contact_force(scene, revolutions, run)), axis=1)
    return jnp.sqrt(jnp.mean(squares))


def contact_work(scene: Scene, revolutions: int, **run: Any) -> Scalar:
    """`Int h Re(conj(z.) F) dt` [J] over a window, work of all contacts on the rotor.

    Above zero they feed the motion, by friction; below they take from it. The weight
    `h = cos^2(pi t / 2 T)` falls smoothly to zero at the end `T`, so what a stop stores and returns
    cancels, also where the end cuts a contact in two. The work is smoother than the state at the end: two
    bounces that diverge do nearly the same work. Smooth as `contact_peak` by a power.

    Args:
        scene: a rotor with contacts at one station.
        revolutions: length of the run.
        **run: `start`, `keep`, `steps_per_revolution` and other options of `simulate`, but not `at`.

    Returns:
        The work [J].

    Raises:
        ValueError: if the scene has no contacts, or contacts at several stations, or `at` is given.
    """
    at = {float(contact.at) for contact in scene.of(AbstractContact) if known(contact.at)}
    if len(at) > 1:
        raise ValueError(f"Contacts must be at one station, but are at {sorted(at)} m.")
    _check_contact(scene)
    for contact in scene.of(AbstractContact):
        if contact.on is not None:
            raise ValueError(
                f"The work of `{scene.name_of(contact)}` is by its motion relative to the casing "
                f"{contact.on!r}, but `contact_work` is of contacts on the ground; leave out its `on`."
            )
    if "at" in run:
        raise ValueError(
            "The work is done where the contacts are, so `contact_work` takes no `at`; leave it out."
        )
    response = simulate(scene, revolutions, at=scene.of(AbstractContact)[0].at, **run)
    force = jnp.sum(cast(Array, response.contact_force), axis=1)
    power = jnp.real(jnp.conj(response.velocity[:, 0]) * force)
    time = response.time
    fraction = (time - time[0]) / (time[-1] - time[0])
    return jnp.trapezoid(jnp.cos(0.5 * jnp.pi * fraction) ** 2 * power, time)


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
        scene: the rotor, at constant speed.
        name: of the reaction, such as "supports.0".
        revolutions: length of the run.
        power: `p` of the smooth mean; None for the largest.
        **run: `start`, `keep`, `steps_per_revolution` and other options of `simulate`.

    Returns:
        The peak force [N].
    """
    return peak(jnp.abs(_reaction(scene, name, revolutions, run)), power)


def reaction_rms(scene: Scene, name: str, revolutions: int, **run: Any) -> Scalar:
    """`sqrt( mean |F|^2 )` [N] of one of the `jaxrotor.reactions` over a window; see `reaction_peak`.

    Args:
        scene: the rotor, at constant speed.
        name: of the reaction, such as "supports.0".
        revolutions: length of the run.
        **run: `start`, `keep`, `steps_per_revolution` and other options of `simulate`.

    Returns:
        The root mean square of the force [N].
    """
    return jnp.sqrt(jnp.mean(square(_reaction(scene, name, revolutions, run))))


def _check_contact(scene: Scene) -> None:
    if not scene.of(AbstractContact):
        raise ValueError("The scene has no contacts, so no contact force; give it a `Limiter`.")


def _contact_force(scene: Scene, revolutions: int, run: dict[str, Any]) -> Array:
    _check_contact(scene)
    return cast(Array, simulate(scene, revolutions, **run).contact_force)


def _reaction(scene: Scene, name: str, revolutions: int, run: dict[str, Any]) -> Array:
    return reactions(simulate(scene, revolutions, **run)).of(name)


# === periodic motion


class Rub(NamedTuple):
    """Whirl rate `turn / (Omega T)` and mean radius of a periodic rub."""

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
    bound; a damped stop makes a kink, or ends the orbit. Where the orbit appears or disappears (a
    multiplier at 1) slopes grow without bound, and beyond it the result is not a number: keep bounds
    inside. A rate that is locked to the rotation is flat. The largest sample (`power=None`) has kinks.

    Args:
        scene: a rotor with contacts.
        orbit: result of `jaxrotor.periodic`, of a scene not far away.
        power: `p` of the mean over the samples; None for the largest.
        at: station [m], by default the observed one of `simulate`.
        **find: `steps_per_revolution`, `finder` and other options of `periodic`.

    Returns:
        A `Rub`.

    Raises:
        ValueError: if the scene has no contacts.
        RuntimeError: if `periodic` finds no orbit near the known one.
    """
    _check_contact(scene)
    found = periodic(scene, orbit, at=scene.stations(at)[0], **find)
    return Rub(found.whirl_rate, peak(jnp.abs(found.displacement[:-1, 0]), power))
