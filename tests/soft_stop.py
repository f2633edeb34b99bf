"""The force of a stop with `blend` and `slip`, written by its law for plain numbers."""

import numpy as np


def soft_force(z, v, speed, stop):
    """Force on a shaft at z with the velocity v that turns at `speed`, of a stop by its parameters."""
    turned = np.exp(-1j * stop["angle"])
    depth, rate = (z * turned).real - stop["gap"], (v * turned).real
    if depth <= 0:
        return 0.0
    blend, stiffness = stop["blend"], stop["stiffness"]
    u = min(depth / blend, 1.0)
    elastic = stiffness * (depth + blend * (_onset(u) - u))
    push = max(elastic + stop["damping"] * rate * u**3 * (10 - 15 * u + 6 * u**2), 0.0)
    w = min(push / (stiffness * blend), 1.0)
    normal = push + stiffness * blend * (_onset(w) - w)
    slip = np.clip((speed * stop["rim_radius"] + (v * turned).imag) / stop["slip"], -1, 1)
    direction = slip * (15 - 10 * slip**2 + 3 * slip**4) / 8
    return -normal * (1 + 1j * stop["friction"] * direction) / turned


def _onset(u):
    return u**3 * (6 - 8 * u + 3 * u**2)
