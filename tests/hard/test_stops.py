"""Stops of every stiffness, gap, friction and number: against closed forms and SciPy."""

import numpy as np
import pytest
from jeffcott import AT, by_scipy, jeffcott, path, state
from scipy.linalg import expm
from systems import limiter_rotor

import jaxrotor as jr
from jaxrotor import plot


# === stiffness


@pytest.mark.hard("1.4 stops of 10 to 1e9 of the shaft's stiffness")
def test_an_impact_on_a_stop_of_any_stiffness(record_property):
    """`x = x_e + a cos w t + sin w t / w` while it lasts, then off with the speed it came."""
    scene, steps, worst = jeffcott(jr.Limiter(AT, 0.0, 1.0, 10.0)), 512, 0.0
    for kappa in 10.0 ** np.arange(1, 10):
        w = np.sqrt(1 + kappa)  # of shaft and stop
        a = 1 / w**2  # x = 1 at the touch, less that of rest at the stop
        lasts = 2 * np.arctan2(w, 1.0) / w
        t = np.linspace(0, 2 * lasts, steps + 1)
        r = jr.simulate(
            scene.replace({"limiters.stiffness": kappa}),
            *(1, steps),
            start=state(1.0, 1.0),
            period=t[-1],
            solver=jr.Exponential(4),
        )
        inside = 1 - a + a * np.cos(w * t) + np.sin(w * t) / w
        outside = np.cos(t - lasts) - np.sin(t - lasts)
        want = np.where(t < lasts, inside, outside)
        worst = max(worst, abs(path(r)[0] - want).max() / (inside.max() - 1))
    record_property("measured", f"path {worst:.0e} of the depth")
    assert worst < 1e-4


@pytest.mark.slow
@pytest.mark.hard("1.4 stops of 1e8 and 1e9 of the shaft's stiffness, flexible rotor")
def test_a_flexible_rotor_on_rigid_stops(record_property):
    worst = 0.0
    for kappa in (1e8, 1e9):
        scene = limiter_rotor(kappa=kappa, eta_S=0.0, nodes=4)
        begin = jr.simulate(scene.without("limiters"), 1, 64, start=jr.Whirl(7e-3, 800.0))
        outside = np.asarray(begin.displacement[:, 0])
        at = np.argmax(_depth(scene, outside) > -1e-5)  # a sample just short of a stop, or beyond
        q, v = begin.coordinates[max(at - 1, 0)], begin.rates[max(at - 1, 0)]
        r = jr.simulate(scene, 1, 65536, start=jr.Continued(q, v), solver=jr.Exponential(4))
        times = np.asarray(r.time)[::4096]
        want = by_scipy(scene, q, v, times, method="LSODA", tol=1e-10)
        assert (_depth(scene, path(r)[0]) > 0).any()
        worst = max(worst, abs(path(r)[0][::4096] - want).max() / 7e-3)
    record_property("measured", f"path {worst:.0e}, 65536 steps a revolution")
    assert worst < 1e-2  # blows in quick succession, of kinks that a step of order 4 cannot see


@pytest.mark.slow
@pytest.mark.hard("1.4 a stop too stiff for the steps")
def test_automatic_steps_resolve_a_stiff_stop(record_property):
    """64 steps, each 8 times what the stop answers in, are refused; "auto" takes enough."""
    kappa = 1e6
    scene = jeffcott(jr.Limiter(AT, 0.0, 1.0, kappa))
    run = {"start": state(0.99, 0.5), "period": 64 * 8 / np.sqrt(1 + kappa)}
    with pytest.raises(
        RuntimeError,
        match=r"too stiff for the steps, .* take at least (255|256|257) `steps_per_rev",
    ):
        jr.simulate(scene, 1, 64, **run)
    r = jr.simulate(scene, 1, "auto", **run)
    z, v = path(r)
    energy = abs(v) ** 2 + abs(z) ** 2 + kappa * np.maximum(z.real - 1, 0) ** 2
    off = abs(energy[-1] / energy[0] - 1)
    record_property("measured", f"refused; energy by {r.pilots[0].setting} steps {off:.0e}")
    assert r.pilots[0].converged
    assert off < 1e-2


@pytest.mark.slow
@pytest.mark.hard("1.4 a stop too stiff for the steps, in a sweep", outcome="flagged")
@pytest.mark.parametrize(("order", "limit"), [(2, 2.0), (4, 0.5)])
def test_a_sweep_flags_lanes_whose_steps_are_too_long(order, limit, record_property):
    """Released beyond an elastic stop, a mass bounces 30 times: below the limit its energy stays.

    `k h^2 / 2 m` is 0.9 and 6 of the limit; a mass that does not touch is right at any step.
    """
    steps, gap, height = 64, 1.0, 1.5
    kappas = np.array([0.9, 6.0]) * 2 * limit / (2 * np.pi / steps) ** 2
    scene = jeffcott(jr.Limiter(AT, 0.0, gap, 1.0))
    with pytest.warns(jr.FewStepsWarning, match="In 2 of 4 lanes steps are few: `limiter`"):
        ds = jr.sweep(
            scene,
            {"limiters.stiffness": kappas, "start.radius": [0.5, height]},
            start=jr.Whirl(1.0, angle=np.pi),
            observe=[jr.observe.Radius()],
            settle=20,
            keep=5,
            steps_per_revolution=steps,
            period=2 * np.pi,
            solver=jr.Exponential(order),
            error_sample=0,
        )
    names = np.array(ds.status.attrs["flag_meanings"].split())[ds.status.values]
    assert names.tolist() == [["ok", "ok"], ["ok", "steps_too_long_for_a_stop"]]
    free, bounced = ds.radius_max.values.T
    np.testing.assert_allclose(free, 0.5, rtol=1e-9)
    record_property("measured", f"order {order}: height {bounced / height}, flagged the second")
    assert 0.6 * height < bounced[0] < 1.1 * height and bounced[1] > 2 * height


@pytest.mark.slow
@pytest.mark.hard("1.4 a ring of stops too stiff together")
def test_stops_that_press_together_are_hard_together():
    """64 stops around a shaft, each soft enough for the steps, are together 16 times as hard."""
    angles = 2 * np.pi * np.arange(64) / 64
    scene = jeffcott(*[jr.Limiter(AT, a, 0.0, 200.0) for a in angles])
    with pytest.raises(RuntimeError, match="A stop was touched that is too stiff for the steps"):
        jr.simulate(scene, 1, 64, start=state(0.5, 0.5j), period=2 * np.pi)
    one = jeffcott(jr.Limiter(AT, 0.0, 0.0, 200.0))
    with pytest.warns(jr.FewStepsWarning, match="`limiter` was touched with 2.3 steps a rebound"):
        jr.simulate(one, 1, 64, start=state(0.5, 0.5j), period=2 * np.pi)


def _depth(scene, z):
    """Into the nearest stop."""
    stops = scene.of(jr.Limiter)
    return np.max([(z * np.exp(-1j * float(s.angle))).real - float(s.gap) for s in stops], axis=0)


# === gaps


@pytest.mark.hard("1.4 a stop that presses the shaft in its centre (negative gap)")
@pytest.mark.parametrize("friction", [0.0, 0.5, 5.0])
def test_one_preloaded_stop_bends_the_shaft(friction, record_property):
    """At rest `k u = -K (u - gap)` along the stop, and across it friction, `k v = -f K (u - gap)`."""
    gap, stop = -2e-3, 30.0
    limiter = jr.Limiter(AT, 0.7, gap, stop, 2.0, friction, rim_radius=0.1)
    scene = jeffcott(limiter, jr.DiscDamping(AT, 1.0), speed=20.0)
    r = jr.simulate(scene, 200, 64, keep=1)
    u = stop * gap / (1 + stop)
    want = (u - 1j * friction * stop * (u - gap)) * np.exp(0.7j)
    error = abs(path(r)[0] - want).max() / abs(want)
    record_property("measured", f"balance of forces {error:.0e}")
    assert error < 1e-10
    touching = np.asarray(r.contact_force)[-1, 0]
    assert touching == pytest.approx(complex(want), rel=1e-9)  # the shaft's force, k = 1


@pytest.mark.slow
@pytest.mark.hard("1.4 one to 64 preloaded stops")
@pytest.mark.parametrize("count", [1, 64])
def test_preloaded_stops_are_springs(count, record_property):
    """While all press, `z.. + z = -Sum_j K (Re(z e_j*) - gap) e_j + unbalance`: a matrix exponential."""
    speed, stop, gap = 3.0, 5.0 / count, -1.0
    angles = 0.3 + 2 * np.pi * np.arange(count) / count
    stops = [jr.Limiter(AT, a, gap, stop) for a in angles]
    scene = jeffcott(*stops, jr.Unbalance(AT, 1.0, 0.02), speed=speed)
    out = np.stack([np.cos(angles), np.sin(angles)])
    # (x, y, x., y., 1, cos, sin): all of it linear
    a = np.zeros((7, 7))
    a[:2, 2:4] = np.eye(2)
    a[2:4, :2] = -np.eye(2) - stop * out @ out.T
    a[2:4, 4] = stop * gap * out.sum(1)
    a[2:4, 5:] = 0.02 * speed**2 * np.eye(2)
    a[5:, 5:] = speed * np.array([[0, -1], [1, 0]])
    rest = np.linalg.solve(a[2:4, :2], -a[2:4, 4])
    y = np.array([*(rest + [0.03, 0.02]), 0.04, 0.0, 1.0, 1.0, 0.0])
    r = jr.simulate(
        scene, 2, 512, start=state(y[0] + 1j * y[1], y[2] + 1j * y[3]), solver=jr.Exponential(4)
    )
    z = path(r)[0]
    assert (np.real(z[:, None] * np.exp(-1j * angles)) > gap).all()  # every stop all the time
    want = np.array([(expm(a * t) @ y)[:2] for t in np.asarray(r.time)[::64]])
    error = abs(z[::64] - want @ [1, 1j]).max()
    record_property("measured", f"path {error:.0e} of 1, 512 steps a revolution")
    assert error < 1e-8


@pytest.mark.slow
@pytest.mark.hard("1.4 gaps from preload over none to wide, files, sweep, plots")
def test_a_sweep_through_zero_gap(tmp_path, record_property):
    """Three stops, passive and preloaded: stiffness `1 + 3 K / 2`; wide open: 1. Files keep the sign."""
    stops = [jr.Limiter(AT, a, -0.5, 4.0) for a in np.pi / 3 * np.array([1, 3, 5])]
    scene = jeffcott(*stops, jr.DiscDamping(AT, 0.4), jr.Unbalance(AT, 1.0, 0.01), speed=1.5)
    jr.save(scene, tmp_path / "preload.toml")
    scene = jr.load(tmp_path / "preload.toml")
    assert np.asarray(scene.get("limiters.gap")).tolist() == [-0.5] * 3
    ds = jr.sweep(
        scene,
        {"limiters.gap": [-0.5, -0.1, 0.0, 0.01, 0.5]},
        observe=[jr.observe.Radius(), jr.observe.Contact()],
        settle=60,
        keep=5,
        steps_per_revolution=256,
        solver=jr.Exponential(4),
        error_sample=0,
    )
    assert (ds.status == 0).all()
    radius = lambda k: 0.01 * 1.5**2 / abs(k - 1.5**2 + 0.4j * 1.5)
    want = [radius(7.0), radius(7.0), None, None, radius(1.0)]
    errors = [abs(float(ds.radius_max[i]) / want[i] - 1) for i in (0, 1, 4)]
    record_property("measured", f"radius {max(errors):.0e}")
    assert max(errors) < 1e-7
    assert ds.duty[:2].values.min() == 1.0
    assert np.isfinite(ds.radius_max).all()
    r = jr.simulate(scene, 2, 64, start=jr.Whirl(0.02))
    axes = plot.orbit(r)
    assert axes.lines


# === friction


@pytest.mark.slow
@pytest.mark.hard("1.4 friction of 0 to 5")
def test_friction_from_none_to_five(record_property):
    """A rub on a round of four stops, thrown backwards by friction until it rolls, and SciPy."""
    angles = np.arange(4) * np.pi / 2
    stops = [jr.Limiter(AT, a, 0.2, 50.0, rim_radius=1.0, slip=1.0) for a in angles]
    scene = jeffcott(*stops, jr.DiscDamping(AT, 0.3), speed=3.0)
    worst = 0.0
    for friction in (0.0, 0.1, 0.5, 1.0, 2.0, 5.0):
        changed = scene.replace({"limiters.friction": friction})
        r = jr.simulate(changed, 1, 8192, start=state(0.19, 0.5 + 0.3j), solver=jr.Exponential(4))
        times = np.asarray(r.time)[::512]
        want = by_scipy(changed, [0.19], [0.5 + 0.3j], times, method="LSODA", tol=1e-10)
        worst = max(worst, abs(path(r)[0][::512] - want).max() / abs(want).max())
    record_property("measured", f"path {worst:.0e} after a revolution")
    assert worst < 1e-4


# === many stops


def _ring(z: complex, gap: float, stiffness: float, friction: float) -> complex:
    """A ring of stiffness spread evenly round: `-K / 2pi Int (r cos p - gap)+ e^ip dp (1 + i f)`."""
    r = abs(z)
    if r <= gap:
        return 0j
    a = np.arccos(gap / r)
    normal = stiffness / (2 * np.pi) * (r * (a + np.sin(a) * np.cos(a)) - 2 * gap * np.sin(a))
    return -normal * (1 + 1j * friction) * z / r


@pytest.mark.slow
@pytest.mark.hard("1.4 many stops approach a continuum of stops")
def test_many_stops_become_a_ring(record_property):
    """Stiffness, friction and gap of a ring, shared among 8 and 64 flat stops: of second order."""
    gap, stiffness, friction = 0.2, 400.0, 0.2
    speed, q, v = 2.0, [0.15 + 0.05j], [0.3 + 0.45j]
    turn = lambda z, v: _ring(z, gap, stiffness, friction)
    errors, counts = [], (8, 64)
    for count in counts:
        angles = 0.1 + 2 * np.pi * np.arange(count) / count
        stops = [
            jr.Limiter(AT, a, gap, stiffness / count, friction=friction, rim_radius=1.0)
            for a in angles
        ]
        scene = jeffcott(*stops, jr.DiscDamping(AT, 0.2), speed=speed)
        r = jr.simulate(scene, 2, 2048, start=state(q[0], v[0]), solver=jr.Exponential(4))
        want = by_scipy(scene, q, v, np.asarray(r.time)[::64], turn)
        errors.append(abs(path(r)[0][::64] - want).max() / gap)
    assert abs(want).max() > 1.05 * gap  # it does rub
    order = np.log(errors[0] / errors[1]) / np.log(counts[1] / counts[0])
    record_property(
        "measured", f"{errors[0]:.0e} by 8 to {errors[-1]:.0e} by 64, order {order:.1f}"
    )
    assert errors[-1] < 2e-3
    assert order > 1.5


@pytest.mark.slow
@pytest.mark.hard("1.4 a closed round of stops without a gap is a spring")
def test_a_round_of_stops_without_gap(record_property):
    """Of two opposite stops one presses: an even number of them is a spring of `K count / 4`."""
    angles = 2 * np.pi * np.arange(64) / 64
    scene = jeffcott(*[jr.Limiter(AT, a, 0.0, 12.0 / 64) for a in angles])
    r = jr.simulate(
        scene, 3, 512, period=np.pi, start=state(0.3, 0.4 + 0.5j), solver=jr.Exponential(4)
    )
    t = 2 * np.asarray(r.time)  # frequency sqrt(1 + 3)
    off = abs(path(r)[0] - 0.3 * np.cos(t) - (0.4 + 0.5j) / 2 * np.sin(t)).max()
    record_property("measured", f"path {off:.0e} by 64")
    assert off < 1e-4
