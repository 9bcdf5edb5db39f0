"""An effect that was added first looked for again beside the later one, on an axis in closed form."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.refit import refit
from jaxid.explanation.search.from_the_back import named_from_the_back, not_present
from jaxid.explanation.search.steps import Step
from jaxid.logs import noise_scale
from jaxid.logs.windows import in_windows
from jaxid.simulation.scaled import scaled_to

BIAS = 0.05


def driven(edge, count=3):
    """Speeds with white noise and a bias, of a mass whose held command passes a dead zone; no dry friction."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([9, k])
        u = np.repeat(rng.uniform(-4, 4, 40), 10)
        decay, v, found = np.exp(-0.04), 0.0, []
        for force in np.sign(u) * np.maximum(np.abs(u) - edge, 0.0):
            found.append(v)
            v = 0.5 * force + (v - 0.5 * force) * decay
        outputs = {"v": np.array(found) + BIAS + 0.003 * rng.normal(size=400)}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(400), u[:, None], outputs, AXIS))
    return LogSet(logs[:-1]), LogSet(logs[-1:])


def searched(first, law, edge=0.6, left_out=()):
    """Two steps of a search, to the effect `first` and then to a sensor's bias, and what comes of them from the back. Of the
    effects `left_out` there was a step before them, which the model lacks again."""
    logs, held_out = driven(edge)
    noise = noise_scale(held_out, otherwise=logs)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0), logs)
    fit = output_error(robot.change("Fc", free=False).change("offset", free=False), logs)

    def trial(model, before):
        start = {name: model.parameters[name].value for name in model.parameters.free_names}
        strengths = {n: p.typical for n, p in model.effects[-1].parameters(model).items()} if model.effects else {}
        return refit(model, [start | strengths], logs, held_out, noise, before)

    base = trial(fit.robot, fit.initial_states)
    one = trial(base.robot + effect_by_id(base.robot, first, law), base.initial_states)
    two = trial(one.robot + effect_by_id(one.robot, "sensor_bias"), one.initial_states)
    steps = [Step((t,), (), (), before, t, (t,)) for t, before in ((one, base), (two, one))]
    for name in left_out:
        once = trial(base.robot + effect_by_id(base.robot, name, "subtractive"), base.initial_states)
        steps.insert(0, Step((once,), (), (), base, once, (once,)))
    said = []
    revised, current = named_from_the_back(steps, two, base, (), logs, held_out, noise, said.append)
    return steps, two, revised, current, said


@pytest.mark.slow
def test_a_name_that_stood_in_for_another_is_exchanged_beside_the_later_one():
    # Added before and left out again, it is found anew: one step to it, not two.
    again = ("actuator_dead_zone",)
    steps, before, revised, current, said = searched("sublinear_viscous_friction", "power", left_out=again)
    assert before.held_out.normalised_rms > 2.0  # the friction is no dead zone
    assert [step.chosen.id for step in revised] == ["actuator_dead_zone", "sensor_bias"]
    assert revised[0].before.robot.effects[0].id == "sensor_bias"  # looked for beside what was added later
    assert current.held_out.adequate and current is revised[0].chosen
    own = current.robot.parameters
    (edge,) = [p.value for name, p in own.items() if name.startswith("actuator_dead_zone.")]
    assert abs(edge - 0.6) < 0.02 and abs(own["sensor_bias.bias_v"].value - BIAS) < 0.003
    assert any("instead of sublinear_viscous_friction" in sentence for sentence in said)


def test_nothing_is_looked_for_where_only_noise_is_left():
    steps, before, revised, current, said = searched("actuator_dead_zone", "subtractive")
    assert before.held_out.adequate and current is before and revised == steps and not said


def test_of_windows_no_law_counts_from_the_start_of_the_whole_logs(axis_log):
    """A drift that begins anew in every window is none, and follows whatever each of them leaves."""
    logs = LogSet([axis_log("a", np.repeat([3.0, -2.0], 100), 0.01, 1)])
    whole, cut = ({(e.id, e.law) for e in not_present(Axis(), (), own)} for own in (logs, in_windows(logs, 1.0)))
    assert {("sensor_bias", "drifting"), ("sensor_delay", "growing")} <= whole - cut
    assert cut < whole and {identifier for identifier, _ in cut} >= {"sensor_bias", "sensor_delay", "stribeck_friction"}
