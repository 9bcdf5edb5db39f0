"""Localisation against what was hidden in the logs, with the simulator's own constants as the fitted model."""

import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Channels, Custom, Fit, Log, LogSet, Omni, Parameter, Pioneer
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.where.condition_shares import ConditionShare, condition_shares
from jaxid.explanation.where.conditions import conditions_of, motions
from jaxid.explanation.where.localise import _when, concentration, gap_shares, localise
from jaxid.explanation.where.missing_force import ForceHistory
from jaxid.explanation.where.patterns import Pattern, answering, patterns
from reference import excitation
from reference.logs import simulate_log
from reference.pioneer import PIONEER

NOISE = {"eta1": 0.01, "eta2": 0.02}
KINDS = ("prbs_reversing", "multilevel", "crawl")
SAMPLES = 600


def logs_with(effects, first=0) -> LogSet:
    logs = []
    for seed, kind in enumerate(KINDS, first):
        inputs = excitation.experiment("pioneer", kind, SAMPLES, seed)
        table = simulate_log(PIONEER, inputs, 0.02, tuple(NOISE.values()), 70 + seed, effects, rtol=1e-7, atol=1e-9)
        columns = [{n: table[n] for n in names} for names in (("V2", "V3"), NOISE)]
        logs.append(Log.from_arrays(kind, table["t"], *columns, "pioneer"))
    return LogSet(logs)


def true_fit() -> Fit:
    """A fit that found the simulator's constants exactly."""
    robot = Pioneer()
    robot = robot.with_values(**{n: v for n, v in PIONEER.parameters.items() if n in robot.parameters})
    return Fit("exact", robot, {}, {}, (), np.zeros((0, 0)), dict(NOISE), True, "given", 0)


def located(effects, **options):
    fit = true_fit()
    return localise(fit, logs_with(effects), held_out_state(fit.robot, logs_with(effects, 10), NOISE), **options)


def by_name(found):
    return {condition.name: condition for condition in found.conditions}


@pytest.mark.slow
def test_stribeck_friction_is_placed_at_low_speed():
    found = located({"stribeck_friction": {"amplitude": 0.4, "speed": 0.03}}, stages={"drivetrain": 0.9, "body": 0.1})
    slow = by_name(found)["low speed"]
    assert slow.stands_out and slow.ratio_ci95[0] > 1.5 and slow.share > 0.4
    assert not by_name(found)["high speed"].notable
    best = found.standing_out[0]
    assert best.name in ("low speed", "near a reversal", "standstill")
    assert f"{100 * best.share:.0f} % of the missing force acts {best.phrase}" in found.sentence
    assert "'drivetrain'" in found.sentence and "90 %" in found.sentence
    assert sum(found.force_share.values()) == pytest.approx(1.0)
    again = json.loads(json.dumps(found.to_dict()))
    assert again["stages"] == {"drivetrain": 0.9, "body": 0.1} and again["sentence"] == found.sentence
    assert again["conditions"][0]["mean_force"].keys() == {"eta1", "eta2"}


@pytest.mark.slow
def test_a_slope_follows_the_heading_and_no_condition():
    found = located({"ground_slope": {"angle": 0.03, "direction": 0.7}})
    assert found.patterns[0].name == "heading" and found.patterns[0].share > 0.9
    assert not any(pattern.stands_out for pattern in found.patterns[1:])
    assert "follows the heading" in found.sentence


@pytest.mark.slow
def test_pushes_come_in_bursts_and_under_no_condition():
    found = located({"push": {"force": 10.0, "moment": 0.0, "start": 3.0, "duration": 0.4, "every": 4.0}})
    assert found.force_share["eta1"] > 0.95
    assert found.concentration < 0.15  # they last 10 % of the time
    assert not found.standing_out and not any(pattern.stands_out for pattern in found.patterns)
    assert "bursts" in found.sentence and "no condition stands out" in found.sentence


def test_a_share_below_half_a_per_cent_is_not_said_to_be_none():
    """A force as short as single samples of a long log: "80 % of it in 0 % of the time" says nothing."""
    plain = ConditionShare("rest", "at standstill", 0.1, 0.1, 1.0, (0.5, 2.0), 0.5, False, {"v": 0.0})
    assert "80 % of it in less than 1 % of the time" in _when([plain], [], 0.003)
    assert "80 % of it in 1 % of the time" in _when([plain], [], 0.012)


@pytest.mark.slow
def test_a_complete_model_leaves_nothing_to_place():
    found = located({})
    assert found.sentence.startswith("Nothing stands out")
    assert not found.standing_out and not any(pattern.stands_out for pattern in found.patterns)


def test_the_gap_is_split_by_channel():
    fit = true_fit()
    shares = gap_shares(held_out_state(fit.robot, logs_with({"sensor_bias": {"bias": 0.05, "channel": 2.0}}), NOISE))
    assert shares["eta2"] > 0.97 and sum(shares.values()) == pytest.approx(1.0)


def history(values, std=0.01) -> ForceHistory:
    time = np.arange(len(values)) * 0.02
    force = np.asarray(values, dtype=float)[:, None]
    return ForceHistory("made", time, force, np.full_like(force, std), ("v",), ("N",), np.ones(1), np.ones(1))


def test_shares_of_a_force_that_is_known():
    rng = np.random.default_rng(1)
    mask = np.repeat(rng.random(60) < 0.2, 25)
    force = np.where(mask, 2.0, 1.0) * rng.choice([-1.0, 1.0], mask.size)
    (row,) = condition_shares([history(force, std=1e-9)], {("made", "when made"): [mask]})
    t = mask.mean()
    assert row.time_share == pytest.approx(t)
    assert row.share == pytest.approx(4 * t / (4 * t + 1 - t))
    assert row.ratio_ci95[0] < row.ratio < row.ratio_ci95[1]
    assert row.stands_out
    assert concentration(np.array([0.0, 8.0, 1.0, 1.0])) == 0.25


def test_forces_at_random_moments_seldom_stand_out():
    rng = np.random.default_rng(2)
    alarms = 0
    for _ in range(60):
        # Conditions and forces that last about as long as one another, and know nothing of one another.
        masks = {(f"c{i}", ""): [np.repeat(rng.random(40) < 0.3, 25) for _ in range(3)] for i in range(5)}
        forces = [history(np.repeat(rng.normal(size=40), 25)) for _ in range(3)]
        alarms += any(row.stands_out for row in condition_shares(forces, masks))
    assert alarms <= 8  # 5 % of 60 is 3; more than 8 would come by chance once in 500 times


def test_conditions_of_a_drive_that_is_known():
    time = np.arange(600) * 0.02
    speed = np.select([time < 2, time < 5, time < 6, time < 9], [0.0, 1.0, 0.05, -1.0], 0.0)
    turn = np.where((time > 3) & (time < 4), np.pi / 2, 0.0)
    rng = np.random.default_rng(4)
    measured = {"eta1": speed + 0.001 * rng.normal(size=600), "eta2": turn + 0.001 * rng.normal(size=600)}
    log = Log.from_arrays("drive", time, {"V2": 5 * speed, "V3": 5 * speed}, measured, "pioneer")
    (motion,) = motions(Pioneer(), LogSet([log]))
    holds = {c.name: c.holds(motion) for c in conditions_of(motion)}

    def share_of(name, inside):
        """Share of the samples, clear of the edges by 0.1 s, in which the condition is as it should be."""
        edges = np.flatnonzero(np.diff(inside.astype(int)))
        clear = np.min(np.abs(time[:, None] - time[edges]), axis=1, initial=np.inf) > 0.1
        return np.mean(holds[name][clear] == inside[clear])

    assert share_of("standstill", (time < 2) | (time >= 9)) == 1.0
    assert share_of("forward", (time >= 2) & (time < 6)) == 1.0
    assert share_of("backward", (time >= 6) & (time < 9)) == 1.0
    assert share_of("near a reversal", np.abs(time - 6) <= 0.4) > 0.99
    assert share_of("turning left", (time > 3) & (time < 4)) == 1.0
    assert not holds["turning right"].any()
    assert share_of("heading 90° (left)", time > 3.5) > 0.99
    assert share_of("near largest input", np.abs(speed) == 1.0) == 1.0
    assert holds["low speed"][(time > 5.2) & (time < 5.8)].all()
    assert [int(holds[f"{name} third"].sum()) for name in ("first", "middle", "last")] == [200, 200, 200]
    # Forward along y for 2 s, then a quarter turn to the left, on towards -x and back.
    assert motion.path is not None
    np.testing.assert_allclose(motion.path[time < 3][-1], [0.0, 1.0], atol=0.03)


def test_an_omni_has_conditions_for_each_of_its_axes(demo_logs):
    logs = demo_logs("omni")
    names = {c.name for c in conditions_of(motions(Omni(), logs)[0])}
    assert {"V slow", "Vn slow", "W slow", "near a reversal of W", "turning right", "straight"} <= names


def test_an_axis_has_no_heading(axis_log):
    from jaxid import Axis

    (motion,) = motions(Axis(), LogSet([axis_log("run", np.repeat([1.0, -1.0, 0.0], 100), noise=0.001)]))
    names = {c.name for c in conditions_of(motion)}
    assert "near a reversal" in names and not any("heading" in name or "turning" in name for name in names)
    assert any(name.startswith("x >") for name in names)


def test_a_car_of_which_a_camera_sees_only_the_place_is_given_its_speed_by_how_the_place_changes():
    def rates(s, u, p):
        v, th = s["v"], s["th"]
        turning = v * jnp.tan(u["steer"]) / p["L"]
        return {"x": v * jnp.cos(th), "y": v * jnp.sin(th), "th": turning, "v": u["push"] - p["b"] * v}

    channels = Channels(inputs=("push", "steer"), outputs=("x", "y", "th"))
    car = Custom(
        dynamics=rates, state_names=("x", "y", "th", "v"), own_channels=channels, velocities=("v",),
        table={"L": Parameter(0.3), "b": Parameter(0.5, free=True)},
    )  # fmt: skip
    # A circle of 0.8 m at v = 0.6 (1 - cos t), so that the way is 0.6 (t - sin t).
    time = 0.02 * np.arange(300)
    heading = 0.6 * (time - np.sin(time)) / 0.8
    outputs = np.stack([0.8 * np.sin(heading), 0.8 * (1 - np.cos(heading)), heading], axis=1)
    inputs = np.stack([0.6 * np.sin(time) + 0.3 * (1 - np.cos(time)), np.full(300, np.arctan(0.3 / 0.8))], axis=1)
    logs = LogSet([Log.from_arrays("circle", time, inputs, outputs, channels)])
    (motion,) = motions(car, logs)
    np.testing.assert_allclose(motion.ahead, 0.6 * (1 - np.cos(time)), atol=0.02)
    force = ForceHistory(
        "circle", time, np.sin(time)[:, None], np.ones((300, 1)), ("v",), ("N",), np.ones(1), np.ones(1)
    )
    assert all(np.isfinite(pattern.share) for pattern in patterns([force], [motion]))
    still = replace(motion, axes=0.0 * motion.axes, fastest=np.full(1, np.inf))
    assert all(np.isfinite(pattern.share) for pattern in patterns([force], [still]))


def test_of_a_force_of_two_things_the_pair_is_said_and_what_one_does_alone():
    def pattern(name, share, pair=False):
        return Pattern(name, f"follows the {name}", share, 0.002, pair=pair)

    both = pattern("speed and place", 0.91, pair=True)
    shares = (ConditionShare("low speed", "at low speed", 0.1, 0.1, 1.0, (0.9, 1.1), 0.6, False, {}),)
    alone, place = pattern("speed", 0.52), pattern("place", 0.34)
    assert answering([alone, place]) is alone and answering([place]) is None
    assert answering([alone, place, both]) is both
    said = _when(shares, [alone, place, both], 1.0)
    assert said == "91 % of the missing force follows the speed and place (52 % the speed alone)"
