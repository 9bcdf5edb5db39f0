"""Speeds rounded to coarse steps, on an axis in closed form: rounding is not white, and no gap."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.left.rounding import within_rounding

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0)
STEP = 0.03


def recorded(seed, *, drag=0.0, below=0.05, held=100):
    """Speeds of an axis without dry friction, rounded to `STEP`, with noise of that share of it before."""
    logs = []
    for k in range(3):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-1.0, 1.0, 1000 // held), held)
        v, found, dt = 0.0, [], 0.02
        for force in u:
            found.append(v)
            for _ in range(10):  # Heun's method, for the drag
                slope = force - 2.0 * v - drag * v * abs(v)
                there = v + dt / 10 * slope
                v += dt / 20 * (slope + force - 2.0 * there - drag * there * abs(there))
        read = STEP * np.round((np.array(found) + below * STEP * rng.normal(size=len(u))) / STEP)
        logs.append(Log.from_arrays(f"run {k}", dt * np.arange(len(u)), u[:, None], {"v": read}, AXIS))
    return LogSet(logs)


@pytest.mark.parametrize("seed", range(4))
def test_what_rounding_makes_of_slow_speeds_is_no_gap(seed):
    logs = recorded(seed)
    state = replace(held_out_state(ROBOT, logs, {"v": STEP / np.sqrt(12)}), negligible=0.0)
    assert state.p_white < 1e-4 and not state.adequate
    assert within_rounding(logs, state).adequate


@pytest.mark.parametrize("seed", range(4))
def test_what_more_than_rounding_is_left_stays_one(seed):
    """A drag, of an error below that of rounding."""
    logs = recorded(seed, drag=0.06)
    state = held_out_state(ROBOT, logs, {"v": STEP / np.sqrt(12)})
    found = within_rounding(logs, state)
    assert found.normalised_rms < 1.15 and not found.adequate


def test_fine_sensors_are_left_alone():
    logs = recorded(7, drag=0.25, below=3.0)
    state = held_out_state(ROBOT, logs)
    assert within_rounding(logs, state) is state
