"""A load in some of the logs, on an axis in closed form: in which ones, each log itself tells."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.explanation.payload_by_log import sorted_by_payload

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)


def recorded(masses, law=lambda u: u, more=None):
    """Speeds of an axis without dry friction, of another mass in every log."""
    logs = []
    for k, mass in enumerate(masses):
        rng = np.random.default_rng([9, k])
        u = np.repeat(rng.uniform(-4, 4, 60), 10)
        decay, v, found = np.exp(-2.0 / mass * 0.02), 0.0, []
        for force in law(u):
            found.append(v)
            v = force / 2.0 + (v - force / 2.0) * decay
        outputs = {"v": np.array(found) + 0.003 * rng.normal(size=len(u))}
        extra = None if more is None else {"payload": np.full(len(u), more[k])}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(len(u)), u[:, None], outputs, AXIS, extra=extra))
    return LogSet(logs[:-2]), LogSet(logs[-2:])


def quiet(message):
    """Nobody listens."""


def payloads(*sets):
    return [float(log.extra["payload"].iloc[0]) for logs in sets for log in logs]


def test_a_load_in_some_logs_is_named_with_its_size_and_its_logs():
    logs, held_out = recorded([1.0, 1.3, 1.0, 1.3, 1.0, 1.0, 1.3])
    found = explain(output_error(ROBOT, logs), logs, held_out)
    assert found.verdict == "named"
    (effect,) = found.effects
    assert (effect.id, effect.law) == ("payload_change", "in_some_logs")
    mass = effect.parameters["mass"]
    assert mass.value == pytest.approx(0.3, abs=4 * mass.std_error) and mass.std_error < 0.01
    assert found.after.normalised_rms == pytest.approx(1.0, abs=0.06)
    (said,) = [note for note in found.notes if "a load that is there in some of the logs" in note]
    assert "run 1, run 3, run 6." in said


def test_a_single_log_with_less_is_found():
    logs, held_out = recorded([1.0, 1.0, 1.0, 0.8, 1.0, 1.0, 1.0])
    found, others, _ = sorted_by_payload(output_error(ROBOT, logs), logs, held_out, quiet)
    assert payloads(found, others) == [1, 1, 1, 0, 1, 1, 1]


def test_what_the_files_say_is_believed():
    logs, held_out = recorded([1.0, 1.3, 1.0, 1.3, 1.0, 1.0, 1.3], more=[0, 1, 0, 1, 0, 0, 1])
    fit = output_error(ROBOT, logs)
    assert sorted_by_payload(fit, logs, held_out, quiet) == (logs, held_out, "")
    found = explain(fit, logs, held_out)
    assert [(effect.id, effect.law) for effect in found.effects] == [("payload_change", "in_some_logs")]


@pytest.mark.parametrize("law", [lambda u: u, lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.8, 0.0)])
def test_logs_of_one_load_are_not_sorted_whatever_else_is_missing(law):
    logs, held_out = recorded([1.0] * 6, law)
    assert sorted_by_payload(output_error(ROBOT, logs), logs, held_out, quiet) == (logs, held_out, "")
