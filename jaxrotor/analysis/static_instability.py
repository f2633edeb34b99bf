"""Static instability of a rotor: negative stiffness that drives it off its axis.

K x = s M x,   s < 0: the rotor at rest leaves its axis as `cosh(sqrt(-s) t)` if nothing damps it
"""

import math

import jax
import numpy as np

from ..core.quantities import known, value_of
from ..effects import Support
from ..effects.base import AbstractOverSpeed
from ..equations.pencil import Pencil, frame
from ..equations.system import assemble
from ..scene import Scene


ROUNDING = 1e-9  # of the inverse square of the slowest motion


def static_instability(scene: Scene) -> str:
    """A clause that names the supports whose negative stiffness drives the rotor off its axis, else "".

    The stiffness is that at the speed of the scene and at whirl frequency zero. A rotor with traced
    values, beyond its tables, or with unequal axes that turn beside others that stand counts as stable.
    """
    if not all(map(known, jax.tree.leaves((scene.shaft, scene.effects)))):
        return ""
    tabled = [one for one in scene.of(AbstractOverSpeed) if isinstance(one, Support)]
    drives = [one for one in tabled if _is_negative(one)]
    if not drives:
        return ""
    still = [one.at_whirl(0.0) if isinstance(one, Support) else one for one in scene.effects]
    system = assemble(scene.of_parts(*still))
    if frame(system.blocks) not in ("fixed", "rotating"):
        return ""
    pencil = Pencil.of(system.at_speed(0.0) if system.tabled is None else system).along_axes
    stiffness, inertia = np.asarray(pencil.stiffness), np.asarray(pencil.inertia)
    if not np.isfinite(stiffness).all():
        return ""
    try:
        inverses = np.linalg.eigvals(np.linalg.solve(stiffness, inertia))
    except np.linalg.LinAlgError:
        return ""  # in a motion that nothing holds
    limit = ROUNDING * np.abs(inverses).max()
    own = inverses[(inverses.real < -limit) & (np.abs(inverses.imag) < limit)].real
    if not own.size:
        return ""
    names = ", ".join(scene.where(scene.name_of(one)) for one in drives)
    rate = math.sqrt(-1 / own.max())
    return (
        f"negative stiffness ({names}) is above what holds the rotor, which leaves its axis by itself, "
        f"undamped at {rate:.6g} 1/s"
    )


def _is_negative(support: Support) -> bool:
    """Whether a support has negative stiffness along some axis, at a node of its tables at least."""
    number = lambda value: np.asarray(0.0 if value is None else value)
    if number(support.angular_stiffness) < 0:
        return True
    if support.kxx is None:
        mean = number(support.stiffness)
        return bool(mean - abs(mean * number(support.anisotropy)) < 0)
    xx, yy = (number(value_of(support, name)) for name in ("kxx", "kyy"))
    cross = number(support.kxy) + number(support.kyx)
    return bool(np.any((xx + yy - np.hypot(xx - yy, cross)) < 0))
