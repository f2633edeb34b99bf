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

counts = {"jaxpr_trace_duration": 0, "backend_compile_duration": 0, "cache_retrieval_time_sec": 0}
def hear(event, seconds, **_):
    name = event.rpartition("/")[2]
    if name in counts:
        counts[name] += 1
jax.monitoring.register_event_duration_secs_listener(hear)
jax.jit(lambda x: 2 * x)(3.0)  # compiled before the folder is set
folder = jr.keep_programs(sys.argv[1])
roots = np.abs(jr.roots(jr.load("limiter-rotor"), 4)).tolist()
other = np.asarray(jax.jit(lambda x: np.pi * x)(3.0)).tolist()  # not of jaxrotor, kept by jax
jax.numpy.sin(3.0)
print(json.dumps([[roots, other], *counts.values(), str(folder)]))
"""


def answered(folder):
    run = [sys.executable, "-c", PROGRAM, str(folder)]
    kept = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    process = subprocess.run(run, check=True, capture_output=True, env=kept, text=True)
    assert "Warning" not in process.stderr, process.stderr
    return json.loads(process.stdout)


def test_a_second_process_compiles_and_traces_nothing(tmp_path):
    roots, traced, compiled, loaded, folder = answered(tmp_path / "kept")
    assert traced > 50 and compiled > 3 and not loaded and Path(folder) == tmp_path / "kept"
    (cut,) = Path(folder).glob("jit_sin-*-cache")  # as a process leaves it that still writes
    cut.write_bytes(cut.read_bytes()[:100])
    empty = Path(folder) / "jit_f-0-cache"
    empty.touch()
    again, traced, compiled, loaded, _ = answered(tmp_path / "kept")
    assert traced < 10 and compiled == loaded + 2 and loaded >= 1
    assert again == roots and not empty.exists()


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
