"""Command `new`: a scene file to begin with."""

import contextlib
import importlib.resources
from pathlib import Path
from typing import Annotated

import typer

from ..files import source


def new(
    path: Annotated[
        Path, typer.Argument(metavar="FILE.toml", help="File to write; none may be there.")
    ],
    like: Annotated[
        str | None,
        typer.Option(
            metavar="SCENE",
            help="Begin with a copy of a scene, comments and all. [default: a disc]",
        ),
    ] = None,
) -> None:
    """Write a commented scene file to begin with: a disc on a shaft in two bearings, ready to run.

    ```
    jaxrotor new my-rotor.toml
    jaxrotor show my-rotor.toml
    jaxrotor campbell my-rotor.toml --to "9000 rpm" --out runs/my-rotor
    jaxrotor new stops.toml --like limiter-rotor
    ```
    """
    if path.suffix != ".toml":
        raise ValueError(f"The name of a scene file ends in .toml, but is {path}.")
    text = _template().replace("NAME.toml", str(path)) if like is None else source(like)
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileExistsError:
        raise ValueError(f"{path} exists already; choose another name, or delete it.") from None
    except OSError as error:
        with contextlib.suppress(OSError):  # half a file, if any
            path.unlink()
        raise ValueError(f"{path} cannot be written ({error.strerror}); choose another.") from None
    typer.echo(f"Written: {path}. Edit it, and look at it with `jaxrotor show {path}`.")


def _template() -> str:
    return (importlib.resources.files("jaxrotor.cli") / "new.toml").read_text("utf-8")
