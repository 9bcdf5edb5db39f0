"""One mechanism's curve instead of a further name beside its formula, on an axis in closed form."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from jaxid import Axis, Pioneer, output_error
from jaxid.effects import effect_by_id, laws_of
from jaxid.explanation.refits.refit import refit, refit_from_itself
from jaxid.explanation.search import reconsider
from jaxid.explanation.search.plainer_laws import by_plainer_laws
from jaxid.explanation.search.reconsider import (
    bare_of_the_end,
    by_laws_again,
    exchanged,
    rather_by_curves,
    reconsidered,
    rivals_of,
)
from jaxid.explanation.search.steps import Step
from jaxid.logs import noise_scale
from jaxid.simulation.scaled import scaled_to
from tests.explanation.closed_form_axis import driven

SEED = 9


def found_of(logs, held_out):
    """The step to a dead zone, and that from there to a quadratic drag, as a search has them."""
    noise = noise_scale(held_out, otherwise=logs)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs).change("Fc", free=False)
    fit = output_error(robot, logs)

    def trial(model, before):
        start = {name: model.parameters[name].value for name in model.parameters.free_names}
        strengths = {n: p.typical for n, p in model.effects[-1].parameters(model).items()} if model.effects else {}
        return refit(model, [start | strengths], logs, held_out, noise, before)

    base = trial(fit.robot, fit.initial_states)
    one = trial(base.robot + effect_by_id(base.robot, "actuator_dead_zone", "subtractive"), base.initial_states)
    two = trial(one.robot + effect_by_id(one.robot, "quadratic_drag"), one.initial_states)
    return noise, Step((one,), (), (), base, one, (one,)), Step((two,), (), (), one, two, (two,))


def smooth_zone(u):
    """What passes of a command: little near zero, bent as no dead zone with two edges is."""
    return u - 0.8 * np.tanh(u / 0.8)


def test_the_curve_of_one_mechanism_is_taken_instead_of_two_names():
    logs, held_out = driven(smooth_zone, SEED)
    noise, step, further = found_of(logs, held_out)
    steps, current = rather_by_curves([step], further, logs, held_out, noise, lambda message: None)
    assert [own.chosen.id for own in steps] == ["actuator_dead_zone"] and steps[0].chosen.law == "shape"
    assert current is steps[0].chosen and current.score < further.chosen.score
    assert current.fitted.normalised_rms < 1.1 < further.chosen.fitted.normalised_rms


def test_a_second_name_that_no_curve_stands_in_for_stays():
    """A dead zone with its edges, and a drag that is none of the command's."""
    logs, held_out = driven(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0), SEED)
    noise, step, further = found_of(logs, held_out)
    worse = Step(further.trials, (), (), further.chosen, further.chosen, further.laws)
    # Whose model before it was not the last step's, there is nothing to stand in for.
    assert rather_by_curves([step], worse, logs, held_out, noise, lambda message: None) is None


def test_a_curve_is_not_looked_for_twice():
    logs, held_out = driven(smooth_zone, SEED)
    noise, step, further = found_of(logs, held_out)
    again, current = rather_by_curves([step], further, logs, held_out, noise, lambda message: None)
    beyond = Step(further.trials, (), (), current, further.chosen, further.laws)
    assert rather_by_curves(again, beyond, logs, held_out, noise, lambda message: None) is None


def test_beside_a_curve_rivals_from_farther_off_are_looked_at_again():
    """A curve follows a part of what was still missing, too; what a formula explains without that says less against it."""
    logs, held_out = driven(lambda u: np.sign(u) * np.maximum(np.abs(u) - 1.0, 0.0), SEED)
    noise, step, further = found_of(logs, held_out)
    base, formula = step.before, step.chosen
    curve = refit_from_itself(
        base.robot + effect_by_id(base.robot, "actuator_dead_zone", "shape"), base, logs, held_out, noise
    )
    rival = refit_from_itself(base.robot + effect_by_id(base.robot, "motor_lag"), base, logs, held_out, noise)
    looked = {}
    for chosen in (formula, curve):
        # As if neither had explained what the later effect does, the rival 0.4 of what was gained behind.
        gained = base.score - chosen.score
        behind = replace(rival, squares=rival.squares + chosen.score + 0.4 * gained - rival.score)
        first = replace(step, trials=(chosen, behind, replace(base, id="backlash")), laws=(chosen,), after=chosen)
        second = replace(further, trials=(further.chosen,))
        said = []
        final = refit_from_itself(
            chosen.robot + effect_by_id(chosen.robot, "quadratic_drag"), chosen, logs, held_out, noise
        )
        steps, found = reconsidered([first, second], final, base, logs, held_out, noise, said.append)
        looked[chosen.law] = any("with motor_lag (first_order) instead" in sentence for sentence in said)
        assert steps[0].chosen.id == "actuator_dead_zone" and found.score <= final.score + 10.0
    assert looked == {formula.law: False, "shape": True}


def test_rivals_that_could_not_be_told_apart_are_looked_at_first():
    """Others that did better while a later effect was missing would leave no room for them."""
    logs, held_out = driven(smooth_zone, SEED)
    _, step, _ = found_of(logs, held_out)
    chosen = step.chosen
    far = replace(chosen, id="none", squares=chosen.squares + 1e4)
    near = [replace(chosen, id=name, squares=chosen.squares + 10.0) for name in ("a", "b", "c", "d", "e")]
    found = replace(step, trials=(chosen, *near, far), equivalent=("e",), before=far)
    assert [trial.id for trial in rivals_of(found, {"a"})] == ["e", "b", "c"]


def test_what_an_effect_gained_is_told_from_the_model_without_it():
    """Where every other trial explained something, too, the worst of them says little of what there was to explain."""
    logs, held_out = driven(smooth_zone, SEED)
    _, step, _ = found_of(logs, held_out)
    chosen = step.chosen
    two = [replace(chosen, id=name, squares=chosen.squares + more) for name, more in (("a", 1e3), ("b", 3e3))]
    for without, expected in ((3e3, []), (1e4, ["a"])):
        found = replace(step, trials=(chosen, *two), before=replace(chosen, squares=chosen.squares + without))
        assert [trial.id for trial in rivals_of(found, set())] == expected


@pytest.mark.slow
def test_a_rival_has_the_law_that_suits_beside_the_later_effects_too():
    """A late command with a dead zone: while the dead zone was missing, both delays were taken to grow; when it was there, only
    the one that had come first was looked at by its other laws."""
    logs, held_out = driven(lambda u: np.where(np.abs(late(u)) > 0.5, late(u) - 0.5 * np.sign(late(u)), 0.0), SEED)
    noise, step, further = found_of(logs, held_out)
    base = step.before

    def delayed(identifier, law, before, size):
        robot = before.robot + effect_by_id(before.robot, identifier, law)
        known = {name: robot.parameters[name].value for name in robot.parameters.free_names}
        own = dict.fromkeys((n for n in known if n.startswith(identifier)), size)
        return refit(robot, [known | own], logs, held_out, noise, before.initial_states)

    grown, rival = (delayed(name, "growing", base, 0.01) for name in ("sensor_delay", "input_delay"))
    zone = step.chosen
    final = replace(delayed("sensor_delay", "constant", zone, 0.04), id="actuator_dead_zone")
    chosen = delayed("sensor_delay", "constant", base, 0.04)
    first = Step((chosen, rival, replace(base, id="backlash")), (), (), base, grown, (chosen,))
    second = replace(step, trials=(zone,), before=grown)
    steps, found = reconsidered([first, second], final, base, logs, held_out, noise, lambda message: None)
    trials = {trial.id: trial for trial in steps[0].trials}
    assert found.held_out.normalised_rms < 1.1 and trials["input_delay"].law == "constant"
    assert {steps[0].chosen.id, *steps[0].equivalent} == {"sensor_delay", "input_delay"}


@pytest.mark.slow
def test_the_name_that_a_rival_takes_the_place_of_is_looked_at_by_its_other_laws_too():
    """It had the law that suited while a dead zone was missing, a growing delay, and the rival the one that suits beside it."""
    logs, held_out = driven(lambda u: np.where(np.abs(late(u)) > 0.5, late(u) - 0.5 * np.sign(late(u)), 0.0), SEED)
    noise, step, _ = found_of(logs, held_out)
    base, zone = step.before, step.chosen

    def delayed(identifier, law, before, size):
        robot = before.robot + effect_by_id(before.robot, identifier, law)
        known = {name: robot.parameters[name].value for name in robot.parameters.free_names}
        own = dict.fromkeys((n for n in known if n.startswith(identifier)), size)
        return refit(robot, [known | own], logs, held_out, noise, before.initial_states)

    grown, rival = delayed("sensor_delay", "growing", base, 0.001), delayed("input_delay", "constant", base, 0.04)
    final = replace(delayed("sensor_delay", "growing", zone, 0.001), id="actuator_dead_zone")
    first = Step((grown, rival, replace(base, id="backlash")), (), (), base, grown, (grown,))
    second = replace(step, trials=(zone,), before=grown)
    steps, found = reconsidered([first, second], final, base, logs, held_out, noise, lambda message: None)
    assert found.held_out.normalised_rms < 1.1
    assert {trial.id: trial.law for trial in steps[0].trials[:2]} == {
        "sensor_delay": "constant",
        "input_delay": "constant",
    }
    assert {steps[0].chosen.id, *steps[0].equivalent} == {"sensor_delay", "input_delay"}


def test_what_was_not_told_from_a_name_while_others_were_missing_is_asked_again():
    """A drag was as good as the delay while the dead zone was missing; beside it, it is not."""
    logs, held_out = driven(lambda u: np.where(np.abs(late(u)) > 0.5, late(u) - 0.5 * np.sign(late(u)), 0.0), SEED)
    noise, step, _ = found_of(logs, held_out)
    base, zone = step.before, step.chosen

    def with_one_more(before, identifier):
        robot = before.robot + effect_by_id(before.robot, identifier)
        known = {name: robot.parameters[name].value for name in robot.parameters.free_names}
        known |= {n: 0.04 if "delay" in n else 0.1 for n in known if n.startswith(identifier)}
        return refit(robot, [known], logs, held_out, noise, before.initial_states)

    delay, drag = with_one_more(base, "sensor_delay"), with_one_more(base, "quadratic_drag")
    final = replace(with_one_more(zone, "sensor_delay"), id="actuator_dead_zone")
    first = Step((delay, replace(drag, squares=delay.squares)), ("quadratic_drag",), (), base, delay, (delay,))
    second = replace(step, trials=(zone,), before=delay)
    steps, _ = reconsidered([first, second], final, base, logs, held_out, noise, lambda message: None)
    assert steps[0].chosen.id == "sensor_delay" and "quadratic_drag" not in steps[0].equivalent


@pytest.mark.slow
def test_laws_that_what_is_in_the_model_refuses_are_not_tried_again():
    """A delay, and later a lag of the sensor: stamps that are early stand beside no lag."""
    logs, held_out = driven(late, SEED)
    noise, step, _ = found_of(logs, held_out)
    base = step.before

    def with_one_more(before, identifier, law):
        return refit_from_itself(
            before.robot + effect_by_id(base.robot, identifier, law), before, logs, held_out, noise
        )

    delay = with_one_more(base, "sensor_delay", "constant")
    both = with_one_more(delay, "sensor_lag", "first_order")
    lag = with_one_more(base, "sensor_lag", "first_order")
    assert not any(law.law == "early" for law in laws_of(lag.robot, "sensor_delay"))
    first, second = Step((delay,), (), (), base, delay, (delay,)), Step((both,), (), (), delay, both, (both,))
    # Still far from the noise, so that other laws are asked for.
    current = both.leaving(base.held_out)
    said = []
    steps, found = by_laws_again([first, second], current, base, logs, held_out, noise, said.append)
    assert "the laws of sensor_delay once more" in said
    assert [own.chosen.id for own in steps] == ["sensor_delay", "sensor_lag"] and found.score <= current.score


def late(u):
    """The command two rows before."""
    return np.concatenate([np.zeros(2), u[:-2]])


@pytest.mark.slow
def test_the_last_law_is_chosen_anew_where_an_earlier_one_has_changed():
    """A late command with a dead zone: beside a delay that grows, a dead zone by a wrong law was as good as any."""
    logs, held_out = driven(lambda u: np.where(np.abs(late(u)) > 1.0, late(u) - np.sign(late(u)), 0.0), SEED)
    noise, step, _ = found_of(logs, held_out)
    base = step.before

    def with_more(before, identifier, law, **sizes):
        robot = before.robot + effect_by_id(before.robot, identifier, law)
        start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
        start |= {f"{identifier}.{name}": size for name, size in sizes.items()}
        return refit(robot, [start], logs, held_out, noise, before.initial_states)

    grown = with_more(base, "sensor_delay", "growing", rate=0.01)
    zone = with_more(grown, "actuator_dead_zone", "threshold", threshold=0.8)
    first = Step((grown,), (), (), base, grown, (grown,))
    second = Step((zone,), (), (), grown, zone, (zone,))
    steps, found = by_laws_again([first, second], zone, base, logs, held_out, noise, lambda message: None)
    assert [own.chosen.law for own in steps] == ["constant", "subtractive"]
    assert found.held_out.normalised_rms < 1.1 < zone.held_out.normalised_rms


def late_with_a_zone(u):
    """The late command, less what a dead zone takes."""
    return np.sign(late(u)) * np.maximum(np.abs(late(u)) - 1.0, 0.0)


def two_effects(*added):
    """Trials one upon the other on logs of a late command with a dead zone, and what to go on with. Each of `added` is an
    effect, its law, and where its parameters start."""
    logs, held_out = driven(late_with_a_zone, SEED)
    noise, step, _ = found_of(logs, held_out)

    def with_more(before, identifier, law, **sizes):
        robot = before.robot + effect_by_id(before.robot, identifier, law)
        start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
        start |= {f"{identifier}.{name}": size for name, size in sizes.items()}
        return refit(robot, [start], logs, held_out, noise, before.initial_states)

    trials = [step.before]
    for identifier, law, sizes in added:
        trials.append(with_more(trials[-1], identifier, law, **sizes))
    return trials, with_more, (logs, held_out, noise, lambda message: None)


def test_an_earlier_effect_is_exchanged_for_the_rival_that_explains_more_beside_the_last():
    """A lag was taken for the delay while the dead zone was missing; the next name would be looked for beside it."""
    added = (
        ("motor_lag", "first_order", {"time_constant": 0.05}),
        ("actuator_dead_zone", "subtractive", {"threshold": 0.8}),
    )
    (base, lag, zone), with_more, rest = two_effects(*added)
    delay = with_more(base, "input_delay", "constant", delay=0.04)
    # As if the lag had come first by a little.
    lag = replace(lag, squares=min(lag.squares, delay.squares - 20.0))
    first = Step((lag, delay), (), (), base, lag, (lag,))
    second = Step((zone,), (), (), lag, zone, (zone,))
    assert zone.held_out.normalised_rms > 1.1
    steps, found = exchanged([first, second], zone, base, *rest)
    assert [own.chosen.id for own in steps] == ["input_delay", "actuator_dead_zone"]
    assert found.id == "actuator_dead_zone" and found.held_out.normalised_rms < 1.1
    assert steps[0].trials[1].id == "motor_lag"
    again, same = exchanged(steps, found, base, *rest)
    assert again == steps and same is found  # nothing but noise is left


def test_what_does_not_hold_on_other_logs_is_neither_in_the_model_nor_its_name(monkeypatch):
    """Of two rivals that explain more, the one that follows the fitted logs better predicts the others badly."""
    added = (
        ("motor_lag", "first_order", {"time_constant": 0.05}),
        ("actuator_dead_zone", "subtractive", {"threshold": 0.8}),
    )
    (base, lag, zone), with_more, rest = two_effects(*added)
    delays = [with_more(base, name, "constant", delay=0.04) for name in ("input_delay", "sensor_delay")]
    lag = replace(lag, squares=min(lag.squares, *(delay.squares - 20.0 for delay in delays)))
    first, second = Step((lag, *delays), (), (), base, lag, (lag,)), Step((zone,), (), (), lag, zone, (zone,))
    (plain, _), found = exchanged([first, second], zone, base, *rest)
    leading = plain.chosen.id
    monkeypatch.setattr(reconsider, "holds_as_well", lambda trial, current: trial.id != leading)
    (kept, _), found = exchanged([first, second], zone, base, *rest)
    assert kept.chosen.id != leading and kept.chosen.id in {effect.id for effect in found.robot.effects}
    assert kept.evidence[1].robot == found.robot and kept.evidence[0].held_out.normalised_rms > 1.1


def test_a_curve_chosen_while_another_effect_was_missing_gives_way_to_its_formula():
    (base, curve, delay), with_more, rest = two_effects(
        ("actuator_dead_zone", "shape", {}), ("input_delay", "constant", {"delay": 0.04})
    )
    formula = with_more(base, "actuator_dead_zone", "subtractive", threshold=0.8)
    first = Step((curve,), (), (), base, curve, (curve, formula))
    second = Step((delay,), (), (), curve, delay, (delay,))
    steps, found = by_plainer_laws([first, second], delay, base, *rest)
    assert [own.chosen.law for own in steps] == ["subtractive", "constant"]
    assert found.id == "input_delay" and found.held_out.normalised_rms < 1.1
    assert found.robot.parameters["actuator_dead_zone.threshold"].value == pytest.approx(1.0, abs=0.02)
    # Chosen beside just these laws of the others, nothing is tried again.
    said = []
    beside = replace(first, before=with_more(base, "input_delay", "constant", delay=0.04))
    again, same = by_plainer_laws([beside], delay, base, *rest[:3], said.append)
    assert not said and same is delay and again[0].chosen is curve


def test_rivals_are_near_to_the_law_that_an_effect_has_now():
    """One that was by far the best while a later effect was missing says nothing against rivals that have no such law."""
    logs, held_out = driven(smooth_zone, SEED)
    _, step, _ = found_of(logs, held_out)
    chosen = step.chosen
    behind = [replace(chosen, id=name, squares=chosen.squares + more) for name, more in (("a", 5e3), ("far", 1e4))]
    plain = replace(chosen, squares=chosen.squares + 5e3)
    found = replace(step, trials=(chosen, *behind), before=behind[-1])
    assert [trial.id for trial in rivals_of(found, set())] == []
    assert [trial.id for trial in rivals_of(replace(found, as_it_was=plain), set())] == ["a"]


def test_a_model_without_an_effect_that_frees_a_parameter_has_it_as_before():
    """A centre of mass that an effect found off the middle is in the middle without it; the others keep their numbers."""
    base = Pioneer().with_values(M=14.0)
    offset, drag = effect_by_id(base, "lateral_com_offset"), effect_by_id(base, "quadratic_drag")
    (name,) = offset.frees(base)
    final = (base + offset + drag).with_values(**{name: 0.02, "M": 15.0, "quadratic_drag.coefficient": 3.0})
    trials = [SimpleNamespace(robot=robot) for robot in (final, base)]
    bare = bare_of_the_end("lateral_com_offset", *trials)
    assert [effect.id for effect in bare.effects] == ["quadratic_drag"]
    table = bare.parameters
    assert table[name].value == base.parameters[name].value and not table[name].free
    assert (table["M"].value, table["quadratic_drag.coefficient"].value) == (15.0, 3.0)
    kept = bare_of_the_end("quadratic_drag", *trials).parameters
    assert (kept[name].value, kept[name].free, kept["M"].value) == (0.02, True, 15.0)
