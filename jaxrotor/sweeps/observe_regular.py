"""Observable of regular motion, with any number of periods: whether averages have settled."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ..core.lanes import reduced
from ..core.plane import square
from .observable import AbstractObservable, Turn, Variable


SETTLED = 1e-3  # change of the average, over the largest square, that a regular motion stays below


class Regularity(AbstractObservable):
    """Change of the mean square radius from one half of the kept revolutions to the other.

        regularity = |<r^2>_1 - <r^2>_2| / max r^2
        <f> = Sum w(t) f / Sum w(t),   w = exp(-1 / (t (1 - t))),   t from 0 to 1 in each half

    Such averages of a periodic or quasi-periodic motion, of whatever
    number of periods, change less than any power of the number of revolutions, those of chaos as its
    root. So it asks for no section: that of a motion with the clocks of two shafts is no point. A period
    of more than a tenth of the kept revolutions, as the beat of two speeds that are nearly equal, is not
    told from chaos, and neither is a transient. Averages of chaos may agree by chance, to 1e-3 in about
    one of a hundred motions.

    Source: Das, Saiki, Sander, Yorke (2017), Nonlinearity 30, 4111; as a test of chaos Sander, Meiss
    (2020), Physica D 411, 132569.
    """

    needs_contact: ClassVar[bool] = False
    rows = True

    def check(self, steps, contacts):
        del steps, contacts

    def start(self, contacts):
        return jnp.zeros(2), jnp.zeros(2), jnp.zeros(())

    def update(self, carry, turn: Turn):
        sums, weights, most = carry
        squares = square(turn.z[1:])
        steps = len(squares)
        t = 2 * (turn.number + (jnp.arange(steps) + 0.5) / steps) / turn.count
        half = jnp.stack([t < 1, t >= 1])
        t = t - half[1]
        weight = half * jnp.exp(-1 / (t * (1 - t)))
        parts = [reduced(jnp.add, (own * squares.T).T) for own in weight]
        total = weight.sum(1).reshape(2, *[1] * (squares.ndim - 1))
        most = jnp.maximum(most, reduced(jnp.maximum, squares))
        return (sums + jnp.stack(parts), weights + total, most), None

    def report(self, carry, stored, count):
        sums, weights, most = carry
        with np.errstate(invalid="ignore", divide="ignore"):
            change = np.abs(np.diff(sums / weights, axis=-1)[..., 0]) / most
        name = "change of the mean square radius from half to half, over its largest"
        return {"regularity": Variable((), np.where(most > 0, change, 0.0), "1", name)}
