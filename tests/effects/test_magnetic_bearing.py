"""Magnetic bearing in time: lift and drop, sensors elsewhere, saturation, steps, lanes, derivatives."""

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import central
from magnetic_bearing import (
    BIAS,
    CONSTANT,
    EARTH,
    FILTER,
    GAP,
    KD,
    KI,
    KP,
    LAG,
    MASS,
    RING,
    TIGHT,
    bearing,
    launch,
    machine,
)
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.effects.law import Now


LOW = -162.4445843621  # um, at rest on the ring under the bias and the weight
LIFTED = {  # ms: y [um], v [um/ms], q [um ms], f [um], i [A], by DOP853 and collocation of order 12
    2: (-97.140418492, 43.866971312, -272.811427024, -101.512376093, 1.060565362),
    10: (-6.599444338, -10.191962303, -332.690159619, -5.565738221, 0.432350150),
    100: (-0.0034688563, 0.0003242413, -544.963145138, -0.0035015697, 0.3270253697),
}
LIFT = jr.AnnularStator(0.5, **RING)


def lift():
    """The start on the ring, where the filter has settled and no current flows."""
    return launch(1j * LOW, states=[0.0, 0.0, 0.0, KD / FILTER * LOW * 1e-6, 0.0, 0.0])


# === lift and drop


def test_lift_off_a_ring():
    times = np.array([0.0, *LIFTED]) / 1e3
    run = jr.run_up(machine(LIFT), times, start=lift(), **TIGHT)
    of = lambda name: np.asarray(run.states[f"magnetic_bearing.{name}_y"])
    q, f = 1e9 * of("integral") / KI, 1e6 * of("filtered") * FILTER / KD
    z, v = 1e6 * run.displacement[:, 0].imag, 1e3 * run.velocity[:, 0].imag
    found = np.stack([z, v, q, f, of("current")], axis=1)[1:]
    np.testing.assert_allclose(found, list(LIFTED.values()), rtol=0, atol=3e-9)


def test_bias_alone_pulls_onto_the_ring():
    """At rest on it the pull of both coils, the weight and the ring balance, in closed form."""
    y = 1e-6 * LOW
    pull = CONSTANT * BIAS**2 * ((GAP - y) ** -2 - (GAP + y) ** -2)
    ring = RING["stiffness"] * (-y - RING["gap"])
    assert abs(pull - MASS * EARTH + ring) < 1e-6


@pytest.mark.slow
def test_drop_onto_a_ring():
    """Coils off: the free fall, three touches, and whirl by friction on the ring."""
    ring = jr.AnnularStator(0.5, **RING, friction=0.15, rim_radius=0.02)
    parts = jr.MasslessShaft(1.0, 0.5, 1e-6), jr.Disc(0.5, MASS), jr.Gravity(EARTH)
    rotor = jr.Scene(*parts, ring, spin=jr.ConstantSpeed(1000.0))
    times = np.array([0.0, 8e-3, 20e-3])
    steps = {"solver": jr.Exponential(4, located=True), "substeps": 2000}
    run = jr.run_up(rotor, times, start=launch(), **steps)
    wanted = [-28.171530171 - 103.386319160j, -17.425734405 - 163.063279494j]
    np.testing.assert_allclose(1e6 * run.displacement[1:, 0], wanted, rtol=0, atol=2e-6)


def test_times_of_touches_of_a_drop():
    """Without friction, so that the fall is vertical."""
    parts = jr.MasslessShaft(1.0, 0.5, 1e-6), jr.Disc(0.5, MASS), jr.Gravity(EARTH)
    rotor = jr.Scene(*parts, LIFT, spin=jr.ConstantSpeed(0.0))
    times = np.linspace(0.0, 0.03, 3001)
    steps = {"solver": jr.Exponential(4, located=True), "substeps": 4}
    run = jr.run_up(rotor, times, start=launch(), **steps)
    z, v = np.asarray(run.displacement[:, 0]), np.asarray(run.velocity[:, 0])
    depth = abs(z) - RING["gap"]
    enters = np.flatnonzero((depth[:-1] < 0) & (depth[1:] >= 0))
    for k, wanted in zip(enters, (5.530012636, 17.405399315, 28.656853837), strict=True):
        # Free fall from the sample before the touch, in closed form.
        fall = lambda t, k=k: abs(z[k] + v[k] * t - 0.5j * EARTH * t**2) - RING["gap"]
        low, high = 0.0, 2e-5
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if fall(middle) < 0 else (low, middle)
        assert abs(1e3 * (times[k] + low) - wanted) < 1e-7


# === against SciPy: sensor elsewhere, turned axes, saturation


def rates_of(y, limit, sensed):
    """Rates of the integral, of the filter and of the current of an axis by what its sensor reads."""
    q, f, i = y
    rate = (sensed - f) / FILTER
    wanted = -(KP * sensed + KI * q + KD * rate)
    return sensed, rate, (np.clip(wanted, -limit, limit) - i) / LAG


def rigid(limit, angle, sensor, start, times):
    """A rigid body of two coordinates, its bearing at its centre, by SciPy and the sheet's equations."""
    mass, diametral = MASS, 0.3
    turn = np.exp(1j * angle)

    def rates(t, s):
        z, tilt, v, w = (s[2 * k] + 1j * s[2 * k + 1] for k in range(4))
        seen = (z + tilt * sensor) / turn
        place, force, more = z / turn, [], []
        for axis, part in enumerate((np.real, np.imag)):
            own = s[8 + 3 * axis : 11 + 3 * axis]
            more += rates_of(own, limit, part(seen))
            x, i = part(place), own[2]
            force.append(CONSTANT * (((BIAS + i) / (GAP - x)) ** 2 - ((BIAS - i) / (GAP + x)) ** 2))
        push = (force[0] + 1j * force[1]) * turn
        zz, tt = push / mass - 1j * EARTH, -SPRING * tilt / diametral
        both = [v, w, zz, tt]
        return [*(p for c in both for p in (c.real, c.imag)), *more]

    begin = np.concatenate([[p for c in start for p in (c.real, c.imag)], np.zeros(6)])
    found = solve_ivp(rates, (0, times[-1]), begin, "DOP853", times, rtol=1e-11, atol=1e-13)
    return found.y[0] + 1j * found.y[1], found.y[8:]


SPRING, AT, SENSOR = 5e4, 0.5, 0.8  # N m/rad against tilting about the middle


def body(limit, angle=0.3, sensor=SENSOR):
    """A rigid body that the bearing holds in its middle, and a spring against tilting."""
    return jr.Scene(
        jr.RigidShaft(1.0),
        jr.Disc(AT, MASS, diametral=0.3, polar=0.0),
        jr.Support(AT, stiffness=0.0, angular_stiffness=SPRING),
        jr.Gravity(EARTH),
        bearing(angle=angle, sensor=sensor, limit=limit),
        spin=jr.ConstantSpeed(0.0),
    )


# 20 um in the middle along x, with a tilt; coordinates are the displacement at 0 and the tilt
TILTED = jr.Continued(jnp.array([5e-6 + 0j, 30e-6]), jnp.zeros(2, complex))


@pytest.mark.parametrize("limit", [3.0, 0.4], ids=["linear", "saturated"])
def test_sensor_elsewhere_on_turned_axes(limit):
    """A body that tilts, so that the sensor reads another motion than that at the coils."""
    scene, times = body(limit), np.array([0.0, 0.002, 0.006])
    run = jr.run_up(scene, times, at=AT, start=TILTED, **TIGHT)
    z, states = rigid(limit, 0.3, SENSOR - AT, (20e-6, 30e-6, 0.0, 0.0), times)
    np.testing.assert_allclose(run.displacement[:, 0], z, rtol=0, atol=1e-12)
    found = [run.states[f"magnetic_bearing.current_{axis}"] for axis in "xy"]
    np.testing.assert_allclose(found, states[[2, 5]], rtol=0, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_located_steps_keep_their_order_in_saturation(order):
    """Currents saturate and leave saturation; without location order 4 falls to about 3."""
    scene, times = machine(limit=0.4), np.array([0.0, 4e-3])
    end = lambda **given: jr.run_up(scene, times, start=launch(30 + 20j), **given)
    reference = end(**TIGHT)
    counts, errors = (100, 200, 400), []
    for count in counts:
        run = end(solver=jr.Exponential(order, located=True), substeps=count)
        errors.append(abs(run.displacement[-1, 0] - reference.displacement[-1, 0]))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert slopes.min() > order - 0.35, (errors, slopes)


# === lanes, derivatives, contract


@pytest.mark.slow
def test_lanes_are_single_runs():
    """Located steps of lanes that saturate at different instants, and read a sensor elsewhere."""
    times, gains = np.linspace(0.0, 2e-3, 3), [12000.0, 15000.0, 20000.0]
    solver = jr.Exponential(4, located=True)
    scene, over = body(0.4).at_speed(100 * np.pi), {"magnetic_bearing.kp": gains}
    options = {"solver": solver, "steps_per_revolution": 800, "error_sample": 0}
    found = jr.sweep(scene, over, times=times, start=TILTED, **options)
    name = "magnetic_bearing.current_y"
    current = found.states.sel(state=f"{name} [A]").isel(window=-1).values.ravel()
    for k, gain in enumerate(gains):
        there = scene.replace({"magnetic_bearing.kp": gain})
        run = jr.run_up(there, times, start=TILTED, solver=solver, substeps=40)
        np.testing.assert_allclose(current[k], run.states[name][-1], rtol=1e-7)


NUMBERS = {
    "constant": CONSTANT,
    "bias": 3.2,
    "gap": GAP,
    "kp": KP,
    "ki": KI,
    "kd": KD,
    "filter": FILTER,
    "lag": LAG,
    "limit": 2.9,
    "angle": 0.3,
    "sensor": SENSOR,
    "at": 0.5,
}


@pytest.mark.slow
def test_derivatives_by_every_number():
    """Those of a motion through saturation, against differences."""
    scene, times = body(0.4), np.array([0.0, 2e-3])
    values = jnp.array([0.4 if name == "limit" else value for name, value in NUMBERS.items()])
    options = {"solver": jr.Exponential(4, located=True), "substeps": 60}

    def end(values):
        paths = {f"magnetic_bearing.{n}": v for n, v in zip(NUMBERS, values, strict=True)}
        run = jr.run_up(scene.replace(paths), times, at=0.5, start=TILTED, **options)
        return jnp.stack([run.displacement[-1, 0].real, run.displacement[-1, 0].imag])

    for k, value in enumerate(np.asarray(values)):
        unit = jnp.eye(len(values))[k]
        _, slope = jax.jvp(end, (values,), (unit,))
        step = 1e-5 * value
        expected = central(lambda n, k=k, h=step: end(values.at[k].add(n * h)), step)
        np.testing.assert_allclose(slope, expected, rtol=0, atol=1e-6 * np.abs(slope).max())


def test_absent_parts_have_no_states():
    assert bearing().law().states == (
        "integral_x [A]",
        "integral_y [A]",
        "filtered_x [A]",
        "filtered_y [A]",
        "current_x [A]",
        "current_y [A]",
    )
    assert bearing(ki=None, filter=None, lag=None).law().states == ()
    assert not bearing(limit=None).law().kinked


def test_sensor_where_it_acts_has_no_port():
    assert len(jr.assemble(machine()).ports) == 1
    apart = jr.assemble(body(3.0))
    assert [len(port.laws) for port in apart.ports] == [1, 0] and apart.ports[0].reads == 1


def test_force_is_the_slope_of_its_factors_about_the_centre():
    law = bearing(ki=None, filter=None, lag=None, kd=None, limit=None, kp=16000.0).law()
    force = lambda x: law(jnp.stack([x, 0.0]), jnp.zeros(2), Now(0.0))[0]
    slope = jax.grad(force)(0.0)
    np.testing.assert_allclose(slope, 2.25e6 - 300 * 16000, rtol=1e-12)
    assert np.isnan(force(GAP)) and np.isnan(force(-1.01 * GAP))


def test_own_controller_is_that_of_the_gains():
    """PID as a transfer function: `kp + ki/p + kd p/(1 + filter p)` over a common denominator."""
    numerator = [KP * FILTER + KD, KP + KI * FILTER, KI]
    own = dict.fromkeys(("kp", "ki", "kd", "filter"))
    own |= {"numerator": numerator, "denominator": [FILTER, 1.0, 0.0]}
    times, start = np.array([0.0, 2e-3]), launch(30 + 20j)
    tight = {"solver": dfx.Dopri8(), "controller": dfx.PIDController(rtol=1e-11, atol=1e-14)}
    gains = machine(limit=2.0)
    # Controllers without states of their own begin alike; the filter of both begins at zero.
    a = jr.run_up(gains, times, start=start, **tight)
    b = jr.run_up(machine(limit=2.0, **own), times, start=start, **tight)
    np.testing.assert_allclose(b.displacement[-1], a.displacement[-1], rtol=1e-7)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kp": 7500.0}, r"`kp \[A/m\]` must be above 7500"),
        ({"limit": 3.1}, r"`limit \[A\]` must not be above the `bias \[A\]`, 3"),
        ({"kd": None}, "`filter .* give both or neither"),
        ({"numerator": [1.0]}, "A controller is given by `kp`"),
        ({"kp": None, "ki": None, "kd": None, "filter": None}, "needs a controller; give `kp"),
    ],
)
def test_refused(values, message):
    with pytest.raises(ValueError, match=message):
        bearing(**values)


def test_sensor_off_the_shaft_is_refused():
    with pytest.raises(
        ValueError, match="The sensor of a magnetic_bearing at 1.2 m is off the shaft"
    ):
        body(3.0, sensor=1.2)


def test_a_run_that_comes_to_a_coil_says_so():
    with pytest.raises(RuntimeError, match=r"At the wall of a bearing \(magnetic_bearing\)"):
        jr.run_up(machine(weight=1200.0), np.array([0.0, 0.05]), max_steps=4000)


@pytest.mark.slow
def test_sensor_elsewhere_by_whole_revolutions():
    """A controller without states: steps, harmonic balance and an orbit read the sensor, too."""
    gains = {"kp": 15000.0, "kd": 15.0, "sensor": 0.8}
    spring = {"stiffness": 1e4, "angular_stiffness": 5e4, "angular_damping": 5.0}
    scene = jr.Scene(
        jr.RigidShaft(1.0),
        jr.Disc(0.5, MASS, diametral=0.3, polar=0.1),
        jr.Support(0.5, damping=50.0, **spring),
        jr.Unbalance(0.5, MASS, 3e-5),
        jr.MagneticBearing(0.5, CONSTANT, BIAS, GAP, **gains),
        spin=jr.ConstantSpeed(300.0),
    )
    times = np.arange(4) * 2 * np.pi / 300.0
    run = jr.run_up(scene, times, at=0.5, **TIGHT)
    steps = jr.simulate(scene, 3, 256, at=0.5, solver=jr.Exponential(4))
    np.testing.assert_allclose(steps.displacement[-1], run.displacement[-1], rtol=0, atol=1e-10)
    settled = jr.simulate(scene, 40, 64, keep=1, at=0.5, solver=jr.Exponential(4))
    orbit = jr.periodic(scene, settled, solver=jr.Exponential(4), steps_per_revolution=256)
    balance = jr.harmonic_balance(scene, orbit, at=0.5)
    wanted = np.abs(balance.coefficients[balance.orders == 1])
    found = np.abs(np.fft.fft(np.asarray(orbit.displacement[:-1, 0]))[1]) / (len(orbit.time) - 1)
    np.testing.assert_allclose(found, wanted.max(), rtol=1e-6)
