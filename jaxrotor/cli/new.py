"""Command `new`: a scene file to begin with."""

import contextlib
import importlib.resources
from pathlib import Path
from typing import Annotated

import typer

from ..files.shipped import source
from ..files.units import quantity


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
    from_ross: Annotated[
        Path | None,
        typer.Option(metavar="ROSS", help="Begin with a rotor that ROSS saved, .toml or .json."),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(metavar="SPEED", help="Speed of that rotor; its file has none."),
    ] = None,
) -> None:
    """Write a commented scene file to begin with: a disc on a shaft in two bearings, ready to run.

    What of a ROSS file is not carried over is printed, and stands in the first lines of the scene.

    ```
    jaxrotor new my-rotor.toml
    jaxrotor show my-rotor.toml
    jaxrotor campbell my-rotor.toml --to "9000 rpm" --out runs/my-rotor
    jaxrotor new stops.toml --like limiter-rotor
    jaxrotor new compressor.toml --from-ross rotor.toml --speed 6000rpm
    ```
    """
    if path.suffix != ".toml":
        raise ValueError(f"The name of a scene file ends in .toml, but is {path}.")
    text, notes = _template().replace("NAME.toml", str(path)), ()
    if like is not None and from_ross is not None:
        raise ValueError("A scene begins with one of --like and --from-ross; give one of them.")
    if like is not None:
        text = source(like)
    elif from_ross is not None:
        text, notes = _of_ross(from_ross, speed)
    elif speed is not None:
        raise ValueError("--speed is that of --from-ross; other scenes have theirs.")
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileExistsError:
        raise ValueError(f"{path} exists already; choose another name, or delete it.") from None
    except OSError as error:
        with contextlib.suppress(OSError):  # half a file, if any
            path.unlink()
        raise ValueError(f"{path} cannot be written ({error.strerror}); choose another.") from None
    for note in notes:
        typer.echo(f"{note}.")
    typer.echo(f"Written: {path}. Edit it, and look at it with `jaxrotor show {path}`.")


def _of_ross(path: Path, speed: str | None) -> tuple[str, tuple[str, ...]]:
    """Text of a scene, and what is not in it."""
    from ..files.ross import from_ross as read
    from ..files.toml import dumps  # jax, which no other way to begin needs

    if speed is None:
        raise ValueError("The file of ROSS says no speed; add --speed, such as --speed 6000rpm.")
    scene, notes = read(path, quantity(speed, "rad/s", "--speed"))
    told = tuple(f"Not as in {path.name}: {note}" for note in notes)
    head = [f"# {note}." for note in told]
    return "\n".join([*head, dumps(scene, f"Rotor of ROSS, {path.name}")]), told


def _template() -> str:
    return (importlib.resources.files("jaxrotor.cli") / "new.toml").read_text("utf-8")
