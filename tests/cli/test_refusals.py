"""Errors name the parts of the scene that cause them, and what to do in Python or at a prompt."""

import types

import pytest
from typer.testing import CliRunner

import jaxrotor as jr
from jaxrotor.cli import app
from jaxrotor.cli.typed import typed


SHARE = {"anisotropy": 0.3}
STOPS = [jr.Limiter(0.4, angle, 1e-3, 1e5, 1.0, 0.1, 0.05) for angle in (0.0, 3.0)]


def held(shaft, *effects, **support):
    """Three discs on a shaft in two elastic supports."""
    ends = [jr.Support(at, 1e5, 100.0, **support) for at in (0.0, 0.8)]
    discs = [jr.Disc(at, 5.0, 0.01, 0.02) for at in (0.0, 0.4, 0.8)]
    return jr.Scene(shaft, *discs, *ends, *effects, spin=jr.ConstantSpeed(50.0))


RIGID = jr.RigidShaft(0.8, constraints=())
UNEQUAL = jr.MasslessShaft(0.8, 0.4, 1e5, anisotropy=0.3, ends="elastic")
STANDING = held(RIGID, **SHARE)
TURNING = held(UNEQUAL)
BOTH = held(UNEQUAL, **SHARE)
HYSTERESIS = jr.HystereticDamping(0.01)
OVAL = jr.FlexibleShaft(0.8, 0.02, nodes=2, constraints=(), anisotropy=0.3)
SPREAD = held(OVAL, jr.ExternalDamping(8.0, anisotropy=0.3))
FILM = jr.Support(0.4, kxx=[1e5, 2e5], kyy=[2e5, 3e5], speeds=[0.0, 100.0])
BALLS = jr.BallBalancer(0.4, 0.01, 0.05, 1.0)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (
            lambda: jr.simulate(SPREAD, 1, 8, solver=jr.Exponential()),
            r"not all forces.*at single stations, .* \(external_damping\) and others turn with the shaft "
            r"\(the shaft\); leave `solver` out, or name a diffrax solver",
        ),
        (
            lambda: jr.simulate(held(UNEQUAL, FILM), 1, 8, solver=jr.Exponential()),
            r"by constant numbers at single stations, .*\(supports.2\) and others turn with the shaft",
        ),
        (
            lambda: jr.roots(BOTH),
            r"stand still \(supports.0 and supports.1\) and others turn with the shaft \(the shaft\); "
            "look at `jaxrotor.floquet_multipliers`",
        ),
        (lambda: jr.critical_speeds(BOTH), "no single critical speeds.*supports.0.*the shaft"),
        (lambda: jr.unbalance_response(BOTH, 10.0), "series of frequencies.*supports.0.*the shaft"),
        (
            lambda: jr.unbalance_response(held(RIGID, *STOPS), 10.0),
            r"contacts \(limiters.0 and limiters.1\); remove them, as by `scene.without\('limiters'\)`",
        ),
        (
            lambda: jr.sweep(
                held(RIGID, BALLS), {"spin.speed": [9.0]}, steps_per_revolution=8, solver=jr.Exponential()
            ),
            r"does not take this motion: there are balls \(ball_balancer\), which `times` would allow",
        ),
        (lambda: jr.simulate(held(RIGID, HYSTERESIS), 1, 8), r"\(hysteretic_damping\).*not in time"),
        (
            lambda: jr.roots(held(UNEQUAL, HYSTERESIS)),
            r"\(hysteretic_damping\).*every axis \(the shaft\)",
        ),
    ],
)  # fmt: skip
def test_what_is_in_the_way_is_named(call, sentence):
    with pytest.raises(ValueError, match=sentence):
        call()


COMMAND = types.SimpleNamespace(
    params=[
        types.SimpleNamespace(name=name, opts=opts)
        for name, opts in (("scene", ["scene"]), ("steps", ["--steps"]), ("low", ["--from"]))
    ]
)


@pytest.mark.parametrize(
    ("python", "prompt"),
    [
        ("use `jaxrotor.run_up`.", "use `jaxrotor run-up my.toml`."),
        ("look at `jaxrotor.critical_speeds`.", "look at `jaxrotor critical my.toml`."),
        ("look at `jaxrotor.lyapunov`.", "look at `jaxrotor.lyapunov` in Python."),
        ("take 512 `steps_per_revolution`.", "take 512 --steps."),
        ("a wider `within`.", "a wider `within`."),  # which takes both ends
        ("take `scene.without('limiters')`.", "take a scene file without its limiters."),
        ("put a Disc or a BallBalancer there.", "put a [disc] or a [ball_balancer] there."),
        ("`at [m]` must be on the shaft.", "`at [m]` must be on the shaft."),
    ],
)
def test_what_to_write_is_said_as_what_to_type(python, prompt):
    words = ["my.toml", "--keep", "3"]
    assert typed(python, "simulate", words, ["simulate", "run-up"], COMMAND) == prompt


def test_a_command_says_what_to_type(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    jr.save(SPREAD, "mine.toml")
    result = CliRunner().invoke(
        app, ["simulate", "mine.toml", "--revolutions", "1", "--solver", "exponential2"]
    )
    assert result.exit_code == 2 and len(result.stderr.splitlines()) == 1
    assert "with the shaft (the shaft); leave --solver out, or name a diffrax" in result.stderr
