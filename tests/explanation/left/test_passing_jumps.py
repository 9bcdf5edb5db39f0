"""jaxid/explanation/left/passing_jumps.py: samples that jump and come back, on an axis in closed form whose sensor slips."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, explain, output_error
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.left.passing_jumps import ROBUST, _jumps, jumps_are_much
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


def test_what_a_fast_robot_does_later_than_its_model_is_no_slip_of_a_sensor():
    """Its answer to every step comes two samples late: the error there jumps and comes back."""
    logs = []
    for k in range(3):
        random = np.random.default_rng(k)
        u = np.repeat(random.uniform(-4.0, 4.0, 40), 10)
        v = np.concatenate([[0.0, 0.0, 0.0], 0.5 * u[:-3]]) + NOISE * random.normal(size=len(u))
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(len(u)), u[:, None], v[:, None], ROBOT))
    fast = ROBOT.with_values(M=0.004)
    assert not jumps_are_much(fast, LogSet(logs[:2]), LogSet(logs[2:]))
    # Slips of its sensor are seen where it answers in time.
    prompt = [
        replace(log, outputs=np.concatenate([log.outputs[2:], log.outputs[-1:], log.outputs[-1:]])) for log in logs
    ]
    slipping = _slipping(LogSet(prompt), 0.02, 4)
    for own, count in ((LogSet(logs), 0), (slipping, 15)):
        found = _jumps(held_out_state(fast, own, {"v": NOISE}), own)
        assert count <= sum(int(each.sum()) for each in found) <= 2 * count
    # And where it does not, if they are larger than all that it does late.
    spiked, there = [], []
    for k, log in enumerate(logs):
        random = np.random.default_rng([7, k])
        there.append((random.random(log.outputs.shape) < 0.02) & np.isfinite(log.outputs))
        off = 12.0 * random.choice([-1.0, 1.0], log.outputs.shape)
        spiked.append(replace(log, outputs=log.outputs + np.where(there[-1], off, 0.0)))
    own = LogSet(spiked)
    found = _jumps(held_out_state(fast, own, {"v": NOISE}), own)
    assert 15 <= sum(int(each.sum()) for each in there) <= 40
    for found_in, put_in in zip(found, there, strict=True):
        assert found_in[put_in[:, 0], 0].all() and np.count_nonzero(found_in[~put_in[:, 0]]) <= 2
    # Where a tenth of the readings jump it is no sensor's fault: so few show a motion that it jumps from one to the next.
    seldom = [replace(log, outputs=np.where(np.arange(len(log)) % 12, np.nan, log.outputs.T).T) for log in prompt]
    slow = ROBOT.with_values(M=1.0)
    assert not any(own.any() for own in _jumps(held_out_state(slow, LogSet(seldom), {"v": NOISE}), LogSet(seldom)))


@pytest.mark.slow
def test_a_dead_zone_is_named_through_them_and_nothing_is_missing_without_it():
    """By least squares, which they count for in full."""
    for law, named in ((lambda u: u, []), (small_zone, ["actuator_dead_zone"])):
        logs, held_out = (_slipping(each, 0.01, 4) for each in driven(law, 5))
        found = explain(output_error(ROBOT, logs), logs, held_out)
        assert found.verdict in (("named", "ambiguous") if named else ("adequate",))
        assert [effect.id for effect in found.effects] == named
        assert any(ROBUST in note for note in found.notes) == bool(named)
