"""Confusion and calibration of `jr.diagnose`: records of six kinds of a machine, with 5 % of noise.

A disc on a shaft in bearings turns at 0.6 of its critical speed. Parameters of unbalance and fault are
drawn from their bounds, the motion is simulated for 200 revolutions, and the next one is recorded by 64
samples with noise of 5 % of the root mean square of the vibration, in x and in y. Each
candidate is then fitted to each record.

    python benchmarks/diagnosis.py --records 60 --starts 3   # nine minutes on one core
    python benchmarks/diagnosis.py --records 3  # still compiles for minutes

prints causes and diagnoses, of all records and of those whose signal carries the answer (the sum of
squares that unbalance alone, its sag and a forward whirl of 1X, leaves of the record without noise is
more than `CARRIED` variances of the noise); the share of right answers by the probability of the best;
and how often it says "none of these" with and without the true cause among the candidates.
"""

import argparse
import itertools
import time

import numpy as np
from scipy.special import softmax

import jaxrotor as jr


K, M = 1e6, 10.0  # stiffness of the shaft and mass of the disc
NATURAL = np.sqrt(K / M)
DAMPING = 2 * 0.05 * np.sqrt(K * M)
SHARE = 0.05  # of the vibration is noise, in x and in y
CARRIED = 40.0  # sum of squares over the variance of the noise
SETTLE, FINE, SAMPLES = 200, 256, 64  # revolutions, steps in each of the truth, samples in each
LEVEL = 1e-3  # of the test of residuals
PERIODIC = 1e-3  # change over the size of the vibration from a revolution to the next

MACHINE = jr.Scene(
    jr.MasslessShaft(1.0, 0.5, 1e-6),  # the support has its stiffness
    jr.Disc(0.5, M),
    jr.DiscDamping(0.5, DAMPING),
    jr.Support(0.5, K),
    jr.Gravity(9.81),
    jr.Unbalance(0.5, M, 1e-4),
    spin=jr.ConstantSpeed(0.6 * NATURAL),
)
UNBALANCE = {"unbalance.eccentricity": (2e-5, 3e-4), "unbalance.phase": (-2.5, 2.5)}
RUB = jr.Limiter(
    0.5,
    -0.5,
    gap=1e-4,
    stiffness=1e6,
    damping=100.0,
    friction=0.1,
    rim_radius=0.05,
    blend=2e-6,
    slip=0.1,
)


def in_place_of_support(*parts):
    """Function from a scene to one with other parts in place of the support."""
    return lambda scene: scene.of_parts(*scene.without("supports").effects, *parts)


RING = jr.AnnularStator(0.5, 1e-4, K / 2, blend=1e-5, slip=0.01)  # one of two bearings
PEDESTAL = jr.LoosePedestal("pedestal", 5.0, 1e7, 2e3, 1e6, 2e3, 1e-4)
CANDIDATES = {
    "unbalance": (None, {}),
    "rub": (RUB, {"limiter.gap": (2e-5, 1.2e-4), "limiter.stiffness": (1e5, 1e7)}),
    "crack": (
        jr.Crack(0.5, 1e5, 1e4),
        {"crack.loss": (1e4, 4e5), "crack.angle": (-2.5, 2.5)},
    ),
    "loose pedestal": (
        in_place_of_support(PEDESTAL, jr.Support(0.5, K, on="pedestal")),
        {"loose_pedestal.play": (1e-5, 5e-4), "loose_pedestal.bolt_stiffness": (3e5, 1e7)},
    ),
    "worn bearing": (
        in_place_of_support(jr.Support(0.5, K / 2), RING),
        {"annular_stator.gap": (1e-5, 3e-4)},
    ),
    "misaligned": (
        in_place_of_support(jr.Support(0.5, 0.9 * K), jr.Coupling(0.5, 0.1 * K, 0.2, offset=1e-4)),
        {
            "coupling.offset": (2e-5, 5e-4),
            "coupling.direction": (-2.5, 2.5),
            "coupling.anisotropy": (0.05, 0.8),
        },
    ),
}


def scene_of(name):
    adds, _ = CANDIDATES[name]
    if adds is None:
        return MACHINE
    return adds(MACHINE) if callable(adds) else MACHINE.of_parts(*MACHINE.effects, adds)


def drawn(where, rng):
    """Parameters, uniform between their bounds, or in the logarithm as `jr.diagnose` takes them."""
    found = {}
    for path, (low, high) in where.items():
        if low > 0 and high > 10 * low:
            found[path] = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        else:
            found[path] = float(rng.uniform(low, high))
    return found


def motions(name, count, rng):
    """A revolution of steady motions, (count, T), and how many were left out as not periodic."""
    scene, found, left_out = scene_of(name), [], 0
    where = {**UNBALANCE, **CANDIDATES[name][1]}
    while len(found) < count:
        run = jr.simulate(
            scene.replace(drawn(where, rng)),
            SETTLE,
            FINE,
            keep=2,
            solver=jr.Exponential(4) if scene.of(type(RUB)) or scene.of(jr.Crack) else None,
            progress=False,
        )
        z = np.asarray(run.displacement[:-1, 0])[:: FINE // SAMPLES]
        before, z = np.split(z, 2)
        if np.abs(z - before).max() > PERIODIC * np.std(z):
            left_out += 1
            continue
        found.append(z)
    return np.array(found), left_out


def carried(z, sigma):
    """What unbalance alone, a constant and a forward whirl of 1X, leaves of a motion over the noise."""
    terms = np.fft.fft(z) / len(z)
    terms[0] += 1j * 9.81 * M / K  # it sags by the weight
    terms[1] = 0.0
    return len(z) * np.sum(np.abs(terms) ** 2) / sigma**2


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--records", type=int, default=200, help="of each kind")
    parser.add_argument("--draws", type=int, default=64)
    parser.add_argument("--starts", type=int, default=3)
    options = parser.parse_args()
    rng, begin = np.random.default_rng(0), time.perf_counter()
    names, records, sizes, causes = list(CANDIDATES), [], [], []
    for name in names:
        clean, left_out = motions(name, options.records, rng)
        sigma = SHARE * np.std(clean, axis=1, keepdims=True)
        noise = rng.normal(size=(2, *clean.shape)) * sigma
        records += list(clean + noise[0] + 1j * noise[1])
        sizes += [carried(z, s[0]) for z, s in zip(clean, sigma, strict=True)]
        causes += [name] * len(clean)
        print(f"{name}: {len(clean)} records, {left_out} left out as not periodic")
    print(f"simulated in {time.perf_counter() - begin:.0f} s", flush=True)
    begin = time.perf_counter()
    conditions = [jr.OrbitRecord(z, steps_per_revolution=64) for z in records]
    found = jr.diagnose_each(
        conditions,
        MACHINE,
        CANDIDATES,
        UNBALANCE,
        draws=options.draws,
        starts=options.starts,
        steps=30,
        level=LEVEL,
        progress=False,
    )
    print(f"diagnosed in {time.perf_counter() - begin:.0f} s of wall time")
    show(names, np.array(causes), np.array(sizes), found)


def show(names, causes, sizes, found):
    """Print the tables."""
    true = np.array([names.index(cause) for cause in causes])
    evidence = np.array(
        [
            [
                float(one.explanations[n].log_evidence) if n in one.explanations else -np.inf
                for n in names
            ]
            for one in found
        ]
    )
    tests = np.array(
        [
            [float(one.explanations[n].p_value) if n in one.explanations else 0.0 for n in names]
            for one in found
        ]
    )
    rows = np.arange(len(true))
    carries = (sizes > CARRIED) | (true == 0)
    best = evidence.argmax(axis=1)
    accepted = tests[rows, best] >= LEVEL
    for what, chosen in (
        ("all records", true >= 0),
        ("where the signal carries the answer", carries),
    ):
        confusion(names, what, true[chosen], np.where(accepted, best, len(names))[chosen])
    reliability(np.max(softmax(evidence, axis=1), axis=1), best == true)
    others = np.where(np.arange(len(names)) == true[:, None], -np.inf, evidence)
    second = others.argmax(axis=1)
    faults = carries & (true > 0)
    for what, chosen in (("with the cause among the candidates", best), ("without it", second)):
        share = np.mean(tests[rows, chosen][faults] < LEVEL)
        print(f"none of these, faults that the signal carries, {what}: {100 * share:.1f} %")
    for i, name in enumerate(
        names[1:], 1
    ):  # which other candidates pass for a cause that is left out
        own = faults & (true == i)
        passed = np.bincount(second[own][tests[rows, second][own] >= LEVEL], minlength=len(names))
        others = ", ".join(f"{n} {k}" for n, k in zip(names, passed, strict=True) if k)
        print(f"  {name}, left out, of {own.sum()} passes for: {others or 'none'}")


def confusion(names, what, true, said):
    print(f"\n{what}: cause and diagnosis")
    print(" " * 16, *(f"{name:>15}" for name in [*names, "none of these"]), f"{'right':>8}")
    for i, name in enumerate(names):
        counts = np.bincount(said[true == i], minlength=len(names) + 1)
        share = 100 * counts[i] / max(counts.sum(), 1)
        print(f"{name:16}", *(f"{count:15d}" for count in counts), f"{share:6.1f} %")
    print(f"right in all: {100 * np.mean(said == true):.1f} % of {len(true)}")


def reliability(probability, right):
    """Share of right answers by the probability of the best, with the bounds of a binomial count."""
    print("\nprobability of the best     mean   right      95 % bounds   records")
    for low, high in itertools.pairwise((0.0, 0.5, 0.7, 0.9, 0.99, 1.0 + 1e-9)):
        inside = (probability >= low) & (probability < high)
        if inside.any():
            share = jr.probability(right[inside])
            print(
                f"{low:.2f} to {min(high, 1.0):.2f} {probability[inside].mean():19.3f} {share.value:7.3f}"
                f"   {share.low:.3f} to {share.high:.3f} {inside.sum():9d}"
            )
    print()


if __name__ == "__main__":
    main()
