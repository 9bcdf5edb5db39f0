"""Speeds that are differences of an encoder's counts: their noise pulls neighbours apart, and is rated too high by them; on an
axis in closed form."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.left.overrated import in_its_own_noise, small_after_all

DT, SAMPLES, COUNTS = 0.02, 1000, 500.0
MASS, VISCOUS = 1.0, 2.0
ROBOT = Axis().with_values(M=MASS, Fv=VISCOUS, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)


def recorded(late, seed, count=4):
    """Speeds whose errors are differences of rounded positions. `late`: they are those of the intervals before their stamps, as
    counts of an encoder give them; else those at their stamps."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-4, 4, SAMPLES // 10), 10)
        decay, v, position, places, speeds = np.exp(-VISCOUS / MASS * DT), 0.0, rng.uniform(), [], []
        for force in u:
            places.append(position)
            speeds.append(v)
            steady = force / VISCOUS
            position += steady * DT + (v - steady) * MASS / VISCOUS * (1.0 - decay)
            v = steady + (v - steady) * decay
        counts = np.floor(np.array(places) * COUNTS)
        rounded = np.diff(counts / COUNTS - places) / DT
        outputs = np.diff(places) / DT + rounded if late else np.array(speeds[1:]) + rounded
        logs.append(Log.from_arrays(f"run {k}", DT * np.arange(SAMPLES - 1), u[1:, None], {"v": outputs}, AXIS))
    return LogSet(logs[:-1]), LogSet(logs[-1:])


@pytest.mark.slow
def test_the_half_interval_that_differences_are_late_is_found_below_their_noise():
    logs, held_out = recorded(True, 1)
    fit = output_error(ROBOT, logs)
    state = held_out_state(fit.robot, held_out)
    assert state.normalised_rms < state.negligible and not fit.trustworthy
    own = in_its_own_noise(fit, held_out, state)
    assert own.noise["v"] < 0.9 * state.noise["v"] and not own.adequate
    found = explain(fit, logs, held_out)
    (effect,) = found.effects
    assert "sensor_delay" in (effect.id, *effect.equivalent_to)
    (late,) = (e for e in effect.parameters.values() if e.unit == "s")
    assert late.value == pytest.approx(DT / 2, abs=4 * late.std_error)
    assert abs(fit["M"].value - MASS) > 4 * fit["M"].std_error  # what the model without it had made of the delay
    assert found.final["M"].value == pytest.approx(MASS, abs=4 * found.final["M"].std_error)


def test_noise_of_counts_alone_raises_no_alarm():
    logs, held_out = recorded(False, 2)
    fit = output_error(ROBOT, logs)
    state = held_out_state(fit.robot, held_out)
    assert state.normalised_rms < 0.9 and state.p_white < 1e-6
    assert in_its_own_noise(fit, held_out, state) is state
    assert explain(fit, logs, held_out).verdict == "adequate"


def test_what_is_below_the_rated_noise_and_follows_nothing_is_small():
    logs, held_out = recorded(False, 2)
    fit = output_error(ROBOT, logs)
    rated = held_out_state(fit.robot, held_out)
    state = held_out_state(fit.robot, held_out, {"v": 0.6 * rated.noise["v"]})
    assert not state.adequate
    assert small_after_all(state, held_out, rated.noise).adequate
    assert not small_after_all(state, held_out, state.noise).adequate  # rated so, it is larger than the noise
    late = recorded(True, 1)
    wrong = held_out_state(output_error(ROBOT, late[0]).robot, late[1], {"v": 0.6 * rated.noise["v"]})
    assert not small_after_all(wrong, late[1], rated.noise).adequate


def controlled(width, seed, count=4, gain=24.0):
    """Speeds with white noise that a hard controller follows sample by sample, so that neighbouring samples differ by the
    motion, too; behind a soft dead zone of `width`."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        wanted = np.repeat(rng.uniform(-1.0, 1.0, SAMPLES // 50), 50)
        decay, v, commands, speeds = np.exp(-VISCOUS / MASS * DT), 0.0, [], []
        for aim in wanted:
            speeds.append(v + 0.02 * rng.normal())
            commands.append(VISCOUS * aim + gain * (aim - speeds[-1]))
            force = commands[-1] - (width * np.tanh(commands[-1] / width) if width else 0.0)
            v = force / VISCOUS + (v - force / VISCOUS) * decay
        u = np.array(commands)[:, None]
        logs.append(Log.from_arrays(f"run {k}", DT * np.arange(SAMPLES), u, {"v": np.array(speeds)}, AXIS))
    return LogSet(logs[:-1]), LogSet(logs[-1:])


@pytest.mark.parametrize("width", [0.0, pytest.param(0.16, marks=pytest.mark.slow)])
def test_noise_that_a_hard_controller_makes_quick_hides_nothing(width):
    logs, held_out = controlled(width, 3)
    fit = output_error(ROBOT, logs)
    state = held_out_state(fit.robot, held_out)
    assert state.normalised_rms < 1.0  # the noise is rated too high
    found = explain(fit, logs, held_out)
    assert found.verdict == ("adequate" if width == 0.0 else "named")
    assert [effect.id for effect in found.effects] == (["actuator_dead_zone"] if width else [])
