"""A run and a lane of the same scene are advanced by the same method."""

import re

import numpy as np
import pytest
from own_laws import TurningForce, WornRim

import jaxrotor as jr
from jaxrotor.motion import run_up as runs, simulate as revolutions
from jaxrotor.motion.choice import steps_along, system_of_march
from jaxrotor.motion.integrated import IntegratedPace
from jaxrotor.motion.stepped import Stepping
from jaxrotor.sweeps.pace import pace_of, start_of_lanes


TIMES = np.linspace(0.0, 0.1, 33)


class Chosen(Exception):
    """Ends a motion before its program is traced, with the method chosen."""


def told(solver):
    """Name of a method: that of a diffrax solver, or the order of exponential steps."""
    return solver.order if isinstance(solver, jr.Exponential) else type(solver).__name__


def of_run(monkeypatch, scene, start, *, along):
    """Method of one motion."""

    def stop_along(scene, system, times, launch, stations, plan):
        raise Chosen(told(plan.solver))

    def stop_by_revolutions(system, plan, *rest):
        raise Chosen(told(plan.solver))

    monkeypatch.setattr(runs, "_motion", stop_along)
    monkeypatch.setattr(revolutions, "_run", stop_by_revolutions)
    try:
        if along:
            jr.simulate(scene, times=TIMES, start=start)
        else:
            jr.simulate(scene, 1, 32, start=start)
    except Chosen as chosen:
        return chosen.args[0]
    except ValueError as refusal:
        return str(refusal).partition(":")[0][:40]


def of_lane(scene, start, *, along):
    """Method of a lane of a sweep."""
    pacing = (TIMES, None) if along else (None, None)
    try:
        begun = start_of_lanes(scene, start, ())
        pace = pace_of(scene, begun, {}, pacing, None, None, (32, None))
    except ValueError as refusal:
        return str(refusal).partition(":")[0][:40]
    if isinstance(pace, IntegratedPace):
        return told(pace.integration.solver)
    return told(pace.solver) if isinstance(pace, Stepping) else "revolutions"


def drawn(rng):
    """A rotor with some of the effects that decide on the method, and where it begins."""
    some = lambda share: rng.random() < share
    k, unequal = rng.uniform(1e5, 1e6), rng.uniform(0.001, 0.9)
    match rng.integers(3):
        case 0:
            shaft = jr.MasslessShaft(1.0, 0.5, k, anisotropy=unequal if some(0.3) else 0.0)
            held = []
        case 1:
            shaft = jr.RigidShaft(1.0)
            held = [jr.Support(0.0, k, 50.0), jr.Support(1.0, k, 50.0)]
        case _:
            steel = jr.Material(2.1e11, 7850.0)
            shaft = jr.FlexibleShaft(1.0, 0.02, steel, nodes=3)
            held = [jr.Support(0.0, k, 50.0), jr.Support(1.0, k, 50.0)]
    parts = [jr.Disc(0.5, rng.uniform(1.0, 5.0), 0.02, 0.01), jr.DiscDamping(0.5, 20.0), *held]
    if some(0.4):
        parts.append(jr.Limiter(0.5, 0.0, 1e-3, 1e6))
    if some(0.3):
        parts.append(jr.Support(0.5, k, 10.0, anisotropy=unequal))
    if some(0.25):
        parts.append(jr.BallBalancer(0.5, 0.02, 0.05, 0.5, rolling=1.0, places=2))
    if some(0.1):
        parts.append(WornRim(0.5, 1e-3, 1e6, 1e-6, 0.1))
    if some(0.1):
        parts.append(TurningForce(0.5, 10.0, 0.4))
    match rng.integers(4):
        case 0:
            spin = jr.SpeedProfile([0.0, 1.0], [50.0, 200.0])
        case 1:
            spin = jr.Drive(
                50.0, 2.0, polar=0.1, feedback=some(0.5), coulomb=1.0 if some(0.3) else None
            )
        case _:
            spin = jr.ConstantSpeed(rng.uniform(50.0, 200.0))
    start = jr.Launch(angle=rng.uniform(0.1, 3.0)) if some(0.3) else None
    return jr.Scene(shaft, *parts, spin=spin), start


@pytest.mark.parametrize(
    "count", [pytest.param(25, marks=pytest.mark.slow), pytest.param(200, marks=pytest.mark.long)]
)
def test_run_and_lane_choose_alike(monkeypatch, count):
    rng, seen = np.random.default_rng(41), set()
    for _ in range(count):
        scene, start = drawn(rng)
        ways = (True, False) if isinstance(scene.spin, jr.ConstantSpeed) else (True,)
        for along in ways:
            with monkeypatch.context() as patch:
                run, lane = (
                    of_run(patch, scene, start, along=along),
                    of_lane(scene, start, along=along),
                )
            if lane == "revolutions":
                assert run in (2, 4), scene
            else:
                assert run == lane, (along, scene, start)
            seen.add((along, lane))
    methods = {method for along, method in seen if along}
    assert {2, 4, "Dopri8"} <= methods and (False, "revolutions") in seen
    assert count < 200 or "Kvaerno5" in methods


# === reasons


def rotor(*parts, spin=100.0):
    shaft = jr.FlexibleShaft(1.0, 0.02, jr.Material(2.1e11, 7850.0), nodes=3)
    held = jr.Support(0.0, 1e6, 50.0), jr.Support(1.0, 1e6, 50.0), jr.Disc(0.5, 2.0, 0.02, 0.01)
    spin = jr.ConstantSpeed(spin) if isinstance(spin, float) else spin
    return jr.Scene(shaft, *held, *parts, spin=spin)


BALLS = jr.BallBalancer(0.5, 0.02, 0.05, 0.5, rolling=1.0, places=2)
STOP = jr.Limiter(0.5, 0.0, 1e-3, 1e6)


@pytest.mark.parametrize(
    ("scene", "order", "along", "by_march", "by_revolutions"),
    [
        (
            rotor(),
            4,
            "for a linear rotor at constant speed",
            True,
            "for a linear rotor at constant speed",
        ),
        (rotor(STOP), 2, "for contact", True, "for contact"),
        (rotor(BALLS, STOP), 4, "for balls and contact", False, "since balls .ball_balancer. move"),
        (
            rotor(WornRim(0.5, 1e-3, 1e6, 1e-6, 0.1)),
            4,
            "for states of laws and contact",
            False,
            "since contacts .worn_rim. have states or count turns",
        ),
        (
            rotor(spin=jr.Drive(50.0, 2.0, polar=0.1, coulomb=1.0, feedback=True)),
            None,
            "since the rotor may come to rest",
            None,
            None,
        ),
    ],
)
def test_the_reason_of_a_choice(scene, order, along, by_march, by_revolutions):
    system = jr.assemble(scene)
    steps, why = steps_along(scene, system, TIMES)
    assert (steps and steps.order) == order and re.match(along, why), why
    if by_revolutions is not None:
        taken, why = system_of_march(scene, system, None)
        assert (taken is not None) == by_march
        assert re.match(by_revolutions, why), why


def test_a_motion_tells_by_what_it_was_stepped_and_why():
    linear, asked = rotor(), jr.Exponential(4)
    for run in (jr.simulate(linear, 1, 8), jr.run_up(linear, TIMES)):
        assert run.method == f"{run.solver} for a linear rotor at constant speed"
    assert jr.simulate(linear, 1, 8, solver=asked).method.endswith("as asked for")
    assert jr.dataset(run).attrs["method"] == run.method
