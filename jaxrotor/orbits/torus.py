"""Torus: the motion of a rotor whose shafts turn at two speeds, as a sum of whirls.

z(t) = Sum_kl c_kl exp(i (k theta_1 + l theta_2)),   k = -H_1 .. H_1, l = -H_2 .. H_2
"""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, Int

from ..analysis.observed import Places
from ..core import linalg
from ..core.checks import check_counts
from ..core.compiled import QUICKLY
from ..core.extremes import largest
from ..core.quantities import Scalar, known
from ..core.tables import notebook_table
from ..equations.start import Continued
from ..equations.system import System, assemble, port_groups
from ..motion.history import TimeHistory
from ..motion.revolutions import check_constant
from ..scene import Scene
from .balance import Balance, balanced, orders_of, speeds_of, truncation
from .disturbances import growth_along
from .harmonic import check_balanced
from .lyapunov import BLOCKS


SAMPLES = 8  # of an angle for every harmonic, by default
LEAST = 4  # of an angle for every harmonic, which they must exceed
UNITS = 3000  # unknowns, above which an answer would take minutes and gigabytes


class Torus(eqx.Module):
    """A motion `Sum_k coefficients[k] exp(i orders[k] . theta)` at `s` stations and `p` ports.

    `theta` are the angles of `d` shafts, the first one and those beside it that have unbalance, each from
    zero at the start on; their speeds need no common period. `K` harmonics, `N` samples of all angles.
    """

    orders: Int[Array, "K d"]  # of the angles of all shafts
    frequencies: Float[Array, " K"]  # of whirl [rad/s]
    coefficients: Complex[Array, "K s"]  # [m]
    ports: Complex[Array, "K p"]  # displacements where contacts act [m]
    forces: Complex[Array, "K p"]  # total of the contacts there, on the shaft [N]
    start: Continued  # state at angles 0
    displacement: Complex[
        Array, "N s"
    ]  # x + i y over all angles, those of the last shaft first [m]
    speeds: Float[Array, " d"]  # of the shafts [rad/s]
    stations: Float[Array, " s"]  # [m]
    residual: Scalar  # largest of any harmonic, over the largest of the ports [1]
    truncation: Scalar  # what harmonics H to 2 H would add, over the largest of all [1]
    exponent: Scalar  # growth of the fastest small disturbance [1/s], see `torus`
    exponent_error: Scalar  # its standard error [1/s]
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]
    scene: Scene
    shafts: tuple[str, ...] = eqx.field(static=True)  # whose angles these are
    observed: tuple[str, ...] = eqx.field(static=True)  # shaft of every station
    harmonics: tuple[int, ...] = eqx.field(static=True)  # H of every angle
    samples: tuple[int, ...] = eqx.field(static=True)  # of every angle

    @property
    def stable(self) -> Bool[Array, ""]:
        """Whether small disturbances die out; raises where no exponent was asked for."""
        if known(self.exponent) and math.isnan(float(self.exponent)) and bool(self.converged):
            raise ValueError(
                "The stability of this torus was not looked at, as `revolutions` were 0; ask for some."
            )
        return jnp.less(self.exponent, 0)

    @property
    def radius(self) -> tuple[Float[Array, " s"], Float[Array, " s"]]:
        """Smallest and largest distance from the centre [m] over all angles."""
        radius = jnp.abs(self.displacement)
        return -largest(-radius), largest(radius)

    def at(self, time: ArrayLike) -> Complex[Array, "T s"]:
        """Displacement x + i y [m] at times [s] from angles 0 on."""
        time = jnp.atleast_1d(jnp.asarray(time, float))
        return jnp.exp(1j * time[:, None] * self.frequencies) @ self.coefficients

    def _repr_html_(self) -> str:
        low, high = self.radius
        heads = ("station [m]", "least radius [m]", "largest radius [m]")
        rows = list(zip(self.stations.tolist(), low.tolist(), high.tolist(), strict=True))
        return notebook_table(str(self), heads, rows)

    def __str__(self) -> str:
        speeds = zip(self.shafts, self.speeds.tolist(), strict=True)
        at = " and ".join(f"{name} at {speed:.6g}" for name, speed in speeds)
        stability = "not looked at for stability"
        if not math.isnan(float(self.exponent)):
            kind = "stable" if self.stable else "unstable"
            exponent, error = float(self.exponent), float(self.exponent_error)
            stability = f"{kind}: disturbances grow by {exponent:.4g} +- {error:.1g} 1/s"
        return (
            f"Torus of {at} rad/s, {stability}; "
            f"{' x '.join(map(str, self.harmonics))} harmonics and "
            f"{' x '.join(map(str, self.samples))} samples: as many more would add "
            f"{float(self.truncation):.1e} of the largest; residual {float(self.residual):.1e} after "
            f"{int(self.iterations)} iterations"
        )


def torus(
    scene: Scene,
    guess: Any = None,
    *,
    harmonics: int | tuple[int, ...] = 7,
    samples: int | tuple[int, ...] | None = None,
    at: Any = None,
    revolutions: int = 200,
    steps_per_revolution: int = 128,
    tolerance: float = 1e-10,
    finder: Any = None,
    max_iterations: int = 100,
    throw: bool = True,
) -> Torus:
    """The motion `z(t) = Sum_kl c_kl exp(i (k theta_1 + l theta_2))` near a guess, stable or not.

    Where unbalance of two shafts turns at speeds without a common period, a motion does not repeat; over
    both angles it is a function on a torus. Harmonic balance solves for its harmonics, with the forces
    of contacts computed at samples of both angles. It does not matter how near the speeds are to a
    common period. Of three shafts with unbalance there are three angles.

    Its stability is the growth of the fastest small disturbance, by the derivative of the forces along
    the motion, which exists also where the motion is unstable.

    Args:
        scene: the rotor of several shafts, at constant speed, the same along every axis but for contact
            and loads; stops with `blend` and `slip`.
        guess: another such torus, or a `TimeHistory` from angles of zero on, which is fitted by harmonics
            where it is longer than they are many; by default the motion without contact.
        harmonics: of each angle, forward and backward.
        samples: of each angle, at which forces are computed: more than 4 a harmonic, by default the
            power of two from 8 a harmonic up.
        at: station(s) to observe, with the names of their shafts, `("hp", 0.3)`.
        revolutions: of the first shaft, over which disturbances are averaged; the exponent is NaN for 0.
        steps_per_revolution: of these disturbances, whose error is of order 2.
        tolerance: largest residual of a harmonic, relative to the largest of the ports.
        finder: root finder or least-squares solver of optimistix, by default its Dogleg.
        max_iterations: of the root finder.
        throw: whether to raise an error where no torus is found; if not, `converged` is False.

    Returns:
        A `Torus`, whose harmonics are differentiable, in forward and reverse mode, by the implicit
        function theorem.

    Raises:
        ValueError: if an argument is out of its range, the guess does not fit, no shaft beside the first
            one has unbalance, or the scene has no harmonic balance, see `harmonic_balance`.
        RuntimeError: if no torus is found, unless `throw` is False.

    Source: Kim, Choi (1997), Nonlinear Dynamics 14, 93-110; Krack, Gross (2019), Harmonic Balance for
    Nonlinear Vibration Problems, section 3.5.
    """
    check_counts(max_iterations=max_iterations, steps_per_revolution=steps_per_revolution)
    check_counts(0, revolutions=revolutions)
    if 0 < revolutions < 2 * BLOCKS:
        raise ValueError(
            f"`revolutions` must be at least {2 * BLOCKS} to estimate an error, or 0 for no exponent, but "
            f"is {revolutions}."
        )
    check_constant(scene, "`torus`")
    system = assemble(scene, port_groups(scene))
    check_balanced(system)
    if not system.others:
        raise ValueError(
            "A torus has the angles of several shafts, but only the first shaft of this scene has "
            "unbalance; take `jaxrotor.harmonic_balance`."
        )
    count = 1 + len(system.others)
    harmonics = _of_each(harmonics, count, "harmonics")
    if samples is None:
        samples = tuple(1 << (SAMPLES * h - 1).bit_length() for h in harmonics)
    samples = _of_each(samples, count, "samples")
    for h, n in zip(harmonics, samples, strict=True):
        if n <= LEAST * h:
            raise ValueError(
                f"`samples` of an angle must be more than {LEAST * h}, {LEAST} a harmonic, to avoid "
                f"aliasing, but are {n}."
            )
    unknowns = 2 * len(system.ports) * math.prod(2 * h + 1 for h in harmonics)
    if unknowns > 2 * UNITS:
        raise ValueError(
            f"`harmonics` = {harmonics} of {len(system.ports)} ports are {unknowns} unknowns, more than "
            f"the {2 * UNITS} that one matrix holds; take fewer harmonics."
        )
    finder = optx.Dogleg(tolerance, tolerance) if finder is None else finder
    settings = finder, tolerance, max_iterations
    first = _first(system, guess, harmonics)
    sizes, along = (harmonics, samples), (revolutions, steps_per_revolution)
    return torus_near(scene, Places.of(scene, at), first, sizes, settings, along, throw)


def torus_near(
    scene: Scene,
    places: Places,
    first: Complex[Array, "K p"] | None,
    sizes: tuple[tuple[int, ...], tuple[int, ...]],
    settings: tuple[Any, float, int],
    along: tuple[int, int],
    throw: bool,
) -> Torus:
    """The torus near harmonics of the ports, see `torus`.

    `sizes` are harmonics and samples of each angle, `settings` the finder, its tolerance and most
    iterations, `along` revolutions and steps of disturbances.
    """
    system = assemble(scene, port_groups(scene))
    traced = not all(map(known, jax.tree.leaves((system, first))))
    find = _COMPILED if traced else _COMPILED_QUICKLY
    found = find(scene, system, places, first, sizes, settings, along)
    if throw and known(found.converged) and not bool(found.converged):
        raise RuntimeError(
            f"No torus was found near the guess: after {int(found.iterations)} iterations the residual "
            f"is still {float(found.residual):.1e} of the motion. Take a nearer guess, such as a settled "
            "motion or the torus of fewer harmonics or of softer contact."
        )
    return found


def _find(
    scene: Scene,
    system: System,
    places: Places,
    first: Complex[Array, "K p"] | None,
    sizes: tuple[tuple[int, ...], tuple[int, ...]],
    settings: tuple[Any, float, int],
    along: tuple[int, int],
) -> Torus:
    (harmonics, samples), (finder, tolerance, max_iterations) = sizes, settings
    balance = Balance.of(system, harmonics, 1, samples)
    found = balanced(balance, first, finder, tolerance, max_iterations)
    ports, forces, residual, iterations = found
    q = balance.coordinates(forces)
    row = places.rows(system.line)
    coefficients = q @ row.T
    exponent, error = growth_along(balance, ports, *along)
    return Torus(
        orders=jnp.asarray(balance.orders),
        frequencies=balance.frequencies,
        coefficients=coefficients,
        ports=ports,
        forces=forces,
        start=Continued(q.sum(0), (1j * balance.frequencies) @ q),
        displacement=balance.sampled(coefficients),
        speeds=speeds_of(system),
        stations=places.stations,
        residual=residual,
        truncation=truncation(balance, row, coefficients, ports),
        exponent=exponent,
        exponent_error=error,
        iterations=iterations,
        converged=jnp.all(jnp.isfinite(q)),
        scene=scene,
        shafts=(str(scene.name), *(other.name for other in system.others)),
        observed=tuple(map(str, places.shafts)),
        harmonics=harmonics,
        samples=samples,
    )


_COMPILED = eqx.filter_jit(_find)
_COMPILED_QUICKLY = eqx.filter_jit(_find, **QUICKLY)


def _of_each(given: Any, count: int, name: str) -> tuple[int, ...]:
    """A number for every angle."""
    each = tuple(given) if isinstance(given, list | tuple) else (given,) * count
    if len(each) != count:
        raise ValueError(
            f"`{name}` must be a number, or one for each of {count} angles, but is {given!r}."
        )
    for one in each:
        check_counts(**{name: one})
    return each


def _first(system: System, guess: Any, harmonics: tuple[int, ...]) -> Complex[Array, "K p"] | None:
    """Harmonics of the ports in a guess, or None."""
    if guess is None or not system.ports:
        return None
    orders = orders_of(harmonics)
    if isinstance(guess, Torus):
        if len(guess.harmonics) != len(harmonics) or guess.ports.shape[1] != len(system.ports):
            raise ValueError(
                f"The guess has {len(guess.harmonics)} angles and {guess.ports.shape[1]} ports, which "
                f"does not fit {len(harmonics)} and {len(system.ports)}."
            )
        inside = np.all(np.abs(orders) <= guess.harmonics, axis=1)
        place = np.mod(orders + guess.harmonics, np.array(guess.harmonics) * 2 + 1).T
        place = np.ravel_multi_index(tuple(place), tuple(2 * h + 1 for h in guess.harmonics))
        return jnp.where(inside[:, None], guess.ports[place], 0.0)
    if not isinstance(guess, TimeHistory):
        raise ValueError(
            "`guess` must be a torus, or a motion of jaxrotor.simulate or run_up, but is a "
            f"{type(guess).__name__}."
        )
    if guess.time.size < 2 * len(orders):
        raise ValueError(
            f"The guess must have at least {2 * len(orders)} times, two for each of {len(orders)} "
            f"harmonics, but has {guess.time.size}."
        )
    time = guess.angle / system.spin.speed
    waves = jnp.exp(1j * time[:, None] * (orders @ speeds_of(system)))
    rows = jnp.stack([port.row for port in system.ports])
    return linalg.pinv(waves) @ (guess.coordinates @ rows.T)
