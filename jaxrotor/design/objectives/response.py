"""Response: anisotropy, and the response to weight and unbalance, as objectives over speeds."""

import dataclasses
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array

from ... import analysis
from ...core import linalg
from ...core.quantities import Scalar
from ...effects import InternalDamping, Support
from ...equations.pencil import Pencil, isotropic
from ...equations.speed_tables import check_no_tables
from ...equations.system import assemble
from ...scene import Scene
from .means import over, peak, square


# === unequal stiffness


def anisotropy(scene: Scene, speeds: Any, at: Any = None) -> Scalar:
    """`mean |D_x - D_y|^2 / |D_x + D_y|^2` [1] at `s = i Omega`, over given speeds.

    `D(s)` is the dynamic stiffness that shaft, supports and internal damping offer at a station, in the
    axes that turn with the shaft where these are unequal: no inertia, no damping by a medium. Cross
    terms count as differences unless they are those of a rotation. Smooth, and with a single minimum in
    every case examined. Zero exactly where the rotor is isotropic; internal damping leaves a remainder,
    and moves the minimum a little.

    Args:
        scene: a rotor unequal in one frame.
        speeds: one or many [rad/s].
        at: station [m], by default the observed one of `simulate`.

    Returns:
        The anisotropy [1].

    Raises:
        ValueError: if the rotor is the same along every axis.

    Source: sheet of the rotor of two stiffnesses, sections 1.5 and 4 (R5).
    """
    station = scene.stations(at)[0]
    check_no_tables(scene, "The anisotropy of the dynamic stiffness")
    system = assemble(scene)
    blocks = scene.shaft.blocks(system.line)
    for effect in (*scene.of(Support), *scene.of(InternalDamping)):
        blocks = blocks + effect.blocks(system.line)
    if isotropic(blocks):
        raise ValueError(
            "The rotor is the same along every axis, so there is no anisotropy to tune; give a shaft or "
            "support its `anisotropy`."
        )
    massless = jnp.zeros((system.n, system.n))
    blocks = dataclasses.replace(blocks, inertia=massless, gyroscopic=None)
    elastic = dataclasses.replace(system, blocks=blocks)
    pair = lambda part: linalg.block_diag(part[None], part[None])
    rows, columns = pair(system.line.row(station)), pair(system.line.column(station)).T

    def one(speed: Scalar) -> Scalar:
        dynamic = Pencil.of(elastic.at_speed(speed)).dynamic(speed)
        stiffness = linalg.inv(rows @ linalg.solve(dynamic, columns + 0j))
        sizes = stiffness.real**2 + stiffness.imag**2
        return (sizes[0, 1] + sizes[1, 0]) / (sizes[0, 0] + sizes[1, 1])

    return jnp.mean(over(speeds, one))


def twice_share(scene: Scene, speeds: Any, at: Any = None) -> Scalar:
    """`mean |z_2|^2 / (|z_2|^2 + |z_0|^2)` [1], of the twice-per-revolution response to weight.

    `z_0` is the deflection under weight, see `jaxrotor.weight_response`. Smooth and between 0 and 1, so
    resonances between given speeds make no false minima of consequence; zero where the rotor is
    isotropic.

    Args:
        scene: a rotor under gravity.
        speeds: one or many [rad/s].
        at: station(s) [m], by default the observed one of `simulate`.

    Returns:
        The fraction [1].

    Source: sheet of the rotor of two stiffnesses, section 4 (R4).
    """
    twice, still = _weight(scene, speeds, at)
    return jnp.mean(twice / (twice + still))


def twice_response(scene: Scene, speeds: Any, at: Any = None) -> Scalar:
    """`mean |z_2|^2` [m^2], the square of the twice-per-revolution response to weight.

    Smooth at every damping above zero. Of speeds below half the first critical one it has one minimum;
    over resonances a lightly damped rotor has false ones, where a resonance falls between two speeds.

    Args:
        scene: a rotor under gravity.
        speeds: one or many [rad/s].
        at: station(s) [m], by default the observed one of `simulate`.

    Returns:
        The mean square [m^2].

    Source: sheet of the rotor of two stiffnesses, section 4 (R1, R6).
    """
    return jnp.mean(_weight(scene, speeds, at)[0])


def _weight(scene: Scene, speeds: Any, at: Any) -> tuple[Array, Array]:
    """Squares of the parts at twice the speed and at rest [m^2]."""
    found = analysis.weight_response(scene, speeds, at)
    return square(found.twice), square(found.deflection)


# === unbalance


def unbalance_peak(
    scene: Scene, speeds: Any, at: Any = None, power: float | int | None = None
) -> Scalar:
    """`max |z|` [m] of the unbalance response over given speeds; by `power`, `mean(|z|^p)^(1/p)`.

    `|z|` is the larger half axis of the orbit. The maximum has kinks, where the largest moves to another
    speed or station, and between speeds it sees nothing: a resonance narrower than their distance makes
    false minima. The mean by a power is smooth and lies below the largest.

    Args:
        scene: the rotor with its unbalance.
        speeds: one or many [rad/s].
        at: station(s) [m], by default the observed one of `simulate`.
        power: `p` of the mean; None for the largest.

    Returns:
        The peak [m].
    """
    return peak(analysis.unbalance_response(scene, speeds, at).major, power)


def unbalance_rms(scene: Scene, speeds: Any, at: Any = None) -> Scalar:
    """`sqrt( mean |z|^2 )` [m] of the unbalance response over given speeds and stations.

    `|z|^2` is the mean over the orbit, `|z_f|^2 + |z_b|^2`. Smooth at every damping above zero, unless
    there is no response at all.

    Args:
        scene: the rotor with its unbalance.
        speeds: one or many [rad/s].
        at: station(s) [m], by default the observed one of `simulate`.

    Returns:
        The root mean square [m].
    """
    found = analysis.unbalance_response(scene, speeds, at)
    return jnp.sqrt(jnp.mean(square(found.forward) + square(found.backward)))
