"""Writes `docs/scene-files.md`: every key of a scene file, from the classes of the parts.

`python docs/scene_files.py` writes the page. `tests/files/test_scene_files.py` checks that it is up to
date, and loads every example.
"""

import dataclasses
import inspect
import re
import typing
from pathlib import Path

from scene_defaults import WHY as WHY, why
from scene_examples import EXAMPLES

from jaxrotor import shafts, spins
from jaxrotor.core.quantities import is_series, takes_matrix, takes_table, unit_of
from jaxrotor.effects import CoaxialShaft
from jaxrotor.files.machine import Clearance, Machine, Probe, Stage
from jaxrotor.files.several_shafts import KEYS
from jaxrotor.files.toml_reader import choices_of
from jaxrotor.files.vocabulary import COUNTS, FORMS, START, exported, models
from jaxrotor.shafts import AbstractShaft, Constraint, Step
from jaxrotor.shafts.materials import NAMED, Material
from jaxrotor.spins.base import AbstractSpin


PAGE = Path(__file__).with_name("scene-files.md")
INTRODUCTION = """\
# Scene files

<!-- Written by docs/scene_files.py from the classes; change these, or the examples there. -->

A scene is a TOML file with one `[shaft]`, or `[shafts.NAME]` for each of several on one axis, one
`[spin]`, and a table for each effect on or around the shaft. Nothing else is simulated. `jaxrotor new
my-rotor.toml` writes a commented file to begin with, and `jaxrotor show my-rotor.toml` lists the
parameters that were read from a file.

* A number is in SI units; a text carries its unit: `0.7`, `"0.7 m"`, `"700 mm"`, `"1500 rpm"`, `"60 deg"`.
* A single part is `[disc]`. If there are several, each is `[[disc]]` or `[[discs]]`, with two brackets.
* Stations (`at`) are measured from the left end of the shaft, of several shafts along their common axis.
* Every effect on one of several shafts names it: `at = "hp 0.3 m"`, or by the key `shaft`, which an effect
  along a shaft needs: `shaft = "hp"`. `on` may name another shaft: the part is then between the two, as a
  bearing between shafts is.
* `angles = ["0 deg", "90 deg"]` in place of `angle` stands for one part at each of these angles.
* In the tables below, a key that is "needed" must be given; one that is "absent" has no effect until it
  is given. A default has the reason why it adds nothing to what is drawn.
* A support or a shaft may have `table = "bearing.csv"` in place of its numbers: a table in CSV or Excel,
  by its path from the folder of the scene file, and `sheet = "DE"` where several sheets have one
  ([tables](guides/exchange.md#tables-of-bearings)). Other keys stand beside it, as `at` and `hold`,
  of a shaft also `materials = {"42CrMo4" = {youngs_modulus = "210 GPa", density = 7850.0}}` for names
  in its table.
* The name of a parameter is that of its table and key: `disc.mass`, `limiters.0.gap`. `--set`, `--over`
  and `scene.replace` use these names. Those of a further shaft are `coaxial_shaft.ratio` and
  `coaxial_shaft.body.length`, or `shafts.hp.ratio` and `shafts.hp.length`.

The file may begin with `title`, a text that figures show, and `assumption`, a text that says what of the
rotor is assumed, and that every result repeats.
"""


def page() -> str:
    """The whole page."""
    parts = [INTRODUCTION, "## The shaft\n", "One of these models.\n"]
    parts += [_part(name, cls, "[shaft]") for name, cls in models(shafts, AbstractShaft).items()]
    parts += [_further_shaft()]
    parts += [_part("step", Step, "[[shaft.steps]]")]
    parts += [_part("constraint", Constraint, "[[shaft.constraints]]")]
    parts += [_part("material", Material, "[shaft.material]"), "## Effects\n"]
    for kind, cls in exported().items():
        if cls is CoaxialShaft:
            continue
        parts.append(_part(kind, cls, f"[{kind}]"))
        parts += [_form(form) for form in FORMS if form.of is cls]
    parts += ["## Rotation\n", "One of these models.\n"]
    parts += [_part(name, cls, "[spin]") for name, cls in models(spins, AbstractSpin).items()]
    return "\n".join([*parts, _sweep(), *_machine()])


def examples(name: str) -> list[str]:
    """Examples of a part."""
    if not EXAMPLES.get(name):
        raise KeyError(
            f"Give {name!r} examples with every key in EXAMPLES of docs/scene_examples.py."
        )
    return EXAMPLES[name]


def _further_shaft() -> str:
    """Several shafts; what one beside the first has is the model of a shaft and keys of its own."""
    fields = [field for field in dataclasses.fields(CoaxialShaft) if field.name in KEYS]
    name = CoaxialShaft.kind
    rows = [(f.name, _unit(f), _with_reason(_default(f), name, f.name)) for f in fields]
    head = [
        "### `[shafts.NAME]`, several shafts\n",
        "The first table is a shaft as above; a further one has these keys, too. Its own stations, of\n"
        "`steps` and `constraints`, are from its own left end.\n",
        _section(name, "", CoaxialShaft, rows).partition("\n\n")[2],
    ]
    return "\n".join(head)


def _part(name: str, cls: type, table: str) -> str:
    fields = [field for field in dataclasses.fields(cls) if field.init and field.name != "shaft"]
    rows = [
        (field.name, _unit(field), _with_reason(_default(field), name, field.name))
        for field in fields
    ]
    noun = f'model = "{name}"' if table in ("[shaft]", "[spin]") else ""
    return _section(name, f"`{table}` {noun and f'with `{noun}`'}".rstrip(), cls, rows)


def _form(form) -> str:
    rows, parameters = [], inspect.signature(form.build).parameters
    for key, unit in form.units.items():
        if key == "speed":
            needed = "that of a constant spin"
        else:
            default = parameters[key].default
            needed = "needed" if key in form.needed else f"`{default:g}`"
            needed = _with_reason(needed, form.noun, key)
        rows.append((key, 'mm/s, or `"G6.3"`' if key == "grade" else unit, needed))
    noun = form.noun[0].upper() + form.noun[1:]
    text = _section(form.noun, noun, form.build, rows)
    others = ", ".join(f"`{key}`" for key in form.fields)
    return f"{text}\nFurther keys, as above: {others}.\n"


def _sweep() -> str:
    rows = [("over", "of each parameter", "absent")]
    rows += [(key, f"whole number from {least}", "absent") for key, least in COUNTS.items()]
    rows += [(f"start.{key}", unit, "absent") for key, unit in START.items()]
    head = [
        "## Sweeps\n",
        'Values are a list, or `"start : stop : count"`. Options of the command line override them.\n',
    ]
    return "\n".join([*head, _table("sweep", rows), *_blocks("sweep")])


def _machine() -> list[str]:
    """The machine around a rotor, and what it has many of."""
    tables = {
        "machine": (Machine, "[machine]"),
        "probe": (Probe, "[[machine.probes]]"),
        "close clearance": (Clearance, "[[machine.clearances]]"),
        "stage": (Stage, "[[machine.stages]]"),
    }
    told = "What `jaxrotor api` asks for; nothing else reads it, and `save` does not write it."
    return [f"## The machine\n\n{told}\n", *(_part(name, *own) for name, own in tables.items())]


def _section(name: str, title: str, described: typing.Any, rows: list) -> str:
    told = inspect.cleandoc(described.__doc__).partition("Args:")[0].rstrip()
    head = [f"### {title}\n", f"{told}\n", _table(name, rows)]
    return "\n".join([*head, *_blocks(name)])


def _blocks(name: str) -> list[str]:
    return [f"```toml\n{text}```\n" for text in examples(name)]


def _table(name: str, rows: list) -> str:
    lines = ["| key | unit | default | example |", "|---|---|---|---|"]
    lines += [
        f"| `{key}` | {unit} | {default} | `{example_of(name, key)}` |"
        for key, unit, default in rows
    ]
    return "\n".join(lines) + "\n"


def example_of(name: str, key: str) -> str:
    """The value of a key in the examples of a part."""
    own = key.rpartition(".")[2]
    value = r"(\"[^\"]*\"|\[.*\]|[^\s,}\]#]+)"
    for text in examples(name):
        text = re.sub(" +#.*", "", text)
        found = re.search(rf"(?<![\w.]){own}\s*=\s*{value}", text)
        if found is not None:
            return found[1]
    if key == "over":
        return '"spin.speed" = "1000 rpm : 4000 rpm : 41"'
    raise KeyError(f"Give `{key}` of {name!r} an example in EXAMPLES of docs/scene_examples.py.")


def _unit(field: dataclasses.Field) -> str:
    unit, kind = unit_of(field), typing.cast(typing.Any, field.type)
    if unit is not None:
        unit = "number" if unit == "1" else unit
        if is_series(field):
            return f"list in {unit}"
        if takes_table(field):
            return f"{unit}, or a list at `speeds`"
        return f"{unit}, or a 2 by 2 matrix" if takes_matrix(field) else unit
    if Material in (kind, *typing.get_args(kind)):
        return f"table, or {' or '.join(f'`{name!r}`' for name in NAMED)}".replace("'", '"')
    if typing.get_origin(kind) is tuple:
        return "list of tables"
    words, plain = choices_of(kind)
    names = {bool: "true or false", int: "whole number", str: "text"}
    return " or ".join([*(names[one] for one in plain), *(f'`"{one}"`' for one in words)])


def _with_reason(default: str, part: str, key: str) -> str:
    """A default with the reason why it is neutral, if it needs one."""
    reason = why(part, key)
    if default == "needed" or not reason:
        return default
    return reason if reason.startswith(default) else f"{default}: {reason}"


def _default(field: dataclasses.Field) -> str:
    default = field.default
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    if default is dataclasses.MISSING:
        return "needed"
    if isinstance(default, Material):
        return '`"steel"`'
    if field.metadata.get("taken") is not None:
        return f"`{field.metadata['taken'].formula}`"
    if default is None:
        return "that of the shaft" if field.name == "material" else "absent"
    if isinstance(default, tuple):
        return "none"
    if isinstance(default, bool | str):
        return f"`{str(default).lower()}`" if isinstance(default, bool) else f'`"{default}"`'
    return f"`{float(default):.6g}`"


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8", newline="\n")
