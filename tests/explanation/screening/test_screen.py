"""A first look: what it promises of a constant of the table that an effect frees."""

import numpy as np
import pytest

from jaxid import Integrator, Log, LogSet, Pioneer
from jaxid.effects import effect_by_id
from jaxid.explanation.screening.screen import screen
from jaxid.simulation.simulate import simulate

NOISE = {"eta1": 0.004, "eta2": 0.01}


def driven(robot, seed):
    """Ten seconds of random levels, half a second each."""
    rng = np.random.default_rng(seed)
    time = 0.02 * np.arange(500)
    inputs = np.repeat(rng.uniform(-8.0, 8.0, (20, 2)), 25, axis=0)
    still = LogSet([Log.from_arrays("one", time, inputs, np.zeros((500, 2)), robot)])
    (seen,) = simulate(robot, still, integrator=Integrator(4))
    outputs = seen[:, :2] + rng.normal(size=(500, 2)) * list(NOISE.values())
    return LogSet([Log.from_arrays("one", time, inputs, outputs, robot)])


@pytest.mark.parametrize("share", [0.05, -0.08])
def test_a_wrong_constant_is_promised_where_it_is(share):
    """To first order, from the table's value: not from a track of one metre."""
    robot = Pioneer()
    true = (1.0 + share) * robot.parameters["L"].value
    logs = driven(robot.with_values(L=true), 1)
    (found,) = screen(robot, logs, [effect_by_id(robot, "effective_track")], NOISE, {})
    assert found.share > 0.8  # to first order, and a large change bends
    assert found.starts[0]["L"] == pytest.approx(true, rel=0.02)
