"""jaxid/explanation/search/by_chance.py: delays that scatter leave more than noise, and no more than they leave is missing."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.refits.refit import refit
from jaxid.explanation.search.by_chance import _by_size, _where_drawn, by_chance

LONGEST, NOISE = 0.08, 0.03  # s, m/s
AXIS_MODEL = Axis().change("Fc", free=False).with_values(Fc=0.0)


def _run(seed, commands=False, samples=False, push=0.0, least=0.0):
    """1 kg with 2 N s/m in steps of a millisecond: commands, or samples, that come late by times of their own."""
    random = np.random.default_rng(seed)
    count, each = 400, 20
    u = np.repeat(random.uniform(-4.0, 4.0, count), each)
    u = np.repeat(u.reshape(-1, 10 * each)[:, 0], 10 * each)  # held for 0.2 s
    applied = u.copy()
    if commands:
        changes = 10 * each * np.arange(1, count // 10)
        arrived = np.maximum.accumulate(
            changes + random.uniform(1000.0 * least, 1000.0 * LONGEST, len(changes)).astype(int)
        )
        for change, at in zip(changes, arrived, strict=True):
            applied[change:at] = applied[change - 1]
    v, fine = 0.0, []
    for force in applied + push * np.sin(0.0015 * np.arange(len(applied))):
        fine.append(v)
        decay = np.exp(-0.002)
        v = 0.5 * force + (v - 0.5 * force) * decay
    at = each * np.arange(count)
    seen = np.maximum(at - random.uniform(1000.0 * least, 1000.0 * LONGEST, count).astype(int), 0) if samples else at
    outputs = {"v": np.array(fine)[seen] + NOISE * random.normal(size=count)}
    return Log.from_arrays(f"run {seed}", 0.02 * np.arange(count), u[at][:, None], outputs, AXIS)


def _logs(**how):
    return LogSet(_run(seed, **how) for seed in range(3)), LogSet([_run(7, **how), _run(8, **how)])


def _first(log, samples):
    return Log.from_arrays(log.name, log.time[:samples], log.inputs[:samples], {"v": log.outputs[:samples, 0]}, AXIS)


def _judged(law, fit_logs, held_out):
    fit = output_error(AXIS_MODEL + effect_by_id(AXIS_MODEL, law, "jittering"), fit_logs)
    return by_chance(fit, fit_logs, held_out, held_out_state(fit.robot, held_out, {"v": NOISE}))


@pytest.mark.slow
def test_commands_that_scatter_leave_what_draws_of_them_leave_and_no_draws_of_samples_do():
    logs = _logs(commands=True)
    state = _judged("input_delay", *logs)
    assert state.normalised_rms > 1.3 and state.by_chance and state.adequate
    assert not _judged("sensor_delay", *logs).adequate


def test_what_is_left_elsewhere_than_where_draws_leave_it_is_no_chance():
    """As large on the whole, and as slow, but not where commands change."""
    random = np.random.default_rng(3)
    size = np.where(np.arange(600) % 100 < 30, 4.0, 1.0)[:, None]
    draws = [[size * random.normal(size=(600, 1))] for _ in range(60)]
    where = [np.mean(np.square([own for (own,) in draws]), axis=0)]
    seen = size * random.normal(size=(600, 1))
    assert _where_drawn([seen], draws, where, 0.01)
    assert not _where_drawn([np.roll(seen, 50, axis=0)], draws, where, 0.01)


@pytest.mark.slow
def test_samples_that_scatter_leave_what_draws_of_them_leave_and_no_draws_of_commands_do():
    logs = _logs(samples=True)
    state = _judged("sensor_delay", *logs)
    assert state.normalised_rms > 1.3 and state.by_chance
    assert not _judged("input_delay", *logs).adequate


def test_what_is_missing_besides_is_not_left_by_chance():
    assert not _judged("input_delay", *_logs(commands=True, push=0.4)).by_chance


@pytest.mark.slow
def test_what_is_missing_in_fitted_logs_alone_is_not_left_by_chance():
    pushed, held_out = _logs(commands=True, push=1.0)[0], _logs(commands=True)[1]
    assert _judged("input_delay", *_logs(commands=True)).by_chance
    assert not _judged("input_delay", pushed, held_out).by_chance


def test_a_model_without_such_a_law_is_judged_as_before():
    fit_logs, held_out = _logs()
    fit = output_error(AXIS_MODEL, fit_logs)
    state = replace(held_out_state(fit.robot, held_out), normalised_rms=3.0)
    assert by_chance(fit, fit_logs, held_out, state) is state


def test_too_few_samples_for_autocorrelations_are_not_said_to_be_chance():
    fit_logs, held_out = _logs(commands=True)
    fit = output_error(AXIS_MODEL + effect_by_id(AXIS_MODEL, "input_delay", "jittering"), fit_logs)
    short = LogSet([_first(held_out[0], 60)])
    state = held_out_state(fit.robot, short, {"v": NOISE / 10.0})
    assert not state.adequate and not by_chance(fit, fit_logs, short, state).by_chance


@pytest.mark.parametrize(("law", "way"), [("input_delay", "commands"), ("sensor_delay", "samples")])
def test_the_size_of_what_is_left_tells_how_much_delays_scatter(law, way):
    """Between 40 and 80 ms: what the mean law alone hardly tells."""
    logs, held_out = _logs(**{way: True}, least=0.04)
    effect = effect_by_id(AXIS_MODEL, law, "scattered")
    start = {"M": 1.0, "Fv": 2.0, "offset": 0.0, effect.key("delay"): 0.05, effect.key("scatter"): 0.005}
    trial = replace(refit(AXIS_MODEL + effect, [start], logs, held_out, {"v": NOISE}, {}), id=law)
    own = _by_size(trial, effect, logs, {"v": NOISE})[0]  # by changes of command, each late by a time of its own
    assert own.parameters.numbers[effect.key("delay")] == pytest.approx(0.06, abs=0.004)
    assert own.parameters.numbers[effect.key("scatter")] == pytest.approx(0.02, abs=0.005)
    assert not own.parameters[effect.key("scatter")].free


@pytest.mark.slow
def test_late_commands_that_all_take_a_while_are_named_with_their_scatter():
    fit_logs, held_out = _logs(commands=True, least=0.04)
    found = explain(output_error(AXIS_MODEL, fit_logs), fit_logs, held_out)
    assert found.verdict == "named" and [(e.id, e.law) for e in found.effects] == [("input_delay", "scattered")]
    assert "s about their mean" in found.sentence
    delay, scatter = (found.effects[0].parameters[name] for name in ("delay", "scatter"))
    assert delay.value == pytest.approx(0.06, abs=4.0 * delay.std_error)
    assert scatter.value == pytest.approx(0.02, abs=0.005)


@pytest.mark.slow
def test_late_commands_are_named_though_no_model_foretells_them():
    fit_logs, held_out = _logs(commands=True)
    found = explain(output_error(AXIS_MODEL, fit_logs), fit_logs, held_out)
    assert found.verdict == "named" and [(e.id, e.law) for e in found.effects] == [("input_delay", "jittering")]
    assert found.effects[0].equivalent_to == () and "each of them by chance" in found.sentence
    assert found.noise_floor == found.after.normalised_rms and found.gap_closed == pytest.approx(1.0)
    delay = found.effects[0].parameters["delay"]
    assert delay.value == pytest.approx(LONGEST / 2, abs=4.0 * delay.std_error)
