"""jaxid/explanation/certainty/taken_for_granted.py: an axis in closed form, all of whose parameters are in proportion to its
gain."""

from jaxid import AXIS, Axis, Custom, Parameter, output_error
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


def test_constants_beyond_those_that_are_listed_are_named():
    """Three constants of a cart, each of which a parameter makes up for, in another way."""

    def dynamics(state, inputs, p):
        resistance = (p["Fv"] + p["brush"]) * state["v"]
        return {"v": (p["gain"] * inputs["u"] - resistance) / (p["M"] + p["load"]), "q": state["v"]}

    free = {name: Parameter(value, unit, free=True, lower=0.0) for name, value, unit in
            (("M", 0.6, "kg"), ("Fv", 1.2, "N s/m"))}  # fmt: skip
    known = {"load": Parameter(0.4, "kg"), "brush": Parameter(0.8, "N s/m"), "gain": Parameter(1.0, "")}
    logs, _ = driven(lambda u: u, 4, count=5)
    fit = output_error(Custom(dynamics=dynamics, state_names=("v", "q"), own_channels=AXIS, table=free | known), logs)
    said = taken_for_granted(fit, logs, noise_scale(logs))
    listed = [name for name in known if f"with {name} " in said]
    (rest,) = set(known) - set(listed)
    assert len(listed) == 2 and said.endswith(f"; and so would, by more than standard errors say, errors of {rest}.")
