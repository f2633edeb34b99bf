"""App: the commands together, and what happens when one cannot go on."""

import os
from typing import Any

import jax
import typer
from platformdirs import user_cache_dir
from typer.core import TyperGroup

from .accuracy import accuracy
from .balance import balance
from .campbell import campbell, critical
from .export import export
from .linear import onset, roots
from .new import new
from .reactions import reactions
from .report import report
from .response import response
from .run_up import run_up
from .scenes import scenes, show
from .simulate import simulate
from .stability import stability
from .sweep import sweep


UsageError: Any = typer.BadParameter.__base__  # of the click that typer brings


class OneSentence(TyperGroup):
    """Bad input, a failed run or Ctrl-C end in one sentence on stderr, not in a traceback."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except (typer.Exit, typer.Abort):  # RuntimeErrors, but typer's own
            raise
        except KeyboardInterrupt:
            typer.echo("Interrupted; nothing was written.", err=True)
            raise typer.Exit(130) from None
        except UsageError as error:
            typer.echo(f"{_one_line(error.format_message())} (see --help)", err=True)
            raise typer.Exit(2) from None
        except (ValueError, RuntimeError) as error:
            if ctx.params["debug"]:
                raise
            typer.echo(_one_line(error) or type(error).__name__, err=True)
            raise typer.Exit(2) from None


def _one_line(error: object) -> str:
    """First paragraph of a message; jax and equinox add pages about themselves."""
    paragraph = str(error).strip().partition("\n\n")[0]
    return " ".join(paragraph.removeprefix("Value error, ").split())


app = typer.Typer(
    cls=OneSentence,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_COMMANDS = (
    scenes, show, new, roots, onset, campbell, critical, stability, response, balance, simulate, run_up,
    reactions, sweep, accuracy, export, report,
)  # fmt: skip
for _command in _COMMANDS:
    app.command()(_command)


@app.callback()
def options(
    debug: bool = typer.Option(False, "--debug", help="Show the traceback of an error."),
) -> None:
    """Rotor dynamics: roots, Campbell diagram, stability, response and bifurcation of a scene.

    A scene is a shaft, what sits on it, and how it spins: a TOML file, or one of those shipped.

    ```
    jaxrotor scenes
    jaxrotor show limiter-rotor
    jaxrotor new my-rotor.toml
    jaxrotor onset limiter-rotor --set internal_damping.voigt_time=0.1ms
    jaxrotor campbell limiter-rotor --out run
    jaxrotor critical limiter-rotor
    jaxrotor stability limiter-rotor --over spin.speed=0:9000rpm:61
    jaxrotor response limiter-rotor --set unbalance.eccentricity=0.1mm --out run
    jaxrotor balance turbine-run-up --planes 0m,0.453m
    jaxrotor run-up turbine-run-up --out run
    jaxrotor reactions turbine-run-up --out run
    jaxrotor simulate limiter-rotor --revolutions 500 --keep 50 --out run
    jaxrotor sweep limiter-rotor
    jaxrotor accuracy limiter-rotor --quantity onset-speed --out run
    jaxrotor export run/response.zarr orbit.csv
    jaxrotor report run
    ```

    Numbers are SI; with a unit behind them they may be anything: 6000rpm, "7 mm", 60deg.
    Every command has its own --help.
    """


def main() -> None:
    """Entry point of the program; what it compiles is kept for the next time."""
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
        jax.config.update("jax_compilation_cache_dir", user_cache_dir("jaxrotor"))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
    app(prog_name="jaxrotor")
