"""When `explain` gives no name: hopeless fits, robots without velocities, heavy tails, and files that stay finite."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from jaxid import Axis, Custom, Log, LogError, LogSet, Parameter, compare, explain, output_error
from jaxid.effects.catalogue import effect_by_id
from jaxid.estimate.result import Estimate
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.named_effect import Evidence, NamedEffect, differs_from_nothing
from jaxid.explanation.policy import Policy
from jaxid.explanation.refits.refit import Trial
from jaxid.explanation.search.needed import _between_samples
from jaxid.explanation.search.steps import Search, Step
from jaxid.explanation.verdict import doubts_of, verdict_of
from jaxid.logs import Channels
from jaxid.report.files import fit_document

SAMPLES = 500
ROBOT = Axis().change("offset", free=False).with_values(M=1.0, Fv=2.0, Fc=0.5)


def inputs(seed):
    return np.repeat(np.random.default_rng(seed).uniform(-5, 5, SAMPLES // 20), 20)


def heavy(axis_log, name, seed):
    """An axis whose sensor has Student's t noise with three degrees of freedom."""
    clean = axis_log(name, inputs(seed), position=False, M=1.0, Fv=2.0, Fc=0.5)
    noise = 0.01 * np.random.default_rng(seed).standard_t(3, size=SAMPLES)
    return Log.from_arrays(name, clean.time, clean.inputs, clean.output("v") + noise, "axis")


@pytest.fixture(scope="module")
def heavy_tailed(axis_log):
    logs, held_out = LogSet([heavy(axis_log, "a", 1)]), LogSet([heavy(axis_log, "b", 2)])
    fit = output_error(ROBOT, logs)
    return explain(fit, logs, held_out, most=1), fit, logs, held_out


def test_heavy_tails_of_a_sensor_are_no_missing_effect_and_files_are_json(heavy_tailed, tmp_path):
    found, *_ = heavy_tailed
    assert found.verdict == "adequate"
    found.save(tmp_path)
    json.loads((tmp_path / "explanation.json").read_text(), parse_constant=pytest.fail)


def test_fit_and_explanation_measure_with_one_yardstick(heavy_tailed):
    found, fit, _, held_out = heavy_tailed
    document = fit_document([fit], compare(fit, held_out=held_out).predicted)
    of_fit = document["methods"]["output_error"]["check"]["normalised_rms"]
    assert found.to_dict()["gap"]["before"] == pytest.approx(of_fit, rel=1e-12)


def test_what_is_said_beside_a_fit_stands_in_its_file(heavy_tailed):
    """But for the judgement's sentence, which stands there by itself; no key where nothing is said."""
    _, fit, *_ = heavy_tailed
    doubted = replace(fit, notes=(fit.judgement.sentence, "a.csv is in milliseconds."))
    assert fit_document([doubted])["methods"]["output_error"]["notes"] == ["a.csv is in milliseconds."]
    quiet = replace(fit, notes=(fit.judgement.sentence,))
    assert "notes" not in fit_document([quiet])["methods"]["output_error"]


def test_logs_of_one_name_are_refused_before_anything_is_done(heavy_tailed):
    _, fit, logs, _ = heavy_tailed
    said = []
    with pytest.raises(LogError, match="both called 'a'"):
        explain(fit, logs, logs, report=said.append)
    again = LogSet([replace(logs[0], name="copy")])
    with pytest.raises(LogError, match="'a' and the held-out log 'copy' hold the same numbers"):
        explain(fit, logs, again, report=said.append)
    assert said == []


def test_a_fit_that_failed_by_a_dead_sensor_is_told_so_where_held_out_logs_show_nothing(axis_log):
    """The model follows the position; of one fitted log the speed's sensor is dead, but for its noise."""
    logs = [axis_log(name, inputs(k), noise=0.01, seed=k, M=1.0, Fv=2.0, Fc=0.5) for k, name in enumerate("abcd")]
    noise = 0.01 * np.random.default_rng(8).normal(size=len(logs[0]))
    dead = Log.from_arrays("dead", logs[0].time, logs[0].inputs, {"v": noise, "q": logs[0].output("q")}, "axis")
    fitted = LogSet([dead, *logs[1:3]])
    fit = output_error(ROBOT, fitted)
    assert fit.failed
    found = explain(fit, fitted, LogSet(logs[3:]), most=1)
    assert found.verdict == "unexplained" and found.to_dict()["verdict"] == "unexplained"
    assert found.sentence.startswith("The fit that was to be explained failed, so that none of its parameters is known")
    assert any("looks dead" in note for note in found.notes)


# -- gates on made-up findings -------------------------------------------------------------------------------------
def state(rms):
    return HeldOut(rms, {"v": rms}, (np.full((100, 1), rms),), {"v": 0.01}, 1e-9)


def named(sure=True):
    evidence = Evidence(0.0, 0.0, 0.0, 0.0, 1, 1, None, None)
    return NamedEffect("quadratic_drag", "body", "", {}, (), evidence, sure)


def verdict(fit, before, after, *effects, between=()):
    """Of a gap `before` that the effects close to `after`, in one step or by way of what they left `between`."""
    path = [
        Trial("", fit.robot, 0.0, 1, state(rms), lambda rms=rms: state(rms), {}) for rms in (before, *between, after)
    ]
    steps = tuple(Step((with_it,), (), (), without, with_it) for without, with_it in pairwise(path))
    found = Search(state(before), state(after), None, steps, ())
    doubts = doubts_of(found, fit, effects, found.after)
    return verdict_of(found, effects, 3, doubts), doubts


def test_a_name_that_leaves_many_times_the_noise_is_not_given(heavy_tailed):
    _, fit, *_ = heavy_tailed
    found, doubts = verdict(fit, 260_000.0, 1024.0, named())  # closes 99.6 % of the gap
    assert found == "unexplained" and "1.02e+03 times the noise" in doubts[0]
    assert verdict(fit, 10.0, 1.01, named())[0] == "named"
    assert verdict(fit, 1000.0, Policy().many + 0.1, named())[0] == "unexplained"


def test_a_name_that_explains_less_than_half_of_a_small_gap_is_not_given(heavy_tailed):
    """What a soft contact left of a robot in another engine, 1.035 times the noise, was called a drag that left 1.029."""
    _, fit, *_ = heavy_tailed
    assert verdict(fit, 1.035, 1.029, named())[0] == "unexplained"
    assert verdict(fit, 1.06, 1.029, named())[0] == "named"


def test_three_names_leave_no_more_than_what_an_imprecise_effect_may(heavy_tailed):
    """As many as may be added: beyond what their own imprecision explains, they would stand in for something else."""
    _, fit, *_ = heavy_tailed
    policy = Policy()
    three = (named(), replace(named(), id="effective_track"), replace(named(), id="sensor_bias"))
    assert verdict(fit, 10.0, policy.small - 0.005, *three)[0] == "named"
    assert verdict(fit, 1.5, policy.small + 0.015, *three) == ("unexplained", ())
    assert verdict(fit, 10.0, policy.small + 0.015, *three)[0] == "named"  # half a percent of the gap
    assert verdict(fit, 10.0, policy.small + 0.01, *three[:2])[0] == "named"


def test_two_names_that_leave_more_than_an_imprecise_law_are_not_given(heavy_tailed):
    _, fit, *_ = heavy_tailed
    policy, other = Policy(), replace(named(), id="effective_track")
    assert verdict(fit, 10.0, policy.coarse_law - 0.01, named(), other)[0] == "named"
    found, doubts = verdict(fit, 10.0, policy.coarse_law + 0.01, named(), other)
    assert found == "unexplained" and "one may stand for what another's law lacks" in doubts[0]
    # Each closes what it finds but for an imprecise law's share, or makes up for a part of what the other leaves.
    assert verdict(fit, 11.0, 1.4, named(), other, between=(9.0,))[0] == "named"
    assert verdict(fit, 4.1, 1.57, named(), other, between=(2.16,))[0] == "unexplained"
    of_a_curve = replace(other, law="shape")  # through few points, which follow a law less closely
    assert verdict(fit, 10.0, policy.coarse_law + 0.01, named(), of_a_curve)[0] == "named"
    assert verdict(fit, 10.0, policy.coarse_curve + 0.01, named(), of_a_curve)[0] == "unexplained"
    # What the fit with them says itself: it does not follow its own logs.
    poor = replace(fit, judgement=replace(fit.judgement, verdict="poor"))
    assert verdict(poor, 10.0, policy.coarse_curve - 0.01, named(), of_a_curve)[0] == "unexplained"
    assert verdict(poor, 10.0, policy.coarse_law - 0.01, named(), of_a_curve)[0] == "named"
    assert verdict(fit, 10.0, policy.coarse_curve + 0.01, named())[0] == "named"  # one alone is what explains most


def test_a_name_that_may_be_nothing_is_not_given(heavy_tailed):
    _, fit, *_ = heavy_tailed
    found, doubts = verdict(fit, 10.0, 1.01, named(sure=False))
    assert found == "unexplained" and "errors of quadratic drag do not exclude that there is none" in doubts[0]


def test_of_several_names_that_explain_all_alike_one_is_there_though_the_size_of_each_may_be_nothing(heavy_tailed):
    """What excess near standstill, viscous and drag make of slow noise: a level of dry friction takes any of them up."""
    _, fit, *_ = heavy_tailed
    either = replace(named(sure=False), equivalent_to=("sublinear_viscous_friction",))
    assert verdict(fit, 4.1, 1.0, either)[0] == "ambiguous"
    assert verdict(fit, 4.1, 1.5, either)[0] == "unexplained"


def test_two_names_beside_which_nothing_is_known_are_none_unless_it_is_all_but_for_one_factor(heavy_tailed):
    _, fit, *_ = heavy_tailed
    two = (named(), replace(named(), id="effective_track"))

    def nothing_known(model):
        found = {n: Estimate.of(p.value, 1.0, p.unit, "not_identifiable") for n, p in model.parameters.items()}
        return replace(fit, robot=model, parameters=found, free_names=model.parameters.free_names)

    drag = nothing_known(ROBOT + effect_by_id(ROBOT, "quadratic_drag"))
    found, doubts = verdict(drag, 10.0, 1.01, *two)
    assert found == "unexplained" and "stand in for one another" in doubts[0]
    # What a limit's curve takes from the smallest commands is a gain of all.
    limit = nothing_known(ROBOT + effect_by_id(ROBOT, "voltage_saturation", "shape"))
    assert verdict(limit, 10.0, 1.01, *two)[0] == "named"


def told(fit, identifier, estimates, correlation=0.0):
    """Whether these estimates of an effect's parameters, by their short names, say that it is there."""
    effect = effect_by_id(ROBOT, identifier)
    own = {effect.key(name): estimate for name, estimate in estimates.items()}
    errors = np.array([e.std_error if np.isfinite(e.std_error) else np.nan for e in own.values()])
    covariance = np.outer(errors, errors) * (correlation + (1 - correlation) * np.eye(len(errors)))
    final = replace(fit, robot=ROBOT + effect, parameters=own, free_names=tuple(own), covariance=covariance)
    return differs_from_nothing(effect, fit, final)


INFINITE = float("inf")
FROM_ONE_SIDE = Estimate(0.3, INFINITE, (0.2, INFINITE), "N", "not_identifiable")


@pytest.mark.parametrize(
    ("estimate", "there"),
    [
        (Estimate.of(1.0, 0.1, "N", "identified"), True),
        (Estimate.of(0.1, 0.1, "N", "identified"), False),
        (Estimate.of(1.0, 0.1, "N", "not_identifiable"), False),
        (Estimate.of(0.0, 0.1, "N", "at_bound"), False),
        (FROM_ONE_SIDE, True),
        (replace(FROM_ONE_SIDE, ci95=(0.0, INFINITE)), False),
        (replace(FROM_ONE_SIDE, ci95=(-INFINITE, INFINITE)), False),
    ],
)
def test_an_effect_is_there_if_its_strength_is_not_zero_by_its_errors(heavy_tailed, estimate, there):
    _, fit, *_ = heavy_tailed
    assert told(fit, "quadratic_drag", {"coefficient": estimate}) is there
    # The speed says where friction rises; known or not, it does not say that it rises.
    for speed in (Estimate.of(0.1, 0.01, "m/s", "identified"), replace(FROM_ONE_SIDE, unit="m/s")):
        assert told(fit, "stribeck_friction", {"amplitude": estimate, "speed": speed}) is there


def test_strengths_that_hang_together_tell_together(heavy_tailed):
    _, fit, *_ = heavy_tailed
    vague = Estimate.of(1.0, 1.0, "N", "identified")
    other = replace(vague, value=-1.0)
    periods = Estimate.of(14.0, 0.3, "1/m", "identified")
    ripple = {"sine_q": vague, "cosine_q": other, "periods": periods}
    assert not told(fit, "cogging_torque", ripple)
    assert told(fit, "cogging_torque", ripple, correlation=0.95)  # their difference is known to a fifth


def test_a_model_that_does_not_follow_its_own_logs_names_nothing(heavy_tailed):
    _, fit, *_ = heavy_tailed
    failed = replace(fit, judgement=replace(fit.judgement, verdict="failed", sentences=("It is far off.",)))
    found, doubts = verdict(failed, 10.0, 1.01, named())
    assert found == "unexplained" and "It is far off" in doubts[0]


# -- a robot whose outputs are no states ---------------------------------------------------------------------------
@pytest.mark.slow
def test_a_robot_without_velocities_is_told_so_first_and_explained_without_a_place():
    def decay(state, given, p):
        return {"level": given["u"] - p["rate"] * state["level"]}

    def output(state, given, p):
        return {"volts": 2.0 * state["level"]}

    tank = Custom(
        dynamics=decay, output=output, state_names=("level",), own_channels=Channels(("u",), ("volts",)),
        table={"rate": Parameter(1.0, "1/s", free=True, lower=0.0)}, title="tank",
    )  # fmt: skip

    def measured(name, seed, leak=0.6):
        # In closed form between samples: the tank leaks in proportion to its level, less above one half of it.
        u, level, values = np.abs(inputs(seed)) / 5, 0.0, []
        for k in range(SAMPLES):
            values.append(2.0 * level)
            for _ in range(20):
                level += 0.001 * (u[k] - level - leak * level**2)
        noise = 0.002 * np.random.default_rng(seed).normal(size=SAMPLES)
        return Log.from_arrays(name, 0.02 * np.arange(SAMPLES), u[:, None], (np.array(values) + noise)[:, None], tank)

    logs, held_out, said = LogSet([measured("a", 1)]), LogSet([measured("b", 2)]), []
    fit = output_error(tank, logs)
    assert fit.judgement.verdict == "poor"
    found = explain(fit, logs, held_out, most=1, report=said.append)
    assert (
        "velocities" in said[0]
        and found.localisation is None
        and found.verdict in ("named", "ambiguous", "unexplained")
    )
    assert "velocities" in found.notes[0] and "velocities" in repr(found)
    assert found.after.normalised_rms < Policy().many or found.verdict == "unexplained"


def test_an_error_below_the_noise_that_is_not_white_is_not_said_to_be(heavy_tailed):
    """Speeds from differences of counts have noise that third differences overrate: 0.85 times it is no proof of white."""
    found, *_ = heavy_tailed
    assert "no structure left" in found.sentence and "beyond doubt" not in found.sentence
    coloured = replace(found, before=replace(found.before, p_white=1e-9))
    assert "no structure left" not in coloured.sentence and "not white" in coloured.sentence
    # A glitch of a few samples is no gap without a name.
    wild = tuple(np.where(np.arange(len(r))[:, None] == 40, 200.0, r) for r in found.before.residuals)
    glitch = replace(found.before, residuals=wild, normalised_rms=12.0)
    assert "A few samples make it" in replace(found, verdict="unexplained", after=glitch).sentence
    assert "A few samples" not in replace(found, verdict="unexplained").sentence
    # What the fitted logs hold against the fit is not withdrawn by quiet held-out ones.
    doubted = found.baseline.judgement.doubted("What is left holds the mark of a delay.")
    poor = replace(found, baseline=replace(found.baseline, judgement=doubted))
    assert not poor.sentence.startswith("Nothing is missing:") and "mark of a delay" in poor.sentence
    # Who has asked `explain` is told what to record, and not to ask `explain`.
    assert "`explain`" in doubted.sentence and "`explain`" not in poor.sentence and "hold out more" in poor.sentence


def test_an_edge_that_no_sample_lies_at_is_there_by_what_it_explains():
    """Between two levels of a command it has no slope and no error; without it the model is far less likely."""
    edge, smooth = (effect_by_id(ROBOT, "actuator_dead_zone", law) for law in ("threshold", "subtractive"))
    flat = Estimate(1.2, INFINITE, (-INFINITE, INFINITE), "V", "not_identifiable")
    noise = np.random.default_rng(0).normal(size=(2000, 1))

    def trial(size, free):
        left = HeldOut(size, {"v": size}, (size * noise,), {"v": 0.01}, 1e-9)
        return Trial("actuator_dead_zone", ROBOT, float(np.sum((size * noise) ** 2)), free, left, lambda: left, {})

    def there(effect, estimate, after):
        step = Step((after,), (), (), trial(2.0, 4), after)
        return _between_samples(effect, {"own": estimate}, step)

    assert there(edge, flat, trial(1.0, 5))
    late = effect_by_id(ROBOT, "input_delay")  # of a command that is held, seen at once: anywhere between two samples
    assert there(late, flat, trial(1.0, 5)) and not there(late, flat, trial(2.0, 5))
    assert not there(edge, flat, trial(2.0, 5))  # explains nothing
    assert not there(smooth, flat, trial(1.0, 5))  # has a slope, or is not determined
    assert not there(edge, Estimate.of(0.1, 0.1, "V", "identified"), trial(1.0, 5))
