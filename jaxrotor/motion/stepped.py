"""Stepping: settings of exponential steps along times.

A run is cut into pieces, from sample to sample or shorter. A piece is stepped in the modal coordinates
that the rotor has at one of a few speeds, the nearest.
"""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..core.checks import check_counts
from ..core.compiled import compiled_quickly
from ..core.extremes import larger
from ..core.quantities import Scalar, Series, known, with_values
from ..effects.base import AbstractBodies, AbstractContact
from ..equations.constant_frame import linear_matrix
from ..equations.fixed_axes import depends_on_speed
from ..equations.start import Launch
from ..equations.system import System, assemble
from ..scene import Scene
from ..solvers.basis import Basis, Count, DenseBasis, modal, well_conditioned
from ..solvers.exponential import Exponential
from ..spins.constant import ConstantSpeed
from .choice import check_steppable, steps_along
from .exact import has_steady_motion
from .speeds import coupled_steps, expected_speed, steps_between


MODES = 8  # in which the change of speed acts within a piece; beyond them the nearest speed counts
SPEEDS = 16  # at which the rotor is decomposed where it has more coordinates than that
STEPS = {2: 64, 4: 32}  # a revolution at the highest speed, by order, that follow an unbalance
CONTACT_STEPS = 256  # where there is contact
LEAST_PART = 16  # steps of a part of a piece, where the part is cut no further
APART = 1e-9  # share of a run within which a jump counts as at the end of a piece


class Stepping(eqx.Module):
    """Settings of the steps of a run."""

    solver: Exponential
    breaks: Float[Array, " b"]  # ends of the pieces [s], the first is 0
    samples: Int[Array, " T"]  # which of them are samples
    substeps: int = eqx.field(static=True)  # of every part of a piece
    even: bool = eqx.field(static=True)  # whether all pieces are of one length
    modes: int = eqx.field(static=True)  # see `SpeedTerms`; 0 where nothing depends on the speed
    speeds: int = eqx.field(static=True)  # at which the rotor is decomposed
    bases: Basis | None = None  # at all these speeds; None: dense ones, made in the run
    exact: bool = eqx.field(static=True, default=False)  # whether no steps are needed
    before: int = eqx.field(static=True, default=0)  # intervals before the first sample of lanes
    span: tuple[Scalar, Scalar] | None = None  # lowest and highest speed; None: of the run
    parts: Count = 1  # of every piece; an array is traced, so that one program serves all numbers

    def with_steps(self, count: int) -> "Stepping":
        """The settings with `count` steps of a piece, in as many parts as halving it gives.

        So twice as many steps take no other program. Derivatives are in forward mode alone.
        """
        parts = 1
        while count % 2 == 0 and count >= 2 * LEAST_PART:
            count, parts = count // 2, 2 * parts
        return dataclasses.replace(self, substeps=count, parts=jnp.asarray(parts))

    @property
    def steps(self) -> int:
        """Steps of a piece."""
        return self.substeps * int(self.parts)

    @classmethod
    def of(
        cls,
        system: System,
        kinks: Series | None,
        times: Any,
        solver: Exponential,
        substeps: int | None,
        ball_rate: float = 0.0,
    ) -> "Stepping":
        """Settings for samples at `times`; `substeps` are the steps from sample to sample.

        `kinks` are those of the speed: within a trace the scene still knows them, its equations do not.
        `ball_rate` is that of the fastest ball at the start [rad/s].
        """
        constant = isinstance(system.spin, ConstantSpeed) or not depends_on_speed(system.blocks)
        modes = 0 if constant else system.n if system.coupled else min(MODES, system.n)
        speeds = 1 if constant or system.coupled or modes == system.n else SPEEDS
        several = math.ceil(4 * speeds / len(times)) if speeds > 1 else 1
        breaks, samples, even = _breaks(kinks, np.asarray(times, float), several)
        if substeps is None:
            each = _steps_of_piece(system, breaks, solver.order, ball_rate)
        else:
            each = math.ceil(substeps / several)
        at = jnp.asarray(breaks, float), jnp.asarray(samples)
        stepping = cls(solver, *at, each, even, modes, speeds)
        return stepping.with_bases(system)

    def with_bases(self, system: System) -> "Stepping":
        """The settings with the bases of the rotor at all speeds, and with basis "auto" decided."""
        solver, bases = self.solver, None
        all_known = all(known(leaf) for leaf in jax.tree.leaves((system, self.breaks)))
        if solver.basis == "modal" or (solver.basis == "auto" and all_known):
            bases = _modal_bases(system, self.breaks, self.span, self.speeds)
        if solver.basis == "auto":
            good = bases is not None and well_conditioned(bases.vectors)
            solver = dataclasses.replace(solver, basis="modal" if good else "dense")
        exact = False
        if all_known and not isinstance(bases, DenseBasis | None):
            _, rate = self.centres(system)
            linear = isinstance(system.spin, ConstantSpeed) and not (system.ports or system.races)
            exact = linear and has_steady_motion(system, np.asarray(bases.values), float(rate))
        bases = bases if solver.basis == "modal" else None
        return dataclasses.replace(self, solver=solver, bases=bases, exact=exact)

    def centres(self, system: System) -> tuple[Float[Array, " w"], Scalar]:
        """Speeds at which the rotor is decomposed, and the rate by which time is scaled [rad/s]."""
        return _centres(system, self.breaks, self.span, self.speeds)


def stepping_of(
    scene: Scene,
    times: Any,
    solver: Exponential,
    substeps: int | None,
    system: System | None = None,
    launch: Launch | None = None,
) -> Stepping:
    """Settings of exponential steps; raises where they do not take the scene.

    `system` are its equations, where they are at hand, and `launch` is the start.
    """
    system = check_steppable(scene, solver, system)
    if not known(times):
        raise ValueError("`times` of Exponential() must be known, but are traced.")
    if substeps is not None:
        check_counts(substeps=substeps)
    return Stepping.of(system, scene.spin.kinks, times, solver, substeps, _ball_rate(launch))


def _ball_rate(launch: Launch | None) -> float:
    """Rate of the fastest ball at a start relative to the shaft [rad/s]; 0 of one that is traced."""
    balls = () if launch is None else launch.balls or ()
    rates = [np.abs(np.asarray(one.rate)).max(initial=0.0) for one in balls if known(one.rate)]
    return float(max(rates, default=0.0))


def _breaks(
    kinks: Series | None, times: np.ndarray, several: int
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Ends of the pieces, which of them are samples, and whether all pieces are of one length.

    There are `several` pieces from sample to sample. Before the first sample they are no longer.
    """
    share = np.arange(several) / several
    ahead = math.ceil(times[0] / np.diff(times).max() - APART)
    whole = np.append(np.linspace(0.0, times[0], ahead + 1)[:-1], times)
    breaks = np.append((whole[:-1, None] + np.diff(whole)[:, None] * share).ravel(), whole[-1])
    if kinks is not None and known(kinks):
        inside = np.asarray(kinks)[(np.asarray(kinks) > 0) & (np.asarray(kinks) < times[-1])]
        apart = np.abs(breaks - inside[:, None]).min(axis=1, initial=np.inf) > APART * times[-1]
        breaks = np.union1d(breaks, inside[apart])
    lengths = np.diff(breaks)
    even = bool(np.ptp(lengths) <= 1e-9 * lengths.max())
    if even:
        breaks = np.linspace(0.0, times[-1], breaks.size)
    return breaks, np.searchsorted((breaks[1:] + breaks[:-1]) / 2, times), even


def _steps_of_piece(system: System, breaks: np.ndarray, order: int, ball_rate: float) -> int:
    """Steps of a piece that follow the unbalance, and contact, at the highest speed."""
    speed = expected_speed(system, jnp.asarray(breaks))
    if not known(speed):
        raise ValueError(
            "`substeps` of Exponential are chosen by the speed, but that is traced; give `substeps`, the "
            "steps from sample to sample."
        )
    revolution = CONTACT_STEPS if system.ports else STEPS[order]
    longest, speeds = float(np.diff(breaks).max()), np.asarray(speed)
    if system.coupled:
        return coupled_steps(system, longest, speeds, ball_rate, revolution)
    return steps_between(longest, np.abs(speeds).max(), revolution)


def _centres(
    system: System, breaks: Array, span: tuple[Scalar, Scalar] | None, count: int
) -> tuple[Float[Array, " w"], Scalar]:
    """See `Stepping.centres`."""
    if span is None:
        speed = expected_speed(system, breaks)
        low, high = jnp.min(speed), jnp.max(speed)
    else:
        low, high = map(jnp.asarray, span)
    share = (jnp.arange(count) + 0.5) / count
    fastest = larger(jnp.abs(low), jnp.abs(high))
    return low + share * (high - low), jnp.where(fastest > 0, fastest, 1.0)


@compiled_quickly
def _modal_bases(
    system: System, breaks: Array, span: tuple[Scalar, Scalar] | None, count: int
) -> Basis:
    """Modal bases of the linear equations at all speeds of decomposition.

    One program serves steps of any number and order, so it is not given the settings as a whole.
    """
    centres, rate = _centres(system, breaks, span, count)
    one = lambda speed: modal(linear_matrix(system.at_speed(speed), rate))
    return jax.lax.map(one, centres)


def without_steps(scene: Scene, times: Any, launch: Launch, solver: Any) -> Scene:
    """A scene of several shafts with their unbalance as loads, not forces, if its motion is exact."""
    moved = scene.of(AbstractContact) or scene.of(AbstractBodies)
    if not scene.in_time or moved or not isinstance(scene.spin, ConstantSpeed):
        return scene
    plain = with_values(scene, in_time=False)
    system = assemble(plain)
    steps = steps_along(plain, system, times)[0] if solver is None else solver
    if not isinstance(steps, Exponential):
        return scene
    return plain if stepping_of(plain, times, steps, None, system, launch).exact else scene
