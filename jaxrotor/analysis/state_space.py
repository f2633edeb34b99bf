"""State space of the linear rotor from forces to displacements, as used in control engineering."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..core import linalg
from ..core.checks import check_counts
from ..core.compiled import compiled_quickly
from ..effects.base import AbstractBodies, AbstractContact
from ..effects.layout import check_one_shaft
from ..equations.pencil import ROUNDING, Pencil, isotropic
from ..equations.stationary_frame import check_known_in_time
from ..equations.system import System, assemble, structure
from ..scene import Scene
from .forced import ending_span
from .linearized import check_linear
from .modal import less_rounding, slowest_first
from .resolved import resolved


_ALIKE = 1 - 1e-10  # cosine between two modes above which they count as one


def state_space(scene: Scene, forces=None, displacements=None, modes: int | None = None) -> Any:
    """`w. = A w + B F`, `z = C w + D F`: real modal state space, `w` the amplitudes of the modes.

    `A` has a block `[s, -v; v, s]` for every root `s + i v` of an isotropic rotor; otherwise for
    every pair of conjugate roots, and a number for a real one. Modal amplitudes keep for every root the
    digits of `roots`; with displacements as states the fastest modes would cost the slowest theirs.

    Args:
        scene: a rotor without contact or balls; its unbalance and weight are left out.
        forces: station(s) [m] of the forces, by default the observed station of `simulate`.
        displacements: station(s) [m] to observe, by default those of the forces.
        modes: number of the slowest blocks of `A` to keep, at least those of roots at zero; the static
            compliance of the others is added to `D`, and nodes that are "auto" are as many as these blocks
            need. By default all are kept; then `D` is zero except
            for coordinates without mass.

    Returns:
        A `scipy.signal.StateSpace`, SI: inputs `Fx, Fy` [N] of one force after the other, outputs
        `x, y` [m] of each station, in axes that turn with the shaft where `modes(scene).frame` is
        "rotating". For python-control use `control.ss(system.A, system.B, system.C, system.D)`. Not
        differentiable.

    Raises:
        ValueError: the scene has contact, balls or hysteretic damping, `modes` is not a positive integer
            or leaves out a root at zero, or two roots have merged with their modes.

    Source: Genta (2005), section 2.7.
    """
    check_one_shaft(scene.shafts, "`state_space`")
    from scipy.signal import StateSpace

    check_linear(scene)
    if scene.of(AbstractContact) or scene.of(AbstractBodies):
        raise ValueError(
            "A state space is that of a linear rotor, but the scene has contacts or balls "
            f"({structure(scene).owners_of('contact', 'bodies')}); remove them, as by "
            '`scene.without("limiters")`.'
        )
    if modes is not None:
        check_counts(modes=modes)
    into = scene.stations(forces)
    seen = into if displacements is None else scene.stations(displacements)
    for at in into:
        scene = ending_span(scene, at)
    system = assemble(resolved(scene, modes))
    check_known_in_time(system)
    equations = _equations(system, into, seen)
    circular = isotropic(system.blocks)
    values, enter, leave, still, through = _motions(circular, *map(np.asarray, equations))
    if circular:
        values: Any = np.asarray(less_rounding(jnp.asarray(values), system))
    order = np.asarray(slowest_first(jnp.asarray(values)))
    every = order[circular | (values[order].imag >= 0)]
    once = every[:modes]
    if modes is not None:
        _check_left_out(values[every], modes, equations[3])
    left = np.ones(values.size, bool)
    left[once] = False
    if not circular:  # conjugates of a real matrix are neighbours, here the upper half follows
        left[once[values[once].imag > 0] - 1] = False
    rest = through + leave[:, left] @ still[left]
    values, enter, leave = values[once], enter[once], leave[:, once]
    if circular:
        return StateSpace(*map(_planar, (np.diag(values), enter, leave, rest)))
    return StateSpace(*_paired(values, enter, leave), rest.real)


@compiled_quickly
def _equations(system: System, forces, displacements):
    """`(A - shift)^-1` of the state, `P(shift)^-1 columns`, rows and the shift.

    Coordinates are complex for an isotropic rotor, otherwise real `(x, y)`.
    """
    pencil, line = Pencil.of(system), system.line
    columns, rows = jax.vmap(line.column)(forces).T + 0j, jax.vmap(line.row)(displacements) + 0j
    if not isotropic(system.blocks):
        one = jnp.eye(system.n)
        pair = jnp.block([[one, 1j * one], [one, -1j * one]])  # (q, q*) of (x, y)
        pencil = jax.tree.map(lambda block: pair.conj().T @ block @ pair / 2, pencil)
        plane = jnp.eye(2)
        columns = jnp.einsum("nf,ab->anfb", columns, plane).reshape(2 * system.n, -1)
        rows = jnp.einsum("sn,ab->sabn", rows, plane).reshape(-1, 2 * system.n)
    shift = pencil.shift
    response = linalg.solve(pencil.at(jnp.asarray(shift + 0j)), columns)
    return pencil.inverse(shift), response, rows, shift


def _motions(circular: bool, inverse: Any, response: Any, rows: Any, shift: Any) -> tuple:
    """Finite roots, their input rows, output columns and static response to forces; and `D`.

    `b = (Y X)^-1 Y B` follows from `(A - shift)^-1 B = -(P^-1 f, P^-1 f)`, so the inertia is not inverted.
    `Y X` is diagonal for distinct roots; vectors of equal roots may be chosen freely on either side.
    `D` is the compliance of coordinates without mass.
    """
    from scipy.linalg import eig

    if not circular:
        inverse, response, rows = inverse.real, response.real, rows.real
    found: Any = eig(inverse, left=True)
    inverses, left, right = found
    finite = np.abs(inverses) * shift > 1e-10
    inverses, left, right = inverses[finite], left[:, finite], right[:, finite]
    alike = np.abs(right.conj().T @ right) - np.eye(inverses.size)
    if alike.size and alike.max() > _ALIKE:
        raise ValueError(
            "Two roots of the rotor have merged with their modes, so the modes are not coordinates; "
            "change its speed or damping slightly."
        )
    left = left.conj().T
    entering = -np.linalg.solve(left @ right, left @ np.concatenate([response, response]))
    leave = rows @ right[: rows.shape[1]]
    through = rows @ response + leave @ entering if not finite.all() else 0 * (rows @ response)
    # Roots at zero divide by zero here, but are never left out.
    with np.errstate(divide="ignore", invalid="ignore"):
        still = -entering / (1 + shift * inverses)[:, None]
    return shift + 1 / inverses, entering / inverses[:, None], leave, still, through


def _check_left_out(values: Any, modes: int, shift: Any) -> None:
    """Raise if a root at zero, as of a free body, is left out: its static compliance is infinite."""
    needed = int(np.max(np.flatnonzero(np.abs(values) <= ROUNDING * shift), initial=-1)) + 1
    if modes < needed:
        raise ValueError(
            f"`modes` must be at least {needed} to keep the roots at zero, whose static compliance is "
            f"infinite, but is {modes}."
        )


def _planar(matrix: Any) -> Any:
    """The real matrix that acts on `(re, im)` of each component like a complex matrix."""
    parts = np.array([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
    return parts.transpose(2, 0, 3, 1).reshape(2 * matrix.shape[0], 2 * matrix.shape[1])


def _paired(values: Any, enter: Any, leave: Any) -> Any:
    """Real matrices `A`, `B`, `C` of pairs of conjugate roots and of real roots."""
    from scipy.linalg import block_diag

    pairs = values.imag > 0
    both = lambda value: [[value.real, -value.imag], [value.imag, value.real]]
    blocks = [both(v) if pair else [[v.real]] for v, pair in zip(values, pairs, strict=True)]
    into = [[b.real, b.imag] if pair else [b.real] for b, pair in zip(enter, pairs, strict=True)]
    out = [
        [2 * c.real, -2 * c.imag] if pair else [c.real]
        for c, pair in zip(leave.T, pairs, strict=True)
    ]
    stacked = lambda parts: np.array([row for part in parts for row in part])
    return block_diag(*blocks), stacked(into), stacked(out).T
