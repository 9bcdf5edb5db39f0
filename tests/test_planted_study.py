"""The study of effects planted in recordings: that what is planted is exact, and how an answer is judged; no explanation."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.planted import page, plants, sets
from jaxid import AXIS, Log

DATA = Path(__file__).parents[1] / "../shared/data"


@pytest.fixture
def log():
    random = np.random.default_rng(2)
    time = 0.01 * np.arange(400)
    u = np.repeat(random.choice([-0.3, 0.0, 0.3], 40), 10)
    return Log.from_arrays("recorded", time, u, np.cumsum(u) * 0.01 + 0.001 * random.normal(size=400), AXIS)


def test_measurements_come_late_and_nothing_else_changes(log):
    late = plants.late(7)(log)
    np.testing.assert_array_equal(late.output("v"), log.output("v")[:-7])
    np.testing.assert_array_equal(late.inputs, log.inputs[7:])
    np.testing.assert_allclose(late.time, log.time[7:])


def test_a_filter_answers_a_step_and_a_ramp_as_its_time_constant_says(log):
    seconds = 0.05
    for signal, expected in (
        (lambda t: np.where(t >= 0.01, 1.0, t / 0.01), lambda t: 1.0 - np.exp(-(t - 0.005) / seconds)),
        (lambda t: t, lambda t: t - seconds * (1.0 - np.exp(-t / seconds))),
    ):
        driven = Log.from_arrays("step", log.time, log.inputs, signal(log.time), AXIS)
        found = plants.filtered(seconds)(driven).output("v")
        np.testing.assert_allclose(found[2:], expected(log.time)[2:], atol=2e-3)


def test_what_a_driver_makes_of_the_planted_commands_is_what_was_recorded(log):
    u = log.inputs
    wide = plants.behind_a_dead_zone(0.1)(log).inputs
    np.testing.assert_allclose(np.sign(wide) * np.maximum(np.abs(wide) - 0.1, 0.0), u, atol=1e-12)
    beyond = plants.behind_a_limit(0.3, 1.8, 3)(log).inputs
    np.testing.assert_allclose(np.clip(beyond, -0.3, 0.3), u)
    assert len(np.unique(beyond)) > 10 and np.abs(beyond).max() <= 0.54
    np.testing.assert_allclose(0.8 * plants.behind_a_gain(0, 0.8)(log).inputs, u)


def test_lost_rows_are_none_in_which_an_input_changed(log):
    found = plants.with_rows_lost(0.2, 1)(log)
    assert 0.75 < len(found) / len(log) < 0.9
    changes = {round(t, 6) for t in log.time[1:][np.diff(log.inputs[:, 0]) != 0]}
    assert changes <= {round(t, 6) for t in found.time}


def _row(planted="late", accepted=("sensor_delay",), effects=(), absorbed=False, sizes=()):
    named = [
        {"id": own, "law": "", "equivalent": list(alike), "parameters": {f"{own}.delay": [0.019, 0.001]}}
        for own, alike in effects
    ]
    return {
        "set": "tra_A",
        "planted": planted,
        "accepted": list(accepted),
        "may_be_absorbed": absorbed,
        "sizes": list(sizes),
        "effects": named,
    }


def test_an_answer_is_judged_by_what_it_says_beside_what_was_said_before():
    plain = _row("", (), (("motor_lag", ()),))

    def said(*effects, **more):
        return page.judged(_row(effects=effects, **more), plain)

    assert said(("motor_lag", ()), ("sensor_delay", ())) == "right"
    assert (
        said(("sensor_lag", ()), ("input_delay", ("sensor_delay",))) == "right"
    )  # a lag was named before, the set holds it
    assert said(("motor_lag", ()), ("sensor_delay", ()), ("backlash", ())) == "right, and backlash as well"
    assert said(("motor_lag", ()), ("backlash", ())) == "wrong: backlash"
    assert said(("motor_lag", ())) == "missed" and said(("motor_lag", ()), absorbed=True) == "right (nothing new)"
    assert said(("motor_lag", ()), accepted=()) == "right (nothing new)"
    assert said(("sensor_delay", ()), accepted=()) == "wrong: sensor_delay"


def test_a_size_counts_where_the_mechanism_is_new():
    size = [["sensor_delay", "delay", 0.02], ["input_delay", "delay", 0.02]]
    row = _row(effects=(("sensor_delay", ()),), sizes=size)
    assert page.covered(row, _row("", ())) == [True]
    assert page.covered({**row, "sizes": [["sensor_delay", "delay", 0.03]]}, _row("", ())) == [False]
    assert page.covered(row, _row("", (), (("sensor_delay", ()),))) == []


@pytest.mark.skipif(not DATA.is_dir(), reason="the measured logs are not beside this checkout")
@pytest.mark.parametrize("name", sets.SETS)
def test_the_cases_of_a_set_are_those_that_the_page_counts_and_can_be_planted(name):
    case = sets.SETS[name](DATA)
    assert 1 + len(case.planted) == sets.COUNTS[name]
    for planted in case.planted:
        assert len(planted.plant(case.fit[0])) > 0.9 * len(case.fit[0])
