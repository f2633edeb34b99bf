"""Magnetic bearings about their static positions: roots, limits of gains, coordinates of controllers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import central
from magnetic_bearing import (
    CONSTANT,
    EARTH,
    FILTER,
    GAP,
    LAG,
    MASS,
    NEGATIVE,
    PER_AMPERE,
    bearing,
    free_shaft,
    machine,
)
from scipy.optimize import brentq

import jaxrotor as jr


REAL = -5541.193220891, -10700.851348580
CENTRED = -92.526249374, -166.047923911 + 437.208408025j, *REAL
LOADED = -93.967939415, -165.365896145 + 433.618222852j, -5541.102294851, -10700.864640110
SAGGED = -209.026266582 + 456.771971286j
FREE_SHAFT = {  # sensor: roots of the symmetric and antisymmetric motions, then bending, by exact beams
    0.1: (
        -94.644755679 + 280.173843774j,
        -266.678783979 + 332.123514730j,
        -199.950617241 + 1220.047020619j,
        -21.365779039 + 3210.842605748j,
    ),
    0.16: (
        -110.338791958 + 285.558547105j,
        -197.704366533 + 249.531142396j,
        -88.293440884 + 1155.492278592j,
        16.827256579 + 3166.392031929j,
    ),
    0.04: (
        -81.474048817 + 273.468831434j,
        -327.469085853 + 394.725657809j,
        -324.076978217 + 1287.026716696j,
        -69.765228521 + 3263.725403553j,
        2.220510749 + 6240.485218125j,
    ),
}


def above(scene):
    """Roots with an imaginary part that is not negative."""
    found = np.asarray(jr.roots(scene))
    return found[found.imag > -1e-6]


def holds(found, wanted, rtol):
    """Whether every wanted root is among those found."""
    for root in wanted:
        assert np.abs(found - root).min() <= rtol * abs(root), root


# === roots and positions


def test_roots_centred_and_under_weight():
    holds(above(jr.linearized(machine(weight=0.0))), CENTRED, 1e-11)
    both = above(jr.linearized(machine()))  # the axis across the weight, and that along it
    holds(both, (*CENTRED, *LOADED), 1e-11)
    assert both.size == 8


def test_rest_of_an_integral_and_sag_without_one():
    rest = jr.static_positions(machine())
    np.testing.assert_allclose(rest.current, [[0.0, 0.327]], atol=1e-14)
    np.testing.assert_allclose(rest.position, 0.0, atol=1e-18)
    np.testing.assert_allclose(rest.load, -1j * MASS * EARTH)
    factor = 4 * CONSTANT * (9 + 0.327**2) / GAP**3
    np.testing.assert_allclose(rest.position_factor, [[NEGATIVE, factor]], rtol=1e-13)
    sag = jr.static_positions(machine(ki=None))
    np.testing.assert_allclose(1e6 * sag.position, -43.60630799j, atol=1e-8)
    holds(above(jr.linearized(machine(ki=None))), [SAGGED], 1e-11)
    assert "static positions" in sag._repr_html_().lower()


@pytest.mark.parametrize(
    ("ki", "low", "high"),
    [(None, 2.262786003, 552.167769553), (6e5, 4.905453006, 552.161676624)],
    ids=["PD", "PID"],
)
def test_range_of_the_derivative_gain(ki, low, high):
    scene = jr.linearized(machine(weight=0.0, ki=ki))
    path = "linear_magnetic_bearing.kd"
    growth = lambda kd: np.asarray(jr.roots(scene.replace({path: kd}))).real.max()
    for wanted in (low, high):
        found = brentq(growth, 0.99 * wanted, 1.01 * wanted, rtol=1e-12)
        assert found == pytest.approx(wanted, rel=1e-9)


def test_position_of_a_load_in_saturation_is_refused():
    message = (
        r"would need a current of 3\.333 A, but its `limit \[A\]` is 3: in saturation the loop"
    )
    with pytest.raises(ValueError, match=message):
        jr.static_positions(machine(weight=100.0))


def test_linear_analyses_ask_for_a_static_position():
    with pytest.raises(
        ValueError, match=r"Magnetic bearings \(magnetic_bearing\) are linear about"
    ):
        jr.roots(machine())
    film = jr.JournalBearing(0.5, viscosity=0.01, radius=0.02, length=0.02, clearance=1e-4)
    with pytest.raises(ValueError, match="more than one kind"):
        jr.static_positions(machine(film))


@pytest.mark.slow
def test_derivatives_of_rest_and_roots():
    """Of the sag, the factors there and the roots, by numbers of the bearing and the weight."""
    numbers = {
        "gravity.acceleration": EARTH,
        "magnetic_bearing.constant": CONSTANT,
        "magnetic_bearing.bias": 3.0,
        "magnetic_bearing.gap": GAP,
        "magnetic_bearing.kp": 15000.0,
        "magnetic_bearing.kd": 15.0,
        "magnetic_bearing.filter": FILTER,
        "magnetic_bearing.lag": LAG,
    }
    scene, values = machine(ki=None), jnp.array(list(numbers.values()))

    @jax.jit
    def found(values, along):
        def of(values):
            there = scene.replace(dict(zip(numbers, values, strict=True)))
            rest = jr.static_positions(there)
            slow = jr.roots(jr.linearized(there), count=2)
            parts = rest.position.imag, rest.position_factor[0], slow.real, slow.imag
            return jnp.concatenate(parts)

        return jax.jvp(of, (values,), (along,))

    for k, value in enumerate(numbers.values()):
        unit = jnp.eye(values.size)[k]
        step = 1e-4 * value
        expected = central(lambda n, u=unit, h=step: found(values + n * h * u, u)[0], step)
        slopes = found(values, unit)[1]
        np.testing.assert_allclose(slopes, expected, rtol=1e-6, atol=1e-6 * np.abs(slopes).max())


# === sensors elsewhere


@pytest.mark.slow
@pytest.mark.parametrize("sensor", FREE_SHAFT)
def test_sensors_on_either_side_of_a_node(sensor):
    """A free shaft; the node of the second bending mode, at 0.132, may lie between sensor and coils."""
    holds(above(free_shaft(sensor, nodes=16)), FREE_SHAFT[sensor], 1e-9)


@pytest.mark.slow
def test_roots_of_a_dense_matrix():
    """A spinning flexible shaft in two unlike bearings, ten coordinates of controllers, by the equations.

    The matrix is of coordinates, their rates, and the integrals, filters and currents of each bearing.
    """
    shaft = jr.FlexibleShaft(1.0, 0.04, nodes=4)
    disc = jr.Disc(0.4, 5.0, diametral=0.02, polar=0.04)
    gains = (9000.0, 3e5, 12.0, 1e-4, 2e-4), (11000.0, 2e5, 9.0, 2e-4, None)
    stations, factors = ((0.1, 0.13), (0.9, 0.86)), ((250.0, 1.1e6), (280.0, 1.4e6))
    names = "kp", "ki", "kd", "filter", "lag"
    bearings = [
        jr.LinearMagneticBearing(at, *own, **dict(zip(names, gain, strict=True)), sensor=s, name=n)
        for (at, s), own, gain, n in zip(stations, factors, gains, "ab", strict=True)
    ]
    spin = jr.ConstantSpeed(400.0)
    scene = jr.Scene(shaft, disc, *bearings, spin=spin)
    # The same rotor on springs of no stiffness, so that its spans are the same.
    bare = [jr.Support(at, stiffness=0.0) for at, _ in stations]
    system = jr.assemble(jr.Scene(shaft, disc, *bare, spin=spin))
    part = lambda name: np.asarray(getattr(system.blocks, name))
    inertia, stiffness = part("inertia"), part("stiffness")
    n, line = system.n, system.line
    row = lambda at: np.asarray(line.row(jnp.asarray(at)))
    sizes = [3, 2]
    a = np.zeros((2 * n + 5, 2 * n + 5), complex)
    a[:n, n : 2 * n] = np.eye(n)
    push = np.zeros((n, 2 * n + 5), complex)
    push[:, :n], push[:, n : 2 * n] = -stiffness, 1j * 400.0 * part("gyroscopic")
    for j, (at, sensor) in enumerate(stations):
        (ki, ks), (kp, gain, kd, filtered, lag) = factors[j], gains[j]
        first = 2 * n + sum(sizes[:j])
        read = np.zeros(2 * n + 5)
        read[:n] = row(sensor)
        q, f = np.eye(2 * n + 5)[first : first + 2]
        a[first], a[first + 1] = read, (read - f) / filtered
        wanted = -(kp * read + gain * q + kd * (read - f) / filtered)
        current = wanted
        if lag is not None:
            current = np.eye(2 * n + 5)[first + 2]
            a[first + 2] = (wanted - current) / lag
        pull = ki * current
        pull[:n] = pull[:n] + ks * row(at)
        push += np.outer(np.asarray(line.column(jnp.asarray(at))), pull)
    a[n : 2 * n] = np.linalg.solve(inertia, push)
    exact = np.linalg.eigvals(a)
    found = np.asarray(jr.roots(scene))
    assert found.size == exact.size
    slow = exact[np.abs(exact) < 2e4]
    assert slow.size >= 12
    holds(found, slow, 1e-10)
    # In time, along the same equations.
    stations = np.linspace(0.0, 1.0, 41)
    q0 = np.linalg.lstsq(np.stack([row(at) for at in stations]), 1e-5 + 0 * stations)[0]
    start = jr.Continued(jnp.append(q0, np.zeros(5)) + 0j, jnp.zeros(n + 5) + 0j)
    run = jr.simulate(scene, 1, steps_per_revolution=32, at=0.4, start=start)
    values, vectors = np.linalg.eig(a)  # a matrix exponential would cost four digits more
    amplitudes = np.linalg.solve(vectors, np.append(q0, np.zeros(n + 5)))
    for k in (1, 7, 32):
        there = row(0.4) @ (vectors @ (np.exp(values * float(run.time[k])) * amplitudes))[:n]
        np.testing.assert_allclose(run.displacement[k, 0], there, rtol=0, atol=1e-14)


@pytest.mark.slow
def test_steps_with_a_stop_agree_with_an_error_estimate():
    """By whole revolutions, where coordinates of controllers are eliminated with the massless ones."""
    gains = {"kp": 15000.0, "kd": 15.0, "filter": FILTER, "lag": LAG}
    own = jr.LinearMagneticBearing(0.5, PER_AMPERE, NEGATIVE, **gains)
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e-6),
        jr.Disc(0.5, MASS),
        jr.Unbalance(0.5, MASS, 3e-5),
        own,
        jr.Limiter(0.5, angle=0.2, gap=1.5e-5, stiffness=5e6, damping=200.0),
        spin=jr.ConstantSpeed(450.0),
    )
    exact = jr.simulate(scene, 4, 256, solver=jr.Exponential(4, located=True))
    other = jr.run_up(scene, np.asarray(exact.time[::256]))
    assert np.abs(exact.contact_force).max() > 10.0
    assert exact.method.startswith("Exponential")
    np.testing.assert_allclose(
        exact.displacement[-1], other.displacement[-1], atol=1e-4 * np.abs(other.displacement).max()
    )


def test_names_of_coordinates_are_told_apart():
    alike = [jr.LinearMagneticBearing(at, 300.0, 1e6, kp=9000.0, lag=LAG) for at in (0.1, 0.9)]
    with pytest.raises(ValueError, match="have the name 'magnetic_bearing'; give each"):
        jr.Scene(jr.FlexibleShaft(1.0, 0.04), *alike, spin=jr.ConstantSpeed(0.0))


def test_absent_states_leave_no_coordinates():
    """A gain alone is a spring, of `current_factor kp - position_factor`."""
    own = jr.LinearMagneticBearing(0.5, PER_AMPERE, NEGATIVE, kp=15000.0, kd=10.0)
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e-6), jr.Disc(0.5, MASS), own, spin=jr.ConstantSpeed(0.0)
    )
    k, c = PER_AMPERE * 15000.0 - NEGATIVE, PER_AMPERE * 10.0
    assert jr.assemble(scene).n == 1
    holds(above(scene), np.roots([MASS, c, k])[:1], 1e-12)


def test_linearized_keeps_the_controller():
    linear = jr.linearized(machine(weight=0.0, sensor=None, angle=0.3))
    (own,) = linear.of(jr.LinearMagneticBearing)
    assert own.name == "magnetic_bearing" and own.current_across is None
    assert [float(x) for x in (own.kp, own.filter, own.angle)] == [15000.0, FILTER, 0.3]
    turned = jr.linearized(machine(angle=0.3)).of(jr.LinearMagneticBearing)[0]
    assert turned.current_across is not None
    straight = np.sort_complex(jr.roots(jr.linearized(machine(angle=np.pi / 2))))
    np.testing.assert_allclose(
        straight, np.sort_complex(jr.roots(jr.linearized(machine()))), rtol=1e-9
    )
    assert bearing().law().factors[0] == pytest.approx(PER_AMPERE)


def test_what_needs_a_rotor_without_damping_is_refused():
    """Critical speeds would hold each sensor fast, by the integral that is left without damping."""
    scene = free_shaft(0.1, nodes=4)
    with pytest.raises(ValueError, match="Critical speeds are those of the rotor without damping"):
        jr.critical_speeds(scene)
    with pytest.raises(
        ValueError, match="A modal_damping is by modes of the rotor without damping"
    ):
        jr.roots(scene.of_parts(*scene.effects, jr.ModalDamping([0.01])))
    driven = scene.of_parts(*scene.effects, jr.Unbalance(0.5, 1.0, 1e-5))
    found = jr.response_peaks(driven, np.linspace(20.0, 2000.0, 100))
    assert not found.critical.speeds.size and 250.0 < found.speeds[0] < 400.0


def test_reductions_refuse_controllers():
    """An integrator is no pin at the sensor, which its static stiffness would make it."""
    with pytest.raises(ValueError, match="that of linear_magnetic_bearing comes from controllers"):
        jr.reduction(jr.linearized(machine()), 0.5)
    with pytest.raises(ValueError, match="`ki .*must be positive, but is 0"):
        machine(ki=0.0)
