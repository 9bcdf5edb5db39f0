"""Cells of an explanation's tables."""

import math

import pytest

from jaxid.estimate.result import Estimate
from jaxid.report.explanation_tables import interval


@pytest.mark.parametrize(
    ("low", "high", "status", "said"),
    [
        (0.7, 0.9, "identified", "0.700 to 0.900"),
        (0.0, 2.27e15, "not_identifiable", "-"),  # of a strength that is estimated by its logarithm
        (-math.inf, math.inf, "not_identifiable", "-"),
        (0.0, 1.0, "not_identifiable", "0.00 to 1.00"),  # its bounds
        (math.nan, math.nan, "fixed", "-"),
    ],
)
def test_an_interval_that_says_nothing_is_none(low, high, status, said):
    assert interval(Estimate(0.8, 0.05, (low, high), "V", status)) == said


def test_an_interval_has_the_digits_that_tell_its_ends_apart():
    assert interval(Estimate.of(7.00065, 0.00024, "1/m")) == "7.0002 to 7.0011"
    assert interval(Estimate.of(0.0401, 0.0002, "rad/s")) == "0.0397 to 0.0405"
