"""A curve of the resistance of the body: one that is a step at standstill is dry friction, and no drag, nor is a wall at the
fastest, of which friction has none either."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import DifferentialDrive
from jaxid.effects import effect_by_id
from jaxid.effects.curve import SHAPE, is_wall

ROBOT = DifferentialDrive()
LAW = effect_by_id(ROBOT, "quadratic_drag", SHAPE)


def with_drag(resistance):
    """A robot whose drag is `resistance(share)` at each share of its speed."""
    heights = {LAW.height(place): float(resistance(LAW.places[place])) for place in LAW.varying}
    return (ROBOT + LAW).with_values(**heights)


@pytest.mark.parametrize(
    "resistance", [lambda x: 0.0, lambda x: x**2, lambda x: x**3 - x, lambda x: 2.0 * x**1.5, lambda x: x**4, np.sin]
)
def test_what_grows_with_the_speed_is_drag_whatever_straight_line_another_has(resistance):
    assert LAW.doubt(with_drag(resistance)) == ""


@pytest.mark.parametrize("resistance", [lambda x: -0.9, lambda x: -0.9 + 0.1 * x, lambda x: -1.0 + np.exp(-x / 0.1)])
def test_a_step_at_standstill_is_dry_friction(resistance):
    assert LAW.doubt(with_drag(resistance)) == "its curve is a step at standstill, as dry friction is"


@pytest.mark.parametrize(
    "resistance", [lambda x: x**12, lambda x: 190.0 * max(x - 0.8, 0.0) ** 2 - 0.3 * x * (1.0 - x)]
)
def test_what_is_there_at_the_fastest_alone_is_where_something_limits_the_speed(resistance):
    said = LAW.doubt(with_drag(resistance))
    assert said.startswith("its curve is a wall at ") and said.endswith("limits the speed")


def test_a_speed_governor_is_no_friction_that_differs_by_direction():
    law = effect_by_id(ROBOT, "asymmetric_viscous_friction", SHAPE)
    heights = {law.height(k, "forward"): float(law.places[k] == 1.0) for k in law.varying}
    robot = (ROBOT + law).with_values(**heights)
    assert "forward is a wall at" in law.doubt(robot)
    # Of a curve that the logs do not go to the end of, only the part where they go says anything.
    slower = replace(robot, scales=replace(robot.scales, fastest=0.7 * robot.scales.speed))
    assert law.doubt(slower) == ""


def test_a_governor_of_one_way_is_seen_where_that_way_ends():
    law = effect_by_id(ROBOT, "asymmetric_viscous_friction", SHAPE).denser
    own = ROBOT.scales.speed
    scales = replace(ROBOT.scales, fastest=own, fastest_by_way={"forward": 0.75 * own, "backward": own})
    robot = replace(ROBOT, scales=scales) + law
    wall = {law.height(k, "forward"): {0.85: 12.0, 1.0: -60.0}.get(law.places[k], 0.0) for k in law.varying}
    assert law.doubt(robot.with_values(**wall)).startswith(f"its curve forward is a wall at {0.75 * own:.3g} ")
    # Beyond where a way goes, its curve says nothing.
    beyond = {law.height(k, "forward"): law.places[k] + (law.places[k] == 1.0) for k in law.varying}
    assert law.doubt(robot.with_values(**beyond)) == ""


def test_what_drives_at_the_fastest_is_no_wall():
    x = np.linspace(0.0, 1.0, 101)
    assert is_wall(x, x**8) and not is_wall(x, -(x**8)) and not is_wall(x, x**3)
