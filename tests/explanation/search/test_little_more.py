"""A gyro's small bias beside friction that falls with speed by a law of no catalogue: a drive by its own small steps."""

import numpy as np
import pytest
from scipy.signal import lfilter

from jaxid import AXIS, Axis, DifferentialDrive, Log, LogSet, explain, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.refit import refit
from jaxid.explanation.search.colour_left import leaves_only_colour
from jaxid.logs import noise_scale
from jaxid.simulation.scaled import scaled_to
from tests.explanation.closed_form_axis import driven

DT, FINE, SAMPLES = 0.02, 20, 600
HALF_MASS, LEVER, FV, FC = 1.3, 0.2, 2.1, 0.8
BIAS = 0.01


def side(u, excess=0.6):
    """Speeds [T] of one side, whose dry friction sticks, under the force `u` [T], by implicit Euler steps. With an inertia of
    mass times lever squared the sides do not feel each other."""
    v, found, h = 0.0, [], DT / FINE
    for force in u:
        found.append(v)
        for _ in range(FINE):
            dry = FC + excess / np.cosh(v / 0.1) ** 0.7
            free = HALF_MASS * v + h * force
            v = np.sign(free) * max(abs(free) - h * dry, 0.0) / (HALF_MASS + h * FV)
    return np.array(found)


def recorded(seed, count):
    logs = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        inputs = [np.repeat(rng.uniform(-4.0, 4.0, SAMPLES // 30), 30) for _ in range(2)]
        right, left = map(side, inputs)
        v = (right + left) / 2 + 0.01 * rng.normal(size=SAMPLES)
        w = (right - left) / (2 * LEVER) + BIAS + 0.02 * rng.normal(size=SAMPLES)
        time, channels = DT * np.arange(SAMPLES), DifferentialDrive().channels
        logs.append(Log.from_arrays(f"run {seed}.{k}", time, np.stack(inputs, axis=1), {"v": v, "w": w}, channels))
    return LogSet(logs)


@pytest.mark.slow
def test_a_bias_of_half_the_noise_is_named_beside_friction_whose_law_is_another():
    robot = DifferentialDrive().with_values(M=2.0, J=0.1, Fv=1.5, Fc=0.5, b=LEVER, gain=1.0)
    logs, held_out = recorded(5, 5), recorded(6, 3)
    found = explain(output_error(robot, logs), logs, held_out)
    assert found.verdict in ("named", "ambiguous") and found.after.normalised_rms < 1.03, found.sentence
    first, second = found.effects
    assert "stribeck_friction" in (first.id, *first.equivalent_to) and second.id == "sensor_bias"
    bias = second.parameters["bias_w"]
    assert bias.value == pytest.approx(BIAS, abs=4 * bias.std_error)


def coloured(logs, seed):
    """The logs with slow noise, ten times as large, on the speed."""
    rng, found = np.random.default_rng(seed), []
    for log in logs:
        slow = lfilter([0.6], [1.0, -0.8], rng.normal(size=len(log) + 100))[100:]
        outputs = {"v": log.output("v") + 0.03 * slow}
        found.append(Log.from_arrays(log.name, log.time, log.inputs, outputs, AXIS))
    return LogSet(found)


def test_only_the_effect_that_was_there_leaves_nothing_but_the_noise():
    """A limit of the commands, beside slow noise that makes most of what any model leaves; a drag is none, nor what is worth
    less than its price."""
    logs, held_out = (coloured(own, k) for k, own in enumerate(driven(lambda u: np.clip(u, -2.5, 2.5), 8, count=5)))
    noise = noise_scale(held_out, otherwise=logs)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs).change("Fc", free=False)

    def refitted(model, **values):
        start = {name: model.parameters[name].value for name in model.parameters.free_names} | values
        return refit(model, [start], logs, held_out, noise, {})

    base = refitted(robot)
    limit = refitted(
        base.robot + effect_by_id(base.robot, "voltage_saturation"), **{"voltage_saturation.inverse_limit": 0.35}
    )
    drag = refitted(base.robot + effect_by_id(base.robot, "quadratic_drag"))
    asked = (logs, held_out, noise)
    assert leaves_only_colour(base, limit, 100, *asked)
    assert not leaves_only_colour(base, drag, 100, *asked) and not leaves_only_colour(limit, limit, 100, *asked)


def limited(seed, count):
    """The same drive with plain dry friction behind a soft limit of its forces, and a gyro that reads 4 % too much, whose noise
    a filter has coloured."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        inputs = [np.repeat(rng.uniform(-6.0, 6.0, SAMPLES // 30), 30) for _ in range(2)]
        right, left = (side(5.0 * np.tanh(u / 5.0), excess=0.0) for u in inputs)
        v = (right + left) / 2 + 0.01 * rng.normal(size=SAMPLES)
        slow = lfilter([np.sqrt(1.0 - 0.75**2)], [1.0, -0.75], rng.normal(size=SAMPLES + 100))[100:]
        w = 1.04 * (right - left) / (2 * LEVER) + 0.05 * slow
        time, channels = DT * np.arange(SAMPLES), DifferentialDrive().channels
        logs.append(Log.from_arrays(f"run {seed}.{k}", time, np.stack(inputs, axis=1), {"v": v, "w": w}, channels))
    return LogSet(logs)


@pytest.mark.slow
def test_a_gyros_scale_is_named_beside_a_soft_limit_though_its_noise_is_coloured():
    """The scale closes little of the gap that the limit left, most of which is the noise that stays."""
    robot = DifferentialDrive().with_values(M=2.0, J=0.1, Fv=1.5, Fc=0.5, b=LEVER, gain=1.0)
    logs, held_out = limited(5, 5), limited(6, 3)
    found = explain(output_error(robot, logs), logs, held_out)
    assert found.verdict in ("named", "ambiguous") and found.colour is not None and found.colour.of_sensors, (
        found.sentence
    )
    first, second = found.effects
    assert "voltage_saturation" in (first.id, *first.equivalent_to) and second.id == "sensor_scale"
    assert second.parameters["error_w"].value == pytest.approx(0.04, abs=0.01)
