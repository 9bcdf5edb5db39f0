"""jaxid/explanation/left/passing_jumps.py: samples that jump and come back, on an axis in closed form whose sensor slips."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, LogSet, explain, output_error
from jaxid.explanation.left.passing_jumps import ROBUST, jumps_are_much
from tests.explanation.closed_form_axis import NOISE, driven

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0).change("Fc", free=False)


def _slipping(logs: LogSet, share: float, seed: int) -> LogSet:
    """Single samples, so many of them, off by eight to fifteen times the noise."""
    found = []
    for k, log in enumerate(logs):
        random = np.random.default_rng([seed, k])
        off = random.uniform(8.0, 15.0, log.outputs.shape) * random.choice([-1.0, 1.0], log.outputs.shape)
        off = np.where(random.random(log.outputs.shape) < share, off, 0.0)
        found.append(replace(log, outputs=log.outputs + NOISE * off))
    return LogSet(found)


def small_zone(u):
    """What makes about as much of the error as the noise does."""
    return u - np.clip(u, -0.02, 0.02)


@pytest.mark.parametrize(
    ("law", "share", "much"), [(small_zone, 0.0, False), (small_zone, 0.01, True), (lambda u: u, 0.01, False)]
)
def test_they_are_left_out_where_they_make_much_of_the_error_and_something_is_missing(law, share, much):
    logs, held_out = (_slipping(each, share, 4) for each in driven(law, 5))
    fit = output_error(ROBOT, logs)
    assert jumps_are_much(fit.robot, logs, held_out) == much


def test_a_dead_zone_is_named_through_them_and_nothing_is_missing_without_it():
    """By least squares, which they count for in full."""
    for law, named in ((lambda u: u, []), (small_zone, ["actuator_dead_zone"])):
        logs, held_out = (_slipping(each, 0.01, 4) for each in driven(law, 5))
        found = explain(output_error(ROBOT, logs), logs, held_out)
        assert found.verdict in (("named", "ambiguous") if named else ("adequate",))
        assert [effect.id for effect in found.effects] == named
        assert any(ROBUST in note for note in found.notes) == bool(named)
