"""jaxid/explanation/hinging.py: which of the robot's own numbers another name would make another."""

from dataclasses import replace

import numpy as np

from jaxid import Axis, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.hinging import hinging
from jaxid.explanation.refit import refit
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
    assert hinging(final, last, {"input delay": same}) == (final, "")
    wider, said = hinging(final, last, {"input delay": same, "a wrong gain": heavier})
    assert "if it is a wrong gain, M 1.3 instead of" in said and "kg" in said
    assert "Fv" not in said and "delay" not in said
    # The interval holds the other value, too, and those of what does not hinge on it stay.
    low, high = wider["M"].ci95
    assert low < final["M"].value < 1.3 < high and wider["Fv"] == final["Fv"]
    k = final.free_names.index("M")
    np.testing.assert_allclose(np.sqrt(wider.covariance[k, k]), wider["M"].std_error)


def test_nothing_is_said_where_the_last_trial_is_not_the_answer():
    final, last = found(())
    held = replace(last, robot=last.robot.change("M", free=False))
    assert hinging(final, held, {"a wrong gain": last.robot.with_values(M=1.3)}) == (final, "")
