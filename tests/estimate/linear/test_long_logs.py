"""What integral least squares does otherwise for long logs, on short ones: nothing comes out differently."""

import numpy as np
import pytest

from jaxid import Log, LogSet, Pioneer, integral_least_squares
from jaxid.estimate.linear import regressor_noise, walks, weighted_least_squares
from jaxid.estimate.linear.window_equations import equations_of_each, window_equations


@pytest.fixture(scope="module")
def logs():
    """Two logs of speeds that follow their inputs roughly."""
    found, robot = [], Pioneer()
    for k in range(2):
        random, T = np.random.default_rng(k), 600 - 150 * k
        inputs = np.repeat(random.uniform(-8, 8, (T // 30, 2)), 30, axis=0)
        speeds = np.zeros((T, 2))
        for t in range(T - 1):
            pull = np.array([inputs[t].sum(), 4.0 * (inputs[t, 0] - inputs[t, 1])])
            speeds[t + 1] = speeds[t] + 0.02 * (0.1 * pull - speeds[t])
        outputs = speeds + 0.01 * random.normal(size=speeds.shape)
        found.append(Log.from_arrays(f"log {k}", 0.02 * np.arange(T), inputs, outputs, robot))
    return LogSet(found)


def test_blocks_of_a_walk_and_triangles_change_no_estimate(logs, monkeypatch):
    expected = integral_least_squares(Pioneer(), logs)
    monkeypatch.setattr(walks, "_NUMBERS", 0)
    monkeypatch.setattr(walks, "_FEWEST", 70)
    monkeypatch.setattr(regressor_noise, "_ROWS", 0)
    same = integral_least_squares(Pioneer(), logs)
    monkeypatch.setattr(weighted_least_squares, "_MANY", 0)
    found = integral_least_squares(Pioneer(), logs)
    for name in expected.free_names:
        pair = [(fit[name].value, fit[name].std_error) for fit in (same, expected)]
        np.testing.assert_array_equal(*pair)
        assert found[name].value == pytest.approx(expected[name].value, rel=1e-7)
        assert found[name].std_error == pytest.approx(expected[name].std_error, rel=1e-7, nan_ok=True)
        assert found[name].status == expected[name].status
    assert same.judgement == expected.judgement and found.judgement.sentences == expected.judgement.sentences


@pytest.mark.usefixtures("double_precision")
def test_equations_of_several_sets_side_by_side_are_those_of_each(logs):
    sets = [logs, LogSet([logs[1]])]
    for found, own in zip(equations_of_each(Pioneer(), sets, "speed"), sets, strict=True):
        expected = window_equations(Pioneer(), own, "speed")
        np.testing.assert_array_equal(found.regressors, expected.regressors)
        np.testing.assert_array_equal(found.targets, expected.targets)
