"""Averages over windows of every channel's own, against the means of sines."""

import numpy as np
import pytest

from jaxid import Axis, DifferentialDrive, EffectError
from jaxid._float64 import in_float64
from jaxid.effects.catalogue import effect_by_id
from tests.effects.at_once import measured


@pytest.mark.parametrize(("law", "ahead"), [("moving_average_per_channel", 0.0), ("centred_average_per_channel", 0.5)])
@in_float64
def test_every_channel_has_its_window(law, ahead):
    robot = DifferentialDrive() + effect_by_id(DifferentialDrive(), "sensor_lag", law)
    robot = robot.with_values(**{"sensor_lag.window_v": 0.13, "sensor_lag.window_w": 0.0})
    time, turns = 0.02 * np.arange(300), 3.0
    motion = np.stack([np.sin(turns * time), np.cos(5.0 * time)], axis=1)
    (effect,) = robot.effects
    shown = measured(effect, motion, time, robot.parameters.numbers, robot)
    begin, end = time - 0.13 * (1.0 - ahead), time + 0.13 * ahead
    mean = (np.cos(turns * begin) - np.cos(turns * end)) / (turns * 0.13)
    inside = slice(8, -8)
    np.testing.assert_allclose(shown[inside, 0], mean[inside], atol=5e-5)
    np.testing.assert_allclose(shown[:, 1], motion[:, 1], atol=1e-12)


def test_one_channel_has_the_plain_average():
    with pytest.raises(EffectError, match="one output"):
        Axis() + effect_by_id(DifferentialDrive(), "sensor_lag", "moving_average_per_channel")
