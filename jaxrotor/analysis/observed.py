"""Places where a response is observed: stations of shafts, and casings by their names."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.parameters import stations_of_paths
from ..equations.system import System
from ..scene import Scene
from ..shafts.cased import line_of, row_of
from ..shafts.line import AbstractLine


class Places(eqx.Module):
    """Places to observe: stations of the shaft, and casings by their names."""

    stations: Float[Array, " s"]  # [m], NaN for a casing
    casings: tuple[str | None, ...] = eqx.field(static=True)  # None for a station
    shafts: tuple[str | None, ...] = eqx.field(static=True)  # of stations; None: of the only one

    @classmethod
    def of(cls, scene: Scene, at) -> "Places":
        """Places of stations [m] and names, one or several; raises if the scene does not have one."""
        at = stations_of_paths(at, scene.get)
        single = not isinstance(at, list | tuple) or at and at[0] in scene.shafts
        every = [at] if single else list(at)
        names = tuple(one if isinstance(one, str) else None for one in every)
        if not any(names):
            stations, shafts = scene.seen(at)
            return cls(stations, (None,) * stations.size, shafts)
        for name in filter(None, names):
            scene.casing(name)
        own = [one for one in every if not isinstance(one, str)]
        seen = iter(zip(*scene.seen(own), strict=True) if own else ())
        pairs = [(jnp.asarray(jnp.nan), None) if name else next(seen) for name in names]
        stations, shafts = zip(*pairs, strict=True)
        return cls(jnp.stack(stations), names, shafts)

    def rows(self, line: AbstractLine) -> Float[Array, "s n"]:
        """Displacements there as linear forms of the coordinates."""
        if not any((*self.casings, *self.shafts)):
            return jax.vmap(line.row)(self.stations)
        every = zip(self.stations, self.casings, self.shafts, strict=True)
        of = lambda at, casing, shaft: row_of(
            line_of(line, shaft), at if casing is None else casing
        )
        return jnp.stack([of(*one) for one in every])


class Unbalanced(eqx.Module):
    """A rotor, places on it, and the shaft beside the first one whose unbalance acts; None: the first."""

    system: System
    places: Places
    by: str | None = eqx.field(static=True)
