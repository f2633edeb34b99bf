"""Harmonic: a periodic motion against smooth stops as a sum of whirls, by harmonic balance.

    z(t) = Sum_k c_k exp(i k Omega t / revolutions),   k = -H .. H
    u_k = row P(i w_k)^-1 ( load_k + column F_k ),     F_k that of the forces of the motion itself

Linear parts are exact in every harmonic, so the displacements of the ports alone are unknown; forces
are known in time, displacements in frequency, and Fourier transforms lead from one to the other.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Complex, Float, Int

from ..core.checks import check_counts
from ..core.compiled import QUICKLY
from ..core.extremes import largest
from ..core.quantities import Scalar, known
from ..core.tables import notebook_table
from ..equations.pencil import Pencil, check_alike, check_moves
from ..equations.start import Continued
from ..equations.stationary_frame import RUN_UP, check_no_balls
from ..equations.system import System, assemble, port_groups
from ..motion.revolutions import check_constant
from ..motion.simulate import Response, simulate
from ..scene import Scene
from .periodic import start_of


SAMPLES = 16  # of a period, for every harmonic, unless said
LEAST = 4  # the same, at least


class HarmonicOrbit(eqx.Module):
    """A motion `z(t) = Sum_k coefficients[k] exp(i orders[k] Omega t)` at `s` stations and `p` ports.

    `K = 2 H + 1` harmonics from the fastest backward whirl to the fastest forward one.
    """

    orders: Float[Array, " K"]  # of whirl over the speed [1]
    coefficients: Complex[Array, "K s"]  # [m]
    ports: Complex[Array, "K p"]  # of the stations where contacts act [m]
    forces: Complex[Array, "K p"]  # of all contacts there, on the shaft [N]
    start: Continued  # state at angle 0
    period: Scalar  # [s]
    time: Float[Array, " T"]  # [s]
    displacement: Complex[Array, "T s"]  # x + i y [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    contact_force: Complex[Array, "T k"] | None  # on the shaft, by contact of the scene [N]
    stations: Float[Array, " s"]  # [m]
    residual: Scalar  # largest that a harmonic misses, over the largest of the ports [1]
    truncation: Scalar  # what harmonics H to 2 H would add, over the largest of all [1]
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]
    scene: Scene
    harmonics: int = eqx.field(static=True)  # H
    revolutions: int = eqx.field(static=True)  # in a period
    samples: int = eqx.field(static=True)  # in a period, of the forces

    @property
    def radius(self) -> tuple[Float[Array, " s"], Float[Array, " s"]]:
        """Smallest and largest distance from the centre [m] at the samples."""
        radius = jnp.abs(self.displacement)
        return -largest(-radius), largest(radius)

    def _repr_html_(self) -> str:
        low, high = self.radius
        heads = ("station [m]", "least radius [m]", "largest radius [m]")
        rows = list(zip(self.stations.tolist(), low.tolist(), high.tolist(), strict=True))
        return notebook_table(str(self), heads, rows)

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

    The second method beside `periodic`, for smooth contact: no steps, and an error that falls with the
    number of harmonics as fast as the forces are smooth. Whether the motion attracts, and its
    multipliers, `periodic(scene, orbit.start, revolutions=orbit.revolutions)` tells.

    Args:
        scene: what moves, at constant speed, the same along every axis but for contact and loads; stops
            with `blend` and `slip`. Hysteretic damping is allowed, with the sign of each harmonic.
        guess: another such orbit, a `Response` of `revolutions` or more, a periodic orbit or a start,
            which are followed for `revolutions`; by default the motion without contact. A subharmonic
            motion takes a guess of it.
        harmonics: `H`, forward and backward, of the period.
        revolutions: in a period.
        samples: of a period, at which forces are computed: 4 a harmonic at the least, by default the
            power of two from 16 a harmonic up.
        at: station(s) [m] to observe, as in `simulate`.
        tolerance: of the largest harmonic that is missed, over the largest of the ports.
        finder: root finder or least-squares solver of optimistix, by default its Dogleg.
        max_iterations: of it.
        throw: whether to raise an error where no orbit is found; else `converged` says so.

    Returns:
        A `HarmonicOrbit`. Differentiable once, in forward and reverse mode, by the implicit function
        theorem.

    Source: Cameron, Griffin (1989), Journal of Applied Mechanics 56, 149-154; Krack, Gross (2019),
    Harmonic Balance for Nonlinear Vibration Problems, chapter 2.
    """
    check_counts(harmonics=harmonics, revolutions=revolutions, max_iterations=max_iterations)
    if harmonics < revolutions:
        raise ValueError(
            f"`harmonics` must be at least `revolutions` = {revolutions}, the order of the unbalance, but "
            f"is {harmonics}."
        )
    samples = _power_of_two(SAMPLES * harmonics) if samples is None else samples
    check_counts(samples=samples)
    if samples < LEAST * harmonics:
        raise ValueError(
            f"`samples` must be at least {LEAST * harmonics}, {LEAST} a harmonic, lest higher ones be "
            f"taken for lower, but is {samples}."
        )
    check_constant(scene, "`harmonic_balance`")
    system = assemble(scene, port_groups(scene))
    _check(system)
    orders = np.arange(-harmonics, harmonics + 1)
    first = _first(scene, system, guess, orders, revolutions)
    finder = optx.Dogleg(tolerance, tolerance) if finder is None else finder
    sizes = harmonics, revolutions, samples
    traced = not all(map(known, jax.tree.leaves((system, first))))
    find = _COMPILED if traced else _COMPILED_QUICKLY
    found = find(scene, system, scene.stations(at), first, sizes, finder, tolerance, max_iterations)
    if throw and known(found.converged) and not bool(found.converged):
        raise RuntimeError(
            f"No orbit was found near the guess: after {int(found.iterations)} iterations the balance "
            f"still misses {float(found.residual):.1e} of the motion. Take a nearer guess, a settled "
            "response or the orbit of fewer harmonics, or look at `jaxrotor.roots` for a resonance."
        )
    return found


class Balance(eqx.Module):
    """What the harmonics of the ports miss: `u - row P^-1 ( load + column F(u) )`."""

    system: System
    frequencies: Float[Array, " K"]  # [rad/s]
    loaded: Complex[Array, "K n"]  # coordinates under the loads alone
    driven: Complex[Array, "K n p"]  # by a unit of force at every port
    size: Scalar  # of the displacements [m]
    samples: int = eqx.field(static=True)

    @classmethod
    def of(cls, system: System, harmonics: int, revolutions: int, samples: int) -> "Balance":
        """Exact answers of the linear part in all harmonics."""
        speed, load, n = system.spin.speed, system.load, system.n
        columns = [port.column for port in system.ports]
        columns = jnp.stack(columns, axis=1) if columns else jnp.zeros((n, 0))
        # Exactly 1 where the unbalance is: hysteresis knows no whirl of the shaft's own speed.
        frequencies = speed * (jnp.arange(-harmonics, harmonics + 1) / revolutions)
        forces = jnp.zeros((2 * harmonics + 1, n), complex)
        if load.constant is not None:
            forces = forces.at[harmonics].add(load.constant)
        unbalance = load.unbalance_force(speed)
        if unbalance is not None:
            forces = forces.at[harmonics + revolutions].add(unbalance)

        def answer(case):
            frequency, force = case
            pencil = Pencil.of(system, jnp.sign(frequency - speed))
            acting = jnp.concatenate([force[:, None], columns], axis=1)
            return jnp.linalg.solve(pencil.dynamic(frequency), acting)

        answers = jax.lax.map(answer, (frequencies, forces))
        parts = frequencies, answers[..., 0], answers[..., 1:]
        plain = cls(system, *parts, jnp.ones(()), samples)
        size = jax.lax.stop_gradient(jnp.max(jnp.abs(plain.rows @ plain.loaded.T), initial=0.0))
        return cls(system, *parts, jnp.where(size > 0, size, 1.0), samples)

    @property
    def rows(self) -> Float[Array, "p n"]:
        """Of the ports."""
        rows = [port.row for port in self.system.ports]
        return jnp.stack(rows) if rows else jnp.zeros((0, self.system.n))

    @property
    def orders(self) -> np.ndarray:
        """Harmonics, -H to H; as indices of a transform the negative ones count from its end."""
        harmonics = self.frequencies.size // 2
        return np.arange(-harmonics, harmonics + 1)

    def coordinates(self, forces: Complex[Array, "K p"]) -> Complex[Array, "K n"]:
        """All coordinates, from the harmonics of the port forces [N]."""
        return self.loaded + jnp.einsum("knp,kp->kn", self.driven, forces)

    def forces(self, ports: Complex[Array, "K p"]) -> Complex[Array, "K p"]:
        """Harmonics of the port forces [N] from those of the displacements there [m]."""
        rates = 1j * self.frequencies[:, None] * ports
        seen = (self._sampled(part) for part in (ports, rates))
        parts = [jnp.stack([part.real, part.imag], axis=-1) for part in seen]
        speed = self.system.spin.speed
        totals = [
            jax.vmap(lambda z, v, port=port: port.forces(z, v, speed).sum(0))(
                parts[0][:, i], parts[1][:, i]
            )
            for i, port in enumerate(self.system.ports)
        ]
        total = jnp.stack(totals, axis=1)
        return jnp.fft.fft(total[..., 0] + 1j * total[..., 1], axis=0, norm="forward")[self.orders]

    def missed(self, x: Float[Array, " a"]) -> Float[Array, " a"]:
        """What the unknowns miss, over `size`."""
        ports = self.decode(x)
        return x - self.encode(self.coordinates(self.forces(ports)) @ self.rows.T)

    def encode(self, ports: Complex[Array, "K p"]) -> Float[Array, " a"]:
        """Unknowns of displacements [m]."""
        flat = ports.ravel() / self.size
        return jnp.concatenate([flat.real, flat.imag])

    def decode(self, x: Float[Array, " a"]) -> Complex[Array, "K p"]:
        """Displacements [m] of unknowns."""
        real, imag = jnp.split(self.size * x, 2)
        return jax.lax.complex(real, imag).reshape(self.frequencies.size, -1)

    def _sampled(self, coefficients: Complex[Array, "K p"]) -> Complex[Array, "N p"]:
        """Over a period, from angle 0 on."""
        spectrum = jnp.zeros((self.samples, coefficients.shape[1]), complex)
        spectrum = spectrum.at[self.orders].set(coefficients)
        return jnp.fft.ifft(spectrum, axis=0, norm="forward")


def _find(
    scene: Scene,
    system: System,
    stations: Float[Array, " s"],
    first: Complex[Array, "K p"] | None,
    sizes: tuple[int, int, int],
    finder: Any,
    tolerance: float,
    max_iterations: int,
) -> HarmonicOrbit:
    harmonics, revolutions, samples = sizes
    balance = Balance.of(system, *sizes)
    ports, iterations = balance.loaded @ balance.rows.T, jnp.zeros((), int)
    forces, residual = jnp.zeros_like(ports), jnp.zeros(())
    if system.ports:
        x, iterations = _root(balance, ports if first is None else first, finder, max_iterations)
        residual = jnp.max(jnp.abs(balance.missed(x))) / jnp.max(jnp.abs(x))
        x = jnp.where(residual <= 10 * tolerance, x, jnp.nan)
        ports = balance.decode(x)
        forces = balance.forces(ports)
    q = balance.coordinates(forces)
    rates = 1j * balance.frequencies[:, None] * q
    row = jax.vmap(system.line.row)(stations)
    coefficients = q @ row.T
    period = 2 * jnp.pi * revolutions / jnp.abs(system.spin.speed)
    time = jnp.linspace(0.0, period, samples + 1)
    waves = jnp.exp(1j * time[:, None] * balance.frequencies)
    seen = waves @ coefficients
    velocity = waves @ (1j * balance.frequencies[:, None] * coefficients)
    return HarmonicOrbit(
        orders=jnp.asarray(balance.orders) / revolutions,
        coefficients=coefficients,
        ports=ports,
        forces=forces,
        start=Continued(q.sum(0), rates.sum(0)),
        period=period,
        time=time,
        displacement=seen,
        velocity=velocity,
        contact_force=_contact_force(system, waves @ q, waves @ rates),
        stations=stations,
        residual=residual,
        truncation=_truncation(balance, revolutions, row, coefficients, ports),
        iterations=iterations,
        converged=jnp.all(jnp.isfinite(q)),
        scene=scene,
        harmonics=harmonics,
        revolutions=revolutions,
        samples=samples,
    )


_COMPILED = eqx.filter_jit(_find)
_COMPILED_QUICKLY = eqx.filter_jit(_find, **QUICKLY)


def _root(balance: Balance, ports: Array, finder: Any, max_iterations: int):
    """Unknowns that miss nothing, with their derivatives, and the iterations it took."""
    held = jax.lax.stop_gradient(balance)
    root = optx.root_find(
        lambda x, balance: balance.missed(x),
        finder,
        held.encode(jax.lax.stop_gradient(ports)),
        held,
        max_steps=max_iterations,
        throw=False,
    )
    # A last Newton step with its matrix held: its derivative is that of the root itself.
    x = jax.lax.stop_gradient(root.value)
    x = x - jnp.linalg.solve(jax.jacfwd(held.missed)(x), balance.missed(x))
    return x, root.stats["num_steps"]


def _contact_force(system: System, q: Array, rates: Array) -> Complex[Array, "T k"] | None:
    """Of each contact of the scene [N]."""
    if not system.ports:
        return None
    rows = jnp.stack([port.row for port in system.ports])
    z, v = (part @ rows.T for part in (q, rates))
    pairs = (jnp.stack([part.real, part.imag], axis=-1) for part in (z, v))
    forces = jax.vmap(lambda z, v: system.contact_forces(z, v, system.spin.speed))(*pairs)
    return forces[..., 0] + 1j * forces[..., 1]


def _truncation(
    balance: Balance,
    revolutions: int,
    row: Float[Array, "s n"],
    coefficients: Complex[Array, "K s"],
    ports: Complex[Array, "K p"],
) -> Scalar:
    """`sum |row D(k)^-1 F_k|` of `H < |k| <= 2 H` over the largest harmonic: forces that were left out.

    Which harmonics a motion has depends on its symmetry; the first that are missing may be any.
    """
    if not balance.system.ports:
        return jnp.zeros(())
    harmonics = balance.frequencies.size // 2
    wide = Balance.of(balance.system, 2 * harmonics, revolutions, balance.samples)
    forces = wide.forces(jnp.pad(ports, ((harmonics, harmonics), (0, 0))))
    added = jnp.abs(jnp.einsum("sn,knp,kp->ks", row, wide.driven, forces))
    added = jnp.where(np.abs(wide.orders)[:, None] > harmonics, added, 0.0)
    return jnp.max(jnp.sum(added, axis=0)) / jnp.max(jnp.abs(coefficients))


def _power_of_two(least: int) -> int:
    return 1 << (least - 1).bit_length()


# === what is asked for


def _check(system: System) -> None:
    """Refuse what has no harmonic balance."""
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
        raise ValueError("At zero speed a revolution has no length, so it has no harmonics.")
    loads = [load for load in (system.load.unbalance, system.load.constant) if load is not None]
    if all(known(load) and not bool(jnp.any(load != 0)) for load in loads):
        raise ValueError(
            "Without unbalance or weight nothing moves the rotor, so the balance is that of rest; a "
            "motion of its own period is found by `jaxrotor.periodic`."
        )


def _first(
    scene: Scene, system: System, guess: Any, orders: np.ndarray, revolutions: int
) -> Complex[Array, "K p"] | None:
    """Harmonics of the ports in a guess."""
    if guess is None or not system.ports:
        return None
    if isinstance(guess, HarmonicOrbit):
        return _of_other(guess, orders, revolutions, len(system.ports))
    if not isinstance(guess, Response):
        guess = simulate(scene, revolutions, start=start_of(guess))
    count = revolutions * guess.steps_per_revolution
    if guess.time.size <= count:
        raise ValueError(
            f"The guess must hold {revolutions} revolutions, but holds "
            f"{(guess.time.size - 1) // guess.steps_per_revolution}; raise the `keep` of its run."
        )
    rows = jnp.stack([port.row for port in system.ports])
    path = guess.coordinates[-count - 1 : -1] @ rows.T
    spectrum = jnp.fft.fft(path, axis=0, norm="forward")
    seen = 2 * np.abs(orders) < count
    ahead, back = (spectrum[np.where(seen, sense * orders, 0)] for sense in (1, -1))
    turned = jnp.where(system.spin.speed < 0, back, ahead)
    return jnp.where(seen[:, None], turned, 0.0)


def _of_other(
    guess: HarmonicOrbit, orders: np.ndarray, revolutions: int, ports: int
) -> Complex[Array, "K p"]:
    """Harmonics of another orbit, of as long a period or of a part of it."""
    times, rest = divmod(revolutions, guess.revolutions)
    if rest or guess.ports.shape[1] != ports:
        raise ValueError(
            f"The guess has a period of {guess.revolutions} revolutions and {guess.ports.shape[1]} ports, "
            f"which does not fit one of {revolutions} and {ports}."
        )
    there = orders // times + guess.harmonics
    held = (orders % times == 0) & (np.abs(orders) <= times * guess.harmonics)
    return jnp.where(held[:, None], guess.ports[np.where(held, there, 0)], 0.0)
