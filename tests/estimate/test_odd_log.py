"""The log that holds nearly all of what is left is named; none where all are alike, or too few."""

import numpy as np
import pytest

from jaxid.estimate.odd_log import odd_log

NOISE = {"v": 0.1, "w": 0.2}


def errors(*sizes):
    return [{"v": np.full(50, 0.1 * size), "w": np.full(50, 0.2 * size)} for size in sizes]


def test_the_odd_one_is_named_with_how_much_is_on_it_and_on_the_others():
    said = odd_log(["a", "b", "c", "d"], errors(1.5, 1.2, 9.0, 2.0), NOISE, 2.0)
    for words in ("the log c: 9 times", "on the others 1.2 to 2"):
        assert words in said


@pytest.mark.parametrize("sizes", [(3.0, 2.0, 4.0), (1.0, 0.5, 1.9), (1.0, 9.0)])
def test_logs_that_are_alike_small_or_few_have_none(sizes):
    assert odd_log(["a", "b", "c"][: len(sizes)], errors(*sizes), NOISE, 2.0) == ""
