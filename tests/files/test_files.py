"""Scene files: published data of the shipped scenes, round trips, units, and error messages."""

import dataclasses
import itertools
import math
import os
import random
import re
import subprocess
import sys
import warnings
from typing import ClassVar

import equinox as eqx
import jax
import numpy as np
import pytest
from systems import leaf_values

from jaxrotor import (
    BallBalancer,
    Casing,
    CoaxialShaft,
    ConstantSpeed,
    Constraint,
    Crack,
    Disc,
    Drive,
    FlexibleShaft,
    Limiter,
    LinearMagneticBearing,
    LoosePedestal,
    MagneticBearing,
    Material,
    RigidShaft,
    RollingBearing,
    Scene,
    SpeedProfile,
    Support,
    Unbalance,
    roots,
)
from jaxrotor.core.blocks import Blocks
from jaxrotor.core.plausibility import ImplausibleWarning
from jaxrotor.core.quantities import positive
from jaxrotor.effects import AbstractLinear
from jaxrotor.equations.system import assemble
from jaxrotor.files import units
from jaxrotor.files.shipped import _shipped, shipped
from jaxrotor.files.toml import dumps, load, loads, save, study
from jaxrotor.files.toml_reader import read
from jaxrotor.files.units import SceneError
from jaxrotor.files.vocabulary import exported


NAMES = ["limiter-rotor", "limiter-rotor-2023"]
OTHERS = [
    "ball-balancer",
    "ball-balancer-light",
    "compressor",
    "counter-rotor",
    "cracked-rotor",
    "dual-rotor",
    "dual-stiffness-elastic",
    "dual-stiffness-rigid",
    "dual-stiffness-rotating",
    "gyroscopic-cantilever",
    "gyroscopic-propped",
    "magnetic-rotor",
    "misaligned-coupling",
    "oil-whirl",
    "overhung-disc",
    "overhung-fan",
    "ring-rub",
    "rolling-bearing",
    "seal-whirl",
    "turbine-run-up",
    "turbine-variants",
    "two-discs",
    "two-discs-unequal",
]

GOOD = """\
title = "Test"
[shaft]
length = "0.7 m"
diameter = "20 mm"
constraints = [{at = "0 m", holds = "clamp"}]
[disc]
at = 0.7
mass = 2.5
[unbalance]
at = 0.7
mass = 2.5
eccentricity = "1 um"
[[limiters]]
at = 0.7
angle = "60 deg"
gap = "7.5 mm"
stiffness = "4.087e6 N/m"
[[limiters]]
at = 0.7
angle = "180 deg"
gap = "7.5 mm"
stiffness = 4087000
[spin]
speed = "1500 rpm"
[sweep]
settle = 10
[sweep.over]
"spin.speed" = "0 : 3000 rpm : 3"
[sweep.start]
radius = "1 mm"
"""


def good(old="", new=""):
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def same(one: Scene, two: Scene):
    leaves, others = jax.tree.leaves(one), jax.tree.leaves(two)
    assert jax.tree.structure(one) == jax.tree.structure(two)
    for a, b in zip(leaves, others, strict=True):
        assert a.dtype == b.dtype and np.asarray(a).tobytes() == np.asarray(b).tobytes()


def refused(text, source="my.toml"):
    with pytest.raises(SceneError) as caught:
        loads(text, source)
    message = str(caught.value)
    assert message.startswith(source) and message.endswith(".") and "\n" not in message
    return message


# === the shipped scenes


def groups(scene: Scene) -> dict[str, float]:
    """Dimensionless groups of the paper by their definitions."""
    shaft, get = scene.shaft, lambda path: np.asarray(scene.get(path)).item()
    length, mass, rigidity = get("shaft.length"), get("disc.mass"), float(shaft.rigidity)
    time = math.sqrt(mass * length**3 / rigidity)
    twice = 2 * math.sqrt(mass * length**3 * rigidity)
    inertia = math.pi * get("shaft.diameter") ** 4 / 64
    stop = {
        name: np.unique(np.asarray(scene.get(f"limiters.{name}"))).item()
        for name in ("at", "gap", "stiffness", "damping", "friction", "rim_radius")
    }
    assert stop["at"] == get("unbalance.at") == get("disc.at") == get("disc_damping.at") == length
    return {
        "T*": time,
        "N": get("spin.speed") * time,
        "mu_R": float(shaft.mass_per_length) * length / mass,
        "beta": get("disc.diametral") / (mass * length**2),
        "beta_R": get("shaft.material.density") * inertia / (mass * length),
        "eta_i": get("internal_damping.voigt_time") / (2 * time),
        "eta_e": get("external_damping.per_length") * length**4 / twice,
        "eta_Dxi": get("disc_damping.translational") * length**3 / twice,
        "eta_Dtheta": get("disc_damping.angular") * length / twice,
        "kappa": stop["stiffness"] * length**3 / rigidity,
        "eta_S": stop["damping"] * math.sqrt(length**3 / (mass * rigidity)),
        "chi": stop["gap"] / length,
        "f": stop["friction"],
        "eps_D": 2 * stop["rim_radius"] / length,
        "eps": get("unbalance.eccentricity") / length,
        "gamma": mass * 9.80665 * length**2 / rigidity,
    }


@pytest.mark.parametrize("name", NAMES)
def test_shipped_scene_has_the_published_groups(name):
    found = groups(load(name))
    exact = {
        "T*": 0.022646559709295067,
        "N": 15,
        "mu_R": 0.7,
        "beta": (0.2 / 0.7) ** 2 / 16,
        "eta_i": 0.005,
        "eta_e": 0.025,
        "eta_Dxi": 0.0025,
        "eta_Dtheta": 0.05,
        "eta_S": 0.06,
        "chi": 0.0075 / 0.7,
        "f": 0.1,
        "eps_D": 0.2 / 0.7,
        "eps": 0.0,
    }
    printed = {"beta": "0.005102041", "beta_R": "3.571429e-05", "chi": "0.01071429"}
    printed |= {"kappa": "849.94", "gamma": "0.00719", "T*": "0.0226465597"}
    for group, value in exact.items():
        assert found[group] == pytest.approx(value, rel=1e-9), group
    for group, digits in printed.items():
        tolerance = 0.51 * 10.0 ** -len(digits.partition("e")[0].partition(".")[2])
        scale = 10.0 ** int(digits.partition("e")[2] or 0)
        assert abs(found[group] - float(digits)) <= tolerance * scale, group


def test_limiter_rotor_details():
    scene = load("limiter-rotor")
    thin = Disc.from_dimensions(0.7, 0.2, 0.01)
    np.testing.assert_allclose(scene.get("disc.mass"), thin.mass, rtol=1e-15)
    np.testing.assert_allclose(scene.get("unbalance.mass"), thin.mass, rtol=1e-15)
    np.testing.assert_allclose(scene.get("disc.polar"), 2 * scene.get("disc.diametral"), rtol=1e-15)
    angles = np.pi / 3 * np.array([1, 3, 5])
    np.testing.assert_allclose(scene.get("limiters.angle"), angles, rtol=1e-15)
    np.testing.assert_array_equal(scene.get("limiters.gap"), [0.0075] * 3)
    assert scene.get("shaft.material.youngs_modulus") == 2.1e11
    assert scene.get("shaft.polar_ratio") == 2
    assert (scene.resolution, scene.shaft.rule) == ((8,), "spectral")
    assert {e.kind for e in scene.effects} == {
        "disc",
        "unbalance",
        "external_damping",
        "disc_damping",
        "internal_damping",
        "limiter",
    }


def test_scene_of_2023_differs_only_where_the_errata_say():
    right, printed = load(NAMES[0]), load(NAMES[1])
    assert (printed.shaft.nodes, printed.shaft.rule) == (6, "trapezoid")
    assert right.paths() == printed.paths()
    present = leaf_values(right)
    assert "disc.polar" in present and "limiters.gap" in present
    for path, value in present.items():
        sign = -1 if path in ("disc.polar", "shaft.polar_ratio") else 1
        np.testing.assert_array_equal(printed.get(path), sign * value, err_msg=path)


@pytest.mark.parametrize("name", NAMES)
def test_study_of_shipped_scene(name):
    found = study(name)
    assert list(found) == ["settle", "keep", "steps_per_revolution", "over", "start"]
    assert (found["settle"], found["keep"], found["steps_per_revolution"]) == (1000, 300, 256)
    assert found["start"] == {"radius": 0.0007, "rate": 0.0}
    (path, values), *rest = found["over"].items()
    assert path == "unbalance.eccentricity" and not rest
    np.testing.assert_array_equal(values, np.linspace(0, 0.001001, 144))


@pytest.mark.parametrize("name", OTHERS)
def test_other_shipped_scene(name):
    """Every number survives a round trip; the tests of the sheets check the results."""
    same(load(name), loads(dumps(load(name))))
    assert study(name) == {}


def test_overhung_fan_has_the_data_of_its_sheets():
    """Parameters are those of the sheets, and are written in the same form."""
    scene = load("overhung-fan")
    for name, value in {
        "kxx": 8e7,
        "kxy": 1e7,
        "kyx": -2e7,
        "kyy": 4e7,
        "cxx": 2e5,
        "cyy": 1e5,
    }.items():
        assert scene.get(f"supports.{name}").tolist() == [value] * 2
        assert dumps(scene).count(f"\n{name} = {value} # N") == 2
    speed, disc = 50 * math.pi, scene.of(Disc)[0]
    assert scene.get("unbalance.eccentricity") * speed == pytest.approx(6.3e-3, rel=1e-12)
    assert (disc.mass, disc.polar) == pytest.approx((80.0, 80.0 * 0.4**2 / 2), rel=1e-12)
    stops = np.exp(1j * scene.get("limiters.angle"))
    np.testing.assert_allclose(stops, np.exp(1j * np.pi / 6 * np.arange(12)), atol=1e-15)
    assert set(scene.get("limiters.gap").tolist()) == {3e-4}


@pytest.mark.slow  # computes roots of fifty coordinates
def test_overhung_fan_runs_smoothly_in_service():
    """Cross-coupling of the films drives whirl, but their damping prevails."""
    scene = load("overhung-fan")
    for rpm in (0, 1500, 6000):
        assert float(roots(scene.at_speed(rpm * math.pi / 30)).real.max()) < -10
    undamped = {f"supports.{name}": 0.0 for name in ("cxx", "cyy")}
    assert float(roots(scene.replace(undamped)).real.max()) > 10


def test_shipped_lists_names_and_titles():
    assert [name for name, _ in shipped()] == sorted(OTHERS + NAMES)
    assert all(len(title) > 20 and "\n" not in title for _, title in shipped())


# === round trip


ANOTHER_WAY = {  # fields of the second way to give a part, which the scene below leaves out
    Support: [
        *(k + axes for k in "kc" for axes in ("xx", "xy", "yx", "yy")),
        "speeds",
        "frequencies",
    ],
    Unbalance: ["moment"],
    Crack: ["compliance", "compliance_across"],
    MagneticBearing: ["numerator", "denominator"],
    LinearMagneticBearing: ["numerator", "denominator"],
}


def every_effect() -> Scene:
    """Scene with every exported effect, and with numbers that no machine has and no short decimals."""
    rng = random.Random(7)
    members = []
    for cls in exported().values():
        if cls is CoaxialShaft:  # see `test_several_shafts.py`
            continue
        if cls is Casing:
            members.append(Casing("pedestal", rng.random() / 3))
            continue
        if cls is LoosePedestal:
            members.append(LoosePedestal("block", *(rng.random() / 3 for _ in range(7))))
            continue
        if cls is Support:
            members.append(Support(at=1 / 9, on="block", kxx=1 / 11))
            members.append(Support(of="pedestal", kxx=1 / 3, kyy=1 / 7, cxx=0.0, cyy=1 / 9))
        for _ in range(rng.choice([1, 2])):
            names = [f.name for f in dataclasses.fields(cls) if not f.metadata.get("static")]
            numbers: dict = {name: rng.random() / 3 for name in names}
            if "ratios" in numbers:
                numbers["ratios"] = [rng.random() / 3 for _ in range(3)]
            if "ball_radius" in numbers:  # must be below the race radius
                numbers["ball_radius"] = numbers["race_radius"] / 7
            if cls is RollingBearing:
                numbers |= {"balls": 7, "exponent": 1 + numbers["exponent"]}
            if cls is MagneticBearing:
                numbers |= {"kp": 1e6 / 3, "limit": numbers["bias"] / 7}
            if cls is LinearMagneticBearing:
                numbers["name"] = f"magnet {len(members)}"
            for name in ANOTHER_WAY.get(cls, ()):
                del numbers[name]
            members.append(cls(**numbers))
    material = Material(1e11 / 3, 7e3 / 9)
    shaft = FlexibleShaft(
        1 / 3,
        1e-2 / 7,
        material,
        -1 / 9,
        nodes=5,
        rotary_inertia=False,
        constraints=[Constraint(0.0, "clamp")],
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ImplausibleWarning)
        return Scene(shaft, *members, spin=ConstantSpeed(-1e5 / 3))


def rigid_scene() -> Scene:
    """Rigid shaft with a drive that has all its fields."""
    constraints = (Constraint(1 / 9), Constraint(1 / 7, "guide"))
    drive = Drive(
        1e3 / 7,
        -1 / 3,
        1 / 7,
        1 / 9,
        odd=True,
        coulomb=1 / 11,
        table_speeds=[1 / 3, 2 / 3, 7 / 9],
        table_torques=[0.1, 0.0, -1 / 3],
        polar=1 / 13,
        feedback=True,
        stops=True,
    )
    disc = Disc.thin(1 / 7, 1 / 3, 1 / 9, tilt=1e-3 / 7, exact=False)
    balls = BallBalancer(1 / 7, 1e-3, 1 / 9, 1 / 3, places=5)
    return Scene(RigidShaft(2 / 3, constraints), disc, balls, spin=drive)


def profile_scene() -> Scene:
    profile = SpeedProfile([0.1, 1 / 3, 0.7], [0.0, 100 / 3, 1e5 / 7])
    return Scene(FlexibleShaft(0.7, 0.02, constraints=[Constraint(0.0, "clamp")]), spin=profile)


def film_scene() -> Scene:
    """Bearings given by coefficients, and an unbalance given by its moment."""
    bearings = [
        Support(0.0, kxx=1e8 / 3, kxy=1e7 / 7, kyx=-2e7 / 9, kyy=4e7, cxx=2e5, cyy=1e5 / 7),
        Support(1 / 3, kxx=8e7 / 3, angular_stiffness=1e3 / 7, rotating=True),
        Support(2 / 9, kxx=8e7 / 3, on="frame"),
        Support(0.3, kxx=[1e8 / 3, 8e7 / 7], cxx=2e5 / 3, speeds=[1 / 3, 100 / 7], hold=True),
    ]
    weight, frame = Unbalance(0.2, moment=8e-5 / 7, phase=1 / 3), Casing("frame", 7.0)
    parts = bearings, Disc(0.2, 80.0), weight, frame
    return Scene(RigidShaft(1 / 3), *parts, spin=ConstantSpeed(1.0))


WRITTEN = {"every effect": every_effect(), "rigid": rigid_scene(), "profile": profile_scene()}
WRITTEN |= {"films": film_scene()}


@pytest.mark.parametrize("scene", [*NAMES, *WRITTEN.values()], ids=[*NAMES, *WRITTEN])
def test_round_trip_is_bit_identical(scene, tmp_path):
    scene = load(scene) if isinstance(scene, str) else scene
    save(scene, tmp_path / "a.toml", title='A "title"')
    same(scene, load(tmp_path / "a.toml"))
    same(scene, loads(dumps(scene)))
    assert dumps(loads(dumps(scene))) == dumps(scene)
    assert [f.name for f in tmp_path.iterdir()] == ["a.toml"]


@pytest.mark.parametrize("value", [5e-300, 1e300, 1 / 3, 123456789.12345679, 1e16, 1e-5, 2.0**-40])
def test_round_trip_of_any_float(value):
    scene = loads(good()).replace({"disc.mass": value, "limiters.0.blend": value})
    same(scene, loads(dumps(scene)))


def test_written_file_has_units():
    text = dumps(load("limiter-rotor"))
    assert 'model = "flexible"' in text and "gap = 0.0075 # m\n" in text
    assert "per_length = 7.778381808870701 # N s/m^2\n" in text
    assert text.count("[[limiters]]") == 3 and text.count("[disc]") == 1


def test_effects_of_a_kind_are_written_in_one_group():
    shaft, spin = (
        FlexibleShaft(0.7, 0.02, constraints=[Constraint(0.0, "clamp")]),
        ConstantSpeed(1.0),
    )
    mixed = Scene(shaft, Disc(0.3, 1.0), Limiter(0.7, 0, 0, 1), Disc(0.5, 2.0), spin=spin)
    again = loads(dumps(mixed))
    assert [e.kind for e in again.effects] == ["disc", "disc", "limiter"]
    np.testing.assert_array_equal(again.get("discs.mass"), mixed.get("discs.mass"))


def test_save_replaces_whole_or_not_at_all(tmp_path, monkeypatch):
    path, scene = tmp_path / "a.toml", loads(good())
    save(scene, path)
    before = path.read_bytes()
    monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space")))
    with pytest.raises(SceneError, match=r"a\.toml cannot be written \(No space\)"):
        save(load("limiter-rotor"), path)
    assert path.read_bytes() == before and len(list(tmp_path.iterdir())) == 1
    monkeypatch.undo()
    save(load("limiter-rotor"), path)
    same(load(path), load("limiter-rotor"))


def test_save_refuses_in_one_sentence(tmp_path):
    scene = loads(good())
    with pytest.raises(SceneError, match=r"the name of a scene file ends in \.toml\."):
        save(scene, tmp_path / "limiter-rotor")
    with pytest.raises(SceneError, match="cannot be written"):
        save(scene, tmp_path / "missing" / "a.toml")
    (tmp_path / "file").write_text("")
    with pytest.raises(SceneError, match="cannot be written"):
        save(scene, tmp_path / "file" / "a.toml")
    many = eqx.tree_at(lambda s: s.spin.speed, scene, np.array([1.0, 2.0]))
    with pytest.raises(SceneError, match="spin.speed cannot be written: it must be one known"):
        dumps(many)
    with pytest.raises(SceneError, match="spin.speed cannot be written"):
        jax.jit(lambda x: dumps(scene.replace({"spin.speed": x})) and x)(1.0)
    with pytest.raises(SceneError, match="spin.speed cannot be written"):
        dumps(eqx.tree_at(lambda s: s.spin.speed, scene, np.nan))


class Magnet(AbstractLinear):
    kind: ClassVar[str] = "magnet"
    plural: ClassVar[str] = "magnets"

    strength: jax.Array = positive("strength [N/mm]")

    def blocks(self, line):
        return Blocks()


class AnotherDisc(AbstractLinear):
    kind: ClassVar[str] = "disc"
    plural: ClassVar[str] = "discs"

    def blocks(self, line):
        return Blocks()


def test_an_effect_of_ones_own_is_read_and_written_once_it_is_defined():
    text = good("[spin]", "[[magnets]]\nstrength = '2 kN/m'\n[spin]")
    scene = loads(text)
    assert scene.get("magnet.strength") == 2
    same(scene, loads(dumps(scene)))
    assert "magnetz is not a part of a scene" in refused(text.replace("magnets", "magnetz"))


def test_an_effect_of_ones_own_that_takes_the_name_of_another_is_not_written():
    shaft = FlexibleShaft(1, 0.1, constraints=[Constraint(0.0, "clamp")])
    with pytest.raises(SceneError, match="no scene file can name a AnotherDisc"):
        dumps(Scene(shaft, AnotherDisc(), spin=ConstantSpeed(1.0)))


# === quantities and tables


@pytest.mark.parametrize(
    ("key", "text", "value"),
    [
        ("shaft.length", '"0.7 m"', 0.7),
        ("shaft.length", '"700mm"', 0.7),
        ("shaft.length", '"30 in"', 0.762),
        ("shaft.length", '" 7e-1  m "', 0.7),
        ("shaft.length", '"0.7"', 0.7),
        ("shaft.length", "1", 1.0),
        ("shaft.diameter", '"20000 µm"', 0.02),
        ("disc.mass", '"2500 g"', 2.5),
        ("limiters.0.angle", '"60 deg"', 1.0471975511965979),  # pi / 3, correctly rounded
        ("limiters.0.angle", '"-90°"', -math.pi / 2),
        ("limiters.0.angle", '"0.5 rad"', 0.5),
        ("limiters.0.angle", '"0.5 turn"', math.pi),
        ("limiters.0.gap", '"7.5 mm"', 0.0075),
        ("limiters.0.stiffness", '"4.087e6 N/m"', 4.087e6),
        ("limiters.0.stiffness", '"4.087 kN/mm"', 4.087e6),
        ("spin.speed", '"1500 rpm"', 50 * math.pi),
        ("spin.speed", '"-1500 rpm"', -50 * math.pi),
        ("spin.speed", '"1500 RPM"', 50 * math.pi),
        ("spin.speed", '"100 rad/s"', 100.0),
        ("spin.speed", '"360 deg/s"', 2 * math.pi),
        ("spin.speed", '"25 turn/s"', 50 * math.pi),
    ],
)
def test_quantities_with_units(key, text, value):
    table, name = key.rsplit(".", 1)
    head = "[[limiters]]" if table == "limiters.0" else f"[{table}]"
    before, _, rest = GOOD.partition(f"{head}\n")
    rest = re.sub(rf"^{name} = .*$", f"{name} = {text}", rest, count=1, flags=re.M)
    assert loads(f"{before}{head}\n{rest}").get(key) == value


@pytest.mark.parametrize(
    ("table", "path", "value"),
    [
        ("[external_damping]\nper_length = '7.5 N*s/m**2'", "external_damping.per_length", 7.5),
        ("[external_damping]\nper_length = '7.5 N·s/m²'", "external_damping.per_length", 7.5),
        ("[external_damping]\nper_length = '7.5 Pa s'", "external_damping.per_length", 7.5),
        ("[disc_damping]\nat = 0.7\nangular = '5 N m s'", "disc_damping.angular", 5.0),
        ("[internal_damping]\nvoigt_time = '0.2 ms'", "internal_damping.voigt_time", 2e-4),
        (
            "[limiter]\nat=0\nangle=0\ngap=0\nstiffness=1\nfriction='5 %'",
            "limiters.2.friction",
            0.05,
        ),
        ("[gravity]", "gravity.acceleration", 9.80665),
    ],
)
def test_more_quantities(table, path, value):
    assert loads(good("[spin]", f"{table}\n[spin]")).get(path) == value


def test_material_by_name_or_table():
    table = "{youngs_modulus = '70 GPa', density = '2.7 g/cm^3'}"
    scene = loads(good("[disc]", f"material = {table}\n[disc]"))
    assert scene.get("shaft.material.youngs_modulus") == 7e10
    assert scene.get("shaft.material.density") == 2700
    same(loads(good("[disc]", 'material = "steel"\n[disc]')), loads(good()))


def test_disc_by_its_dimensions():
    dimensions = "diameter = '200 mm'\nthickness = '1 cm'\ndensity = 2700\nbore = 0.02"
    scene = loads(good("mass = 2.5\n", f"{dimensions}\n"))
    disc = Disc.from_dimensions(0.7, 0.2, 0.01, 2700.0, 0.02)
    for name in ("mass", "diametral", "polar"):
        assert scene.get(f"disc.{name}") == getattr(disc, name)


def test_thin_disc_and_discs_out_of_true():
    wrong = (
        "offset = '0.1 mm'\noffset_angle = '30 deg'\ntilt = '1 deg'\ntilt_axis = 2\nexact = false\n"
    )
    out_of_true = {
        "offset": 1e-4,
        "offset_angle": math.pi / 6,
        "tilt": math.pi / 180,
        "tilt_axis": 2,
    }
    for given, disc in {
        "mass = '2500 g'\nradius = '10 cm'": Disc.thin(0.7, 2.5, 0.1, exact=False, **out_of_true),
        "diameter = 0.2\nthickness = 0.01": Disc.from_dimensions(
            0.7, 0.2, 0.01, exact=False, **out_of_true
        ),
        "mass = 2.5\npolar = 0.1": Disc(0.7, 2.5, polar=0.1, exact=False, **out_of_true),
    }.items():
        scene = loads(good("mass = 2.5\n", f"{given}\n{wrong}"))
        (found,) = scene.of(Disc)
        assert not found.exact
        for name, value in leaf_values(scene).items():
            head, _, own = name.partition(".")
            if head == "disc":
                np.testing.assert_allclose(value, getattr(disc, own), rtol=1e-15)


@pytest.mark.parametrize("head", ["[disc]", "[[disc]]", "[discs]", "[[discs]]"])
def test_one_effect_by_any_name(head):
    same(loads(good("[disc]", head)), loads(good()))


FILM = """\
[shaft]
model = "rigid"
length = 1.0
[disc]
at = 0.5
mass = 80
[[supports]]
at = 0
kxx = "80 MN/m"
kxy = 1e7
kyx = -2e7
kyy = 4e7
cxx = 2e5
cyy = 1e5
[[supports]]
at = 1
stiffness = [["80 MN/m", 1e7], [-2e7, 4e7]]
damping = [[2e5, 0], [0, 1e5]]
[unbalance]
at = 0.5
moment = "80 g*mm"
[spin]
speed = "3000 rpm"
"""


def test_bearings_in_the_form_of_their_reports():
    """Coefficients are read and written exactly, whether given one by one or as matrices."""
    scene = loads(FILM)
    matrices = {"k": [[8e7, 1e7], [-2e7, 4e7]], "c": [[2e5, 0.0], [0.0, 1e5]]}
    for support in scene.of(Support):
        for letter, matrix in matrices.items():
            for i, j in itertools.product("xy", "xy"):
                value = getattr(support, f"{letter}{i}{j}")
                expected = matrix["xy".index(i)]["xy".index(j)]
                assert value == expected if value is not None else expected == 0
    text = dumps(scene)
    assert "kxx = 80000000.0 # N/m\n" in text and "kyx = -20000000.0 # N/m\n" in text
    assert (
        "cyy = 100000.0 # N s/m\n" in text and "stiffness =" not in text and "\nangle" not in text
    )
    same(loads(text), scene)
    assert scene.replace({"supports.1.kxx": 9e7}).get("supports.kxx").tolist() == [8e7, 9e7]
    system, other = (
        assemble(scene).blocks,
        assemble(scene.of_parts(*reversed(scene.effects))).blocks,
    )
    for name in ("stiffness", "damping", "skew_stiffness", "fixed_stiffness", "fixed_damping"):
        np.testing.assert_allclose(getattr(system, name), getattr(other, name), rtol=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "cyy = 1e5\n",
            "damping = 1e5\n",
            "supports.0: `kxx` and `damping` belong to two different ways to describe a support; give ",
        ),
        (
            'kxx = "80 MN/m"',
            "kxx = [[8e7, 1e7], [-2e7, 4e7]]",
            "supports.0: `kxx` is a table of 2 by 2 numbers; give their `speeds [rad/s]` and `frequencies "
            "[rad/s]`, or one number; a matrix [[xx, xy], [yx, yy]] is `stiffness` or `damping`.",
        ),
        ('kxx = "80 MN/m"\n', "", "supports.0: A support needs a stiffness; give `kxx [N/m]`"),
        (
            '[["80 MN/m", 1e7], [-2e7, 4e7]]',
            "[8e7, 4e7]",
            "supports.1.stiffness must be a number or a 2 by 2 matrix such as [[8e7, 1e7], ",
        ),
        (
            '[["80 MN/m", 1e7]',
            '[["80 mm", 1e7]',
            "supports.1.stiffness.0.0 must be in N/m, but is ",
        ),
        (
            "damping = [[2e5",
            "cxx = 1\ndamping = [[2e5",
            "supports.1: `damping` is a matrix of cxx, cxy, cyx and cyy, which are given too; ",
        ),
        (
            "damping = [[2e5, 0], [0, 1e5]]",
            "damping = 2e5",
            "supports.1: `kxx` and `damping` belong to",
        ),
        (
            "[0, 1e5]]",
            "[0, -3e5]]",
            "supports.1: `cxx + cyy [N s/m]` must not be negative, but is -",
        ),
        (
            'moment = "80 g*mm"',
            "moment = 1\nmass = 1",
            "unbalance: An unbalance needs either `mass [kg]` and `eccentricity [m]`, or their product",
        ),
        ('moment = "80 g*mm"', "mass = 1", "unbalance: An unbalance needs either `mass [kg]` and "),
    ],
)
def test_two_ways_at_once_are_refused(old, new, message):
    assert old in FILM
    found = refused(FILM.replace(old, new, 1))
    assert found.startswith(f"my.toml: {message}"), found


def test_unbalance_by_moment_and_by_grade():
    """Grade G6.3 is e Omega = 6.3 mm/s (ISO 21940-11)."""
    assert loads(FILM).get("unbalance.moment") == 8e-5
    moment = 80 * 6.3e-3 / (100 * math.pi)
    for given in ('"G6.3"', '"G 6.3"', "6.3", '"6.3 mm/s"'):
        graded = FILM.replace('moment = "80 g*mm"', f"grade = {given}\nmass = 80\nphase = 1")
        scene = loads(graded)
        load = assemble(scene).load.unbalance
        expected = assemble(loads(FILM).replace({"unbalance.moment": moment})).load.unbalance
        np.testing.assert_allclose(load, expected * np.exp(1j), rtol=1e-14)
        faster = loads(graded.replace("phase = 1", 'phase = 1\nspeed = "6000 rpm"'))
        np.testing.assert_allclose(assemble(faster).load.unbalance, load / 2, rtol=1e-14)
    profile = 'model = "profile"\ntimes = [0, 1]\nspeeds = [0, 1]'
    for mistake, message in [
        (
            ("mass = 80\nphase", "phase"),
            "my.toml: unbalance.mass is missing; an unbalance given by its grade ",
        ),
        (('"6.3 mm/s"', '"G"'), "my.toml: unbalance: `grade` must be a grade such as 'G6.3', but "),
        (('"6.3 mm/s"', "true"), "my.toml: unbalance.grade must be in mm/s, but is True."),
        (('speed = "3000 rpm"', profile), "my.toml: unbalance.speed is missing; an unbalance "),
        (('"3000 rpm"', "0"), "my.toml: unbalance: `speed [rad/s]` must not be zero, but is 0."),
    ]:
        assert refused(graded.replace(*mistake)).startswith(message)


def test_angles_make_one_effect_each():
    head, _, tail = GOOD.partition("[[limiters]]")
    rest = "gap = '7.5 mm'\nstiffness = 4087000\n[spin]" + tail.partition("[spin]")[2]
    text = f"{head}[limiters]\nat = 0.7\nangles = ['60 deg', {math.pi}]\n{rest}"
    same(loads(text), loads(good()))
    stops = Limiter.at_angles([math.pi / 3, math.pi], at=0.7, gap=0.0075, stiffness=4087000)
    own = loads(good()).without("limiters")
    mixed = Scene(own.shaft, *own.effects, stops, spin=own.spin)
    np.testing.assert_allclose(mixed.get("limiters.angle"), [math.pi / 3, math.pi], rtol=1e-15)
    assert [e.kind for e in mixed.effects] == ["disc", "unbalance", "limiter", "limiter"]


def test_lists_serve_as_tuples():
    pins = [Constraint(0.0), Constraint(0.7)]
    for listed, tupled in [
        (
            FlexibleShaft(0.7, 0.02, constraints=pins),
            FlexibleShaft(0.7, 0.02, constraints=(*pins,)),
        ),
        (RigidShaft(0.7, pins), RigidShaft(0.7, tuple(pins))),
    ]:
        same(listed, tupled)
    with pytest.raises(ValueError, match="`constraints` must be a list of Constraint, but is "):
        RigidShaft(0.7, [0.0])


def test_study():
    found = study_of(good())
    assert found["settle"] == 10 and found["start"] == {"radius": 0.001} and "keep" not in found
    np.testing.assert_allclose(found["over"]["spin.speed"], [0, 50 * np.pi, 100 * np.pi], 1e-15)
    assert study_of(GOOD.partition("[sweep]")[0]) == {}
    over = 'limiters.gap = ["1 mm", 0.002]\nlimiters.0.friction = "0:1:2"\n[sweep.start]'
    found = study_of(good("[sweep.start]", over))["over"]
    assert list(found) == ["spin.speed", "limiters.gap", "limiters.0.friction"]
    np.testing.assert_array_equal(found["limiters.gap"], [0.001, 0.002])


def study_of(text):
    return read(text, "my.toml")[1]


# === refusals


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "gap =",
            "gapp =",
            "limiters.0.gapp is not a parameter of a limiter (did you mean `gap`?); it has: "
            "at, angle, gap, stiffness, damping, friction, rim_radius, blend, slip, on.",
        ),
        (
            'gap = "7.5 mm"\n',
            "",
            "limiters.0.gap is missing; a limiter needs: at, angle, gap, stiffness.",
        ),
        (
            "length =",
            "lenght =",
            "shaft.lenght is not a parameter of a flexible shaft (did you mean `length`?); "
            "it has: length, diameter, material, polar_ratio, nodes, rule, rotary_inertia, "
            "inner_diameter, steps, constraints, shear, anisotropy.",
        ),
        (
            'length = "0.7 m"\n',
            "",
            "shaft.length is missing; a flexible shaft needs: length, diameter.",
        ),
        (
            "eccentricity =",
            "e =",
            "unbalance.e is not a parameter of an unbalance; it has: at, mass, eccentricity, "
            "phase, moment, since.",
        ),
        ("0.7 m", "0.7 kg", "shaft.length must be in m, but is '0.7 kg'."),
        ("0.7 m", "0,7 m", "shaft.length must be in m, but is '0,7 m'."),
        ("0.7 m", "0.7 metr", "shaft.length must be in m, but is '0.7 metr'."),
        ("0.7 m", "m", "shaft.length must be in m, but is 'm'."),
        ("0.7 m", "", "shaft.length must be in m, but is ''."),
        ("0.7 m", "9**9**9**9 m", "shaft.length must be in m, but is '9**9**9**9 m'."),
        ("0.7 m", "1 m^(9^9)", "shaft.length must be in m, but is '1 m^(9^9)'."),
        ("0.7 m", "1e999 m", "shaft.length must be in m and finite, but is '1e999 m'."),
        ('"0.7 m"', "nan", "shaft.length must be in m and finite, but is nan."),
        ('"0.7 m"', "-inf", "shaft.length must be in m and finite, but is -inf."),
        ('"0.7 m"', "1e999", "shaft.length must be in m and finite, but is inf."),
        ('"0.7 m"', "true", "shaft.length must be in m, but is True."),
        (
            '"0.7 m"',
            "[0.7]",
            "shaft.length must be one number in m, but is the list [0.7]; write one.",
        ),
        ('"0.7 m"', "{m = 1}", "shaft.length must be in m, but is {'m': 1}."),
        ('"0.7 m"', "1979-05-27", "shaft.length must be in m, but is datetime.date(1979, 5, 27)."),
        (
            '"0.7 m"',
            "0x" + "f" * 5000,
            "shaft.length must be in m and finite, but is a huge number.",
        ),
        ('"0.7 m"', "-1", "shaft: `length [m]` must be positive, but is -1."),
        (
            '"4.087e6 N/m"',
            '"-4 N/m"',
            "limiters.0: `stiffness [N/m]` must not be negative, but is -4.",
        ),
        ("1500 rpm", "25 Hz", "spin.speed must be in rad/s, but is '25 Hz' (write rpm or rad/s)."),
        (
            "1500 rpm",
            "25 1/s",
            "spin.speed must be in rad/s, but is '25 1/s' (write rpm or rad/s).",
        ),
        (
            "1500 rpm",
            "25 rmp",
            "spin.speed must be in rad/s, but is '25 rmp' (write rpm or rad/s).",
        ),
        ("60 deg", "60 mm", "limiters.0.angle must be in rad, but is '60 mm' (write deg or rad)."),
        (
            "[[limiters]]\n",
            "[[limiters]]\nfriction = '6 deg'\n",
            "limiters.0.friction must be a number, but is '6 deg'.",
        ),
        (
            "[[limiters]]\nat = 0.7",
            "[[limiters]]\nat = 0.8",
            "The limiter at 0.8 m is off the shaft; `at [m]` must be between 0 and the "
            "shaft's length, 0.7 m.",
        ),
        (
            "angle =",
            "angles =",
            'limiters.0.angles must be a list such as [0.0, "90 deg"], in place of angle.',
        ),
        (
            "angle =",
            "angles = ['1 m'] #",
            "limiters.0.angles.0 must be in rad, but is '1 m' (write deg or rad).",
        ),
        (
            "mass = 2.5",
            "diameter = 0.2",
            "disc.thickness is missing; a disc given by its dimensions needs: at, diameter, "
            "thickness.",
        ),
        (
            "mass = 2.5",
            "mass = 1\nbore = 0.2",
            "disc.mass is not a parameter of a disc given by its dimensions; it has: at, "
            "diameter, thickness, density, bore, offset, offset_angle, tilt, tilt_axis, exact.",
        ),
        (
            "mass = 2.5",
            "radius = '0.1 m'",
            "disc.mass is missing; a thin disc needs: at, mass, radius.",
        ),
        ("mass = 2.5", "mass = 1\nradius = 0", "disc: `radius [m]` must be positive, but is 0."),
        (
            "mass = 2.5",
            "mass = 1\nradius = 1\nexact = 1",
            "disc.exact must be true or false, but is 1.",
        ),
        (
            "mass = 2.5",
            "mass = 1\nradius = 1\npolar = 1",
            "disc.polar is not a parameter of a thin disc; it has: at, mass, radius, offset, ",
        ),
        (
            "mass = 2.5",
            "diameter = 1\nthickness = 1\nbore = 2",
            "disc: `bore [m]` must be inside the disc, but is 2.",
        ),
        (
            "[disc]",
            "[disk]",
            "disk is not a part of a scene (did you mean `[disc]`?); it has: title, assumption, "
            "shaft, shafts, annular_stator, ball_balancer, ball_contact, casing, coupling, "
            "oldham_coupling, crack, cubic_spring, disc, ",
        ),
        (
            "[disc]",
            "[[disc]]\nat = 0\nmass = 1\n[[disc]]\nmas = 1",
            "disc.1.mas is not a parameter",
        ),
        ("[disc]", "[dics]", "dics is not a part of a scene (did you mean `[disc]`?)"),
        ("[disc]", "[dicss]", "dicss is not a part of a scene (did you mean `[disc]`?)"),
        ("[shaft]", "[shfat]", "shfat is not a part of a scene (did you mean `[shaft]`?)"),
        ("[shaft]", "[spindle]", "spindle is not a part of a scene"),
        ("[disc]", "[impeller]", "impeller is not a part of a scene (did you mean `[disc]`?)"),
        ("[disc]", "[bearings]", "bearings is not a part of a scene (did you mean `[support]`?)"),
        ('[spin]\nspeed = "1500 rpm"\n', "", "spin is missing; a scene needs: shaft, spin."),
        (
            "[shaft]",
            "[shaft]\nmodel = 'flexibel'",
            "shaft.model must be 'flexible' or 'massless' or 'rigid', but is 'flexibel'.",
        ),
        (
            "[shaft]",
            "[shaft]\nmodel = [1]",
            "shaft.model must be 'flexible' or 'massless' or 'rigid', but is [1].",
        ),
        (
            "[spin]",
            "[spin]\nmodel = 3",
            "spin.model must be 'constant' or 'drive' or 'profile', but is 3.",
        ),
        (
            "[shaft]",
            "[shaft]\nrule = 'simpson'",
            "shaft.rule must be 'spectral' or 'trapezoid', but is 'simpson'.",
        ),
        (
            "[shaft]",
            "[shaft]\nnodes = 8.0",
            "shaft.nodes must be 'auto' or a whole number up to 10000000, but is 8.0.",
        ),
        (
            "[shaft]",
            "[shaft]\nnodes = true",
            "shaft.nodes must be 'auto' or a whole number up to 10000000, but is True.",
        ),
        (
            "[shaft]",
            "[shaft]\nrule = 'trapezoid'\nnodes = 0x" + "f" * 5000,
            "shaft.nodes must be 'auto' or a whole number up to 10000000, but is a huge number.",
        ),
        ("[shaft]", "[shaft]\nnodes = 99", "shaft: `nodes` must be 2 to 24"),
        (
            "[shaft]",
            "[shaft]\nrotary_inertia = 'no'",
            "shaft.rotary_inertia must be true or false, but is 'no'.",
        ),
        (
            "[shaft]",
            "[shaft]\nmaterial = 'stee'",
            "shaft.material must be a table or 'steel', but is 'stee'.",
        ),
        ("[shaft]", "[shaft]\nmaterial = 5", "shaft.material must be a table, but is 5."),
        (
            "[shaft]",
            "[shaft]\nmaterial = {density = 1}",
            "shaft.material.youngs_modulus is missing; a material needs: youngs_modulus, density.",
        ),
        ('title = "Test"', "title = 5", "title must be a text, but is 5."),
        ('title = "Test"', "gravity = 9.81", "gravity must be a table, but is 9.81."),
        ('title = "Test"', "gravities = [9.81]", "gravities.0 must be a table, but is 9.81."),
        ('title = "Test"\n[shaft]', "shaft = 1\n[gravity]\n#", "shaft must be a table, but is 1."),
        (
            "settle =",
            "setle =",
            "sweep.setle is not a parameter of a sweep (did you mean `settle`?); it has: "
            "over, settle, keep, steps_per_revolution, start.",
        ),
        (
            "settle = 10",
            "settle = -1",
            "sweep.settle must be a whole number from 0 to 10000000, but is -1.",
        ),
        (
            "settle = 10",
            "keep = 0",
            "sweep.keep must be a whole number from 1 to 10000000, but is 0.",
        ),
        (
            "settle = 10",
            "settle = '1 s'",
            "sweep.settle must be a whole number from 0 to 10000000, but is '1 s'.",
        ),
        (
            '"spin.speed"',
            '"spin.sped"',
            "sweep.over.spin.sped: The scene has no parameter `spin.sped` (did you mean "
            "`spin.speed`?)",
        ),
        (
            "0 : 3000 rpm : 3",
            "0 : 3000 rpm",
            'sweep.over.spin.speed must be a list, or "start : stop : count" with a count '
            "from 2 to 10000000, but is '0 : 3000 rpm'.",
        ),
        ("3000 rpm : 3", "3000 rpm : 1", "sweep.over.spin.speed must be a list, or"),
        ("3000 rpm : 3", "3000 rpm : 99999999", "sweep.over.spin.speed must be a list, or"),
        ('"0 : 3000 rpm : 3"', "[]", "sweep.over.spin.speed must be a list, or"),
        ('"0 : 3000 rpm : 3"', "5", "sweep.over.spin.speed must be a list, or"),
        (
            '"0 : 3000 rpm : 3"',
            "[0, '1 m']",
            "sweep.over.spin.speed.1 must be in rad/s, but is '1 m' (write rpm or rad/s).",
        ),
        (
            "3000 rpm : 3",
            "3000 mm : 3",
            "sweep.over.spin.speed must be in rad/s, but is '3000 mm' (write rpm or rad/s).",
        ),
        (
            "radius =",
            "radios =",
            "sweep.start.radios is not a parameter of a start (did you mean `radius`?); it "
            "has: radius, rate, angle.",
        ),
        ("1 mm", "1 s", "sweep.start.radius must be in m, but is '1 s'."),
    ],
)
def test_every_slip_gets_one_sentence(old, new, message):
    found = refused(good(old, new))
    assert found.startswith(f"my.toml: {message}"), found


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "my.toml is empty; a scene needs at least [shaft] and [spin]."),
        ("# only a comment\n", "my.toml is empty;"),
        (
            "[shaft]\nlength = \n",
            "my.toml is not valid TOML: Invalid value (at line 2, column 10).",
        ),
        (
            "[shaft]\n[shaft]\n",
            "my.toml has [shaft] a second time, at line 2; it can have one, so join the two.",
        ),
        (
            good("[unbalance]", "[disc]\n[unbalance]"),
            "my.toml has [disc] a second time, at line 9; write [[disc]] for each of several.",
        ),
        (
            good("[unbalance]", "[[discs]]\n[discs]\n[unbalance]"),
            "my.toml has [discs] a second time, at line 10; write [[discs]] for each of several.",
        ),
        (
            good("[unbalance]", "[[disc]]\n[unbalance]"),
            "my.toml has [disc] a second time, at line 9; write [[disc]] for each of several.",
        ),
        (
            good("mass = 2.5", "mass = 2.5\nmass = 3"),
            "my.toml gives mass a second time, at line 9; keep one of the two.",
        ),
        ("[shaft]\na = " + "9" * 5000, "my.toml is not valid TOML: Exceeds the limit"),
        ("a = " + "[" * 9000, "my.toml is not valid TOML: "),
        (
            "a = 2023-02-30",
            "my.toml is not valid TOML: Invalid date or datetime (at line 1, column",
        ),
        ("\x00", "my.toml is not valid TOML: "),
        (
            good("[sweep.over]\n", "[sweep.over]\n" + "a." * 5000 + "b = 1\n"),
            "my.toml is nested too",
        ),
    ],
)
def test_texts_that_are_no_scene(text, message):
    assert refused(text).startswith(message)


def test_unreadable_files(tmp_path):
    def sentence(path, start):
        for reader in (load, study):
            with pytest.raises(SceneError) as caught:
                reader(path)
            shown = str(path).replace("\0", "\\x00")
            assert str(caught.value).startswith(f"{shown} {start}"), caught.value
            assert str(caught.value).endswith(".")

    near = f"(did you mean `limiter-rotor`?); shipped are: {', '.join(sorted(OTHERS + NAMES))}."
    sentence("limiter-roter", f"is neither a file nor a shipped scene {near}")
    (tmp_path / "my-rotor.toml").touch()
    near = "(did you mean `my-rotor.toml`?)"
    for misspelt in ("my-rotr.toml", "my-rotor"):
        sentence(
            tmp_path / misspelt, f"is neither a file nor a shipped scene {near}; shipped are: "
        )
    for name in ("my-fan.toml", "my-fan"):
        begin = "`jaxrotor new my-fan.toml` writes one to begin with; shipped are: "
        sentence(name, f"is neither a file nor a shipped scene; {begin}")
    sentence(tmp_path, "cannot be read (Is a directory); give a TOML file in UTF-8.")
    sentence("", "cannot be read (Is a directory)")
    sentence("a\x00b", "cannot be read (embedded null byte)")
    sentence("a" * 300, "cannot be read (File name too long)")
    (tmp_path / "latin.toml").write_bytes('title = "Größe"'.encode("latin-1"))
    sentence(tmp_path / "latin.toml", "cannot be read ('utf-8' codec can't decode byte 0xf6 in ")


def test_files_of_other_editors(tmp_path):
    """A byte order mark and line ends of Windows are accepted."""
    (tmp_path / "a.toml").write_bytes(good().replace("\n", "\r\n").encode("utf-8-sig"))
    same(load(str(tmp_path / "a.toml")), loads(good()))


def test_mutated_files_never_end_in_another_exception():
    """Every text gives a scene or an error message of one sentence."""
    rng = random.Random(2023)
    texts = [file.read_text("utf-8") for file in _shipped().values()]
    junk = [*"[]{}=\"'.,#\n\t éz\x00\\-1", "true", "nan", "1e999", "1979-05-27", '"9**9 m"', "[1]"]
    accepted = 0
    for _ in range(400):
        text = rng.choice(texts)
        lines = [i for i, line in enumerate(text.split("\n")) if "=" in line and line[0] != "#"]
        for _ in range(rng.choice([1, 2, 3])):
            if rng.random() < 0.5:
                rows = text.split("\n")
                i = min(rng.choice(lines), len(rows) - 1)
                rows[i] = f"{rows[i].partition('=')[0]}= {rng.choice(junk)}"
                text = "\n".join(rows)
            else:
                i = rng.randrange(len(text))
                text = text[:i] + rng.choice(junk) + text[i + rng.randrange(3) :]
        try:
            scene = loads(text, "my.toml")
        except SceneError as error:
            assert str(error).startswith("my.toml") and str(error).endswith(".")
        else:
            accepted += 1
            same(scene, loads(dumps(scene)))
    assert 10 < accepted < 300


@pytest.mark.slow
def test_from_another_folder_and_without_pint(tmp_path):
    """Shipped scenes load from any folder; pint is imported only for units that it was never asked."""
    env = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    code = (
        "import sys, jaxrotor.files as f\n"
        "s = f.load('limiter-rotor-2023')\n"
        "f.save(s, 'here.toml')\n"
        "assert 'pint' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, env=env)
    code = (
        "import sys, jaxrotor.files as f\n"
        "f.load('here.toml')\n"
        "f.load('limiter-rotor-2023')\n"
        "assert 'pint' not in sys.modules and 'tomlkit' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, env=env)


@pytest.mark.parametrize("name", [name for name, _ in shipped()])
def test_every_shipped_scene_has_finite_equations(name):
    system = assemble(load(name))
    numbers = [leaf for leaf in jax.tree.leaves(system) if eqx.is_inexact_array(leaf)]
    assert numbers and all(np.isfinite(leaf).all() for leaf in numbers)


def test_factors_of_units_are_remembered(tmp_path, monkeypatch):
    """The first process asks pint, later ones read its answers; a damaged file is written anew."""
    file = tmp_path / "factors.json"
    monkeypatch.setattr(units, "_factors_file", lambda: file)
    asked = []

    def by_pint(given, wanted, ask=units._factor_by_pint):
        asked.append(given)
        return ask(given, wanted)

    monkeypatch.setattr(units, "_factor_by_pint", by_pint)
    for content, times in ((None, 1), (None, 1), ('{"mm -> m": "not a nu', 2), ("[3]", 3)):
        if content is not None:
            file.write_text(content)
        units._remembered.cache_clear()
        assert units.quantity("7.5 mm", "m", "x") == 0.0075
        assert asked == ["mm"] * times and file.read_text() == '{"mm -> m": "0.001"}'
    assert list(tmp_path.iterdir()) == [file]
    units._remembered.cache_clear()
