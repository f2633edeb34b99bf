"""Exports: read back by other means, they are the data they were written from."""

import csv
import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from systems import one_disc
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor.cli import app


SCENE = one_disc(mass=2.0, damping=3.0, stiffness=800.0, speed=15.0, eccentricity=1e-3)


def read_csv(path, like):
    """A table read to the last digit, which pandas does by default since version 3 only."""
    head, *rows = csv.reader(Path(path).read_text().splitlines())
    return pd.DataFrame(rows, columns=head).astype(dict(like.dtypes))


@pytest.fixture(scope="module")
def motion():
    return jr.simulate(SCENE, 2, 16, start=jr.AtRest(), at=0.5)


@pytest.fixture(scope="module")
def swept():
    axes = {"unbalance.eccentricity": [1e-3, 2e-3], "start.radius": [0.0, 1e-3]}
    return jr.sweep(SCENE, axes, start=jr.Whirl(1e-3), settle=1, keep=2, steps_per_revolution=16)


def test_table_of_a_motion(motion):
    found = jr.table(motion)
    assert list(found) == [
        *("time [s]", "angle [rad]"),
        *("displacement x at 0.5 m [m]", "displacement y at 0.5 m [m]"),
        *("velocity x at 0.5 m [m/s]", "velocity y at 0.5 m [m/s]"),
        *("slope x at 0.5 m [rad]", "slope y at 0.5 m [rad]"),
        *("speed [rad/s]", "acceleration [rad/s^2]"),
    ]
    np.testing.assert_array_equal(found["time [s]"], motion.time)
    z = np.asarray(motion.displacement)[:, 0]
    np.testing.assert_array_equal(found["displacement y at 0.5 m [m]"], z.imag)
    part = jr.table(jr.dataset(motion)[["displacement"]].isel(time=slice(3)))
    assert len(part) == 3 and "velocity x at 0.5 m [m/s]" not in part


def test_table_of_numbered_things(motion):
    """Limiters are told by their number, bearings by their name."""
    data = jr.dataset(motion)[["displacement"]].isel(time=slice(2))
    force = ("time", "limiter", "axis"), np.arange(8.0).reshape(2, 2, 2), {"units": "N"}
    load = ("time", "bearing"), np.ones((2, 1)), {"units": "N"}
    data = data.assign(contact_force=force, load=load).assign_coords(bearing=["supports.0"])
    found = jr.table(data)
    assert found["contact_force y of limiter 1 [N]"].tolist() == [3.0, 7.0]
    assert found["load of supports.0 [N]"].tolist() == [1.0, 1.0]


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_tables_come_back(motion, tmp_path, suffix):
    """They agree to the last bit, also as text."""
    path = tmp_path / f"orbit{suffix}"
    path.write_text("old")
    jr.export(motion, path)
    expected = jr.table(motion)
    read = read_csv(path, expected) if suffix == ".csv" else pd.read_parquet(path)
    pd.testing.assert_frame_equal(read, expected, rtol=1e-15, atol=0)
    assert [one.name for one in tmp_path.iterdir()] == [path.name]


def test_netcdf_of_a_motion(motion, tmp_path):
    path = tmp_path / "orbit.nc"
    jr.export(motion, path)
    with xr.open_dataset(path, engine="h5netcdf") as found:
        xr.testing.assert_identical(found.load(), jr.dataset(motion))
        assert str(jr.loads(found.attrs["scene"])) == str(SCENE)
        assert found["displacement"].attrs["units"] == "m"


def test_netcdf_of_a_sweep(swept, tmp_path):
    """Every variable and attribute comes back; values that NetCDF cannot hold are JSON."""
    path = tmp_path / "sweep.nc"
    odd = swept.assign_attrs(flag=True, nothing=None, pair=(1, 2), about={"a": 1})
    odd = odd.assign(good=swept["status"] == 0)
    jr.export(odd, path)
    with xr.open_dataset(path, engine="h5netcdf") as found:
        xr.testing.assert_equal(found.load(), odd)
        assert found["good"].dtype == bool
        for name, one in swept.variables.items():
            assert found[name].attrs.keys() == one.attrs.keys()
            assert found[name].attrs.get("units") == one.attrs.get("units")
        said = {name: found.attrs[name] for name in ("flag", "nothing", "about")}
        assert said == {"flag": "true", "nothing": "null", "about": '{"a": 1}'}
        assert found.attrs["pair"].tolist() == [1, 2]
        flags = found["status"].attrs["flag_values"]
        assert flags.tolist() == [0, 1, 2, 3, 4, 5, 6] and flags.dtype == found["status"].dtype
        assert found.attrs["scene"] == swept.attrs["scene"]
    assert odd.attrs["flag"] is True  # the data set itself is unchanged


def test_table_of_a_sweep(swept, tmp_path):
    """There is a row a lane, as xarray itself makes them from the numbers."""
    found = jr.table(swept)
    dims = list(swept["status"].dims)
    numbers = [n for n, one in swept.data_vars.items() if one.dims == swept["status"].dims]
    expected = swept[numbers].to_dataframe(dim_order=dims).reset_index()
    assert len(found) == swept["status"].size and (found["status"] == "ok").all()
    heads = {head.partition(" [")[0]: head for head in found.columns}
    for name in [*dims, *(n for n in numbers if n != "status")]:
        np.testing.assert_array_equal(found[heads[name]], expected[name])
        assert swept[name].attrs["units"] in ("1", heads[name].partition(" [")[2].rstrip("]"))
    assert not any("section" in head for head in heads)
    some = jr.table(swept.isel({"start.radius": 1}))  # the selected value is still a column
    rows = found[found["start.radius [m]"] == 1e-3].reset_index(drop=True)
    pd.testing.assert_frame_equal(some[found.columns], rows, check_exact=True)
    one = jr.table(swept.isel({"start.radius": 1, "unbalance.eccentricity": 0}))
    pd.testing.assert_frame_equal(one[found.columns], rows[:1], check_exact=True)
    jr.export(swept, tmp_path / "lanes.csv")
    pd.testing.assert_frame_equal(read_csv(tmp_path / "lanes.csv", found), found, check_exact=True)


def test_table_over_a_speed_or_a_map():
    """Data of commands have a row a point, as xarray itself makes them."""
    speeds = "speed", [1.0, 2.0, 4.0], {"units": "rad/s"}
    heights = np.arange(6.0).reshape(3, 2)
    line = xr.Dataset(
        {
            "amplitude": (("speed", "station"), heights, {"units": "m"}),
            "growth": ("speed", [3.0, 2.0, 1.0]),
        },
        {"speed": speeds, "station": [0.5, 1.0]},
    )
    found = jr.table(line)
    assert list(found) == [
        *("speed [rad/s]", "amplitude at 0.5 m [m]", "amplitude at 1 m [m]", "growth")
    ]
    np.testing.assert_array_equal(found.to_numpy(), np.c_[[1, 2, 4], heights, [3, 2, 1]])
    branches = jr.table(line.drop_vars("station").rename(station="branch"))
    assert list(branches)[1:3] == ["amplitude of branch 0 [m]", "amplitude of branch 1 [m]"]
    grid = xr.Dataset(
        {"growth": (("a.x", "a.y"), heights), "boundary": (("point", "parameter"), heights)},
        {"a.x": [1.0, 2.0, 3.0], "a.y": [5.0, 6.0], "parameter": ["a.x", "a.y"]},
    )
    expected = grid[["growth"]].to_dataframe().reset_index()
    pd.testing.assert_frame_equal(jr.table(grid), expected)
    runs = xr.Dataset({"error": ("run", [0.1, 0.2])}, {"method": ("run", ["a", "b"])})
    assert jr.table(runs).to_numpy().tolist() == [["a", 0.1], ["b", 0.2]]


def test_refusals(motion, swept, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="the data are single numbers"):
        jr.table(xr.Dataset({"mass": 1.0}))
    with pytest.raises(ValueError, match="ends in .csv, .parquet, .nc"):
        jr.export(motion, tmp_path / "orbit.xls")
    with pytest.raises(ValueError, match="cannot be written"):
        jr.export(motion, tmp_path / "none" / "orbit.csv")
    with monkeypatch.context() as patch:
        patch.setattr(importlib.util, "find_spec", lambda name: None)
        for suffix, needed in {"nc": "h5netcdf h5py", "parquet": "pyarrow"}.items():
            with pytest.raises(ValueError, match=f"needs the package .* `pip install {needed}`"):
                jr.export(motion, tmp_path / f"orbit.{suffix}")
    jr.export(motion, tmp_path / "orbit.csv")
    assert [one.name for one in tmp_path.iterdir()] == ["orbit.csv"]


def test_command(motion, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    jr.dataset(motion).to_zarr("run/response.zarr", zarr_format=2, consolidated=True)
    run = lambda *args: CliRunner().invoke(app, ["export", *args])
    assert run("run", "out/orbit.csv").exit_code == 0
    assert run("run/response.zarr", "orbit.nc").exit_code == 0
    pd.testing.assert_frame_equal(
        read_csv("out/orbit.csv", jr.table(motion)),
        jr.table(motion),
        check_like=True,
        rtol=1e-15,
    )
    with xr.open_dataset("orbit.nc", engine="h5netcdf") as found:
        xr.testing.assert_identical(found.load(), jr.dataset(motion))
    again = run("run", "out/orbit.csv")
    assert again.exit_code == 2 and "add --overwrite" in again.stderr
    assert run("run", "out/orbit.csv", "--overwrite").exit_code == 0
    assert "there are: none" in run("out", "a.csv").stderr
    assert "does not contain the data" in run("out/orbit.zarr", "a.csv").stderr
    assert not (tmp_path / "a.csv").exists()
