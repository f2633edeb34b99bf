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


Target = Callable[[Array], tuple[Array, Any]]  # `u -> (what is minimised, what else is seen there)`


class Step(NamedTuple):
    """What a step comes to."""

    at: Float[Array, " n"]  # where the loss was looked at last and found good
    seen: Any  # of the target there
    next: Float[Array, " n"]  # to step on from
    state: Any
    ahead: Scalar  # largest change of a free number that the optimiser wants next


class AbstractDescent(eqx.Module):
    """An optimiser that looks at a target, with derivatives, once a step."""

    residuals: eqx.AbstractVar[bool]  # whether the target is a vector, its squares to be summed
    restarts: eqx.AbstractClassVar[bool]  # whether a target that changed calls for a new state

    @property
    @abc.abstractmethod
    def name(self) -> str: ...

    @abc.abstractmethod
    def begin(self, target: Target, u: Float[Array, " n"]) -> Any:
        """State, of arrays alone."""

    @abc.abstractmethod
    def step(self, target: Target, u: Float[Array, " n"], state: Any) -> Step: ...


class FirstOrder(AbstractDescent):
    """`u <- u + update(gradient)` of an optax gradient transformation."""

    restarts: ClassVar[bool] = False

    transformation: Any
    residuals: bool = eqx.field(static=True, default=False)

    @property
    def name(self) -> str:
        return f"optax {self.transformation.update.__qualname__.partition('.')[0]}"  # what made it

    def begin(self, target: Target, u: Float[Array, " n"]) -> Any:
        del target
        return self.transformation.init(u)

    def step(self, target: Target, u: Float[Array, " n"], state: Any) -> Step:
        (value, seen), gradient = jax.value_and_grad(target, has_aux=True)(u)
        line = {"value": value, "grad": gradient, "value_fn": lambda u: target(u)[0]}
        update = optax.with_extra_args_support(self.transformation).update
        change: Any
        change, state = update(gradient, state, u, **line)
        return Step(u, seen, u + change, state, jnp.max(jnp.abs(change)))


class Iterative(AbstractDescent):
    """A minimiser or least-squares solver of optimistix: BFGS, LevenbergMarquardt and their like."""

    restarts: ClassVar[bool] = True

    solver: Any
    residuals: bool = eqx.field(static=True)

    @property
    def name(self) -> str:
        return f"optimistix {type(self.solver).__name__}"

    def begin(self, target: Target, u: Float[Array, " n"]) -> Any:
        return eqx.filter(self._fresh(target, u), eqx.is_array)

    def step(self, target: Target, u: Float[Array, " n"], state: Any) -> Step:
        constant = eqx.filter(self._fresh(target, u), eqx.is_array, inverse=True)
        whole = eqx.combine(state, constant)
        look = lambda u, args: target(u)
        u, whole, _ = self.solver.step(look, u, None, OPTIONS, whole, frozenset())
        ahead = jnp.max(jnp.abs(whole.y_eval - u))
        return Step(u, whole.aux, u, eqx.filter(whole, eqx.is_array), ahead)

    def _fresh(self, target: Target, u: Float[Array, " n"]) -> Any:
        shapes = jax.eval_shape(target, u)
        look = lambda u, args: target(u)
        return self.solver.init(look, u, None, OPTIONS, *shapes, frozenset())


BY_GRADIENTS = (
    optx.AbstractGradientDescent,
    optx.AbstractBFGS,
    optx.AbstractDFP,
    optx.AbstractLBFGS,
    optx.AbstractGaussNewton,
)
OPTIONS = {"autodiff_mode": "fwd", "jac": "fwd"}  # a target brings its own derivative


def descent(optimiser: Any, residuals: bool, tolerance: float | int) -> AbstractDescent:
    """The optimiser asked for, or the one that suits: LevenbergMarquardt for residuals, else BFGS."""
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
