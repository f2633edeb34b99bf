"""Files for MATLAB, read by SciPy, and universal files, read by pyuff and by their bytes."""

from pathlib import Path

import numpy as np
import pytest
import pyuff
import xarray as xr
from scipy.io import loadmat
from systems import one_disc
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor.cli import app


SCENE = one_disc(mass=2.0, damping=3.0, stiffness=800.0, speed=15.0, eccentricity=1e-3)


@pytest.fixture(scope="module")
def motion():
    return jr.simulate(SCENE, 2, 16, start=jr.AtRest(), at=0.5)


@pytest.fixture(scope="module")
def swept():
    axes = {"unbalance.eccentricity": [1e-3, 2e-3], "start.radius": [0.0, 1e-3]}
    return jr.sweep(SCENE, axes, start=jr.Whirl(1e-3), settle=1, keep=2, steps_per_revolution=32)


def functions(path):
    """Functions of a universal file by their first line."""
    found = pyuff.UFF(str(path)).read_sets()
    return {one["id1"]: one for one in found if one["type"] == 58}


def test_matlab_of_a_motion(motion, tmp_path):
    jr.export(motion, tmp_path / "orbit.mat")
    data, found = jr.dataset(motion), loadmat(tmp_path / "orbit.mat", simplify_cells=True)
    x, y = found["displacement"].T  # (time, axis), at one station
    np.testing.assert_array_equal(x + 1j * y, np.asarray(motion.displacement)[:, 0])
    np.testing.assert_array_equal(found["time"], motion.time)
    about = found["variables"]["displacement"]
    assert (about["units"], about["long_name"], about["name"]) == (
        "m",
        "displacement",
        "displacement",
    )
    assert about["dimensions"].tolist() == ["time", "station", "axis"]
    assert found["axis"].tolist() == ["x", "y"]
    assert found["attributes"]["scene"] == data.attrs["scene"]


def test_matlab_of_a_sweep(swept, tmp_path):
    jr.export(swept, tmp_path / "sweep.mat")
    found = loadmat(tmp_path / "sweep.mat", simplify_cells=True)
    assert found["unbalance_eccentricity"].tolist() == [1e-3, 2e-3]
    about = found["variables"]["unbalance_eccentricity"]
    assert (about["name"], about["units"]) == ("unbalance.eccentricity", "m")
    np.testing.assert_array_equal(found["section"], swept["section"])
    assert found["status"].tolist() == [[0, 0], [0, 0]]


def test_names_that_matlab_accepts(tmp_path):
    """They begin with a letter, have 63 letters at most, are no words of MATLAB, and all different."""
    names = (
        "a.b",
        "a-b",
        "2x",
        "end",
        "variables",
        "w" * 70,
        "w" * 71,
        "_u",
        "d\N{GREEK SMALL LETTER PHI}",
    )
    data = xr.Dataset({name: ("t", [float(k), 0.0]) for k, name in enumerate(names)})
    odd = data.assign_attrs({"Conventions.of": "CF", "nothing": None, "pair": (1, 2)})
    jr.export(odd, tmp_path / "a.mat")
    found = loadmat(tmp_path / "a.mat", simplify_cells=True)
    own = {key: int(value[0]) for key, value in found.items() if isinstance(value, np.ndarray)}
    assert own == {
        **{"a_b": 0, "a_b_2": 1, "x_2x": 2, "x_end": 3, "variables_2": 4},
        **{"w" * 63: 5, "w" * 61 + "_2": 6, "x__u": 7, "d_": 8},
    }
    assert found["variables"]["a_b_2"]["name"] == "a-b"
    attributes = found["attributes"]
    assert (attributes["Conventions_of"], attributes["nothing"]) == ("CF", "null")
    assert attributes["pair"].tolist() == [1, 2]


def test_universal_file_of_a_motion(motion, tmp_path):
    path = tmp_path / "orbit.unv"
    jr.export(motion, path)
    sets = pyuff.UFF(str(path)).read_sets()
    assert (sets[0]["type"], sets[0]["units_code"], sets[0]["length"]) == (164, 1, 1.0)
    assert (sets[1]["type"], sets[1]["node_nums"], sets[1]["z"]) == (15, [1.0], [0.5])
    found = functions(path)
    z = np.asarray(motion.displacement)[:, 0]
    one = found["displacement y at 0.5 m [m]"]
    np.testing.assert_array_equal(one["data"], z.imag)
    np.testing.assert_allclose(one["x"], motion.time, rtol=5e-6)  # of six digits
    assert (one["func_type"], one["rsp_node"], one["rsp_dir"]) == (1, 1, 2)
    assert (one["abscissa_spec_data_type"], one["abscissa_axis_units_lab"]) == (17, "s")
    assert (one["ordinate_spec_data_type"], one["ordinate_axis_units_lab"]) == (8, "m")
    assert (one["ordinate_len_unit_exp"], one["ordinate_force_unit_exp"]) == (1, 0)
    assert found["velocity x at 0.5 m [m/s]"]["ordinate_spec_data_type"] == 11
    turns = [found[f"slope {axis} at 0.5 m [rad]"]["rsp_dir"] for axis in "xy"]
    assert turns == [5, -4]  # dx/ds turns about y, dy/ds about -x
    assert found["speed [rad/s]"]["rsp_dir"] == 0
    np.testing.assert_array_equal(found["angle [rad]"]["data"], motion.angle)


def test_universal_file_over_speeds(tmp_path):
    """Speeds are in rpm, to the last digit where they are not equally spaced; gaps are left out."""
    heights = np.array([[1.0, 5.0], [np.nan, 6.0], [3.0, 7.0], [4.0, np.nan]])
    line = xr.Dataset(
        {
            "amplitude": (
                ("speed", "station"),
                heights,
                {"units": "m", "long_name": "major half axis"},
            )
        },
        {
            "speed": ("speed", [10.0, 20.0, 21.0, 100 / 3], {"units": "rad/s"}),
            "station": ("station", [0.25, 1.5], {"units": "m"}),
        },
        {"title": "a response"},
    )
    path = tmp_path / "response.unv"
    jr.export(line, path)
    rpm = 60 / (2 * np.pi)
    first, second = functions(path).values()
    np.testing.assert_allclose(first["x"], np.array([10, 21, 100 / 3]) * rpm, rtol=1e-15)
    assert first["data"].tolist() == [1.0, 3.0, 4.0] and second["data"].tolist() == [5.0, 6.0, 7.0]
    assert (first["rsp_node"], second["rsp_node"], second["abscissa_spec_data_type"]) == (1, 2, 19)
    assert (first["id2"], first["id4"]) == ("major half axis", "a response")
    assert first["id1"] == "amplitude at 0.25 m [m]"
    with path.open("rb") as file:  # a program that skips a set trusts the number of its bytes
        content = file.read()
    head, _, body = content[content.index(b"    58b") :].partition(b"\n")
    size = int(head.split()[4])
    end = len(b"\n".join(body.split(b"\n")[:11])) + 1
    assert size == 2 * 3 * 8 and body[end + size :].startswith(b"    -1\n")
    values = np.frombuffer(body[end : end + size])
    np.testing.assert_array_equal(values[1::2], [1.0, 3.0, 4.0])


def test_universal_file_of_loads_and_limiters(tmp_path):
    loads = ("time", "bearing", "axis"), np.arange(12.0).reshape(3, 2, 2), {"units": "N m"}
    stops = ("time", "limiter"), np.ones((3, 1)), {"units": "N"}
    time = "time", [0.0, 0.1, 0.2], {"units": "s"}
    data = xr.Dataset({"moment": loads, "contact_force": stops}, {"time": time})
    data = data.assign_coords(bearing=["supports.0", "supports.1"], axis=["x", "y"])
    jr.export(data, tmp_path / "loads.unv")
    found = functions(tmp_path / "loads.unv")
    one = found["moment y of supports.1 [N m]"]
    assert one["data"].tolist() == [3.0, 7.0, 11.0]
    assert (one["rsp_ent_name"], one["rsp_node"], one["rsp_dir"]) == ("supports.1", 0, -4)
    assert (one["ordinate_len_unit_exp"], one["ordinate_force_unit_exp"]) == (1, 1)
    assert found["contact_force of limiter 0 [N]"]["rsp_ent_name"] == "limiter 0"


def test_universal_file_of_a_sweep(swept, tmp_path):
    """The series of a lane are functions of their own, as is an orbit, of its revolutions."""
    jr.export(swept, tmp_path / "sweep.unv")
    found = functions(tmp_path / "sweep.unv")
    name = "section x of unbalance.eccentricity 0.002 of start.radius 0.001 [m]"
    np.testing.assert_array_equal(found[name]["data"], swept["section"][1, 1, :, 0])
    assert found[name]["rsp_dir"] == 1 and found[name]["rsp_node"] == 1
    orbit = ("revolution", "sample", "axis"), np.arange(12.0).reshape(2, 3, 2), {"units": "m"}
    data = xr.Dataset({"orbit": orbit}, {"axis": ["x", "y"]})
    jr.export(data, tmp_path / "orbit.unv")
    one = functions(tmp_path / "orbit.unv")["orbit y [m]"]
    assert one["data"].tolist() == [1.0, 3.0, 5.0, 7.0, 9.0, 11.0]
    np.testing.assert_allclose(one["x"], np.arange(1, 7) / 3, rtol=5e-6)
    table = jr.table(data)
    assert list(table) == ["turns", "orbit x [m]", "orbit y [m]"]
    np.testing.assert_allclose(table["turns"], np.arange(1, 7) / 3, rtol=1e-15)
    assert table["orbit x [m]"].tolist() == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]


def test_no_series_for_a_universal_file(tmp_path):
    with pytest.raises(
        ValueError, match="no series of two or more numbers, which a .unv file needs"
    ):
        jr.export(xr.Dataset({"mass": 1.0}), tmp_path / "a.unv")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def export(swept, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    swept.to_zarr("run/sweep.zarr", zarr_format=2, consolidated=True)
    return lambda *args: CliRunner().invoke(app, ["export", "run", *args])


LANE = ("--lane", "unbalance.eccentricity=1.7mm", "--lane", "start.radius=0.2mm")


def test_lane_by_the_command(export, swept):
    """The nearest lane is taken and named; its series is a table."""
    result = export("lane.csv", *LANE)
    assert result.exit_code == 0 and (
        "lane 3 of 4: unbalance.eccentricity = 0.002 m, start.radius = 0 m, status ok"
        in result.stderr
    )
    head, row = (line.split(",") for line in Path("lane.csv").read_text().splitlines())
    value = dict(zip(head, row, strict=True))
    assert float(value["radius_max [m]"]) == float(swept["radius_max"][1, 0])
    assert export("section.csv", *LANE, "--of", "section").exit_code == 0
    head, *rows = (line.split(",") for line in Path("section.csv").read_text().splitlines())
    column = lambda name: [float(row[head.index(name)]) for row in rows]
    own = np.stack([column("section x [m]"), column("section y [m]")], axis=1)
    np.testing.assert_allclose(own, swept["section"][1, 0], rtol=1e-14)
    assert column("unbalance.eccentricity [m]") == [2e-3] * 2


def test_orbit_and_spectrum_of_a_lane_are_computed_again(export, swept):
    """The orbit is at the end of each revolution where the section is."""
    assert export("orbit.csv", *LANE, "--of", "orbit").exit_code == 0
    found = np.genfromtxt("orbit.csv", delimiter=",", skip_header=1)
    assert found.shape == (64, 5) and found[-1, 2] == 2.0
    np.testing.assert_allclose(found[31::32, -2:], swept["section"][1, 0], rtol=1e-9)
    assert export("lane.unv", *LANE, "--of", "spectrum", "--of", "orbit").exit_code == 0
    spectrum = functions("lane.unv")["spectrum"]
    assert (spectrum["abscissa_spec_data_type"], spectrum["abscissa_axis_units_lab"]) == (
        20,
        "order",
    )
    assert spectrum["x"].tolist() == [k / 2 for k in range(33)]
    assert spectrum["id3"] == "start.radius = 0 m, unbalance.eccentricity = 0.002 m"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            LANE[:2],
            "--lane names no start.radius, which is swept, too; add --lane start.radius=VALUE.",
        ),
        (
            ("--lane", "speed=1"),
            "--lane speed is not swept; swept are unbalance.eccentricity, start.rad",
        ),
        (("--lane", "start.radius=1kg"), "--lane start.radius must be in m, but is '1kg'"),
        (("--lane", "start.radius"), "--lane must be path=value, as in spin.speed=3000rpm"),
        (("--of", "orbit"), "; --lane PATH=VALUE computes it again for one lane."),
        (
            (*LANE, "--of", "orbit", "--of", "section"),
            "--of orbit is computed again; write it without sec",
        ),
    ],
)
def test_refused_lanes(export, given, message, tmp_path):
    result = export("a.csv", *given)
    assert result.exit_code == 2 and message in result.stderr
    assert not (tmp_path / "a.csv").exists()


def test_lanes_up_and_down(export, swept, tmp_path):
    """A lane of a carried sweep is on a branch, which is named by its word."""
    both = xr.concat([swept, swept + 1], "branch", data_vars="all").assign_coords(
        branch=["up", "down"]
    )
    both = both.assign(status=swept["status"].expand_dims(branch=2)).assign_attrs(swept.attrs)
    both["status"].attrs.update(swept["status"].attrs)
    both.to_zarr("both/sweep.zarr", zarr_format=2, consolidated=True)
    run = lambda *args: CliRunner().invoke(app, ["export", "both", *args])
    assert "branch = down" in run("down.csv", *LANE, "--lane", "branch=down").stderr
    assert (
        "--lane branch must be one of up, down, but is 'left'"
        in run("a.csv", *LANE, "--lane", "branch=left").stderr
    )
    jr.dataset(jr.simulate(SCENE, 1, 16)).to_zarr(
        "one/response.zarr", zarr_format=2, consolidated=True
    )
    result = CliRunner().invoke(app, ["export", "one", "a.csv", *LANE])
    assert "--lane is for the data of a sweep, but these have no lanes" in result.stderr
