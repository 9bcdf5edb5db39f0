"""The reference Pioneer against the world frame, energy, and the numbers that follow from the paper's tables."""

import numpy as np
import pytest

from reference.excitation import experiment
from reference.logs import simulate
from reference.pioneer import PARAMETERS, PIONEER, mass_and_bias

FRICTIONLESS = {"Cs": 0.0, "Cv": 0.0, "Cs1": 0.0, "Cv1": 0.0, "KT": 0.0, "KE": 0.0, "tau_fr": 0.0}


NAMES = list(PARAMETERS)


def vector(**changes):
    return np.array(list({**PARAMETERS, **changes}.values()))


def reduced(beta, eta, p):
    J, g = np.empty((2, 2)), np.empty(2)
    mass_and_bias(beta, eta[0], eta[1], p, p[NAMES.index("xm")], J, g)
    return J, g


def world_motions(q, p):
    """World-frame motions of all bodies per unit eta, scaled by sqrt(mass or inertia): rows of a matrix (rows, 2)."""
    theta, beta = q[2], q[3]
    c = dict(zip(NAMES, p, strict=True))
    d, l1, L, R, R1 = (c[name] for name in ("d", "l1", "L", "R", "R1"))
    beta_row = np.array([-np.sin(beta) / d, -(d + l1 * np.cos(beta)) / d])
    S = np.array([[-np.sin(theta), 0], [np.cos(theta), 0], [0, 1], beta_row])

    def position(q, point, arm):
        turn, turned = np.exp(1j * q[2]), np.exp(1j * (q[2] + q[3]))
        return q[0] + 1j * q[1] + turn * (point[0] + 1j * point[1]) - 1j * arm * turned

    rows = []
    for mass, point, arm in (
        (c["M"], (c["xm"], c["ym"]), 0.0),
        (c["m"], (L, 0), 0.0),
        (c["m"], (-L, 0), 0.0),
        (c["m1"], (0, -l1), d),
    ):
        jacobian = np.array(
            [(position(q + h, point, arm) - position(q - h, point, arm)) / 2e-6 for h in 1e-6 * np.eye(4)]
        )
        velocity = np.asarray(jacobian @ S)
        rows += [np.sqrt(mass) * np.real(velocity), np.sqrt(mass) * np.imag(velocity)]
    rows += [np.sqrt(c["I0"] + 2 * c["Ip"]) * S[2], np.sqrt(c["Ip1"]) * (S[2] + S[3])]
    rows += [np.sqrt(c["Ir"]) * np.array([1 / R, sign * L / R]) for sign in (1, -1)]
    rows += [np.sqrt(c["Ir1"]) * np.array([np.cos(beta) / R1, -l1 * np.sin(beta) / R1])]
    return np.array(rows), S


@pytest.mark.parametrize("beta", [-2.0, 0.3, 1.4])
def test_inertia_and_bias_agree_with_newtons_law_in_the_world_frame(beta):
    p = vector(xm=0.03, ym=-0.05)
    eta, q = np.array([0.7, -1.9]), np.array([0.2, -0.4, 0.9, beta])
    J, g = reduced(beta, eta, p)
    motions, S = world_motions(q, p)
    h, rate = 1e-5, S @ eta
    change = (world_motions(q + h * rate, p)[0] - world_motions(q - h * rate, p)[0]) / (2 * h)
    np.testing.assert_allclose(J, motions.T @ motions, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(g, motions.T @ change @ eta, rtol=1e-4, atol=1e-4)  # nested differences


def test_wheel_contacts_do_not_slip():
    d, l1, beta, eta = PARAMETERS["d"], PARAMETERS["l1"], 0.8, np.array([0.5, -1.2])
    beta_dot = -np.sin(beta) / d * eta[0] - (d + l1 * np.cos(beta)) / d * eta[1]
    centre = np.array([d * np.sin(beta), -l1 - d * np.cos(beta)])
    velocity = np.array([0, eta[0]]) + eta[1] * np.array([-centre[1], centre[0]])
    velocity += beta_dot * d * np.array([np.cos(beta), np.sin(beta)])
    assert abs(velocity @ [np.cos(beta), np.sin(beta)]) < 1e-14  # nothing along the caster's axle


def test_printed_inertias():
    assert reduced(0.0, (0, 0), vector())[0][0, 0] == pytest.approx(17.078, abs=5e-4)
    assert reduced(-np.pi / 2, (0, 0), vector())[0][1, 1] == pytest.approx(0.42418, abs=5e-6)


@pytest.mark.parametrize("start", [{3: 0.4, 4: 0.8, 5: 1.5}, {3: 3.0, 4: 0.6, 5: -0.2}])  # the second flips the caster
def test_energy_is_conserved_without_friction_and_voltage(start):
    robot = PIONEER.with_parameters(**FRICTIONLESS, xm=0.02)
    run = simulate(robot, np.zeros((301, 2)), 0.02, start=start, rtol=1e-12, atol=1e-14)
    p = vector(xm=0.02)
    energy = np.array([x[4:6] @ reduced(x[3], x[4:6], p)[0] @ x[4:6] / 2 for x in run.states])
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    assert np.ptp(run.states[:, 3]) > 0.3


def test_work_and_losses_add_up_to_the_kinetic_energy():
    inputs = experiment("pioneer", "turning", 601, seed=3)
    fine = np.repeat(inputs, 100, axis=0)
    run = simulate(PIONEER, fine, 0.0002)
    c, x = PARAMETERS, run.states
    beta, eta1, eta2 = x[:, 3], x[:, 4], x[:, 5]
    phi_dot = np.stack((eta1 + c["L"] * eta2, eta1 - c["L"] * eta2), 1) / c["R"]
    beta_dot = -(np.sin(beta) * eta1 + (c["d"] + c["l1"] * np.cos(beta)) * eta2) / c["d"]
    gear = c["tr"] * c["mu"]
    friction = c["Cs"] + gear * c["tau_fr"]

    def power(voltage):
        drive = gear * c["KT"] * (voltage - c["KE"] * c["tr"] * phi_dot) / c["Ra"]
        wheel = drive * phi_dot - c["Cv"] * phi_dot**2 - friction * np.abs(phi_dot)
        return wheel.sum(1) - c["Cv1"] * beta_dot**2 - c["Cs1"] * np.abs(beta_dot)

    work = np.sum(0.5 * (power(fine)[:-1] + power(np.vstack((fine[:1], fine[:-1])))[1:]) * 0.0002)
    kinetic = x[-1, 4:6] @ reduced(beta[-1], x[-1, 4:6], vector())[0] @ x[-1, 4:6] / 2
    assert kinetic > 1.0 and abs(work - kinetic) < 1e-5 * kinetic


def test_sticks_below_break_away_and_starts_above():
    c = PARAMETERS
    breakaway = (c["Cs"] / (c["tr"] * c["mu"]) + c["tau_fr"]) * c["Ra"] / c["KT"]
    assert breakaway == pytest.approx(0.86, abs=0.005)
    below = simulate(PIONEER, np.full((500, 2), breakaway - 1e-6), 0.02)
    above = simulate(PIONEER, np.full((500, 2), breakaway + 1e-6), 0.02)
    assert not below.states[:, :8].any() and not below.modes.any()
    assert 0 < above.speeds[-1, 0] < 1e-6


def test_one_wheel_can_stick_while_the_other_turns_about_it():
    run = simulate(PIONEER, np.tile([2.0, 0.3], (200, 1)), 0.02)
    assert run.modes[50, 1] == 0 and run.modes[50, 0] == 1
    np.testing.assert_allclose(run.states[50:, 4], PARAMETERS["L"] * run.states[50:, 5], rtol=1e-9)


def test_terminal_speed_and_time_constants():
    run = simulate(PIONEER, np.full((300, 2), 12.0), 0.02)
    final = run.speeds[-1, 0]
    assert final == pytest.approx(1.68, abs=0.005)
    np.testing.assert_allclose(run.speeds[:, 0], final * (1 - np.exp(-4.396 * run.t)), atol=2e-4)
    assert not run.speeds[:, 1].any()


def test_caster_settles_where_its_pivot_stops_turning():
    robot = PIONEER.with_parameters(ym=0.0, Cs1=0.0)
    run = simulate(robot, np.tile([4.0, -4.0], (500, 1)), 0.02)
    settled = np.degrees(-np.arccos(-PARAMETERS["d"] / PARAMETERS["l1"]))
    assert settled == pytest.approx(-99.6, abs=0.01)
    # the caster's rolling keeps a little forward speed from the transient only
    assert np.degrees(run.states[-1, 3]) == pytest.approx(settled, abs=0.05)


def test_centre_of_mass_pulls_the_turning_robot_backwards():
    run = simulate(PIONEER, np.tile([4.0, -4.0], (500, 1)), 0.02)
    assert run.speeds[-1, 0] < -0.05 and run.speeds[-1, 1] > 2
