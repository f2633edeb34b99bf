"""Compiled functions: with optimisation, or without it for programs that run once or twice."""

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ParamSpec, TypeVar

import equinox as eqx
import jax.core

from .stored_programs import StoredPrograms


_P = ParamSpec("_P")
_T = TypeVar("_T")

# Options for `jax.jit`. A program that runs once or twice takes longer to optimise than to run. Without
# the fusion emitters and LLVM's optimisation it compiles in a third of the time.
QUICKLY: dict[str, Any] = {
    "compiler_options": {
        "xla_backend_optimization_level": 0,
        "xla_cpu_use_fusion_emitters": False,
    }
}


class Compiled:
    """A function that is compiled when it is called, with options of `jax.jit` for a direct call."""

    def __init__(self, function: Callable, options: dict[str, Any]):
        functools.update_wrapper(self, function)
        self.__qualname__ = function.__qualname__
        self._inside = eqx.filter_jit(function)
        self._alone: Any = eqx.filter_jit(function, **options) if options else self._inside
        self._stored = StoredPrograms(function, self._inside, options)

    def __reduce__(self) -> str:
        return self.__qualname__  # pickled by its name, as functions are

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        if not _nothing_is_traced():
            return self._inside(*args, **kwargs)
        program = self._stored.find(args, kwargs)
        return self._alone(*args, **kwargs) if program is None else program()

    def compile(self, *args: Any, **kwargs: Any) -> None:
        """Compile the program of a direct call with these arguments, or load it, without running it."""
        if self._stored.find(args, kwargs) is None:
            self._alone.lower(*args, **kwargs).compile()

    def shapes(self, *args: Any, **kwargs: Any) -> Any:
        """The output with a `jax.ShapeDtypeStruct` in place of every array, without compilation."""
        compute = lambda: eqx.filter_eval_shape(self._inside, *args, **kwargs)
        if not _nothing_is_traced():
            return compute()
        return self._stored.shapes(compute, args, kwargs)


def compiled(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """`eqx.filter_jit(function)`; a direct call takes a stored program where programs are kept."""
    return Compiled(function, {})


def compiled_quickly(function: Callable) -> Compiled:
    """`eqx.filter_jit(function)`, compiled without optimisation when it is called directly.

    Linear algebra runs as fast as with optimisation, as LAPACK does it. Inside another program, a
    derivative or a map the function is compiled as a part of that program, because jax takes compiler
    options for whole programs only. A direct call takes a stored program where programs are kept.
    """
    return Compiled(function, QUICKLY)


def _nothing_is_traced() -> bool:
    return bool(jax.core.get_opaque_trace_state() == _OUTSIDE)


# The trace state belongs to a thread. A new thread has the state outside any trace, even if this
# module is imported while something is traced.
with ThreadPoolExecutor(1) as _thread:
    _OUTSIDE = _thread.submit(jax.core.get_opaque_trace_state).result()
