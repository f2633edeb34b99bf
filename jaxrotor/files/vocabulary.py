"""Vocabulary of scene files: names of effects, shafts and spins, and their keys.

Effects are found by the `kind` and `plural` of their classes, those that `jaxrotor.effects` exports and
one's own, shafts and spins by their class names (`FlexibleShaft` is `model = "flexible"`). A new class
needs no line here.
"""

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import ModuleType
from typing import Any, NamedTuple

from .. import effects
from ..effects import AbstractEffect, Disc, Unbalance


TEXTS = ("title", "assumption")
START = {"radius": "m", "rate": "rad/s", "angle": "rad"}
COUNTS = {"settle": 0, "keep": 1, "steps_per_revolution": 1}  # smallest allowed count of each key
_NOUNS = ("Shaft", "Speed")  # endings of class names that are not part of the model name


class Form(NamedTuple):
    """Way to give a part by other keys than its own fields."""

    of: type
    noun: str
    marks: frozenset[str]  # any of these keys selects this way
    build: Callable
    units: Mapping[str, str]  # unit of each argument of `build`
    needed: tuple[str, ...]
    fields: tuple[str, ...] = ()  # fields of the part that may be given too


_OUT_OF_TRUE = ("offset", "offset_angle", "tilt", "tilt_axis", "exact")
FORMS = (
    Form(
        Disc,
        "disc given by its dimensions",
        frozenset({"diameter", "thickness", "density", "bore"}),
        Disc.from_dimensions,
        {"at": "m", "diameter": "m", "thickness": "m", "density": "kg/m^3", "bore": "m"},
        ("at", "diameter", "thickness"),
        _OUT_OF_TRUE,
    ),
    Form(
        Disc,
        "thin disc",
        frozenset({"radius"}),
        Disc.thin,
        {"at": "m", "mass": "kg", "radius": "m"},
        ("at", "mass", "radius"),
        _OUT_OF_TRUE,
    ),
    Form(
        Unbalance,
        "unbalance given by its grade",
        frozenset({"grade"}),
        Unbalance.from_grade,
        {"at": "m", "grade": "mm/s", "mass": "kg", "speed": "rad/s"},
        ("at", "grade", "mass", "speed"),
        ("phase",),
    ),
)


def exported() -> dict[str, Any]:
    """Classes of effects that `jaxrotor.effects` exports, by their kind."""
    return _by_kind(vars(effects).values())


def kinds() -> dict[str, Any]:
    """Classes of effects by their kind: those exported, and those of one's own, of one kind the last."""
    ours = exported()
    return ours | _by_kind(_below(AbstractEffect)) | ours


def _by_kind(values: Iterable[Any]) -> dict[str, Any]:
    """Classes of effects among some values that are not abstract, by their kind."""
    classes = [c for c in values if inspect.isclass(c) and issubclass(c, AbstractEffect)]
    named = [c for c in classes if hasattr(c, "kind") and not inspect.isabstract(c)]
    return {cls.kind: cls for cls in named}


def _below(cls: type) -> Iterator[type]:
    """Classes that inherit from one, at any number of removes."""
    for one in cls.__subclasses__():
        yield one
        yield from _below(one)


def models(module: ModuleType, base: type) -> dict[str, type]:
    """Classes of shafts or spins by model name: `FlexibleShaft` is "flexible"."""
    classes = [c for c in vars(module).values() if inspect.isclass(c) and issubclass(c, base)]
    words = {c: re.findall("[A-Z][a-z]*", c.__name__) for c in classes}
    own = {c: [w.lower() for w in found if w not in _NOUNS] for c, found in words.items()}
    return {"_".join(names): c for c, names in own.items() if "abstract" not in names}


_LINE = re.compile(r"\(at line (\d+),")
_HEAD = re.compile(r"\s*\[\[?\s*([\w.]+)\s*\]\]?.*")
_KEY = re.compile(r"\s*([\w.\"-]+?)\s*=.*")


def repeated(text: str, error: str) -> str:
    """Message for a table or key that is repeated; "" if `error` of tomllib is a different one."""
    found = _LINE.search(error)
    if found is None or not ("twice" in error or "overwrite" in error):
        return ""
    number = int(found[1])
    line = text.split("\n")[number - 1]
    if head := _HEAD.fullmatch(line):
        name = head[1]
        named = {name for cls in kinds().values() for name in (cls.kind, cls.plural)}
        if name in named:
            return f"has [{name}] a second time, at line {number}; write [[{name}]] for each of several."
        return f"has [{name}] a second time, at line {number}; it can have one, so join the two."
    if key := _KEY.fullmatch(line):
        return f"gives {key[1]} a second time, at line {number}; keep one of the two."
    return ""
