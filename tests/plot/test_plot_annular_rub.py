"""Plots of rubs in a ring: what is drawn, and where."""

import jax.numpy as jnp
import numpy as np
import pytest
from drawn import check_axes, legend, lines

import jaxrotor as jr
from jaxrotor import plot


pytestmark = pytest.mark.usefixtures("rendered")

NAN = np.nan


def rub() -> jr.AnnularRub:
    """Six speeds, with contact from 1.5 on and a second branch from 3.5 to a fold at 5.5."""
    radius = [[NAN, NAN], [3, NAN], [4, NAN], [5, 2.5], [6, 3.5], [NAN, NAN]]
    growth = [[NAN, NAN], [-1, NAN], [-1, NAN], [1, 1], [1, 1], [NAN, NAN]]
    speeds = np.arange(1.0, 7.0)
    ends = {"onsets": [1.5, 3.5], "folds": [5.5], "fold_radius": [5e-3]}
    return jr.AnnularRub(
        speeds=jnp.asarray(speeds),
        rates=jnp.asarray(speeds),
        gap=jnp.asarray(2e-3),
        free=1e-3 * jnp.array([1.0, 3.0, 2.5, 1.5, 1.2, 1.1]) + 0j,
        free_growth=jnp.full(6, -1.0),
        normal_force=1e3 * jnp.array(radius),
        displacement=1e-3 * jnp.array(radius) * jnp.exp(0.3j),
        roots=jnp.array(growth)[..., None] + 2j,
        coordinates=jnp.array(radius)[..., None] + 0j,
        **{name: jnp.array(value) for name, value in ends.items()},
    )


def goes_through(line, points) -> bool:
    """Whether these points are all that is drawn of a line."""
    drawn = np.transpose(line.get_data())
    drawn = drawn[np.isfinite(drawn[:, 1])]
    return drawn.shape == np.shape(points) and bool(np.allclose(drawn, points))


def test_lines_run_from_onsets_to_the_fold():
    ax = plot.annular_rub(rub())
    named = lines(ax)
    stable = [(1.5, 2.0), (2.0, 3.0), (3.0, 4.0)]
    assert goes_through(named["full rub, stable"], stable)
    upper = [(4.0, 5.0), (5.0, 6.0), (5.5, 5.0)]
    assert goes_through(named["full rub, unstable"], upper)
    lower = [(3.5, 2.0), (4.0, 2.5), (5.0, 3.5), (5.5, 5.0)]
    assert any(goes_through(line, lower) for line in ax.lines)
    free = [(1.0, 1.0), (1.5, 2.0), (3.5, 2.0), (4.0, 1.5), (5.0, 1.2), (6.0, 1.1)]
    assert goes_through(named["free, stable"], free)
    assert goes_through(named["fold"], [(5.5, 5.0)])
    assert goes_through(named["onset of contact"], [(1.5, 2.0), (3.5, 2.0)])
    assert ax.get_ylabel() == "radius at the ring [mm]"


def whirls() -> jr.DryWhirlMap:
    rolls = np.array([[0, 0, 1], [0, 1, 1]], bool)
    slips = np.array([[0, 0, 0], [0, 0, 1]], bool)
    exists = np.array([[0, 1, 1], [0, 1, 1]], bool)
    parts = (rolls, slips, exists, np.where(rolls, -3.0, NAN), np.array([0.1, 0.2]))
    speeds, frictions = jnp.array([1.0, 2.0]), jnp.array([0.0, 0.2, 0.4])
    return jr.DryWhirlMap(speeds, frictions, *map(jnp.asarray, parts))


def test_a_map_shows_what_kind_of_whirl_there_is():
    ax = plot.dry_whirl(whirls())
    (mesh,) = ax.collections
    assert np.asarray(mesh.get_array()).tolist() == [[0, 0], [1, 2], [2, 4]]
    names = ["none", "unstable alone", "rim rolls", "rolls or slips", "least friction"]
    assert sorted(legend(ax)) == sorted(names)
    np.testing.assert_allclose(lines(ax)["least friction"].get_ydata(), [0.1, 0.2])


@pytest.mark.parametrize(
    "draw",
    [lambda ax: plot.annular_rub(rub(), ax=ax), lambda ax: plot.dry_whirl(whirls(), ax=ax)],
    ids=["annular_rub", "dry_whirl"],
)
def test_draws_in_given_axes_or_a_figure_of_its_own(draw):
    check_axes(draw)


def test_speeds_in_revolutions_per_minute():
    plain = plot.annular_rub(rub())
    with plot.units(speed="rpm"):
        chosen = plot.annular_rub(rub())
    assert chosen.get_xlabel() == "spin speed [rpm]"
    assert chosen.get_xlim() == pytest.approx(np.array(plain.get_xlim()) * 30 / np.pi)
    for name in ("free, stable", "full rub, stable", "onset of contact", "fold"):
        (before,), (after,) = (
            [line for line in ax.lines if line.get_label() == name] for ax in (plain, chosen)
        )
        np.testing.assert_allclose(after.get_xdata(), np.array(before.get_xdata()) * 30 / np.pi)
