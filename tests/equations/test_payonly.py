"""Absent parts cost nothing: size of the compiled equations, strength zero, retracing, closed forms."""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import (
    DIAMETRAL,
    EFFECTS,
    HARMONIC,
    LENGTH,
    MASS,
    ROLLING,
    STRENGTHS,
    TIME,
    TURNING,
    bare,
    leaf_values,
    limiter_rotor,
)

import jaxrotor as jr
from jaxrotor import (
    Disc,
    ExternalDamping,
    Gravity,
    InternalDamping,
    Limiter,
    Unbalance,
    Whirl,
    assemble,
)
from jaxrotor.core.blocks import Blocks, Load
from jaxrotor.effects import AbstractLinear
from jaxrotor.effects.film import AbstractFluid
from jaxrotor.equations.rotating_frame import RotatingState, Transient
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.equations.system import structure
from jaxrotor.motion.base import Plan
from jaxrotor.motion.revolutions import March


# === size of the equations


def primitives(jaxpr):
    """Primitives of all equations of a jaxpr, also of inner ones."""
    for equation in jaxpr.eqns:
        inner = [
            getattr(leaf, "jaxpr", leaf)
            for value in equation.params.values()
            for leaf in jax.tree.leaves(value, is_leaf=lambda x: hasattr(x, "eqns"))
            if hasattr(getattr(leaf, "jaxpr", leaf), "eqns")
        ]
        yield from (name for sub in inner for name in primitives(sub))
        if not inner:
            yield equation.primitive.name


def field_of(scene):
    """Vector field's equations, size of its state, and the motion."""
    motion = Motion(assemble(scene), jnp.asarray(1 / TIME))
    y = jnp.zeros((2, 2, motion.stiffness.shape[0]))
    made = jax.make_jaxpr(lambda motion, theta, y: motion(theta, y))(motion, jnp.zeros(()), y)
    return list(primitives(made.jaxpr)), y.size, motion


DISC = Disc(LENGTH, MASS, DIAMETRAL, 2 * DIAMETRAL)
STOP = Limiter(LENGTH, 0.4, 0.0075, 4e6, 6.0, 0.1, 0.1)
STAGES = {  # each adds one thing to the one before
    "bare": (),
    "disc": (DISC,),
    "damping": (DISC, ExternalDamping(8.0)),
    "internal": (DISC, ExternalDamping(8.0), InternalDamping(2e-4)),
    "unbalance": (DISC, ExternalDamping(8.0), InternalDamping(2e-4), Unbalance(LENGTH, MASS, 1e-4)),
}
STAGES["gravity"] = (*STAGES["unbalance"], Gravity())
STAGES["limiter"] = (*STAGES["gravity"], STOP)
STAGES["limiters"] = (*STAGES["limiter"], *[eqx.tree_at(lambda s: s.angle, STOP, jnp.pi)] * 2)


@pytest.fixture(scope="module")
def fields():
    return {name: field_of(bare(*effects)) for name, effects in STAGES.items()}


@pytest.mark.slow
def test_state_never_grows_at_the_end_of_the_shaft(fields):
    assert {size for _, size, _ in fields.values()} == {4 * 8}


@pytest.mark.slow
def test_state_grows_by_a_span_for_a_kink_inside():
    """Nodes of two spans, and the slope where they meet."""
    kinked = Disc(0.3, MASS), ExternalDamping(8.0), Unbalance(0.3, 1.0, 1e-4)
    assert field_of(bare(kinked[0]))[1] == 4 * (7 + 8 + 1)
    assert field_of(bare(*kinked))[1] == 4 * (7 + 8 + 1)


@pytest.mark.slow
def test_equations_grow_only_by_what_was_added(fields):
    count = {name: len(names) for name, (names, *_) in fields.items()}
    assert count["disc"] == count["bare"]  # adds to blocks that were there
    for less, more in (
        ("disc", "damping"),
        ("damping", "internal"),
        ("internal", "unbalance"),
        ("unbalance", "gravity"),
        ("gravity", "limiter"),
    ):
        assert count[less] < count[more], (less, more)
    assert count["limiters"] == count["limiter"]  # equal laws are one batched law
    # A bare shaft: two products (stiffness, gyroscopic), a quarter turn, and no more.
    assert count["bare"] <= 30


@pytest.mark.slow
def test_products(fields):
    """One product of the state with a matrix for each block that is present, three for the ports."""
    products = {name: names.count("dot_general") for name, (names, *_) in fields.items()}
    assert products == {
        "bare": 2,  # stiffness, gyroscopic
        "disc": 2,
        "damping": 3,
        "internal": 4,  # circulatory
        "unbalance": 4,
        "gravity": 4,
        "limiter": 7,  # displacement and velocity at the port, and its force
        "limiters": 7,
    }


@pytest.mark.slow
def test_trigonometry_only_for_unbalance(fields):
    for name, (names, *_) in fields.items():
        drawn = any(isinstance(effect, Unbalance) for effect in STAGES[name])
        assert names.count("cos") == names.count("sin") == int(drawn), name


@pytest.mark.slow
def test_absent_is_none(fields):
    absent = {
        "bare": ("damping", "circulatory", "constant", "unbalance", "columns", "rows"),
        "damping": ("circulatory", "constant", "unbalance", "columns", "rows"),
        "internal": ("constant", "unbalance", "columns", "rows"),
        "unbalance": ("constant", "columns", "rows"),
        "gravity": ("columns", "rows"),
    }
    for name, missing in absent.items():
        motion = fields[name][2]
        assert all(getattr(motion, part) is None for part in missing), name
        assert motion.ports == ()
    thin = bare(rotary_inertia=False)
    assert assemble(thin).blocks.gyroscopic is None and field_of(thin)[2].gyroscopic is None
    assert len(field_of(thin)[0]) < len(fields["bare"][0])


def test_loads_are_built_where_they_are_asked_for():
    system = assemble(bare(DISC, ExternalDamping(8.0), Unbalance(LENGTH, MASS, 1e-4), Gravity()))
    loaded, unloaded = (
        Motion(system, jnp.asarray(1 / TIME), loads=there) for there in (True, False)
    )
    assert loaded.constant is not None and loaded.unbalance is not None
    assert unloaded.constant is None and unloaded.unbalance is None
    np.testing.assert_array_equal(loaded.matrix(), unloaded.matrix())


def test_force_of_unbalance():
    """`(Omega^2 - i Omega.) u`, or nothing."""
    speed, acceleration, u = jnp.asarray(30.0), jnp.asarray(7.0), jnp.array([1e-3 + 2e-3j])
    load = Load(unbalance=u)
    np.testing.assert_allclose(load.unbalance_force(speed), 900 * u, rtol=1e-15)
    np.testing.assert_allclose(
        load.unbalance_force(speed, acceleration), (900 - 7j) * u, rtol=1e-15
    )
    assert Load().unbalance_force(speed, acceleration) is None


def test_damping_that_is_known_to_be_the_same_along_every_axis():
    """It adds one block, and another once its anisotropy has a value or is traced."""
    path, scene = "external_damping.anisotropy", bare(ExternalDamping(8.0, anisotropy=0.0))
    there = lambda scene: structure(scene).blocks.fixed_damping is not None
    assert scene.get(path) == 0 and not there(scene)
    assert there(scene.replace({path: 0.1}))
    assert not there(scene.replace({path: 0.1}).replace({path: 0.0}))
    block = lambda value: structure(scene.replace({path: value})).blocks.fixed_damping.shape
    assert jax.eval_shape(lambda value: jnp.zeros(block(value)), 0.0).shape == (8, 8)


# === strength zero equals absence


@eqx.filter_jit
def rates(scene, states):
    """Vector field of a scene at several states, at different angles, and the matrix of inertia."""
    system = assemble(scene)
    motion = Motion(system, jnp.asarray(1 / TIME))
    return jax.vmap(motion)(0.4 * jnp.arange(len(states)), states), system.blocks.inertia


def without_strength(scene, effect):
    """The scene with all parameters zero that make an effect act."""
    paths = [f"{effect.kind}.{name}" for name in STRENGTHS[effect.kind]]
    return scene.replace({path: 0.0 * scene.get(path) for path in paths})


GROUPS = [[effect.kind for effect in EFFECTS[first::4]] for first in range(4)]


@pytest.mark.slow
@pytest.mark.parametrize("kinds", GROUPS, ids="-".join)
def test_zero_strength_equals_absence(kinds):
    """Of several effects at once, since every scene without some is a program; each acts at strength."""
    group = [one for one in EFFECTS if one.kind in kinds]
    base = bare(*[one for one in EFFECTS if one.kind not in kinds], N=4.0)
    here = bare(*EFFECTS, N=4.0)
    # Bent by millimetres every way, so that the limiter is struck in some and moves in all.
    states = 4e-3 * np.random.default_rng(3).standard_normal((6, 2, 2, 8))
    expected, inertia = (np.asarray(part) for part in rates(base, states))
    # Times the inertia, whose inverse enlarges the rounding of its entries a hundred thousand times; so
    # differences are measured against the terms that cancel in the product.
    rounding = np.abs(expected) @ np.abs(inertia.T)
    difference = lambda scene: np.max(
        np.abs((np.asarray(rates(scene, states)[0]) - expected) @ inertia.T) / rounding
    )
    for acting in (None, *group):
        scene = here
        for effect in group:
            scene = scene if effect is acting else without_strength(scene, effect)
        if acting is None:
            assert difference(scene) < 1e-13
        else:
            assert difference(scene) > 1e-11, acting.kind


@pytest.mark.slow
@pytest.mark.parametrize("effect", HARMONIC, ids=lambda effect: effect.kind)
def test_zero_strength_equals_absence_among_harmonic_motions(effect):
    others = [one for one in EFFECTS if not isinstance(one, AbstractFluid)]  # films have no roots
    base, here = bare(*others, N=4.0), bare(*others, effect, N=4.0)
    zero = without_strength(here, effect)
    expected = np.asarray(jr.roots(base, 6))
    np.testing.assert_allclose(np.asarray(jr.roots(zero, 6)), expected, rtol=1e-11)
    assert np.max(np.abs(np.asarray(jr.roots(here, 6)) / expected - 1)) > 1e-4


@pytest.mark.slow
def test_accelerations_call_no_solver():
    """Two programs of over a hundred lanes that call LAPACK wait for each other (jax 0.10, CPU)."""
    scene, spin = jr.load("ball-balancer"), jr.Drive(10.0, 1.0, polar=0.1, feedback=True)
    scene = jr.Scene(scene.shaft, *scene.effects, spin=spin)
    field = Transient.of(scene, jnp.asarray(100.0), jnp.zeros(()))
    n, one, balls = field.system.n, jnp.ones(1), jnp.ones(5)
    y = RotatingState(jnp.ones((2, n)), jnp.ones((2, n)), one, one, balls, balls, jnp.zeros(0))
    made = jax.make_jaxpr(lambda y: field(jnp.zeros(()), y))(y)
    assert not {"lu", "triangular_solve", "custom_linear_solve", "eig"} & set(
        primitives(made.jaxpr)
    )
    assert np.isfinite(np.asarray(field(jnp.zeros(()), y).speed)).all()


@eqx.filter_jit
def rates_with_bodies(scene, states, bodies):
    """Vector field of a scene whose bodies move, of shaft and bodies."""
    field = Transient.of(scene, jnp.asarray(1 / TIME), jnp.zeros(()))
    angle, rate = bodies if field.system.races else jnp.zeros((2, 0))
    none = jnp.zeros(0)
    at = lambda time, state: field(time, RotatingState(*state, none, none, angle, rate, none))
    found = jax.vmap(at)(1e-3 * jnp.arange(len(states)), states)
    return found.r_rate, found.bodies_rate


@pytest.mark.slow
@pytest.mark.parametrize("effect", TURNING + ROLLING, ids=lambda effect: effect.kind)
def test_zero_strength_equals_absence_in_turning_axes(effect):
    """Effects that have no motion by whole revolutions, beside balls."""
    beside = [one for one in EFFECTS if one.kind in ("disc", "unbalance", "limiter", "support")]
    others = [*beside, *(one for one in ROLLING[:1] if one.kind != effect.kind)]
    base, here = bare(*others, N=4.0), bare(*others, effect, N=4.0)
    zero = without_strength(here, effect)
    states = 4e-3 * np.random.default_rng(3).standard_normal((6, 2, 2, assemble(base).n))
    bodies = jnp.array([[0.1, 0.3, 2.0], [0.2, -0.1, 0.0]])  # the first two touch
    shaft, balls = rates_with_bodies(base, states, bodies)
    same, still = rates_with_bodies(zero, states, bodies)
    other, rolls = rates_with_bodies(here, states, bodies)
    largest = np.max(np.abs(shaft))
    np.testing.assert_allclose(same, shaft, rtol=0, atol=1e-12 * largest)
    # Balls feel the acceleration of the shaft, so its rounding is theirs.
    np.testing.assert_allclose(still[:, : balls.shape[1]], balls, rtol=0, atol=1e-12 * largest)
    assert np.max(np.abs(other - shaft)) > 1e-6 * largest  # at strength it acts
    assert not np.allclose(rolls, still)


# === values never retrace


TRACED = []  # events of tracing and compiling
jax.monitoring.register_event_duration_secs_listener(
    lambda event, *_, **__: TRACED.append(event) if event.startswith("/jax/core/compile") else None
)


def other_values(scene):
    """The same scene with every number changed (stations and length left where they are)."""
    changed = {
        path: jnp.max(value) * 1.01 + 1e-6
        for path, value in leaf_values(scene).items()
        if not path.endswith((".at", ".length"))
    }
    return scene.replace(changed)


STARTED = Whirl(0.001, 5.0)
USES = {
    "simulate": lambda scene: jr.simulate(scene, 2, 16, start=STARTED).displacement,
    "roots": lambda scene: jr.roots(scene),
    "onset": lambda scene: jr.onset_speed(scene),
    "assemble": lambda scene: assemble(scene).blocks.inertia,
}


SLOW = {"onset"}


@pytest.mark.parametrize(
    "use", [pytest.param(use, marks=[pytest.mark.slow] * (use in SLOW)) for use in USES]
)
def test_changing_values_never_retraces(use):
    scene = limiter_rotor(eps=1e-4, gravity=True)
    once, again = other_values(scene), other_values(other_values(scene))
    USES[use](scene)
    first = np.asarray(jax.tree.leaves(USES[use](once))[0])
    TRACED.clear()
    second = USES[use](again)
    assert not TRACED
    assert not np.allclose(first, np.asarray(jax.tree.leaves(second)[0]), rtol=1e-6, atol=0)


def test_a_run_assembles_its_scene_once(monkeypatch):
    """Where its program is traced; another run of the same structure assembles by that program."""
    assembled, line = [], jr.Scene.line
    monkeypatch.setattr(jr.Scene, "line", lambda scene: assembled.append(scene) or line(scene))
    scene = bare(DISC, ExternalDamping(8.0), Unbalance(LENGTH, MASS, 1e-4), nodes=3)
    for run in (scene, other_values(scene)):
        jr.simulate(run, 1, 5, start=STARTED)
        assert len(assembled) == 1


def test_new_structure_does_compile():
    """`TRACED` records compilations, so the test above can fail."""
    TRACED.clear()
    jax.jit(lambda x: jnp.sin(x) + 2.71828)(jnp.zeros(7))
    assert TRACED


# === linear scenes have no time loop


@pytest.mark.slow
@pytest.mark.parametrize("basis", ["modal", "dense"])
def test_linear_scene_skips_in_closed_form(basis):
    fields = {field.name for field in dataclasses.fields(Plan)}
    settings = {
        "solver": jr.Exponential(basis=basis),
        "controller": None,
        "adjoint": dfx.ForwardMode(),
        "max_steps": 16,
        "steps": 64,
        "slopes": False,
        "contacts": False,
        "coordinates": False,
        "together": (),
        "batch": False,
        "massless": None,
    }
    assert fields == set(settings)
    scene = bare(DISC, ExternalDamping(8.0), Unbalance(LENGTH, MASS, 1e-4))

    def names(revolutions):
        def skip(scene, y):
            march = March.build(scene, Plan(**settings), scene.spin.speed, jnp.array([LENGTH]))
            return march.skip(y, revolutions)[0]

        return list(primitives(eqx.filter_make_jaxpr(skip)(scene, jnp.zeros(4 * 8))[0].jaxpr))

    few, many = names(3), names(3000)
    assert "scan" not in many and "while" not in many
    assert len(many) < len(few) + 60  # at most the powers of one matrix, log2(3000)


@pytest.mark.slow
def test_linear_scene_is_exact_at_any_step():
    scene = bare(DISC, ExternalDamping(8.0), Unbalance(LENGTH, MASS, 1e-4), Gravity(), N=3.0)
    coarse = jr.simulate(scene, 30, 4, keep=1, start=STARTED).displacement
    fine = jr.simulate(scene, 30, 64, keep=1, start=STARTED).displacement[::16]
    np.testing.assert_allclose(coarse, fine, rtol=0, atol=1e-12)


class _Spring(AbstractLinear):
    """Spring of one's own, whose stiffness may be a function of its station."""

    kind: ClassVar[str] = "spring"
    plural: ClassVar[str] = "springs"

    at: Any
    stiffness: Callable | None = None

    def blocks(self, line):
        stiffness = 2e3 if self.stiffness is None else self.stiffness(self.at)
        return Blocks(stiffness=stiffness * jnp.outer(line.column(self.at), line.row(self.at)))


def test_parts_of_ones_own_may_have_functions():
    """Parts of one class are traced together where numbers alone tell them apart: `Sum k x^2`."""
    functions = [_Spring(jnp.array(1.0), lambda x, k=k: k * x) for k in (1e3, 2e3)]
    plain = [_Spring(jnp.array(at)) for at in (0.5, 1.0)]
    shaft = jr.RigidShaft(1.0, constraints=[jr.Constraint(0.0)])
    scene = jr.Scene(shaft, Disc(1.0, 1.0), *functions, *plain, spin=jr.ConstantSpeed(0.0))
    stiffness = float(assemble(scene).blocks.stiffness[0, 0])
    assert stiffness == pytest.approx(3e3 + 2e3 * 1.25, rel=1e-14)
