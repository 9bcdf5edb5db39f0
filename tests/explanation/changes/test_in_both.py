"""What the model lacks in both sets is no change: an axis with friction that falls with speed, by its own small steps."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain_change, output_error

DT, FINE, SAMPLES = 0.02, 20, 600
FV, FC, RISE, KNEE = 2.1, 0.8, 0.6, 0.12


def motion(u, mass):
    """Speeds [T] of an axis whose dry friction sticks and falls with speed, under `u` [T], by implicit Euler steps."""
    v, found, h = 0.0, [], DT / FINE
    for drive in u:
        found.append(v)
        for _ in range(FINE):
            dry = FC + RISE / (1.0 + (v / KNEE) ** 2)
            free = mass * v + h * drive
            v = np.sign(free) * max(abs(free) - h * dry, 0.0) / (mass + h * FV)
    return np.array(found)


def recorded(seed, largest, mass=1.3):
    logs = []
    for k in range(5):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-largest, largest, SAMPLES // 30), 30)
        v = motion(u, mass) + 0.005 * rng.normal(size=SAMPLES)
        logs.append(Log.from_arrays(f"run {seed}.{k}", DT * np.arange(SAMPLES), u[:, None], {"v": v}, AXIS))
    return LogSet(logs)


def changed(before, after):
    robot = Axis().with_values(M=1.0, Fv=1.5, Fc=0.5, offset=0.0).change("offset", free=False)
    fits = [output_error(robot, logs) for logs in (before, after)]
    assert not any(fit.trustworthy for fit in fits)
    return explain_change(*fits, before, after)


@pytest.mark.slow
def test_what_the_model_lacks_in_both_sets_is_no_change_of_what_drove_one_otherwise():
    found = changed(recorded(1, 5.0), recorded(2, 2.6))
    assert found.verdict == "unchanged" and found.change is None
    assert found.lacked and "The model lacks something in both sets, much like " in found.sentence
    assert found.to_dict()["lacked"] == list(found.lacked)
    assert {effect.id for effect in found.before.robot.effects} == set(found.lacked)


@pytest.mark.slow
def test_a_change_beside_what_both_lack_is_named():
    found = changed(recorded(3, 5.0), recorded(4, 5.0, mass=1.5))
    assert found.verdict == "named" and found.change.id == "M"
    size = found.change.differences["M"].size
    assert size.value == pytest.approx(0.2, abs=max(4 * size.std_error, 0.01))
