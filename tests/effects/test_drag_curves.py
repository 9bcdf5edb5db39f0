"""A curve of the resistance of the body: one that is a step at standstill is dry friction, and no drag."""

import numpy as np
import pytest

from jaxid import DifferentialDrive
from jaxid.effects import effect_by_id
from jaxid.effects.curve import SHAPE

ROBOT = DifferentialDrive()
LAW = effect_by_id(ROBOT, "quadratic_drag", SHAPE)


def with_drag(resistance):
    """A robot whose drag is `resistance(share)` at each share of its speed."""
    heights = {LAW.height(place): float(resistance(LAW.places[place])) for place in LAW.varying}
    return (ROBOT + LAW).with_values(**heights)


@pytest.mark.parametrize(
    "resistance", [lambda x: 0.0, lambda x: x**2, lambda x: x**3 - x, lambda x: 2.0 * x**1.5, np.sin]
)
def test_what_grows_with_the_speed_is_drag_whatever_straight_line_another_has(resistance):
    assert LAW.doubt(with_drag(resistance)) == ""


@pytest.mark.parametrize("resistance", [lambda x: -0.9, lambda x: -0.9 + 0.1 * x, lambda x: -1.0 + np.exp(-x / 0.1)])
def test_a_step_at_standstill_is_dry_friction(resistance):
    assert LAW.doubt(with_drag(resistance)) == "its curve is a step at standstill, as dry friction is"
