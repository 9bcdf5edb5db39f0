"""jaxid/estimate/linear/{integrals,balance}.py: machine code against the same balances in XLA, on any robot."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Log, LogSet, Omni, Parameter, Pioneer
from jaxid.effects.catalogue import effect_by_id
from jaxid.effects.drivetrain import AsymmetricFriction
from jaxid.estimate.linear import integrals as module
from jaxid.estimate.linear.integrals import Asked, SlowEquations, _in_xla, has_mass_matrix, integrals
from jaxid.estimate.linear.log_rows import gather, measured_speeds, positions_of

SAMPLES = 150


def _rolling(state, inputs, p, friction):
    pull = p["b"] * jnp.tanh(inputs["u"]) - p["k"] * jnp.sin(state["q"]) - friction["slide"]
    return {"v": pull / p["m"], "q": state["v"]}


def cart(dynamics=_rolling):
    """A mass on a spring, by a user; its position is not measured."""
    table = {name: Parameter(x, free=True, lower=0.0) for name, x in {"m": 2.0, "k": 3.0, "b": 4.0, "c": 0.5}.items()}
    channels = Channels(inputs=("u",), outputs=("v",), units={})
    return Custom(dynamics=dynamics, state_names=("v", "q"), own_channels=channels, table=table,
                  dry_friction=(("slide", "v", "c"),))  # fmt: skip


def frictionless():
    """Nothing rubs, and nothing is free."""
    channels = Channels(inputs=("u",), outputs=("v",), units={})
    return Custom(dynamics=lambda state, inputs, p: {"v": inputs["u"] / p["m"]}, state_names=("v",), own_channels=channels,
                  table={"m": Parameter(2.0)})  # fmt: skip


ROBOTS = {
    "axis": Axis(),
    "axis + stribeck_friction": Axis() + effect_by_id(Axis(), "stribeck_friction"),
    "axis, friction by direction": (Axis() + AsymmetricFriction()).with_values(
        **{"asymmetric_friction.asymmetry": 0.3}
    ),
    "omni": Omni(),
    "pioneer": Pioneer(),
    "user's own": cart(),
    "user's own, without friction": frictionless(),
}

LONG = (
    ("omni", "momentum"),
    ("pioneer", "momentum"),
    ("pioneer", "speed"),
    ("axis", "momentum"),
    ("axis, friction by direction", "speed"),
)
"""What XLA compiles for seconds and has a like in the other form, or on another robot."""


def logs_of(robot):
    """Two logs of speeds that wander through zero, the second with a gap, on irregular time stamps."""
    rng, channels = np.random.default_rng(3), robot.channels
    logs = []
    for k in range(2):
        time = np.cumsum(rng.uniform(0.015, 0.025, SAMPLES - 20 * k))
        inputs = np.repeat(rng.normal(size=(len(time) // 10, len(channels.inputs))) * 3, 10, axis=0)
        outputs = 0.1 * np.cumsum(rng.normal(size=(len(time), len(channels.outputs))), axis=0)
        outputs[40:42] = np.nan if k else outputs[40:42]
        logs.append(Log.from_arrays(f"log {k}", time, inputs, outputs, robot))
    return LogSet(logs)


def asked_of(robot, form):
    names = measured_speeds(robot)
    rows = gather(robot, logs_of(robot), names)
    mass = has_mass_matrix(robot, names)
    return Asked(names, positions_of(robot, names), robot.parameters.free_names, form, mass), rows


def same(found, expected, rows):
    assert len(found) == len(expected)
    inside = rows.dt > 0
    for a, b in zip(found, expected, strict=True):
        assert a.shape == b.shape
        scale = np.max(np.abs(b[inside]), initial=1e-12)
        np.testing.assert_allclose(a[inside], b[inside], rtol=1e-9, atol=1e-9 * scale)


@pytest.mark.usefixtures("double_precision")
@pytest.mark.parametrize(
    ("name", "form"),
    [
        pytest.param(name, form, marks=[pytest.mark.slow] * ((name, form) in LONG))
        for name in ROBOTS
        for form in ("momentum", "speed")
    ],
)
def test_machine_code_gives_what_xla_gives(name, form):
    robot = ROBOTS[name]
    asked, rows = asked_of(robot, form)
    numbers = robot.parameters.numbers
    own = np.array(np.nan)
    expected = _in_xla(robot.structure, asked, numbers, rows, own, None)
    found = integrals(robot.structure, asked, numbers, rows, own)
    same(found, expected, rows)
    same(integrals(robot.structure, asked, numbers, rows), expected[:6], rows)
    # Prescribed directions and positions are taken.
    directions, places = np.full_like(found[8], 0.5), found[9] + 0.1
    given = integrals(robot.structure, asked, numbers, rows, directions, places)
    np.testing.assert_array_equal(given[8], directions)
    np.testing.assert_array_equal(given[9], places)
    if np.any(found[8] != 0.5):
        assert np.max(np.abs(given[2] - found[2])) > 0


@pytest.mark.usefixtures("double_precision")
def test_blocks_of_rows_change_nothing(monkeypatch):
    robot = Omni()
    asked, rows = asked_of(robot, "momentum")
    expected = integrals(robot.structure, asked, robot.parameters.numbers, rows)
    monkeypatch.setattr(module, "_BLOCK", 33)
    for a, b in zip(integrals(robot.structure, asked, robot.parameters.numbers, rows), expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-300)


@pytest.mark.usefixtures("double_precision")
def test_a_function_without_machine_code_is_integrated_in_xla_and_says_so():
    def searching(state, inputs, p, friction):
        rates = _rolling(state, inputs, p, friction)
        return {**rates, "v": jnp.sort(jnp.stack([rates["v"], 1e6]))[0]}

    plain, robot = cart(), cart(searching)
    asked, rows = asked_of(plain, "momentum")
    with pytest.warns(SlowEquations, match="sort"):
        found = integrals(robot.structure, asked, robot.parameters.numbers, rows)
    same(found, integrals(plain.structure, asked, plain.parameters.numbers, rows), rows)
    assert all(part.flags.writeable for part in found)  # equations are made of them in place
