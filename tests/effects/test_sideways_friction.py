"""jaxid/effects/ground/sideways_friction.py: rollers stop a sideways motion, and hold until they are pushed harder."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.fingerprints.mecanum import MECANUM
from jaxid import DifferentialDrive, Log, LogSet, Omni, Pioneer, simulate
from jaxid.effects import effect_by_id
from jaxid.effects.ground.sideways_friction import SidewaysFriction
from jaxid.robots.traits import refusal

SIDEWAYS = np.array([-1.0, 1.0, 1.0, -1.0])


def _to_the_left(forces, **known):
    """Speeds (vx, vy, w) under such a force of each wheel to the left, 10 kg without friction of the wheels' own."""
    time = 0.02 * np.arange(len(forces))
    robot = replace(MECANUM, scales=replace(MECANUM.scales, outputs={"vx": 1.0, "vy": 2.0, "w": 2.0}))
    robot = robot.with_values(M=10.0, J=1.0, Fv=0.0, Fc=0.0, gain=1.0, back_emf=0.0)
    model = (robot + effect_by_id(robot, "sideways_friction")).with_values(
        **{f"sideways_friction.{name}": value for name, value in known.items()}
    )
    log = Log.from_arrays("left", time, forces[:, None] * SIDEWAYS, np.zeros((len(forces), 3)), model)
    (found,) = simulate(model, LogSet([log]))
    return found


def test_a_sideways_motion_ends_where_dry_friction_ends_it():
    """10 kg against 10 N: 20 N for 2 s give 2 m/s, which last for another 2 s; 8 N then move nothing at all."""
    time = 0.02 * np.arange(301)
    found = _to_the_left(np.select([time < 2.0, time < 4.5], [5.0, 0.0], 2.0), coulomb_vy=10.0)
    exact = np.select([time < 2.0, time < 4.0], [time, 4.0 - time], 0.0)
    np.testing.assert_allclose(found[:, 1], exact, atol=0.015)
    np.testing.assert_allclose(found[:, [0, 2]], 0.0, atol=1e-9)


def test_viscous_rollers_slow_what_moves_sideways():
    time = 0.02 * np.arange(301)
    found = _to_the_left(np.full(301, 2.5), viscous_vy=5.0)
    np.testing.assert_allclose(found[:, 1], 2.0 * (1.0 - np.exp(-time / 2.0)), atol=1e-4)


@pytest.mark.parametrize(
    ("robot", "why"),
    [(Omni(), "an axis of its own"), (Pioneer(), "across its first"), (DifferentialDrive(), "across its first")],
)
def test_who_has_no_such_friction(robot, why):
    assert why in str(refusal(SidewaysFriction(), robot))
