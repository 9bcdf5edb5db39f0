"""What sensors that are all late have in common is as well the command's."""

from types import SimpleNamespace

import pytest

from jaxid import Omni
from jaxid.effects import effect_by_id
from jaxid.explanation.certainty.in_common import common_delay, delays_in_common, without_a_name


def final_of(robot, delays):
    """A fit with these delays and standard errors."""
    parameters = {name: SimpleNamespace(value=value, std_error=error) for name, (value, error) in delays.items()}
    return SimpleNamespace(robot=robot, parameters=parameters)


@pytest.mark.parametrize(
    ("identifier", "law", "names", "other"),
    [
        ("sensor_delay", "per_channel", ("V", "Vn", "W"), "input delay"),
        ("input_delay", "per_input", ("u1", "u2", "u3", "u4"), "sensor delay"),
    ],
)
def test_the_least_of_the_delays_is_as_well_the_other_mechanisms(identifier, law, names, other):
    robot = Omni() + effect_by_id(Omni(), identifier, law)
    times = [(0.045, 1e-4), *[(0.040, 1e-4)] * (len(names) - 1)]
    delays = {f"{identifier}.delay_{name}": time for name, time in zip(names, times, strict=True)}
    final = final_of(robot, delays)
    assert common_delay(robot.effects[-1], final) == (0.040, other.replace(" ", "_"))
    assert f"40 ms that all have in common may as well be {other}" in delays_in_common(final)
    # Where one of them is not late, or may not be, nothing is in common; nor where the model has the other, too.
    one = final_of(robot, delays | {f"{identifier}.delay_{names[0]}": (1e-4, 1e-4)})
    assert common_delay(robot.effects[-1], one) is None and delays_in_common(one) == ""
    both = robot + effect_by_id(robot, other.replace(" ", "_"), "constant")
    assert common_delay(robot.effects[-1], final_of(both, delays)) is None
    plain = Omni() + effect_by_id(Omni(), identifier, "constant")
    assert delays_in_common(final_of(plain, {f"{identifier}.delay": (0.04, 1e-4)})) == ""


@pytest.mark.parametrize("law", ["hard", "shape"])
def test_a_limit_of_traction_may_as_well_be_one_of_the_motors_current(law):
    (said,) = without_a_name(final_of(Omni() + effect_by_id(Omni(), "traction_limit", law), {}))
    assert said.startswith("What is called traction limit here may as well be a limit of the motors' current")
    assert without_a_name(final_of(Omni() + effect_by_id(Omni(), "motor_lag"), {})) == ()
