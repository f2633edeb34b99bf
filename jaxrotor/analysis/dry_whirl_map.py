"""Map of dry whirl: where a rim may roll or slip round its ring, over speed and friction."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..core.compiled import compiled_quickly
from ..effects import AnnularStator
from ..scene import Scene
from .dry_whirl import dry_whirl
from .ring import ring_of


class DryWhirlMap(eqx.Module):
    """Whirls against the spin at `a` speeds and `b` coefficients of friction."""

    speeds: Float[Array, " a"]  # [rad/s]
    frictions: Float[Array, " b"]  # [1]
    rolls: Bool[Array, "a b"]  # whether a stable one rolls
    slips: Bool[Array, "a b"]  # whether a stable one slips: dry whip
    exists: Bool[Array, "a b"]  # whether there is any, stable or not
    rate: Float[Array, "a b"]  # of the fastest stable one [rad/s], NaN where there is none
    least_friction: Float[Array, " a"]  # below which there is none, see `DryWhirl` [1]


def dry_whirl_map(scene: Scene, speeds, frictions) -> DryWhirlMap:
    """Existence and stability of `dry_whirl` at `(Omega, f)`, with `s = f sgn V` or `|s| <= f`.

    Args:
        scene: a rotor in one `AnnularStator`, as for `dry_whirl`; its own speed and friction do not
            matter.
        speeds: ascending speeds [rad/s].
        frictions: ascending coefficients of friction.

    Returns:
        `DryWhirlMap`.

    Raises:
        ValueError: as `dry_whirl`.
    """
    ring_of(scene, "A dry whirl")
    return _dry_whirl_map(scene, *(jnp.asarray(part, float) for part in (speeds, frictions)))


@compiled_quickly
def _dry_whirl_map(
    scene: Scene, speeds: Float[Array, " a"], frictions: Float[Array, " b"]
) -> DryWhirlMap:
    def found_at(speed, friction):
        put = {"spin.speed": speed, f"{AnnularStator.kind}.friction": friction}
        return dry_whirl(scene.put(put))

    def one(case):
        speed, friction = case
        found = found_at(speed, friction)
        rim = found.slip - found.rate * found.radius
        backward = found.rate * rim < 0
        stable = found.stable & backward
        fastest = jnp.argmax(jnp.where(stable, jnp.abs(found.rate), -jnp.inf))
        rate = jnp.where(jnp.any(stable), found.rate[fastest], jnp.nan)
        rolls, slips = jnp.any(stable & found.rolling), jnp.any(stable & ~found.rolling)
        return rolls, slips, jnp.any(backward), rate

    shape = speeds.size, frictions.size
    grid = [part.ravel() for part in jnp.meshgrid(speeds, frictions, indexing="ij")]
    parts: Any = [part.reshape(shape) for part in jax.lax.map(one, tuple(grid))]
    # It does not depend on friction, and what is not returned above is not computed.
    least = jax.lax.map(lambda speed: found_at(speed, frictions[0]).least_friction, speeds)
    parts = speeds, frictions, *parts, least
    return DryWhirlMap(*parts)
