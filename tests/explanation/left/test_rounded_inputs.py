"""Inputs that were rounded before they were logged, told from what a model lacks: on a single axis by another integrator,
with dry friction that sticks and constants of its own."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, explain, output_error
from jaxid.estimate.rounded_inputs import input_step
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.left.rounded_inputs import within_input_rounding
from jaxid.simulation.scaled import scaled_to

DT, FINE, SAMPLES = 0.02, 20, 1000
M, FV, FC, NOISE = 7.0, 9.0, 4.0, 0.0014
STEP = 40.0 / 255


def motion(force, drag=0.0):
    """Speeds [T] under forces [T], by semi-implicit steps of 1 ms; dry friction takes as much of the speed as it may."""
    h, v, found = DT / FINE, 0.0, []
    for own in force:
        found.append(v)
        for _ in range(FINE):
            free = (v + h * (own - drag * v * abs(v)) / M) / (1.0 + h * FV / M)
            v = np.sign(free) * max(abs(free) - h * FC / M, 0.0)
    return np.array(found)


def logs(logged, **law):
    """Four logs to fit and two held out, whose forces are `logged(force)`."""
    every, t = [], DT * np.arange(SAMPLES)
    for seed in range(6):
        rng = np.random.default_rng([43, seed])
        waves = [rng.uniform(4, 12) * np.sin(rng.uniform(0.3, 3.0) * t + rng.uniform(0, 6)) for _ in range(3)]
        force = np.where(t < 0.5, 0.0, np.sum(waves, axis=0))
        output = motion(force, **law) + NOISE * rng.normal(size=SAMPLES)
        every.append(Log.from_arrays(f"run {seed}", t, logged(force)[:, None], output[:, None], Axis().channels))
    return LogSet(every[:4]), LogSet(every[4:])


def rounded(force):
    return STEP * np.round(force / STEP)


def left(logs, held_out):
    """What a fit leaves, as it is and with the rounding of the inputs in mind."""
    own = scaled_to(output_error(Axis(), logs).robot, logs)
    state = held_out_state(own, held_out, {"v": NOISE})
    return state, within_input_rounding(own, held_out, state)


def test_what_rounding_of_the_inputs_leaves_is_nothing_missing():
    fitted, held_out = logs(rounded)
    state, marked = left(fitted, held_out)
    assert not state.adequate
    assert marked.inputs_rounded
    found = explain(output_error(Axis(), fitted), fitted, held_out)
    assert found.verdict == "adequate"
    assert not found.effects
    # By the noise that the logs show themselves it is hardly seen; by the true one it is, and said.
    assert "logged in coarse steps" in replace(found, before=marked, after=marked).sentence


@pytest.mark.parametrize("law", [{"drag": 0.1}, {"drag": 6.0}])
def test_a_force_beside_rounded_inputs_is_more_than_rounding(law):
    assert not left(*logs(rounded, **law))[1].inputs_rounded


def test_commands_of_a_few_levels_and_fine_ones_were_not_rounded():
    few, _ = logs(lambda force: 4.0 * np.round(force / 4.0))
    fine, _ = logs(lambda force: force)
    assert input_step(few, few.channels.inputs[0]) == 0.0
    assert input_step(fine, fine.channels.inputs[0]) == 0.0
    coarse, _ = logs(rounded)
    assert input_step(coarse, coarse.channels.inputs[0]) == pytest.approx(STEP, rel=1e-6)
