"""Revolutions of several shafts: phases exactly, steps through contact, lanes, and what each begins at."""

from fractions import Fraction

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shafts_of_tests import launched, toy
from test_several_shafts_in_time import FINE, GAP, MOTIONS, STOPS, start_of

import jaxrotor as jr
from jaxrotor.equations.clocks import _after


# Three cubic springs by 120 degrees between the shafts: -40 |d|^2 d
CUBIC = [
    jr.CubicSpring(at=("lp", 1.0), on="hp", angle=k * np.pi / 3, stiffness=320 / 9)
    for k in range(3)
]
AFTER_THREE = {  # z1 after three revolutions, of two codes with located changes of contact
    "cubic": (toy(1.3, None, *CUBIC), 0.0619926943 - 0.3319500910j),
    "cubic, against": (toy(-1.2, None, *CUBIC), -0.1140321367 - 0.2956915078j),
    "kink": (toy(1.3, None, *GAP, k12=0.0), 0.1003750127 - 0.2127511607j),
    "jumps": (toy(1.3, None, *STOPS), 0.0850826356 - 0.1266894437j),
}


def off(name, order, steps, **how):
    scene, wanted = AFTER_THREE[name]
    solver = jr.Exponential(order=order, **how)
    run = {"keep": 1, "at": ("lp", 1.0), "start": launched(), "solver": solver}
    return abs(jr.simulate(scene, 3, steps, **run).displacement[-1, 0] - wanted)


@pytest.mark.slow  # four programs
@pytest.mark.parametrize("name", ["cubic", "cubic, against"])
def test_steps_through_a_smooth_joint_have_their_order(name):
    for order, largest in ((2, 5e-4), (4, 3e-7)):
        coarse, fine = off(name, order, 64), off(name, order, 128)
        assert coarse < largest
        assert 2**order * 0.75 < coarse / fine < 2**order * 1.25


@pytest.mark.slow  # two programs each
@pytest.mark.filterwarnings("ignore::jaxrotor.FewStepsWarning")
@pytest.mark.parametrize(("name", "plain"), [("kink", 1.5e-4), ("jumps", 5e-4)])
def test_steps_through_contact(name, plain):
    assert off(name, 2, 256) < plain
    assert off(name, 4, 64, located=True) < 2e-6


@pytest.mark.slow  # located steps and their continuation along times are a program each
@pytest.mark.parametrize("name", ["N1", "N5"])
def test_motions_go_on_along_times_from_the_end_of_revolutions(name):
    scene, wanted = MOTIONS[name]
    at, period = ("lp", 1.0), 2 * np.pi / 1.4
    solver = jr.Exponential(order=4, located=True)
    motion = jr.simulate(scene, 5, 256, keep=1, at=at, start=start_of(scene), solver=solver)
    rest = np.linspace(0.0, 25.0 - 5 * period, 3)
    rest = jr.run_up(scene, rest, at=at, solver=dfx.Dopri8(), controller=FINE, start=motion.end)
    assert np.abs(rest.coordinates[-1][:2] - np.array(wanted)).max() < 1e-6


@pytest.mark.slow  # programs of revolutions to skip, and of those that are kept
def test_revolutions_go_on_from_the_end_of_others():
    scene = toy(1.3, 0.3, *CUBIC)
    more = {"keep": 1, "at": ("lp", 1.0)}
    whole = jr.simulate(scene, 5, 64, start=launched(), **more)
    half = jr.simulate(scene, 2, 64, start=launched(), **more)
    after = jr.simulate(scene, 3, 64, start=half.end, **more)
    np.testing.assert_allclose(after.coordinates, whole.coordinates, atol=1e-13)


@pytest.mark.parametrize(("dtype", "bits"), [(np.float64, 52), (np.float32, 23)])
@pytest.mark.parametrize("ratio", [1.3, -1.2, 0.1, 4 / 3, 17.25])
def test_turns_of_a_shaft_are_exact_sums(ratio, dtype, bits):
    rho, none, one = jnp.asarray([ratio], dtype), jnp.zeros(1, dtype), jnp.asarray(1)
    rounded = Fraction(round(Fraction(float(rho[0])) % 1 * 2**bits), 2**bits)
    at_once = _after(none, rho, jnp.asarray(1_000_003))
    assert Fraction(float(at_once[0])) == 1_000_003 * rounded % 1
    each = jax.lax.fori_loop(0, 4099, lambda _, turns: _after(turns, rho, one), none)
    assert Fraction(float(each[0])) == 4099 * rounded % 1


def test_the_phase_after_a_million_revolutions():
    count, ratio = 1_000_000, 1.3
    scene = toy(ratio)
    motion = jr.simulate(scene, count, 16, keep=1, at=("hp", 1.0), start=launched())
    angle = 2 * np.pi * np.arange(17) / 16
    turns = float((count - 1) * Fraction(ratio) % 1)
    wanted = 0
    for by, phase in (("lp", angle), ("hp", ratio * angle + 2 * np.pi * turns)):
        found = jr.unbalance_response(scene, [1.4], at=("hp", 1.0), by=by)
        wanted = wanted + complex(found.forward[0, 0]) * np.exp(1j * phase)
    np.testing.assert_allclose(motion.displacement[:, 0], wanted, atol=1e-12)


@pytest.mark.slow  # 1.6 million steps
def test_steps_have_no_drift_of_phase():
    far = jr.AnnularStator(at=("lp", 1.0), gap=10.0, stiffness=5.0)
    motions = [
        jr.simulate(scene, 100_000, 16, keep=1, at=("hp", 1.0), start=launched())
        for scene in (toy(1.3, 0.2), toy(1.3, 0.2, far))
    ]
    assert "contact" in motions[1].method
    np.testing.assert_allclose(motions[1].displacement, motions[0].displacement, atol=1e-12)


UNEQUAL = [jr.Support(at=("hp", 1.0), kxx=0.3, kyy=0.1)]
TURNING = [jr.Support(at=("lp", 1.0), kxx=0.3, kyy=0.1, rotating=True)]


@pytest.mark.slow  # a program each, and one of DOP853
@pytest.mark.parametrize("parts", [UNEQUAL, TURNING], ids=["fixed", "turning"])
@pytest.mark.parametrize("contact", [[], CUBIC], ids=["linear", "contact"])
def test_unequal_axes(parts, contact):
    scene, at = toy(1.3, 0.1, *parts, *contact), ("hp", 1.0)
    motion = jr.simulate(scene, 3, 256, at=at, start=launched(), solver=jr.Exponential(order=4))
    run = {"at": at, "start": launched(), "solver": dfx.Dopri8(), "controller": FINE}
    wanted = jr.run_up(scene, motion.time[::256], **run)
    np.testing.assert_allclose(motion.displacement[::256], wanted.displacement, atol=2e-8)


@pytest.mark.slow  # lanes and a run are two programs
def test_lanes_over_ratio_and_speed_are_runs():
    scene, at = toy(1.3, 0.1, *STOPS), ("lp", 1.0)
    over = {"shafts.hp.ratio": [-1.2, 1.3], "spin.speed": [1.0, 1.4]}
    run = {"start": launched(), "at": at}
    lanes = {"settle": 5, "keep": 3, "steps_per_revolution": 128, "error_sample": 0}
    orbit = jr.observe.Orbit()
    found = jr.sweep(scene, over, observe=[orbit], progress=False, **lanes, **run).orbit.values
    single = jr.sweep(
        scene, over, observe=[orbit], progress=False, precision="float32", **lanes, **run
    )
    for i, ratio in enumerate(over["shafts.hp.ratio"]):
        for j, speed in enumerate(over["spin.speed"]):
            moved = scene.replace({"shafts.hp.ratio": ratio, "spin.speed": speed})
            motion = jr.simulate(moved, 8, 128, keep=3, **run)
            z = (found[i, j] @ np.array([1, 1j])).ravel()
            np.testing.assert_allclose(z, motion.displacement[1:, 0], atol=1e-12)
            z = (single.orbit.values[i, j] @ np.array([1, 1j])).ravel()
            np.testing.assert_allclose(z, motion.displacement[1:, 0], atol=2e-4)


@pytest.mark.slow  # a derivative through steps is a program of its own
def test_derivatives_by_the_ratio():
    def end(ratio):
        moved = toy(1.3, None, *CUBIC).replace({"shafts.hp.ratio": ratio})
        run = {"keep": 1, "at": ("lp", 1.0), "start": launched()}
        return jr.simulate(moved, 3, 64, **run).displacement[-1, 0].real

    slope = float(jax.jacfwd(end)(1.3))
    both = float(end(1.3 + 1e-5)) - float(end(1.3 - 1e-5))
    assert slope == pytest.approx(both / 2e-5, rel=1e-6)


@pytest.mark.slow  # a program of lanes, and of a run
@pytest.mark.parametrize("by", ["lp", "hp"])
def test_revolutions_of_a_named_shaft(by):
    """Whirl by the unbalance of hp alone: its index is 1 by hp, and the ratio of speeds by lp."""
    whole = toy(1.3, 0.1)
    alone = [
        one for one in whole.effects if not (isinstance(one, jr.Unbalance) and one.shaft == "lp")
    ]
    over, at = {"shafts.hp.ratio": [-1.2, 1.3]}, ("hp", 1.0)
    run = {"settle": 600, "keep": 10, "steps_per_revolution": 64, "at": at, "period": by}
    found = jr.sweep(whole.of_parts(*alone), over, error_sample=0, progress=False, **run)
    speeds = np.array([-1.2, 1.3]) * 1.4 + 0.1
    wanted = np.ones(2) if by == "hp" else speeds / 1.4
    for name in ("index", "winding", "whirl_rate"):
        np.testing.assert_allclose(found[name], wanted, rtol=1e-6 if name == "index" else 2e-2)
    assert found.attrs["observed_shaft"] == "hp"
    # Both unbalances, through contact, at the same instants:
    scene = toy(1.3, 0.1, *CUBIC)
    run = {"at": at, "start": launched(), "solver": jr.Exponential(order=4)}
    motion = jr.simulate(scene, 3, 128, period=by, **run)
    assert motion.time[-1] == pytest.approx(3 * 2 * np.pi / (1.4 if by == "lp" else 1.92))
    wanted = jr.run_up(scene, motion.time[::128], **run | {"solver": dfx.Dopri8()}, controller=FINE)
    np.testing.assert_allclose(motion.displacement[::128], wanted.displacement, atol=1e-7)


def test_what_is_refused():
    with pytest.raises(ValueError, match="the name of a shaft"):
        jr.simulate(toy(), 3, 64, at=("lp", 1.0), period="ip")
    with pytest.raises(ValueError, match="parts turn with 'lp'"):
        jr.simulate(toy(1.3, None, *TURNING), 3, 64, at=("lp", 1.0), period="hp")
    with pytest.raises(ValueError, match="lanes by exponential steps"):
        over = {"spin.speed": [1.0, 1.4]}
        jr.sweep(toy(), over, at=("lp", 1.0), period="hp", solver=dfx.Dopri8(), progress=False)
