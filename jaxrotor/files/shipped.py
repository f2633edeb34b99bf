"""Texts of scene files, shipped ones and those of the user.

This module does not load jax, so a wrong name is reported at once.
"""

import importlib.resources
import os
import tomllib
from pathlib import Path
from typing import Any

from ..core.checks import suggest
from .units import refuse


def source(name_or_path: str | os.PathLike[str]) -> str:
    """Text of a scene file, including its comments."""
    return text_of(name_or_path)[0]


def shipped() -> list[tuple[str, str]]:
    """Scenes that come with jaxrotor.

    Returns:
        Name and title of every scene, ordered by name.
    """
    texts = {name: file.read_text("utf-8") for name, file in sorted(_shipped().items())}
    return [(name, tomllib.loads(text).get("title", "")) for name, text in texts.items()]


def text_of(name_or_path: str | os.PathLike[str]) -> tuple[str, str]:
    """Text of a scene file, and its name for error messages."""
    source, ours = os.fspath(name_or_path), _shipped()
    try:
        return ours.get(source, Path(source)).read_bytes().decode("utf-8-sig"), source
    except FileNotFoundError:
        called = {path.stem: path.name for path in Path(source).parent.glob("*.toml")}
        called |= {name: name for name in ours}
        near, names = suggest(Path(source).stem, called, called.get), ", ".join(sorted(ours))
        new = source if source.endswith(".toml") else f"{source or 'NAME'}.toml"
        hint = near or f"; `jaxrotor new {new}` writes one to begin with"
        refuse(source, f"is neither a file nor a shipped scene{hint}; shipped are: {names}.")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        refuse(source, f"cannot be read ({reason}); give a TOML file in UTF-8.")


def _shipped() -> dict[str, Any]:
    folder = importlib.resources.files("jaxrotor") / "scenes"
    return {f.name.removesuffix(".toml"): f for f in folder.iterdir() if f.name.endswith(".toml")}
