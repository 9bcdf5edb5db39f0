"""jaxid/explanation/named_effects.py: which wheel a number in a parameter's name is."""

import numpy as np

from jaxid import DifferentialDrive, Omni, Wheel, Wheeled
from jaxid.effects import effect_by_id
from jaxid.explanation.named_effects import _which_axes


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
