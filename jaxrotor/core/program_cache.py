"""Program cache: compiled programs are stored on disk, where later processes find them.

jax finds a program there after it has traced the function and lowered it. Programs of the package's own
functions are found before that, see `stored_programs`.
"""

import contextlib
import hashlib
import importlib.metadata
import os
import platform
import warnings
from pathlib import Path

from platformdirs import user_cache_path


# Every program is stored, however small: loading one takes a hundredth of a second.
SETTINGS = {
    "jax_persistent_cache_min_compile_time_secs": 0.0,
    "jax_persistent_cache_min_entry_size_bytes": -1,
}
# jax does not write an entry at once, so another process may read a part of it, and compiles the program
# itself, as it would without the cache.
UNREADABLE = "Error reading persistent compilation cache entry"
_kept = False


def programs_are_kept() -> bool:
    """Whether this process has called one of the functions here that keep programs."""
    return _kept


def program_folder() -> Path:
    """Default folder of compiled programs, for this processor and this version of jaxlib.

    Machines may share the user's cache folder, and a program of one may not run on another.
    """
    own = hashlib.sha256(processor().encode()).hexdigest()[:8]
    version = importlib.metadata.version("jaxlib")
    return user_cache_path("jaxrotor") / f"jaxlib-{version}-{platform.machine()}-{own}"


def keep_programs(folder: str | os.PathLike[str] | None = None) -> Path:
    """Store everything that jax compiles from now on in a folder, from which later processes load it.

    Functions of jaxrotor that are called with the same structure, shapes and static values are not traced
    again either, as long as its sources and the versions of jax are the same. Code of jaxrotor that is
    replaced while a process runs is not noticed.

    Args:
        folder: folder of the programs. The default lies in the user's cache folder, depends on the
            processor and the version of jaxlib, and is shared with the commands. It may be deleted at
            any time.

    Returns:
        Path of the folder.
    """
    global _kept
    import jax
    from jax.experimental.compilation_cache import compilation_cache

    where = program_folder() if folder is None else Path(folder).expanduser().resolve()
    where.mkdir(parents=True, exist_ok=True)
    _mend(where)
    for name, value in SETTINGS.items():
        jax.config.update(name, value)
    jax.config.update("jax_compilation_cache_dir", str(where))
    compilation_cache.reset_cache()  # drop a cache that was opened before with another folder
    _kept = True
    return where


def keep_programs_of_commands() -> None:
    """`keep_programs` by environment variables, before jax is loaded; the user's own settings stay."""
    global _kept
    _kept = True
    if "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return
    folder = program_folder()
    _mend(folder)
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(folder)
    for name, value in SETTINGS.items():
        os.environ.setdefault(name.upper(), str(value))


def _mend(folder: Path) -> None:
    """Delete empty entries, left by processes that ended while they wrote, as jax writes none again.

    Warnings of entries that another process writes are left out from now on.
    """
    warnings.filterwarnings("ignore", UNREADABLE)
    for entry in folder.glob("*-cache"):
        with contextlib.suppress(OSError):  # of a folder that others own, or share
            if not entry.stat().st_size:
                entry.unlink()


def processor() -> str:
    """Instruction sets of the processor as Linux lists them, else its name."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line for line in lines if line.startswith(("flags", "Features"))), "")
