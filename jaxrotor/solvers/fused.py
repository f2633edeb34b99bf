"""Fused steps: a kernel for a GPU in which the state of a lane stays in registers for a revolution.

    y_(k+1), seen_k = one(parts, y_k, phase_k),   k = 0 .. steps - 1,   in every lane

The step is that of all other lanes, traced for one of them. The kernel carries its operations out number
by number: a number that belongs to a lane is a vector over the lanes of a block, one that all lanes share
is a scalar. So nothing is left of slices, stacks and axes. Triton, by which `jax.experimental.pallas`
compiles a kernel, has no slices, and takes powers of two as sizes alone. See docs/concepts/lanes.md.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import pallas as pl
from jax.experimental.pallas import triton
from jax.extend.core import Jaxpr, Literal, Primitive
from jax.interpreters import partial_eval
from jaxtyping import Array, Float


BLOCK = 128  # lanes of a block: one a thread
WARPS = BLOCK // 32
MOST_OWN = 64  # numbers of a lane's own beside its state: the first cache of an H100 holds these

Numbers = (
    np.ndarray
)  # of objects: scalars, vectors over the lanes of a block, either maybe `Unread`

# Operations on every number by itself, all of which Triton has:
ELEMENTWISE = """
    abs add and atan2 ceil convert_element_type cos cosh div eq exp exp2 expm1 floor ge gt integer_pow
    le log log1p lt max min mul ne neg not or pow rsqrt select_n sign sin sinh sqrt square sub tan tanh xor
"""
ARRANGING = "broadcast_in_dim concatenate reshape rev slice split squeeze transpose"
FOLDING = {
    "reduce_sum": jax.lax.add,
    "reduce_max": jax.lax.max,
    "reduce_min": jax.lax.min,
    "reduce_and": jax.lax.bitwise_and,
    "reduce_or": jax.lax.bitwise_or,
}
CALLS = {  # where the equations of a call are
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "closed_call": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
}


class Unread(NamedTuple):
    """A number in the memory, read anew by every operation that takes it."""

    array: Any  # (size,) of what lanes share, (size, lanes) of what each has
    place: Any

    def read(self) -> Array:
        """The number that all lanes share, or that of each lane."""
        return self.array[self.place] if len(self.array.shape) == 1 else self.array[self.place, :]


class LaneStep(NamedTuple):
    """Equations of `y, seen = one(parts, y, phase)` in one lane, and the arrays of `parts` they use."""

    equations: Jaxpr  # of these arrays, the phase and the state
    arrays: list[Array]  # lanes last

    @classmethod
    def of(cls, one: Callable, parts: Any, y: Array, phase: Array) -> "LaneStep":
        """The step, traced for one lane."""
        leaves, treedef = jax.tree.flatten(parts)
        first = [jax.ShapeDtypeStruct((*leaf.shape[:-1], 1), leaf.dtype) for leaf in (*leaves, y)]
        whole = lambda leaves, phase, y: one(jax.tree.unflatten(treedef, leaves), y, phase)
        traced = jax.make_jaxpr(whole)(first[:-1], phase, first[-1])
        every = [True] * len(traced.jaxpr.outvars)
        keep = [False] * len(leaves) + [True, True]
        equations, used = partial_eval.dce_jaxpr(traced.jaxpr, every, instantiate=keep)
        return cls(equations, [leaf for leaf, own in zip(leaves, used, strict=False) if own])


def on_gpu(
    one: Callable, parts: Any, y: Array, phases: Array, unroll: int
) -> tuple[Array, Array | None]:
    """`scan_lanes` on an NVIDIA GPU; on any other processor `jax.lax.scan` over the same steps.

    A GPU scans, too, where lanes have more than `MOST_OWN` coefficients of their own: to read them at
    every step would take as long as what the kernel saves.
    """
    arrays, constant = eqx.partition(parts, eqx.is_array)
    bound = lambda arrays, y, phase: one(eqx.combine(arrays, constant), y, phase)
    scan = lambda arrays, y, phases: jax.lax.scan(
        functools.partial(bound, arrays), y, phases, unroll=unroll
    )
    used = LaneStep.of(bound, arrays, y, phases[0]).arrays
    if sum(array.size // array.shape[-1] for array in used if array.shape[-1] > 1) > MOST_OWN:
        return scan(arrays, y, phases)
    kernel = functools.partial(scan_lanes, bound)
    return jax.lax.platform_dependent(arrays, y, phases, cuda=kernel, default=scan)


def scan_lanes(
    one: Callable,
    parts: Any,
    y: Float[Array, "m lanes"],
    phases: Float[Array, "steps ..."],
    *,
    interpret: bool = False,
) -> tuple[Float[Array, "m lanes"], Float[Array, "steps s lanes"] | None]:
    """`jax.lax.scan` of `y, seen = one(parts, y, phase)` over phases, in one kernel.

    Args:
        one: the step, written for lanes last; `seen` (s, lanes) or None.
        parts: what the step reads, with lanes last; a last axis of one is shared by all lanes.
        y: states of all lanes.
        phases: what each step reads of its instant, the same for all lanes.
        interpret: whether to interpret the kernel, which any processor can.

    Returns:
        States after the last step, and what each step has seen.

    Raises:
        ValueError: if the step has an operation that the kernel cannot carry out number by number.
    """
    step = LaneStep.of(one, parts, y, phases[0])
    m, lanes = y.shape
    blocks = -(-lanes // BLOCK)
    filled = lambda x: jnp.pad(x, ((0, 0), (0, blocks * BLOCK - lanes)), mode="edge")
    of_lanes = lambda *rows: pl.BlockSpec((*rows, BLOCK), lambda i: (*[0] * len(rows), i))
    given, specs = [phases.ravel()], cast("list[Any]", [pl.no_block_spec])
    for array in step.arrays:
        flat = array.reshape(-1, array.shape[-1])
        shared = flat.shape[1] == 1
        given.append(flat[:, 0] if shared else filled(flat))
        specs.append(pl.no_block_spec if shared else of_lanes(len(flat)))
    seen = [_shape(out)[0] for out in step.equations.outvars[1:]]
    sizes = [(m,), *((len(phases), size) for size in seen)]
    found = pl.pallas_call(
        functools.partial(_kernel, step.equations, len(phases)),
        grid=(blocks,),
        in_specs=[*specs, of_lanes(m)],
        out_specs=[of_lanes(*size) for size in sizes],
        out_shape=[jax.ShapeDtypeStruct((*size, blocks * BLOCK), y.dtype) for size in sizes],
        compiler_params=triton.CompilerParams(num_warps=WARPS),
        interpret=interpret,
        name="revolution",
    )(*given, filled(y))
    y, *seen = (part[..., :lanes] for part in found)
    return y, seen[0] if seen else None


def _kernel(equations: Jaxpr, steps: int, phases: Any, *refs: Any) -> None:
    """All steps of one block of lanes, by references to its arrays in the memory of the GPU."""
    *leaves, phase, state = map(_shape, equations.invars)
    given, (begin, end, *seen) = refs[: len(leaves)], refs[len(leaves) :]
    # Registers hold the state alone: coefficients are read where they are used.
    unread = lambda ref, shape, first: _numbers(
        [Unread(ref, first + k) for k in range(math.prod(shape))], shape
    )

    def step(number: Array, begun: tuple) -> tuple:
        values = [unread(ref, shape, 0) for ref, shape in zip(given, leaves, strict=True)]
        now = unread(phases, phase, number * math.prod(phase))
        y, *readings = evaluate(equations, (), [*values, now, _numbers(begun, state)])
        for ref, reading in zip(seen, readings, strict=True):
            for k, value in enumerate(reading.ravel()):
                ref[number, k, :] = value
        return tuple(y.ravel())

    y = tuple(begin[k, :] for k in range(state[0]))
    y = jax.lax.fori_loop(np.int32(0), np.int32(steps), step, y)
    for k, value in enumerate(y):
        end[k, :] = value


def _shape(variable: Any) -> tuple[int, ...]:
    """Shape of a variable of equations."""
    return variable.aval.shape


def _numbers(values: Any, shape: tuple[int, ...]) -> Numbers:
    """Numbers as an array of objects."""
    found = np.empty(len(values), object)
    for k, value in enumerate(values):
        found[k] = value
    return found.reshape(shape)


def evaluate(equations: Jaxpr, consts: Any, args: list[Numbers]) -> list[Numbers]:
    """Results of equations, every operation on arrays carried out on their numbers."""
    known: dict[Any, Numbers] = {}
    plain = lambda value: _numbers(list(np.asarray(value).ravel()), np.shape(value))
    take = lambda var: plain(var.val) if isinstance(var, Literal) else known[var]
    known.update(zip(equations.constvars, map(plain, consts), strict=True))
    known.update(zip(equations.invars, args, strict=True))
    for equation in equations.eqns:
        found = _carried_out(equation, [take(var) for var in equation.invars])
        known.update(zip(equation.outvars, found, strict=True))
    return [take(var) for var in equations.outvars]


def _carried_out(equation: Any, args: list[Numbers]) -> list[Numbers]:
    """Results of one equation."""
    name, params = equation.primitive.name, equation.params
    shape = _shape(equation.outvars[0])
    if name in CALLS:
        inner = params[CALLS[name]]
        consts = getattr(inner, "consts", ())
        return evaluate(getattr(inner, "jaxpr", inner), consts, args)
    if name == "optimization_barrier":  # is for arrays in memory
        return args
    if name in ELEMENTWISE.split():
        return [_elementwise(equation.primitive, params, args, shape)]
    if name in ARRANGING.split():
        return _arranged(equation.primitive, params, args)
    if name in FOLDING:
        rows = _rows(args[0], params["axes"], ())
        return [_numbers([_folded(FOLDING[name], row) for row in rows[0]], shape)]
    if name == "dot_general":
        return [_product(args, params["dimension_numbers"], shape)]
    raise ValueError(
        f"`fused` cannot take this scene: a step has the operation `{name}`, which is not carried out "
        "number by number; leave `fused` out."
    )


def _elementwise(
    primitive: Primitive, params: dict[str, Any], args: list[Numbers], shape: tuple[int, ...]
) -> Numbers:
    """An operation on every number by itself; one that lanes share becomes that of every lane."""
    found = np.empty(shape, object)
    spread = [np.broadcast_to(arg, shape) for arg in args]
    for place in np.ndindex(shape):
        found[place] = primitive.bind(*_of_all_lanes([arg[place] for arg in spread]), **params)
    return found


def _of_all_lanes(numbers: list[Any]) -> list[Any]:
    """Numbers that are read, those that lanes share as vectors where others belong to a lane."""
    numbers = [one.read() if isinstance(one, Unread) else one for one in numbers]
    wide = max((np.shape(one) for one in numbers), key=len)
    broadcast = lambda one: jax.lax.broadcast_in_dim(one, wide, ())
    return [one if np.shape(one) == wide else broadcast(one) for one in numbers]


def _folded(combine: Callable, numbers: Any) -> Any:
    """Numbers combined one after the other."""
    return functools.reduce(lambda one, other: combine(*_of_all_lanes([one, other])), numbers)


def _arranged(primitive: Primitive, params: dict[str, Any], args: list[Numbers]) -> list[Numbers]:
    """Numbers where an operation that only arranges them puts their places in the list of all."""
    ends = np.cumsum([0, *(arg.size for arg in args)])
    places = [
        np.arange(first, first + arg.size, dtype=np.int32).reshape(arg.shape)
        for first, arg in zip(ends, args, strict=False)
    ]
    with jax.ensure_compile_time_eval():
        found = primitive.bind(*map(jnp.asarray, places), **params)
    every = np.concatenate([arg.ravel() for arg in args])
    parts = found if primitive.multiple_results else [found]
    return [_numbers([every[k] for k in np.ravel(part)], part.shape) for part in parts]


def _rows(numbers: Numbers, last: Any, first: Any) -> Numbers:
    """Numbers as (places along the axes `first`, along the others, along the axes `last`)."""
    others = [axis for axis in range(numbers.ndim) if axis not in (*first, *last)]
    ordered = numbers.transpose([*first, *others, *last])
    sizes = [math.prod(numbers.shape[axis] for axis in axes) for axes in (first, others, last)]
    return ordered.reshape(sizes)


def _product(args: list[Numbers], dimensions: Any, shape: tuple[int, ...]) -> Numbers:
    """Products of the numbers of two arrays, summed over the contracted axes."""
    contracted, batched = dimensions
    pairs = zip(args, contracted, batched, strict=True)
    left, right = (_rows(x, last, first) for x, last, first in pairs)
    times = lambda one, other: jax.lax.mul(*_of_all_lanes([one, other]))
    sum_of = lambda row, other: _folded(jax.lax.add, map(times, row, other))
    found = [
        sum_of(row, other)
        for rows, others in zip(left, right, strict=True)
        for row in rows
        for other in others
    ]
    return _numbers(found, shape)
