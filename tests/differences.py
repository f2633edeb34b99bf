"""Central differences of sixth order, and derivatives held against them."""

import jax
import pytest


STENCIL = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}


def central(at, h):
    """Derivative at 0 of `at(k)`, what a function is `k` steps of `h` away."""
    return sum(w * (at(k) - at(-k)) for k, w in STENCIL.items()) / h


def check_forward(function, own, step):
    """Forward-mode derivatives by every entry equal differences to 1e-5; `step` is relative."""
    value, exact = jax.jit(function), jax.jit(jax.jacfwd(function))(own)
    for i in range(own.size):
        h = step * abs(float(own[i]))
        expected = central(lambda k, i=i, h=h: float(value(own.at[i].add(k * h))), h)
        assert expected != 0
        assert float(exact[i]) == pytest.approx(expected, rel=1e-5)
