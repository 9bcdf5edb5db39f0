"""What a newcomer gets wrong in Python: every error says what was given and what to give instead, before anything is fitted."""

import os

import numpy as np
import pandas as pd
import pytest

import jaxid
from jaxid import Axis, Log, LogError, LogSet, Omni, ParameterError

pytestmark = pytest.mark.skipif(
    bool(os.environ.get("JAXID_CHECK_ANNOTATIONS")), reason="the annotations' checker refuses these first"
)

ESTIMATORS = [
    jaxid.integral_least_squares,
    jaxid.instrumental_variables,
    jaxid.output_error,
    jaxid.prediction_error,
    jaxid.multi_start,
    jaxid.output_error_problem,
    jaxid.simulate,
]
every_estimator = pytest.mark.parametrize("estimate", ESTIMATORS, ids=lambda function: function.__name__)


@pytest.fixture(scope="module")
def logs() -> LogSet:
    return LogSet([Log.from_arrays("a", np.arange(50) * 0.02, np.ones((50, 1)), np.ones((50, 1)), "axis")])


@every_estimator
def test_a_robot_must_be_a_robot(estimate, logs):
    with pytest.raises(TypeError, match=r"'axis' is no robot; give an object such as"):
        estimate("axis", logs)
    with pytest.raises(TypeError, match=r"Axis'> is no robot; give an object such as Axis\(\)"):
        estimate(Axis, logs)


@every_estimator
def test_logs_must_be_logs_of_the_robot(estimate, logs):
    with pytest.raises(TypeError, match=r"'a.csv' is no set of logs; give what read_logs returns"):
        estimate(Axis(), "a.csv")
    with pytest.raises(TypeError, match=r"a is a single log; give LogSet\(\[log\]\)"):
        estimate(Axis(), logs[0])
    with pytest.raises(
        TypeError, match=r"place 0 of the logs has a DataFrame, no Log; make one of its columns with Log\."
    ):
        estimate(Axis(), [pd.DataFrame({"t": [0.0, 0.1]})])
    with pytest.raises(LogError, match=r"a has the columns \['u', 'v', 'q'\] and the robot 'omni' has \['u1',"):
        estimate(Omni(), logs)


def test_a_list_of_logs_is_as_good_as_a_set(axis_log):
    """For whatever takes logs; and what needs names says so."""
    robot, inputs = Axis(), np.repeat([3.0, -2.0, 1.0, -1.5], 25)
    short = [axis_log(name, np.roll(inputs, 30 * k), 0.01, k, position=False) for k, name in enumerate("ab")]
    logs = LogSet(short)
    fit = jaxid.output_error(robot, short, integrator=jaxid.Integrator(2))
    assert fit["M"] == jaxid.output_error(robot, logs, integrator=jaxid.Integrator(2))["M"]
    assert len(jaxid.simulate(robot, short)) == 2
    assert jaxid.compare(fit, held_out=short[1:], fit=short[:1]).predicted
    assert jaxid.identifiability(robot, short).values
    for wrong in (lambda: jaxid.simulate(Omni(), short), lambda: jaxid.explain(fit, "a.csv", short)):
        with pytest.raises((LogError, TypeError), match="give"):
            wrong()
    with pytest.raises(TypeError, match="a list is no fleet; give every member's logs by its name"):
        jaxid.fit_fleet(robot, [logs])


@pytest.mark.parametrize("estimate", [jaxid.output_error, jaxid.prediction_error, jaxid.output_error_problem])
def test_words_and_starts_are_looked_at(estimate, logs):
    with pytest.raises(ValueError, match="initial_states = 'estimated' is no choice; use one of 'auto', 'known'"):
        estimate(Axis(), logs, initial_states="estimated")
    with pytest.raises(ParameterError, match="M (is|=) 'two'"):
        estimate(Axis(), logs, start={"M": "two"})


def test_what_is_no_start_is_told_before_anything_is_simulated(logs):
    with pytest.raises(ParameterError, match="start is an empty list; give at least one start"):
        jaxid.output_error(Axis(), logs, start=[])
    for wrong in ("integral least squares", 1.5, [1.0, 2.0]):
        with pytest.raises(TypeError, match="is no start; give a fit, values such as"):
            jaxid.output_error(Axis(), logs, start=wrong)


def test_other_words_that_nothing_has(logs):
    with pytest.raises(ValueError, match="covariance = 'robus' is no choice; use one of 'auto', 'white', 'robust'"):
        jaxid.output_error(Axis(), logs, covariance="robus")
    with pytest.raises(jaxid.EffectError, match="'cogging_torque' is no effect; add one of jaxid.catalogue"):
        Axis() + "cogging_torque"


def test_a_robot_in_the_place_of_its_fit_is_to_be_fitted_first(logs):
    for call in (
        lambda robot: jaxid.compare(robot, held_out=logs),
        lambda robot: jaxid.explain(robot, logs, logs),
        lambda robot: jaxid.explain_change(robot, robot, logs, logs),
        lambda robot: jaxid.profile_likelihood(robot, logs),
    ):
        with pytest.raises(
            TypeError, match=r"is no fit; give what an estimator returns, such as jaxid\.\w+\(robot, logs\)"
        ):
            call(Axis())


def test_a_fit_says_what_it_has(axis_log):
    inputs = np.repeat(np.random.default_rng(3).uniform(-2, 2, 25), 10)
    fit = jaxid.integral_least_squares(Axis(), LogSet([axis_log("a", inputs, 0.02, 1, position=False)]))
    with pytest.raises(KeyError, match=r"There is no 'mass' in this fit; it has M, Fv"):
        fit["mass"]
