"""Observables: what sweeps keep of whole revolutions, or of the windows of a run."""

from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..core.lanes import reduced
from ..core.plane import plane, square
from ..effects.base import AbstractBodies, AbstractContact
from ..equations.system import state_names
from ..scene import Scene
from .observable import (
    AbstractObservable as AbstractObservable,
    AbstractStored,
    Turn as Turn,
    Variable as Variable,
)
from .observe_balls import BallLag as BallLag, Imbalance as Imbalance
from .observe_regular import Regularity as Regularity
from .observe_runs import Capture as Capture, Envelope as Envelope, Peak as Peak


class Section(AbstractStored):
    """Poincare section: displacement at the end of every revolution."""

    rows = True

    def update(self, carry, turn: Turn):
        return carry, plane(turn.z[-1])

    def report(self, carry, stored, count):
        section = Variable(("revolution", "axis"), stored, "m", "displacement once a revolution")
        return {"section": section}


class Orbit(AbstractStored):
    """Orbit: displacement at every step of every revolution, which takes much memory in large sweeps."""

    rows = True

    def update(self, carry, turn: Turn):
        return carry, plane(turn.z[1:], axis=1)

    def report(self, carry, stored, count):
        dims = ("revolution", "sample", "axis")
        return {"orbit": Variable(dims, stored, "m", "displacement at every step")}


class Extrema(AbstractObservable):
    """Local extrema of the x displacement, up to `most` in a revolution, located to O(step^4)."""

    needs_contact: ClassVar[bool] = False
    rows = True
    most: int = eqx.field(default=12, static=True)

    def check(self, steps, contacts):
        del steps, contacts

    def start(self, contacts):
        return jnp.array(0)

    def update(self, carry, turn: Turn):
        x, v = turn.z.real, turn.velocity.real
        inside = (v[:-1] * v[1:] < 0) | (v[1:] == 0) & (v[:-1] != 0)  # the steps with an extremum
        fall = v[:-1] - v[1:]
        u = jnp.clip(jnp.where(inside, v[:-1] / jnp.where(inside, fall, 1.0), 0.0), 0, 1)
        value = (
            (1 + 2 * u) * (1 - u) ** 2 * x[:-1]
            + u**2 * (3 - 2 * u) * x[1:]
            + turn.step * (u * (1 - u) ** 2 * v[:-1] + u**2 * (u - 1) * v[1:])
        )
        numbers = jnp.arange(self.most).reshape(-1, *[1] * carry.ndim)

        # One sample of all lanes after the other: `jnp.nonzero` scatters lane by lane.
        def one(found, sample):
            kept, count = found
            value, inside = sample
            kept = jnp.where(inside & (numbers == count), value, kept)
            return (kept, count + inside), None

        none = jnp.full((self.most, *carry.shape), jnp.nan), 0 * carry
        (kept, count), _ = jax.lax.scan(one, none, (value, inside))
        return carry + jnp.maximum(count - self.most, 0), kept

    def report(self, carry, stored, count):
        return {
            "extrema": Variable(
                ("revolution", "extremum"), stored, "m", "local extrema of x displacement"
            ),
            "extrema_missed": Variable(
                (), carry, "1", f"extrema beyond {self.most} in a revolution, not kept"
            ),
        }


class Precession(AbstractObservable):
    """Precession `Lambda = psi./Omega`: +1 forward synchronous, negative backward.

    `index` is the mean of Lambda over the samples, `winding` the number of turns of the orbit about the
    centre per revolution. `whirl_rate` is a mean with a bump weight that vanishes smoothly at both ends
    of the kept revolutions; it converges fast for periodic and quasi-periodic motion (Das, Saiki,
    Sander, Yorke, Nonlinearity 30 (2017), eq. (2)). All are undefined (NaN) for an orbit with a sample
    in the centre, and at zero speed. Source: Azarov, Gouskov, Panovko (2023), "precession index".
    """

    needs_contact: ClassVar[bool] = False
    rows = True

    def check(self, steps, contacts):
        del contacts
        _check_direction_is_resolved(steps)

    def start(self, contacts):
        zero = jnp.array(0.0)
        return {"index": zero, "winding": zero, "whirl": zero, "weight": zero, "undefined": zero}

    def update(self, carry, turn: Turn):
        steps = len(turn.z) - 1
        angle, area = turn.turned(), square(turn.z[1:])
        undefined = turn.in_centre()[1:]
        momentum = jnp.imag(jnp.conj(turn.z[1:]) * turn.velocity[1:])
        spin = jnp.where(turn.s == 0, jnp.nan, turn.s)
        rate = turn.step * momentum / jnp.where(undefined, 1.0, area)
        t = (turn.number + (jnp.arange(steps) + 0.5) / steps) / turn.count
        bump = jnp.exp(-1 / (t * (1 - t)))
        weighted = (bump * angle.T).T
        add = {
            "index": spin * reduced(jnp.add, rate) / (2 * jnp.pi),
            "winding": spin * reduced(jnp.add, angle) / (2 * jnp.pi),
            "whirl": spin * reduced(jnp.add, weighted) * steps / (2 * jnp.pi),
            "weight": jnp.sum(bump),
            "undefined": reduced(jnp.add, undefined.astype(float)),
        }
        return {name: carry[name] + value for name, value in add.items()}, None

    def report(self, carry, stored, count):
        one_or_nan = np.where(np.asarray(carry["undefined"]) == 0, 1.0, np.nan)
        names = {
            "index": (carry["index"] / count, "mean of relative whirl speed"),
            "winding": (carry["winding"] / count, "turns of the orbit per revolution"),
            "whirl_rate": (
                carry["whirl"] / carry["weight"],
                "weighted mean of relative whirl speed",
            ),
        }
        return {
            name: Variable((), one_or_nan * value, "1", long_name)
            for name, (value, long_name) in names.items()
        }


class Radius(AbstractObservable):
    """Smallest, largest and root-mean-square distance from the centre."""

    needs_contact: ClassVar[bool] = False
    rows = True
    paced = "any"

    def check(self, steps, contacts):
        del steps, contacts

    def start(self, contacts):
        return jnp.inf + jnp.zeros(()), jnp.zeros(()), jnp.zeros(())

    def update(self, carry, turn: Turn):
        low, high, total = carry
        squares = square(turn.z[1:])
        carry = (
            jnp.minimum(low, reduced(jnp.minimum, squares)),
            jnp.maximum(high, reduced(jnp.maximum, squares)),
            total + reduced(jnp.add, squares) / len(squares),
        )
        return carry, None

    def report(self, carry, stored, count):
        low, high, total = carry
        return {
            "radius_min": Variable((), np.sqrt(low), "m", "smallest radius"),
            "radius_max": Variable((), np.sqrt(high), "m", "largest radius"),
            "radius_rms": Variable((), np.sqrt(total / count), "m", "rms radius"),
        }


class Contact(AbstractObservable):
    """Share of time under load and largest resultant force of each contact."""

    needs_contact: ClassVar[bool] = True
    rows = True
    paced = "any"

    def check(self, steps, contacts):
        if not contacts:
            raise ValueError("`Contact` observes limiters, but the scene has none.")

    def start(self, contacts):
        return jnp.zeros(contacts), jnp.zeros(contacts)

    def update(self, carry, turn: Turn):
        duty, peak = carry
        assert turn.contact_force is not None, "checked before the run"
        squares = square(turn.contact_force[1:])
        loaded = reduced(jnp.add, (squares > 0).astype(float)) / len(squares)
        return (duty + loaded, jnp.maximum(peak, reduced(jnp.maximum, squares))), None

    def report(self, carry, stored, count):
        duty, peak = carry
        return {
            "duty": Variable(("limiter",), duty / count, "1", "share of time in contact"),
            "peak_force": Variable(("limiter",), np.sqrt(peak), "N", "largest contact force"),
        }


class States(AbstractStored):
    """States of all laws, such as the wear of a stop, at the end of every revolution or window."""

    needs_states: ClassVar[bool] = True
    rows = True
    paced = "any"

    def update(self, carry, turn: Turn):
        assert turn.states is not None, "checked before the run"
        return carry, turn.states[-1]

    def report(self, carry, stored, count):
        name = "states of laws at the ends of windows"
        return {
            "states": Variable(("window", "state"), stored, "see `state`", name),
            "states_end": Variable(
                ("state",), stored[:, -1], "see `state`", "states of laws at the end"
            ),
        }


class Reversal(AbstractObservable):
    """Reversal of the whirl to backward: the first of `window` backward revolutions in a row.

    A revolution is backward if the area it sweeps, `Int Im(conj(z) z.) dt / 2`, has the sign opposite to
    the spin. `jaxrotor.escapes` takes the reversals of an ensemble of starts.
    """

    needs_contact: ClassVar[bool] = False
    rows = True
    window: int = eqx.field(default=10, static=True)

    def check(self, steps, contacts):
        del contacts
        if self.window < 1:
            raise ValueError(f"`window` of Reversal must be at least 1, but is {self.window}.")
        _check_direction_is_resolved(steps)

    def start(self, contacts):
        return jnp.array(0), jnp.array(-1)

    def update(self, carry, turn: Turn):
        in_a_row, first = carry
        areas = jnp.imag(jnp.conj(turn.z[1:]) * turn.velocity[1:])
        area = turn.s * reduced(jnp.add, areas)
        in_a_row = jnp.where(area < 0, in_a_row + 1, 0)
        reversed_now = (first < 0) & (in_a_row == self.window)
        first = jnp.where(reversed_now, turn.number + 1 - self.window, first)
        return (in_a_row, first), None

    def report(self, carry, stored, count):
        _, first = carry
        reversal = np.where(first < 0, np.nan, first)
        watched = np.full(reversal.shape, max(count + 1 - self.window, 0))
        return {
            "reversal": Variable((), reversal, "1", "revolutions before the whirl turned backward"),
            "reversal_watched": Variable(
                (), watched, "1", "revolutions in which a reversal can be detected"
            ),
        }


class WhirlSpectrum(AbstractObservable):
    """Amplitude spectrum of Lambda(t): Hann window, mean removed, up to `samples`/2 cycles a revolution.

    Each sample is the mean of Lambda over its share of the revolution, for which the spectrum is
    corrected. It is undefined (NaN) where the precession is. Source: Azarov, Gouskov, Panovko (2023),
    Figs. 5, 6.
    """

    needs_contact: ClassVar[bool] = False
    rows = True
    samples: int = eqx.field(default=32, static=True)

    def check(self, steps, contacts):
        if steps % self.samples:
            raise ValueError(
                f"`steps_per_revolution` must be a multiple of WhirlSpectrum's `samples` = "
                f"{self.samples}, but is {steps}."
            )

    def start(self, contacts):
        return None

    def update(self, carry, turn: Turn):
        undefined = reduced(jnp.logical_or, turn.in_centre()) | (turn.s == 0)
        angle = turn.turned()
        angle = angle.reshape(self.samples, -1, *angle.shape[1:])
        angle = reduced(jnp.add, jnp.moveaxis(angle, 1, 0))
        angle = jnp.where(undefined, jnp.nan, angle)
        return carry, turn.s * angle * self.samples / (2 * jnp.pi)

    def report(self, carry, stored, count):
        signal = np.asarray(stored).reshape(*np.shape(stored)[:-2], -1)
        signal = signal - signal.mean(axis=-1, keepdims=True)
        window = np.hanning(signal.shape[-1] + 1)[:-1]
        amplitude = 2 * np.abs(np.fft.rfft(signal * window)) / window.sum()
        frequency = np.arange(amplitude.shape[-1]) / count
        amplitude = amplitude / np.sinc(frequency / self.samples)
        if signal.shape[-1] % 2 == 0:
            amplitude[..., -1] /= 2  # the Nyquist frequency has no negative counterpart
        long_name = "amplitude of relative whirl speed"
        return {
            "spectrum": Variable(("frequency",), amplitude, "1", long_name),
            "frequency": Variable(("frequency",), frequency, "1/revolution", "frequency"),
        }


def everything(
    contacts: bool = False,
    *,
    along_times: bool = False,
    balls: bool = False,
    states: bool = False,
    shafts: bool = False,
) -> tuple[AbstractObservable, ...]:
    """The default observables of a sweep: section, extrema, precession and radius.

    Args:
        contacts: whether `Contact`, which observes limiters, is among them.
        along_times: whether the lanes are runs along times, observed by peak, envelope and radius.
        balls: whether `Imbalance` and `BallLag`, which observe balls, are among them.
        states: whether `States`, which observes states of laws, is among them.
        shafts: whether there are several shafts, so that `Regularity` is among them.

    Returns:
        The observables, for `sweep(.., observe=..)`.
    """
    others = *[Contact()][:contacts], *[Imbalance(), BallLag()][: 2 * balls], *[States()][:states]
    if along_times:
        return Peak(), Envelope(), Radius(), *others
    return Section(), Extrema(), Precession(), Radius(), *[Regularity()][:shafts], *others


def checked_observables(
    observe: Any, scene: Scene, steps: int, along_times: bool
) -> tuple[AbstractObservable, ...]:
    """The observables asked for, or by default all but the spectrum."""
    contacts, balls = len(scene.of(AbstractContact)), bool(scene.of(AbstractBodies))
    states = bool(state_names(scene))
    if observe is None:
        drawn = {"balls": balls, "states": states, "shafts": bool(scene.shafts)}
        observe = everything(bool(contacts), along_times=along_times, **drawn)
    observe = tuple(observe) if isinstance(observe, Sequence) else (observe,)
    for one in observe:
        if not isinstance(one, AbstractObservable):
            raise ValueError(f"`observe` must hold observables such as Section(), but has {one!r}.")
        if one.paced not in ("any", "times" if along_times else "revolutions"):
            where = (
                "along `times`" if one.paced == "times" else "of whole revolutions, without `times`"
            )
            raise ValueError(f"`{type(one).__name__}` is an observable of motions {where}.")
        if one.needs_balls and not balls:
            raise ValueError(f"`{type(one).__name__}` observes balls, but the scene has none.")
        if one.needs_states and not states:
            raise ValueError(
                f"`{type(one).__name__}` observes states of laws, but the scene has none."
            )
        one.check(steps, contacts)
    return observe


def _check_direction_is_resolved(steps: int) -> None:
    """Raise unless so many steps a revolution tell in which direction an orbit turns."""
    if steps < 8:
        raise ValueError(
            f"`steps_per_revolution` = {steps} is too few to tell which way an orbit turns; take 8 "
            "or more."
        )
