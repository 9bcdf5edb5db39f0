"""Programs written for earlier names go on working, and hear of the new ones."""

import pytest

from jaxid import Axis, Log, LogError, LogSet, compare, explain, simulate
from jaxid._renamed import renamed
from jaxid.report.comparison import Comparison
from tests.report.test_comparison import fit_of


@pytest.fixture
def logs():
    robot = Axis()
    return LogSet([Log.from_arrays(name, [0.0, 0.1, 0.2], [[0.0]] * 3, [[0.0]] * 3, robot) for name in "abc"])


def test_logs_are_held_out_under_either_name(logs):
    with pytest.warns(DeprecationWarning, match="held_out"):
        fit, held_out = logs.split(check=["c"])
    assert fit.names == ("a", "b") and held_out.names == ("c",)
    with pytest.warns(DeprecationWarning, match="prescribed"):
        old = simulate(Axis(), logs, driven={})
    assert [len(y) for y in old] == [3, 3, 3]


def test_public_functions_know_their_earlier_names(logs):
    with pytest.warns(DeprecationWarning), pytest.raises(ValueError, match="nothing to compare"):
        compare(check=logs)
    with pytest.warns(DeprecationWarning), pytest.raises(LogError, match="held-out"):
        explain(fit_of("output_error", Axis()), logs, check=logs)


def test_both_names_at_once_are_refused():
    @renamed(old="new")
    def function(new):
        return new

    assert function(3) == function(new=3) == 3
    with pytest.raises(TypeError, match="'old' and 'new'"):
        function(old=1, new=2)


def test_a_comparison_shows_its_predictions_under_either_name(logs):
    found = Comparison({}, logs, {}, predicted={})
    with pytest.warns(DeprecationWarning, match="predicted"):
        assert found.validations is found.predicted
