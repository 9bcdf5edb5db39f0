"""Sensors of a base that spins while its motors push: alive, or dead all the same."""

import numpy as np
import pytest
from scipy.signal import lfilter, lsim

from jaxid import AXIS, Channels, Custom, Log, LogSet, Parameter

DT, M, DRAG, NOISE = 0.02, 8.0, 6.0, 0.005
OMNI = Custom(
    dynamics=lambda s, u, p: {
        "vx": (u["fx"] - DRAG * s["vx"]) / p["M"] + s["w"] * s["vy"],
        "vy": (u["fy"] - DRAG * s["vy"]) / p["M"] - s["w"] * s["vx"],
        "w": 2.0 * u["turn"] - 2.0 * s["w"],
    },
    state_names=("vx", "vy", "w"),
    own_channels=Channels(
        ("fx", "fy", "turn"),
        ("vx", "vy", "w"),
        (),
        {"fx": "N", "fy": "N", "turn": "rad/s", "vx": "m/s", "vy": "m/s", "w": "rad/s"},
    ),
    table={"M": Parameter(M, "kg", lower=0.0, free=True)},
)


def spinning(seed):
    """A log in closed form but for the heading within a step: in the world's frame the velocity decays towards what pushes."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.0, 1.0, (40, 3)) * (12.0, 12.0, 4.0), 25, axis=0)
    velocity, heading, w, seen = 0j, 0.0, 0.0, []
    for fx, fy, turn in u:
        own = velocity * np.exp(-1j * heading)
        seen.append((own.real, own.imag, w))
        for _ in range(20):
            decay = np.exp(-DRAG / M * DT / 20)
            velocity = velocity * decay + (fx + 1j * fy) / DRAG * np.exp(1j * heading) * (1.0 - decay)
            heading += w * DT / 20
            w = turn + (w - turn) * np.exp(-2.0 * DT / 20)
    return DT * np.arange(len(u)), u, np.array(seen) + NOISE * rng.normal(size=(len(u), 3))


def dead(time, u, outputs):
    logs = LogSet([Log.from_arrays("run", time, u, outputs, OMNI.channels)])
    return [f.column for f in logs.preflight() if f.check == "dead_sensor"]


@pytest.mark.parametrize("seed", range(6))
def test_speeds_of_a_base_that_spins_are_not_dead(seed):
    assert dead(*spinning(seed)) == []


@pytest.mark.parametrize("seed", range(6))
def test_a_sensor_that_only_rustles_is_dead_on_such_a_base_too(seed):
    time, u, outputs = spinning(seed)
    noise = lfilter([1.0], [1.0, -0.9], np.random.default_rng(100 + seed).normal(size=len(time)))
    outputs[:, 1] = 0.5 * noise / np.std(noise)
    assert dead(time, u, outputs) == ["vy"]


CAR = Channels(
    ("drive", "steer"), ("wheel", "gyro"), (), {"drive": "V", "steer": "rad", "wheel": "rad/s", "gyro": "rad/s"}
)


def stop_and_go(seed, curves):
    """A car that stands or drives straight on for most of the time, and takes as many curves."""
    rng, time = np.random.default_rng(seed), DT * np.arange(1000)
    drive = np.repeat(rng.choice([0.0, 0.0, 2.0, 4.0, -2.0], 10), 100)
    steer = np.zeros(1000)
    for begin in rng.choice(np.arange(50, 900, 60), curves, replace=False):
        steer[begin : begin + 50] = rng.uniform(-0.4, 0.4)
    late = [1.0 - np.exp(-DT / 0.3), np.exp(-DT / 0.3)]
    v, angle = (lfilter(late[:1], [1.0, -late[1]], x) for x in (drive / 3.0, steer))
    seen = np.stack([16.0 * v, v * np.tan(angle) / 0.3], axis=1) + rng.normal(size=(1000, 2)) * (0.1, 0.02)
    return time, np.stack([drive, steer], axis=1), seen


def dead_on_a_car(time, u, outputs):
    logs = LogSet([Log.from_arrays("run", time, u, outputs, CAR)])
    return [f.column for f in logs.preflight() if f.check == "dead_sensor"]


@pytest.mark.parametrize("seed", range(16))
def test_a_yaw_rate_that_is_noise_but_in_curves_is_not_dead(seed):
    assert dead_on_a_car(*stop_and_go(seed, 10)) == []


@pytest.mark.parametrize("seed", range(16))
def test_a_gyro_that_only_rustles_and_jumps_is_dead_on_a_car_too(seed):
    time, u, outputs = stop_and_go(seed, 10)
    rng = np.random.default_rng(100 + seed)
    outputs[:, 1] = 0.05 * rng.normal(size=1000) + np.where(rng.random(1000) < 0.01, rng.normal(size=1000), 0.0)
    assert dead_on_a_car(time, u, outputs) == ["gyro"]


def there_and_back(seed):
    """A car that drives forwards and backwards and steers to either side meanwhile, at other times: its yaw rate is a product
    alone, and jumps by more than half a turn a second."""
    rng, time = np.random.default_rng(seed), DT * np.arange(1500)

    def held(size):
        return np.concatenate([np.full(rng.integers(15, 60), rng.uniform(-size, size)) for _ in time])[: len(time)]

    drive, steer = held(10.0), held(0.4)
    late = [1.0 - np.exp(-DT / 0.2), np.exp(-DT / 0.2)]
    v = lfilter(late[:1], [1.0, -late[1]], drive / 5.0)
    seen = np.stack([16.0 * v, v * np.tan(steer) / 0.3], axis=1) + rng.normal(size=(len(time), 2)) * (0.1, 0.02)
    return time, np.stack([drive, steer], axis=1), seen


@pytest.mark.parametrize("seed", range(16))
def test_a_yaw_rate_that_is_a_product_of_speed_and_steering_is_not_dead(seed):
    time, u, outputs = there_and_back(seed)
    assert dead_on_a_car(time, u, outputs) == []
    outputs[:, 1] = 0.3 * np.random.default_rng(100 + seed).normal(size=len(time))
    assert dead_on_a_car(time, u, outputs) == ["gyro"]


MOTOR = Channels(("volt",), ("speed", "temperature"), (), {"volt": "V", "speed": "rad/s", "temperature": "degC"})


def warmed(seed, alive=True):
    """A motor that its own current heats, in closed form: the heat is the square of the voltage that its speed leaves."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-12.0, 12.0, 60), 20)
    speed = lfilter([0.0, 0.1], [1.0, -0.9], u)
    temperature = 25.0 + lfilter([0.0, 0.004], [1.0, -0.998], (u - 0.6 * speed) ** 2)
    if not alive:
        temperature = 25.0 + lfilter([0.02], [1.0, -0.998], rng.normal(size=len(u)))
    outputs = np.stack([speed, temperature], axis=1) + rng.normal(size=(len(u), 2)) * [0.02, 0.01]
    logs = LogSet([Log.from_arrays("run", DT * np.arange(len(u)), u[:, None], outputs, MOTOR)])
    return [f.column for f in logs.preflight() if f.check == "dead_sensor"]


@pytest.mark.parametrize("seed", range(6))
def test_a_temperature_that_follows_the_heat_of_a_motor_is_not_dead(seed):
    assert warmed(seed) == []


@pytest.mark.parametrize("seed", range(6))
def test_a_temperature_that_only_drifts_is(seed):
    assert warmed(seed, alive=False) == ["temperature"]


def servo(seed, seen):
    """A position servo that travels at one speed: its drive holds against friction, and hunts a little about that."""
    rng = np.random.default_rng(seed)
    time = 0.005 * np.arange(2400)
    hunting = lfilter([0.02], [1.0, -0.98], rng.normal(size=2400))
    speed = 0.02 * (1.0 - np.exp(-time / 0.1)) + 1e-4 * hunting
    position = np.cumsum(speed) * 0.005
    drive = 0.6 * (1.0 - np.exp(-time / 0.05)) + 0.02 * hunting
    counted = np.round((position if seen else 1e-3 * np.cumsum(rng.normal(size=2400))) / 2e-6) * 2e-6
    outputs = np.stack([np.full(2400, np.nan), counted], axis=1)
    logs = LogSet([Log("servo", time, drive[:, None], outputs, AXIS)])
    return [f.column for f in logs.preflight() if f.check == "dead_sensor"]


@pytest.mark.parametrize("seed", range(3))
def test_an_encoder_of_a_servo_that_travels_steadily_is_alive(seed):
    assert servo(seed, seen=True) == []


def test_one_that_wanders_by_itself_is_dead():
    assert servo(0, seen=False) == ["q"]


CRANE = Custom(
    dynamics=lambda s, u, p: {
        "x": s["xd"],
        "a": s["ad"],
        "xd": (p["k"] * u["volts"] - s["xd"]) / 0.15,
        "ad": -0.1 * s["ad"] - 15.4 * s["a"] - 1.57 * (p["k"] * u["volts"] - s["xd"]) / 0.15,
    },
    state_names=("x", "a", "xd", "ad"),
    own_channels=Channels(("volts",), ("x", "a"), (), {"volts": "V", "x": "m", "a": "rad"}),
    table={"k": Parameter(0.1, "m/(V s)", free=True)},
)


def hung(seed, own=False):
    """A pendulum that hangs from a cart, in closed form; of its `own` it has the answer to another cart's voltage."""
    system = (
        [[0, 0, 1, 0], [0, 0, 0, 1], [0, 0, -1 / 0.15, 0], [0, -15.4, 1.57 / 0.15, -0.1]],
        [[0], [0], [0.1 / 0.15], [-1.57 * 0.1 / 0.15]],
        np.eye(4),
        np.zeros((4, 1)),
    )
    random, time = np.random.default_rng(seed), DT * np.arange(1000)
    volts = [np.resize(np.repeat(random.uniform(-6, 6, 40), each), 1000) for each in (50, 37)]
    runs = [lsim(system, u, time, interp=False)[1] for u in volts]
    seen = np.stack([runs[0][:, 0], runs[int(own)][:, 1]], axis=1) + 0.002 * random.normal(size=(1000, 2))
    logs = LogSet([Log.from_arrays("run", time, volts[0][:, None], seen, CRANE.channels)])
    return [f.column for f in logs.preflight() if f.check == "dead_sensor"]


def test_a_pendulum_that_swings_by_itself_between_pushes_is_alive():
    assert [hung(seed) for seed in range(8)] == [[]] * 8


def test_one_that_another_cart_pushes_is_not_this_one_s():
    assert [hung(seed, own=True) for seed in range(8)] == [["a"]] * 8


@pytest.mark.parametrize("seed", [3, 5])
def test_a_gyro_that_answers_to_the_sum_of_three_wheels_and_hardly_to_each_is_not_dead(seed):
    rng = np.random.default_rng(seed)
    each = np.repeat(rng.uniform(-8.0, 8.0, (12, 3)), 100, axis=0)
    u = each - each.mean(axis=1, keepdims=True) + np.repeat(rng.uniform(-1.0, 1.0, (24, 1)), 50, axis=0)
    lag = np.exp(-1.0 / 30.0)
    speeds = lfilter([1.0 - lag], [1.0, -lag], u, axis=0) + 0.3 * rng.normal(size=u.shape)
    turning = lfilter([0.3 * (1.0 - lag)], [1.0, -lag], u.sum(axis=1)) + 1.5 * rng.normal(size=len(u))
    names = ("speed_1", "speed_2", "speed_3")
    mixing = {**{name: tuple(row) for name, row in zip(names, np.eye(3).tolist(), strict=True)}, "W": (1.0, 1.0, 1.0)}
    channels = Channels(("u_1", "u_2", "u_3"), (*names, "W"), mixing=mixing)
    logs = LogSet([Log.from_arrays("run", 0.01 * np.arange(len(u)), u, np.column_stack([speeds, turning]), channels)])
    assert not [f for f in logs.preflight() if f.check == "dead_sensor"]


@pytest.mark.parametrize("moves", [False, True])
def test_channels_of_a_user_s_own_that_never_rise_above_their_noise_are_a_robot_that_did_not_move(moves):
    """Such fits, of which the logs determine nothing, were sound, with a dry friction 14 standard errors off."""
    rng = np.random.default_rng(4)
    channels = Channels(("right", "left"), ("speed", "yaw"), units={"right": "V", "speed": "in/s", "yaw": "rad/s"})
    u, n = np.repeat(rng.uniform(-0.1, 0.1, (40, 2)), 15, axis=0), 600
    outputs = np.stack([0.6 * rng.normal(size=n), 0.02 * rng.normal(size=n)], axis=1)
    if moves:
        outputs[1:, 1] += 0.3 * (u[:-1, 0] - u[:-1, 1])
    log = Log.from_arrays("run", 0.02 * np.arange(n), u, outputs, channels)
    assert any(f.check == "never_moved" for f in LogSet([log]).preflight()) == (not moves)
