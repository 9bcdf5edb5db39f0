"""jaxid/explanation/certainty/hinging.py: which of the robot's own numbers another name would make another."""

from dataclasses import replace

import numpy as np

from jaxid import Axis, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.certainty.hinging import hinging, with_the_rest
from jaxid.explanation.refits.refit import refit
from jaxid.logs import noise_scale
from jaxid.simulation.scaled import scaled_to
from tests.explanation.closed_form_axis import driven


def found(free):
    """A model with a lag of its motors, which nothing calls for, in full and as a trial; `free` besides."""
    logs, held_out = driven(lambda u: u, 5)
    noise = noise_scale(held_out, otherwise=logs)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs)
    for name in ("Fc", "offset"):
        robot = robot.change(name, free=False)
    robot = robot.with_values(offset=0.0) + effect_by_id(robot, "motor_lag", "first_order")
    for name in free:
        robot = robot.change(name, free=True)
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    return output_error(robot, logs), refit(robot, [start], logs, held_out, noise, {})


def test_a_number_that_another_name_makes_another_is_told():
    final, last = found(())
    same = last.robot
    heavier = same.with_values(M=1.3)
    assert hinging(final, last, {"it is input delay": same}) == (final, "")
    wider, said = hinging(final, last, {"it is input delay": same, "it is a wrong gain": heavier})
    assert "if it is a wrong gain, M 1.3 instead of" in said and "kg" in said
    assert "Fv" not in said and "delay" not in said
    # The interval holds the other value, too, and those of what does not hinge on it stay.
    low, high = wider["M"].ci95
    assert low < final["M"].value < 1.3 < high and wider["Fv"] == final["Fv"]
    k = final.free_names.index("M")
    np.testing.assert_allclose(np.sqrt(wider.covariance[k, k]), wider["M"].std_error)


def test_a_number_at_its_bound_by_one_name_hinges_on_it_as_well():
    final, last = found(())
    bound = replace(final, parameters={**final.parameters, "Fv": replace(final["Fv"], value=0.0, status="at_bound")})
    at_zero = replace(last, robot=last.robot.with_values(Fv=0.0))
    wider, said = hinging(bound, at_zero, {"it is a wrong gain": last.robot.with_values(Fv=2.0)})
    assert "Fv 2 instead of 0" in said
    assert wider["Fv"].ci95[1] > 2.0 and wider["Fv"].status == "not_identifiable"


def test_nothing_is_said_where_the_last_trial_is_not_the_answer():
    final, last = found(())
    held = replace(last, robot=last.robot.change("M", free=False))
    assert hinging(final, held, {"it is a wrong gain": last.robot.with_values(M=1.3)}) == (final, "")


def test_nothing_is_said_beside_a_model_in_which_a_number_of_the_effect_was_free():
    """Held since, it had moved the others with it."""
    final, last = found(())
    name = "motor_lag.time_constant"
    fixed = replace(final.parameters[name], status="fixed")
    held = replace(final, parameters={**final.parameters, name: fixed})
    other = {"it is a wrong gain": last.robot.with_values(M=1.3)}
    assert hinging(held, last, other) == (held, "") and hinging(final, last, other).sentence


def test_models_that_lack_another_effect_say_nothing():
    final, last = found(())
    with_drag = replace(final, robot=final.robot + effect_by_id(final.robot, "quadratic_drag"))
    delayed = last.robot + effect_by_id(last.robot, "quadratic_drag")
    others = {"as it was": last.robot, "beside the drag": delayed}
    assert list(with_the_rest(others, "motor_lag", with_drag)) == ["beside the drag"]
    assert list(with_the_rest(others, "motor_lag", final)) == ["as it was", "beside the drag"]


def test_a_height_of_a_curve_is_not_compared_with_one_at_another_place():
    logs, held_out = driven(lambda u: u, 5)
    axis = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0), logs)
    for name in ("Fc", "offset", "Fv"):
        axis = axis.change(name, free=False)
    curve = effect_by_id(axis, "quadratic_drag", "shape")
    robot, name = axis + curve, curve.height(curve.varying[-1])
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    final = output_error(robot, logs)
    last = refit(robot, [start], logs, held_out, noise_scale(held_out, otherwise=logs), {})
    assert f"{name.split('.')[1].replace('_', ' ')} of quadratic drag 0.5 instead of" in said_of(
        final, last, robot, name
    )
    denser = axis + curve.denser
    assert name in denser.parameters and said_of(final, last, denser, name) == ""


def said_of(final, last, robot, name):
    others = last.robot.parameters
    kept = {own: others[own].value for own in robot.parameters if own in others}
    return hinging(final, last, {"it is another": robot.with_values(**{**kept, name: 0.5})}).sentence
