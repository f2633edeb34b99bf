"""Branches that begin at bifurcations of others, and normal forms, against scipy and closed forms."""

import dataclasses
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from own_laws import AbstractFreeLaw
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from switched import TURN, Switched
from systems import one_disc
from test_continuation import FINE, Duffing, along_x

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.core.quantities import Scalar, nonnegative, real
from jaxrotor.effects.base import AbstractContact
from jaxrotor.orbits import switching
from jaxrotor.orbits.bifurcations import touches
from jaxrotor.orbits.branch import check_point
from jaxrotor.orbits.normal_forms import PeriodMap


ECCENTRICITY = "unbalance.eccentricity"
BIASED = Duffing(0.2, 0.1, 1.0)


def distance_to(multipliers, values):
    """Largest distance of values from the nearest multiplier."""
    return max(np.abs(np.asarray(multipliers) - value).min() for value in values)


# === flips of a smooth oscillator


@pytest.fixture(scope="module")
def cascade():
    """Branches of 1, 2, 4, 8 and 16 revolutions of the biased resonance, each from a flip of the last.

    The page `docs/tutorials/bifurcation.md` prints the flips.
    """
    spring, weight = jr.CubicSpring(0.5, 0.0, 1.0), jr.Gravity(1.0, angle=0.0)
    options = {"damping": 0.2, "stiffness": 0.1, "speed": 1.0, "eccentricity": 1.1}
    scene = one_disc(spring, weight, **options)
    orbit = jr.periodic(scene, jr.simulate(scene, 60, 128, keep=1), revolutions=1)
    branches = [jr.continue_(orbit, ECCENTRICITY, (1.0, 1.45))]
    for count in (30, 30, 16, 8):
        flip = branches[-1].of("flip")[0]
        branches.append(jr.switch(branches[-1], flip, max_points=count))
    return branches


@pytest.mark.slow
def test_flips_of_a_cascade(cascade):
    """Four doublings by scipy; their distances shrink towards Feigenbaum's 4.669."""
    flips = [branch.of("flip")[0] for branch in cascade]
    for count, (branch, flip) in enumerate(zip(cascade[:4], flips, strict=False)):
        start = along_x(branch.orbit(flip))
        exact = BIASED.critical(start, flip.value, -1.0, 2**count)
        assert flip.value == pytest.approx(exact, rel=1e-7)
        assert branch.orbit(flip).revolutions == 2**count
    steps = np.diff([flip.value for flip in flips])
    ratios = steps[:-1] / steps[1:]
    assert (np.diff(np.abs(ratios - 4.6692)) < 0).all() and abs(ratios[-1] - 4.6692) < 0.3


@pytest.mark.slow
def test_the_doubled_branch_begins_at_the_flip(cascade):
    """Its orbits and multipliers by scipy; a revolution is not a period of them."""
    before, after = cascade[:2]
    flip, second = before.of("flip")[0], after.of("flip")[0]
    assert after.values[0] == flip.value and after.orbit(0).revolutions == 2
    assert after.reasons[0] == (
        f"the flip at {ECCENTRICITY} = {flip.value:.9g}, where orbits of twice the period begin"
    )
    for number in (1, 5, 12):
        start, value = along_x(after.orbit(number)), after.values[number]
        end, derivative = BIASED.back(start, value, 1.0, 2)
        np.testing.assert_allclose(end, start, rtol=0, atol=1e-7)
        assert distance_to(after.multipliers[number], np.linalg.eigvals(derivative)) < 1e-6
        halfway = BIASED.back(start, value, 1.0, 1)[0]
        assert np.abs(halfway - start).max() > 1e-3
    place = np.arange(1, after.values.size)
    np.testing.assert_array_equal(after.stable[1:], place < second.place)
    back = jr.continue_(after.orbit(3), ECCENTRICITY, (1.0, 1.45), direction="down")
    said, value = back.reasons[1].split(" = ")
    assert (
        said == f"it meets the branch of orbits of half the period, at their flip at {ECCENTRICITY}"
    )
    assert float(value) == pytest.approx(flip.value, rel=1e-7)


@pytest.mark.slow
def test_a_long_run_settles_on_the_doubled_branch(cascade):
    """The states after every second revolution of a sweep of one lane are those of the branch."""
    after = cascade[1]
    number = int(after.of("flip")[0].place) // 2
    orbit = after.orbit(number)
    fourth = jr.Exponential(4, located=True)  # the order of the orbit
    motion = jr.simulate(orbit.scene, 400, orbit.steps, keep=2, solver=fourth)
    seen = motion.displacement[:: orbit.steps, 0][:2].real
    own = orbit.displacement[:: orbit.steps, 0][:2].real
    nearest = np.abs(np.subtract.outer(np.asarray(seen), np.asarray(own))).min(axis=1)
    assert abs(seen[1] - seen[0]) > 0.1 and nearest.max() < 1e-6


@pytest.mark.slow
def test_the_other_half_has_the_same_orbits_a_period_later(cascade):
    before, after = cascade[:2]
    flip = before.of("flip")[0]
    other = jr.switch(before, flip, opposite=True, max_points=1, locate=False)
    here = np.array(along_x(after.orbit(0)))
    along = np.array(along_x(after.orbit(1))) - here
    start = np.array(along_x(other.orbit(1)))
    later = BIASED.back(start, other.values[1], 1.0)[0]
    apart = [(state - here) @ along / (along @ along) for state in (start, later)]
    np.testing.assert_allclose(apart, [-1.0, 1.0], atol=0.01)


@pytest.mark.slow
def test_an_orbit_of_the_old_branch_is_not_taken_for_a_new_one(cascade):
    before, after = cascade[:2]
    old = before.unknowns[int(before.of("flip")[0].place)]
    new = after.unknowns[1]
    distance = float(np.linalg.norm(new - after.unknowns[0]))
    assert switching._is_new(before, new, distance)
    assert not switching._is_new(before, old, distance)
    # where neighbours at a great distance are elsewhere, the first orbit is nearer
    wide = jr.switch(before, before.of("flip")[0], step=2.0, max_step=2.0, max_points=1)
    assert np.linalg.norm(wide.unknowns[1] - wide.unknowns[0]) < 0.6
    assert switching._is_new(before, wide.unknowns[1], 1e-2)


@pytest.mark.slow
def test_a_branch_that_was_cut_short_behind_its_flip(cascade):
    before = cascade[0]
    flip = before.of("flip")[0]
    how = {"direction": "up", "max_points": 2, "step": 0.05}
    short = jr.continue_(before.orbit(int(flip.place)), ECCENTRICITY, (1.0, 1.45), **how)
    (last,) = short.of("flip")
    again = jr.switch(short, last, max_points=2, locate=False)
    assert "`max_points` = 2" in short.reasons[1]
    assert again.values[0] == pytest.approx(flip.value, rel=1e-9)
    start = along_x(again.orbit(1))
    halfway, end = (BIASED.back(start, again.values[1], 1.0, n)[0] for n in (1, 2))
    np.testing.assert_allclose(end, start, rtol=0, atol=1e-7)
    assert np.abs(halfway - start).max() > 1e-3
    with pytest.raises(ValueError, match="`point` must be of this `branch`, but is the flip of an"):
        jr.switch(short, flip)


@pytest.mark.slow
def test_refusals(cascade):
    branch, after = cascade[:2]
    flip = branch.of("flip")[0]
    for one, sentence in (
        (branch.of("fold")[0], "must be a flip or branching of `branch.points`.* but is a fold"),
        (dataclasses.replace(flip, kind="grazing"), "where other orbits begin, but is a grazing"),
    ):
        with pytest.raises(ValueError, match=sentence):
            jr.switch(branch, one)
    with pytest.raises(ValueError, match="of which there are normal forms, but is a fold"):
        jr.normal_form(branch, branch.of("fold")[0])
    with pytest.raises(ValueError, match="`branch` must be a result of `jaxrotor.continue_` or"):
        check_point(branch.orbit(0), flip, ("flip",), "")
    with pytest.raises(ValueError, match="`step` must be above"):
        jr.switch(branch, flip, step=1.0)
    unlocated = dataclasses.replace(branch, unlocated=((4, "flip"),))
    with pytest.raises(ValueError, match="The flip between unbalance.* was detected but not loc"):
        check_point(unlocated, (4, "flip"), ("flip",), "")
    exact = dataclasses.replace(branch, tolerance=1e-30)
    with pytest.raises(
        RuntimeError, match="No orbit of twice the period was found beside the flip"
    ):
        jr.switch(exact, flip)


@pytest.mark.slow
def test_picture_of_a_cascade(cascade):
    """Lines of the doubled branches begin at the flips, solid while they are stable."""
    ax = plot.branch(cascade[:2])
    solid = [
        line
        for line in ax.get_lines()
        if line.get_linestyle() == "-" and line.get_marker() == "None"
    ]
    (flip, second), shown = (one.of("flip")[0] for one in cascade[:2]), solid[1]
    right = shown.get_xdata()[np.isfinite(shown.get_ydata())]
    assert right[0] == pytest.approx(1e3 * flip.value) and right[-1] == pytest.approx(
        1e3 * second.value
    )
    assert len(ax.get_legend().get_texts()) == 4  # stable, unstable, fold, flip
    speeds = dataclasses.replace(cascade[0].curve.parameters[0], path="spin.speed")
    other = eqx.tree_at(lambda one: one.curve.parameters, cascade[0], (speeds,))
    with pytest.raises(ValueError, match="have the same parameter, but these have spin.speed, unb"):
        plot.branch([cascade[0], other])
    plt.close("all")


# === normal forms


def differenced(back, state, multiplier=-1.0):
    """The coefficient of a flip by differences of a map of two numbers alone."""
    value = lambda change: back(state + change)
    slope = lambda h, q: 8 * (value(h * q) - value(-h * q)) - value(2 * h * q) + value(-2 * h * q)
    matrix = np.stack([slope(2e-3, q) / 24e-3 for q in np.eye(2)], axis=1)
    pairs = [np.linalg.eig(one) for one in (matrix, matrix.T)]
    q, p = (vectors[:, np.argmin(np.abs(values - multiplier))].real for values, vectors in pairs)
    p = p / (p @ q)

    def coefficient(h):
        square = lambda v: (value(h * v) - 2 * value(0 * v) + value(-h * v)) / h**2
        cube = value(2 * h * q) - 2 * value(h * q) + 2 * value(-h * q) - value(-2 * h * q)
        v = np.linalg.solve(np.eye(2) - matrix, square(q))
        mixed = (square(q + v) - square(q - v)) / 4
        return p @ (cube / (2 * h**3) + 3 * mixed) / 6

    return (4 * coefficient(2e-3) - coefficient(4e-3)) / 3


@pytest.mark.slow
def test_coefficient_of_a_flip(cascade):
    """By scipy's map alone; and the doubled orbits grow as it says, `(mu + 1) w = b w^3`."""
    branch, after = cascade[:2]
    flip = branch.of("flip")[0]
    form = jr.normal_form(branch, flip)
    state = np.array(along_x(branch.orbit(flip)))
    exact = differenced(lambda y: BIASED.back(y, flip.value, 1.0)[0], state)
    assert form.coefficient == pytest.approx(exact, rel=1e-5) and form.error < 1e-4
    assert form.supercritical and str(form).startswith("supercritical flip, coefficient 0.90678")
    near = jr.continue_(branch.orbit(flip), ECCENTRICITY, (1.0, 1.45), step=1e-3, max_points=1)
    outward = near.multipliers[:, 0].real + 1
    outward = outward[np.argmax(near.values)] / (near.values.max() - flip.value)
    w = np.linalg.norm(after.unknowns[1:3, :-1] - after.unknowns[0, :-1], axis=1)
    w *= float(branch.curve.size[0])
    grown = -outward * (after.values[1:3] - flip.value) / w**2
    np.testing.assert_allclose(grown, form.coefficient, rtol=0.02)


@pytest.mark.slow
def test_coefficient_of_a_neimark_sacker_point():
    """Internal damping and an isotropic spring, in closed form.

    Three cubic springs of `k` make `F = -9/8 k |z|^2 z`, so a circular whirl `A exp(i w t)` without
    unbalance has `w^2 = 1 + A^2` for `k = 8/9` and `(c + h) w = h Omega`, stable beyond the onset.
    """
    c, h = 0.06, 0.1
    shaft = jr.MasslessShaft(1.0, 0.5, 1.0, damping=h)
    springs = [jr.CubicSpring(0.5, angle, 8 / 9) for angle in (0, np.pi / 3, 2 * np.pi / 3)]
    parts = jr.Disc(0.5, 1.0), jr.DiscDamping(0.5, c), jr.Unbalance(0.5, 1.0, 1e-3)
    scene = jr.Scene(shaft, *parts, *springs, spin=jr.ConstantSpeed(1.45))
    orbit = jr.periodic(scene, jr.AtRest(), steps_per_revolution=64)
    branch = jr.continue_(orbit, "spin.speed", (1.4, 1.9), direction="up")
    (point,) = branch.points
    form = jr.normal_form(branch, point)
    onset = (1 + c / h) * 1.0
    growth = (1j * h / (2j + c + h)).real  # of the whirl by the speed, at the onset
    square = 2 * onset * (h / (c + h)) ** 2 * (1 + 1 / onset**2) / 2  # of |w| by the speed
    exact = -growth * TURN / onset / square
    assert form.coefficient == pytest.approx(exact, rel=2e-5) and form.supercritical
    third = dataclasses.replace(point, multipliers=np.exp(1j * TURN / 3 * np.array([1, -1])))
    resonant = dataclasses.replace(branch, points=(third,))
    with pytest.raises(RuntimeError, match="is at a 1:3 resonance, where its coefficient does not"):
        jr.normal_form(resonant, third)


@pytest.mark.slow
def test_return_map_of_an_orbit_of_unknown_period():
    """Its derivative beside the orbit, by scipy with an event in the plane across the motion."""
    h, kx, ky = 0.2, 1.0, 1.1
    shaft = jr.MasslessShaft(1.0, 0.5, 0.8, damping=h)
    parts = (
        jr.Disc(0.5, 1.0),
        jr.DiscDamping(0.5, 0.05),
        jr.Support(0.5, kxx=kx - 0.8, kyy=ky - 0.8),
    )
    springs = jr.CubicSpring(0.5, 0.0, 1.0), jr.CubicSpring(0.5, np.pi / 2, 1.0)
    scene = jr.Scene(shaft, *parts, *springs, spin=jr.ConstantSpeed(2.5))
    motion = jr.simulate(scene, 600, 64, start=jr.Whirl(0.8, 1.2), keep=8)
    orbit = jr.periodic(scene, motion, turn=0, steps_per_revolution=512)
    branch = jr.continue_(orbit, "spin.speed", (2.4, 2.6), max_points=1, locate=False)
    point = dataclasses.replace(branch_point(branch), kind="flip")
    found = PeriodMap.of(branch, point)
    speed, size = float(branch.values[1]), float(branch.curve.size[0])
    rate = float(branch.look(point).rate)

    def field(t, y):
        x, u, v, w = y[0], y[1], rate * y[2], rate * y[3]
        fx = -kx * x - x**3 - (0.05 + h) * v - h * speed * u
        fy = -ky * u - u**3 - (0.05 + h) * w + h * speed * x
        return [v, w, fx / rate, fy / rate]

    order = [0, 2, 1, 3]  # x, dx, y, dy of the state
    state, across = found.state[order], found.across[order]
    crossing = lambda t, y: across @ (y / size - state)
    crossing.direction = 1.0
    period = float(branch.period[1])

    def back(y):
        done = solve_ivp(field, (0.0, 1.3 * period), size * y, events=crossing, **FINE)
        late = done.t_events[0] > 0.7 * period
        return done.y_events[0][late][0] / size

    change = 0.05 * np.linalg.svd(across[None])[2][1]
    slopes = []
    for along in np.eye(4):
        ahead, behind = (back(state + change + step * along) for step in (1e-4, -1e-4))
        slopes.append((ahead - behind) / 2e-4)
    exact = np.stack(slopes, axis=1)
    undone = np.argsort(order)
    jacobian = found.jacobian(change[undone])[np.ix_(order, order)]
    plane = np.eye(4) - np.outer(across, across)
    np.testing.assert_allclose(jacobian @ plane, exact @ plane, rtol=0, atol=1e-5)


def branch_point(branch):
    """A point like a bifurcation at the second orbit of a branch."""
    names = ("whirl_rate", "radius_min", "radius_max", "multipliers", "unknowns")
    kept = {name: np.asarray(getattr(branch, name)[1]) for name in names}
    kept["whirl_rate"] = float(kept["whirl_rate"])
    value = float(branch.values[1])
    return jr.BranchPoint(kind="flip", value=value, contact=None, place=1.0, **kept)


# === loss of symmetry


@pytest.fixture(scope="module")
def symmetric():
    """Orbits that half a revolution maps to their mirror images, through both branchings."""
    scene = one_disc(jr.CubicSpring(0.5, 0.0, 1.0), damping=0.2, stiffness=0.1, speed=0.5)
    orbit = jr.periodic(scene, jr.AtRest(), steps_per_revolution=512)
    return jr.continue_(orbit, ECCENTRICITY, (0.05, 6.0))


@pytest.mark.slow
def test_branchings_where_the_orbit_loses_its_symmetry(symmetric):
    """The derivative `D` of half a revolution is 1 there, by scipy."""
    branch, duffing = symmetric, Duffing(0.2, 0.1, 0.0)
    assert [point.kind for point in branch.points] == ["branching", "branching"]

    def residual(unknown):
        *start, eccentricity = unknown
        end, derivative = duffing.back(start, eccentricity, 0.5, 0.5)
        return [*(end + start), np.linalg.det(derivative - np.eye(2))]

    for point in branch.points:
        start = along_x(branch.orbit(point))
        exact = fsolve(residual, [*start, point.value], xtol=1e-13)
        assert np.abs(residual(exact)).max() < 1e-9
        assert point.value == pytest.approx(exact[2], rel=1e-7)
    first, second = (point.place for point in branch.points)
    place = np.arange(branch.values.size)
    np.testing.assert_array_equal(branch.stable, (place < first) | (place > second))


@pytest.mark.slow
def test_orbits_without_the_symmetry(symmetric):
    """By scipy, from one branching to the other; the opposite ones are their mirror images."""
    duffing, (first, second) = Duffing(0.2, 0.1, 0.0), symmetric.points
    one = jr.switch(symmetric, first, max_step=0.1)
    other = jr.switch(symmetric, first, opposite=True, max_step=0.1, max_points=6, locate=False)
    assert not one.points and not one.unlocated and one.stable[1:-1].all()
    assert one.values[0] == first.value
    assert "a branch of orbits of more symmetry, at their branching" in one.reasons[1]
    assert one.values[-1] == pytest.approx(second.value, rel=1e-7)
    for number in (3, len(one.values) // 2):
        start, value = along_x(one.orbit(number)), one.values[number]
        end, derivative = duffing.back(start, value, 0.5)
        np.testing.assert_allclose(end, start, rtol=0, atol=1e-6)
        assert distance_to(one.multipliers[number], np.linalg.eigvals(derivative)) < 1e-6
        halfway = duffing.back(start, value, 0.5, 0.5)[0]
        assert np.abs(halfway + start).max() > 1e-3
    assert other.values[4] == pytest.approx(one.values[4], rel=1e-8)
    here = one.orbit(4)
    mirrored = jr.periodic(here.scene, other.orbit(4), steps_per_revolution=512)
    z, w = (np.asarray(orbit.displacement[:-1, 0]) for orbit in (here, mirrored))
    np.testing.assert_allclose(np.roll(w.real, 256), -z.real, rtol=0, atol=1e-7)


class Quadratic(AbstractContact):
    """Force `F = k x + a x^2` along x, which pushes outwards."""

    kind: ClassVar[str] = "quadratic"
    plural: ClassVar[str] = "quadratics"

    at: Scalar = nonnegative("at [m]")
    stiffness: Scalar = nonnegative("stiffness [N/m]")
    square: Scalar = nonnegative("square [N/m^2]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)

    def law(self):
        return QuadraticLaw(self.stiffness, self.square)


class QuadraticLaw(AbstractFreeLaw):
    """Law of a `Quadratic`."""

    stiffness: Scalar
    square: Scalar

    def __call__(self, displacement, velocity, now):
        x = displacement[0]
        return jnp.stack([self.stiffness * x + self.square * x**2, jnp.zeros(())])


@pytest.mark.slow
def test_a_branch_that_crosses_another_at_an_angle():
    """A rotor at rest, `(k - q) x = a x^2`: beside `x = 0` there is `x = (k - q) / a`."""
    force = Quadratic(0.5, 0.5, 0.4)
    scene = one_disc(force, damping=0.3, stiffness=1.0, speed=1.0, eccentricity=0.0)
    orbit = jr.periodic(scene, jr.AtRest(), revolutions=1, steps_per_revolution=64)
    how = {"direction": "up", "tolerance": 1e-13}
    branch = jr.continue_(orbit, "quadratic.stiffness", (0.1, 1.7), **how)
    (point,) = branch.points
    assert point.kind == "branching" and point.value == pytest.approx(1.0, rel=1e-9)
    ends = []
    for opposite in (False, True):
        crossing = jr.switch(branch, point, opposite=opposite)
        x = [crossing.orbit(number).start.q[0].real for number in (1, 4, -1)]
        exact = (1.0 - crossing.values[[1, 4, -1]]) / 0.4
        np.testing.assert_allclose(x, exact, rtol=1e-7)
        ends.append(crossing.values[-1])
    assert sorted(ends) == pytest.approx([0.1, 1.7], rel=1e-12)


# === contact


@pytest.fixture(scope="module")
def striking():
    """A mass that strikes a stop along x at every revolution, continued in speed both ways."""
    scene = one_disc(jr.Limiter(0.5, 0.0, gap=0.1, stiffness=30.0), speed=1.8, eccentricity=0.12)
    settled = jr.simulate(scene, 300, 400, keep=2)
    orbit = jr.periodic(scene, settled, revolutions=1, steps_per_revolution=400)
    return jr.continue_(orbit, "spin.speed", (0.6, 3.0))


def followed(orbit):
    """State at the end of an orbit over that at its start, and multipliers, by scipy event by event."""
    speed = float(orbit.scene.spin.speed)
    w = np.concatenate([orbit.start.q, orbit.start.velocity / speed])
    y = np.concatenate([w.real, w.imag])
    switched = Switched(orbit.scene)
    end, changes, derivative = switched.followed(y, orbit.revolutions)
    half = switched.run(y, orbit.revolutions // 2)[0] if orbit.revolutions > 1 else None
    return y, end, half, changes, np.linalg.eigvals(derivative)


@pytest.mark.slow
def test_doublings_through_impacts(striking):
    """Twice in a row, with the flips, against integration from event to event."""
    branch, flip = striking, striking.of("flip")[-1]
    for revolutions in (2, 4):
        assert np.abs(followed(branch.orbit(flip))[-1] + 1).min() < 1e-5
        assert jr.normal_form(branch, flip).supercritical
        branch = jr.switch(branch, flip, max_points=16, max_step=0.02)
        flip = branch.of("flip")[0]
        y, end, half, changes, multipliers = followed(branch.orbit(4))
        assert branch.orbit(4).revolutions == revolutions
        assert changes == 2 * touches(branch.look(4))[0][0] == 2 * revolutions
        assert np.abs(end - y).max() < 1e-7 * np.abs(y).max()
        assert np.abs(half - y).max() > 1e-3 * np.abs(y).max()
        assert distance_to(branch.multipliers[4], multipliers) < 1e-6


@pytest.mark.slow
def test_a_flip_close_to_grazing(striking, monkeypatch):
    """Where the map has a kink nearby: other orbits begin, a normal form exists over short distances."""
    grazing, flip = striking.points[0], striking.points[1]
    assert (grazing.kind, flip.kind) == ("grazing", "flip")
    assert 0 < flip.value - grazing.value < 1e-4
    # The first orbits press the stop by a few micrometres, less than steps between events of SciPy see.
    y, end, half, _, _ = followed(jr.switch(striking, flip, max_points=6, locate=False).orbit(4))
    assert np.abs(end - y).max() < 1e-6 * np.abs(y).max()
    assert np.abs(half - y).max() > 1e-3 * np.abs(y).max()
    monkeypatch.setattr("jaxrotor.orbits.normal_forms.DISTANCES", (0.1, 2e-2))
    with pytest.raises(RuntimeError, match="has no normal form: contact changes within 0.02 of"):
        jr.normal_form(striking, flip)
