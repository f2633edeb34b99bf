"""Fit: parameters of a scene, the noise and confidence intervals from what was measured."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy import stats

from ..core.checks import check_counts
from ..core.progress import waiting
from ..core.quantities import Scalar
from ..core.tables import notebook_table
from ..equations.shared_nodes import with_shared_nodes
from ..scene import Scene
from .bounds import Bounds, bounds, check_paths, own_value
from .minimum import Minimum, minima
from .records import AbstractRecord, FittedStart, is_of_start, with_starts, without_starts
from .uncertainty import Uncertainty, of_slopes
from .whiteness import correlations


EDGE = 1e-4  # of the range of a parameter: nearer to a bound it is on the bound
KINK = 0.2  # step in standard deviations that may remain at a kink of the sum of squares
MENTIONED = 1e-3  # such a step above which `cautions` mentions it
CORRELATED = 3.3  # z-score of a correlation, exceeded by noise once in a thousand
ALIKE = 1e-3  # difference of log-likelihoods below which two starts have found the same minimum
SCANT = 10.0  # degrees of freedom of one of several records, below which its noise is poorly known


class Fitted(eqx.Module):
    """`x +- t s`: parameters fitted to `r` records, how surely they are known, and the noise of each.

    `str` and a notebook show 95 % intervals and `cautions`.
    """

    values: Mapping[str, Scalar]  # SI
    noise: Float[np.ndarray, " r"]  # standard deviation of the numbers of every record [m]
    uncertainty: Uncertainty  # residuals in units of the noise
    residuals: tuple[Array, ...]  # prediction less measurement [m], each as its record, (T, c)
    residual_correlations: Float[np.ndarray, "r 2"]  # in time, between channels; of noise about 0
    z_scores: Float[np.ndarray, "r 2"]  # of these
    records: tuple[AbstractRecord, ...]  # to which it was fitted
    bounds: Bounds  # of the parameters
    model: Scene  # before the fit, with the starts of time records as members if one was fitted
    remaining_step: Scalar  # that would come next, in standard deviations
    degrees_of_freedom: Float[np.ndarray, " n"]  # of every parameter; m - n for one record
    record_freedom: Float[np.ndarray, " r"]  # m_i - n_i of every record
    doubts: tuple[str, ...] = eqx.field(static=True)  # of each record: a sentence, or empty
    evaluations: int = eqx.field(static=True)  # of the start that led here
    ended: bool = eqx.field(static=True)  # whether the search ended of itself

    @property
    def scene(self) -> Scene:
        """The scene with the fitted parameters."""
        scene = self.model
        if scene.of(FittedStart):
            scene = scene.of_parts(*without_starts(scene))
        return scene.replace({p: v for p, v in self.values.items() if not is_of_start(p)})

    @property
    def covariance(self) -> Float[Array, "n n"]:
        """Covariance of the parameters, in the order of `values`."""
        return self.uncertainty.covariance

    @property
    def start(self) -> Any:
        """The start of the first time record with its fitted numbers; None if no start was fitted."""
        return next(iter(self.starts), None)

    @property
    def starts(self) -> tuple[Any, ...]:
        """Starts of the shaft of all time records; empty if no number of one was fitted."""
        own = {p: v for p, v in self.values.items() if is_of_start(p)}
        return tuple(begun.shaft for begun in self.model.put(own).of(FittedStart))

    def intervals(self, level: float | int = 0.95) -> dict[str, tuple[float, float]]:
        """`x_k +- t s_k`, with `t` of Student's distribution of `nu_k` degrees of freedom.

            1 / nu_k = sum_i c_ki^2 / (m_i - n_i)

        `c_ki` is the share of the variance of parameter k that comes from the noise of record i, so with
        one record `nu_k = m - n`.

        Args:
            level: probability with which an interval contains the true parameter.

        Returns:
            Ends of every interval by path, SI. They hold to first order in the noise, where it is normal,
            independent from sample to sample and from channel to channel, and alike within a record;
            `cautions` says where it is not.

        Raises:
            ValueError: `level` is not a number between 0 and 1.

        Source: Bard (1974), Nonlinear Parameter Estimation, chapter 7; Satterthwaite (1946), Biometrics
        Bulletin 2, 110-114.
        """
        try:
            inside = np.ndim(level) == 0 and bool(0 < level < 1)
        except (TypeError, ValueError):
            inside = False
        if not inside:
            raise ValueError(f"`level` must be a number between 0 and 1, but is {level!r:.200}.")
        reach = stats.t.ppf((1 + level) / 2, self.degrees_of_freedom)
        deviations = self.uncertainty.deviations.items()
        sizes = {path: float(t * s) for t, (path, s) in zip(reach, deviations, strict=True)}
        return {p: (float(x) - sizes[p], float(x) + sizes[p]) for p, x in self.values.items()}

    @property
    def cautions(self) -> tuple[str, ...]:
        """Sentences on what makes the intervals doubtful, none if nothing was found."""
        said = [
            f"The residuals of record {i} are correlated from {which} "
            f"({self.residual_correlations[i, k]:.2f}, {self.z_scores[i, k]:.0f} standard deviations from "
            "noise): the model or the noise is not as assumed, and the intervals fail."
            for i in range(len(self.records))
            for k, which in enumerate(("sample to sample", "channel to channel"))
            if abs(self.z_scores[i, k]) > CORRELATED
        ]
        said += [
            f"Record {i} has {left:.1f} degrees of freedom for its noise, so the weights of the records "
            "are poorly known and the intervals too narrow; measure more."
            for i, left in enumerate(self.record_freedom)
            if len(self.records) > 1 and left < SCANT
        ]
        if self.remaining_step > MENTIONED:
            size = f"would be of {float(self.remaining_step):.2g} standard deviations"
            said.append(
                f"The sum of squares has a kink at its minimum, where a next step {size}; take located "
                "steps, `Exponential(4, located=True)`, or more of them."
                if self.ended
                else f"The search used all its steps, and the next one {size}; take more `steps`."
            )
        said += [f"Record {i}: {doubt}" for i, doubt in enumerate(self.doubts) if doubt]
        ends = self.bounds.ends
        for path, (low, high) in self.intervals().items():
            least, most = ends[path]
            if low < least or high > most:
                said.append(
                    f"The interval of `{path}`, {low:.6g} to {high:.6g}, goes beyond its bounds, "
                    f"{least:g} to {most:g}; widen them, or measure more."
                )
        return tuple(said)

    def _repr_html_(self) -> str:
        rows = [
            (path, value, self.uncertainty.deviations[path], *self.intervals()[path], unit)
            for path, value, unit in zip(
                self.values, self.values.values(), self.bounds.units, strict=True
            )
        ]
        heads = ("parameter", "found", "standard deviation", "95 % from", "to", "unit")
        return notebook_table("\n".join((self._noises, *self.cautions)), heads, rows)

    @property
    def _noises(self) -> str:
        noises = ", ".join(f"{sigma:.4g} m" for sigma in self.noise)
        count, several = sum(record.count for record in self.records), len(self.values) > 1
        return f"{len(self.values)} parameter{'s' * several} from {count} numbers; noise {noises}"

    def __str__(self) -> str:
        lines = [self._noises]
        for (path, (low, high)), unit in zip(
            self.intervals().items(), self.bounds.units, strict=True
        ):
            unit = "" if unit == "1" else f" {unit}"
            value = float(self.values[path])
            lines.append(f"  {path} = {value:.6g}{unit}, 95 % from {low:.6g} to {high:.6g}")
        return "\n".join((*lines, *self.cautions))


def fit(
    scene: Scene,
    records: Any,
    parameters: Mapping[str, Any],
    *,
    steps: int = 100,
    starts: int = 1,
    seed: int = 0,
    progress: bool | None = None,
) -> Fitted:
    """`min sum_i |z_i(x) - z_i|^2 / sigma_i^2` by weights that are repeated, and the noise of the records.

        sigma_i^2 = sum |r_i|^2 / (m_i - n_i),   sum_i n_i = n,   x_k +- t_nu_k sqrt(C_kk)

    by Levenberg and Marquardt's method, in which every record is weighted by the noise that its own
    residuals show at the last step. `n_i`, the trace of its block of the hat matrix, is the part of the
    `n` parameters that the record determines. One program does all of it, once for every start.
    A later fit compiles no program if its scene has the same parts at the same stations, its records the
    same shapes and settings, and if paths and the number of starts are the same.

    Args:
        scene: the rotor, whose own values are the first guess.
        records: what was measured: `TimeRecord`, `OrbitRecord`, `SpectrumRecord`, `ResponseRecord`, one or
            several of any kind.
        parameters: bounds by parameter path, `{"limiters.gap": (5e-3, 10e-3)}`; None for none.
            `start.shaft.radius` is a number of the start of a time record, `starts.1.shaft.radius` of the
            second of several.
        steps: greatest number of steps, each one prediction of all records with its derivatives.
        starts: number of starts: the scene's own values, and more by a Latin hypercube within the bounds,
            for records of motion in time, which fit well in several places. The best of them counts, and
            an orbit with contact is sought from that of the scene's own values in all.
        seed: of these starts.
        progress: whether to show after two seconds that the fit is under way; by default on a terminal.

    Returns:
        A `Fitted`. Print it: it says where its intervals do not hold.

    Raises:
        ValueError: if a record or a parameter is not as described, or the records do not determine the
            parameters.
        RuntimeError: if the fit ends on a bound, or finds no minimum.

    Source: Nocedal, Wright (2006), Numerical Optimization, section 10.3; Bard (1974), Nonlinear Parameter
    Estimation, chapters 4 and 7; noise of several records: Patterson, Thompson (1971), Biometrika
    58, 545-554.
    """
    check_counts(steps=steps, starts=starts)
    every = checked(scene, records, parameters)
    scene = with_starts(every, scene, parameters)
    limits = bounds(scene, parameters, "parameters")
    scene = with_shared_nodes(scene, parameters)
    every = tuple(record.prepared(scene) for record in every)
    check_enough(every, len(limits.paths))
    own = limits.numbers([own_value(scene, path) for path in parameters])
    first = jnp.asarray(np.concatenate([own[None], limits.drawn(starts - 1, seed)]))
    with waiting(progress, "fit"):
        found = jax.device_get(minima(scene, every, limits, first, steps))
    return concluded(scene, every, limits, found)


def checked(scene: Any, records: Any, parameters: Any) -> tuple[AbstractRecord, ...]:
    """The records as a tuple; raise unless these are arguments of a fit."""
    if not isinstance(scene, Scene):
        raise ValueError(
            f"`scene` must be a `Scene`, but is {scene!r:.200}; `jr.load` reads one from a file."
        )
    check_paths(parameters, "parameters")
    every = tuple(records) if isinstance(records, list | tuple) else (records,)
    for record in every:
        if not isinstance(record, AbstractRecord):
            raise ValueError(
                f"A record must be a `TimeRecord` or its like, but is {record!r:.200}; give one of these, "
                "or a list of several."
            )
    if not every:
        raise ValueError("`fit` needs at least one record.")
    return every


def concluded(
    scene: Scene, records: tuple[AbstractRecord, ...], limits: Bounds, every: Any
) -> Fitted:
    """The result of a fit from the `Minimum` of every start; raise where none was found, or on a bound."""
    counts = [record.count for record in records]
    merit = np.log(every.noise) @ counts  # of the likelihood; the sum of squares of a single record
    merit = np.where(np.isfinite(every.residuals).all(axis=1), merit, np.inf)
    alike = merit <= merit.min() + ALIKE
    best = int(np.argmin(np.where(alike, every.remaining, np.inf)))
    found: Any = Minimum(*(part[best] for part in every))
    if not np.isfinite(found.residuals).all():
        raise ValueError(
            "The prediction is not finite at the scene's own values, the first start; begin where it is, "
            "or give a time record its `times`, which parts without mass need."
        )
    _check_inside(limits, found.u)
    values = dict(zip(limits.paths, limits.values(jnp.asarray(found.u)), strict=True))
    parts = np.split(found.residuals, np.cumsum(counts)[:-1])
    weights = np.repeat(1 / found.noise, counts)
    left, slopes = found.residuals * weights, found.slopes * weights[:, None]
    known = of_slopes(jnp.asarray(left), jnp.asarray(slopes), values, 1.0)
    if not found.remaining <= KINK:
        raise RuntimeError(
            f"The fit found no minimum: after {int(found.evaluations) - 1} steps a next one would move "
            f"the parameters by {float(found.remaining):.2g} standard deviations; take more `steps` or "
            "`starts`, or begin nearer."
        )
    tables = [part.reshape(r.samples_left, -1) for part, r in zip(parts, records, strict=True)]
    correlated, scores = correlations(left, slopes, [table.shape for table in tables])
    freedom, of_records = _degrees_of_freedom(slopes, counts)
    fitted = scene.put(values)
    return Fitted(
        values=values,
        noise=np.asarray(found.noise),
        uncertainty=known,
        residuals=tuple(map(as_measured, tables, records)),
        residual_correlations=correlated,
        z_scores=scores,
        records=records,
        bounds=limits,
        model=scene,
        evaluations=int(found.evaluations),
        ended=bool(found.ended),
        remaining_step=jnp.asarray(found.remaining),
        degrees_of_freedom=freedom,
        record_freedom=of_records,
        doubts=tuple(record.doubt(fitted) for record in records),
    )


def _degrees_of_freedom(slopes: np.ndarray, counts: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """`nu_k` of every parameter and `m_i - n_i` of every record, see `Fitted.intervals`."""
    basis, triangle = np.linalg.qr(slopes / np.linalg.norm(slopes, axis=0))
    inverse = np.linalg.solve(triangle, basis.T)  # of the slopes, by parameters and numbers
    first = np.cumsum([0, *counts[:-1]])
    left = counts - np.add.reduceat(np.sum(basis**2, axis=1), first)
    variances = np.add.reduceat(inverse**2, first, axis=1)
    shares = variances / variances.sum(axis=1, keepdims=True)
    return 1 / np.sum(shares**2 / left, axis=1), left


def as_measured(table: np.ndarray, record: AbstractRecord) -> Array:
    """Residuals by sample and channel, (T, c), as complex numbers where the record has such."""
    channels, every = record.measured.shape[1], record.centred(jnp.asarray(table))
    return every if every.shape[1] == channels else every[:, :channels] + 1j * every[:, channels:]


def check_enough(records: tuple[AbstractRecord, ...], parameters: int) -> None:
    """Raise where a record has no more numbers than there are parameters."""
    for i, record in enumerate(records):
        if record.count <= parameters:
            raise ValueError(
                f"Record {i} has {record.count} numbers, too few for {parameters} parameters and its "
                "noise; measure more, or fit fewer."
            )


def _check_inside(limits: Bounds, u: np.ndarray) -> None:
    """Raise where a parameter ended on a bound."""
    share = 1 / (1 + np.exp(-np.asarray(u)))
    for path, at, free in zip(limits.paths, share, limits.free, strict=True):
        if not free and not EDGE < at < 1 - EDGE:
            bound = limits.ends[path][int(at > 0.5)]
            raise RuntimeError(
                f"`{path}` ended on its bound {bound:g}, where no interval holds; widen the bounds, check "
                "the model, or leave the parameter out."
            )
