"""The level at which a complete model is called incomplete: set by whoever asks, and kept by what is decided."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from jaxid import AXIS, OMNI, Axis, Log, LogSet, Omni, explain, output_error
from jaxid.explanation.left.heldout import HeldOut, held_out_state, whiteness
from jaxid.explanation.level import FALSE_ALARM, at_level, current_level
from jaxid.explanation.screening.absorbed import less_absorbed

SAMPLES = 300
TRUE = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}


def test_a_level_holds_within_its_block_and_is_kept_by_what_was_judged_there():
    assert current_level() == FALSE_ALARM
    with at_level(0.1):
        state = HeldOut(1.0, {"v": 1.0}, (np.ones((100, 1)),), {"v": 0.01}, 0.5)
    assert current_level() == FALSE_ALARM and state.false_alarm == 0.1


@pytest.mark.parametrize("level", [0.0, 0.5, -1.0, float("nan")])
def test_what_is_no_level_is_refused(level):
    with pytest.raises(ValueError, match="such as 0.01"), at_level(level):
        pass


@pytest.fixture(scope="module")
def logs(axis_log):
    rng = np.random.default_rng(4)
    found = []
    for name in ("fit", "check"):
        clean = axis_log(name, np.repeat(rng.uniform(-5, 5, SAMPLES // 20), 20), position=False, **TRUE)
        noisy = clean.output("v") + 0.01 * rng.normal(size=SAMPLES)
        found.append(Log.from_arrays(name, clean.time, clean.inputs, noisy, AXIS))
    return LogSet(found[:1]), LogSet(found[1:])


def test_the_p_value_decides_at_every_level(logs):
    state = replace(held_out_state(Axis().with_values(**TRUE, offset=0.0), logs[1]), p_white=0.02, normalised_rms=1.01)
    assert state.p_value == pytest.approx(0.04)
    assert replace(state, false_alarm=0.03).adequate and not replace(state, false_alarm=0.05).adequate
    # What is too small to matter is adequate at any level.
    assert replace(state, false_alarm=0.4, normalised_rms=1.001).adequate


def test_an_explanation_says_at_which_level_it_was_made(logs):
    fit = output_error(Axis().with_values(**TRUE), logs[0])
    found = explain(fit, *logs, false_alarm=0.002)
    assert found.verdict == "adequate" and found.before.false_alarm == 0.002
    assert found.to_dict()["false_alarm"] == 0.002 and explain(fit, *logs).to_dict()["false_alarm"] == FALSE_ALARM


def test_what_other_parameters_take_up_is_taken_off_and_nothing_else(logs):
    """A robot with the wrong friction leaves what the right one would take up; an offset in the sensor stays."""
    robot = Axis().with_values(**{**TRUE, "Fv": 2.05}, offset=0.0).change("offset", free=False)
    states = [(held_out_state(robot, own, {"v": 0.01, "q": 1.0}), own) for own in logs]
    left = less_absorbed(robot, states)
    before, after = (
        np.sqrt(np.mean(np.concatenate([own.residuals[0] for own, _ in each]) ** 2)) for each in (states, left)
    )
    assert before > 1.2 and after == pytest.approx(1.0, abs=0.1)
    shifted = [(replace(state, residuals=tuple(r + 5.0 for r in state.residuals)), own) for state, own in left]
    again = less_absorbed(robot, shifted)
    assert np.mean(np.concatenate([own.residuals[0] for own, _ in again])) > 2.5  # friction of one direction takes some


def test_slow_noise_of_one_sensor_does_not_stir_the_white_ones_of_others():
    """What parameters take up is told by the samples that are independent: few of a coloured channel, however large."""
    robot, rng, states = Omni(), np.random.default_rng(6), []
    for name in ("fit", "check"):
        volts = np.repeat(rng.uniform(-10, 10, (SAMPLES // 20, 4)), 20, axis=0)
        own = LogSet([Log.from_arrays(name, 0.02 * np.arange(SAMPLES), volts, np.zeros((SAMPLES, 3)), OMNI)])
        state = held_out_state(robot, own, {"V": 0.01, "Vn": 0.01, "W": 0.01})
        white = rng.normal(size=(SAMPLES, 2))
        slow = 10.0 * signal.lfilter([1.0], [1.0, -0.95], rng.normal(size=SAMPLES))
        states.append((replace(state, residuals=(np.column_stack([white, slow]),)), own))
    left = less_absorbed(robot, states)
    speeds = [residual[:, :2] for own, _ in left for residual in own.residuals]
    assert whiteness(speeds) > 0.01
