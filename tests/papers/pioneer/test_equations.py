"""The Pioneer's equations against mechanics derived again here by automatic differentiation, and against the paper.

Nothing in the first half knows a matrix of the paper: bodies at positions, their kinetic energy, the velocities of the
contact points, and Lagrange's equations with multipliers solved as one linear system.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid._float64 import float64
from jaxid.papers.pioneer import equations as eq
from jaxid.robots import pioneer_closed_form as closed
from tests.pioneer_numbers import FREE, ON_THE_SPOT, PAPER


@pytest.fixture(autouse=True)
def double_precision():
    with float64():
        yield


def random_cases(n=40, seed=20060, base=PAPER):
    """States, speeds, voltages and parameters, all different: each parameter up to a factor of about 3 from print."""
    rng = np.random.default_rng(seed)
    p = {name: value * np.exp(rng.uniform(-1.1, 1.1, n)) for name, value in base.items()}
    p |= {"xm": rng.uniform(-0.1, 0.1, n), "ym": rng.uniform(-0.2, 0.2, n)}
    q, qdot = rng.uniform(-3, 3, (n, 7)), rng.normal(size=(n, 7))
    return q, qdot, rng.normal(size=(n, 2)) * [1.0, 2.0], rng.uniform(-12, 12, (n, 2)), p


def over(function):
    return jax.jit(jax.vmap(function))


def rotate(angle, vector):
    return jnp.array([[jnp.cos(angle), -jnp.sin(angle)], [jnp.sin(angle), jnp.cos(angle)]]) @ jnp.stack(vector)


def wheel_centres(q, p):
    right, left = (q[:2] + rotate(q[2], (side * p["L"], 0.0)) for side in (1.0, -1.0))
    pivot = q[:2] + rotate(q[2], (0.0, -p["l1"]))
    return jnp.stack([pivot + rotate(q[2] + q[3], (0.0, -p["d"])), right, left])


def energy_of_bodies(q, qdot, p):
    def mass_points(q):
        return jnp.concatenate([(q[:2] + rotate(q[2], (p["xm"], p["ym"])))[None], wheel_centres(q, p)])

    _, velocities = jax.jvp(mass_points, (q,), (qdot,))
    masses = jnp.stack([p["M"], p["m1"], p["m"], p["m"]])
    upright = (p["I0"] + 2 * p["Ip"]) * qdot[2] ** 2 + p["Ip1"] * (qdot[2] + qdot[3]) ** 2
    spin = p["Ir1"] * qdot[4] ** 2 + p["Ir"] * (qdot[5] ** 2 + qdot[6] ** 2)
    return 0.5 * (masses @ jnp.sum(velocities**2, axis=1) + upright + spin)


def contact_slip(q, qdot, p):
    """Velocity [m/s] of the material points that touch the floor: sideways and along each wheel, 3 x 2."""
    _, velocities = jax.jvp(lambda at: wheel_centres(at, p), (q,), (qdot,))
    angles = jnp.stack([q[2] + q[3], q[2], q[2]])
    radii = jnp.stack([p["R1"], p["R"], p["R"]])
    axle = jnp.stack([jnp.cos(angles), jnp.sin(angles)], axis=1)
    ahead = jnp.stack([-jnp.sin(angles), jnp.cos(angles)], axis=1)
    sideways = jnp.sum(axle * velocities, axis=1)
    return jnp.stack([sideways, jnp.sum(ahead * velocities, axis=1) - radii * qdot[4:]], axis=1)


def independent_slip(q, qdot, p):
    """The five independent slips in the order of A: the driving wheels share their sideways slip."""
    slip = contact_slip(q, qdot, p)
    return jnp.stack([slip[1, 0], slip[1, 1], slip[2, 1], slip[0, 0], slip[0, 1]])


def inertia_force(q, qdot, p):
    """d/dt(dT/dqdot) - dT/dq without its term in the acceleration: eq. 19."""
    _, rate = jax.jvp(lambda at: jax.grad(energy_of_bodies, 1)(at, qdot, p), (q,), (qdot,))
    return rate - jax.grad(energy_of_bodies, 0)(q, qdot, p)


def rolling_acceleration(q, qdot, force, p):
    """Generalised acceleration (7,) under a generalised force and rolling, by Lagrange's multipliers."""
    mass = jax.hessian(energy_of_bodies, 1)(q, qdot, p)
    slope = jax.jacfwd(independent_slip, 1)(q, qdot, p)
    _, turning = jax.jvp(lambda at: independent_slip(at, qdot, p), (q,), (qdot,))
    system = jnp.block([[mass, -slope.T], [slope, jnp.zeros((5, 5))]])
    return jnp.linalg.solve(system, jnp.concatenate([force - inertia_force(q, qdot, p), -turning]))[:7]


# ---- the equations against mechanics ----


def test_inertia_matrix_is_the_hessian_of_kinetic_energy():
    q, qdot, _, _, p = random_cases()
    np.testing.assert_allclose(over(eq.M)(q, p), over(jax.hessian(energy_of_bodies, 1))(q, qdot, p), atol=1e-12)
    np.testing.assert_allclose(over(eq.kinetic_energy)(q, qdot, p), over(energy_of_bodies)(q, qdot, p), rtol=1e-12)


def test_coriolis_is_lagrange_and_passive():
    q, qdot, _, _, p = random_cases()
    matrix = over(eq.C)(q, qdot, p)
    expected = over(inertia_force)(q, qdot, p)
    np.testing.assert_allclose(jnp.einsum("nij,nj->ni", matrix, qdot), expected, rtol=1e-10, atol=1e-11)
    rate = over(lambda q, v, p: jax.jvp(lambda at: eq.M(at, p), (q,), (v,))[1])(q, qdot, p)
    skew = rate - 2 * matrix
    np.testing.assert_allclose(skew, -jnp.swapaxes(skew, 1, 2), atol=1e-11)


def test_constraints_are_the_slip_of_the_contact_points():
    q, qdot, eta, _, p = random_cases()
    jacobian = over(jax.jacfwd(independent_slip, 1))(q, qdot, p)
    np.testing.assert_allclose(over(eq.A)(q, p), jacobian, atol=1e-13)
    assert np.all(np.linalg.matrix_rank(np.asarray(jacobian)) == 5)
    np.testing.assert_allclose(over(lambda q, p: eq.A(q, p) @ eq.S(q, p))(q, p), 0.0, atol=1e-13)
    rolling = over(lambda q, e, p: contact_slip(q, eq.S(q, p) @ e, p))(q, eta, p)  # all six, the shared one twice
    np.testing.assert_allclose(rolling, 0.0, atol=1e-13)


def test_velocity_map_carries_eta():
    q, _, eta, _, p = random_cases()
    qdot = over(lambda q, e, p: eq.S(q, p) @ e)(q, eta, p)
    forward = -np.sin(q[:, 2]) * qdot[:, 0] + np.cos(q[:, 2]) * qdot[:, 1]
    np.testing.assert_allclose(np.stack([forward, qdot[:, 2]], 1), eta, atol=1e-14)


def test_reduced_inertia_is_positive_definite():
    q, _, _, _, p = random_cases(200)
    reduced = np.asarray(over(eq.J)(q, p))
    np.testing.assert_allclose(reduced[:, 0, 1], reduced[:, 1, 0], atol=1e-12)
    assert np.linalg.eigvalsh(reduced).min() > 0.0


def test_acceleration_is_that_of_lagrange_with_multipliers():
    q, _, eta, voltage, p = random_cases()

    def by_multipliers(q, eta, V, p):
        qdot = eq.S(q, p) @ eta
        sign = jnp.sign(qdot)
        motor = p["mu"] * p["tr"] * (p["KT"] * (V - p["KE"] * p["tr"] * qdot[5:]) / p["Ra"] - p["tau_fr"] * sign[5:])
        rubbing = p["Cs"] * sign[5:] + p["Cv"] * qdot[5:]
        pivot = p["Cs1"] * sign[3] + p["Cv1"] * qdot[3]
        force = jnp.zeros(7).at[5:].set(motor - rubbing).at[3].set(-pivot)
        qddot = rolling_acceleration(q, qdot, force, p)
        return jnp.stack([p["R"] * (qddot[5] + qddot[6]) / 2, qddot[2]])

    expected = over(by_multipliers)(q, eta, voltage, p)
    np.testing.assert_allclose(over(eq.acceleration)(q, eta, voltage, p), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("offset", [0.0, 0.08])
def test_kinetic_energy_is_conserved_without_friction_and_voltage(offset):
    p = FREE | {"xm": offset}
    step = jax.jit(lambda z: jnp.concatenate([eq.S(z[:7], p) @ z[7:], eq.acceleration(z[:7], z[7:], jnp.zeros(2), p)]))
    start = np.array([0.0, 0.0, 0.4, 0.7, 0.0, 0.0, 0.0, 0.6, 1.5])
    run = solve_ivp(lambda _, z: np.asarray(step(z)), (0, 5), start, method="DOP853", rtol=1e-12, atol=1e-12)
    energy = over(lambda z: energy_of_bodies(z[:7], eq.S(z[:7], p) @ z[7:], p))(run.y.T)
    assert np.ptp(run.y[7]) > 0.1 and np.ptp(run.y[3]) > 0.5  # it does move from one form to another
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)


def test_power_balance_with_friction_and_voltage():
    q, _, eta, voltage, p = random_cases()

    def energy_rate(q, eta, V, p):
        flow = (eq.S(q, p) @ eta, eq.acceleration(q, eta, V, p))
        return jax.jvp(lambda q, e: energy_of_bodies(q, eq.S(q, p) @ e, p), (q, eta), flow)[1]

    def motor_and_friction_power(q, eta, V, p):
        rates = eq.S(q, p) @ eta
        lost = p["Cs"] * jnp.abs(rates[5:]) + p["Cv"] * rates[5:] ** 2
        pivot = p["Cs1"] * jnp.abs(rates[3]) + p["Cv1"] * rates[3] ** 2
        return eq.motor_torque(V, rates[5:], p) @ rates[5:], jnp.sum(lost) + pivot

    motor, lost = over(motor_and_friction_power)(q, eta, voltage, p)
    np.testing.assert_allclose(over(energy_rate)(q, eta, voltage, p), motor - lost, rtol=1e-9, atol=1e-9)
    assert np.all(lost > 0)


def test_double_precision_without_the_global_flag():
    with jax.enable_x64(False):
        assert eq.M(np.zeros(7), PAPER).dtype == np.float64
        assert eq.acceleration(np.zeros(7), np.array([0.1, 0.2]), np.array([3.0, 2.0]), PAPER).dtype == np.float64


# ---- what the print gets wrong ----


def printed_velocity_map(q, p):
    return eq.S(q, p).at[3].multiply(-1.0)


def test_printed_velocity_map_slips_at_the_caster():
    q, _, eta, _, p = random_cases()
    slip = np.abs(over(lambda q, e, p: contact_slip(q, printed_velocity_map(q, p) @ e, p))(q, eta, p))
    assert np.all(slip[:, 0, 0] > 1e-3) and np.allclose(slip[:, 1:], 0.0, atol=1e-13)


def test_printed_velocity_map_trails_in_reverse():
    def pull_towards_trailing(velocity_map, speed):  # d(beta_dot)/d(beta) at beta = 0: stable where negative
        return jax.grad(lambda b: (velocity_map(jnp.zeros(7).at[3].set(b), PAPER) @ jnp.array([speed, 0.0]))[3])(0.0)

    assert pull_towards_trailing(eq.S, 0.5) < 0 < pull_towards_trailing(eq.S, -0.5)
    assert pull_towards_trailing(printed_velocity_map, -0.5) < 0 < pull_towards_trailing(printed_velocity_map, 0.5)


def test_printed_velocity_map_adds_to_a22():
    mass = eq.M(ON_THE_SPOT, PAPER)
    printed, corrected = (s.T @ mass @ s for s in (printed_velocity_map(ON_THE_SPOT, PAPER), eq.S(ON_THE_SPOT, PAPER)))
    excess = 4 * PAPER["Ip1"] + 4 * PAPER["d"] ** 2 * PAPER["m1"]
    assert corrected[1, 1] == pytest.approx(1 / closed.turning_coefficients(PAPER).a22, rel=1e-12)
    assert printed[1, 1] - corrected[1, 1] == pytest.approx(excess, rel=1e-10)


def test_printed_sign_of_inertia_13_moves_the_centre_of_mass():
    # A platform alone, pivoting about its own centre of mass at (0, ym): nothing but spin energy.
    p = PAPER | dict(m=0.0, m1=0.0, Ip1=0.0, Ip=0.0)
    spin = np.array([p["ym"], 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    corrected = eq.M(np.zeros(7), p)
    printed = corrected.at[[0, 2], [2, 0]].add(2 * p["M"] * p["ym"])
    assert 0.5 * spin @ corrected @ spin == pytest.approx(0.5 * p["I0"], rel=1e-12)
    assert 0.5 * spin @ printed @ spin == pytest.approx(0.5 * p["I0"] + 2 * p["M"] * p["ym"] ** 2, rel=1e-12)


def test_printed_inertia_33_lacks_the_driving_wheels():
    rigid = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    printed = eq.M(np.zeros(7), PAPER).at[2, 2].add(-2 * PAPER["Ip"])
    missing = energy_of_bodies(jnp.zeros(7), rigid, PAPER) - 0.5 * rigid @ printed @ rigid
    assert missing == pytest.approx(PAPER["Ip"], rel=1e-9)
    s = eq.S(ON_THE_SPOT, PAPER)
    from_print = (s.T @ eq.M(ON_THE_SPOT, PAPER).at[2, 2].add(-2 * PAPER["Ip"]) @ s)[1, 1]
    assert 1 / closed.turning_coefficients(PAPER).a22 - from_print == pytest.approx(2 * PAPER["Ip"], rel=1e-9)


def test_printed_motor_friction_drives_a_wheel_that_turns_backwards():
    coasting = PAPER | {"KE": 0.0}
    corrected = eq.motor_torque(0.0, np.array([5.0, -5.0]), coasting)
    assert np.all(corrected * np.array([5.0, -5.0]) < 0)  # takes power in both directions
    printed = -coasting["tr"] * coasting["mu"] * coasting["tau_fr"]  # eq. 28 at V = 0
    assert printed * 5.0 < 0 < printed * -5.0
