"""Dry whirl of random rotors and rings: what `jaxrotor.dry_whirl` predicts, against runs in time.

Every rotor has two complex coordinates (displacement and tilt of a disc, with gyroscopic moments, and
damping that turns with the shaft) and a ring of random stiffness, damping, friction and width of slip.
Each whirl that is predicted is started a thousandth off; it must stay where it is predicted stable, and
leave where it is not. Where none is predicted, the run begins on the whirl that more friction would
sustain, and must leave it. The runs share no code with the library but the matrices of the rotor: they
take Runge-Kutta steps with the written law of the ring.

    python benchmarks/dry_whirl.py --count 1000
    python benchmarks/dry_whirl.py --figure docs/ring.png      # pictures of docs/concepts/ring.md
"""

import argparse
import functools
import time
from typing import NamedTuple

import jax
import jax.numpy as jnp
import matplotlib
import numpy as np


matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

import jaxrotor as jr
from jaxrotor import plot


AT, GAP = 0.5, 1.0
RANGES = {  # path: lowest and highest value, of a uniform distribution of the logarithm
    "spin.speed": (0.3, 10.0),
    "annular_stator.rim_radius": (0.3, 10.0),
    "annular_stator.stiffness": (1.0, 100.0),
    "annular_stator.friction": (0.01, 1.0),
    "annular_stator.damping": (0.01, 1.0),
    "annular_stator.slip": (0.02, 0.2),
    "disc_damping.translational": (0.006, 0.4),
    "disc_damping.angular": (0.001, 0.1),
    "disc.diametral": (0.05, 1.0),
    "disc.polar": (0.05, 2.0),
    "shaft.k22": (0.3, 3.0),
    "shaft.damping": (0.001, 0.05),
}
FRICTION = "annular_stator.friction"
MORE = 4.0  # times the friction that a whirl needs, where that at hand sustains none
OFF = 1e-3  # relative distance from the orbit at the start
STEP = 0.2  # over the largest root
LONG = 15.0  # length of a run, in times of growth or decay by e
MOST = 300_000  # steps
LEAST = 4.0  # a run of fewer times of growth or decay cannot tell
PLACES = 4  # whirls of a rotor that are run
TOGETHER = 64  # runs


class Rotor(NamedTuple):
    """Matrices of a rotor, and its ring."""

    inertia: jax.Array
    damping: jax.Array
    stiffness: jax.Array
    row: jax.Array
    column: jax.Array
    ring: jax.Array  # stiffness, damping, friction and slip
    rim: jax.Array  # speed of its surface


class Whirl(NamedTuple):
    """A whirl to begin with."""

    there: jax.Array
    borrowed: jax.Array  # from a rotor with more friction, as this one has none
    stable: jax.Array
    rolling: jax.Array
    growth: jax.Array
    fastest: jax.Array  # size of the largest root
    rate: jax.Array
    q: jax.Array


def scene() -> jr.Scene:
    """The rotor whose numbers are drawn."""
    return jr.Scene(
        jr.MasslessShaft(1.0, AT, 1.0, 0.1, 1.0, damping=0.01),
        jr.Disc(AT, 1.0, 0.2, 0.3),
        jr.DiscDamping(AT, 0.1, 0.01),
        jr.AnnularStator(AT, GAP, 10.0, 0.1, 0.1, 1.0, slip=0.1),
        spin=jr.ConstantSpeed(1.0),
    )


def drawn(count: int, seed: int) -> dict[str, jax.Array]:
    """Values of all parameters; a quarter of the rotors have no tilt that is coupled."""
    rng = np.random.default_rng(seed)
    values = {path: np.exp(rng.uniform(*np.log(ends), count)) for path, ends in RANGES.items()}
    coupling = rng.uniform(-0.9, 0.9, count) * (rng.uniform(size=count) > 0.25)
    values["shaft.k12"] = coupling * np.sqrt(values["shaft.k22"])
    values["annular_stator.damping"] *= rng.uniform(size=count) > 0.3
    return {path: jnp.asarray(part) for path, part in values.items()}


def predict(base: jr.Scene, values: dict[str, jax.Array]) -> tuple[Rotor, Whirl]:
    """Matrices of a rotor, and `PLACES` whirls."""
    own = base.put(values)

    def with_friction(friction, _):  # one program finds both
        found = jr.dry_whirl(own.put({FRICTION: friction}), PLACES)
        needed = jnp.where(found.least_friction > friction, found.least_friction, friction)
        return MORE * needed, found

    _, found = jax.lax.scan(with_friction, values[FRICTION], length=2)
    whirls, more = (jax.tree.map(lambda part, i=i: part[i], found) for i in (0, 1))
    backward = lambda found: found.exists & (found.rate < 0)
    none = ~jnp.any(backward(whirls))

    def parts(found: jr.DryWhirl) -> Whirl:
        fastest = jnp.nanmax(jnp.abs(found.roots), axis=1)
        stable = found.stable & ~none
        shared = found.growth, fastest, found.rate, found.coordinates
        return Whirl(backward(found), jnp.full_like(stable, none), stable, found.rolling, *shared)

    whirl = jax.tree.map(lambda a, b: jnp.where(none, a, b), parts(more), parts(whirls))
    system, (ring,) = jr.assemble(own), own.of(jr.AnnularStator)
    blocks, speed, port = system.blocks, system.spin.speed, system.ports[0]
    rotor = Rotor(
        blocks.inertia,
        blocks.damping - 1j * speed * blocks.gyroscopic,
        blocks.stiffness - 1j * speed * blocks.circulatory,
        port.row,
        port.column,
        jnp.stack([ring.stiffness, ring.damping, ring.friction, ring.slip]),
        speed * ring.rim_radius,
    )
    return rotor, whirl


def force(rotor: Rotor, z: jax.Array, v: jax.Array) -> jax.Array:
    """The law of a ring with a sharp onset and smoothed friction."""
    stiffness, damping, friction, slip = rotor.ring
    radius = jnp.abs(z)
    n = z / jnp.where(radius > 0, radius, 1.0)
    normal = stiffness * (radius - GAP) + damping * (v * n.conj()).real
    normal = jnp.where((radius > GAP) & (normal > 0), normal, 0.0)
    u = jnp.clip((rotor.rim + (v * n.conj()).imag) / slip, -1.0, 1.0)
    return -normal * (1 + 1j * friction * u * (15 - 10 * u**2 + 3 * u**4) / 8) * n


def run(rotor: Rotor, whirl: Whirl, off: jax.Array, steps: jax.Array, h: jax.Array):
    """Least and largest radius in the last tenth of a run, its whirl rate there, distance at the end."""
    inverse = jnp.linalg.inv(rotor.inertia)
    stiff, damp, push = inverse @ rotor.stiffness, inverse @ rotor.damping, inverse @ rotor.column
    start = jnp.concatenate([whirl.q, 1j * whirl.rate * whirl.q])
    size = jnp.concatenate([jnp.ones(2), jnp.full(2, jnp.abs(whirl.rate))]) * jnp.linalg.norm(
        whirl.q
    )

    def field(y):
        q, v = jnp.split(y, 2)
        pressed = force(rotor, rotor.row @ q, rotor.row @ v)
        return jnp.concatenate([v, push * pressed - stiff @ q - damp @ v])

    def step(i, carry):
        y, low, high, turned = carry
        a = field(y)
        b = field(y + h / 2 * a)
        c = field(y + h / 2 * b)
        d = field(y + h * c)
        new = y + h / 6 * (a + 2 * b + 2 * c + d)
        new = jnp.where(i < steps, new, y)
        before, after = rotor.row @ y[:2], rotor.row @ new[:2]
        late = (i > 0.9 * steps) & (i < steps)
        low = jnp.where(late & (jnp.abs(after) < low), jnp.abs(after), low)
        high = jnp.where(late & (jnp.abs(after) > high), jnp.abs(after), high)
        turned += jnp.where(late, jnp.angle(after * before.conj()), 0.0)
        return new, low, high, turned

    def apart(y):
        """Distance from the orbit, whatever the phase."""
        turn = jnp.vdot(start / size, y / size)
        ahead = turn / jnp.where(jnp.abs(turn) > 0, jnp.abs(turn), 1.0)
        return jnp.linalg.norm((y - ahead * start) / size)

    y = start + size * off
    carry = y, jnp.asarray(jnp.inf), jnp.zeros(()), jnp.zeros(())
    y, low, high, turned = jax.lax.fori_loop(0, steps, step, carry)
    span = jnp.where(steps > 0, 0.1 * steps * h, 1.0)
    return low, high, turned / span, apart(y)


def judged(count: int, seed: int = 1) -> dict[str, int]:
    """Numbers of rotors and runs, and of those whose runs contradict what was predicted."""
    values = drawn(count, seed)
    predictions = jax.jit(jax.vmap(functools.partial(predict, scene())))(values)
    rotors, whirls = jax.tree.map(np.asarray, predictions)
    which, place = np.nonzero(whirls.there)
    rotors = jax.tree.map(lambda part: part[which], rotors)
    whirls = jax.tree.map(lambda part: part[which, place], whirls)
    rng = np.random.default_rng(seed + 1)
    off = (rng.normal(size=(which.size, 4)) + 1j * rng.normal(size=(which.size, 4))) / 4
    wrong, telling = _contradicted(rotors, whirls, off)
    some = np.flatnonzero(wrong)
    if (
        some.size
    ):  # shorter steps from nearer the orbit tell errors of steps, and small limit cycles
        again = (jax.tree.map(lambda part: part[some], one) for one in (rotors, whirls, off))
        wrong[some], _ = _contradicted(*again, closer=10.0)
    rotors_with = lambda chosen: len(set(which[chosen].tolist()))
    own = ~whirls.borrowed
    for one in np.flatnonzero(wrong):
        print(f"misjudged: { {path: float(part[which[one]]) for path, part in values.items()} }")
    return {
        "rotors": count,
        "with a stable whirl": rotors_with(own & whirls.stable),
        "with unstable whirls alone": rotors_with(own) - rotors_with(own & whirls.stable),
        "without a whirl, run": rotors_with(whirls.borrowed),
        "runs": which.size,
        "of whirls that flutter": int(np.sum(own & ~whirls.stable & whirls.rolling)),
        "too slow to tell": int(np.sum(~telling)),
        "rotors misjudged": rotors_with(wrong),
    }


def _contradicted(rotors: Rotor, whirls: Whirl, off, closer: float = 1.0):
    """Whether each run contradicts what was predicted, and whether it is long enough to tell.

    A run that begins `closer` takes steps shorter by the root of that, and as many more.
    """
    h = STEP / whirls.fastest / closer**0.5
    away, most = OFF / closer, MOST * closer
    steps = np.ceil(np.minimum(LONG / np.abs(whirls.growth) / h, most)).astype(int)
    low, high, rate, apart = _ran(rotors, whirls, away * off, steps, h)
    telling = steps * h * np.abs(whirls.growth) >= LEAST
    # A whirl that is left may end on another one; where there is none at all, on none.
    circular = (low > GAP) & (high < 1.001 * low) & (rate < 0)
    wrong = np.where(whirls.stable, ~(apart < away / 3), ~(apart > 3 * away))
    return telling & np.where(whirls.borrowed, circular, wrong), telling


def _ran(rotors: Rotor, whirls: Whirl, off, steps, h) -> np.ndarray:
    """Results of all runs, those of similar length together, by one program."""
    together, order, found = jax.jit(jax.vmap(run)), np.argsort(steps), []
    for first in range(0, order.size, TOGETHER):
        some = np.resize(order[first : first + TOGETHER], TOGETHER)
        parts = (jax.tree.map(lambda part, some=some: part[some], one) for one in (rotors, whirls))
        found.append(np.array(together(*parts, off[some], steps[some], h[some])))
    return np.concatenate(found, axis=1)[:, : order.size][:, np.argsort(order)]


def draw(path: str) -> None:
    """Full rubs of the shipped scene over speed, and dry whirl of the limiter rotor in a ring."""
    figure, (above, below) = plt.subplots(2, 1, figsize=(4.7, 6.4), dpi=200, layout="constrained")
    plot.annular_rub(jr.annular_rub(jr.load("ring-rub"), np.linspace(100, 1200, 221)), ax=above)
    rotor = jr.load("limiter-rotor").with_nodes(8)
    stop = rotor.of(jr.Limiter)[0]
    same = {name: getattr(stop, name) for name in ("gap", "stiffness", "damping", "rim_radius")}
    rotor = rotor.without("limiters").without("unbalance")
    rotor = rotor.of_parts(*rotor.effects, jr.AnnularStator(stop.at, friction=0.1, **same))
    speeds, frictions = np.linspace(5, 350, 60), np.linspace(0.002, 0.12, 60)
    plot.dry_whirl(jr.dry_whirl_map(rotor, speeds, frictions), ax=below)
    figure.savefig(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--figure", help="draw the pictures of the documentation instead")
    given = parser.parse_args()
    if given.figure:
        draw(given.figure)
        return
    started = time.perf_counter()
    for name, number in judged(given.count, given.seed).items():
        print(f"{number:6d} {name}")
    print(f"{time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
