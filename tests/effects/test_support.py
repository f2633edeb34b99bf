"""Bearings of any stiffness and damping, against 2 by 2 matrices of a Jeffcott rotor by numpy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment

import jaxrotor as jr


MASS, SHAFT, OUTER, ECCENTRICITY, PHASE = 2.0, 3.0, 0.2, 0.1, 0.7
STIFFNESS = np.array([[4.0, 1.3], [-0.4, 2.5]])
DAMPING = np.array(
    [[0.5, -0.1], [0.25, 0.3]]
)  # its principal axes differ from those of the stiffness
J, ONE = np.array([[0.0, -1.0], [1.0, 0.0]]), np.eye(2)


def rotor(speed, *supports):
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, SHAFT),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, OUTER),
        jr.Unbalance(0.5, MASS, ECCENTRICITY, PHASE),
        *supports,
        spin=jr.ConstantSpeed(speed),
    )


def support(stiffness=STIFFNESS, damping=DAMPING, **options):
    return jr.Support(0.5, stiffness, damping, **options)


def matrices(speed, stiffness, damping, rotating):
    """`C`, `K` of the rotor in fixed axes, or in rotating axes."""
    if not rotating:
        return OUTER * ONE + damping, SHAFT * ONE + stiffness
    coriolis = 2 * MASS * speed * J + OUTER * ONE + damping
    return coriolis, (SHAFT - MASS * speed**2) * ONE + OUTER * speed * J + stiffness


def roots_of(mass, damping, stiffness):
    low = np.concatenate([-stiffness, -damping], axis=1) / mass
    return np.linalg.eigvals(np.concatenate([np.eye(2, 4, 2), low]))


def close(found, expected, tolerance):
    """Check that two sets of values are equal, in any order."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    distance = np.abs(found[:, None] - expected[None])
    assert distance[linear_sum_assignment(distance)].max() < tolerance


@pytest.mark.slow
@pytest.mark.parametrize("rotating", [False, True])
@pytest.mark.parametrize("speed", [0.6, 3.0, -1.7])
def test_eight_coefficients(speed, rotating):
    scene = rotor(speed, support(rotating=rotating))
    damping, stiffness = matrices(speed, STIFFNESS, DAMPING, rotating)
    expected = roots_of(MASS, damping, stiffness)
    close(jr.roots(scene), expected, 1e-12)
    assert float(jr.growth_rate(scene)) == pytest.approx(expected.real.max(), abs=1e-12)
    multipliers = np.exp(expected * 2 * np.pi / abs(speed))
    close(jr.floquet_multipliers(scene), multipliers, 1e-11 * np.abs(multipliers).max())
    found = jr.unbalance_response(scene, speed)
    push = MASS * ECCENTRICITY * speed**2 * np.exp(1j * PHASE)
    if rotating:  # the response is constant in rotating axes
        x, y = np.linalg.solve(stiffness, [push.real, push.imag])
        forward, backward = x + 1j * y, 0.0
    else:  # q = (x, y) with the motion Re(q exp(i Omega t))
        dynamic = stiffness + 1j * speed * damping - MASS * speed**2 * ONE
        x, y = np.linalg.solve(dynamic, [push, -1j * push])
        forward, backward = (x + 1j * y) / 2, (x - 1j * y).conj() / 2
    assert complex(found.forward[0, 0]) == pytest.approx(forward, rel=1e-12)
    assert complex(found.backward[0, 0]) == pytest.approx(backward, rel=1e-12)


def test_fixed_and_rotating_bearings_at_once():
    """Multipliers of the periodic coefficients, integrated in fixed axes by scipy."""
    speed, rotating = 1.3, 0.3 * STIFFNESS.T
    scene = rotor(speed, support(), support(rotating, 0.5 * DAMPING, rotating=True))

    def field(t, y):
        q, v = y.reshape(2, 2, 4)
        axes = expm(speed * t * J)
        seen = axes.T @ q, axes.T @ (v - speed * J @ q)
        force = axes @ (rotating @ seen[0] + 0.5 * DAMPING @ seen[1])
        force = force + (SHAFT * ONE + STIFFNESS) @ q + (OUTER * ONE + DAMPING) @ v
        return np.concatenate([v, -force / MASS]).ravel()

    period = (0.0, 2 * np.pi / speed)
    run = solve_ivp(field, period, np.eye(4).ravel(), method="DOP853", rtol=1e-11, atol=1e-12)
    expected = np.linalg.eigvals(run.y[:, -1].reshape(4, 4))
    close(jr.floquet_multipliers(scene), expected, 1e-9)


@pytest.mark.slow
def test_each_mode_of_a_pinned_shaft_in_an_anisotropic_medium():
    """Every mode is a Jeffcott rotor, `rA q.. + D q. + EI k^4 q = f`; `D` is anisotropic."""
    length, diameter, young, density = 1.3, 0.02, 2.1e11, 7850.0
    medium, share, angle, speed, eccentric = 150.0, 0.6, 0.5, 90.0, 1e-3
    per_length = density * np.pi * diameter**2 / 4
    rigidity = young * np.pi * diameter**4 / 64
    scene = jr.Scene(
        jr.FlexibleShaft(
            length,
            diameter,
            jr.Material(young, density),
            nodes=16,
            rotary_inertia=False,
            constraints=(jr.Constraint(0.0), jr.Constraint(length)),
        ),
        jr.ExternalDamping(medium, share, angle),
        jr.Unbalance(length / 2, 1.0, eccentric),
        spin=jr.ConstantSpeed(speed),
    )
    c, s = np.cos(2 * angle), np.sin(2 * angle)
    damping = medium * (ONE + share * np.array([[c, s], [s, -c]]))
    wave = lambda number: number * np.pi / length
    found = np.asarray(jr.roots(scene))
    for number in (1, 2, 3):
        for root in roots_of(per_length, damping, rigidity * wave(number) ** 4 * ONE):
            assert np.min(np.abs(found - root)) < 1e-8 * abs(root)
    first = roots_of(per_length, damping, rigidity * wave(1) ** 4 * ONE)
    multipliers = np.asarray(jr.floquet_multipliers(scene))
    for multiplier in np.exp(first * 2 * np.pi / speed):
        assert np.min(np.abs(multipliers - multiplier)) < 1e-8
    response = np.zeros(2, complex)
    for number in range(1, 2001, 2):
        dynamic = rigidity * wave(number) ** 4 * ONE + 1j * speed * damping
        push = 2 / length * eccentric * speed**2 * np.array([1, -1j])
        shape = np.sin(number * np.pi / 2)
        response += shape**2 * np.linalg.solve(dynamic - per_length * speed**2 * ONE, push)
    x, y = response
    orbit = jr.unbalance_response(scene, speed, length / 2)
    assert complex(orbit.forward[0, 0]) == pytest.approx((x + 1j * y) / 2, rel=1e-8)
    assert complex(orbit.backward[0, 0]) == pytest.approx((x - 1j * y).conj() / 2, rel=1e-8)


def test_pure_cross_coupling():
    """Alford's force, which is ahead of the displacement, without direct stiffness or damping."""
    alford = support([[0.0, 1.5], [-1.5, 0.0]], None)
    close(
        jr.roots(rotor(2.0, alford)),
        np.roots([MASS, OUTER, SHAFT - 1.5j]),
        1e-12,
    )
    both = support(0.0 * ONE, [[0.0, -0.4], [0.4, 0.0]])
    close(jr.roots(rotor(2.0, both)), np.roots([MASS, OUTER + 0.4j, SHAFT]), 1e-12)


CROSSED = jr.Support(0.5, 2.0, 0.3, cross_stiffness=0.4, cross_damping=0.15, rotating=True)


def crossed(speed):
    """Coefficients of `m z.. + d (z. - i Omega z) + c z. + k z = 0`, `d = 0.3 + 0.15 i`."""
    internal = 0.3 + 0.15j
    stiffness = SHAFT + 2.0 + 0.4j - 1j * speed * internal
    return np.array([MASS, OUTER + internal, stiffness])


@pytest.mark.parametrize("speed", [3.0, -2.0])
def test_cross_coupled_damper_that_rotates(speed):
    """The damper acts on the velocity in rotating axes: `Omega` times the cross term is a stiffness."""
    close(jr.roots(rotor(speed, CROSSED)), np.roots(crossed(speed)), 1e-12)


def test_cross_coupled_damper_that_rotates_in_time():
    speed = 3.0
    scene = rotor(speed, CROSSED).without("unbalance")
    run = jr.simulate(scene, 2, 16, start=jr.Whirl(0.01, -1.2))
    mass, damping, stiffness = crossed(speed)
    matrix = np.array([[0, 1], [-stiffness / mass, -damping / mass]])
    expected = [(expm(matrix * t) @ [0.01, -0.012j])[0] for t in np.asarray(run.time)]
    np.testing.assert_allclose(run.displacement[:, 0], expected, rtol=0, atol=1e-12)


# === matrices


@pytest.mark.slow
def test_derivatives_by_every_coefficient():
    """Derivatives by traced matrices, against differences of the eigenvalues by numpy."""
    speed, h = 1.1, 1e-5
    root = lambda k, c: jr.roots(rotor(speed, support(k, c)))[0]

    def exact(k, c):
        values = roots_of(MASS, *matrices(speed, k, c, False))
        here = complex(root(STIFFNESS, DAMPING))
        return values[np.argmin(np.abs(values - here))]

    by_k, by_c = jax.jacfwd(root, (0, 1))(jnp.asarray(STIFFNESS), jnp.asarray(DAMPING))
    for i in range(2):
        for j in range(2):
            d = np.zeros((2, 2))
            d[i, j] = h
            slopes = [
                (exact(STIFFNESS + d, DAMPING) - exact(STIFFNESS - d, DAMPING)) / (2 * h),
                (exact(STIFFNESS, DAMPING + d) - exact(STIFFNESS, DAMPING - d)) / (2 * h),
            ]
            np.testing.assert_allclose([by_k[i, j], by_c[i, j]], slopes, rtol=1e-7)


@pytest.mark.parametrize("change", [ONE, np.diag([2.0, 0.0])], ids=["equal", "unequal"])
def test_derivatives_where_the_axes_are_equal(change):
    """Derivatives at an isotropic bearing by the stiffness of both axes, and of x alone."""

    def response(share):
        bearing = support(4.0 * jnp.eye(2) + share * change, None)
        orbit = jr.unbalance_response(rotor(1.0, bearing), 0.9)
        return jnp.stack([orbit.forward[0, 0], orbit.backward[0, 0]])

    def exact(share):
        stiffness = (SHAFT + 4.0) * ONE + share * change
        dynamic = stiffness + (0.9j * OUTER - MASS * 0.81) * ONE
        push = MASS * ECCENTRICITY * 0.81 * np.exp(1j * PHASE)
        x, y = np.linalg.solve(dynamic, [push, -1j * push])
        return np.array([x + 1j * y, (x - 1j * y).conj()]) / 2

    slopes = jax.jacfwd(response)(0.0)
    np.testing.assert_allclose(slopes, (exact(1e-5) - exact(-1e-5)) / 2e-5, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("name", ["stiffness", "damping"])
@pytest.mark.parametrize(
    "matrix",
    [STIFFNESS, DAMPING, 2 * ONE, np.diag([1.0, 3.0]), [[1.0, 5.0], [5.0, 1.0]], J, 0 * ONE],
)
def test_blocks_reproduce_the_matrix(name, matrix):
    """The matrix is recovered from the forces of unit displacements or velocities along x and y."""
    other = {"stiffness": "damping", "damping": "stiffness"}[name]
    bearing = jr.Support(0.5, **{name: matrix, other: ONE})
    blocks = bearing.blocks(rotor(1.0).line())
    part = lambda label: 0.0 if (b := getattr(blocks, label)) is None else complex(b[0, 0])
    mean, cross, deviator = part(name), part(f"skew_{name}"), part(f"fixed_{name}")
    pushed = [(mean + 1j * cross) * z + deviator * np.conj(z) for z in (1, 1j)]
    back = np.array([[f.real for f in pushed], [f.imag for f in pushed]])
    np.testing.assert_allclose(back, matrix, rtol=0, atol=1e-15)
    equal = bool(np.allclose(np.asarray(matrix), np.trace(matrix) / 2 * ONE + (matrix[1][0]) * J))
    assert (getattr(blocks, f"fixed_{name}") is None) == equal


def test_coefficients_are_the_matrices():
    """Coefficients give the blocks of the matrices, one alone and all of them at once."""
    of = lambda **given: jr.Support(0.5, **given).blocks(rotor(1.0).line())
    names = [f"{letter}{axes}" for letter in "kc" for axes in ("xx", "xy", "yx", "yy")]
    values = np.concatenate([STIFFNESS.ravel(), DAMPING.ravel()])
    whole = of(**dict(zip(names, values, strict=True)))
    expected = support().blocks(rotor(1.0).line())
    for one, other in zip(jax.tree.leaves(whole), jax.tree.leaves(expected), strict=True):
        np.testing.assert_array_equal(one, other)
    alone = of(kxx=2.0)
    assert alone.stiffness[0, 0] == 2 and alone.fixed_stiffness is None
    assert alone.damping is None and alone.skew_stiffness is None


EQUAL = [
    jr.Support(0.5, 4.0, anisotropy=0.0, angle=0.3, cross_stiffness=0.0),
    jr.Support(0.5, kxx=4.0, kyy=4.0, kxy=0.0, kyx=0.0, cxx=0.0),
    jr.Support(0.5, 4.0 * ONE),
]


@pytest.mark.parametrize("bearing", EQUAL, ids=["means", "coefficients", "matrix"])
def test_equal_axes_leave_no_trace(bearing):
    """An isotropic bearing adds no anisotropic blocks, until `replace` makes it anisotropic."""
    scene, plain = rotor(1.0, bearing), rotor(1.0, jr.Support(0.5, 4.0))
    found, expected = jr.assemble(scene).blocks, jr.assemble(plain).blocks
    for name in ("stiffness", "skew_stiffness", "fixed_stiffness", "fixed_damping"):
        one, other = getattr(found, name), getattr(expected, name)
        assert one is other is None or np.array_equal(one, other)
    name, value = ("support.anisotropy", 0.5) if bearing.kxx is None else ("support.kxx", 12.0)
    mean = 4.0 if bearing.kxx is None else 8.0
    unequal = jr.Scene(scene.shaft, *scene.without("support").effects, spin=scene.spin)
    unequal = jr.Scene(
        scene.shaft,
        *unequal.effects,
        jr.Support(0.5, mean, anisotropy=0.5, angle=bearing.angle),
        spin=scene.spin,
    )
    traced = jax.jit(lambda x: jr.growth_rate(scene.replace({name: x})))
    assert jr.growth_rate(scene.replace({name: value})) == jr.growth_rate(unequal)
    assert traced(value) == pytest.approx(float(jr.growth_rate(unequal)), rel=1e-12)
    back = scene.replace({name: value}).replace({name: 0.0 if bearing.kxx is None else 4.0})
    assert jr.assemble(back).blocks.fixed_stiffness is None


def test_traced_values_are_placed_without_checks():
    scene = rotor(1.0, jr.Support(0.5, kxx=4.0, kyy=4.0))
    placed = jax.make_jaxpr(lambda k: scene.put({"support.kxx": k}).leaves("support.kxx"))(5.0)
    assert not placed.eqns


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (
            lambda: support([[1.0, 2.0]]),
            "`stiffness` must be a 2 by 2 matrix, [[kxx, kxy], [kyx, kyy]], but has shape (1, 2)",
        ),
        (lambda: support(ONE, -ONE), "`cxx + cyy [N s/m]` must not be negative, but is -2."),
        (lambda: support("soft"), "`stiffness [N/m]` must be a number, but is 'soft'"),
        (lambda: support([["a", 1], [2, 3]]), "must be a number or a 2 by 2 matrix of numbers"),
        (
            lambda: jr.Support(0.5, kxx=1.0, angle=0.3),
            "`kxx` and `angle` belong to two different ways",
        ),
        (lambda: jr.Support(0.5, cxx=1.0), "A support needs a stiffness; give `kxx [N/m]`"),
        (lambda: support(STIFFNESS, kyy=1.0), "`stiffness` is a matrix of kxx, kxy, kyx and kyy"),
        (lambda: support(np.diag([1.0, np.nan])), "must be a finite number"),
        (lambda: jr.Support(0.5, 1.0, damping_anisotropy=0.1), "give that too"),
        (lambda: jr.Support(0.5, 1.0, 0.1, damping_angle=0.1), "give both or neither"),
    ],
)
def test_refusals(make, sentence):
    with pytest.raises(ValueError) as error:
        make()
    assert sentence in str(error.value)


SEALED, ADDED, HELD = 20.0, 3.0, 4e6  # [kg] of the disc, of a seal, [N/m] of both seals
LOADED = SEALED + 2 * ADDED


def on_seals(speed=300.0, *others):
    """A disc on a rigid shaft between two seals with added mass."""
    seals = [jr.Support(at, kxx=HELD / 2, mxx=ADDED) for at in (0.2, 0.8)]
    disc = jr.Disc(0.5, SEALED, 0.5, 0.0)
    return jr.Scene(jr.RigidShaft(1.0), disc, *seals, *others, spin=jr.ConstantSpeed(speed))


def test_added_mass_of_two_seals():
    """`w = sqrt(k / (m + 2 m_a))`, as 392.232 rad/s: 20 kg, 3 kg each, 4 MN/m."""
    found = jr.critical_speeds(on_seals()).forward[0]
    np.testing.assert_allclose(found, np.sqrt(HELD / LOADED), rtol=1e-12)
    np.testing.assert_allclose(found, 392.2322702763681, rtol=1e-12)


@pytest.mark.slow
def test_response_and_reactions_of_seals_with_added_mass():
    """`|z| = u W^2 / |k - (m + 2 m_a) W^2|`, seals take `-m w^2 z` of a free whirl and `m g`."""
    speed, moment = 300.0, 1e-3
    scene = on_seals(speed, jr.Unbalance(0.5, moment=moment))
    found = jr.unbalance_response(scene, speed, 0.5).major[0, 0]
    np.testing.assert_allclose(found, moment * speed**2 / abs(HELD - LOADED * speed**2), rtol=1e-10)
    rate = np.sqrt(HELD / LOADED)
    run = jr.simulate(on_seals(), 1, 4, start=jr.Whirl(1e-3, rate))
    whirl = 1e-3 * np.exp(1j * rate * np.asarray(run.time))
    force = jr.reactions(run).force.sum(1)
    np.testing.assert_allclose(force, -SEALED * rate**2 * whirl, rtol=1e-8)
    run = jr.simulate(on_seals(speed, jr.Gravity(9.81)), 1, 4, start=jr.Whirl(1e-3, rate))
    np.testing.assert_allclose(jr.reactions(run).static.sum(), 1j * SEALED * 9.81, rtol=1e-12)


# === supports where the shaft is held


def held(holds, **bearing):
    """A rigid rotor on a constraint at 0 and a bearing there, and on another bearing."""
    bearings = jr.Support(0.0, **bearing), jr.Support(0.8, 1e6)
    shaft = jr.RigidShaft(1.0, constraints=(jr.Constraint(0.0, holds),))
    return jr.Scene(
        shaft, jr.Disc(0.5, 10.0, diametral=0.2, polar=0.3), *bearings, spin=jr.ConstantSpeed(0.0)
    )


def test_a_support_where_a_constraint_holds_the_shaft_is_refused():
    with pytest.raises(
        ValueError, match="The support at 0 m has no effect, since a pin of the shaft"
    ):
        held("pin", stiffness=1e6)
    apart = held("pin", stiffness=0.0, angular_stiffness=3e4)
    with pytest.raises(ValueError, match="The support at 0 m has no effect"):
        apart.replace({"supports.1.at": 0.0})


def test_a_support_that_holds_the_slope_of_a_pin_is_felt():
    """`J w^2 = k l^2 + k_a` about the pin, with `J = I + m a^2`."""
    frequency = np.sqrt((1e6 * 0.8**2 + 3e4) / (0.2 + 10.0 * 0.5**2))
    roots = jr.roots(held("pin", stiffness=0.0, angular_stiffness=3e4))
    assert np.abs(roots.imag).max() == pytest.approx(frequency, rel=1e-9)
