"""Section 4 of the sheet: each hard case is right, or refused in a sentence."""

import contextlib
import os
import subprocess
import sys

import diffrax as dfx
import garbage
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jeffcott import stop_force
from scipy.linalg import expm

import jaxrotor as jr
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.equations.system import assemble
from jaxrotor.solvers.choice import choose


LENGTH, UNIT = 0.7, 0.022646559709295067
ROTOR = jr.load("limiter-rotor")
LINEAR = ROTOR.without("limiters")
FEW = ROTOR.with_nodes(3)  # for what does not look at digits of the rotor
WHIRL = jr.Whirl(0.012 * LENGTH, -10 / UNIT)


def tip(response: jr.TimeHistory) -> np.ndarray:
    return np.asarray(response.displacement[:, 0])


# === 1 and 2: the centre, and gradients


@pytest.mark.slow
@pytest.mark.hard("1.1 at rest in the centre: the whirl index is 0/0", outcome="flagged")
def test_rest_in_the_centre_is_undefined_whirl_not_a_number_elsewhere():
    ds = jr.sweep(
        FEW,
        {"unbalance.eccentricity": [0.0, 1e-4]},
        settle=3,
        keep=3,
        observe=(*jr.observe.everything(), jr.observe.Contact()),
        steps_per_revolution=64,
        error_sample=0,
    )
    still = ds.isel({"unbalance.eccentricity": 0})
    assert int(still.status) == 2
    assert ds.status.values.tolist() == [2, 0]
    for name in ("index", "winding", "whirl_rate"):
        assert np.isnan(still[name])
        assert np.isfinite(ds[name][1])
    for name in ("section", "radius_min", "radius_max", "radius_rms", "duty", "peak_force"):
        assert np.all(still[name].values == 0)


@pytest.mark.slow
@pytest.mark.hard("1.1 at rest in the centre it stays")
def test_rest_in_the_centre_stays_there():
    r = jr.simulate(FEW, 3, 64)
    for part in (r.displacement, r.velocity, r.slope, r.contact_force):
        assert np.all(np.asarray(part) == 0)


@pytest.mark.slow
@pytest.mark.hard("1.2 gradients beside a contact that is not there")
def test_gradient_from_rest_in_the_centre_is_finite():
    paths = ("limiters.gap", "limiters.stiffness", "unbalance.eccentricity")

    def end(values):
        r = jr.simulate(FEW.replace(values), 1, 32)
        return jnp.real(r.displacement[-1, 0]) + jnp.imag(r.displacement[-1, 0])

    push = jax.jit(lambda values, along: jax.jvp(end, (values,), (along,))[1])
    values = {path: jnp.asarray(FEW.get(path)).ravel()[0] for path in paths}
    for path in paths:
        along = {one: jnp.asarray(float(one == path)) for one in paths}
        assert np.isfinite(float(push(values, along)))


# === 3: several stops, grazing


@pytest.mark.slow
@pytest.mark.hard("1.3 two and three stops at once")
@pytest.mark.parametrize("count", [2, 3])
def test_several_stops_at_once(count):
    """Pressed by weight between stops that all touch: the static balance of forces."""
    angles = {2: [-2.0, -1.2], 3: [-2.0, -1.6, -1.2]}[count]
    stops = [jr.Limiter(LENGTH, a, 1e-4, 2e5, 200.0, 0.1, rim_radius=0.1) for a in angles]
    rest = [e for e in LINEAR.effects if not isinstance(e, jr.InternalDamping)]
    scene = jr.Scene(
        jr.FlexibleShaft(LENGTH, 0.02, nodes=4, constraints=[jr.Constraint(0.0, "clamp")]),
        *rest,
        jr.Gravity(),
        *stops,
        spin=jr.ConstantSpeed(100.0),
    )
    r = jr.simulate(scene, 150, 128, keep=1)
    z = tip(r)
    assert np.ptp(z.real) < 1e-9
    active = np.asarray(r.contact_force)[-1] != 0
    assert active.sum() == count
    # tip stiffness 3 EI / l^3, and the deflection by weight of disc and shaft
    stiffness = 3 * 2.1e11 * np.pi * 0.02**4 / 64 / LENGTH**3
    mass = 7850 * np.pi * 0.02**2 / 4 * LENGTH
    weight = -9.80665j * (2.4661502330679883 + 3 / 8 * mass)
    assert stiffness * z[-1] == pytest.approx(weight + stop_force(scene)(z[-1], 0j), rel=1e-7)


@pytest.mark.slow
@pytest.mark.hard("1.3 grazing")
def test_grazing(record_property):
    """A circular orbit whose radius is the gap to within 1e-9: no more than a touch."""
    few = {"shaft.nodes": 2, "spin.speed": 300.0, "unbalance.eccentricity": 1e-4}
    linear = LINEAR.replace(few)
    radius = float(abs(jr.unbalance_response(linear, 300.0).forward[0, 0]))
    free = jr.simulate(linear, 400, 64, keep=1)
    scene = ROTOR.replace(few)
    for depth in (-1e-9, 0.0, 1e-9):
        grazing = scene.replace({"limiters.gap": radius * (1 - depth)})
        r = jr.simulate(grazing, 5, 64, start=free.end)
        error = abs(abs(tip(r)) - radius).max() / radius
        record_property("measured", f"off the free circle by {error:.0e} of it")
        assert error < 1e-5
        assert np.all(np.isfinite(np.asarray(r.velocity)))


# === 4: stiffness, gap, friction


@pytest.mark.slow
@pytest.mark.hard("1.4 stops of 10 to 1e7 of the shaft's stiffness")
@pytest.mark.parametrize("kappa", [1e1, 1e3, 1e5, 1e7])
def test_stops_from_soft_to_rigid(kappa):
    stiffness = kappa * 1649.336143 / LENGTH**3
    scene = ROTOR.replace({"limiters.stiffness": stiffness})
    rigid = pytest.warns(jr.FewStepsWarning, match="`limiters.[012]` was touched with [5-9]")
    with rigid if kappa == 1e7 else contextlib.nullcontext():
        r = jr.simulate(scene, 12, 4096, start=WHIRL, keep=5)
    z = tip(r)
    assert np.all(np.isfinite(z))
    assert abs(z).max() < 0.1 * LENGTH
    local = z[:, None] * np.exp(-1j * np.array([float(e.angle) for e in ROTOR.of(jr.Limiter)]))
    deepest = local.real.max() - 0.0075
    if kappa >= 1e3:  # about v sqrt(M / k)
        assert deepest < 3 * 10.0 * np.sqrt(2.47 / stiffness)


@pytest.mark.slow
@pytest.mark.hard("1.4 stops of 10 to 1e7 of the shaft's stiffness")
def test_moderate_stiffness_against_an_implicit_solver(record_property):
    scene = FEW.replace({"limiters.stiffness": 30 * 1649.336143 / LENGTH**3})
    fine = jr.simulate(scene, 2, 2048, start=WHIRL, solver=jr.Exponential(4))
    other = jr.simulate(scene, 2, 128, start=WHIRL, solver=dfx.Kvaerno5())
    error = abs(tip(fine)[::16] - tip(other)).max() / abs(tip(fine)).max()
    record_property("measured", f"{error:.0e} from an implicit solver")
    assert error < 1e-4


@pytest.mark.hard("1.4 zero gap")
def test_zero_gap_touches_always():
    r = jr.simulate(FEW.replace({"limiters.gap": 0.0}), 20, 512, start=WHIRL, keep=10)
    assert np.all(np.isfinite(tip(r)))
    touching = np.abs(np.asarray(r.contact_force)).max(axis=1) > 0
    assert touching.mean() > 0.4


@pytest.mark.slow
@pytest.mark.hard("1.4 friction above 1 and rolling")
@pytest.mark.parametrize("friction", [1.0, 3.0])
@pytest.mark.parametrize("slip", [None, 1.0])
def test_strong_friction_and_rolling(friction, slip):
    scene = FEW.replace({"limiters.friction": friction})
    if slip is not None:
        scene = scene.replace({"limiters.slip": slip})
    r = jr.simulate(scene, 40, 1024, start=WHIRL, keep=10)
    assert np.all(np.isfinite(tip(r)))
    assert abs(tip(r)).max() < LENGTH


# === 5: speed and damping


@pytest.mark.hard("1.5 zero speed without a period", outcome="refused")
def test_zero_speed_needs_a_period():
    still = ROTOR.replace({"spin.speed": 0.0})
    with pytest.raises(ValueError, match="give `period`"):
        jr.simulate(still, 1)
    with pytest.raises(ValueError, match="zero speed only"):
        jr.simulate(ROTOR, 1, period=0.1)
    with pytest.raises(ValueError, match="must be positive"):
        jr.simulate(still, 1, period=-1.0)


@pytest.mark.slow
@pytest.mark.hard("1.5 zero speed")
def test_zero_speed_against_the_matrix_exponential(record_property):
    still = LINEAR.replace({"spin.speed": 0.0})
    r = jr.simulate(still, 2, 16, start=jr.Whirl(1e-3, 50.0), period=0.1)
    system = assemble(still)
    blocks = system.blocks
    assert blocks.inertia is not None
    assert blocks.damping is not None
    n, inverse = system.n, np.linalg.inv(blocks.inertia)
    a = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-inverse @ blocks.stiffness, -inverse @ blocks.damping]]
    )
    start = np.concatenate(jr.Whirl(1e-3, 50.0).state(system, jnp.asarray(LENGTH)))
    row = np.asarray(system.line.row(jnp.asarray(LENGTH)))
    times = [5, 16, 32]
    want = np.array([row @ (expm(a * 0.1 * k / 16) @ start)[:n] for k in times])
    error = abs(tip(r)[times] - want).max()
    record_property("measured", f"{error:.0e} m of 1e-3 m")
    assert error < 1e-12
    assert float(r.time[-1]) == pytest.approx(0.2)


@pytest.mark.slow
@pytest.mark.hard("1.5 speed N = 100")
def test_high_speed(record_property):
    fast = ROTOR.replace({"spin.speed": 100 / UNIT, "internal_damping.voigt_time": 0.0})
    fast = fast.replace({"unbalance.eccentricity": 1e-4})
    r = jr.simulate(fast, 12000, 32, keep=1)
    want = jr.unbalance_response(fast.without("limiters"), 100 / UNIT).forward[0, 0]
    error = abs(tip(r)[-1] / complex(want) - 1)
    record_property("measured", f"relative error {error:.0e}")
    assert error < 1e-4


@pytest.mark.slow
@pytest.mark.hard("1.5 no internal damping")
def test_without_internal_damping_forward_whirl_dies_out():
    scene = FEW.replace({"internal_damping.voigt_time": 0.0})
    r = jr.simulate(scene, 400, 256, start=jr.Whirl(1e-3), keep=1)
    assert abs(tip(r)).max() < 1e-6


def double_root() -> jr.Scene:
    """A rotor whose eigenvectors nearly merge: its damping tuned along the over-damped pair."""
    quiet = LINEAR.replace(
        {
            "spin.speed": 0.0,
            "external_damping.per_length": 0.0,
            "disc_damping.translational": 0.0,
            "disc_damping.angular": 0.0,
        }
    )
    # with Voigt damping alone mode j has lambda^2 + T w^2 lambda + w^2: double at T = 2 / w
    first = abs(np.asarray(jr.roots(quiet.replace({"internal_damping.voigt_time": 0.0}))[0]))
    near = [2 / float(first) * (1 + k * 2e-14) for k in range(-5, 6)]
    return max((quiet.replace({"internal_damping.voigt_time": t}) for t in near), key=merged)


def merged(scene: jr.Scene, period: float = 0.02) -> float:
    """Condition number of the eigenvectors."""
    matrix = Motion(assemble(scene), jnp.asarray(2 * jnp.pi / period)).matrix()
    return float(np.linalg.cond(np.linalg.eig(np.asarray(matrix))[1]))


@pytest.mark.slow
@pytest.mark.hard("1.5 double root of an over-damped pair")
def test_near_a_double_root_the_basis_is_dense_and_right(record_property):
    scene, period = double_root(), 0.02
    rate = jnp.asarray(2 * jnp.pi / period)
    motion = Motion(assemble(scene), rate)
    a = np.asarray(motion.matrix())
    assert merged(scene, period) > 1e5
    chosen = choose(None, assemble(scene), rate)
    assert isinstance(chosen, jr.Exponential)
    assert chosen.basis == "dense"
    start = jr.Whirl(1e-3, 40.0)
    system = assemble(scene)
    q, v = start.state(system, jnp.asarray(LENGTH))
    y = np.concatenate([q, np.asarray(v) / float(rate)])
    row = np.asarray(system.line.row(jnp.asarray(LENGTH)))
    r = jr.simulate(scene, 2, 16, start=start, period=period)
    assert "dense" in r.solver
    times = [3, 16, 32]
    want = np.array([row @ (expm(a * 2 * np.pi * k / 16) @ y)[: system.n] for k in times])
    gap = abs(tip(r)[times] - want)
    record_property("measured", f"{gap.max():.0e} m of 1e-3 m from expm")
    assert np.all(gap < 1e-10 * 1e-3 + 1e-9 * abs(want))


@pytest.mark.slow
@pytest.mark.hard("1.5 double root of an over-damped pair")
def test_dense_basis_equals_modal_where_both_serve(record_property):
    paths = [
        tip(jr.simulate(FEW, 4, 128, start=WHIRL, solver=jr.Exponential(4, basis)))
        for basis in ("modal", "dense")
    ]
    error = abs(paths[0] - paths[1]).max() / abs(paths[0]).max()
    record_property("measured", f"dense beside modal: {error:.0e}")
    assert error < 1e-9


@pytest.mark.hard("1.5 undamped at its critical speed", outcome="refused")
def test_undamped_resonance_is_refused():
    rest = [e for e in LINEAR.effects if isinstance(e, jr.Disc | jr.Unbalance)]
    shaft = jr.FlexibleShaft(LENGTH, 0.02, constraints=[jr.Constraint(0.0, "clamp")])
    bare = jr.Scene(shaft, *rest, spin=jr.ConstantSpeed(70.0)).replace(
        {"unbalance.eccentricity": 1e-4}
    )
    low, high = 50.0, 100.0
    for _ in range(80):  # forward whirl of the first mode = speed
        speed = (low + high) / 2
        whirls = np.asarray(jr.roots(bare.replace({"spin.speed": speed}))).imag
        low, high = (speed, high) if whirls[whirls > 0].min() > speed else (low, speed)
    critical = bare.replace({"spin.speed": speed})
    with pytest.raises(ValueError, match=r"is a critical speed of an undamped mode"):
        jr.simulate(critical, 1)


# === 6: many nodes


@pytest.mark.slow
@pytest.mark.hard("1.6 16 and 20 nodes: no mode grows")
@pytest.mark.parametrize("nodes", [16, 20])
def test_many_nodes_have_no_growing_modes(nodes, record_property):
    shaft = jr.FlexibleShaft(LENGTH, 0.02, nodes=nodes, constraints=[jr.Constraint(0.0, "clamp")])
    fine = jr.Scene(shaft, *ROTOR.effects, spin=ROTOR.spin).replace({"spin.speed": 10 / UNIT})
    values = np.asarray(jr.roots(fine))
    assert values.real.max() < 0
    want = np.array([-0.03236635 + 1.69410001j, -0.19425748 - 1.50011970j])
    error = max(abs(values * UNIT - root).min() for root in want)
    record_property("measured", f"{nodes} nodes: first roots to {error:.0e}")
    assert error < 1e-6
    r = jr.simulate(fine, 20, 256, start=WHIRL, keep=5)
    assert np.all(np.isfinite(tip(r)))
    assert abs(tip(r)).max() < 0.05 * LENGTH
    if nodes == 16:  # the coarse rotor has to be simulated once
        return
    coarse = jr.Scene(
        jr.FlexibleShaft(LENGTH, 0.02, nodes=10, constraints=[jr.Constraint(0.0, "clamp")]),
        *ROTOR.effects,
        spin=fine.spin,
    )
    z = [tip(jr.simulate(s, 2, 1024, start=WHIRL)) for s in (fine, coarse)]
    assert abs(z[0] - z[1]).max() < 1e-2 * abs(z[0]).max()


# === 7: long runs


@pytest.mark.slow
@pytest.mark.hard("1.7 a hundred thousand revolutions")
def test_phase_of_unbalance_after_a_hundred_thousand_revolutions(record_property):
    values = {"spin.speed": 10 / UNIT, "unbalance.eccentricity": 1e-4}
    linear = LINEAR.replace(values)
    want = complex(jr.unbalance_response(linear, 10 / UNIT).forward[0, 0])
    r = jr.simulate(linear, 100_000, 8, keep=1)
    closed = abs(tip(r)[-1] / want - 1)
    assert closed < 1e-10
    assert tip(r)[2] == pytest.approx(1j * want, rel=1e-10)
    # stepped, for the scene has stops, though its orbit stays clear of them
    r = jr.simulate(ROTOR.replace(values), 100_000, 8, keep=1)
    error = abs(np.angle(tip(r)[-1] / want)) / (2 * np.pi)
    record_property("measured", f"phase to {error:.0e} rev stepped")
    assert tip(r)[-1] == pytest.approx(want, rel=1e-10)


@pytest.mark.slow
@pytest.mark.hard("1.7 a hundred thousand revolutions in contact")
def test_period_one_contact_does_not_drift(record_property):
    """Pressed on a stop by its weight and shaken by unbalance: the same point every revolution."""
    stop = jr.Limiter(LENGTH, -np.pi / 2, 0.0, 5e4, 100.0, 0.1, rim_radius=0.1)
    scene = jr.Scene(
        jr.FlexibleShaft(LENGTH, 0.02, nodes=4, constraints=[jr.Constraint(0.0, "clamp")]),
        *LINEAR.effects,
        jr.Gravity(),
        stop,
        spin=jr.ConstantSpeed(300.0),
    ).replace({"unbalance.eccentricity": 2e-5})
    early = jr.simulate(scene, 1000, 16, keep=1)
    late = jr.simulate(scene, 99_000, 16, keep=1, start=early.end)
    assert np.ptp(np.abs(tip(early))) > 1e-6
    drift = abs(tip(early) - tip(late)).max() / abs(tip(early)).max()
    record_property("measured", f"drift {drift:.0e} of the orbit")
    assert drift < 1e-10


# === precision


SINGLE = """
import numpy as np, jaxrotor as jr
scene = jr.load("limiter-rotor").with_nodes(4)
onset = float(jr.onset_speed(scene).speed)
r = jr.simulate(scene, 5, 256, start=jr.Whirl(0.0084, -441.57))
print(r.displacement.dtype, onset, abs(complex(r.displacement[-1, 0])))
own = {"settle": 1, "keep": 1, "steps_per_revolution": 32, "observe": [jr.observe.Radius()]}
own["error_sample"] = 0
ds = jr.sweep(scene, {"unbalance.eccentricity": [1e-4]}, **own)
print(ds.attrs["precision"])
"""
BAD_TYPES = """
import diffrax as dfx, jaxrotor as jr
rotor = jr.load("limiter-rotor")
for call in (
    lambda: jr.simulate(rotor, 1, 0.5),
    lambda: jr.simulate(rotor, 1, solver="Kvaerno5"),
    lambda: jr.simulate(rotor, 1, solver=dfx.Kvaerno5),
    lambda: jr.Exponential(3),
    lambda: jr.Exponential(2, "best"),
    lambda: jr.sweep(rotor, {"limiters.gap": [1e-3]}, settle=1, keep=1, solver="x"),
    lambda: jr.sweep(rotor, {"limiters.gap": [1e-3]}, observe=[3]),
):
    try:
        call()
        print("accepted")
    except ValueError as error:
        print(error)
    except Exception as error:
        print(type(error).__name__)
"""


@pytest.fixture(scope="module")
def apart():
    """What a process of single precision, without the type checker of the tests, prints of both."""
    done = subprocess.run(
        [sys.executable, "-c", "\n".join((garbage.CODE, BAD_TYPES, "print('===')", SINGLE))],
        env=os.environ | {"JAX_ENABLE_X64": "0"},
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split("===\n")


@pytest.mark.slow
@pytest.mark.hard("6.1 single precision")
def test_single_precision_runs_and_says_so(apart, record_property):
    """With JAX_ENABLE_X64=0: the onset to 1e-2, a short rub to 1e-2, the data set says float32."""
    dtype, onset, radius, precision = apart[1].split()
    assert dtype == "complex64"
    error = abs(float(onset) * UNIT / 13.9041252 - 1)
    record_property("measured", f"onset speed to {error:.0e}")
    assert error < 1e-2
    exact = jr.simulate(ROTOR.with_nodes(4), 5, 256, start=jr.Whirl(0.0084, -441.57))
    assert float(radius) == pytest.approx(abs(tip(exact)[-1]), rel=1e-2)
    assert precision == "float32"


# === refusals


OVER = {"limiters.gap": [1e-3]}


@pytest.mark.hard("6.2 bad input", outcome="refused")
@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: jr.simulate(ROTOR, 2, keep=3), r"`keep` must not exceed `revolutions` = 2"),
        (lambda: jr.simulate(ROTOR, 0), r"`revolutions` must be a whole number of at least 1"),
        (lambda: jr.simulate(ROTOR, 1, at=0.9), r"`at \[m\]` must be on the shaft"),
        (lambda: jr.simulate(ROTOR, 1, at=-0.1), r"`at \[m\]` must be on the shaft"),
        (lambda: jr.simulate(ROTOR, 1, at=[]), r"`at \[m\]` must be a station"),
        (lambda: jr.simulate(ROTOR, 1, at=float("nan")), r"`at \[m\]` must be"),
        (lambda: jr.sweep(ROTOR, {"unbalance.excentricity": [0.0]}), "no parameter"),
        (lambda: jr.sweep(ROTOR, {"start.radius": [0.0]}), "has no `radius`"),
        (lambda: jr.sweep(ROTOR, {}), "at least one parameter"),
        (lambda: jr.sweep(ROTOR, {"spin.speed": [0.0, 1.0]}), "give `period`"),
        (lambda: jr.sweep(ROTOR, {"limiters.stiffness": [-1.0]}), "must not be negative"),
        (lambda: jr.sweep(ROTOR, {"limiters.gap": []}), "must be a list of numbers"),
        (lambda: jr.sweep(ROTOR, {"limiters.gap": [1e-3]}, settle=-1), "`settle` must be"),
        (lambda: jr.sweep(ROTOR, {"limiters.gap": [1e-3]}, keep=0), "`keep` must be"),
        (lambda: jr.sweep(ROTOR, {"limiters.gap": [1e-3]}, workers=0), "`workers` must be"),
        (
            lambda: jr.simulate(ROTOR, 1, start=jr.Continued(jnp.zeros(3) + 0j, jnp.zeros(3) + 0j)),
            "has 3 coordinates",
        ),
        (lambda: jr.sweep(ROTOR, OVER, at=[0.1, 0.2]), "A sweep observes one station"),
        (lambda: jr.sweep(ROTOR, OVER, steps_per_revolution=4), "= 4 is too few to tell which way"),
        (
            # Each alone keeps the order of the stations; together they do not.
            lambda: jr.sweep(
                ROTOR.replace({"limiters.at": 0.4}),
                {"limiters.at": [0.4, 0.6], "shaft.length": [0.7, 0.7001], "disc.at": [0.5, 0.7]},
            ),
            "moves a station past another",
        ),
        (
            lambda: jr.onset_speed(ROTOR, samples=4),
            "`samples` must be a whole number of at least 8",
        ),
        (lambda: jr.onset_speed(ROTOR, within=(3.0, 3.0)), "must be two different speeds"),
        (
            lambda: jr.FlexibleShaft(
                0.7,
                0.02,
                rule="trapezoid",
                rotary_inertia=False,
                constraints=[jr.Constraint(0.0, "clamp")],
            ),
            "slopes are coordinates",
        ),
    ],
)
def test_bad_input_gets_a_sentence(call, sentence):
    with pytest.raises(ValueError, match=sentence) as raised:
        call()
    assert str(raised.value).strip().endswith(".")
    assert "\n" not in str(raised.value)


@pytest.mark.hard("6.2 bad input", outcome="refused")
def test_a_whirl_does_not_start_where_the_shaft_is_held():
    with pytest.raises(ValueError, match="a station that is held fast"):
        jr.simulate(ROTOR, 1, at=[0.0], start=jr.Whirl(1e-3, 5.0))


@pytest.mark.slow
@pytest.mark.hard("6.2 bad input", outcome="refused")
def test_bad_types_get_a_sentence(apart):
    """In a process of its own: the tests' type checker would speak first."""
    starts = [
        "`steps_per_revolution`",
        *["`solver`"] * 2,
        "`order`",
        "`basis`",
        "`solver`",
        "`observe`",
    ]
    said = apart[0].strip().splitlines()
    assert [line.partition(" must ")[0] for line in said] == starts


@pytest.mark.slow
@pytest.mark.hard("6.3 one lane of a sweep overflows", outcome="flagged")
def test_a_failing_lane_is_flagged_and_kept():
    """A growing rotor without stops overflows in its lane alone."""
    ds = jr.sweep(
        LINEAR.replace({"unbalance.eccentricity": 1e-4}),
        {"spin.speed": [5 / UNIT, 450 / UNIT]},
        start=jr.Whirl(1e-3),
        settle=1000,
        keep=2,
        steps_per_revolution=32,
    )
    assert ds.status.values.tolist() == [0, 1]
    assert np.isfinite(ds.radius_max[0])


@pytest.mark.slow
@pytest.mark.hard("6.4 a run overflows or takes too many steps", outcome="refused")
def test_a_run_that_fails_says_so():
    with pytest.raises(RuntimeError, match="did not stay finite"):
        jr.simulate(LINEAR.replace({"spin.speed": 2000 / UNIT}), 200_000, 16, start=WHIRL, keep=1)
    with pytest.raises(RuntimeError, match="max_steps"):
        jr.simulate(FEW, 1, 16, solver=dfx.Tsit5(), start=WHIRL, max_steps=5)
