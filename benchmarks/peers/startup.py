"""Seconds from the start of a process to the result of `jaxrotor sweep limiter-rotor`."""

import subprocess
import sys
import tempfile
import time


FULL = 300  # revolutions kept, from which the command runs at its default size


def first_result(revolutions: int) -> dict:
    """Wall time of the command as a user types it, twice: compiled, then from the cache if any."""
    command = [sys.executable, "-m", "jaxrotor", "sweep", "limiter-rotor"]
    if revolutions < FULL:
        command += ["--settle", str(revolutions), "--keep", str(revolutions)]
    seconds = []
    for _ in range(2):
        with tempfile.TemporaryDirectory() as folder:
            began = time.perf_counter()
            subprocess.run([*command, "--out", folder], check=True, capture_output=True)
            seconds.append(time.perf_counter() - began)
    return {"first s": seconds[0], "again s": seconds[1]}
