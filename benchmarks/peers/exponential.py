"""The two-stage exponential step by hand: coefficients in numpy, marched by C++ or numba.

    s_i = look_i w + steady(theta + i h) + echo f_0,   w <- exp(h lambda) w + feed (f_0, f_1)

The same arithmetic as `Exponential(2)` in its modal basis, from the same matrices by other code.
"""

import ctypes
import functools
import math
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .rotor import Arrays


FEATURES = Path("/proc/cpuinfo")
# Lanes at a time: a vector of 512 bits, or, where the processor has none, of 256. Of 8 lanes without
# AVX-512 g++ 12 makes single numbers, which take ten times as long.
WIDTH = 8 if FEATURES.exists() and "avx512f" in FEATURES.read_text() else 4
SOURCE = Path(__file__).parent.parent / "floor.cpp"
POINTER = ctypes.POINTER(ctypes.c_double)


class Tableau(NamedTuple):
    """Coefficients of a step, all real, and how a state is written in modes."""

    look: np.ndarray  # (2, 4, 2 m)
    echo: np.ndarray  # (4, 2)
    feed: np.ndarray  # (2 m, 4)
    turn: np.ndarray  # (2 m,)
    stops: np.ndarray  # (k, 6)
    rim: float
    phases: np.ndarray  # (steps + 1, 2)
    vectors: np.ndarray
    inverse: np.ndarray
    steady: np.ndarray  # (2 n,) complex, at the largest eccentricity
    seen: np.ndarray  # (2,) complex, of the steady response

    @classmethod
    def of(cls, arrays: Arrays, steps: int) -> "Tableau":
        n, h = arrays.row.size, 2 * np.pi / steps
        values, vectors = np.linalg.eig(arrays.a)
        inverse, zero = np.linalg.inv(vectors), np.zeros(n)
        gain = np.array([[*arrays.row, *zero], [*zero, *arrays.rate * arrays.row]])
        see, drive = gain @ vectors, inverse @ np.array([*zero, *arrays.column])
        flow, first, second = np.array([_phi(z) for z in h * values]).T
        one, two = h * (first * drive)[:, None], h * (second * drive)[:, None]
        force = np.array([*zero, *arrays.load])
        steady = np.linalg.solve(1j * np.eye(2 * n) - arrays.a, force)
        angles = h * np.arange(steps + 1)
        stop = (arrays.cos, arrays.sin, arrays.gap, arrays.stiffness, arrays.damping)
        return cls(
            np.stack([_real(see), _real(see * flow)]),
            _real(see @ one),
            np.hstack([_real(one - two), _real(two)]),
            np.concatenate([flow.real, flow.imag]),
            np.ascontiguousarray(np.stack([*stop, arrays.friction], axis=1)),
            arrays.rim,
            np.ascontiguousarray(np.stack([np.cos(angles), np.sin(angles)], axis=1)),
            vectors,
            inverse,
            steady,
            gain @ steady,
        )

    def begin(self, start: np.ndarray, shares: np.ndarray):
        """Blocks of lanes (blocks, .., WIDTH): state, and the steady response at cos and at sin."""
        shares = np.concatenate([shares, np.repeat(shares[-1:], -len(shares) % WIDTH)])
        w = self.inverse @ (start[:, None] - self.steady[:, None] * shares)
        cos4 = _parts(self.seen)[:, None] * shares
        sin4 = _parts(1j * self.seen)[:, None] * shares
        return tuple(_blocks(part) for part in (np.concatenate([w.real, w.imag]), cos4, sin4))

    def end(self, state: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Complex `(q, q')` (lanes, 2 n) of blocks at a whole revolution."""
        w = np.moveaxis(state, 1, -1).reshape(-1, state.shape[1])[: len(shares)]
        real, imag = np.split(w, 2, axis=1)
        return (real + 1j * imag) @ self.vectors.T + np.outer(shares, self.steady)


def _phi(z: complex) -> tuple[complex, complex, complex]:
    """`exp`, `phi_1`, `phi_2`: series within the unit circle, else the recurrence."""
    if abs(z) < 1:
        series = lambda k: sum(z**j / math.factorial(j + k) for j in range(20))
        return np.exp(z), series(1), series(2)
    one = (np.exp(z) - 1) / z
    return np.exp(z), one, (one - 1) / z


def _real(z: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.block([[z.real, -z.imag], [z.imag, z.real]]))


def _parts(z: np.ndarray) -> np.ndarray:
    return np.concatenate([z.real, z.imag])


def _blocks(values: np.ndarray) -> np.ndarray:
    """(rows, lanes) -> (blocks, rows, WIDTH), aligned to a vector."""
    rows, lanes = values.shape
    room = np.empty(values.size + WIDTH)
    skip = -room.ctypes.data % (8 * WIDTH) // 8
    blocks = room[skip : skip + values.size].reshape(lanes // WIDTH, rows, WIDTH)
    blocks[...] = np.moveaxis(values.reshape(rows, -1, WIDTH), 0, 1)
    return blocks


# === C++


def compiler() -> str | None:
    """The C++ compiler on the path."""
    names = (os.environ.get("CXX"), "c++", "g++", "clang++")
    return next((found for name in names if name and (found := shutil.which(name))), None)


@functools.cache
def _library(modes: int, stops: int):
    """`floor.cpp` compiled for so many modes and stops."""
    folder = Path(tempfile.mkdtemp(prefix="floor-"))
    flags = ["-O3", "-march=native", "-std=c++17", "-shared", "-fPIC", "-pthread", "-w"]
    sizes = [f"-DMODES={modes}", f"-DSTOPS={stops}", f"-DWIDTH={WIDTH}"]
    command = [str(compiler()), *flags, *sizes, str(SOURCE), "-o", str(folder / "floor.so")]
    subprocess.run(command, check=True)
    library = ctypes.CDLL(str(folder / "floor.so"))
    shutil.rmtree(folder)
    library.march.restype = None
    arrays, whole = [POINTER] * 8, ctypes.c_long
    library.march.argtypes = [*arrays, ctypes.c_double, POINTER, whole, whole, whole, whole]
    return library


def cpp(tableau: Tableau, blocks, revolutions: int, threads: int = 1) -> np.ndarray:
    """States after whole revolutions, in C++."""
    state, cos4, sin4 = blocks
    t = tableau
    library = _library(t.turn.size // 2, len(t.stops))
    turned = _copied(state)
    given = (turned, cos4, sin4, t.look, t.echo, t.feed, t.turn, t.stops)
    pointers = [one.ctypes.data_as(POINTER) for one in given]
    phases, sizes = t.phases.ctypes.data_as(POINTER), (len(state), revolutions, len(t.phases) - 1)
    library.march(*pointers, t.rim, phases, *sizes, threads)
    return turned


def _copied(blocks: np.ndarray) -> np.ndarray:
    """A copy, as well aligned."""
    return _blocks(np.moveaxis(blocks, 1, 0).reshape(blocks.shape[1], -1))
