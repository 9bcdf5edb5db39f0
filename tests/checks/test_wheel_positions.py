"""Pre-flight of counted positions of wheels: standing is no frozen sensor, and swapped wheels are told."""

import numpy as np
import pytest

from jaxid import Log, LogSet, Pioneer
from jaxid.checks.motion import speed

STEP, TIME = 0.012, 0.02 * np.arange(1000)
ROBOT = Pioneer(wheel_angles=True)
LEVELS = np.random.default_rng(2).choice([-6.0, -3.0, 0.0, 4.0, 7.0], (25, 2))
VOLTS = np.repeat(LEVELS, 40, axis=0)


def rates(volts):
    """Speeds of wheels that follow their own voltage in 0.2 s, and stand still at none."""
    found = np.zeros_like(volts)
    for k in range(1, len(volts)):
        found[k] = found[k - 1] + 0.1 * (1.3 * volts[k - 1] - found[k - 1])
    return np.where(np.abs(found) < 0.3, 0.0, found)


ANGLES = np.cumsum(0.02 * rates(VOLTS), axis=0)


def logged(angles, volts=VOLTS):
    counted = STEP * np.floor(angles / STEP)
    return LogSet(
        [Log.from_arrays("run", TIME, volts, dict(zip(ROBOT.measured_angles, counted.T, strict=True)), ROBOT)]
    )


def warned(logs):
    return [f for f in logs.preflight() if f.severity != "note"]


@pytest.mark.filterwarnings("error")
def test_an_encoder_that_is_slower_than_the_log_shows_the_speed_all_the_same():
    """Read at every fifth row: neighbouring rows hold no difference of its own."""
    turning = rates(VOLTS)[:, 0]
    noisy = ANGLES + 0.005 * np.random.default_rng(3).normal(size=ANGLES.shape)
    seldom = np.where((np.arange(len(TIME)) % 5 == 0)[:, None], noisy, np.nan)
    for angles in (noisy, seldom):
        (log,) = logged(angles)
        shown = speed(log, ROBOT.measured_angles[0])
        there = np.isfinite(shown)
        assert np.array_equal(there, np.isfinite(angles[:, 0]))
        assert np.std((shown - turning)[there]) < 0.25 * np.std(turning)


def test_wheels_that_stand_and_creep_are_sound():
    assert not warned(logged(ANGLES))
    creeping = ANGLES.copy()
    creeping[500:] = ANGLES[500] + np.outer(0.004 * np.arange(500), [1.0, 1.0])  # a step every third sample
    assert not [f for f in warned(logged(creeping)) if f.check in ("frozen_sensor", "slow_sensor")]


@pytest.mark.parametrize("until", [420, 1000])
def test_a_position_that_froze_in_motion_is_told(until):
    moving = int(np.argmax(np.abs(rates(VOLTS)[:400, 1]) > 6.0))
    frozen = ANGLES.copy()
    frozen[moving:until, 1] = frozen[moving, 1]
    found = [f for f in warned(logged(frozen)) if f.check == "frozen_sensor"]
    assert [f.column for f in found] == ["phi3"]


def test_swapped_wheels_and_a_wheel_that_counts_backwards_are_told():
    assert any("swapped" in f.message for f in warned(logged(ANGLES[:, ::-1])))
    backwards = [f for f in warned(logged(ANGLES * [1.0, -1.0])) if f.check == "sign_flipped"]
    assert backwards and "'phi3' has the opposite sign" in backwards[0].message
