"""jaxid/explanation/named_effects.py: which wheel a number in a parameter's name is, and what is named beside an effect."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxid import DifferentialDrive, Omni, Pioneer, Wheel, Wheeled
from jaxid.effects import effect_by_id
from jaxid.explanation.named_effects import _equivalent, _which_axes


def test_the_wheels_that_parameters_count_are_called_as_the_robot_calls_them():
    law = effect_by_id(DifferentialDrive(), "asymmetric_friction", "between_axes")
    assert _which_axes(law, DifferentialDrive()) == " (1 is the right wheel, 2 is the left wheel)"
    angles = {"front": 0.0, "left_rear": 120.0, "right_rear": 240.0}
    wheels = tuple(
        Wheel(name, (0.1 * np.cos(np.radians(a)), 0.1 * np.sin(np.radians(a))), rolls=a + 90.0, kind="omni")
        for name, a in angles.items()
    )
    kiwi = Wheeled(wheels=wheels)
    assert _which_axes(law, kiwi) == " (1 is front, 2 is left rear, 3 is right rear)"
    assert _which_axes(effect_by_id(kiwi, "sensor_scale"), kiwi) == ""
    drag = effect_by_id(Omni(), "quadratic_drag", "per_axis")
    assert _which_axes(drag, Omni()) == ""


def tried(law, left):
    """A trial of the Pioneer with that law of an effect, which leaves so much of the held-out logs."""
    robot = Pioneer() + law
    return SimpleNamespace(id=law.id, effect=law, robot=robot, held_out=SimpleNamespace(normalised_rms=left))


@pytest.mark.parametrize(("left", "jittering", "alike"), [(1.46, 1.461, True), (1.46, 1.6, False), (1.0, 1.001, False)])
def test_a_mean_may_be_that_of_delays_which_differ_where_more_than_noise_is_left(left, jittering, alike):
    lag = effect_by_id(Pioneer(), "sensor_lag", "moving_average_per_channel")
    trials = tried(lag, left), tried(effect_by_id(Pioneer(), "sensor_delay", "jittering"), jittering)
    step = SimpleNamespace(chosen=trials[0], trials=trials, equivalent=())
    found = _equivalent(lag, step, Pioneer(), SimpleNamespace(robot=trials[0].robot), False)
    assert found == (("sensor_delay",) if alike else ())


def test_what_has_been_added_since_is_no_other_name_of_what_was_added_before():
    bias, drag = effect_by_id(Pioneer(), "sensor_bias"), effect_by_id(Pioneer(), "quadratic_drag")
    trials = tried(bias, 1.0), tried(drag, 1.0)
    step = SimpleNamespace(chosen=trials[0], trials=trials, equivalent=("quadratic_drag", "ground_slope"))
    both = SimpleNamespace(robot=Pioneer() + bias + drag)
    assert _equivalent(bias, step, Pioneer(), both, False) == ("ground_slope",)
    assert _equivalent(bias, step, Pioneer(), SimpleNamespace(robot=Pioneer() + bias), False) == step.equivalent


def test_a_delay_whose_curve_was_tried_as_another_lag_is_named():
    """What a trial's curve is, its own model says: the final one has none of its shares, which stopped an explanation."""
    delay = effect_by_id(Pioneer(), "input_delay")
    trials = tried(delay, 1.46), tried(effect_by_id(Pioneer(), "motor_lag", "shape"), 1.47)
    step = SimpleNamespace(chosen=trials[0], trials=trials, equivalent=())
    assert "motor_lag" not in _equivalent(delay, step, Pioneer(), SimpleNamespace(robot=trials[0].robot), False)
