"""An input's and an output's column in each other's place: named in logs whose command is held and jumps, and nowhere else."""

import numpy as np
import pytest

from jaxid import Wheel, Wheeled, demo, read_logs
from jaxid.checks.exchanged import check_exchanged
from jaxid.checks.preflight import preflight
from jaxid.checks.signs import check_signs
from jaxid.logs import AXIS, Channels, Log
from tests.checks.any_scale import ROBOTS, make

N = 500
MIXING = np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1.0]])
ARMS = np.array([[1, -1, -0.39], [1, 1, 0.39], [1, 1, -0.39], [1, -1, 0.39]])
JUMPS = ("levels", "two levels")


def exchanged(log, command, sensor):
    """The log as somebody maps it who took the one for the other."""
    inputs, outputs = np.array(log.inputs), np.array(log.outputs)
    i, j = log.channels.inputs.index(command), log.channels.measured.index(sensor)
    inputs[:, i], outputs[:, j] = log.output(sensor), log.input(command)
    return Log.from_arrays("mapped.csv", log.time, inputs, outputs, log.channels)


@pytest.mark.parametrize("robot", list(ROBOTS))
def test_clean_logs_say_nothing_and_exchanged_columns_are_named(robot):
    """Each input with each output that it drives, at any scale. Where sensors share inputs some are too faint, and
    two levels of an angle may be an encoder's counts."""
    for made in make(10, seed=31, robots=(robot,)):
        log = made.log
        assert not list(check_exchanged(log)), made.run
        if made.run not in JUMPS:
            continue
        for sensor, gains in log.channels.mixing.items():
            for command, gain in zip(log.channels.inputs, gains, strict=True):
                found = list(check_exchanged(exchanged(log, command, sensor)))
                assert all(f.column == command and f"output {sensor!r}" in f.message for f in found)
                assert found or robot in ("three", "angle") or sensor == "gyro" or gain == 0, (
                    made.run,
                    command,
                    sensor,
                )


@pytest.mark.parametrize("robot", ["pioneer", "omni", "pioneer_paper", "unknown"])
def test_the_logs_of_the_demonstration_say_nothing(robot):
    logs = read_logs(demo.folder(robot) / "*.csv", "omni" if robot == "omni" else "pioneer")
    assert not [f.message for log in logs for f in check_exchanged(log)]


def test_it_is_the_one_thing_that_pre_flight_says_of_the_wiring():
    log = next(made.log for made in make(6, seed=5, robots=("axis",)) if made.run == "levels")
    assert not [f for f in preflight(log) if f.severity == "warning"]
    found = [f for f in preflight(exchanged(log, "u", "v")) if f.check in ("exchanged", "swapped", "sign_flipped")]
    assert [f.check for f in found] == ["exchanged"] and found[0].severity == "warning"
    assert "column 'u'" in found[0].message and "exchange their names" in found[0].message


def servo(reference, gain, noise, late, counts=0.0, of_position=False, seed=0, interval=0.02):
    """A drive axis in a loop: (commands, measurements). `late`: the command acts a sample later."""
    rng = np.random.default_rng(seed)
    v = q = integral = before = 0.0
    commands, measured = [], []
    for wanted in reference:
        y = (q if of_position else v) + noise * rng.normal()
        y = np.round(y / counts) * counts if counts else y
        integral += 0.5 * gain * (wanted - y) * interval
        now = gain * (wanted - y) + integral
        acts, before = (before, now) if late else (now, now)
        commands.append(acts)
        measured.append(y)
        for _ in range(5):
            v += interval / 5 * (acts - v - 0.1 * np.tanh(v / 0.01)) / 0.3 + 0.05 * np.sqrt(interval / 5) * rng.normal()
            q += interval / 5 * v
    return np.array(commands), np.array(measured)


@pytest.mark.parametrize("counts", [0.0, 0.01, 0.1])
@pytest.mark.parametrize("of_position", [False, True])
@pytest.mark.parametrize("late", [False, True])
def test_a_closed_loop_in_which_the_command_follows_the_sensor_says_nothing(late, of_position, counts):
    """Held at one place against disturbances, following ramps and steps; a user's robot that has no mixing."""
    time = 0.02 * np.arange(N)
    random = np.random.default_rng(2)
    references = (np.full(N, 0.5), np.interp(time, np.arange(11), random.uniform(-1, 1, 11)))
    references += (np.repeat(random.uniform(-1, 1, 10), 50),)
    own = Channels(("u",), ("y",), units={"y": "rad" if of_position else "rad/s"})
    for number, reference in enumerate(references):
        for gain in (0.5, 5.0):
            for noise in (1e-3, 5e-2):
                both = servo(reference, gain, noise, late, counts, of_position, seed=number)
                log = Log.from_arrays("servo.csv", time, *both, own)
                assert not list(check_exchanged(log)), (number, gain, noise)


def test_currents_on_either_side_say_nothing():
    """A motor's current follows its voltage and answers to its speed."""
    rng = np.random.default_rng(4)
    volts, i, w, rows = np.repeat(rng.uniform(-6, 6, N // 25), 25), 0.0, 0.0, []
    for u in volts:
        rows.append((i, w))
        for _ in range(40):
            i += 2.5e-4 * (u - 0.8 * i - 0.05 * w) / 2e-3
            w += 2.5e-4 * (0.05 * i - 1e-4 * w - 4e-3 * np.tanh(w)) / 2e-4
    time, noisy = 0.01 * np.arange(N), np.array(rows) * (1 + 0.01 * rng.normal(size=(N, 2)))
    driven = Channels(("u",), ("w", "i"), units={"u": "V", "w": "rad/s", "i": "A"})
    by_current = Channels(("i",), ("w",), units={"i": "A", "w": "rad/s"})
    for log in (
        Log.from_arrays("a", time, volts, noisy[:, ::-1], driven),
        Log.from_arrays("b", time, noisy[:, 0], noisy[:, 1], by_current),
    ):
        assert not list(check_exchanged(log))


def test_measurements_that_are_missing_foretell_nothing(axis_log):
    inputs = np.repeat(np.random.default_rng(3).choice([-5.0, 0.0, 3.0, 5.0], 25), 20)
    log = axis_log("slow.csv", inputs, noise=0.01, seed=1, position=False)
    slow = np.where(np.arange(N)[:, None] % 10 == 0, log.outputs, np.nan)
    assert not list(check_exchanged(Log.from_arrays("slow.csv", log.time, inputs, slow, AXIS)))
    assert list(check_exchanged(exchanged(log, "u", "v")))


def mecanum(seed, level, hold=40, samples=1000, dt=0.02):
    """Speeds of the body beside the counts of four mecanum wheels, with dry friction that weak commands hardly overcome."""
    wheels = [
        Wheel(n, (0.24 * a, 0.15 * b), kind="mecanum")
        for n, a, b in (("fl", 1, 1), ("fr", 1, -1), ("rl", -1, 1), ("rr", -1, -1))
    ]
    rng = np.random.default_rng(seed)
    modes = rng.normal(size=(samples // hold + 1, 3)) * (1, 1, 0.6)
    u, x, angles, seen = level * np.repeat(modes @ MIXING / 2, hold, axis=0)[:samples], np.zeros(3), np.zeros(4), []
    for row in u:
        seen.append(np.concatenate([x, angles]))
        for _ in range(10):
            friction = np.array([1.0, 1.0, 2.8]) * np.tanh(x / 0.005)
            x = x + 0.1 * dt * (np.array([0.9, 0.9, 2.6]) * (MIXING @ row) - 2.4 * x - friction)
            angles = angles + 0.1 * dt * (ARMS @ x) / 0.05
    read, count = np.array(seen), 2 * np.pi / 4096
    read[:, :3] += rng.normal(size=(samples, 3)) * (0.004, 0.004, 0.01)
    read[:, 3:] = np.round(read[:, 3:] / count) * count
    channels = Wheeled(wheels=tuple(wheels), wheel_angles=True).channels
    return Log.from_arrays("mecanum", dt * np.arange(samples), u, read, channels)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_weak_commands_to_many_wheels_are_no_swapped_wires(seed):
    """Changes of seven outputs say a little more for another wiring, the outputs themselves say more against it."""
    assert not list(check_signs(mecanum(seed, level=0.6)))


@pytest.mark.parametrize(("seed", "pair"), [(0, (0, 1)), (1, (2, 3))])
def test_wires_of_many_wheels_that_are_swapped_are_named(seed, pair):
    log = mecanum(seed, level=2.0)
    inputs = np.array(log.inputs)
    inputs[:, pair] = inputs[:, pair[::-1]]
    found = list(check_signs(Log.from_arrays("mapped.csv", log.time, inputs, log.outputs, log.channels)))
    names = [log.channels.inputs[k] for k in pair]
    assert any(all(name in one.message for name in names) for one in found)
