"""What the model lacks in both sets is no change: an axis with friction that falls with speed, by its own small steps."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, DifferentialDrive, Log, LogSet, explain_change, output_error

DT, FINE, SAMPLES = 0.02, 20, 600
FV, FC, RISE, KNEE = 2.1, 0.8, 0.6, 0.12


def motion(u, mass, rise=RISE):
    """Speeds [T] of an axis whose dry friction sticks and falls with speed by `rise`, under `u` [T], by implicit steps."""
    v, found, h = 0.0, [], DT / FINE
    for drive in u:
        found.append(v)
        for _ in range(FINE):
            dry = FC + rise / (1.0 + (v / KNEE) ** 2)
            free = mass * v + h * drive
            v = np.sign(free) * max(abs(free) - h * dry, 0.0) / (mass + h * FV)
    return np.array(found)


def recorded(seed, largest, mass=1.3, rise=RISE):
    logs = []
    for k in range(5):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-largest, largest, SAMPLES // 30), 30)
        v = motion(u, mass, rise) + 0.005 * rng.normal(size=SAMPLES)
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


@pytest.mark.slow
def test_what_grew_was_there_before():
    found = changed(recorded(5, 5.0, rise=0.3), recorded(6, 5.0, rise=0.9))
    assert found.verdict in ("named", "ambiguous") and found.lacked == ("stribeck_friction",)
    for own in (found.change, *found.equivalent):
        assert own.id.startswith("stribeck_friction") and "appeared" not in own.title
    name = next(name for name in found.change.differences if name.endswith("amplitude"))
    assert found.change.differences[name].size.value == pytest.approx(0.6, rel=0.15)


HALF = 0.2  # m, from the middle to either wheel


def driven(seed, largest, turning):
    """Logs of two wheels that do not feel each other, as with J = M HALF^2: only the left one's friction falls with speed."""
    logs, robot = [], DifferentialDrive()
    for k in range(4):
        rng = np.random.default_rng([seed, k])
        along, across = (np.repeat(rng.uniform(-1.0, 1.0, SAMPLES // 30), 30) for _ in range(2))
        u = largest * np.stack([along + turning * across, along - turning * across], axis=1)
        right, left = motion(u[:, 0], 1.3, 0.0), motion(u[:, 1], 1.3, 1.5 * RISE)
        seen = np.stack([(right + left) / 2.0, (right - left) / (2.0 * HALF)], axis=1)
        seen = seen + rng.normal(size=seen.shape) * (0.004, 0.02)
        logs.append(Log.from_arrays(f"run {seed}.{k}", DT * np.arange(SAMPLES), u, seen, robot.channels))
    return LogSet(logs)


@pytest.mark.slow
def test_what_one_wheel_lacks_in_both_sets_is_no_change_of_friction():
    robot = DifferentialDrive().with_values(b=HALF)
    before, after = driven(7, 4.0, 0.3), driven(8, 2.6, 1.0)
    fits = [output_error(robot, logs) for logs in (before, after)]
    assert not any(fit.trustworthy for fit in fits)
    found = explain_change(*fits, before, after)
    assert found.verdict == "unchanged" and found.lacked[0] == "stribeck_friction"
