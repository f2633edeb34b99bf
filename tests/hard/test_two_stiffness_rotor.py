"""Hard cases of the rotor of two stiffnesses: a response that is unstable, stiffness that goes."""

import numpy as np
import pytest
from published import dual

import jaxrotor as jr


MU = 0.2


def effective(alpha, nu, mu=MU):
    """Stiffness of shaft and two turning supports in series along the axes of both."""
    return np.array(
        [
            2 * (1 + s * mu) * (1 + s * nu) / (alpha * (1 + s * mu) + 2 * (1 + s * nu))
            for s in (1, -1)
        ]
    )


@pytest.mark.hard("2.1 finite response inside the unstable band")
def test_a_finite_response_of_an_unstable_rotor(record_property):
    """Sheet, 3.8: |q| = 7.4535599 at p = 1, where `max Re lambda` is +0.049703."""
    scene = dual(1, p=1.0)
    size = abs(jr.unbalance_response(scene, 1.0).forward[0, 0])
    growth = float(jr.growth_rate(scene))
    record_property("measured", f"|q| = {size:.7f} at a growth rate of {growth:+.6f}")
    assert size == pytest.approx(7.4535599, abs=5.1e-8)
    assert growth == pytest.approx(0.049703, abs=5.1e-7)


@pytest.mark.hard("2.13 one direction of the supports loses its stiffness")
@pytest.mark.parametrize("left", [1e-2, 1e-5, 1e-8])
@pytest.mark.parametrize("side", [-1, 1])
def test_one_direction_loses_its_stiffness(side, left, record_property):
    """One critical speed goes to zero as the root of `left`, the sag grows as 1 / `left`."""
    nu = side * (1 - left)
    scene = dual(3, nu=nu, kappa=None, delta=0.0)
    k, e = effective(1.0, nu)
    speeds = np.asarray(jr.critical_speeds(scene).forward)
    weight = jr.weight_response(scene, 0.0)
    found = [*speeds, weight.deflection[0, 0].real, weight.twice[0, 0].real]
    expected = [*np.sort(np.sqrt([k, e])), (k + e) / (2 * k * e), (e - k) / (2 * k * e)]
    error = np.max(np.abs(np.array(found) / expected - 1))
    record_property("measured", f"{left:.0e} left: relative error {error:.0e}")
    assert error < 4e-16 / left + 1e-14  # the rounding of 1 - left


@pytest.mark.hard("2.13 one direction of the supports has no stiffness", outcome="refused")
def test_one_direction_has_no_stiffness():
    scene = dual(3, nu=-1.0, kappa=None)
    speeds = np.asarray(jr.critical_speeds(scene).forward)
    np.testing.assert_allclose(speeds, np.sqrt(effective(1.0, -1.0)[1:]), rtol=1e-12)
    with pytest.raises(ValueError, match="needs a rotor that is held, but it can move as a rigid"):
        jr.weight_response(scene, 0.0)


@pytest.mark.hard("2.13 supports of great compliance")
@pytest.mark.parametrize("alpha", [1e2, 1e4, 1e6])
def test_great_compliance(alpha, record_property):
    scene = dual(3, alpha=alpha, nu=-0.3, kappa=None, delta=0.0)
    speeds = np.asarray(jr.critical_speeds(scene).forward)
    error = np.max(np.abs(speeds / np.sort(np.sqrt(effective(alpha, -0.3))) - 1))
    record_property("measured", f"alpha = {alpha:.0e}: relative error {error:.0e}")
    assert error < 1e-15 * alpha + 1e-14  # the shaft's stiffness is rounded beside the supports'


@pytest.mark.hard("2.14 the best anisotropy of the supports at a small one of the shaft")
@pytest.mark.parametrize("mu", [0.1, 1e-4, 1e-8])
@pytest.mark.parametrize("alpha", [1e-3, 1.0, 1e4])
def test_best_anisotropy_of_a_nearly_round_shaft(mu, alpha, record_property):
    """The printed formula is 0/0 there: 4 mu (..) by differences. Written as a quotient it is not."""
    even = alpha * (1 - mu**2)
    nu = -4 * mu / (even + np.hypot(even, 4 * mu))
    scene = dual(3, alpha=alpha, nu=nu, mu=mu, kappa=None, delta=0.0)
    one, two = np.asarray(jr.critical_speeds(scene).forward)
    error = abs(one / two - 1)
    record_property("measured", f"critical speeds one to {error:.0e}")
    assert error < 1e-12
    assert abs(jr.weight_response(scene, 0.3).twice[0, 0]) < 1e-13 * max(1, alpha)
    printed = (even - np.sqrt(even**2 + 16 * mu**2)) / (4 * mu)
    if mu == 1e-8 and alpha >= 1:
        assert abs(printed / nu - 1) > 1e-2
