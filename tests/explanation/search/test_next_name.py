"""jaxid/explanation/search/next_name.py: what is refitted beside the name that is believed."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.refits.refit import Trial
from jaxid.explanation.screening.screen import Candidate
from jaxid.explanation.search import next_name
from jaxid.explanation.search.next_name import _untried


def trial(name: str, law: str) -> Trial:
    state = HeldOut(1.0, {"v": 1.0}, (np.zeros((10, 1)),), {"v": 0.01}, 0.5)
    return Trial(name, Axis() + effect_by_id(Axis(), name, law), 10.0, 1, state, lambda: state, {})


def candidate(name: str, *direction: float) -> Candidate:
    along = (np.array(direction) / np.linalg.norm(direction)).astype(np.float32)
    return Candidate(effect_by_id(Axis(), name), 100.0, 0.5, (), along)


def test_what_explains_like_the_name_that_is_believed_is_refitted_though_another_led_first():
    likely = [candidate("stribeck_friction", 1, 0), candidate("sensor_delay", 0, 1), candidate("input_delay", 0.1, 1)]
    led, believed = trial("stribeck_friction", "gaussian"), trial("sensor_delay", "constant")
    assert [c.effect.id for c in _untried([believed, led], likely)] == ["input_delay"]
    assert not _untried([led, believed], likely)  # nothing is like the friction
    assert not _untried([believed, led, trial("input_delay", "constant")], likely)  # it was


@pytest.mark.parametrize(("far", "tried"), [(130.0, True), (3.0, False)])
def test_far_from_the_noise_formulas_are_refitted_beside_a_curve(monkeypatch, far, tried):
    """A curve that promised most and went astray, of a mechanism whose formula is right."""
    robot = Axis()
    curve, formula = (effect_by_id(robot, "asymmetric_viscous_friction", law) for law in ("shape", "all_axes"))
    along = np.ones(10, np.float32)
    plain = Candidate(formula, 60.0, 0.3, (), along)
    candidates = [Candidate(curve, 90.0, 0.5, (), along, laws=(plain,)), candidate("quadratic_drag", *range(10))]
    refitted = []

    def added(base, candidates, *rest):
        refitted.extend(c.effect.title for c in candidates)
        found = [trial(c.effect.id, c.effect.law) for c in candidates]
        return [replace(t, squares=1e6 if t.law == "shape" else 1e3) for t in found]

    class Seen(Exception):
        pass

    def by_law(candidates, trials, *rest):
        raise Seen({t.id: t.law for t in trials})

    monkeypatch.setattr(next_name, "all_added", added)
    monkeypatch.setattr(next_name, "by_law", by_law)
    monkeypatch.setattr(next_name, "continued", lambda trial, *rest: trial)
    state = HeldOut(far, {"v": far}, (np.full((10, 1), far),), {"v": 0.01}, 0.5)
    base = Trial("", robot, 2e6, 1, state, lambda: state, {})
    with pytest.raises(Seen) as seen:
        next_name.name_next(base, base, candidates, None, None, {"v": 0.01}, lambda said: None)
    assert (formula.title in refitted) is tried
    assert seen.value.args[0]["asymmetric_viscous_friction"] == ("all_axes" if tried else "shape")
