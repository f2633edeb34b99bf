"""First-order formulas for the whirl of a gyroscopic rotor, as approximations of its `roots`."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float

from ..core.compiled import compiled_quickly
from ..effects import AbstractLoad, Disc, HystereticDamping
from ..equations.system import assemble
from ..scene import Scene
from ..shafts import MasslessShaft


LARGEST_SHIFT = 0.1  # relative gyroscopic change of a frequency beyond which the formula fails
LEAST_SLOPE = 0.3  # least denominator of `e_w`, relative to its value at rest


class Perturbation(eqx.Module):
    """Approximate roots in the order forward slow, forward fast, backward slow, backward fast."""

    values: Complex[Array, " 4"]  # lambda [rad/s]
    at_rest: Float[Array, " 4"]  # whirl frequency without rotation and loss, signed [rad/s]
    undamped: Float[Array, " 4"]  # whirl frequency without loss [rad/s]
    valid: Bool[Array, " 4"]  # whether the first-order formula holds


@compiled_quickly
def perturbed_roots(scene: Scene) -> Perturbation:
    """`Omega = Lambda (1 + i e_h)`, `Lambda = lambda (1 + e_w)`; returned as `i Omega`.

        e_w = I_0 w L (m L^2 - k11) / (4 m I L^4 - 3 m I_0 w L^3 - 2 S L^2 + k11 I_0 w L),  L = lambda
        e_h = eta_s (S L^2 - k11 I_0 w L - 2 det) / (the same),                             L = Lambda

    `S = m k22 + I k11`, `det = k11 k22 - k12^2`; `eta_s = +eta` where `Lambda > w`, else `-eta`.

    Args:
        scene: a `MasslessShaft` with slope on rigid ends, discs, at most HystereticDamping; loads do
            not matter.

    Returns:
        Approximate roots. `valid` is false where the gyroscopic shift exceeds a tenth or is close to
        the pole of `e_w` (denominator below 0.3 of that at rest): use `roots` there.

    Raises:
        ValueError: the scene has parts that the formulas do not describe.

    Source: Brysin, Nikiforov (2019), eqs. (4)-(6).
    """
    _check_described(scene)
    system = assemble(scene)
    blocks, w = system.blocks, system.spin.speed
    zero = jnp.zeros((2, 2))
    part = lambda block: zero if block is None else block
    (m, _), (_, inertia) = part(blocks.inertia)
    polar = part(blocks.gyroscopic)[1, 1]
    (k11, k12), (_, k22) = part(blocks.stiffness)
    eta = part(blocks.hysteretic)[0, 0] / k11
    total, det = m * k22 + inertia * k11, k11 * k22 - k12**2
    momentum = polar * w  # angular momentum I_0 w [kg m^2/s]

    def denominator(x, momentum):
        slow = 4 * m * inertia * x**4 - 2 * total * x**2
        return slow - 3 * m * momentum * x**3 + k11 * momentum * x

    middle, spread = total, jnp.sqrt(total**2 - 4 * m * inertia * det)
    slow = jnp.sqrt(2 * det / (middle + spread))  # no cancellation
    fast = jnp.sqrt((middle + spread) / (2 * m * inertia))
    at_rest = jnp.array([slow, fast, -slow, -fast])
    below = denominator(at_rest, momentum)
    shift = momentum * at_rest * (m * at_rest**2 - k11) / below
    undamped = at_rest * (1 + shift)
    loss = jnp.where(undamped > w, eta, -eta)
    top = total * undamped**2 - k11 * momentum * undamped - 2 * det
    values = undamped * (1j - loss * top / denominator(undamped, momentum))
    near_pole = below / denominator(at_rest, 0.0) < LEAST_SLOPE
    return Perturbation(values, at_rest, undamped, (jnp.abs(shift) <= LARGEST_SHIFT) & ~near_pole)


def _check_described(scene: Scene) -> None:
    """Raise unless the formulas describe every part of the scene."""
    shaft = scene.shaft
    plain = (
        isinstance(shaft, MasslessShaft)
        and shaft.k12 is not None
        and shaft.anisotropy is None
        and shaft.damping is None
        and shaft.ends == "rigid"
    )
    described = (Disc, HystereticDamping, AbstractLoad)
    if not (plain and scene.of(Disc) and all(isinstance(one, described) for one in scene.effects)):
        raise ValueError(
            "The first-order formulas are for a round MasslessShaft with k12 and k22, without damping "
            "and on rigid ends, that carries discs and at most HystereticDamping; use `roots` for any "
            "other rotor."
        )
