"""Two and three changes at once, on logs of a differential drive whose wheels stick."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxid import Axis, DifferentialDrive, explain_change, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.changes.trials import with_a_number_more
from tests.two_sides import HALF_TRACK, driven


def compared(back_emf=0.0, **changed):
    """What changed, by a model in which so much of the viscous friction (in N s/m) is the motors' back-EMF."""
    robot = DifferentialDrive().with_values(b=HALF_TRACK, back_emf=back_emf)
    before, after = driven(0), driven(1, **changed)
    return explain_change(output_error(robot, before), output_error(robot, after), before, after)


@pytest.mark.slow
def test_a_load_and_a_tired_battery_are_named_and_no_effects_that_vanished():
    found = compared(M=11.4, J=0.25, gain=0.9)
    assert found.verdict == "named" and found.change is not None
    assert {part.id for part in found.change.parts} == {"payload", "command_gain"}
    for name, true in (("M", 2.0), ("J", 0.04), ("command_gain.gain", -0.1)):
        size = found.change.differences[name].size
        assert abs(size.value - true) < 4.0 * size.std_error, (name, size)


@pytest.mark.slow
def test_a_load_in_proportion_and_a_tired_battery_come_before_a_weaker_motor_on_another_floor():
    """All forces over 1.2 are all masses times 1.2: the same motion, to the last digit."""
    found = compared(back_emf=5.0, M=1.2 * 9.4, J=1.2 * 0.21, gain=0.92)
    assert found.verdict == "ambiguous" and found.change is not None
    assert {part.id for part in found.change.parts} == {"payload", "command_gain"}
    for name, true in (("M", 1.88), ("J", 0.042), ("command_gain.gain", -0.08)):
        size = found.change.differences[name].size
        assert abs(size.value - true) < 3.0 * size.std_error, (name, size)
    assert any({part.id for part in own.parts} == {"gain", "friction"} for own in found.equivalent)


@pytest.mark.slow
def test_sensors_that_would_all_have_another_scale_are_no_answer_for_three_changes():
    found = compared(M=11.4, J=0.25, gain=0.88, gyro=1.05)
    named = [own for own in (found.change, *found.equivalent) if own is not None]
    if any("sensor_scale" in own.id for own in named):
        assert found.verdict == "unexplained" and "all have another scale at once" in found.sentence


def test_one_sensor_s_scale_may_have_changed_and_hardly_that_of_all():
    robot = DifferentialDrive()
    scale = effect_by_id(robot, "sensor_scale")
    one = (robot + scale).with_values(**{scale.key("error_w"): 0.05})
    assert scale.doubt_of_change(one) == ""
    assert "v and w would all" in scale.doubt_of_change(one.with_values(**{scale.key("error_v"): -0.2}))
    axis = Axis()
    alone = effect_by_id(axis, "sensor_scale")
    errors = {name: 0.05 for name in alone.parameters(axis)}
    assert bool(alone.doubt_of_change((axis + alone).with_values(**errors))) is (len(errors) > 1)


def test_what_says_the_same_with_a_number_more_is_not_lost():
    def trial(ids, numbers, residual):
        parts = [SimpleNamespace(id=name) for name in ids]
        candidate = SimpleNamespace(parts=parts, title=" and ".join(ids))
        joint = SimpleNamespace(delta=np.zeros(numbers))
        return SimpleNamespace(score=SimpleNamespace(candidate=candidate), joint=joint, compared=[residual])

    r = np.random.default_rng(0).normal(size=(500, 1))
    best = trial(("friction", "radius"), 3, r)
    others = [
        trial(("friction", "gains"), 4, r + 1e-3),
        trial(("friction", "slope"), 4, r + 0.5),
        trial(("friction", "curve"), 6, r),
        trial(("friction", "radius"), 4, r),
    ]
    assert [own.score.candidate.title for own in with_a_number_more(best, others)] == ["friction and gains"]
