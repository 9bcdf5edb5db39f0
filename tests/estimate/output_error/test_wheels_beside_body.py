"""Wheels' angles beside a gyro: of a cart, by what two wheels on an axle do, and of four Mecanum wheels by their rollers."""

import numpy as np
import pytest

from jaxid import Log, LogSet, output_error, read_robot
from jaxid.estimate.output_error.wheels_beside_body import wheels_beside_body

RADIUS, HALF, AHEAD, DT = 0.0825, 0.17, 0.2, 0.02
PARAMETERS = """
[parameters]
r = 0.0825
"""
CART = f"""name = "cart"
{PARAMETERS}
[wheels]
left = {{ at = [0.0, {HALF}], kind = "standard" }}
right = {{ at = [0.0, -{HALF}], kind = "standard" }}
"""
MECANUM = f"""name = "platform"
{PARAMETERS}
[wheels]
fl = {{ at = [{AHEAD}, {HALF}], rolls = 0, kind = "mecanum" }}
fr = {{ at = [{AHEAD}, -{HALF}], rolls = 0, kind = "mecanum" }}
rl = {{ at = [-{AHEAD}, {HALF}], rolls = 0, kind = "mecanum" }}
rr = {{ at = [-{AHEAD}, -{HALF}], rolls = 0, kind = "mecanum" }}
"""
# Turning to the left: how many radians of each wheel go with one of the body.
TURNING = {
    "left": -HALF / RADIUS,
    "right": HALF / RADIUS,
    "fl": -(AHEAD + HALF) / RADIUS,
    "fr": (AHEAD + HALF) / RADIUS,
    "rl": -(AHEAD + HALF) / RADIUS,
    "rr": (AHEAD + HALF) / RADIUS,
}


KINDS = pytest.mark.parametrize(
    ("text", "wheels", "yaw"),
    [(CART, ("left", "right"), "w"), (MECANUM, ("fl", "fr", "rl", "rr"), "W")],
    ids=["cart", "mecanum"],
)


def made(tmp_path, text, wheels, gear, yaw, sign=1.0):
    """The robot of a file and logs in which its wheels' angles are `gear` times what they were, and no speed of the body."""
    path = tmp_path / "robot.toml"
    path.write_text(text)
    robot = read_robot(path).for_columns([yaw, *(f"angle_{name}" for name in wheels)])
    rng, found = np.random.default_rng(2), []
    for k in range(2):
        ahead, turn = (np.interp(np.arange(600), 20 * np.arange(31), rng.uniform(-0.5, 0.5, 31)) for _ in range(2))
        rates = {f"angle_{name}": gear * (ahead / RADIUS + TURNING[name] * turn) for name in wheels}
        angles = {
            name: np.concatenate([[0.0], np.cumsum(0.5 * DT * (own[1:] + own[:-1]))]) for name, own in rates.items()
        }
        gyro = turn + 0.02 * rng.normal(size=len(turn))
        inputs = rng.normal(size=(len(turn), len(robot.channels.inputs)))
        found.append(
            Log.from_arrays(f"run {k}", DT * np.arange(len(turn)), inputs, {**angles, yaw: sign * gyro}, robot)
        )
    return robot, LogSet(found)


@KINDS
def test_a_gear_that_was_forgotten_is_told_by_its_ratio(tmp_path, text, wheels, yaw):
    said = wheels_beside_body(*made(tmp_path, text, wheels, 26.0, yaw))
    assert f"26 times as far as {yaw} says" in said and "a gear between the encoder and the wheel" in said
    # The other way round, and with a sign that is another.
    said = wheels_beside_body(*made(tmp_path, text, wheels, 1.0 / 26.0, yaw, -1.0))
    factor = float(said.split(" times as far")[0].rsplit(" ", 1)[1])
    assert factor == pytest.approx(1.0 / 26.0, rel=0.01)


@KINDS
def test_of_wheels_that_are_right_or_worn_nothing_is_said(tmp_path, text, wheels, yaw):
    for gear in (1.0, 0.8, 1.5):
        assert wheels_beside_body(*made(tmp_path, text, wheels, gear, yaw)) == ""


SKID = f"""name = "rover"
{PARAMETERS}
[wheels]
fl = {{ at = [{AHEAD}, {HALF}], kind = "skid", command = "left" }}
rl = {{ at = [-{AHEAD}, {HALF}], kind = "skid", command = "left" }}
fr = {{ at = [{AHEAD}, -{HALF}], kind = "skid", command = "right" }}
rr = {{ at = [-{AHEAD}, -{HALF}], kind = "skid", command = "right" }}
"""


@pytest.mark.parametrize(
    ("scale", "scrub", "told"), [(1.0, 1.0, ""), (1.0, 2.8, ""), (9.549, 1.0, "9.55"), (9.549, 1.5, "14.3")]
)
def test_speeds_of_skidding_wheels_in_revolutions_a_minute_are_told_by_the_gyro(tmp_path, scale, scrub, told):
    """The body goes round by less than the wheels say, which is no unit."""
    path = tmp_path / "robot.toml"
    path.write_text(SKID)
    names = ("fl", "rl", "fr", "rr")
    robot = read_robot(path).for_columns(["w", *(f"speed_{name}" for name in names)])
    rng, found = np.random.default_rng(2), []
    for k in range(2):
        ahead, turn = (np.interp(np.arange(600), 20 * np.arange(31), rng.uniform(-0.5, 0.5, 31)) for _ in range(2))
        side = {"fl": -1.0, "rl": -1.0, "fr": 1.0, "rr": 1.0}
        speeds = {f"speed_{n}": scale * (ahead + side[n] * HALF * scrub * turn) / RADIUS for n in names}
        noisy = {name: own + scale * 0.05 * rng.normal(size=600) for name, own in speeds.items()}
        gyro = turn + 0.02 * rng.normal(size=600)
        inputs = rng.normal(size=(600, len(robot.channels.inputs)))
        found.append(Log.from_arrays(f"run {k}", DT * np.arange(600), inputs, {**noisy, "w": gyro}, robot))
    said = wheels_beside_body(robot, LogSet(found))
    assert (f"{told} times as far as w says" in said and "revolutions a minute" in said) if told else said == ""


def test_a_fit_says_it(tmp_path):
    robot, logs = made(tmp_path, CART, ("left", "right"), 26.0, "w")
    fit = output_error(robot, logs, initial_states="known", windows=None, max_steps=3)
    assert any("26 times as far" in note for note in fit.notes)
