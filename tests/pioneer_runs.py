"""Runs of the Pioneer by the independent simulator, which linear estimates of it are made from."""

from functools import cache

import numpy as np

from jaxid import Log, LogSet, Pioneer
from reference.excitation import prbs, steps, wheels
from reference.logs import simulate_log
from reference.pioneer import PIONEER

SAMPLING = 0.02
TRUTH = Pioneer().parameters.numbers
WRONG = {"I0": 0.5, "Ir1": 1e-4, "Ir": 0.003, "Ip1": 2e-4, "Cs1": 0.01, "Cv1": 0.001, "Cs": 0.2, "Cv": 0.1}
"""Table values far from the truth: an estimate that agrees with the truth cannot come from them."""


def as_log(name, frame, robot):
    channels = robot.channels
    return Log.from_arrays(
        name, frame["t"], frame[list(channels.inputs)].to_numpy(), frame[list(channels.outputs)].to_numpy(), robot
    )


@cache
def uncoupled_runs():
    """Straight and on the spot, the centre of mass on the axle so that turning on the spot is uncoupled."""
    rng, still = np.random.default_rng(5), np.zeros(1000)
    signals = {
        "straight_prbs": (prbs(1000, 15, 4, 9, rng), still),
        "straight_steps": (steps(1000, [0, 5, 8, 3, 0, -6]), still),
        "spot_prbs": (still, prbs(1000, 20, 3, 7, rng)),
        "spot_steps": (still, steps(1000, [0, 4, 6, 2.5, 0, -5])),
    }
    robot = PIONEER.with_parameters(ym=0.0)
    return LogSet(as_log(name, simulate_log(robot, wheels(*u), SAMPLING), Pioneer()) for name, u in signals.items())
