"""Characteristic polynomials of a balanced position: exact, slow, and of lowest orders in ball mass."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ...core.compiled import compiled_quickly
from ...core.quantities import Scalar
from .groups import BalancerGroups


@compiled_quickly
def characteristic_polynomial(
    groups: BalancerGroups, beta: Complex[Array, " r"]
) -> Float[Array, " k"]:
    """Exact characteristic polynomial of degree `6 + 2 r`, without its `2 (r - 1)` zeros.

        { A A* l^2 - l g [ A (l - i om)^4 + A* (l + i om)^4 ] + (l^2 + om^2)^4 (g^2 - |nu|^2) } prod e_l^2
        A = A_z + (ha + i a13) l + l^2,  A* its conjugate for real l,  e_l = l + h_l
        g = sum m_l / e_l,  nu = sum m_l beta_l / e_l

    Args:
        groups: the balancer.
        beta: `second_harmonics` of the position.

    Returns:
        Real coefficients, highest power first. For roots `spectrum` is more accurate. Differentiable.

    Source: Filimonikhin, Goncharov (2011), eqs. (5.4)-(5.6); theirs is l^2 times this one.
    """
    om = groups.speed + 0j
    one = jnp.ones((), complex)
    rotor = jnp.stack([one, groups.damping + 1j * groups.a13, groups.a_z])
    back = _fourth_power(jnp.stack([one, -1j * om]))
    drags, first, second = _rows(groups, beta)
    free = jnp.polymul(rotor, rotor.conj()).real
    pull = 2 * jnp.polymul(rotor, back).real
    double = _fourth_power(jnp.stack([one, 0 * om, om**2])).real
    return _total(drags, free, first, pull, second, double)


@compiled_quickly
def slow_polynomial(groups: BalancerGroups, beta: Complex[Array, " r"]) -> Float[Array, " k"]:
    """Characteristic polynomial of degree `2 + 2 r` for slow motion with a quasi-static rotor.

        { Delta l^2 - 2 om^4 a11 g l + om^8 (g^2 - |nu|^2) } prod e_l^2

    Args:
        groups: the balancer.
        beta: `second_harmonics` of the position.

    Returns:
        Real coefficients, highest power first. Differentiable.

    Source: Filimonikhin, Goncharov (2011), eq. (8.6), e_3 and e_5 of its last bracket exchanged.
    """
    om4 = groups.speed**4
    drags, first, second = _rows(groups, beta)
    constant = lambda value: value[None]
    parts = (constant(groups.determinant), first, constant(2 * om4 * groups.a11), second)
    return _total(drags, *parts, constant(om4**2))


class FirstApproximation(NamedTuple):
    """`Delta l^2 - 2 a11 om^4 mu0 l + om^8 (mu0^2 - |nu0|^2) = 0`, its coefficients and roots."""

    coefficients: Float[Array, " 3"]  # times prod h_l^2: A_0, -A_1, A_2 of eq. (8.8)
    values: Complex[Array, " 2"]  # slow roots; if real, the slower one last
    mu0: Scalar  # sum m_l / h_l
    nu0: Complex[Array, ""]  # sum m_l beta_l / h_l


def first_approximation(groups: BalancerGroups, beta: Complex[Array, " r"]) -> FirstApproximation:
    """Slow roots to first order in ball mass: `l = (om^4 / Delta) (a11 mu0 ± sqrt(..))`.

        sqrt( Delta |nu0|^2 - a12^2 mu0^2 ),  mu0 = sum m_l / h_l,  nu0 = sum m_l beta_l / h_l

    It predicts stability where a11 < 0 and |nu0| < mu0. This holds for balls light against `h_l ha`; for
    heavier ones it may be wrong, use `growth_rate`.

    Args:
        groups: the balancer.
        beta: `second_harmonics` of the position.

    Returns:
        `FirstApproximation`. Differentiable.

    Source: Filimonikhin, Goncharov (2011), eq. (8.8), in a compact form.
    """
    ratio = groups.mass / groups.drag
    mu0, nu0 = jnp.sum(ratio), jnp.sum(ratio * beta)
    om4, delta = groups.speed**4, groups.determinant
    size = jnp.prod(groups.drag**2)
    three = [delta, -2 * groups.a11 * om4 * mu0, om4**2 * (mu0**2 - jnp.abs(nu0) ** 2)]
    inside = delta * jnp.abs(nu0) ** 2 - groups.a12**2 * mu0**2
    spread = jnp.sqrt(inside + 0j) * jnp.array([-1, 1])
    values = om4 / delta * (groups.a11 * mu0 + spread)
    return FirstApproximation(size * jnp.stack(three), values, mu0, nu0)


def boundary_shift(groups: BalancerGroups, beta: Complex[Array, " r"]) -> Scalar:
    """`a11*`: value of a11 on the stability boundary, to first order in ball mass.

        a11* = -om^4 [ (a13 / a12) M / mu0 + M' / (2 mu0) ],  M = mu0^2 - |nu0|^2
        M' = 2 mu0 mu1 - 2 Re( nu0 conj(nu1) ),  mu1 = sum m_l / h_l^2,  nu1 = sum m_l beta_l / h_l^2

    The right side is taken at the critical speed. The boundary is then at the speed
    `sqrt((1 - a11*) / (1 - C))`, approximately. It follows from the exact polynomial.

    Args:
        groups: a balancer with C < 1 and ha > 0; its speed does not matter.
        beta: `second_harmonics` of the position.

    Returns:
        a11*. Differentiable.
    """
    groups = eqx.tree_at(lambda g: g.speed, groups, groups.critical_speed)
    first = groups.mass / groups.drag
    second = first / groups.drag
    mu0, mu1 = jnp.sum(first), jnp.sum(second)
    nu0, nu1 = jnp.sum(first * beta), jnp.sum(second * beta)
    gap = mu0**2 - jnp.abs(nu0) ** 2
    slope = 2 * mu0 * mu1 - 2 * (nu0 * jnp.conj(nu1)).real
    return -(groups.speed**4) * (groups.a13 / groups.a12 * gap + slope / 2) / mu0


class ZeroApproximation(NamedTuple):
    """Roots for balls without mass; `2 r` more roots are zero."""

    rotor: Complex[Array, " 4"]
    balls: Float[Array, " _"]  # -h_l, twice each


def zero_approximation(groups: BalancerGroups) -> ZeroApproximation:
    """Roots for m_l = 0: `l = nu - i om` and conjugate, `nu^2 + (ha - i om C) nu + 1 = 0`; -h_l.

    Args:
        groups: the balancer; its ball masses do not matter.

    Returns:
        `ZeroApproximation`. Differentiable.
    """
    half = (groups.damping - 1j * groups.speed * groups.polar) / 2
    spread = jnp.sqrt(half**2 - 1) * jnp.array([-1, 1])
    rotor = spread - half - 1j * groups.speed
    return ZeroApproximation(jnp.concatenate([rotor, rotor.conj()]), -jnp.repeat(groups.drag, 2))


def _fourth_power(polynomial: Array) -> Array:
    square = jnp.polymul(polynomial, polynomial)
    return jnp.polymul(square, square)


def _rows(groups: BalancerGroups, beta: Array) -> tuple[Array, Array, Array]:
    """`prod e^2`, `g prod e^2` and `(g^2 - |nu|^2) prod e^2` as polynomials."""
    edges = [jnp.stack([jnp.ones_like(h), h]) for h in groups.drag]

    def less(row):
        """`prod e_k` over all rows but one."""
        result = jnp.ones(1)
        for other, edge in enumerate(edges):
            result = result if other == row else jnp.polymul(result, edge)
        return result

    parts = [less(row) for row in range(groups.rows)]
    whole = jnp.polymul(parts[0], edges[0])
    shares = sum(m * part for m, part in zip(groups.mass, parts, strict=True))
    second = jnp.zeros(2 * groups.rows - 1)
    for one, share in enumerate(parts):
        for two, other in enumerate(parts):
            size = groups.mass[one] * groups.mass[two]
            aligned = (beta[one] * jnp.conj(beta[two])).real
            second = second + size * (1 - aligned) * jnp.polymul(share, other)
    return jnp.polymul(whole, whole), jnp.polymul(whole, shares), second


def _total(drags, free, first, pull, second, double) -> Array:
    """`free l^2 drags - pull l first + double second`."""
    result = jnp.polymul(jnp.polymul(free, drags), jnp.array([1.0, 0.0, 0.0]))
    result = jnp.polyadd(result, -jnp.polymul(jnp.polymul(pull, first), jnp.array([1.0, 0.0])))
    return jnp.polyadd(result, jnp.polymul(double, second))
