"""Speeds at which a rotor loses or regains stability."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.blocks import Blocks
from ..core.checks import check_counts
from ..core.compiled import compiled_quickly
from ..core.progress import waiting
from ..core.quantities import Scalar, known, on_host
from ..core.roots import sign_change
from ..core.tables import RPM
from ..equations.pencil import ROUNDING, Pencil, eigenvalues, frame, is_rounding, isotropic
from ..equations.speed_tables import speed_range
from ..equations.system import System
from ..scene import Scene
from .growth import (
    EDGES,
    beyond_rounding,
    first_frequency,
    largest_growth,
    rate_over_speed,
    roots_at,
    undamped_side,
    why_unknown,
)
from .linearized import check_linear
from .whirl_tables import OverWhirl


REACH = 16  # see `_turn`
TURNS = 8  # number of turning points of the growth rate refined between samples


class Onset(NamedTuple):
    """Speed where the largest growth rate crosses zero, and the whirl frequency there."""

    speed: Scalar  # [rad/s]
    whirl_frequency: Scalar  # [rad/s], positive from x to y; for unequal axes see `onset_speed`


def onset_speed(
    scene: Scene,
    within: tuple[float, float] | None = None,
    samples: int = 200,
    *,
    throw: bool = True,
    progress: bool | None = None,
) -> Onset:
    """Lowest speed at which the straight rotor becomes unstable: `max Re lambda(Omega) = 0`, rising.

    Lowest and rising are meant of the magnitude of the speed, so a reversed rotor is searched from 0
    down. With hysteresis the growth rate may cross zero by a jump, where a whirl is synchronous.

    Args:
        scene: the rotor; its own speed matters only by its sense, and not if `within` is given.
        within: two speeds [rad/s] between which to search, of either sense; by default 0 and about 40
            times the first natural frequency in the scene's sense, or the ends of tables over speed.
        samples: growth rates computed to bracket the crossing. A band of flutter narrower than an
            interval is found if the growth rate has an extremum near zero there; the `TURNS` extrema
            closest to zero are refined. Bands where an unequal shaft stands bent are always found, unless
            coefficients depend on the speed.
        throw: whether to raise where there is no onset. False gives NaN instead, so that one rotor of
            many under jax.vmap does not stop all.
        progress: whether to report after two seconds that the search is running; by default on a
            terminal.

    Returns:
        `Onset`: speed to 1e-12 and whirl frequency, differentiable by the implicit function theorem.
        Where axes are unequal the frequency is not negative and refers to the axes of `roots`. In axes
        that turn with the shaft, zero is a bent shaft (divergence, synchronous whirl), and any other `w`
        a flutter with `speed + w` and `speed - w` in fixed axes.

    Raises:
        ValueError: `within` is one speed, `samples` is not an integer of at least 8, or, if `throw`,
            the rotor never loses stability in the range, is unstable from its start, has no damping,
            or turns too slowly for `growth_rate`.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 2; Klochkov, Figs. 2-9.
    """
    check_linear(scene, [] if within is None else within)
    with waiting(progress, "onset of instability"):
        system = OverWhirl.of(scene)
        speeds, sign = _scan(system, _checked(within, samples), samples, outward=True)
        found = _onset(system, speeds, sign, samples, throw)
        return jax.block_until_ready(found) if known(found.speed) else found


def _onset(system: System | OverWhirl, speeds: Any, sign: Any, samples: int, throw: bool) -> Onset:
    """The first loss of stability, from speeds and the sign of the growth rate there."""
    if known(sign) and known(speeds):
        speeds, sign = np.asarray(speeds), np.asarray(sign)
    slowest = abs(speeds).argsort()[: samples // 4]
    inner, outer = _outward(speeds, sign)
    rising = (inner <= 0) & (outer > 0)
    marginal = (sign[slowest] == 0).all() & ~rising.any()
    refusals = [
        ((sign != sign).any(), why_unknown(isinstance(system, OverWhirl))),
        (marginal & getattr(system, "free", False), "The rotor is free, and no motion grows,"),
        (marginal, f"{_undamped(system.blocks)}, so it is neither stable nor unstable,"),
        (sign[slowest[0]] > 0, "The rotor is unstable already at the lowest speed,"),
        (~rising.any(), "The rotor never loses its stability"),
    ]
    for wrong, sentence in refusals if throw else ():
        if known(wrong):
            if bool(wrong):
                low, high = sorted((speeds[0], speeds[-1]), key=abs)
                raise ValueError(
                    f"{sentence} from {low:g} to {high:g} rad/s ({RPM * low:.6g} to {RPM * high:.6g} "
                    "rpm); search other speeds by `within`."
                )
        else:
            speeds = eqx.error_if(speeds, wrong, f"{sentence} at the speeds searched.")
    first = (abs(speeds[1:] + speeds[:-1]) + 1e300 * ~rising).argmin()
    low, high = (jnp.asarray(on_host(speeds[i])) for i in (first, first + 1))
    found = _refine(system, low, high)
    if throw:
        return found
    none = jnp.any(jnp.stack([wrong for wrong, _ in refusals]))
    return Onset(*(jnp.where(none, jnp.nan, part) for part in found))


def _undamped(blocks: Blocks) -> str:
    """Why a rotor is neither stable nor unstable: nothing damps it, or not all of its modes."""
    parts = blocks.damping, blocks.fixed_damping, blocks.rotating_damping, blocks.hysteretic
    if any(part is not None and not (known(part) and not np.any(part)) for part in parts):
        return "Some modes of the rotor have no damping beyond rounding"
    return "The rotor has no damping"


def _outward(speeds: Any, signs: Any) -> tuple[Any, Any]:
    """Signs at the slower and at the faster end of every interval of speed."""
    inward = abs(speeds[1:]) < abs(speeds[:-1])
    turned = (signs[1:] - signs[:-1]) * inward
    return signs[:-1] + turned, signs[1:] - turned


def stability_crossings(
    scene: Scene, within: tuple[float, float] | None = None, samples: int = 200
) -> list[tuple[Onset, bool]]:
    """All speeds in a range at which `max Re lambda(Omega)` changes sign.

    A rotor without damping counts as stable: its crossings are the edges of unstable bands.

    Args:
        scene: the rotor; its own speed matters only by its sense, and not if `within` is given.
        within: speeds [rad/s] to search, as in `onset_speed`.
        samples: growth rates computed to bracket the crossings, as in `onset_speed`.

    Returns:
        List of `(Onset, lost)` by rising magnitude of the speed; with it stability is lost where `lost`
        is True and regained where it is False. Each `Onset` is differentiable.

    Raises:
        ValueError: `within` is one speed, `samples` is not an integer of at least 8, the scene is
            traced, or the rotor turns too slowly for `growth_rate`.
    """
    check_linear(scene, [] if within is None else within)
    system = OverWhirl.of(scene)
    speeds, sign = _scan(system, _checked(within, samples), samples, outward=False)
    if not known(sign):
        raise ValueError(
            "The number of crossings depends on values, so `stability_crossings` cannot run inside "
            "jax.jit or jax.vmap; call it outside, or use `onset_speed`."
        )
    unknown = jnp.isnan(sign)
    if jnp.any(unknown):
        reason = why_unknown(isinstance(system, OverWhirl))
        raise ValueError(
            f"{reason} at {speeds[unknown][0]:g} rad/s; search other speeds by `within`."
        )
    speeds, unstable = np.asarray(speeds), 1 * (np.asarray(sign) > 0)
    inner, outer = _outward(speeds, unstable)
    places = sorted(np.flatnonzero(inner != outer), key=lambda i: abs(speeds[i]))
    return [(_refine(system, *map(jnp.asarray, speeds[i : i + 2])), bool(outer[i])) for i in places]


def _checked(within, samples: int) -> tuple[Array, Array] | None:
    """The range as arrays, so that all ranges share one compiled program."""
    check_counts(8, samples=samples)
    ends = () if within is None or not all(map(known, within)) else tuple(map(float, within))
    if ends and ends[0] == ends[1]:
        raise ValueError(f"`within` must be two different speeds, but is {within!r}.")
    if within is None:
        return None
    return jnp.asarray(within[0], float), jnp.asarray(within[1], float)


@compiled_quickly
def _scan(
    system: System | OverWhirl, within, samples: int, outward: bool
) -> tuple[Float[Array, " w"], Float[Array, " w"]]:
    """Speeds (samples and turning points), and the sign of the growth rate there, 0 if marginal.

    `outward`: from the lowest magnitude on, up to the first loss of stability and no further: the rotor
    counts as unstable beyond.
    """
    system = jax.lax.stop_gradient(system)
    growth_at = rate_over_speed(system)
    low, high = jnp.sort(jnp.stack(_range(system) if within is None else within))
    speeds = jax.lax.stop_gradient(jnp.linspace(low, high, samples + 1))
    turning = frame(system.blocks) == "rotating"
    if isinstance(system, System) and turning and system.tabled is None:
        bent = _bent(system, low, high)
        between = (bent[1:] + bent[:-1]) / 2
        speeds = jnp.sort(jnp.concatenate([speeds, bent, between]))
    # One speed at a time: see `sweep._build_lanes` on batched linear algebra.
    growth = _until_lost(growth_at, speeds) if outward else jax.lax.map(growth_at, speeds)
    before, here, after = growth[:-2], growth[1:-1], growth[2:]
    peak = (here < 0) & (here >= before) & (here >= after)
    dip = (here > 0) & (here <= before) & (here <= after)
    closest = jnp.where(peak | dip, jnp.abs(here), jnp.inf)
    calls = jnp.argsort(closest)[:TURNS]
    three = lambda array, i: jax.lax.dynamic_slice(array, (i,), (3,))
    turn = lambda i: _turn(growth_at, three(speeds, i), three(growth, i))
    as_it_is = lambda i: (speeds[i + 1], here[i])  # most rotors have fewer turning points
    either = lambda i: jax.lax.cond(jnp.isfinite(closest[i]), turn, as_it_is, i)
    turns = jax.lax.map(either, calls)
    speeds, growth = jnp.concatenate([speeds, turns[0]]), jnp.concatenate([growth, turns[1]])
    order = jnp.argsort(speeds)
    return speeds[order], jnp.sign(growth)[order]


def _range(system: System | OverWhirl) -> tuple[Scalar, Scalar]:
    """Speeds that are searched by default, in the sense of the spin."""
    sense = system.spin.sense
    span = None if system.tabled is None else speed_range(system.tabled, sense)
    low, high = (jnp.zeros(()), 40 * first_frequency(system)) if span is None else span
    return sense * low, sense * high


def _bent(system: System, low: Scalar, high: Scalar) -> Float[Array, " b"]:
    """Speeds in a range at which the shaft can stand bent in its own axes; `high` fills up.

    `P(0) = K0 + Omega K1 + Omega^2 K2` is singular there. Solved as an eigenvalue problem, without a
    grid of speeds, so that no band is too narrow to be found.
    """
    scale = first_frequency(system)
    still, ahead, back = (Pencil.of(system.at_speed(x * scale)).stiffness for x in (0.0, 1.0, -1.0))
    odd, even = (ahead - back) / 2, (ahead + back) / 2 - still
    # The unknown is -i Omega / scale, so that the real shift of `eigenvalues` is not a root.
    speeds = 1j * scale * eigenvalues(Pencil(-even, 1j * odd, still))
    there = (jnp.abs(speeds.imag) < 1e-6 * jnp.abs(speeds)) & (speeds.real > low)
    return jnp.sort(jnp.where(there & (speeds.real < high), speeds.real, high))


def _until_lost(growth_at: Callable, speeds: Float[Array, " w"]) -> Float[Array, " w"]:
    """Growth rates from the lowest magnitude of the speed on; infinite beyond the first above zero."""
    order = jnp.argsort(jnp.abs(speeds))
    one_sense = speeds[0] * speeds[-1] >= 0  # else all, as both senses may lose it

    def go(state):
        k, growth, _ = state
        own = growth_at(speeds[order[k]])
        return k + 1, growth.at[order[k]].set(own), one_sense & (own > 0)

    goes_on = lambda state: (state[0] < speeds.size) & ~state[2]
    begin = 0, jnp.full_like(speeds, jnp.inf), jnp.zeros((), bool)
    return jax.lax.while_loop(goes_on, go, begin)[1]


def _turn(
    growth_at: Callable, speeds: Float[Array, " 3"], growth: Float[Array, " 3"]
) -> tuple[Array, Array]:
    """Speed and growth rate at the extremum of the rate among three speeds, by golden section.

    It ends where the rate has changed its sign, or zero is further than `REACH` times what the best rate
    exceeds the lower end by: a concave rate rises by 1.6 times that at most.
    """
    sign = -jnp.sign(growth[1])

    # `optimistix.GoldenSearch` compiles about 0.3 s longer (of 1.5 to 3 s) and runs no faster.
    def narrow(state):
        k, (low, best, high), (left, top, right) = state
        above = high - best > best - low
        speed = best + (3 - 5**0.5) / 2 * jnp.where(above, high - best, low - best)
        value = sign * growth_at(speed)
        better = value > top
        # The new place, or the best one before, becomes an end.
        end, at_end = jnp.where(better, best, speed), jnp.where(better, top, value)
        moves_low = better == above
        low, left = jnp.where(moves_low, end, low), jnp.where(moves_low, at_end, left)
        high, right = jnp.where(moves_low, high, end), jnp.where(moves_low, right, at_end)
        best, top = jnp.where(better, speed, best), jnp.maximum(value, top)
        return k + 1, (low, best, high), (left, top, right)

    def goes_on(state):
        k, _, (left, top, right) = state
        return (k < 36) & (top < 0) & (top + REACH * (top - jnp.minimum(left, right)) >= 0)

    state = 0, tuple(speeds), tuple(sign * growth)
    _, (_, speed, _), (_, top, _) = jax.lax.while_loop(goes_on, narrow, state)
    return speed, sign * top


@compiled_quickly
def _refine(system: System | OverWhirl, low: Scalar, high: Scalar) -> Onset:
    speed = _crossing(system, low, high)
    step = 1e-3 * (high - low)
    # One place after the other, so that the roots are compiled once.
    places = jnp.stack([speed, high, speed + step, speed - step])
    values, there, *either = jax.lax.map(lambda place: roots_at(system, place), places)
    towards = jnp.where(beyond_rounding(there, first_frequency(system)) > 0, *either)
    whirl = values[_crosses(system, values, towards)].imag
    if system.blocks.hysteretic is not None:
        whirl = jnp.where(_synchronous(values, speed), speed, whirl)
    return Onset(speed, whirl if isotropic(system.blocks) else jnp.abs(whirl))


def _crosses(system: System | OverWhirl, values: Array, beyond: Array) -> Array:
    """Index of the root that crosses: of marginal ones that which grows on the unstable side, `beyond`."""
    growing = beyond[jnp.argmax(beyond.real)].imag
    size = jnp.maximum(
        first_frequency(system), jnp.max(jnp.where(jnp.isfinite(values), abs(values), 0.0))
    )
    # Near a double root, where a band of divergence ends, all roots have few digits.
    tied = values.real >= largest_growth(values) - 1e3 * ROUNDING * size
    return jnp.argmin(jnp.where(tied, jnp.abs(values.imag - growing), jnp.inf))


@eqx.filter_custom_jvp
def _crossing(system: System | OverWhirl, low: Scalar, high: Scalar) -> Scalar:
    """Speed between `low` and `high` where stability changes."""
    ends = jax.lax.map(rate_over_speed(system), low + jnp.asarray(EDGES) * (high - low))
    lost, marginal = ends[-1] > 0, undamped_side(ends)
    first = first_frequency(system)

    def growth(speed: Scalar) -> Scalar:
        values = roots_at(system, speed)
        return jnp.where(marginal, beyond_rounding(values, first), largest_growth(values))

    return sign_change(growth, low, high, ends[0], ends[-1], lost)


@_crossing.def_jvp
def _crossing_jvp(primals, tangents):
    """`dOmega = -dr / (dr / dOmega)`, with the residual r the growth rate or `Omega - Im lambda`."""
    system, low, high = primals
    speed = _crossing(system, low, high)
    values = roots_at(system, speed)
    jump = jnp.zeros((), bool)
    if system.blocks.hysteretic is not None:
        jump = _synchronous(values, speed)
    nearest = jnp.argmin(jnp.abs(jnp.sort(values.imag) - speed))

    def residual(system, speed):
        values = roots_at(system, speed)
        return jnp.where(jump, speed - jnp.sort(values.imag)[nearest], largest_growth(values))

    _, change = eqx.filter_jvp(lambda system: residual(system, speed), (system,), (tangents[0],))
    slope = jax.jvp(lambda speed: residual(system, speed), (speed,), (jnp.ones_like(speed),))[1]
    return speed, -change / slope


def _synchronous(values: Array, speed: Scalar) -> Array:
    return jnp.any(is_rounding(values.imag - speed, speed))
