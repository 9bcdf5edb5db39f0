"""Robots that hardly moved: nobody learns their mass from that, and the fit says so, alone and in a fleet."""

import numpy as np
import pytest

from jaxid import Axis, LogSet, fit_fleet, output_error
from jaxid.estimate.uncertainty import Spread, with_covariance

ROBOT = Axis().change("offset", free=False).with_values(M=1.0, Fv=2.0, Fc=0.5)
INPUTS = np.repeat([0.4, -0.3, 0.45, 0.2, -0.45, 0.1], 60)
"""Less than the friction: nothing moves, whatever the mass."""


@pytest.fixture(scope="module")
def still(axis_log):
    return {f"still {k}": LogSet([axis_log("a", INPUTS, 0.01, k, position=False)]) for k in range(2)}


def test_a_robot_that_never_moved_tells_nothing_alone_or_in_a_fleet(axis_log, still):
    moved = LogSet([axis_log("a", 8.0 * INPUTS, 0.01, 9, position=False)])
    fleet = fit_fleet(ROBOT, {**still, "moved": moved})
    assert [name for name, e in fleet.fits["moved"].parameters.items() if e.status == "identified"] == ["M", "Fv", "Fc"]
    for name, logs in still.items():
        alone, member = output_error(ROBOT, logs), fleet.fits[name]
        assert alone["M"].status == "not_identifiable" and any("M" in note for note in alone.notes)
        assert alone.judgement == member.judgement and alone.notes == member.notes
        for symbol, estimate in alone.parameters.items():
            assert estimate.status == member[symbol].status
            if estimate.status == "at_bound":
                assert estimate.value in (ROBOT.parameters[symbol].lower, ROBOT.parameters[symbol].upper)
        assert not alone.trustworthy and "did not move" in alone.judgement.sentence
    assert "2 of these are poor or failed: still 0, still 1" in fleet.sentence and "moved" not in fleet.sentence


def test_a_mass_whose_interval_reaches_nothing_is_not_identified_and_a_friction_is(axis_log):
    """Without friction an axis may be; without mass it is none."""
    inputs = np.repeat([0.0, 1.5, -1.5, 1.5], 10)
    logs = LogSet([axis_log("a", inputs, 0.2, 2, position=False)])
    fit = output_error(ROBOT.change("Fv", free=False), logs)
    for symbol, status in (("M", "not_identifiable"), ("Fc", "identified")):
        estimate = fit[symbol]
        assert 0.5 * estimate.value < estimate.std_error < estimate.value  # the interval reaches zero
        assert estimate.status == status
    assert [note for note in fit.notes if note.startswith("M: its 95 % interval reaches 0 kg, where there is no such")]


def test_a_robust_covariance_may_determine_fewer_parameters():
    found = Spread(np.diag([0.01, 0.01]), np.array([True, True]), np.array([False, False]))
    wider = with_covariance(found, np.diag([0.02, 4.0]), np.array([1.0, 1.0]))
    assert wider.determined.tolist() == [True, False] and np.array_equal(wider.covariance, np.diag([0.02, 4.0]))
