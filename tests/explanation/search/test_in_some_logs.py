"""A load in some of the logs, on an axis in closed form: in which ones, each log itself tells."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.explanation.search.in_some_logs import sorted_logs

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)


def recorded(masses, law=lambda u: u, more=None, friction=lambda k: 2.0, gain=lambda k: 1.0):
    """Speeds of an axis without dry friction, of another mass, friction or gain in every log."""
    logs = []
    for k, mass in enumerate(masses):
        rng = np.random.default_rng([9, k])
        u = np.repeat(rng.uniform(-4, 4, 60), 10)
        decay, v, found = np.exp(-friction(k) / mass * 0.02), 0.0, []
        for force in gain(k) * law(u) / friction(k):
            found.append(v)
            v = force + (v - force) * decay
        outputs = {"v": np.array(found) + 0.003 * rng.normal(size=len(u))}
        extra = None if more is None else {"payload": np.full(len(u), more[k])}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(len(u)), u[:, None], outputs, AXIS, extra=extra))
    return LogSet(logs[:-2]), LogSet(logs[-2:])


def quiet(message):
    """Nobody listens."""


def payloads(*sets):
    return [float(log.extra["other_floor"].iloc[0]) for logs in sets for log in logs]


@pytest.mark.slow
def test_a_load_in_some_logs_is_named_with_its_size_and_its_logs():
    logs, held_out = recorded([1.0, 1.3, 1.0, 1.3, 1.0, 1.0, 1.3])
    found = explain(output_error(ROBOT, logs), logs, held_out)
    assert found.verdict == "named"
    (effect,) = found.effects
    assert (effect.id, effect.law) == ("payload_change", "in_some_logs")
    mass = effect.parameters["mass"]
    assert mass.value == pytest.approx(0.3, abs=4 * mass.std_error) and mass.std_error < 0.01
    assert found.after.normalised_rms == pytest.approx(1.0, abs=0.06)
    assert any(note.startswith("The payload of run 1, run 3, run 6 is another") for note in found.notes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "effect", "size"),
    [
        ({"friction": lambda k: 2.6 if k in (0, 3, 5) else 2.0}, "surface_change", ("viscous", 0.3)),
        ({"gain": lambda k: 0.93 if k in (0, 3, 5) else 1.0}, "battery_sag", ("share", 0.07)),
    ],
)
def test_another_floor_or_battery_in_some_logs_is_told_apart_from_a_load(changed, effect, size):
    logs, held_out = recorded([1.0] * 7, **changed)
    found = explain(output_error(ROBOT, logs), logs, held_out)
    assert found.verdict == "named"
    assert [(own.id, own.law) for own in found.effects] == [(effect, "in_some_logs")]
    estimate = found.effects[0].parameters[size[0]]
    # Which of the two kinds of logs is the other one is a matter of words.
    there = estimate.value if payloads(found.held_out) == [1, 0] else (1 / (1 + estimate.value) - 1)
    if effect == "battery_sag":
        there = estimate.value if payloads(found.held_out) == [1, 0] else 1 - 1 / (1 - estimate.value)
    assert there == pytest.approx(size[1], abs=4 * estimate.std_error + 1e-3)


def test_a_single_log_with_less_is_found():
    logs, held_out = recorded([1.0, 1.0, 1.0, 0.8, 1.0, 1.0, 1.0])
    found, others, _ = sorted_logs(output_error(ROBOT, logs), logs, held_out, quiet)
    assert payloads(found, others) == [0, 0, 0, 1, 0, 0, 0]


@pytest.mark.slow
def test_what_the_files_say_is_believed():
    logs, held_out = recorded([1.0, 1.3, 1.0, 1.3, 1.0, 1.0, 1.3], more=[0, 1, 0, 1, 0, 0, 1])
    fit = output_error(ROBOT, logs)
    assert sorted_logs(fit, logs, held_out, quiet) == (logs, held_out, False)
    found = explain(fit, logs, held_out)
    assert [(effect.id, effect.law) for effect in found.effects] == [("payload_change", "in_some_logs")]


@pytest.mark.parametrize("law", [lambda u: u, lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.8, 0.0)])
def test_logs_of_one_load_are_not_sorted_whatever_else_is_missing(law):
    logs, held_out = recorded([1.0] * 6, law)
    assert sorted_logs(output_error(ROBOT, logs), logs, held_out, quiet) == (logs, held_out, False)
