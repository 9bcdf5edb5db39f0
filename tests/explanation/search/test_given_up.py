"""jaxid/explanation/search/given_up.py: what explained the gap alone, and what came in its place."""

from dataclasses import replace

import pytest

from jaxid.explanation.search.given_up import not_given_up
from jaxid.explanation.search.steps import Step
from tests.explanation.search.test_worth import trials


@pytest.mark.parametrize(
    ("left", "in_the_end", "kept"),
    [
        (13.3, 8.8, True),
        (13.3, 2.0, False),  # what came in its place explains what it left
        (60.0, 8.8, False),  # it explained half of the gap
        (13.3, 1.0, False),  # nothing but noise is left
    ],
)
def test_the_name_that_explained_the_gap_stays_unless_others_explain_the_rest(left, in_the_end, kept):
    plain, with_drag, _ = trials("quadratic_drag", (), **{"quadratic_drag.coefficient": 0.5, "Fv": 1.0})

    def leaves(trial, rms):
        return trial.leaving(replace(trial.held_out, normalised_rms=rms, p_white=0.0 if rms > 1.1 else 0.5))

    base, then, without = leaves(plain, 140.0), leaves(with_drag, left), leaves(plain, in_the_end)
    first = [Step((then,), (), (), base, then, (then,))], then
    steps, current = not_given_up(first, [], without, base)
    assert (current is then) is kept and bool(steps) is kept
    # As long as it is in the model nothing has been given up.
    both = leaves(with_drag, in_the_end)
    assert not_given_up(first, first[0], both, base) == (first[0], both)
    assert not_given_up(None, [], without, base) == ([], without)
