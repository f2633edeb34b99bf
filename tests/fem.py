"""Finite elements of a rotor in real coordinates: an independent model, of scipy and numpy alone.

Timoshenko elements with consistent mass (Friswell, Penny, Garvey, Lees: Dynamics of Rotating Machines,
2010, section 5.4); of every node displacements and slopes `x, y, x', y'`.
"""

import dataclasses

import numpy as np
import scipy.linalg


@dataclasses.dataclass
class Stretch:
    """A piece of shaft, up to the station `stop` [m], with a bore of diameter `inner` [m]."""

    stop: float
    diameter: float
    inner: float = 0.0


def element(h, diameter, young, density, shear, inner=0.0):
    """Mass with rotary inertia, twice the rotary inertia alone, and stiffness in one plane, 4 by 4.

    An infinite shear modulus leaves shear out.
    """
    area, second = np.pi * (diameter**2 - inner**2) / 4, np.pi * (diameter**4 - inner**4) / 64
    p = 0.0
    if np.isfinite(shear):
        nu, r2 = young / (2 * shear) - 1, (inner / diameter) ** 2
        cowper = 6 * (1 + r2) ** 2 * (1 + nu)
        cowper /= (7 + 6 * nu) * (1 + r2) ** 2 + (20 + 12 * nu) * r2
        p = 12 * young * second / (cowper * shear * area * h**2)
    full = lambda a, b, c, d, e, f: np.array(
        [[a, b, c, d], [b, e, -d, f], [c, -d, a, -b], [d, f, -b, e]]
    )
    stiff = full(12, 6 * h, -12, 6 * h, (4 + p) * h**2, (2 - p) * h**2)
    moved = full(
        312 + 588 * p + 280 * p**2,
        (44 + 77 * p + 35 * p**2) * h,
        108 + 252 * p + 140 * p**2,
        -(26 + 63 * p + 35 * p**2) * h,
        (8 + 14 * p + 7 * p**2) * h**2,
        -(6 + 14 * p + 7 * p**2) * h**2,
    )
    turned = full(
        36,
        (3 - 15 * p) * h,
        -36,
        (3 - 15 * p) * h,
        (4 + 5 * p + 10 * p**2) * h**2,
        (-1 - 5 * p + 5 * p**2) * h**2,
    )
    rotary = density * second / (30 * (1 + p) ** 2 * h) * turned
    mass = density * area * h / (840 * (1 + p) ** 2) * moved + rotary
    return mass, 2 * rotary, young * second / ((1 + p) * h**3) * stiff


def matrices(stretches, discs, bearings, material, longest):
    """Nodes, `M`, `G` of `G u. Omega` and `K`; discs and bearings by station, these with 2 by 2 `K`."""
    young, density, shear = material
    stops = sorted({s.stop for s in stretches} | {d[0] for d in discs} | {b[0] for b in bearings})
    nodes = [0.0]
    for stop in stops:
        if stop > nodes[-1]:
            pieces = int(np.ceil((stop - nodes[-1]) / longest))
            nodes += list(np.linspace(nodes[-1], stop, pieces + 1)[1:])
    nodes = np.array(nodes)
    size = 4 * nodes.size
    mass, gyroscopic, stiffness = np.zeros((3, size, size))
    for k, (start, stop) in enumerate(zip(nodes[:-1], nodes[1:], strict=True)):
        middle = (start + stop) / 2
        piece = next(s for s in stretches if s.stop > middle)
        own, polar, stiff = element(
            stop - start, piece.diameter, young, density, shear, piece.inner
        )
        x = np.array([0, 2, 4, 6]) + 4 * k
        for plane in (x, x + 1):
            mass[np.ix_(plane, plane)] += own
            stiffness[np.ix_(plane, plane)] += stiff
        gyroscopic[np.ix_(x, x + 1)] += polar
        gyroscopic[np.ix_(x + 1, x)] -= polar
    at = lambda station: 4 * int(np.argmin(np.abs(nodes - station)))
    for station, heavy, diametral, polar in discs:
        first = at(station)
        mass[range(first, first + 4), range(first, first + 4)] += [heavy] * 2 + [diametral] * 2
        gyroscopic[first + 2, first + 3] += polar
        gyroscopic[first + 3, first + 2] -= polar
    for station, spring in bearings:
        stiffness[at(station) : at(station) + 2, at(station) : at(station) + 2] += spring
    return nodes, mass, gyroscopic, stiffness


def critical_speeds(stretches, discs, bearings, material, longest, count):
    """Lowest speeds with `K u = Omega^2 (M - i G) u`, forward shares of energy, and senses (c, nodes).

    Of two meshes, of which the finer is half of `longest`: the error of elements with rotary inertia
    goes with the square of their length, which speeds and shares are rid of.
    """
    coarse, fine = (
        _whirls(*matrices(stretches, discs, bearings, material, h), count)
        for h in (longest, longest / 2)
    )
    speeds, shares = ((4 * b - a) / 3 for a, b in zip(coarse[1:3], fine[1:3], strict=True))
    return fine[0], speeds, shares, fine[3]


def _whirls(nodes, mass, gyroscopic, stiffness, count):
    size = mass.shape[0]
    inverses, shapes = scipy.linalg.eigh(  # of 1 / Omega^2
        mass - 1j * gyroscopic, stiffness, subset_by_index=[size - count, size - 1]
    )
    motion = shapes.T[::-1].reshape(count, -1, 2)  # Re(u exp(i Omega t)) of x and y
    x, y = motion[..., 0], motion[..., 1]
    parts = (x + 1j * y) / 2, (x - 1j * y) / 2  # of exp(i Omega t), conjugate of exp(-i Omega t)
    plane = mass[::2, ::2]
    energies = [np.einsum("ci,ij,cj->c", part.conj(), plane, part).real for part in parts]
    ahead, behind = (np.abs(part[:, ::2]) ** 2 for part in parts)
    share, sense = energies[0] / sum(energies), (ahead - behind) / (ahead + behind)
    return nodes, 1 / np.sqrt(inverses[::-1]), share, sense
