"""Campbell diagram: whirl frequency and growth rate against the speed of rotation."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator, SymmetricalLogLocator

from ..analysis import Campbell, CriticalSpeeds
from ..analysis.campbell import OVERDAMPED
from ..equations.pencil import is_rounding
from . import colours, labels, page
from .marks import draw_operating
from .units import speed_unit


Branches = Float[np.ndarray, "w m"]
Mask = Bool[np.ndarray, "w m"]

_COLOURS = {1: colours.FORWARD, -1: colours.BACKWARD, 0: colours.DARK}  # of rings, by sense
_SENSES = {1: "forward", -1: "backward", 0: "straight"}
_DASHES = ("--", "-.", (0, (1, 1)), (0, (5, 1, 1, 1, 1, 1)))  # of lines of several shafts
_LINE = 9.5  # pt: distance of lines of the list
_APART = 0.08  # least distance of rings, over the range, with damping ratios beside them
_SEEN = 0.01  # smallest damping ratio that is written beside a ring


def campbell(
    result: Campbell,
    axes: Any = None,
    *,
    mirrored: bool = False,
    orders: Sequence[float | int] = (1,),
    highest: float | int | None = None,
    critical: CriticalSpeeds | None = None,
    operating: float | int | tuple[float | int, float | int] | None = None,
) -> tuple[Axes, Axes]:
    """Whirl frequency `|Im lambda|` above and growth rate `Re lambda` below, against spin speed.

    Lines `n Omega` are drawn for `orders` n, with a ring where a branch crosses one: at order 1 the rings
    are the critical speeds of the damped rotor. They are numbered, and listed beside the Axes with speed,
    sense and damping ratio D, which is also written at a ring that is alone, from 0.01 on. Above
    `OVERDAMPED` there is no ring, but a line of the list with a dash. In the axes of the shaft
    (`result.frame` is "rotating") an unbalance is constant, so a speed is critical where a frequency is
    zero; the only line there is that of the weight, `Omega`. Of several shafts each has lines of its own,
    dashed, and the sense of a ring is that relative to the shaft of its line.

    Args:
        result: `jaxrotor.Campbell` diagram.
        axes: two Axes, upper and lower; a new figure if None.
        mirrored: draw backward whirl at negative speeds, of a reversed rotor at positive ones.
        orders: cycles per revolution of the lines, (1, 2) for a line of twice per revolution, too.
        highest: end of the frequency axis [rad/s], by default above the highest branch and cross.
        critical: undamped `jaxrotor.critical_speeds`, marked by crosses and listed, too.
        operating: operating speed [rad/s], a vertical line, or the slowest and the fastest, shaded.

    Returns:
        The upper Axes, frequency, and the lower, growth rate [1/s].

    Raises:
        ValueError: `axes` are not two, or `mirrored` is set but there is no backward whirl or the speeds
            are of both senses.

    Source: Brysin, Nikiforov (2019), Figs. 3, 4; their decay is minus the growth here.
    """
    factor, unit = speed_unit()
    values = np.asarray(result.values)
    speeds, frequency = factor * np.asarray(result.speeds), factor * np.abs(np.imag(values))
    growth = np.real(values)
    growth = np.where(is_rounding(growth, values), 0.0, growth)
    directions = _directions(result)
    if mirrored:
        _check_mirror(np.asarray(result.speeds), [name for name, _, _ in directions])
    rotating = result.frame == "rotating"
    lines = () if rotating else orders

    upper, lower = page.pair(axes, 170, 120)
    low, high = float(speeds.min()), float(speeds.max())
    farthest = max(-low, high)
    left, right = (-farthest, farthest) if mirrored else (low, high)
    ends = np.array([left, np.clip(0.0, left, right), right])
    if result.line is not None and not rotating:
        _draw_lines(upper, result, orders, left, right, mirrored)
    for order in (1,) if rotating else lines if result.line is None else ():
        name = "weight" if rotating else "synchronous" if order == 1 else f"{order:g} a revolution"
        dashes = "-" if order == 1 else ":"
        page.curve(upper, ends, order * np.abs(ends), colours.GREY, name, 0.8, linestyle=dashes)
    for under, (name, colour, shown) in enumerate(directions):  # forward whirl is drawn on top
        x = -speeds if mirrored and name == "backward whirl" else speeds
        name = name if result.line is None else name.replace("whirl", f"of {result.line.shafts[0]}")
        for ax, part in ((upper, frequency), (lower, growth)):
            x_all, y_all = _joined(x, part, shown)
            page.curve(ax, x_all, y_all, colour, name, zorder=2.5 - 0.1 * under)
    listed = _draw_crossings(upper, result, lines, mirrored)
    if critical is not None and lines:
        listed += _draw_undamped(upper, critical, mirrored, low, high)
    _list(upper, listed, upper if result.line is None else lower)

    for ax in (upper, lower):
        ax.margins(x=0)
    if operating is not None:
        slowest, fastest = np.broadcast_to(operating, 2).tolist()
        if max(low, factor * min(slowest, fastest)) <= min(high, factor * max(slowest, fastest)):
            draw_operating((upper, lower), slowest, fastest)
    if highest is None:
        crosses = [] if critical is None or not lines else factor * np.asarray(critical.speeds)
        inside = [abs(speed) for speed in crosses if low <= speed <= high]
        upper.set_ylim(0.0, 1.05 * max([frequency.max(initial=1e-9), *inside]))
    else:
        upper.set_ylim(0.0, factor * highest)
    _scale_growth(lower, growth)
    page.zero(lower)
    name = "frequency in the axes\nof the shaft" if rotating else "whirl frequency"
    page.finish(upper, y=f"{name} [{unit}]", columns=4)
    other = f", backward whirl at {'positive' if low < 0 else 'negative'}" if mirrored else ""
    label = labels.spin("spin speed", speeds) + other
    return upper, page.finish(lower, label, "growth rate [1/s]")


def _directions(result: Campbell) -> list[tuple[str, str, Mask]]:
    """Name, colour and points of each direction of whirl, if there are directions."""
    if result.forward is None:
        return [("whirl", colours.DARK, np.ones(result.values.shape, bool))]
    forward, values = np.asarray(result.forward), np.asarray(result.values)
    still = np.asarray(is_rounding(np.imag(values), values))
    found = [
        ("forward whirl", colours.FORWARD, forward > 0),
        ("backward whirl", colours.BACKWARD, forward < 0),
        ("nearly straight", colours.ORANGE, (forward == 0) & ~still),
        ("no whirl", colours.UNDEFINED, (forward == 0) & still),
    ]
    if not result.circular:  # a branch that changes its direction has no gap there
        for _, _, shown in found:
            shown[1:] |= shown[:-1].copy()
    return [row for row in found if row[2].any()]


def _draw_lines(
    ax: Axes,
    result: Campbell,
    orders: Sequence[float | int],
    left: float,
    right: float,
    mirrored: bool,
) -> None:
    """Dashed lines `n |Omega_k|` of every shaft between two speeds of the first one, as drawn."""
    assert result.line is not None
    x = np.linspace(left, right, 401)  # a line has a kink where its shaft is at rest
    first = np.abs(x) * np.sign(np.sum(result.speeds)) if mirrored else x
    turning = speed_unit()[0] * np.asarray(result.line.at(jnp.asarray(first / speed_unit()[0])))
    for k, shaft in enumerate(result.line.shafts):
        for order in orders:
            style: Any = {"linestyle": _DASHES[k % len(_DASHES)]}
            y = order * np.abs(turning[:, k])
            page.curve(ax, x, y, colours.GREY, f"{order:g}x {shaft}", 0.9, **style)


def _check_mirror(speeds: Float[np.ndarray, " w"], directions: list[str]) -> None:
    if "backward whirl" not in directions:
        raise ValueError(
            "A mirrored axis separates forward from backward whirl, but this result has no backward "
            "branch; leave `mirrored` out."
        )
    if speeds.min() < 0 < speeds.max():
        raise ValueError(
            "A mirrored axis puts backward whirl on the other side of 0, but the speeds themselves are "
            f"from {speeds.min():g} to {speeds.max():g} rad/s; begin at 0."
        )


def _joined(
    x: Float[np.ndarray, " w"], branches: Branches, shown: Mask
) -> tuple[np.ndarray, np.ndarray]:
    """All branches as one curve, with gaps between them and where they are not `shown`."""
    width = branches.shape[1]
    y = np.vstack([np.where(shown, branches, np.nan), np.full(width, np.nan)])
    return np.tile(np.append(x, np.nan), width), y.ravel(order="F")


def _draw_crossings(
    ax: Axes, result: Campbell, orders: Sequence[float | int], mirrored: bool
) -> list[tuple[str, str]]:
    """Rings where branches cross a line, numbered; none where damping removes the peak.

    Returns:
        Text and colour of each line of the list of rings.
    """
    name = "critical speed, damped" if tuple(orders) == (1,) else "crossing"
    factor, unit = speed_unit()
    shafts = (None,) if result.line is None else result.line.shafts
    kinds = [(n, shaft) for shaft in shafts for n in orders]
    every = [(n, *one) for n in kinds for one in zip(*result.crossings(*n), strict=True)]
    seen = [one for one in every if one[3] <= OVERDAMPED]
    span = _APART * np.ptp(result.speeds)
    listed, rings = [], {(way, kind): [] for way in _COLOURS for kind in kinds}
    near = 2 * _APART * np.max(np.abs(np.imag(result.values)))
    for order, speed, frequency, ratio, way in seen:
        number, colour = len(listed) + 1, _COLOURS[int(way)]
        back = mirrored and way * _same_sense(result, order[1], speed) < 0
        at = factor * (-speed if back else speed), factor * frequency
        rings[int(way), order].append(at)
        alone = result.line is None and sum(abs(other[1] - speed) < span for other in seen) == 1
        text = rf"$\bf{{{number}}}$" + (f"  {ratio:.2g}" if alone and ratio >= _SEEN else "")
        beside: Any = {"textcoords": "offset points", "fontsize": 7, "color": colour, "zorder": 5}
        place: Any = ((4, -9), "left") if way < 0 else ((-4, 4), "right")
        if order[1] is not None:  # beside the ring of another shaft on the same branch
            alike = [one[1] for one in seen if one[4] == way and abs(one[2] - frequency) < near]
            right = (speed > np.mean(alike)) != back
            place = ((4 if right else -4, -9 if way < 0 else 4), "left" if right else "right")
        late = at[0] > factor * (np.max(result.speeds) - span)
        if late and place[1] == "left":  # where the list of rings is
            place = (-4, place[0][1]), "right"
        ax.annotate(text, at, place[0], ha=place[1], **beside)
        listed.append((f"{number}", order, speed, ratio, way))
    for (way, _), places in rings.items():
        if places:
            style: Any = {"color": _COLOURS[way], "markersize": 4.0, "markerfacecolor": "white"}
            style |= {"label": page.once(ax, name), "zorder": 4 + 0.01 * way}
            ax.plot(*zip(*places, strict=True), "o", **style)
    hidden = [("\N{EN DASH}", *one[:2], *one[3:]) for one in every if one[3] > OVERDAMPED]
    if hidden:
        label = f"{len(hidden)} damped by over {OVERDAMPED:g}"
        ax.plot([], [], linestyle="none", label=label)
    rows = []
    for mark, order, speed, ratio, way in (*listed, *hidden):
        sense = "whirl" if result.forward is None else _SENSES[int(way)]
        text = f"{mark}  {labels.number(factor * speed)} {unit}, {sense}, D = {ratio:.2g}"
        (times, shaft) = order
        text += f", {times:g}x {shaft}" if shaft else "" if times == 1 else f" ({times:g}x)"
        rows.append((text, colours.GREY if mark == "\N{EN DASH}" else _COLOURS[int(way)]))
    return rows


def _same_sense(result: Campbell, shaft: str | None, speed: float) -> int:
    """-1 where a shaft turns against the first one, at a speed of that; else 1."""
    if result.line is None or shaft is None:
        return 1
    own = result.line.at(jnp.asarray([speed]))[0, result.line.shafts.index(shaft)]
    return -1 if float(own) * speed < 0 else 1


def _draw_undamped(
    ax: Axes, critical: CriticalSpeeds, mirrored: bool, start: float, end: float
) -> list[tuple[str, str]]:
    """Crosses on the synchronous line at the critical speeds of the undamped rotor.

    Returns:
        Text and colour of each line of the list of crosses.
    """
    factor, unit = speed_unit()
    speeds, kinds = factor * np.asarray(critical.speeds), np.array(critical.kinds)
    heights = np.abs(speeds)
    if critical.line is not None and critical.operating is not None:
        heights = factor * np.abs(np.asarray(critical.operating)[:, critical.line.by])
        speeds = factor * np.asarray(critical.operating)[:, 0]
    inside = (speeds >= start) & (speeds <= end)
    x = np.where((kinds == "backward") & mirrored, -speeds, speeds)[inside]
    style = {"linestyle": "none", "marker": "x", "markersize": 4.0, "color": colours.DARK}
    ax.plot(x, heights[inside], label="critical speed, undamped", zorder=4.5, **style)
    rows = zip(speeds[inside].tolist(), kinds[inside].tolist(), strict=True)
    cross = "\N{MULTIPLICATION SIGN}"
    return [
        (f"{cross}  {labels.number(speed)} {unit}, {kind}", colours.DARK) for speed, kind in rows
    ]


def _list(ax: Axes, rows: list[tuple[str, str]], last: Axes) -> None:
    """Write lines of text [colour] to the right of the Axes; those that do not fit are counted.

    There is room down to the lower end of the `last` Axes.
    """
    figure: Any = ax.figure
    height = (ax.bbox.y1 - last.bbox.y0) / figure.dpi * 72  # pt
    fits = max(int(height / _LINE) - 1, 3)
    if len(rows) > fits:
        rows = [*rows[:fits], (f"and {len(rows) - fits} more", colours.DARK)]
    for line, (text, colour) in enumerate(rows):
        place: Any = {"xycoords": "axes fraction", "textcoords": "offset points", "va": "top"}
        style: Any = {"fontsize": 7, "color": colour, "annotation_clip": False}
        ax.annotate(text, (1.0, 1.0), (6.0, -_LINE * line), **place, **style)


def _scale_growth(ax: Axes, growth: Branches) -> None:
    """Make the growth axis nearly logarithmic if fast branches would hide the sign of the slowest."""
    sizes = np.abs(growth).max(axis=0)
    sizes = sizes[sizes > 0]
    if not sizes.size:
        ax.set_ylim(-1.0, 1.0)
    elif sizes.max() > 30 * sizes.min():
        ax.set_yscale("asinh", linear_width=sizes.min())
        least = 10 ** np.ceil(np.log10(sizes.min()))  # ticks of smaller decades would overlap
        ax.yaxis.set_major_locator(SymmetricalLogLocator(base=10, linthresh=least))
        ax.yaxis.set_minor_locator(NullLocator())
