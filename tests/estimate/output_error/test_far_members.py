"""jaxid/estimate/output_error/far_members.py: who stands out from a fleet, and how rarely nobody's doing does."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, LogSet, output_error
from jaxid.estimate.output_error.far_members import far_members
from jaxid.estimate.result import Estimate

ROBOT = Axis().change("offset", value=0.0, free=False).change("Fc", value=0.0, free=False)


@pytest.fixture(scope="module")
def fit(axis_log):
    inputs = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 60)
    return output_error(ROBOT, LogSet([axis_log("run", inputs, 0.01, 1, position=False, Fc=0.0)]))


def fleet_of(fit, masses, errors, viscous=None):
    """A fleet whose estimates are given numbers."""
    viscous = np.full(len(masses), 2.0) if viscous is None else viscous
    made = {}
    for k, (mass, error) in enumerate(zip(masses, errors, strict=True)):
        own = {"M": Estimate.of(mass, error, "kg"), "Fv": Estimate.of(viscous[k], 0.01, "N s/m")}
        made[f"robot {k}"] = replace(fit, parameters={**fit.parameters, **own})
    return made


def test_the_one_that_weighs_more_is_named_with_how_much(fit):
    masses = [1.00, 1.02, 0.99, 1.01, 0.98, 1.00, 1.03, 1.50]
    (far,) = far_members(fleet_of(fit, masses, [0.01] * 8))
    assert (far.member, far.parameter, far.unit) == ("robot 7", "M", "kg")
    # By hand: the median is 1.005; the deviations' is 0.015, so that the spread is 0.0222 x 8/7.2, and with 0.01 0.0266.
    assert far.median == pytest.approx(1.005) and far.distance == pytest.approx(0.495 / 0.0266, rel=0.01)
    for words in ("robot 7", "M", "1.5 ± 0.01 kg", "median of 1.005"):
        assert words in far.sentence


def test_a_large_standard_error_is_no_distance(fit):
    masses = [1.00, 1.02, 0.99, 1.01, 0.98, 1.00, 1.03, 1.50]
    assert not far_members(fleet_of(fit, masses, [0.01] * 7 + [0.3]))


def test_few_members_and_doubted_ones_say_nothing(fit):
    masses = [1.0, 1.0, 1.0, 9.0]
    assert not far_members(fleet_of(fit, masses, [0.001] * 4))
    fleet = fleet_of(fit, [1.00, 1.02, 0.99, 1.01, 0.98, 1.00, 1.03, 1.50], [0.01] * 8)
    doubted = replace(fleet["robot 7"].judgement, verdict="failed")
    assert not doubted.trustworthy
    assert not far_members({**fleet, "robot 7": replace(fleet["robot 7"], judgement=doubted)})


def test_one_of_a_small_fleet_with_little_scatter_is_told(fit):
    """Twelve spreads of seven others, where the median of eight deviations says little; and the second one after it."""
    masses = [9.71, 9.41, 10.09, 9.9, 9.62, 9.78, 9.85, 12.23]
    assert [far.member for far in far_members(fleet_of(fit, masses, [0.02] * 8))] == ["robot 7"]
    two = far_members(fleet_of(fit, [*masses, 9.6, 9.8, 9.7, 14.0], [0.02] * 12))
    assert {far.member for far in two} == {"robot 7", "robot 11"}


def test_two_kinds_of_robot_are_a_spread(fit):
    assert not far_members(fleet_of(fit, [1.0, 1.01, 0.99, 1.0, 2.0, 2.01, 1.99, 2.0], [0.01] * 8))


@pytest.mark.parametrize("count", [5, 8, 20])
@pytest.mark.parametrize(("spread", "error"), [(0.1, 0.001), (0.0, 0.05), (0.05, 0.05)])
def test_a_fleet_of_one_kind_is_seldom_said_to_have_a_far_member(fit, count, spread, error):
    rng, alarms, times = np.random.default_rng(count), 0, 300
    for _ in range(times):
        own = error * rng.uniform(0.5, 1.5, count)
        masses = 1.0 + spread * rng.normal(size=count) + own * rng.normal(size=count)
        alarms += bool(far_members(fleet_of(fit, masses, own, 2.0 + 0.3 * rng.normal(size=count))))
    assert alarms <= 9  # of 300 at 1 %: more than 9 has a chance of 0.1 %
