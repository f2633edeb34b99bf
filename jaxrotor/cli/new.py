"""Command `new`: a scene file to start from."""

import contextlib
import importlib.resources
from pathlib import Path
from typing import Annotated

import typer

from ..files.shipped import source
from ..files.units import quantity


def new(
    path: Annotated[
        Path, typer.Argument(metavar="FILE.toml", help="File to write; it must not exist.")
    ],
    like: Annotated[
        str | None,
        typer.Option(
            metavar="SCENE",
            help="Copy this scene, with its comments. [default: a disc on a shaft]",
        ),
    ] = None,
    from_ross: Annotated[
        Path | None,
        typer.Option(metavar="ROSS", help="Convert a rotor saved by ROSS, .toml or .json."),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(metavar="SPEED", help="Speed of the rotor of ROSS, whose file has none."),
    ] = None,
) -> None:
    """Write a commented scene file to start from: a disc on a shaft in two bearings, ready to run.

    The parts of a ROSS file that are not converted are printed, and listed at the top of the scene file.

    ```
    jaxrotor new my-rotor.toml
    jaxrotor show my-rotor.toml
    jaxrotor campbell my-rotor.toml --to "9000 rpm" --out runs/my-rotor
    jaxrotor new stops.toml --like limiter-rotor
    jaxrotor new compressor.toml --from-ross rotor.toml --speed 6000rpm
    ```
    """
    if path.suffix != ".toml":
        raise ValueError(f"The name of a scene file must end in .toml, but is {path}.")
    text, notes = _template().replace("NAME.toml", str(path)), ()
    if like is not None and from_ross is not None:
        raise ValueError(
            "A new scene takes one of --like and --from-ross, but has both; give only one."
        )
    if like is not None:
        text = source(like)
    elif from_ross is not None:
        text, notes = _of_ross(from_ross, speed)
    elif speed is not None:
        raise ValueError(
            "--speed is for --from-ross only, as other scenes have a speed; leave it out."
        )
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileExistsError:
        raise ValueError(f"{path} exists already; choose another name, or delete it.") from None
    except OSError as error:
        with contextlib.suppress(OSError):  # an incomplete file, if any
            path.unlink()
        raise ValueError(f"{path} cannot be written ({error.strerror}); choose another.") from None
    for note in notes:
        typer.echo(f"{note}.")
    typer.echo(f"Written: {path}. Edit it, and check it with `jaxrotor show {path}`.")


def _of_ross(path: Path, speed: str | None) -> tuple[str, tuple[str, ...]]:
    """Text of a scene converted from ROSS, and notes on the parts left out."""
    from ..files.ross import from_ross as read
    from ..files.toml import dumps  # loads jax, which no other option needs

    if speed is None:
        raise ValueError("The file of ROSS has no speed; add --speed, as in --speed 6000rpm.")
    scene, notes = read(path, quantity(speed, "rad/s", "--speed"))
    differences = tuple(f"Not as in {path.name}: {note}" for note in notes)
    head = [f"# {note}." for note in differences]
    return "\n".join([*head, dumps(scene, f"Rotor of ROSS, {path.name}")]), differences


def _template() -> str:
    return (importlib.resources.files("jaxrotor.cli") / "new.toml").read_text("utf-8")
