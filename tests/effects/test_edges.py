"""Edges of effects: wide while they are searched for, sharp once found."""

import jax.numpy as jnp
import pytest

from jaxid import Omni, Pioneer
from jaxid.effects import catalogue, effect_by_id


@pytest.mark.parametrize("robot", [Pioneer(), Omni()])
def test_a_surface_is_sharp_unless_searched_for(robot):
    found = effect_by_id(robot, "surface_change")
    assert found.sharp == found and found.blurred.sharp == found and found.blurred != found
    model = (robot + found).with_values(**{"surface_change.coulomb": 1.0, "surface_change.offset": 0.5})
    p = {name: jnp.asarray(value) for name, value in model.parameters.numbers.items()}
    levels = tuple((1.0, 1.0) for _ in range(max(robot.drive_axes) + 1))

    def doubled(effect, x):
        """How far friction has risen at x [m]: 0 before the line at 0.5 m, 1 beyond."""
        changed = effect.dry(levels, (), {"x": jnp.asarray(x), "y": jnp.asarray(0.0)}, p, robot)
        return float(changed[robot.drive_axes[0]][1]) - 1.0

    for effect in (found, found.blurred):
        assert doubled(effect, 0.4) < 0.01 and doubled(effect, 0.6) > 0.99
        assert doubled(effect, 0.5) == pytest.approx(0.5)
    assert doubled(found, 0.51) > 0.95 > 0.8 > doubled(found.blurred, 0.51)


@pytest.mark.parametrize(
    ("identifier", "law"), [("actuator_dead_zone", "threshold"), ("freewheeling_driver", "below_a_threshold")]
)
def test_an_edge_in_the_command_is_sharpened_in_steps(identifier, law):
    """Of which each leaves the last one's edge within its own."""
    sharp = effect_by_id(Omni(), identifier, law)
    steps = [sharp.blurred]
    while steps[-1].sharper != steps[-1]:
        steps.append(steps[-1].sharper)
    assert steps[-1] == sharp.sharp == sharp and len(steps) > 2
    assert all(one.edge / other.edge <= 4.0 for one, other in zip(steps, steps[1:], strict=False))


def test_other_effects_have_one_form():
    for effect in catalogue(Pioneer()):
        if not hasattr(effect, "edge"):
            assert effect.blurred is effect and effect.sharp is effect and effect.sharper is effect
