"""Commands `simulate` and `sweep` of scenes whose speed varies, or with balls."""

import pytest
import xarray as xr
from typer.testing import CliRunner

from jaxrotor.cli import app


def run(*words):
    return CliRunner().invoke(app, list(map(str, words)))


def test_simulate_a_drive(tmp_path):
    """A rigid shaft in two pins: its speed changes, and its axis stays."""
    result = run("simulate", "turbine-run-up", "--times", "0:0.1s:33", "--out", tmp_path / "o")
    assert result.exit_code == 0, result.output
    assert "Motion from 600 to" in result.stdout and "cannot move" in result.stdout
    data = xr.open_zarr(tmp_path / "o" / "response.zarr", consolidated=False)
    assert data.sizes["time"] == 33 and float(data.speed[0]) == 600.0
    refused = run("simulate", "turbine-run-up", "--keep", "3")
    assert refused.exit_code == 2 and "--keep is for whole revolutions" in refused.stderr


@pytest.mark.long
def test_sweep_starts_of_balls(tmp_path):
    words = ("--over", "start.balls.0.angle.0=0deg,90deg", "--times", "0:0.2s:65", "--at", "0.14m")
    result = run("sweep", "ball-balancer-light", *words, "--out", tmp_path / "o")
    assert result.exit_code == 0, result.output
    data = xr.open_zarr(tmp_path / "o" / "sweep.zarr", consolidated=False)
    assert data["start.balls.0.angle.0"].values.tolist() == pytest.approx([0.0, 1.5707963])
    assert (data.peak > 0).all() and float(data.imbalance[0]) != float(data.imbalance[1])
