"""Stability maps and boundaries of the two-stiffness rotor, against its closed-form boundary."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import jaxrotor as jr


def rotor(damping=None, ratio=0.2, **shaft):
    """A rotor of unit mass and stiffness: speeds are p and the damping is delta of the sheet."""
    shaft = jr.MasslessShaft(1.0, 0.5, 1.0, anisotropy=ratio, **shaft)
    on_it = [jr.Disc(0.5, 1.0)] + ([] if damping is None else [jr.DiscDamping(0.5, damping)])
    return jr.Scene(shaft, *on_it, spin=jr.ConstantSpeed(1.0))


def edges(ratio, damping):
    """`(1 - p^2)^2 - mu^2 + delta^2 p^2 = 0`, zero root of the quartic (sheet 2, section 1.6)."""
    squares = np.roots([1.0, damping**2 - 2, 1 - ratio**2])
    return np.sqrt(np.sort(squares.real)) if np.isreal(squares).all() else np.zeros(0)


@pytest.mark.parametrize("damping", [None, 0.05])
def test_boundary_along_the_speed(damping):
    found = jr.stability_boundary(rotor(damping), "spin.speed", np.linspace(0.1, 2.0, 24))
    np.testing.assert_allclose(found.values, edges(0.2, damping or 0.0), rtol=1e-8)
    assert found.lost.tolist() == [True, False]


def test_boundary_along_another_parameter():
    """At p = 0.95 the rotor is unstable from `mu^2 = (1 - p^2)^2 + delta^2 p^2` on."""
    scene = rotor(0.05).replace({"spin.speed": 0.95})
    found = jr.stability_boundary(scene, "shaft.anisotropy", np.linspace(0.0, 0.5, 9))
    expected = np.hypot(1 - 0.95**2, 0.05 * 0.95)
    np.testing.assert_allclose(found.values, [expected], rtol=1e-9)
    assert found.lost.tolist() == [True]
    empty = jr.stability_boundary(scene, "shaft.anisotropy", [0.0, 0.01])
    assert empty.values.size == 0 and empty.lost.size == 0


def test_map_and_its_curves():
    """Every point of the curves is on the closed-form boundary, and the grid agrees with it."""
    speeds, ratios = np.linspace(0.6, 1.4, 33), np.linspace(0.0, 0.5, 21)
    over = {"spin.speed": speeds, "shaft.anisotropy": ratios}
    found = jr.stability_map(rotor(0.05), over)
    assert found.paths == ("spin.speed", "shaft.anisotropy") and found.units == ("rad/s", "1")
    p, mu = np.concatenate(found.boundaries).T
    np.testing.assert_allclose(mu, np.hypot(1 - p**2, 0.05 * p), rtol=1e-8)
    assert len(found.boundaries) == 1 and len(p) > 40
    inside = ratios > np.hypot(1 - speeds**2, 0.05 * speeds)[:, None]
    np.testing.assert_array_equal(found.growth > 0, inside)
    # At p = 1 a real root: lambda^2 + (delta + ..): from the quartic itself.
    quartic = [1, 0.1, 0.05**2 + 4, 4 * 0.05, 0.05**2 - 0.5**2]
    assert found.growth[16, -1] == pytest.approx(np.roots(quartic).real.max(), rel=1e-9)


@pytest.mark.slow
def test_map_of_a_rotor_on_supports_of_two_stiffnesses():
    """At a ratio of zero, where the periodic coefficients are constant, growth is that of the roots."""
    shaft = jr.MasslessShaft(1.0, 0.5, 1.0, anisotropy=0.1, damping=0.02, ends="elastic")
    supports = [jr.Support(x, 2.0, 0.01, anisotropy=0.1) for x in (0.0, 1.0)]
    scene = jr.Scene(
        shaft, jr.Disc(0.5, 1.0), jr.DiscDamping(0.5, 0.02), *supports, spin=jr.ConstantSpeed(1.0)
    )
    speeds = np.array([0.5, 0.7, 0.9, 1.5])
    over = {"spin.speed": speeds, "supports.anisotropy": [0.0, 0.1]}
    found = jr.stability_map(scene, over)
    round_ = jr.Scene(
        shaft,
        jr.Disc(0.5, 1.0),
        jr.DiscDamping(0.5, 0.02),
        *(jr.Support(x, 2.0, 0.01) for x in (0.0, 1.0)),
        spin=jr.ConstantSpeed(1.0),
    )
    for speed, growth in zip(speeds, found.growth[:, 0], strict=True):
        values = np.asarray(jr.roots(round_.replace({"spin.speed": speed})))
        assert growth == pytest.approx(values.real.max(), rel=1e-7, abs=1e-10)


def test_a_map_is_one_compiled_program():
    """One program serves any number of points and curves, and any values."""
    axes = lambda count: {
        "spin.speed": np.linspace(0.6, 1.4, count),
        "shaft.anisotropy": np.linspace(0.0, 0.5, count - 2),
    }
    jr.stability_map(rotor(0.05), axes(5))
    compiled = []

    def listen(event, *_, **__):
        if event == "/jax/core/compile/backend_compile_duration":
            compiled.append(event)

    jax.monitoring.register_event_duration_secs_listener(listen)
    found = jr.stability_map(rotor(0.07), axes(14))
    assert len(found.boundaries[0]) > 10 and not compiled
    jax.jit(lambda x: jnp.sin(x) + 1.7182)(jnp.zeros(11))
    assert compiled  # the list is filled by compilations


def slow(cross, damping=None):
    """Supports drive the rotor; at a ratio close to zero whirl is circular, though coefficients vary."""
    shaft = jr.MasslessShaft(1.0, 0.5, 1.0, anisotropy=0.0, ends="elastic")
    supports = [jr.Support(x, 2.0, cross_stiffness=2 * cross, anisotropy=1e-12) for x in (0.0, 1.0)]
    on_it = [jr.Disc(0.5, 1.0)] + ([] if damping is None else [jr.DiscDamping(0.5, damping)])
    return jr.Scene(shaft, *on_it, *supports, spin=jr.ConstantSpeed(0.02))


def slow_growth(cross, damping=0.0):
    """`m q.. + c q. + k q = 0` of the shaft and two supports `2 (1 - i cross)` in series."""
    ground = 2 * 2.0 * (1 - 1j * cross)
    return np.roots([1.0, damping, ground / (1 + ground)]).real.max()


@pytest.mark.slow
def test_slow_rotors_take_the_steps_they_need():
    """Below 1/30 of the first frequency 32 steps per half revolution do not suffice."""
    assert float(jr.growth_rate(slow(0.4))) == pytest.approx(slow_growth(0.4), rel=1e-6)
    over = {"spin.speed": [0.008, 0.1], "supports.cross_stiffness": [0.6, 0.8]}
    found = jr.stability_map(slow(0.4), over)
    expected = [slow_growth(0.3), slow_growth(0.4)]
    np.testing.assert_allclose(found.growth, [expected] * 2, rtol=1e-5)
    lost = jr.stability_boundary(slow(0.4, 0.03), "supports.cross_stiffness", [0.2, 0.8])
    edge = brentq(lambda cross: slow_growth(cross, 0.03), 0.1, 0.4, xtol=1e-14)
    np.testing.assert_allclose(lost.values, [2 * edge], rtol=1e-6)


@pytest.mark.slow
def test_what_is_too_slow_is_not_taken_for_stable():
    over = {"spin.speed": [1e-4, 0.02, 0.1], "supports.cross_stiffness": [0.4, 0.8]}
    found = jr.stability_map(slow(0.4), over)
    assert np.isnan(found.growth).tolist() == [[True] * 2, [False] * 2, [False] * 2]
    assert np.all(found.growth[1:] > 0) and found.boundaries == ()
    with pytest.raises(
        ValueError, match=r"too low for Floquet multipliers at `spin.speed` = 0.0001; leave such"
    ):
        jr.stability_boundary(slow(0.4), "spin.speed", [1e-4, 0.02])
    with pytest.raises(
        ValueError, match=r"too low for Floquet multipliers at 0.0001 rad/s; search"
    ):
        jr.stability_crossings(slow(0.4), (1e-4, 0.1), 8)
    with pytest.raises(
        ValueError, match=r"too low for Floquet multipliers from 0.0001 to 0.1 rad/s"
    ):
        jr.onset_speed(slow(0.4), (1e-4, 0.1), 8)


@pytest.mark.parametrize(
    ("over", "sentence"),
    [
        ({"spin.speed": [1.0, 2.0]}, "must name two parameters, but names 1"),
        ({"spin.speed": [2.0, 1.0, 3.0], "disc.mass": [1.0, 2.0]}, "values in order"),
        ({"spin.speed": [1.0, 2.0], "disc.mass": [-1.0, 2.0]}, "must not be negative"),
        ({"spin.speed": [1.0, 2.0], "disk.mass": [1.0, 2.0]}, "no parameter"),
    ],
)
def test_refusals(over, sentence):
    with pytest.raises(ValueError, match=sentence):
        jr.stability_map(rotor(0.05), over)
