"""Whether a controller's law is the one that ran, on the loop of `test_closed_loop`."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Controller, LogSet, Parameter, output_error
from jaxid.robots.replayed import replayed
from tests.robots.test_closed_loop import CONTROLLER, NOISE, _recorded, law, plant


@pytest.fixture(scope="module")
def logs():
    return LogSet([_recorded(f"run {seed}", seed, NOISE)[0] for seed in range(2)])


def test_the_law_that_ran_commands_what_was_logged(logs):
    found = replayed(plant(), logs, CONTROLLER)
    assert found is not None and found.share < 1e-6 and not found.sentence


def test_a_law_of_another_gain_is_said_to_be_another(logs):
    def softer(reference, measured, state, p):
        commands, after = law(reference, measured, state, p)
        return {"u": 0.97 * commands["u"]}, after

    other = Controller(softer, CONTROLLER.reference, states=CONTROLLER.states)
    found = replayed(plant(), logs, other)
    assert found is not None and found.command == "u" and found.share == pytest.approx(0.03, rel=0.1)
    fit = output_error(plant(), logs, controller=other)
    assert any("another u than was logged" in note for note in fit.notes)


def test_nothing_is_said_where_gains_are_estimated_or_measurements_lack(logs):
    free = replace(CONTROLLER, parameters={"kp": Parameter(1.0, free=True)})
    assert replayed(plant(), logs, free) is None
    assert replayed(plant(), logs, replace(CONTROLLER, fitted=False)) is None
    outputs = np.array(logs[0].outputs)
    outputs[5] = np.nan
    assert replayed(plant(), LogSet([replace(logs[0], outputs=outputs)]), CONTROLLER) is None
