"""Which tick of an even clock every row of a log is of, where stamps scatter and rows are missing."""

import numpy as np
import pytest

from jaxid import AXIS, Log
from jaxid.logs.even_clock import scatter


def stamped(time):
    return Log.from_arrays("run", time, np.zeros((len(time), 1)), {"v": np.zeros(len(time))}, AXIS)


@pytest.mark.parametrize("lost", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("size", [0.01, 0.08, 0.15])
def test_rows_get_their_ticks_however_many_are_missing(size, lost):
    """Twelve runs each: single steps of 1.5 intervals and more are scatter as well as missing rows."""
    rng = np.random.default_rng([3, int(1000 * size), int(1000 * lost)])
    for _ in range(12):
        ticks = np.flatnonzero(rng.random(3000) >= lost)
        time = np.sort(0.01 * (ticks + size * rng.normal(size=len(ticks))))
        even, found = scatter(stamped(time))
        assert found == pytest.approx(size, rel=0.1)
        wrong = np.abs(np.diff(even) - 0.01 * np.diff(ticks)) > 1e-5
        assert wrong.mean() < 0.01  # where a row is missing, its neighbour may be taken for it


def test_clocks_that_are_uneven_themselves_are_left_alone():
    rng = np.random.default_rng(5)
    for steps in (rng.exponential(0.01, 4000), 0.01 * (1 + 0.05 * rng.normal(size=4000)), np.full(4000, 0.01)):
        time = np.cumsum(steps)
        assert scatter(stamped(time))[1] == 0.0
