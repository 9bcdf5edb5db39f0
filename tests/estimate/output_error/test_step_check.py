"""A first-order lag, whose exact solution is known, sampled coarsely: long integration steps have solutions of their own."""

import math

import numpy as np
import optimistix as optx
import pytest

from jaxid import Channels, Custom, Integrator, Log, LogSet, Parameter, output_error
from jaxid.estimate.output_error import step_check
from jaxid.estimate.output_error.solvers import DEFAULT

CHANNELS = Channels(inputs=("command",), outputs=("speed",))
TRUE, INTERVAL, NOISE = 5.27e-3, 1.33e-3, 1e-3
NOTICED = 0.002
"""Relative error of a time constant that would be noticed."""


def lag(state, u, p):
    return {"speed": (u["command"] - state["speed"]) / p["T"]}


def robot(T: float) -> Custom:
    table = {"T": Parameter(T, "s", free=True, lower=0.0)}
    return Custom(dynamics=lag, state_names=("speed",), own_channels=CHANNELS, table=table, title="lag")


def sampled(true: float, noise: float) -> LogSet:
    rng = np.random.default_rng(3)
    u = np.repeat(rng.uniform(-1, 1, 20), 10)
    v = np.zeros(200)
    for k in range(199):  # exact under a held input
        v[k + 1] = u[k] + (v[k] - u[k]) * math.exp(-INTERVAL / true)
    measured = v + noise * rng.standard_normal(200)
    return LogSet([Log.from_arrays("lag", np.arange(200) * INTERVAL, u[:, None], measured[:, None], CHANNELS)])


@pytest.fixture(scope="module")
def logs() -> LogSet:
    return sampled(TRUE, NOISE)


def test_a_time_constant_of_the_integrator_is_not_taken_for_the_robots(logs: LogSet) -> None:
    """With one step a sample, Runge-Kutta's factor 1 - z + z²/2 - z³/6 + z⁴/24 at z = 2.6 is exp(-1.33 / 5.27), too."""
    z = INTERVAL / 0.000509
    assert 1 - z + z**2 / 2 - z**3 / 6 + z**4 / 24 == pytest.approx(math.exp(-INTERVAL / TRUE), abs=0.01)
    held = output_error(robot(0.6e-3), logs, integrator=Integrator(1))
    assert held["T"].value < 0.2 * TRUE  # what this is about: as close to the data, and wrong
    fit = output_error(robot(0.6e-3), logs)
    assert abs(fit["T"].value - TRUE) < 4 * fit["T"].std_error
    assert fit["T"].std_error < 0.01 * TRUE


def test_steps_that_suit_the_robot_stay(logs: LogSet) -> None:
    said: list[str] = []
    fit = output_error(robot(0.9 * TRUE), logs, report=said.append)
    assert not any("shorter" in sentence for sentence in said)
    assert fit.robot.longest_step == math.inf


@pytest.mark.parametrize(("true", "noise"), [(2e-3, 1e-3), (0.6e-3, 1e-4), (0.5e-3, 1e-4)])
def test_a_start_that_is_far_too_slow_ends_at_the_robots_time_constant(true: float, noise: float) -> None:
    """Steps are chosen for the start, which needs one a sample. What one step leaves of a fast lag is many times the noise,
    and in its units the error of four would not show."""
    logs = sampled(true, noise)
    assert Integrator.suited(robot(1.0), INTERVAL) == Integrator(1)
    held = output_error(robot(1.0), logs, integrator=Integrator(1))
    assert abs(held["T"].value - true) > NOTICED * true  # what this is about
    said: list[str] = []
    fit = output_error(robot(1.0), logs, report=said.append)
    assert any("shorter" in sentence for sentence in said)
    assert abs(fit["T"].value - true) < 4 * fit["T"].std_error
    assert fit["T"].std_error < NOTICED / 2 * true
    assert not fit.notes


def test_the_model_goes_on_with_the_steps_that_its_fit_needed() -> None:
    logs = sampled(TRUE, 1e-4)
    fit = output_error(robot(1.0), logs)
    assert fit.robot.longest_step < INTERVAL
    assert Integrator.suited(fit.robot.with_values(T=1.0), INTERVAL).substeps > 1  # whatever the rule says
    again = output_error(fit.robot, logs)
    assert abs(again["T"].value - fit["T"].value) < 0.01 * fit["T"].std_error


def test_a_log_without_noise_is_told_so_and_not_that_its_motion_is_chaotic() -> None:
    """What steps leave of it is many times the noise, which is that of rounding."""
    fit = output_error(robot(0.9 * TRUE), sampled(TRUE, 0.0))
    assert abs(fit["T"].value - TRUE) < 1e-6 * TRUE
    said = " ".join(fit.notes)
    assert "no noise to speak of" in said and "chaotic" not in said


@pytest.mark.slow
def test_shorter_steps_are_fitted_by_the_solver_that_was_given(monkeypatch) -> None:
    mine, used = optx.LevenbergMarquardt(1e-8, 1e-8), []
    own = step_check.minimise_compiled

    def noted(*problem, solver=DEFAULT, **options):
        used.append((problem[0].integrator.substeps, solver))
        return own(*problem, solver=solver, **options)

    monkeypatch.setattr(step_check, "minimise_compiled", noted)
    fit = output_error(robot(1.0), sampled(2e-3, NOISE), solver=mine)
    assert 4 in {steps for steps, _ in used}  # from one step a sample
    assert {solver for _, solver in used} == {mine}
    assert abs(fit["T"].value - 2e-3) < 4 * fit["T"].std_error
