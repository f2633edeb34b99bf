"""Stores keep what was computed, whatever happens, and end with the same data."""

import contextlib
import errno
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import Mock

import diffrax as dfx
import garbage
import numpy as np
import pytest
import xarray as xr
from systems import one_disc

import jaxrotor as jr
from jaxrotor.core.outcome import STATUS
from jaxrotor.core.program_cache import SETTINGS
from jaxrotor.sweeps.grid import block_shape, blocks
from jaxrotor.sweeps.store import PENDING, OtherSweepError, Store, StoreError


STOP = jr.Limiter(0.5, 0.0, gap=7e-3, stiffness=4e4)
# A mass that meets one stop: of a larger rotor, every process would compile larger programs.
ROTOR = one_disc(STOP, mass=10.0, damping=60.0, stiffness=1e5, speed=50.0, eccentricity=1e-4)
OVER = {"unbalance.eccentricity": np.linspace(0, 1e-3, 4), "start.angle": [0.0, 1.0, 2.0]}
HOW = {"start": jr.Whirl(7e-3, 75.0), "settle": 3, "keep": 2, "steps_per_revolution": 32}
HOW |= {"lanes_per_chunk": 3, "workers": 1, "error_sample": 0}


def swept(**options):
    return jr.sweep(ROTOR, OVER, **{**HOW, **options})


@pytest.fixture(scope="module")
def gathered():
    """The sweep in memory, with errors of two lanes."""
    return swept(error_sample=2)


@pytest.mark.parametrize("shape", [(1,), (7,), (256,), (64, 33), (3, 300), (5, 1, 4), (2, 3, 500)])
@pytest.mark.parametrize(("most", "workers"), [(128, 1), (128, 2), (1, 2), (6, 3)])
def test_blocks_cover_a_grid_once(shape, most, workers):
    block = block_shape(shape, most, workers)
    assert math.prod(block) <= most
    seen = np.zeros(shape, int)
    sizes = {str(axis): n for axis, n in enumerate(shape)}
    parts = blocks(sizes, block)
    for part in parts:
        seen[tuple(part[dim] for dim in sizes)] += 1
    assert (seen == 1).all() and len(parts) >= min(workers, math.prod(shape))


def test_one_axis_is_cut_evenly():
    assert block_shape((256,), 128, 2) == (128,) and block_shape((100,), 128, 2) == (50,)
    assert block_shape((300,), 128, 2) == (100,) and block_shape((64, 33), 128, 2) == (3, 33)


def test_store_is_what_memory_gathers(tmp_path, gathered):
    found = swept(error_sample=2, store=tmp_path / "a.zarr")
    xr.testing.assert_identical(found.load(), gathered)
    again = xr.open_zarr(tmp_path / "a.zarr", chunks=None).load()
    xr.testing.assert_identical(again, gathered)
    assert again["index"].attrs["error"] == gathered["index"].attrs["error"]
    assert again["unbalance.eccentricity"].attrs["units"] == "m"
    assert jr.loads(again.attrs["scene"]).get("limiters.gap") == ROTOR.get("limiters.gap")


@pytest.mark.slow
def test_carried_states_are_stored_alike(tmp_path):
    how = {"carry": "unbalance.eccentricity", "lanes_per_chunk": 2}
    inside = swept(**how)
    found = swept(**how, store=tmp_path / "a.zarr").load()
    xr.testing.assert_identical(found, inside)


def test_stopped_sweep_goes_on(tmp_path, gathered, monkeypatch):
    """An error stops it within the writing of a block; finished blocks stay as they are."""
    path = tmp_path / "a.zarr"
    put, count = Store.put, []

    def failing(self, block, part):
        count.append(1)
        if len(count) == 3:
            part = part[["index", "status"]].assign(
                missing=part["index"]
            )  # half of the block, then an error
        put(self, block, part)

    monkeypatch.setattr(Store, "put", failing)
    with pytest.raises(KeyError):
        swept(error_sample=2, store=path)
    monkeypatch.undo()
    partial = xr.open_zarr(path, chunks=None).load()
    done = partial["status"] != PENDING
    assert int(done.sum()) == 6 and STATUS[PENDING] == "not_computed"
    stamp = {p: p.stat().st_mtime_ns for p in path.glob("index/*")}
    found = swept(error_sample=2, store=path, lanes_per_chunk=12)  # keeps its chunks
    xr.testing.assert_identical(found.load(), gathered)
    kept = [p for p, at in stamp.items() if p.stat().st_mtime_ns == at and p.name[0].isdigit()]
    assert len(kept) == 2
    assert not list(tmp_path.glob(".begun-*"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"settle": 4}, r"holds another sweep: its `settle` is '3', not '4'"),
        ({"steps_per_revolution": 64}, "`steps_per_revolution` is '32', not '64'"),
        ({"start": jr.Whirl(8e-3, 75.0)}, "its `start` is"),
    ],
)
def test_another_sweep_is_refused(tmp_path, gathered, change, words):
    path = tmp_path / "a.zarr"
    gathered.to_zarr(path, zarr_format=2)
    with pytest.raises(ValueError, match=words):
        swept(store=path, **change)
    with pytest.raises(ValueError, match="over other values of `start.angle`"):
        jr.sweep(ROTOR, {**OVER, "start.angle": [0.0, 1.0, 2.5]}, **HOW, store=path)


@pytest.mark.slow
def test_every_setting_tells_a_sweep_from_another(tmp_path):
    """The same sweep is asked for with one setting changed at a time, some in the last digit."""
    scene = jr.load("limiter-rotor").with_nodes(3)
    scene = scene.replace({"spin.speed": 0.0, "unbalance.eccentricity": 0.0})
    solver, steps = dfx.Tsit5(), dfx.PIDController(rtol=1e-6, atol=1e-9)
    how = HOW | {"start": jr.Whirl(1.2345678901234567e-3), "period": 1e-3, "lanes_per_chunk": 1}
    how |= {"observe": [jr.observe.Extrema(3)], "solver": solver, "controller": steps, "at": 0.7}
    how |= {"settle": 0, "keep": 1}
    ask = lambda scene=scene, **more: jr.sweep(
        scene, {"limiters.gap": [7e-3]}, store=tmp_path / "a.zarr", **how | more
    )
    with np.printoptions(precision=3):
        ask()
    ask()  # the same, whatever the options of numpy
    mass = float(scene.get("disc.mass"))
    others = {
        "scene": [scene.replace({"disc.mass": np.nextafter(mass, np.inf)})],
        "start": [
            jr.Whirl(1.2345678901234569e-3),
            jr.Whirl(1.2345678901234567e-3, rate=5e-324),
            jr.Whirl(1.2345678901234567e-3, angle=1e-300),
            jr.AtRest(),
        ],
        "settle": [1],
        "keep": [2],
        "observe": [[jr.observe.Section()], [jr.observe.Extrema(4)], jr.observe.everything(True)],
        "steps_per_revolution": [33],
        "solver": [dfx.Tsit5(scan_kind="bounded"), dfx.Kvaerno3(), jr.Exponential(4)],
        "controller": [
            dfx.PIDController(rtol=np.nextafter(1e-6, 1), atol=1e-9),
            dfx.PIDController(rtol=1e-6, atol=np.nextafter(1e-9, 1)),
            dfx.PIDController(rtol=1e-6, atol=1e-9, pcoeff=0.1),
            None,
        ],
        "at": [0.69],
        "period": [1e-3 * (1 + 1e-15)],
        "max_steps": [4095],
        "nodes": [5],
    }
    for name, values in others.items():
        for other in values:
            with pytest.raises(OtherSweepError):
                ask(**{name: other})


@pytest.mark.slow
def test_carried_states_are_another_sweep(tmp_path):
    """So is a sweep without them, or over the same paths in another order."""
    carried = {"carry": "unbalance.eccentricity"}
    swept(**carried, store=tmp_path / "a.zarr")
    swept(store=tmp_path / "b.zarr")
    with pytest.raises(OtherSweepError, match="a sweep over `branch`, .* not over `unbalance"):
        swept(store=tmp_path / "a.zarr")
    with pytest.raises(OtherSweepError, match="not over `branch`"):
        swept(**carried, store=tmp_path / "b.zarr")
    with pytest.raises(OtherSweepError, match="not over `start.angle`, `unbalance.eccentricity`;"):
        jr.sweep(ROTOR, dict(reversed(OVER.items())), **HOW, store=tmp_path / "b.zarr")


def begun(path, whole, size=2, **other):
    """A store for the data, which no process has begun yet."""
    coords = {dim: (dim, whole[dim].values, whole[dim].attrs) for dim in OVER}
    sizes = {"unbalance.eccentricity": size, "start.angle": 3}
    return Store(path, coords, whole.attrs | other, sizes)


def test_begun_at_the_same_time(tmp_path, gathered):
    """Processes of the same sweep share the store; another sweep, or other blocks, are refused."""
    path = tmp_path / "a.zarr"
    first, same, other, coarse = (
        begun(path, gathered, **how) for how in ({}, {}, {"settle": 4}, {"size": 4})
    )
    todo = first.pending(blocks({dim: gathered.sizes[dim] for dim in OVER}, (2, 3)))
    part = gathered[NAMES].isel(todo[0])
    first.put(todo[0], part)
    with pytest.raises(OtherSweepError, match="its `settle` is '3', not '4'"):
        other.put(todo[1], gathered[NAMES].isel(todo[1]))
    with pytest.raises(StoreError, match="begun meanwhile by another run, in other blocks"):
        coarse.put(todo[0], part)
    same.put(todo[1], gathered[NAMES].isel(todo[1]))
    xr.testing.assert_equal(first.finished().load(), gathered[NAMES])


@pytest.mark.slow
def test_gone_while_the_sweep_runs(tmp_path, gathered, monkeypatch):
    path, put = tmp_path / "a.zarr", Store.put

    def moved(self, block, part):
        put(self, block, part)
        path.rename(tmp_path / "b.zarr")

    monkeypatch.setattr(Store, "put", moved)
    with pytest.raises(StoreError, match="a.zarr is gone: it was moved or deleted"):
        swept(store=path)
    assert os.listdir(tmp_path) == ["b.zarr"]
    path = tmp_path / "c.zarr"
    gathered.assign(status=0 * gathered["status"] + PENDING).to_zarr(path, zarr_format=2)
    monkeypatch.setattr(Store, "put", lambda *_: None)
    with pytest.raises(StoreError, match="was changed while the sweep ran, and lanes are missing"):
        swept(store=path)


@pytest.mark.slow
def test_killed_as_errors_are_written(tmp_path, gathered, monkeypatch):
    """No reader sees errors that are incomplete, and the same sweep ends as if never stopped."""
    path = tmp_path / "a.zarr"
    swept(error_sample=3, store=path)
    for owner, name in ((xr.Dataset, "to_zarr"), (shutil, "rmtree")):
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(owner, name, Mock(side_effect=KeyboardInterrupt))
            swept(error_sample=2, store=path)
        seen = xr.open_zarr(path, chunks=None).load()
        assert not [name for name in seen.variables if "error" in str(name)]
        xr.testing.assert_equal(seen, gathered[list(seen.data_vars)])
    found = swept(error_sample=2, store=path)
    xr.testing.assert_identical(found.load(), gathered)


def test_errors_of_every_observable():
    """Whole numbers have errors, too."""
    observe = [*jr.observe.everything(True), jr.observe.Reversal(), jr.observe.WhirlSpectrum()]
    found = swept(error_sample=2, observe=observe)
    assert np.isfinite(found["index_error"]).all() and "reversal_watched_error" not in found


def test_other_folders_are_refused(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").write_text("no store")
    for name in "ab":
        with pytest.raises(ValueError, match="exists and is no store of a sweep; choose another"):
            swept(store=tmp_path / name)
    assert (tmp_path / "b").read_text() == "no store"


# It loads the library once, and forks a process for every store that it is told; no program of jax
# has run before.
MOST_KILLS = 2
SCRIPT = (
    f"{garbage.CODE}\n"
    + """
import os, sys, numpy as np, xarray as xr, zarr, jaxrotor as jr, jaxrotor.sweeps.store
run, load, whirl = jr.sweep, jr.load, jr.Whirl
over = {"unbalance.eccentricity": np.linspace(0, 1e-3, 32), "start.angle": [0.0, 1.0, 2.0]}
how = {"settle": 3, "keep": 2, "steps_per_revolution": 32, "lanes_per_chunk": 3, "workers": 1}
how |= {"observe": [jr.observe.Section()], "error_sample": 0}
for line in sys.stdin:
    if child := os.fork():
        print("ended", os.waitpid(child, 0)[1], flush=True)
        continue
    print("begun", os.getpid(), flush=True)
    run(load(sys.argv[1]), over, start=whirl(7e-3, 75.0), **how, store=line.strip())
    os._exit(0)
"""
)


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="POSIX processes")
def test_killed_at_random_moments(tmp_path):
    """After `kill -9` again and again, every byte of the data is that of a run never killed."""
    random = np.random.default_rng(0)
    settings = {name.upper(): str(value) for name, value in SETTINGS.items()}
    environment = os.environ | settings | {"JAX_COMPILATION_CACHE_DIR": str(tmp_path / "cache")}
    jr.save(ROTOR, tmp_path / "rotor.toml")
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "rotor.toml")]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "bufsize": 1}

    def done(store):
        if not store.exists():
            return 0
        return int((xr.open_zarr(store, chunks=None)["status"] != PENDING).sum())

    with subprocess.Popen(command, env=environment, **pipes) as process:

        def begin(name):
            process.stdin.write(f"{tmp_path / name}\n")
            begun, child = process.stdout.readline().split()
            assert begun == "begun"
            return int(child)

        begin("whole.zarr")
        assert process.stdout.readline() == "ended 0\n"
        kills, status = 0, signal.SIGKILL
        while status == signal.SIGKILL:
            store = tmp_path / "killed.zarr"
            before, child = done(store), begin("killed.zarr")
            with contextlib.suppress(ProcessLookupError):  # it has ended
                while done(store) <= before:  # until it computes again
                    os.kill(child, 0)
                    time.sleep(0.02)
                if kills < MOST_KILLS:
                    time.sleep(random.uniform(0, 0.1))
                    os.kill(child, signal.SIGKILL)
            status = int(process.stdout.readline().split()[1])
            kills += status == signal.SIGKILL
            found = xr.open_zarr(store, chunks=None)  # a reader may look at any time
            computed = found["status"] != PENDING
            expected = xr.open_zarr(tmp_path / "whole.zarr", chunks=None)
            np.testing.assert_array_equal(
                found["section"].where(computed), expected["section"].where(computed)
            )
        assert status == 0 and kills == MOST_KILLS
        process.stdin.close()
    for path in (tmp_path / "whole.zarr").rglob("*"):
        if path.is_file():
            twin = tmp_path / "killed.zarr" / path.relative_to(tmp_path / "whole.zarr")
            assert twin.read_bytes() == path.read_bytes(), path


# === a disk that is full, or may not be written


NAMES = ["index", "status"]


def files_of(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def written_in_blocks(path, whole):
    """Write known data to a store as a sweep does."""
    store = begun(path, whole)
    for block in store.pending(blocks({dim: whole.sizes[dim] for dim in OVER}, (2, 3))):
        store.put(block, whole[NAMES].isel(block))
    about = {"index": {"error": whole["index"].attrs["error"]}}
    store.add(whole[["index_error", "error_lane"]], about)


@pytest.mark.slow
def test_disk_that_is_full_at_any_file(tmp_path, gathered, monkeypatch):
    """The disk may be full at any file: a store is whole or absent, finished blocks are right, and the
    next call ends with the bytes of a store that always had room."""
    opened, room = Path.open, [math.inf]

    def open_(self, mode="r", *args, **options):
        if "w" in mode:
            if room[0] <= 0:
                with opened(self, mode, *args, **options) as file:
                    file.write(b"half"[: 4 - len(mode)])
                raise OSError(errno.ENOSPC, "No space left on device")
            room[0] -= 1
        return opened(self, mode, *args, **options)

    monkeypatch.setattr(Path, "open", open_)
    room[0] = 1000
    written_in_blocks(tmp_path / "whole.zarr", gathered)
    whole, count = files_of(tmp_path / "whole.zarr"), 1000 - room[0]
    assert count > 20
    reached = set()
    for files in range(count):
        path, room[0] = tmp_path / f"{files}.zarr", files
        with pytest.raises(StoreError) as said:
            written_in_blocks(path, gathered)
        kept = "done blocks are kept in it, and the same sweep goes on from there"
        then = kept if path.exists() else "choose another place"
        assert str(said.value) == f"{path} cannot be written (No space left on device); {then}."
        assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
            ["whole.zarr"] + [path.name] * path.exists()
        )
        done = 0
        if path.exists():
            found = xr.open_zarr(path, chunks=None).load()
            there = found["status"] != PENDING
            xr.testing.assert_equal(found["index"].where(there), gathered["index"].where(there))
            done = int(there.sum())
        reached.add(done)
        room[0] = math.inf
        written_in_blocks(path, gathered)
        assert files_of(path) == whole
        shutil.rmtree(path)
    assert reached == {0, 6, 12}


@pytest.mark.parametrize("place", ["a/b.zarr", "/proc/jaxrotor/b.zarr"])
def test_place_where_nothing_can_be(tmp_path, monkeypatch, place):
    monkeypatch.chdir(tmp_path)
    Path("a").write_text("mine")
    if place.startswith("/proc") and not Path("/proc/self").exists():
        pytest.skip("there is no /proc")
    with pytest.raises(StoreError, match=r"^\S+ cannot be written \(.+\); choose another place.$"):
        swept(store=place)
    assert Path("a").read_text() == "mine" and os.listdir() == ["a"]


ON_A_SMALL_DISK = """
import json, os, subprocess, sys
import numpy as np, xarray as xr
from typer.testing import CliRunner
import jaxrotor as jr
from jaxrotor.cli import app
from jaxrotor.sweeps.store import StoreError

over = {"unbalance.eccentricity": np.linspace(0, 1e-3, 4), "start.angle": [0.0, 1.0, 2.0]}
how = dict(settle=3, keep=2, steps_per_revolution=32, lanes_per_chunk=3, workers=1, error_sample=2)
command = ["sweep", "rotor.toml", "--over", "start.angle=0:3:4", "--settle", "0", "--keep", "2",
           "--steps", "16", "--start-radius", "1mm", "--workers", "1", "--error-sample", "0", "--out"]
opened = lambda path: xr.open_zarr(path, chunks=None).load()
said = []

def swept(store):
    return jr.sweep(jr.load("rotor.toml"), over, start=jr.Whirl(7e-3, 75.0), **how, store=store)

def remounted(how):
    subprocess.run(["mount", "-o", "remount," + how, "disk"], check=True)

def refused():
    try:
        swept("disk/a.zarr")
    except StoreError as error:
        said.append(str(error))

def called(out="disk/run"):
    done = CliRunner().invoke(app, [*command, out])
    assert not done.stdout or done.exit_code == 0
    said.append([done.exit_code, done.stderr])

refused()
remounted("size=4m,ro")
refused(), called()
remounted("size=480k,rw")  # about as much as the command takes, less its picture
called()
assert os.listdir("disk/run") == ["sweep-partial.zarr"]
remounted("size=4m")
swept("disk/a.zarr")
called()
called("run")
xr.testing.assert_identical(opened("disk/run/sweep.zarr"), opened("run/sweep.zarr"))
print(json.dumps(said))
"""


@pytest.mark.long
def test_small_disk(tmp_path, gathered):
    """The store is on a file system that is full, then read-only, and then has room."""
    (tmp_path / "disk").mkdir()
    jr.save(ROTOR, tmp_path / "rotor.toml")
    mount = ["unshare", "-rm", "sh", "-c", 'mount -t tmpfs -o size=300k tmpfs disk && "$@"', "-"]
    try:
        subprocess.run([*mount, "true"], cwd=tmp_path, capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("A file system of one's own may not be mounted here.")
    copied = '"$@" && cp -r disk/a.zarr .'
    run = [sys.executable, "-c", ON_A_SMALL_DISK]
    command = [*mount[:4], mount[4].replace('"$@"', copied), "-", *run]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    kept = "; done blocks are kept in it, and the same sweep goes on from there."
    full, read_only = "(No space left on device)", "(Read-only file system)"
    another = "; choose another --out.\n"
    assert json.loads(done.stdout) == [
        f"disk/a.zarr cannot be written {full}{kept}",
        f"disk/a.zarr cannot be written {read_only}{kept}",
        [2, f"disk/run cannot be written {read_only}{another}"],
        [2, f"disk/run/sweep-partial.zarr cannot be written {full}{kept}\n"],
        [0, ""],
        [0, ""],
    ]
    xr.testing.assert_identical(xr.open_zarr(tmp_path / "a.zarr", chunks=None).load(), gathered)
