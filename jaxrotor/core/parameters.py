"""Parameters: paths to the numbers of a tree of modules, such as `spin.speed` and `limiters.0.gap`.

A tree has parts, called by their names, and a tuple of members, called by their `kind` where there is
one of a kind, else by their `plural`, with a number for one of them and without for all.
"""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np

from .doubt import Known
from .quantities import known, quantity_units, taken_for, unit_of, value_of, with_values


Address = tuple[Any, ...]  # attribute names and tuple indices from the tree to a leaf
Addresses = Mapping[str, list[Address]]  # by path; several where a path stands for all of a kind


def addresses(tree: eqx.Module, parts: Iterable[str], members: str) -> Addresses:
    """Addresses of all parameters of a tree, by their paths.

    Args:
        tree: module with the parts and the members.
        parts: names of the fields that hold a part.
        members: name of the field that holds the tuple of members.
    """
    return _addresses(jax.tree.structure(tree), tuple(parts), members)


@functools.lru_cache(64)  # commands ask for each of hundreds of parameters
def _addresses(structure: Any, parts: tuple[str, ...], members: str) -> Addresses:
    tree = jax.tree.unflatten(structure, range(structure.num_leaves))
    table: dict[str, list[Address]] = {}
    for part in parts:
        for leaf in _quantities(getattr(tree, part)):
            table[_path(part, *leaf)] = [(part, *leaf)]
    all_members = getattr(tree, members)
    for kind in dict.fromkeys(member.kind for member in all_members):
        alike = [i for i, member in enumerate(all_members) if member.kind == kind]
        group = kind if len(alike) == 1 else all_members[alike[0]].plural
        for number, i in enumerate(alike):
            for leaf in _quantities(all_members[i]):
                address = (members, i, *leaf)
                table.setdefault(_path(group, *leaf), []).append(address)
                if len(alike) > 1:
                    table[_path(group, number, *leaf)] = [address]
    return table


def aliases(path: str, members: Iterable[Any], first: str | None = None) -> list[str]:
    """Other spellings of a path: with the singular or plural of its kind, and without the index 0.

    `shafts.hp.length` is that of a member with this name and a `body`, or of the `first` shaft.
    """
    head, _, rest = path.partition(".")
    if head == "shafts":
        name, _, leaf = rest.partition(".")
        bodies = [one for one in members if hasattr(one, "body")]
        groups = [f"{one.plural}.{i}" for i, one in enumerate(bodies) if one.name == name]
        if len(bodies) == 1:
            groups = [one.kind for one in bodies if one.name == name]
        own = [f"{group}.{part}" for group in groups for part in (leaf, f"body.{leaf}")]
        return [f"shaft.{leaf}"] if name == first else own
    names = {m.kind: m.plural for m in members} | {m.plural: m.kind for m in members}
    if head not in names:
        return []
    found = [f"{names[head]}.{rest}"]
    index, _, leaf = rest.partition(".")
    if index == "0":
        found += [f"{head}.{leaf}", f"{names[head]}.{leaf}"]
    return found


def stations_of_paths(at: Any, get: Callable[[str], Any]) -> Any:
    """Stations, one or several, where paths such as `discs.1.at` are replaced by their values."""
    of = lambda one: get(one) if isinstance(one, str) and one.endswith(".at") else one
    return type(at)(map(of, at)) if isinstance(at, list | tuple) else of(at)


def follow(tree: Any, address: Sequence[Any]) -> Any:
    """The leaf or module of a tree at an address."""
    for step in address:
        tree = tree[step] if isinstance(step, int) else getattr(tree, step)
    return tree


def given_or_taken(tree: Any, table: Iterable[Address]) -> tuple[list[Any], str]:
    """Values at addresses, and the formula by which those are taken that are not given, else ""."""
    owners = [(follow(tree, address[:-1]), address[-1]) for address in table]
    taken = [taken_for(*owner) for owner in owners]
    formula = next((one.formula for one in taken if one is not None), "")
    given = any(getattr(*owner) is not None for owner in owners)
    values = [value_of(*owner) for owner in owners]
    return values, f"{formula} where not given" if formula and given else formula


def with_leaves(tree: Any, leaves: Mapping[Address, Any]) -> Any:
    """The tree with other leaves at addresses, without checks.

    Modules on the way that have static flags derived from their values compute these anew, by their
    method `refreshed`.
    """
    if () in leaves:
        return leaves[()]
    by_step: dict[Any, dict[Address, Any]] = {}
    for (step, *rest), leaf in leaves.items():
        by_step.setdefault(step, {})[tuple(rest)] = leaf
    if isinstance(tree, tuple):
        return tuple(
            with_leaves(one, by_step[i]) if i in by_step else one for i, one in enumerate(tree)
        )
    others = {name: with_leaves(getattr(tree, name), by_step[name]) for name in by_step}
    changed = with_values(tree, **others)
    return changed.refreshed() if hasattr(changed, "refreshed") else changed


def known_values(tree: eqx.Module, table: Addresses) -> dict[str, Known]:
    """Every number with its unit by its own path; none while any leaf is traced."""
    found: dict[str, Known] = {}
    if not all(map(known, jax.tree.leaves(tree))):
        return found
    for path, (address, *more) in table.items():
        leaf = follow(tree, address)
        if more or leaf is None:
            continue
        unit = quantity_units(follow(tree, address[:-1]))[address[-1]]
        least, *_, largest = sorted([*(numbers := np.ravel(leaf)), *numbers], key=abs)
        found[path] = Known(float(largest), unit, float(least))
    return found


def _path(*steps: Any) -> str:
    return ".".join(map(str, steps))


def _quantities(module: eqx.Module) -> list[Address]:
    """Addresses of the quantities of a module and of the modules in it."""
    found: list[Address] = []
    for name, is_quantity in _fields(type(module)):
        if is_quantity:
            found.append((name,))
            continue
        value = getattr(module, name)
        if isinstance(value, eqx.Module):
            found += [(name, *rest) for rest in _quantities(value)]
        elif isinstance(value, tuple):
            parts = [(i, part) for i, part in enumerate(value) if isinstance(part, eqx.Module)]
            found += [(name, i, *rest) for i, part in parts for rest in _quantities(part)]
    return found


@functools.cache
def _fields(kind: type[eqx.Module]) -> tuple[tuple[str, bool], ...]:
    """Names of the fields of a class, each with whether it is a quantity."""
    return tuple((field.name, unit_of(field) is not None) for field in dataclasses.fields(kind))
