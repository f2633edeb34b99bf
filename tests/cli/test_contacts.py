"""Rows of contacts: a ring of stops has one, and a sweep says where contact begins."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import jaxrotor as jr
from jaxrotor.cli.contacts import contact_rows
from jaxrotor.cli.sweep_answer import _contact_rows


def motion(*stops):
    """Four samples: the first stop touches in one, each next one in the sample after it."""
    force = np.zeros((4, len(stops)), complex)
    for number in range(len(stops)):
        force[number + 1, number] = 10.0 * (number + 1) * 1j
    scene = jr.Scene(
        jr.MasslessShaft(0.4, 0.2, 5e3), jr.Disc(0.2, 2.0), *stops, spin=jr.ConstantSpeed(5.0)
    )
    return SimpleNamespace(scene=scene, contact_force=force)


def test_stops_that_differ_in_their_angle_share_a_row():
    one, other = jr.Limiter.at_angles([0.0, 2.0], at=0.2, gap=1e-3, stiffness=1e6)
    harder = jr.Limiter(0.2, 1.0, 1e-3, 2e6)
    assert contact_rows(motion(one, other)) == [
        ("contacts 0 to 1", "50.00% of the time, up to 20 N")
    ]
    assert contact_rows(motion(one, harder, other)) == [
        ("contacts 0, 2", "50.00% of the time, up to 30 N"),
        ("contact 1", "25.00% of the time, up to 20 N"),
    ]
    (row,) = contact_rows(motion(one, other), skip=2)
    assert row[1] == "50.00% of the time, up to 20 N"
    free = SimpleNamespace(scene=motion().scene, contact_force=None)
    assert contact_rows(free) == []


SPEEDS = np.array([30.0, 10.0, 20.0, 40.0, 50.0])  # [rad/s]


@pytest.mark.parametrize(
    "touching, said, where",
    [
        ([0, 0, 0, 0, 0], "none", None),
        ([1, 1, 1, 1, 1], "5 of 5 lanes, a stop up to 40 % of the time", None),
        ([1, 0, 0, 1, 1], "3 of 5 lanes, a stop up to 40 % of the time", "60 to 100"),
        ([0, 1, 0, 1, 0], "2 of 5 lanes, a stop up to 40 % of the time", "20, 80"),
    ],
)
def test_a_sweep_says_where_it_touches(touching, said, where):
    duty = 0.4 * np.array(touching)[:, None] * np.array([0.5, 1.0])
    variables = {
        "duty": (("spin.speed", "limiter"), duty),
        "status": ("spin.speed", np.zeros(5, np.int8)),
    }
    data = xr.Dataset(variables, {"spin.speed": SPEEDS})
    rows = _contact_rows(data, {"spin.speed": SPEEDS}, {"spin.speed": (2.0, "half rad/s")})
    expected = [] if where is None else [("", f"at spin.speed {where} half rad/s")]
    assert rows == [("contact", said), *expected]
