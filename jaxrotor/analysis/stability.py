"""Growth rate of a rotor, and the speeds at which it loses or regains stability."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import check_counts
from ..core.compiled import compiled_quickly
from ..core.extremes import larger, largest
from ..core.progress import waiting
from ..core.quantities import Scalar, known
from ..equations.pencil import ROUNDING, Pencil, eigenvalues, frame, is_rounding, isotropic
from ..equations.system import System, assemble
from ..scene import Scene
from .floquet import exponents


EDGES = (0.0, 0.02, 0.98, 1.0)  # shares of a bracket where growth is looked at, see `undamped_side`
STEPS = (32, 128, 512)  # of half a revolution, the fewest that follow the first mode
TURNS = 8  # turning points of the growth rate looked at between samples


class Onset(NamedTuple):
    """Speed where the largest growth rate crosses zero, and the whirl frequency there."""

    speed: Scalar  # [rad/s]
    whirl_frequency: Scalar  # [rad/s], positive forward; of unequal axes see `onset_speed`


def growth_rate(scene: Scene) -> Scalar:
    """Largest growth rate [1/s], `max Re lambda`, negative stable, of the straight rotor.

    `lambda` are its `roots` or, where no frame has constant coefficients, the Floquet exponents
    `log(mu) / T` by as many `STEPS` as the first mode needs; where traced, by the fewest. Not a number
    where they are too few: below 1/30 of the first natural frequency where traced, else below 1/490.
    At rest such a rotor is taken as it stands. Zero where it is within rounding. Differentiable.
    """
    growth = _growth_rate(scene, STEPS[0])
    for steps in STEPS[1:]:
        if known(growth) and np.isnan(growth):
            growth = _growth_rate(scene, steps)
    return growth


@compiled_quickly
def _growth_rate(scene: Scene, steps: int) -> Scalar:
    return growth_of(assemble(scene), steps)[0]


def growth_of(system: System, steps: int = STEPS[0]) -> tuple[Scalar, Scalar]:
    """Largest growth rate [1/s], zero where it is within rounding, and as computed."""
    values = exponents(system, steps)
    return _beyond_rounding(values, _first(system)), _largest(values)


def undamped_side(ends: Any) -> Any:
    """Whether growth (4, ..) at `EDGES` of a bracket is rounding all along one end of it.

    That side is stable without damping, and growth there has no sign to search by: the boundary is
    where growth is more than rounding. At one place alone growth may be zero by chance.
    """
    still = ends == 0
    return still[:2].all(0) | still[2:].all(0)


def onset_speed(
    scene: Scene,
    within: tuple[float, float] | None = None,
    samples: int = 200,
    *,
    throw: bool = True,
    progress: bool | None = None,
) -> Onset:
    """Lowest speed at which the straight rotor turns unstable: `max Re lambda(Omega) = 0`, rising.

    Args:
        scene: the rotor; its own speed does not matter.
        within: speeds [rad/s] to search, by default 0 to about 40 times the first natural frequency.
        samples: growth rates taken to bracket the crossing; bands of flutter narrower than an
            interval are found where the growth rate turns back beside them, at the `TURNS` closest
            calls. Bands where an unequal shaft stands bent are never missed.
        throw: whether to raise where there is no onset. False gives NaN instead, so that one rotor of
            many under jax.vmap does not end all.
        progress: whether to say after two seconds that it is under way; by default on a terminal.

    Returns:
        Speed to 1e-12 and whirl frequency, differentiable by the implicit function theorem. The
        frequency is zero or positive where axes are unequal and counts in those of `roots`: zero in
        axes that turn with the shaft is a shaft that bends (divergence, synchronous whirl), any other
        `w` a flutter, seen as `speed + w` and `speed - w` in fixed axes. With hysteresis the growth
        rate jumps through zero where a whirl is synchronous.

    Raises:
        ValueError: no loss of stability in the range, unstable from its start, no damping, or speeds
            too slow for `growth_rate`.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 2; Klochkov, Figs. 2-9.
    """
    with waiting(progress, "onset of instability"):
        speeds, sign = _scan(scene, _checked(within, samples), samples)
        found = _onset(scene, speeds, sign, samples, throw)
        return jax.block_until_ready(found) if known(found.speed) else found


def _onset(scene: Scene, speeds: Array, sign: Array, samples: int, throw: bool) -> Onset:
    """The first loss of stability among speeds where growth has a sign."""
    rising = (sign[:-1] <= 0) & (sign[1:] > 0)
    marginal = jnp.all(sign[: samples // 4] == 0) & ~jnp.any(rising)
    refusals = [
        (jnp.any(jnp.isnan(sign)), "The slowest speeds are too slow for Floquet multipliers"),
        (marginal, "The rotor has no damping, so it is neither stable nor unstable,"),
        (sign[0] > 0, "The rotor is unstable already at the lowest speed,"),
        (~jnp.any(rising), "The rotor never loses its stability"),
    ]
    for wrong, sentence in refusals if throw else ():
        if known(wrong):
            if bool(wrong):
                raise ValueError(
                    f"{sentence} from {speeds[0]:g} to {speeds[-1]:g} rad/s; search other speeds by "
                    "`within`."
                )
        else:
            speeds = eqx.error_if(speeds, wrong, f"{sentence} at the speeds searched.")
    first = jnp.argmax(rising)
    found = _refine(scene, speeds[first], speeds[first + 1])
    if throw:
        return found
    none = jnp.any(jnp.stack([wrong for wrong, _ in refusals]))
    return Onset(*(jnp.where(none, jnp.nan, part) for part in found))


def stability_crossings(
    scene: Scene, within: tuple[float, float] | None = None, samples: int = 200
) -> list[tuple[Onset, bool]]:
    """All crossings in the range, in order, each with whether stability is lost (or regained).

    A rotor without damping counts as not unstable: its crossings are the edges of unstable bands.
    Arguments as of `onset_speed`.
    """
    speeds, sign = _scan(scene, _checked(within, samples), samples)
    if not known(sign):
        raise ValueError(
            "How many crossings there are depends on values, so `stability_crossings` cannot run inside "
            "jax.jit or jax.vmap; call it outside, or use `onset_speed`."
        )
    unknown = jnp.isnan(sign)
    if jnp.any(unknown):
        raise ValueError(
            "Floquet multipliers do not follow the first mode at speeds as low as "
            f"{speeds[unknown][0]:g} rad/s; begin `within` at a higher speed."
        )
    unstable = np.asarray(sign) > 0
    return [
        (_refine(scene, speeds[i], speeds[i + 1]), bool(unstable[i + 1]))
        for i in np.flatnonzero(unstable[:-1] != unstable[1:])
    ]


def _checked(within, samples: int) -> tuple[Array, Array] | None:
    """The range as arrays: other ranges are then the same compiled program."""
    check_counts(8, samples=samples)
    ends = () if within is None or not all(map(known, within)) else tuple(map(float, within))
    if ends and ends[0] >= ends[1]:
        raise ValueError(f"`within` must be a lower and a higher speed, but is {within!r}.")
    if within is None:
        return None
    return jnp.asarray(within[0], float), jnp.asarray(within[1], float)


@compiled_quickly
def _scan(scene: Scene, within, samples: int) -> tuple[Float[Array, " w"], Float[Array, " w"]]:
    """Speeds and the sign of the growth rate there, 0 marginal: samples and turning points."""
    system = assemble(jax.lax.stop_gradient(scene))
    growth_at = _growth(system)
    low, high = (jnp.zeros(()), 40 * _first(system)) if within is None else within
    speeds = jax.lax.stop_gradient(jnp.linspace(low, high, samples + 1))
    if frame(system.blocks) == "rotating":
        bent = _bent(system, low, high)
        between = (bent[1:] + bent[:-1]) / 2
        speeds = jnp.sort(jnp.concatenate([speeds, bent, between]))
    # One speed after the other: see `sweep._build_lanes` on batched linear algebra.
    growth = jax.lax.map(growth_at, speeds)
    before, here, after = growth[:-2], growth[1:-1], growth[2:]
    peak = (here < 0) & (here >= before) & (here >= after)
    dip = (here > 0) & (here <= before) & (here <= after)
    closest = jnp.where(peak | dip, jnp.abs(here), jnp.inf)
    calls = jnp.argsort(closest)[:TURNS]
    turn = lambda i: _turn(growth_at, jax.lax.dynamic_slice(speeds, (i,), (3,)), here[i])
    as_it_is = lambda i: (speeds[i + 1], here[i])  # most rotors have fewer turning points
    either = lambda i: jax.lax.cond(jnp.isfinite(closest[i]), turn, as_it_is, i)
    turns = jax.lax.map(either, calls)
    speeds, growth = jnp.concatenate([speeds, turns[0]]), jnp.concatenate([growth, turns[1]])
    order = jnp.argsort(speeds)
    return speeds[order], jnp.sign(growth)[order]


def _bent(system: System, low: Scalar, high: Scalar) -> Float[Array, " b"]:
    """Speeds in a range where a bent shaft stands still in its own axes; `high` for none.

    `P(0) = K0 + Omega K1 + Omega^2 K2` is singular there: no grid of speeds, so no band too narrow.
    """
    scale = _first(system)
    still, ahead, back = (Pencil.of(system.at_speed(x * scale)).stiffness for x in (0.0, 1.0, -1.0))
    odd, even = (ahead - back) / 2, (ahead + back) / 2 - still
    # Of -i Omega / scale, so that the real shift of `eigenvalues` is none of them.
    speeds = 1j * scale * eigenvalues(Pencil(-even, 1j * odd, still))
    there = (jnp.abs(speeds.imag) < 1e-6 * jnp.abs(speeds)) & (speeds.real > low)
    speeds = jnp.where(there & (speeds.real < high), speeds.real, high)
    return jnp.sort(speeds)


def _turn(growth_at: Callable, speeds: Float[Array, " 3"], growth: Scalar) -> tuple[Array, Array]:
    """Speed and growth rate where the rate comes closest to zero or past it, by golden section."""
    sign = -jnp.sign(growth)

    def narrow(_, state):
        low, best, high, top = state
        right = high - best > best - low
        speed = best + (3 - 5**0.5) / 2 * jnp.where(right, high - best, low - best)
        value = sign * growth_at(speed)
        better = value > top
        low = jnp.where(better == right, jnp.where(better, best, speed), low)
        high = jnp.where(better == right, high, jnp.where(better, best, speed))
        return low, jnp.where(better, speed, best), high, jnp.maximum(value, top)

    state = (*speeds, sign * growth)
    _, speed, _, top = jax.lax.fori_loop(0, 36, narrow, state)
    return speed, sign * top


@compiled_quickly
def _refine(scene: Scene, low: Scalar, high: Scalar) -> Onset:
    system = assemble(scene)
    speed = _crossing(system, low, high)
    values = _roots_at(system, speed)
    whirl = values[_crosses(system, speed, values, low, high)].imag
    if system.blocks.hysteretic is not None:
        whirl = jnp.where(_synchronous(values, speed), speed, whirl)
    return Onset(speed, whirl if isotropic(system.blocks) else jnp.abs(whirl))


def _crosses(system: System, speed: Scalar, values: Array, low: Scalar, high: Scalar) -> Array:
    """Which root crosses: that of the largest growth or, of several marginal ones, the next to grow."""
    way = jnp.where(_growth(system)(high) > 0, 1e-3, -1e-3)  # to where it is unstable
    beyond = _roots_at(system, speed + way * (high - low))
    growing = beyond[jnp.argmax(beyond.real)].imag
    size = jnp.maximum(_first(system), jnp.max(jnp.where(jnp.isfinite(values), abs(values), 0.0)))
    # Beside a double root, where a band of divergence ends, all have few digits.
    tied = values.real >= _largest(values) - 1e3 * ROUNDING * size
    return jnp.argmin(jnp.where(tied, jnp.abs(values.imag - growing), jnp.inf))


@eqx.filter_custom_jvp
def _crossing(system: System, low: Scalar, high: Scalar) -> Scalar:
    """Speed between `low` and `high` where stability changes."""
    ends = jax.lax.map(_growth(system), low + jnp.asarray(EDGES) * (high - low))
    lost, marginal = ends[-1] > 0, undamped_side(ends)
    first = _first(system)

    def growth(speed: Scalar) -> Scalar:
        values = _roots_at(system, speed)
        return jnp.where(marginal, _beyond_rounding(values, first), _largest(values))

    return _sign_change(growth, low, high, ends[0], ends[-1], lost)


def _sign_change(
    growth: Callable[[Scalar], Scalar],
    low: Scalar,
    high: Scalar,
    at_low: Scalar,
    at_high: Scalar,
    lost: Array,
) -> Scalar:
    """Speed where `growth` becomes positive, or ceases to be unless `lost`, to rounding.

    The interpolation is truncated towards the middle of the bracket, so the bracket is never wider than
    that of bisection one step before, also where the growth rate jumps. A growth rate takes all
    eigenvalues: eight to ten of them do here, where bisection takes 53.

    Source: Oliveira, Takahashi, ACM Trans. Math. Softw. 47 (2020), algorithm ITP, kappa_2 = 2, n_0 = 1.
    """
    width = high - low
    precision = jnp.finfo(width.dtype).eps
    narrow = larger(precision * width / 2, precision * jnp.abs(high))
    most = jnp.ceil(jnp.log2(width / (2 * narrow))) + 1

    def unfinished(state):
        step, low, high, *_ = state
        return (high - low > 2 * narrow) & (step < most)

    def halve(state):
        step, low, high, at_low, at_high = state
        middle = (low + high) / 2
        slope = at_high - at_low
        secant = jnp.where(slope == 0, middle, (low * at_high - high * at_low) / slope)
        towards = jnp.sign(middle - secant)
        shift = 0.2 / width * (high - low) ** 2
        truncated = jnp.where(shift <= jnp.abs(middle - secant), secant + towards * shift, middle)
        reach = larger(narrow * 2.0 ** (most - step) - (high - low) / 2, 0.0)
        near = jnp.abs(truncated - middle) <= reach
        speed = jnp.where(near, truncated, middle - towards * reach)
        value = growth(speed)
        beyond = (value > 0) == lost
        pick = lambda a, b: jnp.where(beyond, a, b)
        return (
            step + 1,
            pick(low, speed),
            pick(speed, high),
            pick(at_low, value),
            pick(value, at_high),
        )

    state = (jnp.zeros(()), low, high, at_low, at_high)
    _, low, high, _, _ = jax.lax.while_loop(unfinished, halve, state)
    return (low + high) / 2


@_crossing.def_jvp
def _crossing_jvp(primals, tangents):
    """`dOmega = -r' / (dr / dOmega)` of what is zero there: the growth rate or `Omega - Im lambda`."""
    system, low, high = primals
    speed = _crossing(system, low, high)
    values = _roots_at(system, speed)
    jump = jnp.zeros((), bool)
    if system.blocks.hysteretic is not None:
        jump = _synchronous(values, speed)
    nearest = jnp.argmin(jnp.abs(jnp.sort(values.imag) - speed))

    def residual(system, speed):
        values = _roots_at(system, speed)
        return jnp.where(jump, speed - jnp.sort(values.imag)[nearest], _largest(values))

    _, change = eqx.filter_jvp(lambda system: residual(system, speed), (system,), (tangents[0],))
    slope = jax.jvp(lambda speed: residual(system, speed), (speed,), (jnp.ones_like(speed),))[1]
    return speed, -change / slope


def _synchronous(values: Array, speed: Scalar) -> Array:
    return jnp.any(is_rounding(values.imag - speed, speed))


def _first(system: System) -> Scalar:
    """Of the order of the first natural frequency [rad/s]."""
    return Pencil.mean(system.at_speed(jnp.zeros(()))).rate


def _largest(values: Array) -> Scalar:
    return largest(values.real)


def _beyond_rounding(values: Array, first: Scalar) -> Scalar:
    """Largest growth rate [1/s]; zero where it is rounding."""
    small = is_rounding(values.real, jnp.maximum(jnp.abs(values), first))
    return jnp.max(jnp.where(jnp.isfinite(values) & small, 0.0, values.real))


def _growth(system: System) -> Callable[[Scalar], Scalar]:
    """Largest growth rate [1/s] of a speed."""
    first = _first(system)
    return lambda speed: _beyond_rounding(_roots_at(system, speed), first)


def _roots_at(system: System, speed: Scalar) -> Array:
    return exponents(system.at_speed(speed))
