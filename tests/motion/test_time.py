"""Motion in time against the reference sheet, an event-located oracle, and scipy."""

import functools

import diffrax as dfx
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Legendre
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from systems import one_disc

import jaxrotor as jr
from jaxrotor.equations.stationary_frame import Motion


LENGTH, UNIT = 0.7, 0.022646559709295067  # l [m], T* [s]; N = Omega T* = 15
RIGHT = jr.load("limiter-rotor").with_nodes(10)
PAPER = jr.load("limiter-rotor-2023")


def whirl(radius: float, rate: float = 0.0) -> jr.Whirl:
    """Start in units of the sheet: radius in l, rate in 1 / T*."""
    return jr.Whirl(radius * LENGTH, rate / UNIT)


def radii(z: np.ndarray) -> tuple[float, float]:
    return abs(z).min() / LENGTH, abs(z).max() / LENGTH


def whirl_rate(z: np.ndarray, steps: int) -> float:
    """Turns per revolution, weighted by a window that vanishes smoothly at both ends."""
    turned = np.angle(z[1:] * z[:-1].conj()) * steps / (2 * np.pi)
    u = (np.arange(turned.size) + 0.5) / turned.size
    weight = np.exp(-1 / (u * (1 - u)))
    return float((turned * weight).sum() / weight.sum())


@functools.cache
def rub(name: str, order: int) -> jr.TimeHistory:
    """200 revolutions of a backward rub, settled for 100, of a shaft of ten nodes or trapezoidal cells."""
    start = whirl(0.012, -10) if name == "right" else whirl(0.02, -13.9)
    turned = {"shaft.polar_ratio": -2.0, "disc.polar": -RIGHT.get("disc.polar")}
    scenes = {"right": RIGHT, "reversed": RIGHT.replace(turned), "trapezoid": PAPER}
    solver = jr.Exponential(order)
    return jr.simulate(scenes[name], 300, 512, solver=solver, start=start, keep=200)


# === the sheet's attractors, section 3.4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "order", "rate", "low", "high"),
    [
        ("right", 2, -0.567622, 0.0090533, 0.0145980),
        ("right", 4, -0.567622, 0.0090533, 0.0145980),
        ("reversed", 4, -0.918395, 0.0129959, 0.0205970),
        ("trapezoid", 2, -0.931369, 0.0133469, 0.0209704),
    ],
)
def test_backward_rub_of_the_sheet(name, order, rate, low, high):
    z = np.asarray(rub(name, order).displacement[:, 0])
    assert whirl_rate(z, 512) == pytest.approx(rate, abs=5e-5)
    assert radii(z) == pytest.approx((low, high), rel=1e-3)


@pytest.mark.slow
def test_forward_bouncing_from_rest():
    # Chaotic: the rate of a window scatters, the range is that of the sheet.
    r = jr.simulate(RIGHT, 1000, 256, start=whirl(1e-3), keep=600)
    z = np.asarray(r.displacement[:, 0])
    assert 0.116 < whirl_rate(z, 256) < 0.120
    low, high = radii(z)
    assert 0.002 < low < 0.009
    assert 0.0110 < high < 0.0130


@pytest.mark.slow
@pytest.mark.hard("1.4 sign of friction smoothed over a stated width")
@pytest.mark.parametrize(
    ("width", "rate", "low", "high"),
    [(0.03, -1.51285, 0.10731, 0.14298), (0.003, -1.5130, 0.1079, 0.1439)],
)
def test_three_attractors_coexist_without_unbalance(width, rate, low, high, record_property):
    """Forward bouncing, backward rub and violent whip; the whip rolls, so its sign(V) is smoothed.

    Width of the smoothing, in rim speeds: 0.1 moves the whip's rate by 1.7e-3 and its radii by
    1.8 %, 0.03 by 1e-4 and 0.6 %, 0.003 by 0.05 %. Neither bouncing nor rub feels even the wider.
    """
    assert float(RIGHT.get("unbalance.eccentricity")) == 0
    rim = float(RIGHT.get("spin.speed")) * 0.1  # [m/s]
    rolling = RIGHT.replace({"limiters.slip": width * rim})

    def settled(start, settle):
        rest = jr.simulate(rolling, settle, 512, start=start, keep=1).end
        r = jr.simulate(rolling, 300, 512, start=rest)
        z = np.asarray(r.displacement[:, 0])
        return whirl_rate(z, 512), *radii(z)

    if width == 0.03:
        assert 0.116 < settled(whirl(1e-3), 400)[0] < 0.120
        rub = settled(whirl(0.012, -10), 200)
        assert rub[0] == pytest.approx(-0.567622, abs=5e-5)
        assert rub[1:] == pytest.approx((0.0090533, 0.0145980), rel=1e-3)
    whip = settled(whirl(0.1, -18), 200)
    record_property("measured", f"width {width} rim speeds: whirl rate {whip[0]:.4f} N")
    assert whip[0] == pytest.approx(rate, abs=2e-4)
    assert whip[1:] == pytest.approx((low, high), rel=1.5e-3)


# === the same rotor, written again: Ritz polynomials, contacts located to rounding


class Oracle:
    """The piecewise linear rotor, exact between its contact events.

    Ritz basis `zeta^2 P_j(2 zeta - 1)` in the dimensionless variables of the sheet; states are
    real, `[Re q, Re q., Im q, Im q.]`. Rim speed keeps its sign (no rolling).
    """

    def __init__(self, functions: int = 8, gyroscopic: float = 1.0):
        n, self.speed = functions, 15.0
        square = Legendre.fromroots([0, 0], [0, 1])
        shapes = [square * Legendre.basis(j, [0, 1]) for j in range(n)]
        at = lambda fs: np.array([f(1.0) for f in fs])

        def product(fs):
            areas = [[(f * g).integ(lbnd=0)(1.0) for g in fs] for f in fs]
            return np.array(areas)

        slopes, bends = [f.deriv(1) for f in shapes], [f.deriv(2) for f in shapes]
        tip, turn = at(shapes), at(slopes)
        beta, eta_i = (0.2 / 0.7) ** 2 / 16, 0.005
        stiffness = product(bends)
        rotary = 3.571429e-5 * product(slopes) + beta * np.outer(turn, turn)
        inertia = 0.7 * product(shapes) + np.outer(tip, tip) + rotary
        damping = 2 * 0.025 * product(shapes) + 2 * eta_i * stiffness
        damping = damping + 2 * 0.0025 * np.outer(tip, tip) + 2 * 0.05 * np.outer(turn, turn)
        moving = damping - 2j * self.speed * gyroscopic * rotary
        held = (1 - 2j * eta_i * self.speed) * stiffness
        inverse = np.linalg.inv(inertia)
        a = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ held, -inverse @ moving]])
        self.free = np.block([[a.real, -a.imag], [a.imag, a.real]])
        zero = np.zeros(n)
        self.z = np.array([[*tip, *zero, *zero, *zero], [*zero, *zero, *tip, *zero]])
        self.v = np.array([[*zero, *tip, *zero, *zero], [*zero, *zero, *zero, *tip]])
        pull = inverse @ tip
        self.push = np.array([[*zero, *pull, *zero, *zero], [*zero, *zero, *zero, *pull]]).T
        self.kappa, self.eta = 4.087e6 * 0.7**3 / 1649.336143, 0.06
        self.gap, self.friction = 0.0075 / 0.7, 0.1
        self.angles = np.pi / 3 + 2 * np.pi / 3 * np.arange(3)
        self.static = np.linalg.solve(stiffness, tip)
        self.static /= tip @ self.static
        self.pieces: dict = {}

    def start(self, radius: float, rate: float) -> np.ndarray:
        q = radius * self.static
        return np.concatenate([q, 0 * q, 0 * q, rate * q])

    def piece(self, active: tuple[int, ...]):
        """Equilibrium, eigenvalues, eigenvectors, their inverse, and events `rows x + offset`."""
        if active not in self.pieces:
            a, c = self.free.copy(), np.zeros(len(self.free))
            rows, offset = [], []
            for k, angle in enumerate(self.angles):
                out = np.array([np.cos(angle), np.sin(angle)])
                load = self.kappa * out @ self.z + self.eta * out @ self.v
                if k in active:
                    way = out + self.friction * np.array([-out[1], out[0]])
                    a -= self.push @ np.outer(way, load)
                    c += self.push @ way * self.kappa * self.gap
                rows.append(-load if k in active else out @ self.z)  # lift-off, touch-down
                offset.append(self.kappa * self.gap if k in active else -self.gap)
            values, vectors = np.linalg.eig(a)
            inverse = np.linalg.inv(vectors)
            rest = -np.linalg.solve(a, c)
            self.pieces[active] = rest, values, vectors, inverse, np.array(rows), np.array(offset)
        return self.pieces[active]

    def run(self, x: np.ndarray, time: float, look: float = 7e-4) -> list[tuple[float, int]]:
        """Times and stops of all touch-downs."""
        t, active, touched = 0.0, (), []
        tau = look * np.arange(1, 41)
        while t < time:
            rest, values, vectors, inverse, rows, offset = self.piece(active)
            c = inverse @ (x - rest)
            gains, base = (rows @ vectors) * c, rows @ rest + offset
            g = (gains @ np.exp(np.outer(values, tau))).real + base[:, None]
            before = np.concatenate([(rows @ x + offset)[:, None], g[:, :-1]], axis=1)
            crossed = (g > 0) & (before <= 1e-14)
            u, stop = tau[-1], None
            if crossed.any():
                j = int(np.argmax(crossed.any(axis=0)))
                found = []
                for k in np.flatnonzero(crossed[:, j]):
                    value = lambda u, e=values, c=gains[k], b=base[k]: (c @ np.exp(e * u)).real + b
                    low = look * j if value(look * j) < 0 else look * j + 1e-9
                    found.append((brentq(value, low, look * (j + 1), xtol=1e-15), int(k)))
                u, stop = min(found)
            x = rest + (vectors @ (c * np.exp(values * u))).real
            t += u
            if stop is not None:
                if stop not in active:
                    touched.append((t, stop))
                active = tuple(sorted(set(active) ^ {stop}))
        return touched


def located_rate(start: tuple[float, float], gyroscopic: float) -> float:
    """Whirl rate of the settled backward rub: -2 pi / 3 between neighbouring touch-downs."""
    oracle = Oracle(gyroscopic=gyroscopic)
    touched = oracle.run(oracle.start(*start), 400 * 2 * np.pi / 15)
    times, stops = np.array([t for t, _ in touched[-200:]]), [k for _, k in touched[-200:]]
    assert all((a - b) % 3 == 1 for a, b in zip(stops, stops[1:], strict=False))
    assert np.ptp(np.diff(times)) < 1e-8
    return -(2 * np.pi / 3) * 199 / (times[-1] - times[0]) / 15


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "start", "rate"),
    [("right", (0.012, -10.0), -0.56762695), ("reversed", (0.02, -13.9), -0.91840269)],
)
def test_rub_agrees_with_contacts_located_exactly(name, start, rate):
    """Eight nodes cost 3e-5 of the rate; ten leave 1e-6, and steps of order 2 another 1e-5."""
    exact = located_rate(start, -1.0 if name == "reversed" else 1.0)
    assert exact == pytest.approx(rate, abs=2e-8)
    for order, bound in ((4, 2e-6), (2, 1e-5)) if name == "right" else ((4, 2e-6),):
        z = np.asarray(rub(name, order).displacement[:, 0])
        assert whirl_rate(z, 512) == pytest.approx(exact, abs=bound)


# === solvers among themselves


@pytest.mark.slow
def test_explicit_and_implicit_parts_agree_on_a_rub():
    """A stop that begins smoothly; sharp ones: `test_moderate_stiffness_against_an_implicit_solver`."""
    stop = jr.Limiter(0.5, 0.0, 7e-3, 4e5, 20.0, 0.2, rim_radius=0.1, blend=2e-4)
    numbers = {"mass": 10.0, "damping": 60.0, "stiffness": 1e5, "speed": 50.0}
    rotor, start = one_disc(stop, eccentricity=1e-3, **numbers), jr.Whirl(8e-3, -75.0)
    fine = jr.simulate(rotor, 2, 4096, solver=jr.Exponential(4), start=start)
    assert (np.abs(np.asarray(fine.contact_force)) > 0).any()
    control = dfx.PIDController(rtol=1e-9, atol=1e-12)
    how = {"solver": dfx.KenCarp4(), "controller": control, "max_steps": 65536}
    z = np.asarray(jr.simulate(rotor, 2, 64, start=start, **how).displacement)
    want = np.asarray(fine.displacement)[::64]
    assert abs(z - want).max() < 1e-6 * abs(want).max()


# === order


BLEND, STOP, SLIP = 1e-3, 4e5, 132.0  # [m], [N/m], [m/s]


def smooth_scene() -> jr.Scene:
    """A rotor whose weight keeps it pressed on a stop below, inside the blends of both laws."""
    stop = jr.Limiter(
        LENGTH, -np.pi / 2, 0.0, STOP, 300.0, 0.3, rim_radius=0.1, blend=BLEND, slip=SLIP
    )
    keep = [e for e in RIGHT.effects if not isinstance(e, jr.Limiter)]
    shaft = jr.FlexibleShaft(LENGTH, 0.02, nodes=4, constraints=[jr.Constraint(0.0, "clamp")])
    built = jr.Scene(shaft, *keep, jr.Gravity(), stop, spin=jr.ConstantSpeed(300.0))
    return built.replace({"unbalance.eccentricity": 2e-5})


def smooth_force(z: complex, v: complex) -> complex:
    """The blended law of a stop at the angle -pi / 2, within both blends."""
    depth, rate = -z.imag, -v.imag
    u = depth / BLEND
    rise = lambda u: u**3 * (6 - 8 * u + 3 * u**2)
    force = STOP * (depth + BLEND * (rise(u) - u)) + 300.0 * rate * u**3 * (10 - 15 * u + 6 * u**2)
    share = force / (STOP * BLEND)
    force = force + STOP * BLEND * (rise(share) - share)
    slip = (300.0 * 0.1 + v.real) / SLIP  # tangent of the stop is x
    grip = slip * (15 - 10 * slip**2 + 3 * slip**4) / 8
    assert 0 < u < 1
    assert 0 < share < 1
    assert abs(slip) < 1
    return -force * (1 + 0.3j * grip) * -1j


@functools.cache
def smooth_reference() -> tuple[jr.Continued, np.ndarray]:
    """A state well inside the smooth regime, and the state two revolutions later by scipy."""
    built = smooth_scene()
    # Sink into the stop slowly: the equilibrium is the start.
    settled = jr.simulate(built, 400, 256, keep=1, start=jr.Whirl(5e-4, angle=-np.pi / 2)).end
    start = jr.Continued(settled.q * 1.1, settled.velocity * 1.5)
    a, inertia, row, column, steady, turning = map(np.asarray, _matrices(built))
    n, column = row.size, np.linalg.solve(inertia, column)

    def field(theta, y):
        force = smooth_force(row @ y[:n], 300.0 * row @ y[n:])
        load = steady + turning * np.exp(1j * theta) + column * force / 300.0**2
        return a @ y + np.concatenate([0 * load, load])

    y = np.concatenate([start.q, start.velocity / 300.0])
    end = solve_ivp(field, (0, 4 * np.pi), y, method="DOP853", rtol=1e-12, atol=1e-16)
    return start, row @ end.y[:n, -1]


@eqx.filter_jit
def _matrices(built: jr.Scene):
    system = jr.assemble(built)
    motion, line = Motion(system, jnp.asarray(300.0)), system.line
    assert motion.constant is not None
    assert motion.unbalance is not None
    loads = (part[0] + 1j * part[1] for part in (motion.constant, motion.unbalance))
    at = jnp.asarray(LENGTH)
    return motion.matrix(), system.blocks.inertia, line.row(at), line.column(at), *loads


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_order_on_a_smooth_motion(order):
    start, exact = smooth_reference()
    steps = np.array([32, 128])
    errors = []
    for count in steps.tolist():
        r = jr.simulate(smooth_scene(), 2, count, solver=jr.Exponential(order), start=start, keep=1)
        errors.append(abs(complex(r.displacement[-1, 0]) - exact))
    slope = np.log(errors[0] / errors[1]) / np.log(steps[1] / steps[0])
    assert slope == pytest.approx(order, abs=0.25)


@pytest.mark.slow
def test_adaptive_solver_meets_scipy_on_a_smooth_motion():
    start, exact = smooth_reference()
    r = jr.simulate(smooth_scene(), 2, 32, solver=dfx.Tsit5(), start=start)
    assert abs(complex(r.displacement[-1, 0]) - exact) < 1e-9
    control = dfx.PIDController(rtol=1e-10, atol=1e-13)
    r = jr.simulate(smooth_scene(), 2, 32, solver=dfx.Tsit5(), start=start, controller=control)
    assert abs(complex(r.displacement[-1, 0]) - exact) < 1e-12
