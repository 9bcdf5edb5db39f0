"""Readings at the end of a sensor's range, and of one that is dead in a log."""

import numpy as np
import pytest

from jaxid import Channels, Log, LogSet
from jaxid.logs.unusable import at_the_end, without_unusable
from tests.closed_form_rover import clipped, dead, driven


def test_samples_at_the_end_of_the_range_are_those_that_were_cut_off():
    y = np.random.default_rng(0).normal(size=500)
    np.testing.assert_array_equal(at_the_end(np.clip(y, -1.2, 1.2)), np.abs(y) >= 1.2)
    assert not at_the_end(y).any()


@pytest.mark.parametrize(
    "signal",
    [
        pytest.param(np.round(np.sin(np.arange(500.0)) * 3), id="few levels"),
        pytest.param(np.repeat([0.0, 1.0, -1.0, 1.0], 125), id="two levels"),
        pytest.param(np.zeros(500), id="nothing"),
        pytest.param(np.concatenate([np.zeros(200), np.random.default_rng(1).uniform(0.1, 1.0, 300)]), id="at rest"),
    ],
)
def test_signals_that_return_to_a_level_of_their_own_are_not_clipped(signal):
    assert not at_the_end(signal).any()


def test_readings_of_a_sensor_that_is_dead_in_one_log_are_missing_there_and_nowhere_else():
    logs, held_out = driven(1, change=dead(1))
    (some, others), said = without_unusable(logs, held_out)
    assert said == ["W of run 1, which never changes there"]
    assert np.isfinite(some[1].output("W")).sum() == 1 and np.isfinite(some[1].output("V")).all()
    assert all(
        mine is given for mine, given in zip([*some, *others], [*logs, *held_out], strict=True) if given is not logs[1]
    )


def test_a_sensor_that_is_dead_everywhere_is_left_to_the_fit():
    """Where it never moves, it may be a robot that cannot."""
    logs, held_out = driven(1, change=dead(*range(6)))
    (some, others), said = without_unusable(logs, held_out)
    assert not said and all(np.isfinite(own.outputs).all() for own in [*some, *others])


def test_clipped_readings_are_missing_with_their_share_and_limit():
    logs, _ = driven(2, change=clipped(0.5))
    (some,), said = without_unusable(logs)
    for own, given, sentence in zip(some, logs, said, strict=True):
        ends = np.abs(given.output("W")) == 0.5
        np.testing.assert_array_equal(np.isnan(own.output("W")), ends)
        assert sentence == f"{ends.mean():.0%} of W of {given.name}, at the end of its range (0.5 rad/s)"


@pytest.mark.parametrize("level", [None, 0.0])
def test_what_a_frozen_sensor_repeats_is_missing_and_what_a_robot_at_rest_reads_is_not(level):
    """Frozen where it is, or dropped to zero in one jump; a robot that stands reads zero on all its sensors."""

    def frozen(k, y):
        stop = 150 + int(np.argmax(np.abs(y[150:250, 1])))
        if k == 1:
            y[stop:, 1] = y[stop, 1] if level is None else level
        if k == 2:
            y[-80:] = 0.0
        return y

    logs, held_out = driven(1, change=frozen)
    (some, others), said = without_unusable(logs, held_out)
    assert len(said) == 1 and "W of run 1, frozen at" in said[0], said
    missing = ~np.isfinite(some[1].output("W"))
    assert np.array_equal(missing, np.append(False, np.diff(logs[1].output("W")) == 0))
    assert all(np.isfinite(own.outputs).all() for own in [some[0], *list(some)[2:], *others])


def test_what_a_slower_sensor_repeats_is_missing_but_for_the_first_reading():
    """A sensor that gives every fourth sample a value, which the log holds until the next."""

    def held(k, y):
        y[:, 1] = y[np.arange(len(y)) // 4 * 4, 1]
        return y

    logs, held_out = driven(3, change=held)
    (some, others), said = without_unusable(logs, held_out)
    assert said == ["what W, whose sensor is slower than the logs, repeats of the reading before"]
    for own in [*some, *others]:
        there = np.flatnonzero(np.isfinite(own.output("W")))
        assert np.all(there % 4 == 0) and len(there) > 0.2 * len(own) and np.isfinite(own.output("V")).all()


@pytest.mark.parametrize("swings", [False, True], ids=["it stands", "its encoder froze"])
def test_an_arm_that_stands_reads_the_same_while_its_gyro_is_noise(swings):
    random, time = np.random.default_rng(6), 0.01 * np.arange(800)
    angle = np.where(time < 4.0, np.sin(3.0 * time), np.sin(12.0))
    rate = np.where(time < 4.0, 3.0 * np.cos(3.0 * time), 3.0 * np.cos(3.0 * time) if swings else 0.0)
    outputs = {"angle": np.round(angle, 3), "rate": rate + 0.05 * random.normal(size=800)}
    channels = Channels(("u",), ("angle", "rate"), units={"angle": "rad", "rate": "rad/s"})
    logs = LogSet([Log.from_arrays("run", time, np.zeros((800, 1)), outputs, channels)])
    (some,), said = without_unusable(logs)
    assert bool(said) is swings and np.isfinite(some[0].output("angle")).all() is not np.bool_(swings)
