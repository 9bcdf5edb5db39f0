"""The velocity-controlled omni against what is known in closed form, and against figures 10-12 in words."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid.papers.omni.closed_loop import VelocityController, closed_loop
from jaxid.robots import Omni

P = Omni().parameters.numbers
PER_AMPERE = P["l"] * P["Kt"] / P["r"]  # N at the rim


@pytest.fixture(scope="module")
def runs():
    return {axis: closed_loop(np.eye(3)[j]) for j, axis in enumerate(("V", "Vn", "W"))}


def reached(run, column, level):
    return run.time[np.flatnonzero(run.speeds[:, column] >= level)[0]]


@pytest.mark.parametrize("axis, column, motors", [("V", 0, (3, 1)), ("Vn", 1, (0, 2))])
def test_translation_looks_like_figures_10_and_11(runs, axis, column, motors):
    run, (plus, minus) = runs[axis], motors
    assert 0.85 < reached(run, column, 0.98) < 1.05  # the paper's figures: about 0.9-1 s
    assert np.max(run.speeds[:, column]) < 1.02
    assert np.max(np.abs(run.currents)) < 6.0 + 1e-9
    assert np.max(np.abs(run.duty)) <= 255.0
    assert run.duty[0, plus] == 255.0 and run.duty[0, minus] == -255.0  # saturated at the start
    np.testing.assert_allclose(run.currents[:, plus], -run.currents[:, minus], atol=1e-9)
    others = [j for j in range(3) if j != column]
    assert np.max(np.abs(run.speeds[:, others])) < 1e-9  # straight on


def test_rise_with_5_and_a_half_ampere_has_the_slope_of_figure_10():
    run = closed_loop((1.0, 0.0, 0.0), controller=VelocityController(current_limit=5.5))
    slope = (run.speeds[1, 0] - run.speeds[0, 0]) / 0.02
    assert slope == pytest.approx((66.0 - 29.45) / 35.0, rel=2e-3)  # 1.04 m/s^2
    rising = run.time <= 0.8
    friction = P["Cv"] / P["Bv"]
    final = 2 * PER_AMPERE * 5.5 / P["Bv"] - friction
    exact = final * (1 - np.exp(-P["Bv"] / P["M"] * run.time[rising]))
    np.testing.assert_allclose(run.speeds[rising, 0], exact, atol=2e-3)


@pytest.mark.parametrize("limit", [4.0, 6.0])
def test_driver_holds_its_current_limit_while_the_robot_rises(limit):
    run = closed_loop((1.0, 0.0, 0.0), controller=VelocityController(current_limit=limit))
    slope = np.diff(run.speeds[:6, 0]) / 0.02
    expected = (2 * PER_AMPERE * limit - P["Cv"] - P["Bv"] * run.speeds[:5, 0]) / P["M"]
    np.testing.assert_allclose(slope, expected, rtol=5e-3)


def test_turning_looks_like_figure_12(runs):
    run = runs["W"]
    assert reached(run, 2, 0.95) < 0.5 * reached(runs["V"], 0, 0.95)  # much faster than V and Vn
    assert np.max(np.abs(run.currents)) < 2.5
    assert np.max(np.abs(run.duty)) < 255.0  # "the motors do not saturate easily"
    for other in (1, 2, 3):
        np.testing.assert_allclose(run.currents[:, other], run.currents[:, 0], atol=1e-9)


@pytest.mark.parametrize(
    "axis, column, motor, expected",
    [
        ("V", 0, 3, (P["Bv"] + P["Cv"]) / (2 * PER_AMPERE)),
        ("Vn", 1, 0, (P["Bvn"] + P["Cvn"]) / (2 * PER_AMPERE)),
        ("W", 2, 0, (P["Bw"] + P["Cw"]) / (4 * P["b"] * PER_AMPERE)),
    ],
)
def test_steady_currents_are_the_frictions(axis, column, motor, expected):
    run = closed_loop(np.eye(3)[column], duration=8.0)
    assert run.speeds[-1, column] == pytest.approx(1.0, abs=1e-4)  # the integral action leaves no error
    assert run.currents[-1, motor] == pytest.approx(expected, rel=1e-3)
    volts = P["Ra"] * expected + P["Kv"] * P["l"] / P["r"] * (P["b"] if axis == "W" else 1.0)
    assert run.duty[-1, motor] == pytest.approx(255 * volts / P["supply"], rel=1e-3)


def test_proportional_control_leaves_the_error_that_friction_asks_for():
    gain = 600.0
    run = closed_loop((1.0, 0.0, 0.0), controller=VelocityController(integral=(0.0, 0.0, 0.0)), duration=4.0)

    def missing(V):  # duty that the error gives minus duty that the speed V takes
        volts = P["Ra"] * (P["Bv"] * V + P["Cv"]) / (2 * PER_AMPERE) + P["Kv"] * P["l"] / P["r"] * V
        return gain * (1 - V) - 255 * volts / P["supply"]

    slope = missing(1.0) - missing(0.0)
    assert run.speeds[-1, 0] == pytest.approx(-missing(0.0) / slope, rel=1e-4)


def test_inductance_changes_next_to_nothing():
    without = closed_loop((0.8, 0.0, 1.0))
    with_it = closed_loop((0.8, 0.0, 1.0), robot=Omni(inductance=True))
    np.testing.assert_allclose(with_it.speeds, without.speeds, atol=5e-3)
    # A current just before the new duty acts is the one the last interval ended with: compare where duty is steady.
    np.testing.assert_allclose(with_it.currents[-5:], without.currents[-5:], atol=0.02)


def test_loop_agrees_with_a_simulation_by_scipy():
    """The whole loop once more, for V alone, with SciPy's integrator and the driver limiting at every instant."""
    control = VelocityController()
    run = closed_loop((1.0, 0.0, 0.0), controller=control, substeps=16)

    def right(_, y, duty):
        emf = P["Kv"] * P["l"] / P["r"] * y[0]
        i = np.clip((duty / 255 * P["supply"] - emf) / P["Ra"], -control.current_limit, control.current_limit)
        return [(2 * PER_AMPERE * i - P["Bv"] * y[0] - P["Cv"]) / P["M"]]  # it never stops or sticks on the way up

    V, memory, speeds = 0.0, 0.0, []
    for _ in run.time:
        speeds.append(V)
        raw = control.proportional[0] * (1 - V) + memory
        if abs(raw) <= 255:
            memory += control.integral[0] * 0.02 * (1 - V)
        V = solve_ivp(right, (0, 0.02), [V], args=(np.clip(raw, -255, 255),), rtol=1e-9, atol=1e-11).y[0, -1]
    np.testing.assert_allclose(run.speeds[:, 0], speeds, atol=1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_loop_agrees_with_the_independent_simulation_of_the_figures(axis):
    """What figures 10-12 draw as real comes from other equations, another integrator and a controller written apart."""
    pytest.importorskip("numba", reason="the independent simulator needs numba")
    from reference.omni import OMNI
    from reference.velocity_control import VelocityControl, controlled_log

    apart, own = VelocityControl(encoder_noise=(0.0, 0.0, 0.0)), VelocityController()
    assert (apart.proportional, apart.integral) == (own.proportional, own.integral)
    assert (apart.current_limit, apart.sampling) == (own.current_limit, own.sampling)
    table, _ = controlled_log(OMNI, np.tile(np.eye(3)[axis], (76, 1)), (0.0, 0.0, 0.0), 0, 0.0, apart)
    run = closed_loop(np.eye(3)[axis])
    np.testing.assert_allclose(run.speeds, table[["V", "Vn", "W"]], atol=1e-3)
    np.testing.assert_allclose(run.currents, table[["i1", "i2", "i3", "i4"]], atol=0.05)
    np.testing.assert_allclose(run.duty / 255 * 24, table[["u1", "u2", "u3", "u4"]], atol=0.06)


def test_a_reference_that_reverses_is_followed():
    reference = np.zeros((200, 3))
    reference[:100, 1], reference[100:, 1] = 0.6, -0.6
    run = closed_loop(reference)
    assert run.speeds[99, 1] == pytest.approx(0.6, abs=0.01) and run.speeds[-1, 1] == pytest.approx(-0.6, abs=0.01)


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: closed_loop([1.0, 0.0]), "shape"),
        (lambda: closed_loop(np.full((10, 3), np.nan)), "finite"),
        (lambda: closed_loop([1.0, 0.0, 0.0], substeps=0), "substeps"),
        (lambda: closed_loop([1.0, 0.0, 0.0], duration=0.0), "two or more"),
        (lambda: VelocityController(current_limit=0.0), "current_limit = 0"),
        (lambda: VelocityController(proportional=(1.0, -1.0, 1.0)), "none negative"),
    ],
)
def test_requests_that_cannot_be_met(call, words):
    with pytest.raises(ValueError, match=words):
        call()
