"""A cart that runs into a spring, by SciPy; the table has the place of the spring wrong by 8 %."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import Channels, Custom, Log, LogSet, Parameter
from jaxid.effects import effect_by_id
from jaxid.effects.table_constants import TableConstants
from jaxid.explanation.refits.refit import refit
from jaxid.explanation.search import constants_from_the_end, table_constants
from jaxid.explanation.search.table_constants import constants_in_the_end
from jaxid.simulation.scaled import scaled_to

CHANNELS = Channels(("u",), ("v", "q"), units={"u": "N", "v": "m/s", "q": "m"})
M, FV, K, WALL = 8.0, 20.0, 300.0, 0.54
NOISE = {"v": 0.004, "q": 0.002}


def dynamics(state, inputs, p):
    spring = p["k"] * jnp.maximum(state["q"] - p["wall"], 0.0)
    return {"v": (inputs["u"] - p["Fv"] * state["v"] - spring) / p["M"], "q": state["v"]}


CART = Custom(
    dynamics=dynamics,
    state_names=("v", "q"),
    own_channels=CHANNELS,
    table={
        "M": Parameter(M, "kg", free=True, lower=0.1),
        "Fv": Parameter(FV, "N s/m", free=True, lower=0.0),
        "k": Parameter(K, "N/m", free=True, lower=0.0),
        "wall": Parameter(0.5, "m"),
    },
)


def driven(name, seed):
    random = np.random.default_rng(seed)
    u, state, seen = np.repeat(random.uniform(-25.0, 45.0, 25), 20), np.zeros(2), []
    for force in u:
        seen.append(state)

        def rates(_, state, force=force):
            return [(force - FV * state[0] - K * max(state[1] - WALL, 0.0)) / M, state[0]]

        state = solve_ivp(rates, (0.0, 0.02), state, rtol=1e-8, atol=1e-10).y[:, -1]
    shown = np.array(seen) + random.normal(size=(len(u), 2)) * list(NOISE.values())
    return Log.from_arrays(name, 0.02 * np.arange(len(u)), u[:, None], shown, CHANNELS)


def test_a_place_that_is_wrong_is_found_from_the_model_with_the_scale_that_stands_for_it():
    """Larger by 8 % on both sensors, with mass and friction larger as well, is the same motion."""
    logs, held_out = LogSet([driven("a", 1), driven("b", 2)]), LogSet([driven("c", 3)])
    robot = scaled_to(CART, logs)

    def fitted(model, **start):
        own = {name: model.parameters[name].value for name in model.parameters.free_names}
        return refit(model, [own | start], logs, held_out, NOISE, {})

    base = fitted(robot)
    scaled = robot + effect_by_id(robot, "sensor_scale", "each_channel")
    after = fitted(scaled, **{"sensor_scale.error_v": 0.05, "sensor_scale.error_q": 0.05})
    assert after.held_out.normalised_rms < 1.05 and base.held_out.normalised_rms > 3.0
    bare = base.robot.with_values(**{n: after.robot.parameters[n].value for n in base.robot.parameters.free_names})
    (wrong,) = constants_in_the_end(bare, after, logs, held_out, NOISE)
    assert wrong.shares == {"wall": pytest.approx(0.08, abs=0.002)}
    numbers = wrong.robot.parameters.numbers
    assert (numbers["M"], numbers["Fv"], numbers["k"]) == pytest.approx((M, FV, K), rel=0.01)


def test_what_no_constant_gives_back_has_none():
    """The speed alone is shown larger: no other place of the spring does that."""
    logs, held_out = LogSet([driven("a", 1), driven("b", 2)]), LogSet([driven("c", 3)])
    robot = scaled_to(CART.with_values(wall=WALL), logs)
    scaled = robot + effect_by_id(robot, "sensor_scale", "each_channel")

    def with_scale(log):
        outputs = np.array(log.outputs)
        outputs[:, 0] *= 1.1
        return Log.from_arrays(log.name, log.time, log.inputs, outputs, CHANNELS)

    logs, held_out = (LogSet([with_scale(log) for log in own]) for own in (logs, held_out))
    own = {name: scaled.parameters[name].value for name in scaled.parameters.free_names}
    noise = NOISE | {"v": 1.1 * NOISE["v"]}
    after = refit(scaled, [own | {"sensor_scale.error_v": 0.1}], logs, held_out, noise, {})
    assert after.held_out.normalised_rms < 1.05
    assert constants_in_the_end(robot, after, logs, held_out, noise) == []


def test_numbers_that_lead_to_motion_too_fast_to_follow_are_no_answer(monkeypatch):
    """To first order a stiffness may have to be a million times what it is: that stops no explanation."""
    logs = LogSet([driven("a", 1)])
    robot = scaled_to(CART, logs)
    scaled = robot + effect_by_id(robot, "sensor_scale", "each_channel")
    own = {name: scaled.parameters[name].value for name in scaled.parameters.free_names}
    after = refit(scaled, [own], logs, logs, NOISE, {})
    stiff = (robot + TableConstants(("wall",))).with_values(k=1e15, wall=0.52)
    monkeypatch.setattr(table_constants, "models_from_the_end", lambda *given: [(("wall",), stiff)])
    assert constants_in_the_end(robot, after, logs, logs, NOISE) == []


def test_changes_that_are_no_numbers_lead_nowhere(monkeypatch):
    logs = LogSet([driven("a", 1)])
    robot = scaled_to(CART, logs)
    scaled = robot + effect_by_id(robot, "sensor_scale", "each_channel")
    after = SimpleNamespace(effect=scaled.effects[0], robot=scaled)
    count = len(scaled.parameters.free_names) + 1
    monkeypatch.setattr(constants_from_the_end, "secants_of", lambda *given: (None, np.full((count, 9), np.nan), None))
    assert constants_from_the_end.models_from_the_end(robot, after, ["wall"], NOISE, logs) == []
