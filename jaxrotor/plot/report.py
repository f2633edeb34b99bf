"""Report: a self-contained HTML file of a run, to archive, send and print."""

import base64
import html
import io
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from ..core.tables import html_table
from ..files.draft import replacing
from ..files.toml import dumps, loads
from ..results.export import data_of
from ..scene import Scene
from .units import unit_of_text


IMAGES = {".png": "png", ".jpg": "jpeg", ".jpeg": "jpeg", ".gif": "gif", ".svg": "svg+xml"}
_ELSEWHERE = ("title", "scene", "assumption", "versions")  # attributes shown in other parts
_ACCURACY = ("error", "steps_per_revolution", "precision", "tolerance", "chosen")
_HEADS = ("", "unit", "count", "not a number", "smallest", "largest", "meaning")
TEMPLATE = Path(__file__).with_name("report.html")


def report(
    path: str | os.PathLike[str], *results: Any, figures: Sequence[Any] = (), title: str = ""
) -> None:
    """Write one HTML file of a run: scenes, figures, numbers, accuracy, status of lanes, versions.

    Speeds and small lengths in its tables are in the units of a `with plot.units(..)` block.
    The file is self-contained: figures are embedded, and it has no scripts or links. An existing file is
    replaced, but only once the new one is complete.

    Args:
        path: the file, which ends in .html.
        results: results of `simulate`, `run_up`, `reactions` and `sweep`, data sets, scenes.
        figures: picture files (.png, .svg, .gif, .jpg), and figures or Axes of matplotlib.
        title: heading, by default that of the first result.

    Raises:
        ValueError: the path does not end in .html, there is neither a result nor a figure, a figure is
            neither a picture file nor a figure or Axes, or a picture cannot be read.
    """
    target = Path(path)
    if target.suffix != ".html":
        raise ValueError(f"The name of a report must end in .html, but is {target.name}.")
    if not results and not figures:
        raise ValueError("A report needs a result, a scene or a figure, but has none; give one.")
    data = [data_of(result) for result in results if not isinstance(result, Scene)]
    given = [dumps(result) for result in results if isinstance(result, Scene)]
    given += [one.attrs["scene"] for one in data if "scene" in one.attrs]
    scenes = dict.fromkeys(given)  # each once
    title = title or next((str(one.attrs.get("title", "")) for one in data), "") or target.stem
    parts = [*map(scene_part, scenes), *_figures(figures), *map(numbers_part, data)]
    body = "\n".join([*parts, versions_part(data)])
    text = Template(TEMPLATE.read_text("utf-8")).substitute(title=html.escape(title), body=body)
    with replacing(target) as draft:
        draft.write_text(text, "utf-8", newline="\n")


# === parts


def scene_part(text: str) -> str:
    """Drawing, parameters and the scene file that reproduces it."""
    scene = loads(text, "the scene of a result")
    said = f'<p class="note">{html.escape(scene.assumption)}</p>' if scene.assumption else ""
    rows = []
    for path in scene.paths():
        leaves, unit = scene.leaves(path), scene.unit(path)
        known = [np.abs(leaf).max(initial=0.0) for leaf in leaves if leaf is not None]
        if known:
            factor, unit = unit_of_text(unit, float(max(known)), float(scene.shaft.length))
            texts = [_values(leaf, factor) for leaf in leaves]
            same = len(texts) > 1 and len(set(texts)) == 1
            values = f"{texts[0]} each" if same else ", ".join(texts)
            rows.append((path, values, "" if unit == "1" else unit))
    table = html_table(rows, ("parameter", "value", "unit"))
    file = f"<h3>Scene file</h3>\n<pre>{html.escape(text)}</pre>"
    return "\n".join(["<h2>Scene</h2>", said, _drawing(scene), table, file])


def _values(leaf: Any, factor: float) -> str:
    """Text of one or more numbers, times a factor; `-` where one of several effects has none."""
    return "-" if leaf is None else ", ".join(map(_short, factor * np.atleast_1d(leaf)))


def _drawing(scene: Scene) -> str:
    """The rotor to scale, or the reason why it cannot be drawn."""
    from . import rotor, write

    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "rotor.png"
        try:
            write(picture, lambda ax: rotor(scene, ax), 170, 75)
        except ValueError as error:
            return f"<p>{html.escape(str(error))}</p>"
        return image(picture.read_bytes(), "png", "the rotor, to scale")


def _figures(figures: Sequence[Any]) -> Iterator[str]:
    if figures:
        yield "<h2>Figures</h2>"
    for number, figure in enumerate(figures, 1):
        if isinstance(figure, str | os.PathLike):
            yield _picture(Path(figure))
            continue
        figure = getattr(figure, "figure", figure)  # that of the Axes
        if not hasattr(figure, "savefig"):
            raise ValueError(
                f"`figures` must be picture files, figures or Axes, but one is {figure!r}."
            )
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=150)
        yield image(buffer.getvalue(), "png", f"figure {number}")


def _picture(path: Path) -> str:
    kind = IMAGES.get(path.suffix.lower())
    if kind is None:
        raise ValueError(f"A picture must end in {', '.join(IMAGES)}, but is {path}.")
    try:
        return image(path.read_bytes(), kind, path.name)
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({error.strerror}); give another.") from None


def image(content: bytes, kind: str, caption: str) -> str:
    """A picture within the page, above its caption; `kind` is that of its MIME type, such as "png"."""
    text, coded = html.escape(caption), base64.b64encode(content).decode("ascii")
    source = f"data:image/{kind};base64,{coded}"
    return f'<figure><img alt="{text}" src="{source}"><figcaption>{text}</figcaption></figure>'


def numbers_part(data: Any) -> str:
    """Status of the lanes of a data set, accuracy, range of every variable, settings."""
    settings = {str(k): _short(value) for k, value in data.attrs.items() if k not in _ELSEWHERE}
    accuracy = [(name, settings.pop(name)) for name in _ACCURACY if name in settings]
    for name, one in data.data_vars.items():
        unit = f" {one.attrs.get('units', '')}".removesuffix(" 1").rstrip()
        known = [key for key in _ACCURACY if key in one.attrs]
        accuracy += [(f"{name}: {key}", f"{_short(one.attrs[key])}{unit}") for key in known]
    parts = [f"<h2>{html.escape(str(data.attrs.get('title', 'Data')))}</h2>"]
    for head, rows, heads, numbers in (
        ("Lanes", _lanes(data), ("status", "lanes"), (1,)),
        ("Accuracy", accuracy, (), ()),
        ("Numbers", _ranges(data), _HEADS, (2, 3, 4, 5)),
        ("Settings", list(settings.items()), (), ()),
    ):
        if rows:
            parts.append(f"<h3>{head}</h3>\n{html_table(rows, heads, numbers)}")
    return "\n".join(parts)


def _ranges(data: Any) -> list[tuple[str, ...]]:
    """Rows of the table of numbers, see `_HEADS`."""
    rows = []
    span = float(loads(data.attrs["scene"]).shaft.length) if "scene" in data.attrs else np.inf
    for name, one in [*data.coords.items(), *data.data_vars.items()]:
        if name == "status" or not np.issubdtype(one.dtype, np.number):
            continue
        values, unit = np.asarray(one.values).ravel(), str(one.attrs.get("units", ""))
        values = np.abs(values) if np.iscomplexobj(values) else values
        finite = values[np.isfinite(values)]
        factor, unit = unit_of_text(unit, float(np.abs(finite).max(initial=0.0)), span)
        ends = (finite.min(), finite.max()) if finite.size else ()
        told = [_short(factor * end) for end in ends] or ["", ""]
        missing, meaning = values.size - finite.size, str(one.attrs.get("long_name", ""))
        counts = str(values.size), str(missing or "")
        rows.append((str(name), "" if unit == "1" else unit, *counts, *told, meaning))
    return rows


def _lanes(data: Any) -> list[tuple[str, str]]:
    """Number of lanes of each status, in the words of the data."""
    if "status" not in data:
        return []
    words = str(data["status"].attrs.get("flag_meanings", "")).split()
    codes, counts = np.unique(np.asarray(data["status"].values), return_counts=True)
    named = [words[int(k)] if 0 <= int(k) < len(words) else str(k) for k in codes]
    return [(name.replace("_", " "), str(n)) for name, n in zip(named, counts, strict=True)]


def versions_part(data: Sequence[Any]) -> str:
    """Versions of the software that made the results and this page."""
    from ..results.provenance import versions

    known = lambda one, name, default: str(one.attrs.get(name, default))
    rows = [(known(one, "title", "data"), known(one, "versions", "")) for one in data]
    return "<h2>Versions</h2>\n" + html_table([*rows, ("this page", versions())], ())


def _short(value: Any) -> str:
    array = np.asarray(value)
    return f"{float(array):.7g}" if array.ndim == 0 and array.dtype.kind == "f" else str(value)
