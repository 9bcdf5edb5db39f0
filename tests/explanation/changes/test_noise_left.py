"""What is noise of two sets of logs, and what never changes within a log is none."""

from dataclasses import replace

import numpy as np

from jaxid import AXIS, Axis, Log, LogSet, output_error
from jaxid.effects.sensor.bias import SensorBias
from jaxid.explanation.changes.candidates import of_mechanism
from jaxid.explanation.changes.joint import SIDES, Pair, white
from jaxid.explanation.changes.moved import Changes, Linear
from jaxid.explanation.changes.noise_left import noise_left
from jaxid.explanation.changes.sides import side_of
from jaxid.explanation.changes.whitened import Whitened

DT, SAMPLES, NOISE = 0.02, 500, 0.01


def recorded(seed, bias=0.0):
    logs = []
    for k in range(3):
        rng, v = np.random.default_rng([seed, k]), np.zeros(SAMPLES)
        u = np.repeat(rng.uniform(-4.0, 4.0, SAMPLES // 20), 20)
        for i in range(SAMPLES - 1):
            v[i + 1] = v[i] * np.exp(-2.0 * DT) + u[i] / 2.0 * (1.0 - np.exp(-2.0 * DT))
        y = v + bias + NOISE * rng.normal(size=SAMPLES)
        logs.append(Log.from_arrays(f"run {seed}.{k}", DT * np.arange(SAMPLES), u[:, None], {"v": y}, AXIS))
    return LogSet(logs)


def test_a_bias_is_no_slow_noise_beside_whatever_one_change_is_taken_off():
    sets = recorded(1), recorded(2, bias=2.0 * NOISE)
    robot = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0)
    robot = robot.change("Fc", free=False).change("offset", free=False)
    fit = output_error(robot, sets[0])
    sides = {side: side_of(fit, own) for side, own in zip(SIDES, sets, strict=True)}
    pair = Pair.of(fit.robot, fit.free_names, sides)
    residual, columns, states = {}, {}, {}
    for side, own in sides.items():
        y = own.simulated(pair.robot, [{}], own.nothing_moved)
        residual[side] = y[0] - own.observed
        columns[side] = np.zeros((1, *y.shape[1:]))
        states[side] = np.zeros((0, *y.shape[1:]))
    bias = of_mechanism(SensorBias(), pair.robot, "after")
    steady = Changes(bias, np.ones((1, *residual["after"].shape)), np.ones(1))
    other = replace(steady, outputs=np.random.default_rng(3).normal(size=steady.outputs.shape))
    seen = Linear(pair, residual, columns, states, (other, steady))
    plain = Whitened(seen, white(pair))
    every = [plain.directions(own) for own in seen.changes]
    for most in (0, 1):
        found = noise_left(seen, plain, every, most=most)
        assert len(found.taken) == 1 and found.taken[0] is steady
        assert not found.colours["after"][0].order or sum(found.colours["after"][0].coefficients) < 0.3
