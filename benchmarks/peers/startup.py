"""Seconds from the start of a process to the result of `jaxrotor sweep limiter-rotor`."""

import os
import subprocess
import sys
import tempfile
import time


FULL = 300  # revolutions kept, from which the command runs at its default size


def first_result(revolutions: int) -> dict:
    """Wall time of the command as a user types it, twice: with all to compile, then from the cache."""
    command = [sys.executable, "-m", "jaxrotor", "sweep", "limiter-rotor"]
    if revolutions < FULL:
        command += ["--settle", str(revolutions), "--keep", str(revolutions)]
    seconds = []
    with tempfile.TemporaryDirectory() as cache:
        for turn in range(2):
            own = os.environ | {"JAX_COMPILATION_CACHE_DIR": f"{cache}/programs"}
            whole = [*command, "--out", f"{cache}/{turn}"]
            began = time.perf_counter()
            subprocess.run(whole, check=True, capture_output=True, env=own)
            seconds.append(time.perf_counter() - began)
    return {"first s": seconds[0], "again s": seconds[1]}
