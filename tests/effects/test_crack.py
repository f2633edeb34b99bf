"""Crack: its energy and symmetries, motions of a mass on a cracked shaft, the order of steps, lanes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cracked_rotor import ACROSS, LOSS, RATIO, crack, machine, rest
from differences import check_by_each
from scipy.linalg import expm

import jaxrotor as jr
from jaxrotor.effects.law import Now


LOCATED = jr.Exponential(4, located=True)


# === law


def places(count=200):
    """Displacements, and angles of rotation [rad]."""
    draw = np.random.default_rng(5)
    return jnp.asarray(draw.uniform(-2, 2, (2, count))), jnp.asarray(draw.uniform(-9, 9, count))


def force_and_torque(law, place, angle):
    still, now = jnp.zeros_like(place), Now(jnp.asarray(1.0), angle)
    force = law(place, still, now)
    return force, law.torque(force, place, still, now)


def laws(**values):
    """Cracks that breathe in every way, and a hinge in a line of some stiffness."""
    hinged = {"loss": None, "loss_across": None, "compliance": 0.4, "compliance_across": 0.1}
    found = {name: crack(name, **values).law() for name in ("mayes", "switch", "response")}
    return found | {"hinge": crack(**hinged, **values).law_within(jnp.asarray(7.0))}


@pytest.mark.parametrize("name", laws())
def test_force_and_torque_are_slopes_of_the_energy(name):
    """`U = -f (Dx xi^2 + De eta^2) / 2`; of a hinge `-f c M_0^2 / (1 + f c 7) / 2` along either axis."""
    law = laws(angle=0.3, tension=-1.2)[name]
    weak, across = (0.4, 0.1) if name == "hinge" else (LOSS, 0.0 if name == "response" else ACROSS)
    kept = 7.0 if name == "hinge" else 0.0

    def energy(place, theta):
        psi = theta + 0.3
        xi = jnp.cos(psi) * place[0] + jnp.sin(psi) * place[1]
        eta = jnp.cos(psi) * place[1] - jnp.sin(psi) * place[0]
        part = jnp.cos(psi + 1.2)
        opened = {"switch": jnp.where(part > 0, 1.0, 0.0), "response": jnp.where(xi > 0, 1.0, 0.0)}
        f = opened.get(name, (1 + part) / 2)
        return -sum(f * c / (1 + f * c * kept) * u**2 for c, u in ((weak, xi), (across, eta))) / 2

    at, turn = places()
    slopes = jax.vmap(jax.grad(energy, (0, 1)), (1, 0))(at, turn)
    force, torque = force_and_torque(law, at, turn)
    np.testing.assert_allclose(force, -slopes[0].T, rtol=0, atol=1e-13)
    np.testing.assert_allclose(torque, -slopes[1], rtol=0, atol=1e-13)
    assert np.abs(torque).max() > 0.01


@pytest.mark.parametrize("name", laws())
def test_mirror_image_and_turned_law(name):
    """Conjugate, with angles reversed, it has the force `F*` and the torque `-T`."""
    (at, turn), flip = places(), jnp.array([[1.0], [-1.0]])
    force, torque = force_and_torque(laws(angle=0.3, tension=-1.2)[name], at, turn)
    mirror, back = force_and_torque(laws(angle=-0.3, tension=1.2)[name], flip * at, -turn)
    np.testing.assert_allclose(mirror, flip * force, rtol=0, atol=1e-14)
    np.testing.assert_allclose(back, -torque, rtol=0, atol=1e-14)
    rotation = jnp.array([[jnp.cos(0.8), -jnp.sin(0.8)], [jnp.sin(0.8), jnp.cos(0.8)]])
    turned, same = force_and_torque(laws(angle=1.1, tension=-0.4)[name], rotation @ at, turn)
    np.testing.assert_allclose(turned, rotation @ force, rtol=0, atol=1e-14)
    np.testing.assert_allclose(same, torque, rtol=0, atol=1e-14)


# === motions


def pieces(speed, angle, turns, ratio=RATIO):
    """State (z, z.) after revolutions from rest at -i, through pieces of constant coefficients.

    In turning axes, of `(xi, eta, xi., eta., 1)`, while the crack is open or closed; weight turns back.
    """
    eye, cross = np.eye(2), np.array([[0.0, -1.0], [1.0, 0.0]])

    def field(opened):
        """Of `zeta`, `zeta.` and the weight `(g_x, g_y)` in the turning axes."""
        stiff = eye - opened * np.diag([LOSS, ACROSS])
        low = np.hstack(
            [
                -stiff + speed**2 * eye - 2 * ratio * speed * cross,
                -2 * ratio * eye - 2 * speed * cross,
                eye,
            ]
        )
        zero = np.zeros((2, 2))
        return np.vstack(
            [np.hstack([zero, eye, zero]), low, np.hstack([zero, zero, -speed * cross])]
        )

    turned = np.exp(-1j * angle)
    start = -1j * turned
    v = -1j * speed * start
    y = np.array([start.real, start.imag, v.real, v.imag, (-1j * turned).real, (-1j * turned).imag])
    psi, end = angle, angle + 2 * np.pi * turns  # closed where sin(psi) > 0
    while psi < end - 1e-12:
        after = min(np.pi * (np.floor(psi / np.pi + 1e-9) + 1), end)
        opened = float(np.sin((psi + after) / 2) < 0)
        y = expm(field(opened) * (after - psi) / speed) @ y
        psi = after
    back = np.exp(1j * angle)
    zeta, rate = y[0] + 1j * y[1], y[2] + 1j * y[3]
    return zeta * back, (rate + 1j * speed * zeta) * back


def end_of(run):
    return np.array([complex(run.displacement[-1, 0]), complex(run.velocity[-1, 0])])


@pytest.mark.slow
def test_located_steps_keep_their_order_through_switches():
    """Against matrix exponentials of the pieces, with switches that no step ends at."""
    scene, exact = machine(0.7, "switch", angle=0.3), np.array(pieces(0.7, 0.3, 3))
    errors = [
        np.abs(
            end_of(jr.simulate(scene, 3, start=rest(), solver=LOCATED, steps_per_revolution=n))
            - exact
        ).max()
        for n in (32, 64, 128)
    ]
    assert errors[-1] < 1e-6
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 3.7).all()


@pytest.mark.slow
def test_located_steps_keep_their_order_through_kinks():
    """A crack that opens by its response; against 2048 steps."""
    scene = machine(0.32, "response")
    ends = [
        end_of(jr.simulate(scene, 2, start=rest(), solver=LOCATED, steps_per_revolution=n))
        for n in (64, 128, 256, 2048)
    ]
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    assert errors[-1] < 1e-5
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 3.5).all()


def test_response_keeps_energy_in_turning_axes():
    """`|zeta.|^2 - s^2 |zeta|^2 + |zeta|^2 - Dx (xi)_+^2`, undamped and without weight."""
    speed = 0.7
    scene = machine(speed, "response", damping=0.0).replace({"gravity.acceleration": 0.0})
    run = jr.simulate(scene, 6, start=rest(), solver=LOCATED, steps_per_revolution=256)
    z, v = run.displacement[:, 0], run.velocity[:, 0]
    zeta = z * np.exp(-1j * run.angle)
    rate = v * np.exp(-1j * run.angle) - 1j * speed * zeta
    opened = np.maximum(zeta.real, 0.0)
    energy = np.abs(rate) ** 2 + (1 - speed**2) * np.abs(zeta) ** 2 - LOSS * opened**2
    assert np.ptp(LOSS * opened**2) > 0.1
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-8)


@pytest.mark.slow
def test_a_rotor_that_turns_freely_keeps_its_energy():
    """The torque of breathing holds the rotor back by what the vibration gains."""
    polar, drive = 4.0, jr.Drive(0.7, 0.0, polar=4.0, feedback=True)
    held = machine(0.7, damping=0.0)
    scene = jr.Scene(held.shaft, *held.effects, spin=drive)
    times = np.linspace(0.0, 30.0, 61)
    run = jr.run_up(scene, times, start=rest(), solver=jr.Exponential(4), substeps=128)
    z, f = np.asarray(run.displacement[:, 0]), (1 - np.sin(run.angle)) / 2
    zeta = z * np.exp(-1j * run.angle)
    lost = f * (LOSS * zeta.real**2 + ACROSS * zeta.imag**2)
    kinetic = np.abs(run.velocity[:, 0]) ** 2 + polar * run.speed**2
    energy = (kinetic + np.abs(z) ** 2 - lost) / 2 + z.imag
    assert np.ptp(polar * run.speed**2) > 0.02
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-6)


NUMBERS = {
    "crack.loss": LOSS,
    "crack.loss_across": ACROSS,
    "crack.angle": 0.3,
    "crack.tension": -1.4,
    "gravity.acceleration": 1.0,
}


@pytest.mark.slow
@pytest.mark.parametrize("breathing", ["mayes", "switch", "response"])
def test_derivatives_of_a_motion_by_all_numbers(breathing):
    numbers = dict(NUMBERS)
    if breathing == "response":  # neither of the two is of account
        del numbers["crack.loss_across"], numbers["crack.tension"]
    scene, values = machine(0.7, breathing), jnp.array(list(numbers.values()))

    def end(values):
        there = scene.replace(dict(zip(numbers, values, strict=True)))
        how = {"solver": LOCATED, "steps_per_revolution": 256}
        run = jr.simulate(there, 2, start=rest(), **how)
        z = run.displacement[-1, 0]
        return jnp.stack([z.real, z.imag])

    check_by_each(end, values, 1e-3, least=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("breathing", ["mayes", "switch"])
def test_lanes_are_runs(breathing):
    """Of losses, angles and speeds."""
    scene = machine(0.7, breathing, eccentricity=0.1)
    over = {"crack.loss": [0.1, LOSS], "crack.angle": [0.0, 0.3], "spin.speed": [0.7, -1.3]}
    how = {"start": rest(), "solver": LOCATED, "steps_per_revolution": 256}
    found = jr.sweep(scene, over, settle=2, keep=1, error_sample=0, **how)
    for place in np.ndindex(2, 2, 2):
        here = {path: values[k] for (path, values), k in zip(over.items(), place, strict=True)}
        run = jr.simulate(scene.replace(here), 3, **how)
        z = complex(run.displacement[-1, 0])
        np.testing.assert_allclose(found.section[place][-1], [z.real, z.imag], rtol=0, atol=1e-10)


def test_no_loss_leaves_the_shaft_as_it_is():
    run = lambda scene: jr.simulate(scene, 2, start=rest(), solver=jr.Exponential(4))
    whole = machine(0.7, eccentricity=0.1)
    none = run(whole.replace({"crack.loss": 0.0, "crack.loss_across": 0.0}))
    plain = run(whole.without("cracks"))
    np.testing.assert_allclose(none.displacement, plain.displacement, rtol=0, atol=1e-12)


# === what is refused


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: crack("response", loss_across=0.05), "response has no `loss_across`, but it is 0.05"),
        (lambda: jr.Crack(0.5), "needs either `loss .N/m.`"),
        (lambda: crack(compliance=1.0), "needs either `loss .N/m.`"),
        (lambda: crack(compliance_across=1.0), "needs either `loss .N/m.`"),
        (lambda: jr.roots(machine(0.7)), "Cracks .crack. breathe as the shaft turns"),
        (lambda: jr.floquet_multipliers(machine(0.7)), "take `jaxrotor.periodic`, whose multipliers"),
        (
            lambda: jr.unbalance_response(machine(0.7, eccentricity=0.1), [0.7]),
            "or take the crack as closed",
        ),
        (lambda: jr.harmonic_balance(machine(0.7, "switch")), "Harmonic balance takes smooth"),
    ],
)  # fmt: skip
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
