"""A store of a sweep that an earlier version wrote: it is read, shown, and not continued."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import jaxrotor as jr
from jaxrotor.sweeps.store import OtherSweepError


EARLIER_STORE = Path(__file__).parents[1] / "earlier" / "sweep.zarr.zip"


@pytest.fixture
def earlier_store(tmp_path):
    shutil.unpack_archive(EARLIER_STORE, tmp_path / "sweep.zarr")
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
