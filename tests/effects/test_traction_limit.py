"""jaxid/effects/ground/traction_limit.py: a curve of what is lost of a drive force, and when it is rather a command's."""

import numpy as np
import pytest

from jaxid import Axis
from jaxid.effects import effect_by_id


@pytest.mark.parametrize(
    ("lost", "agrees"),
    [
        (lambda force: np.maximum(force - 0.5, 0.0), True),  # a limit
        (lambda force: force**2, True),
        (lambda force: np.minimum(force, 0.15), False),  # a dead zone: lost of small forces, level beyond
        (lambda force: np.minimum(force, 0.15) - 0.5 * force, False),  # the same beside a larger gain
    ],
)
def test_what_small_forces_lose_is_rather_lost_of_the_command(lost, agrees):
    curve = effect_by_id(Axis(), "traction_limit", "shape")
    heights = {curve.height(place): float(lost(curve.places[place])) for place in curve.varying}
    robot = Axis() + curve
    model = robot.with_values(**heights)
    assert curve.agrees(model) == agrees and curve.rather == "actuator_dead_zone"
