"""Fields for tables of numbers: checks, scene files, parameter paths."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import bare

import jaxrotor as jr
from jaxrotor.core.quantities import Series, series
from jaxrotor.files.toml import dumps, loads


class Table(eqx.Module):
    times: Series = series("times [s]", ascending=True)
    gains: Series | None = series("gains [1]", default=None)


def test_a_list_becomes_one_leaf_of_floats():
    table = Table([0, 1, 3], np.array([2, 1]))
    assert table.times.dtype == jnp.zeros(()).dtype and table.times.tolist() == [0.0, 1.0, 3.0]
    assert [leaf.shape for leaf in jax.tree.leaves(table)] == [(3,), (2,)]
    assert Table((0.0, 1.0)).gains is None


TWO = "`times [s]` must be a list of two or more finite numbers, but"
BAD = [
    (3.0, f"{TWO} has shape ()."),
    ([1.0], f"{TWO} has shape (1,)."),
    ([[0.0, 1.0], [2.0, 3.0]], f"{TWO} has shape (2, 2)."),
    ("0 1", f"{TWO} is '0 1'."),
    (None, f"{TWO} is None."),
    ([0.0, "a"], f"{TWO} is [0.0, 'a']."),
    ([0.0, [1.0]], f"{TWO} is [0.0, [1.0]]."),
    ([0.0, 1j], f"{TWO} is [0.0, 1j]."),
    ([0.0, np.nan], f"{TWO} is [0.0, nan]."),
    (
        [0.0, 2.0, 2.0],
        "`times [s]` must be ascending, each above the one before, but has 2 and then 2.",
    ),
    (
        [0.0, 2.0, 1.0],
        "`times [s]` must be ascending, each above the one before, but has 2 and then 1.",
    ),
]


@pytest.mark.parametrize(("value", "message"), BAD)
def test_each_mistake_has_one_sentence(value, message):
    with pytest.raises(ValueError) as caught:
        Table(value)
    assert str(caught.value) == message


def test_traced_tables_are_checked_when_they_run():
    build = eqx.filter_jit(lambda end: Table([0.0, end]).times)
    assert build(jnp.asarray(2.0)).tolist() == [0.0, 2.0]
    with pytest.raises(RuntimeError, match="must be ascending"):
        build(jnp.asarray(-2.0))
    with pytest.raises(RuntimeError, match="finite"):
        build(jnp.asarray(jnp.inf))
    with pytest.raises(ValueError, match=r"has shape \(\)"):
        jax.jit(lambda t: Table(t).times)(1.0)


# === scene files

HEAD = "[shaft]\nlength = 0.7\ndiameter = 0.02\n"
PROFILE = HEAD + '[spin]\nmodel = "profile"\ntimes = {}\nspeeds = {}\n'


def test_a_table_in_a_file_has_units_element_by_element():
    spin = loads(PROFILE.format('[0, "500 ms", "1 s"]', '["600 rpm", 1.0, "-2 rad/s"]')).spin
    assert type(spin) is jr.SpeedProfile
    assert spin.times.tolist() == [0.0, 0.5, 1.0]
    np.testing.assert_allclose(spin.speeds, [20 * np.pi, 1.0, -2.0], rtol=1e-15)


LIST = "spin.times must be a list of two or more numbers, but is"
ORDER = "`times [s]` must be ascending, each above the one before, but has"
MISTAKES = [
    ("3", "[0, 1]", f"{LIST} 3."),
    ('"0 : 1 : 3"', "[0, 1]", f"{LIST} '0 : 1 : 3'."),
    ("[0, 1, 1]", "[0, 1, 2]", f"spin: {ORDER} 1 and then 1."),
    (
        "[0, 1, 2]",
        "[0, 1]",
        "spin: `times` and `speeds` must be of one length, but have 3 and 2 numbers.",
    ),
    ("[0]", "[1]", f"spin: {TWO} has shape (1,)."),
    ('[0, "1 m"]', "[0, 1]", "spin.times.1 must be in s, but is '1 m'."),
    ("[0, [1]]", "[0, 1]", "spin.times.1 must be in s, but is [1]."),
    ("[0, inf]", "[0, 1]", "spin.times.1 must be in s and finite, but is inf."),
]


@pytest.mark.parametrize(("times", "speeds", "message"), MISTAKES)
def test_each_mistake_in_a_file_has_one_sentence(times, speeds, message):
    with pytest.raises(jr.SceneError) as caught:
        loads(PROFILE.format(times, speeds))
    assert str(caught.value) == f"<text>: {message}"


def test_a_table_is_written_to_the_last_bit():
    times, speeds = [0.0, 1 / 3, 0.1 + 0.2 + 1.0], [np.pi, -1e-17, 1e6 / 7]
    scene = eqx.tree_at(lambda s: s.spin, bare(), jr.SpeedProfile(times, speeds))
    again = loads(dumps(scene)).spin
    assert again.times.tolist() == times and again.speeds.tolist() == speeds
    assert "] # s\n" in dumps(scene) and "] # rad/s\n" in dumps(scene)
    with pytest.raises(jr.SceneError, match=r"spin.times cannot be written: it must be a list of"):
        jax.jit(lambda t: dumps(scene.put({"spin.times": t})))(jnp.asarray(times))


# === parameter paths


def profile():
    return jr.Scene(bare().shaft, spin=jr.SpeedProfile([0.0, 1.0, 2.0], [1.0, 2.0, 3.0]))


def test_a_path_names_the_whole_table():
    scene = profile()
    assert {"spin.times", "spin.speeds"} <= set(scene.paths())
    assert scene.unit("spin.speeds") == "rad/s"
    assert scene.get("spin.speeds").tolist() == [1.0, 2.0, 3.0]
    changed = scene.replace({"spin.speeds": [4.0, 5.0, 6.0]})
    assert changed.get("spin.speeds").tolist() == [4.0, 5.0, 6.0]
    longer = scene.replace({"spin.times": [0.0, 3.0], "spin.speeds": [1.0, 7.0]})
    assert longer.spin.turning(1.5).speed == 4.0
    put = scene.put({"spin.speeds": jnp.asarray([0.0, 0.0, 1.0])})
    assert put.spin.turning(1.5).speed == 0.5


def test_a_replaced_table_is_checked_with_its_partner():
    with pytest.raises(ValueError) as caught:
        profile().replace({"spin.speeds": [4.0, 5.0]})
    assert str(caught.value) == (
        "spin.speeds: `times` and `speeds` must be of one length, but have 3 and 2 numbers."
    )
    with pytest.raises(ValueError, match="spin.times: `times .s.` must be ascending"):
        profile().replace({"spin.times": [0.0, 2.0, 1.0]})
    with pytest.raises(ValueError, match=r"spin.times: .* has shape \(\)"):
        profile().replace({"spin.times": 1.0})


def test_derivatives_with_respect_to_a_replaced_table():
    scene, at = profile(), 1.5
    slope = jax.grad(lambda v: scene.replace({"spin.speeds": v}).spin.turning(at).angle)(
        jnp.asarray([1.0, 2.0, 3.0])
    )
    np.testing.assert_allclose(
        slope, [0.5, 0.5 + 0.375, 0.125], rtol=1e-14
    )  # areas of the hat functions
