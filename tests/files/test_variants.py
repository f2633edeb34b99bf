"""The thirty turbine variants: strict reading, both layouts, and the numbers of the sheet (3.7)."""

import csv
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.files.variants import read


TEXT = (Path(jr.__file__).parent / "scenes" / "turbine-variants.csv").read_text("utf-8")
ROWS = {int(row["variant"]): row for row in csv.DictReader(TEXT.splitlines())}
SINGLE = (11, 22, 30)
DOUBTFUL = (2, 4, 7, 11, 20, 22, 28)
FAR = 1e4  # [s], over a thousand relaxation times of the slowest rotor


def drive(row):
    """Inertia, drive and times of a row from the printed cells."""
    get = lambda key: float(ROWS[row][key] or 0)
    inertia = sum(get(f"m{i}_kg") * get(f"R{i}_m") ** 2 / 2 for i in (1, 2))
    law = 100 * get("M0T_100Nm"), get("k1_Nms"), get("k2T_1e-2Nms2") / 100
    return inertia, *law, get("omega0_rad_s"), get("tau_s")


def run_of(row, layout="chain"):
    scene = jr.load("turbine-variants", row=row, layout=layout)
    run = jr.run_up(scene, jnp.array([0.0, jr.variants()[row].duration, FAR]))
    return run, np.abs(jr.reactions(run).force)


@pytest.mark.parametrize("row", ROWS)
def test_speed_of_every_variant(row):
    """Speed against the Riccati equation by partial fractions, from the printed cells."""
    inertia, torque, slope, drag, start, end = drive(row)
    scene = jr.load("turbine-variants", row=row)
    root = np.sqrt(slope**2 + 4 * drag * torque)
    high, low = (-slope + root) / (2 * drag), (-slope - root) / (2 * drag)
    ratio = (start - high) / (start - low) * np.exp(-root * end / inertia)
    polar = jr.assemble(scene).blocks.polar
    rotation = scene.spin.turning(jnp.array([end, FAR]), polar)
    np.testing.assert_allclose(polar, inertia, rtol=1e-14)
    np.testing.assert_allclose(
        rotation.speed, [(high - low * ratio) / (1 - ratio), high], rtol=1e-12
    )
    if (
        start == 0
    ):  # the table was made so that the speed is within a few per cent of the steady one
        assert 0.9804 - 5e-5 <= rotation.speed[0] / high <= 0.9969 + 5e-5


def test_variants_run_up_and_run_down():
    ends = {row: run_of(row)[0].speed for row in (1, 16, 20)}
    assert ends[1][0] < ends[1][1] < ends[1][2] and ends[16][0] > ends[16][1] > ends[16][2]


@pytest.mark.hard("4.7 variants with a single wheel")
@pytest.mark.parametrize("layout", ["chain", "example31"])
def test_reactions_of_every_variant(layout):
    """Reactions `|u - J / z_B|`, `|J / z_B|` times `hypot(eps, omega^2)`, from the printed cells."""
    for row in (1, 2, 7, 11, 16, 22, 30):
        run, found = run_of(row, layout)
        get = lambda key, row=row: float(ROWS[row][key] or 0)
        a, b, c = (get(f"{k}_m") for k in "abc")
        last = 1 if row in SINGLE else 2
        bearing = b if layout == "example31" else a + b + c
        u = get("m1_kg") * get("O1C1_mm") * 1e-3
        product = u * a + get("alpha_rad") * get(f"m{last}_kg") * get(f"R{last}_m") ** 2 / 4
        size = np.hypot(run.acceleration, run.speed**2)
        arms = np.abs([u - product / bearing, product / bearing])
        np.testing.assert_allclose(found, np.outer(size, arms), rtol=1e-10)


def test_reference_numbers():
    """Values agree to one unit of the last digit, as the sheet truncates 475.1582088."""
    run, force = run_of(1)
    assert np.allclose(run.speed[1:], [469.731705, 475.158208], rtol=0, atol=1e-6)
    assert np.all(np.abs(force[2] - [6087.52, 10603.0]) < [6e-3, 6e-2])
    run, force = run_of(30)
    assert abs(run.speed[2] - 106.804462) < 1e-6
    np.testing.assert_allclose(force[2], [2060.82, 2403.04], rtol=0, atol=6e-3)
    run, force = run_of(16)
    assert abs(run.speed[2] - 411.632054) < 1e-6
    np.testing.assert_allclose(force[0], [17460.6, 21300.6], rtol=0, atol=6e-2)
    np.testing.assert_allclose(run_of(2, "example31")[1][2], [19959.9, 22146.6], rtol=0, atol=6e-2)
    np.testing.assert_allclose(run_of(16, "example31")[1][2], [8980.37, 9997.02], rtol=0, atol=6e-3)


def test_worst_phase_between_offset_and_tilt():
    """The reaction at bearing B is largest at phase 0, that at bearing A at 180 deg."""
    scene, phases = jr.load("turbine-variants", row=1), np.pi * np.array([0, 0.25, 0.5, 0.75, 1])
    runs = [jr.run_up(scene.replace({"discs.0.offset_angle": p}), [0.0, FAR]) for p in phases]
    force = np.array([np.abs(jr.reactions(run).force[1]) for run in runs])
    assert np.all(np.diff(force[:, 0]) > 0) and np.all(np.diff(force[:, 1]) < 0)


# === reading


@pytest.mark.hard("4.7 variants with a single wheel")
def test_missing_wheels_are_absent(record_property):
    table = jr.variants()
    assert list(table) == list(range(1, 31))
    record_property("measured", f"rows {sorted(SINGLE)}")
    for row, variant in table.items():
        count = 1 if row in SINGLE else 2
        assert len(variant.masses) == len(variant.radii) == count
        assert len(variant.distances) == count + 1
        (*_, last) = jr.load("turbine-variants", row=row).of(jr.Disc)
        assert last.tilt == variant.tilt
        assert (last.offset is not None) == (row in SINGLE)


@pytest.mark.hard("4.14 doubtful cells of the table", outcome="flagged")
def test_doubtful_cells_stay_as_printed_and_are_named():
    table = jr.variants()
    printed = {2: ("speed", 990), 22: ("speed", 580), 28: ("speed", 490), 11: ("masses", (160,))}
    for row, (name, value) in printed.items():
        assert getattr(table[row], name) == value
    assert table[4].masses[0] == 79 and table[4].torque == 800 and table[4].drag == 0.001
    assert table[7].distances[1] == 0.45 and table[20].distances[:2] == (0.28, 0.08)
    for row, variant in table.items():
        title = jr.title("turbine-variants", row=row, layout="example31")
        assert f"variant {row} " in title and "layout assumed: example31" in title
        assert ("printed" in title or "doubtful" in title) == (row in DOUBTFUL), title
        assert variant.note in title
    assert "layout assumed" in jr.title("turbine-variants")


@pytest.mark.hard("4.14 letters, dashes and decimal commas in the table", outcome="refused")
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.23,0.21", '"0,23",0.21', "line 2, R1_m must be a number such as 0.15, but is '0,23'."),
        ("0.23,0.21", "0.23,-", "line 2, R2_m must be a number such as 0.15, but is '-'."),
        ("0.23,0.21", "0.23,", "line 2, R2_m must be a number such as 0.15, but is ''."),
        ("0.23,0.21", ",0.21", "line 2, R1_m must be a number such as 0.15, but is ''."),
        ("1,100,90", "1,1OO,90", "line 2, m1_kg must be a number such as 0.15, but is '1OO'."),
        ("1,100,90", "1,.0.15,90", "line 2, m1_kg must be a number such as 0.15, but is '.0.15'."),
        ("1,100,90", "1,nan,90", "line 2, m1_kg must be a number such as 0.15, but is 'nan'."),
        ("1,100,90", "2,100,90", "line 3 is another variant 2."),
        ("1,100,90", "1,100,90,90", "line 2 must have 16 cells, but has 17."),
        ("m1_kg", "m1_g", "must have the columns variant, m1_kg, "),
    ],
)
def test_mistakes_in_the_table_are_refused(old, new, message):
    assert TEXT.count(old) == 1
    with pytest.raises(jr.SceneError) as caught:
        read(TEXT.replace(old, new))
    assert message in str(caught.value) and str(caught.value).endswith(".")


@pytest.mark.parametrize("row", [0, 31, -1, True])
def test_rows_that_do_not_exist(row):
    with pytest.raises(ValueError, match=r"`row` must be a whole number from 1 to 30, but is"):
        jr.load("turbine-variants", row=row)


def test_other_refusals():
    with pytest.raises(ValueError, match="`layout` must be 'chain' or 'example31', but is 'x'"):
        jr.load("turbine-variants", row=3, layout="x")
    with pytest.raises(jr.SceneError, match="limiter-rotor has no rows and no layouts; give none"):
        jr.load("limiter-rotor", row=1)


# === every result states the assumption


def test_results_state_the_assumption(tmp_path):
    scene = jr.load("turbine-variants", row=3, layout="example31")
    run = jr.run_up(scene.replace({"spin.speed": 300.0}), [0.0, 0.1, 0.2])
    result = jr.reactions(run)
    for data in (jr.dataset(run), jr.dataset(result)):
        assert data.attrs["assumption"] == "layout assumed: example31"
    for ax in (plot.reactions(result), plot.hodograph(result), plot.speed(run)[1]):
        assert "layout assumed: example31" in [text.get_text() for text in ax.texts]
    file = tmp_path / "variant.toml"
    jr.save(scene, file)
    assert jr.load(file).assumption == "layout assumed: example31"
    assert scene.without("discs").assumption == "layout assumed: example31"
    assert jr.load("turbine-variants").assumption == "layout assumed: chain"
    assert jr.load("turbine-run-up").assumption == ""
    assert "assumption" not in jr.dataset(jr.run_up(jr.load("turbine-run-up"), [0, 0.1])).attrs


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("turbine-variants", None, "example31"), "needs the row that the layout is for"),
        (("turbine-variants", 1, "nonsense"), "must be 'chain' or 'example31', but is 'nonsense'"),
        (("limiter-rotor", None, "nonsense"), "has no rows and no layouts"),
        (("limiter-rotor", 1, None), "has no rows and no layouts"),
    ],
)
def test_layouts_are_not_ignored(options, message):
    for ask in (jr.load, jr.title):
        with pytest.raises(ValueError, match=message):
            ask(*options)
