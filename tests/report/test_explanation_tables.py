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
