"""Curves that no law of their mechanism is: a Stribeck curve that falls towards standstill, one that goes up and down."""

import numpy as np
import pytest

from jaxid import Axis
from jaxid.effects import effect_by_id
from jaxid.effects.curve import SHAPE, is_jagged


def with_excess(*heights):
    law = effect_by_id(Axis(), "stribeck_friction", SHAPE)
    robot = Axis() + law
    return law, robot.with_values(**{law.key(f"at_{k + 1}"): height for k, height in enumerate(heights)})


@pytest.mark.parametrize(
    ("heights", "contrary"),
    [((3.0, 2.0, 1.0, 0.3), False), ((-0.2, 2.0, 1.0, 0.3), False), ((-3.0, -2.0, -1.0, -0.3), True)],
)
def test_friction_that_falls_towards_standstill_is_no_stribeck_friction(heights, contrary):
    """One height at standstill, of a curve that rises otherwise, is hardly known."""
    law, robot = with_excess(*heights)
    assert bool(law.doubt(robot)) == contrary


def test_many_points_close_to_standstill_do_not_outvote_the_rest():
    """Of LuGre friction in noise: the first of sixteen points, 3 mm/s apart, was as large as all others, of the other sign."""
    law = effect_by_id(Axis(), "stribeck_friction", SHAPE)
    for _ in range(2):
        law = law.denser
    robot = Axis() + law
    heights = (-6.9, 0.6, -1.6, -1.4, 1.4, -1.2, 1.0, 1.0, 0.9, 0.8, 0.7, 0.5, 0.5, 0.4, 0.1, 0.5)
    robot = robot.with_values(**{law.height(k): h for k, h in zip(law.varying, heights, strict=True)})
    assert law.doubt(robot) == ""
    falling = robot.with_values(**{law.height(k): -abs(h) for k, h in zip(law.varying, heights, strict=True)})
    assert law.doubt(falling)


def test_what_goes_up_and_down_again_and_again_is_no_law_of_one_variable():
    jagged = np.array([0.0, -22.0, -17.6, -26.2, -5.2, -34.9, -7.4, -37.1, -8.3])
    smooth = np.array([0.0, 4.0, 7.0, 8.0, 6.0, 3.0, 4.0, 2.0, 0.0])
    for errors in (np.full(9, np.inf), np.full(9, 0.5)):
        assert is_jagged(jagged, errors) and not is_jagged(smooth, errors)
    assert not is_jagged(jagged, np.full(9, 8.0))  # by chance


@pytest.mark.parametrize("effect", ["traction_limit", "voltage_saturation"])
def test_a_limit_that_gives_more_of_what_is_large_is_none(effect):
    law = effect_by_id(Axis(), effect, SHAPE)
    robot = Axis() + law
    heights = [law.height(place) for place in law.varying]
    largest = robot.parameters[law.key("reach")].value
    losing = robot.with_values(**dict(zip(heights, [0.0, 0.0, 0.05 * largest, 0.2 * largest], strict=True)))
    assert law.doubt(losing) == ""
    # In small things a share of the whole may be another gain; at the end a limit has taken more than that.
    giving = robot.with_values(**dict(zip(heights, [0.0, -0.1 * largest, -0.2 * largest, -0.3 * largest], strict=True)))
    assert law.doubt(giving) == "its curve gives more of what is large, where a limit takes of it"


def test_a_dead_zone_loses_of_the_command_and_gives_nothing():
    law = effect_by_id(Axis(), "actuator_dead_zone", SHAPE)
    robot = Axis() + law
    heights = [law.height(place) for place in law.varying]
    lost = robot.with_values(**dict(zip(heights, [0.2, 0.5, 0.5, 0.4], strict=True)))
    given = robot.with_values(**dict(zip(heights, [0.2, -1.0, -3.0, -5.0], strict=True)))
    assert law.doubt(lost) == "" and law.doubt(given) == "its curve gives more than is commanded"
