"""Mechanism first, law second: laws that another author wrote, on data of the independent simulator."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("numba")
from benchmarks.laws.cases import make  # noqa: E402
from jaxid import explain, output_error, read_logs
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.refits.refit import Trial
from jaxid.explanation.screening.screen import Candidate
from jaxid.explanation.search.laws import (
    by_law,
    by_where_they_bend,
    other_laws,
    with_formulas_of_others,
    with_its_other_laws,
    with_the_same_law,
)
from jaxid.explanation.search.telling_apart import supersets
from jaxid.logs import LogWarning
from jaxid.model_file import read_model, write_model
from jaxid.robots import Axis, DifferentialDrive, Pioneer


@pytest.fixture
def explained(tmp_path):
    """The explanation of an axis with a law of the simulator's hidden in it."""

    def run(law, size, seed):
        fitted, held_out, model = make("axis", {law: size}, seed).write(tmp_path)
        robot = read_model(model, Axis())
        logs, check = (read_logs([str(path) for path in paths], robot="axis") for paths in (fitted, held_out))
        return explain(output_error(robot, logs), logs, check)

    return run


@pytest.mark.slow
def test_another_law_of_friction_near_standstill_is_named_with_its_law(explained, tmp_path):
    found = explained("stribeck_friction/exponential", 5.0, 7)
    (effect,) = found.effects
    assert (found.verdict, effect.id, effect.law) == ("named", "stribeck_friction", "exponential")
    assert found.after.normalised_rms < 1.03
    assert effect.parameters["amplitude"].value == pytest.approx(5.0, abs=4 * effect.parameters["amplitude"].std_error)
    assert found.to_dict()["effects"][0]["law"] == "exponential"
    write_model(tmp_path / "again.toml", found.model)
    again = read_model(tmp_path / "again.toml", Axis())
    assert [(e.id, e.law) for e in again.effects] == [("stribeck_friction", "exponential")]


@pytest.mark.slow
def test_what_is_no_published_law_is_answered_by_its_shape(explained):
    found = explained("actuator_dead_zone/drawn", 0.5, 5)
    (effect,) = found.effects
    # On one axis the drive force is the command: what is lost of one may as well be lost of the other.
    assert (found.verdict, effect.law) == ("ambiguous", "shape")
    assert effect.id == "actuator_dead_zone" and "traction_limit" in effect.equivalent_to
    assert found.gap_closed > 0.9
    (shape,) = found.to_dict()["effects"][0]["shape"]
    assert len(shape["points"]) == len(shape["values"]) == len(shape["band"])
    assert shape["unit"] == "V or N" and max(shape["values"]) > 0.1


SAMPLES = 100
STATE = HeldOut(2.0, {"v": 2.0}, (np.full((SAMPLES, 1), 2.0),), {"v": 1.0}, 0.0)
NOISE_ONLY = replace(STATE, normalised_rms=1.0, p_white=0.5)


def candidate(effect, gain, laws=()):
    return Candidate(effect, gain, 0.5, ({},), np.zeros(2, np.float32), laws=laws)


def trial(robot, effect, squares, state=STATE):
    signs = np.random.default_rng(3).choice([-1.0, 1.0], size=(SAMPLES, 1))
    fitted = replace(state, residuals=(np.sqrt(squares / SAMPLES) * signs,))
    return Trial(effect.id, robot + effect, squares, 3, fitted, lambda: state, {})


def test_other_mechanisms_laws_are_tried_while_none_leaves_only_noise():
    """The second mechanism's curve wins over the first one's formula, though its own formula does worse."""
    robot = Pioneer()
    zone, tanh, curve = (effect_by_id(robot, "voltage_saturation", law) for law in ("hard", "tanh", "shape"))
    bias = effect_by_id(robot, "sensor_bias")
    saturation = candidate(zone, 80.0, (candidate(curve, 100.0), candidate(tanh, 60.0)))
    asked = []

    def refits(further):
        asked.extend(c.effect for c in further)
        return [trial(robot, c.effect, 100.0 if c.effect is curve else 700.0) for c in further]

    tried = [trial(robot, zone, 600.0), trial(robot, bias, 500.0)]
    ranked = by_law([saturation, candidate(bias, 90.0)], tried, near=2000.0, refits=refits)
    assert asked == [tanh, curve]
    assert [[t.law for t in own] for own in ranked] == [["shape", "hard", "tanh"], ["constant"]]


def test_the_best_mechanism_s_laws_are_all_tried_before_a_further_effect_is_looked_for():
    """The law that the first look promises least of is the one that leaves only noise."""
    robot = Pioneer()
    usual, root, per_axis = (
        effect_by_id(robot, "stribeck_friction", n) for n in ("gaussian", "exponent_one_half", "per_axis")
    )
    bias = effect_by_id(robot, "sensor_bias")
    screened = [candidate(usual, 100.0, (candidate(root, 5.0), candidate(per_axis, -1.0))), candidate(bias, 90.0)]
    asked = []

    def refits(further):
        asked.extend(c.effect for c in further)
        return [trial(robot, c.effect, 100.0, NOISE_ONLY) for c in further]

    tried = [[trial(robot, usual, 500.0)], [trial(robot, bias, 600.0)]]
    (best, *others), second = with_its_other_laws(tried, screened, refits)
    assert (asked, best.law, [t.law for t in others], second[0].id) == (
        [root],
        "exponent_one_half",
        ["gaussian"],
        "sensor_bias",
    )
    asked.clear()
    with_its_other_laws([[trial(robot, usual, 100.0, NOISE_ONLY)], tried[1]], screened, refits)
    assert not asked


def test_where_a_curve_leads_and_leaves_more_than_noise_formulas_of_names_not_refitted_are_tried():
    """A dead zone promised less than half, since friction stands in for it from far off, and leaves only noise."""
    robot = Pioneer()
    curve = effect_by_id(robot, "traction_limit", "shape")
    per_motor, one, shape = (
        effect_by_id(robot, "actuator_dead_zone", n) for n in ("per_motor", "subtractive", "shape")
    )
    bias, late = effect_by_id(robot, "sensor_bias"), effect_by_id(robot, "input_delay")
    zone = candidate(shape, 45.0, (candidate(per_motor, 44.0), candidate(one, 43.0)))
    likely = [candidate(curve, 100.0), zone, candidate(bias, 30.0), candidate(late, 19.0)]
    asked = []

    def refits(further):
        asked.extend(c.effect for c in further)
        return [trial(robot, c.effect, 900.0 if c.effect is bias else 100.0, NOISE_ONLY) for c in further]

    ranked = with_formulas_of_others([[trial(robot, curve, 500.0)]], likely, refits)
    assert asked == [per_motor, bias]
    assert [own[0].id for own in ranked] == ["actuator_dead_zone", "traction_limit", "sensor_bias"]
    asked.clear()
    ranked = with_its_other_laws(ranked, likely, refits)
    assert asked == [one] and {t.law for t in ranked[0]} == {"per_motor", "subtractive"}
    asked.clear()
    for leading in (trial(robot, curve, 100.0, NOISE_ONLY), trial(robot, late, 500.0)):
        assert [own[0] for own in with_formulas_of_others([[leading]], likely, refits)] == [leading] and not asked


def test_every_formula_that_is_worth_a_refit_is_tried_before_one_is_said_to_be_the_law():
    robot = Pioneer()
    names = ("lorentzian", "share_of_coulomb", "gaussian", "exponential", "exponent_one_half", "shape")
    tried, share, gaussian, exponential, root, shape = (effect_by_id(robot, "stribeck_friction", n) for n in names)
    laws = (candidate(shape, 99.0), candidate(gaussian, 90.0), candidate(tried, 75.0))
    laws += (candidate(exponential, 70.0), candidate(root, 50.0))
    screened, asked = [candidate(share, 100.0, laws)], []

    def refits(further):
        asked.extend(c.effect for c in further)
        return [trial(robot, c.effect, 100.0 if c.effect is exponential else 300.0, NOISE_ONLY) for c in further]

    best = [trial(robot, own, 200.0 + 100.0 * k, NOISE_ONLY) for k, own in enumerate((tried, share, gaussian))]
    (found,) = with_its_other_laws([best], screened, refits)
    assert asked == [exponential] and found[0].law == "exponential"
    asked.clear()
    # Where more is missing, by whatever explains some of it.
    with_its_other_laws([[trial(robot, tried, 200.0)]], screened, refits)
    assert asked == [share, shape, gaussian, exponential, root]


def test_a_mechanism_whose_other_law_promises_enough_stays_in_the_running():
    """Its first law does far worse than the best, and another of its laws promises to do as well."""
    robot = Pioneer()
    power, tanh = (effect_by_id(robot, "sublinear_viscous_friction", law) for law in ("power", "tanh"))
    drag = effect_by_id(robot, "quadratic_drag", "shape")
    bent = candidate(power, 4000.0, (candidate(tanh, 4850.0),))
    tried = [trial(robot, drag, 150.0), trial(robot, power, 2000.0)]

    def ranked(first):
        return by_law(
            [candidate(drag, 4800.0), first],
            tried,
            300.0,
            lambda more: [trial(robot, c.effect, 140.0) for c in more],
            5000.0,
        )

    assert [t.law for t in ranked(bent)[0]] == ["tanh", "power"]
    assert [t.law for t in ranked(replace(bent, laws=(candidate(tanh, 4500.0),)))[0]] == ["shape"]


def test_where_a_formula_leaves_only_noise_no_curve_is_asked_for():
    robot = Pioneer()
    zone, tanh, curve = (effect_by_id(robot, "voltage_saturation", law) for law in ("hard", "tanh", "shape"))
    saturation = candidate(zone, 80.0, (candidate(curve, 100.0), candidate(tanh, 60.0)))
    asked = []
    by_law([saturation], [trial(robot, zone, 100.0, NOISE_ONLY)], 500.0, lambda more: asked.extend(more) or [])
    assert [c.effect for c in asked] == [tanh]
    assert [c.effect for c in other_laws(saturation, curve=True)] == [tanh, curve]


def test_the_best_law_s_namesake_of_another_mechanism_is_tried():
    """Of a robot driven by currents, a limit of the torque and one of the current are one model; refitted was another law."""
    robot = Pioneer()
    hard, grip = (effect_by_id(robot, name, "hard") for name in ("voltage_saturation", "traction_limit"))
    tanh = effect_by_id(robot, "voltage_saturation", "tanh")
    screened = [candidate(grip, 80.0), candidate(tanh, 80.0, (candidate(hard, 20.0),))]
    asked = []

    def refits(more):
        asked.extend(c.effect for c in more)
        return [trial(robot, c.effect, 100.0, NOISE_ONLY) for c in more]

    tried = [[trial(robot, grip, 100.0, NOISE_ONLY)], [trial(robot, tanh, 5000.0)]]
    found = with_the_same_law(tried, screened, refits)
    assert asked == [hard] and [[t.law for t in own] for own in found] == [["hard"], ["hard", "tanh"]]
    assert (
        with_the_same_law([[trial(robot, grip, 300.0)], tried[1]], screened, refits)[1] == tried[1] and len(asked) == 1
    )


def test_the_twin_of_a_delay_is_tried_whatever_else_is_missing():
    """Late commands and late sensors are one motion; refitted was the first look's law, by which the twin came off worse."""
    robot = DifferentialDrive()
    late, other = (effect_by_id(robot, name, "constant") for name in ("sensor_delay", "input_delay"))
    scattered, lag = effect_by_id(robot, "input_delay", "jittering"), effect_by_id(robot, "motor_lag")
    screened = [candidate(late, 80.0), candidate(scattered, 80.0, (candidate(other, 79.0),)), candidate(lag, 80.0)]
    asked = []

    def refits(more):
        asked.extend(c.effect for c in more)
        return [trial(robot, c.effect, 300.0) for c in more]

    tried = [[trial(robot, late, 300.0)], [trial(robot, scattered, 900.0)], [trial(robot, lag, 700.0)]]
    found = with_the_same_law(tried, screened, refits)
    assert asked == [other]
    assert [(own[0].id, own[0].law) for own in found[:2]] == [("sensor_delay", "constant"), ("input_delay", "constant")]


def test_of_laws_that_the_data_cannot_tell_apart_the_simplest_and_most_usual_is_named():
    robot = Pioneer()
    hard, tanh, unequal = (effect_by_id(robot, "voltage_saturation", law) for law in ("hard", "tanh", "unequal_limits"))
    tried = {hard: trial(robot, hard, 105.0), tanh: trial(robot, tanh, 104.0)}
    tried[unequal] = replace(trial(robot, unequal, 90.0), free=4)
    laws = candidate(tanh, 80.0, (candidate(unequal, 79.0), candidate(hard, 78.0)))
    (own,) = by_law([laws], [tried[tanh]], 5000.0, lambda more: [tried[c.effect] for c in more])
    assert [t.law for t in own] == ["hard", "unequal_limits", "tanh"]


@pytest.mark.parametrize("identifier", ["asymmetric_friction", "asymmetric_viscous_friction"])
def test_a_curve_for_either_way_that_is_one_both_ways_is_no_asymmetry(identifier, double_precision):
    """Friction that bends alike both ways is one curve of the speed; forward against backward tells nothing of it."""
    robot = DifferentialDrive()
    gap = replace(STATE, residuals=(np.full((SAMPLES, 1), 3.0),))

    def followed(effect, squares, **heights):
        own = trial(robot, effect, squares)
        state = replace(own.fitted, normalised_rms=1.0 + squares / 1e6)
        return replace(own, robot=own.robot.with_values(**heights), fitted=state)

    ways, bend = (effect_by_id(robot, name, "shape") for name in (identifier, "stribeck_friction"))
    each = [[0.9, -0.4, 0.1, 0.3], [0.9, -0.4, 0.1, 0.3]]
    alike, apart = (
        {
            ways.key(f"at_{k}_{way}"): h
            for way, own in zip(("forward", "backward"), pair, strict=True)
            for k, h in enumerate(own, 1)
        }
        for pair in (each, [[0.5, 0.5, 0.6, 0.5], [-0.5, -0.6, -0.5, -0.5]])
    )
    one = followed(bend, 120.0)
    base = replace(one, fitted=replace(gap, normalised_rms=2.0))
    for heights, first in ((alike, one.id), (apart, ways.id)):
        two = followed(ways, 100.0, **heights)
        ranked = by_where_they_bend([[two], [one]], base)
        assert ranked[0][0].id == first
        assert (ways.id in supersets([one, two])) == (first == one.id)
    unexplained = replace(one, fitted=replace(one.fitted, normalised_rms=1.9))
    assert by_where_they_bend([[followed(ways, 100.0, **alike)], [unexplained]], base)[0][0].id == ways.id


def test_a_bend_that_is_rather_stribeck_friction_gives_way_to_any_of_its_laws_that_explains_the_gap():
    axis, falls = Axis(), [-0.7, -0.95, -1.0, -1.0]
    bend = effect_by_id(axis, "sublinear_viscous_friction", "shape")
    gap = replace(STATE, normalised_rms=2.0)
    base = replace(trial(axis, bend, 1.0), fitted=gap)

    def of(effect, rms, heights=()):
        own = trial(axis, effect, 1e4 * rms)
        values = {bend.key(f"at_{k}"): height for k, height in enumerate(heights, 1)}
        return replace(own, robot=own.robot.with_values(**values), fitted=replace(own.fitted, normalised_rms=rms))

    formula = effect_by_id(axis, "stribeck_friction", "exponential")
    for heights, rms, first in ((falls, 1.01, formula), (falls, 1.8, bend), ([0.7, 0.95, 1.0, 1.0], 1.01, bend)):
        ranked = by_where_they_bend([[of(bend, 1.005, heights)], [of(formula, rms)]], base)
        assert ranked[0][0].id == first.id


def test_a_curve_that_falls_towards_standstill_is_rather_a_bend_of_the_viscous_friction():
    axis = Axis()
    law = effect_by_id(axis, "stribeck_friction", "shape")
    assert law.rather == effect_by_id(axis, law.rather, "shape").id == "sublinear_viscous_friction"
    for height, rises in ((2.0, True), (-2.0, False)):
        robot = (axis + law).with_values(**{law.height(0): height})
        assert law.agrees(robot) is rises


def test_a_bend_that_falls_at_once_is_rather_friction_that_rises_towards_standstill():
    """The Coulomb friction takes its level; one that grows with the cube of the speed is none, nor one that levels off."""
    axis = Axis()
    law = effect_by_id(axis, "sublinear_viscous_friction", "shape")
    assert law.rather == "stribeck_friction"
    reach = axis.scales.speed
    for bend, agrees in (
        (lambda s: -(1.0 - np.exp(-8.0 * s)), False),
        (lambda s: s**3, True),
        (lambda s: s**3 - s, True),
        (lambda s: 1.0 - np.exp(-8.0 * s), True),
    ):
        heights = {law.height(k): float(bend(law.places[k])) for k in law.varying}
        robot = (axis + law).with_values(**heights, **{law.key("reach"): reach})
        assert law.agrees(robot) is agrees


def test_drag_that_falls_at_once_is_rather_friction_that_rises_towards_standstill():
    axis = Axis()
    law = effect_by_id(axis, "quadratic_drag", "shape")
    assert law.rather == "stribeck_friction"
    for drag, agrees in ((lambda s: -(1.0 - np.exp(-8.0 * s)), False), (lambda s: s**2, True), (lambda s: s**3, True)):
        heights = {law.height(k): float(drag(law.places[k])) for k in law.varying}
        assert law.agrees((axis + law).with_values(**heights)) is agrees


@pytest.mark.parametrize("seed", [31095, 31145])
def test_rounded_speeds_of_a_complete_model_hide_nothing(tmp_path, seed):
    """What rounding makes of slow signals is slow, and below the noise that neighbouring samples show."""
    fitted, held_out, model = make("axis", {}, seed, noise_kind="quantised").write(tmp_path)
    robot = read_model(model, Axis())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        logs, check = (read_logs([str(path) for path in paths], robot="axis") for paths in (fitted, held_out))
    assert explain(output_error(robot, logs), logs, check).verdict == "adequate"
