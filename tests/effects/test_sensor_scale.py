"""A curve of a sensor's scale: one by which it shows less of more is no sensor's."""

import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, DifferentialDrive, Omni, Parameter
from jaxid.effects import effect_by_id

LAW = effect_by_id(Axis(), "sensor_scale", "shape")


def with_scale(error):
    """An axis whose speed is measured `error(share)` too large at each share of its amplitude."""
    robot = Axis() + LAW
    heights = [name for name in robot.parameters.free_names if LAW.is_height(name) and name.endswith("_v")]
    return robot.with_values(**{name: float(error(x)) for name, x in zip(heights, LAW.places, strict=True)})


@pytest.mark.parametrize("error", [lambda x: 0.0, lambda x: 0.1, lambda x: -0.4 * x, lambda x: 0.5 * np.exp(-x)])
def test_a_sensor_that_is_nonlinear_shows_more_of_more(error):
    assert LAW.doubt(with_scale(error)) == ""


def test_one_that_stands_for_something_else_may_show_less():
    falling = with_scale(lambda x: 2.0 if x < 0.2 else -0.45)
    assert LAW.doubt(falling) == "by its curve v would show less of more"


def test_what_all_sensors_have_alike_may_be_held_as_another_s():
    """A gyro alone, or all others the other way round beside a smaller mass: the middle one is held."""
    scale = effect_by_id(Omni(), "sensor_scale", "each_channel")
    robot = Omni() + scale
    robot = robot.with_values(**{scale.key(f"error_{name}"): error for name, error in (("V", -0.05), ("Vn", -0.048))})
    assert scale.may_hold(robot) == ["sensor_scale.error_Vn"]
    held = robot.with_values(**{"sensor_scale.error_Vn": 0.0}).change("sensor_scale.error_Vn", free=False)
    assert scale.may_hold(held) == []
    pair = effect_by_id(Axis(), "sensor_scale", "by_direction")
    assert pair.may_hold(Axis() + pair) == []


def test_of_sensors_of_each_unit_one_may_be_held():
    """What both ammeters read too much is another resistance, whatever the encoders read."""
    names = ("nr", "nl", "ir", "il")
    robot = Custom(
        dynamics=lambda state, inputs, p: dict.fromkeys(names, p["a"] * inputs["u"]),
        state_names=names,
        own_channels=Channels(("u",), names, (), {"u": "V", "nr": "rpm", "nl": "rpm", "ir": "A", "il": "A"}),
        table={"a": Parameter(1.0, "1/s", free=True)},
    )
    scale = effect_by_id(robot, "sensor_scale", "each_channel")
    robot = (robot + scale).with_values(**{scale.key(f"error_{n}"): 0.01 * (k + 1) for k, n in enumerate(names)})
    assert scale.may_hold(robot) == [scale.key("error_nl")]
    held = robot.change(scale.key("error_nl"), free=False)
    assert scale.may_hold(held) == [scale.key("error_ir")]
    assert scale.may_hold(held.change(scale.key("error_ir"), free=False)) == []


def test_of_sensors_that_no_log_has_none_is_held():
    """Of a rover's body and wheels, v is not measured: its error stays where it was, and to hold that would hold nothing."""
    robot = DifferentialDrive(wheel_angles=True)
    scale = effect_by_id(robot, "sensor_scale", "each_channel")
    errors = {"v": 0.0, "w": -0.028, "way_right": 0.0121, "way_left": 0.012}
    robot = (robot + scale).with_values(**{scale.key(f"error_{name}"): error for name, error in errors.items()})
    assert scale.may_hold(robot) == ["sensor_scale.error_way_left"]


def test_a_curve_of_a_scale_is_no_other_unit():
    """Of a car that understeers, sensors that show four times the speed at all speeds, and a mass four times as large."""
    robot = with_scale(lambda share: 3.3 - 0.4 * share)
    assert LAW.doubt(robot).startswith("v would be in another unit, by a curve")


def test_sensors_that_are_all_in_another_unit_stand_for_something_else():
    """A tracked robot 25 times as heavy whose speeds are both shown 25 times too large; of one of them, degrees are a unit."""
    scale = effect_by_id(DifferentialDrive(), "sensor_scale", "each_channel")

    def doubt(**errors):
        robot = DifferentialDrive() + scale
        return scale.doubt(robot.with_values(**{scale.key(f"error_{name}"): error for name, error in errors.items()}))

    assert doubt(v=24.1, w=24.2).startswith("v (25.1 times) and w (25.2 times) would all be in another unit")
    assert doubt(v=0.02, w=56.3) == "" and doubt(v=0.0, w=56.3) == "" and doubt(v=-0.2, w=0.25) == ""


def test_a_sensor_that_would_show_one_way_as_the_other_is_none_of_a_scale():
    """One wheel's asymmetric dry friction had been a speed that reads -0.18 times backwards, as fact."""
    law = effect_by_id(DifferentialDrive(), "sensor_scale", "by_direction")
    model = DifferentialDrive() + law
    for backward, doubted in ((-1.18, True), (-0.95, True), (-0.4, False), (0.1, False)):
        robot = model.with_values(**{law.key("error_v"): 0.01, law.key("error_backward_v"): backward})
        said = next(e for e in robot.effects if e.id == law.id).doubt(robot)
        assert bool(said) == doubted and ("v would show nothing" in said) == doubted
