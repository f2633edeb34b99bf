"""Whirl of a shaft by transfer matrices: exact for uniform sections, sharing nothing with the library.

    w' = psi + Q / kGA,  psi' = M / EI,  Q' = -rho A w^2 W,  M' = -Q - (rho I w^2 - Omega rho P w) psi

A motion `exp(i w t)` of the plane x + i y at spin `Omega`. The state (w, psi, M, Q) at both ends of
every stretch is unknown; a whirl is where the conditions that tie them have a zero determinant.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq


@dataclass
class Stretch:
    length: float
    diameter: float
    youngs: float
    density: float
    shear: float = np.inf  # modulus; none by default
    inner: float = 0.0
    rotary: bool = True

    def matrix(self, whirl, speed):
        outer, ratio = self.diameter, self.inner / self.diameter
        area, second = (
            np.pi / 4 * (outer**2 - self.inner**2),
            np.pi / 64 * (outer**4 - self.inner**4),
        )
        soft = 0.0
        if np.isfinite(self.shear):
            nu, r2 = self.youngs / (2 * self.shear) - 1, ratio**2
            cowper = 6 * (1 + r2) ** 2 * (1 + nu)
            cowper /= (7 + 6 * nu) * (1 + r2) ** 2 + (20 + 12 * nu) * r2
            soft = 1 / (cowper * self.shear * area)
        turning = self.density * second * (whirl**2 - 2 * speed * whirl) * self.rotary
        rates = np.zeros((4, 4))
        rates[0, 1], rates[0, 3] = 1, soft
        rates[1, 2] = 1 / (self.youngs * second)
        rates[2, 1], rates[2, 3] = -turning, -1
        rates[3, 0] = -self.density * area * whirl**2
        return expm(rates * self.length)


@dataclass
class Joint:
    """What sits between two stretches or at an end."""

    mass: float = 0.0
    diametral: float = 0.0
    polar: float = 0.0
    stiffness: float = 0.0
    pinned: bool = False
    slope: bool = False

    def jumps(self, whirl, speed):
        """Jump of Q by w, and of M by psi."""
        turning = self.polar * speed * whirl - self.diametral * whirl**2
        return self.stiffness - self.mass * whirl**2, turning


def determinant(stretches, joints, whirl, speed):
    """Of all conditions; `joints` has one more than `stretches`."""
    units = np.array([1, 1 / 0.3, 1e4, 1e4])  # of the state, to keep the determinant in range
    count = 8 * len(stretches)
    rows = []
    for k, stretch in enumerate(stretches):
        tie = np.zeros((4, count))
        tie[:, 8 * k : 8 * k + 4] = -stretch.matrix(whirl, speed) * units
        tie[:, 8 * k + 4 : 8 * k + 8] = np.diag(units)
        rows += list(tie)
    for k, joint in enumerate(joints):
        left = np.zeros((4, count))  # the state before and after the joint
        right = np.zeros((4, count))
        if k:
            left[:, 8 * k - 4 : 8 * k] = np.diag(units)
        if k < len(stretches):
            right[:, 8 * k : 8 * k + 4] = np.diag(units)
        here = right if k < len(stretches) else left
        by_w, by_psi = joint.jumps(whirl, speed)
        force = here[0] if joint.pinned else right[3] - left[3] - by_w * here[0]
        couple = here[1] if joint.slope else right[2] - left[2] - by_psi * here[1]
        rows += [force, couple]
        if 0 < k < len(stretches):
            rows += [right[0] - left[0], right[1] - left[1]]
    matrix = np.array(rows)
    return np.linalg.det(matrix / np.abs(matrix).max(axis=1, keepdims=True))


def whirl_near(guess, stretches, joints, speed=0.0, reach=1e-5):
    """The exact whirl frequency within `reach` of a guess, or an error if there is none."""
    at = lambda whirl: determinant(stretches, joints, whirl, speed)
    low, high = sorted((guess * (1 - reach), guess * (1 + reach)))
    return brentq(at, low, high, xtol=1e-13 * abs(guess), rtol=1e-14)
