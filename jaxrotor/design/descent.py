"""Descent: one step of an optimiser of optax or optimistix, with one interface for both."""

import abc
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
import optimistix as optx
from jaxtyping import Array, Float

from ..core.quantities import Scalar


Target = Callable[[Array], tuple[Array, Any]]  # `u -> (minimised number or residuals, evaluation)`


class Step(NamedTuple):
    """The iterate of one step of an optimiser, and where it goes next."""

    at: Float[Array, " n"]  # last accepted iterate
    evaluation: Any  # of the target there
    next: Float[Array, " n"]  # to continue from
    state: Any
    change: Scalar  # largest change of a free number in the next step


class AbstractDescent(eqx.Module):
    """An optimiser that evaluates a target, with derivatives, once a step."""

    residuals: eqx.AbstractVar[bool]  # whether the target is a vector whose squares are summed
    restarts: eqx.AbstractClassVar[bool]  # whether a changed target calls for a new state

    @property
    @abc.abstractmethod
    def name(self) -> str: ...

    @abc.abstractmethod
    def begin(self, target: Target, u: Float[Array, " n"]) -> Any:
        """The first state, of arrays alone."""

    @abc.abstractmethod
    def step(self, target: Target, u: Float[Array, " n"], state: Any) -> Step:
        """One step from `u`."""


class FirstOrder(AbstractDescent):
    """`u <- u + update(gradient)` of an optax gradient transformation."""

    restarts: ClassVar[bool] = False

    transformation: Any
    residuals: bool = eqx.field(static=True, default=False)

    @property
    def name(self) -> str:
        return f"optax {self.transformation.update.__qualname__.partition('.')[0]}"  # its maker

    def begin(self, target: Target, u: Float[Array, " n"]) -> Any:
        del target
        return self.transformation.init(u)

    def step(self, target: Target, u: Float[Array, " n"], state: Any) -> Step:
        (value, evaluation), gradient = jax.value_and_grad(target, has_aux=True)(u)
        search = {"value": value, "grad": gradient, "value_fn": lambda u: target(u)[0]}
        update = optax.with_extra_args_support(self.transformation).update
        change: Any
        change, state = update(gradient, state, u, **search)
        return Step(u, evaluation, u + change, state, jnp.max(jnp.abs(change)))


class Iterative(AbstractDescent):
    """A minimiser or least-squares solver of optimistix: BFGS, LevenbergMarquardt and their like."""

    restarts: ClassVar[bool] = True

    solver: Any
    residuals: bool = eqx.field(static=True)

    @property
    def name(self) -> str:
        return f"optimistix {type(self.solver).__name__}"

    def begin(self, target: Target, u: Float[Array, " n"]) -> Any:
        return eqx.filter(self._first_state(target, u), eqx.is_array)

    def step(self, target: Target, u: Float[Array, " n"], state: Any) -> Step:
        constant = eqx.filter(self._first_state(target, u), eqx.is_array, inverse=True)
        whole = eqx.combine(state, constant)
        function = lambda u, args: target(u)
        u, whole, _ = self.solver.step(function, u, None, OPTIONS, whole, frozenset())
        change = jnp.max(jnp.abs(whole.y_eval - u))
        return Step(u, whole.aux, u, eqx.filter(whole, eqx.is_array), change)

    def _first_state(self, target: Target, u: Float[Array, " n"]) -> Any:
        shapes = jax.eval_shape(target, u)
        function = lambda u, args: target(u)
        return self.solver.init(function, u, None, OPTIONS, *shapes, frozenset())


BY_GRADIENTS = (
    optx.AbstractGradientDescent,
    optx.AbstractBFGS,
    optx.AbstractDFP,
    optx.AbstractLBFGS,
    optx.AbstractGaussNewton,
)
OPTIONS = {"autodiff_mode": "fwd", "jac": "fwd"}  # a target has a derivative of its own


def descent(optimiser: Any, residuals: bool, tolerance: float | int) -> AbstractDescent:
    """The optimiser given, or by default LevenbergMarquardt for residuals and BFGS for a loss."""
    if optimiser is None:
        kind = optx.LevenbergMarquardt if residuals else optx.BFGS
        solver = kind(rtol=tolerance, atol=tolerance)
        return Iterative(solver=solver, residuals=residuals)
    if isinstance(optimiser, optax.GradientTransformation):
        return FirstOrder(transformation=optimiser)
    squares = isinstance(optimiser, optx.AbstractLeastSquaresSolver)
    if squares and not residuals:
        raise ValueError(
            f"{type(optimiser).__name__} minimises squares of residuals, but `loss` returns a single "
            "number; let it return the vector of residuals, or take a minimiser such as optimistix.BFGS."
        )
    if isinstance(optimiser, BY_GRADIENTS):
        return Iterative(solver=optimiser, residuals=squares)
    raise ValueError(
        "`optimiser` must be an optax gradient transformation such as optax.adam(0.02), or a minimiser "
        "or least-squares solver of optimistix that goes by gradients, such as BFGS or "
        f"LevenbergMarquardt, but is {optimiser!r}."
    )
