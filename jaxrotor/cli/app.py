"""App: the commands, and the handling of their errors."""

import contextlib
import functools
import gc
import importlib
import importlib.metadata
import os
import warnings
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ..core.caller import FewStepsWarning
from ..core.plausibility import ImplausibleWarning
from ..core.program_cache import keep_programs_of_commands
from ..files.shipped import source
from .interrupt import INTERRUPTED, run_until_interrupted, stop_on_ctrl_c
from .typed import typed


# Summary of every command, and its module where that has another name. The modules take seconds to load,
# so `jaxrotor --help` uses the summaries, and only the module of the command that runs is loaded.
_SUMMARIES = {
    "scenes": "List the scenes that come with jaxrotor.",
    "show": "Show a scene: its parameters, whirl frequencies, critical speeds and onset of instability.",
    "new": "Write a commented scene file to start from: a disc on a shaft in two bearings, ready to run.",
    "roots": "Complex roots: whirl frequencies, damping, direction and stability, without contact.",
    "onset": "Lowest speed at which the straight rotor loses stability, and its whirl there.",
    "campbell": "Campbell diagram: whirl frequencies and growth rates against speed, without contact.",
    "critical": "Critical speeds: speeds of rotation that equal a whirl frequency of the undamped rotor.",
    "stability": "Boundaries of stability along one parameter, or a stability map over two, "
    "without contact.",
    "response": "Steady response to unbalance: its peaks, "
    "and its values at operating and critical speeds.",
    "api": "Lateral analysis in the style of API 617 and API RP 684, with pass or fail of each demand.",
    "balance": "Balance a rotor as a rigid body: corrections in two planes, and grade G before and after.",
    "simulate": "Simulate one motion in time: radius, whirl and contact; with --out, data and pictures.",
    "run-up": "Simulate a run-up or any other change of speed: peak, speeds, contact and balls.",
    "reactions": "Reactions of bearings and stops: at rest, and first, last and largest dynamic part.",
    "sweep": "Sweep a scene over parameters: many long motions, "
    "their data and bifurcation diagram or map.",
    "accuracy": "Accuracy against cost: error to a converged reference, compile time, "
    "run time and memory.",
    "explore": "Explore a sweep: click a point of its bifurcation diagram to see its orbit and spectrum.",
    "export": "Write the data of a run as a table (CSV, Parquet), as NetCDF, for MATLAB "
    "or as a universal file.",
    "report": "Write one HTML file of a run: scene, pictures, numbers, accuracy, status, versions.",
}
_MODULES = {"roots": "linear", "onset": "linear", "critical": "campbell", "run-up": "run_up"}
COMMANDS = {name: (_MODULES.get(name, name), told) for name, told in _SUMMARIES.items()}
_WITHOUT_SCENE = ("scenes", "new", "explore", "export", "report")
_DOUBTS = ImplausibleWarning, FewStepsWarning  # warnings that are printed as notes
UsageError: Any = typer.BadParameter.__base__  # that of the click inside typer


class OneSentence(TyperGroup):
    """A group whose commands end in one sentence on stderr, not in a traceback, when they fail."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command itself, loaded, instead of its placeholder in the list."""
        name, listed, rest = super().resolve_command(ctx, args)
        if name in COMMANDS and name not in _WITHOUT_SCENE and rest and not rest[0].startswith("-"):
            # Raises for a wrong name, before the seconds that a command takes to load
            source(rest[0])
        ctx.meta[__name__] = name, list(rest)
        return name, loaded(name) if name else listed, rest

    def invoke(self, ctx: Any) -> Any:
        try:
            with _doubts_noted(ctx):
                return super().invoke(ctx)
        except (typer.Exit, typer.Abort):  # typer's own, though RuntimeErrors
            raise
        except KeyboardInterrupt:
            typer.echo("Interrupted; nothing was written.", err=True)
            raise typer.Exit(INTERRUPTED) from None
        except UsageError as error:
            typer.echo(f"{_one_line(error.format_message())} (see --help)", err=True)
            raise typer.Exit(2) from None
        except (ValueError, RuntimeError, OSError, ArithmeticError, MemoryError) as error:
            if ctx.params["debug"]:
                raise
            sentence = _one_line(error) or type(error).__name__
            typer.echo(_typed(ctx, sentence), err=True)
            raise typer.Exit(2) from None


def _typed(ctx: Any, sentence: str) -> str:
    """A sentence of the library, reworded for the command that was typed."""
    if __name__ not in ctx.meta:
        return sentence
    name, words = ctx.meta[__name__]
    return typed(sentence, name, words, list(COMMANDS), loaded(name))


@contextlib.contextmanager
def _doubts_noted(ctx: Any) -> Iterator[None]:
    """Print every warning of an implausible number or of few steps once, in a line on stderr."""
    with warnings.catch_warnings():
        for category in _DOUBTS:
            warnings.simplefilter("always", category)
        warnings.showwarning = functools.partial(_noted_once, ctx, warnings.showwarning, set())
        yield


def _noted_once(
    ctx: Any,
    other: Callable[..., None],
    noted: set[str],
    message: Any,
    category: type[Warning],
    *rest: Any,
    **more: Any,
) -> None:
    """Print a warning of an implausible number or of few steps once; pass others on to `other`."""
    if not issubclass(category, _DOUBTS):
        other(message, category, *rest, **more)
    elif str(message) not in noted:
        noted.add(str(message))
        typer.echo(f"Note: {_typed(ctx, str(message))}", err=True)


def _one_line(error: object) -> str:
    """First paragraph of a message as one line; jax and equinox append pages of their own."""
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename} cannot be used: {error.strerror}."
    paragraph = str(error).strip().partition("\n\n")[0]
    return " ".join(paragraph.removeprefix("Value error, ").split())


app = typer.Typer(
    cls=OneSentence,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _name, (_, _summary) in COMMANDS.items():
    app.command(_name, help=_summary)(lambda: None)


@functools.cache
def loaded(name: str) -> Any:
    """A command, with its module loaded."""
    module = importlib.import_module(f".{COMMANDS[name][0]}", __package__)
    one = typer.Typer(rich_markup_mode="markdown", add_completion=False)
    one.command(name)(getattr(module, name.replace("-", "_")))
    return typer.main.get_command(one)


def _version(asked: bool) -> bool:
    if asked:
        typer.echo(f"jaxrotor {importlib.metadata.version('jaxrotor')}")
        raise typer.Exit
    return asked


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", callback=_version, is_eager=True),
    ] = False,
) -> None:
    """Rotor dynamics: roots, Campbell diagram, stability, response and bifurcation of a scene.

    A scene is a shaft, the parts on it, and its spin: a TOML file, or one of those shipped.

    ```
    jaxrotor scenes
    jaxrotor show limiter-rotor
    jaxrotor new my-rotor.toml
    jaxrotor onset limiter-rotor --set internal_damping.voigt_time=0.1ms
    jaxrotor campbell limiter-rotor --out runs/campbell
    jaxrotor critical limiter-rotor
    jaxrotor stability limiter-rotor --over spin.speed=0:9000rpm:61
    jaxrotor response limiter-rotor --set unbalance.eccentricity=0.1mm --out runs/response
    jaxrotor balance turbine-run-up --planes 0m,0.453m
    jaxrotor run-up turbine-run-up --out runs/run-up
    jaxrotor reactions turbine-run-up --out runs/reactions
    jaxrotor simulate limiter-rotor --revolutions 500 --keep 50 --out runs/simulate
    jaxrotor sweep limiter-rotor
    jaxrotor accuracy limiter-rotor --quantity onset-speed --out runs/accuracy
    jaxrotor export runs/response/response.zarr response.csv
    jaxrotor report runs/response
    ```

    Numbers without a unit are SI; others have their unit: 6000rpm, "7 mm", 60deg.
    Every command has its own --help.
    """


def main() -> None:
    """Entry point of the program; compiled programs are cached for the next run."""
    # For every cached program XLA warns that the processor lacks features, mistaking compiler settings
    # for them.
    if os.environ.get("TF_CPP_MIN_LOG_LEVEL", "1") == "1":  # what jax itself sets when it is loaded
        os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"
    keep_programs_of_commands()
    stop_on_ctrl_c()
    # Tracing creates millions of lasting objects; scanning them for garbage is a tenth of the time of a
    # command.
    gc.set_threshold(50_000, 20, 50)
    run_until_interrupted(lambda: app(prog_name="jaxrotor"))
