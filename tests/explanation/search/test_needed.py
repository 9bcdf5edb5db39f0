"""jaxid/explanation/search/needed.py: effects of which the final fit is not sure, on an axis in closed form."""

import numpy as np
import pytest

from jaxid import Axis, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.refits.prescribed_angles import predicted
from jaxid.explanation.refits.refit import in_full, refit
from jaxid.explanation.search import needed as needing
from jaxid.explanation.search.needed import only_needed
from jaxid.explanation.search.steps import Search, Step
from jaxid.logs import noise_scale
from jaxid.parameters import ParameterError
from jaxid.simulation.scaled import scaled_to
from tests.explanation.closed_form_axis import driven

ZONE = ("actuator_dead_zone", "subtractive")


def needed(force, *effects, again=in_full, kept=None):
    """What of the effects, added one after another, is left, whether all of them explain all, and what was said; models with
    less are fitted by `again`, and `kept` gets those that were found to be needed."""
    kept = [] if kept is None else kept
    logs, held_out = driven(force, 9)
    noise = noise_scale(held_out, otherwise=logs)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs).change("Fc", free=False)
    baseline = output_error(robot, logs)
    model, states, trials, steps = baseline.robot, baseline.initial_states, [], []
    for identifier, law in ((None, None), *effects):
        if identifier is not None:
            model = trials[-1].robot + effect_by_id(trials[-1].robot, identifier, law)
        start = {name: model.parameters[name].value for name in model.parameters.free_names}
        if identifier is not None:
            start |= {n: p.typical for n, p in model.effects[-1].parameters(model).items() if p.free}
        trials.append(refit(model, [start], logs, held_out, noise, states))
        if identifier is not None:
            steps.append(Step((trials[-1],), (), (), trials[-2], trials[-1]))
    final = in_full(trials[-1], logs, noise)
    after, said = predicted(final.robot, held_out, noise), []
    before = held_out_state(baseline.robot, held_out, noise)
    search = Search(before, after, trials[-1], tuple(steps), ())
    found, fit, state = only_needed(
        search, final, after, baseline, held_out, lambda trial: again(trial, logs, noise), said.append
    )
    assert [step.chosen.id for step in found.steps] == [effect.id for effect in fit.robot.effects]
    assert state.normalised_rms < 1.05 * after.normalised_rms
    kept.extend(found.needed)
    return [effect.id for effect in fit.robot.effects], after.adequate, said


@pytest.mark.parametrize(("sharpness", "all_explained"), [(1e3, True), (6.0, False)])
def test_what_may_as_well_be_none_is_left_out_whether_or_not_all_is_explained(sharpness, all_explained):
    """A dead zone, its edges sharp as the law has them or rounded, and a bias that nothing speaks for."""

    def zone(u):
        return np.sign(u) * np.logaddexp(0.0, sharpness * (np.abs(u) - 0.8)) / sharpness

    kept: list[str] = []
    left, adequate, said = needed(zone, ZONE, ("sensor_bias", "constant"), kept=kept)
    assert adequate == all_explained and not kept
    assert left == ["actuator_dead_zone"] and said[-1] == "sensor_bias is not needed"


def test_what_leads_nowhere_when_it_is_left_out_stays():
    def nowhere(trial, logs, noise):
        raise ParameterError("Derivatives are not finite")

    left, _, said = needed(
        lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.8, 0.0), ZONE, ("sensor_bias", "constant"), again=nowhere
    )
    assert left == ["actuator_dead_zone", "sensor_bias"] and said[-1].startswith("fitting again without sensor_bias")


def test_what_the_fit_is_sure_of_stays():
    def late_zone(u):
        late = np.concatenate([np.zeros(2), u[:-2]])
        return np.sign(late) * np.maximum(np.abs(late) - 0.8, 0.0)

    left, _, said = needed(late_zone, ZONE, ("input_delay", "constant"))
    assert left == ["actuator_dead_zone", "input_delay"] and not said


def test_without_which_clearly_more_is_left_is_needed_whatever_its_errors_say(monkeypatch):
    """As of gear play, along whose parameters the cost hardly rises though there is no fit without it."""
    sure = needing.sure_of
    monkeypatch.setattr(needing, "sure_of", lambda effect, *others: effect.id != ZONE[0] and sure(effect, *others))

    def late_zone(u):
        late = np.concatenate([np.zeros(2), u[:-2]])
        return np.sign(late) * np.maximum(np.abs(late) - 0.8, 0.0)

    kept: list[str] = []
    left, _, said = needed(late_zone, ZONE, ("input_delay", "constant"), kept=kept)
    assert left == ["actuator_dead_zone", "input_delay"] and kept == ["actuator_dead_zone"]
    assert said == ["fitting again without actuator_dead_zone, which may as well be none"]
