"""Half a matrix or half an inertia: what is taken for the other half, or the sentence that asks for it."""

import fem
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor.cli.show import _parameter
from jaxrotor.core import pchip


STEEL = (2.1e11, 7850.0, np.inf)  # without shear
BEARINGS = """\
[shaft]
length = "1 m"
diameter = "50 mm"
constraints = []
[disc]
at = "0.5 m"
mass = "10 kg"
[[support]]
at = "0 m"
kxx = "10 MN/m"
[[support]]
at = "1 m"
kxx = "10 MN/m"
[spin]
speed = "1000 rpm"
"""
FAN = """\
[shaft]
length = "0.9 m"
diameter = "50 mm"
constraints = []
[disc]
at = "0.9 m"
mass = "30 kg"
polar = "1.8 kg m^2"
[[support]]
at = "0 m"
kxx = "8e7 N/m"
kyy = "4e7 N/m"
[[support]]
at = "0.5 m"
kxx = "8e7 N/m"
kyy = "4e7 N/m"
[spin]
speed = "1500 rpm"
"""


@pytest.mark.slow
def test_kxx_alone_is_kxx_and_kyy():
    """Critical speeds of finite elements with equal springs along x and y."""
    spring = 1e7 * np.eye(2)
    _, speeds, _, _ = fem.critical_speeds(
        [fem.Stretch(1.0, 0.05)],
        [(0.5, 10.0, 0.0, 0.0)],
        [(0.0, spring), (1.0, spring)],
        STEEL,
        0.05,
        4,
    )
    found = jr.critical_speeds(jr.loads(BEARINGS))
    np.testing.assert_allclose(found.speeds[:4], speeds, rtol=1e-6)


@pytest.mark.slow
def test_polar_alone_is_a_thin_disc():
    """Critical speeds of finite elements with a diametral inertia of half the polar one."""
    spring = np.diag([8e7, 4e7])
    _, speeds, _, _ = fem.critical_speeds(
        [fem.Stretch(0.9, 0.05)],
        [(0.9, 30.0, 0.9, 1.8)],
        [(0.0, spring), (0.5, spring)],
        STEEL,
        0.05,
        3,
    )
    found = jr.critical_speeds(jr.loads(FAN))
    np.testing.assert_allclose(found.speeds[:3], speeds, rtol=1e-6)


def one_mass(**given):
    """A mass of 1 kg on a support alone: `s^2 + s c + k = 0` along each axis."""
    return jr.Scene(
        jr.RigidShaft(1.0, (jr.Constraint(0.0),)),
        jr.Disc(1.0, 1.0),
        jr.Support(1.0, **given),
        spin=jr.ConstantSpeed(1.0),
    )


def test_the_other_half_follows_its_partner():
    """Values, derivatives and flags of `kyy = kxx` are those of both given, until kyy is given itself."""
    alone, both = one_mass(kxx=4.0, cxx=0.2), one_mass(kxx=4.0, kyy=4.0, cxx=0.2, cyy=0.2)
    expected = -0.1 + 1j * np.sqrt(4.0 - 0.01)
    for scene in (alone, both):
        np.testing.assert_allclose(sorted(jr.roots(scene), key=np.imag)[1], expected, rtol=1e-14)
    moved = jr.roots(alone.replace({"support.kxx": 9.0}))
    np.testing.assert_allclose(np.abs(moved.imag), np.sqrt(9.0 - 0.01), rtol=1e-14)
    slope = jax.jacfwd(lambda k: jr.roots(alone.replace({"support.kxx": k})).imag.max())(4.0)
    np.testing.assert_allclose(slope, 0.5 / np.sqrt(4.0 - 0.01), rtol=1e-12)
    unequal = alone.replace({"support.kyy": 9.0})
    found = np.sort(np.abs(np.asarray(jr.roots(unequal)).imag))
    np.testing.assert_allclose(found, np.sqrt(np.repeat([4.0, 9.0], 2) - 0.01), rtol=1e-12)
    assert jr.assemble(alone).blocks.fixed_stiffness is None
    with pytest.raises(ValueError, match="absent from this scene .None.; `kxx` is taken for it"):
        alone.get("support.kyy")


@pytest.mark.parametrize("over", ["speeds", "frequencies"])
def test_of_tables_too(over):
    nodes = {over: [0.0, 10.0], "kxx": [1.0, 3.0]}
    own = jr.Support(0.5, **nodes)
    read = own.at_speed(5.0) if over == "speeds" else own.at_whirl(5.0)
    assert float(read.kxx) == 2.0 and read.kyy is None and own.vanishing == read.vanishing
    between = jr.Support(of="a", on="b", **nodes)
    assert between.kyy is None and between.mean_stiffness.tolist() == [1.0, 3.0]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"kyy": 1.0}, "A support needs a stiffness; give `kxx [N/m]`"),
        ({"kxx": 1.0, "kxy": 1.0}, "`kxy [N/m]` is given without `kyx [N/m]`; give that too: 0 if"),
        ({"kxx": 1.0, "kyx": 1.0}, "`kyx [N/m]` is given without `kxy [N/m]`"),
        ({"kxx": 1.0, "cyy": 1.0}, "`cyy [N s/m]` is given without `cxx [N s/m]`"),
        ({"kxx": 1.0, "cxy": 1.0, "cyx": -1.0}, "`cxy [N s/m]` is given without `cxx [N s/m]`"),
        ({"kxx": 1.0, "cxx": 1.0, "cyx": 0.0}, "`cyx [N s/m]` is given without `cxy [N s/m]`"),
        ({"stiffness": 1.0, "cross_damping": 1.0}, "`cross_damping [N s/m]` goes with `damping"),
        ({"stiffness": 1.0, "angle": 1.0}, "`angle [rad]` belongs to `anisotropy [1]`"),
        ({"kyy": [1.0, 2.0], "speeds": [0.0, 1.0]}, "give `kxx [N/m]`, and kyy if it differs"),
    ],
)
@pytest.mark.parametrize("ends", [{"at": 0.5}, {"of": "a", "on": "b"}])
def test_other_halves_are_asked_for(ends, given, sentence):
    with pytest.raises(ValueError) as error:
        jr.Support(**ends, **given)
    assert sentence in str(error.value) and str(error.value).endswith(".")


def test_a_disc_by_half_of_its_inertia():
    """`I_d = |I_p| / 2` of a thin disc; a diametral inertia alone may belong to anything."""
    for polar in (0.6, -0.6):
        assert [float(one) for one in jr.Disc(0.1, 2.0, polar=polar).inertia] == [0.3, polar]
    assert jr.Disc(0.1, 2.0).inertia is None
    with pytest.raises(ValueError, match="without `polar .kg m.2.`; give that too: twice"):
        jr.Disc(0.1, 2.0, 0.3)
    with pytest.raises(ValueError, match="`tilt .rad.` belongs to a disc with moments of inertia"):
        jr.Disc(0.1, 2.0, tilt=0.1)


def test_what_is_taken_is_shown_and_written():
    text = BEARINGS.replace('"10 kg"', '"10 kg"\npolar = 0.4')
    scene = jr.loads(text)
    assert "kyy = 1e+07, 1e+07 N/m, = kxx" in str(scene)
    assert "disc.diametral = 0.2 kg m^2, = abs(polar) / 2" in str(scene)
    written = jr.files.dumps(scene)
    assert "kxx = 10000000.0 # N/m; kyy = kxx\n" in written
    assert "polar = 0.4 # kg m^2; diametral = abs(polar) / 2\n" in written
    again = jr.loads(written)
    assert str(again) == str(scene) and again.leaves("supports.kyy") == [None, None]
    shown = {path: _parameter(scene, path) for path in ("supports.kyy", "disc.diametral")}
    assert shown["supports.kyy"] == {"value": [1e7, 1e7], "unit": "N/m", "taken": "kxx"}
    assert shown["disc.diametral"]["value"] == 0.2
    one = jr.loads(text.replace("[[support]]", "[[support]]\nkyy = 3e7", 1))
    assert _parameter(one, "supports.kyy")["value"] == [3e7, 1e7]
    assert _parameter(one, "supports.kyy")["taken"] == "kxx where not given"


# === tables by straight lines


def test_linear_tables_are_those_of_numpy():
    """Values within, at nodes and at the ends, NaN beyond; one derivative at a kink is that above it."""
    nodes, values = jnp.array([0.0, 1.0, 3.0, 4.0]), jnp.array([[1.0, 2.0, 0.0, 5.0], [0.0] * 4])
    places = np.array([-0.1, 0.0, 0.4, 1.0, 2.5, 3.0, 4.0, 4.1])
    found = jax.vmap(lambda x: pchip.linear(x, nodes, values))(places)[:, 0]
    expected = np.interp(places, nodes, values[0], left=np.nan, right=np.nan)
    np.testing.assert_allclose(found, expected, rtol=1e-15)
    slope = jax.vmap(jax.grad(lambda x: pchip.linear(x, nodes, values)[0]))(places[1:-1])
    np.testing.assert_allclose(slope, [1.0, 1.0, -1.0, -1.0, 5.0, 5.0], rtol=1e-15)


def test_interpolation_is_a_key_of_a_file():
    bearing = {"kxx": [1.0, 2.0, 9.0], "speeds": [0.0, 1.0, 2.0], "interpolation": "linear"}
    assert float(jr.Support(0.5, **bearing).at_speed(1.5).kxx) == 5.5
    scene = one_mass(**bearing)
    assert "interpolation='linear'" in repr(scene) and scene.of(jr.Support)[0].kyy is None
    again = jr.loads(jr.files.dumps(scene)).of(jr.Support)[0]
    assert again.interpolation == "linear"
    text = jr.files.dumps(scene).replace('"linear"', '"cubic"')
    with pytest.raises(jr.SceneError, match="interpolation must be 'pchip' or 'linear', but is"):
        jr.loads(text)
