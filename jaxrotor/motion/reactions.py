"""Reactions: forces and moments of bearings, constraints and stops on the rotor."""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core import linalg
from ..core.blocks import Blocks
from ..core.compiled import compiled
from ..core.plane import direction
from ..core.quantities import known
from ..core.tables import largest_rows, notebook_table
from ..effects import AbstractContact, Coupling, Gravity, OldhamCoupling, Support
from ..effects.layout import check_one_shaft
from ..equations.forces import (
    applied_force,
    body_force,
    contact_force,
    contacts_of,
    resistance,
)
from ..equations.kinematics import Kinematics
from ..equations.parts import assemble_blocks, assemble_load
from ..equations.pencil import Pencil
from ..equations.rotating_frame import Transient
from ..equations.system import System, assemble
from ..scene import Scene
from ..shafts.cased import ends, row_of
from ..shafts.influence import Influence
from ..shafts.virtual import VirtualLine
from ..spins.base import Turning
from .history import TimeHistory
from .pieces import check_always


Act = Callable[[Kinematics], tuple[Array, Array]]  # forces and moments, in the axes of the shaft


class Reactions(eqx.Module):
    """Forces and moments on the rotor in fixed axes, `k` of them at `T` times."""

    time: Float[Array, " T"]  # [s]
    angle: Float[Array, " T"]  # of rotation [rad]
    force: Complex[Array, "T k"]  # x + i y [N]
    moment: Complex[Array, "T k"]  # rotates the tangent, positive with the slope [N m]
    static: Complex[Array, " k"]  # force of the rotor at rest at angle 0 [N], NaN if it has none
    static_moment: Complex[Array, " k"]  # [N m]
    names: tuple[str, ...] = eqx.field(static=True)
    scene: Scene
    solver: str = eqx.field(static=True)  # by which the motion was computed

    def _repr_html_(self) -> str:
        places = [self.scene.where(name) for name in self.names]
        rest = np.abs(np.asarray(self.static)).tolist()
        largest = largest_rows(places, np.abs(self.force), self.time)
        rows = [(*row, still) for row, still in zip(largest, rest, strict=True)]
        heads = ("reaction", "largest [N]", "at time [s]", "at rest [N]")
        samples = f"Reactions at {self.time.size} samples, motion by {self.solver}"
        return notebook_table(samples, heads, rows)

    @property
    def rotating(self) -> Complex[Array, "T k"]:
        """Force in the axes of the shaft [N]."""
        return self._in_axes_of_shaft(self.force)

    @property
    def rotating_moment(self) -> Complex[Array, "T k"]:
        """Moment in the axes of the shaft [N m]."""
        return self._in_axes_of_shaft(self.moment)

    @property
    def dynamic(self) -> Complex[Array, "T k"]:
        """Force less that at rest [N], in fixed axes."""
        return self.force - self._determined(self.static)

    @property
    def dynamic_moment(self) -> Complex[Array, "T k"]:
        """Moment less that at rest [N m], in fixed axes."""
        return self.moment - self._determined(self.static_moment)

    @property
    def rotating_dynamic(self) -> Complex[Array, "T k"]:
        """Force less that at rest [N], in the axes of the shaft."""
        return self._in_axes_of_shaft(self.dynamic)

    @property
    def rotating_dynamic_moment(self) -> Complex[Array, "T k"]:
        """Moment less that at rest [N m], in the axes of the shaft."""
        return self._in_axes_of_shaft(self.dynamic_moment)

    def _in_axes_of_shaft(self, vectors: Complex[Array, "T k"]) -> Complex[Array, "T k"]:
        return vectors * jnp.exp(-1j * self.angle)[:, None]

    def _determined(self, static: Complex[Array, " k"]) -> Complex[Array, " k"]:
        if known(static) and not np.isfinite(static).all():
            raise ValueError(
                "Nothing elastic holds the rotor against its weight, so it has no rest position and its "
                "reactions have no static part; use `force` and `moment`, or add a Support."
            )
        return static

    def of(self, name: str) -> Complex[Array, " T"]:
        """Force of one support, constraint or contact, by its name [N]."""
        if name not in self.names:
            raise ValueError(f"There is no {name!r}; there are: {', '.join(self.names)}.")
        return jax.lax.index_in_dim(self.force, self.names.index(name), 1, keepdims=False)


def reactions(response: TimeHistory) -> Reactions:
    """Reactions of supports, couplings, constraints and contacts on the rotor, at every sample.

        support      F = -(k z + c z. .. + m z..),   L = -(k_a z' + c_a z'.),   `of` a casing: on that
        coupling     F = k u + k anisotropy exp(2 i psi) u*,   likewise moments by slopes
        Oldham's     F = m (Omega^2 - i Omega. / 2) d* exp(2 i psi) - m (Omega^2 + i Omega. / 2) d
                         + (W - W* exp(2 i psi)) / 2
        constraint   F_k = Int phi_k (m z.. - loads) dx + ..,   phi_k its influence line

    The reaction of a constraint is minus the work of all loads and inertia forces on the displacement
    `phi_k` by a unit motion of the constraint (Betti; d'Alembert), for rigid and flexible shafts and any
    number of constraints. Contacts are named after their effects; they have no static part, even where
    the rotor rests on one. Where nothing elastic holds the rotor against its weight (a pivot alone) the
    static part is not determined, and is NaN.

    In a flexible shaft, reactions of constraints depend on accelerations, and so on the highest modes,
    which an adaptive solver computes to fewer digits than displacements: started by a `Whirl`, a shaft
    in two pins has an error of 5e-8 in its displacement, but of 1.4e-3 in its reactions at the default
    tolerance, 3e-5 at `rtol` 1e-9. `simulate` is exact where there is no contact.

    Args:
        response: result of `run_up` or `simulate`.

    Returns:
        `Reactions`, whose axis `k` has supports, then couplings, constraints and contacts.

    Raises:
        ValueError: if a crack is a hinge of the shaft, or a pedestal is loose.

    Source: course project of `turbine-run-up`, Newton-Euler equations (9) with its errata.
    """
    check_one_shaft(response.scene.shafts, "`reactions`")
    cure = "take them of a run up to then, and of one on from `motion.end`"
    check_always(response.scene, "`reactions`", cure)
    scene = response.scene
    if owners := [scene.name_of(one) for one in scene.of(AbstractContact) if one.own_port]:
        raise ValueError(
            f"Reactions are those of forces at stations of the shaft, but {', '.join(owners)} acts "
            "otherwise; leave it out, or take a crack by its `loss` and a pedestal as a Casing."
        )
    instants = response.instants
    force, moment, static, static_moment, constraints = _all(scene, assemble(scene), instants)
    names = [scene.name_of(effect) for effect in (*scene.of(Support), *_couplings(scene))]
    names += [f"constraints.{i}" for i in constraints]
    if response.contact_force is not None:
        contacts = scene.of(AbstractContact)
        names += [scene.name_of(effect) for effect in contacts]
        force = jnp.concatenate([force, response.contact_force], axis=1)
        moment = jnp.pad(moment, [(0, 0), (0, len(contacts))])
        static, static_moment = (jnp.pad(a, (0, len(contacts))) for a in (static, static_moment))
    return Reactions(
        time=response.time,
        angle=instants.turning.angle,
        force=force,
        moment=moment,
        static=static,
        static_moment=static_moment,
        names=tuple(names),
        scene=scene,
        solver=response.solver,
    )


@compiled
def _all(scene: Scene, system: System, instants: Kinematics):
    """Forces, moments, both of the rotor at rest, and the numbers of the constraints."""
    transient = Transient.of(scene, jnp.ones(()), jnp.zeros(()), system=system)
    parts = [_support(transient.system, support) for support in scene.of(Support)]
    weights = scene.of(Gravity)
    parts += [_coupling(transient.system, one, weights) for one in _couplings(scene)]
    influence, constraints = scene.shaft.influence(), ()
    if influence is not None:
        constraints = tuple(dict.fromkeys(influence.owners))
        parts.append(_constraints(scene, transient, influence))

    def act(now: Kinematics):
        pairs = [part(now) for part in parts]
        join = lambda which: now.turn * jnp.concatenate([jnp.zeros(0), *(p[which] for p in pairs)])
        return join(0), join(1)

    force, moment = jax.vmap(act)(instants)
    static, static_moment = act(_at_rest(transient.system))
    return force, moment, static, static_moment, constraints


def _support(system: System, support: Support) -> Act:
    """Force and moment of a support on what it holds, in the axes of the shaft."""
    if support.of is None:
        line = VirtualLine.resultant(system.line, support.at)
        held = jnp.eye(2)
    else:
        line = system.line
        row = row_of(line, support.of)
        held = jnp.stack([row, jnp.zeros_like(row)])

    def act(now: Kinematics):
        blocks = support.at_speed(now.turning.speed).blocks(line)
        resisted = resistance(blocks, now)
        if blocks.inertia is not None:
            resisted += blocks.inertia @ now.absolute
        force, moment = -(held @ resisted)
        return force[None], moment[None]

    return act


def _couplings(scene: Scene) -> tuple[Coupling | OldhamCoupling, ...]:
    """Couplings of both kinds, in the order of the reactions."""
    return *scene.of(Coupling), *scene.of(OldhamCoupling)


def _coupling(
    system: System, coupling: Coupling | OldhamCoupling, weights: tuple[Gravity, ...]
) -> Act:
    """Force and moment of a coupling on the shaft, in its axes, and the share of its weight."""
    line = VirtualLine.resultant(system.line, coupling.at)
    blocks = coupling.blocks(line)
    load = sum((one.load(line, blocks) for one in weights), coupling.load(line, blocks))

    def act(now: Kinematics):
        force, moment = applied_force(load, now) - resistance(blocks, now)
        return force[None], moment[None]

    return act


def _constraints(scene: Scene, transient: Transient, influence: Influence) -> Act:
    """Forces and moments of the constraints, in the axes of the shaft."""
    line = VirtualLine(line=transient.system.line, shapes=influence.shapes, slopes=influence.slopes)
    blocks = assemble_blocks(scene, line)
    load = assemble_load(scene, line, blocks)
    system, inertia = transient.system, blocks.inertia
    forces, moments = _selections(influence)

    def act(now: Kinematics):
        own = blocks
        if system.tabled is not None:
            own = assemble_blocks(scene.at_speed(now.turning.speed), line)
        reaction = resistance(own, now) - applied_force(load, now)
        contacts, column = contacts_of(system, now), lambda port: ends(line, port.at, port.on)[1]
        reaction -= contact_force(system, now, contacts, column)
        outward = direction(now.bodies)
        reaction -= body_force(system, now, outward, lambda race: line.column(race.at))
        if inertia is not None:
            reaction += inertia @ now.absolute
        return jnp.asarray(forces) @ reaction, jnp.asarray(moments) @ reaction

    return act


def _selections(influence: Influence) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (c, r) of 0 and 1 that select the force and the moment of every constraint."""
    owned = np.arange(max(influence.owners) + 1)[:, None] == np.array(influence.owners)
    turns = np.array(influence.holds_slope)
    return 1.0 * (owned & ~turns), 1.0 * (owned & turns)


def _at_rest(system: System) -> Kinematics:
    """The rotor at rest under weight and misalignment, its unequal axes that turn at the angle 0."""
    zero, q = jnp.zeros(()), jnp.zeros(system.n, complex)
    still = jnp.zeros(sum(race.bodies.places for race in system.races))
    turning, bodies = Turning(zero, zero, zero), (still, still, still)
    now = Kinematics(turning, q, q, q, *bodies, system.begin())
    if not (system.load.steady and system.n):
        return now
    rest = system.at_rest
    turned = Blocks(fixed_stiffness=rest.blocks.rotating_stiffness)
    fixed = dataclasses.replace(rest.blocks, rotating_stiffness=None, rotating_damping=None)
    pencil = Pencil.of(dataclasses.replace(rest, blocks=fixed + turned))
    force = applied_force(system.load, now)
    pair = jnp.concatenate([force, force.conj()]) if len(pencil.inertia) > system.n else force
    stiff = pencil.stiffness
    rows = jnp.max(jnp.abs(stiff), axis=1, keepdims=True)
    held = linalg.cond(stiff / jnp.where(rows > 0, rows, 1.0)) < 1e14
    stiff = jnp.where(held, stiff, jnp.eye(len(stiff)))
    return now._replace(r=jnp.where(held, linalg.solve(stiff, pair)[: system.n], jnp.nan))
