"""Curves through as many points as the robot's own parameters need, on an axis in closed form behind a soft limit."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.certainty.finer_curves import (
    _losing_nothing_of_the_small,
    _worse,
    by_a_curve_instead,
    hangs_on_forms,
    moved,
    through_enough_points,
    widened_by_forms,
)
from jaxid.explanation.refits.refit import in_full, refit
from jaxid.explanation.search.reconsider import by_its_curve
from jaxid.explanation.search.steps import Search, Step
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


def test_a_limit_s_curve_that_has_a_gain_of_all_is_asked_without_it():
    """It loses 30 % of everything, and what is beyond 6 V of 10: the same robot has a mass larger by as much."""
    robot = Axis() + effect_by_id(Axis(), "voltage_saturation", "shape")
    reach = robot.parameters["voltage_saturation.reach"].value
    places = reach * np.array([0.25, 0.5, 0.75, 1.0])
    heights = {f"voltage_saturation.at_{k + 1}": 0.3 * x + max(x - 0.6 * reach, 0.0) for k, x in enumerate(places)}
    model = robot.with_values(M=0.7, **heights)
    asked = _losing_nothing_of_the_small(model, "voltage_saturation", robot.with_values(M=1.0)).parameters
    assert asked["M"].value == 1.0 and not asked["voltage_saturation.at_1"].free
    left = [asked[name].value for name in heights]
    assert np.allclose(left, [0.0, 0.0, 0.15 * reach, 0.4 * reach])
    held = model.change("voltage_saturation.at_1", free=False)
    assert _losing_nothing_of_the_small(held, "voltage_saturation", robot) is held


def test_a_freer_form_that_leaves_more_says_nothing(found):
    fit = found[2](found[1])
    left = fit.judgement.normalised_rms
    assert _worse(replace(fit, judgement=replace(fit.judgement, normalised_rms=1.2 * left)), fit)
    assert not _worse(replace(fit, judgement=replace(fit.judgement, normalised_rms=1.02 * left)), fit)


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
    assert finer.found.final is not None and finer.found.final.robot.parameters["M"].value == finer.final["M"].value
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

    assert not moved(coarse, like("M", 1.5, 2.0)) and moved(coarse, like("M", 5.0, 2.0))
    # An estimate that is lost is no better one.
    lost = like("M", 5.0, 2.0)
    lost = replace(lost, parameters={**lost.parameters, "M": replace(lost["M"], status="not_identifiable")})
    assert not moved(coarse, lost)
    # One that ends at its bound by more than its error has moved; of one without an error nothing is known.
    bound = like("M", 5.0, 2.0)
    bound = replace(bound, parameters={**bound.parameters, "M": replace(bound["M"], status="at_bound")})
    assert moved(coarse, bound)
    bare = replace(bound, parameters={**bound.parameters, "M": replace(bound["M"], std_error=float("nan"))})
    assert not moved(coarse, bare) and moved(coarse, bare, lost=True)


def searched(logs, held_out, identifier, law, **own):
    """What a search has named by a formula, begun with its `own` numbers; the fit in full of that; the model with the curve of
    a mechanism, and how a model is fitted in full."""
    noise = noise_scale(held_out, otherwise=logs)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs).change("Fc", free=False)
    fit = output_error(robot, logs)

    def refitted(model, **values):
        start = {name: model.parameters[name].value for name in model.parameters.free_names} | values
        return refit(model, [start], logs, held_out, noise, fit.initial_states)

    base = refitted(fit.robot)
    begun = {f"{identifier}.{name}": value for name, value in own.items()}
    trial = refitted(base.robot + effect_by_id(base.robot, identifier, law), **begun)
    step = Step((trial,), (), (), base, trial, (trial,))
    search = Search(before=base.held_out, after=trial.held_out, final=trial, steps=(step,), first_look=())

    def curve_of(name):
        return by_its_curve(name, trial, base, logs, held_out, noise, lambda sentence: None)

    def fitted(other):
        return in_full(other, logs, noise)

    return search, fitted(trial), curve_of, fitted


def named_by(logs, held_out, identifier, law, **own):
    """The fit in full of the same, and that with errors that allow for the formula's form."""
    search, plain, curve_of, fitted = searched(logs, held_out, identifier, law, **own)
    return plain, widened_by_forms(search, plain, curve_of, fitted, lambda sentence: None)


def by_a_formula(limit, law):
    """The same of a limit."""
    return named_by(*driven(limit, 8, count=13), "voltage_saturation", law, inverse_limit=0.3)


@pytest.mark.slow
def test_beside_a_formula_of_another_form_the_parameters_errors_allow_for_it():
    plain, wider = by_a_formula(lambda u: u / (1.0 + np.abs(u / 3.0) ** 2.5) ** 0.4, "tanh")
    assert errors_off(plain) > 10.0 and errors_off(wider) < 2.0
    assert "hang on the form of voltage saturation (tanh)" in wider.notes[-1]
    assert hangs_on_forms(wider) == wider.notes[-1:] and hangs_on_forms(plain) == ()
    assert all(wider[name].value == plain[name].value for name in plain.parameters)
    place = wider.free_names.index("M")
    assert np.sqrt(wider.covariance[place, place]) == pytest.approx(wider["M"].std_error)


def test_beside_a_gradual_dead_zone_that_lingers_they_allow_for_it():
    """The law is the square root's, whose rest falls slower than an exponential."""
    logs, held_out = driven(lambda u: np.sign(u) * (np.sqrt(u**2 + 0.16) - 0.4), 8, count=7)
    plain, wider = named_by(logs, held_out, "actuator_dead_zone", "gradual", threshold=0.3)
    assert errors_off(plain) > 5.0 and errors_off(wider) < 2.0
    assert "hang on the form of actuator dead zone (gradual)" in wider.notes[-1]


def test_beside_a_formula_that_is_the_law_they_stay_right():
    plain, wider = by_a_formula(lambda u: 3.0 * np.tanh(u / 3.0), "tanh")
    assert errors_off(plain) < 3.0 and errors_off(wider) < 3.0
    assert all(wider[name].std_error < 0.01 * value for name, value in TRUE.items())


def resisted(resistance, seed=3, count=3, samples=400, fine=20, h=0.02):
    """Logs to fit and one held-out log of an axis of 1 kg under `resistance(v)`, by the classical Runge-Kutta method in fine
    steps, with white noise."""
    logs, d = [], h / fine
    for k in range(count):
        random = np.random.default_rng([seed, k])
        u = np.repeat(random.uniform(-8.0, 8.0, samples // 10), 10)
        v, speeds = 0.0, []
        for force in u:
            speeds.append(v)
            for _ in range(fine):
                r1 = force - resistance(v)
                r2 = force - resistance(v + 0.5 * d * r1)
                r3 = force - resistance(v + 0.5 * d * r2)
                v += d / 6.0 * (r1 + 2.0 * r2 + 2.0 * r3 + force - resistance(v + d * r3))
        outputs = {"v": np.array(speeds) + 0.02 * random.normal(size=samples)}
        logs.append(Log.from_arrays(f"run {k}", h * np.arange(samples), u[:, None], outputs, AXIS))
    return LogSet(logs[:-1]), LogSet(logs[-1:])


@pytest.mark.slow
def test_a_curve_takes_the_place_of_a_formula_whose_fit_is_doubted():
    """A drag that sets in at 0.6 m/s and is level from 1.2 m/s on, as no power of the speed is."""
    logs, held_out = resisted(
        lambda v: 2.0 * v + 1.5 * np.sign(v) * np.clip((np.abs(v) - 0.6) / 0.6, 0.0, 1.0), count=4
    )
    search, plain, curve_of, fitted = searched(logs, held_out, "quadratic_drag", "whole_speed", coefficient=0.3)
    found, final = by_a_curve_instead(search, plain, curve_of, fitted, lambda sentence: None)
    assert not plain.trustworthy and final.trustworthy
    assert [effect.law for effect in final.robot.effects] == ["shape"]
    assert found.final is not None and found.final.robot.parameters["M"].value == final["M"].value
    assert abs(final["M"].value - 1.0) < 3.0 * final["M"].std_error < 0.01


def with_a_law(resistance, identifier, law, **own):
    """The same of a law of the speed."""
    return named_by(*resisted(resistance), identifier, law, **own)


def test_viscous_friction_beside_drag_of_another_power_allows_for_it():
    plain, wider = with_a_law(
        lambda v: 2.0 * v + 1.0 * np.sign(v) * np.abs(v) ** 1.4, "quadratic_drag", "whole_speed",
        coefficient=0.5,
    )  # fmt: skip
    assert plain.judgement.verdict == "sound"
    off = abs(plain["Fv"].value - TRUE["Fv"])
    assert off > 4.0 * plain["Fv"].std_error and off < 2.0 * wider["Fv"].std_error
    assert "hang on the form of quadratic drag" in wider.notes[-1] and "another exponent" in wider.notes[-1]


def test_viscous_friction_beside_drag_that_is_quadratic_stays_as_sharp():
    plain, wider = with_a_law(lambda v: 2.0 * v + 0.5 * v * np.abs(v), "quadratic_drag", "whole_speed", coefficient=0.4)
    assert wider is plain and abs(plain["Fv"].value - TRUE["Fv"]) < 3.0 * plain["Fv"].std_error


def test_viscous_friction_that_a_power_law_bends_may_be_another_s():
    plain, wider = with_a_law(
        lambda v: 2.0 * v + 0.8 * np.sign(v) * np.sqrt(np.abs(v)), "sublinear_viscous_friction", "power",
        deficit=0.2,
    )  # fmt: skip
    off = abs(plain["Fv"].value - TRUE["Fv"])
    assert off > 4.0 * plain["Fv"].std_error and off < 2.0 * wider["Fv"].std_error
    assert wider["M"].std_error < 1.5 * plain["M"].std_error


def test_a_power_law_that_is_the_law_stays_as_sharp():
    plain, wider = with_a_law(
        lambda v: 2.0 * np.sign(v) * np.sqrt(np.abs(v)), "sublinear_viscous_friction", "power",
        deficit=0.4,
    )  # fmt: skip
    assert wider is plain
    # By this law the coefficient is the friction over the speed at the reference.
    at = plain.robot.parameters["sublinear_viscous_friction.reference"].value
    assert abs(plain["Fv"].value - 2.0 / np.sqrt(at)) < 3.0 * plain["Fv"].std_error
