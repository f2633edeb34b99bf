"""Compiled: programs that run once or twice, translated in a third of the time."""

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import equinox as eqx
import jax.core


# For `jax.jit`: a program that runs once or twice is slower to compile well than to run. Without the
# fusion emitters and LLVM's optimisation a program compiles in a third of the time.
QUICKLY: dict[str, Any] = {
    "compiler_options": {
        "xla_backend_optimization_level": 0,
        "xla_cpu_use_fusion_emitters": False,
    }
}


def compiled_quickly(function: Callable) -> Callable:
    """`eqx.filter_jit(function)`, compiled without optimisation where it is called by itself.

    Linear algebra, which LAPACK does, runs as fast. Inside another program (or a derivative or a map)
    the function is a part of that one and compiled with it: jax takes settings for a whole program.
    """
    alone, inside = eqx.filter_jit(function, **QUICKLY), eqx.filter_jit(function)

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        return (alone if _nothing_is_traced() else inside)(*args, **kwargs)

    return call


def _nothing_is_traced() -> bool:
    return bool(jax.core.get_opaque_trace_state() == _OUTSIDE)


# What jax traces is that of a thread. This module may be imported while something is traced.
with ThreadPoolExecutor(1) as _thread:
    _OUTSIDE = _thread.submit(jax.core.get_opaque_trace_state).result()
