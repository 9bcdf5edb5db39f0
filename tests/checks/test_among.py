"""A log among the others of its set: a silent sensor that is dead, or of a robot that dry friction held; copies."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import LogSet


def dead(logs):
    return [(f.file, f.column) for f in logs.preflight() if f.check == "dead_sensor"]


@pytest.fixture(scope="module")
def driven(held, pioneer_log):
    random = np.random.default_rng(5)
    levels = np.array([-6.0, -3.0, 3.0, 6.0])
    return [pioneer_log(held(random, 1500, 2, 40, levels), seed=k, name=f"driven_{k}.csv") for k in range(2)]


def silent(log, seed=9):
    outputs = np.array(log.outputs)
    outputs[:, 1] = 0.01 * np.random.default_rng(seed).normal(size=len(log))
    return replace(log, outputs=outputs)


@pytest.fixture(scope="module")
def crawl(pioneer_log):
    """Forwards; turned by commands below the 0.625 V a side that dry friction holds, so that the gyro shows its noise."""
    random = np.random.default_rng(6)
    forward, turn = (np.repeat(random.uniform(low, high, 30), 50) for low, high in ((1.5, 3.0), (-0.6, 0.6)))
    return silent(pioneer_log(np.stack([forward + turn, forward - turn], axis=1), seed=7, name="crawl.csv"))


def test_a_robot_that_did_not_turn_has_no_dead_gyro_where_the_other_logs_show_it_alive(driven, crawl):
    assert dead(LogSet([crawl])) == [("crawl.csv", "eta2")]  # alone, nobody can tell
    assert dead(LogSet([*driven, crawl])) == []


def test_a_dead_gyro_is_found_in_one_log_of_a_set_and_in_all(driven, crawl):
    one = LogSet([driven[0], silent(driven[1]), crawl])
    assert ("driven_1.csv", "eta2") in dead(one)
    every = LogSet([silent(log, k) for k, log in enumerate([*driven, crawl])])
    assert dead(every) == [(log.name, "eta2") for log in every]


def test_a_log_that_is_given_twice_is_said_to_be(driven):
    again = replace(driven[0], name="again.csv")
    (found,) = [f for f in LogSet([*driven, again]).preflight() if f.check == "copy"]
    assert (found.file, found.severity) == ("again.csv", "warning") and "driven_0.csv" in found.message
    assert not [f for f in LogSet(driven).preflight() if f.check == "copy"]
