"""Speeds from none to a hundred times critical, and from 4 to 64 nodes, against finite elements."""

import numpy as np
import pytest
from oracles import Beam
from systems import DENSITY, DIAMETER, DIAMETRAL, LENGTH, MASS, TIME, YOUNG, limiter_rotor

import jaxrotor as jr


CRITICAL = 1.7  # about the first critical speed, over 1 / T*
ECCENTRICITY = 1e-4


def by_elements(speed: float) -> complex:
    """Amplitude at the disc of the rotor without internal damping."""
    scale = np.sqrt(MASS * LENGTH**3 * YOUNG * np.pi * DIAMETER**4 / 64)
    beam = Beam(LENGTH, DIAMETER, YOUNG, DENSITY, elements=120)
    beam.disc(
        LENGTH, MASS, DIAMETRAL, 2 * DIAMETRAL, 2 * scale * 0.0025 / LENGTH**3, 0.1 * scale / LENGTH
    )
    beam.damp(2 * scale * 0.025 / LENGTH**4)
    return beam.response(speed, LENGTH, MASS * ECCENTRICITY, [LENGTH])[0]


@pytest.mark.slow
@pytest.mark.hard("1.5 speeds from 0 to 100 times critical")
def test_forced_motion_at_every_speed(record_property):
    """After its free motions have died out, against Hermite elements."""
    scene = limiter_rotor(eps=ECCENTRICITY / LENGTH, eta_i=None, contact=False, nodes=18)
    worst = 0.0
    for ratio in (1e-3, 0.1, 0.5, 0.99, 1.0, 1.01, 2.0, 10.0, 30.0, 100.0):
        speed = ratio * CRITICAL / TIME
        changed = scene.replace({"spin.speed": speed})
        r = jr.simulate(changed, 20_000, 8, keep=1)
        want = by_elements(speed) * np.exp(1j * np.asarray(r.angle))
        worst = max(worst, abs(np.asarray(r.displacement[:, 0]) - want).max() / abs(want[0]))
    record_property("measured", f"amplitude {worst:.0e} by 18 nodes")
    assert worst < 1e-6


@pytest.mark.slow
@pytest.mark.hard("1.5 100 times critical with internal damping", outcome="flagged")
def test_growth_beyond_the_onset(record_property):
    """Far above the onset of whirl a free rotor grows by its root; in the sweep it is flagged."""
    speed = 100 * CRITICAL / TIME
    scene = limiter_rotor(contact=False, eps=1e-4).replace({"spin.speed": speed})
    root = max(np.asarray(jr.roots(scene)), key=lambda x: x.real)
    assert root.real > 0
    turns = int(20 / root.real * speed / (2 * np.pi))
    r = jr.simulate(scene, 2 * turns, 8, start=jr.Whirl(1e-6), keep=turns)
    z, t = np.asarray(r.displacement[:, 0]), np.asarray(r.time)
    half = slice(len(z) // 2, None)
    rate = np.polyfit(t[half], np.log(abs(z[half])), 1)[0]
    off = abs(rate / root.real - 1)
    ds = jr.sweep(
        scene,
        {"spin.speed": [0.5 / TIME, speed]},
        start=jr.Whirl(1e-3),
        settle=200 * turns,
        keep=1,
        observe=[jr.observe.Radius()],
        steps_per_revolution=16,
    )
    record_property(
        "measured", f"growth {off:.0e}; the lane says {ds.status.attrs['flag_meanings'].split()[1]}"
    )
    assert off < 1e-3
    assert ds.status.values.tolist() == [0, 1]


@pytest.mark.hard("1.6 32 and 64 nodes of the spectral rule", outcome="refused")
@pytest.mark.parametrize("nodes", [32, 64])
def test_more_nodes_than_serve_are_refused(nodes, record_property):
    with pytest.raises(ValueError, match="must be 2 to 24") as raised:
        limiter_rotor(nodes=nodes)
    record_property("measured", str(raised.value))


@pytest.mark.slow
@pytest.mark.hard("1.6 4 to 64 nodes")
def test_from_four_to_sixty_four_nodes(record_property):
    """No root grows, and those of the first bending are of finite elements; 64 cells are of order 2."""
    speed, worst = 0.5 / TIME, {}
    beam = Beam(LENGTH, DIAMETER, YOUNG, DENSITY, elements=120)
    scale = np.sqrt(MASS * LENGTH**3 * YOUNG * np.pi * DIAMETER**4 / 64)
    beam.disc(
        LENGTH, MASS, DIAMETRAL, 2 * DIAMETRAL, 2 * scale * 0.0025 / LENGTH**3, 0.1 * scale / LENGTH
    )
    want = beam.damp(2 * scale * 0.025 / LENGTH**4, 0.01 * TIME).roots(speed, 4)
    for nodes, rule in ((4, "spectral"), (8, "spectral"), (24, "spectral"), (64, "trapezoid")):
        scene = limiter_rotor(contact=False).with_nodes(nodes, rule).replace({"spin.speed": speed})
        values = np.asarray(jr.roots(scene))
        assert values.real.max() < 0
        worst[nodes] = max(abs(values - root).min() / abs(root) for root in want[:2])
    text = ", ".join(f"{e:.0e} by {n}" for n, e in worst.items())
    record_property("measured", f"first roots {text}")
    assert max(worst[4], worst[64]) < 1e-3
    assert max(worst[8], worst[24]) < 1e-6


@pytest.mark.slow
@pytest.mark.hard("1.6 rubs by 4 to 20 nodes")
def test_a_rub_by_many_nodes(record_property):
    """A revolution with impacts: the more nodes, the nearer to those of 20."""
    paths = {}
    for nodes in (4, 12, 20):
        start = jr.Whirl(0.012 * LENGTH, -10 / TIME)
        r = jr.simulate(limiter_rotor(nodes=nodes), 1, 1024, start=start)
        paths[nodes] = np.asarray(r.displacement[:, 0])
        assert np.isfinite(paths[nodes]).all()
    reach = abs(paths[20]).max()
    off = {n: abs(path - paths[20]).max() / reach for n, path in paths.items() if n != 20}
    record_property("measured", ", ".join(f"{e:.0e} by {n}" for n, e in off.items()))
    assert off[12] < off[4] < 0.1
    assert off[12] < 1e-2
