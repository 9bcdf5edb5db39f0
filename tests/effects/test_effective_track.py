"""A track width that changes with how the robot turns: the wheels' rolling on a circle, in closed form."""

import numpy as np
import pytest

from jaxid import Pioneer, float64
from jaxid.effects import effect_by_id

WIDTH, SHARE = 0.1689, 0.1


def width(law, rate, **values):
    robot = Pioneer()
    effect = effect_by_id(robot, "effective_track", law)
    robot = (robot + effect).with_values(**{effect.key(name): value for name, value in values.items()})
    with float64():
        numbers = effect.numbers(robot.parameters.numbers, {"eta1": 0.0, "eta2": np.float64(rate)}, robot)
    return float(numbers["L"])


def test_wider_one_way_and_narrower_the_other():
    assert width("by_direction", 0.8, share=SHARE) == pytest.approx(WIDTH * (1.0 + SHARE))
    assert width("by_direction", -0.8, share=SHARE) == pytest.approx(WIDTH * (1.0 - SHARE))


def test_a_curve_of_the_yaw_rate_whichever_way():
    # Through a straight line: the share at 0.375 of the reach is 0.375 of that at its end.
    line = {f"at_{k}": SHARE * place for k, place in enumerate((0.0, 0.25, 0.5, 1.0), start=1)}
    for rate in (0.75, -0.75):
        assert width("shape", rate, **line, reach=2.0) == pytest.approx(WIDTH * (1.0 + 0.375 * SHARE))
