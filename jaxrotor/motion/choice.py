"""Choice of the method by which a motion is advanced, the same for a run and for a lane of a sweep.

The table is in docs/concepts/motion.md. What exponential steps do not take is integrated by a diffrax
solver with an error estimate, `default_solver`; a solver that is named is taken, or refused in a
sentence that names the reason. A motion tells the reason of what was chosen in its `method`.
"""

import dataclasses
from typing import Any

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp

from ..core.quantities import known
from ..equations.constant_frame import WORST_GAIN, in_constant_axes, loop_gain
from ..equations.pencil import frame
from ..equations.rotating_frame import massless_in_steps
from ..equations.start import AbstractStart, is_whole
from ..equations.stationary_frame import check_known_in_time, has_memory
from ..equations.system import System, assemble, has_massless
from ..scene import Scene
from ..solvers.choice import solver_name
from ..solvers.control import step_control
from ..solvers.exponential import Exponential
from ..spins.constant import ConstantSpeed
from ..spins.drive import Drive
from .pieces import appearing


RIGID = 2  # coordinates, up to which balls and drives leave an explicit solver as quick
ASKED = "as asked for"  # reasons of a choice
STEEP = "since a film, whose force has no bound, or a hinge takes steps with an error estimate"


# === by whole revolutions


def system_of_march(
    scene: Scene, system: System, solver: Any, start: AbstractStart | None = None
) -> tuple[System | None, str]:
    """The equations as a `March` takes them by whole revolutions, None to integrate them; and why."""
    named, chosen = isinstance(solver, Exponential), solver is None
    if appearing(scene):
        return None, "since unbalance appears during it"
    if system.races:
        return None, f"since balls ({system.owners_of('bodies')}) move with the rotor"
    if remembering := system.laws_with(has_memory):
        return None, f"since contacts ({remembering}) have states or count turns"
    if not (start is None or is_whole(start)):
        return None, "since the start is not that of a revolution"
    if chosen and system.steep:
        return None, STEEP
    if system.others and not (named or chosen):
        return None, "since another shaft has an unbalance of its own"
    if system.others and frame(system.blocks) == "periodic":
        return None, "since there are several shafts, axes that turn and axes that stand"
    if chosen and not has_small_remainder(system):
        return None, "since the axes that turn and those that stand are very unequal"
    if named or chosen:
        system = in_constant_axes(system)
    massless, reason = massless_in_steps(scene, system)
    if named and reason is not None:
        raise ValueError(f"Exponential() does not take this motion: {reason}; leave `solver` out.")
    if reason is not None or massless is not None and not (named or chosen):
        return None, f"since {reason or 'a part of the rotor has no mass'}"
    if massless and isinstance(solver, Exponential) and isinstance(solver.shapes, int):
        raise ValueError(
            f"Exponential(shapes={solver.shapes}) needs mass at every coordinate, but a part of the rotor "
            "has none; leave `shapes` out."
        )
    return dataclasses.replace(system, massless=massless), _drawn(system) if chosen else ASKED


def has_small_remainder(system: System) -> bool:
    """Whether axes of constant coefficients leave no remainder, or one of small gain.

    Where values are traced, the gain is not known, and it is taken to be small.
    """
    if frame(system.blocks) != "periodic":
        return True
    gain = loop_gain(in_constant_axes(system)) if system.deviators else jnp.inf
    return not known(gain) or bool(gain <= WORST_GAIN)


def check_integrated(solver: Any) -> None:
    """Raise where a solver cannot integrate what exponential steps do not take."""
    if isinstance(solver, dfx.AbstractSolver) and step_control(solver) is None:
        raise ValueError(
            f"`{solver_name(solver)}` has no error estimate, by which balls, parts without mass or a "
            "start at any angle are integrated; take another, or `run_up` with `substeps`."
        )


# === along times


def steps_along(scene: Scene, system: System, times: Any) -> tuple[Exponential | None, str]:
    """The exponential steps that a scene takes along times, None where it is integrated; and why.

    Balls, states of laws and drives that the rotor holds back are integrated where a rotor has few
    coordinates: in the axes of the shaft nothing but contact is quick there, so that long steps serve.
    Values that decide the steps must be known: those of the speed, and all of a drive that the rotor
    holds back.
    """
    check_known_in_time(system)
    if system.steep:
        return None, STEEP
    if system.coupled and system.n <= RIGID:
        return None, f"{_drawn(system)} on one or two coordinates, where long steps serve"
    decide = times, system if system.coupled else (system.spin, system.blocks.polar)
    if not all(map(known, jax.tree.leaves(decide))):
        return None, "since values that decide the steps are traced"
    reason = unsteppable(system)
    if reason is None and has_massless(scene, system) is not False:
        reason = "a part of the rotor has no mass, or may have none"
    if reason is not None:
        return None, f"since {reason}"
    return steps_of_default(system), _drawn(system)


def steps_of_default(system: System) -> Exponential:
    """Exponential steps along times: through the kinks of contact those of order 4 gain nothing."""
    return Exponential(order=4 if system.coupled or not system.ports else 2)


def check_steppable(
    scene: Scene, solver: Exponential, system: System | None = None, *, revolutions: bool = False
) -> System:
    """The equations of a scene; raises where exponential steps do not take its run.

    With `revolutions` it goes by whole revolutions, and has no balls.
    """
    system = assemble(scene) if system is None else system
    check_known_in_time(system)
    reason = unsteppable(system)
    if revolutions and system.races:
        reason = f"there are balls ({system.owners_of('bodies')}), which `times` would allow"
    elif revolutions and (remembering := system.laws_with(has_memory)):
        moves = f"contacts that have states or count turns ({remembering})"
        reason = f"there are {moves}, which `times` would allow"
    if reason is None:
        massless = has_massless(scene, system)
        reason = "a part of the rotor has no mass" if massless else None
        reason = "masses are traced, so that one may be zero" if massless is None else reason
    if reason is not None:
        raise ValueError(
            f"Exponential() does not take this motion: {reason}; leave `solver` out, or name a diffrax "
            "one."
        )
    if solver.shapes is not None:
        raise ValueError(
            "A few shapes are for whole revolutions, where the steady response is known; leave `shapes` "
            "out."
        )
    if solver.fused:
        raise ValueError(
            "`fused=True` is for sweeps by whole revolutions, not for runs along times; leave `fused` out."
        )
    return system


def unsteppable(system: System) -> str | None:
    """Why exponential steps do not take the run of a system; None if they do."""
    if not system.n or system.blocks.inertia is None:
        return "nothing moves but the angle of the rotor"
    spin = system.spin
    if isinstance(spin, Drive) and spin.can_stop:
        return "the rotor may come to rest under its Drive"
    if system.between:
        return "balls touch each other, which takes steps with an error estimate"
    if frame(system.blocks) != "fixed":
        return "unequal axes turn with the shaft"
    if system.tabled is not None and not isinstance(system.spin, ConstantSpeed):
        return "coefficients of its supports are tables over the speed, which varies"
    return None


def _drawn(system: System) -> str:
    """Parts of a scene by which its steps are chosen, as a reason."""
    spin, parts = system.spin, []
    if not spin.given:
        parts.append("a drive that the rotor holds back")
    elif not isinstance(spin, ConstantSpeed):
        parts.append("a speed that varies")
    if system.races:
        parts.append("balls")
    if system.state_count:
        parts.append("states of laws")
    if system.remainder:
        parts.append("axes that turn and axes that stand")
    if len(system.ports) > system.remainder:
        parts.append("contact")
    return f"for {' and '.join(parts) or 'a linear rotor at constant speed'}"


# === by diffrax


def default_solver(scene: Scene, system: System | None = None) -> dfx.AbstractSolver:
    """Solver for a run: implicit for a flexible shaft, whose high modes are stiff, or massless parts."""
    if has_massless(scene, system):
        return dfx.Kvaerno5()
    line = lambda scene: scene.line().stiffness
    size = eqx.filter_eval_shape(line, scene).shape[0] if system is None else system.n
    return dfx.Kvaerno5() if size > 2 else dfx.Dopri8()
