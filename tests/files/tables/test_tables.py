"""Tables of bearings and shafts are read as they are written, or refused by row and column.

Units are converted here by the definitions of inch, pound and standard gravity; workbooks are written by
openpyxl, and `model.xls` by xlwt, in the layout of the sheet Model of XLTRC and ROSS.
"""

import importlib.util
import math
from pathlib import Path

import numpy as np
import openpyxl
import pytest

import jaxrotor as jr


INCH, POUND = 0.0254, 0.45359237
FORCE = POUND * 9.80665
RPM = math.pi / 30
MODEL = Path(__file__).with_name("model.xls")


def written(folder, text, name="bearing.csv", encoding="utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def workbook(path, **sheets):
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        page = book.create_sheet(name)
        for row in rows:
            page.append(row)
    book.save(path)
    return path


# Heads of a speed, a stiffness and a damping, each with its factor to SI.
HEADS = [
    ("rpm", RPM, "Kxx (N/m)", 1.0, "CXX N*s/m", 1.0),
    ("speed", 1.0, "kxx", 1.0, "cxx", 1.0),
    ("Speed [1/min]", RPM, "kxx [lbf/in]", FORCE / INCH, "Cxx [lbf-s/in]", FORCE / INCH),
    ("Rotor speed (RPM)", RPM, "Kxx (lb/in)", FORCE / INCH, "c_xx (lb·s/in)", FORCE / INCH),
    ("Frequency, Hz", 2 * math.pi, "KXX (N/MM)", 1e3, "CXX (N*S/MM)", 1e3),
    ("omega / rad/s", 1.0, "K_xx, kN/mm", 1e6, "C_xx, kNs/m", 1e3),
    ("w_rad/s", 1.0, "kxx_MN/m", 1e6, "bxx N.s/m", 1.0),
    ("n (r/min)", RPM, "Kxx/(N/µm)", 1e6, "Dxx [Ns/mm]", 1e3),
    ("Ω [rad/s]", 1.0, "K xx kgf/mm", 9806.65, "cxx kgf*s/mm", 9806.65),
]


@pytest.mark.parametrize("heads", HEADS, ids=lambda heads: heads[2])
def test_names_and_units(tmp_path, heads):
    path = written(tmp_path, f"{';'.join(heads[::2])}\n100;3;5\n200;4;7\n")
    found = jr.read_support(path, 0.1)
    values = [found.speeds, found.kxx, found.cxx]
    for value, factor, own in zip(values, heads[1::2], [(100, 200), (3, 4), (5, 7)], strict=True):
        np.testing.assert_allclose(value, factor * np.array(own), rtol=1e-14)


DIALECTS = {
    "points and commas": ("speed,kxx,note\n1.5,2.5e7,a\n2500,3e7,\n", "utf-8"),
    "decimal commas": ("speed;kxx\n1,5;2,5e7\n2500;3e7\n", "utf-8"),
    "thousands": ("speed;kxx\n1,5;25.000.000,0\n2.500;30.000.000\n", "utf-8"),
    "thin spaces": ("speed;kxx\n1,5;25\u202f000\u202f000\n2 500;+30'000'000\n", "utf-8"),
    "quoted": ('speed,kxx\n"1,5","2,5e7"\n"2500","3e7"\n', "utf-8"),
    "tabs": ("speed\tkxx\n1,5\t2,5e7\n2500\t3e7\n", "utf-8"),
    "a mark of UTF-8": ("speed,kxx\r\n1.5,2.5e7\r\n2500,3e7\r\n\r\n", "utf-8-sig"),
    "text of Excel": ("speed\tkxx\n1,5\t2,5e7\n2500\t3e7\n", "utf-16"),
    "Windows": ("omega (rad/s);kxx (N/µm)\n1,5;25\n2500;30\n", "cp1252"),
    "Fortran": ("speed,kxx\n1.5D0,.25D+08\n2.5d3,3.D7\n", "utf-8"),
    "titles and notes": (
        "Bearing 7; DE\n\nspeed,kxx\nrad/s,N/m\n1.5,2.5e7\n2500,3e7\n\nby A.\n",
        "utf-8",
    ),
    "wrapped heads": ('"speed\n[rad/s]","Kxx\n(N/m)"\n1.5,2.5e7\n2500,3e7\n', "utf-8"),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_ways_to_write_numbers(tmp_path, dialect):
    found = jr.read_support(
        written(tmp_path, *DIALECTS[dialect][:1], encoding=DIALECTS[dialect][1]), 0.1
    )
    assert found.speeds.tolist() == [1.5, 2500.0] and found.kxx.tolist() == [2.5e7, 3e7]


HEAD = "speed,kxx,kyy\n"
REFUSED = {
    "": "row 1 has no column kxx; a table of a bearing needs kxx, but this has none",
    "speed,kyy,Load\n1,2,3\n": "no column kxx; .* but this has 'speed', 'kyy', 'Load'",
    "a,b\n1,2\n": "no column kxx; .* but this has 'a', 'b'",
    HEAD: "row 1 is the last one of its table; give rows of numbers",
    f"{HEAD}1,2,3\n2,,3\n": "row 3, column kxx is empty; every row .* needs a value",
    f"{HEAD}1,2,n.a.\n2,3,3\n": "row 2, column kyy must be a number, but is 'n.a.'",
    f"{HEAD}1,2,3\n2,3,3\nby A.\n": "row 4, column speed must be a number, .* an empty row before notes",
    f"{HEAD}2,2,3\n1,2,3\n": "row 3, column speed is below the row before; give each speed once, in",
    f"{HEAD}1,2,3\n1,2,3\n": "row 3, column speed is the speed of the row before",
    f"{HEAD}1,2,3\n": "row 2, column speed is the only speed; give two or more",
    f"{HEAD}1,2,3\n\n2,2,3\n": "row 3 is empty, but the table goes on in row 4",
    f"{HEAD}1,1e400,3\n2,2,3\n": "row 2, column kxx must be in N/m and finite",
    f"{HEAD}1,5,2,5,3\n2,2,3\n": "row 2 has 5 cells below 3 names; if its commas are decimal",
    'speed,kxx\n"1,500",2\n"2,500",3\n': "row 2, column speed is '1,500', .* write 1,5 or 1500",
    "speed;kxx\n1.500;2\n2.000;3\n": "row 2, column speed is '1.500', .* write 1.5 or 1500",
    "speed;kxx\n1,000;2\n2;3\n": "is '1,000', .* write 1,0 or 1000",
    "speed;kxx\n1,5;2,5\n2.5;3\n": "is '1,5', with a decimal comma, but row 3, column speed is '2.5'",
    "rpm,kxx [foo]\n1,2\n2,3\n": r"row 1, column kxx \[foo\] has the unit 'foo', which is unknown",
    "rpm,kxx [kg]\n1,2\n2,3\n": "has the unit 'kg', which is unknown or none of this quantity",
    "speed,kxx\nrpm,furlong\n1,2\n2,3\n": "row 2, column kxx has the unit 'furlong'",
    "rpm,kxx [N/m],kyy\n1,2,3\n2,2,3\n": r"column kyy has no unit, but kxx \[N/m\] has N/m",
    "speed,kxx [N/m]\n1,2\n2,3\n": "column speed has no unit",
    "n,kxx\n1,2\n2,3\n": r"column n needs a unit; name the column n \[rpm\]",
    "rpm,speed,kxx\n1,2,3\n": "row 1 names 'rpm' and 'speed', which are one quantity",
    "rpm,kxx,Zxx\n1,2,3\n2,3,4\n": "row 1 has the column 'Zxx', which is unknown; k is stiffness",
    "kxx,kyy\n1,2\n3,4\n": "has 2 rows, but no column speed among 'kxx', 'kyy'",
    "rpm,kxx,kxy\n1,2,3\n2,3,4\n": r"`kxy \[N/m\]` is given without `kyx \[N/m\]`",
    "rpm,kxx,mxx,myy\n1,2,3,4\n2,3,3,4\n": "column mxx has added masses, but a support has one",
    "rpm,kxx\n1,\0\n": "is no text; save the table as CSV",
}


@pytest.mark.parametrize("text", REFUSED)
def test_refusals(tmp_path, text):
    """One sentence names the file, the row and the column."""
    with pytest.raises(jr.SceneError, match=REFUSED[text]) as error:
        jr.read_support(written(tmp_path, text), 0.1)
    assert str(error.value).startswith(str(tmp_path / "bearing.csv"))
    assert str(error.value).count(". ") == 0 and str(error.value).endswith(".")


def test_files_that_are_not_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, f"{HEAD}1,2,3\n2,2,3\n")
    with pytest.raises(
        jr.SceneError, match="bearings.csv is not a file .did you mean `bearing.csv`"
    ):
        jr.read_support("bearings.csv", 0.1)
    with pytest.raises(jr.SceneError, match="is no workbook of Excel, so it has no sheet 'DE'"):
        jr.read_support("bearing.csv", 0.1, sheet="DE")
    with pytest.raises(jr.SceneError, match="bearing.csv: A support holds the shaft at a station"):
        jr.read_support("bearing.csv")
    written(tmp_path, "no workbook", "broken.xlsx")
    with pytest.raises(jr.SceneError, match="broken.xlsx cannot be read as a workbook"):
        jr.read_support("broken.xlsx", 0.1)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        jr.SceneError, match="needs the package openpyxl, .* `pip install openpyxl`"
    ):
        jr.read_support("broken.xlsx", 0.1)


def test_minus_of_a_text_program(tmp_path):
    path = written(tmp_path, "rpm;kxx;kxy;kyx\n1;2;3;\u22124,5\n2;2;3;-5\n")
    assert jr.read_support(path, 0.1).kyx.tolist() == [-4.5, -5.0]


def test_tables_without_speed_and_with_mass(tmp_path):
    found = jr.read_support(
        written(tmp_path, "Kxx,Kyy,Cxx\nkN/m,kN/m,kN s/m\n3,4,5\n"), 0.1, on="frame"
    )
    assert (found.kxx, found.kyy, found.cxx, found.speeds, found.on) == (
        3e3,
        4e3,
        5e3,
        None,
        "frame",
    )
    seal = jr.read_support(
        written(tmp_path, "rpm,kxx,mxx,myy,mxy\n1,2,3,3,0\n2,3,3,3,0\n"), 0.1, hold=True
    )
    assert seal.mxx == 3.0 and seal.hold
    plain = jr.read_support(written(tmp_path, "rpm,kxx,mxx\n1,2,0\n2,3,0\n"), 0.1)
    assert plain.mxx is None


def test_workbooks(tmp_path):
    """Rows count from the top of the sheet; units may stand above the names."""
    good = [["Bearing"], [], ["rpm", "lb/in"], ["Speed", "Kxx"], [1000, 1e5], [2000, 2e5]]
    other = [["speed", "kxx"], [1.0, 2.0], [2.0, "=A3*2"]]
    one = workbook(tmp_path / "one.xlsx", Notes=[["by", "A"]], DE=good)
    found = jr.read_support(one, 0.1)
    np.testing.assert_allclose(found.speeds, [1000 * RPM, 2000 * RPM], rtol=1e-14)
    np.testing.assert_allclose(found.kxx, np.array([1e5, 2e5]) * FORCE / INCH, rtol=1e-14)
    less = [["rpm", "kyy", "cxx", "cyy"], [1, 2, 3, 4]]  # with more columns, but not all it needs
    found = jr.read_support(workbook(tmp_path / "less.xlsx", A=less, DE=good), 0.1)
    both = workbook(tmp_path / "both.xlsx", DE=good, NDE=other)
    assert jr.read_support(both, 0.1, sheet="DE").kxx.tolist() == found.kxx.tolist()
    with pytest.raises(
        jr.SceneError, match=r"several tables of a bearing, .*\[DE\], .*\[NDE\]; name"
    ):
        jr.read_support(both, 0.1)
    with pytest.raises(jr.SceneError, match="has no sheet 'Nde'; its sheets are 'DE', 'NDE'"):
        jr.read_support(both, 0.1, sheet="Nde")
    with pytest.raises(jr.SceneError, match=r"\[NDE\]: row 3, column kxx is empty"):  # not computed
        jr.read_support(both, 0.1, sheet="NDE")
    bad = workbook(tmp_path / "bad.xlsx", DE=[*good, [3000, "3e5 or so"]])
    with pytest.raises(jr.SceneError, match=r"\[DE\]: row 7, column Kxx must be a number"):
        jr.read_support(bad, 0.1)


def test_older_workbooks():
    """Dates and truth values are no numbers, though such a file stores them as numbers."""
    found = jr.read_support(MODEL, 0.1, sheet="DE")
    np.testing.assert_allclose(found.speeds, [1000 * RPM, 2000 * RPM], rtol=1e-14)
    assert found.kxx.tolist() == [3e6, 4e6]
    with pytest.raises(
        jr.SceneError, match="row 4, column Kxx .* must be a number, but is datetime"
    ):
        jr.read_support(MODEL, 0.1, sheet="date")
    with pytest.raises(jr.SceneError, match="row 3, column Kxx .* must be a number, but is True"):
        jr.read_support(MODEL, 0.1, sheet="truth")


def test_a_stray_cell_far_off(tmp_path):
    book = openpyxl.Workbook()
    for row in (["rpm", "kxx"], [1000, 1.0], [2000, 2.0]):
        book.active.append(row)
    book.active["XFD1000"] = "x"
    book.save(tmp_path / "stray.xlsx")
    assert jr.read_support(tmp_path / "stray.xlsx", 0.1).kxx.tolist() == [1.0, 2.0]


# === shafts


def numbers_of(shaft):
    """Start, outer and inner diameter of every section, and its material."""
    first = (0.0, shaft.diameter, shaft.inner_diameter, shaft.material)
    return [
        first,
        *((one.at, one.diameter, one.inner_diameter, one.material) for one in shaft.steps),
    ]


def test_shaft_by_names_in_words(tmp_path):
    text = (
        "Length [mm];outer diameter left [mm];outer diameter right [mm];bore [mm];Material\n"
        "200;50;50;0;steel\n300,5;60;60;10;bronze\n100;60;60;10;bronze\n"
    )
    bronze = jr.Material(1.1e11, 8800.0, 4.1e10)
    pin = jr.Constraint(0.0)
    shaft, notes = jr.read_shaft(
        written(tmp_path, text), materials={"bronze": bronze}, constraints=(pin,), nodes=5
    )
    assert notes == () and shaft.shear and shaft.rotary_inertia and shaft.polar_ratio == 2.0
    assert (
        shaft.constraints == (pin,)
        and shaft.nodes == 5
        and float(shaft.length) == pytest.approx(0.6005)
    )
    (_, first, bore, steel), (at, second, inner, other) = numbers_of(shaft)
    assert (first, bore, at, second, inner) == (0.05, None, 0.2, 0.06, 0.01)
    assert (steel.youngs_modulus, steel.density) == (2.1e11, 7850.0)
    assert (other.youngs_modulus, other.density, other.shear_modulus) == (1.1e11, 8800.0, 4.1e10)


def test_shaft_with_moduli_and_flags(tmp_path):
    text = (
        "n,L [in],od [in],E [Mpsi],rho [lb/in3],nu,axial force [lbf],shear_effects,gyroscopic\n"
        "2,5,4,30,0.283,0.25,0,no,0\n1,10,5,30,0.283,0.25,100,no,0\n"
    )
    shaft, notes = jr.read_shaft(written(tmp_path, text))
    (_, left, _, steel), (at, right, *_) = numbers_of(shaft)
    psi = FORCE / INCH**2
    wanted = [5 * INCH, 10 * INCH, 4 * INCH, 3e7 * psi, 0.283 * POUND / INCH**3, 1.2e7 * psi]
    found = [left, at, right, steel.youngs_modulus, steel.density, steel.shear_modulus]
    np.testing.assert_allclose(found, wanted, rtol=1e-14)
    assert not shaft.shear and shaft.polar_ratio == 0.0
    assert notes == ("axial force is left out: row 3",)


def test_taper(tmp_path):
    """Four pieces have the mean diameters, and the note the error of their flexibility."""
    shaft, notes = jr.read_shaft(
        written(tmp_path, "length,odl,odr\n0.4,0.04,0.08\n0.4,0.08,0.08\n")
    )
    sections = numbers_of(shaft)
    np.testing.assert_allclose([one[0] for one in sections], [0, 0.1, 0.2, 0.3, 0.4], atol=1e-15)
    np.testing.assert_allclose([one[1] for one in sections], [0.045, 0.055, 0.065, 0.075, 0.08])
    # Of d = 0.04 to 0.05 m: Int d^-4 ds over that of the mean diameter
    error = (0.04**-3 - 0.05**-3) / (3 * 0.01) * 0.045**4 - 1
    assert notes[:2] == (
        "no unit is given for length, odl, odr, read in m",
        "material is steel, since the table names none",
    )
    assert notes[2].endswith(f"is off by up to {100 * error:.2g} %: row 2")


def test_shaft_of_ross_and_xltrc():
    """Inches above the names, a table of materials by number, and a sleeve around the second element."""
    shaft, notes = jr.read_shaft(MODEL)
    psi, density = FORCE / INCH**2, POUND / INCH**3
    assert len(notes) == 1 and notes[0].startswith("layers are taken as one ring")
    (_, left, _, steel), (at, sleeved, none, both), (end, right, bore, same) = numbers_of(shaft)
    np.testing.assert_allclose(shaft.length, 23 * INCH, rtol=1e-14)
    found = [left, at, sleeved, end, right, bore]
    np.testing.assert_allclose(found, np.array([2, 10, 4, 15, 2, 0.5]) * INCH, rtol=1e-14)
    assert none is None and same is None
    found = [steel.youngs_modulus, steel.shear_modulus, steel.density]
    np.testing.assert_allclose(found, [30e6 * psi, 12e6 * psi, 0.283 * density], rtol=1e-14)
    bending = (30e6 * 3**4 + 10e6 * (4**4 - 3**4)) / 4**4
    mass = (0.283 * 3**2 + 0.1 * (4**2 - 3**2)) / 4**2
    np.testing.assert_allclose(
        [both.youngs_modulus, both.density], [bending * psi, mass * density], rtol=1e-13
    )


def test_shaft_of_a_workbook(tmp_path):
    rows = [["L", "odl", "idl", "odr", "idr", "material"], [0.2, 0.05, 0.01, 0.05, 0.01, "Steel"]]
    path = workbook(tmp_path / "shaft.xlsx", Simple=rows, Other=[[1, 2], [3, 4]])
    shaft, notes = jr.read_shaft(path)
    assert (shaft.length, shaft.diameter, shaft.inner_diameter) == (0.2, 0.05, 0.01)
    assert notes == ("no unit is given for L, odl, idl, odr, idr, read in m",)


REFUSED_SHAFTS = {
    "od,id\n0.1,0\n": "has no column length; a table of a shaft needs length, but this has 'od', 'id'",
    "length,odl\n1,0.1\n": "has no column odr; a shaft needs od, or odl and odr, but there are",
    "length,od,idl\n1,0.1,0\n": "has no column idr; a shaft needs id, or idl and idr",
    "length,od\n1,0.1\n0,0.1\n": "row 3, column length must be above 0 m, but is 0 m",
    "length,od,id\n1,0.1,0.1\n": "row 2, column od must be above the inner diameter, 0.1 m",
    "length,od,material\n1,0.1,lead\n": "column material is 'lead', which is none of the materials steel",
    "length,od,material\n1,0.1,\n": "column material is None",
    "length,od,E,rho\n1,0.1,2e11,7800\n": "has no column G; a material needs E, rho, and G or nu",
    "length,od,gyroscopic\n1,0.1,maybe\n": "column gyroscopic must be true or false, or 1 or 0",
    "length,od,shear\n1,0.1,1\n2,0.1\n": "row 3, column shear must be true or false, .* but is None",
}


@pytest.mark.parametrize("text", REFUSED_SHAFTS)
def test_refused_shafts(tmp_path, text):
    with pytest.raises(jr.SceneError, match=REFUSED_SHAFTS[text]):
        jr.read_shaft(written(tmp_path, text, "shaft.csv"))


def test_a_material_without_shear_modulus(tmp_path):
    path = written(tmp_path, "length,od,material\n1,0.1,lead\n", "shaft.csv")
    lead = jr.Material(1.6e10, 11340.0)
    with pytest.raises(
        jr.SceneError, match="row 2, column material is 'lead', which has no `shear_mod"
    ):
        jr.read_shaft(path, materials={"lead": lead})


# === in scene files

SCENE = """\
[shaft]
table = "tables/shaft.csv"
constraints = [{at = "0 m"}]

[[supports]]
at = "50 mm"
table = "tables/bearings.xlsx"
sheet = "DE"
hold = true

[support]
at = "0.3 m"
stiffness = "1 MN/m"

[spin]
speed = "3000 rpm"
"""


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "tables").mkdir()
    written(tmp_path / "tables", "length,odl,odr\n0.2,0.05,0.06\n0.3,0.06,0.06\n", "shaft.csv")
    rows = [["rpm", "Kxx", "Cxx"], ["", "kN/mm", "kN*s/m"], [1000, 50, 3], [4000, 30, 2]]
    workbook(tmp_path / "tables" / "bearings.xlsx", DE=rows, NDE=rows)
    return written(tmp_path, SCENE, "rotor.toml")


def test_tables_in_scene_files(scene, tmp_path, monkeypatch):
    """They are sought beside the scene file, and written as numbers."""
    found = jr.load(scene)
    shaft, notes = jr.read_shaft(
        tmp_path / "tables" / "shaft.csv", constraints=(jr.Constraint(0.0),)
    )
    support = jr.read_support(tmp_path / "tables" / "bearings.xlsx", 0.05, sheet="DE", hold=True)
    assert str(found.shaft) == str(shaft) and str(found.of(jr.Support)[0]) == str(support)
    assert support.kxx.tolist() == [5e7, 3e7] and support.cxx.tolist() == [3e3, 2e3]
    assert found.assumption == "; ".join(f"shaft.csv: {note}" for note in notes)
    jr.save(found, tmp_path / "saved.toml")
    text = (tmp_path / "saved.toml").read_text()
    assert "table =" not in text and "kxx = [50000000.0, 30000000.0]" in text
    assert str(jr.load(tmp_path / "saved.toml")) == str(found)


def test_materials_and_missing_units_in_scene_files(scene, tmp_path):
    folder = tmp_path / "tables"
    written(folder, "length [mm],od [mm],material\n200,50,alloy 7\n300,50,Steel\n", "shaft.csv")
    written(folder, "speed,Kxx\n100,5e7\n200,3e7\n")
    alloy = '{youngs_modulus = "70 GPa", density = 2700.0, shear_modulus = "26 GPa"}'
    text = SCENE.replace("constraints", f'materials = {{"alloy 7" = {alloy}}}\nconstraints')
    text = text.replace('bearings.xlsx"\nsheet = "DE"', 'bearing.csv"')
    scene.write_text(f'assumption = "invented"\n{text}')
    found = jr.load(scene)
    assert float(found.shaft.material.density) == 2700.0
    (step,) = found.shaft.steps
    assert float(step.material.density) == float(jr.steel().density) and float(step.at) == 0.2
    assert found.assumption == (
        "invented; bearing.csv: no unit is given for speed, Kxx, read in rad/s, N/m"
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "constraints",
            "materials = 1\nconstraints",
            "shaft.materials must be a table of materials",
        ),
        (
            "constraints",
            "materials = {alloy = {density = 1.0}}\nconstraints",
            r"shaft.materials.alloy.youngs_modulus is missing",
        ),
        ("hold = true", "kxx = 1.0", "supports.0.kxx is given beside `table`, which has it, too"),
        ("constraints", "length = 1.0\nconstraints", "shaft.length is given beside `table`"),
        (
            "bearings.xlsx",
            "bearing.xlsx",
            "supports.0.table: .*bearing.xlsx is not a file .did you mean",
        ),
        ('sheet = "DE"', "", "supports.0.table: .* has several tables of a bearing"),
        ('"tables/shaft.csv"', "3", "shaft.table must be a text, but is 3"),
        ('sheet = "DE"', "sheet = 1", "supports.0.sheet must be a text, but is 1"),
    ],
)
def test_refused_tables_in_scene_files(scene, old, new, message):
    scene.write_text(SCENE.replace(old, new))
    with pytest.raises(jr.SceneError, match=f"rotor.toml: {message}"):
        jr.load(scene)


def test_tables_of_several_shafts(scene):
    shafts = SCENE.partition("[[supports]]")[0].replace("[shaft]", "[shafts.lp]")
    shafts += '[shafts.hp]\ntable = "tables/shaft.csv"\nratio = 1.5\n'
    spin = SCENE[SCENE.index("[spin]") :]
    scene.write_text(f'{shafts}[[supports]]\nat = "hp 0.1 m"\nstiffness = 1e7\n{spin}')
    (hp,) = jr.load(scene).of(jr.CoaxialShaft)
    assert (float(hp.body.length), float(hp.ratio)) == (0.5, 1.5)
