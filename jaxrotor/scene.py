"""Scene: a shaft, the effects on it, and its law of rotation."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from .core.checks import check_invariants, check_kind, suggest
from .core.doubt import Known
from .core.parameters import (
    Address,
    addresses,
    aliases,
    follow,
    given_or_taken,
    known_values,
    stations_of_paths,
    with_leaves,
)
from .core.plausibility import warn_implausible
from .core.quantities import known, quantity_units, with_values
from .core.representation import number_text
from .core.tables import notebook_table
from .effects.base import AbstractCasing, AbstractCoaxial, AbstractEffect
from .effects.layout import (
    Layout,
    Placed,
    check_shafts,
    check_simulated,
    coaxial_shafts,
    placed,
    seen_stations,
)
from .effects.places import check_casing, check_casings, names_beside
from .shafts.cased import CasedLine
from .shafts.coaxial import CoaxialLine
from .shafts.line import AbstractLine, AbstractShaft
from .spins.base import AbstractSpin
from .spins.constant import constant


class Scene(eqx.Module):
    """Model of a rotor: `Scene(shaft, *effects, spin=ConstantSpeed(300.0))`.

    Only the effects given are simulated. Units are SI, and every number is a leaf to differentiate or
    map over. The stations where the elastic line may have a kink are ordered once, when the scene is
    built.

    Args:
        shaft: model of the shaft.
        effects: what acts on or around the shaft; a list of effects, as `Limiter.at_angles` returns,
            stands for its members.
        spin: law of rotation.
        assumption: what of the rotor is assumed, such as a layout that is not known. Data sets, tables
            and figures of every result repeat it.

    Raises:
        ValueError: If a part is not of its kind, if a station is off the shaft or in conflict with
            another one, or if stations or the length are traced.
    """

    shaft: AbstractShaft
    effects: tuple[AbstractEffect, ...]
    spin: AbstractSpin
    layouts: tuple[Layout, ...] = eqx.field(static=True)  # of every shaft
    assumption: str = eqx.field(static=True)
    name: str | None = eqx.field(static=True, default=None)  # of the shaft, where there are several
    observed: str | None = eqx.field(static=True, default=None)  # shaft whose line `line` is
    in_time: bool = eqx.field(static=True, default=False)  # see `System.others`

    def __init__(
        self,
        shaft: AbstractShaft | Mapping[str, AbstractShaft | AbstractEffect],
        *effects: AbstractEffect | Sequence[AbstractEffect],
        spin: AbstractSpin,
        assumption: str = "",
        name: str | None = None,
    ):
        if isinstance(shaft, Mapping):
            (name, first), *others = shaft.items()
            effects = (*(with_values(one, name=k, shaft=k) for k, one in others), *effects)
        else:
            first = shaft
        first = cast(AbstractShaft, first)
        check_kind(first, AbstractShaft, "The first argument of a scene", "a shaft")
        lists: Any = (one if isinstance(one, list | tuple) else (one,) for one in effects)
        members: tuple[AbstractEffect, ...] = tuple(itertools.chain.from_iterable(lists))
        for effect in members:
            check_kind(effect, AbstractEffect, "Each effect of a scene", "an effect")
        check_kind(spin, AbstractSpin, "`spin`", "a spin such as ConstantSpeed(300.0)")
        self.shaft, self.effects, self.spin, self.assumption = first, members, spin, assumption
        self.name, self.observed, self.in_time = name, None, False
        check_shafts(members, name)
        check_casings(members, self.shafts)
        layouts = []
        for own in self.placed():
            if (stations := own.known_stations) is None:
                raise ValueError(
                    "A scene must be built from known stations and length; build it outside jax.jit or "
                    "jax.grad and give it traced values with `scene.replace`."
                )
            layouts.append(own.layout(stations))
        self.layouts = tuple(layouts)
        warn_implausible(self.known_values())

    @property
    def shafts(self) -> tuple[str, ...]:
        """Names of the shafts of a scene of several, the first one first; none of a scene of one."""
        beside = coaxial_shafts(self.effects)
        return (str(self.name), *(one.name for one in beside)) if beside else ()

    @property
    def spans(self) -> tuple[int, ...]:
        """Stations between which the elastic lines are smooth, see `AbstractShaft.spans`."""
        return sum((own.spans for own in self.layouts), ())

    @property
    def resolution(self) -> tuple[int, ...]:
        """Number of nodes of every span, shaft by shaft."""
        return sum((own.resolution for own in self.layouts), ())

    @property
    def condensed(self) -> bool:
        """Whether an elastic line is condensed, see `AbstractShaft.attached`."""
        return any(own.attached for own in self.layouts)

    def placed(self) -> list[Placed]:
        """Every shaft with the effects on it."""
        return placed(self.shaft, self.name, self.effects)

    def line(self) -> AbstractLine:
        """The elastic lines of the shafts, and the coordinates beside them if there are any."""
        every = self.placed()
        lines = [own.line(there) for own, there in zip(self.layouts, every, strict=True)]
        line = lines[0]
        if len(lines) > 1:
            starts = tuple(jnp.asarray(there.start) for there in every)
            line = CoaxialLine(
                lines=tuple(lines), starts=starts, names=self.shafts, anisotropy=line.anisotropy
            )
            line = line.of(self.observed or self.shafts[0])
        beside = names_beside(self.effects)
        return CasedLine(line=line, names=beside, anisotropy=line.anisotropy) if beside else line

    def stations(self, at: Any = None) -> Float[Array, " s"]:
        """Stations to observe [m].

        Args:
            at: station(s) [m] or their paths, `"discs.1.at"`; of several shafts `("hp", 0.3)`; by default
                that of the first contact, else of an effect that has one, else the end of the shaft.

        Returns:
            The stations, as an array.

        Raises:
            ValueError: If a station is not on the shaft, or nothing is known of the shaft there.
        """
        return self.seen(at)[0]

    def seen(self, at: Any = None) -> tuple[Float[Array, " s"], tuple[str | None, ...]]:
        """Stations [m] as of `stations`, and the name of the shaft of each; None: there is only one."""
        at = stations_of_paths(at, self.get)
        return seen_stations(self.placed(), self.shafts, self.effects, at)

    def to_simulate(self, at: Any = None, *, in_time: bool = True) -> tuple["Scene", Array]:
        """The scene as motions along times, or by revolutions, take it; stations on one shaft [m]."""
        stations, shafts = self.seen(at)
        if not self.shafts:
            return self, stations
        check_simulated(shafts, given=self.spin.given)
        return with_values(self, observed=shafts[0], in_time=in_time), stations

    def at_speed(self, speed: ArrayLike) -> "Scene":
        """Scene with a constant speed [rad/s] in place of its spin."""
        return eqx.tree_at(lambda scene: scene.spin, self, constant(speed))

    def with_nodes(self, nodes: int | str, rule: str | None = None) -> "Scene":
        """Scene whose shaft has another discretization.

        `scene.replace({"shaft.nodes": 12})` does the same, together with other values.

        Args:
            nodes: nodes per span, or "auto".
            rule: "spectral" or "trapezoid"; None leaves it as it is.

        Raises:
            ValueError: If the shaft has no nodes, or does not accept these.
        """
        if not hasattr(self.shaft, "nodes"):
            raise ValueError(
                f"A {type(self.shaft).__name__} has no nodes; only a FlexibleShaft has."
            )
        other: dict[str, Any] = {"nodes": nodes} | ({} if rule is None else {"rule": rule})
        effects = [
            dataclasses.replace(one, body=dataclasses.replace(one.body, **other))
            if isinstance(one, AbstractCoaxial) and hasattr(one.body, "nodes")
            else one
            for one in self.effects
        ]
        shaft = dataclasses.replace(self.shaft, **other)
        return with_values(self, shaft=shaft).of_parts(*effects)

    def of(self, kind: type) -> tuple:
        """Effects that are instances of a class: an effect, `Disc`, or a capability, `AbstractContact`."""
        return tuple(effect for effect in self.effects if isinstance(effect, kind))

    def casing(self, name: str) -> int:
        """Number of a casing by its name; its coordinate is this one of the last, in the same order.

        Raises:
            ValueError: If there is no such casing.
        """
        names = [casing.name for casing in self.of(AbstractCasing)]
        check_casing(name, names)
        return names.index(name)

    def name_of(self, effect: AbstractEffect) -> str:
        """Name of an effect in parameter paths: `support`, or `supports.1` if there are several."""
        alike = [other for other in self.effects if other.kind == effect.kind]
        if len(alike) == 1:
            return effect.kind
        return f"{effect.plural}.{next(i for i, other in enumerate(alike) if other is effect)}"

    def of_parts(self, *effects: AbstractEffect) -> "Scene":
        """Scene with the given effects in place of its own."""
        new = Scene(
            self.shaft, *effects, spin=self.spin, assumption=self.assumption, name=self.name
        )
        return with_values(new, observed=self.observed, in_time=self.in_time)

    def without(self, kind: str) -> "Scene":
        """Scene without the effects of a kind: `scene.without("limiters")`.

        Raises:
            ValueError: If there is no effect of the kind.
        """
        rest = [e for e in self.effects if kind not in (e.kind, e.plural)]
        if len(rest) == len(self.effects):
            kinds = sorted({e.plural for e in self.effects})
            raise ValueError(
                f"The scene has no {kind!r}{suggest(kind, kinds)}; it has: {', '.join(kinds)}."
            )
        return self.of_parts(*rest)

    def where(self, name: str) -> str:
        """Label of a constraint or an effect with its station: `constraints.0 at 93 mm`."""
        table = _addresses(self)
        for path in (f"shaft.{name}.at", f"{name}.at"):
            at = follow(self, table[path][0]) if path in table else None
            if at is not None:
                return f"{name} at {1e3 * float(at):.6g} mm"
        return name

    def __repr__(self) -> str:
        parts = [*map(repr, (self.shaft, *self.effects)), f"spin={self.spin!r}"]
        parts += [f"assumption={self.assumption!r}"] * bool(self.assumption)
        return "\n".join(["Scene(", *(f"    {part}," for part in parts), ")"])

    def __str__(self) -> str:
        """Text with every parameter, its value and unit; of several effects their values in a row."""
        unit_of = lambda unit: "" if unit == "1" else f" {unit}"
        lines = (f"  {path} = {text}{unit_of(unit)}" for path, text, unit in self._rows())
        return "\n".join([self._head(), *lines])

    def _repr_html_(self) -> str:
        rows = self._rows()
        return notebook_table(self._head(), ("parameter", "value", "unit"), rows, most=len(rows))

    def _head(self) -> str:
        head = f"{type(self.shaft).__name__}, {type(self.spin).__name__}"
        return head + (f" ({self.assumption})" if self.assumption else "")

    def _rows(self) -> list[tuple[str, str, str]]:
        """Paths of the parameters that are present, their values, and their units, with what was taken."""
        rows = []
        for path in self.paths():
            values, formula = self.values(path)
            if any(value is not None for value in values):
                unit = self.unit(path) + (f", = {formula}" if formula else "")
                texts = ("-" if value is None else number_text(value) for value in values)
                rows.append((path, ", ".join(texts), unit))
        return rows

    def paths(self) -> list[str]:
        """Paths of all parameters of the shaft, of the spin, and of each kind of effect."""
        return [path for path in _addresses(self) if not path.split(".")[1].isdigit()]

    def get(self, path: str) -> Array:
        """Value of the parameter at a path; of several effects their values, in order.

        Raises:
            ValueError: If there is no such parameter, or it is absent (None).
        """
        leaves = [leaf for leaf in self.leaves(path) if leaf is not None]
        if len(leaves) < len(self._find(path)):
            formula = self.values(path)[1].partition(" where ")[0]
            taken = f"; `{formula}` is taken for it" if formula else ""
            raise ValueError(f"`{path}` is absent from this scene (None){taken}.")
        if len({jnp.shape(leaf) for leaf in leaves}) > 1:
            raise ValueError(
                f"`{path}` has tables of different lengths; name one effect, as in `supports.0.kxx`."
            )
        return leaves[0] if len(leaves) == 1 else jnp.stack(leaves)

    def leaves(self, path: str) -> list[Array | None]:
        """Values of the parameter at a path, one per effect; None where it is absent."""
        return [follow(self, address) for address in self._find(path)]

    def values(self, path: str) -> tuple[list[Array | None], str]:
        """Values at a path, one per effect, given or taken, and how those are taken that are not given.

        `values("support.kyy")` of a support with `kxx` alone are its `kxx`, and "kxx". The text is empty
        where all values are given or absent.
        """
        return given_or_taken(self, self._find(path))

    def unit(self, path: str) -> str:
        """Unit of the parameter at a path; "1" for a dimensionless one."""
        *parents, name = self._find(path)[0]
        return quantity_units(follow(self, parents))[name]

    def replace(self, values: Mapping[str, Any]) -> "Scene":
        """Scene with other values: `scene.replace({"unbalance.eccentricity": 1e-3})`.

        Args:
            values: new values in SI by parameter path. `limiters.gap` sets all limiters, `limiters.0.gap`
                one; a table such as `spin.times` is replaced as a whole. `shaft.nodes` takes a number or
                "auto". Nodes that are "auto" are decided anew. Values may be traced; then the spans of
                the shaft and their nodes stay as they are.

        Returns:
            The scene, its values checked as when it was built.

        Raises:
            ValueError: If there is no such parameter, or a value is invalid.
        """
        if "shaft.nodes" in values:
            others = {path: value for path, value in values.items() if path != "shaft.nodes"}
            return self.with_nodes(values["shaft.nodes"]).replace(others)
        checked = {}
        for path, value in values.items():
            *parents, name = self._find(path)[0]
            fields = {f.name: f for f in dataclasses.fields(follow(self, parents))}
            try:
                checked[path] = fields[name].metadata["converter"](value)
            except ValueError as error:
                raise ValueError(f"{path}: {error}") from None
        scene = self.put(checked)
        for path in checked:
            for address in self._find(path):
                for depth in range(1, len(address)):
                    check_invariants(follow(scene, address[:depth]), path)
        every = scene.placed()
        stations = [one for own in every if (one := own.known_stations) is not None]
        if len(stations) < len(every):
            return scene
        pairs = zip(every, stations, self.layouts, strict=True)
        same = all(own.spans(there) == layout.spans for own, there, layout in pairs)
        chosen = getattr(scene.shaft, "nodes", None) == "auto"
        if not same or chosen and all(map(known, jax.tree.leaves(scene.shaft))):
            return scene.of_parts(*scene.effects)
        warn_implausible(scene.known_values())
        return scene

    def known_values(self) -> dict[str, Known]:
        """Every number with its unit by its own path; none while any is traced."""
        return known_values(self, _addresses(self))

    def put(self, values: Mapping[str, Any]) -> "Scene":
        """Scene with other leaves by parameter path, without checks and with the same spans.

        Static flags that parts derive from their values, such as whether a `Support` is isotropic, are
        computed anew. `replace` checks the values.
        """
        leaves = {address: leaf for path, leaf in values.items() for address in self._find(path)}
        scene = with_leaves(self, leaves)
        turned = lambda one: [own.turned for own in one.placed()]
        same = not self.condensed or turned(scene) == turned(self)
        return scene if same else scene.of_parts(*scene.effects)

    def _find(self, path: str) -> list[Address]:
        table = _addresses(self)
        for alias in (path, *aliases(path, self.effects, self.name)):
            if alias in table:
                return table[alias]
        head = path.partition(".")[0]
        alike = [p for p in self.paths() if p.partition(".")[0] == head] or self.paths()
        raise ValueError(
            f"The scene has no parameter `{path}`{suggest(path, table)}; it has: {', '.join(alike)}."
        )


def _addresses(scene: Scene) -> Mapping[str, list[Address]]:
    """Addresses of all parameters of a scene, by their paths."""
    return addresses(scene, ("shaft", "spin"), "effects")
