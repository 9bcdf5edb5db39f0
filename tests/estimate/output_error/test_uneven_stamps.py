"""What a fit says of receive stamps, on counted angles of an independent simulator."""

import numpy as np
import pytest

import jaxid
from tests.counted_runs import Hidden, logged, model

pytest.importorskip("numba", reason="the independent simulator needs numba")


def arriving(time, rng):
    """Stamps of messages that were on their way for some 1.2 ms, in their order."""
    return np.maximum.accumulate(time + rng.gamma(2.0, 0.0006, len(time)))


@pytest.mark.parametrize(("name", "counts"), [("axis", 2048), pytest.param("own drive", 4096, marks=pytest.mark.slow)])
def test_a_complete_model_is_told_that_its_stamps_are_those_of_arrival(name, counts):
    logs, held_out = logged(name, counts, Hidden(), seed=2, stamps=arriving)
    fit = jaxid.output_error(model(name), logs)
    assert not fit.trustworthy
    notes = [note for note in fit.notes if "scatter about an even clock" in note]
    assert len(notes) == 1 and "interval = seconds" in notes[0]
    assert jaxid.explain(fit, logs, held_out).verdict == "adequate"


def test_an_incomplete_model_is_told_nothing_of_stamps_that_are_even():
    logs, _ = logged("axis", 2048, Hidden(dead_zone=0.3), seed=2)
    fit = jaxid.output_error(model("axis"), logs)
    assert not fit.trustworthy and not [note for note in fit.notes if "even clock" in note]
