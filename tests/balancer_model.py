"""The auto-balancer by numpy and scipy alone: eqs. (2.1)-(2.2) of the source as they are printed."""

import numpy as np
from scipy.integrate import solve_ivp


MACHINE = dict(
    transverse=0.07,
    polar=0.014,
    stiffness=700.0,
    distance=0.14,
    unbalance=2.4e-3,
    balls=(2, 3),
    ball_mass=[0.025, 0.020],
    track_radius=[0.06, 0.06],
)


class Model:
    """Motion in dimensionless rotor axes, `y = (Re delta, Im delta, psi.., rates)`, worked out in SI."""

    def __init__(self, machine, mass_factor=1.0):
        self.m = m = {k: np.asarray(v, float) for k, v in machine.items() if k != "balls"}
        self.balls = machine["balls"]
        row = np.repeat(np.arange(len(self.balls)), self.balls)
        self.mass, self.radius, self.drag = (
            m[k][row] for k in ("ball_mass", "track_radius", "drag")
        )
        self.rolling = np.broadcast_to(m.get("rolling", 1.4), m["ball_mass"].shape)[row]
        self.rate = np.sqrt(m["stiffness"] / m["transverse"])
        first = m["ball_mass"][0] * m["track_radius"][0]
        self.tilt = m["distance"] * first / m["transverse"]
        # A lighter ball in the dimensionless groups: weaker coupling at the same imbalance and drag.
        self.factor = mass_factor

    def rhs(self, t, y):
        m, n = self.m, len(self.mass)
        w, d, factor = m["speed"], m["distance"], self.factor
        place, rate = np.split(np.asarray(y, float), 2)
        z, dz = (self.tilt * (x[0] + 1j * x[1]) for x in (place, rate))
        dz = self.rate * dz
        phi, dphi = place[2:], self.rate * rate[2:] + w
        a, b = z.real, z.imag
        da, db = (dz + 1j * w * z).real, (dz + 1j * w * z).imag
        c, s, mr = np.cos(phi), np.sin(phi), self.mass * self.radius
        big = np.zeros((n + 2, n + 2))
        big[0, 0] = big[1, 1] = m["transverse"]
        big[0, 2:], big[1, 2:] = -d * mr * c, -d * mr * s
        inertia = self.mass * self.rolling * self.radius
        big[2:, 0], big[2:, 1] = -factor * self.mass * d * c, -factor * self.mass * d * s
        big[2:, 2:] = np.diag(inertia)
        held = m["damping"] * np.array([da, db]) + m["stiffness"] * np.array([a, b])
        held += w * m["polar"] * np.array([db, -da])
        thrown = d * np.array([mr @ (dphi**2 * s), -mr @ (dphi**2 * c) - m["unbalance"] * w**2])
        slip = self.drag * self.radius * (dphi - w)
        found = np.linalg.solve(big, np.concatenate([-held - thrown, -slip]))
        ddz = found[0] + 1j * found[1] - 2j * w * dz + w**2 * z
        ddz = ddz / self.tilt
        change = np.concatenate([[ddz.real, ddz.imag], found[2:]]) / self.rate**2
        return np.concatenate([rate, change])

    def jacobian(self, y, step=1e-5):
        y, slopes = np.asarray(y, float), []
        for i in range(len(y)):
            e = step * np.eye(len(y))[i]
            near = self.rhs(0, y + e) - self.rhs(0, y - e)
            far = self.rhs(0, y + 2 * e) - self.rhs(0, y - 2 * e)
            slopes.append((8 * near - far) / (12 * step))
        return np.stack(slopes, axis=1)

    def at(self, positions, delta=0j, slip=0.0):
        angles = np.concatenate([np.asarray(row) for row in positions])
        rates = [(1j * slip * delta).real, (1j * slip * delta).imag, *np.full(len(angles), slip)]
        return np.concatenate([[np.real(delta), np.imag(delta)], angles, rates])

    def run(self, y, until, **options):
        options = dict(dict(method="DOP853", rtol=1e-10, atol=1e-12), **options)
        return solve_ivp(self.rhs, (0, until), y, **options)
