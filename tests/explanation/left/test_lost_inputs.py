"""Complete and incomplete models on logs that lack rows in which the input changed, on an axis in closed form."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.explanation.left.lost_inputs import with_inputs_put_back

DT, SAMPLES = 0.02, 800
ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)


def recorded(law, seed, count=4, held=False, long=False):
    """Speeds under held levels that pass through `law`; one row in fifteen is missing. `held`: the robot lacked those
    commands, too, and went on with the one before. `long`: twenty rows in one place are missing instead."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-4, 4, SAMPLES // 10), 10)
        kept = np.append(True, rng.uniform(size=SAMPLES - 1) > 1 / 15)
        kept = np.abs(np.arange(SAMPLES) - 310) > 10 if long else kept
        applied = u[np.maximum.accumulate(np.where(kept, np.arange(SAMPLES), 0))] if held else u
        decay, v, found = np.exp(-2.0 * DT), 0.0, []
        for force in law(applied):
            found.append(v)
            v = force / 2.0 + (v - force / 2.0) * decay
        outputs = np.array(found) + 0.003 * rng.normal(size=SAMPLES)
        logs.append(
            Log.from_arrays(f"run {k}", DT * np.arange(SAMPLES)[kept], u[kept, None], outputs[kept, None], AXIS)
        )
    return LogSet(logs[:-1]), LogSet(logs[-1:])


def said(found):
    return [note for note in found.notes if note.startswith("Rows are missing in")]


def test_nothing_is_missing_in_a_complete_model_whose_inputs_changed_in_missing_rows():
    logs, held_out = recorded(lambda u: u, 1)
    fit = output_error(ROBOT, logs)
    assert fit.judgement.normalised_rms > 1.2  # the simulation changes the input too late
    found = explain(fit, logs, held_out)
    assert found.verdict == "adequate" and len(said(found)) == 1
    for name, value in (("M", 1.0), ("Fv", 2.0)):
        assert found.final[name].value == pytest.approx(value, abs=4 * found.final[name].std_error)


@pytest.mark.slow
def test_a_dead_zone_is_named_with_its_size_though_rows_are_missing():
    logs, held_out = recorded(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0), 2)
    found = explain(output_error(ROBOT, logs), logs, held_out)
    assert found.verdict == "named" and [effect.id for effect in found.effects] == ["actuator_dead_zone"]
    assert len(said(found)) == 1 and found.after.normalised_rms < 1.1
    edge = found.effects[0].parameters["threshold"]
    assert edge.value == pytest.approx(0.6, abs=4 * edge.std_error) and edge.std_error < 0.02


def test_of_long_gaps_nothing_is_said():
    """Twenty rows in one place may hold any number of commands."""
    logs, held_out = recorded(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0), 4, long=True)
    fit = output_error(ROBOT, logs)
    assert with_inputs_put_back(fit, logs, held_out, lambda message: None) == (fit, logs, held_out, "", False)


def test_inputs_that_were_held_are_left_alone():
    logs, held_out = recorded(lambda u: u, 3, held=True)
    found = explain(output_error(ROBOT, logs), logs, held_out)
    assert found.verdict == "adequate" and not said(found) and found.held_out is held_out


def test_a_command_that_changes_all_the_time_was_halfway_in_between():
    """A driver's stick moves smoothly: in the missing rows the command was about the mean of the two beside them."""

    def driven(seed):
        rng = np.random.default_rng(seed)
        time = DT * np.arange(SAMPLES)
        u = sum(
            a * np.sin(w * time + p)
            for a, w, p in zip(*rng.uniform([[1.0], [2.0], [0.0]], [[2.0], [9.0], [6.0]], (3, 4)), strict=True)
        )
        decay, v, found = np.exp(-2.0 * DT), 0.0, []
        for force in u:
            found.append(v)
            v = force / 2.0 + (v - force / 2.0) * decay
        kept = np.append(True, rng.uniform(size=SAMPLES - 1) > 0.05)
        outputs = np.array(found) + 0.003 * rng.normal(size=SAMPLES)
        return Log.from_arrays(f"run {seed}", time[kept], u[kept, None], outputs[kept, None], AXIS)

    logs, held_out = LogSet([driven(k) for k in range(3)]), LogSet([driven(7)])
    fit = output_error(ROBOT, logs)
    found = explain(fit, logs, held_out)
    assert found.verdict == "adequate" and "halfway" in said(found)[0]
    for name, value in (("M", 1.0), ("Fv", 2.0)):
        assert found.final[name].value == pytest.approx(value, abs=4 * found.final[name].std_error)
