"""Delays that jitter: what they do on average, against the average of many of them."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, DifferentialDrive
from jaxid._float64 import float64
from jaxid.effects import effect_by_id
from tests.effects.at_once import measured

DT, DELAY, MANY = 0.02, 0.06, 4000
TIME = DT * np.arange(200)


def law(robot, mechanism):
    effect = effect_by_id(robot, mechanism, "jittering")
    return effect, (robot + effect).with_values(**{effect.key("delay"): DELAY}).parameters.numbers


def test_samples_late_by_a_random_time_are_on_average_a_mean():
    robot = DifferentialDrive()
    outputs = np.stack([np.sin(3.0 * TIME), np.cos(5.0 * TIME) - 1.0], axis=1)
    with float64():
        effect, p = law(robot, "sensor_delay")
        seen = measured(effect, outputs, TIME, p, robot)
    late = np.maximum(TIME[:, None] - np.random.default_rng(0).uniform(0.0, 2.0 * DELAY, (200, MANY)), 0.0)
    truth = np.stack([np.sin(3.0 * late).mean(axis=1), np.cos(5.0 * late).mean(axis=1) - 1.0], axis=1)
    assert np.max(np.abs(seen - truth)) < 5.0 * np.max(late.std(axis=1)) * 5.0 / np.sqrt(MANY)


def test_commands_late_by_a_random_time_are_on_average_a_mean():
    robot = Axis()
    rng = np.random.default_rng(1)
    levels = np.repeat(rng.uniform(-5.0, 5.0, 20), 10)
    with float64():
        effect, p = law(robot, "input_delay")
        acting = np.asarray(
            effect.command(jnp.asarray(levels[:, None]), jnp.asarray(TIME), jnp.full(200, DT), p, robot)
        )
    # When a command acts that was given in an interval, the mean over the interval of what acts in it.
    inside = TIME[:, None] + rng.uniform(0.0, DT, (200, MANY)) - rng.uniform(0.0, 2.0 * DELAY, (200, MANY))
    given = np.where(inside >= 0.0, levels[np.clip((inside / DT).astype(int), 0, 199)], 0.0)
    assert acting[:, 0] == pytest.approx(given.mean(axis=1), abs=0.35)
    assert np.sqrt(np.mean((acting[:, 0] - given.mean(axis=1)) ** 2)) < 0.1
