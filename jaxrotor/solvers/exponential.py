"""Exponential integrator: the linear rotor exactly, contact forces by Cox-Matthews stages.

    w' = A w + B f(C w + steady(theta)),   w = state less the exact steady response

The eigenvalues of `A`, however stiff, set no step limit, and free flight is exact at any step. The
contact forces see the state only through a few ports, so a step needs one product from the state
to the stage values of the ports, the forces, and one product back.

Source: Cox, Matthews, J. Comput. Phys. 176 (2002), eqs. (22) (ETDRK2) and (26)-(29) (ETDRK4).
"""

from collections.abc import Callable
from typing import Any, ClassVar, Literal

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..motion import Motion
from ..quantities import Scalar
from .form import AbstractForm
from .phi import phi_dense, phi_scalar


WORST_CONDITION = 1e6  # of the eigenvectors: beyond it modal coordinates cost over 6 digits


class Exponential(eqx.Module):
    """Choice of the exponential integrator: `order` 2 or 4, `basis` "modal", "dense" or "auto".

    Modal coordinates take the fewest operations. They fail where eigenvectors merge (over-damped or
    defective pairs), and jax cannot differentiate eigenvectors; "auto" takes the dense
    matrix exponential there and whenever parameters are being traced.
    """

    order: Literal[2, 4] = eqx.field(default=2, static=True)
    basis: Literal["auto", "modal", "dense"] = eqx.field(default="auto", static=True)

    def __check_init__(self):
        if self.order not in (2, 4):
            raise ValueError(f"`order` must be 2 or 4, but is {self.order!r}.")
        if self.basis not in ("auto", "modal", "dense"):
            raise ValueError(f"`basis` must be 'auto', 'modal' or 'dense', but is {self.basis!r}.")

    def form(self, motion: Motion, rows: Float[Array, "s n"]) -> "ExponentialForm":
        """The motion in the coordinates this solver steps."""
        build = DenseBasis.build if self.basis == "dense" else ModalBasis.build
        return ExponentialForm.build(motion, rows, build(motion.matrix()))


class ModalBasis(eqx.Module):
    """`A = V diag(values) V^-1`: coordinates are amplitudes of the modes."""

    values: Complex[Array, " m"]
    vectors: Complex[Array, "m m"]
    inverse: Complex[Array, "m m"]

    @classmethod
    def build(cls, a: Complex[Array, "m m"]) -> "ModalBasis":
        values, vectors = jnp.linalg.eig(a)
        return cls(values, vectors, jnp.linalg.inv(vectors))

    def matrix(self) -> Complex[Array, "m m"]:
        """`A` in this basis."""
        return jnp.diag(self.values)

    def flow(self, span, b: Complex[Array, "m p"], count: int):
        """`exp(span A)` and `span phi_k(span A) b`, in this basis."""
        first, *rest = phi_scalar(span * self.values, count)
        return first, [span * phi[:, None] * b for phi in rest]

    def apply(self, flow, b: Complex[Array, "m p"]) -> Complex[Array, "m p"]:
        return flow[:, None] * b

    def step(self, flow) -> "Rotation":
        return Rotation(flow.real, flow.imag)

    def revolutions(self, count: int, w: Complex[Array, " m"]) -> Complex[Array, " m"]:
        """State after whole free revolutions."""
        return jnp.exp(2 * jnp.pi * count * self.values) * w


class DenseBasis(eqx.Module):
    """Coordinates are the state itself: no eigenvectors needed, or differentiated."""

    a: Complex[Array, "m m"]
    vectors: Complex[Array, "m m"]
    inverse: Complex[Array, "m m"]

    @classmethod
    def build(cls, a: Complex[Array, "m m"]) -> "DenseBasis":
        return cls(a, jnp.eye(a.shape[0]) + 0j, jnp.eye(a.shape[0]) + 0j)

    def matrix(self) -> Complex[Array, "m m"]:
        """`A` in this basis."""
        return self.a

    def flow(self, span, b: Complex[Array, "m p"], count: int):
        return phi_dense(span * self.a, span * b, count)

    def apply(self, flow, b: Complex[Array, "m p"]) -> Complex[Array, "m p"]:
        return flow @ b

    def step(self, flow) -> "Dense":
        return Dense(_real(flow))

    def revolutions(self, count: int, w: Complex[Array, " m"]) -> Complex[Array, " m"]:
        once, _ = phi_dense(2 * jnp.pi * self.a, jnp.zeros((self.a.shape[0], 0), complex), 0)
        return jnp.linalg.matrix_power(once, count) @ w


class Rotation(eqx.Module):
    """Advance of modal amplitudes: one complex factor a mode, on `[re, im]`."""

    real: Float[Array, " m"]
    imag: Float[Array, " m"]

    def __call__(self, w: Float[Array, " 2m"]) -> Float[Array, " 2m"]:
        a, b = jnp.split(w, 2)
        return jnp.concatenate([self.real * a - self.imag * b, self.real * b + self.imag * a])


class Dense(eqx.Module):
    """Advance by a full matrix, on `[re, im]`."""

    matrix: Float[Array, "2m 2m"]

    def __call__(self, w: Float[Array, " 2m"]) -> Float[Array, " 2m"]:
        return self.matrix @ w


class ExponentialForm(AbstractForm):
    """`y = [Re w, Im w]`: deviation from the exact steady response, in a basis of `A`."""

    motion: Motion
    basis: ModalBasis | DenseBasis
    drive: Complex[Array, "m p"]  # B: port forces to coordinates
    ports: "Reading | None"
    stations: "Reading"
    still: Complex[Array, " m"]
    whirling: Complex[Array, " m"]

    @classmethod
    def build(cls, motion: Motion, rows: Array, basis: ModalBasis | DenseBasis):
        still, whirling = motion.steady()
        ports = None
        drive = jnp.zeros((still.size, 0), complex)
        if motion.columns is not None and motion.rows is not None:
            drive = basis.inverse @ jnp.concatenate([0 * motion.columns, motion.columns])
            ports = Reading.build(motion, motion.rows, basis, still, whirling)
        stations = Reading.build(motion, rows, basis, still, whirling)
        return cls(motion, basis, drive, ports, stations, still, whirling)

    @property
    def field(self) -> "PortField":
        generator = self.basis.matrix()
        return PortField(self.motion, _real(generator), _real(self.drive), self.ports)

    def encode(self, q, velocity):
        state = jnp.concatenate([q, velocity / self.motion.rate])
        w = self.basis.inverse @ (state - self.still - self.whirling)
        return jnp.concatenate([w.real, w.imag])

    def decode(self, y):
        state = self.basis.vectors @ _complex(y) + self.still + self.whirling
        q, rate = jnp.split(state, 2)
        return q, self.motion.rate * rate

    def read(self, theta, y):
        return self.stations(theta, y).reshape(2, 2, -1)

    def fly(self, y: Array, revolutions: int) -> Array:
        """State after whole revolutions without contact, in closed form."""
        w = self.basis.revolutions(revolutions, _complex(y))
        return jnp.concatenate([w.real, w.imag])


class Reading(eqx.Module):
    """`[Re, Im]` of displacement and velocity of stations: linear in `y`, plus the steady response."""

    matrix: Float[Array, "4s 2m"]
    still: Float[Array, " 4s"]
    cos: Float[Array, " 4s"]
    sin: Float[Array, " 4s"]
    s: Scalar

    @classmethod
    def build(cls, motion: Motion, rows, basis, still, whirling) -> "Reading":
        see = station_gain(motion, rows)
        offset, whirl = see @ still, see @ whirling
        parts = [jnp.concatenate([z.real, z.imag]) for z in (offset, whirl, 1j * whirl)]
        return cls(_real(see @ basis.vectors), *parts, motion.s)

    def steady(self, theta: Scalar) -> Float[Array, " 4s"]:
        phase = self.s * theta
        return self.still + jnp.cos(phase) * self.cos + jnp.sin(phase) * self.sin

    def __call__(self, theta: Scalar, y: Array) -> Float[Array, " 4s"]:
        return self.matrix @ y + self.steady(theta)


class PortField(eqx.Module):
    """`dy/dtheta = A y + B f(ports)`, all real."""

    motion: Motion
    generator: Float[Array, "2m 2m"]
    drive: Float[Array, "2m 2p"]
    ports: Reading | None

    def __call__(self, theta: Scalar, y: Array, args: None = None) -> Array:
        del args
        rate = self.generator @ y
        if self.ports is not None:
            rate = rate + self.drive @ self.forces(self.ports(theta, y))
        return rate

    def forces(self, seen: Float[Array, " 4p"]) -> Float[Array, " 2p"]:
        """`[Re, Im]` of the port forces from displacement and velocity of the ports."""
        parts = seen.reshape(2, 2, -1)
        return self.motion.port_forces(parts[:, 0], parts[:, 1]).ravel()


class Tableau(eqx.Module):
    """One exponential step of fixed size, in terms of the ports.

    Stage `i`: `Y_i = look[c_i] y + steady(theta + c_i h) + Sum_j echo[i][j] f_j`, `f_i = f(Y_i)`;
    then `y <- advance(y) + feed (f_0, f_1, ..)`.
    """

    advance: Rotation | Dense
    look: Float[Array, "c 4p 2m"]  # one for every distinct stage time
    echo: tuple[dict[int, Array], ...]  # of stage i by earlier stage j, (4p, 2p)
    feed: Float[Array, "2m stages*2p"]
    h: Scalar
    times: tuple[float, ...] = eqx.field(static=True)  # distinct, in steps
    stages: tuple[int, ...] = eqx.field(static=True)  # which time each stage is at

    @classmethod
    def build(cls, form: ExponentialForm, h: Scalar, order: int) -> "Tableau":
        basis, b = form.basis, form.drive
        see = station_gain(form.motion, form.motion.rows) @ basis.vectors
        half, full = (0.5, 1.0) if order == 4 else (1.0, 1.0)
        flow, (one, two, *three) = basis.flow(full * h, b, 3 if order == 4 else 2)
        if order == 2:
            times, stages = (0.0, 1.0), (0, 1)
            echo = ({}, {0: one})
            feed = [one - two, two]
            looks = [see, _look(see, flow)]
        else:
            mid_flow, (p,) = basis.flow(half * h, b, 1)
            times, stages = (0.0, 0.5, 1.0), (0, 1, 1, 2)
            echo = ({}, {0: p}, {1: p}, {0: basis.apply(mid_flow, p) - p, 2: 2 * p})
            both = 2 * two - 4 * three[0]
            feed = [one - 3 * two + 4 * three[0], both, both, 4 * three[0] - two]
            looks = [see, _look(see, mid_flow), _look(see, flow)]
        return cls(
            basis.step(flow),
            jnp.stack([_real(look) for look in looks]),
            tuple({j: _real(see @ part) for j, part in row.items()} for row in echo),
            jnp.concatenate([_real(part) for part in feed], axis=1),
            h,
            times,
            stages,
        )

    def __call__(self, field: PortField, theta: Scalar, y: Array) -> Array:
        seen = (self.look.reshape(-1, y.size) @ y).reshape(len(self.times), -1)
        steady = [field.ports.steady(theta + c * self.h) for c in self.times]
        forces: list[Array] = []
        for time, echo in zip(self.stages, self.echo, strict=True):
            stage = seen[time] + steady[time]
            for earlier, gain in echo.items():
                stage = stage + gain @ forces[earlier]
            forces.append(field.forces(stage))
        return self.advance(y) + self.feed @ jnp.concatenate(forces)


class ExponentialStep(dfx.AbstractSolver):
    """A tableau as a diffrax solver on a fixed grid of steps of `tableau.h`."""

    tableau: Tableau
    field: PortField
    order_: int = eqx.field(static=True)

    term_structure: ClassVar = dfx.ODETerm
    interpolation_cls: ClassVar[Callable[..., Any]] = dfx.LocalLinearInterpolation

    def order(self, terms) -> int:
        del terms
        return self.order_

    def init(self, terms, t0, t1, y0, args) -> None:
        del terms, t0, t1, y0, args

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del terms, t1, args, solver_state, made_jump
        y1 = self.tableau(self.field, t0, y0)
        return y1, None, {"y0": y0, "y1": y1}, None, dfx.RESULTS.successful

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)


def well_conditioned(vectors: np.ndarray) -> bool:
    """Whether the eigenvectors of every (known) matrix are far enough from merging."""
    return bool(np.all(np.linalg.cond(vectors) < WORST_CONDITION))


def station_gain(motion: Motion, rows: Float[Array, "s n"]) -> Float[Array, "2s 2n"]:
    """Displacement and velocity of stations from `(q, dq/dtheta)`."""
    zero = jnp.zeros_like(rows)
    return jnp.block([[rows, zero], [zero, motion.rate * rows]])


def _look(see, flow) -> Complex[Array, "2p m"]:
    return see * flow if flow.ndim == 1 else see @ flow


def _real(z: Complex[Array, "a b"]) -> Float[Array, "2a 2b"]:
    """Complex matrix as it acts on `[re, im]`."""
    return jnp.block([[z.real, -z.imag], [z.imag, z.real]])


def _complex(y: Float[Array, " 2m"]) -> Complex[Array, " m"]:
    real, imag = jnp.split(y, 2)
    return jax.lax.complex(real, imag)
