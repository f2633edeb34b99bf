"""Tuning by gradients: against closed forms and scipy.

Toy losses are of parameters alone, so that their minima are known; `X` and `Y` are angles, which may
be any number.
"""

import functools

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import optax
import optimistix as optx
import pytest
from scipy.optimize import least_squares
from shown import shown

import jaxrotor as jr
from jaxrotor import plot


X, Y = "gravity.angle", "unbalance.phase"


@functools.cache
def rotating():
    return jr.load("dual-stiffness-rotating")


def toy(x=0.0, y=0.0):
    return rotating().replace({X: x, Y: y})


def of(function):
    """A loss of the two angles."""
    return lambda scene: function(scene.get(X), scene.get(Y))


def tune(loss, scene, where=None, **options):
    return jr.tune(loss, scene, where or {X: None, Y: None}, progress=False, **options)


def found(tuned):
    return np.array([float(value) for value in tuned.values.values()])


# === optimisers

bowl = of(lambda x, y: (x - 1.0) ** 2 + 5.0 * (y + 0.5 * x) ** 2 + 2.0)
residuals = of(lambda x, y: jnp.stack([x - 1.0, 5.0**0.5 * (y + 0.5 * x), 2.0**0.5 + 0 * x]))
OPTIMISERS = {
    "default": (bowl, None, 1e-7),
    "bfgs": (bowl, optx.BFGS(1e-9, 1e-9), 1e-7),
    "lbfgs": (bowl, optx.LBFGS(1e-9, 1e-9), 1e-7),
    "nonlinear cg": (bowl, optx.NonlinearCG(1e-9, 1e-9), 1e-7),
    "gradient descent": (bowl, optx.GradientDescent(0.5, 1e-9, 1e-9), 1e-7),
    "adam": (bowl, optax.adam(optax.exponential_decay(0.2, 60, 0.5)), 1e-2),
    "sgd": (bowl, optax.sgd(0.05), 1e-7),
    "optax lbfgs": (bowl, optax.lbfgs(), 1e-7),
    "default of residuals": (residuals, None, 1e-9),
    "levenberg-marquardt": (residuals, optx.LevenbergMarquardt(1e-9, 1e-9), 1e-9),
    "gauss-newton": (residuals, optx.GaussNewton(1e-9, 1e-9), 1e-9),
    "dogleg": (residuals, optx.Dogleg(1e-9, 1e-9), 1e-9),
    "minimiser of residuals": (residuals, optx.BFGS(1e-9, 1e-9), 1e-7),
    "sgd of residuals": (residuals, optax.sgd(0.05), 1e-7),
}


@pytest.mark.long
@pytest.mark.parametrize("name", OPTIMISERS)
def test_a_bowl_by_every_optimiser(name):
    """Least at (1, -0.5), where the loss is 2."""
    loss, optimiser, tolerance = OPTIMISERS[name]
    tuned = tune(loss, toy(1.5, 1.0), optimiser=optimiser)
    np.testing.assert_allclose(found(tuned), [1.0, -0.5], rtol=0, atol=tolerance)
    assert float(tuned.loss) == pytest.approx(2.0, abs=10 * tolerance**2 + 1e-13)
    assert float(tuned.scene.get(X)) == float(tuned.values[X])


@pytest.mark.parametrize("name", ["default", "default of residuals", "sgd"])
def test_derivatives_by_reverse_mode(name):
    loss, optimiser, _ = OPTIMISERS[name]
    one, other = (
        tune(loss, toy(1.5, 1.0), optimiser=optimiser, mode=mode, steps=5)
        for mode in ("forward", "reverse")
    )
    np.testing.assert_allclose(other.history.loss, one.history.loss, rtol=1e-12)
    np.testing.assert_allclose(other.history.gradient, one.history.gradient, rtol=1e-12)


def test_the_usual_optimiser_is_named():
    assert tune(bowl, toy(3.0, 2.0), steps=1).optimiser == "optimistix BFGS"
    assert tune(residuals, toy(3.0, 2.0), steps=1).optimiser == "optimistix LevenbergMarquardt"
    assert tune(bowl, toy(3.0, 2.0), steps=1, optimiser=optax.sgd(0.1)).optimiser.startswith(
        "optax"
    )


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_the_size_of_a_loss_does_not_matter(size):
    tuned = tune(lambda scene: size * (bowl(scene) - 2.0), toy(3.0, 2.0))
    np.testing.assert_allclose(found(tuned), [1.0, -0.5], rtol=0, atol=1e-8)


def test_residuals_as_scipy_fits_them():
    """`y = m exp(-t d)` through noisy points; mass by its logarithm, damping between bounds."""
    t = np.linspace(0.0, 2.0, 21)
    y = 7.0 * np.exp(-1.3 * t) + 0.05 * np.random.default_rng(3).normal(size=t.size)
    expected = least_squares(
        lambda p: p[0] * np.exp(-p[1] * t) - y, [3.0, 0.4], xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    scene = rotating().replace({"disc.mass": 3.0, "disc_damping.translational": 0.4})
    loss = lambda s: s.get("disc.mass") * jnp.exp(-t * s.get("disc_damping.translational")) - y
    where = {"disc.mass": (0.1, 100.0), "disc_damping.translational": (0.1, 5.0)}
    tuned = tune(loss, scene, where)
    np.testing.assert_allclose(found(tuned), expected.x, rtol=1e-8)
    assert float(tuned.loss) == pytest.approx(2 * expected.cost, rel=1e-12)


# === bounds


def test_an_active_bound_is_approached():
    tuned = tune(
        of(lambda x, y: (x - 3.0) ** 2 + y**2), toy(0.5, 0.5), {X: (0.0, 1.0), Y: (-1.0, 2.0)}
    )
    np.testing.assert_allclose(found(tuned), [1.0, 0.0], rtol=0, atol=1e-6)
    assert np.nanmax(tuned.history.values[X]) <= 1.0


def test_positive_bounds_over_a_decade_are_those_of_the_logarithm():
    """Both ways to a target are alike in the logarithm: the middle of 1 and 1e4 is 1e2."""
    scene = rotating().replace({"disc.mass": 1e2})
    path, where = "disc.mass", {"disc.mass": (1.0, 1e4)}
    for target in (10.0, 1e3):
        loss = lambda s, t=target: jnp.log(s.get(path) / t) ** 2
        tuned = tune(loss, scene, where, steps=2)
        off = np.log10(tuned.history.values[path][0])
        assert off[0] == pytest.approx(2.0) and abs(off[1] - 2.0) == pytest.approx(
            abs(float(np.log10(tuned.values[path])) - 2.0), rel=1e-12
        )
    drawn = jr.tune(loss, scene, where, starts=9, steps=1, progress=False).history.values[path][
        1:, 0
    ]
    shares = np.sort(np.log(drawn) / np.log(1e4))  # a Latin hypercube: one in each eighth
    np.testing.assert_array_equal(np.floor(8 * shares), np.arange(8))


# === starts

two_wells = of(lambda x, y: (x**2 - 1.0) ** 2 + 0.3 * x + y**2)
LEFT, RIGHT = np.sort(np.roots([4.0, 0.0, -4.0, 0.3]).real)[[0, 2]]
WELLS = {X: (-2.0, 2.0), Y: (-1.0, 1.0)}


def test_several_starts_find_the_deeper_well():
    alone = tune(two_wells, toy(0.9, 0.1), WELLS)
    assert found(alone)[0] == pytest.approx(RIGHT, abs=1e-7)
    many = tune(two_wells, toy(0.9, 0.1), WELLS, starts=6)
    assert found(many)[0] == pytest.approx(LEFT, abs=1e-7)
    assert many.start > 0 and len(many.reasons) == 6
    assert many.history.values[X][0, 0] == pytest.approx(0.9, rel=1e-14)
    np.testing.assert_allclose(many.history.loss[0, : alone.steps], alone.history.loss[0])
    assert "start" in str(many) and "seed 0" in str(many)


def test_the_seed_says_where_starts_are():
    runs = [tune(two_wells, toy(0.9), WELLS, starts=3, seed=s, steps=4) for s in (5, 5, 6)]
    one, again, other = (run.history.values[X][:, 0] for run in runs)
    np.testing.assert_array_equal(one, again)
    assert not np.any(one[1:] == other[1:])


@pytest.mark.parametrize("optimiser", [None, optax.adam(0.1)], ids=["bfgs", "adam"])
def test_starts_as_one_program_as_on_an_accelerator(monkeypatch, optimiser):
    options = {"starts": 5, "steps": 12, "optimiser": optimiser}
    line = ("sum", of(lambda x, y: x + y))
    apart = tune(two_wells, toy(0.9), WELLS, constraints=[line], **options)
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    together = tune(two_wells, toy(0.9), WELLS, constraints=[line], **options)
    np.testing.assert_allclose(together.history.loss, apart.history.loss, rtol=1e-12)
    assert together.reasons == apart.reasons


# === constraints

CONSTRAINED = {  # loss, constraint, optimum, multiplier
    "line": (
        of(lambda x, y: (x - 3.0) ** 2 + (y - 2.0) ** 2),
        of(lambda x, y: x + y - 3.0),
        (2.0, 1.0),
        2.0,
    ),
    "circle": (of(lambda x, y: x + y), of(lambda x, y: x**2 + y**2 - 2.0), (-1.0, -1.0), 0.5),
    "not active": (
        of(lambda x, y: (x - 1.0) ** 2 + y**2),
        of(lambda x, y: x + y - 3.0),
        (1.0, 0.0),
        0.0,
    ),
    "residuals": (
        of(lambda x, y: jnp.stack([x - 3.0, y - 2.0])),
        of(lambda x, y: x + y - 3.0),
        (2.0, 1.0),
        2.0,
    ),
    "of another size": (
        of(lambda x, y: 1e6 * ((x - 3.0) ** 2 + (y - 2.0) ** 2)),
        of(lambda x, y: 1e-3 * (x + y - 3.0)),
        (2.0, 1.0),
        2e9,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("start", [(0.0, 0.5), (4.0, 4.0)], ids=["inside", "outside"])
@pytest.mark.parametrize("name", CONSTRAINED)
def test_constraint_in_closed_form(name, start):
    loss, excess, optimum, multiplier = CONSTRAINED[name]
    tuned = tune(loss, toy(*start), constraints=[("c", excess)])
    # A loss has no digits of a step below the square root of its rounding.
    np.testing.assert_allclose(found(tuned), optimum, rtol=0, atol=1e-7)
    assert float(tuned.multipliers["c"]) == pytest.approx(multiplier, rel=1e-6, abs=1e-7)
    scale = 1e-3 if name == "of another size" else 1.0
    assert float(tuned.excess["c"]) <= 1e-7 * scale
    assert "below" in tuned.reason
    assert tuned.history.excess["c"].shape == tuned.history.loss.shape


def test_constraint_by_a_first_order_optimiser():
    loss, excess, optimum, multiplier = CONSTRAINED["line"]
    slower = optax.adam(optax.exponential_decay(0.1, 100, 0.5))
    tuned = tune(loss, toy(), constraints=[("c", excess)], optimiser=slower, steps=900)
    np.testing.assert_allclose(found(tuned), optimum, rtol=0, atol=2e-3)
    assert float(tuned.multipliers["c"]) == pytest.approx(multiplier, rel=2e-2)


# === how it ends


def test_reasons_to_stop():
    assert tune(bowl, toy(3.0, 2.0)).reason == "gradient below 1e-10 of its largest"
    shrinking = optax.sgd(lambda count: 0.05 * 0.5**count)
    assert tune(bowl, toy(3.0, 2.0), optimiser=shrinking).reason == "step below 1e-10"
    short = tune(bowl, toy(3.0, 2.0), optimiser=optax.sgd(1e-3), steps=7)
    assert short.reason == "steps used up" and short.steps == 7


def test_a_loss_that_is_not_finite_ends_a_start_and_the_best_is_kept():
    """Steps of 1.5 from 5.2, the unit, down: finite at 5.2, 3.7, 2.2 and 0.7, no root of -0.8."""
    loss = of(lambda x, y: x + 0 * jnp.sqrt(x) + y**2)
    tuned = tune(loss, toy(5.2), optimiser=optax.sgd(1.5 / 5.2**2))
    assert tuned.reason == "not finite from step 4"
    assert float(tuned.values[X]) == pytest.approx(0.7)
    # A solver of optimistix steps back instead, to where the loss ends.
    assert float(tune(loss, toy(5.2)).values[X]) < 1e-3


def test_the_best_iterate_is_kept_where_a_kink_makes_it_chatter():
    """Steps of 0.2 from 1.0, the unit: .., 0.4, 0.2, 0.4, 0.2, about a kink at 0.33."""
    kink = of(lambda x, y: jnp.abs(x - 0.33) + y**2)
    tuned = tune(kink, toy(1.0), optimiser=optax.sgd(0.2), steps=31)
    np.testing.assert_allclose(
        tuned.history.values[X][0, -4:], [0.2, 0.4, 0.2, 0.4][::-1], atol=1e-12
    )
    assert float(tuned.values[X]) == pytest.approx(0.4, abs=1e-12)
    short = tune(kink, toy(1.0), optimiser=optax.sgd(0.2), steps=30)
    assert short.history.loss[0, -1] != pytest.approx(tuned.history.loss[0, -1])
    assert float(short.loss) == pytest.approx(0.07, abs=1e-12)


def test_history_and_words():
    """The gradient is by free numbers, which count in units of the first values, 3 and 2."""
    tuned = tune(bowl, toy(3.0, 2.0))
    assert tuned.history.loss.shape == tuned.history.gradient.shape == (1, tuned.steps)
    assert tuned.history.loss[0, 0] == pytest.approx(4.0 + 5 * 3.5**2 + 2)
    slope = np.hypot(3.0 * (4.0 + 5 * 3.5), 2.0 * 10 * 3.5)
    assert tuned.history.gradient[0, 0] == pytest.approx(slope, rel=1e-12)
    text = str(tuned).splitlines()
    assert text[0].startswith("Loss 2 after") and "optimistix BFGS: gradient below" in text[0]
    assert text[1] == "  gravity.angle = 1 rad, from 3"
    said, _, rows = shown(tuned)
    assert said == text[0] and rows[0] == ["gravity.angle", "1", "3", "rad"]


def test_progress_is_shown_when_asked(capfd):
    jr.tune(bowl, toy(3.0, 2.0), {X: None, Y: None}, progress=True, steps=5)
    assert "tuning" in capfd.readouterr().err


# === bad input

REFUSED = {
    "unknown path": (
        {"where": {"supports.anisotopy": (-1, 1)}},
        "did you mean `supports.anisotropy`",
    ),
    "no path": ({"where": {}}, "must name at least one parameter"),
    "reversed": ({"where": {X: (1.0, -1.0)}}, "must be a lower and a higher bound"),
    "not two": ({"where": {X: 3.0}}, "must be a lower and a higher bound"),
    "outside": ({"where": {X: (1.0, 2.0)}}, "must be between its bounds, 1 and 2"),
    "not allowed": (
        {"where": {"disc.mass": (-1.0, 20.0)}},
        "must be values it may have: disc.mass",
    ),
    "choice": ({"where": {"shaft.ends": (0, 1)}}, "is a whole number or a choice"),
    "vector of vectors": (
        {"loss": lambda s: jnp.ones((2, 2)) * s.get(X)},
        "array of shape \\(2, 2\\)",
    ),
    "no number": ({"loss": lambda s: None}, "must return real numbers, but returns None"),
    "complex": (
        {"loss": lambda s: 1j * s.get(X)},
        "must return real numbers, but returns complex128",
    ),
    "nan": (
        {"loss": lambda s: jnp.sqrt(s.get(X) - 5.0)},
        "The loss is nan at the scene's own values",
    ),
    "no slope": ({"loss": lambda s: jnp.sqrt(s.get(X))}, "no derivative by `gravity.angle`"),
    "flat": ({"loss": lambda s: s.get("disc.mass")}, "does not change with `gravity.angle` or"),
    "optimiser": ({"optimiser": "adam"}, "must be an optax gradient transformation"),
    "no gradients": ({"optimiser": optx.NelderMead(1e-3, 1e-3)}, "that goes by gradients"),
    "one number": ({"optimiser": optx.LevenbergMarquardt(1e-3, 1e-3)}, "returns a single number"),
    "steps": ({"steps": 0}, "`steps` must be a whole number"),
    "starts": ({"starts": 0}, "`starts` must be a whole number"),
    "mode": ({"mode": "backward"}, "`mode` must be 'forward' or 'reverse'"),
    "tolerance": ({"tolerance": 0.0}, "`tolerance` must be between 0 and 1"),
    "constraint": ({"constraints": [bowl]}, "must be a name and a function"),
    "two names": ({"constraints": [("a", bowl), ("a", bowl)]}, "a name of its own"),
    "vector": ({"constraints": [("a", residuals)]}, "Constraint 'a' must return a number"),
    "nan constraint": (
        {"constraints": [("a", lambda s: jnp.log(s.get(X) - 1.0))]},
        "Constraint 'a' is nan at the scene's own values",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_one_sentence(name):
    changed, sentence = REFUSED[name]
    arguments = {"loss": bowl, "where": {X: None, Y: None}} | changed
    loss, where = arguments.pop("loss"), arguments.pop("where")
    with pytest.raises(ValueError, match=sentence) as error:
        jr.tune(loss, toy(), where, progress=False, **arguments)
    assert str(error.value).endswith(".") and "\n" not in str(error.value)


def test_several_values_at_one_path_are_refused():
    scene = rotating().replace({"supports.0.stiffness": 9e4})
    with pytest.raises(ValueError, match=r"several values \(90000, 100000\)"):
        tune(bowl, scene, {"supports.stiffness": (1e4, 1e6)})
    one = tune(
        lambda s: s.get("supports.0.stiffness"),
        scene,
        {"supports.0.stiffness": (1e4, 1e6)},
        steps=2,
    )
    assert float(one.scene.get("supports.1.stiffness")) == 1e5


def test_tables_and_stations_that_pass_are_refused():
    profile = jr.SpeedProfile([0.0, 1.0], [10.0, 20.0])
    rotor = jr.load("two-discs")
    turned = jr.Scene(rotor.shaft, *rotor.effects, spin=profile)
    with pytest.raises(ValueError, match="`spin.times` is a table of numbers"):
        tune(bowl, turned, {"spin.times": (0.0, 1.0)})
    with pytest.raises(ValueError, match="let a station pass another"):
        tune(lambda s: s.get("discs.0.at"), rotor, {"discs.0.at": (0.1, 1.2)})


# === picture


@pytest.mark.slow
@pytest.mark.parametrize("where", [WELLS, {X: (-2.0, 2.0)}], ids=["two", "one"])
def test_plot_of_a_tuning(where):
    tuned = tune(two_wells, toy(0.9, 0.1), where, starts=3, steps=15)
    upper, lower = plot.tuning(tuned)
    assert upper.get_ylabel() == "loss" and lower.get_xlabel() == "steps [1]"
    heavy = [line for line in upper.lines if line.get_linewidth() == 1.2]
    np.testing.assert_array_equal(heavy[0].get_ydata(), tuned.history.loss[tuned.start])
    assert lower.get_ylabel() == (
        "gravity angle [rad]" if len(where) == 1 else "share of the range [1]"
    )
    plt.close(upper.figure)
