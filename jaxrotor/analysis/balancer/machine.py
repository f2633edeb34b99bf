"""Dimensionless groups of a scene to which the theory of the ball balancer applies."""

import numpy as np

from ...effects import BallBalancer
from ...equations.pencil import isotropic
from ...equations.speed_tables import check_no_tables
from ...equations.system import assemble
from ...scene import Scene
from .groups import BalancerGroups, Scales


def groups_of(scene: Scene) -> tuple[BalancerGroups, Scales]:
    """Groups and scales of a rotor with one coordinate, such as the tilt about a pivot, at its speed.

    Positions of balls are then angles from the rotor's imbalance, in the sense of its rotation.

    Args:
        scene: a rotor that only tilts about a pivot, with all balls in one plane off it; rows without
            balls are left out.

    Returns:
        `BalancerGroups`, see `BalancerGroups.from_si`, and `Scales`.

    Raises:
        ValueError: the scene is not such a rotor, or has no inertia or spring.
    """
    check_no_tables(scene, "The theory of the ball balancer")
    system, races = assemble(scene), scene.of(BallBalancer)
    levers = [float(race.row[0]) for race in system.races] if system.n == 1 else []
    blocks, counts = system.blocks, [int(np.sum(np.asarray(row.masses) > 0)) for row in races]
    filled = [i for i, count in enumerate(counts) if count]
    fits = isotropic(blocks) and not system.ports and len(levers) == len(races) == len(system.races)
    if not fits or not filled or not all(lever == levers[0] != 0 for lever in levers):
        raise ValueError(
            "The theory of the ball balancer is that of a rotor which only tilts about a pivot, with all "
            "balls in one plane off it and no contacts: a `RigidShaft` with one constraint."
        )
    if blocks.inertia is None or blocks.stiffness is None:
        raise ValueError(
            "The theory of the ball balancer needs a rotor with inertia and a spring; add a Disc or a "
            "Support."
        )
    rows, distance = [races[i] for i in filled], levers[0]
    part = lambda block: 0.0 if block is None else block[0, 0]
    shape = {
        "transverse": blocks.inertia[0, 0],
        "stiffness": blocks.stiffness[0, 0],
        "distance": distance,
        "ball_mass": [row.ball_mass for row in rows],
        "track_radius": [row.race_radius for row in rows],
    }
    unbalance = system.load.unbalance
    groups = BalancerGroups.from_si(
        speed=scene.spin.sense * scene.spin.speed,
        polar=part(blocks.gyroscopic),
        damping=part(blocks.damping),
        unbalance=0.0 if unbalance is None else abs(unbalance[0]) / abs(distance),
        balls=[counts[i] for i in filled],
        drag=[row.drag_coefficient for row in rows],
        rolling=[row.rolling for row in rows],
        **shape,
    )
    return groups, Scales.of(**shape)
