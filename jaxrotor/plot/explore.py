"""Explorer: a bifurcation diagram that shows the motion behind a point that is clicked."""

import textwrap
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ..core.outcome import STATUS
from ..motion.history import TimeHistory
from ..motion.simulate import simulate
from . import colours, page
from .bifurcation import bifurcation
from .labels import coordinate, ensemble, only_swept
from .lane_motions import check_lanes, motion_of
from .orbit import orbit
from .spectra import whirl_spectrum
from .units import length_unit


_KEYS = {"left": -1, "right": 1}


class Explorer:
    """The diagram of a sweep on the left; orbit and whirl spectrum of one of its lanes on the right.

    A click shows the lane nearest to it; the arrow keys left and right step to its neighbours.

    Attributes:
        upper: Axes of the diagram, with the precession index in `lower`.
        lower: Axes of the index.
        orbit: Axes of the orbit.
        spectrum: Axes of the spectrum.
        response: the motion shown, as from `simulate`; None before the first, or if it cannot be computed.
    """

    def __init__(self, dataset: xr.Dataset, run: dict[str, Any]):
        self.response: TimeHistory | None = None
        self._run, self._lane = run, 0
        self._factor = length_unit("mm")[0]
        others = ensemble(dataset, "index")
        dim = only_swept(dataset, "index", others)
        self._values, self._label = coordinate(dataset, dim)
        parts: Any = [["upper", "orbit"], ["lower", "spectrum"]]
        style: Any = {"figsize": page.inches(240, 130), "layout": "constrained"}
        self.figure, axes = plt.subplot_mosaic(parts, width_ratios=(1.5, 1.0), **style)
        self.upper, self.lower = axes["upper"], axes["lower"]
        self.orbit, self.spectrum = axes["orbit"], axes["spectrum"]
        self.lower.sharex(self.upper)
        bifurcation(dataset, (self.upper, self.lower), size=3)
        # Read once, not at every click, because the data set may be on disk.
        self._data = dataset[["index", "extrema", "status"]].transpose(dim, *others, ...).load()
        self._starts = self._data["index"].size // self._values.size  # lanes at each value
        mark: Any = {"color": colours.DARK, "linewidth": 0.8, "visible": False}
        self._marks = [ax.axvline(self._values[0], **mark) for ax in (self.upper, self.lower)]
        self._show_text("click a point of the diagram")
        self.figure.canvas.mpl_connect("button_press_event", self._clicked)
        self.figure.canvas.mpl_connect("key_press_event", self._pressed)

    def show(self, lane: int) -> None:
        """Show the motion of a lane, by its number in the flattened data set, the swept axis first.

        Args:
            lane: number of the lane; negative ones count from the end.
        """
        self._lane, self.response = lane % self._data["index"].size, None
        value = self._values[self._lane // self._starts]
        for mark in self._marks:
            mark.set(xdata=[value] * 2, visible=True)
        scene, how = motion_of(self._data, self._lane)
        try:
            self.response = simulate(scene, **{**how, **self._run})
        except (RuntimeError, ValueError) as error:
            self._show_text(str(error))
        else:
            self._draw()
        status = STATUS[int(self._data["status"].values.ravel()[self._lane])]
        text = f"{self._label}: {value:.6g}\nstatus {status}"
        self.orbit.set_title(text, fontsize=page.TEXT, loc="left", pad=18)
        self.figure.canvas.draw_idle()

    def near(self, ax: Axes, x: float, y: float) -> int:
        """The lane nearest to a point of a diagram: at the nearest value, the nearest height.

        Args:
            ax: `upper` or `lower`.
            x: value of the swept parameter, in the unit of the diagram.
            y: height in the unit of the diagram.

        Returns:
            Its number in the flattened data set.
        """
        number = int(np.argmin(np.abs(self._values - x)))
        lanes = number * self._starts + np.arange(self._starts)
        name, factor = ("extrema", self._factor) if ax is self.upper else ("index", 1.0)
        drawn = factor * self._data[name].values.reshape(self._data["index"].size, -1)[lanes]
        off = np.where(np.isfinite(drawn), np.abs(drawn - y), np.inf).min(axis=1)
        return int(lanes[np.argmin(off)])

    def wait(self) -> None:
        """Open the window and wait until it is closed.

        Raises:
            ValueError: if the backend of matplotlib opens no windows.
        """
        canvas: Any = self.figure.canvas
        if canvas.required_interactive_framework is None:
            raise ValueError(
                f"No window can be opened here (matplotlib draws by {plt.get_backend()}); write a picture "
                "by --out FILE, or install a backend that opens windows, such as PyQt6."
            )
        plt.show()

    def _clicked(self, event: Any) -> None:
        bar = getattr(self.figure.canvas, "toolbar", None)
        if event.inaxes in (self.upper, self.lower) and not (bar and bar.mode):  # no zoom
            self.show(self.near(event.inaxes, event.xdata, event.ydata))

    def _pressed(self, event: Any) -> None:
        if event.key in _KEYS:
            self.show(self._lane + _KEYS[event.key] * self._starts)

    def _draw(self) -> None:
        """Draw the orbit and the spectrum of the motion."""
        for ax in (self.orbit, self.spectrum):
            ax.clear()
            ax.set_axis_on()
        orbit(self.response, ax=self.orbit)
        try:
            whirl_spectrum(self.response, self.spectrum)
        except ValueError as error:
            _write(self.spectrum, str(error))

    def _show_text(self, sentence: str) -> None:
        """Show a sentence in place of the orbit and the spectrum."""
        _write(self.orbit, sentence)
        _write(self.spectrum, "")


def _write(ax: Axes, sentence: str) -> None:
    """Replace what axes show by a sentence."""
    ax.clear()
    ax.set_axis_off()
    text = textwrap.fill(sentence, 44)
    style: Any = {"transform": ax.transAxes, "fontsize": page.TEXT, "ha": "center", "va": "center"}
    ax.text(0.5, 0.5, text, **style)


def explore(dataset: xr.Dataset, **run: Any) -> Explorer:
    """A window on a sweep: click a point of its diagram to see its orbit and whirl spectrum.

    The lane is simulated again from the attributes of the data set, and its last revolutions are drawn.
    Windows need an interactive backend of matplotlib (`plt.show()`, or `%matplotlib widget`).

    Args:
        dataset: data set of a sweep, with `extrema` and `index`, over one parameter and any starts;
            where it has more parameters, select values by `.sel`.
        **run: options of `simulate` that replace those of the sweep, such as `keep`.

    Returns:
        The explorer; `show` and `wait` work without a click.

    Raises:
        ValueError: if the data set is none of `sweep`, its states were carried from lane to lane, or its
            start or solver cannot be built from its attributes.
    """
    check_lanes(dataset)
    motion_of(dataset, 0)  # raises here if a click could show nothing
    return Explorer(dataset, run)
