"""Plots of motions at any speed: run-ups, reactions, balancers, films."""

from dataclasses import replace

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn import check_axes, legend, lines
from matplotlib.animation import FFMpegWriter
from matplotlib.colors import to_hex
from PIL import Image
from shown import shown

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.plot import colours


pytestmark = pytest.mark.usefixtures("rendered")

SUPPORT, PIVOT = "support at 400 mm", "constraints.0 at 0 mm"
STATIC = ("static", "static_moment")


def rows(*angles):
    """Motion of balls that are at these angles, at rest in the axes of the shaft."""
    return tuple(jr.Balls(jnp.asarray(row), jnp.zeros(np.shape(row))) for row in angles)


@pytest.fixture(scope="module")
def run():
    """The first second of a ramp, 10 to 20 rad/s, of a tilting shaft with two rows of balls.

    In place of its own motion 2 mm of whirl that grows to 3 mm, and balls that go round once.
    """
    scene = jr.Scene(
        jr.RigidShaft(0.14, (jr.Constraint(0.0),)),
        jr.Disc(0.14, 1.0),
        jr.Support(0.14, 1e3, 5.0),
        jr.Unbalance(0.14, 1.0, 2e-3),
        jr.BallBalancer(0.14, 0.025, 0.06, 1.0),
        jr.BallBalancer(0.14, 0.02, 0.05, 1.0, places=3, in_use=1),
        spin=jr.SpeedProfile.ramp(10.0, 30.0, 2.0),
    )
    starts = [0.0, np.pi / 2], [-np.pi / 2, 1.0, 2.0]
    found = jr.run_up(scene, np.linspace(0.0, 1.0, 201), start=jr.Launch(balls=rows(*starts)))
    turn = 2 * np.pi * found.time[:, None]
    return replace(
        found,
        displacement=((2e-3 + 1e-3 * found.time) * jnp.exp(1j * found.angle))[:, None],
        balls=rows(*(turn + jnp.array(row) for row in starts)),
    )


@pytest.fixture(scope="module")
def pressed():
    """Two bearings in closed form: 3 N turn with the shaft, and a weight of 4 N alone.

    The weight is at the pivot. The unbalance of `m e W^2` = 3 N is at the support, whose spring alone
    answers to it: a disc of equal moments of inertia whirls with the speed without any moment.
    """
    speed, stiffness = 2 * np.pi, 1e3
    scene = jr.Scene(
        jr.RigidShaft(0.4, (jr.Constraint(0.0),)),
        jr.Disc(0.0, 4.0 / 9.80665, 1.0, 1.0),
        jr.Support(0.4, stiffness),
        jr.Unbalance(0.4, 1.0, 3.0 / speed**2, np.pi),
        jr.Gravity(),
        spin=jr.ConstantSpeed(speed),
    )
    start = jr.Whirl(3.0 / stiffness, speed, np.pi)
    return jr.reactions(jr.simulate(scene, 2, 50, start=start, at=0.4))


@pytest.mark.parametrize(
    "draw",
    [
        lambda run, _, ax: plot.passage(run, ax=ax),
        lambda run, _, ax: plot.balancer_at(run, 0.5, ax=ax),
        lambda _, pressed, ax: plot.reactions(pressed, ax=ax),
        lambda _, pressed, ax: plot.reaction_vectors(pressed, 1.0, ax=ax),
        lambda _, pressed, ax: plot.hodograph(pressed, ax=ax),
    ],
    ids=["passage", "balancer_at", "reactions", "reaction_vectors", "hodograph"],
)
def test_draws_in_given_axes_or_a_figure_of_its_own(run, pressed, draw):
    check_axes(lambda ax: draw(run, pressed, ax))


# === run-ups


def test_speed_and_acceleration_in_time(run):
    upper, lower = plot.speed(run)
    np.testing.assert_allclose(upper.lines[0].get_ydata()[[0, -1]], [10.0, 20.0])
    np.testing.assert_allclose(lower.lines[0].get_ydata(), 10.0)
    assert upper.get_ylabel() == "speed [rad/s]" and lower.get_xlabel() == "time [s]"
    assert lower.get_ylabel() == "acceleration [rad/s$^2$]"
    with plot.units(speed="rpm"):
        upper, _ = plot.run_up(run)[::-1]
        over = plot.passage(run)
    assert upper.get_ylabel() == "speed [rpm]"
    assert over.get_xlabel() == "speed of rotation [rpm]"
    for drawn in (upper.lines[0].get_ydata(), over.lines[0].get_xdata()):
        np.testing.assert_allclose(drawn[[0, -1]], np.array([300.0, 600.0]) / np.pi)


def test_acceleration_at_the_end_of_a_profile_is_that_of_the_run(run):
    """The profile is constant after its last time, where this run ends."""
    spin = jr.SpeedProfile.ramp(10.0, 20.0, 1.0)
    scene = jr.Scene(run.scene.shaft, *run.scene.effects, spin=spin)
    ended = replace(run, scene=scene, acceleration=spin.turning(run.time).acceleration)
    assert ended.acceleration[-1] == 0.0
    np.testing.assert_allclose(plot.speed(ended)[1].lines[0].get_ydata(), 10.0)


def test_amplitude_of_a_run_up(run):
    upper, lower = plot.run_up(run)
    np.testing.assert_allclose(upper.lines[0].get_ydata()[[0, -1]], [2.0, 3.0])
    assert upper.get_ylabel() == "amplitude [mm]"
    np.testing.assert_allclose(lower.lines[0].get_ydata()[[0, -1]], [10.0, 20.0])
    ax = plot.passage(replace(run, displacement=1e-3 * run.displacement))
    np.testing.assert_allclose(ax.lines[0].get_xdata()[[0, -1]], [10.0, 20.0])
    np.testing.assert_allclose(ax.lines[0].get_ydata()[[0, -1]], [2.0, 3.0])
    assert ax.get_ylabel() == "amplitude [\N{MICRO SIGN}m]"
    assert ax.get_xlabel() == "speed of rotation [rad/s]"


def test_passage_marks_contact_and_the_critical_speed():
    """A mass of 2 kg on 5 kN/m (50 rad/s), in contact where the amplitude exceeds the gap."""
    scene = jr.Scene(
        jr.MasslessShaft(0.4, 0.2, 5e3),
        jr.Disc(0.2, 2.0, 0.0, 0.0, offset=1e-3),
        jr.DiscDamping(0.2, 8.0),
        jr.Limiter(0.2, 0.0, 3e-3, 4e4, 20.0),
        spin=jr.SpeedProfile.ramp(10.0, 90.0, 2.0),
    )
    run = jr.run_up(scene, np.linspace(0, 2, 801))
    ax = plot.passage(run)
    drawn = lines(ax)
    assert drawn["critical, forward"].get_xdata()[0] == pytest.approx(50.0)
    assert [text.get_text() for text in ax.texts] == ["50"]  # the backward one is not excited
    np.testing.assert_allclose(drawn["clearance"].get_ydata(), 3.0)
    touched = drawn["contact"].get_ydata()
    assert legend(ax) == ["no contact", "contact", "clearance", "critical, forward"]
    assert np.nanmin(touched) > 2.99 and np.isnan(touched[0])
    with plot.units(speed="rpm", length="um"):
        far = plot.passage(replace(run, scene=run.scene.replace({"limiters.gap": 1.0})))
    assert [text.get_text() for text in far.texts] == [f"{50 * 30 / np.pi:.4g}"]
    assert legend(far)[2] == "clearance 1e+06 \N{MICRO SIGN}m, beyond" and far.get_ylim()[1] < 1e5


# === reactions


def test_reactions_are_magnitudes_with_their_static_part(pressed):
    drawn = lines(plot.reactions(pressed))
    assert list(drawn) == [SUPPORT, PIVOT, f"{PIVOT} at rest"]
    np.testing.assert_allclose(drawn[SUPPORT].get_ydata(), 3.0)
    np.testing.assert_allclose(drawn[f"{PIVOT} at rest"].get_ydata(), 4.0)
    assert to_hex(drawn[SUPPORT].get_color()).upper() == colours.CYCLE[0]


@pytest.mark.parametrize(
    "factor, moment, size, label",
    [
        (1.0, False, 3.0, "reaction [N]"),
        (1e4, False, 30.0, "reaction [kN]"),
        (1.0, True, 0.3, "moment [N m]"),
    ],
)
def test_reactions_have_units(pressed, factor, moment, size, label):
    force, static = factor * pressed.force, factor * pressed.static
    large = replace(pressed, force=force, moment=0.1 * force, static=static)
    ax = plot.reactions(large, moment=moment)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), size)
    assert ax.get_ylabel() == label


def test_reactions_are_a_table_in_a_notebook(pressed):
    sentence, heads, rows = shown(pressed)
    assert sentence.startswith("Reactions at") and heads[0] == "reaction"
    found = {name: [float(one) for one in (largest, rest)] for name, largest, _, rest in rows}
    assert found[SUPPORT] == pytest.approx([3.0, 0.0], abs=1e-9)
    assert found[PIVOT] == pytest.approx([4.0, 4.0], abs=1e-9)


def test_reaction_vectors_at_an_instant(pressed):
    for rotating, tip in ((False, 3 * np.exp(2j * np.pi * 0.3)), (True, 3.0)):
        ax = plot.reaction_vectors(pressed, 0.301, rotating=rotating)
        arrow = ax.collections[0]
        np.testing.assert_allclose(arrow.U[0] + 1j * arrow.V[0], tip, atol=1e-12)
        assert ("axes of the shaft" in ax.get_xlabel()) == rotating
        assert ax.get_xlabel().endswith("[N]") and ax.texts[0].get_text() == "0.3 s"
    with pytest.raises(ValueError, match="within the run"):
        plot.reaction_vectors(pressed, 3.0)


def test_hodograph_of_a_turning_force(pressed):
    path = lines(plot.hodograph(pressed))[SUPPORT]
    np.testing.assert_allclose(np.hypot(path.get_xdata(), path.get_ydata()), 3.0)
    fixed = lines(plot.hodograph(pressed, rotating=True))
    np.testing.assert_allclose(fixed[SUPPORT].get_xdata(), 3.0)
    turned = fixed[PIVOT].get_xdata() + 1j * fixed[PIVOT].get_ydata()
    np.testing.assert_allclose(turned, 4j * np.exp(-2j * np.pi * pressed.time), atol=1e-12)


def test_reactions_of_nothing(pressed):
    none = {name: getattr(pressed, name)[..., :0] for name in ("force", "moment", *STATIC)}
    nothing = replace(pressed, names=(), **none)
    with pytest.raises(ValueError, match="no supports"):
        plot.hodograph(nothing)


def symmetric(*effects, samples=3):
    """Reactions of a disc in the middle of two pins, off centre."""
    shaft = jr.RigidShaft(0.4, (jr.Constraint(0.0), jr.Constraint(0.4)))
    spin = jr.ConstantSpeed(100.0)
    scene = jr.Scene(shaft, jr.Disc(0.2, 2.0, 0.0, 0.02, offset=1e-3), *effects, spin=spin)
    return jr.reactions(jr.run_up(scene, np.linspace(0.0, 0.2, samples)))


def test_equal_reactions_can_be_told_apart():
    found = symmetric(samples=999)
    for ax in (plot.reactions(found), plot.hodograph(found)):
        first, second = [line for line in ax.lines if len(line.get_xdata()) > 2]
        assert first.get_linestyle() == "-" and second.get_linestyle() == "--"
        names = ["constraints.0 at 0 mm", "constraints.1 at 400 mm"]
        assert legend(ax) == names


def test_a_force_that_is_never_there_has_no_legend():
    ax = plot.reactions(symmetric(jr.Limiter(0.2, 0.0, 1e-3, 1e5)))
    assert len(ax.get_legend().get_texts()) == 2


def test_a_coarse_hodograph_is_round():
    """A reaction `m e W^2 / 2` = 10 N about the weight, 2 g / 2, at three samples in three revolutions."""
    ax = plot.hodograph(symmetric(jr.Gravity()))
    path = ax.lines[0].get_xdata() + 1j * ax.lines[0].get_ydata()
    weight = np.mean([np.min(path.imag), np.max(path.imag)]) * 1j
    assert abs(weight) == pytest.approx(9.80665, rel=1e-2)
    assert np.abs(path - weight) == pytest.approx(10.0, rel=1e-2)
    assert any("samples per revolution, interpolated" in text.get_text() for text in ax.texts)


def test_a_force_of_rounding_has_no_static_part():
    """The support carries all of the weight: the pivot carries 2e-15 N, which is rounding."""
    scene = jr.Scene(
        jr.RigidShaft(0.4, (jr.Constraint(0.0),)),
        jr.Disc(0.4, 1.0, offset=1e-3),
        jr.Support(0.4, 1e3),
        jr.Gravity(),
        spin=jr.ConstantSpeed(100.0),
    )
    found = jr.reactions(jr.run_up(scene, np.array([0.0, 0.1, 0.2])))
    assert 0 < abs(found.static[1]) < 1e-14
    assert legend(plot.reactions(found)) == [SUPPORT, f"{SUPPORT} at rest"]


def test_no_place_at_rest():
    """A weight on a pivot alone has no static part; coarse samples are joined by chords."""
    scene = jr.Scene(
        jr.RigidShaft(0.4, (jr.Constraint(0.0),)),
        jr.Disc(0.2, 2.0, 0.01, 0.02),
        jr.Unbalance(0.4, 1.0, 1e-3),
        jr.Gravity(),
        spin=jr.ConstantSpeed(100.0),
    )
    found = jr.reactions(jr.run_up(scene, np.array([0.0, 0.1, 0.2])))
    assert np.isnan(found.static).all()
    assert legend(plot.reactions(found)) == [PIVOT]
    ax = plot.hodograph(found)
    path = lines(ax)[PIVOT]
    np.testing.assert_allclose(path.get_xdata() + 1j * path.get_ydata(), found.force[:, 0])
    assert ax.texts[0].get_text().endswith("samples per revolution")


@pytest.mark.parametrize("draw", [plot.reactions, plot.hodograph])
def test_pins_have_no_moments_to_name(pressed, draw):
    assert draw(pressed, moment=True).get_legend() is None


# === balancer


def test_balls_by_row_and_what_they_leave(run):
    upper, lower = plot.balls(run)
    blue, orange = colours.BLUE, colours.ORANGE
    assert [to_hex(line.get_color()).upper() for line in upper.lines] == [blue, blue, orange]
    drawn = lines(upper)["row 1, 2 balls"].get_ydata()
    np.testing.assert_allclose(drawn[:200], 360 * np.linspace(0.0, 1.0, 201)[:200], atol=1e-9)
    once = upper.lines[1].get_ydata()  # begins at 90 degrees, passes 360 at three quarters
    assert np.isnan(once).sum() == 1 and once[-1] == pytest.approx(90.0)
    assert "row 2, 1 ball" in lines(upper)
    left, turn = lines(lower), 2j * np.pi * run.time
    thrown = (1.5e-3 + 1.5e-3j) * np.exp(turn) - 1e-3j * np.exp(turn)
    np.testing.assert_allclose(left["rotor and balls"].get_ydata(), 1e3 * np.abs(2e-3 + thrown))
    np.testing.assert_allclose(left["rotor alone"].get_ydata(), 2.0)
    assert lower.get_ylabel() == "imbalance [g m]" and "[deg]" in upper.get_ylabel()


def test_balls_that_balance_are_on_a_logarithmic_scale(run):
    assert plot.balls(run)[1].get_yscale() == "linear"
    pair = np.pi - 10.0 ** np.linspace(0.0, -9.0, 201)[:, None] * np.ones(2)
    settling = replace(run, balls=rows(pair, np.zeros((201, 3))))
    lower = plot.balls(settling)[1]
    assert lower.get_yscale() == "log"
    top = 1e3 * np.abs(3e-3 + 3e-3 * np.exp(1j * pair)).max()
    np.testing.assert_allclose(lower.get_ylim(), [1e-6 * top, 2 * top])


def test_balancer_is_drawn_to_scale(run):
    sized = replace(run, scene=run.scene.replace({"ball_balancers.ball_radius": 0.008}))
    ax = plot.balancer_at(sized, 0.0)
    circles = [(*patch.center, patch.radius) for patch in ax.patches]
    expected = [(0, 0, 60), (60, 0, 8), (0, 60, 8), (0, 0, 50), (0, -50, 8)]
    np.testing.assert_allclose(circles, expected, atol=1e-6)
    arrows = {a.get_label(): complex(a.U[0], a.V[0]) for a in ax.collections}
    each = 60 / 4.0  # mm per g m: the balls can balance 4 g m
    assert arrows["rotor"] == pytest.approx(2 * each)
    assert arrows["row 1, 2 balls"] == pytest.approx((1.5 + 1.5j) * each)
    assert arrows["row 2, 1 ball"] == pytest.approx(-1j * each)
    assert arrows["remaining"] == pytest.approx((3.5 + 0.5j) * each)
    assert "radius = 4 g m" in [text.get_text() for text in ax.texts]
    assert ax.get_xlabel() == "x of the rotor [mm]" and ax.get_aspect() == 1.0


def test_balls_without_a_radius_are_of_steel(run):
    ball = plot.balancer_at(run, 0.0).patches[1]
    assert 4 / 3 * np.pi * (1e-3 * ball.radius) ** 3 * 7850 == pytest.approx(0.025)


def test_balls_need_a_balancer(run):
    without = replace(run, scene=run.scene.without("ball_balancers"), balls=())
    with pytest.raises(ValueError, match="BallBalancer"):
        plot.balls(without)


# === films


def test_animation_is_a_film(run, tmp_path):
    path = tmp_path / "film.gif"
    plot.animate(run, path, seconds=0.4, rate=10)
    with Image.open(path) as film:
        assert film.n_frames == 4 and film.width > 600
    assert not plt.get_fignums()


def test_animation_says_what_it_writes(run, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=".gif or .mp4"):
        plot.animate(run, tmp_path / "film.avi")
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(ValueError, match="ffmpeg"):
        plot.animate(run, tmp_path / "film.mp4")
    for wrong, said in (
        ({"station": 3}, "`station`"),
        ({"seconds": 0}, "0 and 15"),
        ({"rate": 0}, "4 and 0"),
    ):
        with pytest.raises(ValueError, match=said):
            plot.animate(run, tmp_path / "film.gif", **wrong)
    with pytest.raises(ValueError, match="no/film.gif cannot be written"):
        plot.animate(run, tmp_path / "no" / "film.gif")
    assert not list(tmp_path.iterdir())
