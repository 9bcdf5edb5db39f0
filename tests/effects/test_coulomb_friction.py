"""Dry friction of a robot that has none of its own, on data of an independent simulation with sticking."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, DifferentialDrive, Log, LogSet, explain, output_error
from jaxid.effects.drivetrain import CoulombFriction, StribeckFriction
from jaxid.explanation.search.from_the_back import not_present
from jaxid.robots.effect import EffectError

WITHOUT = Axis().with_values(Fc=0.0).change("Fc", free=False)


def recorded(level, count=5, mass=1.3, viscous=2.1):
    """Speeds by 200 semi-implicit steps a sample, in which friction stops what it can stop."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([5, k])
        u = np.repeat(rng.uniform(-4, 4, 40), 15)
        v, h, found = 0.0, 1e-4, []
        for force in u:
            found.append(v)
            for _ in range(200):
                free = v + h * (force - viscous * v) / mass
                v = np.sign(free) * max(abs(free) - h * level / mass, 0.0)
        outputs = {"v": np.array(found) + 0.004 * rng.normal(size=len(u))}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(len(u)), u[:, None], outputs, AXIS))
    return LogSet(logs[:-2]), LogSet(logs[-2:])


@pytest.mark.slow
def test_dry_friction_is_named_by_its_own_name_with_its_level():
    logs, held_out = recorded(0.6)
    fit = output_error(WITHOUT, logs)
    found = explain(fit, logs, held_out)
    assert (found.verdict, [effect.id for effect in found.effects]) == ("named", ["coulomb_friction"])
    level = found.effects[0].parameters["level"]
    assert level.value == pytest.approx(0.6, abs=4 * level.std_error) and level.std_error < 0.01
    for name, true in (("M", 1.3), ("Fv", 2.1)):
        assert found.final[name].value == pytest.approx(true, abs=4 * found.final[name].std_error)


def test_a_robot_with_dry_friction_of_its_own_cannot_have_it():
    for robot in (Axis(), DifferentialDrive(), Axis().with_values(Fc=0.0)):  # the last: free, and zero by chance
        with pytest.raises(EffectError, match="dry friction of its own"):
            robot + CoulombFriction()
    assert (WITHOUT + CoulombFriction()).effects


def test_what_changes_dry_friction_is_looked_for_once_there_is_some():
    # Not on an axis, whose own offset is an asymmetric friction.
    drive = DifferentialDrive().with_values(Fc=0.0).change("Fc", free=False)
    upon = {"stribeck_friction", "asymmetric_friction"}
    assert not upon & {effect.id for effect in not_present(drive, ())}
    assert upon <= {effect.id for effect in not_present(drive + CoulombFriction(), ())}
    assert upon <= {effect.id for effect in not_present(DifferentialDrive(), ())}
    assert (drive + StribeckFriction()).effects  # who asks for it may have it
