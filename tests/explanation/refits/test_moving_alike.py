"""Other numbers of the same motion, against what the equations say by hand."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Log, LogSet, Parameter
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.moving_alike import values_moving_alike


def test_a_straight_line_of_two_curves_is_viscous_friction():
    robot = Axis().with_values(M=93.0, Fv=4209.0, Fc=29.7, offset=-6.9)
    model = robot + effect_by_id(robot, "asymmetric_viscous_friction", "shape")
    curve = model.effects[0]
    reach, last = 0.125, -511.0
    heights = {
        curve.key(f"at_{k + 1}_{way}"): height
        for way, bend in (("forward", 30.0), ("backward", -12.0))
        for k, place in enumerate(curve.places[1:])
        for height in (last * place + bend * np.sin(np.pi * place),)
    }
    model = model.with_values(**heights, **{curve.key("reach"): reach})
    logs = moved_anyhow("u", "v", reach)
    found = values_moving_alike(model, curve.key("at_4_backward"), 0.0, logs)
    line = last / reach
    assert found["Fv"] == pytest.approx(4209.0 + line, rel=1e-9)
    assert (found["M"], found["Fc"], found["offset"]) == pytest.approx((93.0, 29.7, -6.9), rel=1e-9)
    for way, bend in (("forward", 30.0), ("backward", -12.0)):
        own = [found.get(curve.key(f"at_{k + 1}_{way}"), 0.0) for k in range(4)]
        assert own == pytest.approx([bend * np.sin(np.pi * place) for place in curve.places[1:]], abs=1e-7)


def moved_anyhow(name, seen, size):
    random = np.random.default_rng(3)
    channels = Channels((name,), (seen,))
    outputs = size * random.uniform(-1.0, 1.0, (400, 1))
    return LogSet([Log.from_arrays("anyhow", 0.01 * np.arange(400), random.normal(size=(400, 1)), outputs, channels)])


def pushed(free):
    """A mass with friction and drag, moved by a motor whose factor is unknown."""
    table = {
        "M": Parameter(4.0, "kg", free="M" in free, lower=0.1),
        "Fv": Parameter(3.0, "N s/m", free="Fv" in free),
        "drag": Parameter(2.0, "N s2/m2", free="drag" in free),
        "K": Parameter(0.5, "N/V", free=True, lower=0.0),
    }
    channels = Channels(("u",), ("v",), units={"u": "V", "v": "m/s"})
    return Custom(
        dynamics=lambda state, u, p: {
            "v": (p["K"] * u["u"] - p["Fv"] * state["v"] - p["drag"] * state["v"] * abs(state["v"])) / p["M"]
        },
        state_names=("v",),
        own_channels=channels,
        table=table,
    )


def test_a_factor_of_every_force_goes_far_from_where_it_was():
    robot = replace(pushed({"M", "Fv", "drag"}), velocities=("v",))
    found = values_moving_alike(robot, "K", 2.0, moved_anyhow("u", "v", 1.5))
    assert found == pytest.approx({"M": 16.0, "Fv": 12.0, "drag": 8.0}, rel=1e-3)


def test_nothing_is_said_of_what_is_not_finite_or_not_measured():
    robot = replace(pushed({"M", "Fv", "drag"}), velocities=("v",))
    logs = moved_anyhow("u", "v", 1.5)
    assert values_moving_alike(robot.with_values(drag=np.finfo(float).max), "K", 2.0, logs) == {}
    (log,) = logs
    hardly = np.where(np.arange(len(log)) < 10, log.outputs[:, 0], np.nan)
    assert values_moving_alike(robot, "K", 2.0, LogSet([replace(log, outputs=hardly[:, None])])) == {}


def test_what_the_motion_tells_has_no_other_numbers():
    robot = replace(pushed({"Fv", "drag"}), velocities=("v",))
    assert values_moving_alike(robot, "K", 2.0, moved_anyhow("u", "v", 1.5)) == {}
