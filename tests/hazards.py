"""Programs of very many lanes, run by a process that may hang or crash, on one processor or on all.

`python tests/hazards.py NAME ..` runs them in turn, and writes a line of JSON for each one done. The
compiler has its own settings there, as it has for a user: those of `conftest.py` hide half of what
is looked for.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable

import diffrax as dfx
import flags
import garbage
import jax
import jax.numpy as jnp
import numpy as np

import jaxrotor as jr
from jaxrotor import objectives as of
from jaxrotor.core import linalg
from jaxrotor.core.compiled import QUICKLY


LANES, CHUNK = 16_640, 128  # some programs of jax went wrong above 16 384
# Options by which the program of chunks is compiled: as other tests compile theirs.
SIMPLY = {
    "compiler_options": QUICKLY["compiler_options"] | {"xla_disable_hlo_passes": flags.PASSES}
}
LIMIT = 240  # [s] for one program, its compilation included; most take less than 10


def outcomes(
    names: Iterable[str], limit: float = LIMIT, one_processor: bool = False
) -> dict[str, str]:
    """What became of each program: "" if all is well, else what is wrong.

    One process runs them all. Where it hangs or crashes, the next one goes on behind that program. The
    limit counts from the moment when it has loaded the library.
    """
    left, found = list(names), {}
    while left:
        lines, ended = _process(left, limit, one_processor)
        done = [json.loads(line) for line in lines]
        found |= {one["name"]: one["error"] for one in done}
        left = left[len(done) :]
        if left:
            found[left.pop(0)] = ended
    return found


def _process(names: list[str], limit: float, one_processor: bool) -> tuple[list[str], str]:
    """Lines that a process wrote, and how it ended."""
    own = ("XLA_FLAGS", "NPROC")  # of the tests
    settings = {key: value for key, value in os.environ.items() if key not in own}
    every = os.sched_getaffinity(0)
    command = [sys.executable, __file__, *names]
    with tempfile.TemporaryFile("w+") as said, tempfile.TemporaryFile("w+") as errors:
        try:
            os.sched_setaffinity(0, {max(every)} if one_processor else every)
            process = subprocess.Popen(command, stdout=said, stderr=errors, env=settings)
        finally:
            os.sched_setaffinity(0, every)
        try:
            ended = _wait(process, said.fileno(), limit)
        finally:
            process.kill()
            process.wait()
        said.seek(0), errors.seek(0)
        return said.read().splitlines()[1:], f"{ended}\n{errors.read()[-2000:]}"


def _wait(process: subprocess.Popen, said: int, limit: float) -> str:
    """How a process ended, which must write a line within the limit of the one before it."""
    size, since = 0, time.monotonic()
    while process.poll() is None:
        time.sleep(0.1)
        if os.fstat(said).st_size > size:
            size, since = os.fstat(said).st_size, time.monotonic()
        allowed = limit if size else LIMIT
        if time.monotonic() - since > allowed:
            return f"hung: no answer within {allowed} s"
    return f"crashed: exit status {process.returncode}"


def _run(names: list[str]) -> None:
    print("begun", flush=True)
    for name in names:
        start = time.perf_counter()
        try:
            (PROGRAMS | FAILING)[name]()
            error = ""
        except Exception as failed:
            error = f"{type(failed).__name__}: {failed}"
        seconds = round(time.perf_counter() - start, 1)
        print(json.dumps({"name": name, "seconds": seconds, "error": error}), flush=True)


# === of jax alone


def rows() -> None:
    """Jax issue 39103: the last row of over 16 384 is computed as another one."""
    for kind, count in ((np.float64, 16_385), (np.float32, 32_769)):
        i = jnp.arange(count, dtype=kind)
        x = jnp.stack((i, jnp.zeros_like(i), jnp.zeros_like(i)), axis=1)
        matrix = jnp.eye(3, dtype=kind)
        squares = jax.jit(jax.vmap(lambda row, m=matrix: jnp.sum((m @ row) ** 2)))
        np.testing.assert_array_equal(squares(x), i**2)


def lapack() -> None:
    """Batched calls of LAPACK that do not depend on each other: each waited for a thread (0.10.0)."""
    a = jnp.asarray(np.random.default_rng(0).normal(size=(8, LANES, 4, 4)))
    together = jax.jit(lambda a: [jnp.linalg.qr(part) for part in a])
    for _ in range(4):
        jax.block_until_ready(together(a))


def singular() -> None:
    """Batched singular values in loops beside each other: each waited for the only thread (0.9.1)."""
    a = jnp.asarray(np.random.default_rng(0).normal(size=(8, 8, 8, 8)))
    step = jax.vmap(lambda a: a + linalg.svd(a)[0])
    loop = lambda a: jax.lax.fori_loop(0, 5, lambda _, a: step(a), a)
    jax.block_until_ready(jax.jit(lambda a: [loop(part) for part in a])(a))


def fourier() -> None:
    """Batched Fourier transforms that do not depend on each other: likewise (0.11.1, 0.11.2)."""
    a = jnp.asarray(np.random.default_rng(0).normal(size=(8, 2000, 512))) + 0j
    there_and_back = jax.jit(lambda a: [jnp.fft.ifft(jnp.fft.fft(part)) for part in a])
    for _ in range(4):
        jax.block_until_ready(there_and_back(a))


def fused() -> None:
    """Jax issue 39257: a product of many axes, summed over one, crashes (0.10.2, 0.11.0)."""
    few, many = jnp.ones((10, 4, 6), jnp.float32), jnp.ones((10, 4, 6, 9, 9, 9, 9, 9), jnp.float32)
    total = jax.jit(lambda a, b: jnp.sum(a[..., None, None, None, None, None] * b, axis=2))
    np.testing.assert_array_equal(total(few, many), 6.0)


def loops() -> None:
    """Jax issue 40101: a loop that writes one row copies the whole array at every pass (0.11.1)."""
    row = lambda i, a: jax.lax.dynamic_update_slice(a, 0.5 * a[:1] + i, (i, 0))
    loop = jax.jit(lambda a, passes: jax.lax.fori_loop(0, passes, row, a))

    def seconds(passes: int) -> float:
        start = time.perf_counter()
        jax.block_until_ready(loop(jnp.zeros((200_000, 8)), passes))
        return time.perf_counter() - start

    few, many = (min(seconds(passes) for _ in range(6)) for passes in (40, 4000))
    assert many < 8 * few, f"{few:.2g} s for 40 passes, {many:.2g} s for 4000"


# === of the library


def tables() -> None:
    """Critical speeds of bearings whose tables are level are those of bearings without tables."""
    speeds = jr.critical_speeds(level(False), 2).forward
    np.testing.assert_allclose(jr.critical_speeds(level(True), 2).forward, speeds, 1e-9)


def one_chunk() -> None:
    """A chunk of as many lanes is that of smaller chunks, lane by lane."""
    eccentricity = {"unbalance.eccentricity": np.linspace(1e-4, 2e-3, LANES)}
    run = {"start": jr.Whirl(7e-3, 150.0), "settle": 1, "keep": 1, "steps_per_revolution": 16}
    run["error_sample"] = 0  # lanes by twice the steps are few
    scene = stopped()
    whole, parts = (
        jr.sweep(scene, eccentricity, **run, lanes_per_chunk=size, progress=False)
        for size in (LANES, LANES // 8)
    )
    assert set(whole) == set(parts)
    for name in whole:
        _same(whole[name].values, parts[name].values, name)


def mapped(functions: dict[str, Callable], scene: Callable) -> Callable[[], None]:
    """Functions of a scene, at very many masses of its disc, are those of chunks of them.

    They are one program, whose parts do not depend on each other. That of chunks is compiled without
    optimisation.
    """

    def check() -> None:
        base = scene()
        values = float(base.get(MASS)) * jnp.linspace(0.95, 1.05, LANES)

        @jax.jit
        def one(value: jax.Array) -> dict:
            changed = base.put({MASS: value})
            return {name: function(changed) for name, function in functions.items()}

        whole = jax.device_get(jax.jit(jax.vmap(one))(values))
        chunk = jax.jit(jax.vmap(one), **SIMPLY)
        for first in (0, 16_384 - CHUNK // 2, LANES - CHUNK):
            own = slice(first, first + CHUNK)
            part = jax.device_get(chunk(values[own]))
            for name in functions:
                where = f"{name}, {own}"
                jax.tree.map(lambda w, p: _same(w[own], p, where), whole[name], part[name])  # noqa: B023

    return check


def _same(found: np.ndarray, expected: np.ndarray, where: str) -> None:
    """Equal to rounding, and numbers, most of them."""
    if not np.issubdtype(expected.dtype, np.number):
        np.testing.assert_array_equal(found, expected, where)
        return
    finite = np.isfinite(expected)
    assert finite.any(), f"{where}: no finite number"
    largest = np.max(np.abs(expected[finite]))
    np.testing.assert_allclose(found, expected, 1e-9, 1e-9 * largest, err_msg=where)


def flexible():
    """An elastic shaft of as few coordinates as there may be."""
    return jr.load("limiter-rotor").with_nodes(3).without("limiters")


def tilting():
    """A disc that moves and tilts: two coordinates, of which programs are small."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e5, k12=5e3, k22=4e3),
        jr.Disc(0.5, 10.0, 0.2, 0.1),
        jr.DiscDamping(0.5, 60.0),
        jr.Unbalance(0.5, 10.0, 1e-4),
        spin=jr.ConstantSpeed(50.0),
    )


def stopped():
    """The disc that tilts, between three stops."""
    rotor = tilting()
    return jr.Scene(rotor.shaft, *rotor.effects, *stops(), spin=rotor.spin)


def stops():
    stop = {"gap": 7e-3, "stiffness": 1e5, "damping": 50.0, "friction": 0.1, "rim_radius": 0.1}
    return [jr.Limiter(0.5, angle, **stop) for angle in (0.0, 2.0, 4.0)]


def sprung():
    """A disc on a rigid shaft in springs, whose reactions are determined, between the same stops."""
    bearings = [jr.Support(at, 5e4, 50.0) for at in (0.0, 1.0)]
    disc, heavy = jr.Disc(0.5, 10.0, 0.2, 0.1), jr.Unbalance(0.5, 10.0, 1e-4)
    return jr.Scene(
        jr.RigidShaft(1.0), disc, heavy, *bearings, *stops(), spin=jr.ConstantSpeed(50.0)
    )


def level(tabled: bool) -> jr.Scene:
    """An elastic shaft in bearings of 2e7 N/m and 100 N s/m at all speeds."""
    table = {"speeds": [10.0, 3000.0], "kxx": [2e7] * 2, "kyy": [2e7] * 2}
    damping = {"cxx": [100.0] * 2, "cyy": [100.0] * 2}
    bearing = table | damping if tabled else {"stiffness": 2e7, "damping": 100.0}
    shaft = jr.FlexibleShaft(1.0, 0.05, constraints=(), nodes=5)
    return jr.Scene(
        shaft,
        jr.Disc(0.5, 10.0),
        *(jr.Support(at, **bearing) for at in (0.0, 1.0)),
        spin=jr.ConstantSpeed(100.0),
    )


def unequal():
    """Turning axes of a shaft, and fixed ones of its supports, of two stiffnesses each."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e5, anisotropy=0.2),
        jr.Disc(0.5, 10.0),
        jr.DiscDamping(0.5, 60.0),
        jr.Support(0.5, 2e4, anisotropy=0.2),
        spin=jr.ConstantSpeed(50.0),
    )


def lying():
    """A shaft of two stiffnesses under its weight."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e5, damping=40.0, anisotropy=0.2),
        jr.Disc(0.5, 10.0),
        jr.DiscDamping(0.5, 60.0),
        jr.Gravity(9.81),
        jr.Unbalance(0.5, 10.0, 1e-4),
        spin=jr.ConstantSpeed(50.0),
    )


def damped():
    """A shaft that turns unstable at 250 rad/s."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e5, damping=40.0),
        jr.Disc(0.5, 10.0),
        jr.DiscDamping(0.5, 60.0),
        spin=jr.ConstantSpeed(50.0),
    )


def hardening():
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e5),
        jr.Disc(0.5, 10.0),
        jr.DiscDamping(0.5, 60.0),
        jr.Unbalance(0.5, 10.0, 1e-4),
        jr.CubicSpring(at=0.5, angle=0.0, stiffness=1e9),
        spin=jr.ConstantSpeed(50.0),
    )


def gyroscopic():
    return jr.load("gyroscopic-cantilever")


def balls():
    return jr.load("ball-balancer-light")


def shapes(modes):
    return modes.values, modes.shapes


def corrections(scene):
    """Of two planes, by what both do to three readings."""
    mass = scene.get(MASS)
    influence = jnp.array([[1.0, 0.3], [0.2, 1.0], [0.5, 0.4]]) * mass
    return jr.correction_masses(influence, jnp.array([1.0, 2.0, 3.0 * mass]))


def slope(scene):
    """Of the growth rate in the mass of the disc."""
    return jax.grad(lambda mass: jr.growth_rate(scene.put({MASS: mass})))(scene.get(MASS))


def orbiting(scene):
    found = jr.periodic(scene, jr.Whirl(1e-4), revolutions=1, steps_per_revolution=32, throw=False)
    return found.multipliers


def balanced(scene):
    return jr.harmonic_balance(scene, harmonics=2, throw=False).displacement


def running_up(scene):
    run = jr.run_up(scene.at_speed(60.0), np.linspace(0.0, 0.02, 3), solver=dfx.Tsit5(), substeps=8)
    return run.displacement


MASS = "disc.mass"
TIMES = np.linspace(0.0, 0.02, 3)
BALLS = {"solver": dfx.Tsit5(), "substeps": 4, "at": 0.14}
SPEEDS = (20.0, 120.0)
RUN = {"start": jr.Whirl(7e-3, 150.0), "steps_per_revolution": 32}
FORCE = jr.HarmonicForce(0.7, 3.0, 0.2)

# Name of a program: functions of a scene, and the scene. Of objectives that differ in how they sum up the
# same run or response alone, one is here.
FUNCTIONS: dict[str, tuple[dict[str, Callable], Callable]] = {
    "elastic shaft": (
        {
            "roots": jr.roots,
            "unbalance_response": lambda s: jr.unbalance_response(s, SPEEDS).forward,
            "reduction": lambda s: jr.reduction(s, 0.7).condensed,
        },
        flexible,
    ),
    "linear analysis": (
        {
            "modes": lambda s: shapes(jr.modes(s, 2, 3)),
            "critical_speeds": lambda s: jr.critical_speeds(s, 2).forward,
            "growth_rate": jr.growth_rate,
            "forced_response": lambda s: jr.forced_response(s, SPEEDS, FORCE).forward,
            "steady_state": jr.steady_state,
            "correction_masses": corrections,
            "derivative of growth_rate": slope,
            "objectives.damping_ratio": of.damping_ratio,
            "objectives.unbalance_peak": lambda s: of.unbalance_peak(s, SPEEDS),
        },
        tilting,
    ),
    "two stiffnesses": (
        {
            "axis_speeds": lambda s: tuple(jr.axis_speeds(s)),
            "weight_response": lambda s: jr.weight_response(s, SPEEDS).twice,
            "mass_properties": lambda s: jr.mass_properties(s).tensor,
            "centre_of_mass": jr.centre_of_mass,
            "objectives.critical_gap": of.critical_gap,
            "objectives.anisotropy": lambda s: of.anisotropy(s, SPEEDS),
            "objectives.twice_share": lambda s: of.twice_share(s, SPEEDS),
            "objectives.twice_response": lambda s: of.twice_response(s, SPEEDS),
        },
        lying,
    ),
    "onset of instability": (
        {"objectives.onset_speed": lambda s: of.onset_speed(s, (10.0, 600.0), 8)},
        damped,
    ),
    "floquet_multipliers": (
        {"floquet_multipliers": lambda s: jr.floquet_multipliers(s, 4)},
        unequal,
    ),
    "perturbed_roots": ({"perturbed_roots": lambda s: jr.perturbed_roots(s).values}, gyroscopic),
    "steps with contact": (
        {
            "simulate": lambda s: jr.simulate(s, 1, **RUN).displacement,
            "objectives.reaction_peak": lambda s: of.reaction_peak(s, "limiters.1", 1, **RUN),
        },
        sprung,
    ),
    "run_up": ({"run_up": running_up}, hardening),
    "periodic": ({"periodic": orbiting}, hardening),
    "harmonic_balance": ({"harmonic_balance": balanced}, hardening),
    "ball balancer": (
        {"objectives.balancing_time": lambda s: of.balancing_time(s, TIMES, **BALLS)},
        balls,
    ),
}

PLAIN = {one.__name__: one for one in (rows, lapack, singular, fourier, fused, loops)}
PROGRAMS = PLAIN | {"sweep": one_chunk, "tables": tables}
PROGRAMS |= {name: mapped(*case) for name, case in FUNCTIONS.items()}
FAILING = {
    "sleep": lambda: time.sleep(1e6),
    "leave": lambda: os._exit(3),
}  # of which tests are sure

if __name__ == "__main__":
    garbage.collect_rarely()
    _run(sys.argv[1:])
