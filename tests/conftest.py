"""Settings every test runs under: double precision, and pictures without a window."""

import os
import signal
from pathlib import Path

import flags


os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as jaxrotor itself sets, before jax loads it
# Compiling programs is most of what tests cost, so they are compiled without optimisation. Processes
# that tests start do the same.
os.environ.setdefault("XLA_FLAGS", flags.FLAGS)

import durations  # noqa: E402
import garbage  # noqa: E402
import jax  # noqa: E402
import pytest  # noqa: E402
from hard import table  # noqa: E402


jax.config.update("jax_enable_x64", True)

# A shell starts `pytest &` with interrupts ignored, and a process inherits that: so would those that
# tests start to interrupt them.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    parser.addoption("--all", action="store_true", help="run the slow and the long tests, too")
    parser.addoption("--hard-table", metavar="FILE", help="write the table of hard cases there")
    parser.addoption("--pictures", action="store_true", help="draw pictures of pages anew")
    parser.addoption(
        "--durations-table", metavar="FILE", help="write what files of tests cost there"
    )


def pytest_configure(config):
    worker = hasattr(config, "workerinput")
    if (path := config.getoption("--hard-table")) and not worker:
        config.pluginmanager.register(table.HardTable(path))
    if path := config.getoption("--durations-table"):
        config.pluginmanager.register(durations.Meter())
        if not worker:
            config.pluginmanager.register(durations.Table(path))


LATER = ("slow", "long")  # tiers after the first
LONGEST = (  # see benchmarks/durations.md
    "test_docs test_notebooks test_designs test_stepped test_periodic test_continuation "
    "test_hazards test_cluster test_limiter_rotor test_massless_coordinates test_fit "
    "test_sweep test_unequal_axes test_store test_accuracy test_one_sided test_annular_rub "
    "test_any_scene test_cli test_time test_run_up test_oil_whirl test_shafts "
    "test_ball_balancer test_rotorbench test_speed_tables test_payonly test_integrated_lanes "
    "test_trapezoid test_annular_stator test_runs test_casing test_curves test_resolution "
    "test_reactions"
)


def pytest_collection_modifyitems(config, items):
    """Leave out slow and long tests, unless they are asked for: by `--all`, `-m`, `-k` or their names.

    Files that take long come first, so that no process is left with one of them at the end.
    """
    place = {name: number for number, name in enumerate(LONGEST.split())}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))
    asked = config.getoption("--all") or config.getoption("-m") or config.getoption("-k")
    if asked or any("::" in name for name in config.args):
        return
    later = [item for item in items if any(map(item.get_closest_marker, LATER))]
    config.hook.pytest_deselected(items=later)
    left = set(later)
    items[:] = [item for item in items if item not in left]


def pytest_collection_finish():
    garbage.collect_rarely()


def pytest_itemcollected(item):
    """Into the report, which travels from a worker to where the table is written."""
    item.user_properties += [("hard", table.case_of(mark)) for mark in item.iter_markers("hard")]


@pytest.fixture(scope="module", autouse=True)
def forget_programs():
    """Every compiled program holds memory maps, of which a process may have 65530."""
    yield
    maps = Path("/proc/self/maps")
    if not maps.exists() or len(maps.read_bytes().splitlines()) > 40_000:
        jax.clear_caches()


@pytest.fixture
def rendered():
    """Every figure that a test leaves must draw, and no test leaves a figure or a setting behind."""
    import matplotlib.pyplot as plt

    settings = dict(plt.rcParams)
    yield
    for number in plt.get_fignums():
        plt.figure(number).canvas.draw()
    plt.close("all")
    assert dict(plt.rcParams) == settings
