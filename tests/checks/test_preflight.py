"""jaxid/checks/preflight.py and its checks, on simulated robots: clean logs pass, and every fault is named alone."""

import numpy as np
import pandas as pd
import pytest

from jaxid import demo, read_logs
from jaxid.checks.preflight import preflight
from jaxid.logs import AXIS, OMNI, PIONEER, Channels, Log, LogError, LogSet
from tests.checks.any_scale import ROBOTS, make

T = 1000
TIME = 0.02 * np.arange(T)


def _checks(log, **options):
    return {finding.check for finding in preflight(log, **options) if finding.severity != "note"}


def _pioneer_inputs(held, kind, seed=0):
    random = np.random.default_rng(seed)
    one = held(random, T, 1, 40, [-6, 3, 6.0])
    inputs = {
        "two levels": held(random, T, 2, 15, [-6, 6.0]),
        "nine levels": held(random, T, 2, 25, np.linspace(-8, 8, 9)),
        "straight": np.repeat(one, 2, axis=1),
        "on the spot": one * [1, -1],
        "step": np.full((T, 2), 6.0),
        "forward and back": np.repeat(np.where(np.arange(T) < T // 2, 5.0, -5.0)[:, None], 2, axis=1),
        "sines": np.stack([5 * np.sin(2 * TIME), 6 * np.sin(3.1 * TIME)], axis=1),
        "coast": np.repeat(np.where(np.arange(T) < 400, 6.0, 0.0)[:, None], 2, axis=1),
        "trapezoid": np.repeat(np.interp(TIME, [0, 2, 8, 10, 12, 18, 20], [0, 6, 6, 0, -6, -6, 0])[:, None], 2, axis=1),
    }[kind]
    inputs[:25] = 0
    return inputs


def _omni_inputs(held, kind, seed=0):
    random = np.random.default_rng(seed)
    return {
        "two levels": held(random, T, 4, 15, [-12, 12.0]),
        "eight levels": held(random, T, 4, 25, np.linspace(-14, 14, 8)),
        "sines": 20 * np.sin(np.outer(TIME, [1, 1.7, 2.3, 3.1])),
        "along Vn": held(random, T, 1, 50, [-18, 18.0]) * [1, 0, -1, 0],
        "spin": held(random, T, 1, 50, [-18, 18.0]) * [1, 1, 1, 1],
    }[kind]


PIONEER_KINDS = ["two levels", "nine levels", "straight", "on the spot", "step", "forward and back", "sines", "coast", "trapezoid"]  # fmt: skip  # noqa: E501
OMNI_KINDS = ["two levels", "eight levels", "sines", "along Vn", "spin"]


@pytest.mark.parametrize("path", sorted(demo.folder("omni").glob("*.csv")), ids=lambda path: path.stem)
def test_currents_that_jump_with_the_voltages_are_no_spikes(path):
    """Of the omni's logs, whose voltages are now and then there for one sample alone."""
    assert not [found for found in read_logs(path, "omni").preflight() if found.check == "spike"]


@pytest.mark.parametrize("noise", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("kind", PIONEER_KINDS)
def test_clean_pioneer_logs_raise_no_warning(held, pioneer_log, kind, noise):
    assert not _checks(pioneer_log(_pioneer_inputs(held, kind), seed=7, noise=noise))


@pytest.mark.parametrize("noise", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("kind", OMNI_KINDS)
def test_clean_omni_logs_raise_no_warning(held, omni_log, kind, noise):
    assert not _checks(omni_log(_omni_inputs(held, kind), seed=7, noise=noise))


def _wrong(log, inputs=None, outputs=None, time=None, name="wrong.csv"):
    time, inputs = log.time if time is None else time, log.inputs if inputs is None else inputs
    return Log.from_arrays(name, time, inputs, log.outputs if outputs is None else outputs, log.channels)


@pytest.fixture(scope="module")
def pioneer(held, pioneer_log):
    return pioneer_log(_pioneer_inputs(held, "nine levels", seed=3), seed=3)


@pytest.fixture(scope="module")
def omni(held, omni_log):
    return omni_log(_omni_inputs(held, "eight levels", seed=3), seed=3)


@pytest.mark.parametrize(
    ("signs", "order", "named"),
    [
        ((-1, 1), (0, 1), ["'V2' has the opposite sign"]),
        ((1, -1), (0, 1), ["'V3' has the opposite sign"]),
        ((1, 1), (1, 0), ["'V2' and 'V3' are swapped", "'eta2' has the opposite sign"]),
    ],
)
def test_pioneer_input_wiring_is_named(pioneer, signs, order, named):
    """Swapped sides and a flipped yaw rate are the same to the data, so both must be offered."""
    findings = [
        f for f in preflight(_wrong(pioneer, inputs=(pioneer.inputs * signs)[:, order])) if f.severity != "note"
    ]
    assert len(findings) == 1 and findings[0].check in ("sign_flipped", "swapped")
    assert all(text in findings[0].message for text in named)


def test_swapped_and_flipped_outputs_are_named(pioneer, omni):
    flipped = preflight(_wrong(pioneer, outputs=pioneer.outputs * [-1, 1]))
    assert any(f.check == "sign_flipped" and "output 'eta1' has the opposite sign" in f.message for f in flipped)
    swapped = preflight(_wrong(pioneer, outputs=pioneer.outputs[:, ::-1]))
    assert any("outputs 'eta1' and 'eta2' are swapped" in f.message for f in swapped)
    turned = preflight(_wrong(omni, outputs=omni.outputs * [1, 1, -1, 1, 1, 1, 1]))
    assert any(f.check == "sign_flipped" and "output 'W' has the opposite sign" in f.message for f in turned)


@pytest.mark.parametrize("name", ["pioneer", "omni"])
def test_commands_that_are_all_reversed_are_one_remedy(name, request):
    log = request.getfixturevalue(name)
    findings = [f for f in preflight(_wrong(log, inputs=-log.inputs)) if f.check in ("sign_flipped", "swapped")]
    assert len(findings) == 1 and "all inputs, or all outputs, have the opposite sign" in findings[0].message


def test_one_command_that_was_recorded_for_both_is_a_warning_where_the_robot_turns(pioneer, pioneer_log):
    copied = pioneer.inputs[:, [0, 0]]
    found = [f for f in preflight(_wrong(pioneer, inputs=copied)) if f.check == "copied_input"]
    assert len(found) == 1 and "'V2' throughout" in found[0].message and "'eta2' moves all the same" in found[0].message
    straight = pioneer_log(copied, seed=3)
    pulls = straight.outputs + np.outer(straight.outputs[:, 0], [0.0, 0.3])  # to one side, whose wheel is smaller
    for log in (straight, _wrong(straight, outputs=pulls)):
        assert not any(f.check == "copied_input" for f in preflight(log))


@pytest.mark.parametrize("flipped", range(4))
def test_each_omni_input_flipped_alone_is_named_alone(omni, flipped):
    signs = np.where(np.arange(4) == flipped, -1, 1)
    findings = [
        f for f in preflight(_wrong(omni, inputs=omni.inputs * signs)) if f.check in ("sign_flipped", "swapped")
    ]
    assert [f.column for f in findings] == [f"u{flipped + 1}"]
    assert f"input 'u{flipped + 1}' has the opposite sign" in findings[0].message


@pytest.mark.parametrize(("a", "b"), [(0, 1), (0, 2), (1, 3), (2, 3)])
def test_swapped_omni_inputs_are_named(omni, a, b):
    order = np.arange(4)
    order[[a, b]] = b, a
    findings = [
        f for f in preflight(_wrong(omni, inputs=omni.inputs[:, order])) if f.check in ("sign_flipped", "swapped")
    ]
    assert len(findings) == 1 and f"inputs 'u{a + 1}' and 'u{b + 1}' are swapped" in findings[0].message


@pytest.mark.parametrize(("frame", "expected"), [(1.0, False), (0.0, False), (-1.0, True)])
def test_a_left_handed_frame_shows_in_the_turning_terms_alone(held, omni_log, frame, expected):
    """All wheel signs wrong leave every answer to the inputs right: the mirrored robot obeys the mirrored terms."""
    log = omni_log(_omni_inputs(held, "eight levels", seed=5), seed=5, frame=frame)
    assert ("frame_flipped" in _checks(log)) == expected


def _faults(log):
    random = np.random.default_rng(11)
    rows = np.arange(len(log))
    eta = log.outputs

    def one(column, values):
        outputs = eta.copy()
        outputs[:, column] = values
        return _wrong(log, outputs=outputs)

    late = log.time + 0.5 * (rows >= 400)
    uneven = log.time + random.uniform(-0.006, 0.006, len(log)) * (rows > 0)
    clipped = np.clip(8 * np.sin(np.outer(log.time, [2.0, 3.1])), -4, 4)
    spiky = eta[:, 0] + np.where(rows == 333, 0.8, 0.0)
    frozen = np.where((rows >= 500) & (rows < 560), eta[500, 1], eta[:, 1])
    dropped = np.where((rows >= 500) & (rows < 560), 0.0, eta[:, 0] + 2.0)
    held_rows = rows // 5 * 5
    repeated = np.where(rows % 2 == 0, rows, rows - 1)
    return {
        "time_gap": (_wrong(log, time=late), "t", 399),
        "clock_jitter": (_wrong(log, time=uneven), "t", None),
        "time_unit": (_wrong(log, time=1000 * log.time), "t", None),
        "saturated": (_wrong(log, inputs=clipped), "V2", None),
        "saturated sensor": (one(0, np.clip(eta[:, 0], -0.6, 0.6)), "eta1", None),
        "missing_samples": (one(1, np.where((rows > 200) & (rows < 240), np.nan, eta[:, 1])), "eta2", 201),
        "slow_sensor": (one(0, eta[held_rows, 0]), "eta1", None),
        "frozen_sensor": (one(1, frozen), "eta2", 500),
        "frozen_sensor at zero": (one(0, dropped), "eta1", 500),
        "spike": (one(0, spiky), "eta1", 333),
        "dead_sensor": (one(1, 0.05 * random.normal(size=len(log))), "eta2", None),
        "dead_sensor constant": (one(1, np.full(len(log), 0.02)), "eta2", None),
        "moving_start": (log.window(5.0, 15.0), "eta1", 0),
        "idle": (_wrong(log, inputs=log.inputs[repeated], outputs=eta[repeated]), None, None),
        "doubtful_clock": (one(0, 30 * eta[:, 0]), "eta1", None),
        "never_moved": (_wrong(log, outputs=0.01 * random.normal(size=eta.shape)), "eta1", None),
        "never_moved constant": (_wrong(log, outputs=np.zeros(eta.shape)), "eta1", None),
    }


FAULTS = ["time_gap", "clock_jitter", "time_unit", "saturated", "saturated sensor", "missing_samples", "slow_sensor", "frozen_sensor", "frozen_sensor at zero", "spike", "dead_sensor", "dead_sensor constant", "moving_start", "idle", "doubtful_clock", "never_moved", "never_moved constant"]  # fmt: skip  # noqa: E501


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_named_with_file_column_and_sample(pioneer, fault):
    log, column, sample = _faults(pioneer)[fault]
    check = fault.split()[0]
    found = [f for f in preflight(log) if f.check == check and f.column == column]
    assert len(found) == 1, [str(f) for f in preflight(log)]
    # A command that stays at its largest value may be meant; a sensor that keeps returning to one value is clipped.
    severity = {"never_moved": "error", "saturated": "note" if column == "V2" else "warning"}.get(check, "warning")
    assert found[0].severity == severity
    assert found[0].file == log.name and found[0].message.startswith(log.name) and "\n" not in found[0].message
    assert column is None or repr(column) in found[0].message
    if sample is not None:
        assert found[0].sample == sample and f"sample {sample} (t = " in found[0].message
    assert ";" in found[0].message  # the remedy


def test_a_sensor_that_never_changes_has_no_time_constant(pioneer):
    silent = np.stack([pioneer.outputs[:, 0], np.zeros(len(pioneer))], axis=1)
    found = {f.check for f in preflight(_wrong(pioneer, outputs=silent)) if f.column == "eta2"}
    assert "dead_sensor" in found and "coarse_sampling" not in found


@pytest.mark.parametrize(("dt", "expected"), [(0.02, False), (0.05, False), (0.4, True)])
def test_sampling_is_held_against_the_time_constant(dt, expected):
    """A first-order axis of time constant 0.2 s, discretised exactly; 0.4 s between samples is two time constants."""
    random = np.random.default_rng(2)
    u = np.repeat(random.choice([-5, 5.0], 200), 3)
    v = np.zeros(len(u))
    for k in range(len(u) - 1):
        v[k + 1] = np.exp(-dt / 0.2) * v[k] + (1 - np.exp(-dt / 0.2)) * 0.1 * u[k]
    log = Log.from_arrays("axis.csv", dt * np.arange(len(u)), u, v + 0.005 * random.normal(size=len(u)), AXIS)
    found = [f for f in preflight(log) if f.check == "coarse_sampling"]
    assert bool(found) == expected
    if expected:
        assert "about 0.2 s" in found[0].message


def test_one_column_recorded_for_two_motors_is_noted(pioneer):
    """Nothing in the motion tells: a robot with unequal wheels turns on equal voltages, too."""
    both = np.repeat(pioneer.inputs[:, :1], 2, axis=1)
    (note,) = [f for f in preflight(_wrong(pioneer, inputs=both)) if f.check == "equal_inputs"]
    assert (note.column, note.severity) == ("V3", "note") and "the same as 'V2'" in note.message
    assert not [f for f in preflight(pioneer) if f.check == "equal_inputs"]


def test_a_coarse_encoder_is_noted(pioneer):
    steps = np.round(pioneer.outputs / 0.1) * 0.1
    notes = [f for f in preflight(_wrong(pioneer, outputs=steps)) if f.check == "quantisation"]
    assert {f.column for f in notes} >= {"eta1"} and "steps of 0.1" in notes[0].message


def test_a_push_is_located():
    """An axis of unit gain is pushed from t = 11 to 12 s; the rest of the log obeys its own model."""
    random = np.random.default_rng(4)
    u = np.repeat(random.choice([-2, -1, 1, 2.0], T // 10), 10)
    push = np.where((TIME >= 11) & (TIME < 12), 6 * np.sign(np.sin(20 * TIME)), 0.0)
    v = np.zeros(T)
    for k in range(T - 1):
        v[k + 1] = v[k] + 0.02 * (-v[k] / 0.3 + u[k] + push[k])
    log = Log.from_arrays("axis.csv", TIME, u, v + 0.002 * random.normal(size=T), AXIS)
    found = [f for f in preflight(log) if f.check == "disturbed"]
    assert len(found) == 1 and 10.5 <= log.time[found[0].sample] <= 11.5


def test_extra_columns_are_looked_at_on_request(held, pioneer_log):
    log = pioneer_log(_pioneer_inputs(held, "two levels"), seed=1)
    random = np.random.default_rng(8)
    gyros = pd.DataFrame({"dead": random.uniform(-1, 1, T), "good": log.output("eta2") + 0.05 * random.normal(size=T)})
    log = Log.from_arrays("run.csv", log.time, log.inputs, log.outputs, PIONEER, gyros.assign(note="x"))
    assert "dead_sensor" not in _checks(log)
    dead = [f.column for f in preflight(log, also=["dead", "good"]) if f.check == "dead_sensor"]
    assert dead == ["dead"]
    with pytest.raises(LogError, match="close: 'dead'"):
        preflight(log, also=["daed"])
    with pytest.raises(LogError, match="no numbers"):
        preflight(log, also=["note"])


def test_a_short_log_and_one_without_mixing_are_looked_at_without_failing():
    channels = Channels(("a",), ("b",))
    for samples in (2, 3, 5, 17, 40):
        time = 0.02 * np.arange(samples)
        for robot, nu, ny in ((channels, 1, 1), (OMNI, 4, 3), (AXIS, 1, 1)):
            log = Log.from_arrays("short.csv", time, np.ones((samples, nu)), np.outer(time, np.ones(ny)), robot)
            assert all(finding.file == "short.csv" for finding in preflight(log))


def test_a_set_collects_the_findings_of_its_logs(pioneer):
    logs = LogSet([pioneer, _wrong(pioneer, outputs=pioneer.outputs * [1, -1])])
    assert {f.file for f in logs.preflight() if f.severity == "warning"} == {"wrong.csv"}
    assert "swapped" in repr(logs) or "sign_flipped" in repr(logs)


# -- any robot, any units, any sampling rate ----------------------------------------------------------------------------
def _doubts(log):
    return [f"{f.check}: {f.message}" for f in preflight(log) if f.severity != "note"]


@pytest.mark.parametrize("count", [20, pytest.param(50, marks=pytest.mark.slow)])
@pytest.mark.parametrize("robot", list(ROBOTS))
def test_clean_logs_of_any_scale_raise_no_warning(robot, count):
    said = {made.log.name: _doubts(made.log) for made in make(count, seed=17, robots=(robot,))}
    assert not {name: doubts for name, doubts in said.items() if doubts}


# Trapezoids that all inputs follow together may leave one output out.
SIGNS = ("levels", "two levels", "sines", "straight and turning")


def _flipped(log, *, output=None, input=None):
    inputs, outputs = np.array(log.inputs), np.array(log.outputs)
    if output is not None:
        outputs[:, log.channels.measured.index(output)] *= -1
    if input is not None:
        inputs[:, log.channels.inputs.index(input)] *= -1
    return _wrong(log, inputs=inputs, outputs=outputs)


@pytest.mark.parametrize("count", [6, pytest.param(16, marks=pytest.mark.slow)])
@pytest.mark.parametrize("robot", list(ROBOTS))
def test_a_sensor_of_the_wrong_sign_is_named_at_any_scale(robot, count):
    """A gyro on straight and turning runs among them: each log excites all of its outputs."""
    missed = []
    for made in make(count, seed=23, robots=(robot,), runs=SIGNS):
        for name in made.log.channels.mixing:
            found = [f for f in preflight(_flipped(made.log, output=name)) if f.check in ("sign_flipped", "swapped")]
            if not any(repr(name) in f.message for f in found):
                missed.append((made.run, name))
    assert not missed


@pytest.mark.parametrize("robot", ["body", "wheels", "three"])
def test_an_input_of_the_wrong_sign_is_named_at_any_scale(robot):
    missed = []
    for made in make(8, seed=29, robots=(robot,), runs=("levels", "two levels")):
        for name in made.log.channels.inputs:
            found = [f for f in preflight(_flipped(made.log, input=name)) if f.check in ("sign_flipped", "swapped")]
            if not any(repr(name) in f.message for f in found):
                missed.append((made.run, name))
    assert not missed


def test_a_position_that_rests_anywhere_is_at_rest(axis_log):
    """A log that holds the position alone, far from zero; and the same log from its middle, where it moves."""
    inputs = np.repeat(np.random.default_rng(3).choice([-5.0, 3.0, 5.0], 25), 20)
    inputs[:40] = 0
    whole = axis_log("rests.csv", inputs, noise=1e-3, seed=1, q=700.0)
    alone = Log.from_arrays("rests.csv", whole.time, whole.inputs, {"q": whole.output("q")}, AXIS)
    assert not _doubts(whole) and not _doubts(alone)
    angle = Channels(("u",), ("angle",), units={"angle": "rad"}, mixing={"angle": (1,)})
    for log, moving in ((whole, False), (whole.window(2.5), True)):
        turned = Log.from_arrays("arm.csv", log.time, log.inputs, {"angle": log.output("q")}, angle)
        assert ("moving_start" in _checks(turned)) == moving


def test_a_motor_may_turn_fast(axis_log):
    """Thousands of rad/s and rad/s^2 are usual for a motor's axis, whose unit is not metres."""
    inputs = np.repeat(np.random.default_rng(3).choice([-5.0, 3.0, 5.0], 25), 20)
    slow = axis_log("motor.csv", inputs, noise=1e-3, seed=1)
    motor = Log.from_arrays("motor.csv", 0.01 * slow.time, slow.inputs, 2000 * slow.outputs, AXIS)
    motor = Log.from_arrays("motor.csv", motor.time, motor.inputs, motor.outputs * [1, 0.01], AXIS)
    assert not _doubts(motor)


@pytest.mark.parametrize("column", ["goal", "q", ""])
def test_an_angle_in_degrees_beside_one_in_rad_is_doubted(column):
    """A servo whose goal and position are both called rad."""
    random = np.random.default_rng(41)
    goal = np.repeat(random.uniform(-0.9, 0.9, 20), 30)
    q = np.convolve(goal, np.exp(-np.arange(60) / 12.0) / 12.5)[:600] + 0.001 * random.normal(size=600)
    channels = Channels(("goal",), ("q",), units={"goal": "rad", "q": "rad"})
    sizes = {name: np.rad2deg(values) if name == column else values for name, values in (("goal", goal), ("q", q))}
    log = Log.from_arrays("servo.csv", 0.02 * np.arange(600), sizes["goal"][:, None], sizes["q"], channels)
    assert [f.column for f in preflight(log) if f.check == "unit"] == [column] * bool(column)


@pytest.mark.parametrize("in_degrees", [False, True])
def test_a_steering_angle_in_degrees_is_doubted(in_degrees):
    """Numbers of a commanded angle beyond a whole turn; the same angle in rad is none, nor is a motor's counted position."""
    random = np.random.default_rng(37)
    steering = np.repeat(random.uniform(-0.4, 0.4, 20), 30)
    channels = Channels(("delta",), ("w", "position"), units={"delta": "rad", "w": "rad/s", "position": "rad"})
    time, turned = 0.02 * np.arange(600), np.cumsum(np.tan(steering)) + 300.0
    outputs = np.stack([np.tan(steering), turned], axis=-1) + 0.01 * random.normal(size=(600, 2))
    inputs = (np.rad2deg(steering) if in_degrees else steering)[:, None]
    found = preflight(Log.from_arrays("car.csv", time, inputs, outputs, channels))
    assert [f.column for f in found if f.check == "unit"] == ["delta"] * in_degrees


def test_a_sign_is_not_read_from_a_motion_that_the_inputs_did_not_ask_for(held, pioneer_log):
    """Driven straight with wheels that differ, the robot turns a little: that says nothing of the gyro."""
    log = pioneer_log(_pioneer_inputs(held, "straight"), seed=5)
    for sign in (1, -1):
        turning = sign * 0.05 * log.output("eta1") + 0.01 * np.random.default_rng(1).normal(size=T)
        assert not _checks(_wrong(log, outputs=np.stack([log.output("eta1"), turning], axis=-1)))


def test_a_start_that_is_over_before_the_next_sample_is_no_spike():
    """A light robot logged at 10 Hz: at rest, and at speed one sample later. A wild first reading still is a spike."""
    random = np.random.default_rng(31)
    u = np.repeat(random.uniform(-1, 1, 20), 15)
    v = np.zeros(len(u))
    for k in range(1, len(u)):
        v[k] = v[k - 1] + 0.99 * (u[k - 1] - v[k - 1])
    v = v + 0.002 * random.normal(size=len(u))

    def spikes(values):
        found = preflight(Log.from_arrays("light", 0.1 * np.arange(len(u)), u, values, "axis"))
        return [f.sample for f in found if f.check == "spike"]

    rows = np.arange(len(u))
    assert spikes(v) == []
    assert spikes(np.where(rows == 0, 3.0, v)) == [0]
    # An input that is there for one interval makes such a sample, and none that is larger than others of its changes.
    pulse = np.where(rows == 202, 0.8, u)
    quick = np.append(v[0], pulse[:-1]) + 0.002 * random.normal(size=len(u))
    log = Log.from_arrays("light", 0.1 * rows, pulse, quick, "axis")
    assert [f for f in preflight(log) if f.check == "spike"] == []
    wild = Log.from_arrays("light", 0.1 * rows, pulse, quick + 5.0 * (rows == 203), "axis")
    assert [f.sample for f in preflight(wild) if f.check == "spike"] == [203]


def test_a_step_of_the_command_at_the_end_makes_no_spike():
    """The last sample answers a command of one row before; without such a command it is a wild reading."""
    time, rng = 0.02 * np.arange(600), np.random.default_rng(3)
    u = np.repeat(rng.uniform(-3.0, 3.0, 20), 30)
    step = u.copy()
    step[-2:] = -np.sign(u[-1]) * 3.0
    v = np.zeros(600)
    for k in range(1, 600):
        v[k] = v[k - 1] + 0.5 * (step[k - 1] - v[k - 1])
    v += 0.002 * rng.normal(size=600)

    def spikes(u):
        found = preflight(Log.from_arrays("run", time, u[:, None], {"v": v}, AXIS))
        return [f.sample for f in found if f.check == "spike"]

    assert spikes(step) == [] and spikes(u) == [599]
