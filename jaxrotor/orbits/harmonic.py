"""Harmonic: a periodic motion against smooth stops as a sum of whirls, by harmonic balance.

z(t) = Sum_k c_k exp(i k Omega t / revolutions),   k = -H .. H
"""

from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Complex, Float, Int

from ..analysis.observed import Places
from ..core.checks import check_counts
from ..core.compiled import QUICKLY
from ..core.plane import plane
from ..core.quantities import Scalar, known
from ..effects.law import Now
from ..equations.pencil import check_alike, check_moves
from ..equations.start import Continued
from ..equations.stationary_frame import RUN_UP, check_no_balls
from ..equations.system import System, assemble, port_groups
from ..motion.history import TimeHistory
from ..motion.rebounds import pilot_run
from ..motion.revolutions import check_constant
from ..motion.simulate import simulate
from ..scene import Scene
from .balance import Balance, balanced, truncation
from .guess import start_of
from .orbit import AbstractOrbit


SAMPLES = 16  # in a period for every harmonic, by default
LEAST = 4  # in a period for every harmonic, at least


class HarmonicOrbit(AbstractOrbit):
    """A motion `z(t) = Sum_k coefficients[k] exp(i orders[k] Omega t)` at `s` stations and `p` ports.

    `K = 2 H + 1` harmonics from the fastest backward whirl to the fastest forward one.
    """

    orders: Float[Array, " K"]  # frequency of whirl over the speed [1]
    coefficients: Complex[Array, "K s"]  # [m]
    ports: Complex[Array, "K p"]  # displacements where contacts act [m]
    forces: Complex[Array, "K p"]  # total of the contacts there, on the shaft [N]
    start: Continued  # state at angle 0
    period: Scalar  # [s]
    time: Float[Array, " T"]  # [s]
    displacement: Complex[Array, "T s"]  # x + i y [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    contact_force: Complex[Array, "T k"] | None  # on the shaft, by contact of the scene [N]
    stations: Float[Array, " s"]  # [m]
    residual: Scalar  # largest of any harmonic, over the largest of the ports [1]
    truncation: Scalar  # what harmonics H to 2 H would add, over the largest of all [1]
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]
    scene: Scene
    harmonics: int = eqx.field(static=True)  # H
    revolutions: int = eqx.field(static=True)  # in a period
    samples: int = eqx.field(static=True)  # in a period, of the forces

    def __str__(self) -> str:
        return (
            f"Orbit of {self.revolutions} revolution{'s' * (self.revolutions > 1)} by {self.harmonics} "
            f"harmonics and {self.samples} samples: as many more would add {float(self.truncation):.1e} "
            f"of the largest; residual {float(self.residual):.1e} after {int(self.iterations)} iterations"
        )


def harmonic_balance(
    scene: Scene,
    guess: Any = None,
    *,
    harmonics: int = 7,
    revolutions: int = 1,
    samples: int | None = None,
    at: Any = None,
    tolerance: float = 1e-10,
    finder: Any = None,
    max_iterations: int = 100,
    throw: bool = True,
) -> HarmonicOrbit:
    """The periodic motion `z(t) = Sum_k c_k exp(i k Omega t / revolutions)` near a guess, stable or not.

    A second method beside `periodic`, for smooth contact: it takes no time steps, and its error falls
    with the number of harmonics as fast as the forces are smooth. For stability and multipliers, see
    `periodic(scene, orbit.start, revolutions=orbit.revolutions)`.

    Args:
        scene: the rotor, at constant speed, the same along every axis but for contact and loads; stops
            with `blend` and `slip`. Hysteretic damping is allowed, with the sign of each harmonic.
        guess: another such orbit, a `TimeHistory` of at least `revolutions`, a periodic orbit or a start,
            of which `revolutions` are simulated; by default the motion without contact. A subharmonic
            motion needs a guess near it.
        harmonics: number of harmonics `H` of the period, forward and backward.
        revolutions: in a period.
        samples: of a period, at which forces are computed: at least 4 a harmonic, by default the power
            of two from 16 a harmonic up.
        at: station(s) to observe [m], as in `simulate`.
        tolerance: largest residual of a harmonic, relative to the largest of the ports.
        finder: root finder or least-squares solver of optimistix, by default its Dogleg.
        max_iterations: of the root finder.
        throw: whether to raise an error where no orbit is found; if not, `converged` is False.

    Returns:
        A `HarmonicOrbit`, differentiable once, in forward and reverse mode, by the implicit function
        theorem.

    Raises:
        ValueError: if an argument is out of its range, the guess does not fit, or the scene has no
            harmonic balance: sharp stops, unequal axes, balls, a speed that is zero or not constant, or
            neither unbalance nor weight.
        RuntimeError: if no orbit is found, unless `throw` is False.

    Source: Cameron, Griffin (1989), Journal of Applied Mechanics 56, 149-154; Krack, Gross (2019),
    Harmonic Balance for Nonlinear Vibration Problems, chapter 2.
    """
    check_counts(harmonics=harmonics, revolutions=revolutions, max_iterations=max_iterations)
    if harmonics < revolutions:
        raise ValueError(
            f"`harmonics` must be at least `revolutions` = {revolutions}, the order of the unbalance, but "
            f"is {harmonics}."
        )
    if samples is None:
        samples = 1 << (SAMPLES * harmonics - 1).bit_length()  # a power of two
    check_counts(samples=samples)
    if samples < LEAST * harmonics:
        raise ValueError(
            f"`samples` must be at least {LEAST * harmonics}, {LEAST} a harmonic, to avoid aliasing, but "
            f"is {samples}."
        )
    check_constant(scene, "`harmonic_balance`")
    system = assemble(scene, port_groups(scene))
    check_balanced(system)
    if system.others:
        raise ValueError(
            "Unbalance of several shafts has no common period; take `jaxrotor.torus`, which has the "
            "angles of all of them."
        )
    orders = np.arange(-harmonics, harmonics + 1)
    first = _first(scene, system, guess, orders, revolutions)
    finder = optx.Dogleg(tolerance, tolerance) if finder is None else finder
    sizes = harmonics, revolutions, samples
    traced = not all(map(known, jax.tree.leaves((system, first))))
    find = _COMPILED if traced else _COMPILED_QUICKLY
    found = find(
        scene, system, Places.of(scene, at), first, sizes, finder, tolerance, max_iterations
    )
    if throw and known(found.converged) and not bool(found.converged):
        raise RuntimeError(
            f"No orbit was found near the guess: after {int(found.iterations)} iterations the residual "
            f"is still {float(found.residual):.1e} of the motion. Take a nearer guess, a settled "
            "response or the orbit of fewer harmonics, or look at `jaxrotor.roots` for a resonance."
        )
    return found


def _find(
    scene: Scene,
    system: System,
    places: Places,
    first: Complex[Array, "K p"] | None,
    sizes: tuple[int, int, int],
    finder: Any,
    tolerance: float,
    max_iterations: int,
) -> HarmonicOrbit:
    harmonics, revolutions, samples = sizes
    balance = Balance.of(system, (harmonics,), revolutions, (samples,))
    found = balanced(balance, first, finder, tolerance, max_iterations)
    ports, forces, residual, iterations = found
    q = balance.coordinates(forces)
    rates = 1j * balance.frequencies[:, None] * q
    row = places.rows(system.line)
    coefficients = q @ row.T
    period = 2 * jnp.pi * revolutions / jnp.abs(system.spin.speed)
    time = jnp.linspace(0.0, period, samples + 1)
    waves = jnp.exp(1j * time[:, None] * balance.frequencies)
    displacement = waves @ coefficients
    velocity = waves @ (1j * balance.frequencies[:, None] * coefficients)
    return HarmonicOrbit(
        orders=jnp.asarray(balance.orders[:, 0]) / revolutions,
        coefficients=coefficients,
        ports=ports,
        forces=forces,
        start=Continued(q.sum(0), rates.sum(0)),
        period=period,
        time=time,
        displacement=displacement,
        velocity=velocity,
        contact_force=_contact_force(system, time, waves @ q, waves @ rates),
        stations=places.stations,
        residual=residual,
        truncation=truncation(balance, row, coefficients, ports),
        iterations=iterations,
        converged=jnp.all(jnp.isfinite(q)),
        scene=scene,
        harmonics=harmonics,
        revolutions=revolutions,
        samples=samples,
    )


_COMPILED = eqx.filter_jit(_find)
_COMPILED_QUICKLY = eqx.filter_jit(_find, **QUICKLY)


def _contact_force(
    system: System, time: Array, q: Array, rates: Array
) -> Complex[Array, "T k"] | None:
    """Force of each contact of the scene [N]."""
    if not system.ports:
        return None
    rows = jnp.stack([port.row for port in system.ports])
    z, v = (part @ rows.T for part in (q, rates))
    pairs = (plane(part, axis=-1) for part in (z, v))
    speed = system.spin.speed
    force = lambda angle, z, v: system.contact_forces(z, v, Now(speed, angle))
    forces = jax.vmap(force)(speed * time, *pairs)
    return forces[..., 0] + 1j * forces[..., 1]


# === checks and guesses


def check_balanced(system: System) -> None:
    """Raise where a system has no harmonic balance."""
    check_moves(system)
    check_alike(system, "Harmonic balance", RUN_UP)
    check_no_balls(system, "Harmonic balance", RUN_UP)
    if any(law.kinked for port in system.ports for law in port.laws):
        raise ValueError(
            "Harmonic balance takes smooth contact, but there are sharp stops; give them `blend` and "
            "`slip`, or take `jaxrotor.periodic`."
        )
    speed = system.spin.speed
    if known(speed) and not float(speed):
        raise ValueError(
            "At zero speed a revolution has no length, so it has no harmonics; give the scene a speed."
        )
    loads = [system.load.unbalance, system.load.constant, *(one.column for one in system.others)]
    loads = [load for load in loads if load is not None]
    still = all(known(load) and not bool(jnp.any(load != 0)) for load in loads)
    if still and not system.clocks:
        raise ValueError(
            "Without unbalance or weight nothing moves the rotor, so the balance is that of rest; a "
            "motion of its own period is found by `jaxrotor.periodic`."
        )


def _first(
    scene: Scene, system: System, guess: Any, orders: np.ndarray, revolutions: int
) -> Complex[Array, "K p"] | None:
    """Harmonics of the ports in a guess, or None."""
    if guess is None or not system.ports:
        return None
    if isinstance(guess, HarmonicOrbit):
        return _from_orbit(guess, orders, revolutions, len(system.ports))
    if not isinstance(guess, TimeHistory) or guess.steps_per_revolution is None:
        with pilot_run():
            guess = simulate(scene, revolutions, start=start_of(guess))
    steps = cast(int, guess.steps_per_revolution)
    count = revolutions * steps
    if guess.time.size <= count:
        raise ValueError(
            f"The guess must hold {revolutions} revolutions, but holds "
            f"{(guess.time.size - 1) // steps}; raise the `keep` of its run."
        )
    rows = jnp.stack([port.row for port in system.ports])
    path = guess.coordinates[-count - 1 : -1] @ rows.T
    spectrum = jnp.fft.fft(path, axis=0, norm="forward")
    sampled = 2 * np.abs(orders) < count
    ahead, back = (spectrum[np.where(sampled, sense * orders, 0)] for sense in (1, -1))
    turned = jnp.where(system.spin.speed < 0, back, ahead)
    return jnp.where(sampled[:, None], turned, 0.0)


def _from_orbit(
    guess: HarmonicOrbit, orders: np.ndarray, revolutions: int, ports: int
) -> Complex[Array, "K p"]:
    """Harmonics of another orbit, whose period is the same or a whole part of it."""
    times, rest = divmod(revolutions, guess.revolutions)
    if rest or guess.ports.shape[1] != ports:
        raise ValueError(
            f"The guess has a period of {guess.revolutions} revolutions and {guess.ports.shape[1]} ports, "
            f"which does not fit one of {revolutions} and {ports}."
        )
    place = orders // times + guess.harmonics
    present = (orders % times == 0) & (np.abs(orders) <= times * guess.harmonics)
    return jnp.where(present[:, None], guess.ports[np.where(present, place, 0)], 0.0)
