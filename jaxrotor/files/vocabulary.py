"""Vocabulary of scene files: what they call the classes of effects, shafts and spins, and their keys.

Effects are found by the `kind` and `plural` of the classes exported in `jaxrotor.effects`, shafts and
spins by their class names (`FlexibleShaft` is `model = "flexible"`): a new class needs no line here.
"""

import inspect
import re
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, NamedTuple

from .. import effects
from ..effects import AbstractEffect, Disc, Unbalance


TEXTS = ("title", "assumption")
START = {"radius": "m", "rate": "rad/s", "angle": "rad"}
COUNTS = {"settle": 0, "keep": 1, "steps_per_revolution": 1}  # whole numbers and their least
_NOUNS = ("Shaft", "Speed")  # what the classes of a model share, and its name leaves out


class Form(NamedTuple):
    """Another way to give a part than by its own fields."""

    of: type
    noun: str
    marks: frozenset[str]  # keys of which one says that a table is written this way
    build: Callable
    units: Mapping[str, str]  # of the arguments of `build`
    needed: tuple[str, ...]
    fields: tuple[str, ...] = ()  # of the part's own that may be given too


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


def kinds() -> dict[str, Any]:
    """Classes of effects by their kind: those exported in `jaxrotor.effects`."""
    classes = [c for c in vars(effects).values() if inspect.isclass(c)]
    named = [c for c in classes if issubclass(c, AbstractEffect) and hasattr(c, "kind")]
    return {cls.kind: cls for cls in named if not inspect.isabstract(cls)}


def models(module: ModuleType, base: type) -> dict[str, type]:
    """Classes of shafts or spins by model: `FlexibleShaft` is "flexible", `SpeedProfile` "profile"."""
    classes = [c for c in vars(module).values() if inspect.isclass(c) and issubclass(c, base)]
    words = {c: re.findall("[A-Z][a-z]*", c.__name__) for c in classes}
    own = {c: [w.lower() for w in found if w not in _NOUNS] for c, found in words.items()}
    return {"_".join(names): c for c, names in own.items() if "abstract" not in names}


_LINE = re.compile(r"\(at line (\d+),")
_HEAD = re.compile(r"\s*\[\[?\s*([\w.]+)\s*\]\]?.*")
_KEY = re.compile(r"\s*([\w.\"-]+?)\s*=.*")


def twice(text: str, error: str) -> str:
    """What to write in place of a table or key that is there twice, "" where `error` is another."""
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
