"""Flexible shaft: a beam by its Green's function and polynomials on spans."""

import itertools
from typing import Any, ClassVar, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.blocks import Blocks
from ..core.quantities import Scalar, as_tuple, known, nonnegative, positive, real
from .condensed import MODES, CondensedLine
from .constraint import Constraint, Motion, motions_left
from .greens import CantileverKernel, HeldKernel
from .influence import Influence
from .line import (
    NODES,
    AbstractLine,
    AbstractShaft,
    AbstractSpectralLine,
    Attached,
    Held,
    check_ratio,
    off_shaft,
)
from .materials import Material, steel
from .resolution import nodes_needed
from .section import Section, Step, column, stacked
from .shear import ShearLine
from .spectral import SpectralLine
from .trapezoid import TrapezoidLine


WORTH = 0.4  # share of the coordinates below which a line is condensed


class FlexibleShaft(AbstractShaft):
    """Euler-Bernoulli or Timoshenko shaft with rotary inertia, of one or many round sections.

        z(x) + .. = - Int G(x,s) m z.. ds - Int dG/ds(x,s) (J z'.. - i Omega P z'.) ds + loads

    The equation holds at the ends of spans, and in Galerkin's sense within (see `SpectralLine`).
    Per length, `m = rho A` is the mass, `J = rho I` the diametral and `P = polar_ratio J` the polar
    moment of inertia. `G` is the Green's function under the `constraints`; without them only supports
    hold the shaft. `steps` change the section from their station onwards.
    With `shear=True` the shaft deforms in shear too, and the slope is that of the sections.
    `anisotropy` mu: the bending stiffness is `(1 + mu)` times that of the round section along an axis
    that turns with the shaft, and `(1 - mu)` times across it; shear stiffness and rotary inertia remain
    those of the round section.
    `rule="spectral"`: `nodes` per span between stations, with exponential convergence; `nodes="auto"`
    chooses 2 to 8 for each span, as its part of the bending waves needs, and 8 where sections are traced.
    `rule="trapezoid"`: `nodes` equal cells, of second order, as published; "auto" stands for 8. It is for
    a uniform shaft without shear whose constraints, if any, are at its ends.
    Source: Azarov, Gouskov, Panovko (2023), eqs. (6), (9).
    """

    has_mass: ClassVar[bool] = True

    length: Scalar = positive("length [m]")
    diameter: Scalar = positive("diameter [m]")
    material: Material = eqx.field(default_factory=steel)
    polar_ratio: Scalar = real("polar_ratio [1]", default=2.0)
    nodes: int | Literal["auto"] = eqx.field(default="auto", static=True)
    rule: Literal["spectral", "trapezoid"] = eqx.field(default="spectral", static=True)
    rotary_inertia: bool = eqx.field(default=True, static=True)
    inner_diameter: Scalar = nonnegative("inner_diameter [m]", default=None)
    steps: tuple[Step, ...] = eqx.field(default=(), converter=as_tuple)
    constraints: tuple[Constraint, ...] = eqx.field(default=(), converter=as_tuple)
    shear: bool = eqx.field(default=False, static=True)
    anisotropy: Scalar = real("anisotropy [1]", default=None)

    def __check_init__(self):
        if self.rule not in ("spectral", "trapezoid"):
            raise ValueError(f"`rule` must be 'spectral' or 'trapezoid', but is {self.rule!r}.")
        self._check_nodes()
        for name, kind in (("steps", Step), ("constraints", Constraint)):
            members = getattr(self, name)
            if not isinstance(members, tuple) or not all(isinstance(m, kind) for m in members):
                raise ValueError(f"`{name}` must be a list of {kind.__name__}, but is {members!r}.")
        if not self.rotary_inertia and (self.shear or self.rule == "trapezoid"):
            raise ValueError(
                "With shear, and in the trapezoidal rule, slopes are coordinates, which have no inertia "
                "without `rotary_inertia`; keep it."
            )
        for section in self._each:
            section.check(self.shear)
        check_ratio(self.anisotropy)
        if self.rule == "trapezoid" and (self.steps or self.shear or self._held_inside):
            raise ValueError(
                "The trapezoidal rule is for a uniform shaft without shear, with constraints at its ends "
                'only; take rule="spectral".'
            )

    def _check_nodes(self) -> None:
        nodes, spectral = self.nodes, self.rule == "spectral"
        if nodes == "auto":
            return
        if isinstance(nodes, bool) or not isinstance(nodes, int):
            raise ValueError(f'`nodes` must be a whole number or "auto", but is {nodes!r}.')
        least = 2 if spectral else 1
        if nodes < least or (spectral and nodes > 24):
            raise ValueError(
                f"`nodes` must be {least} to 24 (any number from 1 for the trapezoidal rule), but is "
                f"{nodes}; more accuracy on a long shaft comes from more spans."
            )

    @property
    def rigidity(self) -> Scalar:
        """Bending stiffness `EI` [N m^2] at the start of the shaft."""
        return self._first.rigidity

    @property
    def mass_per_length(self) -> Scalar:
        """`rho A` [kg/m] at the start of the shaft."""
        return self._first.mass_per_length

    @property
    def _first(self) -> Section:
        return Section(self.diameter, self.inner_diameter, self.material)

    @property
    def _each(self) -> list[Section]:
        return [self._first, *(step.section(self.material) for step in self.steps)]

    @property
    def _sections(self) -> Section:
        """All sections as one, whose numbers have a leading axis."""
        return stacked(self._each, self.shear)

    @property
    def _held_inside(self) -> bool:
        """Whether a constraint is known to be between the ends of the shaft."""
        held = [one.at for one in self.constraints if known(one.at) and known(self.length)]
        ends = (0.0, 1.0)
        return any(min(abs(at / self.length - end) for end in ends) > 1e-12 for at in held)

    @property
    def _slope_held(self) -> bool:
        return any(one.slope for one in self.constraints)

    # --- stations

    @property
    def stations(self) -> tuple[Scalar, ...]:
        return tuple(own.at for own in (*self.constraints, *self.steps))

    @property
    def rigid_motions(self) -> list[Motion]:
        return motions_left(self.constraints)

    def reason_against(self, at: float) -> str | None:
        return off_shaft(self, at)

    def seen(self, points: int) -> Float[Array, " x"]:
        return jnp.linspace(0.0, self.length, points)

    def spans(self, stations: tuple[float, ...]) -> tuple[int, ...]:
        length, own = float(self.length), len(self.stations)
        # Closer stations count as one: a shorter span loses more digits than the break would gain.
        shortest = 0.002 * length
        held = len(self.constraints)
        first = last = -1
        inner: list[int] = []
        for number, at in enumerate(stations):
            constraint = number < held
            if at <= 1e-12 * length or at >= (1 - 1e-12) * length:
                if held <= number < own:
                    raise ValueError(f"A step at {at:g} m is at an end of the shaft; leave it out.")
                if constraint and at > length / 2:
                    last = _only(number, last, at)
                elif constraint:
                    first = _only(number, first, at)
                continue
            near = [k for k in inner if abs(stations[k] - at) < shortest]
            near += [-1] * (min(at, length - at) < shortest)
            coincident = all(k >= 0 and abs(stations[k] - at) <= 1e-12 * length for k in near)
            if number < own and near and not (coincident and not constraint):
                raise ValueError(
                    f"The constraint or step at {at:g} m is nearer than {shortest:.2g} m to another one "
                    f"or to an end of the shaft, which is {length:g} m long; move one of them."
                )
            if not near and self.rule == "spectral":
                inner.append(number)
        steps = [stations[k] for k in range(held, own)]
        if sorted(steps) != steps:
            raise ValueError(f"`steps` must be in the order of their stations, but are at {steps}.")
        if twice := [at for at, after in itertools.pairwise(steps) if after - at < 1e-12 * length]:
            raise ValueError(
                f"Two steps are at {twice[0]:g} m, so the first has no length; leave out one of them."
            )
        return (first, *sorted(inner, key=stations.__getitem__), last)

    def resolution(
        self, stations: tuple[float, ...], spans: tuple[int, ...], held: int, modes: int = 2
    ) -> tuple[int, ...]:
        if self.nodes != "auto":
            bending = self.rule == "spectral" and not self.shear
            if self.nodes == 2 and len(spans) == 2 and bending and not self._slope_held:
                raise ValueError(
                    "`nodes` must be at least 3 for a shaft of one span whose slope no constraint holds, "
                    "but is 2."
                )
            return (self.nodes,) * (len(spans) - 1)
        if self.rule == "trapezoid" or not all(map(known, jax.tree.leaves(self))):
            return (NODES,) * (len(spans) - 1)
        held += sum(one.displacement + one.slope for one in self.constraints)
        slowness = np.array([jax.tree.map(np.asarray, one).slowness for one in self._each])
        starts = np.array([float(step.at) for step in self.steps])
        ends = np.array([0.0, *(stations[k] for k in spans[1:-1]), float(self.length)])
        waves = slowness[_section_of_span(ends, starts)] * np.diff(ends)
        return nodes_needed(waves, held, self.shear, modes)

    def attached(
        self, stations: tuple[float, ...], turned: tuple[bool, ...], resolution: tuple[int, ...]
    ) -> Attached:
        loads: list[tuple[int, bool]] = []
        for couple in (False, True):
            apart: list[float] = []
            for number, turns in enumerate(turned, len(self.stations)):
                at = stations[number]
                near = any(abs(at - one) <= 1e-9 * float(self.length) for one in apart)
                if not near and (turns or not couple):
                    apart.append(at)
                    loads.append((number, couple))
        coordinates = sum(resolution) * (2 if self.shear else 1) + (not self.shear) * len(
            resolution
        )
        worth = MODES + len(loads) < WORTH * coordinates
        return tuple(loads) if worth and self.nodes == "auto" else ()

    def line(
        self,
        stations: tuple[Scalar, ...],
        spans: tuple[int, ...],
        resolution: tuple[int, ...],
        attached: Attached,
    ) -> AbstractLine:
        ends = self._ends(stations, spans)
        held, free = self._held(spans)
        if self.shear:
            sections, own = self._sections, self._section_of_span(ends)
            line = ShearLine(
                bending=sections.rigidity[own],
                shear=sections.shear_stiffness[own],
                ends=ends,
                degrees=resolution,
                held=held,
                anisotropy=self.anisotropy,
            )
            return self._condensed(line, stations, attached)
        kernel = self._beam
        if held[0] != (True, True) or any(any(one) for one in held[1:]):
            holds = [(k, sloped) for k, one in enumerate(held) for sloped in (0, 1) if one[sloped]]
            holds += [(k, 0) for k in free]
            at = jnp.stack([ends[k] for k, _ in holds])
            sloped = tuple(bool(sloped) for _, sloped in holds)
            kernel = HeldKernel(kernel, self.length, at, sloped, len(free))
        common: dict[str, Any] = {"held": held, "free": free, "anisotropy": self.anisotropy}
        if self.rule == "trapezoid":
            (cells,) = resolution
            return TrapezoidLine(kernel=kernel, length=self.length, cells=cells, **common)
        line = SpectralLine(kernel=kernel, ends=ends, degrees=resolution, **common)
        return self._condensed(line, stations, attached)

    def _condensed(
        self,
        line: AbstractSpectralLine,
        stations: tuple[Scalar, ...],
        attached: Attached,
    ) -> AbstractLine:
        if not attached:
            return line
        sections, own = self._sections, self._section_of_span(line.breaks)
        inertia = line.work_along(sections.mass_per_length[own], 0)
        if self.rotary_inertia:
            inertia = inertia + line.work_along(sections.rotary_inertia[own], 1)
        forces, couples = (
            [jnp.asarray(stations[k], float) for k, couple in attached if couple == turns]
            for turns in (False, True)
        )
        return CondensedLine.of(line, inertia, forces, couples)

    def _ends(
        self, stations: tuple[Scalar, ...] | tuple[float, ...], spans: tuple[int, ...]
    ) -> Float[Array, " ends"]:
        """Ends of the spans [m]."""
        inner = [jnp.asarray(stations[k], float) for k in spans[1:-1]]
        return jnp.stack([jnp.zeros_like(self.length), *inner, self.length])

    def _held(self, spans: tuple[int, ...]) -> tuple[Held, tuple[int, ...]]:
        """Whether displacement and slope are held at every end of the spans; auxiliary constraints."""
        own = self.constraints
        held = tuple(
            (own[k].displacement, own[k].slope) if 0 <= k < len(own) else (False, False)
            for k in spans
        )
        pins, slopes = sum(one[0] for one in held), sum(one[1] for one in held)
        if pins >= 2 or (pins and slopes):
            free = ()
        elif pins:
            free = (-1,) if held[0][0] else (0,)
        else:
            free = (0,) if slopes else (0, -1)
        return held, free

    # --- equations

    def blocks(self, line: AbstractLine) -> Blocks:
        sections, own = self._sections, self._section_of_span(line.breaks)
        mass = sections.mass_per_length[own]
        inertia = line.forces_along(mass)
        gyroscopic = None
        if self.rotary_inertia:
            couples = line.couples_along(sections.rotary_inertia[own])
            inertia = inertia + couples
            gyroscopic = self.polar_ratio * couples
        return Blocks(
            inertia=inertia,
            gyroscopic=gyroscopic,
            stiffness=line.stiffness,
            rotating_stiffness=line.rotating_stiffness,
            weight=line.load_along(mass),
            polar=self._polar,
        )

    def influence(self) -> Influence | None:
        shear = None
        if self.shear:
            shear = 1 / self._sections.shear_stiffness
        beam = eqx.tree_at(lambda b: b.shear, self._beam, shear, is_leaf=lambda leaf: leaf is None)
        return Influence.of(beam, self.constraints, self.length)

    @property
    def _beam(self) -> CantileverKernel:
        return CantileverKernel(self._starts, 1 / self._sections.rigidity)

    @property
    def _polar(self) -> Scalar:
        """Moment of inertia about the axis [kg m^2]."""
        lengths = jnp.diff(self._starts, append=self.length)
        return self.polar_ratio * jnp.sum(self._sections.rotary_inertia * lengths)

    @property
    def _starts(self) -> Float[Array, " sections"]:
        """Starts of all sections [m]."""
        return column([jnp.zeros_like(self.length), *(step.at for step in self.steps)])

    def _section_of_span(self, ends: Float[Array, " ends"]) -> Any:
        """Index of the section of every span."""
        return _section_of_span(ends, self._starts[1:])


def _section_of_span(ends: Any, starts: Any) -> Any:
    """Index of the section of every span: (spans,), or (1,) if there are no steps."""
    if not starts.size:
        return np.zeros(1, int)
    middles = (ends[:-1] + ends[1:]) / 2
    return (middles[:, None] > starts).sum(1)


def _only(number: int, taken: int, at: float) -> int:
    """The number of the constraint at an end of the shaft; raises if there is another (`taken`)."""
    if taken >= 0:
        raise ValueError(
            f"Two constraints are at {at:g} m; give one, as a clamp holds displacement and slope."
        )
    return number
