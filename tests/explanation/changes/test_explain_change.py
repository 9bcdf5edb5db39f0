"""What changed between two sets of logs: said and sized on data of the independent simulator, whose dry friction truly sticks,
and silent where nothing did."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import signal

pytest.importorskip("numba")
from benchmarks.hidden.cases import MODEL, NOISE, REFERENCE  # noqa: E402
from jaxid import (  # noqa: E402
    Channels,
    Custom,
    Log,
    LogError,
    LogSet,
    Omni,
    Parameter,
    ParameterError,
    explain_change,
    output_error,
    simulate,
)
from jaxid.effects import effect_by_id  # noqa: E402
from jaxid.explanation.changes import judged  # noqa: E402
from jaxid.explanation.changes.change import Noticeable, number_in_words  # noqa: E402
from jaxid.report.change_page import change_page  # noqa: E402
from jaxid.report.document import rendered  # noqa: E402
from reference import excitation  # noqa: E402
from reference.logs import simulate_log  # noqa: E402

KINDS = {"axis": ("prbs_reversing", "multilevel", "crawl")}
MANY = ("prbs_forward", "prbs_reversing", "multilevel", "turning")


def recorded(name, seed, times=(), gain=1.0, noise="white", kinds=None, samples=500, **hidden):
    """Logs of a robot whose constants are so many `times` the usual ones, with a battery that gives `gain` times as much as is
    logged."""
    reference, model = REFERENCE[name], MODEL[name]()
    reference = reference.with_parameters(
        **{key: reference.parameters[key] * factor for key, factor in dict(times).items()}
    )
    found = []
    for k, kind in enumerate(kinds or KINDS.get(name, MANY)):
        inputs = excitation.experiment(name, kind, samples, 100 * seed + k)
        table = simulate_log(reference, inputs, 0.02, NOISE[name], 100 * seed + k, noise_kind=noise, **hidden)
        outputs = table[list(model.channels.outputs)].to_numpy()
        found.append(Log.from_arrays(f"run {k}", table["t"].to_numpy(), inputs / gain, outputs, model))
    return LogSet(found)


def nominal(name):
    """The model with the simulator's constants as known ones and starts."""
    model = MODEL[name]()
    return model.with_values(**{k: float(v) for k, v in REFERENCE[name].parameters.items() if k in model.parameters})


@cache
def usual(name, seed=0, noise="white"):
    logs = recorded(name, seed, noise=noise)
    return output_error(nominal(name), logs), logs


def compared(name, logs, seed: int = 0, noise: str = "white", **options):
    fit, before = usual(name, seed, noise)
    return explain_change(fit, output_error(nominal(name), logs), before, logs, **options)


def within(difference, true, errors=4.0):
    return abs(difference.size.value - true) < errors * difference.size.std_error


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "noise"), [(0, "white"), pytest.param(1, "coloured", marks=pytest.mark.slow)])
def test_nothing_changed_and_what_would_have_been_seen(seed, noise):
    found = compared("axis", recorded("axis", 50 + seed, noise=noise), seed, noise)
    assert found.verdict == "unchanged" and found.p_value > 0.01 and found.change is None
    mass = next(own for own in found.noticeable if own.name == "M")
    # No fit of one set tells the mass better than two sets tell a change of it at 1 %, all candidates counted.
    assert 5 * found.before["M"].std_error < mass.size < 0.1
    assert "Nothing changed" in str(found) and "would have been noticed" in str(found)


@pytest.mark.slow
def test_a_sensor_whose_noise_has_become_slow_is_no_change_of_the_robot(monkeypatch):
    """Noise that is remembered for 0.4 s, slower than the axis itself, as if no log told whether it is there at rest."""
    usual("axis", 0, "white")
    monkeypatch.setitem(NOISE, "axis", 1e-6)
    monkeypatch.setattr(judged, "shown_at_rest", lambda *arguments: None)
    logs, random = [], np.random.default_rng(5)
    for log in recorded("axis", 51, kinds=("prbs_forward", "multilevel") * 2):
        slow = 0.01 * signal.lfilter([1.0], [1.0, -0.95], random.normal(size=len(log)))
        logs.append(
            Log.from_arrays(f"slow {log.name}", log.time, log.inputs, log.outputs + slow[:, None], nominal("axis"))
        )
    found = compared("axis", LogSet(logs))
    assert found.verdict == "unchanged" and found.change is None
    (note,) = found.notes
    assert note.startswith("The set after is followed") and "coloured noise of v (AR(1), 0.95)" in note


@pytest.mark.slow
def test_a_payload_is_named_with_its_size_and_saved(tmp_path):
    check = recorded("axis", 70, kinds=("arcs",)), recorded("axis", 71, {"J": 1.2}, kinds=("arcs",))
    logs = recorded("axis", 50, {"J": 1.2})
    found = compared("axis", logs, held_out_before=check[0], held_out_after=check[1])
    assert found.verdict == "named" and found.change is not None and found.change.id == "M"
    assert within(found.change.differences["M"], 0.2)
    assert found.held_out_gain > 100 and found.rms_unchanged > 1.3 and found.change.rms == pytest.approx(1.0, abs=0.03)
    (path,) = found.save(tmp_path / "new")
    said = json.loads(path.read_text())
    assert said["verdict"] == "named" and said["change"]["id"] == "M"
    low, high = said["change"]["parameters"]["M"]["difference"]["ci95"]
    assert low < 0.2 < high and said["change"]["parameters"]["M"]["after"] == pytest.approx(1.2, abs=0.02)
    # Sizes from a model that lacks something are doubted in a terminal as they are on the page.
    judged_poor = replace(found.after, judgement=found.after.judgement.doubted("Drag is missing."))
    assert found.only_noise and not replace(found, after=judged_poor).unsound  # it lacks the change alone
    poor = replace(found, after=judged_poor, only_noise=False)
    assert "of the set" not in str(found)
    assert "The fit of the set after is poor: what the model lacks may pass for a change" in " ".join(str(poor).split())
    both = replace(poor, before=replace(found.before, judgement=found.before.judgement.doubted("Drag is missing.")))
    assert "The fits of both sets are poor" in " ".join(str(both).split())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "name", "true"),
    [
        ({"gain": 1.08}, "command_gain", {"command_gain.gain": 0.08}),
        pytest.param({"times": {"Cs": 1.3}}, "Fc", {"Fc": 0.15}, marks=pytest.mark.slow),
        pytest.param(
            {"effects": {"input_delay": {"delay": 0.04}}},
            "input_delay",
            {"input_delay.delay": 0.04},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_battery_floor_and_delay_of_an_axis(options, name, true):
    found = compared("axis", recorded("axis", 50, **options))
    assert found.verdict in ("named", "ambiguous") and found.change is not None
    named = {own.id: own for own in (found.change, *found.equivalent)}
    assert name in named and len(named) <= 2
    assert all(within(named[name].differences[key], size) for key, size in true.items())


@pytest.mark.slow
def test_of_what_may_be_another_in_one_motor_it_is_said_which():
    """A winding of more resistance is no weaker driver: it brakes less, too."""
    robot, sets = Omni(), []
    worn = robot + effect_by_id(robot, "motor_gain_mismatch", "winding_resistance")
    worn = worn.with_values(**{[n for n in worn.parameters if n.startswith("motor_gain_mismatch.")][1]: 0.1})
    for seed, model in ((1, robot), (2, worn)):
        random, logs = np.random.default_rng(seed), []
        for k in range(3):
            inputs = np.repeat(random.uniform(-12.0, 12.0, (16, 4)), 25, axis=0)
            log = Log.from_arrays(f"run {seed} {k}", 0.02 * np.arange(400), inputs, np.zeros((400, 3)), robot)
            moved = simulate(model, LogSet([log]))[0][:, :3]
            moved = moved + random.normal(size=moved.shape) * (0.01, 0.01, 0.02)
            logs.append(Log.from_arrays(log.name, log.time, inputs, moved, robot))
        sets.append(LogSet(logs))
    before, after = (output_error(robot, logs) for logs in sets)
    found = explain_change(before, after, *sets)
    assert found.verdict == "named" and found.change is not None and found.change.id == "motor_gain_mismatch"
    sizes = {name: difference for name, difference in found.change.differences.items() if "excess" in name}
    assert len(sizes) == 4 and within(list(sizes.values())[1], 0.1)
    # What would have been noticed of one motor's friction is said once, by the motor's name.
    said = [own.words for own in found.noticeable]
    assert len(set(said)) == len(said) and not any("drive axis" in words for words in said)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_a_sensor_that_was_filtered_since_is_no_change_of_the_robot(seed):
    logs = recorded("axis", 60 + seed, noise="coloured")
    found = compared("axis", logs, seed)
    assert found.verdict == "unchanged", found.sentence


@pytest.mark.slow
def test_what_has_no_name_is_said_to_have_none():
    found = compared("axis", recorded("axis", 50, effects={"push": {"force": 3.0, "every": 2.0, "start": 1.0}}))
    assert found.verdict == "unexplained" and found.doubts


def dynamics(state, inputs, p):
    return {"v": (p["K"] * inputs["u"] - state["v"]) / p["T"]}


def lag(gain, T, seed):
    """Logs of a first-order drive in closed form."""
    rng, found = np.random.default_rng(seed), []
    robot = Custom(
        dynamics=dynamics,
        state_names=("v",),
        own_channels=Channels(("u",), ("v",), (), {"u": "V", "v": "m/s"}),
        table={"T": Parameter(0.3, "s", lower=0.0, free=True), "K": Parameter(0.1, "m/(V s)", free=True)},
    )
    for k in range(2):
        u, v, seen = np.repeat(rng.uniform(-10.0, 10.0, 20), 15), 0.0, []
        for final in gain * 0.1 * u:
            seen.append(v)
            v = final + (v - final) * np.exp(-0.02 / T)
        noisy = np.array(seen) + 0.005 * rng.normal(size=300)
        found.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(300), u[:, None], noisy[:, None], robot.channels))
    return robot, LogSet(found)


@pytest.mark.slow
def test_a_robot_of_ones_own():
    """Its gain is the same model as a battery's, and as good as a sensor's scale; a slower drive is its time constant."""
    robot, before = lag(1.0, 0.3, 0)
    fit = output_error(robot, before)
    for gain, T, name in ((0.95, 0.3, "K"), (1.0, 0.35, "T")):
        _, after = lag(gain, T, 1)
        found = explain_change(fit, output_error(robot, after), before, after)
        assert found.verdict == ("ambiguous" if name == "K" else "named") and found.change is not None
        named = {own.id: own for own in (found.change, *found.equivalent)}
        if name == "T":
            assert list(named) == ["T"] and within(named["T"].differences["T"], 0.05)
        else:
            assert named["command_gain"].same == ("K",) and "sensor_scale" in named
            assert within(named["command_gain"].differences["command_gain.gain"], -0.05)


@pytest.mark.parametrize("gain", [pytest.param(1.0, marks=pytest.mark.slow), 1.02])
def test_a_second_change_that_is_small_beside_the_first_is_not_passed_over(gain):
    robot, before = lag(1.0, 0.3, 0)
    _, after = lag(gain, 0.5, 1)
    found = explain_change(output_error(robot, before), output_error(robot, after), before, after)
    assert found.change is not None and found.verdict == ("named" if gain == 1.0 else "ambiguous")
    assert within(found.change.differences["T"], 0.2)
    if gain == 1.0:
        assert not found.change.parts
        return
    # The only sensor's scale does the same as the gain of what drives: neither is named as fact.
    seconds = {own.parts[1].id: own for own in (found.change, *found.equivalent) if own.parts[0].id == "T"}
    assert {"command_gain", "sensor_scale"} <= set(seconds)
    assert within(seconds["command_gain"].differences["command_gain.gain"], 0.02)
    assert seconds["command_gain"].parts[1].same == ("K",) and "which is the same as K" in found.sentence
    assert [part["id"] for part in found.to_dict()["change"]["together"]] == [part.id for part in found.change.parts]
    assert found.change.title in rendered(change_page(found))


@pytest.mark.slow
def test_a_share_is_said_as_a_share():
    """Of a size without unit, such as all friction times 1 + size."""
    found = compared("axis", recorded("axis", 50, gain=1.08))
    assert found.change is not None and found.change.id == "command_gain"
    assert "gain +8" in found.change.sizes and " % (95 % " in found.change.sizes


def test_what_cannot_be_compared_is_refused_with_a_remedy():
    fit, logs = usual("axis")
    other = replace(fit, robot=fit.robot.with_values(gain=2.0))
    with pytest.raises(ParameterError, match="take gain for 1 and 2"):
        explain_change(fit, other, logs, logs)
    with pytest.raises(ParameterError, match="estimate different parameters"):
        explain_change(fit, replace(fit, free_names=("M",)), logs, logs)
    with pytest.raises(LogError, match="of one set only"):
        explain_change(fit, fit, logs, logs, logs)
    with pytest.raises(ValueError, match="false_alarm"):
        explain_change(fit, fit, logs, logs, false_alarm=0.7)
    with pytest.raises(LogError, match="of before and .* of after hold the same numbers"):
        explain_change(fit, fit, logs, logs)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options", "identifier", "true"),
    [
        ("pioneer", {}, "", {}),
        ("pioneer", {"noise": "coloured"}, "", {}),
        ("pioneer", {"times": {"M": 1.2, "I0": 1.1}}, "payload", {"M": 3.1, "I0": 0.03}),
        ("pioneer", {"gain": 1.08}, "command_gain", {"command_gain.gain": 0.08}),
        (
            "pioneer",
            {"laws": {"wheel_radius_mismatch/one_wheel": {"mismatch": -0.02, "wheel": 1.0}}},
            "radius_of_right_wheel",
            {"radius_of_right_wheel": -0.02},
        ),
        ("pioneer", {"times": {"Cs": 1.3, "Cv": 1.15}}, "friction", {"friction.viscous_friction.viscous": 0.15}),
        ("omni", {}, "", {}),
        ("omni", {"times": {"M": 1.15, "J": 1.1}}, "payload", {"M": 5.25, "J": 0.1374}),
        ("omni", {"gain": 1.08}, "command_gain", {"command_gain.gain": 0.08}),
    ],
)
def test_robots_in_the_plane(name, options, identifier, true):
    noise = options.get("noise", "white")
    found = compared(name, recorded(name, 50, **options), noise=noise)
    if not identifier:
        assert found.verdict == "unchanged"
        return
    assert found.verdict in ("named", "ambiguous") and found.change is not None
    named = {own.id: own for own in (found.change, *found.equivalent)}
    assert identifier in named
    assert all(within(named[identifier].differences[key], size) for key, size in true.items())


def test_candidates_call_wheels_and_axes_as_everything_else_does():
    from jaxid import DifferentialDrive, Omni, Pioneer
    from jaxid.explanation.changes.candidates import candidates_of

    sides = {"friction of the right wheel", "friction of the left wheel"}
    for robot, wanted in (
        (Pioneer(), sides),
        (DifferentialDrive(), sides),
        (Omni(), {"friction of V", "friction of Vn", "friction of W"}),
    ):
        titles = {candidate.title for candidate in candidates_of(robot)}
        ids = {candidate.id for candidate in candidates_of(robot)}
        assert {title.replace(" the ", " ").replace(" ", "_") for title in wanted} <= ids
        assert wanted <= titles and not any("wheel 1" in title for title in titles)


@pytest.mark.parametrize(
    ("name", "identifier", "title", "words"),
    [
        ("Fc", "Fc", "Coulomb friction of a side (Fc)", "Fc"),
        ("J", "payload", "payload", "J"),
        ("radius_of_right_wheel", "radius_of_right_wheel", "radius of the right wheel", "radius of the right wheel"),
        ("command_gain.gain", "command_gain", "supply or command gain", "supply or command gain"),
        (
            "friction_of_right_wheel.dry_friction.coulomb",
            "friction_of_right_wheel",
            "friction of the right wheel",
            "Coulomb friction of the right wheel",
        ),
        (
            "drive_of_left_wheel.drive_torque.torque",
            "drive_of_left_wheel",
            "drive torque of the left wheel",
            "drive torque of the left wheel",
        ),
        (
            "friction_of_each_2.viscous_friction.viscous",
            "friction_of_each",
            "friction of each drive axis",
            "viscous friction of drive axis 2",
        ),
        ("stribeck_friction.amplitude", "stribeck_friction", "Stribeck friction that appeared", "amplitude"),
        (
            "stribeck_friction.amplitude",
            "stribeck_friction.amplitude",
            "stribeck_friction.amplitude",
            "amplitude of Stribeck friction",
        ),
    ],
)
def test_numbers_are_printed_in_words(name, identifier, title, words):
    assert number_in_words(name, identifier, title) == words


def test_shares_are_per_cent():
    own = Noticeable("command_gain", "supply or command gain", "command_gain.gain", 0.0113, "", 0.0)
    assert own.text == "supply or command gain by 1.1 %"
    assert Noticeable("M", "mass (M)", "M", 0.43, "kg", 14.0).text == "M by 0.43 kg (3.1 %)"
