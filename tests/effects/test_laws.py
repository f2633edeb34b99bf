"""Laws with states, and laws that turn: a stop that wears, a force of a cage, a force of the shaft."""

import functools

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from own_laws import (
    Counter,
    Forgetful,
    OtherCounter,
    ShaftForce,
    TurningForce,
    TurningStop,
    WornRim,
)
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.effects.law import AbstractSmoothLaw
from jaxrotor.equations.port import Port, _as_states


K, MASS, C, ECC = 1e5, 10.0, 100.0, 1e-4
GAP, STIFF, WEAR, RIM = 1e-4, 1e6, 3e-6, 0.1
UNBALANCE = jr.Unbalance(0.5, MASS, ECC)
TIMES = np.linspace(0.0, 0.2, 33)
LOCATED = jr.Exponential(4, located=True)
TIGHT = {"solver": dfx.Dopri8(), "controller": dfx.PIDController(rtol=1e-10, atol=1e-13)}


def rotor(*parts, spin=120.0):
    """A disc in the middle of a massless shaft, K = 1e5 N/m."""
    spin = jr.ConstantSpeed(spin) if isinstance(spin, float) else spin
    middle = jr.Disc(0.5, MASS), jr.DiscDamping(0.5, C)
    return jr.Scene(jr.MasslessShaft(1.0, 0.5, K), *middle, *parts, spin=spin)


def worn(gap=GAP):
    return rotor(UNBALANCE, WornRim(0.5, gap, STIFF, WEAR, RIM))


# === a stop that wears


@functools.cache
def by_scipy(gap=GAP):
    """Displacement and depth of wear at the times, from one change of contact to the next."""

    def rates(time, y, inside):
        x, across, vx, vy, depth = y
        force = -STIFF * inside * (x - gap - depth)
        turning = MASS * ECC * 120.0**2 * np.array([np.cos(120 * time), np.sin(120 * time)])
        ax = (turning[0] + force - K * x - C * vx) / MASS
        ay = (turning[1] - K * across - C * vy) / MASS
        return [vx, vy, ax, ay, -WEAR * force * (120.0 * RIM + vy)]

    depth = lambda time, y, inside: y[0] - gap - y[4]
    depth.terminal = True
    time, y, inside = 0.0, np.zeros(5), 0.0
    found = [y]
    for until in TIMES[1:]:
        while time < until:
            part = solve_ivp(
                rates,
                (time, until),
                y,
                "DOP853",
                events=depth,
                args=(inside,),
                rtol=1e-12,
                atol=1e-16,
            )
            time, y = part.t[-1], part.y[:, -1]
            if part.status == 1:  # beyond the event, so that it is not found again
                inside = 1.0 - inside
                step = min(1e-9, until - time)
                y, time = y + step * np.array(rates(time, y, inside)), time + step
        found.append(y)
    found = np.array(found)
    return found[:, 0] + 1j * found[:, 1], found[:, 4]


def test_scipy_wears_the_stop():
    _, depth = by_scipy()
    assert 0.05 * GAP < depth[-1] < GAP


@pytest.mark.parametrize(
    ("how", "error"),
    [
        pytest.param({}, 1e-4, id="default", marks=pytest.mark.slow),
        pytest.param(TIGHT, 1e-6, id="integrated"),
        pytest.param({"solver": jr.Exponential(4), "substeps": 64}, 3e-4, id="steps"),
    ],
)
def test_run_of_a_stop_that_wears(how, error):
    run = jr.run_up(worn(), TIMES, **how)
    z, depth = by_scipy()
    np.testing.assert_allclose(run.displacement[:, 0], z, atol=error * np.abs(z).max())
    np.testing.assert_allclose(run.states["worn_rim.depth"], depth, atol=error * depth[-1])
    force = -STIFF * np.maximum(z.real - GAP - depth, 0.0)
    size = STIFF * np.abs(z).max()
    np.testing.assert_allclose(run.contact_force[:, 0], force, atol=5 * error * size)


@pytest.mark.slow
def test_located_steps_keep_their_order_beside_a_state():
    """One program takes all numbers of steps."""
    z, depth = by_scipy()
    errors = []
    for substeps in (16, 32, 64):
        run = jr.run_up(worn(), TIMES, solver=LOCATED, substeps=substeps)
        away = np.abs(run.displacement[:, 0] - z).max() / np.abs(z).max()
        errors.append([away, np.abs(run.states["worn_rim.depth"] - depth).max() / depth[-1]])
    errors = np.array(errors)
    assert (errors[1] < 1e-5).all()
    assert (np.log2(errors[:-1] / errors[1:]) > 3.5).all()


@pytest.mark.slow
def test_derivative_of_the_wear_by_the_gap():
    scene = worn()

    def depth(gap):
        run = jr.run_up(scene.replace({"worn_rim.gap": gap}), TIMES, solver=LOCATED, substeps=32)
        return run.states["worn_rim.depth"][-1]

    value, slope = jax.jvp(depth, (GAP,), (1.0,))
    step = 1e-4 * GAP
    difference = (by_scipy(GAP + step)[1][-1] - by_scipy(GAP - step)[1][-1]) / (2 * step)
    assert float(slope) == pytest.approx(difference, rel=1e-4)
    assert float(value) == pytest.approx(by_scipy()[1][-1], rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [None, LOCATED], ids=["integrated", "located"])
def test_lanes_of_stops_that_wear(solver):
    """Along times; the states observed are those at the ends of windows."""
    gaps = [GAP, 1.5 * GAP]
    how = {"solver": solver, "error_sample": 0, "times": TIMES}
    if solver is not None:
        how["steps_per_revolution"] = 256
    found = jr.sweep(worn(), {"worn_rim.gap": gaps}, **how)
    assert list(found.state.values) == ["worn_rim.depth [m]"]
    for lane, gap in enumerate(gaps):
        end = by_scipy(gap)[1][-1]
        assert float(found.states[lane, -1, 0]) == pytest.approx(end, rel=1e-4)
    assert (found.status == 0).all()


def test_a_run_goes_on_from_the_wear_that_it_has():
    """The depth is a variable of a data set, too."""
    whole = jr.run_up(worn(), TIMES, **TIGHT)
    first, later = TIMES[:17], TIMES[16:] - TIMES[16]
    begun = jr.run_up(worn(), first, **TIGHT)
    rest = jr.run_up(worn(), later, start=begun.end, **TIGHT)
    depth = jr.dataset(rest)["worn_rim.depth"]
    assert depth.attrs["units"] == "m" and depth.dims == ("time",)
    assert float(depth[0]) == float(begun.states["worn_rim.depth"][-1])
    np.testing.assert_allclose(depth, whole.states["worn_rim.depth"][16:], rtol=1e-6)


@pytest.mark.slow
def test_wear_under_a_drive_that_the_rotor_holds_back():
    """By steps, and integrated, where nothing of the states is shared."""
    drive = jr.Drive(100.0, 5.0, polar=0.1, feedback=True)
    scene = rotor(*worn().effects[2:], spin=drive)
    one = jr.run_up(scene, TIMES, **TIGHT)
    other = jr.run_up(scene, TIMES, solver=LOCATED, substeps=64)
    depth = one.states["worn_rim.depth"]
    assert float(depth[-1]) > 1e-6
    np.testing.assert_allclose(other.states["worn_rim.depth"], depth, atol=1e-5 * float(depth[-1]))
    np.testing.assert_allclose(other.speed, one.speed, rtol=1e-7)


# === several laws with several states


COUNTING = rotor(Counter(0.5, 1.0), OtherCounter(0.5, 2.0), Counter(0.5, 3.0))
COUNTED = {
    **{"counters.0.once": 0.5, "counters.0.twice": 1.0},
    **{"other_counter.once": 1.0, "other_counter.twice": 2.0},
    **{"counters.1.once": 1.5, "counters.1.twice": 3.0},
}


@pytest.mark.parametrize("begun", [None, [1, 0, 2, 0, 3, 0]])
def test_states_are_those_of_their_contacts(begun):
    """In the order of the scene, whatever laws share a port; a start of whole numbers stays exact."""
    start = jr.Launch(states=begun)
    run = jr.run_up(COUNTING, [0.0, 0.5], start=start, solver=dfx.Dopri8())
    assert list(run.states) == list(COUNTED)
    moved = [float(values[-1]) for values in run.states.values()]
    wanted = np.array(begun or np.zeros(6)) + list(COUNTED.values())
    np.testing.assert_allclose(moved, wanted, rtol=1e-9)
    np.testing.assert_allclose(run.end.states, wanted, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [None, jr.Exponential(4)], ids=["integrated", "steps"])
def test_lanes_name_the_states_of_their_contacts(solver):
    over = {"other_counter.rate": [2.0, 4.0]}
    how = {"times": np.linspace(0.0, 0.5, 9), "solver": solver, "observe": [jr.observe.States()]}
    found = jr.sweep(COUNTING, over, start=jr.Launch(states=[1, 0, 2, 0, 3, 0]), **how)
    assert list(found.state.values) == [f"{name} [rad]" for name in COUNTED]
    wanted = np.array([1, 0, 2, 0, 3, 0]) + list(COUNTED.values())
    np.testing.assert_allclose(found.states_end[0], wanted, rtol=1e-9)
    np.testing.assert_allclose(found.states_end[1], wanted + [0, 0, 1, 2, 0, 0], rtol=1e-9)


def test_a_law_that_is_misspelt_says_so():
    """When its class is defined, or when its states begin."""
    base = {"__call__": lambda self, displacement, velocity, now: displacement}
    with pytest.raises(ValueError, match='`clock` of Bad must be "revolution", "turns" or None'):
        type("Bad", (AbstractSmoothLaw,), base | {"clock": "cage"})
    with pytest.raises(ValueError, match="`states` of Bad must be a tuple of texts"):
        type("Bad", (AbstractSmoothLaw,), base | {"states": "wear [m]"})
    law = COUNTING.of(Counter)[0].law()
    short = Port(jnp.ones(1), jnp.ones(1), jnp.zeros(()), (jax.tree.map(lambda x: x[None], law),))
    with pytest.raises(
        ValueError, match="`begin` of CounterLaw must return a number for each of its 2"
    ):
        _as_states(law, "begin", [0.0])
    np.testing.assert_array_equal(short.begin(), [0.0, 0.0])


def test_a_law_of_states_without_rates_says_so():
    with pytest.raises(
        NotImplementedError, match="ForgetfulLaw has `states`, so it needs their `rates`"
    ):
        jr.run_up(rotor(Forgetful(0.5, 1.0)), [0.0, 0.5], solver=dfx.Dopri8())


# === a force of a cage


def response(force, frequency, times):
    """Motion from rest under `force exp(i frequency t)`."""
    amplitude = force / (K + 1j * frequency * C - MASS * frequency**2)
    roots = np.roots([MASS, C, K])
    own = np.linalg.solve([[1, 1], roots], [-amplitude, -1j * frequency * amplitude])
    return amplitude * np.exp(1j * frequency * times) + np.exp(np.outer(times, roots)) @ own


@pytest.mark.parametrize(
    ("speed", "how", "error"),
    [
        (120.0, {}, 1e-3),
        (-120.0, {"solver": jr.Exponential(4)}, 1e-6),
        (-120.0, TIGHT, 1e-8),
    ],
    ids=["default", "steps", "integrated"],
)
def test_a_force_turns_with_a_cage(speed, how, error):
    scene = rotor(TurningForce(0.5, 30.0, 0.37), spin=speed)
    run = jr.run_up(scene, TIMES, **how)
    z = response(30.0, 0.37 * speed, TIMES)
    np.testing.assert_allclose(run.displacement[:, 0], z, atol=error * np.abs(z).max())
    force = 30.0 * np.exp(1j * 0.37 * speed * TIMES)
    np.testing.assert_allclose(run.contact_force[:, 0], force, rtol=1e-9)


@pytest.mark.slow
def test_lanes_under_a_force_of_a_cage():
    scene = rotor(TurningForce(0.5, 30.0, 0.37))
    found = jr.sweep(scene, {"turning_force.ratio": [0.37, 0.6]}, times=TIMES, error_sample=0)
    for lane, ratio in enumerate((0.37, 0.6)):
        z = response(30.0, ratio * 120.0, TIMES)
        assert float(found.peak[lane]) == pytest.approx(np.abs(z).max(), rel=1e-3)
    turned = jr.sweep(scene, {"turning_force.ratio": [0.37]}, settle=1, keep=1, error_sample=0)
    z = response(30.0, 0.37 * 120.0, np.array([4 * np.pi / 120.0]))[0]
    np.testing.assert_allclose(turned.section[0, 0], [z.real, z.imag], rtol=1e-5)


@pytest.mark.slow
def test_a_force_of_a_cage_while_the_speed_rises():
    """The angle of a profile, against SciPy."""
    profile = jr.SpeedProfile([0.0, 0.2], [60.0, 120.0])
    scene = rotor(TurningForce(0.5, 30.0, 0.37), spin=profile)
    angle = lambda t: 0.37 * (60.0 * t + 150.0 * t**2)

    def rates(t, y):
        z, v = y[0] + 1j * y[1], y[2] + 1j * y[3]
        a = (30.0 * np.exp(1j * angle(t)) - K * z - C * v) / MASS
        return [v.real, v.imag, a.real, a.imag]

    exact = solve_ivp(rates, (0, 0.2), np.zeros(4), "DOP853", TIMES, rtol=1e-11, atol=1e-15)
    z = exact.y[0] + 1j * exact.y[1]
    for how in ({"solver": jr.Exponential(4)}, TIGHT):
        run = jr.run_up(scene, TIMES, **how)
        np.testing.assert_allclose(run.displacement[:, 0], z, atol=1e-6 * np.abs(z).max())


# === a force of the shaft


@pytest.mark.parametrize(
    ("speed", "solver", "error"),
    [
        (120.0, None, 1e-4),
        (-120.0, jr.Exponential(4, located=True), 1e-8),
        pytest.param(-120.0, dfx.Dopri8(), 2e-5, marks=pytest.mark.slow),
    ],
    ids=["default", "fourth order", "integrated"],
)
def test_a_force_that_turns_with_the_shaft_is_unbalance(speed, solver, error):
    law = jr.simulate(rotor(ShaftForce(0.5, MASS * ECC), spin=speed), 5, solver=solver)
    wanted = jr.simulate(rotor(UNBALANCE, spin=speed), 5)
    size = np.abs(wanted.displacement).max()
    np.testing.assert_allclose(law.displacement, wanted.displacement, atol=error * size)
    force = MASS * ECC * speed**2 * np.exp(1j * law.angle)
    np.testing.assert_allclose(law.contact_force[:, 0], force, rtol=1e-9)


@pytest.mark.slow
def test_lanes_under_a_force_of_the_shaft():
    """At unequal speeds of either sense, and where all lanes have one speed."""
    law, wanted = rotor(ShaftForce(0.5, MASS * ECC)), rotor(UNBALANCE)
    how = {"settle": 20, "keep": 2, "steps_per_revolution": 64, "error_sample": 0}
    how["solver"] = jr.Exponential(4)
    speeds = {"spin.speed": [100.0, -100.0, 50.0]}
    sizes = {"shaft_force.moment": [1e-3, 2e-3]}, {"unbalance.eccentricity": [1e-4, 2e-4]}
    for over, beside in ((speeds, speeds), sizes):
        one, other = jr.sweep(law, over, **how), jr.sweep(wanted, beside, **how)
        np.testing.assert_allclose(one.section, other.section, atol=1e-10)
        np.testing.assert_allclose(one.radius_rms, other.radius_rms, rtol=1e-6)


@pytest.mark.slow
def test_orbits_under_a_force_of_the_shaft():
    law = rotor(ShaftForce(0.5, MASS * ECC))
    orbit = jr.periodic(law, jr.Whirl(1e-4, rate=120.0))
    balance = jr.harmonic_balance(law, harmonics=2)
    z = MASS * ECC * 120.0**2 / (K + 120j * C - MASS * 120.0**2)
    for found in (orbit, balance):
        np.testing.assert_allclose(found.displacement[0, 0], z, rtol=1e-6)


# === a stop that turns


@pytest.mark.slow
@pytest.mark.parametrize("spin", [120.0, jr.SpeedProfile([0.0, 0.2], [60.0, 150.0])])
def test_located_steps_through_a_stop_that_turns(spin):
    """A rim pressed against a stop that turns with the shaft, through many whole turns."""
    scene = rotor(UNBALANCE, TurningStop(0.5, 1e-4, 1e6), jr.Gravity(9.81), spin=spin)
    runs = [jr.run_up(scene, TIMES, solver=LOCATED, substeps=count) for count in (16, 32)]
    exact = jr.run_up(scene, TIMES, **TIGHT).displacement[:, 0]
    away = [float(np.abs(run.displacement[:, 0] - exact).max()) for run in runs]
    assert away[1] < 2e-6 * np.abs(exact).max() and away[0] > 8 * away[1]
    assert np.any(runs[0].contact_force != 0) and not np.all(runs[0].contact_force != 0)


# === refusals


FILM = jr.JournalBearing(0.5, 1e-4, 0.05, 0.02, 0.01)


def carried():
    return jr.sweep(
        rotor(TurningForce(0.5, 1.0, 0.4)),
        {"turning_force.force": [0, 1.0]},
        carry="turning_force.force",
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: jr.harmonic_balance(rotor(UNBALANCE, TurningForce(0.5, 1.0, 0.4)), harmonics=2),
            "count turns",
        ),
        (
            lambda: jr.harmonic_balance(worn(), harmonics=2),
            "have states of their own or count turns; follow its motion",
        ),
        (carried, "`carry` continues each lane at angle zero"),
        (
            lambda: jr.sweep(worn(), {"worn_rim.gap": [1e-4]}, solver=jr.Exponential()),
            "contacts that have states or count turns .worn_rim., which `times` would allow",
        ),
        (
            lambda: jr.sweep(
                rotor(UNBALANCE), {"spin.speed": [9.0]}, observe=[jr.observe.States()]
            ),
            "`States` observes states of laws, but the scene has none",
        ),
        (
            lambda: jr.static_positions(rotor(FILM, ShaftForce(0.5, 1e-3))),
            "for forces that stand still, but those of shaft_force turn",
        ),
        (
            lambda: jr.sweep(
                rotor(UNBALANCE), {"spin.speed": [9.0]}, start=jr.Launch(states=[0.0])
            ),
            "must have the shape .0,., one for each state",
        ),
        (
            lambda: jr.run_up(worn(), TIMES, start=jr.Launch(states=jnp.zeros(2))),
            "must have the shape .1,., one for each state",
        ),
        (
            lambda: jr.simulate(rotor(UNBALANCE), 2, start=jr.Launch(states=jnp.zeros(1))),
            "takes no states of laws",
        ),
        (
            lambda: jr.periodic(
                rotor(ShaftForce(0.5, 1e-3)), jr.Whirl(1e-4), turn=0.0, period=0.06
            ),
            "depends on its angle; give `revolutions`",
        ),
    ],
)
def test_what_takes_no_such_law_says_so(call, message):
    with pytest.raises(ValueError, match=message):
        call()
