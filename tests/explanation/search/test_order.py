"""jaxid/explanation/search/order.py: in which order names stand, on trials that are nothing but their scores."""

from types import SimpleNamespace

import pytest

from jaxid import DifferentialDrive
from jaxid.effects import effect_by_id
from jaxid.explanation.search.order import by_what_holds, rather_first, with_more


def trial(name, score, left=1.0, robot=None, law=""):
    effect = robot.effects[-1] if robot is not None else None
    held_out = SimpleNamespace(normalised_rms=left, diverged=())
    return SimpleNamespace(id=name, law=law, score=score, held_out=held_out, robot=robot, effect=effect)


def both_ways(forward, backward):
    """A drive with friction by direction, curves through such heights."""
    robot = DifferentialDrive()
    robot = robot + effect_by_id(robot, "asymmetric_friction", "shape")
    values = {f"asymmetric_friction.at_{k}_forward": h for k, h in enumerate(forward, start=1)}
    return robot.with_values(**values, **{f"asymmetric_friction.at_{k}_backward": h for k, h in enumerate(backward, 1)})


def test_a_curve_that_leads_astray_on_other_logs_hides_no_law_that_holds_there():
    base = trial("", 900.0, left=3.9)
    curve, formula = trial("battery_sag", 100.0, 96.0, law="shape"), trial("battery_sag", 300.0, 2.0, law="sum")
    heating, limit = trial("motor_heating", 200.0, 2.8), trial("traction_limit", 400.0, 2.9)
    found = by_what_holds([[curve, formula], [heating], [limit]], base)
    assert [own[0] for own in found] == [heating, formula, limit] and found[1] == [formula, curve]


def test_mechanisms_whose_first_law_holds_stay_in_their_order():
    base = trial("", 900.0, left=3.9)
    first, second = trial("stribeck_friction", 120.0), trial("sublinear_viscous_friction", 110.0)
    none = [trial("actuator_dead_zone", 800.0, 4.1), trial("actuator_dead_zone", 850.0, 4.0)]
    assert by_what_holds([[first], [second], none], base) == [[first], [second], none]


def test_what_is_added_later_comes_first_only_if_it_is_best():
    first, second, third = trial("a", 120.0), trial("b", 110.0), trial("c", 300.0)
    other, best = trial("d", 115.0), trial("e", 90.0)
    assert with_more([first, second, third], [other]) == [first, second, other, third]
    assert with_more([first, second, third], [best])[0] is best


@pytest.mark.parametrize("alike", [True, False])
def test_friction_by_direction_that_is_the_same_both_ways_is_not_first(alike):
    rise = (3.0, 2.0, 1.0, 0.5)
    robot = both_ways(rise, rise if alike else (-3.0, -2.0, -1.0, -0.5))
    ways, drag = trial("asymmetric_friction", 100.0, robot=robot), trial("quadratic_drag", 101.0)
    ranked, same = rather_first([ways, drag], ["quadratic_drag"], "asymmetric_friction")
    assert ranked[0] is (drag if alike else ways)
    assert same == (("asymmetric_friction",) if alike else ("quadratic_drag",))


def test_the_name_whose_curve_it_is_comes_first():
    ways = trial("asymmetric_friction", 100.0, robot=both_ways((3.0, 2.0, 1.0, 0.5), (3.0, 2.0, 1.0, 0.5)))
    drag, stribeck = trial("quadratic_drag", 101.0), trial("stribeck_friction", 102.0)
    ranked, same = rather_first([ways, drag, stribeck], ["quadratic_drag", "stribeck_friction"], "stribeck_friction")
    assert ranked[0] is stribeck and same == ("asymmetric_friction", "quadratic_drag")


def limited(mechanism, heights):
    """A drive that loses so much of its commands, by the curve of a dead zone or of a saturation."""
    robot = DifferentialDrive()
    robot = robot + effect_by_id(robot, mechanism, "shape")
    values = {f"{mechanism}.at_{k}": height for k, height in enumerate(heights, start=1)}
    return robot.with_values(**values, **{f"{mechanism}.reach": robot.scales.input})


@pytest.mark.parametrize("bends", [True, False])
def test_a_curve_of_one_formula_that_bends_as_the_first_is_no_other_name(bends):
    late, early = (0.0, 0.0, 0.02, 0.3), (0.3, 0.32, 0.34, 0.34)
    first = trial("voltage_saturation", 100.0, robot=limited("voltage_saturation", late))
    other = trial("actuator_dead_zone", 101.0, robot=limited("actuator_dead_zone", late if bends else early))
    lag = trial("motor_lag", 102.0)
    ranked, same = rather_first([first, other, lag], ["actuator_dead_zone", "motor_lag"], "")
    assert ranked == [first, other, lag]
    assert same == (("motor_lag",) if bends else ("actuator_dead_zone", "motor_lag"))
