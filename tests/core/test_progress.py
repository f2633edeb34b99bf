"""Progress of long computations is shown on request or on a terminal, one display at a time."""

import time

import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor.core import progress


def test_a_bar_compiles_until_its_first_step(capsys):
    with progress.progress(True, 2, "2 lanes", "lanes"):
        pass
    assert "compiling .." in capsys.readouterr().err
    with progress.progress(True, 2, "2 lanes", "lanes") as tick:
        tick(1)
    said = capsys.readouterr().err
    assert "2 lanes" in said and "50 %" in said and "compiling" not in said


def test_a_wait_is_told_after_some_time(capsys, monkeypatch):
    with progress.waiting(True, "run-up"):
        pass
    assert not capsys.readouterr().err  # it ended before PATIENCE
    monkeypatch.setattr(progress, "PATIENCE", 0.01)
    with progress.waiting(True, "run-up"):
        time.sleep(0.2)
    assert "run-up: compiling and running" in capsys.readouterr().err
    with progress.waiting(None, "run-up"):  # not a terminal
        time.sleep(0.05)
    assert not capsys.readouterr().err


def test_one_thing_is_shown_at_a_time(capsys, monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.01)
    with progress.progress(True, 1, "lanes", "lanes") as tick:
        with progress.waiting(True, "simulation"), progress.progress(True, 1, "other", "x"):
            time.sleep(0.1)
        tick(1)
    said = capsys.readouterr().err
    assert "lanes" in said and "simulation" not in said and "other" not in said
    with pytest.raises(ZeroDivisionError), progress.waiting(True, "simulation"):
        raise ZeroDivisionError
    capsys.readouterr()
    with progress.progress(
        True, 1, "again", "lanes"
    ) as tick:  # the display of a failed run is closed
        tick(1)
    assert "again" in capsys.readouterr().err


DISC = jr.Disc(0.5, 1.0), jr.DiscDamping(0.5, 0.2)
ROTOR = jr.Scene(jr.MasslessShaft(1.0, 0.5, 1.0), *DISC, spin=jr.ConstantSpeed(2.0))


@pytest.mark.slow  # each function is compiled
@pytest.mark.parametrize(
    ("call", "what"),
    [
        (lambda **how: jr.run_up(ROTOR, np.linspace(0.0, 1.0, 3), **how), "run-up"),
        (lambda **how: jr.simulate(ROTOR, 1, 8, **how), "simulation"),
        (lambda **how: jr.periodic(ROTOR, jr.Whirl(0.1), revolutions=1, **how), "periodic orbit"),
        (lambda **how: jr.onset_speed(ROTOR, throw=False, **how), "onset of instability"),
    ],
    ids=["run_up", "simulate", "periodic", "onset_speed"],
)
def test_what_is_one_program_says_that_it_is_under_way(call, what, capsys, monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    call(progress=True)
    assert f"{what}: compiling and running" in capsys.readouterr().err
    call()
    assert not capsys.readouterr().err
