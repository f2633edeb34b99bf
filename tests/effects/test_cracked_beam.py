"""A crack as a hinge of a flexible shaft: frequencies, deflections and orbits of a cracked beam."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import central
from scipy.integrate import solve_ivp
from scipy.linalg import eigvals

import jaxrotor as jr
from jaxrotor.shafts.hinge import hinge


YOUNG, DIAMETER, LENGTH, DENSITY, WEIGHT = 2e11, 0.02, 1.0, 7800.0, 9.81
RIGIDITY = YOUNG * np.pi * DIAMETER**4 / 64
PER_LENGTH = DENSITY * np.pi * DIAMETER**2 / 4
GAMMA = 0.1  # compliance times EI / L
COMPLIANCE = GAMMA * LENGTH / RIGIDITY
PINS = [jr.Constraint(0.0), jr.Constraint(LENGTH)]
CLAMPS = [jr.Constraint(0.0, "clamp"), jr.Constraint(LENGTH, "clamp")]
FREQUENCIES = {  # of an open hinge, times sqrt(m L^4 / EI), by exact beam functions
    0.5: {0: 9.00781862956, 2: 82.0754148252},
    0.3: {0: 9.27463138239, 1: 36.6457245595, 2: 88.1737478990},
}
MASS, RATIO = 10.0, 0.05
STIFF = 48 * RIGIDITY / LENGTH**3
NATURAL = np.sqrt(STIFF / MASS)


def beam(*effects, at=0.5, nodes=8, constraints=PINS, density=DENSITY, speed=100.0, **shaft):
    """A uniform shaft with a crack whose compliances are equal, so that an open one is a hinge."""
    given = {"rotary_inertia": False} | shaft
    shaft = jr.FlexibleShaft(
        LENGTH,
        DIAMETER,
        jr.Material(YOUNG, density, YOUNG / 2.6),
        nodes=nodes,
        constraints=constraints,
        **given,
    )
    crack = jr.Crack(at * LENGTH, compliance=COMPLIANCE, compliance_across=COMPLIANCE)
    return jr.Scene(shaft, jr.Gravity(WEIGHT), crack, *effects, spin=jr.ConstantSpeed(speed))


def opened(scene):
    """Equations, and the stiffness `K - K t c t'K / (1 + c t'K t)` of an open hinge."""
    system = jr.assemble(scene)
    row, column, stiffness = hinge(system.line, scene.of(jr.Crack)[0].at)
    softer = COMPLIANCE / (1 + COMPLIANCE * float(stiffness))
    return system, np.asarray(system.blocks.stiffness) - softer * np.outer(column, row)


def flexibility(scene, at=0.5):
    """Deflection at a station by a unit force there."""
    system, stiffness = opened(scene)
    place = jnp.asarray(at * LENGTH)
    return float(system.line.row(place) @ np.linalg.solve(stiffness, system.line.column(place)))


# === an open hinge


@pytest.mark.slow
@pytest.mark.parametrize("at", FREQUENCIES)
def test_frequencies_of_an_open_hinge(at):
    """The error falls with the third power of the nodes; odd modes of a hinge in the middle have none."""

    def found(nodes):
        system, stiffness = opened(beam(at=at, nodes=nodes))
        squares = eigvals(stiffness, np.asarray(system.blocks.inertia)).real
        return np.sqrt(np.sort(squares) * PER_LENGTH * LENGTH**4 / RIGIDITY)

    numbers, wanted = np.array([*FREQUENCIES[at]]), np.array([*FREQUENCIES[at].values()])
    coarse, fine = (np.abs(found(nodes)[numbers] / wanted - 1) for nodes in (8, 16))
    assert coarse[0] < 6e-6 and coarse.max() < 3e-4
    assert (coarse > 6 * fine).all()
    if at == 0.5:
        assert found(8)[1] == pytest.approx(4 * np.pi**2, rel=1e-9)


def test_sag_and_stiffness_with_an_open_hinge():
    """`(5/384 + gamma/32) q L^4 / EI` under the weight, `k / k_0 = 1 / (1 + 48 gamma / 16)` in the middle.

    Deflections at rest are exact: nodes have those of the jump. At 0.3 L the moment is 0.15 P L.
    """
    scene = beam()
    system, stiffness = opened(scene)
    load = np.asarray(system.load.constant).imag
    sag = -float(system.line.row(jnp.asarray(0.5)) @ np.linalg.solve(stiffness, load))
    wanted = (5 / 384 + GAMMA / 32) * PER_LENGTH * WEIGHT * LENGTH**4 / RIGIDITY
    assert sag == pytest.approx(wanted, rel=1e-9)
    assert flexibility(scene) * STIFF == pytest.approx(1 + 48 * GAMMA / 16, rel=1e-9)
    off = beam(jr.Disc(0.5, 1e-9), at=0.3)
    assert 1 / (flexibility(off) * STIFF) == pytest.approx(0.9025270758, abs=1e-9)


@pytest.mark.slow
def test_stiffness_of_other_shafts():
    """Clamped at both ends, with shear, free on springs, and beside a casing: `1 / k` with a hinge.

    A hinge in the middle of a clamped beam, `M = P L / 8` without it, is held by `EI / L` of the beam.
    Without a compliance the sag is that of the intact beam.
    """
    shut = beam().replace({"crack.compliance": 0.0, "crack.compliance_across": 0.0})
    whole = 5 / 384 * PER_LENGTH * WEIGHT * LENGTH**4 / RIGIDITY
    found = jr.harmonic_balance(shut, harmonics=2, at=0.5).displacement[0, 0]
    assert complex(found) == pytest.approx(-1j * whole, rel=1e-9)
    size = LENGTH**3 / RIGIDITY
    clamped = size * (1 / 192 + GAMMA / 64 / (1 + GAMMA))
    assert flexibility(beam(constraints=CLAMPS)) == pytest.approx(clamped, rel=1e-8)
    turning = GAMMA / 16 * size
    sheared = beam(shear=True, rotary_inertia=True)
    system = jr.assemble(sheared)
    middle = jnp.asarray(0.5)
    whole = np.linalg.solve(system.blocks.stiffness, system.line.column(middle))
    own = float(system.line.row(middle) @ whole)
    assert flexibility(sheared) - own == pytest.approx(turning, rel=1e-7)
    springs = [jr.Support(0.0, 1e6), jr.Support(LENGTH, 3e6)]
    free = flexibility(beam(*springs, constraints=()))
    wanted = 1 / 48 * size + turning + (1e-6 + 1e-6 / 3) / 4
    assert free == pytest.approx(wanted, rel=1e-8)
    beside = [jr.Casing("box", 5.0), jr.Support(of="box", stiffness=1e6)]
    assert flexibility(beam(*beside)) == pytest.approx(1 / 48 * size + turning, rel=1e-8)


# === orbits


def rotor(breathing="mayes", across=0.02, speed=0.6 * NATURAL, nodes="auto", **values):
    """A disc in the middle of a shaft, cracked there."""
    weak = {"compliance": COMPLIANCE, "breathing": breathing}
    if breathing != "response":
        weak["compliance_across"] = across * LENGTH / RIGIDITY
    whole = beam(nodes=nodes, speed=speed, **values)
    return jr.Scene(
        whole.shaft,
        jr.Gravity(WEIGHT),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, 2 * RATIO * np.sqrt(STIFF * MASS)),
        jr.Crack(0.5, **weak),
        spin=whole.spin,
    )


def rates(time, y, breathing, speed, weight):
    """A mass on `k_0 / (1 + f c k_0 mu^2)` along both turning axes, moments `mu = L / 4` a load."""
    z, v = y[0] + 1j * y[1], y[2] + 1j * y[3]
    turn = np.exp(1j * speed * time)
    zeta = z / turn
    f = (1 - np.sin(speed * time)) / 2 if breathing == "mayes" else float(zeta.real > 0)
    across = 0.02 if breathing == "mayes" else 0.0
    along, aside = (STIFF / (1 + f * c * 48 / 16) for c in (GAMMA, across))
    force = -(along * zeta.real + 1j * aside * zeta.imag) * turn
    a = force / MASS - 2 * RATIO * NATURAL * v - 1j * weight
    return [v.real, v.imag, a.real, a.imag]


@pytest.mark.slow
def test_orbit_of_a_light_shaft_is_that_of_a_mass():
    """Its stiffness is linear in the compliance, not in the opening of the crack; against DOP853."""
    speed = 0.6 * NATURAL
    turned = lambda y, weight: solve_ivp(
        rates,
        (0, 2 * np.pi / speed),
        y,
        "DOP853",
        args=("mayes", speed, weight),
        rtol=1e-11,
        atol=1e-14,
    ).y[:, -1]
    matrix = np.stack([turned(y, 0.0) for y in np.eye(4)], axis=1)
    x, y, *_ = np.linalg.solve(np.eye(4) - matrix, turned(np.zeros(4), WEIGHT))
    found = jr.harmonic_balance(rotor(density=1e-3), harmonics=12, at=0.5)
    assert abs(complex(found.displacement[0, 0]) - (x + 1j * y)) < 1e-6 * abs(x + 1j * y)


@pytest.mark.slow
def test_a_shaft_that_opens_by_its_moment():
    """In time, from rest, against DOP853 of a mass; implicit steps are the default."""
    speed = 0.6 * NATURAL
    end = 3.0 / NATURAL
    scene = rotor("response", density=1e-3)
    run = jr.run_up(scene, np.array([0.0, end]), start=jr.AtRest(), at=0.5)
    assert run.solver.startswith("Kvaerno5")
    y = solve_ivp(
        rates,
        (0, end),
        np.zeros(4),
        "DOP853",
        args=("response", speed, WEIGHT),
        rtol=1e-10,
        atol=1e-15,
    ).y[:, -1]
    assert abs(complex(run.displacement[-1, 0]) - (y[0] + 1j * y[1])) < 1e-5 * abs(y[0] + 1j * y[1])
    with pytest.raises(ValueError, match="Reactions are those of forces at stations"):
        jr.reactions(run)


@pytest.mark.slow
def test_shooting_resolves_the_fastest_mode():
    """Three nodes a span are those of 2400 steps a turn; more are refused, as they would need more."""
    scene = rotor()
    scene = scene.of_parts(*scene.effects, jr.ExternalDamping(5.0))
    coarse = scene.with_nodes(3)
    fine, orbit = (jr.harmonic_balance(one, harmonics=12, at=0.5) for one in (scene, coarse))
    near = complex(orbit.displacement[0, 0])
    assert abs(complex(fine.displacement[0, 0]) - near) < 1e-3 * abs(near)
    how = {"solver": jr.Exponential(4), "steps_per_revolution": 2400, "at": 0.5}
    found = jr.periodic(coarse, orbit.start, **how)
    assert found.stable
    assert abs(complex(found.displacement[0, 0]) - near) < 1e-6 * abs(near)
    with pytest.raises(RuntimeError, match="The hinge of `crack` moves modes of the shaft"):
        jr.periodic(scene, fine.start, **how)


@pytest.mark.slow
def test_derivatives_of_an_orbit_by_compliances():
    """And by the station of the crack, where nothing else is."""
    disc, damper = jr.Disc(0.5, MASS), jr.DiscDamping(0.5, 300.0)
    scene = beam(disc, damper, at=0.3, speed=40.0)
    paths = ("crack.compliance", "crack.compliance_across", "crack.at")
    values = jnp.array([COMPLIANCE, COMPLIANCE / 3, 0.3])

    @jax.jit
    def push(values, along):
        def own(values):
            there = scene.replace(dict(zip(paths, values, strict=True)))
            z = jr.harmonic_balance(there, harmonics=8, at=0.5).displacement[0, 0]
            return 1e3 * jnp.stack([z.real, z.imag])

        return jax.jvp(own, (values,), (along,))

    for along in jnp.diag(values):
        slopes = push(values, along)[1]
        away = lambda k, along=along: push(values + k * 1e-3 * along, along)[0]
        size = float(jnp.abs(slopes).max())
        np.testing.assert_allclose(central(away, 1e-3), slopes, rtol=0, atol=1e-6 * size)


# === what is refused


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: beam(at=0.001), "crack at 0.001 m bends the shaft, but no spans of it meet there"),
        (lambda: beam(constraints=[*PINS, jr.Constraint(0.501)]), "no spans of it meet there"),
        (lambda: beam(rule="trapezoid", rotary_inertia=True), "no spans of it meet there"),
        (lambda: beam(constraints=[*PINS, jr.Constraint(0.5, "guide")]), "a guide of the shaft holds"),
        (lambda: beam(anisotropy=0.1), "needs a round shaft"),
        (lambda: beam(jr.InternalDamping(1e-4)), "so the internal_damping would damp it wrongly"),
        (lambda: beam(jr.RayleighDamping(0.0, 1e-4)), "so the rayleigh_damping would damp it"),
        (lambda: beam(jr.Crack(0.7, compliance=1e-4)), "Two hinges of the shaft, as by cracks"),
    ],
)  # fmt: skip
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_two_hinges_with_a_station_between_them():
    beam(jr.Disc(0.6, 0.0), jr.Crack(0.7, compliance=1e-4))
