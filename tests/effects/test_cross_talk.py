"""A sensor that sees another axis, in proportion or by its size."""

import numpy as np
import pytest

from jaxid import Axis, Omni, float64
from jaxid.effects import effect_by_id
from jaxid.robots.traits import refusal
from tests.effects.at_once import measured


def test_what_is_seen_of_the_size_is_the_same_whichever_way_the_other_moves():
    robot = Omni()
    effect = effect_by_id(robot, "sensor_cross_talk", "shape")
    line = {f"sensor_cross_talk.at_{k}_V_of_W": 0.05 * place for k, place in enumerate((0.25, 0.6, 1.0), start=1)}
    model = (robot + effect).with_values(**line, **{"sensor_cross_talk.amplitude_W": 2.0})
    true = np.array([[0.3, 0.1, 1.0], [0.3, 0.1, -1.0], [0.3, 0.1, 3.0]])
    with float64():
        seen = measured(effect, true, np.arange(3.0), model.parameters.numbers, robot)
    assert seen[:, 0] - 0.3 == pytest.approx([0.025, 0.025, 0.05])  # through a straight line, level beyond it
    assert np.array_equal(seen[:, 1:], true[:, 1:])


def test_one_output_sees_no_other():
    assert "sees no other" in str(refusal(effect_by_id(Omni(), "sensor_cross_talk", "shape"), Axis()))
