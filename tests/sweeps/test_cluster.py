"""Sweeps on a cluster give the data of a sweep by threads, even if workers are lost."""

import asyncio
import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import distributed
import numpy as np
import pytest
import xarray as xr
from distributed import Client, LocalCluster
from systems import one_disc
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor.cli import app
from jaxrotor.sweeps import cluster as module
from jaxrotor.sweeps.store import PENDING, Store, StoreError


STOP = jr.Limiter(0.5, 0.0, gap=7e-3, stiffness=4e4)
# A mass that meets one stop: of a larger rotor, every process would compile larger programs.
ROTOR = one_disc(STOP, mass=10.0, damping=60.0, stiffness=1e5, speed=50.0, eccentricity=1e-4)
OVER = {"unbalance.eccentricity": np.linspace(0, 1e-3, 24), "start.angle": [0.0, 1.0, 2.0]}
HOW = {"start": jr.Whirl(7e-3, 75.0), "settle": 2, "keep": 2, "steps_per_revolution": 32}
# Every process compiles them, too.
HOW |= {
    "lanes_per_chunk": 3,
    "error_sample": 0,
    "observe": [jr.observe.Precession(), jr.observe.Section()],
}


def swept(**options):
    return jr.sweep(ROTOR, OVER, **{**HOW, **options})


def files(store):
    return {p.relative_to(store): p.read_bytes() for p in Path(store).rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def dask():
    """A client of two worker processes."""
    how = {"threads_per_worker": 1, "dashboard_address": ":0"}
    with LocalCluster(n_workers=2, **how) as here, Client(here, set_as_default=False) as client:
        yield client


@pytest.fixture(scope="module")
def near():
    """A client of a worker in a thread of this process, for what needs no other process."""
    how = {"n_workers": 1, "processes": False, "protocol": "tcp", "dashboard_address": ":0"}
    with LocalCluster(**how) as here, Client(here, set_as_default=False) as client:
        yield client


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The store of the same sweep by threads of this process."""
    path = tmp_path_factory.mktemp("alone") / "a.zarr"
    swept(workers=2, store=path)
    return path


@pytest.mark.long
def test_store_is_that_of_threads(dask, alone, tmp_path, monkeypatch):
    """They agree byte for byte, and the workers write all: this process puts nothing."""
    monkeypatch.setattr(Store, "put", lambda *_: pytest.fail("put by the client"))
    monkeypatch.chdir(tmp_path)
    found = swept(cluster=dask, store="a.zarr")
    assert files("a.zarr") == files(alone) and os.listdir() == ["a.zarr"]
    assert not (found["status"] == PENDING).any()


@pytest.mark.slow
def test_without_a_store_the_data_come_here(dask):
    """So they do for a client with the address alone, and with errors by a second pass."""
    found = swept(cluster=dask.scheduler.address, error_sample=2)
    xr.testing.assert_identical(found, swept(workers=2, error_sample=2))


@pytest.mark.slow
def test_workers_that_do_not_see_the_folder_send_what_they_find(dask, alone, tmp_path, monkeypatch):
    @contextlib.contextmanager
    def unseen(sink):
        yield sink and (sink, tmp_path / "elsewhere")

    monkeypatch.setattr(module, "_shared_folder", unseen)
    swept(cluster=dask, store=tmp_path / "a.zarr")
    assert files(tmp_path / "a.zarr") == files(alone)


@pytest.mark.slow
def test_carried_states(dask, tmp_path):
    over = {"unbalance.eccentricity": [1e-4, 5e-4], "start.angle": np.arange(6.0)}
    for name, where in (("a.zarr", {"cluster": dask}), ("b.zarr", {"workers": 2})):
        store = tmp_path / name
        jr.sweep(ROTOR, over, carry="unbalance.eccentricity", **HOW, **where, store=store)
    assert files(tmp_path / "a.zarr") == files(tmp_path / "b.zarr")


@pytest.mark.slow
def test_what_is_installed_must_be_the_same(dask, monkeypatch):
    monkeypatch.setattr(module, "_installed", lambda: "jaxrotor 0.0")
    with pytest.raises(
        RuntimeError, match="has jaxrotor .*, but this process jaxrotor 0.0; install"
    ):
        swept(cluster=dask)


@pytest.mark.slow
def test_processes_of_this_machine(alone):
    """They are started for a sweep, and have ended after it."""
    before = set(multiprocessing.active_children())
    xr.testing.assert_identical(swept(cluster=1), xr.open_zarr(alone, chunks=None).load())
    assert not set(multiprocessing.active_children()) - before


def test_command(near, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    jr.save(ROTOR, "rotor.toml")
    command = ["sweep", "rotor.toml", "--over", "unbalance.eccentricity=1e-4:1e-3:6"]
    command += ["--settle", "2", "--keep", "2", "--steps", "32", "--error-sample", "0"]
    result = CliRunner().invoke(app, [*command, "--cluster", near.scheduler.address, "--out", "a"])
    assert result.exit_code == 0, result.stderr
    assert sorted(os.listdir("a")) == ["bifurcation.png", "sweep.zarr"]
    assert (xr.open_zarr("a/sweep.zarr", chunks=None)["status"] == 0).all()
    text = CliRunner().invoke(app, [*command, "--cluster", "1", "--workers", "1"]).stderr
    assert "leave them out" in text


# === refusals


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "http://127.0.0.1:9", ""])
def test_no_scheduler(address, monkeypatch):
    monkeypatch.setattr(module, "CONNECTION_TIME", 0.5)
    with pytest.raises(ValueError, match="No Dask scheduler answers at .* give the address that"):
        swept(cluster=address)


@pytest.mark.slow
def test_an_address_in_a_notebook(dask):
    """There an event loop runs already."""

    async def cell():
        return swept(cluster=dask.scheduler.address)

    xr.testing.assert_identical(asyncio.run(cell()), swept(workers=2))


def test_a_folder_that_cannot_be(near, tmp_path):
    (tmp_path / "a").write_text("mine")
    with pytest.raises(StoreError, match=r"cannot be written \(.+\); choose another place.$"):
        swept(cluster=near, store=tmp_path / "a" / "b.zarr")
    assert (tmp_path / "a").read_text() == "mine" and os.listdir(tmp_path) == ["a"]


def test_no_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match=r"`pip install distributed`"):
        swept(cluster=2)


def test_either_threads_or_a_cluster():
    with pytest.raises(ValueError, match="with a `cluster` leave them out"):
        swept(cluster=2, workers=2)
    with pytest.raises(ValueError, match="`cluster` must be"):
        swept(cluster=0)


def test_a_script_without_a_guard(monkeypatch):
    """Worker processes import the script, which would start workers again; Python refuses that."""

    def failing(**_):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr(distributed, "LocalCluster", failing)
    with pytest.raises(RuntimeError, match="below `if __name__ == '__main__':`"):
        swept(cluster=2)


def test_dask_is_imported_when_it_is_asked_for():
    code = "import sys, jaxrotor, jaxrotor.cli; print({'dask', 'distributed'} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "set()\n"


@pytest.mark.slow
def test_two_processes_begin_one_store(tmp_path, alone):
    part = xr.open_zarr(alone, chunks=None).load()
    place = ({"start.angle": ("start.angle", part["start.angle"].values, {})}, {"a": 1})
    one, other = (Store(tmp_path / "a.zarr", *place, {"start.angle": 1}) for _ in range(2))
    one._begin(part[["status"]])
    seen = files(tmp_path / "a.zarr")
    other._begin(part[["status"]])
    assert files(tmp_path / "a.zarr") == seen and os.listdir(tmp_path) == ["a.zarr"]


# === losses


@pytest.mark.slow
def test_a_worker_is_killed(dask, alone, tmp_path):
    """After `kill -9` of one of two workers others run its chunks; every byte is the same."""
    store = tmp_path / "a.zarr"
    before = dask.run(os.getpid)
    run = threading.Thread(target=swept, kwargs={"cluster": dask, "store": store})
    run.start()
    while run.is_alive() and not list(store.glob("status/[0-9]*")):
        time.sleep(0.01)
    while (xr.open_zarr(store, chunks=None)["status"] == PENDING).all():
        time.sleep(0.01)
    assert run.is_alive()
    os.kill(before.popitem()[1], signal.SIGKILL)
    run.join(200)
    assert not run.is_alive() and files(store) == files(alone)


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_ctrl_c_keeps_what_is_done(tmp_path, monkeypatch):
    """Sent to every process, as a terminal does, it leaves none, and the command can resume later."""
    monkeypatch.chdir(tmp_path)
    over = ["--over", "unbalance.eccentricity=0:1mm:640", "--steps", "64", "--keep", "8"]
    jr.save(ROTOR, "rotor.toml")
    small = ["sweep", "rotor.toml", *over, "--settle", "200", "--out", "run"]
    process = subprocess.Popen(
        [sys.executable, "-m", "jaxrotor", *small, "--cluster", "2"],
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True},
        start_new_session=True,
    )
    partial = tmp_path / "run" / "sweep-partial.zarr"
    while process.poll() is None and not list(partial.glob("status/[0-9]*")):
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130 and not out, err
    done = int((xr.open_zarr(partial, chunks=None)["status"] != PENDING).sum())
    assert 0 < done < 640 and len(err.splitlines()) == 1
    assert f"{done} of 640 lanes are kept in {partial.relative_to(tmp_path)}" in err
    until = time.monotonic() + 30
    with pytest.raises(ProcessLookupError):
        while time.monotonic() < until:
            os.killpg(process.pid, 0)
            time.sleep(0.1)
    found = CliRunner().invoke(app, [*small, "--workers", "2", "--json"])
    assert found.exit_code == 0 and sorted(os.listdir("run")) == ["bifurcation.png", "sweep.zarr"]
    assert not (xr.open_zarr("run/sweep.zarr")["status"] == PENDING).any()


@pytest.mark.slow
def test_a_chunk_that_kills_every_worker(dask, monkeypatch):
    """The last test that has a worker: none is started again for another."""
    monkeypatch.setattr(dask.cluster.scheduler, "allowed_failures", 0)
    with pytest.raises(RuntimeError, match="1 worker processes died over the same chunk"):
        module.Workers(dask).each(deadly, [0], lambda _: None)


def deadly(chunk, tick):
    os._exit(1)


@pytest.mark.slow
def test_a_cluster_that_goes():
    with LocalCluster(n_workers=1, processes=False, dashboard_address=":0") as here:
        client = Client(here, set_as_default=False)
        leave = threading.Timer(0.5, client.close)
        leave.start()
        with pytest.raises(RuntimeError, match="The cluster has gone"):
            module.Workers(client).each(slow, [0], lambda _: None)
        leave.join()


def slow(chunk, tick):
    time.sleep(2)
