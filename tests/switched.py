"""A rotor against three sharp stops in numpy, contact switched by events of scipy; shares no stepping.

The linear part is that of the library; integration, events, forces and derivatives are not.
"""

import functools

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import jaxrotor as jr
from jaxrotor.equations.stationary_frame import Motion


TURN = 2 * np.pi


def gradient(field, size):
    """Of a field that is affine in its state."""
    rest = field(0.0, np.zeros(size))
    return np.stack([field(0.0, one) - rest for one in np.eye(size)], axis=-1)


class Switched:
    """The rotor in numpy, its contact switched by events of scipy: three stops, sharp law."""

    def __init__(self, scene):
        motion = Motion(jr.assemble(scene), jnp.abs(scene.spin.speed))
        a = np.asarray(motion.matrix())
        self.A = np.block([[a.real, -a.imag], [a.imag, a.real]])
        self.n, self.rate = a.shape[0] // 2, float(motion.rate)
        self.row, self.column = np.asarray(motion.rows)[0], np.asarray(motion.columns)[:, 0]
        self.load = np.zeros(2 * self.n, complex)
        if motion.unbalance is not None:
            self.load[self.n :] = np.asarray(motion.unbalance).T @ [1, 1j]
        self.stops, self.speed = scene.of(jr.Limiter), float(scene.spin.speed)

    def local(self, y):
        """Of every stop: depth [m], elastic and viscous force [N], slip [m/s]."""
        w = y[: 2 * self.n] + 1j * y[2 * self.n :]
        z, v = self.row @ w[: self.n], self.rate * (self.row @ w[self.n :])
        turned = [(np.exp(-1j * float(s.angle)), s) for s in self.stops]
        depth = [(z * t).real - float(s.gap) for t, s in turned]
        push = [
            float(s.stiffness) * d + float(s.damping) * (v * t).real
            for d, (t, s) in zip(depth, turned, strict=True)
        ]
        slip = [self.speed * float(s.rim_radius) + (v * t).imag for t, s in turned]
        return np.array([depth, push, slip])

    def field(self, theta, y, touching, forward):
        _, push, _ = self.local(y)
        force = sum(
            -push[i] * (1 + 1j * float(s.friction) * forward[i]) * np.exp(1j * float(s.angle))
            for i, s in enumerate(self.stops)
            if touching[i]
        )
        extra = self.load * np.exp(1j * theta)
        extra[self.n :] += self.column * force
        return self.A @ y + np.concatenate([extra.real, extra.imag])

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
            field = functools.partial(self.field, touching=touching.copy(), forward=forward.copy())
            span, fine = (theta, TURN * revolutions), {"rtol": 3e-13, "atol": 1e-16}
            found = solve_ivp(field, span, y, "DOP853", events=events, **fine)
            derivative = expm((found.t[-1] - theta) * gradient(field, y.size)) @ derivative
            theta, y = found.t[-1], found.y[:, -1]
            hit = [k for k, times in enumerate(found.t_events) if times.size]
            for k in hit:
                if k % 2:
                    forward[k // 2] *= -1
                else:
                    touching[k // 2] ^= True
                    changes += 1
                normal = gradient(lambda _, y: events[k](0.0, y), y.size)  # noqa: B023
                after = self.field(theta, y, touching, forward)
                jump = (after - field(theta, y)) / (normal @ field(theta, y))
                derivative = derivative + np.outer(jump, normal @ derivative)
        return y, changes, derivative

    def _event(self, kind, stop, direction):
        event = lambda theta, y: self.local(y)[kind, stop]
        event.terminal, event.direction = True, direction
        return event
