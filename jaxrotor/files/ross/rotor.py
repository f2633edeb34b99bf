"""Scene of a rotor that ROSS has written."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from ...effects import AbstractEffect
from ...scene import Scene
from ...shafts import FlexibleShaft
from ...shafts.materials import Material
from ...spins.constant import ConstantSpeed
from ..units import SceneError, quantity, refuse
from .bearings import casings, discs, housed, supports
from .file import Notes, note_unread, read
from .shaft import merged, placed, sections, step


_COORDINATES = 48  # about as many nodes in all spans together


def from_ross(
    path: str | os.PathLike[str], speed: float | int, nodes: int | None = None
) -> tuple[Scene, tuple[str, ...]]:
    """Scene of a rotor that ROSS has written by `Rotor.save`, a .toml or .json file.

    Shaft elements become one `FlexibleShaft` without constraints, with their shear and rotary inertia,
    and with a `Step` where the section changes. Disks, and point masses on the shaft, become `Disc`.
    Bearings and seals become `Support` with all eight coefficients and their added mass, as one number,
    the mean of mxx and myy. Coefficients are numbers or tables over the speed, the whirl frequency or
    both, constant beyond their ends; `kyy` and `cyy` that a file leaves out stay out, so they are `kxx`
    and `cxx`, also where these are replaced or swept. Between the nodes of a table ROSS 3 interpolates as
    `Support` does, and its `interpolation` is kept; ROSS 2 took splines. A tapered element becomes up to
    four uniform ones, and layers of sleeves become one ring; the sentence on them has the largest error,
    of the bending flexibility of a piece (where the whole shaft is tapered, about twice that of its
    natural frequencies) and of the rotary inertia of a ring.

    A bearing on a flexible support (`n_link`) with a point mass stands on a `Casing`, which the support
    holds. Without a mass there both become one `Support` in series, `K^-1 = K1^-1 + K2^-1`,
    `C = K (K1^-1 C1 K1^-1 + K2^-1 C2 K2^-1) K`. That is right for slow motions, `omega C << K` of either
    one; in faster motions, as on a squeeze film, the damping is too high. Axial and torsional motion,
    axial force, torque and damping of the shaft are not carried over.
    The reader is written for files of ROSS 2.3, and of ROSS 3 as its documentation describes them.

    Args:
        path: path of the file.
        speed: constant speed of the scene [rad/s], not negative; the file has none.
        nodes: nodes of every span of the shaft; by default 8 for few spans, down to 3 for many.

    Returns:
        The scene, and a sentence on everything that was changed or left out, with its elements.

    Raises:
        SceneError: If the file cannot be read, an element is invalid, or `speed` is negative.
    """
    source, speed = os.fspath(path), quantity(speed, "rad/s", "speed")
    if speed < 0:
        wanted = "must not be negative, as coefficients in the file are those of positive rotation"
        refuse("speed", f"{wanted}, but is {speed:g} rad/s.")
    elements, notes = read(source), Notes()
    places, rings, gyroscopic, flags = sections(elements, source, notes)
    total = places[max(places)]
    housings = casings(elements, places)
    effects = [
        *discs(elements, places, notes),
        *housed(elements, housings, places, notes),
        *supports(elements, places, housings, speed, notes),
    ]
    note_unread(elements, notes)
    shaft, *steps = merged(rings, total, notes)
    ends = [0.0, total, *(at for at, _ in placed(shaft, steps)), *_stations(effects)]
    spans = len({round(at / total, 4) for at in ends}) - 1
    left_out = tuple(notes)
    said = f"without what could not be carried over from {Path(source).name}" if left_out else ""
    try:
        line = FlexibleShaft(
            total,
            shaft.outer,
            Material(*shaft.of),
            polar_ratio=2.0 if gyroscopic else 0.0,
            nodes=min(8, max(3, _COORDINATES // spans)) if nodes is None else nodes,
            inner_diameter=shaft.bore,
            steps=tuple(step(at, ring, shaft.of) for at, ring in placed(shaft, steps)),
            constraints=(),
            **flags,
        )
        scene = Scene(line, *effects, spin=ConstantSpeed(speed), assumption=said)
    except ValueError as error:
        raise SceneError(f"{source}: {error}") from None
    return scene, left_out


def _stations(effects: Iterable[AbstractEffect]) -> Iterator[float]:
    """Stations of the effects that have one [m]."""
    found = (getattr(effect, "at", None) for effect in effects)
    return (float(at) for at in found if at is not None)
