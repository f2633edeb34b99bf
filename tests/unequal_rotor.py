"""Rotors with unequal axes, and their motion by scipy on equations written by hand."""

import numpy as np
from scipy.integrate import solve_ivp

import jaxrotor as jr


SPEED = 150.0
BEARING = {"kxx": 4e4, "kyy": 1e4, "kxy": 1e4, "kyx": -2e4, "cxx": 40.0, "cyy": 80.0}
BEARING |= {"cxy": 3.0, "cyx": -5.0}
WHAT = ("damping", "stiffness")
NAMES = ["damping", "skew_damping", "gyroscopic", "stiffness", "skew_circulatory", "skew_stiffness"]
NAMES += ["circulatory", *(f"{axes}_{what}" for axes in ("fixed", "rotating") for what in WHAT)]


def rotor(*effects, anisotropy=None, internal=5.0, stops=True, speed=SPEED):
    """A disc on a massless shaft between stops, with weight, unbalance and damping that turns."""
    around = []
    if stops:
        stop = {"at": 0.5, "gap": 1e-3, "stiffness": 4e5, "damping": 50.0}
        stop |= {"friction": 0.1, "rim_radius": 0.1}
        around = jr.Limiter.at_angles(np.array([1.0, 3.0, 5.0]) * np.pi / 3, **stop)
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 2e4, anisotropy=anisotropy, damping=internal),
        jr.Disc(0.5, 2.0),
        jr.DiscDamping(0.5, 20.0),
        jr.Unbalance(0.5, 2.0, 1e-3, 0.4),
        jr.Gravity(9.81),
        *effects,
        *around,
        spin=jr.ConstantSpeed(speed),
    )


def unequal(kind, **options):
    """Axes that are unequal in space, or turn with the shaft, or both."""
    bearing = [jr.Support(0.5, **BEARING)] if kind in ("fixed", "both") else []
    share = 0.15 if kind in ("turning", "both") else None
    return rotor(*bearing, anisotropy=share, **options)


class ByHand:
    """`M q.. + C q. + K q + C_f q.* + K_f q* + (C_r r.* + K_r r*) exp(i Omega t) = loads + contact`.

    `r = q exp(-i Omega t)`.
    """

    def __init__(self, scene):
        system = jr.assemble(scene)
        blocks, self.n = system.blocks, system.n
        part = lambda name: getattr(blocks, name)
        zero = np.zeros((self.n, self.n))
        one = {k: zero if part(k) is None else np.asarray(part(k)) for k in blocks.present + NAMES}
        self.speed = w = float(scene.spin.speed)
        self.C = one["damping"] + 1j * (one["skew_damping"] - w * one["gyroscopic"])
        self.K = one["stiffness"] + w * one["skew_circulatory"]
        self.K = self.K + 1j * (one["skew_stiffness"] - w * one["circulatory"])
        self.unequal = [one[f"{axes}_{what}"] for axes in ("fixed", "rotating") for what in WHAT]
        self.inverse = np.linalg.inv(one["inertia"])
        # The field is linear in the state: its matrices are taken from `linear` once.
        unit = np.eye(4 * self.n)
        still, turning = self.linear(unit)
        self.matrix = self.pushed(still)
        self.matrix[: 2 * self.n] = unit[2 * self.n :]
        self.turning = [self.pushed(turning), self.pushed(1j * turning)]
        load = w**2 * np.asarray(system.load.unbalance)
        self.weight = self.pushed(np.asarray(system.load.constant))
        self.unbalance = [self.pushed(load), self.pushed(1j * load)]
        names = ("angle", "gap", "stiffness", "damping", "friction", "rim_radius")
        stops = [[float(getattr(stop, name)) for name in names] for stop in scene.of(jr.Limiter)]
        self.stops = [(np.exp(1j * angle), *law) for angle, *law in stops]
        if self.stops:
            self.row, column = map(np.asarray, (system.ports[0].row, system.ports[0].column))
            self.push = [self.pushed(column), self.pushed(1j * column)]

    def linear(self, y):
        """Forces that the state gives, and those that turn by `exp(2 i Omega t)`."""
        x, y, u, v = np.split(y, 4)
        q, rate = x + 1j * y, u + 1j * v
        damping, stiffness, turning_damping, turning_stiffness = self.unequal
        still = -self.C @ rate - self.K @ q - damping @ rate.conj() - stiffness @ q.conj()
        drift = rate - 1j * self.speed * q
        return still, -turning_damping @ drift.conj() - turning_stiffness @ q.conj()

    def pushed(self, force):
        """Change of the state by forces."""
        a = self.inverse @ force
        return np.concatenate([0 * a.real, 0 * a.real, a.real, a.imag])

    def contact(self, z, v):
        total = 0j
        for normal, gap, stiffness, damping, friction, rim in self.stops:
            depth = (z / normal).real - gap
            if depth > 0:
                push = stiffness * depth + damping * (v / normal).real
                slip = (v / normal).imag + self.speed * rim
                total -= max(push, 0.0) * normal * (1 + 1j * friction * np.sign(slip))
        return total

    def __call__(self, t, y):
        turn, n = np.exp(1j * self.speed * t), self.n
        twice = turn**2
        change = self.matrix @ y + self.weight
        change += twice.real * (self.turning[0] @ y) + twice.imag * (self.turning[1] @ y)
        change += turn.real * self.unbalance[0] + turn.imag * self.unbalance[1]
        if self.stops:
            z, v = (self.row @ a + 1j * (self.row @ b) for a, b in y.reshape(2, 2, n))
            force = self.contact(z, v)
            if force:
                change += force.real * self.push[0] + force.imag * self.push[1]
        return change

    def map(self, seconds, start, **options):
        """State `(x, y, x., y.)` at the end of a run."""
        how = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-14, "max_step": seconds / 400}
        return solve_ivp(self, (0, seconds), start, **(how | options)).y[:, -1]

    def end(self, seconds, start=None, **options):
        """Coordinates at the end of a run, from rest."""
        start = np.zeros(4 * self.n) if start is None else start
        y = self.map(seconds, start, **options)
        return y[: self.n] + 1j * y[self.n : 2 * self.n]
