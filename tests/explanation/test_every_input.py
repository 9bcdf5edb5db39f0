"""What happens to all commands alike, of the drive and of the turning, is named as such on a base that takes a twist."""

import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, explain, output_error

INTERVAL, STEPS, SAMPLES = 0.02, 20, 500
TRUE = {"speed_time": 0.24, "yaw_time": 0.15, "speed_gain": 0.96, "yaw_gain": 1.05}
CHANNELS = Channels(
    inputs=("forwards", "turning"),
    outputs=("v", "w"),
    units={"forwards": "m/s", "turning": "rad/s", "v": "m/s", "w": "rad/s"},
)


def dynamics(state, u, p):
    return {
        "v": (p["speed_gain"] * u["forwards"] - state["v"]) / p["speed_time"],
        "w": (p["yaw_gain"] * u["turning"] - state["w"]) / p["yaw_time"],
    }


TABLE = {name: Parameter(1.2 * value, "s" if "time" in name else "", free=True) for name, value in TRUE.items()}
BASE = Custom(
    dynamics=dynamics,
    state_names=("v", "w"),
    own_channels=CHANNELS,
    table=TABLE,
    plane=("v", "", "w"),
    forces={"v": 1.0, "w": 1.0},
)


def log(seed, delay):
    """First-order loops by exact small steps, of commands that arrive `delay` later."""
    rng, dt = np.random.default_rng(seed), INTERVAL / STEPS
    commands = np.repeat(rng.uniform(-1.0, 1.0, (SAMPLES // 20, 2)), 20, axis=0) * [0.7, 1.4]
    late = round(delay / dt)
    fine = np.concatenate([np.zeros((late, 2)), np.repeat(commands, STEPS, axis=0)])
    gains = np.array([TRUE["speed_gain"], TRUE["yaw_gain"]])
    keep = np.exp(-dt / np.array([TRUE["speed_time"], TRUE["yaw_time"]]))
    state, seen = np.zeros(2), np.zeros((SAMPLES, 2))
    for k in range(SAMPLES):
        seen[k] = state
        for u in fine[k * STEPS : (k + 1) * STEPS]:
            state = keep * state + (1.0 - keep) * gains * u
    seen += rng.normal(size=seen.shape) * [0.01, 0.03]
    return Log.from_arrays(f"run {seed}", INTERVAL * np.arange(SAMPLES), commands, seen, CHANNELS)


@pytest.mark.slow
def test_a_delay_of_all_commands_is_one_delay_of_the_inputs():
    logs, held_out = (LogSet([log(seed, 0.053) for seed in seeds]) for seeds in ((1, 2, 3), (4, 5)))
    found = explain(output_error(BASE, logs), logs, held_out)
    (effect,) = found.effects
    assert found.verdict in ("named", "ambiguous")
    # From rest, and linear, the same motion is commanded, or seen, later.
    assert (effect.id, effect.law) == ("input_delay", "every_input") and {*effect.equivalent_to} <= {"sensor_delay"}
    assert effect.parameters["delay"].value == pytest.approx(0.053, abs=0.003)
    for name, value in TRUE.items():
        assert found.final[name].value == pytest.approx(value, abs=3.5 * found.final[name].std_error)
