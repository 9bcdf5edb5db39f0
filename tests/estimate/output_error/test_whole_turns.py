"""An angle that a search left turns away is brought back where the model is the same, and only there."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, ParameterTable, float64, output_error
from jaxid.estimate.output_error.problem import parameters_at
from jaxid.estimate.output_error.setup import build
from jaxid.estimate.output_error.solvers import minimise_compiled
from jaxid.estimate.output_error.whole_turns import without_whole_turns

TRIM, LAG, DT = 0.035, 0.11, 0.02


def car(function, unit="rad"):
    """A yaw rate that follows a function of the steering angle with a lag."""
    per = {"rad": 1.0, "deg": np.pi / 180.0}[unit]
    return Custom(
        dynamics=lambda s, u, p: {"w": (3.0 * function(u["steer"] + per * p["trim"]) - s["w"]) / p["lag"]},
        state_names=("w",),
        own_channels=Channels(("steer",), ("w",), units={"steer": "rad", "w": "rad/s"}),
        table=ParameterTable(
            {"trim": Parameter(0.0, unit, free=True), "lag": Parameter(0.1, "s", free=True, lower=1e-3)}
        ),
    )


def driven(function):
    """Its exact answer to steps of the steering, with noise."""
    rng, a = np.random.default_rng(9), np.exp(-DT / LAG)
    steer, w = np.repeat(rng.uniform(-0.4, 0.4, 40), 10), [0.0]
    for u in steer[:-1]:
        w.append(a * w[-1] + (1.0 - a) * 3.0 * function(u + TRIM))
    noisy = np.array(w) + 0.01 * rng.standard_normal(len(w))
    return LogSet([Log.from_arrays("one", DT * np.arange(len(w)), steer[:, None], noisy[:, None], car(jnp.tan))])


@pytest.mark.parametrize(
    ("function", "unit", "turns", "nearest"),
    [
        (jnp.tan, "rad", 11, TRIM),
        (jnp.sin, "rad", 4, TRIM),
        (jnp.sin, "rad", 1, None),  # half a turn on, the robot steers the other way
        (jnp.tan, "deg", -3, np.degrees(TRIM)),
        (lambda angle: angle, "rad", 4, None),
    ],
)
def test_turns_that_change_nothing_are_taken_off(function, unit, turns, nearest):
    robot, half = car(function, unit), {"rad": np.pi, "deg": 180.0}[unit]
    away = turns * half if nearest is not None else 0.0
    with float64():
        at = float(nearest or TRIM) + away
        structure, problem, unknowns = build(robot, driven(np.tan), start={"trim": at, "lag": LAG})
        optimum = minimise_compiled(structure, problem, unknowns, max_steps=50)
        found = without_whole_turns(
            robot, structure, problem, optimum, {"trim": 0.0 if nearest else turns * half, "lag": LAG}
        )
        if nearest is None:
            assert found is None
            return
        trim = float(parameters_at(problem, found.z)[0])
    assert trim == pytest.approx(nearest, abs=2e-2 * half)


def test_a_search_that_leapt_turns_away_answers_near_its_start():
    """From a length and a lag many times too large it ended a turn away, and said so as a fact."""
    robot = Custom(
        dynamics=lambda s, u, p: {"w": (jnp.tan(u["steer"] + p["trim"]) / p["length"] - s["w"]) / p["lag"]},
        state_names=("w",),
        own_channels=Channels(("steer",), ("w",), units={"steer": "rad", "w": "rad/s"}),
        table=ParameterTable(
            {
                "trim": Parameter(0.0, "rad", free=True),
                "length": Parameter(5.0, "m", free=True, lower=0.01),
                "lag": Parameter(1.5, "s", free=True, lower=1e-3),
            }
        ),
    )
    fit = output_error(robot, driven(np.tan))
    assert fit["length"].value == pytest.approx(1.0 / 3.0, abs=4 * fit["length"].std_error)
    assert fit["trim"].value == pytest.approx(TRIM, abs=4 * fit["trim"].std_error)
