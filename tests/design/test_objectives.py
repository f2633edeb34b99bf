"""Objectives: derivatives against central differences, and at kinks as their docstrings say.

Sixth-order differences go through the same discretisation. The sheet is that of the rotor of two
stiffnesses, section 4.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import check_forward

import jaxrotor as jr
from jaxrotor import objectives


NU = "supports.anisotropy"
NU0 = -0.362049935181
RATE = 100.0
SPEEDS = RATE * np.linspace(0.35, 1.10, 7)


WHOLE = jr.load("dual-stiffness-rotating")
BARE = WHOLE.put({"shaft.damping": None, "supports.damping": None})  # no internal damping


def rotating():
    return WHOLE


# objective: scene, function, parameters, step of the differences (relative)
CASES = {
    "onset_speed": (
        rotating,
        lambda s: objectives.onset_speed(s, (110.0, 190.0), 20),
        (NU, "disc_damping.translational"),
        1e-3,
    ),
    "critical_gap": (rotating, objectives.critical_gap, (NU, "shaft.anisotropy"), 1e-2),
    "largest_growth": (
        rotating,
        lambda s: objectives.largest_growth(s, SPEEDS),
        (NU, "disc_damping.translational"),
        1e-3,
    ),
    "largest_growth, smooth": (
        rotating,
        lambda s: objectives.largest_growth(s, SPEEDS, 0.5),
        (NU, "disc_damping.translational"),
        1e-3,
    ),
    "damping_ratio": (
        lambda: jr.load("gyroscopic-cantilever"),
        lambda s: objectives.damping_ratio(s, 1),
        ("shaft.k11", "disc.mass"),
        1e-2,
    ),
    "damping_ratio, turning axes": (
        rotating,
        lambda s: objectives.damping_ratio(s, 2),
        (NU, "disc_damping.translational"),
        1e-2,
    ),
    "anisotropy": (
        rotating,
        lambda s: objectives.anisotropy(s, SPEEDS),
        (NU, "shaft.damping"),
        1e-2,
    ),
    "twice_share": (
        rotating,
        lambda s: objectives.twice_share(s, SPEEDS),
        (NU, "shaft.damping"),
        1e-2,
    ),
    "twice_response": (
        rotating,
        lambda s: objectives.twice_response(s, SPEEDS),
        (NU, "shaft.damping"),
        1e-2,
    ),
    "unbalance_peak": (
        rotating,
        lambda s: objectives.unbalance_peak(s, SPEEDS),
        (NU, "disc_damping.translational"),
        1e-3,
    ),
    "unbalance_peak, smooth": (
        rotating,
        lambda s: objectives.unbalance_peak(s, SPEEDS, power=8),
        (NU, "disc_damping.translational"),
        1e-3,
    ),
    "unbalance_rms": (
        rotating,
        lambda s: objectives.unbalance_rms(s, SPEEDS),
        (NU, "disc_damping.translational"),
        1e-3,
    ),
}


def of_parameters(name):
    build, objective, paths, step = CASES[name]
    scene = build()
    own = jnp.array([jnp.ravel(scene.get(path))[0] for path in paths])
    return lambda values: objective(scene.put(dict(zip(paths, values, strict=True)))), own, step


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_gradient_against_central_differences(name):
    check_forward(*of_parameters(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["critical_gap", "anisotropy", "twice_share", "unbalance_rms"])
def test_gradients_of_many_as_a_loop(name):
    function, own, _ = of_parameters(name)
    slope = jax.jit(jax.grad(function))
    many = own * jnp.array([[1.0], [0.9], [1.15]])
    together = jax.jit(jax.vmap(jax.grad(function)))(many)
    np.testing.assert_allclose(together, [slope(one) for one in many], rtol=1e-10)


# === equal to their definitions


def test_anisotropy_is_that_of_the_sheet():
    """R5 with `D(s) = S (alpha S + B)^-1 B` of sheet 1.5, by numpy."""
    mu, kappa, alpha, nu = 0.2, 0.16, 1.0, -0.3
    p = SPEEDS / RATE
    s = 1j * p

    def stiffness(sign):
        shaft = 1 + sign * mu + kappa * s
        support = 2 * (1 + sign * nu) + 2 * alpha * kappa * s
        return shaft * support / (alpha * shaft + support)

    one, two = stiffness(1), stiffness(-1)
    expected = np.mean(np.abs(one - two) ** 2 / np.abs(one + two) ** 2)
    assert float(objectives.anisotropy(rotating(), SPEEDS)) == pytest.approx(expected, rel=1e-12)


def test_twice_is_that_of_the_sheet():
    """Table 3.8: scheme 3, nu = -0.3, sag and twice per gamma = g / omega_0^2."""
    gamma = 9.80665 / RATE**2
    rows = {0.45: (1.58166425, 1.193312e-1), 0.8: (1.57180432, 1.412365e-2)}
    for p, (sag, twice) in rows.items():
        found = objectives.twice_response(rotating(), p * RATE)
        assert float(found) == pytest.approx((gamma * twice) ** 2, rel=2e-6)
        share = objectives.twice_share(rotating(), p * RATE)
        assert float(share) == pytest.approx(twice**2 / (twice**2 + sag**2), rel=2e-6)
    both = [objectives.twice_response(rotating(), p * RATE) for p in rows]
    mean = objectives.twice_response(rotating(), RATE * np.array(list(rows)))
    assert float(mean) == pytest.approx(np.mean(both), rel=1e-12)


def test_critical_gap_is_signed():
    """Table 3.3: P_xi and P_eta on either side of nu0; slopes of sheet 4.1 at it."""
    at = lambda nu: objectives.critical_gap(rotating().put({NU: jnp.asarray(nu)})) / RATE
    for nu, stiff, soft in ((-0.9, 0.414039, 0.812939), (0.5, 0.925820, 0.666667)):
        assert float(at(nu)) == pytest.approx(stiff - soft, abs=1.1e-6)
    value, slope = jax.jvp(at, (NU0,), (1.0,))
    assert abs(float(value)) < 1e-12
    assert float(slope) == pytest.approx(0.298720 + 0.065532, abs=1.1e-6)


def test_unbalance_by_table_3_8():
    """|q| per |e| at p = 0.6 and 0.8 along the stiff axis; peak, its smooth form and rms of the two."""
    sizes = 1e-4 * np.array([1.2317471, 8.7204031])
    ask = dict(scene=rotating(), speeds=RATE * np.array([0.6, 0.8]))
    assert float(objectives.unbalance_peak(**ask)) == pytest.approx(sizes[1], rel=1e-7)
    smooth = np.mean(sizes**6) ** (1 / 6)
    assert float(objectives.unbalance_peak(**ask, power=6)) == pytest.approx(smooth, rel=1e-7)
    rms = np.sqrt(np.mean(sizes**2))
    assert float(objectives.unbalance_rms(**ask)) == pytest.approx(rms, rel=1e-7)


def test_damping_ratio_of_a_root():
    scene = jr.load("gyroscopic-cantilever")
    value = np.asarray(jr.roots(scene))[1]
    ratio = float(objectives.damping_ratio(scene, 1))
    assert ratio == pytest.approx(-value.real / abs(value), rel=1e-9)


# === kinks and flats (sheet 4.1)


def growth(nu, speeds, **options):
    return (
        objectives.largest_growth(BARE.put({NU: jnp.asarray(nu, float)}), speeds, **options) / RATE
    )


def one_sided(function, at, h):
    """Slopes on either side, third order."""
    weights = {0: -11 / 6, 1: 3.0, 2: -3 / 2, 3: 1 / 3}
    return [
        sum(w * float(function(at + side * k * h)) for k, w in weights.items()) / (side * h)
        for side in (-1, 1)
    ]


def test_growth_has_a_kink_at_the_right_anisotropy():
    """At p_d the slow roots are one: slopes +-0.140196, and jax takes their mean, 0."""
    k = 2 * 1.2 * (1 + NU0) / (1.2 + 2 * (1 + NU0))  # sheet 1.5, K of the axis xi
    speed = RATE * np.sqrt(k - 0.1**2 / 4)
    assert speed == pytest.approx(78.4789, abs=1e-4)
    at = jax.jit(lambda nu: growth(nu, speed))
    left, right = one_sided(at, NU0, 1e-4)
    assert right == pytest.approx(0.140196, abs=5e-5) and left == pytest.approx(-0.140196, abs=5e-5)
    assert abs(float(jax.grad(at)(NU0))) < 1e-4


def test_worst_growth_has_a_steeper_kink():
    """Over speeds that follow the critical ones: +-0.182126."""
    speeds = RATE * (0.784789 + np.linspace(-4e-4, 4e-4, 81))
    at = jax.jit(lambda nu: growth(nu, speeds))
    sides = [(float(at(NU0 + side * 1e-3)) - float(at(NU0))) / 1e-3 for side in (-1, 1)]
    np.testing.assert_allclose(sides, 0.182126, atol=6e-4)


def test_growth_is_flat_off_the_zone_and_steep_at_its_edges():
    """kappa = 0, p = 0.75: no slope inside, 0.6 and 5.9 at 1e-2 and 1e-4 from the edge at 0.03830."""
    slope = jax.jit(jax.grad(lambda nu: growth(nu, 75.0)))
    assert abs(float(slope(-0.3))) < 1e-12
    with pytest.raises(ValueError, match="does not change with `supports.anisotropy`"):
        flat = BARE.replace({NU: -0.3})
        jr.tune(
            lambda s: objectives.largest_growth(s, 75.0), flat, {NU: (-0.9, 0.9)}, progress=False
        )
    assert float(slope(0.0383 + 1e-2)) == pytest.approx(0.6, abs=0.05)


def test_the_largest_has_a_kink_where_it_moves():
    """Two values that cross: slopes -2 and 3, their mean at the crossing."""
    at = lambda t: objectives.peak(jnp.stack([1.0 - 2.0 * t, 1.0 + 3.0 * t]), None)
    assert one_sided(at, 0.0, 1e-3) == pytest.approx([-2.0, 3.0], abs=1e-9)
    assert float(jax.grad(at)(0.0)) == pytest.approx(0.5)


def test_the_smooth_largest_lies_below_and_comes_near():
    sizes = jnp.array([1.0, 3.0, 2.0])
    means = [float(objectives.peak(sizes, p)) for p in (2, 20, 200)]
    assert means == sorted(means) and means[-1] < 3.0 and means[-1] == pytest.approx(3.0, rel=6e-3)
    assert float(objectives.peak(jnp.zeros(3), 4)) == 0.0
    assert np.isfinite(jax.grad(lambda x: objectives.peak(x * sizes, 4))(0.0))


def test_without_an_onset_it_is_not_a_number():
    scene = BARE
    assert np.isnan(objectives.onset_speed(scene, (110.0, 190.0), 20))


# === bad input

REFUSED = {
    "isotropic": (
        lambda: objectives.anisotropy(jr.load("gyroscopic-cantilever"), 10.0),
        "same along every axis",
    ),
    "no axes": (
        lambda: objectives.critical_gap(
            jr.load("dual-stiffness-elastic").put({"shaft.anisotropy": None})
        ),
        "exist only where all unequal axes turn with the shaft",
    ),
    "turned": (
        lambda: objectives.critical_gap(rotating().put({"supports.angle": jnp.asarray(0.3)})),
        "axis at another angle",
    ),
    "no contact": (lambda: objectives.contact_peak(rotating(), 1), "has no contacts"),
    "no balls": (lambda: objectives.balancing_time(rotating(), [0.0, 1.0]), "has no balls"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_one_sentence(name):
    call, sentence = REFUSED[name]
    with pytest.raises(ValueError, match=sentence) as error:
        call()
    assert str(error.value).endswith(".")
