"""The measured two-disc rotor of `rk4.csv`: its runs in the signs and units of jaxrotor, and its scene."""

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

import jaxrotor as jr


TABLE = Path(__file__).with_name("rk4.csv")
PROBES = ("p1x", "p1y", "p2x", "p2y")
STATIONS = ("discs.2.at", "discs.2.at", "discs.3.at", "discs.3.at")
ANGLES = np.array([0.0, np.pi / 2, 0.0, np.pi / 2])
NOMINAL = np.array([1005.0, 1206.0])  # [rpm]
MISLABELLED = ("B047", "B038")  # as if without their mass on disc 2
LATE = ("B007", "B031", "A027")  # three days later
RPM = np.pi / 30


class Runs(NamedTuple):
    """Conditions at both speeds; `x(t) = Re v exp(i Omega t)`, angles in the sense of rotation."""

    condition: np.ndarray  # (c,)
    masses: np.ndarray  # "D1", "D2", "inphase", "antiphase" or "balanced", (c,)
    speeds: np.ndarray  # [rad/s], (c, 2)
    trials: np.ndarray  # [kg m], (c, 2 discs)
    readings: np.ndarray  # [m], (c, 2 speeds, 4 probes)

    def of(self, chosen: np.ndarray) -> "Runs":
        """The runs of these numbers, or for which it is true."""
        return Runs(*(part[chosen] for part in self))

    def record(self, speed: int, probes: list[int]) -> jr.ResponseRecord:
        """The runs at one of the speeds, read by these probes."""
        return jr.ResponseRecord(
            self.readings[:, speed, probes],
            self.speeds[:, speed],
            at=[STATIONS[k] for k in probes],
            angle=ANGLES[probes],
            trials=self.trials,
            offset=True,
        )


def runs() -> Runs:
    """All runs; a condition has one row at each speed."""
    with TABLE.open() as file:
        rows = list(csv.DictReader(file))
    of = lambda row, name: complex(float(row[name + "_re"]), -float(row[name + "_im"]))
    pairs = list(zip(rows[::2], rows[1::2], strict=True))
    assert all(one["condition"] == other["condition"] for one, other in pairs)
    return Runs(
        np.array([one["condition"] for one, _ in pairs]),
        np.array([one["config"] for one, _ in pairs]),
        RPM * np.array([[float(row["speed_rpm"]) for row in pair] for pair in pairs]),
        1e-6 * np.array([[of(one, "U1"), of(one, "U2")] for one, _ in pairs]),
        1e-6 * np.array([[[of(row, p) for p in PROBES] for row in pair] for pair in pairs]),
    )


def split(every: Runs) -> tuple[Runs, Runs]:
    """Runs with masses on one disc, to be fitted, and on both, to be predicted, without suspect ones."""
    sound = ~np.isin(every.condition, MISLABELLED + LATE)
    one, both = np.isin(every.masses, ("D1", "D2")), np.isin(every.masses, ("inphase", "antiphase"))
    return every.of(sound & one), every.of(sound & both)


def rig() -> jr.Scene:
    """Shaft and discs as stated, discs at a quarter of the span; what is not known has a first guess.

    Each bearing is rigid along an axis at `supports.angle`, and has a spring across it. Discs without mass
    carry the probes, unbalances the trial masses.
    """
    disc = lambda at: jr.Disc(at, 0.8, polar=5.776e-4, diametral=3.305e-4)
    bearing = lambda at: (
        jr.Support(at, stiffness=5e7, anisotropy=1.0, angle=1.9),
        jr.Support(at, stiffness=1e5, anisotropy=-1.0, angle=1.9),
    )
    return jr.Scene(
        jr.FlexibleShaft(0.56, 0.01, nodes=3),
        *(disc(0.14), disc(0.42)),
        *(jr.Disc(0.1, 0.0), jr.Disc(0.46, 0.0)),
        *(*bearing(0.0), *bearing(0.56)),
        *(jr.DiscDamping(0.14, 2.0), jr.DiscDamping(0.42, 2.0)),
        *(jr.Unbalance(0.14, moment=1e-6), jr.Unbalance(0.42, moment=1e-6)),
        spin=jr.ConstantSpeed(NOMINAL[0] * RPM),
    )


SOUGHT = {
    "supports.1.stiffness": (1e4, 1e8),  # of bearing 1, across its rigid axis; half the spring
    "supports.3.stiffness": (1e4, 1e8),  # of bearing 2
    "supports.angle": None,  # of the rigid axis of both
    "disc_dampings.translational": (0.01, 100.0),
    "discs.2.at": (0.005, 0.13),  # probes of plane 1
    "discs.3.at": (0.43, 0.555),  # of plane 2
    "unbalances.phase": None,  # from the keyphasor's mark to hole 0
}


def coefficients(scene: jr.Scene) -> np.ndarray:
    """Influence coefficients at the nominal speeds [m / (kg m)], (2 speeds, 4 probes, 2 discs)."""
    found = []
    for unit in ([1e-6, 0.0], [0.0, 1e-6]):
        own = scene.replace({"unbalances.0.moment": unit[0], "unbalances.1.moment": unit[1]})
        whirl = jr.unbalance_response(own, NOMINAL * RPM, STATIONS)
        found.append(1e6 * np.asarray(whirl.probe(ANGLES)))
    return np.stack(found, axis=-1)
