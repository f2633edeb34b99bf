"""Attractors: their numbers follow motions as parameters change; basins over two starting parameters."""

import numpy as np
import pytest
import xarray as xr

import jaxrotor as jr
import jaxrotor.plot


def made(features, **dims):
    """A data set like that of a sweep, with one number a lane."""
    shape = tuple(len(values) for values in dims.values())
    names = {name.replace("__", "."): values for name, values in dims.items()}
    variables = {name: (tuple(names), np.reshape(v, shape)) for name, v in features.items()}
    variables["status"] = (tuple(names), np.zeros(shape, np.int8))
    return xr.Dataset(variables, names)


def test_numbers_follow_attractors_that_cross():
    """Two branches cross in one feature and differ in the other; a third begins late."""
    x = np.linspace(0.0, 1.0, 21)
    first, second, third = x, 1 - x, np.full_like(x, 3.0)
    rate = np.stack([first, second, np.where(x > 0.6, third, first)], axis=1)
    radius = np.stack([0 * x, 0 * x + 1, 0 * x], axis=1)
    dataset = made({"rate": rate, "radius": radius}, spin__speed=x, start__angle=[0.0, 1.0, 2.0])
    found = jr.attractors(dataset, ["rate", "radius"])["attractor"]
    assert (found[:, 0] == 0).all() and (found[:, 1] == 1).all()
    assert (found[:, 2] == np.where(x > 0.6, 2, 0)).all()
    assert np.allclose(found.attrs["means"][0], [np.mean([*first, *first[x <= 0.6]]), 0])
    assert "attractor" not in dataset


def test_numbers_are_kept_around_every_corner_of_a_grid():
    """A branch that climbs along two parameters is one attractor, though its ends are far apart."""
    x, y = np.meshgrid(np.linspace(0, 1, 15), np.linspace(0, 1, 12), indexing="ij")
    rate = np.stack([x + 2 * y, -4 - x], axis=-1)
    dims = {"a__x": np.arange(15.0), "a__y": np.arange(12.0), "start__rate": [0.0, 1.0]}
    found = jr.attractors(made({"rate": rate}, **dims), ["rate"])["attractor"]
    assert (found[..., 0] == found[0, 0, 0]).all() and (found[..., 1] == found[0, 0, 1]).all()
    assert found[0, 0, 0] != found[0, 0, 1]


def test_failed_lanes_are_in_none():
    dataset = made({"rate": [1.0, np.nan, 1.0, np.nan]}, start__angle=np.arange(4.0))
    dataset["status"][1] = 1  # not finite
    found = jr.attractors(dataset, ["rate"])["attractor"].values
    assert found[1] == -1 and found[0] == found[2] and found[3] != found[0]


def test_motions_of_different_whirl_are_never_one():
    """Section 3.4: forward bouncing in one cell, the locked rub in the next, whip in both."""
    rate = [[-1.513, 0.118], [-1.513, -0.5]]
    dataset = made({"rate": rate}, a__x=[0.0, 1.0], start__rate=[0.0, 1.0])
    found = jr.attractors(dataset, ["rate"])["attractor"].values
    assert found[0, 0] == found[1, 0] == 0 and found[0, 1] != found[1, 1]


def test_numbers_of_another_sweep_are_kept():
    """The rare attractor of a first sweep is the commonest of the next; a new one gets the next number."""
    first = made({"rate": [1.0, 1.0, 2.0]}, start__angle=np.arange(3.0))
    first = jr.attractors(first, ["rate"])
    then = made({"rate": [2.01, 0.5, 2.0, 2.02]}, start__angle=np.arange(4.0))
    found = jr.attractors(then, ["rate"], within=0.05, like=first)["attractor"]
    assert found.values.tolist() == [1, 2, 1, 1]
    assert found.attrs["means"][0] == [1.0] and found.attrs["means"][2] == [0.5]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"features": []}, "at least one variable, but is empty"),
        ({"features": ["colour"]}, "The dataset has no `colour`; choose `features` of rate"),
        ({"features": ["rate"], "within": 0.0}, "`within` must be above 0"),
        ({"features": ["rate"], "apart": 0.01}, "`apart` not below it"),
        ({"features": ["rate"], "like": made({}, start__angle=[0.0])}, "`like` must be a result"),
    ],
)
def test_refusals(given, words):
    with pytest.raises(ValueError, match=words):
        jr.attractors(made({"rate": [1.0]}, start__angle=[0.0]), **given)


@pytest.fixture(scope="module")
def starts():
    """Starts of the limiter rotor without unbalance, over radius and rate."""
    scene = jr.load("limiter-rotor").replace({"unbalance.eccentricity": 0.0})
    over = {"start.radius": [1e-3, 8.4e-3, 70e-3], "start.rate": [-795.0, -441.0, 75.0]}
    run = {"settle": 300, "keep": 100, "steps_per_revolution": 128, "error_sample": 0}
    return jr.sweep(scene, over, start=jr.Whirl(1e-3), **run)


@pytest.mark.slow
def test_three_attractors_of_the_sheet(starts):
    """Section 3.4: whirl rates of forward bouncing, backward rub and violent whip."""
    found = jr.attractors(starts, ["whirl_rate", "radius_max"])["attractor"]
    assert sorted(np.unique(found)) == [0, 1, 2]
    whirls = [mean[0] for mean in found.attrs["means"]]
    assert sorted(whirls) == pytest.approx([-1.513, -0.5676, 0.118], abs=5e-3)
    at = dict(zip(["whip", "rub", "forward"], np.argsort(whirls), strict=True))
    assert found.sel({"start.radius": 70e-3, "start.rate": -795.0}) == at["whip"]
    assert found.sel({"start.radius": 8.4e-3, "start.rate": -441.0}) == at["rub"]
    assert found.sel({"start.radius": 1e-3, "start.rate": 75.0}) == at["forward"]


def test_picture():
    radii, rates = np.array([1e-3, 8.4e-3, 70e-3]), np.array([-795.0, -441.0, 75.0])
    whirl = np.array([[-1.513, -0.568, 0.118], [-1.513, -0.568, 0.118], [-1.513, -0.568, -0.568]])
    dataset = made({"whirl_rate": whirl}, start__radius=radii, start__rate=rates)
    dataset["start.radius"].attrs["units"], dataset["start.rate"].attrs["units"] = "m", "rad/s"
    ax = jr.plot.attractors(jr.attractors(dataset, ["whirl_rate"]))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("start radius [mm]", "start rate [rad/s]")
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert len(names) == 3 and any("-0.568" in name for name in names)


@pytest.mark.slow
def test_diagram_is_coloured_by_attractor(starts):
    """Starts are drawn at the same value: a start is no parameter."""
    dataset = starts.rename({"start.rate": "limiters.stiffness"})
    upper, lower = jr.plot.bifurcation(
        jr.attractors(dataset, ["whirl_rate", "radius_max"], apart=2.0)
    )
    names = [text.get_text() for text in upper.get_legend().get_texts()]
    assert all(name.startswith(("whirl rate", "clearance")) for name in names)
    assert sum(line.get_xdata().size for line in lower.get_lines()[:-1]) == 9
