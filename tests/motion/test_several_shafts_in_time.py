"""Motions of two rigid shafts in time against DOP853 and Gauss collocation, and linear ones exactly."""

import diffrax as dfx
import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shafts_of_tests import launched, toy

import jaxrotor as jr


LOCATED = jr.Exponential(order=4, located=True)
FINE = dfx.PIDController(rtol=1e-10, atol=1e-13)
TIMES = np.linspace(0.0, 25.0, 26)

STOPS = [
    jr.Limiter(
        at=("lp", 1.0),
        angle=np.pi / 3 + 2 * np.pi * j / 3,
        gap=0.12,
        stiffness=20.0,
        damping=0.3,
        friction=0.1,
        rim_radius=1.0,
    )
    for j in range(3)
]
RING = [
    jr.AnnularStator(
        at=("hp", 1.0),
        gap=0.06,
        stiffness=30.0,
        damping=0.2,
        friction=0.15,
        rim_radius=1.0,
        on="case",
    )
]
GAP = [jr.AnnularStator(at=("lp", 1.0), gap=0.03, stiffness=5.0, on="hp")]

MOTIONS = {  # z1 and z2 at t = 25
    "N1": (
        toy(1.3, None, *STOPS),
        (-0.0580074657 + 0.0358845384j, -0.0491252952 + 0.0877055184j),
    ),
    "N2": (
        toy(1.3, None, *RING, cased=True),
        (-0.4115104104 + 0.4350097513j, -0.0941982918 + 0.1186342469j),
    ),
    "N3": (
        toy(-1.2, None, *RING, cased=True),
        (-0.4453511487 + 0.4714353090j, -0.1347206960 + 0.1706394027j),
    ),
    "N4": (
        toy(1.3, None, *GAP, k12=0.0),
        (-0.3294335734 - 0.0630067690j, -0.2483233562 - 0.0199943082j),
    ),
    "N5": (
        toy(1.3, None, *STOPS, *RING, *GAP, k12=0.0, cased=True),
        (0.1095025962 + 0.0019141848j, 0.0562913027 + 0.0620640560j),
    ),
}


def start_of(scene):
    return launched(*[0.0] * len(scene.of(jr.Casing)))


@pytest.mark.parametrize(
    "name", ["N1", *(pytest.param(n, marks=pytest.mark.slow) for n in list(MOTIONS)[1:])]
)
def test_motions_through_contact(name):
    scene, wanted = MOTIONS[name]
    motion = jr.run_up(
        scene, TIMES, at=("lp", 1.0), solver=dfx.Dopri8(), controller=FINE, start=start_of(scene)
    )
    assert abs(motion.displacement[-1, 0] - wanted[0]) < 2e-8
    assert np.abs(motion.coordinates[-1][:2] - np.array(wanted)).max() < 2e-8


@pytest.mark.slow  # located steps of each scene, of two sizes
@pytest.mark.parametrize("name", ["N1", "N3", "N5"])
def test_located_steps_through_contact(name):
    scene, wanted = MOTIONS[name]
    off = []
    for substeps in (32, 64):
        motion = jr.run_up(
            scene, TIMES, at=("lp", 1.0), solver=LOCATED, substeps=substeps, start=start_of(scene)
        )
        off.append(abs(motion.displacement[-1, 0] - wanted[0]))
    assert off[1] < 2e-6 and off[1] < off[0]


@pytest.mark.slow  # steps at a speed that varies
def test_run_up_with_a_speed_of_its_own():
    spin = jr.SpeedProfile(times=[0.0, 50.0], speeds=[0.5, 1.5])
    motion = jr.run_up(
        toy(1.3, 0.1, spin=spin),
        np.linspace(0.0, 50.0, 51),
        at=("hp", 1.0),
        solver=jr.Exponential(order=4),
        substeps=64,
    )
    wanted = [-0.14982101 - 0.51162257j, -0.04076077 - 0.08887760j]
    np.testing.assert_allclose(motion.coordinates[-1], wanted, atol=2e-8)


def field_of(ratio, speed, first=1.4):
    """Equations of the linear toy in time, written here."""
    across = np.array([[1.0, -1.0], [-1.0, 1.0]])
    second = ratio * first + speed
    speeds, d = np.diag([first, second]), np.diag([0.01, 0.02])
    inverse = np.diag([1.0, 1 / 0.6])
    damping = np.diag([0.04, 0.03]) + d + 0.02 * across - 1j * speeds @ np.diag([0.2, 0.18])
    stiffness = np.diag([1.0, 2.0]) + 0.8 * across - 1j * speeds @ d

    def field(t, y):
        q, v = y[:2], y[2:]
        phases = np.exp(1j * np.array([first * t, second * t + 0.7]))
        load = np.array([0.05 * first**2, 0.03 * second**2]) * phases
        return np.concatenate([v, inverse @ (load - damping @ v - stiffness @ q)])

    return field


@pytest.mark.filterwarnings("ignore::jaxrotor.ImplausibleWarning")
@pytest.mark.parametrize(("ratio", "speed"), [(1.3, 0.0), (np.sqrt(2), 0.3), (0.0, 0.9)])
def test_linear_motions_are_exact(ratio, speed):
    scene = toy(ratio, speed)
    motion = jr.run_up(scene, TIMES, at=("lp", 1.0), start=launched())
    begin = np.array([0.05, -0.03j, 0.0, 0.0])
    found = solve_ivp(
        field_of(ratio, speed), (0, 25), begin, "DOP853", TIMES, rtol=1e-12, atol=1e-14
    )
    np.testing.assert_allclose(motion.coordinates, found.y[:2].T, atol=1e-10)


@pytest.mark.filterwarnings("ignore::jaxrotor.ImplausibleWarning")
def test_a_motion_goes_on_at_the_angle_of_every_shaft():
    scene = toy(1.3, 0.3)
    whole = jr.run_up(scene, TIMES, at=("hp", 1.0), start=launched())
    half = jr.run_up(scene, TIMES[:14], at=("hp", 1.0), start=launched())
    rest = jr.run_up(scene, TIMES[:13], at=("hp", 1.0), start=half.end)
    np.testing.assert_allclose(rest.displacement, whole.displacement[13:], atol=1e-12)


def test_revolutions_are_those_of_the_first_shaft():
    scene = toy()
    motion = jr.simulate(scene, 3, 32, keep=1, at=("lp", 1.0), start=launched())
    along = jr.run_up(scene, motion.time, at=("lp", 1.0), start=launched())
    np.testing.assert_allclose(motion.time[-1], 3 * 2 * np.pi / 1.4)
    np.testing.assert_allclose(motion.displacement, along.displacement, atol=1e-12)


@pytest.mark.slow  # lanes and a run are two programs
def test_lanes_over_the_ratio_are_runs():
    scene, times = MOTIONS["N1"][0], np.linspace(0.0, 20.0, 129)
    run = {"times": times, "at": ("lp", 1.0), "solver": jr.Exponential(order=4)}
    lanes = jr.sweep(
        scene,
        {"coaxial_shaft.ratio": [-1.2, 1.3]},
        **run,
        start=launched(),
        steps_per_revolution=512,
        error_sample=0,
        progress=False,
    )
    for number, ratio in enumerate((-1.2, 1.3)):
        moved = scene.replace({"coaxial_shaft.ratio": ratio})
        alone = jr.simulate(moved, **run, start=launched())
        peak = float(np.abs(alone.displacement).max())
        assert float(lanes["peak"][number]) == pytest.approx(peak, rel=5e-3)


@pytest.mark.slow  # a derivative through steps is a program of its own
def test_derivatives_by_the_ratio_through_contact():
    scene = MOTIONS["N4"][0]
    run = {"at": ("lp", 1.0), "solver": jr.Exponential(order=4), "substeps": 64}

    def end(ratio):
        moved = scene.replace({"coaxial_shaft.ratio": ratio})
        return jr.run_up(moved, TIMES[:6], start=launched(), **run).displacement[-1, 0].real

    slope = float(jax.jacfwd(end)(1.3))
    both = float(end(1.3 + 1e-5)) - float(end(1.3 - 1e-5))
    assert slope == pytest.approx(both / 2e-5, rel=1e-6)


def test_what_is_refused():
    drive = jr.Drive(1.0, torque=1.0, polar=1.0, feedback=True)
    with pytest.raises(ValueError, match="held back by the rotor"):
        jr.run_up(toy(spin=drive), TIMES, at=("lp", 1.0))
    with pytest.raises(ValueError, match="stations of one shaft"):
        jr.run_up(toy(), TIMES, at=[("lp", 1.0), ("hp", 1.0)])
