"""A first-order lag, whose exact solution is known, sampled coarsely: long integration steps have solutions of their own."""

import math

import numpy as np
import pytest

from jaxid import Channels, Custom, Integrator, Log, LogSet, Parameter, output_error

CHANNELS = Channels(inputs=("command",), outputs=("speed",))
TRUE, INTERVAL, NOISE = 5.27e-3, 1.33e-3, 1e-3


def lag(state, u, p):
    return {"speed": (u["command"] - state["speed"]) / p["T"]}


def robot(T: float) -> Custom:
    table = {"T": Parameter(T, "s", free=True, lower=0.0)}
    return Custom(dynamics=lag, state_names=("speed",), own_channels=CHANNELS, table=table, title="lag")


@pytest.fixture(scope="module")
def logs() -> LogSet:
    rng = np.random.default_rng(3)
    u = np.repeat(rng.uniform(-1, 1, 20), 10)
    v = np.zeros(200)
    for k in range(199):  # exact under a held input
        v[k + 1] = u[k] + (v[k] - u[k]) * math.exp(-INTERVAL / TRUE)
    measured = v + NOISE * rng.standard_normal(200)
    return LogSet([Log.from_arrays("lag", np.arange(200) * INTERVAL, u[:, None], measured[:, None], CHANNELS)])


def test_a_time_constant_of_the_integrator_is_not_taken_for_the_robots(logs: LogSet) -> None:
    """With one step a sample, Runge-Kutta's factor 1 - z + z²/2 - z³/6 + z⁴/24 at z = 2.6 is exp(-1.33 / 5.27), too."""
    z = INTERVAL / 0.000509
    assert 1 - z + z**2 / 2 - z**3 / 6 + z**4 / 24 == pytest.approx(math.exp(-INTERVAL / TRUE), abs=0.01)
    held = output_error(robot(0.6e-3), logs, integrator=Integrator(1))
    assert held["T"].value < 0.2 * TRUE  # what this is about: as close to the data, and wrong
    said: list[str] = []
    fit = output_error(robot(0.6e-3), logs, report=said.append)
    assert any("shorter" in sentence for sentence in said)
    assert abs(fit["T"].value - TRUE) < 4 * fit["T"].std_error
    assert fit["T"].std_error < 0.01 * TRUE


def test_steps_that_suit_the_robot_stay(logs: LogSet) -> None:
    said: list[str] = []
    fit = output_error(robot(0.9 * TRUE), logs, report=said.append)
    assert not any("shorter" in sentence for sentence in said)
    assert fit.robot.longest_step == math.inf


def test_the_model_goes_on_with_the_steps_that_its_fit_needed(logs: LogSet) -> None:
    fit = output_error(robot(0.6e-3), logs)
    assert Integrator.suited(fit.robot, INTERVAL).substeps > 1
    again = output_error(fit.robot, logs)
    assert abs(again["T"].value - fit["T"].value) < 0.01 * fit["T"].std_error
