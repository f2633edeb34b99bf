"""Methods: ways to compute the same number, each a ladder of settings from loose to tight."""

import contextlib
import dataclasses
from collections.abc import Sequence
from typing import Any, Literal

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp

from ..scene import Scene
from ..solvers.control import step_control
from ..solvers.exponential import Exponential


Solver = Exponential | dfx.AbstractSolver
ATOL = 1e-3  # absolute tolerance [m], [rad] over the relative one

NODES = (3, 4, 5, 6, 8)
CELLS = (5, 10, 20, 40)
STEPS = (32, 64, 128, 256, 512, 1024)
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)


class Setting(eqx.Module):
    """How a number is computed; None leaves a part as the scene or the library has it.

    `steps` are those a revolution, or between two samples of a run-up; for a solver with a `tolerance`
    they are only its samples.
    """

    solver: Solver | None = None
    steps: int | None = eqx.field(default=None, static=True)
    # Relative; absolute: ATOL times it
    tolerance: float | None = eqx.field(default=None, static=True)
    nodes: int | None = eqx.field(default=None, static=True)
    rule: Literal["spectral", "trapezoid"] | None = eqx.field(default=None, static=True)
    precision: Literal["float64", "float32"] = eqx.field(default="float64", static=True)

    def __str__(self) -> str:
        parts = [
            None if self.solver is None else name_of(self.solver),
            None if self.steps is None else f"{self.steps} steps",
            None if self.tolerance is None else f"rtol {self.tolerance:g}",
            None if self.nodes is None else f"{self.nodes} nodes",
            None if self.rule is None else self.rule,
            None if self.precision == "float64" else self.precision,
        ]
        return ", ".join(part for part in parts if part) or "as it is"

    @property
    def adaptive(self) -> bool:
        """Whether the solver can choose its steps."""
        return isinstance(self.solver, dfx.AbstractAdaptiveSolver)

    def applied(self, scene: Scene) -> Scene:
        """The scene with the precision, nodes and rule of the setting; to be used in `computed()`."""
        scene = self.cast(scene)
        return scene if self.nodes is None else scene.with_nodes(self.nodes, self.rule)

    def cast(self, tree: Any) -> Any:
        """A scene or a start in the precision of the setting; to be used in `computed()`."""
        change = lambda leaf: leaf.astype(jax.dtypes.canonicalize_dtype(leaf.dtype))
        return jax.tree.map(lambda leaf: change(leaf) if eqx.is_array(leaf) else leaf, tree)

    def computed(self) -> contextlib.AbstractContextManager:
        """A context in which jax computes in the precision of the setting, in this thread alone."""
        return jax.enable_x64(self.precision == "float64")

    def controller(self) -> dfx.AbstractStepSizeController | None:
        """Step control over a revolution; None stands for that of `simulate`."""
        if not self.adaptive or (self.steps is None and self.tolerance is None):
            return None
        if self.tolerance is None:
            return dfx.ConstantStepSize()
        # As arrays, so that all tolerances share one compiled program.
        tolerances = jnp.asarray([1.0, ATOL]) * self.tolerance
        return step_control(self.solver, *tolerances)  # type: ignore[arg-type]

    def finer(self) -> "Setting":
        """The next finer setting: twice the steps or cells, a tenth of the tolerance, two more nodes."""
        nodes = self.nodes
        if nodes is not None:
            nodes = 2 * nodes if self.rule == "trapezoid" else nodes + 2
        return dataclasses.replace(
            self,
            steps=None if self.steps is None else 2 * self.steps,
            tolerance=None if self.tolerance is None else self.tolerance / 10,
            nodes=nodes,
        )


class Method(eqx.Module):
    """Settings along one `axis`, loose to tight: a line of a work-precision figure."""

    name: str = eqx.field(static=True)
    settings: tuple[Setting, ...]
    axis: Literal["steps", "tolerance", "nodes"] = eqx.field(static=True)


def by_nodes(spectral: Sequence[int] = NODES, cells: Sequence[int] = CELLS) -> tuple[Method, ...]:
    """Both rules of a flexible shaft, by their number of nodes.

    Args:
        spectral: nodes a span of the spectral rule.
        cells: cells of the trapezoidal rule, which is left out if there are none.

    Returns:
        One method for each rule.
    """
    lobatto = Method(
        "spectral", tuple(Setting(nodes=n, rule="spectral") for n in spectral), "nodes"
    )
    equal = Method("trapezoid", tuple(Setting(nodes=n, rule="trapezoid") for n in cells), "nodes")
    return (lobatto, equal) if len(cells) else (lobatto,)


def by_steps(solvers: Sequence[Solver], steps: Sequence[int] = STEPS) -> tuple[Method, ...]:
    """Solvers with fixed steps, also those that have an error estimate.

    Args:
        solvers: `Exponential` or solvers of diffrax.
        steps: steps a revolution, or between two samples of a run-up, ascending.

    Returns:
        One method for each solver.
    """
    return tuple(
        Method(
            f"{name_of(one)}{', fixed' if isinstance(one, dfx.AbstractAdaptiveSolver) else ''}",
            tuple(Setting(one, count) for count in steps),
            "steps",
        )
        for one in solvers
    )


def by_tolerance(
    solvers: Sequence[dfx.AbstractAdaptiveSolver], tolerances: Sequence[float] = TOLERANCES
) -> tuple[Method, ...]:
    """Solvers whose steps are chosen by their error estimate.

    Args:
        solvers: solvers of diffrax that have an error estimate.
        tolerances: relative tolerances, descending; the absolute ones are `ATOL` times these.

    Returns:
        One method for each solver.
    """
    return tuple(
        Method(name_of(one), tuple(Setting(one, tolerance=t) for t in tolerances), "tolerance")
        for one in solvers
    )


def in_float32(methods: Sequence[Method]) -> tuple[Method, ...]:
    """The same methods in single precision.

    Args:
        methods: methods in any precision.

    Returns:
        One method for each, with `float32` in its name.
    """
    return tuple(
        Method(
            f"{method.name}, float32",
            tuple(dataclasses.replace(s, precision="float32") for s in method.settings),
            method.axis,
        )
        for method in methods
    )


def linear() -> tuple[Method, ...]:
    """Methods for numbers without a motion in time.

    Returns:
        Both rules of shafts, and the spectral rule in single precision.
    """
    return (*by_nodes(), *in_float32(by_nodes(NODES[::2], ())))


def of_motion() -> tuple[Method, ...]:
    """Methods for motions that are computed revolution by revolution.

    Returns:
        Exponential solvers in both precisions, implicit Euler, and adaptive solvers of diffrax.
    """
    ours = by_steps((Exponential(2), Exponential(4), Exponential(4, located=True)))
    explicit, implicit = (dfx.Tsit5(), dfx.Dopri8()), (dfx.Kvaerno3(), dfx.Kvaerno5())
    adaptive = by_tolerance((*explicit, *implicit, dfx.KenCarp4()))
    return (*ours, *in_float32(ours[:1]), *by_steps((dfx.ImplicitEuler(),)), *adaptive)


def of_run_up() -> tuple[Method, ...]:
    """Methods for runs at a speed that varies.

    Returns:
        Implicit Euler and adaptive solvers of diffrax, without `KenCarp4`, which needs the stiff part of
        the equations separately.
    """
    solvers = (dfx.Tsit5(), dfx.Dopri8(), dfx.Kvaerno3(), dfx.Kvaerno5())
    adaptive = by_tolerance(solvers)
    steps = (1, 2, 4, 8, 16, 32)
    return (*by_steps((dfx.ImplicitEuler(),), steps), *adaptive, *in_float32(adaptive[:1]))


def name_of(solver: Solver) -> str:
    """Name of a solver, with fields that differ from their default.

    Args:
        solver: `Exponential` or a solver of diffrax.

    Returns:
        A text such as `Exponential(4), basis dense` or `Kvaerno5`.
    """
    if not isinstance(solver, Exponential):
        return type(solver).__name__
    parts = [f"Exponential({solver.order})"]
    for field in dataclasses.fields(solver):
        value = getattr(solver, field.name)
        if field.name != "order" and value != field.default:
            parts.append(field.name if value is True else f"{field.name} {value}")
    return ", ".join(parts)
