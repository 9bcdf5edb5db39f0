"""Where runs start: at rest, as pose columns say, or in motion."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Log, LogSet, Parameter, Pioneer, output_error
from jaxid.effects import effect_by_id
from jaxid.simulation.start import free_states, initial_states


def pioneer(name, first=(0.0, 0.0), extra=None, noise=0.01, seed=0):
    rng = np.random.default_rng(seed)
    outputs = np.tile(first, (200, 1)) + noise * rng.normal(size=(200, 2))
    outputs[0] = first
    inputs = np.repeat(rng.uniform(-3, 3, (20, 2)), 10, axis=0)
    return Log.from_arrays(name, 0.02 * np.arange(200), inputs, outputs, "pioneer", extra)


def test_a_log_without_a_word_starts_at_rest_at_the_origin():
    start = initial_states(Pioneer(pose=True), LogSet([pioneer("a", (0.02, -0.02)), pioneer("b", seed=1)]))
    assert set(start.states) == {"x", "y", "theta", "beta", "eta1", "eta2"}
    assert all(np.all(values == 0.0) for values in start.states.values())  # two standard deviations are noise
    assert not start.uncertain.any()


def test_pose_columns_set_the_states_of_their_own_log():
    columns = {name: np.full(200, value) for name, value in dict(x=1.0, y=-2.0, theta=0.5, beta=-1.7).items()}
    logs = LogSet([pioneer("posed", extra=columns), pioneer("plain", seed=1)])
    start = initial_states(Pioneer(pose=True), logs)
    assert [start.states[name][0] for name in ("x", "y", "theta", "beta")] == [1.0, -2.0, 0.5, -1.7]
    assert [start.states[name][1] for name in ("x", "y", "theta", "beta")] == [0.0, 0.0, 0.0, 0.0]
    assert not start.uncertain.any()
    without_pose = initial_states(Pioneer(), logs)
    assert set(without_pose.states) == {"beta", "eta1", "eta2"} and without_pose.states["beta"][0] == -1.7


def test_a_pose_that_was_not_measured_is_no_start():
    start = initial_states(Pioneer(), LogSet([pioneer("a", extra={"beta": np.full(200, np.nan)})]))
    assert start.states["beta"][0] == 0.0


def test_a_log_that_already_moves_starts_from_its_measured_speed_and_is_uncertain():
    start = initial_states(Pioneer(), LogSet([pioneer("rest"), pioneer("moving", (0.5, 0.0), seed=1)]))
    np.testing.assert_array_equal(start.uncertain, [False, True])
    np.testing.assert_array_equal(start.states["eta1"], [0.0, 0.5])
    np.testing.assert_array_equal(start.states["eta2"], [0.0, 0.0])


@pytest.mark.parametrize(("speed", "starts_at"), [(0.0, 0.0), (0.5, 0.5)], ids=["rest", "motion"])
def test_what_the_model_knows_of_its_sensors_is_taken_off(speed, starts_at):
    """A robot at rest whose gyro has a bias does not turn."""
    biased = Pioneer() + effect_by_id(Pioneer(), "sensor_bias") + effect_by_id(Pioneer(), "sensor_scale")
    known = biased.with_values(**{"sensor_bias.bias_eta2": 0.3, "sensor_scale.error_eta1": 0.1})
    logs = LogSet([pioneer("a", (1.1 * speed, 0.3))])
    assert initial_states(biased, logs).uncertain.all()
    assert initial_states(biased, logs).states["eta2"][0] == 0.3
    start = initial_states(known, logs)
    assert start.uncertain.item() == (speed > 0)
    assert start.states["eta1"].item() == pytest.approx(starts_at, abs=1e-12)
    assert start.states["eta2"].item() == pytest.approx(0.0, abs=1e-12)


def test_a_first_sample_that_is_missing_says_nothing(axis_log):
    log = axis_log("axis", np.full(100, 2.0), v=0.9, noise=0.001)
    outputs = log.outputs.copy()
    outputs[0, 0] = np.nan
    start = initial_states(Axis(), LogSet([Log.from_arrays("gap", log.time, log.inputs, outputs, "axis")]))
    assert start.states["v"][0] == 0.0


def test_a_position_that_starts_elsewhere_is_taken_from_the_noisy_first_sample_and_uncertain(axis_log):
    logs = LogSet(
        [axis_log("away", np.full(100, 2.0), q=1.5, noise=0.001), axis_log("home", np.full(100, 2.0), noise=0.001)]
    )
    start = initial_states(Axis(), logs)
    assert start.states["q"][0] == pytest.approx(1.5, abs=0.01) and start.states["q"][1] == 0.0
    np.testing.assert_array_equal(start.states["v"], [0.0, 0.0])
    np.testing.assert_array_equal(start.uncertain, [True, False])


def test_a_start_in_motion_is_seen_through_outputs_that_are_no_states():
    """Wheel speeds are the states, body speeds are measured: (right + left) / 2 and (right - left) / 2 L."""
    channels = Channels(inputs=("u",), outputs=("v", "w"))
    robot = Custom(
        dynamics=lambda s, u, p: {"right": u["u"] - s["right"], "left": u["u"] - s["left"]},
        output=lambda s, u, p: {"v": (s["right"] + s["left"]) / 2, "w": (s["right"] - s["left"]) / 2 / p["L"]},
        state_names=("right", "left"), own_channels=channels, table={"L": Parameter(0.2, "m")}, title="rims",
    )  # fmt: skip
    rng = np.random.default_rng(3)
    at_rest = 0.01 * rng.normal(size=(200, 2)) + np.linspace(0, 1, 200)[:, None]
    moving = at_rest + [0.5, 1.5]
    moving[0] = 0.5, 1.5
    time, inputs = 0.02 * np.arange(200), np.repeat(rng.uniform(-1, 1, 20), 10)[:, None]
    logs = LogSet([Log.from_arrays(n, time, inputs, y, channels) for n, y in (("rest", at_rest), ("moving", moving))])
    start = initial_states(robot, logs)
    np.testing.assert_array_equal(start.uncertain, [False, True])
    assert start.states["right"].tolist() == pytest.approx([0.0, 0.5 + 0.2 * 1.5], abs=1e-9)
    assert start.states["left"].tolist() == pytest.approx([0.0, 0.5 - 0.2 * 1.5], abs=1e-9)


def test_optional_outputs_that_are_no_states_do_not_stand_in_a_starts_way():
    """Measured is the sum of two speeds; each of them may be in a log as well, and a state is in no column."""
    channels = Channels(inputs=("u",), outputs=("sum",), optional=("right", "twice"))
    robot = Custom(
        dynamics=lambda s, u, p: {"right": u["u"] - s["right"], "left": u["u"] - p["a"] * s["left"]},
        output=lambda s, u, p: {"sum": s["right"] + s["left"], "right": s["right"], "twice": 2 * s["right"]},
        state_names=("right", "left"), own_channels=channels, table={"a": Parameter(1.0, "1/s")}, title="two speeds",
    )  # fmt: skip
    time, rise = 0.02 * np.arange(200), np.linspace(0, 1, 200)
    for optional in ({}, {"right": 1.0 + rise, "twice": 2.0 + 2 * rise}):
        log = Log.from_arrays("moving", time, np.zeros((200, 1)), {"sum": 2.5 + rise, **optional}, channels)
        start = initial_states(robot, LogSet([log]))
        assert start.uncertain.tolist() == [True]
        assert start.states["right"][0] + start.states["left"][0] == pytest.approx(2.5, abs=1e-9)


def counted(axis_law, step, rounding, start=0.0, noise=0.0):
    """An axis whose position a counter shows, from `start` steps above the origin."""
    inputs = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5, -1.2, 2.4], 45)
    q = axis_law(inputs, 0.02, M=1.3)[1] + start * step + noise * np.random.default_rng(0).normal(size=360)
    outputs = np.stack([np.full(360, np.nan), rounding(q / step) * step], axis=1)
    return Log.from_arrays("counted", 0.02 * np.arange(360), inputs[:, None], outputs, Axis().channels)


@pytest.mark.parametrize("step", [0.002, 0.05])
@pytest.mark.parametrize(
    ("rounding", "start", "seen"), [(np.floor, 0.0, -0.5), (np.round, 0.4, 0.4), (np.floor, 0.9, 0.4)]
)
def test_a_counter_leaves_the_start_within_a_step_open(axis_law, step, rounding, start, seen):
    """What reads 0 stands half a step higher on average, if the counter rounds down: of 300 to 7000 steps, that is all."""
    fit = output_error(Axis(), LogSet([counted(axis_law, step, rounding, start)]))
    assert fit.judgement.trustworthy
    for name, true in {"M": 1.3, "Fv": 2.0, "Fc": 0.5, "offset": 0.0}.items():
        assert abs(fit[name].value - true) < 4 * fit[name].std_error
    assert fit.initial_states["counted"]["q"] / step == pytest.approx(seen, abs=0.25)
    assert fit.initial_states["counted"]["v"] == 0.0  # it is known to rest


def test_a_position_whose_steps_are_lost_in_noise_starts_at_the_origin(axis_law):
    fine, coarse = (LogSet([counted(axis_law, step, np.round, noise=0.01)]) for step in (1e-4, 0.01))
    assert not free_states(Axis(), fine, initial_states(Axis(), fine)).any()
    assert free_states(Axis(), coarse, initial_states(Axis(), coarse)).any()


@pytest.mark.parametrize("step", [0.0, 0.002])
@pytest.mark.parametrize("v", [1.2, 0.0])
def test_a_speed_that_nobody_measures_shows_in_a_position_that_moves_from_the_first_sample_on(axis_law, v, step):
    """The count was set to zero where the log was cut out of a longer one."""
    inputs = np.repeat([1.5, -2.0, 4.0, 0.8, -4.0, 1.5, -1.2, 2.4], 45)
    q = axis_law(inputs, 0.02, M=1.3, v=v)[1] + 1e-3 * np.random.default_rng(0).normal(size=360) * (step == 0)
    q = np.floor(q / step) * step if step else q
    logs = LogSet([Log.from_arrays("cut", 0.02 * np.arange(360), inputs[:, None], {"q": q}, Axis().channels)])
    start = initial_states(Axis(), logs)
    assert start.uncertain.tolist() == [v != 0]
    assert start.states["v"][0] == pytest.approx(v, abs=0.1)
    fit = output_error(Axis(), logs)
    assert fit.judgement.trustworthy
    assert abs(fit["M"].value - 1.3) < 4 * fit["M"].std_error


def test_wheels_that_turn_from_the_first_sample_on_tell_speeds_that_nobody_measures():
    from jaxid import DifferentialDrive

    robot = DifferentialDrive(wheel_angles=True).for_columns(("u_right", "u_left", "way_right", "way_left", "w"))
    time = 0.01 * np.arange(300)
    ways = {"way_right": 0.18 * time + 2.0, "way_left": 0.18 * time - 1.0}
    noise = np.random.default_rng(0).normal(size=(3, 300))
    outputs = {
        "w": 0.01 * noise[0],
        **{name: y + 1e-4 * e for (name, y), e in zip(ways.items(), noise[1:], strict=True)},
    }
    logs = LogSet([Log.from_arrays("straight", time, np.zeros((300, 2)), outputs, robot.channels)])
    start = initial_states(robot, logs)
    assert start.uncertain.tolist() == [True]
    assert start.states["v"][0] == pytest.approx(0.18, abs=0.02)


def test_a_start_far_from_the_origin_has_the_speed_with_which_its_position_begins(axis_law):
    """A camera at a third of the rows: from rest, where it sticks, the search in a held-out log leads nowhere."""
    inputs = np.repeat([1.5, -2.0, 4.0, 0.8, -4.0, 1.5, -1.2, 2.4], 45)
    q = axis_law(inputs, 0.02, M=1.3, v=-0.3, q=0.7)[1] + 1e-3 * np.random.default_rng(0).normal(size=360)
    q[np.arange(360) % 3 != 0] = np.nan
    start = initial_states(
        Axis(), LogSet([Log.from_arrays("cut", 0.02 * np.arange(360), inputs[:, None], {"q": q}, Axis().channels)])
    )
    assert start.uncertain.tolist() == [True]
    assert start.states["v"][0] == pytest.approx(-0.3, abs=0.1)


def test_a_position_that_stands_at_first_is_at_rest_however_noisy(axis_law):
    inputs = np.repeat([0.0, -2.0, 4.0, 0.8, -4.0, 1.5, -1.2, 2.4], 45)
    for seed in range(5):
        q = axis_law(inputs, 0.02, M=1.3)[1] + 0.02 * np.random.default_rng(seed).normal(size=360)
        logs = LogSet([Log.from_arrays("rest", 0.02 * np.arange(360), inputs[:, None], {"q": q}, Axis().channels)])
        assert initial_states(Axis(), logs).states["v"].tolist() == [0.0]


def test_a_counter_that_stands_far_from_zero_begins_at_rest(axis_law):
    """What it reads again says nothing to a fit: a motion before the first change would be free, and take the log with it."""
    inputs = np.repeat([0.0, -2.0, 4.0, 0.8, -4.0, 1.5, -1.2, 2.4], 45)

    def log(v):
        q = 0.37 + axis_law(inputs, 0.02, M=1.3, v=v)[1]
        outputs = {"q": np.round(q / 1e-4) * 1e-4}
        return LogSet([Log.from_arrays("counted", 0.02 * np.arange(360), inputs[:, None], outputs, Axis().channels)])

    begin = initial_states(Axis(), log(0.0))
    free = dict(zip(Axis().estimated_states, free_states(Axis(), log(0.0), begin)[0].tolist(), strict=True))
    assert begin.standing.tolist() == [True] and free == {"q": True, "v": False}
    fit = output_error(Axis(), log(0.0))
    assert fit.initial_states["counted"]["v"] == 0.0
    assert fit.initial_states["counted"]["q"] == pytest.approx(0.37, abs=1e-4)
    assert fit.judgement.normalised_rms < 1.2
    moving = initial_states(Axis(), log(0.3))
    assert moving.standing.tolist() == [False] and free_states(Axis(), log(0.3), moving).all()


def test_what_is_driven_from_rest_at_once_is_at_rest(axis_law):
    """The first slope of a parabola is not zero then; however fine the position, it is a small share of what follows."""
    inputs = np.repeat([4.0, -2.0, 4.0, 0.8, -4.0, 1.5, -1.2, 2.4], 45)
    q = axis_law(inputs, 0.02, M=0.2)[1] + 1e-6 * np.random.default_rng(0).normal(size=360)
    logs = LogSet([Log.from_arrays("driven", 0.02 * np.arange(360), inputs[:, None], {"q": q}, Axis().channels)])
    assert not initial_states(Axis(), logs).uncertain.any()


def test_a_robot_at_rest_may_stand_turned_as_a_sensor_of_an_angle_says():
    """A tenth of the largest count is no sensor's offset on an angle, as it may be on a speed: a trailer that stood at 0.3 rad
    was fitted as if it stood straight, at 40 times the noise."""
    trailer = Custom(
        dynamics=lambda s, u, p: {"v": u["f"] - s["v"], "psi": -s["v"] * jnp.sin(s["psi"])},
        state_names=("v", "psi"),
        own_channels=Channels(inputs=("f",), outputs=("speed", "hitch")),
        table={"zero": Parameter(1000.0, free=True), "counts": Parameter(650.0)},
        output=lambda s, u, p: {"speed": s["v"], "hitch": p["zero"] + p["counts"] * s["psi"]},
        velocities=("v",),
    )
    rng, time = np.random.default_rng(3), 0.02 * np.arange(200)
    logs = []
    for k, turned in enumerate((0.0, 0.3)):
        angle = turned + 3.0 * np.maximum(time - 1.0, 0.0)
        read = np.stack([0.02 + 0.5 * np.maximum(time - 1.0, 0.0), 1000.0 + 650.0 * angle], axis=1)
        read += [0.001, 1.0] * rng.standard_normal((200, 2))
        logs.append(Log.from_arrays(f"log {k}", time, np.zeros((200, 1)), read, trailer))
    begun = initial_states(trailer, LogSet(logs))
    assert begun.uncertain.tolist() == [False, True]  # a speed of 0.02 of 1.5 is an offset
    assert begun.states["psi"] == pytest.approx([0.0, 0.3], abs=0.01)
