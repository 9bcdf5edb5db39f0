"""What changes of commands between two sets of logs, on robots that a user wrote, simulated here by small exact steps."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, explain_change, output_error

INTERVAL, STEPS, SAMPLES = 0.02, 10, 500
WHEELBASE, MASS, VISCOUS, PUSH = 0.3, 2.5, 2.0, 0.8
TIMES, GAINS = np.array([0.24, 0.15]), np.array([0.96, 1.05])

CAR = Custom(
    dynamics=lambda s, u, p: {"v": (PUSH * u["duty"] - p["viscous"] * s["v"]) / p["mass"]},
    output=lambda s, u, p: {"v": s["v"], "w": s["v"] * jnp.tan(u["steer"]) / p["wheelbase"]},
    state_names=("v",),
    own_channels=Channels(
        inputs=("duty", "steer"), outputs=("v", "w"), units={"duty": "V", "steer": "rad", "v": "m/s", "w": "rad/s"}
    ),
    table={
        "mass": Parameter(2.0, "kg", free=True),
        "viscous": Parameter(1.5, "N s/m", free=True),
        "wheelbase": Parameter(0.25, "m", free=True),
    },
    forces={"v": "mass"},
)
BASE = Custom(
    dynamics=lambda s, u, p: {
        "v": (GAINS[0] * u["forwards"] - s["v"]) / p["speed_time"],
        "w": (GAINS[1] * u["turning"] - s["w"]) / p["yaw_time"],
    },
    state_names=("v", "w"),
    own_channels=Channels(
        inputs=("forwards", "turning"),
        outputs=("v", "w"),
        units={"forwards": "m/s", "turning": "rad/s", "v": "m/s", "w": "rad/s"},
    ),
    table={"speed_time": Parameter(0.2, "s", free=True), "yaw_time": Parameter(0.2, "s", free=True)},
    forces={"v": 1.0, "w": 1.0},
)


def commands(rng, largest):
    return np.repeat(rng.uniform(-1.0, 1.0, (SAMPLES // 20, 2)), 20, axis=0) * largest


def logs(robot, make, seeds, noise):
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        given, seen = make(rng)
        seen = seen + rng.normal(size=seen.shape) * noise
        found.append(Log.from_arrays(f"run {seed}", INTERVAL * np.arange(SAMPLES), given, seen, robot))
    return LogSet(found)


def driven(trim, mass=MASS):
    """A car whose steering is off by `trim`."""

    def make(rng):
        given = commands(rng, [8.0, 0.4])
        keep, v, seen = np.exp(-INTERVAL * VISCOUS / mass), 0.0, np.zeros((SAMPLES, 2))
        for k, (duty, steer) in enumerate(given):
            seen[k] = v, v * np.tan(steer + trim) / WHEELBASE
            v = keep * v + (1.0 - keep) * PUSH * duty / VISCOUS
        return given, seen

    return make


def commanded(delay):
    """A base whose commands are all late by `delay`."""

    def make(rng):
        given, dt = commands(rng, [0.7, 1.4]), INTERVAL / STEPS
        fine = np.concatenate([np.zeros((round(delay / dt), 2)), np.repeat(given, STEPS, axis=0)])
        keep, state, seen = np.exp(-dt / TIMES), np.zeros(2), np.zeros((SAMPLES, 2))
        for k in range(SAMPLES):
            seen[k] = state
            for u in fine[k * STEPS : (k + 1) * STEPS]:
                state = keep * state + (1.0 - keep) * GAINS * u
        return given, seen

    return make


def changed(robot, make, before, after, noise):
    sets = [logs(robot, make(size), seeds, noise) for size, seeds in ((before, (1, 2, 3)), (after, (4, 5, 6)))]
    return explain_change(*(output_error(robot, own) for own in sets), *sets)


@pytest.mark.slow
def test_a_trim_that_is_off_since_is_an_error_of_steering_and_no_cross_talk():
    """A curve of the command promises more to first order than the offset that it is."""
    found = changed(CAR, driven, 0.0, 0.015, [0.01, 0.03])
    assert found.change.id == "steering_error" and found.verdict == "named"
    (trim,) = found.change.differences.values()
    assert abs(trim.size.value - 0.015) < 4.0 * trim.size.std_error


@pytest.mark.slow
def test_a_trim_beside_a_load_is_one_number_and_no_curve():
    sets = [
        logs(CAR, make, seeds, [0.01, 0.03])
        for make, seeds in ((driven(0.0), (1, 2, 3)), (driven(0.015, 3.1), (4, 5, 6)))
    ]
    found = explain_change(*(output_error(CAR, own) for own in sets), *sets)
    laws = {part.id: part.law for part in found.change.parts}
    assert found.verdict in ("named", "ambiguous") and laws.get("steering_error") == "offset" and len(laws) == 2
    numbers = found.change.differences
    (trim,) = (d for name, d in numbers.items() if "steering_error" in name)
    assert abs(trim.size.value - 0.015) < 4.0 * trim.size.std_error and trim.size.std_error < 0.005


@pytest.mark.slow
def test_commands_that_all_come_later_since_may_be_late_and_not_the_sensors_alone():
    found = changed(BASE, commanded, 0.0, 0.03, [0.01, 0.03])
    assert {found.change.id, *(own.id for own in found.equivalent)} >= {"input_delay"}
    assert {found.change.id, *(own.id for own in found.equivalent)} <= {"input_delay", "sensor_delay"}
