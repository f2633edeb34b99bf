"""The rotor of the comparison: the limiter rotor in its backward rub, for jaxrotor and as arrays."""

import functools
from typing import NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxrotor as jr
from jaxrotor.core.parallel import chunk_size, spread
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.equations.system import port_groups
from jaxrotor.motion.base import Plan
from jaxrotor.motion.revolutions import March


SCENE = jr.load("limiter-rotor")
START = jr.Whirl(0.012 * 0.7, rate=-10 / 0.022646559709295067)  # leads to the backward rub
LARGEST = 1e-5  # [m] of the eccentricities
REFERENCE_STEPS = 4096  # a revolution, by Exponential(4)
SAMPLES = 32  # a revolution, from which the peers' rates come
LANES_PER_CHUNK = 128  # as in a sweep


@functools.cache
def settled() -> jr.Continued:
    """State without eccentricity in its periodic backward rub."""
    return jr.simulate(SCENE, 300, 1024, solver=jr.Exponential(4), start=START, keep=1).end


def whirl_rate(z: np.ndarray) -> float:
    """Bump-weighted mean of the whirl's angular velocity over the spin's, from complex samples."""
    turned = np.angle(z[1:] * z[:-1].conj()) * SAMPLES / (2 * np.pi)
    u = (np.arange(turned.size) + 0.5) / turned.size
    weight = np.exp(-1 / (u * (1 - u)))
    return float(turned @ weight / weight.sum())


# === jaxrotor


def library_rates(
    choice: dict, steps: int, revolutions: int, eccentricities, workers: int = 1, scene=SCENE
) -> np.ndarray:
    """Whirl rates by the public sweep; `choice` are the keywords of `Exponential`.

    No lanes are run again for an error, which the peers do not tell either.
    """
    over = {"unbalance.eccentricity": eccentricities}
    run = {"start": settled(), "settle": 0, "keep": revolutions, "progress": False}
    run["error_sample"] = 0
    how = {"solver": jr.Exponential(**choice), "steps_per_revolution": steps, "workers": workers}
    found = jr.sweep(scene, over, observe=(jr.observe.Precession(),), **run, **how)
    return found["whirl_rate"].values


@functools.cache
def reference(revolutions: int) -> np.ndarray:
    """Rates of the first and the last lane over a window."""
    return library_rates({"order": 4}, REFERENCE_STEPS, revolutions, [0.0, LARGEST])


def plan_of(scene: jr.Scene, solver: jr.Exponential, steps: int) -> Plan:
    """Plan of a march that observes displacements alone."""
    return Plan(
        solver=solver,
        controller=None,
        adjoint=dfx.ForwardMode(),
        max_steps=4096,
        steps=steps,
        slopes=False,
        contacts=False,
        coordinates=False,
        together=port_groups(scene),
        batch=True,
    )


class Lanes(NamedTuple):
    """Marches of many lanes, as a sweep holds them: what all share, and what each has of its own."""

    shared: March
    own: March
    y: jax.Array  # (lanes, state)

    @classmethod
    def of(cls, solver: jr.Exponential, steps: int, eccentricities, start=None) -> "Lanes":
        plan, station = plan_of(SCENE, solver, steps), SCENE.stations()
        start = settled() if start is None else start

        def build(eccentricity):
            scene = SCENE.put({"unbalance.eccentricity": eccentricity})
            march = March.build(scene, plan, jnp.abs(scene.spin.speed), station)
            return march, march.begin(start, station[0])

        constant = eqx.filter(
            eqx.filter_eval_shape(build, jnp.zeros(())),
            lambda leaf: not isinstance(leaf, jax.ShapeDtypeStruct),
        )
        every = lambda e: eqx.filter(build(e), eqx.is_array)
        with jax.default_device(jax.local_devices(backend="cpu")[0]):
            arrays = eqx.filter_jit(lambda e: jax.lax.map(every, e))(jnp.asarray(eccentricities))
        march, y = jax.device_get(arrays)
        same = jax.tree.map(lambda leaf: bool((leaf == leaf[:1]).all()), march)
        shared = jax.tree.map(lambda leaf, s: jnp.asarray(leaf[0]) if s else None, march, same)
        own = jax.tree.map(lambda leaf, s: None if s else jnp.asarray(leaf), march, same)
        return cls(eqx.combine(shared, constant[0]), own, jnp.asarray(y))

    def part(self, lanes) -> "Lanes":
        """Some of the lanes: a slice, or indices."""
        return Lanes(self.shared, *jax.tree.map(lambda leaf: leaf[lanes], (self.own, self.y)))

    def march(self, revolutions: int, workers: int = 1) -> jax.Array:
        """States after whole revolutions, nothing observed."""
        size = chunk_size(len(self.y), LANES_PER_CHUNK, workers)
        chunks = [self.part(slice(i, i + size)) for i in range(0, len(self.y), size)]
        run = lambda chunk, tick: skipped(*chunk, revolutions).block_until_ready()
        return jnp.concatenate(spread(run, chunks, workers, lambda steps: None))

    def decode(self, y: jax.Array) -> np.ndarray:
        """Complex `(q, dq/dtheta)` (lanes, 2 n) of states at a whole revolution."""
        of = lambda own, y: eqx.combine(own, self.shared).form.decode(y)
        q, velocity = jax.vmap(of)(self.own, y)
        return np.concatenate([q, velocity / np.abs(SCENE.spin.speed)], axis=1)


@eqx.filter_jit
def skipped(shared: March, own: March, y: jax.Array, revolutions: int) -> jax.Array:
    """States of all lanes after whole revolutions, one program."""
    return jax.vmap(lambda own, y: eqx.combine(own, shared).skip(y, revolutions)[0])(own, y)


# === the same rotor for the others


@functools.cache
def motion_and_state(modes: int | None = None):
    """First-order motion at the largest eccentricity, and the settled state (q or q', x or y, n).

    `modes`: on so many real modes of the rotor at rest, else on all coordinates.
    """
    scene = SCENE.replace({"unbalance.eccentricity": LARGEST})
    motion = Motion(jr.assemble(scene), jnp.abs(scene.spin.speed))
    state = np.stack([settled().q, settled().velocity / motion.rate])
    state = np.stack([state.real, state.imag], axis=1)
    if modes is None:
        return motion, state
    return reduced(motion, modes), state @ _modes(motion, modes)[1].T


def _modes(motion: Motion, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The lowest modes at rest without damping, and what reads their amplitudes."""
    squares, shapes = np.linalg.eig(np.asarray(motion.stiffness))
    order = np.argsort(squares.real)[:count]
    return shapes.real[:, order], np.linalg.inv(shapes.real)[order]


def reduced(motion: Motion, count: int) -> Motion:
    """The motion on its lowest modes at rest: coordinates are their amplitudes."""
    shapes, read = _modes(motion, count)
    parts = {
        "stiffness": lambda x: read @ x @ shapes,
        "damping": lambda x: read @ x @ shapes,
        "gyroscopic": lambda x: read @ x @ shapes,
        "circulatory": lambda x: read @ x @ shapes,
        "constant": lambda x: x @ read.T,
        "unbalance": lambda x: x @ read.T,
        "columns": lambda x: read @ x,
        "rows": lambda x: x @ shapes,
    }
    names = [name for name in parts if getattr(motion, name) is not None]
    values = [jnp.asarray(parts[name](np.asarray(getattr(motion, name)))) for name in names]
    return eqx.tree_at(lambda m: [getattr(m, name) for name in names], motion, values)


class Arrays(NamedTuple):
    """A motion in plain numbers, contact at one station: `y' = a y + [0, column F + load e^(i theta)]`."""

    a: np.ndarray  # (2 n, 2 n) complex, on (q, q')
    row: np.ndarray  # (n,) displacement of the station
    column: np.ndarray  # (n,)
    load: np.ndarray  # (n,) complex, at the largest eccentricity
    start: np.ndarray  # (2 n,) complex
    rate: float  # [rad/s]
    cos: np.ndarray  # (k,) direction of every stop
    sin: np.ndarray
    gap: np.ndarray  # [m]
    stiffness: np.ndarray  # [N/m]
    damping: np.ndarray  # [N s/m]
    friction: np.ndarray
    rim: float  # [m/s], speed of the rim

    @classmethod
    def of(cls, motion: Motion, state: np.ndarray) -> "Arrays":
        ((law,),) = [port.laws for port in motion.ports]
        stop = jax.tree.map(np.asarray, law.contact)
        real, imag = np.asarray(motion.unbalance)
        return cls(
            np.asarray(motion.matrix()),
            np.asarray(motion.rows)[0],
            np.asarray(motion.columns)[:, 0],
            real + 1j * imag,
            (state[:, 0] + 1j * state[:, 1]).ravel(),
            float(motion.rate),
            np.asarray(law.cos),
            np.asarray(law.sin),
            stop.gap,
            stop.stiffness,
            stop.damping,
            stop.friction,
            float(motion.speed * stop.rim_radius[0]),
        )


@functools.cache
def arrays(modes: int | None = None) -> Arrays:
    """The rotor in plain numbers."""
    return Arrays.of(*motion_and_state(modes))
