"""Explorer: a bifurcation diagram that shows the motion behind a point that is clicked."""

import re
import textwrap
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ..core.outcome import STATUS
from ..equations.start import AbstractStart, AtRest, Whirl
from ..files.toml import loads
from ..motion.simulate import Response, simulate
from ..solvers import Exponential
from ..sweeps.sweep import placed
from . import colours, page
from .bifurcation import bifurcation
from .labels import coordinate, ensemble, only_swept
from .orbit import orbit
from .whirl import whirl_spectrum


LONGEST = 50  # revolutions of a motion that are shown, its last
_KEYS = {"left": -1, "right": 1}


class Explorer:
    """The diagram of a sweep on the left; orbit and whirl spectrum of one of its lanes on the right.

    A click takes the lane that is nearest to it; the arrow keys left and right go on to its neighbours.

    Attributes:
        upper: Axes of the diagram, with the precession index in `lower`.
        lower: Axes of the index.
        orbit: Axes of the orbit.
        spectrum: Axes of the spectrum.
        response: the motion that is shown, of `simulate`; None before the first, or if there is none.
    """

    def __init__(self, dataset: xr.Dataset, run: dict[str, Any]):
        self.response: Response | None = None
        self._run = run
        others = ensemble(dataset, "index")
        dim = only_swept(dataset, "index", others)
        self._values, self._label = coordinate(dataset, dim)
        self._lane = 0
        style: Any = {"figsize": page.inches(240, 130), "layout": "constrained"}
        parts: Any = [["upper", "orbit"], ["lower", "spectrum"]]
        figure, axes = plt.subplot_mosaic(parts, width_ratios=(1.5, 1.0), **style)
        self.figure = figure
        self.upper, self.lower = axes["upper"], axes["lower"]
        self.orbit, self.spectrum = axes["orbit"], axes["spectrum"]
        self.lower.sharex(self.upper)
        bifurcation(dataset, (self.upper, self.lower), size=3)
        # Read once, not at every click: the data set may be one on disk.
        self._data = dataset[["index", "extrema", "status"]].transpose(dim, *others, ...).load()
        mark: Any = {"color": colours.DARK, "linewidth": 0.8, "visible": False}
        self._marks = [ax.axvline(self._values[0], **mark) for ax in (self.upper, self.lower)]
        self._say("click a point of the diagram")
        figure.canvas.mpl_connect("button_press_event", self._clicked)
        figure.canvas.mpl_connect("key_press_event", self._pressed)

    def show(self, lane: int) -> None:
        """Show the motion of a lane, counted as in the flattened data set, along the diagram first."""
        self._lane, self.response = lane % self._data["index"].size, None
        number = self._lane // self._starts
        for mark in self._marks:
            mark.set(xdata=[self._values[number]] * 2, visible=True)
        scene, how = motion_of(self._data, self._lane)
        try:
            self.response = simulate(scene, **{**how, **self._run})
        except (RuntimeError, ValueError) as error:
            self._say(str(error))
        else:
            self._draw()
        status = STATUS[int(self._data["status"].values.ravel()[self._lane])]
        about = f"{self._label}: {self._values[number]:.6g}"
        self.orbit.set_title(f"{about}\nstatus {status}", fontsize=page.TEXT, loc="left", pad=18)
        self.figure.canvas.draw_idle()

    def near(self, ax: Axes, x: float, y: float) -> int:
        """The lane that is nearest to a point of a diagram: its value, then what is drawn there."""
        number = int(np.argmin(np.abs(self._values - x)))
        lanes = number * self._starts + np.arange(self._starts)
        if ax is self.upper:
            drawn = 1e3 * self._data["extrema"].values.reshape(self._data["index"].size, -1)[lanes]
        else:
            drawn = self._data["index"].values.reshape(-1, 1)[lanes]
        off = np.where(np.isfinite(drawn), np.abs(drawn - y), np.inf).min(axis=1)
        return int(lanes[np.argmin(off)])

    def wait(self) -> None:
        """Open the window and wait until it is closed."""
        canvas: Any = self.figure.canvas
        if canvas.required_interactive_framework is None:
            raise ValueError(
                f"No window can be opened here (matplotlib draws by {plt.get_backend()}); write a picture "
                "by --out FILE, or install what opens windows, as by pip install PyQt6."
            )
        plt.show()

    @property
    def _starts(self) -> int:
        """Lanes at each value of the diagram."""
        return self._data["index"].size // self._values.size

    def _clicked(self, event: Any) -> None:
        bar = getattr(self.figure.canvas, "toolbar", None)
        if event.inaxes in (self.upper, self.lower) and not (bar and bar.mode):  # no zoom
            self.show(self.near(event.inaxes, event.xdata, event.ydata))

    def _pressed(self, event: Any) -> None:
        if event.key in _KEYS:
            self.show(self._lane + _KEYS[event.key] * self._starts)

    def _draw(self) -> None:
        for ax in (self.orbit, self.spectrum):
            ax.clear()
            ax.set_axis_on()
        orbit(self.response, ax=self.orbit)
        try:
            whirl_spectrum(self.response, self.spectrum)
        except ValueError as error:
            _write(self.spectrum, str(error))

    def _say(self, sentence: str) -> None:
        for ax in (self.orbit, self.spectrum):
            _write(ax, "")
        _write(self.orbit, sentence)


def _write(ax: Axes, sentence: str) -> None:
    ax.clear()
    ax.set_axis_off()
    text = textwrap.fill(sentence, 44)
    style: Any = {"transform": ax.transAxes, "fontsize": page.TEXT, "ha": "center", "va": "center"}
    ax.text(0.5, 0.5, text, **style)


def explore(dataset: xr.Dataset, **run: Any) -> Explorer:
    """A window on a sweep: click a point of its diagram to see its orbit and whirl spectrum.

    The lane is simulated again, by what the data set says of it, and its last revolutions are drawn.
    Windows need an interactive backend of matplotlib (`plt.show()`, or `%matplotlib widget`).

    Args:
        dataset: of a sweep, with `extrema` and `index`, over one parameter and any starts; of more
            parameters choose values by `.sel`.
        **run: options of `simulate` other than those of the sweep, such as `keep`.
    """
    if "scene" not in dataset.attrs or "status" not in dataset:
        raise ValueError(
            "Only a data set of `sweep` can be explored: this one has no scene or status."
        )
    if "branch" in dataset.dims or "branch" in dataset.coords:
        raise ValueError(
            "A lane of a sweep with `carry` comes of the whole way before it, so it cannot be run alone; "
            "explore a sweep without."
        )
    motion_of(dataset, 0)  # refuses here what a click could not show
    return Explorer(dataset, run)


def motion_of(dataset: xr.Dataset, lane: int) -> tuple[Any, dict[str, Any]]:
    """Scene of a lane, and how `simulate` repeats its motion."""
    about, status = dataset.attrs, dataset["status"]
    at = dict(zip(status.dims, np.unravel_index(lane, status.shape), strict=True))
    coords = status.isel(at).coords
    values = {str(name): float(c) for name, c in coords.items() if "." in str(name)}
    scene, start = placed(loads(about["scene"]), _start(about["start"]), values)
    keep, period = int(about["keep"]), about["period"]
    how = {
        "revolutions": int(about["settle"]) + keep,
        "steps_per_revolution": int(about["steps_per_revolution"]),
        "start": start,
        "solver": _solver(about["solver"]),
        "keep": min(keep, LONGEST),
        "at": float(about["station"]),
        "period": period if isinstance(period, float) else None,
    }
    return scene, how


def _start(text: str) -> AbstractStart:
    """A start from how a data set names it."""
    if text.startswith("AtRest"):
        return AtRest()
    fields = re.findall(r"(\w+)=Array\(([^,]+),", text)
    if not text.startswith("Whirl") or not fields:
        raise ValueError(
            f"A sweep from {text.split('(')[0]} cannot be run again from its data set; only one from "
            "AtRest or Whirl can."
        )
    return Whirl(**{name: float(value) for name, value in fields})


def _solver(text: str) -> Exponential:
    found = re.fullmatch(r"Exponential\(order=(\d), basis='(\w+)'(, located=True)?\)", text)
    if found is None:
        raise ValueError(
            f"A sweep by {text} cannot be run again from its data set; only `Exponential` can."
        )
    order, basis, located = found.groups()
    kind: Any = Exponential
    return kind(order=int(order), basis=basis, located=bool(located))
