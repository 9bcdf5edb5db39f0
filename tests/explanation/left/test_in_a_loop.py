"""Coloured noise of which a controller makes commands is noise, and hides no drag."""

import pytest

from jaxid import Axis, explain, output_error
from jaxid.effects.actuator.input_delay import InputDelay
from jaxid.effects.body.drag import QuadraticDrag
from jaxid.effects.sensor.delay import SensorDelay
from jaxid.effects.sensor.lag import CentredAverage
from tests.closed_loop_runs import driven

START = Axis().with_values(M=1.0, Fv=1.5, Fc=0.5, offset=0.0)


def test_nothing_is_missing_for_noise_that_is_fed_back():
    logs, held_out = driven(1), driven(2, logs=2)
    effects = [QuadraticDrag(), InputDelay(), SensorDelay(), CentredAverage()]
    found = explain(output_error(START, logs), logs, held_out, effects=effects)
    assert found.verdict == "adequate" and found.colour is not None and not found.colour.fed_back
    assert "the noise of v (AR(1)" in found.sentence


@pytest.mark.slow
def test_what_is_missing_beside_it_is_named():
    logs, held_out = driven(3, drag=0.8, size=0.04), driven(4, logs=2, drag=0.8, size=0.04)
    found = explain(output_error(START, logs), logs, held_out, effects=[QuadraticDrag()])
    assert found.verdict in ("named", "ambiguous") and [effect.id for effect in found.effects] == ["quadratic_drag"]
    size = found.final["quadratic_drag.coefficient"]
    assert abs(size.value - 0.8) < 3.0 * size.std_error
