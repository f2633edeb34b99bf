"""Paths to the numbers of a tree of modules: addresses, other spellings, changes and known values."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from jaxrotor.core.parameters import addresses, aliases, follow, known_values, with_leaves
from jaxrotor.core.quantities import Scalar, real


class Wing(eqx.Module):
    kind: ClassVar[str] = "wing"
    plural: ClassVar[str] = "wings"

    span: Scalar = real("span [m]")
    is_long: bool = eqx.field(default=False, static=True)

    def refreshed(self):
        return Wing(self.span, bool(self.span > 10))


class Tail(eqx.Module):
    kind: ClassVar[str] = "tail"
    plural: ClassVar[str] = "tails"

    angle: Scalar = real("angle [rad]", default=None)


class Body(eqx.Module):
    length: Scalar = real("length [m]")
    ends: tuple[Wing, ...] = ()


class Plane(eqx.Module):
    body: Body
    members: tuple[Wing | Tail, ...]


PLANE = Plane(Body(7.0, (Wing(0.5),)), (Wing(4.0), Tail(), Wing(-5.0)))


@pytest.fixture
def table():
    return addresses(PLANE, ("body",), "members")


def test_paths_of_parts_and_members(table):
    assert table == {
        "body.length": [("body", "length")],
        "body.ends.0.span": [("body", "ends", 0, "span")],
        "wings.span": [("members", 0, "span"), ("members", 2, "span")],
        "wings.0.span": [("members", 0, "span")],
        "wings.1.span": [("members", 2, "span")],
        "tail.angle": [("members", 1, "angle")],
    }
    assert float(follow(PLANE, table["wings.1.span"][0])) == -5.0


def test_other_spellings():
    assert aliases("wing.span", PLANE.members) == ["wings.span"]
    assert aliases("tails.0.angle", PLANE.members) == ["tail.0.angle", "tails.angle", "tail.angle"]
    assert aliases("body.length", PLANE.members) == []


def test_changed_leaves_refresh_flags(table):
    (address,) = table["wings.0.span"]
    changed = with_leaves(PLANE, {address: jnp.asarray(40.0), ("body", "length"): jnp.zeros(())})
    assert float(changed.members[0].span) == 40.0 and changed.members[0].is_long
    assert float(changed.body.length) == 0.0
    assert changed.members[1:] == PLANE.members[1:] and not PLANE.members[0].is_long


def test_known_values_have_units(table):
    assert known_values(PLANE, table) == {
        "body.length": (7.0, "m", 7.0),
        "body.ends.0.span": (0.5, "m", 0.5),
        "wings.0.span": (4.0, "m", 4.0),
        "wings.1.span": (-5.0, "m", -5.0),
    }

    def traced(plane):
        assert known_values(plane, table) == {}
        return plane.body.length

    jax.jit(traced)(PLANE)
