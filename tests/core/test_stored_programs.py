"""Programs are stored with all that decides them, and give the same numbers when they are loaded."""

import enum
import functools
import importlib
import importlib.metadata
import itertools
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.experimental.compilation_cache import compilation_cache

import jaxrotor as jr
from jaxrotor.analysis.modal import _modes
from jaxrotor.core import description, program_cache, stored_programs
from jaxrotor.core.compiled import QUICKLY, Compiled
from jaxrotor.core.description import Indescribable, described
from jaxrotor.core.stored_programs import StoredPrograms, surroundings
from jaxrotor.files.shipped import shipped


SCENE = jr.load("limiter-rotor").with_nodes(3)


def asked(scene=SCENE):
    """Arguments of the program that the tests store."""
    return scene, jr.assemble(scene), 4, 11


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Folder of stored programs, kept for one test."""
    names = ("jax_compilation_cache_dir", *program_cache.SETTINGS)
    before = {name: jax.config.values[name] for name in names}
    monkeypatch.setattr(program_cache, "_kept", False)
    program_cache.keep_programs(tmp_path)
    yield tmp_path / stored_programs.FOLDER
    for name, value in before.items():
        jax.config.update(name, value)
    compilation_cache.reset_cache()


def of_jaxrotor(function):
    """A function of a test as if it were one of the package."""
    function.__module__, function.__qualname__ = "jaxrotor.core.blocks", function.__name__
    return function


def refuses(*args, **kwargs):
    raise AssertionError("traced, though a program is stored")


class Static(eqx.Module):
    array: jax.Array | None = None
    setting: object = eqx.field(default=None, static=True)


# === descriptions


Colour = enum.Enum("Colour", "red")
DIFFERENT = [
    *(None, True, False, 0, 1, 1.0, 0.0, -0.0, math.nan, 1j, "1", b"1", (), [], (1,), [1], (1.0,)),
    *({"a": 1}, {"a": 2}, {"b": 1}, {"a": 1, "b": 2}, {"b": 2, "a": 1}, {1: 1}, slice(1), slice(2)),
    *(np.zeros(2), np.zeros(3), np.zeros((2, 1)), np.array([0.0, -0.0]), np.zeros(2, np.float32)),
    *(np.zeros(2, int), np.zeros(2, ">f8"), np.float64(1.0), np.float32(1.0), np.array(1.0)),
    *(np.dtype(float), np.dtype(np.float32), np.sin.__class__, dict, eqx.Module),
    *(math.sin, math.cos, functools.partial(math.sin), functools.partial(math.sin, 1.0)),
    *(frozenset({1}), frozenset({1, 2}), frozenset({1.0}), Ellipsis, jr.Exponential, jr.roots),
]


def test_static_values_have_descriptions_of_their_own():
    texts = [repr(described(value)) for value in DIFFERENT]
    assert len({*texts}) == len(DIFFERENT)
    assert texts == [repr(described(value)) for value in DIFFERENT]


def test_arrays_are_described_by_shape_and_type():
    given = (jnp.ones(2), jnp.ones(3), jnp.ones(2, np.float32), jnp.ones(()), jnp.ones((), int))
    given += (
        np.ones(2),
        np.ones(3),
        np.float64(1.0),
        jax.device_put(jnp.ones(2), jax.devices()[0]),
    )
    given += (jax.jit(lambda: 1.0)(),)  # weakly typed
    texts = [repr(described(one, [])) for one in given]
    assert len({*texts}) == len(given)
    assert described(jnp.zeros(2), []) == described(jnp.ones(2), [])
    found = []
    described({"b": jnp.ones(1), "a": (jnp.ones(2), [jnp.ones(3)])}, found)
    assert [one.size for one in found] == [2, 3, 1]


@pytest.mark.parametrize(
    "value",
    [
        lambda: None,
        refuses,  # of a package whose version is not compared
        Colour.red,
        Static(),
        object(),
        {1, 2},
        np.array(["text"]),
        np.ma.zeros(2),
        functools.partial(lambda: None),
        jnp.ones(2),  # as a static value
        jax.random.key(0),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_cannot_be_described_is_refused(value):
    with pytest.raises(Indescribable):
        described((1, value))


@pytest.mark.parametrize("name", [name for name, _ in shipped()])
def test_shipped_scenes_can_be_described(name):
    """Also after operations on their trees, by which every other attribute than a field would be seen."""
    scene = jr.load(name)
    moved = jax.tree.map(lambda leaf: leaf, scene)
    assert repr(described(moved, [])) == repr(described(scene, []))


def test_a_scene_is_described_by_its_structure():
    text = lambda scene: repr(described(scene, []))
    own = text(SCENE)
    assert own == text(SCENE.replace({"spin.speed": 7.0}))
    assert own == text(jr.load("limiter-rotor").with_nodes(3))
    others = [
        SCENE.with_nodes(5),
        SCENE.with_nodes(6),
        jr.load("two-discs"),
        SCENE.with_nodes(5, "trapezoid"),
    ]
    assert len({own, *map(text, others)}) == 5
    found = []
    described(SCENE, found)
    assert all(a is b for a, b in zip(found, jax.tree.leaves(SCENE), strict=True))


# === keys


def key(*args, options=QUICKLY, function=_modes.__wrapped__):
    return StoredPrograms(function, function, options)._key(args, {})[0]


def changed_versions(monkeypatch):
    known = importlib.metadata.version
    monkeypatch.setattr(
        importlib.metadata, "version", lambda name: known(name) + "0" * (name == "lineax")
    )


CHANGES = {
    "a version": changed_versions,
    "a source": lambda patch: patch.setattr(stored_programs, "sources", lambda: "others"),
    "the processor": lambda patch: patch.setattr(stored_programs, "processor", lambda: "another"),
    "the environment": lambda patch: patch.setenv("XLA_FLAGS", "--xla_cpu_enable_fast_math=true"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_the_key_changes_with(what, monkeypatch):
    before = key(SCENE)
    CHANGES[what](monkeypatch)
    surroundings.cache_clear()
    after = key(SCENE)
    monkeypatch.undo()
    surroundings.cache_clear()
    assert after != before == key(SCENE)


def test_the_key_changes_with_settings_options_and_functions():
    if hasattr(jax, "enable_x64"):
        single = jax.enable_x64(False)
    else:  # jax below 0.8
        single = importlib.import_module("jax.experimental").enable_x64(False)
    contexts = [single, jax.default_matmul_precision("float32")]
    contexts += [jax.default_device(jax.devices()[0]), jax.numpy_rank_promotion("warn")]
    found = [key(SCENE), key(SCENE, options={}), key(SCENE, function=jr.roots), key(SCENE, SCENE)]
    for context in contexts:
        with context:
            found.append(key(SCENE))
    assert len({*found}) == len(found) and found[0] == key(SCENE)
    with jax.debug_nans(True), pytest.raises(Indescribable):
        key(SCENE)


def test_sources_are_compared_by_content(tmp_path):
    (tmp_path / "inner").mkdir()
    files = [tmp_path / "a.py", tmp_path / "inner" / "b.py"]
    seen = []
    for contents in (
        ("x = 1", "y = 1"),
        ("x = 1", "y = 2"),
        ("x = 2", "y = 1"),
        ("x = 1y = ", "1"),
    ):
        for file, content in zip(files, contents, strict=True):
            file.write_text(content)
        seen.append(stored_programs.sources(tmp_path))
    files[0].rename(tmp_path / "c.py")
    seen.append(stored_programs.sources(tmp_path))
    assert len({*seen}) == len(seen)
    assert description.TRUSTED[0] == jr.__name__


# === storing and loading


def test_loaded_program_gives_the_same_bits_without_tracing(folder):
    function = _modes.__wrapped__
    expected = eqx.filter_jit(function, **QUICKLY)(*asked())
    built = StoredPrograms(function, function, QUICKLY).find(asked(), {})()
    loaded = StoredPrograms(function, refuses, QUICKLY).find(asked(), {})()
    for found in (built, loaded):
        assert jax.tree.structure(found) == jax.tree.structure(expected)
        assert type(found) is type(expected) and found.frame == expected.frame
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
            assert (a.dtype, a.weak_type, a.committed) == (b.dtype, b.weak_type, b.committed)
            assert np.asarray(a).tobytes() == np.asarray(b).tobytes()
    other = SCENE.replace({"spin.speed": 11.0})  # the same program with other values
    assert not np.array_equal(
        StoredPrograms(function, refuses, QUICKLY).find(asked(other), {})().values,
        expected.values,
    )
    assert len([*folder.iterdir()]) == 2  # and the program that assembles


@of_jaxrotor
def scaled(x, setting):
    return Static(x * 2.0, ("kept", 1, -0.0)), setting, 3, np.float64(2.0), jnp.ones(2)


def test_static_parts_of_the_output_are_restored(folder):
    for traced in (scaled, refuses):
        found = StoredPrograms(scaled, traced, {}).find((jnp.ones(2), "text"), {})()
        assert type(found[0]) is Static and repr(found[0].setting) == "('kept', 1, -0.0)"
        assert found[1:3] == ("text", 3) and type(found[2]) is int
        assert np.array_equal(found[0].array, [2.0, 2.0]) and float(found[3]) == 2.0


def damaged(content):
    flipped = bytearray(content)
    flipped[len(flipped) // 2] ^= 1
    yield from (b"", content[:-1], content[:30], bytes(flipped), content + b"x", b"\n\n" + content)


def test_a_damaged_file_is_written_anew(folder):
    call = lambda traced: StoredPrograms(scaled, traced, {}).find((jnp.ones(2), 1), {})()
    call(scaled)
    (file,) = folder.iterdir()
    for content in damaged(file.read_bytes()):
        file.write_bytes(content)
        assert np.array_equal(call(scaled)[0].array, [2.0, 2.0])
        assert np.array_equal(call(refuses)[0].array, [2.0, 2.0])
    assert [*folder.iterdir()] == [file]


@of_jaxrotor
def fused(x, y):
    return jnp.stack([jnp.pi * (x / y) ** 0.25, x * y + jnp.sin(x)])


def test_a_program_that_jax_has_in_its_cache_is_stored_complete(folder, monkeypatch):
    """A program that jax loads from its cache lacks functions if it is serialised again."""
    given = (jnp.ones(()), jnp.full((), 2.0))
    call = lambda traced: StoredPrograms(fused, traced, QUICKLY).find(given, {})()
    with monkeypatch.context() as patch:  # jax stores the program as well
        patch.setattr(stored_programs._WITHOUT_CACHE, "_count", lambda more: None)
        first = call(fused)
    assert [*folder.parent.glob("jit_fused*")]
    for file in folder.iterdir():
        file.unlink()
    jax.clear_caches()
    assert np.array_equal(call(fused), first) and np.array_equal(call(refuses), first)
    assert jax.config.jax_enable_compilation_cache


@of_jaxrotor
def checked(x):
    return jax.lax.scan(lambda x, _: (eqx.error_if(x, x < 0, "below zero"), None), x, None, 2)[0]


@of_jaxrotor
def with_a_function(x):
    return Static(x, lambda: None)


@pytest.mark.parametrize("function", [checked, with_a_function])
def test_what_cannot_be_stored_is_traced_as_before(folder, function):
    call = Compiled(function, {})
    for _ in range(2):
        assert StoredPrograms(function, function, {}).find((jnp.ones(()),), {}) is None
    assert float(jax.tree.leaves(call(jnp.ones(())))[0]) == 1.0
    if function is checked:
        with pytest.raises((RuntimeError, ValueError), match="below zero"):  # by version
            call(-jnp.ones(()))


def test_errors_while_tracing_are_raised_and_nothing_is_stored(folder):
    with pytest.raises(AssertionError, match="though"):
        StoredPrograms(scaled, refuses, {}).find((jnp.ones(2), 1), {})
    assert not folder.exists()


def test_traced_calls_and_calls_by_others_are_left_alone(folder):
    def local(x):
        return x + 1

    assert StoredPrograms(local, local, {}).find((jnp.ones(2),), {}) is None
    assert StoredPrograms(refuses, refuses, {}).find((jnp.ones(2),), {}) is None
    call = Compiled(scaled, {})
    slope = jax.grad(lambda x: call(x, 1)[0].array.sum())(jnp.ones(2))
    assert np.array_equal(slope, [2.0, 2.0]) and not folder.exists()


def test_nothing_is_stored_unless_programs_are_kept(folder, monkeypatch):
    find = lambda: StoredPrograms(scaled, scaled, {}).find((jnp.ones(2), 1), {})
    monkeypatch.setattr(program_cache, "_kept", False)
    assert find() is None
    monkeypatch.setattr(program_cache, "_kept", True)
    for cache in (None, "gs://bucket/programs"):
        jax.config.update("jax_compilation_cache_dir", cache)
        assert find() is None
    assert not folder.exists()


def test_a_folder_that_cannot_be_written_does_no_harm(tmp_path, folder):
    folder.write_text("no folder")
    assert np.array_equal(
        StoredPrograms(scaled, scaled, {}).find((jnp.ones(2), 1), {})()[0].array, [2, 2]
    )


def test_shapes_are_remembered(folder):
    expected = eqx.filter_eval_shape(_modes.__wrapped__, *asked())
    compute = lambda: eqx.filter_eval_shape(_modes.__wrapped__, *asked())
    for one, _ in itertools.product((compute, refuses), range(2)):
        found = StoredPrograms(_modes.__wrapped__, refuses, QUICKLY).shapes(one, asked(), {})
        assert jax.tree.structure(found) == jax.tree.structure(expected)
        assert jax.tree.leaves(found) == jax.tree.leaves(expected)
