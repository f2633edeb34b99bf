"""Single precision: its error over the revolutions is bounded, and known."""

import numpy as np
import pytest
from jeffcott import AT, jeffcott

import jaxrotor as jr
from jaxrotor.work_precision.methods import Setting


TURNS = (1, 10, 100, 1000, 10_000)
START = jr.Whirl(0.02, 1.0)


def computed(scene: jr.Scene, precision: str, steps: int) -> list[np.ndarray]:
    """Displacements of the last of so many revolutions."""
    setting = Setting(precision=precision)
    with setting.computed():
        scene, start, found, done = setting.applied(scene), setting.cast(START), [], 0
        for turns in TURNS:
            r = jr.simulate(scene, turns - done, steps, start=start, keep=1)
            start, done = r.end, turns
            found.append(np.asarray(r.displacement[:, 0]))
    assert found[0].dtype == ("complex64" if precision == "float32" else "complex128")
    return found


def growth(scene: jr.Scene, steps: int) -> np.ndarray:
    """Difference of the two precisions over the amplitude, by `TURNS`."""
    single, double = (computed(scene, name, steps) for name in ("float32", "float64"))
    pairs = zip(single, double, strict=True)
    return np.array([abs(s - d).max() / abs(d).max() for s, d in pairs])


@pytest.mark.slow
@pytest.mark.hard("also: float32, a forced rotor without contact")
def test_single_precision_of_a_linear_rotor(record_property):
    """Free motions die out, and their errors with them: what is left does not grow."""
    scene = jeffcott(jr.DiscDamping(AT, 0.02), jr.Unbalance(AT, 1.0, 0.05), speed=2.3)
    off = growth(scene, 16)
    record_property("measured", " ".join(f"{e:.0e}" for e in off) + " after 1 to 1e4 revolutions")
    assert off.max() < 1e-4
    assert off[-1] < 2e-6


@pytest.mark.slow
@pytest.mark.hard("also: float32, an undamped whirl")
def test_single_precision_of_an_undamped_whirl(record_property):
    """Its phase slips by a rounding of the frequency a revolution: linear, no faster."""
    off = growth(jeffcott(speed=2.3), 16)
    record_property("measured", " ".join(f"{e:.0e}" for e in off) + " after 1 to 1e4 revolutions")
    assert (off < 2e-6 + 4e-6 * np.array(TURNS)).all()


@pytest.mark.slow
@pytest.mark.hard("also: float32, a steady rub")
def test_single_precision_of_a_rub(record_property):
    """An orbit on preloaded stops and friction, attracted: rounding does not add up."""
    stops = [
        jr.Limiter(AT, a, -0.1, 2.0, 0.1, 0.1, rim_radius=1.0)
        for a in np.pi / 3 * np.array([1, 3, 5])
    ]
    scene = jeffcott(*stops, jr.DiscDamping(AT, 0.5), jr.Unbalance(AT, 1.0, 0.05), speed=2.3)
    off = growth(scene, 64)
    record_property("measured", " ".join(f"{e:.0e}" for e in off) + " after 1 to 1e4 revolutions")
    assert off.max() < 1e-4
