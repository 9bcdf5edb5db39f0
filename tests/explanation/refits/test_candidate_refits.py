"""A candidate is refitted from near the model without it, too, where its first guess leads to something worse than that."""

from types import SimpleNamespace

import numpy as np
import pytest

import jaxid.explanation.refits.candidate_refits as under_test
from jaxid import Axis, LogSet
from jaxid.effects import effect_by_id
from jaxid.explanation.screening.screen import Candidate


@pytest.mark.parametrize(("led_to", "then", "kept"), [(900.0, [], 900.0), (5e6, [40.0], 40.0), (np.inf, [2e3], 2e3)])
def test_a_first_guess_that_leads_astray_does_not_lose_the_effect(monkeypatch, axis_log, led_to, then, kept):
    """Scales that the logs do not tell one by one: the first look found -98 %, and the search stayed far off."""
    starts, found = [], iter([led_to, *then])

    def refit(robot, given, *rest):
        starts.append(given)
        squares = next(found)
        return SimpleNamespace(squares=squares, score=squares)

    monkeypatch.setattr(under_test, "refit", refit)
    monkeypatch.setattr(under_test, "compile_refits", lambda *given: None)
    guess = {"sensor_scale.error_v": -0.98}
    candidate = Candidate(
        effect_by_id(Axis(), "sensor_scale"), 1.0, 1.0, (guess, {"M": 0.02, **guess}), np.zeros(0, np.float32)
    )
    near = SimpleNamespace(normalised_rms=1.0)
    base = SimpleNamespace(robot=Axis(), squares=1e3, initial_states={}, angles=None, fitted=near)
    logs = LogSet([axis_log("run", np.ones(20))])
    (trial,) = under_test.all_added(base, [candidate], logs, logs, {}, lambda text: None)
    assert trial.squares == kept
    assert [[sorted(start) for start in own] for own in starts[1:]] == [[["sensor_scale.error_v"]]] * len(then)
    assert all(abs(start["sensor_scale.error_v"]) < 0.02 for own in starts[1:] for start in own)


def test_a_small_share_of_a_first_guess_stays_within_bounds(monkeypatch, axis_log):
    """An exponent of one hundredth is none that friction has: it was handed to the refit, which stopped all of it."""
    starts = []

    def refit(robot, given, *rest):
        starts.append(given)
        return SimpleNamespace(squares=2e3, score=2e3)

    monkeypatch.setattr(under_test, "refit", refit)
    monkeypatch.setattr(under_test, "compile_refits", lambda *given: None)
    robot = Axis()
    effect = effect_by_id(robot, "load_dependent_friction", "power_of_torque")
    guess = {"load_dependent_friction.share": 0.3, "load_dependent_friction.exponent": 1.0}
    candidate = Candidate(effect, 1.0, 1.0, (guess,), np.zeros(0, np.float32))
    near = SimpleNamespace(normalised_rms=1.0)
    base = SimpleNamespace(robot=robot, squares=1e3, initial_states={}, angles=None, fitted=near)
    logs = LogSet([axis_log("run", np.ones(20))])
    under_test.all_added(base, [candidate], logs, logs, {}, lambda text: None)
    (again,) = starts[-1]
    assert again == {"load_dependent_friction.share": 0.003, "load_dependent_friction.exponent": 0.5}


def test_what_was_refitted_before_is_a_rival_of_what_is_dear_to_follow_up(monkeypatch, axis_log):
    rivals = []

    def refit(robot, given, logs, held_out, noise, states, few, rival, angles):
        rivals.append(rival)
        return SimpleNamespace(squares=500.0, score=500.0)

    monkeypatch.setattr(under_test, "refit", refit)
    monkeypatch.setattr(under_test, "compile_refits", lambda *given: None)
    robot = Axis()
    named = [effect_by_id(robot, name) for name in ("cogging_torque", "quadratic_drag")]
    candidates = [Candidate(effect, 1.0, 1.0, ({},), np.zeros(0, np.float32)) for effect in named]
    base = SimpleNamespace(
        robot=robot, squares=1e3, initial_states={}, angles=None, fitted=SimpleNamespace(normalised_rms=1.0)
    )
    logs = LogSet([axis_log("run", np.ones(20))])
    best = SimpleNamespace(squares=300.0)
    under_test.all_added(base, candidates, logs, logs, {}, lambda text: None, [best])
    under_test.all_added(base, candidates, logs, logs, {}, lambda text: None)
    # What repeats with the wheels comes last.
    assert rivals == [300.0, 300.0, np.inf, 500.0]
