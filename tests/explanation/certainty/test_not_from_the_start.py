"""jaxid/explanation/certainty/not_from_the_start.py: an axis in closed form behind a limit, of another mass than its table."""

import re

import numpy as np
import pytest

from jaxid import Axis, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.certainty.not_from_the_start import with_nothing_from_the_start
from jaxid.explanation.refits.refit import in_full, refit
from jaxid.logs import noise_scale
from jaxid.simulation.scaled import scaled_to
from tests.explanation.closed_form_axis import driven


def limited(u):
    """Nothing is lost of the smallest commands."""
    return u - 0.06 * np.sign(u) * np.maximum(np.abs(u) - 0.8, 0.0) ** 2


def answer(mass):
    """The fit by a curve of the limit with the mass held at so much, where it is 1 and the friction 2, and what hangs."""
    logs, held_out = driven(limited, 4, count=7)
    noise = noise_scale(held_out, otherwise=logs)
    robot = scaled_to(Axis().with_values(M=mass, Fv=2.0, Fc=0.0), logs).change("Fc", free=False).change("M", free=False)
    base = output_error(robot, logs)
    model = base.robot + effect_by_id(base.robot, "voltage_saturation", "shape")
    start = {name: model.parameters[name].value for name in model.parameters.free_names}
    trial = refit(model, [start], logs, held_out, noise, base.initial_states)
    fit = in_full(trial, logs, noise)
    return fit, with_nothing_from_the_start(fit, trial, logs, held_out, noise)


@pytest.mark.parametrize("mass", [1.03, 0.97])
def test_friction_allows_for_a_mass_that_the_curve_makes_up_for(mass):
    plain, found = answer(mass)
    assert abs(plain["Fv"].value - 2.0) > 5.0 * plain["Fv"].std_error
    assert abs(found.final["Fv"].value - 2.0) < 2.0 * found.final["Fv"].std_error < 0.2
    said = re.search(r"if M is another \((.*) %\), Fv", found.sentence)
    assert said and float(said[1]) == pytest.approx(100.0 * (1.0 / mass - 1.0), abs=0.7)


def test_nothing_hangs_on_the_table_where_it_is_right():
    plain, found = answer(1.0)
    assert not found.sentence and found.final is plain
    assert abs(plain["Fv"].value - 2.0) < 3.0 * plain["Fv"].std_error
