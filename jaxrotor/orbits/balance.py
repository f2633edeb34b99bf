"""Balance: the equations of harmonic balance for the displacements where contacts act.

    u_k = row P(i w_k)^-1 ( load_k + column F_k ),     F_k that of the forces of the motion itself

Linear parts are exact in every harmonic, so the displacements of the ports alone are unknown. Forces
are known in time, displacements in frequency; Fourier transforms convert one to the other.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core import linalg
from ..core.plane import plane
from ..core.quantities import Scalar
from ..effects.law import Now
from ..equations.pencil import Pencil
from ..equations.port import of_each
from ..equations.system import System


class Balance(eqx.Module):
    """The residual `u - row P^-1 ( load + column F(u) )` of the harmonics of the ports."""

    system: System
    frequencies: Float[Array, " K"]  # [rad/s]
    loaded: Complex[Array, "K n"]  # coordinates under the loads alone
    driven: Complex[Array, "K n p"]  # by a unit of force at every port
    size: Scalar  # of the displacements [m]
    samples: int = eqx.field(static=True)
    revolutions: int = eqx.field(static=True)  # in a period

    @classmethod
    def of(cls, system: System, harmonics: int, revolutions: int, samples: int) -> "Balance":
        """Balance with the exact responses of the linear part in all harmonics."""
        speed, load, n = system.spin.speed, system.load, system.n
        columns = [port.column for port in system.ports]
        columns = jnp.stack(columns, axis=1) if columns else jnp.zeros((n, 0))
        # Exactly 1 for the unbalance: hysteretic damping has no effect on whirl at the shaft's own speed.
        frequencies = speed * (jnp.arange(-harmonics, harmonics + 1) / revolutions)
        forces = jnp.zeros((2 * harmonics + 1, n), complex)
        if load.constant is not None:
            forces = forces.at[harmonics].add(load.constant)
        if load.unbalance is not None:
            forces = forces.at[harmonics + revolutions].add(speed**2 * load.unbalance)

        def response(case):
            frequency, force = case
            pencil = Pencil.of(system, jnp.sign(frequency - speed))
            acting = jnp.concatenate([force[:, None], columns], axis=1)
            return linalg.solve(pencil.dynamic(frequency), acting)

        responses = jax.lax.map(response, (frequencies, forces))
        parts = frequencies, responses[..., 0], responses[..., 1:]
        plain = cls(system, *parts, jnp.ones(()), samples, revolutions)
        size = jax.lax.stop_gradient(jnp.max(jnp.abs(plain.rows @ plain.loaded.T), initial=0.0))
        return cls(system, *parts, jnp.where(size > 0, size, 1.0), samples, revolutions)

    @property
    def rows(self) -> Float[Array, "p n"]:
        """Rows that read the displacements of the ports."""
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
        in_time = (self._sampled(part) for part in (ports, rates))
        parts = [plane(part, axis=-1) for part in in_time]
        speed = self.system.spin.speed
        angle = 2 * jnp.pi * self.revolutions / self.samples * jnp.arange(self.samples)

        def at(places: Array, velocities: Array, angle: Array) -> Float[Array, "p 2"]:
            now = of_each(self.system.ports, Now(speed, angle), places, velocities)
            motions = zip(self.system.ports, places, velocities, now, strict=True)
            return jnp.stack([port.forces(d, v, own).sum(0) for port, d, v, own in motions])

        total = jax.vmap(at)(parts[0], parts[1], angle)
        return jnp.fft.fft(total[..., 0] + 1j * total[..., 1], axis=0, norm="forward")[self.orders]

    def residual(self, x: Float[Array, " a"]) -> Float[Array, " a"]:
        """Residual of the unknowns, over `size`."""
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
        """Samples over a period, from angle 0."""
        spectrum = jnp.zeros((self.samples, coefficients.shape[1]), complex)
        spectrum = spectrum.at[self.orders].set(coefficients)
        return jnp.fft.ifft(spectrum, axis=0, norm="forward")


def truncation(
    balance: Balance,
    revolutions: int,
    row: Float[Array, "s n"],
    coefficients: Complex[Array, "K s"],
    ports: Complex[Array, "K p"],
) -> Scalar:
    """`sum |row D(k)^-1 F_k|` over `H < |k| <= 2 H`, the forces left out, over the largest harmonic.

    It is a sum because symmetry may leave any of these harmonics zero, the first ones too.
    """
    if not balance.system.ports:
        return jnp.zeros(())
    harmonics = balance.frequencies.size // 2
    wide = Balance.of(balance.system, 2 * harmonics, revolutions, balance.samples)
    forces = wide.forces(jnp.pad(ports, ((harmonics, harmonics), (0, 0))))
    added = jnp.abs(jnp.einsum("sn,knp,kp->ks", row, wide.driven, forces))
    added = jnp.where(np.abs(wide.orders)[:, None] > harmonics, added, 0.0)
    return jnp.max(jnp.sum(added, axis=0)) / jnp.max(jnp.abs(coefficients))
