"""Stored programs: executables on disk, which later processes run without tracing the function again.

The program cache of jax saves the compilation only: to find a program there, jax must trace the function
and lower it first. Here a program is found by a description of everything that decides it: the
function, the structure, shapes and static values of its arguments, the options of the compiler, the
versions and sources of the code, the settings of jax and the processor. What cannot be described
exactly is traced as usual: an object of an unknown class, a function defined inside another one, code
of packages whose versions are not compared. Code that is replaced while the process runs is not noticed.

A stored program is unpickled, so whoever can write to the folder can run code in the processes that
read it. The same holds for the compiled programs that jax keeps there.
"""

import contextlib
import dataclasses
import functools
import hashlib
import importlib.metadata
import operator
import os
import pickle
import sys
import tempfile
import threading
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jax.experimental.compilation_cache import compilation_cache

from .description import TRUSTED, Indescribable, described
from .program_cache import processor, programs_are_kept


FOLDER = "executables"  # inside the folder of the program cache
_FORMAT = b"jaxrotor program 1\n"
_UNSTORABLE = b""  # content of the file of a program that must be traced
_CHECKED = (  # settings under which programs are checked while they run, or are not compiled
    "jax_debug_nans",
    "jax_debug_infs",
    "jax_disable_jit",
    "jax_check_tracer_leaks",
    "jax_enable_checks",
    "jax_no_execution",
    "jax_use_simplified_jaxpr_constants",
)
_INDIFFERENT = (  # beginnings of the names of settings that decide no program
    "jax_compilation_cache",
    "jax_enable_compilation_cache",
    "jax_persistent_cache",
    "jax_raise_persistent_cache",
    "jax_log",
    "jax_explain",
    "jax_compiler_detailed_logging",
    "jax_debug_log",
    "jax_traceback_filtering",
    "jax_dump_ir",
)
# Beginnings of environment variables that may decide
_VARIABLES = ("XLA_", "TF_XLA_", "JAX_", "EQX_")


@dataclasses.dataclass(frozen=True)
class Place:
    """Leaf of an output that stands for the array of a number."""

    number: int


class Program(NamedTuple):
    """An executable, and the output of its function with a `Place` for every array."""

    executable: Any  # a function of arrays that returns a list of them
    output: Any

    def __call__(self, arrays: list[Any]) -> Any:
        """Output of the function for other arrays of the same shapes and types."""
        found = jax.block_until_ready(self.executable(*arrays))
        leaves, structure = jax.tree.flatten(self.output)
        filled = [found[one.number] if type(one) is Place else one for one in leaves]
        return jax.tree.unflatten(structure, filled)


class StoredPrograms:
    """Programs of one function, one for every description of its arguments."""

    def __init__(self, function: Callable, traced: Callable, options: dict[str, Any]):
        """`traced` is the function as other programs contain it, `options` are those of `jax.jit`."""
        self._function, self._inside, self._options = function, traced, options
        self._programs: dict[str, Program | None] = {}
        self._shapes: dict[str, Any] = {}
        self._locks: dict[str, Any] = {}  # by file
        own = function.__module__.partition(".")[0] in TRUSTED
        self._found_by_name = own and "<" not in function.__qualname__
        self._name = function.__module__, function.__qualname__, described(options)

    def find(self, args: tuple, kwargs: dict[str, Any]) -> Callable[[], Any] | None:
        """The call with these arguments, none of them traced; None where its program is not stored.

        The program comes from the disk, or it is compiled and stored now.
        """
        found = self._file_and_arrays(args, kwargs)
        if found is None:
            return None
        file, arrays = found
        with self._lock(file):
            if file.name not in self._programs:
                self._programs[file.name] = self._loaded_or_built(file, args, kwargs, arrays)
        program = self._programs[file.name]
        return None if program is None else lambda: program(arrays)

    def shapes(self, compute: Callable[[], Any], args: tuple, kwargs: dict[str, Any]) -> Any:
        """Result of `compute` for a call with these arguments, which only their structure decides."""
        found = self._file_and_arrays(args, kwargs)
        if found is None:
            return compute()
        file = found[0].with_name(f"{found[0].name}-shapes")
        with self._lock(file):
            if file.name not in self._shapes:
                self._shapes[file.name] = _remembered(file, compute)
        return self._shapes[file.name]

    def _lock(self, file: Path) -> Any:
        """The lock of a program: others are compiled beside it."""
        return self._locks.setdefault(file.name, threading.RLock())

    def _file_and_arrays(
        self, args: tuple, kwargs: dict[str, Any]
    ) -> tuple[Path, list[Any]] | None:
        """File of the program of a call, and the arrays of the call; None where none is stored."""
        folder = _folder() if self._found_by_name and programs_are_kept() else None
        if folder is None:
            return None
        try:
            key, arrays = self._key(args, kwargs)
        except (Indescribable, ImportError):  # unknown parts of a call; an unknown version of jax
            return None
        return folder / key, arrays

    def _key(self, args: tuple, kwargs: dict[str, Any]) -> tuple[str, list[Any]]:
        """Hash of all that decides the program of a call, and the arrays of the call."""
        arrays: list[Any] = []
        call = described((args, kwargs), arrays)
        leaves = [leaf for leaf in jax.tree.leaves((args, kwargs)) if eqx.is_array(leaf)]
        if len(leaves) != len(arrays) or any(map(operator.is_not, leaves, arrays)):
            raise Indescribable("a class whose arrays jax takes in another order")
        return _digest((self._name, call, _settings(), surroundings())), arrays

    def _loaded_or_built(
        self, file: Path, args: tuple, kwargs: dict[str, Any], arrays: list[Any]
    ) -> Program | None:
        content = _read(file)
        if content == _UNSTORABLE:
            return None
        if content is not None:
            with contextlib.suppress(Exception):  # what another library wrote; it is built anew
                return _unpacked(content)
        traced, outputs = self._traced(args, kwargs, arrays)
        if _calls_python(traced.jaxpr.jaxpr):
            _write(file, _UNSTORABLE)
            return None
        with _WITHOUT_CACHE:
            program = Program(traced.lower().compile(), outputs[0])
        try:
            content = _packed(program)
        except Exception:  # jax or a static part of the output decides which
            content, program = _UNSTORABLE, None
        _write(file, content)
        return program

    def _traced(self, args: tuple, kwargs: dict[str, Any], arrays: list[Any]) -> tuple[Any, list]:
        """The function of the arrays alone, traced, and a list with its output."""
        leaves, structure = jax.tree.flatten((args, kwargs))
        places = [i for i, leaf in enumerate(leaves) if eqx.is_array(leaf)]
        outputs: list[Any] = []

        def of_arrays(*arrays: Any) -> list[Any]:
            filled = list(leaves)
            for i, array in zip(places, arrays, strict=True):
                filled[i] = array
            args, kwargs = jax.tree.unflatten(structure, filled)
            found, shape = jax.tree.flatten(self._inside(*args, **kwargs))
            there = [i for i, leaf in enumerate(found) if eqx.is_array(leaf)]
            marks = list(found)
            for number, i in enumerate(there):
                marks[i] = Place(number)
            outputs.append(jax.tree.unflatten(shape, marks))
            return [found[i] for i in there]

        of_arrays.__name__ = of_arrays.__qualname__ = self._function.__name__
        return jax.jit(of_arrays, **self._options).trace(*arrays), outputs


class _WithoutCache:
    """Compilation without the cache of jax: a program loaded from there lacks functions if stored again.

    The cache is off while any thread is inside; the others compile without it meanwhile, too.
    """

    def __init__(self) -> None:
        self._lock, self._threads = threading.Lock(), 0

    def __enter__(self) -> None:
        self._count(1)

    def __exit__(self, *_: Any) -> None:
        self._count(-1)

    def enabled(self) -> bool:
        """Whether the cache of jax is on, or off for compilations alone."""
        with self._lock:
            return jax.config.values["jax_enable_compilation_cache"] or self._threads > 0

    def _count(self, more: int) -> None:
        with self._lock:
            self._threads += more
            if self._threads == max(more, 0):  # the first to enter or the last to leave
                jax.config.update("jax_enable_compilation_cache", more < 0)
                compilation_cache.reset_cache()  # jax reads the setting once


_WITHOUT_CACHE = _WithoutCache()


def _calls_python(jaxpr: Any) -> bool:
    """Whether a program calls Python while it runs, or has another effect."""
    if jaxpr.effects:
        return True
    for equation in jaxpr.eqns:
        if "callback" in equation.primitive.name:
            return True
        if any(map(_calls_python, _inner(tuple(equation.params.values())))):
            return True
    return False


def _inner(value: Any) -> list[Any]:
    """Programs inside the parameters of an operation."""
    if isinstance(value, tuple | list):
        return [one for part in value for one in _inner(part)]
    inside = getattr(value, "jaxpr", value)
    return [inside] if hasattr(inside, "eqns") else []


# === what else decides a program


def _digest(description: Any) -> str:
    """Hash of a description."""
    return hashlib.sha256(repr(description).encode()).hexdigest()


def _settings() -> str:
    """Hash of jax's settings for this thread that decide programs; raises where programs are checked."""
    from jax._src.config import trace_context  # another version of jax may have none

    values, context = jax.config.values, trace_context()
    last = _LAST.get("settings")  # read once, as other threads write it
    if last is not None and last[0] == values and last[1] == context:
        return last[2]
    if any(values.get(name) for name in _CHECKED):
        raise Indescribable("programs that are checked")
    own = [
        (name, described(value))
        for name, value in sorted(values.items())
        if not name.startswith(_INDIFFERENT)
    ]
    found = _digest((tuple(own), described(context)))
    _LAST["settings"] = dict(values), context, found
    return found


_LAST: dict[str, tuple[Any, Any, Any]] = {}  # settings described last, and the hash of that


@functools.cache
def surroundings() -> str:
    """Hash of versions, sources, processor and environment of this process."""
    versions = [(name, _version(name)) for name in TRUSTED]
    variables = [
        (name, value)
        for name, value in sorted(os.environ.items())
        if name.startswith(_VARIABLES) and not name.lower().startswith(_INDIFFERENT)
    ]
    python = sys.version, sys.platform
    return _digest((tuple(versions), tuple(variables), python, processor(), sources()))


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:  # jaxrotor from a folder, hashed by `sources`
        return ""


def sources(package: Path = Path(__file__).parents[1]) -> str:
    """Hash of all modules of a package."""
    found = hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        content = file.read_bytes()
        found.update(f"{file.relative_to(package).as_posix()} {len(content)}\n".encode())
        found.update(content)
    return found.hexdigest()


def _folder() -> Path | None:
    """Folder of stored programs; None on anything but one CPU, or if jax keeps none on a local disk."""
    cache = jax.config.values["jax_compilation_cache_dir"]
    if not cache or "://" in cache or not _WITHOUT_CACHE.enabled():
        return None
    alone = jax.default_backend() == "cpu" and jax.device_count() == 1
    return Path(cache) / FOLDER if alone else None


# === files


def _remembered(file: Path, compute: Callable[[], Any]) -> Any:
    """Content of a file, else the result of a function, which is then written."""
    content = _read(file)
    if content is not None:
        with contextlib.suppress(Exception):
            return pickle.loads(content)
    found = compute()
    with contextlib.suppress(Exception):  # a static part that cannot be pickled
        _write(file, pickle.dumps(found))
    return found


def _packed(program: Program) -> bytes:
    """A program as bytes; raises where it, or its output, cannot be restored."""
    from jax.experimental.serialize_executable import serialize

    output = pickle.dumps(program.output)
    if jax.tree.structure(pickle.loads(output)) != jax.tree.structure(program.output):
        raise Indescribable("an output that changes when it is pickled")
    executable, inputs, outputs = serialize(program.executable)
    if (inputs, outputs) != _structures(inputs.num_leaves, outputs.num_leaves):
        raise Indescribable("a program of something else than arrays")
    sizes = inputs.num_leaves, outputs.num_leaves
    return zlib.compress(pickle.dumps((executable, sizes, output)), 1)


def _unpacked(content: bytes) -> Program:
    from jax.experimental.serialize_executable import deserialize_and_load

    executable, sizes, output = pickle.loads(zlib.decompress(content))
    _load_lapack()
    return Program(deserialize_and_load(executable, *_structures(*sizes)), pickle.loads(output))


def _structures(inputs: int, outputs: int) -> tuple[Any, Any]:
    """Structures of arguments and output of a program of arrays."""
    return jax.tree.structure(((0,) * inputs, {})), jax.tree.structure([0] * outputs)


@functools.cache
def _load_lapack() -> None:
    """Load LAPACK, which jax does when it lowers a program, and which no executable does."""
    from jaxlib.lapack import prepare_lapack_call

    prepare_lapack_call("getrf_ffi", np.dtype(np.float64))


def _read(file: Path) -> bytes | None:
    """Content of a file, None if it is absent or damaged."""
    try:
        form, digest, content = file.read_bytes().split(b"\n", 2)
    except (OSError, ValueError):
        return None
    whole = form + b"\n" == _FORMAT and digest == hashlib.sha256(content).hexdigest().encode()
    return content if whole else None


def _write(file: Path, content: bytes) -> None:
    """Write a file at once, so that no process reads a part; where that fails, there is none."""
    digest = hashlib.sha256(content).hexdigest().encode()
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=file.parent)
        try:
            with os.fdopen(handle, "wb") as part:
                part.write(_FORMAT + digest + b"\n" + content)
            os.replace(name, file)
        except OSError:
            os.unlink(name)
            raise
