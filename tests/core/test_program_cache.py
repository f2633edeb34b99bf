"""Programs compiled by one process are loaded by another."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from jaxrotor.core import program_cache


PROGRAM = """
import json, sys
import jax, numpy as np
import jaxrotor as jr

counts = {"/jax/compilation_cache/cache_hits": 0, "/jax/compilation_cache/cache_misses": 0}
def hear(event, **_):
    if event in counts:
        counts[event] += 1
jax.monitoring.register_event_listener(hear)
jax.jit(lambda x: 2 * x)(3.0)  # compiled before the folder is set
folder = jr.keep_programs(sys.argv[1])
roots = np.abs(jr.roots(jr.load("gyroscopic-cantilever"), 4)).tolist()
print(json.dumps([roots, *counts.values(), str(folder)]))
"""


def answered(folder):
    run = [sys.executable, "-c", PROGRAM, str(folder)]
    kept = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    return json.loads(subprocess.run(run, check=True, capture_output=True, env=kept).stdout)


def test_a_second_process_compiles_nothing(tmp_path):
    roots, hits, misses, folder = answered(tmp_path / "kept")
    assert hits == 0 and misses > 2 and Path(folder) == tmp_path / "kept"
    again, hits, later, _ = answered(tmp_path / "kept")
    assert hits == misses and later == 0
    assert again == roots


def test_the_folder_is_that_of_a_processor_and_a_version(monkeypatch):
    own = program_cache.program_folder()
    assert own.parent.name == "jaxrotor" and own == program_cache.program_folder()
    monkeypatch.setattr(program_cache, "processor", lambda: "another one")
    assert program_cache.program_folder() != own


@pytest.mark.parametrize("set_before", [True, False])
def test_commands_leave_what_the_user_has_set(monkeypatch, set_before):
    settings = {name.upper(): str(value) for name, value in program_cache.SETTINGS.items()}
    for name in ("JAX_COMPILATION_CACHE_DIR", *settings):
        monkeypatch.setenv(name, "mine")
        if not set_before:
            monkeypatch.delenv(name)
    program_cache.keep_programs_of_commands()
    found = {name: os.environ[name] for name in settings if name in os.environ}
    if set_before:
        assert os.environ["JAX_COMPILATION_CACHE_DIR"] == "mine" and {*found.values()} == {"mine"}
    else:
        assert os.environ["JAX_COMPILATION_CACHE_DIR"] == str(program_cache.program_folder())
        assert found == settings
