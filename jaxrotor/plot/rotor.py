"""Rotor: side view of the shaft and its parts, to scale."""

from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle

from ..effects import (
    AnnularStator,
    BallBalancer,
    CoaxialShaft,
    Disc,
    Limiter,
    LoosePedestal,
    RollingBearing,
    Support,
    Unbalance,
)
from ..effects.base import AbstractCasing
from ..effects.rub import AbstractRub
from ..scene import Scene
from . import colours, labels, page, symbols
from .units import length_unit


BESIDE, ABOVE = 17.0, 19.0  # mm: labels beside the Axes, labels and legend below and above
LOWEST, HIGHEST, NARROWEST = 50.0, 110.0, 85.0  # mm: sizes of a figure
THICK = 0.5  # largest thickness of a disc, relative to the length of the shaft
HOUSED = (0.5, 0.65)  # upper and lower side of a casing, between axis and ground
SIZE, FLATTEST = 0.03, 0.1  # size of symbols, and least height over the axis, by the shaft's length
SHADES = ("0.85", "0.6", "0.75", "0.5")  # of several shafts
ROW = 4.0  # mm: height of a further row of the legend
IN_ROW = 4  # parts in a row of a legend that has several
DRAWN: tuple[type, ...] = (AnnularStator, Disc, BallBalancer, AbstractCasing, Limiter, CoaxialShaft)
DRAWN += (RollingBearing, Support, Unbalance, *symbols.SYMBOLS)


def rotor(scene: Scene, ax: Axes | None = None) -> Axes:
    """Shaft, discs, bearings, limiters and rings of a scene, drawn to scale from the side.

    A disc is drawn as the solid disc of its mass and moments of inertia, but thin if that would be thicker
    than half the length of the shaft. A limiter or ring is at its gap from the rim that it touches. Films,
    seals, magnets, cracks and couplings are symbols. Of several shafts each is at its place on the axis, a
    hollow one as a tube around what is inside it. Damping, weight and other effects without a shape are
    named under the figure.

    Args:
        scene: the scene to draw.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, radius over station. A new figure is as high as the rotor needs.
    """
    new = ax is None
    ax = page.single(ax, 170, 75)
    every = _bodies(scene)
    own = {body.name: body for body in every}
    left, right = min(body.left for body in every), max(body.right for body in every)
    length = right - left
    tall = [0.05 * length, *(_shaft(ax, body) for body in every)]
    tall += [_disc(ax, disc, length, own[disc.shaft]) for disc in scene.of(Disc)]
    tall += [_balls(ax, balls) for balls in scene.of(BallBalancer)]
    tall += [_rolling(ax, bearing) for bearing in scene.of(RollingBearing)]
    tall += [_stop(ax, stop, length) for stop in scene.of(AbstractRub)]
    size = SIZE * length
    drawn: list[Any] = [part for part in scene.effects if type(part) in symbols.SYMBOLS]
    for part in drawn:
        at = _drawn(part.at)
        reach = symbols.draw(ax, part, at, own[part.shaft].radius(at), size)
        tall.append(reach if part.on is None else 1.8 * reach)  # a casing begins below it
        if getattr(part, "sensor", None) is not None:
            sensor = _drawn(part.sensor)
            symbols.draw_sensor(ax, sensor, own[part.shaft].radius(sensor), size)
    ground = -1.2 * max(tall)
    for body in every:
        for held in getattr(body.shaft, "constraints", ()):
            _constraint(ax, body.left + _drawn(held.at), held.holds, ground)
    for support in scene.of(Support):
        if support.on in scene.shafts:
            _joint(ax, _drawn(support.at), own[support.shaft], own[support.on], size)
        elif support.at is not None:
            at, foot = _drawn(support.at), ground if support.on is None else HOUSED[0] * ground
            _spring(ax, at, -own[support.shaft].radius(at) if scene.shafts else 0.0, foot, ground)
    for casing in scene.of(AbstractCasing):
        _casing(ax, scene, casing, ground)
    heavy = [(_drawn(unbalance.at), unbalance.shaft) for unbalance in scene.of(Unbalance)]
    if heavy:
        style = {"color": colours.RED, "markersize": 4.0, "zorder": 4.0}
        heights = [own[name].radius(at) if scene.shafts else 0.0 for at, name in heavy]
        ax.plot([at for at, _ in heavy], heights, "o", label="unbalance", **style)
    ends = [left - 0.04 * length, right + 0.04 * length]
    ax.plot(ends, [0.0, 0.0], "-.", color=colours.DARK, linewidth=0.5)
    ax.update_datalim([(left, side * FLATTEST * length) for side in (-1, 1)])
    ax.set_aspect("equal", adjustable="box")
    unit, size = length_unit("mm")[1], float(ax.xaxis.label.get_fontsize())
    wide = int(page.width_of(ax) / (0.55 * size))  # letters
    page.finish(ax, fill(f"station [{unit}]{_unseen(scene)}", wide), f"radius [{unit}]")
    if new:
        fit(ax)
    return page.finish(ax, columns=6, scene=scene)


def fit(ax: Axes) -> None:
    """Make a figure of one rotor as high, or if that is too high as wide, as its scale needs."""
    figure: Any = ax.figure
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    ratio, width = (high - low) / (right - left), figure.get_figwidth() * 25.4
    names = len(ax.get_legend_handles_labels()[1])
    above = ABOVE + (ROW * (np.ceil(names / IN_ROW) - 1) if names > 6 else 0.0)
    height = ratio * (width - BESIDE) + above
    if height > HIGHEST:
        width, height = (HIGHEST - above) / ratio + BESIDE, HIGHEST
    figure.set_size_inches(page.inches(max(width, NARROWEST), max(height, LOWEST)))


def _drawn(length: Any) -> float:
    """A length [m] in the unit drawn."""
    return length_unit("mm")[0] * float(length)


def _box(
    ax: Axes, x: tuple[float, float], y: tuple[float, float], label: str, **style: Any
) -> None:
    style = {"edgecolor": colours.DARK, "linewidth": 0.6, "label": page.once(ax, label)} | style
    ax.add_patch(Rectangle((x[0], y[0]), x[1] - x[0], y[1] - y[0], **style))


class _Body(NamedTuple):
    """A shaft at its place on the axis, with lengths as drawn."""

    shaft: Any
    left: float
    name: str | None  # None: the only one
    shade: str

    @property
    def right(self) -> float:
        return self.left + _drawn(self.shaft.length)

    def radius(self, at: float) -> float:
        """Radius at a station; of a shaft without a diameter that of a thick line."""
        if not hasattr(self.shaft, "diameter"):
            return 0.3 * SIZE * _drawn(self.shaft.length)
        return _drawn(self._part(at).diameter) / 2

    def bore(self, at: float) -> float:
        """Inner radius at a station, 0 of a solid shaft."""
        inner = self._part(at).inner_diameter if hasattr(self.shaft, "diameter") else None
        return 0.0 if inner is None else _drawn(inner) / 2

    def _part(self, at: float) -> Any:
        steps = (step for step in self.shaft.steps if self.left + _drawn(step.at) < at)
        return [self.shaft, *steps][-1]


def _bodies(scene: Scene) -> list[_Body]:
    names = scene.shafts or (None,)
    starts = [0.0 if one.start is None else _drawn(one.start) for one in scene.placed()]
    shades = (SHADES[i % len(SHADES)] for i in range(len(names)))
    rows = zip(scene.placed(), starts, names, shades, strict=True)
    return [_Body(one.shaft, start, name, shade) for one, start, name, shade in rows]


def _shaft(ax: Axes, body: _Body) -> float:
    """Draw a shaft, one of several by its walls alone; returns its largest radius as drawn."""
    shaft, label = body.shaft, body.name or "shaft"
    if not hasattr(shaft, "diameter"):
        dark: Any = {"color": colours.DARK, "linewidth": 3.0, "label": label}
        ax.plot([body.left, body.right], [0.0, 0.0], **dark)
        return 0.0
    places = [body.left, *(body.left + _drawn(step.at) for step in shaft.steps)]
    parts = list(zip(places, [*places[1:], body.right], (shaft, *shaft.steps), strict=True))
    for left, right, part in parts:
        radius, middle = _drawn(part.diameter) / 2, (left + right) / 2
        bore, walled = body.bore(middle), body.name is not None
        sides = _sides(bore, radius) if walled else [(-radius, radius)]
        for side in sides:
            _box(
                ax,
                (left, right),
                side,
                facecolor=body.shade,
                label=label,
                zorder=1.0 + 0.1 * walled,
            )
        if bore and not walled:
            _box(ax, (left, right), (-bore, bore), facecolor="white", label="bore")
    return max(_drawn(part.diameter) for *_, part in parts) / 2


def _sides(inner: float, outer: float) -> list[tuple[float, float]]:
    """Heights of a ring in section, above the axis and below; one of a solid."""
    return [(inner, outer), (-outer, -inner)] if inner else [(-outer, outer)]


def _joint(ax: Axes, at: float, one: _Body, other: _Body, size: float) -> None:
    """Draw a bearing between two shafts, above and below the axis, in the gap if there is one."""
    inner, outer = sorted((one, other), key=lambda body: body.radius(at))
    low, high = inner.radius(at), outer.bore(at)
    if high <= low:
        low, high = 0.0, 1.3 * outer.radius(at)
    style: Any = {"facecolor": colours.MAGENTA, "label": "bearing between shafts", "zorder": 3.0}
    for side in _sides(low, high):
        _box(ax, (at - size / 2, at + size / 2), side, **style)


def _disc(ax: Axes, disc: Disc, length: float, body: _Body) -> float:
    """Draw a disc by `I_p = m R^2 / 2`, `I_d = I_p / 2 + m a^2 / 12`; returns its radius as drawn."""
    diametral, polar = (abs(float(value)) for value in disc.inertia or (0.0, 0.0))
    at, mass = _drawn(disc.at), float(disc.mass)
    if not (mass and polar):
        label = page.once(ax, "mass")
        height = 0.0 if body.name is None else body.radius(at)
        ax.plot([at], [height], "s", color=colours.BLUE, markersize=5.0, label=label)
        return 0.0
    radius = _drawn((2 * polar / mass) ** 0.5)
    thickness = _drawn((12 * max(diametral - polar / 2, 0.0) / mass) ** 0.5)
    if thickness > THICK * length:  # the inertia represents more than a disc
        thickness = 0.0
    half = max(thickness / 2, 0.003 * length)
    style = {"facecolor": colours.BLUE, "alpha": 0.6, "zorder": 2.0}
    bore = body.radius(at) if body.bore(at) and body.name is not None else 0.0
    for side in _sides(bore, radius):
        _box(ax, (at - half, at + half), side, label="disc", **style)
    return radius


def _balls(ax: Axes, balls: BallBalancer) -> float:
    """Draw a race of balls; returns its radius as drawn."""
    at, race = _drawn(balls.at), _drawn(balls.race_radius)
    style = {"color": colours.TEAL, "markersize": 5.0, "markerfacecolor": "none"}
    ax.plot([at, at], [-race, race], "o", label=page.once(ax, "balls"), **style)
    return race


def _rolling(ax: Axes, bearing: RollingBearing) -> float:
    """Draw a ball above and below the axis between two races; returns the larger one as drawn."""
    at, inner, outer = (_drawn(x) for x in (bearing.at, bearing.inner_radius, bearing.outer_radius))
    pitch, half = (inner + outer) / 2, abs(outer - inner) / 2
    for side in (1, -1):
        style = {"facecolor": "none", "edgecolor": colours.MAGENTA}
        label = page.once(ax, "rolling bearing")
        ax.add_patch(Circle((at, side * pitch), half, label=label, **style))
        for race in (inner, outer):
            ax.plot([at - half, at + half], [side * race] * 2, color=colours.DARK, linewidth=1.0)
    return max(inner, outer)


def _stop(ax: Axes, stop: AbstractRub, length: float) -> float:
    """Draw a limiter above or below the axis, one at the side and a ring both; returns its reach."""
    at, side, shift = _drawn(stop.at), float(np.sin(stop.angle)), 0.0
    reach = _drawn(float(stop.rim_radius) + float(stop.gap))
    half, thick = 0.012 * length, 0.02 * length
    signs, name = (1.0, -1.0) if abs(side) < 1e-9 else (np.sign(side),), "limiter"
    if isinstance(stop, AnnularStator):
        shift, signs, name = _drawn(stop.offset) * side, (1.0, -1.0), "ring"
    for sign in signs:
        y = sorted((shift + sign * reach, shift + sign * (reach + thick)))
        _box(ax, (at - half, at + half), (y[0], y[1]), facecolor=colours.ORANGE, label=name)
    return abs(reach) + abs(shift) + thick


def _constraint(ax: Axes, at: float, holds: str, ground: float) -> None:
    """Draw a clamp as a wall, a pin as a triangle under the axis, a guide as a dashed line."""
    style: Any = {"color": colours.DARK, "label": page.once(ax, holds)}
    if holds == "clamp":
        ax.plot([at, at], [ground, -ground], linewidth=3.0, **style)
    elif holds == "pin":
        x = at + 0.25 * ground * np.array([0.0, 1.0, -1.0, 0.0])
        ax.plot(x, [0.0, ground, ground, 0.0], linewidth=1.0, **style)
    else:
        ax.plot([at, at], [ground, -ground], linewidth=1.0, linestyle="--", **style)


def _casing(ax: Axes, scene: Scene, casing: AbstractCasing, ground: float) -> None:
    """Draw a casing below what stands on it at the shaft, and a spring, or bolts, to the ground."""
    parts: list[Any] = [one for one in scene.effects if getattr(one, "on", None) == casing.name]
    above = [_drawn(one.at) for one in parts if getattr(one, "at", None) is not None]
    if not above:
        return
    x = min(above) + 0.3 * ground, max(above) - 0.3 * ground
    label, foot = labels.words(casing.kind), HOUSED[1] * ground
    _box(ax, x, (foot, HOUSED[0] * ground), facecolor="0.7", label=label)
    if isinstance(casing, LoosePedestal):
        for bolt in (x[0] + 0.2 * (x[1] - x[0]), x[1] - 0.2 * (x[1] - x[0])):
            ends = [0.95 * HOUSED[0] * ground, ground]
            page.curve(ax, [bolt, bolt], ends, colours.DARK, page.once(ax, "bolt"), 2.0)
        slab = sorted((ground, 1.1 * foot))
        _box(ax, x, (slab[0], slab[1]), facecolor="0.9", label="foundation", hatch="///")
    if any(one.of == casing.name for one in scene.of(Support)):
        _spring(ax, sum(x) / 2, foot, ground, ground)


def _spring(ax: Axes, at: float, top: float, foot: float, ground: float) -> None:
    """Draw a support as a spring between two heights, with a base if it stands on the ground."""
    x = at + 0.12 * ground * np.array([0, 0, *[1, -1] * 4, 0, 0])
    y = np.linspace(top, foot, x.size)
    page.curve(ax, x, y, colours.MAGENTA, page.once(ax, "support"), 1.0)
    if foot == ground:
        base = at + 0.3 * ground * np.array([-1, 1])
        ax.plot(base, [ground, ground], color=colours.DARK, linewidth=1.5)


def _unseen(scene: Scene) -> str:
    """Part of the axis label that names the effects without a shape."""
    kinds = {effect.kind: None for effect in scene.effects if not isinstance(effect, DRAWN)}
    return f"; not drawn: {', '.join(map(labels.words, kinds))}" if kinds else ""
