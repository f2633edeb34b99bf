"""Settings every test runs under: double precision, and pictures without a window."""

import os


os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as jaxrotor itself sets, before jax loads it

import jax  # noqa: E402
import pytest  # noqa: E402
from hard import table  # noqa: E402


jax.config.update("jax_enable_x64", True)


def pytest_addoption(parser):
    parser.addoption("--hard-table", metavar="FILE", help="write the table of hard cases there")


def pytest_configure(config):
    path, worker = config.getoption("--hard-table"), hasattr(config, "workerinput")
    if path and not worker:
        config.pluginmanager.register(table.HardTable(path))


def pytest_itemcollected(item):
    """Into the report, which travels from a worker to where the table is written."""
    item.user_properties += [("hard", table.case_of(mark)) for mark in item.iter_markers("hard")]


@pytest.fixture(scope="module", autouse=True)
def forget_programs():
    """Every compiled program holds memory maps, of which a process may have 65530."""
    yield
    jax.clear_caches()
