"""Growth rate of a rotor, and the speeds at which it loses or regains stability."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ..pencil import Pencil
from ..quantities import Scalar, known
from ..scene import Scene
from ..system import assemble
from .floquet import exponents


class Onset(NamedTuple):
    """Speed where the largest growth rate crosses zero, and the whirl frequency there.

    In the frame of `roots`, positive forward; with periodic coefficients up to twice the speed.
    """

    speed: Scalar  # [rad/s]
    whirl_frequency: Scalar  # [rad/s]


@eqx.filter_jit
def growth_rate(scene: Scene) -> Scalar:
    """Largest growth rate [1/s], `max Re lambda`, negative stable, of the straight rotor.

    `lambda` are its `roots` or, where no frame has constant coefficients, the Floquet exponents
    `log(mu) / T` (not a number below 1/30 of the first natural frequency, see
    `floquet_multipliers`). At rest such a rotor is taken as it stands. Differentiable.
    """
    return jnp.max(exponents(assemble(scene)).real)


def onset_speed(
    scene: Scene, within: tuple[float, float] | None = None, samples: int = 200
) -> Onset:
    """Lowest speed at which the straight rotor turns unstable: `max Re lambda(Omega) = 0`, rising.

    Args:
        scene: the rotor; its own speed does not matter.
        within: speeds [rad/s] to search, by default 0 to about 40 times the first natural frequency.
        samples: growth rates taken to bracket the crossing; two crossings closer than a sample
            interval are missed.

    Returns:
        Speed to 1e-12 and whirl frequency, differentiable by the implicit function theorem.

    Raises:
        ValueError: no loss of stability in the range, unstable from its start, or no damping.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 2.
    """
    _check_search(within, samples)
    speeds, growth, scale = _scan(scene, within, samples)
    rising = (growth[:-1] <= 0) & (growth[1:] > 0)
    marginal = jnp.max(jnp.abs(growth[: samples // 4])) < 1e-9 * scale
    refusals = [
        (marginal, "The rotor has no damping, so it is neither stable nor unstable,"),
        (growth[0] > 1e-9 * scale, "The rotor is unstable already at the lowest speed,"),
        (~jnp.any(rising), "The rotor never loses its stability; search a wider range than"),
    ]
    for wrong, sentence in refusals:
        if known(wrong):
            if bool(wrong):
                raise ValueError(f"{sentence} from {speeds[0]:g} to {speeds[-1]:g} rad/s.")
        else:
            speeds = eqx.error_if(speeds, wrong, f"{sentence} the speeds searched.")
    first = jnp.argmax(rising)
    return _refine(scene, speeds[first], speeds[first + 1])


def stability_crossings(
    scene: Scene, within: tuple[float, float] | None = None, samples: int = 200
) -> list[tuple[Onset, bool]]:
    """All crossings in the range, in order, each with whether stability is lost (or regained)."""
    _check_search(within, samples)
    speeds, growth, _ = _scan(scene, within, samples)
    signs = np.asarray(growth) > 0
    return [
        (_refine(scene, speeds[i], speeds[i + 1]), bool(signs[i + 1]))
        for i in np.flatnonzero(signs[:-1] != signs[1:])
    ]


def _check_search(within, samples: int) -> None:
    if isinstance(samples, bool) or not isinstance(samples, int) or samples < 8:
        raise ValueError(f"`samples` must be a whole number of at least 8, but is {samples!r}.")
    if within is not None and known(within[0]) and known(within[1]) and within[0] >= within[1]:
        raise ValueError(f"`within` must be a lower and a higher speed, but is {within!r}.")


@eqx.filter_jit
def _scan(
    scene: Scene, within, samples: int
) -> tuple[Float[Array, " w"], Float[Array, " w"], Scalar]:
    """Speeds, growth rates, and the frequency that makes a rate small or large."""
    scale = Pencil.mean(assemble(scene.put({"spin.speed": jnp.zeros(())}))).rate
    low, high = (0.0, 40 * scale) if within is None else within
    speeds = jnp.linspace(low, high, samples + 1)
    # One speed after the other: see `sweep._prepare` on batched linear algebra.
    growth = jax.lax.map(lambda speed: growth_rate(scene.put({"spin.speed": speed})), speeds)
    return speeds, jax.lax.stop_gradient(growth), scale


@eqx.filter_jit
def _refine(scene: Scene, low: Scalar, high: Scalar) -> Onset:
    growth = lambda speed, scene: growth_rate(scene.put({"spin.speed": speed}))
    span = jax.lax.stop_gradient({"lower": low, "upper": high})
    solution = optx.root_find(
        growth,
        optx.Bisection(rtol=1e-13, atol=1e-13),
        (span["lower"] + span["upper"]) / 2,
        args=scene,
        options=span,
        max_steps=64,
        throw=False,
    )
    values = exponents(assemble(scene.put({"spin.speed": solution.value})))
    return Onset(solution.value, values[jnp.argmax(values.real)].imag)
