"""Static positions and linear coefficients of oil films, against closed forms and SciPy."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

import jaxrotor as jr


RADIUS, LENGTH, GAP, GRAVITY = 0.025, 0.02, 1e-4, 9.81
BASE = np.sqrt(GRAVITY / GAP)  # unit of rates

# eps: S_s, Kxx, Kxy, Kyx, Kyy in W/c, Cxx, Cxy, Cyy in W/(c Omega), load along -y
PRINTED = {
    0.1: (
        *(3.11011109, 2.53077169, 9.75769206, -10.3811199, 1.32842404),
        *(19.7904657, -2.53249464, 20.4871581),
    ),
    0.3: (
        *(0.855066215, 2.41255323, 2.62460099, -4.48249899, 1.79486124),
        *(6.06115225, -2.42697817, 8.15304771),
    ),
    0.5: (
        *(0.33316405, 2.20994375, 0.85769951, -3.97664242, 2.9232505),
        *(3.05392414, -2.2449555, 6.61475972),
    ),
    0.9: (
        *(0.0104140013, 1.72942068, -1.42129198, -7.26367219, 19.0955453),
        *(0.686922234, -1.80585718, 10.9978382),
    ),
}  # fmt: skip


def sommerfeld(e):
    """`S_s = k0 |Omega| / (4 W)` (8)."""
    return (1 - e**2) ** 2 / (e * np.sqrt(16 * e**2 + np.pi**2 * (1 - e**2)))


def coefficients(e):
    """Stiffness in W/c and damping in W/(c Omega) by (9), for a load along -y."""
    E, s, p2 = e**2, np.sqrt(1 - e**2), np.pi**2
    h0 = (p2 * s**2 + 16 * E) ** -1.5
    kxx = 4 * h0 * (p2 * (2 - E) + 16 * E)
    kyy = 4 * h0 * (p2 * (1 + 2 * E) + 32 * E * (1 + E) / (1 - E))
    kxy = h0 * np.pi * (p2 * (1 - E) ** 2 - 16 * E**2) / (e * s)
    kyx = -h0 * np.pi * (p2 * (1 - E) * (1 + 2 * E) + 32 * E * (1 + E)) / (e * s)
    cxx = 2 * np.pi * h0 * s * (p2 * (1 + 2 * E) - 16 * E) / e
    cyy = 2 * np.pi * h0 * (p2 * (1 - E) ** 2 + 48 * E) / (e * s)
    cxy = -8 * h0 * (p2 * (1 + 2 * E) - 16 * E)
    return np.array([[kxx, kxy], [kyx, kyy]]), np.array([[cxx, cxy], [cxy, cyy]])


def bearing(at=0.5, weight=1.0, sigma=0.3, **values):
    """Bearing whose `k0 sqrt(g / c) / (4 W)` is sigma."""
    scale = 4 * weight * sigma / BASE
    values = {"viscosity": scale * GAP**2 / RADIUS / LENGTH**3} | values
    return jr.JournalBearing(at, radius=RADIUS, length=LENGTH, clearance=GAP, **values)


def rigid(p, sigma=0.3, *others):
    """A mass of 2 kg in one bearing, at the speed `p` in units of `sqrt(g / c)`."""
    parts = jr.Disc(0.5, 2.0), jr.Gravity(GRAVITY), bearing(0.5, 2.0 * GRAVITY, sigma)
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e-6), *parts, *others, spin=jr.ConstantSpeed(p * BASE)
    )


def matrices(support):
    """Stiffness and damping of a support, tables first."""
    parts = [[getattr(support, a + b) for b in ("xx", "xy", "yx", "yy")] for a in "kc"]
    return (np.moveaxis(np.reshape(part, (2, 2, -1)), -1, 0) for part in parts)


@pytest.mark.slow
def test_one_film_under_its_load():
    """Eccentricities that are given, to 1e-10 of the formulas; a turned load; reversed spin."""
    weight, eccentricities = 30.0, np.array(sorted(PRINTED, reverse=True))
    film = bearing(weight=weight)
    speeds = sommerfeld(eccentricities) / 0.3 * BASE
    turn = 0.7
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    plain = matrices(jr.film_support(film, -1j * weight, speeds))
    turned = matrices(jr.film_support(film, -1j * np.exp(1j * turn) * weight, speeds))
    reverse = matrices(jr.film_support(film, -1j * weight, -speeds[::-1]))
    units = weight / GAP * np.ones_like(speeds), weight / GAP / speeds
    flip = np.array([[1, -1], [-1, 1]])
    for which, (own, aside, back, unit) in enumerate(
        zip(plain, turned, reverse, units, strict=True)
    ):
        want = np.array([coefficients(e)[which] for e in eccentricities]) * unit[:, None, None]
        size = np.abs(want).max(axis=(1, 2), keepdims=True)
        assert np.max(np.abs(own - want) / size) < 1e-10
        assert np.max(np.abs(aside - rotation @ want @ rotation.T) / size) < 1e-10
        assert np.max(np.abs(back[::-1] - flip * want) / size) < 1e-10
    for e, numbers in PRINTED.items():
        stiffness, damping = coefficients(e)
        found = (sommerfeld(e), *stiffness.ravel(), damping[0, 0], damping[0, 1], damping[1, 1])
        np.testing.assert_allclose(found, numbers, rtol=1e-8)


@pytest.mark.long
def test_thresholds_of_a_rigid_rotor():
    """Position, roots and onset of the table, by numbers at one speed and by tables."""
    onset = 2.59133483
    found = jr.static_positions(rigid(onset))
    assert float(found.eccentricity[0, 0]) == pytest.approx(0.319917841, rel=1e-8)
    assert complex(found.load[0, 0]) == pytest.approx(-2j * GRAVITY, rel=1e-11)
    roots = np.asarray(jr.roots(jr.linearized(rigid(onset)))) / BASE / onset
    assert np.min(np.abs(roots - 0.520874118j)) < 1e-8
    roots = np.asarray(jr.roots(jr.linearized(rigid(3.0)))) / BASE
    assert np.min(np.abs(roots - (0.087575506 + 1.431722906j))) < 2e-9
    nodes = np.sort(np.append(np.linspace(0.5, 4.5, 9), onset)) * BASE
    tables = jr.linearized(rigid(2.0), nodes)
    threshold = jr.onset_speed(tables, (BASE, 4 * BASE))
    assert float(threshold.speed) / BASE == pytest.approx(onset, rel=1e-8)
    assert float(threshold.whirl_frequency / threshold.speed) == pytest.approx(
        0.520874118, rel=1e-8
    )


@pytest.mark.slow
def test_a_rotor_is_stable_at_every_speed_from_an_eccentricity_on():
    """Growth at a thousand times `sqrt(g / c)`, just below the eccentricity of sheet 8 and above it."""
    limit, p = 0.756030386, 1000.0
    assert sommerfeld(limit) == pytest.approx(0.0663852602, rel=1e-8)  # of nine digits
    growth = []
    for eccentricity in (limit - 5e-6, limit + 5e-6):
        scene = rigid(p, sommerfeld(eccentricity) / p)
        found = jr.static_positions(scene)
        assert float(found.eccentricity[0, 0]) == pytest.approx(eccentricity, abs=1e-9)
        growth.append(float(jr.growth_rate(jr.linearized(scene))))
    assert growth[0] > 0 > growth[1]


@pytest.mark.slow
def test_threshold_of_a_flexible_rotor():
    """A tenth of the mass in the journal, the rest on a spring: (11) at kappa 4, eccentricity 0.3."""
    sigma, onset, whirl, kappa, mass = 0.391832212, 2.18222542, 1.13348583, 4.0, 2.0
    disc = (1 - 0.1) * mass
    parts = [
        jr.Disc(0.5, 0.1 * mass),
        jr.Casing("disc", disc),
        jr.Support(0.5, kappa * BASE**2 * disc, on="disc"),
        jr.Gravity(GRAVITY),
        bearing(0.5, mass * GRAVITY, sigma),
    ]
    spin = jr.ConstantSpeed(onset * BASE)
    scene = jr.Scene(jr.MasslessShaft(1.0, 0.5, 1e-6), *parts, spin=spin)
    found = jr.static_positions(scene)
    assert float(found.eccentricity[0, 0]) == pytest.approx(0.3, rel=1e-8)
    roots = np.asarray(jr.roots(jr.linearized(scene))) / BASE
    assert np.min(np.abs(roots - 1j * whirl)) < 2e-8
    assert np.max(roots.real) < 1e-8


@pytest.mark.long
def test_three_bearings_share_the_load():
    """Statically indeterminate, the middle bush aside: equilibrium and compatibility of the shaft."""
    shaft = jr.FlexibleShaft(1.0, 0.03, constraints=[], nodes=4)
    films = [bearing(0.0, 20.0), bearing(0.5, 20.0, offset=3e-5, angle=1.0), bearing(1.0, 20.0)]
    scene = jr.Scene(
        shaft,
        jr.Disc(0.3, 5.0, 0.01, 0.02),
        jr.Gravity(GRAVITY),
        *films,
        spin=jr.ConstantSpeed(300.0),
    )
    speeds = jnp.array([100.0, 300.0, 1500.0])
    found = jr.static_positions(scene, speeds)
    system = jr.assemble(scene)
    stiffness, force = np.asarray(system.blocks.stiffness), np.asarray(system.load.constant)
    read = eqx.filter_jit(lambda line, at: (jax.vmap(line.row)(at), jax.vmap(line.column)(at)))
    rows, columns = map(np.asarray, read(system.line, np.array([0.0, 0.5, 1.0])))
    scale = 4 * 20.0 * 0.3 / BASE

    def film(zeta, speed):
        e, s = np.abs(zeta), np.sqrt(1 - np.abs(zeta) ** 2)
        turn = np.where(e > 0, zeta / np.where(e > 0, e, 1), 1)
        return scale * speed * turn * (-(e**2) / s**4 + 1j * np.pi * e / (4 * s**3))

    aside = np.array([0, 3e-5 * np.exp(1j), 0])
    both = np.concatenate([stiffness, 1e6 * rows])
    for k, speed in enumerate(np.asarray(speeds)):
        position = np.asarray(found.position[k])
        push = force + columns.T @ film(position / GAP, speed)
        right = np.concatenate([push, 1e6 * (position + aside)])
        q = np.linalg.lstsq(both, right, rcond=None)[0]
        assert np.max(np.abs(stiffness @ q - push)) < 1e-8 * np.max(np.abs(force))
        np.testing.assert_allclose(rows @ q, position + aside, rtol=1e-9, atol=1e-9 * GAP)
        total = complex(np.sum(np.asarray(found.load[k])))
        weight = GRAVITY * (5.0 + 7850.0 * np.pi * 0.03**2 / 4)
        assert total == pytest.approx(-1j * weight, rel=1e-9)


@pytest.mark.slow
def test_derivatives_of_the_position():
    """By viscosity and clearance against central differences of the inverse of (8)."""

    scene = rigid(2.0)

    def eccentricity(viscosity, gap):
        changed = {"journal_bearing.viscosity": viscosity, "journal_bearing.clearance": gap}
        return jr.static_positions(scene.replace(changed)).eccentricity[0, 0]

    viscosity = float(bearing(0.5, 2.0 * GRAVITY).viscosity)

    def inverse(viscosity, gap):
        scale = viscosity * RADIUS * LENGTH**3 / gap**2 * 2.0 * BASE / (8.0 * GRAVITY)
        return scipy.optimize.brentq(lambda e: sommerfeld(e) - scale, 1e-6, 0.999, xtol=1e-15)

    found = jax.jit(jax.jacfwd(eccentricity, (0, 1)))(viscosity, GAP)
    for number, slope in enumerate(found):
        at, step = np.array([viscosity, GAP]), np.zeros(2)
        step[number] = 1e-4 * at[number]
        want = (inverse(*(at + step)) - inverse(*(at - step))) / (2 * step[number])
        assert float(slope) == pytest.approx(want, rel=1e-6)


@pytest.mark.hard("8.7 linear analyses of a film without its static position", outcome="refused")
def test_linear_analyses_ask_for_linear_films():
    scene = rigid(2.0)
    for analysis in (
        jr.roots,
        jr.modes,
        jr.onset_speed,
        jr.critical_speeds,
        jr.growth_rate,
        jr.state_space,
        lambda scene: jr.reduction(scene, 0.5),
        lambda scene: jr.campbell(scene, [1.0, 2.0]),
        lambda scene: jr.unbalance_response(scene, 3.0),
        lambda scene: jr.stability_boundary(scene, "spin.speed", [1.0, 2.0]),
    ):
        with pytest.raises(
            ValueError, match=r"\(journal_bearing\).*`jaxrotor.linearized\(scene\)`"
        ):
            analysis(scene)
    with pytest.raises(ValueError, match="neither an oil film nor a rolling or magnetic bearing"):
        jr.linearized(scene.without("journal_bearings"))


def test_speeds_of_tables_are_several():
    with pytest.raises(
        ValueError, match=r"`speeds` must be two or more.*`linearized\(scene.at_speed"
    ):
        jr.linearized(rigid(2.0), [500.0])


@pytest.mark.slow
def test_a_film_of_a_reversed_rotor_is_the_mirror_image():
    """Cross coefficients change their signs, growth does not; the other sense is refused.

    `growth` is the largest real part of `m s^2 + C s + K = 0` by (9), at the eccentricity of (8).
    """
    speed, e = 2.0 * BASE, 0.3
    weight = 2.0 * GRAVITY
    scene = rigid(2.0, sommerfeld(e) / 2.0)
    K, C = coefficients(e)
    K, C, zero = weight / GAP * K, weight / GAP / speed * C, np.zeros((2, 2))
    growth = np.linalg.eigvals(np.block([[zero, np.eye(2)], [-K / 2.0, -C / 2.0]])).real.max()
    nodes, mirror = speed * np.array([0.9, 1.0, 1.1]), np.array([[1, -1], [-1, 1]])
    one, other = jr.linearized(scene, nodes), jr.linearized(scene.at_speed(-speed), -nodes[::-1])
    for linear, sign, by_hand in ((one, 1, (K, C)), (other, -1, (mirror * K, mirror * C))):
        own = linear.of(jr.Support)[0].at_speed(sign * speed)
        for found, wanted in zip(matrices(own), by_hand, strict=True):
            np.testing.assert_allclose(found[0], wanted, rtol=1e-9)
        assert float(jr.growth_rate(linear)) == pytest.approx(growth, rel=1e-9)
        back = linear.at_speed(-sign * speed)
        said = r"of support are for (positive|negative) speeds alone, but .* at -?626.418 rad/s"
        with pytest.raises(ValueError, match=said):
            jr.growth_rate(back)
        with pytest.raises(ValueError, match=r"needed at (negative|positive) speeds: films"):
            jr.critical_speeds(back)
        assert np.isnan(jax.jit(jr.growth_rate)(back))
    with pytest.raises(ValueError, match="must be of one sense, but are from -300 to 600 rad/s"):
        jr.linearized(scene, [-300.0, 300.0, 600.0])


@pytest.mark.long
@pytest.mark.hard("8.2 films without viscosity or speed, under weight")
def test_positions_at_rest():
    """A film bears nothing at rest, and without viscosity never: there a support does, or nothing."""
    scene = rigid(2.0)
    with pytest.raises(ValueError, match="No static position in the films was found at 0 rad/s"):
        jr.linearized(scene.at_speed(0.0))
    with pytest.raises(ValueError, match="No position in the film bears the load"):
        jr.film_support(bearing(), -1j, [0.0, 100.0, 200.0, 300.0])
    weight, stiffness = float(scene.of(jr.Disc)[0].mass) * GRAVITY, 1e9
    caged = scene.of_parts(*scene.effects, jr.Support(scene.of(jr.JournalBearing)[0].at, stiffness))
    found = jr.static_positions(caged, [0.0, 100.0])
    np.testing.assert_allclose(found.position[0], -1j * weight / stiffness, rtol=1e-9)
    assert abs(found.load[0, 0]) < 1e-12 * weight < abs(found.load[1, 0])
    dry = jr.static_positions(caged.put({"journal_bearing.viscosity": 0.0}), [0.0, 100.0])
    np.testing.assert_allclose(dry.position[:, 0], -1j * weight / stiffness, rtol=1e-9)
