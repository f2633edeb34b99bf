"""Program cache: what was compiled once is kept on disk and found there by later processes."""

import hashlib
import importlib.metadata
import os
import platform
from pathlib import Path

from platformdirs import user_cache_path


# Of every program, however small: loading one takes a hundredth of a second.
SETTINGS = {
    "jax_persistent_cache_min_compile_time_secs": 0.0,
    "jax_persistent_cache_min_entry_size_bytes": -1,
}


def program_folder() -> Path:
    """Where programs for this processor and this version of jaxlib are kept by default.

    A folder shared by machines would else hold programs that one of them cannot run.
    """
    processor = hashlib.sha256(_processor().encode()).hexdigest()[:8]
    version = importlib.metadata.version("jaxlib")
    return user_cache_path("jaxrotor") / f"jaxlib-{version}-{platform.machine()}-{processor}"


def keep_programs(folder: str | os.PathLike[str] | None = None) -> Path:
    """Keep everything that jax compiles from now on in a folder, for later processes to load.

    Args:
        folder: where, by default the user's cache folder for this processor and version of jaxlib,
            which the commands use, too. It may be deleted at any time.

    Returns:
        The folder.
    """
    import jax
    from jax.experimental.compilation_cache import compilation_cache

    where = program_folder() if folder is None else Path(folder).expanduser().resolve()
    where.mkdir(parents=True, exist_ok=True)
    for name, value in SETTINGS.items():
        jax.config.update(name, value)
    jax.config.update("jax_compilation_cache_dir", str(where))
    compilation_cache.reset_cache()  # one that was opened before, in another folder or in none
    return where


def keep_programs_of_commands() -> None:
    """The same by the environment, before jax is loaded; what the user has set there stays."""
    if "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(program_folder())
    for name, value in SETTINGS.items():
        os.environ.setdefault(name.upper(), str(value))


def _processor() -> str:
    """What a processor can do, as Linux lists it, else what it is called."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line for line in lines if line.startswith(("flags", "Features"))), "")
