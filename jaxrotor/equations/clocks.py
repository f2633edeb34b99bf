"""Clocks: the shafts beside the first one in a motion by revolutions, each with a steady response.

    exp(i theta_k) = exp(2 pi i tau_k) exp(i rho_k theta),   tau_k <- (tau_k + rho_k) mod 1

`theta` is the angle of revolution, which begins anew at zero, and `rho_k = Omega_k / rate`. The turns
`tau_k` at the beginning of a revolution are part of the state. They are fixed-point numbers, so that
their sums are exact: a phase is that of the ratio in the precision of its number, however long the run.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..core.quantities import Scalar
from ..effects.law import Clock, Now
from ..effects.layout import coaxial_shafts
from ..scene import Scene
from .other_unbalance import OtherUnbalance
from .pencil import frame
from .start import AbstractStart, Launch
from .system import System


class Clocks(eqx.Module):
    """`Sum cos(phi_k) cos_k + sin(phi_k) sin_k`, the response to the unbalance of other shafts.

    `phi_k` is the angle of shaft k along the axes of the equations. All fields may have lanes last.
    """

    rates: Float[Array, "k ..."]  # phi_k by the angle of revolution
    cos: Inexact[Array, "k m ..."]
    sin: Inexact[Array, "k m ..."]

    @classmethod
    def of(
        cls, system: System, rate: Scalar, respond: Callable, turn: Scalar | float = 0.0
    ) -> "Clocks | None":
        """Those of a system, None without unbalance of others; its axes turn by `turn` theta.

        `respond(rho, force)` are the parts, cosine and sine, of the state under `force exp(i phi)`.
        """
        if not system.others:
            return None
        speed = system.spin.speed
        rates = [rate_of(one, speed, rate) - turn for one in system.others]
        forces = [one.clock.speed(speed) ** 2 * one.column for one in system.others]
        found = [respond(*pair) for pair in zip(rates, forces, strict=True)]
        cos, sin = (jnp.stack(part) for part in zip(*found, strict=True))
        return cls(jnp.stack(rates), cos, sin)

    def seen(self, output: Array, stack: Callable = lambda one: one) -> "Clocks":
        """The same as it is read by a matrix."""
        read = lambda part: jnp.stack([stack(output @ one) for one in part])
        return dataclasses.replace(self, cos=read(self.cos), sin=read(self.sin))

    def at(self, phase: Float[Array, "k2 ..."]) -> Array:
        """The response, by cosine and sine of the angle of every clock."""
        pairs = [*zip(phase[::2], self.cos, strict=True), *zip(phase[1::2], self.sin, strict=True)]
        terms: list[Array] = [share * part for share, part in pairs]
        return sum(terms[1:], start=terms[0])

    def after(self, turns: Float[Array, "k ..."], revolutions: Array | int = 1) -> Array:
        """Turns of the clocks after some revolutions."""
        return _after(turns, self.rates, jnp.asarray(revolutions))


def clock_of(scene: Scene, name: str) -> Clock | None:
    """Clock of the shaft of a name, whose turns are the revolutions; None of the first one."""
    if name not in scene.shafts:
        known = ", ".join(scene.shafts) or "there are no names"
        raise ValueError(
            f"`period` must be a time [s] or the name of a shaft ({known}), but is {name!r}."
        )
    return next((one.clock for one in coaxial_shafts(scene.effects) if one.name == name), None)


def counted_by(system: System, scene: Scene, period: float | str | None) -> System:
    """The system in revolutions of a shaft that is named; the first one is then among the others."""
    clock = clock_of(scene, period) if isinstance(period, str) else None
    if clock is None:
        return system
    load = system.load
    if (
        frame(system.blocks) == "rotating"
        or load.twice is not None
        or "revolution" in system.clocks
    ):
        raise ValueError(
            f"Revolutions of {period!r} are for a first shaft that is round, but parts turn with "
            f"{scene.name!r}; leave `period` out."
        )
    others = system.others
    if load.unbalance is not None:
        others += (OtherUnbalance(Clock(jnp.ones(()), None), load.unbalance, str(scene.name)),)
    bare = dataclasses.replace(load, unbalance=None)
    return dataclasses.replace(system, load=bare, others=others, counted=clock)


def since(tree: Any, turns: Float[Array, "k ..."]) -> Any:
    """The tree with its clocks at so many turns where the angle of revolution is zero."""
    angle = 2 * jnp.pi * turns[:, None]
    c, s = jnp.cos(angle), jnp.sin(angle)
    turned = lambda own: Clocks(own.rates, c * own.cos + s * own.sin, c * own.sin - s * own.cos)
    is_one = lambda node: isinstance(node, Clocks)
    return jax.tree.map(lambda node: turned(node) if is_one(node) else node, tree, is_leaf=is_one)


def rate_of(other: OtherUnbalance, speed: Scalar, rate: Scalar) -> Scalar:
    """Turns of a shaft in a revolution; without a speed of its own, its ratio itself."""
    clock = other.clock
    own = clock.ratio * (speed / rate)
    return own if clock.excess is None else own + clock.excess / rate


def turns_of(start: AbstractStart, system: System) -> Float[Array, " k"]:
    """Turns of the other shafts with unbalance at a start."""
    launch = Launch.of(start)
    now = Now(system.spin.speed, launch.angle, time=launch.time)
    found = [cast(Any, one.clock.of(now).angle) / (2 * jnp.pi) for one in system.others]
    turns = jnp.stack(found)
    return _after(turns, jnp.zeros_like(turns), jnp.asarray(0))


@jax.custom_jvp
def _after(turns: Array, rates: Array, revolutions: Array) -> Array:
    """`(turns + revolutions rates) mod 1`, exactly, of numbers that are rounded once."""
    bits = jnp.finfo(turns.dtype).nmant
    integer = jnp.uint64 if bits > 32 else jnp.uint32
    whole = lambda x: jnp.round((x - jnp.floor(x)) * 2.0**bits).astype(integer)
    total = whole(turns) + revolutions.astype(integer) * whole(rates)  # modulo a power of two
    return (total & (2**bits - 1)).astype(turns.dtype) * 2.0**-bits


@_after.defjvp
def _after_jvp(primals, tangents):
    turns, rates, _ = tangents
    return _after(*primals), turns + primals[2] * rates
