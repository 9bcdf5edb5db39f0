"""jaxid/explanation/certainty/taken_for_granted.py: an axis in closed form, all of whose parameters are in proportion to its
gain."""

from jaxid import Axis, output_error
from jaxid.explanation.certainty.taken_for_granted import taken_for_granted
from jaxid.logs import noise_scale
from jaxid.simulation.scaled import scaled_to
from tests.explanation.closed_form_axis import driven


def fitted(**fixed):
    logs, _ = driven(lambda u: u, 4, count=5)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs).change("Fc", free=False)
    for name in fixed:
        robot = robot.change(name, free=False)
    return output_error(robot, logs), logs


def test_what_is_in_proportion_to_the_gain_is_said_with_a_gain_that_is_off():
    fit, logs = fitted()
    said = taken_for_granted(fit, logs, noise_scale(logs))
    assert said.startswith(
        "Errors of a per cent in the table, which these logs would not show, would move: with gain larger by 1 %, "
    )
    for name in ("M", "Fv"):
        assert f"{name} {1.01 * fit[name].value:.4g} instead of {fit[name].value:.4g} {fit[name].unit}" in said


def test_nothing_is_said_where_the_logs_would_show_it():
    """With the mass known, a gain that is off is seen."""
    fit, logs = fitted(M=1.0)
    assert taken_for_granted(fit, logs, noise_scale(logs)) == ""
