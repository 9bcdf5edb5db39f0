"""jaxid/effects/actuator/battery_sag.py: a supply that runs down, of robots without the constants of a motor."""

import numpy as np
import pytest
from scipy.optimize import brentq

from jaxid import (
    AXIS,
    Axis,
    Channels,
    Custom,
    DifferentialDrive,
    Log,
    LogSet,
    Omni,
    Parameter,
    Pioneer,
    explain,
    float64,
    output_error,
)
from jaxid.effects import catalogue, effect_by_id, laws_of
from jaxid.explanation.not_looked_for import not_looked_for
from tests.explanation.closed_form_axis import driven

SLOPE = 0.025  # 1/s: a fifth in 8 s
TIME = 0.02 * np.arange(400)


def _held(time):
    """The middle of the ten samples for which a command is held, so that the axis' closed form stays exact."""
    return time.reshape(-1, 10).mean(axis=1).repeat(10)


@pytest.mark.slow
def test_a_supply_that_runs_down_is_named_with_its_rate():
    fit, held_out = driven(lambda u: u * (1.0 - SLOPE * _held(TIME)), 5)
    found = explain(output_error(Axis().change("Fc", free=False).with_values(Fc=0.0), fit), fit, held_out)
    assert (
        found.verdict == "named"
        and [e.id for e in found.effects] == ["battery_sag"]
        and found.effects[0].law == "over_time"
    )
    slope = found.effects[0].parameters["slope"]
    assert slope.value == pytest.approx(SLOPE, abs=4.0 * slope.std_error) and slope.std_error < 0.1 * SLOPE
    # What was sagging is not in the mass and the friction any more.
    assert found.final["M"].value == pytest.approx(1.0, rel=0.01)


@pytest.mark.slow
def test_a_supply_that_settles_is_named_with_how_far_and_how_fast():
    """As of a battery under load, and not evenly: of 12 % in 8 s more than half is gone after 2 s."""
    share, slow = 0.12, 2.5
    fit, held_out = driven(lambda u: u * (1.0 - share * (1.0 - np.exp(-_held(TIME) / slow))), 5)
    found = explain(output_error(Axis().change("Fc", free=False).with_values(Fc=0.0), fit), fit, held_out)
    assert (found.verdict, [(e.id, e.law) for e in found.effects]) == ("named", [("battery_sag", "levelling_off")])
    own = found.effects[0].parameters
    for name, true in (("share", share), ("time_constant", slow)):
        assert own[name].value == pytest.approx(true, abs=4.0 * own[name].std_error)
        assert own[name].std_error < 0.1 * true
    assert found.final["M"].value == pytest.approx(1.0, rel=0.01)


def test_robots_with_motors_have_the_laws_of_what_is_drawn_and_others_this_one():
    assert [law.law for law in laws_of(DifferentialDrive(), "battery_sag")] == [
        "over_time",
        "levelling_off",
        "by_load",
        "by_power",
        "in_some_logs",
    ]
    assert "over_time" not in [law.law for law in laws_of(Omni(), "battery_sag")]


def _car():
    channels = Channels(("throttle", "steering"), ("v", "r"), units={"throttle": "V", "steering": "rad"})
    table = {"k": Parameter(1.0, "", free=True), "j": Parameter(1.0, "", free=True)}

    def dynamics(state, u, p):
        return {"v": p["k"] * u["throttle"] - state["v"], "r": p["j"] * u["steering"] - state["r"]}

    return Custom(dynamics=dynamics, state_names=("v", "r"), own_channels=channels, table=table, title="car")


def test_only_drive_inputs_fall():
    effect = effect_by_id(_car(), "battery_sag")
    model = (_car() + effect).with_values(**{effect.key("slope"): 0.1})
    changed = effect.command(np.ones((3, 2)), np.array([0.0, 5.0, 20.0]), 1.0, model.parameters.numbers, model)
    assert np.allclose(changed, [[1.0, 1.0], [0.5, 1.0], [0.0, 1.0]])


def test_what_a_robot_without_motors_cannot_be_tried_for_is_said_with_its_law():
    assert "battery sag (duty times current) (`motor_currents=`" in not_looked_for(_car())
    assert "battery_sag" in [effect.id for effect in catalogue(Axis())]


@pytest.mark.parametrize(
    ("law", "drawn"),
    [
        ("by_load", lambda volts, currents: np.sum(np.abs(currents))),
        ("by_power", lambda volts, currents: max(np.sum(volts * currents), 0.0)),
    ],
)
def test_a_supply_without_constants_falls_with_what_is_drawn_from_it(law, drawn):
    """Of a differential drive whose motors turn, by SciPy's root of the fall that the currents behind it leave."""
    effect = effect_by_id(DifferentialDrive(), "battery_sag", law)
    slope = {"by_load": 0.012, "by_power": 0.0011}[law]
    model = (DifferentialDrive() + effect).with_values(back_emf=7.0, b=0.2, **{effect.key("slope"): slope})
    p, volts, state = model.parameters.numbers, np.array([11.0, -4.0]), {"v": 0.5, "w": 1.5}
    behind = 7.0 * np.array([0.5 + 0.2 * 1.5, 0.5 - 0.2 * 1.5])
    share = brentq(lambda s: 1.0 - slope * drawn(volts, volts * s - behind) - s, 0.0, 1.0)
    found = effect.supply(tuple(volts), tuple(volts - behind), state, p, model)
    assert 0.05 < 1.0 - share < 0.3
    np.testing.assert_allclose(np.array(found) / volts, share, atol=0.003)


@pytest.mark.slow
def test_mass_and_friction_allow_for_a_sag_that_goes_on_in_another_way():
    """A supply that falls by a power of time, which the formula that levels off is near enough to for the outputs."""
    time, decay = 0.1 * np.arange(4000), np.exp(-0.2)
    logs = []
    for k in range(3):
        rng = np.random.default_rng([7, k])
        u = np.repeat(rng.uniform(-4, 4, 800), 5)
        v, found = 0.0, []
        for force in u * (1.0 - 0.3 * (time / time[-1]) ** 0.7):
            found.append(v)
            v = force / 2.0 + (v - force / 2.0) * decay
        outputs = {"v": np.array(found) + 0.05 * rng.normal(size=len(u))}
        logs.append(Log.from_arrays(f"run {k}", time, u[:, None], outputs, AXIS))
    robot = Axis().with_values(M=1.2, Fv=2.2, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)
    story = explain(output_error(robot, LogSet(logs[:2])), LogSet(logs[:2]), LogSet(logs[2:]))
    assert [(effect.id, effect.law) for effect in story.effects] == [("battery_sag", "levelling_off")]
    assert any("with a freer form they would be M" in note for note in story.notes)
    for name, true in (("M", 1.0), ("Fv", 2.0)):
        assert abs(story.final[name].value - true) < 3.0 * story.final[name].std_error < 0.2 * true, name


@pytest.mark.parametrize("by_duty", [0.0, 1.0])
@pytest.mark.parametrize("most", [0.0, 0.5, 4.0, 11.0])
def test_a_steep_drop_is_that_of_the_currents_which_it_leaves(by_duty, most):
    """Against a bracketing root finder: the drop at the full voltage's currents would be many times too large."""
    robot = Pioneer() + effect_by_id(Pioneer(), "battery_sag", "shape")
    heights = {f"battery_sag.at_{k}": share * most for k, share in ((1, 0.3), (2, 0.4), (3, 1.0))}
    robot = robot.with_values(**heights, **{"battery_sag.by_duty": by_duty})
    (effect,), p = robot.effects, robot.parameters.numbers
    random = np.random.default_rng(1)
    with float64():
        for _ in range(20):
            volts, rates = random.uniform(-12, 12, 2), random.uniform(-15, 15, 2)
            emf = p["KE"] * p["tr"] * rates

            def short(share, volts=volts, emf=emf):
                each = (volts * share - emf) / p["Ra"]
                total = by_duty * abs(volts @ each) / 12.0 + (1.0 - by_duty) * np.abs(each).sum()
                return 1.0 - float(effect.at(np.float64(total), p)) / 12.0 - share

            found = np.array(effect.supply((*volts,), (*((volts - emf) / p["Ra"]),), {}, p, robot)) / volts
            assert np.allclose(found, brentq(short, -1.0, 1.0 + 1e-9, xtol=1e-13), atol=2e-3)


def test_a_supply_that_recovers_falls_with_the_sum_of_the_currents():
    """One resistor before an RC element, of motors whose currents add up whatever their choppers' duty: by a root finder."""
    at_once, behind, slow = 0.3, 0.2, 1.5
    robot = Pioneer() + effect_by_id(Pioneer(), "battery_sag", "sum_with_recovery")
    numbers = {"resistance_at_once": at_once, "resistance": behind, "time_constant": slow}
    robot = robot.with_values(**{f"battery_sag.{name}": value for name, value in numbers.items()})
    (effect,), p = robot.effects, robot.parameters.numbers
    random, tried = np.random.default_rng(2), 0
    with float64():
        for _ in range(40):
            volts, rates = random.uniform(-12, 12, 2), random.uniform(-15, 15, 2)
            emf, slowly = p["KE"] * p["tr"] * rates, random.uniform(0.0, 8.0)
            state = {effect.own("supply_drop"): np.float64(slowly)}

            def currents(share, volts=volts, emf=emf):
                return (volts * share - emf) / p["Ra"]

            def short(share, currents=currents, slowly=slowly):
                return 12.0 - at_once * np.abs(currents(share)).sum() - behind * slowly - 12.0 * share

            share = brentq(short, -1.0, 1.0 + 1e-9, xtol=1e-13)
            if np.any(np.sign(currents(share)) != np.sign(currents(1.0))):
                continue  # exact while no current changes its sign by it
            tried += 1
            found = np.array(effect.supply((*volts,), (*currents(1.0),), state, p, robot)) / volts
            assert np.allclose(found, share, atol=1e-9)
            (rate,) = effect.rates(state, (*currents(share),), p, robot).values()
            assert float(rate) == pytest.approx((np.abs(currents(share)).sum() - slowly) / slow)
    assert tried > 20
