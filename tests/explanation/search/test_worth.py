"""jaxid/explanation/search/worth.py: what is worth a name, on an axis in closed form."""

from dataclasses import replace

import numpy as np

from jaxid import Axis, Log, LogSet
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.refits.refit import Trial, refit
from jaxid.explanation.search.worth import holds_as_well, undone, worth_in_colour
from jaxid.simulation.scaled import scaled_to
from tests.explanation import closed_form_axis
from tests.explanation.closed_form_axis import driven

NOISE = {"v": closed_form_axis.NOISE}


def biased(logs, bias):
    return LogSet(Log.from_arrays(o.name, o.time, o.inputs, {"v": o.output("v") + bias}, o.channels) for o in logs)


def trials(effect, known, bias=0.0, **values):
    """The axis refitted without and with an effect at some size of its own, the parameters `known` held."""
    logs, held_out = (biased(some, bias) for some in driven(lambda u: u, 2))
    plain = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0), logs)
    for name in ("Fc", "offset", *known):
        plain = plain.change(name, free=False)
    found = []
    for robot in (plain, plain + effect_by_id(plain, effect)):
        start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
        start |= {name: value for name, value in values.items() if name in start}
        found.append(refit(robot, [start], logs, held_out, NOISE, {}))
    return *found, held_out


def test_another_unit_of_all_that_is_measured_is_undone_by_mass_and_friction():
    before, after, held_out = trials("sensor_scale", (), **{"sensor_scale.error_v": 0.8, "M": 1.8, "Fv": 3.6})
    assert abs(after.robot.parameters["sensor_scale.error_v"].value) > 0.1
    assert undone(after, before, held_out, NOISE)


def test_a_bias_that_explains_what_it_does_is_not():
    before, after, held_out = trials("sensor_bias", (), 0.005, **{"sensor_bias.bias_v": 0.001})
    assert not undone(after, before, held_out, NOISE)


def test_nor_is_an_effect_that_is_none_of_a_sensor():
    before, after, held_out = trials("quadratic_drag", (), **{"quadratic_drag.coefficient": 0.5, "Fv": 1.0})
    assert not undone(after, before, held_out, NOISE)


def test_what_predicts_other_logs_clearly_worse_does_not_hold_as_well():
    before, after, _ = trials("quadratic_drag", (), **{"quadratic_drag.coefficient": 0.5, "Fv": 1.0})
    error = after.held_out.normalised_rms
    assert holds_as_well(after, after) and holds_as_well(before, after) == (
        before.held_out.normalised_rms < 1.1 * error
    )
    for times, holds in ((1.05, True), (1.2, False)):
        other = after.leaving(replace(after.held_out, normalised_rms=times * error))
        assert holds_as_well(other, after) is holds
    away = after.leaving(replace(after.held_out, normalised_rms=float("nan"), diverged=("b",)))
    assert holds_as_well(after, away) and not holds_as_well(away, after) and not holds_as_well(away, away)


def whitened(fitted, held_out, free):
    """A trial that leaves these residuals [T]."""

    def state(residual):
        return HeldOut(float(np.sqrt(np.mean(residual**2))), {"v": 1.0}, (residual[:, None],), {"v": 1.0}, 0.0)

    return Trial("", Axis(), float(np.sum(fitted**2)), free, state(fitted), lambda: state(held_out), {})


def test_what_is_no_chance_on_the_fitted_logs_the_held_out_ones_need_only_bear_out():
    """An effect whose size on 4,000 fitted samples is 10 standard deviations, and 2 on the held-out ones."""
    rng = np.random.default_rng(3)
    noise, other, wave = rng.normal(size=4000), rng.normal(size=1000), np.sin(np.arange(4000) / 40)
    wave /= np.linalg.norm(wave)
    new = np.sin(np.arange(1000) / 40)
    new /= np.linalg.norm(new)
    noise, other = noise - (noise @ wave) * wave, other - (other @ new) * new
    after = whitened(noise, other, 4)

    def worth(fitted, held_out):
        return worth_in_colour(whitened(noise + fitted * wave, other + held_out * new, 3), after, tried=60)

    assert worth(10.0, 2.0) and not worth(10.0, 0.0)  # where they ask for it at all
    assert worth(6.0, 3.0) and not worth(6.0, 2.0)  # what might be chance must show on both
    assert not worth(3.0, 3.0)
