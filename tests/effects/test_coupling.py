"""Couplings: 2X of a misaligned line, instability by a stiffness that turns, torque, a floating disc."""

import json

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import check_by_each
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor.cli import app
from jaxrotor.equations.system import assemble, structure


M, K, C = 12.0, 1.6e6, 300.0
KS, KD, D = 8e5, 2.5e5, 2e-4 * np.exp(0.6j)
BODY = 20.0, 4e6, 500.0  # the second line: m [kg], k [N/m], c [N s/m]
FINEST = {"solver": dfx.Dopri8(), "controller": dfx.PIDController(rtol=1e-11, atol=1e-13)}


def machine(speed, *parts, body=False, disc=None, **changed):
    """A disc whose line is misaligned with one that is held, or a body; with a floating `disc` [kg]."""
    on = "second line" if body else None
    beside = [jr.Casing("second line", BODY[0]), jr.Support(None, *BODY[1:], of="second line")]
    placed = {"offset": abs(D), "direction": np.angle(D), "on": on} | changed
    coupling = jr.Coupling(0.5, KS, KD / KS, **placed) if disc is None else None
    oldham = None if disc is None else jr.OldhamCoupling(0.5, disc, **placed)
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, K),
        jr.Disc(0.5, M),
        jr.DiscDamping(0.5, C),
        *(beside if body else ()),
        coupling or oldham,
        *parts,
        spin=speed if isinstance(speed, jr.Drive | jr.SpeedProfile) else jr.ConstantSpeed(speed),
    )


def response(scene, at=0.5):
    """`z_0` and `z_2` [um]."""
    found = jr.weight_response(scene, scene.spin.speed, at)
    return 1e6 * np.array([found.deflection[0, 0], found.twice[0, 0]])


# === steady motion: shared/spec/11-elements.md, section 6


def test_beside_a_line_that_is_held():
    slow, fast = response(machine(150.0)), response(machine(400.0))
    expected = [52.9232008488 + 35.9816577016j, 20.1520653939 - 15.9472690377j]
    np.testing.assert_allclose(slow, expected, rtol=0, atol=2e-10)
    np.testing.assert_allclose(fast[1], -5.3344095406 + 3.3058838569j, rtol=0, atol=2e-10)


def test_beside_a_body_and_what_it_costs():
    """The drive makes good the losses, by the torque, whose mean is `-2 k_d Im(u_0 u_2)`."""
    scene = machine(150.0, body=True)
    shaft, body = response(scene), response(scene, "second line")
    np.testing.assert_allclose(shaft[1], 15.5843222994 - 12.4472338053j, rtol=0, atol=2e-10)
    np.testing.assert_allclose(body[1], -4.0169709240 + 2.5784173684j, rtol=0, atol=2e-10)
    u_0, u_2 = 1e-6 * (body - shaft) + np.array([D, 0])
    power = 150.0 * KD * 2 * np.imag(u_0 * u_2)
    losses = (2 * 150.0) ** 2 * np.sum(
        np.array([C, BODY[2]]) * np.abs(1e-6 * np.array([shaft[1], body[1]])) ** 2
    )
    np.testing.assert_allclose([power, losses], 0.0117660208541, rtol=2e-11)


def test_floating_disc():
    found = response(machine(300.0, disc=1.5))
    expected = [-13.9275385016 - 9.5283417385j, -8.5262434704 + 5.0406702048j]
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-10)
    # Weight: half the disc's on each hub, -i m_c G (1 +- e^(2i theta)) / 2, and that of the rotor.
    heavy = response(machine(300.0, jr.Gravity(9.81), disc=1.5)) - found
    back = K - 4 * M * 300.0**2 + 2j * C * 300.0
    expected = [-1j * (M + 0.75) * 9.81 / K, -0.75j * 9.81 / back]
    np.testing.assert_allclose(heavy, 1e6 * np.array(expected), rtol=0, atol=1e-12)


def test_unbalance_couples_with_its_own_conjugate():
    """`(k + k_s - m w^2 + i c w) z_1 + k_d z_1* = m e w^2`, whatever the misalignment."""
    rotor, w = machine(400.0, jr.Unbalance(0.5, M, 2e-5, 0.8)), 400.0
    found = jr.unbalance_response(rotor, w, 0.5)
    z, load = complex(found.forward[0, 0]), M * 2e-5 * w**2 * np.exp(0.8j)
    left = (K + KS - M * w**2 + 1j * C * w) * z + KD * z.conjugate()
    assert abs(left - load) < 1e-12 * abs(load) and found.backward[0, 0] == 0
    q, v = jr.steady_state(rotor)
    z_0, z_2 = 1e-6 * response(rotor)
    np.testing.assert_allclose(q, z_0 + z + z_2, rtol=1e-13)
    np.testing.assert_allclose(v, 1j * w * (z + 2 * z_2), rtol=1e-13)


@pytest.mark.parametrize(
    ("body", "edges"),
    [(False, (426.7382531301, 466.1217258566)), (True, (498.8403920588, 550.4526920847))],
)
def test_unstable_between(body, edges):
    found = jr.stability_crossings(machine(100.0, body=body), (350.0, 600.0), 40)
    assert [lost for _, lost in found] == [True, False]
    np.testing.assert_allclose([float(one.speed) for one, _ in found], edges, rtol=1e-12)


def test_without_anisotropy_it_is_a_steady_load():
    """Two roots a coordinate, as of any isotropic rotor, until the anisotropy has a value."""
    scene = machine(150.0).replace({"coupling.anisotropy": 0.0})
    blocks, load = structure(scene).blocks, structure(scene).load
    assert blocks.rotating_stiffness is None and load.twice is None and load.twist is None
    np.testing.assert_allclose(response(scene), [1e6 * KS * D / (K + KS), 0.0], rtol=1e-13)
    there = scene.replace({"coupling.anisotropy": KD / KS})
    np.testing.assert_allclose(response(there), response(machine(150.0)), rtol=1e-13)


def test_mirror():
    """Turned round and mirrored, the answer is the conjugate, see section 7.1 of the sheet."""
    placed = {"angle": 0.3, "offset": 2e-4}
    one, other = machine(150.0, direction=0.6, **placed), machine(-150.0, direction=-0.6, **placed)
    other = other.replace({"coupling.angle": -0.3})
    np.testing.assert_allclose(response(other), response(one).conj(), rtol=1e-13)


def test_derivatives_by_every_number():
    slopes = {"angular_stiffness": 4e4, "tilt": 5e-4, "tilt_direction": -1.0}
    scene = machine(150.0, body=True, angle=0.3, **slopes)
    shaft, disc = jr.MasslessShaft(1.0, 0.5, K, -2e5, 1e5), jr.Disc(0.5, M, 0.4, 0.1)
    scene = jr.Scene(shaft, disc, *scene.effects[1:], spin=scene.spin)
    oldham = machine(150.0, jr.Gravity(9.81), disc=1.5, body=True, angle=0.3)
    names = "stiffness", "anisotropy", "angle", "offset", "direction"
    for rotor, paths in (
        (scene, [f"coupling.{name}" for name in (*names, *slopes)]),
        (oldham, [f"oldham_coupling.{name}" for name in ("mass", *names[2:])]),
    ):

        def parts(values, rotor=rotor, paths=paths):
            found = jr.weight_response(
                rotor.replace(dict(zip(paths, values, strict=True))), 150.0, 0.5
            )
            z = 1e6 * jnp.stack([found.deflection, found.twice]).ravel()
            return jnp.concatenate([z.real, z.imag])

        check_by_each(parts, jnp.stack([rotor.get(path) for path in paths]), 1e-3, 1.0)


@pytest.mark.slow
def test_shipped_scene_and_the_command():
    range_ = ["--to", "560", "--points", "41"]
    answer = CliRunner().invoke(app, ["response", "misaligned-coupling", "--json", *range_])
    found = json.loads(answer.stdout)
    (twice,), edges = found["twice"], [one for one in found["margins"] if one["speed"] > 450.0]
    assert twice == pytest.approx(1e-6 * abs(15.5843222994 - 12.4472338053j), rel=1e-11)
    assert [one["speed"] for one in edges] == pytest.approx([498.8403920588, 550.4526920847])
    assert all(one["amplification"] is None for one in edges)  # unbounded there
    assert "2X" not in CliRunner().invoke(app, ["response", "two-discs", "--points", "41"]).stdout


# === motions


@pytest.mark.slow
def test_motions_agree():
    """Exact motion, steps through contact and with unequal bearings, an integration; an orbit closes."""
    scene = machine(400.0)
    start = jr.Launch(jr.Continued(*jr.steady_state(scene)))
    z = np.asarray(jr.simulate(scene, 3, 64, start=start).displacement[:, 0])
    theta = 2 * np.pi * np.arange(z.size) / 64
    z_0, z_2 = response(scene)
    np.testing.assert_allclose(1e6 * z, z_0 + z_2 * np.exp(2j * theta), rtol=0, atol=1e-9)
    orbit = jr.periodic(scene, start)
    assert orbit.residual < 1e-9 and np.abs(orbit.multipliers).max() < 1
    ends = np.linspace(0.0, 2 * 2 * np.pi / 150.0, 3)
    for part in (jr.Support(0.5, 1e5, 10.0, 0.3), jr.Limiter(0.5, 0.4, 5e-5, 4e5, 40.0)):
        rotor = machine(150.0, part)
        steps = jr.Exponential(4, located=isinstance(part, jr.Limiter))
        stepped = jr.simulate(rotor, 2, 512, solver=steps).displacement[-1, 0]
        integrated = jr.simulate(rotor, times=ends, **FINEST).displacement[-1, 0]
        assert abs(stepped - integrated) < 1e-12


def test_reactions_at_rest():
    """Pins of a beam share the pull of the coupling, `k z = k_s (1 +- anisotropy) (d - z)` each way."""
    length, diameter, share = 1.0, 0.04, 0.4
    pins = jr.Constraint(0.0), jr.Constraint(length)
    shaft = jr.FlexibleShaft(length, diameter, constraints=pins, nodes=5, shear=False)
    coupling = jr.Coupling(0.5, KS, share, offset=abs(D), direction=np.angle(D))
    scene = jr.Scene(shaft, jr.Disc(0.5, M), coupling, spin=jr.ConstantSpeed(150.0))
    found = jr.reactions(jr.simulate(scene, 1, keep=1))
    k = 48 * jr.steel().youngs_modulus * np.pi * diameter**4 / 64 / length**3
    place = lambda d, ks: d * ks / (k + ks)
    z = place(D.real, KS * (1 + share)) + 1j * place(D.imag, KS * (1 - share))
    np.testing.assert_allclose(found.static, [k * z, -k * z / 2, -k * z / 2], rtol=1e-9)


def test_reactions_of_a_coupling():
    """Its force and moment by displacement and slope, against the axes that turn."""
    pins = jr.Constraint(0.0), jr.Constraint(1.0)
    shaft = jr.FlexibleShaft(1.0, 0.04, constraints=pins, nodes=5, shear=False)
    placed = {"offset": abs(D), "direction": np.angle(D), "angle": 0.3}
    tilted = {"angular_stiffness": 2e4, "tilt": 1e-3, "tilt_direction": -0.8}
    coupling = jr.Coupling(0.3, KS, 0.4, **placed, **tilted)
    parts = jr.Disc(0.3, M), jr.Unbalance(0.3, M, 1e-4), coupling
    motion = jr.simulate(jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(150.0)), 2, 16, at=0.3)
    found, turn = jr.reactions(motion), np.exp(2j * (motion.angle + 0.3))
    z, slope = motion.displacement[:, 0], motion.slope[:, 0]
    of = lambda k, u: k * (u + 0.4 * turn * u.conj())
    assert found.names[0] == "coupling" and len(found.names) == 3
    np.testing.assert_allclose(found.force[:, 0], of(KS, D - z), rtol=1e-9)
    away = 1e-3 * np.exp(-0.8j) - slope
    np.testing.assert_allclose(found.moment[:, 0], of(2e4, away), rtol=1e-9)


def test_reactions_of_a_floating_disc():
    """`-(m c.. - W)` half by half: what a slot holds of the disc's inertia and weight, across itself."""
    weight, disc, angle = -1j * 9.81, 1.5, 0.3
    pins = jr.Constraint(0.0), jr.Constraint(1.0)
    shaft = jr.FlexibleShaft(1.0, 0.04, constraints=pins, nodes=5, shear=False)
    placed = {"offset": abs(D), "direction": np.angle(D), "angle": angle}
    parts = jr.Disc(0.3, M), jr.Gravity(9.81), jr.OldhamCoupling(0.3, disc, **placed)
    motion = jr.simulate(jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(300.0)), 2, 16)
    found, twice = jr.reactions(motion), np.exp(2j * (np.asarray(motion.angle) + angle))
    c = lambda turn: (D + np.conj(D) * turn) / 2  # its centre from the axis of the shaft
    span = 1e-4
    ahead, behind = (c(twice * np.exp(2j * sign * span)) for sign in (1, -1))
    needed = disc * (300.0**2 * (ahead - 2 * c(twice) + behind) / span**2 - weight)
    # The slot along psi holds what is across it, i.e. (f - f* exp(2 i psi)) / 2 of a force f.
    held = -(needed - np.conj(needed) * twice) / 2
    np.testing.assert_allclose(
        found.of("oldham_coupling"), held, rtol=0, atol=1e-5 * abs(held).max()
    )
    still = disc * (weight - np.conj(weight) * np.exp(2j * angle)) / 2
    np.testing.assert_allclose(found.static[0], still, rtol=1e-12)


@pytest.mark.slow
def test_sweep_steps_lanes_by_the_same_loads():
    rotor = machine(150.0, jr.Limiter(0.5, 0.4, 5e-5, 4e5, 40.0))
    speeds, options = [150.0, 170.0], {"steps_per_revolution": 128, "progress": False}
    over, observe = {"spin.speed": speeds}, [jr.observe.Section()]
    swept = jr.sweep(rotor, over, observe=observe, settle=2, keep=1, error_sample=0, **options)
    z = jr.simulate(rotor.at_speed(speeds[1]), 3, **options).displacement[-1, 0]
    assert abs(complex(*swept["section"].to_numpy()[1].ravel()) - z) < 1e-15


def test_energy_beside_a_free_spin():
    """What the rotor, springs and rotation have together stays: the torque is the potential's slope."""
    k11, k12, k22 = 1.6e6, -2e5, 1e5
    body, moment = 20.0, 0.4
    given = {"angle": 0.3, "offset": 2e-3, "direction": 0.6, "on": "body"}
    given |= {"angular_stiffness": 4e4, "tilt": 5e-3, "tilt_direction": -1.0}
    coupling = jr.Coupling(0.5, KS, 0.6, **given)
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, k11, k12, k22),
        jr.Disc(0.5, M, moment, 0.0),
        jr.Casing("body", body),
        jr.Support(None, 4e6, of="body"),
        coupling,
        spin=jr.Drive(30.0, 0.0, polar=0.05, feedback=True),
    )
    run = jr.run_up(scene, np.linspace(0.0, 0.2, 41), **FINEST)
    q, v = np.asarray(run.coordinates), np.asarray(run.rates)
    line, at = assemble(scene).line, jnp.asarray(0.5)
    z, slope, z_2 = (
        q @ np.asarray(row) for row in (line.row(at), line.slope_row(at), np.eye(3)[2])
    )
    dz, dslope, dz_2 = (
        v @ np.asarray(row) for row in (line.row(at), line.slope_row(at), np.eye(3)[2])
    )
    psi = np.asarray(run.angle) + 0.3
    wound = lambda k, u: k / 2 * (np.abs(u) ** 2 + 0.6 * np.real(np.exp(-2j * psi) * u**2))
    energy = M * np.abs(dz) ** 2 + moment * np.abs(dslope) ** 2 + body * np.abs(dz_2) ** 2
    energy += k11 * np.abs(z) ** 2 + 2 * k12 * np.real(z * slope.conj()) + k22 * np.abs(slope) ** 2
    energy += 4e6 * np.abs(z_2) ** 2 + 0.05 * np.asarray(run.speed) ** 2
    energy = (
        energy / 2
        + wound(KS, 2e-3 * np.exp(0.6j) + z_2 - z)
        + wound(4e4, 5e-3 * np.exp(-1j) - slope)
    )
    turned = 0.05 / 2 * np.asarray(run.speed) ** 2
    assert np.ptp(turned) > 0.1  # J
    assert np.ptp(energy) < 1e-7


def test_floating_disc_at_a_speed_that_changes():
    """Against forces from the path of a disc in two slots, differentiated twice."""
    begin, gain, weight = 60.0, 400.0, -9.81j
    scene = machine(
        jr.SpeedProfile([0.0, 1.0], [begin, begin + gain]), jr.Gravity(9.81), disc=1.5, body=True
    )

    def path(t):
        psi = begin * t + gain * t**2 / 2
        along = jnp.array([jnp.cos(psi), jnp.sin(psi)])
        return along * (along @ jnp.array([D.real, D.imag])), along

    push = jax.jit(jax.jacfwd(jax.jacfwd(lambda t: path(t)[0])))

    def rates(t, y):
        z, z_2, v, v_2 = y[:4] + 1j * y[4:]
        along = complex(*np.asarray(path(t)[1]))
        both = 1.5 * (weight - complex(*np.asarray(push(t))))  # on both hubs together
        slot = np.imag(both * along.conjugate()) * 1j * along  # hub 1 pushes across its slot
        force, other = slot, both - slot
        a = (force + M * weight - K * z - C * v) / M
        b = (other + BODY[0] * weight - BODY[1] * z_2 - BODY[2] * v_2) / BODY[0]
        out = np.array([v, v_2, a, b])
        return np.concatenate([out.real, out.imag])

    times = np.linspace(0.0, 0.1, 5)
    found = solve_ivp(rates, (0, 0.1), np.zeros(8), "DOP853", times, rtol=1e-10, atol=1e-14).y
    start = jr.Launch(jr.Continued(jnp.zeros(2, complex), jnp.zeros(2, complex)))
    run = jr.run_up(scene, times, at=[0.5], start=start, **FINEST)
    np.testing.assert_allclose(
        np.asarray(run.displacement[:, 0]), found[0] + 1j * found[4], rtol=0, atol=1e-10
    )


# === refusals


def test_what_makes_no_coupling_is_refused():
    with pytest.raises(ValueError, match="between -1 and 1, .* but is 1.5"):
        jr.Coupling(0.5, KS, 1.5)
    with pytest.raises(ValueError, match="0.01, but without `angular_stiffness"):
        jr.Coupling(0.5, KS, tilt=0.01)
    with pytest.raises(ValueError, match="no casing 'other'"):
        machine(150.0, on="other")
    with pytest.raises(ValueError, match="drive of the scene has `feedback`"):
        jr.run_up(machine(jr.Drive(30.0, 1.0, polar=1.0, feedback=True), disc=1.5), [0.0, 0.1])
