"""Provenance: settings as JSON, which tell one sweep from another and give back start and solver."""

import functools
import json

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

import jaxrotor as jr
from jaxrotor.results.provenance import as_json, start_and_solver
from jaxrotor.sweeps.observe import Extrema, Reversal, Section, WhirlSpectrum


def after(number):
    """The next larger floating-point number."""
    return np.nextafter(number, np.inf)


def told(start, solver):
    """Attributes as a sweep has them."""
    return {"start": as_json(start), "solver_settings": as_json(solver), "solver": "its name"}


def test_settings_are_json_with_the_class_and_every_field():
    whirl = json.loads(as_json(jr.Whirl(1e-3, -441.0123456789012)))
    expected = {"class": "Whirl", "radius": 1e-3, "rate": -441.0123456789012, "angle": 0.0}
    assert whirl == expected
    solver = json.loads(as_json(jr.Exponential(4, located=True)))
    expected = {"order": 4, "basis": "auto", "located": True, "shapes": None, "fused": False}
    assert solver == {"class": "Exponential", **expected}
    observed = json.loads(as_json((Section(), Extrema(7))))
    assert observed == [{"class": "Section"}, {"class": "Extrema", "most": 7}]
    control = json.loads(as_json(dfx.PIDController(rtol=1e-6, atol=1e-9, dtmin=np.inf)))
    assert (control["rtol"], control["dtmin"], control["dtmax"]) == (1e-6, "inf", None)
    assert control["norm"] == "rms_norm"


WHIRL = (1.2345678901234567e-3, 75.0, 0.1)
CONTROL = {"rtol": 1e-6, "atol": 1e-9, "pcoeff": 0.1, "dtmin": 1e-7, "dtmax": 0.5, "safety": 0.9}
NUMBERS = np.array([1e-3, 2e-3, 3e-3, -1e-3, 0.5, -0.1, 0.7, 1.3])  # of a state, part by part


def continued(numbers):
    q, velocity = jnp.asarray(numbers[0::2] + 1j * numbers[1::2]).reshape(2, 2)
    return jr.Continued(q, velocity)


SETTINGS = {
    "start": [
        jr.AtRest(),
        jr.Whirl(*WHIRL),
        *(jr.Whirl(*(after(x) if k == n else x for k, x in enumerate(WHIRL))) for n in range(3)),
        continued(NUMBERS),
        *(continued(np.where(np.arange(8) == n, after(NUMBERS), NUMBERS)) for n in range(8)),
    ],
    "solver": [
        *(jr.Exponential(n, basis) for n in (2, 4) for basis in ("auto", "modal", "dense")),
        jr.Exponential(located=True),
        dfx.Tsit5(),
        dfx.Dopri8(),
        dfx.Kvaerno5(),
        dfx.Kvaerno5(scan_kind="bounded"),
        dfx.Kvaerno5(root_find_max_steps=11),
        dfx.Kvaerno5(root_finder=dfx.VeryChord(rtol=1e-6, atol=1e-9)),
        dfx.Kvaerno5(root_finder=dfx.VeryChord(rtol=after(1e-6), atol=1e-9)),
    ],
    "controller": [
        dfx.ConstantStepSize(),
        dfx.StepTo(ts=jnp.array([0.0, 0.5, 1.0])),
        dfx.StepTo(ts=jnp.array([0.0, after(0.5), 1.0])),
        dfx.PIDController(**CONTROL),
        *(dfx.PIDController(**CONTROL | {name: after(x)}) for name, x in CONTROL.items()),
        dfx.PIDController(**CONTROL, norm=optx.max_norm),
        dfx.PIDController(**CONTROL, norm=functools.partial(optx.rms_norm)),
        dfx.ClipStepSizeController(dfx.PIDController(**CONTROL), jump_ts=jnp.array([0.1])),
    ],
    "observe": [
        (),
        (Section(),),
        (Section(), Section()),
        *((Extrema(most),) for most in (11, 12)),
        *((Reversal(window),) for window in (9, 10)),
        *((WhirlSpectrum(samples),) for samples in (16, 32)),
    ],
}


@pytest.mark.parametrize("name", SETTINGS)
def test_every_setting_tells_itself_from_any_other(name):
    """Also by the last digit of one number, whatever the options of numpy."""
    texts = [as_json(setting) for setting in SETTINGS[name]]
    assert len(set(texts)) == len(texts)
    with np.printoptions(precision=3, threshold=2, suppress=True):
        assert [as_json(setting) for setting in SETTINGS[name]] == texts


def test_precision_of_an_array_is_told():
    wide, narrow = np.array([0.5]), np.array([0.5], np.float32)
    assert json.loads(as_json(wide)) == [0.5]
    assert json.loads(as_json(narrow)) == {"dtype": "float32", "values": [0.5]}


@pytest.mark.parametrize("start", SETTINGS["start"], ids=as_json)
def test_a_start_comes_back_to_its_last_digit(start):
    found, _ = start_and_solver(told(start, jr.Exponential()))
    assert type(found) is type(start)
    for name in start.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(found, name), getattr(start, name))


@pytest.mark.parametrize("solver", SETTINGS["solver"][:7], ids=as_json)
def test_a_solver_comes_back(solver):
    assert start_and_solver(told(jr.AtRest(), solver))[1] == solver


PRINTED = "Whirl(\n  radius=Array(0.001, dtype=float64),\n  rate=Array(-441., dtype=float64),\n"
PRINTED += "  angle=Array(1.e-16, dtype=float64, weak_type=True)\n)"


def test_printed_settings_of_earlier_versions_are_read():
    name = "Exponential(order=4, basis='dense', located=True)"
    start, solver = start_and_solver({"start": PRINTED, "solver": name})
    assert (start.radius, start.rate, start.angle) == (1e-3, -441.0, 1e-16)
    assert solver == jr.Exponential(4, "dense", located=True)
    plain = {"start": "AtRest()", "solver": "Exponential(order=2, basis='auto')"}
    start, solver = start_and_solver(plain)
    assert isinstance(start, jr.AtRest) and solver == jr.Exponential()


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        (
            {"start": '{"class": "Mine"}', "solver_settings": '{"class": "Exponential"}'},
            "from Mine cannot .*; only one from AtRest or Whirl or Continued can",
        ),
        (told(jr.AtRest(), dfx.Kvaerno5()), "by Kvaerno5 cannot .*; only `Exponential` can"),
        ({"start": "AtRest()", "solver": "Kvaerno5"}, "by Kvaerno5 .*; only `Exponential` can"),
        (
            {"start": "Continued(\n  q=Array([0.+0.j], dtype=complex128)", "solver": "Tsit5"},
            "from Continued .* only one from AtRest or Whirl can",
        ),
    ],
)
def test_what_cannot_be_run_again_is_one_sentence(attributes, words):
    with pytest.raises(ValueError, match=words):
        start_and_solver(attributes)
