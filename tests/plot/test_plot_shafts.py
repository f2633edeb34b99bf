"""Pictures of several shafts: where they and their parts are drawn, and lines of every speed."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn import legend, lines
from matplotlib.colors import to_hex

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.plot import colours
from jaxrotor.plot.marks import amplitudes


pytestmark = pytest.mark.usefixtures("rendered")


@pytest.fixture(autouse=True, scope="module")
def closed():
    yield
    plt.close("all")


def boxes(ax, colour):
    """Sides left, right, lower and upper of every box of a colour."""
    own = [one for one in ax.patches if to_hex(one.get_facecolor()).upper() == colour]
    sides = [
        (b.get_x(), b.get_x() + b.get_width(), *sorted((b.get_y(), b.get_y() + b.get_height())))
        for b in own
    ]
    return np.array(sides)


def test_a_hollow_shaft_is_a_tube_around_the_first_one():
    """hp from 300 to 682 mm, radii 14 and 17 mm; the bearing between the shafts fills 10 to 14 mm."""
    ax = plot.rotor(jr.load("dual-rotor"))
    assert legend(ax) == ["lp", "hp", "disc", "support", "bearing between shafts", "unbalance"]
    grey = lambda shade: to_hex(str(shade)).upper()
    np.testing.assert_allclose(boxes(ax, grey(0.85)), [[0, 962, -10, 10]])
    np.testing.assert_allclose(
        boxes(ax, grey(0.6)), [[300, 682, 14, 17], [300, 682, -17, -14]], atol=1e-9
    )
    joint = boxes(ax, colours.MAGENTA)
    assert joint[:, :2].mean() == pytest.approx(682)
    np.testing.assert_allclose(joint[:, 2:], [[10, 14], [-14, -10]])
    discs = [b for b in ax.patches if b.get_alpha() == 0.6]
    assert len(discs) == 6  # those of lp, and two halves of each of hp, above and below its tube
    heights = sorted(round(b.get_height(), 6) for b in discs)
    lp, hp = (
        np.hypot(125.0, 10.0),
        np.hypot(125.0, 17.0),
    )  # solid discs of the inertia of bored ones
    assert heights == pytest.approx([hp - 17.0] * 4 + [2 * lp] * 2)
    (heavy,) = [line for label, line in lines(ax).items() if label == "unbalance"]
    np.testing.assert_allclose(heavy.get_xdata(), [270.5, 718.5, 450.5, 592.5])
    np.testing.assert_allclose(heavy.get_ydata(), [10, 10, 17, 17])
    assert "not drawn" not in ax.get_xlabel()


def test_shafts_end_to_end_are_drawn_one_after_the_other():
    """The second one begins beyond the first one, solid, in a pin of its own 0.2 m from its end."""
    shafts = {
        "a": jr.FlexibleShaft(0.5, 0.02, nodes=3),
        "b": jr.CoaxialShaft(
            jr.FlexibleShaft(0.4, 0.03, nodes=3, constraints=[jr.Constraint(0.2)]), start=0.6
        ),
    }
    held = [jr.Support(at=("a", x), kxx=1e6) for x in (0.0, 0.5)]
    ax = plot.rotor(jr.Scene(shafts, *held, jr.Disc(("b", 0.7), 1.0), spin=jr.ConstantSpeed(9.0)))
    np.testing.assert_allclose(boxes(ax, to_hex("0.6").upper()), [[600, 1000, -15, 15]])
    drawn = lines(ax)
    assert drawn["pin"].get_xdata()[0] == pytest.approx(800)
    assert (drawn["mass"].get_xdata()[0], drawn["mass"].get_ydata()[0]) == pytest.approx((700, 15))
    low, high = ax.get_xlim()
    assert low < 0 and high > 1000


@pytest.mark.slow  # follows branches
def test_campbell_has_a_line_of_every_shaft():
    """`|Omega|` and `1.2 |Omega|`; rings by hp are at the critical speeds by hp, over its ratio."""
    scene = jr.load("counter-rotor")
    result = jr.campbell(scene, np.linspace(0.0, 300.0, 61), 4)
    np.testing.assert_allclose(result.turning("hp"), -1.2 * np.asarray(result.speeds), rtol=1e-14)
    at = result.crossings(1, "hp")
    undamped = jr.critical_speeds(scene, by="hp")
    for way, kind in ((1, "forward"), (-1, "backward")):
        own = np.asarray(at.speeds)[np.asarray(at.forward) == way]
        expected = np.asarray(getattr(undamped, kind))[: own.size] / -1.2
        np.testing.assert_allclose(own, expected, rtol=2e-3)
    upper, _ = plot.campbell(result, critical=undamped)
    drawn = lines(upper)
    for name, factor, style in (("1x lp", 1.0, "--"), ("1x hp", 1.2, "-.")):
        x, y = drawn[name].get_data()
        np.testing.assert_allclose(y, factor * np.abs(x), atol=1e-9)
        assert drawn[name].get_linestyle() == style
    assert {"forward of lp", "backward of lp"} < set(legend(upper))
    texts = [text.get_text() for text in upper.texts]
    assert any("forward" in text and text.endswith("1x hp") for text in texts)
    x, y = drawn["critical speed, undamped"].get_data()
    np.testing.assert_allclose(y, 1.2 * x, rtol=1e-12)
    mirrored, _ = plot.campbell(result, mirrored=True)
    rings = np.concatenate(
        [np.transpose(one.get_data()) for one in mirrored.lines if one.get_marker() == "o"]
    )
    x, y = np.transpose(rings)  # on the branches as drawn: backward whirl of lp at negative speeds
    ahead = np.asarray(result.forward)[-1] > 0
    curves = np.abs(np.asarray(result.frequencies))
    for at, height in zip(x, y, strict=True):
        own = curves[:, ahead if at > 0 else ~ahead]
        beside = [np.interp(abs(at), np.asarray(result.speeds), one) for one in own.T]
        assert min(abs(one - height) for one in beside) < 1e-2 * height


def test_stops_are_those_of_one_shaft():
    """At 0.5 m there is room of 1 mm for hp, of 2 mm for lp, by its own name or as the first."""
    scene = jr.load("dual-rotor")
    stops = [jr.Limiter((name, 0.5), 0.0, gap, 1e6) for name, gap in (("hp", 1e-3), ("lp", 2e-3))]
    scene = scene.of_parts(*scene.effects, *stops)
    found = [amplitudes(scene, 0.5, shaft) for shaft in ("hp", "lp", None)]
    assert found == [[1e-3], [2e-3], [2e-3]]
