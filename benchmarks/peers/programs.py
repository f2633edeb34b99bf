"""Programs that answer requests: a process that stays, a fresh process, and the peer's environment."""

import json
import os
import re
import subprocess
import sys
import time
import venv
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any


BENCHMARKS = Path(__file__).parents[1]
REQUIREMENTS = ("ross-rotordynamics==2.3.*", "plotly<6")
# ROSS, numpy and jax all compute with OpenBLAS, whose threads wait for each other on a busy machine.
THREADS = "OPENBLAS_NUM_THREADS"


def environment(folder: Path) -> str:
    """Python of the environment that has ROSS; both are installed unless they are there already."""
    python = folder / "bin" / "python"
    if not (folder / "installed").exists():
        print(f"ROSS is installed into {folder}; this takes some minutes once.", flush=True)
        venv.create(folder, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *REQUIREMENTS], check=True)
        (folder / "installed").write_text("\n".join(REQUIREMENTS) + "\n")
    return str(python)


class Program:
    """A process that answers requests, one a line, until its input ends."""

    def __init__(self, command: Sequence[str], threads: int):
        own = os.environ | {THREADS: str(threads)}
        if command[0] != sys.executable:
            own.pop("PYTHONPATH", None)
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            command,
            cwd=BENCHMARKS,
            env=own,
            stdin=pipe,
            stdout=pipe,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ask(self, request: dict) -> dict[str, Any]:
        """Answer and seconds of the call; lines that are not JSON, of imported packages, are skipped."""
        given, taken = _open(self.process.stdin), _open(self.process.stdout)
        given.write(json.dumps(request) + "\n")
        given.flush()
        for line in taken:
            if line.startswith("{"):
                return json.loads(line)
        asked = {key: value for key, value in request.items() if key != "rotor"}
        command = " ".join(map(str, self.process.args[1:]))  # type: ignore[index]
        raise SystemExit(
            f"`{command}` ended without an answer to {asked}; "
            f"run it in {BENCHMARKS} and give it that line to see why."
        )

    def close(self) -> None:
        _open(self.process.stdin).close()
        self.process.wait()


def fresh(command: Sequence[str], threads: int, request: dict) -> float:
    """Seconds from the start of a process until its answer has been read."""
    began = time.perf_counter()
    program = Program(command, threads)
    program.ask(request)
    seconds = time.perf_counter() - began
    program.close()
    return seconds


def version(python: str) -> str:
    """Version of ROSS in its environment."""
    ask = "import importlib.metadata as m; print(m.version('ross-rotordynamics'))"
    return subprocess.run([python, "-c", ask], capture_output=True, text=True).stdout.strip()


def processor() -> str:
    """Name of the processor, where Linux tells it."""
    info = Path("/proc/cpuinfo")
    found = re.search("model name.*: (.*)", info.read_text()) if info.exists() else None
    return f"{found[1] if found else '?'}, {os.cpu_count()} cores"


def _open(stream: IO[str] | None) -> IO[str]:
    assert stream is not None
    return stream
