"""Balance: the equations of harmonic balance for the displacements where contacts act.

    u_k = row P(i w_k)^-1 ( load_k + column F_k ),     F_k that of the forces of the motion itself

Linear parts are exact in every harmonic, so the displacements of the ports alone are unknown. Forces
are known in time, displacements in frequency; Fourier transforms convert one to the other. Where several
shafts have unbalance, harmonics and samples are those of the angles of all of them.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Complex, Float, Int

from ..core import linalg
from ..core.plane import plane
from ..core.quantities import Scalar
from ..effects.law import Now
from ..equations.pencil import Pencil
from ..equations.port import of_each
from ..equations.system import System


class Balance(eqx.Module):
    """The residual `u - row P^-1 ( load + column F(u) )` of the harmonics of the ports.

    `K` harmonics `exp(i k . theta)` of the angles of `d` clocks: the first shaft's over `revolutions`, and
    those of the further shafts that have unbalance.
    """

    system: System
    frequencies: Float[Array, " K"]  # [rad/s]
    loaded: Complex[Array, "K n"]  # coordinates under the loads alone
    driven: Complex[Array, "K n p"]  # by a unit of force at every port
    size: Scalar  # of the displacements [m]
    harmonics: tuple[int, ...] = eqx.field(static=True)  # H of every clock
    samples: tuple[int, ...] = eqx.field(static=True)  # of every angle
    revolutions: int = eqx.field(static=True)  # of the first shaft in a period

    @classmethod
    def of(
        cls,
        system: System,
        harmonics: tuple[int, ...],
        revolutions: int,
        samples: tuple[int, ...],
    ) -> "Balance":
        """Balance with the exact responses of the linear part in all harmonics."""
        speed, load, n = system.spin.speed, system.load, system.n
        columns = [port.column for port in system.ports]
        columns = jnp.stack(columns, axis=1) if columns else jnp.zeros((n, 0))
        orders = orders_of(harmonics)
        # Exactly 1 for the unbalance: hysteretic damping has no effect on whirl at the shaft's own speed.
        frequencies = speed * (orders[:, 0] / revolutions)
        place = lambda *order: int(np.flatnonzero((orders == order).all(axis=1))[0])
        none = (0,) * (len(harmonics) - 1)
        forces = jnp.zeros((len(orders), n), complex)
        if load.constant is not None:
            forces = forces.at[place(0, *none)].add(load.constant)
        if load.unbalance is not None:
            forces = forces.at[place(revolutions, *none)].add(speed**2 * load.unbalance)
        for k, other in enumerate(system.others):
            own, phase = other.clock.speed(speed), other.clock.phase
            turned = other.column if phase is None else other.column * jnp.exp(1j * phase)
            frequencies = frequencies + own * orders[:, 1 + k]
            once = [0] * len(harmonics)
            once[1 + k] = 1
            forces = forces.at[place(*once)].add(own**2 * turned)

        def response(case):
            frequency, force = case
            pencil = Pencil.of(system, jnp.sign(frequency - speed))
            acting = jnp.concatenate([force[:, None], columns], axis=1)
            return linalg.solve(pencil.dynamic(frequency), acting)

        responses = jax.lax.map(response, (frequencies, forces))
        parts = frequencies, responses[..., 0], responses[..., 1:]
        sizes = harmonics, samples, revolutions
        plain = cls(system, *parts, jnp.ones(()), *sizes)
        size = jax.lax.stop_gradient(jnp.max(jnp.abs(plain.rows @ plain.loaded.T), initial=0.0))
        return cls(system, *parts, jnp.where(size > 0, size, 1.0), *sizes)

    @property
    def rows(self) -> Float[Array, "p n"]:
        """Rows that read the displacements of the ports."""
        rows = [port.row for port in self.system.ports]
        return jnp.stack(rows) if rows else jnp.zeros((0, self.system.n))

    @property
    def orders(self) -> Int[np.ndarray, "K d"]:
        """Harmonics of every clock, -H to H."""
        return orders_of(self.harmonics)

    def coordinates(self, forces: Complex[Array, "K p"]) -> Complex[Array, "K n"]:
        """All coordinates, from the harmonics of the port forces [N]."""
        return self.loaded + jnp.einsum("knp,kp->kn", self.driven, forces)

    def forces(self, ports: Complex[Array, "K p"]) -> Complex[Array, "K p"]:
        """Harmonics of the port forces [N] from those of the displacements there [m]."""
        total = jax.vmap(self.port_forces)(*self._sampled(ports))
        return self._transform(total[..., 0] + 1j * total[..., 1])[self._places]

    def residual(self, x: Float[Array, " a"]) -> Float[Array, " a"]:
        """Residual of the unknowns, over `size`."""
        ports = self.decode(x)
        return x - self.encode(self.coordinates(self.forces(ports)) @ self.rows.T)

    def jacobian(self, x: Float[Array, " a"]) -> Float[Array, "a a"]:
        """Derivative of the residual by the unknowns.

            dF_k = Sum_l ( A_(k-l) + i w_l C_(k-l) ) du_l + ( B_(k+l) - i w_l D_(k+l) ) du_l*

        `A` to `D` are the transforms of the derivatives of the forces by displacement and velocity and by
        their conjugates, whose samples are those of the forces, so this is exact.
        """
        by = jax.vmap(jax.jacfwd(self.port_forces, argnums=(0, 1)))(*self._sampled(self.decode(x)))
        (a, b), (c, d) = (map(self._transform, _complex_parts(part)) for part in by)
        orders, rates = self.orders, 1j * self.frequencies[:, None, None]
        apart = self._indices(orders[:, None] - orders)
        total = self._indices(orders[:, None] + orders)
        straight, mirrored = (
            jnp.einsum("knp,klpq->knlq", self.rows @ self.driven, part)
            for part in (a[apart] + rates * c[apart], b[total] - rates * d[total])
        )
        size = x.size // 2
        p = jnp.eye(size) - straight.reshape(size, size)
        q = -mirrored.reshape(size, size)
        upper = jnp.concatenate([p.real + q.real, q.imag - p.imag], axis=1)
        lower = jnp.concatenate([p.imag + q.imag, p.real - q.real], axis=1)
        return jnp.concatenate([upper, lower])

    def encode(self, ports: Complex[Array, "K p"]) -> Float[Array, " a"]:
        """Unknowns of displacements [m]."""
        flat = ports.ravel() / self.size
        return jnp.concatenate([flat.real, flat.imag])

    def decode(self, x: Float[Array, " a"]) -> Complex[Array, "K p"]:
        """Displacements [m] of unknowns."""
        real, imag = jnp.split(self.size * x, 2)
        return jax.lax.complex(real, imag).reshape(self.frequencies.size, -1)

    def sampled(self, coefficients: Complex[Array, "K p"]) -> Complex[Array, "N p"]:
        """Samples at all angles, each from zero on, those of the last clock next to each other."""
        width = coefficients.shape[1]
        spectrum = jnp.zeros((math.prod(self.samples), width), complex)
        spectrum = spectrum.at[self._places].set(coefficients).reshape(*self.samples, width)
        axes = tuple(range(len(self.samples)))
        return jnp.fft.ifftn(spectrum, axes=axes, norm="forward").reshape(-1, width)

    def at(self, coefficients: Complex[Array, "K p"], time: Scalar) -> Complex[Array, " p"]:
        """Values of harmonics at a time [s]."""
        return jnp.exp(1j * self.frequencies * time) @ coefficients

    def port_forces(
        self, place: Float[Array, "p 2"], velocity: Float[Array, "p 2"], angle: Scalar
    ) -> Float[Array, "p 2"]:
        """Total force at every port [N], by the motion of the ports and the first shaft's angle [rad]."""
        clocks = self.system.clocks
        now = Now(
            self.system.spin.speed,
            angle if clocks else None,
            time=jnp.zeros(()) if clocks else None,
        )
        own = of_each(self.system.ports, now, place, velocity)
        motions = zip(self.system.ports, place, velocity, own, strict=True)
        return jnp.stack([port.forces(d, v, one).sum(0) for port, d, v, one in motions])

    def _sampled(
        self, ports: Complex[Array, "K p"]
    ) -> tuple[Float[Array, "N p 2"], Float[Array, "N p 2"], Float[Array, " N"]]:
        """Displacement [m], velocity [m/s] and the first shaft's angle [rad] at every sample."""
        rates = 1j * self.frequencies[:, None] * ports
        motion = (plane(self.sampled(part), axis=-1) for part in (ports, rates))
        angle = 2 * jnp.pi * self.revolutions / self.samples[0] * jnp.arange(self.samples[0])
        return *motion, jnp.repeat(angle, math.prod(self.samples[1:]))

    def _transform(self, samples: Array) -> Array:
        """Harmonics of samples (N, ..), at the places of `_indices`."""
        axes, rest = tuple(range(len(self.samples))), samples.shape[1:]
        grid = samples.reshape(*self.samples, *rest)
        return jnp.fft.fftn(grid, axes=axes, norm="forward").reshape(-1, *rest)

    def _indices(self, orders: Int[np.ndarray, "... d"]) -> Int[np.ndarray, "..."]:
        """Places of harmonics in a transform."""
        each = np.moveaxis(np.mod(orders, self.samples), -1, 0)
        return np.asarray(np.ravel_multi_index(tuple(each), self.samples))

    @property
    def _places(self) -> Int[np.ndarray, " K"]:
        return self._indices(self.orders)


def orders_of(harmonics: tuple[int, ...]) -> Int[np.ndarray, "K d"]:
    """All orders from -H to H of every clock, those of the last one next to each other."""
    each = np.meshgrid(*[np.arange(-h, h + 1) for h in harmonics], indexing="ij")
    return np.stack(each, axis=-1).reshape(-1, len(harmonics))


def speeds_of(system: System) -> Float[Array, " d"]:
    """Speeds of the first shaft and of those beside it that have unbalance [rad/s]."""
    speed = system.spin.speed
    return jnp.stack([speed, *(other.clock.speed(speed) for other in system.others)])


class Balanced(NamedTuple):
    """Harmonics that meet a balance, NaN where none were found."""

    ports: Complex[Array, "K p"]  # displacements [m]
    forces: Complex[Array, "K p"]  # [N]
    residual: Scalar  # largest of any harmonic, over the largest of the ports [1]
    iterations: Int[Array, ""]


def balanced(
    balance: Balance,
    first: Complex[Array, "K p"] | None,
    finder: Any,
    tolerance: float,
    max_iterations: int,
) -> Balanced:
    """Harmonics that meet a balance, near those of a guess, or of the motion without forces."""
    ports, none = balance.loaded @ balance.rows.T, jnp.zeros(())
    if not balance.system.ports:
        return Balanced(ports, jnp.zeros_like(ports), none, jnp.zeros((), int))
    x, iterations = _root(balance, ports if first is None else first, finder, max_iterations)
    residual = jnp.max(jnp.abs(balance.residual(x))) / jnp.max(jnp.abs(x))
    ports = balance.decode(jnp.where(residual <= 10 * tolerance, x, jnp.nan))
    return Balanced(ports, balance.forces(ports), residual, iterations)


def _root(
    balance: Balance, ports: Complex[Array, "K p"], finder: Any, max_iterations: int
) -> tuple[Float[Array, " a"], Int[Array, ""]]:
    """Unknowns at the root near a guess, with their derivatives, and the number of iterations."""
    constant = jax.lax.stop_gradient(balance)
    root = optx.root_find(
        _residual,
        finder,
        constant.encode(jax.lax.stop_gradient(ports)),
        constant,
        max_steps=max_iterations,
        throw=False,
    )
    # A last Newton step with a constant matrix has the derivative of the root itself.
    x = jax.lax.stop_gradient(root.value)
    x = x - linalg.solve(constant.jacobian(x), balance.residual(x))
    return x, root.stats["num_steps"]


@eqx.filter_custom_jvp
def _residual(x: Float[Array, " a"], balance: Balance) -> Float[Array, " a"]:
    """The residual of a constant balance; its derivative by the unknowns is `Balance.jacobian`."""
    return balance.residual(x)


@_residual.def_jvp
def _residual_jvp(primals, tangents):
    (x, balance), (along, _) = primals, tangents
    return balance.residual(x), balance.jacobian(x) @ along


def _complex_parts(
    matrix: Float[Array, "N p 2 q 2"],
) -> tuple[Complex[Array, "N p q"], Complex[Array, "N p q"]]:
    """`a, b` of `a z + b z*` for a matrix that acts on (x, y)."""
    along, across = matrix[:, :, 0, :, 0], matrix[:, :, 1, :, 1]
    up, down = matrix[:, :, 1, :, 0], matrix[:, :, 0, :, 1]
    even = jax.lax.complex(along + across, up - down)
    odd = jax.lax.complex(along - across, up + down)
    return even / 2, odd / 2


def truncation(
    balance: Balance,
    row: Float[Array, "s n"],
    coefficients: Complex[Array, "K s"],
    ports: Complex[Array, "K p"],
) -> Scalar:
    """`sum |row D(k)^-1 F_k|` over `H < |k| <= 2 H`, the forces left out, over the largest harmonic.

    It is a sum because symmetry may leave any of these harmonics zero, the first ones too.
    """
    if not balance.system.ports:
        return jnp.zeros(())
    twice = tuple(2 * h for h in balance.harmonics)
    wide = Balance.of(balance.system, twice, balance.revolutions, balance.samples)
    within = np.all(np.abs(wide.orders) <= balance.harmonics, axis=1)
    all_ports = jnp.zeros((len(within), ports.shape[1]), complex)
    forces = wide.forces(all_ports.at[np.flatnonzero(within)].set(ports))
    added = jnp.abs(jnp.einsum("sn,knp,kp->ks", row, wide.driven, forces))
    added = jnp.where(within[:, None], 0.0, added)
    return jnp.max(jnp.sum(added, axis=0)) / jnp.max(jnp.abs(coefficients))
