"""A current that was read before, or after, the command of its own row was applied, on an axis in closed form."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, output_error
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.left.row_before import at_once, row_before

DT, R, KE, M, B = 0.02, 1.2, 2.0, 3.0, 1.5
UNITS = {"u": "V", "v": "m/s", "i": "A"}
MOTOR = Custom(
    dynamics=lambda s, u, p: {"v": (p["k"] * (u["u"] - KE * s["v"]) / R - p["B"] * s["v"]) / p["M"]},
    output=lambda s, u, p: {"v": s["v"], "i": (u["u"] - KE * s["v"]) / R},
    state_names=("v",),
    own_channels=Channels(inputs=("u",), outputs=("v", "i"), units=UNITS),
    table={"M": Parameter(2.5, "kg", free=True), "B": Parameter(1.0, "N s/m", free=True), "k": Parameter(2.0, "N/A")},
)


def runs(before, count=4):
    logs, rate = [], (2.0 * KE / R + B) / M
    for seed in range(count):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.uniform(-6.0, 6.0, 40), 15)
        v = np.zeros(len(u))
        for k in range(len(u) - 1):
            end = 2.0 * u[k] / R / M / rate
            v[k + 1] = end + (v[k] - end) * np.exp(-rate * DT)
        acting = np.concatenate([[0.0], u[:-1]]) if before else u
        outputs = {"v": v + 0.01 * rng.normal(size=len(u)), "i": (acting - KE * v) / R + 0.02 * rng.normal(size=len(u))}
        logs.append(Log.from_arrays(f"run {seed}", DT * np.arange(len(u)), u, outputs, MOTOR.channels))
    return LogSet(logs[:-1]), LogSet(logs[-1:])


def test_a_current_hangs_on_the_input_of_its_row_and_a_speed_does_not():
    assert at_once(MOTOR) == ("i",)


@pytest.mark.parametrize("before", [True, False])
def test_a_current_that_was_read_before_its_rows_command_is_said_to_be(before):
    logs, held_out = runs(before)
    fit = output_error(MOTOR, logs)
    said = row_before(fit.robot, held_out, held_out_state(fit.robot, held_out))
    assert ("Move that column one row up" in said) == before
    assert said.startswith("Most of what is left of i (") == before


CAR = Custom(
    dynamics=lambda s, u, p: {"v": (p["k"] * u["u"] - s["v"]) / 0.5},
    output=lambda s, u, p: {"v": s["v"], "w": s["v"] * jnp.tan(u["steer"]) / 0.33},
    state_names=("v",),
    own_channels=Channels(inputs=("u", "steer"), outputs=("v", "w"), units={"steer": "rad", "v": "m/s", "w": "rad/s"}),
    table={"k": Parameter(0.4, "m/(V s)", free=True)},
)


def drives(before):
    logs = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        u, steer = np.repeat(rng.uniform(2.0, 8.0, 20), 30), np.repeat(rng.uniform(-0.3, 0.3, 60), 10)
        v = np.zeros(600)
        for k in range(599):
            v[k + 1] = 0.5 * u[k] + (v[k] - 0.5 * u[k]) * np.exp(-DT / 0.5)
        acting = np.concatenate([[0.0], steer[:-1]]) if before else steer
        outputs = {"v": v, "w": v * np.tan(acting) / 0.33}
        seen = {name: own + 0.02 * rng.normal(size=600) for name, own in outputs.items()}
        logs.append(Log.from_arrays(f"{seed}", DT * np.arange(600), {"u": u, "steer": steer}, seen, CAR.channels))
    return LogSet(logs[:-1]), LogSet(logs[-1:])


@pytest.mark.parametrize("before", [True, False])
def test_a_yaw_rate_of_a_car_that_is_steered_at_once_is_told_by_the_speed_times_what_changes(before):
    """It hangs on the steering of its row while the car drives, and not while it stands."""
    assert at_once(CAR) == ("w",)
    logs, held_out = drives(before)
    fit = output_error(CAR, logs)
    said = row_before(fit.robot, held_out, held_out_state(fit.robot, held_out))
    assert said.startswith("Most of what is left of w (") == ("one row up" in said) == before
