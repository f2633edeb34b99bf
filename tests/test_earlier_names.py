"""Files of earlier versions can be read: names of modules, pickles, stores of sweeps."""

import importlib
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import jaxrotor as jr
from jaxrotor.earlier_names import EARLIER
from jaxrotor.sweeps.store import OtherSweepError


# Written by the version of 2026-11-24, before modules were in folders: two revolutions of the
# limiter rotor from `Whirl(12e-3, -441.0)` with the last kept, 8 samples each; a run-up of the ball
# balancer; reactions of the turbine; a sweep of two eccentricities and two starting radii into a store.
EARLIER_RESULTS = Path(__file__).parent / "earlier"


@pytest.mark.parametrize("name", EARLIER)
def test_earlier_modules_are_found(name):
    module = importlib.import_module(f"jaxrotor.{name}")
    places = [importlib.import_module(f"jaxrotor.{place}") for place in EARLIER[name]]
    for place in places:
        for known, value in vars(place).items():
            if isinstance(value, type) and value.__module__ == place.__name__:
                assert getattr(module, known) is value
    assert not hasattr(module, "nothing_of_this_name")


def test_an_earlier_module_hides_no_function():
    importlib.import_module("jaxrotor.sweep")
    assert callable(jr.sweep) and callable(jr.simulate) and callable(jr.balancer.lag_whirl)


def test_earlier_pickles_are_read():
    found = pickle.loads((EARLIER_RESULTS / "results.pickle").read_bytes())
    assert isinstance(found["response"], jr.Response) and isinstance(found["run_up"], jr.RunUp)
    np.testing.assert_allclose(found["scene"].get("limiters.gap"), 7.5e-3)
    again = jr.simulate(found["scene"], 2, 8, start=jr.Whirl(12e-3, -441.0), keep=1)
    # The equations of a shaft held at every node then, and erred by some 1e-5 with eight of them.
    np.testing.assert_allclose(found["response"].displacement, again.displacement, rtol=1e-4)
    assert jr.dataset(found["reactions"])["force"].dims == ("time", "bearing", "axis")
    assert found["modes"].values.shape == (2,)


@pytest.fixture
def earlier_store(tmp_path):
    shutil.unpack_archive(EARLIER_RESULTS / "sweep.zarr.zip", tmp_path / "sweep.zarr")
    return tmp_path / "sweep.zarr"


def test_a_store_of_before_is_read_and_its_motions_run_again(earlier_store):
    dataset = xr.open_zarr(earlier_store, consolidated=False)
    assert dataset.sizes["start.radius"] == 2
    lane = dataset.isel({"unbalance.eccentricity": 1, "start.radius": [1]})
    shown = jr.plot.explore(lane)
    shown.show(0)
    radius = np.abs(np.asarray(shown.response.displacement)).max()
    extrema = lane["extrema"].values
    assert radius == pytest.approx(np.nanmax(np.abs(extrema)), rel=0.2)


def test_a_store_of_before_is_not_continued(earlier_store):
    """Its settings are printed texts, which count as those of another sweep; nothing is written."""
    dataset = xr.open_zarr(earlier_store, chunks=None)
    over = {path: dataset[path].values for path in ("unbalance.eccentricity", "start.radius")}
    run = {"start": jr.Whirl(1e-3, -441.0), "settle": 1, "keep": 2, "steps_per_revolution": 8}
    before = {path: path.stat().st_mtime_ns for path in earlier_store.rglob("*")}
    with pytest.raises(
        OtherSweepError, match=r"another sweep: its `start` is 'Whirl\(.*, not '\{\"class"
    ):
        jr.sweep(jr.loads(dataset.attrs["scene"]), over, **run, store=earlier_store)
    assert {path: path.stat().st_mtime_ns for path in earlier_store.rglob("*")} == before
