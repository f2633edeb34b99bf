"""Scene: a shaft, what sits on it, and how it spins."""

import dataclasses
import functools
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from .core.checks import suggest
from .core.plausibility import warn_implausible
from .core.quantities import known, quantity_units, unit_of, with_values
from .core.representation import number_text
from .core.tables import notebook_table
from .effects.base import AbstractContact, AbstractEffect
from .shafts.line import AbstractLine, AbstractShaft
from .spins.base import AbstractSpin
from .spins.constant import constant


Address = tuple[Any, ...]  # attribute names and tuple indices from the scene to a leaf


class Scene(eqx.Module):
    """What is simulated, and nothing else: `Scene(shaft, *effects, spin=ConstantSpeed(300.0))`.

    SI units; every number is a leaf to differentiate or map over. A list of effects, such as
    `Limiter.at_angles` makes, stands for its members. The stations where the elastic
    line may have a kink are ordered once, when the scene is built. `assumption` names what is not
    known of it, such as a layout: data sets, tables and pictures of every result say it.
    """

    shaft: AbstractShaft
    effects: tuple[AbstractEffect, ...]
    spin: AbstractSpin
    spans: tuple[int, ...] = eqx.field(static=True)
    resolution: tuple[int, ...] = eqx.field(static=True)  # nodes of every span
    assumption: str = eqx.field(static=True)

    def __init__(
        self,
        shaft: AbstractShaft,
        *effects: AbstractEffect | Sequence[AbstractEffect],
        spin: AbstractSpin,
        assumption: str = "",
    ):
        _check_kind(shaft, AbstractShaft, "The first argument of a scene", "a shaft")
        lists: Any = (one if isinstance(one, list | tuple) else (one,) for one in effects)
        members: tuple[AbstractEffect, ...] = tuple(itertools.chain.from_iterable(lists))
        for effect in members:
            _check_kind(effect, AbstractEffect, "Each effect of a scene", "an effect")
        _check_kind(spin, AbstractSpin, "`spin`", "a spin such as ConstantSpeed(300.0)")
        self.shaft, self.effects, self.spin, self.assumption = shaft, members, spin, assumption
        stations = _known_stations(shaft, members)
        if stations is None:
            raise ValueError(
                "A scene must be built from known stations and length; build it outside jax.jit or "
                "jax.grad and give it traced values with `scene.replace`."
            )
        self.spans = _spans(shaft, members, stations)
        self.resolution = shaft.resolution(stations, self.spans, _held(members))
        warn_implausible(_known_values(self))

    def line(self) -> AbstractLine:
        """The elastic line of the shaft."""
        return self.shaft.line(_stations(self.shaft, self.effects), self.spans, self.resolution)

    def stations(self, at: Any = None) -> Float[Array, " s"]:
        """Stations [m] to observe: those given, each on the shaft, or one the scene suggests.

        That is the station of its first contact, else of its first effect that has one, else the
        end of the shaft.
        """
        if at is None:
            placed = (*self.of(AbstractContact), *self.effects)
            first = (at for at in map(_station, placed) if at is not None)
            return jnp.atleast_1d(next(first, self.shaft.length))
        stations = jnp.atleast_1d(jnp.asarray(at, float))
        if stations.ndim > 1 or not stations.size:
            raise ValueError(f"`at [m]` must be a station or a list of them, but is {at!r}.")
        if known(stations) and known(self.shaft.length):
            length = float(self.shaft.length)
            off = [x for x in stations.tolist() if not 0 <= x <= length * (1 + 1e-12)]
            if off:
                raise ValueError(
                    f"`at [m]` must be on the shaft (0 to {length:g}), but is {off[0]:g}."
                )
            for x in stations.tolist():
                reason = self.shaft.reason_against(x)
                if reason is not None:
                    raise ValueError(f"`at [m]` = {x:g} m {reason}.")
        return stations

    def at_speed(self, speed: ArrayLike) -> "Scene":
        """Scene that turns at a constant speed [rad/s], whatever its spin."""
        return eqx.tree_at(lambda scene: scene.spin, self, constant(speed))

    def with_nodes(self, nodes: int | str, rule: str | None = None) -> "Scene":
        """Scene whose shaft is computed with other `nodes`, and by another `rule`.

        `scene.replace({"shaft.nodes": 12})` is the same, beside other values.
        """
        if not hasattr(self.shaft, "nodes"):
            raise ValueError(f"A {type(self.shaft).__name__} has no nodes; a FlexibleShaft has.")
        other: dict[str, Any] = {"nodes": nodes} | ({} if rule is None else {"rule": rule})
        shaft = dataclasses.replace(self.shaft, **other)
        return Scene(shaft, *self.effects, spin=self.spin, assumption=self.assumption)

    def of(self, kind: type) -> tuple:
        """The effects that have a capability or are of a class."""
        return tuple(effect for effect in self.effects if isinstance(effect, kind))

    def name_of(self, effect: AbstractEffect) -> str:
        """How parameter paths call an effect of the scene: `support`, or `supports.1` of several."""
        alike = [other for other in self.effects if other.kind == effect.kind]
        if len(alike) == 1:
            return effect.kind
        return f"{effect.plural}.{next(i for i, other in enumerate(alike) if other is effect)}"

    def of_parts(self, *effects: AbstractEffect) -> "Scene":
        """The scene with these effects in place of its own."""
        return Scene(self.shaft, *effects, spin=self.spin, assumption=self.assumption)

    def without(self, kind: str) -> "Scene":
        """The scene less every effect of a kind: `scene.without("limiters")`."""
        rest = [e for e in self.effects if kind not in (e.kind, e.plural)]
        if len(rest) == len(self.effects):
            kinds = sorted({e.plural for e in self.effects})
            raise ValueError(
                f"The scene has no {kind!r}{suggest(kind, kinds)}; it has: {', '.join(kinds)}."
            )
        return self.of_parts(*rest)

    def where(self, name: str) -> str:
        """`constraints.0 at 93 mm`: a constraint or an effect as reactions call it, and its station."""
        table = _addresses(self)
        for path in (f"shaft.{name}.at", f"{name}.at"):
            if path in table:
                return f"{name} at {1e3 * float(_follow(self, table[path][0])):.6g} mm"
        return name

    def __repr__(self) -> str:
        parts = [repr(part) for part in (self.shaft, *self.effects)] + [f"spin={self.spin!r}"]
        parts += [f"assumption={self.assumption!r}"] * bool(self.assumption)
        return "\n".join(["Scene(", *(f"    {part}," for part in parts), ")"])

    def __str__(self) -> str:
        """Every parameter with its value and unit, those of several effects one after the other."""
        lines = [type(self.shaft).__name__ + ", " + type(self.spin).__name__]
        lines[0] += f" ({self.assumption})" if self.assumption else ""
        for path in self.paths():
            leaves = self.leaves(path)
            if any(leaf is not None for leaf in leaves):
                values, unit = ", ".join(map(_text, leaves)), self.unit(path)
                lines.append(f"  {path} = {values}" + ("" if unit == "1" else f" {unit}"))
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        head = f"{type(self.shaft).__name__}, {type(self.spin).__name__}"
        head += f" ({self.assumption})" if self.assumption else ""
        rows = [
            (path, ", ".join(map(_text, leaves)), self.unit(path))
            for path, leaves in ((path, self.leaves(path)) for path in self.paths())
            if any(leaf is not None for leaf in leaves)
        ]
        return notebook_table(head, ("parameter", "value", "unit"), rows, most=len(rows))

    def paths(self) -> list[str]:
        """Paths of all parameters: of the shaft, the spin, and each kind of effect."""
        return [path for path in _addresses(self) if not path.split(".")[1].isdigit()]

    def get(self, path: str) -> Array:
        """Value at a path; of several effects, their values in order."""
        leaves = [leaf for leaf in self.leaves(path) if leaf is not None]
        if len(leaves) < len(self._find(path)):
            raise ValueError(f"`{path}` is absent from this scene (None).")
        return leaves[0] if len(leaves) == 1 else jnp.stack(leaves)

    def leaves(self, path: str) -> list[Array | None]:
        """Values at a path, one of each effect; None where it is absent."""
        return [_follow(self, address) for address in self._find(path)]

    def unit(self, path: str) -> str:
        """Unit of the parameter at a path."""
        *parents, name = self._find(path)[0]
        return quantity_units(_follow(self, parents))[name]

    def replace(self, values: Mapping[str, Any]) -> "Scene":
        """Scene with other values: `scene.replace({"unbalance.eccentricity": 1e-3})`.

        `limiters.gap` sets all of a kind, `limiters.0.gap` one; a table such as `spin.times` is set
        as a whole. `shaft.nodes` is replaced too, by a number or "auto". Values may be traced; then the
        spans of the shaft and the nodes of each stay as they are.
        """
        if "shaft.nodes" in values:
            others = {path: value for path, value in values.items() if path != "shaft.nodes"}
            return self.with_nodes(values["shaft.nodes"]).replace(others)
        checked = {}
        for path, value in values.items():
            *parents, name = self._find(path)[0]
            fields = {f.name: f for f in dataclasses.fields(_follow(self, parents))}
            try:
                checked[path] = fields[name].metadata["converter"](value)
            except ValueError as error:
                raise ValueError(f"{path}: {error}") from None
        scene = self.put(checked)
        for path in checked:
            for address in self._find(path):
                for depth in range(1, len(address)):
                    _check_together(_follow(scene, address[:depth]), path)
        stations = _known_stations(scene.shaft, scene.effects)
        if stations is None:
            return scene
        if _spans(scene.shaft, scene.effects, stations) != self.spans or _by_need(scene.shaft):
            return scene.of_parts(*scene.effects)
        warn_implausible(_known_values(scene))
        return scene

    def put(self, values: Mapping[str, Any]) -> "Scene":
        """Scene with other leaves, as they are: no checks, the spans kept. See `replace`.

        What a part noted of its values when it was built, as a `Support` that its axes are equal, is
        noted anew.
        """
        leaves = {address: leaf for path, leaf in values.items() for address in self._find(path)}
        return _with(self, leaves)

    def _find(self, path: str) -> list[Address]:
        table = _addresses(self)
        for alias in (path, *_aliases(path, self.effects)):
            if alias in table:
                return table[alias]
        head = path.partition(".")[0]
        alike = [p for p in self.paths() if p.partition(".")[0] == head] or self.paths()
        raise ValueError(
            f"The scene has no parameter `{path}`{suggest(path, table)}; it has: {', '.join(alike)}."
        )


def _check_kind(value: Any, kind: type, what: str, wanted: str) -> None:
    if not isinstance(value, kind):
        raise ValueError(f"{what} must be {wanted}, but is {value!r}.")


def _check_together(module: Any, path: str) -> None:
    """What binds the fields of a module to each other, checked as when it is built."""
    try:
        getattr(module, "__check_init__", tuple)()
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _text(leaf: Any) -> str:
    return "-" if leaf is None else number_text(leaf)


def _with(part: Any, leaves: Mapping[Address, Any]) -> Any:
    """The scene, or a part of it, with other leaves at addresses, and what parts note noted anew."""
    if () in leaves:
        return leaves[()]
    within: dict[Any, dict[Address, Any]] = {}
    for (step, *rest), leaf in leaves.items():
        within.setdefault(step, {})[tuple(rest)] = leaf
    if isinstance(part, tuple):
        return tuple(_with(one, within[i]) if i in within else one for i, one in enumerate(part))
    others = {name: _with(getattr(part, name), within[name]) for name in within}
    changed = with_values(part, **others)
    return changed.noted() if hasattr(changed, "noted") else changed


# === stations


def _station(effect: AbstractEffect) -> Any:
    """Station [m] of an effect, None for one that has no place."""
    return getattr(effect, "at", None)


def _stations(shaft, effects) -> tuple[Any, ...]:
    """Stations of the shaft's own, then of every effect that has one."""
    return (*shaft.stations, *(at for at in map(_station, effects) if at is not None))


def _known_stations(shaft, effects) -> tuple[float, ...] | None:
    """All stations, or None while any is traced."""
    stations = _stations(shaft, effects)
    if not all(known(at) for at in (shaft.length, *stations)):
        return None
    return tuple(float(at) for at in stations)


def _spans(shaft, effects, stations: tuple[float, ...]) -> tuple[int, ...]:
    """Stations between which the elastic line is smooth."""
    owners = [effect.kind for effect in effects if _station(effect) is not None]
    owners = ["constraint or step"] * len(shaft.stations) + owners
    for owner, at in zip(owners, stations, strict=True):
        reason = shaft.reason_against(at)
        if reason is not None:
            raise ValueError(f"The {owner} at {at:g} m {reason}.")
    return shaft.spans(stations)


def check_fixed_nodes(scene: Scene, path: str) -> None:
    """Refuse to vary what decides the nodes of a shaft: one program serves all values."""
    decides = path.startswith("shaft.") or path.endswith(".at")
    if decides and getattr(scene.shaft, "nodes", None) == "auto":
        raise ValueError(
            f'The shaft\'s `nodes="auto"` follow `{path}`, which is varied here; give them a number, '
            'such as `scene.replace({"shaft.nodes": 8})`.'
        )


def _held(effects) -> int:
    """Number of stations at which effects hold the shaft, always or while in contact."""
    return len({float(effect.at) for effect in effects if effect.holds_shaft})


def _by_need(shaft) -> bool:
    """Whether the nodes of its spans follow from values, all of them known."""
    return getattr(shaft, "nodes", None) == "auto" and all(map(known, jax.tree.leaves(shaft)))


# === parameter paths


def _leaves(module: eqx.Module) -> list[Address]:
    """Addresses of the quantities of a module and of the modules in it."""
    found: list[Address] = []
    for name, is_quantity in _fields(type(module)):
        if is_quantity:
            found.append((name,))
            continue
        value = getattr(module, name)
        if isinstance(value, eqx.Module):
            found += [(name, *rest) for rest in _leaves(value)]
        elif isinstance(value, tuple):
            parts = [(i, part) for i, part in enumerate(value) if isinstance(part, eqx.Module)]
            found += [(name, i, *rest) for i, part in parts for rest in _leaves(part)]
    return found


@functools.cache
def _fields(kind: type[eqx.Module]) -> tuple[tuple[str, bool], ...]:
    """Names of the fields of a class, each with whether it is a quantity."""
    return tuple((field.name, unit_of(field) is not None) for field in dataclasses.fields(kind))


def _addresses(scene: Scene) -> dict[str, list[Address]]:
    table: dict[str, list[Address]] = {}
    for part in ("shaft", "spin"):
        for leaf in _leaves(getattr(scene, part)):
            table[".".join(map(str, (part, *leaf)))] = [(part, *leaf)]
    for kind in dict.fromkeys(effect.kind for effect in scene.effects):
        members = [i for i, effect in enumerate(scene.effects) if effect.kind == kind]
        plural = scene.effects[members[0]].plural
        group = kind if len(members) == 1 else plural
        for number, i in enumerate(members):
            for leaf in _leaves(scene.effects[i]):
                address = ("effects", i, *leaf)
                table.setdefault(".".join(map(str, (group, *leaf))), []).append(address)
                if len(members) > 1:
                    table[".".join(map(str, (group, number, *leaf)))] = [address]
    return table


def _known_values(scene: Scene) -> dict[str, tuple[float, str]]:
    """Value, of a table the largest, and unit of every number by its own path; {} while any is traced."""
    found = {}
    if not all(map(known, jax.tree.leaves(scene))):
        return found
    for path, (address, *more) in _addresses(scene).items():
        leaf = _follow(scene, address)
        if more or leaf is None:
            continue
        unit = quantity_units(_follow(scene, address[:-1]))[address[-1]]
        found[path] = float(max(np.ravel(leaf), key=abs)), unit
    return found


def _aliases(path: str, effects: Sequence[AbstractEffect]) -> list[str]:
    """The same path by the singular or plural of its kind, and less an index of 0."""
    head, _, rest = path.partition(".")
    names = {e.kind: e.plural for e in effects} | {e.plural: e.kind for e in effects}
    if head not in names:
        return []
    found = [f"{names[head]}.{rest}"]
    index, _, leaf = rest.partition(".")
    if index == "0":
        found += [f"{head}.{leaf}", f"{names[head]}.{leaf}"]
    return found


def _follow(tree: Any, address: Sequence[Any]) -> Any:
    for step in address:
        tree = tree[step] if isinstance(step, int) else getattr(tree, step)
    return tree
