"""Rotors that ROSS has written: results of ROSS, and notes on everything that is changed or left out."""

import copy
import json
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor.cli import app
from jaxrotor.core.quantities import value_of


HERE = Path(__file__).parent / "ross"  # written by ROSS 2.3.0, see `reference.py` there
ROOTS = json.loads((HERE / "roots.json").read_text())
CASES = [("example.toml", s) for s in (0, 400, 1200)] + [("stepped.json", s) for s in (0, 500)]
CASES += [("housed.json", s) for s in (0, 500)]  # bearings on masses of their own
STEPPED = json.loads((HERE / "stepped.json").read_text())
SHAFT, FRONT = "ShaftElement_Shaft Element 1", "BearingElement_front"
REAR = "BearingElement_rear"


def of_ross(name, speed, cut):
    found = ROOTS[f"{name.partition('.')[0]} at {speed:g} rad/s, elements cut into {cut}"]
    return np.array(found) @ [1, 1j]


def oscillating(scene, count):
    found = np.asarray(jr.roots(scene))
    return found[found.imag > 1.0][:count]


@pytest.fixture
def changed(tmp_path):
    """The stepped rotor with other values of an element, read at 500 rad/s."""

    def read(change, speed=500.0):
        document = copy.deepcopy(STEPPED)
        change(document)
        path = tmp_path / "rotor.json"
        path.write_text(json.dumps(document))
        return jr.from_ross(path, speed)

    return read


def put(element, **values):
    return lambda document: document[element].update(values)


# === numbers


@pytest.mark.slow
@pytest.mark.parametrize(("name", "speed"), CASES)
def test_roots_are_those_of_ross(name, speed):
    """Twelve roots each, with gyroscopic moments, eight-coefficient bearings, steps and two materials.

    The errors of ROSS's elements fall with the square of their length, so the limit is extrapolated
    from 12 and 24 pieces of each element.
    """
    scene, notes = jr.from_ross(HERE / name, speed)
    assert all("depend on speed" in note for note in notes)
    if "rear" in str(notes):
        scene = as_by_ross_2(scene, speed)
    coarse, medium, fine = (of_ross(name, speed, cut) for cut in (1, 12, 24))
    found = oscillating(scene, 12)
    error = lambda other: np.abs(found - other) / np.abs(found)
    assert (error((4 * fine - medium) / 3) < 4e-8).all()
    assert (error((4 * fine - medium) / 3)[:4] < 5e-10).all()
    assert (error(fine) < error(medium)).all() and (error(medium) < error(coarse) / 50).all()


def as_by_ross_2(scene, speed):
    """The stepped rotor with the coefficients of its rear bearing by a parabola, as ROSS 2 has them."""
    nodes = STEPPED[REAR]["frequency"]
    at = lambda key: float(np.polyval(np.polyfit(nodes, STEPPED[REAR][key], 2), speed))
    values = {f"supports.1.{key}": at(key) for key in ("kxx", "kyy", "cxx", "cyy")}
    return scene.replace(values | {"supports.1.speeds": None})


@pytest.mark.slow
def test_frequencies_in_the_documentation_of_ross():
    """Natural frequencies printed in the documentation of ROSS, [91.79655318 96.28899977]."""
    found = oscillating(jr.from_ross(HERE / "example.toml", 0.0)[0], 2)
    np.testing.assert_allclose(found.imag, [91.79655318, 96.28899977], rtol=2e-6)


def test_scene_of_the_file():
    scene, notes = jr.from_ross(HERE / "stepped.json", 500.0)
    shaft = scene.shaft
    assert float(shaft.length) == pytest.approx(0.8) and not shaft.constraints
    ats = [float(step.at) for step in shaft.steps]
    assert ats == pytest.approx([0.2, 0.3, 0.6, 0.7])  # equal neighbours are one section
    assert [float(step.diameter) for step in shaft.steps] == [0.05, 0.06, 0.04, 0.03]
    assert [step.material is None for step in shaft.steps] == [True, False, True, True]
    assert float(shaft.steps[1].inner_diameter) == 0.02
    assert [float(disc.at) for disc in scene.of(jr.Disc)] == pytest.approx([0.0, 0.45])
    area = lambda outer, inner=0.0: np.pi * (outer**2 - inner**2) / 4
    steel = 0.3 * area(0.03) + 0.1 * area(0.05) + 0.1 * area(0.04)
    mass = 12.0 + 7850 * steel + 8800 * 0.3 * area(0.06, 0.02)
    assert float(jr.total_mass(scene)) == pytest.approx(mass, rel=1e-12)
    assert notes == (
        "coefficients that depend on speed are interpolated by PCHIP, as by ROSS 3: rear",
    )
    assert "stepped.json" in scene.assumption
    assert jr.from_ross(HERE / "example.toml", 0.0)[0].assumption == ""


def stiffness(scene, which):
    """Stiffness matrix of a support, [[xx, xy], [yx, yy]]."""
    own = scene.of(jr.Support)[which]
    values = [getattr(own, name) for name in ("kxx", "kxy", "kyx", "kyy")]
    return np.reshape(np.array(values, float), (2, 2))


@pytest.mark.parametrize(("speed", "kxx"), [(0, 2e7), (700, 2.8e7), (9000, 3e7)])
def test_table_of_coefficients(speed, kxx):
    scene, notes = jr.from_ross(HERE / "stepped.json", float(speed))
    front, rear = scene.of(jr.Support)
    assert front.speeds is None and rear.hold
    assert rear.speeds.tolist() == STEPPED[REAR]["frequency"]
    for key in ("kxx", "kyy", "cxx", "cyy"):
        assert getattr(rear, key).tolist() == STEPPED[REAR][key]
    assert float(rear.kxy) == 0
    assert float(rear.at_speed(speed).kxx) == pytest.approx(kxx, rel=1e-9)
    assert any("nearer end: rear" in note for note in notes) == (speed == 9000)
    assert stiffness(scene, 0) == pytest.approx(np.array([[3e7, 4e6], [-6e6, 5e7]]))


def third(**values):
    """Change to a file of ROSS 3, with the rear bearing by these."""

    def change(document):
        nothing = {key: [0.0] for key in ("kxy", "kyx", "cxy", "cyx")}
        document["ross_version"] = "3.0.0"
        document[REAR] = {"n": 7, "tag": "rear", "frequency": None, **nothing, **values}

    return change


def test_tables_of_ross_3(changed):
    scene, notes = changed(third(speed=[0.0, 800.0], kxx=[1e7, 2e7], kyy=[3e7, 4e7], cxx=[1e3]))
    rear = scene.of(jr.Support)[1]
    assert rear.speeds.tolist() == [0, 800] and rear.kxx.tolist() == [1e7, 2e7]
    assert rear.kyy.tolist() == [3e7, 4e7] and float(rear.cxx) == value_of(rear, "cyy") == 1e3
    assert not notes


@pytest.mark.parametrize("over", ["speed", "frequency"])
def test_interpolation_of_ross_3_is_kept(changed, over):
    """Halfway between two nodes a straight line has the mean of their values."""
    table = {over: [0.0, 100.0, 200.0, 400.0, 800.0], "kxx": [1e6, 1.1e6, 1.5e6, 3e6, 9e6]}
    scene, notes = changed(third(**table, cxx=[1e3], interpolation="linear"), speed=600.0)
    rear = scene.of(jr.Support)[1]
    read = rear.at_speed if over == "speed" else rear.at_whirl
    assert float(read(600.0).kxx) == pytest.approx(6e6, rel=1e-15) and not notes
    notes = changed(third(**table, cxx=[1e3], interpolation="spline"))[1]
    assert notes == ("interpolation by 'spline' is replaced by PCHIP: rear",)


def test_linear_tables_in_series_are_read_by_straight_lines(changed):
    """Between nodes of its own a table in series is read where the other one has a node."""
    table = {"kxx": [1e8, 2e8], "speed": [200.0, 800.0], "interpolation": "linear"}

    def link(document):
        on_support({"cxx": [0.0, 0.0], **table})(document)
        document["ross_version"] = "3.0.0"
        one = {"kxx": [3e7, 4e7, 9e7], "kyy": [3e7, 4e7, 9e7], "speed": [200.0, 500.0, 800.0]}
        document[FRONT].update(cxx=[0.0], cyy=[0.0], interpolation="linear", **one)

    front = changed(link)[0].of(jr.Support)[0]
    assert front.interpolation == "linear"
    assert float(front.kxx[1]) == pytest.approx(4e7 * 1.5e8 / 1.9e8, rel=1e-12)


def test_negative_direct_stiffness_of_a_seal(changed):
    seal = {"frequency": [500.0, 800.0], "kxx": [-2e4, -3e4], "cxx": [15.0, 15.0]}
    scene, _ = changed(lambda d: d.update({"LabyrinthSeal_L": {"n": 3, "tag": "L", **seal}}))
    (own,) = [one for one in scene.of(jr.Support) if one.speeds is not None and one.kxx[0] < 0]
    assert own.kxx.tolist() == value_of(own, "kyy").tolist() == [-2e4, -3e4]


def test_added_mass_of_a_seal(changed):
    """In ROSS `myy=None` is `mxx`; two kilograms are those of the support, and nothing is noted."""
    scene, notes = changed(put(FRONT, mxx=[2.0], myy=None))
    assert float(scene.of(jr.Support)[0].mxx) == 2.0 and not any("inertia" in one for one in notes)


def test_coefficients_without_a_value_are_those_that_ross_takes(changed):
    """In ROSS `kyy=None` is `kxx`, and `cyy=None` is `cxx`; a JSON file has null for both.

    They stay so where `kxx` is another number, so that a bearing that is the same all round stays one.
    """
    scene = changed(put(FRONT, kyy=None, cyy=None))[0]
    front = scene.of(jr.Support)[0]
    assert value_of(front, "kyy") == float(front.kxx) == 3e7
    assert value_of(front, "cyy") == float(front.cxx) == 4e3
    for other in (scene.replace, scene.put):
        stiff = other({"supports.0.kxx": jnp.asarray(7e7)})
        assert stiff.values("supports.0.kyy") == ([7e7], "kxx")
        assert float(stiff.of(jr.Support)[0].mean_stiffness) == 7e7
    given = changed(put(FRONT, kyy=[3e7]))[0].replace({"supports.0.kxx": 7e7})
    assert float(given.of(jr.Support)[0].kyy) == 3e7


@pytest.mark.parametrize("key", ["Id", "Ip", "m"])
def test_half_a_disc_is_not_left_out(changed, key):
    with pytest.raises(jr.SceneError, match=rf"DiskElement_middle\.{key} is missing"):
        changed(lambda document: document["DiskElement_middle"].pop(key))


def test_tables_over_speed_and_whirl_frequency(changed):
    speeds, whirls = np.array([100.0, 400.0, 900.0]), np.array([0.0, 1000.0])
    table = 1e7 + 2e4 * speeds[:, None] - 5e3 * whirls
    both = {"speed": speeds.tolist(), "frequency": whirls.tolist()}
    scene, notes = changed(third(**both, kxx=table.tolist(), cxx=[[1e3, 1e3]] * 3))
    rear = scene.of(jr.Support)[1]
    assert rear.speeds.tolist() == speeds.tolist() and rear.frequencies.tolist() == whirls.tolist()
    assert rear.kxx.tolist() == value_of(rear, "kyy").tolist() == table.tolist()
    assert float(rear.cxx) == 1e3 and rear.hold and not notes
    still = np.broadcast_to(table[0], table.shape)  # the same at every speed
    rear = changed(third(**both, kxx=still.tolist(), cxx=[1e3]))[0].of(jr.Support)[1]
    assert rear.speeds is None and rear.kxx.tolist() == table[0].tolist()


def test_table_over_whirl_frequency_alone(changed):
    scene, notes = changed(third(frequency=[0.0, 800.0], kxx=[1e7, 2e7], cxx=[1e3]))
    rear = scene.of(jr.Support)[1]
    assert rear.speeds is None and rear.frequencies.tolist() == [0, 800]
    assert rear.kxx.tolist() == [1e7, 2e7] and not notes


def test_tables_over_whirl_frequency_in_series(changed):
    """At synchronous whirl `k = a + b Omega + c w` is `a + (b + c) Omega`; `1/k = 1/k1 + 1/k2`."""
    speeds, whirls = np.array([100.0, 400.0, 900.0]), np.array([0.0, 1000.0])
    table = 1e7 + 2e4 * speeds[:, None] - 5e3 * whirls

    def link(document):
        on_support({"kxx": [1e8], "cxx": [0.0]})(document)
        document["ross_version"] = "3.0.0"
        own = {"speed": speeds.tolist(), "frequency": whirls.tolist(), "kxx": table.tolist()}
        document[FRONT].update(own, kyy=table.tolist(), cxx=[0.0], cyy=[0.0], kxy=[0.0], kyx=[0.0])

    scene, notes = changed(link)
    front, own = scene.of(jr.Support)[0], 1e7 + 1.5e4 * speeds
    at = [float(front.at_speed(speed).kxx) for speed in speeds]
    assert at == pytest.approx((own * 1e8 / (own + 1e8)).tolist(), rel=1e-12)
    assert "coefficients over whirl frequency are those of synchronous whirl: front" in notes


def test_negative_speed_is_refused():
    """Cross-coupling of films and seals changes its sign with the rotation, so the file is not valid."""
    with pytest.raises(
        jr.SceneError, match="speed must not be negative.*, but is -700 rad/s"
    ) as error:
        jr.from_ross(HERE / "stepped.json", -700.0)
    assert str(error.value).endswith(".")


# === changes and omissions


@pytest.mark.parametrize(
    ("change", "note"),
    [
        (put(SHAFT, axial_force=100.0), "axial force is left out: Shaft Element 1"),
        (put(SHAFT, torque=3), "torque is left out: Shaft Element 1"),
        (put(SHAFT, beta=1e-5), "damping in proportion to stiffness (beta) is left out"),
        (put(SHAFT, shear_method_calc="hutchinson"), "Cowper in place of Hutchinson"),
        (put(SHAFT, gyroscopic=False), "gyroscopic is taken into account all along the shaft"),
        (put(FRONT, mxx=[2.0, 4.0], myy=3.0), "is 3 kg, the mean of mxx and myy or 0: front"),
        (put(FRONT, mxx=-1.0), "inertia of a bearing or seal is 0 kg, the mean of mxx and"),
        (put(FRONT, kzz=[1e5]), "axial stiffness, damping and inertia are left out: front"),
        (put(FRONT, preload=0.3), "`preload` is not read: front"),
        (lambda d: d.update({"Gadget_1": {"n": 2}}), "Gadget is left out: Gadget"),
        (
            lambda d: d.update({"PointMass_a": {"n": 3, "mx": 1.0, "my": 2.0}}),
            "mass that differs along x and y is replaced by its mean: PointMass",
        ),
    ],
)  # fmt: skip
def test_omissions_are_noted(changed, change, note):
    scene, notes = changed(change)
    assert len(notes) == 2 and any(note in one for one in notes), notes
    assert scene.assumption


def test_one_note_for_many(changed):
    def twist(document):
        for name, table in document.items():
            if name.startswith("ShaftElement"):
                table["torque"] = 1.0

    assert "torque is left out: Shaft Element 0 and 6 more" in changed(twist)[1]


def test_tapered_element_is_cut(changed):
    """Diameters are those at the middles of four pieces; the mass is that of the cone within 0.2 %."""
    scene, notes = changed(put(SHAFT, odl=0.03, odr=0.045))
    # `Int dx / d^4` over the thinnest piece, by that of its middle.
    ends = 0.03 + 0.015 * np.arange(3) / 8
    error = (ends[0] ** -3 - ends[2] ** -3) / 3 / (ends[2] - ends[0]) * ends[1] ** 4 - 1
    said = "tapered element is cut into 4 uniform ones, whose flexibility is off by up to"
    assert f"{said} {100 * error:.2g} %: Shaft Element 1" in notes
    diameters = [float(step.diameter) for step in scene.shaft.steps][:4]
    assert diameters == pytest.approx(0.03 + 0.015 * (np.arange(4) + 0.5) / 4)
    squares = np.mean(np.square(diameters))
    assert squares == pytest.approx((0.03**2 + 0.03 * 0.045 + 0.045**2) / 3, rel=2e-3)


@pytest.mark.parametrize(
    ("length", "said"),
    [
        (0.006, "cut into 4 u"),
        (0.0047, "cut into 3 u"),
        (0.003, "cut into 2 u"),
        (0.002, "taken as a u"),
    ],
)
def test_pieces_of_a_short_taper_are_counted(changed, length, said):
    notes = changed(put(SHAFT, L=length, odl=0.03, odr=0.045))[1]
    assert any(note.startswith(f"tapered element is {said}") for note in notes), notes


def test_sleeve_of_the_same_material_is_exact(changed):
    sleeve = {**STEPPED[SHAFT], "idl": 0.03, "idr": 0.03, "odl": 0.05, "odr": 0.05}
    scene, notes = changed(lambda d: d.update({"ShaftElement_sleeve": sleeve}))
    assert len(notes) == 1
    assert [float(step.diameter) for step in scene.shaft.steps] == [0.05, 0.06, 0.04, 0.03]
    assert float(scene.shaft.steps[0].at) == pytest.approx(0.08)


def test_sleeve_of_another_material(changed):
    """The layers become one ring with the same mass and bending stiffness per length."""
    light = {"name": "light", "E": 7e10, "rho": 2700.0, "G_s": 2.6e10}
    sleeve = {**STEPPED[SHAFT], "idl": 0.03, "idr": 0.03, "odl": 0.05, "odr": 0.05}
    scene, notes = changed(lambda d: d.update({"ShaftElement_s": {**sleeve, "material": light}}))
    step = scene.shaft.steps[0]
    area, second = np.pi * 0.05**2 / 4, np.pi * 0.05**4 / 64
    core, tube = np.pi * 0.03**4 / 64, np.pi * (0.05**4 - 0.03**4) / 64
    assert float(step.material.youngs_modulus) * second == pytest.approx(
        2.1e11 * core + 7e10 * tube
    )
    mass = np.pi / 4 * (7850 * 0.03**2 + 2700 * (0.05**2 - 0.03**2))
    assert float(step.material.density) * area == pytest.approx(mass)
    inertia = 7850 * core + 2700 * tube
    error = float(step.material.density) * second / inertia - 1
    (said,) = [note for note in notes if "layers are taken as one ring" in note]
    assert said.endswith(
        f"whose rotary inertia is off by up to {100 * error:.2g} %: Shaft Element 1"
    )


def on_support(ground, mass=None):
    """Change that puts the front bearing on another one, with a mass between them unless it is None."""
    plain = {key: [0.0] for key in ("kxy", "kyx", "cxy", "cyx")}

    def link(document):
        document[FRONT].update(n_link=20, kxx=[3e7], kyy=[5e7], cxx=[4e3], cyy=[6e3], **plain)
        document["BearingElement_ground"] = {"n": 20, "tag": "ground", **ground}
        if mass is not None:
            document["PointMass_casing"] = {"n": 20, "mx": mass, "my": mass, "tag": "casing"}

    return link


def test_bearing_on_a_flexible_support(changed):
    """In series `1/k = 1/k1 + 1/k2`, `c = c1 (k/k1)^2 + c2 (k/k2)^2`."""
    scene, notes = changed(on_support({"kxx": 1e8, "cxx": 1e3}))
    front = scene.of(jr.Support)[0]
    expected = np.array([3e7 * 1e8 / 1.3e8, 5e7 * 1e8 / 1.5e8])
    assert np.diag(stiffness(scene, 0)) == pytest.approx(expected)
    loss = np.array([4e3, 6e3]) * (expected / [3e7, 5e7]) ** 2 + 1e3 * (expected / 1e8) ** 2
    assert [float(front.cxx), float(front.cyy)] == pytest.approx(loss)
    assert len(scene.of(jr.Support)) == 2 and len(scene.of(jr.Disc)) == 2
    assert not scene.of(jr.Casing)
    (said,) = [note for note in notes if "in series" in note]
    assert "(omega C << K of either): front" in said


def test_two_in_series_that_are_the_same_all_round(changed):
    """`k = k1 k2 / (k1 + k2)`, along y the same, also where the bearing is given another stiffness."""

    def link(document):
        on_support({"kxx": 1e8, "cxx": 1e3})(document)
        document[FRONT].update(kyy=None, cyy=None)

    scene = changed(link)[0]
    front = scene.of(jr.Support)[0]
    assert value_of(front, "kyy") == float(front.kxx) == pytest.approx(3e7 * 1e8 / 1.3e8)
    assert scene.replace({"supports.0.kxx": 7e7}).values("supports.0.kyy") == ([7e7], "kxx")


def test_tables_in_series(changed):
    """At every speed of both tables within their common range `1/k = 1/k1 + 1/k2`."""
    table = {"kxx": [1e8, 2e8], "frequency": [200.0, 800.0]}

    def link(document):
        on_support({"cxx": [0.0, 0.0], **table})(document)
        one = {"kxx": [3e7, 4e7, 6e7], "kyy": [3e7, 4e7, 6e7], "frequency": [0.0, 500.0, 700.0]}
        document[FRONT].update(cxx=[0.0], cyy=[0.0], **one)

    front = changed(link)[0].of(jr.Support)[0]
    assert front.speeds.tolist() == [200, 500, 700]
    own, ground = np.array([4e7, 6e7]), 1e8 * (1 + np.array([300.0, 500.0]) / 600)
    assert front.kxx[1:].tolist() == pytest.approx(
        (own * ground / (own + ground)).tolist(), rel=1e-12
    )
    with pytest.raises(jr.SceneError, match="a range of speeds in common"):
        table["frequency"] = [700.0, 800.0]
        changed(link)


def test_mass_of_a_flexible_support_is_a_casing(changed):
    scene, notes = changed(on_support({"kxx": 1e8, "kyy": 7e7, "cxx": 1e3}, mass=40.0))
    (casing,) = scene.of(jr.Casing)
    assert (casing.name, float(casing.mass)) == ("casing", 40.0)
    bearings = scene.of(jr.Support)
    assert [(one.on, one.of) for one in bearings] == [
        ("casing", None),
        (None, None),
        (None, "casing"),
    ]
    assert np.diag(stiffness(scene, 0)) == pytest.approx([3e7, 5e7])
    assert np.diag(stiffness(scene, 2)) == pytest.approx([1e8, 7e7])
    assert len(notes) == 1 and "depend on speed" in notes[0]


def test_masses_at_one_node_and_one_that_nothing_holds(changed):
    def more(document):
        on_support({"kxx": 1e8}, mass=40.0)(document)
        document["PointMass_lid"] = {"n": 20, "mx": 5.0, "my": 7.0, "tag": "lid"}
        document["PointMass_far"] = {"n": 33, "mx": 5.0, "my": 5.0, "tag": "far"}

    scene, notes = changed(more)
    assert [float(one.mass) for one in scene.of(jr.Casing)] == [46.0]
    assert "mass that no bearing holds is left out: far" in notes
    assert "mass that differs along x and y is replaced by its mean: lid" in notes


def test_squeeze_film_in_series_is_noted(changed):
    """`omega C / K` of the film is 500 * 2e4 / 1e7 = 1, and 0.28 at 140 rad/s."""
    film = {"kxx": 1e7, "cxx": 2e4}
    notes = changed(on_support(film))[1]
    assert any(
        "too high at the speed" in note and "omega C / K is 1: front" in note for note in notes
    )
    assert not any("too high" in note for note in changed(on_support(film), speed=140.0)[1])


def test_short_section_takes_its_neighbours_diameter(changed):
    """A groove of 1 mm is shorter than the least distance of steps."""
    scene, notes = changed(put(SHAFT, L=0.001, odl=0.02, odr=0.02))
    assert float(scene.shaft.length) == pytest.approx(0.681)
    assert [float(step.diameter) for step in scene.shaft.steps] == [0.05, 0.06, 0.04, 0.03]
    assert any("0.001 m of 0.02 m" in note for note in notes)


# === refusals


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.pop(SHAFT), "do not make one line"),
        (lambda d: d.update({"CouplingElement_c": {"n": 3}}), "joins shafts by springs"),
        (put(SHAFT, L=-1.0), "Shaft Element 1.L must be positive"),
        (put(SHAFT, odl=0.0, odr=0.0), "above the inner diameter"),
        (put(SHAFT, material="steel"), "material must be a table"),
        (put(SHAFT, n="1"), "n must be a whole number"),
        (put(SHAFT, shear_effects="no"), "shear_effects must be true or false"),
        (put(FRONT, kxx=[1.0, 2.0]), "frequency must be a list of as many numbers"),
        (put(FRONT, kxx=[1.0, 2.0], frequency=[2.0, 1.0]), "must be ascending"),
        (
            put(FRONT, kxx=[1.0, 2.0, 3.0], cxx=[1.0, 2.0], frequency=[1, 2, 3]),
            "cxx must be a list of 3",
        ),
        (put(FRONT, kxx=[[1.0, 2.0], [3.0]]), "kxx must be a list of rows of equal length"),
        (
            put(FRONT, kxx=[[1.0, 2.0]], frequency=[1.0]),
            "tables over `speed` and `frequency` of one",
        ),
        (put(FRONT, cxx=[-9e9]), "front: `cxx + cyy [N s/m]` must not be negative, but is -"),
        (
            lambda d: d[FRONT].pop("kxy"),
            "front: `kyx [N/m]` is given without `kxy [N/m]`; give that too: 0 if",
        ),
        (lambda d: d[FRONT].pop("kxx"), "front.kxx is missing; a bearing or seal needs it, 0 if"),
        (put(FRONT, n_link=40), "n_link must be the node of another bearing"),
        (put("DiskElement_middle", n=31), "n must be a node of the shaft, but is 31"),
        (put("DiskElement_middle", m="heavy"), "m must be in kg, but is 'heavy'"),
        (lambda d: [d.pop(k) for k in list(d) if k.startswith("Shaft")], "has no shaft elements"),
    ],
)
def test_refused_in_one_sentence(changed, change, said):
    with pytest.raises(jr.SceneError, match="rotor.json") as error:
        changed(change)
    assert said in str(error.value) and str(error.value).endswith(".")


@pytest.mark.parametrize("text", ["", "{", "[]", '{"ShaftElement_1": 3}', "\x00", "[" * 10**5])
def test_no_file_of_ross(tmp_path, text):
    for suffix in (".json", ".toml"):
        path = tmp_path / f"rotor{suffix}"
        path.write_text(text)
        with pytest.raises(jr.SceneError):
            jr.from_ross(path, 100.0)
    with pytest.raises(jr.SceneError, match="cannot be read"):
        jr.from_ross(tmp_path / "none.json", 100.0)


ODD = [None, -1, 0, 1e300, float("nan"), "2 furlongs", True, [], {}, [1, "x"]]


@pytest.mark.parametrize("element", [SHAFT, FRONT, "DiskElement_middle"])
def test_odd_values_end_in_a_sentence(changed, element):
    """Every key of an element without a value or with an odd one is read, or refused in one sentence."""
    keys = [key for key in STEPPED[element] if key not in ("color", "scale_factor")]
    for number, key in enumerate(keys):
        for odd in (None, *ODD[number % 3 :: 3]):
            try:
                changed(put(element, **{key: odd}))
            except jr.SceneError as error:
                assert str(error).endswith("."), error


# === as a command


def test_new_scene_from_ross(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = lambda *args: CliRunner().invoke(app, ["new", *map(str, args)])
    options = ["--from-ross", HERE / "stepped.json", "--speed", "500 rad/s"]
    done = run("mine.toml", *options)
    assert done.exit_code == 0, done.stderr
    assert "coefficients that depend on speed" in done.stdout
    text = (tmp_path / "mine.toml").read_text()
    assert text.startswith("# Not as in stepped.json: coefficients that depend on speed")
    scene = jr.from_ross(HERE / "stepped.json", 500.0)[0]
    assert str(jr.load("mine.toml")) == str(scene)
    assert "add --speed" in run("other.toml", *options[:2]).stderr
    assert "one of --like and --from-ross" in run("o.toml", *options, "--like", "x").stderr
    assert "--speed is for --from-ross" in run("o.toml", *options[2:]).stderr
    assert not (tmp_path / "other.toml").exists()


def test_a_tag_cannot_write_into_the_scene(changed):
    notes = changed(put(SHAFT, torque=1.0, tag="a\n[spin]\nspeed = 1\x1b"))[1]
    assert "torque is left out: a [spin] speed = 1" in notes


def test_a_kind_cannot_write_into_the_scene(changed):
    odd = {"Foo\n[gravity]_1": {"n": 0}}
    notes = changed(lambda document: document.update(odd))[1]
    assert any("Foo [gravity] is left out" in note for note in notes)
    assert not any("\n" in note for note in notes)
