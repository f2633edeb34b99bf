"""Supports with tables of coefficients over speed, against closed forms and SciPy's equations."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from differences import central
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

import jaxrotor as jr
from jaxrotor.analysis.synchronous import PARTS, _sampled


# m z.. + c z. + (a + b Omega^2 - i q Omega) z = 0, exact where its speeds are nodes of the tables
M, A, B, C, Q = 2.0, 8e5, 0.3, 1500.0, 900.0
CRITICAL, ONSET = np.sqrt(A / (M - B)), np.sqrt(A / (M * Q**2 / C**2 - B))
NODES = np.unique([*np.linspace(0.0, 2000.0, 9), CRITICAL, ONSET])
COUPLING = Q * NODES


def mass(stiffness, coupling=COUPLING, speed=1000.0, other=None, **options):
    """A mass in a bearing of tables; with `other` its stiffness along y differs."""
    bearing = jr.Support(
        0.5,
        kxx=stiffness,
        kyy=stiffness if other is None else other,
        kxy=coupling,
        kyx=-coupling,
        cxx=C,
        cyy=C,
        speeds=NODES,
        **options,
    )
    shaft, disc = jr.MasslessShaft(1.0, 0.5, 1e-6), jr.Disc(0.5, M)
    return jr.Scene(shaft, disc, bearing, jr.Unbalance(0.5, M, 1e-4), spin=jr.ConstantSpeed(speed))


def example(b=B, **options):
    return mass(A + b * NODES**2, **options)


@pytest.mark.slow
def test_closed_example():
    np.testing.assert_allclose([CRITICAL, ONSET], [685.994341, 1380.13112], rtol=1e-8)
    expected = [-59.5848019 + 713.345461j, -690.415198 - 713.345461j]
    np.testing.assert_allclose(jr.roots(example()), expected, rtol=1e-8)
    found = jr.critical_speeds(example())
    for speeds in (found.forward, found.backward):
        assert speeds.tolist() == pytest.approx([CRITICAL], rel=1e-12)
    onset = jr.onset_speed(example())
    assert float(onset.speed) == pytest.approx(ONSET, rel=1e-12)
    assert float(onset.whirl_frequency / onset.speed) == pytest.approx(0.6, rel=1e-11)
    assert jr.critical_speeds(example(b=2.5)).speeds.size == 0  # none for b >= m
    boundary = jr.stability_boundary(example(), "spin.speed", [1000.0, 1300.0, 1600.0])
    assert boundary.values.tolist() == pytest.approx([ONSET], rel=1e-9) and boundary.lost.all()


@pytest.mark.slow
@pytest.mark.hard("8.8 critical speeds on bearings with tables: none, or several")
def test_several_critical_speeds_and_their_derivatives():
    """A stiffness that falls and rises meets `m Omega^2` three times; each is a root by SciPy."""
    table = M * NODES**2 * np.where(NODES < 400, 1.3, np.where(NODES < 900, 0.8, 1.2))
    table[0], table[-1] = 4e4, 0.9 * M * NODES[-1] ** 2
    gap = lambda speed: PchipInterpolator(NODES, table)(speed) - M * speed**2
    grid = np.linspace(1.0, 2000.0, 400)
    k = np.flatnonzero(np.diff(np.sign(gap(grid))))
    expected = [brentq(gap, grid[i], grid[i + 1], xtol=1e-12) for i in k]
    assert len(expected) >= 3
    found = jr.critical_speeds(mass(table))
    assert found.forward.tolist() == pytest.approx(expected, rel=1e-11)

    def speeds(table):  # traced axes are not known to be equal, so each speed is there twice
        return jr.critical_speeds(mass(table)).speeds[: 2 * len(expected) : 2]

    changes = np.asarray(jax.jacfwd(speeds)(jnp.asarray(table)))
    one = lambda number, step: PchipInterpolator(NODES, table + step * np.eye(NODES.size)[number])
    for i in range(NODES.size):
        for speed, change in zip(expected, changes, strict=True):
            own = lambda step, i=i: lambda x: one(i, step)(x) - M * x**2
            moved = lambda k, own=own, speed=speed: brentq(
                own(20.0 * k), speed - 9, speed + 9, xtol=1e-13
            )
            assert change[i] == pytest.approx(central(moved, 20.0), rel=1e-5, abs=1e-10)


def own_roots(tables, speed):
    """Roots of `M q.. + C q. + K(Omega) q = 0`, `q = (x, y)`, with tables (3, w) of kxx, kyy and kxy."""
    xx, yy, xy = PchipInterpolator(NODES, tables, axis=1)(speed)
    stiffness = np.array([[xx, xy], [-xy, yy]])
    low = np.concatenate([-stiffness, -C * np.eye(2)], axis=1) / M
    return np.linalg.eigvals(np.concatenate([np.eye(2, 4, 2), low])), stiffness


UNEQUAL = np.stack([A + B * NODES**2, 0.7 * A + 1.5e2 * NODES * np.sin(NODES / 400), COUPLING])


def unequal(speed=1000.0, tables=UNEQUAL, **options):
    return mass(tables[0], tables[2], speed, tables[1], **options)


def test_signs_within_an_interval_are_seen_near_zero():
    """Parabolas that dip below zero within an interval, far above it, and a line through zero."""
    function = lambda x: jnp.stack([(x - 10.5) ** 2 - 0.04, (x - 10.5) ** 2 + 30.0, 4.25 - x])
    points, values = map(np.asarray, _sampled(function, jnp.arange(21.0)))
    assert points.size == values.shape[0] == 20 * PARTS + 1
    np.testing.assert_array_equal(np.sign(values), np.sign(np.asarray(function(points)).T))
    zeros = [points[np.flatnonzero(np.diff(np.sign(column)))] for column in values.T]
    np.testing.assert_allclose(zeros[0], [10.3, 10.7], atol=1 / PARTS)
    assert zeros[1].size == 0 and zeros[2] == pytest.approx(4.25, abs=1 / PARTS)


@pytest.mark.slow
def test_unequal_axes_at_speeds_between_nodes():
    """Roots, growth, Campbell diagram, critical and onset speeds, response, against 2 by 2 matrices."""
    speeds = np.linspace(130.0, 1930.0, 9)
    diagram = jr.campbell(unequal(), speeds)
    response = jr.unbalance_response(unequal(), speeds)
    for k, speed in enumerate(speeds):
        expected, stiffness = own_roots(UNEQUAL, speed)
        for value in np.asarray(diagram.values)[k]:
            assert np.min(np.abs(expected - value)) < 1e-9 * abs(value)
        dynamic = stiffness + 1j * speed * C * np.eye(2) - M * speed**2 * np.eye(2)
        x, y = np.linalg.solve(dynamic, M * 1e-4 * speed**2 * np.array([1, -1j]))
        both = response.forward[k, 0], response.backward[k, 0]
        assert np.array(both) == pytest.approx(
            [(x + 1j * y) / 2, (x - 1j * y).conj() / 2], rel=1e-10
        )
    growth = lambda speed: own_roots(UNEQUAL, speed)[0].real.max()
    assert float(jr.growth_rate(unequal(640.0))) == pytest.approx(growth(640.0), rel=1e-9)
    onset = brentq(growth, 900.0, 1900.0, xtol=1e-11)
    assert float(jr.onset_speed(unequal()).speed) == pytest.approx(onset, rel=1e-10)
    lines = (lambda s, row=row: PchipInterpolator(NODES, row)(s) - M * s**2 for row in UNEQUAL[:2])
    critical = sorted(brentq(line, 300.0, 1900.0, xtol=1e-11) for line in lines)
    found = jr.critical_speeds(unequal())
    assert found.speeds.tolist() == pytest.approx(critical, rel=1e-10)
    assert found.kinds == ["mixed"] * len(critical)


@pytest.mark.long
def test_derivatives_by_a_table_of_unequal_axes():
    """Growth at a speed between nodes, and onset speed, by entries of kxx and kxy."""

    def values(varied):
        tables = jnp.asarray(UNEQUAL).at[jnp.array(rows)].set(varied)
        scene = unequal(1140.0, tables)
        return jnp.stack([jr.growth_rate(scene), jr.onset_speed(scene, (1100.0, 1900.0)).speed])

    rows = (0, 2)

    def own(row, i, step):
        tables = UNEQUAL.copy()
        tables[row, i] += step
        growth = lambda speed: own_roots(tables, speed)[0].real.max()
        return np.array([growth(1140.0), brentq(growth, 900.0, 1900.0, xtol=1e-12)])

    every = np.asarray(jax.jacfwd(values)(UNEQUAL[list(rows)]))
    for row, found in zip(rows, np.moveaxis(every, 1, 0), strict=True):
        for i in range(4, NODES.size):
            step = 1e-4 * UNEQUAL[row, i]
            expected = central(lambda k, i=i, row=row, step=step: own(row, i, k * step), step)
            np.testing.assert_allclose(found[:, i], expected, rtol=1e-5, atol=1e-11)


def test_a_constant_table_is_its_number_and_hold_is_constant_beyond_the_ends():
    scenes = [example(), example(hold=True)]
    own, high = (float(jr.growth_rate(scenes[0].at_speed(x))) for x in (50.0, 2000.0))
    found = [float(jr.growth_rate(scenes[1].at_speed(x))) for x in (-50.0, 2600.0)]
    assert found == pytest.approx([own, high], rel=1e-12)  # the table is that of both senses


def test_coefficients_at_a_speed_are_those_of_the_scene_there():
    """The parts without tables are kept, but for a damping that depends on the stiffness in the tables."""
    modal, plain = jr.ModalDamping([0.02]), jr.Support(0.5, kxx=3e5, kyy=2e5)
    for more in ((plain,), (plain, modal)):
        scene = example()
        scene = jr.Scene(scene.shaft, *scene.effects, *more, spin=scene.spin)
        found = eqx.filter_jit(jr.assemble(scene).blocks_at)(jnp.asarray(1730.0))
        expected = jr.assemble(scene.at_speed(1730.0)).blocks
        assert found.present == expected.present
        for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-13)


@pytest.mark.slow
def test_critical_speeds_beyond_tables_that_are_held():
    """The stiffness is that of the last node: `Omega = sqrt(k / m)`; without `hold` there is none."""
    stiff = np.linspace(0.9, 1.0, NODES.size) * 4 * M * 2000.0**2
    expected = np.sqrt(stiff[-1] / M)
    assert jr.critical_speeds(mass(stiff, hold=True)).forward.tolist() == pytest.approx([expected])
    assert not jr.critical_speeds(mass(stiff)).forward.size


# === a flexible rotor


BEARINGS = {  # station: speeds, and tables of kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy
    0.2: (
        np.array([50.0, 200.0, 400.0, 900.0]),
        1e7 * np.array([[6, 5, 4, 3], [1, 1.5, 6, 25], [-2, -2.5, -6, -25], [4, 4.5, 5, 5]]),
        1e5 * np.array([[2.0, 1.6, 1.2, 1.0], [0] * 4, [0] * 4, [1.5, 1.5, 1.2, 1.0]]),
    ),
    0.8: (
        np.array([0.0, 300.0, 1000.0]),
        1e7 * np.array([[9, 8, 7], [0.5, 1, 3], [-0.7, -1, -3.5], [6, 7, 8]]),
        1e5 * np.array([[1.0, 0.8, 0.7], [0.1, 0.1, 0.0], [0.1, 0.1, 0.0], [0.9, 0.9, 0.9]]),
    ),
}
STEEL = (2.1e11, 7850.0, 2.1e11 / 2.6)


def fan(speed=300.0):
    """An overhung disc on a shaft in two oil films."""
    shaft = jr.FlexibleShaft(1.2, 0.08, constraints=(), shear=True, nodes=7)
    names = [letter + axes for letter in "kc" for axes in ("xx", "xy", "yx", "yy")]
    bearings = [
        jr.Support(at, speeds=nodes, **dict(zip(names, [*spring, *damper], strict=True)))
        for at, (nodes, spring, damper) in BEARINGS.items()
    ]
    disc, heavy = jr.Disc(1.15, 80.0, 2.0, 3.8), jr.Unbalance(1.15, 80.0, 1e-5)
    return jr.Scene(shaft, disc, heavy, *bearings, spin=jr.ConstantSpeed(speed))


class Elements:
    """Finite elements of the fan on one mesh."""

    def __init__(self, longest):
        import fem

        disc = (1.15, 80.0, 2.0, 3.8)
        places = [(at, np.zeros((2, 2))) for at in BEARINGS]
        parts = fem.matrices([fem.Stretch(1.2, 0.08)], [disc], places, STEEL, longest)
        nodes, self.mass, self.gyroscopic, self.stiff = parts
        at = lambda station: 4 * int(np.argmin(np.abs(nodes - station)))
        self.disc = at(1.15)
        self.tables = {
            at(station): [PchipInterpolator(speeds, one, axis=1) for one in tables]
            for station, (speeds, *tables) in BEARINGS.items()
        }

    def at(self, speed):
        """`C` with gyroscopic moments, and `K`, at a speed."""
        damping, stiffness = speed * self.gyroscopic, self.stiff.copy()
        for k, (spring, damper) in self.tables.items():
            own = slice(k, k + 2)
            stiffness[own, own] += spring(speed).reshape(2, 2)
            damping[own, own] += damper(speed).reshape(2, 2)
        return damping, stiffness

    def roots(self, speed):
        damping, stiffness = self.at(speed)
        solved = np.linalg.solve(self.mass, np.concatenate([-stiffness, -damping], axis=1))
        size = len(solved)
        return np.linalg.eigvals(np.concatenate([np.eye(size, 2 * size, size), solved]))

    def response(self, speed):
        damping, stiffness = self.at(speed)
        push = np.zeros(len(stiffness), complex)
        push[self.disc : self.disc + 2] = 80.0 * 1e-5 * speed**2 * np.array([1, -1j])
        x, y = np.linalg.solve(stiffness + 1j * speed * damping - speed**2 * self.mass, push)[
            self.disc : self.disc + 2
        ]
        return np.array([(x + 1j * y) / 2, (x - 1j * y).conj() / 2])

    def critical(self, low, high):
        """Zeros of the eigenvalues of `K(Omega) - Omega^2 (M - i G)`, which is Hermitian."""

        def least(speed):
            stiffness = self.at(speed)[1]
            stiffness = (stiffness + stiffness.T) / 2
            matrix = stiffness - speed**2 * (self.mass - 1j * self.gyroscopic)
            return scipy.linalg.eigvalsh(matrix, subset_by_index=[0, 5])

        grid = np.linspace(low, high, 40)
        values = np.array([least(speed) for speed in grid])
        pairs = np.argwhere((values[:-1] > 0) != (values[1:] > 0))
        zero = lambda k, j: brentq(lambda s: least(s)[j], grid[k], grid[k + 1], xtol=1e-9)
        return np.sort([zero(*pair) for pair in pairs])


def test_modes_that_are_not_resolved_do_not_make_a_damped_rotor_undamped():
    """Springs are symmetric and the bearings damp, so that every motion loses energy."""
    scene = jr.load("compressor").replace({"shaft.nodes": 6})
    values = np.asarray(jr.roots(scene))
    still = np.abs(values.real) <= 1e-9 * np.abs(values)  # the fastest modes, within rounding
    assert still.any() and np.abs(values[still]).min() > 5e5
    assert float(jr.growth_rate(scene)) == pytest.approx(values.real[~still].max(), rel=1e-3)
    assert float(jr.growth_rate(scene)) < 0


@pytest.mark.long
def test_flexible_rotor_is_that_of_finite_elements():
    """Errors of the elements fall with the square of their length, so their limit is extrapolated."""
    coarse, fine = Elements(0.06), Elements(0.03)
    limit = lambda of: (4 * of(fine) - of(coarse)) / 3
    scene = fan()

    def first(mesh):
        roots = mesh.roots(300.0)
        roots = roots[roots.imag > 1]
        return roots[np.argsort(np.abs(roots))][:5]

    found = np.asarray(jr.roots(scene))
    expected = limit(first)
    for root in expected:
        assert np.min(np.abs(found - root)) < 2e-6 * abs(root)
    slow = lambda roots: roots[np.abs(roots) < 3000]  # fast modes have hardly any damping
    diagram = jr.campbell(scene, np.linspace(100.0, 300.0, 3), count=4)
    for value in np.asarray(diagram.values)[-1]:
        assert np.min(np.abs(found - value)) < 1e-8 * abs(value)
    growth = lambda mesh: lambda speed: slow(mesh.roots(speed)).real.max()
    onset = limit(lambda mesh: brentq(growth(mesh), 100.0, 880.0, xtol=1e-7))
    assert float(jr.onset_speed(scene, samples=24).speed) == pytest.approx(onset, rel=1e-5)
    critical = limit(lambda mesh: mesh.critical(51.0, 899.0))
    assert critical.size >= 2
    assert jr.critical_speeds(scene).speeds.tolist() == pytest.approx(critical.tolist(), rel=1e-6)
    response = jr.unbalance_response(scene, [250.0, 700.0], 1.15)
    for k, speed in enumerate((250.0, 700.0)):
        both = np.array([response.forward[k, 0], response.backward[k, 0]])
        np.testing.assert_allclose(both, limit(lambda mesh, s=speed: mesh.response(s)), rtol=1e-5)


# === refusals


BEARING = {"at": 0.5, "kxx": [1e6, 2e6], "speeds": [100.0, 200.0]}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"speeds": None}, "`kxx` is a table of 2 numbers; give their `speeds"),
        ({"kxx": 1e6}, "no coefficient is a table"),
        (
            {"cxx": [1.0, 2.0, 3.0]},
            "`cxx` must have a value at each of the 2 `speeds [rad/s]`, but has 3",
        ),
        ({"kyy": [1e6, 2e6, 3e6]}, "`kyy` must have a value at each of the 2"),
        ({"speeds": [200.0, 100.0]}, "must be ascending"),
        ({"kxx": [1e6], "speeds": [100.0]}, "must be a list of two or more"),
        ({"cxx": [1e3, -2e3]}, "`cxx + cyy [N s/m]` must not be negative, but is -4000"),
        ({"kxx": [1e6, np.nan]}, "must be a list of two or more finite numbers"),
        ({"rotating": True}, "for a support that does not turn"),
    ],
)
def test_refused_in_one_sentence(change, said):
    with pytest.raises(ValueError) as error:
        jr.Support(**(BEARING | change))
    assert said in str(error.value) and str(error.value).endswith(".")


@pytest.mark.parametrize(
    "analysis",
    [
        jr.roots,
        jr.modes,
        jr.growth_rate,
        jr.floquet_multipliers,
        jr.state_space,
        jr.steady_state,
        lambda scene: jr.reduction(scene, 0.5),
        lambda scene: jr.campbell(scene, [100.0, 2500.0]),
        lambda scene: jr.unbalance_response(scene, [2500.0]),
        lambda scene: jr.forced_response(scene, [50.0], jr.HarmonicForce(0.5)),
        lambda scene: jr.onset_speed(scene, (100.0, 2500.0)),
        lambda scene: jr.stability_crossings(scene, (100.0, 2500.0)),
        lambda scene: jr.simulate(scene, 3),
        lambda scene: jr.simulate(scene, times=[0.0, 0.1]),
        pytest.param(
            lambda scene: jr.sweep(scene, {"unbalance.eccentricity": [1e-4]}),
            marks=pytest.mark.slow,
        ),
        lambda scene: jr.sweep(scene, {"spin.speed": [100.0, 2500.0]}),
        lambda scene: jr.harmonic_balance(scene, jr.steady_state(scene.at_speed(0.0))),
    ],
)
@pytest.mark.hard("8.8 a speed beyond tables of coefficients", outcome="refused")
def test_a_speed_outside_of_the_tables_is_refused(analysis):
    said = "tables of the supports are for speeds from 0 to 2000 rad/s, .*at 2500 rad/s; extend"
    with pytest.raises(ValueError, match=said):
        analysis(example(speed=2500.0))


def test_tables_without_a_speed_in_common():
    other = jr.Support(0.5, kxx=[1e6, 2e6], speeds=[2100.0, 2200.0])
    scene = example()
    with pytest.raises(ValueError, match="no speed in common: one begins at 2100"):
        jr.critical_speeds(scene.of_parts(*scene.effects, other))


def test_speeds_along_and_across_are_refused():
    scene = example()
    shaft = jr.MasslessShaft(1.0, 0.5, 1e5, anisotropy=0.1)
    scene = jr.Scene(shaft, *scene.effects, spin=scene.spin)
    with pytest.raises(
        ValueError, match="`axis_speeds` is for constant coefficients, but supports"
    ):
        jr.axis_speeds(scene)


# === scenes


def test_tables_in_text_and_files():
    scene = example(hold=True)
    text = jr.files.dumps(scene)
    assert str(jr.loads(text)) == str(scene) and "hold = true" in text
    assert "speeds=[0, 250, 500, .., 2000] rad/s" in repr(scene)
    bearing = jr.loads(text).of(jr.Support)[0]
    np.testing.assert_array_equal(bearing.kxx, scene.of(jr.Support)[0].kxx)
    assert "deviator" in str(bearing.vanishing)  # both axes have the same table
    changed = scene.replace({"support.kxx": 2e6})
    assert changed.of(jr.Support)[0].vanishing == ("damping cross", "damping deviator")


def test_numbers_leave_no_trace_of_tables():
    from jaxrotor.equations.system import assemble

    scene = example()
    numbers = scene.of(jr.Support)[0].at_speed(1000.0)
    plain = scene.of_parts(*(e for e in scene.effects if e.kind != "support"), numbers)
    assert assemble(plain).tabled is None and assemble(scene).tabled is not None
    expected = np.asarray(jr.roots(plain))
    np.testing.assert_allclose(jr.roots(scene), expected, rtol=1e-14)
