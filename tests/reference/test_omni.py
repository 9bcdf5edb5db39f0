"""The reference omni robot: steady states of the paper, energy, and what the turning frame adds."""

import numpy as np
import pytest

from reference.excitation import experiment, omni_wheels
from reference.logs import simulate
from reference.omni import OMNI, PARAMETERS

ONE, NONE = np.ones(1), np.zeros(1)
FREE = dict.fromkeys(("Bv", "Bvn", "Bw", "Cv", "Cvn", "Cw", "Kt", "Kv"), 0.0)


@pytest.mark.parametrize(
    ("speed", "lever", "motors", "viscous", "coulomb"),
    [("V", 1.0, 2, "Bv", "Cv"), ("Vn", 1.0, 2, "Bvn", "Cvn"), ("W", 0.195, 4, "Bw", "Cw")],
)
def test_steady_state_balances_traction_and_friction(speed, lever, motors, viscous, coulomb):
    motion = [8 * ONE if name == speed else NONE for name in OMNI.speeds]
    run = simulate(OMNI, np.repeat(omni_wheels(*motion), 500, axis=0), 0.02)
    place = OMNI.speeds.index(speed)
    v = run.speeds[-1, place]
    traction = PARAMETERS["l"] * PARAMETERS["Kt"] / PARAMETERS["r"] * np.abs(run.currents[-1]).sum() * lever
    assert np.count_nonzero(np.abs(run.currents[-1]) > 1e-9) == motors and v > 0.5
    assert traction == pytest.approx(PARAMETERS[viscous] * v + PARAMETERS[coulomb], rel=1e-7)
    assert not np.delete(run.speeds, place, axis=1).any()


def test_world_velocity_is_constant_without_forces():
    run = simulate(
        OMNI.with_parameters(**FREE), np.zeros((200, 4)), 0.02, start={3: 1.0, 4: -0.4, 5: 2.0}, rtol=1e-12, atol=1e-14
    )
    np.testing.assert_allclose(np.diff(run.states[:, :2], axis=0), np.tile([0.02, -0.008], (199, 1)), atol=1e-11)
    np.testing.assert_allclose(run.speeds[:, 2], 2.0, rtol=1e-12)


def test_energy_is_conserved_with_the_centre_of_mass_aside():
    run = simulate(
        OMNI.with_parameters(**FREE),
        np.zeros((200, 4)),
        0.02,
        {"lateral_com_offset": {"offset": 0.05}},
        start={3: 1.0, 4: -0.4, 5: 2.0},
        rtol=1e-12,
        atol=1e-14,
    )
    V, Vn, W = run.speeds.T
    energy = 35 * (V**2 + Vn**2) / 2 + 1.374 * W**2 / 2 - 35 * 0.05 * W * V
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    np.testing.assert_allclose(
        W, 2.0, rtol=1e-9
    )  # nothing turns a free body, but its origin circles the centre of mass
    assert np.ptp(V) > 1


def test_uncoupled_equations_are_the_papers():
    run = simulate(
        OMNI.with_parameters(**FREE),
        np.zeros((100, 4)),
        0.02,
        {"coriolis_coupling": {"absent": 1.0}},
        start={3: 1.0, 5: 2.0},
    )
    np.testing.assert_allclose(run.speeds, np.tile([1.0, 0.0, 2.0], (100, 1)), atol=1e-12)


def test_coast_down_stops_after_the_closed_forms_time():
    robot = OMNI.with_parameters(Kt=0.0, Kv=0.0)
    run = simulate(robot, np.zeros((2000, 4)), 0.001, start={3: 1.2})
    rate, level = 3.73 / 35, 29.45 / 3.73
    expected = np.maximum((1.2 + level) * np.exp(-rate * run.t) - level, 0)
    np.testing.assert_allclose(run.speeds[:, 0], expected, atol=1e-9)
    assert run.speeds[-1, 0] == 0 and run.events == 1


def test_inductance_tends_to_the_resistive_motor():
    inputs = experiment("omni", "steps", 150, seed=1)
    fast, slow = (simulate(OMNI.with_parameters(La=La), inputs, 0.02).speeds for La in (0.0, 1e-4))
    difference = np.abs(fast - slow).max()
    assert 1e-5 < difference < 0.01
