"""The slowest roots by a Krylov space, against all roots by SciPy, and where the space does not do."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import block_diag, eig, qr

import jaxrotor as jr
from jaxrotor.equations.pencil import Pencil, eigenvalues, eigenvectors, moving_eigenvalues
from jaxrotor.equations.slowest import WORTH, _checked, _dimension


COUNT = 5


def matrices(kind: str, sizes: int = 70, seed: int = 0):
    """Inertia, damping and stiffness of modes whose frequencies grow like those of a beam.

    Equations are divided by the stiffness, as those of a flexible shaft are.
    """
    draw = np.random.default_rng(seed)
    frequencies = 30.0 * (1 + np.arange(sizes)) ** 2
    basis = qr(draw.standard_normal((sizes, sizes)))[0]
    stiffness = basis @ np.diag(frequencies**2) @ basis.T
    point = draw.standard_normal((sizes, 2))
    damping = 40 * point @ np.array([[1.0, 0.6], [-0.6, 1.0]]) @ point.T
    stiffness = stiffness + 500 * point @ np.array([[0.0, 1.0], [-1.0, 0.0]]) @ point.T
    if kind == "complex":
        damping = damping + 25j * np.outer(point[:, 0], point[:, 0])
    divided = lambda block: np.linalg.solve(stiffness, block)
    return divided(np.eye(sizes)), divided(damping), divided(stiffness)


def reference(inertia, damping, stiffness, count):
    """The slowest roots and their vectors, from the inverse of the first-order matrix."""
    m = len(inertia)
    flexible = -np.linalg.solve(stiffness, np.concatenate([damping, inertia], axis=1))
    values, vectors = eig(np.concatenate([flexible, np.eye(m, 2 * m)]))
    order = np.argsort(-np.abs(values))[:count]
    return 1 / values[order], vectors[m:, order].T


def pencil(blocks):
    return Pencil(*map(jnp.asarray, blocks))


def nearest(found, wanted):
    """Index of the found root nearest to each of the wanted ones."""
    return np.abs(np.asarray(found)[:, None] - wanted).argmin(axis=0)


@eqx.filter_jit
def sure(pencil: Pencil, count: int):
    return _checked(pencil.near(pencil.rate), count, False)[1]


@pytest.mark.parametrize("kind", ["real", "complex"])
def test_slowest_roots_and_vectors(kind):
    blocks = matrices(kind)
    assert _dimension(COUNT) < WORTH[kind][1] * 2 * len(blocks[0]) and sure(pencil(blocks), COUNT)
    values, vectors = map(np.asarray, eqx.filter_jit(eigenvectors)(pencil(blocks), COUNT))
    wanted, shapes = reference(*blocks, COUNT)
    near = nearest(values, wanted)
    assert len(set(near)) == COUNT
    np.testing.assert_allclose(values[near], wanted, rtol=1e-10)
    for one, other in zip(vectors[near], shapes, strict=True):
        alike = abs(np.vdot(one, other)) / np.linalg.norm(one) / np.linalg.norm(other)
        assert alike == pytest.approx(1, abs=1e-10)
    np.testing.assert_allclose(
        np.asarray(eqx.filter_jit(eigenvalues)(pencil(blocks), COUNT))[near], wanted, rtol=1e-10
    )


@pytest.mark.parametrize("kind", ["real", "complex"])
def test_changes_of_roots(kind):
    """Left vectors are a series: changes have few digits, but those of the slowest roots have several."""
    blocks = matrices(kind)
    change = 0 * blocks[0], matrices("real", seed=1)[1], 0 * blocks[0]
    found = eqx.filter_jit(moving_eigenvalues)(pencil(blocks), pencil(change), COUNT)
    wanted, _ = reference(*blocks, COUNT)
    near = nearest(found[0], wanted)
    moved = [
        reference(blocks[0], blocks[1] + h * change[1], blocks[2], COUNT + 1)[0]
        for h in (-1e-4, 1e-4)
    ]
    behind, ahead = (one[nearest(one, wanted)] for one in moved)
    np.testing.assert_allclose(np.asarray(found[1])[near], (ahead - behind) / 2e-4, rtol=1e-3)


def test_missing_roots_are_noticed():
    """Eight equal machines have every root eight times, of which a block of two vectors finds two.

    Rounding adds a third and a fourth in time, on some processors, so five are never there.
    """
    blocks = [block_diag(*[one] * 8) for one in matrices("real", sizes=16)]
    assert not sure(pencil(blocks), COUNT)
    values = np.asarray(eqx.filter_jit(eigenvalues)(pencil(blocks), COUNT))
    wanted, _ = reference(*blocks, COUNT)
    np.testing.assert_allclose(np.sort(np.abs(values))[:COUNT], np.abs(wanted), rtol=1e-10)


def test_a_batch_is_a_loop():
    several = [matrices("real", 88, seed) for seed in range(3)]
    several.append(tuple(block_diag(*[one] * 4) for one in matrices("real", sizes=22)))
    batch = [jnp.stack(part) for part in zip(*several, strict=True)]
    found = jax.jit(jax.vmap(lambda *one: eigenvalues(Pencil(*one), COUNT)))(*batch)
    for values, blocks in zip(found, several, strict=True):
        wanted, _ = reference(*blocks, COUNT)
        np.testing.assert_allclose(np.sort(np.abs(values))[:COUNT], np.abs(wanted), rtol=1e-10)


def test_derivatives_of_a_few_roots():
    inertia, damping, stiffness = map(jnp.asarray, matrices("real"))

    @jax.jit
    @jax.value_and_grad
    def slowest(scale):
        values = eigenvalues(Pencil(inertia, scale * damping, stiffness), COUNT)
        return values[jnp.argmin(jnp.abs(values))].real

    value, slope = slowest(1.0)
    behind, ahead = (
        reference(np.asarray(inertia), (1 + h) * np.asarray(damping), np.asarray(stiffness), 2)[0]
        for h in (-1e-5, 1e-5)
    )
    assert value == pytest.approx((ahead[0].real + behind[0].real) / 2, rel=1e-8)
    assert slope == pytest.approx((ahead[0].real - behind[0].real) / 2e-5, rel=1e-6)


@eqx.filter_jit
def few_of(scene):
    own = Pencil.of(jr.assemble(scene))
    return own, eigenvalues(own, COUNT)


@pytest.mark.slow
def test_few_roots_of_a_scene_are_the_first_of_all():
    """Unequal bearings, and a free shaft, whose zero roots are two pairs without own vectors."""
    held = [jr.Support(at, kxx=2e7, kyy=5e7, cxx=3e3, cyy=3e3) for at in (0.1, 0.9)]
    discs = [jr.Disc(at, mass=20.0, diametral=0.2, polar=0.38) for at in (0.3, 0.6)]
    for effects, nodes in ((held, 9), ([], 22)):
        shaft = jr.FlexibleShaft(1.0, 0.05, constraints=(), nodes=nodes)
        scene = jr.Scene(shaft, *discs, *effects, spin=jr.ConstantSpeed(300.0))
        own, few = few_of(scene)
        mass, damping, stiffness = map(np.asarray, (own.inertia, own.damping, own.stiffness))
        one = np.eye(len(mass))
        assert _dimension(COUNT) < WORTH["complex"][0] * 2 * len(mass)  # so the space is used
        every = eig(np.block([[0 * one, one], [-stiffness, -damping]]), block_diag(one, mass))[0]
        few = np.asarray(few)[np.argsort(np.abs(few))][:COUNT]
        close = {"rtol": 1e-9, "atol": 1e-3}
        np.testing.assert_allclose(every[nearest(every, few)], few, **close)
        np.testing.assert_allclose(np.abs(few), np.sort(np.abs(every))[:COUNT], **close)
