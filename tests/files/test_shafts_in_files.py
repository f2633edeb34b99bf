"""Several shafts in scene files: the round trip, and one sentence for every mistake."""

import jax
import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor.core.plausibility import ImplausibleWarning
from jaxrotor.files.several_shafts import station
from jaxrotor.files.toml import dumps, load, loads
from jaxrotor.files.units import SceneError


TWO = """\
[shafts.lp]
length = "0.962 m"
diameter = "20 mm"
[shafts.hp]
length = "0.382 m"
diameter = "34 mm"
inner_diameter = "28 mm"
ratio = 1.3
start = "0.3 m"
[[supports]]
at = "lp 0 m"
kxx = 5e5
[[supports]]
at = "lp 0.962 m"
kxx = 6e5
[[supports]]
at = "hp 0.3 m"
kxx = 8e5
[[supports]]
at = "hp 0.682 m"
on = "lp"
kxx = 6e5
[spin]
speed = 250
"""


def with_(old, new):
    assert TWO.count(old) == 1
    return TWO.replace(old, new)


def same(one, two):
    leaves, others = jax.tree.leaves(one), jax.tree.leaves(two)
    assert jax.tree.structure(one) == jax.tree.structure(two)
    for a, b in zip(leaves, others, strict=True):
        assert a.dtype == b.dtype and np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_the_first_table_is_the_reference():
    scene = loads(TWO)
    (hp,) = scene.of(jr.CoaxialShaft)
    assert scene.shafts == ("lp", "hp") and (hp.name, hp.shaft) == ("hp", "hp")
    assert float(hp.ratio) == 1.3 and float(hp.start) == 0.3 and hp.speed is None
    assert float(scene.shaft.length) == 0.962 and float(hp.body.inner_diameter) == 0.028
    supports = scene.of(jr.Support)
    assert [(one.shaft, float(one.at), one.on) for one in supports] == [
        ("lp", 0.0, None),
        ("lp", 0.962, None),
        ("hp", 0.3, None),
        ("hp", 0.682, "lp"),
    ]
    rigid = '[shafts.hp]\nmodel = "rigid"\nlength = 0.382\n'
    start, end = TWO.index("[shafts.hp]"), TWO.index("ratio")
    other = loads(f"{TWO[:start]}{rigid}{TWO[end:]}")
    assert isinstance(other.of(jr.CoaxialShaft)[0].body, jr.RigidShaft)


def many():
    """Three shafts with every key of their own, and names that are no bare keys."""
    wheel = jr.Disc.thin(("l p", 1 / 7), 1 / 3, 1 / 11)
    stop = jr.Limiter(("l p", 1 / 7), 0.1, 1e-3, 1e5)
    held = [jr.Support(at=("l p", x), kxx=1e5 / 3) for x in (0.0, 1.0)]
    joints = [jr.Support(at=(k, x), on="l p", kxx=1e5 / 7) for k, x in (("2", 0.3), ("ö", 0.6))]
    ends = [jr.Support(at=(k, x), kxx=1e5) for k, x in (("2", 0.1), ("ö", 0.8))]
    along = jr.InternalDamping(1e-4 / 3, shaft="2"), jr.ExternalDamping(1 / 3, shaft="ö")
    second = jr.CoaxialShaft(
        jr.FlexibleShaft(1 / 3, 0.05, jr.Material(2e11 / 3, 7e3 / 9), inner_diameter=0.04, nodes=4),
        ratio=-1 / 3,
        speed=1 / 7,
        start=0.1,
        phase=1 / 9,
    )
    balls = jr.RollingBearing(("l p", 0.2), 9, 1e10, 1e-6, 0.03, 0.04, on="2", linear="mean")
    tables = jr.Support(
        at=("2", 0.2), on="l p", kxx=[1e5, 2e5], speeds=[0.0, 9.0], speeds_of="difference"
    )
    third = jr.CoaxialShaft(jr.RigidShaft(1 / 3), start=0.5)
    shafts = {"l p": jr.FlexibleShaft(1.0, 0.02, nodes=4), "2": second, "ö": third}
    blade = jr.Unbalance(("2", 0.2), moment=1e-4, since=1 / 3)
    every = (wheel, stop, blade, balls, tables, *held, *joints, *ends, *along)
    return jr.Scene(shafts, *every, spin=jr.ConstantSpeed(100 / 3))


@pytest.mark.filterwarnings("ignore::jaxrotor.core.plausibility.ImplausibleWarning")
def test_round_trip_gives_every_bit_back():
    scene = many()
    text = dumps(scene)
    read = loads(text)
    assert 'at = "l p 0.14285714285714285 m"' in text and '[shafts."l p"]' in text
    assert dumps(read) == text and read.shafts == scene.shafts
    ordered = scene.of_parts(*sorted(scene.effects, key=lambda one: one.kind))
    same(read.of_parts(*sorted(read.effects, key=lambda one: one.kind)), ordered)
    for name in ("dual-rotor", "counter-rotor"):
        same(loads(dumps(load(name))), load(name))


def test_one_shaft_may_have_a_name():
    scene = jr.Scene(
        {"main": jr.FlexibleShaft(1.0, 0.02, nodes=3)},
        jr.Support(0.0, 1e5),
        jr.Support(at=("main", 1.0), kxx=1e5),
        spin=jr.ConstantSpeed(30.0),
    )
    same(loads(dumps(scene)), scene)


def test_parameters_by_the_names_of_the_tables():
    scene = load("dual-rotor")
    assert float(scene.get("shafts.hp.ratio")) == float(scene.get("coaxial_shaft.ratio")) == 1.3
    assert float(scene.get("shafts.hp.length")) == 0.382 and scene.unit("shafts.lp.length") == "m"
    changed = scene.replace({"shafts.hp.ratio": -1.2})
    same(changed.replace({"shafts.lp.length": 0.962}), load("counter-rotor"))
    with pytest.raises(ValueError, match="no parameter `shafts.ip.ratio`"):
        scene.get("shafts.ip.ratio")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (with_("lp 0 m", "0 m"), "supports.0.at must name its shaft, 'lp' or 'hp', as in \"lp 0.3 m\""),
        (with_('"lp 0 m"', "0"), "supports.0.at must name its shaft, 'lp' or 'hp'"),
        (with_("lp 0 m", "hpp 0 m"), "but is 'hpp 0 m' (did you mean `hp`?)."),
        (with_("lp 0 m", "lp 0 s"), "supports.0.at must be in m, but is '0 s'."),
        (with_("lp 0 m", "lp"), "supports.0.at must name its shaft"),
        (with_('"lp 0 m"', '"lp 0 m"\nshaft = "hp"'), "names the shaft 'lp', but `shaft` is 'hp'."),
        (with_('"lp 0 m"', '0\nshaft = "ip"'), "shaft must be 'lp' or 'hp', but is 'ip'"),
        (with_('on = "lp"', 'on = "hp"'), "between a shaft, 'hp', and itself"),
        (with_('on = "lp"', 'on = "ip"'), "no casing or shaft 'ip'"),
        (with_("hp 0.682 m", "hp 0.7 m"), "0.7 m (0.4 m from the left end of its shaft)"),
        (with_('"20 mm"', '"20 mm"\nratio = 2'), "shafts.lp.ratio is that of a further shaft"),
        (with_("ratio = 1.3", 'ratio = "1 m"'), "shafts.hp.ratio must be a number"),
        (with_("ratio = 1.3", "ratoi = 1.3"), "(did you mean `ratio`?)"),
        (with_("ratio = 1.3", "speed = true"), "shafts.hp.speed must be in rad/s"),
        (with_("[spin]", "[internal_damping]\nvoigt_time = 1e-4\n[spin]"), "shaft is missing"),
        (with_("[spin]", "[shaft]\nlength = 1\n[spin]"), "shafts stands beside [shaft]"),
        (with_("[spin]", "[coaxial_shaft]\nratio = 1\n[spin]"), "[shafts.hp]"),
        ("shafts = 3\n[spin]\nspeed = 1\n", "shafts must be a table"),
        ("shafts = {}\n[spin]\nspeed = 1\n", "shafts has no shafts"),
        ('[shafts." "]\nlength = 1\n[spin]\nspeed = 1\n', "has a shaft of the name ' '"),
        ("[shaft]\nlength = 1\ndiameter = 1\n[disc]\nat = 1\nmass = 1\nshaft = 'hp'\n[spin]\nspeed = 1\n",
         "disc.shaft names a shaft, but the scene has one [shaft]"),
    ],
)  # fmt: skip
def test_mistakes_are_one_sentence(text, sentence):
    with pytest.raises(SceneError) as caught:
        loads(text, "my.toml")
    message = str(caught.value)
    assert message.startswith("my.toml") and message.endswith(".") and "\n" not in message
    assert sentence in message


def test_stations_of_options():
    names = ("lp", "lp 2")
    assert station("lp 2 0.3 m", names, "--at") == ("lp 2", 0.3)
    assert station(" lp 0.3 m", names, "--at") == ("lp", 0.3)
    assert station("300 mm", (), "--at") == 0.3
    with pytest.raises(SceneError, match="--at must name its shaft"):
        station("300 mm", names, "--at")


@pytest.mark.filterwarnings("error")
def test_a_speed_of_its_own_and_a_longer_shaft_are_plausible():
    """700 rad/s beside 250 rad/s, which look like rpm where there is one shaft."""
    scene = load("dual-rotor")
    scene.replace({"coaxial_shaft.ratio": 0.0, "coaxial_shaft.speed": 700.0})
    loads(with_('"0.382 m"', '"2 m"').replace("hp 0.682", "hp 0.9"))
    with pytest.raises(ImplausibleWarning, match="faster than any rotor"):
        scene.replace({"coaxial_shaft.speed": 2e6})
