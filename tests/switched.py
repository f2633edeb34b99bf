"""A rotor against three sharp stops in numpy, contact switched by events of scipy; shares no stepping.

The linear part is that of the library; integration, events, forces and derivatives are not.
"""

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import jaxrotor as jr
from jaxrotor.equations.stationary_frame import Motion


TURN = 2 * np.pi


def real_part(row):
    """Row that takes the real part of a complex row times `x + i y` from the state `(x, y)`."""
    return np.concatenate([row.real, -row.imag])


class Switched:
    """The rotor in numpy, its contact switched by events of scipy: three stops, sharp law.

    All that decides contact, and between events the field, is affine in the state.
    """

    def __init__(self, scene):
        motion = Motion(jr.assemble(scene), jnp.abs(scene.spin.speed))
        a = np.asarray(motion.matrix())
        self.A = np.block([[a.real, -a.imag], [a.imag, a.real]])
        self.n, self.rate = a.shape[0] // 2, float(motion.rate)
        self.row, self.column = np.asarray(motion.rows)[0], np.asarray(motion.columns)[:, 0]
        load = np.zeros(2 * self.n, complex)
        if motion.unbalance is not None:
            load[self.n :] = np.asarray(motion.unbalance).T @ [1, 1j]
        self.load = np.concatenate([load.real, load.imag]), np.concatenate([-load.imag, load.real])
        self.stops, self.speed = scene.of(jr.Limiter), float(scene.spin.speed)
        self.angles, self.friction = np.array(
            [(float(stop.angle), float(stop.friction)) for stop in self.stops]
        ).T
        self.rows, self.offsets = self._local()

    def _local(self):
        """Of every stop, as rows of the state and offsets: depth [m], force [N], slip [m/s]."""
        none = np.zeros(self.n)
        place = np.concatenate([self.row, none])
        rate = np.concatenate([none, self.rate * self.row])
        rows, offsets = [], []
        for stop in self.stops:
            turn, k, gap = np.exp(-1j * float(stop.angle)), float(stop.stiffness), float(stop.gap)
            push = k * place + float(stop.damping) * rate
            rows.append([real_part(one * turn) for one in (place, push, -1j * rate)])
            offsets.append([-gap, -k * gap, self.speed * float(stop.rim_radius)])
        return np.swapaxes(rows, 0, 1), np.transpose(offsets)

    def local(self, y):
        return self.rows @ y + self.offsets

    def affine(self, touching, forward):
        """Matrix and constant of the field while the same stops are touched."""
        matrix, constant = self.A.copy(), np.zeros(len(self.A))
        ways = -(1 + 1j * self.friction * forward) * np.exp(1j * self.angles)
        for i in np.flatnonzero(touching):
            push = np.concatenate([np.zeros(self.n), self.column * ways[i]])
            push = np.concatenate([push.real, push.imag])
            matrix += np.outer(push, self.rows[1, i])
            constant += push * self.offsets[1, i]
        return matrix, constant

    def field(self, theta, y, matrix, constant):
        return matrix @ y + (constant + np.cos(theta) * self.load[0] + np.sin(theta) * self.load[1])

    def run(self, y, revolutions):
        """State after some revolutions, and the number of changes of contact."""
        return self.followed(y, revolutions)[:2]

    def followed(self, y, revolutions):
        """The same, and the derivative of the state by that at the start, jumps included.

        Between events the field is affine, so its derivative is advanced by an exponential.
        """
        theta, changes, derivative = 0.0, 0, np.eye(y.size)
        depth, push, slip = self.local(y)
        touching, forward = (depth > 0) & (push > 0), np.sign(slip)
        while theta < TURN * revolutions - 1e-12:
            events = []
            for i in range(len(self.stops)):
                kind, sign = (1, -1) if touching[i] else (0, 1)
                events.append(self._event(kind, i, sign))
                events.append(self._event(2, i, -forward[i]))
            parts = self.affine(touching, forward)
            span, fine = (theta, TURN * revolutions), {"rtol": 3e-13, "atol": 1e-16}
            found = solve_ivp(self.field, span, y, "DOP853", events=events, args=parts, **fine)
            derivative = expm((found.t[-1] - theta) * parts[0]) @ derivative
            theta, y = found.t[-1], found.y[:, -1]
            hit = [k for k, times in enumerate(found.t_events) if times.size]
            for k in hit:
                before = self.field(theta, y, *parts)
                if k % 2:
                    forward[k // 2] *= -1
                else:
                    touching[k // 2] ^= True
                    changes += 1
                normal = events[k].row
                after = self.field(theta, y, *self.affine(touching, forward))
                jump = (after - before) / (normal @ before)
                derivative = derivative + np.outer(jump, normal @ derivative)
        return y, changes, derivative

    def _event(self, kind, stop, direction):
        row, offset = self.rows[kind, stop], self.offsets[kind, stop]
        event = lambda theta, y, *_: row @ y + offset
        event.terminal, event.direction, event.row = True, direction, row
        return event
