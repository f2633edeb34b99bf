"""Casings: bearings that stand on masses beside the shaft, against matrices of the tests' own."""

import diffrax
import equinox as eqx
import fem
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from differences import check_forward
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor import (
    Casing,
    Constraint,
    Disc,
    FlexibleShaft,
    Gravity,
    MasslessShaft,
    RigidShaft,
    Scene,
    Support,
    Unbalance,
)
from jaxrotor.shafts.cased import same_shape


# === one coordinate on a casing

HEAVY, MASS, SPRING, FOUNDATION = 30.0, 12.0, 4e6, 9e6


def stack(*effects, speed=100.0, mass=MASS, damping=None, **options):
    """A disc that moves without tilting, on a bearing, on a casing, on a foundation."""
    return Scene(
        RigidShaft(1.0, (Constraint(0.0, "guide"),)),
        Disc(0.5, HEAVY),
        Casing("pedestal", mass),
        Support(0.5, SPRING, damping, on="pedestal"),
        Support(of="pedestal", stiffness=FOUNDATION, damping=damping, **options),
        *effects,
        spin=jr.ConstantSpeed(speed),
    )


def two_masses(mass=MASS):
    """`m M x^2 - (M (k + k_f) + m k) x + k k_f = 0` of the squared frequencies."""
    middle = HEAVY * (SPRING + FOUNDATION) + mass * SPRING
    return np.sqrt(np.sort(np.roots([mass * HEAVY, -middle, SPRING * FOUNDATION])))


def test_two_masses_in_a_row():
    found = np.asarray(jr.roots(stack()))
    np.testing.assert_allclose(found[found.imag > 0].imag, two_masses(), rtol=1e-12)
    assert jr.assemble(stack()).n == 2
    speeds = np.asarray(jr.critical_speeds(stack()).speeds)  # forward and backward
    np.testing.assert_allclose(speeds, np.repeat(two_masses(), 2), rtol=1e-9)


def test_unbalance_moves_the_casing():
    """`(K - Omega^2 M) q = Omega^2 (u, 0)`, of the disc and, as coordinates, of the casing."""
    u, speed = 1e-4, 250.0
    scene = stack(Unbalance(0.5, moment=u), speed=speed)
    stiffness = np.array([[SPRING, -SPRING], [-SPRING, SPRING + FOUNDATION]])
    dynamic = stiffness - speed**2 * np.diag([HEAVY, MASS])
    expected = np.linalg.solve(dynamic, [speed**2 * u, 0.0])
    np.testing.assert_allclose(jr.steady_state(scene)[0], expected, rtol=1e-12)
    for at, which in ((0.5, 0), ("pedestal", 1)):
        found = jr.unbalance_response(scene, speed, at=at)
        np.testing.assert_allclose(found.forward[0, 0], expected[which], rtol=1e-12)


def test_weight_and_its_reactions():
    """The foundation carries both, the bearing the disc alone."""
    scene = stack(Gravity(9.81), damping=3e3)
    run = jr.simulate(scene, 2, 32, start=jr.Continued(*jr.steady_state(scene)))
    sag = -9.81j * (HEAVY + MASS) / FOUNDATION
    np.testing.assert_allclose(run.of_casing("pedestal"), sag, rtol=1e-9)
    np.testing.assert_allclose(run.displacement[:, 0], sag - 9.81j * HEAVY / SPRING, rtol=1e-9)
    forces = jr.reactions(run)
    assert forces.names[:2] == ("supports.0", "supports.1")
    np.testing.assert_allclose(forces.of("supports.0"), 9.81j * HEAVY, rtol=1e-8)
    np.testing.assert_allclose(forces.of("supports.1"), 9.81j * (HEAVY + MASS), rtol=1e-8)
    np.testing.assert_allclose(forces.static[:2], forces.force[0, :2], rtol=1e-8)


def test_limits_of_a_stiff_foundation_and_of_a_light_casing():
    stiff = stack().replace({"supports.1.stiffness": 1e14})
    slow = np.asarray(jr.roots(stiff, 2)).imag
    np.testing.assert_allclose(np.abs(slow), np.sqrt(SPRING / HEAVY), rtol=1e-6)
    series = 1 / (1 / SPRING + 1 / FOUNDATION)
    light = np.asarray(jr.roots(stack(mass=1e-6), 2)).imag
    np.testing.assert_allclose(np.abs(light), np.sqrt(series / HEAVY), rtol=1e-6)


# === a rigid rotor in unequal housings

RIGID = {"disc": 50.0, "diametral": 2.0, "polar": 3.5, "at": 0.45}
STATIONS, HOUSINGS = (0.1, 0.9), (15.0, 22.0)
FILMS = (np.array([[3e6, 4e5], [-6e5, 5e6]]), np.array([[4e6, -2e5], [3e5, 3e6]]))
LOSSES = (np.diag([900.0, 1500.0]), np.array([[700.0, 50.0], [50.0, 1100.0]]))
PEDESTALS = (np.diag([9e6, 5e6]), np.diag([7e6, 1.2e7]))
LEAKS = (np.diag([300.0, 200.0]), np.diag([150.0, 400.0]))


def housed(*effects, speed=300.0, spin=None):
    parts = [Disc(RIGID["at"], RIGID["disc"], RIGID["diametral"], RIGID["polar"])]
    for k, (at, mass) in enumerate(zip(STATIONS, HOUSINGS, strict=True)):
        parts += [
            Casing(f"housing {k}", mass),
            Support(at, FILMS[k], LOSSES[k], on=f"housing {k}"),
            Support(of=f"housing {k}", stiffness=PEDESTALS[k], damping=LEAKS[k]),
        ]
    spin = jr.ConstantSpeed(speed) if spin is None else spin
    return Scene(RigidShaft(1.0), *parts, *effects, spin=spin)


def of_numpy(speed, masses=HOUSINGS):
    """`M`, `C`, `K` in `(z_0, psi, c_1, c_2)` by x and y, x of all before y of all."""
    at = RIGID["at"]
    row = np.array([1.0, at, 0.0, 0.0])
    tilt = np.array([0.0, 1.0, 0.0, 0.0])
    plane = RIGID["disc"] * np.outer(row, row) + RIGID["diametral"] * np.outer(tilt, tilt)
    plane = plane + np.diag([0.0, 0.0, *masses])
    mass = np.kron(np.eye(2), plane)
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])  # -i Omega I_p psi.: x gets + y., y gets - x.
    damping = speed * RIGID["polar"] * np.kron(turn, np.outer(tilt, tilt))
    stiffness = np.zeros((8, 8))
    for k, station in enumerate(STATIONS):
        alone = np.eye(4)[2 + k]
        relative = np.array([1.0, station, 0.0, 0.0]) - alone
        for block, film, ground in (
            (stiffness, FILMS[k], PEDESTALS[k]),
            (damping, LOSSES[k], LEAKS[k]),
        ):
            block += np.kron(film, np.outer(relative, relative))
            block += np.kron(ground, np.outer(alone, alone))
    return mass, damping, stiffness


def state_matrix(mass, damping, stiffness):
    size = len(mass)
    low = -np.linalg.solve(mass, np.concatenate([stiffness, damping], axis=1))
    return np.concatenate([np.eye(size, 2 * size, size), low])


@pytest.mark.parametrize("speed", [0.0, 300.0, -300.0])
def test_roots_in_unequal_housings(speed):
    found = np.sort_complex(np.asarray(jr.roots(housed(speed=speed))))
    expected = np.sort_complex(np.linalg.eigvals(state_matrix(*of_numpy(speed))))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


UNBALANCE = Unbalance(0.3, moment=2e-3, phase=0.4)


def forces_of(speed):
    """Complex force of the unbalance in the equations of numpy, of `exp(i speed t)` in x and y."""
    row = np.array([1.0, 0.3, 0.0, 0.0])
    size = speed**2 * 2e-3 * np.exp(0.4j)
    return np.concatenate([size * row, -1j * size * row])


def test_unbalance_in_unequal_housings():
    """Ellipses: `x + i y` of the real part of `a exp(i Omega t)` in x and y."""
    speed = 300.0
    mass, damping, stiffness = of_numpy(speed)
    dynamic = stiffness + 1j * speed * damping - speed**2 * mass
    x, y = np.split(np.linalg.solve(dynamic, forces_of(speed)), 2)
    ahead, behind = (x + 1j * y) / 2, (x.conj() + 1j * y.conj()) / 2
    rows = {0.1: np.array([1.0, 0.1, 0.0, 0.0]), "housing 1": np.eye(4)[3]}
    found = jr.unbalance_response(housed(UNBALANCE), [speed], at=list(rows))
    for k, row in enumerate(rows.values()):
        np.testing.assert_allclose(found.forward[0, k], row @ ahead, rtol=1e-9)
        np.testing.assert_allclose(found.backward[0, k], row @ behind, rtol=1e-9)


def motion_of_scipy(times, speed, angle, masses=HOUSINGS):
    """Motion from rest at times, `(T, 4)` complex; `angle` gives angle, speed and acceleration."""
    mass, still, stiffness = of_numpy(0.0, masses)
    turning, inverse = of_numpy(1.0, masses)[1] - still, np.linalg.inv(mass)
    row = np.array([1.0, 0.3, 0.0, 0.0])

    def rates(time, state):
        theta, omega, change = angle(time)
        force = (omega**2 - 1j * change) * 2e-3 * np.exp(1j * (theta + 0.4)) * row
        push = np.concatenate([force.real, force.imag])
        q, v = state[:8], state[8:]
        return np.concatenate([v, inverse @ (push - (still + omega * turning) @ v - stiffness @ q)])

    done = solve_ivp(
        rates, (0.0, times[-1]), np.zeros(16), "DOP853", t_eval=times, rtol=1e-11, atol=1e-15
    )
    x, y = np.split(done.y[:8].T, 2, axis=1)
    return x + 1j * y


@pytest.mark.slow
def test_motion_by_revolutions_is_that_of_scipy():
    run = jr.simulate(housed(UNBALANCE), 4, 64, at=0.9)
    expected = motion_of_scipy(np.asarray(run.time), 300.0, lambda t: (300.0 * t, 300.0, 0.0))
    size = np.abs(expected).max()
    np.testing.assert_allclose(run.coordinates, expected, atol=2e-9 * size)
    np.testing.assert_array_equal(run.of_casing("housing 1"), run.coordinates[:, 3])
    again = jr.simulate(housed(UNBALANCE), 2, 64, at=0.9)
    carried = jr.simulate(housed(UNBALANCE), 2, 64, at=0.9, start=again.end)
    np.testing.assert_allclose(carried.coordinates[-1], run.coordinates[-1], atol=1e-12 * size)


@pytest.mark.long
def test_run_up_is_that_of_scipy():
    spin = jr.SpeedProfile([0.0, 1.0], [100.0, 400.0])
    times = np.linspace(0.0, 0.3, 61)
    exact = diffrax.PIDController(rtol=1e-10, atol=1e-14)
    how = {"controller": exact, "solver": diffrax.Dopri8()}
    run = jr.run_up(housed(UNBALANCE, spin=spin), times, at=0.9, **how)
    profile = lambda t: (100.0 * t + 150.0 * t**2, 100.0 + 300.0 * t, 300.0)
    expected = motion_of_scipy(times, None, profile)
    size = np.abs(expected).max()
    np.testing.assert_allclose(run.of_casing("housing 0"), expected[:, 2], atol=1e-7 * size)
    np.testing.assert_allclose(run.coordinates, expected, atol=1e-7 * size)


# === flexible shafts

LENGTH, DIAMETER = 1.2, 0.06
YOUNG, DENSITY, SHEAR = 2.1e11, 7850.0, 8.1e10
STEEL = jr.Material(YOUNG, DENSITY, SHEAR)
WHEEL = (0.5, 40.0, 0.5, 0.9)
ENDS = (0.0, LENGTH)
BEARING, BASE = np.array([[6e7, 3e6], [-2e6, 4e7]]), np.diag([1.5e8, 8e7])


def on_frame(*effects, speed=0.0, mass=80.0, shear=True, **shaft):
    """A flexible shaft whose two bearings stand on one frame."""
    line = FlexibleShaft(
        LENGTH, DIAMETER, STEEL, **({"nodes": 10, "constraints": (), "shear": shear} | shaft)
    )
    parts = [Support(at, BEARING, on="frame") for at in ENDS]
    parts += [Casing("frame", mass), Support(of="frame", stiffness=BASE), Disc(*WHEEL)]
    return Scene(line, *parts, *effects, spin=jr.ConstantSpeed(speed))


def elements_on_frame(pieces, mass=80.0):
    """Nodes, `M`, `G`, `K` of finite elements with the frame's x and y as two further coordinates."""
    material, stretch = (YOUNG, DENSITY, SHEAR), [fem.Stretch(LENGTH, DIAMETER)]
    nodes, *blocks = fem.matrices(stretch, [WHEEL], [], material, LENGTH / pieces)
    own, gyroscopic, stiffness = (np.pad(block, (0, 2)) for block in blocks)
    frame = [len(own) - 2, len(own) - 1]
    own[frame, frame] = mass
    for node in (0, len(nodes) - 1):
        both = np.array([4 * node, 4 * node + 1, *frame])
        relative = np.array([[1, 0, -1, 0], [0, 1, 0, -1]])
        stiffness[np.ix_(both, both)] += relative.T @ BEARING @ relative
    stiffness[np.ix_(frame, frame)] += BASE
    return nodes, own, gyroscopic, stiffness


def extrapolated(answer):
    """Limit of fine elements, whose error goes with the square of their length."""
    coarse, fine = (answer(*elements_on_frame(pieces)) for pieces in (24, 48))
    return (4 * fine - coarse) / 3


@pytest.mark.slow
def test_flexible_shaft_on_one_frame():
    speed = 600.0

    def slowest(_, mass, gyroscopic, stiffness):
        found = scipy.linalg.eigvals(state_matrix(mass, speed * gyroscopic, stiffness))
        found = found[found.imag > 1.0]
        return found[np.argsort(np.abs(found))][:7]

    found = np.asarray(jr.roots(on_frame(speed=speed), 24))
    found = found[found.imag > 1.0][:7]
    np.testing.assert_allclose(found, extrapolated(slowest), rtol=2e-6, atol=1e-3)


@pytest.mark.slow
def test_response_of_a_flexible_shaft_on_one_frame():
    speed = 420.0

    def answer(nodes, mass, gyroscopic, stiffness):
        wheel = 4 * int(np.argmin(np.abs(nodes - WHEEL[0])))
        force = np.zeros(len(mass), complex)
        force[wheel], force[wheel + 1] = speed**2 * 1e-3, -1j * speed**2 * 1e-3
        dynamic = stiffness + 1j * speed**2 * gyroscopic - speed**2 * mass
        q = np.linalg.solve(dynamic, force)
        at = lambda k: (q[k] + 1j * q[k + 1]) / 2
        return np.array([at(wheel), at(len(mass) - 2)])

    scene = on_frame(Unbalance(WHEEL[0], moment=1e-3))
    found = jr.unbalance_response(scene, [speed], at=[WHEEL[0], "frame"])
    np.testing.assert_allclose(found.forward[0], extrapolated(answer), rtol=3e-6)


SHAFTS = {  # that of `test_flexible_shaft_on_one_frame` bends and shears
    "pinned": {"shear": False, "constraints": (Constraint(0.6, "pin"),), "anisotropy": 0.05},
    "trapezoid": {"shear": False, "rule": "trapezoid", "nodes": 8},
}


@pytest.mark.long
@pytest.mark.parametrize("name", SHAFTS)
def test_stiff_foundation_is_the_ground(name):
    """A casing of 1 kg on 1e15 N/m: its own root is far, the others are those without it."""
    options = {"nodes": 6, "constraints": ()} | SHAFTS[name]
    line = FlexibleShaft(LENGTH, DIAMETER, STEEL, **options)
    build = lambda *parts, **on: Scene(
        line,
        *(Support(at, 5e7, **on) for at in ENDS),
        Disc(*WHEEL),
        *parts,
        spin=jr.ConstantSpeed(200.0),
    )
    rock = Casing("rock", 1.0), Support(of="rock", stiffness=1e15)
    found, expected = (
        np.sort(np.asarray(jr.roots(scene, 6)).imag) for scene in (build(*rock, on="rock"), build())
    )
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.slow
def test_massless_shaft_on_a_casing():
    """The ends have no mass: shaft and bearings are in series, on the casing; in time, too."""
    shaft = MasslessShaft(1.0, 0.5, 8e6, ends="elastic")
    bearings = [Support(at, 4e6, on="pedestal") for at in (0.0, 1.0)]
    foundation = Support(of="pedestal", stiffness=FOUNDATION)
    scene = Scene(
        shaft,
        Disc(0.5, HEAVY),
        bearings,
        foundation,
        Casing("pedestal", MASS),
        spin=jr.ConstantSpeed(100.0),
    )
    found = np.asarray(jr.roots(scene))
    np.testing.assert_allclose(found[found.imag > 0].imag, two_masses(), rtol=1e-10)  # 8e6 | 8e6
    run = jr.simulate(scene, 2, 32, start=jr.Whirl(1e-3), at=0.5)
    plain = jr.simulate(stack(), 2, 32, start=jr.Whirl(1e-3), at=0.5)
    np.testing.assert_allclose(run.displacement, plain.displacement, atol=1e-11)
    np.testing.assert_allclose(run.of_casing("pedestal"), plain.of_casing("pedestal"), atol=1e-11)


def test_shape_on_more_nodes_keeps_the_casing():
    """The coordinates of a bent shaft and of its frame, as a continued orbit takes them over."""
    line_of = eqx.filter_jit(lambda scene: scene.line())
    few, many = (line_of(on_frame(shear=False, nodes=nodes)) for nodes in (4, 7))
    q = np.append(np.linspace(1.0, 2.0, few.stiffness.shape[0] - 1) * (1 + 0.5j), 3.0 - 1j)
    moved = same_shape(q, few, many)
    assert moved[-1] == pytest.approx(3.0 - 1j, rel=1e-10)
    row_of = eqx.filter_jit(lambda line, at: line.row(at))
    row = lambda line, at: np.asarray(row_of(line, at))
    for at in map(jnp.asarray, (0.2, 1.1)):
        assert row(many, at) @ moved == pytest.approx(row(few, at) @ q, rel=1e-10)


# === other analyses


@pytest.mark.slow
def test_damping_in_proportion_counts_the_casing():
    """`M` and `K` of modal damping are those of both masses: each mode has its ratio."""
    found = np.asarray(jr.roots(stack(jr.ModalDamping([0.02, 0.05]))))
    found = found[found.imag > 0]
    omega = two_masses()
    np.testing.assert_allclose(found.real, -np.array([0.02, 0.05]) * omega, rtol=1e-9)


@pytest.mark.slow
def test_onset_and_map_of_stability():
    """`InternalDamping` of the bearing, c_i at the disc, against eigenvalues of numpy."""
    rotor = lambda speed: stack(Support(0.5, 0.0, 400.0, rotating=True), damping=150.0, speed=speed)

    def growth(speed, mass=MASS):
        stiffness = np.array([[SPRING, -SPRING], [-SPRING, SPRING + FOUNDATION]], complex)
        stiffness[0, 0] -= 1j * speed * 400.0
        damping = np.array([[550.0, -150.0], [-150.0, 300.0]])
        return np.linalg.eigvals(
            state_matrix(np.diag([HEAVY, mass]), damping, stiffness)
        ).real.max()

    onset = float(jr.onset_speed(rotor(100.0)).speed)
    assert abs(growth(onset)) < 1e-6 * onset and growth(1.01 * onset) > 0 > growth(0.99 * onset)
    axes = {"spin.speed": [0.5 * onset, 1.5 * onset], "casing.mass": [5.0, 60.0]}
    found = jr.stability_map(rotor(100.0), axes)
    expected = [
        [growth(speed, mass) for mass in axes["casing.mass"]] for speed in axes["spin.speed"]
    ]
    np.testing.assert_allclose(np.asarray(found.growth), expected, rtol=1e-7, atol=1e-7)
    diagram = jr.campbell(rotor(100.0), [0.0, onset])
    assert np.asarray(diagram.values).shape[0] == 2


@pytest.mark.slow
def test_sweep_over_the_mass_of_a_casing():
    scene = stack(Unbalance(0.5, moment=1e-4), speed=250.0, damping=2e3)
    masses = [8.0, 12.0, 20.0]
    found = jr.sweep(scene, over={"casing.mass": masses}, settle=20, keep=2)
    for k, mass in enumerate(masses):
        steady = jr.unbalance_response(scene.replace({"casing.mass": mass}), 250.0)
        size = float(np.abs(steady.forward[0, 0]))
        assert float(found["radius_max"].isel({"casing.mass": k}).max()) == pytest.approx(
            size, rel=1e-3
        )


# === derivatives


@pytest.mark.slow
def test_derivatives_by_the_mass_of_a_casing():
    """Of a root, of the response of the casing, and of a motion in time."""
    own = jnp.array([MASS])
    scene = stack(Unbalance(0.5, moment=1e-4), speed=250.0, damping=2e3)
    of = lambda values: scene.put({"casing.mass": values[0]})

    def root(values):
        return jr.roots(of(values), 2)[0].imag

    def response(values):
        return jnp.abs(jr.unbalance_response(of(values), [250.0], at="pedestal").forward[0, 0])

    def motion(values):
        return jr.simulate(of(values), 2, 32).of_casing("pedestal")[-1].real

    for function in (root, response, motion):
        check_forward(function, own, 1e-3)


# === input


def test_scene_file():
    text = """
[shaft]
model = "rigid"
length = "1 m"
[[casing]]
name = "pedestal"
mass = "40 kg"
[[support]]
at = "0.1 m"
kxx = "1 MN/m"
kyy = "2 MN/m"
on = "pedestal"
[[support]]
of = "pedestal"
stiffness = "3 MN/m"
[[support]]
at = "0.9 m"
stiffness = "1 MN/m"
[disc]
at = "0.5 m"
mass = "9 kg"
diametral = "1 kg m^2"
polar = 0.0
[spin]
speed = "1500 rpm"
"""
    scene = jr.loads(text)
    assert float(scene.get("casing.mass")) == 40.0 and jr.assemble(scene).n == 3
    again = jr.loads(jr.files.toml.dumps(scene))
    np.testing.assert_array_equal(jr.roots(again), jr.roots(scene))
    with pytest.raises(jr.SceneError, match="There is no casing 'pedestral' .did you mean"):
        jr.loads(text.replace('on = "pedestal"', 'on = "pedestral"'))
    with pytest.raises(jr.SceneError, match="casing.0.name is missing"):
        jr.loads(text.replace('name = "pedestal"\n', ""))
    with pytest.raises(jr.SceneError, match="on must be a text, but is 3"):
        jr.loads(text.replace('on = "pedestal"', "on = 3"))
    assert scene.where("supports.1") == "supports.1"


def build(*effects):
    return Scene(RigidShaft(1.0), *effects, spin=jr.ConstantSpeed(1.0))


FRAME = Casing("frame", 3.0)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Casing("frame", 0.0), "`mass .kg.` must be positive, but is 0"),
        (lambda: Casing("", 1.0), "`name` of a casing must be a text"),
        (lambda: Support(kxx=1.0), "A support holds the shaft at a station, `at .m.`, or a casing"),
        (lambda: Support(0.1, 1.0, of="frame"), "give one of the two"),
        (lambda: Support(of="a", on="a", kxx=1.0), "'a' cannot stand on itself; leave out `on`"),
        (lambda: Support(of="a", kxx=1.0, rotating=True), "A casing does not turn or tilt"),
        (lambda: Support(of="a", kxx=1.0, angular_damping=1.0), "does not turn or tilt"),
        (lambda: build(FRAME), "Nothing holds the casing 'frame'"),
        (lambda: build(Support(0.1, 1.0, on="frame")), "no casing 'frame'; the scene has none"),
        (lambda: build(FRAME, FRAME, Support(0.1, 1.0, on="frame")), "Two casings have the name"),
        (
            lambda: build(FRAME, Support(0.1, 1.0, on="frame")).without("casings"),
            "no casing 'frame'; the scene has none",
        ),
    ],
)
def test_refusals(make, sentence):
    with pytest.raises(ValueError, match=sentence) as error:
        make()
    assert str(error.value).endswith(".")


def test_a_casing_that_is_not_there_has_no_motion():
    run = jr.simulate(stack(), 1, 8)
    with pytest.raises(ValueError, match="no casing 'frame'; the scene has: pedestal."):
        run.of_casing("frame")
    with pytest.raises(ValueError, match="no casing 'frame'; the scene has: pedestal."):
        jr.unbalance_response(stack(), 100.0, at="frame")
