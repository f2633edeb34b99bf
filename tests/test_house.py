"""House rules that a machine can check: layers, abstract or final, equations, sources, units."""

import ast
import dataclasses
import importlib
import inspect
import os
import pkgutil
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import equinox as eqx
import pytest
from systems import BESIDE, EFFECTS, HARMONIC, ROLLING, STRENGTHS, TURNING

import jaxrotor
import jaxrotor.plot
from jaxrotor import effects
from jaxrotor.cli.app import COMMANDS, loaded
from jaxrotor.core.quantities import unit_of
from jaxrotor.effects import AbstractEffect


PACKAGE = Path(jaxrotor.__file__).parent

# From the ground up, as the table of CONTRIBUTING has them; rooms of one floor do not import each other.
FLOORS = [
    ("core",),
    ("shafts", "spins"),
    ("effects",),
    ("scene",),
    ("equations", "files"),
    ("solvers", "analysis"),
    ("motion",),
    ("orbits", "results"),
    ("sweeps", "design"),
    ("work_precision", "plot"),
    ("__init__",),
    ("cli",),
    ("__main__",),
]
LEVEL = {name: level for level, names in enumerate(FLOORS) for name in names}
SOURCES = sorted(PACKAGE.rglob("*.py"))


def module_of(path):
    """Dotted parts below the package: ("solvers", "form"), ("shafts", "__init__")."""
    return path.relative_to(PACKAGE).with_suffix("").parts


def imports(path):
    """Every import of a file as dotted parts: own modules without the package's name, and others."""
    own, others = set(), set()
    tree = ast.parse(path.read_text())
    parts = module_of(path)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                names = tuple(alias.name.split("."))
                if names[0] == "jaxrotor":
                    own.add(names[1:] or ("__init__",))
                else:
                    others.add(names[0])
        elif isinstance(node, ast.ImportFrom):
            names = tuple(node.module.split(".")) if node.module else ()
            if node.level:
                base = parts[:-1]
                names = base[: len(base) - node.level + 1] + names
            elif names[0] == "jaxrotor":
                names = names[1:]
            else:
                others.add(names[0])
                continue
            for alias in node.names:
                own.add(full_name(names, alias.name))
    return own, others


def full_name(parts, name):
    """`from parts import name`: the module `name` where there is one, else `parts`."""
    folder = PACKAGE.joinpath(*parts)
    if (folder / f"{name}.py").exists() or (folder / name / "__init__.py").exists():
        return (*parts, name)
    return parts or ("__init__",)


LONGEST_MODULE, LONGEST_FUNCTION = 400, 80  # lines; of a function without its docstring


def functions(tree):
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]


def lines_of(function):
    """Lines of a function, its docstring not counted."""
    first = function.body[0]
    text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    told = first.end_lineno - first.lineno + 1 if text else 0
    return function.end_lineno - function.lineno + 1 - told


def name_of(path):
    return "/".join(module_of(path))


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_layers_import_downwards_only(path):
    here = module_of(path)
    assert here[0] in LEVEL, f"Give {here[0]} its floor in FLOORS."
    for there in imports(path)[0]:
        if there[0] != here[0]:
            assert LEVEL[there[0]] < LEVEL[here[0]], f"{'.'.join(here)} imports {'.'.join(there)}."


CONTRIBUTING = (PACKAGE.parent / "CONTRIBUTING.md").read_text()


def test_the_rooms_are_those_of_the_table():
    """CONTRIBUTING has every room with its floor and what it imports from, as it is."""
    rooms, imported = {}, {}
    for path in SOURCES:
        here = module_of(path)[0]
        if len(module_of(path)) > 1 or here == "scene":
            rooms[here] = LEVEL[here] + 1
            own = imported.setdefault(here, set())
            own |= {there[0] for there in imports(path)[0]} - {here}
    rows = re.findall(r"^\| (\d+) \| `([\w.]+)` \|.*\| ([^|]*) \|$", CONTRIBUTING, re.M)
    told = {name.removesuffix(".py"): (int(floor), froms) for floor, name, froms in rows}
    shown = {name: min(floor, 11) for name, floor in rooms.items()}
    assert {name: floor for name, (floor, _) in told.items()} == shown
    for name, (_, froms) in told.items():
        named = set(re.findall(r"`(\w+)`", froms))
        if froms.startswith("every room but"):
            named = {room for room in rooms if room != name} - named
        assert named == imported[name] & set(rooms), name


def test_the_walks_pass_by_what_is_there():
    stops = re.findall(r"^(\d+)\. `([\w/]+\.py): (\w+)`", CONTRIBUTING, re.M)
    assert [number for number, *_ in stops] == 3 * list("12345678")
    for _, path, name in stops:
        defined = {f.name for f in functions(ast.parse((PACKAGE / path).read_text()))}
        assert name in defined, f"{path}: {name}"


DIFFERENTIATED = ("effects", "shafts", "spins", "equations", "solvers", "motion", "design")


@pytest.mark.parametrize(
    "path", [p for p in SOURCES if module_of(p)[0] in DIFFERENTIATED], ids=name_of
)
def test_extremes_are_those_of_extremes(path):
    """The derivative of `jnp.maximum` and its like may be lost, see the module."""
    assert not re.findall(r"jnp\.(?:maximum|minimum|clip)\b", path.read_text())


CORE = ("core", "spins", "scene", "equations", "solvers", "motion", "sweeps")


NAMED = ("motion", "reactions")  # of supports and constraints, each by its name


@pytest.mark.parametrize(
    "path",
    [p for p in SOURCES if module_of(p)[0] in CORE and module_of(p) != NAMED],
    ids=name_of,
)
def test_core_knows_no_concrete_effect_or_shaft(path):
    allowed = {
        ("effects", "base"),
        ("effects", "law"),
        ("effects", "places"),
        ("effects", "layout"),
        *(
            ("shafts", name)
            for name in ("line", "cased", "coaxial", "constraint", "hinge", "virtual")
        ),
    }
    known = {there for there in imports(path)[0] if there[0] in ("effects", "shafts")}
    assert known <= allowed


def test_capabilities_know_no_effect():
    known = imports(PACKAGE / "effects" / "base.py")[0]
    assert {there for there in known if there[0] == "effects"} <= {("effects", "law")}
    for path in (PACKAGE / "effects").glob("*.py"):
        if path.stem not in ("__init__", "base", "law"):
            known = {there for there in imports(path)[0] if there[0] == "effects"}
            shared = {
                ("effects", name)
                for name in [
                    "base",
                    "law",
                    "places",
                    "coefficients",
                    "controller",
                    "rub",
                    "film",
                    "film_pressure",
                    "places",
                ]
            }  # no effects
            assert known <= shared, f"{path.stem} imports another effect."


def test_matplotlib_is_imported_by_plots_alone():
    for path in SOURCES:
        if module_of(path)[0] != "plot":
            assert "matplotlib" not in imports(path)[1], name_of(path)


@pytest.mark.parametrize("path", [p for p in SOURCES if name_of(p) != "core/linalg"], ids=name_of)
def test_decompositions_are_those_of_linalg(path):
    """Some of jax hang where a process has one processor, see the module."""
    there = r"jnp\.(?:linalg|roots|polyfit)\b|jax\.(?:numpy|scipy|lax)\.linalg|\b(?:lineax|lx)\."
    assert not re.findall(there, path.read_text())


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_modules_and_functions_are_short(path):
    text = path.read_text()
    assert len(text.splitlines()) <= LONGEST_MODULE
    long = {f.name: lines_of(f) for f in functions(ast.parse(text))}
    assert max(long.values(), default=0) <= LONGEST_FUNCTION, long


# === words

OPENINGS = ("Of ", "What ")  # of half a sentence


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_docstrings_open_with_a_noun_or_a_sentence(path):
    told = (ast.Module, ast.ClassDef, ast.FunctionDef)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, told):
            assert not (ast.get_docstring(node) or "").startswith(OPENINGS), node


def public_functions():
    """Functions that a user calls by name, each once."""
    places = (jaxrotor, jaxrotor.plot, jaxrotor.objectives, jaxrotor.methods)
    found = {}
    for place in places:
        for name in dir(place):
            value = inspect.unwrap(getattr(place, name))
            ours = inspect.isfunction(value) and value.__module__.startswith(place.__name__)
            if ours and not name.startswith("_"):
                found[f"{value.__module__}.{value.__qualname__}"] = value
    return found


PUBLIC = public_functions()


@pytest.mark.parametrize("name", PUBLIC)
def test_public_functions_tell_arguments_result_and_errors(name):
    function = PUBLIC[name]
    doc = inspect.getdoc(function) or ""
    section = lambda head: doc.partition(f"{head}:\n")[2].partition("\n\n")[0]
    parameters = inspect.signature(function).parameters.values()
    for one in parameters:
        said = re.search(rf"^ +(?:\S+, )*\**{one.name}(?:, \S+)*:", section("Args"), re.M)
        assert said, f"Tell {one.name} of {name} under `Args:`."
    if inspect.signature(function).return_annotation is not None:
        assert section("Returns"), f"Tell what {name} returns."
    body = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = {getattr(node.func, "id", "") for node in ast.walk(body) if isinstance(node, ast.Call)}
    raises = any(isinstance(node, ast.Raise) for node in ast.walk(body))
    if raises or any(call.startswith("check_") for call in calls):
        assert section("Raises"), f"Tell what {name} raises."


# === classes


def modules():
    for info in pkgutil.walk_packages([str(PACKAGE)], "jaxrotor."):
        if not info.name.endswith("__main__"):
            yield importlib.import_module(info.name)


def own_classes():
    found = {}
    for module in modules():
        for value in vars(module).values():
            if isinstance(value, type) and value.__module__ == module.__name__:
                found[f"{value.__module__}.{value.__qualname__}"] = value
    return found


CLASSES = own_classes()
MODULES = {name: cls for name, cls in CLASSES.items() if issubclass(cls, eqx.Module)}


@pytest.mark.parametrize("name", MODULES)
def test_every_module_is_abstract_or_final(name):
    cls = MODULES[name]
    for base in cls.__mro__[1:]:
        if base.__module__.startswith("jaxrotor."):
            assert base.__name__.startswith("Abstract"), f"{name} subclasses {base.__name__}."
            repeated = {
                key
                for key, value in vars(base).items()
                if inspect.isfunction(value)
                and not key.startswith("__")
                and not getattr(value, "__isabstractmethod__", False)
            }
            if base.__name__ == "AbstractLaw":  # a law with states replaces these
                repeated -= {"begin", "rates"}
            assert not repeated & set(vars(cls)), "A method that has a body is not overridden."
    if cls.__name__.startswith("Abstract"):
        shared = {"shaft"}  # of every effect, by keyword alone
        assert {field.name for field in dataclasses.fields(cls)} <= shared, (
            "An abstract class declares no fields, AbstractVar does."
        )


@pytest.mark.parametrize("name", [n for n in CLASSES if not n.rpartition(".")[2].startswith("_")])
def test_every_public_class_is_described(name):
    doc = vars(CLASSES[name]).get("__doc__") or ""
    assert doc.strip() and not doc.startswith(f"{CLASSES[name].__name__}(")


CONCRETE = [
    value
    for value in vars(effects).values()
    if isinstance(value, type)
    and issubclass(value, AbstractEffect)
    and not value.__name__.startswith("Abstract")
]


def test_every_effect_is_in_the_list_of_the_tests():
    every = EFFECTS + TURNING + HARMONIC + ROLLING + BESIDE
    assert {type(effect) for effect in every} == set(CONCRETE)
    assert set(STRENGTHS) == {cls.kind for cls in CONCRETE}
    assert all(getattr(jaxrotor, cls.__name__) is cls for cls in CONCRETE)


@pytest.mark.parametrize("cls", CONCRETE, ids=lambda cls: cls.__name__)
def test_every_effect_has_equation_source_and_units(cls):
    assert "=" in cls.__doc__ and "Source:" in cls.__doc__
    assert cls.plural and cls.kind != cls.plural
    for field in dataclasses.fields(cls):
        if not field.metadata.get("static") and field.name != "body":
            assert unit_of(field), f"{cls.__name__}.{field.name} has no unit."


@pytest.mark.parametrize("name", MODULES)
def test_no_plain_float_field(name):
    """A `float` field would be static: neither checked, nor traced, nor differentiated."""
    for field in dataclasses.fields(MODULES[name]):
        if not field.metadata.get("static"):
            assert field.type not in (float, int, "float", "int"), field.name


def test_everything_public_is_in_the_reference():
    """Every function and class of `jaxrotor`, its plots and objectives has a line in `docs/api`."""
    pages = (PACKAGE.parent / "docs" / "api").glob("*.md")
    told = {line.rpartition(".")[2] for page in pages for line in page.read_text().split("\n")}
    for module in (jaxrotor, jaxrotor.plot):
        for name in dir(module):
            value = getattr(module, name)
            if not name.startswith("_") and (isinstance(value, type) or inspect.isfunction(value)):
                assert value.__name__ in told, (
                    f"Give {module.__name__}.{name} its line in docs/api."
                )


# === loading


HEAVY = ("jax", "scipy", "diffrax", "xarray", "dask", "pint", "zarr", "matplotlib", "contourpy")


@pytest.mark.parametrize("done", ["", "; dir(jaxrotor)", "; from jaxrotor.cli import app"])
def test_nothing_is_loaded_before_it_is_asked_for(done):
    said = f"import sys, jaxrotor{done}; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", said], capture_output=True, check=True, text=True
    )
    assert not set(HEAVY) & set(loaded.stdout.split())


@pytest.mark.parametrize(
    "words",
    [
        ["--version"],
        ["--help"],
        ["nonsense"],
        ["scenes"],
        ["new", "mine.toml"],
        ["show", "limiter-rottor"],
    ],
    ids=" ".join,
)
def test_program_answers_before_anything_is_loaded(words, tmp_path):
    run = [sys.executable, "-X", "importtime", "-m", "jaxrotor", *words]
    path = os.pathsep.join(filter(None, [str(PACKAGE.parent), os.environ.get("PYTHONPATH")]))
    run_in = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": path}}
    err = subprocess.run(run, capture_output=True, text=True, **run_in).stderr
    loaded = {line.rpartition("|")[2].strip() for line in err.splitlines()}
    assert "typer" in loaded and not set(HEAVY) & loaded


def test_analyses_are_loaded_when_they_are_asked_for():
    """`roots` needs neither the theory of the balancer nor maps, which load scipy and xarray."""
    said = "import sys; from jaxrotor.analysis import roots, campbell; assert callable(campbell); "
    said += "import jaxrotor.analysis.campbell; assert callable(jaxrotor.analysis.campbell); "
    said += "print(*sys.modules)"
    run = [sys.executable, "-c", said]
    found = subprocess.run(run, capture_output=True, check=True, text=True).stdout.split()
    assert not {"jaxrotor.analysis.balancer", "jaxrotor.analysis.maps", "xarray"} & set(found)


@pytest.mark.slow
def test_names_are_of_functions_whatever_is_loaded_first():
    """Modules that are loaded hide no function of the same name."""
    said = (
        "import jaxrotor.plot, jaxrotor.sweeps.sweep, jaxrotor as jr; assert callable(jr.sweep); "
    )
    said += "from jaxrotor import basins, plot; assert callable(basins); assert plot is jr.plot; "
    said += "import jax.numpy as jnp; assert jnp.ones(1).dtype == 'float64'; "
    said += "assert {'sweep', 'plot', 'Disc'} <= set(dir(jr)) and 'lazy_loader' not in dir(jr)"
    subprocess.run([sys.executable, "-c", said], check=True)


@pytest.mark.parametrize("first", ["jax", "jaxrotor"])
@pytest.mark.parametrize(
    ("chosen", "wide"), [({}, "float64"), ({"JAX_ENABLE_X64": "0"}, "float32")]
)
def test_double_precision_is_the_default(monkeypatch, first, chosen, wide):
    monkeypatch.delenv("JAX_ENABLE_X64", raising=False)
    said = f"import {first}, jaxrotor, jax; assert jax.numpy.ones(1).dtype == '{wide}'"
    subprocess.run([sys.executable, "-c", said], check=True, env=os.environ | chosen)


@pytest.mark.parametrize("name", COMMANDS)
def test_what_help_lists_is_what_the_command_says(name):
    said = inspect.cleandoc(loaded(name).callback.__doc__).partition("\n\n")[0]
    assert " ".join(said.split()) == COMMANDS[name][1]
