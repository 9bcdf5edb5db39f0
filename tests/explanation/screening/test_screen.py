"""A first look: what it promises of a constant of the table that an effect frees."""

import numpy as np
import pytest

from jaxid import AXIS, Custom, Integrator, Log, LogSet, Parameter, Pioneer
from jaxid.effects import effect_by_id
from jaxid.explanation.screening.screen import screen
from jaxid.logs import noise_scale
from jaxid.simulation.simulate import simulate
from tests.explanation.closed_form_axis import driven as in_closed_form

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


CART = {"M": Parameter(1.2, "kg", free=True, lower=0.0), "B": Parameter(2.0, "N s/m"), "mismatch": Parameter(0.0, "")}


def cart(state, inputs, p):
    force = inputs["u"] / (1.0 - p["mismatch"]) - p["B"] * state["v"]
    return {"v": force / p["M"], "q": state["v"]}


@pytest.mark.parametrize("true", [0.02, -0.03])
def test_a_mechanism_of_a_users_robot_is_looked_for_though_nobody_says_how_large_it_is(true):
    """A parameter that is zero and has no typical size: a first look at one of one, a wheel of no radius, saw nothing."""
    robot = Custom(dynamics=cart, state_names=("v", "q"), own_channels=AXIS, table=CART,
                   mechanisms={"wheel_radius_mismatch": ("mismatch",)})  # fmt: skip
    logs, _ = in_closed_form(lambda u: u / (1.0 - true), 3, count=3)
    effect = effect_by_id(robot, "wheel_radius_mismatch")
    (found,) = screen(robot.with_values(M=1.0), logs, [effect], noise_scale(logs), {})
    assert found.share > 0.8 and found.starts[0]["mismatch"] == pytest.approx(true, abs=0.003)
