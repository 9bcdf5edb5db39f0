"""Curves through as many points as the robot's own parameters need, on an axis in closed form behind a soft limit."""

from dataclasses import replace

import pytest

from jaxid import Axis, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.finer_curves import moved, through_enough_points
from jaxid.explanation.refit import in_full, refit
from jaxid.explanation.steps import Search
from jaxid.logs import noise_scale
from jaxid.simulation.scaled import scaled_to
from tests.explanation.closed_form_axis import driven

TRUE = {"M": 1.0, "Fv": 2.0}


def soft_limit(u):
    """A command that a limit of 3 cuts off little by little."""
    return u / (1.0 + (u / 3.0) ** 4) ** 0.25


@pytest.fixture(scope="module")
def found():
    """What a search has found of a soft limit: its curve of few points, the first held at zero."""
    logs, held_out = driven(soft_limit, 5, count=7)
    noise = noise_scale(held_out, otherwise=logs)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs).change("Fc", free=False)
    base = output_error(robot, logs)
    model = base.robot + effect_by_id(base.robot, "voltage_saturation", "shape")
    model = model.with_values(**{"voltage_saturation.at_1": 0.0}).change("voltage_saturation.at_1", free=False)
    start = {name: model.parameters[name].value for name in model.parameters.free_names}
    trial = refit(model, [start], logs, held_out, noise, base.initial_states)
    search = Search(before=trial.held_out, after=trial.held_out, final=trial, steps=(), first_look=())
    return search, trial, lambda own: in_full(own, logs, noise)


def errors_off(fit):
    return max(abs(fit[name].value - value) / fit[name].std_error for name, value in TRUE.items())


def test_parameters_that_a_curve_of_few_points_made_wrong_are_right_with_more(found):
    search, trial, fitted = found
    coarse = fitted(trial)
    assert errors_off(coarse) > 4.0
    said = []
    finer = through_enough_points(search, coarse, fitted, lambda own: True, said.append)
    assert any("needs a curve through more points" in sentence for sentence in said)
    assert errors_off(finer.final) < 3.0
    assert finer.found.final.robot.parameters["M"].value == finer.final["M"].value
    # What is held at zero is the loss of the smallest commands now, and that of the coarse curve's is estimated.
    table = finer.final.robot.parameters
    assert [name for name in table if ".at_" in name and not table[name].free] == ["voltage_saturation.at_1"]
    # A finer one yet would move nothing by more than it costs.
    assert len(said) in (3, 4)


def test_a_curve_that_is_no_longer_seen_through_more_points_stays(found):
    search, trial, fitted = found
    coarse = fitted(trial)
    kept = through_enough_points(search, coarse, fitted, lambda own: False, lambda sentence: None)
    assert kept.final is coarse and kept.found is search


def test_what_moves_by_what_further_parameters_cost_has_not_moved(found):
    _, trial, fitted = found
    coarse = fitted(trial)

    def like(name, by, wider):
        estimate = coarse[name]
        error = wider * estimate.std_error
        changed = replace(estimate, value=estimate.value + by * estimate.std_error, std_error=error)
        return replace(coarse, parameters={**coarse.parameters, name: changed})

    assert not moved(coarse, like("M", 1.5, 2.0)) and moved(coarse, like("M", 4.0, 2.0))
    # An estimate that is lost is no better one.
    lost = like("M", 4.0, 2.0)
    lost = replace(lost, parameters={**lost.parameters, "M": replace(lost["M"], status="not_identifiable")})
    assert not moved(coarse, lost)
