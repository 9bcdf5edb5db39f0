"""jaxid/explanation/search/next_name.py: what is refitted beside the name that is believed."""

import numpy as np

from jaxid import Axis
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.refits.refit import Trial
from jaxid.explanation.screening.screen import Candidate
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
