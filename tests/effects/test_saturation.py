"""Limits of commands: of each input its own, where a controller cuts off one velocity command and not the others."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, explain, output_error
from jaxid.effects import effect_by_id
from jaxid.robots.probe import Seen
from jaxid.simulation.scaled import scaled_to

NAMES, GAINS, TIMES = ("vx", "vy", "w"), (0.97, 0.9, 0.93), (0.12, 0.14, 0.1)
LARGEST, NOISE, DT = (0.7, 0.5, 1.5), (0.01, 0.01, 0.02), 0.02
BASE = Custom(
    dynamics=lambda s, u, p: {n: (p[f"k_{n}"] * u[f"c_{n}"] - s[n]) / p[f"t_{n}"] for n in NAMES},
    state_names=NAMES,
    own_channels=Channels(
        tuple(f"c_{n}" for n in NAMES), NAMES, units={"w": "rad/s", "c_w": "rad/s", "c_vx": "m/s", "c_vy": "m/s"}
    ),
    table={f"{of}_{n}": Parameter(v, "", free=True, lower=1e-3) for of, v in (("k", 1.0), ("t", 0.15)) for n in NAMES},
    velocities=NAMES,
    turning="w",
    title="base",
)


def logs(seeds, seconds=20.0):
    """A base with three inner loops of first order, simulated in closed form; its controller cuts c_vx at +0.45 m/s."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        count = int(seconds / DT)
        command = np.stack([np.repeat(rng.uniform(-a, a, count // 25 + 1), 25)[:count] for a in LARGEST], axis=1)
        acting = np.column_stack([np.minimum(command[:, 0], 0.45), command[:, 1:]])
        speed = np.zeros((count, 3))
        for k in range(count - 1):
            kept = np.exp(-DT / np.array(TIMES))
            speed[k + 1] = kept * speed[k] + (1.0 - kept) * np.array(GAINS) * acting[k]
        speed += rng.normal(size=speed.shape) * NOISE
        outputs = dict(zip(NAMES, speed.T, strict=True))
        found.append(Log.from_arrays(f"run {seed}", DT * np.arange(count), command, outputs, BASE.channels))
    return LogSet(found)


def test_each_input_is_cut_off_at_its_own_limits():
    law = effect_by_id(BASE, "voltage_saturation", "per_motor")
    robot = BASE + law
    numbers = robot.parameters.numbers | {law.key("inverse_limit_forward_c_vx"): 1 / 0.45}
    inputs = jnp.array([[0.7, 0.7, 0.7], [-0.7, -0.7, -0.7]])
    limited = np.asarray(law.command(inputs, None, None, numbers, robot))
    np.testing.assert_allclose(limited, [[0.45, 0.7, 0.7], [-0.7, -0.7, -0.7]])
    # What is tried are shares of what each of them reaches.
    seen = scaled_to(BASE, logs([1]))
    first = law.probes(seen, Seen(1.5, 20.0, lambda: None, lambda by_torque: ((), 0)))[0]
    for name, largest in zip(("c_vx", "c_vy"), LARGEST[:2], strict=True):
        key = law.key(f"inverse_limit_forward_{name}")
        assert first.limits[key] == pytest.approx(largest, rel=0.1) and first.strengths[key] > 1 / first.limits[key]


@pytest.mark.slow
def test_a_governor_of_one_command_is_its_limit_and_no_gain_of_the_others():
    fit = output_error(BASE, logs([1, 2, 3]))
    found = explain(fit, logs([1, 2, 3]), logs([8, 9]))
    assert found.verdict == "named" and [effect.id for effect in found.effects] == ["voltage_saturation"]
    assert found.effects[0].law == "per_motor"
    limit = found.final.parameters["voltage_saturation.inverse_limit_forward_c_vx"]
    assert abs(1.0 / limit.value - 0.45) < 0.01
    for name, gain in zip(NAMES, GAINS, strict=True):
        own = found.final.parameters[f"k_{name}"]
        assert abs(own.value - gain) < 4.0 * own.std_error
