"""jaxid/explanation/next_experiment.py: proposals that would tell two models apart, and none that a refit makes up for."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet
from jaxid.effects.actuator.dead_zone import DeadZone
from jaxid.effects.body.drag import QuadraticDrag
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.next_experiment import propose
from jaxid.explanation.refits.refit import Trial
from tests.explanation.closed_form_axis import NOISE

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0)


def _pushed(seed: int) -> Log:
    """A kilogram with 2 N s/m that is pushed once, with 4 N for 0.04 s, and rolls out."""
    time, decay = 0.02 * np.arange(400), np.exp(-0.04)
    u, v = np.where((time > 0.99) & (time < 1.03), 4.0, 0.0), [0.0]
    for force in u[:-1]:
        v.append(0.5 * force + (v[-1] - 0.5 * force) * decay)
    noise = NOISE * np.random.default_rng(seed).normal(size=len(time))
    return Log.from_arrays(f"push {seed}", time, u[:, None], {"v": np.array(v) + noise}, AXIS)


def _trial(robot: Axis, identifier: str, logs: LogSet) -> Trial:
    state = held_out_state(robot, logs, {"v": NOISE})
    free = len(robot.parameters.free_names)
    return Trial(identifier, robot, state.squares, free, state, lambda: state, {})


def _dead_zone() -> Axis:
    """It makes of the short push what a heavier axis makes of it."""
    robot = ROBOT + DeadZone()
    threshold = {n: 0.4 for n in robot.parameters.free_names if n not in ROBOT.parameters}
    return robot.with_values(**threshold, M=0.9, Fv=1.8)


def _drag() -> Axis:
    return (ROBOT + QuadraticDrag()).with_values(**{"quadratic_drag.coefficient": 3.0})


@pytest.mark.parametrize(
    ("one", "other", "told", "only_if"),
    [
        pytest.param(ROBOT, ROBOT.with_values(Fv=2.02), False, "", id="a friction that is a little larger"),
        pytest.param(ROBOT, _dead_zone(), True, "other", id="a dead zone, or none"),
        pytest.param(_drag(), _dead_zone(), True, "", id="a dead zone, or drag"),
    ],
)
def test_what_a_refit_makes_up_for_is_no_experiment(one, other, told, only_if):
    """All predict the short push, and differ by several times the noise where the axis is driven on. A little more friction,
    which the push hardly shows, a fit to that drive would show at once; none is a dead zone of nothing, but not the reverse."""
    logs = LogSet([_pushed(1), _pushed(2)])
    found = propose(_trial(one, "one", logs), _trial(other, "other", logs), logs)
    assert (found is not None) == told
    if found is not None:
        assert found.only_if == only_if and found.separation > 0.5 and np.max(np.abs(found.inputs)) <= 4.0
        assert "after a refit" in found.sentence and ("if it is other" in found.sentence) == bool(only_if)


def test_of_logs_without_a_command_there_is_no_experiment():
    """Nothing says how large an input may be; the explanation of such a log had ended with a traceback."""
    logs = LogSet([replace(_pushed(1), inputs=np.zeros((400, 1)))])
    assert propose(_trial(ROBOT, "one", logs), _trial(_drag(), "other", logs), logs) is None
