"""jaxid/explanation/search/formulas.py: formulas in the place of curves, on an axis in closed form."""

from dataclasses import replace

import numpy as np

from jaxid.effects import effect_by_id
from jaxid.explanation.refits.refit import continued, refit_from_itself
from jaxid.explanation.search.formulas import by_formulas
from jaxid.explanation.search.reconsider import pruned_in_the_end
from jaxid.explanation.search.steps import Step
from tests.explanation.closed_form_axis import driven
from tests.explanation.search.test_reconsider import found_of, smooth_zone

SEED = 9


def _by_its_curve(logs, held_out):
    """The step to a dead zone as a search has it whose first look promised the curve alone."""
    noise, step, _ = found_of(logs, held_out)
    base = step.before
    robot = base.robot + effect_by_id(base.robot, "actuator_dead_zone", "shape")
    curve = continued(refit_from_itself(robot, base, logs, held_out, noise), logs, held_out, noise)
    return noise, Step((curve,), (), (), base, curve, (curve,))


def test_a_formula_that_does_as_well_as_the_curve_is_the_law():
    logs, held_out = driven(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0), SEED)
    noise, step = _by_its_curve(logs, held_out)
    (found,), current = by_formulas([step], step.chosen, step.before, logs, held_out, noise, lambda message: None)
    assert (found.chosen.id, found.chosen.law) == ("actuator_dead_zone", "subtractive")
    assert abs(current.robot.parameters["actuator_dead_zone.threshold"].value - 0.6) < 0.02
    assert current.held_out.normalised_rms < 1.05 and current.free < step.chosen.free
    assert "shape" in [trial.law for trial in found.laws]


def test_a_curve_beside_what_was_found_later_gives_way_to_the_formula_of_a_name_that_came_near_it():
    """A limit's curve stood for a dead zone, which had been tried by another law, and a drag came after it."""
    logs, held_out = driven(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0), SEED)
    noise, zone, _ = found_of(logs, held_out)
    base = zone.before

    def with_law(before, identifier, law):
        robot = before.robot + effect_by_id(before.robot, identifier, law)
        return continued(refit_from_itself(robot, before, logs, held_out, noise), logs, held_out, noise)

    limit = with_law(base, "voltage_saturation", "shape")
    other_law = with_law(base, "actuator_dead_zone", "threshold")
    both = with_law(limit, "quadratic_drag", "whole_speed")
    first = Step((limit, other_law), (), (), base, limit, (limit,))
    second = Step((both,), (), (), limit, both, (both,))
    (found, _), current = by_formulas([first, second], both, base, logs, held_out, noise, lambda message: None)
    assert (found.chosen.id, found.chosen.law) == ("actuator_dead_zone", "subtractive")
    assert {effect.id for effect in current.robot.effects} == {"actuator_dead_zone", "quadratic_drag"}
    assert abs(current.robot.parameters["actuator_dead_zone.threshold"].value - 0.6) < 0.03
    # Where nothing has been found since, those that came near it were asked by all their laws beside it.
    (alone,), current = by_formulas([first], limit, base, logs, held_out, noise, lambda message: None)
    assert alone.chosen.id == "voltage_saturation"


def test_a_curve_that_no_formula_follows_stays():
    logs, held_out = driven(lambda u: smooth_zone(u) - 0.3 * np.clip(u - 2.0, 0.0, None), SEED)
    noise, step = _by_its_curve(logs, held_out)
    (found,), current = by_formulas([step], step.chosen, step.before, logs, held_out, noise, lambda message: None)
    assert found is step and current is step.chosen


def test_what_the_finished_model_does_not_need_is_dropped():
    """Beside the dead zone that is there, a drag that was added before it explains nothing."""
    logs, held_out = driven(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0), SEED)
    noise, zone, drag = found_of(logs, held_out)
    steps, current = pruned_in_the_end(
        [drag, zone], drag.chosen, zone.before, logs, held_out, noise, lambda message: None
    )
    assert [step.chosen.id for step in steps] == ["actuator_dead_zone"] == [e.id for e in current.robot.effects]
    assert current.held_out.normalised_rms < 1.05
    # One alone is what was found.
    assert pruned_in_the_end([zone], zone.chosen, zone.before, logs, held_out, noise, lambda message: None) == (
        [zone],
        zone.chosen,
    )


def test_the_evidence_of_a_name_that_came_later_is_its_own():
    logs, held_out = driven(smooth_zone, SEED)
    _, step, further = found_of(logs, held_out)
    assert step.evidence == (step.before, step.after)
    early = replace(step.before, id="quadratic_drag")
    exchanged = replace(step, trials=(further.chosen, early), instead=(step.chosen, further.chosen))
    assert exchanged.evidence == (step.chosen, further.chosen)
    # What was refitted without the dead zone compares with nothing beside it.
    assert exchanged.compared == (further.chosen,) and step.compared == step.trials
