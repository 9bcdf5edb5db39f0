"""jaxid/kernel/identity.py: two models have one name only where they compile alike."""

from dataclasses import dataclass

import pytest

import jaxid
from jaxid.effects import effect_by_id
from jaxid.kernel import identity
from jaxid.kernel.identity import identity_of
from jaxid.robots.pioneer import Pioneer
from jaxid.simulation.friction import Sticking
from jaxid.simulation.rollout import step


def named(robot, *more):
    return identity_of(robot.structure, *more)


def test_numbers_are_not_part_of_a_model_and_everything_else_is():
    robot = jaxid.Pioneer()
    one = named(robot, ("Cs",), step, Sticking(2))
    assert one and one == named(robot.with_values(M=99.0), ("Cs",), step, Sticking(2))
    others = [
        named(robot, ("Cv",), step, Sticking(2)),
        named(robot, ("Cs",), step, Sticking(3)),
        named(jaxid.Omni(), ("Cs",), step, Sticking(2)),
        *(
            named(robot + effect_by_id(robot, "stribeck_friction", law), ("Cs",), step, Sticking(2))
            for law in ("gaussian", "lorentzian")
        ),
    ]
    assert None not in others and len({one, *others}) == len(others) + 1


def test_text_and_numbers_are_told_apart():
    alike = [("1",), (1,), (1.0,), (True,), ("a", "b"), ("a,b",), (("a",), "b"), (("a", "b"),), ([1],), (None,)]
    assert len({identity_of(*each) for each in alike}) == len(alike)


class _Heavier(Pioneer):
    """Somebody's robot."""


@dataclass(frozen=True)
class _Law:
    """Somebody's friction."""


def test_what_somebody_else_wrote_has_no_name():
    robot = jaxid.Pioneer()
    assert named(_Heavier()) is None
    assert named(robot, _Law()) is None
    assert named(robot, lambda x: x) is None


def test_a_class_into_which_somebody_has_put_a_function_has_no_name(monkeypatch):
    assert named(jaxid.Pioneer())
    monkeypatch.setattr(Pioneer, "rubbing", lambda self, state, p: ())
    assert named(jaxid.Pioneer()) is None


def test_other_source_makes_other_names(monkeypatch):
    before = named(jaxid.Pioneer())
    monkeypatch.setattr(identity, "_source", lambda: "other")
    assert named(jaxid.Pioneer()) != before


@pytest.mark.parametrize("robot", [jaxid.Pioneer(), jaxid.Omni(), jaxid.Axis(), jaxid.DifferentialDrive()])
def test_shipped_robots_have_a_name_with_every_effect(robot):
    for effect in jaxid.catalogue(robot):
        try:
            model = robot + effect
        except jaxid.EffectError:
            continue
        assert named(model), effect.title
