"""Sensitivity of the control loops of magnetic bearings: how near each is to instability."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core import linalg
from ..core.compiled import compiled_quickly
from ..core.extremes import larger
from ..core.plane import real_matrix
from ..core.quantities import Scalar, known
from ..core.roots import implicit_root, sign_change
from ..core.tables import notebook_table
from ..effects import LinearMagneticBearing
from ..effects.base import AbstractContact
from ..effects.layout import check_one_shaft
from ..equations.constant_frame import of_axes
from ..equations.pencil import Pencil, check_axes, eigenvalues, frame, unequal_parts
from ..equations.system import System, assemble
from ..scene import Scene
from ..shafts.cased import ends
from .linearized import check_linear


ZONES = {"A": 3.0, "B": 4.0, "C": 5.0}  # largest |S| of each; beyond is D
# Frequencies by default [Hz], and how many; the standard asks for 2 kHz or three times the speed:
LOWEST, HIGHEST, COUNT = 1.0, 2000.0, 400
TIMES = 3  # the speed
AROUND = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)  # decay rates beside the frequency of a root
LETTERS = "ABCD"


class Sensitivity(eqx.Module):
    """`S = 1 / (1 + L)` of `l` control loops at `k` frequencies, with the peak of each.

    `L` is the open loop of one bearing and axis, cut at its sensor, while all others are closed.
    """

    frequencies: Float[Array, " k"]  # w [rad/s]
    values: Complex[Array, "l k"]  # S [1]
    peaks: Float[Array, " l"]  # largest |S| [1]
    peak_frequencies: Float[Array, " l"]  # [rad/s]
    # Factors of the gain of each loop, below and above 1, at which it becomes unstable; 0 and infinity
    # where none is found up to the last frequency:
    gain_margins: Float[Array, "l 2"]
    growth: Scalar  # largest real part of the roots of the rotor with all loops closed [1/s]
    loops: tuple[str, ...] = eqx.field(static=True)  # names of bearings, each with its axis

    @property
    def zones(self) -> list[str]:
        """Zone of each loop: "A" up to a peak of 3, "B" up to 4, "C" up to 5, else "D"."""
        counts = np.searchsorted(list(ZONES.values()), np.asarray(self.peaks), side="left")
        return [LETTERS[count] for count in counts.tolist()]

    @property
    def open_loops(self) -> Complex[Array, "l k"]:
        """`L = 1 / S - 1`."""
        return 1 / self.values - 1

    def _repr_html_(self) -> str:
        rows = [
            (
                name,
                self.zones[j],
                float(self.peaks[j]),
                float(self.peak_frequencies[j]),
                float(self.peak_frequencies[j]) / (2 * np.pi),
                *map(float, self.gain_margins[j]),
            )
            for j, name in enumerate(self.loops)
        ]
        heads = "loop", "zone", "max |S|", "at [rad/s]", "[Hz]", "least gain", "largest gain"
        state = "" if self.growth < 0 else f", unstable: roots grow by {float(self.growth):.4g} 1/s"
        return notebook_table(f"Sensitivity of {len(rows)} loops{state}", heads, rows)


def sensitivity(scene: Scene, frequencies: Any = None) -> Sensitivity:
    """`S = y / d` of each loop: its reading `y` over a signal `d` that is added to its sensor.

    Every bearing has two loops, one along each of its axes. The signal is added in the closed linear
    system, so the loop of one axis is cut and all others are closed. Peaks and gain margins are refined
    between the frequencies; peaks on the end of them are those of the end, and a margin by what
    happens beyond the last one is not found.

    Args:
        scene: a rotor with at least one `LinearMagneticBearing`, such as `jaxrotor.linearized(scene)`.
        frequencies: ascending frequencies [rad/s] of the signal; by default 400 up to 2 kHz, or three
            times the speed if that is more, and some at every natural frequency between.

    Returns:
        `Sensitivity`, at the speed of the scene, with first derivatives by all parameters.

    Raises:
        ValueError: if the scene has no linear magnetic bearing, has contacts, or axes that turn are
            unequal, or the frequencies are not ascending and positive.

    Source: ISO 14839-3 (2006), Mechanical vibration: rotating machinery with active magnetic bearings.
    """
    check_one_shaft(scene.shafts, "`sensitivity`")
    check_linear(scene)
    bearings = scene.of(LinearMagneticBearing)
    if not bearings:
        raise ValueError(
            "The scene has no magnetic bearing, so no control loop; add a MagneticBearing and give "
            "`jaxrotor.linearized(scene)`."
        )
    if contacts := scene.of(AbstractContact):
        names = ", ".join(scene.name_of(contact) for contact in contacts)
        raise ValueError(
            f"Sensitivities are those of a linear rotor, but the scene has contacts ({names}); leave them "
            "out, as by `scene.without(..)`."
        )
    system = assemble(scene)
    check_axes(system, "There are no frequency responses", "leave one kind out")
    if frame(system.blocks) == "rotating":
        raise ValueError(
            f"Axes of {unequal_parts(system, 'rotating')} turn with the shaft, so loops have no response "
            "at a single frequency; leave them equal."
        )
    names = tuple(f"{bearing.name} {axis}" for bearing in bearings for axis in ("first", "second"))
    return Sensitivity(*_sensitivities(system, bearings, _checked(frequencies)), loops=names)


def _checked(frequencies: Any) -> Array | None:
    """Frequencies as an array; raises unless they are positive and ascending."""
    if frequencies is None:
        return None
    found = jnp.atleast_1d(jnp.asarray(frequencies, float))
    if known(found) and (found.ndim > 1 or np.any(np.diff(found, prepend=0.0) <= 0)):
        raise ValueError(
            f"`frequencies [rad/s]` must be positive and ascending, but are {np.asarray(found)}."
        )
    return found


class _Loops(eqx.Module):
    """Closed linear system, and where the signals of all loops enter and are read; along (x, y)."""

    pencil: Pencil
    entering: Float[Array, "n2 l"]  # by the signal
    moving: Float[Array, "n2 l"]  # and by its rate
    reading: Float[Array, "l n2"]

    @classmethod
    def of(cls, system: System, bearings: tuple[LinearMagneticBearing, ...]) -> "_Loops":
        parts = [_entries(system, bearing) for bearing in bearings]
        entering, moving, reading = zip(*parts, strict=True)
        wide = lambda columns: jnp.concatenate(columns, axis=1)
        return cls(
            of_axes(Pencil.of(system)), wide(entering), wide(moving), jnp.concatenate(reading)
        )

    def __call__(self, frequency: Scalar) -> Complex[Array, " l"]:
        """`S` of all loops at a frequency [rad/s]."""
        force = self.entering + 1j * frequency * self.moving
        moved = linalg.solve(self.pencil.dynamic(frequency), -force)
        return 1 + jnp.sum(self.reading.T * moved, axis=0)

    def of_loop(self, number: int) -> "_Loops":
        """One of them alone; the others remain closed."""
        one = slice(number, number + 1)
        parts = self.entering[:, one], self.moving[:, one], self.reading[one]
        return _Loops(self.pencil, *parts)


def _entries(system: System, bearing: LinearMagneticBearing) -> tuple[Array, Array, Array]:
    """Terms of a unit signal along each axis of a bearing, and of its rate, and the rows that read it."""
    line = system.line
    row, _ = ends(line, bearing.at if bearing.sensor is None else bearing.sensor, bearing.on)
    entries = bearing.entries(line)
    zero = jnp.zeros((system.n, 1))
    part = lambda name: getattr(entries, name) if name in entries.present else zero
    cos, sin = jnp.cos(bearing.angle), jnp.sin(bearing.angle)
    axes = jnp.array([[cos, -sin], [sin, cos]])  # columns: unit vectors of both axes
    columns = [
        real_matrix(part(name) + 0j, part(f"fixed_{name}") + 0j) @ axes
        for name in ("stiffness", "damping")
    ]
    return *columns, axes.T @ jnp.kron(jnp.eye(2), row[None])


@compiled_quickly
def _sensitivities(
    system: System, bearings: tuple[LinearMagneticBearing, ...], frequencies: Array | None
) -> tuple[Array, ...]:
    """Fields of `Sensitivity`."""
    loops = _Loops.of(system, bearings)
    roots = jax.lax.stop_gradient(eigenvalues(Pencil.of(system)))
    finite = jnp.isfinite(roots)
    growth = jnp.max(jnp.where(finite, roots.real, -jnp.inf))
    if frequencies is None:
        frequencies = _frequencies(jnp.where(finite, roots, 0.0), system.spin.speed)
    values = jax.lax.map(loops, frequencies).T
    own = [loops.of_loop(number) for number in range(len(values))]
    peaks, places = zip(
        *(_peak(*pair, frequencies) for pair in zip(own, values, strict=True)), strict=True
    )
    margins = [_margins(*pair, frequencies) for pair in zip(own, values, strict=True)]
    stack = lambda parts: jnp.stack(list(parts))
    return frequencies, values, stack(peaks), stack(places), stack(margins), growth


def _frequencies(roots: Complex[Array, " r"], speed: Scalar) -> Float[Array, " k"]:
    """Frequencies by default, see `sensitivity`."""
    top = larger(2 * np.pi * HIGHEST, TIMES * jnp.abs(jax.lax.stop_gradient(speed)))
    even = jnp.geomspace(2 * np.pi * LOWEST, top, COUNT)
    beside = (roots.imag[:, None] + roots.real[:, None] * np.array(AROUND)).ravel()
    inside = (beside > even[0]) & (beside < top)
    return jnp.sort(jnp.concatenate([even, jnp.where(inside, beside, top)]))


def _peak(loop: _Loops, values: Complex[Array, " k"], frequencies: Array) -> tuple[Array, Array]:
    """Largest `|S|` of a loop and its frequency, refined where it is not at an end."""
    size = lambda at: jnp.abs(loop(at)[0])
    slope = lambda at: jax.jvp(size, (at,), (jnp.ones_like(at),))[1]
    here = frequencies[jnp.argmax(jax.lax.stop_gradient(jnp.abs(values)))]
    low = jnp.max(jnp.where(frequencies < here, frequencies, frequencies[0]))  # some may be equal
    high = jnp.min(jnp.where(frequencies > here, frequencies, frequencies[-1]))
    found = _between(slope, low, high)
    at = jnp.where(jnp.isnan(found), here, found)
    return size(at), at


def _margins(loop: _Loops, values: Complex[Array, " k"], frequencies: Array) -> Float[Array, "2"]:
    """Largest factor below 1 and smallest one above it of the gain of a loop that make it unstable.

    There `L` is real and negative.
    """
    opened = lambda at: 1 / loop(at)[0] - 1
    still = jax.lax.stop_gradient(1 / values - 1)
    share = still.imag[:-1] / (still.imag[:-1] - still.imag[1:])
    real = still.real[:-1] + share * (still.real[1:] - still.real[:-1])
    crosses = (still.imag[:-1] * still.imag[1:] < 0) & (real < 0)
    factors = jnp.where(crosses, -1 / jnp.where(crosses, real, -1.0), jnp.nan)
    imag = lambda at: opened(at).imag

    def refined(best: Array, there: Array, absent: float) -> Array:
        found = _between(imag, frequencies[best], frequencies[best + 1])
        fine = there & ~jnp.isnan(found)
        return jnp.where(fine, -1 / opened(jnp.where(fine, found, frequencies[0])).real, absent)

    below, above = jnp.where(factors < 1, factors, 0.0), jnp.where(factors > 1, factors, jnp.inf)
    low = refined(jnp.argmax(below), jnp.max(below) > 0, 0.0)
    high = refined(jnp.argmin(above), jnp.min(above) < jnp.inf, jnp.inf)
    whole = loop(jnp.zeros(()))[0].real  # where L is real, too; below 0 without an integral
    rest = whole / jnp.where(whole < 0, whole - 1, 1.0)
    return jnp.stack([jnp.where((whole < 0) & (rest > low), rest, low), high])


def _between(function: Any, low: Array, high: Array) -> Array:
    """Root of a function between two places, with derivatives; NaN where it does not change its sign."""
    still = lambda at: jax.lax.stop_gradient(function(at))
    at_low, at_high = still(low), still(high)
    root = sign_change(still, low, high, at_low, at_high, at_high > 0)
    changes = at_low * at_high < 0
    return jnp.where(changes, implicit_root(function, jnp.where(changes, root, low)), jnp.nan)
