"""Options that several commands share, and the functions that interpret them."""

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np
import typer

from ..analysis import critical_speeds, settled
from ..core.compiled import compiled_quickly
from ..effects.places import of_first_order
from ..equations.speed_tables import speed_range
from ..equations.start import AbstractStart, AtRest, Whirl
from ..equations.system import polar_inertia
from ..files.several_shafts import station
from ..files.toml import load
from ..files.toml_reader import swept_values, value_list
from ..files.units import quantity
from ..files.vocabulary import START
from ..scene import Scene
from ..spins.constant import ConstantSpeed
from ..spins.drive import Drive
from .answer import AsJson as AsJson, note


MOST = 10_000_000  # largest count accepted; a larger one is a mistake
STILL = "a rigid shaft in two pins cannot move; use `jaxrotor reactions`"
SAMPLES = 2001  # of a run, by default
BEYOND = 2.5  # default end of a range of speeds, over the running speed
REVOLUTIONS = 50  # default length of a run at constant speed


def count(told: str, least: int = 1, most: int = MOST) -> Any:
    """Option of a whole number, with its help."""
    return typer.Option(min=least, max=most, help=told)


SceneName = Annotated[
    str,
    typer.Argument(
        metavar="SCENE", help="Name of a shipped scene (see `jaxrotor scenes`) or a TOML file."
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help="Change a parameter, as in `--set spin.speed=6000rpm`, or the nodes of each span of the "
        "shaft, as in `--set shaft.nodes=12`; may be repeated. `jaxrotor show SCENE` lists the paths.",
    ),
]
Row = Annotated[int | None, typer.Option(help="Row of `turbine-variants`, 1 to 30.")]
Layout = Annotated[
    str | None,
    typer.Option(help="Layout assumed of that row: chain or example31. [default: chain]"),
]
Radius = Annotated[
    str | None,
    typer.Option(
        "--start-radius",
        metavar="LENGTH",
        help="Initial displacement, with the shaft bent as by a force. [default: the scene's]",
    ),
]
Rate = Annotated[
    str | None,
    typer.Option(
        "--start-rate",
        metavar="SPEED",
        help="Initial whirl speed, negative for backward. [default: the scene's]",
    ),
]
Angle = Annotated[
    str | None,
    typer.Option(
        "--start-angle",
        metavar="ANGLE",
        help="Direction of the initial displacement. [default: the scene's]",
    ),
]
At = Annotated[
    str | None,
    typer.Option(
        metavar="LENGTH",
        help='Station to observe, of several shafts as "hp 0.3 m". [default: that of the first contact, '
        "else of the first effect]",
    ),
]
By = Annotated[
    str | None,
    typer.Option(
        metavar="SHAFT",
        help="Name of the shaft whose unbalance is meant, where there are several. [default: the first]",
    ),
]
Period = Annotated[
    str | None,
    typer.Option(
        metavar="TIME",
        help="Time that counts as a revolution at zero speed, or the shaft whose turns are counted.",
    ),
]
Steps = Annotated[
    str | None,
    typer.Option(
        metavar="COUNT",
        help='Steps and samples per revolution, or "auto": chosen by a pilot run. '
        "[default: the scene's, or 256]",
    ),
]
Nodes = Annotated[
    str | None,
    typer.Option(metavar="COUNT", help='Nodes of the shaft, or "auto". [default: the scene\'s]'),
]
Tolerance = Annotated[
    float, typer.Option(help='Change of motion and roots under refinement that "auto" accepts.')
]
Low = Annotated[
    str | None, typer.Option("--from", metavar="SPEED", help="First speed. [default: 0]")
]
High = Annotated[
    str | None,
    typer.Option(
        "--to",
        metavar="SPEED",
        help="Last speed, negative for reversed rotation. [default: in the scene's sense 2.5 times its "
        "speed, and at least a quarter above the first forward critical speed; of a scene at speed 0 a "
        "quarter above the second]",
    ),
]
Duration = Annotated[
    str | None,
    typer.Option(
        metavar="TIME",
        help="Duration of the run. [default: to the end of spin.times; for a drive, until it is within "
        "0.1 % of its steady speed; else 50 revolutions]",
    ),
]
Samples = Annotated[int, count("Number of samples in --duration.", least=2)]
Times = Annotated[
    str | None,
    typer.Option(
        metavar="TIMES", help='Samples, as "0 s:2 s:201" or "0, 0.1, 0.5"; instead of --duration.'
    ),
]
Points = Annotated[int, count("Number of speeds.", least=3)]
Out = Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for data and pictures.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files of an earlier run.")]


def scene_with(name: str, settings: Sequence[str] | None) -> Scene:
    """`scene_of`, with its assumption noted on stderr."""
    scene = scene_of(name, settings)
    if scene.assumption:
        note(f"{scene.assumption}.")
    return scene


def scene_of(
    name: str, settings: Sequence[str] | None, row: int | None = None, layout: str | None = None
) -> Scene:
    """The scene of a name or path (or of a row of its table), with the changes of `--set`."""
    scene, values = load(name, row, layout), {}
    for path, text in assignments("--set", settings, "spin.speed=6000rpm").items():
        if path == "shaft.nodes":
            values[path] = _nodes(text)
        else:
            values[path] = quantity(text, scene.unit(path), f"--set {path}")
    return scene.replace(values)


def _nodes(text: str) -> int | str:
    """Nodes of `--set shaft.nodes`."""
    if text == "auto" or text.isdecimal():
        return text if text == "auto" else int(text)
    raise ValueError(
        f'--set shaft.nodes must be a whole number, such as 12, or "auto", but is {text!r}.'
    )


def assignments(option: str, texts: Sequence[str] | None, example: str) -> dict[str, str]:
    """`path=value` texts by path."""
    found = {}
    for text in texts or ():
        path, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not path:
            raise ValueError(f"{option} must be path=value, as in {example}, but is {text!r}.")
        found[path] = value
    return found


def swept_axes(scene: Scene, over: Sequence[str] | None) -> dict[str, np.ndarray]:
    """Values [SI] of `--over` by path."""
    axes = {}
    for path, text in assignments("--over", over, "spin.speed=0:6000rpm:61").items():
        axes[path] = swept_values(listed(text), scene, path, f"--over {path}")
    return axes


def start_with(
    study: Mapping[str, Any],
    radius: str | None,
    rate: str | None,
    angle: str | None,
    swept: Sequence[str] = (),
) -> AbstractStart:
    """The start of a scene file's `[sweep]` table, with the changes of the options."""
    given = {"radius": radius, "rate": rate, "angle": angle}
    values = dict(study.get("start", {})) | {
        name: quantity(text, START[name], f"--start-{name}")
        for name, text in given.items()
        if text is not None
    }
    if any(path.removeprefix("start.") in START for path in swept):
        values = {"radius": 0.0} | values
    if values and "radius" not in values:
        raise ValueError("A start with a rate or an angle needs a radius; add --start-radius.")
    return Whirl(**values) if values else AtRest()


def count_or_auto(text: str | None, option: str) -> Any:
    """A positive whole number, "auto", or None."""
    if text is None or text == "auto":
        return text
    if not text.isdecimal() or not 1 <= int(text) <= MOST:
        raise ValueError(
            f'{option} must be a whole number from 1 to {MOST}, or "auto", but is {text!r}.'
        )
    return int(text)


def optional(text: str | None, unit: str, option: str) -> float | None:
    """The quantity of an option, None if it is left out."""
    return None if text is None else quantity(text, unit, option)


def revolution(scene: Scene, text: str | None) -> float | str | None:
    """The time [s] or the shaft of `--period`, None if it is left out."""
    return text if text in scene.shafts else optional(text, "s", "--period")


def place(scene: Scene, text: str | None) -> Any:
    """The station [m] of `--at`, of several shafts with a name; None if it is left out."""
    return None if text is None else station(text, scene.shafts, "--at")


def interval(low: str | None, high: str) -> tuple[float, float]:
    """The speeds of `--from` and `--to` [rad/s]."""
    start, stop = quantity(low or "0", "rad/s", "--from"), quantity(high, "rad/s", "--to")
    if start == stop:
        raise ValueError(f"--to must be another speed than --from, but both are {stop:g} rad/s.")
    return start, stop


def operating_speed(scene: Scene) -> float | None:
    """The speed [rad/s] at which a rotor operates, None of one that is at rest or runs up or down."""
    constant = isinstance(scene.spin, ConstantSpeed)
    return float(scene.spin.speed) or None if constant else None


def speeds_between(scene: Scene, low: str | None, high: str | None, points: int) -> np.ndarray:
    """Speeds [rad/s] of `--from`, `--to` and `--points`, by default in the sense of the scene.

    Tables of coefficients limit them.
    """
    last = 0.0 if high is None else quantity(high, "rad/s", "--to")
    sense = math.copysign(1.0, last) if last else float(scene.spin.sense)
    span = speed_range(scene, sense)
    if span is not None:
        ends = (repr(sense * float(end)) for end in span)
        low, high = (own or end for own, end in zip((low, high), ends, strict=True))
    if high is None:
        running = abs(float(scene.spin.speed))
        driven = of_first_order(scene.effects)  # by controllers, so without critical speeds
        count = 1 if running else 2
        marks = [] if driven else np.abs(critical_speeds(scene, count).forward).tolist()
        high = repr(sense * max(BEYOND * running, 1.25 * max(marks, default=0.0)))
    return np.linspace(*interval(low, high), points)


def instants(scene: Scene, duration: str | None, samples: int, times: str | None) -> np.ndarray:
    """Times [s] of `--duration` and `--samples`, or of `--times`."""
    if times is not None:
        if duration is not None:
            raise ValueError("--times and --duration exclude each other; leave out --duration.")
        values = value_list(listed(times), "s", "--times")
        for before, after in itertools.pairwise(values.tolist()):
            if not before < after:
                raise ValueError(f"--times must ascend, but has {before:g} s and then {after:g} s.")
        return values
    stop = _length(scene) if duration is None else quantity(duration, "s", "--duration")
    if not stop > 0:
        raise ValueError(f"--duration must be above 0, but is {stop:g} s.")
    return np.linspace(0.0, stop, samples)


def refuse_revolutions(given: dict[str, Any]) -> None:
    """Raise if an option that is for whole revolutions is given, by its name, for a run along times."""
    for name, value in given.items():
        if value is not None:
            raise ValueError(
                f"{name} is for whole revolutions, but this motion is along times; leave {name} out, or "
                "take a constant speed without --times."
            )


def _length(scene: Scene) -> float:
    """Default duration of a run [s]; see `Duration`."""
    spin = scene.spin
    if spin.kinks is not None:
        return float(spin.kinks[-1])
    if isinstance(spin, Drive):
        found = settled(spin, float(spin.inertia(polar_inertia(scene))))
        if found.time > 0:
            return found.time
    speed = abs(float(spin.speed))
    if not speed:
        raise ValueError(
            "A run at speed 0 has no default duration; add --duration, as in --duration 2s."
        )
    return REVOLUTIONS * 2 * math.pi / speed


def suggested(scene: Scene) -> Any:
    """The station [m] that `Scene.stations` suggests, of several shafts with the name of its own."""
    (at, *_), (name, *_) = scene.seen()
    return float(at) if name is None else (name, float(at))


def moving_station(scene: Scene) -> Any:
    """The station [m] that `Scene.stations` suggests if it can move, else one that can, else None.

    Of several shafts it has the name of its own.
    """
    if scene.shafts:
        return suggested(scene)
    placed = [getattr(effect, "at", None) for effect in scene.effects]
    stations = [at for at in placed if at is not None]
    every = [float(at) for at in (*scene.stations(), *stations, scene.shaft.length)]
    known = [at for at in every if scene.shaft.reason_against(at) is None]
    moves = np.asarray(_largest_of_rows(scene, jnp.array(known))) > 1e-9
    return next((at for at, one in zip(known, moves, strict=True) if one), None)


@compiled_quickly
def _largest_of_rows(scene: Scene, stations: jax.Array) -> jax.Array:
    """Largest entry of the row of displacement of every station."""
    rows = jax.vmap(scene.line().row)(stations)
    return jnp.max(jnp.abs(rows), axis=1, initial=0.0)


def listed(text: str) -> str | list[str]:
    """A text with colons unchanged, any other text split at its commas."""
    return text if ":" in text else [part.strip() for part in text.split(",")]


def rpm(speed: float) -> float:
    """Revolutions per minute of a speed [rad/s]."""
    return speed * 30 / math.pi
