"""jaxid/explanation/certainty/beyond_reach.py: a soft dead band, of which ever less is lost, on an axis in closed form."""

import numpy as np
import pytest

from jaxid import Axis, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.certainty.beyond_reach import going_on_beyond
from jaxid.explanation.refits.refit import continued, refit
from jaxid.simulation.scaled import scaled_to
from tests.explanation import closed_form_axis
from tests.explanation.closed_form_axis import driven

NOISE = {"v": closed_form_axis.NOISE}


def allowed_for(law):
    """The axis behind a law of its command, fitted with a curve of what is lost, and what that allows for."""
    logs, held_out = driven(law, 11, count=4)
    robot = scaled_to(Axis().with_values(M=1.3, Fv=1.5, Fc=0.0, offset=0.0), logs)
    robot = robot.change("Fc", free=False).change("offset", free=False)
    robot = robot + effect_by_id(robot, "actuator_dead_zone", "shape")
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    last = continued(refit(robot, [start], logs, held_out, NOISE, {}), logs, held_out, NOISE)
    final = output_error(last.robot, logs)
    return final, going_on_beyond(final, last, logs, held_out, NOISE, lambda message: None)


def test_mass_and_friction_allow_for_what_is_lost_beyond_the_curves_reach():
    final, found = allowed_for(lambda u: u**3 / (u**2 + 0.5))
    assert "goes on beyond the reach" in found.sentence and "M " in found.sentence
    for name, true in (("M", 1.0), ("Fv", 2.0)):
        assert abs(final[name].value - true) > 4.0 * final[name].std_error, name
        estimate = found.final[name]
        assert estimate.value == pytest.approx(true, abs=3.0 * estimate.std_error), name
        assert estimate.std_error < 0.3 * true


def test_nothing_hangs_on_a_curve_that_is_level_where_it_ends():
    final, found = allowed_for(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.5, 0.0))
    assert not found.sentence and found.final is final
